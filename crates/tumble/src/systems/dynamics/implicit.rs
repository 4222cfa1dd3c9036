//! The linear systems of implicit stages: (M/gh² + D/gh + K) dx = rhs.

use super::contact::{self, Penalty, Slip};
use super::laws::{Acting, Laws};
use crate::elements::{Batch, Weights};
use crate::forces::Group;
use crate::geometry::Vector;
use crate::integrators::newton::{self, LinearSolve, Stiff};
use crate::integrators::{Equation, Kinematics, Stage};
use crate::linalg::blocks::{Block, Blocks};
use crate::linalg::cholesky::{Assembly, Cholesky};
use crate::linalg::pcg::{self, Operator, Params};
use crate::math::parallel::{chunks, chunks2, sum};
use crate::math::{Real, Row, ZERO, xyz64};
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;
use tumble_interface::scene::{Hessian, Linear as LinearMethod, Solver};

/// Settings and storage of the implicit schemes, kept between steps.
#[derive(Default)]
pub struct Implicit {
    solver: Solver,
    contact: Penalties,
    newton: newton::Workspace,
    /// 1/mass of every row, 0 for held ones.
    weights: Vec<Real>,
    pcg: pcg::Workspace,
    cholesky: Cholesky,
    /// Per row: mass, forces on each mass by itself and contact.
    local: Vec<Block>,
    local_columns: Blocks,
    /// Per row: the inverse of the whole diagonal block; zero for a pinned row.
    inverse: Vec<Block>,
    inverse_columns: Blocks,
}

/// The solids as implicit stages see them.
#[derive(Default)]
struct Penalties {
    /// Whether they do.
    seen: bool,
    /// Positions and velocities at the start of the stage.
    start: [Vec<Row>; 2],
    /// Of every mass, as Newton's method last linearized this stage.
    slips: Vec<Slip>,
}

impl Penalties {
    /// Whether the stages of these laws meet any.
    fn act(&self, laws: &Laws) -> bool {
        self.seen && !laws.colliders.is_empty()
    }

    /// The contacts of mass i, at x with velocity v, in a stage of length gh that ends at t.
    fn of(&self, laws: &Laws, i: usize, t: f64, gh: f64, x: Row, v: Row) -> impl Iterator<Item = Penalty> {
        let stiffness = contact::stiffness(laws.masses.mass[i], laws.grip.get(i).copied().unwrap_or(0.0), gh);
        let [start_x, start_v] = &self.start;
        // Masses at rest have no normal force in the first stage yet: a speed that gravity gives in two stages is no slide.
        let resting = 2.0 * gh * laws.gravity.largest;
        Penalty::of(&laws.colliders, (t - gh, t), stiffness, (x, v), (start_x[i], start_v[i]), resting)
    }
}

/// The equation of motion of a whole system.
pub struct Motion<'a> {
    /// Its laws.
    pub laws: &'a mut Laws,
    /// Settings and storage of implicit stages.
    pub implicit: &'a mut Implicit,
}

/// The matrix as an operator, with block Jacobi: a pinned row gets 0, so that its residual never matters.
struct Matrix<'a> {
    batches: &'a mut [Box<dyn Batch>],
    x: &'a [Row],
    local: &'a Blocks,
    inverse: &'a Blocks,
}

impl Operator for Matrix<'_> {
    fn begin(&mut self, u: &[Row]) {
        self.batches.iter_mut().for_each(|b| b.begin_product(self.x, u));
    }

    fn apply(&self, u: &[Row], start: usize, out: &mut [Row]) {
        self.local.multiply(start, &u[start..start + out.len()], out);
        self.batches.iter().for_each(|b| b.add_product(u, start, out));
    }

    fn precondition(&self, start: usize, r: &[Row], out: &mut [Row]) {
        self.inverse.multiply(start, r, out);
    }
}

/// The inverse of a symmetric block, by cofactors in double precision; the inverse of its diagonal if it is not
/// positive definite.
fn inverse(b: &Block) -> Block {
    let [xx, yy, zz, xy, yz, zx] = b.map(f64::from);
    let (cx, cy, cz) = (yy * zz - yz * yz, xx * zz - zx * zx, xx * yy - xy * xy);
    let (cxy, cyz, czx) = (yz * zx - xy * zz, xy * zx - xx * yz, xy * yz - yy * zx);
    let det = xx * cx + xy * cxy + zx * czx;
    if xx > 0.0 && cz > 0.0 && det > 0.0 {
        return [cx, cy, cz, cxy, cyz, czx].map(|c| (c / det) as Real);
    }
    let safe = |d: f64| if d == 0.0 { 1.0 } else { 1.0 / d.abs() };
    [safe(xx) as Real, safe(yy) as Real, safe(zz) as Real, 0.0, 0.0, 0.0]
}

impl Implicit {
    /// For stages with these settings; `penalty` says whether they see the solids.
    pub fn new(solver: Solver, penalty: bool) -> Self {
        Self { solver, contact: Penalties { seen: penalty, ..Penalties::default() }, ..Self::default() }
    }

    /// Whether stages see the solids as penalties.
    pub fn sees_solids(&self) -> bool {
        self.contact.seen
    }

    /// Fills `local` with mass over gh², forces and contact, prepares the batches, and inverts the diagonal blocks.
    /// Returns the round-off of the forces in the norm sqrt(sum |.|²/m).
    fn linearize(&mut self, laws: &mut Laws, t: f64, x: &[Row], v: &[Row], gh: f64, hessian: Hessian) -> Result<f64, StepError> {
        let n = x.len();
        self.local.resize(n, [0.0; 6]);
        self.inverse.resize(n, [0.0; 6]);
        let mut slips = std::mem::take(&mut self.contact.slips);
        let (all, masses, contact) = (&*laws, &laws.masses, &self.contact);
        let group = Group::new(masses, 0, x, v);
        // The stiffness of everything, without mass.
        chunks(&mut self.local, |start, local| {
            let end = start + local.len();
            local.fill([0.0; 6]);
            for Acting { law, ranges, .. } in &all.forces {
                for i in ranges.iter().flat_map(|r| r.start.max(start)..r.end.min(end)) {
                    let (k, d) = law.matrix(t, &group.one(i));
                    add_block(&mut local[i - start], k, 1.0);
                    add_block(&mut local[i - start], d, (1.0 / gh) as Real);
                }
            }
        });
        if contact.act(all) {
            chunks2(&mut self.local, &mut slips, |start, local, slips| {
                for (k, (local, slip)) in local.iter_mut().zip(slips).enumerate().filter(|(k, _)| !masses.frames.contains(start + k)) {
                    let i = start + k;
                    let mut now = Slip { velocity: xyz64(v[i]), share: Vector::default() };
                    let mut most = 0.0;
                    for touch in contact.of(all, i, t, gh, x[i], v[i]) {
                        let share = touch.share(slip);
                        add_block(local, touch.matrix(gh, share), 1.0);
                        if touch.friction() > most {
                            (most, now.share) = (touch.friction(), share);
                        }
                    }
                    *slip = now;
                }
            });
        }
        self.contact.slips = slips;
        laws.add_user_stiffness(t, x, v, hessian == Hessian::Definite, |i, [k, d]| {
            add_block(&mut self.local[i], k, 1.0);
            add_block(&mut self.local[i], d, (1.0 / gh) as Real);
        })?;
        self.inverse.copy_from_slice(&self.local);
        let weights = Weights { stiffness: 1.0, damping: (1.0 / gh) as Real, hessian };
        for batch in &mut laws.batches {
            batch.linearize(x, weights);
            batch.add_diagonal(x, &mut self.inverse);
        }
        let (diagonal, masses) = (&self.inverse, &laws.masses);
        let noise = sum(n, |range| {
            range
                .map(|i| {
                    // A coordinate is off by 0.2 units in its last place on average, and so are its neighbours'.
                    let force = |c: usize| 0.3 * f64::from(Real::EPSILON) * f64::from(diagonal[i][c]) * f64::from(x[i][c]);
                    f64::from(masses.inverse(i, x)) * (0..3).map(|c| force(c) * force(c)).sum::<f64>()
                })
                .sum()
        });
        let inertia = 1.0 / (gh * gh);
        for (i, ((local, diagonal), m)) in self.local.iter_mut().zip(&mut self.inverse).zip(&masses.mass).enumerate() {
            let m = (f64::from(*m) * inertia) as Real;
            add_block(local, [m, m, m, 0.0, 0.0, 0.0], 1.0);
            add_block(diagonal, [m, m, m, 0.0, 0.0, 0.0], 1.0);
            *diagonal = if masses.inverse(i, x) > 0.0 { inverse(diagonal) } else { [0.0; 6] };
        }
        self.local_columns.set(&self.local);
        self.inverse_columns.set(&self.inverse);
        Ok(noise.sqrt())
    }

    /// Round-off of the forces, those of contact left out, over the weight of everything, where steps of h [s] start; `None` without gravity.
    pub fn noise_over_weight(&mut self, laws: &mut Laws, x: &[Row], v: &[Row], h: f64) -> Option<f64> {
        let seen = std::mem::take(&mut self.contact.seen);
        let noise = self.linearize(laws, 0.0, x, v, h, self.solver.hessian);
        self.contact.seen = seen;
        let noise = noise.ok()?;
        let free = laws.masses.points().flatten().filter(|i| laws.masses.inverse(*i, x) > 0.0);
        let mass: f64 = free.map(|i| f64::from(laws.masses.mass[i])).sum();
        let weight = mass.sqrt() * laws.gravity.largest;
        (weight > 0.0).then(|| noise / weight)
    }

    fn solve(&mut self, laws: &mut Laws, x: &[Row], rhs: &[Row], out: &mut [Row], settings: &Solver) -> LinearSolve {
        if settings.linear == LinearMethod::Cholesky {
            let pinned = |i: usize| laws.masses.inverse(i, x) == 0.0;
            let mut assembly = Assembly::new(x.len());
            for (i, b) in self.local.iter().enumerate() {
                let [xx, yy, zz, xy, yz, zx] = if pinned(i) { [1.0, 1.0, 1.0, 0.0, 0.0, 0.0] } else { b.map(f64::from) };
                assembly.add(i, i, [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]);
            }
            for batch in &laws.batches {
                batch.entries(x, &mut |i, j, block| {
                    if !pinned(i) && !pinned(j) {
                        assembly.add(i, j, block);
                    }
                });
            }
            let indefinite = self.cholesky.factorize(&assembly).is_err();
            self.cholesky.solve(rhs, out);
            return LinearSolve { iterations: 1, indefinite };
        }
        let tolerance = settings.linear_tolerance.unwrap_or(if cfg!(feature = "double") { 1e-6 } else { 1e-2 });
        let params = Params { tolerance, iterations: settings.linear_iterations as usize };
        let mut matrix = Matrix { batches: &mut laws.batches, x, local: &self.local_columns, inverse: &self.inverse_columns };
        let info = pcg::solve(&mut matrix, rhs, out, params, &mut self.pcg);
        LinearSolve { iterations: info.iterations, indefinite: info.indefinite }
    }
}

fn add_block(to: &mut Block, b: Block, c: Real) {
    for i in 0..6 {
        to[i] += c * b[i];
    }
}

impl Equation for Motion<'_> {
    fn kinematics(&self) -> Kinematics {
        self.laws.kinematics()
    }

    fn rate(&mut self, t: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        self.laws.rate(t, x, v, out)
    }

    fn solve(&mut self, stage: &Stage<'_>, x: &mut [Row], v: &mut [Row], report: &mut StepReport) -> Result<(), StepError> {
        if !self.laws.colliders.is_empty() {
            for (start, now) in self.implicit.contact.start.iter_mut().zip([&*x, &*v]) {
                start.clear();
                start.extend_from_slice(now);
            }
            let slips = &mut self.implicit.contact.slips;
            slips.clear();
            slips.extend(v.iter().map(|v| Slip { velocity: xyz64(*v), share: Vector::default() }));
        }
        let masses = &self.laws.masses;
        self.implicit.weights.clear();
        self.implicit.weights.extend((0..x.len()).map(|i| masses.inverse(i, x)));
        let mut work = std::mem::take(&mut self.implicit.newton);
        let solver = self.implicit.solver.clone();
        let result = newton::solve(self, stage, x, v, &solver, &mut work, report);
        self.implicit.newton = work;
        result
    }
}

impl Stiff for Motion<'_> {
    fn inverse_mass(&self) -> &[Real] {
        &self.implicit.weights
    }

    fn force(&mut self, t: f64, x: &[Row], v: &[Row], gh: f64, out: &mut [Row]) -> Result<(), StepError> {
        self.laws.forces(t, x, v, out)?;
        let (laws, contact) = (&*self.laws, &self.implicit.contact);
        if !contact.act(laws) {
            return Ok(());
        }
        chunks(out, |start, out| {
            for (k, f) in out.iter_mut().enumerate() {
                let i = start + k;
                if !laws.masses.frames.contains(i) && x[i][3] > 0.0 {
                    for touch in contact.of(laws, i, t, gh, x[i], v[i]) {
                        let push = touch.force(x[i]);
                        *f = [f[0] + push.x as Real, f[1] + push.y as Real, f[2] + push.z as Real, 0.0];
                    }
                }
            }
        });
        Ok(())
    }

    fn linearize(&mut self, t: f64, x: &[Row], v: &[Row], gh: f64, hessian: Hessian) -> Result<f64, StepError> {
        self.implicit.linearize(self.laws, t, x, v, gh, hessian)
    }

    fn solve_linear(&mut self, x: &[Row], rhs: &[Row], out: &mut [Row], settings: &Solver) -> LinearSolve {
        out.fill(ZERO);
        self.implicit.solve(self.laws, x, rhs, out, settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_inverted() {
        let b: Block = [4.0, 3.0, 5.0, 1.0, -0.5, 0.3];
        let u = [[1.0, -2.0, 0.5, 0.0]];
        let times = |block: Block, u: [Row; 1]| {
            let (mut blocks, mut out) = (Blocks::default(), [ZERO]);
            blocks.set(&[block]);
            blocks.multiply(0, &u, &mut out);
            out
        };
        let back = times(inverse(&b), times(b, u));
        assert!((0..3).all(|i| (back[0][i] - u[0][i]).abs() < 1e-5), "{back:?}");
        assert_eq!(inverse(&[2.0, -4.0, 0.0, 0.0, 0.0, 0.0]), [0.5, 0.25, 1.0, 0.0, 0.0, 0.0]);
    }
}
