//! Which way fur lies: a unit tangent at each vertex of a surface.

use super::options::{Direction, FurShape};
use super::surface::Surface;
use crate::import::plain::Field;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Length of a tangent, of a unit vector or of a mean of unit vectors, below which it has no direction.
const NONE: f64 = 1e-6;

/// The directions at the vertices: unit tangents, or zero where there is none. `field` holds texture
/// coordinates or vectors where the direction is along these.
pub(super) fn directions(surface: &Surface, shape: &FurShape, field: Option<&Field>) -> Vec<Vector3<f64>> {
    let mut directions = match &shape.direction {
        Direction::Normal => return vec![Vector3::zeros(); surface.vertices().len()],
        Direction::Vector(along) => vec![along.normalize(); surface.vertices().len()],
        Direction::Flow(start) => {
            let distances = distances(surface, &starts(surface, *start));
            at_vertices(surface, |t| {
                let corners = surface.corners(t).map(|v| distances[v as usize]);
                slope(surface, t, corners)
            })
        }
        Direction::Texture { axis, falls } => at_vertices(surface, |t| {
            let uv = field.map_or([Vector3::zeros(); 3], |field| surface.values(field, t));
            slope(surface, t, uv.map(|uv| uv[*axis])) * if *falls { -1.0 } else { 1.0 }
        }),
        Direction::Field(_) => at_vertices(surface, |t| {
            let values = field.map_or([Vector3::zeros(); 3], |field| surface.values(field, t));
            values.iter().sum()
        }),
    };
    let down = -Vector3::y() * shape.gravity;
    for (direction, normal) in directions.iter_mut().zip(&surface.normals) {
        let own = tangential(direction, normal).try_normalize(NONE).unwrap_or_default();
        *direction = tangential(&(own + down), normal);
    }
    smooth(surface, directions, shape.smoothing)
}

/// The part of `x` that is perpendicular to the unit vector `normal`.
fn tangential(x: &Vector3<f64>, normal: &Vector3<f64>) -> Vector3<f64> {
    x - normal * x.dot(normal)
}

/// Means over the triangles of each vertex of a vector of each triangle, weighted by area; only their
/// directions count.
fn at_vertices(surface: &Surface, of_triangle: impl Fn(u32) -> Vector3<f64>) -> Vec<Vector3<f64>> {
    let mut sums = vec![Vector3::zeros(); surface.vertices().len()];
    for t in 0..surface.triangles as u32 {
        let Some(unit) = of_triangle(t).try_normalize(f64::MIN_POSITIVE) else { continue };
        let weighted = unit * surface.doubled_area(t).norm();
        surface.corners(t).iter().for_each(|v| sums[*v as usize] += weighted);
    }
    sums.iter().map(|sum| sum.try_normalize(0.0).unwrap_or_default()).collect()
}

/// Direction in which a number that is linear on triangle `t` rises, not normalised.
fn slope(surface: &Surface, t: u32, corners: [f64; 3]) -> Vector3<f64> {
    let normal = surface.doubled_area(t);
    let [a, b, c] = surface.corners(t).map(|v| surface.vertex(v));
    normal.cross(&((c - b) * corners[0] + (a - c) * corners[1] + (b - a) * corners[2]))
}

/// Rounds of Jacobi's method that replace each tangent by the mean of its own and that of its neighbours, in
/// its own plane; unit vectors in the end.
fn smooth(surface: &Surface, mut tangents: Vec<Vector3<f64>>, rounds: usize) -> Vec<Vector3<f64>> {
    let unit = |x: &Vector3<f64>| x.try_normalize(NONE).unwrap_or_default();
    for _ in 0..rounds {
        let mean = |v: usize| {
            let ring = &surface.ring[v];
            let around: Vector3<f64> = ring.iter().map(|n| tangents[*n as usize]).sum();
            let sum = tangents[v] + around / ring.len().max(1) as f64;
            tangential(&(sum * 0.5), &surface.normals[v])
        };
        tangents = (0..tangents.len()).into_par_iter().map(mean).collect();
    }
    tangents.iter().map(unit).collect()
}

/// The vertices from which fur flows away: that nearest to `start`, and in each piece of the mesh without it
/// the one that is foremost. Without a start it is the foremost of all.
fn starts(surface: &Surface, start: Option<Vector3<f64>>) -> Vec<u32> {
    let forward = forward(surface);
    let pieces = pieces(surface);
    let height = |v: u32| surface.vertex(v).dot(&forward);
    let distance = |v: u32, start: &Vector3<f64>| (surface.vertex(v) - start).norm_squared();
    let all = 0..surface.vertices().len() as u32;
    let named = start
        .and_then(|start| all.clone().min_by(|a, b| distance(*a, &start).total_cmp(&distance(*b, &start))));
    let mut foremost: Vec<Option<u32>> = vec![None; pieces.len()];
    for v in all {
        let of_piece = &mut foremost[pieces[v as usize] as usize];
        if of_piece.is_none_or(|best| height(v) > height(best)) {
            *of_piece = Some(v);
        }
    }
    if let Some(named) = named {
        foremost[pieces[named as usize] as usize] = Some(named);
    }
    foremost.into_iter().flatten().collect()
}

/// The piece of each vertex, named by its first vertex.
fn pieces(surface: &Surface) -> Vec<u32> {
    let count = surface.vertices().len();
    let mut piece = vec![u32::MAX; count];
    let mut queue = Vec::new();
    for first in 0..count as u32 {
        queue.push(first);
        while let Some(v) = queue.pop() {
            if piece[v as usize] == u32::MAX {
                piece[v as usize] = first;
                queue.extend(&surface.ring[v as usize]);
            }
        }
    }
    piece
}

/// Towards the head: along the longest axis of the surface, up if it stands upright, else towards positive
/// coordinates, which characters face.
fn forward(surface: &Surface) -> Vector3<f64> {
    let points = surface.vertices();
    let low = points.iter().fold(Vector3::repeat(f64::INFINITY), |a, x| a.inf(x));
    let high = points.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |a, x| a.sup(x));
    Vector3::ith((high - low).imax(), 1.0)
}

/// A vertex and its distance from the start; nearer ones are greater.
struct Front(f64, u32);

impl Ord for Front {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}
impl PartialOrd for Front {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Front {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Front {}

/// Distance along the surface of each vertex from the nearest of `starts`, m, by fast marching (R. Kimmel &
/// J. A. Sethian, "Computing geodesic paths on manifolds", 1998).
pub(super) fn distances(surface: &Surface, starts: &[u32]) -> Vec<f64> {
    let count = surface.vertices().len();
    let mut triangles_of: Vec<Vec<u32>> = vec![Vec::new(); count];
    for t in 0..surface.triangles as u32 {
        surface.corners(t).iter().for_each(|v| triangles_of[*v as usize].push(t));
    }
    let (mut distance, mut done) = (vec![f64::INFINITY; count], vec![false; count]);
    let mut fronts: BinaryHeap<Front> = starts.iter().map(|v| Front(0.0, *v)).collect();
    starts.iter().for_each(|v| distance[*v as usize] = 0.0);
    while let Some(Front(_, v)) = fronts.pop() {
        if std::mem::replace(&mut done[v as usize], true) {
            continue;
        }
        for &t in &triangles_of[v as usize] {
            let corners = surface.corners(t);
            for (k, &c) in corners.iter().enumerate().filter(|(_, c)| !done[**c as usize]) {
                let [a, b] = [1, 2].map(|i| corners[(k + i) % 3]);
                let known = [a, b].map(|v| distance[v as usize]);
                let ends = [a, b].map(|v| surface.vertex(v) - surface.vertex(c));
                let through = arrival(ends, known);
                if through < distance[c as usize] {
                    distance[c as usize] = through;
                    fronts.push(Front(through, c));
                }
            }
        }
    }
    distance
}

/// Distance from the start of the corner of a triangle whose other corners are at `ends` from it, m, and at
/// the distances `known` from the start, m: a straight front that crosses the triangle, or the way along an
/// edge.
fn arrival(ends: [Vector3<f64>; 2], known: [f64; 2]) -> f64 {
    let along_edges = (known[0] + ends[0].norm()).min(known[1] + ends[1].norm());
    if !known.iter().all(|d| d.is_finite()) {
        return along_edges;
    }
    // The gradient g of length 1 in the plane of the triangle has ends · g = known − d.
    let [aa, ab, bb] = [ends[0].dot(&ends[0]), ends[0].dot(&ends[1]), ends[1].dot(&ends[1])];
    let det = aa * bb - ab * ab;
    // 1ᵀ Q 1 d² − 2 1ᵀ Q u d + uᵀ Q u − 1 = 0, with Q the inverse of the Gram matrix of the ends.
    let q = [bb / det, -ab / det, aa / det];
    let product = |x: [f64; 2], y: [f64; 2]| {
        q[0] * x[0] * y[0] + q[1] * (x[0] * y[1] + x[1] * y[0]) + q[2] * x[1] * y[1]
    };
    let one = [1.0, 1.0];
    let [two, linear, constant] = [product(one, one), product(one, known), product(known, known) - 1.0];
    let root = linear * linear - two * constant;
    if !(det > 0.0 && root >= 0.0) {
        return along_edges;
    }
    let d = (linear + root.sqrt()) / two;
    // The front comes through the triangle if the gradient points away from both corners' edges.
    let rise = known.map(|known| d - known);
    let weights = [q[0] * rise[0] + q[1] * rise[1], q[1] * rise[0] + q[2] * rise[1]];
    if weights.iter().all(|w| *w >= 0.0) { d.min(along_edges) } else { along_edges }
}
