//! Kirchhoff rods in curvature-and-twist coordinates (`docs/theory.md` §3-§5).
//!
//! A Kirchhoff rod is the inextensible, unshearable Cosserat rod: its shape follows from its strain Ω(s) =
//! (κ1, κ2, τ) in the material frame. The natural shape keeps the groom's own resolution; the unknowns `q`
//! are the deviation of the strain from it at a few nodes, linear in between.
//!
//! | symbol | here | meaning | unit |
//! |---|---|---|---|
//! | s, L | `nodes`, `length` | arc length | m |
//! | Ω, Ω̄ | strain, natural strain | (κ1, κ2, τ) along d1, d2, d3 | 1/m |
//! | q | `q[3 i + c]` | deviation Ω − Ω̄ at node i, axis c; zero at a tip without moment | 1/m |
//! | θ | `q[..3]` of a pinned or free root, before the nodes | rotation vector of its frame | rad |
//! | d | `q[3..6]` of a free root | displacement from what carries it, in its axes | m |
//! | ψ | `Twist` | Magnus exponent of one segment | rad, m |
//! | T, S | `Twist` | world twist of everything downstream per unit of an unknown | rad·m, m² |
//! | K | `stiffness` | (E I1, E I2, G J) | N·m² |
//!
//! | file | content |
//! |---|---|
//! | `model` | [`Rod`]: constants of a rod, built from a [`RodSource`] |
//! | `segment` | [`SegmentSize`]; the segments of the curve |
//! | `shape` | [`RodShape`]: frames and points at one `q` |
//! | `sensitivity` | [`Sensitivity`]: exact derivatives of the shape by `q` |
//! | `lumped` | [`LumpedSensitivity`]: approximate ones, and matrices of linear models |
//! | [`potential`], `hessian` | incremental potential Φ of one implicit step; its minimum is the new state |
//! | [`newton`] | [`Solver`](newton::Solver): minimises Φ |
//! | `block_factor` | factor of the Hessian of a long rod in O(n) |
//! | [`contact_load`] | linearisation of Φ under contact forces |
//! | `joint` | [`RootJoint`]: rotation and displacement of a root that is not clamped |
//! | `held_frame` | material frames at places of a rod that are held |
//! | `winding` | free roots that turn by more than half a turn |
//! | [`Fit`] | unknowns at which a rod passes near given points |
//! | [`RateFit`] | rates of the unknowns at which places of a rod move as given |
//! | [`pack`] | several rods at once, one per SIMD lane |

mod block_factor;
pub mod contact_load;
mod drawn;
mod fit;
mod hat;
mod held_frame;
mod hessian;
mod joint;
mod lumped;
mod model;
pub mod newton;
pub mod pack;
pub mod potential;
mod rate_fit;
mod secants;
mod segment;
mod sensitivity;
mod shape;
mod winding;

pub use fit::Fit;
pub use held_frame::HoldingMoment;
pub use joint::RootJoint;
pub use lumped::LumpedSensitivity;
pub use model::{Rod, RodSource, Taper};
pub use rate_fit::{PlaceVelocity, RateFit};
pub use segment::SegmentSize;
pub use sensitivity::Sensitivity;
pub use shape::RodShape;

#[cfg(test)]
mod tests;
