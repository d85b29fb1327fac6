//! Binds the roots of a groom to the skins of an animation (`docs/theory.md` §2.1).

use super::anim::{Anim, Track};
use super::groom::{Curves, Groom};
use super::json::diagnostics::MAX_REPORTED;
use super::root_binding::RootBinding;
use super::track::PoseSamples;
use crate::error::Diagnostic;
use crate::geometry::{Deformation, Shape, Skin};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// Distance of a root from the skin from which on it is told, m: combed hair and beards are modelled as near.
const OFF_SKIN: f64 = 2e-3;

/// The same from which on it is refused, m.
const TOO_FAR: f64 = 0.02;

/// Share of its area at rest below which a skin has collapsed.
const COLLAPSED: f64 = 1e-3;

/// Most roots to which the reference frame is fitted.
const FITTED: usize = 200;

/// A collider that roots grow on.
struct LivingSkin<'a> {
    collider: usize,
    name: &'a str,
    skin: Skin,
    deformation: Option<&'a Deformation>,
}

/// Binds all roots of `groom` to the skins of `anim`, read from `file`, if it has any, and sets the frame of
/// reference that stands for the head. Returns what prevents it.
pub fn bind(groom: &mut Groom, anim: &mut Anim, file: &Path) -> Vec<Diagnostic> {
    if anim.skins.is_empty() {
        return Vec::new();
    }
    let mut bound = Vec::new();
    {
        let living = |&collider: &usize| {
            let c = &anim.colliders[collider];
            let Shape::Mesh(mesh) = &c.shape else { return None };
            let deformation = c.deformation.as_deref();
            Some(LivingSkin { collider, name: &c.name, skin: Skin::new(mesh, deformation), deformation })
        };
        let skins: Vec<LivingSkin> = anim.skins.iter().filter_map(living).collect();
        let mut diagnostics = Vec::new();
        for (what, curves) in [("guides", &groom.guides.curves), ("strands", &groom.strands.curves)] {
            match bind_curves(what, curves, &skins, anim.fps, file) {
                Ok(of_curves) => bound.push(of_curves),
                Err(found) => diagnostics.extend(found),
            }
        }
        if !diagnostics.is_empty() {
            return diagnostics;
        }
    }
    let distances: Vec<f64> = bound.iter().flat_map(|of| &of.distances).copied().collect();
    groom.notes.push(distances_in_words(distances));
    for (curves, Bound { bindings, .. }) in
        [&mut groom.guides.curves, &mut groom.strands.curves].into_iter().zip(bound)
    {
        curves.skin = bindings;
    }
    if anim.bodies[anim.head].track.span().is_none() {
        let reference = reference(anim, &groom.guides.curves.skin);
        for collider in &mut anim.colliders {
            let body = &anim.bodies[collider.body].track;
            let in_body = |t: f64| body.pose(t).inverse() * reference.pose(t);
            let carried =
                |d: Arc<Deformation>| Arc::new(Arc::unwrap_or_clone(d).carried_beyond_ends(in_body));
            collider.deformation = collider.deformation.take().map(carried);
        }
        anim.reference = Some(reference);
    }
    Vec::new()
}

/// Roots bound to skins, and their distances from these, m.
struct Bound {
    bindings: Vec<RootBinding>,
    distances: Vec<f64>,
}

/// Binds each root of `curves`, the groom's `what`, to the nearest of the `skins`.
fn bind_curves(
    what: &str,
    curves: &Curves,
    skins: &[LivingSkin],
    fps: f64,
    file: &Path,
) -> Result<Bound, Vec<Diagnostic>> {
    let roots: Vec<Vector3<f64>> = curves.roots().collect();
    let nearest = |x: &Vector3<f64>| {
        let (mut nearest, mut within) = (None, TOO_FAR);
        for skin in skins {
            if let Some((place, distance)) = skin.skin.bind(x, within) {
                (nearest, within) = (Some((skin, place, distance)), distance);
            }
        }
        nearest
    };
    let found: Vec<_> = roots.par_iter().map(nearest).collect();
    let far: Vec<usize> = (0..roots.len()).filter(|c| found[*c].is_none()).collect();
    if !far.is_empty() {
        return Err(vec![too_far(what, curves, &far, &roots, skins, file)]);
    }
    let found: Vec<_> = found.into_iter().flatten().collect();
    let collapsed: Vec<(usize, usize)> = found
        .par_iter()
        .enumerate()
        .filter_map(|(c, (skin, place, _))| {
            let samples = &skin.deformation?.samples;
            let ratio = |k: &usize| place.area_ratio(|v| samples[*k][v as usize]);
            (0..samples.len()).find(|k| ratio(k) <= COLLAPSED).map(|k| (c, k))
        })
        .collect();
    if !collapsed.is_empty() {
        let (all, shown) = (collapsed.len(), collapsed.into_iter().take(MAX_REPORTED));
        let message = |(c, k): (usize, usize)| {
            let LivingSkin { name, deformation, .. } = found[c].0;
            let frame = deformation.map_or(0.0, |d| (d.start + k as f64 / d.rate) * fps);
            let id = curves.id[c];
            Diagnostic::new(
                file,
                format!("colliders.{name}"),
                format!(
                    "the skin around the root of id {id} of the {what} (of {all} such roots) has no area at \
                     frame {frame:.0}"
                ),
                "a skin that keeps its area around each root",
                "correct the animation of the mesh there, or remove these curves",
            )
        };
        return Err(shown.map(message).collect());
    }
    let (bindings, distances) = found
        .into_iter()
        .map(|(skin, place, distance)| (RootBinding { collider: skin.collider, place }, distance))
        .unzip();
    Ok(Bound { bindings, distances })
}

/// The error of the roots `far` of `curves`.
fn too_far(
    what: &str,
    curves: &Curves,
    far: &[usize],
    roots: &[Vector3<f64>],
    skins: &[LivingSkin],
    file: &Path,
) -> Diagnostic {
    let distance = |c: &usize| {
        let on = skins.iter().filter_map(|s| Some(s.skin.bind(&roots[*c], f64::INFINITY)?.1));
        on.fold(f64::INFINITY, f64::min)
    };
    // Finding the distance is slow far away.
    let shown: Vec<String> = far
        .iter()
        .take(MAX_REPORTED)
        .map(|c| format!("id {}: {:.3} m", curves.id[*c], distance(c)))
        .collect();
    let names: Vec<&str> = skins.iter().map(|s| s.name).collect();
    Diagnostic::new(
        file,
        "skins",
        format!(
            "{} of the {} roots of the {what} are {TOO_FAR} m or more from the skin {} at rest ({})",
            far.len(),
            roots.len(),
            names.join(", "),
            shown.join(", ")
        ),
        format!("roots within {TOO_FAR} m of a skin at rest"),
        "give groom and skin in one rest space, with the mesh that the hair was drawn on; name all meshes that hair \
         grows on; or remove these curves",
    )
}

/// A remark on how far roots are from the skin, m, with a warning if some are off it.
fn distances_in_words(mut distances: Vec<f64>) -> String {
    distances.sort_by(f64::total_cmp);
    let (roots, off) = (distances.len(), distances.iter().filter(|d| **d > OFF_SKIN).count());
    let [median, most] =
        [roots / 2, roots.saturating_sub(1)].map(|i| distances.get(i).map_or(0.0, |d| d * 1e3));
    let mut words =
        format!("{roots} roots ride on the skin, {median:.2} mm from it in the median, {most:.2} mm at most");
    if off > 0 {
        words += &format!("; {off} of them are more than {} mm off it", OFF_SKIN * 1e3);
        tracing::warn!("{words}");
    }
    words
}

/// The frame of reference of roots with the bindings `roots`: a track through the rigid motions that fit them
/// best at the samples of the first skin that deforms, or that of the body of a rigid skin.
fn reference(anim: &Anim, roots: &[RootBinding]) -> Track {
    let skins = || anim.skins.iter().map(|skin| &anim.colliders[*skin]);
    let Some(times) = skins().find_map(|skin| skin.deformation.as_ref()) else {
        return anim.bodies[anim.colliders[anim.skins[0]].body].track.clone();
    };
    let fitted: Vec<_> = roots.iter().step_by(roots.len().div_ceil(FITTED).max(1)).collect();
    let at = |sample: usize| {
        let t = times.start + sample as f64 / times.rate;
        let carried: Vec<_> = fitted.iter().map(|root| (root.place.rest(), anim.carried(root, t))).collect();
        mean_motion(&carried)
    };
    let samples = PoseSamples {
        start: times.start,
        rate: times.rate,
        poses: (0..times.samples.len()).into_par_iter().map(at).collect(),
        bridged: Vec::new(),
    };
    match samples.poses[..] {
        [only] => Track::fixed(only),
        _ => Track::through(&samples, 0.0, &Isometry3::identity()),
    }
}

/// The rigid motion with the mean rotation of the given ones that takes the mean of their points at rest
/// where they take it.
fn mean_motion(carried: &[(&Vector3<f64>, Isometry3<f64>)]) -> Isometry3<f64> {
    let Some((_, first)) = carried.first() else { return Isometry3::identity() };
    let mut rotation = Quaternion::identity() * 0.0;
    let (mut rest, mut now) = (Vector3::zeros(), Vector3::zeros());
    for (x, motion) in carried {
        let q = motion.rotation.into_inner();
        rotation += if q.dot(first.rotation.as_ref()) < 0.0 { -q } else { q };
        rest += *x;
        now += (motion * Point3::from(**x)).coords;
    }
    let rotation = UnitQuaternion::from_quaternion(rotation);
    let n = carried.len() as f64;
    Isometry3::from_parts(Translation3::from(now / n - rotation * (rest / n)), rotation)
}
