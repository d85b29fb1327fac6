//! Animations of `hairbake preview`, those made by ffmpeg among them.

use super::console;
use crate::cache::{Reader, write_file};
use crate::error::{Error, Result};
use crate::report::picture::AnimationFormat;
use crate::report::preview::{self, Options, Quality};
use std::io::{self, BufWriter, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// The program that makes films.
const FFMPEG: &str = "ffmpeg";

/// Samples per pixel in each direction: fewer than on a sheet, for pictures that are seen for a moment.
const SUPERSAMPLING: u32 = 2;

/// Bits per pixel of a film: enough for single hairs.
const BITS: f64 = 0.4;

/// An animation to write.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    /// Its file.
    pub path: PathBuf,
    /// Its format.
    pub format: FilmFormat,
}

/// File format of an animation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilmFormat {
    /// Written by this program.
    Pictures(AnimationFormat),
    /// Written by ffmpeg.
    Mp4,
}

impl FilmFormat {
    /// That of a file whose name can only be an animation's.
    pub fn of(path: &Path) -> Option<Self> {
        match Film::ending(path)?.as_str() {
            "mp4" => Some(FilmFormat::Mp4),
            "gif" => Some(FilmFormat::Pictures(AnimationFormat::Gif)),
            "apng" => Some(FilmFormat::Pictures(AnimationFormat::Apng)),
            _ => None,
        }
    }
}

impl Film {
    /// The ending of a file's name, in lower case.
    pub fn ending(path: &Path) -> Option<String> {
        Some(path.extension()?.to_str()?.to_ascii_lowercase())
    }

    /// Draws `frames` and writes them.
    ///
    /// # Errors
    /// Those of [`preview::animate`]; [`Error::Io`]; [`Error::Config`] if ffmpeg is missing or fails.
    pub fn write(&self, reader: &Reader, options: &Options, frames: &[i32]) -> Result<()> {
        let options = match options.quality {
            Quality::Quick => Options { supersampling: SUPERSAMPLING, ..options.clone() },
            Quality::Beauty => options.clone(),
        };
        let draw = |format, out: &mut dyn io::Write| {
            preview::animate(reader, &options, frames, reader.header().fps, format, out)
        };
        match self.format {
            FilmFormat::Pictures(format) => {
                let mut bytes = Vec::new();
                draw(format, &mut bytes)?;
                write_file(&self.path, &[bytes])?;
                console::wrote(&self.path);
                Ok(())
            }
            FilmFormat::Mp4 => {
                let folder = tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), e))?;
                let made = folder.path().join("film.mp4");
                match ffmpeg(&made, options.size, reader.header().fps) {
                    Ok(child) => self.finish(child, &made, |out| draw(AnimationFormat::Pixels, out)),
                    Err(error) if error.kind() == io::ErrorKind::NotFound => Err(Error::Config(format!(
                        "there is no {FFMPEG} on the path, which {} needs; a .gif does without",
                        self.path.display()
                    ))),
                    Err(error) => Err(Error::io(FFMPEG, error)),
                }
            }
        }
    }

    /// Sends the pixels that `draw` writes to ffmpeg, and takes the film that it `made`.
    fn finish(
        &self,
        mut child: Child,
        made: &Path,
        draw: impl FnOnce(&mut dyn io::Write) -> Result<()>,
    ) -> Result<()> {
        let drawn = child.stdin.take().map_or(Ok(()), |input| draw(&mut BufWriter::new(input)));
        let mut messages = String::new();
        let read = child.stderr.take().map_or(Ok(0), |mut from| from.read_to_string(&mut messages));
        let status =
            child.wait().and_then(|status| read.map(|_| status)).map_err(|e| Error::io(FFMPEG, e))?;
        if !status.success() {
            let last = messages.lines().last().unwrap_or("no message");
            return Err(Error::Config(format!("{FFMPEG} made no {}: {last}", self.path.display())));
        }
        drawn?;
        let bytes = std::fs::read(made).map_err(|e| Error::io(made, e))?;
        write_file(&self.path, &[bytes])?;
        console::wrote(&self.path);
        Ok(())
    }
}

/// Starts ffmpeg, which makes the film `made` of the pixels on its standard input.
fn ffmpeg(made: &Path, (width, height): (u32, u32), fps: f64) -> io::Result<Child> {
    Command::new(FFMPEG)
        .args(["-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"])
        .args(["-s", &format!("{width}x{height}"), "-r", &fps.to_string(), "-i", "-"])
        // Most players want a quarter of the colours, and for that even sides.
        .args(["-b:v", &format!("{:.0}", BITS * f64::from(width) * f64::from(height) * fps)])
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-movflags", "+faststart"])
        .arg(made)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
}
