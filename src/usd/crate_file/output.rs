//! The bytes of a crate file in the making.

use super::format::{BOOTSTRAP_LEN, ValueRep};
use super::integers::compress_ints;
use bytemuck::NoUninit;
use std::borrow::Cow;

/// Arrays of at least this many bytes are borrowed from the layer instead of copied.
const MIN_BORROWED_LEN: usize = 4096;

/// The file as consecutive parts, large arrays borrowed. The bootstrap, which is written last, is counted but
/// missing.
pub(super) struct Output<'a> {
    parts: Vec<Cow<'a, [u8]>>,
    /// Length of the bootstrap and all parts.
    flushed: usize,
    /// The current part.
    buffer: Vec<u8>,
}

impl<'a> Output<'a> {
    pub fn new() -> Self {
        Output { parts: Vec::new(), flushed: BOOTSTRAP_LEN, buffer: Vec::new() }
    }

    /// Offset of the next byte in the file.
    pub fn position(&self) -> usize {
        self.flushed + self.buffer.len()
    }

    /// Pads to a multiple of 8 and returns the offset in the file.
    pub fn align(&mut self) -> u64 {
        let padding = self.position().wrapping_neg() % 8;
        self.buffer.resize(self.buffer.len() + padding, 0);
        self.position() as u64
    }

    pub fn put<T: NoUninit>(&mut self, value: T) {
        self.buffer.extend_from_slice(bytemuck::bytes_of(&value));
    }

    pub fn put_slice<T: NoUninit>(&mut self, items: &[T]) {
        self.buffer.extend_from_slice(bytemuck::cast_slice(items));
    }

    /// Writes a length and the bytes.
    pub fn put_sized(&mut self, bytes: &[u8]) {
        self.put(bytes.len() as u64);
        self.buffer.extend_from_slice(bytes);
    }

    pub fn put_compressed_ints(&mut self, ints: impl Iterator<Item = i32> + Clone) {
        self.put_sized(&compress_ints(ints));
    }

    /// Writes the distance from here to the representation of a nested value, which follows directly.
    pub fn put_rep_distance(&mut self) {
        self.put(size_of::<i64>() as i64);
    }

    /// Writes a count and that many items, aligned; returns the offset.
    pub fn counted<T: NoUninit>(&mut self, items: &[T]) -> u64 {
        let offset = self.align();
        self.put(items.len() as u64);
        self.put_slice(items);
        offset
    }

    /// Writes an array of values.
    pub fn array<T: NoUninit>(&mut self, kind: u8, items: &'a [T]) -> ValueRep {
        if items.is_empty() {
            return ValueRep::array(kind, 0);
        }
        let offset = self.align();
        self.put(items.len() as u64);
        let bytes: &'a [u8] = bytemuck::cast_slice(items);
        if bytes.len() < MIN_BORROWED_LEN {
            self.buffer.extend_from_slice(bytes);
        } else {
            self.flush();
            self.flushed += bytes.len();
            self.parts.push(Cow::Borrowed(bytes));
        }
        ValueRep::array(kind, offset)
    }

    /// The parts after the bootstrap `bootstrap`.
    pub fn finish(mut self, bootstrap: Vec<u8>) -> Vec<Cow<'a, [u8]>> {
        self.flush();
        self.parts.insert(0, Cow::Owned(bootstrap));
        self.parts
    }

    fn flush(&mut self) {
        self.flushed += self.buffer.len();
        self.parts.push(Cow::Owned(std::mem::take(&mut self.buffer)));
    }
}
