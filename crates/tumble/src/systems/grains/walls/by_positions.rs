//! Hard contact of grains with solids and bodies; see `positions.rs`. Of a contact the grain is the second, and its memory the impulse on the grain.

use super::{Body, Part, SAME, WallContact, Walls, add};
use crate::exchange::Visit;
use crate::geometry::Vector;
use crate::math::Row;
use crate::math::parallel::Tasks;
use crate::systems::grains::hard::{Push, Step, Touch, shares};
use crate::systems::grains::kick::QUICK;
use crate::systems::grains::law::Memory;
use crate::systems::grains::list::{Four, point};

/// Ways in which a body may yield at once to a push and to the friction that goes with it.
const WAYS: f64 = 2.0;

/// Rows of grains that walls touch, and what walls add to.
pub struct HardTouched<'a> {
    pub x: &'a [Four],
    pub w: &'a [Four],
    /// `Bed::quick`.
    pub quick: &'a [Row],
    pub force: &'a mut [Four],
    pub torque: &'a mut [Four],
    pub shift: &'a mut [Four],
    /// Rows of a chunk.
    pub chunk: usize,
}

impl WallContact {
    /// From the centre of the grain at x to its surface there.
    fn arm(&self, x: &Four) -> Vector {
        -self.normal * (x[3] - self.depth)
    }
}

impl Walls {
    /// The body of a surface.
    fn body_of(&self, surface: u32) -> Option<usize> {
        (surface as usize).checked_sub(self.solids.len())
    }

    /// Sums what contacts remember.
    pub fn recall(&self, x: &[Four], chunk: usize, force: &mut [Four], torque: &mut [Four]) {
        let sums = force.chunks_mut(chunk).zip(torque.chunks_mut(chunk)).enumerate();
        self.parts.iter().zip(sums).in_parallel(|(part, (c, (force, torque)))| {
            for contact in &part.contacts {
                let (row, Memory { slip, turn, .. }) = (contact.row as usize, contact.memory);
                add(&mut force[row - c * chunk], slip);
                add(&mut torque[row - c * chunk], contact.arm(&x[row]).cross(slip) + turn);
            }
        });
    }

    /// Bodies have their own acceleration.
    pub fn begin(&mut self, h: f64) {
        for body in &mut self.bodies {
            body.visit.accelerate(h);
            body.touches = 0;
        }
    }

    /// Bodies at the end of a step, if contacts go on as they did.
    pub fn predict(&mut self, x: &[Four]) {
        let mut ahead: Vec<Visit> = self.bodies.iter().map(|body| body.visit.clone()).collect();
        for contact in self.parts.iter().flat_map(|part| &part.contacts) {
            if let Some(k) = self.body_of(contact.surface) {
                let (row, Memory { slip, turn, .. }) = (contact.row as usize, contact.memory);
                ahead[k].take_couple(point(&x[row]) + contact.arm(&x[row]), -slip, -turn, contact.normal);
            }
        }
        for (body, ahead) in self.bodies.iter_mut().zip(ahead) {
            body.ahead = ahead.state;
        }
    }

    /// Bodies get what the last pass gave.
    pub fn end(&mut self) {
        for push in self.parts.iter().flat_map(|part| &part.pushes) {
            self.bodies[push.body].visit.take_couple(push.point, push.force, push.couple, push.normal);
        }
    }

    /// Velocity of a surface at a point with the impulses of the last pass [m/s], and before the step.
    fn velocities(&self, surface: usize, p: Vector, t: f64) -> [Vector; 2] {
        match self.body_of(surface as u32).map(|k| &self.bodies[k]) {
            // With its own acceleration, which in a step is less than what bounces.
            Some(body) => [body.ahead.velocity_at(p), body.visit.state.velocity_at(p)],
            None => [self.velocity(surface, p, t); 2],
        }
    }

    /// Looks for contacts within a step of h from the time t on [s], not farther than `most` [m], and counts those of each row.
    pub fn find(&mut self, x: &[Four], quick: &[Row], (t, h, most): (f64, f64, f64), counts: &mut [u32], chunk: usize) {
        let mut parts = std::mem::take(&mut self.parts);
        let walls = &*self;
        parts.iter_mut().zip(counts.chunks_mut(chunk)).enumerate().in_parallel(|(c, (part, counts))| {
            let before = std::mem::take(&mut part.contacts);
            let mut old = before.as_slice();
            for [row, surface] in &part.candidates {
                let (i, s) = (*row as usize, *surface as usize);
                let key = [*row, *surface];
                let first = old.partition_point(|c| [c.row, c.surface] < key);
                let end = old.partition_point(|c| [c.row, c.surface] <= key);
                let same = &old[first..end];
                old = &old[end..];
                let mut taken = 0_u32;
                let (p, radius, v) = (point(&x[i]), x[i][3], point(&quick[QUICK * i].map(f64::from)));
                let near = radius + most.min(h * (v - walls.velocities(s, p, t + 0.5 * h)[0]).norm());
                walls.each_near(s, p, t, (near, false), |distance, normal| {
                    let arm = -normal * distance.min(radius);
                    let closing = (v - walls.velocities(s, p + arm, t + 0.5 * h)[0]).dot(normal).min(0.0);
                    if distance + h * closing >= radius {
                        return;
                    }
                    let like = |k: &usize| same[*k].normal.dot(normal);
                    let free = (0..same.len().min(32)).filter(|k| taken & 1 << k == 0 && like(k) > SAME);
                    let known = free.max_by(|a, b| like(a).total_cmp(&like(b)));
                    taken |= known.map_or(0, |k| 1 << k);
                    let memory = known.map_or_else(Memory::default, |k| same[k].memory);
                    let fresh = memory.slip == Vector::default();
                    part.contacts.push(WallContact { row: *row, surface: *surface, normal, memory, depth: radius - distance, fresh });
                    counts[i - c * chunk] += 1;
                });
            }
        });
        for k in parts.iter().flat_map(|part| &part.contacts).filter_map(|contact| walls.body_of(contact.surface)).collect::<Vec<_>>() {
            self.bodies[k].touches += 1;
        }
        self.parts = parts;
    }

    /// One pass over contacts: adds what they give to the sums of grains, and tells what bodies get.
    pub fn project(&mut self, rows: HardTouched<'_>, t: f64, step: Step) {
        let mut parts = std::mem::take(&mut self.parts);
        let (walls, HardTouched { x, w, quick, force, torque, shift, chunk }) = (&*self, rows);
        let sums = force.chunks_mut(chunk).zip(torque.chunks_mut(chunk)).zip(shift.chunks_mut(chunk));
        parts.iter_mut().zip(sums).enumerate().in_parallel(|(c, (part, ((force, torque), shift)))| {
            let Part { contacts, pushes, .. } = part;
            pushes.clear();
            for contact in contacts {
                let row = contact.row as usize;
                let Some((push, arm)) = walls.solve(contact, &x[row], &w[row], &quick[QUICK * row..], t, step) else { continue };
                let local = row - c * chunk;
                add(&mut force[local], push.impulse);
                add(&mut torque[local], arm.cross(push.impulse) + push.couple);
                add(&mut shift[local], contact.normal * push.shift);
                if let Some(body) = walls.body_of(contact.surface) {
                    let (point, normal) = (point(&x[row]) + arm, contact.normal);
                    pushes.push(super::Push { body, point, force: -push.impulse, couple: -push.couple, normal });
                }
            }
        });
        self.parts = parts;
    }

    /// What a contact gives its grain, and the arm there.
    fn solve(&self, contact: &mut WallContact, x: &Four, w: &Four, quick: &[Row], t: f64, step: Step) -> Option<(Push, Vector)> {
        let (normal, radius, surface) = (contact.normal, x[3], contact.surface as usize);
        let [v, spin, gain] = [0, 1, 2].map(|k: usize| point(&quick[k].map(f64::from)));
        let (inverse, arm) = (f64::from(quick[0][3]), contact.arm(x));
        let place = point(x) + arm;
        let pair = self.pair(surface, w[3] as usize, t)?;
        let turns = pair.resists_turns();
        let [velocity, before] = self.velocities(surface, place, t + 0.5 * step.h);
        let rel = v + spin.cross(arm) - velocity;
        let [along, turning] = shares(turns);
        let mut yields = [inverse, inverse * along, inverse * turning / (radius * radius)];
        let mut turn = self.spin(surface, t);
        if let Some(Body { visit, ahead, touches, .. }) = self.body_of(contact.surface).map(|k| &self.bodies[k]) {
            turn = ahead.spin;
            let parts = WAYS * f64::from(*touches);
            let own = |e: Vector| visit.yields_to(place, e, normal).dot(e).max(0.0) * parts;
            let slip = rel - normal * rel.dot(normal);
            yields[0] += own(normal);
            yields[1] += if slip.norm() > 0.0 { own(slip.normalized()) } else { 0.0 };
            yields[2] += visit.state.turned(normal).norm() * parts;
        }
        let touch = Touch {
            gap: -contact.depth,
            normal,
            velocity: rel,
            // What is pressed already does not bounce.
            before: if contact.fresh { (v - gain - before).dot(normal) } else { 0.0 },
            turning: spin - turn,
            radius,
            yields,
        };
        Some((pair.project(&touch, [step.h, step.slow], &mut contact.memory, turns), arm))
    }
}
