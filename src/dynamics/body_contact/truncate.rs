//! Truncation of the step's motion, the last resort.

use super::problem::BodyContact;
use super::scratch::BodyContactScratch;
use crate::contact::{Contact, ContactCache};
use crate::rod::newton::Solver;

/// Speed that closing bodies may give to a wedged strand, m/s: a few times the push-out speed, for the tip
/// has the longer arm.
const MAX_WEDGE_SPEED: f64 = 1.0;

/// Largest ratio of the displacement of a strand's point to that of its root on a turning head.
const MAX_CARRY_RATIO: f64 = 3.0;

impl BodyContact<'_> {
    /// True if no point is faster than all of [`MAX_WEDGE_SPEED`], the fastest point at the start with
    /// gravity, and [`MAX_CARRY_RATIO`] times a root that is held or a body. Two bodies that close on a strand would
    /// throw it.
    pub(super) fn gains_no_speed(&self, scratch: &BodyContactScratch) -> bool {
        let Some([t0, t1]) = self.motions.first().map(|motion| motion.times) else { return true };
        let detection = &scratch.detection;
        let moved = |c: &Contact| (c.point[1] - c.point[0]).norm();
        let root = if self.rod.is_free() { 0.0 } else { (self.root.p - self.x0[0]).norm() };
        let carried = MAX_CARRY_RATIO * detection.contacts.iter().map(moved).fold(root, f64::max);
        let most = (self.fastest.max(MAX_WEDGE_SPEED) * (t1 - t0)).max(carried);
        self.x0.iter().zip(&detection.x1).all(|(a, b)| (a - b).norm() <= most)
    }

    /// Truncates the motion from unknowns `start` to `q` to the share that crosses no surface, gains no speed
    /// and has the least shortfall. Share 0 follows the body that carries the root, but another body that
    /// approaches may still cross it; the full motion is then taken if it alone crosses nothing, at any
    /// speed. Returns `false` if the result crosses a surface.
    pub fn truncate(
        &self,
        start: &[f64],
        q: &mut [f64],
        solver: &mut Solver,
        contact_cache: &mut ContactCache,
        scratch: &mut BodyContactScratch,
    ) -> bool {
        scratch.full_q.clear();
        scratch.full_q.extend_from_slice(q);
        let full_is_clear = self.find(solver, contact_cache, scratch);
        let (mut clear, mut least, mut chosen) = (false, f64::INFINITY, None);
        for share in [0.5, 0.25, 0.125, 0.0] {
            clear = self.move_by_share(share, start, q, solver, contact_cache, scratch);
            let shortfall = scratch.detection.shortfall;
            if clear && shortfall < least && self.gains_no_speed(scratch) {
                (least, chosen) = (shortfall, Some(share));
            }
            if least <= 0.0 {
                break;
            }
        }
        let fallback = if !clear && full_is_clear { 1.0 } else { 0.0 };
        clear = self.move_by_share(chosen.unwrap_or(fallback), start, q, solver, contact_cache, scratch);
        self.record(scratch);
        clear
    }

    /// Sets `q` to this share of the motion from `start` to the full motion; returns whether that crosses no
    /// surface.
    fn move_by_share(
        &self,
        share: f64,
        start: &[f64],
        q: &mut [f64],
        solver: &mut Solver,
        contact_cache: &mut ContactCache,
        scratch: &mut BodyContactScratch,
    ) -> bool {
        for ((q, a), full) in q.iter_mut().zip(start).zip(&scratch.full_q) {
            *q = a + share * (full - a);
        }
        solver.shape.update(self.rod, &self.root.r, q);
        self.find(solver, contact_cache, scratch)
    }
}
