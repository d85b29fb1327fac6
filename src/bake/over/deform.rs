//! Curves of a stage that Houdini deforms by the guides of a cache.
//!
//! What it takes at rest, guides, skin and the curves' own points, it takes as it stands: all in the space of
//! the curves' points. Each space of curves has its own copy of the guides' places at rest.

use super::motion::affine;
use super::plan::{OverPlan, PlannedCurves, Undeformable};
use super::source::{Owners, Set, nearest_root};
use super::stage::{rows, shot_stage, stage_record};
use crate::bake::cache_content::{CacheContent, weights_of};
use crate::bake::single::single;
use crate::cache::{
    DeformCurves, DeformHeader, DeformMethod, DeformPrimRecord, DeformRecord, DeformSpace, Header, ranges,
};
use crate::dynamics::guide_rods::GuideRods;
use crate::error::{Diagnostic, Result};
use crate::geometry::Shape;
use crate::scene::{Anim, Collider, Groom, OverPrim, OverTarget, SourceCurves};
use crate::strands::GuideWeights;
use nalgebra::{Matrix4, Vector3};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::Path;

/// Number of guides that Houdini finds near the root of each curve where it chooses them, at least.
const GUIDES_IN_RADIUS: usize = 3;

/// Factor on the distance of the last of [`GUIDES_IN_RADIUS`], beyond rounding to single precision.
const RADIUS_MARGIN: f64 = 1.001;

/// Number of roots whose distance from a mesh is measured.
const ROOTS: usize = 100;

/// Largest change of the matrix from the space of curves to that of the guides, relative to its largest
/// entry, or to 1: rounding of their places in the world, up to 1e9 units from its origin.
const SAME_PLACE: f64 = 1e-6;

/// Curves to deform.
#[derive(Debug)]
pub(super) struct Deformed {
    /// The prim of the groom's source that they are; `None` for curves that were not imported.
    imported: Option<usize>,
    /// Matrix from the space of the prim to rest space in metres, Y up.
    to_rest: Matrix4<f64>,
    /// The collider that carries their roots.
    skin: usize,
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
fn roots(prim: &OverPrim, to_rest: &Matrix4<f64>) -> Vec<Vector3<f64>> {
    ranges(prim.vertices.iter().copied())
        .map(|controls| affine(to_rest, &prim.points[controls.start]))
        .collect()
}

/// Index of the point nearest to `x`, and its distance.
fn nearest(points: &[Vector3<f64>], x: &Vector3<f64>) -> Option<(usize, f64)> {
    let far = points.iter().map(|point| (point - x).norm_squared()).enumerate();
    far.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, far)| (i, far.sqrt()))
}

/// The layer by which Houdini deforms curves by the guides of a cache with this `header`, and what the manifest
/// tells of it; `None` if the bake moves them itself.
///
/// # Errors
/// [`crate::Error::Io`] without a current folder.
pub fn deform(
    groom: &Groom,
    anim: &Anim,
    rods: &GuideRods,
    header: &Header,
    plan: &OverPlan,
    out: &Path,
) -> Result<Option<(DeformHeader, DeformRecord)>> {
    let OverPlan { target, owners, curves: PlannedCurves::Deformed(deformed) } = plan else {
        return Ok(None);
    };
    let weights = weights_of(groom, &groom.strands, &CacheContent::new(groom, anim, rods).rods);
    let (guide_points, guide_rest) = Set::Guides.curves(header, groom.convention);
    let guide_roots: Vec<Vector3<f64>> = guide_points.iter().map(|points| guide_rest[points.start]).collect();
    let skin_rest = |skin: usize| {
        let points = header.colliders[skin].points.iter();
        points.map(|p| groom.convention.length_in(p.map(f64::from).into())).collect::<Vec<_>>()
    };
    let mut spaces: Vec<(Matrix4<f64>, DeformSpace)> = Vec::new();
    let mut prims = Vec::new();
    for (prim, Deformed { imported, to_rest, skin }) in target.prims.iter().zip(deformed) {
        // The reader of the groom's source refuses matrices without inverse.
        let from_rest = to_rest.try_inverse().unwrap_or_else(Matrix4::identity);
        let at_rest =
            |points: &[Vector3<f64>]| points.iter().map(|p| single(&affine(&from_rest, p))).collect();
        let space = spaces.iter().position(|(other, _)| other == to_rest).unwrap_or_else(|| {
            let name = unused_name(&prim.path, spaces.iter().map(|(_, space)| space.name.as_str()));
            spaces.push((*to_rest, DeformSpace { name, guides: at_rest(&guide_rest), skins: Vec::new() }));
            spaces.len() - 1
        });
        let skins = &mut spaces[space].1.skins;
        if skins.iter().all(|(other, _)| other != skin) {
            skins.push((*skin, at_rest(&skin_rest(*skin))));
        }
        let roots = roots(prim, to_rest);
        let method = match imported {
            Some(of) => by_weights(owners.of_prim(*of), &weights, &roots, &guide_roots),
            None => DeformMethod::Shapes { radius: search_radius(&roots, &guide_roots, &from_rest) },
        };
        prims.push(DeformCurves {
            path: prim.path.clone(),
            space,
            skin: *skin,
            method,
            points: (!prim.shows_rest).then(|| prim.points.iter().map(single).collect()),
            without_accelerations: prim.accelerations,
            without_skeleton: prim.skinned,
        });
    }
    let conversion = target.convention.matrix_in().try_inverse().unwrap_or_else(Matrix4::identity)
        * groom.convention.matrix_in();
    let layer = DeformHeader {
        stage: shot_stage(target, out)?,
        from_cache: rows(&conversion),
        spaces: spaces.into_iter().map(|(_, space)| space).collect(),
        prims,
    };
    let record = record(&layer, deformed, header, target);
    Ok(Some((layer, record)))
}

/// Guides and weights of curves that were imported: those of the strands that they are; a guide itself; for
/// curves that were left out, the guide with the nearest root.
fn by_weights(
    owners: &[Option<(Set, usize)>],
    strands: &[GuideWeights],
    roots: &[Vector3<f64>],
    guide_roots: &[Vector3<f64>],
) -> DeformMethod {
    let of = |(owner, root): (&Option<(Set, usize)>, &Vector3<f64>)| match owner {
        Some((Set::Hair, strand)) => strands[*strand].iter().copied().filter(|(_, w)| *w > 0.0).collect(),
        Some((Set::Guides, guide)) => vec![(*guide, 1.0)],
        None => nearest(guide_roots, root).map(|(guide, _)| (guide, 1.0)).into_iter().collect(),
    };
    let each: Vec<GuideWeights> = owners.par_iter().zip(roots).map(of).collect();
    let all = || each.iter().flatten();
    DeformMethod::Weights {
        counts: each.iter().map(|guides| guides.len() as i32).collect(),
        guides: all().map(|(guide, _)| *guide as i32).collect(),
        weights: all().map(|(_, weight)| *weight as f32).collect(),
    }
}

/// The distance from every root within which there are [`GUIDES_IN_RADIUS`] guides, or all of them, in the
/// space of the curves.
fn search_radius(roots: &[Vector3<f64>], guide_roots: &[Vector3<f64>], from_rest: &Matrix4<f64>) -> f32 {
    let [roots, guides] =
        [roots, guide_roots].map(|all| all.iter().map(|x| affine(from_rest, x)).collect::<Vec<_>>());
    let last = GUIDES_IN_RADIUS.min(guides.len()).saturating_sub(1);
    let distance = |root: &Vector3<f64>| {
        let mut each: Vec<f64> = guides.iter().map(|guide| (guide - root).norm()).collect();
        each.select_nth_unstable_by(last, f64::total_cmp);
        each[last]
    };
    (roots.par_iter().map(distance).reduce(|| 0.0, f64::max) * RADIUS_MARGIN) as f32
}

/// The name of a prim that stands for the curves at `path`.
fn unused_name<'n>(path: &str, others: impl Iterator<Item = &'n str> + Clone) -> String {
    let stem = path.trim_start_matches('/').replace('/', "_");
    let mut names = std::iter::once(stem.clone()).chain((2..).map(|number| format!("{stem}_{number}")));
    names.find(|name| others.clone().all(|other| other != name)).unwrap_or(stem)
}

fn record(layer: &DeformHeader, deformed: &[Deformed], header: &Header, target: &OverTarget) -> DeformRecord {
    let prims = target.prims.iter().zip(deformed).zip(&layer.prims).map(|((prim, deformed), curves)| {
        DeformPrimRecord {
            path: prim.path.clone(),
            points: prim.points_name.clone(),
            time: prim.time,
            to_rest_m: rows(&deformed.to_rest),
            method: curves.method.name().into(),
            guides: layer.guides_path(curves),
            skin: layer.skin_path(curves, header),
        }
    });
    let (stage, metres_per_unit, up_axis) = stage_record(target);
    DeformRecord { stage, metres_per_unit, up_axis, prims: prims.collect() }
}
