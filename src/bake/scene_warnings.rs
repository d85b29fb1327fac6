//! What the user is warned of in a scene before it is baked.

use crate::dynamics::guide_rods::GuideRods;
use crate::dynamics::run_up::StartedIn;
use crate::dynamics::tie_reach::{OutOfReach, out_of_reach};
use crate::math::polyline;
use crate::scene::anim::{Keyframes, Load, Tie};
use crate::scene::{Anim, Collider, Groom};

/// Share of the median length of the hair above which the thickness of a collider is warned of. A strand that lies
/// along a surface leaves it, over its whole length, at no more than this angle, rad.
const THICK: f64 = 0.1;

/// Pre-roll below which bodies that come to their places in it do so fast, s: the hair that they push moves on as the shot
/// starts.
const SHORT_PREROLL: f64 = 0.5;

/// What the user should look at in a scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SceneWarning {
    /// What it is.
    pub what: String,
    /// What to do about it.
    pub advice: String,
    /// The frames, each with a detail; empty if it is about all.
    pub frames: Vec<(i32, String)>,
    /// The guarantee that it breaks, if it does.
    pub broken: Option<String>,
}

/// The warnings of a scene. `groom` must have its trees, and `rods` are its own.
pub fn scene_warnings(groom: &Groom, anim: &Anim, rods: &GuideRods) -> Vec<SceneWarning> {
    let too_far = out_of_reach(groom, anim, rods);
    let too_far = too_far.iter().map(|found| unreached(&anim.ties[found.tie].name, found));
    idle(anim).into_iter().chain(too_far).chain(thick(groom, anim)).collect()
}

/// The warnings of `bodies` in which guides start that are drawn outside of them, of the `colliders` with these names, in
/// a shot with this `preroll`, s.
pub fn start_warnings(bodies: &[StartedIn], colliders: &[&str], preroll: f64) -> Vec<SceneWarning> {
    let warning = |StartedIn { collider, guides, runs_up }: &StartedIn| {
        let name = colliders.get(*collider as usize)?;
        let stay =
            format!("{guides} guides start in \"{name}\", which is not so as they are drawn, and stay in it");
        let (what, advice) = match runs_up {
            true if preroll >= SHORT_PREROLL => return None,
            true => (
                format!(
                    "\"{name}\" comes into {guides} guides within half of the pre-roll of {preroll} s, and hair may \
                     start fast"
                ),
                "; give it more time (--preroll 1)",
            ),
            false if preroll == 0.0 => (stay, "; a pre-roll (--preroll 1) pushes them out"),
            false => (
                format!("{stay}: all ways there lead through other hair"),
                "; start the shot with it outside of the hair, or earlier",
            ),
        };
        Some(SceneWarning { what, advice: advice.into(), ..SceneWarning::default() })
    };
    bodies.iter().filter_map(warning).collect()
}

/// A tie that hair does not reach.
fn unreached(name: &str, OutOfReach { guides, short, frames, .. }: &OutOfReach) -> SceneWarning {
    let away = |(frame, by): &(i32, f64)| (*frame, format!("{:.0} mm", 1e3 * by));
    SceneWarning {
        what: format!("the tie \"{name}\" is out of reach of {short} of its {guides} guides"),
        advice: "; move it nearer to their roots, tie them farther from the root, or leave them out".into(),
        frames: frames.iter().map(away).collect(),
        broken: None,
    }
}

/// The ties, loads and goals that do nothing in the shot and its pre-roll: their frames are others.
fn idle(anim: &Anim) -> Vec<SceneWarning> {
    let (first, last) = anim.shot;
    let span = [anim.time(f64::from(first) - 1.0) - anim.settings.preroll, anim.time(f64::from(last))];
    let warning = |kind: &str, name: &str, times: [f64; 2], key: &str| {
        let [from, to] = times.map(|t| format!("{}", (1e3 * t * anim.fps).round() / 1e3));
        SceneWarning {
            what: format!(
                "the {kind} \"{name}\" does nothing: its frames are {from} to {to}, those of the shot {first} to {last}"
            ),
            advice: format!("; correct {key}, or remove it"),
            frames: Vec::new(),
            broken: Some(format!("the {kind} \"{name}\" does nothing")),
        }
    };
    let ties = anim.ties.iter().enumerate().filter(|(_, tie)| is_over(tie, span));
    let ties = ties.map(|(i, tie)| warning("tie", &tie.name, tie.times, &format!("ties[{i}].frames")));
    let loads = anim.loads.iter().enumerate().filter_map(|(i, load)| {
        let Load { name, force, moment, .. } = load;
        let keys = [force, moment].into_iter().filter(|keys| !keys.is_zero()).collect::<Vec<_>>();
        let rests = !keys.is_empty() && keys.iter().all(|keys| keys.is_zero_within(span));
        rests.then(|| warning("load", name, ends(&keys), &format!("the keys of loads[{i}]")))
    });
    let goals = anim.goals.iter().enumerate().filter_map(|(i, goal)| {
        let (weight, hard_to) = (&goal.pull.weight, &goal.pull.hard_to);
        let rests = |keys: &Keyframes<1>| !keys.is_zero() && keys.is_zero_within(span);
        let (keys, key) = if rests(weight) {
            (weight, "weight")
        } else if goal.pull.along.is_zero() && rests(hard_to) {
            (hard_to, "hard_to")
        } else {
            return None;
        };
        Some(warning("goal", &goal.name, ends(&[keys]), &format!("goals[{i}].{key}")))
    });
    ties.chain(loads).chain(goals).collect()
}

/// Whether a tie holds at no time within `span`, s.
fn is_over(tie: &Tie, span: [f64; 2]) -> bool {
    tie.times[1] < span[0] || tie.times[0] > span[1]
}

/// First and last time of keys, s.
fn ends<const D: usize>(keys: &[&Keyframes<D>]) -> [f64; 2] {
    let times = || keys.iter().flat_map(|keys| keys.times.iter().copied());
    [times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max)]
}

/// The colliders that keep hair away by more than a small part of its length.
fn thick(groom: &Groom, anim: &Anim) -> Vec<SceneWarning> {
    let curves = match &groom.strands.curves {
        strands if strands.is_empty() => &groom.guides.curves,
        strands => strands,
    };
    let mut lengths: Vec<f64> = (0..curves.len()).map(|i| polyline::length(curves.curve(i))).collect();
    let middle = lengths.len() / 2;
    if lengths.is_empty() {
        return Vec::new();
    }
    let (_, length, _) = lengths.select_nth_unstable_by(middle, f64::total_cmp);
    let most = THICK * *length;
    let warning = |(i, collider): (usize, &Collider)| SceneWarning {
        what: format!(
            "the collider \"{}\" keeps hair {} mm away, more than a tenth of its median length of {} mm: such hair is \
             lifted, and slow to settle",
            collider.name,
            in_mm(collider.thickness, f64::round),
            in_mm(*length, f64::round)
        ),
        advice: format!(
            "; give colliders[{i}].thickness_m, or --thickness of `import track`, {} mm or less",
            in_mm(most, f64::floor)
        ),
        ..SceneWarning::default()
    };
    anim.colliders.iter().enumerate().filter(|(_, c)| c.thickness > most).map(warning).collect()
}

/// A length, m, in millimetres, to two digits by `round`.
fn in_mm(length: f64, round: impl Fn(f64) -> f64) -> String {
    let mm = 1e3 * length;
    let digits = 1.0 - mm.log10().floor();
    let unit = 10_f64.powf(digits);
    format!("{}", round(mm * unit) / unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_that_guides_start_in_is_warned_of_unless_it_has_time_to_come_there() {
        let texts = |runs_up, preroll| {
            let body = StartedIn { collider: 1, guides: 7, runs_up };
            let warnings = start_warnings(&[body], &["head", "pillow"], preroll);
            warnings.into_iter().map(|warning| warning.what + &warning.advice).collect::<String>()
        };
        assert_eq!(texts(true, 1.0), "");
        assert!(
            texts(true, 0.1).contains("\"pillow\" comes into 7 guides within half of the pre-roll of 0.1 s")
        );
        assert!(texts(false, 0.0).contains("stay in it; a pre-roll"));
        assert!(texts(false, 1.0).contains("stay in it: all ways"));
    }
}
