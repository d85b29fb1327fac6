//! `hairbake preview`.

use super::film::{Film, FilmFormat};
use super::frame_list::frame_range;
use super::{console, values};
use crate::cache::{Reader, write_file};
use crate::error::{Error, Result};
use crate::report::Image;
use crate::report::picture::AnimationFormat;
use crate::report::preview::{self, Colours, CurveSelection, Follow, Options, Quality, Views, spread};
use clap::{ArgGroup, Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Default number of frames on a contact sheet.
pub const PICTURES: usize = 12;

/// Default azimuths of the large views: from the front, three quarters, and from behind at the side, degrees.
const VIEWS: [f64; 3] = [0.0, 40.0, 145.0];
/// Default sides of a picture: alone, below views, and both with [`Quality::Beauty`], pixels.
const SIDE: u32 = 480;
const SIDE_BELOW_VIEWS: u32 = 320;
const SIDE_BEAUTY: u32 = 1200;
const SIDE_BEAUTY_BELOW_VIEWS: u32 = 480;
/// Samples per pixel in each direction with [`Quality::Beauty`].
const BEAUTY_SAMPLES: u32 = 5;

const EXAMPLES: &str = "\
Examples:
  hairbake preview out -o sheet.png
  hairbake preview out -o back.png --frames 1020-1030 --pictures 4 --azimuth 150
  hairbake preview out -o beauty.png --beauty
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
    /// Number of frames on the contact sheet [default: 12; none with --beauty]
    ///
    /// They are spread evenly over the frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=400))]
    pictures: Option<u32>,
    /// Views of the first frame in a row above, twice as large, as azimuths [default: 0,40,145; none with
    /// --pictures, --azimuth or several caches]
    ///
    /// They are seen from in front of the head, however it is turned, and upright.
    #[arg(long, value_name = "DEGREES", value_delimiter = ',', value_parser = values::angle, allow_hyphen_values = true)]
    views: Option<Vec<f64>>,
    /// Size of one picture in pixels: one number for a square, or WIDTHxHEIGHT [default: 480, or 320 below
    /// views; with --beauty 1200, or 480]
    #[arg(long, value_name = "SIZE", value_parser = values::size)]
    size: Option<(u32, u32)>,
    /// Take more time for light and samples: soft shadows, finer hair, large pictures
    ///
    /// It may take a minute. By default it draws the views alone.
    #[arg(long)]
    beauty: bool,
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
    ///
    /// The default is 35.
    #[arg(long, value_name = "DEGREES", value_parser = values::angle, allow_hyphen_values = true, help_heading = CAMERA)]
    azimuth: Option<f64>,
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

/// Draws the contact sheet of a bake: views of its first frame, and frames spread over the shot.
///
/// # Errors
/// Those of [`preview::sheet`].
pub fn overview(reader: &Reader) -> Result<Image> {
    let options = Options { size: (SIDE_BELOW_VIEWS, SIDE_BELOW_VIEWS), ..Options::default() };
    let frames = spread(reader.header().frames, PICTURES);
    let views = Views { frame: frames[0], azimuths_deg: VIEWS.to_vec() };
    preview::sheet(reader, &options, Some(&views), &frames)
}

/// Draws the contact sheet and the animation.
pub fn run(arguments: &PreviewArguments) -> Result<()> {
    let shots: Vec<(Reader, Vec<i32>)> =
        arguments.caches.iter().map(|cache| arguments.shot(cache)).collect::<Result<_>>()?;
    let (sheet, films) = arguments.outputs();
    let [(reader, frames)] = &shots[..] else { return arguments.draw_sweep(shots) };
    if let Some(path) = sheet {
        let views = arguments.views().map(|azimuths_deg| Views { frame: frames[0], azimuths_deg });
        let options = arguments.options(views.is_some());
        let selected = arguments.select(frames, views.is_some());
        write(path, preview::sheet(reader, &options, views.as_ref(), &selected)?.to_png()?)?;
    }
    films.iter().try_for_each(|film| film.write(reader, &arguments.options(false), frames))
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

    /// The azimuths of the views of the first frame.
    fn views(&self) -> Option<Vec<f64>> {
        let frames_alone = self.pictures.is_some() || self.azimuth.is_some() || self.caches.len() > 1;
        self.views.clone().or_else(|| (!frames_alone).then(|| VIEWS.to_vec()))
    }

    /// The frames for the contact sheet.
    fn select(&self, frames: &[i32], below_views: bool) -> Vec<i32> {
        let default = if self.beauty && below_views { 0 } else { PICTURES };
        let count = self.pictures.map_or(default, |n| n as usize);
        let selected = spread((0, frames.len() as i32 - 1), count);
        selected.into_iter().map(|i| frames[i as usize]).collect()
    }

    /// Draws a contact sheet of several caches.
    fn draw_sweep(&self, shots: Vec<(Reader, Vec<i32>)>) -> Result<()> {
        let (sheet, films) = self.outputs();
        let (Some(path), true, None) = (sheet, films.is_empty(), &self.views) else {
            let message = "several caches need -o FILE for a sheet; an animation and views take one cache";
            return Err(Error::Usage(message.into()));
        };
        for (i, cache) in self.caches.iter().enumerate() {
            console::say(&format!("row {}: {}", i + 1, cache.display()));
        }
        let shots: Vec<_> =
            shots.into_iter().map(|(reader, frames)| (reader, self.select(&frames, false))).collect();
        write(path, preview::sheet_of_shots(&shots, &self.options(false))?.to_png()?)
    }

    fn options(&self, below_views: bool) -> Options {
        let side = match (self.beauty, below_views) {
            (false, false) => SIDE,
            (false, true) => SIDE_BELOW_VIEWS,
            (true, false) => SIDE_BEAUTY,
            (true, true) => SIDE_BEAUTY_BELOW_VIEWS,
        };
        let default = Options::default();
        Options {
            size: self.size.unwrap_or((side, side)),
            supersampling: if self.beauty { BEAUTY_SAMPLES } else { default.supersampling },
            quality: if self.beauty { Quality::Beauty } else { Quality::Quick },
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
            azimuth_deg: self.azimuth.unwrap_or(default.azimuth_deg),
            elevation_deg: self.elevation,
            fov_deg: self.fov,
        }
    }
}
