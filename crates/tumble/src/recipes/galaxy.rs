//! Stars that hold together: a disk, or Plummer's sphere.

use super::Site;
use crate::geometry::Vector;
use crate::math::functions::{cos, ln, pow, sin};
use crate::math::random::Random;
use crate::math::rotation::from_degrees;
use crate::reference::Disk;
use std::f64::consts::PI;
use tumble_interface::scene::{Galaxy, Profile};

/// What random numbers of a star are drawn for.
const PLACE: u32 = 0;
const SPEED: u32 = 1;
const TRIAL: u32 = 2;

/// A disk ends at this many scale lengths: 99.95 % of an exponential one are within.
const EDGE: f64 = 10.0;

/// Adds the stars, and last the halo. `constant` is G [N m²/kg²].
///
/// Disk: radii from (orbits.17), heights from sech²(z/z0), mean speeds and their scatter from (orbits.19).
/// Sphere: (orbits.20).
/// Centre and mean velocity of the stars are exactly those given.
pub fn galaxy(site: &mut Site<'_>, thing: &Galaxy, seed: u32, constant: f64, softening: f64) {
    let random = Random::new(seed, &thing.name);
    site.parts.begin(&thing.name, thing.radius);
    let (gm, n) = (constant * thing.mass, thing.stars);
    let mut stars: Vec<(Vector, Vector)> = match thing.profile {
        Profile::Disk => {
            let halo = thing.halo.as_ref().map_or((0.0, 1.0), |h| (constant * h.mass, h.radius * h.radius + softening * softening));
            let model =
                Model { disk: Disk { gm, length: thing.length }, halo, height: thing.thickness * thing.length, toomre: thing.toomre };
            (0..n).map(|id| model.star(&random, u64::from(id))).collect()
        }
        Profile::Plummer => {
            if thing.halo.is_some() {
                site.wrong(format!("galaxy \"{}\".halo", thing.name), "only a disk can have one; leave it out, or set profile = \"disk\"");
            }
            (0..n).map(|id| in_sphere(&random, u64::from(id), gm, thing.length)).collect()
        }
    };
    let mean = |of: &dyn Fn(&(Vector, Vector)) -> Vector| stars.iter().fold(Vector::default(), |sum, s| sum + of(s)) * (1.0 / f64::from(n));
    let (off, drift) = (mean(&|s| s.0), mean(&|s| s.1));
    let turn = from_degrees(thing.rotate);
    let (center, velocity) = (Vector::from(thing.center), Vector::from(thing.velocity));
    let sense = if thing.clockwise { -1.0 } else { 1.0 };
    for (x, v) in &mut stars {
        let (mut at, mut moves) = (*x - off, *v - drift);
        // A mirror image turns the other way.
        at.y *= sense;
        moves.y *= sense;
        site.parts.point(center + turn.turn(at), velocity + turn.turn(moves), thing.mass / f64::from(n));
    }
    if let Some(halo) = &thing.halo {
        let point = site.parts.point(center, velocity, halo.mass);
        site.parts.halo(point, halo.radius);
    }
}

/// A disk with a halo round it.
struct Model {
    disk: Disk,
    /// G M_h [m³/s²] and the square of its softened radius [m²].
    halo: (f64, f64),
    /// z0 [m].
    height: f64,
    toomre: f64,
}

impl Model {
    /// Speed of a circle, squared.
    fn speed_sq(&self, r: f64) -> f64 {
        let (gm, b_sq) = self.halo;
        let s = r * r + b_sq;
        self.disk.speed_sq(r) + gm * r * r / (s * s.sqrt())
    }

    /// kappa² = 2 v²/R² + (dv²/dR)/R: the square of the rate at which an orbit swings about its circle.
    fn swing_sq(&self, r: f64) -> f64 {
        let d = 1e-3 * r;
        let slope = (self.speed_sq(r + d) - self.speed_sq(r - d)) / (2.0 * d);
        2.0 * self.speed_sq(r) / (r * r) + slope / r
    }

    fn star(&self, random: &Random, id: u64) -> (Vector, Vector) {
        let [a, b, c, _] = random.uniform(id, 0, PLACE).map(inside);
        let r = self.disk.radius(a * self.disk.enclosed(EDGE * self.disk.length)).max(1e-4 * self.disk.length);
        let (s, co) = (sin(2.0 * PI * b), cos(2.0 * PI * b));
        let z = 0.5 * self.height * ln(c / (1.0 - c));
        let (v_sq, swing_sq) = (self.speed_sq(r), self.swing_sq(r));
        // 3.36 G Sigma/kappa: the scatter at which Toomre's Q is 1.
        let scatter = self.toomre * 3.36 * self.disk.surface(r) / swing_sq.sqrt();
        let d = 1e-2 * r;
        let steepness = r * (ln(self.swing_sq(r + d)) - ln(self.swing_sq(r - d))) / (2.0 * d);
        let ratio = swing_sq * r * r / (4.0 * v_sq);
        let mean_sq = v_sq + scatter * scatter * (1.0 - ratio - 3.0 * r / self.disk.length - steepness);
        let [e, f, g] = normal(random, id);
        let along = mean_sq.max(0.0).sqrt() + f * scatter * ratio.sqrt();
        let out = e * scatter;
        let up = g * (PI * self.disk.surface(r) * self.height).sqrt();
        (vector(r * co, r * s, z), vector(out * co - along * s, out * s + along * co, up))
    }
}

/// A star of Plummer's sphere: its place from the part of the mass within, its speed by von Neumann's rejection from
/// q² (1 - q²)^(7/2), q in units of the speed of escape.
fn in_sphere(random: &Random, id: u64, gm: f64, length: f64) -> (Vector, Vector) {
    let [a, b, c, _] = random.uniform(id, 0, PLACE).map(inside);
    // 99.9 % of the mass: a star that is a thousand radii away would only lengthen the pictures.
    let r = length / (pow(0.999 * a, -2.0 / 3.0) - 1.0).sqrt();
    let mut q = 0.0;
    for trial in 0..1000 {
        let [x, y, _, _] = random.uniform(id, trial, TRIAL);
        if 0.1 * y < x * x * pow(1.0 - x * x, 3.5) {
            q = x;
            break;
        }
    }
    let speed = q * (2.0 * gm / (r * r + length * length).sqrt()).sqrt();
    let [d, e, _, _] = random.uniform(id, 0, SPEED);
    (direction(b, c) * r, direction(d, e) * speed)
}

/// A direction from two numbers between 0 and 1.
fn direction(a: f64, b: f64) -> Vector {
    let z = 2.0 * a - 1.0;
    let r = (1.0 - z * z).sqrt();
    vector(r * cos(2.0 * PI * b), r * sin(2.0 * PI * b), z)
}

/// Three normal numbers of a star, by Box and Muller.
fn normal(random: &Random, id: u64) -> [f64; 3] {
    let [a, b, c, d] = random.uniform(id, 0, SPEED).map(inside);
    let (r, t) = ((-2.0 * ln(a)).sqrt(), (-2.0 * ln(c)).sqrt());
    [r * cos(2.0 * PI * b), r * sin(2.0 * PI * b), t * cos(2.0 * PI * d)]
}

/// Of 32 random bits, the middle of their interval: neither 0 nor 1.
fn inside(u: f64) -> f64 {
    u + 0.5 / 4_294_967_296.0
}

fn vector(x: f64, y: f64, z: f64) -> Vector {
    Vector { x, y, z }
}
