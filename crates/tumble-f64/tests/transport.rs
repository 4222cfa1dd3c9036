//! Transport in flux form, in double precision: docs/theory/grids.md, (grids.21) and (grids.22), and in a gas (gas.22).

extern crate tumble_f64 as tumble;

use crate::common;
use crate::densities::wave;

use common::{grid, noisy, orders, run, show, simulation, step};
use std::f64::consts::PI;
use tumble_f64::math::Spare;
use tumble_f64::operators::{Advection, Interpolation, advect, curl, transport};
use tumble_f64::scene::Simulation;
use tumble_f64::state::{Field, Grid, Place, Side, Vectors};
use tumble_interface::{Engine, Scene};

/// Flows without divergence in closed and periodic boxes: the curls of random numbers on edges that are zero on walls.
fn eddies() -> Vec<Vectors> {
    let plane = |axis: usize, n: [usize; 3]| Grid::new(n, 0.1, [0.0; 3]).unwrap().flat(axis).unwrap();
    [
        plane(0, [1, 12, 17]),
        plane(1, [19, 1, 9]).periodic([true, false, false]),
        plane(2, [14, 11, 1]),
        Grid::new([18, 7, 9], 0.1, [0.0; 3]).unwrap(),
        Grid::new([9, 8, 7], 0.1, [0.0; 3]).unwrap().periodic([true; 3]),
    ]
    .into_iter()
    .map(|g| {
        let mut edges = Vectors::edges(g, "m²/s").unwrap();
        for (seed, part) in edges.parts.iter_mut().enumerate() {
            let values = noisy(g, part.place, seed as u64 + 3);
            let n = part.points();
            for at in part.each().collect::<Vec<_>>() {
                let on_wall =
                    |a: usize| g.flat != Some(a) && !g.periodic[a] && g.on_walls(part.place, a) && (at[a] == 0 || at[a] + 1 == n[a]);
                let i = part.index(at);
                part.data[i] = if (0..3).any(on_wall) { 0.0 } else { values.value(at) };
            }
        }
        let mut u = Vectors::faces(g, "m/s").unwrap();
        curl(&edges, &mut u).unwrap();
        u
    })
    .collect()
}

fn carried(f: &Field, u: &Vectors, h: f64) -> (Field, f64) {
    let mut f = f.clone();
    let lost = transport(&mut [&mut f], u, h, &mut Spare::default()).unwrap()[0];
    (f, lost)
}

fn sum(f: &Field) -> f64 {
    f.values().iter().sum()
}

#[test]
fn what_leaves_a_cell_enters_the_next_and_no_extremum_is_made() {
    for u in eddies() {
        let g = u.parts[0].grid;
        let f = noisy(g, Place::Cell, 1);
        let fastest = u.parts.iter().flat_map(Field::values).fold(0.0_f64, |m, u| m.max(u.abs()));
        let range = |f: &Field| f.values().iter().fold((f64::INFINITY, -f64::INFINITY), |(l, h), f| (l.min(*f), h.max(*f)));
        let (low, high) = range(&f);
        // Courant numbers of 0.3 and 5.
        for h in [0.03, 0.5].map(|c| c / fastest) {
            let (after, lost) = carried(&f, &u, h);
            let size: f64 = f.values().iter().map(|f| f.abs()).sum();
            assert!((sum(&after) + lost - sum(&f)).abs() < 1e-13 * size && lost.abs() < 1e-13 * size, "{} {} {lost}", sum(&after), sum(&f));
            let (l, h) = range(&after);
            assert!(l >= low - 1e-14 && h <= high + 1e-14 && after.values() != f.values(), "{l} {h} of {low} {high}");
            // The fields of one call do not know of each other.
            let mut both = [f.clone(), noisy(g, Place::Cell, 2)];
            let [a, b] = &mut both;
            transport(&mut [a, b], &u, h.min(1.0), &mut Spare::default()).unwrap();
            assert_eq!(both[0].values(), carried(&f, &u, h.min(1.0)).0.values());
            let ones = Field::of(g, Place::Cell, "1", |_| 3.0).unwrap();
            assert!(carried(&ones, &u, h.min(1.0)).0.values().iter().all(|f| (f - 3.0).abs() < 1e-13));
        }
    }
}

#[test]
fn a_stream_brings_in_what_is_beyond_and_takes_out_what_is_there() {
    let g = Grid::new([10, 4, 3], 0.5, [0.0; 3]).unwrap();
    let u = Vectors::of(g, "m/s", |_| [0.25, 0.0, 0.0]).unwrap();
    let mut f = Field::of(g, Place::Cell, "1", |x| if x[0] < 3.0 { 1.0 } else { 5.0 }).unwrap();
    f.sides[0] = [Side::Ghost(2.0), Side::Ghost(0.0)];
    // In 1.2 s the stream goes 0.6 cells of 0.5 m³; 2 enters, 5 leaves.
    let (after, lost) = carried(&f, &u, 1.2);
    assert!((sum(&after) - sum(&f) - 12.0 * 0.6 * (2.0 - 5.0)).abs() < 1e-11 && lost.abs() < 1e-12, "{} {}", sum(&f), sum(&after));
    // A divergence squeezes: values stay, contents do not, and the difference is told.
    let squeeze = Vectors::of(g, "m/s", |x| [0.1 * (5.0 - x[0]), 0.0, 0.0]).unwrap();
    let ones = Field { sides: [[Side::Ghost(1.0); 2]; 3], ..Field::of(g, Place::Cell, "1", |_| 1.0).unwrap() };
    let (after, lost) = carried(&ones, &squeeze, 0.5);
    assert!(after.values().iter().all(|f| (f - 1.0).abs() < 1e-14));
    // 12 faces of 0.5 m/s let in half a cell each at the lower end, and none out at the upper.
    assert!((lost - 12.0 * 0.5).abs() < 1e-10, "{lost}");
}

/// Error in the first norm over the size of a shape turned once about (0.5, 0.5) at half a cell a step, by transport and by limited
/// MacCormack with monotone cubic interpolation.
fn turned(n: usize, shape: impl Fn([f64; 3]) -> f64) -> [f64; 2] {
    let g = Grid::new([n, 1, n], 1.0 / n as f64, [0.0; 3]).and_then(|g| g.flat(1)).unwrap();
    let u = Vectors::of(g, "m/s", |x| [2.0 * PI * (0.5 - x[2]), 0.0, 2.0 * PI * (x[0] - 0.5)]).unwrap();
    let start = Field::of(g, Place::Cell, "1", shape).unwrap();
    let steps = 2 * (PI * n as f64).ceil() as usize;
    let how = Advection { interpolation: Interpolation::MonotoneCubic, corrected: true, ..Advection::default() };
    let (mut fluxes, mut paths, mut spare) = (start.clone(), start.clone(), Spare::default());
    for _ in 0..steps {
        transport(&mut [&mut fluxes], &u, 1.0 / steps as f64, &mut spare).unwrap();
        paths = advect(&[&paths], &u, 1.0 / steps as f64, &how, &mut spare).unwrap().remove(0);
    }
    [fluxes, paths].map(|f| f.values().iter().zip(start.values()).map(|(a, b)| (a - b).abs()).sum::<f64>() / sum(&start))
}

#[test]
fn jumps_turn_sharper_than_along_paths() {
    let slotted = |x: [f64; 3]| f64::from((x[0] - 0.5).hypot(x[2] - 0.75) < 0.15 && !((x[0] - 0.5).abs() < 0.025 && x[2] < 0.85));
    let hump = |x: [f64; 3]| 0.5 + 0.5 * (PI * ((x[0] - 0.5).hypot(x[2] - 0.75) / 0.2).min(1.0)).cos();
    let [fluxes, paths] = turned(128, slotted);
    println!("slotted disk: {fluxes:.4} {paths:.4}");
    assert!(fluxes < 0.21 && fluxes > 0.16 && paths > 2.5 * fluxes, "{fluxes} {paths}");
    // What is smooth becomes steeper: of first order here, cubic interpolation of second.
    let errors = [64, 128].map(|n| turned(n, hump)[0]);
    println!("hump: {} {:?}", show(&errors), orders(&errors));
    assert!(errors[0] < 0.07 && orders(&errors)[0] > 0.6, "{errors:?}");
}

#[test]
fn bits_of_a_transport_do_not_depend_on_threads() {
    let g = Grid::new([40, 30, 20], 0.1, [0.0; 3]).unwrap();
    let f = noisy(g, Place::Cell, 1);
    let u = Vectors { parts: (0..3).map(|a| noisy(g, Place::Face(a), 3 + a as u64)).collect() };
    let on = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| carried(&f, &u, 0.05));
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(5));
}

#[test]
fn smoke_of_a_plume_around_a_ball_keeps_its_mass() {
    for (order, courant) in [("project_last", 2), ("advect_last", 2), ("reflection", 6)] {
        let mut sim = simulation(&format!(
            r#"
time = {{ fps = 24, frames = 20 }}
[[gas]]
name = "air"
box = {{ size = [1, 1, 1.5], center = [0, 0, 0.75], resolution = 24 }}
smoke = {{ initial = "smoothstep(0.3, 0.1, hypot(x, y, z - 0.4))" }}
temperature = {{ ambient = 300, initial = "300 + 100*smoothstep(0.3, 0.1, hypot(x - 0.02, y, z - 0.4))" }}
advection.scalars.conservative = true
order = "{order}"
courant = {courant}
[[collider]]
name = "ball"
shape.sphere = {{ center = [0.05, 0.02, 0.9], radius = 0.2 }}
"#
        ));
        let before = sim.ledger().mass;
        run(&mut sim, 20);
        let after = sim.ledger();
        let smoke = grid(&sim, "air", "density").0;
        println!("{order}: {:e}, {} m/s", after.mass / before - 1.0, after.speed.unwrap());
        assert!((after.mass / before - 1.0).abs() < 1e-14 && after.speed.unwrap() > 0.5, "{} {before}", after.mass);
        assert!(smoke.iter().all(|s| (0.0..=1.0).contains(s)) && smoke.iter().any(|s| *s > 0.3));
    }
}

#[test]
fn smoke_that_an_inflow_brings_is_all_there_until_it_leaves() {
    const SOURCE: &str = "source = [{ shape.sphere = { center = [0.3, 0, 0.5], radius = 0.15 }, smoke = 2, end = 0.5 }]";
    let stream = |words: &str| {
        simulation(&format!(
            r#"
dimension = 2
time = {{ fps = 10, frames = 20 }}
[[gas]]
name = "air"
box = {{ size = [2, 1, 1], center = [1, 0, 0.5], resolution = 40 }}
smoke = {{ weight = 0 }}
advection.scalars.conservative = true
courant = 0.7
{SOURCE}
{words}
[[collider]]
name = "post"
shape.sphere = {{ center = [0.7, 0, 0.45], radius = 0.12 }}
"#
        ))
    };
    let mut still = stream("");
    run(&mut still, 5);
    let given = still.ledger().mass;
    // 2 kg/(m³ s) for half a second in what the grid covers of the disk.
    assert!((given / (PI * 0.0225) - 1.0).abs() < 0.04, "{given}");
    let mut sim = stream("sides = { x = [{ inflow = { velocity = [1, 0, 0], density = 0.5 } }, \"open\"] }\nvelocity = [1, 0, 0]");
    for frame in 1..8 {
        step(&mut sim);
        // And 0.5 kg/m³ over 1 m at 1 m/s.
        let expected = given * (0.2 * f64::from(frame)).min(1.0) + 0.05 * f64::from(frame);
        assert!((sim.ledger().mass - expected).abs() < 1e-10, "{frame}: {} {expected}", sim.ledger().mass);
    }
}

#[test]
fn a_jump_between_layers_swings_closer_to_its_period() {
    // Paths smear the layer between two densities: -5.9 % and -4.4 % (densities.rs). Fluxes keep it thin: -2.9 % and -1.6 %.
    let exact = (0.5 * 9.8 * PI * PI.tanh()).sqrt();
    let off = [32, 64].map(|n| wave("variable", n, "advection.scalars.conservative = true") / exact - 1.0);
    println!("off by {off:?}");
    assert!(off[0].abs() < 0.032 && off[1].abs() < 0.018 && (off[0] / off[1]).log2() > 0.75, "{off:?}");
}

#[test]
fn what_transport_cannot_do_is_told() {
    for (words, message) in [
        ("advection.velocity.conservative = true", "gas \"air\".advection.velocity.conservative: true, expected false: for scalars only"),
        ("advection.scalars = { conservative = true, corrected = false }", "gas \"air\".advection.scalars: given with conservative"),
        ("advection.scalars = { conservative = true, pieces = 2 }", "gas \"air\".advection.scalars: given with conservative"),
    ] {
        let text = format!("version = 1\n[[gas]]\nname = \"air\"\nbox = {{ size = [1, 1, 1], resolution = 8 }}\n{words}\n");
        let error = Simulation::new(Scene::from_toml(&text).unwrap(), Default::default()).err().unwrap().to_string();
        assert!(error.contains(message), "{error}");
    }
}
