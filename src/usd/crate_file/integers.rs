//! Compression in crate files: LZ4 blocks, and the coding of 32-bit integers that precedes them.
//!
//! Integers are coded as wrapping differences (of the first from 0): the most common difference as i32; two
//! bits per integer, lowest bits first, with the storage of its difference (0: the most common one; 1, 2, 3:
//! i8, i16, i32); the stored differences. The whole is compressed by LZ4.

use std::collections::HashMap;

/// Largest expansion of LZ4: bytes of output per byte of a block.
const LZ4_MAX_RATIO: usize = 255;

/// One LZ4 block after the number of further chunks, which is 0: tables stay far below the 2 GB at which a
/// second chunk begins.
pub(super) fn compress(bytes: &[u8]) -> Vec<u8> {
    [&[0], lz4_flex::block::compress(bytes).as_slice()].concat()
}

/// The inverse of [`compress`]. An error if the result exceeds `max_len`.
pub(super) fn decompress(block: &[u8], max_len: usize) -> Result<Vec<u8>, String> {
    let (&further_chunks, block) = block.split_first().ok_or("a compressed block is empty")?;
    if further_chunks != 0 {
        return Err("compressed blocks of several chunks are not supported".into());
    }
    let mut out = vec![0; max_len.min(block.len().saturating_mul(LZ4_MAX_RATIO))];
    let len = lz4_flex::block::decompress_into(block, &mut out).map_err(|e| e.to_string())?;
    out.truncate(len);
    Ok(out)
}

/// Codes and compresses integers.
pub(super) fn compress_ints(ints: impl Iterator<Item = i32> + Clone) -> Vec<u8> {
    let mut previous = 0i32;
    let deltas: Vec<i32> = ints.map(|i| i.wrapping_sub(std::mem::replace(&mut previous, i))).collect();
    // Without integers USD reads no most common difference.
    let Some(common) = most_common(&deltas) else { return compress(&[]) };

    let mut coded = Vec::with_capacity(max_coded_len(deltas.len()));
    coded.extend_from_slice(&common.to_le_bytes());
    coded.resize(4 + deltas.len().div_ceil(4), 0);
    for (i, &delta) in deltas.iter().enumerate() {
        let code = if delta == common {
            0
        } else if let Ok(small) = i8::try_from(delta) {
            coded.extend_from_slice(&small.to_le_bytes());
            1
        } else if let Ok(medium) = i16::try_from(delta) {
            coded.extend_from_slice(&medium.to_le_bytes());
            2
        } else {
            coded.extend_from_slice(&delta.to_le_bytes());
            3
        };
        coded[4 + i / 4] |= code << (2 * (i % 4));
    }
    compress(&coded)
}

/// The inverse of [`compress_ints`]. `count` comes from the file: memory for the integers is allocated only
/// after the decompressed bytes are known to have a code for each.
pub(super) fn decompress_ints(block: &[u8], count: usize) -> Result<Vec<i32>, String> {
    if count == 0 {
        return Ok(Vec::new());
    }
    let coded = decompress(block, max_coded_len(count))?;
    let too_short = || format!("{count} integers do not fit into {} bytes", coded.len());
    let (common, rest) = coded.split_first_chunk::<4>().ok_or_else(too_short)?;
    let common = i32::from_le_bytes(*common);
    let (codes, mut stored) = rest.split_at_checked(count.div_ceil(4)).ok_or_else(too_short)?;

    let mut ints = Vec::with_capacity(count);
    let mut value = 0i32;
    for i in 0..count {
        let delta = match codes[i / 4] >> (2 * (i % 4)) & 3 {
            0 => common,
            1 => i8::from_le_bytes(take(&mut stored).ok_or_else(too_short)?).into(),
            2 => i16::from_le_bytes(take(&mut stored).ok_or_else(too_short)?).into(),
            _ => i32::from_le_bytes(take(&mut stored).ok_or_else(too_short)?),
        };
        value = value.wrapping_add(delta);
        ints.push(value);
    }
    Ok(ints)
}

/// Largest coded length of `count` integers before LZ4, bytes.
pub(super) fn max_coded_len(count: usize) -> usize {
    4usize.saturating_add(count.div_ceil(4)).saturating_add(count.saturating_mul(4))
}

/// The most common value; the largest of equally common ones, so that the bytes are deterministic.
fn most_common(deltas: &[i32]) -> Option<i32> {
    let mut counts: HashMap<i32, usize> = HashMap::new();
    let counted = deltas.iter().map(|&delta| {
        let count = counts.entry(delta).or_insert(0);
        *count += 1;
        (*count, delta)
    });
    counted.max().map(|(_, delta)| delta)
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (head, tail) = bytes.split_first_chunk()?;
    *bytes = tail;
    Some(*head)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn coding_follows_the_specification() {
        // Differences 123, 1, 200, -70000; the most common is the largest of equals: 200.
        let block = compress_ints([123, 124, 324, -69676].into_iter());
        let coded = decompress(&block, 100).unwrap();
        let mut expected = vec![200, 0, 0, 0, 0b11_00_01_01, 123, 1];
        expected.extend_from_slice(&(-70_000i32).to_le_bytes());
        assert_eq!(coded, expected);
    }

    #[test]
    fn count_beyond_the_block_is_an_error_before_allocation() {
        let block = compress_ints([1, 2, 3].into_iter());
        for count in [100, usize::MAX] {
            assert!(decompress_ints(&block, count).is_err());
        }
    }

    proptest! {
        #[test]
        fn integers_round_trip(ints in prop::collection::vec(prop_oneof![any::<i32>(), -300..300i32, Just(7)], 0..300)) {
            let block = compress_ints(ints.iter().copied());
            prop_assert_eq!(decompress_ints(&block, ints.len()).unwrap(), ints);
        }

        #[test]
        fn any_bytes_are_decoded_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..200), count in 0..1000usize) {
            let _ = decompress_ints(&bytes, count);
        }
    }
}
