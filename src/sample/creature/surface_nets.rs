//! The mesh of an implicit surface: a vertex in each cell of a grid that the surface crosses (S. F. F. Gibson,
//! "Constrained elastic surface nets", 1998).

use crate::geometry::TriMesh;
use nalgebra::Vector3;
use std::array::from_fn;

type V = Vector3<f64>;

/// The surface on which `height`, m, is 0 within `bounds`, m, on cells of side `cell`, m; closed, with normals
/// towards greater heights.
pub(super) fn surface_nets(height: impl Fn(&V) -> f64, bounds: [V; 2], cell: f64) -> TriMesh {
    let cells: [usize; 3] = from_fn(|axis| ((bounds[1] - bounds[0])[axis] / cell).ceil() as usize);
    let nodes = cells.map(|n| n + 1);
    let index = |size: &[usize; 3], at: [usize; 3]| (at[2] * size[1] + at[1]) * size[0] + at[0];
    let position = |at: [usize; 3]| bounds[0] + V::from_fn(|axis, _| at[axis] as f64 * cell);
    let all = |size: [usize; 3]| {
        (0..size[2]).flat_map(move |k| (0..size[1]).flat_map(move |j| (0..size[0]).map(move |i| [i, j, k])))
    };
    let heights: Vec<f64> = all(nodes).map(|at| height(&position(at))).collect();
    let at_node = |at: [usize; 3]| heights[index(&nodes, at)];

    let mut mesh = TriMesh::default();
    let mut vertex = vec![u32::MAX; cells.iter().product()];
    for at in all(cells) {
        let (mut sum, mut crossings) = (V::zeros(), 0.0);
        for axis in 0..3 {
            for side in 0..4 {
                let mut from = at;
                from[(axis + 1) % 3] += side & 1;
                from[(axis + 2) % 3] += side >> 1;
                let mut to = from;
                to[axis] += 1;
                let [a, b] = [from, to].map(at_node);
                if (a < 0.0) != (b < 0.0) {
                    sum += position(from).lerp(&position(to), a / (a - b));
                    crossings += 1.0;
                }
            }
        }
        if crossings > 0.0 {
            vertex[index(&cells, at)] = mesh.vertices.len() as u32;
            mesh.vertices.push(sum / crossings);
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
            let [inside, beyond] = [at, to].map(|at| at_node(at) < 0.0);
            if inside == beyond {
                continue;
            }
            // The four cells around the edge, counter-clockwise seen from its end.
            let around = [[1, 1], [0, 1], [0, 0], [1, 0]].map(|[back, down]| {
                let mut cell = at;
                cell[next] -= back;
                cell[last] -= down;
                vertex[index(&cells, cell)]
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
