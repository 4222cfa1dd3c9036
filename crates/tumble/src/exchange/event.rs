//! Events: what happens to particles within an interval, for those who ask.

use crate::geometry::Vector;
use tumble_interface::scene::Cause;

/// What has happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Happening {
    /// A particle has met a solid.
    Contact,
    /// It has died.
    Death(Cause),
}

/// Something that has happened to a particle of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// What.
    pub what: Happening,
    /// The particle.
    pub id: u32,
    /// When [s].
    pub time: f64,
    /// Where [m].
    pub position: Vector,
    /// Velocity of the particle after it [m/s].
    pub velocity: Vector,
    /// Off the solid that it met; else that of the velocity.
    pub normal: Vector,
    /// Age of the particle then [s].
    pub age: f64,
}

/// Events of an object that somebody asks for, those of the last turn of its system. They are in no snapshot: who asks has its turn after.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Heard {
    pub object: String,
    /// Whether contacts are asked for, too.
    pub contacts: bool,
    pub events: Vec<Event>,
}
