//! Bytes of a crate file under bounds checks, with a budget for the memory that reading may take.

use bytemuck::{AnyBitPattern, Pod};
use std::cell::Cell;

/// What is wrong with a file, in words.
pub(super) type Fault<T> = Result<T, String>;

/// The file.
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
        // Several attributes may share one array and compressed arrays grow, so the budget is larger
        // than the file; it only has to be far from all memory.
        let budget = bytes.len().saturating_mul(16).saturating_add(256 << 20);
        Source { bytes, budget: Cell::new(budget) }
    }

    pub fn at(&self, offset: u64) -> Fault<Cursor<'b>> {
        match usize::try_from(offset) {
            Ok(at) if at <= self.bytes.len() => Ok(Cursor { bytes: self.bytes, at }),
            _ => Err(format!("offset {offset} in a file of {} bytes", self.bytes.len())),
        }
    }

    /// Takes the memory of `count` items of `size` bytes from the budget, before it is allocated.
    pub fn charge(&self, count: usize, size: usize) -> Fault<()> {
        let left = count.checked_mul(size).and_then(|len| self.budget.get().checked_sub(len));
        self.budget.set(
            left.ok_or_else(|| format!("{count} items take more memory than a file like this may ask for"))?,
        );
        Ok(())
    }
}

impl<'b> Cursor<'b> {
    pub fn bytes(&mut self, len: usize) -> Fault<&'b [u8]> {
        let end = self.at.checked_add(len).filter(|&end| end <= self.bytes.len());
        let end = end.ok_or_else(|| {
            format!("{len} bytes at offset {} in a file of {} bytes", self.at, self.bytes.len())
        })?;
        let bytes = &self.bytes[self.at..end];
        self.at = end;
        Ok(bytes)
    }

    pub fn value<T: AnyBitPattern>(&mut self) -> Fault<T> {
        Ok(bytemuck::pod_read_unaligned(self.bytes(size_of::<T>())?))
    }

    /// A count or a length.
    pub fn count(&mut self) -> Fault<usize> {
        let count: u64 = self.value()?;
        usize::try_from(count).map_err(|_| format!("a count of {count}"))
    }

    /// `count` items as they lie in memory.
    pub fn items<T: Pod>(&mut self, count: usize, source: &Source) -> Fault<Vec<T>> {
        let len = count.checked_mul(size_of::<T>()).ok_or_else(|| format!("a count of {count}"))?;
        let bytes = self.bytes(len)?;
        source.charge(count, size_of::<T>())?;
        let mut items = vec![T::zeroed(); count];
        bytemuck::cast_slice_mut(&mut items).copy_from_slice(bytes);
        Ok(items)
    }

    /// Bytes behind their length.
    pub fn sized(&mut self) -> Fault<&'b [u8]> {
        let len = self.count()?;
        self.bytes(len)
    }

    /// Moves by the signed distance that stands here, counted from where it stands.
    pub fn follow(&mut self) -> Fault<()> {
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
    fn values_that_share_their_bytes_cannot_ask_for_memory_without_end() {
        let bytes = vec![0u8; 1 << 20];
        let source = Source::new(&bytes);
        let budget = source.budget.get();
        let read =
            (0..10_000).take_while(|_| source.at(0).unwrap().items::<u8>(1 << 20, &source).is_ok()).count();
        assert_eq!(read, budget >> 20);
    }
}
