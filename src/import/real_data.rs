//! The importer on real grooms, where they are at hand.

use super::{GroomOptions, Joint, Source, TrackOptions, groom, track};
use crate::scene::{Array, UpAxis, motion};
use crate::test_data::shared_data;
use nalgebra::Isometry3;
use nalgebra::Vector3;

#[test]
fn sintel_grows_to_its_own_number_of_strands() {
    let Some(path) = shared_data("grooms/sintel_guides_228x32_cm.tfx") else { return };
    let (groom, report) = groom(&GroomOptions::new(Source::new(path))).unwrap();
    assert_eq!(report.fit.counts, [228, 114, 11_400]);
    assert_eq!(groom.convention.metres_per_unit, 0.01);
    let leaves: Vec<_> = groom.trees.iter().flat_map(|t| &t.wisps).filter(|w| !w.guides.is_empty()).collect();
    assert!(leaves.iter().all(|w| w.guides.len() <= 3));
    assert!(report.fit.guide_error.length[1] < 0.005, "{report}");
    assert!(
        report.fit.levels[1].of_length < 0.08
            && report.fit.levels[1].distance[0] < 0.5 * report.fit.levels[0].distance[0],
        "{report}"
    );
}

#[test]
fn dense_strands_in_metres_join_guides_in_centimetres() {
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
fn ratboy_gets_guides_chosen_from_his_strands() {
    let Some(path) = shared_data("grooms/ratboy_mane_2228x32_m.tfx") else { return };
    let (groom, report) = groom(&GroomOptions::new(Source::new(path))).unwrap();
    assert_eq!(groom.guides.curves.len(), super::groom::CHOSEN_GUIDES);
    assert_eq!(report.sources[0].degenerate, 9);
    assert_eq!(groom.strands.curves.len(), 2228 - 9);
    assert!(groom.strands.curves.root_uv.iter().any(|uv| uv[0] > 0.0));
}

/// The joint of a file against what somebody else made of it: metres and radians, at most.
fn apart(file: Source, joint: &str, theirs: &str) -> Option<[f64; 2]> {
    let theirs = motion(&shared_data(theirs)?).unwrap().1;
    let mut options = TrackOptions::new(file, "");
    options.joint = Joint { name: Some(joint.into()), clip: None };
    let anim = track(&options).unwrap().anim;
    let convention = crate::scene::Convention { metres_per_unit: anim.metres_per_unit, up: anim.up_axis };
    let ours = anim.bodies[0].track.as_ref().unwrap();
    let (Some(Array::Inline(at)), Some(Array::Inline(turn))) = (&ours.translation, &ours.rotation_wxyz)
    else {
        panic!("poses in the file")
    };
    let ours = at.iter().zip(turn).map(|(&x, &q)| convention.pose_in(x.into(), super::motion::turn(q)));
    let off = |(a, b): (Isometry3<f64>, &Isometry3<f64>)| {
        [(a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation)]
    };
    assert_eq!(ours.len(), theirs.len());
    Some(ours.zip(&theirs).map(off).fold([0.0; 2], |a, b| [a[0].max(b[0]), a[1].max(b[1])]))
}

#[test]
fn a_walk_in_bvh_is_where_others_find_it() {
    let Some(path) = shared_data("motion_src/mh_walk1.bvh") else { return };
    let file = Source { metres_per_unit: Some(0.1), up: Some(UpAxis::Z), ..Source::new(path) };
    let Some([metres, radians]) = apart(file, "Head", "motion/makehuman_walk1_24fps.json") else { return };
    assert!(metres < 2e-6 && radians < 1e-5, "{metres} m, {radians}");
}

#[test]
fn a_walk_in_gltf_is_where_others_find_it() {
    let Some(path) = shared_data("motion_src/CesiumMan.glb") else { return };
    let joint = "Skeleton_neck_joint_2";
    let Some([metres, radians]) = apart(Source::new(path), joint, "motion/cesiumman_walk_24fps.json") else {
        return;
    };
    assert!(metres < 2e-6 && radians < 1e-5, "{metres} m, {radians}");
}
