//! One render strand at one moment: its free chain, its retractions and its projected chain.

use super::chain::{Edge, RestChain, Vertex};
use super::clearances::{Clearances, DistanceBounds};
use super::curl::{IN_PHASE, Winding, about};
use super::deflection::{Deflection, deflected, deflection};
use super::fabrik::relax;
use super::free_chain::{Lay, lay, rotations};
use super::guide_place::GuidePlace;
use super::obstacles::{InsidePoint, Keep, Leaving, Obstacles};
use super::posed_guide::{PosedGuide, PosedGuides};
use super::projected_chain::{NextEdge, ProjectedChain};
use super::rest_guide::RestGuide;
use crate::contact::Bodies;
use nalgebra::{Isometry3, Vector3};
use std::{iter, slice};

/// Largest slope at which a retracted strand approaches or leaves its guide. Steeper, strands cannot follow
/// and pass through; shallower, a local retraction is seen far away.
const SLOPE: f64 = 0.25;

/// Violation of a clearance beyond which a projected vertex is retracted further, m.
const MAX_VIOLATION: f64 = 1.5e-3;

/// Number of times that the chain is laid to find further retractions.
const CORRECTIONS: usize = 2;

/// A render strand.
#[derive(Debug, Clone)]
pub(super) struct Strand {
    pub chain: RestChain,
    /// The place on the first guide that corresponds to the root.
    beside: GuidePlace,
    /// Whether a body separates that place from the root at rest.
    separated: bool,
    clearances: Clearances,
}

/// Workspace and result of one strand at one moment.
#[derive(Debug, Default)]
pub(super) struct StrandState {
    /// Fraction (0..=1) of its path from the guide by which each vertex is retracted.
    pub retraction: Vec<f64>,
    /// The free chain.
    pub free: Vec<Vertex>,
    /// The result: the free chain up to the first vertex that needs projection, then the projected chain.
    pub vertices: Vec<Vertex>,
    /// Whether part of the result is projected. Its velocities are still those of the free chain then.
    is_projected: bool,
    /// Distance of each vertex of the free chain from its place on the guide, m.
    guide_distance: Vec<f64>,
    /// How it leaves parts that have swallowed its root.
    leaving: Vec<Leaving>,
    /// Vertices that violate a clearance by more than [`MAX_VIOLATION`].
    violating: Vec<usize>,
    bounds: Bounds,
}

#[derive(Debug, Default)]
struct Bounds {
    free: DistanceBounds,
    projected: DistanceBounds,
}

impl StrandState {
    /// No retraction of a strand with `vertices` vertices.
    pub fn clear_retraction(&mut self, vertices: usize) {
        self.retraction.clear();
        self.retraction.resize(vertices, 0.0);
    }
}

impl Strand {
    /// Strand `index`, with `points` in the groom, m, that follows the guide `main`, and `others`: pairs with
    /// the main guide and weights. Also the largest distance of its vertices from their places on the main
    /// guide at rest, m.
    pub fn new(
        (index, points): (usize, &[Vector3<f64>]),
        main: usize,
        others: Vec<(usize, f64)>,
        rest: &[RestGuide],
        bodies: &Bodies,
        thickness: &[f64],
    ) -> (Self, f64) {
        let first = &rest[main];
        let arc: Vec<f64> = iter::once(0.0)
            .chain(points.windows(2).scan(0.0, |arc, ends| {
                *arc += (ends[1] - ends[0]).norm();
                Some(*arc)
            }))
            .collect();
        // A strand longer than its guide corresponds to it by arc-length fraction, so that all of it can be
        // retracted.
        let pace = (first.length() / arc[arc.len() - 1]).min(1.0);
        let poses = vec![Isometry3::identity(); thickness.len()];
        let at_rest = Obstacles { bodies, time: 0.0, poses: &poses };
        let separated = |x: &Vector3<f64>, place| at_rest.retraction((&first.position(place), 0.0), x) > 0.0;
        let place = |s: f64| first.place(s * pace);
        let midpoints: Vec<f64> = arc.windows(2).map(|ends| 0.5 * (ends[0] + ends[1])).collect();
        let mut vectors: Vec<_> = points.windows(2).map(|ends| ends[1] - ends[0]).collect();
        let mut half_phases = Vec::new();
        if let Some(winding) = first.winding() {
            let own = Winding::new(&arc, winding.turn() / pace, midpoints.iter().copied());
            let phase = |((vector, axis), s): ((&Vector3<f64>, Vector3<f64>), &f64)| {
                let tangent = vector.try_normalize(0.0)?;
                Some(first.half_phase(place(*s), &tangent, &axis))
            };
            let phases = vectors.iter().zip(own.means(points)).zip(&midpoints);
            half_phases.extend(phases.map(|edge| phase(edge).unwrap_or(IN_PHASE)));
            for ((vector, half), s) in vectors.iter_mut().zip(&half_phases).zip(&midpoints) {
                *vector = about(&first.axis(place(*s)), *half).rotate_back((*vector).into()).into();
            }
        }
        if half_phases.iter().all(|half| *half == IN_PHASE) {
            half_phases.clear();
        }
        let edges = (0..vectors.len()).map(|j| {
            let beside = place(arc[j + 1]);
            Edge::new(vectors[j], place(midpoints[j]), beside, separated(&points[j + 1], beside))
        });
        let edges = edges.collect();
        let beside = place(0.0);
        let guide_distance =
            points.iter().zip(&arc).map(|(x, s)| (x - first.position(place(*s))).norm()).fold(0.0, f64::max);
        let strand = Strand {
            separated: separated(&points[0], beside),
            chain: RestChain { strand: index, root: points[0], main, others, edges, half_phases },
            beside,
            clearances: Clearances::new(bodies, thickness, points),
        };
        (strand, guide_distance)
    }

    /// Sets `out`, which is zero, to the deflections that keep the strand outside the bodies, given the free
    /// chain in `state`.
    pub fn find_deflections(
        &self,
        obstacles: &Obstacles,
        guides: &PosedGuides,
        state: &mut StrandState,
        out: &mut [Deflection],
    ) {
        if obstacles.poses.is_empty() {
            return;
        }
        state.leaving = obstacles.leaving(&state.free);
        self.required_retractions(obstacles, &guides.guides[self.chain.main], state);
        if state.retraction.iter().any(|fraction| *fraction > 0.0) {
            self.spread(state);
        }
        self.lay(obstacles, guides, state);
        for _ in 0..CORRECTIONS {
            if state.violating.is_empty() {
                break;
            }
            for &j in &state.violating {
                state.retraction[j] = 1.0;
            }
            self.spread(state);
            self.lay(obstacles, guides, state);
        }
        if state.is_projected {
            self.relax(obstacles, state);
            self.deflections(guides, &state.vertices, out);
        }
    }

    /// Sets `out` to the deflections of `filtered`, and where these lead into a body, to those of the chain
    /// projected from there.
    pub fn settle(
        &self,
        obstacles: &Obstacles,
        guides: &PosedGuides,
        filtered: &[Vector3<f64>],
        state: &mut StrandState,
        out: &mut [Deflection],
    ) {
        let edges: Vec<_> = self.deflected(filtered.iter().map(|by| [*by, Vector3::zeros()])).collect();
        let chain = Lay { chain: &self.chain, deflected: &edges };
        lay(iter::once(chain), guides, false, slice::from_mut(&mut state.free));
        state.leaving = obstacles.leaving(&state.free);
        state.clear_retraction(out.len());
        self.lay(obstacles, guides, state);
        if state.is_projected {
            self.relax(obstacles, state);
            self.deflections(guides, &state.vertices, out);
        } else {
            out.iter_mut().zip(filtered).for_each(|(out, by)| *out = by.cast::<f32>().into());
        }
    }

    /// Its edges with deflections (one per vertex) and their rates.
    pub fn deflected(
        &self,
        deflections: impl Iterator<Item = [Vector3<f64>; 2]>,
    ) -> impl Iterator<Item = [Vector3<f64>; 2]> {
        let edges = self.chain.edges.iter().map(Edge::vector);
        edges.zip(deflections.skip(1)).map(|(edge, [by, rate])| deflected(&edge, &by, &rate))
    }

    /// The deflections of a chain with these vertices.
    fn deflections(&self, guides: &PosedGuides, vertices: &[Vertex], out: &mut [Deflection]) {
        let rotations = rotations(&self.chain, guides);
        let edges = vertices.windows(2).zip(rotations).zip(&self.chain.edges);
        for (((ends, rotation), edge), out) in edges.zip(&mut out[1..]) {
            let to = rotation.rotate_back((ends[1].x - ends[0].x).into()).into();
            *out = deflection(&edge.vector(), &to).cast::<f32>().into();
        }
    }

    /// The vertices at `points`, m, world, that the groom places outside the bodies and that are inside.
    pub(super) fn inside(
        &self,
        obstacles: &Obstacles,
        guides: &PosedGuides,
        points: impl Iterator<Item = Vector3<f64>>,
        bounds: &mut DistanceBounds,
    ) -> Vec<InsidePoint> {
        let guide = &guides.guides[self.chain.main];
        let place = |vertex: usize| match vertex {
            0 => self.beside,
            _ => self.chain.edges[vertex - 1].beside,
        };
        let is_clear = |vertex: usize, x: &Vector3<f64>| guide.is_clear(place(vertex), x, 0.0);
        obstacles.inside(&self.clearances, points, is_clear, bounds)
    }

    /// Sets the retractions in `state` to those required by bodies between each vertex and the guide.
    fn required_retractions(&self, obstacles: &Obstacles, guide: &PosedGuide, state: &mut StrandState) {
        let StrandState { free, retraction, guide_distance, .. } = state;
        retraction.clear();
        guide_distance.clear();
        let places = iter::once((self.beside, self.separated));
        let places = places.chain(self.chain.edges.iter().map(|edge| (edge.beside, edge.separated)));
        for ((place, separated), Vertex { x, .. }) in places.zip(free) {
            let from = guide.position(place);
            guide_distance.push((*x - from).norm());
            // A guide inside a body does not tell the side.
            let outside = guide.clear[place.nearest_point()] > 0.0;
            let hidden = outside && !separated && !guide.is_clear(place, x, 0.0);
            let clear = guide.distance_bound(place, &from);
            retraction.push(if hidden { obstacles.retraction((&from, clear), x) } else { 0.0 });
        }
    }

    /// Raises the retractions along the strand so that they change no faster than [`SLOPE`] allows.
    fn spread(&self, state: &mut StrandState) {
        let StrandState { retraction, guide_distance, .. } = state;
        let fall = |j: usize| {
            SLOPE * self.chain.edges[j - 1].length() / guide_distance[j].max(guide_distance[j - 1]).max(1e-9)
        };
        for j in 1..retraction.len() {
            retraction[j] = retraction[j].max(retraction[j - 1] - fall(j));
        }
        for j in (1..retraction.len()).rev() {
            retraction[j - 1] = retraction[j - 1].max(retraction[j] - fall(j));
        }
    }

    /// Sets the result in `state` from its free chain and retractions.
    fn lay(&self, obstacles: &Obstacles, guides: &PosedGuides, state: &mut StrandState) {
        let guide = &guides.guides[self.chain.main];
        let StrandState { free, retraction, vertices, violating, bounds, leaving, .. } = state;
        let keep = Keep { clearances: &self.clearances, leaving };
        bounds.free.reset(obstacles.poses.len());
        bounds.projected.reset(obstacles.poses.len());
        let mut projected: Option<ProjectedChain> = None;
        vertices.clear();
        vertices.push(free[0]);
        violating.clear();
        let mut from = self.beside;
        for (j, edge) in self.chain.edges.iter().enumerate() {
            let [start, Vertex { x: end, v }] = [free[j], free[j + 1]];
            let start = start.x;
            let (length, to, vertex) = (edge.length(), edge.beside, j + 1);
            let is_clear = |x: &Vector3<f64>| guide.is_clear(to, x, self.clearances.largest());
            if projected.is_none() {
                let violates = if is_clear(&end) {
                    bounds.free.move_by(length);
                    false
                } else {
                    obstacles.violation(&keep, vertex, &end, length, &mut bounds.free).depth > 0.0
                };
                projected = (violates || retraction[vertex] > 0.0).then_some(ProjectedChain { end: start });
            }
            let x = projected.as_mut().map_or(end, |chain| {
                // `docs/theory.md` eq. 7.4.
                let target = [
                    start.lerp(&guide.position(from), retraction[j]),
                    end.lerp(&guide.position(to), retraction[vertex]),
                ];
                // Where both targets coincide, the direction of the free chain; an edge of zero length needs
                // none.
                let vectors = [target[1] - target[0], end - start];
                let direction = vectors.into_iter().find_map(|vector| vector.try_normalize(1e-9));
                let direction = direction.unwrap_or_default();
                let next = NextEdge { vertex, length, direction, target: target[0] };
                let bounds = &mut bounds.projected;
                if chain.append(obstacles, &keep, &next, is_clear, bounds) > MAX_VIOLATION {
                    violating.push(vertex);
                }
                chain.end
            });
            from = to;
            vertices.push(Vertex { x, v });
        }
        state.is_projected = projected.is_some();
    }

    /// Relaxes a result that still violates clearances.
    fn relax(&self, obstacles: &Obstacles, state: &mut StrandState) {
        let Some(&last) = state.violating.last() else { return };
        let mut x: Vec<_> = state.vertices.iter().map(|vertex| vertex.x).collect();
        let keep = Keep { clearances: &self.clearances, leaving: &state.leaving };
        let push = |k: usize, x: &Vector3<f64>| obstacles.push_out(&keep, k, x, MAX_VIOLATION);
        let length: Vec<f64> = self.chain.edges.iter().map(Edge::length).collect();
        relax(&mut x, &length, last, push);
        state.vertices.iter_mut().zip(x).for_each(|(vertex, x)| vertex.x = x);
    }
}
