//! What two guides do to each other where they touch, by the angle between them (S6; `docs/theory.md` §5.2).

use crate::math::frame::frame_towards;
use nalgebra::Vector3;

/// Pairs whose distance exceeds what they keep by less than this at the start of a sub-step are in its problem, m.
pub(super) const REACH: f64 = 5e-4;

/// What a guide is to another that it touches, with the hairs of all that move with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::dynamics) struct BundleProperties {
    /// Radius of one hair, m: what parallel guides keep, for their hairs mix.
    pub hair: f64,
    /// Radius of its hairs pressed together, m: what crossing guides keep, for their hairs cannot.
    pub bundle: f64,
    /// Friction for slip along parallel guides over that of crossing ones.
    pub parallel: f64,
    /// Force per length with which parallel guides cling together that stand for one hair by the count of `hairs`, N/m.
    pub cohesion: f64,
    /// How many hairs it stands for, over a number that is the same for all guides of a scene. Its rod is that of one hair; forces between guides are as of this
    /// many.
    pub hairs: f64,
}

impl BundleProperties {
    /// Takes up the hairs of another guide: pressed together all of them are as thick as their sections ask.
    pub fn carry(&mut self, other: &BundleProperties) {
        self.bundle = self.bundle.hypot(other.bundle);
        self.hairs += other.hairs;
    }
}

/// Two guides where they meet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Encounter {
    skins: [BundleProperties; 2],
    /// Sine of the angle between them, 0..=1.
    sine: f64,
    /// The direction between theirs; a null vector where both have none.
    along: Vector3<f64>,
}

impl Encounter {
    /// Of guides of these skins and directions, unit vectors.
    pub fn new(skins: [BundleProperties; 2], [a, b]: [Vector3<f64>; 2]) -> Self {
        let along = if a.dot(&b) < 0.0 { a - b } else { a + b };
        Encounter { skins, sine: a.cross(&b).norm().min(1.0), along }
    }

    fn mean(&self, of: impl Fn(&BundleProperties) -> f64) -> f64 {
        0.5 * (of(&self.skins[0]) + of(&self.skins[1]))
    }

    /// Distance that they keep, m.
    pub fn kept(&self) -> f64 {
        2.0 * (self.mean(|s| s.hair) + self.mean(|s| s.bundle) * self.sine)
    }

    /// The axes of a contact with normal `n`: that, and tangents along and across the guides. The first tangent is as long as friction along
    /// is weaker than friction across, which makes the elliptic cone a round one, as for bodies.
    pub fn axes(&self, n: &Vector3<f64>) -> [Vector3<f64>; 3] {
        let parallel = self.mean(|s| s.parallel);
        let weaker = parallel + (1.0 - parallel) * self.sine * self.sine;
        let frame = frame_towards(n, &self.along);
        [*n, frame.column(0) * weaker, frame.column(1).into()]
    }

    /// Force with which they cling together, N, at a distance of `gap` over what they keep, m, where a stretch of `length`, m, of each has no
    /// other place: along as much of it as they are within [`REACH`] of each other, fading with the distance as liquid bridges
    /// between fibres do that break at such a length; the more, the more girth their hairs have. Of unlike bundles the thinner counts, as of unlike cylinders: the
    /// harmonic mean.
    pub fn cohesion(&self, gap: f64, length: f64) -> f64 {
        let near = (1.0 - gap.max(0.0) / REACH).max(0.0);
        let girth = 1.0 / self.mean(|s| 1.0 / s.hairs.sqrt());
        self.mean(|s| s.cohesion) * girth * near * length.min(REACH / self.sine.max(f64::MIN_POSITIVE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SKIN: BundleProperties =
        BundleProperties { hair: 4e-5, bundle: 3e-4, parallel: 0.4, cohesion: 0.2, hairs: 1.0 };

    fn at(angle: f64) -> Encounter {
        Encounter::new([SKIN; 2], [Vector3::x(), Vector3::new(angle.cos(), angle.sin(), 0.0)])
    }

    #[test]
    fn guides_that_cross_keep_their_bundles_and_rub_all_ways_alike() {
        let crossing = at(std::f64::consts::FRAC_PI_2);
        assert!((crossing.kept() - 2.0 * (SKIN.hair + SKIN.bundle)).abs() < 1e-15);
        let [_, along, across] = crossing.axes(&Vector3::z());
        assert!((along.norm() - 1.0).abs() < 1e-12 && (across.norm() - 1.0).abs() < 1e-12);
        // They are within reach of each other for no longer than that.
        assert!((crossing.cohesion(0.0, 0.01) - SKIN.cohesion * REACH).abs() < 1e-15);
    }

    #[test]
    fn parallel_guides_mix_slide_along_each_other_and_cling() {
        // Whichever way each runs.
        for angle in [0.0, std::f64::consts::PI] {
            let parallel = at(angle);
            assert!((parallel.kept() - 2.0 * SKIN.hair).abs() < 1e-15);
            let [_, along, across] = parallel.axes(&Vector3::z());
            assert!((along - Vector3::x() * along.x).norm() < 1e-15);
            assert!((along.norm() - SKIN.parallel).abs() < 1e-12 && (across.norm() - 1.0).abs() < 1e-12);
            assert!((parallel.cohesion(0.0, 0.01) - SKIN.cohesion * 0.01).abs() < 1e-15);
        }
    }

    #[test]
    fn bundles_cling_by_their_girth_and_a_thin_one_to_any_other_alike() {
        let between = |hairs: [f64; 2]| {
            let skins = hairs.map(|hairs| BundleProperties { hairs, ..SKIN });
            Encounter::new(skins, [Vector3::x(); 2]).cohesion(0.0, 0.01)
        };
        let one = between([1.0, 1.0]);
        assert!((between([9.0, 9.0]) / one - 3.0).abs() < 1e-12);
        assert!((between([1.0, 1e6]) / one - 2.0).abs() < 0.01);
        assert_eq!(between([1.0, 50.0]), between([50.0, 1.0]));
    }

    #[test]
    fn what_clings_lets_go_with_the_distance_and_with_the_angle() {
        let forces = [0.0, 0.25, 0.5, 1.0, 2.0].map(|gap| at(0.0).cohesion(gap * REACH, 0.01));
        assert!(forces.windows(2).all(|f| f[1] < f[0] || f[1] == 0.0) && forces[3] == 0.0);
        assert_eq!(at(0.0).cohesion(-1e-5, 0.01), forces[0]);
        let turned = [0.01, 0.1, 0.3, 1.5].map(|angle| at(angle).cohesion(0.0, 0.01));
        assert!(turned.windows(2).all(|f| f[1] <= f[0]) && turned[3] < 0.06 * turned[0]);
    }
}
