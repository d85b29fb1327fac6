//! Vectors over time.

use super::context::Context;
use crate::scene::anim::file::KeyframesFile;
use crate::scene::json::diagnostics::MAX_REPORTED;
use crate::scene::json::key::Key;
use crate::scene::keyframes::Keyframes;

/// The vector over time at `key`.
pub fn keyframes(context: &mut Context, key: &Key, file: KeyframesFile) -> Option<Keyframes> {
    let convention = context.convention;
    let value = |v: [f64; 3]| convention.direction_in(v.into());
    let (frames, values) = match file {
        KeyframesFile::Constant(v) => return Some(Keyframes::constant(value(v))),
        KeyframesFile::Keys { frames, values } => (frames, values),
    };
    let values: Vec<_> = values.into_iter().map(value).collect();
    let diagnostics = &mut *context.diagnostics;
    let before = diagnostics.len();
    diagnostics.expect_len(&key.name("values"), values.len(), frames.len(), "frame");
    if frames.is_empty() {
        diagnostics.add(&key.name("frames"), "is empty", "at least one key", "add a key, or give a constant");
    }
    let unordered = frames.windows(2).enumerate().filter(|(_, pair)| pair[0] >= pair[1]);
    for (i, pair) in unordered.take(MAX_REPORTED) {
        let message = format!("{} follows {}", pair[1], pair[0]);
        let key = key.name("frames").index(i + 1);
        diagnostics.add(&key, message, "increasing frames", "sort the keys by frame");
    }
    let times = frames.iter().map(|frame| frame / context.fps).collect();
    (diagnostics.len() == before).then_some(Keyframes { times, values })
}
