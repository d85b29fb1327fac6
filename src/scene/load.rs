//! Loads and checks grooms and animations.

use super::anim::ends_file::RootHold;
use super::anim::file::AnimFile;
use super::anim::model::{Anim, GuideSelection, LoadPlace, Roots, TiePoint};
use super::anim::read as anim_reader;
use super::format::Format;
use super::goal;
use super::groom::file::GroomFile;
use super::groom::model::Groom;
use super::groom::read as groom_reader;
use super::json::document::Document;
use super::json::key::Key;
use super::json::locate;
use super::json::pretty::pretty;
use super::json::schema::schema_of;
use super::load_options::LoadOptions;
use super::placement;
use super::skin;
use crate::error::{Diagnostic, Error, Result};
use crate::math::polyline;
use nalgebra::Vector3;
use std::path::Path;

/// Share of the length by which a place may be beyond a tip for rounding.
const ROUNDING: f64 = 1e-6;

/// Loads and checks a groom.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::BadInput`] with every error found.
pub fn load_groom(path: &Path) -> Result<Groom> {
    read_groom(Document::open(path)?, path)
}

/// Loads and checks an animation and the files it names.
///
/// # Errors
/// As [`load_groom`].
pub fn load_anim(path: &Path) -> Result<Anim> {
    read_anim(Document::open(path)?)
}

/// Loads and checks a groom and its animation.
///
/// # Errors
/// As [`load_groom`], with the errors of both files in one report.
pub fn load(groom: &Path, anim: &Path) -> Result<(Groom, Anim)> {
    load_with(groom, anim, &LoadOptions::default())
}

/// As [`load`], with `options` applied to the files.
///
/// # Errors
/// As [`load`], and [`Error::Usage`] if a file has no place for an override.
pub fn load_with(groom: &Path, anim: &Path, options: &LoadOptions) -> Result<(Groom, Anim)> {
    let groom_document = options.open(Format::Groom, groom);
    let anim_document = options.open(Format::Anim, anim);
    if let (Ok(first), Ok(second)) = (&groom_document, &anim_document) {
        check_order(first, groom, second, anim)?;
    }
    let loaded_groom = groom_document.and_then(|doc| read_groom(doc, groom));
    let loaded_anim = anim_document.and_then(read_anim);
    match (loaded_groom, loaded_anim) {
        (Ok(mut loaded_groom), Ok(mut loaded_anim)) => {
            Error::if_any(compare(&mut loaded_groom, &mut loaded_anim, [groom, anim]))?;
            Ok((loaded_groom, loaded_anim))
        }
        (Err(Error::BadInput(mut diagnostics)), Err(Error::BadInput(others))) => {
            diagnostics.extend(others);
            Err(Error::BadInput(diagnostics))
        }
        (Err(e), _) | (_, Err(e)) => Err(e),
    }
}

/// Compares `groom` and `anim`, read from these files, binds the roots to their skins, and matches the goals.
fn compare(groom: &mut Groom, anim: &mut Anim, [groom_file, anim_file]: [&Path; 2]) -> Vec<Diagnostic> {
    let mut diagnostics = check_selections(groom, anim, anim_file);
    diagnostics.extend(place(groom, anim, anim_file));
    if !diagnostics.is_empty() {
        [groom_file, anim_file].iter().for_each(|file| locate::find(file, &mut diagnostics));
    }
    diagnostics
}

/// Compares the spaces of `groom` and `anim`, read from `file`, binds the roots to their skins, and
/// matches the goals.
fn place(groom: &mut Groom, anim: &mut Anim, file: &Path) -> Vec<Diagnostic> {
    let misplaced = placement::check(groom, anim, file);
    if !misplaced.is_empty() {
        return misplaced;
    }
    let unbound = skin::bind(groom, anim, file);
    if !unbound.is_empty() {
        return unbound;
    }
    let mut diagnostics = goal::bind(groom, anim, file);
    diagnostics.extend(freed_roots_with_goals(groom, anim, file));
    diagnostics
}

/// Reports pinned and free roots of `anim`, read from `file`, of guides that a goal leads: it prescribes their frames.
fn freed_roots_with_goals(groom: &Groom, anim: &Anim, file: &Path) -> Vec<Diagnostic> {
    let freed = anim.roots.iter().enumerate().filter(|(_, roots)| roots.hold != RootHold::Clamped);
    let led = |(i, roots): (usize, &Roots)| {
        let goal = anim
            .goals
            .iter()
            .find(|goal| goal.guides.iter().any(|&guide| names(&roots.guides, groom, guide)))?;
        let verb = if roots.hold == RootHold::Pinned { "pins" } else { "frees" };
        let message = format!("{verb} roots of guides that the goal \"{}\" leads", goal.name);
        let help = "leave the guides out of one of them";
        Some(Diagnostic::new(file, format!("roots[{i}]"), message, "guides without goals", help))
    };
    freed.filter_map(led).collect()
}

/// Checks that the first file is no animation and the second no groom.
fn check_order(first: &Document, groom: &Path, second: &Document, anim: &Path) -> Result<()> {
    let is = |doc: &Document, name: &str| doc.string("format") == Some(name);
    let swapped = |file: &Path, found: &str, wanted: &str| {
        Error::from(Diagnostic::new(
            file,
            "format",
            format!("the file is {found}, where {wanted} is expected"),
            "the groom first, then the animation",
            "swap the two files",
        ))
    };
    match (is(first, "hairbake-anim"), is(second, "hairbake-groom")) {
        (true, _) => Err(swapped(groom, "an animation", "a groom")),
        (_, true) => Err(swapped(anim, "a groom", "an animation")),
        _ => Ok(()),
    }
}

/// Reports the guides and groups that roots, ties and loads of `anim`, read from `file`, name but `groom` does not
/// have, and places beyond the tips of all guides that they name.
fn check_selections(groom: &Groom, anim: &Anim, file: &Path) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    let roots = anim.roots.iter().enumerate().map(|(i, roots)| (format!("roots[{i}]"), &roots.guides));
    let ties = anim.ties.iter().enumerate().map(|(i, tie)| (format!("ties[{i}]"), &tie.guides));
    let loads = anim.loads.iter().enumerate().map(|(i, load)| (format!("loads[{i}]"), &load.guides));
    for (key, guides) in roots.chain(ties).chain(loads) {
        let mut report = |name: &str, message: String, allowed: String, help: &str| {
            diagnostics.push(Diagnostic::new(file, format!("{key}.{name}"), message, allowed, help));
        };
        let unknown = |id: &&i32| !groom.guides.curves.id.contains(id);
        let ids: Vec<String> = guides.ids.iter().flatten().filter(unknown).map(i32::to_string).collect();
        if !ids.is_empty() {
            let message = format!("the groom has no guides with ids {}", ids.join(", "));
            report("ids", message, "ids of guides of the groom".into(), "correct or remove them");
        }
        if let Some(name) = guides.group.as_ref().filter(|name| groom.groups.iter().all(|g| g.name != **name))
        {
            let message = format!("the groom has no group \"{name}\"");
            let names: Vec<&str> = groom.groups.iter().map(|g| g.name.as_str()).collect();
            let allowed = format!("a group of the groom: \"{}\"", names.join("\", \""));
            report("group", message, allowed, "correct the name");
        }
        if let Some(ball) = guides.within
            && !curves_near(groom, guides, ball)
        {
            let message = format!("no guide comes within {:.4} m of there", ball.1);
            let allowed = "a ball that guides of the groom enter as they are drawn".into();
            report("within", message, allowed, "move it, or make it larger");
        }
    }
    diagnostics.extend(places_beyond_tips(groom, anim, file));
    diagnostics
}

/// Reports places of ties and loads of `anim`, read from `file`, that are beyond the tips of all their guides.
fn places_beyond_tips(groom: &Groom, anim: &Anim, file: &Path) -> Vec<Diagnostic> {
    let ties = anim.ties.iter().enumerate().filter_map(|(i, tie)| match tie.point {
        TiePoint::Arc(arc) => Some((format!("ties[{i}].arc_m"), &tie.guides, arc)),
        TiePoint::Nearest | TiePoint::Share(_) | TiePoint::Distance(_) => None,
    });
    let loads = anim.loads.iter().enumerate().filter_map(|(i, load)| {
        let (name, from) = match load.place {
            LoadPlace::Arc(arc) => ("arc_m", arc),
            LoadPlace::Span([from, _]) => ("span_m", from),
            LoadPlace::Share(_) | LoadPlace::SpanShare(_) => return None,
        };
        Some((format!("loads[{i}].{name}"), &load.guides, from))
    });
    let curves = &groom.guides.curves;
    let length = |guide: usize| polyline::length(curves.curve(guide));
    let beyond = |(key, guides, from): (String, &GuideSelection, f64)| {
        let chosen = (0..curves.len()).filter(|&guide| names(guides, groom, guide));
        let longest = chosen.map(length).fold(0.0, f64::max);
        // That the names are wrong is an error of its own.
        (longest > 0.0 && from > longest * (1.0 + ROUNDING)).then(|| {
            let message = format!("{from} m is beyond the tips of all guides that it names");
            let allowed = format!("up to {longest:.4} m, the length of the longest of them");
            Diagnostic::new(file, key, message, allowed, "correct it, or name longer guides")
        })
    };
    ties.chain(loads).filter_map(beyond).collect()
}

/// True if a guide that `guides` names comes within the ball of this centre and radius, m, or if it names none.
fn curves_near(groom: &Groom, guides: &GuideSelection, (centre, radius): (Vector3<f64>, f64)) -> bool {
    let curves = &groom.guides.curves;
    let mut chosen = (0..curves.len()).filter(|&guide| names(guides, groom, guide)).peekable();
    // That the names are wrong is an error of its own. Rods are some micrometres off what is drawn.
    chosen.peek().is_none()
        || chosen.any(|guide| polyline::distance(&centre, curves.curve(guide)) <= 1.01 * radius)
}

/// True if the ids and the group of `guides` are those of a guide.
fn names(guides: &GuideSelection, groom: &Groom, guide: usize) -> bool {
    let curves = &groom.guides.curves;
    guides.ids.as_ref().is_none_or(|ids| ids.contains(&curves.id[guide]))
        && guides.group.as_ref().is_none_or(|name| *name == groom.groups[curves.group[guide] as usize].name)
}

/// All errors in the files `paths`, grooms and animations in any order, distinguished by their `format`. If
/// all are right, each groom is compared with each animation.
///
/// # Errors
/// [`Error::Io`] if a file cannot be read.
pub fn check(paths: &[&Path]) -> Result<Vec<Diagnostic>> {
    check_with(paths, &LoadOptions::default())
}

/// As [`check`], with `options` applied to the files.
///
/// # Errors
/// As [`check`], and [`Error::Usage`] if a file has no place for an override.
pub fn check_with(paths: &[&Path], options: &LoadOptions) -> Result<Vec<Diagnostic>> {
    let (mut diagnostics, mut grooms, mut anims) = (Vec::new(), Vec::new(), Vec::new());
    for path in paths {
        match Document::open(path).and_then(|doc| read_any(doc, path, options)) {
            Ok(Checked::Groom(groom)) => grooms.push((groom, *path)),
            Ok(Checked::Anim(anim)) => anims.push((anim, *path)),
            Err(Error::BadInput(found)) => diagnostics.extend(found),
            Err(e) => return Err(e),
        }
    }
    if diagnostics.is_empty() {
        for (anim, anim_file) in &anims {
            for (groom, groom_file) in &grooms {
                diagnostics.extend(compare(&mut groom.clone(), &mut anim.clone(), [groom_file, anim_file]));
            }
        }
    }
    Ok(diagnostics)
}

/// A file that was read.
enum Checked {
    Groom(Box<Groom>),
    Anim(Box<Anim>),
}

fn read_any(mut doc: Document, path: &Path, options: &LoadOptions) -> Result<Checked> {
    match doc.string("format") {
        Some("hairbake-anim") => {
            options.apply(Format::Anim, &mut doc)?;
            read_anim(doc).map(Box::new).map(Checked::Anim)
        }
        Some("hairbake-groom") => {
            options.apply(Format::Groom, &mut doc)?;
            read_groom(doc, path).map(Box::new).map(Checked::Groom)
        }
        other => {
            let message = match other {
                Some(name) => format!("unknown format \"{name}\""),
                None => "required key is missing".into(),
            };
            let allowed = "\"hairbake-groom\" or \"hairbake-anim\"";
            doc.diagnostics.add(&Key::at("format"), message, allowed, "set \"format\"");
            doc.finish(None, &[])
        }
    }
}

/// The JSON Schema of a format.
pub fn schema(format: Format) -> String {
    pretty(&match format {
        Format::Groom => schema_of::<GroomFile>(),
        Format::Anim => schema_of::<AnimFile>(),
    })
}

fn read_groom(mut doc: Document, path: &Path) -> Result<Groom> {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let groom = doc.deserialize().and_then(|file| groom_reader::groom(file, &stem, &mut doc));
    doc.finish(groom, groom_reader::DEPENDENCIES)
}

fn read_anim(mut doc: Document) -> Result<Anim> {
    let anim = doc.deserialize().and_then(|file| anim_reader::anim(file, &mut doc));
    doc.finish(anim, anim_reader::DEPENDENCIES)
}
