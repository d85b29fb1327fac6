//! Guides that move as given while others take a part of their sub-step again (`docs/theory.md` §5.2).

use super::checkpoint::StrandContactsState;
use super::island::DisjointSets;
use super::strand_contacts::StrandContacts;
use nalgebra::Vector3;

/// The motion of a guide over a part of a sub-step that it has taken.
#[derive(Debug, Clone)]
pub(in crate::dynamics) struct GivenMotion {
    /// Start and end of the part, s.
    span: [f64; 2],
    /// Its points at both, m, in the frame of the head.
    x: [Vec<Vector3<f64>>; 2],
}

impl GivenMotion {
    /// Its points at time `t`, s: they move evenly.
    pub fn at(&self, t: f64) -> impl Iterator<Item = Vector3<f64>> {
        let [start, end] = &self.x;
        let share = (t - self.span[0]) / (self.span[1] - self.span[0]);
        start.iter().zip(end).map(move |(a, b)| a.lerp(b, share))
    }
}

/// Guides that touch each other.
pub(in crate::dynamics) struct Links {
    guides: usize,
    pairs: Vec<[usize; 2]>,
}

impl Links {
    /// `guides` and all that are linked to them, over any number of others, ascending.
    pub fn connected(&self, guides: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let mut sets = DisjointSets::new(self.guides);
        self.pairs.iter().for_each(|&[a, b]| sets.unite(a, b));
        let mut chosen = vec![false; self.guides];
        guides.into_iter().for_each(|g| chosen[sets.least_of(g)] = true);
        (0..self.guides).filter(|&g| chosen[sets.least_of(g)]).collect()
    }
}

impl StrandContacts {
    /// The active guides whose motion is not given, ascending.
    pub fn free(&self) -> impl Iterator<Item = usize> {
        self.active.iter().copied().filter(|&g| self.given[g].is_none())
    }

    /// True if no motion is given.
    pub fn all_are_free(&self) -> bool {
        self.given.iter().all(Option::is_none)
    }

    /// The motions of the free guides over `span`, s, which they have just taken.
    pub fn motion(&self, span: [f64; 2]) -> Vec<(usize, GivenMotion)> {
        // Ends have become starts.
        let of = |g: usize| {
            let points = self.pairs.points_of(g);
            (g, GivenMotion { span, x: [1, 0].map(|i| self.pairs.x[i][points.clone()].to_vec()) })
        };
        self.free().map(of).collect()
    }

    /// Lets guide `g` move as it does in `motion`, which is in ascending order of guides.
    pub fn give(&mut self, g: usize, motion: &[(usize, GivenMotion)]) {
        let known = motion.binary_search_by_key(&g, |(g, _)| *g);
        self.given[g] = known.ok().map(|i| motion[i].1.clone());
    }

    /// Lets guide `g` move freely again.
    pub fn free_again(&mut self, g: usize) {
        self.given[g] = None;
    }

    /// Sets the points of guides with a given motion at times `t`, s, of the start and end of the sub-step.
    pub(super) fn place_given(&mut self, t: [f64; 2]) {
        for (g, given) in self.given.iter().enumerate() {
            let Some(given) = given else { continue };
            let points = self.pairs.points_of(g);
            for (x, t) in self.pairs.x.iter_mut().zip(t) {
                x[points.clone()].iter_mut().zip(given.at(t)).for_each(|(x, given)| *x = given);
            }
        }
    }

    /// The pairs of free guides that acted on each other, or crossed, in the sub-step just taken.
    pub fn links(&self) -> Links {
        let pairs = self.touching().filter(|pair| pair.iter().all(|&g| self.given[g].is_none())).collect();
        Links { guides: self.given.len(), pairs }
    }

    /// The guides with a given motion that free ones pushed or crossed in the sub-step just taken, ascending.
    pub fn touched_given(&self) -> Vec<usize> {
        let mut touched: Vec<usize> =
            self.touching().flatten().filter(|&g| self.given[g].is_some()).collect();
        touched.sort_unstable();
        touched.dedup();
        touched
    }

    fn touching(&self) -> impl Iterator<Item = [usize; 2]> {
        let acting = self.pairs.contacts.iter().filter(|pair| pair.is_active() || pair.cohesion > 0.0);
        let acting = acting.map(|pair| self.pairs.guides(&pair.contact));
        acting.chain(self.pairs.crossing.iter().map(|&pair| self.pairs.guides_of(pair)))
    }

    /// Takes over from `state` what it knows of contacts between guides that are not of `group`.
    pub fn keep_contacts_of_others(&mut self, state: StrandContactsState, group: &[usize]) {
        let is_other = |g: usize| group.binary_search(&g).is_err();
        for (g, pushed) in state.pushed.into_iter().enumerate().filter(|(g, _)| is_other(*g)) {
            self.pushed[g] = pushed;
        }
        let history = state.history.into_iter();
        self.pairs.history.extend(history.filter(|known| known.guides.iter().all(|&g| is_other(g as usize))));
        self.pairs.sort_history();
    }
}
