//! The hair cache: the USD files of a bake, written by [`Writer`] and read by [`Reader`].
//!
//! | file | content |
//! |---|---|
//! | `hair.usda` | root layer: the one to open or to reference |
//! | `hair.topology.usdc` | everything that does not move ([`Header`]) |
//! | `hair.manifest.usda` | clip manifest |
//! | `hair.1001.usdc` … | one file per frame ([`Frame`]) |
//! | `manifest.json` | [`Manifest`]: inputs, settings, checksums and figures; written last |
//!
//! A folder without `manifest.json` contains an unfinished bake.

pub mod array;
mod check;
mod deform;
mod frame;
mod header;
mod layers;
mod manifest;
mod material;
mod names;
mod over;
mod reader;
mod shot;
mod writer;

pub use crate::file::{FileRecord, sha256, write_file};
pub use deform::{DeformCurves, DeformHeader, DeformMethod, DeformSpace};
pub use frame::{ColliderFrame, CurveFrame, Frame, Reactions};
pub use header::{Basis, ClosestGuides, ColliderMesh, CurveSet, Header, HeldGuides, ranges};
pub use manifest::{
    DeformPrimRecord, DeformRecord, FrameEntry, InputRecord, Manifest, OverPrimRecord, OverRecord, OverRun,
    Summary,
};
pub use names::{
    CLIP_MANIFEST, DEFORM, MANIFEST, OVER, OVER_CLIP_MANIFEST, ROOT, SHOT, TOPOLOGY, frame_file_name,
    over_frame_file_name,
};
pub use over::{OverCurveFrame, OverCurves, OverFrame, OverHeader};
pub use reader::Reader;
pub use shot::ShotStage;
pub use writer::{Writer, mark_unfinished};
