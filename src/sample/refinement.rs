//! Finer meshes where a solid is strongly curved: triangles are bisected at their longest edges (M.-C. Rivara,
//! "Algorithms for refining triangular grids suitable for adaptive and multigrid techniques", 1984), which keeps
//! them from becoming thin.

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

/// The parts of a triangle, the first edge of which is its longest, between its corners and the new vertices on
/// its edges.
fn parts([a, b, c]: [u32; 3], new: &BTreeMap<Edge, u32>) -> Vec<[u32; 3]> {
    let Some(&m) = new.get(&edge(a, b)) else { return vec![[a, b, c]] };
    let half = |(p, q): (u32, u32)| match new.get(&edge(p, q)) {
        Some(&n) => vec![[m, p, n], [m, n, q]],
        None => vec![[m, p, q]],
    };
    [(b, c), (c, a)].into_iter().flat_map(half).collect()
}
