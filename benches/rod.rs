//! Cost of one implicit step of one rod: a 25 cm hair on a head shaken at 2.5 Hz, ±5 cm.
#![allow(clippy::print_stdout)] // The cost depends on how many Newton steps a step takes; they are told beside it.

use hairbake::bake::guide::{Guide, Surroundings, Workspace};
use hairbake::contact::Bodies;
use hairbake::rod::{Rod, RodSource};
use nalgebra::{Isometry3, Vector3};

fn main() {
    divan::main();
}

fn hair(nodes: usize, max_step: f64) -> Rod {
    let points: Vec<Vector3<f64>> = (0..32)
        .map(|i| {
            let a = f64::from(i) / 31.0;
            Vector3::new(0.1 * (1.0 - (1.5 * a).cos()), 0.05 * (3.0 * a).sin() - 0.18 * a, 0.02 * a)
        })
        .collect();
    let arc: Vec<f64> = (0..nodes).map(|i| (i as f64 / (nodes - 1) as f64).powf(1.5)).collect();
    Rod::new(&RodSource {
        points: &points,
        root_frame: None,
        arc: &arc,
        stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
        line_density: 6.6e-6,
        damping: 0.005,
        natural: None,
        max_step,
    })
    .unwrap()
}

/// A second of motion at `rate` steps a second.
fn shake(nodes: usize, max_step: f64, rate: u32) -> u32 {
    let pose = |t: f64| Isometry3::translation(0.05 * (std::f64::consts::TAU * 2.5 * t).sin(), 0.0, 0.0);
    let around = Surroundings {
        head: &pose,
        gravity: &|_| Vector3::y() * -9.81,
        wind: &[],
        bodies: &Bodies::new(&[]),
        body: &|_, t| pose(t),
        brought_out: &|_| 1.0,
    };
    let rod = hair(nodes, max_step);
    let drag = vec![2e-5; rod.points()];
    let h = 1.0 / f64::from(rate);
    let mut guide = Guide::new(rod, drag, 0.3, &[], &around, 0.0, h);
    let mut work = Workspace::default();
    (0..rate)
        .map(|i| guide.advance(&around, f64::from(i) * h, f64::from(i + 1) * h, &mut work).iterations)
        .sum()
}

#[divan::bench(args = [(8, 25), (8, 96), (8, 192), (16, 192)])]
fn second_of_shaking_coarse(bencher: divan::Bencher, (nodes, rate): (usize, u32)) {
    println!(
        "{nodes} nodes, {rate} steps: {:.2} Newton steps a step",
        f64::from(shake(nodes, 1.0, rate)) / f64::from(rate)
    );
    bencher.bench(|| shake(nodes, 1.0, rate));
}

#[divan::bench(args = [(8, 192)])]
fn second_of_shaking_as_baked(bencher: divan::Bencher, (nodes, rate): (usize, u32)) {
    bencher.bench(|| shake(nodes, 0.01, rate));
}
