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
    pub(super) fn from_file(kinetic: f64, fixed: Option<f64>) -> Self {
        Friction { fixed: fixed.unwrap_or(kinetic), kinetic }
    }
}

impl Friction {
    /// What two strands rub with: the mean of theirs.
    pub fn mean(self, other: Self) -> Self {
        Friction { fixed: 0.5 * (self.fixed + other.fixed), kinetic: 0.5 * (self.kinetic + other.kinetic) }
    }
}

impl From<f64> for Friction {
    /// One coefficient for both.
    fn from(mu: f64) -> Self {
        Friction { fixed: mu, kinetic: mu }
    }
}
