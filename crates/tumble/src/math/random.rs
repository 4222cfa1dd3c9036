//! Random numbers without a state: each is a function of what it is for. Two runs, two threads, and a run that was
//! restored, draw the same.
//!
//! Source: Philox4x32-10, [salmon2011].

use std::hash::Hasher;
use twox_hash::XxHash32;

/// The random numbers of one thing, keyed by the scene's seed and the thing's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Random {
    key: [u32; 2],
}

impl Random {
    /// The numbers of a thing of that name.
    pub fn new(seed: u32, name: &str) -> Self {
        let mut hash = XxHash32::with_seed(0);
        hash.write(name.as_bytes());
        Self { key: [seed, hash.finish_32()] }
    }

    /// Four words for a particle, a step, and what they are drawn for.
    pub fn words(&self, id: u64, step: u32, purpose: u32) -> [u32; 4] {
        philox([id as u32, (id >> 32) as u32, step, purpose], self.key)
    }

    /// One number, uniform in [0, 1), for a particle: a tenth of the work of [`Random::uniform`], for what is asked again and again.
    /// Two rounds of a hash that mixes every bit, [steele2014].
    #[inline]
    pub fn quick(&self, id: u32, purpose: u32) -> f64 {
        let mix = |mut x: u64| {
            x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            x ^ (x >> 31)
        };
        let key =
            (u64::from(self.key[0]) << 32 | u64::from(self.key[1])).wrapping_add(u64::from(purpose).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        (mix(mix(key) ^ u64::from(id)) >> 32) as f64 / 4294967296.0
    }

    /// Four numbers, uniform in [0, 1), with 32 random bits each.
    pub fn uniform(&self, id: u64, step: u32, purpose: u32) -> [f64; 4] {
        self.words(id, step, purpose).map(|word| f64::from(word) / 4294967296.0)
    }
}

/// Ten rounds of Philox4x32.
fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let multiply = |a: u32, b: u32| {
            let product = u64::from(a) * u64::from(b);
            ((product >> 32) as u32, product as u32)
        };
        let (high0, low0) = multiply(0xD251_1F53, counter[0]);
        let (high1, low1) = multiply(0xCD9E_8D57, counter[2]);
        counter = [high1 ^ counter[1] ^ key[0], low1, high0 ^ counter[3] ^ key[1], low0];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of the Random123 distribution, [salmon2011].
    #[test]
    fn the_generator_gives_its_published_answers() {
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([u32::MAX; 4], [u32::MAX; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        let digits_of_pi = philox([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344], [0xa409_3822, 0x299f_31d0]);
        assert_eq!(digits_of_pi, [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]);
    }

    /// Evenness, and no correlation of neighbours, of keys, of purposes: standard deviations are 0.0006 of the mean and 0.005 of
    /// correlations.
    #[test]
    fn quick_numbers_are_uniform_and_independent() {
        let (a, b) = (Random::new(7, "snow"), Random::new(8, "snow"));
        let n = 200_000;
        let mean = |f: &dyn Fn(u32) -> f64| (0..n).map(f).sum::<f64>() / f64::from(n);
        assert!((mean(&|i| a.quick(i, 0)) - 0.5).abs() < 0.0026);
        assert!((mean(&|i| a.quick(i, 0).powi(2)) - 1.0 / 3.0).abs() < 0.0027);
        let with = |f: &dyn Fn(u32) -> f64| 12.0 * mean(&|i| (a.quick(i, 0) - 0.5) * (f(i) - 0.5));
        assert!(with(&|i| a.quick(i + 1, 0)).abs() < 0.01);
        assert!(with(&|i| b.quick(i, 0)).abs() < 0.01);
        assert!(with(&|i| a.quick(i, 1)).abs() < 0.01);
        assert!((with(&|i| a.quick(i, 0)) - 1.0).abs() < 0.01);
    }

    #[test]
    fn numbers_are_uniform_and_differ_by_every_key() {
        let random = Random::new(7, "snow");
        let n = 20_000;
        let mean: f64 = (0..n).flat_map(|id| random.uniform(id, 0, 0)).sum::<f64>() / (4 * n) as f64;
        // The standard deviation of the mean is 0.001.
        assert!((mean - 0.5).abs() < 0.004, "{mean}");
        let first = random.words(1, 2, 3);
        for other in [random.words(2, 2, 3), random.words(1, 3, 3), random.words(1, 2, 4), random.words(1 << 32, 2, 3)] {
            assert_ne!(first, other);
        }
        assert_ne!(first, Random::new(8, "snow").words(1, 2, 3));
        assert_ne!(first, Random::new(7, "rain").words(1, 2, 3));
    }
}
