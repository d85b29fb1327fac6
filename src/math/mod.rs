//! Small mathematics shared by the solver: rigid motions, frames and splines of curves, dense kernels, random numbers. Imports nothing of ours.

pub mod cholesky;
pub mod frame;
pub mod polyline;
pub mod random;
pub mod se3;
pub mod spline;
