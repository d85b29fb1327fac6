//! Render strands from guide strands, in strain space (S18; `docs/theory.md` §7).
//!
//! A render strand keeps its own shape as a chain of rigid edges. What its guides deviate from their rest shape is
//! turned into the strand's own frame, blended, and added to the turns from edge to edge. Curls stay curls, no
//! edge changes its length, and at rest the strand is the groom's, to rounding.

mod follow;
mod keep_out;

use crate::contact::Bodies;
use crate::math::frame::{any_frame, transport};
use crate::math::se3;
use crate::rod::{Rod, Shape};
use crate::scene::Curves;
use follow::{Follow, RestGuide};
pub use keep_out::KeepOut;
use keep_out::{FreeEdge, Kept, Lean, Spare};
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
    /// The guide.
    pub rod: &'a Rod,
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
    /// Point of the rod of the foremost guide (the first of `follow`) that is beside the middle of each edge.
    beside: Vec<u32>,
    kept: Kept,
}

/// A moment at which strands are rebuilt: the head, and what to keep out of.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Motion of the head.
    pub head: HeadMotion,
    /// The bodies; none where it holds none.
    pub keep_out: KeepOut<'a>,
}

/// How much earlier than the moment asked for a strand that leans on a body is rebuilt, s, to take its velocity from the
/// difference: the leaning has no derivative of its own.
pub const BACKWARD: f64 = 1e-4;

impl Interpolator {
    /// Prepares the strands `curves`, whose leaf wisps are `leaf`, to follow `guides`: each guide's rod with its leaf.
    ///
    /// A strand follows the guides of its own leaf, the three of nearest root if there are more, weighted by the inverse
    /// square of the distance of the roots; a strand whose leaf holds no guide follows the nearest guide of all.
    ///
    /// `bodies` at rest, with what is kept from each (`thickness`, m), tell how close to them each strand was drawn.
    pub fn new(
        curves: &Curves,
        leaf: &[(u32, u32)],
        guides: &[(&Rod, (u32, u32))],
        bodies: &Bodies,
        thickness: &[f64],
    ) -> Self {
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
                Strand::new(points, &near, &rest, Kept::new(bodies, thickness, points))
            })
            .collect();
        Interpolator { strands, offsets: curves.offsets.clone() }
    }

    /// Writes the points and velocities (per second) of all strands, `to_scene` being what turns metres, Y up, into the
    /// unit and axes asked for. `moments` are now and [`BACKWARD`] earlier. Shapes: one entry per vertex of the curves given to
    /// [`Interpolator::new`].
    pub fn evaluate(
        &self,
        moments: &[Moment; 2],
        guides: &[GuideMotion],
        to_scene: &Matrix3<f64>,
        points: &mut [[f32; 3]],
        velocities: &mut [[f32; 3]],
    ) {
        let lines = [0, 1].map(|i| lines(&moments[i].head, guides, BACKWARD * i as f64));
        let mut cut = Vec::with_capacity(self.strands.len());
        let (mut p, mut v) = (points, velocities);
        for (strand, w) in self.strands.iter().zip(self.offsets.windows(2)) {
            let (p0, p1) = p.split_at_mut(w[1] - w[0]);
            let (v0, v1) = v.split_at_mut(w[1] - w[0]);
            cut.push((strand, p0, v0));
            (p, v) = (p1, v1);
        }
        cut.into_par_iter().with_min_len(64).for_each_init(Tracks::default, |tracks, (strand, p, v)| {
            let leans = strand.trace(&moments[0], guides, &lines[0], 0.0, &mut tracks.now, &mut tracks.spare);
            if leans {
                strand.trace(&moments[1], guides, &lines[1], BACKWARD, &mut tracks.before, &mut tracks.spare);
                for (now, before) in tracks.now.iter_mut().zip(&tracks.before) {
                    now.1 = (now.0 - before.0) / BACKWARD;
                }
            }
            for ((p, v), (x, dx)) in p.iter_mut().zip(v).zip(&tracks.now) {
                (*p, *v) = (single(&(to_scene * x)), single(&(to_scene * dx)));
            }
        });
    }
}

/// Points and velocities of one strand now and a little earlier, and room for the two chains of a leaning one.
#[derive(Debug, Default)]
struct Tracks {
    now: Track,
    before: Track,
    spare: [Spare; 2],
}

/// Points of a guide's rod and the guide's direction at each, world, m.
type Line = Vec<(Vector3<f64>, Vector3<f64>)>;

/// Points of a strand and their velocities, world, m and m/s.
type Track = Vec<(Vector3<f64>, Vector3<f64>)>;

/// Where the guides stand, `back`, s, before their motion's own moment.
fn lines(head: &HeadMotion, guides: &[GuideMotion], back: f64) -> Vec<Line> {
    guides
        .par_iter()
        .with_min_len(16)
        .map_init(
            || (Shape::default(), Vec::new()),
            |(shape, q), g| {
                q.clear();
                q.extend(g.q.iter().zip(g.rate).map(|(q, rate)| q - rate * back));
                shape.update(g.rod, &(head.rotation * g.rod.root.r), q);
                let (root, _) = head.carry(&g.rod.root.p);
                (0..shape.points()).map(|k| (root + shape.x(k), shape.tangent(k))).collect()
            },
        )
        .collect()
}

impl Strand {
    fn new(points: &[Vector3<f64>], near: &[(f64, usize)], rest: &[RestGuide], kept: Kept) -> Self {
        let edges: Vec<Vector3<f64>> = points.windows(2).map(|w| w[1] - w[0]).collect();
        let length: Vec<f64> = edges.iter().map(|e| e.norm()).collect();
        // An edge of no length keeps the direction of its predecessor.
        let mut direction = edges.iter().find_map(|e| e.try_normalize(0.0)).unwrap_or(Vector3::z());
        let mut frames: Vec<Matrix3<f64>> = Vec::with_capacity(edges.len());
        let mut turn = Vec::with_capacity(edges.len());
        for e in &edges {
            direction = e.try_normalize(1e-12).unwrap_or(direction);
            let frame = match frames.last() {
                None => any_frame(&direction),
                Some(last) => transport(&last.column(2).into(), &direction) * last,
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
        let mut middle = 0.0;
        let beside = length
            .iter()
            .map(|l| {
                middle += l;
                rest[near[0].1].nearest(middle - 0.5 * l)
            })
            .collect();
        Strand { root: points[0], frame: frames[0], turn, length, follow, beside, kept }
    }

    /// Rebuilds the strand at a moment, the guides, which stand along `lines`, being `back`, s, before their motion's own; positions
    /// and velocities, m and m/s. Whether it leans on a body, in which case the velocities are not those of the leaning.
    fn trace(
        &self,
        moment: &Moment,
        guides: &[GuideMotion],
        lines: &[Line],
        back: f64,
        out: &mut Track,
        spare: &mut [Spare; 2],
    ) -> bool {
        let Moment { head, keep_out } = moment;
        let (mut x, mut v) = head.carry(&self.root);
        let mut frame = head.rotation * self.frame;
        let mut spin = head.spin;
        let mut lean: Option<Lean> = None;
        for spare in spare.iter_mut() {
            spare.clear();
            spare.resize(keep_out.poses.len(), 0.0);
        }
        let [spare, spare_leaning] = spare;
        out.clear();
        out.push((x, v));
        for (j, (turn, &length)) in self.turn.iter().zip(&self.length).enumerate() {
            let (mut d, mut rate) = (Vector3::zeros(), Vector3::zeros());
            for f in &self.follow {
                let (fd, fr) = f.deviation(j, &guides[f.guide]);
                d += fd - fr * back;
                rate += fr;
            }
            let phi = turn + d;
            spin += frame * (se3::left_jacobian_so3(&phi) * rate);
            frame *= se3::exp_so3(&phi);
            let (start, edge) = (x, frame.column(2) * length);
            x += edge;
            v += spin.cross(&edge);
            let place = (j + 1, self.length.len() + 1);
            let violation = match &lean {
                Some(lean) if lean.on_guide() => 0.0,
                _ => keep_out.violation(&self.kept, place, &x, length, spare),
            };
            if violation > 0.0 && lean.is_none() {
                lean = Some(Lean::from(start));
            }
            let end = lean.as_mut().map_or(x, |lean| {
                let guide = lines[self.follow[0].guide][self.beside[j] as usize];
                let free = FreeEdge { start, edge, violation, guide };
                lean.advance(keep_out, &self.kept, place, length, &free, spare_leaning)
            });
            out.push((end, v));
        }
        lean.is_some()
    }
}

fn single(v: &Vector3<f64>) -> [f32; 3] {
    v.cast::<f32>().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{Cut, RodSource, Shape};
    use nalgebra::Isometry3;

    const LEAF: (u32, u32) = (0, 0);

    /// Across the plane in which equal entries of a rod along x bend it, m.
    const BESIDE: Vector3<f64> = Vector3::new(0.0, 0.055, 0.055);

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
            cut: Cut { length: 0.005, ..Cut::FINE },
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
        let bodies = Bodies::from_shapes(&[]);
        let interpolator = Interpolator::new(c, &vec![LEAF; c.len()], &guides, &bodies, &[]);
        let moment = Moment { head: *head, keep_out: KeepOut { bodies: &bodies, time: 0.0, poses: &[] } };
        let motion: Vec<_> =
            rods.iter().zip(q).zip(rate).map(|((&rod, q), rate)| GuideMotion { rod, q, rate }).collect();
        let mut out = [vec![[0.0; 3]; c.points.len()], vec![[0.0; 3]; c.points.len()]];
        let [p, v] = &mut out;
        interpolator.evaluate(&[moment, moment], &motion, &Matrix3::identity(), p, v);
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
    fn a_strand_beside_its_guide_turns_as_the_guide_does() {
        // Standing off across the guide, where a deviation carried along the smallest turn between the tangents fails.
        let line: Vec<_> = (0..200).map(|i| Vector3::x() * (0.2 * f64::from(i) / 199.0)).collect();
        let r = rod(&line);
        let across: Vec<_> =
            (0..129).map(|i| (Vector3::y() + Vector3::x()) * (0.14 * f64::from(i) / 128.0)).collect();
        let q: Vec<f64> = (0..r.unknowns()).map(|i| (i as f64 * 0.7).sin() * 8.0).collect();
        let zero = vec![0.0; q.len()];
        let [p, _] =
            run(&curves(std::slice::from_ref(&across)), &[&r], std::slice::from_ref(&q), &[zero], &still());
        let mut shape = Shape::default();
        shape.update(&r, &r.root.r, &q);
        let turn = shape.poses().last().unwrap().r * r.root.r.transpose();
        let rest = (across[128] - across[127]).normalize();
        let now = (wide(&p[128]) - wide(&p[127])).normalize();
        assert!((now - rest).norm() > 0.1, "does not turn");
        assert!((now - turn * rest).norm() < 0.01, "{now} {}", turn * rest);
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

    #[test]
    fn a_strand_is_turned_out_of_a_body_and_keeps_its_length_and_velocity() {
        use crate::scene::Shape as Solid;
        // A straight strand that its guide, which passes beside it, bends into a ball.
        let line: Vec<_> = (0..33).map(|i| Vector3::x() * (0.2 * f64::from(i) / 32.0)).collect();
        let r = rod(&line.iter().map(|p| p + BESIDE).collect::<Vec<_>>());
        let c = curves(&[line]);
        let q: Vec<f64> = (0..r.unknowns()).map(|i| if i % 3 == 2 { 0.0 } else { 12.0 }).collect();
        let rate: Vec<f64> = q.iter().map(|q| 8.0 * q).collect();
        let mut free = Shape::default();
        free.update(&r, &r.root.r, &q);
        let middle = free.x(r.points() * 6 / 10);
        let centre = middle + (middle - Vector3::x() * 0.12).normalize() * 0.02;
        let ball = Solid::Sphere { centre, radius: 0.05 };
        let bodies = Bodies::from_shapes(&[ball]);
        let interpolator = Interpolator::new(&c, &[LEAF], &[(&r, LEAF)], &bodies, &[0.0005]);
        let at = |t: f64| {
            let q: Vec<f64> = q.iter().zip(&rate).map(|(q, r)| q + t * r).collect();
            let motion = [GuideMotion { rod: &r, q: &q, rate: &rate }];
            let moment = Moment {
                head: still(),
                keep_out: KeepOut { bodies: &bodies, time: 0.0, poses: &[Isometry3::identity()] },
            };
            let mut out = [vec![[0.0; 3]; 33], vec![[0.0; 3]; 33]];
            let [p, v] = &mut out;
            interpolator.evaluate(&[moment, moment], &motion, &Matrix3::identity(), p, v);
            out
        };
        let [p, v] = at(0.0);
        let depth = p.iter().map(|x| (wide(x) - centre).norm() - 0.05).fold(f64::INFINITY, f64::min);
        assert!((-1e-6..0.002).contains(&depth), "does not lean on the ball: {depth}");
        for e in p.windows(2) {
            assert!(((wide(&e[1]) - wide(&e[0])).norm() / 0.00625 - 1.0).abs() < 1e-4);
        }
        // It comes towards its guide, beside which it ran.
        let across = (r.root.p + free.x(r.points() - 1) - wide(&p[32])).dot(&BESIDE.normalize());
        assert!(across < 0.9 * BESIDE.norm(), "{across} m beside its guide");
        let t = 2e-3;
        let ([hi, _], [lo, _]) = (at(t), at(-t));
        let slip = (wide(&hi[32]) - wide(&lo[32])) / (2.0 * t);
        assert!((slip - wide(&v[32])).norm() < 0.1 * slip.norm().max(0.1), "{slip} {:?}", v[32]);
    }
}
