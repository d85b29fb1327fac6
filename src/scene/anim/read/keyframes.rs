//! Vectors and numbers over time.

use super::context::Context;
use crate::scene::anim::file::{KeyframesFile, NumberKeyframesFile, RampFile};
use crate::scene::json::diagnostics::MAX_REPORTED;
use crate::scene::json::key::Key;
use crate::scene::keyframes::Keyframes;
use nalgebra::{SVector, Vector3};

/// The vector over time at `key`, in the axes of the file.
pub fn keyframes(context: &mut Context, key: &Key, file: KeyframesFile) -> Option<Keyframes> {
    let convention = context.convention;
    vectors(context, key, file, |v| convention.direction_in(v))
}

/// The vector over time at `key`, each value converted by `value`.
pub fn vectors(
    context: &mut Context,
    key: &Key,
    file: KeyframesFile,
    value: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> Option<Keyframes> {
    let fps = context.fps;
    let value = |v: [f64; 3]| value(v.into());
    match file {
        KeyframesFile::Constant(v) => Some(Keyframes::constant(value(v))),
        KeyframesFile::Keys { frames, values } => {
            let values = values.into_iter().map(value).collect();
            ordered(context, key, "frames", frames, values).map(|keys| in_seconds(keys, fps))
        }
    }
}

/// The share, 0 to 1, over time at `key`.
pub fn share_keyframes(context: &mut Context, key: &Key, file: NumberKeyframesFile) -> Option<Keyframes<1>> {
    let fps = context.fps;
    match file {
        NumberKeyframesFile::Constant(value) => {
            shares(context, key, &[value]).then(|| Keyframes::constant(SVector::from([value])))
        }
        NumberKeyframesFile::Keys { frames, values } => {
            let sound = shares(context, &key.name("values"), &values);
            let values = values.into_iter().map(|x| SVector::from([x])).collect();
            let keys = ordered(context, key, "frames", frames, values)?;
            sound.then(|| in_seconds(keys, fps))
        }
    }
}

/// The share, 0 to 1, along a strand at `key`.
pub fn ramp(context: &mut Context, key: &Key, file: RampFile) -> Option<Keyframes<1>> {
    let RampFile { arc, values } = file;
    let sound = [shares(context, &key.name("arc"), &arc), shares(context, &key.name("values"), &values)];
    let values = values.into_iter().map(|x| SVector::from([x])).collect();
    let keys = ordered(context, key, "arc", arc, values)?;
    (sound == [true; 2]).then_some(keys)
}

/// Reports which of the `values` at `key` are not within 0 to 1; true if all are.
fn shares(context: &mut Context, key: &Key, values: &[f64]) -> bool {
    let wrong = values.iter().enumerate().filter(|(_, x)| !(0.0..=1.0).contains(*x));
    let wrong: Vec<_> = wrong.take(MAX_REPORTED).collect();
    for (i, x) in &wrong {
        let key = if values.len() == 1 { key.clone() } else { key.index(*i) };
        context.diagnostics.add(&key, format!("{x} is out of range"), "0 to 1", "use a number from 0 to 1");
    }
    wrong.is_empty()
}

/// Keyframes with the `places` at the key `name`, checked to be increasing and as many as `values`.
fn ordered<const D: usize>(
    context: &mut Context,
    key: &Key,
    name: &str,
    places: Vec<f64>,
    values: Vec<SVector<f64, D>>,
) -> Option<Keyframes<D>> {
    let diagnostics = &mut *context.diagnostics;
    let before = diagnostics.len();
    diagnostics.expect_len(&key.name("values"), values.len(), places.len(), "key");
    if places.is_empty() {
        diagnostics.add(&key.name(name), "is empty", "at least one key", "add a key, or give a constant");
    }
    let unordered = places.windows(2).enumerate().filter(|(_, pair)| pair[0] >= pair[1]);
    for (i, pair) in unordered.take(MAX_REPORTED) {
        let message = format!("{} follows {}", pair[1], pair[0]);
        let key = key.name(name).index(i + 1);
        diagnostics.add(&key, message, format!("increasing {name}"), "sort the keys");
    }
    (diagnostics.len() == before).then_some(Keyframes { times: places, values })
}

/// The keyframes with the times of their frames.
fn in_seconds<const D: usize>(mut keys: Keyframes<D>, fps: f64) -> Keyframes<D> {
    keys.times.iter_mut().for_each(|frame| *frame /= fps);
    keys
}
