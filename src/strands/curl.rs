//! Curls: the axis that a curve winds about, and the phase of one curl relative to another
//! (`docs/theory.md` §7.1).

use super::guide_place::GuidePlace;
use super::moving_rotation::MovingRotation;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::iter;

/// Turns of a curl over which its tangent is averaged, twice. Fewer do not hide turns that unwind; more lag
/// behind bends.
const TURNS: f64 = 1.5;

/// Product of the sines of the angles of two curls with their axes up to which they have no phase.
const MIN_WINDING: f64 = 0.1;

/// Product of the sines, above [`MIN_WINDING`], of which a curl follows its phase half.
const PHASE_FADE: f64 = 0.05;

/// Length of a mean tangent of which the axis that it gives is shortened by 30 %. Where it is shorter, the
/// curve turns back within the average, and the direction of the mean may change at once.
const MIN_MEAN: f64 = 0.3;

/// Largest half phase, rad: short of π/2, so that a rotation by a phase about an axis of any length is one.
const MAX_HALF_PHASE: f64 = 1.52;

/// Cosine and sine of half the angle by which a curl is ahead of another.
pub(super) type HalfPhase = [f32; 2];

/// The half phase of curls that wind alike.
pub(super) const IN_PHASE: HalfPhase = [1.0, 0.0];

/// Turns a curve at rest by its half phase about an axis.
pub(super) fn about(axis: &Vector3<f64>, [cosine, sine]: HalfPhase) -> MovingRotation<f64> {
    MovingRotation::about((*axis).into(), Vector3::zeros().into(), cosine.into(), sine.into())
}

/// Where a curve is averaged to find the axes that it winds about at some of its places.
#[derive(Debug, Clone)]
pub(super) struct Winding {
    /// Arc length of a turn, m.
    turn: f64,
    /// Arc length of each average, m.
    width: f64,
    /// Lengths of the segments, m.
    segments: Vec<f64>,
    /// For each axis, the places at a distance of `width` before, at, and after it.
    places: Vec<[GuidePlace; 3]>,
}

impl Winding {
    /// Of a curve with points at `arc`, m, and turns of the length `turn`, m, at the arc lengths `at`.
    pub fn new(arc: &[f64], turn: f64, at: impl Iterator<Item = f64>) -> Self {
        let length = arc[arc.len() - 1];
        let width = (TURNS * turn).min(0.5 * length);
        let places = at.map(|s| {
            let middle = s.clamp(width, length - width);
            [middle - width, middle, middle + width].map(|s| GuidePlace::at(arc, s))
        });
        Winding {
            turn,
            width,
            segments: arc.windows(2).map(|ends| ends[1] - ends[0]).collect(),
            places: places.collect(),
        }
    }

    /// Arc length of a turn, m.
    pub fn turn(&self) -> f64 {
        self.turn
    }

    /// The axes, and their rates if `x` are velocities: means of the tangent of the curve through `x`, m,
    /// weighted by a triangle.
    pub fn means(&self, x: &[Vector3<f64>]) -> impl Iterator<Item = Vector3<f64>> {
        // The mean of the mean of a derivative is the second difference of the integral.
        let areas = x.windows(2).zip(&self.segments).scan(Vector3::zeros(), |sum, (ends, length)| {
            *sum += (ends[0] + ends[1]) * (0.5 * length);
            Some(*sum)
        });
        let integral: Vec<Vector3<f64>> = iter::once(Vector3::zeros()).chain(areas).collect();
        self.places.iter().map(move |places| {
            let [before, at, after] = places.map(|place| {
                let (from, to, u) = place.ends(x);
                let k = place.segment();
                integral[k] + (from + (to - from) * (0.5 * u)) * (u * self.segments[k])
            });
            (before - at * 2.0 + after) / (self.width * self.width)
        })
    }
}

/// The axis of a mean tangent and its rate, 1/s: a unit vector where the mean is not small. Smooth.
pub(super) fn axis(mean: &Vector3<f64>, rate: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let square = mean.norm_squared() + MIN_MEAN * MIN_MEAN;
    let size = square.sqrt();
    [mean / size, (rate - mean * (mean.dot(rate) / square)) / size]
}

/// How a curve through `x`, m, at `arc`, m, with unit `tangents` winds, and its axes at the points; None for
/// one that is straight, merely bent, or wavy by less than 18° in the root mean square.
pub(super) fn wound(
    arc: &[f64],
    x: &[Vector3<f64>],
    tangents: &[Vector3<f64>],
) -> Option<(Winding, Vec<Vector3<f64>>)> {
    let winding = Winding::new(arc, turn_length(arc, tangents)?, arc.iter().copied());
    let means: Vec<_> = winding.means(x).collect();
    let across: f64 = tangents.iter().zip(&means).map(|(t, mean)| (t - mean).norm_squared()).sum();
    let axes = means.iter().map(|mean| axis(mean, &Vector3::zeros())[0]);
    (across > MIN_WINDING * arc.len() as f64).then(|| (winding, axes.collect()))
}

/// Arc length of a turn of the curl with unit `tangents` at points at `arc`, m: the tangent of a helix
/// changes in a direction that turns once per turn, to the same side. None if the curve does not wind twice;
/// noise winds to and fro.
fn turn_length(arc: &[f64], tangents: &[Vector3<f64>]) -> Option<f64> {
    let bends: Vec<Vector3<f64>> = tangents.windows(2).map(|t| t[1] - t[0]).collect();
    let (mut turned, mut along) = (0.0, 0.0);
    for ((bends, tangent), s) in bends.windows(2).zip(&tangents[1..]).zip(arc.windows(3)) {
        let weight = (bends[0].norm() * bends[1].norm()).sqrt();
        let side = tangent.dot(&bends[0].cross(&bends[1])).signum();
        turned += side * weight * bends[0].angle(&bends[1]);
        along += weight * 0.5 * (s[2] - s[0]);
    }
    let length = TAU * along / turned.abs();
    (2.0 * length <= arc[arc.len() - 1]).then_some(length)
}

/// Half the angle by which a curl with tangent `tangent` about `axis` is ahead of one with tangent `of` about
/// `of_axis`: none where either hardly winds.
pub(super) fn half_phase(
    [tangent, axis]: [&Vector3<f64>; 2],
    [of, of_axis]: [&Vector3<f64>; 2],
) -> HalfPhase {
    let across = |x: &Vector3<f64>, axis: &Vector3<f64>| {
        let axis = axis.try_normalize(1e-9).unwrap_or_default();
        x - axis * axis.dot(x)
    };
    let along = of_axis.try_normalize(1e-9).unwrap_or_default();
    let (own, other) = (across(&across(tangent, axis), &along), across(of, &along));
    let (cosine, sine) = (other.dot(&own), along.dot(&other.cross(&own)));
    let product = cosine.hypot(sine);
    if product <= MIN_WINDING {
        return IN_PHASE;
    }
    let share = 1.0 - MIN_WINDING / product;
    let half = 0.5 * (sine * share).atan2(cosine * share + PHASE_FADE);
    let half = half.clamp(-MAX_HALF_PHASE, MAX_HALF_PHASE);
    [half.cos() as f32, half.sin() as f32]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A helix about z of 3 turns, with a phase, rad: points at arc lengths, tangents.
    fn helix(phase: f64) -> (Vec<f64>, Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
        let angle = |i: usize| 0.1 * i as f64 + phase;
        let each = (0..189).map(|i| {
            let (sine, cosine) = angle(i).sin_cos();
            let x = Vector3::new(0.006 * cosine, 0.006 * sine, 0.008 * angle(i));
            (0.001 * i as f64, (x, Vector3::new(-0.6 * sine, 0.6 * cosine, 0.8)))
        });
        let (arc, rest): (Vec<_>, Vec<_>) = each.unzip();
        let (x, tangents) = rest.into_iter().unzip();
        (arc, x, tangents)
    }

    #[test]
    fn helix_has_its_turn_length_and_axis() {
        let (arc, x, tangents) = helix(0.0);
        let turn = turn_length(&arc, &tangents).unwrap();
        assert!((turn / (0.01 * TAU) - 1.0).abs() < 0.01, "{turn}");
        let winding = Winding::new(&arc, turn, arc.iter().copied());
        for mean in winding.means(&x) {
            assert!(mean.xy().norm() < 0.03 && (mean.z - 0.8).abs() < 0.03, "{mean}");
        }
        assert!(wound(&arc, &x, &tangents).is_some());
        // A line does not wind, and what turns less than twice is a bend.
        assert_eq!(turn_length(&arc, &vec![Vector3::z(); arc.len()]), None);
        assert_eq!(turn_length(&arc[..100], &tangents[..100]), None);
    }

    #[test]
    fn phase_is_the_angle_between_curls_and_none_between_straight_curves() {
        let (_, _, tangents) = helix(0.0);
        for phase in [-2.5, -0.4, 0.0, 1.0, 3.0] {
            let (_, _, ahead) = helix(phase);
            let [cosine, sine] = half_phase([&ahead[30], &Vector3::z()], [&tangents[30], &Vector3::z()]);
            let found = 2.0 * f64::from(sine).atan2(f64::from(cosine));
            assert!((found - phase).abs() < 0.15, "{found} {phase}");
        }
        let straight = Vector3::new(0.1, 0.0, 1.0).normalize();
        assert_eq!(half_phase([&straight, &Vector3::z()], [&-straight, &Vector3::z()]), IN_PHASE);
    }

    #[test]
    fn rate_of_an_axis_is_its_derivative() {
        let (mean, rate) = (Vector3::new(0.1, -0.2, 0.3), Vector3::new(2.0, 1.0, -0.5));
        let at = |t: f64| axis(&(mean + rate * t), &rate)[0];
        let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
        assert!((slope - axis(&mean, &rate)[1]).norm() < 1e-8);
    }
}
