//! Guides that move with others, and the forces on all hair that moves as one.

use nalgebra::Vector3;
use std::ops::Range;

/// A place between two pieces of a guide.
#[derive(Debug, Clone, Copy)]
pub(super) struct Between {
    before: usize,
    next: usize,
    /// How far (0..=1) it is towards the next.
    share: f64,
}

impl Between {
    /// The place at the share `s` of the length of a guide whose `pieces` have their middles at the shares `middles`.
    pub fn new(s: f64, middles: &[f64], pieces: Range<usize>) -> Self {
        let k = middles.partition_point(|o| *o <= s).clamp(1, (middles.len() - 1).max(1)) - 1;
        let next = middles.get(k + 1).unwrap_or(&f64::INFINITY);
        let share = ((s - middles[k]) / (next - middles[k])).clamp(0.0, 1.0);
        let before = pieces.start + k;
        Between { before, next: (before + 1).min(pieces.end - 1), share }
    }

    /// The mean there of what the pieces have.
    pub fn mean(&self, of: impl Fn(usize) -> Vector3<f64>) -> Vector3<f64> {
        of(self.before).lerp(&of(self.next), self.share)
    }

    /// The pieces, with the share of each.
    pub fn shares(&self) -> [(usize, f64); 2] {
        [(self.before, 1.0 - self.share), (self.next, self.share)]
    }
}

/// Which pieces of followers move with each piece of a guide that leads.
#[derive(Default)]
pub(super) struct Led {
    /// For each piece, the index of the first in `pieces`, then their number.
    first: Vec<u32>,
    /// Pieces of followers, each with the share of it that moves with the piece.
    pieces: Vec<(u32, f64)>,
}

impl Led {
    /// Of pieces that move with these places between others.
    pub fn new(between: &[Option<Between>]) -> Self {
        let mut shares: Vec<(usize, (u32, f64))> = Vec::new();
        for (own, between) in between.iter().enumerate() {
            let of = |(leader, share)| (leader, (own as u32, share));
            shares.extend(between.iter().flat_map(Between::shares).map(of));
        }
        shares.sort_by_key(|(leader, _)| *leader);
        let first = (0..=between.len()).map(|i| shares.partition_point(|(leader, _)| *leader < i) as u32);
        Led { first: first.collect(), pieces: shares.into_iter().map(|(_, led)| led).collect() }
    }

    /// Of all hair that moves with piece `i`, itself of this `volume`, m³: the mean force per length, N/m, and
    /// acceleration, m/s², beyond what acts on the piece, and the volume, m³. Followers have `beyond`.
    pub fn mean(&self, i: usize, volume: f64, beyond: &[Beyond]) -> ([Vector3<f64>; 2], f64) {
        let (mut whole, mut pressure, mut load) = (volume, Vector3::zeros(), Vector3::zeros());
        for (own, share) in &self.pieces[self.first[i] as usize..self.first[i + 1] as usize] {
            let beyond = &beyond[*own as usize];
            let part = share * beyond.volume;
            whole += part;
            pressure += beyond.pressure * part;
            load += beyond.load * part;
        }
        ([pressure, load].map(|sum| sum / whole), whole)
    }
}

/// What acts on a piece of a follower beyond what acts on its leader, less what it bears in its own shape.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Beyond {
    /// Volume of the hairs, m³.
    pub volume: f64,
    /// Force per length of the pressure, N/m.
    pub pressure: Vector3<f64>,
    /// Acceleration by the drag of neighbours, m/s².
    pub load: Vector3<f64>,
}
