//! USD layers: one model ([`Layer`]), two encodings, crate (usdc, [`crate_file`]) and text (usda,
//! [`text`]). Knows prims, attributes, relationships and arrays, not hair.

pub mod crate_file;
mod layer;
pub mod text;

pub use layer::{Attribute, Layer, Metadata, Prim, Relationship, Specifier, Value};
