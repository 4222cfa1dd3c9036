//! Clumps: rigid unions of spheres [bell2005].
//!
//!   m v' = m g + sum of F,   L' = sum of (x_i - x) × F + M,   q' = q ω/2,   ω = I^-1 L                                  (grains.9)
//!
//! Spheres are rows of the bed, and feel forces there. The motion between two kicks is made of turns about the clump's own axes [dullweber1997], so that
//! the angular momentum L is kept to round-off.

use super::kick::{Kick, QUICK, narrow};
use super::list::{Four, point};
use super::walls::add;
use crate::geometry::Vector;
use crate::math::parallel::{CHUNK, Tasks};
use crate::math::{Quat, Row, rotation};
use std::ops::Range;

/// Of a row that belongs to no clump.
const NONE: u32 = u32::MAX;
/// Numbers of a clump in a snapshot.
pub const CLUMP: usize = 13;

/// A clump at the start, and how it moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Clump {
    /// Its spheres, as numbers of grains.
    pub spheres: Range<u32>,
    /// Mass [kg].
    pub mass: f64,
    /// Moments of inertia about its own axes [kg m²].
    pub inertia: [f64; 3],
    /// Centre of mass [m].
    pub x: Vector,
    /// Orientation of its own axes.
    pub q: Quat<f64>,
    /// Velocity [m/s].
    pub v: Vector,
    /// Angular momentum about the centre of mass [N m s].
    pub spin: Vector,
}

impl Clump {
    /// Angular velocity with an angular momentum [rad/s].
    pub fn turns(&self, spin: Vector) -> Vector {
        let [a, b, c] = self.inertia;
        let own = self.q.conj().turn(spin);
        self.q.turn(Vector { x: own.x / a, y: own.y / b, z: own.z / c })
    }

    /// The angular momentum of an angular velocity [N m s].
    pub fn spin_of(&self, w: Vector) -> Vector {
        let [a, b, c] = self.inertia;
        let own = self.q.conj().turn(w);
        self.q.turn(Vector { x: own.x * a, y: own.y * b, z: own.z * c })
    }

    /// Kinetic energy [J].
    pub fn kinetic(&self) -> f64 {
        0.5 * (self.mass * self.v.norm_sq() + self.spin.dot(self.turns(self.spin)))
    }

    /// Momentum [N s], and angular momentum about the origin [N m s].
    pub fn momenta(&self) -> [Vector; 2] {
        let momentum = self.v * self.mass;
        [momentum, self.x.cross(momentum) + self.spin]
    }

    /// Moves without forces for h [s].                                                                           (grains.10)
    fn advance(&mut self, h: f64) {
        self.x = self.x + self.v * h;
        for (axis, part) in [(0, 0.5), (1, 0.5), (2, 1.0), (1, 0.5), (0, 0.5)] {
            let own = <[f64; 3]>::from(self.q.conj().turn(self.spin))[axis];
            let mut theta = [0.0; 3];
            theta[axis] = part * h * own / self.inertia[axis];
            self.q = (self.q * rotation::by(theta.into())).normalized();
        }
    }
}

/// What velocity and spin gain until the time of the next forces, and half of what the last forces gave both.
type Gains = [[Vector; 2]; 2];

/// All of them.
#[derive(Debug, Default)]
pub struct Clumps {
    /// Each.
    pub all: Vec<Clump>,
    gains: Vec<Gains>,
    /// The clump of each grain, and its place there [m], in the clump's own axes; empty without clumps.
    of: Vec<u32>,
    local: Vec<Vector>,
    /// The clump of each row, and the row of each grain.
    rows: Vec<u32>,
    places: Vec<u32>,
}

/// Rows that a clump moves.
pub struct Moved<'a> {
    pub x: &'a [Four],
    pub v: &'a mut [Four],
    pub w: &'a mut [Four],
    pub quick: &'a mut [Row],
    pub grain: &'a [u32],
}

impl Clumps {
    /// Of so many grains, at places [m] in the axes of their clumps.
    pub fn new(all: Vec<Clump>, local: Vec<Vector>) -> Self {
        if all.is_empty() {
            return Self::default();
        }
        let mut of = vec![NONE; local.len()];
        for (k, clump) in all.iter().enumerate() {
            clump.spheres.clone().for_each(|grain| of[grain as usize] = k as u32);
        }
        Self { gains: vec![Gains::default(); all.len()], all, of, local, rows: Vec::new(), places: Vec::new() }
    }

    /// Takes the grain of each row.
    pub fn sort(&mut self, grain: &[u32]) {
        if self.all.is_empty() {
            return;
        }
        self.rows = grain.iter().map(|grain| self.of[*grain as usize]).collect();
        self.places.resize(grain.len(), 0);
        grain.iter().enumerate().for_each(|(row, grain)| self.places[*grain as usize] = row as u32);
    }

    /// Whether two rows are spheres of one clump.
    pub fn joins(&self, a: u32, b: u32) -> bool {
        let of = |row: u32| self.rows.get(row as usize).copied().unwrap_or(NONE);
        of(a) != NONE && of(a) == of(b)
    }

    /// The clump of a row.
    pub fn at(&self, row: usize) -> Option<&Clump> {
        self.all.get(*self.rows.get(row)? as usize)
    }

    /// Moves a row, and all that are rigid with it.
    pub fn shift(&self, x: &mut [Four], row: usize, by: Vector) {
        match self.at(row) {
            None => add(&mut x[row], by),
            Some(clump) => clump.spheres.clone().for_each(|grain| add(&mut x[self.places[grain as usize] as usize], by)),
        }
    }

    /// Velocities change by forces on spheres, in their order, and gravity.
    pub fn kick(&mut self, x: &[Four], [force, torque]: [&[Four]; 2], gravity: Vector, kick: Kick) {
        let places = &self.places;
        self.all.chunks_mut(CHUNK).zip(self.gains.chunks_mut(CHUNK)).in_parallel(|(all, gains)| {
            for (clump, [gain, last]) in all.iter_mut().zip(gains) {
                let (mut f, mut m) = (Vector::default(), Vector::default());
                for row in clump.spheres.clone().map(|grain| places[grain as usize] as usize) {
                    let push = point(&force[row]);
                    (f, m) = (f + push, m + point(&torque[row]) + (point(&x[row]) - clump.x).cross(push));
                }
                let changes = [gravity + f * (1.0 / clump.mass), m];
                (clump.v, clump.spin) = (clump.v + changes[0] * kick.h, clump.spin + changes[1] * kick.h);
                for k in 0..2 {
                    [gain[k], last[k]] = kick.gain(changes[k], last[k]);
                }
            }
        });
    }

    /// Moves clumps for h [s]: spheres get the mean velocities of that time, and what these gain until the time of the forces.
    pub fn drift(&mut self, rows: Moved<'_>, h: f64) {
        let mut before = vec![Vector::default(); self.all.len()];
        self.all.chunks_mut(CHUNK).zip(before.chunks_mut(CHUNK)).in_parallel(|(all, before)| {
            for (clump, before) in all.iter_mut().zip(before) {
                *before = clump.turns(clump.spin);
                clump.advance(h);
            }
        });
        let gains = &self.gains;
        self.each_row(rows, |k, clump, arm, x| {
            let [gain, spin_gain] = gains[k][0];
            let velocity = (clump.x + arm - x) * (1.0 / h);
            let turn = (before[k] + clump.turns(clump.spin)) * 0.5;
            let then = clump.turns(clump.spin + spin_gain);
            [velocity, turn, clump.v + gain + then.cross(arm) - velocity, then - turn]
        });
    }

    /// Gives spheres the velocities of their clumps.
    pub fn settle(&self, rows: Moved<'_>) {
        self.each_row(rows, |_, clump, arm, _| {
            let turn = clump.turns(clump.spin);
            [clump.v + turn.cross(arm), turn, Vector::default(), Vector::default()]
        });
    }

    /// Sets velocities and spins of spheres, and their gains, by the number of a clump, itself, the arm to a sphere and the place of that.
    fn each_row(&self, rows: Moved<'_>, of: impl Fn(usize, &Clump, Vector, Vector) -> [Vector; 4] + Sync) {
        if self.all.is_empty() {
            return;
        }
        let Moved { x, v, w, quick, grain } = rows;
        let clump_of = &self.rows;
        let chunks = v.chunks_mut(CHUNK).zip(w.chunks_mut(CHUNK)).zip(quick.chunks_mut(QUICK * CHUNK)).enumerate();
        chunks.in_parallel(|(c, ((v, w), quick))| {
            for (k, ((v, w), quick)) in v.iter_mut().zip(w).zip(quick.chunks_exact_mut(QUICK)).enumerate() {
                let row = c * CHUNK + k;
                let number = clump_of[row] as usize;
                let Some(clump) = self.all.get(number) else { continue };
                let arm = clump.q.turn(self.local[grain[row] as usize]);
                let [velocity, turn, gain, turn_gain] = of(number, clump, arm, point(&x[row]));
                v[..3].copy_from_slice(&<[f64; 3]>::from(velocity));
                w[..3].copy_from_slice(&<[f64; 3]>::from(turn));
                (quick[2], quick[3]) = (narrow(gain), narrow(turn_gain));
            }
        });
    }

    /// Takes over where spheres have been moved to, all of a clump alike.
    pub fn follow(&mut self, x: &[Four]) {
        for clump in &mut self.all {
            let first = clump.spheres.start as usize;
            clump.x = point(&x[self.places[first] as usize]) - clump.q.turn(self.local[first]);
        }
    }

    /// Numbers for [`restore`](Self::restore).
    pub fn save(&self) -> Vec<f64> {
        let three = <[f64; 3]>::from;
        self.all.iter().flat_map(|c| [&three(c.x)[..], &c.q.row(), &three(c.v), &three(c.spin)].concat()).collect()
    }

    /// Takes numbers over, if they are as many as there should be.
    pub fn restore(&mut self, numbers: &[f64]) -> Option<()> {
        if numbers.len() != CLUMP * self.all.len() {
            return None;
        }
        let three = |s: &[f64]| Vector { x: s[0], y: s[1], z: s[2] };
        for (clump, s) in self.all.iter_mut().zip(numbers.chunks_exact(CLUMP)) {
            let q = Quat::from_row([s[3], s[4], s[5], s[6]]);
            (clump.x, clump.q, clump.v, clump.spin) = (three(s), q, three(&s[7..]), three(&s[10..]));
        }
        Some(())
    }
}
