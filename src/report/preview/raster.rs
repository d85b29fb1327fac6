//! Rasteriser for shaded triangles and thin ribbons.
//!
//! The picture is supersampled and averaged. Triangles use a depth buffer. Ribbons are blended from far to
//! near with their exact coverage of each fine pixel, so that a strand far thinner than a pixel neither
//! breaks up nor widens.

use rayon::prelude::*;
use std::ops::Range;
use std::sync::LazyLock;

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
    /// Linear colours of its ends.
    pub colours: [Rgb; 2],
}

/// A triangle, in fine pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Corners.
    pub corners: [Projected; 3],
    /// What the colours of its points are asked by.
    pub id: u32,
}

/// Rows of final pixels per task.
const BAND: usize = 16;

/// A fine pixel: linear red, green and blue, and the reciprocal of the depth of the nearest triangle.
type FinePixel = [f32; 4];

/// A band of fine rows.
struct Band<'a> {
    /// First fine row.
    top: usize,
    width: usize,
    pixels: &'a mut [FinePixel],
    /// One more than the place of the nearest triangle in its band; 0 for none.
    nearest: &'a mut [u32],
}

/// Draws a picture of `size` final pixels, supersampled `fine` times in each direction, over `background`
/// (linear colour at a position in fractions of the picture). `skin` is the linear colour of a triangle at the
/// point with these weights of its corners; it is asked once for each pixel and triangle. Triangles hide
/// ribbons that are farther than `hides` of their distance behind them. The picture does not depend on the
/// number of threads.
pub fn draw(
    size: (u32, u32),
    fine: u32,
    background: impl Fn(f32, f32) -> Rgb + Sync,
    (triangles, hides): (&[Triangle], f32),
    skin: impl Fn(u32, [f32; 3]) -> Rgb + Sync,
    ribbons: &[Ribbon],
) -> Image {
    let (width, fine) = (size.0 as usize, fine as usize);
    let rows = BAND * fine;
    let bands = (size.1 as usize).div_ceil(BAND);
    let ribbons_by_band = in_bands(ribbons, bands, |r| {
        // Across the fixed axis a sloping ribbon covers at most √2 of its width, plus a pixel.
        let reach = r.width + 1.0;
        let [a, b] = r.ends.map(|end| end.y);
        touched_bands(a.min(b) - reach, a.max(b) + reach, bands, rows)
    });
    let triangles_by_band = in_bands(triangles, bands, |t| {
        let [a, b, c] = t.corners.map(|p| p.y);
        touched_bands(a.min(b).min(c), a.max(b).max(c), bands, rows)
    });
    let mut image = Image::new(size.0, size.1);
    let draw_band = |Scratch { pixels, nearest, order }: &mut Scratch, (k, out): (usize, &mut [u8])| {
        pixels.clear();
        for y in k * BAND..k * BAND + out.len() / (3 * width) {
            // The background is smooth: one colour for all fine pixels of a final one.
            let v = (y as f32 + 0.5) / size.1 as f32;
            let start = pixels.len();
            for x in 0..width {
                let shade = background((x as f32 + 0.5) / width as f32, v);
                pixels.extend(std::iter::repeat_n([shade.x, shade.y, shade.z, 0.0], fine));
            }
            for _ in 1..fine {
                pixels.extend_from_within(start..start + width * fine);
            }
        }
        nearest.clear();
        nearest.resize(pixels.len(), 0);
        let mut band = Band { top: k * rows, width: width * fine, pixels, nearest };
        let triangles = &triangles_by_band[k];
        triangles.iter().zip(1..).for_each(|(t, place)| band.triangle(t, place));
        band.shade(triangles, fine, &skin);
        band.pixels.iter_mut().for_each(|pixel| pixel[3] /= 1.0 + hides);
        let ribbons = &ribbons_by_band[k];
        far_to_near(ribbons, order);
        order.iter().for_each(|key| band.ribbon(&ribbons[*key as u32 as usize]));
        for (i, out) in out.chunks_exact_mut(3).enumerate() {
            let (x, y) = (i % width * fine, i / width * fine);
            let mut sum = [0.0; 4];
            for row in y..y + fine {
                for pixel in &band.pixels[row * width * fine + x..][..fine] {
                    sum.iter_mut().zip(pixel).for_each(|(sum, c)| *sum += c);
                }
            }
            let [r, g, b, _] = sum.map(|c| c / (fine * fine) as f32);
            out.copy_from_slice(&to_srgb(Rgb::new(r, g, b)));
        }
    };
    image.rgb.par_chunks_mut(3 * width * BAND).enumerate().for_each_init(Scratch::default, draw_band);
    image
}

/// What drawing a band needs; reused from band to band.
#[derive(Default)]
struct Scratch {
    pixels: Vec<FinePixel>,
    nearest: Vec<u32>,
    /// See [`far_to_near`].
    order: Vec<u64>,
}

/// For each band those of `all` that touch it, in input order. They are copied, so that a band is read from
/// one place.
fn in_bands<T: Copy>(all: &[T], bands: usize, touched: impl Fn(&T) -> Range<usize>) -> Vec<Vec<T>> {
    let mut by_band: Vec<Vec<T>> = (0..bands).map(|_| Vec::with_capacity(2 * all.len() / bands)).collect();
    for item in all {
        by_band[touched(item)].iter_mut().for_each(|band| band.push(*item));
    }
    by_band
}

/// The bands that fine rows from `low` to `high` touch.
fn touched_bands(low: f32, high: f32, bands: usize, rows: usize) -> Range<usize> {
    let (low, high) = (low / rows as f32, high / rows as f32);
    if !(high >= 0.0 && low < bands as f32) {
        return 0..0;
    }
    low.max(0.0) as usize..(high as usize).min(bands - 1) + 1
}

/// Puts the order of the ribbons from far to near into `order`, their indices in the lower half; ties in
/// input order.
fn far_to_near(ribbons: &[Ribbon], order: &mut Vec<u64>) {
    // Positive floats compare like their bits.
    let key = |(r, i): (&Ribbon, u64)| {
        let depth = (r.ends[0].inverse_depth + r.ends[1].inverse_depth).to_bits();
        (u64::from(depth) << 32) | i
    };
    order.clear();
    order.extend(ribbons.iter().zip(0..).map(key));
    order.sort_unstable();
}

/// Twice the area of the triangle from an edge to a point.
fn cross(p: Projected, q: Projected, x: f32, y: f32) -> f32 {
    (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)
}

impl Triangle {
    /// The weights of the corners at the point of the surface that is seen at (`x`, `y`).
    fn weights(&self, [x, y]: [f32; 2]) -> [f32; 3] {
        let [a, b, c] = self.corners;
        let parts = [(b, c, a), (c, a, b), (a, b, c)].map(|(p, q, r)| cross(p, q, x, y) * r.inverse_depth);
        let sum: f32 = parts.iter().sum();
        parts.map(|part| part / sum)
    }
}

impl Band<'_> {
    fn rows(&self) -> usize {
        self.pixels.len() / self.width
    }

    /// Marks where a triangle is nearest with its `place`.
    fn triangle(&mut self, t: &Triangle, place: u32) {
        let [a, b, c] = t.corners;
        let area = cross(a, b, c.x, c.y);
        let (top, bottom) = (self.top as f32, (self.top + self.rows()) as f32);
        let y_range = fine_range(a.y.min(b.y).min(c.y).max(top), a.y.max(b.y).max(c.y).min(bottom));
        let (left, right) = (a.x.min(b.x).min(c.x).max(0.0), a.x.max(b.x).max(c.x).min(self.width as f32));
        if area == 0.0 {
            return;
        }
        // Weights of the corners, and how they change along a row.
        let edges = [(b, c), (c, a), (a, b)];
        let slopes = edges.map(|(p, q)| (p.y - q.y) / area);
        for row in y_range {
            let y = row as f32 + 0.5;
            let starts = edges.map(|(p, q)| cross(p, q, 0.0, y) / area);
            let (mut low, mut high) = (left, right);
            for (start, slope) in starts.iter().zip(slopes) {
                // A pixel of slack for rounding; the weights decide.
                let crossing = -start / slope;
                if slope > 0.0 {
                    low = low.max(crossing - 1.0);
                } else if slope < 0.0 {
                    high = high.min(crossing + 1.0);
                }
            }
            for column in fine_range(low, high) {
                let x = column as f32 + 0.5;
                let weights: [f32; 3] = std::array::from_fn(|k| starts[k] + slopes[k] * x);
                // Rounding shall leave no gap between triangles.
                if weights[0].min(weights[1]).min(weights[2]) < -1e-5 {
                    continue;
                }
                let inverse_depth = weights[0] * a.inverse_depth
                    + weights[1] * b.inverse_depth
                    + weights[2] * c.inverse_depth;
                let i = (row - self.top) * self.width + column;
                if inverse_depth > self.pixels[i][3] {
                    self.pixels[i][3] = inverse_depth;
                    self.nearest[i] = place;
                }
            }
        }
    }

    /// Colours what triangles cover: of each pixel the first fine pixel of each triangle stands for all.
    fn shade(&mut self, triangles: &[Triangle], fine: usize, skin: &impl Fn(u32, [f32; 3]) -> Rgb) {
        let mut known: Vec<(u32, Rgb)> = Vec::new();
        for y in (0..self.rows()).step_by(fine) {
            for x in (0..self.width).step_by(fine) {
                known.clear();
                for row in y..y + fine {
                    for column in x..x + fine {
                        let i = row * self.width + column;
                        let place = self.nearest[i];
                        if place == 0 {
                            continue;
                        }
                        let colour =
                            known.iter().find(|(known, _)| *known == place).map(|(_, colour)| *colour);
                        let colour = colour.unwrap_or_else(|| {
                            let t = &triangles[place as usize - 1];
                            let at = [column as f32 + 0.5, (self.top + row) as f32 + 0.5];
                            let colour = skin(t.id, t.weights(at));
                            known.push((place, colour));
                            colour
                        });
                        self.pixels[i][..3].copy_from_slice(colour.as_slice());
                    }
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
        let half = 0.5 * r.width * (1.0 + slope * slope).sqrt();
        let colours = if place(p).0 <= place(q).0 { r.colours } else { [r.colours[1], r.colours[0]] };
        let change = (colours[1] - colours[0]) / run;
        let deepening = (to.inverse_depth - from.inverse_depth) / run;
        let (low, high) = if steep { (self.top, self.top + self.rows()) } else { (0, self.width) };
        for step in fine_range(along0.max(low as f32), along1.min(high as f32)) {
            let f = step as f32 + 0.5 - along0;
            let middle = across0 + slope * f;
            let inverse_depth = from.inverse_depth + deepening * f;
            let colour = colours[0] + change * f;
            let (left, right) = (middle - half, middle + half);
            let (low, high) = if steep { (0, self.width) } else { (self.top, self.top + self.rows()) };
            let first = left.max(low as f32) as usize;
            let last = ceiling(right.min(high as f32));
            for cell in first..last {
                let covered = right.min(cell as f32 + 1.0) - left.max(cell as f32);
                let (x, y) = if steep { (cell, step) } else { (step, cell) };
                let pixel = &mut self.pixels[(y - self.top) * self.width + x];
                if inverse_depth > pixel[3] {
                    let shade = [colour.x, colour.y, colour.z, pixel[3]];
                    pixel.iter_mut().zip(shade).for_each(|(c, shade)| *c += (shade - *c) * covered);
                }
            }
        }
    }
}

/// Indices of the fine pixels whose centres lie on [low, high).
fn fine_range(low: f32, high: f32) -> Range<usize> {
    ceiling(low - 0.5)..ceiling(high - 0.5)
}

/// The next whole number, at least 0. Faster than `f32::ceil`, which is a call where the processor is not
/// known to have an instruction for it.
fn ceiling(x: f32) -> usize {
    let below = x as usize;
    below.saturating_add(usize::from((below as f32) < x))
}

/// Linear colour to eight-bit sRGB. Highlights above 0.8 are compressed instead of clipped.
fn to_srgb(linear: Rgb) -> [u8; 3] {
    static STEPS: LazyLock<SrgbSteps> = LazyLock::new(SrgbSteps::new);
    linear.map(|c| STEPS.encode(c)).into()
}

/// Cells of [`SrgbSteps`]: so many that most are without a step.
const CELLS: usize = 4096;

/// Where the eight-bit value of a linear colour steps up, for a search instead of powers.
struct SrgbSteps {
    /// The least linear value of each eight-bit one.
    least: [f32; 256],
    /// The eight-bit value at the start of each of equal cells from 0 to 1 of the square root.
    guess: [u8; CELLS],
}

impl SrgbSteps {
    fn new() -> Self {
        let least = std::array::from_fn(|value| {
            let (mut low, mut high) = (0.0f32, 3.0f32);
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                let below = usize::from(srgb(middle)) < value;
                *(if below { &mut low } else { &mut high }) = middle;
            }
            if value == 0 { f32::NEG_INFINITY } else { high }
        });
        let guess = std::array::from_fn(|cell| srgb((cell as f32 / CELLS as f32).powi(2)));
        SrgbSteps { least, guess }
    }

    fn encode(&self, linear: f32) -> u8 {
        let cell = (CELLS as f32 * linear.max(0.0).sqrt()) as usize;
        let mut value = usize::from(self.guess[cell.min(CELLS - 1)]);
        while value < 255 && linear >= self.least[value + 1] {
            value += 1;
        }
        while value > 0 && linear < self.least[value] {
            value -= 1;
        }
        value as u8
    }
}

fn srgb(linear: f32) -> u8 {
    let c = if linear > 0.8 { 1.0 - 0.2 * (-(linear - 0.8) / 0.2).exp() } else { linear.max(0.0) };
    let s = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (255.0 * s).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn at(x: f32, y: f32, inverse_depth: f32) -> Projected {
        Projected { x, y, inverse_depth }
    }

    fn green(_: u32, _: [f32; 3]) -> Rgb {
        Rgb::new(0.0, 0.5, 0.0)
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
        let ribbon = Ribbon { ends, width, colours: [Rgb::repeat(GREY); 2] };
        total(&draw((64, 64), fine, black, (&[], 0.0), green, &[ribbon])) / f64::from(GREY)
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
        let whole = Ribbon { ends: [a, b], width: 0.7, colours: [Rgb::repeat(GREY); 2] };
        let cut = |t: f32| at(a.x + (b.x - a.x) * t, a.y + (b.y - a.y) * t, 1.0);
        let parts: Vec<Ribbon> = (0..17)
            .map(|i| Ribbon { ends: [cut(i as f32 / 17.0), cut((i + 1) as f32 / 17.0)], ..whole })
            .collect();
        let one = total(&draw((64, 64), 1, black, (&[], 0.0), green, &[whole]));
        assert_relative_eq!(
            total(&draw((64, 64), 1, black, (&[], 0.0), green, &parts)),
            one,
            max_relative = 0.005
        );
    }

    #[test]
    fn nearer_hides_farther_in_any_order() {
        let bar = |inverse_depth, colour| Ribbon {
            ends: [at(16.0, 0.0, inverse_depth), at(16.0, 32.0, inverse_depth)],
            width: 8.0,
            colours: [colour; 2],
        };
        let (red, blue) = (Rgb::new(0.5, 0.0, 0.0), Rgb::new(0.0, 0.0, 0.5));
        let (near, far) = (bar(2.0, red), bar(1.0, blue));
        for ribbons in [[near, far], [far, near]] {
            let [r, _, b] = draw((32, 32), 2, black, (&[], 0.0), green, &ribbons).get(8, 8);
            assert!(r > 100 && b == 0, "red {r}, blue {b}");
        }
        let wall = |inverse_depth| Triangle {
            corners: [
                at(-50.0, -50.0, inverse_depth),
                at(200.0, -50.0, inverse_depth),
                at(-50.0, 200.0, inverse_depth),
            ],
            id: 0,
        };
        let seen = |depth| draw((32, 32), 2, black, (&[wall(depth)], 0.1), green, &[near]).get(8, 8);
        assert_eq!(seen(3.0)[0], 0, "behind the wall");
        assert!(seen(2.1)[0] > 100 && seen(2.3)[0] == 0, "a little behind it");
        assert!(seen(1.5)[0] > 100 && seen(1.5)[1] == 0, "before the wall");
    }

    #[test]
    fn triangles_with_a_common_edge_leave_no_gap() {
        let corners = [at(2.0, 3.0, 1.0), at(30.0, 1.0, 1.0), at(28.0, 29.0, 1.0), at(1.0, 31.0, 1.0)];
        let half = |k: [usize; 3]| Triangle { corners: k.map(|i| corners[i]), id: 0 };
        let image = draw((32, 32), 1, black, (&[half([0, 1, 2]), half([0, 3, 2])], 0.0), green, &[]);
        let grey = image.get(16, 16);
        assert!(grey[1] > 100);
        assert!((4..28).all(|i| image.get(i, i) == grey), "a gap along the shared edge");
    }

    #[test]
    fn stepped_srgb_is_srgb() {
        let steps = SrgbSteps::new();
        for i in -10..3_000 {
            let linear = i as f32 * 1e-3;
            assert_eq!(steps.encode(linear), srgb(linear), "{linear}");
            let dark = (i as f32 * 1e-3).powi(3) * 1e-3;
            assert_eq!(steps.encode(dark), srgb(dark), "{dark}");
        }
        assert_eq!(steps.encode(f32::NAN), 0);
    }

    #[test]
    fn ribbons_off_the_picture_are_clipped() {
        let ribbon = |x0, y0, x1, y1| Ribbon {
            ends: [at(x0, y0, 1.0), at(x1, y1, 1.0)],
            width: 3.0,
            colours: [Rgb::repeat(GREY); 2],
        };
        let off = [
            ribbon(-1e6, -1e6, -10.0, 5.0),
            ribbon(50.0, 2.0, 1e7, 9.0),
            ribbon(3.0, -90.0, 4.0, -50.0),
            ribbon(3.0, 60.0, 4.0, 1e30),
        ];
        assert_eq!(total(&draw((32, 32), 1, black, (&[], 0.0), green, &off)), 0.0);
        let across = ribbon(-100.0, 16.0, 100.0, 16.0);
        assert_relative_eq!(
            total(&draw((32, 32), 1, black, (&[], 0.0), green, &[across])) / f64::from(GREY),
            96.0,
            max_relative = 0.01
        );
    }
}
