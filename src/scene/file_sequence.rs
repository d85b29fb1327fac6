//! Files numbered by frame, such as `cloth.####.obj`.

use std::path::{Path, PathBuf};

/// Frames read before the pre-roll and after the last frame of a bake, if there are files for them: the
/// handle frame, and one more for its slope.
const HANDLES: i32 = 2;

/// Frames that a bake with a pre-roll of `preroll` seconds reads before its first, at `fps` a second.
pub fn lead_in(fps: f64, preroll: f64) -> i32 {
    ((fps * preroll).ceil() as i32).saturating_add(HANDLES)
}

/// The pattern of the file names: one run of `#`, a `#` for each digit of the frame number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileSequence {
    prefix: String,
    /// Fewest digits of the frame number.
    digits: usize,
    suffix: String,
}

impl FileSequence {
    /// The sequence of `pattern`; `None` unless its file name holds exactly one run of `#`.
    pub fn new(pattern: &str) -> Option<Self> {
        let (start, end) = (pattern.find('#')?, pattern.rfind('#')? + 1);
        let run = &pattern[start..end];
        let suffix = &pattern[end..];
        (run.bytes().all(|c| c == b'#') && !suffix.contains(['/', '\\'])).then(|| FileSequence {
            prefix: pattern[..start].into(),
            digits: run.len(),
            suffix: suffix.into(),
        })
    }

    /// The file of `frame`, its number padded with zeros. Relative names start from `folder`.
    pub fn path(&self, folder: &Path, frame: i32) -> PathBuf {
        let FileSequence { prefix, digits, suffix } = self;
        folder.join(format!("{prefix}{frame:0digits$}{suffix}"))
    }

    /// First and last frame to read for a bake of the frames `first` to `last`: up to `lead` before and
    /// [`HANDLES`] after them, if there are files for them.
    pub fn available_frames(&self, folder: &Path, (first, last): (i32, i32), lead: i32) -> (i32, i32) {
        let extend = |from: i32, sign: i32, most: i32| {
            let exists =
                |k: &i32| from.checked_add(sign * k).is_some_and(|frame| self.path(folder, frame).is_file());
            from.saturating_add(sign * (1..=most).take_while(exists).last().unwrap_or(0))
        };
        (extend(first, -1, lead), extend(last, 1, HANDLES))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_has_one_run_of_digits_in_its_file_name() {
        let path = |pattern: &str, frame| {
            FileSequence::new(pattern).map(|s| s.path(Path::new("a"), frame).to_string_lossy().into_owned())
        };
        assert_eq!(path("b/cloth.####.obj", 7).as_deref(), Some("a/b/cloth.0007.obj"));
        assert_eq!(path("cloth#.obj", 1001).as_deref(), Some("a/cloth1001.obj"));
        assert_eq!(path("c_###.obj", -3).as_deref(), Some("a/c_-03.obj"));
        for pattern in ["cloth.obj", "c##.1#.obj", "##/cloth.obj"] {
            assert_eq!(path(pattern, 1), None, "{pattern}");
        }
    }

    #[test]
    fn frames_of_the_preroll_and_two_after_the_last_are_available() {
        let folder = tempfile::tempdir().unwrap();
        let sequence = FileSequence::new("c##").unwrap();
        for frame in [1, 4, 5, 6, 7, 8, 9, 10] {
            std::fs::write(sequence.path(folder.path(), frame), "").unwrap();
        }
        assert_eq!(sequence.available_frames(folder.path(), (5, 7), 9), (4, 9));
        assert_eq!(sequence.available_frames(folder.path(), (2, 10), 9), (1, 10));
        assert_eq!(sequence.available_frames(folder.path(), (9, 9), 3), (6, 10));
    }
}
