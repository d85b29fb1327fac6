//! Rates of a rod's unknowns at which places of it move as given, by least squares in O(n) (`docs/theory.md` §7.3).

use super::block_factor::BlockFactor;
use super::hessian::{Acting, Assembly, Composite, ElementBlock, sweep};
use super::joint::RootJoint;
use super::model::Rod;
use super::potential::PointSpring;
use super::segment::RodCore;
use super::sensitivity::Sensitivity;
use super::shape::RodShape;
use crate::math::lanes::{Twist, V3};
use nalgebra::Vector3;

/// Damping of the rates of the unknowns, as a share of the mean diagonal of the normal equations that the places give.
/// The unknowns of a root that turns have other units than the strains beside them: there each has its own.
const DAMPING: f64 = 1e-6;

/// A place fixed to the frame at a point of a rod, and its velocity.
#[derive(Debug, Clone, Copy)]
pub struct PlaceVelocity {
    /// Index of the point: that of the root only if it is free.
    pub point: usize,
    /// Position relative to the root, m.
    pub x: Vector3<f64>,
    /// Velocity relative to what carries the root, m per unit of time, world axes.
    pub velocity: Vector3<f64>,
    /// Weight of the square of what it is off.
    pub weight: f64,
}

/// Finds rates of the unknowns of a rod by velocities of its places.
#[derive(Debug, Default)]
pub struct RateFit {
    normal: NormalEquations,
    sensitivity: Sensitivity,
    factor: BlockFactor<f64>,
    /// Of each segment: none, for springs are where the places are.
    wrench: Vec<Twist<f64>>,
    change: Vec<f64>,
}

impl RateFit {
    /// Removes all places.
    pub fn clear(&mut self) {
        self.normal.places.clear();
    }

    /// Adds a place, whose point is not nearer to the root than those of the places before it.
    pub fn add(&mut self, place: PlaceVelocity) {
        self.normal.places.push(place);
    }

    /// Changes `rate`, the rates of the unknowns `q` of `rod`, whose shape is `shape`, to those at which the places
    /// have their velocities, in the least squares. False if there are none; then `rate` is what it was.
    pub fn correct(&mut self, rod: &Rod, shape: &RodShape, q: &[f64], rate: &mut [f64]) -> bool {
        let RateFit { normal, sensitivity, factor, wrench, change } = self;
        let core = &rod.core;
        sensitivity.update(rod, shape, q);
        wrench.clear();
        wrench.resize(core.segments.len(), Twist::none(0.0));
        for (k, (velocity, spin)) in shape.velocities(rod, q, rate).enumerate() {
            for place in normal.at_mut(k) {
                place.velocity -= velocity + spin.cross(&(place.x - shape.x(k)));
            }
        }
        normal.set_right_side(core, sensitivity, change);
        normal.set_damping(core, shape, sensitivity, wrench);
        if factor.set(core, normal, shape, sensitivity, wrench, 0.0) != 1 {
            return false;
        }
        factor.solve(change);
        rate.iter_mut().zip(&*change).for_each(|(rate, change)| *rate += change);
        true
    }
}

/// The normal equations of the fit: as the Hessian of springs at the places.
#[derive(Debug, Default)]
struct NormalEquations {
    /// By their points, from root to tip.
    places: Vec<PlaceVelocity>,
    /// Of each unknown.
    damping: Vec<f64>,
}

impl Acting<f64> for NormalEquations {
    fn add_point(&self, k: usize, _: &RodCore<f64>, _: &RodShape, downstream: &mut Composite<f64>) {
        for place in &self.places[self.range(k)] {
            let x = V3::from(place.x);
            downstream.add(x, &PointSpring { alpha: place.weight, u: V3([0.0; 3]), target: x });
        }
    }

    fn on_unknown(&self, _: &RodCore<f64>, a: usize) -> f64 {
        self.damping[a]
    }

    fn on_neighbours(&self, _: &RodCore<f64>, _: usize, _: usize) -> f64 {
        0.0
    }
}

/// Takes the diagonal.
struct Diagonal<'a>(&'a mut [f64]);

impl Assembly<f64> for Diagonal<'_> {
    fn add_element(&mut self, first: usize, live: usize, block: &ElementBlock<f64>) {
        (0..live).for_each(|a| self.0[first + a] += block.entry(a, a));
    }
}

impl NormalEquations {
    /// Indices of the places of point `k`.
    fn range(&self, k: usize) -> std::ops::Range<usize> {
        let [start, end] = [k, k + 1].map(|k| self.places.partition_point(|place| place.point < k));
        start..end
    }

    fn at_mut(&mut self, k: usize) -> &mut [PlaceVelocity] {
        let range = self.range(k);
        &mut self.places[range]
    }

    /// Sets `b` to the sum of the weighted velocities of the places by the unknowns.
    fn set_right_side(&self, core: &RodCore<f64>, sensitivity: &Sensitivity, b: &mut Vec<f64>) {
        b.clear();
        b.resize(core.unknowns(), 0.0);
        let mut wrench = Twist::none(0.0);
        let mut add = |k: usize| {
            for place in &self.places[self.range(k)] {
                let force = place.velocity * place.weight;
                wrench = wrench + Twist { w: place.x.cross(&force).into(), v: force.into() };
            }
            wrench
        };
        for (k, segment) in core.segments.iter().enumerate().rev() {
            let wrench = add(k + 1);
            for (b, t) in b[3 * segment.element..].iter_mut().zip(&sensitivity.own[k]) {
                *b += t.dot(&wrench);
            }
        }
        let wrench = add(0);
        for (b, t) in b.iter_mut().zip(&sensitivity.total).take(3 * core.joint.blocks()) {
            *b += t.dot(&wrench);
        }
    }

    fn set_damping(
        &mut self,
        core: &RodCore<f64>,
        shape: &RodShape,
        sensitivity: &Sensitivity,
        wrench: &[Twist<f64>],
    ) {
        let mut damping = std::mem::take(&mut self.damping);
        damping.clear();
        damping.resize(core.unknowns(), 0.0);
        let diagonal = &mut Diagonal(&mut damping);
        let mut all = sweep(core, &*self, shape, sensitivity, wrench, 0.0, diagonal);
        if core.joint == RootJoint::Clamped {
            let mean = damping.iter().sum::<f64>() / damping.len() as f64;
            damping.fill(DAMPING * mean);
        } else {
            if core.joint == RootJoint::Free {
                self.add_point(0, core, shape, &mut all);
            }
            let response = all.response(0.0);
            for (own, t) in damping.iter_mut().zip(&sensitivity.total).take(3 * core.joint.blocks()) {
                *own = t.dot(&response.to(t));
            }
            damping.iter_mut().for_each(|own| *own *= DAMPING);
        }
        self.damping = damping;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::cholesky;

    /// Places at and beside the points that move, with velocities that no rates give them all.
    fn places(rod: &Rod, shape: &RodShape) -> Vec<PlaceVelocity> {
        let velocity =
            |k: usize, side: f64| Vector3::new((k as f64).sin(), side, (1.3 * k as f64).cos() * side);
        let place = |k: usize, side: f64| PlaceVelocity {
            point: k,
            x: shape.x(k) + shape.normal(k) * (0.01 * side),
            velocity: velocity(k, side) * 0.02,
            weight: 1.0 + side + 0.1 * k as f64,
        };
        (usize::from(!rod.is_free())..rod.points()).flat_map(|k| [place(k, 0.0), place(k, 1.0)]).collect()
    }

    #[test]
    fn rates_solve_the_damped_normal_equations_of_every_joint() {
        for joint in [RootJoint::Clamped, RootJoint::Pinned, RootJoint::Free] {
            let (mut rod, mut q) = Rod::bent_sample();
            rod.join_root(joint);
            q.splice(0..0, [0.7, -0.4, 0.3, 0.01, 0.02, -0.03].into_iter().take(3 * joint.blocks()));
            let mut shape = RodShape::default();
            shape.update(&rod, &rod.root.r, &q);
            let mut sensitivity = Sensitivity::default();
            sensitivity.update(&rod, &shape, &q);
            let rate: Vec<f64> = (0..q.len()).map(|i| (i as f64).cos()).collect();
            let n = q.len();
            let (mut normal, mut change) = (vec![0.0; n * n], vec![0.0; n]);
            let mut fit = RateFit::default();
            let velocities: Vec<_> = shape.velocities(&rod, &q, &rate).collect();
            for place in places(&rod, &shape) {
                fit.add(place);
                let (v, spin) = velocities[place.point];
                let missing = place.velocity - v - spin.cross(&(place.x - shape.x(place.point)));
                for axis in 0..3 {
                    let mut row = vec![0.0; n];
                    sensitivity.add_row(place.point, &place.x, &Vector3::ith(axis, 1.0), 1.0, &mut row);
                    for i in 0..n {
                        change[i] += place.weight * row[i] * missing[axis];
                        (0..n).for_each(|j| normal[i * n + j] += place.weight * row[i] * row[j]);
                    }
                }
            }
            let mean = (0..n).map(|i| normal[i * n + i]).sum::<f64>() / n as f64;
            for i in 0..n {
                let own = normal[i * n + i];
                normal[i * n + i] += DAMPING * if joint == RootJoint::Clamped { mean } else { own };
            }
            assert_eq!(cholesky::factor(&mut normal, n), 1);
            cholesky::solve(&normal, n, &mut change);
            let mut found = rate.clone();
            assert!(fit.correct(&rod, &shape, &q, &mut found));
            let size = change.iter().fold(0.0_f64, |size, c| size.max(c.abs()));
            for i in 0..n {
                let off = (found[i] - rate[i] - change[i]).abs();
                assert!(off < 1e-7 * size, "{joint:?}, unknown {i}: {off} of {size}");
            }
        }
    }
}
