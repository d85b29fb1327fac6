//! All render strands of a groom, evaluated from the guides.

use super::chain::Vertex;
use super::clearances::{DistanceBounds, SEARCH_RADIUS};
use super::deflection::{Deflection, FILTER_SPAN, between, filtered};
use super::depths::{Depths, INSIDE, in_metres};
use super::free_chain::{Lay, lay};
use super::guide_weights::GuideWeights;
use super::jumps::Jumps;
use super::moment::{Carriers, GuideMotion};
use super::obstacles::Obstacles;
use super::posed_guide::{PosedGuide, PosedGuides};
use super::rest_guide::{Counterpart, RestGuide};
use super::strand::{Strand, StrandState};
use crate::contact::Bodies;
use crate::math::lanes::MAX_LANES;
use crate::rod::Rod;
use crate::scene::Curves;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Distance of a strand from its guide, relative to that at rest, up to which the guide alone tells that no
/// body is near.
const SPREAD: f64 = 1.5;

/// Render strands, ready to be evaluated at any moment.
#[derive(Debug, Clone)]
pub struct Interpolator {
    strands: Vec<Strand>,
    offsets: Vec<usize>,
    guides: Vec<RestGuide>,
    pairs: Vec<GuidePair>,
    /// For each guide, the radius of the search for bodies around its points, m.
    search_radius: Vec<f64>,
}

/// Two guides that some strand follows.
#[derive(Debug, Clone)]
struct GuidePair {
    /// Their indices; the strand's weight of the first is the larger.
    guides: [usize; 2],
    /// For each point of the first, what corresponds to it on the second.
    counterparts: Vec<Counterpart>,
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

/// Number of frames after a frame whose guides its strands depend on.
pub const LOOKAHEAD: usize = FILTER_SPAN + 2;

/// Number of frames before a frame whose guides its strands depend on.
pub const LOOKBEHIND: usize = FILTER_SPAN + 1;

/// Deflections of all vertices at the frames around a frame, for [`Interpolator::settle`].
pub type AroundFrame<'a> = [&'a [Deflection]; 2 * FILTER_SPAN + 1];

/// Settled deflections at the frame before a frame, the frame and the two after it, and a moment between it
/// and the next.
#[derive(Debug, Clone, Copy)]
pub struct DeflectionAt<'a> {
    /// Deflections at the four frames.
    pub frames: [&'a [Deflection]; 4],
    /// Time since the frame as a fraction (0..1) of the interval to the next.
    pub fraction: f64,
    /// Interval between frames, s.
    pub interval: f64,
}

impl DeflectionAt<'_> {
    /// Deflection of a vertex and its rate, 1/s.
    fn of(&self, vertex: usize) -> [Vector3<f64>; 2] {
        let [value, rate] = between(self.frames.map(|frame| frame[vertex]), self.fraction);
        [value, rate / self.interval]
    }

    /// Whether any vertex of a range is deflected.
    fn is_any(&self, start: usize, end: usize) -> bool {
        self.frames.iter().any(|frame| is_any(&frame[start..end]))
    }
}

/// Whether any deflection is not zero.
fn is_any(deflections: &[Deflection]) -> bool {
    deflections.iter().any(|by| *by != [0.0; 3])
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
        let pair = |weights: &GuideWeights, other: usize| [weights[0].0, other];
        let all = weights.iter().flat_map(|w| w[1..].iter().map(move |(other, _)| pair(w, *other)));
        let unique: Vec<[usize; 2]> = all.collect::<BTreeSet<_>>().into_iter().collect();
        let (strands, distances): (Vec<Strand>, Vec<f64>) = weights
            .into_par_iter()
            .enumerate()
            .map(|(c, weights)| {
                let index = |other| unique.partition_point(|known| *known < pair(&weights, other));
                let others = weights[1..].iter().map(|(other, weight)| (index(*other), *weight)).collect();
                Strand::new((c, curves.curve(c)), weights[0].0, others, &rest, bodies, thickness)
            })
            .unzip();
        let pairs = unique
            .into_par_iter()
            .map(|guides| GuidePair { guides, counterparts: rest[guides[1]].counterparts(&rest[guides[0]]) })
            .collect();
        let mut search_radius = vec![0.0_f64; rest.len()];
        for (strand, distance) in strands.iter().zip(distances) {
            let guide = strand.chain.main;
            search_radius[guide] = search_radius[guide].max(distance);
        }
        search_radius.iter_mut().for_each(|radius| *radius = SPREAD * *radius + SEARCH_RADIUS);
        Interpolator { strands, offsets: curves.offsets.clone(), guides: rest, pairs, search_radius }
    }

    /// Number of vertices of all strands.
    pub fn vertices(&self) -> usize {
        self.offsets.last().copied().unwrap_or(0)
    }

    /// For each strand, the index of the guide of largest weight.
    pub fn main_guides(&self) -> impl Iterator<Item = usize> {
        self.strands.iter().map(|strand| strand.chain.main)
    }

    /// The guides at a moment, on `carriers`; with their distances from bodies if `obstacles` are given.
    pub fn pose(
        &self,
        carriers: Carriers,
        obstacles: Option<&Obstacles>,
        guides: &[GuideMotion],
    ) -> PosedGuides {
        let guides: Vec<PosedGuide> = guides
            .par_iter()
            .zip(self.guides.par_iter().zip(&self.search_radius))
            .enumerate()
            .with_min_len(16)
            .map_init(Default::default, |scratch, (i, (motion, (rest, radius)))| {
                let clear = obstacles.map(|obstacles| |x: &Vector3<f64>| obstacles.distance(x, *radius));
                PosedGuide::new(scratch, rest, (&carriers, i), motion, clear)
            })
            .collect();
        let differences = |GuidePair { guides: [first, second], counterparts }: &GuidePair| {
            guides[*first].differences(&self.guides[*first], &guides[*second], counterparts)
        };
        let differences = self.pairs.par_iter().with_min_len(16).map(differences).collect();
        PosedGuides { guides, differences, carriers }
    }

    /// The free strands at a frame, and the deflections that keep them outside the bodies there. `guides` are
    /// posed for that with their distances from bodies; `to_scene` maps metres, Y up, to the output's unit
    /// and axes.
    pub fn evaluate_free(
        &self,
        obstacles: &Obstacles,
        guides: &PosedGuides,
        to_scene: &Matrix3<f64>,
    ) -> (StrandMotion, Vec<Deflection>) {
        let mut motion = StrandMotion::zeros(self.vertices());
        let mut deflections = vec![[0.0; 3]; self.vertices()];
        let outputs = self.split_motion(&mut motion).zip(self.split(&mut deflections));
        let strands = self.strands.iter().zip(outputs);
        for_each_strand(strands.collect(), guides, true, |strand, state, (out, deflections)| {
            write(to_scene, &state.free, out);
            strand.find_deflections(obstacles, guides, state, deflections);
        });
        (motion, deflections)
    }

    /// The deflections of [`Interpolator::evaluate_free`].
    pub fn deflections(&self, obstacles: &Obstacles, guides: &PosedGuides) -> Vec<Deflection> {
        let mut deflections = vec![[0.0; 3]; self.vertices()];
        let strands = self.strands.iter().zip(self.split(&mut deflections)).collect();
        for_each_strand(strands, guides, false, |strand, state, deflections| {
            strand.find_deflections(obstacles, guides, state, deflections);
        });
        deflections
    }

    /// Settled deflections at a frame, from those of [`Interpolator::deflections`] at the frames around it.
    pub fn settle(&self, obstacles: &Obstacles, guides: &PosedGuides, raw: &AroundFrame) -> Vec<Deflection> {
        let mut settled = vec![[0.0; 3]; self.vertices()];
        let strands = self.strands.iter().zip(self.offsets.windows(2).zip(self.split(&mut settled)));
        let strands: Vec<_> =
            strands.filter(|(_, (w, _))| raw.iter().any(|frame| is_any(&frame[w[0]..w[1]]))).collect();
        let buffers = <(StrandState, Vec<Vector3<f64>>)>::default;
        strands.into_par_iter().with_min_len(8).for_each_init(
            buffers,
            |(state, smooth), (strand, (w, out))| {
                filtered(&raw.map(|frame| &frame[w[0]..w[1]]), smooth);
                strand.settle(obstacles, guides, smooth, state, out);
            },
        );
        settled
    }

    /// The strands at a moment with their deflections. `free` is the result of
    /// [`Interpolator::evaluate_free`] at that moment, if known; other arguments are as there.
    pub fn evaluate(
        &self,
        guides: &PosedGuides,
        deflections: &DeflectionAt,
        to_scene: &Matrix3<f64>,
        free: Option<StrandMotion>,
    ) -> StrandMotion {
        let known = free.is_some();
        let mut out = free.unwrap_or_else(|| StrandMotion::zeros(self.vertices()));
        let strands = self.strands.iter().zip(self.offsets.windows(2).zip(self.split_motion(&mut out)));
        let mut strands: Vec<_> =
            strands.filter(|(_, (w, _))| !known || deflections.is_any(w[0], w[1])).collect();
        if strands.is_empty() {
            return out;
        }
        let buffers = <[(Vec<[Vector3<f64>; 2]>, Vec<Vertex>); MAX_LANES]>::default;
        strands.par_chunks_mut(MAX_LANES).with_min_len(8).for_each_init(buffers, |buffers, strands| {
            for ((edges, _), (strand, (w, _))) in buffers.iter_mut().zip(&*strands) {
                edges.clear();
                if deflections.is_any(w[0], w[1]) {
                    edges.extend(strand.deflected((w[0]..w[1]).map(|vertex| deflections.of(vertex))));
                }
            }
            let mut laid: [Vec<Vertex>; MAX_LANES] =
                std::array::from_fn(|i| std::mem::take(&mut buffers[i].1));
            let chains = strands.iter().zip(&*buffers);
            let chains =
                chains.map(|((strand, _), (edges, _))| Lay { chain: &strand.chain, deflected: edges });
            lay(chains, guides, true, &mut laid);
            for ((_, (_, out)), vertices) in strands.iter_mut().zip(&laid) {
                write(to_scene, vertices, out);
            }
            buffers.iter_mut().zip(laid).for_each(|(buffer, laid)| buffer.1 = laid);
        });
        out
    }

    /// Depths of strands at `points`, in the output's unit and axes, which `from_scene` maps to metres, Y up.
    pub fn depths(
        &self,
        obstacles: &Obstacles,
        guides: &PosedGuides,
        points: &[[f32; 3]],
        from_scene: &Matrix3<f64>,
    ) -> Depths {
        self.strands
            .par_iter()
            .zip(self.offsets.par_windows(2))
            .with_min_len(64)
            .map_init(DistanceBounds::default, |bounds, (strand, w)| {
                let points = in_metres(&points[w[0]..w[1]], from_scene);
                let Depths { guides: strands, pinched, pinched_bodies, .. } =
                    Depths::of_curve(&strand.inside(obstacles, guides, points, bounds));
                let inside = u32::from(strands > INSIDE);
                Depths { guides: 0.0, strands, inside, pinched, pinched_bodies }
            })
            .reduce(Depths::default, |a, b| Depths { inside: a.inside + b.inside, ..a.max(b) })
    }

    /// How far settled deflections at two consecutive frames move the strands between them.
    pub fn jumps(&self, frames: [&[Deflection]; 2]) -> Jumps {
        self.strands
            .par_iter()
            .zip(self.offsets.par_windows(2))
            .with_min_len(64)
            .map(|(strand, w)| Jumps::of_strand(strand, frames.map(|frame| &frame[w[0]..w[1]])))
            .reduce(Jumps::default, Jumps::and)
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

/// Calls `then` for each strand, in parallel, with a state that holds its free chain, with velocities if
/// `with_velocities`.
fn for_each_strand<T: Send>(
    mut strands: Vec<(&Strand, T)>,
    guides: &PosedGuides,
    with_velocities: bool,
    then: impl Fn(&Strand, &mut StrandState, &mut T) + Sync,
) {
    let buffers = <([Vec<Vertex>; MAX_LANES], StrandState)>::default;
    strands.par_chunks_mut(MAX_LANES).with_min_len(8).for_each_init(buffers, |(free, state), strands| {
        let chains = strands.iter().map(|(strand, _)| Lay::free(&strand.chain));
        lay(chains, guides, with_velocities, free);
        for ((strand, with), free) in strands.iter_mut().zip(free) {
            std::mem::swap(&mut state.free, free);
            then(strand, state, with);
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
