//! Bakes on a farm: divided, killed, stopped, run twice or out of disk space, all with the same bytes.

mod disk;
mod engines;
mod shot;
mod signals;
mod slurm;
mod stages;
mod storm;
