//! Solves a pressure system that another program has written, for benchmarks:
//!
//!   pressure_file FOLDER CELLS METHOD RUNS refined|once
//!
//! reads the weights of the lower faces (`w0`, `w1`, `w2`, bytes of 127 parts) and the right-hand side (`b`, single precision) of a
//! closed cube of CELLS cells a side, x fastest, and writes the solution to a relative residual of 1e-5 (`q`, double precision): refined until its residual in double
//! precision is that, or solved once in single precision.
//! Prints, as JSON, the seconds of the set-up and of the median solve, and iterations and passes of refinement.

use std::path::Path;
use std::time::Instant;
use tumble::linalg::poisson::{Excess, Info, Method, Params, Side, Solver, Target};
use tumble::math::{Lattice, Real};

fn main() -> Result<(), String> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [folder, cells, method, runs, how] = &words[..] else { return Err("expected FOLDER CELLS METHOD RUNS refined|once".to_string()) };
    let (Ok(n), Ok(runs)) = (cells.parse::<usize>(), runs.parse::<usize>()) else { return Err("no numbers".to_string()) };
    let Some(method) = Method::ALL.into_iter().find(|m| m.name() == method) else { return Err(format!("no method {method}")) };
    let lattice = Lattice::new([n; 3]);
    let read = |name: &str| std::fs::read(Path::new(folder).join(name)).map_err(|e| format!("{name}: {e}"));
    let each = || (0..n).flat_map(move |k| (0..n).flat_map(move |j| (0..n).map(move |i| lattice.at(i, j, k))));
    let mut w = [(); 3].map(|()| vec![0_u8; lattice.len()]);
    for (axis, w) in w.iter_mut().enumerate() {
        each().zip(read(&format!("w{axis}"))?).for_each(|(at, byte)| w[at] = byte);
    }
    let mut b: Vec<Real> = vec![0.0; lattice.len()];
    let bytes = read("b")?;
    each().zip(bytes.as_chunks::<4>().0).for_each(|(at, four)| b[at] = Real::from(f32::from_le_bytes(*four)));
    let started = Instant::now();
    let made = Solver::new(lattice, [[Side::Closed; 2]; 3], [&w[0], &w[1], &w[2]], None);
    let set_up = started.elapsed().as_secs_f64();
    let mut solver = made.map_err(|fault| fault.to_string())?;
    let params = Params { method, target: Target::Relative(1e-5), iterations: 100, excess: Excess::Remove };
    let (mut single, mut q) = (vec![0.0 as Real; lattice.len()], vec![0.0_f64; lattice.len()]);
    let mut times = Vec::new();
    let mut info = Info::default();
    // The first one warms up.
    for run in 0..=runs {
        let started = Instant::now();
        let solved = if how == "once" { solver.solve(&b, &mut single, &params) } else { solver.solve_double(&b, &mut q, &params) };
        info = solved.map_err(|fault| fault.to_string())?;
        if run > 0 {
            times.push(started.elapsed().as_secs_f64());
        }
    }
    if how == "once" {
        q.iter_mut().zip(&single).for_each(|(q, single)| *q = f64::from(*single));
    }
    times.sort_by(f64::total_cmp);
    let solution: Vec<u8> = each().flat_map(|at| q[at].to_le_bytes()).collect();
    std::fs::write(Path::new(folder).join("q"), solution).map_err(|e| e.to_string())?;
    let seconds = times.get(times.len() / 2).copied().unwrap_or(f64::NAN);
    println!(
        "{{\"set_up\": {set_up}, \"seconds\": {seconds}, \"iterations\": {}, \"refinements\": {}}}",
        info.iterations, info.refinements
    );
    Ok(())
}
