//! The constants of a rod: natural shape, stiffness, damping and mass.

use super::drawn::{DrawnSegment, max_turn};
use super::hat::{hat_matrix, solve_hat};
use super::joint::RootJoint;
use super::segment::{GAUSS, RodCore, Segment, SegmentSize};
use crate::math::frame::{any_frame, frame_towards};
use crate::math::lanes::{self, V3};
use crate::math::se3::{Pose, Twist};
use crate::math::spline::ArcSpline;
use nalgebra::{UnitQuaternion, Vector3};

/// Gravity of the Earth, m/s².
const STANDARD_GRAVITY: f64 = 9.81;

/// Rate at which friction in a root that turns slows the swing of a rod at most, 1/s. It keeps a straight rod from
/// spinning about itself, for which it has no inertia.
const JOINT_DAMPING: f64 = 1e-4;

/// The same of a free root of a straight rod. It is more because contact would else bring points a little nearer or
/// farther by spinning a nearly straight rod far. It is little against the drag of the air, tens per second.
const FREE_DAMPING: f64 = 1e-3;

/// How far skin gives way to a fibre that presses on it, m/N.
const SKIN_COMPLIANCE: f64 = 0.05;

/// Input of [`Rod::new`]. SI units, rest space.
#[derive(Debug, Clone)]
pub struct RodSource<'a> {
    /// Points of the centre line, root first, m.
    pub points: &'a [Vector3<f64>],
    /// Root frame (columns d1, d2, d3); `None` takes any frame around the root tangent. Its d3 is the clamp
    /// direction if `natural_strain` is given.
    pub root_frame: Option<UnitQuaternion<f64>>,
    /// Arc-length fractions of the strain nodes, increasing from 0 to 1.
    pub arc: &'a [f64],
    /// (E I1, E I2, G J) at the root, N·m².
    pub stiffness: [f64; 3],
    /// ρS at the root, kg/m.
    pub line_density: f64,
    /// Kelvin-Voigt relaxation time at the root, s.
    pub damping: f64,
    /// Change of the properties towards the tip.
    pub taper: Taper,
    /// Constant natural strain, 1/m; `None` takes the shape of `points` as natural.
    pub natural_strain: Option<Vector3<f64>>,
    /// Bounds on the segments.
    pub segment_size: SegmentSize,
    /// Whether the tip node has unknowns: a moment there bends and twists it.
    pub tip_strain: bool,
}

impl<'a> RodSource<'a> {
    /// A uniform undamped human scalp hair of radius 40 µm whose drawn shape is natural: the hair of the
    /// tests, benchmarks and examples. `points`, m, and `arc` are as the fields of these names.
    ///
    /// Moduli E = 3.89 GPa and G = 0.89 GPa (Robbins 1994, appendix) and the density 1320 kg/m³ give the
    /// stiffness and the line density, rounded to two digits.
    pub fn hair(points: &'a [Vector3<f64>], arc: &'a [f64]) -> Self {
        RodSource {
            points,
            root_frame: None,
            arc,
            stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
            line_density: 6.6e-6,
            damping: 0.0,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize::FINE,
            tip_strain: false,
        }
    }
}

/// Ratios of tip to root properties; the properties vary linearly with arc length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taper {
    /// Moduli.
    pub stiffness: f64,
    /// Radius. Line density scales with its square, bending and torsion stiffness with its fourth power.
    pub radius: f64,
    /// Relaxation time.
    pub damping: f64,
}

impl Taper {
    /// A uniform rod.
    pub const NONE: Taper = Taper { stiffness: 1.0, radius: 1.0, damping: 1.0 };
}

/// A Kirchhoff rod: all that stays constant over a bake.
#[derive(Debug, Clone)]
pub struct Rod {
    /// Arc lengths of the strain nodes, m.
    pub nodes: Vec<f64>,
    /// Root pose, rest space.
    pub root: Pose,
    /// Arc length of every point, m.
    pub arc: Vec<f64>,
    /// Mass lumped at every point, kg.
    pub mass: Vec<f64>,
    /// Quadrature weight of every point in integrals over arc length (composite Simpson rule), m.
    pub weight: Vec<f64>,
    /// Unknowns of the drawn shape, 1/m: zero unless a natural strain is given.
    pub initial_q: Vec<f64>,
    pub(super) core: RodCore<f64>,
    /// ∫ N_i N_j σ τ ds, m·s, with τ the relaxation time; laid out as [`RodCore::hat`].
    pub(super) damping: Vec<[f64; 2]>,
    profile: Profile,
}

/// Stiffness and damping along a rod.
#[derive(Debug, Clone, Copy)]
struct Profile {
    taper: Taper,
    /// Relaxation time at the root, s.
    damping: f64,
}

impl Profile {
    /// Stiffness over that at the root, σ, at arc-length fraction `u`.
    fn sigma(&self, u: f64) -> f64 {
        lerp_from_one(self.taper.stiffness, u) * lerp_from_one(self.taper.radius, u).powi(4)
    }

    /// Relaxation time τ at arc-length fraction `u`, s.
    fn tau(&self, u: f64) -> f64 {
        self.damping * lerp_from_one(self.taper.damping, u)
    }
}

/// The segments of a rod with what else follows from the drawn curve.
struct Segments {
    segments: Vec<Segment<f64>>,
    /// Simpson weights of the points, m.
    weight: Vec<f64>,
    /// Strain of the drawn curve relative to the natural one at the Gauss points, 1/m.
    deviation: Vec<[Vector3<f64>; 2]>,
}

impl Segments {
    fn new(source: &RodSource, spline: &ArcSpline, nodes: &[f64], root: &Pose) -> Self {
        let natural = source.natural_strain.map_or(0.0, |w| w.norm());
        let (mut segments, mut weight, mut deviation) = (Vec::new(), vec![0.0], Vec::new());
        let mut frame = root.r;
        for (element, node) in nodes.windows(2).enumerate() {
            let l = node[1] - node[0];
            // Simpson's rule needs an even number.
            let pairs = (max_turn(spline, natural, node[0], node[1]) / source.segment_size.max_turn)
                .max(l / source.segment_size.max_length)
                .max(2.0)
                / 2.0;
            let n = 2 * pairs.ceil() as usize;
            let h = l / n as f64;
            for k in 0..n {
                let a = node[0] + h * k as f64;
                let drawn = DrawnSegment::new(spline, &mut frame, a, h);
                let hat = GAUSS.map(|g| 1.0 - (k as f64 + g) / n as f64);
                let (natural, strain) = match source.natural_strain {
                    None => (drawn.exponent, drawn.strain),
                    Some(w) => (Twist::new(w * h, Vector3::z() * h), [w; 2]),
                };
                let natural = lanes::Twist { w: natural.w.into(), v: natural.v.into() };
                let strain = strain.map(V3::from);
                deviation.push(drawn.strain.map(|w| w - source.natural_strain.unwrap_or(w)));
                segments.push(Segment { element, h, natural, strain, hat });
                if k % 2 == 0 {
                    let last = weight.len() - 1;
                    weight[last] += h / 3.0;
                    weight.extend([4.0 * h / 3.0, h / 3.0]);
                }
            }
        }
        Segments { segments, weight, deviation }
    }
}

impl Rod {
    /// Builds a rod. `None` if `points` has fewer than two distinct points.
    pub fn new(source: &RodSource) -> Option<Rod> {
        let spline = ArcSpline::through(source.points)?;
        let length = spline.length();
        let nodes: Vec<f64> = source.arc.iter().map(|u| u * length).collect();
        let root = root_pose(source, &spline);
        let Segments { segments, weight, deviation } = Segments::new(source, &spline, &nodes, &root);
        let arc: Vec<f64> = std::iter::once(0.0)
            .chain(segments.iter().scan(0.0, |s, segment: &Segment<f64>| {
                *s += segment.h;
                Some(*s)
            }))
            .collect();
        let taper = &source.taper;
        let mass = arc.iter().zip(&weight);
        let mass = mass.map(|(s, weight)| {
            weight * source.line_density * lerp_from_one(taper.radius, s / length).powi(2)
        });
        let mass: Vec<f64> = mass.collect();
        let count = if source.tip_strain { nodes.len() } else { nodes.len() - 1 };
        let initial_q = match source.natural_strain {
            Some(_) => project(&nodes, count, &segments, &deviation),
            None => vec![0.0; 3 * count],
        };
        let profile = Profile { taper: source.taper, damping: source.damping };
        let core = RodCore {
            hat: hat_matrix(&nodes, count, |u| profile.sigma(u)),
            stiffness: source.stiffness,
            prebend: vec![0.0; initial_q.len()],
            length,
            longest: segments.iter().map(|s: &Segment<f64>| s.h).fold(0.0, f64::max),
            mass: mass.iter().sum(),
            segments,
            joint: RootJoint::Clamped,
        };
        let damping = hat_matrix(&nodes, count, |u| profile.sigma(u) * profile.tau(u));
        Some(Rod { damping, root, arc, mass, weight, initial_q, nodes, core, profile })
    }

    /// Sets how the root of a rod that is clamped is held: the joint has unknowns of its own, three if it turns and six
    /// if nothing holds it. Before the natural shape is changed.
    pub fn join_root(&mut self, joint: RootJoint) {
        let (core, blocks) = (&mut self.core, joint.blocks());
        core.joint = joint;
        core.segments.iter_mut().for_each(|segment| segment.element += blocks);
        // Of the rod as a stiff one, m L²/3; the moment is the stiffness times this.
        let inertia = core.mass * core.length * core.length / 3.0;
        let stiffest = core.stiffness.iter().fold(0.0_f64, |a, b| a.max(*b));
        let rate = if joint == RootJoint::Free { FREE_DAMPING } else { JOINT_DAMPING };
        let friction = [[rate * inertia / stiffest, 0.0], [0.0; 2]];
        core.hat.splice(0..0, [[0.0; 2]; 2].into_iter().take(blocks));
        self.damping.splice(0..0, friction.into_iter().take(blocks));
        for of_unknowns in [&mut core.prebend, &mut self.initial_q] {
            of_unknowns.splice(0..0, std::iter::repeat_n(0.0, 3 * blocks));
        }
    }

    /// How the root is held.
    pub fn joint(&self) -> RootJoint {
        self.core.joint
    }

    /// True if nothing holds the root.
    pub fn is_free(&self) -> bool {
        self.core.joint == RootJoint::Free
    }

    /// True if another rod has the same unknowns: as many nodes, and the same root.
    pub fn is_like(&self, other: &Rod) -> bool {
        self.unknowns() == other.unknowns() && self.joint() == other.joint()
    }

    /// Arc length L, m.
    pub fn length(&self) -> f64 {
        self.nodes[self.nodes.len() - 1]
    }

    /// Arc length from the root, m, up to which the rod gives way less than skin does to a force across it: the
    /// deflection of a cantilever under a force F at its end is F s³ / (3 E I). 0 if the root is free.
    pub fn held_length(&self) -> f64 {
        if self.is_free() {
            return 0.0;
        }
        let [one, two, _] = self.core.stiffness;
        (3.0 * one.max(two) * SKIN_COMPLIANCE).cbrt()
    }

    /// The force of the rod's own making, N: its weight, and its bending stiffness over the square of its length.
    pub fn own_force(&self) -> f64 {
        let [one, two, _] = self.core.stiffness;
        self.core.mass * STANDARD_GRAVITY + one.max(two) / (self.length() * self.length())
    }

    /// Number of unknowns: three per node, except at a tip that bears no moment, where there is no deviation; and
    /// three of a pinned root, six of a free one.
    pub fn unknowns(&self) -> usize {
        self.core.unknowns()
    }

    /// Number of points of the polyline: the number of segments plus one.
    pub fn points(&self) -> usize {
        self.core.points()
    }

    /// Index of the point at node `node`.
    pub fn node_point(&self, node: usize) -> usize {
        self.core.segments.partition_point(|segment| segment.element < node + self.core.joint.blocks())
    }

    /// Arc length lumped at a node: half of both adjacent elements, m.
    pub fn lumped_length(&self, node: usize) -> f64 {
        let last = self.nodes.len() - 1;
        0.5 * (self.nodes[(node + 1).min(last)] - self.nodes[node.saturating_sub(1)])
    }

    /// Mass lumped at a node if the rod's mass were spread evenly over its length, kg.
    pub fn lumped_mass(&self, node: usize) -> f64 {
        self.lumped_length(node) / self.length() * self.core.mass
    }

    /// Arc-length fraction of the place at fraction `u` of segment `k`.
    pub fn arc_fraction(&self, k: usize, u: f64) -> f64 {
        (self.arc[k] + (self.arc[k + 1] - self.arc[k]) * u) / self.length()
    }

    /// Arc lengths of the points of [`RodShape::refined_curve`](super::RodShape::refined_curve), m.
    pub fn refined_arc(&self) -> impl Iterator<Item = f64> + '_ {
        let next = |s: &[f64]| [0.5 * (s[0] + s[1]), s[1]];
        std::iter::once(self.arc[0]).chain(self.arc.windows(2).flat_map(next))
    }

    /// Stiffness matrix 𝐊 = ∫ N_i K N_j ds, row-major n × n, N·m³.
    pub fn elastic_matrix(&self) -> Vec<f64> {
        self.assemble(&self.core.hat)
    }

    /// Damping matrix ∫ N_i τ K N_j ds (Kelvin-Voigt), row-major n × n, N·m³·s.
    pub fn damping_matrix(&self) -> Vec<f64> {
        self.assemble(&self.damping)
    }

    /// The matrix of the integrals `hat` times the stiffness, row-major.
    fn assemble(&self, hat: &[[f64; 2]]) -> Vec<f64> {
        let n = self.unknowns();
        let mut unit = vec![0.0; n];
        let mut rows = vec![0.0; n * n];
        for (i, row) in rows.chunks_exact_mut(n).enumerate() {
            unit[i] = 1.0;
            self.core.add_elastic(hat, 1.0, &unit, row);
            unit[i] = 0.0;
        }
        rows
    }

    /// Stiffness of each unknown that holds it against the rod's own elasticity and its weight, N·m³: of the
    /// order at which a strain under both would be halved.
    pub fn hold_stiffness(&self) -> Vec<f64> {
        let weight = self.core.mass * STANDARD_GRAVITY * self.length() * self.length();
        let node = |i: usize| {
            let (own, length) = (self.core.hat[i][0], self.lumped_length(i));
            self.core.stiffness.map(|stiffness| stiffness * own + weight * length)
        };
        (0..self.core.hat.len()).flat_map(node).collect()
    }

    /// 𝐊⁻¹ `load`: the unknowns, 1/m, at which elasticity balances a generalised force, N·m².
    pub fn static_strain(&self, load: &[f64]) -> Vec<f64> {
        let stiffness = Vector3::from(self.core.stiffness);
        let mut strain: Vec<Vector3<f64>> =
            load.chunks_exact(3).map(|f| Vector3::from_column_slice(f).component_div(&stiffness)).collect();
        solve_hat(&self.core.hat, &mut strain);
        strain.iter().flat_map(|w| [w.x, w.y, w.z]).collect()
    }

    /// Multiplies the stiffness given to [`Rod::new`], and the damping with it, by `factor` at each
    /// arc-length fraction.
    pub fn stiffen(&mut self, factor: impl Fn(f64) -> f64) {
        let (profile, count) = (self.profile, self.core.hat.len());
        self.core.hat = hat_matrix(&self.nodes, count, |u| profile.sigma(u) * factor(u));
        self.damping = hat_matrix(&self.nodes, count, |u| profile.sigma(u) * profile.tau(u) * factor(u));
    }

    /// Offsets the natural strain by `strain` (at the nodes, 1/m) from that given to [`Rod::new`].
    pub fn set_natural_offset(&mut self, strain: &[f64]) {
        let mut prebend = vec![0.0; strain.len()];
        self.core.add_elastic(&self.core.hat, 1.0, strain, &mut prebend);
        self.core.prebend = prebend;
    }
}

/// L2 projection of a strain given at the Gauss points onto the hat functions of the first `n` nodes.
fn project(nodes: &[f64], n: usize, segments: &[Segment<f64>], strain: &[[Vector3<f64>; 2]]) -> Vec<f64> {
    let mut rhs = vec![Vector3::zeros(); nodes.len()];
    for (segment, w) in segments.iter().zip(strain) {
        for (w, hat) in w.iter().zip(segment.hat) {
            rhs[segment.element] += w * (hat * segment.h / 2.0);
            rhs[segment.element + 1] += w * ((1.0 - hat) * segment.h / 2.0);
        }
    }
    solve_hat(&hat_matrix(nodes, n, |_| 1.0), &mut rhs[..n]);
    rhs[..n].iter().flat_map(|w| [w.x, w.y, w.z]).collect()
}

fn root_pose(source: &RodSource, spline: &ArcSpline) -> Pose {
    let at = spline.at(0.0);
    let r = match source.root_frame {
        // With a given natural strain the clamp may point away from the drawn tangent. If the drawn shape is
        // natural, the drawn tangent is the clamp direction.
        Some(q) if source.natural_strain.is_some() => q.to_rotation_matrix().into_inner(),
        Some(q) => frame_towards(&at.tangent, &(q * Vector3::x())),
        None => any_frame(&at.tangent),
    };
    Pose { r, p: at.x }
}

/// Linear from 1 at the root (u = 0) to `tip` (u = 1).
pub(super) fn lerp_from_one(tip: f64, u: f64) -> f64 {
    1.0 + (tip - 1.0) * u
}

#[cfg(test)]
impl Rod {
    /// A bent and twisted rod, and unknowns, 1/m, that wind it further.
    pub(crate) fn bent_sample() -> (Self, Vec<f64>) {
        let rod = Rod::new(&RodSource {
            stiffness: [1e-9; 3],
            line_density: 1e-5,
            segment_size: SegmentSize { max_length: 0.005, max_turn: 0.4 },
            ..RodSource::hair(
                &[Vector3::zeros(), Vector3::new(0.03, 0.1, 0.0), Vector3::new(0.1, 0.15, 0.03)],
                &[0.0, 0.25, 0.5, 1.0],
            )
        })
        .unwrap();
        let q = (0..rod.unknowns()).map(|i| 20.0 * (i as f64 * 1.3).sin()).collect();
        (rod, q)
    }
}
