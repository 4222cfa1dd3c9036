//! How people choose their velocities: models by one word, a file each. Whatever they choose, contacts cut it, (crowds.5).

mod anticipation_velocity;
mod collision_free_speed;
mod orca;
mod social_force;

pub use anticipation_velocity::AnticipationVelocity;
pub use collision_free_speed::CollisionFreeSpeed;
pub use orca::Orca;
pub use social_force::SocialForce;

use super::around::Around;
use super::plan::Point;

/// What somebody is about to do.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    /// Velocity [m/s].
    pub v: Point,
    /// Heading at the end of the step [rad].
    pub heading: f64,
}

/// A model with its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    /// Speed from the room ahead.
    CollisionFreeSpeed(CollisionFreeSpeed),
    /// Forces on masses.
    SocialForce(SocialForce),
    /// A direction that avoids where others will be.
    AnticipationVelocity(AnticipationVelocity),
    /// The best of the velocities that keep clear.
    Orca(Orca),
}

impl Model {
    /// How far people of this speed and radius look [m].
    pub fn reach(&self, speed: f64, radius: f64) -> f64 {
        match self {
            Self::CollisionFreeSpeed(model) => model.reach(speed, radius),
            Self::SocialForce(_) => social_force::REACH,
            Self::AnticipationVelocity(model) => model.reach(speed, radius),
            Self::Orca(model) => model.reach(speed, radius),
        }
    }

    /// Longest step, unless given [s].
    pub fn step(&self) -> f64 {
        if matches!(self, Self::SocialForce(_)) { social_force::STEP } else { 0.05 }
    }

    /// By which part of their radii bodies give way in contact.
    pub fn soft(&self) -> f64 {
        if matches!(self, Self::SocialForce(_)) { social_force::SOFT } else { 0.0 }
    }

    /// What somebody does in a step h [s] who wants to go in a direction.
    pub fn motion(&self, around: &Around<'_>, wanted: Point, h: f64) -> Motion {
        match self {
            Self::CollisionFreeSpeed(model) => model.motion(around, wanted, h),
            Self::SocialForce(model) => model.motion(around, wanted, h),
            Self::AnticipationVelocity(model) => model.motion(around, wanted, h),
            Self::Orca(model) => model.motion(around, wanted, h),
        }
    }
}
