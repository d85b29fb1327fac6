//! Ties.

use super::context::Context;
use crate::scene::anim::ends_file::{TieFile, TieOrientationFile, TieOrientationWord};
use crate::scene::anim::model::{Tie, TieOrientation, TiePoint};
use crate::scene::json::diagnostics::Diagnostics;
use crate::scene::json::key::Key;
use nalgebra::Matrix3;

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
        let orientation = match file.orientation {
            None | Some(TieOrientationFile::Word(TieOrientationWord::Free)) => TieOrientation::Free,
            Some(TieOrientationFile::Word(TieOrientationWord::Drawn)) => TieOrientation::Drawn,
            Some(TieOrientationFile::Frame(wxyz)) => {
                let frame = context.quaternion(&key.name("orientation"), wxyz)?;
                let columns = *frame.to_rotation_matrix().matrix();
                let in_metres = |d: usize| convention.direction_in(columns.column(d).into());
                TieOrientation::Frame(Matrix3::from_columns(&[0, 1, 2].map(in_metres)))
            }
        };
        if file.radius != 0.0 && file.at.is_none() {
            let allowed = "together with `at`, the place where the hair is gathered";
            let help = "add `at`, or remove it";
            context.diagnostics.add(&key.name("radius"), "is given without `at`", allowed, help);
        }
        if file.releases && !file.slides {
            let allowed = "together with `slides`: no strand slides out of what holds one place of it";
            context.diagnostics.add(
                &key.name("releases"),
                "is given without `slides`",
                allowed,
                "add `slides`",
            );
        }
        if let Some([on, off]) = file.frames.filter(|[on, off]| on > off) {
            let message = format!("first frame {on} is after last frame {off}");
            let allowed = "[first, last] with first ≤ last";
            context.diagnostics.add(&key.name("frames"), message, allowed, "swap the two");
        }
        let always = [f64::NEG_INFINITY, f64::INFINITY];
        Some(Tie {
            name: file.name,
            body: body?,
            guides: context.selection(&key, file.ids, file.group, file.within),
            point,
            bundle: file.at.map(|at| ball(at, file.radius)),
            orientation,
            slides: file.slides,
            releases: file.releases,
            times: file.frames.map_or(always, |frames| frames.map(|frame| frame / context.fps)),
        })
    };
    files.into_iter().enumerate().map(tie).collect()
}

/// The point of a guide that the tie at `key` holds.
fn tie_point(diagnostics: &mut Diagnostics, key: &Key, file: &TieFile) -> Option<TiePoint> {
    let places = [
        ("arc_m", file.arc_m.map(TiePoint::Arc)),
        ("arc_share", file.arc_share.map(TiePoint::Share)),
        ("arc_by_distance", file.arc_by_distance.map(TiePoint::Distance)),
    ];
    let mut given = places.into_iter().filter_map(|(name, point)| Some((name, point?)));
    let (first, second) = (given.next(), given.next());
    let (key, message, allowed, help) = match (first, second) {
        (Some((name, _)), Some((other, _))) => (
            key.name(other),
            format!("is given together with `{name}`"),
            "one of `arc_m`, `arc_share` and `arc_by_distance`",
            "remove one of them",
        ),
        (Some((name, TiePoint::Distance(_))), None) if file.at.is_none() => (
            key.name(name),
            "is given without `at`".into(),
            "together with `at`, the point from which the distance is measured",
            "add `at`, or use `arc_m`",
        ),
        (Some((_, point)), None) => return Some(point),
        _ if file.at.is_none() && file.within.is_none() => (
            key.clone(),
            "does not say which point of a guide it holds".into(),
            "`arc_m`, `arc_share`, `at` or `within`",
            "add one of them",
        ),
        _ => return Some(TiePoint::Nearest),
    };
    diagnostics.add(&key, message, allowed, help);
    None
}
