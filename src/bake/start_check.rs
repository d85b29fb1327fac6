//! Whether a bake can start: where the groom lies among the bodies.

use super::scene_warnings::{SceneWarning, scene_warnings, start_warnings};
use crate::dynamics::exemption::Exemption;
use crate::dynamics::guide_rods::GuideRods;
use crate::dynamics::simulation::Simulation;
use crate::error::Diagnostic;
use crate::scene::{Anim, Groom};
use crate::{Error, Result};
use std::path::Path;

/// Largest share of the guides' segments that may be exempt from contact with a body. Rooted segments and
/// hair drawn through an ear are some per cent; a groom in another space than the body is nearly all.
const MAX_EXEMPT: f64 = 0.5;

/// Checks where `groom` lies when the pre-roll of a bake starts; returns what the user is warned of. Errors name
/// `file`, that of `anim`.
///
/// # Errors
/// [`Error::BadInput`] for each body that holds most of the groom.
pub fn check_start(groom: Groom, anim: &Anim, file: &Path) -> Result<Vec<SceneWarning>> {
    let groom = groom.with_default_trees(anim.settings.nodes);
    let rods = GuideRods::new(&groom, anim);
    let at_start = check(&groom, anim, &rods, file)?;
    Ok(scene_warnings(&groom, anim, &rods).into_iter().chain(at_start).collect())
}

/// As [`check_start`], of a groom with trees and its guides as `rods`; the warnings are those of where guides start.
///
/// # Errors
/// As [`check_start`].
pub(super) fn check(groom: &Groom, anim: &Anim, rods: &GuideRods, file: &Path) -> Result<Vec<SceneWarning>> {
    if anim.colliders.is_empty() {
        return Ok(Vec::new());
    }
    let simulation = Simulation::new(groom, anim, rods);
    let errors: Vec<Diagnostic> = (anim.colliders.iter().enumerate())
        .zip(simulation.exemptions())
        .filter(|(_, exemption)| exemption.share() > MAX_EXEMPT)
        .map(|((i, collider), Exemption { exempt, segments })| {
            Diagnostic::new(
                file,
                format!("colliders[{i}]"),
                format!(
                    "{exempt} of {segments} guide segments are inside \"{}\", or drawn through it, when the \
                     pre-roll starts: contact cannot hold them",
                    collider.name
                ),
                "at most half of them",
                "compare groom and collider in one picture: they may have other units, axes or rest poses, or \
                 be taken at other times (`hairbake import track --help`, Rest pose); remove a collider that \
                 contains the hair on purpose",
            )
        })
        .collect();
    Error::if_any(errors)?;
    let colliders: Vec<&str> = anim.colliders.iter().map(|collider| &collider.name[..]).collect();
    Ok(start_warnings(&simulation.started_in, &colliders, anim.settings.preroll))
}
