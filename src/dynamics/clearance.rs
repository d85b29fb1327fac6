//! What a guide keeps from each body.
//!
//! A strand grows out of the head, so its first stretch is in the head or on it, and production grooms have more of it
//! inside, or drawn through an ear. The rule, body by body, with g the signed distance in the groom's pose and d the body's
//! thickness:
//!
//! - a point outside (g > 0) keeps min(d, g/2), g being the least along the segments beside it: what was drawn closer
//!   than d stays as close, with room to give;
//! - a point inside, before the strand has come out for the first time: the segments beside it are exempt for good;
//! - a segment drawn through the body is exempt for good, for it has no side; its ends have one. So is a stretch of points inside with the segments
//!   that lead in and out, if the surfaces nearest to two points in a row face away from each other, as on two sides of an ear. A segment that
//!   only cuts the surface, as the chord of a curl that lies on it, or clips an edge less than 2 d deep, is no exception;
//! - a point inside later on, and a segment that cuts the surface: brought out to min(d, s/4) during the pre-roll, gently, s being its
//!   arc length from the root; segments that are still in the body then are exempt from then on.

use crate::contact::{Bodies, BodyMotion, Contact, ContactCache, MovingPolyline};
use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

/// How far the groom's pose is searched for a body, m; what lies deeper inside is taken to lie this deep.
const SEARCH: f64 = 0.3;

/// How steeply a strand rises out of a body in which it lies, at most: one drawn flat in the skin cannot stand off it at once.
const STEEPEST: f64 = 0.25;

/// Of a segment that is exempt.
const EXEMPT: [f64; 2] = [f64::NEG_INFINITY; 2];

/// Distances that the segments of one guide keep from the bodies.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Clearance {
    /// From body b at the two ends of segment k, at `b * segments + k`, m: in the groom's pose, and once all has been brought
    /// out. −∞ where a segment is exempt.
    from: Vec<[f64; 2]>,
    to: Vec<[f64; 2]>,
}

/// A point of the groom's pose beside one body: what it keeps in the end, m, and how deep inside it begins, m.
#[derive(Debug, Clone, Copy)]
struct Point {
    keep: f64,
    depth: f64,
    /// Outward normal of the nearest surface, body frame; zero where there is none.
    normal: Vector3<f64>,
}

/// How a segment of the groom's pose goes by a body.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Way {
    /// Inside, before the strand has come out for the first time.
    Rooted,
    /// In on one side and out on another.
    Through,
    Beside,
}

impl Clearance {
    /// The rule applied to the points `x` (m, world), with the bodies as they are at time `t`, s, at `pose` (rest space to world),
    /// and `thickness`, m.
    pub fn new(
        bodies: &Bodies,
        t: f64,
        pose: &[Isometry3<f64>],
        thickness: &[f64],
        x: &[Vector3<f64>],
    ) -> Self {
        let mut points = Vec::new();
        let mut ways = Vec::new();
        for (b, (pose, &d)) in pose.iter().zip(thickness).enumerate() {
            let local: Vec<_> = x.iter().map(|p| pose.inverse_transform_point(&(*p).into()).coords).collect();
            let (mut s, mut known) = (0.0, None);
            let beside: Vec<Point> = (0..x.len())
                .map(|k| {
                    let nearest = bodies.closest(b, t, &local[k], SEARCH);
                    let far = nearest.map_or(SEARCH, |s| s.distance.abs());
                    let normal = nearest.map_or_else(Vector3::zeros, |s| s.normal);
                    let way = (x[k] - x[k.saturating_sub(1)]).norm();
                    s += way;
                    // The winding number, not the nearest triangle's side: it holds on open and dirty meshes. It is asked for at every second
                    // point at least.
                    let inside = known.take().filter(|_| way < far);
                    let inside = inside.unwrap_or_else(|| *known.insert(bodies.contains(b, t, &local[k])));
                    match inside {
                        true => Point { keep: d.min(STEEPEST * s), depth: far, normal },
                        false => Point { keep: d.min(0.5 * far), depth: 0.0, normal },
                    }
                })
                .collect();
            let rooted = beside.iter().take_while(|point| point.depth > 0.0).count();
            let inside = |k: usize| beside[k].depth > 0.0;
            let facing_away = |k: usize| beside[k].normal.dot(&beside[k + 1].normal) < 0.0;
            let of_body = ways.len();
            ways.extend((0..x.len() - 1).map(|k| match k < rooted {
                true => Way::Rooted,
                false if inside(k) || inside(k + 1) => Way::Beside,
                false if passes(bodies, b, t, &[local[k], local[k + 1]]) => Way::Through,
                false => Way::Beside,
            }));
            // All of a stretch inside: there is no telling how much of it the way from one side to the other takes.
            let halves: Vec<usize> = (rooted..x.len() - 1).collect();
            for stretch in halves.chunk_by(|_, k| inside(*k)) {
                if stretch.iter().any(|&k| (inside(k) || inside(k + 1)) && facing_away(k)) {
                    ways[of_body + stretch[0]..][..stretch.len()].fill(Way::Through);
                }
            }
            points.extend(beside);
        }
        let ends = |body: usize, k: usize| body * x.len() + k..body * x.len() + k + 2;
        let segments = || (0..pose.len()).flat_map(|b| (0..x.len() - 1).map(move |k| (b, k)));
        let found = |ways: &[Way], wanted: Way| {
            let touching: Vec<[f64; 2]> = segments()
                .zip(ways)
                .map(|((b, k), way)| match points[ends(b, k)].iter().any(|p| p.depth > 0.0) {
                    false if *way == wanted => [0.0; 2],
                    _ => EXEMPT,
                })
                .collect();
            at_rest(bodies, t, pose, thickness, &MovingPolyline { x0: x, x1: x, clearance: &touching })
        };
        let of = |c: &Contact| c.body * (x.len() - 1) + c.segment;
        let clips = |c: &&Contact| c.gap < 0.0 && -c.gap < 2.0 * thickness[c.body];
        for clip in found(&ways, Way::Through).iter().filter(clips) {
            ways[of(clip)] = Way::Beside;
        }
        let mut cut = vec![0.0_f64; ways.len()];
        for c in found(&ways, Way::Beside) {
            if c.gap < 0.0 {
                cut[of(&c)] = cut[of(&c)].min(c.gap);
            } else {
                // The distance may be less along a segment than at its ends.
                points[ends(c.body, c.segment)].iter_mut().for_each(|p| p.keep = p.keep.min(0.5 * c.gap));
            }
        }
        let all = |distance: fn(&Point) -> f64| -> Vec<[f64; 2]> {
            let distances = |((b, k), way): ((usize, usize), &Way)| match (way, &points[ends(b, k)]) {
                (Way::Beside, [one, two]) => [distance(one), distance(two)],
                _ => EXEMPT,
            };
            segments().zip(&ways).map(distances).collect()
        };
        let mut from = all(|point| if point.depth > 0.0 { -point.depth } else { point.keep });
        for (ends, cut) in from.iter_mut().zip(cut).filter(|(_, cut)| *cut < 0.0) {
            *ends = ends.map(|from| from.min(cut));
        }
        Clearance { from, to: all(|point| point.keep) }
    }

    /// Clearances when `share` (0..=1) of the way out has been gone.
    pub fn at(&self, share: f64, out: &mut Vec<[f64; 2]>) {
        let between = |a: f64, b: f64| if a == b { a } else { a + share * (b - a) };
        out.clear();
        out.extend(self.from.iter().zip(&self.to).map(|(a, b)| [between(a[0], b[0]), between(a[1], b[1])]));
    }

    /// Number of segments, over all bodies.
    pub(super) fn len(&self) -> usize {
        self.to.len()
    }

    /// Segments that are exempt, and segments of which an end is being brought out.
    pub fn counts(&self) -> (usize, usize) {
        let exempt = self.to.iter().filter(|ends| **ends == EXEMPT).count();
        (exempt, self.from.iter().zip(&self.to).filter(|(a, b)| a != b).count())
    }

    /// Ends the way out with the points at `x`, m, world, and the bodies at time `t`, s, at `pose`: segments that are still in a body are
    /// exempt from now on, all others have arrived.
    pub fn arrive(&mut self, bodies: &Bodies, t: f64, pose: &[Isometry3<f64>], x: &[Vector3<f64>]) {
        let segments = x.len() - 1;
        for (i, (from, to)) in self.from.iter_mut().zip(&mut self.to).enumerate() {
            if from == to {
                continue;
            }
            let (b, k) = (i / segments, i % segments);
            let ends = [x[k], x[k + 1]].map(|x| pose[b].inverse_transform_point(&x.into()).coords);
            if ends.iter().any(|y| bodies.contains(b, t, y)) || passes(bodies, b, t, &ends) {
                *to = EXEMPT;
            }
            *from = *to;
        }
    }
}

/// Whether the way between two points outside a body, in its frame, goes through it: in on one side and out on another.
fn passes(bodies: &Bodies, body: usize, t: f64, [from, to]: &[Vector3<f64>; 2]) -> bool {
    let sides =
        bodies.first_intersection(body, t, from, to).zip(bodies.first_intersection(body, t, to, from));
    sides.is_some_and(|((_, entry), (_, exit))| entry.dot(&exit) < 0.0)
}

/// Distances (as the contacts' gaps) in the groom's pose, wherever they are below twice the thickness.
fn at_rest(
    bodies: &Bodies,
    t: f64,
    pose: &[Isometry3<f64>],
    thickness: &[f64],
    line: &MovingPolyline,
) -> Vec<Contact> {
    let motions: Vec<BodyMotion> =
        pose.iter().map(|p| BodyMotion { times: [t, t], start: *p, end: *p }).collect();
    let reach = 2.0 * thickness.iter().copied().fold(0.0, f64::max);
    let mut found = Vec::new();
    bodies.candidates(&motions, line, reach, &mut ContactCache::default(), &mut found);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Shape, TriMesh};

    /// A triangle of the xy plane, clockwise, drawn out along z to `half` either way.
    fn prism(corners: [[f64; 2]; 3], half: f64) -> TriMesh {
        let side = |z: f64| corners.map(|[x, y]| Vector3::new(x, y, z));
        let vertices = [side(half), side(-half)].concat();
        let walls = [0, 1, 2].map(|i: u32| [i, (i + 1) % 3]).map(|[a, b]| [[a, b, a + 3], [b, b + 3, a + 3]]);
        let triangles = [walls.concat(), vec![[0, 2, 1], [3, 4, 5]]].concat();
        TriMesh { vertices, triangles }
    }

    #[test]
    fn only_what_is_drawn_through_a_body_is_exempt_and_its_ends_keep_their_side() {
        let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.01 };
        let bodies = Bodies::from_shapes(&[ball]);
        let at = |x: f64| Vector3::new(x, 0.0, 0.0);
        // From inside, out, back through, out to 0.2 mm and on.
        let x = [at(0.005), at(0.02), at(-0.0102), at(-0.03), at(-0.04)];
        let clearance = Clearance::new(&bodies, 0.0, &[Isometry3::identity()], &[5e-4], &x);
        let mut kept = Vec::new();
        clearance.at(1.0, &mut kept);
        assert_eq!(kept[..2], [EXEMPT; 2]);
        // As close as drawn along the segments beside a point.
        assert!(kept[2].iter().all(|d| (d - 1e-4).abs() < 1e-12), "{kept:?}");
        assert_eq!(kept[3], [kept[2][1], 5e-4]);
        assert_eq!(clearance.counts(), (2, 0));
        // The end of the segment drawn through is held by the segment after it.
        let mut pushed = x;
        pushed[2] = at(-0.0099);
        let line = MovingPolyline { x0: &x, x1: &pushed, clearance: &kept };
        let found = at_rest(&bodies, 0.0, &[Isometry3::identity()], &[5e-4], &line);
        assert!(found.iter().any(|c| (c.segment, c.u) == (2, 0.0) && c.gap < 0.0), "{found:?}");
    }

    #[test]
    fn a_chord_that_only_cuts_the_surface_is_held() {
        let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: Vector3::zeros(), radius: 0.1 }]);
        let x =
            [-0.02, 0.0, 0.005].map(|s: f64| Vector3::new((s / 0.1).sin(), (s / 0.1).cos(), 0.0) * 0.1002);
        let depth = 0.1 - 0.5 * (x[0] + x[1]).norm();
        assert!(depth > 1e-4);
        let clearance = Clearance::new(&bodies, 0.0, &[Isometry3::identity()], &[5e-4], &x);
        // It is held where it is, and brought out.
        assert_eq!(clearance.counts(), (0, 1));
        let mut kept = Vec::new();
        clearance.at(0.0, &mut kept);
        assert!(kept[0].iter().all(|d| (d + depth).abs() < 1e-5), "{kept:?} {depth}");
        clearance.at(1.0, &mut kept);
        assert!(kept[0].iter().all(|d| (8e-5..1e-4).contains(d)), "{kept:?}");
    }

    #[test]
    fn what_clips_an_edge_is_brought_out_and_what_is_drawn_through_a_sheet_is_exempt() {
        // A sharp ridge along z, and a sheet in the plane x = 0 of two sides 0.2 mm apart.
        let [wide, thin] = [0.05, 1e-4].map(|w| prism([[0.0, 0.0], [w, -0.1], [-w, -0.1]], 0.1));
        let counts = |mesh: TriMesh, height: f64| {
            let bodies = Bodies::from_shapes(&[Shape::Mesh(mesh)]);
            let x = [-0.02, -0.002, 0.002, 0.02].map(|x| Vector3::new(x, height, 1e-3));
            Clearance::new(&bodies, 0.0, &[Isometry3::identity()], &[5e-4], &x).counts()
        };
        assert_eq!(counts(wide.clone(), -3e-4), (0, 1));
        assert_eq!(counts(wide, -2e-3), (1, 0));
        assert_eq!(counts(thin, -0.03), (1, 0));
    }

    #[test]
    fn a_stretch_through_a_body_is_exempt_and_one_that_dips_into_it_comes_out() {
        // A slab 8 mm thick, its upper face at the height 0.
        let half = Vector3::new(0.1, 0.004, 0.1);
        let corner = |i: usize| Vector3::from_fn(|k, _| if i >> k & 1 == 1 { half[k] } else { -half[k] });
        let vertices = (0..8).map(|i| corner(i) - Vector3::y() * half.y).collect();
        let triangles = [[0, 3, 1], [0, 2, 3], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]];
        let more = [[2, 7, 3], [2, 6, 7], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]];
        let triangles = [triangles, more].concat();
        let bodies = Bodies::from_shapes(&[Shape::Mesh(TriMesh { vertices, triangles })]);
        let kept = |heights: [f64; 7]| {
            let x: Vec<_> =
                heights.iter().enumerate().map(|(k, h)| Vector3::new(0.003 * k as f64, *h, 0.0)).collect();
            let clearance = Clearance::new(&bodies, 0.0, &[Isometry3::identity()], &[5e-4], &x);
            let mut kept = Vec::new();
            clearance.at(1.0, &mut kept);
            kept.iter().map(|ends| *ends == EXEMPT).collect::<Vec<_>>()
        };
        let through = kept([0.004, 0.001, -0.002, -0.003, -0.006, -0.009, -0.012]);
        assert_eq!(through, [false, true, true, true, true, false]);
        let dips = kept([0.004, 0.001, -0.002, -0.003, -0.002, 0.001, 0.004]);
        assert_eq!(dips, [false; 6]);
    }

    #[test]
    fn what_begins_inside_later_on_comes_out_or_is_exempt_on_both_sides() {
        let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.01 };
        let bodies = Bodies::from_shapes(&[ball]);
        let x = [0.03, 0.015, 0.008, 0.015, 0.03].map(|y| Vector3::new(0.0, y, 0.0));
        let clearance = Clearance::new(&bodies, 0.0, &[Isometry3::identity()], &[5e-4], &x);
        let mut kept = Vec::new();
        clearance.at(0.5, &mut kept);
        assert_eq!(kept[0], [5e-4; 2]);
        assert!((kept[1][1] - 0.5 * (5e-4 - 2e-3)).abs() < 1e-12, "{kept:?}");
        assert_eq!(kept[1][1], kept[2][0]);
        assert_eq!(clearance.counts(), (0, 2));
        let arrive = |beside: f64| {
            let (mut arrived, mut kept) = (clearance.clone(), Vec::new());
            let moved = x.map(|p| p + Vector3::x() * beside);
            arrived.arrive(&bodies, 0.0, &[Isometry3::identity()], &moved);
            arrived.at(1.0, &mut kept);
            kept
        };
        assert_eq!(arrive(0.0), [[5e-4; 2], EXEMPT, EXEMPT, [5e-4; 2]]);
        // Beside the ball, if nearer to it than it should.
        assert_eq!(arrive(0.0101), [[5e-4; 2]; 4]);
    }

    #[test]
    fn what_is_drawn_flat_in_the_skin_is_asked_to_stand_off_no_faster_than_it_can() {
        let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.1 };
        let bodies = Bodies::from_shapes(&[ball]);
        // From just outside along the skin, a hundredth of a millimetre in it, and out.
        let x = [(0.0, 1e-6), (1e-4, -1e-5), (4e-4, -1e-5), (5e-3, -1e-5), (2e-2, 2e-3)]
            .map(|(s, g): (f64, f64)| Vector3::new((s / 0.1).sin(), (s / 0.1).cos(), 0.0) * (0.1 + g));
        let clearance = Clearance::new(&bodies, 0.0, &[Isometry3::identity()], &[5e-4], &x);
        let mut kept = Vec::new();
        clearance.at(1.0, &mut kept);
        for (ends, goal) in kept[1..].iter().zip([0.25e-4, 1e-4, 5e-4]) {
            assert!((ends[0] - goal).abs() < 0.03 * goal, "{kept:?}");
        }
    }
}
