//! A furry creature on four legs that walks.

mod body;
mod walk;

use super::motion::FPS;
use crate::file::write_file;
use crate::geometry::{SolidMesh, TriMesh};
use crate::import::{FurShape, GrowOptions, GrowReport, Source, StrandCount, grow};
use crate::scene::anim::file::{BodyFile, ColliderFile, ShapeFile};
use crate::scene::{AnimFile, FileSequence, UpAxis};
use crate::{Error, Result};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::fmt::Write;
use std::path::Path;
use walk::Walker;

/// First and last frame of the bake.
const FRAMES: [i32; 2] = [1001, 1048];
/// Frames written before and after these: the pre-roll reads them, and slopes at the ends.
const HANDLES: [i32; 2] = [27, 2];
/// Length of the longest fur, m.
const FUR: f64 = 0.035;
/// Distance kept between body and fur, m.
const THICKNESS: f64 = 5e-4;
/// Poses of a stride in which fur is to have room.
const POSES: usize = 12;
/// Height in which there is to be room, as a multiple of the length of the fur.
const MARGIN: f64 = 1.4;
/// Distance from the skin that the middle of a ball at that height keeps, as a share of the height.
const ROOM: f64 = 0.85;
/// Least length of fur, as a share of the longest; where there is no room for it, there is no fur.
const LEAST_SHARE: f64 = 0.3;
/// Rings of vertices over which short fur shortens what is around it.
const SPREAD: usize = 4;
/// Decimal places of positions, m.
const DIGITS: usize = 6;

/// Size of the creature's fur.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FurSize {
    /// Number of guides.
    pub guides: usize,
    /// Number of strands.
    pub strands: usize,
}

impl Default for FurSize {
    fn default() -> Self {
        FurSize { guides: 600, strands: 30_000 }
    }
}

/// Writes the creature to `folder`, which is created if necessary: `groom.json` with `groom.bin`, its mesh
/// `creature.obj`, one mesh for each frame of its walk, and the animation `walk.json`.
///
/// # Errors
/// [`Error::Io`].
pub fn write_creature(size: FurSize, folder: &Path) -> Result<GrowReport> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let limbs = body::limbs();
    let (skin, mut fur) = body::skin(&limbs);
    let walker = Walker::new(skin.vertices.clone(), &limbs);
    leave_room(&mut fur, &skin, &walker);
    let file = folder.join("creature.obj");
    write_file(&file, &[painted_obj(&skin, &fur, &density(&fur, &skin.triangles))])?;
    let pattern = "creature.####.obj";
    let sequence = FileSequence::new(pattern).ok_or_else(|| Error::Internal("no sequence".into()))?;
    for frame in FRAMES[0] - HANDLES[0]..=FRAMES[1] + HANDLES[1] {
        let vertices = walker.vertices(f64::from(frame - FRAMES[0]) / FPS);
        let posed = TriMesh { vertices, triangles: skin.triangles.clone() };
        write_file(&sequence.path(folder, frame), &[posed.to_obj(DIGITS)])?;
    }
    animation(pattern).write(&folder.join("walk.json"))?;
    let mesh = Source { metres_per_unit: Some(1.0), up: Some(UpAxis::Y), ..Source::new(file) };
    let options = GrowOptions {
        guides: size.guides,
        strands: StrandCount::Number(size.strands),
        folder: folder.to_path_buf(),
        density_field: Some("color.g".into()),
        shape: FurShape { length: Some(FUR), length_field: Some("color".into()), ..FurShape::default() },
        ..GrowOptions::new(mesh)
    };
    let (groom, report) = grow(&options)?;
    groom.write(&folder.join("groom.json"))?;
    Ok(report)
}

/// Shortens fur, lengths at vertices as shares of [`FUR`], to what the skin leaves room for at rest and through
/// a stride: in the groins and between the legs other parts of it are near, or it folds.
fn leave_room(fur: &mut [f64], skin: &TriMesh, walker: &Walker) {
    let rest = std::iter::once(skin.vertices.clone());
    let poses: Vec<Vec<Vector3<f64>>> =
        rest.chain((0..POSES).map(|k| walker.vertices(k as f64 / POSES as f64))).collect();
    let solids: Vec<SolidMesh> = poses.iter().map(|pose| SolidMesh::new(pose, &skin.triangles)).collect();
    let normals: Vec<Vec<Vector3<f64>>> = poses.iter().map(|pose| normals(pose, &skin.triangles)).collect();
    let free = |v: usize, share: f64| {
        let height = MARGIN * share * FUR;
        (0..poses.len()).all(|k| {
            let x = poses[k][v] + normals[k][v] * height;
            // A ball that rests on the skin, with some slack for its curvature.
            solids[k].closest(&x, height).is_none_or(|nearest| nearest.distance > ROOM * height)
        })
    };
    fur.par_iter_mut().enumerate().for_each(|(v, share)| {
        while *share > 0.0 && !free(v, *share) {
            *share = if *share > LEAST_SHARE { (0.8 * *share).max(LEAST_SHARE) } else { 0.0 };
        }
    });
    // The shortest around a vertex, so that no strand leans into a place without room.
    for _ in 0..SPREAD {
        let before = fur.to_vec();
        for t in &skin.triangles {
            let least = t.iter().map(|v| before[*v as usize]).fold(1.0, f64::min);
            let most = (1.25 * least).max(LEAST_SHARE);
            t.iter().for_each(|v| fur[*v as usize] = fur[*v as usize].min(most));
        }
    }
}

/// Unit normals at the vertices of a mesh, by the areas of the triangles around them.
fn normals(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); vertices.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        t.iter().for_each(|v| normals[*v as usize] += (b - a).cross(&(c - a)));
    }
    normals.iter().map(|n| n.try_normalize(0.0).unwrap_or_else(Vector3::y)).collect()
}

/// Density of the fur at the vertices: its length as a share, and 0 next to bare skin, so that no strand is shorter
/// than fur may be.
fn density(fur: &[f64], triangles: &[[u32; 3]]) -> Vec<f64> {
    let mut density = fur.to_vec();
    for t in triangles.iter().filter(|t| t.iter().any(|v| fur[*v as usize] == 0.0)) {
        t.iter().for_each(|v| density[*v as usize] = 0.0);
    }
    density
}

/// The mesh as Wavefront OBJ. The red of its vertex colours is the length of the fur, the green its density.
fn painted_obj(mesh: &TriMesh, fur: &[f64], density: &[f64]) -> String {
    let mut out =
        String::from("# creature of a hairbake sample, metres, Y up; fur, red: length, green: density\n");
    let mut paint = fur.iter().zip(density);
    for line in mesh.to_obj(DIGITS).lines() {
        // Writing to a string does not fail.
        let _ = match paint.next() {
            Some((length, density)) => writeln!(out, "{line} {length:.3} {density:.3} 0"),
            None => writeln!(out, "{line}"),
        };
    }
    out
}

/// The walk: a skin that deforms, and nothing else.
fn animation(sequence: &str) -> AnimFile {
    let mut anim = AnimFile::new(FPS, FRAMES);
    anim.bodies = vec![BodyFile { name: "world".into(), track: None }];
    anim.colliders = vec![ColliderFile {
        name: "creature".into(),
        body: None,
        shape: ShapeFile::Mesh {
            file: "creature.obj".into(),
            sequence: Some(sequence.into()),
            metres_per_unit: None,
            up_axis: None,
        },
        friction: None,
        static_friction: None,
        thickness_m: THICKNESS,
    }];
    anim.skins = vec!["creature".into()];
    anim
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use std::sync::OnceLock;

    /// The volume that a closed mesh encloses, m³; every edge is used once in each direction.
    fn volume(mesh: &TriMesh) -> f64 {
        let mut edges: BTreeMap<[u32; 2], [usize; 2]> = BTreeMap::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                edges.entry([a.min(b), a.max(b)]).or_default()[usize::from(a < b)] += 1;
            }
        }
        assert!(edges.values().all(|uses| *uses == [1, 1]));
        // One piece without holes through it (Euler).
        assert_eq!(mesh.vertices.len() + mesh.triangles.len(), edges.len() + 2);
        let corners = mesh.triangles.iter().map(|t| t.map(|i| mesh.vertices[i as usize]));
        corners.map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum()
    }

    /// The limbs, the skin and the lengths of its fur, made once.
    fn creature() -> &'static (Vec<body::Limb>, TriMesh, Vec<f64>) {
        static CREATURE: OnceLock<(Vec<body::Limb>, TriMesh, Vec<f64>)> = OnceLock::new();
        CREATURE.get_or_init(|| {
            let limbs = body::limbs();
            let (skin, fur) = body::skin(&limbs);
            (limbs, skin, fur)
        })
    }

    #[test]
    fn the_creature_is_watertight_and_symmetric_at_rest_and_walking() {
        let (limbs, skin, fur) = creature();
        assert!((2000..10_000).contains(&skin.triangles.len()), "{} triangles", skin.triangles.len());
        let at_rest = volume(skin);
        // The volume of a big dog.
        assert!((0.05..0.09).contains(&at_rest), "{at_rest} m³");
        assert!(fur.iter().all(|length| (0.2..=1.0).contains(length)));
        let solid = SolidMesh::new(&skin.vertices, &skin.triangles);
        let mirrored = |x: &Vector3<f64>| Vector3::new(-x.x, x.y, x.z);
        let off = |x: &Vector3<f64>| solid.closest(&mirrored(x), 1.0).unwrap().distance.abs();
        let most = skin.vertices.iter().map(off).fold(0.0, f64::max);
        // The diagonals of cells are not mirrored.
        assert!(most < 8e-3, "{most} m");
        let lowest = skin.vertices.iter().map(|x| x.y).fold(f64::INFINITY, f64::min);
        assert!(lowest.abs() < 0.01, "{lowest} m above the ground");
        let walker = Walker::new(skin.vertices.clone(), limbs);
        for quarter in 0..4 {
            let vertices = walker.vertices(0.25 * f64::from(quarter));
            let walking = volume(&TriMesh { vertices, triangles: skin.triangles.clone() });
            assert!((walking / at_rest - 1.0).abs() < 0.05, "{walking} m³");
        }
    }

    #[test]
    fn fur_is_as_long_as_there_is_room_for_it() {
        let (limbs, skin, fur) = creature();
        let walker = Walker::new(skin.vertices.clone(), limbs);
        let mut shares = fur.clone();
        leave_room(&mut shares, skin, &walker);
        assert!(shares.iter().zip(fur).all(|(share, most)| share <= most));
        assert!(
            shares
                .iter()
                .zip(fur)
                .all(|(share, painted)| [0.0, *painted].contains(share) || *share >= LEAST_SHARE)
        );
        let bald = shares.iter().filter(|share| **share == 0.0).count();
        assert!(bald > 0 && bald < shares.len() / 5, "{bald} of {}", shares.len());
        // Strands that stand upright are outside in all poses.
        for pose in [0.2, 0.45, 0.7] {
            let vertices = walker.vertices(pose);
            let (solid, normals) =
                (SolidMesh::new(&vertices, &skin.triangles), normals(&vertices, &skin.triangles));
            for v in (0..shares.len()).filter(|v| shares[*v] > 0.0).step_by(5) {
                let tip = vertices[v] + normals[v] * (shares[v] * FUR);
                let height = solid.closest(&tip, 1.0).unwrap().distance;
                assert!(height > 0.0, "the tip at vertex {v} is {height} m high at {pose} s");
            }
        }
    }

    #[test]
    fn paws_on_the_ground_stay_where_they_are() {
        let (limbs, skin, _) = creature();
        let walker = Walker::new(skin.vertices.clone(), limbs);
        // The lowest vertex of the left hind paw, which is set down at the start of the stride.
        let paw = (0..skin.vertices.len())
            .filter(|v| skin.vertices[*v].x > 0.0 && skin.vertices[*v].z < 0.0)
            .min_by(|a, b| skin.vertices[*a].y.total_cmp(&skin.vertices[*b].y))
            .unwrap();
        let places: Vec<_> = (0..=24).map(|k| walker.vertices(f64::from(k) / 24.0)[paw]).collect();
        assert!(places[..9].iter().all(|x| (x - places[0]).norm() < 2e-3), "{places:?}");
        assert!((places[24] - places[0] - Vector3::z() * 0.5).norm() < 1e-9, "a stride is half a metre");
        assert!(places.iter().map(|x| x.y).fold(0.0, f64::max) > 0.04, "the paw is lifted");
    }
}
