//! Orders and errors of every scheme against exact orbits: Kepler's with e = 0.5, Arenstorf's and the Pleiades.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, fixed, orders, positions, run, simulation, slope, step, vector, velocities};
use tumble_f64::integrators::{Equation, Kinematics, Memory, Scratch, Stage, adaptive_step};
use tumble_f64::math::{Row, ZERO};
use tumble_f64::reference::Kepler;
use tumble_f64::reference::orbits::{arenstorf, pleiades};
use tumble_f64::state::Frames;
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;
use tumble_interface::scene::{Adaptive, Integrator};

const ORBIT: Kepler = Kepler { gm: 1.0, semi_major: 1.0, eccentricity: 0.5 };
/// The orbit is followed from here, past the apocentre, to its end: no symmetry helps.
const START: f64 = 0.4;
const TIME: f64 = 3.0;

/// State of the orbit in a plane that is turned in space, about a centre off the origin.
fn exact(t: f64) -> (Vector, Vector) {
    let (p, q) = (vector(0.6, 0.0, 0.8), vector(0.64, 0.6, -0.48));
    let turn = |v: Vector| p * v.x + q * v.y;
    let (x, v) = ORBIT.at(t);
    (turn(x) + vector(0.3, -0.2, 0.1), turn(v))
}

fn scene(scheme: Integrator, settings: &str) -> String {
    let (x, v) = exact(START);
    format!(
        "time.fps = {:e}\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{}\"\n{settings}\n\
         [[particles]]\nname = \"p\"\nmass = [2.5]\nposition = {}\nvelocity = {}\n\
         [[force]]\nkind = \"attraction\"\ncenter = [0.3, -0.2, 0.1]\ngm = 1\n",
        1.0 / TIME,
        scheme.name(),
        common::list(&[x]),
        common::list(&[v]),
    )
}

/// Distance of (x, v) to the exact state at the end.
fn error(x: Vector, v: Vector) -> f64 {
    let (ex, ev) = exact(START + TIME);
    ((x - ex).norm_sq() + (v - ev).norm_sq()).sqrt()
}

#[test]
fn observed_orders_are_those_of_theory() {
    for scheme in fixed() {
        // Steps small enough that the next power of h is below 10 % of the error at the finest, errors above 1e-12.
        let coarse = match scheme.order() {
            1 => 2000,
            2 => 400,
            _ => 60,
        };
        let errors: Vec<f64> = (0..4)
            .map(|k| {
                let mut sim = simulation(&scene(scheme, &format!("substeps = {}\nsolver.newton_tolerance = 1e-12", coarse << k)));
                run(&mut sim, 1);
                error(positions(&sim, "p")[0], velocities(&sim, "p")[0])
            })
            .collect();
        let observed = orders(&errors);
        println!("{:18} errors {}, orders {observed:.3?}", scheme.name(), common::show(&errors));
        // Measured: within 0.02 of theory at every step, but for RK4 with 4.15, 4.08, 4.04.
        for p in &observed {
            assert!((p - f64::from(scheme.order())).abs() < 0.2, "{} has order {p}", scheme.name());
        }
        assert!(errors[3] > 1e-13 && errors[0] < 0.5, "errors in the range where orders show");
    }
}

/// y'' = a(x, v) for some bodies, given as a function.
struct Motion<F> {
    acceleration: F,
    evaluations: usize,
}

impl<F: FnMut(&[Row], &[Row], &mut [Row])> Motion<F> {
    fn new(acceleration: F) -> Self {
        Self { acceleration, evaluations: 0 }
    }
}

impl<F: FnMut(&[Row], &[Row], &mut [Row])> Equation for Motion<F> {
    fn kinematics(&self) -> Kinematics {
        Kinematics { frames: Frames::default(), second_order: true }
    }

    fn rate(&mut self, _: f64, x: &[Row], v: &[Row], out: &mut [Row]) -> Result<(), StepError> {
        self.evaluations += 1;
        (self.acceleration)(x, v, out);
        Ok(())
    }

    fn solve(&mut self, _: &Stage<'_>, _: &mut [Row], _: &mut [Row], _: &mut StepReport) -> Result<(), StepError> {
        panic!("explicit schemes only")
    }
}

fn kepler() -> Motion<impl FnMut(&[Row], &[Row], &mut [Row])> {
    Motion::new(|x: &[Row], _: &[Row], out: &mut [Row]| {
        let d = Vector::from([x[0][0], x[0][1], x[0][2]]) - vector(0.3, -0.2, 0.1);
        let a = d * (-1.0 / d.norm().powi(3));
        out[0] = [a.x, a.y, a.z, 0.0];
    })
}

fn row(v: Vector) -> Row {
    [v.x, v.y, v.z, 0.0]
}

fn point(row: Row) -> Vector {
    [row[0], row[1], row[2]].into()
}

/// Dormand-Prince with n equal steps: a tolerance that accepts everything, and the step set before each.
fn dormand_prince_fixed(equation: &mut dyn Equation, time: f64, n: u32, x: &mut [Row], v: &mut [Row]) {
    let settings = Adaptive { tolerance: 1e300, ..Adaptive::default() };
    let (mut memory, mut scratch, mut report) =
        (Memory::new(Integrator::DormandPrince, x.len()), Scratch::default(), StepReport::default());
    let h = time / f64::from(n);
    for k in 0..n {
        memory.next_step = h;
        let y = (&mut *x, &mut *v);
        let taken = adaptive_step(
            Integrator::DormandPrince,
            &settings,
            equation,
            (f64::from(k) * h, time, time),
            y,
            &mut memory,
            &mut scratch,
            &mut report,
        );
        assert_eq!(taken, Ok(h));
    }
}

#[test]
fn dormand_prince_has_order_five() {
    // From the pericentre on: elsewhere the error term of order 5, which the scheme was designed to make small, is still
    // below that of order 6 when both drown in round-off (observed order 5.7 from START on).
    let errors: Vec<f64> = (0..4)
        .map(|k| {
            let (x, v) = exact(0.0);
            let (mut x, mut v) = ([row(x)], [row(v)]);
            let mut equation = kepler();
            dormand_prince_fixed(&mut equation, TIME, 80 << k, &mut x, &mut v);
            // The last stage of a step is the first of the next: six evaluations a step, and one at the start.
            assert_eq!(equation.evaluations, 6 * (80 << k) + 1);
            let (ex, ev) = exact(TIME);
            ((point(x[0]) - ex).norm_sq() + (point(v[0]) - ev).norm_sq()).sqrt()
        })
        .collect();
    // Measured: 5.01, 5.14, 5.11.
    let observed = orders(&errors);
    println!("dormand_prince     errors {}, orders {observed:.3?}", common::show(&errors));
    for p in &observed {
        assert!((p - 5.0).abs() < 0.2, "order {p}");
    }
}

/// Follows an equation to `time` in adaptive steps; `each` sees every accepted step: state before, after, and its length.
fn follow(
    scheme: Integrator,
    settings: &Adaptive,
    equation: &mut dyn Equation,
    time: f64,
    x: &mut [Row],
    v: &mut [Row],
    mut each: impl FnMut((&[Row], &[Row]), (&[Row], &[Row]), f64),
) -> StepReport {
    let (mut memory, mut scratch, mut report) = (Memory::new(scheme, x.len()), Scratch::default(), StepReport::default());
    let mut done = 0.0;
    while done < time {
        let before = (x.to_vec(), v.to_vec());
        let left = time - done;
        let h = adaptive_step(scheme, settings, equation, (done, left, time), (x, v), &mut memory, &mut scratch, &mut report).unwrap();
        each((&before.0, &before.1), (x, v), h);
        done = if h == left { time } else { done + h };
    }
    report
}

/// The estimate that schemes control is honest: what a step really adds, against an accurate solution from the same start, stays
/// within the tolerance.
#[test]
fn the_local_error_of_adaptive_schemes_is_within_the_tolerance() {
    for (scheme, tolerance) in [
        (Integrator::AdaptiveEuler, 1e-4),
        (Integrator::AdaptiveEuler, 1e-6),
        (Integrator::DormandPrince, 1e-5),
        (Integrator::DormandPrince, 1e-8),
        (Integrator::DormandPrince, 1e-11),
    ] {
        let (x, v) = exact(START);
        let (mut x, mut v) = ([row(x)], [row(v)]);
        let settings = Adaptive { tolerance, ..Adaptive::default() };
        let (mut worst, mut steps) = (0.0_f64, 0);
        let report = follow(scheme, &settings, &mut kepler(), ORBIT.period(), &mut x, &mut v, |before, after, h| {
            let (mut ex, mut ev) = (before.0.to_vec(), before.1.to_vec());
            // 16 steps of order 5 err by 16^-5 = 1e-6 of what one does.
            dormand_prince_fixed(&mut kepler(), h, 16, &mut ex, &mut ev);
            let off = |a: Row, b: Row| point(a) - point(b);
            let (dx, dv) = (off(ex[0], after.0[0]), off(ev[0], after.1[0]));
            let error = match scheme {
                // The distance of positions, as taught.                 (integrators.8)
                Integrator::AdaptiveEuler => dx.norm(),
                // The largest component of positions and velocities.    (integrators.9)
                _ => [dx.x, dx.y, dx.z, dv.x, dv.y, dv.z].into_iter().fold(0.0, |m: f64, c| m.max(c.abs())),
            };
            worst = worst.max(error / tolerance);
            steps += 1;
        });
        let estimated = report.trials.iter().filter(|t| t.accepted).map(|t| t.error).fold(0.0, f64::max);
        println!(
            "{} at {tolerance:.0e}: local error at most {worst:.3} of the tolerance in {steps} steps (estimated {estimated:.3})",
            scheme.name()
        );
        match scheme {
            // The estimate h²/4 |a| is the error up to h³: 3 % at the largest steps of 1e-4. Measured: 0.837, 0.813.
            Integrator::AdaptiveEuler => assert!((0.7..1.04).contains(&worst), "{worst}"),
            // It is that of order 4; the result of order 5 is better. Measured: 0.66, 0.13, 0.025.
            _ => assert!((1e-4..1.0).contains(&worst), "{worst}"),
        }
    }
}

/// The log in the report of a frame: accepted and rejected trials, in order, without a gap.
#[test]
fn every_trial_is_logged() {
    for (scheme, tolerance) in [(Integrator::AdaptiveEuler, 1e-5), (Integrator::DormandPrince, 1e-9)] {
        let mut sim = simulation(&scene(scheme, &format!("adaptive.tolerance = {tolerance:e}\nadaptive.first_step = 0.5")));
        let mut rejected = 0;
        for frame in 0..4 {
            let report = step(&mut sim);
            let start = TIME * f64::from(frame);
            let mut time = start;
            let mut range = (f64::INFINITY, 0.0_f64);
            for trial in &report.trials {
                assert!((trial.time - time).abs() < 1e-12, "{trial:?} at {time}");
                assert_eq!(trial.accepted, trial.error <= 1.0, "{trial:?}");
                if trial.accepted {
                    time += trial.step;
                    range = (range.0.min(trial.step), range.1.max(trial.step));
                }
            }
            assert!((time - start - TIME).abs() < 1e-12);
            assert_eq!(report.step_range, Some(range));
            let accepted = report.trials.iter().filter(|t| t.accepted).count() as u64;
            assert_eq!((report.steps, report.rejected), (accepted, report.trials.len() as u64 - accepted));
            rejected += report.rejected;
            // A rejected trial is tried again from the same time with a shorter step.
            for pair in report.trials.windows(2).filter(|p| !p[0].accepted) {
                assert!(pair[1].time == pair[0].time && pair[1].step < pair[0].step);
            }
        }
        println!("{}: {rejected} trials rejected in 4 frames", scheme.name());
        assert!(rejected > 0, "the first step of 0.5 is too long");
    }
}

/// A tolerance far below what is of use takes time, not memory: the log ends, the counts go on.
#[test]
fn the_log_of_trials_is_bounded() {
    let mut sim = simulation(&scene(Integrator::AdaptiveEuler, "adaptive.tolerance = 1e-12"));
    let report = step(&mut sim);
    println!("{} steps", report.steps);
    assert!(report.steps > StepReport::MOST_TRIALS as u64);
    assert_eq!(report.trials.len(), StepReport::MOST_TRIALS);
    let mut total = report.clone();
    total.add_interval(&report);
    assert_eq!((total.trials.len(), total.steps), (StepReport::MOST_TRIALS, 2 * report.steps));
}

fn bodies() -> Motion<impl FnMut(&[Row], &[Row], &mut [Row])> {
    Motion::new(|x: &[Row], _: &[Row], out: &mut [Row]| {
        let places: [[f64; 2]; 7] = std::array::from_fn(|i| [x[i][0], x[i][1]]);
        for (i, out) in out.iter_mut().enumerate() {
            let [ax, ay] = pleiades::acceleration(&places, i);
            *out = [ax, ay, 0.0, 0.0];
        }
    })
}

fn moon() -> Motion<impl FnMut(&[Row], &[Row], &mut [Row])> {
    Motion::new(|x: &[Row], v: &[Row], out: &mut [Row]| {
        let [ax, ay] = arenstorf::acceleration([x[0][0], x[0][1]], [v[0][0], v[0][1]]);
        out[0] = [ax, ay, 0.0, 0.0];
    })
}

fn flat<const N: usize>(points: [[f64; 2]; N]) -> [Row; N] {
    points.map(|[x, y]| [x, y, 0.0, 0.0])
}

/// Distance at the end and count of evaluations at one tolerance.
fn arenstorf_at(tolerance: f64) -> (f64, usize) {
    let (mut x, mut v) = (flat([arenstorf::POSITION]), flat([arenstorf::VELOCITY]));
    let settings = Adaptive { tolerance, ..Adaptive::default() };
    let mut equation = moon();
    follow(Integrator::DormandPrince, &settings, &mut equation, arenstorf::PERIOD, &mut x, &mut v, |_, _, _| {});
    let end = arenstorf::POSITION;
    ((x[0][0] - end[0]).hypot(x[0][1] - end[1]), equation.evaluations)
}

fn pleiades_at(tolerance: f64) -> (f64, usize) {
    let (mut x, mut v) = (flat(pleiades::POSITION), flat(pleiades::VELOCITY));
    let settings = Adaptive { tolerance, ..Adaptive::default() };
    let mut equation = bodies();
    follow(Integrator::DormandPrince, &settings, &mut equation, pleiades::END, &mut x, &mut v, |_, _, _| {});
    let off = |i: usize| (x[i][0] - pleiades::POSITION_AT_END[i][0]).hypot(x[i][1] - pleiades::POSITION_AT_END[i][1]);
    ((0..7).map(off).fold(0.0, f64::max), equation.evaluations)
}

#[test]
fn the_global_error_of_dormand_prince_is_proportional_to_the_tolerance() {
    for (name, problem) in [("arenstorf", arenstorf_at as fn(f64) -> (f64, usize)), ("pleiades", pleiades_at)] {
        // Quarters of a decade: the error of a single tolerance also depends on how the steps happen to fall.
        let tolerances: Vec<f64> = (24..=44).map(|k| 10.0_f64.powf(-0.25 * f64::from(k))).collect();
        let found: Vec<(f64, usize)> = tolerances.iter().map(|t| problem(*t)).collect();
        for (t, (e, n)) in tolerances.iter().zip(&found).step_by(4) {
            println!("{name} at {t:.0e}: error {e:.2e}, {n} evaluations");
        }
        let points: Vec<(f64, f64)> = tolerances.iter().zip(&found).map(|(t, (e, _))| (t.log10(), e.log10())).collect();
        let slope = slope(&points);
        println!("{name}: slope of log error over log tolerance {slope:.3}");
        // Measured: 0.877 (Arenstorf), 1.127 (Pleiades, where at loose tolerances the error term of order 6 is the larger one).
        assert!((slope - 1.0).abs() < 0.2, "{name}: {slope}");
        // The end states are those of the references: they are known to 1e-10 (Arenstorf, which returns to 1.6e-10 at 3e-14)
        // and 1e-11 (Pleiades).
        let (error, evaluations) = found[found.len() - 1];
        assert!(error > 5e-12, "{name}: {error:e}");
        // Measured: 1.2e-9 with 8777, 5.6e-11 with 13724.
        let (bound, most) = if name == "arenstorf" { (5e-9, 12_000) } else { (5e-10, 20_000) };
        assert!(error < bound && evaluations < most, "{name}: {error:e} with {evaluations}");
    }
}

/// The same slope on problems that the controller's constants were not chosen on: they were tuned on Arenstorf's orbit and the
/// Pleiades (ten settings were tried), so that those two alone would prove little.
#[test]
fn the_proportionality_holds_on_problems_it_was_not_tuned_on() {
    let eccentric = |e| {
        let orbit = Kepler { gm: 1.0, semi_major: 1.0, eccentricity: e };
        move |tolerance: f64| {
            let ((x, v), (end, _)) = (orbit.at(0.4), orbit.at(0.4 + 12.0));
            let center = vector(0.3, -0.2, 0.1);
            let (mut x, mut v) = ([row(x + center)], [row(v)]);
            let settings = Adaptive { tolerance, ..Adaptive::default() };
            follow(Integrator::DormandPrince, &settings, &mut kepler(), 12.0, &mut x, &mut v, |_, _, _| {});
            (point(x[0]) - center - end).norm()
        }
    };
    // Van der Pol's oscillator, mu = 3, over two and a half cycles of relaxation, against 2^17 steps of fixed length.
    let van_der_pol = || {
        Motion::new(|x: &[Row], v: &[Row], out: &mut [Row]| {
            out[0] = [3.0 * (1.0 - x[0][0] * x[0][0]) * v[0][0] - x[0][0], 0.0, 0.0, 0.0];
        })
    };
    let start = || ([[2.0, 0.0, 0.0, 0.0]], [ZERO]);
    let (mut end, mut end_v) = start();
    dormand_prince_fixed(&mut van_der_pol(), 22.0, 1 << 17, &mut end, &mut end_v);
    let relaxation = |tolerance: f64| {
        let (mut x, mut v) = start();
        let settings = Adaptive { tolerance, ..Adaptive::default() };
        follow(Integrator::DormandPrince, &settings, &mut van_der_pol(), 22.0, &mut x, &mut v, |_, _, _| {});
        (x[0][0] - end[0][0]).abs().hypot(v[0][0] - end_v[0][0])
    };
    let problems: [(&str, &dyn Fn(f64) -> f64); 3] =
        [("Kepler, e = 0.6", &eccentric(0.6)), ("Kepler, e = 0.9", &eccentric(0.9)), ("van der Pol", &relaxation)];
    for (name, problem) in problems {
        let tolerances: Vec<f64> = (24..=44).map(|k| 10.0_f64.powf(-0.25 * f64::from(k))).collect();
        let points: Vec<(f64, f64)> = tolerances.iter().map(|t| (t.log10(), problem(*t).log10())).collect();
        let slope = slope(&points);
        println!("{name}: slope of log error over log tolerance {slope:.3}, error {:.1e} at 1e-11", 10.0_f64.powf(points[20].1));
        // Measured: 1.036, 1.057, 1.050.
        assert!((slope - 1.0).abs() < 0.2, "{name}: {slope}");
    }
}

/// A gate for codes with adaptive steps (../shared/validation, 1.2): 1e-5 with at most 5000 evaluations.
#[test]
fn arenstorf_closes_cheaply() {
    let (error, evaluations) = arenstorf_at(1e-9);
    println!("arenstorf at 1e-9: {error:.1e} with {evaluations} evaluations");
    // Measured: 1.0e-7 with 3760.
    assert!(error < 1e-5 && evaluations < 5000);
    // On the way: the checkpoints, to their eight decimals and the error at that time.
    for (time, place) in arenstorf::CHECKPOINTS {
        let (mut x, mut v) = (flat([arenstorf::POSITION]), flat([arenstorf::VELOCITY]));
        let settings = Adaptive { tolerance: 1e-11, ..Adaptive::default() };
        follow(Integrator::DormandPrince, &settings, &mut moon(), time, &mut x, &mut v, |_, _, _| {});
        let off = (x[0][0] - place[0]).hypot(x[0][1] - place[1]);
        println!("arenstorf at t = {time:.3}: {off:.1e} from the reference");
        assert!(off < 2e-8);
        let constant = arenstorf::jacobi([x[0][0], x[0][1]], [v[0][0], v[0][1]]);
        assert!((constant - arenstorf::JACOBI).abs() < 1e-8);
        assert_eq!(x[0][2..], ZERO[2..]);
    }
}
