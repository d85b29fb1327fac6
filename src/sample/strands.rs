//! The hair of a style: guides, and render strands that come together in wisps and tufts.

use super::comb;
use super::head;
use super::scalp::{Chance, Root, roots};
use super::style::Cut;
use crate::math::point_tree::PointTree;
use crate::math::polyline;
use crate::math::spline::ArcSpline;
use crate::scene::Curves;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

type V = Vector3<f64>;

/// Strands of a tuft, on average.
const TUFT: usize = 7;
/// Share of strands that fly away, and how much farther than others they stray.
const FLYAWAYS: (f64, f64) = (0.03, 3.0);
/// Hairs that are farther apart somewhere than so many times the distance of their roots, and this distance,
/// m, do not come together: a parting is between them.
const APART: (f64, f64) = (3.0, 0.02);

/// Depth, m, from which hair is not lifted out of the body: it might come out on the other side.
const DEEP: f64 = 0.004;

/// Hairs before they are curled.
pub(super) struct Hair {
    roots: Vec<Root>,
    courses: Vec<Vec<V>>,
    nearest: PointTree,
}

impl Hair {
    fn new(roots: Vec<Root>, course: impl Fn(&Root) -> Vec<V> + Send + Sync) -> Self {
        let courses = roots.par_iter().map(course).collect();
        let nearest = PointTree::new(roots.iter().map(|root| root.x).collect());
        Hair { roots, courses, nearest }
    }

    /// The hair whose root is nearest to `x`.
    fn nearest(&self, x: &V) -> Option<usize> {
        self.nearest.least(x, 1, |_, squared| Some(squared)).first().map(|(_, i)| *i)
    }

    /// The hairs as curves, of which `points` gives those of each.
    fn curves(&self, points: impl Fn(usize) -> Vec<V> + Send + Sync) -> Curves {
        let mut out = Curves { offsets: vec![0], ..Curves::default() };
        let points: Vec<Vec<V>> = (0..self.roots.len()).into_par_iter().map(points).collect();
        for (i, (root, points)) in self.roots.iter().zip(points).enumerate() {
            out.points.extend(points);
            out.offsets.push(out.points.len());
            out.id.push(i as i32);
            out.group.push(0);
            let d = root.direction;
            let (azimuth, elevation) = (d.x.atan2(d.z), d.y.asin());
            out.root_uv.push([(0.5 + azimuth / TAU) as f32, (0.5 + elevation / PI) as f32]);
        }
        out
    }
}

/// Grows the hair of `count` guides.
pub(super) fn guide_hair(cut: &Cut, count: usize) -> Hair {
    Hair::new(roots(count, 0), |root| comb::course(cut, root, 0.0))
}

/// Makes the guides, m, rest space.
pub(super) fn guides(cut: &Cut, hair: &Hair) -> Curves {
    hair.curves(|i| {
        let seed = [&hair.roots[i]; 2];
        comb::curl(&hair.courses[i], cut, seed, cut.guide_curl, cut.vertices[0])
    })
}

/// Makes `count` render strands around the hair of the guides, m, rest space.
pub(super) fn strands(cut: &Cut, count: usize, guides: &Hair) -> Curves {
    let strays = |root: &Root| if root.random(Chance::Flyaway) < FLYAWAYS.0 { FLYAWAYS.1 } else { 1.0 };
    let hair = Hair::new(roots(count, 1), |root| comb::course(cut, root, cut.stray * strays(root)));
    let tufts: Vec<usize> = (0..count).step_by(TUFT).collect();
    let of_tuft = PointTree::new(tufts.iter().map(|&i| hair.roots[i].x).collect());
    hair.curves(|i| {
        let root = &hair.roots[i];
        let mut course = hair.courses[i].clone();
        let together = if strays(root) > 1.0 { 0.0 } else { 0.5 + 0.5 * root.random(Chance::Together) };
        let tuft = of_tuft.least(&root.x, 1, |_, squared| Some(squared));
        for (_, tuft) in tuft {
            gather(&mut course, &hair.courses[tufts[tuft]], cut.clump[1] * together);
        }
        let mut wisp = root;
        if let Some(guide) = guides.nearest(&root.x) {
            gather(&mut course, &guides.courses[guide], cut.clump[0] * together);
            wisp = &guides.roots[guide];
        }
        comb::curl(&course, cut, [wisp, root], cut.curl[0], cut.vertices[1])
    })
}

/// Draws a course to another, by `share` at its tip and less towards its root, unless this leads through the
/// body.
fn gather(course: &mut Vec<V>, to: &[V], share: f64) {
    let Some(spline) = ArcSpline::through(to) else { return };
    let root = (course[0] - to[0]).norm();
    let (length, last) = (polyline::length(course), (course.len() - 1) as f64);
    let drawn: Option<Vec<V>> = course
        .iter()
        .enumerate()
        .map(|(i, x)| {
            let u = i as f64 / last;
            let offset = spline.at((length * u).min(spline.length())).x - x;
            let drawn = x + offset * (share * u * (2.0 - u));
            let together = offset.norm() < APART.0 * root + APART.1;
            (together && head::height(drawn).0 > -DEEP).then_some(drawn)
        })
        .collect();
    *course = drawn.unwrap_or_else(|| std::mem::take(course));
}
