//! Topology of a triangle soup: welding, consistent winding, neighbours.

use nalgebra::Vector3;
use std::cmp::Ordering;

/// Lists of different lengths, one after the other.
#[derive(Debug, Clone, Default)]
pub struct Lists {
    offsets: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    /// From (list, item) pairs, items of a list sorted, each once.
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

/// Welded, consistently wound triangles with their edges.
#[derive(Debug)]
pub struct Topology {
    /// For each vertex the first of the points given that it stands for.
    pub source: Vec<u32>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Edges of each triangle; edge i runs from vertex i to vertex i + 1.
    pub triangle_edges: Vec<[u32; 3]>,
    /// Ends of each edge, the smaller index first.
    pub edges: Vec<[u32; 2]>,
    /// Triangles of each edge.
    pub edge_triangles: Lists,
    /// For each edge, the third vertex of its triangles.
    pub edge_opposite: Lists,
    /// For each vertex, the vertices it shares an edge with.
    pub ring: Lists,
    /// Triangles of each vertex.
    pub vertex_triangles: Lists,
    /// Edges of each vertex.
    pub vertex_edges: Lists,
    /// Whether each edge lies on an open border.
    pub edge_on_border: Vec<bool>,
    /// The same of each vertex.
    pub vertex_on_border: Vec<bool>,
}

impl Topology {
    /// Of points in one or more `shapes`, the first of which is the mesh at rest. Points that are at the same place in all of
    /// them become one vertex; triangles that then have no area at rest are dropped, and of triangles on the same three vertices
    /// one is kept. In each patch joined by edges of two triangles the winding is made consistent: with that of the
    /// greater area at rest, or outward where the patch is closed.
    pub fn new(shapes: &[&[Vector3<f64>]], triangles: &[[u32; 3]]) -> Self {
        let (source, place) = weld(shapes);
        let vertices: Vec<_> = source.iter().map(|&i| shapes[0][i as usize]).collect();
        let mut triangles: Vec<[u32; 3]> = triangles
            .iter()
            .map(|t| t.map(|i| place[i as usize]))
            .filter(|t| has_area(t, &vertices))
            .collect();
        let mut seen: Vec<([u32; 3], usize)> = triangles.iter().copied().zip(0..).collect();
        seen.iter_mut().for_each(|(t, _)| t.sort_unstable());
        seen.sort_unstable();
        seen.dedup_by_key(|(t, _)| *t);
        let mut kept: Vec<usize> = seen.into_iter().map(|(_, i)| i).collect();
        kept.sort_unstable();
        triangles = kept.into_iter().map(|i| triangles[i]).collect();

        let (edges, edge_triangles) = find_edges(&triangles);
        wind_consistently(&vertices, &mut triangles, &edges, &edge_triangles);

        let edge_of = |a: u32, b: u32| {
            // Present by construction: `edges` holds every side of every triangle.
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
        let edge_on_border: Vec<bool> =
            (0..edges.len()).map(|e| edge_triangles.get(e as u32).len() == 1).collect();
        let mut vertex_on_border = vec![false; vertices.len()];
        for (ends, _) in edges.iter().zip(&edge_on_border).filter(|(_, border)| **border) {
            ends.iter().for_each(|&v| vertex_on_border[v as usize] = true);
        }
        Topology {
            edge_on_border,
            vertex_on_border,
            vertex_triangles: Lists::from_pairs(vertices.len(), corners),
            vertex_edges: Lists::from_pairs(vertices.len(), ends),
            edge_opposite: Lists::from_pairs(edges.len(), opposite),
            ring: Lists::from_pairs(vertices.len(), ring),
            source,
            triangles,
            triangle_edges,
            edges,
            edge_triangles,
        }
    }
}

/// First points of the distinct places in order of first use, and the place of each point. Exact equality: near-duplicates are
/// not merged, because a thin gap may be meant.
fn weld(shapes: &[&[Vector3<f64>]]) -> (Vec<u32>, Vec<u32>) {
    let points = shapes[0].len();
    let mut order: Vec<usize> = (0..points).collect();
    let compare = |i: &usize, j: &usize| {
        let coordinates = |i: usize| shapes.iter().flat_map(move |shape| shape[i].iter());
        // + 0.0 makes −0 and 0 one place.
        let mut orders = coordinates(*i).zip(coordinates(*j)).map(|(a, b)| (a + 0.0).total_cmp(&(b + 0.0)));
        orders.find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
    };
    order.sort_by(|i, j| compare(i, j).then(i.cmp(j)));
    let mut first = vec![0usize; points];
    for k in 0..order.len() {
        let same = k > 0 && compare(&order[k - 1], &order[k]).is_eq();
        first[order[k]] = if same { first[order[k - 1]] } else { order[k] };
    }
    let mut place = vec![0u32; points];
    let mut source = Vec::new();
    for i in 0..points {
        if first[i] == i {
            place[i] = source.len() as u32;
            source.push(i as u32);
        } else {
            place[i] = place[first[i]];
        }
    }
    (source, place)
}

fn has_area(t: &[u32; 3], vertices: &[Vector3<f64>]) -> bool {
    let [a, b, c] = t.map(|i| vertices[i as usize]);
    let n = (b - a).cross(&(c - a)).norm_squared();
    // A needle whose height is 1e-10 of its length has no usable normal; its edges are kept by its neighbours.
    n > 1e-20 * (b - a).norm_squared().max((c - a).norm_squared()).max((c - b).norm_squared()).powi(2)
}

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

fn wind_consistently(
    vertices: &[Vector3<f64>],
    triangles: &mut [[u32; 3]],
    edges: &[[u32; 2]],
    edge_triangles: &Lists,
) {
    let runs_along = |t: &[u32; 3], [a, b]: [u32; 2]| (0..3).any(|i| t[i] == a && t[(i + 1) % 3] == b);
    let mut neighbours: Vec<(u32, u32)> = Vec::new();
    let mut open = vec![false; triangles.len()];
    for (e, &edge) in edges.iter().enumerate() {
        match *edge_triangles.get(e as u32) {
            [s, t] => {
                // The last bit tells whether the two windings disagree.
                let (ts, tt) = (&triangles[s as usize], &triangles[t as usize]);
                let against = u32::from(runs_along(ts, edge) == runs_along(tt, edge));
                neighbours.push((s, 2 * t + against));
                neighbours.push((t, 2 * s + against));
            }
            ref others => others.iter().for_each(|&t| open[t as usize] = true),
        }
    }
    let neighbours = Lists::from_pairs(triangles.len(), neighbours);
    let mut flip: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut patch = Vec::new();
    for seed in 0..triangles.len() {
        if flip[seed].is_some() {
            continue;
        }
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
        // Six times the volume, and twice the area, as wound after the flips; positive means: keep them.
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
