//! Head motions of the samples.

use super::head;
use crate::scene::AnimFile;
use crate::scene::anim::file::{BodyFile, ColliderFile, ShapeFile, TrackFile};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt;

/// Samples per second of a motion.
const RATE: f64 = 96.0;
/// Frames per second of the bake.
pub(super) const FPS: f64 = 24.0;
/// Frequency of the shake, Hz, and its amplitude, rad (25°).
const SHAKE: (f64, f64) = (2.5, 0.436_332_312_998_582_4);
/// Distance kept between body and hair, m.
const THICKNESS: f64 = 5e-4;

/// A motion of the head that begins and ends at rest, so that the hair can settle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Shaking the head: five oscillations of ±25° at 2.5 Hz, then rest; 4 s.
    Shake,
    /// A quick look to the left: 90° in 0.5 s, then rest; 3 s.
    Turn,
}

impl Motion {
    /// All motions.
    pub const ALL: [Motion; 2] = [Motion::Shake, Motion::Turn];

    /// Duration, s.
    pub fn duration(self) -> f64 {
        match self {
            Motion::Shake => 4.0,
            Motion::Turn => 3.0,
        }
    }

    /// Rotation of the head to its left at time `t`, s; rad.
    pub fn yaw(self, t: f64) -> f64 {
        let ease = |from: f64, to: f64| {
            let u = ((t - from) / (to - from)).clamp(0.0, 1.0);
            // A quintic without jumps in acceleration (Flash & Hogan 1985).
            u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
        };
        match self {
            Motion::Shake => SHAKE.1 * (TAU * SHAKE.0 * t).sin() * ease(0.0, 0.3) * (1.0 - ease(2.0, 2.4)),
            Motion::Turn => FRAC_PI_2 * ease(0.25, 0.75),
        }
    }

    /// The animation, m, Y up: a moving head (`head.obj` in the same folder) on shoulders at rest.
    pub fn anim(self) -> AnimFile {
        let samples = (self.duration() * RATE).round() as usize + 1;
        let rotations = (0..samples).map(|i| {
            let q = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.yaw(i as f64 / RATE));
            [q.w, q.i, q.j, q.k]
        });
        let frames = (self.duration() * FPS).round() as i32;
        let mut anim = AnimFile::new(FPS, [1001, 1001 + frames]);
        anim.head = Some("head".into());
        let track = TrackFile {
            fps: Some(RATE),
            rotation_wxyz: Some(rotations.collect::<Vec<_>>().into()),
            smoothing_hz: 0.0,
            ..TrackFile::default()
        };
        anim.bodies = vec![
            BodyFile { name: "head".into(), track: Some(track) },
            BodyFile { name: "torso".into(), track: None },
        ];
        let collider = |name: &str, body: &str, shape| ColliderFile {
            name: name.into(),
            body: Some(body.into()),
            shape,
            friction: None,
            static_friction: None,
            thickness_m: THICKNESS,
        };
        let capsule = |(ends, radius): ([Vector3<f64>; 2], f64)| ShapeFile::Capsule {
            ends: ends.map(<[f64; 3]>::from),
            radius,
        };
        let mesh =
            ShapeFile::Mesh { file: "head.obj".into(), sequence: None, metres_per_unit: None, up_axis: None };
        anim.colliders = vec![
            collider("head", "head", mesh),
            collider("neck", "torso", capsule(head::NECK)),
            collider("shoulders", "torso", capsule(head::SHOULDERS)),
        ];
        anim
    }
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Motion::Shake => "shake",
            Motion::Turn => "turn",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_begin_and_end_at_rest() {
        for motion in Motion::ALL {
            let speed = |t: f64| (motion.yaw(t + 1e-5) - motion.yaw(t - 1e-5)) / 2e-5;
            assert_eq!(motion.yaw(0.0), 0.0);
            assert!(speed(0.0).abs() < 1e-6 && speed(motion.duration() - 0.5).abs() < 1e-12);
            let fastest = (0..400).map(|i| speed(f64::from(i) / 100.0).abs()).fold(0.0, f64::max);
            assert!((4.0..8.0).contains(&fastest), "{motion}: {fastest} rad/s");
        }
    }
}
