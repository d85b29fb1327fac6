//! Ties: points of guides that a body holds in all directions.

use super::contact_polyline::{on_rod, with_midpoints};
use crate::rod::RodShape;
use crate::scene::anim::{GuideSelection, TiePoint};
use crate::scene::{Anim, Groom};
use crate::wisp::GuideRod;
use nalgebra::{Isometry3, Vector3};

/// Least length from the root to the held point, relative to the distance of the root from the goal: a
/// shorter one cannot reach it around the head.
const REACH: f64 = 1.1;
/// Largest speed at which a point is moved to its goal, m/s.
const MAX_GATHER_SPEED: f64 = 0.5;

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
    /// First and last time of the tie, s.
    pub times: [f64; 2],
    /// Number of the tie of the animation that it is of: index into [`Anim::ties`].
    pub of: usize,
}

impl Tie {
    /// The held point on the contact polyline `x`.
    pub fn place(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        x[self.segment] * (1.0 - self.u) + x[self.segment + 1] * self.u
    }

    /// True if it holds at time `t`, s.
    pub fn holds_at(&self, t: f64) -> bool {
        (self.times[0]..=self.times[1]).contains(&t)
    }

    /// Target at the end, at time `t`, s, of a step of `h`, s, that starts with the point at `from`, world,
    /// m. `poses` are the body's poses (rest space to world) at start and end. `None` if the tie is not
    /// active at `t`.
    pub fn target(
        &self,
        t: f64,
        h: f64,
        from: &Vector3<f64>,
        poses: [Isometry3<f64>; 2],
    ) -> Option<Vector3<f64>> {
        if !self.holds_at(t) {
            return None;
        }
        let goal = (poses[1] * nalgebra::Point3::from(self.goal)).coords;
        let carried = (poses[1] * poses[0].inverse_transform_point(&(*from).into())).coords;
        let offset = goal - carried;
        Some(carried + offset * (MAX_GATHER_SPEED * h / offset.norm()).min(1.0))
    }
}

/// Returns the ties of each of `rods`.
pub fn ties(groom: &Groom, anim: &Anim, rods: &[GuideRod]) -> Vec<Vec<Tie>> {
    let mut out = vec![Vec::new(); rods.len()];
    let drawn: Vec<Vec<Vector3<f64>>> = rods.iter().map(drawn).collect();
    for (of, tie) in anim.ties.iter().enumerate() {
        let centre = tie.bundle.or(tie.guides.within).map(|(centre, _)| centre);
        let mut held: Vec<(usize, usize, f64)> = Vec::new();
        for (i, (r, points)) in rods.iter().zip(&drawn).enumerate() {
            if !selects(&tie.guides, groom, r, points) {
                continue;
            }
            let place = match (tie.point, centre) {
                (TiePoint::Arc(arc), _) => at_arc(r, arc),
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
            out[i].push(Tie { segment, u, body: tie.body, goal, times: tie.times, of });
        }
    }
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
pub(super) fn drawn(r: &GuideRod) -> Vec<Vector3<f64>> {
    let (mut shape, mut line) = (RodShape::default(), Vec::new());
    shape.update(&r.rod, &r.rod.root.r, &r.rod.initial_q);
    with_midpoints(&r.rod.arc, |k| shape.x(k) + r.rod.root.p, |k| shape.tangent(k), &mut line);
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

/// Segment and position on it at an arc length, m; `None` beyond the tip.
fn at_arc(r: &GuideRod, arc: f64) -> Option<(usize, f64)> {
    let s = &r.rod.arc;
    let k = s.windows(2).position(|s| arc <= s[1])?;
    let halves = 2.0 * (arc - s[k]) / (s[k + 1] - s[k]);
    Some(if halves < 1.0 { (2 * k, halves) } else { (2 * k + 1, halves - 1.0) })
}
