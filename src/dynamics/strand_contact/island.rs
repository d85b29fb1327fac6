//! Islands: sets of guides connected by contacts.

/// Guides that are solved together: no contact connects them to another island.
#[derive(Debug, Default)]
pub(super) struct Island {
    /// The guides, ascending.
    pub guides: Vec<usize>,
    /// Their contacts, ascending.
    pub contacts: Vec<usize>,
}

impl Island {
    /// The sets that contain one of `wanted`, in ascending order of their least guides, and the island of
    /// each of `count` guides.
    pub fn from_sets(
        mut sets: DisjointSets,
        count: usize,
        wanted: impl Iterator<Item = usize>,
    ) -> (Vec<Island>, Vec<Option<usize>>) {
        let mut chosen = vec![false; count];
        wanted.for_each(|g| chosen[sets.least_of(g)] = true);
        let mut islands: Vec<Island> = Vec::new();
        let mut island_of = vec![None; count];
        for g in 0..count {
            let least = sets.least_of(g);
            if !chosen[least] {
                continue;
            }
            if least == g {
                island_of[g] = Some(islands.len());
                islands.push(Island::default());
            } else {
                island_of[g] = island_of[least];
            }
            if let Some(island) = island_of[g] {
                islands[island].guides.push(g);
            }
        }
        (islands, island_of)
    }
}

/// Disjoint sets of the integers from 0, each represented by its least (union-find).
pub(super) struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// `count` sets of one.
    pub fn new(count: usize) -> Self {
        DisjointSets((0..count as u32).collect())
    }

    /// Number of the integers.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The least element of the set that contains `i`.
    pub fn least_of(&mut self, i: usize) -> usize {
        let mut i = i as u32;
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i as usize
    }

    /// Unites the sets of `a` and `b`.
    pub fn unite(&mut self, a: usize, b: usize) {
        let (a, b) = (self.least_of(a), self.least_of(b));
        self.0[a.max(b)] = a.min(b) as u32;
    }
}
