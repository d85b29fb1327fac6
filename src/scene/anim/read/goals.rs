//! Animated curves that guides are pulled to.

use super::context::Context;
use super::keyframes::{ramp, share_keyframes};
use super::samples::{Samples, samples};
use crate::math::polyline;
use crate::math::sample_times::SampleTimes;
use crate::scene::anim::file::GoalFile;
use crate::scene::anim::goal::{Goal, GoalCurves, GoalPull};
use crate::scene::convention::Convention;
use crate::scene::json::key::Key;
use crate::scene::keyframes::Keyframes;
use crate::scene::obj_curves::ObjCurves;
use nalgebra::SVector;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

/// A curve that is shorter is degenerate, m.
const MIN_LENGTH: f64 = 1e-3;

/// The goals; `None` for those with errors.
pub fn goals(context: &mut Context, files: Vec<GoalFile>) -> Vec<Option<Goal>> {
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    context.check_unique("goals", &names);
    files.into_iter().enumerate().map(|(i, file)| goal(context, &Key::at("goals").index(i), file)).collect()
}

fn goal(context: &mut Context, key: &Key, file: GoalFile) -> Option<Goal> {
    let constant = |x: f64| Keyframes::constant(SVector::from([x]));
    let weight = share_keyframes(context, &key.name("weight"), file.weight);
    let is_hard = file.hard_to.is_some();
    let hard_to = match file.hard_to {
        Some(hard_to) => share_keyframes(context, &key.name("hard_to"), hard_to),
        None => Some(constant(0.0)),
    };
    let along = match file.along {
        Some(along) => ramp(context, &key.name("along"), along),
        None => Some(constant(if is_hard { 0.0 } else { 1.0 })),
    };
    let ids = match file.ids {
        Some(ids) => Some(context.buffers.load(ids, &key.name("ids"), context.diagnostics)?),
        None => None,
    };
    let convention = Convention {
        metres_per_unit: file.metres_per_unit.unwrap_or(context.convention.metres_per_unit),
        up: file.up_axis.unwrap_or(context.convention.up),
    };
    let curves = curves(context, &key.name("sequence"), &file.sequence, &convention);
    Some(Goal {
        name: file.name,
        groups: file.groups,
        ids,
        space: file.space,
        curves: Arc::new(curves?),
        pull: Arc::new(GoalPull {
            weight: weight?,
            along: along?,
            hard_to: hard_to?,
            omega: TAU * file.hz,
            damping: file.damping,
        }),
        guides: Vec::new(),
    })
}

/// The curves of the files `pattern`, the value of `key`.
fn curves(context: &mut Context, key: &Key, pattern: &str, convention: &Convention) -> Option<GoalCurves> {
    let load = |path: &Path| {
        let curves = ObjCurves::load(path, convention)?;
        let length = |c: usize| polyline::length(&curves.points[curves.offsets[c]..curves.offsets[c + 1]]);
        match (0..curves.len()).find(|c| length(*c) < MIN_LENGTH) {
            Some(c) => Err(format!("has a curve without length: number {}", c + 1)),
            None => Ok(curves),
        }
    };
    let rule =
        ["curves of at least 1 mm, with the same numbers of points in all frames", "export the curves again"];
    let Samples { first, samples } = samples(context, key, pattern, "tail.####.obj", load, rule)?;
    let offsets = samples[0].offsets.clone();
    let other = |sample: &ObjCurves| {
        let c = sample.offsets.iter().zip(&offsets).position(|(a, b)| a != b);
        match c {
            Some(c) => Some(format!(
                "curve {c} has {} points, {} in the first file",
                sample.offsets[c] - sample.offsets[c - 1],
                offsets[c] - offsets[c - 1]
            )),
            None if sample.len() != offsets.len() - 1 => {
                Some(format!("holds {} curves, the first file {}", sample.len(), offsets.len() - 1))
            }
            None => None,
        }
    };
    if let Some((i, what)) = samples.iter().enumerate().find_map(|(i, s)| Some((i, other(s)?))) {
        let message = format!("at frame {}: {what}", first + i as i32);
        context.diagnostics.add(key, message, rule[0], rule[1]);
        return None;
    }
    let times =
        SampleTimes { start: f64::from(first) / context.fps, rate: context.fps, count: samples.len() };
    Some(GoalCurves { times, offsets, samples: samples.into_iter().map(|s| s.points).collect() })
}
