//! L4: all that systems say to each other. A system posts impulses to ports of others and reads the state that they
//! have published; it never sees another system. What passes through a surface of one, heat, say, is a flux that all
//! others may read.
//!
//! The world delivers an impulse to a system on the system's own next turn, before it advances: absorbing them after
//! everyone has advanced would conserve momentum too, and multiply the energy (see `docs/theory/coupling.md`).

use crate::geometry::Vector;
use crate::state::Vectors;
use std::sync::Arc;

/// A mass that another system may push: its place in the list of ports.
pub type Port = usize;

/// The published state of a port.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PortState {
    /// System and row that own it.
    pub owner: (usize, usize),
    /// Position [m].
    pub position: Vector,
    /// Velocity [m/s].
    pub velocity: Vector,
    /// Time at which they hold [s].
    pub time: f64,
}

/// What has passed through a surface of a system.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flux {
    /// System that it has entered.
    pub system: usize,
    /// Object and surface: `plate x_low`.
    pub name: String,
    /// Heat that has entered, in all [J].
    pub heat: f64,
    /// Mass that has entered, in all [kg].
    pub mass: f64,
}

/// Velocities that a fluid has published, of the last two times [s]. They are in no snapshot: the fluid publishes them anew.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Wind {
    fluid: String,
    states: Vec<(f64, Arc<Vectors>)>,
}

/// Ports and mail.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Exchange {
    ports: Vec<PortState>,
    mail: Vec<(Port, Vector)>,
    fluxes: Vec<Flux>,
    winds: Vec<Wind>,
    /// Sum of all impulses ever posted and ever delivered [N s].
    pub posted: Vector,
    /// Sum of all impulses ever delivered [N s].
    pub delivered: Vector,
}

impl Exchange {
    /// Makes a row of a system a port.
    pub fn open(&mut self, system: usize, row: usize) -> Port {
        self.ports.push(PortState { owner: (system, row), ..PortState::default() });
        self.ports.len() - 1
    }

    /// The state of a port.
    pub fn port(&self, port: Port) -> PortState {
        self.ports[port]
    }

    /// Ports of a system, to publish them.
    pub fn ports_of(&mut self, system: usize) -> impl Iterator<Item = &mut PortState> {
        self.ports.iter_mut().filter(move |p| p.owner.0 == system)
    }

    /// Posts an impulse [N s] to a port.
    pub fn post(&mut self, port: Port, impulse: Vector) {
        self.posted = self.posted + impulse;
        self.mail.push((port, impulse));
    }

    /// Takes the mail of a system, as rows and impulses, in the order in which it was posted.
    pub fn take(&mut self, system: usize) -> Vec<(usize, Vector)> {
        let (mine, others) = self.mail.drain(..).partition::<Vec<_>, _>(|(port, _)| self.ports[*port].owner.0 == system);
        self.mail = others;
        for (_, impulse) in &mine {
            self.delivered = self.delivered + *impulse;
        }
        mine.into_iter().map(|(port, impulse)| (self.ports[port].owner.1, impulse)).collect()
    }

    /// Announces a surface; returns its place among the fluxes.
    pub fn surface(&mut self, system: usize, name: String) -> usize {
        self.fluxes.push(Flux { system, name, ..Flux::default() });
        self.fluxes.len() - 1
    }

    /// Heat [J] and mass [kg] have entered through a surface.
    pub fn enter(&mut self, surface: usize, heat: f64, mass: f64) {
        let flux = &mut self.fluxes[surface];
        (flux.heat, flux.mass) = (flux.heat + heat, flux.mass + mass);
    }

    /// What has passed through all surfaces.
    pub fn fluxes(&self) -> &[Flux] {
        &self.fluxes
    }

    /// Asks a fluid for its velocities.
    pub fn listen(&mut self, fluid: &str) {
        if self.winds.iter().all(|wind| wind.fluid != fluid) {
            self.winds.push(Wind { fluid: fluid.into(), states: Vec::new() });
        }
    }

    /// Whether anybody wants to know the velocities of fluids.
    pub fn is_heard(&self) -> bool {
        !self.winds.is_empty()
    }

    /// The velocities of a fluid on faces [m/s] at time t [s], if anybody wants to know.
    pub fn blow(&mut self, fluid: &str, t: f64, u: &Vectors) {
        if let Some(wind) = self.winds.iter_mut().find(|wind| wind.fluid == fluid) {
            wind.states.retain(|(time, _)| *time < t);
            wind.states.push((t, Arc::new(u.clone())));
            let old = wind.states.len().saturating_sub(2);
            wind.states.drain(..old);
        }
    }

    /// What a fluid has published.
    pub fn wind(&self, fluid: &str) -> &[(f64, Arc<Vectors>)] {
        self.winds.iter().find(|wind| wind.fluid == fluid).map_or(&[], |wind| &wind.states)
    }

    /// Everything as numbers, for a snapshot: ports in order, fluxes, then the mail.
    pub fn save(&self) -> Vec<f64> {
        let v = |v: Vector| <[f64; 3]>::from(v);
        let mut out = vec![self.ports.len() as f64];
        for p in &self.ports {
            out.extend(v(p.position).into_iter().chain(v(p.velocity)).chain([p.time]));
        }
        out.extend(v(self.posted).into_iter().chain(v(self.delivered)));
        out.extend(self.fluxes.iter().flat_map(|flux| [flux.heat, flux.mass]));
        for (port, impulse) in &self.mail {
            out.push(*port as f64);
            out.extend(v(*impulse));
        }
        out
    }

    /// The inverse of [`Exchange::save`]; `None` if the numbers are not of this exchange.
    pub fn restore(&mut self, numbers: &[f64]) -> Option<()> {
        let (count, rest) = numbers.split_first()?;
        let n = self.ports.len();
        let fixed = 7 * n + 6 + 2 * self.fluxes.len();
        if *count as usize != n || rest.len() < fixed || !(rest.len() - fixed).is_multiple_of(4) {
            return None;
        }
        let v = |s: &[f64]| Vector { x: s[0], y: s[1], z: s[2] };
        let (ports, rest) = rest.split_at(7 * n);
        let (sums, rest) = rest.split_at(6);
        let (fluxes, mail) = rest.split_at(2 * self.fluxes.len());
        if mail.chunks_exact(4).any(|m| !(m[0] >= 0.0 && m[0] < n as f64)) {
            return None;
        }
        for (port, s) in self.ports.iter_mut().zip(ports.chunks_exact(7)) {
            (port.position, port.velocity, port.time) = (v(&s[..3]), v(&s[3..6]), s[6]);
        }
        (self.posted, self.delivered) = (v(&sums[..3]), v(&sums[3..]));
        for (flux, s) in self.fluxes.iter_mut().zip(fluxes.chunks_exact(2)) {
            (flux.heat, flux.mass) = (s[0], s[1]);
        }
        self.mail = mail.chunks_exact(4).map(|m| (m[0] as usize, v(&m[1..]))).collect();
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_impulse_is_delivered_once_to_its_system() {
        let mut exchange = Exchange::default();
        let (a, b) = (exchange.open(0, 5), exchange.open(1, 7));
        let surface = exchange.surface(1, "plate x_low".into());
        exchange.enter(surface, 3.0, 0.5);
        exchange.enter(surface, -1.0, 0.5);
        assert_eq!((exchange.fluxes()[0].heat, exchange.fluxes()[0].mass), (2.0, 1.0));
        exchange.post(a, [1.0, 0.0, 0.0].into());
        exchange.post(b, [0.0, 2.0, 0.0].into());
        exchange.post(b, [0.0, 0.0, 3.0].into());
        let mut copy = exchange.clone();
        copy.take(0);
        copy.enter(surface, 9.0, 9.0);
        assert!(copy.restore(&exchange.save()).is_some() && copy == exchange);
        assert!(copy.restore(&exchange.save()[1..]).is_none());
        assert_eq!(exchange.take(1), vec![(7, [0.0, 2.0, 0.0].into()), (7, [0.0, 0.0, 3.0].into())]);
        assert_eq!(exchange.take(1), vec![]);
        assert_eq!(exchange.take(0), vec![(5, [1.0, 0.0, 0.0].into())]);
        assert_eq!(exchange.posted, exchange.delivered);
    }
}
