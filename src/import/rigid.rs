//! Splits affine transforms into rigid poses and scale.

use super::source::Source;
use crate::scene::anim::file::PoseFile;
use crate::{Diagnostic, Error, Result};
use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion, Vector3};

/// Relative difference of scales above which a warning is given, and above which roots would be a millimetre
/// off a head of 10 cm.
const SCALE_TOLERANCES: [f64; 2] = [1e-3, 1e-2];
/// Ratio of the smallest to the largest singular value below which a transform is singular.
const SINGULAR: f64 = 1e-9;

const SCALE_WARNING: &str =
    "the joint's scale changes over time: hair keeps its size, so roots will leave a growing scalp";

/// Rigid poses of a joint.
pub(super) struct RigidPoses {
    /// Poses over time.
    pub(super) poses: Vec<PoseFile>,
    /// The pose at rest.
    pub(super) bind: Option<PoseFile>,
    /// A warning if the scale changes.
    pub(super) warnings: Vec<String>,
}

/// The rigid parts of transforms over time and at rest. `key` names the transforms in error messages.
///
/// # Errors
/// Transforms that mirror, are singular or not finite.
pub(super) fn poses(
    source: &Source,
    key: &str,
    matrices: &[Matrix4<f64>],
    rest: Option<&Matrix4<f64>>,
) -> Result<RigidPoses> {
    let error = |what: String| {
        Diagnostic::new(
            &source.path,
            key,
            what,
            "finite transforms with positive determinant",
            "remove negative or zero scale from the joint and its ancestors, or select another joint",
        )
    };
    let all: Vec<_> = matrices.iter().map(decompose).collect();
    let mut diagnostics = Vec::new();
    if let Some(first) = all.iter().position(Option::is_none) {
        let count = all.iter().filter(|pose| pose.is_none()).count();
        diagnostics.push(error(format!(
            "{count} transforms mirror, are singular or not finite, the first of them sample {first}"
        )));
    }
    let rest = rest.map(decompose);
    if rest == Some(None) {
        diagnostics.push(error("the rest transform mirrors, is singular or not finite".into()));
    }
    Error::if_any(diagnostics)?;
    let rest = rest.flatten();
    let all: Vec<_> = all.into_iter().flatten().collect();
    let reference = rest.as_ref().or(all.first()).map_or(1.0, |pose| pose.1);
    let change = |pose: &(PoseFile, f64)| (pose.1 / reference - 1.0).abs();
    let largest = all.iter().enumerate().max_by(|a, b| change(a.1).total_cmp(&change(b.1)));
    let [warned, refused] = SCALE_TOLERANCES.map(|tolerance| largest.filter(|l| change(l.1) > tolerance));
    let warnings = if warned.is_some() { vec![SCALE_WARNING.into()] } else { Vec::new() };
    if let Some((sample, pose)) = refused {
        return Err(Error::from(Diagnostic::new(
            &source.path,
            key,
            format!("the scale at sample {sample} is {:.3} times that at rest", pose.1 / reference),
            "the scale at rest, within 1 %: hair keeps its size, and roots would leave the scalp",
            "remove the scale from the joint and its ancestors; if the shot makes the character larger throughout, \
             import groom, colliders and motion from the shot",
        )));
    }
    Ok(RigidPoses {
        poses: all.into_iter().map(|pose| pose.0).collect(),
        bind: rest.map(|pose| pose.0),
        warnings,
    })
}

/// The rigid part of a transform and its mean scale. The rotation is the nearest to the linear part (its
/// orthogonal polar factor). `None` if the transform mirrors, is singular or not finite.
fn decompose(matrix: &Matrix4<f64>) -> Option<(PoseFile, f64)> {
    let linear: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let at = Vector3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]);
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let svd = linear.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let rotation = u * v_t;
    let [low, high] = [svd.singular_values.min(), svd.singular_values.max()];
    if rotation.determinant() < 0.0 || low <= SINGULAR * high {
        return None;
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Some((
        PoseFile { translation: at.into(), rotation_wxyz: [q.w, q.i, q.j, q.k] },
        svd.singular_values.mean(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::motion::rotation;

    #[test]
    fn a_scale_that_differs_from_that_at_rest_is_refused() {
        let scaled = |scale: f64| Matrix4::<f64>::new_scaling(scale);
        let poses = |rest: f64, scales: &[f64]| {
            let matrices: Vec<_> = scales.iter().map(|s| scaled(*s)).collect();
            super::poses(&Source::new("a.usda"), "/head", &matrices, Some(&scaled(rest)))
        };
        assert!(poses(100.0, &[100.0, 100.01]).unwrap().warnings.is_empty());
        assert_eq!(poses(1.0, &[1.0, 1.005]).unwrap().warnings.len(), 1);
        for (rest, scales, what) in
            [(1.0, [1.1, 1.1], "sample 1 is 1.100"), (1.0, [1.0, 0.8], "sample 1 is 0.800")]
        {
            let Err(Error::BadInput(diagnostics)) = poses(rest, &scales) else { panic!("{scales:?}") };
            let message = &diagnostics.first().unwrap().message;
            assert!(message.contains("scale") && message.contains(what), "{message}");
        }
    }

    #[test]
    fn a_transform_is_split_into_rotation_translation_and_scale() {
        let q = UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1);
        let matrix = Matrix4::new_translation(&Vector3::new(1.0, 2.0, 3.0))
            * q.to_homogeneous()
            * Matrix4::new_nonuniform_scaling(&Vector3::new(1.9, 2.0, 2.1));
        let (pose, scale) = decompose(&matrix).unwrap();
        assert_eq!(pose.translation, [1.0, 2.0, 3.0]);
        assert!(rotation(pose.rotation_wxyz).angle_to(&q) < 1e-9 && (scale - 2.0).abs() < 1e-12);
        let mirrored = matrix * Matrix4::new_nonuniform_scaling(&Vector3::new(-1.0, 1.0, 1.0));
        assert!(decompose(&mirrored).is_none());
        assert!(decompose(&Matrix4::new_nonuniform_scaling(&Vector3::new(1.0, 0.0, 1.0))).is_none());
        assert!(decompose(&Matrix4::from_element(f64::NAN)).is_none());
    }
}
