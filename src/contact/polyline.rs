//! Polylines and bodies in motion, and contacts between them.

use crate::geometry::{Feature, Friction};
use nalgebra::{Isometry3, Vector3};

/// Accepted violation of a clearance, m: a tenth of a hair's diameter, a fiftieth of the usual clearance.
pub const GAP_TOLERANCE: f64 = 1e-5;

/// Motion of a body over a sub-step.
#[derive(Debug, Clone, Copy)]
pub struct BodyMotion {
    /// Start and end, s, within the step for which the bodies are prepared; they select the configuration of
    /// a deforming body.
    pub times: [f64; 2],
    /// Pose (body frame to world) at the start.
    pub start: Isometry3<f64>,
    /// Pose (body frame to world) at the end.
    pub end: Isometry3<f64>,
}

/// A polyline that moves over a sub-step; n vertices, root first, world frame, m.
#[derive(Debug, Clone, Copy)]
pub struct MovingPolyline<'a> {
    /// Vertices at the start.
    pub x0: &'a [Vector3<f64>],
    /// Candidate vertices at the end.
    pub x1: &'a [Vector3<f64>],
    /// Distance to keep from body b at the two ends of segment k, m, at index `b * (n - 1) + k`; linear in
    /// between. Negative while a part is brought out of the body. A segment with an end at −∞ is exempt from
    /// contact with it.
    pub clearance: &'a [[f64; 2]],
    /// Whether parts of one mesh close on the polyline, or overlap where it is. Each part then tells its own
    /// side, for the nearest surface tells that of one alone.
    pub by_part: bool,
}

/// A place where a polyline must keep its distance from a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Segment of the polyline, from vertex `segment` to the next.
    pub segment: usize,
    /// Parameter on the segment, 0..=1.
    pub u: f64,
    /// Index of the body.
    pub body: usize,
    /// Feature of the body's surface.
    pub feature: Feature,
    /// Unit normal, out of the body, world frame, at the end of the sub-step.
    pub normal: Vector3<f64>,
    /// Material point of the body at the start and at the end of the sub-step, m, world frame. Their
    /// difference over the duration is its velocity.
    pub point: [Vector3<f64>; 2],
    /// `normal · (x1(u) − point[1]) − d(u)`, m, with the clearance d; negative if the clearance is violated.
    pub gap: f64,
    /// Friction of the body; `None` for the strand's own.
    pub friction: Option<Friction>,
}

impl MovingPolyline<'_> {
    /// Clearances of all segments from a body, m.
    pub(super) fn clearances(&self, body: usize) -> &[[f64; 2]] {
        let segments = self.x0.len().saturating_sub(1);
        &self.clearance[body * segments..][..segments]
    }

    /// Gap of `contact` for the current vertices at the end of the sub-step, m.
    pub fn gap(&self, contact: &Contact) -> f64 {
        let k = contact.segment;
        let x = self.x1[k] + (self.x1[k + 1] - self.x1[k]) * contact.u;
        contact.normal.dot(&(x - contact.point[1])) - self.clearance_at(contact)
    }

    /// Distance, along the tangent plane, of the contact's place on the polyline from its material point at
    /// the end of the sub-step, m.
    pub fn tangential_offset(&self, contact: &Contact) -> f64 {
        let k = contact.segment;
        let x = self.x1[k] + (self.x1[k + 1] - self.x1[k]) * contact.u - contact.point[1];
        (x - contact.normal * contact.normal.dot(&x)).norm()
    }

    /// Clearance at `contact`, m.
    pub fn clearance_at(&self, contact: &Contact) -> f64 {
        let [from, to] = self.clearances(contact.body)[contact.segment];
        from + (to - from) * contact.u
    }

    /// Whether the place of `contact` must end the step in front of the surface.
    pub fn stays_in_front(&self, contact: &Contact) -> bool {
        let [from, to] = self.clearances(contact.body)[contact.segment];
        from + (to - from) * contact.u >= least_in_front(&[from, to])
    }
}

/// Clearance, m, from which a place on a segment with these clearances at its ends stays in front of the
/// surface. A segment with a negative one passes through the surface where its clearance is 0. Clearances are
/// kept to [`GAP_TOLERANCE`], so that a place may end behind the surface as long as its own is less.
pub(super) fn least_in_front(clearance: &[f64; 2]) -> f64 {
    if clearance.iter().any(|end| *end < 0.0) { GAP_TOLERANCE } else { 0.0 }
}

/// Whether a segment with these clearances at its ends is exempt from contact.
pub(super) fn is_exempt(clearance: &[f64; 2]) -> bool {
    clearance.contains(&f64::NEG_INFINITY)
}

/// A contact in the frame of its body.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalContact {
    pub segment: usize,
    pub u: f64,
    pub feature: Feature,
    /// Unit normal at the end of the sub-step.
    pub normal: Vector3<f64>,
    /// Material point at the start and at the end, m.
    pub point: [Vector3<f64>; 2],
}

impl LocalContact {
    /// The contact in the world frame, with its gap at the end of the sub-step.
    pub fn into_world(
        self,
        body: usize,
        friction: Option<Friction>,
        motion: &BodyMotion,
        line: &MovingPolyline,
    ) -> Contact {
        let LocalContact { segment, u, feature, normal, point } = self;
        let to_world = |pose: &Isometry3<f64>, y: &Vector3<f64>| pose.rotation * y + pose.translation.vector;
        let point = [to_world(&motion.start, &point[0]), to_world(&motion.end, &point[1])];
        let normal = motion.end.rotation * normal;
        let contact = Contact { segment, u, body, feature, normal, point, gap: 0.0, friction };
        Contact { gap: line.gap(&contact), ..contact }
    }
}
