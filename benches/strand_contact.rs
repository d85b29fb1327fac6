//! Guides that touch each other: cost, contacts and residual against their number, on a shaken head of the
//! sample `short`, 8 nodes a guide and 8 sub-steps a frame.
//!
//! `cargo bench --bench strand_contact` tries a head of 2,000 guides, then patches about the crown of one of
//! 4,000, of 125 guides to all: as dense, whatever their number. `-- head 500` and `-- patch 500 1000` try
//! some. Seconds of CPU, of all threads together, are those to compare on a machine that others use too.
#![allow(clippy::print_stdout)] // Cost means little without what was found and how well it was solved.

use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::dynamics::step_record::StepRecord;
use hairbake::sample::{self, Motion, Size, Style};
use hairbake::scene::anim::{ContactSetting, Resolution};
use hairbake::scene::{Anim, Groom};
use hairbake::wisp::GuideRod;
use std::time::Instant;

/// The frames that are measured: the second quarter of a second of the shake.
const FRAMES: (i32, i32) = (1006, 1011);

/// Guides of the head that patches are of.
const HEAD: usize = 4000;

/// Render strands of a guide, which tell how thick it is.
const STRANDS: usize = 4;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let counts: Vec<usize> = arguments.iter().filter_map(|a| a.parse().ok()).collect();
    let asked = |name: &str| arguments.iter().any(|a| a == name) || counts.is_empty();
    println!(
        "         guides  found  active  rounds  residual, mean  at worst  cut short  bodies only, s/frame (CPU)     full, s/frame (CPU)"
    );
    if asked("head") {
        for &guides in if counts.is_empty() { &[2000] } else { &counts[..] } {
            cost(guides, guides);
        }
    }
    if asked("patch") {
        let counts = if counts.is_empty() { vec![125, 250, 500, 1000, 2000, HEAD] } else { counts };
        let costs: Vec<Cost> = counts.iter().map(|&n| cost(HEAD, n)).collect();
        let exponent = |of: fn(&Cost) -> f64| {
            let of = |c: &Cost| [(c.guides as f64).ln(), of(c).ln()];
            slope(costs.iter().map(of).collect())
        };
        if costs.len() > 1 {
            println!(
                "exponents against guides: active contacts {:.2}, CPU of bodies only {:.2}, of full {:.2}",
                exponent(|c| c.active),
                exponent(|c| c.cpu[0]),
                exponent(|c| c.cpu[1])
            );
        }
    }
}

struct Cost {
    guides: usize,
    /// Places that push, mean over sub-steps.
    active: f64,
    /// With bodies only and with all contacts, s of CPU a frame.
    cpu: [f64; 2],
}

/// Simulates the `guides` guides nearest to the crown of a head of `head`.
fn cost(head: usize, guides: usize) -> Cost {
    let folder = tempfile::tempdir().unwrap();
    let size = Size { wisps: Some(head), strands: Some(STRANDS * head), head_subdivisions: 4 };
    sample::write(Style::Short, size, folder.path()).unwrap();
    let (groom, mut anim) = hairbake::scene::load(
        &folder.path().join("groom.json"),
        &folder.path().join(format!("{}.json", Motion::Shake)),
    )
    .unwrap();
    anim.settings.preroll = 0.25;
    anim.settings.resolution = Resolution::Full;
    let mut costs = [[0.0; 2]; 2];
    let (mut found, mut active, mut steps, mut rounds) = (0, 0, 0, 0);
    let (mut residual, mut worst, mut short) = (0.0, 0.0_f64, 0);
    for (cost, contact) in costs.iter_mut().zip([ContactSetting::Bodies, ContactSetting::Full]) {
        anim.settings.contact = contact;
        *cost = run(&groom, &anim, guides, |records| {
            if contact == ContactSetting::Full {
                let sum = |of: fn(&StepRecord) -> u32| records.iter().map(of).sum::<u32>();
                found += sum(|r| r.strands.found);
                active += sum(|r| r.strands.active);
                short += sum(|r| r.strands.uncoupled + r.strands.truncated);
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
        "{}  {guides:>6}  {:>5.0}  {:>6.0}  {:>6.1}  {:>14.1e}  {worst:>8.1e}  {short:>9}  {:>20.3} ({:.3})  {:>14.3} ({:.3})",
        if guides < head { "patch" } else { "head " },
        mean(found),
        mean(active),
        mean(rounds),
        residual / f64::from(steps),
        costs[0][0],
        costs[0][1],
        costs[1][0],
        costs[1][1]
    );
    Cost { guides, active: mean(active), cpu: costs.map(|c| c[1]) }
}

/// Seconds and seconds of CPU a frame over [`FRAMES`], whose sub-steps are told to `each`.
fn run(groom: &Groom, anim: &Anim, guides: usize, mut each: impl FnMut(&[StepRecord])) -> [f64; 2] {
    let mut rods = GuideRods::new(groom, anim);
    let height = |r: &GuideRod| r.rod.root.p.y;
    rods.simulated.sort_by(|a, b| height(b).total_cmp(&height(a)));
    rods.simulated.truncate(guides);
    rods.required.truncate(guides);
    let mut simulation = Simulation::new(groom, anim, &rods);
    let half = 0.5 * simulation.model.substep();
    let time = |frame: i32| f64::from(frame) / anim.fps - half;
    while simulation.time() < time(FRAMES.0) {
        simulation.step();
    }
    let (start, before) = (Instant::now(), cpu());
    while simulation.time() < time(FRAMES.1) {
        each(&simulation.step().guides);
    }
    let frames = f64::from(FRAMES.1 - FRAMES.0);
    [start.elapsed().as_secs_f64() / frames, (cpu() - before) / frames]
}

/// Seconds of CPU that this process has used, all threads together; not a number where the system does not
/// tell (Linux does).
fn cpu() -> f64 {
    let told = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // User and system time, in hundredths, are the 12th and 13th entries after the name.
    let after = told.rsplit(')').next().unwrap_or_default();
    let entries: Vec<f64> = after.split_whitespace().map(|e| e.parse().unwrap_or(f64::NAN)).collect();
    entries.get(11..13).map_or(f64::NAN, |t| (t[0] + t[1]) / 100.0)
}

/// Slope of the line through points, by least squares.
fn slope(points: Vec<[f64; 2]>) -> f64 {
    let n = points.len() as f64;
    let mean = |d: usize| points.iter().map(|p| p[d]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum::<f64>()
        / points.iter().map(|p| (p[0] - x).powi(2)).sum::<f64>()
}
