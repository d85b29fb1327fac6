//! Compact encoding of moving points: 16 bits per coordinate, and changes in eight.
//!
//! A point is an integer place in the box of all points. From the second frame on, a point is predicted from
//! the frame before and from the motion of the point before it on its curve, and the difference from that is
//! rounded to a byte. The prediction uses decoded places, so that errors do not add up.

use crate::report::space::finite_box;
use nalgebra::Vector3;

/// Marks a point that is stored in full because its change is too large for a byte.
const ESCAPE: i8 = i8::MIN;
/// Differences are rounded to at most 2 to this power, in steps of the box.
const MAX_SHIFT: u8 = 4;
/// Share of points that may be stored in full before differences are rounded more coarsely.
const MANY_ESCAPES: f64 = 0.01;

/// The box of all points, divided into steps of equal length along the three axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Box16 {
    /// Its lowest corner.
    pub low: Vector3<f32>,
    /// Length of a step.
    pub step: f32,
}

impl Box16 {
    /// The box of the finite ones of `points`, but no larger than from the one corner of `limits` to the
    /// other.
    pub fn around<'a>(
        points: impl IntoIterator<Item = &'a Vector3<f32>>,
        limits: Option<[Vector3<f32>; 2]>,
    ) -> Self {
        let [low, high] = finite_box(points).unwrap_or_default();
        let [low, high] = limits.map_or([low, high], |[a, b]| [low.sup(&a), high.inf(&b)]);
        // Negative where no point is within the limits.
        let side = (high - low).max();
        Box16 { low, step: (side / f32::from(u16::MAX)).max(f32::MIN_POSITIVE) }
    }

    /// Distance of the farthest of some points from the box; what is no number counts as in there.
    pub fn excess<'a>(&self, points: impl IntoIterator<Item = &'a Vector3<f32>>) -> f32 {
        let high = self.low.add_scalar(self.step * f32::from(u16::MAX));
        let distance = |p: &Vector3<f32>| (p - p.sup(&self.low).inf(&high)).norm();
        points.into_iter().map(distance).filter(|d| d.is_finite()).fold(0.0, f32::max)
    }

    /// The nearest place in the box; the lowest corner for what is not a number.
    fn place(&self, p: &Vector3<f32>) -> [i32; 3] {
        let steps = |k: usize| ((p[k] - self.low[k]) / self.step).round() as u16;
        [steps(0), steps(1), steps(2)].map(i32::from)
    }
}

/// The encoded frames of some points.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Encoded {
    /// The content.
    pub bytes: Vec<u8>,
    /// The power of two to which the differences of each frame are rounded.
    pub shifts: Vec<u8>,
}

impl Encoded {
    /// Bound on the error of a decoded coordinate, in steps of the box: half a step for the place in the box,
    /// and half of what differences are rounded to.
    pub fn error_steps(&self) -> f32 {
        let shift = self.shifts.iter().copied().max().unwrap_or(0);
        0.5 + if shift > 0 { f32::from(1u16 << (shift - 1)) } else { 0.0 }
    }
}

/// Encodes `frames` of points; `roots` tells of each point whether it is the first of its curve.
pub fn encode<F: AsRef<[Vector3<f32>]>>(frames: &[F], roots: &[bool], space: &Box16) -> Encoded {
    let mut encoded = Encoded::default();
    let mut before: Option<Vec<[i32; 3]>> = None;
    for frame in frames {
        let places: Vec<_> = frame.as_ref().iter().map(|p| space.place(p)).collect();
        let allowed = (MANY_ESCAPES * places.len() as f64) as usize;
        let shifts = if before.is_some() { 0..=MAX_SHIFT } else { 0..=0 };
        let mut best = (Vec::new(), Vec::new(), 0);
        for shift in shifts {
            let (bytes, decoded, escapes) = encode_frame(&places, roots, before.as_deref(), shift);
            best = (bytes, decoded, shift);
            if escapes <= allowed {
                break;
            }
        }
        let (bytes, decoded, shift) = best;
        encoded.bytes.extend(bytes);
        encoded.shifts.push(shift);
        before = Some(decoded);
    }
    encoded
}

/// The bytes of a frame, its decoded places, and the number of points that are stored in full.
fn encode_frame(
    places: &[[i32; 3]],
    roots: &[bool],
    before: Option<&[[i32; 3]]>,
    shift: u8,
) -> (Vec<u8>, Vec<[i32; 3]>, usize) {
    let mut bytes = Vec::with_capacity(3 * places.len());
    let mut decoded: Vec<[i32; 3]> = Vec::with_capacity(places.len());
    let mut escapes = 0;
    for (i, place) in places.iter().enumerate() {
        let change = before.and_then(|before| {
            let carried = if roots[i] { [0; 3] } else { difference(decoded[i - 1], before[i - 1]) };
            let predicted: [i32; 3] = std::array::from_fn(|k| before[i][k] + carried[k]);
            small_change(difference(*place, predicted), predicted, shift)
        });
        match change {
            Some((change, reached)) => {
                bytes.extend(change.map(|c| c as u8));
                decoded.push(reached);
            }
            None => {
                bytes.push(ESCAPE as u8);
                bytes.extend(place.iter().flat_map(|c| (*c as u16).to_le_bytes()));
                decoded.push(*place);
                escapes += 1;
            }
        }
    }
    (bytes, decoded, escapes)
}

/// A change rounded to multiples of 2^`shift`, and the place that it leads to; `None` if it does not fit.
fn small_change(change: [i32; 3], from: [i32; 3], shift: u8) -> Option<([i8; 3], [i32; 3])> {
    let half = (1 << shift) >> 1;
    let rounded = change.map(|c| (c + half) >> shift);
    let reached: [i32; 3] = std::array::from_fn(|k| from[k] + (rounded[k] << shift));
    let fits = rounded.iter().all(|c| (-127..=127).contains(c))
        && reached.iter().all(|c| (0..=i32::from(u16::MAX)).contains(c));
    fits.then(|| (rounded.map(|c| c as i8), reached))
}

fn difference(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Decodes as the page does; also returns the number of bytes used.
    pub fn decode(encoded: &Encoded, roots: &[bool], space: &Box16) -> (Vec<Vec<Vector3<f32>>>, usize) {
        let mut bytes = encoded.bytes.iter().copied();
        let mut next = || bytes.next().unwrap();
        let mut before: Vec<[i32; 3]> = Vec::new();
        let mut frames = Vec::new();
        for shift in &encoded.shifts {
            let mut now: Vec<[i32; 3]> = Vec::new();
            for i in 0..roots.len() {
                let first = next() as i8;
                now.push(if first == ESCAPE {
                    std::array::from_fn(|_| i32::from(u16::from_le_bytes([next(), next()])))
                } else {
                    let change = [first, next() as i8, next() as i8];
                    let carried = if roots[i] { [0; 3] } else { difference(now[i - 1], before[i - 1]) };
                    std::array::from_fn(|k| before[i][k] + carried[k] + (i32::from(change[k]) << shift))
                });
            }
            let point = |q: &[i32; 3]| space.low + Vector3::from(q.map(|c| c as f32)) * space.step;
            frames.push(now.iter().map(point).collect());
            before = now;
        }
        (frames, encoded.bytes.len() - bytes.len())
    }

    /// Curves of 12 points that swing, the faster the larger `speed`.
    fn swinging(curves: usize, frames: usize, speed: f32) -> (Vec<Vec<Vector3<f32>>>, Vec<bool>) {
        let point = |c: usize, k: usize, f: usize| {
            let turn = 0.3 * (speed * f as f32 + 0.7 * c as f32).sin() * k as f32 / 12.0;
            let (s, u) = (0.02 * k as f32, 0.001 * c as f32);
            Vector3::new(u + s * turn.sin(), -s * turn.cos(), 0.1 * u)
        };
        let frame = |f| (0..curves * 12).map(|i| point(i / 12, i % 12, f)).collect();
        ((0..frames).map(frame).collect(), (0..curves * 12).map(|i| i % 12 == 0).collect())
    }

    fn largest_error(speed: f32) -> (f32, f32, Encoded) {
        let (frames, roots) = swinging(40, 30, speed);
        let space = Box16::around(frames.iter().flatten(), None);
        let encoded = encode(&frames, &roots, &space);
        let (decoded, used) = decode(&encoded, &roots, &space);
        assert_eq!(used, encoded.bytes.len());
        let error = |(a, b): (&Vector3<f32>, &Vector3<f32>)| (a - b).amax() / space.step;
        let largest = frames.iter().flatten().zip(decoded.iter().flatten()).map(error).fold(0.0, f32::max);
        (largest, encoded.error_steps(), encoded)
    }

    #[test]
    fn errors_keep_to_their_bound_however_fast_points_move() {
        for speed in [0.0, 0.02, 0.3, 2.0] {
            let (error, bound, encoded) = largest_error(speed);
            // Single precision of the coordinates is a tenth of a step.
            assert!(error <= bound + 0.1, "speed {speed}: {error} steps, bound {bound}");
            assert!(bound <= 8.5, "{bound}");
            assert!(encoded.shifts.len() == 30 && encoded.shifts[0] == 0);
        }
        assert!(largest_error(0.02).1 == 0.5 && largest_error(2.0).1 > 0.5);
    }

    #[test]
    fn slow_motion_takes_three_bytes_a_point() {
        let points = 40 * 12;
        let (_, _, encoded) = largest_error(0.02);
        assert!(encoded.bytes.len() <= points * (7 + 29 * 3) + points, "{}", encoded.bytes.len());
    }

    #[test]
    fn a_jump_and_what_is_no_number_spoil_no_other_point() {
        let (mut frames, roots) = swinging(8, 6, 0.1);
        let space = Box16::around(frames.iter().flatten(), None);
        let clean = frames.clone();
        frames[3][17] += Vector3::new(0.05, 0.0, 0.0);
        frames[4][40] = Vector3::new(f32::NAN, f32::INFINITY, 0.0);
        let encoded = encode(&frames, &roots, &space);
        let (decoded, _) = decode(&encoded, &roots, &space);
        let bound = (encoded.error_steps() + 0.1) * space.step;
        for (f, (a, b)) in clean.iter().zip(&decoded).enumerate() {
            for (i, (p, q)) in a.iter().zip(b).enumerate() {
                assert!((p - q).amax() <= bound || [(3, 17), (4, 40)].contains(&(f, i)), "{f} {i}");
            }
        }
        assert!((decoded[3][17] - frames[3][17]).amax() <= bound);
    }

    #[test]
    fn the_box_is_that_of_finite_points_within_its_limits() {
        let limits = [Vector3::repeat(-1.0), Vector3::repeat(1.0)];
        let points = [[0.0, 0.0, 0.0], [0.5, 0.25, 9.0], [f32::NAN; 3]].map(Vector3::from);
        let space = Box16::around(&points, Some(limits));
        assert_eq!((space.low, space.step), (Vector3::zeros(), 1.0 / 65535.0));
        assert_eq!(space.place(&points[1])[2], 65535, "on the border");
        assert_eq!(space.excess(&points), 8.0);
        let none = Box16::around(&[Vector3::repeat(f32::NAN)], Some(limits));
        assert_eq!(none.place(&Vector3::repeat(f32::NAN)), [0; 3]);
    }
}
