//! Kirchhoff rods in curvature-and-twist coordinates.
