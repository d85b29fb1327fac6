//! The validated scene: plain data in SI units, metres, Y up. `groom.json` and `anim.json` become
//! [`Groom`] and [`Anim`] here, with every fault of a file reported at once.

pub mod anim;
pub mod convention;
pub mod groom;
pub mod keyed;
pub mod track;

pub use anim::{Anim, Body, Collider, Settings, Shape, TriMesh};
pub use convention::{Convention, UpAxis};
pub use groom::{Curves, Groom, Group, Guides, Material, RodSection, Section, Strands, Tree, Wisp};
