//! Two orbits without a closed form, whose ends are known to many digits.
//!
//! Source: [hairer1993], II.0 (Arenstorf) and II.10 (Pleiades); start and end as in the SciML ODE problem library and in
//! the test set for initial-value problems of Bari, each confirmed by an eighth-order solver at a tolerance of 3e-14.

/// Arenstorf's closed orbit about Earth and Moon, in the frame that turns with them.
pub mod arenstorf {
    /// The Moon's part of the mass.
    pub const MU: f64 = 0.012277471;
    /// Position at the start.                                           (orbits.7)
    pub const POSITION: [f64; 2] = [0.994, 0.0];
    /// Velocity at the start.
    pub const VELOCITY: [f64; 2] = [0.0, -2.001_585_106_379_082_5];
    /// Period.
    pub const PERIOD: f64 = 17.065_216_560_157_962;
    /// Jacobi's constant of the orbit.
    pub const JACOBI: f64 = 2.856_412_520_209_87;
    /// Positions at an eighth, a quarter and a half of the period, to eight decimals.
    pub const CHECKPOINTS: [(f64, [f64; 2]); 3] = [
        (PERIOD / 8.0, [-0.628_488_26, 0.645_125_03]),
        (PERIOD / 4.0, [-0.088_719_21, 1.102_775_76]),
        (PERIOD / 2.0, [-1.244_822_05, 0.0]),
    ];

    /// Acceleration.                                                    (orbits.6)
    pub fn acceleration([x, y]: [f64; 2], [vx, vy]: [f64; 2]) -> [f64; 2] {
        let (earth, moon) = (MU, 1.0 - MU);
        let d1 = ((x + earth) * (x + earth) + y * y).powi(3).sqrt();
        let d2 = ((x - moon) * (x - moon) + y * y).powi(3).sqrt();
        [x + 2.0 * vy - moon * (x + earth) / d1 - earth * (x - moon) / d2, y - 2.0 * vx - moon * y / d1 - earth * y / d2]
    }

    /// Jacobi's constant of any state.                                  (orbits.8)
    pub fn jacobi([x, y]: [f64; 2], [vx, vy]: [f64; 2]) -> f64 {
        let r1 = ((x + MU) * (x + MU) + y * y).sqrt();
        let r2 = ((x - 1.0 + MU) * (x - 1.0 + MU) + y * y).sqrt();
        x * x + y * y + 2.0 * (1.0 - MU) / r1 + 2.0 * MU / r2 - vx * vx - vy * vy
    }
}

/// Seven bodies in the plane with masses 1 to 7 and G = 1.
pub mod pleiades {
    /// End of the problem.
    pub const END: f64 = 3.0;
    /// Positions at the start.                                          (orbits.10)
    pub const POSITION: [[f64; 2]; 7] = [[3.0, 3.0], [3.0, -3.0], [-1.0, 2.0], [-3.0, 0.0], [2.0, 0.0], [-2.0, -4.0], [2.0, 4.0]];
    /// Velocities at the start.
    pub const VELOCITY: [[f64; 2]; 7] = [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, -1.25], [0.0, 1.0], [1.75, 0.0], [-1.5, 0.0]];
    /// Positions at the end; two sources agree on 11 digits.
    pub const POSITION_AT_END: [[f64; 2]; 7] = [
        [0.370_613_914_397_050_2, -3.943_437_585_517_392],
        [3.237_284_092_057_233, -3.271_380_973_972_55],
        [-3.222_559_032_418_324, 5.225_081_843_456_543],
        [0.659_709_145_577_531, -2.590_612_434_977_47],
        [0.342_558_170_715_658_4, 1.198_213_693_392_275],
        [1.562_172_101_400_631, -0.242_968_234_493_582_4],
        [-0.700_309_292_221_249_5, 1.091_449_240_428_98],
    ];

    /// Mass of body i, counted from 0.
    pub fn mass(i: usize) -> f64 {
        i as f64 + 1.0
    }

    /// Acceleration of body i.                                          (orbits.9)
    pub fn acceleration(x: &[[f64; 2]; 7], i: usize) -> [f64; 2] {
        let mut a = [0.0; 2];
        for j in (0..7).filter(|j| *j != i) {
            let d = [x[j][0] - x[i][0], x[j][1] - x[i][1]];
            let pull = mass(j) / (d[0] * d[0] + d[1] * d[1]).powi(3).sqrt();
            a = [a[0] + pull * d[0], a[1] + pull * d[1]];
        }
        a
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Jacobi's constant is one: its rate along the equation, by differences, is zero.
    #[test]
    fn the_constant_of_jacobi_is_constant() {
        let (x, v) = (arenstorf::POSITION, arenstorf::VELOCITY);
        assert!((arenstorf::jacobi(x, v) - arenstorf::JACOBI).abs() < 1e-13);
        let (x, v, h) = ([-0.6, 0.7], [0.3, -0.4], 1e-5);
        let a = arenstorf::acceleration(x, v);
        let moved = |h: f64| arenstorf::jacobi([0, 1].map(|i| x[i] + h * v[i]), [0, 1].map(|i| v[i] + h * a[i]));
        assert!(((moved(h) - moved(-h)) / (2.0 * h)).abs() < 1e-8);
        assert!(a[0].abs() > 0.1);
    }

    /// No net force: the sum of mass times acceleration is round-off.
    #[test]
    fn the_pleiades_pull_each_other_alike() {
        for axis in 0..2 {
            let parts: Vec<f64> = (0..7).map(|i| pleiades::mass(i) * pleiades::acceleration(&pleiades::POSITION, i)[axis]).collect();
            assert!(parts.iter().sum::<f64>().abs() < 1e-14 && parts.iter().all(|p| p.abs() > 1e-3));
        }
    }
}
