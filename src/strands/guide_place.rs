//! Places on guides.

use nalgebra::Vector3;

/// A place on a guide: a segment of its polyline and the fraction (0..=1) along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct GuidePlace {
    segment: u32,
    u: f32,
}

impl GuidePlace {
    /// The place at arc length `s` of a polyline whose points are at `arc`, m, clamped to its ends.
    pub fn at(arc: &[f64], s: f64) -> Self {
        let i = arc.partition_point(|&a| a <= s).clamp(1, arc.len() - 1);
        let (from, to) = (arc[i - 1], arc[i]);
        // A segment of no length, as at a tip that is given twice, has one place.
        let u = (s - from) / (to - from).max(f64::MIN_POSITIVE);
        GuidePlace { segment: i as u32 - 1, u: u.clamp(0.0, 1.0) as f32 }
    }

    /// Position of the place, given those of the points, m.
    pub fn position(self, x: impl Fn(usize) -> Vector3<f64>) -> Vector3<f64> {
        let k = self.segment as usize;
        x(k).lerp(&x(k + 1), f64::from(self.u))
    }

    /// The values at the ends of its segment, given those at the points, and the fraction along it.
    #[inline(always)]
    pub fn ends<T>(self, of: &[T]) -> (&T, &T, f64) {
        let k = self.segment as usize;
        (&of[k], &of[k + 1], f64::from(self.u))
    }

    /// Index of the first point of its segment.
    pub fn segment(self) -> usize {
        self.segment as usize
    }

    /// Index of the nearest point.
    pub fn nearest_point(self) -> usize {
        self.segment as usize + usize::from(self.u >= 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_of_no_length_at_the_tip_has_one_place() {
        let x = [0.0, 1.0, 1.0].map(|x| Vector3::new(x, 0.0, 0.0));
        for (s, at) in [(-0.5, 0.0), (0.25, 0.25), (1.0, 1.0), (1.5, 1.0)] {
            assert_eq!(GuidePlace::at(&[0.0, 1.0, 1.0], s).position(|k| x[k]).x, at, "{s}");
        }
    }
}
