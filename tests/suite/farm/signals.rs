//! Signals and time limits.

use super::shot::{Shot, wait_until, workplace};
use std::path::Path;
use std::process::{Child, Command};
use std::time::Duration;

/// A bake with frames long enough to be interrupted.
fn long_bake(shot: &Shot, out: &Path) -> Child {
    shot.bake(out, &["--substeps", "400", "--checkpoint-seconds", "0"]).spawn().unwrap()
}

fn send(signal: &str, child: &Child) {
    assert!(
        Command::new("kill")
            .args([&format!("-{signal}"), &child.id().to_string()])
            .status()
            .unwrap()
            .success()
    );
}

fn checkpoints(out: &Path) -> usize {
    std::fs::read_dir(out.join(".hairbake/checkpoints")).map_or(0, Iterator::count)
}

#[test]
fn stopping_signals_save_and_exit_with_85() {
    let shot = Shot::get();
    for signal in ["TERM", "INT", "USR1"] {
        let folder = workplace();
        let out = folder.path();
        let mut child = long_bake(shot, out);
        wait_until("work folder", || out.join(".hairbake/job.json").exists());
        std::thread::sleep(Duration::from_millis(300));
        send(signal, &child);
        assert_eq!(child.wait().unwrap().code(), Some(85), "{signal}");
        assert_eq!(checkpoints(out), 1, "{signal}");
    }
}

#[test]
fn a_hangup_saves_without_stopping() {
    let shot = Shot::get();
    let folder = workplace();
    let mut child = long_bake(shot, folder.path());
    wait_until("work folder", || folder.path().join(".hairbake/job.json").exists());
    wait_until("checkpoint", || {
        send("HUP", &child);
        checkpoints(folder.path()) > 0
    });
    assert_eq!(child.try_wait().unwrap(), None);
    send("KILL", &child);
    child.wait().unwrap();
}

#[test]
fn a_second_signal_ends_the_process_at_once() {
    let shot = Shot::get();
    let folder = workplace();
    let mut child = long_bake(shot, folder.path());
    wait_until("work folder", || folder.path().join(".hairbake/job.json").exists());
    send("STOP", &child);
    send("TERM", &child);
    send("INT", &child);
    send("CONT", &child);
    // Both signals are pending when the process continues; the second one ends it.
    let code = child.wait().unwrap().code();
    assert!([Some(128 + 2), Some(128 + 15)].contains(&code), "{code:?}");
}

#[test]
fn a_bake_completes_in_many_runs_of_limited_time() {
    let shot = Shot::get();
    let folder = workplace();
    let mut stops = 0;
    loop {
        // Longer each time, since reading the scene takes time too.
        let limit = format!("{}s", 0.04 + 0.01 * f64::from(stops));
        let status = shot.bake(folder.path(), &["--max-runtime", &limit]).status().unwrap();
        if status.success() {
            break;
        }
        assert_eq!(status.code(), Some(85));
        stops += 1;
        assert!(stops < 1000);
    }
    assert!(stops > 1, "it was done after {stops} stops");
    shot.assert_same(folder.path());
}
