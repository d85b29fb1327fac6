//! Render strands from guide strands, in strain space (S18; `docs/theory.md` §7).
//!
//! A render strand keeps its own shape as a chain of rigid edges. What its guides deviate from their rest shape is
//! blended in rest space and turns edge after edge. Curls stay curls, no
//! edge changes its length, and at rest the strand is the groom's, to rounding.

mod choice;
mod follow;
mod free;
mod keep;
mod keep_out;
mod relax;
mod retreat;
mod strand;
#[cfg(test)]
mod tests;

use crate::contact::Bodies;
use crate::math::lanes::MAX_LANES;
use crate::rod::{Rod, RodShape};
use crate::scene::Curves;
pub use choice::{GuideWeights, MAX_GUIDES, Membership, clumping, guide_weights};
use follow::{Place, RestGuide, Turned};
pub use keep::thin;
pub use keep_out::Obstacles;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
pub use retreat::RETRACTION_SPAN;
use strand::{Strand, Trace, Track};

/// Render strands, ready to be rebuilt from the guides at any moment.
#[derive(Debug, Clone)]
pub struct Interpolator {
    strands: Vec<Strand>,
    offsets: Vec<usize>,
    guides: Vec<RestGuide>,
    /// How far from each guide it is of use to know that there is no body, m.
    reach: Vec<f64>,
}

/// What a guide does at one moment.
#[derive(Debug, Clone, Copy)]
pub struct GuideMotion<'a> {
    /// The guide.
    pub rod: &'a Rod,
    /// Deviation of the strain at its nodes, 1/m (the rod's unknowns).
    pub q: &'a [f64],
    /// Rate of `q`, 1/(m·s).
    pub rate: &'a [f64],
}

/// How the head, and with it every root, moves at one moment: rest space to world.
#[derive(Debug, Clone, Copy)]
pub struct HeadMotion {
    /// Rotation.
    pub rotation: Matrix3<f64>,
    /// Translation, m.
    pub translation: Vector3<f64>,
    /// Angular velocity, rad/s, world axes.
    pub spin: Vector3<f64>,
    /// Velocity of the point of the head that is at the rest origin, m/s.
    pub velocity: Vector3<f64>,
}

impl HeadMotion {
    /// World position and velocity of a point of rest space that is fixed to the head.
    pub fn carry(&self, p: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let arm = self.rotation * p;
        (arm + self.translation, self.velocity + self.spin.cross(&arm))
    }
}

/// A moment at which strands are rebuilt: the head, and what to keep out of.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Motion of the head.
    pub head: HeadMotion,
    /// The bodies; none where it holds none.
    pub obstacles: Obstacles<'a>,
}

/// How much earlier than the moment asked for a strand that leans on a body is rebuilt, s, to take its velocity from the
/// difference: the leaning has no derivative of its own.
pub const DIFFERENCE_STEP: f64 = 1e-4;

/// How much farther from its guide than at rest a strand may be and still be known to have no body near, from the guide alone.
const SPREAD: f64 = 1.5;

/// Speed of guides past bodies up to which their room need not be looked for again so soon before, m/s.
const SPEED: f64 = 20.0;

/// How the strands are and move at one moment: an entry per vertex of the curves given to [`Interpolator::new`].
#[derive(Debug, Clone, PartialEq)]
pub struct StrandMotion {
    /// Points.
    pub points: Vec<[f32; 3]>,
    /// Velocities, per second.
    pub velocities: Vec<[f32; 3]>,
}

impl StrandMotion {
    fn new(vertices: usize) -> Self {
        StrandMotion { points: vec![[0.0; 3]; vertices], velocities: vec![[0.0; 3]; vertices] }
    }
}

/// Retractions of the strands at the frames around one, from [`RETRACTION_SPAN`] before it to [`RETRACTION_SPAN`] after; see [`Interpolator::evaluate_unretracted`].
pub type Retractions<'a> = [&'a [f32]; 2 * RETRACTION_SPAN + 1];

impl Interpolator {
    /// Prepares the strands `curves` to follow `guides`, each as `follows` tells.
    ///
    /// `bodies` at rest, with what is kept from each (`thickness`, m), tell how close to them each strand was drawn.
    pub fn new(
        curves: &Curves,
        follows: Vec<GuideWeights>,
        guides: &[&Rod],
        bodies: &Bodies,
        thickness: &[f64],
    ) -> Self {
        let rest: Vec<RestGuide> = guides.par_iter().map(|rod| RestGuide::new(rod)).collect();
        let strands: Vec<Strand> = follows
            .into_par_iter()
            .enumerate()
            .map(|(c, follows)| Strand::new(curves.curve(c), follows, &rest, bodies, thickness))
            .collect();
        let mut reach = vec![0.0_f64; rest.len()];
        for strand in &strands {
            let guide = strand.nearest();
            reach[guide] = reach[guide].max(strand.reach(&rest[guide]));
        }
        reach.iter_mut().for_each(|reach| *reach = SPREAD * *reach + keep_out::REACH);
        Interpolator { strands, offsets: curves.offsets.clone(), guides: rest, reach }
    }

    /// Number of vertices of all strands.
    pub fn vertices(&self) -> usize {
        self.offsets.last().copied().unwrap_or(0)
    }

    /// The guide that each strand follows most, by index.
    pub fn main_guides(&self) -> impl Iterator<Item = usize> {
        self.strands.iter().map(Strand::nearest)
    }

    /// How the strands are at a moment of a frame if none retreats from a body, and by which share (0..=1) of its way from its guide each
    /// vertex has to. `moments` are now and [`DIFFERENCE_STEP`] earlier; `to_scene` turns metres, Y up, into the unit and axes asked for.
    pub fn evaluate_unretracted(
        &self,
        moments: &[Moment; 2],
        guides: &[GuideMotion],
        to_scene: &Matrix3<f64>,
    ) -> (StrandMotion, Vec<f32>) {
        let stands = self.stands(moments, guides);
        let (mut laid, mut retreats) = (StrandMotion::new(self.vertices()), vec![0.0; self.vertices()]);
        let strands = self.strands.iter().zip(self.cut_moving(&mut laid).zip(self.cut(&mut retreats)));
        each(strands.collect(), moments, &stands, true, |strand, traces, (out, retreats)| {
            strand.retreat(&moments[0], &stands[0], &mut traces[0], retreats);
            traces.iter_mut().for_each(|trace| trace.stay(retreats.len()));
            strand.settle(moments, &stands, traces);
            write(to_scene, &traces[0].track, out);
        });
        (laid, retreats)
    }

    /// By which share of its way from its guide each vertex has to retreat, as [`Interpolator::evaluate_unretracted`] tells.
    pub fn retractions(&self, moments: &[Moment; 2], guides: &[GuideMotion]) -> Vec<f32> {
        let stands = self.stands(moments, guides);
        let mut retreats = vec![0.0; self.vertices()];
        let strands = self.strands.iter().zip(self.cut(&mut retreats)).collect();
        each(strands, moments, &stands, false, |strand, traces, retreats| {
            strand.retreat(&moments[0], &stands[0], &mut traces[0], retreats);
        });
        retreats
    }

    /// How the strands are at a moment that is `after` (0..1) of the `interval`, s, from a frame to the next; `retreats` are those of the frames around
    /// that frame, and `laid` how they are if none retreats, where that is known; all else as for [`Interpolator::evaluate_unretracted`].
    pub fn evaluate(
        &self,
        moments: &[Moment; 2],
        guides: &[GuideMotion],
        (retreats, after, interval): (&Retractions, f64, f64),
        to_scene: &Matrix3<f64>,
        laid: Option<StrandMotion>,
    ) -> StrandMotion {
        let known = laid.is_some();
        let mut out = laid.unwrap_or_else(|| StrandMotion::new(self.vertices()));
        let retreat_at =
            |w: &[usize]| retreats.iter().any(|r| r[w[0]..w[1]].iter().any(|share| *share != 0.0));
        let strands = self.strands.iter().zip(self.offsets.windows(2).zip(self.cut_moving(&mut out)));
        let strands: Vec<_> = strands.filter(|(_, (w, _))| !known || retreat_at(w)).collect();
        if strands.is_empty() {
            return out;
        }
        let stands = self.stands(moments, guides);
        each(strands, moments, &stands, true, |strand, traces, (w, out)| {
            traces.iter_mut().for_each(|trace| trace.stay(w[1] - w[0]));
            // Few strands retreat.
            for i in (w[0]..w[1]).take_while(|_| retreat_at(w)) {
                let (share, change) = retreat::smoothed(retreats.map(|r| f64::from(r[i])), after);
                traces[0].retreat[i - w[0]] = share;
                traces[1].retreat[i - w[0]] = share - change * DIFFERENCE_STEP / interval;
            }
            strand.settle(moments, &stands, traces);
            write(to_scene, &traces[0].track, out);
        });
        out
    }

    /// How the guides stand now and [`DIFFERENCE_STEP`] earlier.
    fn stands(&self, moments: &[Moment; 2], guides: &[GuideMotion]) -> [Vec<Stand>; 2] {
        let q: Vec<Vec<f64>> = guides.iter().map(earlier).collect();
        let earlier: Vec<_> = guides.iter().zip(&q).map(|(g, q)| GuideMotion { q, ..*g }).collect();
        let room = |x: &Vector3<f64>, (i, _): (usize, usize)| moments[0].obstacles.room(x, self.reach[i]);
        let now = self.stand(&moments[0].head, guides, room);
        // So soon before the bodies have hardly moved.
        let room = |_: &Vector3<f64>, (i, k): (usize, usize)| now[i].room[k] - DIFFERENCE_STEP * SPEED;
        let before = self.stand(&moments[1].head, &earlier, room);
        [now, before]
    }

    /// How the guides stand; `room` tells it for a point of a guide, by the indices of both.
    fn stand(
        &self,
        head: &HeadMotion,
        guides: &[GuideMotion],
        room: impl Fn(&Vector3<f64>, (usize, usize)) -> f64 + Sync,
    ) -> Vec<Stand> {
        guides
            .par_iter()
            .zip(&self.guides)
            .with_min_len(16)
            .enumerate()
            .map_init(RodShape::default, |shape, (i, (g, rest))| {
                shape.update(g.rod, &(head.rotation * g.rod.root.r), g.q);
                let (root, _) = head.carry(&g.rod.root.p);
                let x: Vec<_> = (0..shape.points()).map(|k| root + shape.x(k)).collect();
                Stand {
                    room: x.iter().enumerate().map(|(k, x)| room(x, (i, k))).collect(),
                    x,
                    turned: rest.turned(g.q, g.rate),
                }
            })
            .collect()
    }

    fn cut_moving<'a>(
        &'a self,
        moving: &'a mut StrandMotion,
    ) -> impl Iterator<Item = [&'a mut [[f32; 3]]; 2]> {
        self.cut(&mut moving.points).zip(self.cut(&mut moving.velocities)).map(|(p, v)| [p, v])
    }

    /// An array with an entry per vertex, in the strands' parts.
    fn cut<'a, T>(&'a self, mut array: &'a mut [T]) -> impl Iterator<Item = &'a mut [T]> {
        self.offsets.windows(2).map(move |w| {
            let (own, others) = std::mem::take(&mut array).split_at_mut(w[1] - w[0]);
            array = others;
            own
        })
    }
}

/// How a guide stands at a moment, point by point of its rod.
#[derive(Debug)]
struct Stand {
    /// Where it is, world, m.
    x: Vec<Vector3<f64>>,
    /// How far all bodies are from there at least, m.
    room: Vec<f64>,
    /// How it has turned from rest, and at which rate, segment by segment.
    turned: Vec<Turned>,
}

/// The deviation of a guide [`DIFFERENCE_STEP`] before its motion's own moment, 1/m.
fn earlier(guide: &GuideMotion) -> Vec<f64> {
    guide.q.iter().zip(guide.rate).map(|(q, rate)| q - rate * DIFFERENCE_STEP).collect()
}

impl Stand {
    /// A place of it, world, m.
    fn at(&self, place: Place) -> Vector3<f64> {
        place.of(|k| self.x[k])
    }

    /// How far all bodies are from `x` at least, m, as far as the guide beside it tells. It costs no search.
    fn room_at(&self, place: Place, x: &Vector3<f64>) -> f64 {
        let k = place.nearest();
        self.room[k] - (x - self.x[k]).norm()
    }

    /// Whether no body is within `keep`, m, of `x`, by that.
    fn clears(&self, place: Place, x: &Vector3<f64>, keep: f64) -> bool {
        self.room_at(place, x) > keep
    }
}

/// Does with each strand, in parallel, what `then` does with its traces, in the first of which it is as it would be without bodies at the first of the
/// moments; with its velocities, if it is `moving`.
fn each<T: Send>(
    mut strands: Vec<(&Strand, T)>,
    moments: &[Moment; 2],
    stands: &[Vec<Stand>; 2],
    moving: bool,
    then: impl Fn(&Strand, &mut [Trace; 2], &mut T) + Sync,
) {
    let works = <([Vec<Track>; MAX_LANES], [Trace; 2])>::default;
    strands.par_chunks_mut(MAX_LANES).with_min_len(8).for_each_init(works, |(free, traces), strands| {
        free::free(strands.iter().map(|(strand, _)| *strand), &moments[0].head, &stands[0], moving, free);
        for ((strand, with), free) in strands.iter_mut().zip(free) {
            std::mem::swap(&mut traces[0].free, free);
            then(strand, traces, with);
        }
    });
}

fn write(to_scene: &Matrix3<f64>, track: &[Track], [points, velocities]: &mut [&mut [[f32; 3]]; 2]) {
    for ((p, v), (x, dx)) in points.iter_mut().zip(velocities.iter_mut()).zip(track) {
        (*p, *v) = (single(&(to_scene * x)), single(&(to_scene * dx)));
    }
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    v.cast::<f32>().into()
}
