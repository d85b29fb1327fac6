//! `hairbake preview`.

use super::film::{Film, FilmFormat};
use super::frame_list::frame_range;
use super::{console, values};
use crate::cache::{Reader, write_file};
use crate::error::{Error, Result};
use crate::report::picture::AnimationFormat;
use crate::report::preview::{self, Colours, CurveSelection, Follow, Options, spread};
use clap::{ArgGroup, Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Default number of pictures on a contact sheet.
pub const PICTURES: usize = 12;

const EXAMPLES: &str = "\
Examples:
  hairbake preview out -o sheet.png
  hairbake preview out -o back.png --frames 1020-1030 --pictures 4 --azimuth 150
  hairbake preview out --animate shot.gif --size 320 --follow head
  hairbake preview out -o shot.mp4
  hairbake preview out -o guides.png --curves guides";

const CAMERA: &str = "Camera";

/// `hairbake preview` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, group(ArgGroup::new("written").required(true).multiple(true).args(["output", "animate"])))]
pub struct PreviewArguments {
    /// Folder of a cache, which may be unfinished
    ///
    /// With several caches, such as the wedges of a sweep, the contact sheet has one row per cache.
    #[arg(required = true, value_name = "CACHE")]
    caches: Vec<PathBuf>,
    /// Contact sheet to write (PNG), or an animation if the name ends in .mp4, .gif or .apng
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Animation to write: .mp4, .gif (256 colours), .apng or .png (all colours)
    ///
    /// MP4 needs ffmpeg on the path.
    #[arg(long, value_name = "FILE", value_parser = film)]
    animate: Option<Film>,
    /// Frames to draw, such as 1020-1030 [default: all of the shot]
    #[arg(long, value_name = "A-B", value_parser = frame_range, allow_hyphen_values = true)]
    frames: Option<(i32, i32)>,
    /// Number of pictures on the contact sheet
    ///
    /// They are spread evenly over the frames.
    #[arg(long, value_name = "N", default_value_t = PICTURES as u32, value_parser = clap::value_parser!(u32).range(1..=400))]
    pictures: u32,
    /// Size of one picture in pixels: one number for a square, or WIDTHxHEIGHT
    #[arg(long, value_name = "SIZE", default_value = "480", value_parser = values::size)]
    size: (u32, u32),
    /// Curves to draw [default: hair if the cache has it, else guides]
    #[arg(long, value_enum, value_name = "NAME")]
    curves: Option<CurvesName>,
    /// Meaning of the colours
    #[arg(long, value_enum, value_name = "NAME", alias = "color", default_value = "hair")]
    colour: ColourName,
    /// Scale factor for the drawn widths
    ///
    /// Raise it if few strands represent a whole head of hair.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = values::positive)]
    width_scale: f64,
    /// Do not draw the head and other colliders
    #[arg(long)]
    no_colliders: bool,
    /// What the camera follows
    #[arg(long, value_enum, value_name = "NAME", default_value = "position", help_heading = CAMERA)]
    follow: FollowName,
    /// Direction of the viewer, in degrees from the front towards the subject's left; 180 is behind
    #[arg(long, value_name = "DEGREES", default_value_t = 35.0, value_parser = values::angle, allow_hyphen_values = true, help_heading = CAMERA)]
    azimuth: f64,
    /// Elevation of the viewer, in degrees above the horizon
    #[arg(long, value_name = "DEGREES", default_value_t = 8.0, value_parser = values::angle, allow_hyphen_values = true, help_heading = CAMERA)]
    elevation: f64,
    /// Vertical field of view, in degrees
    ///
    /// Raising it exaggerates depth.
    #[arg(long, value_name = "DEGREES", default_value_t = 24.0, help_heading = CAMERA)]
    fov: f64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum CurvesName {
    /// Render strands
    Hair,
    /// Guides, coloured by group
    Guides,
    /// Guides among thinned render strands
    Both,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ColourName {
    /// Natural colours for hair, one colour per group for guides
    Hair,
    /// Wisp level that moves each curve: blue is a coarse wisp, warmer colours are finer
    Level,
    /// Density: green as the densest hair of the groom, yellow 1.5 times, red twice as dense; blue is loose
    /// hair
    Crowding,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FollowName {
    /// Position of the head, so that its turns show
    Position,
    /// Position and orientation of the head, which then stands still
    Head,
    /// Nothing; the whole motion fits the picture
    World,
}

fn film(text: &str) -> std::result::Result<Film, String> {
    let path = PathBuf::from(text);
    let format = match Film::ending(&path).as_deref() {
        Some("png") => Some(FilmFormat::Pictures(AnimationFormat::Apng)),
        _ => FilmFormat::of(&path),
    };
    let format = format.ok_or("expected a name that ends in .mp4, .gif, .apng or .png")?;
    Ok(Film { path, format })
}

/// Draws the contact sheet and the animation.
pub fn run(arguments: &PreviewArguments) -> Result<()> {
    let options = arguments.options();
    let shots: Vec<(Reader, Vec<i32>)> =
        arguments.caches.iter().map(|cache| arguments.shot(cache)).collect::<Result<_>>()?;
    let (sheet, films) = arguments.outputs();
    let [(reader, frames)] = &shots[..] else { return arguments.draw_sweep(shots, &options) };
    if let Some(path) = sheet {
        write(path, preview::sheet(reader, &options, &arguments.select(frames))?.to_png()?)?;
    }
    films.iter().try_for_each(|film| film.write(reader, &options, frames))
}

fn write(path: &Path, bytes: Vec<u8>) -> Result<()> {
    write_file(path, &[bytes])?;
    console::wrote(path);
    Ok(())
}

impl PreviewArguments {
    /// Opens a cache; returns it with its frames to draw.
    fn shot(&self, cache: &Path) -> Result<(Reader, Vec<i32>)> {
        let reader = Reader::open(cache)?;
        let (first, last) = self.frames.unwrap_or(reader.header().frames);
        let frames: Vec<i32> =
            reader.frames().iter().copied().filter(|frame| (first..=last).contains(frame)).collect();
        if frames.is_empty() || self.frames.is_some_and(|(a, b)| !frames.contains(&a) || !frames.contains(&b))
        {
            let all = reader.frames();
            let range = all.first().zip(all.last()).map_or("none".into(), |(a, b)| format!("{a} to {b}"));
            return Err(Error::Usage(format!(
                "{} does not have all frames from {first} to {last}; available: {range}",
                cache.display()
            )));
        }
        Ok((reader, frames))
    }

    /// The contact sheet and the animations to write.
    fn outputs(&self) -> (Option<&Path>, Vec<Film>) {
        let output = self.output.as_deref();
        let as_film = output.and_then(|path| Some(Film { path: path.into(), format: FilmFormat::of(path)? }));
        let sheet = output.filter(|_| as_film.is_none());
        (sheet, as_film.into_iter().chain(self.animate.clone()).collect())
    }

    /// The frames for the contact sheet.
    fn select(&self, frames: &[i32]) -> Vec<i32> {
        let selected = spread((0, frames.len() as i32 - 1), self.pictures as usize);
        selected.into_iter().map(|i| frames[i as usize]).collect()
    }

    /// Draws a contact sheet of several caches.
    fn draw_sweep(&self, shots: Vec<(Reader, Vec<i32>)>, options: &Options) -> Result<()> {
        let (sheet, films) = self.outputs();
        let (Some(path), true) = (sheet, films.is_empty()) else {
            let message = "several caches need -o FILE for a sheet; an animation takes one cache";
            return Err(Error::Usage(message.into()));
        };
        for (i, cache) in self.caches.iter().enumerate() {
            console::say(&format!("row {}: {}", i + 1, cache.display()));
        }
        let shots: Vec<_> =
            shots.into_iter().map(|(reader, frames)| (reader, self.select(&frames))).collect();
        write(path, preview::sheet_of_shots(&shots, options)?.to_png()?)
    }

    fn options(&self) -> Options {
        Options {
            size: self.size,
            curves: self.curves.map(|curves| match curves {
                CurvesName::Hair => CurveSelection::Hair,
                CurvesName::Guides => CurveSelection::Guides,
                CurvesName::Both => CurveSelection::Both,
            }),
            colours: match self.colour {
                ColourName::Hair => Colours::Hair,
                ColourName::Level => Colours::Level,
                ColourName::Crowding => Colours::Crowding,
            },
            width_scale: self.width_scale,
            colliders: !self.no_colliders,
            follow: match self.follow {
                FollowName::Position => Follow::Position,
                FollowName::Head => Follow::Head,
                FollowName::World => Follow::World,
            },
            azimuth_deg: self.azimuth,
            elevation_deg: self.elevation,
            fov_deg: self.fov,
            ..Options::default()
        }
    }
}
