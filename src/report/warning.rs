//! Warnings of a report, with the frames that they are about.

use super::text::escape;
use serde::{Serialize, Serializer};

/// Most frames that a warning lists.
const MAX_LISTED: usize = 8;

/// What the user should look at, and where.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Warning {
    /// What it is.
    pub what: String,
    /// What to do about it.
    pub advice: String,
    /// The frames, each with a detail, which may be empty.
    pub frames: Vec<(i32, String)>,
}

impl Warning {
    /// A warning without advice and frames.
    pub fn new(what: impl Into<String>) -> Self {
        Warning { what: what.into(), ..Warning::default() }
    }

    /// Adds a frame.
    pub fn frame(&mut self, frame: i32, detail: impl Into<String>) {
        self.frames.push((frame, detail.into()));
    }

    /// The warning in words.
    pub fn to_text(&self) -> String {
        self.written(str::to_string, |frame| frame.to_string())
    }

    /// The same for a page, in which frames are links if `linked`.
    pub(super) fn to_html(&self, linked: bool) -> String {
        self.written(escape, |frame| frame_link(frame, linked))
    }

    fn written(&self, text: impl Fn(&str) -> String, number: impl Fn(i32) -> String) -> String {
        let (what, advice) = (text(&self.what), text(&self.advice));
        if self.frames.is_empty() {
            return format!("{what}{advice}");
        }
        let listed = self.frames.iter().take(MAX_LISTED).map(|(frame, detail)| match detail.as_str() {
            "" => number(*frame),
            detail => format!("{} ({})", number(*frame), text(detail)),
        });
        let listed = listed.collect::<Vec<_>>().join(", ");
        let more = if self.frames.len() > MAX_LISTED { ", ..." } else { "" };
        match self.frames.len() {
            1 => format!("{what} in frame {listed}{advice}"),
            n => format!("{what} in {n} frames: {listed}{more}{advice}"),
        }
    }
}

/// As its text.
impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.to_text())
    }
}

/// A frame number on a page; if `linked`, it leads to the frame in the view.
pub fn frame_link(frame: i32, linked: bool) -> String {
    if linked { format!("<a href=\"#frame={frame}\">{frame}</a>") } else { frame.to_string() }
}
