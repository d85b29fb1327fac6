//! Curves over control points, as USD's basis curves: which points they pass through, and the control points
//! of a curve that passes through given points.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::{Add, Mul};

/// Weight of the second differences of the control points. It decides what the curve leaves open, such as the
/// phantom ends of a Catmull-Rom spline, and is too small to be seen elsewhere.
const SMOOTHNESS: f64 = 1e-9;

/// Control points of one cubic segment, and so the width of a row of weights.
const WINDOW: usize = 4;

/// Basis of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase")]
pub enum Basis {
    /// Straight from point to point.
    Linear,
    /// Cubic Bézier segments.
    Bezier,
    /// Uniform cubic B-spline.
    #[serde(rename = "bspline")]
    BSpline,
    /// Catmull-Rom spline.
    CatmullRom,
}

/// How a curve ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Wrap {
    /// Where its segments end.
    Nonperiodic,
    /// In its first and last control point, by phantom points beyond them.
    Pinned,
    /// Nowhere: it is closed.
    Periodic,
}

/// Type of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CurveType {
    /// Basis.
    pub basis: Basis,
    /// Ends.
    pub wrap: Wrap,
}

/// A point of a curve as weights of neighbouring control points.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Row {
    /// The first control point with a weight.
    pub first: usize,
    /// The weights; 0 beyond the last control point.
    pub weights: [f64; WINDOW],
}

/// What has weighted sums: numbers, points, points with their velocities.
pub trait Linear: Copy + Default + Add<Output = Self> + Mul<f64, Output = Self> {}

impl<T: Copy + Default + Add<Output = T> + Mul<f64, Output = T>> Linear for T {}

impl Row {
    /// The point, of control points or of what else belongs to them.
    pub fn of<T: Linear>(&self, controls: &[T]) -> T {
        let window = controls.iter().skip(self.first).zip(self.weights);
        window.fold(T::default(), |sum, (control, weight)| sum + *control * weight)
    }
}

impl CurveType {
    /// Number of segments of an open curve with `count` control points; `None` if there is no such curve.
    fn segments(self, count: usize) -> Option<usize> {
        let n = match (self.basis, self.wrap) {
            (_, Wrap::Periodic) => return None,
            (Basis::Linear, _) | (Basis::BSpline | Basis::CatmullRom, Wrap::Pinned) => {
                count.checked_sub(1)?
            }
            (Basis::Bezier, _) if count % 3 == 1 => count / 3,
            (Basis::Bezier, _) => return None,
            (Basis::BSpline | Basis::CatmullRom, Wrap::Nonperiodic) => count.checked_sub(3)?,
        };
        (n > 0).then_some(n)
    }

    /// The place `u` in 0..=1 of a segment of a curve with `count` control points.
    pub fn row(self, count: usize, segment: usize, u: f64) -> Row {
        let v = 1.0 - u;
        let weights = match self.basis {
            Basis::Linear => return Row { first: segment, weights: [v, u, 0.0, 0.0] },
            Basis::Bezier => {
                let weights = [v * v * v, 3.0 * v * v * u, 3.0 * v * u * u, u * u * u];
                return Row { first: 3 * segment, weights };
            }
            Basis::BSpline => {
                let inner = |u: f64| 4.0 + 3.0 * u * u * (u - 2.0);
                [v * v * v, inner(u), inner(v), u * u * u].map(|w| w / 6.0)
            }
            Basis::CatmullRom => {
                [-u * v * v, 2.0 + u * u * (3.0 * u - 5.0), 2.0 + v * v * (3.0 * v - 5.0), -v * u * u]
                    .map(|w| w / 2.0)
            }
        };
        if self.wrap != Wrap::Pinned {
            return Row { first: segment, weights };
        }
        // The phantom points continue the curve: 2 P0 − P1 and its counterpart at the tip.
        let first = segment.saturating_sub(1).min(count.saturating_sub(WINDOW));
        let mut row = Row { first, weights: [0.0; WINDOW] };
        let mut add = |control: usize, weight: f64| row.weights[control - first] += weight;
        for (k, weight) in weights.into_iter().enumerate() {
            match (segment + k).checked_sub(1) {
                None => {
                    add(0, 2.0 * weight);
                    add(1, -weight);
                }
                Some(control) if control == count => {
                    add(count - 1, 2.0 * weight);
                    add(count - 2, -weight);
                }
                Some(control) => add(control, weight),
            }
        }
        row
    }

    /// The points that the importer takes of a curve with `count` control points, from root to tip; `None` if
    /// there is no such curve. They define it, but for phantom ends.
    pub fn samples(self, count: usize) -> Option<Vec<Row>> {
        let segments = self.segments(count)?;
        let per_segment = match self.basis {
            Basis::Linear | Basis::CatmullRom => 1,
            Basis::BSpline => 2,
            Basis::Bezier => 3,
        };
        let places = (0..segments).flat_map(|s| (0..per_segment).map(move |i| (s, i)));
        let rows = places.map(|(s, i)| self.row(count, s, f64::from(i) / f64::from(per_segment)));
        Some(rows.chain([self.row(count, segments - 1, 1.0)]).collect())
    }
}

/// Finds the control points of curves through given points.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveFit {
    /// The points of the curve, which are fitted.
    pub samples: Vec<Row>,
    /// The control points are the points.
    identity: bool,
    /// Cholesky factor of the normal equations, the diagonal and the entries left of it: `factor[i][k]` is
    /// the entry of row i and column i − k.
    factor: Vec<[f64; WINDOW]>,
    /// How the control points move to move the root by 1 at the least cost elsewhere.
    root: Vec<f64>,
}

impl CurveFit {
    /// The fit of curves with `count` control points; `None` if there are no such curves.
    pub fn new(curve: CurveType, count: usize) -> Option<Self> {
        let samples = curve.samples(count)?;
        let is_control = |(i, row): (usize, &Row)| {
            row.weights.iter().enumerate().all(|(k, w)| *w == f64::from(u8::from(row.first + k == i)))
        };
        let identity = samples.len() == count && samples.iter().enumerate().all(is_control);
        let mut normal = vec![[0.0; WINDOW]; count];
        let mut add = |first: usize, weights: &[f64], weight: f64| {
            for (i, a) in weights.iter().enumerate().filter(|(_, a)| **a != 0.0) {
                for (j, b) in weights.iter().enumerate().take(i + 1) {
                    normal[first + i][i - j] += weight * a * b;
                }
            }
        };
        samples.iter().for_each(|row| add(row.first, &row.weights, 1.0));
        (2..count).for_each(|i| add(i - 2, &[1.0, -2.0, 1.0], SMOOTHNESS));
        let mut fit = CurveFit { samples, identity, factor: factorised(normal), root: Vec::new() };
        let row = fit.samples[0];
        let mut by_root = vec![0.0; count];
        by_root.iter_mut().skip(row.first).zip(row.weights).for_each(|(x, w)| *x = w);
        fit.substitute(&mut by_root);
        let at_root = row.of(&by_root);
        fit.root = by_root.into_iter().map(|x| x / at_root).collect();
        Some(fit)
    }

    /// The control points of the curve whose samples are nearest to `points`: least squares, with the root
    /// held. As they depend linearly on the points, this gives their displacements and velocities as well.
    pub fn solve<T: Linear>(&self, points: &[T], controls: &mut Vec<T>) {
        controls.clear();
        if self.identity {
            controls.extend_from_slice(points);
            return;
        }
        controls.resize(self.factor.len(), T::default());
        for (row, point) in self.samples.iter().zip(points) {
            for (control, w) in controls.iter_mut().skip(row.first).zip(row.weights) {
                *control = *control + *point * w;
            }
        }
        self.substitute(controls);
        let missing = points[0] + self.samples[0].of(controls) * -1.0;
        controls.iter_mut().zip(&self.root).for_each(|(control, by)| *control = *control + missing * *by);
    }

    /// Solves the normal equations for the right-hand side `x`, in place.
    fn substitute<T: Linear>(&self, x: &mut [T]) {
        let n = x.len();
        for i in 0..n {
            (1..WINDOW.min(i + 1)).for_each(|k| x[i] = x[i] + x[i - k] * -self.factor[i][k]);
            x[i] = x[i] * self.factor[i][0].recip();
        }
        for i in (0..n).rev() {
            (1..WINDOW.min(n - i)).for_each(|k| x[i] = x[i] + x[i + k] * -self.factor[i + k][k]);
            x[i] = x[i] * self.factor[i][0].recip();
        }
    }
}

/// Cholesky factor of a symmetric positive definite band matrix, in its own layout.
fn factorised(mut a: Vec<[f64; WINDOW]>) -> Vec<[f64; WINDOW]> {
    for i in 0..a.len() {
        for k in (0..WINDOW.min(i + 1)).rev() {
            let j = i - k;
            let shared = (k + 1..WINDOW.min(i + 1)).map(|m| a[i][m] * a[j][m - k]).sum::<f64>();
            let rest = a[i][k] - shared;
            a[i][k] = if k == 0 { rest.sqrt() } else { rest / a[j][0] };
        }
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use nalgebra::Vector3;

    const OPEN: [Wrap; 2] = [Wrap::Pinned, Wrap::Nonperiodic];

    /// Control points on a helix.
    fn helix(count: usize) -> Vec<Vector3<f64>> {
        (0..count).map(|i| 0.7 * i as f64).map(|t| Vector3::new(t.cos(), t.sin(), 0.3 * t)).collect()
    }

    fn all() -> impl Iterator<Item = (CurveType, usize)> {
        let bases = [Basis::Linear, Basis::Bezier, Basis::BSpline, Basis::CatmullRom];
        bases.into_iter().flat_map(|basis| {
            let types = OPEN.into_iter().map(move |wrap| CurveType { basis, wrap });
            types.flat_map(|curve| (2..20).map(move |count| (curve, count)))
        })
    }

    #[test]
    fn the_weights_of_a_point_sum_to_one() {
        for (curve, count) in all() {
            for row in curve.samples(count).into_iter().flatten() {
                assert_abs_diff_eq!(row.weights.iter().sum::<f64>(), 1.0, epsilon = 1e-12);
                let used = row.weights.iter().rposition(|w| *w != 0.0).unwrap();
                assert!(row.first + used < count, "{curve:?} {count}");
            }
        }
    }

    #[test]
    fn curves_have_the_points_of_usd() {
        let at = |basis, wrap, controls: &[f64], segment, u| {
            CurveType { basis, wrap }.row(controls.len(), segment, u).of(controls)
        };
        let x = [0.0, 6.0, 6.0, 12.0];
        // (P0 + 4 P1 + P2) / 6, and (P0 + 23 P1 + 23 P2 + P3) / 48.
        assert_eq!(at(Basis::BSpline, Wrap::Nonperiodic, &x, 0, 0.0), 5.0);
        assert_abs_diff_eq!(at(Basis::BSpline, Wrap::Nonperiodic, &x, 0, 0.5), 6.0, epsilon = 1e-12);
        assert_eq!(at(Basis::BSpline, Wrap::Pinned, &x, 0, 0.0), 0.0);
        assert_eq!(at(Basis::BSpline, Wrap::Pinned, &x, 2, 1.0), 12.0);
        // (−P0 + 9 P1 + 9 P2 − P3) / 16.
        assert_eq!(at(Basis::CatmullRom, Wrap::Nonperiodic, &x, 0, 0.5), 6.0);
        assert_eq!(at(Basis::CatmullRom, Wrap::Pinned, &x, 1, 0.0), 6.0);
        // (P0 + 3 P1 + 3 P2 + P3) / 8.
        assert_eq!(at(Basis::Bezier, Wrap::Nonperiodic, &x, 0, 0.5), 6.0);
        assert_eq!(at(Basis::Linear, Wrap::Nonperiodic, &x, 2, 0.5), 9.0);
    }

    #[test]
    fn a_curve_gives_back_its_control_points() {
        for (curve, count) in all() {
            let Some(fit) = CurveFit::new(curve, count) else { continue };
            let phantom = curve.wrap == Wrap::Nonperiodic
                && (curve.basis == Basis::CatmullRom || curve.basis == Basis::BSpline && count == 4);
            let controls = helix(count);
            let points: Vec<_> = fit.samples.iter().map(|row| row.of(&controls)).collect();
            let mut found = Vec::new();
            fit.solve(&points, &mut found);
            for (row, point) in fit.samples.iter().zip(&points) {
                assert_abs_diff_eq!(row.of(&found), *point, epsilon = 1e-6);
            }
            for (found, control) in found.iter().zip(&controls).filter(|_| !phantom) {
                assert_abs_diff_eq!(found, control, epsilon = 1e-6);
            }
        }
    }

    #[test]
    fn a_curve_that_is_moved_along_moves_all_control_points_alike() {
        for (curve, count) in all() {
            let Some(fit) = CurveFit::new(curve, count) else { continue };
            let mut found = Vec::new();
            fit.solve(&vec![1.0; fit.samples.len()], &mut found);
            found.into_iter().for_each(|x| assert_abs_diff_eq!(x, 1.0, epsilon = 1e-6));
        }
    }

    #[test]
    fn the_root_is_held_where_a_curve_cannot_follow() {
        let fit = CurveFit::new(CurveType { basis: Basis::BSpline, wrap: Wrap::Nonperiodic }, 9).unwrap();
        let points: Vec<f64> = (0..fit.samples.len()).map(|i| f64::from(i as u32 % 2)).collect();
        let mut found = Vec::new();
        fit.solve(&points, &mut found);
        assert_abs_diff_eq!(fit.samples[0].of(&found), 0.0, epsilon = 1e-12);
        assert!((fit.samples[5].of(&found) - 1.0).abs() > 0.1);
    }

    #[test]
    fn counts_without_segments_and_closed_curves_have_no_fit() {
        for (basis, wrap, count) in [
            (Basis::Bezier, Wrap::Pinned, 5),
            (Basis::BSpline, Wrap::Nonperiodic, 3),
            (Basis::Linear, Wrap::Nonperiodic, 1),
            (Basis::CatmullRom, Wrap::Periodic, 8),
        ] {
            assert!(CurveFit::new(CurveType { basis, wrap }, count).is_none());
        }
    }
}
