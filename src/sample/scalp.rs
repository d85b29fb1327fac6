//! Where hair grows: roots on the skin of the head above the hairline.

use super::head;
use crate::math::{random, smoothstep};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::PI;

type V = Vector3<f64>;

/// The golden angle, rad: the azimuth between consecutive points of a Fibonacci sphere.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// How far a root is from its point of the Fibonacci sphere, as a share of the distance between points: no
/// rows.
const SCATTER: f64 = 0.6;
/// Of so many roots one may be left out, where there are too many.
const TOO_MANY: usize = 50;
/// Distance that roots keep from the ears, m.
const AROUND_EARS: f64 = 0.004;

/// What is random about a hair; each has numbers of its own.
#[derive(Debug, Clone, Copy)]
pub(super) enum Chance {
    /// Where its root is, along three axes, and whether the hairline is lower there.
    Scatter(u8),
    Hairline,
    /// How much shorter it is, twice, how high it lies, and where it is cut.
    Shorter,
    Uneven,
    Layer,
    Hem,
    /// On which side of a parting it lies, and whether it belongs to a fringe.
    Side,
    FringeDepth,
    FringeWidth,
    /// Where it strays, along three axes, whether it flies away, and how close it keeps to its wisp.
    Stray(u8),
    Flyaway,
    Together,
    /// Its place in a ponytail.
    TailRadius,
    TailTurn,
    /// Its curls: those of its wisp, and how they are its own.
    Phase,
    Pitch,
    OwnPhase,
    OwnPitch,
    OwnRadius,
}

impl Chance {
    /// Where its numbers begin.
    fn stream(self) -> u64 {
        let (kind, axis) = match self {
            Chance::Scatter(axis) => (0, axis),
            Chance::Stray(axis) => (1, axis),
            Chance::Hairline => (2, 0),
            Chance::Shorter => (3, 0),
            Chance::Uneven => (4, 0),
            Chance::Layer => (5, 0),
            Chance::Hem => (6, 0),
            Chance::Side => (7, 0),
            Chance::FringeDepth => (8, 0),
            Chance::FringeWidth => (9, 0),
            Chance::Flyaway => (10, 0),
            Chance::Together => (11, 0),
            Chance::TailRadius => (12, 0),
            Chance::TailTurn => (13, 0),
            Chance::Phase => (14, 0),
            Chance::Pitch => (15, 0),
            Chance::OwnPhase => (16, 0),
            Chance::OwnPitch => (17, 0),
            Chance::OwnRadius => (18, 0),
        };
        (3 * kind + u64::from(axis)) << 2
    }
}

/// A place on the scalp.
#[derive(Debug, Clone, Copy)]
pub(super) struct Root {
    /// Its position, m.
    pub(super) x: V,
    /// Its direction from the centre of the head.
    pub(super) direction: V,
    /// How much higher it is than the hairline, rad.
    pub(super) inside: f64,
    /// Seed of its random numbers.
    seed: u64,
}

impl Root {
    /// A random number in [0, 1).
    pub(super) fn random(&self, of: Chance) -> f64 {
        random::unit(self.seed, of.stream())
    }

    /// A random number of mean 0 and variance 1, at most 3: twice the sum of three uniform ones.
    pub(super) fn normal(&self, of: Chance) -> f64 {
        2.0 * (0..3).map(|k| random::unit(self.seed, of.stream() + k)).sum::<f64>() - 3.0
    }
}

/// Lowest elevation of hair, rad, at an azimuth from the face, rad, seen from the centre of the head:
/// forehead, recess, temple, sideburn, above and behind the ear, nape.
const HAIRLINE: [[f64; 2]; 9] = [
    [0.0, 0.50],
    [0.35, 0.53],
    [0.78, 0.42],
    [1.02, 0.12],
    [1.27, -0.28],
    [1.45, -0.02],
    [1.75, -0.06],
    [2.05, -0.50],
    [2.50, -0.78],
];
const NAPE: f64 = -0.82;
/// Width over which hair becomes dense at the hairline, rad: over the face, and at the nape.
const SOFT: [f64; 2] = [0.05, 0.14];
/// Azimuths between which the one passes into the other, rad.
const BEHIND_EARS: [f64; 2] = [1.6, 2.4];

fn hairline(azimuth: f64) -> f64 {
    let k = HAIRLINE.partition_point(|[a, _]| *a <= azimuth).max(1);
    let ([a0, e0], [a1, e1]) = (HAIRLINE[k - 1], *HAIRLINE.get(k).unwrap_or(&[PI, NAPE]));
    e0 + (e1 - e0) * (azimuth - a0) / (a1 - a0)
}

/// `count` roots, evenly spread over the scalp: scattered points of a Fibonacci sphere above the hairline.
/// Roots of another `family` are others.
pub(super) fn roots(count: usize, family: u64) -> Vec<Root> {
    let on_scalp = |points: usize| -> Vec<Root> {
        let root = |i: usize| root(i, points, random::bits(family, i as u64));
        (0..points).into_par_iter().filter_map(root).collect()
    };
    let mut points = 2 * count;
    let n = on_scalp(points).len();
    if n > count + count / TOO_MANY {
        points = points * (count + count / (2 * TOO_MANY)) / n;
    }
    loop {
        let found = on_scalp(points);
        if found.len() >= count {
            // Points follow each other from the crown to the nape: the last ones are all of the nape.
            return (0..count).map(|i| found[i * found.len() / count]).collect();
        }
        points += (count - found.len()).max(1);
    }
}

/// The root at point `i` of a Fibonacci sphere of so many points, if hair grows there.
fn root(i: usize, points: usize, seed: u64) -> Option<Root> {
    let mut root = Root { x: V::zeros(), direction: V::zeros(), inside: 0.0, seed };
    let y = 1.0 - (2.0 * i as f64 + 1.0) / points as f64;
    let (sin, cos) = (i as f64 * GOLDEN_ANGLE).sin_cos();
    let level = (1.0 - y * y).sqrt();
    let spacing = (4.0 * PI / points as f64).sqrt();
    let scatter = V::from_fn(|k, _| root.random(Chance::Scatter(k as u8)) - 0.5) * (2.0 * SCATTER * spacing);
    root.direction = (V::new(level * sin, y, level * cos) + scatter).normalize();
    let (d, azimuth) = (root.direction, root.direction.x.abs().atan2(root.direction.z));
    // No hairline is a line.
    let waves = 0.03 * (11.0 * azimuth + 0.7 * d.x.signum()).sin() + 0.02 * (23.0 * azimuth).sin();
    let soft = SOFT[0] + (SOFT[1] - SOFT[0]) * smoothstep(BEHIND_EARS, azimuth);
    root.inside = d.y.asin() - hairline(azimuth) - waves - soft * (root.random(Chance::Hairline) - 0.3);
    if root.inside < 0.0 {
        return None;
    }
    root.x = head::point(d);
    (head::ear(root.x) > AROUND_EARS).then_some(root)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_as_many_as_asked_and_reach_from_the_forehead_to_the_nape() {
        for count in [1, 7, 88, 2000] {
            let roots = roots(count, 0);
            assert_eq!(roots.len(), count);
            let at_nape = roots.iter().filter(|root| root.x.z < -0.04 && root.x.y < 0.12).count();
            let before = roots.iter().filter(|root| root.x.z > 0.04).count();
            assert!(count < 50 || 20 * at_nape.min(before) > count, "{at_nape} and {before} of {count}");
        }
    }
}
