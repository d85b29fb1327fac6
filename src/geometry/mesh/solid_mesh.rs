//! A triangle mesh as a solid: signed distance by angle-weighted pseudonormals (J. A. Baerentzen & H. Aanaes,
//! "Signed distance computation using the angle weighted pseudonormal", 2005); of a closed mesh, places that it does not
//! wind about are outside.

use super::topology::Topology;
use super::winding::{Ray, turns};
use crate::geometry::bounds::Bounds;
use crate::geometry::distance::triangle::{
    TriangleFeature, barycentric, barycentric_point, closest_on_triangle,
};
use crate::geometry::surface_point::{Feature, SurfacePoint};
use crate::math::polyline::closest_on_segment;
use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhLeafCost, BvhNode};
use std::sync::Arc;

/// Below this length, m, a difference of coordinates is rounding and has no direction.
const ROUNDING: f64 = 1e-12;

/// Distance from a surface, m, below which a place is taken to be in front of it.
const ON_SURFACE: f64 = 1e-4;

/// Cosine of the angle between outward normals above which a place is of the same part, which bends.
const BENT: f64 = 0.5;

/// Least cosine of the angle between the way out of a part and its outward normal. The nearest points of faces
/// that bend away are on their edges.
const AHEAD: f64 = 0.5;

/// A triangle mesh in one configuration, open or closed, with a bounding volume hierarchy over its triangles.
/// Holes, such as that at the neck of a head, are closed.
///
/// A point whose closest feature lies on the boundary of an open mesh counts as outside: it is beside the
/// sheet, not behind it.
#[derive(Debug)]
pub struct SolidMesh {
    pub(super) topology: Arc<Topology>,
    /// Positions, m, body frame.
    pub(super) vertices: Vec<Vector3<f64>>,
    normals: Pseudonormals,
    bvh: Bvh,
}

/// Unit pseudonormals of the features of a mesh; zero if the normals of adjacent faces cancel.
#[derive(Debug)]
struct Pseudonormals {
    faces: Vec<Vector3<f64>>,
    edges: Vec<Vector3<f64>>,
    vertices: Vec<Vector3<f64>>,
}

impl SolidMesh {
    /// From a triangle soup, m, body frame, which is welded and oriented consistently.
    pub fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Self {
        SolidMesh::from_positions(&[vertices], triangles)
    }

    /// A mesh that will take several sets of `positions`, in the first of them. Points are welded that
    /// coincide in all of them.
    pub fn from_positions(positions: &[&[Vector3<f64>]], triangles: &[[u32; 3]]) -> Self {
        let topology = Topology::new(positions, triangles);
        let vertices: Vec<_> = topology.source.iter().map(|&i| positions[0][i as usize]).collect();
        let boxes: Vec<Aabb> = topology.triangles.iter().map(|t| bounding_box(t, &vertices)).collect();
        let bvh = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        SolidMesh::assemble(Arc::new(topology), vertices, bvh)
    }

    /// The mesh with other positions of the points that it was made from.
    pub fn moved(&self, points: &[Vector3<f64>]) -> Self {
        self.with_vertices(self.topology.source.iter().map(|&i| points[i as usize]).collect())
    }

    /// The mesh with other positions of its vertices. The hierarchy of the mesh at rest is refitted, not
    /// rebuilt, so that the order of results does not depend on earlier configurations.
    pub(super) fn with_vertices(&self, vertices: Vec<Vector3<f64>>) -> Self {
        let mut bvh = self.bvh.clone();
        for (t, k) in self.topology.triangles.iter().zip(0..) {
            bvh.insert_or_update_partially(bounding_box(t, &vertices), k, 0.0);
        }
        bvh.refit_without_opt();
        SolidMesh::assemble(Arc::clone(&self.topology), vertices, bvh)
    }

    fn assemble(topology: Arc<Topology>, vertices: Vec<Vector3<f64>>, bvh: Bvh) -> Self {
        let normals = Pseudonormals::new(&topology, &vertices);
        SolidMesh { topology, vertices, normals, bvh }
    }

    /// The bounding box of its vertices, m.
    pub fn bounds(&self) -> Bounds {
        Bounds::around(&self.vertices, 0.0)
    }

    /// Number of triangles after welding.
    pub fn triangle_count(&self) -> usize {
        self.topology.triangles.len()
    }

    /// Number of its triangles without those that close holes, which come last.
    pub fn drawn_triangles(&self) -> u32 {
        (self.topology.triangles.len() - self.topology.caps.len()) as u32
    }

    /// Vertices of triangle `t`.
    pub fn corners(&self, t: u32) -> [u32; 3] {
        self.topology.triangles[t as usize]
    }

    /// Positions of all vertices, m.
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// Corners of triangle `t`, m.
    pub fn triangle(&self, t: u32) -> [&Vector3<f64>; 3] {
        self.topology.triangles[t as usize].map(|i| &self.vertices[i as usize])
    }

    /// Position of vertex `v`, m.
    pub fn vertex(&self, v: u32) -> &Vector3<f64> {
        &self.vertices[v as usize]
    }

    /// Ends of edge `e`, m.
    pub fn edge(&self, e: u32) -> [&Vector3<f64>; 2] {
        self.topology.edges[e as usize].map(|i| &self.vertices[i as usize])
    }

    /// A feature of a triangle as a feature of the mesh.
    pub fn feature(&self, triangle: u32, local: TriangleFeature) -> Feature {
        let t = triangle as usize;
        match local {
            TriangleFeature::Vertex(i) => Feature::Vertex(self.topology.triangles[t][i]),
            TriangleFeature::Edge(i) => Feature::Edge(self.topology.triangle_edges[t][i]),
            TriangleFeature::Face => Feature::Face(triangle),
        }
    }

    /// Whether triangle `t` is the first of those that share its feature `local`: each feature has one owner.
    pub fn owns(&self, t: u32, local: TriangleFeature) -> bool {
        let topology = &self.topology;
        match self.feature(t, local) {
            Feature::Edge(e) => topology.edge_triangles.get(e)[0] == t,
            Feature::Vertex(v) => topology.vertex_triangles.get(v)[0] == t,
            Feature::Face(_) | Feature::Smooth => true,
        }
    }

    /// Edges owned by triangle `t`.
    pub fn edges_owned_by(&self, t: u32) -> impl Iterator<Item = u32> {
        let edges = &self.topology.triangle_edges[t as usize];
        edges.iter().copied().filter(move |&e| self.topology.edge_triangles.get(e)[0] == t)
    }

    /// The first end, or the last, of edge `e`, if `e` is the first edge of that vertex.
    pub fn vertex_owned_by(&self, e: u32, last: bool) -> Option<u32> {
        let v = self.topology.edges[e as usize][usize::from(last)];
        (self.topology.vertex_edges.get(v)[0] == e).then_some(v)
    }

    /// Outward pseudonormal of a feature: unit, or zero if the normals of adjacent faces cancel.
    pub fn pseudonormal(&self, feature: Feature) -> Vector3<f64> {
        match feature {
            Feature::Face(i) => self.normals.faces[i as usize],
            Feature::Edge(i) => self.normals.edges[i as usize],
            Feature::Vertex(i) => self.normals.vertices[i as usize],
            Feature::Smooth => Vector3::zeros(),
        }
    }

    /// Position, in another configuration of this mesh, of the material at `point` of `feature`; m.
    pub fn material_point(&self, point: &Vector3<f64>, feature: Feature, to: &SolidMesh) -> Vector3<f64> {
        if std::ptr::eq(self, to) {
            return *point;
        }
        match feature {
            Feature::Face(t) => {
                let w = barycentric(TriangleFeature::Face, point, self.triangle(t));
                barycentric_point(to.triangle(t), &w)
            }
            Feature::Edge(e) => {
                let ([a, b], [c, d]) = (self.edge(e), to.edge(e));
                c.lerp(d, closest_on_segment(point, a, b))
            }
            Feature::Vertex(v) => *to.vertex(v),
            Feature::Smooth => *point,
        }
    }

    /// Triangles that close its holes, as indices of the points that it was made from, oriented as the
    /// triangles that it was made from.
    pub fn caps(&self) -> &[[u32; 3]] {
        &self.topology.caps
    }

    /// Ends of the boundary edges, m.
    pub fn boundary(&self) -> impl Iterator<Item = [Vector3<f64>; 2]> {
        let edges = self.topology.edges.iter().zip(&self.topology.edge_on_boundary);
        edges.filter(|(_, on)| **on).map(|(edge, _)| edge.map(|i| self.vertices[i as usize]))
    }

    /// Whether a feature lies on the boundary of an open mesh.
    fn on_boundary(&self, feature: Feature) -> bool {
        match feature {
            Feature::Edge(i) => self.topology.edge_on_boundary[i as usize],
            Feature::Vertex(i) => self.topology.vertex_on_boundary[i as usize],
            Feature::Face(_) | Feature::Smooth => false,
        }
    }

    /// Whether a feature belongs to a cap or lies next to one. A cap may pass through the surface near its
    /// rim, as behind the lids of an eye, and pseudonormals do not tell the side there.
    fn near_cap(&self, feature: Feature) -> bool {
        let near = |vertices: &[u32]| vertices.iter().any(|&v| self.topology.vertex_near_cap[v as usize]);
        match feature {
            Feature::Face(t) => near(&self.topology.triangles[t as usize]),
            Feature::Edge(e) => near(&self.topology.edges[e as usize]),
            Feature::Vertex(v) => near(&[v]),
            Feature::Smooth => false,
        }
    }

    /// Whether `normal` lies in the normal cone of `feature`: no adjacent triangle rises above the plane
    /// through the feature, so that it is a local minimum of the distance over the surface.
    pub fn in_normal_cone(&self, feature: Feature, normal: &Vector3<f64>) -> bool {
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

    /// Signed distance and outward normal of `p` relative to `point` on `feature`.
    pub fn surface_point(&self, p: &Vector3<f64>, point: &Vector3<f64>, feature: Feature) -> SurfacePoint {
        let offset = p - point;
        let distance = offset.norm();
        let pseudonormal = self.pseudonormal(feature);
        let outside = self.on_boundary(feature)
            || match self.near_cap(feature) {
                true => self.winding_number(p) <= 0.5,
                // Where the surface passes through itself, as at the fold of an ear, a face has its back outside.
                false => offset.dot(&pseudonormal) >= 0.0 || self.winds_past(p),
            };
        let sign = if outside { 1.0 } else { -1.0 };
        let normal = if distance > ROUNDING { offset * (sign / distance) } else { pseudonormal };
        SurfacePoint { distance: sign * distance, normal, point: *point, feature }
    }

    /// Surface point closest to `p`; `None` if it is `max_distance`, m, away or more.
    pub fn closest(&self, p: &Vector3<f64>, max_distance: f64) -> Option<SurfacePoint> {
        let (triangle, point, local) = self.nearest(p, max_distance, |_| true)?;
        Some(self.surface_point(p, &point, self.feature(triangle, local)))
    }

    /// Of the triangles that are `wanted`, that closest to `p`, its closest point, and the feature that this
    /// lies on; `None` if it is `max_distance`, m, away or more.
    pub fn nearest(
        &self,
        p: &Vector3<f64>,
        max_distance: f64,
        wanted: impl Fn(u32) -> bool,
    ) -> Option<(u32, Vector3<f64>, TriangleFeature)> {
        let box_distance2 = |node: &BvhNode, _| {
            let (lo, hi) = (node.mins(), node.maxs());
            let gap = |x: f64, lo: f64, hi: f64| (lo - x).max(x - hi).max(0.0);
            let (dx, dy, dz) = (gap(p.x, lo.x, hi.x), gap(p.y, lo.y, hi.y), gap(p.z, lo.z, hi.z));
            dx * dx + dy * dy + dz * dz
        };
        let (triangle, Nearest { point, local, .. }) =
            self.bvh.find_best(max_distance * max_distance, box_distance2, |t, _| {
                wanted(t).then(|| {
                    let (point, local) = closest_on_triangle(p, self.triangle(t));
                    Nearest { distance2: (p - point).norm_squared(), point, local }
                })
            })?;
        Some((triangle, point, local))
    }

    /// The point nearest to `p` of a part of the surface that faces the part `from`, the surface nearest to
    /// `p`: the cosine of the angle between their outward normals is below `cosine`. Either part tells its own
    /// side of `p`. `None` if the point is `max_distance`, m, away or more, or lies on the other side of the
    /// thin solid in front of which, or in which, `p` is.
    pub fn facing(
        &self,
        p: &Vector3<f64>,
        from: &SurfacePoint,
        cosine: f64,
        max_distance: f64,
    ) -> Option<SurfacePoint> {
        let faces = |t: u32| self.normals.faces[t as usize].dot(&from.normal) < cosine;
        let found = self.nearest_of_part(p, max_distance, faces)?;
        let behind = usize::from(found.distance < 0.0) + usize::from(is_behind(from));
        // Behind both sides of a single solid, a place is inside once; behind one of them, it is outside.
        (behind == 0 || self.is_inside(p, from, behind)).then_some(found)
    }

    /// [`SolidMesh::facing`], or, if `p` is inside a part at another angle, [`SolidMesh::around`].
    pub fn facing_or_around(
        &self,
        p: &Vector3<f64>,
        from: &SurfacePoint,
        cosine: f64,
        max_distance: f64,
    ) -> Option<SurfacePoint> {
        let facing = self.facing(p, from, cosine, max_distance);
        if facing.is_some_and(|found| found.distance < 0.0) {
            return facing;
        }
        self.around(p, from, max_distance).or(facing)
    }

    /// The nearest place, less than `max_distance`, m, away, where `p` leaves a part at any angle that it is
    /// inside of, but for the part `from`, the surface nearest to `p`. `None` if it is inside no other part.
    pub fn around(&self, p: &Vector3<f64>, from: &SurfacePoint, max_distance: f64) -> Option<SurfacePoint> {
        if !self.in_other_part(p, from) {
            return None;
        }
        let is_ahead = |t: u32| {
            let normal = &self.normals.faces[t as usize];
            let out = closest_on_triangle(p, self.triangle(t)).0 - p;
            normal.dot(&from.normal) < BENT && out.dot(normal) > AHEAD * out.norm()
        };
        self.nearest_of_part(p, max_distance, is_ahead).filter(|found| found.distance < 0.0)
    }

    /// Whether the mesh is closed and does not wind about `p`: the nearest surface is turned inside out there
    /// if `p` is behind it.
    pub fn winds_past(&self, p: &Vector3<f64>) -> bool {
        self.topology.boundary_fan.is_empty() && self.winding_number(p) <= 0.5
    }

    /// Whether `p` is inside another part of the surface than `from`, the surface nearest to `p`: it is inside
    /// of one more than that tells.
    pub fn in_other_part(&self, p: &Vector3<f64>, from: &SurfacePoint) -> bool {
        self.is_inside(p, from, 1 + usize::from(is_behind(from)))
    }

    /// Whether the mesh winds `times` or more about `p`, near the surface point `from`; on the surface, about
    /// the place in front.
    fn is_inside(&self, p: &Vector3<f64>, from: &SurfacePoint, times: usize) -> bool {
        let near = from.distance.abs() < ON_SURFACE;
        let place = if near { p + from.normal * (ON_SURFACE - from.distance) } else { *p };
        self.winding_number(&place) > times as f64 - 0.5
    }

    /// The point nearest to `p` of a part of the surface alone, wherever other parts put `p`: of the triangles
    /// that are `wanted`, less than `max_distance`, m, away.
    fn nearest_of_part(
        &self,
        p: &Vector3<f64>,
        max_distance: f64,
        wanted: impl Fn(u32) -> bool,
    ) -> Option<SurfacePoint> {
        let (triangle, point, local) = self.nearest(p, max_distance, wanted)?;
        let feature = self.feature(triangle, local);
        let offset = p - point;
        let distance = offset.norm();
        let pseudonormal = self.pseudonormal(feature);
        let sign = if offset.dot(&pseudonormal) >= 0.0 { 1.0 } else { -1.0 };
        let normal = if distance > ROUNDING { offset * (sign / distance) } else { pseudonormal };
        Some(SurfacePoint { distance: sign * distance, normal, point, feature })
    }

    /// First intersection of the segment from `a` to `b` with the surface: the fraction of the segment, and
    /// the triangle.
    pub fn first_intersection(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> Option<(f64, u32)> {
        let way = b - a;
        let inverse = way.map(f64::recip);
        let entry = |node: &BvhNode, best: f64| {
            let (lo, hi) = (node.mins(), node.maxs());
            let (mut from, mut to) = (0.0_f64, best);
            for i in 0..3 {
                let (s, t) = ((lo[i] - a[i]) * inverse[i], (hi[i] - a[i]) * inverse[i]);
                // For a segment parallel to a face of the box they are infinite, or NaN, which `max` ignores.
                from = from.max(s.min(t));
                to = to.min(s.max(t));
            }
            if from <= to { from } else { f64::INFINITY }
        };
        let leaf = |t, _| Some(Fraction(intersect_triangle(a, &way, self.triangle(t))?));
        self.bvh.find_best(1.0, entry, leaf).map(|(t, Fraction(fraction))| (fraction, t))
    }

    /// Appends to `out` the triangles whose bounding boxes intersect `bounds`, in the order of the hierarchy.
    pub fn triangles_in(&self, bounds: &Bounds, out: &mut Vec<u32>) {
        out.extend(self.bvh.leaves(|node| bounds.overlaps_node(node)));
    }

    /// Generalised winding number about `p`, the sum of the triangles' solid angles over 4π: 1 inside a
    /// closed mesh, 0 outside, in between near the opening of an open one.
    pub fn winding_number(&self, p: &Vector3<f64>) -> f64 {
        let from_p = |ids: [u32; 3]| ids.map(|v| self.vertices[v as usize] - p);
        let crossings = |ids: [u32; 3]| Ray::crossings(ids, from_p(ids).each_ref());
        let above = Bounds { min: *p, max: Vector3::new(p.x, p.y, f64::INFINITY) };
        let crossed = self.bvh.leaves(|node| above.overlaps_node(node));
        let of_mesh: i32 = crossed.map(|t| crossings(self.corners(t))).sum();
        let closed = |ids: &[u32; 3]| turns(from_p(*ids).each_ref()) - f64::from(crossings(*ids));
        f64::from(of_mesh) + self.topology.boundary_fan.iter().map(closed).sum::<f64>()
    }
}

/// Whether the place of which `from` is the nearest surface point is behind that, and not on it.
fn is_behind(from: &SurfacePoint) -> bool {
    from.distance <= -ON_SURFACE
}

impl Pseudonormals {
    fn new(topology: &Topology, positions: &[Vector3<f64>]) -> Self {
        let zero = Vector3::zeros();
        let mut edges = vec![zero; topology.edges.len()];
        let mut vertices = vec![zero; positions.len()];
        let mut faces = Vec::with_capacity(topology.triangles.len());
        // A triangle that has collapsed in a deformation contributes nothing.
        let unit = |n: Vector3<f64>| n.try_normalize(0.0).unwrap_or(zero);
        for (t, triangle_edges) in topology.triangles.iter().zip(&topology.triangle_edges) {
            let v = t.map(|i| positions[i as usize]);
            let n = unit((v[1] - v[0]).cross(&(v[2] - v[0])));
            for i in 0..3 {
                edges[triangle_edges[i] as usize] += n;
                let corner = (v[(i + 1) % 3] - v[i]).angle(&(v[(i + 2) % 3] - v[i]));
                vertices[t[i] as usize] += n * corner;
            }
            faces.push(n);
        }
        edges.iter_mut().chain(&mut vertices).for_each(|n| *n = unit(*n));
        Pseudonormals { faces, edges, vertices }
    }
}

fn bounding_box(triangle: &[u32; 3], vertices: &[Vector3<f64>]) -> Aabb {
    Bounds::around(triangle.iter().map(|&i| &vertices[i as usize]), 0.0).into()
}

/// Fraction at which the segment from `a` along `way` intersects a triangle from either side (T. Möller & B.
/// Trumbore 1997).
fn intersect_triangle(a: &Vector3<f64>, way: &Vector3<f64>, corners: [&Vector3<f64>; 3]) -> Option<f64> {
    let [e1, e2] = [corners[1] - corners[0], corners[2] - corners[0]];
    let p = way.cross(&e2);
    let det = e1.dot(&p);
    let t = a - corners[0];
    let u = t.dot(&p) / det;
    let q = t.cross(&e1);
    let v = way.dot(&q) / det;
    let fraction = e2.dot(&q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&fraction)).then_some(fraction)
}

/// Fraction of a segment, as the cost of a leaf.
struct Fraction(f64);

impl BvhLeafCost for Fraction {
    fn cost(&self) -> f64 {
        self.0
    }
}

/// Closest point on a triangle, its squared distance being the cost of a leaf.
struct Nearest {
    distance2: f64,
    point: Vector3<f64>,
    local: TriangleFeature,
}

impl BvhLeafCost for Nearest {
    fn cost(&self) -> f64 {
        self.distance2
    }
}
