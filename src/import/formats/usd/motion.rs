//! Motion of a prim or a skeleton joint of a USD stage.

use super::exchange::{Exchange, matrices, required};
use crate::Result;
use crate::import::motion::{FrameNumbers, GroomCurves, Motion, StageMotion};
use crate::import::plain::Rest;
use crate::import::rigid::{self, RigidPoses};
use crate::import::source::Source;
use crate::scene::{Convention, RestSpace};
use serde::Deserialize;
use std::path::Path;

/// The default of USD's metersPerUnit.
const DEFAULT_METRES_PER_UNIT: f64 = 0.01;

#[derive(Debug, Deserialize)]
struct Header {
    /// The prim whose motion was read.
    prim: String,
    /// Time codes per second.
    rate: f64,
    /// Time code of the first sample.
    start: f64,
    /// Time codes from one sample to the next.
    step: f64,
    /// First and last time code of the shot.
    shot: [f64; 2],
    /// The space of the rest pose.
    space: RestSpace,
    /// Paths of the groom's curves.
    over: Vec<String>,
}

/// Reads the motion of a prim, or of a joint of a skeleton at or below it. `rest_of` is where its rest pose
/// is read; `None` for the rest space of its character. `curves` are the curves of the groom that it carries,
/// and the stage that they are from.
///
/// # Errors
/// As [`Exchange::read`]; a transform without a rotation.
pub(crate) fn read(
    source: &Source,
    joint: Option<&str>,
    rest_of: Option<&Path>,
    curves: Option<&GroomCurves>,
) -> Result<Motion> {
    let mut options: Vec<String> = joint.iter().map(|name| format!("--joint={name}")).collect();
    if let Some(stage) = rest_of {
        options.push("--world".into());
        let other = !crate::file::is_same(stage, &source.path);
        options.extend(other.then(|| format!("--rest-stage={}", stage.display())));
    }
    if let Some(curves) = curves {
        options.push(format!("--groom-stage={}", curves.stage.display()));
        options.push(format!("--groom-prims={}", curves.prims.join(",")));
    }
    let read = Exchange::<Header>::read("motion", source, &options)?;
    let over_time = matrices(&required(read.f64s("matrix"), "matrix")?);
    let rest = matrices(&required(read.f64s("rest"), "rest")?);
    let declared = read.header.declared();
    let from_world = matrices(&required(read.f64s("from_world"), "from_world")?).first().copied();
    let mut notes = read.header.notes;
    let Header { prim, rate, start, step, shot, space, over } = read.header.more;
    let RigidPoses { poses, bind, warnings } = rigid::poses(source, &prim, &over_time, rest.first())?;
    let metres_per_unit = source.metres_per_unit.or(declared.metres_per_unit);
    if metres_per_unit.is_none() {
        notes.push(
            "no metersPerUnit in the stage: USD's default, centimetres (set --units to override)".into(),
        );
    }
    Ok(Motion {
        rate: rate / step,
        numbering: Some(FrameNumbers { first: start, rate }),
        convention: Convention {
            metres_per_unit: metres_per_unit.unwrap_or(DEFAULT_METRES_PER_UNIT),
            up: source.up.or(declared.up).unwrap_or_default(),
        },
        poses,
        bind,
        stage: Some(StageMotion { prim, shot, rest: Rest { space, from_world }, over }),
        notes,
        warnings,
    })
}
