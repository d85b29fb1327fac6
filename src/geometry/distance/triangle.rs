//! Closest points on triangles.

use super::segment::segment_segment;
use crate::math::polyline::closest_on_segment;
use nalgebra::Vector3;

/// A feature of a triangle; edge i runs from vertex i to vertex i + 1 (mod 3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TriangleFeature {
    /// A vertex.
    Vertex(usize),
    /// The interior of an edge.
    Edge(usize),
    /// The interior.
    Face,
}

/// Closest points of a segment and a triangle.
#[derive(Debug, Clone, Copy)]
pub struct ClosestPoints {
    /// Parameter of the point of the segment, 0..=1.
    pub u: f64,
    /// Point of the triangle, m.
    pub point: Vector3<f64>,
    /// Squared distance, m²; 0 if the segment intersects the triangle.
    pub distance2: f64,
    /// Feature of the triangle that `point` lies on.
    pub feature: TriangleFeature,
}

/// Point of triangle `v` closest to `p`, and the feature it lies on (Ericson 2005, §5.1.5: Voronoi regions).
pub fn closest_on_triangle(p: &Vector3<f64>, v: [&Vector3<f64>; 3]) -> (Vector3<f64>, TriangleFeature) {
    let [a, b, c] = v;
    let (ab, ac) = (b - a, c - a);
    let ap = p - a;
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (*a, TriangleFeature::Vertex(0));
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (*b, TriangleFeature::Vertex(1));
    }
    // Barycentric coordinates of c, b and a, times twice the squared area.
    let wc = d1 * d4 - d3 * d2;
    if wc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), TriangleFeature::Edge(0));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (*c, TriangleFeature::Vertex(2));
    }
    let wb = d5 * d2 - d1 * d6;
    if wb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), TriangleFeature::Edge(2));
    }
    let wa = d3 * d6 - d5 * d4;
    let (to_c, to_b) = (d4 - d3, d5 - d6);
    if wa <= 0.0 && to_c >= 0.0 && to_b >= 0.0 {
        return (b + (c - b) * (to_c / (to_c + to_b)), TriangleFeature::Edge(1));
    }
    let scale = 1.0 / (wa + wb + wc);
    (a + ab * (wb * scale) + ac * (wc * scale), TriangleFeature::Face)
}

/// Barycentric coordinates of `p` on `feature` of triangle `v`.
pub fn barycentric(feature: TriangleFeature, p: &Vector3<f64>, v: [&Vector3<f64>; 3]) -> [f64; 3] {
    let mut w = [0.0; 3];
    match feature {
        TriangleFeature::Vertex(i) => w[i] = 1.0,
        TriangleFeature::Edge(i) => {
            let j = (i + 1) % 3;
            w[j] = closest_on_segment(p, v[i], v[j]);
            w[i] = 1.0 - w[j];
        }
        TriangleFeature::Face => {
            let n = (v[1] - v[0]).cross(&(v[2] - v[0]));
            let opposite = |i: usize| n.dot(&(v[(i + 1) % 3] - p).cross(&(v[(i + 2) % 3] - p)));
            w = [0, 1, 2].map(|i| opposite(i) / n.norm_squared());
        }
    }
    w
}

/// Point of a triangle with barycentric coordinates `w`.
pub fn barycentric_point(corners: [&Vector3<f64>; 3], w: &[f64; 3]) -> Vector3<f64> {
    corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2]
}

/// Closest points of segment `ab` and triangle `v`. The minimum is at an end of the segment or on an edge of
/// the triangle, unless the segment intersects the face.
pub fn segment_triangle(a: &Vector3<f64>, b: &Vector3<f64>, v: [&Vector3<f64>; 3]) -> ClosestPoints {
    let at_end = |u: f64, x: &Vector3<f64>| {
        let (point, feature) = closest_on_triangle(x, v);
        ClosestPoints { u, point, distance2: (x - point).norm_squared(), feature }
    };
    let mut best = at_end(0.0, a);
    let end = at_end(1.0, b);
    if end.distance2 < best.distance2 {
        best = end;
    }
    for i in 0..3 {
        let q = [v[i], v[(i + 1) % 3]];
        let (u, t) = segment_segment([a, b], q);
        let point = q[0] + (q[1] - q[0]) * t;
        let distance2 = (a + (b - a) * u - point).norm_squared();
        if distance2 < best.distance2 {
            let feature = match t {
                0.0 => TriangleFeature::Vertex(i),
                1.0 => TriangleFeature::Vertex((i + 1) % 3),
                _ => TriangleFeature::Edge(i),
            };
            best = ClosestPoints { u, point, distance2, feature };
        }
    }
    let n = (v[1] - v[0]).cross(&(v[2] - v[0]));
    let (ha, hb) = (n.dot(&(a - v[0])), n.dot(&(b - v[0])));
    if (ha > 0.0) != (hb > 0.0) && ha != hb {
        let u = ha / (ha - hb);
        let x = a + (b - a) * u;
        if (0..3).all(|i| n.dot(&(v[(i + 1) % 3] - v[i]).cross(&(x - v[i]))) >= 0.0) {
            best = ClosestPoints { u, point: x, distance2: 0.0, feature: TriangleFeature::Face };
        }
    }
    best
}
