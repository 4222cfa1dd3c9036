//! Two systems that meet in an anchor: each impulse is delivered exactly once, the energy stays, the order is one, and the order
//! of the systems does not matter. See docs/theory/coupling.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{orders, positions, run, simulation, slope, step, vector, velocities};
use safetensors::SafeTensors;
use std::sync::atomic::{AtomicU64, Ordering};
use tumble_f64::reference::Oscillator;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const MASSES: [f64; 2] = [1.0, 2.0];
/// Reduced mass [kg].
const M: f64 = 2.0 / 3.0;
/// Angular frequency of the pair [rad/s]: w dt = 0.05 at 3337 exchanges in 20 s.
const W: f64 = 8.3425;

/// Schemes of both systems: by forces, by positions on either side, and on both. A mass without elements takes the same step by either, so that
/// bounds are the same, too.
const SCHEMES: [[&str; 2]; 4] = [
    ["symplectic_euler", "symplectic_euler"],
    ["position_based", "symplectic_euler"],
    ["symplectic_euler", "position_based"],
    ["position_based", "position_based"],
];

fn systems([first, second]: [&str; 2], swapped: bool, substeps: u32) -> String {
    let one = |name: &str, scheme: &str| format!("[[system]]\nname = \"{name}\"\nintegrator = \"{scheme}\"\nsubsteps = {substeps}\n");
    let (first, second) = (one("first", first), one("second", second));
    if swapped { second + &first } else { first + &second }
}

/// The pair of [`pair`] in intervals of z = w dt each, in sub-steps of 1e-4 s; `coupling` may repeat them.
fn repeated(swapped: bool, z: f64, coupling: &str) -> Simulation {
    let dt = z / W;
    pair_with(SCHEMES[0], 1, swapped, (dt / 1e-4).ceil() as u32, 1.0 / dt, coupling)
}

/// Masses "a" and "b", each in a system of its own, on an anchor of length 1 m that is stretched by 0.1 m and belongs to a's system;
/// they also move together. `swapped` lets b's system go first.
fn pair(schemes: [&str; 2], exchanges: u32, swapped: bool, substeps: u32, fps: f64) -> Simulation {
    pair_with(schemes, exchanges, swapped, substeps, fps, "")
}

/// The same with more words.
fn pair_with(schemes: [&str; 2], exchanges: u32, swapped: bool, substeps: u32, fps: f64, more: &str) -> Simulation {
    let systems = systems(schemes, swapped, substeps);
    simulation(&format!(
        "time = {{ fps = {fps:e}, exchanges = {exchanges} }}\nworld.gravity = [0, 0, 0]\n{more}\n{systems}\
         [[particles]]\nname = \"a\"\nsystem = \"first\"\nposition = [[0, 0, 0]]\nvelocity = [[0, 0.5, 0]]\nmass = [{}]\n\
         [[particles]]\nname = \"b\"\nsystem = \"second\"\nposition = [[1.1, 0, 0]]\nvelocity = [[0, 0.5, 0]]\nmass = [{}]\n\
         [[anchor]]\nname = \"tie\"\nbetween = [\"a 0\", \"b 0\"]\nrest_length = 1.0\nstiffness = {:e}\n",
        MASSES[0],
        MASSES[1],
        M * W * W
    ))
}

/// All schemes in both orders.
fn all() -> impl Iterator<Item = ([&'static str; 2], bool)> {
    SCHEMES.into_iter().flat_map(|schemes| [(schemes, false), (schemes, true)])
}

/// Lengthening of the anchor, and its rate.
fn stretch(sim: &Simulation) -> (f64, f64) {
    let d = positions(sim, "b")[0] - positions(sim, "a")[0];
    let u = velocities(sim, "b")[0] - velocities(sim, "a")[0];
    (d.norm() - 1.0, d.normalized().dot(u))
}

/// Energy of the oscillation over that at the start.
fn energy(sim: &Simulation) -> f64 {
    let (r, speed) = stretch(sim);
    (r * r + speed * speed / (W * W)) / 0.01
}

/// Posted and delivered impulses of the exchange [N s] and the momentum in transit, from a snapshot: the number of bodies, posted, delivered, then
/// letters of ten numbers, the impulse from the fourth on.
fn exchange(sim: &Simulation) -> ([f64; 3], [f64; 3], [f64; 3]) {
    let bytes = sim.save(&[]);
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let name = tensors.names().into_iter().find(|n| n.ends_with(" exchange")).unwrap().to_string();
    let numbers: Vec<f64> =
        tensors.tensor(&name).unwrap().data().chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
    let rest = &numbers[1..];
    let three = |s: &[f64]| [s[0], s[1], s[2]];
    let mail = rest[6..].chunks_exact(16).fold([0.0; 3], |sum, m| [sum[0] + m[4], sum[1] + m[5], sum[2] + m[6]]);
    (three(rest), three(&rest[3..]), mail)
}

#[test]
fn every_impulse_is_delivered_and_momentum_is_kept() {
    for (schemes, swapped) in all() {
        for substeps in [1, 4] {
            let mut sim = pair(schemes, 20, swapped, substeps, 1.0);
            let mut worst = 0.0_f64;
            for _ in 0..20 {
                step(&mut sim);
                let (posted, delivered, mail) = exchange(&sim);
                let p = sim.ledger().momentum;
                for a in 0..3 {
                    worst = worst.max((posted[a] - delivered[a] - mail[a]).abs());
                    worst = worst.max((p[a] + mail[a] - [0.0, 1.5, 0.0][a]).abs());
                }
                assert!(posted[0].abs() > 1e-3, "something is exchanged");
                // The partner's mail is empty where it goes second; else its last impulse waits for its next turn.
                assert_eq!(mail == [0.0; 3], !swapped, "{mail:?}");
            }
            println!("{schemes:?}, swapped {swapped}, {substeps} sub-steps: impulses and momentum kept to {worst:.1e} N s");
            // 400 impulses of 0.3 N s, each rounded to 1e-17. Measured: 2.0e-15.
            assert!(worst < 1e-14);
        }
    }
}

/// The ledger holds the energy of anchors between systems, whoever owns them and whatever the scheme: what masses lose is there.
#[test]
fn the_ledger_holds_what_joins_systems() {
    for (schemes, swapped) in all() {
        let mut sim = pair(schemes, 4, swapped, 1, 40.0);
        // Both move together across, with 0.5 m/s.
        let drift = 0.5 * 0.25 * (MASSES[0] + MASSES[1]);
        let whole = 0.5 * M * W * W * 0.01;
        let mut swing = (f64::INFINITY, 0.0_f64);
        for _ in 0..40 {
            step(&mut sim);
            let (r, speed) = stretch(&sim);
            let ledger = sim.ledger();
            assert!((ledger.elastic - 0.5 * M * W * W * r * r).abs() < 1e-12 * whole, "{schemes:?} {swapped}");
            // Impulses that wait for their turn are missing from what moves.
            let moving = ledger.kinetic - drift - 0.5 * M * speed * speed;
            assert!(moving.abs() < if swapped { 0.1 * whole } else { 1e-9 * whole }, "{schemes:?} {swapped}: {moving}");
            swing = (swing.0.min(ledger.elastic / whole), swing.1.max(ledger.elastic / whole));
        }
        assert!(swing.0 < 0.05 && swing.1 > 0.9, "the spring works: {swing:?}");
    }
}

/// (coupling.2): together the two are one symplectic Euler, with the energy between (1 - z/2)/(1 + z/2) and its inverse.
#[test]
fn the_energy_stays() {
    for (schemes, swapped) in all() {
        // 3337 exchanges of 20/3337 s: w dt = 0.05.
        let mut sim = pair(schemes, 1, swapped, 1, 3337.0 / 20.0);
        let mut range = (f64::INFINITY, 0.0_f64);
        let mut all = Vec::new();
        for _ in 0..3337 {
            step(&mut sim);
            let e = energy(&sim);
            range = (range.0.min(e), range.1.max(e));
            all.push(e);
        }
        // Means over the first and the last period of 126 exchanges: within a period the energy swings.
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let ratio = mean(&all[all.len() - 126..]) / mean(&all[..126]);
        println!("{schemes:?}, swapped {swapped}: energy after 20 s x {ratio:.5}, between {:.4} and {:.4} of the start", range.0, range.1);
        // Measured: 0.99996, whichever goes first.
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
        // At the start the spring is stretched and nothing moves, x² = 1: the form x² - z x u + u² = const lets x² + u² reach
        // 1/(1 - z/2) = 1.0256. Seen with b a step ahead or behind, once more.
        assert!(range.1 < 1.053 && range.0 > 0.95, "{range:?}");
        // No drift: the line through the energies of 26 periods rises by less than a thousandth.
        let points: Vec<(f64, f64)> = all.iter().enumerate().map(|(i, e)| (i as f64 / 3337.0, *e)).collect();
        assert!(slope(&points).abs() < 1e-3, "{}", slope(&points));
    }
}

#[test]
fn the_exchange_has_order_one_whichever_system_goes_first() {
    let exact = Oscillator { frequency: W, damping: 0.0, x0: 0.1, v0: 0.0 };
    // Two masses on a line that also move along: both move with 0.5 m/s, the spring adds its part.
    let places = |t: f64| {
        let r = exact.at(t).0 - 0.1;
        [-r * M / MASSES[0], 1.1 + r * M / MASSES[1]]
    };
    let mut at_finest = Vec::new();
    for (schemes, swapped) in all() {
        let errors: Vec<f64> = (0..4)
            .map(|k| {
                let mut sim = pair(schemes, 100 << k, swapped, 1, 1.0);
                run(&mut sim, 1);
                let (a, b) = (positions(&sim, "a")[0], positions(&sim, "b")[0]);
                if k == 3 {
                    at_finest.push(a);
                }
                let [ea, eb] = places(1.0);
                (a - vector(ea, 0.5, 0.0)).norm().max((b - vector(eb, 0.5, 0.0)).norm())
            })
            .collect();
        let observed = orders(&errors);
        println!("{schemes:?}, swapped {swapped}: errors {}, orders {observed:.3?}", common::show(&errors));
        // Measured: 1.04, 1.02, 1.01, whichever goes first.
        for p in observed {
            assert!((p - 1.0).abs() < 0.2, "order {p}");
        }
        assert!(errors[3] > 1e-6 && errors[3] < 1e-3);
    }
    // The two orders differ by no more than either errs: 8.3 rad/s x 0.1 m x dt.
    for two in at_finest.chunks(2) {
        let apart = (two[0] - two[1]).norm();
        println!("the two orders end {apart:.1e} m apart");
        assert!(apart > 1e-9 && apart < W * 0.1 / 800.0);
    }
}

/// More sub-steps inside a system do not change what the exchange does: order one in its interval.
#[test]
fn sub_steps_do_not_spoil_the_energy() {
    for (schemes, swapped) in all() {
        let mut sim = pair(schemes, 1, swapped, 8, 3337.0 / 20.0);
        run(&mut sim, 3337);
        let end = energy(&sim);
        println!("{schemes:?}, swapped {swapped}, 8 sub-steps: energy after 20 s x {end:.4}");
        // A sub-step sees the other as it was published, up to an interval ago or ahead: 0.9934 and 0.9936 measured, of the 2.6 % by
        // which the energy swings.
        assert!((end - 1.0).abs() < 0.026);
    }
}

/// Masses 1, 2, 2 and 1 kg in a row, two in each system on a spring of their own, which position-based dynamics projects; the anchor joins
/// the middle ones.
fn row_of_four(schemes: [&str; 2], swapped: bool, exchanges: u32) -> Simulation {
    let two = |name: &str, system: &str, x: [f64; 2], mass: [f64; 2]| {
        format!(
            "[[particles]]\nname = \"{name}\"\nsystem = \"{system}\"\nposition = [[{}, 0, 0], [{}, 0, 0]]\nvelocity = [[0, 0.5, 0]]\nmass = {mass:?}\n\
             spring = [{{ between = [0, 1], stiffness = {SPRING}, rest_length = 1 }}]\n",
            x[0], x[1]
        )
    };
    simulation(&format!(
        "time = {{ fps = 1, exchanges = {exchanges} }}\nworld.gravity = [0, 0, 0]\n{}{}{}\
         [[anchor]]\nname = \"tie\"\nbetween = [\"a 1\", \"b 0\"]\nrest_length = 1\nstiffness = {TIE}\n",
        systems(schemes, swapped, 1),
        two("a", "first", [0.0, 1.05], [1.0, 2.0]),
        two("b", "second", [2.15, 3.1], [2.0, 1.0]),
    ))
}

const SPRING: f64 = 40.0;
const TIE: f64 = 50.0;

/// Positions after 1 s, by fourth-order Runge-Kutta in 20 000 steps, with an error below 1e-13 m.
fn row_exactly() -> [f64; 4] {
    let slope = |y: [f64; 8]| {
        let pull = |i: usize, k: f64| k * (y[i + 1] - y[i] - 1.0);
        let f = [pull(0, SPRING), pull(1, TIE), pull(2, SPRING)];
        [y[4], y[5], y[6], y[7], f[0], (f[1] - f[0]) / 2.0, (f[2] - f[1]) / 2.0, -f[2]]
    };
    let (mut y, h) = ([0.0, 1.05, 2.15, 3.1, 0.0, 0.0, 0.0, 0.0], 1.0 / 20_000.0);
    let ahead = |y: [f64; 8], k: [f64; 8], h: f64| -> [f64; 8] { std::array::from_fn(|i| y[i] + h * k[i]) };
    for _ in 0..20_000 {
        let a = slope(y);
        let b = slope(ahead(y, a, 0.5 * h));
        let c = slope(ahead(y, b, 0.5 * h));
        let d = slope(ahead(y, c, h));
        y = std::array::from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
    }
    [y[0], y[1], y[2], y[3]]
}

/// Projected systems on both sides of an anchor conserve momentum to round-off, with order one.
#[test]
fn projected_springs_on_an_anchor_keep_momentum_and_have_order_one() {
    let exact = row_exactly();
    for (schemes, swapped) in all() {
        let mut lost = 0.0_f64;
        let errors: Vec<f64> = (0..4)
            .map(|k| {
                let mut sim = row_of_four(schemes, swapped, 200 << k);
                step(&mut sim);
                let (_, _, mail) = exchange(&sim);
                let p = sim.ledger().momentum;
                (0..3).for_each(|a| lost = lost.max((p[a] + mail[a] - [0.0, 3.0, 0.0][a]).abs()));
                let x: Vec<f64> = [positions(&sim, "a"), positions(&sim, "b")].concat().iter().map(|x| x.x).collect();
                (0..4).map(|i| (x[i] - exact[i]).abs()).fold(0.0, f64::max)
            })
            .collect();
        let observed = orders(&errors);
        println!(
            "{schemes:?}, swapped {swapped}: momentum kept to {lost:.1e} N s, errors {}, orders {observed:.3?}",
            common::show(&errors)
        );
        assert!(observed.iter().all(|p| (p - 1.0).abs() < 0.2) && errors[3] > 1e-6, "{errors:?} {observed:?}");
        // 1600 steps in which places of 3 m are rounded to 4e-16 m, over their length of 6e-4 s. Measured: 3.7e-11 at most, and orders of
        // 0.95 to 1.01.
        assert!(lost < 1e-10, "{lost:e}");
    }
}

/// Largest error of either mass now [m].
fn off(sim: &Simulation) -> f64 {
    let exact = Oscillator { frequency: W, damping: 0.0, x0: 0.1, v0: 0.0 };
    let t = sim.time();
    let r = exact.at(t).0 - 0.1;
    let (a, b) = (positions(sim, "a")[0], positions(sim, "b")[0]);
    (a - vector(-r * M / MASSES[0], 0.5 * t, 0.0)).norm().max((b - vector(1.1 + r * M / MASSES[1], 0.5 * t, 0.0)).norm())
}

/// (coupling.7): repeated intervals have order two, with one system's sub-steps far below the interval.
#[test]
fn repeated_intervals_have_order_two_whichever_system_goes_first() {
    for swapped in [false, true] {
        let errors: Vec<f64> = [16_u32, 32, 64]
            .map(|n| {
                // Half of a period and a bit, in n intervals.
                let mut sim = repeated(swapped, 4.0 / f64::from(n), "world.coupling = { tolerance = 1e-9, iterations = 50 }");
                run(&mut sim, n as usize);
                off(&sim)
            })
            .to_vec();
        let observed = orders(&errors);
        println!("swapped {swapped}: errors {}, orders {observed:.3?}", common::show(&errors));
        assert!(observed.iter().all(|p| (p - 2.0).abs() < 0.3) && errors[2] > 1e-7, "{errors:?} {observed:?}");
    }
}

/// Intervals in which the pair swings almost once: taken once they explode, repeated they keep the energy, and lose no momentum.
#[test]
fn repeated_intervals_hold_where_explicit_exchange_explodes() {
    for swapped in [false, true] {
        let z = 6.0;
        let mut once = repeated(swapped, z, "");
        let mut agreed = repeated(swapped, z, "world.coupling = { tolerance = 1e-6, iterations = 100 }");
        let mut worst = (0.0_f64, 0.0_f64);
        for _ in 0..30 {
            let _ = once.step(&|| true);
            let report = agreed.step(&|| true).unwrap().unwrap();
            assert!(report.passes > 2 && report.disagreement.is_some_and(|gap| gap <= 1e-6), "{report:?}");
            let ((posted, delivered, mail), p) = (exchange(&agreed), agreed.ledger().momentum);
            for a in 0..3 {
                worst.0 = worst.0.max((posted[a] - delivered[a] - mail[a]).abs()).max((p[a] + mail[a] - [0.0, 1.5, 0.0][a]).abs());
            }
            worst.1 = worst.1.max(energy(&agreed));
        }
        println!(
            "swapped {swapped}: momentum kept to {:.1e} N s, energy at most x {:.3}; taken once x {:.1e}",
            worst.0,
            worst.1,
            energy(&once)
        );
        // Measured: 1.0, and 4e18 and 1e26 times the energy taken once.
        assert!(worst.0 < 1e-11 && worst.1 < 1.05 && worst.1 > 0.5, "{worst:?}");
        assert!(energy(&once) > 1e6 || once.frame_index() < 30, "{}", energy(&once));
        assert_eq!(agreed.warnings(), []);
    }
}

#[test]
fn systems_that_do_not_agree_are_named_and_nothing_is_lost() {
    // A third pass would find the only impulse of this linear pair by its secant.
    let mut sim = repeated(true, 2.0, "world.coupling = { tolerance = 1e-12, iterations = 2 }");
    for _ in 0..3 {
        let report = step(&mut sim);
        assert!(report.passes == 2 && report.disagreement.is_some_and(|gap| gap > 1e-12), "{report:?}");
        let ((_, _, mail), p) = (exchange(&sim), sim.ledger().momentum);
        (0..3).for_each(|a| assert!((p[a] + mail[a] - [0.0, 1.5, 0.0][a]).abs() < 1e-12));
    }
    let named: Vec<String> = sim.warnings().iter().map(|warning| format!("{} {}", warning.path, warning.message)).collect();
    assert!(named.len() == 1 && named[0].starts_with("system \"second\" what \"first\" does to it still changes by"), "{named:?}");
}

/// A front that says no within any pass leaves no trace: neither in what follows, nor as a warning.
#[test]
fn an_interval_that_is_cut_short_leaves_nothing_behind() {
    let words = "world.coupling = { tolerance = 1e-3, iterations = 9 }";
    let mut whole = repeated(true, 1.0, words);
    let asked = AtomicU64::new(0);
    let report = whole.step(&|| asked.fetch_add(1, Ordering::Relaxed) < u64::MAX).unwrap().unwrap();
    let (asked, passes) = (asked.into_inner(), report.passes);
    assert!(passes > 2 && asked > 2000, "{passes} {asked}");
    let mut cut = repeated(true, 1.0, words);
    let start = cut.hash();
    for n in [1, asked / passes, asked / passes + 1, 2 * asked / passes + 7, asked - 2] {
        let left = AtomicU64::new(0);
        assert!(cut.step(&|| left.fetch_add(1, Ordering::Relaxed) < n).unwrap().is_none(), "{n}");
        assert_eq!((cut.hash(), cut.warnings().len()), (start, 0), "{n}");
    }
    step(&mut cut);
    assert_eq!(cut.hash(), whole.hash());
    // Looks inside see the sub-steps of the first pass but the last, after which the frame ends.
    let per_system = report.steps / 2;
    let times: Vec<f64> = [1, per_system, 2 * per_system - 1, 2 * per_system]
        .map(|n| whole.inside(n, &["position"], &|| true).unwrap().map_or(f64::NAN, |inside| inside.frame.time))
        .to_vec();
    let dt = 1.0 / W;
    assert!(times[0] > dt && times[0] < 1.01 * dt && (times[1] - 2.0 * dt).abs() < 1e-9, "{times:?}");
    assert!(times[2] > 1.99 * dt && times[2] < 2.0 * dt - 1e-9, "{times:?}");
    assert!(times[3].is_nan(), "{times:?}");
}

#[test]
fn a_restored_run_repeats_with_the_same_bits() {
    let words = "world.coupling = { tolerance = 1e-3, iterations = 4 }";
    let mut whole = repeated(true, 1.0, words);
    run(&mut whole, 3);
    let saved = whole.save(&[]);
    run(&mut whole, 3);
    let mut again = repeated(true, 1.0, words);
    again.restore(&saved).unwrap();
    run(&mut again, 3);
    assert_eq!(again.hash(), whole.hash());
    assert!(stretch(&whole).0.abs() > 1e-6);
}
