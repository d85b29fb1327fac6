//! Guides stepped together: their free motions are solved for in the lanes of one pack, contact guide by guide.

use super::environment::Environment;
use super::guide::{Guide, Solved, Workspace};
use super::step_record::StepRecord;
use crate::math::lanes::MAX_LANES;
use crate::rod::Rod;
use crate::rod::newton::NewtonOutcome;
use crate::rod::pack::{Pack, PackBuffers, StepTask};
use std::sync::{Mutex, PoisonError};

/// All guides of a list, in companies.
#[derive(Default)]
pub struct Batches {
    batches: Vec<Batch>,
    /// One for each thread, made once.
    works: Vec<Mutex<BatchScratch>>,
}

/// Guides that follow each other in a list, those of which that move by themselves are stepped together.
struct Batch {
    pack: Pack,
    /// Which of them are.
    free: Vec<bool>,
}

impl Batch {
    /// Of an entry for each guide those of guides that are stepped.
    fn of<'a, T>(&'a self, entries: impl IntoIterator<Item = T> + 'a) -> impl Iterator<Item = T> + 'a {
        entries.into_iter().zip(&self.free).filter(|(_, free)| **free).map(|(entry, _)| entry)
    }
}

/// Workspace of the steps of one thread.
#[derive(Default)]
struct BatchScratch {
    guides: Vec<Workspace>,
    solved: Vec<Solved>,
    pack: PackBuffers,
}

impl Batches {
    /// Divides guides into companies, in order; those that are not `free` are not stepped.
    pub fn rebuild(guides: &[Guide], free: impl Fn(usize) -> bool) -> Self {
        let free: Vec<bool> = (0..guides.len()).map(free).collect();
        let mut batches = Vec::new();
        let (mut start, mut rods) = (0, Vec::new());
        let mut close = |rods: &mut Vec<&Rod>, range: std::ops::Range<usize>| {
            if !rods.is_empty() {
                batches.push(Batch { pack: Pack::new(rods), free: free[range].to_vec() });
                rods.clear();
            }
        };
        for (i, guide) in guides.iter().enumerate().filter(|(i, _)| free[*i]) {
            let unlike = rods.first().is_some_and(|first: &&Rod| first.unknowns() != guide.rod.unknowns());
            if unlike || rods.len() == Pack::width() {
                close(&mut rods, start..i);
                start = i;
            }
            rods.push(&guide.rod);
        }
        close(&mut rods, start..guides.len());
        let works = (0..rayon::current_num_threads()).map(|_| Mutex::default()).collect();
        Batches { batches, works }
    }

    /// Does for every guide of the list that is stepped what [`Guide::advance`] does, bit for bit, on all threads; `span` is the sub-step's start and
    /// end, s, and `records` has an entry for each guide.
    pub fn advance(
        &self,
        guides: &mut [Guide],
        env: &Environment,
        span: [f64; 2],
        records: &mut [StepRecord],
    ) {
        self.split(&self.batches, guides, env, span, records);
    }

    /// In halves as threads are free to take them, without a list of the parts.
    fn split(
        &self,
        batches: &[Batch],
        guides: &mut [Guide],
        env: &Environment,
        span: [f64; 2],
        records: &mut [StepRecord],
    ) {
        match batches {
            [] => {}
            [batch] => {
                // No other thread of a pool has this one's number.
                let work = &self.works[rayon::current_thread_index().unwrap_or(0) % self.works.len()];
                let mut work = work.lock().unwrap_or_else(PoisonError::into_inner);
                batch.advance(guides, env, span, &mut work, records);
            }
            _ => {
                let (first, second) = batches.split_at(batches.len() / 2);
                let len = first.iter().map(|c| c.free.len()).sum();
                let (guides, their_guides) = guides.split_at_mut(len);
                let (records, their_records) = records.split_at_mut(len);
                rayon::join(
                    || self.split(first, guides, env, span, records),
                    || self.split(second, their_guides, env, span, their_records),
                );
            }
        }
    }
}

impl Batch {
    /// Does for the guides of the company that are stepped what [`Guide::advance`] does for each, bit for bit; `span` is the sub-step's start and end,
    /// s, and `records` has an entry for each guide.
    fn advance(
        &self,
        guides: &mut [Guide],
        env: &Environment,
        span: [f64; 2],
        work: &mut BatchScratch,
        records: &mut [StepRecord],
    ) {
        let BatchScratch { guides: works, solved, pack } = work;
        works.resize_with(works.len().max(Pack::width()), Workspace::default);
        solved.clear();
        for (guide, work) in self.of(guides.iter()).zip(&mut *works) {
            let formula = guide.formula(span[1] - span[0]);
            let root = guide.prepare(env, span, &formula, work);
            solved.push(Solved { root, outcome: NewtonOutcome::default() });
        }
        {
            let mut tasks =
                self.of(guides.iter()).zip(&mut *works).zip(&mut *solved).map(|((guide, work), solved)| {
                    StepTask {
                        root: &solved.root.r,
                        load: &work.load,
                        q: &mut work.q,
                        other: &guide.q[0],
                        shape: &mut work.solver.shape,
                        outcome: &mut solved.outcome,
                    }
                });
            let mut tasks: [_; MAX_LANES] = std::array::from_fn(|_| tasks.next());
            self.pack.minimise(&mut tasks, pack);
        }
        let free = self.of(guides.iter_mut().zip(records));
        for (((guide, record), work), solved) in free.zip(works).zip(solved) {
            *record = guide.complete(env, span, Some(*solved), work);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Bodies;
    use crate::geometry::Shape;
    use crate::rod::{RodSource, SegmentSize, Taper};
    use crate::scene::Tree;
    use crate::scene::anim::Scheme;
    use nalgebra::{Isometry3, Vector3};

    /// A hair beside others of its kind; every fourth has fewer nodes.
    fn hair(i: usize) -> Rod {
        let root = Vector3::x() * (0.01 * i as f64);
        Rod::new(&RodSource {
            points: &[root, root + Vector3::new(0.02, 0.01, 0.1 + 0.03 * (i % 3) as f64)],
            root_frame: None,
            arc: &Tree::default_arc(if i % 4 == 3 { 5 } else { 7 }),
            stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
            line_density: 6.6e-6,
            damping: 0.005,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize::FINE,
        })
        .unwrap()
    }

    #[test]
    fn company_changes_no_bit() {
        // A head that jerks above a ball: some strands are thrown about, some come to lie on it.
        let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: Vector3::zeros(), radius: 0.04 }]);
        let head = |t: f64| Isometry3::translation(0.0, 0.05 + 0.03 * (40.0 * t).sin(), -0.06);
        let env = Environment {
            head: &head,
            gravity: &|_| Vector3::y() * -9.81,
            wind: &[],
            bodies: &bodies,
            body: &|_, _| Isometry3::identity(),
            carrier: &|_, _| Isometry3::identity(),
            brought_out: &|_| 1.0,
        };
        let h = 1.0 / 96.0;
        for scheme in [Scheme::BackwardEuler, Scheme::Bdf2] {
            let guide = |i| {
                let rod = hair(i);
                let drag = vec![2e-5; rod.points()];
                let mut guide = Guide::new(rod, drag, 0.3, &[5e-4], &env, 0.0, h);
                guide.scheme = scheme;
                guide
            };
            let mut alone: Vec<Guide> = (0..7).map(guide).collect();
            let mut coupled = alone.clone();
            let batches = Batches::rebuild(&coupled, |_| true);
            let mut work = Workspace::default();
            let mut touched = 0;
            for step in 0..60 {
                let span = [f64::from(step) * h, f64::from(step + 1) * h];
                let one: Vec<StepRecord> =
                    alone.iter_mut().map(|g| g.advance(&env, span[0], span[1], &mut work)).collect();
                let mut all = vec![StepRecord::default(); coupled.len()];
                batches.advance(&mut coupled, &env, span, &mut all);
                assert_eq!(one, all);
                assert!(alone.iter().zip(&coupled).all(|(a, b)| a.x == b.x && a.v == b.v && a.q == b.q));
                touched += all.iter().filter(|r| r.active > 0).count();
            }
            assert!(touched > 0);
        }
    }
}
