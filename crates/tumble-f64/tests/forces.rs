//! Forces on single masses against exact motions, and fields against their definitions.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Numbers, Vector, fixed, orders, positions, run, show, simulation, vector, velocities};
use tumble_f64::forces::Acceleration;
use tumble_f64::forces::{
    Attraction, Current, Drag, Electric, Flow, Force, Group, Magnetic, Medium, One, Propulsion, Turbulence, Vortex, Wind,
};
use tumble_f64::math::formula::Of;
use tumble_f64::math::{Row, VectorSignal};
use tumble_interface::Scene;
use tumble_interface::scene::{AnimatedVector, Integrator};

/// One particle for `time` seconds in one frame.
fn flight(integrator: &str, substeps: u32, time: f64, start: (Vector, Vector), particle: &str, forces: &str) -> (Vector, Vector) {
    let text = format!(
        "time.fps = {:e}\n[[system]]\nintegrator = \"{integrator}\"\nsubsteps = {substeps}\nsolver.newton_tolerance = 1e-12\n\
         [[particles]]\nname = \"p\"\nposition = {}\nvelocity = {}\n{particle}\n{forces}",
        1.0 / time,
        common::list(&[start.0]),
        common::list(&[start.1]),
    );
    let mut sim = simulation(&text);
    run(&mut sim, 1);
    (positions(&sim, "p")[0], velocities(&sim, "p")[0])
}

#[test]
fn a_projectile_with_linear_drag_flies_as_calculus_says() {
    let (x0, v0, k, m, time) = (vector(1.0, 2.0, 3.0), vector(4.0, -3.0, 8.0), 0.6, 1.5, 1.3);
    // v' = g - c v with c = k/m: v = u + (v0 - u) e^(-c t), x = x0 + u t + (v0 - u)(1 - e^(-c t))/c, u = g/c.
    let c: f64 = k / m;
    let u = vector(0.0, 0.0, -9.8) * (1.0 / c);
    let decay = (-c * time).exp();
    let (x, v) = (x0 + u * time + (v0 - u) * ((1.0 - decay) / c), u + (v0 - u) * decay);
    let force = format!("[[force]]\nkind = \"drag\"\ncoefficient = {k}");
    let errors: Vec<f64> = [4, 8, 16, 32]
        .map(|n| {
            let found = flight("rk4", n, time, (x0, v0), "mass = [1.5]", &force);
            (found.0 - x).norm() + (found.1 - v).norm()
        })
        .into();
    println!("linear drag: errors {}, orders {:.3?}", show(&errors), orders(&errors));
    assert!(errors[3] < 1e-6 && errors[3] > 1e-11);
    assert!(orders(&errors).iter().all(|p| (p - 4.0).abs() < 0.2));
}

#[test]
fn quadratic_drag_ends_at_the_terminal_velocity() {
    // v = -v_t tanh(g t/v_t), z = -v_t²/g ln cosh(g t/v_t), v_t = sqrt(m g/k).
    let (m, k, g, time) = (0.2, 0.05, 9.8_f64, 0.9);
    let vt = (m * g / k).sqrt();
    let (z, v) = (-vt * vt / g * (g * time / vt).cosh().ln(), -vt * (g * time / vt).tanh());
    let force = format!("[[force]]\nkind = \"drag\"\nquadratic = {k}");
    let still = (vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0));
    for (scheme, order) in [("rk4", 4.0), ("midpoint", 2.0), ("implicit_midpoint", 2.0)] {
        let errors: Vec<f64> = [8, 16, 32, 64]
            .map(|n| {
                let found = flight(scheme, n, time, still, "mass = [0.2]", &force);
                assert_eq!((found.0.x, found.0.y), (0.0, 0.0));
                (found.0.z - z).abs() + (found.1.z - v).abs()
            })
            .into();
        println!("quadratic drag, {scheme}: errors {}, orders {:.3?}", show(&errors), orders(&errors));
        assert!(orders(&errors).iter().all(|p| (p - order).abs() < 0.25), "{scheme}");
        assert!(errors[3] > 1e-12 && errors[3] < 1e-2);
    }
    let (_, end) = flight("rk4", 400, 10.0, still, "mass = [0.2]", &force);
    // tanh(15.65) = 1 - 5e-14.
    assert!((end.z + vt).abs() < 1e-10, "terminal velocity {} of {vt}", end.z);
    // Sideways, alone: 1/v grows by k t/m.
    let text = format!("world.gravity = [0, 0, 0]\n{force}");
    let sideways = flight("rk4", 100, 2.0, (vector(0.0, 0.0, 0.0), vector(3.0, 4.0, 0.0)), "mass = [0.2]", "");
    assert!((sideways.1.x - 3.0).abs() < 1e-12, "no drag without a force");
    let mut sim = simulation(&format!(
        "{text}\n[[system]]\nintegrator = \"rk4\"\nsubsteps = 20\n[[particles]]\nname = \"p\"\nmass = [0.2]\nposition = [[0, 0, 0]]\nvelocity = [[3, 4, 0]]\n[time]\nfps = 10"
    ));
    run(&mut sim, 20);
    let speed = velocities(&sim, "p")[0].norm();
    assert!((speed - 1.0 / (0.2 + 0.05 * 2.0 / 0.2)).abs() < 1e-9, "{speed}");
}

/// m = 2 kg, q = -0.8 C, B = 1.5 T along a tilted axis: w = |q| B/m = 0.6 rad/s.
const TURN: f64 = 0.6;

fn turning(forces: &str, integrator: &str, substeps: u32, time: f64, v: Vector) -> (Vector, Vector) {
    let particle = "mass = [2]\ncharge = [-0.8]";
    flight(integrator, substeps, time, (vector(0.3, 0.1, -0.2), v), particle, &format!("{forces}\n[world]\ngravity = [0, 0, 0]"))
}

#[test]
fn charges_turn_with_the_gyro_frequency_on_the_gyro_radius() {
    let axis = vector(0.6, 0.0, 0.8);
    let b = axis * 1.5;
    let force = format!("[[force]]\nkind = \"magnetic\"\nfield = [{}, {}, {}]", b.x, b.y, b.z);
    // A negative charge turns about B by the right hand, a positive one against it: v' = (q/m) v x B = -(q B/m) b x v.
    let (along, across) = (axis * 0.7, vector(0.0, 1.2, 0.0));
    let start = along + across;
    let exact = |t: f64| {
        let (sin, cos) = (TURN * t).sin_cos();
        let side = axis.cross(across);
        (vector(0.3, 0.1, -0.2) + along * t + (across * sin + side * (1.0 - cos)) * (1.0 / TURN), along + across * cos + side * sin)
    };
    let time = 2.0 * std::f64::consts::PI / TURN * 1.25;
    let (x, v) = exact(time);
    // The radius m v/(|q| B) = 2 m: the path's farthest distance from its start, across, is twice that.
    let half = turning(&force, "rk4", 2000, std::f64::consts::PI / TURN, start);
    let moved = half.0 - vector(0.3, 0.1, -0.2);
    let radius = 0.5 * (moved - axis * axis.dot(moved)).norm();
    println!("gyro-radius {radius:.12} m, exact {}", 2.0 * 1.2 / (0.8 * 1.5));
    assert!((radius - 2.0 * 1.2 / (0.8 * 1.5)).abs() < 1e-9);
    for scheme in fixed() {
        let coarse = match scheme.order() {
            1 => 1600,
            2 => 100,
            _ => 25,
        };
        let errors: Vec<f64> = (0..4)
            .map(|k| {
                let found = turning(&force, scheme.name(), coarse << k, time, start);
                (found.0 - x).norm() + (found.1 - v).norm()
            })
            .collect();
        println!("magnetic, {:18} errors {}, orders {:.3?}", scheme.name(), show(&errors), orders(&errors));
        let order = f64::from(scheme.order());
        assert!((orders(&errors)[2] - order).abs() < 0.2, "{}", scheme.name());
        assert!(errors[3] > 1e-12 && errors[3] < 0.2, "{}", scheme.name());
    }
}

/// A field that grows as 1 + t/2, read from formulas of the time, and of the place, too.
#[test]
fn charges_turn_in_fields_that_are_formulas() {
    let (along, across) = (vector(0.0, 0.0, 0.7), vector(0.0, 1.2, 0.0));
    let force = |field: &str| format!("[[force]]\nkind = \"magnetic\"\nfield = {field}");
    let time = 3.0;
    // v turns by the integral of -q B/m = 0.6 (1 + t/2) about z, by the right hand.
    let (sin, cos) = (TURN * (time + 0.25 * time * time)).sin_cos();
    let exact = along + across * cos + vector(-1.2, 0.0, 0.0) * sin;
    for field in ["[\"0\", \"0\", \"1.5*(1 + t/2)\"]", "[\"0\", \"0\", \"1.5*(1 + t/2) + 0*x\"]"] {
        let (_, v) = turning(&force(field), "rk4", 600, time, along + across);
        println!("{field}: off by {:.1e}", (v - exact).norm());
        // Order 4 with 600 steps of 0.005 s: h^4 w^5 t/120 = 1e-10 (w up to 1.5/s). Measured 4e-11.
        assert!((v - exact).norm() < 3e-10);
    }
}

#[test]
fn what_schemes_do_to_the_energy_in_a_magnetic_field() {
    // Five turns with 60 steps each: the speed at the end over that at the start.
    let force = "[[force]]\nkind = \"magnetic\"\nfield = [0, 0, 1.5]";
    let time = 2.0 * std::f64::consts::PI / TURN;
    for scheme in Integrator::ALL.into_iter().filter(|i| !i.is_adaptive()) {
        let text = format!(
            "time.fps = {:e}\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"{}\"\nsubsteps = 60\nsolver.newton_tolerance = 1e-12\n\
             [[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\nvelocity = [[0, 1, 0]]\nmass = [2]\ncharge = [-0.8]\n{force}",
            1.0 / time,
            scheme.name()
        );
        let mut sim = simulation(&text);
        let end = (0..5).try_for_each(|_| tumble_interface::Engine::step(&mut sim, &|| true).map(drop));
        let speed = velocities(&sim, "p")[0].norm();
        println!("magnetic, {:18} speed after five turns x {speed:.9} {}", scheme.name(), if end.is_err() { "(exploded)" } else { "" });
        let (low, high) = match scheme {
            // (1 + w²h²)^(1/2) a step, w h = 2 pi/60: 5.1345 after 300. All three take the old velocity.
            Integrator::ForwardEuler | Integrator::SymplecticEuler | Integrator::ModifiedEuler => (5.134, 5.135),
            // 1 + (w h)^4/8 a step: 1.00452.
            Integrator::Midpoint | Integrator::Heun => (1.0044, 1.0046),
            // Measured: 1.00926 and 0.98330.
            Integrator::Verlet | Integrator::VelocityVerlet => (1.009, 1.0095),
            Integrator::Bdf2 => (0.983, 0.984),
            Integrator::ImplicitEuler => (0.194, 0.195),
            Integrator::ImplicitMidpoint => (1.0 - 1e-9, 1.0 + 1e-9),
            // 1 - (w h)^6/144 a step: 2.7e-6.
            Integrator::Rk4 => (1.0 - 3.0e-6, 1.0 - 2.4e-6),
            _ => (0.1, 3.0),
        };
        assert!(speed > low && speed < high, "{}: {speed}", scheme.name());
    }
}

#[test]
fn crossed_fields_make_charges_drift() {
    // E x B/B² = (0, 3, 0) x (0, 0, 1.5)/2.25 = (2, 0, 0) m/s, whatever the charge; here the mean over ten turns.
    let forces = "[[force]]\nkind = \"magnetic\"\nfield = [0, 0, 1.5]\n[[force]]\nkind = \"electric\"\nfield = [0, 3, 0]";
    let time = 2.0 * std::f64::consts::PI / TURN * 10.0;
    let (x, v) = turning(forces, "rk4", 2000, time, vector(0.5, 0.0, 0.0));
    let drift = (x - vector(0.3, 0.1, -0.2)) * (1.0 / time);
    println!("drift {:.9} {:.9} m/s, velocity after ten turns {:.9} {:.9}", drift.x, drift.y, v.x, v.y);
    // RK4 at w h = 0.0314: a phase error of (w h)^5/120 a step, 5e-7 in all, of a circle of 2.5 m.
    assert!((drift.x - 2.0).abs() < 1e-6 && drift.y.abs() < 1e-6);
    assert!((v.x - 0.5).abs() < 1e-5);
    // Without the electric field it goes in circles.
    let (x, _) = turning("[[force]]\nkind = \"magnetic\"\nfield = \"[0, 0, 1.5]\"", "rk4", 2000, time, vector(0.5, 0.0, 0.0));
    assert!((x - vector(0.3, 0.1, -0.2)).norm() < 1e-5);
}

fn one(numbers: &mut Numbers) -> One {
    let mut next = || vector(numbers.next(), numbers.next(), numbers.next());
    One { mass: 1.7, charge: -0.6, x: next(), v: next() * 2.0 }
}

fn force(law: &dyn Force, t: f64, one: &One) -> Vector {
    let row = |v: Vector| -> [Row; 1] { [[v.x, v.y, v.z, 0.0]] };
    let mut f = [[0.0; 4]];
    law.add(t, Group { mass: &[one.mass], charge: &[one.charge], x: &row(one.x), v: &row(one.v) }, &mut f);
    vector(f[0][0], f[0][1], f[0][2])
}

fn formula(text: &str) -> VectorSignal {
    VectorSignal::new(&AnimatedVector::Formula(text.into()), Of::Motion).unwrap()
}

fn noise(rate: f64) -> Turbulence {
    Turbulence { strength: 2.0.into(), scale: 0.8, octaves: 3, roughness: 0.6, rate, seed: 5, flat: None }
}

fn whirl() -> Vortex {
    let axis = vector(0.6, 0.0, 0.8);
    Vortex { center: [0.1, 0.2, 0.3].into(), axis, core: 0.5, swirl: 3.0.into(), inward: 1.0.into(), lift: 2.0.into() }
}

#[test]
fn matrices_are_the_symmetric_derivatives_and_forces_those_of_the_energy() {
    let attraction =
        |power: f64, softening: f64, radius: f64| Attraction { center: [0.1, -0.2, 0.3].into(), gm: 1.3.into(), power, softening, radius };
    let drag = || Medium::from(Drag { coefficient: 0.3, rate: 0.2, quadratic: 0.7 });
    let laws: Vec<(&str, Box<dyn Force>)> = vec![
        ("drag", Box::new(drag())),
        ("wind", Box::new(Wind { drag: drag(), air: Flow { fields: vec![Current::Uniform([1.0, 2.0, 3.0].into())], flat: None } })),
        ("attraction", Box::new(attraction(2.0, 0.0, f64::INFINITY))),
        ("softened", Box::new(attraction(2.0, 0.2, f64::INFINITY))),
        ("within", Box::new(attraction(2.0, 0.2, 5.0))),
        ("line", Box::new(attraction(1.0, 0.1, f64::INFINITY))),
        ("spring", Box::new(attraction(-1.0, 0.0, f64::INFINITY))),
        ("cubic", Box::new(attraction(3.5, 0.1, f64::INFINITY))),
        ("acceleration", Box::new(Acceleration(formula("[sin(x*y) + vx^2, exp(z)*vy, x*z - t]")))),
        ("electric", Box::new(Electric(formula("[x^2, y*z, sin(z)]")))),
        ("uniform", Box::new(Electric([1.0, 2.0, 3.0].into()))),
        ("vortex", Box::new(whirl())),
        ("propulsion", Box::new(Propulsion { thrust: 0.4.into(), speed: Some(2.0.into()), time: 0.5 })),
        ("turbulence", Box::new(noise(0.7))),
        ("magnetic", Box::new(Magnetic([0.0, 0.0, 1.5].into()))),
    ];
    let mut numbers = Numbers(11);
    let units = [vector(1.0, 0.0, 0.0), vector(0.0, 1.0, 0.0), vector(0.0, 0.0, 1.0)];
    let h = 1e-5;
    for (name, law) in &laws {
        let (mut worst, mut size, mut with_energy) = (0.0_f64, 0.0_f64, 0.0_f64);
        for _ in 0..20 {
            let one = one(&mut numbers);
            let columns = |by: &dyn Fn(Vector) -> One| {
                units.map(|e| (force(law.as_ref(), 0.3, &by(e * h)) - force(law.as_ref(), 0.3, &by(-e * h))) * (-0.5 / h))
            };
            let (k, d) = law.matrix(0.3, &one);
            let moved = columns(&|e| One { x: one.x + e, ..one });
            let faster = columns(&|e| One { v: one.v + e, ..one });
            for (block, by) in [(k, moved), (d, faster)] {
                let [a, b, c] = by;
                let expected = [a.x, b.y, c.z, 0.5 * (a.y + b.x), 0.5 * (b.z + c.y), 0.5 * (a.z + c.x)];
                let scale = 1.0 + by.iter().map(|c| c.norm()).fold(0.0, f64::max);
                for i in 0..6 {
                    worst = worst.max((block[i] - expected[i]).abs() / scale);
                    size = size.max(expected[i].abs());
                }
            }
            let f = force(law.as_ref(), 0.3, &one);
            let energy = |e: Vector| law.energy(0.3, &One { x: one.x + e, ..one });
            if energy(units[0]).is_some() {
                for e in units {
                    let slope = (energy(e * h).unwrap() - energy(-e * h).unwrap()) * (0.5 / h);
                    with_energy = with_energy.max((slope + f.dot(e)).abs() / (1.0 + f.norm()));
                }
            }
        }
        println!("{name:14} matrix {worst:.1e} of {size:.2}, energy {with_energy:.1e}");
        // Central differences with h = 1e-5: (h f''')/6 and round-off of 1e-11/h relative to forces of 1 to 1e3.
        assert!(worst < 2e-5 && with_energy < 1e-5, "{name}");
        assert!(size > 0.1 || ["uniform", "magnetic"].contains(name), "{name} has derivatives");
    }
}

#[test]
fn there_is_no_force_without_a_direction() {
    let here = One { mass: 1.0, charge: 1.0, x: vector(0.1, -0.2, 0.3), v: vector(0.0, 0.0, 0.0) };
    for (power, softening) in [(2.0, 0.0), (2.0, 0.1), (1.0, 0.0), (3.0, 0.0), (0.0, 0.0), (-1.0, 0.0)] {
        let law = Attraction { center: [0.1, -0.2, 0.3].into(), gm: 2.0.into(), power, softening, radius: f64::INFINITY };
        assert_eq!(force(&law, 0.0, &here).norm(), 0.0, "power {power}");
        let (k, _) = law.matrix(0.0, &here);
        assert!(k.iter().all(|k| k.is_finite()), "power {power}");
        assert!(law.energy(0.0, &here).unwrap().is_finite(), "power {power}, softening {softening}");
    }
    let engine = Propulsion { thrust: 1.0.into(), speed: Some(1.0.into()), time: 1.0 };
    assert_eq!(force(&engine, 0.0, &here).norm(), 0.0);
    // Beyond its radius an attraction is nothing, and it fades towards it.
    let law = Attraction { center: [0.0; 3].into(), gm: 1.0.into(), power: 2.0, softening: 0.0, radius: 2.0 };
    let at = |r: f64| force(&law, 0.0, &One { x: vector(r, 0.0, 0.0), ..here }).x;
    assert_eq!((at(2.0), at(3.0)), (0.0, 0.0));
    assert!((at(1.0) + 0.75 * 0.75).abs() < 1e-15);
}

#[test]
fn a_vortex_has_its_largest_swirl_at_its_core() {
    let flow = Flow { fields: vec![Current::Vortex(whirl())], flat: None };
    let axis = vector(0.6, 0.0, 0.8);
    let (side, up) = (vector(0.8, 0.0, -0.6), vector(0.0, 1.0, 0.0)); // side x ... axis x side = (0, 1, 0)
    assert!((axis.cross(side) - up).norm() < 1e-15);
    for (r, s, g) in [(0.5, 1.0, 0.5), (1.0, 0.8, 0.2), (0.25, 0.8, 0.8)] {
        let u = flow.at(0.0, vector(0.1, 0.2, 0.3) + side * r + axis * 1.7);
        // s = 2 c r/(r² + c²), g = c²/(r² + c²)
        assert!((u - (up * (3.0 * s) - side * (1.0 * s) + axis * (2.0 * g))).norm() < 1e-14, "r = {r}");
    }
}

#[test]
fn turbulence_has_no_sources_and_the_strength_that_is_asked_for() {
    let mut numbers = Numbers(3);
    for (flat, rate) in [(None, 0.0), (None, 0.7), (Some(1), 0.7)] {
        let field = Turbulence { flat, ..noise(rate) };
        let units = [vector(1.0, 0.0, 0.0), vector(0.0, 1.0, 0.0), vector(0.0, 0.0, 1.0)];
        let h = 1e-4;
        let (mut divergence, mut slope, mut square) = (0.0_f64, 0.0, 0.0);
        let n = 20_000;
        for i in 0..n {
            let mut x = vector(numbers.next(), numbers.next(), numbers.next()) * 40.0;
            if flat.is_some() {
                x.y = 0.0;
            }
            let t = 3.0 * numbers.next();
            let u = field.value(t, x);
            square += u.norm_sq() / f64::from(n);
            if flat.is_some() {
                assert_eq!(u.y, 0.0);
            }
            if i < 500 {
                let columns = units.map(|e| (field.value(t, x + e * h) - field.value(t, x - e * h)) * (0.5 / h));
                divergence = divergence.max((columns[0].x + columns[1].y + columns[2].z).abs());
                slope += (columns[0].norm_sq() + columns[2].norm_sq()) / 500.0;
            }
        }
        println!(
            "turbulence {flat:?}, rate {rate}: root mean square {:.4}, divergence {divergence:.1e} of slopes {:.2}",
            square.sqrt(),
            slope.sqrt()
        );
        // h² u'''/6: with a smallest swirl of 0.2 m and slopes near 20/s about 1e-5.
        assert!(divergence < 1e-3 && slope.sqrt() > 5.0);
        // 20 000 places in some 1e6 cells of the smallest swirls: 1 % at most.
        assert!((square.sqrt() - 2.0).abs() < 0.06);
    }
    let (a, b) = (noise(0.7), Turbulence { seed: 6, ..noise(0.7) });
    let x = vector(0.3, 0.4, 0.5);
    assert!((a.value(0.0, x) - b.value(0.0, x)).norm() > 0.1 && (a.value(0.0, x) - a.value(1.0, x)).norm() > 0.1);
    assert!((a.value(1.0, x) - a.value(1.0 + 1e-9, x)).norm() < 1e-7, "continuous where the time slices meet");
    assert!(a.value(0.0, vector(1e30, -1e30, 0.0)).norm().is_finite());
}

#[test]
fn propulsion_reaches_its_speed() {
    let force = "[[force]]\nkind = \"propulsion\"\nspeed = 3\ntime = 0.5\n[world]\ngravity = [0, 0, 0]";
    let (_, v) = flight("rk4", 100, 1.0, (vector(0.0, 0.0, 0.0), vector(0.6, 0.8, 0.0)), "", force);
    // 3 - 2 e^(-2), along (0.6, 0.8).
    let speed = 3.0 - 2.0 * (-2.0_f64).exp();
    assert!((v - vector(0.6, 0.8, 0.0) * speed).norm() < 1e-8, "{}", v.norm());
    let force = "[[force]]\nkind = \"propulsion\"\nthrust = \"2*t\"\n[world]\ngravity = [0, 0, 0]";
    let (_, v) = flight("rk4", 100, 1.0, (vector(0.0, 0.0, 0.0), vector(0.6, 0.8, 0.0)), "mass = [0.5]", force);
    assert!((v.norm() - 3.0).abs() < 1e-12, "1 m/s and the integral of 2 t/0.5 kg: {}", v.norm());
}

#[test]
fn animated_words_act_at_their_time() {
    let weightless = "[world]\ngravity = [0, 0, 0]\n";
    let rest = (vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0));
    // a = cos 2t e_x: v = sin(2t)/2.
    let (x, v) = flight("rk4", 50, 1.0, rest, "", &format!("{weightless}[[force]]\nkind = \"acceleration\"\nvalue = \"[cos(2*t), 0, 0]\""));
    assert!((v.x - 2.0_f64.sin() / 2.0).abs() < 1e-8 && (x.x - (1.0 - 2.0_f64.cos()) / 4.0).abs() < 1e-8);
    // a = -4 x: cos 2t, by a formula of place.
    let start = (vector(1.0, 0.0, 0.5), vector(0.0, 0.0, 0.0));
    for scheme in ["rk4", "implicit_midpoint"] {
        let text = format!("{weightless}[[force]]\nkind = \"acceleration\"\nvalue = [\"-4*x\", 0, \"-4*z\"]");
        let (x, _) = flight(scheme, 400, 1.0, start, "", &text);
        assert!((x - start.0 * 2.0_f64.cos()).norm() < 1e-5, "{scheme}: {}", (x - start.0 * 2.0_f64.cos()).norm());
    }
    // Wind that rises with keyframes: u = 2 t, v' = 3 (u - v): v = 2 t - 2/3 (1 - e^(-3 t)).
    let text = format!(
        "{weightless}[[force]]\nkind = \"wind\"\nrate = 3\nair = [{{ kind = \"uniform\", velocity = {{ keys = [[0, 0, 0, 0], [2, 4, 0, 0]] }} }}]"
    );
    let (_, v) = flight("rk4", 100, 1.0, rest, "", &text);
    assert!((v.x - (2.0 - 2.0 / 3.0 * (1.0 - (-3.0_f64).exp()))).abs() < 1e-8, "{}", v.x);
}

#[test]
fn tracers_follow_formulas_with_every_scheme() {
    // u = (-y, x, cos t): circles, and z = sin t.
    let exact = vector(1.0_f64.cos(), 1.0_f64.sin(), 1.0_f64.sin());
    for scheme in fixed().into_iter().filter(|i| !i.needs_velocities()) {
        let errors: Vec<f64> = [40, 80, 160]
            .map(|n| {
                let mut sim = simulation(&format!(
                    "time.fps = 1\n[[system]]\nmethod = \"tracers\"\nintegrator = \"{}\"\nsubsteps = {n}\n\
                     [[particles]]\nname = \"p\"\nposition = [[1, 0, 0]]\n[[field]]\nkind = \"formula\"\nvelocity = \"[-y, x, cos(t)]\"",
                    scheme.name()
                ));
                run(&mut sim, 1);
                (positions(&sim, "p")[0] - exact).norm()
            })
            .into();
        println!("tracers, {:18} errors {}, orders {:.3?}", scheme.name(), show(&errors), orders(&errors));
        assert!((orders(&errors)[1] - f64::from(scheme.order())).abs() < 0.2, "{}", scheme.name());
    }
}

#[test]
fn faults_of_formulas_have_a_place() {
    let faults = |text: &str| {
        let scene = Scene::from_toml(&format!("version = 1\n[[particles]]\nname = \"p\"\nposition = [[1, 0, 0]]\n{text}")).unwrap();
        tumble_f64::scene::Simulation::new(scene, Default::default()).err().map(|e| e.to_string()).unwrap_or_default()
    };
    let found = faults(
        "[[force]]\nkind = \"acceleration\"\nvalue = \"[-y, foo, 0]\"\n[[force]]\nkind = \"vortex\"\nswirl = \"1/t\"\n[[force]]\nkind = \"wind\"\nrate = 1\n\
         air = [{ kind = \"formula\", velocity = \"[x, y]\" }]\n[[force]]\nkind = \"attraction\"\ngm = \"1/0\"\n[[field]]\nkind = \"uniform\"\nvelocity = [\"x\", 0, 0]",
    );
    println!("{found}");
    for expected in [
        "force[0].value: \"[-y, foo, 0]\": unknown name \"foo\"; did you mean \"floor\"? (known: t, x, y, z, vx, vy, vz, pi, e, sin,",
        "force[1].swirl: inf at t = 0 s, expected a finite number",
        "force[2].air[0].velocity: \"[x, y]\": 2 components, expected 3",
        "force[3].gm: \"1/0\": a division gives inf, expected a finite number",
        "field[0].velocity: \"x\": unknown name \"x\"",
    ] {
        assert!(found.contains(expected), "{expected}\nnot in\n{found}");
    }
    // A value that is not finite for a single mass ends the run with a clear error.
    let mut sim = simulation(
        "[[particles]]\nname = \"p\"\nposition = [[1, 0, 0], [0, 0, 0]]\n[[force]]\nkind = \"acceleration\"\nvalue = \"[1/x, 0, 0]\"\n[[system]]\nintegrator = \"rk4\"\nsubsteps = 4",
    );
    let error = tumble_interface::Engine::step(&mut sim, &|| true).unwrap_err().to_string();
    assert!(error.contains("not a finite number") && error.contains("\"p\", particle 1"), "{error}");
}
