//! Ties: places of guides that a body holds, and turns with it where asked (`docs/theory.md` §4.10).

use super::contact_polyline::{on_rod, with_midpoints};
use super::reaction::TieReaction;
use crate::math::frame::any_frame;
use crate::rod::{Rod, RodShape};
use crate::scene::anim::{self, GuideSelection, TieOrientation, TiePoint};
use crate::scene::{Anim, Groom};
use crate::wisp::GuideRod;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Vector3};

/// Least length from the root to the held point, relative to the distance of the root from the goal: a
/// shorter one cannot reach it around the head.
const REACH: f64 = 1.1;
/// Largest speed at which a point is moved to its goal, m/s.
const MAX_GATHER_SPEED: f64 = 0.5;
/// Largest angular velocity at which a frame is turned to its goal, rad/s.
const MAX_GATHER_TURN: f64 = 5.0;
/// Largest distance of a place from the one held before it, as a share of the arc length between them, at which a
/// tie holds it, unless it is drawn farther.
const WITHIN_REACH: f64 = 0.999;
/// Distance along the axis of a ring, m, from which a tip has left it, and within which of the axis it was in it: what a
/// tie is off, and more.
const OUT: f64 = 1e-5;
/// Distance of a place from its goal, m, and angle between its frame and that of the goal, rad, at which it is there: more
/// than the tie is off.
const THERE: f64 = 1e-6;
/// Share of its length by which a place may be beyond the tip for rounding.
pub(super) const ROUNDING: f64 = 1e-6;

/// A held point of a guide.
#[derive(Debug, Clone, PartialEq)]
pub struct Tie {
    /// Segment of the guide's contact polyline, which has the rod's points and midpoints.
    pub segment: usize,
    /// Position on it, 0..=1.
    pub u: f64,
    /// Index of the body that holds it, into [`Anim::bodies`].
    pub body: usize,
    /// Goal in the rest space of the body, m.
    pub goal: Vector3<f64>,
    /// Material frame that it holds there, rest space of the body: columns d1, d2, d3. `None` if the place may
    /// turn.
    pub frame: Option<Matrix3<f64>>,
    /// True if the strand slides along its axis through the goal: what is held is the place nearest to it.
    pub slides: bool,
    /// True if it lets the strand go for good that slides out of it.
    pub releases: bool,
    /// Arc length of the place from the root, m.
    pub arc: f64,
    /// The place as it is drawn, rest space of the guide, m.
    pub drawn: Vector3<f64>,
    /// First and last time of the tie, s.
    pub times: [f64; 2],
    /// Number of the tie of the animation that it is of: index into [`Anim::ties`].
    pub of: usize,
}

/// What holds a strand before the place of a tie, on the way from its root: the root unless that is free, or the last
/// tie through which it does not slide.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    /// Arc length from the root, m.
    pub arc: f64,
    /// As it is drawn, rest space of the guide, m.
    pub drawn: Vector3<f64>,
    /// Where it is at the end of the step, world, m.
    pub x: Vector3<f64>,
}

/// A tie that holds at the end of a step.
#[derive(Debug, Clone, PartialEq)]
pub struct ActiveTie {
    /// The tie.
    pub tie: Tie,
    /// Where its place is to be, world, m.
    pub target: Vector3<f64>,
    /// Where it is to be once it is there, world, m: the target may be on the way, or as far as the strand reaches.
    pub goal: Vector3<f64>,
    /// The material frame that its place is to have, world; `None` if it may turn.
    pub frame: Option<Matrix3<f64>>,
    /// What it exerted at the end of the last step, world; zero if it did not hold then.
    pub last: TieReaction,
    /// Whether its place is at its goal throughout the step, and so moves as smoothly as the body.
    pub steady: bool,
}

/// The place of a rod that a tie holds.
#[derive(Debug, Clone, Copy)]
pub struct HeldPlace {
    /// Segment of the rod.
    pub segment: usize,
    /// Fraction of it, 0..=1.
    pub u: f64,
    /// Axes, world, of which it is held along the first `held`.
    pub directions: [Vector3<f64>; 3],
    /// Number of directions in which it is held.
    pub held: usize,
    /// How far it is from the target along these axes, m.
    pub off: [f64; 3],
}

impl ActiveTie {
    /// The place that it holds on the contact polyline `x`, world, m.
    ///
    /// A strand that slides is held across its axis alone: that of the frame, or its tangent. Where it has been
    /// drawn out, it is held as if it went on straight beyond its tip.
    pub fn held(&self, x: &[Vector3<f64>]) -> HeldPlace {
        let (k, u) = self.tie.position(x, &self.target);
        let off = x[k].lerp(&x[k + 1], u) - self.target;
        let (directions, held) = match (self.tie.slides, &self.frame) {
            (false, _) => ([Vector3::x(), Vector3::y(), Vector3::z()], 3),
            (true, Some(frame)) => ([0, 1, 2].map(|d| frame.column(d).into()), 2),
            (true, None) => {
                let frame = any_frame(&(x[k + 1] - x[k]).normalize());
                ([0, 1, 2].map(|d| frame.column(d).into()), 2)
            }
        };
        let (segment, u) = on_rod(k, u);
        HeldPlace { segment, u, directions, held, off: directions.map(|d| d.dot(&off)) }
    }

    /// How far the place that it holds on the contact polyline `x`, m, is from its goal in the directions in which it is
    /// held, m.
    pub fn slack(&self, x: &[Vector3<f64>]) -> f64 {
        let place = self.held(x);
        let short = self.target - self.goal;
        let off =
            place.off.iter().zip(&place.directions).take(place.held).map(|(off, d)| off + d.dot(&short));
        off.map(|off| off * off).sum::<f64>().sqrt()
    }
}

impl Tie {
    /// A tie that always holds, at `goal`, m, in the rest space of the first body, the place at `u` (0..=1) on
    /// `segment` of the contact polyline of `rod`, which may turn.
    pub fn new(rod: &Rod, segment: usize, u: f64, goal: Vector3<f64>) -> Self {
        let (x, (k, share)) = (drawn(rod), on_rod(segment, u));
        Tie {
            segment,
            u,
            body: 0,
            goal,
            frame: None,
            slides: false,
            releases: false,
            arc: rod.arc[k] + share * (rod.arc[k + 1] - rod.arc[k]),
            drawn: x[segment].lerp(&x[segment + 1], u),
            times: [f64::NEG_INFINITY, f64::INFINITY],
            of: 0,
        }
    }

    /// The anchor of the next tie, if this one holds its place at `target`, world, m.
    pub fn anchor(&self, target: Vector3<f64>) -> Anchor {
        Anchor { arc: self.arc, drawn: self.drawn, x: target }
    }

    /// Largest distance, m, from `anchor` at which the place is held: short of the arc length between them, for a
    /// strand that is pulled straight would be without bound on the force.
    fn reach(&self, anchor: &Anchor) -> f64 {
        if self.slides {
            return f64::INFINITY;
        }
        (WITHIN_REACH * (self.arc - anchor.arc)).max((self.drawn - anchor.drawn).norm())
    }

    /// The place nearest to `goal`, world, m, that the strand reaches from `anchor`.
    pub fn within_reach(&self, anchor: &Anchor, goal: &Vector3<f64>) -> Vector3<f64> {
        let offset = goal - anchor.x;
        anchor.x + offset * (self.reach(anchor) / offset.norm()).min(1.0)
    }

    /// Segment of the contact polyline `x`, m, and position on it (0..=1) that is to be at `goal`, m.
    pub fn position(&self, x: &[Vector3<f64>], goal: &Vector3<f64>) -> (usize, f64) {
        if self.slides {
            let (segment, u, _) = nearest(x, goal);
            return (segment, u);
        }
        (self.segment, self.u)
    }

    /// True if it holds at time `t`, s.
    pub fn holds_at(&self, t: f64) -> bool {
        (self.times[0]..=self.times[1]).contains(&t)
    }

    /// True if a strand with the contact polyline `x`, world, m, has just slid out of it: its tip is short of the ring
    /// or sleeve, on the axis. `pose` is that of the body, rest space to world.
    pub fn is_left_by(&self, x: &[Vector3<f64>], pose: &Isometry3<f64>) -> bool {
        let tip = x.len() - 1;
        let axis = match &self.frame {
            Some(frame) => pose.rotation * Vector3::from(frame.column(2)),
            None => (x[tip] - x[tip - 1]).normalize(),
        };
        let beyond = (pose * Point3::from(self.goal)).coords - x[tip];
        let along = beyond.dot(&axis);
        self.slides && along > OUT && (beyond - axis * along).norm() < OUT
    }

    /// What it holds at the end of a step of `h`, s, that starts with the contact polyline `x`, world, m, and the frames
    /// of `shape`, within reach of `anchor` if there is one. `poses` are the body's poses (rest space to world) at start and end.
    pub fn active(
        &self,
        h: f64,
        x: &[Vector3<f64>],
        shape: &RodShape,
        anchor: Option<&Anchor>,
        poses: [Isometry3<f64>; 2],
    ) -> ActiveTie {
        let [before, goal] = poses.map(|pose| (pose * Point3::from(self.goal)).coords);
        let (k, u) = self.position(x, &before);
        let from = x[k] * (1.0 - u) + x[k + 1] * u;
        let carried = (poses[1] * poses[0].inverse_transform_point(&from.into())).coords;
        let offset = goal - carried;
        let free = carried + offset * (MAX_GATHER_SPEED * h / offset.norm()).min(1.0);
        let target = anchor.map_or(free, |anchor| self.within_reach(anchor, &free));
        let (segment, s) = on_rod(k, u);
        let frame = self.frame.map(|frame| target_frame(h, &frame, &shape.frame_between(segment, s), poses));
        // By the rotation that is held, which is not that of `frame_between`.
        let is_turned_there = |frame: &Matrix3<f64>| {
            let held = poses[0].rotation.to_rotation_matrix().matrix() * frame;
            shape.rotation_from(segment, s, &held).norm() < THERE
        };
        let steady = offset.norm() < THERE
            && (target - goal).norm() < THERE
            && self.frame.as_ref().is_none_or(is_turned_there);
        ActiveTie { tie: self.clone(), target, goal, frame, last: TieReaction::default(), steady }
    }
}

/// The frame at the end of a step of `h`, s, that starts with the frame `from`, world, on its way to `goal` in the
/// rest space of a body with these poses at start and end.
fn target_frame(
    h: f64,
    goal: &Matrix3<f64>,
    from: &Matrix3<f64>,
    poses: [Isometry3<f64>; 2],
) -> Matrix3<f64> {
    let [start, end] = poses.map(|pose| *pose.rotation.to_rotation_matrix().matrix());
    let (goal, carried) = (end * goal, end * start.transpose() * from);
    let offset = Rotation3::from_matrix_unchecked(goal * carried.transpose());
    let rest = (1.0 - MAX_GATHER_TURN * h / offset.angle()).max(0.0);
    if rest > 0.0 { offset.powf(-rest) * goal } else { goal }
}

/// Returns the ties of each of `rods`, from root to tip.
pub fn ties(groom: &Groom, anim: &Anim, rods: &[GuideRod]) -> Vec<Vec<Tie>> {
    let mut out = vec![Vec::new(); rods.len()];
    let drawn: Vec<Vec<Vector3<f64>>> = rods.iter().map(|r| drawn(&r.rod)).collect();
    for (of, tie) in anim.ties.iter().enumerate() {
        let centre = tie.bundle.or(tie.guides.within).map(|(centre, _)| centre);
        let mut held: Vec<(usize, usize, f64)> = Vec::new();
        for (i, (r, points)) in rods.iter().zip(&drawn).enumerate() {
            if !selects(&tie.guides, groom, r, points) {
                continue;
            }
            let place = match (tie.point, centre) {
                (TiePoint::Arc(arc), _) => at_arc(r, arc),
                (TiePoint::Share(share), _) => at_arc(r, share * r.rod.length()),
                (TiePoint::Distance(factor), Some(at)) => at_arc(r, factor * (points[0] - at).norm()),
                (TiePoint::Nearest, Some(at)) => Some(nearest(points, &at)).map(|(k, u, _)| (k, u)),
                (_, None) => None,
            };
            held.extend(place.map(|(k, u)| (i, k, u)));
        }
        let at = |&(i, k, u): &(usize, usize, f64)| drawn[i][k] * (1.0 - u) + drawn[i][k + 1] * u;
        let mean = held.iter().map(at).sum::<Vector3<f64>>() / held.len().max(1) as f64;
        let widest = held.iter().map(|p| (at(p) - mean).norm()).fold(f64::MIN_POSITIVE, f64::max);
        for place in held {
            let (i, mut segment, mut u) = place;
            let mut goal = at(&place);
            if let Some((centre, radius)) = tie.bundle {
                // The bundle keeps its drawn arrangement.
                goal = centre + (goal - mean) * (radius / widest).min(1.0);
                let least = REACH * (drawn[i][0] - goal).norm();
                if tie.point == TiePoint::Nearest && arc_of(&rods[i], segment, u) < least {
                    (segment, u) = at_arc(&rods[i], least).unwrap_or((segment, u));
                }
            }
            let drawn_frame = || {
                let (mut shape, (k, s)) = (RodShape::default(), on_rod(segment, u));
                shape.update(&rods[i].rod, &rods[i].rod.root.r, &rods[i].rod.initial_q);
                shape.frame_between(k, s)
            };
            let frame = match tie.orientation {
                TieOrientation::Free => None,
                TieOrientation::Drawn => Some(drawn_frame()),
                TieOrientation::Frame(frame) => Some(frame),
            };
            let held = Tie::new(&rods[i].rod, segment, u, goal);
            let anim::Tie { body, slides, releases, times, .. } = *tie;
            out[i].push(Tie { body, frame, slides, releases, times, of, ..held });
        }
    }
    out.iter_mut().for_each(|ties| ties.sort_by(|a, b| a.arc.total_cmp(&b.arc)));
    out
}

/// True if `guides` selects the guide `r` of `groom`, with these points and midpoints in the groom's pose, m.
pub(super) fn selects(guides: &GuideSelection, groom: &Groom, r: &GuideRod, points: &[Vector3<f64>]) -> bool {
    let curves = &groom.guides.curves;
    let group = &groom.groups[curves.group[r.guide] as usize].name;
    guides.ids.as_ref().is_none_or(|ids| ids.contains(&curves.id[r.guide]))
        && guides.group.as_ref().is_none_or(|name| name == group)
        && guides.within.is_none_or(|(centre, radius)| nearest(points, &centre).2 <= radius)
}

/// Points and midpoints in the groom's pose, rest space, m.
pub(super) fn drawn(rod: &Rod) -> Vec<Vector3<f64>> {
    let (mut shape, mut line) = (RodShape::default(), Vec::new());
    shape.update(rod, &rod.root.r, &rod.initial_q);
    with_midpoints(&rod.arc, |k| shape.x(k) + rod.root.p, |k| shape.tangent(k), &mut line);
    line
}

/// Segment and position on it nearest to `p`, and its distance, m.
fn nearest(points: &[Vector3<f64>], p: &Vector3<f64>) -> (usize, f64, f64) {
    let on = |(k, ends): (usize, &[Vector3<f64>])| {
        let edge = ends[1] - ends[0];
        let u = (edge.dot(&(p - ends[0])) / edge.norm_squared()).clamp(0.0, 1.0);
        (k, u, (ends[0] + edge * u - p).norm())
    };
    points.windows(2).enumerate().map(on).fold((0, 0.0, f64::INFINITY), |a, b| if b.2 < a.2 { b } else { a })
}

/// Arc length of a position on a segment, m.
fn arc_of(r: &GuideRod, segment: usize, u: f64) -> f64 {
    let (k, share) = on_rod(segment, u);
    r.rod.arc[k] + share * (r.rod.arc[k + 1] - r.rod.arc[k])
}

/// Segment and position on it at an arc length, m; `None` beyond the tip, but for rounding.
fn at_arc(r: &GuideRod, arc: f64) -> Option<(usize, f64)> {
    let s = &r.rod.arc;
    let tip = s[s.len() - 1];
    let arc = if arc <= tip * (1.0 + ROUNDING) { arc.min(tip) } else { arc };
    let k = s.windows(2).position(|s| arc <= s[1])?;
    let halves = 2.0 * (arc - s[k]) / (s[k + 1] - s[k]);
    Some(if halves < 1.0 { (2 * k, halves) } else { (2 * k + 1, halves - 1.0) })
}
