//! The model of Vicsek: points of constant speed in a periodic square, each of which takes the mean direction of all within a
//! radius, itself included, and errs.
//!
//!   theta_i(t + 1) = arg(sum over j of e^(i theta_j)) + eta (u - 1/2),   x_i(t + 1) = x_i(t) + speed e^(i theta_i(t + 1))  (flocks.6)
//!
//! u is uniform in [0, 1). Time is counted in steps: this is a map, not a differential equation, and has no integrator.
//!
//! Source: [vicsek1995].

use crate::exchange::Turn;
use crate::geometry::{Meet, Neighbours, Vector};
use crate::integrators::equal_steps;
use crate::math::functions::{atan2, cos, sin};
use crate::math::{Lane, Random, Real, Row};
use crate::state::Object;
use crate::system::{Archive, Part, System};
use tumble_interface::engine::{Ledger, Stability, StepReport};
use tumble_interface::scene;
use tumble_interface::{Column, StepError};

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

// Purposes of random numbers.
const START: u32 = 0;
const NOISE: u32 = 1;

impl Vicsek {
    /// `count` points at random places of a square with this side [m], in random directions; `speed` [m] a step, `noise` eta [rad].
    pub fn new(seed: u32, count: usize, side: f64, radius: f64, speed: f64, noise: f64) -> Self {
        let random = Random::new(seed, "vicsek");
        let at = |i: usize| random.uniform(i as u64, 0, START);
        let places: Vec<[f64; 2]> = (0..count).map(|i| [at(i)[0] * side, at(i)[1] * side]).collect();
        Self::from(random, &places, &vec![None; count], side, radius, speed, noise)
    }

    /// Points at these places and with these directions, random where there are none.
    fn from(random: Random, places: &[[f64; 2]], theta: &[Option<f64>], side: f64, radius: f64, speed: f64, noise: f64) -> Self {
        let turn = |i: usize| std::f64::consts::TAU * random.uniform(i as u64, 0, START)[2];
        Self {
            side,
            speed,
            noise,
            random,
            step: 0,
            x: places.iter().map(|x| [x[0] as Real, x[1] as Real, 0.0, 0.0]).collect(),
            theta: theta.iter().enumerate().map(|(i, theta)| theta.unwrap_or_else(|| turn(i))).collect(),
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
        self.step = self.step.wrapping_add(1);
    }

    /// Length of the mean direction: 1 where all go one way, sqrt(pi/(4 N)) where none does.
    pub fn order(&self) -> f64 {
        let (c, s) = self.theta.iter().fold((0.0, 0.0), |(c, s), theta| (c + cos(*theta), s + sin(*theta)));
        (c * c + s * s).sqrt() / self.theta.len().max(1) as f64
    }
}

/// Points and directions of a scene, in a square around the origin.
pub struct Swarm {
    name: String,
    model: Vicsek,
    substeps: Option<u32>,
    step: Option<f64>,
    /// Speed [m/s]; the model's is that of a step.
    speed: f64,
    /// The two axes of the plane.
    plane: [usize; 2],
    objects: Vec<Object>,
}

/// An angle; none of a direction of nothing.
fn angle(v: [f64; 2]) -> Option<f64> {
    (v != [0.0, 0.0]).then(|| atan2(v[1], v[0]))
}

impl Swarm {
    /// The system that a plan describes; `plane` are its two axes, every object is a range of points.
    pub fn new(
        plan: &scene::System,
        words: &scene::Vicsek,
        seed: u32,
        plane: [usize; 2],
        points: &[[Vector; 2]],
        objects: Vec<Object>,
    ) -> Self {
        let across = |p: Vector| plane.map(|a| <[f64; 3]>::from(p)[a]);
        let places: Vec<[f64; 2]> = points.iter().map(|[x, _]| across(*x).map(|x| home(x, words.side))).collect();
        let theta: Vec<Option<f64>> = points.iter().map(|[_, v]| angle(across(*v))).collect();
        let random = Random::new(seed, &plan.name);
        Self {
            model: Vicsek::from(random, &places, &theta, words.side, words.radius, 0.0, words.noise),
            name: plan.name.clone(),
            substeps: plan.substeps,
            step: plan.step,
            speed: words.speed,
            plane,
            objects,
        }
    }

    /// Two numbers of the plane, in space.
    fn in_space(&self, [a, b]: [Real; 2]) -> [Real; 3] {
        let mut x = [0.0; 3];
        (x[self.plane[0]], x[self.plane[1]]) = (a, b);
        x
    }
}

/// A coordinate around the origin as one from 0 to the side.
fn home(x: f64, side: f64) -> f64 {
    (x + 0.5 * side).rem_euclid(side)
}

impl System for Swarm {
    fn name(&self) -> &str {
        &self.name
    }

    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, _t: f64, dt: f64, _exchange: &mut Turn<'_>, go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        let n = self.substeps.or(self.step.map(|step| equal_steps(dt, step) as u32)).unwrap_or(1);
        let h = dt / f64::from(n);
        self.model.speed = self.speed * h;
        for _ in 0..n {
            if !go_on() {
                break;
            }
            self.model.step();
            report.stepped(h);
        }
        Ok(report)
    }

    fn publish(&mut self, _t: f64, _exchange: &mut Turn<'_>) {}

    fn columns(&self, _t: f64, names: &[&str], out: &mut Vec<Column>) {
        let half = 0.5 * self.model.side;
        for object in &self.objects {
            let points = object.points.clone();
            for name in names {
                let rows: Vec<[Real; 3]> = match *name {
                    "position" => {
                        let place = |x: &Row| self.in_space([x[0], x[1]].map(|x| (f64::from(x) - half) as Real));
                        self.model.x[points.clone()].iter().map(place).collect()
                    }
                    "velocity" => {
                        let v = |theta: &f64| self.in_space([cos(*theta), sin(*theta)].map(|part| (self.speed * part) as Real));
                        self.model.theta[points.clone()].iter().map(v).collect()
                    }
                    _ => continue,
                };
                out.push(object.column(name, rows.concat()));
            }
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        out.extend(self.objects.iter().map(Object::one_radius));
    }

    fn ledger(&self, t: f64) -> Ledger {
        Ledger { time: t, speed: Some(self.speed), ..Ledger::default() }
    }

    /// Nothing can: places stay in the square.
    fn breakdown(&mut self, _t: f64) -> Option<StepError> {
        None
    }

    fn watch(&mut self, _on: bool) {}

    fn stability(&mut self, _dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        None
    }

    fn save(&self, archive: &mut Archive) {
        archive.push_rows("x", &self.model.x);
        archive.push("theta", Part::Numbers(self.model.theta.clone()));
        archive.push_indices("step", &vec![self.model.step]);
    }

    fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        archive.rows("x", &mut self.model.x)?;
        let theta = archive.numbers("theta")?;
        let [step] = archive.indices("step")?[..] else { return None };
        if theta.len() != self.model.theta.len() {
            return None;
        }
        (self.model.theta, self.model.step) = (theta, step);
        Some(())
    }

    /// Of velocities the direction is taken, if they have one.
    fn write(&mut self, object: &str, column: &str, values: &[f64]) -> Option<bool> {
        let points = self.objects.iter().find(|o| o.name == object)?.points.clone();
        if !matches!(column, "position" | "velocity") || values.len() != 3 * points.len() {
            return Some(false);
        }
        for (i, value) in points.zip(values.chunks_exact(3)) {
            let [a, b] = self.plane.map(|a| value[a]);
            if column == "position" {
                let side = self.model.side;
                self.model.x[i] = [home(a, side) as Real, home(b, side) as Real, 0.0, 0.0];
            } else if let Some(theta) = angle([a, b]) {
                self.model.theta[i] = theta;
            }
        }
        Some(true)
    }
}
