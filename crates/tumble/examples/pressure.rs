//! Times of the pressure solvers around a solid sphere with cut cells, and in an empty box.
//!
//!   cargo run --release -p tumble --example pressure -- 128 7
//!
//! takes the best of 7 runs at 128 cells a side. The residual is evaluated in double precision.

use std::time::Instant;
use tumble::linalg::poisson::{Excess, Info, Method, Params, Side, Solver, Target, Weight, byte};
use tumble::math::{Lattice, Random, Real};

fn main() {
    let mut words = std::env::args().skip(1).filter_map(|word| word.parse().ok());
    let (n, runs): (usize, usize) = (words.next().unwrap_or(128), words.next().unwrap_or(5));
    let lattice = Lattice::new([n; 3]);
    let bytes = sphere(lattice, n as f64);
    let numbers = [0, 1, 2].map(|axis| bytes[axis].iter().map(|w: &u8| w.value()).collect::<Vec<Real>>());
    let (random, smooth) = sides(lattice);
    let started = Instant::now();
    let made = Solver::new(lattice, [[Side::Closed; 2]; 3], [&bytes[0], &bytes[1], &bytes[2]], None);
    println!("set-up {:.1} ms", 1e3 * started.elapsed().as_secs_f64());
    if let (Ok(solver), Ok(other)) = (made, Solver::new(lattice, [[Side::Closed; 2]; 3], [&numbers[0], &numbers[1], &numbers[2]], None)) {
        let (mut solver, mut other) = (solver, other);
        for (name, b) in [("random", &random), ("smooth", &smooth)] {
            time(&format!("bytes, {name}"), &mut solver, b, runs, Method::MultigridGradients);
            time(&format!("numbers, {name}"), &mut other, b, runs, Method::MultigridGradients);
        }
        if std::env::args().any(|word| word == "ladder") {
            for method in Method::ALL {
                time(method.name(), &mut solver, &random, 1, method);
            }
        }
    }
    let open = vec![u8::OPEN; lattice.len()];
    if let Ok(mut solver) = Solver::new(lattice, [[Side::Closed; 2]; 3], [&open, &open, &open], None) {
        for (name, b) in [("random", &random), ("smooth", &smooth)] {
            time(&format!("box, transform, {name}"), &mut solver, b, runs, Method::Cosine);
            time(&format!("box, multigrid, {name}"), &mut solver, b, runs, Method::MultigridGradients);
        }
    }
}

fn time<T: Weight>(name: &str, solver: &mut Solver<T>, b: &[Real], runs: usize, method: Method) {
    let params = Params { method, target: Target::Relative(1e-5), iterations: 5000, excess: Excess::Remove };
    let mut q = vec![0.0; b.len()];
    let mut best = f64::INFINITY;
    let mut last = None;
    for _ in 0..runs {
        let started = Instant::now();
        last = Some(solver.solve(b, &mut q, &params));
        best = best.min(started.elapsed().as_secs_f64());
    }
    let mut double = vec![0.0; b.len()];
    let started = Instant::now();
    let refined = solver.solve_double(b, &mut double, &params);
    let of_refined = started.elapsed().as_secs_f64();
    let say = |info: &Info| format!("{} iterations, {:.1e}", info.iterations, info.residual());
    match (last, refined) {
        (Some(Ok(info)), Ok(refined)) => {
            println!("{name:24} {:8.1} ms: {}; refined {:.1} ms: {}", 1e3 * best, say(&info), 1e3 * of_refined, say(&refined));
        }
        (Some(Err(fault)), _) | (_, Err(fault)) => println!("{name:24} {fault}"),
        (None, _) => println!("{name:24} no runs"),
    }
}

/// Open fractions around a sphere a little beside the centre.
fn sphere(lattice: Lattice, n: f64) -> [Vec<u8>; 3] {
    [0, 1, 2].map(|axis| {
        let mut w = vec![0; lattice.len()];
        for k in 0..lattice.n[2] {
            for j in 0..lattice.n[1] {
                for i in 0..lattice.n[0] {
                    let mut x = [i, j, k].map(|i| i as f64 + 0.5);
                    x[axis] -= 0.5;
                    let d = [x[0] - 0.45 * n, x[1] - 0.5 * n, x[2] - 0.55 * n];
                    w[lattice.at(i, j, k)] = byte(0.5 + (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() - 0.2 * n);
                }
            }
        }
        w
    })
}

/// A random right-hand side, and a smooth one.
fn sides(lattice: Lattice) -> (Vec<Real>, Vec<Real>) {
    let (mut random, mut smooth) = (vec![0.0; lattice.len()], vec![0.0; lattice.len()]);
    let draw = Random::new(1, "pressure");
    let n = lattice.n.map(|n| n as f64);
    for k in 0..lattice.n[2] {
        for j in 0..lattice.n[1] {
            for i in 0..lattice.n[0] {
                let at = lattice.at(i, j, k);
                random[at] = (draw.quick(at as u32, 0) - 0.5) as Real;
                let [x, y, z] = [i as f64 / n[0], j as f64 / n[1], k as f64 / n[2]];
                smooth[at] = ((2.0 * x - 1.0) + (3.0 * y).cos() * (3.0 * z).sin()) as Real;
            }
        }
    }
    (random, smooth)
}
