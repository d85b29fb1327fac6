//! Small mathematics shared by the solver: rigid motions, dense kernels. Imports nothing of ours.
