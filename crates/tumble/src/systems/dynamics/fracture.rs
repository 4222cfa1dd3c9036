//! Fracture: links break beyond their strain, and surfaces tear. Broken elements and the triangles of torn surfaces are the state.

use super::core::Core;
use super::feature::{Feature, Span};
use super::tear::{ElementList, Tear};
use crate::elements::Constraints;
use crate::system::{Archive, Part};
use tumble_interface::engine::StepReport;

/// Links that break and surfaces that tear.
pub struct Fracture {
    tears: Vec<Tear>,
    /// Whether a surface has torn since contact was told.
    pub torn: bool,
}

impl Fracture {
    /// These surfaces tear.
    pub fn new(tears: Vec<Tear>) -> Self {
        Self { tears, torn: false }
    }

    /// Surfaces that tear.
    pub fn tears(&self) -> &[Tear] {
        &self.tears
    }

    /// Masses and elements follow the triangles.
    fn apply(&mut self, core: &mut Core) {
        for tear in &mut self.tears {
            tear.weigh(&mut core.laws.masses.mass, &mut core.state.x);
            for (elements, moved, lost) in tear.changes() {
                match elements {
                    ElementList::Batch(i) => {
                        let batch = &mut core.laws.batches[i];
                        batch.rewire(&moved);
                        batch.break_elements(&lost);
                    }
                    ElementList::Constraints(i) => {
                        core.constraints[i].rewire(&moved);
                        core.constraints[i].break_elements(&lost);
                    }
                    ElementList::Clamp => {
                        if let Some(clamp) = &mut core.clamp {
                            clamp.rewire(&moved);
                            clamp.break_elements(&lost);
                        }
                    }
                }
            }
        }
        self.torn = true;
    }
}

impl Feature for Fracture {
    /// Breaks links, then splits the vertices of edges beyond their strength.
    fn after(&mut self, core: &mut Core, _: Span, report: &mut StepReport) {
        let mut broken = core.break_links();
        let state = &mut core.state;
        let splits: u64 = self.tears.iter_mut().map(|tear| tear.split_strained(&mut state.x, &mut state.v)).sum();
        if splits > 0 {
            self.apply(core);
        }
        broken += splits;
        if broken > 0 {
            report.broken += broken;
            core.broken += broken;
            core.memory.ready = false;
        }
    }

    fn save(&self, core: &Core, archive: &mut Archive) {
        for tear in &self.tears {
            archive.push("triangles", Part::Indices(tear.triangles().concat()));
        }
        for batch in &core.laws.batches {
            archive.push("broken", Part::Indices(batch.broken()));
        }
        for constraints in &core.constraints {
            archive.push("broken", Part::Indices(constraints.broken()));
        }
    }

    fn restore(&mut self, core: &mut Core, archive: &mut Archive) -> Option<()> {
        for tear in &mut self.tears {
            tear.set(&archive.indices("triangles")?)?;
        }
        if !self.tears.is_empty() {
            self.apply(core);
        }
        let known = |broken: Vec<u32>, len: usize| broken.iter().all(|e| (*e as usize) < len).then_some(broken);
        for batch in &mut core.laws.batches {
            let broken = known(archive.indices("broken")?, batch.len())?;
            batch.set_broken(&broken);
        }
        for constraints in &mut core.constraints {
            let broken = known(archive.indices("broken")?, constraints.len())?;
            constraints.set_broken(&broken);
        }
        Some(())
    }
}
