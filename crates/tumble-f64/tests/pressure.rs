//! The pressure equation and its solvers, in double precision: docs/theory/pressure.md.

extern crate tumble_f64 as tumble;

use std::f64::consts::PI;
use tumble::linalg::poisson::{Excess, Fault, Method, Params, Side, Solver, Target, Weight, byte};
use tumble::math::{Lattice, Random};

const CLOSED: [Side; 2] = [Side::Closed; 2];
const OPEN: [Side; 2] = [Side::Open; 2];
const PERIODIC: [Side; 2] = [Side::Periodic; 2];

/// A column of f(i, j, k).
fn column(lattice: Lattice, f: impl Fn([usize; 3]) -> f64) -> Vec<f64> {
    let mut out = vec![0.0; lattice.len()];
    each(lattice, |cell, at| out[at] = f(cell));
    out
}

fn each(lattice: Lattice, mut f: impl FnMut([usize; 3], usize)) {
    for k in 0..lattice.n[2] {
        for j in 0..lattice.n[1] {
            for i in 0..lattice.n[0] {
                f([i, j, k], lattice.at(i, j, k));
            }
        }
    }
}

/// A box without solids.
fn empty<T: Weight>(n: [usize; 3], sides: [[Side; 2]; 3]) -> Solver<T> {
    let lattice = Lattice::new(n);
    let w = vec![T::OPEN; lattice.len()];
    Solver::new(lattice, sides, [&w, &w, &w], None).unwrap()
}

/// Open fractions of faces outside a solid with that signed distance, in cells from the lower corner.
fn cut(lattice: Lattice, distance: impl Fn([f64; 3]) -> f64) -> [Vec<u8>; 3] {
    [0, 1, 2].map(|axis| {
        let mut w = vec![0; lattice.len()];
        let up = |a: usize| lattice.n[a] + usize::from(a == axis);
        for k in 0..up(2) {
            for j in 0..up(1) {
                for i in 0..up(0) {
                    let mut x = [i, j, k].map(|i| i as f64 + 0.5);
                    x[axis] -= 0.5;
                    w[lattice.at(i, j, k)] = byte(0.5 + distance(x));
                }
            }
        }
        w
    })
}

fn sphere(n: usize) -> impl Fn([f64; 3]) -> f64 {
    let n = n as f64;
    move |x| ((x[0] - 0.45 * n).powi(2) + (x[1] - 0.5 * n).powi(2) + (x[2] - 0.55 * n).powi(2)).sqrt() - 0.2 * n
}

fn random(lattice: Lattice) -> Vec<f64> {
    let random = Random::new(1, "pressure");
    column(lattice, |[i, j, k]| random.quick((i + lattice.n[0] * (j + lattice.n[1] * k)) as u32, 0) - 0.5)
}

fn smooth(lattice: Lattice) -> Vec<f64> {
    let n = lattice.n.map(|n| n as f64);
    column(lattice, |[i, j, k]| (2.0 * i as f64 / n[0] - 1.0) + (PI * (j as f64 + 0.5) / n[1]).cos() * (3.0 * k as f64 / n[2]).sin())
}

/// |b - A q| over |b|, over the cells that have an open face, in double precision; the mean of b is no part of either.
fn left<T: Weight>(solver: &Solver<T>, b: &[f64], q: &[f64]) -> f64 {
    let mut r = vec![0.0; b.len()];
    solver.residual(b, q, &mut r);
    let mut alive = vec![0.0; b.len()];
    let ones = column(solver.lattice(), |_| 1.0);
    let _ = &ones;
    let (mut rr, mut bb, mut mean, mut cells) = (0.0, 0.0, 0.0, 0.0);
    each(solver.lattice(), |_, at| {
        // A q = 0 and q = 0: nothing to solve there.
        if q[at] != 0.0 {
            alive[at] = 1.0;
            mean += r[at];
            cells += 1.0;
        }
    });
    mean /= cells;
    each(solver.lattice(), |_, at| {
        rr += alive[at] * (r[at] - mean).powi(2);
        bb += alive[at] * (b[at] - mean).powi(2);
    });
    (rr / bb).sqrt()
}

/// The largest difference of two columns over their cells, means removed if nothing holds them.
fn difference(lattice: Lattice, a: &[f64], b: &[f64], held: bool) -> f64 {
    let (mut most, mut mean) = (0.0_f64, 0.0);
    if !held {
        each(lattice, |_, at| mean += (a[at] - b[at]) / lattice.cells() as f64);
    }
    each(lattice, |_, at| most = most.max((a[at] - b[at] - mean).abs()));
    most
}

fn params(method: Method, tolerance: f64) -> Params {
    Params { method, target: Target::Relative(tolerance), iterations: 20_000, excess: Excess::Remove }
}

/// Wave number times pi over the box's length, and whether the side value is that of a sine, for each axis.
fn wave(sides: [Side; 2], m: f64) -> (f64, fn(f64) -> f64) {
    match sides {
        CLOSED => (m * PI, f64::cos),
        OPEN => (m * PI, f64::sin),
        PERIODIC => (2.0 * m * PI, f64::sin),
        // Closed at the lower side, open at the upper one.
        _ => ((m - 0.5) * PI, f64::cos),
    }
}

/// Sides, and the shape of a box along each axis.
const BOXES: [[[Side; 2]; 3]; 5] = [
    [CLOSED, CLOSED, CLOSED],
    [OPEN, OPEN, OPEN],
    [PERIODIC, PERIODIC, PERIODIC],
    [PERIODIC, CLOSED, OPEN],
    [[Side::Closed, Side::Open], PERIODIC, CLOSED],
];

#[test]
fn solutions_are_of_order_two_whatever_the_sides() {
    for flat in [false, true] {
        for sides in BOXES {
            let error = |n: usize| {
                // Sides of 1, 0.75 and 0.5.
                let n = [n, 3 * n / 4, if flat { 1 } else { n / 2 }];
                let sides = if flat { [sides[0], sides[1], CLOSED] } else { sides };
                let lattice = Lattice::new(n);
                let waves = [0, 1, 2].map(|a| wave(sides[a], if flat && a == 2 { 0.0 } else { 1.0 + (a % 2) as f64 }));
                let exact = column(lattice, |cell| (0..3).map(|a| waves[a].1(waves[a].0 * (cell[a] as f64 + 0.5) / n[a] as f64)).product());
                // -dx² times the Laplacian.
                let k2: f64 = (0..3).map(|a| (waves[a].0 / n[a] as f64).powi(2)).sum();
                let b: Vec<f64> = exact.iter().map(|q| k2 * q).collect();
                let mut q = vec![0.0; b.len()];
                let info = empty::<u8>(n, sides).solve(&b, &mut q, &params(Method::MultigridGradients, 1e-11)).unwrap();
                assert!(info.converged && info.iterations < 25, "{sides:?} {n:?} {info:?}");
                let held = sides.iter().flatten().any(|s| *s == Side::Open);
                difference(lattice, &q, &exact, held)
            };
            let errors = [16, 32, 64].map(error);
            let order = (errors[1] / errors[2]).log2();
            println!("{sides:?} flat {flat}: {errors:?}, order {order:.3}");
            assert!((order - 2.0).abs() < 0.1 && errors[2] > 1e-5, "{sides:?} {errors:?} {order}");
        }
    }
}

#[test]
fn cycles_do_not_grow_with_the_grid_and_stand_cut_cells() {
    for n in [32, 64, 128] {
        let lattice = Lattice::new([n; 3]);
        let w = cut(lattice, sphere(n));
        let mut solver = Solver::new(lattice, [CLOSED; 3], [&w[0], &w[1], &w[2]], None).unwrap();
        for (name, b) in [("random", random(lattice)), ("smooth", smooth(lattice))] {
            let mut q = vec![0.0; b.len()];
            let info = solver.solve(&b, &mut q, &params(Method::MultigridGradients, 1e-5)).unwrap();
            println!("{n} {name}: {} {:?} {:.2e}", info.iterations, info.residuals, left(&solver, &b, &q));
            assert!(info.converged && info.iterations <= 10);
        }
    }
}
