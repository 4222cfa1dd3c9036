//! Elements of the parts: as batches of forces, or as constraints.

use super::super::parts::{Closed, Liquid, Parts, Point, Springs};
use crate::elements::{
    Area, Batch, BendTwist, Bending, Constraints, Density, Distance, Driven, DrivenSpring, Element, Elements, IsometricBend, Law, Linear,
    Members, Membrane, Neohookean, Nonlinear, Pair, Pairs, Projected, Shape, Strands, StretchShear, TetShear, TetStrain, TetVolume, Vector,
    Volume, Weights, Woven, WovenBending,
};
use crate::forces::{Near, Newtonian};
use crate::math::{Real, Row};
use crate::state::Masses;
use std::ops::Range;
use tumble_interface::scene::Hessian;

/// The lists of elements that surfaces and links are made of, as indices of batches or constraints; `None` where a kind has no elements.
#[derive(Debug, Clone, Copy)]
pub struct Lists {
    /// Linear springs, nonlinear ones, those of no rest length.
    pub springs: [Option<usize>; 3],
    pub bending: Option<usize>,
    pub isometric: Option<usize>,
    pub membranes: Option<usize>,
    pub areas: Option<usize>,
    pub woven: Option<usize>,
    pub woven_bending: Option<usize>,
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

/// A node of an element that is no row of its system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NotARow;

impl Batches {
    /// No elements yet between the rows of these masses; `projects` says whether they will be constraints.
    pub fn new(masses: &Masses, projects: bool) -> Self {
        Self {
            rows: masses.mass.len(),
            points: masses.frames.start,
            projected: projects.then(|| masses.inverse_inertia.clone()),
            list: Vec::new(),
            constraints: Vec::new(),
        }
    }

    /// Holds frames.
    pub fn hold(&mut self, held: impl Fn(usize) -> bool) {
        let points = self.points;
        let frames = self.projected.iter_mut().flatten().enumerate();
        frames.filter(|(i, _)| held(points + i)).for_each(|(_, inverse)| *inverse = 0.0);
    }

    /// Adds all elements of some parts.
    pub fn fill(&mut self, parts: &mut Parts) -> Result<Lists, NotARow> {
        let springs = [
            self.springs::<Distance, Linear, 1, 1, 0>(&parts.linear, &parts.chains())?,
            self.springs::<Distance, Nonlinear, 1, 1, 2>(&parts.nonlinear, &[])?,
            self.springs::<Vector, Linear, 3, 0, 0>(&parts.vector, &[])?,
        ];
        self.add::<Distance, 2, 1, 1>(&parts.dampers, 0.0)?;
        self.driven(std::mem::take(&mut parts.driven))?;
        let bending = self.add::<Bending, 6, 3, 12>(&parts.bending, 0.0)?;
        let isometric = self.add::<IsometricBend, 4, 3, 3>(&parts.isometric, 0.0)?;
        let membranes = self.add::<Membrane, 3, 3, 8>(&parts.membranes, 0.0)?;
        let areas = self.add::<Area, 3, 1, 1>(&parts.areas, 0.0)?;
        let woven = self.add::<Woven, 3, 3, 28>(&parts.woven, 0.0)?;
        let woven_bending = self.add::<WovenBending, 6, 3, 36>(&parts.woven_bending, 0.0)?;
        self.solids(&parts.shears, &parts.volumes, parts.energy_at_rest)?;
        self.add::<TetStrain, 4, 6, 9>(&parts.strains, 0.0)?;
        self.rods(&parts.stretches, &mut parts.bends, &parts.rod_limits)?;
        self.global_constraints(&parts.points, std::mem::take(&mut parts.closed), &parts.shapes, &parts.liquids)?;
        Ok(Lists { springs, bending, isometric, membranes, areas, woven, woven_bending })
    }

    /// The stiffness with which elements hold each row [N/m].
    pub fn grip(&mut self, x: &[Row]) -> Vec<Real> {
        let mut stiffness = vec![[0.0; 6]; self.rows];
        for batch in &mut self.list {
            batch.linearize(x, Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Definite });
            batch.add_diagonal(x, &mut stiffness);
        }
        let mut grip: Vec<Real> = stiffness.iter().map(|k| (k[0] + k[1] + k[2]) / 3.0).collect();
        self.constraints.iter().for_each(|c| c.add_grip(x, &mut grip));
        grip
    }

    /// Adds springs, if there are any, as constraints with some `chains` of them; returns the index of the batch.
    fn springs<E: Pair<M, D>, Y: Law<P>, const M: usize, const D: usize, const P: usize>(
        &mut self,
        springs: &Springs<D, P>,
        chains: &[Range<usize>],
    ) -> Result<Option<usize>, NotARow> {
        if springs.members.is_empty() {
            return Ok(None);
        }
        if let Some(inverse) = &self.projected {
            let Springs { members, limits, .. } = springs;
            let springs =
                Projected::<E, Y, 2, M, D, P>::with_chains(self.rows, self.points, inverse, members, limits, chains).ok_or(NotARow)?;
            self.constraints.push(Box::new(springs));
            return Ok(Some(self.constraints.len() - 1));
        }
        self.list.push(Box::new(Pairs::<E, Y, M, D, P>::new(self.rows, &springs.members, &springs.limits).ok_or(NotARow)?));
        Ok(Some(self.list.len() - 1))
    }

    /// Adds elements, if there are any; returns the index of the batch.
    fn add<E: Element<N, M, D>, const N: usize, const M: usize, const D: usize>(
        &mut self,
        members: &[Members<N, D, 0>],
        energy_at_rest: f64,
    ) -> Result<Option<usize>, NotARow> {
        if members.is_empty() {
            return Ok(None);
        }
        if let Some(inverse) = &self.projected {
            let elements = Projected::<E, Linear, N, M, D, 0>::new(self.rows, self.points, inverse, members, &[]).ok_or(NotARow)?;
            self.constraints.push(Box::new(elements));
            return Ok(Some(self.constraints.len() - 1));
        }
        let elements = Elements::<E, Linear, N, M, D, 0>::new(self.rows, members).ok_or(NotARow)?;
        self.list.push(Box::new(elements.with_energy_at_rest(energy_at_rest)));
        Ok(Some(self.list.len() - 1))
    }

    /// Adds springs that change in time, if there are any.
    fn driven(&mut self, springs: Vec<DrivenSpring>) -> Result<(), NotARow> {
        if springs.is_empty() {
            return Ok(());
        }
        let springs = Box::new(Driven::new(self.rows, springs).ok_or(NotARow)?);
        match self.projected {
            Some(_) => self.constraints.push(springs),
            None => self.list.push(springs),
        }
        Ok(())
    }

    /// Adds rods, if there are any: as constraints, chains are solved as a whole.
    fn rods(&mut self, stretches: &[Members<3, 2, 0>], bends: &mut Vec<Members<2, 6, 0>>, limits: &[f64]) -> Result<(), NotARow> {
        let strands = self.projected.as_ref().and_then(|inverse| Strands::new(self.rows, self.points, inverse, stretches, bends, limits));
        match strands {
            Some(strands) => self.constraints.push(Box::new(strands)),
            None => _ = self.add::<StretchShear, 3, 3, 2>(stretches, 0.0)?,
        }
        self.add::<BendTwist, 2, 3, 6>(bends, 0.0).map(|_| ())
    }

    /// Adds both laws of solids, if there are any.
    fn solids(&mut self, shears: &[Members<4, 9, 0>], volumes: &[Members<4, 10, 0>], energy_at_rest: [f64; 2]) -> Result<(), NotARow> {
        if self.projected.is_none() || shears.is_empty() {
            self.add::<TetShear, 4, 9, 9>(shears, energy_at_rest[0])?;
            return self.add::<TetVolume, 4, 1, 10>(volumes, energy_at_rest[1]).map(|_| ());
        }
        self.constraints.push(Box::new(Neohookean::new(self.rows, shears, volumes, energy_at_rest[0] + energy_at_rest[1]).ok_or(NotARow)?));
        Ok(())
    }

    /// Adds constraints on whole bodies. There are some only where elements are constraints.
    fn global_constraints(
        &mut self,
        points: &[Point],
        closed: Vec<(String, Closed)>,
        shapes: &[(String, Range<usize>, f64)],
        liquids: &[(String, Range<usize>, Liquid)],
    ) -> Result<(), NotARow> {
        for (_, Closed { triangles, volume, target, stiffness }) in closed {
            self.constraints.push(Box::new(Volume::new(self.points, triangles, volume, target, stiffness).ok_or(NotARow)?));
        }
        for (_, range, kappa) in shapes {
            let (mass, places): (Vec<f64>, Vec<_>) =
                points.get(range.clone()).ok_or(NotARow)?.iter().map(|(x, _, mass, _)| (*mass, *x)).unzip();
            self.constraints.push(Box::new(Shape::new(range.clone(), mass, &places, *kappa).ok_or(NotARow)?));
        }
        for (_, range, Liquid { spacing, bulk, viscosity }) in liquids {
            self.constraints.push(Box::new(Density::new(range.clone(), *spacing, *bulk)));
            if *viscosity > 0.0 {
                let law = Newtonian { viscosity: *viscosity, spacing: *spacing };
                self.list.push(Box::new(Near::new(law, vec![range.clone()], None)));
            }
        }
        Ok(())
    }
}
