//! Procedural grooms and head motions.
//!
//! [`groom`] makes one of four hair styles on a simple head, [`Motion`] moves the head, and [`write()`]
//! writes both to a folder that can be baked. [`write_creature`] writes a furry creature that walks.

mod comb;
mod creature;
pub mod head;
mod motion;
mod style;

use crate::file::write_file;
use crate::import::{BuildOptions, BuildReport, Generation, HierarchyShape, Resample, Scalp, build};
use crate::scene::{Convention, Groom};
use crate::{Error, Result};
pub use creature::{FurSize, write_creature};
pub use motion::Motion;
use std::path::Path;
pub use style::Style;

/// Size of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Number of leaf wisps, with one guide each; `None` for that of the style ([`Style::nodes`]).
    pub wisps: Option<usize>,
    /// Number of render strands, rounded to a multiple of the wisps.
    pub strands: usize,
    /// Subdivisions of the head mesh.
    pub head_subdivisions: usize,
}

impl Default for Size {
    fn default() -> Self {
        Size { wisps: None, strands: 8000, head_subdivisions: 4 }
    }
}

/// Fewest coarse wisps, which separate front, back, two sides and a parting.
const MIN_COARSE_WISPS: usize = 6;

/// Makes the groom of a style, m, Y up.
pub fn groom(style: Style, size: Size) -> (Groom, BuildReport) {
    let cut = style.cut();
    let wisps = size.wisps.unwrap_or(cut.wisps).max(1);
    let guides = comb::guides(&cut, wisps);
    let coarse = (cut.coarse * wisps).div_ceil(cut.wisps).max(MIN_COARSE_WISPS);
    let options = BuildOptions {
        guide_vertices: Resample::Vertices(cut.vertices[0]),
        generation: Generation {
            per_guide: (size.strands as f64 / wisps as f64).round() as usize,
            vertices: Some(cut.vertices[1]),
            length_variation: 0.12,
            clump: 0.5,
        },
        hierarchy: HierarchyShape { levels: cut.levels, coarse: Some(coarse), leaves: Some(wisps) },
        sections: cut.sections,
        ..BuildOptions::default()
    };
    let scalp = Scalp::new(&head::mesh(size.head_subdivisions));
    build(&style.to_string(), Convention::default(), &guides, None, scalp.as_ref(), &options)
}

/// Writes a sample to `folder`, which is created if necessary: `groom.json` with `groom.bin`, `head.obj`, and
/// an animation per motion (`shake.json`, `turn.json`).
///
/// # Errors
/// [`Error::Io`].
pub fn write(style: Style, size: Size, folder: &Path) -> Result<BuildReport> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let (groom, report) = groom(style, size);
    groom.write(&folder.join("groom.json"))?;
    let head = folder.join("head.obj");
    write_file(&head, &[head::obj(&head::mesh(size.head_subdivisions))])?;
    for motion in Motion::ALL {
        motion.anim().write(&folder.join(format!("{motion}.json")))?;
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn hair_grows_on_the_scalp_outside_the_head_and_the_face() {
        for style in Style::ALL {
            let (groom, _) = groom(style, Size { wisps: Some(80), strands: 160, head_subdivisions: 3 });
            let guides = &groom.guides.curves;
            assert_eq!((guides.len(), groom.strands.curves.len()), (80, 160));
            for g in 0..guides.len() {
                let points = guides.curve(g);
                assert!(head::height(points[0]).0.abs() < 1e-6, "{style}: root of {g}");
                let deepest = points.iter().map(|&x| head::height(x).0).fold(0.0, f64::min);
                assert!(deepest > -0.002, "{style}: guide {g} {deepest} m inside");
                let on_face = |x: &&Vector3<f64>| x.z > 0.09 && x.x.abs() < 0.04 && x.y < 0.17;
                assert_eq!(points.iter().find(on_face), None, "{style}: guide {g}");
            }
        }
    }

    #[test]
    fn a_style_has_its_number_of_nodes_and_levels() {
        let (groom, report) =
            groom(Style::Long, Size { strands: 0, head_subdivisions: 1, ..Size::default() });
        let leaves: usize =
            groom.trees.iter().flat_map(|t| &t.wisps).filter(|w| !w.guides.is_empty()).count();
        assert_eq!(leaves * groom.trees[0].arc.len(), Style::Long.nodes());
        assert_eq!(report.levels.len(), 3);
        assert!(groom.strands.curves.is_empty());
    }

    #[test]
    fn a_written_sample_is_a_valid_scene() {
        let folder = tempfile::tempdir().unwrap();
        let size = Size { wisps: Some(40), strands: 200, head_subdivisions: 3 };
        write(Style::ShortCurly, size, folder.path()).unwrap();
        for motion in Motion::ALL {
            let anim = folder.path().join(format!("{motion}.json"));
            let (groom, anim) = crate::scene::load(&folder.path().join("groom.json"), &anim).unwrap();
            assert_eq!((groom.guides.curves.len(), groom.strands.curves.len()), (40, 200));
            assert_eq!(anim.colliders.len(), 3);
            let turned = anim.head_pose(anim.time(1001.0) + 0.5).rotation.scaled_axis().y;
            assert!((turned - motion.yaw(0.5)).abs() < 1e-4, "{turned}");
        }
    }

    #[test]
    fn the_committed_sample_is_up_to_date() {
        let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/short");
        let fresh = tempfile::tempdir().unwrap();
        write(Style::Short, Size { wisps: Some(88), strands: 970, head_subdivisions: 3 }, fresh.path())
            .unwrap();
        // The last digits of sines and powers depend on the math library.
        let same = |a: &[Vector3<f64>], b: &[Vector3<f64>]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).norm() < 1e-6)
        };
        for motion in Motion::ALL {
            let load = |folder: &Path| {
                crate::scene::load(&folder.join("groom.json"), &folder.join(format!("{motion}.json")))
                    .unwrap()
            };
            let ((groom, anim), (fresh_groom, fresh_anim)) = (load(&committed), load(fresh.path()));
            for (a, b) in [
                (&groom.guides.curves, &fresh_groom.guides.curves),
                (&groom.strands.curves, &fresh_groom.strands.curves),
            ] {
                assert!(same(&a.points, &b.points));
                assert_eq!((&a.offsets, &a.id, &a.group), (&b.offsets, &b.id, &b.group));
            }
            assert_eq!(groom.strands.leaf, fresh_groom.strands.leaf);
            assert_eq!(groom.materials, fresh_groom.materials);
            assert_eq!(groom.trees.len(), fresh_groom.trees.len());
            assert_eq!((anim.frames, anim.fps), (fresh_anim.frames, fresh_anim.fps));
            for (a, b) in anim.colliders.iter().zip(&fresh_anim.colliders) {
                assert!(same(&a.shape.tessellate().vertices, &b.shape.tessellate().vertices), "{}", a.name);
            }
            for frame in anim.frames.0..=anim.frames.1 {
                let pose = |anim: &crate::scene::Anim| anim.head_pose(anim.time(f64::from(frame)));
                let difference = pose(&anim).inverse() * pose(&fresh_anim);
                assert!(
                    difference.translation.vector.norm() + difference.rotation.angle() < 1e-6,
                    "{motion} {frame}"
                );
            }
        }
    }
}
