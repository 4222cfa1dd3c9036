//! Contacts side by side in registers: blocks of manifolds that share no moving body. Manifolds are solved in the order of their pairs, those
//! side by side that do not depend on each other (level scheduling [anderson1989]), so that a load travels through a stack in one pass.
//!
//!   u = v_b + ω_b × r_b - v_a - ω_a × r_a,   n·u ≥ -gap/h  ⊥  p ≥ 0,   |d| ≤ μ p,   d ∥ -u_t where it slides                (rigid.4)
//!   and against rolling the angular impulse  |l| ≤ μ_r ρ p,   l ∥ -(ω_b - ω_a)_t where it rolls                              (rigid.6)
//!
//! Sources: sequential impulses and soft constraints [catto2009], small steps [macklin2019], the step along the slide back to the cone
//! [jourdan1998].

use super::body::Body;
use super::contact::Contact;
use super::lever::{FASTEST, Pace, Twist};
use crate::geometry::Vector;
use crate::math::parallel::Tasks;
use crate::math::simd::{self, Kernel, Width, dispatch_at};
use crate::math::{Lane, Vec3};
use std::ops::{Add, Div, Mul, Neg, Range, Sub};

/// Manifolds of a block: as many as a register of AVX2 holds, which compilers fill with these from plain loops.
const LANES: usize = 4;
/// Points of a manifold at most.
const POINTS: usize = 4;
/// Blocks per task.
const TASK: usize = 64;
/// Overlaps are mended as by springs of this frequency over that of sub-steps, twice as much against what nothing moves.
const MEND: f64 = 0.25;
/// Damping ratio of these.
const DAMPING: f64 = 10.0;

/// A number of each lane, in double precision in both engines.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(align(32))]
struct Wide([f64; LANES]);

macro_rules! operators {
    ($($trait:ident $method:ident $assign:tt),*) => {$(
        impl $trait for Wide {
            type Output = Self;
            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for l in 0..LANES {
                    self.0[l] $assign other.0[l];
                }
                self
            }
        }
    )*};
}
operators!(Add add +=, Sub sub -=, Mul mul *=, Div div /=);

impl Neg for Wide {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        for l in 0..LANES {
            self.0[l] = -self.0[l];
        }
        self
    }
}

impl Lane for Wide {
    #[inline(always)]
    fn like(self, c: f64) -> Self {
        Self([c; LANES])
    }
    #[inline(always)]
    fn sqrt(mut self) -> Self {
        for l in 0..LANES {
            self.0[l] = self.0[l].sqrt();
        }
        self
    }
    #[inline(always)]
    fn rsqrt(self) -> Self {
        Self([1.0; LANES]) / self.sqrt()
    }
    #[inline(always)]
    fn positive(self, mut then: Self, other: Self) -> Self {
        for l in 0..LANES {
            then.0[l] = if self.0[l] > 0.0 { then.0[l] } else { other.0[l] };
        }
        then
    }
    #[inline(always)]
    fn any_positive(self) -> bool {
        let mut any = false;
        for l in 0..LANES {
            any |= self.0[l] > 0.0;
        }
        any
    }
}

type Vectors = Vec3<Wide>;

#[inline(always)]
fn put(all: &mut Vectors, lane: usize, v: Vector) {
    (all.x.0[lane], all.y.0[lane], all.z.0[lane]) = (v.x, v.y, v.z);
}

#[inline(always)]
fn get(all: &Vectors, lane: usize) -> Vector {
    Vector { x: all.x.0[lane], y: all.y.0[lane], z: all.z.0[lane] }
}

/// Both bodies of each manifold, and what its points share.
#[derive(Clone, Default)]
struct Block {
    rows: [[u32; LANES]; 2],
    inverse_mass: [Wide; 2],
    /// In the axes of the world: xx, yy, zz, xy, yz, zx.
    inertia: [[Wide; 6]; 2],
    normal: Vectors,
    /// Across the normal; a second direction is across both.
    across: Vectors,
    /// Coulomb friction of what rests and of what slides.
    friction: [Wide; 2],
    /// Velocity of the second surface along the first by belts [m/s], in both directions.
    belt: [Wide; 2],
    /// Factors of a soft pass on the effective mass and on the accumulated impulse, where surfaces overlap.
    soft: [Wide; 2],
    /// Which manifolds, `NONE` where there is none.
    of: [u32; LANES],
    /// Its points, as many as the manifold with most of them has, and friction against rolling at them, if there is any.
    count: usize,
    points: [Point; POINTS],
    rolling: Vec<Rolling>,
}

const NONE: u32 = u32::MAX;

/// A point of each manifold of a block; where there is none its impulses are zero and stay so.
#[derive(Clone, Copy, Default)]
struct Point {
    arms: [Vectors; 2],
    /// 1/(n K n) [kg], zero where there is no point.
    mass: Wide,
    /// K between the normal and both directions across it [1/kg].
    aslant: [Wide; 2],
    /// Speed of approach that closes the gap [m/s], and that which a soft pass leaves: negative to part what overlaps.
    gap: Wide,
    left: Wide,
    /// Impulse along the normal [N s].
    press: Wide,
    friction: Friction,
}

/// Friction against rolling of a point.
#[derive(Clone, Copy, Default)]
struct Rolling {
    friction: Friction,
    /// Largest moment over the normal force [m].
    arm: Wide,
}

/// Impulses across the normal, both together at most in proportion to that along it.
#[derive(Clone, Copy, Default)]
struct Friction {
    /// The inverse of K across the normal: xx, yy, xy [kg], or [kg m²].
    inverse: [Wide; 3],
    /// 1 over the largest eigenvalue of K.
    slide: Wide,
    /// [N s], or [N m s].
    impulse: [Wide; 2],
}

impl Friction {
    /// With K across the normal: xx, yy, xy; where there is a point.
    #[inline(always)]
    fn prepare(&mut self, [xx, yy, xy]: [Wide; 3], there: Wide) {
        let (zero, one) = (there.zero(), there.like(1.0));
        let det = xx * yy - xy * xy;
        let over = there.positive(one / there.positive(det, one), zero);
        self.inverse = [yy * over, xx * over, -xy * over];
        let apart = xx - yy;
        let double = xx + yy + (apart * apart + xy * xy * xy.like(4.0)).sqrt();
        self.slide = there.positive(there.like(2.0) / there.positive(double, one), zero);
    }

    /// The change of impulses that speeds ask for, within Coulomb's cones of radii for what rests and for what moves.
    #[inline(always)]
    fn rub(&mut self, [x, y]: [Wide; 2], resting: Wide, moving: Wide) -> [Wide; 2] {
        let ([xx, yy, xy], [p, q]) = (self.inverse, self.impulse);
        let held = [p - (xx * x + xy * y), q - (xy * x + yy * y)];
        let slides = held[0] * held[0] + held[1] * held[1] - resting * resting;
        let mut new = held;
        if slides.any_positive() {
            // With the inverse of K, the impulse would not point against the slide: a step along that, and back to the cone.
            let slid = [p - self.slide * x, q - self.slide * y];
            let square = slid[0] * slid[0] + slid[1] * slid[1];
            let beyond = square - moving * moving;
            let length = beyond.positive(square, square.like(1.0)).sqrt();
            let part = beyond.positive(moving / length, square.like(1.0));
            new = [slides.positive(slid[0] * part, held[0]), slides.positive(slid[1] * part, held[1])];
        }
        self.impulse = new;
        [new[0] - p, new[1] - q]
    }
}

/// Velocities of the bodies of a block.
#[derive(Clone, Copy)]
struct Speeds {
    v: [Vectors; 2],
    w: [Vectors; 2],
}

impl Speeds {
    #[inline(always)]
    fn of(twists: &[Twist], rows: &[[u32; LANES]; 2]) -> Self {
        let mut speeds = Self { v: [Vectors::default(); 2], w: [Vectors::default(); 2] };
        for side in 0..2 {
            for l in 0..LANES {
                let twist = &twists[rows[side][l] as usize];
                put(&mut speeds.v[side], l, twist.v);
                put(&mut speeds.w[side], l, twist.w);
            }
        }
        speeds
    }

    #[inline(always)]
    fn give(&self, twists: &mut [Twist], rows: &[[u32; LANES]; 2]) {
        for side in 0..2 {
            for l in 0..LANES {
                let twist = &mut twists[rows[side][l] as usize];
                twist.v = get(&self.v[side], l);
                twist.w = get(&self.w[side], l);
            }
        }
    }

    /// Of the second point, seen from the first.
    #[inline(always)]
    fn at(&self, arms: &[Vectors; 2]) -> Vectors {
        self.v[1] + self.w[1].cross(arms[1]) - self.v[0] - self.w[0].cross(arms[0])
    }

    #[inline(always)]
    fn push(&mut self, block: &Block, arms: &[Vectors; 2], impulse: Vectors) {
        self.v[0] = self.v[0] - impulse * block.inverse_mass[0];
        self.v[1] = self.v[1] + impulse * block.inverse_mass[1];
        self.w[0] = self.w[0] - turned(&block.inertia[0], arms[0].cross(impulse));
        self.w[1] = self.w[1] + turned(&block.inertia[1], arms[1].cross(impulse));
    }

    #[inline(always)]
    fn turn(&mut self, block: &Block, impulse: Vectors) {
        self.w[0] = self.w[0] - turned(&block.inertia[0], impulse);
        self.w[1] = self.w[1] + turned(&block.inertia[1], impulse);
    }
}

#[inline(always)]
fn turned(inertia: &[Wide; 6], l: Vectors) -> Vectors {
    let [xx, yy, zz, xy, yz, zx] = *inertia;
    Vectors { x: xx * l.x + xy * l.y + zx * l.z, y: xy * l.x + yy * l.y + yz * l.z, z: zx * l.x + yz * l.y + zz * l.z }
}

impl Block {
    #[inline(always)]
    fn place(&mut self, bodies: &[Body], side: usize, lane: usize) {
        // The last row is the world's.
        let body = bodies.get(self.rows[side][lane] as usize).unwrap_or(&Body::WORLD);
        self.inverse_mass[side].0[lane] = body.inverse_mass;
        for (all, one) in self.inertia[side].iter_mut().zip(body.inverse_inertia) {
            all.0[lane] = one;
        }
    }

    /// K between two directions at a point.
    #[inline(always)]
    fn compliance(&self, arms: &[Vectors; 2], one: Vectors, two: Vectors) -> Wide {
        let mut sum = (self.inverse_mass[0] + self.inverse_mass[1]) * one.dot(two);
        for side in 0..2 {
            sum = sum + arms[side].cross(one).dot(turned(&self.inertia[side], arms[side].cross(two)));
        }
        sum
    }

    /// The same between two axes.
    #[inline(always)]
    fn turning(&self, one: Vectors, two: Vectors) -> Wide {
        one.dot(turned(&self.inertia[0], two)) + one.dot(turned(&self.inertia[1], two))
    }

    /// What passes need, from arms, gaps and what is at which place.
    #[inline(always)]
    fn prepare(&mut self, h: f64) {
        let (n, s) = (self.normal, self.across);
        let t = n.cross(s);
        let one = Wide([1.0; LANES]);
        // h ω of the springs: twice as stiff where one of both does not move.
        let rate = one.like(std::f64::consts::TAU * MEND);
        let both = self.inverse_mass[0] * self.inverse_mass[1];
        let rate = both.positive(rate, rate + rate);
        let damped = rate + one.like(2.0 * DAMPING);
        let left = one / (one + rate * damped);
        self.soft = [rate * damped * left, left];
        let (over, fastest) = (one.like(1.0 / h), one.like(-FASTEST));
        for k in 0..self.count {
            let arms = self.points[k].arms;
            let (normal, aslant) = (self.compliance(&arms, n, n), [self.compliance(&arms, n, s), self.compliance(&arms, n, t)]);
            let across = [self.compliance(&arms, s, s), self.compliance(&arms, t, t), self.compliance(&arms, s, t)];
            let point = &mut self.points[k];
            let there = point.mass;
            point.mass = there.positive(one / there.positive(normal, one), one.zero());
            point.aslant = aslant;
            point.friction.prepare(across, there);
            point.gap = point.gap * over;
            let mend = point.gap * rate / damped;
            point.left = point.gap.positive(point.gap, (mend - fastest).positive(mend, fastest));
        }
        if !self.rolling.is_empty() {
            let k = [self.turning(s, s), self.turning(t, t), self.turning(s, t)];
            for rolling in &mut self.rolling {
                rolling.friction.prepare(k, rolling.arm);
            }
        }
    }

    /// One pass over the points of a block.
    #[inline(always)]
    fn pass(&mut self, twists: &mut [Twist], soft: bool) {
        let mut speeds = Speeds::of(twists, &self.rows);
        let (n, s) = (self.normal, self.across);
        let t = n.cross(s);
        let one = Wide([1.0; LANES]);
        for k in 0..self.count {
            let point = &mut self.points[k];
            let u = speeds.at(&point.arms);
            let press = if soft {
                let [mass, left] = [point.gap.positive(one, self.soft[0]), point.gap.positive(one.zero(), self.soft[1])];
                point.press - point.mass * mass * (n.dot(u) + point.left) - left * point.press
            } else {
                point.press - point.mass * (n.dot(u) + point.gap.above_zero())
            };
            let press = press.above_zero();
            let change = press - point.press;
            point.press = press;
            // Speeds across, as they are after that.
            let u = [s.dot(u) + point.aslant[0] * change + self.belt[0], t.dot(u) + point.aslant[1] * change + self.belt[1]];
            let [p, q] = point.friction.rub(u, self.friction[0] * press, self.friction[1] * press);
            let arms = point.arms;
            speeds.push(self, &arms, n * change + s * p + t * q);
            if k < self.rolling.len() {
                let (w, most) = (speeds.w[1] - speeds.w[0], self.rolling[k].arm * press);
                let [p, q] = self.rolling[k].friction.rub([s.dot(w), t.dot(w)], most, most);
                speeds.turn(self, s * p + t * q);
            }
        }
        speeds.give(twists, &self.rows);
    }

    /// Gives bodies the impulses that points have.
    fn start(&self, twists: &mut [Twist]) {
        let mut speeds = Speeds::of(twists, &self.rows);
        let (n, s) = (self.normal, self.across);
        let t = n.cross(s);
        for point in &self.points[..self.count] {
            let [p, q] = point.friction.impulse;
            speeds.push(self, &point.arms, n * point.press + s * p + t * q);
        }
        for rolling in &self.rolling {
            let [p, q] = rolling.friction.impulse;
            speeds.turn(self, s * p + t * q);
        }
        speeds.give(twists, &self.rows);
    }
}

/// All contacts of a sub-step.
pub struct Blocks {
    /// By tasks.
    blocks: Vec<Vec<Block>>,
    /// Contacts of each manifold.
    manifolds: Vec<Range<usize>>,
}

/// Of a manifold: the number of others that it waits for, one after the other; points that it lacks; which one it is.
type Level = (u32, u32, u32);

impl Blocks {
    /// With the impulses that contacts have.
    pub fn new(bodies: &[Body], contacts: &[Contact], pace: &Pace) -> Self {
        let mut manifolds = Vec::new();
        let mut first = 0;
        for end in 1..=contacts.len() {
            let one = &contacts[first];
            if contacts.get(end).is_none_or(|c| c.pair != one.pair || c.normal != one.normal || end - first == POINTS) {
                manifolds.push(first..end);
                first = end;
            }
        }
        let order = levels(bodies, contacts, &manifolds);
        let groups: Vec<&[Level]> = order.chunk_by(|a, b| a.0 == b.0).flat_map(|level| level.chunks(LANES)).collect();
        let blocks = groups.chunks(TASK).map_in_parallel(|groups| {
            let mut blocks: Vec<Block> = groups.iter().map(|group| Block::new(bodies, contacts, &manifolds, group)).collect();
            dispatch_at(simd::Level::Avx2, Prepare { blocks: &mut blocks, h: pace.h });
            blocks
        });
        Self { blocks, manifolds }
    }

    /// The same contacts of bodies that have moved.
    pub fn moved(&mut self, bodies: &[Body], contacts: &[Contact]) {
        let manifolds = &self.manifolds;
        self.blocks.iter_mut().in_parallel(|blocks| blocks.iter_mut().for_each(|block| block.moved(bodies, contacts, manifolds)));
    }

    /// Gives bodies the impulses that contacts have.
    pub fn start(&self, twists: &mut [Twist]) {
        self.blocks.iter().flatten().for_each(|block| block.start(twists));
    }

    /// One pass over all contacts.
    pub fn pass(&mut self, twists: &mut [Twist], soft: bool) {
        dispatch_at(simd::Level::Avx2, Pass { blocks: &mut self.blocks, twists, soft });
    }

    /// What the passes have found.
    pub fn keep(&self, contacts: &mut [Contact]) {
        for block in self.blocks.iter().flatten() {
            for (lane, of) in block.lanes() {
                let [s, t] = across(get(&block.normal, lane));
                let sum = |[p, q]: [Wide; 2]| s * p.0[lane] + t * q.0[lane];
                let contacts = &mut contacts[self.manifolds[of].clone()];
                for (c, point) in contacts.iter_mut().zip(&block.points) {
                    (c.press, c.drag) = (point.press.0[lane], sum(point.friction.impulse));
                }
                for (c, rolling) in contacts.iter_mut().zip(&block.rolling) {
                    c.roll = sum(rolling.friction.impulse);
                }
            }
        }
    }
}

/// Manifolds by their levels, those with more points first.
fn levels(bodies: &[Body], contacts: &[Contact], manifolds: &[Range<usize>]) -> Vec<Level> {
    let mut reached = vec![0_u32; bodies.len()];
    let level = |(k, range): (usize, &Range<usize>)| {
        let pair = contacts[range.start].pair.map(|i| i as usize);
        let moves = |i: &usize| bodies[*i].inverse_mass > 0.0;
        let level = pair.iter().filter(|i| moves(i)).map(|i| reached[*i]).max().unwrap_or(0);
        pair.iter().filter(|i| moves(i)).for_each(|i| reached[*i] = level + 1);
        (level, (POINTS - range.len()) as u32, k as u32)
    };
    let mut order: Vec<Level> = manifolds.iter().enumerate().map(level).collect();
    order.sort_unstable();
    order
}

impl Block {
    fn new(bodies: &[Body], contacts: &[Contact], manifolds: &[Range<usize>], group: &[Level]) -> Self {
        let world = bodies.len() as u32;
        let count = POINTS - group[0].1 as usize;
        let mut block = Self { rows: [[world; LANES]; 2], of: [NONE; LANES], count, ..Self::default() };
        for (lane, (_, _, k)) in group.iter().enumerate() {
            let range = manifolds[*k as usize].clone();
            let one = &contacts[range.start];
            block.of[lane] = *k;
            for side in 0..2 {
                block.rows[side][lane] = one.pair[side];
                block.place(bodies, side, lane);
            }
            let [s, t] = across(one.normal);
            put(&mut block.normal, lane, one.normal);
            put(&mut block.across, lane, s);
            (block.friction[0].0[lane], block.friction[1].0[lane]) = (one.friction.resting, one.friction.sliding);
            (block.belt[0].0[lane], block.belt[1].0[lane]) = (one.belt.dot(s), one.belt.dot(t));
            if contacts[range.clone()].iter().any(|c| c.rolling > 0.0) {
                block.rolling.resize(count, Rolling::default());
            }
            for (rolling, c) in block.rolling.iter_mut().zip(&contacts[range.clone()]) {
                rolling.arm.0[lane] = c.rolling;
                (rolling.friction.impulse[0].0[lane], rolling.friction.impulse[1].0[lane]) = (c.roll.dot(s), c.roll.dot(t));
            }
            for (point, c) in block.points.iter_mut().zip(&contacts[range]) {
                for side in 0..2 {
                    put(&mut point.arms[side], lane, c.arms[side]);
                }
                (point.gap.0[lane], point.mass.0[lane], point.press.0[lane]) = (c.gap, 1.0, c.press);
                (point.friction.impulse[0].0[lane], point.friction.impulse[1].0[lane]) = (c.drag.dot(s), c.drag.dot(t));
            }
        }
        block
    }

    /// Its lanes, and the manifold of each.
    fn lanes(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        self.of.into_iter().enumerate().filter(|(_, of)| *of != NONE).map(|(lane, of)| (lane, of as usize))
    }

    fn moved(&mut self, bodies: &[Body], contacts: &[Contact], manifolds: &[Range<usize>]) {
        for (lane, of) in self.lanes() {
            let contacts = &contacts[manifolds[of].clone()];
            let pair @ [a, b] = contacts[0].pair.map(|i| &bodies[i as usize]);
            if a.inverse_mass == 0.0 || b.inverse_mass == 0.0 {
                continue;
            }
            self.place(bodies, 0, lane);
            self.place(bodies, 1, lane);
            for (point, c) in self.points.iter_mut().zip(contacts) {
                let arms = meeting(pair, [a.x, b.x], c.arms);
                put(&mut point.arms[0], lane, arms[0]);
                put(&mut point.arms[1], lane, arms[1]);
            }
        }
    }
}

/// Two directions across a normal.
pub fn across(n: Vector) -> [Vector; 2] {
    let least = if n.x.abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let s = n.cross(Vector::from(least)).normalized();
    [s, n.cross(s)]
}

/// Arms of a contact of two bodies at other places: it goes with the smaller one, and both still push at one point, so that no angular momentum is
/// lost.
pub fn meeting(pair: [&Body; 2], [a, b]: [Vector; 2], [ra, rb]: [Vector; 2]) -> [Vector; 2] {
    let [one, two] = pair.map(|body| body.inertia.iter().sum::<f64>());
    if one <= two { [ra, a + ra - b] } else { [b + rb - a, rb] }
}

struct Prepare<'a> {
    blocks: &'a mut [Block],
    h: f64,
}

impl Kernel for Prepare<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, _w: W) {
        for block in self.blocks {
            block.prepare(self.h);
        }
    }
}

struct Pass<'a> {
    blocks: &'a mut [Vec<Block>],
    twists: &'a mut [Twist],
    soft: bool,
}

impl Kernel for Pass<'_> {
    type Output = ();
    #[inline(always)]
    fn run<W: Width>(self, _w: W) {
        for blocks in self.blocks {
            for block in blocks {
                block.pass(self.twists, self.soft);
            }
        }
    }
}
