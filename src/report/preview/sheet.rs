//! Contact sheets and animations.

use super::options::Options;
use super::renderer::Renderer;
use super::shot::Shot;
use crate::error::Result;
use crate::report::font;
use crate::report::picture::{Animation, AnimationFormat, Image, animation_frame};
use rayon::prelude::*;
use std::io::Write;

/// Gap between the pictures of a sheet, pixels.
const GAP: u32 = 4;

/// Draws a contact sheet of `frames`, each labelled with its number.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`].
pub fn sheet<S: Shot + Sync>(shot: &S, options: &Options, frames: &[i32]) -> Result<Image> {
    let renderer = Renderer::new(shot, options.clone(), frames)?;
    let (width, height) = options.size;
    // As close to a 4:3 page as whole cells allow.
    let n = frames.len() as u32;
    let shape = 4.0 / 3.0 * f64::from(height) / f64::from(width);
    let columns = ((f64::from(n) * shape).sqrt().round() as u32).clamp(1, n);
    let mut page = page(options, columns, n.div_ceil(columns));
    let mut cells = 0..;
    let draw = |frame: i32| Ok(labelled(renderer.render(frame)?, frame, false));
    in_order(frames, draw, |cell| {
        let k: u32 = cells.next().unwrap_or(0);
        place(&mut page, &cell, k % columns, k / columns);
        Ok(())
    })?;
    Ok(page)
}

/// Most frames that are drawn at the same time: each takes some tens of megabytes.
const AT_ONCE: usize = 8;

/// Makes something of each frame, some of them at the same time, and takes it in order.
fn in_order<T: Send>(
    frames: &[i32],
    make: impl Fn(i32) -> Result<T> + Sync,
    mut take: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    for some in frames.chunks((2 * rayon::current_num_threads()).min(AT_ONCE)) {
        let made: Vec<T> = some.par_iter().map(|frame| make(*frame)).collect::<Result<_>>()?;
        made.into_iter().try_for_each(&mut take)?;
    }
    Ok(())
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
        let renderer = Renderer::new(shot, options.clone(), frames)?;
        let mut cells = 0..;
        let draw = |frame: i32| Ok(labelled(renderer.render(frame)?, frame, false));
        in_order(frames, draw, |cell| {
            let column: u32 = cells.next().unwrap_or(0);
            let cell = if column == 0 { labelled(cell, row as i32 + 1, true) } else { cell };
            place(&mut page, &cell, column, row as u32);
            Ok(())
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
    let draw = |frame: i32| animation_frame(format, renderer.render(frame)?);
    in_order(frames, draw, |frame| animation.push(frame))?;
    animation.finish()
}
