//! One render strand: as it would be without bodies, and laid outside them.

use super::follow::{Follow, Place, RestGuide};
use super::keep_out::{KeepOut, Kept, Lean, Spare};
use super::relax::relax;
use super::{GuideMotion, HeadMotion, Moment, Stand};
use crate::contact::Bodies;
use crate::math::frame::{any_frame, transport};
use crate::math::se3;
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Tangent of the angle at which a strand comes to its guide, or goes from it, because of a body, at most. More, and strands cannot
/// follow and go through; less, and what one place asks for is seen far from it.
const SLOPE: f64 = 0.25;

/// Violation of a clearance beyond which a vertex that has been turned out asks for more retreat, m.
const TOO_DEEP: f64 = 1.5e-3;

/// Times that the strand is laid to see whether it asks for more.
const CORRECTIONS: usize = 2;

/// A render strand at rest: root, frame of the first edge, then for every edge its length and the turn into it from
/// the edge before (rotation vector in the material frame; zero for the first).
#[derive(Debug, Clone)]
pub(super) struct Strand {
    root: Vector3<f64>,
    frame: Matrix3<f64>,
    turn: Vec<Vector3<f64>>,
    length: Vec<f64>,
    /// The guides; what bodies are concerned, the first stands for all.
    follow: Vec<Follow>,
    /// Place of the first guide that is beside each vertex.
    beside: Vec<Place>,
    /// Whether a body lies between that and the vertex at rest.
    apart: Vec<bool>,
    kept: Kept,
}

/// A strand at one moment.
#[derive(Debug, Default)]
pub(super) struct Trace {
    /// Share of its way from its guide by which each vertex retreats (0..=1).
    pub retreat: Vec<f64>,
    /// Points and velocities, world, m and m/s.
    pub track: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Whether it leans on a body: the velocities are then those that it would have without.
    pub leans: bool,
    /// Distance of each vertex from the guide, where there are no bodies, m.
    offset: Vec<f64>,
    /// Vertices that came to lie too deep in a body.
    deep: Vec<usize>,
    spare: [Spare; 2],
}

impl Strand {
    /// For a strand drawn at `points`, m, that follows the guides `near`: distance of their roots, m, and index.
    pub fn new(
        points: &[Vector3<f64>],
        near: &[(f64, usize)],
        rest: &[RestGuide],
        bodies: &Bodies,
        thickness: &[f64],
    ) -> Self {
        let edges: Vec<Vector3<f64>> = points.windows(2).map(|w| w[1] - w[0]).collect();
        let length: Vec<f64> = edges.iter().map(|e| e.norm()).collect();
        // An edge of no length keeps the direction of its predecessor.
        let mut direction = edges.iter().find_map(|e| e.try_normalize(0.0)).unwrap_or(Vector3::z());
        let mut frames: Vec<Matrix3<f64>> = Vec::with_capacity(edges.len());
        let mut turn = Vec::with_capacity(edges.len());
        for e in &edges {
            direction = e.try_normalize(1e-12).unwrap_or(direction);
            let frame = match frames.last() {
                None => any_frame(&direction),
                Some(last) => transport(&last.column(2).into(), &direction) * last,
            };
            turn.push(
                frames.last().map_or(Vector3::zeros(), |last| se3::log_so3(&(last.transpose() * frame))),
            );
            frames.push(frame);
        }
        // Roots closer than this to a guide's follow that guide alone, smoothly.
        let soft = 1e-4;
        let weights: Vec<f64> = near.iter().map(|(d, _)| 1.0 / (d * d + soft * soft)).collect();
        let sum: f64 = weights.iter().sum();
        let follow = near
            .iter()
            .zip(&weights)
            .map(|((_, g), w)| Follow::new(*g, w / sum, &rest[*g], &frames, &turn, &length))
            .collect();
        let first = &rest[near[0].1];
        // Past the end of a shorter guide there would be nothing to retreat to.
        let pace = (first.length() / length.iter().sum::<f64>()).min(1.0);
        let mut arc = 0.0;
        let mut beside = vec![first.place(0.0)];
        for l in &length {
            arc += l * pace;
            beside.push(first.place(arc));
        }
        let poses = vec![Isometry3::identity(); thickness.len()];
        let at_rest = KeepOut { bodies, time: 0.0, poses: &poses };
        let apart = |(x, place): (&Vector3<f64>, &Place)| at_rest.retreat(&first.at(*place), x) > 0.0;
        Strand {
            root: points[0],
            frame: frames[0],
            turn,
            length,
            follow,
            apart: points.iter().zip(&beside).map(apart).collect(),
            beside,
            kept: Kept::new(bodies, thickness, points),
        }
    }

    /// The guide of nearest root, by index.
    pub fn nearest(&self) -> usize {
        self.follow[0].guide
    }

    /// The strand as it would be without bodies, edge by edge from the root; `each` gets the start and the end of every edge with their
    /// velocities, which mean nothing where they are not asked for (`moving`).
    fn free(
        &self,
        head: &HeadMotion,
        guides: &[GuideMotion],
        moving: bool,
        mut each: impl FnMut(usize, [(Vector3<f64>, Vector3<f64>); 2]),
    ) {
        let (mut x, mut v) = head.carry(&self.root);
        let mut frame = head.rotation * self.frame;
        let mut spin = head.spin;
        for (j, (turn, &length)) in self.turn.iter().zip(&self.length).enumerate() {
            let phi = self.follow.iter().fold(*turn, |phi, f| phi + f.turn(j, guides[f.guide].q));
            if moving {
                let rate: Vector3<f64> = self.follow.iter().map(|f| f.turn(j, guides[f.guide].rate)).sum();
                spin += frame * (se3::left_jacobian_so3(&phi) * rate);
            }
            frame *= se3::exp_so3(&phi);
            let start = (x, v);
            let edge = frame.column(2) * length;
            x += edge;
            v += spin.cross(&edge);
            each(j, [start, (x, v)]);
        }
    }

    /// By how much each vertex has to retreat, into `trace.retreat`: for what lies between it and its guide, and wholly where the
    /// strand so laid still comes to lie too deep.
    pub fn retreat(&self, moment: &Moment, guides: &[GuideMotion], stands: &[Stand], trace: &mut Trace) {
        let stand = &stands[self.follow[0].guide];
        let Trace { retreat, offset, .. } = trace;
        retreat.clear();
        offset.clear();
        let mut see = |vertex: usize, x: &Vector3<f64>| {
            let place = self.beside[vertex];
            let guide = stand.at(place);
            offset.push((x - guide).norm());
            // A guide that is itself inside does not tell.
            let outside = stand.room[place.nearest()] > 0.0;
            let hidden = outside && !self.apart[vertex] && !stand.clears(place, x, 0.0);
            retreat.push(if hidden { moment.keep_out.retreat(&guide, x) } else { 0.0 });
        };
        see(0, &moment.head.carry(&self.root).0);
        self.free(&moment.head, guides, false, |j, [_, (x, _)]| see(j + 1, &x));
        if retreat.iter().all(|share| *share == 0.0) {
            return;
        }
        self.spread(trace);
        for _ in 0..CORRECTIONS {
            self.trace(moment, guides, stands, false, trace);
            if trace.deep.is_empty() {
                break;
            }
            for &j in &trace.deep {
                trace.retreat[j] = 1.0;
            }
            self.spread(trace);
        }
    }

    /// Spreads retreats along the strand: it needs some length to come to its guide, and to go from it.
    fn spread(&self, trace: &mut Trace) {
        let Trace { retreat, offset, .. } = trace;
        let fall = |j: usize| SLOPE * self.length[j - 1] / offset[j].max(offset[j - 1]).max(1e-9);
        for j in 1..retreat.len() {
            retreat[j] = retreat[j].max(retreat[j - 1] - fall(j));
        }
        for j in (1..retreat.len()).rev() {
            retreat[j - 1] = retreat[j - 1].max(retreat[j] - fall(j));
        }
    }

    /// Rebuilds the strand at a moment, with the retreats in `trace`; the guides stand as in `stands`. Velocities mean nothing where they
    /// are not asked for (`moving`).
    pub fn trace(
        &self,
        moment: &Moment,
        guides: &[GuideMotion],
        stands: &[Stand],
        moving: bool,
        trace: &mut Trace,
    ) {
        let Moment { head, keep_out } = moment;
        let stand = &stands[self.follow[0].guide];
        let Trace { retreat, track, deep, spare, .. } = trace;
        for spare in spare.iter_mut() {
            spare.clear();
            spare.resize(keep_out.poses.len(), 0.0);
        }
        let [spare, spare_leaning] = spare;
        let mut lean: Option<Lean> = None;
        track.clear();
        track.push(head.carry(&self.root));
        deep.clear();
        self.free(head, guides, moving, |j, [(start, _), (end, v)]| {
            let (length, place) = (self.length[j], (j + 1, self.length.len() + 1));
            let [from, to] = [j, j + 1].map(|k| self.beside[k]);
            let clear = |x: &Vector3<f64>| stand.clears(to, x, self.kept.most());
            if lean.is_none() {
                let too_near = if clear(&end) {
                    // It was not looked how far the bodies are.
                    spare.iter_mut().for_each(|spare| *spare -= length);
                    false
                } else {
                    keep_out.violation(&self.kept, place, &end, length, spare).0 > 0.0
                };
                lean = (too_near || retreat[j + 1] > 0.0).then_some(Lean(start));
            }
            let x = lean.as_mut().map_or(end, |lean| {
                let aim = [start.lerp(&stand.at(from), retreat[j]), end.lerp(&stand.at(to), retreat[j + 1])];
                // Where retreats come together, as the strand would go without bodies.
                let way = [aim[1] - aim[0], end - start].into_iter().find_map(|way| way.try_normalize(1e-9));
                // An edge of no length needs no direction.
                let way = way.unwrap_or_default();
                if lean.advance(keep_out, &self.kept, (place, length), (&aim[0], &way), clear, spare_leaning)
                    > TOO_DEEP
                {
                    deep.push(j + 1);
                }
                lean.0
            });
            track.push((x, v));
        });
        trace.leans = lean.is_some();
    }

    /// Moves a strand that was traced out of bodies where it lies too deep in one.
    pub fn relax(&self, keep_out: &KeepOut, trace: &mut Trace) {
        let Some(&last) = trace.deep.last() else { return };
        let mut x: Vec<_> = trace.track.iter().map(|(x, _)| *x).collect();
        let vertices = x.len();
        let push = |k: usize, x: &Vector3<f64>| keep_out.pushed_out(&self.kept, (k, vertices), x, TOO_DEEP);
        relax(&mut x, &self.length, last, push);
        trace.track.iter_mut().zip(x).for_each(|(track, x)| track.0 = x);
    }
}
