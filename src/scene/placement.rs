//! Whether groom, head and colliders are given in one space: roots are compared with what they grow on.
//!
//! Hair grows on a skin, or near the bodies that it can touch. A groom, a rest pose and a mesh that come from
//! different stages may be off by the placement of a character in its shot; then no root is where it belongs.

use super::anim::{Anim, Collider};
use super::groom::Groom;
use super::origin::Origin;
use crate::error::Diagnostic;
use crate::geometry::{Shape, SolidMesh, TriMesh};
use nalgebra::{Point3, Vector3};
use std::fmt;
use std::path::Path;

/// Most roots that are compared.
const MAX_ROOTS: usize = 200;
/// Least distance from a skin beyond which roots are off it, m.
const OFF_SKIN: f64 = 0.02;
/// The same as a share of the diagonal of the roots' bounding box.
const OFF_SKIN_SHARE: f64 = 0.15;

/// The roots of a groom, rest space.
#[derive(Debug, Clone, PartialEq)]
pub struct Roots {
    /// Some of them, evenly chosen, m.
    points: Vec<Vector3<f64>>,
    /// Length of the longest strand, m.
    reach: f64,
}

/// Signed distances of the roots from a mesh, m; negative inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RootDistances {
    /// The median magnitude.
    pub median: f64,
    /// The largest median depth: positive if most roots are inside.
    pub depth: f64,
    /// The smallest magnitude.
    pub nearest: f64,
}

/// A mesh that hair may grow on, in rest space.
pub struct PlacedMesh<'a> {
    /// Name of the collider.
    pub name: &'a str,
    /// The mesh at rest.
    pub rest: &'a TriMesh,
    /// Its vertices in the first frame, taken back to rest space by the pose of the head; `None` if the head
    /// carries it.
    pub first: Option<Vec<Vector3<f64>>>,
}

/// Why roots and meshes cannot be in one space.
#[derive(Debug, Clone, PartialEq)]
pub struct Misplaced {
    /// Name of the collider.
    pub name: String,
    /// What is wrong.
    pub what: String,
}

impl Roots {
    /// Those of a groom.
    pub fn of(groom: &Groom) -> Self {
        let all: Vec<_> = groom.guides.curves.roots().collect();
        let step = all.len().div_ceil(MAX_ROOTS).max(1);
        Roots { points: all.into_iter().step_by(step).collect(), reach: groom.reach() }
    }

    /// Distance beyond which the median root is off a skin, m.
    pub fn tolerance(&self) -> f64 {
        let low = self.points.iter().fold(Vector3::repeat(f64::INFINITY), |a, p| a.inf(p));
        let high = self.points.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |a, p| a.sup(p));
        (OFF_SKIN_SHARE * (high - low).norm()).max(OFF_SKIN)
    }

    /// Their distances from a mesh.
    pub fn distances(&self, vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> RootDistances {
        let mesh = SolidMesh::new(vertices, triangles);
        let signed = self.points.iter().filter_map(|p| mesh.closest(p, f64::INFINITY)).map(|s| s.distance);
        let mut signed: Vec<f64> = signed.collect();
        signed.sort_by(f64::total_cmp);
        let mut sizes: Vec<f64> = signed.iter().map(|d| d.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let median = |sorted: &[f64]| sorted.get(sorted.len() / 2).copied().unwrap_or(f64::INFINITY);
        let depth = (-median(&signed)).max(0.0);
        RootDistances {
            median: median(&sizes),
            depth,
            nearest: sizes.first().copied().unwrap_or(f64::INFINITY),
        }
    }

    /// What cannot be right of these meshes together: none of them is where the hair is.
    pub fn check(&self, skins: &[PlacedMesh]) -> Option<Misplaced> {
        let tolerance = self.tolerance();
        let mut faults = Vec::new();
        for skin in skins {
            let rest = self.distances(&skin.rest.vertices, &skin.rest.triangles);
            let now = skin.first.as_ref().map_or(rest, |first| self.distances(first, &skin.rest.triangles));
            let metres = |d: f64| format!("{d:.2} m");
            let what = if rest.median <= tolerance && now.median > 2.0 * tolerance {
                format!(
                    "roots are on it at rest, and {} off it in the first frame: the rest pose of the head is not \
                     that of the mesh",
                    metres(now.median)
                )
            } else if now.depth > tolerance {
                format!("most roots are {} inside it", metres(now.depth))
            } else if now.nearest > self.reach {
                format!(
                    "the nearest root is {} away, and the longest strand {}: no hair can touch it",
                    metres(now.nearest),
                    metres(self.reach)
                )
            } else {
                return None;
            };
            faults.push(Misplaced { name: skin.name.into(), what });
        }
        faults.into_iter().next()
    }
}

/// The error of a groom and an animation, read from `file`, that cannot be in one space. There is none if a
/// collider is a primitive or moves on its own: it was placed on purpose, and the hair may belong to it.
pub fn check(groom: &Groom, anim: &Anim, file: &Path) -> Vec<Diagnostic> {
    let start = anim.time(anim.frames.0.into());
    let to_rest = anim.head_pose(start).inverse();
    let moved = |collider: &'_ Collider| {
        let pose = to_rest * anim.bodies[collider.body].track.pose(start);
        let vertices = collider.deformation.as_ref().map(|d| d.vertices(start));
        vertices.map(|all| all.into_iter().map(|x| (pose * Point3::from(x)).coords).collect())
    };
    let skins: Option<Vec<PlacedMesh>> = anim
        .colliders
        .iter()
        .enumerate()
        .map(|(i, collider)| match &collider.shape {
            // Its roots go with it.
            Shape::Mesh(rest) if anim.skins.contains(&i) => {
                Some(PlacedMesh { name: &collider.name, rest, first: None })
            }
            Shape::Mesh(rest) if collider.deformation.is_some() || collider.body == anim.head => {
                Some(PlacedMesh { name: &collider.name, rest, first: moved(collider) })
            }
            _ => None,
        })
        .collect();
    let Some(found) = skins.and_then(|skins| Roots::of(groom).check(&skins)) else { return Vec::new() };
    let head = &anim.bodies[anim.head];
    vec![found.diagnostic(file, groom.origin.as_ref(), head.origin.as_ref())]
}

impl Misplaced {
    /// The error in `file`, with the origins of groom and rest pose as the likely cause.
    pub fn diagnostic(&self, file: &Path, groom: Option<&Origin>, rest: Option<&Origin>) -> Diagnostic {
        let origin = |name: &str, origin: Option<&Origin>| {
            origin.map_or_else(String::new, |origin| format!("; the {name} is from {origin}"))
        };
        let message = format!("{}{}{}", self.what, origin("groom", groom), origin("rest pose", rest));
        Diagnostic::new(
            file,
            format!("colliders.{}", self.name),
            message,
            "groom, rest pose of the head and colliders in one space",
            "import the track with --groom, so that its rest pose is that of the groom's stage; import groom and head \
             from one asset; or move the groom with --offset",
        )
    }
}

impl fmt::Display for RootDistances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} mm in the median, {:.1} mm at least", self.median * 1e3, self.nearest * 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of 20 cm about the origin, moved by `x`.
    fn cube(x: f64) -> TriMesh {
        let corner = |i: usize, k: usize| if i >> k & 1 == 1 { 0.1 } else { -0.1 };
        let vertices = (0..8).map(|i| Vector3::new(corner(i, 0) + x, corner(i, 1), corner(i, 2))).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        TriMesh { vertices, triangles }
    }

    /// Roots on the upper face of the cube.
    fn roots() -> Roots {
        let place = |i: usize| 0.02 * (i as f64 - 4.0);
        let points = (0..81).map(|i| Vector3::new(place(i % 9), 0.1, place(i / 9))).collect();
        Roots { points, reach: 0.2 }
    }

    fn fault(rest: f64, first: Option<f64>) -> Option<String> {
        let (rest, first) = (cube(rest), first.map(|x| cube(x).vertices));
        roots().check(&[PlacedMesh { name: "head", rest: &rest, first }]).map(|found| found.what)
    }

    #[test]
    fn a_skin_where_the_roots_are_is_right() {
        assert_eq!(fault(0.0, None), None);
        assert_eq!(fault(0.0, Some(0.005)), None);
        // The mesh at rest of a sequence is that of its first frame.
        assert_eq!(fault(2.0, Some(0.005)), None);
        // Clothes below the head.
        assert_eq!(fault(0.25, None), None);
    }

    #[test]
    fn meshes_away_from_all_roots_are_wrong() {
        assert!(fault(2.0, None).unwrap().contains("no hair can touch it"));
        assert!(fault(2.0, Some(2.0)).unwrap().contains("no hair can touch it"));
        assert!(fault(0.0, Some(0.4)).unwrap().contains("in the first frame"));
        let (near, far) = (cube(0.0), cube(2.0));
        let skins = [near, far].map(|mesh| mesh);
        let both: Vec<PlacedMesh> =
            skins.iter().map(|rest| PlacedMesh { name: "x", rest, first: None }).collect();
        assert_eq!(roots().check(&both), None);
    }

    #[test]
    fn roots_deep_inside_are_wrong() {
        let mut deep = roots();
        deep.points.iter_mut().for_each(|p| p.y = 0.0);
        let rest = cube(0.0);
        let found = deep.check(&[PlacedMesh { name: "head", rest: &rest, first: None }]);
        assert!(found.unwrap().what.contains("inside"));
    }
}
