//! The model of Vicsek: points of constant speed in a periodic square, each of which takes the mean direction of all within a
//! radius, itself included, and errs.
//!
//!   theta_i(t + 1) = arg(sum over j of e^(i theta_j)) + eta (u - 1/2),   x_i(t + 1) = x_i(t) + speed e^(i theta_i(t + 1))  (flocks.6)
//!
//! u is uniform in [0, 1). Time is counted in steps: this is a map, not a differential equation, and has no integrator.
//!
//! Source: [vicsek1995].

use crate::geometry::{Meet, Neighbours};
use crate::math::functions::{atan2, cos, sin};
use crate::math::{Lane, Random, Real, Row};

/// Points and their directions.
pub struct Vicsek {
    side: f64,
    speed: f64,
    noise: f64,
    random: Random,
    step: u32,
    /// Places; the last two numbers are not used.
    x: Vec<Row>,
    /// Directions [rad].
    theta: Vec<f64>,
    law: Mean,
    grid: Neighbours,
    numbers: Vec<[Real; 4]>,
    sums: Vec<[Real; 2]>,
}

/// x, y, cosine, sine -> sums of cosines and sines.
struct Mean {
    side: f64,
    radius: f64,
}

impl Mean {
    /// The nearest image.                                                                              (neighbours.4)
    #[inline(always)]
    fn nearest<L: Lane>(&self, d: L) -> L {
        let (side, half) = (d.like(self.side), d.like(0.5 * self.side));
        let d = (d - half).positive(d - side, d);
        (-d - half).positive(d + side, d)
    }
}

impl Meet<4, 2> for Mean {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 4], there: [L; 4], sum: [L; 2]) -> [L; 2] {
        let (x, y) = (self.nearest(there[0] - here[0]), self.nearest(there[1] - here[1]));
        let near = x.like(self.radius * self.radius) - (x * x + y * y);
        [sum[0] + near.positive(there[2], x.zero()), sum[1] + near.positive(there[3], x.zero())]
    }
}

// What random numbers are drawn for.
const START: u32 = 0;
const NOISE: u32 = 1;

impl Vicsek {
    /// `count` points at random places of a square with this side [m], in random directions; `speed` [m] a step, `noise` eta [rad].
    pub fn new(seed: u32, count: usize, side: f64, radius: f64, speed: f64, noise: f64) -> Self {
        let random = Random::new(seed, "vicsek");
        let at = |i: usize| random.uniform(i as u64, 0, START);
        Self {
            side,
            speed,
            noise,
            random,
            step: 0,
            x: (0..count).map(|i| [(at(i)[0] * side) as Real, (at(i)[1] * side) as Real, 0.0, 0.0]).collect(),
            theta: (0..count).map(|i| std::f64::consts::TAU * at(i)[2]).collect(),
            law: Mean { side, radius },
            grid: Neighbours::periodic(radius, [side, side, 4.0 * radius]),
            numbers: Vec::new(),
            sums: Vec::new(),
        }
    }

    /// One step.
    pub fn step(&mut self) {
        self.grid.rebuild(&self.x);
        let (x, theta) = (&self.x, &self.theta);
        self.grid.sorted(|i| [x[i][0], x[i][1], cos(theta[i]) as Real, sin(theta[i]) as Real], &mut self.numbers);
        self.grid.gather(&self.law, &self.numbers, &mut self.sums);
        for i in 0..self.x.len() {
            if let Some(place) = self.grid.place(i) {
                let [c, s] = self.sums[place].map(f64::from);
                let [u, ..] = self.random.uniform(i as u64, self.step, NOISE);
                self.theta[i] = atan2(s, c) + self.noise * (u - 0.5);
            }
            for (a, part) in [cos(self.theta[i]), sin(self.theta[i])].into_iter().enumerate() {
                let moved = f64::from(self.x[i][a]) + self.speed * part;
                self.x[i][a] = (moved - (moved / self.side).floor() * self.side) as Real;
            }
        }
        self.step += 1;
    }

    /// Length of the mean direction: 1 where all go one way, sqrt(pi/(4 N)) where none does.
    pub fn order(&self) -> f64 {
        let (c, s) = self.theta.iter().fold((0.0, 0.0), |(c, s), theta| (c + cos(*theta), s + sin(*theta)));
        (c * c + s * s).sqrt() / self.theta.len().max(1) as f64
    }
}
