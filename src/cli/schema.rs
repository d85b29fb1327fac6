//! `hairbake schema`.

use super::console;
use crate::error::Result;
use crate::scene::{self, Format};
use clap::ValueEnum;

/// The file formats that have a schema.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum SchemaFormat {
    /// groom.json
    Groom,
    /// anim.json
    Anim,
}

/// Prints the schema of a format.
pub fn schema(format: SchemaFormat) -> Result<()> {
    let format = match format {
        SchemaFormat::Groom => Format::Groom,
        SchemaFormat::Anim => Format::Anim,
    };
    console::data(scene::schema(format).as_bytes())
}
