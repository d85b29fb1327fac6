//! Motions that are cut short, and those that would have to be.

use super::{Touch, TouchWork};
use crate::contact::Contact;
use crate::rod::newton::Solver;

/// Speed that closing bodies may give to what they pinch, m/s: a few times that at which it is brought out, for its tip is the longer arm.
const THROWN: f64 = 1.0;

/// How many times as far as its root a head that turns carries a strand, at most.
const CARRIED: f64 = 3.0;

impl Touch<'_> {
    /// Whether no point is faster than [`THROWN`], than any was and falls, and than a few times the root: two bodies that close on a strand would
    /// throw it.
    pub(super) fn gains_none(&self, work: &TouchWork) -> bool {
        let Some([t0, t1]) = self.motions.first().map(|motion| motion.times) else { return true };
        let moved = |c: &Contact| (c.point[1] - c.point[0]).norm();
        let carried =
            CARRIED * work.contacts.iter().map(moved).fold((self.root.p - self.x0[0]).norm(), f64::max);
        let most = (self.fastest.max(THROWN) * (t1 - t0)).max(carried);
        self.x0.iter().zip(&work.x1).all(|(a, b)| (a - b).norm() <= most)
    }

    /// Cuts the motion from unknowns `start` to `q` short so that no surface is crossed and no speed is gained: the last resort. On a body that carries
    /// the root, no motion of the unknowns is no motion at all; on another, which comes nearer, that may cross it where the whole motion does not, and then
    /// that is taken, at whatever speed. `false` where what it ends with crosses a surface.
    pub fn shorten(
        &self,
        start: &[f64],
        q: &mut [f64],
        solver: &mut Solver,
        memory: &mut crate::contact::Workspace,
        work: &mut TouchWork,
    ) -> bool {
        let whole_is_clear = self.find(solver, memory, work);
        work.whole.clear();
        work.whole.extend_from_slice(q);
        let mut clear = false;
        for share in [0.5, 0.5, 0.5, 0.0] {
            for (q, a) in q.iter_mut().zip(start) {
                *q = a + share * (*q - a);
            }
            solver.shape.update(self.rod, &self.root.r, q);
            clear = self.find(solver, memory, work);
            if clear && self.gains_none(work) {
                break;
            }
        }
        if !clear && whole_is_clear {
            q.copy_from_slice(&work.whole);
            solver.shape.update(self.rod, &self.root.r, q);
            clear = self.find(solver, memory, work);
        }
        self.note(work);
        clear
    }
}
