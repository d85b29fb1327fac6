//! Arrays of numbers in a file: in the JSON itself, or in a binary buffer next to it (as in glTF).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A binary file next to the JSON file: little-endian numbers, no header.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct BufferFile {
    /// Name of the file, in the folder of the JSON file: a plain file name without path or scheme.
    pub uri: String,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// SHA-256 of the file, hexadecimal. Checked if given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

/// Type of an element: scalar type, and number of components if there are several.
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
    /// The buffer: index into `buffers`.
    pub buffer: u32,
    /// Offset of the first element in the buffer, bytes. Default 0.
    #[serde(default)]
    pub offset: u64,
    /// Number of elements.
    pub count: u64,
    /// Type of an element, such as `f32x3`. Must have as many components as the key expects.
    #[serde(rename = "type")]
    pub element: ElementType,
}

/// An array of numbers: nested JSON arrays, or a view of a binary buffer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Array<T> {
    /// The elements themselves.
    Inline(Vec<T>),
    /// The elements are in a binary buffer.
    View(View),
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(elements: Vec<T>) -> Self {
        Array::Inline(elements)
    }
}

/// Scalar type of a buffer's elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
    /// Signed 32-bit integer.
    I32,
    /// Unsigned 32-bit integer.
    U32,
}

impl Scalar {
    /// Bytes of one number.
    pub fn size(self) -> usize {
        if self == Scalar::F64 { 8 } else { 4 }
    }
}

impl ElementType {
    /// Scalar type and number of components.
    pub fn parts(self) -> (Scalar, usize) {
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

    /// Its name in a file.
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// An element of an [`Array`].
pub trait Element: Copy {
    /// The types it is read from; the first is the type it is written as.
    const TYPES: &[ElementType];
    /// The element with these components; `None` if a component is out of its range.
    fn from_components(components: &[f64]) -> Option<Self>;
    /// Its components.
    fn components(&self) -> impl Iterator<Item = f64>;
}

impl Element for f64 {
    const TYPES: &[ElementType] = &[ElementType::F64, ElementType::F32];
    fn from_components(components: &[f64]) -> Option<Self> {
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
        _ => panic!("no element type has this many components"),
    };
    fn from_components(components: &[f64]) -> Option<Self> {
        components.try_into().ok().filter(|v: &[f64; N]| v.iter().all(|x| x.is_finite()))
    }
    fn components(&self) -> impl Iterator<Item = f64> {
        self.iter().copied()
    }
}

impl Element for i32 {
    const TYPES: &[ElementType] = &[ElementType::I32, ElementType::U32];
    fn from_components(components: &[f64]) -> Option<Self> {
        components.first().filter(|&&x| x <= i32::MAX.into()).map(|&x| x as i32)
    }
    fn components(&self) -> impl Iterator<Item = f64> {
        std::iter::once(f64::from(*self))
    }
}

impl Element for u32 {
    const TYPES: &[ElementType] = &[ElementType::U32, ElementType::I32];
    fn from_components(components: &[f64]) -> Option<Self> {
        components.first().filter(|&&x| x >= 0.0).map(|&x| x as u32)
    }
    fn components(&self) -> impl Iterator<Item = f64> {
        std::iter::once(f64::from(*self))
    }
}
