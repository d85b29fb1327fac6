//! What carries hair in the groom's pose: bodies that it lies on (`docs/theory.md` §6).

use crate::contact::Bodies;
use crate::math::cholesky::dot;
use crate::rod::{Rod, RodShape, Sensitivity};
use nalgebra::{Matrix3, Vector3};

/// Distance from a body up to which hair lies on it, or on hair that does, m: the depth of combed hair.
/// Raising it lets hair sink further to the skin at the start, and store less energy against gravity.
const REACH: f64 = 0.015;

/// Displacement by which a support loses its hold, m.
const HOLD: f64 = 1e-3;

/// Iterations for the reactions: any forces in the cones make an equilibrium, better ones a calmer one.
const ITERATIONS: usize = 300;

/// Iterations for the largest eigenvalue that bounds their steps, and the share of that bound taken.
const POWER_ITERATIONS: usize = 20;
const STEP_SHARE: f64 = 0.9;

/// A point of a rod that lies on a body.
#[derive(Debug, Clone, Copy)]
pub struct Support {
    /// Index of the point.
    pub point: usize,
    /// Outward unit normal of the body, rest space.
    pub normal: Vector3<f64>,
    /// Static coefficient of friction.
    pub mu: f64,
}

/// The points of `rod` in its initial pose that lie on `bodies` at rest, which share its space: of the points at its nodes
/// and half-way between them, since a rod has no more freedom than that. `mu` is the strand's friction, which holds for
/// bodies without one of their own.
pub fn supports(bodies: &Bodies, rod: &Rod, mu: f64) -> Vec<Support> {
    let mut shape = RodShape::default();
    shape.update(rod, &rod.root.r, &rod.initial_q);
    let nodes = (0..rod.nodes.len()).map(|node| rod.node_point(node)).collect::<Vec<_>>();
    let points = nodes.windows(2).flat_map(|w| [(w[0] + w[1]) / 2, w[1]]);
    points.filter_map(|k| support(bodies, k, &(shape.x(k) + rod.root.p), mu)).collect()
}

/// The support of point `k` at `x`, m, by `bodies` at rest.
fn support(bodies: &Bodies, k: usize, x: &Vector3<f64>, mu: f64) -> Option<Support> {
    let on = |b: usize| {
        // Bodies at rest do not change with time.
        let nearest = bodies.closest(b, 0.0, x, REACH)?;
        let mu = bodies.bodies[b].friction.map_or(mu, |friction| friction.mu_s);
        Some((nearest.distance.abs(), Support { point: k, normal: nearest.normal, mu }))
    };
    let found = (0..bodies.len()).filter_map(on);
    found.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, support)| support)
}

/// Forces of the supports, N, within their friction cones, with which the natural shape has to move least to
/// make the initial pose an equilibrium under `load`, N·m²: they minimise the elastic energy that the move
/// stores, by accelerated projected gradients [Mazhar et al. 2015].
pub fn reactions(rod: &Rod, load: &[f64], supports: &[Support]) -> Vec<Vector3<f64>> {
    if supports.is_empty() {
        return Vec::new();
    }
    let rows = Rows::new(rod, supports);
    // Each support in a unit of its own, so that those near the root and near the tip converge alike.
    let unit: Vec<f64> = (0..supports.len()).map(|i| rows.compliance(rod, i).sqrt().recip()).collect();
    let gradient = |f: &[Vector3<f64>], load: &[f64]| {
        rows.displacements(&rod.static_strain(&rows.load(f, &unit, load)), &unit)
    };
    let step = STEP_SHARE / largest_eigenvalue(supports.len(), |f| gradient(f, &vec![0.0; load.len()]));
    let mut f = vec![Vector3::zeros(); supports.len()];
    let (mut ahead, mut theta) = (f.clone(), 1.0_f64);
    for _ in 0..ITERATIONS {
        let slope = gradient(&ahead, load);
        let next: Vec<Vector3<f64>> = (ahead.iter().zip(&slope).zip(supports))
            .map(|((f, slope), support)| support.project(f - slope * step))
            .collect();
        let uphill = slope.iter().zip(&next).zip(&f).map(|((slope, next), f)| slope.dot(&(next - f)));
        let (beta, theta_next) = if uphill.sum::<f64>() > 0.0 {
            (0.0, 1.0)
        } else {
            let theta_next = 0.5 * (1.0 + (1.0 + 4.0 * theta * theta).sqrt());
            ((theta - 1.0) / theta_next, theta_next)
        };
        ahead = next.iter().zip(&f).map(|(next, f)| next + (next - f) * beta).collect();
        (f, theta) = (next, theta_next);
    }
    f.iter().zip(&unit).map(|(f, unit)| f * *unit).collect()
}

/// Largest eigenvalue of a symmetric positive map of `n` vectors, from below.
fn largest_eigenvalue(n: usize, map: impl Fn(&[Vector3<f64>]) -> Vec<Vector3<f64>>) -> f64 {
    let norm = |v: &[Vector3<f64>]| v.iter().map(Vector3::norm_squared).sum::<f64>().sqrt();
    let mut v = vec![Vector3::repeat(1.0); n];
    let mut eigenvalue = 1.0;
    for _ in 0..POWER_ITERATIONS {
        let next = map(&v);
        eigenvalue = norm(&next) / norm(&v);
        v = next;
    }
    eigenvalue
}

/// Stiffness by which pressed supports hold their points, row-major n × n, N·m³: each its force over
/// [`HOLD`], along the surface that of its friction.
pub fn stiffness(rod: &Rod, supports: &[Support], reactions: &[Vector3<f64>]) -> Vec<f64> {
    let n = rod.unknowns();
    let mut stiffness = vec![0.0; n * n];
    for ((support, reaction), rows) in supports.iter().zip(reactions).zip(&Rows::new(rod, supports).rows) {
        let normal = support.normal * support.normal.transpose();
        let tangential = Matrix3::identity() - normal;
        let hold = (normal + tangential * support.mu) * (support.normal.dot(reaction) / HOLD);
        for (i, j) in (0..9).map(|entry| (entry / 3, entry % 3)) {
            for (a, out) in rows[i].iter().zip(stiffness.chunks_exact_mut(n)) {
                out.iter_mut().zip(&rows[j]).for_each(|(out, b)| *out += hold[(i, j)] * a * b);
            }
        }
    }
    stiffness
}

impl Support {
    /// The nearest force in the friction cone.
    fn project(&self, f: Vector3<f64>) -> Vector3<f64> {
        let along = self.normal.dot(&f);
        let across = f - self.normal * along;
        let slide = across.norm();
        if slide <= self.mu * along {
            f
        } else if along <= -self.mu * slide {
            Vector3::zeros()
        } else {
            let along = (along + self.mu * slide) / (1.0 + self.mu * self.mu);
            self.normal * along + across * (self.mu * along / slide)
        }
    }
}

/// Jacobian rows of the supports' points: of x, y and z by all unknowns, m².
struct Rows {
    rows: Vec<[Vec<f64>; 3]>,
}

impl Rows {
    fn new(rod: &Rod, supports: &[Support]) -> Self {
        let (mut shape, mut sensitivity) = (RodShape::default(), Sensitivity::default());
        shape.update(rod, &rod.root.r, &rod.initial_q);
        sensitivity.update(rod, &shape, &rod.initial_q);
        let row = |k: usize, c: usize| {
            let mut row = vec![0.0; rod.unknowns()];
            sensitivity.add_row(k, &shape.x(k), &Vector3::ith(c, 1.0), 1.0, &mut row);
            row
        };
        Rows { rows: supports.iter().map(|s| [0, 1, 2].map(|c| row(s.point, c))).collect() }
    }

    /// Trace of the compliance of support `i`, m/N.
    fn compliance(&self, rod: &Rod, i: usize) -> f64 {
        self.rows[i].iter().map(|row| dot(row, &rod.static_strain(row))).sum()
    }

    /// `load` plus that of forces `f` in `unit`s, N·m².
    fn load(&self, f: &[Vector3<f64>], unit: &[f64], load: &[f64]) -> Vec<f64> {
        let mut load = load.to_vec();
        for ((rows, f), unit) in self.rows.iter().zip(f).zip(unit) {
            for (row, f) in rows.iter().zip(f.iter()) {
                load.iter_mut().zip(row).for_each(|(load, row)| *load += row * f * unit);
            }
        }
        load
    }

    /// Displacements of the supports' points, m, at `strain`, 1/m, times `unit`.
    fn displacements(&self, strain: &[f64], unit: &[f64]) -> Vec<Vector3<f64>> {
        let each = self.rows.iter().zip(unit);
        each.map(|(rows, unit)| Vector3::from(rows.each_ref().map(|row| dot(row, strain) * unit))).collect()
    }
}
