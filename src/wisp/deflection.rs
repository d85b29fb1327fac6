//! Deflections that can be averaged over guides of any length and shape.

use super::linear_kinematics::LinearKinematics;
use nalgebra::Vector3;

/// Deflection of a guide from rest: its normalised strain (see [`LinearKinematics`]) now and one and two
/// sub-steps ago, and its first-order displacements now. Deflections of guides with the same number of nodes
/// form a vector space.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Deflection {
    /// [`Deflection::MOMENTS`] blocks of strain, then one of displacements, n numbers each.
    numbers: Vec<f64>,
}

impl Deflection {
    /// Number of moments of the strain: now, and one and two sub-steps ago.
    pub const MOMENTS: usize = 3;

    /// No deflection of a guide with `unknowns` unknowns.
    pub fn zeros(unknowns: usize) -> Self {
        Deflection { numbers: vec![0.0; (Self::MOMENTS + 1) * unknowns] }
    }

    /// Sets the strain at the nodes to `strain`, moment after moment, newest first, and the displacements to
    /// those of `kinematics`.
    pub fn set(&mut self, strain: impl Iterator<Item = Vector3<f64>>, kinematics: &LinearKinematics) {
        self.numbers.clear();
        strain.for_each(|strain| self.numbers.extend_from_slice(strain.as_slice()));
        let now = vectors(&self.numbers[..self.numbers.len() / Self::MOMENTS]);
        let displacements: Vec<_> = kinematics.displacements(now).map(|(x, _)| x).collect();
        displacements.iter().for_each(|x| self.numbers.extend_from_slice(x.as_slice()));
    }

    /// Sets all numbers to zero, with the size of `other`.
    pub fn reset_like(&mut self, other: &Self) {
        self.numbers.clear();
        self.numbers.resize(other.numbers.len(), 0.0);
    }

    /// Sets all numbers to zero.
    pub(super) fn fill_zero(&mut self) {
        self.numbers.fill(0.0);
    }

    /// Adds `scale` times `other`.
    pub fn add_scaled(&mut self, scale: f64, other: &Self) {
        self.numbers.iter_mut().zip(&other.numbers).for_each(|(sum, of)| *sum += scale * of);
    }

    /// Adds `scale` times the difference `a` − `b`.
    pub fn add_scaled_difference(&mut self, scale: f64, a: &Self, b: &Self) {
        let difference = a.numbers.iter().zip(&b.numbers);
        self.numbers.iter_mut().zip(difference).for_each(|(sum, (a, b))| *sum += scale * (a - *b));
    }

    /// Normalised strain `back` (0..=2) sub-steps ago: three numbers per node but the tip, rad.
    pub fn strain(&self, back: usize) -> &[f64] {
        let n = self.numbers.len() / (Self::MOMENTS + 1);
        &self.numbers[back * n..][..n]
    }

    /// Displacements now: three numbers per node but the root, over the length of the guide.
    pub fn displacement(&self) -> &[f64] {
        self.strain(Self::MOMENTS)
    }

    /// The blocks in their order: strain at each moment, then displacements.
    pub(super) fn blocks_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        let n = self.numbers.len() / (Self::MOMENTS + 1);
        self.numbers.chunks_exact_mut(n)
    }
}

fn vectors(numbers: &[f64]) -> impl Iterator<Item = Vector3<f64>> {
    numbers.chunks_exact(3).map(Vector3::from_column_slice)
}
