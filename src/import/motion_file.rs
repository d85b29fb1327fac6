//! Motion files: our own JSON, BVH, glTF and USD.

use super::formats;
use super::joint_selector::JointSelector;
use super::motion::{GroomCurves, Motion};
use super::source::Source;
use crate::scene::anim::file::PoseFile;
use crate::scene::anim::motion_file::MotionFrame;
use crate::scene::{self, Convention};
use crate::{Error, Result};
use std::path::Path;

/// Reads a motion with the reader that the extension selects; a file with any other extension is read as
/// JSON. `rest_of`: USD only, the stage whose rest pose counts; `None` for the rest space of the character.
/// `curves`: the curves of the groom that it carries, if it comes from USD.
///
/// # Errors
/// Every error in the file; [`Error::Usage`] if a joint or prim is selected in a file that has none.
pub(super) fn read_motion(
    source: &Source,
    joint: &JointSelector,
    rest_of: Option<&Path>,
    curves: Option<&GroomCurves>,
) -> Result<Motion> {
    source.check()?;
    match source.extension().as_deref() {
        _ if source.is_usd() => formats::usd::motion::read(source, joint.name.as_deref(), rest_of, curves),
        Some("bvh") => formats::bvh::parse(source, joint, &source.read()?),
        Some("gltf" | "glb") => formats::gltf::parse(source, joint, &source.read()?),
        _ if joint.name.is_some() => Err(Error::Usage(format!(
            "{}: --joint needs a USD, BVH or glTF file; this file has a single joint without a name",
            source.path.display()
        ))),
        _ => read_json(source),
    }
}

/// Reads a motion file in our JSON format.
fn read_json(source: &Source) -> Result<Motion> {
    let (file, _) = scene::load_motion(&source.path)?;
    let pose = |f: &MotionFrame| PoseFile { translation: f.translation, rotation_wxyz: f.rotation_quat_wxyz };
    Ok(Motion {
        rate: file.fps,
        numbering: None,
        convention: Convention {
            metres_per_unit: source.metres_per_unit.unwrap_or(file.units.metres()),
            up: source.up.unwrap_or(file.up_axis.into()),
        },
        poses: file.frames.iter().map(pose).collect(),
        bind: None,
        stage: None,
        notes: Vec::new(),
        warnings: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selecting_a_joint_in_a_json_file_is_a_usage_error() {
        let joint = JointSelector { name: Some("Head".into()), clip: None };
        assert!(matches!(read_motion(&Source::new("walk.json"), &joint, None, None), Err(Error::Usage(_))));
    }
}
