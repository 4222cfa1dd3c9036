//! Crowds, and the plans of the floors on which they walk.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The plan of a floor at z = 0, on which people of a `crowd` walk. A scene with a crowd has one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Name in frames and pictures.
    pub name: String,
    /// The system that it belongs to. Default: the first of method `crowd`.
    #[serde(default)]
    pub system: Option<String>,
    /// Metres in a unit of its coordinates: 0.001 for a plan in millimetres. Holds for walls, doors, exits, and the places of all
    /// that is on it.
    #[serde(default = "one")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
    /// Walls, each a line through points x, y; a wall that ends where it begins is an outline. Walls have no thickness; bodies keep off them by their
    /// radius.
    #[schemars(extend("x-unit" = "m"))]
    pub walls: Vec<Vec<[f64; 2]>>,
    /// Lines across openings, where crossings are counted.
    #[serde(default)]
    pub door: Vec<Gate>,
    /// Lines that people leave by.
    #[serde(default)]
    pub exit: Vec<Gate>,
    /// Places that people may have as goals.
    #[serde(default)]
    pub waypoint: Vec<Waypoint>,
    /// Floor that is stairs.
    #[serde(default)]
    pub stairs: Vec<Stairs>,
    /// Floor that slopes.
    #[serde(default)]
    pub ramp: Vec<Ramp>,
    /// Lines where floors that are drawn side by side go on at each other.
    #[serde(default)]
    pub link: Vec<FloorLink>,
    /// Red, green and blue of walls in pictures, 0 to 1, in linear light.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// A line from one jamb of an opening to the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// Name, of which a plan has each once.
    pub name: String,
    /// One jamb, x and y.
    #[schemars(extend("x-unit" = "m"))]
    pub from: [f64; 2],
    /// The other.
    #[schemars(extend("x-unit" = "m"))]
    pub to: [f64; 2],
    /// When it opens; it is closed before. Ways are planned anew whenever a door or an exit opens or closes.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub opens: Option<f64>,
    /// When it closes; with `opens` after that, it is open at the start, and again from then. Whoever stands in it gets out.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub closes: Option<f64>,
}

/// Two lines on a plan that are one place, such as the head of a flight of stairs, drawn on its lower floor, and the landing on the upper one.
/// Whoever crosses one goes on beyond the other: laid on each other end on end, the two floors continue each other, each on its own side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FloorLink {
    /// Name, of which a plan has each once, doors included.
    pub name: String,
    /// One line, from jamb to jamb, each x and y.
    #[schemars(extend("x-unit" = "m"))]
    pub from: [[f64; 2]; 2],
    /// The other, as long as it, whose ends lie on those of the first one in the same order.
    #[schemars(extend("x-unit" = "m"))]
    pub to: [[f64; 2]; 2],
}

/// A place on the floor that people may have as a goal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    /// Name, of which a plan has each once, doors included.
    pub name: String,
    /// Where it is, x and y.
    #[schemars(extend("x-unit" = "m"))]
    pub at: [f64; 2],
    /// How near people get to have reached it.
    #[serde(default = "near")]
    #[schemars(range(min = 0.1, max = 2.0), extend("x-unit" = "m"))]
    pub radius: f64,
}

/// Floor that is stairs, on which people are slower.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stairs {
    /// Where they are in plan: two corners of a rectangle, or the corners of a polygon, x and y.
    #[schemars(extend("x-unit" = "m"))]
    pub area: Vec<[f64; 2]>,
    /// The direction in which they rise, x and y, of any length.
    #[schemars(extend("x-unit" = "1"))]
    pub up: [f64; 2],
    /// Speed upward, in plan, over that on the level. Default: Weidmann's 0.610 m/s over 1.34 m/s.
    #[serde(default = "upward")]
    #[schemars(range(min = 0.05, max = 1.0), extend("x-unit" = "1"))]
    pub up_factor: f64,
    /// Speed downward, in plan, over that on the level. Default: Weidmann's 0.694 m/s over 1.34 m/s.
    #[serde(default = "downward")]
    #[schemars(range(min = 0.05, max = 1.0), extend("x-unit" = "1"))]
    pub down_factor: f64,
}

/// Floor that slopes, on which people are slower upward, by Tobler's function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Where it is in plan: two corners of a rectangle, or the corners of a polygon, x and y.
    #[schemars(extend("x-unit" = "m"))]
    pub area: Vec<[f64; 2]>,
    /// The direction in which it rises, x and y, of any length.
    #[schemars(extend("x-unit" = "1"))]
    pub up: [f64; 2],
    /// Its rise over its length in plan.
    #[schemars(range(min = 0.0, max = 0.5), extend("x-unit" = "1"))]
    pub slope: f64,
}

/// Which of their exits people take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// The nearest, by the length of the way.
    #[default]
    Distance,
    /// The one that they would be out of first, by the way and by the queue before it; decided anew every second.
    Quickest,
}

/// Measured people.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Ages of mean 50 and deviation 20 years, from 10 to 85, and the speed of each age, by the guideline of RiMEA.
    Rimea,
    /// Speeds of mean 1.34 m/s and deviation 0.26 m/s, by Weidmann.
    Weidmann,
}

/// The corners of an area; of a rectangle, given by two, all four.
pub fn corners(area: &[[f64; 2]]) -> Vec<[f64; 2]> {
    match area[..] {
        [[a, b], [c, d]] => vec![[a, b], [c, b], [c, d], [a, d]],
        _ => area.to_vec(),
    }
}

/// Area of a polygon [m²].
pub fn floor(p: &[[f64; 2]]) -> f64 {
    let turn = |i: usize| p[i][0] * p[(i + 1) % p.len()][1] - p[i][1] * p[(i + 1) % p.len()][0];
    0.5 * (0..p.len()).map(turn).sum::<f64>().abs()
}

/// People who walk to an exit and leave, moved by systems of method `crowd`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Crowd {
    /// Name in frames and pictures.
    pub name: String,
    /// The system that moves them. Default: the first of method `crowd`.
    #[serde(default)]
    pub system: Option<String>,
    /// Where they are at the start: two corners of a rectangle, or the corners of a polygon, x and y.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub area: Vec<[f64; 2]>,
    /// How many there are. Alternatives: `density`, `position`, `arrivals`.
    #[serde(default)]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub count: Option<u32>,
    /// How many there are on an area.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1/m²", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// How many of them come in a second, to free places of their area, at random times; without it all are there at the start.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1/s", "exclusiveMinimum" = 0.0))]
    pub rate: Option<f64>,
    /// When each of them comes to a free place of the area.
    #[serde(default)]
    #[schemars(inner(range(min = 0.0)), extend("x-unit" = "s"))]
    pub arrivals: Vec<f64>,
    /// Initial positions, x and y, instead of an area.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub position: Vec<[f64; 2]>,
    /// Names of doors and waypoints that they go to in this order, before they go to an exit.
    #[serde(default)]
    pub goals: Vec<String>,
    /// Names of exits that they may take. Default: all.
    #[serde(default)]
    pub exit: Vec<String>,
    /// Which of the exits they take.
    #[serde(default)]
    pub choice: Choice,
    /// Speeds as measured, instead of `speed`.
    #[serde(default)]
    pub preset: Option<Preset>,
    /// Lowest and highest age in years, between which ages are uniformly distributed, with `preset = "rimea"`.
    #[serde(default)]
    #[schemars(inner(range(min = 3.0, max = 90.0)), extend("x-unit" = "1"))]
    pub age: Option<[f64; 2]>,
    /// Radius of a body; the mean if they differ. Bodies never overlap.
    #[serde(default = "radius")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.05, "maximum" = 1.0))]
    pub radius: f64,
    /// How far radii differ from that, at most, as a part of it: they are uniformly distributed.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.5), extend("x-unit" = "1"))]
    pub radius_spread: f64,
    /// Standard deviation of radii instead of that: they are normally distributed, cut at two of it.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub radius_deviation: f64,
    /// Mean desired speed.
    #[serde(default = "speed")]
    #[schemars(extend("x-unit" = "m/s", "exclusiveMinimum" = 0.0, "maximum" = 10.0))]
    pub speed: f64,
    /// Standard deviation of desired speeds, which are normally distributed, cut at two of it and at a tenth of the mean. Default:
    /// 0.26 m/s.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub speed_deviation: Option<f64>,
    /// How far desired speeds differ from the mean instead of that, at most, as a part of it: they are uniformly distributed.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.9), extend("x-unit" = "1"))]
    pub speed_spread: Option<f64>,
    /// When the first of them may start, after the start or after its arrival.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub reaction: f64,
    /// How much later the last may: reaction times are uniformly distributed.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub reaction_spread: f64,
    /// Standard deviation of reaction times instead of that: they are normally distributed around `reaction`, cut at two of it and at 0.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub reaction_deviation: f64,
    /// How long people leave a trail behind them in pictures.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub trail: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

impl Crowd {
    /// The corners of its area.
    pub fn polygon(&self) -> Vec<[f64; 2]> {
        corners(&self.area)
    }

    /// Area of that polygon [m²].
    pub fn floor(&self) -> f64 {
        floor(&self.polygon())
    }

    /// How many people there are.
    pub fn people(&self) -> f64 {
        let by_density = self.density.map_or(0.0, |density| (density * self.floor()).round());
        (self.position.len() + self.arrivals.len()) as f64 + self.count.map_or(by_density, f64::from)
    }
}

/// How people choose their velocities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Steering {
    /// Of first order: a heading that turns away from whoever is ahead, and a speed that follows from the room there.
    #[default]
    CollisionFreeSpeed,
    /// Forces on masses: to the desired velocity, away from others, and of contact. Sub-steps of at most 0.02 s unless given.
    SocialForce,
    /// Of first order: a direction that avoids where others will be, and a speed that follows from the room ahead.
    AnticipationVelocity,
    /// Optimal reciprocal collision avoidance: of the velocities that keep clear of all, the one nearest to the desired one.
    Orca,
}

/// Settings of the `crowd` method.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Walking {
    /// Model of how people walk.
    pub model: Steering,
    /// Time gap that people keep to who is ahead: the slope of distance over speed; of `collision_free_speed` and `anticipation_velocity`. Default:
    /// 0.65 s and 0.5 s.
    #[schemars(range(min = 0.1, max = 10.0), extend("x-unit" = "s"))]
    pub time_gap: Option<f64>,
    /// Distance between bodies at which people stand, of the same. Default: 0.04 m.
    #[schemars(range(min = 0.0, max = 2.0), extend("x-unit" = "m"))]
    pub buffer: Option<f64>,
    /// Mass of a person, of `social_force`, and in blows by objects of `body`. Default: 80 kg.
    #[schemars(range(min = 10.0, max = 1000.0), extend("x-unit" = "kg"))]
    pub mass: Option<f64>,
    /// Time in which velocities relax to desired ones, of `social_force`. Default: 0.5 s.
    #[schemars(range(min = 0.1, max = 10.0), extend("x-unit" = "s"))]
    pub relaxation: Option<f64>,
    /// For which time velocities keep clear of others, of `orca`. Default: 2 s.
    #[schemars(range(min = 0.1, max = 10.0), extend("x-unit" = "s"))]
    pub time_horizon: Option<f64>,
    /// Who gets faster than this by the blow of a `body` falls. Default: 1 m/s.
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub fall_speed: Option<f64>,
    /// How long they lie. Default: 5 s.
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub rise_time: Option<f64>,
    /// Name of a gas in whose smoke people walk: they are slower, and see less far.
    pub smoke: Option<String>,
    /// Extinction of light by that smoke, per mass. Default: 8700 m²/kg, of soot.
    #[schemars(extend("x-unit" = "m²/kg", "exclusiveMinimum" = 0.0))]
    pub extinction: Option<f64>,
    /// Energy of a blow that injures: they never rise. Default: 79 J.
    #[schemars(extend("x-unit" = "J", "exclusiveMinimum" = 0.0))]
    pub injury_energy: Option<f64>,
}

fn one() -> f64 {
    1.0
}

fn radius() -> f64 {
    0.18
}

fn speed() -> f64 {
    1.34
}

fn near() -> f64 {
    1.0
}

fn upward() -> f64 {
    0.455
}

fn downward() -> f64 {
    0.518
}
