//! The Delassus operator of some contacts, as sparse blocks.

use super::coupled_problem::CoupledFrictionProblem;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// The part of W of some contacts: for each, its non-zero blocks with their columns, ascending.
#[derive(Default)]
pub(super) struct SparseDelassus {
    contacts: Vec<u32>,
    /// Line of each contact of the problem, or [`SparseDelassus::NONE`].
    line: Vec<u32>,
    /// Start of each line, and the end of the last.
    start: Vec<usize>,
    blocks: Vec<(u32, Matrix3<f64>)>,
}

impl SparseDelassus {
    const NONE: u32 = u32::MAX;

    /// The operator of `contacts`; blocks that `known` has are copied from it.
    pub fn new(problem: &CoupledFrictionProblem, contacts: &[u32], known: &SparseDelassus) -> Self {
        let strands =
            |i: u32| problem.strands[i as usize].iter().flatten().map(|strand| strand.first_unknown);
        let mut incidences: Vec<(usize, u32)> =
            contacts.iter().flat_map(|&i| strands(i).map(move |strand| (strand, i))).collect();
        incidences.sort_unstable();
        let of_strand = |strand: usize| {
            let from = incidences.partition_point(|incidence| incidence.0 < strand);
            incidences[from..].iter().take_while(move |incidence| incidence.0 == strand).map(|i| i.1)
        };
        let line = |&i: &u32| {
            let mut columns: Vec<u32> = strands(i).flat_map(of_strand).collect();
            columns.sort_unstable();
            columns.dedup();
            let of = |j: u32| known.block(i, j).unwrap_or_else(|| problem.block(i as usize, j as usize));
            columns.into_iter().map(|j| (j, of(j))).collect::<Vec<_>>()
        };
        let lines: Vec<_> = contacts.par_iter().map(line).collect();
        let mut delassus = SparseDelassus { contacts: contacts.to_vec(), ..SparseDelassus::default() };
        delassus.line.resize(problem.friction.len(), Self::NONE);
        delassus.start.push(0);
        for (k, (&i, line)) in contacts.iter().zip(lines).enumerate() {
            delassus.line[i as usize] = k as u32;
            delassus.blocks.extend(line);
            delassus.start.push(delassus.blocks.len());
        }
        delassus
    }

    /// The contacts it was built for.
    pub fn contacts(&self) -> &[u32] {
        &self.contacts
    }

    /// Blocks of a contact with their columns; empty for contacts it was not built for.
    pub fn line(&self, i: u32) -> &[(u32, Matrix3<f64>)] {
        let Some(&line) = self.line.get(i as usize).filter(|line| **line != Self::NONE) else { return &[] };
        &self.blocks[self.start[line as usize]..self.start[line as usize + 1]]
    }

    fn block(&self, i: u32, j: u32) -> Option<Matrix3<f64>> {
        let line = self.line(i);
        Some(line[line.binary_search_by_key(&j, |(j, _)| *j).ok()?].1)
    }
}
