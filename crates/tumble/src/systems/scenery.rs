//! Scenery: solids that are functions of time alone. What stands, and what moves as the scene says, whatever touches it.

use crate::exchange::Turn;
use crate::geometry::{Collider, Shape};
use crate::system::{Archive, System};
use std::sync::Arc;
use tumble_interface::engine::{Ledger, Stability, StepReport};
use tumble_interface::{Column, StepError};

/// Solids, and their meshes for pictures.
pub struct Scenery {
    solids: Arc<Vec<Collider>>,
    meshes: Vec<Column>,
}

impl Scenery {
    /// These solids; the constant columns of their meshes.
    pub fn new(solids: Arc<Vec<Collider>>, meshes: Vec<Column>) -> Self {
        Self { solids, meshes }
    }
}

impl System for Scenery {
    fn name(&self) -> &str {
        "scenery"
    }

    fn is_listed(&self) -> bool {
        false
    }

    fn absorb(&mut self, _exchange: &mut Turn<'_>) {}

    fn advance(&mut self, _t: f64, _dt: f64, _: &mut Turn<'_>, _go_on: &(dyn Fn() -> bool + Sync)) -> Result<StepReport, StepError> {
        Ok(StepReport::default())
    }

    fn publish(&mut self, _t: f64, exchange: &mut Turn<'_>) {
        exchange.publish_surfaces(self.solids.clone());
    }

    /// Where those are that move, whatever is asked for: `translation` and `turn` of the mesh in the topology, x = turn p + translation, and
    /// `position` of vertices that move by themselves.
    fn columns(&self, t: f64, _names: &[&str], out: &mut Vec<Column>) {
        for solid in self.solids.iter() {
            let mut add = |name: &str, data: Vec<f64>| out.push(Column::new(&solid.name, name, data));
            if let Shape::Animated { facets, .. } = &solid.shape {
                add("position", facets.vertices(t).concat());
            }
            if let Some(motion) = &solid.motion {
                let (pose, _) = motion.at(t);
                add("translation", <[f64; 3]>::from(pose.shift).to_vec());
                add("turn", pose.turn.row().to_vec());
            }
        }
    }

    fn topology(&self, out: &mut Vec<Column>) {
        out.extend(self.meshes.iter().cloned());
    }

    fn ledger(&self, t: f64) -> Ledger {
        Ledger { time: t, ..Ledger::default() }
    }

    fn breakdown(&mut self, _t: f64) -> Option<StepError> {
        None
    }

    fn watch(&mut self, _on: bool) {}

    fn stability(&mut self, _dt: f64, _go_on: &(dyn Fn() -> bool + Sync)) -> Option<Stability> {
        None
    }

    fn save(&self, _archive: &mut Archive) {}

    fn restore(&mut self, _archive: &mut Archive) -> Option<()> {
        Some(())
    }

    fn write(&mut self, _object: &str, _column: &str, _values: &[f64]) -> Option<bool> {
        None
    }
}
