//! Positions that go to their constraints one after the other end where the nearest point in the metric of the masses is:
//! docs/theory/projections.md. The same of velocities on grids: python/tests/test_fields.py.

use crate::common;

use common::Numbers;
use tumble_f64::elements::{Constraints, Distance, Linear, Members, Projected, Projection};
use tumble_f64::geometry::Walls;
use tumble_f64::math::Row;

/// Points of a chain that is bent everywhere, so that no two constraints are parallel.
const POINTS: usize = 7;
/// Size of a displacement [m]: constraints are straight to this, relatively.
const SMALL: f64 = 1e-6;

type Displacement = Vec<[f64; 3]>;

struct Chain {
    rest: Vec<Row>,
    links: Box<dyn Constraints>,
}

impl Chain {
    fn new() -> Self {
        // Inverse masses from 1/4 to 2 1/kg; the first is held.
        let w = [0.0, 1.0, 2.0, 0.25, 0.5, 1.5, 0.7];
        let mut rest = vec![[0.0, 0.0, 0.0, w[0]]];
        for i in 1..POINTS {
            let (a, b) = (0.9 * i as f64, 0.4 * i as f64 - 1.0);
            let [x, y, z, _] = rest[i - 1];
            rest.push([x + a.cos() * b.cos(), y + a.sin() * b.cos(), z + b.sin(), w[i]]);
        }
        let length = |i: usize| (0..3).map(|a| (rest[i + 1][a] - rest[i][a]).powi(2)).sum::<f64>().sqrt();
        let member = |i| Members { nodes: [i as u32, i as u32 + 1], rest: [length(i)], law: [], stiffness: f64::INFINITY, damping: 0.0 };
        let members: Vec<_> = (0..POINTS - 1).map(member).collect();
        let links = Projected::<Distance, Linear, 2, 1, 1, 0>::new(POINTS, POINTS, &[], &members, &[]).unwrap();
        Self { rest, links: Box::new(links) }
    }

    /// The remainder of a displacement after repeated sweeps over all links.
    fn project(&mut self, d: &Displacement, sweeps: usize) -> Displacement {
        let mut x: Vec<Row> =
            self.rest.iter().zip(d).map(|(r, d)| [r[0] + SMALL * d[0], r[1] + SMALL * d[1], r[2] + SMALL * d[2], r[3]]).collect();
        let step = Projection { h: 1.0, before: &[], iteration: 0, iterations: 1, plain: None, walls: Walls::default() };
        (0..sweeps).for_each(|_| self.links.project(&mut x, &step));
        x.iter().zip(&self.rest).map(|(x, r)| [0, 1, 2].map(|a| (x[a] - r[a]) / SMALL)).collect()
    }

    /// The inner product in the metric of the masses.
    fn product(&self, a: &Displacement, b: &Displacement) -> f64 {
        let mass = |i: usize| if self.rest[i][3] > 0.0 { 1.0 / self.rest[i][3] } else { 0.0 };
        (0..POINTS).map(|i| mass(i) * (0..3).map(|c| a[i][c] * b[i][c]).sum::<f64>()).sum()
    }

    /// The largest lengthening of a link, to first order.
    fn off(&self, d: &Displacement) -> f64 {
        let of = |i: usize| {
            let along = [0, 1, 2].map(|a| self.rest[i + 1][a] - self.rest[i][a]);
            (0..3).map(|a| along[a] * (d[i + 1][a] - d[i][a])).sum::<f64>().abs()
        };
        (0..POINTS - 1).map(of).fold(0.0, f64::max)
    }
}

fn minus(a: &Displacement, b: &Displacement) -> Displacement {
    a.iter().zip(b).map(|(a, b)| [0, 1, 2].map(|c| a[c] - b[c])).collect()
}

#[test]
fn links_in_turn_find_the_nearest_point_in_the_metric_of_the_masses() {
    let mut chain = Chain::new();
    let mut numbers = Numbers(3);
    let mut some = || -> Displacement { (0..POINTS).map(|i| if i == 0 { [0.0; 3] } else { <[f64; 3]>::from(numbers.vector()) }).collect() };
    let (a, b) = (some(), some());
    let (pa, pb) = (chain.project(&a, 500), chain.project(&b, 500));
    let size = chain.product(&a, &a).sqrt() * chain.product(&b, &b).sqrt();
    // Constraints are curved: their second order, SMALL, is all that is left, and rounding of positions, 2e-16/SMALL.
    let near = 10.0 * SMALL;
    assert!(chain.off(&a) > 0.5 && chain.off(&pa) < near, "{} {}", chain.off(&a), chain.off(&pa)); // 0.98, 2.5e-6
    // Projecting twice is projecting once.
    let twice = minus(&chain.project(&pa, 500), &pa);
    assert!(chain.product(&twice, &twice).sqrt() < near);
    // Self-adjoint in the metric of the masses.
    let (left, right) = (chain.product(&a, &pb), chain.product(&pa, &b));
    println!("<a, P b> = {left}, <P a, b> = {right}");
    assert!(left.abs() > 0.1 * size && (left - right).abs() < near * size, "{left} {right}");
    // The change is orthogonal to every displacement that keeps all lengths, so that no other is nearer.
    let change = minus(&a, &pa);
    let across = chain.product(&change, &pb) / (chain.product(&change, &change) * chain.product(&pb, &pb)).sqrt();
    println!("cosine of change and kept: {across:e}");
    assert!(across.abs() < near, "{across}");
    let energies = chain.product(&a, &a) - chain.product(&pa, &pa) - chain.product(&change, &change);
    assert!(energies.abs() < near * chain.product(&a, &a), "{energies}");
    // Stopped early it is none of that: a few turns are a few sweeps of Gauss-Seidel.
    let early = chain.project(&a, 3);
    assert!(chain.off(&early) > 1e-3, "{}", chain.off(&early));
}
