//! The hair of a style: guides, and render strands that come together in wisps and tufts.

use super::comb;
use super::head;
use super::scalp::{Chance, Root, roots};
use super::style::Cut;
use crate::math::point_tree::PointTree;
use crate::math::polyline;
use crate::math::smoothstep;
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
/// Number of guides with the nearest roots among which a strand finds one that it runs along.
const COMPANIONS: usize = 6;
/// Depth from which hair hangs before the face, m: no strand is led there that would not fall there by itself.
const FACE: f64 = 0.08;
/// Points before the place where a strand would leave its companion, along which it turns to run beside it.
const JOIN: usize = 8;
/// Shares of its distance at which a course runs on beside its companion, the first that the body allows.
const APARTS: [f64; 4] = [1.0, 0.6, 0.3, 0.0];

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

    /// Of the hairs with roots near a course the one that it runs along the farthest, the nearest of several,
    /// and the number of points up to which it does.
    fn companion(&self, course: &[V]) -> Option<(usize, usize)> {
        let near = self.nearest.least(&course[0], COMPANIONS, |_, squared| Some(squared));
        let along = |&(_, i): &(f64, usize)| (i, together(course, &self.courses[i]));
        near.iter().map(along).reduce(|best, next| if next.1 > best.1 { next } else { best })
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
    let hair = Hair::new(roots(count, 1), |root| {
        let mut course = comb::course(cut, root, cut.stray * strays(root));
        if let Some((guide, along)) = guides.companion(&course) {
            keep_along(&mut course, &guides.courses[guide], along);
        }
        course
    });
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
        let mut winds_with = root;
        if let Some((guide, _)) = guides.companion(&course) {
            gather(&mut course, &guides.courses[guide], cut.clump[0] * together);
            // Turns in step side by side make stripes, unless the whole wisp is one lock.
            if cut.guide_curl == cut.curl[0] {
                winds_with = &guides.roots[guide];
            }
        }
        comb::curl(&course, cut, [winds_with, root], cut.curl[0], cut.vertices[1])
    })
}

/// The points of the course `to`, and straight on from its end, at the arc lengths of the points of `course`; none
/// of a course that is a point.
fn beside(course: &[V], to: &[V]) -> Vec<V> {
    let Some(spline) = ArcSpline::through(to) else { return Vec::new() };
    let pace = polyline::length(course) / (course.len() - 1) as f64;
    let at = |s: f64| {
        let point = spline.at(s);
        point.x + point.tangent * (s - spline.length()).max(0.0)
    };
    (0..course.len()).map(|j| at(pace * j as f64)).collect()
}

/// Largest distance of points of two hairs that belong together, m, of which the roots are `root` apart.
fn most_apart(root: f64) -> f64 {
    APART.0 * root + APART.1
}

/// Number of points up to which a course belongs together with another.
fn together(course: &[V], to: &[V]) -> usize {
    let most = most_apart((course[0] - to[0]).norm());
    let near = |(x, beside): &(&V, V)| (*x - beside).norm() < most;
    course.iter().zip(beside(course, to)).take_while(near).count()
}

/// Lets a course that leaves its companion `to` after `along` points run on beside it, as near as the body
/// demands: over a shoulder all hairs of a wisp fall on the same side.
fn keep_along(course: &mut [V], to: &[V], along: usize) {
    if along < JOIN || along == course.len() {
        return;
    }
    let (join, beside) = (along - JOIN, beside(course, to));
    let offset = course[join] - beside[join];
    let share = |j: usize| smoothstep([join as f64, along as f64], j as f64);
    for apart in APARTS {
        let kept = |j: usize| course[j].lerp(&(beside[j] + offset * apart), share(j));
        let kept: Vec<V> = (join..course.len()).map(kept).collect();
        let clear = |(x, own): (&V, &V)| head::height(*x).0 > -DEEP && x.z < own.z.max(FACE);
        if kept.iter().zip(&course[join..]).all(clear) {
            course[join..].copy_from_slice(&kept);
            break;
        }
    }
}

/// Draws a course to another, by `share` at its tip and less towards its root, unless they part or this leads
/// through the body.
fn gather(course: &mut Vec<V>, to: &[V], share: f64) {
    let most = most_apart((course[0] - to[0]).norm());
    let last = (course.len() - 1) as f64;
    let drawn = |(i, (x, beside)): (usize, (&V, V))| {
        let (u, offset) = (i as f64 / last, beside - x);
        let drawn = x + offset * (share * u * (2.0 - u));
        (offset.norm() < most && head::height(drawn).0 > -DEEP).then_some(drawn)
    };
    let drawn: Option<Vec<V>> = course.iter().zip(beside(course, to)).enumerate().map(drawn).collect();
    *course = drawn.filter(|drawn| !drawn.is_empty()).unwrap_or_else(|| std::mem::take(course));
}
