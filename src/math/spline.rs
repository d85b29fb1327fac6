//! C2 cubic splines through points, and their arc length.

use super::polyline;
use nalgebra::{SVector, Vector3};

/// Nodes and weights of the five-point Gauss-Legendre rule on [−1, 1].
const GAUSS5: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// The interpolating cubic spline with not-a-knot ends (de Boor 1978, ch. IV) through points of `D`
/// components.
#[derive(Debug, Clone, PartialEq)]
pub struct CubicSpline<const D: usize> {
    /// Parameter of each point, increasing.
    t: Vec<f64>,
    points: Vec<SVector<f64, D>>,
    /// Second derivative at each point.
    second: Vec<SVector<f64, D>>,
}

impl<const D: usize> CubicSpline<D> {
    /// The spline through `points`, at least one, at increasing parameters `t` of the same number. Fewer than
    /// four points give the polynomial through them.
    pub fn through(t: Vec<f64>, points: Vec<SVector<f64, D>>) -> Self {
        let second = not_a_knot(&t, &points);
        CubicSpline { t, points, second }
    }

    /// Parameters of the points.
    pub fn knots(&self) -> &[f64] {
        &self.t
    }

    /// Value, first and second derivative at parameter `t`, clamped to the knots.
    pub fn at(&self, t: f64) -> [SVector<f64, D>; 3] {
        let n = self.t.len();
        if n == 1 {
            return [self.points[0], SVector::zeros(), SVector::zeros()];
        }
        let i = self.t.partition_point(|&k| k <= t).clamp(1, n - 1) - 1;
        self.in_span(i, t.clamp(self.t[0], self.t[n - 1]))
    }

    /// Value, first and second derivative at `t` in span `i`, between knots `i` and `i + 1`.
    fn in_span(&self, i: usize, t: f64) -> [SVector<f64, D>; 3] {
        let h = self.t[i + 1] - self.t[i];
        let (a, b) = ((self.t[i + 1] - t) / h, (t - self.t[i]) / h);
        let (p0, p1, m0, m1) = (&self.points[i], &self.points[i + 1], &self.second[i], &self.second[i + 1]);
        let x = p0 * a + p1 * b + (m0 * (a * a * a - a) + m1 * (b * b * b - b)) * (h * h / 6.0);
        [x, self.slope(i, t), m0 * a + m1 * b]
    }

    /// First derivative alone, for arc lengths, which need it often.
    fn slope(&self, i: usize, t: f64) -> SVector<f64, D> {
        let h = self.t[i + 1] - self.t[i];
        let (a, b) = ((self.t[i + 1] - t) / h, (t - self.t[i]) / h);
        let (p0, p1, m0, m1) = (&self.points[i], &self.points[i + 1], &self.second[i], &self.second[i + 1]);
        (p1 - p0) / h + (m1 * (3.0 * b * b - 1.0) - m0 * (3.0 * a * a - 1.0)) * (h / 6.0)
    }
}

/// A [`CubicSpline`] in space, parametrised by chord length, with a table of its arc length.
#[derive(Debug, Clone)]
pub struct ArcSpline {
    cubic: CubicSpline<3>,
    /// Arc length up to each point, m.
    arc: Vec<f64>,
}

/// A point of a curve, with its tangent and curvature.
#[derive(Debug, Clone, Copy)]
pub struct CurvePoint {
    /// Position, m.
    pub x: Vector3<f64>,
    /// Unit tangent.
    pub tangent: Vector3<f64>,
    /// Curvature vector: derivative of the tangent by arc length, 1/m.
    pub curvature: Vector3<f64>,
}

/// Relative difference of one panel and two, above which these are halved: two err by a thousandth of it or less.
const PANEL_TOLERANCE: f64 = 1e-5;

/// Least over largest speed of a part that is not halved: at a cusp one panel may agree with two by chance.
const EVEN: f64 = 0.2;

/// Most times that a span is halved: at a cusp the error falls by four with each.
const MAX_HALVINGS: u32 = 14;

/// Most steps towards a parameter; halving alone is as near as rounding allows after 50.
const MAX_STEPS: u32 = 60;

impl ArcSpline {
    /// The spline through `points`, m. Points equal to their predecessor are omitted. `None` for fewer than
    /// two distinct points.
    pub fn through(points: &[Vector3<f64>]) -> Option<Self> {
        let mut p: Vec<Vector3<f64>> = Vec::with_capacity(points.len());
        let mut t: Vec<f64> = Vec::with_capacity(points.len());
        let span = polyline::length(points);
        for &x in points {
            match p.last() {
                None => t.push(0.0),
                Some(last) => {
                    let d = (x - last).norm();
                    // Below this the chord parametrisation loses its digits. False for NaN, too.
                    let distinct = d > span * 1e-9;
                    if !distinct {
                        continue;
                    }
                    t.push(t[t.len() - 1] + d);
                }
            }
            p.push(x);
        }
        if p.len() < 2 {
            return None;
        }
        let mut spline = ArcSpline { cubic: CubicSpline::through(t, p), arc: vec![0.0] };
        let knots = spline.cubic.t.len();
        for i in 0..knots - 1 {
            let l = spline.arc[i] + spline.span_length(i, spline.cubic.t[i + 1]);
            spline.arc.push(l);
        }
        Some(spline)
    }

    /// Arc length up to each interpolated point, m.
    pub fn arc(&self) -> &[f64] {
        &self.arc
    }

    /// Total arc length, m.
    pub fn length(&self) -> f64 {
        self.arc[self.arc.len() - 1]
    }

    /// The point at arc length `s`, m, clamped to the curve.
    pub fn at(&self, s: f64) -> CurvePoint {
        let t = &self.cubic.t;
        let n = t.len();
        let i = self.arc.partition_point(|&a| a <= s).clamp(1, n - 1) - 1;
        let (t0, t1) = (t[i], t[i + 1]);
        let target = s.clamp(0.0, self.length()) - self.arc[i];
        let mut t = t0 + (t1 - t0) * target / (self.arc[i + 1] - self.arc[i]);
        // Newton's method on a monotonic function: three or four steps from the linear estimate. At a cusp it leaves the
        // range in which the place is known to lie, which is halved then.
        let (mut low, mut high) = (t0, t1);
        for _ in 0..MAX_STEPS {
            let (excess, from) = (self.span_length(i, t) - target, t);
            if excess > 0.0 {
                high = t
            } else {
                low = t
            }
            t = (t - excess / self.cubic.slope(i, t).norm()).clamp(t0, t1);
            if !(low..=high).contains(&t) {
                t = low + 0.5 * (high - low);
            }
            // Quadratic convergence: the remaining error is rounding.
            if (t - from).abs() <= 1e-8 * (t1 - t0) {
                break;
            }
        }
        let [x, d1, d2] = self.cubic.in_span(i, t);
        let speed = d1.norm();
        let tangent = d1 / speed;
        CurvePoint { x, tangent, curvature: (d2 - tangent * tangent.dot(&d2)) / (speed * speed) }
    }

    /// Arc length from the start of span `i` to parameter `t`.
    fn span_length(&self, i: usize, t: f64) -> f64 {
        let t0 = self.cubic.t[i];
        let quarter = (t - t0) / 4.0;
        self.arc_length(i, t0, quarter, self.panel(i, t0 + 2.0 * quarter, 2.0 * quarter), MAX_HALVINGS)
    }

    /// Arc length of span `i` over four times `quarter` from parameter `start` on, which one panel finds as `whole`: two
    /// five-point panels, a relative error of 1e-9 on the curliest strands measured, or more where the curve nearly has
    /// a cusp.
    fn arc_length(&self, i: usize, start: f64, quarter: f64, whole: Panel, halvings: u32) -> f64 {
        let halves = [1.0, 3.0].map(|quarters| self.panel(i, start + quarters * quarter, quarter));
        let length = halves[0].length + halves[1].length;
        let slowest = halves[0].slowest.min(halves[1].slowest);
        let is_even = slowest >= EVEN * halves[0].fastest.max(halves[1].fastest);
        if halvings == 0 || is_even && (length - whole.length).abs() <= PANEL_TOLERANCE * length {
            return length;
        }
        let starts = [start, start + 2.0 * quarter];
        (0..2).map(|k| self.arc_length(i, starts[k], 0.5 * quarter, halves[k], halvings - 1)).sum()
    }

    /// Span `i` within `half` of the parameter `middle` by five-point Gauss quadrature.
    fn panel(&self, i: usize, middle: f64, half: f64) -> Panel {
        let speeds = GAUSS5.map(|(x, _)| self.cubic.slope(i, middle + half * x).norm());
        Panel {
            length: GAUSS5.iter().zip(speeds).map(|((_, w), speed)| w * speed).sum::<f64>() * half,
            slowest: speeds.into_iter().fold(f64::INFINITY, f64::min),
            fastest: speeds.into_iter().fold(0.0, f64::max),
        }
    }
}

/// A part of a curve between two parameters.
#[derive(Clone, Copy)]
struct Panel {
    /// m
    length: f64,
    /// Least and largest length per parameter at the points of the quadrature.
    slowest: f64,
    fastest: f64,
}

/// Second derivatives at the knots of the not-a-knot cubic spline.
fn not_a_knot<const D: usize>(t: &[f64], p: &[SVector<f64, D>]) -> Vec<SVector<f64, D>> {
    let n = t.len();
    if n <= 2 {
        return vec![SVector::zeros(); n];
    }
    let h = |i: usize| t[i + 1] - t[i];
    let slope = |i: usize| (p[i + 1] - p[i]) / h(i);
    if n == 3 {
        return vec![(slope(1) - slope(0)) * (2.0 / (h(0) + h(1))); 3];
    }
    // Rows 1..n−1, with the end values eliminated: m0 = m1 (1 + r) − m2 r, r = h0/h1, and likewise at the
    // end.
    let mut diag: Vec<f64> = (1..n - 1).map(|i| 2.0 * (h(i - 1) + h(i))).collect();
    let mut upper: Vec<f64> = (1..n - 1).map(h).collect();
    let mut lower: Vec<f64> = (1..n - 1).map(|i| h(i - 1)).collect();
    let mut m: Vec<SVector<f64, D>> = (1..n - 1).map(|i| (slope(i) - slope(i - 1)) * 6.0).collect();
    let k = n - 2;
    let (r0, r1) = (h(0) / h(1), h(n - 2) / h(n - 3));
    diag[0] += h(0) * (1.0 + r0);
    upper[0] -= h(0) * r0;
    diag[k - 1] += h(n - 2) * (1.0 + r1);
    lower[k - 1] -= h(n - 2) * r1;
    for i in 1..k {
        let f = lower[i] / diag[i - 1];
        diag[i] -= f * upper[i - 1];
        let prev = m[i - 1];
        m[i] -= prev * f;
    }
    m[k - 1] /= diag[k - 1];
    for i in (0..k - 1).rev() {
        let next = m[i + 1];
        m[i] = (m[i] - next * upper[i]) / diag[i];
    }
    let first = m[0] * (1.0 + r0) - m[1] * r0;
    let last = m[k - 1] * (1.0 + r1) - m[k - 2] * r1;
    m.insert(0, first);
    m.push(last);
    m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn length_and_curvature_of_a_helix_are_accurate() {
        let (r, pitch, turns) = (0.01_f64, 0.02_f64, 4.0_f64);
        let c = pitch / std::f64::consts::TAU;
        let curve = |a: f64| Vector3::new(r * a.cos(), r * a.sin(), c * a);
        let n = 200;
        let points: Vec<_> =
            (0..=n).map(|i| curve(turns * std::f64::consts::TAU * i as f64 / n as f64)).collect();
        let spline = ArcSpline::through(&points).unwrap();
        let length = turns * std::f64::consts::TAU * (r * r + c * c).sqrt();
        assert!((spline.length() - length).abs() < 1e-6 * length, "{}", spline.length() / length - 1.0);
        let kappa = r / (r * r + c * c);
        let mid = spline.at(length / 2.0);
        // The relative error of a cubic spline's second derivative is φ²/12 for an angle φ between
        // neighbours.
        let turn = std::f64::consts::TAU / 50.0;
        assert!((mid.curvature.norm() - kappa).abs() < turn * turn / 10.0 * kappa);
        let off = (mid.x - curve(turns * std::f64::consts::PI)).norm();
        assert!(off < 1e-6 * length, "{off}");
    }

    #[test]
    fn a_line_is_reproduced_and_repeated_points_are_omitted() {
        let line = [Vector3::zeros(), Vector3::x(), Vector3::x(), Vector3::x() * 2.5];
        let spline = ArcSpline::through(&line).unwrap();
        assert!((spline.length() - 2.5).abs() < 1e-14);
        assert!((spline.at(1.7).x - Vector3::x() * 1.7).norm() < 1e-14);
        assert!(ArcSpline::through(&[Vector3::x(), Vector3::x()]).is_none());
    }

    #[test]
    fn arc_lengths_of_a_curve_that_nearly_has_a_cusp_are_accurate() {
        // A strand that turns back on itself, a little aside.
        for aside in [1e-5, 1e-3] {
            let points: Vec<Vector3<f64>> =
                [[0.0, 0.0], [1.0, 0.0], [2.0, aside], [1.5, 2.0 * aside], [1.0, 2.0 * aside], [0.2, 0.0]]
                    .map(|[x, y]| Vector3::new(x, y, 0.0) * 1e-3)
                    .to_vec();
            let curve = ArcSpline::through(&points).unwrap();
            let (n, length) = (2000, curve.length());
            let place = |k: usize| curve.at(length * k as f64 / n as f64).x;
            let chords: Vec<f64> = (0..n).map(|k| (place(k + 1) - place(k)).norm()).collect();
            // One chord cuts the cusp off.
            assert!((chords.iter().sum::<f64>() / length - 1.0).abs() < 2.0 / n as f64, "{aside}");
            // No chord is longer than its arc.
            let longest = chords.iter().copied().fold(0.0, f64::max);
            assert!(longest < (1.0 + 1e-3) * length / n as f64, "{aside}: {longest}");
        }
    }
}
