//! Convex shapes: closest point, outward normal and signed distance in closed form.

use super::distance::ellipsoid::closest_on_ellipsoid;
use super::surface_point::{Feature, SurfacePoint};
use crate::math::frame::any_frame;
use crate::math::polyline::closest_on_segment;
use nalgebra::{UnitQuaternion, Vector3};

/// A convex shape; its signed distance is a convex function.
#[derive(Debug, Clone)]
pub enum Convex {
    /// All points within `radius` of a segment; a sphere if the ends coincide.
    Capsule {
        /// Ends of the axis, m.
        ends: [Vector3<f64>; 2],
        /// Radius, m.
        radius: f64,
    },
    /// Ellipsoid.
    Ellipsoid {
        /// Centre, m.
        centre: Vector3<f64>,
        /// Semi-axes, m.
        radii: Vector3<f64>,
        /// Orientation of the axes.
        rotation: UnitQuaternion<f64>,
    },
    /// Half-space bounded by a plane.
    Plane {
        /// A point of the plane, m.
        point: Vector3<f64>,
        /// Unit normal, pointing out of the solid.
        normal: Vector3<f64>,
    },
}

impl Convex {
    /// Surface point closest to `p`, body frame. The solid lies on the inner side of the tangent plane there.
    pub fn closest(&self, p: &Vector3<f64>) -> SurfacePoint {
        let (distance, normal, point) = match self {
            Convex::Capsule { ends: [a, b], radius } => {
                let axis_point = a + (b - a) * closest_on_segment(p, a, b);
                let normal = (p - axis_point).try_normalize(0.0).unwrap_or_else(|| any_normal(&(b - a)));
                ((p - axis_point).norm() - radius, normal, axis_point + normal * *radius)
            }
            Convex::Ellipsoid { centre, radii, rotation } => {
                let local = rotation.inverse() * (p - centre);
                let x = closest_on_ellipsoid(&local, radii);
                // The gradient of the quadric: p − x loses its digits near the surface.
                let gradient = x.component_div(radii).component_div(radii);
                let normal = gradient.normalize();
                ((local - x).dot(&normal), rotation * normal, centre + rotation * x)
            }
            Convex::Plane { point, normal } => {
                let distance = normal.dot(&(p - point));
                (distance, *normal, p - normal * distance)
            }
        };
        SurfacePoint { distance, normal, point, feature: Feature::Smooth }
    }

    /// First intersection of the segment from `a` to `b` with the surface: the fraction of the segment, and
    /// the outward normal there.
    pub(super) fn first_intersection(
        &self,
        a: &Vector3<f64>,
        b: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        let outside = |u: f64| self.closest(&a.lerp(b, u)).distance > 0.0;
        let (u, _) = self.closest_to_segment(a, b);
        let (mut from, mut to) = (0.0, if outside(0.0) { u } else { 1.0 });
        if outside(to) == outside(from) {
            return None;
        }
        // The distance is convex along the segment. From outside to its minimum, or from inside to an end
        // outside, it changes sign once.
        for _ in 0..50 {
            let middle = 0.5 * (from + to);
            if outside(middle) == outside(0.0) { from = middle } else { to = middle }
        }
        Some((to, self.closest(&a.lerp(b, to)).normal))
    }

    /// Fraction of segment `ab` at which the signed distance is least, and the surface point closest to it.
    ///
    /// The distance is convex along the segment. The zero of its slope is bracketed and found by regula falsi
    /// with the Illinois modification (Dowell & Jarratt 1971); every third step bisects, for the slope may
    /// jump.
    pub fn closest_to_segment(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> (f64, SurfacePoint) {
        let d = b - a;
        let tolerance = 1e-12 * d.norm();
        let (mut lo, mut hi) = (0.0, 1.0);
        let start = self.closest(a);
        let mut slope_lo = start.normal.dot(&d);
        if slope_lo >= -tolerance {
            return (0.0, start);
        }
        let end = self.closest(b);
        let mut slope_hi = end.normal.dot(&d);
        if slope_hi <= tolerance {
            return (1.0, end);
        }
        let mut best = (0.0, start);
        for k in 0..60 {
            let u = if k % 3 == 2 {
                0.5 * (lo + hi)
            } else {
                (lo * slope_hi - hi * slope_lo) / (slope_hi - slope_lo)
            };
            let at = self.closest(&(a + d * u));
            best = (u, at);
            let slope = at.normal.dot(&d);
            if slope.abs() <= tolerance || hi - lo < 1e-15 {
                break;
            }
            if slope < 0.0 {
                (lo, slope_lo) = (u, slope);
                slope_hi *= 0.5;
            } else {
                (hi, slope_hi) = (u, slope);
                slope_lo *= 0.5;
            }
        }
        best
    }
}

/// A unit vector perpendicular to `axis`; any unit vector if the axis has no length.
fn any_normal(axis: &Vector3<f64>) -> Vector3<f64> {
    axis.try_normalize(0.0).map_or_else(Vector3::y, |tangent| any_frame(&tangent).column(1).into())
}
