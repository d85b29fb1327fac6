//! What the manifest tells of over mode.

use super::plan::{OverPlan, PlannedCurves};
use super::source::Set;
use super::stage::{rows, stage_record};
use crate::cache::{Header, OverPrimRecord, OverRecord, OverRun};
use crate::scene::Groom;

/// What the manifest of a cache with this `header` tells of the curves that a bake moves; `None` if it leaves
/// them to Houdini.
pub fn record(groom: &Groom, header: &Header, plan: &OverPlan) -> Option<OverRecord> {
    let OverPlan { target, owners, curves: PlannedCurves::Moved(matched) } = plan else { return None };
    let source = groom.source.as_ref()?;
    let prims = target.prims.iter().zip(matched).map(|(prim, of)| OverPrimRecord {
        path: prim.path.clone(),
        points: prim.points_name.clone(),
        time: prim.time,
        normals: prim.normals.as_ref().map(|normals| normals.name.clone()),
        to_rest_m: rows(&source.prims[*of].to_rest),
        lengthened: source.length.is_some(),
        baked: runs(owners.of_prim(*of), header),
    });
    let (stage, metres_per_unit, up_axis) = stage_record(target);
    Some(OverRecord { stage, metres_per_unit, up_axis, prims: prims.collect() })
}

/// What curves move as, in runs as long as possible.
fn runs(owners: &[Option<(Set, usize)>], header: &Header) -> Vec<OverRun> {
    let mut runs: Vec<OverRun> = Vec::new();
    for (curve, owner) in owners.iter().enumerate() {
        let Some((set, baked)) = owner.filter(|(set, index)| *index < set.count(header)) else { continue };
        match runs.last_mut() {
            Some(run)
                if (run.prim.as_str(), run.first + run.count, run.baked + run.count)
                    == (set.path(), curve, baked) =>
            {
                run.count += 1;
            }
            _ => runs.push(OverRun { prim: set.path().into(), first: curve, baked, count: 1 }),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::CurveSet;

    #[test]
    fn curves_in_one_order_are_one_run() {
        let set = |n: usize| CurveSet { counts: vec![2; n], ..CurveSet::default() };
        let header = Header { hair: Some(set(4)), guides: set(1), ..Header::default() };
        let hair = |i| Some((Set::Hair, i));
        let guide = |i| Some((Set::Guides, i));
        let found = runs(&[hair(0), hair(1), None, hair(3), guide(0), guide(1), hair(2)], &header);
        let found: Vec<_> = found.iter().map(|run| (&*run.prim, run.first, run.baked, run.count)).collect();
        let expected = [
            ("/groom/hair", 0, 0, 2),
            ("/groom/hair", 3, 3, 1),
            // The second guide is not written.
            ("/groom/guides", 4, 0, 1),
            ("/groom/hair", 6, 2, 1),
        ];
        assert_eq!(found, expected);
    }
}
