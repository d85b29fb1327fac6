//! The curves of a cache, and its header.

use super::single::single;
use crate::cache::{ClosestGuides, ColliderMesh, CurveSet, Header, HeldGuides};
use crate::contact::Body;
use crate::dynamics::guide_rods::GuideRods;
use crate::dynamics::tie;
use crate::geometry::Shape;
use crate::rod::{Rod, RodShape};
use crate::scene::anim::{OutputCurves, Resolution};
use crate::scene::{Anim, Collider, Curves, Groom, Strands, UpAxis};
use crate::strands::{GuideWeights, MAX_GUIDES, Membership, clumping, guide_weights, thin};
use crate::wisp::GuideRod;
use nalgebra::Vector3;
use std::borrow::Cow;

const _: () = assert!(MAX_GUIDES <= ClosestGuides::PER_STRAND, "the cache holds all guides of a strand");

/// The curves of a cache.
pub struct CacheContent<'a> {
    groom: &'a Groom,
    anim: &'a Anim,
    /// The guides as written, with their wisps and groups.
    pub rods: Vec<(&'a Rod, Membership)>,
    /// The ties of the guides, if reactions are written.
    held: Option<HeldGuides>,
    /// The render strands; empty if only guides are written.
    pub strands: Cow<'a, Strands>,
    /// Factor on the width of each group, where strands were thinned; else empty.
    width_factors: Vec<f64>,
    /// Guides of each strand, with weights.
    pub guide_weights: Vec<GuideWeights>,
}

impl<'a> CacheContent<'a> {
    /// The curves of a bake whose guides are simulated as `rods`.
    pub fn new(groom: &'a Groom, anim: &'a Anim, rods: &'a GuideRods) -> Self {
        let (strands, width_factors) = match (anim.settings.curves, anim.settings.keep) {
            (OutputCurves::Guides | OutputCurves::Steps, _) => {
                (Cow::Owned(groom.strands.select(&[])), Vec::new())
            }
            (_, keep) if keep < 1.0 => {
                let (left, width_factors) = thin(&groom.strands, keep);
                (Cow::Owned(left), width_factors)
            }
            _ => (Cow::Borrowed(&groom.strands), Vec::new()),
        };
        let home = |guide: &GuideRod| Membership {
            leaf: (guide.leaf.0 as u32, guide.leaf.1 as u32),
            group: groom.guides.curves.group[guide.guide],
        };
        let written = anim.settings.reactions && anim.settings.curves != OutputCurves::Strands;
        let held = written.then(|| held_guides(groom, anim, &rods.simulated));
        let rods: Vec<_> = rods.fine_and_simulated().map(|(rod, guide)| (rod, home(guide))).collect();
        let guide_weights = weights_of(groom, &strands, &rods);
        CacheContent { groom, anim, rods, held, strands, width_factors, guide_weights }
    }

    /// The header of the cache: everything that does not change over the bake.
    pub fn header(&self) -> Header {
        let (groom, anim, convention) = (self.groom, self.anim, self.groom.convention);
        let collider = |(i, c): (usize, &Collider)| {
            let mesh = c.shape.tessellate();
            let corners = |triangles: &[[u32; 3]]| triangles.iter().map(|t| t.map(|i| i as i32)).collect();
            ColliderMesh {
                name: c.name.clone(),
                points: mesh.vertices.iter().map(|v| single(&convention.length_out(*v))).collect(),
                triangles: corners(&mesh.triangles),
                caps: corners(Body::from(c).solid.caps()),
                deforms: c.deformation.is_some(),
                is_skin: anim.skins.contains(&i),
                is_plane: matches!(c.shape, Shape::Plane { .. }),
            }
        };
        let hair = || {
            let curves = &self.strands.curves;
            let set = curve_set(groom, curves, curves.points.clone(), (0, &self.width_factors));
            let main = self.guide_weights.iter().map(|weights| weights[0].0);
            CurveSet { loose: loose(&self.rods, main), closest: self.closest(), ..set }
        };
        Header {
            metres_per_unit: convention.metres_per_unit,
            z_up: convention.up == UpAxis::Z,
            fps: anim.fps,
            frames: anim.frames,
            hair: (!self.strands.curves.is_empty()).then(hair),
            guides: match anim.settings.curves {
                OutputCurves::Strands => CurveSet::default(),
                OutputCurves::Guides | OutputCurves::Steps | OutputCurves::Both => {
                    guide_set(groom, &self.rods)
                }
            },
            colliders: anim.colliders.iter().enumerate().map(collider).collect(),
            steps: anim.settings.curves == OutputCurves::Steps,
            levels: anim.resolution() != Resolution::Full,
            accelerations: anim.settings.accelerations,
            normals: anim.settings.normals && anim.settings.curves != OutputCurves::Strands,
            reactions: self.held.clone(),
            ..Header::default()
        }
    }

    /// Ids and weights of the guides of each strand.
    fn closest(&self) -> ClosestGuides {
        let id = &self.groom.guides.curves.id;
        // Missing entries repeat the first guide with weight 0.
        let entry =
            |f: &GuideWeights, i: usize| f.get(i).map_or((id[f[0].0], 0.0), |(g, w)| (id[*g], *w as f32));
        let each =
            self.guide_weights.iter().flat_map(|f| (0..ClosestGuides::PER_STRAND).map(move |i| entry(f, i)));
        let (guides, weights) = each.unzip();
        ClosestGuides { guides, weights }
    }
}

/// The guides that ties hold, guide after guide.
fn held_guides(groom: &Groom, anim: &Anim, rods: &[GuideRod]) -> HeldGuides {
    let mut held = HeldGuides::default();
    for (ties, rod) in tie::ties(groom, anim, rods).iter().zip(rods) {
        held.guide.extend(ties.iter().map(|_| groom.guides.curves.id[rod.guide]));
        held.number.extend(ties.iter().map(|tie| tie.of as i32));
    }
    held
}

/// Guides of each of some strands of `groom`, with weights; `rods` are all guides.
pub fn weights_of(groom: &Groom, strands: &Strands, rods: &[(&Rod, Membership)]) -> Vec<GuideWeights> {
    let homes = strands.leaf.iter().zip(&strands.curves.group);
    let homes: Vec<Membership> =
        homes.map(|(leaf, group)| Membership { leaf: *leaf, group: *group }).collect();
    let mut weights = guide_weights(&strands.curves, &homes, &clumping(groom), rods);
    weights.iter_mut().for_each(|weights| keep_held_alike(weights, rods));
    weights
}

/// Leaves a strand the guides that move with its first one: a guide whose root is free moves with no other.
fn keep_held_alike(weights: &mut GuideWeights, rods: &[(&Rod, Membership)]) {
    let is_free = |guide: usize| rods[guide].0.is_free();
    let Some(&(main, _)) = weights.first().filter(|_| weights.iter().any(|(guide, _)| is_free(*guide)))
    else {
        return;
    };
    weights.retain(|(guide, _)| *guide == main || !is_free(main) && !is_free(*guide));
    let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
    weights.iter_mut().for_each(|(_, weight)| *weight /= sum);
}

/// The guides as written: the points of the rods and the midpoints between them.
fn guide_set(groom: &Groom, rods: &[(&Rod, Membership)]) -> CurveSet {
    let mut curves = Curves { offsets: vec![0], points: Vec::new(), ..groom.guides.curves.clone() };
    let mut arc = Vec::new();
    for (rod, _) in rods {
        let mut shape = RodShape::default();
        shape.update(rod, &rod.root.r, &rod.initial_q);
        curves.points.extend(shape.refined_curve(rod, &rod.initial_q).map(|x| x + rod.root.p));
        arc.extend(rod.refined_arc().map(|s| (s / groom.convention.metres_per_unit) as f32));
        curves.offsets.push(curves.points.len());
    }
    let points = std::mem::take(&mut curves.points);
    CurveSet { arc, loose: loose(rods, 0..rods.len()), ..curve_set(groom, &curves, points, (1, &[])) }
}

/// Marks which of curves that follow these guides are [loose](CurveSet::loose).
fn loose(rods: &[(&Rod, Membership)], guides: impl Iterator<Item = usize>) -> Vec<i32> {
    let loose: Vec<i32> = guides.map(|guide| i32::from(rods[guide].0.is_free())).collect();
    if loose.contains(&1) { loose } else { Vec::new() }
}

/// `guide` is 1 for guides; `width_factors` scale the width of each group.
fn curve_set(
    groom: &Groom,
    curves: &Curves,
    points: Vec<Vector3<f64>>,
    (guide, width_factors): (i32, &[f64]),
) -> CurveSet {
    let out = &groom.convention;
    let mut widths = Vec::with_capacity(points.len());
    for (c, w) in curves.offsets.windows(2).enumerate() {
        let group = curves.group[c] as usize;
        let [root, tip] = groom.groups[group].width.map(|w| w * width_factors.get(group).unwrap_or(&1.0));
        let last = (w[1] - w[0] - 1).max(1) as f64;
        widths.extend((0..w[1] - w[0]).map(|k| {
            let u = k as f64 / last;
            ((root + (tip - root) * u) / out.metres_per_unit) as f32
        }));
    }
    CurveSet {
        counts: curves.offsets.windows(2).map(|w| (w[1] - w[0]) as i32).collect(),
        rest: points.iter().map(|p| single(&out.length_out(*p))).collect(),
        arc: Vec::new(),
        widths,
        id: curves.id.clone(),
        group: curves.group.iter().map(|g| *g as i32).collect(),
        group_name: curves.group.iter().map(|g| groom.groups[*g as usize].name.clone()).collect(),
        guide: vec![guide; curves.len()],
        root_uv: curves.root_uv.clone(),
        loose: Vec::new(),
        closest: ClosestGuides::default(),
    }
}
