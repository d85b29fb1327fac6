//! Caps over the holes of a mesh.
//!
//! Heads are cut at the neck, and open at the eyes. Hair that fell through such a hole would be inside
//! without having crossed a surface, and come out through the skin. Triangles over the rim of a hole close
//! it.

use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// Largest area of a hole relative to that of its patch. The rim of a hemisphere encloses half of its area,
/// that of a flat sheet all: they have an edge, but no inside to close.
const MAX_SHARE: f64 = 0.25;

/// Smallest area that the smoothed rim encloses in its mean plane, relative to the fan over it. A rim that
/// winds about, such as that of an open jacket, is no hole.
const MIN_FLATNESS: f64 = 0.5;

/// Smallest height of a triangle of a cap, relative to its longest side.
const MIN_HEIGHT: f64 = 1e-6;

/// Cost of the square of a triangle's longest side, relative to that of its area: of triangulations with the
/// same area that with the shortest sides is taken.
const SIDE_COST: f64 = 0.01;

/// Cosine of the angle between a triangle and the mean plane of its rim below which it costs no more. The
/// cost grows with the inverse of its square: a steep triangle would lie in the surface beside the hole, and
/// fold back over it.
const MIN_COSINE: f64 = 0.05;

/// Longest rim that is triangulated as a whole: the cost grows with its cube.
const MAX_RIM: usize = 300;

/// Edge on the boundary of a mesh.
pub(super) struct BoundaryEdge {
    /// Its vertices, in the order of its triangle.
    pub ends: [u32; 2],
    /// Area of the patch that it belongs to, m².
    pub patch_area: f64,
}

/// Triangles that close the holes of a mesh with these boundary edges, oriented as the triangles next to
/// them. `vertices` are at rest, m; `edges` are all edges in ascending order, the smaller index first.
pub(super) fn caps(
    vertices: &[Vector3<f64>],
    edges: &[[u32; 2]],
    boundary: &[BoundaryEdge],
) -> Vec<[u32; 3]> {
    let is_edge = |a: u32, b: u32| edges.binary_search(&[a.min(b), a.max(b)]).is_ok();
    let mut neighbours: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    let mut patch_area = BTreeMap::new();
    for edge in boundary {
        let [a, b] = edge.ends;
        neighbours.entry(a).or_default().push(b);
        neighbours.entry(b).or_default().push(a);
        patch_area.insert(a, edge.patch_area);
    }
    let along: BTreeSet<[u32; 2]> = boundary.iter().map(|edge| edge.ends).collect();
    let cap = |mut rim: Vec<u32>| {
        if along.contains(&[rim[0], rim[1]]) {
            rim.reverse();
        }
        let patch_area = patch_area[&rim[0]];
        cap(vertices, is_edge, rim, patch_area).unwrap_or_default()
    };
    rims(&neighbours).into_iter().flat_map(cap).collect()
}

/// The simple closed loops among boundary vertices with these neighbours.
fn rims(neighbours: &BTreeMap<u32, Vec<u32>>) -> Vec<Vec<u32>> {
    let mut seen = BTreeSet::new();
    let mut rims = Vec::new();
    for &start in neighbours.keys() {
        let (mut rim, mut at) = (Vec::new(), Some(start));
        while let Some(vertex) = at.filter(|vertex| seen.insert(*vertex)) {
            rim.push(vertex);
            at = neighbours[&vertex].iter().copied().find(|next| !seen.contains(next));
        }
        let closed = rim.last().is_some_and(|last| neighbours[last].contains(&start));
        if closed && rim.len() > 2 && rim.iter().all(|vertex| neighbours[vertex].len() == 2) {
            rims.push(rim);
        }
    }
    rims
}

/// Triangles over a rim; `None` if it encloses no hole, or if there are none without a side along an edge of
/// the mesh: they would fold back over a triangle there, as on a rim of teeth.
fn cap(
    vertices: &[Vector3<f64>],
    is_edge: impl Fn(u32, u32) -> bool,
    mut rim: Vec<u32>,
    patch_area: f64,
) -> Option<Vec<[u32; 3]>> {
    let at = |vertex: u32| &vertices[vertex as usize];
    // The middles of the edges: faces left out leave teeth.
    let n = rim.len();
    let middles: Vec<_> = (0..n).map(|i| 0.5 * (at(rim[i]) + at(rim[(i + 1) % n]))).collect();
    let centre = middles.iter().sum::<Vector3<f64>>() / n as f64;
    let fan = (0..n).map(|i| 0.5 * (middles[i] - centre).cross(&(middles[(i + 1) % n] - centre)));
    let (normal, fan) =
        fan.fold((Vector3::zeros(), 0.0), |(sum, size), part| (sum + part, size + part.norm()));
    let area = normal.norm();
    if area > MAX_SHARE * patch_area || area < MIN_FLATNESS * fan {
        return None;
    }
    let normal = normal / area;
    let cost = |[a, b, c]: [u32; 3]| {
        let [ab, ac, bc] = [at(b) - at(a), at(c) - at(a), at(c) - at(b)];
        let longest = ab.norm_squared().max(ac.norm_squared()).max(bc.norm_squared());
        let vector = ab.cross(&ac);
        let area = vector.norm();
        let flat = (normal.dot(&vector) / area).max(MIN_COSINE);
        if area > MIN_HEIGHT * longest { area / (flat * flat) + SIDE_COST * longest } else { f64::INFINITY }
    };
    let mut caps = Vec::new();
    while rim.len() > MAX_RIM {
        let n = rim.len();
        let ear = |i: usize| [rim[(i + n - 1) % n], rim[i], rim[(i + 1) % n]];
        let costs =
            (0..n).map(|i| (if is_edge(ear(i)[0], ear(i)[2]) { f64::INFINITY } else { cost(ear(i)) }, i));
        let (_, i) = costs.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(cost, _)| cost.is_finite())?;
        caps.push(ear(i));
        rim.remove(i);
    }
    caps.extend(triangulate(&rim, is_edge, cost)?);
    Some(caps)
}

/// The triangulation of a polygon in space of least cost (P. Liepa, "Filling holes in meshes", 2003, section
/// 3.1), none of whose diagonals `is_edge`.
fn triangulate(
    rim: &[u32],
    is_edge: impl Fn(u32, u32) -> bool,
    cost: impl Fn([u32; 3]) -> f64,
) -> Option<Vec<[u32; 3]>> {
    let n = rim.len();
    // Least cost of the part from one vertex to another, and the vertex that makes a triangle with both.
    let mut best = vec![(0.0, 0); n * n];
    for span in 2..n {
        for from in 0..n - span {
            let to = from + span;
            let is_diagonal = span < n - 1;
            best[from * n + to] = if is_diagonal && is_edge(rim[from], rim[to]) {
                (f64::INFINITY, 0)
            } else {
                let total =
                    |k: usize| best[from * n + k].0 + best[k * n + to].0 + cost([rim[from], rim[k], rim[to]]);
                (from + 1..to).map(|k| (total(k), k)).min_by(|a, b| a.0.total_cmp(&b.0))?
            };
        }
    }
    let mut triangles = Vec::new();
    let mut parts = vec![(0, n - 1)];
    while let Some((from, to)) = parts.pop().filter(|_| best[n - 1].0.is_finite()) {
        if to > from + 1 {
            let (_, k) = best[from * n + to];
            triangles.push([rim[from], rim[k], rim[to]]);
            parts.extend([(from, k), (k, to)]);
        }
    }
    (!triangles.is_empty()).then_some(triangles)
}

#[cfg(test)]
mod tests {
    use crate::geometry::{Shape, SolidMesh, TriMesh};
    use nalgebra::Vector3;
    use std::collections::BTreeSet;

    /// A ball of 0.1 m about the origin, without the triangles of which `cut` is true at the centre.
    fn cut_ball(cut: impl Fn(&Vector3<f64>) -> bool) -> TriMesh {
        let mut ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.1 }.tessellate();
        let vertices = &ball.vertices;
        ball.triangles
            .retain(|t| !cut(&(t.map(|i| vertices[i as usize]).iter().sum::<Vector3<f64>>() / 3.0)));
        ball
    }

    fn is_open(mesh: &TriMesh) -> bool {
        SolidMesh::new(&mesh.vertices, &mesh.triangles).boundary().next().is_some()
    }

    #[test]
    fn a_neck_and_eyes_are_closed_and_their_inside_is_below_the_cap() {
        let eye = |p: &Vector3<f64>, x: f64| (p - Vector3::new(x, 0.04, 0.08)).norm() < 0.03;
        let mesh = cut_ball(|p| p.y < -0.07 || eye(p, 0.04) || eye(p, -0.04));
        assert!(!is_open(&mesh));
        let solid = SolidMesh::new(&mesh.vertices, &mesh.triangles);
        let rim = mesh.triangles.iter().flatten().map(|&i| mesh.vertices[i as usize].y).fold(0.1, f64::min);
        for height in [-0.01, -0.001, 0.001, 0.01] {
            let p = Vector3::new(0.002, rim + height, 0.003);
            let closest = solid.closest(&p, 1.0).unwrap();
            assert!((closest.distance + height).abs() < 0.003, "{height}: {closest:?}");
            assert_eq!(solid.winding_number(&p) > 0.5, height > 0.0);
        }
    }

    #[test]
    fn caps_share_no_edge_with_a_third_triangle() {
        // Teeth that flare out on every third edge of the rim.
        let mut mesh = cut_ball(|p| p.y < -0.07);
        let sides = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        let all: BTreeSet<[u32; 2]> = mesh.triangles.iter().flat_map(sides).collect();
        let rim: Vec<_> = all.iter().filter(|[a, b]| !all.contains(&[*b, *a])).copied().collect();
        for [a, b] in rim.into_iter().step_by(3) {
            let middle = 0.5 * (mesh.vertices[a as usize] + mesh.vertices[b as usize]);
            assert!(middle.y < -0.06, "on the rim");
            mesh.triangles.push([b, a, mesh.vertices.len() as u32]);
            mesh.vertices.push(Vector3::new(1.1 * middle.x, middle.y - 0.003, 1.1 * middle.z));
        }
        let solid = SolidMesh::new(&mesh.vertices, &mesh.triangles);
        assert!(!is_open(&mesh) && !solid.caps().is_empty());
        let mut found: Vec<[u32; 2]> = mesh.triangles.iter().chain(solid.caps()).flat_map(sides).collect();
        let count = found.len();
        found.sort_unstable();
        found.dedup();
        assert_eq!(found.len(), count, "no edge is run along twice in one direction");
        assert!(found.iter().all(|[a, b]| found.binary_search(&[*b, *a]).is_ok()));
    }

    #[test]
    fn sheets_and_winding_rims_stay_open() {
        let half = cut_ball(|p| p.y < 0.0);
        assert!(is_open(&half), "the rim of a hemisphere");
        // A band around the ball, open at the front: its rim goes to and fro.
        let jacket = cut_ball(|p| p.y.abs() > 0.07 || (p.z > 0.0 && p.x.abs() < 0.02));
        assert!(is_open(&jacket), "the rim of a jacket");
    }

    #[test]
    fn a_concave_rim_with_straight_sides_is_closed() {
        // A box of 20 by 2 by 20 squares of a grid, with an L-shaped hole in its upper face.
        let mut mesh = TriMesh::default();
        let mut quad = |corners: [[f64; 3]; 4]| {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(corners.map(Vector3::from));
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        };
        let n = 20.0;
        for (i, k) in (0..400).map(|cell| (f64::from(cell % 20), f64::from(cell / 20))) {
            let square = |y: f64| [[i, y, k], [i, y, k + 1.0], [i + 1.0, y, k + 1.0], [i + 1.0, y, k]];
            quad(square(0.0));
            let hole = (5.0..12.0).contains(&i) && (5.0..12.0).contains(&k) && (i < 8.0 || k < 8.0);
            if !hole {
                quad(square(2.0));
            }
        }
        for i in (0..20).map(f64::from) {
            let j = i + 1.0;
            quad([[i, 0.0, 0.0], [j, 0.0, 0.0], [j, 2.0, 0.0], [i, 2.0, 0.0]]);
            quad([[i, 0.0, n], [j, 0.0, n], [j, 2.0, n], [i, 2.0, n]]);
            quad([[0.0, 0.0, i], [0.0, 0.0, j], [0.0, 2.0, j], [0.0, 2.0, i]]);
            quad([[n, 0.0, i], [n, 0.0, j], [n, 2.0, j], [n, 2.0, i]]);
        }
        assert!(!is_open(&mesh));
        let solid = SolidMesh::new(&mesh.vertices, &mesh.triangles);
        for (x, z) in [(6.3, 6.4), (6.2, 10.7), (10.6, 6.9), (10.3, 10.2)] {
            let distance = |y: f64| solid.closest(&Vector3::new(x, y, z), 9.0).unwrap().distance;
            assert!((distance(2.5) - 0.5).abs() < 1e-12 && (distance(1.75) + 0.25).abs() < 1e-12);
        }
    }
}
