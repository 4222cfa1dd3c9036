//! Masses that feel no other, stepped block by block.

use super::contact::{Found, Pass, Response, Step as Contact};
use super::core::{BLOCK, Core};
use super::feature::Span;
use super::laws::Local;
use crate::integrators::{self, Equation, Scratch, Step};
use crate::math::Row;
use crate::math::parallel::{CHUNK, Tasks};
use tumble_interface::StepError;
use tumble_interface::engine::StepReport;

impl Core {
    /// All sub-steps of an interval, the first of which is `first`, block by block: every number is then read and written once an
    /// interval, and the scratch of any scheme stays in the first cache.
    pub fn advance_blocks(
        &mut self,
        first: Span,
        substeps: u32,
        response: Response,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), StepError> {
        let (Span { t: begun, h }, scheme, resting) = (first, self.integrator, self.resting_speed(first.h));
        let (laws, colliders, state) = (&self.laws, &self.laws.colliders[..], &mut self.state);
        let mut memory: Vec<Vec<&mut [Row]>> = Vec::new();
        memory.resize_with(state.x.len().div_ceil(BLOCK), Vec::new);
        for column in &mut self.memory.columns {
            for (part, rows) in memory.iter_mut().zip(column.chunks_mut(BLOCK)) {
                part.push(rows);
            }
        }
        let was_ready = self.memory.ready;
        let observed = self.pool.heeded();
        let mut blocks: Vec<_> = state.x.chunks_mut(BLOCK).zip(state.v.chunks_mut(BLOCK)).zip(memory).enumerate().collect();
        let results = blocks.chunks_mut(CHUNK / BLOCK).map_in_parallel(|blocks| {
            let scratch = &mut Scratch::default();
            let moved = blocks.iter_mut().map(|(c, ((x, v), memory))| {
                let start = *c * BLOCK;
                let mut motion = Local { laws, masses: &laws.masses, start, newborn: None };
                let [first, _, last] = motion.kinematics().frames.cut(0, x.len());
                let (mut ready, mut before, mut before_v, mut found) = (was_ready, Vec::new(), Vec::new(), Found::default());
                for k in 0..substeps {
                    if k % 64 == 63 && !go_on() {
                        return Ok((false, found.hits));
                    }
                    if !colliders.is_empty() {
                        before.clear();
                        before.extend_from_slice(x);
                        before_v.clear();
                        before_v.extend_from_slice(v);
                    }
                    let (t, equation, report) = (begun + f64::from(k) * h, &mut motion, &mut StepReport::default());
                    integrators::step(scheme, Step { equation, t, h, x, v, memory, ready, scratch, report })?;
                    ready = true;
                    if !colliders.is_empty() {
                        let step = Contact { t, h, resting, lead: response.lead, observed: false };
                        let pass = Pass { colliders, step, penalty: response.penalty, observed: &observed, counted: &[] };
                        for points in [&first, &last] {
                            let starts = [&before[points.clone()], &before_v[points.clone()]];
                            let (x, v) = (&mut x[points.clone()], &mut v[points.clone()]);
                            pass.rows(start + points.start, starts, x, v, &mut found);
                        }
                        ready &= !std::mem::take(&mut found.touched);
                    }
                }
                Ok((ready, found.hits))
            });
            moved.collect::<Result<Vec<_>, StepError>>()
        });
        self.memory.ready = true;
        for (ready, hits) in results.into_iter().collect::<Result<Vec<_>, _>>()?.concat() {
            self.memory.ready &= ready;
            hits.into_iter().for_each(|(row, hit)| self.pool.note_row(row, hit));
        }
        Ok(())
    }
}
