//! Render strands grown round guides, where a groom has none of its own.

use super::scalp::Scalp;
use super::sections::Sections;
use crate::math::frame::rotation_minimising;
use crate::math::spline::ArcSpline;
use crate::scene::Curves;
use nalgebra::Vector3;
use rayon::prelude::*;

/// The golden angle, rad (Vogel 1979): seeds of a sunflower at this angle and radius √i fill a disc evenly.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// 1/φ: multiples of it, modulo 1, spread evenly.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;

/// Share of a strand over which it comes from its root's place on the scalp to its guide's shape.
const ROOT_SHARE: f64 = 0.4;

/// How strands are grown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growth {
    /// New strands round each guide.
    pub per_guide: usize,
    /// Vertices on each.
    pub vertices: usize,
    /// Most that a strand is shorter than its guide, as a share of the length; 0 to 1.
    pub shorter: f64,
}

impl Default for Growth {
    fn default() -> Self {
        Growth { per_guide: 50, vertices: 16, shorter: 0.08 }
    }
}

/// Grows strands in the room round each guide (`footprint`, m, guides × sections at the fractions `arc`): evenly spread over the disc,
/// at a fixed share of the room's radius in the guide's rotation-minimising frame. With a scalp, each root lies as high over it as
/// its guide's, and the way there fades out along the strand. Returns the strands and the guide of each.
pub(super) fn grow(
    guides: &Curves,
    sections: &Sections,
    footprint: &[f64],
    arc: &[f64],
    growth: Growth,
    scalp: Option<&Scalp>,
) -> (Curves, Vec<u32>) {
    let Growth { per_guide, vertices, shorter } = growth;
    let fraction = |v: usize| v as f64 / (vertices - 1) as f64;
    let tuft = |g: usize| -> Vec<Vector3<f64>> {
        let Some(spline) = ArcSpline::through(guides.curve(g)) else { return Vec::new() };
        let room = &footprint[g * sections.count..(g + 1) * sections.count];
        let mut points = Vec::with_capacity(per_guide * vertices);
        for i in 0..per_guide {
            // Each tuft turned by its own angle, so that neighbours do not repeat.
            let angle = (i as f64 + g as f64 * GOLDEN_RATIO) * GOLDEN_ANGLE;
            let share = ((i as f64 + 0.5) / per_guide as f64).sqrt();
            let cut = 1.0 - shorter * (((i + g) as f64) * GOLDEN_RATIO).fract();
            let s: Vec<f64> = (0..vertices).map(|v| fraction(v) * cut * spline.length()).collect();
            let start = points.len();
            for (v, (frame, &s)) in rotation_minimising(&spline, &s).iter().zip(&s).enumerate() {
                let radius = share * interpolate(arc, room, fraction(v) * cut);
                let offset = Vector3::new(angle.cos(), angle.sin(), 0.0) * radius;
                points.push(spline.at(s).x + frame * offset);
            }
            if let Some(scalp) = scalp {
                let lift = scalp.lift(&spline.at(0.0).x, &points[start]);
                for (v, x) in points[start..].iter_mut().enumerate() {
                    *x += lift * (1.0 - fraction(v) / ROOT_SHARE).max(0.0).powi(2);
                }
            }
        }
        points
    };
    let tufts: Vec<_> = (0..guides.len()).into_par_iter().map(tuft).collect();
    let follows: Vec<u32> =
        tufts.iter().enumerate().flat_map(|(g, t)| vec![g as u32; t.len() / vertices]).collect();
    let of_guide = |values: &dyn Fn(usize) -> u32| follows.iter().map(|&g| values(g as usize)).collect();
    let curves = Curves {
        offsets: (0..=follows.len()).map(|i| i * vertices).collect(),
        points: tufts.into_iter().flatten().collect(),
        id: (0..follows.len() as i32).collect(),
        group: of_guide(&|g| guides.group[g]),
        root_uv: follows.iter().map(|&g| guides.root_uv[g as usize]).collect(),
    };
    (curves, follows)
}

/// Linear interpolation of `values` at the increasing places `at`.
fn interpolate(at: &[f64], values: &[f64], x: f64) -> f64 {
    let k = at.partition_point(|&a| a <= x).clamp(1, at.len() - 1);
    let u = ((x - at[k - 1]) / (at[k] - at[k - 1])).clamp(0.0, 1.0);
    values[k - 1] * (1.0 - u) + values[k] * u
}
