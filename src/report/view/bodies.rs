//! Bodies for the page: meshes thinned to what a browser draws at ease, and how far hair is from them.

use crate::cache::ColliderMesh;
use crate::geometry::{Shape, Solid, SolidMesh, TriMesh};
use nalgebra::Vector3;
use std::collections::BTreeMap;

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
        let (low, high) = points.iter().map(|p| Vector3::from(*p)).fold(
            (Vector3::repeat(f32::INFINITY), Vector3::repeat(f32::NEG_INFINITY)),
            |(a, b): (Vector3<f32>, Vector3<f32>), p| (a.inf(&p), b.sup(&p)),
        );
        let whole = ThinMesh {
            vertices: (0..points.len()).collect(),
            triangles: triangles.iter().map(|t| t.map(|i| i as u32)).collect(),
        };
        let side = (high - low).max();
        if points.len() <= most || !side.is_finite() || side <= 0.0 {
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

/// A body that finds how far points are from it.
pub struct Surface<'a> {
    mesh: &'a ColliderMesh,
    metres_per_unit: f64,
    /// The body at rest, if it is rigid.
    rigid: Option<Solid>,
}

/// Distance, m, from which on a point is nowhere near a body.
pub const NEAR: f64 = 2e-3;

impl<'a> Surface<'a> {
    /// Of a collider in a cache of this unit.
    pub fn new(mesh: &'a ColliderMesh, metres_per_unit: f64) -> Self {
        let rigid = (!mesh.deforms && !mesh.triangles.is_empty()).then(|| {
            let vertices = in_metres(&mesh.points, metres_per_unit);
            Solid::new(&Shape::Mesh(TriMesh { vertices, triangles: triangles(mesh) }), None)
        });
        Surface { mesh, metres_per_unit, rigid }
    }

    /// The body with its vertices of a frame.
    pub fn at(&self, points: Option<&[[f32; 3]]>) -> Option<SurfaceAt<'_>> {
        match (&self.rigid, points) {
            (Some(solid), _) => Some(SurfaceAt::Rigid(solid)),
            (None, Some(points)) if !self.mesh.triangles.is_empty() => {
                let vertices = in_metres(points, self.metres_per_unit);
                Some(SurfaceAt::Deformed(Box::new(SolidMesh::new(&vertices, &triangles(self.mesh)))))
            }
            _ => None,
        }
    }
}

/// A body in one configuration.
pub enum SurfaceAt<'a> {
    /// As it always is.
    Rigid(&'a Solid),
    /// As it is at a frame.
    Deformed(Box<SolidMesh>),
}

impl SurfaceAt<'_> {
    /// Signed distance, m, of a point in the rest space of the body; infinite from [`NEAR`] on.
    pub fn distance(&self, p: &Vector3<f64>) -> f64 {
        /// Deeper than hair ever is.
        const DEEPEST: f64 = 0.05;
        let closest = match self {
            SurfaceAt::Rigid(solid) if solid.distance_bounds(p)[0] >= NEAR => None,
            SurfaceAt::Rigid(solid) => solid.closest(0.0, p, DEEPEST),
            SurfaceAt::Deformed(mesh) => mesh.closest(p, DEEPEST),
        };
        closest.map(|s| s.distance).filter(|d| *d < NEAR).unwrap_or(f64::INFINITY)
    }
}

fn in_metres(points: &[[f32; 3]], metres_per_unit: f64) -> Vec<Vector3<f64>> {
    points.iter().map(|p| Vector3::from(*p).cast::<f64>() * metres_per_unit).collect()
}

fn triangles(mesh: &ColliderMesh) -> Vec<[u32; 3]> {
    mesh.triangles.iter().map(|t| t.map(|i| i as u32)).collect()
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

    #[test]
    fn distances_are_signed_and_end_near_the_body() {
        let side = 0.1f32;
        let corner = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 1 { side } else { -side });
        let points: Vec<_> = (0..8).map(corner).collect();
        for deforms in [false, true] {
            let mesh = ColliderMesh {
                points: points.clone(),
                triangles: BOX.to_vec(),
                deforms,
                ..ColliderMesh::default()
            };
            let surface = Surface::new(&mesh, 1.0);
            let at = surface.at(deforms.then_some(&points[..])).unwrap();
            let distance = |x: f64| at.distance(&Vector3::new(x, 0.01, 0.02));
            assert!((distance(0.099) + 1e-3).abs() < 1e-6, "{}", distance(0.099));
            assert!((distance(0.101) - 1e-3).abs() < 1e-6);
            assert_eq!(distance(0.103), f64::INFINITY);
        }
    }
}
