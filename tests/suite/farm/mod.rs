//! A bake on a farm: divided, killed, stopped, run twice, out of space; whatever happens, the same bytes in the end.

mod disk;
mod engines;
mod shot;
mod signals;
mod slurm;
mod stages;
mod storm;
