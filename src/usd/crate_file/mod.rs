//! The crate (usdc) encoding, version 0.8.0: writer and reader.
//!
//! A crate file consists of a bootstrap, the values that do not fit into a `ValueRep`, six tables (sections),
//! and a table of contents. All numbers are little endian. Sources: AOUSD Core Specification 1.0.1 (2025),
//! "Crate file format", and the behaviour of Pixar's usd-core 26.11.
//!
//! - A *token* is an interned string; a *string* is an index into the tokens through a second table.
//! - A *field* is a (name token, value) pair; a *field set* is a run of field indices that ends in −1; a
//!   *spec* is (path, field set, kind). Equal fields and equal field sets are stored once.
//! - Paths form a tree in pre-order; see `Jump`. Targets of relationships and connections are in the tree as
//!   well, with or without a spec in this file.

mod decode;
mod encode;
mod format;
mod integers;
mod output;
mod source;
mod tables;

pub use decode::decode;
pub use encode::encode;
