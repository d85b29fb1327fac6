//! Guides with equal numbers of unknowns, stepped together: their free motions, those without contact, are
//! solved in the SIMD lanes of one [`Pack`]; contact is resolved guide by guide.
//! [`super::simulation::step`] steps all active guides this way.

use super::environment::Environment;
use super::guide::{ContactMode, FreeSolve, GuideModel, GuideScratch, GuideState};
use super::step_record::StepRecord;
use crate::math::lanes::MAX_LANES;
use crate::rod::Rod;
use crate::rod::newton::NewtonOutcome;
use crate::rod::pack::{Pack, PackBuffers, StepTask};
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// The active guides of a list, in batches.
#[derive(Default)]
pub struct Batches {
    batches: Vec<Batch>,
    /// One for each thread of the pool.
    scratch: Vec<Mutex<BatchScratch>>,
}

/// Consecutive guides of a list. The active ones among them, at most as many as a pack has lanes, have equal
/// numbers of unknowns.
struct Batch {
    pack: Pack,
    /// For each guide of the batch, whether it is active.
    active: Vec<bool>,
}

/// The arguments of a step of all guides.
struct Step<'a> {
    models: &'a [GuideModel],
    env: &'a Environment<'a>,
    span: [f64; 2],
    mode: ContactMode,
}

/// Buffers of one thread.
#[derive(Default)]
struct BatchScratch {
    guides: Vec<GuideScratch>,
    solved: Vec<FreeSolve>,
    pack: PackBuffers,
}

impl Batches {
    /// Divides guides into batches, in order; only guides `i` for which `active(i)` holds are stepped. To be
    /// rebuilt when that changes.
    pub fn new(models: &[GuideModel], active: impl Fn(usize) -> bool) -> Self {
        let active: Vec<bool> = (0..models.len()).map(active).collect();
        let mut batches = Vec::new();
        let (mut start, mut rods) = (0, Vec::new());
        let mut close = |rods: &mut Vec<&Rod>, range: Range<usize>| {
            if !rods.is_empty() {
                batches.push(Batch { pack: Pack::new(rods), active: active[range].to_vec() });
                rods.clear();
            }
        };
        for (i, model) in models.iter().enumerate().filter(|(i, _)| active[*i]) {
            let unlike = rods.first().is_some_and(|first: &&Rod| !first.is_like(&model.rod));
            if unlike || rods.len() == Pack::width() {
                close(&mut rods, start..i);
                start = i;
            }
            rods.push(&model.rod);
        }
        close(&mut rods, start..models.len());
        let scratch = (0..rayon::current_num_threads()).map(|_| Mutex::default()).collect();
        Batches { batches, scratch }
    }

    /// Does for every active guide what [`GuideModel::step`] does, bit for bit, on all threads. `span` is the
    /// start and end of the sub-step, s; `states` and `records` have an entry for each guide. Once a coupled
    /// sub-step is to be abandoned, the guides that are left stay where they are.
    pub fn step(
        &self,
        models: &[GuideModel],
        env: &Environment,
        states: &mut [GuideState],
        span: [f64; 2],
        mode: ContactMode,
        records: &mut [StepRecord],
    ) {
        self.split(&self.batches, &Step { models, env, span, mode }, states, records);
    }

    /// Steps `batches` on all threads: halves the list until one batch is left, which allocates nothing.
    fn split(&self, batches: &[Batch], step: &Step, states: &mut [GuideState], records: &mut [StepRecord]) {
        match batches {
            [] => {}
            // Whoever takes a coupled sub-step restores all guides.
            _ if step.mode == ContactMode::Coupled && step.env.interrupt.is_asked_for() => {}
            [batch] => {
                // No other thread of a pool has this one's index, so the lock is free.
                let scratch = &self.scratch[rayon::current_thread_index().unwrap_or(0) % self.scratch.len()];
                let mut scratch = scratch.lock().unwrap_or_else(PoisonError::into_inner);
                batch.step(step, states, records, &mut scratch);
            }
            _ => {
                let (first, second) = batches.split_at(batches.len() / 2);
                let len = first.iter().map(|b| b.active.len()).sum();
                let (models, second_models) = step.models.split_at(len);
                let (states, second_states) = states.split_at_mut(len);
                let (records, second_records) = records.split_at_mut(len);
                rayon::join(
                    || self.split(first, &Step { models, ..*step }, states, records),
                    || {
                        self.split(
                            second,
                            &Step { models: second_models, ..*step },
                            second_states,
                            second_records,
                        )
                    },
                );
            }
        }
    }
}

impl Batch {
    /// Filters entries of all guides of the batch to the active ones.
    fn active<'a, T>(&'a self, entries: impl IntoIterator<Item = T> + 'a) -> impl Iterator<Item = T> + 'a {
        entries.into_iter().zip(&self.active).filter(|(_, active)| **active).map(|(entry, _)| entry)
    }

    /// Steps the active guides: loads of all, free motions of all at once, then contact of each.
    fn step(
        &self,
        Step { models, env, span, mode }: &Step,
        states: &mut [GuideState],
        records: &mut [StepRecord],
        scratch: &mut BatchScratch,
    ) {
        let BatchScratch { guides: buffers, solved, pack } = scratch;
        buffers.resize_with(buffers.len().max(Pack::width()), GuideScratch::default);
        solved.clear();
        for ((model, state), buffer) in self.active(models.iter().zip(states.iter())).zip(&mut *buffers) {
            let formula = model.difference_formula(state, span[1] - span[0]);
            let root = model.prepare(env, state, *span, &formula, buffer);
            // A guide whose step is solved once more, or halved, is solved on its own.
            buffer.solver.reserve(&model.rod, &buffer.load);
            solved.push(FreeSolve { root, outcome: NewtonOutcome::default() });
        }
        {
            let active = self.active(states.iter()).zip(&mut *buffers).zip(&mut *solved);
            let mut tasks = active.map(|((state, buffer), solved)| StepTask {
                root: &solved.root.r,
                load: &buffer.load,
                q: &mut buffer.q,
                other_start: &state.q[0],
                shape: &mut buffer.solver.shape,
                outcome: &mut solved.outcome,
            });
            let mut tasks: [_; MAX_LANES] = std::array::from_fn(|_| tasks.next());
            self.pack.minimise(&mut tasks, pack);
        }
        let active = self.active(models.iter().zip(states.iter_mut()).zip(records));
        for ((((model, state), record), buffer), solved) in active.zip(buffers).zip(solved) {
            *record = model.step_from(Some(*solved), env, state, *span, *mode, buffer);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::geometry::Shape;
    use crate::rod::RodSource;
    use crate::scene::Tree;
    use crate::scene::anim::Scheme;
    use nalgebra::{Isometry3, Vector3};

    /// A hair beside others of its kind; every fourth has fewer nodes.
    fn hair(i: usize) -> Rod {
        let root = Vector3::x() * (0.01 * i as f64);
        Rod::new(&RodSource {
            damping: 0.005,
            ..RodSource::hair(
                &[root, root + Vector3::new(0.02, 0.01, 0.1 + 0.03 * (i % 3) as f64)],
                &Tree::default_arc(if i % 4 == 3 { 5 } else { 7 }),
            )
        })
        .unwrap()
    }

    #[test]
    fn batching_changes_no_bit() {
        // A head that jerks above a ball: some strands are thrown about, some come to lie on it.
        let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: Vector3::zeros(), radius: 0.04 }]);
        let head = |t: f64| Isometry3::translation(0.0, 0.05 + 0.03 * (40.0 * t).sin(), -0.06);
        let env = Environment { head: Box::new(head), ..Environment::at_rest(bodies) };
        let h = 1.0 / 96.0;
        for scheme in [Scheme::BackwardEuler, Scheme::Bdf2, Scheme::FourStep] {
            let model = |i| {
                let rod = hair(i);
                let drag = vec![2e-5; rod.points()];
                GuideModel { scheme, ..GuideModel::new(rod, drag, 0.3) }
            };
            let models: Vec<GuideModel> = (0..7).map(model).collect();
            let state = |model| GuideState::new(model, &[5e-4], &env, 0.0, h);
            let mut single: Vec<GuideState> = models.iter().map(state).collect();
            let mut batched = single.clone();
            let batches = Batches::new(&models, |_| true);
            let mut scratch = GuideScratch::default();
            let mut touched = 0;
            for step in 0..60 {
                let span = [f64::from(step) * h, f64::from(step + 1) * h];
                let mode = ContactMode::Bodies;
                let step = |(model, state): (&GuideModel, &mut GuideState)| {
                    model.step(&env, state, span, mode, &mut scratch)
                };
                let one: Vec<StepRecord> = models.iter().zip(&mut single).map(step).collect();
                let mut all = vec![StepRecord::default(); models.len()];
                batches.step(&models, &env, &mut batched, span, mode, &mut all);
                assert_eq!(one, all);
                assert!(single.iter().zip(&batched).all(|(a, b)| a.x == b.x && a.v == b.v && a.q == b.q));
                touched += all.iter().filter(|r| r.active > 0).count();
            }
            assert!(touched > 0);
        }
    }
}
