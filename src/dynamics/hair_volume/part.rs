//! How guides are cut into pieces.

use crate::dynamics::guide::GuideModel;
use crate::rod::Rod;
use nalgebra::Vector3;
use std::ops::Range;

/// Length of hair over which its direction is taken, m: a turn of most curls, whose pieces point everywhere
/// while the curls lie side by side. Higher is right for wider curls, and hides how locks bend around others.
const TURN: f64 = 0.05;

/// What does not change of a piece of a guide.
pub(super) struct Part {
    pub guide: usize,
    pub points: Range<usize>,
    /// The length that each point stands for, as a share of that of the piece.
    pub shares: Vec<f64>,
    /// m
    pub length: f64,
    /// Mass of one hair, kg.
    pub mass: f64,
    /// Arc length of its middle as a share of the guide's length.
    pub middle: f64,
    /// Cross-section of a hair over that at the root.
    pub section: f64,
    /// The pieces of the guide that a [`TURN`] around this one reaches, as far as there are such.
    turn: Range<usize>,
    /// The share of the turn that lies in each.
    turn_shares: Vec<f64>,
}

impl Part {
    /// The pieces of all guides, each at least `least` long, m, if the guide is; and the index of the first of
    /// each guide, then the number of pieces.
    pub fn of_guides(models: &[GuideModel], least: f64) -> (Vec<Part>, Vec<usize>) {
        let (mut parts, mut first) = (Vec::new(), vec![0]);
        for (guide, model) in models.iter().enumerate() {
            let pieces = points_of_pieces(&model.rod.weight, least);
            parts.extend(pieces.into_iter().map(|points| Part::new(guide, &model.rod, points)));
            set_turns(&mut parts, first[guide]);
            first.push(parts.len());
        }
        (parts, first)
    }

    /// The piece of a guide with these points of its `rod`, without its turn.
    fn new(guide: usize, rod: &Rod, points: Range<usize>) -> Self {
        let weight = &rod.weight[points.clone()];
        let length: f64 = weight.iter().sum();
        let shares = weight.iter().map(|w| w / length).collect();
        let mass: f64 = rod.mass[points.clone()].iter().sum();
        let middle = 0.5 * (rod.arc[points.start] + rod.arc[points.end - 1]) / rod.length();
        let section = mass / length * rod.weight[0] / rod.mass[0];
        Part { guide, points, shares, length, mass, middle, section, turn: 0..0, turn_shares: Vec::new() }
    }

    /// Adds a force per length, N/m, and an acceleration, m/s², of the piece to the `forces`, N, on the points of its
    /// `rod`.
    pub fn push(&self, rod: &Rod, [force, acceleration]: &[Vector3<f64>; 2], forces: &mut [Vector3<f64>]) {
        for k in self.points.clone() {
            forces[k] += force * rod.weight[k] + acceleration * rod.mass[k];
        }
    }

    /// The mean over a [`TURN`] around the piece of what the pieces have.
    pub fn mean_over_turn(&self, of: impl Fn(usize) -> Vector3<f64>) -> Vector3<f64> {
        self.turn.clone().zip(&self.turn_shares).map(|(piece, share)| of(piece) * *share).sum()
    }
}

/// The points of the pieces of a guide whose points stand for the lengths `weight`, m: each piece is at least
/// `least` long, m, if the guide is.
fn points_of_pieces(weight: &[f64], least: f64) -> Vec<Range<usize>> {
    let mut pieces = Vec::new();
    let (mut start, mut length, mut left) = (0, 0.0, weight.iter().sum::<f64>());
    for (k, w) in weight.iter().enumerate() {
        length += w;
        left -= w;
        if length >= least && left >= least || k + 1 == weight.len() {
            pieces.push(start..k + 1);
            (start, length) = (k + 1, 0.0);
        }
    }
    pieces
}

/// Sets the turns of the pieces of a guide, which are those from `first` on.
fn set_turns(parts: &mut [Part], first: usize) {
    let mut ends = vec![0.0];
    ends.extend(parts[first..].iter().scan(0.0, |end, part| {
        *end += part.length;
        Some(*end)
    }));
    let (pieces, length) = (ends.len() - 1, ends[ends.len() - 1]);
    for k in 0..pieces {
        let middle = 0.5 * (ends[k] + ends[k + 1]);
        let reach = (0.5 * TURN).max(middle - ends[k]);
        let (start, end) = ((middle - reach).max(0.0), (middle + reach).min(length));
        let share = |i: usize| (ends[i + 1].min(end) - ends[i].max(start)) / (end - start);
        let from = (0..k).find(|i| share(*i) > 0.0).unwrap_or(k);
        let to = (k + 1..pieces).find(|i| share(*i) <= 0.0).unwrap_or(pieces);
        parts[first + k].turn_shares = (from..to).map(share).collect();
        parts[first + k].turn = first + from..first + to;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_have_all_points_and_a_least_length() {
        let weights = [0.002, 0.004, 0.004, 0.001, 0.008, 0.002];
        assert_eq!(points_of_pieces(&weights, 0.006), [0..2, 2..6]);
        assert_eq!(points_of_pieces(&weights, 0.004), [0..2, 2..3, 3..6]);
        assert_eq!(points_of_pieces(&weights, 1.0).len(), 1);
    }

    /// Pieces of these lengths, m, of one guide.
    fn pieces(lengths: &[f64]) -> Vec<Part> {
        let part = |length: &f64| Part {
            guide: 0,
            points: 0..1,
            shares: vec![1.0],
            length: *length,
            mass: 1.0,
            middle: 0.5,
            section: 1.0,
            turn: 0..0,
            turn_shares: Vec::new(),
        };
        let mut parts: Vec<Part> = lengths.iter().map(part).collect();
        set_turns(&mut parts, 0);
        parts
    }

    #[test]
    fn a_turn_of_a_helix_has_the_direction_of_its_axis() {
        // 0.6 of the length of the helix is along its axis, z; its turns are a `TURN` long.
        let lengths = [0.006, 0.008, 0.007, 0.005].repeat(6);
        let parts = pieces(&lengths);
        let middle = |i: usize| lengths[..i].iter().sum::<f64>() + 0.5 * lengths[i];
        let tangent = |i: usize| {
            let angle = std::f64::consts::TAU * middle(i) / TURN;
            Vector3::new(0.8 * angle.cos(), 0.8 * angle.sin(), 0.6)
        };
        for (k, part) in parts.iter().enumerate() {
            let [shares, mean] =
                [Vector3::x(), part.mean_over_turn(tangent)].map(|v| part.mean_over_turn(|_| v));
            assert!((shares.x - 1.0).abs() < 1e-12, "{k}");
            let whole = middle(k) > 0.5 * TURN && middle(k) < lengths.iter().sum::<f64>() - 0.5 * TURN;
            assert!(!whole || (mean - Vector3::z() * 0.6).norm() < 0.03, "{k}: {mean}");
        }
    }

    #[test]
    fn a_guide_shorter_than_half_a_turn_has_the_direction_of_its_chord() {
        let parts = pieces(&[0.005, 0.003, 0.004]);
        let tangent = |i: usize| [Vector3::x(), Vector3::y(), Vector3::z()][i];
        let chord = Vector3::new(5.0, 3.0, 4.0) / 12.0;
        assert!(parts.iter().all(|part| (part.mean_over_turn(tangent) - chord).norm() < 1e-12));
    }
}
