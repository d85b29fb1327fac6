//! Dry friction, by its coefficients.

/// Coefficients of dry friction (Coulomb), tangential over normal force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Up to which what sticks is held; not less than `kinetic`.
    pub fixed: f64,
    /// With which what slides is braked.
    pub kinetic: f64,
}

impl Friction {
    /// From the two coefficients as files have them: without one for what sticks, that for what slides.
    pub fn from_file(kinetic: f64, fixed: Option<f64>) -> Self {
        Friction { fixed: fixed.unwrap_or(kinetic), kinetic }
    }
}

impl Friction {
    /// Both coefficients times a factor.
    pub fn times(self, factor: f64) -> Self {
        Friction { fixed: self.fixed * factor, kinetic: self.kinetic * factor }
    }

    /// Between two ends, at a share of the way.
    pub fn between([from, to]: [Self; 2], share: f64) -> Self {
        let at = |a: f64, b: f64| a + (b - a) * share;
        Friction { fixed: at(from.fixed, to.fixed), kinetic: at(from.kinetic, to.kinetic) }
    }
}

impl From<f64> for Friction {
    /// One coefficient for both.
    fn from(mu: f64) -> Self {
        Friction { fixed: mu, kinetic: mu }
    }
}
