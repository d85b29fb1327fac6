//! Goals of an animation: curves that guides are pulled to.

use super::OBJ_DIGITS;
use super::colliders::Colliders;
use super::names::Names;
use super::options::{GoalCurvesSource, TrackGroom, TrackOptions};
use super::timing::Timing;
use crate::file::relative;
use crate::import::formats::usd::goal::{self, MovingCurves};
use crate::import::plain::{Declared, SampleTimes};
use crate::import::source::Source;
use crate::import::units::{HAIR_SIZE, convention};
use crate::scene::anim::file::{GoalFile, NumberKeyframesFile};
use crate::scene::obj_curves::ObjCurves;
use crate::scene::{Convention, FileSequence, UpAxis};
use crate::{Diagnostic, Error, Result};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Largest displacement of a point between two frames, as a share of the extent of its curve, that counts as
/// none.
const STILL: f64 = 1e-6;

/// Goals and the files that they refer to.
#[derive(Default)]
pub(super) struct Goals {
    pub(super) goals: Vec<GoalFile>,
    /// Files to write: path and text.
    pub(super) files: Vec<(PathBuf, String)>,
    /// Remarks on the curves.
    pub(super) notes: Vec<String>,
    /// What the artist should check in them.
    pub(super) warnings: Vec<String>,
    names: Names,
    /// What files beside the animation are named after.
    file_names: Names,
}

/// The curves of a goal as they are in its file.
pub(super) enum GoalInput {
    /// Curves of a USD stage.
    Stage {
        read: MovingCurves,
        /// Time codes per second that the bake reads, and per frame.
        rate: f64,
        codes_per_frame: f64,
    },
    /// The first file of a sequence of OBJ files.
    Sequence(ObjCurves),
}

impl GoalInput {
    /// Reads the curves of `source` at `times`, or the first file, that of frame `first`, of a sequence.
    ///
    /// # Errors
    /// A file that is neither; the errors in it.
    pub(super) fn read(source: &Source, times: &SampleTimes, first: i32) -> Result<Self> {
        if source.is_usd() {
            let SampleTimes { rate, step: codes_per_frame, .. } = *times;
            return Ok(GoalInput::Stage { read: goal::read(source, times)?, rate, codes_per_frame });
        }
        source.check()?;
        let Some(sequence) = FileSequence::new(&source.path.to_string_lossy()) else {
            return Err(Diagnostic::new(
                &source.path,
                "",
                "is no file of animated curves",
                ".usd, .usda, .usdc or .usdz, or a sequence of OBJ files such as tail.####.obj",
                "export to one of these formats",
            )
            .into());
        };
        let path = sequence.path(Path::new(""), first);
        let read = ObjCurves::load(&path, &Convention::default());
        let help = "export the curves again, or correct the path";
        Ok(GoalInput::Sequence(read.map_err(|what| {
            Error::from(Diagnostic::new(&path, "", what, "an OBJ file with curves", help))
        })?))
    }
}

impl Goals {
    /// No goals yet; their files are named otherwise than those of `colliders`.
    pub(super) fn beside(colliders: &Colliders) -> Self {
        Goals { file_names: colliders.names.clone(), ..Goals::default() }
    }

    /// Adds a goal. `read` are its curves, `timing` that of the bake.
    ///
    /// # Errors
    /// Curves that match no guides or have other time codes, a unit that cannot be guessed, a path that has
    /// no absolute form.
    pub(super) fn add(
        &mut self,
        from: &GoalCurvesSource,
        read: GoalInput,
        timing: &Timing,
        options: &TrackOptions,
    ) -> Result<()> {
        let GoalCurvesSource { name, source, space } = from;
        let mut notes = Vec::new();
        let mut goal = GoalFile {
            name: self.names.unique(name),
            sequence: String::new(),
            metres_per_unit: Some(1.0),
            up_axis: Some(UpAxis::Y),
            space: *space,
            groups: None,
            ids: None,
            weight: NumberKeyframesFile::Constant(1.0),
            along: None,
            hard_to: None,
            hz: 4.0,
            damping: 1.0,
        };
        match read {
            GoalInput::Sequence(curves) => {
                let of_file = convention(source, Declared::default(), &curves.points, HAIR_SIZE, &mut notes)?;
                (goal.metres_per_unit, goal.up_axis) = (Some(of_file.metres_per_unit), Some(of_file.up));
                goal.sequence = relative(&source.path, options.folder())?;
            }
            GoalInput::Stage { read, rate, codes_per_frame } => {
                let of_file = convention(source, read.declared, &read.samples[0], HAIR_SIZE, &mut notes)?;
                notes.extend(read.notes.iter().cloned());
                if (read.rate - rate).abs() > 1e-6 * rate {
                    return Err(Diagnostic::new(
                        &source.path,
                        "timeCodesPerSecond",
                        format!("{} time codes a second, where the bake reads {rate}", read.rate),
                        "curves with the time codes of the motion, or of the frames of the bake",
                        "export the curves at this rate, or bake at theirs (--fps)",
                    )
                    .into());
                }
                let matched = Matched::new(&read, source, options.groom.as_ref())?;
                let first_sample = timing.first_mesh_frame();
                let movement = Movement::new(&read, &matched.curves, codes_per_frame, first_sample);
                if movement.moving == 0 {
                    notes.push("the curves do not move".into());
                }
                let warning = movement.warning(timing.frames);
                self.warnings.extend(warning.map(|what| format!("goal {}: {what}", goal.name)));
                notes.extend(matched.note());
                goal.ids = matched.ids.clone().map(Into::into);
                let file_name = self.file_names.unique(&format!("goal_{}", goal.name));
                goal.sequence = options.name_beside(&format!("{file_name}.####.obj"));
                self.write(&goal.sequence, &read, &matched, &of_file, first_sample, options.folder());
            }
        }
        self.notes.extend(notes.iter().map(|note| format!("goal {}: {note}", goal.name)));
        self.goals.push(goal);
        Ok(())
    }

    /// Writes the curves that have guides as OBJ files in `folder`, metres, Y up.
    fn write(
        &mut self,
        sequence: &str,
        read: &MovingCurves,
        matched: &Matched,
        convention: &Convention,
        first_frame: i32,
        folder: &Path,
    ) {
        let Some(sequence) = FileSequence::new(sequence) else { return };
        let starts = read.starts();
        for (frame, sample) in (first_frame..).zip(&read.samples) {
            let mut curves = ObjCurves { offsets: vec![0], points: Vec::new() };
            for &c in &matched.curves {
                curves
                    .points
                    .extend(sample[starts[c]..starts[c + 1]].iter().map(|p| convention.length_in(*p)));
                curves.offsets.push(curves.points.len());
            }
            self.files.push((sequence.path(folder, frame), curves.to_obj(OBJ_DIGITS)));
        }
    }
}

/// How the curves of a goal move in the time that the bake reads.
struct Movement {
    /// Curves that move at all.
    moving: usize,
    /// Of these, the ones that stand still where the file has no points any more, or not yet.
    cut_short: usize,
    /// First and last frame for which the file has points of all of them.
    span: [f64; 2],
}

impl Movement {
    /// The movement of the curves `of`; the first sample is that of the frame `first_sample`.
    fn new(read: &MovingCurves, of: &[usize], codes_per_frame: f64, first_sample: i32) -> Self {
        let starts = read.starts();
        let mut movement = Movement { moving: 0, cut_short: 0, span: [f64::NEG_INFINITY, f64::INFINITY] };
        for &c in of {
            let points = |sample: usize| &read.samples[sample][starts[c]..starts[c + 1]];
            let extent = points(0).iter().map(|x| (x - points(0)[0]).norm()).fold(0.0, f64::max);
            let still = |pair: usize| {
                let mut moved = points(pair).iter().zip(points(pair + 1));
                moved.all(|(a, b)| (a - b).norm() <= STILL * extent)
            };
            let Some(first) = (0..read.samples.len() - 1).find(|pair| !still(*pair)) else { continue };
            let last = (first..read.samples.len() - 1).rfind(|pair| !still(*pair)).unwrap_or(first) + 1;
            movement.moving += 1;
            let [from, to] = read.span[c].map(|code| code / codes_per_frame);
            let frame = |sample: usize| f64::from(first_sample) + sample as f64;
            // It moves up to the end of its samples, but the bake goes on.
            let early = last + 1 < read.samples.len() && frame(last) > to - 1.0;
            let late = first > 0 && frame(first) < from + 1.0;
            movement.cut_short += usize::from(early || late);
            movement.span = [movement.span[0].max(from), movement.span[1].min(to)];
        }
        movement
    }

    /// What to tell of curves that stand still in a part of the frames `first` to `last`.
    fn warning(&self, [first, last]: [i32; 2]) -> Option<String> {
        let [from, to] = self.span.map(|frame| (1e3 * frame).round() / 1e3);
        let uncovered = from > f64::from(first) || to < f64::from(last);
        (self.cut_short > 0 && uncovered).then(|| {
            format!(
                "{} of {} curves that move have samples for a part of the frames {first} to {last} only (all have \
                 them from {from} to {to}), and stand still in the others",
                self.cut_short, self.moving
            )
        })
    }
}

/// The curves of a goal that have guides.
struct Matched {
    /// Their indices.
    curves: Vec<usize>,
    /// The ids of their guides; `None` if they are those of the groom, in its order.
    ids: Option<Vec<i32>>,
    /// Number of curves and guides that are without each other.
    without: [usize; 2],
}

impl Matched {
    /// Matches curves with the guides of `groom`, if it is known: by their ids, else in order.
    ///
    /// # Errors
    /// No guide has a curve, or the numbers differ without ids.
    fn new(read: &MovingCurves, source: &Source, groom: Option<&TrackGroom>) -> Result<Self> {
        let all: Vec<usize> = (0..read.counts.len()).collect();
        let Some(groom) = groom else {
            return Ok(Matched { curves: all, ids: read.ids.clone(), without: [0; 2] });
        };
        let guides = &groom.ids;
        let index: HashMap<i32, usize> =
            read.ids.iter().flatten().enumerate().map(|(curve, id)| (*id, curve)).collect();
        let by_id: Vec<(usize, i32)> = guides.iter().filter_map(|id| Some((*index.get(id)?, *id))).collect();
        if !by_id.is_empty() {
            let without = [all.len(), guides.len()].map(|n| n - by_id.len());
            let (curves, ids) = by_id.into_iter().unzip();
            return Ok(Matched { curves, ids: Some(ids), without });
        }
        if all.len() == guides.len() {
            return Ok(Matched { curves: all, ids: None, without: [0; 2] });
        }
        let message = match read.ids {
            Some(_) => format!("none of the ids of its {} curves is that of a guide", all.len()),
            None => format!("holds {} curves without ids, for {} guides", all.len(), guides.len()),
        };
        Err(Diagnostic::new(
            &source.path,
            source.prim.clone().unwrap_or_default(),
            message,
            "curves with the ids of guides (primvars:groom_id or id), or one curve for each guide, in order",
            "name the prim of the curves (FILE:PRIM), or export them from the groom's guides",
        )
        .into())
    }

    /// How many curves and guides match, in words.
    fn note(&self) -> Option<String> {
        let [curves, guides] = self.without;
        let matched = self.curves.len();
        match &self.ids {
            Some(_) if curves + guides > 0 => Some(format!(
                "{matched} guides have a curve, by id; {guides} guides and {curves} curves are without each other"
            )),
            Some(_) => Some(format!("{matched} curves, by id")),
            None => Some(format!("{matched} curves, in the order of the guides")),
        }
    }
}
