//! Procedural grooms and head motions.
//!
//! [`groom`] makes one of several hair styles on a head, [`Motion`] moves the head and the bust that it turns
//! on, and [`write()`] writes both to a folder that can be baked. The head is a `solid`, meshed by
//! `surface_nets` and finer where `refinement` is needed; hair grows above the hairline of the `scalp`, where
//! a `comb` leads it, into a `tail` too, and comes together in `strands`. What tells styles apart is the
//! table in `style`. [`write_creature`] writes a furry creature that walks.

mod comb;
mod creature;
pub mod head;
mod motion;
mod refinement;
mod scalp;
mod solid;
mod strands;
mod style;
mod surface_nets;
mod tail;

use crate::file::write_file;
use crate::import::{BuildOptions, BuildReport, Generation, HierarchyShape, RenderStrands, Resample, build};
use crate::scene::anim::ends_file::TieFile;
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
    /// Number of render strands; `None` for that of the style.
    pub strands: Option<usize>,
    /// Subdivisions of the meshes of head and bust.
    pub head_subdivisions: usize,
}

impl Default for Size {
    fn default() -> Self {
        Size { wisps: None, strands: None, head_subdivisions: 4 }
    }
}

/// Fewest coarse wisps, which separate front, back, two sides and a parting.
const MIN_COARSE_WISPS: usize = 6;

/// Makes the groom of a style, m, Y up.
pub fn groom(style: Style, size: Size) -> (Groom, BuildReport) {
    let cut = style.cut();
    let wisps = size.wisps.unwrap_or(cut.wisps).max(1);
    let coarse = (cut.coarse * wisps).div_ceil(cut.wisps).max(MIN_COARSE_WISPS);
    let options = BuildOptions {
        guide_vertices: Resample::Vertices(cut.vertices[0]),
        generation: Generation { per_guide: 0, ..Generation::default() },
        hierarchy: HierarchyShape { levels: cut.levels, coarse: Some(coarse), leaves: Some(wisps) },
        sections: cut.sections,
        ..BuildOptions::default()
    };
    let hair = strands::guide_hair(&cut, wisps);
    let count = size.strands.unwrap_or(cut.strands);
    let strands = (count > 0)
        .then(|| RenderStrands { curves: strands::strands(&cut, count, &hair), clumps: vec![None; count] });
    let guides = strands::guides(&cut, &hair);
    build(&style.to_string(), Convention::default(), &guides, strands.as_ref(), None, &options)
}

/// The ties of a style.
fn ties(style: Style) -> Vec<TieFile> {
    let (at, radius) = tail::TIE;
    let tie = TieFile {
        name: "ponytail".into(),
        body: None,
        ids: None,
        group: None,
        within: None,
        at: Some(at.into()),
        radius,
        arc_m: None,
        arc_share: None,
        arc_by_distance: None,
        orientation: None,
        slides: false,
        releases: false,
        frames: None,
    };
    if matches!(style, Style::Ponytail | Style::Braid) { vec![tie] } else { Vec::new() }
}

/// Writes a sample to `folder`, which is created if necessary: `groom.json` with `groom.bin`, `head.obj`,
/// `bust.obj`, and an animation for each [`Motion`] (`shake.json`, …).
///
/// # Errors
/// [`Error::Io`].
pub fn write(style: Style, size: Size, folder: &Path) -> Result<BuildReport> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let (groom, report) = groom(style, size);
    groom.write(&folder.join("groom.json"))?;
    let meshes = [("head", head::mesh as fn(usize) -> _), ("bust", head::bust_mesh)];
    for (name, mesh) in meshes {
        let text = head::obj(name, &mesh(size.head_subdivisions));
        write_file(&folder.join(format!("{name}.obj")), &[text])?;
    }
    for motion in Motion::ALL {
        let mut anim = motion.anim();
        anim.ties = ties(style);
        anim.write(&folder.join(format!("{motion}.json")))?;
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
            let (groom, _) = groom(style, Size { wisps: Some(80), strands: Some(160), head_subdivisions: 3 });
            let curves = [&groom.guides.curves, &groom.strands.curves];
            assert_eq!(curves.map(|c| c.len()), [80, 160]);
            for points in curves.iter().flat_map(|c| (0..c.len()).map(|i| c.curve(i))) {
                assert!(head::height(points[0]).0.abs() < 1e-5, "{style}: {} off", head::height(points[0]).0);
                let deepest = points.iter().map(|&x| head::height(x).0).fold(0.0, f64::min);
                assert!(deepest > -0.002, "{style}: {deepest} m inside");
                // Below the brows.
                let on_face =
                    |x: &&Vector3<f64>| x.z > 0.08 && x.x.abs() < 0.035 && (0.0..0.13).contains(&x.y);
                assert_eq!(points.iter().find(on_face), None, "{style}");
            }
        }
    }

    #[test]
    fn a_style_has_its_number_of_nodes_and_levels() {
        let (groom, report) = groom(Style::Long, Size { strands: Some(0), ..Size::default() });
        let leaves: usize =
            groom.trees.iter().flat_map(|t| &t.wisps).filter(|w| !w.guides.is_empty()).count();
        assert_eq!(leaves * groom.trees[0].arc.len(), Style::Long.nodes());
        assert_eq!(report.levels.len(), 3);
        assert!(groom.strands.curves.is_empty());
    }

    #[test]
    fn a_written_sample_is_a_valid_scene() {
        let folder = tempfile::tempdir().unwrap();
        let size = Size { wisps: Some(40), strands: Some(200), head_subdivisions: 3 };
        write(Style::ShortCurly, size, folder.path()).unwrap();
        for motion in Motion::ALL {
            let anim = folder.path().join(format!("{motion}.json"));
            let (groom, anim) = crate::scene::load(&folder.path().join("groom.json"), &anim).unwrap();
            assert_eq!((groom.guides.curves.len(), groom.strands.curves.len()), (40, 200));
            assert_eq!(anim.colliders.len(), 2);
            let pose = anim.head_pose(anim.time(1001.0) + 0.5);
            let off = motion.head(0.5).inverse() * pose;
            assert!(off.translation.vector.norm() + off.rotation.angle() < 1e-4, "{motion}: {off}");
        }
    }

    #[test]
    fn strands_fall_where_guides_beside_them_do() {
        let (groom, _) =
            groom(Style::Long, Size { wisps: Some(300), strands: Some(1500), ..Size::default() });
        let (guides, strands) = (&groom.guides.curves, &groom.strands.curves);
        let ends = |curves: &crate::scene::Curves, i: usize| {
            let points = curves.curve(i);
            [points[0], points[points.len() - 1]]
        };
        let all: Vec<_> = (0..guides.len()).map(|g| ends(guides, g)).collect();
        for i in 0..strands.len() {
            let [root, tip] = ends(strands, i);
            let mut near: Vec<_> = all.iter().map(|[r, t]| ((r - root).norm(), (t - tip).norm())).collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            let away = near[..12].iter().map(|(_, away)| *away).fold(f64::INFINITY, f64::min);
            // Over a shoulder, the two sides are twice as far apart.
            assert!(away < 0.08, "strand {i} ends {away} m off the guides beside it");
        }
    }

    #[test]
    fn gathered_hair_passes_through_its_tie() {
        let size = Size { wisps: Some(60), strands: Some(200), head_subdivisions: 2 };
        for style in [Style::Ponytail, Style::Braid] {
            let (groom, _) = groom(style, size);
            let (at, radius) = tail::TIE;
            for curves in [&groom.guides.curves, &groom.strands.curves] {
                let far = |i: usize| crate::math::polyline::distance(&at, curves.curve(i)) > 1.5 * radius;
                let stray = (0..curves.len()).filter(|i| far(*i)).count();
                assert!(20 * stray <= curves.len(), "{style}: {stray} of {}", curves.len());
            }
            assert_eq!(ties(style).len(), 1);
        }
    }

    #[test]
    fn strands_of_a_braid_pass_across_each_other() {
        let size = Size { wisps: Some(120), strands: Some(0), head_subdivisions: 2 };
        let (groom, _) = groom(Style::Braid, size);
        let guides = &groom.guides.curves;
        // The order from left to right of the means of the three strands, at heights behind the neck.
        let at = |points: &[Vector3<f64>], height: f64| {
            let falls =
                |pair: &&[Vector3<f64>]| pair[0].y >= height && pair[1].y < height && pair[0].z < -0.11;
            points.windows(2).find(falls).map(|pair| pair[0].x)
        };
        let strand = |root: &Vector3<f64>| 1 + i8::from(root.x > 0.03) - i8::from(root.x < -0.03);
        let mut orders = Vec::new();
        for height in (0..40).map(|k| 0.10 - 0.005 * f64::from(k)) {
            let mut sums = [[0.0, 0.0]; 3];
            for points in (0..guides.len()).map(|g| guides.curve(g)) {
                if let Some(x) = at(points, height) {
                    let sum = &mut sums[strand(&points[0]) as usize];
                    *sum = [sum[0] + x, sum[1] + 1.0];
                }
            }
            let mut order = [0, 1, 2];
            order.sort_by(|a, b| (sums[*a][0] / sums[*a][1]).total_cmp(&(sums[*b][0] / sums[*b][1])));
            orders.push(order);
        }
        orders.dedup();
        assert!((12..17).contains(&orders.len()), "{orders:?}");
        // Neighbours change places, and all orders occur.
        let swap = |pair: &[[usize; 3]]| (0..3).filter(|k| pair[0][*k] != pair[1][*k]).count() == 2;
        assert!(orders.windows(2).all(swap), "{orders:?}");
        assert_eq!(orders.iter().collect::<std::collections::BTreeSet<_>>().len(), 6, "{orders:?}");
    }

    #[test]
    fn the_committed_sample_is_up_to_date() {
        let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples/short");
        let fresh = tempfile::tempdir().unwrap();
        let size = Size { wisps: Some(88), strands: Some(968), head_subdivisions: 4 };
        write(Style::Short, size, fresh.path()).unwrap();
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
