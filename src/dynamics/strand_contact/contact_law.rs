//! The contact law of two guides, by the angle between them (`docs/theory.md` §5.2).

use crate::math::frame::frame_towards;
use nalgebra::Vector3;

/// Distance beyond the required one within which a pair is a contact at the start of a sub-step, m.
pub(super) const REACH: f64 = 5e-4;

/// The bundle of hairs that a guide represents: its own, and those of its followers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::dynamics) struct BundleProperties {
    /// Radius of one hair, m. Parallel guides keep it, because their hairs mix.
    pub hair_radius: f64,
    /// Radius of its hairs pressed together, m. Crossing guides keep it, because their hairs cannot mix.
    pub bundle_radius: f64,
    /// Friction coefficient for slip along parallel guides, relative to that of crossing ones.
    pub parallel_friction: f64,
    /// Cohesive force per length between parallel guides with `hairs` = 1, N/m.
    pub cohesion: f64,
    /// Number of hairs, relative to a number common to all guides of a scene. The guide's rod is that of one
    /// hair; forces between guides act on the bundle.
    pub hairs: f64,
}

impl BundleProperties {
    /// Adds the hairs of another bundle; the sections add up.
    pub fn add(&mut self, other: &BundleProperties) {
        self.bundle_radius = self.bundle_radius.hypot(other.bundle_radius);
        self.hairs += other.hairs;
    }
}

/// Two bundles at an angle.
#[derive(Debug, Clone, Copy)]
pub(super) struct BundlePair {
    bundles: [BundleProperties; 2],
    /// Sine of the angle between them, 0..=1.
    sine: f64,
    /// Their mean direction, not normalised; zero if neither has one.
    mean_direction: Vector3<f64>,
}

impl BundlePair {
    /// Two bundles with unit directions `a` and `b`.
    pub fn new(bundles: [BundleProperties; 2], [a, b]: [Vector3<f64>; 2]) -> Self {
        let mean_direction = if a.dot(&b) < 0.0 { a - b } else { a + b };
        BundlePair { bundles, sine: a.cross(&b).norm().min(1.0), mean_direction }
    }

    fn mean(&self, of: impl Fn(&BundleProperties) -> f64) -> f64 {
        0.5 * (of(&self.bundles[0]) + of(&self.bundles[1]))
    }

    /// Distance that they must keep, m.
    pub fn required_distance(&self) -> f64 {
        2.0 * (self.mean(|s| s.hair_radius) + self.mean(|s| s.bundle_radius) * self.sine)
    }

    /// Axes of a contact with normal `n`: the normal, and tangents along and across the guides. The length of
    /// the first tangent is the ratio of friction along to friction across, which turns the elliptic friction
    /// cone into a round one, as for bodies.
    pub fn axes(&self, n: &Vector3<f64>) -> [Vector3<f64>; 3] {
        let parallel = self.mean(|s| s.parallel_friction);
        let ratio = parallel + (1.0 - parallel) * self.sine * self.sine;
        let frame = frame_towards(n, &self.mean_direction);
        [*n, frame.column(0) * ratio, frame.column(1).into()]
    }

    /// Cohesive force, N, at a distance `gap` beyond the required one, m, for a contact that represents a
    /// `length`, m, of each guide. It acts over the length within [`REACH`] and fades with the gap, as liquid
    /// bridges between fibres do, which break at such a length. It grows with the girth of the bundles: their
    /// harmonic mean, as for unequal cylinders.
    pub fn cohesion(&self, gap: f64, length: f64) -> f64 {
        let near = (1.0 - gap.max(0.0) / REACH).max(0.0);
        let girth = 1.0 / self.mean(|s| 1.0 / s.hairs.sqrt());
        self.mean(|s| s.cohesion) * girth * near * length.min(REACH / self.sine.max(f64::MIN_POSITIVE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUNDLE: BundleProperties = BundleProperties {
        hair_radius: 4e-5,
        bundle_radius: 3e-4,
        parallel_friction: 0.4,
        cohesion: 0.2,
        hairs: 1.0,
    };

    fn at(angle: f64) -> BundlePair {
        BundlePair::new([BUNDLE; 2], [Vector3::x(), Vector3::new(angle.cos(), angle.sin(), 0.0)])
    }

    #[test]
    fn crossing_guides_keep_bundle_radii_with_isotropic_friction() {
        let crossing = at(std::f64::consts::FRAC_PI_2);
        assert!(
            (crossing.required_distance() - 2.0 * (BUNDLE.hair_radius + BUNDLE.bundle_radius)).abs() < 1e-15
        );
        let [_, along, across] = crossing.axes(&Vector3::z());
        assert!((along.norm() - 1.0).abs() < 1e-12 && (across.norm() - 1.0).abs() < 1e-12);
        // They are within reach over that length only.
        assert!((crossing.cohesion(0.0, 0.01) - BUNDLE.cohesion * REACH).abs() < 1e-15);
    }

    #[test]
    fn parallel_guides_keep_hair_radii_with_anisotropic_friction_and_cohesion() {
        // Parallel and antiparallel.
        for angle in [0.0, std::f64::consts::PI] {
            let parallel = at(angle);
            assert!((parallel.required_distance() - 2.0 * BUNDLE.hair_radius).abs() < 1e-15);
            let [_, along, across] = parallel.axes(&Vector3::z());
            assert!((along - Vector3::x() * along.x).norm() < 1e-15);
            assert!(
                (along.norm() - BUNDLE.parallel_friction).abs() < 1e-12
                    && (across.norm() - 1.0).abs() < 1e-12
            );
            assert!((parallel.cohesion(0.0, 0.01) - BUNDLE.cohesion * 0.01).abs() < 1e-15);
        }
    }

    #[test]
    fn cohesion_scales_with_the_harmonic_mean_of_girths() {
        let between = |hairs: [f64; 2]| {
            let bundles = hairs.map(|hairs| BundleProperties { hairs, ..BUNDLE });
            BundlePair::new(bundles, [Vector3::x(); 2]).cohesion(0.0, 0.01)
        };
        let one = between([1.0, 1.0]);
        assert!((between([9.0, 9.0]) / one - 3.0).abs() < 1e-12);
        assert!((between([1.0, 1e6]) / one - 2.0).abs() < 0.01);
        assert_eq!(between([1.0, 50.0]), between([50.0, 1.0]));
    }

    #[test]
    fn cohesion_decreases_with_gap_and_angle() {
        let forces = [0.0, 0.25, 0.5, 1.0, 2.0].map(|gap| at(0.0).cohesion(gap * REACH, 0.01));
        assert!(forces.windows(2).all(|f| f[1] < f[0] || f[1] == 0.0) && forces[3] == 0.0);
        assert_eq!(at(0.0).cohesion(-1e-5, 0.01), forces[0]);
        let turned = [0.01, 0.1, 0.3, 1.5].map(|angle| at(angle).cohesion(0.0, 0.01));
        assert!(turned.windows(2).all(|f| f[1] <= f[0]) && turned[3] < 0.06 * turned[0]);
    }
}
