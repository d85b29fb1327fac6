//! Places on a deforming mesh, and the rigid motion that carries what grows there (`docs/theory.md` eqs. 2.1
//! to 2.3).

use super::solid_mesh::SolidMesh;
use crate::geometry::deformation::Deformation;
use crate::geometry::distance::triangle::barycentric;
use crate::geometry::tri_mesh::TriMesh;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

/// A mesh at rest, ready to find places on it.
#[derive(Debug)]
pub struct Skin {
    mesh: SolidMesh,
    /// Normal of each vertex times the area around it, m².
    normals: Vec<Vector3<f64>>,
    /// Area of the triangles of each vertex, m².
    areas: Vec<f64>,
}

/// A place bound to a skin. Its position and its tangents are sums over vertices with fixed weights.
#[derive(Debug, Clone, PartialEq)]
pub struct SkinPoint {
    support: Vec<Support>,
    /// The place at rest, m.
    rest: Vector3<f64>,
    /// What is bound, relative to the point of the surface at rest, m.
    offset: Vector3<f64>,
    /// The frame at rest.
    frame: Matrix3<f64>,
    /// Area spanned by the tangents at rest.
    area: f64,
}

/// What a vertex contributes to a place.
#[derive(Debug, Clone, PartialEq)]
struct Support {
    /// Index of the vertex in the mesh that the skin was made from.
    vertex: u32,
    /// Barycentric coordinate.
    weight: f64,
    /// Weights in the two tangents, 1/m.
    slope: [f64; 2],
}

/// A surface at a place: its point, m, and the images of two orthonormal tangents at rest.
#[derive(Clone, Copy)]
struct Tangents {
    point: Vector3<f64>,
    along: [Vector3<f64>; 2],
}

impl Skin {
    /// The skin of a mesh at rest, m. Its vertices that coincide there and in all samples of `deformation`
    /// are one, so that seams are smooth.
    pub fn new(mesh: &TriMesh, deformation: Option<&Deformation>) -> Self {
        let mut positions = vec![&mesh.vertices[..]];
        positions.extend(deformation.iter().flat_map(|d| &d.samples).map(Vec::as_slice));
        let mesh = SolidMesh::from_positions(&positions, &mesh.triangles);
        let mut skin = Skin {
            normals: vec![Vector3::zeros(); mesh.vertices.len()],
            areas: vec![0.0; mesh.vertices.len()],
            mesh,
        };
        for t in 0..skin.mesh.drawn_triangles() {
            let normal = skin.doubled_area(t) * 0.5;
            for v in skin.mesh.topology.triangles[t as usize] {
                skin.normals[v as usize] += normal;
                skin.areas[v as usize] += normal.norm();
            }
        }
        skin
    }

    /// Normal of triangle `t`, of twice its area, m².
    fn doubled_area(&self, t: u32) -> Vector3<f64> {
        let [a, b, c] = self.mesh.triangle(t);
        (b - a).cross(&(c - a))
    }

    /// Binds `x`, m, rest space, to the nearest place; also its distance, m. `None` if it is `max_distance`,
    /// m, away or more.
    pub fn bind(&self, x: &Vector3<f64>, max_distance: f64) -> Option<(SkinPoint, f64)> {
        let drawn = self.mesh.drawn_triangles();
        let (triangle, point, local) = self.mesh.nearest(x, max_distance, |t| t < drawn)?;
        let corners = self.mesh.topology.triangles[triangle as usize];
        let shares = barycentric(local, &point, self.mesh.triangle(triangle));
        let of_corners = || corners.iter().zip(shares).filter(|(_, share)| *share > 0.0);
        let mean =
            of_corners().map(|(v, share)| self.normals[*v as usize] * (share / self.areas[*v as usize]));
        // At an edge where two sheets meet, normals may cancel: that of the triangle is one.
        let face = self.doubled_area(triangle).normalize();
        let normal = mean.sum::<Vector3<f64>>().try_normalize(1e-6).unwrap_or(face);
        let across = Vector3::ith(normal.iamin(), 1.0);
        let first = normal.cross(&across).normalize();
        let tangents = [first, normal.cross(&first)];

        let mut weights: BTreeMap<u32, (f64, Vector3<f64>)> = BTreeMap::new();
        for (v, share) in of_corners() {
            weights.entry(*v).or_default().0 += share;
            for &t in self.mesh.topology.vertex_triangles.get(*v).iter().filter(|t| **t < drawn) {
                let normal = self.doubled_area(t).normalize();
                let triangle = self.mesh.topology.triangles[t as usize];
                for (k, vertex) in triangle.iter().enumerate() {
                    // The gradient of the vertex's hat function times the area of the triangle.
                    let [from, to] = [1, 2].map(|next| self.mesh.vertex(triangle[(k + next) % 3]));
                    let gradient = normal.cross(&(to - from)) * 0.5;
                    weights.entry(*vertex).or_default().1 += gradient * (share / self.areas[*v as usize]);
                }
            }
        }
        let support = |(vertex, (weight, gradient)): (u32, (f64, Vector3<f64>))| Support {
            vertex,
            weight,
            slope: tangents.map(|tangent| gradient.dot(&tangent)),
        };
        let mut bound = SkinPoint {
            support: weights.into_iter().map(support).collect(),
            rest: *x,
            offset: Vector3::zeros(),
            frame: Matrix3::identity(),
            area: 0.0,
        };
        let surface = bound.surface(|v| *self.mesh.vertex(v));
        bound.offset = x - surface.point;
        bound.area = surface.area();
        bound.frame = surface.frame();
        // The vertices of the mesh as it was given, before those that coincide were joined.
        bound.support.iter_mut().for_each(|s| s.vertex = self.mesh.topology.source[s.vertex as usize]);
        Some((bound, (x - point).norm()))
    }
}

impl SkinPoint {
    /// The surface there, with its vertices at `vertex`, m.
    fn surface(&self, vertex: impl Fn(u32) -> Vector3<f64>) -> Tangents {
        let mut surface = Tangents { point: Vector3::zeros(), along: [Vector3::zeros(); 2] };
        for Support { vertex: v, weight, slope } in &self.support {
            let x = vertex(*v);
            surface.point += x * *weight;
            surface.along.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += x * *slope);
        }
        surface
    }

    /// The rigid motion from rest that carries what is bound there, with the vertices of the mesh at
    /// `vertex`, m.
    pub fn carry(&self, vertex: impl Fn(u32) -> Vector3<f64>) -> Isometry3<f64> {
        let surface = self.surface(vertex);
        let turn = surface.frame() * self.frame.transpose();
        let place = surface.point + turn * self.offset;
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
        Isometry3::from_parts(Translation3::from(place - turn * self.rest), rotation)
    }

    /// Area of the surface there with the vertices of the mesh at `vertex`, m, over that at rest: 0 where it
    /// has collapsed and has no frame.
    pub fn area_ratio(&self, vertex: impl Fn(u32) -> Vector3<f64>) -> f64 {
        self.surface(vertex).area() / self.area
    }

    /// The place at rest, m.
    pub fn rest(&self) -> &Vector3<f64> {
        &self.rest
    }
}

impl Tangents {
    fn area(&self) -> f64 {
        let [first, second] = self.along;
        first.cross(&second).norm()
    }

    /// The frame whose third axis is the normal, and whose first two are the nearest to the tangents.
    fn frame(&self) -> Matrix3<f64> {
        let [first, second] = self.along;
        let normal = first.cross(&second).normalize();
        let first = (first + second.cross(&normal)).normalize();
        Matrix3::from_columns(&[first, normal.cross(&first), normal])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type V = Vector3<f64>;

    /// Vertices in a row of the sheet.
    const ROW: u32 = 21;

    /// Where point (u, v), m, of a bumpy sheet is.
    fn bumpy(u: f64, v: f64) -> V {
        V::new(u, 0.01 * (40.0 * u).sin() * (30.0 * v).cos(), v)
    }

    /// A sheet of 20 by 20 uneven cells of 1 cm, over which `at` places a point.
    fn sheet(at: impl Fn(f64, f64) -> V) -> TriMesh {
        let vertex = |i: u32, j: u32| {
            let [i, j] = [i, j].map(f64::from);
            at(0.01 * i + 0.002 * (5.0 * j).sin(), 0.01 * j + 0.002 * (7.0 * i).cos())
        };
        let corner = |i: u32, j: u32| ROW * i + j;
        let cells = (0..ROW - 1).flat_map(|i| (0..ROW - 1).map(move |j| (i, j)));
        TriMesh {
            vertices: (0..ROW)
                .flat_map(|i| (0..ROW).map(move |j| (i, j)))
                .map(|(i, j)| vertex(i, j))
                .collect(),
            triangles: cells
                .map(|(i, j)| [corner(i, j), corner(i, j + 1), corner(i + 1, j + 1), corner(i + 1, j)])
                .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
                .collect(),
        }
    }

    fn bind(mesh: &TriMesh, x: &V) -> SkinPoint {
        Skin::new(mesh, None).bind(x, 0.05).unwrap().0
    }

    fn carry(place: &SkinPoint, mesh: &TriMesh) -> Isometry3<f64> {
        place.carry(|v| mesh.vertices[v as usize])
    }

    #[test]
    fn a_rigid_motion_of_the_mesh_carries_its_roots() {
        let mesh = sheet(bumpy);
        let motion = Isometry3::new(V::new(3.0, -1.0, 0.5), V::new(0.4, 2.0, -1.1));
        let moved = |x: &V| (motion * nalgebra::Point3::from(*x)).coords;
        let then = TriMesh { vertices: mesh.vertices.iter().map(moved).collect(), ..mesh.clone() };
        for x in [V::new(0.07, 0.013, 0.11), V::new(0.1032, -0.02, 0.03), V::new(-0.01, 0.01, 0.1)] {
            let place = bind(&mesh, &x);
            let still = carry(&place, &mesh);
            assert!((still.translation.vector.norm() + still.rotation.angle()) < 1e-13, "{still}");
            let carried = carry(&place, &then);
            assert!((carried.inverse() * motion).rotation.angle() < 1e-13, "{carried}");
            assert!(((carried * nalgebra::Point3::from(x)).coords - moved(&x)).norm() < 1e-14);
            assert!((place.area_ratio(|v| then.vertices[v as usize]) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_sheet_rolled_up_turns_its_roots_as_the_cylinder_turns() {
        let flat = sheet(|u, v| V::new(u, 0.0, v));
        let radius = 0.05;
        let rolled = sheet(|u, v| V::new(radius * (u / radius).sin(), radius * (u / radius).cos(), v));
        for (u, v) in [(0.05, 0.11), (0.1043, 0.071), (0.153, 0.13)] {
            let height = 0.004;
            let carried = carry(&bind(&flat, &V::new(u, height, v)), &rolled);
            let expected = UnitQuaternion::from_scaled_axis(V::z() * (-u / radius));
            // Facets are 11° wide.
            assert!(carried.rotation.angle_to(&expected) < 0.01, "{u}: {}", carried.rotation);
            let x = carried * nalgebra::Point3::new(u, height, v);
            let (sine, cosine) = (u / radius).sin_cos();
            let on_cylinder = V::new(sine, cosine, 0.0) * (radius + height) + V::z() * v;
            assert!((x.coords - on_cylinder).norm() < 3e-4, "{u}: {x}");
        }
    }

    #[test]
    fn neighbours_do_not_break_at_edges() {
        let mesh = sheet(bumpy);
        let wrung = sheet(|u, v| {
            let x = bumpy(u, v);
            UnitQuaternion::from_scaled_axis(V::x() * (9.0 * u)) * (x - V::z() * 0.1) * (1.0 + 2.0 * v)
        });
        let skin = Skin::new(&mesh, None);
        let step = 1e-4;
        let carried: Vec<_> = (0..1000)
            .map(|i| bumpy(0.05 + step * f64::from(i), 0.07 + 0.3 * step * f64::from(i)) + V::y() * 0.001)
            .map(|x| carry(&skin.bind(&x, 0.05).unwrap().0, &wrung))
            .collect();
        let turns: Vec<f64> = carried.windows(2).map(|w| w[0].rotation.angle_to(&w[1].rotation)).collect();
        let (most, mean) = (turns.iter().copied().fold(0.0, f64::max), turns.iter().sum::<f64>() / 999.0);
        // About 60 edges are crossed; triangles are 100 steps wide.
        assert!(mean > 5e-4 && most < 0.01, "{most} {mean}");
    }

    #[test]
    fn seams_are_smooth_and_holes_carry_nothing() {
        let whole = sheet(bumpy);
        let bent = sheet(|u, v| bumpy(u, v) + V::y() * (3.0 * u * u));
        // The same with all corners of its own, as at texture seams.
        let split = |mesh: &TriMesh| TriMesh {
            vertices: mesh.triangles.iter().flatten().map(|v| mesh.vertices[*v as usize]).collect(),
            triangles: (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        };
        let x = bumpy(0.093, 0.084);
        let [one, two] =
            [[&whole, &bent], [&split(&whole), &split(&bent)]].map(|[rest, now]| carry(&bind(rest, &x), now));
        assert!((one.inverse() * two).rotation.angle() < 1e-12 && one.rotation.angle() > 0.1, "{one} {two}");

        // A tube: its ends are closed by caps for contact, but nothing grows there.
        let corner = |i: u32, end: f64| {
            let (sine, cosine) = (f64::from(i) * std::f64::consts::TAU / 16.0).sin_cos();
            V::new(0.05 * cosine, end, 0.05 * sine)
        };
        let tube = TriMesh {
            vertices: (0..32).map(|i| corner(i % 16, f64::from(i / 16) * 0.5)).collect(),
            triangles: (0..16)
                .flat_map(|i: u32| [[i, i + 16, (i + 1) % 16], [(i + 1) % 16, i + 16, (i + 1) % 16 + 16]])
                .collect(),
        };
        let skin = Skin::new(&tube, None);
        assert!(!skin.mesh.caps().is_empty());
        let (_, distance) = skin.bind(&V::new(0.0, 0.5, 0.0), 0.1).unwrap();
        assert!((0.045..0.051).contains(&distance), "{distance}");
        assert!(skin.bind(&V::new(0.0, 0.5, 0.0), 0.04).is_none());
    }

    #[test]
    fn roots_accelerate_as_continuously_as_the_mesh() {
        let shape = |t: f64| sheet(|u, v| bumpy(u, v) + V::y() * (0.03 * (9.0 * t + 20.0 * u).sin()));
        let samples = (0..8).map(|i| shape(f64::from(i) / 24.0).vertices).collect();
        let (mesh, deformation) = (shape(0.0), Deformation { start: 0.0, rate: 24.0, samples });
        let place = Skin::new(&mesh, Some(&deformation)).bind(&(mesh.vertices[200] + V::y() * 0.002), 0.05);
        let place = place.unwrap().0;
        let x = |t: f64| place.carry(deformation.at(t)) * nalgebra::Point3::from(mesh.vertices[210]);
        let h = 1e-4;
        let second = |t: f64| (x(t + h).coords - x(t).coords * 2.0 + x(t - h).coords) / (h * h);
        let largest = (20..260).map(|k| second(f64::from(k) / 1000.0).norm()).fold(0.0, f64::max);
        assert!(largest > 1.0, "{largest}");
        for i in 2..6 {
            let t = f64::from(i) / 24.0;
            let jump = (second(t + 2.0 * h) - second(t - 2.0 * h)).norm();
            assert!(jump < 0.05 * largest, "{i}: {jump} of {largest}");
        }
    }
}
