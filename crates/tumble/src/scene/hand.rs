//! What a hand does to a simulation: it pulls masses with springs, and stirs gases.

use super::Simulation;
use crate::math::functions::exp;
use std::sync::{Arc, Mutex};
use tumble_interface::engine::{Engine, UserForce};
use tumble_interface::{Column, Data, SceneError};

/// Frequency of the spring of the hand [1/s], where the steps of the scene bear it.
const FREQUENCY: f64 = 2.0;
/// Largest angular frequency of a held mass times its step: explicit schemes stay far below their limit.
const SLOW: f64 = 0.3;
/// How much around a mass is held with it, as a part of the diagonal of its object.
const GRIP: f64 = 0.06;

/// Masses on springs to points that follow the pointer.
pub struct Held {
    object: String,
    row: usize,
    /// Rows in the system; where each is held, from the target [m]; spring constant [N/m]; damping [N s/m].
    masses: Vec<(usize, [f64; 3], f64, f64)>,
    target: [f64; 3],
}

impl Held {
    /// A mass (row of its object) and those around it, on a spring to `target` [m]; `stiffness` [N/m] is that of all together, chosen
    /// where left out: as stiff as the steps of the scene bear, as far as that is known before `go_on` says no. The name of their system
    /// comes with them.
    pub fn new(
        simulation: &mut Simulation,
        object: &str,
        row: usize,
        target: [f64; 3],
        stiffness: Option<f64>,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<(String, Self), SceneError> {
        let wrong = |message: &str| SceneError::one(object, message);
        let objects = simulation.scene().objects();
        let held = objects.iter().find(|o| o.name == object).ok_or_else(|| wrong("there is no such object to hold"))?;
        let system = held.system.unwrap_or_default().to_string();
        let loose = matches!(held.kind, "particles" | "galaxy");
        let beside: Vec<&str> = objects.iter().filter(|o| o.system == held.system).map(|o| o.name).collect();
        let topology = simulation.topology();
        let frame = simulation.frame(&["position"]);
        let column = |all: &'_ [Column], name: &str| all.iter().find(|c| c.object == object && c.name == name).map(|c| c.data.numbers());
        let (Some(x), Some(mass)) = (column(&frame.columns, "position"), column(&topology, "mass")) else {
            return Err(wrong("it cannot be held: its particles have no mass of their own, or come and go"));
        };
        if x.len() != 3 * mass.len() || row >= mass.len() {
            return Err(wrong("there is no such mass"));
        }
        // Masses stand in the order of the objects of their system.
        let before = topology.iter().filter(|c| c.name == "mass" && beside.contains(&c.object.as_str())).take_while(|c| c.object != object);
        let first: usize = before.map(|c| c.data.len()).sum();
        let pinned = topology.iter().find(|c| c.object == object && c.name == "pinned");
        let pinned = pinned.map(|c| if let Data::U32(rows) = &c.data { rows.clone() } else { Vec::new() }).unwrap_or_default();
        let at = |i: usize| [x[3 * i], x[3 * i + 1], x[3 * i + 2]];
        let (low, high) = (0..mass.len()).map(at).fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), p| {
            (std::array::from_fn(|a| low[a].min(p[a])), std::array::from_fn(|a| high[a].max(p[a])))
        });
        let radius = if loose { 0.0 } else { GRIP * distance(low, high) };
        let center = at(row);
        let near: Vec<usize> = (0..mass.len()).filter(|i| distance(at(*i), center) <= radius && !pinned.contains(&(*i as u32))).collect();
        let total: f64 = mass.iter().sum();
        let share: f64 = near.iter().map(|i| mass[*i]).sum();
        let estimate = simulation.stability(go_on).into_iter().find(|s| s.system == system);
        let h = estimate.map_or(f64::INFINITY, |s| s.step).min(simulation.scene().frame_time());
        let masses = near.into_iter().map(|i| {
            let p = at(i);
            let all = stiffness.filter(|k| k.is_finite() && *k > 0.0).unwrap_or(total * (std::f64::consts::TAU * FREQUENCY).powi(2));
            let k = (all * mass[i] / share).min(mass[i] * (SLOW / h) * (SLOW / h));
            (first + i, std::array::from_fn(|a| p[a] - center[a]), k, 2.0 * (k * mass[i]).sqrt())
        });
        Ok((system, Self { object: object.into(), row, masses: masses.collect(), target }))
    }
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>().sqrt()
}

type Shared = Arc<Mutex<Option<Held>>>;

/// What is held, and the systems that know the hand.
#[derive(Default)]
pub struct Hand {
    known: Vec<(String, Shared)>,
}

impl Hand {
    /// Whether any system has its force.
    pub fn is_known(&self) -> bool {
        !self.known.is_empty()
    }

    /// Moves the target if this mass is held already.
    pub fn drag(&mut self, object: &str, row: usize, target: [f64; 3]) -> bool {
        self.known.iter().any(|(_, shared)| {
            let Ok(mut held) = shared.lock() else { return false };
            let Some(held) = held.as_mut().filter(|held| held.object == object && held.row == row) else { return false };
            held.target = target;
            true
        })
    }

    /// Holds these instead of others; `true` if the system does not know the hand yet.
    pub fn take(&mut self, system: &str, held: Held) -> bool {
        self.release();
        let new = !self.known.iter().any(|(name, _)| name == system);
        if new {
            self.known.push((system.into(), Shared::default()));
        }
        for (_, shared) in self.known.iter().filter(|(name, _)| name == system) {
            if let Ok(mut place) = shared.lock() {
                *place = Some(held);
                break;
            }
        }
        new
    }

    /// The force of the hand in a system.
    pub fn force(&self, system: &str) -> Box<dyn UserForce> {
        let found = self.known.iter().find(|(name, _)| name == system).map(|(_, shared)| shared.clone());
        Box::new(Pull(found.unwrap_or_default()))
    }

    /// Lets go of everything.
    pub fn release(&mut self) {
        for (_, shared) in &self.known {
            if let Ok(mut held) = shared.lock() {
                *held = None;
            }
        }
    }
}

struct Pull(Shared);

impl UserForce for Pull {
    fn force(&mut self, _t: f64, x: &[f64], v: &[f64], _mass: &[f64], force: &mut [f64]) -> Result<(), String> {
        let Ok(held) = self.0.lock() else { return Ok(()) };
        let Some(held) = held.as_ref() else { return Ok(()) };
        for (i, offset, stiffness, damping) in &held.masses {
            for a in 0..3 {
                let k = 3 * i + a;
                if let (Some(x), Some(v), Some(force)) = (x.get(k), v.get(k), force.get_mut(k)) {
                    *force += stiffness * (held.target[a] + offset[a] - x) - damping * v;
                }
            }
        }
        Ok(())
    }
}

/// Adds to the velocity [m/s] and the density [kg/m³] of a gas around a point, falling off as a Gaussian of `radius` [m].
pub fn stir(
    simulation: &mut Simulation,
    gas: &str,
    position: [f64; 3],
    velocity: [f64; 3],
    radius: f64,
    density: f64,
) -> Result<(), SceneError> {
    let wrong = |message: &str| SceneError::one(gas, message);
    if !(radius.is_finite() && radius > 0.0 && density.is_finite()) {
        return Err(wrong("expected a radius > 0 m and a finite density"));
    }
    let topology = simulation.topology();
    let of_grid = |name: &str| topology.iter().find(|c| c.object == gas && c.name == name).map(|c| c.data.numbers());
    let (Some(origin), Some(spacing), Some(flat)) = (of_grid("grid_origin"), of_grid("grid_spacing"), of_grid("grid_flat")) else {
        return Err(wrong("there is no such gas"));
    };
    let (Some(dx), Some(flat)) = (spacing.first(), flat.first()) else { return Err(wrong("there is no such gas")) };
    let axes: Vec<usize> = (0..3).filter(|a| *a as f64 != *flat).collect();
    let columns = [("velocity_x", velocity[0], Some(0)), ("velocity_y", velocity[1], Some(1)), ("velocity_z", velocity[2], Some(2))];
    for (name, amount, wall) in columns.into_iter().chain([("density", density, None)]) {
        if amount == 0.0 {
            continue;
        }
        let frame = simulation.frame(&[name]);
        let Some(column) = frame.column(gas, name).filter(|c| c.points.len() == axes.len() && c.width == 1) else { continue };
        let mut values = column.data.numbers();
        // What each axis contributes to the Gaussian; their product is the weight.
        let along: Vec<Vec<f64>> = axes
            .iter()
            .zip(&column.points)
            .map(|(a, n)| {
                let shift = if wall == Some(*a) { 0.0 } else { 0.5 };
                let from = origin.get(*a).copied().unwrap_or_default() - position[*a];
                (0..*n).map(|i| from + (i as f64 + shift) * dx).map(|d| gaussian(d / radius)).collect()
            })
            .collect();
        let mut index = vec![0; axes.len()];
        for value in &mut values {
            let weight: f64 = index.iter().zip(&along).map(|(i, w)| w[*i]).product();
            *value += amount * weight;
            for (i, w) in index.iter_mut().zip(&along) {
                *i += 1;
                if *i < w.len() {
                    break;
                }
                *i = 0;
            }
        }
        simulation.write(gas, name, &values)?;
    }
    Ok(())
}

/// exp(-x²), zero where it is too small to be seen.
fn gaussian(x: f64) -> f64 {
    if x.abs() > 4.0 { 0.0 } else { exp(-x * x) }
}
