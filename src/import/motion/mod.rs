//! The motion of a joint as a file has it: our own motion files, BVH, glTF, USD.

mod bvh;
mod gltf;

use super::read::Source;
use super::usd;
use crate::scene::anim::file::PoseFile;
use crate::scene::{Convention, UpAxis};
use crate::{Diagnostic, Error, Result, scene};
use nalgebra::{Isometry3, Matrix3, Matrix4, Quaternion, Rotation3, UnitQuaternion, Vector3};

/// Scales that differ by less are the same.
const SAME_SCALE: f64 = 1e-3;
/// Scale, or the sine of the angle between axes, below which a transform is flat.
const FLAT: f64 = 1e-9;
/// Joints that a fault names at most.
const NAMED: usize = 60;

/// Which joint of a motion file, and which of its animations.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joint {
    /// Name of the joint (BVH, USD) or node (glTF); `None` where the file has one joint, or for the prim itself (USD).
    pub name: Option<String>,
    /// Name of the animation (glTF); `None` for the first.
    pub clip: Option<String>,
}

/// Evenly sampled poses of a joint in the world.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Motion {
    /// Samples a second.
    pub(super) rate: f64,
    /// Number of the first sample's frame, and frames a second in which it is counted, where the file numbers its frames.
    pub(super) numbered: Option<(f64, f64)>,
    /// Unit and up axis of the poses.
    pub(super) convention: Convention,
    /// The poses.
    pub(super) poses: Vec<PoseFile>,
    /// The joint in the pose in which the character was modelled, where the file has it.
    pub(super) bind: Option<PoseFile>,
    /// Prim of a USD file that was followed.
    pub(super) prim: Option<String>,
    /// What an artist should know.
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
}

impl Motion {
    /// The poses in metres, Y up.
    pub(super) fn in_metres(&self) -> Vec<Isometry3<f64>> {
        let pose = |p: &PoseFile| self.convention.pose_in(p.translation.into(), turn(p.rotation_wxyz));
        self.poses.iter().map(pose).collect()
    }
}

/// A rotation of a file that was checked.
pub(super) fn turn([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// Reads a motion; its format follows from its ending.
///
/// # Errors
/// Every fault of the file that was found; [`Error::Usage`] where a joint or a prim is named of a file that has none.
pub(super) fn read(source: &Source, joint: &Joint) -> Result<Motion> {
    source.check()?;
    let ending = source.path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let read = match ending.as_deref() {
        _ if usd::is_usd(&source.path) => return usd::motion(source, joint.name.as_deref()),
        Some("bvh") => bvh::parse,
        Some("gltf" | "glb") => gltf::parse,
        _ if joint.name.is_some() => {
            let what = format!(
                "{}: a motion file of this kind has one joint, without a name",
                source.path.display()
            );
            return Err(Error::Usage(what));
        }
        _ => return of_our_own(source),
    };
    let bytes = crate::file::read_file(&source.path).map_err(|e| Error::io(&source.path, e))?;
    read(source, joint, &bytes)
}

/// A motion file in JSON.
fn of_our_own(source: &Source) -> Result<Motion> {
    let (file, _) = scene::motion(&source.path)?;
    let pose = |f: &scene::anim::file::MotionFrame| PoseFile {
        translation: f.translation,
        rotation_wxyz: f.rotation_quat_wxyz,
    };
    Ok(Motion {
        rate: file.fps,
        numbered: None,
        convention: Convention {
            metres_per_unit: source.metres_per_unit.unwrap_or(file.units.metres()),
            up: source.up.unwrap_or(file.up_axis.into()),
        },
        poses: file.frames.iter().map(pose).collect(),
        bind: None,
        prim: None,
        notes: Vec::new(),
        warnings: Vec::new(),
    })
}

/// What a joint name does not find.
fn no_joint(source: &Source, asked: Option<&str>, there: &[&str], kind: &str) -> Error {
    let what = match asked {
        Some(name) => format!("there is no {kind} \"{name}\""),
        None => format!("it has {} {kind}s, and none is named", there.len()),
    };
    let more = if there.len() > NAMED { ", …" } else { "" };
    let names: Vec<&str> = there.iter().take(NAMED).copied().collect();
    Diagnostic::new(
        &source.path,
        kind,
        what,
        format!("one of: {}{more}", names.join(", ")),
        "name one with --joint, such as that of the head",
    )
    .into()
}

/// A transform as the pose and the scale (the mean of the three axes') that it holds; the rotation is the nearest one.
fn rigid(matrix: &Matrix4<f64>) -> Option<(PoseFile, f64)> {
    let linear: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let at = Vector3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]);
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let svd = linear.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let rotation = u * v_t;
    let [low, high] = [svd.singular_values.min(), svd.singular_values.max()];
    if rotation.determinant() < 0.0 || low <= FLAT * high {
        return None;
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Some((
        PoseFile { translation: at.into(), rotation_wxyz: [q.w, q.i, q.j, q.k] },
        svd.singular_values.mean(),
    ))
}

/// The poses of transforms over time and at rest, and whether their scale changes.
pub(super) fn rigid_all(
    source: &Source,
    key: &str,
    matrices: &[Matrix4<f64>],
    rest: Option<&Matrix4<f64>>,
) -> Result<(Vec<PoseFile>, Option<PoseFile>, bool)> {
    let fault = |what: String| {
        Diagnostic::new(
            &source.path,
            key,
            what,
            "a transform that keeps handedness and flattens nothing",
            "mirror or flatten nothing above the joint, or name another joint",
        )
    };
    let all: Vec<_> = matrices.iter().map(rigid).collect();
    let mut problems = Vec::new();
    if let Some(first) = all.iter().position(Option::is_none) {
        let faulty = all.iter().filter(|pose| pose.is_none()).count();
        problems.push(fault(format!(
            "{faulty} samples, the first number {first}, are mirrored, flat or no numbers"
        )));
    }
    let rest = match rest.map(rigid) {
        Some(None) => {
            problems.push(fault("the rest pose is mirrored, flat or no numbers".into()));
            None
        }
        Some(rest) => rest,
        None => None,
    };
    Error::if_any(problems)?;
    let all: Vec<_> = all.into_iter().flatten().collect();
    let usual = rest.as_ref().or(all.first()).map_or(1.0, |pose| pose.1);
    let changes = all.iter().any(|pose| (pose.1 / usual - 1.0).abs() > SAME_SCALE);
    Ok((all.into_iter().map(|pose| pose.0).collect(), rest.map(|pose| pose.0), changes))
}

/// What is said of a joint whose scale changes.
pub(super) const SCALE_CHANGES: &str =
    "the joint's scale changes: hair keeps its size, so roots will leave a skin that grows";

/// A rate, as a whole number if it is within a thousandth of one: files round the time of a frame.
fn whole_if_near(rate: f64) -> f64 {
    if (rate - rate.round()).abs() < 1e-3 * rate { rate.round() } else { rate }
}

/// Unit and up axis: as given, else those of the format.
fn convention(source: &Source, metres_per_unit: f64, up: UpAxis) -> Convention {
    Convention {
        metres_per_unit: source.metres_per_unit.unwrap_or(metres_per_unit),
        up: source.up.unwrap_or(up),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_without_joints_has_none_to_name() {
        let joint = Joint { name: Some("Head".into()), clip: None };
        assert!(matches!(read(&Source::new("walk.json"), &joint), Err(Error::Usage(_))));
    }

    #[test]
    fn a_transform_gives_its_rotation_and_scale() {
        let q = UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1);
        let matrix = Matrix4::new_translation(&Vector3::new(1.0, 2.0, 3.0))
            * q.to_homogeneous()
            * Matrix4::new_nonuniform_scaling(&Vector3::new(1.9, 2.0, 2.1));
        let (pose, scale) = rigid(&matrix).unwrap();
        assert_eq!(pose.translation, [1.0, 2.0, 3.0]);
        assert!(turn(pose.rotation_wxyz).angle_to(&q) < 1e-9 && (scale - 2.0).abs() < 1e-12);
        assert!(rigid(&(matrix * Matrix4::new_nonuniform_scaling(&Vector3::new(-1.0, 1.0, 1.0)))).is_none());
        assert!(rigid(&Matrix4::new_nonuniform_scaling(&Vector3::new(1.0, 0.0, 1.0))).is_none());
        assert!(rigid(&Matrix4::from_element(f64::NAN)).is_none());
    }
}
