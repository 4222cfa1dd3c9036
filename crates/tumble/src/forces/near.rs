//! Forces between masses that are near each other, by cells.

use super::Rows;
use crate::elements::{Batch, Block, Weights};
use crate::geometry::{Meet, Neighbours};
use crate::math::parallel::sum;
use crate::math::{Lane, Real, Row, Vec3, xyz64};
use crate::state::Masses;
use std::ops::Range;
use tumble_interface::scene::Hessian;

/// A law of two masses at a distance r, below its reach. All is a function of r², so that most laws need no root:
///
///   f_i = E'(r)/r d + c(r) (v_j - v_i),   d = x_j - x_i                                   (neighbours.5)
///
/// Both ends are evaluated with the same r² and exactly opposite d, so that forces are exactly opposite.
pub trait PairLaw: Send + Sync + 'static {
    /// Name in reports.
    const NAME: &'static str;
    /// Whether it damps; else `damping` is never asked for.
    const DAMPS: bool = false;
    /// Distance from which on there is no force [m].
    fn reach(&self) -> f64;
    /// E [J].
    #[inline(always)]
    fn energy<L: Lane>(&self, r_sq: L) -> L {
        r_sq.zero()
    }
    /// E'/r [N/m]: positive where masses attract each other.
    #[inline(always)]
    fn pull<L: Lane>(&self, r_sq: L) -> L {
        r_sq.zero()
    }
    /// E'' [N/m].
    #[inline(always)]
    fn tangent<L: Lane>(&self, r_sq: L) -> L {
        r_sq.zero()
    }
    /// c [N s/m].
    #[inline(always)]
    fn damping<L: Lane>(&self, r_sq: L) -> L {
        r_sq.zero()
    }
    /// Whether only the velocity along the line is damped.
    #[inline(always)]
    fn is_central(&self) -> bool {
        false
    }
}

/// A law between all masses of some rows that are near each other.
///
/// Degenerate: two masses in one place have no direction and exert no force. Masses that are not finite have no neighbours.
pub struct Near<L> {
    law: L,
    rows: Rows,
    grid: Neighbours,
    x: Vec<Row>,
    weights: Weights,
    points: Vec<[Real; 4]>,
    moving: Vec<[Real; 8]>,
    forces: Vec<[Real; 3]>,
}

/// d and r² of two places, and r² again with zero where they do not meet.
#[inline(always)]
fn apart<P: PairLaw, L: Lane>(law: &P, here: [L; 3], there: [L; 3]) -> (Vec3<L>, L, L) {
    let d = Vec3 { x: there[0] - here[0], y: there[1] - here[1], z: there[2] - here[2] };
    let r_sq = d.norm_sq();
    // A law may divide by r²: where two do not meet it is asked about its reach.
    let far = r_sq.like(law.reach() * law.reach());
    let near = (far - r_sq).positive(r_sq, r_sq.zero());
    (d, near.positive(r_sq, far), near)
}

/// x, acts -> force.
struct Pull<'a, P>(&'a P);

impl<P: PairLaw> Meet<4, 3> for Pull<'_, P> {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 4], there: [L; 4], sum: [L; 3]) -> [L; 3] {
        let (d, r_sq, near) = apart(self.0, [here[0], here[1], here[2]], [there[0], there[1], there[2]]);
        let pull = near.positive(self.0.pull(r_sq) * there[3], near.zero());
        [sum[0] + d.x * pull, sum[1] + d.y * pull, sum[2] + d.z * pull]
    }
}

/// x, acts, feels, v -> force with damping.
struct Damped<'a, P>(&'a P);

impl<P: PairLaw> Meet<8, 3> for Damped<'_, P> {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 8], there: [L; 8], sum: [L; 3]) -> [L; 3] {
        let (d, r_sq, near) = apart(self.0, [here[0], here[1], here[2]], [there[0], there[1], there[2]]);
        let mut pull = self.0.pull(r_sq);
        let mut push = self.0.damping(r_sq);
        let v = Vec3 { x: there[5] - here[5], y: there[6] - here[6], z: there[7] - here[7] };
        if self.0.is_central() {
            pull = pull + push * d.dot(v) / r_sq;
            push = push.zero();
        }
        let pull = near.positive(pull * there[3], near.zero());
        let push = near.positive(push * there[3], near.zero());
        [sum[0] + (d.x * pull + v.x * push), sum[1] + (d.y * pull + v.y * push), sum[2] + (d.z * pull + v.z * push)]
    }
}

/// x, acts, feels, - -> energy; half of each pair that feels each other.
struct Energy<'a, P>(&'a P);

impl<P: PairLaw> Meet<8, 1> for Energy<'_, P> {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 8], there: [L; 8], sum: [L; 1]) -> [L; 1] {
        let (_, r_sq, near) = apart(self.0, [here[0], here[1], here[2]], [there[0], there[1], there[2]]);
        let share = here[4] * there[3] * (r_sq.like(1.0) - r_sq.like(0.5) * (here[3] * there[4]));
        [sum[0] + near.positive(self.0.energy(r_sq) * share, near.zero())]
    }
}

/// Stiffness along the line and across it over r², and damping likewise, weighted: a d d^T + b I.
#[inline(always)]
fn matrix<P: PairLaw, L: Lane>(law: &P, weights: &Weights, r_sq: L) -> (L, L) {
    let (mut along, mut across) = (law.tangent(r_sq), law.pull(r_sq));
    if weights.hessian != Hessian::Exact {
        (along, across) = (along.above_zero(), across.above_zero());
    }
    let k = r_sq.like(f64::from(weights.stiffness));
    (along, across) = (along * k, across * k);
    if P::DAMPS {
        let damping = law.damping(r_sq) * r_sq.like(f64::from(weights.damping));
        along = along + damping;
        if !law.is_central() {
            across = across + damping;
        }
    }
    ((along - across) / r_sq, across)
}

/// x, acts, feels, u -> product.
struct Product<'a, P>(&'a P, Weights);

impl<P: PairLaw> Meet<8, 3> for Product<'_, P> {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 8], there: [L; 8], sum: [L; 3]) -> [L; 3] {
        let (d, r_sq, near) = apart(self.0, [here[0], here[1], here[2]], [there[0], there[1], there[2]]);
        let (a, b) = matrix(self.0, &self.1, r_sq);
        // Masses without reaction count as held, so that the matrix is symmetric.
        let mutual = here[3] * there[4];
        let u = Vec3 { x: here[5] - there[5] * mutual, y: here[6] - there[6] * mutual, z: here[7] - there[7] * mutual };
        let along = near.positive(a * d.dot(u) * there[3], near.zero());
        let across = near.positive(b * there[3], near.zero());
        [sum[0] + (d.x * along + u.x * across), sum[1] + (d.y * along + u.y * across), sum[2] + (d.z * along + u.z * across)]
    }
}

/// x, acts -> diagonal block.
struct Diagonal<'a, P>(&'a P, Weights);

impl<P: PairLaw> Meet<4, 6> for Diagonal<'_, P> {
    #[inline(always)]
    fn meet<L: Lane>(&self, here: [L; 4], there: [L; 4], sum: [L; 6]) -> [L; 6] {
        let (d, r_sq, near) = apart(self.0, [here[0], here[1], here[2]], [there[0], there[1], there[2]]);
        let (a, b) = matrix(self.0, &self.1, r_sq);
        let (a, b) = (near.positive(a * there[3], near.zero()), near.positive(b * there[3], near.zero()));
        [
            sum[0] + (a * d.x * d.x + b),
            sum[1] + (a * d.y * d.y + b),
            sum[2] + (a * d.z * d.z + b),
            sum[3] + a * d.x * d.y,
            sum[4] + a * d.y * d.z,
            sum[5] + a * d.z * d.x,
        ]
    }
}

fn flag(b: bool) -> Real {
    if b { 1.0 } else { 0.0 }
}

impl<P: PairLaw> Near<P> {
    /// The law on the rows of `on`, which feel those of `from`; without it, each other. No two ranges overlap unless they are equal.
    pub fn new(law: P, on: Vec<Range<usize>>, from: Option<Vec<Range<usize>>>) -> Self {
        Self {
            grid: Neighbours::new(law.reach()),
            law,
            rows: Rows::new(on, from),
            x: Vec::new(),
            weights: Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Definite },
            points: Vec::new(),
            moving: Vec::new(),
            forces: Vec::new(),
        }
    }

    fn sort(&mut self, x: &[Row]) {
        self.rows.gather(x, &mut self.x);
        self.grid.rebuild(&self.x);
    }

    fn sort_points(&mut self) {
        let (x, rows) = (&self.x, &self.rows);
        self.grid.sorted(|i| [x[i][0], x[i][1], x[i][2], flag(rows.acts(i))], &mut self.points);
    }

    fn sort_moving(&mut self, u: &[Row]) {
        let (x, rows) = (&self.x, &self.rows);
        let row = |i: usize| {
            let u = u[rows.row(i)];
            [x[i][0], x[i][1], x[i][2], flag(rows.acts(i)), flag(rows.feels(i)), u[0], u[1], u[2]]
        };
        self.grid.sorted(row, &mut self.moving);
    }

    /// Adds what was gathered to the rows from `start` on.
    fn add(&self, start: usize, out: &mut [Row]) {
        self.rows.among(start, out, |i, out| {
            if let (true, Some(place)) = (self.rows.feels(i), self.grid.place(i)) {
                let f = self.forces[place];
                *out = [out[0] + f[0], out[1] + f[1], out[2] + f[2], out[3]];
            }
        });
    }
}

impl<P: PairLaw> Batch for Near<P> {
    fn name(&self) -> &'static str {
        P::NAME
    }

    fn renew(&mut self, on: Vec<Range<usize>>, others: Option<Vec<Range<usize>>>, _masses: &Masses) {
        self.rows = Rows::new(on, others);
    }

    fn len(&self) -> usize {
        self.rows.len()
    }

    fn energy(&self, x: &[Row]) -> f64 {
        if P::DAMPS {
            return 0.0;
        }
        let (mut rows, mut grid) = (Vec::new(), Neighbours::new(self.law.reach()));
        self.rows.gather(x, &mut rows);
        grid.rebuild(&rows);
        let (mut numbers, mut out) = (Vec::new(), Vec::new());
        let all = |i: usize| [rows[i][0], rows[i][1], rows[i][2], flag(self.rows.acts(i)), flag(self.rows.feels(i)), 0.0, 0.0, 0.0];
        grid.sorted(all, &mut numbers);
        grid.gather(&Energy(&self.law), &numbers, &mut out);
        sum(out.len(), |range| range.map(|i| f64::from(out[i][0])).sum())
    }

    fn is_elastic(&self) -> bool {
        false
    }

    fn begin_forces(&mut self, _t: f64, x: &[Row], v: &[Row]) {
        self.sort(x);
        if P::DAMPS {
            self.sort_moving(v);
            self.grid.gather(&Damped(&self.law), &self.moving, &mut self.forces);
        } else {
            self.sort_points();
            self.grid.gather(&Pull(&self.law), &self.points, &mut self.forces);
        }
    }

    fn add_forces(&self, _x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        self.add(start, force);
    }

    fn linearize(&mut self, x: &[Row], weights: Weights) {
        self.sort(x);
        self.weights = weights;
    }

    fn begin_product(&mut self, x: &[Row], u: &[Row]) {
        self.sort(x);
        self.sort_moving(u);
        self.grid.gather(&Product(&self.law, self.weights), &self.moving, &mut self.forces);
    }

    fn add_product(&self, _u: &[Row], start: usize, out: &mut [Row]) {
        self.add(start, out);
    }

    fn add_diagonal(&mut self, x: &[Row], blocks: &mut [Block]) {
        self.sort(x);
        self.sort_points();
        let mut sums: Vec<[Real; 6]> = Vec::new();
        self.grid.gather(&Diagonal(&self.law, self.weights), &self.points, &mut sums);
        self.rows.among(0, blocks, |i, block| {
            if let (true, Some(place)) = (self.rows.feels(i), self.grid.place(i)) {
                (0..6).for_each(|c| block[c] += sums[place][c]);
            }
        });
    }

    fn entries(&self, x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        let mut rows = Vec::new();
        self.rows.gather(x, &mut rows);
        let mut grid = Neighbours::new(self.law.reach());
        grid.rebuild(&rows);
        let mut order = vec![0; grid.len()];
        (0..rows.len()).filter_map(|i| Some((i, grid.place(i)?))).for_each(|(i, place)| order[place] = i);
        let mut found: Vec<Vec<usize>> = vec![Vec::new(); grid.len()];
        grid.each(&mut found, |_, runs, found| found.extend(runs.iter().flat_map(|[a, b]| *a as usize..*b as usize)));
        for (place, candidates) in found.iter().enumerate().filter(|(place, _)| self.rows.feels(order[*place])) {
            let i = order[place];
            for j in candidates.iter().map(|place| order[*place]).filter(|j| *j != i && self.rows.acts(*j)) {
                let (here, there): ([f64; 3], [f64; 3]) = (xyz64(rows[i]).into(), xyz64(rows[j]).into());
                let (d, r_sq, near) = apart(&self.law, here, there);
                if near <= 0.0 {
                    continue;
                }
                let (a, b) = matrix(&self.law, &self.weights, r_sq);
                let d = [d.x, d.y, d.z];
                let block: [[f64; 3]; 3] = std::array::from_fn(|r| std::array::from_fn(|c| a * d[r] * d[c] + if r == c { b } else { 0.0 }));
                sink(self.rows.row(i), self.rows.row(i), block);
                if self.rows.acts(i) && self.rows.feels(j) {
                    sink(self.rows.row(i), self.rows.row(j), block.map(|row| row.map(|v| -v)));
                }
            }
        }
    }
}
