//! Binary buffers of a file: checked, read, and decoded into arrays.

use super::array::{Array, BufferFile, Element, ElementType, Scalar, View};
use super::diagnostics::Diagnostics;
use super::key::Key;
use crate::file::{is_plain_name, read_file, sha256};
use std::path::Path;

/// Most bad elements of one array that are reported one by one.
const MAX_PER_ARRAY: usize = 4;

/// The buffers of a file. `None`: a buffer that could not be read; its error is reported.
pub struct Buffers(Vec<Option<Vec<u8>>>);

impl Buffers {
    /// Reads the buffers `files` from `folder` and checks their sizes and checksums.
    pub fn read(files: &[BufferFile], folder: &Path, diagnostics: &mut Diagnostics) -> Self {
        let mut read = |(i, file): (usize, &BufferFile)| {
            let key = Key::at("buffers").index(i);
            read_buffer(file, folder).map_err(|e| {
                diagnostics.add(&key.name(e.property), e.message, e.allowed, e.help);
            })
        };
        Buffers(files.iter().enumerate().map(|b| read(b).ok()).collect())
    }

    /// The elements of `array`, the value of `key`. Reports errors and returns `None` if it is not valid.
    pub fn load<T: Element>(
        &self,
        array: Array<T>,
        key: &Key,
        diagnostics: &mut Diagnostics,
    ) -> Option<Vec<T>> {
        match array {
            Array::Inline(elements) => Some(elements),
            Array::View(view) => decode(self.bytes::<T>(&view, key, diagnostics)?, &view, key, diagnostics),
        }
    }

    /// The bytes of `view`, which must have the element type of `T`.
    fn bytes<T: Element>(&self, view: &View, key: &Key, diagnostics: &mut Diagnostics) -> Option<&[u8]> {
        let Some(buffer) = self.0.get(view.buffer as usize) else {
            let message = format!("there is no buffer {}", view.buffer);
            let allowed = match self.0.len() {
                0 => "no index: \"buffers\" is empty".into(),
                n => format!("an index into \"buffers\", below {n}"),
            };
            diagnostics.add(&key.name("buffer"), message, allowed, "correct the index");
            return None;
        };
        if !T::TYPES.contains(&view.element) {
            let names: Vec<_> = T::TYPES.iter().map(|t| format!("\"{}\"", t.name())).collect();
            let message = format!("wrong element type: \"{}\"", view.element.name());
            let help = "write the array in an allowed type";
            diagnostics.add(&key.name("type"), message, names.join(" or "), help);
            return None;
        }
        let buffer = buffer.as_ref()?;
        let (scalar, width) = view.element.parts();
        let size = scalar.size() * width;
        let end = view.count.checked_mul(size as u64).and_then(|n| n.checked_add(view.offset));
        let Some(end) = end.filter(|&end| end <= buffer.len() as u64) else {
            let message = format!("{} elements reach beyond the end of the buffer", view.count);
            let allowed = format!("offset + count × {size} ≤ {} bytes", buffer.len());
            let help = "correct offset and count, or write the whole buffer";
            diagnostics.add(&key.name("count"), message, allowed, help);
            return None;
        };
        Some(&buffer[view.offset as usize..end as usize])
    }
}

/// The elements in the `bytes` of `view`.
fn decode<T: Element>(bytes: &[u8], view: &View, key: &Key, diagnostics: &mut Diagnostics) -> Option<Vec<T>> {
    let (scalar, width) = view.element.parts();
    let mut elements = Vec::with_capacity(view.count as usize);
    let mut components = [0.0; 4];
    let mut bad = 0;
    for (i, element) in bytes.chunks_exact(scalar.size() * width).enumerate() {
        for (x, bytes) in components.iter_mut().zip(element.chunks_exact(scalar.size())) {
            *x = number(scalar, bytes);
        }
        match T::from_components(&components[..width]) {
            Some(element) => elements.push(element),
            None => {
                bad += 1;
                if bad <= MAX_PER_ARRAY {
                    let message = format!("invalid value in the buffer: {:?}", &components[..width]);
                    diagnostics.add(&key.index(i), message, allowed::<T>(), "correct the value");
                }
            }
        }
    }
    if bad > MAX_PER_ARRAY {
        let message = format!("{bad} elements are invalid");
        diagnostics.add(key, message, allowed::<T>(), "write the buffer again");
    }
    (bad == 0).then_some(elements)
}

/// The numbers that an element may hold, in words.
fn allowed<T: Element>() -> &'static str {
    match T::TYPES[0] {
        ElementType::I32 => "a signed 32-bit integer",
        ElementType::U32 => "a non-negative integer",
        _ => "finite numbers (no NaN, no infinity)",
    }
}

fn number(scalar: Scalar, bytes: &[u8]) -> f64 {
    match (scalar, bytes) {
        (Scalar::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
        (Scalar::I32, &[a, b, c, d]) => i32::from_le_bytes([a, b, c, d]).into(),
        (Scalar::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]).into(),
        (Scalar::F64, &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => unreachable!("a chunk has the size of its scalar"),
    }
}

/// Why a buffer could not be read.
struct BufferError {
    /// The property of the [`BufferFile`] that is wrong.
    property: &'static str,
    message: String,
    allowed: &'static str,
    help: &'static str,
}

fn read_buffer(file: &BufferFile, folder: &Path) -> Result<Vec<u8>, BufferError> {
    let name = &file.uri;
    let error = |property, message, allowed, help| BufferError { property, message, allowed, help };
    if !is_plain_name(name) {
        let allowed = "a plain file name: no folder, no \"..\", no scheme";
        return Err(error(
            "uri",
            format!("\"{name}\" is a path"),
            allowed,
            "put the buffer next to the JSON file",
        ));
    }
    let path = folder.join(name);
    let unreadable = |e: std::io::Error| {
        let message = format!("cannot read \"{name}\": {e}");
        error("uri", message, "a readable file", "put the buffer next to the JSON file")
    };
    let written_together = "write the JSON file and the buffer together";
    let size = std::fs::metadata(&path).map_err(unreadable)?.len();
    if size != file.bytes {
        let message = format!("{} bytes expected, but \"{name}\" has {size}", file.bytes);
        return Err(error("bytes", message, "the size of the file, bytes", written_together));
    }
    let bytes = read_file(&path).map_err(unreadable)?;
    if let Some(expected) = &file.sha256 {
        let found = sha256(&bytes);
        if !found.eq_ignore_ascii_case(expected) {
            let message = format!("checksum mismatch: \"{name}\" has {found}");
            return Err(error("sha256", message, "the SHA-256 of the file", written_together));
        }
    }
    Ok(bytes)
}
