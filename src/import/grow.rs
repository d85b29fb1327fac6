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

/// Points at which a guide's run is taken.
const RUN_SAMPLES: usize = 65;
/// Half of the window over which curls are averaged out, in those points.
const RUN_WINDOW: usize = 6;
/// Times the window passes: three come near a Gaussian.
const RUN_PASSES: usize = 3;

/// How strands are grown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growth {
    /// New strands round each guide.
    pub per_guide: usize,
    /// Vertices on each.
    pub vertices: usize,
    /// Most that a strand is shorter than its guide, as a share of the length; 0 to 1.
    pub shorter: f64,
    /// Share by which the room round a guide closes from root to tip: 0 for parallel strands, 1 for a point.
    pub clump: f64,
}

impl Default for Growth {
    fn default() -> Self {
        Growth { per_guide: 50, vertices: 16, shorter: 0.08, clump: 0.4 }
    }
}

/// Grows strands in the room round each guide (`footprint`, m, guides × sections at the fractions `arc`): evenly
/// spread over the disc, at a fixed share of the room's radius, in frames that follow the guide's run but not its
/// curls (curls stay alike then). With a scalp, each root lies as high over it as its guide's, and the way there
/// fades out along the strand. Returns the strands and the guide of each.
pub(super) fn grow(
    guides: &Curves,
    sections: &Sections,
    footprint: &[f64],
    arc: &[f64],
    growth: Growth,
    scalp: Option<&Scalp>,
) -> (Curves, Vec<u32>) {
    let Growth { per_guide, vertices, shorter, clump } = growth;
    let fraction = |v: usize| v as f64 / (vertices - 1) as f64;
    let tuft = |g: usize| -> Vec<Vector3<f64>> {
        let Some(spline) = ArcSpline::through(guides.curve(g)) else { return Vec::new() };
        let Some(run) = ArcSpline::through(&run_of(&spline)) else { return Vec::new() };
        let room = &footprint[g * sections.count..(g + 1) * sections.count];
        let mut points = Vec::with_capacity(per_guide * vertices);
        for i in 0..per_guide {
            // Each tuft turned by its own angle, so that neighbours do not repeat.
            let angle = (i as f64 + g as f64 * GOLDEN_RATIO) * GOLDEN_ANGLE;
            let share = ((i as f64 + 0.5) / per_guide as f64).sqrt();
            let cut = 1.0 - shorter * (((i + g) as f64) * GOLDEN_RATIO).fract();
            let start = points.len();
            let along: Vec<f64> = (0..vertices).map(|v| fraction(v) * cut).collect();
            let on_run: Vec<f64> = along.iter().map(|a| a * run.length()).collect();
            for (frame, &a) in rotation_minimising(&run, &on_run, None).iter().zip(&along) {
                let radius = share * interpolate(arc, room, a) * (1.0 - clump * a);
                let offset = Vector3::new(angle.cos(), angle.sin(), 0.0) * radius;
                points.push(spline.at(a * spline.length()).x + frame * offset);
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

/// Where a strand runs, its curls averaged out: [`RUN_SAMPLES`] points under a box filter, narrower towards the ends
/// so that root and tip stay.
fn run_of(spline: &ArcSpline) -> Vec<Vector3<f64>> {
    let last = RUN_SAMPLES - 1;
    let mut points: Vec<_> =
        (0..=last).map(|i| spline.at(spline.length() * i as f64 / last as f64).x).collect();
    for _ in 0..RUN_PASSES {
        let mean = |i: usize| {
            let half = RUN_WINDOW.min(i).min(last - i);
            points[i - half..=i + half].iter().sum::<Vector3<f64>>() / (2 * half + 1) as f64
        };
        points = (0..=last).map(mean).collect();
    }
    points
}

/// Linear interpolation of `values` at the increasing places `at`.
fn interpolate(at: &[f64], values: &[f64], x: f64) -> f64 {
    let k = at.partition_point(|&a| a <= x).clamp(1, at.len() - 1);
    let u = ((x - at[k - 1]) / (at[k] - at[k - 1])).clamp(0.0, 1.0);
    values[k - 1] * (1.0 - u) + values[k] * u
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Tree;

    fn one_guide(at: impl Fn(f64) -> Vector3<f64>) -> (Curves, Sections, Vec<f64>) {
        let points: Vec<_> = (0..=64).map(|i| at(f64::from(i) / 64.0)).collect();
        let curves =
            Curves { offsets: vec![0, 65], points, id: vec![4], group: vec![0], root_uv: vec![[0.5, 0.25]] };
        let arc = Tree::default_arc(6);
        (curves.clone(), Sections::of(&curves, &arc), arc)
    }

    #[test]
    fn strands_fill_the_room_and_no_more() {
        let (guide, sections, arc) = one_guide(|u| Vector3::new(0.0, -0.2 * u, 0.02 * u * u));
        let growth = Growth { per_guide: 100, vertices: 9, shorter: 0.1, clump: 0.5 };
        let (grown, follows) = grow(&guide, &sections, &[0.01; 6], &arc, growth, None);
        assert_eq!((grown.len(), follows), (100, vec![0; 100]));
        assert_eq!(grown.root_uv[99], [0.5, 0.25]);
        let reach =
            |v: usize| (0..100).map(|c| grown.curve(c)[v]).map(move |x| x.x.hypot(x.z)).fold(0.0, f64::max);
        assert!(reach(0) > 0.0095 && reach(0) <= 0.01 + 1e-12, "{}", reach(0));
        let centre = (0..100).map(|c| grown.curve(c)[0]).sum::<Vector3<f64>>() / 100.0;
        assert!(centre.norm() < 1e-3);
        let width = |v: usize| {
            let x = || (0..100).map(|c| grown.curve(c)[v].x);
            x().fold(f64::MIN, f64::max) - x().fold(f64::MAX, f64::min)
        };
        assert!(width(8) < 0.6 * width(0), "the clump closes: {} {}", width(8), width(0));
    }

    /// The offset of a grown strand does not turn with the curls of its guide.
    #[test]
    fn curls_stay_alike() {
        let curl = |u: f64| Vector3::new(0.01 * (40.0 * u).cos(), -0.2 * u, 0.01 * (40.0 * u).sin());
        let (guide, sections, arc) = one_guide(curl);
        let growth = Growth { per_guide: 7, vertices: 40, shorter: 0.0, clump: 0.0 };
        let (grown, _) = grow(&guide, &sections, &[0.004; 6], &arc, growth, None);
        let spline = ArcSpline::through(guide.curve(0)).unwrap();
        for c in 0..7 {
            let off: Vec<_> =
                (8..32).map(|v| grown.curve(c)[v] - spline.at(spline.length() * v as f64 / 39.0).x).collect();
            assert!(
                off.iter().all(|d| d.angle(&off[0]) < 0.9),
                "{:?}",
                off.iter().map(|d| d.angle(&off[0])).collect::<Vec<_>>()
            );
        }
    }

    #[test]
    fn roots_stand_on_the_scalp() {
        let (guide, sections, arc) = one_guide(|u| Vector3::new(0.2 * u, 0.1, 0.0));
        let mesh = crate::scene::TriMesh {
            vertices: [[-1.0, 0.1, -1.0], [0.0, 0.1, 1.5], [1.0, 0.1, -1.0]].map(Vector3::from).to_vec(),
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        };
        let scalp = Scalp::new(&mesh).unwrap();
        let (grown, _) = grow(&guide, &sections, &[0.01; 6], &arc, Growth::default(), Some(&scalp));
        assert!((0..50).all(|c| (grown.curve(c)[0].y - 0.1).abs() < 1e-9));
        assert!((0..50).any(|c| (grown.curve(c)[12].y - 0.1).abs() > 1e-3));
    }
}
