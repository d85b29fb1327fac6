//! The mesh of a solid: a vertex in each cell of a grid that its surface crosses (S. F. F. Gibson,
//! "Constrained elastic surface nets", 1998).

use super::solid::height;
use crate::geometry::TriMesh;
use nalgebra::Vector3;
use rayon::prelude::*;

type V = Vector3<f64>;

/// Steps of Newton's method that bring a vertex to the surface.
const NEWTON_STEPS: usize = 4;

/// Planes of a grid along one axis, m: from each start on with the spacing beside it, up to `end`.
pub(super) fn planes(parts: &[(f64, f64)], end: f64) -> Vec<f64> {
    let ends = parts.iter().skip(1).map(|(start, _)| *start).chain([end]);
    let mut planes = Vec::new();
    for ((start, spacing), end) in parts.iter().zip(ends) {
        let count = ((end - start) / spacing).round().max(1.0) as usize;
        planes.extend((0..count).map(|i| start + (end - start) * i as f64 / count as f64));
    }
    planes.push(end);
    planes
}

/// The surface of `solid`, a signed distance, as a closed mesh with outward faces, on the cells between the
/// planes of `grid`. It must not reach the outermost cells.
pub(super) fn surface(solid: impl Fn(V) -> f64 + Sync, grid: &[Vec<f64>; 3]) -> TriMesh {
    let nodes = [0, 1, 2].map(|axis| grid[axis].len());
    let cells = nodes.map(|n| n - 1);
    let index = |size: [usize; 3], at: [usize; 3]| (at[2] * size[1] + at[1]) * size[0] + at[0];
    let place = |at: [usize; 3]| V::new(grid[0][at[0]], grid[1][at[1]], grid[2][at[2]]);
    let all = |size: [usize; 3]| {
        (0..size[2]).flat_map(move |k| (0..size[1]).flat_map(move |j| (0..size[0]).map(move |i| [i, j, k])))
    };
    let distances: Vec<f64> = (0..nodes[1] * nodes[2])
        .into_par_iter()
        .flat_map_iter(|row| (0..nodes[0]).map(move |i| [i, row % nodes[1], row / nodes[1]]))
        .map(|at| solid(place(at)))
        .collect();
    let distance = |at: [usize; 3]| distances[index(nodes, at)];

    let mut mesh = TriMesh::default();
    let mut vertex = vec![u32::MAX; cells.iter().product()];
    for cell in all(cells) {
        let (mut sum, mut crossings) = (V::zeros(), 0.0);
        for (axis, side) in (0..3).flat_map(|axis| (0..4).map(move |side| (axis, side))) {
            let mut from = cell;
            from[(axis + 1) % 3] += side & 1;
            from[(axis + 2) % 3] += side >> 1;
            let mut to = from;
            to[axis] += 1;
            let [a, b] = [from, to].map(distance);
            if (a < 0.0) != (b < 0.0) {
                sum += place(from).lerp(&place(to), a / (a - b));
                crossings += 1.0;
            }
        }
        if crossings > 0.0 {
            vertex[index(cells, cell)] = mesh.vertices.len() as u32;
            let [low, high] = [cell, cell.map(|i| i + 1)].map(place);
            mesh.vertices.push(settled(&solid, sum / crossings, low, high));
        }
    }
    for at in all(nodes) {
        for axis in 0..3 {
            let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
            if at[axis] == cells[axis] || [next, last].iter().any(|a| at[*a] == 0 || at[*a] == cells[*a]) {
                continue;
            }
            let mut to = at;
            to[axis] += 1;
            let [inside, beyond] = [at, to].map(|at| distance(at) < 0.0);
            if inside == beyond {
                continue;
            }
            // The four cells around the edge, counter-clockwise seen from its end.
            let around = [[1, 1], [0, 1], [0, 0], [1, 0]].map(|[back, down]| {
                let mut cell = at;
                cell[next] -= back;
                cell[last] -= down;
                vertex[index(cells, cell)]
            });
            let [a, b, c, d] = if inside { around } else { [around[3], around[2], around[1], around[0]] };
            let length = |i: u32, j: u32| (mesh.vertices[i as usize] - mesh.vertices[j as usize]).norm();
            mesh.triangles.extend(match length(a, c) <= length(b, d) {
                true => [[a, b, c], [a, c, d]],
                false => [[a, b, d], [b, c, d]],
            });
        }
    }
    mesh
}

/// The point of the surface of `solid` near `x` within the box from `low` to `high`. Vertices that stay in
/// their cells keep faces from crossing.
pub(super) fn settled(solid: impl Fn(V) -> f64, mut x: V, low: V, high: V) -> V {
    for _ in 0..NEWTON_STEPS {
        let (distance, normal) = height(&solid, x);
        x = (x - normal * distance).sup(&low).inf(&high);
    }
    x
}
