//! Output of a fluid: columns, ledger, snapshots, failures.

use super::fluid::Fluid;
use crate::fluids::projection::around;
use crate::fluids::rows::{self, sum};
use crate::fluids::{Immersed, Solids};
use crate::linalg::poisson::Weight;
use crate::math::Real;
use crate::operators::{average, curl, divergence};
use crate::state::{Field, GridError, Place, Vectors};
use crate::system::{Archive, Part};
use tumble_interface::engine::{Ledger, Worst};
use tumble_interface::error::Breakdown;
use tumble_interface::{Column, StepError};

const FACES: [&str; 3] = ["velocity_x", "velocity_y", "velocity_z"];

impl Fluid {
    fn column(&self, name: &str, fields: &[Field]) -> Column {
        let points = fields.first().map_or([0; 3], Field::points);
        let lists: Vec<Vec<Real>> = fields.iter().map(Field::values).collect();
        let data: Vec<Real> = match &lists[..] {
            [one] => one.clone(),
            _ => (0..points.iter().product()).flat_map(|i| lists.iter().map(move |list| list[i])).collect(),
        };
        let points = self.grid().axes().map(|a| points[a]).collect();
        Column::on_grid(&self.name, name, points, data)
    }

    /// The named columns that it has.
    pub fn columns(&self, names: &[&str], out: &mut Vec<Column>) {
        // Only fields of another grid could fail here.
        out.extend(names.iter().filter_map(|name| self.named(name).ok().flatten()));
    }

    fn named(&self, name: &str) -> Result<Option<Column>, GridError> {
        let one = |field: &Field| Some(self.column(name, std::slice::from_ref(field)));
        Ok(match name {
            "density" => self.smoke.as_ref().and_then(one),
            "temperature" => self.temperature.as_ref().and_then(one),
            "fuel" => self.flame.as_ref().and_then(|flame| one(&flame.fuel)),
            "pressure" => one(&self.pressure),
            "velocity" => Some(self.column(name, &self.at_cells(&self.u)?)),
            "vorticity" => {
                let mut spin = Vectors::edges(self.grid(), "1/s")?;
                curl(&self.u, &mut spin)?;
                Some(self.column(name, &self.at_cells(&spin)?))
            }
            "divergence" => one(&self.divergence()?),
            _ => FACES.iter().position(|face| *face == name).and_then(|axis| one(self.u.part(axis)?)),
        })
    }

    /// Divergence of its velocity, around solids of what flows through open faces [1/s].
    fn divergence(&self) -> Result<Field, GridError> {
        let mut field = Field::new(self.grid(), Place::Cell, "1/s")?;
        if let Some(solids) = &self.solids {
            let scale = (-1.0 / (field.grid.dx * field.grid.dx)) as Real;
            around(&self.u, Some(solids), None, &mut field);
            field.data.iter_mut().for_each(|x| *x *= scale);
        } else {
            divergence(&self.u, &mut field)?;
        }
        Ok(field)
    }

    fn at_cells(&self, vectors: &Vectors) -> Result<Vec<Field>, GridError> {
        vectors.parts.iter().map(|part| average(part, Place::Cell)).collect()
    }

    /// The force of the last pressure on every solid.
    pub fn forces_on(&self) -> impl Iterator<Item = Column> {
        self.solids.iter().flat_map(|solids| solids.forces(|cell| f64::from(self.pressure.data[cell as usize])))
    }

    /// Its grid.
    pub fn topology(&self, out: &mut Vec<Column>) {
        out.extend(self.grid().columns(&self.name));
    }

    /// The volume of a cell [m³]; in the plane, of one metre across it.
    fn volume(&self) -> f64 {
        let grid = self.grid();
        (0..grid.dimension()).fold(1.0, |v, _| v * grid.dx)
    }

    /// Mass of smoke and fuel [kg].
    fn carried_mass(&self) -> f64 {
        let total = |f: &Field| sum(f, |at, n| f.data[at..at + n].iter().map(|x| f64::from(*x)).sum());
        let fuel = self.flame.iter().map(|flame| &flame.fuel);
        self.smoke.iter().chain(fuel).fold(0.0, |mass, c| mass + self.volume() * total(c))
    }

    /// Speed of the fastest cell [m/s].
    pub fn speed(&self) -> f64 {
        let Ok(cells) = self.at_cells(&self.u) else { return 0.0 };
        let Some(first) = cells.first() else { return 0.0 };
        let sq = |i: usize| cells.iter().map(|f| f64::from(f.data[i]) * f64::from(f.data[i])).sum::<f64>();
        rows::largest(first, |at, n| (at..at + n).map(sq).fold(0.0, rows::worse)).sqrt()
    }

    /// Mass of smoke and fuel; momentum, kinetic energy, speed and divergence of the fluid; the heat of one that burns. A face
    /// on a side of the box counts half, one that is open in part by its share.
    pub fn ledger(&self, t: f64) -> Ledger {
        let grid = self.grid();
        let mass = self.volume() * self.settings.density;
        let mut ledger = Ledger { time: t, mass: self.carried_mass(), ..Ledger::default() };
        if let Some(flame) = &self.flame {
            let capacity = mass * self.settings.specific_heat;
            let [start, came] = flame.heat;
            ledger.heat = Some(capacity * (self.excess() - start));
            ledger.heat_in = Some(capacity * came);
        }
        for (index, part) in self.u.parts.iter().enumerate() {
            let Place::Face(axis) = part.place else { continue };
            let light = self.densities.as_ref().and_then(|densities| densities.light.parts.get(index));
            let half = |along: usize| !grid.periodic[axis] && (along == 0 || along == grid.n[axis]);
            let lattice = grid.lattice();
            let share = |start: usize, i: usize| {
                let along = match axis {
                    0 => i,
                    1 => (start - lattice.at(0, 0, 0)) % lattice.stride[2] / lattice.stride[1],
                    _ => (start - lattice.at(0, 0, 0)) / lattice.stride[2],
                };
                let open = self.solids.as_ref().map_or(1.0, |solids| f64::from(solids.open[axis][start + i].value()));
                let heavy = light.map_or(open, |light| open / f64::from(light.data[start + i]));
                if half(along) { 0.5 * heavy } else { heavy }
            };
            let weighed = |power: i32| {
                sum(part, |at, n| {
                    let one = |(i, u): (usize, &Real)| {
                        let u = f64::from(*u);
                        share(at, i) * if power == 2 { u * u } else { u }
                    };
                    part.data[at..at + n].iter().enumerate().map(one).sum()
                })
            };
            ledger.momentum[axis] += mass * weighed(1);
            ledger.kinetic += 0.5 * mass * weighed(2);
        }
        ledger.speed = Some(self.speed());
        // Only fields of another grid could fail here.
        ledger.divergence = self.divergence().ok().map(|field| rows::magnitude(&field));
        ledger
    }

    /// The cells of the largest divergence and of the fastest flow.
    pub fn worst(&self) -> Vec<Worst> {
        let blame = |measure, field: &Field, of: &dyn Fn([usize; 3]) -> f64| {
            let cell = field.each().max_by(|a, b| of(*a).total_cmp(&of(*b)))?;
            Some(Worst {
                measure,
                value: of(cell),
                object: self.name.clone(),
                other: None,
                particles: Vec::new(),
                id: None,
                cell: Some(cell),
            })
        };
        let mut all = Vec::new();
        // Only fields of another grid could fail here.
        if let (Ok(divergence), Ok(velocity)) = (self.divergence(), self.at_cells(&self.u)) {
            all.extend(blame("divergence", &divergence, &|at| f64::from(divergence.value(at).abs())));
            let speed = |at: [usize; 3]| velocity.iter().map(|part| f64::from(part.value(at)).powi(2)).sum::<f64>().sqrt();
            all.extend(blame("speed", &divergence, &speed));
        }
        all
    }

    /// The first number that is not finite.
    pub fn broken(&self, system: &str, t: f64) -> Option<StepError> {
        let carried = [("density", &self.smoke), ("temperature", &self.temperature)];
        let fuel = self.flame.iter().map(|flame| ("fuel", &flame.fuel));
        let scalars = carried.into_iter().filter_map(|(name, c)| Some((name, c.as_ref()?))).chain(fuel);
        let all = self.u.parts.iter().map(|part| ("velocity", part)).chain(scalars);
        for (name, field) in all {
            // Adding up finds any of them; only then is it looked for.
            if sum(field, |at, n| field.data[at..at + n].iter().map(|x| f64::from(*x) * 0.0).sum()) == 0.0 {
                continue;
            }
            let cell = field.each().find(|at| !field.value(*at).is_finite())?;
            let [x, y, _] = field.points();
            return Some(StepError::NotFinite(Box::new(Breakdown {
                system: system.into(),
                object: self.name.clone(),
                column: name.into(),
                index: cell[0] + x * (cell[1] + y * cell[2]),
                id: None,
                cell: Some((cell, self.grid().point(field.place, cell))),
                time: t,
                integrator: String::new(),
                step: 0.0,
                stable_step: f64::INFINITY,
                energy_ratio: None,
                cause: None,
            })));
        }
        None
    }

    fn kept(&self) -> Vec<(&'static str, &Field)> {
        let mut all: Vec<(&'static str, &Field)> = self.u.parts.iter().map(|part| ("u", part)).collect();
        all.extend(self.smoke.iter().map(|f| ("smoke", f)));
        all.extend(self.temperature.iter().map(|f| ("temperature", f)));
        all.extend(self.flame.iter().map(|flame| ("fuel", &flame.fuel)));
        all.push(("pressure", &self.pressure));
        all
    }

    /// Writes everything that the next step depends on.
    pub fn save(&self, archive: &mut Archive) {
        self.kept().into_iter().for_each(|(name, field)| archive.push_field(name, field));
        if let Some(flame) = &self.flame {
            archive.push("burnt", Part::Numbers(flame.heat.to_vec()));
        }
        if let Some(solids) = self.solids.as_ref().filter(|solids| solids.moves()) {
            let bodies = solids.bodies.iter().flat_map(Immersed::numbers);
            archive.push("solids", Part::Numbers(std::iter::once(solids.time).chain(bodies).collect()));
        }
    }

    /// Reads it back.
    pub fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        let mut read = |name: &str, field: &mut Field| archive.field(name, field);
        self.u.parts.iter_mut().try_for_each(|part| read("u", part))?;
        self.smoke.iter_mut().try_for_each(|f| read("smoke", f))?;
        self.temperature.iter_mut().try_for_each(|f| read("temperature", f))?;
        self.flame.iter_mut().try_for_each(|flame| read("fuel", &mut flame.fuel))?;
        read("pressure", &mut self.pressure)?;
        if let Some(flame) = &mut self.flame {
            let [start, came] = archive.numbers("burnt")?[..] else { return None };
            flame.heat = [start, came];
        }
        self.weigh();
        if self.solids.as_ref().is_some_and(Solids::moves) {
            let numbers = archive.numbers("solids")?;
            let (time, bodies) = numbers.split_first()?;
            self.put(*time, bodies)?;
        }
        Some(())
    }

    /// Sets a column, in the order in which it leaves; `false` if there is none of that name and length.
    pub fn write(&mut self, column: &str, values: &[f64]) -> bool {
        let values: Vec<Real> = values.iter().map(|x| *x as Real).collect();
        let field = match column {
            "density" => self.smoke.as_mut(),
            "temperature" => self.temperature.as_mut(),
            "fuel" => self.flame.as_mut().map(|flame| &mut flame.fuel),
            _ => {
                let axis = FACES.iter().position(|face| *face == column);
                self.u.parts.iter_mut().find(|part| axis.is_some_and(|a| part.place == Place::Face(a)))
            }
        };
        let fits = field.is_some_and(|field| field.set(&values).is_ok());
        self.weigh();
        fits
    }
}
