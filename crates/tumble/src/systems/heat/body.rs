//! A body that conducts heat: its cells, what it borders on, and its steps.

use super::pass::{Cells, Pass};
use crate::linalg::poisson::{Excess, Method, Params, Series, Side, Solver, Target};
use crate::math::parallel::{chunks, rows, sum};
use crate::math::{Column, Real, Signal};
use crate::state::{Field, Grid, GridError, Place};
use tumble_interface::engine::StepReport;
use tumble_interface::scene::HeatScheme;

/// Boundary condition of a surface.
#[derive(Debug, Clone)]
pub struct Boundary {
    /// Its name among the fluxes.
    pub name: String,
    /// Temperature of the surface, or of what flows along it [K].
    pub temperature: Option<Signal>,
    /// Heat that passes from what flows along it [W/(m² K)]; without it the surface is held at the temperature.
    pub coefficient: Option<f64>,
    /// Heat that comes in [W/m²].
    pub flux: Option<Signal>,
}

/// A material, or a hole.
#[derive(Debug, Clone, Copy)]
pub struct Material {
    /// Conductivity [W/(m K)].
    pub conductivity: f64,
    /// Density times heat capacity [J/(m³ K)].
    pub capacity: f64,
    /// Of a hole: the boundary that the surface around it is.
    pub hole: Option<usize>,
}

/// Heat that arises: `power` [W/m³] times a profile [1], a column of the lattice; without one it is the same everywhere.
#[derive(Debug, Clone)]
pub struct Source {
    /// Power of a volume [W/m³].
    pub power: Signal,
    /// Its factor in each cell.
    pub profile: Option<Vec<Real>>,
}

/// Everything about a body but its temperatures.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Name in the scene.
    pub name: String,
    /// Its cells.
    pub grid: Grid,
    /// How it is stepped.
    pub scheme: HeatScheme,
    /// Its materials, the first of which is the body's own.
    pub materials: Vec<Material>,
    /// The number of each cell's material, x fastest; empty if there is but one.
    pub material: Vec<u16>,
    /// Its boundary conditions.
    pub boundaries: Vec<Boundary>,
    /// The boundaries of its sides.
    pub sides: [[Option<usize>; 2]; 3],
    /// Heat that arises.
    pub sources: Vec<Source>,
    /// Residual at which the linear solver stops, relative to the first.
    pub tolerance: f64,
}

/// A cell's face to a boundary: net += g (T_boundary - T) + the boundary's flux.
#[derive(Debug, Clone, Copy)]
struct Link {
    /// The cell.
    at: u32,
    /// Number of the boundary.
    of: u32,
    /// Conductance [1].
    g: Real,
    /// Part of the flux outside that comes in [1].
    share: Real,
}

enum WeightedSolver {
    Bytes(Solver<u8>),
    Numbers(Solver<Real>),
}

/// A linear solver for steps of one length.
struct Implicit {
    h: f64,
    solver: WeightedSolver,
    /// phi c/(h k) of each cell, without boundaries: c' of (heat.6).
    inertia: Vec<Real>,
    /// Cells that no open face joins to another, with one over their diagonals.
    lonely: Vec<(u32, Real)>,
    /// Sum over cells of c', and over links of their conductances.
    sums: [f64; 2],
}

/// A body in motion.
pub struct HeatedBody {
    /// Its description.
    pub plan: Plan,
    /// Temperatures less `reference` [K].
    pub t: Field,
    /// A temperature close to all others [K]: what is kept is small, and so is its round-off.
    pub reference: f64,
    cells: Option<Cells>,
    links: Vec<Link>,
    /// Heat that has come in through each boundary, then from sources [J].
    pub come: Vec<f64>,
    /// Sum of profiles [1] over the cells of the body.
    profiles: Vec<f64>,
    /// Heat at the start [J].
    start: f64,
    /// The time of its temperatures [s].
    pub time: f64,
    next: Column,
    correction: Column,
    implicit: Option<Implicit>,
    series: Option<(f64, Series)>,
}

/// The harmonic mean: two halves of cells in a row.                                            (heat.4)
fn harmonic(a: f64, b: f64) -> f64 {
    2.0 * a * b / (a + b)
}

impl HeatedBody {
    /// A body with these temperatures [K] less the reference.
    pub fn new(plan: Plan, t: Field, reference: f64) -> Result<Self, GridError> {
        t.expect(&plan.grid, Place::Cell, "temperature of a body")?;
        let mut body = Self {
            cells: None,
            links: Vec::new(),
            come: vec![0.0; plan.boundaries.len() + 1],
            profiles: Vec::new(),
            start: 0.0,
            time: 0.0,
            next: t.data.clone(),
            correction: Column::new(),
            implicit: None,
            series: None,
            plan,
            t,
            reference,
        };
        body.join();
        body.profiles = body.plan.sources.iter().map(|source| body.total(|at| source.profile.as_ref().map_or(1.0, |p| p[at]))).collect();
        body.start = body.heat();
        Ok(body)
    }

    fn own(&self) -> Material {
        self.plan.materials.first().copied().unwrap_or(Material { conductivity: 1.0, capacity: 1.0, hole: None })
    }

    /// The material of a cell.
    fn material(&self, [i, j, k]: [usize; 3]) -> Material {
        let n = self.plan.grid.n;
        let number = self.plan.material.get(i + n[0] * (j + n[1] * k)).copied().unwrap_or(0);
        self.plan.materials.get(usize::from(number)).copied().unwrap_or_else(|| self.own())
    }

    /// Weights of faces and links to boundaries.
    fn join(&mut self) {
        let grid = self.plan.grid;
        let (l, own) = (grid.lattice(), self.own());
        if !self.plan.material.is_empty() {
            let mut cells = Cells { w: [(); 3].map(|()| vec![0.0; l.len()]), m: vec![0.0; l.len()] };
            for at in self.t.each() {
                let here = self.material(at);
                let number = l.at(at[0], at[1], at[2]);
                cells.m[number] = if here.hole.is_some() { 0.0 } else { (own.capacity / here.capacity) as Real };
                for axis in grid.axes() {
                    let last = at[axis] + 1 == grid.n[axis];
                    if here.hole.is_some() || (last && !(grid.periodic[axis] && grid.n[axis] > 1)) {
                        continue;
                    }
                    let mut next = at;
                    next[axis] = if last { 0 } else { at[axis] + 1 };
                    let there = self.material(next);
                    if there.hole.is_none() {
                        let w = (harmonic(here.conductivity, there.conductivity) / own.conductivity) as Real;
                        cells.w[axis][number + l.stride[axis]] = w;
                        if last {
                            cells.w[axis][l.at(next[0], next[1], next[2])] = w;
                        }
                    }
                }
            }
            self.cells = Some(cells);
        }
        let anything = !self.plan.boundaries.is_empty();
        let (dx, n) = (grid.dx, grid.n);
        let mut links = Vec::new();
        let holes = self.plan.materials.iter().any(|m| m.hole.is_some());
        let rows = (0..n[2]).flat_map(|k| (0..n[1]).map(move |j| [j, k]));
        for [j, k] in rows.filter(|_| anything) {
            // Without holes only cells at the sides border on anything.
            let edge = grid.axes().any(|a| a > 0 && ([0, j, k][a] == 0 || [0, j, k][a] + 1 == n[a]));
            let inner = if edge || holes { n[0] } else { 0 };
            let ends = [0, n[0] - 1];
            let some = if inner > 0 { &[][..] } else { &ends[..if n[0] > 1 { 2 } else { 1 }] };
            for i in (0..inner).chain(some.iter().copied()) {
                let at = [i, j, k];
                let here = self.material(at);
                if here.hole.is_some() {
                    continue;
                }
                for axis in grid.axes() {
                    for up in 0..2 {
                        let beyond = if up == 0 { at[axis] == 0 } else { at[axis] + 1 == n[axis] };
                        let of = if beyond && !grid.periodic[axis] {
                            self.plan.sides[axis][up]
                        } else {
                            let mut next = at;
                            next[axis] = (at[axis] + n[axis] + 2 * up - 1) % n[axis];
                            self.material(next).hole
                        };
                        let Some((of, boundary)) = of.and_then(|of| Some((of, self.plan.boundaries.get(of)?))) else { continue };
                        // From the middle of the cell to what is beyond: half a cell, then the film of a fluid.   (heat.5)
                        let half = 2.0 * here.conductivity / dx;
                        let (conductance, share) = match (&boundary.temperature, boundary.coefficient) {
                            (None, _) => (0.0, 1.0),
                            (Some(_), None) => (half, 0.0),
                            (Some(_), Some(film)) => (half * film / (half + film), half / (half + film)),
                        };
                        let g = (conductance * dx / own.conductivity) as Real;
                        links.push(Link { at: l.at(i, j, k) as u32, of: of as u32, g, share: share as Real });
                    }
                }
            }
        }
        self.links = links;
    }

    /// The sum of something over the cells of the body.
    fn total(&self, of: impl Fn(usize) -> Real + Sync) -> f64 {
        let (l, m) = (self.plan.grid.lattice(), self.cells.as_ref().map(|c| &c.m));
        let rows = l.n[1] * l.n[2];
        let row = |r: usize| {
            let at = l.at(0, r % l.n[1], r / l.n[1]);
            (at..at + l.n[0]).filter(|at| m.is_none_or(|m| m[*at] > 0.0)).map(|at| f64::from(of(at))).sum::<f64>()
        };
        sum(rows, |range| range.map(row).sum())
    }

    /// Volume of a cell [m³]; in a plane for a metre across it.
    fn volume(&self) -> f64 {
        self.plan.grid.dx.powi(self.plan.grid.dimension() as i32)
    }

    /// Heat above the reference [J].
    fn heat(&self) -> f64 {
        let (own, t) = (self.own().capacity, &self.t.data);
        let all = match &self.cells {
            None => self.total(|at| t[at]),
            Some(cells) => self.total(|at| t[at] / cells.m[at]),
        };
        all * own * self.volume()
    }

    /// Heat above that at the start [J].
    pub fn stored(&self) -> f64 {
        self.heat() - self.start
    }

    /// Diffusivity of its own material [m²/s].
    pub fn diffusivity(&self) -> f64 {
        self.own().conductivity / self.own().capacity
    }

    /// A bound of the fastest rate of decay [1/s]: the circles of Gershgorin.                            (heat.7)
    pub fn fastest(&self) -> f64 {
        let grid = self.plan.grid;
        let unit = self.diffusivity() / (grid.dx * grid.dx);
        let n = |a: &usize| grid.n[*a] > 1;
        let plain = 4.0 * grid.axes().filter(n).count() as f64;
        let l = grid.lattice();
        let row = |at: usize| match &self.cells {
            None => plain,
            Some(cells) => 2.0 * (0..3).map(|a| f64::from(cells.w[a][at]) + f64::from(cells.w[a][at + l.stride[a]])).sum::<f64>(),
        };
        let m = |at: usize| self.cells.as_ref().map_or(1.0, |c| f64::from(c.m[at]));
        let mut most = if self.cells.is_some() {
            let each = |r: usize| {
                let at = l.at(0, r % l.n[1], r / l.n[1]);
                (at..at + l.n[0]).map(|at| m(at) * row(at)).fold(0.0, f64::max)
            };
            crate::math::parallel::max(l.n[1] * l.n[2], |range| range.map(each).fold(0.0, f64::max)).max(0.0)
        } else {
            plain
        };
        // Faces of a cell to boundaries come on top of those inside.
        let mut i = 0;
        while i < self.links.len() {
            let at = self.links[i].at as usize;
            let (mut g, mut faces) = (0.0, 0.0);
            while i < self.links.len() && self.links[i].at as usize == at {
                (g, faces) = (g + f64::from(self.links[i].g), faces + 1.0);
                i += 1;
            }
            // Without materials the walls of the plain bound were counted as faces.
            let inside = if self.cells.is_some() { row(at) } else { plain - 2.0 * faces };
            most = most.max(m(at) * (inside + g));
        }
        most * unit
    }

    /// The longest explicit step that does not grow [s].                                                 (heat.7)
    pub fn limit(&self) -> f64 {
        let fastest = self.fastest();
        if self.plan.scheme != HeatScheme::Explicit || fastest == 0.0 { f64::INFINITY } else { 2.0 / fastest }
    }

    /// Temperature of each boundary less the reference [K], and its flux over a cell, in kelvin; means over times.
    fn beyond(&self, times: &[f64]) -> Vec<[f64; 2]> {
        let mean = |signal: &Signal| times.iter().map(|t| signal.value(*t)).sum::<f64>() / times.len() as f64;
        let unit = self.plan.grid.dx / self.own().conductivity;
        let each = |b: &Boundary| {
            let temperature = b.temperature.as_ref().map_or(0.0, |s| mean(s) - self.reference);
            [temperature, b.flux.as_ref().map_or(0.0, |s| mean(s) * unit)]
        };
        self.plan.boundaries.iter().map(each).collect()
    }

    /// Calls `each(cell, net)` for what comes in through each link at the temperatures `t`, and counts it: the net sums of heat.
    fn borders(&mut self, beyond: &[[f64; 2]], h: f64, t: impl Fn(usize) -> Real, mut each: impl FnMut(usize, Real)) {
        let joule = h * self.own().conductivity / (self.plan.grid.dx * self.plan.grid.dx) * self.volume();
        let held: Vec<[Real; 2]> = beyond.iter().map(|b| b.map(|b| b as Real)).collect();
        let mut come = vec![0.0; beyond.len()];
        for link in &self.links {
            let ([outside, flux], at) = (held[link.of as usize], link.at as usize);
            let net = link.g * (outside - t(at)) + link.share * flux;
            come[link.of as usize] += f64::from(net);
            each(at, net);
        }
        for (sum, come) in self.come.iter_mut().zip(come) {
            *sum += joule * come;
        }
    }

    /// Adds `factor` times what arises to a column, m times if `weighed`, and counts it.
    fn arise(&mut self, powers: &[f64], h: f64, factor: f64, weighed: bool, out: &mut [Real]) {
        let (l, volume) = (self.plan.grid.lattice(), self.volume());
        let m = self.cells.as_ref().map(|c| &c.m[..]);
        for ((source, power), profile) in self.plan.sources.iter().zip(powers).zip(&self.profiles) {
            if let Some(sum) = self.come.last_mut() {
                *sum += h * power * profile * volume;
            }
            let factor = (factor * power) as Real;
            let first = l.at(0, 0, 0);
            rows(&mut out[first..], l.stride[1], |r, row| {
                let (j, k) = (r % (l.n[1] + 2), r / (l.n[1] + 2));
                if j >= l.n[1] || k >= l.n[2] {
                    return;
                }
                let at = l.at(0, j, k);
                for (i, out) in row[..l.n[0]].iter_mut().enumerate() {
                    let m = m.map_or(1.0, |m| m[at + i]);
                    let weight = if weighed || m == 0.0 { m } else { 1.0 };
                    *out += factor * weight * source.profile.as_ref().map_or(1.0, |p| p[at + i]);
                }
            });
        }
    }

    fn powers(&self, times: &[f64]) -> Vec<f64> {
        let mean = |s: &Source| times.iter().map(|t| s.power.value(*t)).sum::<f64>() / times.len() as f64;
        self.plan.sources.iter().map(mean).collect()
    }

    fn pass(&self, z: Option<f64>, out: &mut [Real]) {
        let grid = self.plan.grid;
        let cells = self.cells.as_ref();
        Pass { lattice: grid.lattice(), periodic: grid.periodic, cells, t: &self.t.data, z: z.map(|z| z as Real) }.run(out);
    }

    /// One step from time t [s], of whatever length: `limit` is the caller's business.
    pub fn step(&mut self, t: f64, h: f64, report: &mut StepReport) {
        self.time = t + h;
        match self.plan.scheme {
            HeatScheme::Explicit => self.explicit(t, h),
            HeatScheme::Implicit => self.implicit(h, &[t + h], 1.0, report),
            HeatScheme::Trapezoid => self.implicit(h, &[t, t + h], 2.0, report),
            HeatScheme::Spectral => self.spectral(t, h),
        }
    }

    /// Forward Euler.                                                                                   (heat.3)
    fn explicit(&mut self, t: f64, h: f64) {
        let mut next = std::mem::take(&mut self.next);
        let dx = self.plan.grid.dx;
        let z = h * self.diffusivity() / (dx * dx);
        self.pass(Some(z), &mut next);
        let powers = self.powers(&[t]);
        self.arise(&powers, h, h / self.own().capacity, true, &mut next);
        if !self.links.is_empty() {
            let beyond = self.beyond(&[t]);
            let (old, cells) = (std::mem::take(&mut self.t.data), self.cells.take());
            self.borders(&beyond, h, |at| old[at], |at, net| next[at] += z as Real * cells.as_ref().map_or(1.0, |c| c.m[at]) * net);
            (self.t.data, self.cells) = (old, cells);
        }
        self.next = std::mem::replace(&mut self.t.data, next);
    }

    /// The solver for steps of this length.
    fn prepare(&mut self, h: f64, phi: f64) {
        if self.implicit.as_ref().is_some_and(|i| i.h == h) {
            return;
        }
        let grid = self.plan.grid;
        let l = grid.lattice();
        let unit = phi * grid.dx * grid.dx / (h * self.diffusivity());
        let m = |at: usize| self.cells.as_ref().map_or(1.0, |c| f64::from(c.m[at]));
        let mut inertia: Vec<Real> = vec![0.0; l.len()];
        for at in self.t.each() {
            let at = l.at(at[0], at[1], at[2]);
            // A hole stands still.
            inertia[at] = if m(at) > 0.0 { (unit / m(at)) as Real } else { 1.0 };
        }
        let mut extra = inertia.clone();
        let mut conductance = 0.0;
        for link in &self.links {
            extra[link.at as usize] += link.g;
            conductance += f64::from(link.g);
        }
        let side = |a: usize| if grid.periodic[a] { [Side::Periodic; 2] } else { [Side::Closed; 2] };
        let sides = [side(0), side(1), side(2)];
        let solver = match &self.cells {
            None => {
                let open = vec![127_u8; l.len()];
                Solver::new(l, sides, [&open[..]; 3], Some(&extra)).ok().map(WeightedSolver::Bytes)
            }
            Some(cells) => {
                Solver::new(l, sides, [&cells.w[0][..], &cells.w[1], &cells.w[2]], Some(&extra)).ok().map(WeightedSolver::Numbers)
            }
        };
        let faces = |at: usize| match &self.cells {
            None => (0..3).map(|a| if grid.n[a] > 1 { 2.0 } else { 0.0 }).sum::<Real>(),
            Some(cells) => (0..3).map(|a| cells.w[a][at] + cells.w[a][at + l.stride[a]]).sum::<Real>(),
        };
        let numbers = self.t.each().map(|at| l.at(at[0], at[1], at[2]));
        let lonely = numbers.filter(|at| m(*at) > 0.0 && faces(*at) == 0.0).map(|at| (at as u32, 1.0 / extra[at])).collect();
        let sums = [self.total(|at| inertia[at]), conductance];
        self.implicit = solver.map(|solver| Implicit { h, solver, inertia, lonely, sums });
    }

    /// Backward Euler for phi = 1, the trapezoid for phi = 2: (c' + L) d = phi R(T), T += d.              (heat.6)
    fn implicit(&mut self, h: f64, times: &[f64], phi: f64, report: &mut StepReport) {
        self.prepare(h, phi);
        let Some(mut work) = self.implicit.take() else { return };
        let mut right = std::mem::take(&mut self.next);
        let mut d = std::mem::take(&mut self.correction);
        d.reserve(right.len());
        self.pass(None, &mut right);
        let (powers, beyond) = (self.powers(times), self.beyond(times));
        let counted = self.come.clone();
        let of_volume = self.plan.grid.dx * self.plan.grid.dx / self.own().conductivity;
        self.arise(&powers, h, of_volume, false, &mut right);
        let arisen = self.come.last().copied().unwrap_or(0.0) - counted.last().copied().unwrap_or(0.0);
        let old = std::mem::take(&mut self.t.data);
        self.borders(&beyond, h, |at| old[at], |at, net| right[at] += net);
        chunks(&mut right, |_, right| right.iter_mut().for_each(|r| *r *= phi as Real));
        let params = Params {
            method: Method::MultigridGradients,
            target: Target::Relative(self.plan.tolerance),
            iterations: 200,
            excess: Excess::Remove,
        };
        let info = match &mut work.solver {
            WeightedSolver::Bytes(solver) => solver.solve(&right, &mut d, &params),
            WeightedSolver::Numbers(solver) => solver.solve(&right, &mut d, &params),
        };
        for (at, inverse) in &work.lonely {
            d[*at as usize] = right[*at as usize] * inverse;
        }
        match info {
            Ok(info) => {
                report.linear += info.iterations as u64;
                report.left(info.residual());
                report.unconverged += u64::from(!info.converged);
            }
            // Only numbers that are not finite are refused: the breakdown tells where they are.
            Err(_) => d.fill(Real::NAN),
        }
        // One number compensates the residual of the solver, so that heat is conserved: (heat.8).
        self.come = counted;
        if let Some(last) = self.come.last_mut() {
            *last += arisen;
        }
        let joule = h * self.own().conductivity / (self.plan.grid.dx * self.plan.grid.dx) * self.volume();
        let before: f64 = self.come.iter().sum::<f64>() - arisen;
        let part = (1.0 / phi) as Real;
        self.borders(&beyond, h, |at| old[at] + part * d[at], |_, _| {});
        let come = (self.come.iter().sum::<f64>() - before) / joule;
        let gained = self.total(|at| work.inertia[at] * d[at]) / phi;
        let shift = (come - gained) / ((work.sums[0] + work.sums[1]) / phi);
        let per_link = shift / phi * joule;
        for link in &self.links {
            self.come[link.of as usize] -= per_link * f64::from(link.g);
        }
        let cells = self.cells.as_ref();
        chunks(&mut d, |start, d| {
            for (at, (d, t)) in (start..).zip(d.iter_mut().zip(&old[start..])) {
                *d = if cells.is_none_or(|c| c.m[at] > 0.0) { *t + (*d + shift as Real) } else { *t };
            }
        });
        (self.t.data, self.correction, self.next) = (d, old, right);
        self.implicit = Some(work);
    }

    /// Cosine series.                                                                                   (heat.9)
    fn spectral(&mut self, t: f64, h: f64) {
        let grid = self.plan.grid;
        let z = h * self.diffusivity() / (grid.dx * grid.dx);
        if self.series.as_ref().is_none_or(|(of, _)| *of != z) {
            self.series = Series::new(grid.lattice(), z).ok().map(|series| (z, series));
        }
        let Some((of, series)) = self.series.take() else { return };
        series.decay(&mut self.t.data);
        if !self.plan.sources.is_empty() {
            let powers: Vec<f64> = self.plan.sources.iter().map(|s| s.power.integral(t, t + h) / h).collect();
            let mut gain = std::mem::take(&mut self.next);
            gain.fill(0.0);
            let of_volume = grid.dx * grid.dx / self.own().conductivity;
            self.arise(&powers, h, of_volume, false, &mut gain);
            series.gain(&mut gain);
            chunks(&mut self.t.data, |start, t| t.iter_mut().zip(&gain[start..]).for_each(|(t, gain)| *t += gain));
            self.next = gain;
        }
        self.series = Some((of, series));
    }

    /// Heat flux -k grad T at the middle of cells, along each axis [W/m²], x fastest; through walls what comes in.
    pub fn flux(&self, time: f64) -> Vec<Real> {
        let grid = self.plan.grid;
        let (l, axes) = (grid.lattice(), grid.axes().collect::<Vec<_>>());
        let mut out = vec![0.0; axes.len() * self.t.points().iter().product::<usize>()];
        let beyond = self.beyond(&[time]);
        let k = self.own().conductivity / grid.dx;
        // Flow through the links of each cell, low and high side of each axis.
        let mut number = 0;
        for at in self.t.each() {
            let here = l.at(at[0], at[1], at[2]);
            for axis in &axes {
                let mut through = [0.0; 2];
                for (up, through) in through.iter_mut().enumerate() {
                    let sign = if up == 0 { 1.0 } else { -1.0 };
                    let wall = if up == 0 { at[*axis] == 0 } else { at[*axis] + 1 == grid.n[*axis] };
                    let mut next = at;
                    next[*axis] = (at[*axis] + grid.n[*axis] + 2 * up - 1) % grid.n[*axis];
                    let closed = wall && !grid.periodic[*axis];
                    let hole = if closed { self.plan.sides[*axis][up] } else { self.material(next).hole };
                    if self.material(at).hole.is_some() {
                        continue;
                    }
                    *through = match hole.and_then(|of| Some((beyond.get(of)?, self.plan.boundaries.get(of)?))) {
                        Some(([outside, flux], boundary)) => {
                            let half = 2.0 * self.material(at).conductivity / grid.dx;
                            let t = f64::from(self.t.data[here]);
                            let flux = flux * k;
                            sign * match (&boundary.temperature, boundary.coefficient) {
                                (None, _) => flux,
                                (Some(_), None) => half * (outside - t),
                                (Some(_), Some(film)) => half * (film * (outside - t) + flux) / (half + film),
                            }
                        }
                        None if closed => 0.0,
                        None => {
                            let (a, b) = (self.material(at).conductivity, self.material(next).conductivity);
                            let there = f64::from(self.t.data[l.at(next[0], next[1], next[2])]);
                            sign * harmonic(a, b) / grid.dx * (there - f64::from(self.t.data[here]))
                        }
                    };
                }
                out[number] = (0.5 * (through[0] + through[1])) as Real;
                number += 1;
            }
        }
        out
    }
}
