//! What a run writes, from where it is seen, and what it must keep.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a run writes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// Columns of the frames, of each object that has them; the last section of this page lists them.
    pub columns: Vec<String>,
    /// Write `film.mp4`.
    pub film: bool,
    /// Write `scene.usda` with a layer per frame.
    pub usd: bool,
    /// Write `ply/`: the particles of each object at each frame.
    pub ply: bool,
    /// Write `volumes/`: what lies on the grid of each object, at each frame.
    pub vdb: bool,
    /// Write `energy.png`.
    pub plot: bool,
    /// Frames of which to write a still picture.
    pub stills: Vec<u32>,
    /// Frames between checkpoints; a run that is stopped goes on from the last one.
    #[schemars(range(min = 1))]
    pub checkpoint: u32,
}

impl Default for Output {
    fn default() -> Self {
        Self {
            columns: ["position", "velocity", "density", "temperature"].map(String::from).into(),
            film: false,
            usd: false,
            ply: false,
            vdb: false,
            plot: true,
            stills: Vec::new(),
            checkpoint: 10,
        }
    }
}

/// From where pictures are taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Where it stands; without it, far enough to see everything.
    #[schemars(extend("x-unit" = "m"))]
    pub position: Option<[f64; 3]>,
    /// What it looks at; without it, the middle of everything.
    #[schemars(extend("x-unit" = "m"))]
    pub target: Option<[f64; 3]>,
    /// Horizontal angle of view.
    #[schemars(extend("x-unit" = "°", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 170.0))]
    pub view_angle: f64,
    /// Width and height of pictures.
    #[schemars(inner(range(min = 16, max = 8192)), extend("x-unit" = "pixel"))]
    pub resolution: [u32; 2],
    /// How pictures are lit.
    pub look: Look,
}

impl Default for Camera {
    fn default() -> Self {
        Self { position: None, target: None, view_angle: 35.0, resolution: [640, 360], look: Look::Studio }
    }
}

/// How pictures are lit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Look {
    /// Daylight on a bright ground.
    #[default]
    Studio,
    /// Particles glow in the dark: stars, sparks, fireworks.
    Night,
}

/// Bounds that every frame must keep.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Expect {
    /// Longest link, piece of a rod or edge of a membrane or fabric over its rest length.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub max_stretch: Option<f64>,
    /// Deepest mass inside a collider or its thickness, of those that are not held.
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub max_penetration: Option<f64>,
    /// Edges of soft surfaces that pass through triangles of their system; they are counted with or without `self_contact`. With it, edges and
    /// triangles of colliders with `edges` count, too.
    pub max_intersections: Option<u64>,
    /// Fastest mass.
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub max_speed: Option<f64>,
    /// |E - E_0| over the largest kinetic or potential energy so far.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_energy_drift: Option<f64>,
    /// Growth of the energy over the largest kinetic or potential energy so far.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_energy_growth: Option<f64>,
    /// Kinetic energy at the last frame.
    #[schemars(range(min = 0.0), extend("x-unit" = "J"))]
    pub max_final_kinetic: Option<f64>,
    /// |m - m_0| over the mass at the start.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_mass_error: Option<f64>,
    /// |P - P_0|, how far the momentum is from that at the start.
    #[schemars(range(min = 0.0), extend("x-unit" = "kg m/s"))]
    pub max_momentum_change: Option<f64>,
    /// |L - L_0|, how far the angular momentum about the origin is from that at the start.
    #[schemars(range(min = 0.0), extend("x-unit" = "kg m²/s"))]
    pub max_angular_momentum_change: Option<f64>,
    /// |V - V_0| over the volume inside closed surfaces at the start.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_volume_error: Option<f64>,
    /// Largest divergence of the velocity of gases in any cell; of one that burns, with what fire swells.
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    pub max_divergence: Option<f64>,
    /// Heat that bodies have gained less heat that came in, over the largest of both so far.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_heat_error: Option<f64>,
    /// Links that have broken by the last frame.
    pub broken_links: Option<u32>,
    /// Values of single masses at the last frame.
    pub probe: Vec<Probe>,
}

/// A value of one mass or cell at the last frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Name of the object.
    pub object: String,
    /// Column of the frame.
    #[serde(default = "position")]
    pub column: String,
    /// Index of the mass within the object, or of the cell within its grid, the first axis fastest.
    pub index: u32,
    /// The value expected; of a single number the first counts.
    pub value: [f64; 3],
    /// How far off it may be, as a distance.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub tolerance: f64,
}

fn position() -> String {
    "position".into()
}
