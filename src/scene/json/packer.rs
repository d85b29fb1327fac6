//! Arrays on their way to a file: short ones stay in the JSON, long ones go to a binary buffer.

use super::array::{Array, BufferFile, Element, ElementType, Scalar, View};
use crate::error::Result;
use crate::file::write_file;
use std::ffi::{OsStr, OsString};
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

    /// Writes the buffer next to the JSON file `path`, as its [`buffer_name`], and returns its description. Writes
    /// nothing if the buffer is empty.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(self, path: &Path) -> Result<Vec<BufferFile>> {
        if self.bytes.is_empty() {
            return Ok(Vec::new());
        }
        let written = write_file(&path.with_file_name(buffer_name(path)), &[self.bytes])?;
        Ok(vec![BufferFile { uri: written.file, bytes: written.bytes, sha256: Some(written.sha256) }])
    }
}

/// Name of the buffer of the JSON file `path`: that of the file with `.bin` for its ending `.json`, and any other with
/// `.buffer.bin` behind it. Files of different names have buffers of different names.
fn buffer_name(path: &Path) -> OsString {
    match path.extension() {
        Some(ending) if ending == "json" => path.with_extension("bin").file_name().unwrap_or_default().into(),
        _ => [path.file_name().unwrap_or_default(), OsStr::new(".buffer.bin")].into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_differ_in_any_part_of_their_names_have_buffers_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["a.json", "a", "a.v1", "a.v2", "a.v1.json", "a.bin", "a.JSON"];
        let write = |(i, name): (usize, &&str)| {
            let mut packer = Packer::default();
            packer.array(vec![i as f64; 65]);
            packer.write(&folder.path().join(name)).unwrap().remove(0)
        };
        let buffers: Vec<BufferFile> = files.iter().enumerate().map(write).collect();
        assert_eq!([&buffers[0], &buffers[2]].map(|b| &b.uri[..]), ["a.bin", "a.v1.buffer.bin"]);
        for (i, buffer) in buffers.iter().enumerate() {
            let bytes = std::fs::read(folder.path().join(&buffer.uri)).unwrap();
            assert_eq!(bytes, vec![i as f64; 65].iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
        }
    }
}
