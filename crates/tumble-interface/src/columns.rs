//! Every column that leaves the engine, described once: units of frames and files, what is shown around zero, what lies on faces.

use serde::Serialize;

/// What a row of a column belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// The whole object.
    Object,
    /// A mass, a tracer or a vertex.
    Mass,
    /// A link between two of them.
    Link,
    /// A triangle between three.
    Triangle,
    /// A frame: the material axes of a piece of a rod.
    Frame,
    /// A gate of a plan: its doors, then its exits.
    Gate,
    /// A cell of a grid.
    Cell,
    /// A face between two cells.
    Face,
}

/// A column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Described {
    /// As in `output.columns` and in files.
    pub name: &'static str,
    /// SI unit, `1` for a pure number.
    pub unit: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// What its rows belong to; the same name may mean the same of masses and of cells.
    pub places: &'static [Place],
    /// Numbers a row; on a grid a vector has as many as the grid has axes.
    pub width: usize,
    /// Whether its numbers may be less than zero.
    pub signed: bool,
    /// Whether frames have it; else it is part of what does not change.
    pub in_frames: bool,
    /// Whether `output.columns` must ask for it; others are there wherever their object has them.
    pub asked: bool,
    /// Whether it is an amount of matter in a volume, which pictures show as smoke.
    pub fog: bool,
}

const ASKED: Described =
    Described { name: "", unit: "1", doc: "", places: &[Place::Mass], width: 1, signed: true, in_frames: true, asked: true, fog: false };
const VECTOR: Described = Described { width: 3, ..ASKED };
const CELLS: Described = Described { places: &[Place::Cell], ..ASKED };
const ALWAYS: Described = Described { asked: false, signed: false, ..ASKED };
const STATIC: Described = Described { in_frames: false, ..ALWAYS };
const GATES: Described = Described { places: &[Place::Gate], ..ALWAYS };
const GRID: Described = Described { places: &[Place::Object], ..STATIC };

/// All of them.
pub const COLUMNS: &[Described] = &[
    Described { name: "position", unit: "m", doc: "Where it is.", ..VECTOR },
    Described {
        name: "velocity",
        unit: "m/s",
        doc: "Its velocity; on a grid the mean at cells.",
        places: &[Place::Mass, Place::Cell],
        ..VECTOR
    },
    Described { name: "orientation", doc: "Quaternion of a rod's material axes: x, y, z, w.", places: &[Place::Frame], width: 4, ..ASKED },
    Described {
        name: "angular_velocity",
        unit: "rad/s",
        doc: "How they turn: frames in their own axes, rigid bodies in those of the world.",
        places: &[Place::Frame, Place::Mass],
        ..VECTOR
    },
    Described { name: "link_strain", doc: "Lengthening over rest length; nan of what is broken.", places: &[Place::Link], ..ASKED },
    Described {
        name: "density",
        unit: "kg/m³",
        doc: "Mass of smoke, or of a compressible gas, in a volume.",
        signed: false,
        fog: true,
        ..CELLS
    },
    Described { name: "temperature", unit: "K", doc: "Absolute temperature.", signed: false, ..CELLS },
    Described { name: "fuel", unit: "kg/m³", doc: "Mass of fuel that has not burnt, in a volume.", signed: false, fog: true, ..CELLS },
    Described { name: "flux", unit: "W/m²", doc: "Heat that is conducted through an area.", width: 3, ..CELLS },
    Described {
        name: "pressure",
        unit: "Pa",
        doc: "Pressure; of a gas, and at the particles of a liquid on a grid, that of the last solve, in a liquid of particles the mean over \
              the last interval.",
        places: &[Place::Cell, Place::Mass],
        ..CELLS
    },
    Described { name: "vorticity", unit: "1/s", doc: "Curl of the velocity: in a plane the component across it, in space three.", ..CELLS },
    Described {
        name: "distance",
        unit: "m",
        doc: "Distance from the surface of a liquid, below zero in it, in cells of an object `NAME.cells`, which then have `velocity`, too; 1.5 \
              cells where it is farther.",
        ..CELLS
    },
    Described { name: "divergence", unit: "1/s", doc: "Divergence of the velocity.", ..CELLS },
    Described { name: "velocity_x", unit: "m/s", doc: "Velocity along x, on the faces across x.", places: &[Place::Face], ..CELLS },
    Described { name: "velocity_y", unit: "m/s", doc: "Velocity along y, on the faces across y.", places: &[Place::Face], ..CELLS },
    Described { name: "velocity_z", unit: "m/s", doc: "Velocity along z, on the faces across z.", places: &[Place::Face], ..CELLS },
    Described {
        name: "force",
        unit: "N",
        doc: "Force of gases, by their last pressure, and of liquids of particles, the mean over the last interval, on each solid in them; \
              of joints, on the first body, and on the second or the world.",
        places: &[Place::Object, Place::Mass],
        ..VECTOR
    },
    Described { name: "id", doc: "Number of an emitted particle, which it keeps.", ..ALWAYS },
    Described { name: "age", unit: "s", doc: "Time since its birth.", ..ALWAYS },
    Described { name: "color", doc: "Red, green and blue.", width: 3, ..ALWAYS },
    Described { name: "fallen", doc: "Of people: 0 on their feet, 1 knocked down, 2 injured.", ..ALWAYS },
    Described { name: "crossings", doc: "Who has crossed a gate so far: from its left to its right, and back.", width: 2, ..GATES },
    Described { name: "crossing_times", unit: "s", doc: "When a gate was crossed first and last; nan before.", width: 2, ..GATES },
    Described {
        name: "gate_density",
        unit: "1/m²",
        doc: "People within 1 m of a gate and in sight of it, over the floor there, on the side where there are more.",
        ..GATES
    },
    Described {
        name: "gate_waiting",
        unit: "s",
        doc: "Time at less than half the desired speed, of all people together, in the queue of a gate so far.",
        ..GATES
    },
    Described {
        name: "gate_lost",
        unit: "s",
        doc: "Time lost against walking freely, of all people together, in the queue of a gate so far.",
        signed: true,
        ..GATES
    },
    Described {
        name: "translation",
        unit: "m",
        doc: "Shift of a moving collider: x = turn p + translation.",
        places: &[Place::Object],
        signed: true,
        width: 3,
        ..ALWAYS
    },
    Described {
        name: "turn",
        doc: "Quaternion of a moving collider, or of each rigid body: x, y, z, w.",
        places: &[Place::Object, Place::Mass],
        signed: true,
        width: 4,
        ..ALWAYS
    },
    Described { name: "radius", unit: "m", doc: "Radius in pictures, of all or of each.", places: &[Place::Object, Place::Mass], ..STATIC },
    Described { name: "mass", unit: "kg", doc: "Mass.", ..STATIC },
    Described {
        name: "vertices",
        unit: "m",
        doc: "Corners of the mesh of a rigid body, in its own axes.",
        places: &[Place::Object],
        signed: true,
        width: 3,
        ..STATIC
    },
    Described { name: "pinned", doc: "Indices of masses that stay where they are.", ..STATIC },
    Described { name: "triangles", doc: "Indices of the corners of each triangle.", places: &[Place::Triangle], width: 3, ..STATIC },
    Described {
        name: "texture",
        doc: "Places of the corners of each triangle in a texture: u, v of each.",
        places: &[Place::Triangle],
        signed: true,
        width: 6,
        ..STATIC
    },
    Described { name: "links", doc: "Indices of the ends of each link.", places: &[Place::Link], width: 2, ..STATIC },
    Described { name: "curve", doc: "Indices of the masses along a curve, in order.", ..STATIC },
    Described { name: "curve_points", doc: "Masses of each curve, where there are many.", ..GRID },
    Described { name: "grid_cells", doc: "Cells along each axis.", ..GRID },
    Described { name: "grid_spacing", unit: "m", doc: "Side of a cell.", ..GRID },
    Described { name: "grid_origin", unit: "m", doc: "Lowest corner.", signed: true, ..GRID },
    Described { name: "grid_flat", doc: "Axis across a plane; 3 in space.", ..GRID },
];

/// The column of this name.
pub fn of(name: &str) -> Option<&'static Described> {
    COLUMNS.iter().find(|column| column.name == name)
}
