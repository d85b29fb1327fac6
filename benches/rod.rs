//! Cost of the implicit step of rods: hairs on a head shaken at 2.5 Hz, ±5 cm, and cantilevers of Γ = 10.
#![allow(clippy::print_stdout)] // What a cost means depends on Newton steps and errors; they are told beside it.

use hairbake::bake::company::{Company, CompanyWork};
use hairbake::bake::guide::{Guide, StepRecord, Surroundings, Workspace};
use hairbake::contact::Bodies;
use hairbake::rod::{Rod, RodSource};
use hairbake::scene::anim::Scheme;
use nalgebra::{Isometry3, Vector3};
use rayon::prelude::*;
use std::time::Instant;

fn main() {
    real_time();
    cantilevers();
    divan::main();
}

fn rod(points: &[Vector3<f64>], nodes: usize, line_density: f64, max_step: f64) -> Rod {
    let arc: Vec<f64> = (0..nodes).map(|i| (i as f64 / (nodes - 1) as f64).powf(1.5)).collect();
    Rod::new(&RodSource {
        points,
        root_frame: None,
        arc: &arc,
        stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
        line_density,
        damping: 0.005,
        natural: None,
        max_step,
    })
    .unwrap()
}

/// A wavy hair of 25 cm times `scale`.
fn hair(nodes: usize, max_step: f64, scale: f64) -> Rod {
    let points: Vec<Vector3<f64>> = (0..32)
        .map(|i| {
            let a = f64::from(i) / 31.0;
            Vector3::new(0.1 * (1.0 - (1.5 * a).cos()), 0.05 * (3.0 * a).sin() - 0.18 * a, 0.02 * a) * scale
        })
        .collect();
    rod(&points, nodes, 6.6e-6, max_step)
}

/// Rods without contact on a head that moves by `place`.
struct Scene<'a> {
    place: &'a (dyn Fn(f64) -> Vector3<f64> + Sync),
    drag: f64,
    guides: Vec<Guide>,
    companies: Vec<Company>,
    /// Step, s.
    h: f64,
}

impl<'a> Scene<'a> {
    fn new(rods: Vec<Rod>, place: &'a (dyn Fn(f64) -> Vector3<f64> + Sync), drag: f64, h: f64) -> Self {
        let mut scene = Scene { place, drag, guides: Vec::new(), companies: Vec::new(), h };
        scene.guides = scene.around(|around| {
            let start = |rod: Rod| {
                let drag = vec![scene.drag; rod.points()];
                Guide::new(rod, drag, 0.3, &[], around, 0.0, h)
            };
            rods.into_iter().map(start).collect()
        });
        scene.companies = Company::muster(&scene.guides);
        scene
    }

    fn around<T>(&self, f: impl FnOnce(&Surroundings) -> T) -> T {
        let pose = |t: f64| Isometry3::from_parts((self.place)(t).into(), Default::default());
        f(&Surroundings {
            head: &pose,
            gravity: &|_| Vector3::y() * -9.81,
            wind: &[],
            bodies: &Bodies::new(&[]),
            body: &|_, t| pose(t),
            brought_out: &|_| 1.0,
        })
    }

    /// Steps from number `first` for `count` steps; returns Newton steps taken.
    fn run(&mut self, first: u32, count: u32) -> u64 {
        let mut guides = std::mem::take(&mut self.guides);
        let mut records = vec![StepRecord::default(); guides.len()];
        let mut iterations = 0;
        for i in first..first + count {
            let (mut left, mut left_records) = (&mut guides[..], &mut records[..]);
            let parts = self.companies.iter().map(|company| {
                (
                    company,
                    left.split_off_mut(..company.len).unwrap(),
                    left_records.split_off_mut(..company.len).unwrap(),
                )
            });
            let parts: Vec<_> = parts.collect();
            let span = [f64::from(i) * self.h, f64::from(i + 1) * self.h];
            self.around(|around| {
                parts.into_par_iter().with_min_len(32).for_each_init(
                    CompanyWork::default,
                    |work, (company, guides, records)| {
                        company.advance(guides, around, span, work, records);
                    },
                );
            });
            assert!(records.iter().all(|r| r.unconverged == 0));
            iterations += records.iter().map(|r| u64::from(r.iterations)).sum::<u64>();
        }
        self.guides = guides;
        iterations
    }
}

fn shaken(t: f64) -> Vector3<f64> {
    Vector3::x() * 0.05 * (std::f64::consts::TAU * 2.5 * t).sin()
}

/// How many hairs of 8 nodes, unlike in length by up to a twentieth, move in real time at 25 steps a second.
fn real_time() {
    for scheme in [Scheme::BackwardEuler, Scheme::Bdf2] {
        real_time_with(scheme);
    }
}

fn real_time_with(scheme: Scheme) {
    let hairs = 2000;
    let rods = (0..hairs).map(|i| hair(8, 1.0, 0.95 + 0.05 * f64::from(i % 101) / 101.0)).collect();
    let mut scene = Scene::new(rods, &shaken, 2e-5, 0.04);
    for guide in &mut scene.guides {
        guide.scheme = scheme;
    }
    let (start, cpu) = (Instant::now(), cpu_seconds());
    let iterations = scene.run(0, 25) as f64;
    let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - cpu);
    let steps = 25.0 * f64::from(hairs);
    println!(
        "shaken hairs in real time, {scheme:?}, on {} threads: {:.0} ({:.2} us of CPU a step, {:.2} Newton steps a step)",
        rayon::current_num_threads(),
        f64::from(hairs) / wall,
        cpu / steps * 1e6,
        iterations / steps
    );
}

/// 200 cantilevers of Γ = 10, let go from straight, 10 steps a frame of 1/24 s: cost, and the tip against the heavy elastica once at rest.
fn cantilevers() {
    let (length, reach, drop) = (0.25, 0.656_354, 0.700_200);
    let line_density = 10.0 * 7.8e-9 / (9.81 * f64::powi(length, 3));
    for nodes in [3, 4, 5, 8] {
        let straight = [Vector3::zeros(), Vector3::x() * length];
        let rods = (0..200).map(|_| rod(&straight, nodes, line_density, 1.0)).collect();
        let mut scene = Scene::new(rods, &|_| Vector3::zeros(), 2e-6, 1.0 / 240.0);
        let cpu = cpu_seconds();
        let frames = 48;
        let iterations = scene.run(0, 10 * frames) as f64;
        let cost = (cpu_seconds() - cpu) / f64::from(frames);
        scene.run(10 * frames, 2400);
        let tip = scene.guides[0].x.last().unwrap() / length;
        println!(
            "200 cantilevers, {nodes} nodes, 10 steps a frame: {cost:.4} CPU s a frame ({:.2} us and {:.2} Newton steps a step), \
             tip {:.1e} L from the elastica",
            cost / 2000.0 * 1e6,
            iterations / (2000.0 * f64::from(frames)),
            (tip.x - reach).hypot(tip.y + drop)
        );
    }
}

/// Processor time of this process so far, s; the wall clock where the system does not tell.
fn cpu_seconds() -> f64 {
    // Fields 14 and 15 of /proc/self/stat, in hundredths of a second; the name in field 2 ends at the last bracket.
    let told = || {
        let text = std::fs::read_to_string("/proc/self/stat").ok()?;
        let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
        Some((fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?) / 100.0)
    };
    told().unwrap_or_else(|| {
        static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
        START.elapsed().as_secs_f64()
    })
}

/// A second of motion of one hair at `rate` steps a second.
fn shake(nodes: usize, max_step: f64, rate: u32) -> u32 {
    let h = 1.0 / f64::from(rate);
    let mut scene = Scene::new(vec![hair(nodes, max_step, 1.0)], &shaken, 2e-5, h);
    let (mut guide, mut work) = (scene.guides.remove(0), Workspace::default());
    scene.around(|around| {
        (0..rate)
            .map(|i| guide.advance(around, f64::from(i) * h, f64::from(i + 1) * h, &mut work).iterations)
            .sum()
    })
}

#[divan::bench(args = [(4, 25), (8, 25), (8, 96), (8, 192), (16, 192), (32, 192), (64, 192)])]
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
