//! What a system tells about itself: columns, topology, ledger, and whether it has broken down.

use super::Dynamics;
use super::laws::Acting;
use crate::elements::{Batch, Constraints, enclosed};
use crate::forces::Group;
use crate::geometry::Walls;
use crate::integrators::stability::limits;
use crate::math::parallel::{fold, max, sum};
use crate::math::simd::{Kernel, Width, dispatch};
use crate::math::{Quat, Real, Row, Vec3, ZERO, is_finite, xyz64};
use crate::state::Object;
use crate::system::System;
use std::ops::Range;
use tumble_interface::engine::{BLOW_UP, Ledger};
use tumble_interface::error::Breakdown;
use tumble_interface::scene::Integrator;
use tumble_interface::{Column, Data, StepError};

/// What the energy is measured against.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scale {
    /// Energy at the start [J].
    start: f64,
    /// Potential energy of external forces at the start [J].
    external: f64,
    /// Largest kinetic, elastic or external change of energy in any good frame [J].
    size: f64,
}

impl Scale {
    /// The scale of a system that starts with these books, which could gain `fall` [J] by falling through its own height.
    /// Energies up to `noise` [J] are no scale.
    pub fn new(books: &Ledger, fall: f64, noise: f64) -> Self {
        let mut scale = Self { start: books.energy(), external: books.external, size: fall };
        scale.widen(books.kinetic.max(books.elastic), noise);
        scale
    }

    /// Masses come with kinetic energy and potential energy in gravity [J], and are a scale from now on; or go, with a sign.
    pub fn count(&mut self, sign: f64, kinetic: f64, potential: f64) {
        self.start += sign * (kinetic + potential);
        self.external += sign * potential;
        self.size += (sign * (kinetic + potential.abs())).max(0.0);
    }

    /// Forgets a tenth.
    fn fade(&mut self) {
        self.size *= 0.9;
    }

    /// Is at least as large as another scale.
    pub fn keep(&mut self, other: Self) {
        self.size = self.size.max(other.size);
    }

    fn widen(&mut self, energy: f64, noise: f64) {
        if energy > noise {
            self.size = self.size.max(energy);
        }
    }

    pub fn numbers(self) -> [f64; 3] {
        [self.start, self.external, self.size]
    }

    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        match numbers {
            [start, external, size] => Some(Self { start: *start, external: *external, size: *size }),
            _ => None,
        }
    }

    /// Growth of the energy over its scale; `None` while there is no scale.
    fn growth(self, books: &Ledger) -> Option<f64> {
        (self.size > 0.0).then(|| (books.energy() - self.start) / self.size)
    }
}

/// What points add up to, in one pass.
#[derive(Default)]
pub(super) struct Sums {
    pub mass: f64,
    first_moment: Vec3<f64>,
    pub momentum: Vec3<f64>,
    pub angular: Vec3<f64>,
    pub kinetic: f64,
    pub speed_sq: f64,
}

/// Points summed side by side.
const LANES: usize = 8;

/// The sums over some points. Eight of each go side by side, whatever the width of the registers.
struct Summation<'a> {
    mass: &'a [Real],
    x: &'a [Row],
    v: &'a [Row],
}

impl Kernel for Summation<'_> {
    type Output = Sums;
    #[inline(always)]
    fn run<W: Width>(self, _: W) -> Sums {
        let mut lanes = [[0.0_f64; LANES]; 12];
        for ((mass, x), v) in self.mass.chunks(LANES).zip(self.x.chunks(LANES)).zip(self.v.chunks(LANES)) {
            let mut rows = [[0.0_f64; LANES]; 7];
            for j in 0..mass.len() {
                rows[0][j] = f64::from(mass[j]);
                for c in 0..3 {
                    rows[1 + c][j] = f64::from(x[j][c]);
                    rows[4 + c][j] = f64::from(v[j][c]);
                }
            }
            let [m, x, y, z, u, v, w] = rows;
            for j in 0..LANES {
                let (px, py, pz) = (m[j] * u[j], m[j] * v[j], m[j] * w[j]);
                let speed_sq = u[j] * u[j] + v[j] * v[j] + w[j] * w[j];
                lanes[0][j] += m[j];
                lanes[1][j] += m[j] * x[j];
                lanes[2][j] += m[j] * y[j];
                lanes[3][j] += m[j] * z[j];
                lanes[4][j] += px;
                lanes[5][j] += py;
                lanes[6][j] += pz;
                lanes[7][j] += y[j] * pz - z[j] * py;
                lanes[8][j] += z[j] * px - x[j] * pz;
                lanes[9][j] += x[j] * py - y[j] * px;
                lanes[10][j] += 0.5 * m[j] * speed_sq;
                lanes[11][j] = if speed_sq > lanes[11][j] { speed_sq } else { lanes[11][j] };
            }
        }
        let mut sums = Sums::default();
        for j in 0..LANES {
            sums.mass += lanes[0][j];
            sums.first_moment = sums.first_moment + Vec3 { x: lanes[1][j], y: lanes[2][j], z: lanes[3][j] };
            sums.momentum = sums.momentum + Vec3 { x: lanes[4][j], y: lanes[5][j], z: lanes[6][j] };
            sums.angular = sums.angular + Vec3 { x: lanes[7][j], y: lanes[8][j], z: lanes[9][j] };
            sums.kinetic += lanes[10][j];
            sums.speed_sq = sums.speed_sq.max(lanes[11][j]);
        }
        sums
    }
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        self.first_moment = self.first_moment + other.first_moment;
        self.momentum = self.momentum + other.momentum;
        self.angular = self.angular + other.angular;
        self.kinetic += other.kinetic;
        self.speed_sq = self.speed_sq.max(other.speed_sq);
    }
}

impl Dynamics {
    pub(super) fn write_columns(&self, names: &[&str], out: &mut Vec<Column>) {
        for (index, object) in self.objects.iter().enumerate() {
            let tear = self.tears.iter().find(|tear| tear.object() == index);
            for name in names {
                let data: Vec<Real> = match *name {
                    "position" => {
                        let mut x = numbers(&self.state.x[object.points.clone()], 3);
                        // Spare vertices are where the first one is, out of nobody's picture.
                        for i in tear.iter().flat_map(|tear| tear.idle()) {
                            x.copy_within(0..3, 3 * (i - object.points.start));
                        }
                        x
                    }
                    "velocity" => numbers(&self.state.v[object.points.clone()], 3),
                    "orientation" if !object.frames.is_empty() => numbers(&self.state.x[object.frames.clone()], 4),
                    "angular_velocity" if !object.frames.is_empty() => numbers(&self.state.v[object.frames.clone()], 3),
                    "link_strain" if !object.links.is_empty() => self.link_strain(object),
                    _ => continue,
                };
                out.push(object.column(name, data));
                if let (Some(tear), &"position") = (tear, name) {
                    let first = object.points.start as u32;
                    let triangles = tear.triangles().iter().flatten().map(|i| i - first).collect();
                    out.push(object.column("triangles", Data::U32(triangles)));
                }
            }
            if let Some(stream) = object.stream {
                self.pool.write(stream, &object.name, &self.laws.masses.mass, out);
            }
        }
    }

    /// What the elements of the links of an object say of them.
    fn of_links<T: Clone>(
        &self,
        object: &Object,
        of_constraints: impl Fn(&dyn Constraints) -> Vec<T>,
        of_batch: impl Fn(&dyn Batch) -> Vec<T>,
    ) -> Vec<T> {
        let of = |(batch, range): &(usize, std::ops::Range<usize>)| {
            let all = match self.constraints.get(*batch) {
                Some(constraints) => of_constraints(constraints.as_ref()),
                None => of_batch(self.laws.batches[*batch].as_ref()),
            };
            all[range.clone()].to_vec()
        };
        object.links.iter().flat_map(of).collect()
    }

    fn link_strain(&self, object: &Object) -> Vec<Real> {
        let x = &self.state.x;
        self.of_links(object, |c| c.link_strain(x), |b| b.link_strain(x))
    }

    /// The two points of each link, counted from the object's first.
    fn link_ends(&self, object: &Object) -> Vec<u32> {
        let ends = self.of_links(object, |c| c.link_ends(), |b| b.link_ends());
        ends.concat().into_iter().map(|row| row - object.points.start as u32).collect()
    }

    pub(super) fn write_topology(&self, out: &mut Vec<Column>) {
        for object in &self.objects {
            let mut add = |name: &str, data: Data| {
                if !data.is_empty() {
                    out.push(object.column(name, data));
                }
            };
            if let Some(stream) = object.stream {
                if !self.pool.emitter(stream).has_radii() {
                    add("radius", Data::F64(vec![object.radius]));
                }
                continue;
            }
            add("mass", Data::from(self.laws.masses.mass[object.points.clone()].to_vec()));
            let points = object.points.start..object.points.end - object.spare;
            let pinned = points.filter(|i| self.state.x[*i][3] == 0.0).map(|i| (i - object.points.start) as u32);
            add("pinned", Data::U32(pinned.collect()));
            add("triangles", Data::U32(object.triangles.concat()));
            add("texture", Data::F32(object.texture.concat()));
            add("links", Data::U32(self.link_ends(object)));
            add("curve", Data::U32(object.curve.clone()));
            if object.curve_points > 0 {
                add("curve_points", Data::U32(vec![object.curve_points]));
            }
            if object.radius > 0.0 {
                add("radius", Data::F64(vec![object.radius]));
            }
        }
    }

    /// Energy of the elastic batches, or of the others [J].
    fn between(&self, elastic: bool, t: f64) -> f64 {
        let x = &self.state.x;
        let constraints = if elastic { &self.constraints[..] } else { &[] };
        let walls = Walls { colliders: &self.laws.colliders, t };
        let forces = self.laws.batches.iter().filter(|b| b.is_elastic() == elastic).map(|b| b.energy(x));
        forces.chain(constraints.iter().map(|c| c.energy(x, walls))).sum()
    }

    /// What these points and frames add up to.
    pub(super) fn sums(&self, points: Range<usize>, frames: Range<usize>) -> Sums {
        let (x, v, masses) = (&self.state.x[points.clone()], &self.state.v[points.clone()], &self.laws.masses.mass[points.clone()]);
        let mut total = Sums::default();
        for part in fold(points.len(), |range| dispatch(Summation { mass: &masses[range.clone()], x: &x[range.clone()], v: &v[range] })) {
            total.add(&part);
        }
        for i in frames {
            let (inertia, turning) = (f64::from(self.laws.masses.mass[i]), xyz64(self.state.v[i]));
            total.angular = total.angular + Quat::from_row(self.state.x[i].map(f64::from)).turn(turning * inertia);
            total.kinetic += 0.5 * inertia * turning.norm_sq();
        }
        total
    }

    /// How deep a point is in each collider that it touches at time t [s]. What is held is where it was put, as the roots of hair are, and no
    /// solid moves it.
    pub(super) fn depths(&self, i: usize, t: f64) -> impl Iterator<Item = f64> {
        let (x, masses) = (&self.state.x, &self.laws.masses);
        let colliders = if masses.mass[i] > 0.0 && x[i][3] > 0.0 { &self.laws.colliders[..] } else { &[] };
        let p = xyz64(x[i]);
        colliders.iter().filter_map(move |c| c.touch(p, t)).map(|t| t.depth)
    }

    /// Volume inside the triangles of an object [m³].
    pub(super) fn volume_in(&self, object: &Object) -> f64 {
        enclosed(&object.triangles, |i| xyz64(self.state.x[object.points.start + i as usize]))
    }

    pub(super) fn books(&self, t: f64) -> Ledger {
        let (x, v, masses) = (&self.state.x, &self.state.v, &self.laws.masses);
        let n = masses.points;
        let total = self.sums(0..n, n..x.len());
        let strains = self.laws.batches.iter().map(|b| b.largest_strain(x)).chain(self.constraints.iter().map(|c| c.largest_strain(x)));
        let strain = strains.fold(f64::NEG_INFINITY, f64::max);
        let depths = |i: usize| self.depths(i, t);
        // Where all that can stretch has broken, nothing is stretched.
        let stretch = if strain > f64::NEG_INFINITY { Some(strain + 1.0) } else { (self.broken > 0).then_some(0.0) };
        let touching = !self.laws.colliders.is_empty();
        let closed = self.objects.iter().filter(|o| o.closed);
        Ledger {
            time: t,
            mass: total.mass,
            momentum: total.momentum.into(),
            angular_momentum: Some(total.angular.into()),
            kinetic: total.kinetic,
            elastic: self.between(true, t),
            external: self.between(false, t) + self.laws.external_energy(t, x, v) - Vec3::from(self.laws.gravity).dot(total.first_moment),
            stretch,
            penetration: touching.then(|| max(n, |range| range.flat_map(depths).fold(0.0, f64::max)).max(0.0)),
            intersections: self.layers.as_ref().or(self.judge.as_ref()).and_then(|layers| layers.intersections(x, t)),
            speed: Some(total.speed_sq.sqrt()),
            contacts: touching.then(|| sum(n, |range| range.filter(|i| depths(*i).next().is_some()).count() as f64) as u64),
            broken: Some(self.broken),
            volume: closed.clone().next().map(|_| closed.map(|o| self.volume_in(o)).sum()),
            ..Ledger::default()
        }
    }

    /// Takes the scale of the energy from the start: what moves and stretches, a fall by the system's own size, and
    /// gravitation.
    pub(super) fn set_scale(&mut self) {
        let n = self.laws.masses.points;
        let books = self.books(0.0);
        let far = |a: Vec3<f64>, b: Vec3<f64>| (a - b).norm();
        let first = self.state.x.first().map(|x| xyz64(*x)).unwrap_or_default();
        let size = max(n, |range| range.map(|i| far(xyz64(self.state.x[i]), first)).fold(0.0, f64::max)).max(0.0);
        let fall = books.mass * Vec3::from(self.laws.gravity).norm() * size;
        // What holds masses together is a scale, too, even if they start at rest.
        // So is what a driving force may bring them to.
        let driven: f64 = self.laws.batches.iter().filter_map(|b| b.drives()).sum();
        // What a moving solid hits leaves with at most twice its velocity.
        let reach = self.laws.colliders.iter().filter_map(|c| c.motion.as_ref()).map(|m| far(m.pivot, first)).fold(size, |a, b| a + b);
        let fastest = self.laws.colliders.iter().map(|c| c.fastest(reach)).fold(0.0, f64::max);
        let hit = 2.0 * books.mass * fastest * fastest;
        self.scale = Scale::new(&books, fall.max(self.between(false, 0.0).abs()).max(hit).max(driven), self.noise());
    }

    /// Energy [J] that a thing at rest may seem to hold: a thousand times what its links store because positions are rounded.
    fn noise(&self) -> f64 {
        let (x, grip) = (&self.state.x, &self.laws.grip);
        let rounding = |i: usize| f64::from(Real::EPSILON) * xyz64(x[i]).norm();
        1e3 * sum(grip.len(), |range| range.map(|i| f64::from(grip[i]) * rounding(i) * rounding(i)).sum())
    }

    /// Takes the scale of the energy from the books of a good frame. Energy that came from nowhere does not count, or a slow
    /// explosion would carry its scale along; where others push, nobody knows where energy came from.
    pub(super) fn rescale(&mut self, books: &Ledger) {
        let drives = self.laws.colliders.iter().any(|c| c.moves()) || self.laws.batches.iter().any(|b| b.drives().is_some());
        let driven = self.pushed || !self.held.is_empty() || drives || !self.laws.user.is_empty();
        let gain = if driven { 0.0 } else { (books.energy() - self.scale.start).max(0.0) };
        let external = (books.external - self.scale.external).abs();
        let energy = books.kinetic.max(books.elastic).max(external) - gain;
        if !self.pool.is_empty() {
            // What has left is no scale for what is there.
            self.scale.fade();
        }
        if energy > self.scale.size {
            self.scale.widen(energy, self.noise());
        }
    }

    /// The books at time t [s], or what has broken down.
    pub(super) fn checked_books(&self, t: f64) -> Result<Ledger, StepError> {
        let state = &self.state;
        let books = self.books(t);
        // One number that is not finite makes these sums so.
        let finite = books.kinetic.is_finite() && books.angular_momentum.iter().flatten().all(|l| l.is_finite());
        let bad = |rows: &[Row]| fold(rows.len(), |mut range| range.find(|i| !is_finite(rows[*i]))).into_iter().flatten().next();
        let columns = [("position", &state.x), ("velocity", &state.v)];
        let search = || columns.into_iter().find_map(|(column, rows)| Some((column, bad(rows)?, None)));
        let mut found = if finite { None } else { search() };
        if found.is_none() {
            // What a sweep leaves undone is no energy that anything will feel.
            let mut felt = books.clone();
            if self.integrator == Integrator::PositionBased {
                felt.elastic = 0.0;
            }
            let ratio = self.scale.growth(&felt).filter(|g| *g > BLOW_UP || g.is_nan());
            if let Some(ratio) = ratio {
                let fastest =
                    (0..self.laws.masses.points).max_by(|a, b| xyz64(state.v[*a]).norm_sq().total_cmp(&xyz64(state.v[*b]).norm_sq()));
                found = Some(("velocity", fastest.unwrap_or(0), Some(ratio)));
            }
        }
        let Some((column, i, energy_ratio)) = found else { return Ok(books) };
        let (object, index) = self.whose(i);
        let breakdown = Box::new(Breakdown {
            system: self.name().into(),
            object,
            column: column.into(),
            index,
            id: self.pool.id_of(i),
            cell: None,
            time: t,
            integrator: self.integrator.name().into(),
            step: 0.0,
            stable_step: if self.integrator == Integrator::PositionBased { f64::INFINITY } else { 0.0 },
            energy_ratio,
            cause: self.culprit(i),
        });
        Err(if energy_ratio.is_none() { StepError::NotFinite(breakdown) } else { StepError::Exploded(breakdown) })
    }

    /// The force that is not finite on a row as it was before the sub-step that broke it.
    fn culprit(&self, i: usize) -> Option<String> {
        let (t, x, v) = self.witness.as_ref()?;
        let (x, v) = (x.get(i..=i)?, v.get(i..=i)?);
        let is_bad = |acting: &&Acting| {
            let mut force = [ZERO];
            acting.law.add(*t, Group::new(&self.laws.masses, i, x, v), &mut force);
            acting.ranges.iter().any(|range| range.contains(&i)) && !is_finite(force[0])
        };
        let name = &self.laws.forces.iter().find(is_bad)?.name;
        Some(format!("{name} gives no finite number at {:?} m", <[f64; 3]>::from(xyz64(x[0]))))
    }

    /// Object and index within it of a row.
    pub(super) fn whose(&self, i: usize) -> (String, usize) {
        let owner = |o: &&crate::state::Object| o.points.contains(&i) || o.frames.contains(&i);
        self.objects
            .iter()
            .find(owner)
            .map_or((String::new(), i), |o| (o.name.clone(), if o.points.contains(&i) { i - o.points.start } else { i - o.frames.start }))
    }

    /// The pre-flight estimate.
    pub(super) fn estimate(&mut self, dt: f64, go_on: &(dyn Fn() -> bool + Sync)) -> Option<tumble_interface::engine::Stability> {
        if self.integrator == Integrator::PositionBased {
            // No estimate is known.
            return None;
        }
        let modes = self.modes(go_on)?;
        let list = modes.list();
        let fixed = Integrator::ALL.into_iter().filter(|i| !i.is_adaptive());
        let limits = fixed
            .map(|integrator| {
                let (stable, usable) = limits(integrator, &list);
                tumble_interface::engine::Limit { integrator, stable, usable }
            })
            .collect();
        // Looking changes no state.
        let kept = (self.automatic, self.measured);
        let substeps = self.substeps(dt, go_on);
        (self.automatic, self.measured) = kept;
        Some(tumble_interface::engine::Stability {
            system: self.name.clone(),
            integrator: self.integrator,
            step: dt / substeps,
            frequency: modes.stiffest.frequency,
            damping: modes.stiffest.damping,
            damping_max: modes.most_damped.damping,
            culprit: modes.culprit.map(|i| self.whose(i)),
            limits,
        })
    }
}

fn numbers(rows: &[Row], width: usize) -> Vec<Real> {
    rows.iter().flat_map(|r| r[..width].iter().copied()).collect()
}
