//! `hairbake preview`.

use super::{console, values};
use crate::cache::{Reader, write_file};
use crate::error::{Error, Result};
use crate::report::picture::Format;
use crate::report::preview::{self, Curves, Follow, Options, spread};
use clap::{ArgGroup, Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Pictures on a contact sheet unless asked otherwise.
pub const PICTURES: usize = 12;

const EXAMPLES: &str = "\
Examples:
  hairbake preview out -o sheet.png
  hairbake preview out -o back.png --frames 1020-1030 --pictures 4 --azimuth 150
  hairbake preview out --animate shot.gif --size 320 --follow head
  hairbake preview out -o guides.png --curves guides";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, group(ArgGroup::new("made").required(true).multiple(true).args(["output", "animate"])))]
pub struct PreviewArguments {
    /// Folder of the cache; an unfinished one will do. Of several, such as the wedges of a sweep, the sheet has a row each
    #[arg(required = true)]
    caches: Vec<PathBuf>,
    /// Contact sheet to write, PNG
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Animation to write: GIF, which every viewer shows in 256 colours, or PNG (APNG), for browsers, in all colours
    #[arg(long, value_name = "FILE", value_parser = animation)]
    animate: Option<(PathBuf, Format)>,
    /// Frames to draw [default: all of the shot]
    #[arg(long, value_name = "A-B", value_parser = values::frames, allow_hyphen_values = true)]
    frames: Option<(i32, i32)>,
    /// Pictures on the sheet, spread evenly over the frames
    #[arg(long, value_name = "N", default_value_t = PICTURES as u32, value_parser = clap::value_parser!(u32).range(1..=400))]
    pictures: u32,
    /// Size of one picture, pixels
    #[arg(long, value_name = "WxH", default_value = "480", value_parser = values::size)]
    size: (u32, u32),
    /// What is drawn [default: hair where the cache has it, else guides]
    #[arg(long, value_enum, value_name = "WHAT")]
    curves: Option<CurvesName>,
    /// What colours tell: of an adaptive bake, blue is hair that moves with a coarse wisp, and the warmer the finer what came away from it
    #[arg(long, value_enum, value_name = "WHAT", default_value = "hair")]
    colour: ColourName,
    /// Factor on the drawn widths: raise it where few strands stand for a whole head of hair
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = values::positive)]
    width_scale: f64,
    /// Leave the head and other colliders out
    #[arg(long)]
    no_colliders: bool,
    /// What the camera moves with
    #[arg(long, value_enum, value_name = "WHAT", default_value = "position", help_heading = "Camera")]
    follow: FollowName,
    /// Where the viewer stands, degrees from the front to the subject's left; 180 is behind
    #[arg(long, value_name = "DEG", default_value_t = 35.0, value_parser = values::angle, allow_hyphen_values = true, help_heading = "Camera")]
    azimuth: f64,
    /// How high the viewer stands, degrees above the horizon
    #[arg(long, value_name = "DEG", default_value_t = 8.0, value_parser = values::angle, allow_hyphen_values = true, help_heading = "Camera")]
    elevation: f64,
    /// Angle of view from bottom to top, degrees: smaller is flatter, larger exaggerates depth
    #[arg(long, value_name = "DEG", default_value_t = 24.0, help_heading = "Camera")]
    fov: f64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum CurvesName {
    /// Render strands
    Hair,
    /// Guides, coloured by group
    Guides,
    /// Guides amid thinned strands
    Both,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ColourName {
    /// Hair as it is, guides by group
    Hair,
    /// The level of the wisp that moves each curve
    Level,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FollowName {
    /// The head's place: its turns stay readable
    Position,
    /// The head's place and turn: the head stands still
    Head,
    /// Nothing: the whole way fits the picture
    World,
}

fn animation(text: &str) -> std::result::Result<(PathBuf, Format), String> {
    let path = PathBuf::from(text);
    let format = match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("gif") => Format::Gif,
        Some("png" | "apng") => Format::Apng,
        _ => return Err("a name that ends in .gif, .png or .apng".into()),
    };
    Ok((path, format))
}

/// Draws the pictures asked for.
pub fn run(arguments: &PreviewArguments) -> Result<()> {
    let options = arguments.options();
    let shots: Vec<(Reader, Vec<i32>)> =
        arguments.caches.iter().map(|cache| arguments.shot(cache)).collect::<Result<_>>()?;
    let [(reader, frames)] = &shots[..] else { return arguments.sweep(shots, &options) };
    if let Some(path) = &arguments.output {
        write(path, preview::sheet(reader, &options, &arguments.chosen(frames))?.to_png()?)?;
    }
    if let Some((path, format)) = &arguments.animate {
        let mut bytes = Vec::new();
        preview::animate(reader, &options, frames, reader.header().fps, *format, &mut bytes)?;
        write(path, bytes)?;
    }
    Ok(())
}

fn write(path: &Path, bytes: Vec<u8>) -> Result<()> {
    write_file(path, &[bytes])?;
    console::say(&format!("written: {}", path.display()));
    Ok(())
}

impl PreviewArguments {
    /// A cache and its frames that are asked for.
    fn shot(&self, cache: &Path) -> Result<(Reader, Vec<i32>)> {
        let reader = Reader::open(cache)?;
        let (shot, asked) = (reader.header().frames, self.frames);
        let (first, last) = asked.unwrap_or(shot);
        let frames: Vec<i32> =
            reader.frames().iter().copied().filter(|frame| (first..=last).contains(frame)).collect();
        if frames.is_empty() || asked.is_some_and(|(a, b)| !frames.contains(&a) || !frames.contains(&b)) {
            let there = reader.frames();
            let range = there.first().zip(there.last()).map_or("none".into(), |(a, b)| format!("{a} to {b}"));
            return Err(Error::Usage(format!(
                "frames {first} to {last} are not all in {}: there are {range}",
                cache.display()
            )));
        }
        Ok((reader, frames))
    }

    /// The frames for the sheet.
    fn chosen(&self, frames: &[i32]) -> Vec<i32> {
        let chosen = spread((0, frames.len() as i32 - 1), self.pictures as usize);
        chosen.into_iter().map(|i| frames[i as usize]).collect()
    }

    /// A sheet of several caches.
    fn sweep(&self, shots: Vec<(Reader, Vec<i32>)>, options: &Options) -> Result<()> {
        let (Some(path), None) = (&self.output, &self.animate) else {
            return Err(Error::Usage(
                "of several caches there is a sheet only: -o FILE, no --animate".into(),
            ));
        };
        for (i, cache) in self.caches.iter().enumerate() {
            console::say(&format!("row {}: {}", i + 1, cache.display()));
        }
        let shots: Vec<_> =
            shots.into_iter().map(|(reader, frames)| (reader, self.chosen(&frames))).collect();
        write(path, preview::sheet_of_shots(&shots, options)?.to_png()?)
    }

    fn options(&self) -> Options {
        Options {
            size: self.size,
            curves: self.curves.map(|curves| match curves {
                CurvesName::Hair => Curves::Hair,
                CurvesName::Guides => Curves::Guides,
                CurvesName::Both => Curves::Both,
            }),
            levels: self.colour == ColourName::Level,
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
