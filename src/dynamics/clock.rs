//! Sub-steps of an animation and their times.

use crate::scene::Anim;

/// Sub-steps of the pre-roll.
pub(super) fn preroll(anim: &Anim) -> i64 {
    let step = 1.0 / (anim.fps * f64::from(anim.settings.substeps));
    (anim.settings.preroll / step).ceil() as i64
}

/// Sub-steps from the start of the pre-roll to `frame`, which is not before the handle frame.
pub fn substeps_to(anim: &Anim, frame: i32) -> i64 {
    let frames = i64::from(frame) - i64::from(anim.frames.0) + 1;
    preroll(anim) + frames * i64::from(anim.settings.substeps)
}

/// Time after `taken` sub-steps of an animation, s.
pub(super) fn time_after(anim: &Anim, taken: i64) -> f64 {
    let substeps = i64::from(anim.settings.substeps);
    let first = (i64::from(anim.frames.0) - 1) * substeps;
    (first + taken - preroll(anim)) as f64 / (anim.fps * substeps as f64)
}
