//! SIGKILL at random moments, until the bake is done.

use super::shot::{Shot, workplace};
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

/// Number of kills with one process at a time, and with two processes that do the same work.
const KILLS: [usize; 2] = [60, 50];

/// Random numbers in 0..1 (splitmix64, Vigna 2015), seeded differently in each run.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn start(shot: &Shot, out: &Path) -> Child {
    shot.bake(out, &["--checkpoint-seconds", "0.02", "--threads", "2"]).spawn().unwrap()
}

/// Kills `child` after `time`; returns `false` if it was done by then.
fn kill_after(mut child: Child, time: Duration) -> bool {
    std::thread::sleep(time);
    if let Some(status) = child.try_wait().unwrap() {
        assert!(status.success(), "{status}");
        return false;
    }
    child.kill().unwrap();
    !child.wait().unwrap().success()
}

/// Bakes into new folders with `at_once` processes at a time, until `kills` processes were killed.
fn storm(at_once: usize, kills: usize, chance: &mut Chance) {
    let shot = Shot::get();
    let begun = Instant::now();
    let folder = workplace();
    assert!(start(shot, &folder.path().join("calm")).wait().unwrap().success());
    // Long enough for some progress, short enough that most do not finish.
    let longest = begun.elapsed().as_secs_f64() * 0.4;
    let (mut killed, mut baked) = (0, 0);
    while killed < kills {
        let out = folder.path().join(baked.to_string());
        loop {
            let children: Vec<Child> = (0..at_once).map(|_| start(shot, &out)).collect();
            let before = killed;
            for child in children {
                killed += usize::from(kill_after(child, Duration::from_secs_f64(longest * chance.next())));
            }
            if killed == before {
                break;
            }
        }
        // The last process removes the files that the killed ones left.
        assert!(start(shot, &out).wait().unwrap().success());
        shot.assert_same(&out);
        baked += 1;
    }
    println!("{killed} kills, {baked} bakes of {at_once} processes at once");
}

#[test]
fn results_do_not_depend_on_kills() {
    let seed = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_nanos() as u64;
    println!("seed {seed}");
    let mut chance = Chance(seed);
    storm(1, KILLS[0], &mut chance);
    storm(2, KILLS[1], &mut chance);
}

#[test]
fn concurrent_processes_make_the_same_cache() {
    let shot = Shot::get();
    let folder = workplace();
    let children: Vec<Child> = (0..3).map(|_| start(shot, folder.path())).collect();
    for mut child in children {
        assert!(child.wait().unwrap().success());
    }
    shot.assert_same(folder.path());
}
