//! A strand swings under its own weight: its period against theory.
//!
//! ```sh
//! cargo run --release --example pendulum
//! ```
//!
//! A long soft strand hangs like a chain. The head jerks it sideways, then it swings freely. The slowest mode
//! of a hanging chain of length L has the angular frequency ω = j/2 √(g/L), where j = 2.40483 is the first zero
//! of the Bessel function J₀. The other modes, which the jerk excites as well, are taken away by damping.

#![allow(clippy::print_stdout)]

use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::rod::{Rod, RodSource, SegmentSize, Taper};
use hairbake::scene::Tree;
use nalgebra::{Isometry3, Vector3};
use std::f64::consts::TAU;

/// Length, m.
const LENGTH: f64 = 0.5;
/// Gravity, m/s².
const GRAVITY: f64 = 9.81;
/// Steps a second.
const RATE: f64 = 240.0;

fn main() {
    let rod = Rod::new(&RodSource {
        points: &[Vector3::zeros(), Vector3::y() * -LENGTH],
        root_frame: None,
        arc: &Tree::default_arc(12),
        stiffness: [7.8e-11, 7.8e-11, 3.6e-11], // N·m²; a hundredth of a hair's: the strand is nearly a chain
        line_density: 6.6e-6,                   // kg/m
        damping: 0.02,                          // s
        taper: Taper::NONE,
        natural_strain: None,
        segment_size: SegmentSize::COARSE,
    })
    .expect("two distinct points make a rod");

    // The head moves by 2 cm within a tenth of a second and then rests. There is no air and no collider.
    let head = |t: f64| Isometry3::translation(0.02 * (t / 0.1).clamp(0.0, 1.0), 0.0, 0.0);
    let env = Environment {
        head: Box::new(head),
        gravity: Box::new(|_| Vector3::y() * -GRAVITY),
        ..Environment::at_rest(Bodies::default())
    };
    let (tip, drag) = (rod.points() - 1, vec![0.0; rod.points()]);
    let model = GuideModel::new(rod, drag, 0.0);
    let mut state = GuideState::new(&model, &[], &env, 0.0, 1.0 / RATE);
    let mut scratch = GuideScratch::default();

    // Steps through six seconds, prints the tip and notes when it crosses the vertical.
    println!("{:>6} {:>8} {:>8} {:>10}", "t, s", "x, cm", "y, cm", "iterations");
    let (mut crossings, mut before) = (Vec::new(), 0.0);
    for step in 0..(6.0 * RATE) as u32 {
        let [t0, t1] = [step, step + 1].map(|i| f64::from(i) / RATE);
        let record = model.step(&env, &mut state, [t0, t1], ContactMode::Bodies, &mut scratch);
        assert_eq!(record.unconverged, 0, "a step did not converge");
        let x = state.x[tip] - head(t1).translation.vector;
        if (step + 1) % 60 == 0 {
            println!("{t1:6.2} {:8.3} {:8.3} {:10}", 100.0 * x.x, 100.0 * x.y, record.iterations);
        }
        if before * x.x < 0.0 {
            crossings.push(t1 - x.x / (x.x - before) / RATE);
        }
        before = x.x;
    }

    // The first crossings still hold faster modes.
    let [first, last] = [2, crossings.len() - 1];
    let period = 2.0 * (crossings[last] - crossings[first]) / (last - first) as f64;
    let chain = TAU / (0.5 * 2.40483 * (GRAVITY / LENGTH).sqrt());
    println!("\nperiod: {period:.4} s; a hanging chain's: {chain:.4} s");
    assert!((period / chain - 1.0).abs() < 0.03, "the period is wrong");
}
