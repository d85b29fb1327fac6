//! Little-endian numbers at byte offsets. The caller checks the range against the file's length.

use nalgebra::Vector3;

pub(super) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

pub(super) fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(u32_at(bytes, at))
}

/// Three consecutive f32.
pub(super) fn point_at(bytes: &[u8], at: usize) -> Vector3<f64> {
    Vector3::new(0.0, 4.0, 8.0).map(|k: f64| f64::from(f32_at(bytes, at + k as usize)))
}
