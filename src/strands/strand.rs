//! One render strand: as it would be without bodies, and laid outside them.

use super::follow::{Place, RestGuide};
use super::free::free;
use super::keep_out::{Kept, Lean, Obstacles, Spare};
use super::relax::relax;
use super::{DIFFERENCE_STEP, GuideWeights, MAX_GUIDES, Moment, Stand};
use crate::contact::Bodies;
use nalgebra::{Isometry3, Vector3};
use std::{iter, slice};

/// Tangent of the angle at which a strand comes to its guide, or goes from it, because of a body, at most. More, and strands cannot
/// follow and go through; less, and what one place asks for is seen far from it.
const SLOPE: f64 = 0.25;

/// Violation of a clearance beyond which a vertex that has been turned out asks for more retreat, m.
const TOO_DEEP: f64 = 1.5e-3;

/// Times that the strand is laid to see whether it asks for more.
const CORRECTIONS: usize = 2;

/// A render strand at rest.
#[derive(Debug, Clone)]
pub(super) struct Strand {
    pub root: Vector3<f64>,
    /// The guides by index, with their weights; what bodies are concerned, the first stands for all.
    follow: GuideWeights,
    pub edges: Vec<Edge>,
    /// Place of the first guide that is beside the root.
    beside: Place,
    /// Whether a body lies between that and the root at rest.
    apart: bool,
    kept: Kept,
}

/// An edge of a strand at rest, and the vertex at its end.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    /// From its start to its end, m, rest space: single, as it will be written, for much of the time goes into reading edges.
    way: Vector3<f32>,
    /// Where on each guide its middle is: at the same arc length.
    middle: [Place; MAX_GUIDES],
    /// Place of the first guide that is beside the end.
    beside: Place,
    /// Whether a body lies between that and the end at rest.
    apart: bool,
}

impl Edge {
    /// From its start to its end, m, rest space.
    #[inline(always)]
    pub fn way(&self) -> Vector3<f64> {
        self.way.cast()
    }

    /// Length, m.
    fn length(&self) -> f64 {
        self.way().norm()
    }
}

/// A point and its velocity, world, m and m/s.
pub(super) type Track = (Vector3<f64>, Vector3<f64>);

/// A strand at one moment.
#[derive(Debug, Default)]
pub(super) struct Trace {
    /// Share of its way from its guide by which each vertex retreats (0..=1).
    pub retreat: Vec<f64>,
    /// How it would be without bodies.
    pub free: Vec<Track>,
    /// How it is.
    pub track: Vec<Track>,
    /// Whether it leans on a body: the velocities are then those that it would have without.
    leans: bool,
    /// Distance of each vertex from the guide, where there are no bodies, m.
    offset: Vec<f64>,
    /// Vertices that came to lie too deep in a body.
    deep: Vec<usize>,
    spare: [Spare; 2],
}

impl Trace {
    /// Of a strand with so many vertices, none of which retreats.
    pub fn stay(&mut self, vertices: usize) {
        self.retreat.clear();
        self.retreat.resize(vertices, 0.0);
    }
}

impl Strand {
    /// For a strand drawn at `points`, m, that follows these guides.
    pub fn new(
        points: &[Vector3<f64>],
        follow: GuideWeights,
        rest: &[RestGuide],
        bodies: &Bodies,
        thickness: &[f64],
    ) -> Self {
        let first = &rest[follow[0].0];
        let ways = points.windows(2).map(|w| w[1] - w[0]);
        // Past the end of a shorter guide there would be nothing to retreat to.
        let pace = (first.length() / ways.clone().map(|way| way.norm()).sum::<f64>()).min(1.0);
        let poses = vec![Isometry3::identity(); thickness.len()];
        let at_rest = Obstacles { bodies, time: 0.0, poses: &poses };
        let apart = |x: &Vector3<f64>, place| at_rest.retreat((&first.at(place), 0.0), x) > 0.0;
        let mut arc = 0.0;
        let edge = |(way, end): (Vector3<f64>, &Vector3<f64>)| {
            let length = way.norm();
            let middle = arc + 0.5 * length;
            arc += length;
            let beside = first.place(arc * pace);
            let middle = std::array::from_fn(|i| rest[follow[i.min(follow.len() - 1)].0].place(middle));
            Edge { way: way.cast(), middle, beside, apart: apart(end, beside) }
        };
        let edges = ways.zip(&points[1..]).map(edge).collect();
        let beside = first.place(0.0);
        let apart = apart(&points[0], beside);
        Strand { root: points[0], follow, edges, beside, apart, kept: Kept::new(bodies, thickness, points) }
    }

    /// The guide that it follows most, by index.
    pub fn nearest(&self) -> usize {
        self.follow[0].0
    }

    /// How far it is from the place beside it on the first guide, m, rest space, at most.
    pub fn reach(&self, rest: &RestGuide) -> f64 {
        let mut x = self.root;
        let mut far = (x - rest.at(self.beside)).norm();
        for edge in &self.edges {
            x += edge.way();
            far = far.max((x - rest.at(edge.beside)).norm());
        }
        far
    }

    /// What its guides have turned by up to the middle of edge `j`, rad, rest space, and the rate of that, 1/s.
    #[inline(always)]
    pub fn sum(&self, j: usize, stands: &[Stand]) -> [f64; 6] {
        let mut sum = [0.0; 6];
        for ((guide, weight), middle) in self.follow.iter().zip(self.edges[j].middle) {
            let part = middle.sum(&stands[*guide].turned);
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part * weight);
        }
        sum
    }

    /// By how much each vertex of the strand, which would be as in `trace.free`, has to retreat, into `out`, which is 0: for what lies between it and its
    /// guide, and wholly where the strand so laid still comes to lie too deep.
    pub fn retreat(&self, moment: &Moment, stands: &[Stand], trace: &mut Trace, out: &mut [f32]) {
        if moment.obstacles.poses.is_empty() {
            return;
        }
        let stand = &stands[self.nearest()];
        let Trace { free, retreat, offset, .. } = trace;
        retreat.clear();
        offset.clear();
        let places = iter::once((self.beside, self.apart));
        let places = places.chain(self.edges.iter().map(|edge| (edge.beside, edge.apart)));
        for ((place, apart), (x, _)) in places.zip(free) {
            let guide = stand.at(place);
            offset.push((*x - guide).norm());
            // A guide that is itself inside does not tell.
            let outside = stand.room[place.nearest()] > 0.0;
            let hidden = outside && !apart && !stand.clears(place, x, 0.0);
            let room = stand.room_at(place, &guide);
            retreat.push(if hidden { moment.obstacles.retreat((&guide, room), x) } else { 0.0 });
        }
        if retreat.iter().all(|share| *share == 0.0) {
            return;
        }
        self.spread(trace);
        for _ in 0..CORRECTIONS {
            self.lay(moment, stands, trace);
            if trace.deep.is_empty() {
                break;
            }
            for &j in &trace.deep {
                trace.retreat[j] = 1.0;
            }
            self.spread(trace);
        }
        out.iter_mut().zip(&trace.retreat).for_each(|(out, share)| *out = *share as f32);
    }

    /// Spreads retreats along the strand: it needs some length to come to its guide, and to go from it.
    fn spread(&self, trace: &mut Trace) {
        let Trace { retreat, offset, .. } = trace;
        let fall = |j: usize| SLOPE * self.edges[j - 1].length() / offset[j].max(offset[j - 1]).max(1e-9);
        for j in 1..retreat.len() {
            retreat[j] = retreat[j].max(retreat[j - 1] - fall(j));
        }
        for j in (1..retreat.len()).rev() {
            retreat[j - 1] = retreat[j - 1].max(retreat[j] - fall(j));
        }
    }

    /// Lays the strand, which would be as in `trace.free`, outside the bodies, with the retreats in `trace`; the guides stand as in `stands`.
    fn lay(&self, moment: &Moment, stands: &[Stand], trace: &mut Trace) {
        let obstacles = &moment.obstacles;
        let stand = &stands[self.nearest()];
        let Trace { free, retreat, track, deep, spare, .. } = trace;
        for spare in spare.iter_mut() {
            spare.clear();
            spare.resize(obstacles.poses.len(), 0.0);
        }
        let [spare, spare_leaning] = spare;
        let mut lean: Option<Lean> = None;
        track.clear();
        track.push(free[0]);
        deep.clear();
        let mut from = self.beside;
        for (j, edge) in self.edges.iter().enumerate() {
            let [(start, _), (end, v)] = [free[j], free[j + 1]];
            let (length, to) = (edge.length(), edge.beside);
            let place = (j + 1, self.edges.len() + 1);
            let clear = |x: &Vector3<f64>| stand.clears(to, x, self.kept.most());
            if lean.is_none() {
                let too_near = if clear(&end) {
                    // It was not looked how far the bodies are.
                    spare.iter_mut().for_each(|spare| *spare -= length);
                    false
                } else {
                    obstacles.violation(&self.kept, place, &end, length, spare).0 > 0.0
                };
                lean = (too_near || retreat[j + 1] > 0.0).then_some(Lean(start));
            }
            let x = lean.as_mut().map_or(end, |lean| {
                let aim = [start.lerp(&stand.at(from), retreat[j]), end.lerp(&stand.at(to), retreat[j + 1])];
                // Where retreats come together, as the strand would go without bodies.
                let way = [aim[1] - aim[0], end - start].into_iter().find_map(|way| way.try_normalize(1e-9));
                // An edge of no length needs no direction.
                let way = way.unwrap_or_default();
                if lean.advance(obstacles, &self.kept, (place, length), (&aim[0], &way), clear, spare_leaning)
                    > TOO_DEEP
                {
                    deep.push(j + 1);
                }
                lean.0
            });
            from = to;
            track.push((x, v));
        }
        trace.leans = lean.is_some();
    }

    /// Lays the strand at two moments [`DIFFERENCE_STEP`] apart, with the retreats in both traces; it would be as in `now.free` at the first. `now.track` is then where it is
    /// and how it moves.
    pub fn settle(&self, moments: &[Moment; 2], stands: &[Vec<Stand>; 2], [now, before]: &mut [Trace; 2]) {
        self.lay(&moments[0], &stands[0], now);
        if !now.leans {
            return;
        }
        free(iter::once(self), &moments[1].head, &stands[1], false, slice::from_mut(&mut before.free));
        self.lay(&moments[1], &stands[1], before);
        self.relax(&moments[0].obstacles, now);
        self.relax(&moments[1].obstacles, before);
        for (now, before) in now.track.iter_mut().zip(&before.track) {
            now.1 = (now.0 - before.0) / DIFFERENCE_STEP;
        }
    }

    /// Moves a strand that was laid out of bodies where it lies too deep in one.
    fn relax(&self, obstacles: &Obstacles, trace: &mut Trace) {
        let Some(&last) = trace.deep.last() else { return };
        let mut x: Vec<_> = trace.track.iter().map(|(x, _)| *x).collect();
        let vertices = x.len();
        let push = |k: usize, x: &Vector3<f64>| obstacles.pushed_out(&self.kept, (k, vertices), x, TOO_DEEP);
        let length: Vec<f64> = self.edges.iter().map(Edge::length).collect();
        relax(&mut x, &length, last, push);
        trace.track.iter_mut().zip(x).for_each(|(track, x)| track.0 = x);
    }
}
