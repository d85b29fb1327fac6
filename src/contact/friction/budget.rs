//! Limit on the systems of Newton's method that a strand may have solved in one sub-step.

use super::interrupt::Interrupt;

/// Systems of one sub-step, over all its parts and rounds. A system of 64 contacts takes some 0.2 ms.
const SYSTEMS_PER_SUBSTEP: u32 = 4000;

/// What is left of the systems of a sub-step. Bodies that leave no room for a strand would cost a thousand times
/// a step; so there is a limit, beyond which sweeps alone are left.
#[derive(Debug)]
pub struct SystemBudget {
    left: u32,
    interrupt: Interrupt,
}

impl Default for SystemBudget {
    fn default() -> Self {
        SystemBudget::new(Interrupt::default())
    }
}

impl SystemBudget {
    /// The budget of a sub-step; nothing of it is left once `interrupt` is asked for.
    pub fn new(interrupt: Interrupt) -> Self {
        SystemBudget { left: SYSTEMS_PER_SUBSTEP, interrupt }
    }

    /// True if no system may be solved any more.
    pub fn is_exhausted(&self) -> bool {
        self.left == 0
    }

    /// Takes one system, if one is left.
    pub(super) fn take(&mut self) -> bool {
        if self.interrupt.is_asked_for() {
            self.left = 0;
        }
        let may = self.left > 0;
        self.left -= u32::from(may);
        may
    }

    /// Keeps half of what is left for later ([`SystemBudget::release`]); returns how much.
    pub fn keep_half(&mut self) -> u32 {
        let kept = self.left / 2;
        self.left -= kept;
        kept
    }

    /// Makes what was `kept` available again.
    pub fn release(&mut self, kept: u32) {
        self.left += kept;
    }

    #[cfg(test)]
    pub(super) fn left(&self) -> u32 {
        self.left
    }
}
