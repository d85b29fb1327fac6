//! Frames along curves: rotation matrices with columns d1, d2, d3, where d3 is the tangent.

use super::se3::hat;
use super::spline::{ArcSpline, CurvePoint};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Double reflections between two samples of [`rotation_minimising`]; the error is of fourth order in their
/// step.
const SUBSTEPS: usize = 4;

/// Rotation-minimising transport of a frame between two points of a curve by double reflection (Wang,
/// Jüttler, Zheng & Liu 2008). `frame` has the tangent of `from` as d3.
pub fn double_reflection(frame: &Matrix3<f64>, from: &CurvePoint, to: &CurvePoint) -> Matrix3<f64> {
    let reflect = |a: Vector3<f64>, v: &Vector3<f64>| match v.norm_squared() {
        c if c > 0.0 => a - v * (2.0 / c * v.dot(&a)),
        _ => a,
    };
    let chord = to.x - from.x;
    let turn = to.tangent - reflect(from.tangent, &chord);
    let d1 = reflect(reflect(frame.column(0).into(), &chord), &turn);
    let d1 = (d1 - to.tangent * to.tangent.dot(&d1)).normalize();
    Matrix3::from_columns(&[d1, to.tangent.cross(&d1), to.tangent])
}

/// The smallest rotation that takes unit vector `a` to unit vector `b`. If they are opposite, a rotation by π
/// about some perpendicular axis.
pub fn transport(a: &Vector3<f64>, b: &Vector3<f64>) -> Matrix3<f64> {
    let (v, c) = (a.cross(b), a.dot(b));
    if c < -1.0 + 1e-12 {
        let axis = any_frame(a).column(0).into_owned();
        return axis * axis.transpose() * 2.0 - Matrix3::identity();
    }
    let h = hat(&v);
    Matrix3::identity() + h + h * h / (1.0 + c)
}

/// A frame with the unit tangent as d3. d1 is as close as possible to the coordinate axis least aligned with
/// the tangent, so that the frame is well-conditioned.
pub fn any_frame(tangent: &Vector3<f64>) -> Matrix3<f64> {
    let d2 = tangent.cross(&Vector3::ith(tangent.iamin(), 1.0)).normalize();
    Matrix3::from_columns(&[d2.cross(tangent), d2, *tangent])
}

/// The frame with the unit tangent as d3 and d1 as close as possible to the vector `axis`; [`any_frame`] if
/// these are parallel.
pub fn frame_towards(tangent: &Vector3<f64>, axis: &Vector3<f64>) -> Matrix3<f64> {
    match tangent.cross(axis).try_normalize(1e-9) {
        Some(d2) => Matrix3::from_columns(&[d2.cross(tangent), d2, *tangent]),
        None => any_frame(tangent),
    }
}

/// Rotation-minimising frames at increasing arc lengths `s`, m, of a curve. The first is [`frame_towards`]
/// `axis`, or [`any_frame`] if that is `None`.
pub fn rotation_minimising(
    curve: &ArcSpline,
    s: &[f64],
    axis: Option<&Vector3<f64>>,
) -> Vec<UnitQuaternion<f64>> {
    let Some(&first) = s.first() else { return Vec::new() };
    let mut at = curve.at(first);
    let mut frame = axis.map_or_else(|| any_frame(&at.tangent), |axis| frame_towards(&at.tangent, axis));
    let mut last = first;
    s.iter()
        .map(|&next| {
            for i in 1..=SUBSTEPS {
                let to = curve.at(last + (next - last) * i as f64 / SUBSTEPS as f64);
                frame = double_reflection(&frame, &at, &to);
                at = to;
            }
            last = next;
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(frame))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn tangents() -> [Vector3<f64>; 4] {
        [Vector3::x(), -Vector3::y(), Vector3::z(), Vector3::new(1.0, -2.0, 0.5).normalize()]
    }

    #[test]
    fn frames_are_rotations_for_any_tangent_and_axis() {
        for t in tangents() {
            for frame in
                [any_frame(&t), frame_towards(&t, &Vector3::new(0.3, 0.1, 2.0)), frame_towards(&t, &t)]
            {
                assert!((frame.transpose() * frame - Matrix3::identity()).norm() < 1e-14);
                assert!((frame.determinant() - 1.0).abs() < 1e-14 && (frame.column(2) - t).norm() < 1e-15);
            }
        }
        let frame = frame_towards(&Vector3::z(), &Vector3::new(2.0, 0.0, 5.0));
        assert!((frame.column(0) - Vector3::x()).norm() < 1e-15);
    }

    #[test]
    fn transport_is_the_smallest_rotation() {
        for a in tangents() {
            for b in tangents().into_iter().chain([-a]) {
                let turn = transport(&a, &b);
                assert!((turn * a - b).norm() < 1e-14);
                let angle = Rotation3::from_matrix_unchecked(turn).angle();
                assert!((angle - a.angle(&b)).abs() < 1e-7, "{angle}");
            }
        }
    }

    /// Over one turn of a helix the frame rotates by 2π (1 − sin(pitch angle)).
    #[test]
    fn rotation_minimising_frames_follow_the_torsion_of_a_helix() {
        let (r, rise) = (0.02, 0.01);
        let helix = |a: f64| Vector3::new(r * a.cos(), r * a.sin(), rise * a);
        let points: Vec<_> = (0..=96).map(|i| helix(f64::from(i - 16) * TAU / 64.0)).collect();
        let curve = ArcSpline::through(&points).unwrap();
        let step = curve.length() / 96.0;
        let s: Vec<f64> = (16..=80).map(|i| f64::from(i) * step).collect();
        let frames = rotation_minimising(&curve, &s, None);
        let turn = frames[0].angle_to(&frames[64]);
        let climb = rise / r.hypot(rise);
        let expected = TAU * (1.0 - climb);
        let expected = expected.min(TAU - expected);
        assert!(turn > 1.0 && (turn - expected).abs() < 1e-3, "{turn} {expected}");
    }
}
