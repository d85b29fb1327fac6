//! Subdivision of the curves of a cache into short straight pieces.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::camera::{Camera, Projected};
use crate::cache::{Basis, CurveSet};

/// A straight piece of a strand, in picture space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// End towards the root.
    pub from: Vector3<f32>,
    /// End towards the tip.
    pub to: Vector3<f32>,
    /// Images of both ends.
    pub ends: [Projected; 2],
    /// Diameter at its midpoint.
    pub width: f32,
    /// Index of its curve in the set.
    pub curve: u32,
    /// Where its midpoint is among the points of the set.
    pub place: f32,
}

/// Target length of a piece, final pixels.
const TARGET_LENGTH: f32 = 9.0;
/// Target of how far a piece turns, rad.
const TARGET_TURN: f32 = 0.12;
/// Shortest length of a piece because of its turn, final pixels.
const SHORTEST: f32 = 2.5;
/// Largest number of pieces between two points of a curve.
const MAX_PIECES: f32 = 32.0;

/// Subdivides cubic, pinned curves (phantom end points 2·p₀ − p₁, as in UsdGeomBasisCurves) into pieces of
/// at most about [`TARGET_LENGTH`] pixels that turn by about [`TARGET_TURN`]. `pixel` is the side of a final
/// pixel in camera pixels. Pieces with an end behind the near plane are omitted.
pub fn pieces(
    set: &CurveSet,
    basis: Basis,
    points: &[Vector3<f32>],
    camera: &Camera,
    pixel: f32,
) -> Vec<Piece> {
    let ranges: Vec<_> = set.ranges().collect();
    let cut = |(curve, range): (usize, &std::ops::Range<usize>)| {
        let (points, widths) = (&points[range.clone()], &set.widths[range.clone()]);
        let mut pieces = one_curve(curve as u32, basis, points, widths, camera, pixel);
        pieces.iter_mut().for_each(|piece| piece.place += range.start as f32);
        pieces
    };
    ranges.par_iter().enumerate().flat_map_iter(cut).collect()
}

fn one_curve(
    curve: u32,
    basis: Basis,
    points: &[Vector3<f32>],
    widths: &[f32],
    camera: &Camera,
    pixel: f32,
) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let seen: Vec<_> = points.iter().map(|p| camera.project(*p)).collect();
    for i in 1..points.len() {
        let (Some(start), Some(end)) = (seen[i - 1], seen[i]) else { continue };
        let chord = (end.x - start.x).hypot(end.y - start.y) / pixel;
        let by_turn = (turn(points, i) / TARGET_TURN).min(chord / SHORTEST);
        let n = (chord / TARGET_LENGTH).max(by_turn).ceil().clamp(1.0, MAX_PIECES);
        let mut last = None;
        for k in 0..=n as u32 {
            let t = k as f32 / n;
            let to = span(basis, points, i, t);
            let after = camera.project(to);
            if let (Some((from, Some(before))), Some(after)) = (last, after) {
                let middle = t - 0.5 / n;
                let width = widths[i - 1] + (widths[i] - widths[i - 1]) * middle;
                let place = (i - 1) as f32 + middle;
                pieces.push(Piece { from, to, ends: [before, after], width, curve, place });
            }
            last = Some((to, after));
        }
    }
    pieces
}

/// About how far the curve turns between points `i − 1` and `i`, rad: half of what its chord is turned
/// against those beside it.
fn turn(points: &[Vector3<f32>], i: usize) -> f32 {
    let way = |i: usize| (points[i] - points[i - 1]).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    let here = way(i);
    let before = if i >= 2 { (here - way(i - 1)).norm() } else { 0.0 };
    let after = if i + 1 < points.len() { (way(i + 1) - here).norm() } else { 0.0 };
    0.5 * (before + after)
}

/// The curve between points `i − 1` (t = 0) and `i` (t = 1).
fn span(basis: Basis, points: &[Vector3<f32>], i: usize, t: f32) -> Vector3<f32> {
    let (p1, p2) = (points[i - 1], points[i]);
    let p0 = if i >= 2 { points[i - 2] } else { p1 * 2.0 - p2 };
    let p3 = points.get(i + 1).copied().unwrap_or(p2 * 2.0 - p1);
    let (t2, t3) = (t * t, t * t * t);
    let weights = match basis {
        Basis::CatmullRom => [
            0.5 * (2.0 * t2 - t - t3),
            0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
            0.5 * (t + 4.0 * t2 - 3.0 * t3),
            0.5 * (t3 - t2),
        ],
        Basis::Bspline => [
            (1.0 - t).powi(3) / 6.0,
            (4.0 - 6.0 * t2 + 3.0 * t3) / 6.0,
            (1.0 + 3.0 * t + 3.0 * t2 - 3.0 * t3) / 6.0,
            t3 / 6.0,
        ],
    };
    p0 * weights[0] + p1 * weights[1] + p2 * weights[2] + p3 * weights[3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::preview::camera::{Axes, Field, Framing};
    use approx::assert_relative_eq;

    #[test]
    fn catmull_rom_reproduces_parabolas_and_interpolates_the_points() {
        let span = |points: &[_], i, t| super::span(Basis::CatmullRom, points, i, t);
        let f = |x: f32| Vector3::new(x, x * x, 0.5 - x);
        let points: Vec<_> = (0..5).map(|i| f(i as f32)).collect();
        for i in 2..4 {
            for t in [0.0, 0.3, 1.0] {
                assert_relative_eq!(span(&points, i, t), f(i as f32 - 1.0 + t), epsilon = 1e-5);
            }
        }
        assert_relative_eq!(span(&points, 1, 0.0), points[0]);
        assert_relative_eq!(span(&points, 4, 1.0), points[4]);
    }

    /// A cubic B-spline maps points of x² to x² + 1/3.
    #[test]
    fn b_spline_smooths_and_is_pinned() {
        let f = |x: f32| Vector3::new(x, x * x, 0.0);
        let points: Vec<_> = (0..5).map(|i| f(i as f32)).collect();
        let shifted = f(1.4) + Vector3::new(0.0, 1.0 / 3.0, 0.0);
        assert_relative_eq!(span(Basis::Bspline, &points, 2, 0.4), shifted, epsilon = 1e-5);
        assert_relative_eq!(span(Basis::Bspline, &points, 1, 0.0), points[0], epsilon = 1e-5);
        assert_relative_eq!(span(Basis::Bspline, &points, 4, 1.0), points[4], epsilon = 1e-5);
    }

    #[test]
    fn two_points_give_a_straight_line_in_short_pieces() {
        let points = [Vector3::zeros(), Vector3::new(0.0, 1.0, 0.0)];
        let set = CurveSet { counts: vec![1, 0, 2], widths: vec![1.0; 3], ..CurveSet::default() };
        let mut framing = Framing::new(Field::new(30.0, (100, 100)));
        points.iter().for_each(|p| framing.add(*p));
        let camera = framing.camera(Axes::looking(0.0, 0.0), Vector3::zeros(), None, (100, 100));
        let points = [Vector3::zeros(), points[0], points[1]];
        let all = pieces(&set, Basis::default(), &points, &camera, 1.0);
        assert_eq!(all.len(), (100.0f32 / 1.06 / TARGET_LENGTH).ceil() as usize);
        assert!(all.iter().all(|p| p.curve == 2 && p.from.x == 0.0));
        assert_eq!(all.last().unwrap().to, points[2]);
    }
}
