//! Tracers in a gas, in double precision: docs/theory/gas.md.

extern crate tumble_f64 as tumble;

use crate::common;

use common::{positions, run, show, simulation, step};
use std::sync::Arc;
use tumble_f64::exchange::Exchange;
use tumble_f64::forces::{Current, Flow, OnGrid};
use tumble_f64::state::{Grid, Object, Vectors};
use tumble_f64::system::System;
use tumble_f64::systems::tracers::{Settings, Tracers};
use tumble_interface::scene::Integrator;
use tumble_interface::{Data, Engine};

/// How far a point is from where it was after a turn of a solid body in n steps, on grids in space and in the plane.
fn turn(integrator: Integrator, n: u32, flat: Option<usize>) -> f64 {
    let mut grid = Grid::new([10, if flat.is_some() { 1 } else { 10 }, 10], 0.3, [-1.5, -1.5, -1.5]).unwrap();
    if let Some(axis) = flat {
        grid = grid.flat(axis).unwrap();
    }
    // About the y axis through (0.1, ., 0.05), once in 2 pi seconds; linear interpolation is exact for it.
    let u = Vectors::of(grid, "m/s", |x| [x[2] - 0.05, 0.0, -(x[0] - 0.1)]).unwrap();
    let mut exchange = Exchange::default();
    let (air, dust) = (exchange.enter("air"), exchange.enter("dust"));
    exchange.ask("air", "velocity");
    exchange.turn(air).publish_field("air", "velocity", 0.0, || u.clone());
    let flow = Flow { fields: vec![Current::OnGrid(OnGrid { fluid: "air".into(), ..OnGrid::default() })], flat };
    let settings = Settings { name: "dust".into(), integrator, substeps: Some(n), step: None, adaptive: Default::default() };
    let start = [0.8, 0.0, -0.3];
    let object = Object { name: "dust".into(), points: 0..1, ..Object::default() };
    let mut tracers = Tracers::new(settings, flow, &[start.into()], vec![object], Vec::new());
    tracers.absorb(&mut exchange.turn(dust));
    let end = 2.0 * std::f64::consts::PI;
    tracers.advance(0.0, end, &mut exchange.turn(dust), &|| true).unwrap();
    let mut columns = Vec::new();
    tracers.columns(end, &["position"], &mut columns);
    let Data::F64(x) = &columns[0].data else { panic!() };
    (0..3).map(|a| (x[a] - start[a]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn turns_close_at_the_order_of_the_scheme() {
    for (integrator, order) in [(Integrator::Midpoint, 2.0), (Integrator::Rk4, 4.0)] {
        for flat in [None, Some(1)] {
            let errors = [32, 64, 128].map(|n| turn(integrator, n, flat));
            let orders = common::orders(&errors);
            println!("{}: {} orders {}", integrator.name(), show(&errors), show(&orders));
            assert!(orders.iter().all(|o| (o - order).abs() < 0.15), "{orders:?}");
            assert!(errors[2] > 1e-12 && errors[2] < 0.01, "{errors:?}");
        }
    }
}

fn stream(before: bool, more: &str) -> tumble_f64::scene::Simulation {
    let gas = "[[system]]\nname = \"air\"\nmethod = \"gas\"\nsubsteps = 2\n";
    let (first, last) = if before { (gas, "") } else { ("", gas) };
    simulation(&format!(
        r#"
dimension = 2
time = {{ fps = 20, frames = 40 }}
{first}[[system]]
name = "dust"
method = "tracers"
integrator = "midpoint"
{last}[[gas]]
name = "stream"
box = {{ size = [2, 1, 1], resolution = 16 }}
sides = {{ x = ["periodic", "periodic"] }}
velocity = [0.5, 0, 0]
{more}
[[field]]
kind = "gas"
of = "stream"
[[particles]]
name = "two"
system = "dust"
position = [[0, 0, 0.1], [-0.7, 0, -0.45]]
"#
    ))
}

#[test]
fn in_a_stream_that_grows_faster_points_fall() {
    // u = 0.5 + 0.8 t: x = t/2 + 0.4 t². Between exchanges the velocity is linear in time, which the midpoint rule takes exactly.
    let mut sim = stream(true, "acceleration = [0.8, 0, 0]");
    run(&mut sim, 30);
    let x = positions(&sim, "two");
    let way = 0.75 + 0.4 * 2.25;
    assert!((x[0].x - way).abs() < 1e-10 && (x[1].x + 0.7 - way).abs() < 1e-10, "{x:?}");
    assert!(x[0].z == 0.1 && x[1].z == -0.45);
    // A system before the gas has the velocity of the beginning of each interval of 0.05 s: 0.8 0.05/2 1.5 m less.
    let mut sim = stream(false, "acceleration = [0.8, 0, 0]");
    assert!(sim.warnings().iter().any(|w| w.message.contains("put it behind")), "{:?}", sim.warnings());
    run(&mut sim, 30);
    let late = positions(&sim, "two")[0].x;
    assert!((late - (way - 0.03)).abs() < 1e-10, "{late}");
}

#[test]
fn seeds_are_counted_and_keep_their_ids_and_go_on_from_a_snapshot() {
    let make = || {
        stream(
            true,
            r#"
[[emitter]]
name = "dust grains"
system = "dust"
from = { box = { center = [-0.5, 0, 0], size = [0.2, 0, 0.4] } }
rate = 100
lifetime = 0.5
"#,
        )
    };
    let mut sim = make();
    let ids = |sim: &tumble_f64::scene::Simulation| match &sim.frame(&["id"]).column("dust grains", "id").unwrap().data {
        Data::U32(ids) => ids.clone(),
        other => panic!("{other:?}"),
    };
    run(&mut sim, 15);
    // 100 a second, of which the last half second lives.
    let before = ids(&sim);
    assert!(before.len().abs_diff(50) <= 1, "{}", before.len());
    let there = positions(&sim, "dust grains");
    let saved = sim.save(&[]);
    step(&mut sim);
    let (after, now) = (ids(&sim), positions(&sim, "dust grains"));
    let mut kept = 0;
    for (id, x) in before.iter().zip(&there) {
        if let Some(k) = after.iter().position(|i| i == id) {
            // The same one, 0.5 m/s for 0.05 s farther.
            assert!((now[k].x - x.x - 0.025).abs() < 1e-12 && (now[k].z - x.z).abs() < 1e-15);
            kept += 1;
        }
    }
    assert!((44..=46).contains(&kept), "{kept}");
    run(&mut sim, 3);
    let mut other = make();
    other.restore(&saved).unwrap();
    run(&mut other, 4);
    assert_eq!(other.hash(), sim.hash());
}

#[test]
fn velocities_are_linear_between_faces_and_times() {
    let grid = Grid::new([6, 5, 7], 0.25, [-0.7, -0.6, -0.8]).unwrap();
    // Linear in place, and from another such field to another in time: what is linear between is exact.
    let early = |x: [f64; 3]| [1.0 + 2.0 * x[0] - x[2], 0.5 * x[1], x[0] + 3.0 * x[1]];
    let late = |x: [f64; 3]| [-2.0 + x[1], 4.0 * x[0] - x[1], 0.25 + x[2]];
    let states = vec![(2.0, Arc::new(Vectors::of(grid, "m/s", early).unwrap())), (2.5, Arc::new(Vectors::of(grid, "m/s", late).unwrap()))];
    let flow = OnGrid { fluid: "air".into(), states };
    for x in [[0.013, -0.02, 0.1], [-0.31, 0.27, -0.4], [0.4, 0.1, 0.33]] {
        for (t, s) in [(1.0, 0.0), (2.0, 0.0), (2.05, 0.1), (2.4, 0.8), (2.5, 1.0), (9.0, 1.0)] {
            let v: [f64; 3] = flow.at(t, x.into()).into();
            for a in 0..3 {
                let exact = (1.0 - s) * early(x)[a] + s * late(x)[a];
                assert!((v[a] - exact).abs() < 1e-13, "{x:?} {t} {a}: {} {exact}", v[a]);
            }
        }
    }
}

#[test]
fn a_field_of_no_gas_is_told() {
    let text = "version = 1\n[[system]]\nmethod = \"tracers\"\nintegrator = \"rk4\"\n[[particles]]\nname = \"p\"\nposition = [[0, 0, 0]]\n[[field]]\nkind = \"gas\"\nof = \"steam\"\n";
    let error = tumble_f64::scene::Simulation::new(tumble_interface::Scene::from_toml(text).unwrap(), Default::default()).err().unwrap();
    assert!(error.to_string().contains("field[0].of: there is no gas \"steam\""), "{error}");
    let flow = OnGrid { fluid: String::new(), states: vec![(0.0, Arc::new(Vectors { parts: Vec::new() }))] };
    assert_eq!(flow.small(), 1.0);
}
