//! Which curves of a groom's source the curves of a stage are.

use crate::error::{Diagnostic, Error, Result};
use crate::math::basis_curve::CurveFit;
use crate::scene::anim::{OutputCurves, Settings};
use crate::scene::{Groom, OverPrim, OverTarget, SourceCurves, SourcePrim};

/// Whether Houdini is to deform the curves of `target` by the guides, since a bake with these settings has no
/// motion to put over them: that of strands, or of curves that a groom of guides was not imported from.
pub(super) fn is_deformed(groom: &Groom, settings: &Settings, target: &OverTarget) -> bool {
    let Some(source) = &groom.source else { return false };
    let other = |prim| candidates(source, prim, target).is_empty();
    settings.curves == OutputCurves::Guides && (source.has_strands() || target.prims.iter().any(other))
}

/// The source of a groom, and the prim of it that each prim of a stage is; `None` for curves of another name.
///
/// # Errors
/// [`Error::BadInput`] with every prim that has other curves than that of its name.
pub(super) fn match_prims<'a>(
    groom: &'a Groom,
    target: &OverTarget,
) -> Result<(&'a SourceCurves, Vec<Option<usize>>)> {
    let source = groom.source.as_ref().ok_or_else(|| {
        Diagnostic::new(
            &target.file,
            "--over",
            "the groom does not tell which curves it was imported from",
            "a groom that `hairbake import groom` made from USD curves",
            "import the groom again",
        )
    })?;
    let mut diagnostics = Vec::new();
    let mut indices: Vec<Option<usize>> = Vec::new();
    for prim in &target.prims {
        match find(source, prim, target) {
            Ok(Some(index)) if indices.contains(&Some(index)) => diagnostics.push(Diagnostic::new(
                &target.file,
                &prim.path,
                format!("the second prim with the curves of {}", source.prims[index].path),
                "the curves of one character",
                "name one character: --over FILE:/path/to/it",
            )),
            Ok(index) => indices.push(index),
            Err(Error::BadInput(found)) => diagnostics.extend(found),
            Err(e) => return Err(e),
        }
    }
    Error::if_any(diagnostics)?;
    Ok((source, indices))
}

/// The error of a prim of which no curve was imported.
pub(super) fn not_imported(source: &SourceCurves, prim: &OverPrim, target: &OverTarget) -> Diagnostic {
    Diagnostic::new(
        &target.file,
        &prim.path,
        "the groom was not imported from curves of this name",
        imported_from(source),
        "name the prim of the groom, or one above it",
    )
}

/// What the curves of a stage may be.
fn imported_from(source: &SourceCurves) -> String {
    let paths: Vec<&str> = source.prims.iter().map(|prim| prim.path.as_str()).collect();
    format!("curves that the groom was imported from: {}", paths.join(", "))
}

/// The prims of `source` whose paths end as that of `prim` does.
fn candidates(source: &SourceCurves, prim: &OverPrim, target: &OverTarget) -> Vec<usize> {
    let shared = |of: &SourcePrim| {
        let [a, b] = [&of.path, &prim.path].map(|path| path.rsplit('/'));
        a.zip(b).take_while(|(a, b)| a == b).count()
    };
    let longest = source.prims.iter().map(shared).max().unwrap_or_default();
    let alone = source.prims.len() == 1 && target.prims.len() == 1;
    (0..source.prims.len())
        .filter(|of| shared(&source.prims[*of]) == longest && (longest > 0 || alone))
        .collect()
}

/// The prim of `source` that `prim` is: the one whose path ends as its own does, if there is one.
fn find(source: &SourceCurves, prim: &OverPrim, target: &OverTarget) -> Result<Option<usize>> {
    let diagnostic = |message: String, help: &str| {
        Error::from(Diagnostic::new(&target.file, &prim.path, message, imported_from(source), help))
    };
    let index = match candidates(source, prim, target)[..] {
        [] => return Ok(None),
        [index] => index,
        [_, _, ..] => {
            let message = "several prims that the groom was imported from end like this";
            return Err(diagnostic(message.into(), "name the prim of the groom, or one above it"));
        }
    };
    let of = &source.prims[index];
    let start = source.starts()[index];
    let vertices = &source.vertices[start..start + of.curves];
    let again = "choose the variant that was imported, or import the groom again";
    if of.curve != prim.curve {
        let [found, expected] =
            [prim.curve, of.curve].map(|curve| format!("{:?} {:?}", curve.wrap, curve.basis));
        let message = format!("{found} curves, imported as {expected}").to_lowercase();
        return Err(diagnostic(message, again));
    }
    if vertices != prim.vertices {
        let size = |vertices: &[u32]| {
            format!(
                "{} curves of {} points",
                vertices.len(),
                vertices.iter().map(|n| *n as usize).sum::<usize>()
            )
        };
        let message = match (size(&prim.vertices), size(vertices)) {
            (found, expected) if found == expected => format!("{found} in another order than imported"),
            (found, expected) => format!("{found}, imported as {expected}"),
        };
        return Err(diagnostic(message, again));
    }
    match vertices.iter().find(|count| CurveFit::new(of.curve, **count as usize).is_none()) {
        Some(count) => {
            let message = format!("a curve of {count} control points has no segment, or is closed");
            Err(diagnostic(message, "remove it, and import the groom again"))
        }
        None => Ok(Some(index)),
    }
}
