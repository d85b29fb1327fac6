//! Curves of a stage that Houdini deforms by the guides of a cache.
//!
//! What it takes at rest, guides, skin and the curves' own points, it takes as it stands: all in the space of
//! the curves' points. Each space of curves has its own copy of the guides' places at rest.

use super::deformable::{Deformed, nearest, roots};
use super::motion::affine;
use super::plan::{OverPlan, PlannedCurves};
use super::source::Set;
use super::stage::{rows, shot_stage, stage_record};
use crate::bake::cache_content::{CacheContent, weights_of};
use crate::bake::single::single;
use crate::cache::{
    DeformCurves, DeformHeader, DeformMethod, DeformPrimRecord, DeformRecord, DeformSpace, Header,
};
use crate::dynamics::guide_rods::GuideRods;
use crate::error::Result;
use crate::scene::{Anim, Groom, OverTarget};
use crate::strands::GuideWeights;
use nalgebra::{Matrix4, Vector3};
use rayon::prelude::*;
use std::path::Path;

/// Number of guides that Houdini finds near the root of each curve where it chooses them, at least.
const GUIDES_IN_RADIUS: usize = 3;

/// Factor on the distance of the last of [`GUIDES_IN_RADIUS`], beyond rounding to single precision.
const RADIUS_MARGIN: f64 = 1.001;

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
