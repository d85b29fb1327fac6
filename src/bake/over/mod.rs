//! Over mode: the motion of the baked strands, put over the curves that the groom was imported from, in the
//! basis, order and space that these have in a stage.
//!
//! Each strand is a curve of the stage, sampled. What is solved for is not the curve but how far it is from
//! the groom's pose carried with its root, by the head or a skin: control points come back to the last bit
//! where nothing moves, and a curve that no strand was baked of rides with the head, or on a skin with the
//! nearest root.
//!
//! A bake of guides alone has no strands to put over the curves: Houdini deforms these by the guides
//! ([`deform()`]).

mod deform;
mod deformable;
mod matching;
mod motion;
mod plan;
mod record;
mod source;
mod stage;

pub use deform::deform;
pub use deformable::{Undeformable, never_deforms};
pub use plan::{OverPlan, moves_all};
pub use record::record;

use super::single::{extent, single};
use crate::Result;
use crate::cache::{CurveFrame, Frame, Header, OverCurveFrame, OverCurves, OverFrame, OverHeader, ranges};
use crate::math::basis_curve::{Basis, CurveFit, CurveType, Row, Wrap};
use crate::scene::{Anim, Convention, Groom, OverPrim, OverTarget, RootBinding};
use motion::{Carrier, Motion, Placement, linear, parts};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use plan::PlannedCurves;
use rayon::prelude::*;
use source::{Fits, Set, nearest_root, rest_controls};
use stage::shot_stage;
use std::ops::Range;
use std::path::Path;

/// Arc-length fractions closer than this are one place: files hold points in single precision, which moves
/// the fraction of a point by up to some 1e-6; the points of a strand are a hundred times farther apart.
const SAME_PLACE: f64 = 1e-5;

/// The curves that a bake overrides, ready for any frame.
pub struct Over {
    /// Unit and axis of the arrays of the cache.
    convention: Convention,
    target_convention: Convention,
    first_frame: i32,
    /// For each moment of a frame, the frames from one matrix of a placement to the next.
    sides: Vec<f64>,
    fps: f64,
    fits: Vec<CurveFit>,
    prims: Vec<PrimOver>,
    header: OverHeader,
}

/// The curves of one prim.
struct PrimOver {
    prim: OverPrim,
    /// Control points in the groom's pose, m, rest space.
    rest: Vec<Vector3<f64>>,
    /// Turns directions in the space of the prim to rest space.
    turn: Matrix3<f64>,
    curves: Vec<CurveOver>,
}

/// One curve.
struct CurveOver {
    /// Its control points in the prim.
    controls: Range<usize>,
    /// Index of its fit.
    fit: usize,
    /// What it moves as.
    baked: Option<Baked>,
    /// The place of a skin that carries its root; `None` if the head does.
    root: Option<RootBinding>,
}

/// The curve of the cache that a curve moves as.
struct Baked {
    set: Set,
    /// Its points among those of the set.
    points: Range<usize>,
    /// The points in the groom's pose, m, rest space.
    rest: Vec<Vector3<f64>>,
    /// Its samples as weights of these points; `None` if they are the points.
    places: Option<Vec<Row>>,
}

impl Over {
    /// Over mode of a bake of `groom` with this `header` into the folder `out`; `None` if it leaves the curves
    /// to Houdini.
    ///
    /// # Errors
    /// [`crate::Error::Io`] without a current folder.
    pub fn planned(
        groom: &Groom,
        anim: &Anim,
        header: &Header,
        plan: &OverPlan,
        out: &Path,
    ) -> Result<Option<Self>> {
        let (OverPlan { target, owners, curves: PlannedCurves::Moved(matched) }, Some(source)) =
            (plan, &groom.source)
        else {
            return Ok(None);
        };
        let mut fits = Fits::default();
        let sets = Set::ALL.map(|set| set.curves(header, groom.convention));
        let prims = target.prims.iter().zip(matched).map(|(prim, of)| {
            let rest = rest_controls(source, *of, prim, &mut fits);
            let owned = ranges(prim.vertices.iter().copied()).zip(owners.of_prim(*of));
            let curves = owned.map(|(controls, owner)| {
                let fit = fits.index(prim.curve, controls.len());
                let baked = owner.and_then(|(set, index)| {
                    let (ranges, points) = &sets[set as usize];
                    let range = ranges.get(index)?.clone();
                    let samples = fits.all[fit].samples.iter().map(|row| row.of(&rest[controls.clone()]));
                    let places = places(&samples.collect::<Vec<_>>(), &points[range.clone()]);
                    Some(Baked { set, rest: points[range.clone()].to_vec(), points: range, places })
                });
                let own = owner.and_then(|(set, index)| set.of_groom(groom).skin.get(index).cloned());
                let root = own.or_else(|| nearest_root(groom, &rest[controls.start]));
                CurveOver { controls, fit, baked, root }
            });
            let curves = curves.collect();
            PrimOver { prim: prim.clone(), turn: linear(&source.prims[*of].to_rest), curves, rest }
        });
        let prims = prims.collect();
        Ok(Some(Over {
            convention: groom.convention,
            target_convention: target.convention,
            first_frame: target.first_frame,
            sides: target.sides.clone(),
            fps: anim.fps,
            fits: fits.all,
            prims,
            header: over_header(target, anim.settings.accelerations, out)?,
        }))
    }

    /// What does not change in the layers.
    pub fn header(&self) -> &OverHeader {
        &self.header
    }

    /// The overs of a frame with its moments.
    pub fn frame(&self, anim: &Anim, moments: &[Frame]) -> Vec<OverFrame> {
        let over = |(k, moment): (usize, &Frame)| {
            let t = anim.time(f64::from(moment.frame) + moment.offset);
            let head = Carrier::at(anim, None, t);
            let index = moment.frame.abs_diff(self.first_frame) as usize * self.sides.len() + k;
            let step = self.sides[k] / self.fps;
            let prims = self.prims.iter().map(|prim| {
                let placement = Placement::new(&self.target_convention, prim.prim.to_world[index], step);
                let own =
                    |curve: &CurveOver| curve.root.as_ref().map(|root| Carrier::at(anim, Some(root), t));
                let own: Vec<Option<Carrier>> = prim.curves.par_iter().map(own).collect();
                self.prim(prim, moment, &Carriers { head: &head, own }, &placement)
            });
            OverFrame { frame: moment.frame, offset: moment.offset, prims: prims.collect() }
        };
        moments.iter().enumerate().map(over).collect()
    }

    fn prim(
        &self,
        over: &PrimOver,
        moment: &Frame,
        carriers: &Carriers,
        placement: &Placement,
    ) -> OverCurveFrame {
        let curve = |(c, curve): (usize, &CurveOver)| {
            self.curve(&over.rest[curve.controls.clone()], curve, moment, carriers.of(c))
        };
        let world: Vec<Motion> = over.curves.par_iter().enumerate().flat_map_iter(curve).collect();
        let local: Vec<[Vector3<f64>; 3]> = world.par_iter().map(|motion| placement.local(motion)).collect();
        let of = |i: usize| local.iter().map(|motion| single(&motion[i])).collect::<Vec<_>>();
        let points = of(0);
        OverCurveFrame {
            extent: extent(&points, &vec![over.prim.width as f32; points.len()]),
            points,
            velocities: of(1),
            accelerations: self.header.accelerations.then(|| of(2)),
            normals: over.normals(&world, carriers, placement),
        }
    }

    /// The control points, at rest at `rest`, of a curve in the world.
    fn curve(
        &self,
        rest: &[Vector3<f64>],
        curve: &CurveOver,
        moment: &Frame,
        carrier: &Carrier,
    ) -> Vec<Motion> {
        let mut controls = Vec::new();
        if let Some((baked, set)) =
            curve.baked.as_ref().and_then(|baked| Some((baked, baked.set.of(moment)?)))
        {
            let points: Vec<Motion> = baked
                .points
                .clone()
                .zip(&baked.rest)
                .map(|(i, rest)| self.motion(set, i) - carrier.motion(rest))
                .collect();
            match &baked.places {
                None => self.fits[curve.fit].solve(&points, &mut controls),
                Some(places) => {
                    let points: Vec<Motion> = places.iter().map(|row| row.of(&points)).collect();
                    self.fits[curve.fit].solve(&points, &mut controls);
                }
            }
        }
        controls.resize(rest.len(), Motion::zeros());
        controls.iter_mut().zip(rest).for_each(|(control, rest)| *control += carrier.motion(rest));
        controls
    }

    /// Motion of a point of the cache in the world, m.
    fn motion(&self, set: &CurveFrame, i: usize) -> Motion {
        let of = |values: &[[f32; 3]]| {
            values.get(i).map_or_else(Vector3::zeros, |v| self.convention.length_in(v.map(f64::from).into()))
        };
        motion::joined([
            of(&set.points),
            of(&set.velocities),
            of(set.accelerations.as_deref().unwrap_or_default()),
        ])
    }
}

impl PrimOver {
    /// Normals in the space of the prim: carried with the root, then turned by as much as the curve turns
    /// there.
    fn normals(&self, world: &[Motion], carriers: &Carriers, placement: &Placement) -> Option<Vec<[f32; 3]>> {
        let given = self.prim.normals.as_ref()?;
        let to_rest = self.turn.try_inverse().unwrap_or_else(Matrix3::identity).transpose();
        let turned = |(normal, control): (&Vector3<f64>, &usize)| {
            let curve = self.curves.partition_point(|curve| curve.controls.end <= *control);
            let (ends, carrier) = (&self.curves[curve].controls, carriers.of(curve));
            let (before, after) =
                (control.saturating_sub(1).max(ends.start), (control + 1).min(ends.end - 1));
            let carried = carrier.turn(&(self.rest[after] - self.rest[before]));
            let tangent = parts(&world[after])[0] - parts(&world[before])[0];
            let turn = UnitQuaternion::rotation_between(&carried, &tangent).unwrap_or_default();
            let turned = placement.normal(&(turn * carrier.turn(&(to_rest * normal))));
            single(&(turned.try_normalize(0.0).unwrap_or_default() * normal.norm()))
        };
        Some(given.normals.iter().zip(&given.controls).map(turned).collect())
    }
}

/// What carries the curves of a prim at one moment.
struct Carriers<'a> {
    head: &'a Carrier,
    /// That of each curve whose root is on a skin.
    own: Vec<Option<Carrier>>,
}

impl Carriers<'_> {
    /// What carries curve `c`.
    fn of(&self, c: usize) -> &Carrier {
        self.own[c].as_ref().unwrap_or(self.head)
    }
}

/// Where samples of a curve are on the strand that was imported from it, by arc length, as weights of the
/// points of the strand; `None` if they are its points. The importer merges points and may distribute them
/// anew.
fn places(samples: &[Vector3<f64>], strand: &[Vector3<f64>]) -> Option<Vec<Row>> {
    const DRAWN: CurveType = CurveType { basis: Basis::CatmullRom, wrap: Wrap::Pinned };
    let (at, sampled) = (fractions(strand), fractions(samples));
    if at.len() == sampled.len() && at.iter().zip(&sampled).all(|(a, b)| (a - b).abs() < SAME_PLACE) {
        return None;
    }
    let row = |place: f64| {
        let next = at.partition_point(|at| *at <= place).clamp(1, at.len() - 1);
        let near = [next - 1, next].into_iter().find(|i| (at[*i] - place).abs() < SAME_PLACE);
        match near {
            Some(first) => Row { first, weights: [1.0, 0.0, 0.0, 0.0] },
            None => DRAWN.row(at.len(), next - 1, (place - at[next - 1]) / (at[next] - at[next - 1])),
        }
    };
    Some(sampled.into_iter().map(row).collect())
}

/// Arc length up to each point as a share of that of the polyline.
fn fractions(points: &[Vector3<f64>]) -> Vec<f64> {
    let steps = points.windows(2).map(|w| (w[1] - w[0]).norm());
    let arc: Vec<f64> = std::iter::once(0.0)
        .chain(steps.scan(0.0, |sum, step| {
            *sum += step;
            Some(*sum)
        }))
        .collect();
    let length = arc.last().copied().filter(|length| *length > 0.0).unwrap_or(1.0);
    arc.into_iter().map(|s| s / length).collect()
}

/// What does not change in the layers over `target`.
fn over_header(target: &OverTarget, accelerations: bool, out: &Path) -> Result<OverHeader> {
    let prims = target.prims.iter().map(|prim| OverCurves {
        path: prim.path.clone(),
        normals: prim.normals.as_ref().map(|normals| normals.name.clone()),
        without_accelerations: prim.accelerations && !accelerations,
        without_skeleton: prim.skinned,
    });
    Ok(OverHeader { stage: shot_stage(target, out)?, accelerations, prims: prims.collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(x: &[f64]) -> Vec<Vector3<f64>> {
        x.iter().map(|x| Vector3::new(*x, 1.0, 0.0)).collect()
    }

    #[test]
    fn samples_are_found_on_a_strand_with_merged_or_other_points() {
        let samples = line(&[0.0, 0.1, 0.1, 0.3, 0.4]);
        assert_eq!(places(&samples, &samples), None);
        // Twice as long, and without the point that is there twice.
        let merged = places(&samples, &line(&[0.0, 0.2, 0.6, 0.8])).unwrap();
        assert_eq!(merged.iter().map(|row| row.first).collect::<Vec<_>>(), [0, 1, 1, 2, 3]);
        let other = line(&[0.0, 0.2, 0.4]);
        for (row, sample) in places(&samples, &other).unwrap().iter().zip(&samples) {
            approx::assert_abs_diff_eq!(row.of(&other), *sample, epsilon = 1e-12);
        }
    }
}
