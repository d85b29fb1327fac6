//! Finer meshes where a solid is strongly curved: triangles are bisected at their longest edges (M.-C.
//! Rivara, "Algorithms for refining triangular grids suitable for adaptive and multigrid techniques", 1984),
//! which keeps them from becoming thin.

use super::solid::height;
use super::surface_nets::settled;
use crate::geometry::TriMesh;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Most bisections of a triangle's edge.
const ROUNDS: usize = 3;
/// Where along an edge its distance from the surface is taken: grooves may be narrow.
const PROBES: [f64; 3] = [0.25, 0.5, 0.75];

type Edge = [u32; 2];

fn edge(a: u32, b: u32) -> Edge {
    [a.min(b), a.max(b)]
}

/// `mesh`, closed, with the edges bisected that are somewhere farther than `tolerance`, m, off the surface
/// of `solid`; new vertices lie on it. The mesh stays closed.
pub(super) fn refined(
    solid: impl Fn(Vector3<f64>) -> f64 + Sync,
    mut mesh: TriMesh,
    tolerance: f64,
) -> TriMesh {
    for _ in 0..ROUNDS {
        let at = |mesh: &TriMesh, [a, b]: Edge, share: f64| {
            mesh.vertices[a as usize].lerp(&mesh.vertices[b as usize], share)
        };
        let edges: BTreeSet<Edge> =
            mesh.triangles.iter().flat_map(|[a, b, c]| [edge(*a, *b), edge(*b, *c), edge(*c, *a)]).collect();
        let off =
            |e: &Edge| PROBES.iter().any(|share| height(&solid, at(&mesh, *e, *share)).0.abs() > tolerance);
        let edges: Vec<Edge> = edges.into_iter().collect();
        let mut halved: BTreeSet<Edge> = edges.into_par_iter().filter(off).collect();
        let turned: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| longest_first(&mesh, *t)).collect();
        loop {
            let before = halved.len();
            for [a, b, c] in &turned {
                if halved.contains(&edge(*b, *c)) || halved.contains(&edge(*c, *a)) {
                    halved.insert(edge(*a, *b));
                }
            }
            if halved.len() == before {
                break;
            }
        }
        let mut new: BTreeMap<Edge, u32> = BTreeMap::new();
        for e in halved {
            let [a, b] = e.map(|i| mesh.vertices[i as usize]);
            let reach = Vector3::repeat(0.5 * (b - a).norm());
            let x = at(&mesh, e, 0.5);
            new.insert(e, mesh.vertices.len() as u32);
            mesh.vertices.push(settled(&solid, x, x - reach, x + reach));
        }
        mesh.triangles = turned.into_iter().flat_map(|t| parts(t, &new)).collect();
    }
    mesh
}

/// The corners of a triangle in their order, from the start of its longest edge.
fn longest_first(mesh: &TriMesh, [a, b, c]: [u32; 3]) -> [u32; 3] {
    let length = |i: u32, j: u32| {
        let [i, j] = edge(i, j);
        (mesh.vertices[i as usize] - mesh.vertices[j as usize]).norm_squared()
    };
    let [ab, bc, ca] = [length(a, b), length(b, c), length(c, a)];
    if ab >= bc && ab >= ca {
        [a, b, c]
    } else if bc >= ca {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// The parts of a triangle, the first edge of which is its longest, between its corners and the new vertices
/// on its edges.
fn parts([a, b, c]: [u32; 3], new: &BTreeMap<Edge, u32>) -> Vec<[u32; 3]> {
    let Some(&m) = new.get(&edge(a, b)) else { return vec![[a, b, c]] };
    let half = |(p, q): (u32, u32)| match new.get(&edge(p, q)) {
        Some(&n) => vec![[m, p, n], [m, n, q]],
        None => vec![[m, p, q]],
    };
    [(b, c), (c, a)].into_iter().flat_map(half).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::solid::{sphere, union};
    use crate::sample::surface_nets::{planes, surface};

    #[test]
    fn a_refined_mesh_is_closed_and_near_its_solid_with_most_faces_where_it_is_curved() {
        // A large ball, and a small one.
        let solid =
            |x: Vector3<f64>| union(sphere(x, [0.0; 3], 0.1), sphere(x, [0.0, 0.105, 0.0], 0.012), 0.004);
        let grid = [0, 1, 2].map(|_| planes(&[(-0.13, 0.012)], 0.14));
        let coarse = surface(solid, &grid);
        let tolerance = 2.5e-4;
        let fine = refined(solid, coarse.clone(), tolerance);
        let mut edges: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for [a, b, c] in &fine.triangles {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                assert_ne!(from, to);
                *edges.entry([from, to]).or_default() += 1;
            }
        }
        assert!(edges.iter().all(|([a, b], n)| *n == 1 && edges.get(&[*b, *a]) == Some(&1)));
        let middle = |[a, b]: &[u32; 2]| 0.5 * (fine.vertices[*a as usize] + fine.vertices[*b as usize]);
        // The rounds end before the last edges in the groove between the balls are short enough.
        let mut off: Vec<f64> = edges.keys().map(|e| height(solid, middle(e)).0.abs()).collect();
        off.sort_by(f64::total_cmp);
        assert!(off[off.len() * 95 / 100] < tolerance, "{} m", off[off.len() * 95 / 100]);
        let on_top = |mesh: &TriMesh| mesh.vertices.iter().filter(|x| x.y > 0.1).count() as f64;
        let share = |mesh: &TriMesh| on_top(mesh) / mesh.vertices.len() as f64;
        assert!(share(&fine) > 2.0 * share(&coarse), "{} of {}", share(&fine), share(&coarse));
        assert!(fine.triangles.len() < 2 * coarse.triangles.len());
    }
}
