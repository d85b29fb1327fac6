//! Guides that move with others, and the forces on all hair that moves as one.

use nalgebra::Vector3;

/// A guide that moves with another.
pub(super) struct Follower {
    guide: usize,
    leader: usize,
    /// For each piece, the leader's piece before it at the same share of the length, and how far (0..=1) it
    /// is towards the next.
    places: Vec<(usize, f64)>,
}

impl Follower {
    /// Of the pair (guide, leader), whose pieces have their middles at these shares of the lengths.
    pub fn new([guide, leader]: [usize; 2], own: &[f64], of_leader: &[f64]) -> Self {
        let place = |s: &f64| {
            let k = of_leader.partition_point(|o| o <= s).clamp(1, (of_leader.len() - 1).max(1)) - 1;
            let next = of_leader.get(k + 1).unwrap_or(&f64::INFINITY);
            (k, ((s - of_leader[k]) / (next - of_leader[k])).clamp(0.0, 1.0))
        };
        Follower { guide, leader, places: own.iter().map(place).collect() }
    }

    /// The guide that follows.
    pub fn guide(&self) -> usize {
        self.guide
    }

    /// The index of each of its pieces, and where on its leader this is; `first` holds the index of the first
    /// piece of each guide, then the number of pieces.
    pub fn pieces(&self, first: &[usize]) -> impl Iterator<Item = (usize, Between)> {
        let (own, leader) = (first[self.guide], first[self.leader]..first[self.leader + 1]);
        self.places.iter().enumerate().map(move |(k, (before, share))| {
            let before = leader.start + before;
            (own + k, Between { before, next: (before + 1).min(leader.end - 1), share: *share })
        })
    }
}

/// A place between two pieces of a guide.
pub(super) struct Between {
    before: usize,
    next: usize,
    /// How far (0..=1) it is towards the next.
    share: f64,
}

impl Between {
    /// The mean there of what the pieces have.
    pub fn mean(&self, of: impl Fn(usize) -> Vector3<f64>) -> Vector3<f64> {
        of(self.before).lerp(&of(self.next), self.share)
    }

    /// The pieces, with the share of each.
    pub fn shares(&self) -> [(usize, f64); 2] {
        [(self.before, 1.0 - self.share), (self.next, self.share)]
    }
}

/// What acts on the hair that moves with a piece beyond what acts on the piece, less what it bears in its own
/// shape: sums by volume.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct WispForce {
    /// m³
    volume: f64,
    /// Force per length of the pressure, times the volume, N·m².
    pressure: Vector3<f64>,
    /// Acceleration by the drag of neighbours, times the volume, m⁴/s².
    load: Vector3<f64>,
}

impl WispForce {
    /// Of the hair of the leader alone, of this volume, m³.
    pub fn of_leader(volume: f64) -> Self {
        WispForce { volume, ..WispForce::default() }
    }

    /// Adds hair of this `volume`, m³.
    pub fn add(&mut self, volume: f64, pressure: &Vector3<f64>, load: &Vector3<f64>) {
        self.volume += volume;
        self.pressure += pressure * volume;
        self.load += load * volume;
    }

    /// Mean force per length, N/m, and acceleration, m/s².
    pub fn means(&self) -> [Vector3<f64>; 2] {
        [self.pressure, self.load].map(|sum| sum / self.volume)
    }
}
