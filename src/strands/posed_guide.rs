//! Guides at one moment.

use super::curl::axis;
use super::guide_place::GuidePlace;
use super::moment::{Carriers, GuideMotion};
use super::moving_rotation::MovingRotation;
use super::rest_guide::{Counterpart, RestGuide};
use crate::math::lanes::V3;
use crate::rod::{Rod, RodShape};
use nalgebra::Vector3;
use std::borrow::Cow;

/// A guide at one moment.
#[derive(Debug)]
pub(super) struct PosedGuide {
    /// Positions of its points, m, world.
    x: Vec<Vector3<f64>>,
    /// For each point, a lower bound on the distance from all bodies, m; empty if they are not looked for.
    pub clear: Vec<f64>,
    /// Rotations of its frames from rest space to world, one per point; to the rest space around its root if
    /// that has a motion of its own. Quaternions of neighbours have the same sign.
    pub rotations: Vec<MovingRotation<f64>>,
    /// For each point of a guide that winds, the axis ([`axis`]), in the same space, and its rate, 1/s, as
    /// one array.
    axes: Vec<[f64; 6]>,
}

/// Guides at one moment.
#[derive(Debug)]
pub struct PosedGuides {
    pub(super) guides: Vec<PosedGuide>,
    /// For each pair of guides and each point of the first, how the second is rotated relative to it
    /// ([`MovingRotation::difference`]), as one array.
    pub(super) differences: Vec<Vec<[f64; 6]>>,
    /// What carries them and the strands.
    pub(super) carriers: Carriers,
}

impl PosedGuide {
    /// Poses guide `i` of those on `carriers`. `clear`, if given, is the lower bound on the distance from all
    /// bodies for the position of a point.
    pub fn new(
        shape: &mut RodShape,
        rest: &RestGuide,
        (carriers, i): (&Carriers, usize),
        motion: &GuideMotion,
        clear: Option<impl Fn(&Vector3<f64>) -> f64>,
    ) -> Self {
        let GuideMotion { rod, q, rate } = motion;
        let carrier = carriers.guide(i);
        // Strands on skins turn with their own roots, and those of a free root with that: guides tell them how they
        // move on theirs.
        let (turn, spin, to_world) = match carriers {
            Carriers::Head(head) => (head.rotation * rod.root.r, head.spin, None),
            Carriers::Each { .. } => (rod.root.r, Vector3::zeros(), Some(carrier.rotation)),
        };
        let [q, rate] = [q, rate].map(|of| beyond_root(rod, of));
        shape.update(rod, &turn, &q);
        let (root, _) = carrier.carry(&rod.root.p);
        let x: Vec<_> = (0..shape.points()).map(|k| root + shape.x(k)).collect();
        let mut rotations: Vec<MovingRotation<f64>> = Vec::with_capacity(x.len());
        // Velocities relative to the root.
        let mut v = Vec::with_capacity(x.len());
        let velocities = shape.velocities(rod, &q, &rate);
        for (k, (rotation, (velocity, own))) in rest.rotations(shape.poses()).zip(velocities).enumerate() {
            let rotation = MovingRotation::new(&rotation, &(spin + own));
            rotations.push(rotations.last().map_or(rotation, |last| rotation.with_sign_of(last)));
            v.push(velocity + spin.cross(&shape.x(k)));
        }
        let axes = rest.winding().map_or_else(Vec::new, |winding| {
            let means = winding.means(&x).zip(winding.means(&v));
            means.map(|(mean, rate)| joined(axis(&mean, &rate))).collect()
        });
        let x = match to_world {
            None => x,
            Some(turn) => x.iter().map(|x| root + turn * (x - root)).collect(),
        };
        let clear = clear.map_or_else(Vec::new, |clear| x.iter().map(clear).collect());
        PosedGuide { clear, x, rotations, axes }
    }

    /// Rotation from rest to the frame at a place.
    #[inline(always)]
    pub fn rotation(&self, place: GuidePlace) -> MovingRotation<f64> {
        let (from, to, u) = place.ends(&self.rotations);
        from.lerp(to, u)
    }

    /// The axis at a place and its rate, 1/s, as one array; zero if the guide does not wind.
    #[inline(always)]
    pub fn axis(&self, place: GuidePlace) -> [f64; 6] {
        if self.axes.is_empty() {
            return [0.0; 6];
        }
        let (from, to, u) = place.ends(&self.axes);
        std::array::from_fn(|i| from[i] + (to[i] - from[i]) * u)
    }

    /// How `other` with its `counterparts` turns the tangents of this guide, which is `rest` at rest,
    /// otherwise than this guide does.
    pub fn differences(
        &self,
        rest: &RestGuide,
        other: &PosedGuide,
        counterparts: &[Counterpart],
    ) -> Vec<[f64; 6]> {
        let difference = |((own, to), tangent): ((&MovingRotation<f64>, &Counterpart), &Vector3<f64>)| {
            let [x, y, z, dx, dy, dz] = other.axis(to.place);
            let [cosine, sine] = to.half_phase.map(f64::from);
            let phase = MovingRotation::about(V3([x, y, z]), V3([dx, dy, dz]), cosine, sine);
            joined(own.difference(&phase.after(other.rotation(to.place)), tangent, &to.tangent))
        };
        self.rotations.iter().zip(counterparts).zip(rest.tangents()).map(difference).collect()
    }

    /// Position of a place, m, world.
    pub fn position(&self, place: GuidePlace) -> Vector3<f64> {
        place.position(|k| self.x[k])
    }

    /// Lower bound on the distance of `x` (near `place`; m, world) from all bodies, m. It costs no search.
    pub fn distance_bound(&self, place: GuidePlace, x: &Vector3<f64>) -> f64 {
        let k = place.nearest_point();
        self.clear[k] - (x - self.x[k]).norm()
    }

    /// Whether that bound is known and exceeds `distance`, m.
    pub fn is_clear(&self, place: GuidePlace, x: &Vector3<f64>, distance: f64) -> bool {
        !self.clear.is_empty() && self.distance_bound(place, x) > distance
    }
}

/// The unknowns of `rod`, or their rates, but those of a free root: its motion is that of what carries the guide.
fn beyond_root<'a>(rod: &Rod, of: &'a [f64]) -> Cow<'a, [f64]> {
    let mut of = Cow::Borrowed(of);
    if rod.is_free() && !of.is_empty() {
        of.to_mut()[..6].fill(0.0);
    }
    of
}

/// A vector and its rate as one array.
fn joined([value, rate]: [Vector3<f64>; 2]) -> [f64; 6] {
    [value.x, value.y, value.z, rate.x, rate.y, rate.z]
}
