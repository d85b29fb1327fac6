//! The linearised contact problem of one guide: rows, Delassus matrix, friction, compliance.

use super::scratch::{BodyContactScratch, ContactFrame};
use super::tolerances::{CONTACT_COMPLIANCE, MAX_COMPRESSION, MAX_TOLERATED_SHARE, RIGID_FORCE};
use crate::contact::{Bodies, BodyMotion, Contact, MovingPolyline};
use crate::dynamics::contact_polyline::on_rod;
use crate::dynamics::tie::ActiveTie;
use crate::geometry::Friction;
use crate::math::cholesky::{dot, solve_lower};
use crate::math::frame::frame_towards;
use crate::math::se3::Pose;
use crate::rod::Rod;
use crate::rod::newton::Solver;
use crate::rod::potential::Load;
use nalgebra::Vector3;

/// The contact problem of one guide in one step.
pub(in crate::dynamics) struct BodyContact<'a> {
    pub rod: &'a Rod,
    pub bodies: &'a Bodies,
    pub motions: &'a [BodyMotion],
    /// Clearance from body b at both ends of segment k of the contact polyline, at `b * segments + k`, m.
    pub clearance: &'a [[f64; 2]],
    /// Whether the strand slides on each body without friction.
    pub slides: &'a [bool],
    /// [`MovingPolyline::by_part`].
    pub by_part: bool,
    /// True while clearances from bodies that the groom is drawn in still rise, slowly enough for the tip.
    pub pushed_out: bool,
    /// Contact polyline at the start of the step
    /// ([`with_midpoints`](crate::dynamics::contact_polyline::with_midpoints)), world, m.
    pub x0: &'a [Vector3<f64>],
    /// Speed of the fastest point at the start of the step plus the speed gained by falling during it, m/s.
    pub fastest: f64,
    /// Ties that hold at the end of the step.
    pub ties: &'a [ActiveTie],
    /// Friction of the strand along itself, at root and tip, used where the body has none.
    pub friction: [Friction; 2],
    /// Ratio of the friction across the strand to the friction along it.
    pub across: f64,
    /// Root as it is carried at the end of the step, world.
    pub root: &'a Pose,
    pub load: &'a Load,
}

/// Computes the rows L⁻¹Jᵀ of a point of the rod along the three directions of `frame`. `carriers` are the
/// point's shares of the two curve points `k` and `k + 1`, m, relative to the root.
pub(in crate::dynamics) fn rows_at(
    solver: &Solver,
    k: usize,
    carriers: [(f64, Vector3<f64>); 2],
    frame: &[Vector3<f64>; 3],
    rows: &mut [f64],
) {
    let n = rows.len() / 3;
    for (d, row) in frame.iter().zip(rows.chunks_exact_mut(n)) {
        row.fill(0.0);
        for (point, (share, x)) in (k..).zip(&carriers) {
            solver.sensitivity.add_row(point, x, d, *share, row);
        }
        solve_lower(&solver.factor, n, row);
    }
}

/// Distance from its plane that the step requests of `contact`, m.
pub(super) fn target_distance(line: &MovingPolyline, contact: &Contact) -> f64 {
    line.gap(contact) + line.clearance_at(contact) - contact.gap
}

impl BodyContact<'_> {
    /// The contact polyline moving from the start of the step to `x1`, world, m.
    pub(super) fn line<'b>(&'b self, x1: &'b [Vector3<f64>]) -> MovingPolyline<'b> {
        MovingPolyline { x0: self.x0, x1, clearance: self.clearance, by_part: self.by_part }
    }

    /// Adds what the ties do to the solver's direction, and computes L⁻¹Jᵀ, less what ties prevent, and the free
    /// displacements in the axes of each contact.
    pub fn update_rows(&self, solver: &mut Solver, scratch: &mut BodyContactScratch) {
        scratch.ties.eliminate(self.ties, self.rod, &scratch.detection.x1, solver);
        let (detection, problem) = (&scratch.detection, &mut scratch.problem);
        let (n, contacts) = (self.rod.unknowns(), &detection.contacts);
        problem.rows.clear();
        problem.rows.resize(3 * contacts.len() * n, 0.0);
        problem.free_displacement.clear();
        problem.friction.clear();
        problem.frames.clear();
        for (contact, rows) in contacts.iter().zip(problem.rows.chunks_exact_mut(3 * n)) {
            let (k, u) = (contact.segment, contact.u);
            let at = |x: &[Vector3<f64>]| x[k] * (1.0 - u) + x[k + 1] * u;
            let slip = at(&detection.x1) - at(self.x0) - (contact.point[1] - contact.point[0]);
            let axes = self.axes(&detection.x1, contact);
            let (k, s) = on_rod(k, u);
            problem.frames.push(ContactFrame { segment: k, u: s, axes });
            rows_at(solver, k, solver.shape.blend_points(self.rod, k, s), &axes, rows);
            for (j, (d, row)) in axes.iter().zip(rows.chunks_exact(n)).enumerate() {
                let now = if j == 0 { contact.gap } else { slip.dot(d) };
                problem.free_displacement.push(now + dot(row, &solver.direction));
            }
            problem.friction.push(self.friction_at(contact));
        }
        scratch.ties.constrain(n, &mut problem.rows);
    }

    /// Computes the Delassus matrix with compliance at the reactions the solve starts from.
    pub(super) fn assemble_delassus(&self, scratch: &mut BodyContactScratch) {
        let (detection, problem) = (&scratch.detection, &mut scratch.problem);
        let line = self.line(&detection.x1);
        let (n, c) = (self.rod.unknowns(), detection.contacts.len());
        problem.delassus.clear();
        problem.delassus.resize(9 * c * c, 0.0);
        for a in 0..3 * c {
            for b in 0..=a {
                let w = dot(&problem.rows[a * n..(a + 1) * n], &problem.rows[b * n..(b + 1) * n]);
                problem.delassus[a * 3 * c + b] = w;
                problem.delassus[b * 3 * c + a] = w;
            }
            if a % 3 == 0 {
                let force = scratch.reactions.forces[a];
                let per_length = (1.0 - RIGID_FORCE / force.max(RIGID_FORCE)) * CONTACT_COMPLIANCE;
                let stiffening = 1.0 + per_length / MAX_COMPRESSION * force;
                let compliance = per_length * self.compressible(&line, &detection.contacts[a / 3]);
                problem.delassus[a * 3 * c + a] += compliance / stiffening;
            }
        }
    }

    /// The distance of which a contact compresses by a share, m: its clearance, and less in proportion where
    /// the step requests less than old violations may leave, so that repeated pressing never reaches the
    /// surface. Contacts with a negative target are compliant as well: another body may hold the point while
    /// it leaves the first.
    pub(super) fn compressible(&self, line: &MovingPolyline, contact: &Contact) -> f64 {
        let keep = line.clearance_at(contact);
        keep.min(target_distance(line, contact).abs() / (1.0 - MAX_TOLERATED_SHARE)).max(0.0)
    }

    /// Friction of a contact.
    pub(super) fn friction_at(&self, contact: &Contact) -> Friction {
        if self.slides[contact.body] {
            return 0.0.into();
        }
        let (k, s) = on_rod(contact.segment, contact.u);
        let own = || Friction::lerp(self.friction, self.rod.arc_fraction(k, s));
        contact.friction.unwrap_or_else(own)
    }

    /// The axes of a contact: its normal, and tangents along and across the strand. The second tangent is
    /// scaled by the ratio of friction across to friction along. The elliptic cone is circular in these axes,
    /// and sliding that dissipates most (Moreau 1974) is sliding against the force.
    fn axes(&self, x: &[Vector3<f64>], contact: &Contact) -> [Vector3<f64>; 3] {
        let (k, n) = (contact.segment, &contact.normal);
        let frame = frame_towards(n, &(x[k + 1] - x[k]));
        [*n, frame.column(0).into(), frame.column(1) * self.across]
    }
}
