//! Constants shared by detection, the contact problem and the rounds.

use crate::contact::FrictionTolerance;
pub(in crate::dynamics) use crate::contact::GAP_TOLERANCE;

/// Distance from a surface, at the end of a step, below which a strand is in the contact problem, m.
pub(super) const DETECTION_DISTANCE: f64 = 1e-3;

/// Largest displacement of a point in one round, m; the linearisation is useless beyond it.
pub(in crate::dynamics) const MAX_MOVE: f64 = 0.01;

/// Share of a violation from before the step that the step removes. Removing a tenth of a millimetre near the
/// root at once would fling the tip. Violations caused by the step itself are removed completely.
pub(super) const STABILISATION: f64 = 0.1;

/// Largest share of a clearance that an old violation may use while it is removed; continuous detection needs
/// the remaining share.
pub(super) const MAX_TOLERATED_SHARE: f64 = 0.75;

/// Largest speed at which points inside a body are pushed out, m/s.
pub(super) const PUSH_OUT_SPEED: f64 = 0.3;

/// Speed that pushing out would give to the tip of a straight strand, m/s. Points near the root, where the
/// tip has the longer arm, are pushed out at their share of it. A strand bends and lags behind, so that this
/// may be more than a step without a solution is allowed (`MAX_WEDGE_SPEED`); half of it is too slow for hair
/// that is wedged near its root.
pub(super) const MAX_TIP_SPEED: f64 = 2.0;

/// Violation at which a step that crosses no surface is accepted after all rounds, m: a strand wedged
/// between two surfaces cannot keep its distance from both.
pub(super) const ACCEPTABLE_GAP: f64 = 1e-3;

/// Share of the requested distance that such a step must leave at every contact. The cache holds chords of
/// the strand, which may be slightly nearer to the surface.
pub(super) const MIN_DISTANCE_SHARE: f64 = 0.1;

/// Allowance for rounding in a distance, m.
pub(super) const ROUNDING: f64 = 1e-9;

/// Largest number of contacts of one strand in one problem; the deepest are kept, the next round sees the
/// others.
pub(super) const MAX_CONTACTS: usize = 64;

/// Cosine of the largest angle between normals that count as the same contact in successive rounds or steps.
pub(super) const SAME_NORMAL: f64 = 0.9;

/// Depth in a surface that counts as on it, m: a fortieth of a hair's radius.
pub(super) const SURFACE_TOLERANCE: f64 = 1e-6;

/// Initial compliance of a contact beyond [`RIGID_FORCE`], as a share of its clearance per newton, as of skin
/// under a fibre: it bounds the forces on a strand wedged where there is no room for it.
pub(super) const CONTACT_COMPLIANCE: f64 = 5.0;

/// Share of a clearance that an infinite force compresses. It is below the share that old violations leave,
/// so that pressing over many short steps never brings a point onto the surface, where rounding could take it
/// through.
pub(super) const MAX_COMPRESSION: f64 = 0.2;

/// Force up to which contacts are rigid, N: several times the weight of a hair.
pub(super) const RIGID_FORCE: f64 = 1e-4;

/// Compliance of the springs of [`BodyContact::push_away`](super::BodyContact::push_away), m/N: the weight of
/// a long hair sinks in by 0.02 mm. It is a hundredth of the step's own compliance (stiffness about 0.01
/// N/m); less gains nothing.
pub(super) const SPRING_COMPLIANCE: f64 = 1.0;

/// Relative distance to the friction cone below which a sliding contact is taken to slide.
pub(super) const SLIDING_TOLERANCE: f64 = 1e-9;

/// Tolerance for the forces of springs.
pub(super) const SPRING_TOLERANCE: FrictionTolerance =
    FrictionTolerance { residual: 1e-2, sweeps: 20, continuation: true };

/// Tolerance for the reactions: the residual multiplies the displacements of a step, about 0.1 mm.
pub(super) const REACTION_TOLERANCE: FrictionTolerance =
    FrictionTolerance { residual: 1e-6, sweeps: 100, continuation: true };
