//! Every pair once, at every width, for masses of all sizes.

use super::*;
use crate::math::simd::{Level, dispatch_at};

#[test]
fn every_width_gives_the_same_bits() {
    // More than one block of sources, and no multiple of any register.
    let n = BLOCK + 77;
    let number = |i: usize, c: usize| ((i * 131 + c * 37) % 1009) as Real * 0.003 - 1.5;
    let x: Vec<Row> = (0..n).map(|i| [number(i, 1), number(i, 2), number(i, 3), 0.0]).collect();
    let u: Vec<Row> = (0..n).map(|i| [number(i, 4), number(i, 5), number(i, 6), 0.0]).collect();
    let mass: Vec<Real> = (0..n).map(|i| 1.0 + number(i, 7).abs()).collect();
    let masses = Masses { mass, charge: (0..n).map(|i| number(i, 8)).collect(), ..Masses::default() };
    for (attractor, softening) in [(Attractor::Mass(0.3), 0.05), (Attractor::Charge(-0.3), 0.0)] {
        let mut law = DirectSum::new(attractor, softening, false, &[], vec![0..n], &masses);
        law.begin_product(&x, &u);
        let all = |level| {
            let (mut sums, mut product) = (vec![0.0; 6 * n], vec![[0.0; 4]; 45]);
            let mut columns = sums.chunks_exact_mut(n);
            let mut three = || std::array::from_fn(|_| columns.next().unwrap());
            let out = [three(), three()];
            // The same strip twice, and one behind the other.
            let strips = if softening > 0.0 { [0..n, 0..n] } else { [0..BLOCK + 5, BLOCK + 5..n] };
            if softening > 0.0 {
                dispatch_at(level, Tile::<false, false> { law: &law, strips, out });
            } else {
                dispatch_at(level, Tile::<false, true> { law: &law, strips, out });
            }
            dispatch_at(level, Product { law: &law, first: 13, out: &mut product });
            let (positions, range) = (&law.positions, 13..58);
            let potential = if softening > 0.0 {
                dispatch_at(level, Potential::<false, false> { law: &law, positions, range })
            } else {
                dispatch_at(level, Potential::<false, true> { law: &law, positions, range })
            };
            (sums, product, potential.to_bits())
        };
        let one = all(Level::Scalar);
        assert!(one.0.iter().filter(|f| **f != 0.0).count() > n && one.1.iter().all(|f| f[1] != 0.0));
        for level in Level::available() {
            assert_eq!(all(level), one, "{level:?}");
        }
    }
}

/// Counts around the sizes of packs, blocks and strips, against each pair by itself in double precision.
#[test]
fn every_pair_pulls_once() {
    let number = |i: usize, c: usize| ((i * 131 + c * 37) % 1009) as Real * 0.003 - 1.5;
    for n in [1, 2, 3, LANES, LANES + 1, 2 * LANES - 1, BLOCK, BLOCK + 1, 2 * BLOCK + 77] {
        let x: Vec<Row> = (0..n).map(|i| [number(i, 1), number(i, 2), number(i, 3), 0.0]).collect();
        let masses = Masses { mass: (0..n).map(|i| 1.0 + number(i, 7).abs()).collect(), ..Masses::default() };
        let mut law = DirectSum::new(Attractor::Mass(0.3), 0.1, false, &[], vec![0..n], &masses);
        law.begin_forces(0.0, &x, &x);
        let mut force = vec![[0.0; 4]; n];
        law.add_forces(&x, &x, 0, &mut force);
        for i in 0..n {
            let (mut exact, mut size) = (Vec3::<f64>::default(), 0.0);
            for j in (0..n).filter(|j| *j != i) {
                let d = xyz64(x[j]) - xyz64(x[i]);
                let pull = d * (0.3 * f64::from(masses.mass[i]) * f64::from(masses.mass[j]) * (d.norm_sq() + 0.01).powf(-1.5));
                (exact, size) = (exact + pull, size + pull.norm());
            }
            // Units in the last place of the sum of magnitudes: 2 measured.
            let off = (xyz64(force[i]) - exact).norm();
            assert!(off <= 8.0 * f64::from(Real::EPSILON) * size, "{n} {i}: {off:e} of {size:e}");
        }
    }
}

/// The sun, the earth, the moon and a boulder near them, in SI units.
#[test]
fn masses_of_all_sizes_pull() {
    const G: f64 = 6.67428e-11;
    let x = [[0.0; 4], [1.5e11, 0.0, 0.0, 0.0], [1.5e11, 3.8e8, 0.0, 0.0], [1.5e11, 1e7, 2e7, 0.0]];
    let masses = Masses { mass: vec![2e30, 6e24, 7e22, 1e15], ..Masses::default() };
    let mut law = DirectSum::new(Attractor::Mass(G), 0.0, false, &[], vec![0..4], &masses);
    let mut force = vec![[0.0; 4]; 4];
    law.begin_forces(0.0, &x, &x);
    law.add_forces(&x, &x, 0, &mut force);
    for i in 0..4 {
        let pull = |j: usize| {
            let d = xyz64(x[j]) - xyz64(x[i]);
            d * (G * f64::from(masses.mass[i]) * f64::from(masses.mass[j]) / d.norm().powi(3))
        };
        let exact = (0..4).filter(|j| *j != i).map(pull).fold(Vec3::default(), |a, b| a + b);
        let off = (xyz64(force[i]) - exact).norm() / exact.norm();
        assert!(off < 8.0 * f64::from(Real::EPSILON), "{i}: {off:e}");
    }
}

#[test]
fn masses_in_one_place_do_not_pull_each_other() {
    for softening in [0.0, 0.1] {
        let masses = Masses { mass: vec![1.0, 2.0, 1.0], ..Masses::default() };
        let mut law = DirectSum::new(Attractor::Mass(1.0), softening, false, &[], vec![0..3], &masses);
        let x = [[1.0, 2.0, 3.0, 0.0], [1.0, 2.0, 3.0, 0.0], [1.0, 2.0, 4.0, 0.0]];
        let mut f = [[0.0; 4]; 3];
        law.begin_forces(0.0, &x, &x);
        law.add_forces(&x, &x, 0, &mut f);
        let pull = (1.0 + (softening * softening) as Real).powf(-1.5);
        assert!((f[0][2] - pull).abs() < 1e-6 && (f[1][2] - 2.0 * pull).abs() < 1e-6 && f[0][0] == 0.0, "{f:?}");
        assert!(law.energy(&x).is_finite());
    }
}
