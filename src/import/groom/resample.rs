//! Resampling of strands along smooth curves through their vertices.

use crate::math::spline::ArcSpline;
use crate::math::{percentile, polyline};
use crate::scene::Curves;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::fmt;

/// Vertices of resampled strands. Root and tip keep their positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Resample {
    /// Unchanged.
    Keep,
    /// This number per strand, evenly spaced.
    Vertices(usize),
    /// Evenly spaced at most this far apart, m.
    Spacing(f64),
    /// Evenly spaced, for all strands as many as their curls need, but at least this number.
    Curls(usize),
}

/// Largest mean turn from segment to segment, rad, of strands with as many vertices as their curls need: a
/// helix then loses 1 % of its length. A curl of fewer vertices is a zigzag that jumps when it moves.
pub(in crate::import) const CURL_TURN: f64 = 0.5;

/// Most vertices that curls ask for.
pub(in crate::import) const MAX_CURL_VERTICES: usize = 128;

/// Largest ratio of the lengths of neighbouring segments: beyond it the spline through the vertices
/// overshoots.
const MAX_SEGMENT_RATIO: f64 = 3.0;

/// Most vertices of a resampled strand.
const MAX_VERTICES: f64 = 4096.0;

/// Change of the strands by resampling.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ResampleError {
    /// Relative difference in length between the new polyline and the smooth curve: mean and largest.
    pub length: [f64; 2],
    /// Distance of the original vertices from the new polyline, m: mean, 95th percentile and largest.
    pub distance: [f64; 3],
}

impl fmt::Display for ResampleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "length error {:.3} % on average, {:.2} % at most; vertex error {:.4} mm on average, \
             95 % below {:.4} mm, {:.2} mm at most",
            self.length[0] * 100.0,
            self.length[1] * 100.0,
            self.distance[0] * 1e3,
            self.distance[1] * 1e3,
            self.distance[2] * 1e3
        )
    }
}

/// Number of vertices that the curls of all but the curliest twentieth of `curves` need, but at least
/// `least`.
pub(super) fn vertices_for_curls(curves: &Curves, least: usize) -> usize {
    let turn = |c: usize| -> f64 {
        let edges: Vec<_> = curves.curve(c).windows(2).map(|w| w[1] - w[0]).collect();
        edges.windows(2).map(|e| e[0].angle(&e[1])).sum()
    };
    if curves.is_empty() {
        return least;
    }
    let turn = percentile((0..curves.len()).map(turn).collect(), 0.95);
    (1 + (turn / CURL_TURN).ceil() as usize).min(MAX_CURL_VERTICES).max(least)
}

/// Resamples every strand; neighbouring vertices must be distinct.
pub fn resample(curves: &Curves, to: Resample) -> (Curves, ResampleError) {
    let to = match to {
        Resample::Curls(least) => Resample::Vertices(vertices_for_curls(curves, least)),
        to => to,
    };
    let resample_strand = |c: usize| -> (Vec<Vector3<f64>>, f64, Vec<f64>) {
        let points = curves.curve(c);
        let knots = if to == Resample::Keep { points.to_vec() } else { grade(points) };
        let Some(spline) = ArcSpline::through(&knots) else { return (points.to_vec(), 0.0, vec![0.0]) };
        let length = spline.length();
        let vertices = match to {
            Resample::Keep => return (points.to_vec(), 1.0 - polyline::length(points) / length, vec![0.0]),
            Resample::Vertices(n) | Resample::Curls(n) => n.max(2),
            Resample::Spacing(step) => 1 + (length / step).ceil().clamp(1.0, MAX_VERTICES) as usize,
        };
        let at = |v: usize| spline.at(length * v as f64 / (vertices - 1) as f64).x;
        let mut even: Vec<_> = (0..vertices).map(at).collect();
        even[vertices - 1] = points[points.len() - 1];
        let distances = points.iter().map(|p| polyline::distance(p, &even)).collect();
        let error = 1.0 - polyline::length(&even) / length;
        (even, error, distances)
    };
    let resampled: Vec<_> = (0..curves.len()).into_par_iter().map(resample_strand).collect();
    let mut out = Curves {
        offsets: vec![0],
        points: Vec::new(),
        id: curves.id.clone(),
        group: curves.group.clone(),
        root_uv: curves.root_uv.clone(),
        skin: Vec::new(),
    };
    let mut error = ResampleError::default();
    let mut distances = Vec::new();
    for (points, length_error, off) in resampled {
        out.points.extend(points);
        out.offsets.push(out.points.len());
        error.length[0] += length_error.abs() / curves.len() as f64;
        error.length[1] = error.length[1].max(length_error.abs());
        distances.extend(off);
    }
    if !distances.is_empty() {
        let mean = distances.iter().sum::<f64>() / distances.len() as f64;
        let largest = distances.iter().copied().fold(0.0, f64::max);
        error.distance = [mean, percentile(distances, 0.95), largest];
    }
    (out, error)
}

/// The vertices of a strand, with long segments halved until none is more than [`MAX_SEGMENT_RATIO`] times as
/// long as a neighbour.
fn grade(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut points = points.to_vec();
    points.dedup();
    loop {
        let length: Vec<f64> = points.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
        let too_long = |k: usize| {
            let neighbours =
                [k.checked_sub(1), Some(k + 1)].into_iter().flatten().filter_map(|k| length.get(k));
            neighbours.fold(f64::INFINITY, |least, l| l.min(least)) * MAX_SEGMENT_RATIO < length[k]
        };
        let split: Vec<usize> = (0..length.len()).filter(|&k| too_long(k)).collect();
        if split.is_empty() || points.len() + split.len() > MAX_VERTICES as usize {
            return points;
        }
        for k in split.into_iter().rev() {
            points.insert(k + 1, points[k].lerp(&points[k + 1], 0.5));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arc(parameters: impl Iterator<Item = f64>) -> Curves {
        let points: Vec<_> = parameters.map(|t| Vector3::new(0.1 * t.cos(), 0.1 * t.sin(), 0.0)).collect();
        Curves {
            offsets: vec![0, points.len()],
            points,
            id: vec![7],
            group: vec![0],
            root_uv: vec![[0.5; 2]],
            skin: Vec::new(),
        }
    }

    #[test]
    fn uneven_vertices_become_evenly_spaced_on_the_curve() {
        let uneven = arc((0..24).map(|i| 1.5 * (f64::from(i) / 23.0).powi(2)));
        let (even, error) = resample(&uneven, Resample::Vertices(20));
        let steps: Vec<_> = even.points.windows(2).map(|p| (p[1] - p[0]).norm()).collect();
        assert!(steps.iter().all(|s| (s - steps[0]).abs() < 1e-3 * steps[0]), "{steps:?}");
        assert!(even.points.iter().all(|p| (p.norm() - 0.1).abs() < 1e-5));
        assert!(error.length[1] > 0.0 && error.length[1] < 1e-3, "{error:?}");
        let [mean, p95, largest] = error.distance;
        assert!(0.0 < mean && mean < p95 && p95 < largest && largest < 1e-4, "{error:?}");
        assert_eq!((even.id[0], even.root_uv[0]), (7, [0.5; 2]));
    }

    #[test]
    fn curls_have_as_many_vertices_as_they_need() {
        // Helices of 14 mm diameter and 40 cm height, and a straight strand.
        let helix = |turns: f64| -> Vec<_> {
            let place = |i: i32| {
                let s = f64::from(i) / 400.0;
                let (sin, cos) = (std::f64::consts::TAU * turns * s).sin_cos();
                Vector3::new(0.007 * cos, -0.4 * s, 0.007 * sin)
            };
            (0..=400).map(place).collect()
        };
        for (turns, least, most) in [(0.0, 32, 32), (12.0, 90, 128), (60.0, 128, 128)] {
            let points = helix(turns);
            let curls = Curves { offsets: vec![0, points.len()], points, ..arc([0.0, 1.0].into_iter()) };
            let (curls, error) = resample(&curls, Resample::Curls(32));
            assert!((least..=most).contains(&curls.points.len()), "{turns}: {}", curls.points.len());
            assert!(turns > 20.0 || error.length[1] < 0.011, "{turns}: {error:?}");
        }
    }

    #[test]
    fn a_strand_does_not_overshoot_next_to_long_segments() {
        let hook = [[0.0, 0.0], [0.0, 3.0], [0.0, 6.0], [0.3, 6.3], [0.6, 6.0], [0.6, 0.5]];
        let points: Vec<_> = hook.iter().map(|[x, y]| Vector3::new(0.01 * x, 0.01 * y, 0.0)).collect();
        let strand =
            Curves { offsets: vec![0, points.len()], points: points.clone(), ..arc([0.0, 1.0].into_iter()) };
        let (even, error) = resample(&strand, Resample::Vertices(60));
        assert!((polyline::length(&even.points) / polyline::length(&points) - 1.0).abs() < 0.05);
        let off = even.points.iter().map(|p| polyline::distance(p, &points)).fold(0.0, f64::max);
        assert!(off < 1.5e-3 && error.distance[2] < 1e-3, "{off} {error:?}");
    }

    #[test]
    fn error_falls_with_more_vertices_and_spacing_bounds_segments() {
        let uneven = arc((0..12).map(|i| 0.2 * f64::from(i)));
        let error = |n| resample(&uneven, Resample::Vertices(n)).1.length[1];
        assert!(error(10) / error(20) > 3.5);
        let (spaced, _) = resample(&uneven, Resample::Spacing(0.01));
        assert!(spaced.points.windows(2).all(|p| (p[1] - p[0]).norm() <= 0.01 + 1e-12));
        assert_eq!(spaced.len(), 1);
    }

    #[test]
    fn keep_changes_nothing() {
        let uneven = arc((0..5).map(f64::from));
        assert_eq!(resample(&uneven, Resample::Keep).0, uneven);
    }
}
