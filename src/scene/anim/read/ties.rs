//! Ties.

use super::context::Context;
use crate::scene::anim::file::TieFile;
use crate::scene::anim::model::{Tie, TiePoint};
use crate::scene::json::diagnostics::Diagnostics;
use crate::scene::json::key::Key;

/// The ties to the bodies `bodies`; `None` for those with errors.
pub fn ties(
    context: &mut Context,
    files: Vec<TieFile>,
    bodies: &[String],
    head: Option<usize>,
) -> Vec<Option<Tie>> {
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    context.check_unique("ties", &names);
    let tie = |(i, file): (usize, TieFile)| {
        let key = Key::at("ties").index(i);
        let convention = context.convention;
        let ball = |centre: [f64; 3], radius: f64| {
            (convention.length_in(centre.into()), radius * convention.metres_per_unit)
        };
        let body = match &file.body {
            Some(name) => context.body_index(&key.name("body"), name, bodies),
            None => head,
        };
        let point = tie_point(context.diagnostics, &key, &file)?;
        if let Some([on, off]) = file.frames.filter(|[on, off]| on > off) {
            let message = format!("first frame {on} is after last frame {off}");
            let allowed = "[first, last] with first ≤ last";
            context.diagnostics.add(&key.name("frames"), message, allowed, "swap the two");
        }
        let always = [f64::NEG_INFINITY, f64::INFINITY];
        Some(Tie {
            name: file.name,
            body: body?,
            guides: context.selection(file.ids, file.group, file.within),
            point,
            bundle: file.at.map(|at| ball(at, file.radius)),
            times: file.frames.map_or(always, |frames| frames.map(|frame| frame / context.fps)),
        })
    };
    files.into_iter().enumerate().map(tie).collect()
}

/// The point of a guide that the tie at `key` holds.
fn tie_point(diagnostics: &mut Diagnostics, key: &Key, file: &TieFile) -> Option<TiePoint> {
    let (key, message, allowed, help) = match (file.arc_m, file.arc_by_distance) {
        (Some(_), Some(_)) => (
            key.name("arc_m"),
            "is given together with `arc_by_distance`",
            "`arc_m` or `arc_by_distance`, not both",
            "remove one of them",
        ),
        (Some(arc), None) => return Some(TiePoint::Arc(arc)),
        (None, Some(_)) if file.at.is_none() => (
            key.name("arc_by_distance"),
            "is given without `at`",
            "together with `at`, the point from which the distance is measured",
            "add `at`, or use `arc_m`",
        ),
        (None, Some(factor)) => return Some(TiePoint::Distance(factor)),
        (None, None) if file.at.is_none() && file.within.is_none() => (
            key.clone(),
            "does not say which point of a guide it holds",
            "`arc_m`, `at` or `within`",
            "add one of them",
        ),
        (None, None) => return Some(TiePoint::Nearest),
    };
    diagnostics.add(&key, message, allowed, help);
    None
}
