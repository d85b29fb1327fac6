//! The frame loop: sub-steps, statistics, the cache written as it goes.

pub mod air;
mod clearance;
pub mod company;
pub mod guide;
pub mod output;
pub mod record;
mod scheme;
pub mod simulation;
mod tangle;
pub mod tie;
mod touch;

use crate::cache::{self, InputRecord, Manifest};
use crate::scene::{Anim, Groom};
use crate::strands::SPAN;
use crate::{Error, Result};
use output::{GuideState, Output};
use record::FrameRecord;
use serde::Serialize;
use serde_json::{Map, Value, json};
use simulation::Simulation;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Wall-clock time of the stages of one frame, s. Kept out of the cache: it changes from run to run.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct StageSeconds {
    /// Sub-steps of the guides.
    pub simulate: f64,
    /// Render strands from guides.
    pub interpolate: f64,
    /// Encoding and writing the frame file.
    pub write: f64,
}

/// What a bake did, frame by frame, handle frames included.
#[derive(Debug, Clone, Default)]
pub struct BakeSummary {
    /// Figures of each frame.
    pub frames: Vec<FrameRecord>,
    /// Time that each frame took.
    pub seconds: Vec<StageSeconds>,
    /// Time of the pre-roll, s.
    pub preroll_seconds: f64,
    /// The manifest as written.
    pub manifest: Option<Manifest>,
}

/// A frame that is simulated and not written yet.
struct Simulated {
    record: FrameRecord,
    guides: Vec<GuideState>,
    /// See [`Interpolator::retreats`](crate::strands::Interpolator::retreats).
    retreats: Vec<f32>,
    seconds: StageSeconds,
}

/// Name and checksum of every file that a bake of the scene reads. Errors: files that cannot be read.
pub fn inputs(groom: &Path, anim: &Path) -> Result<Vec<InputRecord>> {
    let record = |(role, path): (&str, PathBuf)| {
        let bytes = crate::file::read_file(&path).map_err(|e| Error::io(&path, e))?;
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(InputRecord { role: role.into(), file, sha256: cache::sha256(&bytes) })
    };
    crate::scene::inputs(groom, anim)?.into_iter().map(record).collect()
}

/// Bakes `groom` on `anim` into the folder `out`, frame by frame; `progress` is told each frame that is on disk, and how
/// many of how many that makes.
///
/// # Errors
/// [`crate::Error::Io`] where a file cannot be written.
pub fn bake(
    groom: Groom,
    anim: &Anim,
    inputs: Vec<InputRecord>,
    out: &Path,
    mut progress: impl FnMut(&FrameRecord, usize, usize),
) -> Result<BakeSummary> {
    let groom = &groom.with_default_trees(anim.settings.nodes);
    let mut simulation = Simulation::new(groom, anim);
    let mut output = Output::new(groom, anim, &simulation);
    let writer = cache::Writer::create(out, output.header())?;
    let mut manifest = Manifest::new(output.header());
    manifest.inputs = inputs;
    manifest.settings = settings(anim);

    let ids = &groom.guides.curves.id;
    let mut summary = BakeSummary::default();
    let (first, last) = (anim.frames.0 - 1, anim.frames.1 + 1);
    let total = (last - first + 1) as usize;
    // A frame's strands depend on the guides of the frames around it, so the simulation is ahead.
    let mut window: VecDeque<Simulated> = VecDeque::with_capacity(2 * SPAN + 1);
    for ahead in first..=last + SPAN as i32 {
        let mut record = FrameRecord { frame: ahead, ..FrameRecord::default() };
        let start = Instant::now();
        simulation.run_to(ahead, |steps| record.add(steps, ids));
        let simulate = start.elapsed().as_secs_f64();
        record.close(&simulation.guides, &output::head_motion(anim, simulation.time()));
        let start = Instant::now();
        let guides = simulation.state();
        let retreats = output.retreats(ahead, &guides);
        let seconds =
            StageSeconds { simulate, interpolate: start.elapsed().as_secs_f64(), ..StageSeconds::default() };
        window.push_back(Simulated { record, guides, retreats, seconds });
        let Some(middle) = window.len().checked_sub(1 + SPAN) else { continue };
        // Before the first frame all is as it is there.
        let around = |i: usize| (middle + i).saturating_sub(SPAN);
        let Simulated { record, guides, seconds, .. } = &window[middle];
        let mut seconds = *seconds;
        let start = Instant::now();
        let arrays = output.frame(
            record.frame,
            guides,
            &std::array::from_fn(|i| window[around(i)].retreats.as_slice()),
        );
        seconds.interpolate += start.elapsed().as_secs_f64();
        let start = Instant::now();
        let file = writer.write_frame(&arrays)?;
        seconds.write = start.elapsed().as_secs_f64();
        manifest.frames.push(cache::FrameRecord { frame: record.frame, file, figures: figures(record) });
        if record.frame == first {
            // The first frame's steps are the pre-roll's.
            summary.preroll_seconds = std::mem::take(&mut seconds.simulate);
        }
        summary.seconds.push(seconds);
        summary.frames.push(record.clone());
        progress(record, summary.frames.len(), total);
        if window.len() > 2 * SPAN {
            window.pop_front();
        }
    }
    manifest.totals = totals(&summary.frames);
    manifest.scene_figures = scene_figures(groom, &simulation);
    summary.manifest = Some(writer.finish(manifest)?);
    Ok(summary)
}

/// The settings of a bake as the manifest holds them.
fn settings(anim: &Anim) -> Value {
    json!({
        "substeps": anim.settings.substeps,
        "preroll_s": anim.settings.preroll,
        "nodes": anim.settings.nodes,
        "scheme": anim.settings.scheme,
        "contact": anim.settings.contact,
        "gravity_m_s2": [anim.gravity.x, anim.gravity.y, anim.gravity.z],
    })
}

/// What the scene is like: points of guides that contact leaves alone, one for each body that they are in, and what whoever made
/// the groom found.
fn scene_figures(groom: &Groom, simulation: &Simulation) -> Map<String, Value> {
    let exempt: usize = simulation.guides.iter().map(|g| g.clearance.counts().0).sum();
    object(json!({ "exempt_guide_points": exempt, "groom_notes": groom.notes }))
}

/// Figures over all frames: the worst of each, and the sums of what should be rare.
fn totals(frames: &[FrameRecord]) -> Map<String, Value> {
    let worst = |of: fn(&FrameRecord) -> f64| frames.iter().map(of).fold(0.0, f64::max);
    let sum = |of: fn(&FrameRecord) -> u32| frames.iter().map(of).map(u64::from).sum::<u64>();
    let totals = json!({
        "penetration_m": worst(|f| f.penetration_m),
        "length_drift": worst(|f| f.length_drift),
        "speed_max_m_s": worst(|f| f.speed_max_m_s),
        "contact_residual": worst(|f| f.contact_residual),
        "unconverged": sum(|f| f.unconverged.len() as u32),
        "shortened": sum(|f| f.shortened),
        "strand_residual": worst(|f| f.strand_residual),
        "crossings": sum(|f| f.crossings),
        "strands_shortened": sum(|f| f.strands_shortened),
        "tie_slack_m": worst(|f| f.tie_slack_m),
        "halvings": sum(|f| f.halvings),
    });
    object(totals)
}

fn figures(record: &FrameRecord) -> Map<String, Value> {
    let mut figures = object(json!(record));
    figures.remove("frame");
    figures
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
