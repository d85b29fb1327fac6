//! `hairbake read`: what a cache holds, and its arrays as files of NumPy.

use super::console;
use super::frame_list::{FrameList, frame_list};
use super::output_file;
use crate::cache::array::{Array, CURVES, FIXED, HEAD, MOVING};
use crate::cache::{Basis, CurveSet, Header, Reader};
use crate::error::{Error, Result};
use clap::Args;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::PathBuf;
use tempfile::NamedTempFile;

const EXAMPLES: &str = "\
Examples:
  hairbake read out
  hairbake read out hair.points --frames 1010-1020 -o points.npy
  hairbake read out guides.velocities | python -c 'import sys, numpy as np; print(np.load(sys.stdin.buffer).shape)'

Arrays:
  hair.points, hair.velocities, hair.accelerations, hair.levels, head: frames first
  guides.normals, guides.clamp_forces, guides.clamp_moments, guides.tie_forces,
  guides.tie_moments: frames first
  hair.counts, hair.rest, hair.widths, hair.ids, hair.groups, hair.guide, hair.root_uv,
  hair.closest_guides, hair.guide_weights: do not move
  The same of guides, such as guides.points; guides.arc, guides.tie_guides, guides.tie_numbers.";

/// `hairbake read` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ReadArguments {
    /// Folder of a cache, which may be unfinished
    cache: PathBuf,
    /// Array to write, such as hair.points [default: JSON that says what the cache holds]
    array: Option<String>,
    /// Frames of an array that moves: frame numbers and ranges, such as 1001-1100 or 1001,1050-1060 [default:
    /// all]
    #[arg(long, value_name = "FRAMES", value_parser = frame_list, allow_hyphen_values = true, requires = "array")]
    frames: Option<FrameList>,
    /// File to write (.npy) [default: standard output]
    #[arg(long, short, value_name = "FILE", requires = "array")]
    output: Option<PathBuf>,
}

/// Describes a cache or writes one of its arrays.
///
/// # Errors
/// [`Error::Usage`] if the cache has no such array or frame; those of [`Reader`].
pub fn run(arguments: &ReadArguments) -> Result<()> {
    let reader = Reader::open(&arguments.cache)?;
    let Some(name) = &arguments.array else {
        return console::data(format!("{:#}\n", describe(&reader)?).as_bytes());
    };
    match &arguments.output {
        Some(path) => {
            output_file::create_folder(path)?;
            let fail = |e: io::Error| Error::io(path, e);
            let mut file = BufWriter::new(NamedTempFile::new_in(output_file::folder(path)).map_err(fail)?);
            write_array(&reader, name, arguments.frames.as_ref(), &mut |bytes| {
                file.write_all(bytes).map_err(fail)
            })?;
            let file = file.into_inner().map_err(|e| fail(e.into_error()))?;
            file.persist(path).map_err(|e| fail(e.error))?;
            console::wrote(path);
            Ok(())
        }
        None if io::stdout().is_terminal() => {
            Err(Error::Usage("an array is no text: pipe it to a program, or name a file with -o".into()))
        }
        None => write_array(&reader, name, arguments.frames.as_ref(), &mut console::data),
    }
}

/// Passes the parts of the file of the array `name` to `write`.
fn write_array(
    reader: &Reader,
    name: &str,
    frames: Option<&FrameList>,
    write: &mut dyn FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    if let Some(array) = Array::fixed(reader.header(), name) {
        if frames.is_some() {
            return Err(Error::Usage(format!("{name} does not move: leave out --frames")));
        }
        write(&array.npy_header(None))?;
        return write(&array.bytes());
    }
    let frames = frames.map_or(reader.frames(), |list| &list.frames);
    if let Some(missing) = frames.iter().find(|frame| !reader.frames().contains(frame)) {
        return Err(Error::Usage(format!(
            "the cache has no frame {missing}: it has {}",
            ranges(reader.frames())
        )));
    }
    for &frame in frames {
        let Some(array) = Array::moving(&reader.read_frame(frame)?, name) else {
            let known = names(reader)?.join(", ");
            return Err(Error::Usage(format!("the cache has no array {name}: it has {known}")));
        };
        if frame == frames[0] {
            write(&array.npy_header(Some(frames.len())))?;
        }
        write(&array.bytes())?;
    }
    Ok(())
}

/// The frames as text, in ranges.
fn ranges(frames: &[i32]) -> String {
    let range = |run: &[i32]| match run {
        [one] => one.to_string(),
        run => format!("{}-{}", run[0], run[run.len() - 1]),
    };
    let runs = frames.chunk_by(|a, b| a + 1 == *b).map(range);
    runs.collect::<Vec<_>>().join(", ")
}

/// The names of the arrays of a cache.
fn names(reader: &Reader) -> Result<Vec<String>> {
    let of = |arrays: &[(&str, &str)]| -> Vec<String> {
        CURVES.iter().flat_map(|set| arrays.iter().map(move |(name, _)| format!("{set}.{name}"))).collect()
    };
    let mut names = of(&FIXED);
    names.retain(|name| Array::fixed(reader.header(), name).is_some());
    if let Some(&first) = reader.frames().first() {
        let frame = reader.read_frame(first)?;
        names.extend(of(&MOVING).into_iter().filter(|name| Array::moving(&frame, name).is_some()));
        names.push(HEAD.0.into());
    }
    Ok(names)
}

/// What a cache holds.
fn describe(reader: &Reader) -> Result<Value> {
    let header: &Header = reader.header();
    let curves = |set: &CurveSet| json!({ "curves": set.counts.len(), "points": set.rest.len() });
    Ok(json!({
        "metres_per_unit": header.metres_per_unit,
        "up_axis": if header.z_up { "Z" } else { "Y" },
        "fps": header.fps,
        "basis": match header.basis {
            Basis::CatmullRom => "catmullRom",
            Basis::Bspline => "bspline",
        },
        "shot": header.frames,
        "frames": reader.frames(),
        "hair": header.hair.as_ref().map(curves),
        "guides": (!header.guides.counts.is_empty()).then(|| curves(&header.guides)),
        "groups": groups(header.hair.as_ref().unwrap_or(&header.guides)),
        "colliders": header.colliders.iter().map(|c| &c.name).collect::<Vec<_>>(),
        "arrays": names(reader)?,
    }))
}

/// Names of the groups, by their number.
fn groups(set: &CurveSet) -> BTreeMap<i32, &str> {
    set.group.iter().copied().zip(set.group_name.iter().map(String::as_str)).collect()
}
