//! Imports of real grooms and motion; skipped where the files are missing.

use super::groom::convert::groom;
use super::groom::options::{DEFAULT_GUIDES, GroomOptions};
use super::joint_selector::JointSelector;
use super::motion::rotation;
use super::source::Source;
use super::track::convert::track;
use super::track::options::TrackOptions;
use crate::scene::{Array, Convention, UpAxis, load_motion};
use crate::test_data::shared_data;
use nalgebra::{Isometry3, Vector3};

#[test]
fn strands_are_grown_around_the_guides_of_sintel() {
    let Some(path) = shared_data("grooms/sintel_guides_228x32_cm.tfx") else { return };
    let (groom, report) = groom(&GroomOptions::new(Source::new(path))).unwrap();
    assert_eq!(report.fit.counts, [228, 114, 11_400]);
    assert_eq!(groom.convention.metres_per_unit, 0.01);
    let leaves: Vec<_> = groom.trees.iter().flat_map(|t| &t.wisps).filter(|w| !w.guides.is_empty()).collect();
    assert!(leaves.iter().all(|w| w.guides.len() <= 3));
    assert!(report.fit.guide_error.length[1] < 0.005, "{report}");
    assert!(
        report.fit.levels[1].distance_per_length < 0.08
            && report.fit.levels[1].distance[0] < 0.5 * report.fit.levels[0].distance[0],
        "{report}"
    );
}

#[test]
fn render_strands_in_metres_follow_guides_in_centimetres() {
    let Some(guides) = shared_data("grooms/sintel_guides_228x32_cm.tfx") else { return };
    let Some(strands) = shared_data("grooms/sintel_full_11400x16_m.tfx") else { return };
    let mut options = GroomOptions::new(Source::new(guides));
    options.strands = Some(Source { offset: Vector3::new(0.0, -1.2, 0.0), ..Source::new(strands) });
    let (groom, report) = groom(&options).unwrap();
    assert_eq!(groom.strands.curves.len(), 11_400);
    let hairs: u32 = groom.trees.iter().map(|t| t.wisps[0].strand_count).sum();
    assert!((11_400..11_400 + 228).contains(&hairs), "{hairs}");
    assert!(report.fit.levels[1].inside > 0.8, "{report}");
}

#[test]
fn guides_are_chosen_from_the_strands_of_ratboy() {
    let Some(path) = shared_data("grooms/ratboy_mane_2228x32_m.tfx") else { return };
    let (groom, report) = groom(&GroomOptions::new(Source::new(path))).unwrap();
    assert_eq!(groom.guides.curves.len(), DEFAULT_GUIDES);
    assert_eq!(report.sources[0].too_short, 9);
    assert_eq!(groom.strands.curves.len(), 2228 - 9);
    assert!(groom.strands.curves.root_uv.iter().any(|uv| uv[0] > 0.0));
}

/// Largest differences, m and rad, between the poses of a joint and those that another program exported
/// (`reference`).
fn difference(file: Source, joint: &str, reference: &str) -> Option<[f64; 2]> {
    let theirs = load_motion(&shared_data(reference)?).unwrap().1;
    let mut options = TrackOptions::new(file, "");
    options.joint = JointSelector { name: Some(joint.into()), clip: None };
    let anim = track(&options).unwrap().anim;
    let convention = Convention { metres_per_unit: anim.metres_per_unit, up: anim.up_axis };
    let ours = anim.bodies[0].track.as_ref().unwrap();
    let (Some(Array::Inline(positions)), Some(Array::Inline(rotations))) =
        (&ours.translation, &ours.rotation_wxyz)
    else {
        panic!("the poses are not inline")
    };
    let ours = positions.iter().zip(rotations).map(|(&x, &q)| convention.pose_in(x.into(), rotation(q)));
    let difference = |(a, b): (Isometry3<f64>, &Isometry3<f64>)| {
        [(a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation)]
    };
    assert_eq!(ours.len(), theirs.len());
    Some(ours.zip(&theirs).map(difference).fold([0.0; 2], |a, b| [a[0].max(b[0]), a[1].max(b[1])]))
}

#[test]
fn bvh_motion_agrees_with_another_reader() {
    let Some(path) = shared_data("motion_src/mh_walk1.bvh") else { return };
    let file = Source { metres_per_unit: Some(0.1), up: Some(UpAxis::Z), ..Source::new(path) };
    let Some([metres, radians]) = difference(file, "Head", "motion/makehuman_walk1_24fps.json") else {
        return;
    };
    assert!(metres < 2e-6 && radians < 1e-5, "{metres} m, {radians}");
}

#[test]
fn gltf_motion_agrees_with_another_reader() {
    let Some(path) = shared_data("motion_src/CesiumMan.glb") else { return };
    let joint = "Skeleton_neck_joint_2";
    let Some([metres, radians]) = difference(Source::new(path), joint, "motion/cesiumman_walk_24fps.json")
    else {
        return;
    };
    assert!(metres < 2e-6 && radians < 1e-5, "{metres} m, {radians}");
}
