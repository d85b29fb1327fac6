//! USD layers: one model ([`Layer`]) with two encodings, crate (usdc, [`crate_file`]) and text (usda,
//! [`text`]). It has prims, attributes, relationships and arrays, but no notion of hair: `cache` turns hair
//! into layers and back.

pub mod crate_file;
mod layer;
pub mod text;

pub use layer::{Attribute, Layer, Metadata, Prim, Relationship, Specifier, Value};
