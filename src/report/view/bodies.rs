//! Bodies for the page: meshes thinned to what a browser draws at ease, and how far hair is from them.

use crate::cache::ColliderMesh;
use crate::geometry::{Bounds, Shape, Solid, SolidMesh, TriMesh};
use crate::report::space::finite_box;
use nalgebra::Vector3;
use std::collections::{BTreeMap, HashMap};

/// A mesh with fewer vertices, each of them one of the full mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ThinMesh {
    /// Indices of its vertices in the full mesh.
    pub vertices: Vec<usize>,
    /// Triangles of its own vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl ThinMesh {
    /// The mesh with at most about `most` vertices: the first vertex in each cell of a grid stands for all of
    /// them, and triangles that shrink to a line are left out.
    pub fn new(points: &[[f32; 3]], triangles: &[[i32; 3]], most: usize) -> Self {
        let whole = ThinMesh {
            vertices: (0..points.len()).collect(),
            triangles: triangles.iter().map(|t| t.map(|i| i as u32)).collect(),
        };
        let all: Vec<Vector3<f32>> = points.iter().map(|p| Vector3::from(*p)).collect();
        let Some([low, high]) = finite_box(&all).filter(|_| points.len() > most) else { return whole };
        let side = (high - low).max();
        if side <= 0.0 {
            return whole;
        }
        // A surface crosses about 6 n² cells of n³.
        let mut cells = (most as f32 / 3.0).sqrt().max(1.0);
        loop {
            let thin = whole.clustered(points, &low, side / cells);
            if thin.vertices.len() <= most || cells < 2.0 {
                return thin;
            }
            cells *= 0.85;
        }
    }

    fn clustered(&self, points: &[[f32; 3]], low: &Vector3<f32>, cell: f32) -> Self {
        let mut first: BTreeMap<[i32; 3], u32> = BTreeMap::new();
        let mut vertices = Vec::new();
        let mut stands = |(i, p): (usize, &[f32; 3])| {
            let key = ((Vector3::from(*p) - low) / cell).map(|x| x.floor() as i32).into();
            *first.entry(key).or_insert_with(|| {
                vertices.push(i);
                vertices.len() as u32 - 1
            })
        };
        let stands: Vec<u32> = points.iter().enumerate().map(&mut stands).collect();
        let moved = self.triangles.iter().map(|t| t.map(|i| stands[i as usize]));
        let triangles = moved.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        ThinMesh { vertices, triangles }
    }
}

/// Bytes that a vertex takes in a frame, compressed, and its share of the triangles.
const BYTES_PER_VERTEX: [f64; 2] = [2.6, 12.0];
/// Bytes that the motion of a body takes in a frame.
const BYTES_PER_MOTION: f64 = 48.0;
/// Most vertices of a rigid body.
const RIGID_VERTICES: usize = 20_000;
/// Least vertices of a body for which it has room.
const LEAST_VERTICES: usize = 8;

/// The meshes with so few vertices that they take about `bytes` in so many frames, and what they take. All
/// have the same number at most; where there is no room for all meshes, the first of them.
pub fn fitting(meshes: &[ColliderMesh], frames: usize, bytes: f64) -> (Vec<ThinMesh>, f64) {
    let most = |mesh: &ColliderMesh, cap: usize| if mesh.deforms { cap } else { cap.min(RIGID_VERTICES) };
    let taken = |meshes: &[ColliderMesh], cap: usize| -> f64 {
        let each = meshes.iter().map(|mesh| {
            let [in_frame, once] = BYTES_PER_VERTEX;
            let frames = frames as f64;
            let per_vertex = once + in_frame * if mesh.deforms { frames } else { 1.0 };
            mesh.points.len().min(most(mesh, cap)) as f64 * per_vertex + BYTES_PER_MOTION * frames
        });
        each.sum()
    };
    let fits = |n: usize| taken(&meshes[..n], LEAST_VERTICES) <= bytes;
    let n = (0..=meshes.len()).rev().find(|n| fits(*n)).unwrap_or(0);
    let meshes = &meshes[..n];
    let largest = meshes.iter().map(|mesh| mesh.points.len()).max().unwrap_or(0);
    let (mut cap, mut beyond) = (LEAST_VERTICES, largest.max(LEAST_VERTICES) + 1);
    while beyond - cap > 1 {
        let middle = cap.midpoint(beyond);
        if taken(meshes, middle) <= bytes { cap = middle } else { beyond = middle }
    }
    let thin = |mesh: &ColliderMesh| ThinMesh::new(&mesh.points, &mesh.triangles, most(mesh, cap));
    (meshes.iter().map(thin).collect(), taken(meshes, cap))
}

/// Points of a mesh that coincide at rest and in the frames seen: the bake welds those.
pub struct Coincident {
    /// The lowest point that each coincides with.
    first: Vec<u32>,
}

impl Coincident {
    /// Those of a mesh at rest.
    pub fn new(rest: &[[f32; 3]]) -> Self {
        let mut coincident = Coincident { first: vec![0; rest.len()] };
        coincident.refine(rest);
        coincident
    }

    /// Whether there are any.
    pub fn any(&self) -> bool {
        self.first.iter().zip(0..).any(|(first, i)| *first != i)
    }

    /// Parts those that are apart in these positions.
    pub fn refine(&mut self, points: &[[f32; 3]]) {
        let mut seen = HashMap::with_capacity(points.len());
        for (i, (first, p)) in self.first.iter_mut().zip(points).enumerate() {
            // + 0.0 makes −0 equal to 0.
            let place = p.map(|x| (x + 0.0).to_bits());
            *first = *seen.entry((*first, place)).or_insert(i as u32);
        }
    }
}

/// A body that finds how far points are from it.
pub struct Surface<'a> {
    mesh: &'a ColliderMesh,
    metres_per_unit: f64,
    kind: Kind,
}

enum Kind {
    /// As it always is.
    Rigid(Solid),
    /// A mesh that deforms, at rest.
    Deforming(Box<SolidMesh>),
    /// Without triangles.
    Empty,
}

/// Distance, m, from which on a point is nowhere near a body.
pub const NEAR: f64 = 2e-3;

impl<'a> Surface<'a> {
    /// The surface of a collider; its points in `coincident` are welded if it deforms.
    pub fn new(mesh: &'a ColliderMesh, coincident: &Coincident, metres_per_unit: f64) -> Self {
        let vertices = in_metres(&mesh.points, metres_per_unit);
        let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|i| i as u32)).collect();
        let kind = match (triangles.is_empty(), mesh.deforms) {
            (true, _) => Kind::Empty,
            (false, false) => {
                let tri_mesh = TriMesh { vertices, triangles };
                let plane = mesh.is_plane.then(|| plane_through(&tri_mesh)).flatten();
                Kind::Rigid(Solid::new(&plane.unwrap_or(Shape::Mesh(tri_mesh)), None))
            }
            (false, true) => {
                // A second set of positions, in which all others differ.
                let apart = |first: &u32| Vector3::repeat(f64::from(*first));
                let apart: Vec<Vector3<f64>> = coincident.first.iter().map(apart).collect();
                Kind::Deforming(Box::new(SolidMesh::from_positions(&[&vertices, &apart], &triangles)))
            }
        };
        Surface { mesh, metres_per_unit, kind }
    }

    /// The body with the vertices of a frame, which it has if it deforms.
    pub fn at(&self, points: Option<&[[f32; 3]]>) -> Option<SurfaceAt<'_>> {
        match &self.kind {
            Kind::Rigid(solid) => Some(SurfaceAt::Rigid(solid)),
            Kind::Deforming(rest) => {
                let points = in_metres(points.unwrap_or(&self.mesh.points), self.metres_per_unit);
                let mesh = Box::new(rest.moved(&points));
                Some(SurfaceAt::Deformed(mesh.bounds(), mesh))
            }
            Kind::Empty => None,
        }
    }
}

/// A body in one configuration.
pub enum SurfaceAt<'a> {
    /// As it always is.
    Rigid(&'a Solid),
    /// As it is at a frame, in this box.
    Deformed(Bounds, Box<SolidMesh>),
}

impl SurfaceAt<'_> {
    /// Signed distance, m, of a point in the rest space of the body; infinite from [`NEAR`] on.
    pub fn distance(&self, p: &Vector3<f64>) -> f64 {
        let closest = match self {
            SurfaceAt::Rigid(solid) => {
                let [least, most] = solid.distance_bounds(p);
                // The search leaves out what is as far as its limit.
                (least < NEAR).then(|| solid.closest(0.0, p, most * (1.0 + 1e-6) + 1e-9)).flatten()
            }
            SurfaceAt::Deformed(bounds, mesh) => {
                let near = bounds.overlaps(&Bounds::around([p], NEAR));
                near.then(|| mesh.closest(p, f64::INFINITY)).flatten()
            }
        };
        closest.map(|s| s.distance).filter(|d| *d < NEAR).unwrap_or(f64::INFINITY)
    }
}

/// The plane through the first triangle of a mesh.
fn plane_through(mesh: &TriMesh) -> Option<Shape> {
    let [a, b, c] = mesh.triangles.first()?.map(|i| mesh.vertices[i as usize]);
    let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
    Some(Shape::Plane { point: a, normal })
}

fn in_metres(points: &[[f32; 3]], metres_per_unit: f64) -> Vec<Vector3<f64>> {
    points.iter().map(|p| Vector3::from(*p).cast::<f64>() * metres_per_unit).collect()
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Triangles of a box whose corner i is at the upper end of axis k where bit k of i is set.
    pub const BOX: [[i32; 3]; 12] = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];

    /// A sheet of `n` by `n` squares.
    fn sheet(n: usize) -> (Vec<[f32; 3]>, Vec<[i32; 3]>) {
        let points = (0..=n).flat_map(|i| (0..=n).map(move |j| [i as f32, j as f32, 0.0])).collect();
        let corner = |i: usize, j: usize| (i * (n + 1) + j) as i32;
        let square = |i, j| {
            [
                [corner(i, j), corner(i + 1, j), corner(i, j + 1)],
                [corner(i + 1, j + 1), corner(i, j + 1), corner(i + 1, j)],
            ]
        };
        (points, (0..n).flat_map(|i| (0..n).flat_map(move |j| square(i, j))).collect())
    }

    #[test]
    fn a_thinned_mesh_keeps_its_shape_with_fewer_vertices() {
        let (points, triangles) = sheet(60);
        let thin = ThinMesh::new(&points, &triangles, 500);
        assert!((100..=500).contains(&thin.vertices.len()), "{}", thin.vertices.len());
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| Vector3::from(points[thin.vertices[i as usize]]));
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        let all: f32 = thin.triangles.iter().map(area).sum();
        // All of it, but up to a cell of a thirteenth of its side along the border.
        assert!((55.0f32 * 55.0..=3600.0).contains(&all), "{all}");
        let same = ThinMesh::new(&points, &triangles, 10_000);
        assert_eq!((same.vertices.len(), same.triangles.len()), (points.len(), triangles.len()));
    }

    /// A box of two decimetres.
    fn cube() -> ColliderMesh {
        let side = 0.1f32;
        let corner = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 1 { side } else { -side });
        let points = (0..8).map(corner).collect();
        ColliderMesh { points, triangles: BOX.to_vec(), ..ColliderMesh::default() }
    }

    fn surface(mesh: &ColliderMesh, metres_per_unit: f64) -> Surface<'_> {
        Surface::new(mesh, &Coincident::new(&mesh.points), metres_per_unit)
    }

    #[test]
    fn bodies_share_their_room() {
        let (points, triangles) = sheet(60);
        let mesh = ColliderMesh { points, triangles, ..ColliderMesh::default() };
        let meshes = vec![mesh; 40];
        let count = |frames: usize, bytes: f64| {
            let (thin, taken) = fitting(&meshes, frames, bytes);
            assert!(taken <= bytes, "{taken} of {bytes}");
            (thin.len(), thin.iter().map(|mesh| mesh.vertices.len()).max().unwrap_or(0))
        };
        assert_eq!(count(10, 1e8), (40, 61 * 61));
        let (bodies, vertices) = count(10, 3e5);
        assert!(bodies == 40 && (50..=500).contains(&vertices), "{bodies} {vertices}");
        let (bodies, vertices) = count(1000, 3e5);
        assert!((5..=6).contains(&bodies) && vertices >= 4, "{bodies} {vertices}");
        assert_eq!(count(1000, 3e4), (0, 0));
    }

    #[test]
    fn distances_are_signed_and_end_near_the_body() {
        for (deforms, unit) in [(false, 1.0), (true, 1.0), (false, 0.01), (true, 0.01)] {
            let mesh = ColliderMesh { deforms, ..cube() };
            let surface = surface(&mesh, unit);
            let at = surface.at(deforms.then_some(&mesh.points[..])).unwrap();
            let side = 0.1 * unit;
            let distance = |beyond: f64| at.distance(&Vector3::new(side + beyond, 0.1 * side, 0.2 * side));
            for beyond in [-1e-4, 1e-4, 1.9e-3] {
                assert!((distance(beyond) - beyond).abs() < 1e-8, "{} {beyond}", distance(beyond));
            }
            assert_eq!((distance(3e-3), distance(10.0)), (f64::INFINITY, f64::INFINITY));
            // As deep as it gets.
            assert!((at.distance(&Vector3::new(0.01 * side, 0.0, 0.0)) + 0.99 * side).abs() < 1e-8);
        }
    }

    #[test]
    fn a_plane_ends_nowhere() {
        let plane = Shape::Plane { point: Vector3::new(0.0, 0.1, 0.0), normal: Vector3::y() }.tessellate();
        let unit = 0.01;
        let points = plane.vertices.iter().map(|v| (v / unit).cast::<f32>().into()).collect();
        let triangles = plane.triangles.iter().map(|t| t.map(|i| i as i32)).collect();
        let square = ColliderMesh { points, triangles, ..ColliderMesh::default() };
        let plane = ColliderMesh { is_plane: true, ..square.clone() };
        let distance = |mesh: &ColliderMesh, x: f64, y: f64| {
            surface(mesh, unit).at(None).unwrap().distance(&Vector3::new(x, y, 0.3))
        };
        for x in [0.0, 5.0, -40.0] {
            assert!((distance(&plane, x, 0.101) - 1e-3).abs() < 1e-6);
            assert!((distance(&plane, x, -1.0) + 1.1).abs() < 1e-5);
            assert_eq!(distance(&plane, x, 0.103), f64::INFINITY);
        }
        // A mesh that is such a square ends at its border.
        assert!((distance(&square, 0.0, 0.101) - 1e-3).abs() < 1e-6);
        assert_eq!([5.0, -40.0].map(|x| distance(&square, x, 0.101)), [f64::INFINITY; 2]);
    }

    #[test]
    fn what_parts_in_some_frame_is_not_welded() {
        // Two sheets that touch at rest, drawn apart as lips are; seams of textures stay together.
        let (points, triangles) = sheet(1);
        let both: Vec<_> = points.iter().chain(&points).copied().collect();
        let mut open = both.clone();
        open[4..].iter_mut().for_each(|p| p[2] = 0.1);
        let mut coincident = Coincident::new(&both);
        assert!(coincident.any());
        coincident.refine(&both);
        assert!(coincident.any(), "the same positions part nothing");
        coincident.refine(&open);
        assert!(!coincident.any());
        let second = triangles.iter().map(|t| t.map(|i| i + 4));
        let triangles = triangles.iter().copied().chain(second).collect();
        let mesh = ColliderMesh { points: both, triangles, deforms: true, ..ColliderMesh::default() };
        let count = |coincident: &Coincident| {
            let surface = Surface::new(&mesh, coincident, 1.0);
            let Some(SurfaceAt::Deformed(bounds, at)) = surface.at(Some(&open)) else { panic!() };
            (at.triangle_count(), bounds.max.z)
        };
        assert_eq!(count(&coincident), (4, f64::from(0.1f32)));
        assert_eq!(count(&Coincident::new(&mesh.points)), (2, 0.0), "welded at rest, the second is lost");
    }
}
