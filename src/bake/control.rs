//! Requests to a running stage, and its checkpoint intervals.

use crate::contact::friction::Interrupt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Requests to a running stage, polled between sub-steps and between frames; a stop also within coupled sub-steps.
#[derive(Debug, Clone, Default)]
pub struct Control {
    /// Set to make the stage write a checkpoint and stop.
    pub stop: Arc<AtomicBool>,
    /// Set to make the stage write a checkpoint and continue.
    pub save: Arc<AtomicBool>,
    /// Time at which the stage writes a checkpoint and stops.
    pub until: Option<Instant>,
    /// Time between checkpoints; `None` for none.
    pub every: Option<Duration>,
    /// Frames between checkpoints; `None` for none.
    pub every_frames: Option<u32>,
}

impl Control {
    /// True if the stage must stop.
    pub fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.until.is_some_and(|until| Instant::now() >= until)
    }

    /// Abandons a sub-step once the stage must stop by request. Time alone is no reason: a limit that is shorter than
    /// one sub-step would keep every run from getting on.
    pub(super) fn interrupt(&self) -> Interrupt {
        let stop = self.stop.clone();
        Interrupt::new(move || stop.load(Ordering::Relaxed))
    }

    /// True if a checkpoint was requested since the last call.
    pub fn saves(&self) -> bool {
        self.save.swap(false, Ordering::Relaxed)
    }
}
