//! The guides of a groom in motion.

pub mod air_drag;
pub mod batch;
mod body_contact;
pub mod checkpoint;
mod clearance;
pub mod clock;
mod collider;
mod contact_polyline;
mod coupled_substep;
pub mod environment;
pub mod exemption;
pub mod goal;
pub mod guide;
pub mod guide_frame;
pub mod guide_rods;
mod hair_volume;
mod integrator;
pub mod model;
pub mod pinch;
pub mod reaction;
pub mod sag_free;
pub mod simulation;
pub mod step_record;
mod strand_contact;
pub mod tie;
mod wisp_friction;
pub mod wisps;
