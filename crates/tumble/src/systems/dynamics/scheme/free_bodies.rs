//! Momentum of free bodies under position-based dynamics. An element changes neither linear nor angular momentum about the places at which it
//! finds its points, but the velocity that follows from its corrections is that of the whole way since the start of the sub-step: what is left
//! over, the sum of m v x dx, is of second order in h and adds up to a spin. A rigid motion takes it back from every body that nothing holds:
//!
//!   v += dp/M + w x (x - c),   I w = dL - c x dp                                              (positions.6)
//!
//! with the momenta dp and dL that sweeps have lost, mass M, centre of mass c and inertia I about it. Source: [dahl2019]. Differs: rods have
//! frames, and what contact between surfaces adds stays. Verified in `tests/free_bodies.rs`.

use super::super::contact::real;
use super::super::core::Core;
use super::super::inertia::Inertia;
use super::super::sums::Sums;
use crate::elements::Constraints;
use crate::math::parallel::{Tasks, fold};
use crate::math::{Quat, Row, Vec3, axpy, row, sub, xyz64};
use std::ops::Range;

type Vector = Vec3<f64>;

/// Rows that elements connect, none of them held.
struct Body {
    points: Vec<Range<usize>>,
    frames: Vec<Range<usize>>,
    /// Linear and angular momentum that it is to have [N s, N m s].
    target: [Vector; 2],
}

/// The free bodies of a system.
#[derive(Default)]
pub struct FreeBodies {
    bodies: Vec<Body>,
    /// The topology for which they were found.
    found: Option<[u64; 2]>,
}

impl FreeBodies {
    /// Takes the momenta of predicted positions and velocities.
    pub fn begin(&mut self, core: &Core) {
        let topology = Some([core.broken, core.regrouped]);
        if self.found != topology {
            *self = Self { bodies: find(core), found: topology };
        }
        let sums = self.sums(core);
        for (body, sums) in self.bodies.iter_mut().zip(sums) {
            body.target = [sums.momentum, sums.angular];
        }
    }

    /// Whether there are any.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Adds what contact between surfaces has moved since x was `old`, in a sub-step of length h [s], at the lever arms with which velocities take it:
    /// where the sub-step began.
    pub fn add_contact(&mut self, core: &Core, old: &[Row], h: f64) {
        let Core { state, laws, before, .. } = core;
        for body in &mut self.bodies {
            for range in &body.points {
                let parts = fold(range.len(), |part| {
                    let mut sums = [Vector::default(); 2];
                    for i in range.start + part.start..range.start + part.end {
                        let push = xyz64(sub(state.x[i], old[i])) * (f64::from(laws.masses.mass[i]) / h);
                        sums = [sums[0] + push, sums[1] + xyz64(before[i]).cross(push)];
                    }
                    sums
                });
                body.target = parts.into_iter().fold(body.target, |t, p| [t[0] + p[0], t[1] + p[1]]);
            }
        }
    }

    /// Takes off what liquids have given to rigid bodies in the sweeps.
    pub fn add_reactions(&mut self, core: &Core) {
        for liquid in core.liquids().filter(|liquid| !liquid.bodies.is_empty()) {
            let start = liquid.rows().start;
            let Some(body) = self.bodies.iter_mut().find(|body| body.points.iter().any(|range| range.contains(&start))) else { continue };
            for frozen in &liquid.bodies {
                let [impulse, moment, _] = frozen.got;
                body.target = [body.target[0] - impulse, body.target[1] - moment];
            }
        }
    }

    /// Gives every body the momenta that it is to have; none to those that solids have pushed in a sweep.
    pub fn restore(&self, core: &mut Core) {
        let leaning: Vec<usize> = core.constraints.iter().filter_map(|c| c.leans()).collect();
        let moves = self.bodies.iter().zip(self.sums(core)).map_in_parallel(|(body, sums)| {
            let pushed = leaning.iter().any(|row| body.points.iter().any(|range| range.contains(row)));
            if pushed { None } else { lost(core, body, &sums) }
        });
        let state = &mut core.state;
        for (body, lost) in self.bodies.iter().zip(moves) {
            let Some((shift, spin, center)) = lost else { continue };
            for i in body.points.iter().cloned().flatten() {
                let dv = shift + spin.cross(xyz64(state.x[i]) - center);
                state.v[i] = axpy(state.v[i], 1.0, row(real(dv), 0.0));
            }
            for i in body.frames.iter().cloned().flatten() {
                let dw = Quat::from_row(state.x[i].map(f64::from)).conj().turn(spin);
                state.v[i] = axpy(state.v[i], 1.0, row(real(dw), 0.0));
            }
        }
    }

    fn sums(&self, core: &Core) -> Vec<Sums> {
        self.bodies.iter().map_in_parallel(|body| core.sums(body.points.iter().cloned(), body.frames.iter().cloned().flatten()))
    }
}

/// The rigid motion that a body has lost: velocity of its centre [m/s], spin [rad/s], centre [m].
fn lost(core: &Core, body: &Body, sums: &Sums) -> Option<(Vector, Vector, Vector)> {
    let center = sums.first_moment * (1.0 / sums.mass);
    let push = body.target[0] - sums.momentum;
    let turn = body.target[1] - sums.angular - center.cross(push);
    let (x, masses) = (&core.state.x, &core.laws.masses);
    let mut inertia = Inertia::default();
    for range in &body.points {
        let parts = fold(range.len(), |part| {
            let rows = range.start + part.start..range.start + part.end;
            rows.fold(Inertia::default(), |sum, i| sum.plus(Inertia::of(f64::from(masses.mass[i]), xyz64(x[i]) - center)))
        });
        inertia = parts.into_iter().fold(inertia, Inertia::plus);
    }
    let own: f64 = body.frames.iter().cloned().flatten().map(|i| f64::from(masses.mass[i])).sum();
    let spin = inertia.plus_round(own).spin(turn);
    let finite = |v: Vector| v.norm_sq().is_finite();
    (finite(push) && finite(spin)).then_some((push * (1.0 / sums.mass), spin, center))
}

/// Bodies of two rows and more that hang together by elements that have not broken, and of which no row is held.
fn find(core: &Core) -> Vec<Body> {
    let (x, masses) = (&core.state.x, &core.laws.masses);
    let mut parent: Vec<u32> = (0..x.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    let mut join = |a: u32, b: u32| {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    };
    core.constraints.iter().for_each(|c| c.connect(&mut join));
    if let Some(clamp) = &core.clamp {
        clamp.connect(&mut join);
    }
    let mut held = vec![false; x.len()];
    let mut count = vec![0_u32; x.len()];
    for i in 0..x.len() {
        let at = root(&mut parent, i as u32) as usize;
        count[at] += 1;
        held[at] |= masses.inverse(i, x) == 0.0;
    }
    let mut bodies: Vec<Body> = Vec::new();
    let mut place = vec![usize::MAX; x.len()];
    for i in 0..x.len() {
        let at = root(&mut parent, i as u32) as usize;
        if count[at] < 2 || held[at] {
            continue;
        }
        if place[at] == usize::MAX {
            place[at] = bodies.len();
            bodies.push(Body { points: Vec::new(), frames: Vec::new(), target: Default::default() });
        }
        let body = &mut bodies[place[at]];
        let ranges = if masses.frames.contains(i) { &mut body.frames } else { &mut body.points };
        match ranges.last_mut() {
            Some(last) if last.end == i => last.end += 1,
            _ => ranges.push(i..i + 1),
        }
    }
    bodies.retain(|body| !body.points.is_empty());
    bodies
}
