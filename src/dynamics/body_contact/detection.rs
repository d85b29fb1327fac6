//! Detection of the contacts of one guide at the current end of the step.

use super::problem::{BodyContact, target_distance};
use super::scratch::{BodyContactScratch, Detection};
use super::tolerances::{
    ACCEPTABLE_GAP, DETECTION_DISTANCE, GAP_TOLERANCE, MAX_COMPRESSION, MAX_CONTACTS, MAX_TIP_SPEED,
    MAX_TOLERATED_SHARE, MIN_DISTANCE_SHARE, PUSH_OUT_SPEED, ROUNDING, STABILISATION, SURFACE_TOLERANCE,
};
use crate::contact::{Contact, ContactCache, MovingPolyline};
use crate::dynamics::contact_polyline::{on_rod, with_midpoints};
use crate::rod::newton::Solver;

impl BodyContact<'_> {
    /// Updates the contact polyline from the solver's shape.
    pub(super) fn update_polyline(&self, solver: &Solver, scratch: &mut BodyContactScratch) {
        let (shape, x1) = (&solver.shape, &mut scratch.detection.x1);
        with_midpoints(&self.rod.arc, |k| shape.x(k) + self.root.p, |k| shape.tangent(k), x1);
    }

    /// Finds the contacts at the solver's shape and the impacts of the motion; returns whether the motion
    /// crosses no surface.
    ///
    /// Continuous detection reports a motion before it touches. The motion grazes the surface if it ends in
    /// front of it, and crosses it if it ends behind it. A point that starts behind a surface does not cross
    /// it unless it gets deeper.
    pub fn find(
        &self,
        solver: &Solver,
        contact_cache: &mut ContactCache,
        scratch: &mut BodyContactScratch,
    ) -> bool {
        self.update_polyline(solver, scratch);
        let Detection { x1, found, new_impacts, .. } = &mut scratch.detection;
        found.clear();
        new_impacts.clear();
        let line = self.line(x1);
        self.bodies.detect(self.motions, &line, DETECTION_DISTANCE, contact_cache, found, new_impacts);
        found.retain(|c| !self.is_held(c));
        new_impacts.retain(|c| !self.is_held(c));
        let detection = &mut scratch.detection;
        let line = self.line(&detection.x1);
        let in_front = |c: &Contact| {
            let distance = line.gap(c) + line.clearance_at(c);
            distance >= -SURFACE_TOLERANCE
                || distance >= self.initial_distance(&line, c)
                || !line.stays_in_front(c)
        };
        let clear = detection.new_impacts.iter().chain(&detection.found).all(in_front);
        detection.new_impacts.drain(..).for_each(|impact| detection.impacts.insert(impact));
        detection.found.iter_mut().for_each(|c| c.gap -= self.tolerated(&line, c));
        let planes = &mut detection.planes;
        if detection.frozen {
            planes.retain(|c| line.tangential_offset(c) < DETECTION_DISTANCE);
            for plane in &mut *planes {
                plane.gap = line.gap(plane) - self.tolerated(&line, plane);
            }
            for c in detection.found.iter().filter(|c| c.gap < -GAP_TOLERANCE) {
                if !planes.iter().any(|p| coincide(p, c)) {
                    planes.push(*c);
                }
            }
        } else {
            planes.clone_from(&detection.found);
            detection.midpoints.filter(planes, line.x0.len(), &scratch.reactions.contact_loads);
        }
        let contacts = &mut detection.contacts;
        contacts.clone_from(planes);
        detection.impacts.append_to(&line, contacts);
        for impact in &mut contacts[planes.len()..] {
            impact.gap -= self.tolerated(&line, impact);
        }
        let checked = || detection.found.iter().chain(&contacts[planes.len()..]);
        detection.worst = checked().map(|c| c.gap).fold(0.0, f64::min);
        let unaccounted = |c: &Contact| match line.clearance_at(c) < 0.0 {
            true => c.gap + ACCEPTABLE_GAP,
            false => c.gap + MAX_COMPRESSION * self.compressible(&line, c),
        };
        detection.unaccounted = checked().map(unaccounted).fold(0.0, f64::min);
        detection.shortfall = checked().map(|c| self.shortfall(&line, c)).fold(0.0, f64::max);
        if contacts.len() > MAX_CONTACTS {
            contacts.sort_by(|a, b| a.gap.total_cmp(&b.gap));
            contacts.truncate(MAX_CONTACTS);
            contacts.sort_by(|a, b| (a.body, a.segment).cmp(&(b.body, b.segment)).then(a.u.total_cmp(&b.u)));
        }
        clear
    }

    /// Finds the contacts at the solver's shape, without impacts; returns whether any point is too near to a
    /// body.
    pub(super) fn find_at_end(
        &self,
        solver: &Solver,
        contact_cache: &mut ContactCache,
        scratch: &mut BodyContactScratch,
    ) -> bool {
        self.update_polyline(solver, scratch);
        let detection = &mut scratch.detection;
        detection.found.clear();
        let line = self.line(&detection.x1);
        self.bodies.candidates(self.motions, &line, DETECTION_DISTANCE, contact_cache, &mut detection.found);
        detection.found.retain(|c| !self.is_held(c));
        let violated = !detection.found.iter().all(|c| c.gap >= 0.0);
        if !violated && self.ties.is_empty() {
            return false;
        }
        detection.contacts.clone_from(&detection.found);
        for contact in &mut detection.contacts {
            contact.gap -= self.tolerated(&line, contact);
        }
        detection.contacts.truncate(MAX_CONTACTS);
        violated
    }

    /// Whether the place of `contact` is so near to the root that skin gives way to the rod there. The reaction
    /// that moves such a place has no bound; it would move nothing else, and spoil the Hessian.
    fn is_held(&self, contact: &Contact) -> bool {
        let (k, s) = on_rod(contact.segment, contact.u);
        self.rod.arc_fraction(k, s) * self.rod.length() < self.rod.held_length()
    }

    /// Gap that is tolerated because it existed before the step, m, ≤ 0.
    pub(super) fn tolerated(&self, line: &MovingPolyline, contact: &Contact) -> f64 {
        let keep = line.clearance_at(contact);
        let before = self.initial_distance(line, contact);
        let [t0, t1] = self.motions[contact.body].times;
        let (k, u) = on_rod(contact.segment, contact.u);
        let whole = self.pushed_out && keep < 0.0 || self.rod.is_free();
        let share = if whole { 1.0 } else { self.rod.arc_fraction(k, u) };
        let speed = PUSH_OUT_SPEED.min(MAX_TIP_SPEED * share);
        let pushed_out = before + speed * (t1 - t0) - keep;
        if keep < 0.0 {
            // The distance to keep itself brings the point out slowly. What lagged behind it would be lost.
            return pushed_out.min(0.0);
        }
        let tolerated = ((1.0 - STABILISATION) * (before - keep)).min(0.0).max(-MAX_TOLERATED_SHARE * keep);
        tolerated.min(pushed_out)
    }

    /// Shortfall of `contact` from the distance that even a wedged strand must keep, m, ≥ 0. That distance
    /// is a share of the requested one, or the distance before the step if that is less.
    pub(super) fn shortfall(&self, line: &MovingPolyline, contact: &Contact) -> f64 {
        if contact.gap >= -GAP_TOLERANCE {
            return 0.0;
        }
        let shortfall = -(contact.gap + ACCEPTABLE_GAP);
        if line.clearance_at(contact) < 0.0 {
            return shortfall.max(0.0);
        }
        let target = target_distance(line, contact);
        let least = (MIN_DISTANCE_SHARE * target).min(self.initial_distance(line, contact) - ROUNDING);
        shortfall.max(least - (contact.gap + target)).max(0.0)
    }

    /// Distance of `contact` from its plane at the start of the step, m.
    fn initial_distance(&self, line: &MovingPolyline, contact: &Contact) -> f64 {
        let (k, u) = (contact.segment, contact.u);
        let motion = &self.motions[contact.body];
        let normal = motion.start.rotation * motion.end.rotation.inverse_transform_vector(&contact.normal);
        normal.dot(&(line.x0[k] * (1.0 - u) + line.x0[k + 1] * u - contact.point[0]))
    }
}

/// True if two contacts of a strand are nearly the same.
fn coincide(a: &Contact, b: &Contact) -> bool {
    (a.body, a.segment) == (b.body, b.segment) && (a.u - b.u).abs() < 1e-2 && a.normal.dot(&b.normal) > 0.999
}
