//! Points near bodies, with cached distance bounds.

use super::bodies::Bodies;
use crate::geometry::Solid;
use nalgebra::{Isometry3, Vector3};

/// Points of a polyline, and the midpoints that follow them, per group. If a group is far from a body, one
/// test suffices.
const GROUP: usize = 4;

/// Cached distance bounds of the points of one [`Bodies::each_point_within`].
#[derive(Debug, Clone, Default)]
pub struct ProximityCache {
    /// One per body and point.
    points: Vec<PointBound>,
    /// One per body and group, for its centre.
    groups: Vec<PointBound>,
    /// Bounding balls of the groups: centre, m, world frame, and radius, m.
    balls: Vec<(Vector3<f64>, f64)>,
    /// Whether each group is near the current body.
    near: Vec<bool>,
}

/// A lower bound on the distance of a point from a body, m, body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PointBound {
    /// The point.
    at: Vector3<f64>,
    /// Lower bound on its signed distance; 0 if unknown.
    distance: f64,
    /// A point of the surface; at infinity if unknown.
    foot: Vector3<f64>,
    /// [`Solid::max_travel`] at that time.
    travel: f64,
}

impl Default for PointBound {
    fn default() -> Self {
        let foot = Vector3::repeat(f64::INFINITY);
        PointBound { at: Vector3::zeros(), distance: 0.0, foot, travel: 0.0 }
    }
}

impl PointBound {
    /// Whether the point, now `at`, is certainly farther than `reach` from the surface, which has travelled
    /// `travel`: by this bound, or by one that needs no search.
    fn exceeds(&mut self, reach: f64, solid: &Solid, travel: f64, at: &Vector3<f64>) -> bool {
        let slack = self.distance - (travel - self.travel).abs() - reach;
        if slack > 0.0 && (at - self.at).norm_squared() < slack * slack {
            return true;
        }
        let bound = solid.distance_lower_bound(at);
        if bound > reach {
            // The foot keeps its own `travel`.
            (self.at, self.distance) = (*at, bound);
        }
        bound > reach
    }
}

impl ProximityCache {
    /// Computes the bounding balls of groups of `x`, and allocates bounds for `bodies`.
    fn prepare(&mut self, x: &[Vector3<f64>], bodies: usize) {
        let (points, midpoints) = x.split_at(x.len().div_ceil(2));
        self.balls.clear();
        self.balls.extend((0..points.len()).step_by(GROUP).map(|first| {
            let group = [points, midpoints].map(|x| &x[first..x.len().min(first + GROUP)]);
            let centre = group[0][group[0].len() / 2];
            let square = group.into_iter().flatten().map(|x| (x - centre).norm_squared()).fold(0.0, f64::max);
            // The margins cover rounding.
            (centre, square.sqrt() * (1.0 + 1e-9) + 1e-12)
        }));
        self.points.resize(bodies * x.len(), PointBound::default());
        self.groups.resize(bodies * self.balls.len(), PointBound::default());
    }
}

impl Bodies {
    /// Calls `found` for each point that is nearer to a body than its limit `within`, m.
    ///
    /// `x` are the points of a polyline, then the midpoints between them, m, world frame. The limit for body
    /// b and point k is at index `b * x.len() + k`, which is also the first argument of `found`; then follow
    /// the signed distance, m, and the outward normal, world frame. The bodies are at time `t`, s, at
    /// `poses`.
    ///
    /// `cache` is that of the same points at earlier times. It changes no result, except beside the boundary
    /// of an open mesh, where a point changes sides without crossing the surface.
    pub fn each_point_within(
        &self,
        (t, poses): (f64, &[Isometry3<f64>]),
        x: &[Vector3<f64>],
        within: &[f64],
        cache: &mut ProximityCache,
        mut found: impl FnMut(usize, f64, Vector3<f64>),
    ) {
        cache.prepare(x, self.len());
        let ProximityCache { points, groups, balls, near } = cache;
        let (groups, first_midpoint) = (groups.chunks_mut(balls.len().max(1)), x.len().div_ceil(2));
        for (b, ((body, pose), groups)) in self.bodies.iter().zip(poses).zip(groups).enumerate() {
            let travel = body.solid.max_travel(t);
            let (turn, origin) = (pose.rotation.inverse().to_rotation_matrix(), pose.translation.vector);
            let of_body = b * x.len()..(b + 1) * x.len();
            let (within, points) = (&within[of_body.clone()], &mut points[of_body]);
            let largest = within.iter().copied().fold(0.0, f64::max);
            near.clear();
            near.extend(balls.iter().zip(groups).map(|((centre, radius), bound)| {
                !bound.exceeds(radius + largest, &body.solid, travel, &(turn * (centre - origin)))
            }));
            for half in [0..first_midpoint, first_midpoint..x.len()] {
                let first = half.start;
                for k in half.filter(|k| near[(k - first) / GROUP] && within[*k] > f64::NEG_INFINITY) {
                    let (at, bound) = (turn * (x[k] - origin), &mut points[k]);
                    if bound.exceeds(within[k].max(0.0), &body.solid, travel, &at) {
                        continue;
                    }
                    // The surface is no farther than the last closest point; the margins cover rounding.
                    let moved = (travel - bound.travel).abs();
                    let horizon = ((at - bound.foot).norm() + moved) * (1.0 + 1e-9) + 1e-9;
                    let surface = body.solid.closest(t, &at, horizon);
                    let distance = surface.map_or(horizon, |s| s.distance);
                    let foot = surface.map_or(PointBound::default().foot, |s| s.point);
                    *bound = PointBound { at, distance: distance * (1.0 - 1e-9) - 1e-12, foot, travel };
                    if let Some(surface) = surface.filter(|s| s.distance < within[k]) {
                        found(b * x.len() + k, surface.distance, pose.rotation * surface.normal);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Shape;
    use crate::math::polyline;
    use proptest::prelude::*;

    #[test]
    fn points_deep_inside_are_reported() {
        let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.3 }.tessellate();
        let bodies = Bodies::from_shapes(&[Shape::Mesh(ball)]);
        let x = [Vector3::x() * 0.5, Vector3::x() * 0.1, Vector3::x() * 0.3];
        let (mut cache, mut found) = (ProximityCache::default(), Vec::new());
        // Twice: searched, then from the cache.
        for _ in 0..2 {
            bodies.each_point_within(
                (0.0, &[Isometry3::identity()]),
                &x,
                &[5e-4; 3],
                &mut cache,
                |k, distance, _| found.push((k, (distance * 100.0).round() as i32)),
            );
        }
        assert_eq!(found, [(1, -20), (2, 0)].repeat(2));
    }

    proptest! {
        #[test]
        fn cached_bounds_never_change_the_result(
            places in prop::collection::vec(prop::array::uniform3(-0.03..0.03_f64), 10),
            steps in prop::collection::vec(prop::array::uniform6(-0.004..0.004_f64), 60),
        ) {
            let (a, b, radius) = (Vector3::new(0.12, 0.02, 0.0), Vector3::new(0.13, 0.0, 0.01), 0.01);
            let bodies = Bodies::from_shapes(&[
                Shape::Sphere { centre: Vector3::zeros(), radius },
                Shape::Capsule { ends: [a, b], radius },
            ]);
            let mut poses = [Isometry3::identity(); 2];
            // The first group is near the first body, the last and smaller one near the second; each is far
            // from the other body.
            let along = |k: usize| Vector3::x() * (0.06 * (k / GROUP) as f64);
            let mut points: Vec<_> = (0..).zip(&places).map(|(k, p)| along(k) + Vector3::from(*p)).collect();
            // Some may be slightly inside; some have no limit.
            let count = 2 * points.len() - 1;
            let limits = [-1e-3, 5e-4, 5e-3, f64::NEG_INFINITY, 0.0];
            let within: Vec<_> = limits.into_iter().cycle().take(2 * count).collect();
            let mut cache = ProximityCache::default();
            for step in steps {
                let [one, other] = [0, 3].map(|i| Vector3::from_column_slice(&step[i..i + 3]));
                points.iter_mut().step_by(2).for_each(|x| *x += one);
                points.iter_mut().skip(1).step_by(2).for_each(|x| *x += other);
                poses[1].translation.vector += one - other;
                let mut x = points.clone();
                x.extend(points.windows(2).map(|x| 0.5 * (x[0] + x[1])));
                let distance = |i: usize| {
                    let at = poses[i / count].inverse_transform_point(&x[i % count].into()).coords;
                    let axis = |i: usize| if i < count { [Vector3::zeros(); 2] } else { [a, b] };
                    polyline::distance(&at, &axis(i)) - radius
                };
                let nearer: Vec<_> = (0..2 * count).filter(|i| distance(*i) < within[*i]).collect();
                let mut found = Vec::new();
                let mut push = |i: usize, at: f64, _: Vector3<f64>| found.push((i, at));
                bodies.each_point_within((0.0, &poses), &x, &within, &mut cache, &mut push);
                prop_assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), nearer);
                prop_assert!(found.iter().all(|(i, at)| (at - distance(*i)).abs() < 1e-12));
            }
        }
    }
}
