//! Frame ranges and lists of frames as option values.

use crate::scene::anim::MAX_FRAMES;
use std::collections::BTreeSet;

/// Parses first and last frame: `1001-1100`, or one frame.
pub fn frame_range(text: &str) -> Result<(i32, i32), String> {
    let help = || "expected FIRST-LAST or one frame, such as 1001-1100".to_string();
    // The first character may be a sign.
    let dash = text.char_indices().skip(1).find(|(_, c)| *c == '-').map(|(i, _)| i);
    let (first, last) = dash.map_or((text, text), |i| (&text[..i], &text[i + 1..]));
    let (first, last) = (first.parse().map_err(|_| help())?, last.parse().map_err(|_| help())?);
    if first > last {
        return Err(format!("the first frame {first} is after the last frame {last}"));
    }
    Ok((first, last))
}

/// A list of frames of a shot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameList {
    /// The frames in the order of the list, each once.
    pub frames: Vec<i32>,
    /// First and last frame of the shot: the ends of all ranges, whatever their steps.
    pub shot: (i32, i32),
    /// The text of the list.
    pub text: String,
}

impl FrameList {
    /// Whether the list holds every frame of its shot.
    pub fn is_complete(&self) -> bool {
        self.frames.len() as i64 == i64::from(self.shot.1) - i64::from(self.shot.0) + 1
    }
}

/// Parses a list of frames: `1001`, `1001-1100`, every fifth `1001-1100x5` (or `:5`), separated by commas.
pub fn frame_list(text: &str) -> Result<FrameList, String> {
    let mut list = Vec::new();
    let mut shot = (i32::MAX, i32::MIN);
    for part in text.split(',').map(str::trim) {
        let (range, step) = part.split_once(['x', ':']).unwrap_or((part, "1"));
        let (first, last) = frame_range(range)?;
        let step: usize = step
            .parse()
            .ok()
            .filter(|n| *n > 0)
            .ok_or("expected a step of 1 or more, such as 1001-1100x5")?;
        if (i64::from(last) - i64::from(first)) / step as i64 >= MAX_FRAMES - list.len() as i64 {
            return Err(format!("more than {MAX_FRAMES} frames"));
        }
        list.extend((first..=last).step_by(step));
        shot = (shot.0.min(first), shot.1.max(last));
    }
    let mut seen = BTreeSet::new();
    list.retain(|frame| seen.insert(*frame));
    Ok(FrameList { frames: list, shot, text: text.into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_have_signs() {
        assert_eq!(frame_range("1001-1100"), Ok((1001, 1100)));
        assert_eq!(frame_range("-5--2"), Ok((-5, -2)));
        assert_eq!(frame_range("7"), Ok((7, 7)));
        assert!(frame_range("9-7").is_err() && frame_range("a").is_err() && frame_range("").is_err());
    }

    #[test]
    fn lists_have_ranges_and_steps() {
        let list = |text| frame_list(text).map(|list| list.frames);
        assert_eq!(list("7"), Ok(vec![7]));
        assert_eq!(list("-2-1"), Ok(vec![-2, -1, 0, 1]));
        assert_eq!(list("1001-1010x4, 1002,1001"), Ok(vec![1001, 1005, 1009, 1002]));
        assert_eq!(list("-9--1:4"), Ok(vec![-9, -5, -1]));
        for wrong in ["", "1,", "5-1", "1-5x0", "1-5x", "1-5x-1", "x2", "1-5x2x2", "0-2000000000", "one"] {
            assert!(list(wrong).is_err(), "{wrong}");
        }
        assert_eq!(list("-2147483648-2147483647x1000000000").map(|l| l.len()), Ok(5));
        let shot = |text| frame_list(text).map(|list| (list.shot, list.is_complete()));
        assert_eq!(shot("1001-1010x4"), Ok(((1001, 1010), false)));
        assert_eq!(shot("1006-1010,1001-1005"), Ok(((1001, 1010), true)));
    }
}
