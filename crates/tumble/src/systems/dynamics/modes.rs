//! The stiffest and the most damped mode of a system, by Lanczos' method on M^-1/2 A M^-1/2.

use super::core::Core;
use super::laws::Acting;
use crate::elements::Weights;
use crate::forces::Group;
use crate::integrators::stability::{Mode, limits};
use crate::math::parallel::chunks;
use crate::math::{Real, Row, ZERO, bisect, dot, scale};
use tumble_interface::scene::Hessian;

/// Lanczos steps; the largest eigenvalue of a sheet is then within 1e-3 of its limit.
const STEPS: usize = 48;

/// The modes on which the stability of a step depends.
pub struct Modes {
    /// The mode of highest frequency.
    pub stiffest: Mode,
    /// The mode of highest damping rate.
    pub most_damped: Mode,
    /// A mode of high frequency and low damping, which limits the schemes that need damping.
    pub least_damped: Mode,
    /// The row that moves most in the stiffest mode.
    pub culprit: Option<usize>,
}

impl Modes {
    /// All of them.
    pub fn list(&self) -> [Mode; 3] {
        [self.stiffest, self.most_damped, self.least_damped]
    }
}

impl Core {
    /// Largest usable step of the integrator [s].
    pub fn usable_step(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> f64 {
        if self.integrator.is_implicit() {
            return f64::INFINITY;
        }
        self.modes(go_on).map_or(f64::INFINITY, |modes| limits(self.integrator, &modes.list()).1)
    }

    /// The modes of the system as it is now.
    pub fn modes(&mut self, go_on: &(dyn Fn() -> bool + Sync)) -> Option<Modes> {
        let (k, shape) = self.largest(1.0, 0.0, go_on)?;
        let (d, damped_shape) = self.largest(0.0, 1.0, go_on)?;
        let rate_in = |system: &mut Self, shape: &[Row], (stiffness, damping)| system.rayleigh(shape, stiffness, damping).max(0.0);
        let frequency = k.max(0.0).sqrt();
        let damping = if d > 0.0 && frequency > 0.0 { rate_in(self, &shape, (0.0, 1.0)) } else { d.max(0.0) };
        let other = if d > 0.0 { rate_in(self, &damped_shape, (1.0, 0.0)).sqrt() } else { frequency };
        let culprit = (frequency > 0.0).then(|| {
            let size = |i: &usize| dot(shape[*i], shape[*i]);
            (0..shape.len()).max_by(|a, b| size(a).total_cmp(&size(b)))
        });
        let stiffest = Mode { frequency, damping };
        let mut least_damped = stiffest;
        if d > 0.0 && frequency > 0.0 {
            // The largest of w² - s c: among modes of like frequency the one that is damped least.
            let (_, shape) = self.largest(1.0, -0.5 * frequency * frequency / d, go_on)?;
            let (w_sq, c) = (rate_in(self, &shape, (1.0, 0.0)), rate_in(self, &shape, (0.0, 1.0)));
            least_damped = Mode { frequency: w_sq.sqrt(), damping: c };
        }
        Some(Modes { stiffest, most_damped: Mode { frequency: other, damping: d.max(0.0) }, least_damped, culprit: culprit.flatten() })
    }

    /// y = M^-1/2 (stiffness K + damping D) M^-1/2 u.
    fn apply(&mut self, u: &[Row], weights: (f64, f64)) -> Vec<Row> {
        let (x, masses) = (&self.state.x, &self.laws.masses);
        let root = |i: usize| masses.inverse(i, x).sqrt();
        let scaled: Vec<Row> = u.iter().enumerate().map(|(i, u)| scale(*u, root(i))).collect();
        let mut out = vec![ZERO; u.len()];
        for batch in &mut self.laws.batches {
            batch.begin_product(x, &scaled);
        }
        let batches = &self.laws.batches;
        chunks(&mut out, |start, out| batches.iter().for_each(|b| b.add_product(&scaled, start, out)));
        let group = Group::new(masses, 0, x, &self.state.v);
        for Acting { law, ranges, .. } in &self.laws.forces {
            for i in ranges.iter().cloned().flatten() {
                let (k, d) = law.largest_matrix(&group.one(i));
                let b: [Real; 6] = std::array::from_fn(|c| (weights.0 * f64::from(k[c]) + weights.1 * f64::from(d[c])) as Real);
                let s = scaled[i];
                out[i] = crate::math::add(
                    out[i],
                    [
                        b[0] * s[0] + b[3] * s[1] + b[5] * s[2],
                        b[3] * s[0] + b[1] * s[1] + b[4] * s[2],
                        b[5] * s[0] + b[4] * s[1] + b[2] * s[2],
                        0.0,
                    ],
                );
            }
        }
        out.iter_mut().enumerate().for_each(|(i, o)| *o = scale(*o, root(i)));
        out
    }

    fn prepare(&mut self, (stiffness, damping): (f64, f64)) {
        let weights = Weights { stiffness: stiffness as Real, damping: damping as Real, hessian: Hessian::Definite };
        for batch in &mut self.laws.batches {
            if batch.feels_velocity() {
                batch.begin_forces(0.0, &self.state.x, &self.state.v);
            }
            batch.foresee(&self.state.x);
            batch.linearize(&self.state.x, weights);
        }
    }

    fn rayleigh(&mut self, shape: &[Row], stiffness: f64, damping: f64) -> f64 {
        self.prepare((stiffness, damping));
        let image = self.apply(shape, (stiffness, damping));
        inner(shape, &image) / inner(shape, shape).max(1e-300)
    }

    /// The largest eigenvalue and its vector. The recurrence is run twice, so that no basis is kept: once for the
    /// tridiagonal matrix, once to add up the vector.
    fn largest(&mut self, stiffness: f64, damping: f64, go_on: &(dyn Fn() -> bool + Sync)) -> Option<(f64, Vec<Row>)> {
        self.prepare((stiffness, damping));
        let n = self.state.x.len();
        let start = || -> Vec<Row> {
            let moves = |i: usize| if self.laws.masses.inverse(i, &self.state.x) > 0.0 { 1.0 } else { 0.0 };
            // A fixed start without symmetry: fractional parts of multiples of irrational numbers.
            let part = |i: usize, a: f64| ((i as f64 + 1.0) * a).fract() - 0.5;
            let mut q: Vec<Row> = (0..n)
                .map(|i| {
                    scale([part(i, 0.754_877_666) as Real, part(i, 0.569_840_291) as Real, part(i, 0.618_033_989) as Real, 0.0], moves(i))
                })
                .collect();
            let norm = inner(&q, &q).sqrt();
            q.iter_mut().for_each(|q| *q = scale(*q, if norm > 0.0 { (1.0 / norm) as Real } else { 0.0 }));
            q
        };
        let first = start();
        let (mut alpha, mut beta) = (Vec::new(), Vec::new());
        let weights = (stiffness, damping);
        self.recurrence(&first, weights, &mut alpha, &mut beta, |_, _| go_on())?;
        let (value, weights_of) = tridiagonal_largest(&alpha, &beta);
        let mut vector = vec![ZERO; n];
        let (mut again, mut beta_again) = (Vec::new(), Vec::new());
        self.recurrence(&first, weights, &mut again, &mut beta_again, |k, q| {
            if let Some(c) = weights_of.get(k) {
                vector.iter_mut().zip(q).for_each(|(v, q)| *v = crate::math::axpy(*v, *c as Real, *q));
            }
            go_on()
        })?;
        Some((value, vector))
    }

    fn recurrence(
        &mut self,
        first: &[Row],
        weights: (f64, f64),
        alpha: &mut Vec<f64>,
        beta: &mut Vec<f64>,
        mut each: impl FnMut(usize, &[Row]) -> bool,
    ) -> Option<()> {
        let mut q = first.to_vec();
        let mut before = vec![ZERO; q.len()];
        for k in 0..STEPS {
            if !each(k, &q) {
                return None;
            }
            let mut w = self.apply(&q, weights);
            let a = inner(&w, &q);
            let b = beta.last().copied().unwrap_or(0.0);
            for i in 0..w.len() {
                w[i] = crate::math::axpy(crate::math::axpy(w[i], -a as Real, q[i]), -b as Real, before[i]);
            }
            alpha.push(a);
            let norm = inner(&w, &w).sqrt();
            let size = alpha.iter().fold(0.0_f64, |m, a| m.max(a.abs()));
            if norm <= 1e-5 * size || !norm.is_finite() {
                break;
            }
            beta.push(norm);
            w.iter_mut().for_each(|w| *w = scale(*w, (1.0 / norm) as Real));
            before = std::mem::replace(&mut q, w);
        }
        Some(())
    }
}

fn inner(a: &[Row], b: &[Row]) -> f64 {
    crate::math::parallel::sum(a.len(), |range| range.map(|i| dot(a[i], b[i])).sum())
}

/// Largest eigenvalue of a symmetric tridiagonal matrix and its vector: bisection on the count of sign changes, then the
/// recurrence of the vector from the end where it stays bounded.
fn tridiagonal_largest(alpha: &[f64], beta: &[f64]) -> (f64, Vec<f64>) {
    let n = alpha.len();
    let radius = |i: usize| if i < beta.len() { beta[i].abs() } else { 0.0 } + if i > 0 { beta[i - 1].abs() } else { 0.0 };
    let high = (0..n).map(|i| alpha[i] + radius(i)).fold(f64::NEG_INFINITY, f64::max);
    let low = (0..n).map(|i| alpha[i] - radius(i)).fold(f64::INFINITY, f64::min);
    let below_all = |x: f64| {
        // Whether every eigenvalue is below x: all pivots of T - x are negative.
        let mut pivot = alpha[0] - x;
        for i in 1..n {
            if pivot >= 0.0 {
                return false;
            }
            pivot = alpha[i] - x - beta[i - 1] * beta[i - 1] / pivot;
        }
        pivot < 0.0
    };
    let (_, high) = bisect((low, high), 100, |middle| !below_all(middle));
    // Inverse iteration just above the eigenvalue, by elimination of the definite tridiagonal matrix.
    let shift = high + 1e-9 * (1.0 + high.abs());
    let mut s = vec![1.0; n];
    for _ in 0..3 {
        let mut pivot = vec![0.0; n];
        pivot[0] = shift - alpha[0];
        for i in 1..n {
            let factor = -beta[i - 1] / pivot[i - 1];
            pivot[i] = shift - alpha[i] + factor * beta[i - 1];
            s[i] -= factor * s[i - 1];
        }
        s[n - 1] /= pivot[n - 1];
        for i in (0..n - 1).rev() {
            s[i] = (s[i] + beta[i] * s[i + 1]) / pivot[i];
        }
        let norm = s.iter().map(|s| s * s).sum::<f64>().sqrt();
        s.iter_mut().for_each(|s| *s /= norm);
    }
    (high, s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_eigenvalue_of_a_chain() {
        let n = 20;
        let (value, vector) = tridiagonal_largest(&vec![2.0; n], &vec![-1.0; n - 1]);
        let theta = std::f64::consts::PI * n as f64 / (n as f64 + 1.0);
        assert!((value - (2.0 - 2.0 * theta.cos())).abs() < 1e-12);
        for i in 1..n - 1 {
            let residual = 2.0 * vector[i] - vector[i - 1] - vector[i + 1] - value * vector[i];
            assert!(residual.abs() < 1e-6);
        }
    }
}
