//! The scale of a system's energy: an energy that grows far beyond it is an explosion.

use tumble_interface::engine::Ledger;

/// Energies with which a growth of the energy is compared.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scale {
    /// Energy at the start [J].
    pub start: f64,
    /// Potential energy of external forces at the start [J].
    pub external: f64,
    /// Largest kinetic, elastic or external change of energy in any two good frames that follow each other [J].
    pub size: f64,
    /// That of the last good frame [J]: a peak that one frame happens to see is no scale.
    pub last: f64,
}

impl Scale {
    /// The scale of a system that starts with this ledger, which could gain `fall` [J] by falling through its own height.
    /// Energies up to `noise` [J] are no scale.
    pub fn new(ledger: &Ledger, fall: f64, noise: f64) -> Self {
        let mut scale = Self { start: ledger.energy(), external: ledger.external, size: fall, last: ledger.kinetic.max(ledger.elastic) };
        scale.widen(scale.last, noise);
        scale
    }

    /// Masses come with kinetic energy and potential energy in gravity [J], and are a scale from now on; or go, with a sign.
    pub fn count(&mut self, sign: f64, kinetic: f64, potential: f64) {
        self.start += sign * (kinetic + potential);
        self.external += sign * potential;
        self.size += (sign * (kinetic + potential.abs())).max(0.0);
    }

    /// Loses a tenth.
    pub fn fade(&mut self) {
        self.size *= 0.9;
    }

    /// Grows to at least another scale.
    pub fn keep(&mut self, other: Self) {
        self.size = self.size.max(other.size);
    }

    fn widen(&mut self, energy: f64, noise: f64) {
        if energy > noise {
            self.size = self.size.max(energy);
        }
    }

    /// Takes the energy of a good frame: widens to it, or to that of the frame before if that was less.
    pub fn take(&mut self, energy: f64, noise: impl Fn() -> f64) {
        let held = energy.min(self.last);
        self.last = energy;
        if held > self.size {
            self.widen(held, noise());
        }
    }

    pub fn numbers(self) -> [f64; 4] {
        [self.start, self.external, self.size, self.last]
    }

    pub fn from_numbers(numbers: &[f64]) -> Option<Self> {
        match numbers {
            [start, external, size, last] => Some(Self { start: *start, external: *external, size: *size, last: *last }),
            _ => None,
        }
    }

    /// Growth of the energy over its scale; `None` while there is no scale.
    pub fn growth(self, ledger: &Ledger) -> Option<f64> {
        (self.size > 0.0).then(|| (ledger.energy() - self.start) / self.size)
    }
}
