//! Loads.

use super::context::Context;
use super::keyframes;
use crate::scene::anim::file::{KeyframesFile, LoadAxes, LoadFile};
use crate::scene::anim::model::{Load, LoadPlace};
use crate::scene::json::key::Key;
use crate::scene::keyframes::Keyframes;
use nalgebra::Vector3;

/// Largest force, N, or moment, N·m, on a rod: more than one of steel of the largest radius, 5 cm, bears.
const LARGEST: f64 = 1e7;

/// The loads; `None` for those with errors.
pub fn loads(context: &mut Context, files: Vec<LoadFile>) -> Vec<Option<Load>> {
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    context.check_unique("loads", &names);
    let load = |(i, file): (usize, LoadFile)| {
        let key = Key::at("loads").index(i);
        let place = place(context, &key, &file);
        if file.force_n.is_none() && file.moment_n_m.is_none() {
            let allowed = "`force_n`, `moment_n_m` or both";
            context.diagnostics.add(&key, "has no force and no moment", allowed, "add one of them");
        }
        let axes = file.axes;
        let mut over_time = |name: &str, file: Option<KeyframesFile>| match file {
            Some(file) => vector(context, &key.name(name), file, axes),
            None => Some(Keyframes::constant(Vector3::zeros())),
        };
        let (force, moment) = (over_time("force_n", file.force_n), over_time("moment_n_m", file.moment_n_m));
        let guides = context.selection(&key, file.ids, file.group, file.within);
        Some(Load { name: file.name, guides, place: place?, force: force?, moment: moment?, axes })
    };
    files.into_iter().enumerate().map(load).collect()
}

/// The force or moment at `key`.
fn vector(context: &mut Context, key: &Key, file: KeyframesFile, axes: LoadAxes) -> Option<Keyframes> {
    let keys = match axes {
        LoadAxes::World => keyframes::keyframes(context, key, file),
        LoadAxes::Material => keyframes::vectors(context, key, file, |v| v),
    }?;
    let largest = keys.values.iter().map(|v| v.norm()).fold(0.0, f64::max);
    if largest <= LARGEST {
        return Some(keys);
    }
    let message = format!("{largest:e} is more than any rod bears");
    let allowed = format!("up to {LARGEST:e}; a hair of 20 cm weighs 1.3e-5 N");
    context.diagnostics.add(key, message, allowed, "correct the value, which is in N or N·m on each hair");
    None
}

/// Where the load at `key` acts.
fn place(context: &mut Context, key: &Key, file: &LoadFile) -> Option<LoadPlace> {
    let places = [
        ("arc_m", file.arc_m.map(LoadPlace::Arc)),
        ("arc_share", file.arc_share.map(LoadPlace::Share)),
        ("span_m", file.span_m.map(LoadPlace::Span)),
        ("span_share", file.span_share.map(LoadPlace::SpanShare)),
    ];
    let mut given = places.into_iter().filter_map(|(name, place)| Some((name, place?)));
    let (name, place) = given.next().unwrap_or(("arc_share", LoadPlace::Share(1.0)));
    if let Some((other, _)) = given.next() {
        let message = format!("is given together with `{name}`");
        let allowed = "one of `arc_m`, `arc_share`, `span_m` and `span_share`";
        context.diagnostics.add(&key.name(other), message, allowed, "remove one of them");
        return None;
    }
    if let LoadPlace::Span([from, to]) | LoadPlace::SpanShare([from, to]) = place
        && from >= to
    {
        let message = format!("ends at {to}, not beyond its start {from}");
        let allowed = "[from, to] with from < to";
        context.diagnostics.add(&key.name(name), message, allowed, "swap the two, or use a point load");
        return None;
    }
    Some(place)
}
