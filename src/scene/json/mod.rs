//! JSON input files, read so that one run reports every error with its place in the text.
//!
//! The `serde` structs of a format are its only description. [`document`] parses the text ([`parse`]), checks
//! its shape against the JSON Schema that schemars derives from the structs ([`schema_check`]), and
//! deserialises it; the reader of the format then adds the errors that depend on meaning. The places of the
//! errors in the text are found at the end ([`locate`]), and only if there are errors.

pub mod array;
pub mod buffers;
mod describe;
pub mod diagnostics;
pub mod document;
pub mod former_names;
pub mod key;
pub mod locate;
pub mod packer;
mod parse;
pub mod pretty;
pub mod schema;
mod schema_check;
