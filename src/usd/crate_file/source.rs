//! Bounds-checked reading of a crate file, with a budget for the memory that decoding may take.

use bytemuck::{AnyBitPattern, Pod};
use std::cell::Cell;

/// A decoded value, or a description of the damage.
pub(super) type Decoded<T> = Result<T, String>;

/// The bytes of the file.
pub(super) struct Source<'b> {
    bytes: &'b [u8],
    budget: Cell<usize>,
}

/// A reading position in the file.
pub(super) struct Cursor<'b> {
    bytes: &'b [u8],
    at: usize,
}

impl<'b> Source<'b> {
    pub fn new(bytes: &'b [u8]) -> Self {
        // Attributes may share an array and compressed arrays expand, so the budget exceeds the length of the
        // file. It only has to prevent exhaustion of memory.
        let budget = bytes.len().saturating_mul(16).saturating_add(256 << 20);
        Source { bytes, budget: Cell::new(budget) }
    }

    pub fn at(&self, offset: u64) -> Decoded<Cursor<'b>> {
        match usize::try_from(offset) {
            Ok(at) if at <= self.bytes.len() => Ok(Cursor { bytes: self.bytes, at }),
            _ => Err(format!("offset {offset} in a file of {} bytes", self.bytes.len())),
        }
    }

    /// Deducts the memory of `count` items of `size` bytes from the budget. To be called before allocating
    /// it.
    pub fn charge(&self, count: usize, size: usize) -> Decoded<()> {
        let left = count.checked_mul(size).and_then(|len| self.budget.get().checked_sub(len));
        self.budget.set(
            left.ok_or_else(|| format!("{count} items exceed the memory budget for a file of this length"))?,
        );
        Ok(())
    }
}

impl<'b> Cursor<'b> {
    pub fn bytes(&mut self, len: usize) -> Decoded<&'b [u8]> {
        let end = self.at.checked_add(len).filter(|&end| end <= self.bytes.len());
        let end = end.ok_or_else(|| {
            format!("{len} bytes at offset {} in a file of {} bytes", self.at, self.bytes.len())
        })?;
        let bytes = &self.bytes[self.at..end];
        self.at = end;
        Ok(bytes)
    }

    pub fn value<T: AnyBitPattern>(&mut self) -> Decoded<T> {
        Ok(bytemuck::pod_read_unaligned(self.bytes(size_of::<T>())?))
    }

    /// A count or a length.
    pub fn count(&mut self) -> Decoded<usize> {
        let count: u64 = self.value()?;
        usize::try_from(count).map_err(|_| format!("a count of {count}"))
    }

    /// `count` items in their memory layout.
    pub fn items<T: Pod>(&mut self, count: usize, source: &Source) -> Decoded<Vec<T>> {
        let len = count.checked_mul(size_of::<T>()).ok_or_else(|| format!("a count of {count}"))?;
        let bytes = self.bytes(len)?;
        source.charge(count, size_of::<T>())?;
        let mut items = vec![T::zeroed(); count];
        bytemuck::cast_slice_mut(&mut items).copy_from_slice(bytes);
        Ok(items)
    }

    /// A length, and that many bytes.
    pub fn sized(&mut self) -> Decoded<&'b [u8]> {
        let len = self.count()?;
        self.bytes(len)
    }

    /// Reads a signed distance and moves by it, relative to its own position.
    pub fn follow(&mut self) -> Decoded<()> {
        let from = self.at;
        let distance: i64 = self.value()?;
        self.at = i64::try_from(from)
            .ok()
            .and_then(|from| from.checked_add(distance))
            .and_then(|at| usize::try_from(at).ok())
            .filter(|&at| at <= self.bytes.len())
            .ok_or_else(|| format!("a jump of {distance} from offset {from}"))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_values_are_limited_by_the_memory_budget() {
        let bytes = vec![0u8; 1 << 20];
        let source = Source::new(&bytes);
        let budget = source.budget.get();
        let read =
            (0..10_000).take_while(|_| source.at(0).unwrap().items::<u8>(1 << 20, &source).is_ok()).count();
        assert_eq!(read, budget >> 20);
    }
}
