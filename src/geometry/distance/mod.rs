//! Distances between points, segments, triangles and ellipsoids, in one frame, metres.

mod ellipsoid;
mod segment;
mod triangle;

pub use ellipsoid::closest_on_ellipsoid;
pub use segment::segment_segment;
pub use triangle::{ClosestPoints, TriangleFeature, barycentric, closest_on_triangle, segment_triangle};
