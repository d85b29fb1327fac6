//! Completes a cache: root layer, manifest, checksums.

use super::frame_record::FrameRecord;
use super::frame_state::FrameState;
use super::job::Job;
use super::over;
use super::work_dir::WrittenFrame;
use crate::cache::{self, Manifest, Writer};
use crate::file::FileRecord;
use crate::math::percentile;
use crate::scene::anim::Goal;
use crate::{Error, Result};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// A finished frame, as the manifest lists it.
#[derive(Clone)]
pub(super) struct Finished {
    pub record: FrameRecord,
    machine: String,
    file: FileRecord,
    over: Option<FileRecord>,
}

impl Finished {
    pub fn new(state: &FrameState, WrittenFrame { file, over, measures }: WrittenFrame) -> Self {
        let record = state.record.with_written(measures);
        Finished { record, machine: state.machine.clone(), file, over }
    }
}

/// Completes the cache.
pub(super) fn finish(job: &Job, mut writer: Writer, finished: Vec<Finished>) -> Result<Manifest> {
    let mut manifest = Manifest::new(writer.header());
    manifest.key = job.key.clone();
    manifest.machines =
        finished.iter().map(|f| f.machine.clone()).collect::<BTreeSet<_>>().into_iter().collect();
    manifest.inputs = job.inputs.clone();
    manifest.settings = job.settings.clone();
    manifest.totals = totals(&finished);
    if let Some(plan) = &job.over {
        manifest.over = over::record(&job.groom, writer.header(), plan);
        let deform = over::deform(&job.groom, &job.anim, &job.rods, writer.header(), plan, &job.out)?;
        if let Some((layer, record)) = deform {
            writer = writer.with_deform(layer);
            manifest.deform = Some(record);
        }
    }
    // Exempt segments stay exempt.
    let [exempt, segments] =
        finished.last().map_or([0; 2], |f| [f.record.exempt_segments, f.record.contact_segments]);
    let first = job.work.state(*job.frames().start()).map_err(|fault| Error::NotYet(fault.to_string()))?;
    let [mean, largest] = job.rods.departure(&first.guides);
    manifest.scene_figures = object(json!({
        "exempt_guide_segments": exempt,
        "guide_segments": segments,
        "groom_notes": job.groom.notes,
        "hair_sampling": job.rods.sampling.clone().map(|sampling| percentile(sampling, 0.5)),
        "goals": goals(job),
        "sag_free": job.rods.sag_free,
        "first_frame_from_groom": { "mean": mean, "largest": largest },
        "started_in": first.record.started_in,
    }));
    for Finished { record, file, over, .. } in finished {
        let figures = figures(&record);
        manifest.frames.push(cache::FrameEntry { frame: record.frame, file, over, figures });
    }
    let manifest = writer.finish(manifest)?;
    job.work.sync_marks(&job.frames().collect::<Vec<_>>())?;
    job.work.tidy(job.frames())?;
    Ok(manifest)
}

/// Figures over all frames: extremes, and sums of rare events.
fn totals(finished: &[Finished]) -> Map<String, Value> {
    let worst = |of: fn(&FrameRecord) -> f64| finished.iter().map(|f| of(&f.record)).fold(0.0, f64::max);
    let sum = |of: fn(&FrameRecord) -> u32| finished.iter().map(|f| u64::from(of(&f.record))).sum::<u64>();
    let totals = json!({
        "penetration_m": worst(|f| f.penetration_m),
        "exempt_penetration_m": worst(|f| f.exempt_penetration_m),
        "pinched_penetration_m": worst(|f| f.pinched_penetration_m),
        "hair_penetration_m": worst(|f| f.hair_penetration_m),
        "hair_jumped": sum(|f| f.hair_jumped),
        "hair_jump_m": worst(|f| f.hair_jump_m),
        "limited_rates": sum(|f| f.limited_rates),
        "length_drift": worst(|f| f.length_drift),
        "segment_turn_rad": worst(|f| f.segment_turn_rad),
        "speed_max_m_s": worst(|f| f.speed_max_m_s),
        "contact_residual": worst(|f| f.contact_residual),
        "unconverged": sum(|f| f.unconverged.len() as u32),
        "shortened": sum(|f| f.shortened),
        "unsettled": sum(|f| f.unsettled),
        "hair_softened": worst(|f| f.hair_softened),
        "hair_crowding_p95": worst(|f| f.hair_crowding_p95),
        "hair_crowding_max": worst(|f| f.hair_crowding_max),
        "hair_slip": worst(|f| f.hair_slip),
        "strand_residual": worst(|f| f.strand_residual),
        "crossings": sum(|f| f.crossings),
        "strands_unsettled": sum(|f| f.strands_unsettled),
        "strands_shortened": sum(|f| f.strands_shortened),
        "strand_missing": worst(|f| f.strand_missing),
        "strand_gain": worst(|f| f.strand_gain),
        "hair_gain": worst(|f| f.hair_gain),
        "tie_slack_m": worst(|f| f.tie_slack_m),
        "goal_distance_mean_m": worst(|f| f.goal_distance_mean_m),
        "goal_distance_max_m": worst(|f| f.goal_distance_max_m),
        "halvings": sum(|f| f.halvings),
    });
    object(totals)
}

/// The guides of each goal, by their ids, with the weights of their own.
fn goals(job: &Job) -> Vec<Value> {
    let goal = |goal: &Goal| {
        let ids = goal.guides.iter().map(|g| job.groom.guides.curves.id[*g]);
        let weights = goal.guides.iter().map(|g| job.rods.simulated[*g].material.goal_weight);
        json!({ "name": goal.name, "guides": ids.collect::<Vec<_>>(), "weights": weights.collect::<Vec<_>>() })
    };
    job.anim.goals.iter().map(goal).collect()
}

fn figures(record: &FrameRecord) -> Map<String, Value> {
    let mut figures = object(json!(record));
    figures.remove("frame");
    figures.remove("started_in");
    figures
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
