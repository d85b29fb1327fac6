//! What does not change of a rod: its natural shape cut into Magnus sub-steps, its stiffness, its mass.

use crate::math::frame::{any_frame, double_reflection, frame_towards};
use crate::math::lanes::{self, Real, V3};
use crate::math::se3::{self, Pose, Twist};
use crate::math::spline::ArcSpline;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// How finely the elements of a rod are cut into sub-steps: two at least.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentSize {
    /// Longest sub-step, m.
    pub max_length: f64,
    /// Most that the natural shape turns in one sub-step, rad. The Magnus series converges below π.
    pub max_turn: f64,
}

impl SegmentSize {
    /// As the accuracy of the rod asks: what the sub-steps leave of the error is then far below what the nodes leave.
    pub const COARSE: SegmentSize = SegmentSize { max_length: f64::INFINITY, max_turn: 0.8 };

    /// As contact and writing ask: the polyline of a rod is within a tenth of a millimetre of its curve on a head (a 10 cm radius of
    /// curvature) and within a fiftieth of its radius on a curl.
    pub const FINE: SegmentSize = SegmentSize { max_length: 0.01, max_turn: 0.4 };
}

/// Gauss points of a sub-step, as fractions of it: ½ ∓ √3/6.
pub(super) const GAUSS: [f64; 2] = [0.211_324_865_405_187_13, 0.788_675_134_594_812_9];

/// One Magnus sub-step of the natural shape.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step<F> {
    /// Element (between nodes `element` and `element + 1`) that holds it.
    pub element: usize,
    /// Length h, m.
    pub h: F,
    /// Exponent of the natural shape: exact, so that the natural shape is met to rounding at q = 0.
    pub natural: lanes::Twist<F>,
    /// Natural strain at the two Gauss points, 1/m.
    pub strain: [V3<F>; 2],
    /// Hat functions of the left node at the two Gauss points; the right node's are one minus these.
    pub left: [F; 2],
}

/// What the step of a rod, or of several in lanes, reads of it.
#[derive(Debug, Clone)]
pub(super) struct Beam<F> {
    /// Sub-steps, root first.
    pub steps: Vec<Step<F>>,
    /// ∫ N_i N_j σ ds, m, σ being the stiffness over that at the root: diagonal, and next to it.
    pub hat: Vec<[F; 2]>,
    /// (E I1, E I2, G J), N·m².
    pub stiffness: [F; 3],
    /// Generalised force of natural pre-bending, N·m²; see [`Rod::set_natural_offset`].
    pub prebend: Vec<F>,
    /// Length L, m.
    pub length: F,
    /// Length of the longest sub-step, m.
    pub longest: F,
    /// Mass, kg.
    pub mass: F,
}

impl<F: Real> Beam<F> {
    /// Number of unknowns.
    #[inline(always)]
    pub fn unknowns(&self) -> usize {
        3 * self.hat.len()
    }

    /// Number of points.
    #[inline(always)]
    pub fn points(&self) -> usize {
        self.steps.len() + 1
    }

    /// y += a · (stiffness matrix ∫ N_i K N_j ds) x, of the integrals `hat` of N_i N_j.
    #[inline(always)]
    pub fn add_elastic(&self, hat: &[[F; 2]], a: F, x: &[F], y: &mut [F]) {
        let n = hat.len();
        for i in 0..n {
            for c in 0..3 {
                let mut s = hat[i][0] * x[3 * i + c];
                if i > 0 {
                    s += hat[i - 1][1] * x[3 * (i - 1) + c];
                }
                if i + 1 < n {
                    s += hat[i][1] * x[3 * (i + 1) + c];
                }
                y[3 * i + c] += a * self.stiffness[c] * s;
            }
        }
    }
}

/// What a rod is made from. SI units, rest space.
#[derive(Debug, Clone)]
pub struct RodSource<'a> {
    /// Points of the centre line, root first.
    pub points: &'a [Vector3<f64>],
    /// Root frame (columns d1, d2, d3); `None` takes any frame around the root tangent. Its d3 is used as the
    /// clamp direction where given.
    pub root_frame: Option<UnitQuaternion<f64>>,
    /// Arc-length fractions of the strain nodes, from 0 to 1.
    pub arc: &'a [f64],
    /// (E I1, E I2, G J) at the root, N·m².
    pub stiffness: [f64; 3],
    /// ρ S at the root, kg/m.
    pub line_density: f64,
    /// Kelvin-Voigt relaxation time at the root, s.
    pub damping: f64,
    /// What changes towards the tip.
    pub taper: Taper,
    /// Constant natural strain, 1/m; `None` takes the shape of `points` as natural.
    pub natural_strain: Option<Vector3<f64>>,
    /// How finely it is cut.
    pub segment_size: SegmentSize,
}

/// What a rod is at its tip over what it is at its root, changing evenly between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taper {
    /// Moduli.
    pub stiffness: f64,
    /// Radius: the mass goes as its square, the stiffness of the section as its fourth power.
    pub radius: f64,
    /// Relaxation time.
    pub damping: f64,
}

impl Taper {
    /// A rod that is the same all along.
    pub const NONE: Taper = Taper { stiffness: 1.0, radius: 1.0, damping: 1.0 };
}

/// A rod: everything about it that does not change over a bake.
#[derive(Debug, Clone)]
pub struct Rod {
    /// Arc lengths of the strain nodes, m.
    pub nodes: Vec<f64>,
    /// Root pose in rest space.
    pub root: Pose,
    /// Arc length of every point, m.
    pub arc: Vec<f64>,
    /// Mass that each point stands for, kg.
    pub mass: Vec<f64>,
    /// Arc length that each point stands for in integrals along the rod (composite Simpson), m; one per point.
    pub weight: Vec<f64>,
    /// Starting deviation: the groom's shape as seen from the natural one, 1/m.
    pub initial_q: Vec<f64>,
    pub(super) beam: Beam<f64>,
    /// ∫ N_i N_j σ τ ds, m·s, τ being the relaxation time.
    pub(super) damping: Vec<[f64; 2]>,
}

impl Rod {
    /// Builds a rod; `None` where the points are fewer than two or do not differ.
    pub fn new(source: &RodSource) -> Option<Rod> {
        let spline = ArcSpline::through(source.points)?;
        let length = spline.length();
        let nodes: Vec<f64> = source.arc.iter().map(|u| u * length).collect();
        let root = root_pose(source, &spline);
        // The sharpest of some samples, two or more to a drawn segment, times the length: an upper estimate of the turn, as drawn and
        // by nature.
        let turning = |a: f64, b: f64| {
            let drawn = spline.arc().partition_point(|s| *s < b) - spline.arc().partition_point(|s| *s <= a);
            let samples = 2 * (drawn + 1).max(4);
            (0..=samples)
                .map(|i| spline.at(a + (b - a) * i as f64 / samples as f64).curvature.norm())
                .fold(source.natural_strain.map_or(0.0, |w| w.norm()), f64::max)
                * (b - a)
        };
        let mut steps = Vec::new();
        let mut weight = vec![0.0];
        let mut frame = root.r;
        let mut deviation = Vec::new();
        for (element, node) in nodes.windows(2).enumerate() {
            let l = node[1] - node[0];
            // Simpson's rule needs an even number.
            let pairs = (turning(node[0], node[1]) / source.segment_size.max_turn)
                .max(l / source.segment_size.max_length)
                .max(2.0)
                / 2.0;
            let n = 2 * pairs.ceil() as usize;
            let h = l / n as f64;
            for k in 0..n {
                let a = node[0] + h * k as f64;
                let drawn = DrawnStep::new(&spline, &mut frame, a, h);
                let left = GAUSS.map(|g| 1.0 - (k as f64 + g) / n as f64);
                let (natural, strain) = match source.natural_strain {
                    None => (drawn.exponent, drawn.strain),
                    Some(w) => (Twist::new(w * h, Vector3::z() * h), [w; 2]),
                };
                let natural = lanes::Twist { w: natural.w.into(), v: natural.v.into() };
                let strain = strain.map(V3::from);
                deviation.push(drawn.strain.map(|w| w - source.natural_strain.unwrap_or(w)));
                steps.push(Step { element, h, natural, strain, left });
                if k % 2 == 0 {
                    let last = weight.len() - 1;
                    weight[last] += h / 3.0;
                    weight.extend([4.0 * h / 3.0, h / 3.0]);
                }
            }
        }
        let free = nodes.len() - 1;
        let taper = &source.taper;
        let arc: Vec<f64> = std::iter::once(0.0)
            .chain(steps.iter().scan(0.0, |s, step: &Step<f64>| {
                *s += step.h;
                Some(*s)
            }))
            .collect();
        let mass = arc.iter().zip(&weight);
        let mass =
            mass.map(|(s, weight)| weight * source.line_density * towards(taper.radius, s / length).powi(2));
        let mass: Vec<f64> = mass.collect();
        let beam = Beam {
            hat: hat_matrix(&nodes, |_| 1.0),
            stiffness: source.stiffness,
            prebend: vec![0.0; 3 * free],
            length,
            longest: steps.iter().map(|s: &Step<f64>| s.h).fold(0.0, f64::max),
            mass: mass.iter().sum(),
            steps,
        };
        let (initial_q, damping) = (vec![0.0; 3 * free], Vec::new());
        let mut rod = Rod { root, arc, mass, weight, initial_q, nodes, beam, damping };
        if source.natural_strain.is_some() {
            rod.initial_q = rod.project(&deviation);
        }
        // From here on the integrals are those of the stiffness.
        let sigma = |u: f64| towards(taper.stiffness, u) * towards(taper.radius, u).powi(4);
        rod.beam.hat = hat_matrix(&rod.nodes, sigma);
        rod.damping = hat_matrix(&rod.nodes, |u| sigma(u) * source.damping * towards(taper.damping, u));
        Some(rod)
    }

    /// Arc length L, m.
    pub fn length(&self) -> f64 {
        self.nodes[self.nodes.len() - 1]
    }

    /// Number of unknowns: three at every node but the tip, where a free end has no deviation.
    pub fn unknowns(&self) -> usize {
        3 * (self.nodes.len() - 1)
    }

    /// Number of points of the polyline: one more than there are sub-steps.
    pub fn points(&self) -> usize {
        self.beam.points()
    }

    /// The point at node `node`.
    pub fn node_point(&self, node: usize) -> usize {
        self.beam.steps.partition_point(|step| step.element < node)
    }

    /// Arc that a node stands for where a rod is cut at its nodes, m.
    pub fn lumped_length(&self, node: usize) -> f64 {
        let last = self.nodes.len() - 1;
        0.5 * (self.nodes[(node + 1).min(last)] - self.nodes[node.saturating_sub(1)])
    }

    /// Length of sub-step `k`, m, its element, and the shares that the nodes at that element's start and end have in its strain, on average.
    pub(super) fn segment(&self, k: usize) -> (f64, usize, [f64; 2]) {
        let step = &self.beam.steps[k];
        let left = 0.5 * (step.left[0] + step.left[1]);
        (step.h, step.element, [left, 1.0 - left])
    }

    /// Mass that a node stands for where a rod is cut at its nodes and is as thick all along as on average, kg.
    pub fn lumped_mass(&self, node: usize) -> f64 {
        self.lumped_length(node) / self.length() * self.beam.mass
    }

    /// Arc length of a place on the segment from point `k` to the next, 0..=1 of it, as a share of the rod's length.
    pub fn arc_fraction(&self, k: usize, u: f64) -> f64 {
        (self.arc[k] + (self.arc[k + 1] - self.arc[k]) * u) / self.length()
    }

    /// Hat-function coefficients closest (L2) to a strain given at the Gauss points of every sub-step, with none
    /// at the tip.
    fn project(&self, strain: &[[Vector3<f64>; 2]]) -> Vec<f64> {
        let n = self.nodes.len() - 1;
        let mut rhs = vec![Vector3::zeros(); n + 1];
        for (step, w) in self.beam.steps.iter().zip(strain) {
            for (w, left) in w.iter().zip(step.left) {
                rhs[step.element] += w * (left * step.h / 2.0);
                rhs[step.element + 1] += w * ((1.0 - left) * step.h / 2.0);
            }
        }
        self.solve_hat(&mut rhs[..n]);
        rhs[..n].iter().flat_map(|w| [w.x, w.y, w.z]).collect()
    }

    /// Solves the hat mass matrix (tridiagonal) in place.
    fn solve_hat(&self, rhs: &mut [Vector3<f64>]) {
        let n = rhs.len();
        let hat = &self.beam.hat;
        let mut diag: Vec<f64> = hat[..n].iter().map(|m| m[0]).collect();
        for i in 1..n {
            let f = hat[i - 1][1] / diag[i - 1];
            diag[i] -= f * hat[i - 1][1];
            let prev = rhs[i - 1];
            rhs[i] -= prev * f;
        }
        for i in (0..n).rev() {
            if i + 1 < n {
                let next = rhs[i + 1];
                rhs[i] -= next * hat[i][1];
            }
            rhs[i] /= diag[i];
        }
    }

    /// The elastic stiffness matrix K = ∫ N_i K N_j ds, row-major n × n, N·m³.
    pub fn elastic_matrix(&self) -> Vec<f64> {
        self.stiffened(&self.beam.hat)
    }

    /// The matrix ∫ N_i τ K N_j ds of its internal damping, row-major n × n, N·m³·s.
    pub fn damping_matrix(&self) -> Vec<f64> {
        self.stiffened(&self.damping)
    }

    /// A matrix of hat functions times the stiffness.
    fn stiffened(&self, hat: &[[f64; 2]]) -> Vec<f64> {
        let n = self.unknowns();
        let mut unit = vec![0.0; n];
        let mut rows = vec![0.0; n * n];
        for (i, row) in rows.chunks_exact_mut(n).enumerate() {
            unit[i] = 1.0;
            self.beam.add_elastic(hat, 1.0, &unit, row);
            unit[i] = 0.0;
        }
        rows
    }

    /// K⁻¹ load: the strain at the nodes, 1/m, at which elasticity balances a generalised force, N·m².
    pub fn static_strain(&self, load: &[f64]) -> Vec<f64> {
        let stiffness = Vector3::from(self.beam.stiffness);
        let mut strain: Vec<Vector3<f64>> =
            load.chunks_exact(3).map(|f| Vector3::from_column_slice(f).component_div(&stiffness)).collect();
        self.solve_hat(&mut strain);
        strain.iter().flat_map(|w| [w.x, w.y, w.z]).collect()
    }

    /// Multiplies the stiffness.
    pub fn scale_stiffness(&mut self, factor: f64) {
        self.beam.stiffness.iter_mut().for_each(|k| *k *= factor);
    }

    /// Moves the natural strain by `strain` at the nodes, 1/m, from what the rod was made with.
    pub fn set_natural_offset(&mut self, strain: &[f64]) {
        let mut prebend = vec![0.0; strain.len()];
        self.beam.add_elastic(&self.beam.hat, 1.0, strain, &mut prebend);
        self.beam.prebend = prebend;
    }
}

/// One sub-step of the drawn curve.
struct DrawnStep {
    exponent: Twist,
    strain: [Vector3<f64>; 2],
}

impl DrawnStep {
    /// Measures the curve over [a, a + h] and carries `frame` along it without twist.
    fn new(spline: &ArcSpline, frame: &mut Matrix3<f64>, a: f64, h: f64) -> Self {
        let start = Pose { r: *frame, p: spline.at(a).x };
        let mut strain = [Vector3::zeros(); 2];
        let mut at = a;
        let mut advance = |to: f64, frame: &mut Matrix3<f64>| {
            // Several short reflections: the transport's error is of fourth order in their length.
            for i in 1..=2 {
                let (from, next) = (spline.at(at), spline.at(at + (to - at) * i as f64 / 2.0));
                *frame = double_reflection(frame, &from, &next);
            }
            at = to;
            spline.at(to).curvature
        };
        for (g, w) in GAUSS.iter().zip(&mut strain) {
            // d3' = κ2 d1 − κ1 d2.
            let bend = advance(a + g * h, frame);
            *w = Vector3::new(-bend.dot(&frame.column(1)), bend.dot(&frame.column(0)), 0.0);
        }
        advance(a + h, frame);
        let end = Pose { r: *frame, p: spline.at(a + h).x };
        DrawnStep { exponent: se3::log(&start.inverse().compose(&end)), strain }
    }
}

fn root_pose(source: &RodSource, spline: &ArcSpline) -> Pose {
    let at = spline.at(0.0);
    let r = match source.root_frame {
        // A clamp direction that is not the drawn tangent is honoured for a given natural strain; for a drawn
        // natural shape the drawn tangent is the clamp's.
        Some(q) if source.natural_strain.is_some() => q.to_rotation_matrix().into_inner(),
        Some(q) => frame_towards(&at.tangent, &(q * Vector3::x())),
        None => any_frame(&at.tangent),
    };
    Pose { r, p: at.x }
}

/// What changes evenly from 1 at the root to `tip`, at a share `u` of the length.
fn towards(tip: f64, u: f64) -> f64 {
    1.0 + (tip - 1.0) * u
}

/// ∫ N_i N_i σ ds and ∫ N_i N_{i+1} σ ds for every node, σ being told for shares of the length: exact for polynomials up to the seventh degree
/// (Gauss's rule of five points; Abramowitz & Stegun 1964, table 25.4).
fn hat_matrix(nodes: &[f64], sigma: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
    const HALF: [(f64, f64); 3] = [
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (0.906_179_845_938_664, 0.236_926_885_056_189_08),
    ];
    let length = nodes[nodes.len() - 1];
    let places = HALF.iter().flat_map(|&(x, w)| [(0.5 - 0.5 * x, w), (0.5 + 0.5 * x, w)]).skip(1);
    // ∫ of the products of the falling hat with itself, the two, and the rising one with itself.
    let element = |i: usize| {
        let (from, l) = (nodes[i], nodes[i + 1] - nodes[i]);
        places.clone().fold([0.0; 3], |[a, b, c], (u, w)| {
            let w = 0.5 * w * l * sigma((from + u * l) / length);
            [a + w * (1.0 - u) * (1.0 - u), b + w * u * (1.0 - u), c + w * u * u]
        })
    };
    let mut before = 0.0;
    let entry = |i: usize| {
        let [a, b, c] = element(i);
        [a + std::mem::replace(&mut before, c), b]
    };
    (0..nodes.len() - 1).map(entry).collect()
}

#[cfg(test)]
impl Rod {
    /// A bent and twisted rod for tests, with unknowns, 1/m, that wind it.
    pub(crate) fn bent_sample() -> (Self, Vec<f64>) {
        let rod = Rod::new(&RodSource {
            points: &[Vector3::zeros(), Vector3::new(0.03, 0.1, 0.0), Vector3::new(0.1, 0.15, 0.03)],
            root_frame: None,
            arc: &[0.0, 0.25, 0.5, 1.0],
            stiffness: [1e-9; 3],
            line_density: 1e-5,
            damping: 0.0,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize { max_length: 0.005, max_turn: 0.4 },
        })
        .unwrap();
        let q = (0..rod.unknowns()).map(|i| 20.0 * (i as f64 * 1.3).sin()).collect();
        (rod, q)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{RodShape, Sensitivity};

    #[test]
    fn a_tapered_rod_bends_as_a_tapered_beam() {
        let (l, ei, density, g) = (0.1, 7.8e-9, 6.6e-6, 9.81);
        let arc: Vec<f64> = (0..33).map(|i| f64::from(i) / 32.0).collect();
        let taper = Taper { stiffness: 0.5, radius: 0.6, damping: 1.0 };
        let rod = Rod::new(&RodSource {
            points: &[Vector3::zeros(), Vector3::x() * l],
            root_frame: None,
            arc: &arc,
            stiffness: [ei, ei, 3.6e-9],
            line_density: density,
            damping: 0.0,
            taper,
            natural_strain: None,
            segment_size: SegmentSize::FINE,
        })
        .unwrap();
        // Curvature M/EI at the root and half way, of the weight of what is beyond, by hand.
        let n = 20_000;
        let moment = |s: f64| -> f64 {
            let beyond = (0..n).map(|i| s + (l - s) * (f64::from(i) + 0.5) / f64::from(n));
            beyond.map(|x| density * towards(0.6, x / l).powi(2) * g * (x - s)).sum::<f64>() * (l - s)
                / f64::from(n)
        };
        let mut shape = RodShape::default();
        let (mut sensitivity, zero) = (Sensitivity::default(), vec![0.0; rod.unknowns()]);
        shape.update(&rod, &rod.root.r, &zero);
        sensitivity.update(&rod, &shape, &zero);
        let mut load = vec![0.0; rod.unknowns()];
        for k in 1..rod.points() {
            sensitivity.add_row(k, &shape.x(k), &(Vector3::y() * -g), rod.mass[k], &mut load);
        }
        let strain = rod.static_strain(&load);
        for (node, s) in [(0, 0.0), (16, 0.5 * l)] {
            let u = s / l;
            let stiffness = ei * towards(0.5, u) * towards(0.6, u).powi(4);
            let found = Vector3::from_column_slice(&strain[3 * node..3 * node + 3]).norm();
            assert!(
                (found / (moment(s) / stiffness) - 1.0).abs() < 2e-3,
                "{found} {}",
                moment(s) / stiffness
            );
        }
        let mass = density * l * (1.0 + 0.6 + 0.36) / 3.0;
        assert!((rod.mass.iter().sum::<f64>() / mass - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_taper_is_integrated_exactly() {
        let nodes = [0.0, 0.03, 0.07, 0.13];
        let hat = |i: usize, s: f64| {
            let side =
                |a: f64, b: f64| if (a.min(b)..a.max(b)).contains(&s) { (s - a) / (b - a) } else { 0.0 };
            let rising = if i > 0 { side(nodes[i - 1], nodes[i]) } else { 0.0 };
            rising + if i + 1 < nodes.len() { side(nodes[i + 1], nodes[i]) } else { 0.0 }
        };
        let sigma = |u: f64| towards(0.2, u) * towards(1.3, u).powi(4) * towards(3.0, u);
        let (n, found) = (130_000, hat_matrix(&nodes, sigma));
        for (i, row) in found.iter().enumerate() {
            for (j, found) in row.iter().enumerate() {
                let sum: f64 = (0..n)
                    .map(|k| (k as f64 + 0.5) / n as f64 * 0.13)
                    .map(|s| hat(i, s) * hat(i + j, s) * sigma(s / 0.13))
                    .sum();
                assert!((sum * 0.13 / n as f64 - found).abs() < 1e-7 * found.max(1e-3), "{i} {j}");
            }
        }
        let l = |i: usize| nodes[i + 1] - nodes[i];
        let plain = hat_matrix(&nodes, |_| 1.0);
        let exact = [[l(0) / 3.0, l(0) / 6.0], [(l(1) + l(0)) / 3.0, l(1) / 6.0]];
        for (plain, exact) in plain.iter().zip(exact).flat_map(|(a, b)| a.iter().copied().zip(b)) {
            assert!((plain / exact - 1.0).abs() < 1e-15);
        }
    }
}
