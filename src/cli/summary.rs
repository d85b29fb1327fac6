//! The end of a bake: its report, its contact sheet and a summary for the console.

use super::bake_report::{bake_report, report_of, scene_rows};
use super::figures::Figures;
use super::preview::{PICTURES, overview};
use super::warnings::{findings, pinches, warnings};
use crate::bake::frame_record::FrameRecord;
use crate::bake::{BakeSummary, StageSeconds};
use crate::cache::{FrameEntry, Manifest, ROOT, Reader, SHOT, write_file};
use crate::error::Result;
use crate::file::remove_file;
use crate::report::preview::spread;
use crate::report::view::View;
use crate::report::{BakeReport, Picture};
use std::fmt::Write;
use std::path::Path;

const SHEET: &str = "sheet.png";
/// The page of a report.
pub const PAGE: &str = "report.html";
/// Its data.
pub const DATA: &str = "report.json";

/// Most bytes of a page, unless charts and sheet leave too little of it for the view.
const MAX_PAGE: usize = 10_000_000;
/// Least room for the data of a view.
const MIN_VIEW: usize = 2_000_000;

/// Removes the report of an earlier bake.
///
/// # Errors
/// [`crate::Error::Io`].
pub fn remove_old(out: &Path) -> Result<()> {
    [SHEET, PAGE, DATA].iter().try_for_each(|name| remove_file(&out.join(name)))
}

/// Whether the folder has a report, with its contact sheet if `pictures`.
pub fn exists(out: &Path, pictures: bool) -> bool {
    out.join(PAGE).is_file() && out.join(DATA).is_file() && (!pictures || out.join(SHEET).is_file())
}

/// Writes the report, with its contact sheet and its view if `pictures`, into the folder of the cache.
///
/// # Errors
/// [`crate::Error::Io`].
pub fn write(summary: &BakeSummary, title: &str, out: &Path, pictures: bool) -> Result<()> {
    let mut report = bake_report(summary, title);
    if pictures {
        let reader = Reader::open(out)?;
        let sheet = overview(&reader)?.to_png()?;
        write_file(&out.join(SHEET), &[&sheet])?;
        illustrate(&mut report, Some(sheet), summary, &reader)?;
    }
    write_file(&out.join(PAGE), &[report.to_html()?])?;
    write_file(&out.join(DATA), &[report.to_json()?])?;
    Ok(())
}

/// The page of a cache with its view, `figures` of whose frames are known; the contact sheet is the one that
/// is there.
///
/// # Errors
/// Those of [`Reader`].
pub fn page(reader: &Reader, summary: &BakeSummary, figures: &Figures, title: &str) -> Result<String> {
    let mut report = report_of(summary, figures, title);
    let sheet = std::fs::read(reader.dir().join(SHEET)).ok();
    illustrate(&mut report, sheet, summary, reader)?;
    report.to_html()
}

/// Adds the contact sheet of the cache, and a view that keeps the page within [`MAX_PAGE`].
fn illustrate(
    report: &mut BakeReport,
    sheet: Option<Vec<u8>>,
    summary: &BakeSummary,
    reader: &Reader,
) -> Result<()> {
    report.pictures.extend(sheet.map(|bytes| {
        let frames = spread(reader.header().frames, PICTURES);
        let (first, last) = (frames[0], frames[frames.len() - 1]);
        let caption = format!("Frame {first} from three sides, and frames {first} to {last}");
        Picture { caption, media_type: "image/png".into(), bytes }
    }));
    // With a view, numbers of frames are links.
    let nothing = View::default();
    let script = nothing.to_html().len();
    report.view = Some(nothing);
    let taken = report.to_html()?.len() - script;
    let size = MAX_PAGE.saturating_sub(taken).max(MIN_VIEW);
    let findings = findings(summary, &report.warnings);
    report.view = Some(View::new(reader, reader.frames(), &findings, size)?);
    Ok(())
}

/// The end of a bake on the console: warnings, and in three lines what was made, where to look, and what to do
/// next; before them its figures, if asked for.
pub fn text(summary: &BakeSummary, out: &Path, pictures: bool, figures: bool) -> String {
    let warnings = warnings(summary);
    let mut text = if figures { figures_of(summary) } else { String::new() };
    warnings.iter().for_each(|warning| line(&mut text, "warning", &warning.to_text()));
    line(&mut text, "made", &made(summary, out));
    line(&mut text, "look at", &to_look_at(summary, out, pictures));
    line(&mut text, "try next", &to_try(out, !warnings.is_empty()));
    text.truncate(text.trim_end().len());
    text
}

fn line(text: &mut String, name: &str, value: &str) {
    // Writing to a string does not fail.
    let _ = writeln!(text, "{name:<14}{value}");
}

/// What was written, and how fast.
fn made(summary: &BakeSummary, out: &Path) -> String {
    let (all, done) = (summary.frames.len(), summary.frames.len() - summary.fresh());
    let mut text = match &summary.manifest {
        Some(manifest) => size(manifest, out),
        None => format!("{}: {all} frames", out.display()),
    };
    if summary.fresh() > 0 {
        text += &format!(", {:.2} s a frame", seconds(summary).iter().sum::<f64>());
    }
    if done > 0 {
        text += &format!(" ({done} were already done)");
    }
    text
}

/// The files that a person opens.
fn to_look_at(summary: &BakeSummary, out: &Path, pictures: bool) -> String {
    let path = |name: &str| out.join(name).display().to_string();
    let mut files = Vec::new();
    if pictures {
        files.push(path(SHEET));
        files.push(format!("{} plays the shot", path(PAGE)));
    } else {
        files.push(format!("{} has charts", path(PAGE)));
    }
    if let Some(manifest) = &summary.manifest {
        files.push(format!("{} opens in any USD program", path(ROOT)));
        let shot = path(SHOT);
        let over = manifest.over.as_ref().map(|over| {
            let paths: Vec<&str> = over.prims.iter().map(|prim| prim.path.as_str()).collect();
            format!("{shot} is {} with the motion over {}", over.stage, paths.join(", "))
        });
        let deform = manifest.deform.as_ref().map(|deform| {
            let paths: Vec<&str> = deform.prims.iter().map(|prim| prim.path.as_str()).collect();
            format!("{shot} is {}, in which Houdini deforms {} by the guides", deform.stage, paths.join(", "))
        });
        files.extend(over.into_iter().chain(deform));
    }
    files.join("; ")
}

/// Commands that go on from here.
fn to_try(out: &Path, warned: bool) -> String {
    let out = out.display();
    let play = if warned { "shows the frames of the warnings" } else { "plays it" };
    format!(
        "`hairbake view {out}` {play}; `hairbake preview {out} -o beauty.png --beauty` draws it at its best; \
         `hairbake validate {out}` checks it before it goes on"
    )
}

/// The figures of a bake: how long it took, and how good it is.
fn figures_of(summary: &BakeSummary) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| line(&mut text, name, &value);
    if summary.fresh() > 0 {
        line("time", time(summary));
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
        if depth > 0.0 { format!("{:.4} mm max, frame {frame}", depth * 1e3) } else { "none".into() },
    );
    if let Some(last) = summary.frames.last().filter(|f| f.exempt_segments > 0) {
        let (depth, frame) = worst(|f| f.exempt_penetration_m);
        let (exempt, all) = (last.exempt_segments, last.contact_segments);
        line("exempt", format!("{exempt} of {all} guide segments, {:.4} mm max, frame {frame}", depth * 1e3));
    }
    if summary.frames.iter().any(pinches) {
        let (depth, frame) = worst(|f| f.pinched_penetration_m);
        let segments = summary.frames.iter().map(|f| f.pinched_segments).max().unwrap_or(0);
        let deepest =
            if depth > 0.0 { format!(", {:.4} mm max, frame {frame}", depth * 1e3) } else { String::new() };
        line("pinched", format!("{segments} segments of guides at most{deepest}"));
    }
    if summary.manifest.as_ref().is_some_and(|manifest| manifest.summary.hair.0 > 0) {
        let (depth, frame) = worst(|f| f.hair_penetration_m);
        line(
            "hair in body",
            if depth > 0.0 { format!("{:.4} mm max, frame {frame}", depth * 1e3) } else { "none".into() },
        );
    }
    if summary.frames.iter().any(|f| f.goal_guides > 0) {
        let ((mean, _), (most, frame)) =
            (worst(|f| f.goal_distance_mean_m), worst(|f| f.goal_distance_max_m));
        let guides = summary.frames.iter().map(|f| f.goal_guides).max().unwrap_or(0);
        line(
            "goals",
            format!(
                "{guides} guides at most; {:.3} mm off in the mean, at weight 1 {:.3} mm max, frame {frame}",
                mean * 1e3,
                most * 1e3
            ),
        );
    }
    let (drift, frame) = worst(|f| f.length_drift);
    line("length drift", format!("{drift:.1e} max, frame {frame}"));
    if let Some(manifest) = &summary.manifest {
        scene_rows(manifest).into_iter().for_each(|(name, value)| line(name, value));
    }
    text
}

fn size(Manifest { summary, frames, .. }: &Manifest, out: &Path) -> String {
    let bytes: u64 = frames.iter().map(FrameEntry::bytes).sum();
    format!(
        "{}: {} frames of {} strands and {} guides, {:.1} MB",
        out.display(),
        frames.len(),
        summary.hair.0,
        summary.guides.0,
        bytes as f64 * 1e-6
    )
}

/// Mean time of a frame: to simulate, interpolate and write it.
fn seconds(summary: &BakeSummary) -> [f64; 3] {
    let n = summary.fresh() as f64;
    let mean = |of: fn(&StageSeconds) -> f64| summary.seconds.iter().flatten().map(of).sum::<f64>() / n;
    [mean(|s| s.simulate), mean(|s| s.interpolate), mean(|s| s.write)]
}

fn time(summary: &BakeSummary) -> String {
    let [simulate, interpolate, write] = seconds(summary);
    let preroll = summary.preroll_seconds.map(|s| format!(", plus {s:.1} s pre-roll")).unwrap_or_default();
    let all = simulate + interpolate + write;
    format!(
        "{all:.3} s/frame (simulate {simulate:.3}, interpolate {interpolate:.3}, write {write:.3}){preroll}"
    )
}

/// Peak memory of the process, bytes; `None` on systems other than Linux.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
