//! Whether Houdini can deform curves of a stage by the guides of a bake, and what carries them.

use super::motion::affine;
use super::source::{Owners, Set, nearest_root};
use crate::cache::ranges;
use crate::error::Diagnostic;
use crate::geometry::Shape;
use crate::scene::{Anim, Collider, Groom, OverPrim, OverTarget, SourceCurves};
use nalgebra::{Matrix4, Vector3};
use std::collections::BTreeSet;

/// Number of roots whose distance from a mesh is measured.
const ROOTS: usize = 100;

/// Largest change of the matrix from the space of curves to that of the guides, relative to its largest
/// entry, or to 1: rounding of their places in the world, up to 1e9 units from its origin.
const SAME_PLACE: f64 = 1e-6;

/// Why Houdini cannot deform the curves of a stage.
pub type Undeformable = Vec<Diagnostic>;

/// Curves to deform.
#[derive(Debug)]
pub(super) struct Deformed {
    /// The prim of the groom's source that they are; `None` for curves that were not imported.
    pub(super) imported: Option<usize>,
    /// Matrix from the space of the prim to rest space in metres, Y up.
    pub(super) to_rest: Matrix4<f64>,
    /// The collider that carries their roots.
    pub(super) skin: usize,
}

/// What is to be known of each prim of `target` to deform it; `matched` are the prims of the source that they
/// are.
///
/// # Errors
/// The errors of all prims that cannot be deformed.
pub(super) fn deformed(
    groom: &Groom,
    anim: &Anim,
    source: &SourceCurves,
    owners: &Owners,
    matched: &[Option<usize>],
    target: &OverTarget,
) -> std::result::Result<Vec<Deformed>, Undeformable> {
    if source.length.is_some() {
        return Err(vec![Diagnostic::new(
            &target.file,
            "--curves",
            "the strands were lengthened as they were imported, and Houdini does not lengthen curves",
            "curves as long as the strands",
            "import the groom without --length-scale and --length-variation, or bake with --curves both",
        )]);
    }
    let known: Vec<(usize, &OverPrim)> =
        matched.iter().zip(&target.prims).filter_map(|(of, prim)| Some(((*of)?, prim))).collect();
    let mut errors = Vec::new();
    let mut deformed = Vec::new();
    for (prim, &of) in target.prims.iter().zip(matched) {
        let to_rest = match of {
            Some(of) => Ok(source.prims[of].to_rest),
            None => rest_by_guides(source, &known, prim, target),
        };
        let found = to_rest.and_then(|to_rest| {
            let owners = of.map(|of| owners.of_prim(of));
            let skin = skin(groom, anim, owners, prim, &to_rest, target)?;
            Ok(Deformed { imported: of, to_rest, skin })
        });
        match found {
            Ok(found) => deformed.push(found),
            Err(found) => errors.extend(found),
        }
    }
    if errors.is_empty() { Ok(deformed) } else { Err(errors) }
}

/// Matrix to rest space from the space of curves that were not imported, by their place beside those that
/// were.
fn rest_by_guides(
    source: &SourceCurves,
    known: &[(usize, &OverPrim)],
    prim: &OverPrim,
    target: &OverTarget,
) -> std::result::Result<Matrix4<f64>, Undeformable> {
    let refused = |message: &str, help: &str| {
        let allowed = "curves placed by the same prims as the guides that the groom was imported from";
        Err(vec![Diagnostic::new(&target.file, &prim.path, message, allowed, help)])
    };
    let Some((of, guides)) = known.first() else {
        return refused(
            "the stage does not show the guides as well, which tell where the curves are at rest",
            "name a prim above both: --over FILE:/path/to/it",
        );
    };
    let place = |(guides, curves): (&[Matrix4<f64>; 3], &[Matrix4<f64>; 3])| {
        // The reader of the stage refuses matrices without inverse.
        guides[0].try_inverse().unwrap_or_else(Matrix4::identity) * curves[0]
    };
    let mut places = guides.to_world.iter().zip(&prim.to_world).map(place);
    // There are moments: those of the frames, handles included.
    let first = places.next().unwrap_or_else(Matrix4::identity);
    let tolerance = SAME_PLACE * first.amax().max(1.0);
    if places.any(|place| (place - first).amax() > tolerance) {
        return refused(
            &format!("the curves move against {}", guides.path),
            "place both below one prim that moves",
        );
    }
    Ok(source.prims[*of].to_rest * first)
}

/// The collider that carries the roots of curves. Those that were imported have `owners`.
fn skin(
    groom: &Groom,
    anim: &Anim,
    owners: Option<&[Option<(Set, usize)>]>,
    prim: &OverPrim,
    to_rest: &Matrix4<f64>,
    target: &OverTarget,
) -> std::result::Result<usize, Undeformable> {
    let roots = roots(prim, to_rest);
    let refused = |message: String, allowed: &str, help: &str| {
        Err(vec![Diagnostic::new(&target.file, &prim.path, message, allowed, help)])
    };
    if !anim.skins.is_empty() {
        let skin = |(c, root): (usize, &Vector3<f64>)| {
            let own = owners.and_then(|owners| {
                let (set, index) = owners[c]?;
                set.of_groom(groom).skin.get(index).cloned()
            });
            own.or_else(|| nearest_root(groom, root)).map(|root| root.collider)
        };
        let skins: BTreeSet<usize> = roots.iter().enumerate().filter_map(skin).collect();
        let names: Vec<&str> = skins.iter().map(|skin| anim.colliders[*skin].name.as_str()).collect();
        return match skins.first() {
            Some(skin) if skins.len() == 1 => Ok(*skin),
            _ => refused(
                format!("its roots ride on several skins ({}), and Houdini takes one", names.join(", ")),
                "curves on one skin",
                "split the prim by skins, join the skins to one mesh, or bake with --curves both",
            ),
        };
    }
    let some: Vec<&Vector3<f64>> = roots.iter().step_by(roots.len().div_ceil(ROOTS).max(1)).collect();
    let distance = |vertices: &[Vector3<f64>]| -> f64 {
        let each = some.iter().map(|root| nearest(vertices, root).map_or(f64::INFINITY, |(_, far)| far));
        each.sum()
    };
    let distances = head_meshes(anim).map(|(i, vertices)| (i, distance(vertices)));
    match distances.min_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((skin, _)) => Ok(skin),
        None => refused(
            "no mesh carries its roots: Houdini needs one that hair grows on".into(),
            "a skin, or a collider of the head that is a mesh and does not deform",
            "import the track with the mesh that the hair grows on (--collider, or --skin if it deforms), \
             or bake with --curves both",
        ),
    }
}

/// Why Houdini cannot deform the strands of a groom, whatever the stage is; `None` if it may.
pub fn never_deforms(groom: &Groom, anim: &Anim) -> Option<&'static str> {
    if groom.source.as_ref().is_some_and(|source| source.length.is_some()) {
        return Some("the strands were lengthened as they were imported");
    }
    let carried = !anim.skins.is_empty() || head_meshes(anim).next().is_some();
    (!carried).then_some("no mesh carries the hair, by which Houdini would deform it")
}

/// The colliders that ride with the head as roots do, every place of them, and their vertices, m.
fn head_meshes(anim: &Anim) -> impl Iterator<Item = (usize, &[Vector3<f64>])> {
    let rides = |c: &Collider| c.body == anim.head && c.deformation.is_none();
    anim.colliders.iter().enumerate().filter_map(move |(i, c)| match &c.shape {
        Shape::Mesh(mesh) if rides(c) => Some((i, &mesh.vertices[..])),
        _ => None,
    })
}

/// The first control point of each curve of a prim at rest, m.
pub(super) fn roots(prim: &OverPrim, to_rest: &Matrix4<f64>) -> Vec<Vector3<f64>> {
    ranges(prim.vertices.iter().copied())
        .map(|controls| affine(to_rest, &prim.points[controls.start]))
        .collect()
}

/// Index of the point nearest to `x`, and its distance.
pub(super) fn nearest(points: &[Vector3<f64>], x: &Vector3<f64>) -> Option<(usize, f64)> {
    let far = points.iter().map(|point| (point - x).norm_squared()).enumerate();
    far.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, far)| (i, far.sqrt()))
}
