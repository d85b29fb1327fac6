//! How deep written curves are inside bodies.

use super::clearances::{Clearances, DistanceBounds};
use super::obstacles::{InsidePoint, Obstacles};
use crate::contact::Bodies;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ops::Range;

/// Depth inside a body above which a strand counts as inside, m.
pub(super) const INSIDE: f64 = 2e-3;

/// How deep guides and strands are inside bodies. Points that the groom places inside do not count.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Depths {
    /// Depth of the deepest point of a guide, m; 0 if none is inside.
    pub guides: f64,
    /// Depth of the deepest vertex of a strand, m; 0 if none is inside.
    pub strands: f64,
    /// Number of strands with a vertex deeper than 2 mm.
    pub inside: u32,
    /// Depth of the deepest pinched point or vertex, m: bodies leave no room for it outside
    /// ([`pinch`](crate::contact::pinch)). The figures above are without these.
    pub pinched: f64,
    /// Bodies that hold pinched points.
    pub pinched_bodies: BTreeSet<u32>,
}

impl Depths {
    /// The larger of each figure, and all bodies of both.
    pub fn max(self, mut other: Self) -> Self {
        let mut pinched_bodies = self.pinched_bodies;
        pinched_bodies.append(&mut other.pinched_bodies);
        Depths {
            guides: self.guides.max(other.guides),
            strands: self.strands.max(other.strands),
            inside: self.inside.max(other.inside),
            pinched: self.pinched.max(other.pinched),
            pinched_bodies,
        }
    }

    /// The depths of a curve with these points inside, from root to tip, as those of a guide. A point next to
    /// a pinched one counts as pinched: no closer is known where a curve leaves a pinch.
    pub(super) fn of_curve(points: &[InsidePoint]) -> Self {
        let mut depths = Depths::default();
        for inside in points {
            let beside = points.iter().filter(|other| other.vertex.abs_diff(inside.vertex) <= 1);
            let bodies: BTreeSet<u32> = beside.flat_map(|other| &other.pinched_by).copied().collect();
            let depth = if bodies.is_empty() { &mut depths.guides } else { &mut depths.pinched };
            *depth = depth.max(inside.depth);
            depths.pinched_bodies.extend(bodies);
        }
        depths
    }
}

/// Measures how deep guides are inside bodies.
#[derive(Debug, Default)]
pub struct GuideDepths {
    /// Places of each guide's points in an array of all points, and the distances that they keep.
    guides: Vec<(Range<usize>, Clearances)>,
}

impl GuideDepths {
    /// Of guides with `points` in the groom, m, rest space, of which each has a range. `bodies` are at rest
    /// and have the thicknesses `thickness`, m.
    ///
    /// A stretch that the groom draws through a body may slide in it: points next to one do not count either.
    pub fn new(
        points: &[Vector3<f64>],
        guides: Vec<Range<usize>>,
        bodies: &Bodies,
        thickness: &[f64],
    ) -> Self {
        let clearances = |range: Range<usize>| {
            let mut clearances = Clearances::new(bodies, thickness, &points[range.clone()]);
            clearances.free_beside_drawn_through();
            (range, clearances)
        };
        GuideDepths { guides: guides.into_par_iter().map(clearances).collect() }
    }

    /// Depths of guides at `points`, in the output's unit and axes, which `from_scene` maps to metres, Y up.
    pub fn measure(&self, obstacles: &Obstacles, points: &[[f32; 3]], from_scene: &Matrix3<f64>) -> Depths {
        let depths = |bounds: &mut DistanceBounds, (range, clearances): &(Range<usize>, Clearances)| {
            let points = in_metres(&points[range.clone()], from_scene);
            Depths::of_curve(&obstacles.inside(clearances, points, |_, _| false, bounds))
        };
        self.guides
            .par_iter()
            .with_min_len(16)
            .map_init(DistanceBounds::default, depths)
            .reduce(Depths::default, Depths::max)
    }
}

/// Points in the output's unit and axes, which `from_scene` maps to metres, Y up.
pub(super) fn in_metres(
    points: &[[f32; 3]],
    from_scene: &Matrix3<f64>,
) -> impl Iterator<Item = Vector3<f64>> {
    points.iter().map(move |p| from_scene * Vector3::from(p.map(f64::from)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Body;
    use crate::geometry::{Deformation, Shape};
    use nalgebra::Isometry3;
    use std::sync::Arc;

    /// Depths of a guide in two balls of one skin with these centres, m, and radii, m, that are out of its way
    /// at rest. The guide is a line through the origin with points 1 mm apart, the first at `from`, m.
    fn in_skin(balls: [(f64, f64); 2], direction: Vector3<f64>, from: f64) -> Depths {
        let ball = |(y, radius)| Shape::Sphere { centre: Vector3::y() * y, radius }.tessellate();
        let [mut mesh, other] = balls.map(ball);
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(other.vertices);
        mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        let deformation = Deformation { start: 0.0, rate: 1.0, samples: vec![mesh.vertices.clone(); 2] };
        let skin = Body::new(&Shape::Mesh(mesh), Some(&Arc::new(deformation)), None);
        let mut bodies = Bodies::new([skin]);
        bodies.prepare([0.0, 0.0]);
        let points: Vec<_> = (0..101).map(|i| direction * (1e-3 * f64::from(i) + from)).collect();
        let written: Vec<_> = points.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect();
        let rest: Vec<_> = points.iter().map(|p| p + Vector3::z()).collect();
        let depths = GuideDepths::new(&rest, std::iter::once(0..points.len()).collect(), &bodies, &[5e-4]);
        let obstacles = Obstacles { bodies: &bodies, time: 0.0, poses: &[Isometry3::identity()] };
        depths.measure(&obstacles, &written, &Matrix3::identity())
    }

    #[test]
    fn parts_of_a_skin_that_leave_no_room_are_told_from_a_guide_that_is_inside() {
        // In the middle of an overlap of 1 cm; in one ball alone; and from the root, which a small ball bears,
        // out of a large one that has swallowed it, where the small one is far.
        let overlap = in_skin([(-0.045, 0.05), (0.045, 0.05)], Vector3::x(), -0.05);
        assert!((overlap.pinched - 0.005).abs() < 5e-4 && overlap.guides < 1e-4, "{overlap:?}");
        let inside = in_skin([(-0.3, 0.05), (0.045, 0.05)], Vector3::x(), -0.05);
        assert!((inside.guides - 0.005).abs() < 5e-4 && inside.pinched == 0.0, "{inside:?}");
        let swallowed =
            in_skin([(-0.0045, 0.004), (0.042, 0.05)], Vector3::new(0.75_f64.sqrt(), -0.5, 0.0), 0.0);
        assert!(swallowed.pinched > 1e-3 && swallowed.guides < 1e-4, "{swallowed:?}");
    }

    #[test]
    fn a_hair_cannot_turn_away_from_a_part_that_is_right_before_its_root() {
        // Obliquely from a small ball into a large one, 1 mm or 4 mm before the root. The way out beside the
        // root leads past the small ball.
        let before =
            |gap: f64| in_skin([(-0.0045, 0.004), (0.05 + gap, 0.05)], Vector3::new(0.8, 0.6, 0.0), 0.0);
        let near = before(1e-3);
        assert!(near.pinched > 2e-3 && near.guides > near.pinched, "{near:?}");
        let far = before(4e-3);
        assert!(far.pinched == 0.0 && far.guides > 2e-3, "{far:?}");
    }

    #[test]
    fn skin_that_is_turned_inside_out_does_not_tell_the_side() {
        // A ball that a deformation mirrors, and a guide that passes 5 mm before it or through it.
        let mesh = Shape::Sphere { centre: Vector3::zeros(), radius: 0.05 }.tessellate();
        let mirrored: Vec<_> = mesh.vertices.iter().map(|x| Vector3::new(-x.x, x.y, x.z)).collect();
        for (samples, y, inside) in [
            (mesh.vertices.clone(), 0.045, true),
            (mesh.vertices.clone(), 0.055, false),
            (mirrored, 0.055, false),
        ] {
            let deformation = Deformation { start: 0.0, rate: 1.0, samples: vec![samples; 2] };
            let mut bodies =
                Bodies::new([Body::new(&Shape::Mesh(mesh.clone()), Some(&Arc::new(deformation)), None)]);
            let points: Vec<_> = (-9..10).map(|i| Vector3::new(1e-3 * f64::from(i), y, 0.0)).collect();
            let rest: Vec<_> = points.iter().map(|p| p + Vector3::z()).collect();
            let depths = GuideDepths::new(&rest, std::iter::once(0..rest.len()).collect(), &bodies, &[5e-4]);
            bodies.prepare([0.0, 0.0]);
            let obstacles = Obstacles { bodies: &bodies, time: 0.0, poses: &[Isometry3::identity()] };
            let written: Vec<_> = points.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect();
            let found = depths.measure(&obstacles, &written, &Matrix3::identity());
            assert_eq!(found.guides.max(found.pinched) > 4e-3, inside, "{y}: {found:?}");
        }
    }

    #[test]
    fn bodies_that_leave_no_room_are_named_whatever_their_number() {
        let balls = vec![Shape::Sphere { centre: Vector3::zeros(), radius: 0.05 }; 70];
        let bodies = Bodies::from_shapes(&balls);
        // At rest all are far away; then the last two overlap by 1 cm where a guide passes, or by 4 cm, with open
        // wedges in which it runs in and out.
        let far: Vec<_> =
            (0..70).map(|b| Isometry3::translation(0.0, 1.0 + 0.2 * f64::from(b), 0.0)).collect();
        let overlapping = |overlap: f64| {
            let mut poses = far.clone();
            for (pose, side) in poses[68..].iter_mut().zip([1.0, -1.0]) {
                *pose = Isometry3::translation(0.0, (0.05 - 0.5 * overlap) * side, 0.0);
            }
            poses
        };
        let points: Vec<_> = (0..21).map(|i| Vector3::new(0.005 * f64::from(i) - 0.05, 0.0, 0.0)).collect();
        let written: Vec<_> = points.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect();
        let all = std::iter::once(0..points.len()).collect();
        let measured = |poses: &[Isometry3<f64>]| {
            let rest: Vec<_> = points.iter().map(|p| p + Vector3::z()).collect();
            let depths = GuideDepths::new(&rest, Vec::clone(&all), &bodies, &[5e-4; 70]);
            let obstacles = Obstacles { bodies: &bodies, time: 0.0, poses };
            depths.measure(&obstacles, &written, &Matrix3::identity())
        };
        assert_eq!(measured(&far), Depths::default());
        for overlap in [0.01, 0.04] {
            let depths = measured(&overlapping(overlap));
            assert!((depths.pinched - 0.5 * overlap).abs() < 1e-6 && depths.guides < 1e-4, "{depths:?}");
            assert_eq!(depths.pinched_bodies, BTreeSet::from([68, 69]));
        }
    }
}
