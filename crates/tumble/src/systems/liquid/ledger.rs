//! Output of a liquid: columns, ledger, snapshots, failures.

use super::level::cell;
use super::stencil::Sampler;
use super::tank::Tank;
use crate::fluids::{Immersed, Solids};
use crate::math::Real;
use crate::math::parallel::fold;
use crate::operators::average;
use crate::state::Place;
use crate::system::{Archive, Part};
use tumble_interface::engine::{Ledger, Worst};
use tumble_interface::error::Breakdown;
use tumble_interface::{Column, StepError};

/// Colours of particles at rest, and of the fastest.
const DARK: Three = [0.01, 0.07, 0.25];
const LIGHT: Three = [0.85, 0.93, 1.0];

/// Three numbers of a vector.
type Three = [f64; 3];

fn cross(a: Three, b: Three) -> Three {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn wide(v: &[Real; 3]) -> Three {
    v.map(f64::from)
}

impl Tank {
    /// The place of a particle [m].
    fn place(&self, x: &[Real; 3]) -> Three {
        let grid = self.grid();
        std::array::from_fn(|a| grid.origin[a] + if grid.flat == Some(a) { 0.0 } else { grid.dx * f64::from(x[a]) })
    }

    /// Radius of a particle in pictures [m].
    pub fn radius(&self) -> f64 {
        let edge = self.settings.particle.powf(1.0 / self.grid().dimension() as f64);
        0.5 * edge * self.grid().dx
    }

    /// The named columns that it has, by the numbers of its particles.
    pub fn columns(&self, names: &[&str], out: &mut Vec<Column>) {
        let varies = self.openings.any();
        let known = ["position", "velocity", "pressure"];
        if !varies && !names.iter().any(|name| known.contains(name)) {
            return;
        }
        let rows = self.particles.rows();
        if varies {
            let ids: Vec<u32> = rows.iter().map(|row| self.particles.id[*row as usize]).collect();
            out.push(Column::new(&self.name, "id", ids));
        }
        let each = |of: &dyn Fn(usize) -> Three| rows.iter().flat_map(|row| of(*row as usize)).map(|c| c as Real).collect::<Vec<_>>();
        let particles = &self.particles;
        if let Some(full) = self.settings.shade.filter(|_| names.contains(&"position")) {
            let shade = |v: &[Real; 3]| {
                let speed = wide(v).iter().map(|v| v * v).sum::<f64>().sqrt();
                let part = if full > 0.0 { (speed / full).min(1.0) } else { 0.0 };
                std::array::from_fn(|c| DARK[c] + part * (LIGHT[c] - DARK[c]))
            };
            out.push(Column::new(&self.name, "color", each(&|row| shade(&particles.v[row]))));
        }
        for name in names {
            let data = match *name {
                "position" => each(&|row| self.place(&particles.x[row])),
                "velocity" => each(&|row| wide(&particles.v[row])),
                "pressure" => {
                    let pressure = Sampler::one(&self.pressure);
                    rows.iter().map(|row| self.pressure_at(&pressure, &particles.x[*row as usize])).collect()
                }
                _ => continue,
            };
            out.push(Column::new(&self.name, name, data));
        }
    }

    /// Columns of its surface, an object of its own.
    pub fn skin_columns(&self, names: &[&str], out: &mut Vec<Column>) {
        if !self.settings.surface || !names.contains(&"position") {
            return;
        }
        let (skin, name) = (self.skin(), format!("{}.surface", self.name));
        let rows = |of: &[[f64; 3]]| of.as_flattened().iter().map(|c| *c as Real).collect::<Vec<_>>();
        out.push(Column::new(&name, "position", rows(&skin.vertices)));
        // Vertices have no successors in the next frame that would say how they move.
        out.push(Column::new(&name, "velocity", rows(&skin.velocities)));
        out.push(Column::new(&name, "triangles", skin.triangles.concat()));
    }

    /// The pressure at a place [Pa]: in the half of a cell before a side it goes on as before.
    fn pressure_at(&self, pressure: &Sampler<'_>, x: &[Real; 3]) -> Real {
        const BESIDE: Real = 0.501;
        let n = self.grid().n;
        let near = std::array::from_fn(|a| if n[a] > 1 { x[a].max(BESIDE).min(n[a] as Real - BESIDE) } else { x[a] });
        let (value, slope) = pressure.with_gradient(&near);
        (0..3).fold(value[0], |p, a| p + slope[0][a] * (x[a] - near[a]))
    }

    /// The force of the pressure on every solid.
    pub fn forces_on(&self) -> impl Iterator<Item = Column> {
        let wet = |at: u32| self.level.cells[at as usize] == cell::LIQUID;
        let on = move |solids: &Solids, at: u32| {
            if wet(at) { f64::from(self.pressure.data[at as usize]) + solids.rise(&self.pressure, at, &wet) } else { 0.0 }
        };
        self.solids.iter().flat_map(move |solids| solids.forces(move |at| on(solids, at)))
    }

    /// Columns of its cells, an object of their own: distance from the surface, and velocity.
    pub fn cell_columns(&self, names: &[&str], out: &mut Vec<Column>) {
        if !names.contains(&"distance") {
            return;
        }
        let (grid, name) = (self.grid(), format!("{}.cells", self.name));
        let points: Vec<usize> = grid.axes().map(|a| grid.n[a]).collect();
        let distance = self.level.distance.values().into_iter().map(|phi| phi * grid.dx as Real).collect::<Vec<Real>>();
        out.push(Column::on_grid(&name, "distance", points.clone(), distance));
        if names.contains(&"velocity") {
            // Only a field of another grid could fail.
            let u = self.face_velocities();
            let means = u.parts.iter().map(|part| average(part, Place::Cell).map(|mean| mean.values()));
            let Ok(means) = means.collect::<Result<Vec<_>, _>>() else { return };
            let rows = (0..points.iter().product()).flat_map(|i| means.iter().map(move |mean| mean[i]));
            out.push(Column::on_grid(&name, "velocity", points, rows.collect::<Vec<Real>>()));
        }
    }

    /// Columns of its spray, foam and bubbles, objects of their own.
    pub fn whitewater_columns(&self, names: &[&str], out: &mut Vec<Column>) {
        if let Some(whitewater) = &self.whitewater {
            whitewater.columns(&self.name, |x| self.place(x), names, out);
        }
    }

    /// What does not change.
    pub fn topology(&self, out: &mut Vec<Column>) {
        if let Some(whitewater) = &self.whitewater {
            whitewater.topology(&self.name, self.grid().dx, out);
        }
        out.extend(self.grid().columns(&format!("{}.cells", self.name)));
        out.push(Column::new(&self.name, "radius", vec![self.radius()]));
        if !self.openings.any() {
            out.push(Column::new(&self.name, "mass", vec![self.particle_mass() as Real; self.particles.count()]));
        }
    }

    /// Sums over its particles, and the volume by its surface.
    pub fn ledger(&self, t: f64) -> Ledger {
        let (particles, gravity) = (&self.particles, self.settings.gravity.at(t));
        let parts = fold(particles.count(), |range| {
            let (mut sums, mut fastest) = ([0.0; 8], 0.0_f64);
            for i in range {
                let (x, v) = (self.place(&particles.x[i]), wide(&particles.v[i]));
                let spin = cross(x, v);
                let square: f64 = v.iter().map(|v| v * v).sum();
                let fall: f64 = x.iter().zip(gravity).map(|(x, g)| x * g).sum();
                let all = [v[0], v[1], v[2], spin[0], spin[1], spin[2], 0.5 * square, -fall];
                sums.iter_mut().zip(all).for_each(|(sum, one)| *sum += one);
                fastest = if square > fastest || square.is_nan() { square } else { fastest };
            }
            (sums, fastest)
        });
        let mass = self.particle_mass();
        let mut sums = [0.0; 8];
        let mut fastest = 0.0_f64;
        for (part, most) in parts {
            sums.iter_mut().zip(part).for_each(|(sum, part)| *sum += mass * part);
            fastest = if most > fastest || most.is_nan() { most } else { fastest };
        }
        let [px, py, pz, lx, ly, lz, kinetic, external] = sums;
        Ledger {
            time: t,
            mass: mass * particles.count() as f64,
            momentum: [px, py, pz],
            angular_momentum: Some([lx, ly, lz]),
            kinetic,
            external,
            speed: Some(fastest.sqrt()),
            volume: Some(self.volume()),
            ..Ledger::default()
        }
    }

    /// The fastest particle.
    pub fn worst(&self) -> Option<Worst> {
        let speeds = self.particles.v.iter().map(|v| wide(v).iter().map(|v| v * v).sum::<f64>()).zip(&self.particles.id);
        let (square, id) = speeds.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(a.1)))?;
        let (measure, value, object) = ("speed", square.sqrt(), self.name.clone());
        Some(Worst { measure, value, object, other: None, particles: vec![*id as usize], id: None, cell: None })
    }

    /// The first number that is not finite.
    pub fn broken(&self, system: &str, t: f64) -> Option<StepError> {
        let particles = &self.particles;
        let (column, row) = [("position", &particles.x), ("velocity", &particles.v)]
            .into_iter()
            .find_map(|(name, of)| Some((name, of.iter().position(|row| !row.iter().all(|c| c.is_finite()))?)))?;
        Some(StepError::NotFinite(Box::new(Breakdown {
            system: system.into(),
            object: self.name.clone(),
            column: column.into(),
            index: particles.id[row] as usize,
            id: None,
            cell: None,
            time: t,
            integrator: "liquid".into(),
            step: self.last,
            stable_step: f64::INFINITY,
            energy_ratio: None,
            cause: None,
        })))
    }

    /// Writes everything that the next step depends on.
    pub fn save(&self, archive: &mut Archive) {
        let particles = &self.particles;
        archive.push_indices("numbers", &particles.id);
        let mut table = |name: &str, width: usize, numbers: &[Real]| archive.push(name, Part::Table(width, numbers.to_vec()));
        table("places", 3, particles.x.as_flattened());
        table("velocities", 3, particles.v.as_flattened());
        table("gradients", 9, particles.gradient.as_flattened().as_flattened());
        archive.push_field("pressure", &self.pressure);
        let time = self.solids.as_ref().map_or(0.0, |solids| solids.time);
        archive.push("step", Part::Numbers(vec![self.last, time]));
        archive.push("openings", Part::Numbers(self.openings.numbers()));
        let bodies = self.solids.as_ref().map_or(&[][..], |solids| &solids.bodies);
        archive.push("bodies", Part::Numbers(bodies.iter().flat_map(Immersed::numbers).collect()));
        self.whitewater.iter().for_each(|whitewater| whitewater.save(archive));
    }

    /// Reads it back.
    pub fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        fn rows<const N: usize>(numbers: &[Real]) -> Vec<[Real; N]> {
            numbers.as_chunks().0.to_vec()
        }
        let id = archive.indices("numbers")?;
        let [x, v, gradient] = [(3, "places"), (3, "velocities"), (9, "gradients")].map(|(width, name)| archive.table_of(width, name));
        let (x, v, gradient) = (x?, v?, gradient?);
        let n = id.len();
        let affine = if self.particles.is_affine() { 9 * n } else { 0 };
        let fits = self.openings.any() || n == self.particles.count();
        (fits && x.len() == 3 * n && v.len() == 3 * n && gradient.len() == affine).then_some(())?;
        self.particles.put(
            id,
            rows(&x),
            rows(&v),
            gradient.as_chunks::<9>().0.iter().map(|g| [0, 1, 2].map(|a| [0, 1, 2].map(|b| g[3 * a + b]))).collect(),
        );
        archive.field("pressure", &mut self.pressure)?;
        let [last, time] = archive.numbers("step")?[..] else { return None };
        self.last = last;
        self.openings.put(&archive.numbers("openings")?)?;
        let numbers = archive.numbers("bodies")?;
        let bodies = self.bodies();
        (numbers.len() == Immersed::NUMBERS * bodies.len()).then_some(())?;
        bodies.iter_mut().zip(numbers.chunks_exact(Immersed::NUMBERS)).for_each(|(body, numbers)| body.put(numbers));
        self.whitewater.iter_mut().try_for_each(|whitewater| whitewater.restore(archive))?;
        if let Some(solids) = self.solids.as_mut().filter(|solids| solids.moves()) {
            solids.time = f64::NAN;
            self.put(time);
        }
        self.prepare();
        Some(())
    }

    /// Sets a column, by the numbers of the particles; `false` if there is none of that name and length. Places are kept in the box and out of solids.
    pub fn write(&mut self, column: &str, values: &[f64]) -> bool {
        let (grid, rows) = (self.grid(), self.particles.rows());
        if values.len() != 3 * rows.len() || !matches!(column, "position" | "velocity") {
            return false;
        }
        for (row, value) in rows.iter().zip(values.chunks_exact(3)) {
            for a in grid.axes() {
                if column == "velocity" {
                    self.particles.v[*row as usize][a] = value[a] as Real;
                } else {
                    self.particles.x[*row as usize][a] = ((value[a] - grid.origin[a]) / grid.dx).clamp(0.0, grid.n[a] as f64) as Real;
                }
            }
        }
        if column == "velocity" {
            self.particles.gradient.iter_mut().for_each(|gradient| *gradient = Default::default());
        } else {
            self.push_out();
            self.prepare();
        }
        true
    }
}
