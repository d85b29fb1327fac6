//! Arrays on their way to a file: short ones stay in the JSON, long ones go to a binary buffer.

use super::array::{Array, BufferFile, Element, ElementType, Scalar, View};
use crate::error::Result;
use crate::file::write_file;
use std::path::Path;

/// Collects the long arrays of a file in one buffer.
#[derive(Debug, Default)]
pub struct Packer {
    bytes: Vec<u8>,
}

impl Packer {
    /// Arrays of up to this many numbers stay in the JSON.
    const MAX_INLINE: usize = 64;

    /// `elements` as they are written, floats as f64.
    pub fn array<T: Element>(&mut self, elements: Vec<T>) -> Array<T> {
        self.pack(elements, T::TYPES[0])
    }

    /// `elements` as they are written, floats as f32.
    pub fn array_f32<T: Element>(&mut self, elements: Vec<T>) -> Array<T> {
        self.pack(elements, T::TYPES[1])
    }

    fn pack<T: Element>(&mut self, elements: Vec<T>, element: ElementType) -> Array<T> {
        let (scalar, width) = element.parts();
        if elements.len() * width <= Self::MAX_INLINE {
            return Array::Inline(elements);
        }
        let view = View { buffer: 0, offset: self.bytes.len() as u64, count: elements.len() as u64, element };
        for x in elements.iter().flat_map(Element::components) {
            match scalar {
                Scalar::F32 => self.bytes.extend((x as f32).to_le_bytes()),
                Scalar::F64 => self.bytes.extend(x.to_le_bytes()),
                Scalar::I32 => self.bytes.extend((x as i32).to_le_bytes()),
                Scalar::U32 => self.bytes.extend((x as u32).to_le_bytes()),
            }
        }
        Array::View(view)
    }

    /// Writes the buffer next to the JSON file `path`, under its name with the ending `.bin`, and returns its
    /// description. Writes nothing if the buffer is empty.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(self, path: &Path) -> Result<Vec<BufferFile>> {
        if self.bytes.is_empty() {
            return Ok(Vec::new());
        }
        let buffer = path.with_extension("bin");
        let written = write_file(&buffer, &[self.bytes])?;
        Ok(vec![BufferFile { uri: written.file, bytes: written.bytes, sha256: Some(written.sha256) }])
    }
}
