//! Strands sampled at common arc-length fractions.

use crate::math::spline::ArcSpline;
use crate::scene::Curves;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Points and tangents of `n` strands at `m` common arc-length fractions; row `i` is strand `i`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sections {
    /// Number of sections `m`.
    pub(super) count: usize,
    /// Points, m; `n × m`.
    pub(super) point: Vec<Vector3<f64>>,
    /// Unit tangents; `n × m`.
    pub(super) tangent: Vec<Vector3<f64>>,
    /// Arc length of each strand, m; `n`.
    pub(super) length: Vec<f64>,
}

/// A point, m, and the unit tangent there.
type PointAndTangent = (Vector3<f64>, Vector3<f64>);

impl Sections {
    /// Samples every strand at the fractions `arc` (0 to 1, increasing).
    pub(super) fn of(curves: &Curves, arc: &[f64]) -> Self {
        let sample = |c: usize| -> (Vec<PointAndTangent>, f64) {
            let points = curves.curve(c);
            let Some(spline) = ArcSpline::through(points) else {
                return (vec![(points[0], Vector3::z()); arc.len()], 0.0);
            };
            let length = spline.length();
            let at = |s: &f64| {
                let at = spline.at(s * length);
                (at.x, at.tangent)
            };
            (arc.iter().map(at).collect(), length)
        };
        let rows: Vec<_> = (0..curves.len()).into_par_iter().map(sample).collect();
        let (point, tangent) = rows.iter().flat_map(|(row, _)| row.iter().copied()).unzip();
        Sections { count: arc.len(), point, tangent, length: rows.iter().map(|r| r.1).collect() }
    }

    /// Number of strands.
    pub(super) fn len(&self) -> usize {
        self.length.len()
    }

    /// Points of strand `i`.
    pub(super) fn points(&self, i: usize) -> &[Vector3<f64>] {
        &self.point[i * self.count..(i + 1) * self.count]
    }

    /// Tangents of strand `i`.
    pub(super) fn tangents(&self, i: usize) -> &[Vector3<f64>] {
        &self.tangent[i * self.count..(i + 1) * self.count]
    }
}

/// Length of the component of `d` perpendicular to the unit vector `t`.
pub(super) fn perpendicular_distance(d: Vector3<f64>, t: Vector3<f64>) -> f64 {
    (d - t * d.dot(&t)).norm()
}
