//! Tracks of bodies, from samples in the file or from a motion file.

use super::context::Context;
use crate::error::Error;
use crate::scene::anim::file::{Pops, PoseFile, TrackFile};
use crate::scene::anim::motion_file::load_motion;
use crate::scene::json::array::Array;
use crate::scene::json::diagnostics::{Diagnostics, MAX_REPORTED};
use crate::scene::json::key::Key;
use crate::scene::track::{MAX_DISTANCE, Pop, PoseSamples, Track, find_pops};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use std::collections::BTreeSet;
use std::ops::Range;

/// Most missing samples in a gap that is bridged: a longer gap is no tracker drop-out, and bridging it would
/// invent motion.
const MAX_BRIDGED: i64 = 29;
/// Fewest samples from which others are bridged.
const MIN_VALID: usize = 3;

/// The track at `key`.
pub fn track(context: &mut Context, key: &Key, file: TrackFile) -> Option<Track> {
    let rest = match file.rest {
        Some(rest) => rest_pose(context, &key.name("rest"), &rest),
        None => Some(Isometry3::identity()),
    };
    let (pops, smoothing_hz) = (file.pops, file.smoothing_hz);
    let start = file.first_frame.unwrap_or(context.frames.0.into()) / context.fps;
    let source = read_source(context, key, file)?;
    if !check_places(context.diagnostics, &source.key, &source.poses) {
        return None;
    }
    let (poses, bridged) = match source.numbers {
        Some(numbers) => fill_gaps(context.diagnostics, &key.name("frames"), &numbers, source.poses, pops)?,
        None => (source.poses, Vec::new()),
    };
    // Without a rate there are no times to check.
    if context.diagnostics.reports(&Key::at("fps")) || context.diagnostics.reports(&key.name("fps")) {
        return None;
    }
    let mut samples = PoseSamples { start, rate: source.rate, poses, bridged };
    check_coverage(context, key, &samples);
    check_pops(context, &source.key, &mut samples, pops);
    let valid = samples.poses.len() - samples.bridged.len();
    if !samples.bridged.is_empty() && valid < MIN_VALID {
        let message = format!("only {valid} samples are valid, too few to bridge the others");
        let allowed = format!("{MIN_VALID} or more valid samples");
        context.diagnostics.add(&source.key, message, allowed, "correct the track");
        return None;
    }
    Some(Track::through(&samples, smoothing_hz, &rest?))
}

/// Poses from a motion file or from the animation itself.
struct Source {
    /// Where the poses are.
    key: Key,
    /// Samples per second.
    rate: f64,
    poses: Vec<Isometry3<f64>>,
    /// Number of each sample, if there may be gaps.
    numbers: Option<Vec<i32>>,
}

fn read_source(context: &mut Context, key: &Key, file: TrackFile) -> Option<Source> {
    if let Some(name) = &file.file {
        check_only_file(context.diagnostics, key, &file);
        let key = key.name("file");
        let (rate, poses) = motion_file(context, &key, name)?;
        return Some(Source { key, rate, poses, numbers: None });
    }
    let numbers = match file.frames {
        Some(frames) => Some(context.buffers.load(frames, &key.name("frames"), context.diagnostics)?),
        None => None,
    };
    let array = if file.translation.is_some() { "translation" } else { "rotation_wxyz" };
    let poses = poses(context, key, file.translation, file.rotation_wxyz)?;
    let rate = file.fps.unwrap_or(context.fps);
    Some(Source { key: key.name(array), rate, poses, numbers })
}

/// Reports keys that are given together with `file`.
fn check_only_file(diagnostics: &mut Diagnostics, key: &Key, file: &TrackFile) {
    let given = [
        ("fps", file.fps.is_some()),
        ("frames", file.frames.is_some()),
        ("translation", file.translation.is_some()),
        ("rotation_wxyz", file.rotation_wxyz.is_some()),
    ];
    for (name, _) in given.iter().filter(|(_, given)| *given) {
        let message = "is given together with \"file\", which has its own";
        let allowed = "either \"file\" or samples here";
        diagnostics.add(&key.name(name), message, allowed, "remove one of the two");
    }
}

fn rest_pose(context: &mut Context, key: &Key, file: &PoseFile) -> Option<Isometry3<f64>> {
    let q = context.quaternion(&key.name("rotation_wxyz"), file.rotation_wxyz)?;
    Some(context.convention.pose_in(file.translation.into(), q))
}

/// The poses of the samples in the animation itself.
fn poses(
    context: &mut Context,
    key: &Key,
    translation: Option<Array<[f64; 3]>>,
    rotation: Option<Array<[f64; 4]>>,
) -> Option<Vec<Isometry3<f64>>> {
    if translation.is_none() && rotation.is_none() {
        let allowed = "\"file\", or \"translation\" and \"rotation_wxyz\"";
        let help = "add samples, or remove the track for a body that does not move";
        context.diagnostics.add(key, "has no samples", allowed, help);
        return None;
    }
    let translation =
        translation.map(|array| context.buffers.load(array, &key.name("translation"), context.diagnostics));
    let rotation_key = key.name("rotation_wxyz");
    let rotation = rotation.map(|array| {
        let array = context.buffers.load(array, &rotation_key, context.diagnostics)?;
        context.diagnostics.unit_quaternions(&rotation_key, &array)
    });
    // A missing array means the default value for every sample; an invalid one ends here.
    let translation = translation.map_or(Some(None), |t| t.map(Some))?;
    let rotation = rotation.map_or(Some(None), |r| r.map(Some))?;
    let n = translation.as_ref().map_or_else(|| rotation.as_ref().map_or(0, Vec::len), Vec::len);
    if n == 0 {
        context.diagnostics.add(key, "has no samples", "at least one sample", "add samples");
        return None;
    }
    if let Some(rotation) = &rotation
        && !context.diagnostics.expect_len(&rotation_key, rotation.len(), n, "sample of \"translation\"")
    {
        return None;
    }
    let pose = |i: usize| {
        let p = translation.as_ref().map_or(Vector3::zeros(), |t| t[i].into());
        let q = rotation.as_ref().map_or(UnitQuaternion::identity(), |r| r[i]);
        context.convention.pose_in(p, q)
    };
    Some((0..n).map(pose).collect())
}

/// Sample rate and poses of the motion file `name`. Its errors are reported at their places in it.
fn motion_file(context: &mut Context, key: &Key, name: &str) -> Option<(f64, Vec<Isometry3<f64>>)> {
    let diagnostics = &mut *context.diagnostics;
    let path = context.folder.join(name);
    let mut unreadable = |why: &str| {
        diagnostics.add(
            key,
            format!("cannot read \"{name}\": {why}"),
            "a readable motion file",
            "correct the path; it is relative to the folder of this file",
        );
    };
    match load_motion(&path) {
        Ok((file, poses)) => return Some((file.fps, poses)),
        Err(Error::BadInput(_)) if !path.is_file() => unreadable("no such file"),
        Err(Error::BadInput(found)) => diagnostics.add_elsewhere(found),
        Err(Error::Io { source, .. }) => unreadable(&source.to_string()),
        Err(e) => diagnostics.add(key, e.to_string(), "a motion file", "correct the path"),
    }
    None
}

/// Fills the gaps between samples, whose numbers are the array at `key`. Returns the poses, and the indices
/// of those that are fillers.
fn fill_gaps(
    diagnostics: &mut Diagnostics,
    key: &Key,
    numbers: &[i32],
    poses: Vec<Isometry3<f64>>,
    pops: Pops,
) -> Option<(Vec<Isometry3<f64>>, Vec<usize>)> {
    if !diagnostics.expect_len(key, numbers.len(), poses.len(), "sample") {
        return None;
    }
    let before = diagnostics.len();
    for (i, pair) in numbers.windows(2).enumerate() {
        let step = i64::from(pair[1]) - i64::from(pair[0]);
        let (message, allowed, help) = match step {
            1 => continue,
            ..1 => (
                format!("{} follows {}", pair[1], pair[0]),
                "increasing numbers".to_string(),
                "sort the samples by time, each once".to_string(),
            ),
            _ if pops == Pops::Bridge && step <= MAX_BRIDGED + 1 => continue,
            _ => (
                format!("{} follows {}; number of missing samples: {}", pair[1], pair[0], step - 1),
                format!("{}", i64::from(pair[0]) + 1),
                format!(
                    "fill the gap, or set \"pops\": \"bridge\" to bridge gaps of up to {MAX_BRIDGED} samples"
                ),
            ),
        };
        diagnostics.add(&key.index(i + 1), message, allowed, help);
    }
    if diagnostics.len() > before {
        return None;
    }
    let (mut filled, mut fillers) = (Vec::new(), Vec::new());
    for (pose, &number) in poses.into_iter().zip(numbers) {
        let place = (i64::from(number) - i64::from(numbers[0])) as usize;
        for missing in filled.len()..place {
            fillers.push(missing);
            filled.push(pose);
        }
        filled.push(pose);
    }
    Some((filled, fillers))
}

/// Checks that the poses at `key` are places of a head. Reports those that are not, and returns false.
fn check_places(diagnostics: &mut Diagnostics, key: &Key, poses: &[Isometry3<f64>]) -> bool {
    let places = poses.iter().map(|pose| pose.translation.vector).enumerate();
    let far: Vec<_> = places.filter(|(_, x)| x.norm() > MAX_DISTANCE).take(MAX_REPORTED).collect();
    for (i, x) in &far {
        let message = format!("is at ({:.3e}, {:.3e}, {:.3e}) m", x.x, x.y, x.z);
        let allowed = format!("up to {MAX_DISTANCE:e} m from the origin");
        diagnostics.add(&key.index(*i), message, allowed, "correct the sample, or the metres per unit");
    }
    far.is_empty()
}

/// Checks that the track covers the frames of the bake.
fn check_coverage(context: &mut Context, key: &Key, samples: &PoseSamples) {
    if samples.poses.len() < 2 {
        return;
    }
    let first = samples.start * context.fps;
    let last = first + (samples.poses.len() - 1) as f64 * context.fps / samples.rate;
    // The last frame may lie up to one sample beyond the last sample, and rounding may add to that.
    let slack = 1e-6 + context.fps / samples.rate;
    let (a, b) = (f64::from(context.frames.0), f64::from(context.frames.1));
    if a < first - slack || b > last + slack {
        let message = format!("covers frames {first:.2} to {last:.2}, not all of {a} to {b}");
        let allowed = format!("\"frames\" within {} to {}", first.ceil(), last.floor());
        let help = "shorten \"frames\", or correct \"first_frame\" or \"fps\"";
        context.diagnostics.add(key, message, allowed, help);
    }
}

/// Reports the pops of the track whose samples are at `key`, or marks them to be bridged.
fn check_pops(context: &mut Context, key: &Key, samples: &mut PoseSamples, pops: Pops) {
    if pops == Pops::Keep {
        return;
    }
    let gaps: BTreeSet<usize> = samples.bridged.iter().copied().collect();
    let mut bridged = gaps.clone();
    let mut count = 0;
    for pop in find_pops(&samples.poses, samples.rate) {
        let sample = pop.sample();
        if gaps.contains(&sample) || sample > 0 && gaps.contains(&(sample - 1)) {
            continue;
        }
        if pops == Pops::Bridge && !pop.lasts() {
            bridged.extend(pop.off);
            continue;
        }
        count += 1;
        if count <= MAX_REPORTED {
            let frame = (samples.start + sample as f64 / samples.rate) * context.fps;
            report_pop(context.diagnostics, &key.index(sample), &pop, samples.poses.len(), frame);
        }
    }
    samples.bridged = bridged.into_iter().collect();
    if count > MAX_REPORTED {
        let message = format!("{count} samples jump");
        context.diagnostics.add(key, message, "none", "correct the track, or set \"pops\"");
    }
}

/// Reports a pop of a track of `samples` samples, at `frame`.
fn report_pop(diagnostics: &mut Diagnostics, key: &Key, pop: &Pop, samples: usize, frame: f64) {
    let size = |x: f64| if pop.angular { format!("{:.1}°", x.to_degrees()) } else { format!("{x:.4} m") };
    let place = match pop.off {
        ref off if off.is_empty() => format!("jumps by {} at frame {frame:.2}", size(pop.size)),
        Range { start: 0, end } => format!("up to sample {} the track is {} off", end - 1, size(pop.size)),
        Range { start, end } if end == samples => {
            format!("from sample {start} on, at frame {frame:.2}, the track is {} off", size(pop.size))
        }
        _ => format!("jumps there and back by {} at frame {frame:.2}", size(pop.size)),
    };
    let message = format!(
        "{place}: the velocities before and after do not account for it, and the samples around it jump by {}",
        size(pop.nearby)
    );
    let help = if pop.lasts() {
        "correct the track, or set \"pops\": \"keep\" to follow the jump"
    } else {
        "correct the samples, or set \"pops\": \"bridge\" to interpolate them, \"keep\" to follow them"
    };
    diagnostics.add(key, message, format!("at most {}", size(pop.limit)), help);
}
