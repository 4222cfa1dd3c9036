//! Sheets that hang in the fluid: cloth, curves in the plane, and threads in space. They let fluid through, against a resistance.
//!
//!   p_before - p_behind = K rho/2 |w_n| w_n,   friction c rho/2 |w_t| w_t,   w = u - v                (gas.18)
//!
//! for each mass of the sheet with its share of the area; of a thread, w_n is what goes across it, and the area its length times its
//! diameter. An exchange is that of two bodies, the mass and the fluid in the cells around
//! it, that end a step with the w of the implicit law: it takes energy from them, whatever the step, and no momentum.
//!
//! Source: [taylor1944]. Limits: w of a step is at least w/(1 + K C/2) with the Courant number C of w, so that K above 2/C acts like
//! 2/C; what is smaller than two cells is felt as if it were that large; beside walls and colliders, what is taken from faces that are held
//! is lost.
//! Tests: crates/tumble-f64/tests/sheets.rs.

use crate::exchange::{BodyRow, Exchange, Turn};
use crate::geometry::Vector;
use crate::math::Real;
use crate::operators::Spot;
use crate::state::{Grid, Place, Vectors};

/// A sheet; in the plane a curve, of one metre across it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sheet {
    /// The object that it is.
    pub name: String,
    rows: Vec<BodyRow>,
    /// Over its masses, counted from its first.
    triangles: Vec<[u32; 3]>,
    /// Of a curve.
    pieces: Vec<[u32; 2]>,
    /// Diameter [m] of a curve in space; a curve in the plane is a metre wide.
    diameter: Option<f64>,
    /// Length of a piece beyond which it has broken, and is none [m].
    longest: f64,
    /// Loss of pressure over rho/2 w².
    resistance: f64,
    /// Over rho/2 w², of both faces together.
    friction: f64,
    masses: Vec<Mass>,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Mass {
    x: Vector,
    v: Vector,
    inverse: f64,
    /// Its share of the area [m²], along the normal; of a thread, along it.
    area: Vector,
    impulse: Vector,
}

impl Sheet {
    /// These masses under that name; the resistance and the friction.
    pub fn new(
        name: String,
        rows: Vec<BodyRow>,
        triangles: Vec<[u32; 3]>,
        (pieces, diameter, longest): (Vec<[u32; 2]>, Option<f64>, f64),
        [resistance, friction]: [f64; 2],
    ) -> Self {
        Self { name, rows, triangles, pieces, diameter, longest, resistance, friction, masses: Vec::new() }
    }

    /// Takes its state from its system.
    pub fn listen(&mut self, exchange: &Exchange) {
        self.masses.clear();
        let mass = |row: &BodyRow| {
            let state = exchange.state(*row);
            Mass { x: state.position, v: state.velocity, inverse: state.inverse_mass, ..Mass::default() }
        };
        self.masses.extend(self.rows.iter().map(mass));
    }

    /// Gives its system what the fluid has given it.
    pub fn tell(&mut self, exchange: &mut Turn<'_>) {
        for (row, mass) in self.rows.iter().zip(&self.masses) {
            exchange.post_steady(*row, mass.x, mass.impulse);
        }
    }

    fn share_areas(&mut self, flat: Option<usize>) {
        let masses = &mut self.masses;
        masses.iter_mut().for_each(|mass| mass.area = Vector::default());
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| masses[i as usize].x);
            let third = (b - a).cross(c - a) * (1.0 / 6.0);
            triangle.iter().for_each(|i| masses[*i as usize].area = masses[*i as usize].area + third);
        }
        if let Some(diameter) = self.diameter {
            for piece in &self.pieces {
                let [a, b] = piece.map(|i| masses[i as usize].x);
                if (b - a).norm() > self.longest {
                    continue;
                }
                let half = (b - a) * (0.5 * diameter);
                piece.iter().for_each(|i| masses[*i as usize].area = masses[*i as usize].area + half);
            }
            return;
        }
        let Some(flat) = flat else { return };
        let mut across = [0.0; 3];
        across[flat] = 0.5;
        for piece in &self.pieces {
            let [a, b] = piece.map(|i| masses[i as usize].x);
            if (b - a).norm() > self.longest {
                continue;
            }
            let half = (b - a).cross(across.into());
            piece.iter().for_each(|i| masses[*i as usize].area = masses[*i as usize].area + half);
        }
    }

    /// Exchanges momentum with a fluid of this density [kg/m³] for h seconds, mass by mass.                    (gas.18)
    pub fn trade(&mut self, u: &mut Vectors, grid: &Grid, density: f64, h: f64) {
        self.share_areas(grid.flat);
        let stride = grid.lattice().stride;
        let cell = (0..grid.dimension()).fold(density, |m, _| m * grid.dx);
        let wrapped = |x: Vector| {
            let mut x: [f64; 3] = x.into();
            for a in grid.axes().filter(|a| grid.periodic[*a]) {
                let length = grid.n[a] as f64 * grid.dx;
                x[a] -= length * ((x[a] - grid.origin[a]) / length).floor();
            }
            Vector::from(x)
        };
        let inside = |x: Vector| {
            let x: [f64; 3] = x.into();
            grid.axes().all(|a| (0.0..=grid.n[a] as f64 * grid.dx).contains(&(x[a] - grid.origin[a])))
        };
        let (resistance, friction, is_thread) = (self.resistance, self.friction, self.diameter.is_some());
        for mass in self.masses.iter_mut().filter(|mass| inside(wrapped(mass.x))) {
            let area = mass.area.norm();
            if area == 0.0 {
                continue;
            }
            let (n, mut w, mut sharpest) = (mass.area * (1.0 / area), <[f64; 3]>::from(-mass.v), 0.0_f64);
            if let Some(flat) = grid.flat {
                w[flat] = 0.0;
            }
            let spots: [Option<Spot>; 3] =
                std::array::from_fn(|a| (grid.flat != Some(a)).then(|| Spot::new(grid, Place::Face(a), wrapped(mass.x))));
            for part in &u.parts {
                let Place::Face(axis) = part.place else { continue };
                let Some(spot) = &spots[axis] else { continue };
                let mut squares = 0.0;
                spot.points(stride, |at, weight| {
                    w[axis] += f64::from(weight) * f64::from(part.data[at]);
                    squares += f64::from(weight * weight);
                });
                sharpest = sharpest.max(squares);
            }
            // One over each of the two masses.
            let both = mass.inverse + sharpest / cell;
            let w = Vector::from(w);
            let normal = n * n.dot(w);
            let (across, along) = if is_thread { (w - normal, normal) } else { (normal, w - normal) };
            let law = |factor: f64, w: Vector| {
                let force = 0.5 * density * factor * area * w.norm();
                w * (h * force / (1.0 + h * force * both))
            };
            let impulse = law(resistance, across) + law(friction, along);
            mass.impulse = mass.impulse + impulse;
            mass.v = mass.v + impulse * mass.inverse;
            let impulse: [f64; 3] = impulse.into();
            for part in &mut u.parts {
                let Place::Face(axis) = part.place else { continue };
                let lost = (impulse[axis] / cell) as Real;
                spots[axis].iter().for_each(|spot| spot.points(stride, |at, weight| part.data[at] -= weight * lost));
            }
        }
        self.masses.iter_mut().for_each(|mass| mass.x = mass.x + mass.v * h);
    }
}
