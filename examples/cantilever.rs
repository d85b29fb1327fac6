//! A cantilever under its own weight: the tip of one rod against beam theory.
//!
//! ```sh
//! cargo run --release --example cantilever
//! ```
//!
//! A straight inextensible beam of length L is clamped horizontally. Its shape depends on one number, the
//! load Γ = ρSgL³ / EI. The Euler-Bernoulli beam drops by Γ L / 8, which holds for small Γ only. The heavy
//! elastica holds for all. With θ the angle below the horizontal and s the arc length in lengths of the beam:
//!
//! ```text
//! θ'' = -Γ (1 - s) cos θ,   θ(0) = 0,   θ'(1) = 0.
//! ```
//!
//! The rod has eight nodes, as many as a guide of a groom.

#![allow(clippy::print_stdout)]

use hairbake::rod::newton::Solver;
use hairbake::rod::potential::{Load, PointLoad};
use hairbake::rod::{Rod, RodShape, RodSource, SegmentSize};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// Length, m.
const LENGTH: f64 = 0.25;
/// Bending stiffness EI, N·m².
const BENDING: f64 = 7.8e-9;
/// Torsional stiffness GJ, N·m².
const TORSION: f64 = 3.6e-9;
/// Gravity, m/s².
const GRAVITY: f64 = 9.81;

fn main() {
    println!("{:>6} {:>10} {:>10} {:>10} {:>10} {:>10}", "Γ", "beam", "elastica", "", "rod", "error");
    println!("{:>6} {:>10} {:>10} {:>10} {:>10} {:>10}", "", "drop/L", "reach/L", "drop/L", "drop/L", "/L");
    for gamma in [0.01, 0.1, 1.0, 10.0, 100.0] {
        let [reach, drop] = elastica(gamma);
        let [x, y] = rod(gamma);
        let error = (x - reach).hypot(y - drop);
        println!("{gamma:6} {:10.6} {reach:10.6} {drop:10.6} {y:10.6} {error:10.1e}", gamma / 8.0);
        assert!(error < 1e-4, "the rod misses the elastica");
    }
}

/// Reach and drop of the rod's tip, in lengths.
fn rod(gamma: f64) -> [f64; 2] {
    let line = [Vector3::zeros(), Vector3::x() * LENGTH];
    // Nodes crowd at the clamp, where the rod bends most.
    let nodes = [0.0, 0.054, 0.153, 0.281, 0.432, 0.604, 0.794, 1.0];
    let rod = Rod::new(&RodSource {
        stiffness: [BENDING, BENDING, TORSION],
        line_density: gamma * BENDING / (GRAVITY * LENGTH.powi(3)),
        segment_size: SegmentSize::COARSE,
        ..RodSource::hair(&line, &nodes)
    })
    .expect("two distinct points make a rod");

    // Minimises the incremental potential of an implicit time step h. Inertia vanishes as h grows, so a step
    // of 1000 s is a static solve. The short steps before it lead from the straight rod to its neighbourhood.
    let mut q = vec![0.0; rod.unknowns()];
    let mut solver = Solver::default();
    for h in [0.1, 0.1, 0.1, 1000.0, 1000.0] {
        let mut shape = RodShape::default();
        shape.update(&rod, &rod.root.r, &q);
        let points = (0..rod.points()).map(|k| PointLoad {
            inertial: shape.x(k), // At rest: where the point is.
            previous: shape.x(k),
            air: Vector3::zeros(),
            tangent: shape.tangent(k),
            drag: 0.0,
        });
        let (mut load, start) = (Load::default(), q.clone());
        load.set(&rod, h, &(-GRAVITY * Vector3::y()), &start, points);
        let outcome = solver.minimise(&rod, &rod.root.r, &load, &mut q, &start);
        assert!(outcome.converged, "Newton's method did not converge: {outcome:?}");
    }
    let tip = solver.shape.x(rod.points() - 1) / LENGTH;
    [tip.x, -tip.y]
}

/// Reach and drop of the elastica's tip, in lengths: integrates from the free end, and bisects the angle
/// there until the clamp is horizontal.
fn elastica(gamma: f64) -> [f64; 2] {
    let (mut low, mut high) = (0.0, FRAC_PI_2);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if shoot(gamma, middle)[0] < 0.0 { low = middle } else { high = middle }
    }
    let [_, _, reach, drop] = shoot(gamma, high);
    [reach, drop]
}

/// θ, dθ/dt, reach and drop at the clamp, t = 1 - s = 1, of the elastica with angle `tip` at its free end, t
/// = 0. Classical Runge-Kutta method.
fn shoot(gamma: f64, tip: f64) -> [f64; 4] {
    const STEPS: u32 = 2000;
    let h = 1.0 / f64::from(STEPS);
    let rate = |t: f64, y: [f64; 4]| [y[1], -gamma * t * y[0].cos(), y[0].cos(), y[0].sin()];
    let mut y = [tip, 0.0, 0.0, 0.0];
    for i in 0..STEPS {
        let t = f64::from(i) * h;
        let ahead = |k: [f64; 4], a: f64| std::array::from_fn(|c| y[c] + a * k[c]);
        let k1 = rate(t, y);
        let k2 = rate(t + 0.5 * h, ahead(k1, 0.5 * h));
        let k3 = rate(t + 0.5 * h, ahead(k2, 0.5 * h));
        let k4 = rate(t + h, ahead(k3, h));
        y = std::array::from_fn(|c| y[c] + h / 6.0 * (k1[c] + 2.0 * (k2[c] + k3[c]) + k4[c]));
    }
    y
}
