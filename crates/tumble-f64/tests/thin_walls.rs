//! Walls thinner than a cell in fluids: docs/theory/gas.md, "Solids".

#![allow(clippy::unwrap_used)] // helpers of tests fail by panicking, too

extern crate tumble_f64 as tumble;

use crate::common;

use common::{grid, run, simulation};
use std::f64::consts::PI;
use tumble_interface::Engine;

/// A room in two halves, in the left of which smoke is blown about; the wall passes through the middle, leans by an angle [°] and is as thick as given [m].
fn room(dimension: usize, n: usize, thickness: f64, [lean, turn]: [f64; 2], shift: f64, more: &str) -> tumble::scene::Simulation {
    simulation(&format!(
        "precision = \"double\"\ndimension = {dimension}\ntime = {{ fps = 24, frames = 48 }}\n[[system]]\nmethod = \"gas\"\n[[gas]]\nname = \"room\"\n\
         box = {{ size = [2, 1, 1], center = [0, 0, 0.5], resolution = {n} }}\nsmoke = {{ weight = 0 }}\n{more}\n[[gas.source]]\nshape.box = {{ center = [-0.75, 0, 0.3], size = \
         [0.2, 0.6, 0.2] }}\ndensity = 1\nvelocity = [3, 0, 0]\n[[collider]]\nname = \"wall\"\nshape.box = {{ center = [{shift}, 0, 0.5], size = [{thickness}, 4, 4], rotate = [0, {lean}, \
         {turn}] }}\n"
    ))
}

/// The most smoke and the most kinetic energy per mass beyond the wall, and both before it.
fn beyond(sim: &tumble::scene::Simulation, [lean, turn]: [f64; 2], shift: f64) -> [[f64; 2]; 2] {
    let (smoke, points) = grid(sim, "room", "density");
    let (velocity, _) = grid(sim, "room", "velocity");
    let dx = 2.0 / points[0] as f64;
    let [lean, turn] = [lean, turn].map(|angle: f64| angle * PI / 180.0);
    // The wall's normal: x turned about y, then about z.
    let normal = [lean.cos() * turn.cos(), lean.cos() * turn.sin(), -lean.sin()];
    let mut most = [[0.0_f64; 2]; 2];
    for (i, smoke) in smoke.iter().enumerate() {
        let flat = points.len() == 2;
        let at =
            [i % points[0], if flat { 0 } else { i / points[0] % points[1] }, if flat { i / points[0] } else { i / points[0] / points[1] }];
        let x = [
            (at[0] as f64 + 0.5) * dx - 1.0 - shift,
            if flat { 0.0 } else { (at[1] as f64 + 0.5) * dx - 0.5 },
            (at[2] as f64 + 0.5) * dx - 0.5,
        ];
        let side = (0..3).map(|a| x[a] * normal[a]).sum::<f64>();
        let v = &velocity[points.len() * i..][..points.len()];
        let most = &mut most[usize::from(side > 0.0)];
        // Cells beside the wall are cut by it.
        if side.abs() > 1.8 * dx {
            *most = [most[0].max(*smoke), most[1].max(v.iter().map(|v| v * v).sum())];
        }
    }
    most
}

#[test]
fn a_wall_blocks_wherever_it_lies_and_however_it_leans() {
    for (dimension, n) in [(2, 48), (3, 24)] {
        for thickness in [1e-3, 0.01, 0.03, 0.06, 0.1] {
            for lean in [[0.0, 0.0], [7.0, 0.0], [30.0, 0.0], [45.0, 0.0], [30.0, 40.0]] {
                for shift in [0.0, 0.0173] {
                    if dimension == 2 && lean[1] != 0.0 || dimension == 3 && shift != 0.0 {
                        continue;
                    }
                    let mut sim = room(dimension, n, thickness, lean, shift, "");
                    run(&mut sim, if dimension == 2 { 24 } else { 8 });
                    let [before, beyond] = beyond(&sim, lean, shift);
                    let case = format!("{dimension}D, thickness {thickness} m, lean {lean:?}, shift {shift} m: {before:?} {beyond:?}");
                    assert!(before[0] > 0.9 && before[1] > 5.0, "{case}");
                    // Round-off of the pressure's solver.
                    assert!(beyond[0] < 1e-20 && beyond[1] < 1e-15, "{case}");
                }
            }
        }
    }
}

#[test]
fn a_thin_piston_pushes_the_fluid_in_a_pipe_at_its_own_speed() {
    for (thickness, lean) in [(1e-3, 0.0), (0.02, 0.0), (1e-3, 25.0)] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ndimension = 2\ntime = {{ fps = 24, frames = 12 }}\n[[system]]\nmethod = \"gas\"\n[[gas]]\nname = \"pipe\"\nbox = {{ size = [2, 1, 1], \
             center = [0, 0, 0.5], resolution = 48 }}\nsides.x = [\"open\", \"open\"]\n[[collider]]\nname = \"piston\"\nshape.box = {{ center = [-0.31, 0, 0.5], size = [{thickness}, \
             4, 4], rotate = [0, {lean}, 0] }}\nmotion.velocity = [0.5, 0, 0]\n"
        ));
        run(&mut sim, 12);
        let (velocity, points) = grid(&sim, "pipe", "velocity");
        let dx = 2.0 / points[0] as f64;
        let slope = (lean * PI / 180.0).tan();
        let mut counted = [0; 2];
        for (i, v) in velocity.chunks_exact(2).enumerate() {
            let [x, z] = [(i % points[0]) as f64, (i / points[0]) as f64].map(|i| (i + 0.5) * dx);
            let side = (x - 1.0 + 0.31 - 0.25) - slope * (z - 0.5);
            if side.abs() > 3.0 * dx {
                counted[usize::from(side > 0.0)] += 1;
                // The cut cells of a leaning piston are of first order.
                let bound = if lean == 0.0 { 1e-9 } else { 0.03 };
                assert!((v[0] - 0.5).abs() < bound && v[1].abs() < bound, "thickness {thickness}, lean {lean}, at {x} {z}: {v:?}");
            }
        }
        assert!(counted.iter().all(|n| *n > 200), "{counted:?}");
    }
}

/// A closed surface of sheet metal around a source keeps all of its smoke.
#[test]
fn a_can_of_sheet_metal_keeps_its_smoke() {
    let mut sim = simulation(
        "precision = \"double\"\ntime = { fps = 24, frames = 8 }\n[[system]]\nmethod = \"gas\"\n[[gas]]\nname = \"room\"\nbox = { size = [1, 1, 1], center = [0, 0, 0.5], \
         resolution = 24 }\nsmoke = { weight = 0 }\n[[gas.source]]\nshape.sphere = { center = [0.013, 0, 0.52], radius = 0.1 }\ndensity = 1\nvelocity = [1, 2, 0.5]\n[[collider]]\n\
         name = \"can\"\nshape.lathe = { profile = [[0.3, 0.21], [0.3, 0.83], [0.29, 0.83], [0.29, 0.22], [0, 0.22], [0, 0.21]] }\n[[collider]]\nname = \"lid\"\nshape.box = { center \
         = [0, 0, 0.825], size = [0.7, 0.7, 0.004] }\n",
    );
    run(&mut sim, 8);
    let (smoke, points) = grid(&sim, "room", "density");
    let dx = 1.0 / points[0] as f64;
    let (mut inside, mut outside) = (0.0_f64, 0.0_f64);
    for (i, smoke) in smoke.iter().enumerate() {
        let [x, y, z] = [i % points[0], i / points[0] % points[1], i / points[0] / points[1]].map(|i| (i as f64 + 0.5) * dx);
        let radius = (x - 0.5).hypot(y - 0.5);
        if radius > 0.3 + 2.0 * dx || z > 0.83 + 2.0 * dx || z < 0.21 - 2.0 * dx {
            outside = outside.max(*smoke);
        } else if radius < 0.15 && (0.3..0.7).contains(&z) {
            inside = inside.max(*smoke);
        }
    }
    assert!(inside > 0.9 && outside < 1e-12, "{inside} {outside}");
}

/// Cells of 1/16 m that a solid takes out of a cubic metre of smoke.
fn taken(shape: &str) -> f64 {
    let sim = simulation(&format!(
        "precision = \"double\"\n[[gas]]\nname = \"air\"\nbox = {{ size = [1, 1, 1], resolution = 16 }}\nsmoke = {{ initial = \"1\", weight = 0 }}\n[[collider]]\nname = \"c\"\nshape.{shape}\n"
    ));
    (1.0 - sim.ledger().mass) * 16.0_f64.powi(3)
}

#[test]
fn balls_keep_their_size_and_plates_grow_to_what_blocks() {
    // Cells that a surface cuts stay with the smoke. A ball as wide as two cells has the volume of six, one three times as wide that of 158; a
    // plate of a millimetre takes a layer or two of 256.
    let [small, large] = [0.07, 0.21].map(|radius| taken(&format!("sphere = {{ center = [0.01, 0.02, 0.013], radius = {radius} }}")));
    assert!(small < 2.0 && (60.0..158.0).contains(&large), "{small} {large}");
    let plate = taken("box = { center = [0.01, 0, 0], size = [0.001, 2, 2] }");
    assert!((255.0..513.0).contains(&plate), "{plate}");
}

#[test]
fn a_solid_that_comes_into_a_fluid_at_rest_is_met_by_a_pressure_that_converges() {
    // Half a millimetre outside at first, then its tip has one node of the grid: it cuts faces and closes none, and nothing moves yet.
    let mut sim = simulation(
        "precision = \"double\"\ndimension = 2\ntime = { fps = 1000, frames = 3 }\n[[gas]]\nname = \"air\"\nbox = { size = [2, 1, 2], resolution = 32 }\nsides.x = [\"open\", \"open\"]\n\
         [[collider]]\nname = \"c\"\nshape.sphere = { center = [-1.5005, 0, 0], radius = 0.5 }\nmotion.velocity = [1, 0, 0]\n",
    );
    assert_eq!(sim.ledger().speed, Some(0.0));
    let report = run(&mut sim, 3);
    assert_eq!(report.unconverged, 0);
    let speed = sim.ledger().speed.unwrap();
    assert!(speed > 1e-3 && speed < 2.0, "{speed}");
}
