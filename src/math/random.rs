//! Counter-based pseudo-random numbers: the same on every machine, in any order of evaluation.

/// Output `n`, 64 bits, of the generator SplitMix64 (Steele, Lea & Flood 2014) with this `seed`.
pub fn bits(seed: u64, n: u64) -> u64 {
    let mut z = seed.wrapping_add(n.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Output `n` as a number uniformly distributed in [0, 1).
pub fn unit(seed: u64, n: u64) -> f64 {
    (bits(seed, n) >> 11) as f64 / (1u64 << 53) as f64
}

/// Random numbers in [-1, 1) for tests, the same in every run.
#[cfg(test)]
pub struct Random {
    seed: u64,
    next: u64,
}

#[cfg(test)]
impl Random {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Random { seed, next: 0 }
    }

    /// The next number.
    pub fn draw(&mut self) -> f64 {
        self.next += 1;
        2.0 * unit(self.seed, self.next - 1) - 1.0
    }

    /// A vector of the next three numbers.
    pub fn vector(&mut self) -> nalgebra::Vector3<f64> {
        nalgebra::Vector3::from_fn(|_, _| self.draw())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_agree_with_the_published_generator() {
        let first: Vec<u64> = (0..3).map(|n| bits(1_234_567, n)).collect();
        assert_eq!(first, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn numbers_are_uniform_in_the_unit_interval() {
        let mut tenths = [0; 10];
        (0..10_000).for_each(|n| tenths[(unit(7, n) * 10.0) as usize] += 1);
        assert!(tenths.iter().all(|n| (900..1100).contains(n)), "{tenths:?}");
    }
}
