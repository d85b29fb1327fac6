//! Rigid motion over time, smooth to any sub-frame.

use nalgebra::Isometry3;

/// Rest space to world over time.
#[derive(Debug, Clone)]
pub struct Track {
    /// The one pose of a track that does not move.
    pub fixed: Isometry3<f64>,
}

impl Track {
    /// A track that does not move.
    pub fn fixed(pose: Isometry3<f64>) -> Self {
        Track { fixed: pose }
    }

    /// World pose of rest space at time `t`, s.
    pub fn pose(&self, _t: f64) -> Isometry3<f64> {
        self.fixed
    }
}
