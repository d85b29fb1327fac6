//! Guides that grow on the scalp, are combed away from a parting, fall around the head and are cut at a hem.

use super::head;
use super::style::Cut;
use crate::math::frame::rotation_minimising;
use crate::math::spline::ArcSpline;
use crate::scene::Curves;
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

/// The golden angle, rad: the azimuth between consecutive points of a Fibonacci sphere.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// Growth step, m.
const STEP: f64 = 0.003;
/// Length over which a hair bends into the combing direction, m.
const BEND_LENGTH: f64 = 0.022;
/// Position of the parting, m to the left of the centre.
const PARTING_X: f64 = 0.022;

/// Makes `count` guides of a style, m, rest space.
pub(super) fn guides(cut: &Cut, count: usize) -> Curves {
    let mut out = Curves { offsets: vec![0], ..Curves::default() };
    for (i, d) in scalp_directions(count).into_iter().enumerate() {
        let course = grow_course(d, cut, i as u64);
        out.points.extend(curl(&course, cut, i as u64));
        out.offsets.push(out.points.len());
        out.id.push(i as i32);
        out.group.push(0);
        let (azimuth, elevation) = (d.x.atan2(d.z), d.y.asin());
        out.root_uv.push([(0.5 + azimuth / TAU) as f32, (0.5 + elevation / PI) as f32]);
    }
    out
}

/// Lowest elevation of hair, rad, at an azimuth from the face, rad.
fn hairline(azimuth: f64) -> f64 {
    // Forehead, temple, ear, nape.
    const LINE: [(f64, f64); 6] =
        [(0.0, 0.60), (0.55, 0.58), (1.0, 0.40), (1.55, 0.22), (2.1, -0.25), (PI, -0.55)];
    let k = LINE.iter().position(|&(a, _)| azimuth <= a).unwrap_or(LINE.len() - 1).max(1);
    let ((a0, e0), (a1, e1)) = (LINE[k - 1], LINE[k]);
    e0 + (e1 - e0) * (azimuth - a0) / (a1 - a0)
}

/// `count` directions from the centre of the head, evenly spread over the scalp: the points of a Fibonacci
/// sphere above the hairline.
fn scalp_directions(count: usize) -> Vec<Vector3<f64>> {
    let on_scalp = |points: usize| -> Vec<Vector3<f64>> {
        (0..points)
            .map(|i| {
                let y = 1.0 - (2.0 * i as f64 + 1.0) / points as f64;
                let (sin, cos) = (i as f64 * GOLDEN_ANGLE).sin_cos();
                let level = (1.0 - y * y).sqrt();
                Vector3::new(level * sin, y, level * cos)
            })
            .filter(|d| d.y.asin() > hairline(d.x.abs().atan2(d.z)))
            .collect()
    };
    let mut points = count;
    loop {
        let mut found = on_scalp(points);
        if found.len() >= count {
            found.truncate(count);
            return found;
        }
        points += (count - found.len()).max(1);
    }
}

/// The course of a hair without curls, from the root in direction `d`.
fn grow_course(d: Vector3<f64>, cut: &Cut, seed: u64) -> Vec<Vector3<f64>> {
    let root = head::point(d);
    let (_, up) = head::height(root);
    let side = if root.x < PARTING_X { -1.0 } else { 1.0 };
    // Hair that grows higher lies on top.
    let layer = 0.002 + 0.010 * (d.y + 0.5).max(0.0) * (0.7 + 0.6 * random(seed, 0)) + cut.curl_radius;
    let length = cut.longest * (0.86 + 0.14 * random(seed, 1));
    let hem = cut.hem + 0.03 * (random(seed, 2) - 0.5);
    let stray = Vector3::from_fn(|k, _| random(seed, 3 + k as u64) - 0.5) * 0.16;

    let mut x = root;
    let mut along = (up * 1.2 + combing_direction(root, side) * 0.5 + stray).normalize();
    let mut out = vec![x];
    let steps = (length / STEP).round() as usize;
    for step in 1..=steps {
        let grown = step as f64 * STEP;
        let mut direction = combing_direction(x, side) + stray;
        let (height, normal) = head::height(x);
        let clearance = layer * (grown / 0.03).min(1.0);
        if height < clearance + 0.01 {
            // Slide along the surface and rise to the layer.
            direction -= normal * direction.dot(&normal).min(0.0);
            direction += normal * (3.0 * (clearance - height) / 0.01).clamp(-0.4, 1.2);
        }
        along = (along
            + (direction.try_normalize(1e-9).unwrap_or(along) - along) * (STEP / BEND_LENGTH).min(1.0))
        .normalize();
        x += along * STEP;
        x = lift(x, grown);
        out.push(x);
        if x.y < hem && step >= 8 {
            break;
        }
    }
    out
}

/// Moves a point of a hair, `grown` m from its root, out of the body to a minimum height.
fn lift(x: Vector3<f64>, grown: f64) -> Vector3<f64> {
    let (height, normal) = head::height(x);
    let minimum = 0.0015 * (grown / 0.01).min(1.0);
    x + normal * (minimum - height).max(0.0)
}

/// Combing direction at `x`: away from the parting and the face, then down. `side` is that of the parting, −1
/// or 1.
fn combing_direction(x: Vector3<f64>, side: f64) -> Vector3<f64> {
    let from = x - head::CENTRE;
    let top = ((from.y - 0.03) / 0.07).clamp(0.0, 1.0);
    let front = ((from.z - 0.01) / 0.06).clamp(0.0, 1.0);
    let face = front * (1.0 - ((from.x.abs() - 0.045) / 0.05).clamp(0.0, 1.0));
    Vector3::new(side * (1.1 * top + 1.2 * face), -1.0, -0.35 * top * front - 0.9 * face - 0.25 * front)
}

/// Winds a course into a helix whose radius grows from the root; straight hair gets a slight wave.
fn curl(course: &[Vector3<f64>], cut: &Cut, seed: u64) -> Vec<Vector3<f64>> {
    let Some(spline) = ArcSpline::through(course) else { return course.to_vec() };
    let vertices = cut.vertices[0];
    let s: Vec<f64> = (0..vertices).map(|v| spline.length() * v as f64 / (vertices - 1) as f64).collect();
    let phase = TAU * random(seed, 6);
    let radius = cut.curl_radius * (0.75 + 0.5 * random(seed, 7));
    let pitch = cut.curl_pitch * (0.85 + 0.3 * random(seed, 8));
    let wind = |(frame, &s): (&nalgebra::UnitQuaternion<f64>, &f64)| {
        let open = (s / (1.5 * cut.curl_pitch).min(0.05)).min(1.0);
        let open = open * open * (3.0 - 2.0 * open);
        let (sin, cos) = (phase + TAU * s / pitch).sin_cos();
        lift(spline.at(s).x + frame * Vector3::new(cos, sin, 0.0) * (radius * open), s)
    };
    rotation_minimising(&spline, &s, None).iter().zip(&s).map(wind).collect()
}

/// A random number in [0, 1): number `stream` of hair `seed`.
fn random(seed: u64, stream: u64) -> f64 {
    crate::math::random::unit(0, seed << 8 | stream)
}
