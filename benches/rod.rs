//! Cost of the implicit step of rods: hairs on a head shaken at 2.5 Hz, ±5 cm, and cantilevers of Γ = 10.
//!
//! `cargo bench --bench rod` prints all tables; `cargo bench --bench rod -- nodes strands` prints some.
#![allow(clippy::print_stdout)] // Costs are printed with Newton iterations and errors.

use hairbake::contact::Bodies;
use hairbake::dynamics::batch::Batches;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideState};
use hairbake::dynamics::step_record::StepRecord;
use hairbake::rod::{Rod, RodSource, SegmentSize};
use hairbake::scene::anim::Scheme;
use nalgebra::{Isometry3, Vector3};
use std::time::Instant;

const TABLES: [(&str, fn()); 5] = [
    ("real-time", real_time),
    ("cantilevers", cantilevers),
    ("nodes", nodes),
    ("strands", strands),
    ("threads", threads),
];

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    for (name, table) in TABLES {
        if asked.is_empty() || asked.iter().any(|a| a == name) {
            println!("\n{name}");
            table();
        }
    }
}

fn rod(points: &[Vector3<f64>], nodes: usize, line_density: f64) -> Rod {
    let arc: Vec<f64> = (0..nodes).map(|i| (i as f64 / (nodes - 1) as f64).powf(1.5)).collect();
    Rod::new(&RodSource {
        line_density,
        damping: 0.005,
        segment_size: SegmentSize::COARSE,
        ..RodSource::hair(points, &arc)
    })
    .unwrap()
}

/// `count` wavy hairs of 25 cm, whose lengths vary by up to 5 %.
fn hairs(nodes: usize, count: usize) -> Vec<Rod> {
    let hair = |i: usize| {
        let scale = 0.95 + 0.05 * i as f64 / KINDS as f64;
        let points: Vec<Vector3<f64>> = (0..32)
            .map(|i| {
                let a = f64::from(i) / 31.0;
                Vector3::new(0.1 * (1.0 - (1.5 * a).cos()), 0.05 * (3.0 * a).sin() - 0.18 * a, 0.02 * a)
                    * scale
            })
            .collect();
        rod(&points, nodes, 6.6e-6)
    };
    const KINDS: usize = 101;
    let kinds: Vec<Rod> = (0..KINDS.min(count)).map(hair).collect();
    kinds.iter().cycle().take(count).cloned().collect()
}

/// Rods without contact on a head that moves by `place`.
struct Scene<'a> {
    env: Environment<'a>,
    models: Vec<GuideModel>,
    states: Vec<GuideState>,
    batches: Batches,
    records: Vec<StepRecord>,
    /// Step, s.
    h: f64,
    taken: u32,
}

impl<'a> Scene<'a> {
    fn new(
        rods: Vec<Rod>,
        scheme: Scheme,
        place: &'a (dyn Fn(f64) -> Vector3<f64> + Sync),
        drag: f64,
        h: f64,
    ) -> Self {
        let records = vec![StepRecord::default(); rods.len()];
        let pose = move |t: f64| Isometry3::from_parts(place(t).into(), Default::default());
        let env = Environment {
            head: Box::new(pose),
            body: Box::new(move |_, t| pose(t)),
            ..Environment::at_rest(Bodies::default())
        };
        let model = |rod: Rod| {
            let drag = vec![drag; rod.points()];
            GuideModel { scheme, ..GuideModel::new(rod, drag, 0.3) }
        };
        let models: Vec<GuideModel> = rods.into_iter().map(model).collect();
        let states = models.iter().map(|model| GuideState::new(model, &[], &env, 0.0, h)).collect();
        let batches = Batches::new(&models, |_| true);
        Scene { env, models, states, batches, records, h, taken: 0 }
    }

    /// Hairs on a shaken head.
    fn shaken(rods: Vec<Rod>, scheme: Scheme, rate: f64) -> Self {
        let place = &|t: f64| Vector3::x() * 0.05 * (std::f64::consts::TAU * 2.5 * t).sin();
        Scene::new(rods, scheme, place, 2e-5, 1.0 / rate)
    }

    /// Takes `steps` steps.
    fn run(&mut self, steps: u32) -> Cost {
        let Scene { env, models, states, batches, records, .. } = self;
        let (start, cpu) = (Instant::now(), cpu_seconds());
        let mut iterations = 0;
        for _ in 0..steps {
            let span = [f64::from(self.taken) * self.h, f64::from(self.taken + 1) * self.h];
            batches.step(models, env, states, span, ContactMode::Bodies, records);
            assert!(records.iter().all(|r| r.unconverged == 0));
            iterations += records.iter().map(|r| u64::from(r.iterations)).sum::<u64>();
            self.taken += 1;
        }
        let (wall, cpu) = (start.elapsed().as_secs_f64(), cpu_seconds() - cpu);
        let taken = f64::from(steps) * models.len() as f64;
        Cost { wall, cpu, taken, iterations: iterations as f64 / taken }
    }
}

/// Cost of some steps.
struct Cost {
    wall: f64,
    cpu: f64,
    /// Number of rod steps.
    taken: f64,
    /// Newton iterations per rod step.
    iterations: f64,
}

impl Cost {
    /// CPU time per rod step, µs.
    fn each(&self) -> f64 {
        self.cpu / self.taken * 1e6
    }
}

/// Number of hairs with 8 nodes that are simulated in real time at 25 steps per second.
fn real_time() {
    for scheme in [Scheme::BackwardEuler, Scheme::Bdf2, Scheme::FourStep] {
        let count = 2000;
        let cost = Scene::shaken(hairs(8, count), scheme, 25.0).run(50);
        println!(
            "{scheme:?}, {} threads: {:.0} hairs ({:.2} us of CPU and {:.2} Newton iterations per step)",
            rayon::current_num_threads(),
            2.0 * count as f64 / cost.wall,
            cost.each(),
            cost.iterations
        );
    }
}

/// 200 cantilevers of Γ = 10, released from straight, 10 steps per frame of 1/24 s: cost, and error of the
/// tip at rest.
fn cantilevers() {
    let (length, reach, drop) = (0.25, 0.656_354, 0.700_200);
    let line_density = 10.0 * 7.8e-9 / (9.81 * f64::powi(length, 3));
    for nodes in [3, 4, 5, 8] {
        let straight = [Vector3::zeros(), Vector3::x() * length];
        let rods = (0..200).map(|_| rod(&straight, nodes, line_density)).collect();
        let mut scene = Scene::new(rods, Scheme::default(), &|_| Vector3::zeros(), 2e-6, 1.0 / 240.0);
        let frames = 48;
        let cost = scene.run(10 * frames);
        scene.run(2400);
        let tip = scene.states[0].x.last().unwrap() / length;
        println!(
            "{nodes} nodes: {:.4} CPU s per frame ({:.2} us and {:.2} Newton iterations per step), tip {:.1e} L from the elastica",
            cost.cpu / f64::from(frames),
            cost.each(),
            cost.iterations,
            (tip.x - reach).hypot(tip.y + drop)
        );
    }
}

/// Cost of a rod step against the number of nodes, at 192 steps per second.
fn nodes() {
    let mut last: Option<(f64, f64)> = None;
    for nodes in [4, 8, 16, 32, 64, 128, 256] {
        // About 5 s of CPU time for 64 nodes, 0.5 s for 8: the CPU clock has a resolution of 0.01 s.
        let mut scene = Scene::shaken(hairs(nodes, 256), Scheme::default(), 192.0);
        let cost = scene.run(96);
        print!(
            "{nodes:>6} nodes: {:>8.2} us of CPU and {:.2} Newton iterations per step",
            cost.each(),
            cost.iterations
        );
        println!("{}", exponent(&mut last, nodes as f64, cost.each()));
    }
}

/// Cost of a step of all strands against their number, at 25 steps per second on all threads.
fn strands() {
    let mut last: Option<(f64, f64)> = None;
    for count in [1, 10, 100, 1000, 10_000, 20_000] {
        let mut scene = Scene::shaken(hairs(8, count), Scheme::default(), 25.0);
        let mut wall = 0.0;
        let mut taken = 0.0;
        // One second of motion, repeated until the time is measurable.
        while wall < 0.5 {
            let cost = scene.run(25);
            (wall, taken) = (wall + cost.wall, taken + 25.0);
        }
        print!("{count:>6} strands: {:>10.1} us per step", wall / taken * 1e6);
        println!("{}", exponent(&mut last, count as f64, wall / taken));
    }
}

/// Exponent of the cost between the last number and this one.
fn exponent(last: &mut Option<(f64, f64)>, number: f64, cost: f64) -> String {
    let text =
        last.map_or(String::new(), |(n, c)| format!(", exponent {:.2}", (cost / c).ln() / (number / n).ln()));
    *last = Some((number, cost));
    text
}

/// Speedup by threads.
fn threads() {
    let all = rayon::current_num_threads();
    let cost = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let cost = pool.install(|| Scene::shaken(hairs(8, 2000), Scheme::default(), 25.0).run(50));
        [cost.wall, cost.cpu]
    };
    // Interleaved, so that other load affects both.
    let rounds: Vec<[[f64; 2]; 2]> = (0..3).map(|_| [cost(1), cost(all)]).collect();
    let ratio = |of: usize| {
        let least = |i: usize| rounds.iter().map(|r: &[[f64; 2]; 2]| r[i][of]).fold(f64::INFINITY, f64::min);
        least(0) / least(1)
    };
    println!(
        "{all} threads: speedup {:.2}, efficiency {:.2}; ratio of CPU times {:.2}",
        ratio(0),
        ratio(0) / all as f64,
        ratio(1)
    );
}

/// CPU time of this process so far, s; wall-clock time if the system does not provide it.
fn cpu_seconds() -> f64 {
    // Fields 14 and 15 of /proc/self/stat, in hundredths of a second; the name in field 2 ends at the last
    // bracket.
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
