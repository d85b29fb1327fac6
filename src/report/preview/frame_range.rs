//! Selections of frames.

/// `count` evenly spaced frames from `first` to `last`, both included; fewer if the range is shorter.
pub fn spread((first, last): (i32, i32), count: usize) -> Vec<i32> {
    let span = f64::from(last) - f64::from(first);
    let gaps = count.saturating_sub(1).max(1) as f64;
    let mut frames: Vec<i32> =
        (0..count).map(|k| (f64::from(first) + span * k as f64 / gaps).round() as i32).collect();
    frames.dedup();
    frames
}

/// At most `count` of `frames`, evenly spaced.
pub(super) fn spread_over(frames: &[i32], count: usize) -> impl Iterator<Item = i32> + '_ {
    let last = frames.len() as i32 - 1;
    spread((0, last.max(0)), count).into_iter().filter_map(|k| frames.get(k as usize).copied())
}
