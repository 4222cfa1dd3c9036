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
    /// Acceleration by all that its own system does to it [m/s²], where [`Exchange::open_body`] asked for it.
    pub acceleration: Vector,
    /// Away from the solid of its own system that it touches; zero if it touches none. Asked for like the acceleration, which knows
    /// nothing of contact.
    pub normal: Vector,
    /// 1/mass [1/kg], 0 for what is held.
    pub inverse_mass: f64,
    /// Time at which they hold [s].
    pub time: f64,
}

impl PortState {
    /// How much faster it goes after an impulse [N s]: another system may solve for both together.
    pub fn response(&self, impulse: Vector) -> Vector {
        impulse * self.inverse_mass
    }

    fn numbers(&self) -> [f64; PORT] {
        let [x, v, a, n] = [self.position, self.velocity, self.acceleration, self.normal].map(<[f64; 3]>::from);
        [x[0], x[1], x[2], v[0], v[1], v[2], a[0], a[1], a[2], n[0], n[1], n[2], self.inverse_mass, self.time]
    }
}

/// Numbers of a port in a snapshot.
const PORT: usize = 14;

/// An impulse on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Letter {
    port: Port,
    impulse: Vector,
    steady: bool,
}

/// An impulse that has arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Push {
    /// The row that it pushes.
    pub row: usize,
    /// The impulse [N s].
    pub impulse: Vector,
    /// Whether it is that of a constant force over the interval to come, and not a kick before it.
    pub steady: bool,
}

/// Flux through a surface of a system.
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
    /// Ports whose acceleration is asked for.
    bodies: Vec<Port>,
    mail: Vec<Letter>,
    fluxes: Vec<Flux>,
    winds: Vec<Wind>,
    /// Sum of all impulses ever posted [N s].
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

    /// Makes a row of a system a port that tells its acceleration and what it touches.
    pub fn open_body(&mut self, system: usize, row: usize) -> Port {
        let port = self.open(system, row);
        self.bodies.push(port);
        port
    }

    /// Whether a port of this system tells its acceleration.
    pub fn has_body(&self, system: usize) -> bool {
        self.bodies.iter().any(|port| self.ports[*port].owner.0 == system)
    }

    /// The state of a port.
    pub fn port(&self, port: Port) -> PortState {
        self.ports[port]
    }

    /// Ports of a system, to publish them.
    pub fn ports_of(&mut self, system: usize) -> impl Iterator<Item = &mut PortState> {
        self.ports.iter_mut().filter(move |p| p.owner.0 == system)
    }

    /// Posts an impulse [N s] to a port: a kick before it moves on.
    pub fn post(&mut self, port: Port, impulse: Vector) {
        self.send(Letter { port, impulse, steady: false });
    }

    /// Posts an impulse [N s] to a port: that of a constant force while it moves through its next interval. Post reaction
    /// forces as steady: as a kick they would set resting bodies in motion.                                     (coupling.6)
    pub fn post_steady(&mut self, port: Port, impulse: Vector) {
        self.send(Letter { port, impulse, steady: true });
    }

    fn send(&mut self, letter: Letter) {
        self.posted = self.posted + letter.impulse;
        self.mail.push(letter);
    }

    /// Takes the mail of a system, in the order in which it was posted.
    pub fn take(&mut self, system: usize) -> Vec<Push> {
        let (mine, others) = self.mail.drain(..).partition::<Vec<_>, _>(|letter| self.ports[letter.port].owner.0 == system);
        self.mail = others;
        for letter in &mine {
            self.delivered = self.delivered + letter.impulse;
        }
        mine.into_iter().map(|l| Push { row: self.ports[l.port].owner.1, impulse: l.impulse, steady: l.steady }).collect()
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

    /// Fluxes through all surfaces.
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
    pub fn publish_velocities(&mut self, fluid: &str, t: f64, u: &Vectors) {
        if let Some(wind) = self.winds.iter_mut().find(|wind| wind.fluid == fluid) {
            wind.states.retain(|(time, _)| *time < t);
            wind.states.push((t, Arc::new(u.clone())));
            let old = wind.states.len().saturating_sub(2);
            wind.states.drain(..old);
        }
    }

    /// Published velocities of a fluid.
    pub fn wind(&self, fluid: &str) -> &[(f64, Arc<Vectors>)] {
        self.winds.iter().find(|wind| wind.fluid == fluid).map_or(&[], |wind| &wind.states)
    }

    /// Everything as numbers, for a snapshot: ports in order, fluxes, then the mail.
    pub fn save(&self) -> Vec<f64> {
        let v = |v: Vector| <[f64; 3]>::from(v);
        let mut out = vec![self.ports.len() as f64];
        out.extend(self.ports.iter().flat_map(PortState::numbers));
        out.extend(v(self.posted).into_iter().chain(v(self.delivered)));
        out.extend(self.fluxes.iter().flat_map(|flux| [flux.heat, flux.mass]));
        for letter in &self.mail {
            out.extend([letter.port as f64, f64::from(u8::from(letter.steady))].into_iter().chain(v(letter.impulse)));
        }
        out
    }

    /// The inverse of [`Exchange::save`]; `None` if the numbers are not of this exchange.
    pub fn restore(&mut self, numbers: &[f64]) -> Option<()> {
        let (count, rest) = numbers.split_first()?;
        let n = self.ports.len();
        let fixed = PORT * n + 6 + 2 * self.fluxes.len();
        if *count as usize != n || rest.len() < fixed || !(rest.len() - fixed).is_multiple_of(5) {
            return None;
        }
        let v = |s: &[f64]| Vector { x: s[0], y: s[1], z: s[2] };
        let (ports, rest) = rest.split_at(PORT * n);
        let (sums, rest) = rest.split_at(6);
        let (fluxes, mail) = rest.split_at(2 * self.fluxes.len());
        if mail.chunks_exact(5).any(|m| !(m[0] >= 0.0 && m[0] < n as f64)) {
            return None;
        }
        for (port, s) in self.ports.iter_mut().zip(ports.chunks_exact(PORT)) {
            (port.position, port.velocity, port.acceleration) = (v(&s[..3]), v(&s[3..6]), v(&s[6..9]));
            (port.normal, port.inverse_mass, port.time) = (v(&s[9..12]), s[12], s[13]);
        }
        (self.posted, self.delivered) = (v(&sums[..3]), v(&sums[3..]));
        for (flux, s) in self.fluxes.iter_mut().zip(fluxes.chunks_exact(2)) {
            (flux.heat, flux.mass) = (s[0], s[1]);
        }
        self.mail = mail.chunks_exact(5).map(|m| Letter { port: m[0] as usize, steady: m[1] == 1.0, impulse: v(&m[2..]) }).collect();
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
        exchange.post_steady(b, [0.0, 0.0, 3.0].into());
        let mut copy = exchange.clone();
        copy.take(0);
        copy.enter(surface, 9.0, 9.0);
        assert!(copy.restore(&exchange.save()).is_some() && copy == exchange);
        assert!(copy.restore(&exchange.save()[1..]).is_none());
        let push = |row, impulse: [f64; 3], steady| Push { row, impulse: impulse.into(), steady };
        assert_eq!(exchange.take(1), vec![push(7, [0.0, 2.0, 0.0], false), push(7, [0.0, 0.0, 3.0], true)]);
        assert_eq!(exchange.take(1), vec![]);
        assert_eq!(exchange.take(0), vec![push(5, [1.0, 0.0, 0.0], false)]);
        assert_eq!(exchange.posted, exchange.delivered);
    }
}
