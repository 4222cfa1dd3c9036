//! From the parts that recipes collect to a system.

mod between;
mod contact;
mod elements;
mod objects;
mod tears;

use super::Dynamics;
use super::core::{Between, Clamp, Core};
use super::features::Features;
use super::followers::Followers;
use super::fracture::Fracture;
use super::hair_continuum::HairContinuum;
use super::holds::{Hold, Holds};
use super::laws::{Acting, Laws};
use super::liquid_loads::LiquidLoads;
use super::parts::{On, Parts};
use super::scale::Scale;
use super::scheme::{self, Forces, Projected, Scheme};
use super::settings::Settings;
use crate::elements::{LongRangeAttachments, Members};
use crate::forces::{Sails, Sheets, Threads};
use crate::geometry::{Carrier, Collider};
use crate::integrators::Memory;
use crate::math::Real;
use crate::pool::Pool;
use crate::state::{Frames, Masses, Object, State};
use between::between;
use elements::Batches;
use objects::Objects;
use std::sync::Arc;
use tears::Tied;
use tumble_interface::SceneError;

impl Parts {
    /// The system.
    pub fn build(mut self, settings: Settings) -> Result<Dynamics, SceneError> {
        self.check_range()?;
        let ghosts = self.place_ghosts();
        scheme::check(&self, &settings)?;
        if self.tearing_surface().is_some() {
            self.halve_links();
        }
        self.count_rows(&settings.colliders);
        let lost = || SceneError::one(format!("system \"{}\"", settings.name), "an element refers to a mass that is not there");
        let projects = scheme::projects(&settings);
        let (mut state, mut masses) = self.state();
        masses.ghosts = ghosts;
        let (points, rows) = (masses.frames.start, masses.mass.len());
        let holds = Holds::new(std::mem::take(&mut self.holds));
        let mut batches = Batches::new(&masses, projects);
        // As if they were held for ever: constraints are told when they are not.
        batches.hold(|row| holds.contain(row));
        let clamp = settings.clamp.and_then(|ratio| self.clamp(ratio, rows));
        let lists = batches.fill(&mut self).map_err(|_| lost())?;
        let scheme = self.scheme(&settings, &state, &holds);
        let objects = Objects::new(std::mem::take(&mut self.objects), self.counts(), lists.springs, points);
        let sewn: Vec<[u32; 2]> = self.vector.members.iter().map(|m| m.nodes).collect();
        let (self_contact, intersection_counter) = contact::surfaces(&settings, &objects.list, &sewn, &state)?;
        let between = self.between(&objects, &masses, &settings, &mut batches);
        let sails = self.sails(&objects, &state, &masses, &mut batches).ok_or_else(lost)?;
        let tied = Tied { parts: &self, lists, projects, clamped: clamp.is_some(), sails: &sails };
        let tears = tied.tears(&objects, &masses.mass, &state.x[..points]);
        let grip = batches.grip(&state.x);
        // From here on: contact and tears know what is held for ever.
        holds.apply(&mut state, &mut masses);
        let hair = |(draft, words)| HairContinuum::new(objects.points_of(draft), words, &state.x);
        let mut features = Features {
            hair: self.hair.drain(..).map(hair).collect(),
            followers: Followers::new(self.followers, self.carried, &settings.colliders),
            holds,
            self_contact,
            fracture: Fracture::new(tears),
            liquid_loads: LiquidLoads::default(),
            intersection_counter,
        };
        let forces = self.forces.into_iter().map(|(name, law, on)| match on {
            On::Objects(on) => {
                let on = objects.placed(&on);
                Acting { name, law, ranges: objects.rows(&on), objects: on }
            }
            On::Points(points) => {
                let runs = points.chunk_by(|a, b| a + 1 == *b);
                Acting { name, law, ranges: runs.map(|run| run[0] as usize..run[0] as usize + run.len()).collect(), objects: Vec::new() }
            }
        });
        let laws = Laws {
            grip,
            batches: batches.list,
            forces: forces.collect(),
            gravity: settings.gravity.clone(),
            masses,
            colliders: settings.colliders.clone(),
            ..Default::default()
        };
        let mut core = Core {
            name: settings.name.clone(),
            integrator: settings.integrator,
            state,
            laws,
            constraints: batches.constraints,
            clamp,
            objects: objects.list,
            pool: Pool::new(rows, self.emitters),
            between,
            memory: Memory::new(settings.integrator, rows),
            before: Vec::new(),
            before_v: Vec::new(),
            visits: false,
            pushes: Vec::new(),
            scale: Scale::default(),
            broken: 0,
            regrouped: 0,
        };
        features.holds.tell(&mut core);
        features.liquid_loads.clear(&core);
        Dynamics::new(core, scheme, features, &settings)
    }

    /// Counts the frames of elements and followers from the first row of all, as the system does; leaves out followers of solids at rest.
    fn count_rows(&mut self, colliders: &[Collider]) {
        let points = self.points.len();
        self.carried.retain(|held| colliders.get(held.collider).is_some_and(|c| held.carrier != Carrier::Whole || c.motion.is_some()));
        self.carried.iter_mut().filter_map(|held| held.frame.as_mut()).for_each(|(frame, _)| *frame += points);
        let rows = |hold: Hold| Hold { row: points + hold.row, segment: hold.segment.map(|(frame, turn)| (points + frame, turn)), ..hold };
        self.holds.extend(self.frame_holds.drain(..).map(rows));
        for nodes in self.stretches.iter_mut().map(|m| &mut m.nodes) {
            nodes[2] += points as u32;
        }
        for node in self.bends.iter_mut().flat_map(|m| &mut m.nodes) {
            *node += points as u32;
        }
    }

    /// Rows of points and frames, and their masses.
    fn state(&self) -> (State, Masses) {
        let points = self.points.len();
        let (mut state, mut masses) =
            (State::default(), Masses { frames: Frames { start: points, end: points + self.frames.len() }, ..Masses::default() });
        for (x, v, mass, pinned) in &self.points {
            let w = if *pinned || *mass == 0.0 { 0.0 } else { 1.0 / mass };
            state.x.push([x.x as Real, x.y as Real, x.z as Real, w as Real]);
            state.v.push(if *pinned { [0.0; 4] } else { [v.x as Real, v.y as Real, v.z as Real, 0.0] });
            masses.mass.push(*mass as Real);
        }
        for (q, inertia, pinned) in &self.frames {
            state.x.push(q.map(|q| q as Real));
            state.v.push([0.0; 4]);
            masses.mass.push(*inertia as Real);
            masses.inverse_inertia.push(if *pinned { 0.0 } else { (1.0 / inertia) as Real });
        }
        if !self.charges.is_empty() || self.emitters.iter().any(|e| e.words().charge != 0.0) {
            masses.charge = vec![0.0; points + self.frames.len()];
            for (i, charge) in &self.charges {
                masses.charge[*i as usize] = *charge as Real;
            }
        }
        (state, masses)
    }

    /// Limits springs to `ratio` times their rest length; `None` if one is not between rows.
    fn clamp(&self, ratio: f64, rows: usize) -> Option<Clamp> {
        let short = |m: &Members<2, 1, 0>| Members { rest: [m.rest[0] * ratio], stiffness: f64::INFINITY, damping: 0.0, ..*m };
        let linear = self.linear.members.iter().map(short);
        let others = self.nonlinear.members.iter();
        let others = others.map(|m| short(&Members { nodes: m.nodes, rest: m.rest, law: [], stiffness: 0.0, damping: 0.0 }));
        Clamp::new(rows, rows, &[], &linear.chain(others).collect::<Vec<_>>(), &[])
    }

    /// The scheme of the settings.
    fn scheme(&self, settings: &Settings, state: &State, holds: &Holds) -> Box<dyn Scheme> {
        if !scheme::projects(settings) {
            return Box::new(Forces::new(settings));
        }
        let attachments: Vec<LongRangeAttachments> = settings
            .sweeps
            .tethers
            .map_or_else(Vec::new, |slack| self.attachments(slack, |row| state.x[row][3] == 0.0 && !holds.contain(row)));
        Box::new(Projected::new(settings, attachments))
    }

    /// Adds the forces between masses.
    fn between(&mut self, objects: &Objects, masses: &Masses, settings: &Settings, batches: &mut Batches) -> Vec<Between> {
        let mut added = Vec::new();
        for (words, on, others) in std::mem::take(&mut self.between) {
            let (on, others) = (objects.placed(&on), others.map(|others| objects.placed(&others)));
            for batch in between(words, objects.rows(&on), others.as_deref().map(|o| objects.rows(o)), masses, &self.halos, settings) {
                added.push(Between { batch: batches.list.len(), objects: on.clone(), others: others.clone() });
                batches.list.push(batch);
            }
        }
        added
    }

    /// Adds the air around surfaces and threads, and returns each batch of surfaces with its objects; `None` if an element has no rows.
    fn sails(&mut self, objects: &Objects, state: &State, masses: &Masses, batches: &mut Batches) -> Option<Vec<(usize, Vec<usize>)>> {
        let mut added = Vec::new();
        for (air, on) in std::mem::take(&mut self.airs) {
            let (air, on) = (Arc::new(air), objects.placed(&on));
            let triangles: Vec<[u32; 3]> = on.iter().flat_map(|i| objects.triangles(*i)).collect();
            let threads = on.iter().map(|i| &objects.list[*i]).filter(|object| object.triangles.is_empty() && object.radius > 0.0);
            let piece = |object: &Object, ends: [u32; 2]| {
                (ends.map(|i| i + object.points.start as u32), [2.0 * object.radius, object.breaks.unwrap_or(f64::INFINITY)])
            };
            let (ends, pieces): (Vec<[u32; 2]>, Vec<[f64; 2]>) =
                threads.flat_map(|object| object.pieces().map(|ends| piece(object, ends)).collect::<Vec<_>>()).unzip();
            let (x, mass) = (&state.x[..masses.frames.start], &masses.mass);
            if !ends.is_empty() {
                batches.list.push(Box::new(Sails::new(air.clone(), Threads { pieces }, &ends, x, mass, &self.times)?));
            }
            if !triangles.is_empty() {
                added.push((batches.list.len(), on));
                batches.list.push(Box::new(Sails::new(air, Sheets, &triangles, x, mass, &self.times)?));
            }
        }
        Some(added)
    }
}
