//! `hairbake view`: the report of a cache, which plays it, in a browser.

use super::figures::Figures;
use super::{console, summary};
use crate::bake::frame_record::FrameRecord;
use crate::bake::{BakeSummary, StageSeconds};
use crate::cache::{MANIFEST, Manifest, Reader, frame_file_name, write_file};
use crate::error::{Error, Result};
use clap::Args;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

const EXAMPLES: &str = "\
Examples:
  hairbake view out
  hairbake view out --no-open
  hairbake view /read/only/cache -o page.html";

/// `hairbake view` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ViewArguments {
    /// Folder of a cache, which may be unfinished
    cache: PathBuf,
    /// Page to write [default: report.html of the cache, if it is absent, older than the cache, or does not
    /// play]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Print the path of the page without opening it
    #[arg(long)]
    no_open: bool,
}

/// Writes the page if needed, and opens it.
///
/// # Errors
/// Those of [`Reader`]; [`Error::Io`]; [`Error::Config`] if there is no browser.
pub fn run(arguments: &ViewArguments) -> Result<()> {
    let reader = Reader::open(&arguments.cache)?;
    let page = arguments.output.clone().unwrap_or_else(|| arguments.cache.join(summary::PAGE));
    if arguments.output.is_some() || !is_current(&page, &reader) {
        let earlier = Earlier::read(&arguments.cache);
        let (baked, figures) = baked(&reader, &earlier)?;
        let title = earlier.title.unwrap_or_else(|| name(&arguments.cache));
        let text = summary::page(&reader, &baked, &figures, &title)?;
        write_file(&page, &[text]).map_err(elsewhere)?;
        console::wrote(&page);
    }
    console::data(format!("{}\n", page.display()).as_bytes())?;
    if arguments.no_open || !has_display() {
        return Ok(());
    }
    let full = std::path::absolute(&page).map_err(|e| Error::io(&page, e))?;
    open::that_detached(&full)
        .map_err(|e| Error::Config(format!("no browser opens {} ({e}); open it yourself", page.display())))
}

/// The error of a page that cannot be written, with what to do about it.
fn elsewhere(error: Error) -> Error {
    match error {
        Error::Io { path, source } => {
            let what = format!("{source}; -o FILE writes the page elsewhere");
            Error::Io { path, source: std::io::Error::new(source.kind(), what) }
        }
        other => other,
    }
}

/// Whether a page has a view and is no older than the cache.
fn is_current(page: &Path, reader: &Reader) -> bool {
    let written = |path: &Path| std::fs::metadata(path).and_then(|m| m.modified()).ok();
    let Some(page_time) = written(page) else { return false };
    let manifest = written(&reader.dir().join(MANIFEST));
    let frames =
        || reader.frames().iter().filter_map(|f| written(&reader.dir().join(frame_file_name(*f)))).max();
    let cache: Option<SystemTime> = manifest.or_else(frames);
    let plays = || std::fs::read_to_string(page).is_ok_and(|text| text.contains("id=\"view-data\""));
    cache.is_none_or(|cache| page_time >= cache) && plays()
}

/// Whether a browser would have somewhere to draw. Without a display the program of the desktop would start
/// one in the terminal.
fn has_display() -> bool {
    !cfg!(target_os = "linux")
        || ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some())
}

fn name(folder: &Path) -> String {
    let full = std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
    full.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// What an earlier report tells that the cache does not.
#[derive(Default)]
struct Earlier {
    title: Option<String>,
    /// Times of frames.
    seconds: BTreeMap<i32, StageSeconds>,
}

impl Earlier {
    fn read(folder: &Path) -> Self {
        let bytes = std::fs::read(folder.join(summary::DATA)).unwrap_or_default();
        let Ok(data) = serde_json::from_slice::<Value>(&bytes) else { return Earlier::default() };
        let frames: Vec<i32> = serde_json::from_value(data["frames"].clone()).unwrap_or_default();
        let seconds = frames.into_iter().enumerate().filter_map(|(i, frame)| {
            let of = |stage: usize| data["stages"][stage]["values"][i].as_f64();
            Some((frame, StageSeconds { simulate: of(0)?, interpolate: of(1)?, write: of(2)? }))
        });
        Earlier { title: data["title"].as_str().map(str::to_string), seconds: seconds.collect() }
    }
}

/// What the manifest and an earlier report tell of the bake, and the figures that are known of its frames:
/// none of an unfinished cache, and of an older one those that its program recorded.
fn baked(reader: &Reader, earlier: &Earlier) -> Result<(BakeSummary, Figures)> {
    let manifest = if reader.dir().join(MANIFEST).is_file() { Some(reader.read_manifest()?) } else { None };
    let (frames, figures) = match &manifest {
        Some(manifest) => (records(manifest)?, Figures::recorded(manifest)),
        None => {
            let frame = |f: &i32| FrameRecord { frame: *f, ..FrameRecord::default() };
            (reader.frames().iter().map(frame).collect(), Figures::unknown(reader.frames().len()))
        }
    };
    let seconds = frames.iter().map(|f: &FrameRecord| earlier.seconds.get(&f.frame).copied()).collect();
    Ok((BakeSummary { frames, seconds, manifest, ..BakeSummary::default() }, figures))
}

/// The records of the frames, for what they warn of; what an older program did not record warns of nothing.
fn records(manifest: &Manifest) -> Result<Vec<FrameRecord>> {
    let damaged = |e: serde_json::Error| Error::Damaged { path: MANIFEST.into(), what: e.to_string() };
    let record = |entry: &crate::cache::FrameEntry| {
        let plain = FrameRecord { frame: entry.frame, ..FrameRecord::default() };
        let mut value = serde_json::to_value(plain).map_err(damaged)?;
        if let Some(map) = value.as_object_mut() {
            map.extend(entry.figures.clone());
        }
        serde_json::from_value(value).map_err(damaged)
    };
    manifest.frames.iter().map(record).collect()
}
