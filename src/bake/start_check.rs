//! Whether a bake can start: where the groom lies among the bodies.

use super::job::Job;
use crate::dynamics::exemption::Exemption;
use crate::dynamics::simulation::Simulation;
use crate::error::Diagnostic;
use crate::{Error, Result};
use std::path::Path;

/// Largest share of the guides' segments that may be exempt from contact with a body. Rooted segments and
/// hair drawn through an ear are some per cent; a groom in another space than the body is nearly all.
const MAX_EXEMPT: f64 = 0.5;

/// Checks where the groom lies at the start of the pre-roll.
///
/// # Errors
/// [`Error::BadInput`] for each body that holds most of the groom.
pub fn check(job: &Job, simulation: &Simulation) -> Result<()> {
    let anim = job.inputs.iter().find(|input| input.role == "anim");
    let file = Path::new(anim.map_or("anim.json", |input| &input.file));
    let errors: Vec<Diagnostic> = (job.anim.colliders.iter().enumerate())
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
    if errors.is_empty() { Ok(()) } else { Err(Error::BadInput(errors)) }
}
