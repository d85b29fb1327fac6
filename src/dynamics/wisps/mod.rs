//! The adaptive wisp tree: active guides are stepped, followers move with their leaders (`docs/theory.md` §8;
//! Bertails, Kim, Cani & Neumann 2003).

mod adaptive_tree;
mod checkpoint;
mod control_variate;
mod depenetration;
mod follower;
mod follower_pack;
mod leader_motion;
mod min_correction;
mod modal_correction;
mod rest_shape;
mod snapshot;

pub(super) use adaptive_tree::AdaptiveTree;
pub use adaptive_tree::WispChanges;
pub(super) use checkpoint::WispsState;
