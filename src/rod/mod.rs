//! Kirchhoff rods in curvature-and-twist coordinates (`docs/theory.md` §3-§5).
//!
//! A rod is inextensible and unshearable by construction: its shape follows from its strain
//! Ω(s) = (κ1, κ2, τ) in the material frame. The natural shape keeps the groom's own resolution; the unknowns `q`
//! are the deviation from it at a few nodes, linear in between. [`Rod`] is what does not change, [`RodShape`]
//! and [`Sensitivity`] are the kinematics at one `q`, [`potential`] the incremental potential whose minimum is the
//! implicit step, [`newton`] finds it.
//!
//! | symbol | here | meaning | unit |
//! |---|---|---|---|
//! | s, L | `nodes`, `length` | arc length | m |
//! | Ω, Ω̄ | strain, natural strain | (κ1, κ2, τ) along d1, d2, d3 | 1/m |
//! | q | `q[3 i + c]` | deviation Ω − Ω̄ at node i, axis c; zero at the tip node | 1/m |
//! | ψ | `Twist` | Magnus exponent of one sub-step | rad, m |
//! | T, S | `Twist` columns | world twist that an unknown induces downstream | rad·m, m² per 1/m |
//! | K | `stiffness` | (E I1, E I2, G J) | N·m² |

pub mod contact_load;
mod kinematics;
mod levers;
mod model;
pub mod newton;
pub mod pack;
pub mod potential;

pub use kinematics::{RodShape, Sensitivity};
pub use levers::LumpedSensitivity;
pub use model::{Rod, RodSource, SegmentSize, Taper};
