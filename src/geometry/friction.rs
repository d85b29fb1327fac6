//! Coefficients of dry friction.

/// Coefficients of dry friction (Coulomb): the ratio of tangential to normal force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Static coefficient μ_s; at least `mu_k`.
    pub mu_s: f64,
    /// Kinetic coefficient μ_k.
    pub mu_k: f64,
}

impl Friction {
    /// From the kinetic and the static coefficient; the static one defaults to the kinetic one.
    pub fn new(mu_k: f64, mu_s: Option<f64>) -> Self {
        Friction { mu_s: mu_s.unwrap_or(mu_k), mu_k }
    }

    /// Both coefficients multiplied by `factor`.
    pub fn scaled(self, factor: f64) -> Self {
        Friction { mu_s: self.mu_s * factor, mu_k: self.mu_k * factor }
    }

    /// Linear interpolation between two materials; `u` in 0..=1.
    pub fn lerp([from, to]: [Self; 2], u: f64) -> Self {
        let at = |a: f64, b: f64| a + (b - a) * u;
        Friction { mu_s: at(from.mu_s, to.mu_s), mu_k: at(from.mu_k, to.mu_k) }
    }
}

impl From<f64> for Friction {
    /// The same coefficient for sticking and sliding.
    fn from(mu: f64) -> Self {
        Friction { mu_s: mu, mu_k: mu }
    }
}
