//! What is asked of a running stage from outside, and how often it saves.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Wishes to a running stage. It looks at them between sub-steps, and between frames.
#[derive(Debug, Clone, Default)]
pub struct Control {
    /// Set by whoever wants it to save and stop.
    pub stop: Arc<AtomicBool>,
    /// Set by whoever wants it to save and go on.
    pub save: Arc<AtomicBool>,
    /// When it is to save and stop by itself.
    pub until: Option<Instant>,
    /// Time between checkpoints; `None` for none.
    pub every: Option<Duration>,
    /// Frames between checkpoints; `None` for none.
    pub every_frames: Option<u32>,
}

impl Control {
    /// Whether the stage is to stop.
    pub fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.until.is_some_and(|until| Instant::now() >= until)
    }

    /// Whether the stage has been asked to save since it was last asked here.
    pub fn saves(&self) -> bool {
        self.save.swap(false, Ordering::Relaxed)
    }
}
