//! Arrays of numbers in a file: in the JSON itself, or in a binary buffer beside it (as glTF does).

use super::{Faults, Key};
use crate::error::Result;
use crate::file::{is_plain_name, read_file, sha256, write_file};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Faulty elements of one array that are reported one by one.
const MAX_PER_ARRAY: usize = 4;

/// A binary file beside the JSON: numbers, little-endian, no header.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct BufferFile {
    /// Name of the file, in the folder of the JSON: a plain file name, no path, no scheme.
    pub uri: String,
    /// Size of the file in bytes.
    pub bytes: u64,
    /// SHA-256 of the file in hexadecimal; checked where given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

/// Type of one element of a view: scalar type and number of components.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum ElementType {
    F32,
    F32x2,
    F32x3,
    F32x4,
    F64,
    F64x2,
    F64x3,
    F64x4,
    I32,
    U32,
}

/// An array in a binary buffer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct View {
    /// Index into `buffers`.
    pub buffer: u32,
    /// Where it starts in the buffer, bytes; default 0.
    #[serde(default)]
    pub offset: u64,
    /// Number of elements.
    pub count: u64,
    /// Type of an element, such as `f32x3`; its components must be those of the place.
    #[serde(rename = "type")]
    pub element: ElementType,
}

/// An array of numbers: nested JSON arrays, or a view of a binary buffer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Array<T> {
    /// The elements themselves.
    Inline(Vec<T>),
    /// Where they lie.
    View(View),
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(elements: Vec<T>) -> Self {
        Array::Inline(elements)
    }
}

/// Scalar types of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scalar {
    F32,
    F64,
    I32,
    U32,
}

impl ElementType {
    fn parts(self) -> (Scalar, usize) {
        use ElementType::*;
        match self {
            F32 => (Scalar::F32, 1),
            F32x2 => (Scalar::F32, 2),
            F32x3 => (Scalar::F32, 3),
            F32x4 => (Scalar::F32, 4),
            F64 => (Scalar::F64, 1),
            F64x2 => (Scalar::F64, 2),
            F64x3 => (Scalar::F64, 3),
            F64x4 => (Scalar::F64, 4),
            I32 => (Scalar::I32, 1),
            U32 => (Scalar::U32, 1),
        }
    }

    /// Name as it stands in a file.
    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// What an [`Array`] can hold.
pub trait Element: Copy {
    /// Type it is written as, and types it is read from.
    const TYPES: &[ElementType];
    /// The element from its components; `None` where a number does not fit.
    fn gather(components: &[f64]) -> Option<Self>;
    /// Its components.
    fn components(&self) -> impl Iterator<Item = f64>;
}

impl Element for f64 {
    const TYPES: &[ElementType] = &[ElementType::F64, ElementType::F32];
    fn gather(components: &[f64]) -> Option<Self> {
        components.first().copied().filter(|x| x.is_finite())
    }
    fn components(&self) -> impl Iterator<Item = f64> {
        std::iter::once(*self)
    }
}

impl<const N: usize> Element for [f64; N] {
    const TYPES: &[ElementType] = match N {
        2 => &[ElementType::F64x2, ElementType::F32x2],
        3 => &[ElementType::F64x3, ElementType::F32x3],
        4 => &[ElementType::F64x4, ElementType::F32x4],
        _ => panic!("no element type of this many components"),
    };
    fn gather(components: &[f64]) -> Option<Self> {
        components.try_into().ok().filter(|v: &[f64; N]| v.iter().all(|x| x.is_finite()))
    }
    fn components(&self) -> impl Iterator<Item = f64> {
        self.iter().copied()
    }
}

impl Element for i32 {
    const TYPES: &[ElementType] = &[ElementType::I32, ElementType::U32];
    fn gather(components: &[f64]) -> Option<Self> {
        components.first().filter(|&&x| x <= i32::MAX.into()).map(|&x| x as i32)
    }
    fn components(&self) -> impl Iterator<Item = f64> {
        std::iter::once(f64::from(*self))
    }
}

impl Element for u32 {
    const TYPES: &[ElementType] = &[ElementType::U32, ElementType::I32];
    fn gather(components: &[f64]) -> Option<Self> {
        components.first().filter(|&&x| x >= 0.0).map(|&x| x as u32)
    }
    fn components(&self) -> impl Iterator<Item = f64> {
        std::iter::once(f64::from(*self))
    }
}

/// The buffers of a file, read. A buffer that could not be read is `None`; its fault is noted.
pub struct Buffers(Vec<Option<Vec<u8>>>);

impl Buffers {
    /// Reads the buffers that `files` names from `folder`, and checks their sizes and sums.
    pub fn read(files: &[BufferFile], folder: &Path, faults: &mut Faults) -> Self {
        let mut read = |(i, file): (usize, &BufferFile)| {
            let key = Key::at("buffers").index(i);
            read_buffer(file, folder).map_err(|(name, what, allowed, remedy)| {
                faults.add(&key.name(name), what, allowed, remedy);
            })
        };
        Buffers(files.iter().enumerate().map(|b| read(b).ok()).collect())
    }

    /// The elements of `array`, which stands at `key`. `None` if it is not sound; the faults are noted.
    pub fn load<T: Element>(&self, array: Array<T>, key: &Key, faults: &mut Faults) -> Option<Vec<T>> {
        match array {
            Array::Inline(elements) => Some(elements),
            Array::View(view) => self.view(&view, key, faults),
        }
    }

    fn view<T: Element>(&self, view: &View, key: &Key, faults: &mut Faults) -> Option<Vec<T>> {
        let Some(buffer) = self.0.get(view.buffer as usize) else {
            let allowed = format!("index of one of {} buffers", self.0.len());
            faults.add(&key.name("buffer"), format!("is {}", view.buffer), allowed, "correct the index");
            return None;
        };
        if !T::TYPES.contains(&view.element) {
            let allowed =
                T::TYPES.iter().map(|t| format!("\"{}\"", t.name())).collect::<Vec<_>>().join(" or ");
            let what = format!("is \"{}\"", view.element.name());
            faults.add(&key.name("type"), what, allowed, "write the array in one of these types");
            return None;
        }
        let buffer = buffer.as_ref()?;
        let (scalar, width) = view.element.parts();
        let size = if scalar == Scalar::F64 { 8 } else { 4 };
        let end = view.count.checked_mul((size * width) as u64).and_then(|n| n.checked_add(view.offset));
        let Some(end) = end.filter(|&end| end <= buffer.len() as u64) else {
            let what = format!("is {}: the view ends beyond its buffer", view.count);
            let allowed = format!("offset + count × {} ≤ {} bytes", size * width, buffer.len());
            faults.add(
                &key.name("count"),
                what,
                allowed,
                "correct offset and count, or write the whole buffer",
            );
            return None;
        };
        let bytes = &buffer[view.offset as usize..end as usize];
        let mut elements = Vec::with_capacity(view.count as usize);
        let mut components = [0.0; 4];
        let mut bad = 0;
        for (i, element) in bytes.chunks_exact(size * width).enumerate() {
            for (x, bytes) in components.iter_mut().zip(element.chunks_exact(size)) {
                *x = decode(scalar, bytes);
            }
            match T::gather(&components[..width]) {
                Some(element) => elements.push(element),
                None => {
                    bad += 1;
                    if bad <= MAX_PER_ARRAY {
                        let what = format!("is {:?} in the buffer", &components[..width]);
                        faults.add(&key.index(i), what, allowed::<T>(), "write finite numbers of this range");
                    }
                }
            }
        }
        if bad > MAX_PER_ARRAY {
            faults.add(
                key,
                format!("has {bad} such elements in all"),
                allowed::<T>(),
                "write the buffer anew",
            );
        }
        (bad == 0).then_some(elements)
    }
}

/// Numbers that an element may hold, in words.
fn allowed<T: Element>() -> &'static str {
    match T::TYPES[0] {
        ElementType::I32 => "a signed 32-bit integer",
        ElementType::U32 => "a non-negative integer",
        _ => "finite numbers (no NaN, no infinity)",
    }
}

fn decode(scalar: Scalar, bytes: &[u8]) -> f64 {
    match (scalar, bytes) {
        (Scalar::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
        (Scalar::I32, &[a, b, c, d]) => i32::from_le_bytes([a, b, c, d]).into(),
        (Scalar::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]).into(),
        (Scalar::F64, &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => unreachable!("chunks are as wide as their scalar"),
    }
}

/// Property at fault, what is wrong, what is allowed, remedy.
type BufferFault = (&'static str, String, String, &'static str);

fn read_buffer(file: &BufferFile, folder: &Path) -> std::result::Result<Vec<u8>, BufferFault> {
    if !is_plain_name(&file.uri) {
        let allowed = "a plain file name: no folder, no \"..\", no scheme".into();
        return Err(("uri", format!("is \"{}\"", file.uri), allowed, "put the buffer beside the JSON file"));
    }
    let path = folder.join(&file.uri);
    let unreadable = |e: std::io::Error| {
        (
            "uri",
            format!("\"{}\" cannot be read: {e}", file.uri),
            "a readable file".into(),
            "put the buffer there",
        )
    };
    let size = std::fs::metadata(&path).map_err(unreadable)?.len();
    if size != file.bytes {
        let what = format!("is {} but \"{}\" has {size} bytes", file.bytes, file.uri);
        return Err(("bytes", what, "the size of the file".into(), "write JSON and buffer together"));
    }
    let bytes = read_file(&path).map_err(unreadable)?;
    if let Some(wanted) = &file.sha256 {
        let found = sha256(&bytes);
        if !found.eq_ignore_ascii_case(wanted) {
            let what = format!("does not match \"{}\", whose sum is {found}", file.uri);
            return Err(("sha256", what, "the SHA-256 of the file".into(), "write JSON and buffer together"));
        }
    }
    Ok(bytes)
}

/// Collects arrays for a file: short ones stay in the JSON, long ones go to a binary buffer.
#[derive(Debug, Default)]
pub struct Packer {
    bytes: Vec<u8>,
}

impl Packer {
    /// Arrays of up to this many numbers stay in the JSON.
    const INLINE: usize = 64;

    /// `elements` as they will stand in the file, floats as f64.
    pub fn array<T: Element>(&mut self, elements: Vec<T>) -> Array<T> {
        self.pack(elements, T::TYPES[0])
    }

    /// `elements` as they will stand in the file, floats as f32.
    pub fn array_f32<T: Element>(&mut self, elements: Vec<T>) -> Array<T> {
        self.pack(elements, T::TYPES[1])
    }

    fn pack<T: Element>(&mut self, elements: Vec<T>, element: ElementType) -> Array<T> {
        let (scalar, width) = element.parts();
        if elements.len() * width <= Self::INLINE {
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

    /// Writes the buffer beside the JSON file `path`, as `stem.bin`, and describes it; nothing to write, no buffer.
    pub fn write(self, path: &Path) -> Result<Vec<BufferFile>> {
        if self.bytes.is_empty() {
            return Ok(Vec::new());
        }
        let buffer = path.with_extension("bin");
        let written = write_file(&buffer, &[self.bytes])?;
        Ok(vec![BufferFile { uri: written.file, bytes: written.bytes, sha256: Some(written.sha256) }])
    }
}
