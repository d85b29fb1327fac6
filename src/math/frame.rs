//! Frames along curves: columns d1, d2, d3, with d3 the tangent.

use super::spline::{ArcSpline, CurvePoint};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Reflections between two neighbouring samples of [`rotation_minimising`]; the error is of fourth order in their step.
const SUBSTEPS: usize = 4;

/// Rotation-minimising transport of a frame from one point of a curve to another (double reflection: Wang, Jüttler,
/// Zheng & Liu 2008). `frame` has the tangent of `from` as d3.
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

/// A frame around a unit tangent: d1 square to the axis least along the tangent, which keeps it well-conditioned.
pub fn around(tangent: &Vector3<f64>) -> Matrix3<f64> {
    let mut axis = Vector3::zeros();
    axis[tangent.iamin()] = 1.0;
    let d2 = tangent.cross(&axis).normalize();
    Matrix3::from_columns(&[d2.cross(tangent), d2, *tangent])
}

/// Rotation-minimising frames at increasing arc lengths `s`, m, of a curve.
pub fn rotation_minimising(curve: &ArcSpline, s: &[f64]) -> Vec<UnitQuaternion<f64>> {
    let Some(&first) = s.first() else { return Vec::new() };
    let mut at = curve.at(first);
    let mut frame = around(&at.tangent);
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

    #[test]
    fn around_is_a_rotation_for_any_tangent() {
        for t in [Vector3::x(), -Vector3::y(), Vector3::z(), Vector3::new(1.0, -2.0, 0.5).normalize()] {
            let frame = around(&t);
            assert!((frame.transpose() * frame - Matrix3::identity()).norm() < 1e-14);
            assert!((frame.determinant() - 1.0).abs() < 1e-14 && (frame.column(2) - t).norm() < 1e-15);
        }
    }

    /// A frame carried along a helix turns against its axis by the torsion: over one turn by 2π (1 − sin of the climb).
    #[test]
    fn transport_follows_the_torsion_of_a_helix() {
        let (r, rise) = (0.02, 0.01);
        let helix = |a: f64| Vector3::new(r * a.cos(), r * a.sin(), rise * a);
        let points: Vec<_> = (0..=96).map(|i| helix(f64::from(i - 16) * TAU / 64.0)).collect();
        let curve = ArcSpline::through(&points).unwrap();
        let step = curve.length() / 96.0;
        let s: Vec<f64> = (16..=80).map(|i| f64::from(i) * step).collect();
        let frames = rotation_minimising(&curve, &s);
        let turn = frames[0].angle_to(&frames[64]);
        let climb = rise / r.hypot(rise);
        let expected = TAU * (1.0 - climb);
        let expected = expected.min(TAU - expected);
        assert!(turn > 1.0 && (turn - expected).abs() < 1e-3, "{turn} {expected}");
    }
}
