//! Contact sheets and animations.

use super::options::Options;
use super::renderer::Renderer;
use super::shot::Shot;
use crate::error::Result;
use crate::report::font;
use crate::report::picture::{Animation, AnimationFormat, Image};
use std::io::Write;

/// Gap between the pictures of a sheet, pixels.
const GAP: u32 = 4;

/// Draws a contact sheet of `frames`, each labelled with its number.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn sheet(shot: &impl Shot, options: &Options, frames: &[i32]) -> Result<Image> {
    let renderer = Renderer::new(shot, options.clone(), frames)?;
    let (width, height) = options.size;
    // As close to a 4:3 page as whole cells allow.
    let n = frames.len() as u32;
    let shape = 4.0 / 3.0 * f64::from(height) / f64::from(width);
    let columns = ((f64::from(n) * shape).sqrt().round() as u32).clamp(1, n);
    let mut page = page(options, columns, n.div_ceil(columns));
    for (k, frame) in frames.iter().enumerate() {
        let cell = labelled(renderer.render(*frame)?, *frame, false);
        place(&mut page, &cell, k as u32 % columns, k as u32 / columns);
    }
    Ok(page)
}

/// Draws a contact sheet of several shots, one row each. Pictures are labelled with the frame number at the
/// bottom; the first of each row also with the row number at the top.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn sheet_of_shots<S: Shot>(shots: &[(S, Vec<i32>)], options: &Options) -> Result<Image> {
    let columns = shots.iter().map(|(_, frames)| frames.len() as u32).max().unwrap_or(1);
    let mut page = page(options, columns, shots.len() as u32);
    for (row, (shot, frames)) in shots.iter().enumerate() {
        let renderer = Renderer::new(shot, options.clone(), frames)?;
        for (column, frame) in frames.iter().enumerate() {
            let cell = labelled(renderer.render(*frame)?, *frame, false);
            let cell = if column == 0 { labelled(cell, row as i32 + 1, true) } else { cell };
            place(&mut page, &cell, column as u32, row as u32);
        }
    }
    Ok(page)
}

fn page(options: &Options, columns: u32, rows: u32) -> Image {
    let (width, height) = options.size;
    let mut page = Image::new(columns * (width + GAP) + GAP, rows * (height + GAP) + GAP);
    page.rgb.fill(24);
    page
}

fn place(page: &mut Image, cell: &Image, column: u32, row: u32) {
    page.paste(cell, GAP + column * (cell.width + GAP), GAP + row * (cell.height + GAP));
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
pub fn animate(
    shot: &impl Shot,
    options: &Options,
    frames: &[i32],
    fps: f64,
    format: AnimationFormat,
    out: impl Write,
) -> Result<()> {
    let renderer = Renderer::new(shot, options.clone(), frames)?;
    let mut animation = Animation::new(out, format, options.size, frames.len() as u32, fps)?;
    for frame in frames {
        animation.push(&renderer.render(*frame)?)?;
    }
    animation.finish()
}
