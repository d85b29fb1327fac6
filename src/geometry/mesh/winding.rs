//! Generalised winding numbers (A. Jacobson, L. Kavan & O. Sorkine-Hornung, "Robust inside-outside
//! segmentation using generalized winding numbers", 2013).
//!
//! A mesh and a fan with the same boundary, turned around, are closed, and wind a whole number of times: as
//! often as a ray leaves them less often than it enters them. The fan itself winds by its solid angle.

use crate::math;
use nalgebra::Vector3;
use std::cmp::Ordering;
use std::f64::consts::TAU;

/// A fan of triangles that has the boundary of the mesh of `triangles`; empty if that is closed.
pub fn boundary_fan(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    // Each edge from its lower to its higher vertex, with its multiplicity in that direction less that in the
    // other.
    let sides = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let mut edges: Vec<_> = sides.map(|[a, b]| ([a.min(b), a.max(b)], if a < b { 1 } else { -1 })).collect();
    edges.sort_unstable_by_key(|(edge, _)| *edge);
    math::merge_equal_keys(&mut edges);
    let directed = edges.iter().flat_map(|&([a, b], times)| {
        let edge = if times > 0 { [a, b] } else { [b, a] };
        std::iter::repeat_n(edge, i32::unsigned_abs(times) as usize)
    });
    let apex = directed.clone().next().map_or(0, |[first, _]| first);
    directed.filter(|edge| !edge.contains(&apex)).map(|[a, b]| [apex, a, b]).collect()
}

/// A ray upwards along z from the origin.
pub struct Ray;

impl Ray {
    /// How often it leaves the triangle with these `corners`, relative to its start, less how often it enters
    /// it. `ids` tell the same vertices of several triangles: of those of a closed mesh that meet in an edge or
    /// a vertex, it crosses as many as it does next to that.
    pub fn crossings(ids: [u32; 3], corners: [&Vector3<f64>; 3]) -> i32 {
        let side = |i: usize, j: usize| {
            let [a, b] = [corners[i], corners[j]];
            let upward = b.y > 0.0;
            if (a.y > 0.0) == upward {
                return 0;
            }
            // The same rounding, whichever triangle asks.
            let area = match ids[i].cmp(&ids[j]) {
                Ordering::Greater => -(b.x * a.y - b.y * a.x),
                _ => a.x * b.y - a.y * b.x,
            };
            match upward {
                true => i32::from(area > 0.0),
                false => -i32::from(area < 0.0),
            }
        };
        let around = side(0, 1) + side(1, 2) + side(2, 0);
        // The side of the plane that the ray starts on.
        let ahead = volume(corners) * f64::from(around);
        if ahead > 0.0 { around } else { 0 }
    }
}

/// Half the solid angle of the triangle with these corners as seen from the origin, over 2π (A. Van Oosterom
/// & J. Strackee 1983).
pub fn turns(corners: [&Vector3<f64>; 3]) -> f64 {
    let [a, b, c] = corners;
    let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    volume(corners).atan2(below) / TAU
}

/// Six times the volume of the tetrahedron from the origin to the triangle with these corners.
fn volume([a, b, c]: [&Vector3<f64>; 3]) -> f64 {
    a.dot(&b.cross(c))
}
