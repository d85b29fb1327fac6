//! The head of the samples: a star-shaped surface with a face, ears and a nape, on a neck and shoulders.

use crate::geometry::TriMesh;
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Centre of the head, m. The head turns about the origin of rest space, in the neck.
pub const CENTRE: Vector3<f64> = Vector3::new(0.0, 0.12, 0.012);
/// Semi-axes of the skull, m: width, height, depth.
const RADII: Vector3<f64> = Vector3::new(0.078, 0.115, 0.097);

/// Ends (m, rest space) and radius, m, of the capsule of the neck.
pub const NECK: ([Vector3<f64>; 2], f64) =
    ([Vector3::new(0.0, 0.05, -0.005), Vector3::new(0.0, -0.11, -0.02)], 0.052);
/// The capsule of the shoulders, as [`NECK`].
pub const SHOULDERS: ([Vector3<f64>; 2], f64) =
    ([Vector3::new(-0.15, -0.16, -0.02), Vector3::new(0.15, -0.16, -0.02)], 0.062);

/// A Gaussian bump: height, m; azimuth from the face and elevation, rad; standard deviations of both, rad.
/// Symmetric about the face.
struct Feature(f64, [f64; 2], [f64; 2]);

const FEATURES: [Feature; 11] = [
    Feature(0.016, [0.0, -0.10], [0.10, 0.15]),   // bridge of the nose
    Feature(0.012, [0.0, -0.22], [0.12, 0.07]),   // tip of the nose
    Feature(0.005, [0.25, 0.14], [0.25, 0.07]),   // brow
    Feature(-0.009, [0.36, 0.00], [0.17, 0.09]),  // eyes
    Feature(0.006, [0.0, -0.52], [0.22, 0.05]),   // mouth
    Feature(0.010, [0.0, -0.85], [0.45, 0.20]),   // chin
    Feature(-0.010, [0.95, -0.75], [0.45, 0.35]), // cheeks
    Feature(0.016, [1.62, -0.06], [0.08, 0.20]),  // ears
    Feature(-0.006, [1.95, -0.10], [0.15, 0.25]), // behind the ears
    Feature(0.006, [PI, 0.05], [0.80, 0.50]),     // back of the head
    Feature(-0.022, [PI, -0.95], [1.00, 0.35]),   // nape
];

/// Distance of the surface from [`CENTRE`] in the unit direction `d`, m.
fn radius(d: Vector3<f64>) -> f64 {
    let (azimuth, elevation) = (d.x.abs().atan2(d.z), d.y.clamp(-1.0, 1.0).asin());
    let feature = |Feature(height, at, spread): &Feature| {
        let offset = [(azimuth - at[0]) / spread[0], (elevation - at[1]) / spread[1]];
        height * (-0.5 * (offset[0] * offset[0] + offset[1] * offset[1])).exp()
    };
    1.0 / d.component_div(&RADII).norm() + FEATURES.iter().map(feature).sum::<f64>()
}

/// The point of the head in the unit direction `d` from its centre, m.
pub fn point(d: Vector3<f64>) -> Vector3<f64> {
    CENTRE + d * radius(d)
}

/// Signed distance of `x` from the nearest of head, neck and shoulders, m (negative inside; first order in
/// the distance), and the outward unit normal.
pub fn height(x: Vector3<f64>) -> (f64, Vector3<f64>) {
    let above_head = |x: Vector3<f64>| {
        let from = x - CENTRE;
        let distance = from.norm().max(1e-6);
        distance - radius(from / distance)
    };
    let h = 1e-4;
    let slope = Vector3::from_fn(|i, _| {
        let step = Vector3::ith(i, h);
        (above_head(x + step) - above_head(x - step)) / (2.0 * h)
    });
    let steepness = slope.norm().max(1e-6);
    let head = (above_head(x) / steepness, slope / steepness);
    [NECK, SHOULDERS].iter().map(|c| above_capsule(x, c)).fold(head, |a, b| if b.0 < a.0 { b } else { a })
}

fn above_capsule(x: Vector3<f64>, (ends, radius): &([Vector3<f64>; 2], f64)) -> (f64, Vector3<f64>) {
    let axis = ends[1] - ends[0];
    let u = ((x - ends[0]).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
    let from = x - ends[0] - axis * u;
    let distance = from.norm().max(1e-6);
    (distance - radius, from / distance)
}

/// The head as a mesh: an icosahedron subdivided `subdivisions` times, with 20 × 4^`subdivisions` triangles.
pub fn mesh(subdivisions: usize) -> TriMesh {
    let (mut directions, mut triangles) = icosahedron();
    for _ in 0..subdivisions {
        let mut midpoint: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut split = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut between = |i: u32, j: u32| {
                *midpoint.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                    directions.push((directions[i as usize] + directions[j as usize]).normalize());
                    directions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (between(a, b), between(b, c), between(c, a));
            split.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = split;
    }
    TriMesh { vertices: directions.into_iter().map(point).collect(), triangles }
}

/// Unit vertices and triangles, counter-clockwise seen from outside.
fn icosahedron() -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut corners = Vec::with_capacity(12);
    for (a, b) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
        let corner = Vector3::new(a, b, 0.0).normalize();
        corners.extend([
            corner,
            Vector3::new(0.0, corner.x, corner.y),
            Vector3::new(corner.y, 0.0, corner.x),
        ]);
    }
    let edge = (corners[0] - corners[3]).norm();
    let mut triangles = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i: usize| corners[i]);
                if [p - q, q - r, r - p].iter().all(|e| (e.norm() - edge).abs() < 1e-9) {
                    let outward = (q - p).cross(&(r - p)).dot(&p) > 0.0;
                    let [a, b, c] = [a, b, c].map(|i| i as u32);
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    (corners, triangles)
}

/// The text of a Wavefront OBJ file, metres, Y up.
pub fn obj(mesh: &TriMesh) -> String {
    format!("# head of a hairbake sample, metres, Y up\no head\n{}", mesh.to_obj(5))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mesh_is_closed_and_oriented_outwards() {
        let mesh = mesh(3);
        assert_eq!(mesh.triangles.len(), 1280);
        let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|&n| n == 0), "every edge is used once in each direction");
        let volume: f64 = mesh
            .triangles
            .iter()
            .map(|t| t.map(|i| mesh.vertices[i as usize] - CENTRE))
            .map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0)
            .sum();
        assert!((0.003..0.005).contains(&volume), "{volume} m³");
    }

    #[test]
    fn height_is_the_signed_distance_near_the_surface() {
        for d in [Vector3::z(), Vector3::y(), Vector3::new(0.5, 0.5, -0.7).normalize()] {
            let (on, normal) = height(point(d));
            assert!(on.abs() < 1e-9);
            assert!((height(point(d) + normal * 0.005).0 - 0.005).abs() < 1e-3);
            assert!(height(point(d) - normal * 0.005).0 < -0.003);
        }
    }

    #[test]
    fn the_nose_points_forward() {
        let mesh = mesh(4);
        let tip = mesh.vertices.iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
        assert!(tip.x.abs() < 0.01 && tip.y < CENTRE.y, "{tip}");
    }
}
