//! Figures of the frames of a cache, as far as they are recorded.

use crate::bake::frame_record::FrameRecord;
use crate::cache::Manifest;
use crate::report::Series;
use serde_json::{Map, Value};

/// Fields that warnings, sums and the view use, which no series shows alone, and what they are.
pub const WITHOUT_SERIES: [(&str, &str); 6] = [
    ("exempt_segments", "number of exempt segments"),
    ("pinched_segments", "number of pinched segments"),
    ("hair_inside", "number of render strands inside a body"),
    ("unsettled", "contacts with bodies not converged to rest"),
    ("strands_unsettled", "contacts between guides not converged to rest"),
    ("divided", "guides whose step was halved"),
];

/// Figures of frames by the names of the fields of [`FrameRecord`]. What is not known of a frame is missing.
#[derive(Debug, Clone, Default)]
pub struct Figures(pub(super) Vec<Map<String, Value>>);

impl Figures {
    /// Those of a manifest, which an older program may have written.
    pub fn recorded(manifest: &Manifest) -> Self {
        Figures(manifest.frames.iter().map(|entry| entry.figures.clone()).collect())
    }

    /// None of `frames` frames.
    pub fn unknown(frames: usize) -> Self {
        Figures(vec![Map::new(); frames])
    }

    /// The value of a field in each frame: a number, or the length of a list; NaN where it is not known.
    fn values(&self, field: &str) -> Vec<f64> {
        let value = |frame: &Map<String, Value>| match frame.get(field) {
            Some(Value::Array(list)) => list.len() as f64,
            value => value.and_then(Value::as_f64).unwrap_or(f64::NAN),
        };
        self.0.iter().map(value).collect()
    }

    /// Whether it is recorded of some frame.
    fn is_recorded(&self, field: &str) -> bool {
        self.values(field).iter().any(|value| value.is_finite())
    }

    /// Whether the charts of a field are worth showing: it is above zero in some frame, or not recorded,
    /// which the page says of them.
    pub fn any(&self, field: &str) -> bool {
        !self.is_recorded(field) || self.values(field).iter().any(|value| *value > 0.0)
    }

    /// The sum of fields in each frame, as far as they are known.
    pub fn sum(&self, fields: &[&str]) -> Vec<f64> {
        let all: Vec<_> = fields.iter().map(|field| self.values(field)).collect();
        let sum = |i: usize| {
            let known = all.iter().map(|values| values[i]).filter(|value| value.is_finite());
            known.reduce(|sum, value| sum + value).unwrap_or(f64::NAN)
        };
        (0..self.0.len()).map(sum).collect()
    }

    /// What is not recorded of any frame and has no series of its own that says so.
    pub fn unrecorded(&self) -> Vec<String> {
        let missing =
            WITHOUT_SERIES.iter().filter(|(field, _)| !self.0.is_empty() && !self.is_recorded(field));
        missing.map(|(_, name)| (*name).to_string()).collect()
    }

    /// A field in each frame, times `scale`.
    pub fn series(&self, name: &str, field: &str, scale: f64) -> Series {
        let values = self.values(field).into_iter().map(|value| scale * value).collect();
        Series { name: name.into(), values }
    }

    /// A field in each frame.
    pub fn count(&self, name: &str, field: &str) -> Series {
        self.series(name, field, 1.0)
    }
}

impl From<&[FrameRecord]> for Figures {
    fn from(records: &[FrameRecord]) -> Self {
        let figures = |record| match serde_json::to_value(record) {
            Ok(Value::Object(figures)) => figures,
            _ => Map::new(),
        };
        Figures(records.iter().map(figures).collect())
    }
}
