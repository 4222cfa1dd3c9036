//! Output, camera and expectations of a run.

use super::{Animated, AnimatedVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Output of a run.
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
    /// Write `volumes/`: the grids of each object at each frame.
    pub vdb: bool,
    /// Write `energy.png`.
    pub plot: bool,
    /// Frames to write as still pictures.
    pub stills: Vec<u32>,
    /// Frames between checkpoints; a stopped run resumes from the last one.
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

/// Camera of pictures, upright at all times. It may move: position, target and angle of view are taken at the time of each frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Position. Default: far enough away to see everything.
    #[schemars(extend("x-unit" = "m"))]
    pub position: Option<AnimatedVector>,
    /// Point that it looks at, never the position. Default: the centre of the scene.
    #[schemars(extend("x-unit" = "m"))]
    pub target: Option<AnimatedVector>,
    /// Horizontal angle of view, above 0 and below 170.
    #[schemars(extend("x-unit" = "°", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 170.0))]
    pub view_angle: Animated,
    /// Width and height of pictures.
    #[schemars(inner(range(min = 16, max = 8192)), extend("x-unit" = "pixel"))]
    pub resolution: [u32; 2],
    /// Lighting of pictures.
    pub look: Look,
}

impl Default for Camera {
    fn default() -> Self {
        Self { position: None, target: None, view_angle: 35.0.into(), resolution: [640, 360], look: Look::Studio }
    }
}

/// Lighting of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Look {
    /// Daylight on a bright ground.
    #[default]
    Studio,
    /// Particles glow in the dark: stars, sparks, fireworks.
    Night,
}

/// Bounds on every frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Expect {
    /// Largest stretch, length over rest length, of links, rod segments and edges of membranes and fabrics.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub max_stretch: Option<f64>,
    /// Largest depth of a free mass inside a collider or its thickness.
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub max_penetration: Option<f64>,
    /// Number of edges of soft surfaces that pass through triangles of their system, counted with or without `self_contact`. With it, edges and
    /// triangles of colliders with `edges` count, too.
    pub max_intersections: Option<u64>,
    /// Fastest mass.
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub max_speed: Option<f64>,
    /// |E - E_0| relative to the largest kinetic or potential energy so far.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_energy_drift: Option<f64>,
    /// Growth of the energy relative to the largest kinetic or potential energy so far.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_energy_growth: Option<f64>,
    /// Kinetic energy at the last frame.
    #[schemars(range(min = 0.0), extend("x-unit" = "J"))]
    pub max_final_kinetic: Option<f64>,
    /// |m - m_0| relative to the initial mass.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_mass_error: Option<f64>,
    /// |P - P_0|, the change of momentum since the start.
    #[schemars(range(min = 0.0), extend("x-unit" = "kg m/s"))]
    pub max_momentum_change: Option<f64>,
    /// |L - L_0|, the change of angular momentum about the origin since the start.
    #[schemars(range(min = 0.0), extend("x-unit" = "kg m²/s"))]
    pub max_angular_momentum_change: Option<f64>,
    /// |V - V_0| relative to the initial volume inside closed surfaces.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_volume_error: Option<f64>,
    /// Largest divergence of the velocity of gases in any cell, including expansion by fire.
    #[schemars(range(min = 0.0), extend("x-unit" = "1/s"))]
    pub max_divergence: Option<f64>,
    /// Heat gained by bodies less heat supplied, relative to the largest of both so far.
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub max_heat_error: Option<f64>,
    /// Number of broken links at the last frame.
    pub broken_links: Option<u32>,
    /// Number of people on the floor at the last frame: 0 if all must have left.
    pub people: Option<u32>,
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
    /// Expected value; for a scalar column only the first number counts.
    pub value: [f64; 3],
    /// Largest allowed distance from the value.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub tolerance: f64,
}

fn position() -> String {
    "position".into()
}
