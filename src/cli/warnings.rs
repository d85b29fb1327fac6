//! What the user of a bake is warned of.

use crate::bake::frame_record::{FrameRecord, GAIN, RESIDUAL, StartedIn};
use crate::bake::{BakeSummary, SceneWarning, start_warnings};
use crate::report::Warning;
use crate::report::view::Findings;
use serde_json::Value;

/// Most guides that a warning lists.
const MAX_LISTED: usize = 8;

/// What the user should look at in a scene.
pub fn of_scene(SceneWarning { what, advice, frames, .. }: &SceneWarning) -> Warning {
    Warning { what: what.clone(), advice: advice.clone(), frames: frames.clone() }
}

/// What the user should look at.
pub fn warnings(summary: &BakeSummary) -> Vec<Warning> {
    let frames = &summary.frames[..];
    let unsettled = |f: &FrameRecord| f.unsettled + f.strands_unsettled;
    let count = |n: u32| (n > 0).then(|| n.to_string());
    let unconverged = |f: &FrameRecord| {
        let ids: Vec<String> = f.unconverged.iter().take(MAX_LISTED).map(i32::to_string).collect();
        let more = if f.unconverged.len() > MAX_LISTED { ", ..." } else { "" };
        (!ids.is_empty()).then(|| format!("guides {}{more}", ids.join(", ")))
    };
    let of_frames = [
        warning(
            frames,
            "the solver found no motion for some guides, which went stiffly along with the head",
            ADVICE,
            unconverged,
        ),
        exempt(frames),
        pinched(summary),
        warning(frames, "guides are more than half a millimetre inside a body", ADVICE, |f| {
            (f.penetration_m > GUIDE_INSIDE).then(|| format!("{:.1} mm", 1e3 * f.penetration_m))
        }),
        warning(
            frames,
            "guides were stopped at a surface that they would have gone through, and may hesitate there",
            ADVICE,
            |f| count(f.shortened),
        ),
        warning(
            frames,
            "some contacts with bodies were not at rest when the solver stopped, and hair may tremble there",
            ADVICE,
            |f| count(unsettled(f)),
        ),
        warning(
            frames,
            "forces of some contacts are off by more than a thousandth, and hair may tremble there",
            ADVICE,
            |f| (f.residual() > RESIDUAL).then(|| format!("{:.0e}", f.residual())),
        ),
        warning(
            frames,
            "contact between guides has put energy into them, a share of that with which they move",
            ADVICE,
            |f| (f.strand_gain > GAIN).then(|| format!("{:.0} %", 1e2 * f.strand_gain)),
        ),
        warning(
            frames,
            "some guides came nearer to each other than half of the distance that contact keeps",
            ADVICE,
            |f| (f.strand_missing > MUCH_MISSING).then(|| format!("{:.0} % missing", 1e2 * f.strand_missing)),
        ),
        warning(
            frames,
            "guides turn by more than 2 rad within a segment, and by 3 at most: what is twisted or coiled further stays behind",
            "; more nodes (--nodes) divide them more finely",
            |f| (f.segment_turn_rad > FAR_TURNED).then(|| format!("{:.1} rad", f.segment_turn_rad)),
        ),
        warning(
            frames,
            "tied hair is not where it is to be held: out of reach, on its way, or tied in too many places for its nodes",
            "; more nodes (--nodes) help with the last",
            |f| (f.tie_slack_m > TIE_SLACK).then(|| format!("{:.0} mm", 1e3 * f.tie_slack_m)),
        ),
        warning(
            frames,
            "more than a quarter of the hair is too dense for steps of this length, and is pressed together",
            "; more steps per frame (--substeps) keep it apart",
            |f| (f.hair_softened > MANY_SOFTENED).then(|| format!("{:.0} %", 1e2 * f.hair_softened)),
        ),
        warning(
            frames,
            "hair is pressed together: the densest twentieth is more than 1.5 times as dense as in the groom",
            "; `hairbake preview --colour crowding` shows where",
            |f| (f.hair_crowding_p95 > CROWDED).then(|| format!("{:.1} times", f.hair_crowding_p95)),
        ),
        warning(
            frames,
            "hair as a volume has put energy into itself, a share of that with which it moves",
            "; more steps per frame (--substeps) or more damping (damping_s) leave less",
            |f| (f.hair_gain > VOLUME_GAIN).then(|| format!("{:.0} %", 1e2 * f.hair_gain)),
        ),
        warning(
            frames,
            "strands between the guides are more than 2 mm inside a body",
            "; more guides may help there",
            |f| count(f.hair_inside),
        ),
        warning(
            frames,
            "strands between the guides slip off a body within one frame, and jump by more than 5 cm",
            "; more guides may help there",
            |f| (f.hair_jumped > 0).then(|| format!("{}, {:.0} cm", f.hair_jumped, 1e2 * f.hair_jump_m)),
        ),
        summary.manifest.as_ref().and_then(|manifest| limited(frames, manifest.summary.guides.0)),
    ];
    let of_scene = summary.scene.iter().map(of_scene);
    of_scene.chain(started_in(summary)).chain(of_frames.into_iter().flatten()).collect()
}

/// Depth of a guide inside a body above which the user is warned, m: the validator's tolerance.
const GUIDE_INSIDE: f64 = 5e-4;

/// Share of the distance between guides missing above which the user is warned.
const MUCH_MISSING: f64 = 0.5;

/// Distance of a tied place from its goal above which the user is warned, m: what can be seen.
const TIE_SLACK: f64 = 1e-3;

/// Turn of a segment above which the user is warned, rad: two thirds of the largest that the solver takes. As drawn,
/// segments turn by a fraction of a radian.
const FAR_TURNED: f64 = 2.0;

/// Share of hair softened by the sub-step above which the user is warned.
const MANY_SOFTENED: f64 = 0.25;

/// Energy that hair as a volume has gained since the start, as a share of that with which it moves, above which the user
/// is warned. The samples gain none, at four steps a frame and more; a storm at one step a frame gives a third.
const VOLUME_GAIN: f64 = 0.01;

/// Density of the densest twentieth of the hair, over that in the groom's pose, above which the user is
/// warned.
const CROWDED: f64 = 1.5;

/// Share of guide segments exempt from contact above which the user is warned.
const MANY_EXEMPT: f64 = 0.1;

/// Depth of an exempt segment above which the user is warned, m: more than roots are set in.
const DEEP_EXEMPT: f64 = 5e-3;

fn exempt(frames: &[FrameRecord]) -> Option<Warning> {
    let deepest = frames.iter().max_by(|a, b| a.exempt_penetration_m.total_cmp(&b.exempt_penetration_m))?;
    let (share, depth) = (deepest.exempt_share(), deepest.exempt_penetration_m);
    (share > MANY_EXEMPT || depth > DEEP_EXEMPT).then(|| {
        let mut warning = Warning::new(format!(
            "the groom has {:.1} % of its guides inside a body ({} of {} segments): that part passes through bodies \
             freely, and is deepest",
            100.0 * share,
            deepest.exempt_segments,
            deepest.contact_segments,
        ));
        warning.frame(deepest.frame, format!("up to {:.1} mm", 1e3 * depth));
        warning
    })
}

/// Bodies in which guides start that are drawn outside of them.
fn started_in(summary: &BakeSummary) -> Vec<Warning> {
    let Some(manifest) = &summary.manifest else { return Vec::new() };
    let preroll = manifest.settings.get("preroll_s").and_then(Value::as_f64).unwrap_or_default();
    let bodies: Vec<StartedIn> = summary.frames.iter().flat_map(|frame| frame.started_in.clone()).collect();
    let colliders = manifest.summary.colliders.iter().map(String::as_str);
    start_warnings(&bodies, &colliders.collect::<Vec<_>>(), preroll).iter().map(of_scene).collect()
}

/// Whether bodies leave no room for some of the hair in a frame.
pub fn pinches(frame: &FrameRecord) -> bool {
    frame.pinched_segments > 0 || frame.pinched_penetration_m > 0.0
}

/// Where bodies close on hair, or overlap where it is.
fn pinched(summary: &BakeSummary) -> Option<Warning> {
    let frames: Vec<&FrameRecord> = summary.frames.iter().filter(|f| pinches(f)).collect();
    let names = summary.manifest.as_ref().map_or(&[][..], |manifest| &manifest.summary.colliders);
    let held = |b: usize| frames.iter().any(|f| f.pinched_colliders.contains(&(b as u32)));
    let held: Vec<&str> = (0..names.len()).filter(|b| held(*b)).map(|b| &names[b][..]).collect();
    let held = if held.is_empty() { "bodies".into() } else { held.join(", ") };
    warning(
        &summary.frames,
        &format!("bodies close on the hair and leave no room for it: it is inside {held}"),
        "; keep the bodies apart there, or take one of them out of the contact",
        |f| {
            let depth = f.pinched_penetration_m;
            pinches(f).then(|| if depth >= 5e-5 { format!("{:.1} mm", 1e3 * depth) } else { String::new() })
        },
    )
}

/// Share of the guides with limited velocities in a frame above which the user is warned.
const MANY_LIMITED: f64 = 0.25;

/// Where the velocities of many of the `guides` guides are not those of their motion.
fn limited(frames: &[FrameRecord], guides: usize) -> Option<Warning> {
    let most = MANY_LIMITED * guides as f64;
    warning(
        frames,
        "many guides go there and back between frames, and motion blur does not show all of it",
        "; several samples per frame (--samples) blur them right",
        |f| (f64::from(f.limited_rates) > most).then(|| format!("{} of {guides} guides", f.limited_rates)),
    )
}

const ADVICE: &str = "; more steps per frame (--substeps) may help";

/// A warning about the frames for which `detail` returns something, which may be empty.
fn warning(
    frames: &[FrameRecord],
    what: &str,
    advice: &str,
    detail: impl Fn(&FrameRecord) -> Option<String>,
) -> Option<Warning> {
    let frames: Vec<_> = frames.iter().filter_map(|f| Some((f.frame, detail(f)?))).collect();
    (!frames.is_empty()).then(|| Warning { what: what.into(), advice: advice.into(), frames })
}

/// What the view of a shot marks: the frames of its warnings, and guides whose solves failed or were halved.
pub fn findings(summary: &BakeSummary, warnings: &[Warning]) -> Findings {
    let guides = |of: fn(&FrameRecord) -> &Vec<i32>| {
        let listed = summary.frames.iter().filter(|f| !of(f).is_empty());
        listed.map(|f| (f.frame, of(f).clone())).collect()
    };
    Findings {
        warnings: warnings.to_vec(),
        unconverged: guides(|f| &f.unconverged),
        halved: guides(|f| &f.divided),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_with_soft_or_crowded_hair_are_named() {
        let frame = |frame, hair_softened, hair_crowding_p95| FrameRecord {
            frame,
            hair_softened,
            hair_crowding_p95,
            ..FrameRecord::default()
        };
        let frames = vec![frame(7, 0.24, 1.4), frame(8, 0.26, 1.2), frame(9, 0.1, 1.6)];
        let warnings = warnings(&BakeSummary { frames, ..BakeSummary::default() });
        let [soft, crowded] = &warnings[..] else { panic!("{warnings:?}") };
        let (soft, crowded) = (soft.to_text(), crowded.to_text());
        assert!(soft.contains("in frame 8 (26 %); more steps per frame"), "{soft}");
        assert!(crowded.contains("in frame 9 (1.6 times)"), "{crowded}");
    }

    #[test]
    fn hair_that_gains_energy_is_warned_of() {
        let frame = |frame, hair_gain| FrameRecord { frame, hair_gain, ..FrameRecord::default() };
        let frames = vec![frame(7, 0.004), frame(8, 0.3)];
        let text = warnings(&BakeSummary { frames, ..BakeSummary::default() })[0].to_text();
        assert!(text.contains("put energy into itself") && text.contains("in frame 8 (30 %)"), "{text}");
    }

    #[test]
    fn what_strict_refuses_is_warned_of() {
        let frames = vec![
            FrameRecord { frame: 7, contact_residual: 3.4e-3, ..FrameRecord::default() },
            FrameRecord { frame: 8, strand_residual: 9e-4, strand_gain: 0.02, ..FrameRecord::default() },
        ];
        let broken: Vec<i32> = frames.iter().filter(|f| !f.broken().is_empty()).map(|f| f.frame).collect();
        assert_eq!(broken, [7, 8]);
        let warnings = warnings(&BakeSummary { frames, ..BakeSummary::default() });
        let [residual, gain] = &warnings[..] else { panic!("{warnings:?}") };
        assert!(residual.to_text().contains("in frame 7 (3e-3);"), "{}", residual.to_text());
        assert!(gain.to_text().contains("in frame 8 (2 %);"), "{}", gain.to_text());
    }

    #[test]
    fn a_pinch_that_holds_no_point_inside_is_listed_without_a_depth() {
        let pinch = |frame: i32, depth: f64| FrameRecord {
            frame,
            pinched_segments: 2,
            pinched_penetration_m: depth,
            ..FrameRecord::default()
        };
        let frames = vec![pinch(1001, 0.0), pinch(1002, 1.2e-3)];
        let text = pinched(&BakeSummary { frames, ..BakeSummary::default() }).unwrap().to_text();
        assert!(text.contains("in 2 frames: 1001, 1002 (1.2 mm);"), "{text}");
    }

    #[test]
    fn limited_velocities_are_warned_of_if_many_guides_have_them() {
        let frame =
            |frame: i32, limited_rates: u32| FrameRecord { frame, limited_rates, ..FrameRecord::default() };
        let text = limited(&[frame(1001, 30), frame(1002, 10)], 100).unwrap().to_text();
        assert!(text.contains("in frame 1001 (30 of 100 guides);"), "{text}");
        assert_eq!(limited(&[frame(1001, 25)], 100), None);
    }

    #[test]
    fn frames_in_which_segments_turn_far_are_named() {
        let frame = |frame: i32, segment_turn_rad: f64| FrameRecord {
            frame,
            segment_turn_rad,
            ..FrameRecord::default()
        };
        let frames = vec![frame(1001, 1.5), frame(1002, 2.9)];
        let text = warnings(&BakeSummary { frames, ..BakeSummary::default() })[0].to_text();
        assert!(text.contains("in frame 1002 (2.9 rad);"), "{text}");
    }

    #[test]
    fn frames_in_which_ties_do_not_hold_are_named() {
        let frame =
            |frame: i32, tie_slack_m: f64| FrameRecord { frame, tie_slack_m, ..FrameRecord::default() };
        let frames = vec![frame(1001, 1e-8), frame(1002, 0.236)];
        let warnings = warnings(&BakeSummary { frames, ..BakeSummary::default() });
        let [ties] = &warnings[..] else { panic!("{warnings:?}") };
        assert!(ties.to_text().contains("in frame 1002 (236 mm);"), "{}", ties.to_text());
    }
}
