//! The motion of a guide that has taken a part of a sub-step which others take again.

use nalgebra::Vector3;

/// The motion of a guide over a part of a sub-step that it has taken.
#[derive(Debug, Clone)]
pub(in crate::dynamics) struct GivenMotion {
    /// Start and end of the part, s.
    pub span: [f64; 2],
    /// Its points at both, m, in the frame of the head.
    pub x: [Vec<Vector3<f64>>; 2],
    /// Its unknowns at both, 1/m.
    pub q: [Vec<f64>; 2],
}

impl GivenMotion {
    /// Its points at time `t`, s, m: they move evenly.
    pub fn points(&self, t: f64) -> impl Iterator<Item = Vector3<f64>> {
        let ([start, end], share) = (&self.x, self.share(t));
        start.iter().zip(end).map(move |(a, b)| a.lerp(b, share))
    }

    /// Its unknowns about at time `t`, s, 1/m: a linear change of the unknowns moves the points nearly evenly.
    pub fn unknowns(&self, t: f64) -> Vec<f64> {
        let ([start, end], share) = (&self.q, self.share(t));
        start.iter().zip(end).map(|(a, b)| a + share * (b - a)).collect()
    }

    /// Share of the part that has passed at time `t`, s.
    fn share(&self, t: f64) -> f64 {
        (t - self.span[0]) / (self.span[1] - self.span[0])
    }
}
