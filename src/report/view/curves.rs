//! Curves for the page: their points in the frame of the head, and what colours show of them.

use super::bodies::{NEAR, Surface, SurfaceAt};
use crate::cache::{CurveFrame, CurveSet, Frame, Header};
use crate::report::preview::Crowding;
use crate::report::space::{finite_box, to_rest};
use nalgebra::Vector3;
use std::collections::BTreeSet;
use std::ops::Range;

/// The curves of a set that are shown.
pub struct ShownCurves<'a> {
    /// The set.
    pub set: &'a CurveSet,
    /// Every how many curves one is shown.
    pub step: usize,
    /// Ids of the curves that are shown whatever the step.
    pub always: BTreeSet<i32>,
    /// Indices of the curves shown.
    pub curves: Vec<usize>,
    /// Indices of their points.
    pub points: Vec<usize>,
    /// Whether each of these points is the first of its curve.
    pub roots: Vec<bool>,
    crowding: Crowding<'a>,
    /// Whether the groom has each point shown inside each body.
    inside_at_rest: Vec<Vec<bool>>,
}

/// A frame of these curves.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ShownFrame {
    /// Points, rest space of the head, scene units.
    pub points: Vec<Vector3<f32>>,
    /// One byte for each point: [`crowding_code`] in the lower half, [`depth_code`] in the upper.
    pub shades: Vec<u8>,
    /// Level of each curve; empty if the cache has none.
    pub levels: Vec<u8>,
}

impl<'a> ShownCurves<'a> {
    /// Every `step`th curve of `set`, and those whose ids are in `always`.
    pub fn new(
        set: &'a CurveSet,
        step: usize,
        always: BTreeSet<i32>,
        header: &Header,
        surfaces: &[Surface],
    ) -> Self {
        let mut shown = ShownCurves {
            set,
            step,
            always,
            curves: Vec::new(),
            points: Vec::new(),
            roots: Vec::new(),
            crowding: Crowding::new(set, header.metres_per_unit),
            inside_at_rest: Vec::new(),
        };
        for (curve, points) in set.ranges().enumerate() {
            if !curve.is_multiple_of(step) && !shown.is_always(curve) {
                continue;
            }
            shown.curves.push(curve);
            shown.roots.extend(points.clone().map(|i| i == points.start));
            shown.points.extend(points);
        }
        let rest = |i: &usize| Vector3::from(set.rest[*i]).cast::<f64>() * header.metres_per_unit;
        let inside = |(surface, mesh): (&Surface, _)| {
            let at = surface.at(Some(mesh));
            let inside = |i: &usize| at.as_ref().is_some_and(|at| at.distance(&rest(i)) < 0.0);
            shown.points.iter().map(inside).collect()
        };
        let meshes = header.colliders.iter().map(|mesh| &mesh.points[..]);
        shown.inside_at_rest = surfaces.iter().zip(meshes).map(inside).collect();
        shown
    }

    /// What is shown of a frame; `surfaces` are the bodies at it.
    pub fn at(
        &self,
        moving: &CurveFrame,
        frame: &Frame,
        surfaces: &[Option<SurfaceAt>],
        metres_per_unit: f64,
    ) -> ShownFrame {
        let to_head = to_rest(&frame.head);
        let at_rest: Vec<Vector3<f32>> = moving.points.iter().map(|p| to_head(p).cast()).collect();
        let mut distance = vec![f64::INFINITY; self.points.len()];
        for ((surface, body), inside) in surfaces.iter().zip(&frame.colliders).zip(&self.inside_at_rest) {
            let Some(surface) = surface else { continue };
            let to_body = to_rest(&body.transform);
            for (k, i) in self.points.iter().enumerate().filter(|(k, _)| !inside[*k]) {
                let p = to_body(&moving.points[*i]) * metres_per_unit;
                distance[k] = surface.distance(&p).min(distance[k]);
            }
        }
        let crowding = self.crowding.relative_at(&at_rest, self.points.iter().copied());
        let shades = crowding.iter().zip(&distance).map(|(c, d)| crowding_code(*c) | depth_code(*d) << 4);
        let levels =
            moving.level.iter().flat_map(|level| self.curves.iter().map(|c| level[*c].clamp(0, 255) as u8));
        ShownFrame {
            points: self.points.iter().map(|i| at_rest[*i]).collect(),
            shades: shades.collect(),
            levels: levels.collect(),
        }
    }

    /// The lowest and highest corner of where points of `frames` can be in the rest space of the head: no
    /// farther from the roots, which a skin may move, than the longest curve is long. `None` without roots.
    pub fn reach(&self, frames: &[ShownFrame]) -> Option<[Vector3<f32>; 2]> {
        let roots = frames
            .iter()
            .flat_map(|f| f.points.iter().zip(&self.roots))
            .filter(|(_, root)| **root)
            .map(|(p, _)| p);
        let [low, high] = finite_box(roots)?;
        let distance = |w: &[[f32; 3]]| (Vector3::from(w[1]) - Vector3::from(w[0])).norm();
        let length = |curve: Range<usize>| -> f32 { self.set.rest[curve].windows(2).map(distance).sum() };
        // A spline of rods resampled to points may be longer than the chords at rest.
        let reach = 1.5 * self.set.ranges().map(length).fold(0.0, f32::max);
        Some([low.add_scalar(-reach), high.add_scalar(reach)])
    }

    fn is_always(&self, curve: usize) -> bool {
        self.set.id.get(curve).is_some_and(|id| self.always.contains(id))
    }

    /// Keeps one of `of` curves shown, and what `frames` hold of them. Those that are shown whatever the step
    /// are thinned as the others are, so that neither crowds out the other, and go with them.
    pub fn thin(&mut self, of: usize, frames: &mut [ShownFrame]) {
        let every = self.step * of;
        let regular = self.curves.iter().filter(|curve| curve.is_multiple_of(self.step)).count();
        self.always = match regular < 2 {
            true => BTreeSet::new(),
            false => self.always.iter().copied().step_by(of).collect(),
        };
        let keep: Vec<bool> =
            self.curves.iter().map(|curve| curve.is_multiple_of(every) || self.is_always(*curve)).collect();
        let curve_of: Vec<usize> = self
            .roots
            .iter()
            .scan(0, |n, root| {
                *n += usize::from(*root);
                Some(*n - 1)
            })
            .collect();
        let keep_point = |k: usize| keep[curve_of[k]];
        for frame in frames {
            frame.points = kept(&frame.points, keep_point);
            frame.shades = kept(&frame.shades, keep_point);
            frame.levels = kept(&frame.levels, |curve| keep[curve]);
        }
        self.inside_at_rest.iter_mut().for_each(|inside| *inside = kept(inside, keep_point));
        self.points = kept(&self.points, keep_point);
        self.roots = kept(&self.roots, keep_point);
        self.curves = kept(&self.curves, |curve| keep[curve]);
        self.step = every;
    }
}

fn kept<T: Copy>(all: &[T], keep: impl Fn(usize) -> bool) -> Vec<T> {
    all.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, x)| *x).collect()
}

/// Density over that of the densest hair of the groom, 0 to 2, in fifteen steps.
fn crowding_code(crowding: f32) -> u8 {
    (7.5 * crowding.clamp(0.0, 2.0)).round() as u8
}

/// Steps of half a millimetre into a body, from two millimetres before its surface: 0 is nowhere near, 4 the
/// last one outside, 5 the first one inside, 15 deeper than five millimetres.
fn depth_code(distance: f64) -> u8 {
    ((NEAR - distance) / 5e-4).ceil().clamp(0.0, 15.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_have_their_steps() {
        let depths = [f64::INFINITY, 2e-3, 1.9e-3, 1e-6, -1e-6, -4.9e-4, -6e-4, -4.9e-3, -0.04];
        assert_eq!(depths.map(depth_code), [0, 0, 1, 4, 5, 5, 6, 14, 15]);
        assert_eq!([0.0, 1.0, 1.5, 2.0, 9.0, f32::NAN].map(crowding_code), [0, 8, 11, 15, 15, 0]);
    }
}
