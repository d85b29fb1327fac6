//! The end of a bake: the report, the contact sheet and a few lines to read.

use super::preview::PICTURES;
use crate::bake::frame_record::FrameRecord;
use crate::bake::{BakeSummary, StageSeconds};
use crate::cache::{Manifest, Reader, write_file};
use crate::error::Result;
use crate::file::remove_file;
use crate::report::preview::{self, Options, spread};
use crate::report::{BakeReport, Chart, Picture, Series};
use std::fmt::Write;
use std::path::Path;

const SHEET: &str = "sheet.png";
const PAGE: &str = "report.html";
const DATA: &str = "report.json";
/// Entries of one kind that a warning names.
const NAMED: usize = 8;

/// Removes the report of an earlier bake, so that none is taken for this one's.
pub fn remove_old(out: &Path) -> Result<()> {
    [SHEET, PAGE, DATA].iter().try_for_each(|name| remove_file(&out.join(name)))
}

/// Whether there is a report, with its contact sheet if asked for.
pub fn is_there(out: &Path, pictures: bool) -> bool {
    out.join(PAGE).is_file() && out.join(DATA).is_file() && (!pictures || out.join(SHEET).is_file())
}

/// Writes the report, and the contact sheet if asked for, into the cache's folder.
pub fn write(summary: &BakeSummary, title: &str, out: &Path, pictures: bool) -> Result<()> {
    let mut report = report(summary, title);
    if pictures {
        let reader = Reader::open(out)?;
        let frames = spread(reader.header().frames, PICTURES);
        let bytes = preview::sheet(&reader, &Options::default(), &frames)?.to_png()?;
        write_file(&out.join(SHEET), &[&bytes])?;
        let caption = format!("Frames {} to {}", frames[0], frames[frames.len() - 1]);
        report.pictures.push(Picture { caption, media_type: "image/png".into(), bytes });
    }
    write_file(&out.join(PAGE), &[report.to_html()?])?;
    write_file(&out.join(DATA), &[report.to_json()?])?;
    Ok(())
}

/// What was written, how long it took and how good it is.
pub fn text(summary: &BakeSummary, out: &Path, pictures: bool) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<14}{value}");
    };
    if let Some(Manifest { summary, frames, .. }) = &summary.manifest {
        let bytes: u64 = frames.iter().map(|f| f.file.bytes).sum();
        line(
            "written",
            format!(
                "{}: {} frames, {} strands, {} guides, {:.1} MB",
                out.display(),
                frames.len(),
                summary.hair.0,
                summary.guides.0,
                bytes as f64 * 1e-6
            ),
        );
    }
    let n = summary.fresh();
    if n > 0 {
        let sum = |of: fn(&StageSeconds) -> f64| summary.seconds.iter().flatten().map(of).sum::<f64>();
        let [simulate, interpolate, write] =
            [sum(|s| s.simulate), sum(|s| s.interpolate), sum(|s| s.write)].map(|sum| sum / n as f64);
        let preroll = summary.preroll_seconds.map(|s| format!("; pre-roll {s:.1} s")).unwrap_or_default();
        let before = match summary.frames.len() - n {
            0 => String::new(),
            done => format!("; {done} frames were done already"),
        };
        line(
            "time",
            format!(
                "{:.3} s/frame: simulate {simulate:.3}, interpolate {interpolate:.3}, write {write:.3}{preroll}{before}",
                simulate + interpolate + write
            ),
        );
    }
    if let Some(bytes) = peak_memory() {
        line("peak memory", format!("{:.0} MB", bytes as f64 * 1e-6));
    }
    let worst = |of: fn(&FrameRecord) -> f64| {
        summary.frames.iter().map(|f| (of(f), f.frame)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
    };
    let (depth, frame) = worst(|f| f.penetration_m);
    line(
        "penetration",
        if depth > 0.0 { format!("{:.4} mm at most, frame {frame}", depth * 1e3) } else { "none".into() },
    );
    let (drift, frame) = worst(|f| f.length_drift);
    line("length drift", format!("{drift:.1e} at most, frame {frame}"));
    if let Some(start) = summary.manifest.as_ref().and_then(start) {
        line("start", start);
    }
    for warning in warnings(&summary.frames) {
        line("warning", warning);
    }
    if pictures {
        line("to look at", out.join(SHEET).display().to_string());
    }
    line("report", out.join(PAGE).display().to_string());
    text.truncate(text.trim_end().len());
    text
}

/// How the groom starts: how near to it the first frame is, and what holds it.
fn start(manifest: &Manifest) -> Option<String> {
    let figure = |path: &str| manifest.scene_figures.get("sag_free")?.get(path)?.as_f64();
    let from = |path: &str| manifest.scene_figures.get("first_frame_from_groom")?.get(path)?.as_f64();
    let mut text = format!(
        "guides {:.2} % of their length from the groom at the first frame, {:.1} % at most",
        from("mean")? * 100.0,
        from("largest")? * 100.0
    );
    if figure("guides")? > 0.0 {
        let _ =
            write!(text, "; {} of {} held sag-free made stiffer", figure("stiffened")?, figure("guides")?);
        let _ =
            write!(text, ", up to {:.1} times, {} sag nevertheless", figure("stiffest")?, figure("sagging")?);
    }
    Some(text)
}

fn report(summary: &BakeSummary, title: &str) -> BakeReport {
    let frames = &summary.frames;
    let series = |name: &str, of: fn(&FrameRecord) -> f64| Series {
        name: name.into(),
        values: frames.iter().map(of).collect(),
    };
    let stage = |name: &str, of: fn(&StageSeconds) -> f64| Series {
        name: name.into(),
        // What another process did took a time that this one does not know.
        values: summary.seconds.iter().map(|s| s.as_ref().map_or(f64::NAN, of)).collect(),
    };
    let chart = |name: &str, unit: &str, note: &str, series: Vec<Series>| Chart {
        name: name.into(),
        unit: unit.into(),
        note: note.into(),
        logarithmic: false,
        series,
    };
    let drift = chart(
        "Length drift of guides",
        "",
        "Largest relative change of a segment's length as read from the frames at its ends. The curve keeps its length exactly; this shows how well segments this long follow it.",
        vec![series("largest", |f| f.length_drift)],
    );
    let residual = chart(
        "Residual of the reactions",
        "",
        "By how much the law of contact is missed, relative to the forces, at worst.",
        vec![series("bodies", |f| f.contact_residual), series("guides", |f| f.strand_residual)],
    );
    let mut charts = vec![
        chart(
            "Contacts",
            "",
            "Places where a guide is at a body, at the last sub-step of the frame.",
            vec![
                series("found", |f| f64::from(f.contacts_found)),
                series("active", |f| f64::from(f.contacts_active)),
            ],
        ),
        Chart { logarithmic: true, ..residual },
        chart(
            "Penetration",
            "mm",
            "Deepest point inside a body that is not exempt (roots that start inside are).",
            vec![series("deepest", |f| f.penetration_m * 1e3)],
        ),
        Chart { logarithmic: true, ..drift },
        chart(
            "Speed relative to the head",
            "m/s",
            "Points of guides. Zero on a still head once the hair has settled.",
            vec![
                series("mean", |f| f.speed_mean_m_s),
                series("95th percentile", |f| f.speed_p95_m_s),
                series("largest", |f| f.speed_max_m_s),
            ],
        ),
        chart(
            "Newton steps",
            "",
            "Per guide and sub-step.",
            vec![series("mean", |f| f.newton_mean), series("most", |f| f64::from(f.newton_max))],
        ),
        chart(
            "Rescues",
            "",
            "Steps cut in half for the solver's sake, motions cut short at a surface or for another guide's sake, steps taken though contacts had not \
                 come to rest, guides carried along for want of convergence; none is good.",
            vec![
                series("halvings", |f| f64::from(f.halvings)),
                series("shortened", |f| f64::from(f.shortened)),
                series("shortened for guides", |f| f64::from(f.strands_shortened)),
                series("crossings", |f| f64::from(f.crossings)),
                series("unsettled", |f| f64::from(f.unsettled + f.strands_unsettled)),
                series("unconverged", |f| f.unconverged.len() as f64),
            ],
        ),
    ];
    if frames.iter().any(|f| f.strand_rounds > 0) {
        charts.insert(
            1,
            chart(
                "Contacts between guides",
                "",
                "Places where two guides are near each other or met, at the last sub-step of the frame.",
                vec![
                    series("found", |f| f64::from(f.strand_contacts_found)),
                    series("active", |f| f64::from(f.strand_contacts_active)),
                ],
            ),
        );
    }
    if frames.iter().any(|f| f.splits + f.merges > 0) {
        charts.push(chart(
            "Nodes of guides that move by themselves",
            "",
            "At the end of the frame; the others follow their wisps.",
            vec![series("nodes", |f| f64::from(f.active_nodes))],
        ));
        charts.push(chart(
            "Splits and merges",
            "",
            "Guides that came away from their wisps, and that joined them again.",
            vec![series("splits", |f| f64::from(f.splits)), series("merges", |f| f64::from(f.merges))],
        ));
    }
    BakeReport {
        title: title.into(),
        settings: settings(summary),
        frames: frames.iter().map(|f| f.frame).collect(),
        stages: vec![
            stage("simulate", |s| s.simulate),
            stage("interpolate", |s| s.interpolate),
            stage("write", |s| s.write),
        ],
        charts,
        warnings: warnings(frames),
        pictures: Vec::new(),
    }
}

/// Settings and inputs of the bake, as the manifest has them.
fn settings(summary: &BakeSummary) -> Vec<(String, String)> {
    let mut rows = Vec::new();
    rows.extend(summary.preroll_seconds.map(|s| ("pre-roll took".to_string(), format!("{s:.1} s"))));
    if let Some(manifest) = &summary.manifest {
        let settings = manifest.settings.as_object().into_iter().flatten();
        rows.extend(settings.map(|(name, value)| (name.clone(), value.to_string())));
        rows.extend(
            manifest.inputs.iter().map(|i| (i.role.clone(), format!("{} ({})", i.file, &i.sha256[..12]))),
        );
        rows.push(("hairbake".into(), format!("{}, build {}", manifest.hairbake, manifest.build)));
        rows.push(("simulated on".into(), manifest.machines.join("; ")));
        rows.push(("key".into(), manifest.key.clone()));
        if let Some(exempt) = manifest.scene_figures.get("exempt_guide_segments") {
            rows.push(("guide segments exempt from contact".into(), exempt.to_string()));
        }
        rows.extend(start(manifest).map(|start| ("start".to_string(), start)));
        let notes = manifest.scene_figures.get("groom_notes").and_then(|notes| notes.as_array());
        rows.extend(
            notes.into_iter().flatten().filter_map(|n| n.as_str()).map(|n| ("groom".into(), n.to_string())),
        );
    }
    rows
}

fn warnings(frames: &[FrameRecord]) -> Vec<String> {
    let mut warnings = Vec::new();
    let unconverged: Vec<&FrameRecord> = frames.iter().filter(|f| !f.unconverged.is_empty()).collect();
    if !unconverged.is_empty() {
        let named = unconverged.iter().map(|f| {
            let ids: Vec<String> = f.unconverged.iter().take(NAMED).map(i32::to_string).collect();
            let more = if f.unconverged.len() > NAMED { ", …" } else { "" };
            format!("{} (guides {}{more})", f.frame, ids.join(", "))
        });
        warnings.push(format!(
            "solves that did not converge (the guides were carried along with the head instead), in {} frames: {}; more sub-steps may help",
            unconverged.len(),
            list(named, unconverged.len())
        ));
    }
    let shortened: Vec<&FrameRecord> = frames.iter().filter(|f| f.shortened > 0).collect();
    if !shortened.is_empty() {
        let named = shortened.iter().map(|f| format!("{} ({})", f.frame, f.shortened));
        warnings.push(format!(
            "motions cut short at a surface, in {} frames: {}",
            shortened.len(),
            list(named, shortened.len())
        ));
    }
    let unsettled = |f: &FrameRecord| f.unsettled + f.strands_unsettled;
    let restless: Vec<&FrameRecord> = frames.iter().filter(|f| unsettled(f) > 0).collect();
    if !restless.is_empty() {
        let named = restless.iter().map(|f| format!("{} ({})", f.frame, unsettled(f)));
        warnings.push(format!(
            "steps taken though contacts had not come to rest, in {} frames: {}; more sub-steps may help",
            restless.len(),
            list(named, restless.len())
        ));
    }
    warnings
}

/// The first of `total` names, joined.
fn list(names: impl Iterator<Item = String>, total: usize) -> String {
    let named: Vec<String> = names.take(NAMED).collect();
    let more = if total > NAMED { ", …" } else { "" };
    format!("{}{more}", named.join(", "))
}

/// Most memory that the process has had, bytes, where the system tells (Linux).
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
