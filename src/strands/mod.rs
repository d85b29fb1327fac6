//! Render strands from guide strands, in strain space (S18; `docs/theory.md` §7).
//!
//! A render strand keeps its own shape as a chain of rigid edges. What its guides deviate from their rest shape is
//! turned into the strand's own frame, blended, and added to the turns from edge to edge. Curls stay curls, no
//! edge changes its length, and at rest the strand is the groom's, to rounding.

mod follow;

use crate::math::se3;
use crate::rod::Rod;
use crate::scene::Curves;
use follow::{Follow, RestGuide};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Guides that one render strand follows, at most.
const FOLLOWED: usize = 3;

/// Render strands, ready to be rebuilt from the guides at any moment.
#[derive(Debug, Clone)]
pub struct Interpolator {
    strands: Vec<Strand>,
    offsets: Vec<usize>,
}

/// What a guide does at one moment.
#[derive(Debug, Clone, Copy)]
pub struct GuideMotion<'a> {
    /// Deviation of the strain at its nodes, 1/m (the rod's unknowns).
    pub q: &'a [f64],
    /// Rate of `q`, 1/(m·s).
    pub rate: &'a [f64],
}

/// How the head, and with it every root, moves at one moment: rest space to world.
#[derive(Debug, Clone, Copy)]
pub struct HeadMotion {
    /// Rotation.
    pub rotation: Matrix3<f64>,
    /// Translation, m.
    pub translation: Vector3<f64>,
    /// Angular velocity, rad/s, world axes.
    pub spin: Vector3<f64>,
    /// Velocity of the point of the head that is at the rest origin, m/s.
    pub velocity: Vector3<f64>,
}

impl HeadMotion {
    /// World position and velocity of a point of rest space that is fixed to the head.
    pub fn carry(&self, p: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let arm = self.rotation * p;
        (arm + self.translation, self.velocity + self.spin.cross(&arm))
    }
}

/// A render strand at rest: root, frame of the first edge, then for every edge its length and the turn into it from
/// the edge before (rotation vector in the material frame; zero for the first).
#[derive(Debug, Clone)]
struct Strand {
    root: Vector3<f64>,
    frame: Matrix3<f64>,
    turn: Vec<Vector3<f64>>,
    length: Vec<f64>,
    follow: Vec<Follow>,
}

impl Interpolator {
    /// Prepares the strands `curves`, whose leaf wisps are `leaf`, to follow `guides`: each guide's rod with its leaf.
    ///
    /// A strand follows the guides of its own leaf, the three of nearest root if there are more, weighted by the inverse
    /// square of the distance of the roots; a strand whose leaf holds no guide follows the nearest guide of all.
    pub fn new(curves: &Curves, leaf: &[(u32, u32)], guides: &[(&Rod, (u32, u32))]) -> Self {
        let rest: Vec<RestGuide> = guides.par_iter().map(|(rod, _)| RestGuide::new(rod)).collect();
        let mut by_leaf: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
        for (i, (_, leaf)) in guides.iter().enumerate() {
            by_leaf.entry(*leaf).or_default().push(i);
        }
        let all: Vec<usize> = (0..guides.len()).collect();
        let strands = (0..curves.len())
            .into_par_iter()
            .map(|c| {
                let points = curves.curve(c);
                let (candidates, most) = match by_leaf.get(&leaf[c]) {
                    Some(own) => (own, FOLLOWED),
                    None => (&all, 1),
                };
                let mut near: Vec<(f64, usize)> =
                    candidates.iter().map(|&g| ((rest[g].root() - points[0]).norm(), g)).collect();
                near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                near.truncate(most);
                Strand::new(points, &near, &rest)
            })
            .collect();
        Interpolator { strands, offsets: curves.offsets.clone() }
    }

    /// Writes the points and velocities (per second) of all strands, `to_scene` being what turns metres, Y up, into the
    /// unit and axes asked for. Shapes: one entry per vertex of the curves given to [`Interpolator::new`].
    pub fn evaluate(
        &self,
        head: &HeadMotion,
        guides: &[GuideMotion],
        to_scene: &Matrix3<f64>,
        points: &mut [[f32; 3]],
        velocities: &mut [[f32; 3]],
    ) {
        let mut cut = Vec::with_capacity(self.strands.len());
        let (mut p, mut v) = (points, velocities);
        for (strand, w) in self.strands.iter().zip(self.offsets.windows(2)) {
            let (p0, p1) = p.split_at_mut(w[1] - w[0]);
            let (v0, v1) = v.split_at_mut(w[1] - w[0]);
            cut.push((strand, p0, v0));
            (p, v) = (p1, v1);
        }
        cut.into_par_iter()
            .with_min_len(64)
            .for_each(|(strand, p, v)| strand.evaluate(head, guides, to_scene, p, v));
    }
}

impl Strand {
    fn new(points: &[Vector3<f64>], near: &[(f64, usize)], rest: &[RestGuide]) -> Self {
        let edges: Vec<Vector3<f64>> = points.windows(2).map(|w| w[1] - w[0]).collect();
        let length: Vec<f64> = edges.iter().map(|e| e.norm()).collect();
        // An edge of no length keeps the direction of its predecessor.
        let mut direction = edges.iter().find_map(|e| e.try_normalize(0.0)).unwrap_or(Vector3::z());
        let mut frames: Vec<Matrix3<f64>> = Vec::with_capacity(edges.len());
        let mut turn = Vec::with_capacity(edges.len());
        for e in &edges {
            direction = e.try_normalize(1e-12).unwrap_or(direction);
            let frame = match frames.last() {
                None => follow::any_frame(&direction),
                Some(last) => follow::transport(&last.column(2).into(), &direction) * last,
            };
            turn.push(
                frames.last().map_or(Vector3::zeros(), |last| se3::log_so3(&(last.transpose() * frame))),
            );
            frames.push(frame);
        }
        // Roots closer than this to a guide's follow that guide alone, smoothly.
        let soft = 1e-4;
        let weights: Vec<f64> = near.iter().map(|(d, _)| 1.0 / (d * d + soft * soft)).collect();
        let sum: f64 = weights.iter().sum();
        let follow = near
            .iter()
            .zip(&weights)
            .map(|((_, g), w)| Follow::new(*g, w / sum, &rest[*g], &frames, &turn, &length))
            .collect();
        Strand { root: points[0], frame: frames[0], turn, length, follow }
    }

    fn evaluate(
        &self,
        head: &HeadMotion,
        guides: &[GuideMotion],
        to_scene: &Matrix3<f64>,
        points: &mut [[f32; 3]],
        velocities: &mut [[f32; 3]],
    ) {
        let (mut x, mut v) = head.carry(&self.root);
        let mut frame = head.rotation * self.frame;
        let mut spin = head.spin;
        points[0] = single(&(to_scene * x));
        velocities[0] = single(&(to_scene * v));
        for (j, (turn, length)) in self.turn.iter().zip(&self.length).enumerate() {
            let (mut d, mut rate) = (Vector3::zeros(), Vector3::zeros());
            for f in &self.follow {
                let (fd, fr) = f.deviation(j, &guides[f.guide]);
                d += fd;
                rate += fr;
            }
            let phi = turn + d;
            spin += frame * (se3::left_jacobian_so3(&phi) * rate);
            frame *= se3::exp_so3(&phi);
            let edge = frame.column(2) * *length;
            x += edge;
            v += spin.cross(&edge);
            points[j + 1] = single(&(to_scene * x));
            velocities[j + 1] = single(&(to_scene * v));
        }
    }
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{RodSource, Shape};

    const LEAF: (u32, u32) = (0, 0);

    fn helix(n: usize, phase: f64) -> Vec<Vector3<f64>> {
        (0..n)
            .map(|i| {
                let a = i as f64 / (n - 1) as f64 * 6.0;
                Vector3::new(
                    0.01 * ((a + phase).cos() - phase.cos()),
                    -0.03 * a,
                    0.01 * ((a + phase).sin() - phase.sin()),
                )
            })
            .collect()
    }

    fn rod(points: &[Vector3<f64>]) -> Rod {
        let arc: Vec<f64> = (0..8).map(|i| (i as f64 / 7.0).powf(1.5)).collect();
        Rod::new(&RodSource {
            points,
            root_frame: None,
            arc: &arc,
            stiffness: [8e-9, 8e-9, 4e-9],
            line_density: 6.6e-6,
            damping: 0.0,
            natural: None,
            max_step: 0.005,
        })
        .unwrap()
    }

    fn still() -> HeadMotion {
        HeadMotion {
            rotation: Matrix3::identity(),
            translation: Vector3::zeros(),
            spin: Vector3::zeros(),
            velocity: Vector3::zeros(),
        }
    }

    fn curves(strands: &[Vec<Vector3<f64>>]) -> Curves {
        let mut c = Curves { offsets: vec![0], ..Curves::default() };
        for (i, s) in strands.iter().enumerate() {
            c.points.extend(s);
            c.offsets.push(c.points.len());
            c.id.push(i as i32);
        }
        c
    }

    fn run(
        c: &Curves,
        rods: &[&Rod],
        q: &[Vec<f64>],
        rate: &[Vec<f64>],
        head: &HeadMotion,
    ) -> [Vec<[f32; 3]>; 2] {
        let guides: Vec<_> = rods.iter().map(|r| (*r, LEAF)).collect();
        let interpolator = Interpolator::new(c, &vec![LEAF; c.len()], &guides);
        let motion: Vec<_> = q.iter().zip(rate).map(|(q, rate)| GuideMotion { q, rate }).collect();
        let mut out = [vec![[0.0; 3]; c.points.len()], vec![[0.0; 3]; c.points.len()]];
        let [p, v] = &mut out;
        interpolator.evaluate(head, &motion, &Matrix3::identity(), p, v);
        out
    }

    fn wide(p: &[f32; 3]) -> Vector3<f64> {
        Vector3::new(p[0].into(), p[1].into(), p[2].into())
    }

    #[test]
    fn rest_is_the_groom_and_edges_keep_their_length() {
        let strands = [helix(16, 0.0), helix(24, 1.0)];
        let r = rod(&strands[0]);
        let c = curves(&strands);
        let zero = vec![0.0; r.unknowns()];
        let [p, _] = run(&c, &[&r], std::slice::from_ref(&zero), std::slice::from_ref(&zero), &still());
        for (a, b) in p.iter().zip(&c.points) {
            assert!((wide(a) - b).norm() < 1e-7);
        }
        let q: Vec<f64> = (0..r.unknowns()).map(|i| (i as f64).sin() * 15.0).collect();
        let [p, _] = run(&c, &[&r], &[q], &[zero], &still());
        for s in 0..2 {
            let range = c.offsets[s]..c.offsets[s + 1];
            for (a, b) in p[range.clone()].windows(2).zip(c.points[range].windows(2)) {
                let rest = (b[1] - b[0]).norm();
                assert!(((wide(&a[1]) - wide(&a[0])).norm() / rest - 1.0).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_strand_on_its_guide_stays_on_it() {
        // Second order in the edges: 4 times closer with edges half as long.
        let off = |n: usize| {
            let points = helix(n, 0.0);
            let r = rod(&helix(200, 0.0));
            let q: Vec<f64> = (0..r.unknowns()).map(|i| (i as f64 * 0.7).sin() * 8.0).collect();
            let zero = vec![0.0; q.len()];
            let [p, _] = run(&curves(&[points]), &[&r], std::slice::from_ref(&q), &[zero], &still());
            let mut shape = Shape::default();
            shape.update(&r, &r.root.r, &q);
            (wide(&p[n - 1]) - shape.x(r.points() - 1)).norm() / r.length()
        };
        let (coarse, fine) = (off(17), off(33));
        assert!(coarse < 0.02 && fine < 0.35 * coarse, "{coarse} {fine}");
    }

    #[test]
    fn velocities_are_the_slopes_of_the_points() {
        let strands = [helix(16, 0.3), helix(16, 2.0)];
        let rods = [rod(&strands[0]), rod(&strands[1])];
        let c = curves(&[helix(16, 1.0)]);
        let q: Vec<Vec<f64>> =
            rods.iter().map(|r| (0..r.unknowns()).map(|i| (i as f64).cos() * 10.0).collect()).collect();
        let rate: Vec<Vec<f64>> =
            q.iter().map(|q| (0..q.len()).map(|i| (i as f64 * 1.3).sin() * 40.0).collect()).collect();
        let spin = Vector3::new(3.0, -1.0, 2.0);
        let at = |t: f64| {
            let q: Vec<Vec<f64>> =
                q.iter().zip(&rate).map(|(q, r)| q.iter().zip(r).map(|(q, r)| q + t * r).collect()).collect();
            let head = HeadMotion {
                rotation: se3::exp_so3(&(spin * t)),
                translation: Vector3::new(0.2, -0.1, 0.4) * t,
                spin,
                velocity: Vector3::new(0.2, -0.1, 0.4),
            };
            run(&c, &[&rods[0], &rods[1]], &q, &rate, &head)
        };
        let t = 2e-3;
        let [_, v] = at(0.0);
        let ([hi, _], [lo, _]) = (at(t), at(-t));
        for i in 0..v.len() {
            let slope = (wide(&hi[i]) - wide(&lo[i])) / (2.0 * t);
            assert!((slope - wide(&v[i])).norm() < 2e-3 * (1.0 + slope.norm()), "{i}: {slope} {:?}", v[i]);
        }
    }
}
