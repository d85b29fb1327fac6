//! Motions that are cut short, and those that would have to be.

use super::{BodyContact, BodyContactScratch};
use crate::contact::Contact;
use crate::rod::newton::Solver;

/// Speed that closing bodies may give to what they pinch, m/s: a few times that at which it is brought out, for its tip is the longer arm.
const THROWN: f64 = 1.0;

/// How many times as far as its root a head that turns carries a strand, at most.
const CARRIED: f64 = 3.0;

impl BodyContact<'_> {
    /// Whether no point is faster than [`THROWN`], than any was and falls, and than a few times the root: two bodies that close on a strand would
    /// throw it.
    pub(super) fn gains_none(&self, work: &BodyContactScratch) -> bool {
        let Some([t0, t1]) = self.motions.first().map(|motion| motion.times) else { return true };
        let moved = |c: &Contact| (c.point[1] - c.point[0]).norm();
        let carried =
            CARRIED * work.contacts.iter().map(moved).fold((self.root.p - self.x0[0]).norm(), f64::max);
        let most = (self.fastest.max(THROWN) * (t1 - t0)).max(carried);
        self.x0.iter().zip(&work.x1).all(|(a, b)| (a - b).norm() <= most)
    }

    /// Cuts the motion from unknowns `start` to `q` short so that no surface is crossed, no speed is gained and no surface is too near, or as little as may be: the last
    /// resort. On a body that carries the root, no motion of the unknowns is no motion at all; on another, which comes nearer, that may cross it where the
    /// whole motion does not, and then that is taken, at whatever speed. `false` where what it ends with crosses a surface.
    pub fn truncate(
        &self,
        start: &[f64],
        q: &mut [f64],
        solver: &mut Solver,
        memory: &mut crate::contact::ContactCache,
        work: &mut BodyContactScratch,
    ) -> bool {
        work.whole.clear();
        work.whole.extend_from_slice(q);
        let whole_is_clear = self.find(solver, memory, work);
        let (mut clear, mut least, mut chosen) = (false, f64::INFINITY, None);
        for share in [0.5, 0.25, 0.125, 0.0] {
            clear = self.go(share, start, q, solver, memory, work);
            if clear && work.lacking < least && self.gains_none(work) {
                (least, chosen) = (work.lacking, Some(share));
            }
            if least <= 0.0 {
                break;
            }
        }
        let otherwise = if !clear && whole_is_clear { 1.0 } else { 0.0 };
        clear = self.go(chosen.unwrap_or(otherwise), start, q, solver, memory, work);
        self.note(work);
        clear
    }

    /// Goes this share of the way from unknowns `start` to those that `work` has of the whole motion; whether that crosses nothing.
    fn go(
        &self,
        share: f64,
        start: &[f64],
        q: &mut [f64],
        solver: &mut Solver,
        memory: &mut crate::contact::ContactCache,
        work: &mut BodyContactScratch,
    ) -> bool {
        for ((q, a), whole) in q.iter_mut().zip(start).zip(&work.whole) {
            *q = a + share * (whole - a);
        }
        solver.shape.update(self.rod, &self.root.r, q);
        self.find(solver, memory, work)
    }
}
