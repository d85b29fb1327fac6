//! The walk of the creature: poses of its bones over time, and the skin that follows them.

use super::body::{Bone, LEGS, Limb, SPINE, TAIL, shares};
use crate::math::frame::transport;
use crate::math::smoothstep;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

type V = Vector3<f64>;
type Pose = Isometry3<f64>;

/// Duration of a stride, s, and speed, m/s.
const STRIDE: f64 = 1.0;
const SPEED: f64 = 0.5;
/// Share of a stride for which a paw is on the ground.
const STANCE: f64 = 0.62;
/// How much lower the body is than at rest, and how high paws are lifted, m.
const CROUCH: f64 = 0.03;
const STEP: f64 = 0.06;
/// When in a stride each leg sets its paw down: a lateral sequence walk.
const PHASES: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// Largest weight of a limb on a vertex that is left out.
const NEGLIGIBLE: f64 = 1e-4;

/// The skin of the creature on its bones.
pub(super) struct Walker {
    rest: Vec<V>,
    /// Bones that move each vertex, and by which share.
    weights: Vec<Vec<(Bone, f64)>>,
}

impl Walker {
    /// The skin with these vertices at rest, m.
    pub(super) fn new(rest: Vec<V>, limbs: &[Limb]) -> Self {
        let weights = |x: &V| {
            let shares = shares(limbs, x);
            let kept = shares.iter().zip(limbs).filter(|(share, _)| **share > NEGLIGIBLE);
            let kept: Vec<(Bone, f64)> = kept.map(|(share, limb)| (limb.bone, *share)).collect();
            let sum: f64 = kept.iter().map(|(_, share)| share).sum();
            kept.into_iter().map(|(bone, share)| (bone, share / sum)).collect()
        };
        Walker { weights: rest.iter().map(weights).collect(), rest }
    }

    /// The vertices at time `t`, s, m.
    pub(super) fn vertices(&self, t: f64) -> Vec<V> {
        let skeleton = Skeleton::at(t);
        let vertex = |(x, weights): (&V, &Vec<(Bone, f64)>)| {
            let moved = |(bone, share): &(Bone, f64)| {
                (skeleton.motion(*bone) * nalgebra::Point3::from(*x)).coords * *share
            };
            weights.iter().map(moved).sum()
        };
        self.rest.iter().zip(&self.weights).map(vertex).collect()
    }
}

/// Motions of the bones from rest.
struct Skeleton {
    spine: [Pose; 5],
    ears: Pose,
    tail: [Pose; 3],
    legs: [[Pose; 3]; 4],
}

impl Skeleton {
    fn at(t: f64) -> Self {
        let phase = TAU * t / STRIDE;
        let (sway, nod) = (phase.sin(), (2.0 * phase).cos());
        let root = Translation3::new(0.008 * sway, 0.006 * nod - CROUCH, SPEED * t);
        let pelvis = Pose::from_parts(root, UnitQuaternion::identity())
            * turn(&SPINE[0], [0.012 * nod, 0.06 * sway, 0.05 * sway]);
        let spine = pelvis * turn(&SPINE[1], [0.0, -0.06 * sway, -0.05 * sway]);
        let chest = spine * turn(&SPINE[2], [-0.012 * nod, -0.05 * sway, -0.04 * sway]);
        let neck = chest * turn(&SPINE[3], [0.05 * nod, 0.05 * sway, 0.02 * sway]);
        let head = neck * turn(&SPINE[4], [-0.04 * nod, 0.06 * sway, 0.02 * sway]);
        let mut tail = [pelvis; 3];
        let mut last = pelvis;
        for (k, pose) in tail.iter_mut().enumerate() {
            let wag = 0.22 * (phase - 0.9 * k as f64).sin();
            last *= turn(&TAIL[k], [0.06 * (2.0 * phase - k as f64).sin(), wag, 0.0]);
            *pose = last;
        }
        let bodies = [pelvis, chest];
        let legs = std::array::from_fn(|leg| {
            let mirrored = |x: V| if leg < 2 { x } else { V::new(-x.x, x.y, x.z) };
            leg_motion(LEGS[leg % 2].map(mirrored), bodies[leg % 2], t, leg)
        });
        Skeleton { spine: [pelvis, spine, chest, neck, head], ears: head, tail, legs }
    }

    fn motion(&self, bone: Bone) -> &Pose {
        match bone {
            Bone::Pelvis => &self.spine[0],
            Bone::Spine => &self.spine[1],
            Bone::Chest => &self.spine[2],
            Bone::Neck => &self.spine[3],
            Bone::Head => &self.spine[4],
            Bone::Ear(_) => &self.ears,
            Bone::Tail(k) => &self.tail[k],
            Bone::Leg(leg, segment) => &self.legs[leg][segment],
        }
    }
}

/// A rotation about a joint by angles about x (down), y (left) and z, rad.
fn turn(joint: &V, [pitch, yaw, roll]: [f64; 3]) -> Pose {
    about(joint, joint, UnitQuaternion::from_euler_angles(pitch, yaw, roll))
}

/// The motion that turns about a joint at rest and takes it to `place`.
fn about(joint: &V, place: &V, rotation: UnitQuaternion<f64>) -> Pose {
    Pose::from_parts((place - rotation * joint).into(), rotation)
}

/// Motions of the three segments of a leg with these `joints` at rest, on the part of the body that `body`
/// moves: the paw is where the gait wants it, and knee and hock give way in the plane of the leg.
fn leg_motion(joints: [V; 4], body: Pose, t: f64, leg: usize) -> [Pose; 3] {
    let [top, knee, hock, paw] = joints;
    let stride = (t / STRIDE - PHASES[leg]).rem_euclid(1.0);
    let reach = 0.5 * SPEED * STANCE * STRIDE;
    let swing = ((stride - STANCE) / (1.0 - STANCE)).max(0.0);
    let ahead = match stride < STANCE {
        true => reach * (1.0 - 2.0 * stride / STANCE),
        // As fast as the ground at both ends.
        false => {
            let back = 2.0 * reach * (1.0 - STANCE) / STANCE;
            let s = swing;
            let rise = 2.0 * reach + back;
            -reach - back * s + rise * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
        }
    };
    let up = STEP * (std::f64::consts::PI * swing).sin().powi(2);
    let placed = paw + V::new(0.0, up, ahead + SPEED * t);
    let lifted = smoothstep([0.4, 0.75], stride) * (1.0 - smoothstep([0.75, 0.97], stride));
    let roll = UnitQuaternion::from_axis_angle(&V::x_axis(), 0.7 * lifted);

    let from = (body * nalgebra::Point3::from(top)).coords;
    let to = placed + roll * (hock - paw);
    let [upper, lower] = [(knee - top).norm(), (hock - knee).norm()];
    let way = to - from;
    let far = way.norm().clamp((upper - lower).abs() + 1e-6, 0.9999 * (upper + lower));
    let along = way.normalize();
    // The side to which it bends at rest.
    let straight = (hock - top).normalize();
    let bend = (knee - top) - straight * straight.dot(&(knee - top));
    let bend = (bend - along * along.dot(&bend)).normalize();
    let share = (far * far + upper * upper - lower * lower) / (2.0 * far);
    let bent = from + along * share + bend * (upper * upper - share * share).max(0.0).sqrt();
    let towards = |a: V, b: V| {
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(transport(
            &a.normalize(),
            &b.normalize(),
        )))
    };
    [
        about(&top, &from, towards(knee - top, bent - from)),
        about(&knee, &bent, towards(hock - knee, to - bent)),
        about(&paw, &placed, roll),
    ]
}
