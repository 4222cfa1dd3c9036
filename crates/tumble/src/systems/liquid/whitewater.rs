//! Spray, foam and bubbles: what a liquid looks like where it takes up air. They have no mass, and move nothing.
//!
//!   n = I_k (r_a I_a + r_c I_c) h   a particle of the liquid and step                                                   (pic.14)
//!
//! I_k says how fast a particle is, I_a how much the liquid around runs together, I_c how sharp the crest is that it lies on, each from 0 to 1.
//! What is born is spray, foam or a bubble by its depth, and changes from one to another on its way.
//!
//! Source: [ihmsen2012]; sums there are means here, so that thresholds are velocities, and depths come from the surface.

use super::particles::Particles;
use super::paths::{GAP, go};
use super::stencil::Sampler;
use crate::fluids::Solids;
use crate::math::parallel::{CHUNK, Tasks, chunks};
use crate::math::{Random, Real};
use crate::state::{Field, Grid, Vectors};
use crate::system::{Archive, Part};
use tumble_interface::Column;

/// Depth of the layer in which there is foam, to both sides of the surface [cells].
const LAYER: Real = 0.5;
/// Reach of the kernel 1 - r [cells].
const REACH: Real = 1.0;
/// Distance from the surface up to which a particle may be on a crest [cells].
const CREST: Real = 1.0;
/// Cosine of the angle between velocity and normal from which a crest goes forward.
const FORWARD: Real = 0.6;
/// Part of the velocity of the liquid that what is born has to the side, at most.
const SIDEWAYS: f64 = 0.1;
/// Radius in pictures [cells].
const RADIUS: f64 = 0.06;

/// What a particle is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Kind {
    /// A drop that flies.
    #[default]
    Spray,
    /// On the surface.
    Foam,
    /// Below it.
    Bubble,
}

impl Kind {
    /// All of them, and what follows the name of the liquid in theirs.
    pub const ALL: [(Self, &str); 3] = [(Self::Spray, "spray"), (Self::Foam, "foam"), (Self::Bubble, "bubbles")];

    /// At a distance from the surface [cells], which is negative below it.
    fn at(distance: Real) -> Self {
        if distance > LAYER {
            Self::Spray
        } else if distance < -LAYER {
            Self::Bubble
        } else {
            Self::Foam
        }
    }
}

/// Constant settings. Pairs are where a potential begins and where it is full.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Particles that one of the liquid gives, at most, where it traps air and on crests [1/s].
    pub rates: [f64; 2],
    /// By the speed [m/s].
    pub speed: [f64; 2],
    /// By how fast the liquid around runs together [m/s].
    pub trapped: [f64; 2],
    /// By how much the normals around differ.
    pub crest: [f64; 2],
    /// How long foam lives [s]: at least, at most.
    pub life: [f64; 2],
    /// How fast bubbles rise [m/s].
    pub rise: f64,
    /// How many there are at most; beyond, the oldest go.
    pub limit: usize,
}

#[derive(Debug, Clone, Copy, Default)]
struct Drop {
    /// Place [cells] and velocity [m/s].
    x: [Real; 3],
    v: [Real; 3],
    /// Time since its birth, and time that it may still be foam [s].
    age: Real,
    left: Real,
    kind: Kind,
    id: u32,
}

/// The spray, foam and bubbles of a liquid.
pub struct Whitewater {
    settings: Settings,
    random: Random,
    drops: Vec<Drop>,
    next: u32,
    steps: u32,
}

/// The liquid that they are in.
pub struct Around<'a> {
    /// Its particles, sorted.
    pub particles: &'a Particles,
    /// How many of them lay along the edge of a cell at the start.
    pub sampling: u32,
    /// Distance of cells from its surface [cells].
    pub distance: &'a Field,
    /// Velocity at faces, beyond the surface, too [m/s].
    pub u: &'a Vectors,
    /// What it flows around.
    pub solids: Option<&'a Solids>,
    /// Gravity [m/s²].
    pub gravity: [f64; 3],
}

impl Around<'_> {
    fn grid(&self) -> &Grid {
        &self.distance.grid
    }
}

impl Whitewater {
    /// None yet.
    pub fn new(settings: Settings, random: Random) -> Self {
        Self { settings, random, drops: Vec::new(), next: 0, steps: 0 }
    }

    /// Moves them for h seconds, lets foam burst that has lived its time, and adds what is born.
    pub fn step(&mut self, around: &Around<'_>, h: f64) {
        self.carry(around, h);
        self.drops.retain(|drop| drop.left > 0.0);
        let born = self.births(around, h);
        for drop in born {
            self.drops.push(Drop { id: self.next, ..drop });
            self.next = self.next.wrapping_add(1);
        }
        let over = self.drops.len().saturating_sub(self.settings.limit);
        self.drops.drain(..over);
        self.steps = self.steps.wrapping_add(1);
    }

    fn carry(&mut self, around: &Around<'_>, h: f64) {
        let (grid, gravity) = (*around.grid(), around.gravity.map(|g| g as Real));
        let (time, pace) = (h as Real, (h / grid.dx) as Real);
        let (velocity, distance) = (Sampler::new(around.u), Sampler::one(around.distance));
        let g = gravity.iter().map(|g| g * g).sum::<Real>().sqrt();
        let up = if g > 0.0 { gravity.map(|c| -c / g * self.settings.rise as Real) } else { [0.0; 3] };
        chunks(&mut self.drops, |_, drops| {
            for drop in drops {
                drop.age += time;
                match drop.kind {
                    // The mean velocity of the step, and that of its end after it.
                    Kind::Spray => grid.axes().for_each(|a| drop.v[a] += 0.5 * time * gravity[a]),
                    Kind::Foam => {
                        drop.v = velocity.read(&drop.x);
                        drop.left -= time;
                    }
                    Kind::Bubble => {
                        let u = velocity.read(&drop.x);
                        grid.axes().for_each(|a| drop.v[a] = u[a] + up[a]);
                    }
                }
                let before = drop.x;
                go(around.solids, &grid, &mut drop.x, &drop.v.map(|v| pace * v));
                if drop.kind == Kind::Spray {
                    grid.axes().for_each(|a| drop.v[a] += 0.5 * time * gravity[a]);
                    if stop(around.solids, &grid, drop, &before, pace) {
                        drop.left -= time;
                    }
                }
                drop.kind = Kind::at(distance.read(&drop.x)[0]);
            }
        });
    }

    /// What is born in h seconds, in the order of the particles.
    fn births(&self, around: &Around<'_>, h: f64) -> Vec<Drop> {
        let (particles, distance) = (around.particles, Sampler::one(around.distance));
        let rows = (0..particles.count().div_ceil(CHUNK)).map(|task| task * CHUNK..((task + 1) * CHUNK).min(particles.count()));
        rows.map_in_parallel(|rows| {
            let mut born = Vec::new();
            for row in rows {
                let rate = self.rate(around, &distance, row);
                if rate > 0.0 {
                    let n = rate * h + self.random.quick(particles.id[row], self.steps);
                    born.extend((0..n as u32).map(|k| self.birth(around, &distance, row, h, k)));
                }
            }
            born
        })
        .concat()
    }

    /// How many a particle gives in a second.                                                                       (pic.14)
    fn rate(&self, around: &Around<'_>, distance: &Sampler<'_>, row: usize) -> f64 {
        let Settings { rates, speed, trapped, crest, .. } = &self.settings;
        let (x, v) = (&around.particles.x[row], &around.particles.v[row]);
        let pace = norm(v);
        let fast = ramp(f64::from(pace), speed);
        if fast == 0.0 {
            return 0.0;
        }
        let (phi, slope) = distance.with_gradient(x);
        let normal = unit(&slope[0]);
        let forward = phi[0].abs() < CREST && dot(v, &normal) >= FORWARD * pace;
        let (mut sum, mut closing, mut bend) = (0.0, 0.0, 0.0);
        let n = around.grid().n;
        let cells = |a: usize| {
            let at = |x: Real| (x.max(0.0) as usize).min(n[a] - 1);
            at(x[a] - REACH)..at(x[a] + REACH) + 1
        };
        let along = cells(0);
        for k in cells(2) {
            for j in cells(1) {
                let number = |i: usize| i + n[0] * (j + n[1] * k);
                let others = around.particles.between(number(along.start), number(along.end));
                for (other, w) in around.particles.x[others.clone()].iter().zip(&around.particles.v[others]) {
                    let apart: [Real; 3] = std::array::from_fn(|a| x[a] - other[a]);
                    let far = norm(&apart);
                    if far == 0.0 || far >= REACH {
                        continue;
                    }
                    let weight = 1.0 - far / REACH;
                    let relative: [Real; 3] = std::array::from_fn(|a| v[a] - w[a]);
                    sum += weight;
                    closing += weight * (norm(&relative) - dot(&relative, &apart) / far);
                    // Those behind a convex surface.
                    if forward && dot(&apart, &normal) > 0.0 {
                        bend += weight * (1.0 - dot(&normal, &unit(&distance.with_gradient(other).1[0])));
                    }
                }
            }
        }
        if sum == 0.0 {
            return 0.0;
        }
        let mean = |total: Real| f64::from(total / sum);
        fast * (rates[0] * ramp(mean(closing), trapped) + if forward { rates[1] * ramp(mean(bend), crest) } else { 0.0 })
    }

    /// The k-th that a particle gives, in the cylinder through which it has come.
    fn birth(&self, around: &Around<'_>, distance: &Sampler<'_>, row: usize, h: f64, k: u32) -> Drop {
        let (grid, particles) = (around.grid(), around.particles);
        let [turn, out, back, luck] = self.random.uniform(u64::from(particles.id[row]), self.steps, 1 + k);
        let (x, v) = (particles.x[row].map(f64::from), particles.v[row].map(f64::from));
        let speed = v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let along = v.map(|v| v / speed);
        let (first, second) = across(&along, grid.flat);
        let (angle, out) = (std::f64::consts::TAU * turn, out.sqrt());
        let side: [f64; 3] =
            std::array::from_fn(|a| out * (crate::math::functions::cos(angle) * first[a] + crate::math::functions::sin(angle) * second[a]));
        let radius = 0.5 / f64::from(around.sampling);
        let [low, high] = self.settings.life;
        let mut drop = Drop {
            x: std::array::from_fn(|a| (x[a] - back * h * v[a] / grid.dx) as Real),
            v: std::array::from_fn(|a| (v[a] + SIDEWAYS * speed * side[a]) as Real),
            age: 0.0,
            left: (low + luck * (high - low)) as Real,
            ..Drop::default()
        };
        go(around.solids, grid, &mut drop.x, &side.map(|s| (radius * s) as Real));
        drop.kind = Kind::at(distance.read(&drop.x)[0]);
        drop
    }
}

impl Whitewater {
    /// The named columns that they have, an object for each kind.
    pub fn columns(&self, liquid: &str, place: impl Fn(&[Real; 3]) -> [f64; 3], names: &[&str], out: &mut Vec<Column>) {
        for (kind, word) in Kind::ALL {
            let (object, own) = (format!("{liquid}.{word}"), || self.drops.iter().filter(move |drop| drop.kind == kind));
            out.push(Column::new(&object, "id", own().map(|drop| drop.id).collect::<Vec<u32>>()));
            out.push(Column::new(&object, "age", own().map(|drop| drop.age).collect::<Vec<Real>>()));
            for name in names {
                let data: Vec<Real> = match *name {
                    "position" => own().flat_map(|drop| place(&drop.x).map(|c| c as Real)).collect(),
                    "velocity" => own().flat_map(|drop| drop.v).collect(),
                    _ => continue,
                };
                out.push(Column::new(&object, name, data));
            }
        }
    }

    /// Radius in pictures [m], in a liquid of cells of dx [m].
    pub fn radius(dx: f64) -> f64 {
        RADIUS * dx
    }

    /// What does not change.
    pub fn topology(&self, liquid: &str, dx: f64, out: &mut Vec<Column>) {
        out.extend(Kind::ALL.map(|(_, word)| Column::new(&format!("{liquid}.{word}"), "radius", vec![Self::radius(dx)])));
    }

    /// Writes everything that the next step depends on.
    pub fn save(&self, archive: &mut Archive) {
        let rows = self
            .drops
            .iter()
            .flat_map(|drop| [drop.x, drop.v, [drop.age, drop.left, Kind::ALL.iter().position(|k| k.0 == drop.kind).unwrap_or(0) as Real]]);
        archive.push("whitewater", Part::Table(9, rows.flatten().collect()));
        archive.push_indices("whitewater numbers", &self.drops.iter().map(|drop| drop.id).chain([self.next, self.steps]).collect());
    }

    /// Reads it back.
    pub fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        let (table, numbers) = (archive.table_of(9, "whitewater")?, archive.indices("whitewater numbers")?);
        let (ids, [next, steps]) = numbers.split_last_chunk()?;
        (table.len() == 9 * ids.len()).then_some(())?;
        (self.next, self.steps) = (*next, *steps);
        let row = |(row, id): (&[Real; 9], &u32)| {
            let [x0, x1, x2, v0, v1, v2, age, left, kind] = *row;
            let (kind, _) = Kind::ALL[(kind.max(0.0) as usize).min(2)];
            Drop { x: [x0, x1, x2], v: [v0, v1, v2], age, left, kind, id: *id }
        };
        self.drops = table.as_chunks::<9>().0.iter().zip(ids).map(row).collect();
        Some(())
    }
}

/// Takes the part of a drop's velocity that leads into a side or a solid; whether it lies on one.
fn stop(solids: Option<&Solids>, grid: &Grid, drop: &mut Drop, before: &[Real; 3], pace: Real) -> bool {
    let mut lies = false;
    for a in grid.axes() {
        let free = before[a] + pace * drop.v[a];
        if !(free > GAP && free < grid.n[a] as Real - GAP) && (free - 0.5 * grid.n[a] as Real) * drop.v[a] > 0.0 {
            drop.v[a] = 0.0;
            lies = true;
        }
    }
    if let Some(solids) = solids {
        let (distance, normal) = solids.near(&drop.x);
        let into = dot(&drop.v, &normal);
        if distance < 2.0 * GAP * grid.dx as Real && into < 0.0 {
            (0..3).for_each(|a| drop.v[a] -= into * normal[a]);
            lies = true;
        }
    }
    lies
}

/// From 0 to 1 between two values.
fn ramp(x: f64, [low, high]: &[f64; 2]) -> f64 {
    ((x - low) / (high - low)).clamp(0.0, 1.0)
}

fn dot(a: &[Real; 3], b: &[Real; 3]) -> Real {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: &[Real; 3]) -> Real {
    dot(a, a).sqrt()
}

/// Its direction; zero has none.
fn unit(a: &[Real; 3]) -> [Real; 3] {
    let length = norm(a);
    if length > 0.0 { a.map(|c| c / length) } else { [0.0; 3] }
}

/// Two directions across a direction, and each other; in a plane, the one in it.
fn across(along: &[f64; 3], flat: Option<usize>) -> ([f64; 3], [f64; 3]) {
    let cross = |a: &[f64; 3], b: &[f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let axis = |a: usize| std::array::from_fn(|b| if a == b { 1.0 } else { 0.0 });
    if let Some(flat) = flat {
        return (cross(along, &axis(flat)), [0.0; 3]);
    }
    let least = (1..3).fold(0, |least, a| if along[a].abs() < along[least].abs() { a } else { least });
    let first = cross(along, &axis(least));
    let length = first.iter().map(|c| c * c).sum::<f64>().sqrt();
    let first = first.map(|c| c / length);
    (first, cross(along, &first))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Place;

    /// A liquid of 16 cells a side, of one metre each, by its distance and velocity at places [cells], and particles.
    struct Sea {
        particles: Particles,
        distance: Field,
        u: Vectors,
    }

    impl Sea {
        fn new(distance: impl Fn([f64; 3]) -> f64, u: [Real; 3], particles: &[([Real; 3], [Real; 3])]) -> Self {
            let grid = Grid::new([16; 3], 1.0, [0.0; 3]).unwrap();
            let mut field = Field::new(grid, Place::Cell, "1").unwrap();
            for at in field.each().collect::<Vec<_>>() {
                let i = field.index(at);
                field.data[i] = distance(at.map(|i| i as f64 + 0.5)).clamp(-1.5, 1.5) as Real;
            }
            let mut faces = Vectors::faces(grid, "m/s").unwrap();
            faces.parts.iter_mut().zip(u).for_each(|(part, u)| part.data.fill(u));
            let mut particles = Particles::new(particles.iter().map(|p| p.0).collect(), particles.iter().map(|p| p.1).collect(), false);
            particles.sort(grid.n);
            Self { particles, distance: field, u: faces }
        }

        fn run(&self, white: &mut Whitewater, steps: usize, h: f64) {
            let Self { particles, distance, u } = self;
            let around = Around { particles, sampling: 2, distance, u, solids: None, gravity: [0.0, 0.0, -8.0] };
            (0..steps).for_each(|_| white.step(&around, h));
        }
    }

    fn settings() -> Settings {
        Settings { rates: [0.0; 2], speed: [0.0, 4.0], trapped: [0.0, 16.0], crest: [0.0, 1.0], life: [1.0, 3.0], rise: 0.5, limit: 1000 }
    }

    fn of(settings: Settings, drops: Vec<Drop>) -> Whitewater {
        Whitewater { drops, ..Whitewater::new(settings, Random::new(1, "sea")) }
    }

    fn one(kind: Kind, v: [Real; 3]) -> Whitewater {
        of(settings(), vec![Drop { x: [3.0, 8.0, 4.0], v, left: 9.0, kind, ..Drop::default() }])
    }

    #[test]
    fn spray_flies_bubbles_rise_and_foam_goes_along() {
        let (air, deep, surface) = (|_: [f64; 3]| 1.5, |_: [f64; 3]| -1.5, |_: [f64; 3]| 0.0);
        let near = |white: &Whitewater, x: [Real; 3], v: [Real; 3], kind: Kind| {
            let drop = white.drops[0];
            let far = |a: [Real; 3], b: [Real; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, Real::max);
            assert!(far(drop.x, x) < 1e-4 && far(drop.v, v) < 1e-4 && drop.kind == kind && (drop.age - 0.5).abs() < 1e-5, "{drop:?}");
        };
        let mut spray = one(Kind::Spray, [2.0, 0.0, 6.0]);
        Sea::new(air, [9.0; 3], &[]).run(&mut spray, 10, 0.05);
        near(&spray, [4.0, 8.0, 6.0], [2.0, 0.0, 2.0], Kind::Spray);
        let mut bubble = one(Kind::Bubble, [0.0; 3]);
        Sea::new(deep, [1.0, 0.0, 0.25], &[]).run(&mut bubble, 10, 0.05);
        near(&bubble, [3.5, 8.0, 4.375], [1.0, 0.0, 0.75], Kind::Bubble);
        let mut foam = one(Kind::Foam, [0.0; 3]);
        Sea::new(surface, [1.0, -2.0, 0.0], &[]).run(&mut foam, 10, 0.05);
        near(&foam, [3.5, 7.0, 4.0], [1.0, -2.0, 0.0], Kind::Foam);
    }

    #[test]
    fn kinds_change_with_the_depth() {
        // The surface is at z = 8: a bubble rises to it and lives as foam; a drop falls on it and is foam, too.
        let sea = Sea::new(|x| x[2] - 8.0, [0.0; 3], &[]);
        let mut white = of(settings(), vec![Drop { x: [8.0, 8.0, 7.0], left: 9.0, kind: Kind::Bubble, ..Drop::default() }]);
        let mut seen = Vec::new();
        for _ in 0..40 {
            sea.run(&mut white, 1, 0.05);
            seen.push(white.drops[0].kind);
        }
        assert!(seen[0] == Kind::Bubble && seen[39] == Kind::Foam, "{seen:?}");
        let mut white = of(settings(), vec![Drop { x: [8.0, 8.0, 11.0], v: [0.0, 0.0, -20.0], left: 9.0, ..Drop::default() }]);
        sea.run(&mut white, 2, 0.05);
        assert_eq!(white.drops[0].kind, Kind::Spray);
        sea.run(&mut white, 4, 0.05);
        assert_eq!((white.drops[0].kind, white.drops[0].v), (Kind::Foam, [0.0; 3]));
    }

    #[test]
    fn spray_lies_on_sides_until_it_has_lived_its_time() {
        let mut white = of(settings(), vec![Drop { x: [8.0, 8.0, 1.0], left: 1.0, ..Drop::default() }]);
        let sea = Sea::new(|_| 1.5, [0.0; 3], &[]);
        sea.run(&mut white, 14, 0.05);
        let drop = white.drops[0];
        assert!(drop.x[2] < 0.01 && drop.v[2] > -0.5 && drop.left < 1.0, "{drop:?}");
        sea.run(&mut white, 20, 0.05);
        assert!(white.drops.is_empty());
    }

    /// Those that are born in a second from two particles half a cell apart, with these velocities along x.
    fn born(left: Real, right: Real, steps: usize) -> Whitewater {
        let pair = [([8.0, 8.0, 4.0], [left, 0.0, 0.0]), ([8.5, 8.0, 4.0], [right, 0.0, 0.0])];
        let mut white = of(Settings { rates: [1000.0, 0.0], life: [10.0, 10.0], ..settings() }, Vec::new());
        Sea::new(|_| -1.5, [0.0; 3], &pair).run(&mut white, steps, 1.0 / steps as f64);
        white
    }

    #[test]
    fn as_many_are_born_as_the_potentials_say() {
        // Half of the speed, and 8 m/s of 16 m/s of running together: a quarter of 1000 a second from each of two.
        for steps in [10, 100, 400] {
            let n = born(2.0, -2.0, steps).drops.len() as f64;
            // At each step and particle the part is rounded up or down by chance.
            let spread = 4.0 * (0.25 * 2.0 * steps as f64).sqrt();
            assert!((n - 500.0).abs() <= spread, "{steps}: {n}");
        }
        assert!(born(-2.0, 2.0, 100).drops.is_empty() && born(2.0, 2.0, 100).drops.is_empty());
        let (a, b) = (born(2.0, -2.0, 50), born(2.0, -2.0, 50));
        assert!(a.drops.iter().zip(&b.drops).all(|(a, b)| a.x == b.x && a.left == b.left && a.id == b.id));
    }

    #[test]
    fn crests_that_go_forward_give_foam_and_a_smooth_sea_none() {
        let crest = |distance: &dyn Fn([f64; 3]) -> f64, v: Real| {
            // Half a cell around (8, 8, 8), all at the same velocity.
            let points = (0..27).map(|i| [i % 3, i / 3 % 3, i / 9].map(|k| 7.5 + 0.25 * k as Real));
            let particles: Vec<_> = points.map(|x| (x, [v, 0.0, v])).collect();
            let mut white = of(Settings { rates: [1000.0, 1000.0], ..settings() }, Vec::new());
            Sea::new(distance, [0.0; 3], &particles).run(&mut white, 10, 0.01);
            white.drops.len()
        };
        let edge = |x: [f64; 3]| (x[0] - 8.0).max(x[2] - 8.0);
        let flat = |x: [f64; 3]| ((x[0] - 8.0) + (x[2] - 8.0)) / 2.0_f64.sqrt();
        assert!(crest(&edge, 2.0) > 30, "{}", crest(&edge, 2.0));
        assert_eq!((crest(&edge, -2.0), crest(&flat, 2.0)), (0, 0));
    }

    /// Only neighbours behind the tangent plane count: around a ridge they lie there, in a trough as sharp they lie before it.
    #[test]
    fn ridges_are_crests_and_troughs_are_none() {
        let drops = |bend: f64| {
            let height = |x: f64| 8.0 - 0.5 * bend * (x - 8.5) * (x - 8.5);
            let points = (0..9).map(|i| [8.1 + 0.4 * f64::from(i % 3), 7.6 + 0.4 * f64::from(i / 3)]);
            let particles: Vec<_> = points.map(|[x, y]| ([x, y, height(x)].map(|x| x as Real), [0.0, 0.0, 2.0])).collect();
            let mut white = of(Settings { rates: [0.0, 1000.0], ..settings() }, Vec::new());
            Sea::new(|x| x[2] - height(x[0]), [0.0; 3], &particles).run(&mut white, 10, 0.01);
            white.drops.len()
        };
        let (ridge, trough) = (drops(1.0), drops(-1.0));
        assert!(ridge > 30 && trough == 0, "{ridge} {trough}");
    }

    #[test]
    fn they_are_born_in_the_cylinder_that_a_particle_has_come_through() {
        let pair = [([8.0, 8.0, 4.0], [2.0, 0.0, 0.0]), ([8.5, 8.0, 4.0], [-2.0, 0.0, 0.0])];
        let mut white = of(Settings { rates: [1e5, 0.0], limit: 10_000, ..settings() }, Vec::new());
        Sea::new(|_| -1.5, [0.0; 3], &pair).run(&mut white, 1, 0.05);
        assert!(white.drops.len() > 2000, "{}", white.drops.len());
        let (mut squares, mut widest, mut sideways) = (0.0, 0.0_f64, 0.0_f64);
        for Drop { x, v, kind, .. } in &white.drops {
            let along = if v[0] > 0.0 { 8.0 - x[0] } else { x[0] - 8.5 };
            assert!(*kind == Kind::Bubble && (v[0].abs() - 2.0).abs() < 1e-6 && (-1e-5..0.10001).contains(&along), "{x:?} {v:?} {kind:?}");
            let out = f64::from((x[1] - 8.0).hypot(x[2] - 4.0));
            squares += out * out;
            widest = widest.max(out);
            sideways = sideways.max(f64::from(v[1].hypot(v[2])));
        }
        // A disk of half the distance of particles, evenly, and a tenth of the speed.
        let mean = squares / white.drops.len() as f64 / (0.25 * 0.25);
        assert!((mean - 0.5).abs() < 0.03 && widest > 0.24 && widest < 0.2501, "{mean} {widest}");
        assert!(sideways > 0.19 && sideways < 0.2001, "{sideways}");
    }

    #[test]
    fn foam_bursts_in_its_time_and_the_oldest_make_room() {
        let mut white = of(Settings { limit: 300, ..settings() }, born(2.0, -2.0, 100).drops);
        let (first, last) = (white.drops[0].id, white.drops.last().unwrap().id);
        let sea = Sea::new(|_| 0.0, [0.0; 3], &[]);
        sea.run(&mut white, 1, 1e-3);
        assert!(white.drops.len() == 300 && white.drops[0].id > first && white.drops.last().unwrap().id == last);
        let lives = [1.5, 2.5].map(|left| Drop { left, kind: Kind::Foam, ..white.drops[0] });
        let mut white = of(settings(), lives.to_vec());
        let counts = [0; 3].map(|_| {
            sea.run(&mut white, 10, 0.1);
            white.drops.len()
        });
        assert_eq!(counts, [2, 1, 0]);
    }

    #[test]
    fn a_snapshot_has_all_of_them() {
        let white = born(2.0, -2.0, 50);
        let mut archive = Archive::default();
        white.save(&mut archive);
        archive.rewind();
        let mut other = of(white.settings.clone(), Vec::new());
        other.restore(&mut archive).unwrap();
        let sea = Sea::new(|x| x[2] - 8.0, [1.0, 0.0, 0.0], &[([8.0, 8.0, 4.0], [2.0, 0.0, 0.0]), ([8.5, 8.0, 4.0], [-2.0, 0.0, 0.0])]);
        let mut white = white;
        [&mut white, &mut other].into_iter().for_each(|white| sea.run(white, 10, 0.01));
        assert!(white.drops.len() > 500 && white.drops.len() == other.drops.len());
        assert!(white.drops.iter().zip(&other.drops).all(|(a, b)| a.x == b.x && a.kind == b.kind && a.id == b.id && a.left == b.left));
    }
}
