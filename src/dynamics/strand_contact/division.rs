//! Guides that take a part of a sub-step again while others move as given (`docs/theory.md` §5.2).

use super::checkpoint::StrandContactsState;
use super::given_motion::GivenMotion;
use super::island::DisjointSets;
use super::strand_contacts::StrandContacts;
use crate::dynamics::guide::GuideState;

/// Guides that touch each other, or nearly do.
pub(in crate::dynamics) struct Links {
    sets: DisjointSets,
    /// Those within reach of a contact.
    near: Vec<[usize; 2]>,
}

impl Links {
    /// `guides` with all that touch them, over any number of others, what is near these, and all that touch that;
    /// ascending. What is near is likely to be touched if they take other steps, and would join them late.
    pub fn group(&mut self, guides: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let touching = self.connected(guides);
        let is_inside = |g: &usize| touching.binary_search(g).is_ok();
        let near = self.near.iter().filter(|pair| pair.iter().any(is_inside)).flatten().copied();
        let all: Vec<usize> = touching.iter().copied().chain(near).collect();
        self.connected(all)
    }

    /// `guides` and all that touch them, over any number of others, ascending.
    fn connected(&mut self, guides: impl IntoIterator<Item = usize>) -> Vec<usize> {
        let mut chosen = vec![false; self.sets.len()];
        guides.into_iter().for_each(|g| chosen[self.sets.least_of(g)] = true);
        (0..chosen.len()).filter(|&g| chosen[self.sets.least_of(g)]).collect()
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
    pub fn motion(&self, states: &[GuideState], span: [f64; 2]) -> Vec<(usize, GivenMotion)> {
        // Ends have become starts.
        let of = |g: usize| {
            let points = self.pairs.points_of(g);
            let x = [1, 0].map(|i| self.pairs.x[i][points.clone()].to_vec());
            (g, GivenMotion { span, x, q: [1, 0].map(|i| states[g].q[i].clone()) })
        };
        self.free().map(of).collect()
    }

    /// The guides with a given motion and their [unknowns](GivenMotion::unknowns) at time `t`, s.
    pub fn given_unknowns(&self, t: f64) -> impl Iterator<Item = (usize, Vec<f64>)> {
        let all = self.given.iter().enumerate();
        all.filter_map(move |(g, given)| Some((g, given.as_ref()?.unknowns(t))))
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
                x[points.clone()].iter_mut().zip(given.points(t)).for_each(|(x, given)| *x = given);
            }
        }
    }

    /// The free guides that acted on each other, or crossed, in the sub-step just taken, and those that came near.
    pub fn links(&self) -> Links {
        let are_free = |pair: &[usize; 2]| pair.iter().all(|&g| self.given[g].is_none());
        let mut sets = DisjointSets::new(self.given.len());
        self.touching().filter(are_free).for_each(|[a, b]| sets.unite(a, b));
        let near = self.pairs.contacts.iter().map(|pair| self.pairs.guides(&pair.contact));
        Links { sets, near: near.filter(are_free).collect() }
    }

    /// The guides with a given motion that free ones for which `of` holds pushed or crossed in the part just taken,
    /// ascending; last resorts may have hidden that they crossed.
    pub fn touched_given(&self, of: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut touched: Vec<usize> =
            self.touched.iter().filter(|[free, _]| of(*free)).map(|[_, given]| *given).collect();
        touched.sort_unstable();
        touched.dedup();
        touched
    }

    /// Pairs of a free guide and one with a given motion that act on each other, or cross.
    pub(super) fn touching_given(&self) -> Vec<[usize; 2]> {
        let in_order = |[a, b]: [usize; 2]| match (&self.given[a], &self.given[b]) {
            (None, Some(_)) => Some([a, b]),
            (Some(_), None) => Some([b, a]),
            _ => None,
        };
        self.touching().filter_map(in_order).collect()
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
