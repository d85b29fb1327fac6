//! Triangle mesh as a solid: signed distance by angle-weighted pseudonormals (J. A. Baerentzen & H. Aanaes, "Signed
//! distance computation using the angle weighted pseudonormal", 2005).

use super::topology::Topology;
use super::winding::Winding;
use crate::geometry::bounds::Bounds;
use crate::geometry::distance::{TriangleFeature, barycentric, closest_on_triangle};
use crate::geometry::surface_point::{Feature, SurfacePoint};
use crate::math::polyline::closest_on_segment;
use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use std::sync::{Arc, OnceLock};

/// Below this length, m, a difference of coordinates is rounding and has no direction.
const ROUNDING: f64 = 1e-12;

/// A triangle mesh in one shape, open or closed, with a bounding volume hierarchy over its triangles.
///
/// Where the closest feature is on an open border the point counts as outside: it is beside the sheet, not behind it.
#[derive(Debug)]
pub struct SolidMesh {
    pub(super) topology: Arc<Topology>,
    pub(super) vertices: Vec<Vector3<f64>>,
    face_normals: Vec<Vector3<f64>>,
    edge_normals: Vec<Vector3<f64>>,
    vertex_normals: Vec<Vector3<f64>>,
    bvh: Bvh,
    /// Made when it is first asked for: of the shapes that a mesh takes few are.
    winding: OnceLock<Winding>,
}

impl SolidMesh {
    /// From a triangle soup, m, body frame; welded and wound consistently (see [`Topology::new`]).
    pub fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Self {
        SolidMesh::of_shapes(&[vertices], triangles)
    }

    /// A mesh that will take `shapes`, in the first of them.
    pub(super) fn of_shapes(shapes: &[&[Vector3<f64>]], triangles: &[[u32; 3]]) -> Self {
        let topology = Topology::new(shapes, triangles);
        let vertices: Vec<_> = topology.source.iter().map(|&i| shapes[0][i as usize]).collect();
        let boxes: Vec<Aabb> = topology.triangles.iter().map(|t| bounding_box(t, &vertices)).collect();
        let bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        SolidMesh::with_normals(Arc::new(topology), vertices, bvh)
    }

    /// The same mesh with its vertices elsewhere, its hierarchy refitted: that of the mesh at rest, whatever came between, so
    /// that the order of what it finds has no history.
    pub(super) fn reshaped(&self, vertices: Vec<Vector3<f64>>) -> Self {
        let mut bvh = self.bvh.clone();
        for (t, k) in self.topology.triangles.iter().zip(0..) {
            bvh.insert_or_update_partially(bounding_box(t, &vertices), k, 0.0);
        }
        bvh.refit_without_opt();
        SolidMesh::with_normals(Arc::clone(&self.topology), vertices, bvh)
    }

    fn with_normals(topology: Arc<Topology>, vertices: Vec<Vector3<f64>>, bvh: Bvh) -> Self {
        let zero = Vector3::zeros();
        let mut edge_normals = vec![zero; topology.edges.len()];
        let mut vertex_normals = vec![zero; vertices.len()];
        let mut face_normals = Vec::with_capacity(topology.triangles.len());
        // A triangle of no area, into which a mesh may deform, has no say.
        let unit = |n: Vector3<f64>| n.try_normalize(0.0).unwrap_or(zero);
        for (t, edges) in topology.triangles.iter().zip(&topology.triangle_edges) {
            let v = t.map(|i| vertices[i as usize]);
            let n = unit((v[1] - v[0]).cross(&(v[2] - v[0])));
            for i in 0..3 {
                edge_normals[edges[i] as usize] += n;
                let corner = (v[(i + 1) % 3] - v[i]).angle(&(v[(i + 2) % 3] - v[i]));
                vertex_normals[t[i] as usize] += n * corner;
            }
            face_normals.push(n);
        }
        edge_normals.iter_mut().chain(&mut vertex_normals).for_each(|n| *n = unit(*n));
        SolidMesh {
            topology,
            vertices,
            face_normals,
            edge_normals,
            vertex_normals,
            bvh,
            winding: OnceLock::new(),
        }
    }

    /// Number of triangles kept.
    pub fn triangle_count(&self) -> usize {
        self.topology.triangles.len()
    }

    /// Corners of a triangle.
    pub fn triangle(&self, t: u32) -> [&Vector3<f64>; 3] {
        self.topology.triangles[t as usize].map(|i| &self.vertices[i as usize])
    }

    /// Position of a vertex.
    pub fn vertex(&self, v: u32) -> &Vector3<f64> {
        &self.vertices[v as usize]
    }

    /// Ends of an edge.
    pub fn edge(&self, e: u32) -> [&Vector3<f64>; 2] {
        self.topology.edges[e as usize].map(|i| &self.vertices[i as usize])
    }

    /// A part of a triangle as a feature of the mesh.
    pub fn feature(&self, triangle: u32, part: TriangleFeature) -> Feature {
        let t = triangle as usize;
        match part {
            TriangleFeature::Vertex(i) => Feature::Vertex(self.topology.triangles[t][i]),
            TriangleFeature::Edge(i) => Feature::Edge(self.topology.triangle_edges[t][i]),
            TriangleFeature::Face => Feature::Face(triangle),
        }
    }

    /// Whether triangle `t` is the first of those that share its part `part`: each feature is owned once.
    pub fn owns(&self, t: u32, part: TriangleFeature) -> bool {
        let topology = &self.topology;
        match self.feature(t, part) {
            Feature::Edge(e) => topology.edge_triangles.get(e)[0] == t,
            Feature::Vertex(v) => topology.vertex_triangles.get(v)[0] == t,
            Feature::Face(_) | Feature::Smooth => true,
        }
    }

    /// The edges owned by a triangle.
    pub fn edges_owned_by(&self, t: u32) -> impl Iterator<Item = u32> {
        let edges = &self.topology.triangle_edges[t as usize];
        edges.iter().copied().filter(move |&e| self.topology.edge_triangles.get(e)[0] == t)
    }

    /// The first or last end of edge `e`, if `e` is the first edge of that vertex.
    pub fn vertex_owned_by(&self, e: u32, last: bool) -> Option<u32> {
        let v = self.topology.edges[e as usize][usize::from(last)];
        (self.topology.vertex_edges.get(v)[0] == e).then_some(v)
    }

    /// Pseudonormal of a feature: unit (zero only where faces cancel), outward.
    pub fn pseudonormal(&self, feature: Feature) -> Vector3<f64> {
        match feature {
            Feature::Face(i) => self.face_normals[i as usize],
            Feature::Edge(i) => self.edge_normals[i as usize],
            Feature::Vertex(i) => self.vertex_normals[i as usize],
            Feature::Smooth => Vector3::zeros(),
        }
    }

    /// Where the material at `point` of `feature` is in another shape of this mesh.
    pub fn carried(&self, point: &Vector3<f64>, feature: Feature, to: &SolidMesh) -> Vector3<f64> {
        if std::ptr::eq(self, to) {
            return *point;
        }
        match feature {
            Feature::Face(t) => barycentric_point(
                to.triangle(t),
                &barycentric(TriangleFeature::Face, point, self.triangle(t)),
            ),
            Feature::Edge(e) => {
                let ([a, b], [c, d]) = (self.edge(e), to.edge(e));
                c.lerp(d, closest_on_segment(point, a, b))
            }
            Feature::Vertex(v) => *to.vertex(v),
            Feature::Smooth => *point,
        }
    }

    /// Ends of the edges on open borders, m.
    pub fn border(&self) -> impl Iterator<Item = [Vector3<f64>; 2]> {
        let edges = self.topology.edges.iter().zip(&self.topology.edge_on_border);
        edges.filter(|(_, on)| **on).map(|(edge, _)| edge.map(|i| self.vertices[i as usize]))
    }

    /// Whether a feature lies on an open border.
    pub fn on_border(&self, feature: Feature) -> bool {
        match feature {
            Feature::Edge(i) => self.topology.edge_on_border[i as usize],
            Feature::Vertex(i) => self.topology.vertex_on_border[i as usize],
            Feature::Face(_) | Feature::Smooth => false,
        }
    }

    /// Whether `normal` at `point` of `feature` lies in the feature's normal cone: no triangle there rises above the plane
    /// through `point`, so that the point is a local minimum of the distance over the surface.
    pub fn supports(&self, feature: Feature, normal: &Vector3<f64>) -> bool {
        let below = |from: &Vector3<f64>, others: &[u32]| {
            others.iter().all(|&o| {
                let d = self.vertex(o) - from;
                normal.dot(&d) <= 1e-9 * d.norm()
            })
        };
        match feature {
            Feature::Face(_) | Feature::Smooth => true,
            Feature::Edge(e) => below(self.edge(e)[0], self.topology.edge_opposite.get(e)),
            Feature::Vertex(v) => below(self.vertex(v), self.topology.ring.get(v)),
        }
    }

    /// Signed distance, outward normal and side of `p` as seen from `point` on `feature`.
    pub fn signed(&self, p: &Vector3<f64>, point: &Vector3<f64>, feature: Feature) -> SurfacePoint {
        let offset = p - point;
        let distance = offset.norm();
        let pseudonormal = self.pseudonormal(feature);
        let outside = self.on_border(feature) || offset.dot(&pseudonormal) >= 0.0;
        let sign = if outside { 1.0 } else { -1.0 };
        let normal = if distance > ROUNDING { offset * (sign / distance) } else { pseudonormal };
        SurfacePoint { distance: sign * distance, normal, point: *point, feature }
    }

    /// Closest surface point to `p`, or `None` where it is `max_distance` away or more.
    pub fn closest(&self, p: &Vector3<f64>, max_distance: f64) -> Option<SurfacePoint> {
        let box_distance2 = |node: &BvhNode, _| {
            let (lo, hi) = (node.mins(), node.maxs());
            let gap = |x: f64, lo: f64, hi: f64| (lo - x).max(x - hi).max(0.0);
            let (dx, dy, dz) = (gap(p.x, lo.x, hi.x), gap(p.y, lo.y, hi.y), gap(p.z, lo.z, hi.z));
            dx * dx + dy * dy + dz * dz
        };
        let (triangle, (_, point, part)) = self
            .bvh
            .find_best(max_distance * max_distance, box_distance2, |t, _| {
                let (point, part) = closest_on_triangle(p, self.triangle(t));
                Some(Nearest((p - point).norm_squared(), point, part))
            })
            .map(|(t, Nearest(d, point, part))| (t, (d, point, part)))?;
        Some(self.signed(p, &point, self.feature(triangle, part)))
    }

    /// Where the way from `a` to `b` first goes through the surface, as a share of the way, and the triangle there.
    pub fn first_intersection(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, u32)> {
        let way = b - a;
        let inverse = way.map(f64::recip);
        let entry = |node: &BvhNode, best: f64| {
            let (lo, hi) = (node.mins(), node.maxs());
            let (mut from, mut to) = (0.0_f64, best);
            for i in 0..3 {
                let (s, t) = ((lo[i] - a[i]) * inverse[i], (hi[i] - a[i]) * inverse[i]);
                // Of a way along the sides of a box they are infinite, or no numbers and then no bounds.
                from = from.max(s.min(t));
                to = to.min(s.max(t));
            }
            if from <= to { from } else { f64::INFINITY }
        };
        let hit = self.bvh.find_best(1.0, entry, |t, _| Some(Hit(hit_triangle(a, &way, self.triangle(t))?)));
        hit.map(|(t, Hit(share))| (share, t))
    }

    /// Triangles whose boxes meet `bounds`, appended to `out` in the order of the hierarchy.
    pub fn triangles_in(&self, bounds: &Bounds, out: &mut Vec<u32>) {
        out.extend(self.bvh.leaves(|node| bounds.meets(node)));
    }

    /// Generalised winding number of the mesh about `p`: 1 inside a closed mesh, 0 outside, in between where it is open.
    /// Sum of the triangles' solid angles over 4π.
    pub fn winding_number(&self, p: &Vector3<f64>) -> f64 {
        let winding = || Winding::new(&self.vertices, &self.topology.triangles);
        self.winding.get_or_init(winding).number(&self.vertices, &self.topology.triangles, p)
    }
}

/// The point of a triangle with these barycentric barycentric.
pub fn barycentric_point(corners: [&Vector3<f64>; 3], w: &[f64; 3]) -> Vector3<f64> {
    corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2]
}

fn bounding_box(triangle: &[u32; 3], vertices: &[Vector3<f64>]) -> Aabb {
    let b = Bounds::around(triangle.iter().map(|&i| &vertices[i as usize]), 0.0);
    Aabb::new(b.min.into(), b.max.into())
}

/// Where a way from `a` goes through a triangle, from either side, as a share of the way (T. Möller & B. Trumbore 1997).
fn hit_triangle(a: &Vector3<f64>, way: &Vector3<f64>, corners: [&Vector3<f64>; 3]) -> Option<f64> {
    let [e1, e2] = [corners[1] - corners[0], corners[2] - corners[0]];
    let across = way.cross(&e2);
    let det = e1.dot(&across);
    let from = a - corners[0];
    let u = from.dot(&across) / det;
    let lift = from.cross(&e1);
    let v = way.dot(&lift) / det;
    let share = e2.dot(&lift) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&share)).then_some(share)
}

/// Share of a way, ordered.
struct Hit(f64);

impl parry3d_f64::partitioning::BvhLeafCost for Hit {
    fn cost(&self) -> f64 {
        self.0
    }
}

/// Squared distance, point and part, ordered by the first.
struct Nearest(f64, Vector3<f64>, TriangleFeature);

impl parry3d_f64::partitioning::BvhLeafCost for Nearest {
    fn cost(&self) -> f64 {
        self.0
    }
}
