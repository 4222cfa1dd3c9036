//! Pressure in liquids of particles, and their forces on solids. docs/theory/liquids.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, column, grid, positions, run, simulation, step, vector};
use std::f64::consts::PI;
use tumble_interface::Engine;

/// Water of this spacing and size [m] between five planes with friction, with more tables.
fn water(spacing: f64, friction: f64, [a, b, c]: [f64; 3], more: &str) -> String {
    let planes = [
        ("floor", [0.0, 0.0, 1.0], 0.0),
        ("west", [1.0, 0.0, 0.0], 0.5 * a),
        ("east", [-1.0, 0.0, 0.0], 0.5 * a),
        ("south", [0.0, 1.0, 0.0], 0.5 * b),
        ("north", [0.0, -1.0, 0.0], 0.5 * b),
    ];
    let plane = |(name, normal, away): (&str, [f64; 3], f64)| {
        let point = normal.map(|n| -n * away);
        format!(
            "[[collider]]\nname = \"{name}\"\nfriction = {friction}\nthickness = {}\nshape.plane = {{ normal = {normal:?}, point = {point:?} }}\n",
            0.5 * spacing
        )
    };
    format!(
        "precision = \"double\"\ntime.fps = 50\noutput.columns = [\"position\", \"pressure\", \"force\"]\n\
         [[system]]\nmethod = \"position_based\"\nsubsteps = 20\n\
         [[particles]]\nname = \"water\"\nfluid = {{ spacing = {spacing}, viscosity = 0.5, fill = [{{ center = [0, 0, {}], size = [{a}, {b}, {c}] }}] }}\n\
         {}{more}",
        0.5 * c,
        planes.map(plane).concat()
    )
}

fn force(sim: &tumble_f64::scene::Simulation, solid: &str) -> Vector {
    column(sim, solid, "force")[0]
}

#[test]
fn what_solids_feel_is_what_the_liquid_loses() {
    // Half of the tank, so that it sloshes, onto a ball that moves.
    let more = "[[collider]]\nname = \"ball\"\nrestitution = 0.4\nfriction = 0.5\nshape.sphere = { center = [0.3, 0, 0.2], radius = 0.1 }\n\
                motion.velocity = [-0.2, 0, 0.05]\n";
    let mut sim = simulation(
        &water(0.05, 0.3, [1.2, 0.4, 0.4], more).replace("center = [0, 0, 0.2], size = [1.2", "center = [-0.3, 0, 0.2], size = [0.6"),
    );
    let solids = ["floor", "west", "east", "south", "north", "ball"];
    let weight = sim.ledger().mass * 9.8;
    let (mut worst, mut most) = (0.0_f64, [0.0_f64; 6]);
    for _ in 0..60 {
        let before = Vector::from(sim.ledger().momentum);
        step(&mut sim);
        let gained = (Vector::from(sim.ledger().momentum) - before) * 50.0;
        let forces = solids.map(|solid| force(&sim, solid));
        let felt = forces.iter().fold(Vector::default(), |sum, f| sum + *f);
        worst = worst.max((gained + felt - vector(0.0, 0.0, -weight)).norm() / weight);
        most.iter_mut().zip(forces).for_each(|(most, f)| *most = most.max(f.norm() / weight));
    }
    println!("balance within {worst:.1e} of the weight; forces up to {most:.2?} of it");
    assert!(worst < 1e-11);
    assert!(most.iter().all(|most| *most > 0.02), "{most:?}");
}

/// Filled to its walls, water stays where it is: its surface sinks by less than a tenth of a spacing, and by a fifth of what it does without the
/// thickness.
#[test]
fn water_filled_to_the_brim_stays() {
    let spacing = 0.05;
    let sinks = |text: &str| {
        let mut sim = simulation(text);
        let mean = |sim: &tumble_f64::scene::Simulation| positions(sim, "water").iter().map(|x| x.z).sum::<f64>() / 1000.0;
        let start = mean(&sim);
        run(&mut sim, 50);
        let (kinetic, mass) = (sim.ledger().kinetic, sim.ledger().mass);
        (2.0 * (start - mean(&sim)) / spacing, (2.0 * kinetic / mass).sqrt())
    };
    let thick = water(spacing, 0.0, [0.5, 0.5, 0.5], "");
    let (with, speed) = sinks(&thick);
    let (without, _) = sinks(&thick.replace("thickness = 0.025\n", ""));
    println!("sinks by {with:.4} spacings, {speed:.3} m/s; {without:.4} without thickness");
    assert!(with < 0.1 && speed < 0.1 && without > 5.0 * with, "{with} {speed} {without}");
}

#[test]
#[ignore = "long: make validate"]
fn the_pressure_of_water_at_rest_is_that_of_its_depth() {
    let (spacing, size) = (0.05, [0.5, 0.5, 0.5]);
    let mut sim = simulation(&water(spacing, 0.0, size, "[[force]]\nkind = \"drag\"\nrate = 3\n"));
    run(&mut sim, if common::whole() { 200 } else { 150 });
    let weight = sim.ledger().mass * 9.8;
    let (mut pressures, mut sides, mut floor, mut total) = (vec![0.0; 1000], [0.0; 4], Vector::default(), 0.0);
    for _ in 0..20 {
        step(&mut sim);
        let p = grid(&sim, "water", "pressure").0;
        pressures.iter_mut().zip(p).for_each(|(sum, p)| *sum += p / 20.0);
        floor = floor + force(&sim, "floor") * 0.05;
        let names = ["west", "east", "south", "north"];
        total += ["floor", "west", "east", "south", "north"].map(|name| force(&sim, name).z).iter().sum::<f64>() / 20.0;
        sides.iter_mut().zip(names).for_each(|(sum, name)| *sum += force(&sim, name).norm() / 20.0);
    }
    let x = positions(&sim, "water");
    // The surface, from where the liquid is.
    let height = 2.0 * x.iter().map(|x| x.z).sum::<f64>() / x.len() as f64;
    let rho_g = 1000.0 * 9.8;
    let layers: Vec<[f64; 3]> = (0..10)
        .map(|k| {
            let inside = |x: &Vector| (x.z / spacing) as usize == k && x.x.abs() < 0.2 && x.y.abs() < 0.2;
            let layer: Vec<(f64, f64)> = x.iter().zip(&pressures).filter(|(x, _)| inside(x)).map(|(x, p)| (x.z, *p)).collect();
            let n = layer.len().max(1) as f64;
            let [z, p] = [layer.iter().map(|l| l.0).sum::<f64>() / n, layer.iter().map(|l| l.1).sum::<f64>() / n];
            [z, p, rho_g * (height - z)]
        })
        .collect();
    let side = 0.5 * rho_g * height * height * size[0];
    println!(
        "height {height:.4}; layers {layers:.3?}\nfloor {:?} of the weight; sides {:.4?} of {side:.2}",
        floor * (1.0 / weight),
        sides.map(|s| s / side)
    );
    // All together bear the weight; in edges, where a particle touches two solids in one sub-step, the share of each is known less well.
    assert!((total + weight).abs() < 5e-3 * weight, "{total} {weight}");
    assert!((floor - vector(0.0, 0.0, -weight)).norm() < 0.02 * weight, "{floor:?} {weight}");
    assert!(sides.iter().all(|s| (s / side - 1.0).abs() < 0.05), "{sides:?} {side}");
    for [_, p, exact] in &layers[1..8] {
        assert!((p - exact).abs() < 0.03 * rho_g * height, "{layers:?}");
    }
}

#[test]
fn a_ball_that_is_held_under_water_feels_its_buoyancy() {
    let radius = 0.2;
    let more = format!(
        "[[force]]\nkind = \"drag\"\nrate = 3\n[[collider]]\nname = \"ball\"\nshape.sphere = {{ center = [0, 0, 0.35], radius = {radius} }}\n"
    );
    let mut sim = simulation(&water(0.05, 0.0, [0.7, 0.7, 0.7], &more));
    run(&mut sim, if common::whole() { 150 } else { 75 });
    let mut lift = Vector::default();
    for _ in 0..20 {
        step(&mut sim);
        lift = lift + force(&sim, "ball") * 0.05;
    }
    let buoyancy = 1000.0 * 9.8 * 4.0 / 3.0 * PI * radius * radius * radius;
    println!("lift {lift:?}, buoyancy {buoyancy:.2}");
    assert!((lift - vector(0.0, 0.0, buoyancy)).norm() < 0.05 * buoyancy, "{lift:?} {buoyancy}");
}

#[test]
fn loads_are_the_same_bits_after_a_restore() {
    let text = water(0.1, 0.3, [0.6, 0.4, 0.4], "").replace("size = [0.6", "size = [0.4");
    let (mut sim, mut other) = (simulation(&text), simulation(&text));
    let bytes = sim.save(&[]);
    run(&mut other, 3);
    other.restore(&bytes).unwrap();
    assert_eq!(force(&other, "floor"), Vector::default());
    run(&mut sim, 7);
    other.restore(&sim.save(&[])).unwrap();
    let loads = |sim: &tumble_f64::scene::Simulation| (grid(sim, "water", "pressure").0, grid(sim, "floor", "force").0);
    assert_eq!(loads(&sim), loads(&other));
    assert!(loads(&sim).0.iter().any(|p| *p > 100.0) && loads(&sim).1[2] < -10.0);
    run(&mut sim, 2);
    run(&mut other, 2);
    assert_eq!(loads(&sim), loads(&other));
}

#[test]
fn forces_of_a_gas_and_a_liquid_on_a_solid_add_up() {
    let ball = "[[collider]]\nname = \"ball\"\nshape.sphere = { center = [0, 0, 0.4], radius = 0.2 }\n";
    let gas = "[[system]]\nname = \"wind\"\nmethod = \"gas\"\nsubsteps = 1\n[[gas]]\nname = \"air\"\n\
               box = { center = [0, 0, 0.6], size = [0.8, 0.8, 0.8], resolution = 8 }\nfluid_density = 200\nacceleration = [3, 0, 0]\n";
    let liquid = water(0.1, 0.3, [0.8, 0.8, 0.4], ball);
    // Every solid stands in both.
    let alone = liquid.split("[[system]]").next().unwrap().to_owned() + &liquid[liquid.find("[[collider]]").unwrap()..];
    let [both, wet, dry] = [format!("{liquid}{gas}"), liquid, format!("{alone}{gas}")].map(|text| {
        let mut sim = simulation(&text);
        run(&mut sim, 3);
        assert_eq!(sim.frame(&["force"]).columns.iter().filter(|c| (&c.object[..], &c.name[..]) == ("ball", "force")).count(), 1);
        force(&sim, "ball")
    });
    assert!((wet + dry - both).norm() < 1e-9 * both.norm(), "{wet:?} {dry:?} {both:?}");
    assert!(wet.norm() > 10.0 && dry.norm() > 10.0, "{wet:?} {dry:?}");
}
