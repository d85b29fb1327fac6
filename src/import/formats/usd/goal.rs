//! Curves of a USD stage over time.

use super::exchange::{Exchange, points, required};
use crate::Result;
use crate::import::plain::{Declared, SampleTimes};
use crate::import::source::Source;
use nalgebra::Vector3;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
struct Header {
    /// Time codes per second.
    rate: f64,
}

/// Curves over time, in the unit and axes of the file, world space.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MovingCurves {
    /// Number of points of each curve.
    pub(crate) counts: Vec<u32>,
    /// Id of each curve, if the file has ids.
    pub(crate) ids: Option<Vec<i32>>,
    /// Points at each time, curve after curve.
    pub(crate) samples: Vec<Vec<Vector3<f64>>>,
    /// The first and the last time code at which the file has points of each curve; infinite if there are
    /// no several.
    pub(crate) span: Vec<[f64; 2]>,
    /// Time codes per second.
    pub(crate) rate: f64,
    pub(crate) declared: Declared,
    /// Remarks for the artist.
    pub(crate) notes: Vec<String>,
}

impl MovingCurves {
    /// Where each curve starts in a sample, and the number of points.
    pub(crate) fn starts(&self) -> Vec<usize> {
        let mut starts = vec![0];
        starts.extend(self.counts.iter().scan(0, |sum, n| {
            *sum += *n as usize;
            Some(*sum)
        }));
        starts
    }
}

/// Reads the curves at and below a prim at `times`, evaluated to points: the guides among them if there are
/// any.
///
/// # Errors
/// As [`Exchange::read`].
pub(crate) fn read(source: &Source, times: &SampleTimes) -> Result<MovingCurves> {
    let SampleTimes { start, step, count, .. } = times;
    let read = Exchange::<Header>::read("goal", source, &[format!("--times={start},{step},{count}")])?;
    let counts = required(read.u32s("counts"), "counts")?;
    let all = points(&required(read.f64s("points"), "points")?);
    let per_sample = counts.iter().sum::<u32>().max(1) as usize;
    Ok(MovingCurves {
        ids: read.i32s("id"),
        samples: all.chunks(per_sample).map(<[_]>::to_vec).collect(),
        counts,
        span: required(read.f64s("span"), "span")?.as_chunks().0.to_vec(),
        rate: read.header.more.rate,
        declared: read.header.declared(),
        notes: read.header.notes,
    })
}
