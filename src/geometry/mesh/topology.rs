//! Topology of a triangle soup: welding, closing of holes, consistent orientation, adjacency.

use super::holes::{BoundaryEdge, caps};
use super::winding::boundary_fan;
use nalgebra::Vector3;
use std::cmp::Ordering;

/// Lists of different lengths in one array (compressed sparse rows).
#[derive(Debug, Clone, Default)]
pub struct Lists {
    offsets: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    /// From (list, item) pairs; the items of a list become sorted and unique.
    fn from_pairs(lists: usize, mut pairs: Vec<(u32, u32)>) -> Self {
        pairs.sort_unstable();
        pairs.dedup();
        let mut offsets = vec![0; lists + 1];
        for &(list, _) in &pairs {
            offsets[list as usize + 1] += 1;
        }
        for i in 0..lists {
            offsets[i + 1] += offsets[i];
        }
        Lists { offsets, items: pairs.into_iter().map(|(_, item)| item).collect() }
    }

    /// Items of a list.
    pub fn get(&self, list: u32) -> &[u32] {
        let i = list as usize;
        &self.items[self.offsets[i] as usize..self.offsets[i + 1] as usize]
    }
}

/// Welded, consistently oriented triangles and their adjacency.
#[derive(Debug)]
pub struct Topology {
    /// For each vertex, the first input point welded into it.
    pub source: Vec<u32>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Those that close holes, as input points, oriented as the input.
    pub caps: Vec<[u32; 3]>,
    /// Edges of each triangle; edge i runs from vertex i to vertex i + 1.
    pub triangle_edges: Vec<[u32; 3]>,
    /// Ends of each edge, the smaller index first.
    pub edges: Vec<[u32; 2]>,
    /// Triangles of each edge.
    pub edge_triangles: Lists,
    /// For each edge, the vertices of its triangles opposite to it.
    pub edge_opposite: Lists,
    /// For each vertex, the vertices it shares an edge with (its one-ring).
    pub ring: Lists,
    /// Triangles of each vertex.
    pub vertex_triangles: Lists,
    /// Edges of each vertex.
    pub vertex_edges: Lists,
    /// Whether each edge lies on the boundary of an open mesh.
    pub edge_on_boundary: Vec<bool>,
    /// Whether each vertex lies on the boundary of an open mesh.
    pub vertex_on_boundary: Vec<bool>,
    /// Whether each vertex is one of a cap, or shares an edge with one.
    pub vertex_near_cap: Vec<bool>,
    /// Triangles with the boundary of an open mesh ([`boundary_fan`]).
    pub boundary_fan: Vec<[u32; 3]>,
}

impl Topology {
    /// Topology of `triangles` over points at one or more sets of `positions`, of which the first is the mesh
    /// at rest.
    ///
    /// Points that coincide in all sets are welded. Triangles without area at rest are dropped, and of
    /// triangles on the same three vertices one is kept. Holes are closed ([`caps`]). Each patch connected by
    /// edges of two triangles is oriented consistently: outward if it is closed, else as the larger part of
    /// its area at rest.
    pub fn new(positions: &[&[Vector3<f64>]], triangles: &[[u32; 3]]) -> Self {
        let (source, welded) = weld(positions);
        let vertices: Vec<_> = source.iter().map(|&i| positions[0][i as usize]).collect();
        let mut triangles: Vec<[u32; 3]> = triangles
            .iter()
            .map(|t| t.map(|i| welded[i as usize]))
            .filter(|t| has_area(t, &vertices))
            .collect();
        triangles = without_duplicates(&triangles);
        let (mut edges, mut edge_triangles) = find_edges(&triangles);
        let caps = caps(&vertices, &edges, &boundary(&vertices, &triangles, &edges, &edge_triangles));
        if !caps.is_empty() {
            triangles.extend(&caps);
            (edges, edge_triangles) = find_edges(&triangles);
        }
        orient_consistently(&vertices, &mut triangles, &edges, &edge_triangles);

        let edge_of = |a: u32, b: u32| {
            // Always found: `edges` holds every side of every triangle.
            edges.binary_search(&[a.min(b), a.max(b)]).unwrap_or(0) as u32
        };
        let triangle_edges: Vec<[u32; 3]> =
            triangles.iter().map(|t| [0, 1, 2].map(|i| edge_of(t[i], t[(i + 1) % 3]))).collect();
        let opposite = triangle_edges
            .iter()
            .zip(&triangles)
            .flat_map(|(e, t)| (0..3).map(move |i| (e[i], t[(i + 2) % 3])))
            .collect();
        let ring = edges.iter().flat_map(|&[a, b]| [(a, b), (b, a)]).collect();
        let corners = triangles.iter().zip(0..).flat_map(|(t, k)| t.map(|v| (v, k))).collect();
        let ends = edges.iter().zip(0..).flat_map(|(e, k)| e.map(|v| (v, k))).collect();
        let edge_on_boundary: Vec<bool> =
            (0..edges.len()).map(|e| edge_triangles.get(e as u32).len() == 1).collect();
        let mut vertex_on_boundary = vec![false; vertices.len()];
        for (ends, _) in edges.iter().zip(&edge_on_boundary).filter(|(_, boundary)| **boundary) {
            ends.iter().for_each(|&v| vertex_on_boundary[v as usize] = true);
        }
        let ring = Lists::from_pairs(vertices.len(), ring);
        let mut vertex_near_cap = vec![false; vertices.len()];
        for &v in caps.iter().flatten() {
            vertex_near_cap[v as usize] = true;
            ring.get(v).iter().for_each(|&next| vertex_near_cap[next as usize] = true);
        }
        Topology {
            boundary_fan: boundary_fan(&triangles),
            edge_on_boundary,
            vertex_near_cap,
            vertex_on_boundary,
            vertex_triangles: Lists::from_pairs(vertices.len(), corners),
            vertex_edges: Lists::from_pairs(vertices.len(), ends),
            edge_opposite: Lists::from_pairs(edges.len(), opposite),
            ring,
            caps: caps.iter().map(|t| t.map(|i| source[i as usize])).collect(),
            source,
            triangles,
            triangle_edges,
            edges,
            edge_triangles,
        }
    }
}

/// For each distinct position, in order of first use, its first point; and for each point, its distinct
/// position. Requires exact equality: near-duplicates stay apart, since a thin gap may be intended.
fn weld(positions: &[&[Vector3<f64>]]) -> (Vec<u32>, Vec<u32>) {
    let points = positions[0].len();
    let mut order: Vec<usize> = (0..points).collect();
    let compare = |i: &usize, j: &usize| {
        let coordinates = |i: usize| positions.iter().flat_map(move |x| x[i].iter());
        // + 0.0 makes −0 equal to 0.
        let mut orders = coordinates(*i).zip(coordinates(*j)).map(|(a, b)| (a + 0.0).total_cmp(&(b + 0.0)));
        orders.find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
    };
    order.sort_by(|i, j| compare(i, j).then(i.cmp(j)));
    let mut first = vec![0usize; points];
    for k in 0..order.len() {
        let same = k > 0 && compare(&order[k - 1], &order[k]).is_eq();
        first[order[k]] = if same { first[order[k - 1]] } else { order[k] };
    }
    let mut welded = vec![0u32; points];
    let mut source = Vec::new();
    for i in 0..points {
        if first[i] == i {
            welded[i] = source.len() as u32;
            source.push(i as u32);
        } else {
            welded[i] = welded[first[i]];
        }
    }
    (source, welded)
}

fn has_area(t: &[u32; 3], vertices: &[Vector3<f64>]) -> bool {
    let [a, b, c] = t.map(|i| vertices[i as usize]);
    let n = (b - a).cross(&(c - a)).norm_squared();
    // A needle whose height is 1e-10 of its length has no usable normal. Its neighbours keep its edges.
    n > 1e-20 * (b - a).norm_squared().max((c - a).norm_squared()).max((c - b).norm_squared()).powi(2)
}

/// Of triangles on the same three vertices, keeps the first.
fn without_duplicates(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut seen: Vec<([u32; 3], usize)> = triangles.iter().copied().zip(0..).collect();
    seen.iter_mut().for_each(|(t, _)| t.sort_unstable());
    seen.sort_unstable();
    seen.dedup_by_key(|(t, _)| *t);
    let mut kept: Vec<usize> = seen.into_iter().map(|(_, i)| i).collect();
    kept.sort_unstable();
    kept.into_iter().map(|i| triangles[i]).collect()
}

/// Edges in ascending order, and the triangles of each.
fn find_edges(triangles: &[[u32; 3]]) -> (Vec<[u32; 2]>, Lists) {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for (k, t) in triangles.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], k as u32));
        }
    }
    sides.sort_unstable();
    let mut edges: Vec<[u32; 2]> = Vec::new();
    let mut pairs = Vec::with_capacity(sides.len());
    for (edge, triangle) in sides {
        if edges.last() != Some(&edge) {
            edges.push(edge);
        }
        pairs.push((edges.len() as u32 - 1, triangle));
    }
    let count = edges.len();
    (edges, Lists::from_pairs(count, pairs))
}

/// The edges of one triangle only, in ascending order.
fn boundary(
    vertices: &[Vector3<f64>],
    triangles: &[[u32; 3]],
    edges: &[[u32; 2]],
    edge_triangles: &Lists,
) -> Vec<BoundaryEdge> {
    let (neighbours, _) = neighbours(triangles, edges, edge_triangles);
    let area = |t: usize| {
        let [a, b, c] = triangles[t].map(|i| vertices[i as usize]);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    let mut patch_area = vec![0.0; triangles.len()];
    let (mut seen, mut patch) = (vec![None; triangles.len()], Vec::new());
    for seed in 0..triangles.len() {
        if seen[seed].is_none() {
            flood(seed, &neighbours, &mut seen, &mut patch);
            let sum = patch.iter().map(|&t| area(t)).sum::<f64>();
            patch.iter().for_each(|&t| patch_area[t] = sum);
        }
    }
    let of_one = |(&[a, b], e): (&[u32; 2], u32)| match *edge_triangles.get(e) {
        [t] => {
            let ends = if runs_along(&triangles[t as usize], [a, b]) { [a, b] } else { [b, a] };
            Some(BoundaryEdge { ends, patch_area: patch_area[t as usize] })
        }
        _ => None,
    };
    edges.iter().zip(0..).filter_map(of_one).collect()
}

/// Reverses triangles so that each patch is oriented consistently, see [`Topology::new`].
fn orient_consistently(
    vertices: &[Vector3<f64>],
    triangles: &mut [[u32; 3]],
    edges: &[[u32; 2]],
    edge_triangles: &Lists,
) {
    let (neighbours, open) = neighbours(triangles, edges, edge_triangles);
    let mut flip: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut patch = Vec::new();
    for seed in 0..triangles.len() {
        if flip[seed].is_some() {
            continue;
        }
        flood(seed, &neighbours, &mut flip, &mut patch);
        // Six times the volume, or twice the area, with the flips applied; the flips are kept if it is
        // positive.
        let closed = patch.iter().all(|&t| !open[t]);
        let origin = vertices[triangles[seed][0] as usize];
        let keep: f64 = patch
            .iter()
            .map(|&t| {
                let [a, b, c] = triangles[t].map(|i| vertices[i as usize] - origin);
                let sign = if flip[t] == Some(true) { -1.0 } else { 1.0 };
                let area_vector = (b - a).cross(&(c - a));
                if closed { sign * a.dot(&area_vector) } else { sign * area_vector.norm() }
            })
            .sum();
        for &t in &patch {
            if (flip[t] == Some(true)) == (keep >= 0.0) {
                triangles[t].swap(1, 2);
            }
        }
    }
}

/// Whether a triangle has the edge from `a` to `b` in this direction.
fn runs_along(t: &[u32; 3], [a, b]: [u32; 2]) -> bool {
    (0..3).any(|i| t[i] == a && t[(i + 1) % 3] == b)
}

/// Triangles across the edges of exactly two triangles, and whether each triangle has another kind of edge. A
/// neighbour is encoded as twice its index, plus 1 if the two orientations disagree.
fn neighbours(triangles: &[[u32; 3]], edges: &[[u32; 2]], edge_triangles: &Lists) -> (Lists, Vec<bool>) {
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    let mut open = vec![false; triangles.len()];
    for (e, &edge) in edges.iter().enumerate() {
        match *edge_triangles.get(e as u32) {
            [s, t] => {
                let (ts, tt) = (&triangles[s as usize], &triangles[t as usize]);
                let disagree = u32::from(runs_along(ts, edge) == runs_along(tt, edge));
                pairs.push((s, 2 * t + disagree));
                pairs.push((t, 2 * s + disagree));
            }
            ref others => others.iter().for_each(|&t| open[t as usize] = true),
        }
    }
    (Lists::from_pairs(triangles.len(), pairs), open)
}

/// Collects the patch of `seed` breadth-first, and whether each triangle must be flipped to agree with the
/// seed.
fn flood(seed: usize, neighbours: &Lists, flip: &mut [Option<bool>], patch: &mut Vec<usize>) {
    flip[seed] = Some(false);
    patch.clear();
    patch.push(seed);
    let mut next = 0;
    while next < patch.len() {
        let s = patch[next];
        next += 1;
        for &code in neighbours.get(s as u32) {
            let t = (code / 2) as usize;
            if flip[t].is_none() {
                flip[t] = flip[s].map(|f| f ^ (code % 2 == 1));
                patch.push(t);
            }
        }
    }
}
