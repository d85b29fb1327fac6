//! Nonsmooth block Gauss-Seidel over contacts, optionally accelerated.

use super::anderson::Anderson;
use super::budget::SystemBudget;
use super::local::LocalSolver;
use super::residual::Residual;
use crate::geometry::Friction;
use nalgebra::{Matrix3, Vector3};

/// Sweeps between two checks of all contacts.
const CHECK_INTERVAL: usize = 10;

/// Growth of the residual over the smallest so far at which acceleration is abandoned.
const DIVERGENCE: f64 = 10.0;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionTolerance {
    /// Relative residual at which the solve has converged, see [`FrictionProblem::residual`].
    ///
    /// [`FrictionProblem::residual`]: super::FrictionProblem::residual
    pub residual: f64,
    /// Maximum number of sweeps. Friction couples contacts: a strand with tens of them may need hundreds.
    pub sweeps: usize,
    /// Whether what is hard to solve is worth many systems: for one strand, the path of solutions where Newton's
    /// method fails; for coupled strands, Newton's method for wedged contacts.
    pub continuation: bool,
}

impl Default for FrictionTolerance {
    /// 1e-8 and 1000 sweeps: far below the error of a step's linearisation, usually reached in tens of
    /// sweeps.
    fn default() -> Self {
        FrictionTolerance { residual: 1e-8, sweeps: 1000, continuation: true }
    }
}

/// Result of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionOutcome {
    /// Number of sweeps.
    pub sweeps: usize,
    /// Relative residual reached.
    pub residual: f64,
}

/// Operations of a problem and its impulses that the sweeps need.
pub(super) trait System {
    fn contacts(&self) -> usize;
    /// Diagonal block of W.
    fn block(&self, i: usize) -> Matrix3<f64>;
    /// Free velocity b of a contact.
    fn free(&self, i: usize) -> Vector3<f64>;
    fn friction(&self, i: usize) -> Friction;
    fn impulse(&self, i: usize) -> Vector3<f64>;
    /// Computes u of all contacts under the current impulses.
    fn velocities(&mut self, u: &mut Vec<Vector3<f64>>);
    /// u of a contact.
    fn velocity(&self, i: usize) -> Vector3<f64>;
    fn set_impulse(&mut self, i: usize, impulse: Vector3<f64>);
}

/// Buffers of a solve, reused to avoid allocations.
#[derive(Debug, Default)]
pub struct FrictionScratch {
    locals: Vec<LocalSolver>,
    /// Contacts of the sweeps.
    active: Vec<u32>,
    is_active: Vec<bool>,
    /// u of all contacts at a check.
    velocities: Vec<Vector3<f64>>,
    /// Scaled impulses of the active contacts before a sweep.
    before: Vec<f64>,
    /// Scaled impulses of the active contacts after a sweep.
    after: Vec<f64>,
    anderson: Anderson,
    /// Impulses at the check with the smallest residual.
    best: Vec<Vector3<f64>>,
    /// Systems of Newton's method that may still be solved in the sub-step.
    pub budget: SystemBudget,
}

/// Sweeps until the residual is small.
///
/// Active are the contacts with an impulse or with penetration. Checks up to the first [`CHECK_INTERVAL`]
/// sweeps determine them anew; later ones only add. Sweeps continue to the next check, or until one changes
/// the velocities by no more than the tolerance. The residual is that of all contacts at a check.
///
/// A sweep is one step of a fixed-point iteration, which may be `accelerated`. This takes a tenth of the
/// sweeps once it is settled which contacts have impulses and which of them stick; inactive contacts stay
/// inactive. Without a solution, as between bodies that close on a strand, it diverges. Then the impulses of
/// the best check are restored, and sweeps continue without acceleration.
#[inline(always)]
pub(super) fn solve_by_sweeps(
    system: &mut impl System,
    tolerance: FrictionTolerance,
    accelerated: bool,
    scratch: &mut FrictionScratch,
) -> FrictionOutcome {
    scratch.locals.clear();
    scratch.locals.extend((0..system.contacts()).map(|i| LocalSolver::new(&system.block(i))));
    scratch.active.clear();
    scratch.active.extend(0..scratch.locals.len() as u32);
    let mut solver = GaussSeidel { system, tolerance, scratch, accelerated, sweeps: 0, least: f64::INFINITY };
    loop {
        let sums = solver.check();
        let (free, residual) = (sums.free, sums.relative());
        let out_of_sweeps = solver.sweeps >= tolerance.sweeps;
        if solver.abandons_acceleration(residual, out_of_sweeps) {
            continue;
        }
        if residual <= tolerance.residual || out_of_sweeps {
            return FrictionOutcome { sweeps: solver.sweeps, residual };
        }
        solver.sweep_to_next_check(free);
    }
}

/// A solve in progress.
struct GaussSeidel<'a, S> {
    system: &'a mut S,
    tolerance: FrictionTolerance,
    scratch: &'a mut FrictionScratch,
    accelerated: bool,
    sweeps: usize,
    /// Smallest residual of an accelerated solve.
    least: f64,
}

impl<S: System> GaussSeidel<'_, S> {
    /// Computes the residual of all contacts, and updates which of them are active.
    #[inline(always)]
    fn check(&mut self) -> Residual {
        let FrictionScratch { locals, active, is_active, velocities, anderson, .. } = &mut *self.scratch;
        self.system.velocities(velocities);
        let mut residual = Residual::default();
        let known = active.len();
        let anew = self.sweeps <= CHECK_INTERVAL;
        if anew {
            active.clear();
            is_active.clear();
            is_active.resize(locals.len(), false);
        }
        for (i, (local, u)) in locals.iter().zip(&*velocities).enumerate() {
            let (r, friction) = (self.system.impulse(i), self.system.friction(i));
            residual.add(local.w.trace(), *u, &r, &self.system.free(i), friction);
            if acts(u, &r) && !is_active[i] {
                is_active[i] = true;
                active.push(i as u32);
            }
        }
        if anew || active.len() > known {
            anderson.clear();
        }
        residual
    }

    /// Keeps the best impulses of an accelerated solve. If it diverges, or ends with a larger residual,
    /// restores them and continues without acceleration.
    #[inline(always)]
    fn abandons_acceleration(&mut self, residual: f64, out_of_sweeps: bool) -> bool {
        if !self.accelerated {
            return false;
        }
        let FrictionScratch { locals, best, .. } = &mut *self.scratch;
        if residual < self.least {
            self.least = residual;
            best.clear();
            best.extend((0..locals.len()).map(|i| self.system.impulse(i)));
        }
        let abandon = residual > DIVERGENCE * self.least || out_of_sweeps && residual > self.least;
        if abandon {
            best.iter().enumerate().for_each(|(i, r)| self.system.set_impulse(i, *r));
            self.accelerated = false;
        }
        abandon
    }

    /// Sweeps up to the next check; `free` is the sum of squares of the free velocities.
    #[inline(always)]
    fn sweep_to_next_check(&mut self, free: f64) {
        let last = self.sweeps + CHECK_INTERVAL.min(self.tolerance.sweeps - self.sweeps);
        loop {
            if self.accelerated {
                let FrictionScratch { locals, active, before, .. } = &mut *self.scratch;
                gather(&*self.system, locals, active, before);
            }
            let converged = self.sweep(free);
            self.sweeps += 1;
            // A check follows a plain sweep: accelerated impulses may lie outside their cones.
            if self.sweeps == last || converged {
                break;
            }
            if self.accelerated {
                self.accelerate();
            }
        }
    }

    /// Solves each active contact once, in order. Returns whether the velocities changed by no more than the
    /// tolerance.
    #[inline(always)]
    fn sweep(&mut self, free: f64) -> bool {
        let FrictionScratch { locals, active, .. } = &mut *self.scratch;
        let (mut moved, mut impulse) = (0.0, 0.0);
        for &i in &*active {
            let (i, local) = (i as usize, &mut locals[i as usize]);
            let (u, old) = (self.system.velocity(i), self.system.impulse(i));
            if acts(&u, &old) {
                let before = local.w * old;
                let new = local.solve(&(u - before), self.system.friction(i));
                moved += (local.w * new - before).norm_squared();
                impulse += (new * (local.w.trace() / 3.0)).norm_squared();
                self.system.set_impulse(i, new);
            }
        }
        moved <= self.tolerance.residual.powi(2) * impulse.max(free)
    }

    /// Replaces the impulses after a sweep by their accelerated combination.
    #[inline(always)]
    fn accelerate(&mut self) {
        let FrictionScratch { locals, active, before, after, anderson, .. } = &mut *self.scratch;
        gather(&*self.system, locals, active, after);
        anderson.accelerate(before, after);
        for (&i, x) in active.iter().zip(after.chunks_exact(3)) {
            let (i, scale) = (i as usize, locals[i as usize].scale);
            if scale > 0.0 && self.system.impulse(i) != Vector3::zeros() {
                self.system.set_impulse(i, Vector3::from_column_slice(x) / scale);
            }
        }
    }
}

/// Whether a contact has an impulse `r`, or would need one at velocity `u`.
#[inline(always)]
fn acts(u: &Vector3<f64>, r: &Vector3<f64>) -> bool {
    u.x < 0.0 || *r != Vector3::zeros()
}

/// Collects the impulses of the `active` contacts, times the square roots of their mobilities: sums over
/// contacts need a common unit.
#[inline(always)]
fn gather(system: &impl System, locals: &[LocalSolver], active: &[u32], x: &mut Vec<f64>) {
    x.clear();
    for &i in active {
        let r = system.impulse(i as usize) * locals[i as usize].scale;
        x.extend_from_slice(r.as_slice());
    }
}
