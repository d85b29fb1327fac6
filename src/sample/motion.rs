//! Motions of the samples.

use super::head;
use crate::scene::AnimFile;
use crate::scene::anim::file::{BodyFile, ColliderFile, ShapeFile, TrackFile};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt;

/// Samples per second of a motion.
const RATE: f64 = 96.0;
/// Frames per second of the bake.
pub(super) const FPS: f64 = 24.0;
/// Frequency of the shake, Hz, and its amplitude, rad (25°).
const SHAKE: (f64, f64) = (2.5, 0.436_332_312_998_582_4);
/// Frequency of the nods, Hz, and how far they go down, rad.
const NOD: (f64, f64) = (1.4, 0.35);
/// How far a look goes to either side, and up on the first, rad.
const LOOK: (f64, f64) = (0.95, 0.12);
/// Times, s, heights, m, and velocities, m/s, of a jump: down, off the ground, back on it, down and up. The
/// flight is that of a body in free fall.
const JUMP: [[f64; 3]; 6] = [
    [0.25, 0.0, 0.0],
    [0.60, -0.10, 0.0],
    [0.80, 0.0, 2.2],
    [0.80 + 2.0 * 2.2 / 9.81, 0.0, -2.2],
    [1.45, -0.09, 0.0],
    [1.90, 0.0, 0.0],
];
/// Distance kept between body and hair, m.
const THICKNESS: f64 = 5e-4;

/// A motion that begins and ends at rest, so that the hair can settle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Shaking the head: five oscillations of ±25° at 2.5 Hz, then rest; 4 s.
    Shake,
    /// A quick look to the left: 90° in 0.5 s, then rest; 3 s.
    Turn,
    /// A look round: to the left and up, to the right, and back; 4.5 s.
    Look,
    /// Three nods, 20° down; 4 s.
    Nod,
    /// A jump of 25 cm, head and shoulders; 3.5 s.
    Jump,
}

/// From 0 at `from` to 1 at `to` without jumps in acceleration (Flash & Hogan 1985).
fn ease(from: f64, to: f64, t: f64) -> f64 {
    let u = ((t - from) / (to - from)).clamp(0.0, 1.0);
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}

impl Motion {
    /// All motions.
    pub const ALL: [Motion; 5] = [Motion::Shake, Motion::Turn, Motion::Look, Motion::Nod, Motion::Jump];

    /// Duration, s.
    pub fn duration(self) -> f64 {
        match self {
            Motion::Shake | Motion::Nod => 4.0,
            Motion::Turn => 3.0,
            Motion::Look => 4.5,
            Motion::Jump => 3.5,
        }
    }

    /// Rotation of the head to its left and downwards at time `t`, s; rad.
    pub fn turn(self, t: f64) -> [f64; 2] {
        let within = |from: f64, to: f64| ease(from, from + 0.3, t) * (1.0 - ease(to, to + 0.4, t));
        match self {
            Motion::Shake => [SHAKE.1 * (TAU * SHAKE.0 * t).sin() * within(0.0, 2.0), 0.0],
            Motion::Turn => [FRAC_PI_2 * ease(0.25, 0.75, t), 0.0],
            Motion::Look => {
                let (left, across, back) = (ease(0.2, 0.7, t), ease(1.2, 2.0, t), ease(2.6, 3.1, t));
                [LOOK.0 * (left - 2.0 * across + back), LOOK.1 * (-left + 2.0 * across - back)]
            }
            Motion::Nod => {
                let since = (t - 0.2).max(0.0);
                [0.0, NOD.1 * 0.5 * (1.0 - (TAU * NOD.0 * since).cos()) * within(0.2, 1.9)]
            }
            Motion::Jump => [0.0, 0.0],
        }
    }

    /// Height of the body over where it stands at time `t`, s; m.
    pub fn rise(self, t: f64) -> f64 {
        if self != Motion::Jump {
            return 0.0;
        }
        let k = JUMP.partition_point(|[time, ..]| *time <= t);
        if k == 0 || k == JUMP.len() {
            return 0.0;
        }
        let ([t0, x0, v0], [t1, x1, v1]) = (JUMP[k - 1], JUMP[k]);
        let (h, u) = (t1 - t0, (t - t0) / (t1 - t0));
        // Hermite's cubic.
        let w = u * u * (3.0 - 2.0 * u);
        x0 + (x1 - x0) * w + h * u * (1.0 - u) * (v0 * (1.0 - u) - v1 * u)
    }

    /// Pose of the head at time `t`, s, rest space to world.
    pub fn head(self, t: f64) -> Isometry3<f64> {
        let [left, down] = self.turn(t);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), left)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), down);
        Translation3::from(Vector3::y() * self.rise(t))
            * Isometry3::rotation_wrt_point(turn, head::PIVOT.into())
    }

    /// The animation, m, Y up: a moving head on a bust (`head.obj` and `bust.obj` in the same folder).
    pub fn anim(self) -> AnimFile {
        let frames = (self.duration() * FPS).round() as i32;
        let mut anim = AnimFile::new(FPS, [1001, 1001 + frames]);
        anim.head = Some("head".into());
        let torso = |t: f64| Isometry3::translation(0.0, self.rise(t), 0.0);
        anim.bodies = vec![
            BodyFile { name: "head".into(), track: Some(self.track(|t| self.head(t))) },
            BodyFile { name: "torso".into(), track: (self == Motion::Jump).then(|| self.track(torso)) },
        ];
        let collider = |mesh: &str, body: &str| ColliderFile {
            name: mesh.into(),
            body: Some(body.into()),
            shape: ShapeFile::Mesh {
                file: format!("{mesh}.obj"),
                sequence: None,
                metres_per_unit: None,
                up_axis: None,
            },
            friction: None,
            static_friction: None,
            thickness_m: THICKNESS,
        };
        anim.colliders = vec![collider("head", "head"), collider("bust", "torso")];
        anim
    }

    /// The track of a body with the pose `pose` at a time, s.
    fn track(self, pose: impl Fn(f64) -> Isometry3<f64>) -> TrackFile {
        let samples = (self.duration() * RATE).round() as usize + 1;
        let poses: Vec<_> = (0..samples).map(|i| pose(i as f64 / RATE)).collect();
        let rotation = |p: &Isometry3<f64>| [p.rotation.w, p.rotation.i, p.rotation.j, p.rotation.k];
        let translations: Vec<[f64; 3]> = poses.iter().map(|p| p.translation.vector.into()).collect();
        TrackFile {
            fps: Some(RATE),
            translation: Some(translations.into()),
            rotation_wxyz: Some(poses.iter().map(rotation).collect::<Vec<_>>().into()),
            smoothing_hz: 0.0,
            ..TrackFile::default()
        }
    }
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Motion::Shake => "shake",
            Motion::Turn => "turn",
            Motion::Look => "look",
            Motion::Nod => "nod",
            Motion::Jump => "jump",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_begin_and_end_at_rest() {
        for motion in Motion::ALL {
            // Of a point of the crown, m/s.
            let crown = nalgebra::Point3::new(0.0, 0.24, -0.05);
            let crown = |t: f64| motion.head(t) * crown;
            let speed = |t: f64| (crown(t + 1e-5) - crown(t - 1e-5)).norm() / 2e-5;
            assert!((motion.head(0.0).to_homogeneous() - nalgebra::Matrix4::identity()).norm() < 1e-12);
            assert!(speed(1e-5) < 1e-6 && speed(motion.duration() - 0.5) < 1e-9, "{motion}");
            let fastest = (1..400).map(|i| speed(f64::from(i) / 100.0)).fold(0.0, f64::max);
            assert!((0.1..3.0).contains(&fastest), "{motion}: {fastest} m/s");
        }
    }

    #[test]
    fn a_jump_flies_as_a_thrown_body_and_nothing_else_does() {
        let acceleration = |m: Motion, t: f64| (m.rise(t + 1e-3) - 2.0 * m.rise(t) + m.rise(t - 1e-3)) * 1e6;
        for t in [0.85, 1.0, 1.2] {
            assert!((acceleration(Motion::Jump, t) + 9.81).abs() < 1e-3, "{}", acceleration(Motion::Jump, t));
        }
        let highest = (0..300).map(|i| Motion::Jump.rise(f64::from(i) / 100.0)).fold(0.0, f64::max);
        assert!((0.24..0.26).contains(&highest), "{highest}");
        assert_eq!(Motion::Nod.rise(1.0), 0.0);
    }
}
