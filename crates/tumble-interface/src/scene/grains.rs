//! Grains.

use super::{Emit, Shape, items_above_zero};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Spheres of a granular material, or rigid unions of spheres, moved by systems of method `grains`: they touch, slide and roll on each other, on colliders and on rigid bodies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grains {
    /// Name in frames and pictures.
    pub name: String,
    /// The system that moves them. Default: the first of method `grains`.
    #[serde(default)]
    pub system: Option<String>,
    /// Radius of a grain, or of a sphere of a clump; the mean if they differ.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// How far radii differ from that, at most, as a part of it: they are uniformly distributed.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 0.5), extend("x-unit" = "1"))]
    pub radius_spread: f64,
    /// Rigid unions of spheres instead of spheres: `"dumbbell"`, `"tetrahedron"`, or `{ spheres = [[0, 0, 0, 1], [1.2, 0, 0, 0.8]] }`. They interlock, so
    /// that heaps are steeper.
    #[serde(default)]
    pub clump: Option<GrainClump>,
    /// Initial positions; of clumps those of the mean of their spheres, weighted by volume. Alternatives: `fill`, `emit`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub position: Vec<[f64; 3]>,
    /// Volumes that are filled at the start, loosely: grains settle to two thirds of the height.
    #[serde(default)]
    pub fill: Vec<GrainFill>,
    /// Grains that are poured in over time, after those that are there from the start.
    #[serde(default)]
    pub emit: Option<Emit>,
    /// Initial rotations of clumps about the x, then the y, then the z axis: one for all, or one for each position. Default: none at positions, any in
    /// fills.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: Vec<[f64; 3]>,
    /// Initial velocity: one for all grains, or one for each position.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: Vec<[f64; 3]>,
    /// Initial angular velocity, along the axis by the right-hand rule: one for all grains, or one for each position.
    #[serde(default)]
    #[schemars(extend("x-unit" = "rad/s"))]
    pub angular_velocity: Vec<[f64; 3]>,
    /// Density of the material of a grain.
    #[serde(default = "stone")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Young's modulus. Real stone has some 5e10 Pa; softer grains flow alike as long as they overlap little, in longer steps. Not with scheme `positions`.
    #[serde(default = "soft")]
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub young: f64,
    /// Poisson's ratio. Not with scheme `positions`.
    #[serde(default = "quarter")]
    #[schemars(range(min = 0.0, max = 0.5), extend("x-unit" = "1"))]
    pub poisson: f64,
    /// Friction coefficient (Coulomb). Of two surfaces that touch, the larger coefficient holds.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub friction: f64,
    /// Largest moment against rolling, over the normal force and the radius: a grain rests on slopes up to that tangent. Angular grains have 0.1 to
    /// 0.5. Of two surfaces that touch, the larger coefficient holds.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub rolling_friction: f64,
    /// The same about the line through both centres.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub twisting_friction: f64,
    /// Speed after a bounce over speed before. Of two surfaces that touch, the larger one holds.
    #[serde(default = "half")]
    #[schemars(range(min = 0.05, max = 1.0), extend("x-unit" = "1"))]
    pub restitution: f64,
    /// Work of adhesion of two touching surfaces: spheres are pulled off by 2 pi cohesion R1 R2/(R1 + R2). Moist sand sticks with about 0.1 N/m.
    /// Not with scheme `positions`.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "J/m²"))]
    pub cohesion: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

impl Grains {
    /// Distance of the places in a fill [m].
    pub fn spacing(&self) -> f64 {
        /// Free space between grains of the largest size, over their diameter.
        const GAP: f64 = 0.1;
        2.0 * self.reach() * (1.0 + GAP)
    }

    /// Radius of the ball that holds the largest grain [m].
    pub fn reach(&self) -> f64 {
        self.radius * (1.0 + self.radius_spread) * self.clump.as_ref().map_or(1.0, GrainClump::reach)
    }

    /// Words that say nothing of hard grains, which are moved by positions, and that are given.
    pub fn words_of_forces(&self) -> impl Iterator<Item = &'static str> {
        let given = [
            ("young", self.young != soft()),
            ("poisson", self.poisson != quarter()),
            ("cohesion", self.cohesion != 0.0),
            ("clump", self.clump.is_some()),
        ];
        given.into_iter().filter_map(|(key, given)| given.then_some(key))
    }

    /// How many spheres there are, at most.
    pub fn count(&self) -> f64 {
        let of = |fill: &GrainFill| fill.places(self.spacing()).iter().product::<f64>().min(fill.count.map_or(f64::INFINITY, f64::from));
        let each = self.clump.as_ref().map_or(1, |clump| clump.spheres().len());
        let emitted = self.emit.as_ref().map_or(0.0, |emit| f64::from(emit.count));
        each as f64 * (self.position.len() as f64 + self.fill.iter().map(of).sum::<f64>() + emitted)
    }
}

/// A rigid union of spheres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum GrainClump {
    /// Two spheres that touch.
    Dumbbell,
    /// Four spheres that touch each other.
    Tetrahedron,
    /// These spheres, each x, y, z and radius over the `radius` of the grains, of one density; where they overlap, matter counts once.
    Spheres(#[schemars(extend("x-unit" = "1"))] Vec<[f64; 4]>),
}

impl GrainClump {
    /// Its spheres, x, y, z and radius, over the `radius` of the grains, about their mean, weighted by volume.
    pub fn spheres(&self) -> Vec<[f64; 4]> {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let spheres = match self {
            Self::Dumbbell => vec![[-1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]],
            Self::Tetrahedron => [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
                .map(|[x, y, z]| [half * x, half * y, half * z, 1.0])
                .to_vec(),
            Self::Spheres(spheres) => spheres.clone(),
        };
        let volume: f64 = spheres.iter().map(|s| s[3].powi(3)).sum();
        let mean = [0, 1, 2].map(|a| spheres.iter().map(|s| s[3].powi(3) * s[a]).sum::<f64>() / volume);
        spheres.iter().map(|[x, y, z, r]| [x - mean[0], y - mean[1], z - mean[2], *r]).collect()
    }

    /// How far it reaches from that mean, over the `radius` of the grains.
    fn reach(&self) -> f64 {
        self.spheres().iter().map(|[x, y, z, r]| (x * x + y * y + z * z).sqrt() + r).reduce(f64::max).unwrap_or(1.0)
    }
}

/// A volume that is filled with grains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GrainFill {
    /// Centre.
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Edges of the box around it, which no grain leaves.
    #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
    pub size: [f64; 3],
    /// Its shape.
    #[serde(default)]
    pub shape: FillShape,
    /// Only grains that lie wholly in this solid, too, such as a closed mesh.
    #[serde(default)]
    pub within: Option<Shape>,
    /// How many grains, from the bottom up. Default: as many as fit.
    #[serde(default)]
    #[schemars(range(min = 1, max = 100_000_000))]
    pub count: Option<u32>,
}

impl GrainFill {
    /// Places along each axis, of a box.
    pub fn places(&self, spacing: f64) -> [f64; 3] {
        // A box of exactly so many diameters holds them.
        self.size.map(|size| (size / spacing * (1.0 + 1e-9)).floor().max(0.0))
    }
}

/// Shape of a fill.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FillShape {
    /// A box.
    #[default]
    Box,
    /// A cylinder along z, or an elliptic one.
    Cylinder,
    /// A ball, or an ellipsoid.
    Sphere,
}

/// Settings of the `grains` method.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Granular {
    /// How contacts act.
    pub scheme: GrainScheme,
    /// Force of a contact, with scheme `forces`.
    pub law: NormalLaw,
}

/// How contacts of grains act.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GrainScheme {
    /// By forces of springs: grains yield as their material does, in steps that resolve each bounce.
    #[default]
    Forces,
    /// By positions: grains are hard, and moved so far that they do not enter each other. In steps of at most 0.009 sqrt(2 R/g) unless given, 0.5 ms at a
    /// radius R of 15 mm, however stiff grains are; a preview of heaps and flows.
    Positions,
}

impl GrainScheme {
    /// The word in the scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Forces => "forces",
            Self::Positions => "positions",
        }
    }
}

/// How the force of a contact follows from the overlap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NormalLaw {
    /// As of elastic spheres (Hertz; along the surface Mindlin).
    #[default]
    Hertz,
    /// Proportional to it: bounces take the same time at any speed.
    Linear,
}

impl NormalLaw {
    /// The word in the scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hertz => "hertz",
            Self::Linear => "linear",
        }
    }
}

fn stone() -> f64 {
    2500.0
}

fn soft() -> f64 {
    1e7
}

fn quarter() -> f64 {
    0.25
}

fn half() -> f64 {
    0.5
}
