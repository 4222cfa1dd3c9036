//! Helpers of the verification tests: scenes from text, columns as vectors, observed orders.

#![allow(dead_code)] // every test is a crate of its own and uses a part of this

use tumble_f64::geometry::{Collider, Friction, Shape};
use tumble_f64::scene::Simulation;
use tumble_f64::state::{Field, Grid, Place};
use tumble_interface::engine::StepReport;
use tumble_interface::scene::Integrator;
use tumble_interface::{Data, Engine, Scene};

pub type Vector = tumble_f64::geometry::Vector;

/// Schemes with a fixed step.
pub fn fixed() -> Vec<Integrator> {
    Integrator::ALL.into_iter().filter(|i| !i.is_adaptive()).collect()
}

/// All schemes, position-based dynamics too.
pub fn every() -> Vec<Integrator> {
    Integrator::ALL.into_iter().chain([Integrator::PositionBased]).collect()
}

/// Whether long tests run in full, as in `make validate`.
pub fn whole() -> bool {
    std::env::var_os("TUMBLE_WHOLE").is_some()
}

/// All cases of a long test in `make validate`, every `step`th of them otherwise.
pub fn cases<T>(all: impl IntoIterator<Item = T>, step: usize) -> impl Iterator<Item = T> {
    all.into_iter().step_by(if whole() { 1 } else { step })
}

/// A simulation of a scene in TOML; `version = 1` is added.
pub fn simulation(text: &str) -> Simulation {
    let scene = Scene::from_toml(&format!("version = 1\n{text}")).unwrap_or_else(|e| panic!("{e}\n{text}"));
    Simulation::new(scene, Default::default()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// One frame, which must not fail.
pub fn step(sim: &mut Simulation) -> StepReport {
    sim.step(&|| true).unwrap_or_else(|e| panic!("{e}")).unwrap()
}

/// Some frames, which must not fail; their reports together.
pub fn run(sim: &mut Simulation, frames: usize) -> StepReport {
    let mut report = StepReport::default();
    (0..frames).for_each(|_| report.add_interval(&step(sim)));
    report
}

/// A column of vectors.
pub fn column(sim: &Simulation, object: &str, name: &str) -> Vec<Vector> {
    let frame = sim.frame(&[name]);
    match &frame.column(object, name).unwrap_or_else(|| panic!("no {name} of {object}")).data {
        Data::F64(numbers) => numbers.chunks_exact(3).map(|c| [c[0], c[1], c[2]].into()).collect(),
        other => panic!("{object}.{name} is {other:?}"),
    }
}

/// Intersections that are counted once the first `moved` vertices of an object have gone so far: the sign that the counter is alive. The
/// state of the simulation is lost.
pub fn intersections_after(sim: &mut Simulation, object: &str, moved: usize, by: impl Fn(Vector) -> Vector) -> u64 {
    let x = positions(sim, object).into_iter().enumerate().map(|(i, x)| if i < moved { x + by(x) } else { x });
    write(sim, object, "position", &x.collect::<Vec<_>>());
    sim.ledger().intersections.unwrap()
}

/// A column of a grid, and its points along each axis.
pub fn grid(sim: &Simulation, object: &str, name: &str) -> (Vec<f64>, Vec<usize>) {
    let frame = sim.frame(&[name]);
    let column = frame.column(object, name).unwrap_or_else(|| panic!("no {name} of {object}"));
    match &column.data {
        Data::F64(numbers) => (numbers.clone(), column.points.clone()),
        other => panic!("{object}.{name} is {other:?}"),
    }
}

/// A solid at rest, without friction or restitution, that masses alone meet.
pub fn solid(shape: Shape, inside: bool, thickness: f64) -> Collider {
    let (friction, belt) = (Friction::default(), Vector::default());
    Collider {
        name: String::new(),
        shape,
        inside,
        thickness,
        friction,
        rubbing: None,
        restitution: 0.0,
        belt,
        motion: None,
        rig: None,
        edges: None,
    }
}

/// The largest magnitude.
pub fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().fold(0.0, |most, x| x.abs().max(most))
}

/// Positions [m].
pub fn positions(sim: &Simulation, object: &str) -> Vec<Vector> {
    column(sim, object, "position")
}

/// Velocities [m/s].
pub fn velocities(sim: &Simulation, object: &str) -> Vec<Vector> {
    column(sim, object, "velocity")
}

/// Sets a column.
pub fn write(sim: &mut Simulation, object: &str, name: &str, values: &[Vector]) {
    let flat: Vec<f64> = values.iter().flat_map(|v| <[f64; 3]>::from(*v)).collect();
    sim.write(object, name, &flat).unwrap_or_else(|e| panic!("{e}"));
}

/// A scene's list of vectors.
pub fn list(values: &[Vector]) -> String {
    let one = |v: &Vector| format!("[{:e}, {:e}, {:e}]", v.x, v.y, v.z);
    format!("[{}]", values.iter().map(one).collect::<Vec<_>>().join(", "))
}

pub fn vector(x: f64, y: f64, z: f64) -> Vector {
    [x, y, z].into()
}

/// log2 of each error over the next: the observed order where each belongs to half the step of the one before.
pub fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect()
}

/// Numbers for people.
pub fn show(numbers: &[f64]) -> String {
    numbers.iter().map(|n| format!("{n:.3e}")).collect::<Vec<_>>().join(" ")
}

/// Slope of the line through points (x, y) that fits best.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    points.iter().map(|(x, y)| (x - mx) * (y - my)).sum::<f64>() / points.iter().map(|(x, _)| (x - mx) * (x - mx)).sum::<f64>()
}

/// Times at which a sampled smooth function passes zero, with its slope there: from samples (t, y, y') by the cubic that
/// has both values and both slopes, an error of order 4 in the interval.
pub fn zeros(samples: &[(f64, f64, f64)]) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    for pair in samples.windows(2) {
        let [(t0, a, da), (t1, b, db)] = *pair else { unreachable!() };
        if (a < 0.0) == (b < 0.0) {
            continue;
        }
        let h = t1 - t0;
        let cubic = |s: f64| {
            let (s2, s3) = (s * s, s * s * s);
            a * (1.0 - 3.0 * s2 + 2.0 * s3) + b * (3.0 * s2 - 2.0 * s3) + h * (da * (s - 2.0 * s2 + s3) + db * (s3 - s2))
        };
        let slope = |s: f64| (b - a) / h * 6.0 * s * (1.0 - s) + da * (1.0 - 4.0 * s + 3.0 * s * s) + db * (3.0 * s * s - 2.0 * s);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if (cubic(middle) < 0.0) == (a < 0.0) { low = middle } else { high = middle }
        }
        found.push((t0 + h * low, slope(low)));
    }
    found
}

/// Numbers between -1 and 1 without a pattern, the same in every run.
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64) / (1_u64 << 52) as f64 - 1.0
    }

    pub fn vector(&mut self) -> Vector {
        [self.next(), self.next(), self.next()].into()
    }
}

/// Numbers without any pattern, from -0.5 to 0.5.
pub fn noise(f: &mut Field, seed: u64) {
    let mut s = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    for at in f.each() {
        s ^= s << 13;
        s ^= s >> 7;
        s ^= s << 17;
        let i = f.index(at);
        f.data[i] = (s >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
    }
}

/// A field of them.
pub fn noisy(grid: Grid, place: Place, seed: u64) -> Field {
    let mut f = Field::new(grid, place, "").unwrap();
    noise(&mut f, seed);
    f
}
