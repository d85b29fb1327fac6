//! Contact sheets and animations.

use super::options::Options;
use super::renderer::Renderer;
use super::shot::Shot;
use crate::error::Result;
use crate::report::font;
use crate::report::in_order::{in_order, points_of_a_frame};
use crate::report::picture::{Animation, AnimationFormat, Image, animation_frame};
use std::io::Write;

/// Gap between the pictures of a sheet, pixels.
const GAP: u32 = 4;

/// One frame from several sides, in the frame of the head.
#[derive(Debug, Clone, PartialEq)]
pub struct Views {
    /// The frame.
    pub frame: i32,
    /// Azimuth of each view, as of [`Options`].
    pub azimuths_deg: Vec<f64>,
}

/// Draws a contact sheet of `frames`, each labelled with its number; `views` go before them in a row of their
/// own, twice as large.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn sheet<S: Shot + Sync>(
    shot: &S,
    options: &Options,
    views: Option<&Views>,
    frames: &[i32],
) -> Result<Image> {
    options.check()?;
    let n = frames.len() as u32;
    let Some(views) = views else {
        let (width, height) = options.size;
        // As close to a 4:3 page as whole cells allow.
        let shape = 4.0 / 3.0 * f64::from(height) / f64::from(width);
        let columns = ((f64::from(n) * shape).sqrt().round() as u32).clamp(1, n.max(1));
        let mut page = page(options, columns, n.div_ceil(columns));
        draw_cells(shot, options, frames, |k, cell| {
            place(&mut page, options, &cell, k % columns, k / columns)
        })?;
        return Ok(page);
    };
    let columns = 2 * views.azimuths_deg.len() as u32;
    let mut page = page(options, columns, 2 + n.div_ceil(columns.max(1)));
    let large = Options { size: (2 * options.size.0 + GAP, 2 * options.size.1 + GAP), ..options.clone() };
    let renderers = Renderer::views(shot, &large, views.frame, &views.azimuths_deg)?;
    let draw = |renderer: &Renderer<S>| Ok(labelled(renderer.render(views.frame)?, views.frame, false));
    let mut cells = 0..;
    in_order(&renderers, memory(shot, &large), draw, |cell| {
        place(&mut page, options, &cell, 2 * cells.next().unwrap_or(0), 0);
        Ok(())
    })?;
    if n > 0 {
        draw_cells(shot, options, frames, |k, cell| {
            place(&mut page, options, &cell, k % columns, 2 + k / columns)
        })?;
    }
    Ok(page)
}

/// Draws frames, labelled with their numbers, and passes them on with their places in `frames`.
fn draw_cells<S: Shot + Sync>(
    shot: &S,
    options: &Options,
    frames: &[i32],
    mut place: impl FnMut(u32, Image),
) -> Result<()> {
    let renderer = Renderer::new(shot, options.clone(), frames)?;
    let draw = |frame: &i32| Ok(labelled(renderer.render(*frame)?, *frame, false));
    let mut cells = 0..;
    in_order(frames, memory(shot, options), draw, |cell| {
        place(cells.next().unwrap_or(0), cell);
        Ok(())
    })
}

/// Memory per point of a frame that is drawn: itself, its pieces and their ribbons, bytes.
const PER_POINT: usize = 250;
/// Memory per sample of a picture, bytes.
const PER_SAMPLE: usize = 20;
/// Memory per cell of the volume of shadows: extinction, depths, and those of the directions in work, bytes.
const PER_CELL: usize = 160;
/// Memory per texel of the maps of shadows, bytes.
const PER_TEXEL: usize = 4;

/// Memory that a frame takes while it is drawn, bytes.
fn memory<S: Shot>(shot: &S, options: &Options) -> usize {
    let ((width, height), fine) = (options.size, options.supersampling as usize);
    let samples = width as usize * height as usize * fine * fine;
    let sampling = options.quality.sampling();
    let (cells, texels) = (sampling.cells, 3 * sampling.map * sampling.map);
    PER_POINT * points_of_a_frame(shot.header())
        + PER_SAMPLE * samples
        + PER_CELL * cells
        + PER_TEXEL * texels
}

/// Draws a contact sheet of several shots, one row each. Pictures are labelled with the frame number at the
/// bottom; the first of each row also with the row number at the top.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn sheet_of_shots<S: Shot + Sync>(shots: &[(S, Vec<i32>)], options: &Options) -> Result<Image> {
    let columns = shots.iter().map(|(_, frames)| frames.len() as u32).max().unwrap_or(1);
    let mut page = page(options, columns, shots.len() as u32);
    for (row, (shot, frames)) in shots.iter().enumerate() {
        let row = row as u32;
        draw_cells(shot, options, frames, |column, cell| {
            let cell = if column == 0 { labelled(cell, row as i32 + 1, true) } else { cell };
            place(&mut page, options, &cell, column, row);
        })?;
    }
    Ok(page)
}

fn page(options: &Options, columns: u32, rows: u32) -> Image {
    let (width, height) = options.size;
    let mut page = Image::new(columns * (width + GAP) + GAP, rows * (height + GAP) + GAP);
    page.rgb.fill(24);
    page
}

fn place(page: &mut Image, options: &Options, cell: &Image, column: u32, row: u32) {
    let (width, height) = options.size;
    page.paste(cell, GAP + column * (width + GAP), GAP + row * (height + GAP));
}

/// A picture labelled with a number at the bottom left, or at the top left.
fn labelled(mut cell: Image, number: i32, top: bool) -> Image {
    let scale = (cell.height / 200).max(1);
    let bottom = cell.height.saturating_sub((font::HEIGHT as u32 + 5) * scale);
    let y = if top { 5 * scale } else { bottom };
    font::draw_number(&mut cell, number, 6 * scale, y + scale, scale, [30, 32, 36]);
    font::draw_number(&mut cell, number, 5 * scale, y, scale, [245, 245, 245]);
    cell
}

/// Writes `frames` as an animation, each shown for 1/`fps` seconds.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`]; [`crate::Error::Internal`] where `out` fails.
pub fn animate<S: Shot + Sync>(
    shot: &S,
    options: &Options,
    frames: &[i32],
    fps: f64,
    format: AnimationFormat,
    out: impl Write,
) -> Result<()> {
    let renderer = Renderer::new(shot, options.clone(), frames)?;
    let mut animation = Animation::new(out, format, options.size, frames.len() as u32, fps)?;
    let draw = |frame: &i32| animation_frame(format, renderer.render(*frame)?);
    in_order(frames, memory(shot, options), draw, |frame| animation.push(frame))?;
    animation.finish()
}
