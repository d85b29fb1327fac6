//! Closest points of segments, triangles and ellipsoids, all in one frame, m.

pub mod ellipsoid;
pub mod segment;
pub mod triangle;
