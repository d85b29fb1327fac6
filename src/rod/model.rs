//! What does not change of a rod: its natural shape cut into Magnus sub-steps, its stiffness, its mass.

use crate::math::frame::{any_frame, double_reflection, frame_towards};
use crate::math::lanes::{self, Real, V3};
use crate::math::se3::{self, Pose, Twist};
use crate::math::spline::ArcSpline;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// How finely the elements of a rod are cut into sub-steps: two at least.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// Longest sub-step, m.
    pub length: f64,
    /// Most that the natural shape turns in one sub-step, rad. The Magnus series converges below π.
    pub turn: f64,
}

impl Cut {
    /// As the accuracy of the rod asks: what the sub-steps leave of the error is then far below what the nodes leave.
    pub const COARSE: Cut = Cut { length: f64::INFINITY, turn: 0.8 };

    /// As contact and writing ask: the polyline of a rod is within a tenth of a millimetre of its curve on a head (a 10 cm radius of
    /// curvature) and within a fiftieth of its radius on a curl.
    pub const FINE: Cut = Cut { length: 0.01, turn: 0.4 };
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
    /// Kelvin-Voigt relaxation time, s.
    pub damping: F,
    /// Generalised force of natural pre-bending, N·m²; see [`Rod::move_natural`].
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

    /// y += a · (elastic stiffness matrix ∫ N_i K N_j ds) x.
    #[inline(always)]
    pub fn add_elastic(&self, a: F, x: &[F], y: &mut [F]) {
        let n = self.hat.len();
        for i in 0..n {
            for c in 0..3 {
                let mut s = self.hat[i][0] * x[3 * i + c];
                if i > 0 {
                    s += self.hat[i - 1][1] * x[3 * (i - 1) + c];
                }
                if i + 1 < n {
                    s += self.hat[i][1] * x[3 * (i + 1) + c];
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
    /// (E I1, E I2, G J), N·m².
    pub stiffness: [f64; 3],
    /// ρ S, kg/m.
    pub line_density: f64,
    /// Kelvin-Voigt relaxation time, s.
    pub damping: f64,
    /// Constant natural strain, 1/m; `None` takes the shape of `points` as natural.
    pub natural: Option<Vector3<f64>>,
    /// How finely it is cut.
    pub cut: Cut,
}

/// A rod: everything about it that does not change over a bake.
#[derive(Debug, Clone)]
pub struct Rod {
    /// Arc lengths of the strain nodes, m.
    pub nodes: Vec<f64>,
    /// Root pose in rest space.
    pub root: Pose,
    /// ρ S, kg/m.
    pub line_density: f64,
    /// Arc length that each point stands for in integrals along the rod (composite Simpson), m; one per point.
    pub weight: Vec<f64>,
    /// Starting deviation: the groom's shape as seen from the natural one, 1/m.
    pub start: Vec<f64>,
    pub(super) beam: Beam<f64>,
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
                .fold(source.natural.map_or(0.0, |w| w.norm()), f64::max)
                * (b - a)
        };
        let mut steps = Vec::new();
        let mut weight = vec![0.0];
        let mut frame = root.r;
        let mut deviation = Vec::new();
        for (element, node) in nodes.windows(2).enumerate() {
            let l = node[1] - node[0];
            // Simpson's rule needs an even number.
            let pairs =
                (turning(node[0], node[1]) / source.cut.turn).max(l / source.cut.length).max(2.0) / 2.0;
            let n = 2 * pairs.ceil() as usize;
            let h = l / n as f64;
            for k in 0..n {
                let a = node[0] + h * k as f64;
                let drawn = DrawnStep::new(&spline, &mut frame, a, h);
                let left = GAUSS.map(|g| 1.0 - (k as f64 + g) / n as f64);
                let (natural, strain) = match source.natural {
                    None => (drawn.exponent, drawn.strain),
                    Some(w) => (Twist::new(w * h, Vector3::z() * h), [w; 2]),
                };
                let natural = lanes::Twist { w: natural.w.into(), v: natural.v.into() };
                let strain = strain.map(V3::from);
                deviation.push(drawn.strain.map(|w| w - source.natural.unwrap_or(w)));
                steps.push(Step { element, h, natural, strain, left });
                if k % 2 == 0 {
                    let last = weight.len() - 1;
                    weight[last] += h / 3.0;
                    weight.extend([4.0 * h / 3.0, h / 3.0]);
                }
            }
        }
        let free = nodes.len() - 1;
        let beam = Beam {
            hat: hat_matrix(&nodes, 1.0),
            stiffness: source.stiffness,
            damping: source.damping,
            prebend: vec![0.0; 3 * free],
            length,
            longest: steps.iter().map(|s: &Step<f64>| s.h).fold(0.0, f64::max),
            mass: source.line_density * length,
            steps,
        };
        let start = vec![0.0; 3 * free];
        let mut rod = Rod { root, line_density: source.line_density, weight, start, nodes, beam };
        if source.natural.is_some() {
            rod.start = rod.project(&deviation);
        }
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

    /// Arc length of each point, m.
    pub fn arc_lengths(&self) -> Vec<f64> {
        let mut s = vec![0.0];
        for step in &self.beam.steps {
            s.push(s[s.len() - 1] + step.h);
        }
        s
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
    pub fn elastic(&self) -> Vec<f64> {
        let n = self.unknowns();
        let mut unit = vec![0.0; n];
        let mut rows = vec![0.0; n * n];
        for (i, row) in rows.chunks_exact_mut(n).enumerate() {
            unit[i] = 1.0;
            self.beam.add_elastic(1.0, &unit, row);
            unit[i] = 0.0;
        }
        rows
    }

    /// K⁻¹ load: the strain at the nodes, 1/m, at which elasticity balances a generalised force, N·m².
    pub fn strain_under(&self, load: &[f64]) -> Vec<f64> {
        let stiffness = Vector3::from(self.beam.stiffness);
        let mut strain: Vec<Vector3<f64>> =
            load.chunks_exact(3).map(|f| Vector3::from_column_slice(f).component_div(&stiffness)).collect();
        self.solve_hat(&mut strain);
        strain.iter().flat_map(|w| [w.x, w.y, w.z]).collect()
    }

    /// Makes the stiffness change evenly along the rod, to `tip` times that at the root. Before the natural strain is moved.
    pub fn taper(&mut self, tip: f64) {
        self.beam.hat = hat_matrix(&self.nodes, tip);
    }

    /// Multiplies the stiffness.
    pub fn stiffen(&mut self, factor: f64) {
        self.beam.stiffness.iter_mut().for_each(|k| *k *= factor);
    }

    /// Moves the natural strain by `strain` at the nodes, 1/m, from what the rod was made with.
    pub fn move_natural(&mut self, strain: &[f64]) {
        let mut prebend = vec![0.0; strain.len()];
        self.beam.add_elastic(1.0, strain, &mut prebend);
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
        Some(q) if source.natural.is_some() => q.to_rotation_matrix().into_inner(),
        Some(q) => frame_towards(&at.tangent, &(q * Vector3::x())),
        None => any_frame(&at.tangent),
    };
    Pose { r, p: at.x }
}

/// ∫ N_i N_i σ ds and ∫ N_i N_{i+1} σ ds for every node, σ going evenly from 1 at the first to `tip` at the last.
fn hat_matrix(nodes: &[f64], tip: f64) -> Vec<[f64; 2]> {
    let l = |i: usize| nodes[i + 1] - nodes[i];
    let sigma = |i: usize| 1.0 + (tip - 1.0) * (nodes[i] / nodes[nodes.len() - 1]);
    let entry = |i: usize| {
        let after = l(i) * (3.0 * sigma(i) + sigma(i + 1));
        let before = if i > 0 { l(i - 1) * (sigma(i - 1) + 3.0 * sigma(i)) } else { 0.0 };
        [(after + before) / 12.0, l(i) * (sigma(i) + sigma(i + 1)) / 12.0]
    };
    (0..nodes.len() - 1).map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taper_is_integrated_exactly_and_none_changes_no_bit() {
        let nodes = [0.0, 0.03, 0.07, 0.13];
        let hat = |i: usize, s: f64| {
            let side =
                |a: f64, b: f64| if (a.min(b)..a.max(b)).contains(&s) { (s - a) / (b - a) } else { 0.0 };
            let rising = if i > 0 { side(nodes[i - 1], nodes[i]) } else { 0.0 };
            rising + if i + 1 < nodes.len() { side(nodes[i + 1], nodes[i]) } else { 0.0 }
        };
        let tip = 0.2;
        let (n, found) = (130_000, hat_matrix(&nodes, tip));
        for (i, row) in found.iter().enumerate() {
            for (j, found) in row.iter().enumerate() {
                let sum: f64 = (0..n)
                    .map(|k| (k as f64 + 0.5) / n as f64 * 0.13)
                    .map(|s| hat(i, s) * hat(i + j, s) * (1.0 + (tip - 1.0) * s / 0.13))
                    .sum();
                assert!((sum * 0.13 / n as f64 - found).abs() < 1e-7 * found.max(1e-3), "{i} {j}");
            }
        }
        let l = |i: usize| nodes[i + 1] - nodes[i];
        let plain = hat_matrix(&nodes, 1.0);
        assert_eq!(plain[0], [l(0) / 3.0, l(0) / 6.0]);
        assert_eq!(plain[1], [(l(1) + l(0)) / 3.0, l(1) / 6.0]);
    }
}
