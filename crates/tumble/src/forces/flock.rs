//! Flocks: birds, fish, herds that steer by their neighbours.

use super::Rows;
use crate::elements::{Batch, Block, Weights};
use crate::geometry::{Collider, Meet, Neighbours, Vector};
use crate::math::parallel::{chunks, sum};
use crate::math::{Lane, Real, Row, Vec3, xyz64};
use crate::state::Masses;
use std::ops::Range;
use std::sync::Arc;
use tumble_interface::scene::Hessian;

/// How a flock behaves. Urges are accelerations; each has its own strength, and their sum is bounded.
///
/// Sources: [reynolds1987], [reynolds1999]; the nearest k as neighbours, [ballerini2008].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Habits {
    /// Distance up to which others are seen, R [m].
    pub radius: f64,
    /// Heeds only this many, the nearest; 0 heeds all within the radius.
    pub nearest: usize,
    /// Cosine of half the field of view; -1 and below sees all around.
    pub view: f64,
    /// Towards the centre of the neighbours [1/s²].
    pub cohesion: f64,
    /// Towards their average velocity [1/s].
    pub alignment: f64,
    /// Away from each of them [m/s²] within `spacing` [m].
    pub separation: f64,
    /// [m].
    pub spacing: f64,
    /// Cruising speed [m/s].
    pub speed: f64,
    /// Rate at which it is taken up [1/s].
    pub propulsion: f64,
    /// Bound of the acceleration [m/s²].
    pub limit: f64,
    /// Places that attract.
    pub goals: Vec<Goal>,
    /// Away from solids [m/s²] within `clearance` [m].
    pub avoidance: f64,
    /// [m].
    pub clearance: f64,
    /// Away from predators [m/s²] within `fear_radius` [m].
    pub fear: f64,
    /// [m].
    pub fear_radius: f64,
    /// Of predators, towards the prey [m/s²].
    pub chase: f64,
    /// Cruising speed of predators [m/s].
    pub predator_speed: f64,
}

/// A place that attracts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// The place [m].
    pub point: Vector,
    /// Acceleration towards it far away [m/s²].
    pub strength: f64,
}

/// Steering by neighbours: a force that drives. It has no energy, and no momentum is kept.
///
///   w = (1 - r²/R²)² s,   W = sum w,   a = kc sum w d/W + ka sum w (v_j - v)/W - ks sum e (1 - e²)²/(e² + 0.01) + ...   (flocks.1)
///
/// Everything fades to zero at its radius, so that the right-hand side is continuous and integrators keep their order.
/// Degenerate: two in one place do not see each other. Who is not finite is not seen and does not steer.
pub struct Flock {
    habits: Habits,
    prey: Rows,
    predators: Rows,
    mass: Vec<Real>,
    predator_mass: Vec<Real>,
    colliders: Arc<Vec<Collider>>,
    /// Time of the forces [s].
    time: f64,
    grid: Neighbours,
    /// Positions and velocities of prey that do not lie side by side.
    copies: [Vec<Row>; 2],
    hunters: [Vec<Row>; 2],
    numbers: Vec<[Real; 6]>,
    seeing: Vec<[Real; 10]>,
    sums: Vec<[Real; 10]>,
    /// Accelerations, place by place [m/s²].
    urges: Vec<Row>,
    chases: Vec<Row>,
    weights: Weights,
}

/// x, v -> W, sum w d, sum w (v_j - v), separation. Sees all within the radius, all around.
struct Around {
    radius_sq_inverse: f64,
    spacing_inverse: f64,
}

impl Meet<6, 10> for Around {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 6], there: [L; 6], sum: [L; 10]) -> [L; 10] {
        let d = Vec3 { x: there[0] - here[0], y: there[1] - here[1], z: there[2] - here[2] };
        let r_sq = d.norm_sq();
        let one = r_sq.like(1.0);
        let q = (one - r_sq * r_sq.like(self.radius_sq_inverse)).above_zero();
        let w = r_sq.positive(q * q, r_sq.zero());
        heed(sum, d, Vec3 { x: there[3] - here[3], y: there[4] - here[4], z: there[5] - here[5] }, w)
    }
    fn close(&self) -> f64 {
        1.0 / self.spacing_inverse
    }
    #[inline(always)]
    fn meet_close<L: Lane>(&self, here: [L; 6], there: [L; 6], sum: [L; 10]) -> [L; 10] {
        let d = Vec3 { x: there[0] - here[0], y: there[1] - here[1], z: there[2] - here[2] };
        shun(sum, d, apart(d.norm_sq(), self.spacing_inverse))
    }
}

/// x, v, heading, radius^-2 -> the same, of those that are in view; all that are too close, however few are heeded.
struct InView {
    spacing_inverse: f64,
    view: f64,
}

/// The cosine over which sight fades at the rim of the view.
const RIM: f64 = 0.2;

impl Meet<10, 10> for InView {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 10], there: [L; 10], sum: [L; 10]) -> [L; 10] {
        let d = Vec3 { x: there[0] - here[0], y: there[1] - here[1], z: there[2] - here[2] };
        let r_sq = d.norm_sq();
        let q = (r_sq.like(1.0) - r_sq * here[9]).above_zero();
        let w = r_sq.positive(q * q * self.seen(here, d), r_sq.zero());
        heed(sum, d, Vec3 { x: there[3] - here[3], y: there[4] - here[4], z: there[5] - here[5] }, w)
    }
    fn close(&self) -> f64 {
        1.0 / self.spacing_inverse
    }
    #[inline(always)]
    fn meet_close<L: Lane>(&self, here: [L; 10], there: [L; 10], sum: [L; 10]) -> [L; 10] {
        let d = Vec3 { x: there[0] - here[0], y: there[1] - here[1], z: there[2] - here[2] };
        shun(sum, d, apart(d.norm_sq(), self.spacing_inverse) * self.seen(here, d))
    }
}

impl InView {
    /// How much in view something at d is: from 0 to 1.
    #[inline(always)]
    fn seen<L: Lane>(&self, here: [L; 10], d: Vec3<L>) -> L {
        let r_sq = d.norm_sq();
        let one = r_sq.like(1.0);
        let ahead = d.dot(Vec3 { x: here[6], y: here[7], z: here[8] });
        let cosine = r_sq.positive(ahead * r_sq.rsqrt(), one);
        // How far it is beyond the rim.
        let seen = ((cosine - r_sq.like(self.view)) * r_sq.like(1.0 / RIM)).above_zero();
        (one - seen).positive(seen, one)
    }
}

/// The factor of d in (1 - e²)²/(e² + 0.01) e with e = r/spacing; zero beyond.                    (flocks.2)
#[inline(always)]
fn apart<L: Lane>(r_sq: L, spacing_inverse: f64) -> L {
    let e_sq = r_sq * r_sq.like(spacing_inverse * spacing_inverse);
    let q = (e_sq.like(1.0) - e_sq).above_zero();
    q * q * e_sq.like(spacing_inverse) / (e_sq + e_sq.like(0.01))
}

/// Adds a neighbour of weight w to the means.
#[inline(always)]
fn heed<L: Lane>(sum: [L; 10], d: Vec3<L>, v: Vec3<L>, w: L) -> [L; 10] {
    let [total, x, y, z, vx, vy, vz, ..] = sum;
    [total + w, x + d.x * w, y + d.y * w, z + d.z * w, vx + v.x * w, vy + v.y * w, vz + v.z * w, sum[7], sum[8], sum[9]]
}

/// Adds one that is too close.
#[inline(always)]
fn shun<L: Lane>(sum: [L; 10], d: Vec3<L>, s: L) -> [L; 10] {
    let [.., x, y, z] = sum;
    [sum[0], sum[1], sum[2], sum[3], sum[4], sum[5], sum[6], x + d.x * s, y + d.y * s, z + d.z * s]
}

/// a/sqrt(1 + |a|²/limit²): as a where it is small, never longer than the limit.                    (flocks.5)
fn bounded(a: Vector, limit: f64) -> Vector {
    if limit > 0.0 { a * (1.0 / (1.0 + a.norm_sq() / (limit * limit)).sqrt()) } else { a }
}

/// The urge to cruise, rate v (1 - v²/s²); none without a speed.                                     (flocks.3)
fn cruise(v: Vector, speed: f64, rate: f64) -> Vector {
    if speed > 0.0 { v * (rate * (1.0 - v.norm_sq() / (speed * speed))) } else { Vector::default() }
}

impl Flock {
    /// The flock in the rows of `prey`, hunted by those of `predators`; no two ranges overlap.
    pub fn new(
        habits: Habits,
        prey: Vec<Range<usize>>,
        predators: Vec<Range<usize>>,
        masses: &Masses,
        colliders: Arc<Vec<Collider>>,
    ) -> Self {
        let mut flock = Self {
            grid: Neighbours::new(habits.radius),
            habits,
            prey: Rows::default(),
            predators: Rows::default(),
            mass: Vec::new(),
            predator_mass: Vec::new(),
            colliders,
            time: 0.0,
            copies: Default::default(),
            hunters: Default::default(),
            numbers: Vec::new(),
            seeing: Vec::new(),
            sums: Vec::new(),
            urges: Vec::new(),
            chases: Vec::new(),
            weights: Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Definite },
        };
        flock.renew(prey, Some(predators), masses);
        flock
    }

    /// One over the square of the radius within which each heeds others, place by place: a number of nearest ones is the distance of
    /// the first that is heeded no more, so that everyone fades in and out.                                (flocks.4)
    fn radii(&self, out: &mut Vec<Real>) {
        let all = 1.0 / (self.habits.radius * self.habits.radius);
        out.clear();
        out.resize(self.grid.len(), all as Real);
        if self.habits.nearest == 0 {
            return;
        }
        let numbers = &self.numbers;
        self.grid.each(out, |place, runs, out| {
            let here = numbers[place];
            let mut nearest = Vec::with_capacity(self.habits.nearest + 2);
            for there in runs.iter().flat_map(|[a, b]| &numbers[*a as usize..*b as usize]) {
                let d = [0, 1, 2].map(|a| there[a] - here[a]);
                let r_sq = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                if r_sq > 0.0 && (nearest.len() <= self.habits.nearest || nearest.last().is_some_and(|last| r_sq < *last)) {
                    nearest.insert(nearest.partition_point(|n| *n <= r_sq), r_sq);
                    nearest.truncate(self.habits.nearest + 1);
                }
            }
            if let Some(first_unheeded) = nearest.get(self.habits.nearest) {
                *out = (1.0 / first_unheeded).max(*out);
            }
        });
    }

    /// The sums over neighbours, place by place.
    fn meet(&mut self, x: &[Row], v: &[Row]) {
        self.grid.rebuild(x);
        self.grid.sorted(|i| [x[i][0], x[i][1], x[i][2], v[i][0], v[i][1], v[i][2]], &mut self.numbers);
        let (h, mut sums) = (&self.habits, std::mem::take(&mut self.sums));
        let spacing_inverse = if h.spacing > 0.0 { 1.0 / h.spacing.min(h.radius) } else { 1.0 / h.radius };
        if h.nearest == 0 && h.view <= -1.0 {
            let law = Around { radius_sq_inverse: 1.0 / (h.radius * h.radius), spacing_inverse };
            self.grid.gather(&law, &self.numbers, &mut sums);
        } else {
            let law = InView { spacing_inverse, view: if h.view <= -1.0 { -1.0 - RIM } else { h.view } };
            let mut radii = Vec::new();
            self.radii(&mut radii);
            self.seeing.resize(self.numbers.len(), [0.0; 10]);
            let numbers = &self.numbers;
            chunks(&mut self.seeing, |start, seeing| {
                for (k, out) in seeing.iter_mut().enumerate() {
                    let [x, y, z, vx, vy, vz] = numbers[start + k];
                    let n = Vec3 { x: vx, y: vy, z: vz }.normalized();
                    *out = [x, y, z, vx, vy, vz, n.x, n.y, n.z, radii[start + k]];
                }
            });
            self.grid.gather(&law, &self.seeing, &mut sums);
        }
        self.sums = sums;
    }

    /// The acceleration of the prey at a place [m/s²].
    fn steer(&self, place: usize) -> Vector {
        let (h, s) = (&self.habits, self.sums[place].map(f64::from));
        let [x, y, z, vx, vy, vz] = self.numbers[place].map(f64::from);
        let (x, v) = (Vector { x, y, z }, Vector { x: vx, y: vy, z: vz });
        let of = |k: usize| Vector { x: s[k], y: s[k + 1], z: s[k + 2] };
        let mut a = cruise(v, h.speed, h.propulsion) - of(7) * h.separation;
        if s[0] > 0.0 {
            // W of one far neighbour fades to zero, and the mean does not: W + 0.01 lets it fade, too.
            a = a + (of(1) * h.cohesion + of(4) * h.alignment) * (1.0 / (s[0] + 0.01));
        }
        for goal in &h.goals {
            let d = goal.point - x;
            a = a + d * (goal.strength / (d.norm_sq() + h.radius * h.radius).sqrt());
        }
        if h.avoidance > 0.0 && h.clearance > 0.0 {
            for solid in self.colliders.iter() {
                let (distance, normal) = solid.distance(x, self.time, h.clearance + solid.thickness);
                let near = (1.0 - (distance - solid.thickness) / h.clearance).clamp(0.0, 2.0);
                a = a + normal * (h.avoidance * near * near);
            }
        }
        if h.fear > 0.0 && h.fear_radius > 0.0 {
            for hunter in &self.hunters[0] {
                let d = xyz64(*hunter) - x;
                let r_sq = d.norm_sq();
                let q = 1.0 - r_sq / (h.fear_radius * h.fear_radius);
                if q > 0.0 && r_sq > 0.0 {
                    a = a - d * (h.fear * q * q / r_sq.sqrt());
                }
            }
        }
        bounded(a, h.limit)
    }

    /// The acceleration of predator number k: towards the prey, near ones far more than others, and the whole flock from afar.
    fn hunt(&self, k: usize) -> Vector {
        let h = &self.habits;
        let (x, v) = (xyz64(self.hunters[0][k]), xyz64(self.hunters[1][k]));
        if self.hunters[0][k][..3].iter().any(|c| !c.is_finite()) {
            return Vector::default();
        }
        let soft = h.radius * h.radius;
        let (mut total, mut mean) = (0.0, Vector::default());
        for [px, py, pz, ..] in self.numbers.iter().map(|numbers| numbers.map(f64::from)) {
            let d = Vector { x: px, y: py, z: pz } - x;
            let near = 1.0 / (d.norm_sq() + soft);
            let w = near * near;
            (total, mean) = (total + w, mean + d * w);
        }
        let mut a = cruise(v, h.predator_speed, h.propulsion);
        if total > 0.0 {
            let d = mean * (1.0 / total);
            a = a + d * (h.chase / (d.norm_sq() + soft).sqrt());
        }
        bounded(a, h.limit)
    }

    /// Factors of the masses that stand for -df/dx and -df/dv: enough for steps to be estimated and for Newton's method to settle.
    fn diagonal(&self) -> Real {
        let h = &self.habits;
        let stiffness = h.cohesion + if h.spacing > 0.0 { h.separation / h.spacing } else { 0.0 };
        let damping = h.alignment + 2.0 * h.propulsion;
        (f64::from(self.weights.stiffness) * stiffness + f64::from(self.weights.damping) * damping) as Real
    }
}

impl Batch for Flock {
    fn name(&self) -> &'static str {
        "flock"
    }

    fn take_surfaces(&mut self, solids: &Arc<Vec<Collider>>) {
        self.colliders = solids.clone();
    }

    fn renew(&mut self, on: Vec<Range<usize>>, others: Option<Vec<Range<usize>>>, masses: &Masses) {
        self.prey = Rows::new(on, None);
        self.predators = Rows::new(others.unwrap_or_default(), None);
        let of = |rows: &Rows| (0..rows.len()).map(|i| masses.mass[rows.row(i)]).collect();
        (self.mass, self.predator_mass) = (of(&self.prey), of(&self.predators));
    }

    fn len(&self) -> usize {
        self.prey.len() + self.predators.len()
    }

    fn energy(&self, _x: &[Row]) -> f64 {
        0.0
    }

    fn is_elastic(&self) -> bool {
        false
    }

    /// The energy of all at cruising speed.
    fn drives(&self) -> Option<f64> {
        let all = |mass: &[Real], speed: f64| 0.5 * speed * speed * sum(mass.len(), |range| range.map(|i| f64::from(mass[i])).sum());
        Some(all(&self.mass, self.habits.speed) + all(&self.predator_mass, self.habits.predator_speed))
    }

    fn begin_forces(&mut self, t: f64, x: &[Row], v: &[Row]) {
        self.time = t;
        let mut copies = std::mem::take(&mut self.copies);
        let [of_x, of_v] = &mut copies;
        self.meet(self.prey.pick(x, of_x), self.prey.pick(v, of_v));
        self.copies = copies;
        self.predators.gather(x, &mut self.hunters[0]);
        self.predators.gather(v, &mut self.hunters[1]);
        let mut urges = std::mem::take(&mut self.urges);
        urges.resize(self.grid.len(), [0.0; 4]);
        chunks(&mut urges, |start, urges| {
            for (k, urge) in urges.iter_mut().enumerate() {
                let a = self.steer(start + k);
                *urge = [a.x as Real, a.y as Real, a.z as Real, 0.0];
            }
        });
        self.urges = urges;
        let chase = |k: usize| {
            let a = self.hunt(k) * f64::from(self.predator_mass[k]);
            [a.x as Real, a.y as Real, a.z as Real, 0.0]
        };
        self.chases = (0..self.predators.len()).map(chase).collect();
    }

    fn add_forces(&self, _x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        self.prey.among(start, force, |i, f| {
            if let Some(place) = self.grid.place(i) {
                *f = crate::math::axpy(*f, self.mass[i], self.urges[place]);
            }
        });
        self.predators.among(start, force, |i, f| *f = crate::math::add(*f, self.chases[i]));
    }

    fn linearize(&mut self, _x: &[Row], weights: Weights) {
        self.weights = weights;
    }

    fn add_product(&self, u: &[Row], start: usize, out: &mut [Row]) {
        let c = self.diagonal();
        for (rows, mass) in [(&self.prey, &self.mass), (&self.predators, &self.predator_mass)] {
            rows.among(start, out, |i, o| *o = crate::math::axpy(*o, c * mass[i], u[rows.row(i)]));
        }
    }

    fn add_diagonal(&mut self, _x: &[Row], blocks: &mut [Block]) {
        let c = self.diagonal();
        for (rows, mass) in [(&self.prey, &self.mass), (&self.predators, &self.predator_mass)] {
            rows.among(0, blocks, |i, block| (0..3).for_each(|a| block[a] += c * mass[i]));
        }
    }

    fn entries(&self, _x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        let c = f64::from(self.diagonal());
        for (rows, mass) in [(&self.prey, &self.mass), (&self.predators, &self.predator_mass)] {
            for i in 0..rows.len() {
                let k = c * f64::from(mass[i]);
                sink(rows.row(i), rows.row(i), [[k, 0.0, 0.0], [0.0, k, 0.0], [0.0, 0.0, k]]);
            }
        }
    }
}
