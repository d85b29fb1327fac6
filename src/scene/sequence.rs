//! Numbered files of one thing, one a frame: `cloth.####.obj`.

use std::path::{Path, PathBuf};

/// Frames read beyond the first and the last of a bake, where they are there: the handle frame, and one more for its slope.
const HANDLES: i32 = 2;

/// The name of the files, with one run of `#`, one for each digit of the frame's number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sequence {
    /// All before the run and after it.
    around: [String; 2],
    digits: usize,
}

impl Sequence {
    /// The sequence that `pattern` names; `None` unless its file name holds exactly one run of `#`.
    pub fn new(pattern: &str) -> Option<Self> {
        let (start, end) = (pattern.find('#')?, pattern.rfind('#')? + 1);
        let run = &pattern[start..end];
        let after = &pattern[end..];
        (run.bytes().all(|c| c == b'#') && !after.contains(['/', '\\']))
            .then(|| Sequence { around: [pattern[..start].into(), after.into()], digits: run.len() })
    }

    /// The file of `frame`, its number filled up with zeros; `folder` is where relative names start.
    pub fn path(&self, folder: &Path, frame: i32) -> PathBuf {
        let ([before, after], digits) = (&self.around, self.digits);
        folder.join(format!("{before}{frame:0digits$}{after}"))
    }

    /// First and last of the frames to read for a bake of `frames`: with up to two more at either end, as far as they are there.
    pub fn reach(&self, folder: &Path, (first, last): (i32, i32)) -> (i32, i32) {
        let more = |from: i32, way: i32| {
            let there =
                |k: &i32| from.checked_add(way * k).is_some_and(|frame| self.path(folder, frame).is_file());
            from.saturating_add(way * (1..=HANDLES).take_while(there).last().unwrap_or(0))
        };
        (more(first, -1), more(last, 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_has_one_run_of_digits_in_its_file_name() {
        let path = |pattern: &str, frame| {
            Sequence::new(pattern).map(|s| s.path(Path::new("a"), frame).to_string_lossy().into_owned())
        };
        assert_eq!(path("b/cloth.####.obj", 7).as_deref(), Some("a/b/cloth.0007.obj"));
        assert_eq!(path("cloth#.obj", 1001).as_deref(), Some("a/cloth1001.obj"));
        assert_eq!(path("c_###.obj", -3).as_deref(), Some("a/c_-03.obj"));
        for pattern in ["cloth.obj", "c##.1#.obj", "##/cloth.obj"] {
            assert_eq!(path(pattern, 1), None, "{pattern}");
        }
    }

    #[test]
    fn up_to_two_frames_beyond_the_ends_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let sequence = Sequence::new("c##").unwrap();
        for frame in [1, 4, 5, 6, 7, 8, 9, 10] {
            std::fs::write(sequence.path(folder.path(), frame), "").unwrap();
        }
        assert_eq!(sequence.reach(folder.path(), (5, 7)), (4, 9));
        assert_eq!(sequence.reach(folder.path(), (2, 10)), (1, 10));
    }
}
