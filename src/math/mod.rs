//! Small mathematics shared by the solver: rigid motions, dense kernels. Imports nothing of ours.

pub mod cholesky;
pub mod frame;
pub mod se3;
pub mod spline;
