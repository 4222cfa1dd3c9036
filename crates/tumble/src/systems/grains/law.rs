//! The force of a contact.
//!
//!   F_n = 4/3 E* √R* δ^(3/2) + c_n δ',   F_t = k_t ξ + c_t ξ',   |F_t| <= mu F_n                                      (grains.1, grains.2)
//!
//! δ is the overlap and ξ the slip since contact began. A moment about the point of contact resists rolling and twisting as F_t resists slipping.
//!
//! Sources: [mindlin1949], [tsuji1992], [ai2011].

use crate::geometry::Friction;
use crate::math::{Lane, Vec3};
use tumble_interface::scene::NormalLaw;

/// What the surface of a grain, or of a solid, is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Young's modulus [Pa], infinite of what does not yield.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Coulomb friction.
    pub friction: Friction,
    /// Largest moments against rolling and twisting, over normal force and radius.
    pub resists: [f64; 2],
    /// Speed after a bounce over speed before.
    pub restitution: f64,
    /// Work of adhesion [J/m²].
    pub cohesion: f64,
}

/// Two materials that touch, in lanes of contacts or as numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair<L = f64> {
    law: NormalLaw,
    /// E* [Pa] of Hertz, or the compliances 1/(2 E) of both [1/Pa].
    elastic: L,
    compliance: [L; 2],
    /// Stiffness along the surface over that across it, 4 G*/E*, and the root of its product with the mass that a slip moves, over m*.
    shear: [L; 2],
    /// Damping over √(k m*).
    damping: L,
    /// Of what slides, and of what rests.
    pub(super) friction: [L; 2],
    pub(super) resists: [L; 2],
    cohesion: L,
    pub(super) restitution: L,
}

/// Numbers of a pair in lanes.
pub const NUMBERS: usize = 12;

/// Part of critical damping of what resists rolling and twisting.
const ROLLING: f64 = 0.3;
/// Moment of inertia of a ball over m R².
pub const BALL: f64 = 0.4;
/// Mass that a slip moves over m*: balls turn, too.
const SLIP: f64 = BALL / (1.0 + BALL);

/// What a contact remembers, of the second grain against the first: slip [m] and turn [rad]; by positions the impulse [N s] and the couple [N m s] that
/// the second had in the last step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Memory<L = f64> {
    pub slip: Vec3<L>,
    pub turn: Vec3<L>,
    /// 1 if friction gave way in the last step, 0 if it held.
    pub slides: L,
}

/// Two surfaces that overlap.
#[derive(Debug, Clone, Copy)]
pub struct Overlap<L = f64> {
    /// How deep [m].
    pub depth: L,
    /// From the first to the second.
    pub normal: Vec3<L>,
    /// Velocity of the second surface against the first at the point of contact [m/s], half a step before, and what it gains since.
    pub velocity: Vec3<L>,
    pub gain: Vec3<L>,
    /// Angular velocities of both [rad/s] half a step before, and what that of the second against the first gains since.
    pub spins: [Vec3<L>; 2],
    pub spin_gain: Vec3<L>,
    /// Radii [m]; infinite of what is flat.
    pub radii: [L; 2],
    /// R* [m], and the same of the distances of both centres from the point of contact.
    pub radius: L,
    pub lever: L,
    /// m1 m2/(m1 + m2) [kg], and one over it.
    pub mass: L,
    pub inverse_mass: L,
}

/// Force on the first [N], and its moment apart from that of the force [N m].
#[derive(Debug, Clone, Copy)]
pub struct Answer<L = f64> {
    pub force: Vec3<L>,
    pub moment: Vec3<L>,
}

/// Parts of critical damping by restitution: each is found once.
#[derive(Debug, Default)]
pub struct Dampings(Vec<(f64, f64)>);

impl Dampings {
    fn of(&mut self, law: NormalLaw, restitution: f64) -> f64 {
        if let Some((_, known)) = self.0.iter().find(|(e, _)| *e == restitution) {
            return *known;
        }
        self.0.push((restitution, damping(law, restitution)));
        self.of(law, restitution)
    }
}

impl Pair {
    /// Two materials under the law that the dampings are for.
    pub fn new(law: NormalLaw, a: &Material, b: &Material, dampings: &mut Dampings) -> Self {
        let sum = |of: fn(&Material) -> f64| of(a) + of(b);
        let elastic = 1.0 / sum(|m| (1.0 - m.poisson * m.poisson) / m.young);
        let rigidity = 1.0 / sum(|m| 2.0 * (2.0 - m.poisson) * (1.0 + m.poisson) / m.young);
        let larger = |of: fn(&Material) -> f64| of(a).max(of(b));
        let shear = 4.0 * rigidity / elastic;
        Self {
            law,
            elastic,
            compliance: [0.5 / a.young, 0.5 / b.young],
            shear: [shear, (SLIP * shear).sqrt()],
            damping: 2.0 * dampings.of(law, larger(|m| m.restitution)),
            friction: [larger(|m| m.friction.sliding), larger(|m| m.friction.resting)],
            resists: [larger(|m| m.resists[0]), larger(|m| m.resists[1])],
            cohesion: larger(|m| m.cohesion),
            restitution: larger(|m| m.restitution),
        }
    }

    /// The same with the friction of a solid at another time.
    pub fn with_friction(self, of: Friction) -> Self {
        let [sliding, resting] = self.friction;
        Self { friction: [sliding.max(of.sliding), resting.max(of.resting)], ..self }
    }

    /// Whether it needs more than the slip.
    pub fn resists_turns(&self) -> bool {
        self.resists != [0.0; 2]
    }

    /// The force of its contacts.
    pub fn law(&self) -> NormalLaw {
        self.law
    }

    /// Its numbers, for [`from_numbers`](Pair::from_numbers).
    pub fn numbers(&self) -> [f64; NUMBERS] {
        let Self { elastic, compliance: [a, b], shear: [c, d], damping, friction: [e, f], resists: [g, h], cohesion, restitution, .. } =
            *self;
        [elastic, a, b, c, d, damping, e, f, g, h, cohesion, restitution]
    }

    /// What a contact stores [J]; radii [m] are infinite of what is flat.
    pub fn energy(&self, depth: f64, radii: [f64; 2], memory: &Memory) -> f64 {
        let radius = if radii[1].is_finite() { radii[0] * radii[1] / (radii[0] + radii[1]) } else { radii[0] };
        let (force, stiffness) = self.elastic(depth, radii, radius);
        let part = if self.law == NormalLaw::Hertz { 0.4 } else { 0.5 };
        let pull = std::f64::consts::TAU * self.cohesion * radius;
        let along = 0.5 * self.shear[0] * stiffness * (memory.slip.norm_sq() + radius * radius * memory.turn.norm_sq());
        part * force * depth - pull * depth + along
    }
}

impl<L: Lane> Pair<L> {
    /// A pair from its numbers.
    #[inline(always)]
    pub fn from_numbers(law: NormalLaw, n: [L; NUMBERS]) -> Self {
        Self {
            law,
            elastic: n[0],
            compliance: [n[1], n[2]],
            shear: [n[3], n[4]],
            damping: n[5],
            friction: [n[6], n[7]],
            resists: [n[8], n[9]],
            cohesion: n[10],
            restitution: n[11],
        }
    }

    /// Elastic force [N] and its derivative [N/m] at an overlap [m] of radii with this R* [m].
    #[inline(always)]
    fn elastic(&self, depth: L, radii: [L; 2], radius: L) -> (L, L) {
        match self.law {
            NormalLaw::Hertz => {
                let stiffness = self.elastic * depth.like(2.0) * (radius * depth).sqrt();
                (stiffness * depth * depth.like(2.0 / 3.0), stiffness)
            }
            // Two springs one behind the other, each of 2 E R.
            NormalLaw::Linear => {
                let stiffness = depth.like(1.0) / (self.compliance[0] / radii[0] + self.compliance[1] / radii[1]);
                (stiffness * depth, stiffness)
            }
        }
    }

    /// The force on the first, and what the contact remembers after h [s]. Without `turns`, pairs resist none.
    #[inline(always)]
    pub fn answer(&self, at: &Overlap<L>, h: L, memory: &mut Memory<L>, turns: bool) -> Answer<L> {
        let n = at.normal;
        let (elastic, stiffness) = self.elastic(at.depth, at.radii, at.radius);
        let (away, gain) = (at.velocity.dot(n), at.gain.dot(n));
        let damping = self.damping * (stiffness * at.mass).sqrt();
        // The gain is by forces one and a half steps before; the contact's own have changed since.                  (grains.8)
        let late = h * h.like(1.5) * at.inverse_mass * (stiffness * h * h.like(0.5) * away + damping * gain);
        let press = (elastic - damping * (away + gain - late)).above_zero();
        let pull = self.cohesion * at.radius * h.like(std::f64::consts::TAU);
        let along = at.velocity - n * away;
        // Slip stays along the surface, and turns with the pair about its axis.
        let slip = memory.slip - n * memory.slip.dot(n);
        let mean = (at.spins[0].dot(n) + at.spins[1].dot(n)) * (h * h.like(0.5));
        let slip = slip + n.cross(slip) * mean + along * h;
        let shear = self.shear[0] * stiffness;
        let drag = (along + at.gain - n * gain) * (damping * self.shear[1]);
        let force = slip * shear + drag;
        // Cohesion presses surfaces together, too: friction follows the force without it. What slides goes on until sliding friction holds it.
        let [slides, rests] = self.friction;
        let (taken, limit) = (force.norm_sq(), memory.slides.positive(slides, rests) * press);
        let over = taken - limit * limit;
        let cut = over.positive(slides * press / taken.sqrt(), h.like(1.0));
        // Forces that are only evaluated anew decide nothing.
        memory.slides = over.positive(h.like(1.0), h.positive(h.zero(), memory.slides));
        let force = force * cut;
        // With the drag, so that forces of the same place and another velocity are at the limit, too.
        let inverse = h.like(1.0) / shear;
        memory.slip = Vec3 {
            x: over.positive(force.x * inverse, slip.x),
            y: over.positive(force.y * inverse, slip.y),
            z: over.positive(force.z * inverse, slip.z),
        };
        let moment = if turns { self.resist(at, h, memory, shear, press) } else { n * h.zero() };
        Answer { force: force - n * (press - pull), moment }
    }

    /// The moment against rolling, about the point of contact, and against twisting, about the line of centres.
    #[inline(always)]
    fn resist(&self, at: &Overlap<L>, h: L, memory: &mut Memory<L>, shear: L, press: L) -> Vec3<L> {
        let (n, one) = (at.normal, h.like(1.0));
        let rate = at.spins[1] - at.spins[0];
        let fast = rate + at.spin_gain;
        // The turn goes along with the pair.
        let mean = (at.spins[0] + at.spins[1]) * (h * h.like(0.5));
        let turn = memory.turn + mean.cross(memory.turn) + rate * h;
        let stiffness = shear * at.radius * at.radius;
        let drag = (shear * at.mass).sqrt() * at.radius * at.radius * h.like(2.0 * ROLLING);
        let levers = [at.lever, at.radius];
        let twist = [n * turn.dot(n), n * fast.dot(n)];
        let parts = [[turn - twist[0], fast - twist[1]], twist];
        let mut sum = n * h.zero();
        memory.turn = sum;
        for k in 0..2 {
            let [turn, rate] = parts[k];
            let moment = turn * stiffness + rate * drag;
            let limit = self.resists[k] * levers[k] * press;
            let taken = moment.norm_sq();
            let over = taken - limit * limit;
            // What gives way is not damped.
            let moment = moment * over.positive(limit / taken.sqrt(), one);
            let (inverse, held) = (one / stiffness, over.positive(one, h.zero()));
            sum = sum + moment;
            memory.turn = memory.turn + moment * (inverse * held) + turn * (one - held);
        }
        sum
    }
}

/// The longest step that resolves contact of grains of a material [s]: a fifth of the time in which a Rayleigh wave crosses half a grain, or a
/// twentieth of a bounce; less where dampers need shorter ones. A clump has contacts on so many `spheres`.             (grains.6)
pub fn longest_step(law: NormalLaw, material: &Material, radius: f64, density: f64, spheres: f64) -> f64 {
    use std::f64::consts::PI;
    /// Overlap over the radius up to which steps are to be stable.
    const DEEP: f64 = 0.05;
    let Material { young, poisson, restitution, .. } = material;
    let (resolved, stiffness) = match law {
        NormalLaw::Hertz => (
            0.2 * PI * radius * (2.0 * (1.0 + poisson) * density / young).sqrt() / (0.1631 * poisson + 0.8766),
            young / (1.0 - poisson * poisson) * radius * (0.5 * DEEP).sqrt(),
        ),
        NormalLaw::Linear => (0.05 * PI * radius * (2.0 / 3.0 * PI * density / young).sqrt(), young * radius),
    };
    let shear = 2.0 * (1.0 - poisson) / (2.0 - poisson);
    let mass = 4.0 / 3.0 * PI * density * radius.powi(3);
    resolved.min(stable(damping(law, *restitution) * spheres.sqrt(), shear) * (mass / stiffness).sqrt())
}

/// The longest stable step, over √(m/k), of a grain between others that all move, or all turn, against it. With forces by the velocities of half a
/// step before, ω² h² + 2 c h < 4.                                                                                   (grains.7)
fn stable(damping: f64, shear: f64) -> f64 {
    /// Contacts of a grain.
    const CONTACTS: f64 = 8.0;
    let c = 2.0 * damping * 0.5_f64.sqrt();
    let drag = c * (SLIP * shear).sqrt();
    // A third of contacts bears each direction, two thirds resist slips along it, or a turn about it.
    let moves = [1.0 + 2.0 * shear, c + 2.0 * drag].map(|sum| 2.0 / 3.0 * CONTACTS * sum);
    let turns = [shear, drag].map(|one| 4.0 / 3.0 * CONTACTS / BALL * one);
    let longest = |[k, c]: [f64; 2]| ((c * c + 4.0 * k).sqrt() - c) / k;
    longest(moves).min(longest(turns))
}

/// The part of critical damping that leaves this part of the speed after a bounce. The contact ends where its force does, so that it never pulls;
/// under both laws the part is the same at all speeds.                                                               (grains.3)
fn damping(law: NormalLaw, restitution: f64) -> f64 {
    /// Halvings of the interval that has it, and its end: there hardly 0.01 is left.
    const HALVINGS: u32 = 50;
    const LARGEST: f64 = 10.0;
    if restitution >= 1.0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, LARGEST);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if rebound(law, middle) > restitution { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Speed after a bounce over speed before, by the classical Runge-Kutta method in units of the contact.
fn rebound(law: NormalLaw, damping: f64) -> f64 {
    /// Short against the bounce, and against the decay by the strongest damping.
    const STEP: f64 = 1e-2;
    let force = |x: f64, v: f64| {
        let root = x.max(0.0).sqrt();
        match law {
            NormalLaw::Hertz => root * x.max(0.0) + 2.0 * damping * (1.5 * root).sqrt() * v,
            NormalLaw::Linear => x + 2.0 * damping * v,
        }
    };
    let (mut x, mut v) = (0.0, 1.0);
    loop {
        let (k1, l1) = (v, -force(x, v));
        let (k2, l2) = (v + 0.5 * STEP * l1, -force(x + 0.5 * STEP * k1, v + 0.5 * STEP * l1));
        let (k3, l3) = (v + 0.5 * STEP * l2, -force(x + 0.5 * STEP * k2, v + 0.5 * STEP * l2));
        let (k4, l4) = (v + STEP * l3, -force(x + STEP * k3, v + STEP * l3));
        let last = (x, v);
        x += STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        v += STEP / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
        if v < 0.0 && force(x, v) <= 0.0 {
            // Between the last two the force passes zero.
            let (before, after) = (force(last.0, last.1), force(x, v));
            return -(last.1 + (v - last.1) * before / (before - after));
        }
        if x > 1e3 || !x.is_finite() {
            return 0.0;
        }
    }
}
