//! Readers, one per file format. Each returns what the file contains, in the file's unit and axes, and
//! reports every error it finds at once.

pub(super) mod bvh;
mod bytes;
pub(super) mod gltf;
pub(super) mod hair;
pub(super) mod obj;
pub(super) mod tfx;
pub(super) mod usd;
