//! Forward kinematics: frames and points of a rod from its unknowns.

use super::joint::{Joint, RootJoint};
use super::model::Rod;
use super::segment::{GAUSS, RodCore, Segment};
use crate::math::lanes::{self, M3, Mask, Real, Twist, V3};
use crate::math::se3::{self, Coefficients, Pose};
use nalgebra::{Matrix3, Vector3};

/// √3/12, the weight of the commutator in the fourth-order Magnus step (Iserles & Nørsett 1999).
pub(super) const COMMUTATOR: f64 = 0.144_337_567_297_406_44;

/// Rotation of a segment up to which its exponential is evaluated, rad: just below half a turn. The Magnus
/// series is inaccurate long before that.
const MAX_SEGMENT_TURN: f64 = 3.0;

/// Shape of a rod: frame and position at every point, world axes. The origin, which all that follows calls the root, is
/// where what carries the root has it: a free root is elsewhere.
#[derive(Debug, Clone)]
pub struct RodShape<F = f64> {
    pub(super) pose: Vec<lanes::Pose<F>>,
    /// For every segment, the exponent that leads from the pose at its start to that at its end.
    pub(super) exponent: Vec<MagnusExponent<F>>,
}

impl<F> Default for RodShape<F> {
    fn default() -> Self {
        RodShape { pose: Vec::new(), exponent: Vec::new() }
    }
}

/// Exponent of a segment and the coefficients of its closed forms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MagnusExponent<F> {
    pub psi: Twist<F>,
    pub coefficients: Coefficients<F>,
}

impl<F: Real> MagnusExponent<F> {
    #[inline(always)]
    pub fn new(psi: Twist<F>) -> Self {
        MagnusExponent { psi, coefficients: Coefficients::of(&psi) }
    }
}

impl RodShape {
    /// Sets the shape to that at unknowns `q` (1/m) with root frame `root` (columns d1, d2, d3, world axes).
    /// Returns `false` if a segment turns by more than `MAX_SEGMENT_TURN`: the shape is then invalid.
    pub fn update(&mut self, rod: &Rod, root: &Matrix3<f64>, q: &[f64]) -> bool {
        self.integrate(&rod.core, M3::from(*root), q) == 1
    }

    /// Largest angle by which a segment turns, rad.
    pub fn largest_turn(&self) -> f64 {
        self.exponent.iter().map(|e| e.psi.w.dot(e.psi.w)).fold(0.0, f64::max).sqrt()
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.pose.len()
    }

    /// Position of point `k` relative to the root, m.
    pub fn x(&self, k: usize) -> Vector3<f64> {
        self.pose[k].p.into()
    }

    /// Unit tangent at point `k`.
    pub fn tangent(&self, k: usize) -> Vector3<f64> {
        self.pose[k].r.0[2].into()
    }

    /// Unit vector d1 at point `k`.
    pub fn normal(&self, k: usize) -> Vector3<f64> {
        self.pose[k].r.0[0].into()
    }

    /// Frame at point `k`: columns d1, d2, d3.
    pub fn frame(&self, k: usize) -> Matrix3<f64> {
        self.pose[k].r.into()
    }

    /// Frame and position of every point.
    pub fn poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.pose.iter().map(|g| Pose { r: g.r.into(), p: g.p.into() })
    }

    /// Midpoint of segment `k` relative to the root, m; `q` are the unknowns of this shape. The mean of two
    /// half Magnus steps, forwards from its start and backwards from its end, of the strain that is linear
    /// through the Gauss points.
    pub fn midpoint(&self, rod: &Rod, k: usize, q: &[f64]) -> Vector3<f64> {
        let [forwards, backwards] = self.half_steps(rod, k, q);
        (Vector3::from(forwards.p) + Vector3::from(backwards.p)) / 2.0
    }

    /// The poses in the middle of segment `k`, reached from its start and from its end.
    fn half_steps(&self, rod: &Rod, k: usize, q: &[f64]) -> [lanes::Pose<f64>; 2] {
        let segment = &rod.core.segments[k];
        let d = deviation(segment, q);
        let [first, second] = [segment.strain[0] + d[0], segment.strain[1] + d[1]];
        let slope = (second - first) * 3_f64.sqrt();
        let mean = (first + second) * 0.5;
        let half_step = |from: &lanes::Pose<f64>, h: f64, at: [f64; 2]| {
            let [first, second] = at.map(|u| mean + slope * (u - 0.5));
            let commutator = first.cross(second) * (h * h * COMMUTATOR);
            let e = (first - second) * (h * h * COMMUTATOR);
            let psi = Twist { w: (first + second) * (0.5 * h) + commutator, v: V3([e.0[1], -e.0[0], h]) };
            from.compose(&se3::exp(&psi, &Coefficients::of(&psi)))
        };
        let h = 0.5 * segment.h;
        let forwards = half_step(&self.pose[k], h, GAUSS.map(|u| 0.5 * u));
        let backwards = half_step(&self.pose[k + 1], -h, GAUSS.map(|u| 1.0 - 0.5 * u));
        [forwards, backwards]
    }

    /// The points with the [midpoint](RodShape::midpoint) of every segment between them, m, relative to the
    /// root; `q` are the unknowns of this shape. Cubics through the points alone lose length where a rod is
    /// bent far more than by nature.
    pub fn refined_curve<'a>(
        &'a self,
        rod: &'a Rod,
        q: &'a [f64],
    ) -> impl Iterator<Item = Vector3<f64>> + 'a {
        let next = move |k: usize| [self.midpoint(rod, k, q), self.x(k + 1)];
        std::iter::once(self.x(0)).chain((0..rod.points() - 1).flat_map(next))
    }

    /// Largest relative error of the length of a segment, as cubics through its points and midpoint with the tangents
    /// there; `q` are the unknowns of this shape. The rod itself keeps its length.
    pub fn length_drift(&self, rod: &Rod, q: &[f64]) -> f64 {
        let drift = |(k, segment): (usize, &Segment<f64>)| {
            let [forwards, backwards] = self.half_steps(rod, k, q);
            let mean = |of: fn(&lanes::Pose<f64>) -> V3<f64>| {
                (Vector3::from(of(&forwards)) + Vector3::from(of(&backwards))) / 2.0
            };
            let (middle, tangent) = (mean(|pose| pose.p), mean(|pose| pose.r.0[2]).normalize());
            let half = 0.5 * segment.h;
            let length = cubic_length([self.x(k), middle], [self.tangent(k), tangent], half)
                + cubic_length([middle, self.x(k + 1)], [tangent, self.tangent(k + 1)], half);
            (length / segment.h - 1.0).abs()
        };
        rod.core.segments.iter().enumerate().map(drift).fold(0.0, f64::max)
    }

    /// The unit vectors d1 of the material frame at the points of [`RodShape::refined_curve`]
    /// (`docs/theory.md` eq. 3.4); `q` are the unknowns of this shape.
    pub fn refined_normals<'a>(
        &'a self,
        rod: &'a Rod,
        q: &'a [f64],
    ) -> impl Iterator<Item = Vector3<f64>> + 'a {
        let at = |pose: &lanes::Pose<f64>| Vector3::from(pose.r.0[0]);
        let next = move |k: usize| {
            let [forwards, backwards] = self.half_steps(rod, k, q);
            [(at(&forwards) + at(&backwards)).normalize(), at(&self.pose[k + 1])]
        };
        std::iter::once(at(&self.pose[0])).chain((0..rod.points() - 1).flat_map(next))
    }

    /// The place at fraction `s` (0..=1) of segment `k` on the polyline of [`RodShape::refined_curve`], as a
    /// blend of two points: their weights and positions relative to the root, m. The first point is fixed to
    /// the frame at point `k`, the second to the frame at point `k + 1` (`docs/theory.md` eq. 5.3).
    pub fn blend_points(&self, rod: &Rod, k: usize, s: f64) -> [(f64, Vector3<f64>); 2] {
        let reach = 0.25 * rod.core.segments[k].h;
        let ahead = self.x(k) + self.tangent(k) * (reach * (s / (1.0 - s)).min(1.0));
        let back = self.x(k + 1) - self.tangent(k + 1) * (reach * ((1.0 - s) / s).min(1.0));
        [(1.0 - s, ahead), (s, back)]
    }

    /// Position of the place of [`RodShape::blend_points`] relative to the root, m.
    pub fn curve_point(&self, rod: &Rod, k: usize, s: f64) -> Vector3<f64> {
        self.blend_points(rod, k, s).iter().map(|(weight, x)| x * *weight).sum()
    }

    /// Sets `out` to the points, then to the midpoints of all segments (of the cubics with the tangents at
    /// both ends), m; `root` is the position of the root.
    pub fn points_and_midpoints(&self, rod: &Rod, root: &Vector3<f64>, out: &mut Vec<Vector3<f64>>) {
        out.clear();
        out.extend((0..self.points()).map(|k| self.x(k) + root));
        let midpoint =
            |(k, segment): (usize, &Segment<f64>)| Vector3::from(self.cubic_midpoint(k, segment.h)) + root;
        out.extend(rod.core.segments.iter().enumerate().map(midpoint));
    }
}

impl<F: Real> RodShape<F> {
    /// [`RodShape::update`] in every lane; returns the lanes in which no segment turns by
    /// [`MAX_SEGMENT_TURN`].
    #[inline(always)]
    pub(super) fn integrate(&mut self, core: &RodCore<F>, root: M3<F>, q: &[F]) -> Mask {
        let zero = core.length.same(0.0);
        let mut most = zero;
        let mut g = lanes::Pose { r: root, p: V3::all(zero) };
        if core.joint != RootJoint::Clamped {
            let joint = Joint::new(q);
            if core.joint == RootJoint::Free {
                g.p = root * V3([q[3], q[4], q[5]]);
            }
            g.r = root * joint.rotation();
            // A joint may turn by twice as much as a segment.
            most = joint.squared_angle() * 0.25;
        }
        if self.exponent.len() != core.segments.len() || self.pose.len() != core.points() {
            self.pose.resize(core.points(), g);
            self.exponent.resize(core.segments.len(), MagnusExponent::new(Twist::none(zero)));
        }
        self.pose[0] = g;
        for ((segment, pose), exponent) in
            core.segments.iter().zip(&mut self.pose[1..]).zip(&mut self.exponent)
        {
            *exponent = MagnusExponent::new(psi(segment, &deviation(segment, q)));
            most = most.max(exponent.psi.w.dot(exponent.psi.w));
            g = g.compose(&se3::exp(&exponent.psi, &exponent.coefficients));
            *pose = g;
        }
        most.below(most.same(MAX_SEGMENT_TURN * MAX_SEGMENT_TURN))
    }

    /// Midpoint of the cubic with the positions and tangents at points `k` and `k + 1`, m, relative to the
    /// root; `h` is the length of the segment, m.
    #[inline(always)]
    pub(super) fn cubic_midpoint(&self, k: usize, h: F) -> V3<F> {
        let [a, b] = [&self.pose[k], &self.pose[k + 1]];
        (a.p + b.p) * h.same(0.5) + (a.r.0[2] - b.r.0[2]) * (h * 0.125)
    }

    /// Largest distance between corresponding points of two shapes, m.
    #[inline(always)]
    pub(super) fn distance(&self, other: &Self) -> F {
        let mut most = self.pose[0].p.0[0].same(0.0);
        for (a, b) in self.pose.iter().zip(&other.pose) {
            let d = a.p - b.p;
            most = most.max(d.dot(d));
        }
        most.sqrt()
    }
}

/// Length, m, of the cubic between the points `x`, m, with the unit tangents `t`, for a curve of length `h`, m, by
/// three-point Gauss quadrature.
fn cubic_length(x: [Vector3<f64>; 2], t: [Vector3<f64>; 2], h: f64) -> f64 {
    let (chord, [ta, tb]) = (x[1] - x[0], t.map(|t| t * h));
    let speed = |u: f64| {
        let (d, e, f) = (6.0 * u * (1.0 - u), 1.0 - 4.0 * u + 3.0 * u * u, 3.0 * u * u - 2.0 * u);
        (chord * d + ta * e + tb * f).norm()
    };
    let r = 0.5 * 0.6_f64.sqrt();
    (5.0 * speed(0.5 - r) + 8.0 * speed(0.5) + 5.0 * speed(0.5 + r)) / 18.0
}

/// Unknowns of node `i`; zero at a tip without any.
#[inline(always)]
fn node<F: Real>(q: &[F], i: usize) -> V3<F> {
    match q.get(3 * i..3 * i + 3) {
        Some(c) => V3([c[0], c[1], c[2]]),
        None => V3::all(q[0].same(0.0)),
    }
}

/// Deviation δ at the Gauss points of a segment, 1/m.
#[inline(always)]
pub(super) fn deviation<F: Real>(segment: &Segment<F>, q: &[F]) -> [V3<F>; 2] {
    let (l, r) = (node(q, segment.element), node(q, segment.element + 1));
    [r + (l - r) * segment.hat[0], r + (l - r) * segment.hat[1]]
}

/// Magnus exponent ψ of a segment: the natural one corrected by the deviation `d` at the Gauss points
/// (`docs/theory.md` eq. 3.2).
#[inline(always)]
fn psi<F: Real>(segment: &Segment<F>, d: &[V3<F>; 2]) -> Twist<F> {
    let k = segment.h * segment.h * COMMUTATOR;
    let [a1, a2] = segment.strain;
    let w = (d[0] + d[1]) * (segment.h * 0.5) + ((a1 + d[0]).cross(d[1]) + d[0].cross(a2)) * k;
    let e = (d[0] - d[1]) * k;
    let v = segment.natural.v;
    Twist { w: segment.natural.w + w, v: V3([v.0[0] + e.0[1], v.0[1] - e.0[0], v.0[2]]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::model::RodSource;
    use crate::rod::segment::SegmentSize;

    #[test]
    fn midpoints_agree_with_a_rod_of_half_the_segment_length() {
        let points: Vec<_> = (0..200)
            .map(|i| f64::from(i) * 0.02)
            .map(|t| Vector3::new(t.cos(), t.sin(), 0.5 * t) * 0.03)
            .collect();
        let rod = |segments: f64| {
            let length = 0.06 * 1.25_f64.sqrt() * 1.99;
            let max_length = length / 4.0 / (segments - 0.5);
            Rod::new(&RodSource {
                stiffness: [1e-9; 3],
                line_density: 1e-5,
                segment_size: SegmentSize { max_length, max_turn: 10.0 },
                ..RodSource::hair(&points, &[0.0, 0.25, 0.5, 0.75, 1.0])
            })
            .unwrap()
        };
        let q: Vec<f64> = (0..12).map(|i| 20.0 * f64::from(i * i).sin()).collect();
        let error = |segments: f64| {
            let (coarse, fine) = (rod(segments), rod(2.0 * segments));
            assert_eq!(2 * (coarse.points() - 1), fine.points() - 1);
            let mut shapes = [RodShape::default(), RodShape::default()];
            assert!(shapes[0].update(&coarse, &coarse.root.r, &q));
            assert!(shapes[1].update(&fine, &fine.root.r, &q));
            // In the frame of the preceding point, so that errors do not accumulate.
            let local = |shape: &RodShape, k: usize, x: Vector3<f64>| {
                let g = shape.poses().nth(k).unwrap();
                g.r.transpose() * (x - g.p)
            };
            let off = |k: usize| {
                let midpoint = local(&shapes[0], k, shapes[0].midpoint(&coarse, k, &q));
                (midpoint - local(&shapes[1], 2 * k, shapes[1].x(2 * k + 1))).norm()
            };
            (0..coarse.points() - 1).map(off).fold(0.0, f64::max)
        };
        let (coarse, fine) = (error(4.0), error(8.0));
        assert!(coarse < 5e-6 && fine < coarse / 6.0, "{coarse} {fine}");
    }

    #[test]
    fn a_segment_that_turns_far_keeps_its_length() {
        // A straight rod of one element, bent to arcs of up to 2 rad.
        let line = [Vector3::zeros(), Vector3::z() * 0.05];
        let rod = Rod::new(&RodSource::hair(&line, &[0.0, 1.0])).unwrap();
        let turn_of_first = |turn: f64| {
            let bend = turn / rod.arc[1];
            let mut shape = RodShape::default();
            let q = [bend, 0.0, 0.0].repeat(rod.unknowns() / 3);
            assert!(shape.update(&rod, &rod.root.r, &q));
            shape.length_drift(&rod, &q)
        };
        assert!(turn_of_first(1e-6) < 1e-12);
        assert!((1e-6..2e-3).contains(&turn_of_first(2.0)), "{}", turn_of_first(2.0));
    }
}
