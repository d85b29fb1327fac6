//! Gauss-Seidel over contacts, accelerated.

use super::anderson::Anderson;
use super::local::Local;
use super::problem::{FrictionOutcome, FrictionTolerance, Law, Residual};
use nalgebra::{Matrix3, Vector3};

/// Sweeps between two looks at the contacts that are open.
const LOOK: usize = 10;

/// How many times the least residual so far a look may show before sweeps are no longer accelerated.
const ASTRAY: f64 = 10.0;

/// What Gauss-Seidel asks of a problem.
pub(super) trait System {
    fn contacts(&self) -> usize;
    /// Diagonal block of W.
    fn block(&self, i: usize) -> Matrix3<f64>;
    fn free(&self, i: usize) -> Vector3<f64>;
    fn law(&self, i: usize) -> Law;
    fn impulse(&self, i: usize) -> Vector3<f64>;
    /// u of all contacts under the impulses as they are.
    fn look(&mut self, u: &mut Vec<Vector3<f64>>);
    /// Is told which contacts are swept over from now on. No others push.
    fn narrow(&mut self, _live: &[u32]) {}
    /// u of a contact that is swept over.
    fn velocity(&self, i: usize) -> Vector3<f64>;
    fn set(&mut self, i: usize, impulse: Vector3<f64>);
}

/// Contacts prepared for a solve, kept to spare allocations.
#[derive(Debug, Default)]
pub struct FrictionScratch {
    locals: Vec<Local>,
    /// Contacts that are swept over, and whether each is.
    live: Vec<u32>,
    is_live: Vec<bool>,
    /// u of all contacts in a look.
    seen: Vec<Vector3<f64>>,
    /// Impulses of what is swept over before and after a sweep, each in its contact's own scale.
    before: Vec<f64>,
    after: Vec<f64>,
    anderson: Anderson,
    /// The impulses of the best look.
    best: Vec<Vector3<f64>>,
}

/// Sweeps until the residual is small. What is swept over are the contacts that push or are too near: in looks up to the first [`LOOK`] sweeps just these,
/// from then on with those that have been so since. Sweeps go on to the next look, or until one changes the velocities no more than the residual may be; the residual is that
/// of all contacts at a look.
///
/// A sweep is a turn of a fixed-point iteration, which may be `accelerated`: a tenth of the sweeps for the same residual once it is settled
/// which contacts push and which of them stick. What a sweep leaves open stays so. Where there is no solution, as between bodies that close on a
/// strand, that leads astray; then the best look's impulses are gone back to, and sweeps go on as they are.
pub(super) fn sweep(
    system: &mut impl System,
    tolerance: FrictionTolerance,
    mut accelerated: bool,
    scratch: &mut FrictionScratch,
) -> FrictionOutcome {
    let FrictionScratch { locals, live, is_live, seen, before, after, anderson, best } = scratch;
    let mut least = f64::INFINITY;
    locals.clear();
    locals.extend((0..system.contacts()).map(|i| Local::new(&system.block(i))));
    live.clear();
    live.extend(0..locals.len() as u32);
    let mut sweeps = 0;
    loop {
        system.look(seen);
        let mut residual = Residual::default();
        let held = live.len();
        if sweeps <= LOOK {
            live.clear();
            is_live.clear();
            is_live.resize(locals.len(), false);
        }
        for (i, (local, u)) in locals.iter().zip(&*seen).enumerate() {
            let (r, law) = (system.impulse(i), system.law(i));
            residual.add(local.w.trace(), *u, &r, &system.free(i), law);
            let counts = u.x < 0.0 || r != Vector3::zeros() || law == Law::Bilateral;
            if counts && !is_live[i] {
                is_live[i] = true;
                live.push(i as u32);
            }
        }
        if sweeps <= LOOK || live.len() > held {
            system.narrow(live);
            anderson.clear();
        }
        let (free, residual) = (residual.free, residual.relative());
        if accelerated && residual < least {
            least = residual;
            best.clear();
            best.extend((0..locals.len()).map(|i| system.impulse(i)));
        }
        let ends = sweeps >= tolerance.sweeps;
        if accelerated && (residual > ASTRAY * least || ends && residual > least) {
            best.iter().enumerate().for_each(|(i, r)| system.set(i, *r));
            accelerated = false;
            continue;
        }
        if residual <= tolerance.residual || ends {
            return FrictionOutcome { sweeps, residual };
        }
        let last = sweeps + LOOK.min(tolerance.sweeps - sweeps);
        loop {
            if accelerated {
                gather(system, locals, live, before);
            }
            let (mut moved, mut impulse) = (0.0, 0.0);
            for &i in &*live {
                let (i, local) = (i as usize, &mut locals[i as usize]);
                let (u, old, law) = (system.velocity(i), system.impulse(i), system.law(i));
                if u.x < 0.0 || old != Vector3::zeros() || law == Law::Bilateral {
                    let before = local.w * old;
                    let new = local.solve(&(u - before), law);
                    moved += (local.w * new - before).norm_squared();
                    impulse += (new * (local.w.trace() / 3.0)).norm_squared();
                    system.set(i, new);
                }
            }
            let settled = moved <= tolerance.residual.powi(2) * impulse.max(free);
            sweeps += 1;
            // What is looked at is what a sweep has left: impulses that are accelerated may stray from their cones.
            if sweeps == last || settled {
                break;
            }
            if !accelerated {
                continue;
            }
            gather(system, locals, live, after);
            anderson.accelerate(before, after);
            for (&i, x) in live.iter().zip(after.chunks_exact(3)) {
                let (i, scale) = (i as usize, locals[i as usize].w.trace().sqrt());
                if scale > 0.0 && (system.impulse(i) != Vector3::zeros() || system.law(i) == Law::Bilateral) {
                    system.set(i, Vector3::from_column_slice(x) / scale);
                }
            }
        }
    }
}

/// Impulses of the contacts `live`, times the roots of their mobilities: what is added up of all contacts must be of one kind.
fn gather(system: &impl System, locals: &[Local], live: &[u32], x: &mut Vec<f64>) {
    x.clear();
    for &i in live {
        let r = system.impulse(i as usize) * locals[i as usize].w.trace().sqrt();
        x.extend_from_slice(r.as_slice());
    }
}
