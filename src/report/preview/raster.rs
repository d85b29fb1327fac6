//! Rasteriser for shaded triangles and thin ribbons.
//!
//! The picture is supersampled and averaged. Triangles use a depth buffer. Ribbons are blended from far to
//! near with their exact coverage of each fine pixel, so that a strand far thinner than a pixel neither
//! breaks up nor widens.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::camera::Projected;
use super::light::Rgb;
use crate::report::picture::Image;

/// A short straight piece of a strand, in fine pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ribbon {
    /// Its two ends.
    pub ends: [Projected; 2],
    /// Width in fine pixels.
    pub width: f32,
    /// Linear colour.
    pub colour: Rgb,
}

/// A triangle, in fine pixels, with a linear colour at each corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Corners.
    pub corners: [Projected; 3],
    /// Colours at the corners.
    pub colours: [Rgb; 3],
}

/// Rows of final pixels per task.
const BAND: usize = 16;

/// A band of fine rows.
struct Band<'a> {
    /// First fine row.
    top: usize,
    width: usize,
    colour: &'a mut [Rgb],
    inverse_depth: &'a mut [f32],
}

/// Draws a picture of `size` final pixels, supersampled `fine` times in each direction, over `background`
/// (linear colour at a position in fractions of the picture). The picture does not depend on the number of
/// threads.
pub fn draw(
    size: (u32, u32),
    fine: u32,
    background: impl Fn(f32, f32) -> Rgb + Sync,
    triangles: &[Triangle],
    ribbons: &[Ribbon],
) -> Image {
    let (width, fine) = (size.0 as usize, fine as usize);
    let fine_height = size.1 as usize * fine;
    let rows = BAND * fine;
    let bands = (size.1 as usize).div_ceil(BAND);
    let by_band = far_to_near_in_bands(ribbons, bands, rows);
    let mut image = Image::new(size.0, size.1);
    image.rgb.par_chunks_mut(3 * width * BAND).enumerate().for_each(|(k, out)| {
        let top = k * rows;
        let height = out.len() / (3 * width) * fine;
        let mut colour = Vec::with_capacity(width * fine * height);
        for y in top..top + height {
            let v = (y as f32 + 0.5) / fine_height as f32;
            colour.extend((0..width * fine).map(|x| background((x as f32 + 0.5) / (width * fine) as f32, v)));
        }
        let mut inverse_depth = vec![0.0; colour.len()];
        let mut band =
            Band { top, width: width * fine, colour: &mut colour, inverse_depth: &mut inverse_depth };
        triangles.iter().for_each(|t| band.triangle(t));
        by_band[k].iter().for_each(|&i| band.ribbon(&ribbons[i as usize]));
        for (i, pixel) in out.chunks_exact_mut(3).enumerate() {
            let (x, y) = (i % width * fine, i / width * fine);
            let sum: Rgb = (y..y + fine).flat_map(|r| &colour[r * width * fine + x..][..fine]).sum();
            pixel.copy_from_slice(&to_srgb(sum / (fine * fine) as f32));
        }
    });
    image
}

/// Indices of the ribbons that touch each band, from far to near; ties in input order.
fn far_to_near_in_bands(ribbons: &[Ribbon], bands: usize, rows: usize) -> Vec<Vec<u32>> {
    // Positive floats compare like their bits.
    let key = |(i, r): (usize, &Ribbon)| {
        let depth = (r.ends[0].inverse_depth + r.ends[1].inverse_depth).to_bits();
        (u64::from(depth) << 32) | i as u64
    };
    let mut order: Vec<u64> = ribbons.par_iter().enumerate().map(key).collect();
    order.par_sort_unstable();
    let mut by_band = vec![Vec::new(); bands];
    for i in order.into_iter().map(|k| k as u32) {
        let r = &ribbons[i as usize];
        // Across the fixed axis a sloping ribbon covers at most √2 of its width, plus a pixel.
        let reach = r.width + 1.0;
        let low = (r.ends[0].y.min(r.ends[1].y) - reach) / rows as f32;
        let high = (r.ends[0].y.max(r.ends[1].y) + reach) / rows as f32;
        if high < 0.0 || low >= bands as f32 {
            continue;
        }
        let last = (high as usize).min(bands - 1);
        by_band[low.max(0.0) as usize..=last].iter_mut().for_each(|b| b.push(i));
    }
    by_band
}

impl Band<'_> {
    fn rows(&self) -> usize {
        self.colour.len() / self.width
    }

    fn triangle(&mut self, t: &Triangle) {
        let [a, b, c] = t.corners;
        let cross =
            |p: Projected, q: Projected, x: f32, y: f32| (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x);
        let area = cross(a, b, c.x, c.y);
        let (top, bottom) = (self.top as f32, (self.top + self.rows()) as f32);
        let y_range = fine_range(a.y.min(b.y).min(c.y).max(top), a.y.max(b.y).max(c.y).min(bottom));
        let x_range =
            fine_range(a.x.min(b.x).min(c.x).max(0.0), a.x.max(b.x).max(c.x).min(self.width as f32));
        if area == 0.0 {
            return;
        }
        for row in y_range {
            for column in x_range.clone() {
                let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
                let weights = [cross(b, c, x, y) / area, cross(c, a, x, y) / area, cross(a, b, x, y) / area];
                if weights.iter().any(|w| *w < 0.0) {
                    continue;
                }
                let inverse_depth: f32 = (0..3).map(|k| weights[k] * t.corners[k].inverse_depth).sum();
                let i = (row - self.top) * self.width + column;
                if inverse_depth > self.inverse_depth[i] {
                    self.inverse_depth[i] = inverse_depth;
                    self.colour[i] = (0..3).map(|k| t.colours[k] * weights[k]).sum();
                }
            }
        }
    }

    /// Steps along the dominant axis of the ribbon by fine pixels, and covers across it. Steps have their
    /// centres on [start, end), so that joined ribbons meet without gap or overlap.
    fn ribbon(&mut self, r: &Ribbon) {
        let [p, q] = r.ends;
        let steep = (q.y - p.y).abs() > (q.x - p.x).abs();
        let place = |e: Projected| if steep { (e.y, e.x) } else { (e.x, e.y) };
        let (from, to) = if place(p).0 <= place(q).0 { (p, q) } else { (q, p) };
        let ((along0, across0), (along1, across1)) = (place(from), place(to));
        let run = along1 - along0;
        if run <= 0.0 {
            return;
        }
        let slope = (across1 - across0) / run;
        let half = 0.5 * r.width * slope.hypot(1.0);
        let (low, high) = if steep { (self.top, self.top + self.rows()) } else { (0, self.width) };
        for step in fine_range(along0.max(low as f32), along1.min(high as f32)) {
            let f = step as f32 + 0.5 - along0;
            let middle = across0 + slope * f;
            let inverse_depth = from.inverse_depth + (to.inverse_depth - from.inverse_depth) * (f / run);
            let (left, right) = (middle - half, middle + half);
            let (low, high) = if steep { (0, self.width) } else { (self.top, self.top + self.rows()) };
            let first = left.floor().max(low as f32) as usize;
            let last = right.ceil().min(high as f32).max(0.0) as usize;
            for cell in first..last {
                let covered = right.min(cell as f32 + 1.0) - left.max(cell as f32);
                let (x, y) = if steep { (cell, step) } else { (step, cell) };
                let i = (y - self.top) * self.width + x;
                if inverse_depth > self.inverse_depth[i] {
                    self.colour[i] += (r.colour - self.colour[i]) * covered;
                }
            }
        }
    }
}

/// Indices of the fine pixels whose centres lie on [low, high).
fn fine_range(low: f32, high: f32) -> std::ops::Range<usize> {
    let index = |x: f32| (x - 0.5).ceil().max(0.0) as usize;
    index(low)..index(high)
}

/// Linear colour to eight-bit sRGB. Highlights above 0.8 are compressed instead of clipped.
fn to_srgb(linear: Rgb) -> [u8; 3] {
    let encode = |c: f32| {
        let c = if c > 0.8 { 1.0 - 0.2 * (-(c - 0.8) / 0.2).exp() } else { c.max(0.0) };
        let s = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (255.0 * s).round() as u8
    };
    Vector3::map(&linear, encode).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn at(x: f32, y: f32, inverse_depth: f32) -> Projected {
        Projected { x, y, inverse_depth }
    }

    fn black(_: f32, _: f32) -> Rgb {
        Rgb::zeros()
    }

    /// Sum of the linear values of a picture.
    fn total(image: &Image) -> f64 {
        let linear = |s: u8| {
            let s = f64::from(s) / 255.0;
            if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
        };
        image.rgb.iter().step_by(3).map(|s| linear(*s)).sum()
    }

    /// Below the compression of highlights.
    const GREY: f32 = 0.5;

    fn area_of(ends: [Projected; 2], width: f32, fine: u32) -> f64 {
        let ribbon = Ribbon { ends, width, colour: Rgb::repeat(GREY) };
        total(&draw((64, 64), fine, black, &[], &[ribbon])) / f64::from(GREY)
    }

    #[test]
    fn strand_covers_its_width_times_its_length() {
        for fine in [1u32, 3] {
            let f = fine as f32;
            // Widths from a tenth of a pixel to two, at several subpixel positions.
            for width in [0.1, 0.4, 1.0, 2.3] {
                for x in [20.0, 20.3, 20.5, 20.8] {
                    let vertical = [at(x * f, 8.0 * f, 1.0), at(x * f, 48.0 * f, 1.0)];
                    let expected = f64::from(width) * 40.0;
                    assert_relative_eq!(area_of(vertical, width * f, fine), expected, max_relative = 0.03);
                }
                let sloping = [at(10.0 * f, 50.0 * f, 1.0), at(40.0 * f, 10.0 * f, 1.0)];
                let expected = f64::from(width) * 50.0;
                assert_relative_eq!(area_of(sloping, width * f, fine), expected, max_relative = 0.03);
            }
        }
    }

    #[test]
    fn joined_pieces_cover_as_much_as_one() {
        let (a, b) = (at(10.2, 9.1, 1.0), at(51.7, 23.3, 1.0));
        let whole = Ribbon { ends: [a, b], width: 0.7, colour: Rgb::repeat(GREY) };
        let cut = |t: f32| at(a.x + (b.x - a.x) * t, a.y + (b.y - a.y) * t, 1.0);
        let parts: Vec<Ribbon> = (0..17)
            .map(|i| Ribbon { ends: [cut(i as f32 / 17.0), cut((i + 1) as f32 / 17.0)], ..whole })
            .collect();
        let one = total(&draw((64, 64), 1, black, &[], &[whole]));
        assert_relative_eq!(total(&draw((64, 64), 1, black, &[], &parts)), one, max_relative = 0.005);
    }

    #[test]
    fn nearer_hides_farther_in_any_order() {
        let bar = |inverse_depth, colour| Ribbon {
            ends: [at(16.0, 0.0, inverse_depth), at(16.0, 32.0, inverse_depth)],
            width: 8.0,
            colour,
        };
        let (red, blue) = (Rgb::new(0.5, 0.0, 0.0), Rgb::new(0.0, 0.0, 0.5));
        let (near, far) = (bar(2.0, red), bar(1.0, blue));
        for ribbons in [[near, far], [far, near]] {
            let [r, _, b] = draw((32, 32), 2, black, &[], &ribbons).get(8, 8);
            assert!(r > 100 && b == 0, "red {r}, blue {b}");
        }
        let wall = |inverse_depth| Triangle {
            corners: [
                at(-50.0, -50.0, inverse_depth),
                at(200.0, -50.0, inverse_depth),
                at(-50.0, 200.0, inverse_depth),
            ],
            colours: [Rgb::new(0.0, 0.5, 0.0); 3],
        };
        let seen = |depth| draw((32, 32), 2, black, &[wall(depth)], &[near]).get(8, 8);
        assert_eq!(seen(3.0)[0], 0, "behind the wall");
        assert!(seen(1.5)[0] > 100 && seen(1.5)[1] == 0, "before the wall");
    }

    #[test]
    fn triangles_with_a_common_edge_leave_no_gap() {
        let corners = [at(2.0, 3.0, 1.0), at(30.0, 1.0, 1.0), at(28.0, 29.0, 1.0), at(1.0, 31.0, 1.0)];
        let half =
            |k: [usize; 3]| Triangle { corners: k.map(|i| corners[i]), colours: [Rgb::repeat(GREY); 3] };
        let image = draw((32, 32), 1, black, &[half([0, 1, 2]), half([0, 3, 2])], &[]);
        let grey = image.get(16, 16);
        assert!(grey[0] > 100);
        assert!((4..28).all(|i| image.get(i, i) == grey), "a gap along the shared edge");
    }

    #[test]
    fn ribbons_off_the_picture_are_clipped() {
        let ribbon = |x0, y0, x1, y1| Ribbon {
            ends: [at(x0, y0, 1.0), at(x1, y1, 1.0)],
            width: 3.0,
            colour: Rgb::repeat(GREY),
        };
        let off = [
            ribbon(-1e6, -1e6, -10.0, 5.0),
            ribbon(50.0, 2.0, 1e7, 9.0),
            ribbon(3.0, -90.0, 4.0, -50.0),
            ribbon(3.0, 60.0, 4.0, 1e30),
        ];
        assert_eq!(total(&draw((32, 32), 1, black, &[], &off)), 0.0);
        let across = ribbon(-100.0, 16.0, 100.0, 16.0);
        assert_relative_eq!(
            total(&draw((32, 32), 1, black, &[], &[across])) / f64::from(GREY),
            96.0,
            max_relative = 0.01
        );
    }
}
