//! Elements and forces between masses as batches, in the order in which they act.

use super::build::{Closed, Liquid, Point, Settings, Springs};
use crate::elements::{
    Batch, BendTwist, Constraints, Density, Element, Elements, Law, Linear, Members, Neohookean, Pair, Pairs, Projected, Shape, Strands,
    StretchShear, TetShear, TetVolume, Volume,
};
use crate::forces::{Attractor, Cohesion, DirectSum, Flock, Goal, Habits, Halos, LennardJones, Near, Newtonian, Repulsion, Viscosity};
use crate::math::{Real, functions};
use crate::state::Masses;
use std::ops::Range;
use tumble_interface::scene::Force as Words;

/// The batches of a force between masses.
pub fn between(
    words: Words,
    on: Vec<Range<usize>>,
    others: Option<Vec<Range<usize>>>,
    masses: &Masses,
    halos: &[(u32, f64)],
    settings: &Settings,
) -> Vec<Box<dyn Batch>> {
    vec![match words {
        Words::Gravitation { constant, softening, .. } => {
            let attractor = Attractor::Mass(constant);
            let points: Box<dyn Batch> = Box::new(DirectSum::new(attractor, softening, settings.native, halos, on.clone(), masses));
            if halos.is_empty() {
                return vec![points];
            }
            return vec![Box::new(Halos::new(constant, softening, halos, &on, masses)), points];
        }
        Words::Electrostatics { constant, softening, .. } => {
            Box::new(DirectSum::new(Attractor::Charge(-constant), softening, settings.native, &[], on, masses))
        }
        Words::LennardJones { epsilon, sigma, cutoff, smooth, .. } => {
            Box::new(Near::new(LennardJones::new(epsilon, sigma, cutoff.unwrap_or(2.5 * sigma), smooth), on, others))
        }
        Words::Repulsion { stiffness, distance, exponent, .. } => {
            Box::new(Near::new(Repulsion { stiffness, distance, exponent }, on, others))
        }
        Words::Cohesion { strength, radius, .. } => Box::new(Near::new(Cohesion { strength, radius }, on, others)),
        Words::Viscosity { coefficient, radius, central, .. } => {
            Box::new(Near::new(Viscosity { coefficient, radius, central }, on, others))
        }
        Words::Flock {
            radius,
            nearest,
            view,
            cohesion,
            alignment,
            separation,
            spacing,
            speed,
            propulsion,
            max_acceleration,
            goal,
            avoidance,
            clearance,
            fear,
            fear_radius,
            chase,
            predator_speed,
            ..
        } => {
            let habits = Habits {
                radius,
                nearest: nearest.unwrap_or(0) as usize,
                view: if view < 360.0 { functions::cos((0.5 * view).to_radians()) } else { -2.0 },
                cohesion,
                alignment,
                separation,
                spacing: spacing.unwrap_or(0.5 * radius),
                speed,
                propulsion,
                limit: max_acceleration.unwrap_or(0.0),
                goals: goal.into_iter().map(|g| Goal { point: g.point.into(), strength: g.strength }).collect(),
                avoidance,
                clearance: clearance.unwrap_or(radius),
                fear,
                fear_radius: fear_radius.unwrap_or(3.0 * radius),
                chase,
                predator_speed: predator_speed.unwrap_or(speed),
            };
            Box::new(Flock::new(habits, on, others.unwrap_or_default(), masses, settings.colliders.clone()))
        }
        // Forces on each mass by itself, and on surfaces.
        _ => return Vec::new(),
    }]
}

/// Elements in the order in which they act: as forces, or as constraints.
pub struct Batches {
    /// Rows of points and frames.
    pub rows: usize,
    /// Points.
    pub points: usize,
    /// Inverse inertias of frames, if elements are constraints.
    pub projected: Option<Vec<Real>>,
    /// Forces.
    pub list: Vec<Box<dyn Batch>>,
    /// Constraints.
    pub constraints: Vec<Box<dyn Constraints>>,
}

impl Batches {
    /// Adds springs, if there are any; `None` if one is not between rows, else the index of the batch.
    pub fn springs<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize>(
        &mut self,
        springs: &Springs<D, P>,
    ) -> Option<Option<usize>> {
        if springs.members.is_empty() {
            return Some(None);
        }
        if let Some(inverse) = &self.projected {
            let springs = Projected::<E, Y, 2, M, D, P>::new(self.rows, self.points, inverse, &springs.members, &springs.limits)?;
            self.constraints.push(Box::new(springs));
            return Some(Some(self.constraints.len() - 1));
        }
        self.list.push(Box::new(Pairs::<E, Y, M, D, P>::new(self.rows, &springs.members, &springs.limits)?));
        Some(Some(self.list.len() - 1))
    }

    /// Adds elements, if there are any; `None` if a node is not a row, else the index of the batch.
    pub fn add<E: Element<N, M, D>, const N: usize, const M: usize, const D: usize>(
        &mut self,
        members: &[Members<N, D, 0>],
        energy_at_rest: f64,
    ) -> Option<Option<usize>> {
        self.add_with::<E, Linear, N, M, D, 0>(members, energy_at_rest)
    }

    /// The same with a law of their own.
    pub fn add_with<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize>(
        &mut self,
        members: &[Members<N, D, P>],
        energy_at_rest: f64,
    ) -> Option<Option<usize>> {
        if members.is_empty() {
            return Some(None);
        }
        if let Some(inverse) = &self.projected {
            let elements = Projected::<E, Y, N, M, D, P>::new(self.rows, self.points, inverse, members, &[])?;
            self.constraints.push(Box::new(elements));
            return Some(Some(self.constraints.len() - 1));
        }
        let elements = Elements::<E, Y, N, M, D, P>::new(self.rows, members)?;
        self.list.push(Box::new(elements.with_energy_at_rest(energy_at_rest)));
        Some(Some(self.list.len() - 1))
    }

    /// Adds rods, if there are any: as constraints, chains are solved as a whole.
    pub fn rods(&mut self, stretches: &[Members<3, 2, 0>], bends: &mut Vec<Members<2, 6, 0>>, limits: &[f64]) -> Option<()> {
        let strands = self.projected.as_ref().and_then(|inverse| Strands::new(self.rows, self.points, inverse, stretches, bends, limits));
        match strands {
            Some(strands) => self.constraints.push(Box::new(strands)),
            None => _ = self.add::<StretchShear, 3, 3, 2>(stretches, 0.0)?,
        }
        self.add::<BendTwist, 2, 3, 6>(bends, 0.0).map(|_| ())
    }

    /// Adds both laws of solids, if there are any; `None` if a node is not a row.
    pub fn solids(&mut self, shears: &[Members<4, 9, 0>], volumes: &[Members<4, 10, 0>], energy_at_rest: [f64; 2]) -> Option<()> {
        if self.projected.is_none() || shears.is_empty() {
            self.add::<TetShear, 4, 9, 9>(shears, energy_at_rest[0])?;
            return self.add::<TetVolume, 4, 1, 10>(volumes, energy_at_rest[1]).map(|_| ());
        }
        self.constraints.push(Box::new(Neohookean::new(self.rows, shears, volumes, energy_at_rest[0] + energy_at_rest[1])?));
        Some(())
    }

    /// Adds what acts on whole bodies; `None` if a node is not a row. There are some only where elements are constraints.
    pub fn global_constraints(
        &mut self,
        points: &[Point],
        closed: Vec<(String, Closed)>,
        shapes: &[(String, Range<usize>, f64)],
        liquids: &[(String, Range<usize>, Liquid)],
    ) -> Option<()> {
        for (_, Closed { triangles, target, stiffness }) in closed {
            self.constraints.push(Box::new(Volume::new(self.points, triangles, target, stiffness)?));
        }
        for (_, range, kappa) in shapes {
            let (mass, places): (Vec<f64>, Vec<_>) = points.get(range.clone())?.iter().map(|(x, _, mass, _)| (*mass, *x)).unzip();
            self.constraints.push(Box::new(Shape::new(range.clone(), mass, &places, *kappa)?));
        }
        for (_, range, Liquid { spacing, bulk, viscosity }) in liquids {
            self.constraints.push(Box::new(Density::new(range.clone(), *spacing, *bulk)));
            if *viscosity > 0.0 {
                let law = Newtonian { viscosity: *viscosity, spacing: *spacing };
                self.list.push(Box::new(Near::new(law, vec![range.clone()], None)));
            }
        }
        Some(())
    }
}
