//! What of a cache fits a page: which frames, and which curves.

use std::collections::{BTreeMap, BTreeSet};

/// Frames and curves to show.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// Frames, in order.
    pub frames: Vec<i32>,
    /// Every how many frames one is shown; those of `frames` that were asked for come on top.
    pub frame_step: usize,
    /// Every how many render strands one is shown.
    pub hair_step: usize,
    /// Every how many guides one is shown.
    pub guide_step: usize,
    /// Ids of guides that failed in these frames: those that are shown whatever the step.
    pub always: BTreeSet<i32>,
    /// Number of guides that failed in these frames.
    pub failed: usize,
}

/// A set of curves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Number of curves.
    pub curves: usize,
    /// Number of their points.
    pub points: usize,
}

/// Largest share of the points that guides get beside strands.
const GUIDES: f64 = 0.35;
/// For this many strands every second frame is left out if needed, so that there is a head of hair to see.
const FULL: usize = 1000;
/// For this many, more frames are.
const SPARSE: usize = 300;
/// Frames that stay in any case, if the shot has them.
const FEW_FRAMES: usize = 24;
/// Most guides that failed that are shown whatever the step.
const MOST_FAILED: usize = 200;

impl Selection {
    /// The selection of at most about `points` points in all frames together. Frames of `wanted` are shown
    /// whatever the step, and so are guides of `failed`, which are ids by frame: those that failed first, up
    /// to half of the room of guides.
    pub fn new(
        frames: &[i32],
        wanted: &[i32],
        failed: &BTreeMap<i32, Vec<i32>>,
        [hair, guides]: [Size; 2],
        points: f64,
    ) -> Self {
        let alone = hair.curves == 0;
        let main = if alone { guides } else { hair };
        // Points of guides, and of the main curves, in `n` frames.
        let for_guides = |n: usize| match alone {
            true => points,
            false => (points * GUIDES).min((guides.points * n) as f64),
        };
        let for_main = |n: usize| if alone { points } else { points - for_guides(n) };
        let taken = |step: usize| -> Vec<i32> {
            let regular = frames.iter().enumerate().filter(|(i, _)| i % step == 0).map(|(_, f)| *f);
            let mut taken: Vec<i32> = regular.chain(wanted.iter().copied()).collect();
            taken.retain(|frame| frames.binary_search(frame).is_ok());
            taken.sort_unstable();
            taken.dedup();
            taken
        };
        let fits = |step: usize| {
            let n = taken(step).len().max(1);
            curves_that_fit(main, for_main(n) / n as f64)
        };
        let largest = (frames.len() / FEW_FRAMES).max(1);
        let frame_step = (1..=largest)
            .find(|step| fits(*step) >= main.curves.min(if *step <= 2 { FULL } else { SPARSE }))
            .unwrap_or(largest);
        let frames = taken(frame_step);
        let n = frames.len().max(1);
        let step = |set: Size, fit: usize| set.curves.div_ceil(fit.max(1)).max(1);
        let hair_step = step(hair, curves_that_fit(hair, for_main(n) / n as f64));
        let guides_fit = curves_that_fit(guides, for_guides(n) / n as f64);
        let mut seen = BTreeSet::new();
        let failed: Vec<i32> =
            frames.iter().filter_map(|frame| failed.get(frame)).flatten().copied().collect();
        let failed: Vec<i32> = failed.into_iter().filter(|id| seen.insert(*id)).collect();
        let always: BTreeSet<i32> = failed.iter().copied().take(MOST_FAILED.min(guides_fit / 2)).collect();
        let guide_step = match guides_fit < guides.curves {
            true => step(guides, guides_fit - always.len()),
            false => 1,
        };
        Selection { frame_step, hair_step, guide_step, always, failed: failed.len(), frames }
    }
}

fn curves_that_fit(set: Size, points: f64) -> usize {
    let each = set.points as f64 / set.curves.max(1) as f64;
    (points / each.max(1.0)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Size = Size { curves: 0, points: 0 };

    /// A selection where no guide failed.
    fn select(frames: &[i32], wanted: &[i32], hair: Size, guides: Size, points: f64) -> Selection {
        Selection::new(frames, wanted, &BTreeMap::new(), [hair, guides], points)
    }

    fn size(curves: usize, each: usize) -> Size {
        Size { curves, points: curves * each }
    }

    #[test]
    fn a_small_shot_is_shown_whole() {
        let frames: Vec<i32> = (1..=99).collect();
        let all = select(&frames, &[], size(968, 16), size(88, 16), 3e6);
        assert_eq!((all.frame_step, all.hair_step, all.guide_step), (1, 1, 1));
        assert_eq!(all.frames, frames);
    }

    #[test]
    fn what_is_shown_of_a_large_shot_fits() {
        for (n, strands) in [(97, 11_400), (1000, 50_000), (20_000, 500_000), (3, 500_000)] {
            let frames: Vec<i32> = (1..=n).collect();
            let (hair, guides) = (size(strands, 16), size(2000, 32));
            let chosen = select(&frames, &[77], hair, guides, 2e6);
            let curves = hair.curves.div_ceil(chosen.hair_step) * 16;
            let points = chosen.frames.len() * (curves + guides.curves.div_ceil(chosen.guide_step) * 32);
            assert!(points as f64 <= 2.1e6, "{n} frames: {points}");
            assert!(chosen.frames.len() >= FEW_FRAMES.min(n as usize));
            assert_eq!(chosen.frames.contains(&77), n >= 77);
        }
    }

    #[test]
    fn frames_that_are_asked_for_come_on_top() {
        let frames: Vec<i32> = (1001..=2000).collect();
        let chosen = select(&frames, &[1002, 5000, 1004], size(20_000, 16), NONE, 2e6);
        assert!(chosen.frame_step > 1 && !chosen.frames.contains(&5000));
        assert_eq!(chosen.frames[..2], [1001, 1002]);
        assert!(chosen.frames.contains(&1004) && chosen.frames.is_sorted());
    }

    #[test]
    fn guides_alone_get_all_of_the_room() {
        let frames: Vec<i32> = (1..=100).collect();
        let chosen = select(&frames, &[], NONE, size(2000, 10), 1e6);
        assert_eq!((chosen.guide_step, chosen.frame_step), (2, 1));
    }

    #[test]
    fn guides_that_failed_are_counted_once_and_in_the_room() {
        let frames: Vec<i32> = (1..=100).collect();
        let (hair, guides) = (size(20_000, 16), size(2000, 10));
        let chosen = |failed: &BTreeMap<i32, Vec<i32>>, points: f64| {
            Selection::new(&frames, &[], failed, [hair, guides], points)
        };
        // The same two in each frame before others, and more in a frame that is not there.
        let mut failed: BTreeMap<i32, Vec<i32>> = (1..=99).map(|frame| (frame, vec![7, 9])).collect();
        failed.insert(100, (1000..1100).collect());
        failed.insert(101, (2000..2100).collect());
        let all = chosen(&failed, 1e8);
        assert_eq!((all.failed, all.always.len(), all.guide_step), (102, 102, 1));
        // Most of them fail.
        let failed: BTreeMap<i32, Vec<i32>> = (1..=100).map(|frame| (frame, (0..1500).collect())).collect();
        let some = chosen(&failed, 1e6);
        assert!(some.failed == 1500 && some.always.len() > 20, "{some:?}");
        let shown = some.always.len() + guides.curves.div_ceil(some.guide_step);
        let room = 1.05 * GUIDES * 1e6;
        assert!((shown * some.frames.len() * 10) as f64 <= room, "{shown} guides of {some:?}");
        assert!(some.guide_step > chosen(&BTreeMap::new(), 1e6).guide_step);
    }
}
