//! Guides that touch each other: cost, contacts and residual against their number, on a shaken head of the sample `short`, 8 nodes a guide and
//! 8 sub-steps a frame.
//!
//! `cargo bench --bench tangle` tries 125 to 4,000 guides; `cargo bench --bench tangle -- 500 1000` some. The head stays the same, so that
//! more guides stand more densely, and contacts grow faster than guides.
#![allow(clippy::print_stdout)] // Cost means little without what was found and how well it was solved.

use hairbake::bake::guide::StepRecord;
use hairbake::bake::rods::Rods;
use hairbake::bake::simulation::Simulation;
use hairbake::sample::{self, Motion, Size, Style};
use hairbake::scene::Anim;
use hairbake::scene::anim::Contact;
use std::time::Instant;

/// The frames that are measured: the second quarter of a second of the shake.
const FRAMES: (i32, i32) = (1006, 1011);

fn main() {
    let asked: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let counts = if asked.is_empty() { vec![125, 250, 500, 1000, 2000, 4000] } else { asked };
    println!(
        "guides  found  active  rounds  residual, mean  at worst  cut short  bodies only, s/frame  full, s/frame"
    );
    let costs: Vec<Cost> = counts.iter().map(|&n| cost(n)).collect();
    let exponent = |of: fn(&Cost) -> f64| {
        let of = |c: &Cost| [(c.guides as f64).ln(), of(c).ln()];
        slope(costs.iter().map(of).collect())
    };
    if costs.len() > 1 {
        println!(
            "exponents against guides: active contacts {:.2}, bodies only {:.2}, full {:.2}",
            exponent(|c| c.active),
            exponent(|c| c.seconds[0]),
            exponent(|c| c.seconds[1])
        );
    }
}

struct Cost {
    guides: usize,
    /// Places that push, mean over sub-steps.
    active: f64,
    /// With bodies only and with all contacts, s a frame.
    seconds: [f64; 2],
}

/// Bakes `guides` guides, without writing anything.
fn cost(guides: usize) -> Cost {
    let folder = tempfile::tempdir().unwrap();
    let size = Size { wisps: Some(guides), strands: 8000, head_rounds: 4 };
    sample::write(Style::Short, size, folder.path()).unwrap();
    let (groom, mut anim) = hairbake::scene::load(
        &folder.path().join("groom.json"),
        &folder.path().join(format!("{}.json", Motion::Shake)),
    )
    .unwrap();
    anim.settings.preroll = 0.25;
    let mut seconds = [0.0; 2];
    let (mut found, mut active, mut steps, mut rounds) = (0, 0, 0, 0);
    let (mut residual, mut worst, mut short) = (0.0, 0.0_f64, 0);
    for (seconds, contact) in seconds.iter_mut().zip([Contact::Bodies, Contact::Full]) {
        anim.settings.contact = contact;
        *seconds = run(&groom, &anim, |records| {
            if contact == Contact::Full {
                let sum = |of: fn(&StepRecord) -> u32| records.iter().map(of).sum::<u32>();
                found += sum(|r| r.strands.found);
                active += sum(|r| r.strands.active);
                short += sum(|r| r.strands.alone + r.strands.held);
                rounds += records.iter().map(|r| r.strands.rounds).max().unwrap_or(0);
                let here = records.iter().map(|r| r.strands.residual).fold(0.0, f64::max);
                residual += here;
                worst = worst.max(here);
                steps += 1;
            }
        });
    }
    let mean = |sum: u32| f64::from(sum) / f64::from(steps);
    println!(
        "{guides:>6}  {:>5.0}  {:>6.0}  {:>6.1}  {:>14.1e}  {worst:>8.1e}  {short:>9}  {:>20.3}  {:>13.3}",
        mean(found),
        mean(active),
        mean(rounds),
        residual / f64::from(steps),
        seconds[0],
        seconds[1]
    );
    Cost { guides, active: mean(active), seconds }
}

/// Seconds a frame over [`FRAMES`], whose sub-steps are told to `each`.
fn run(groom: &hairbake::scene::Groom, anim: &Anim, mut each: impl FnMut(&[StepRecord])) -> f64 {
    let rods = Rods::new(groom, anim);
    let mut simulation = Simulation::new(groom, anim, &rods);
    let half = 0.5 * simulation.step();
    let time = |frame: i32| f64::from(frame) / anim.fps - half;
    while simulation.time() < time(FRAMES.0) {
        simulation.advance();
    }
    let start = Instant::now();
    while simulation.time() < time(FRAMES.1) {
        each(simulation.advance());
    }
    start.elapsed().as_secs_f64() / f64::from(FRAMES.1 - FRAMES.0)
}

/// Slope of the line through points, by least squares.
fn slope(points: Vec<[f64; 2]>) -> f64 {
    let n = points.len() as f64;
    let mean = |d: usize| points.iter().map(|p| p[d]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum::<f64>()
        / points.iter().map(|p| (p[0] - x).powi(2)).sum::<f64>()
}
