use super::pops::Pop;
use super::smooth::{penalty, whittaker};
use super::*;
use approx::assert_relative_eq;
use nalgebra::Vector1;
use proptest::prelude::*;
use std::slice::from_ref;

/// A smooth motion: a head that nods, turns and walks.
fn motion(t: f64) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_euler_angles(0.4 * (3.0 * t).sin(), 2.0 * t, 0.2 * (5.0 * t).cos());
    Isometry3::from_parts(
        Translation3::new(1.2 * t, 1.6 + 0.03 * (11.0 * t).sin(), 0.1 * (4.0 * t).cos()),
        rotation,
    )
}

fn samples(start: f64, rate: f64, n: usize) -> PoseSamples {
    let poses = (0..n).map(|i| motion(start + i as f64 / rate)).collect();
    PoseSamples { start, rate, poses, bridged: Vec::new() }
}

fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    (a.translation.vector - b.translation.vector).norm() + a.rotation.angle_to(&b.rotation)
}

fn rest() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.1, 1.5, -0.2), Vector3::new(0.3, -0.2, 0.5))
}

#[test]
fn unfiltered_track_passes_through_its_samples() {
    let samples = samples(-0.5, 24.0, 40);
    let track = Track::through(&samples, 0.0, &Isometry3::identity());
    for (i, pose) in samples.poses.iter().enumerate() {
        assert!(distance(&track.pose(-0.5 + i as f64 / 24.0), pose) < 1e-7);
    }
}

#[test]
fn error_between_samples_is_of_fourth_order() {
    let error = |rate: f64| {
        let track = Track::through(&samples(0.0, rate, 2 * rate as usize + 1), 0.0, &Isometry3::identity());
        (0..1999)
            .map(|i| f64::from(i) / 1000.0)
            .map(|t| distance(&track.pose(t), &motion(t)))
            .fold(0.0, f64::max)
    };
    let order = (error(24.0) / error(48.0)).log2();
    assert!(error(24.0) < 2e-3, "{}", error(24.0));
    assert!((3.5..4.7).contains(&order), "order {order}");
}

#[test]
fn rest_pose_of_the_joint_is_removed() {
    let track = Track::through(&samples(0.0, 60.0, 30), 0.0, &rest());
    let t = 0.25;
    assert!(distance(&track.pose(t), &(motion(t) * rest().inverse())) < 1e-5);
    // The position of the joint in rest space maps to its position in the world.
    let joint = nalgebra::Point3::from(rest().translation.vector);
    assert_relative_eq!((track.pose(t) * joint).coords, motion(t).translation.vector, epsilon = 1e-5);
}

#[test]
fn twist_is_the_derivative_of_the_pose() {
    let track = Track::through(&samples(0.0, 30.0, 61), 12.0, &rest());
    let h = 1e-5;
    // Inside, at a sample, while the motion decays on either side, and at rest.
    for t in [0.01, 0.777, 1.0, -0.05, -0.3, 2.05, 2.3, 9.0] {
        let (a, b) = (track.pose(t - h), track.pose(t + h));
        let (angular, linear) = track.twist(t);
        let difference = (b.translation.vector - a.translation.vector) / (2.0 * h);
        assert_relative_eq!(linear, difference, epsilon = 1e-7);
        assert_relative_eq!(angular, (b.rotation / a.rotation).scaled_axis() / (2.0 * h), epsilon = 1e-7);
    }
    assert!(track.twist(1.0).0.norm() > 0.5 && track.twist(1.0).1.norm() > 0.5);
}

/// At samples, at the ends, and where the motion stops.
#[test]
fn velocity_and_acceleration_are_continuous() {
    let track = Track::through(&samples(0.0, 24.0, 25), 0.0, &rest());
    let velocity = |t: f64| track.twist(t);
    let acceleration = |t: f64, side: f64| {
        let h = side * 1e-6;
        ((velocity(t + h).1 - velocity(t).1) / h, (velocity(t + h).0 - velocity(t).0) / h)
    };
    for knot in (0..=24).map(|i| f64::from(i) / 24.0).chain([
        -coast::ACCELERATION_TIME,
        -coast::VELOCITY_TIME,
        1.0 + coast::ACCELERATION_TIME,
        1.0 + coast::VELOCITY_TIME,
    ]) {
        let ((a, alpha), (b, beta)) = (acceleration(knot, -1.0), acceleration(knot, 1.0));
        assert!((a - b).norm() < 1e-2 && (alpha - beta).norm() < 1e-2, "{knot}: {}", (a - b).norm());
    }
}

#[test]
fn comes_to_rest_beyond_its_ends() {
    let track = Track::through(&samples(0.0, 24.0, 25), 0.0, &Isometry3::identity());
    for (end, away) in [(0.0, -1.0), (1.0, 1.0)] {
        let stop = end + away * coast::VELOCITY_TIME;
        assert_eq!(track.twist(stop + away * 3.0), (Vector3::zeros(), Vector3::zeros()));
        assert!(distance(&track.pose(stop), &track.pose(stop + away * 100.0)) < 1e-12);
        assert!(distance(&track.pose(stop), &track.pose(end)) < 1.5);
    }
}

#[test]
fn tracks_of_few_samples_work() {
    for n in 1..6 {
        let track = Track::through(&samples(0.0, 60.0, n), 12.0, &Isometry3::identity());
        assert!(distance(&track.pose(0.0), &motion(0.0)) < 0.02, "{n}");
        assert_eq!(track.span().is_some(), n > 1);
    }
}

/// g · track(q) · k = track(g · q · k).
#[test]
fn result_is_independent_of_frames() {
    let (g, k) =
        (Isometry3::rotation(Vector3::new(2.0, -1.0, 0.4)), Isometry3::rotation(Vector3::new(0.0, 0.0, 3.0)));
    let plain = samples(0.0, 30.0, 30);
    let mut turned = plain.clone();
    for pose in &mut turned.poses {
        *pose = g * *pose * k;
    }
    let (plain, turned) = [plain, turned].map(|s| Track::through(&s, 12.0, &Isometry3::identity())).into();
    for t in [0.1, 0.33, 0.5] {
        assert!(distance(&(g * plain.pose(t) * k), &turned.pose(t)) < 1e-7);
    }
}

#[test]
fn the_slowest_filter_leaves_a_parabola_as_it_is() {
    for n in [4_u32, 40, 400] {
        let parabola = |k: u32| Vector1::new((2.0 * f64::from(k) / f64::from(n) - 0.7).powi(2));
        let y: Vec<_> = (0..n).map(parabola).collect();
        let z = whittaker(&y, &vec![1.0; y.len()], penalty(1e-5));
        assert!(z.iter().zip(&y).all(|(z, y)| (z - y).norm() < 1e-5), "{n}");
    }
}

#[test]
fn filter_gain_is_one_half_at_the_cutoff_and_one_below() {
    let gain = |f: f64| {
        let n = 4000;
        let wave: Vec<_> =
            (0..n).map(|i| Vector1::new((std::f64::consts::TAU * f * f64::from(i)).cos())).collect();
        let smooth = whittaker(&wave, &vec![1.0; wave.len()], penalty(0.1));
        let (from, to) = (1000, 3000);
        let product =
            |a: &[Vector1<f64>], b: &[Vector1<f64>]| (from..to).map(|i| a[i].x * b[i].x).sum::<f64>();
        product(&smooth, &wave) / product(&wave, &wave)
    };
    assert_relative_eq!(gain(0.1), 0.5, epsilon = 1e-3);
    assert!(gain(0.05) > 0.98 && gain(0.2) < 0.03, "{} {}", gain(0.05), gain(0.2));
}

/// Compares with a dense solve of the normal equations.
#[test]
fn filter_solves_its_normal_equations() {
    let n = 12;
    let y: Vec<_> = (0..n).map(|i| Vector1::new(((i * i) as f64 * 0.7).sin())).collect();
    let weights: Vec<f64> = (0..n).map(|i| if i == 4 || i == 5 { 0.0 } else { 1.0 }).collect();
    let lambda = 2.5;
    let mut a = nalgebra::DMatrix::<f64>::from_diagonal(&weights.clone().into());
    for r in 0..n - 3 {
        let d = [-1.0, 3.0, -3.0, 1.0];
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
            a[(r + i, r + j)] += lambda * d[i] * d[j];
        }
    }
    let rhs = nalgebra::DVector::from_iterator(n, y.iter().zip(&weights).map(|(y, w)| y.x * w));
    let dense = a.cholesky().unwrap().solve(&rhs);
    for (z, dense) in whittaker(&y, &weights, lambda).iter().zip(dense.iter()) {
        assert_relative_eq!(z.x, *dense, epsilon = 1e-12);
    }
}

#[test]
fn filter_preserves_quadratics_up_to_the_ends_and_across_gaps() {
    let y: Vec<_> =
        (0..50).map(|i| Vector1::new(3.0 - 0.2 * f64::from(i) + 0.05 * f64::from(i * i))).collect();
    let mut weights = vec![1.0; 50];
    weights[20..25].fill(0.0);
    let mut gapped = y.clone();
    gapped[20..25].fill(Vector1::new(1e6));
    for (z, y) in whittaker(&gapped, &weights, penalty(0.05)).iter().zip(&y) {
        assert_relative_eq!(z.x, y.x, epsilon = 1e-7);
    }
}

fn pops_after(rate: f64, change: impl Fn(usize, &mut Isometry3<f64>)) -> Vec<Pop> {
    let mut samples = samples(0.0, rate, 60);
    for (i, pose) in samples.poses.iter_mut().enumerate() {
        change(i, pose);
    }
    find_pops(&samples.poses, rate)
}

#[test]
fn pops_are_found_and_fast_motion_is_not() {
    for rate in [24.0, 30.0, 60.0, 120.0] {
        assert_eq!(pops_after(rate, |_, _| {}), []);
        let spike = pops_after(rate, |i, p| {
            if i == 30 {
                p.translation.vector.y += 0.3
            }
        });
        assert_eq!(spike.iter().map(|p| (p.off.clone(), p.angular)).collect::<Vec<_>>(), [(30..31, false)]);
        let step = pops_after(rate, |i, p| {
            if i >= 30 {
                p.translation.vector.z += 0.3
            }
        });
        assert_eq!(step.iter().map(|p| (p.off.clone(), p.angular)).collect::<Vec<_>>(), [(30..30, false)]);
        let turn = pops_after(rate, |i, p| {
            if i == 30 {
                p.rotation *= UnitQuaternion::from_euler_angles(0.0, 2.2, 0.0)
            }
        });
        assert_eq!(turn.iter().map(|p| (p.off.clone(), p.angular)).collect::<Vec<_>>(), [(30..31, true)]);
    }
    // A sprint at 12 m/s with strides, and a head that turns at 25 rad/s.
    let fast: Vec<_> = (0..60)
        .map(|i| f64::from(i) / 24.0)
        .map(|t| {
            Isometry3::new(Vector3::new(12.0 * t, 0.05 * (18.0 * t).sin(), 0.0), Vector3::y() * (25.0 * t))
        })
        .collect();
    assert_eq!(find_pops(&fast, 24.0), []);
}

/// Poses at each step of 1 / `rate` over `seconds`.
fn sampled(rate: f64, seconds: f64, pose: impl Fn(f64) -> Isometry3<f64>) -> Vec<Isometry3<f64>> {
    (0..=(rate * seconds) as usize).map(|i| pose(i as f64 / rate)).collect()
}

#[test]
fn samples_at_an_end_are_off_if_the_track_jumps_there() {
    for (rate, run) in [(24.0, 1), (30.0, 3), (60.0, 1), (120.0, 12)] {
        let t_pose = |i: usize, p: &mut Isometry3<f64>| {
            if i < run {
                *p = Isometry3::new(Vector3::new(0.0, 1.7, 0.0), Vector3::y() * -1.0);
            }
        };
        let found = |n: usize, change: &dyn Fn(usize, &mut Isometry3<f64>)| {
            let mut poses = samples(2.0, rate, n).poses;
            poses.iter_mut().enumerate().for_each(|(i, p)| change(i, p));
            find_pops(&poses, rate).into_iter().map(|p| p.off).collect::<Vec<_>>()
        };
        assert_eq!(found(60, &t_pose), from_ref(&(0..run)), "{rate}");
        assert_eq!(found(60, &|i, p| t_pose(59 - i, p)), from_ref(&(60 - run..60)), "{rate}");
    }
}

#[test]
fn neighbouring_samples_that_are_off_are_one_pop() {
    for (rate, run) in [(24.0, 2), (60.0, 5), (120.0, 20)] {
        let off = pops_after(rate, |i, p| {
            if (30..30 + run).contains(&i) {
                p.translation.vector += Vector3::new(0.1, -0.3, 0.2);
            }
        });
        assert_eq!(
            off.iter().map(|p| p.off.clone()).collect::<Vec<_>>(),
            from_ref(&(30..30 + run)),
            "{rate}"
        );
    }
}

/// A capture at a low rate, written at a higher one, moves in stairs.
#[test]
fn stairs_of_a_held_capture_are_no_pops() {
    let stepped: Vec<_> = (0..40)
        .scan(0.0, |x, i| {
            *x += [0.032, 0.002][i % 2];
            Some(Isometry3::translation(*x, 1.6, 0.0))
        })
        .collect();
    for rate in [24.0, 30.0, 60.0, 120.0] {
        assert_eq!(find_pops(&stepped, rate), [], "{rate}");
    }
    for (rate, capture) in [(24.0, 12.0), (60.0, 15.0), (60.0, 30.0), (120.0, 15.0), (240.0, 24.0)] {
        let held = sampled(rate, 3.0, |t| motion((t * capture).floor() / capture));
        assert_eq!(find_pops(&held, rate), [], "{rate} {capture}");
    }
}

#[test]
fn turns_of_a_head_are_no_pops() {
    let turns: [&dyn Fn(f64) -> f64; 5] = [
        // 137° within a second: evenly, and with a start and a stop.
        &|t| 137f64.to_radians() * (t - 1.0).clamp(0.0, 1.0),
        &|t| {
            let u = (t - 1.0).clamp(0.0, 1.0);
            137f64.to_radians() * u * u * (3.0 - 2.0 * u)
        },
        // A whip turn that reaches 18 rad/s, a spin at 20 rad/s, a shake at 4 Hz.
        &|t| 1.4 * (1.0 - (std::f64::consts::PI * ((t - 1.0) / 0.12).clamp(0.0, 1.0)).cos()) / 2.0,
        &|t| 20.0 * (t - 0.5).max(0.0),
        &|t| 0.4 * (std::f64::consts::TAU * 4.0 * t).sin(),
    ];
    for (turn, angle) in turns.iter().enumerate() {
        for rate in [1.0, 2.0, 4.0, 8.0, 12.0, 24.0, 25.0, 30.0, 60.0, 120.0, 240.0] {
            let poses = sampled(rate, 3.0, |t| Isometry3::new(Vector3::y() * 1.6, Vector3::y() * angle(t)));
            assert_eq!(find_pops(&poses, rate), [], "{turn} at {rate}");
        }
    }
}

/// Noise of a capture, and falls that end on the ground.
#[test]
fn jitter_and_landings_are_no_pops() {
    for rate in [24.0, 60.0, 120.0] {
        let noise = |i: f64| ((i * 12.9898).sin() * 43758.5453).fract();
        let jittery = sampled(rate, 3.0, |t| {
            let i = t * rate;
            motion(t) * Isometry3::translation(0.04 * noise(i), 0.04 * noise(i + 0.3), 0.04 * noise(i + 0.7))
        });
        assert_eq!(find_pops(&jittery, rate), [], "{rate}");
        let fall = sampled(rate, 2.0, |t| Isometry3::translation(0.0, (2.0 - 4.9 * t * t).max(0.1), 0.0));
        assert_eq!(find_pops(&fall, rate), [], "{rate}");
    }
}

#[test]
fn bridged_samples_at_an_end_leave_the_track_at_rest_there() {
    for cutoff in [0.0, 12.0] {
        let valid = samples(0.0, 60.0, 40);
        let mut popped = valid.clone();
        popped.poses[..2].fill(Isometry3::translation(0.0, 9.0, 0.0));
        popped.bridged = vec![0, 1];
        let [valid, popped] = [valid, popped].map(|s| Track::through(&s, cutoff, &Isometry3::identity()));
        assert_eq!(popped.span().unwrap().0, 2.0 / 60.0);
        for t in [0.0, 1.0 / 60.0, 5.0 / 60.0] {
            assert!(distance(&valid.pose(t), &popped.pose(t)) < 0.01, "{cutoff} {t}");
        }
    }
}

#[test]
fn bridged_samples_are_interpolated() {
    for cutoff in [0.0, 12.0] {
        let valid = samples(0.0, 60.0, 40);
        let mut popped = valid.clone();
        popped.poses[17].translation.vector.x += 0.5;
        popped.poses[17].rotation *= UnitQuaternion::from_euler_angles(0.0, 2.2, 0.0);
        popped.bridged = vec![17];
        let [valid, popped] = [valid, popped].map(|s| Track::through(&s, cutoff, &Isometry3::identity()));
        let t = 17.0 / 60.0;
        assert!(distance(&valid.pose(t), &popped.pose(t)) < 2e-3, "{cutoff}");
    }
}

proptest! {
    #[test]
    fn poses_stay_finite(
        numbers in proptest::collection::vec((-5.0..5.0, -5.0..5.0, -3.0..3.0, -3.0..3.0), 1..20),
        cutoff in 0.0..40.0,
        t in -3.0..5.0,
    ) {
        let poses = numbers
            .iter()
            .map(|&(x, y, a, b)| Isometry3::new(Vector3::new(x, y, a), Vector3::new(a, b, x)))
            .collect();
        let track = Track::through(&PoseSamples { start: 0.0, rate: 24.0, poses, bridged: vec![] }, cutoff, &rest());
        let (angular, linear) = track.twist(t);
        prop_assert!(track.pose(t).to_homogeneous().iter().all(|x| x.is_finite()));
        prop_assert!(angular.iter().chain(linear.iter()).all(|x| x.is_finite()));
    }
}
