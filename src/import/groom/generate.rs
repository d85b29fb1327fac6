//! Generates render strands around guides if the groom has none.

use super::resample::vertices_for_curls;
use super::scalp::Scalp;
use super::sections::Sections;
use crate::math::frame::rotation_minimising;
use crate::math::spline::ArcSpline;
use crate::scene::Curves;
use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;

/// The golden angle, rad: points at this angle and radius √i fill a disc evenly (Vogel 1979).
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
/// 1/φ: its multiples modulo 1 are evenly spread.
const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;

/// Share of a strand along which the correction of its root position fades out.
const ROOT_SHARE: f64 = 0.4;

/// Samples of the smoothed course of a guide.
const COURSE_SAMPLES: usize = 65;
/// Half width of the box filter that removes curls, samples.
const COURSE_WINDOW: usize = 6;
/// Passes of the box filter: three approximate a Gaussian.
const COURSE_PASSES: usize = 3;

/// Least number of vertices of a generated strand.
const LEAST_VERTICES: usize = 16;

/// How strands are generated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Generation {
    /// New strands around each guide.
    pub per_guide: usize,
    /// Vertices of each; `None` for 16, or as many as the curls of the guides need.
    pub vertices: Option<usize>,
    /// Largest relative shortening of a strand against its guide; 0 to 1.
    pub length_variation: f64,
    /// Share by which strands converge to their guide from root to tip: 0 for parallel strands, 1 for a
    /// point.
    pub clump: f64,
}

impl Default for Generation {
    fn default() -> Self {
        Generation { per_guide: 50, vertices: None, length_variation: 0.08, clump: 0.4 }
    }
}

/// Generates strands within the footprint of each guide (m, guides × sections at the fractions `arc`).
/// Returns the strands and the guide of each.
///
/// Strands are evenly spread over a disc, each at a fixed share of the footprint's radius, in frames that
/// follow the smoothed course of the guide rather than its curls, so that curls stay alike. With a scalp,
/// each root is placed as high above it as the root of its guide, and no strand is deeper in the head than
/// its guide.
pub(super) fn generate(
    guides: &Curves,
    sections: &Sections,
    footprint: &[f64],
    arc: &[f64],
    generation: Generation,
    scalp: Option<&Scalp>,
) -> (Curves, Vec<u32>) {
    let vertices = generation.vertices.unwrap_or_else(|| vertices_for_curls(guides, LEAST_VERTICES));
    let tuft = |g: usize| -> Vec<Vector3<f64>> {
        let footprint = &footprint[g * sections.count..(g + 1) * sections.count];
        let Some(tuft) = Tuft::new(g, guides.curve(g), arc, footprint) else { return Vec::new() };
        let mut points = Vec::with_capacity(generation.per_guide * vertices);
        for i in 0..generation.per_guide {
            let start = points.len();
            tuft.add_strand(i, generation, vertices, &mut points);
            if let Some(scalp) = scalp {
                lift_root(&mut points[start..], &tuft.guide.at(0.0).x, scalp);
                for (x, u) in points[start..].iter_mut().zip(tuft.fractions(i, generation, vertices)) {
                    *x += scalp.out(&tuft.guide.at(u * tuft.guide.length()).x, x);
                }
            }
        }
        points
    };
    let tufts: Vec<_> = (0..guides.len()).into_par_iter().map(tuft).collect();
    let guide_of_strand: Vec<u32> =
        tufts.iter().enumerate().flat_map(|(g, t)| vec![g as u32; t.len() / vertices]).collect();
    let curves = Curves {
        offsets: (0..=guide_of_strand.len()).map(|i| i * vertices).collect(),
        points: tufts.into_iter().flatten().collect(),
        id: (0..guide_of_strand.len() as i32).collect(),
        group: guide_of_strand.iter().map(|&g| guides.group[g as usize]).collect(),
        root_uv: guide_of_strand.iter().map(|&g| guides.root_uv[g as usize]).collect(),
        skin: Vec::new(),
    };
    (curves, guide_of_strand)
}

/// The strands around one guide.
struct Tuft<'a> {
    /// Index of the guide.
    index: usize,
    guide: ArcSpline,
    /// The guide without curls.
    course: ArcSpline,
    arc: &'a [f64],
    /// Footprint of the guide at the fractions `arc`, m.
    footprint: &'a [f64],
}

impl<'a> Tuft<'a> {
    /// `None` for a guide without length.
    fn new(index: usize, guide: &[Vector3<f64>], arc: &'a [f64], footprint: &'a [f64]) -> Option<Self> {
        let guide = ArcSpline::through(guide)?;
        let course = ArcSpline::through(&smooth_course(&guide))?;
        Some(Tuft { index, guide, course, arc, footprint })
    }

    /// Arc-length fractions of the guide at the vertices of strand `i`.
    fn fractions(
        &self,
        i: usize,
        generation: Generation,
        vertices: usize,
    ) -> impl Iterator<Item = f64> + use<> {
        let Generation { length_variation, .. } = generation;
        let cut = 1.0 - length_variation * (((i + self.index) as f64) * GOLDEN_RATIO).fract();
        (0..vertices).map(move |v| fraction(v, vertices) * cut)
    }

    /// Appends the vertices of strand `i`.
    fn add_strand(&self, i: usize, generation: Generation, vertices: usize, points: &mut Vec<Vector3<f64>>) {
        let Generation { per_guide, clump, .. } = generation;
        let g = self.index;
        // Each tuft is rotated by its own angle, so that neighbours differ.
        let angle = (i as f64 + g as f64 * GOLDEN_RATIO) * GOLDEN_ANGLE;
        let share = ((i as f64 + 0.5) / per_guide as f64).sqrt();
        let along: Vec<f64> = self.fractions(i, generation, vertices).collect();
        let on_course: Vec<f64> = along.iter().map(|a| a * self.course.length()).collect();
        let frames: Vec<UnitQuaternion<f64>> = rotation_minimising(&self.course, &on_course, None);
        for (frame, &a) in frames.iter().zip(&along) {
            let radius = share * interpolate(self.arc, self.footprint, a) * (1.0 - clump * a);
            let offset = Vector3::new(angle.cos(), angle.sin(), 0.0) * radius;
            points.push(self.guide.at(a * self.guide.length()).x + frame * offset);
        }
    }
}

/// Moves the root of a strand to the height of its guide's root above the scalp; the displacement fades out
/// along the strand.
fn lift_root(strand: &mut [Vector3<f64>], guide_root: &Vector3<f64>, scalp: &Scalp) {
    let vertices = strand.len();
    let lift = scalp.lift(guide_root, &strand[0]);
    for (v, x) in strand.iter_mut().enumerate() {
        *x += lift * (1.0 - fraction(v, vertices) / ROOT_SHARE).max(0.0).powi(2);
    }
}

/// Position of vertex `v` along a strand, 0 to 1.
fn fraction(v: usize, vertices: usize) -> f64 {
    v as f64 / (vertices - 1) as f64
}

/// The course of a strand without its curls: [`COURSE_SAMPLES`] points under a box filter that narrows
/// towards the ends, so that root and tip stay in place.
fn smooth_course(spline: &ArcSpline) -> Vec<Vector3<f64>> {
    let last = COURSE_SAMPLES - 1;
    let mut points: Vec<_> =
        (0..=last).map(|i| spline.at(spline.length() * i as f64 / last as f64).x).collect();
    for _ in 0..COURSE_PASSES {
        let mean = |i: usize| {
            let half = COURSE_WINDOW.min(i).min(last - i);
            points[i - half..=i + half].iter().sum::<Vector3<f64>>() / (2 * half + 1) as f64
        };
        points = (0..=last).map(mean).collect();
    }
    points
}

/// Piecewise linear interpolation of `values` at the increasing positions `at`.
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
        let curves = Curves {
            offsets: vec![0, 65],
            points,
            id: vec![4],
            group: vec![0],
            root_uv: vec![[0.5, 0.25]],
            skin: Vec::new(),
        };
        let arc = Tree::default_arc(6);
        (curves.clone(), Sections::of(&curves, &arc), arc)
    }

    #[test]
    fn strands_fill_the_footprint_and_no_more() {
        let (guide, sections, arc) = one_guide(|u| Vector3::new(0.0, -0.2 * u, 0.02 * u * u));
        let generation = Generation { per_guide: 100, vertices: Some(9), length_variation: 0.1, clump: 0.5 };
        let (generated, guide_of_strand) = generate(&guide, &sections, &[0.01; 6], &arc, generation, None);
        assert_eq!((generated.len(), guide_of_strand), (100, vec![0; 100]));
        assert_eq!(generated.root_uv[99], [0.5, 0.25]);
        let reach = |v: usize| {
            (0..100).map(|c| generated.curve(c)[v]).map(move |x| x.x.hypot(x.z)).fold(0.0, f64::max)
        };
        assert!(reach(0) > 0.0095 && reach(0) <= 0.01 + 1e-12, "{}", reach(0));
        let centre = (0..100).map(|c| generated.curve(c)[0]).sum::<Vector3<f64>>() / 100.0;
        assert!(centre.norm() < 1e-3);
        let width = |v: usize| {
            let x = || (0..100).map(|c| generated.curve(c)[v].x);
            x().fold(f64::MIN, f64::max) - x().fold(f64::MAX, f64::min)
        };
        assert!(width(8) < 0.6 * width(0), "strands converge: {} {}", width(8), width(0));
    }

    #[test]
    fn offsets_do_not_rotate_with_the_curls_of_the_guide() {
        let curl = |u: f64| Vector3::new(0.01 * (40.0 * u).cos(), -0.2 * u, 0.01 * (40.0 * u).sin());
        let (guide, sections, arc) = one_guide(curl);
        let generation = Generation { per_guide: 7, vertices: Some(40), length_variation: 0.0, clump: 0.0 };
        let (generated, _) = generate(&guide, &sections, &[0.004; 6], &arc, generation, None);
        let spline = ArcSpline::through(guide.curve(0)).unwrap();
        for c in 0..7 {
            let off: Vec<_> = (8..32)
                .map(|v| generated.curve(c)[v] - spline.at(spline.length() * v as f64 / 39.0).x)
                .collect();
            assert!(
                off.iter().all(|d| d.angle(&off[0]) < 0.9),
                "{:?}",
                off.iter().map(|d| d.angle(&off[0])).collect::<Vec<_>>()
            );
        }
    }

    #[test]
    fn roots_lie_on_the_scalp() {
        let (guide, sections, arc) = one_guide(|u| Vector3::new(0.2 * u, 0.1, 0.0));
        let mesh = crate::geometry::TriMesh {
            vertices: [[-1.0, 0.1, -1.0], [0.0, 0.1, 1.5], [1.0, 0.1, -1.0]].map(Vector3::from).to_vec(),
            triangles: vec![[0, 1, 2]],
        };
        let scalp = Scalp::new(&mesh).unwrap();
        let (generated, _) =
            generate(&guide, &sections, &[0.01; 6], &arc, Generation::default(), Some(&scalp));
        assert!((0..50).all(|c| (generated.curve(c)[0].y - 0.1).abs() < 1e-9));
        assert!((0..50).any(|c| (generated.curve(c)[12].y - 0.1).abs() > 1e-3));
    }

    #[test]
    fn strands_are_not_deeper_in_the_head_than_their_guide() {
        // A guide that rises from the ground, and lies 2 mm above it where its tuft is 1 cm thick.
        let (guide, sections, arc) = one_guide(|u| Vector3::new(0.2 * u, (0.02 * u).min(2e-3), 0.0));
        let mesh = crate::geometry::TriMesh {
            vertices: [[-1.0, 0.0, -1.0], [0.0, 0.0, 1.5], [1.0, 0.0, -1.0]].map(Vector3::from).to_vec(),
            triangles: vec![[0, 1, 2]],
        };
        let deepest = |scalp: Option<&Scalp>| {
            let (strands, _) = generate(&guide, &sections, &[0.01; 6], &arc, Generation::default(), scalp);
            strands.points.iter().map(|x| -x.y).fold(0.0, f64::max)
        };
        assert!(deepest(None) > 5e-3);
        assert!(deepest(Scalp::new(&mesh).as_ref()) < 1e-9);
    }
}
