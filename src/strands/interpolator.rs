//! All render strands of a groom, evaluated from the guides.

use super::chain::Vertex;
use super::clearances::SEARCH_RADIUS;
use super::free_chain::lay_free;
use super::guide_weights::GuideWeights;
use super::moment::{DIFFERENCE_STEP, GuideMotion, HeadMotion, Moment};
use super::posed_guide::PosedGuide;
use super::rest_guide::RestGuide;
use super::retraction::{RETRACTION_SPAN, smoothed};
use super::strand::{Strand, StrandState};
use crate::contact::Bodies;
use crate::math::lanes::MAX_LANES;
use crate::rod::{Rod, RodShape};
use crate::scene::Curves;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Distance of a strand from its guide, relative to that at rest, up to which the guide alone tells that no
/// body is near.
const SPREAD: f64 = 1.5;

/// Speed of guides relative to bodies up to which lower bounds of distances hold [`DIFFERENCE_STEP`] earlier,
/// m/s.
const MAX_SPEED: f64 = 20.0;

/// Render strands, ready to be evaluated at any moment.
#[derive(Debug, Clone)]
pub struct Interpolator {
    strands: Vec<Strand>,
    offsets: Vec<usize>,
    guides: Vec<RestGuide>,
    /// For each guide, the radius of the search for bodies around its points, m.
    search_radius: Vec<f64>,
}

/// Points and velocities of the strands at one moment, one entry per vertex of the curves given to
/// [`Interpolator::new`].
#[derive(Debug, Clone, PartialEq)]
pub struct StrandMotion {
    /// Points.
    pub points: Vec<[f32; 3]>,
    /// Velocities, per second.
    pub velocities: Vec<[f32; 3]>,
}

impl StrandMotion {
    fn zeros(vertices: usize) -> Self {
        StrandMotion { points: vec![[0.0; 3]; vertices], velocities: vec![[0.0; 3]; vertices] }
    }
}

/// Retractions of all vertices at the frames around a frame, from [`RETRACTION_SPAN`] before it to as many
/// after it.
pub type Retractions<'a> = [&'a [f32]; 2 * RETRACTION_SPAN + 1];

/// Retractions around a frame, and a moment between it and the next frame.
#[derive(Debug, Clone, Copy)]
pub struct RetractionAt<'a> {
    /// Retractions around the frame.
    pub frames: &'a Retractions<'a>,
    /// Time since the frame as a fraction (0..1) of the interval to the next.
    pub fraction: f64,
    /// Interval between frames, s.
    pub interval: f64,
}

impl RetractionAt<'_> {
    /// Retraction of a vertex at the moment, and [`DIFFERENCE_STEP`] earlier.
    fn of(&self, vertex: usize) -> [f64; 2] {
        let (value, slope) = smoothed(self.frames.map(|frame| f64::from(frame[vertex])), self.fraction);
        [value, value - slope * DIFFERENCE_STEP / self.interval]
    }

    /// Whether any vertex of a range is retracted.
    fn is_any(&self, start: usize, end: usize) -> bool {
        self.frames.iter().any(|frame| frame[start..end].iter().any(|fraction| *fraction != 0.0))
    }
}

impl Interpolator {
    /// Prepares the strands `curves`, each of which follows `guides` with its `weights`. `bodies` are at rest
    /// and have the thicknesses `thickness`, m; strands stay as close to them as in the groom.
    pub fn new(
        curves: &Curves,
        weights: Vec<GuideWeights>,
        guides: &[&Rod],
        bodies: &Bodies,
        thickness: &[f64],
    ) -> Self {
        let rest: Vec<RestGuide> = guides.par_iter().map(|rod| RestGuide::new(rod)).collect();
        let strands: Vec<Strand> = weights
            .into_par_iter()
            .enumerate()
            .map(|(c, weights)| Strand::new(curves.curve(c), weights, &rest, bodies, thickness))
            .collect();
        let mut search_radius = vec![0.0_f64; rest.len()];
        for strand in &strands {
            let guide = strand.chain.main_guide();
            search_radius[guide] = search_radius[guide].max(strand.max_guide_distance(&rest[guide]));
        }
        search_radius.iter_mut().for_each(|radius| *radius = SPREAD * *radius + SEARCH_RADIUS);
        Interpolator { strands, offsets: curves.offsets.clone(), guides: rest, search_radius }
    }

    /// Number of vertices of all strands.
    pub fn vertices(&self) -> usize {
        self.offsets.last().copied().unwrap_or(0)
    }

    /// For each strand, the index of the guide of largest weight.
    pub fn main_guides(&self) -> impl Iterator<Item = usize> {
        self.strands.iter().map(|strand| strand.chain.main_guide())
    }

    /// The strands at a frame as they are if none is retracted, and the retraction that each vertex requires
    /// there. `moments` are the frame and [`DIFFERENCE_STEP`] earlier; `to_scene` maps metres, Y up, to the
    /// output's unit and axes.
    pub fn evaluate_unretracted(
        &self,
        moments: &[Moment; 2],
        guides: &[GuideMotion],
        to_scene: &Matrix3<f64>,
    ) -> (StrandMotion, Vec<f32>) {
        let posed = self.pose_guides(moments, guides);
        let (mut motion, mut retractions) =
            (StrandMotion::zeros(self.vertices()), vec![0.0; self.vertices()]);
        let outputs = self.split_motion(&mut motion).zip(self.split(&mut retractions));
        let strands = self.strands.iter().zip(outputs);
        for_each_strand(strands.collect(), moments, &posed, true, |strand, states, (out, retractions)| {
            strand.find_retractions(&moments[0], &posed[0], &mut states[0], retractions);
            states.iter_mut().for_each(|state| state.clear_retraction(retractions.len()));
            strand.settle(moments, &posed, states);
            write(to_scene, &states[0].vertices, out);
        });
        (motion, retractions)
    }

    /// The retractions of [`Interpolator::evaluate_unretracted`].
    pub fn retractions(&self, moments: &[Moment; 2], guides: &[GuideMotion]) -> Vec<f32> {
        let posed = self.pose_guides(moments, guides);
        let mut retractions = vec![0.0; self.vertices()];
        let strands = self.strands.iter().zip(self.split(&mut retractions)).collect();
        for_each_strand(strands, moments, &posed, false, |strand, states, retractions| {
            strand.find_retractions(&moments[0], &posed[0], &mut states[0], retractions);
        });
        retractions
    }

    /// The strands at a moment with their retractions. `unretracted` is the result of
    /// [`Interpolator::evaluate_unretracted`] at that moment, if known; other arguments are as there.
    pub fn evaluate(
        &self,
        moments: &[Moment; 2],
        guides: &[GuideMotion],
        retractions: &RetractionAt,
        to_scene: &Matrix3<f64>,
        unretracted: Option<StrandMotion>,
    ) -> StrandMotion {
        let known = unretracted.is_some();
        let mut out = unretracted.unwrap_or_else(|| StrandMotion::zeros(self.vertices()));
        let strands = self.strands.iter().zip(self.offsets.windows(2).zip(self.split_motion(&mut out)));
        let strands: Vec<_> =
            strands.filter(|(_, (w, _))| !known || retractions.is_any(w[0], w[1])).collect();
        if strands.is_empty() {
            return out;
        }
        let posed = self.pose_guides(moments, guides);
        for_each_strand(strands, moments, &posed, true, |strand, states, (w, out)| {
            states.iter_mut().for_each(|state| state.clear_retraction(w[1] - w[0]));
            if retractions.is_any(w[0], w[1]) {
                let [now, before] = &mut *states;
                for (k, vertex) in (w[0]..w[1]).enumerate() {
                    [now.retraction[k], before.retraction[k]] = retractions.of(vertex);
                }
            }
            strand.settle(moments, &posed, states);
            write(to_scene, &states[0].vertices, out);
        });
        out
    }

    /// The guides at both moments.
    fn pose_guides(&self, moments: &[Moment; 2], guides: &[GuideMotion]) -> [Vec<PosedGuide>; 2] {
        let q: Vec<Vec<f64>> = guides.iter().map(GuideMotion::earlier_q).collect();
        let earlier: Vec<_> = guides.iter().zip(&q).map(|(g, q)| GuideMotion { q, ..*g }).collect();
        let obstacles = &moments[0].obstacles;
        let distance = |i: usize, _, x: &Vector3<f64>| obstacles.distance(x, self.search_radius[i]);
        let now = self.pose_at(&moments[0].head, guides, distance);
        // Guides and bodies have hardly moved since the earlier moment.
        let distance = |i: usize, k: usize, _: &Vector3<f64>| now[i].clear[k] - DIFFERENCE_STEP * MAX_SPEED;
        let before = self.pose_at(&moments[1].head, &earlier, distance);
        [now, before]
    }

    /// The guides at one moment. `distance` gives a lower bound on the distance from all bodies, m, for the
    /// index of a guide, the index of a point and its position.
    fn pose_at(
        &self,
        head: &HeadMotion,
        guides: &[GuideMotion],
        distance: impl Fn(usize, usize, &Vector3<f64>) -> f64 + Sync,
    ) -> Vec<PosedGuide> {
        guides
            .par_iter()
            .zip(&self.guides)
            .with_min_len(16)
            .enumerate()
            .map_init(RodShape::default, |shape, (i, (motion, rest))| {
                PosedGuide::new(shape, rest, head, motion, |k, x| distance(i, k, x))
            })
            .collect()
    }

    /// Points and velocities in parts, one per strand.
    fn split_motion<'a>(
        &'a self,
        motion: &'a mut StrandMotion,
    ) -> impl Iterator<Item = [&'a mut [[f32; 3]]; 2]> {
        self.split(&mut motion.points).zip(self.split(&mut motion.velocities)).map(|(p, v)| [p, v])
    }

    /// An array with one entry per vertex in parts, one per strand.
    fn split<'a, T>(&'a self, mut array: &'a mut [T]) -> impl Iterator<Item = &'a mut [T]> {
        self.offsets.windows(2).filter_map(move |w| array.split_off_mut(..w[1] - w[0]))
    }
}

/// Calls `then` for each strand, in parallel, with two states, the first of which holds its free chain at the
/// first moment, with velocities if `with_velocities`.
fn for_each_strand<T: Send>(
    mut strands: Vec<(&Strand, T)>,
    moments: &[Moment; 2],
    guides: &[Vec<PosedGuide>; 2],
    with_velocities: bool,
    then: impl Fn(&Strand, &mut [StrandState; 2], &mut T) + Sync,
) {
    let buffers = <([Vec<Vertex>; MAX_LANES], [StrandState; 2])>::default;
    strands.par_chunks_mut(MAX_LANES).with_min_len(8).for_each_init(buffers, |(free, states), strands| {
        let chains = strands.iter().map(|(strand, _)| &strand.chain);
        lay_free(chains, &moments[0].head, &guides[0], with_velocities, free);
        for ((strand, with), free) in strands.iter_mut().zip(free) {
            std::mem::swap(&mut states[0].free, free);
            then(strand, states, with);
        }
    });
}

fn write(to_scene: &Matrix3<f64>, vertices: &[Vertex], [points, velocities]: &mut [&mut [[f32; 3]]; 2]) {
    for ((p, v), vertex) in points.iter_mut().zip(velocities.iter_mut()).zip(vertices) {
        (*p, *v) = (single(&(to_scene * vertex.x)), single(&(to_scene * vertex.v)));
    }
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    v.cast::<f32>().into()
}
