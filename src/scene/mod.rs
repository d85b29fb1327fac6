//! The validated scene: plain data in SI units, metres, Y up. `groom.json` and `anim.json` become
//! [`Groom`] and [`Anim`] here, with every fault of a file reported at once.

pub mod anim;
mod convention;
mod document;
pub mod groom;
mod inputs;
mod keyed;
mod obj;
mod reading;
mod sequence;
pub(crate) mod track;

pub use anim::{Anim, AnimFile, Body, Collider, Settings};
pub use convention::{Convention, UpAxis};
pub use document::array::{Array, BufferFile, ElementType, View};
pub use groom::{Curves, Factors, Groom, Group, Guides, Material, RodSection, Section, Strands, Tree, Wisp};
pub use inputs::inputs;
pub use reading::{Override, PathMap, Reading};
pub(crate) use sequence::Sequence;

use crate::error::{Diagnostic, Error, Result};
pub(crate) use anim::read::motion;
use document::{Document, Key};
use std::path::Path;

/// A public file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `groom.json`
    Groom,
    /// `anim.json`
    Anim,
}

/// Reads and checks a groom.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::BadInput`] with every fault found.
pub fn load_groom(path: &Path) -> Result<Groom> {
    groom_of(Document::open(path)?, path)
}

/// Reads and checks an animation and the files it names.
///
/// # Errors
/// As [`load_groom`].
pub fn load_anim(path: &Path) -> Result<Anim> {
    anim_of(Document::open(path)?)
}

/// Reads and checks a groom and its animation.
///
/// # Errors
/// As [`load_groom`]; the faults of both are in one report.
pub fn load(groom: &Path, anim: &Path) -> Result<(Groom, Anim)> {
    load_as(groom, anim, &Reading::default())
}

/// As [`load`], with what `reading` changes in the files.
///
/// # Errors
/// As [`load`], and [`Error::Usage`] where a value to put in place has none.
pub fn load_as(groom: &Path, anim: &Path, reading: &Reading) -> Result<(Groom, Anim)> {
    let groom_file = Document::open_as("groom", groom, reading).and_then(|doc| groom_of(doc, groom));
    let anim_file = Document::open_as("anim", anim, reading).and_then(anim_of);
    match (groom_file, anim_file) {
        (Ok(groom), Ok(scene)) => {
            Error::if_any(unknown_to(&groom, &scene, anim))?;
            Ok((groom, scene))
        }
        (Err(Error::BadInput(mut problems)), Err(Error::BadInput(others))) => {
            problems.extend(others);
            Err(Error::BadInput(problems))
        }
        (Err(e), _) | (_, Err(e)) => Err(e),
    }
}

/// What the ties of an animation, read from `file`, name that its groom does not have.
fn unknown_to(groom: &Groom, anim: &Anim, file: &Path) -> Vec<Diagnostic> {
    let mut problems = Vec::new();
    for (i, tie) in anim.ties.iter().enumerate() {
        let key = |name: &str| format!("ties[{i}].{name}");
        let unknown = |id: &&i32| !groom.guides.curves.id.contains(id);
        let ids: Vec<String> = tie.ids.iter().flatten().filter(unknown).map(i32::to_string).collect();
        if !ids.is_empty() {
            let what = format!("names {}", ids.join(", "));
            problems.push(Diagnostic::new(
                file,
                key("ids"),
                what,
                "ids of guides of the groom",
                "correct or remove them",
            ));
        }
        if let Some(name) = tie.group.as_ref().filter(|name| groom.groups.iter().all(|g| g.name != **name)) {
            let names: Vec<&str> = groom.groups.iter().map(|g| g.name.as_str()).collect();
            let allowed = format!("a group of the groom: \"{}\"", names.join("\", \""));
            problems.push(Diagnostic::new(
                file,
                key("group"),
                format!("is \"{name}\""),
                allowed,
                "correct the name",
            ));
        }
    }
    problems
}

/// Every problem of the files, grooms and animations in any order, told apart by their `format`.
///
/// # Errors
/// [`Error::Io`] if one cannot be read.
pub fn check(paths: &[&Path]) -> Result<Vec<Diagnostic>> {
    let mut problems = Vec::new();
    for path in paths {
        match Document::open(path).and_then(|doc| check_one(doc, path)) {
            Ok(()) => {}
            Err(Error::BadInput(found)) => problems.extend(found),
            Err(e) => return Err(e),
        }
    }
    Ok(problems)
}

fn check_one(mut doc: Document, path: &Path) -> Result<()> {
    match doc.text_at("format") {
        Some("hairbake-anim") => anim_of(doc).map(drop),
        Some("hairbake-groom") => groom_of(doc, path).map(drop),
        other => {
            let what = other.map_or("is missing".into(), |name| format!("is \"{name}\""));
            let allowed = "\"hairbake-groom\" or \"hairbake-anim\"";
            doc.faults.add(&Key::at("format"), what, allowed, "set \"format\"");
            doc.finish(None, &[])
        }
    }
}

/// The JSON Schema of a format.
pub fn schema(format: Format) -> String {
    let schema = match format {
        Format::Groom => schemars::schema_for!(groom::file::GroomFile),
        Format::Anim => schemars::schema_for!(anim::file::AnimFile),
    };
    document::pretty(&schema.to_value())
}

fn groom_of(mut doc: Document, path: &Path) -> Result<Groom> {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let groom = doc.parse().and_then(|file| groom::read::groom(file, &stem, &mut doc));
    doc.finish(groom, groom::read::DEPENDS)
}

fn anim_of(mut doc: Document) -> Result<Anim> {
    let anim = doc.parse().and_then(|file| anim::read::anim(file, &mut doc));
    doc.finish(anim, anim::read::DEPENDS)
}

#[cfg(test)]
mod tests;
