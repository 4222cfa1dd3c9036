//! How objects are drawn, said once for pictures, USD and the browser. The engine says the [`Look`] of each object of a scene; forms and what
//! all fronts draw alike are described here.

use crate::kinds::Matter;
use serde::Serialize;

/// Red, green and blue, 0 to 1, in linear light.
pub type Rgb = [f64; 3];

/// The form in which an object is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)] // `FORMS` says what they are
pub enum Form {
    Points,
    Curve,
    Strands,
    Surface,
    Body,
    Instances,
    Solid,
    Container,
    Liquid,
    Ground,
    Image,
    Smoke,
}

/// A form, described.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Described {
    /// The form.
    pub name: Form,
    /// What is drawn.
    pub doc: &'static str,
    /// What its objects consist of: masses, whose positions are in the frames, cells, or a solid.
    pub matter: Matter,
}

/// All of them.
pub const FORMS: &[Described] = &[
    Described { name: Form::Points, doc: "A ball at each mass, and links between them.", matter: Matter::Masses },
    Described { name: Form::Curve, doc: "A round curve through masses.", matter: Matter::Masses },
    Described { name: Form::Strands, doc: "Many curves, which thin out towards their tips.", matter: Matter::Masses },
    Described { name: Form::Surface, doc: "Triangles, seen from both sides and smooth.", matter: Matter::Masses },
    Described { name: Form::Body, doc: "Triangles around a body that deforms, with sharp edges.", matter: Matter::Masses },
    Described { name: Form::Instances, doc: "A mesh at each mass, turned as `turn` says, with sharp edges.", matter: Matter::Masses },
    Described { name: Form::Solid, doc: "Triangles around a solid, with sharp edges.", matter: Matter::Solid },
    Described { name: Form::Container, doc: "The edges of a solid that has others inside.", matter: Matter::Solid },
    Described { name: Form::Liquid, doc: "Triangles around a liquid, others in each frame, seen through.", matter: Matter::Masses },
    Described { name: Form::Ground, doc: "A plane that fades away.", matter: Matter::Solid },
    Described { name: Form::Image, doc: "A column of cells in a plane, and a line around it.", matter: Matter::Cells },
    Described { name: Form::Smoke, doc: "A column of cells in space, seen through.", matter: Matter::Cells },
];

/// How an object is drawn.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Look {
    /// Its name.
    pub object: String,
    /// Its form.
    pub form: Form,
    /// Its colour, where its parts have none of their own.
    pub color: Rgb,
    /// Radius of points and curves [m], where points have none of their own.
    pub radius: f64,
    /// How long points leave a trail behind them [s].
    pub trail: f64,
    /// A step farther than this [m] is none: points that leave a square on one side enter it on the other, and people change floors.
    pub leap: Option<f64>,
    /// A point and the unit normal of a ground, where it is not turned or moved.
    pub plane: Option<[[f64; 3]; 2]>,
    /// Strands that are drawn for each that moves.
    pub strands: u32,
    /// Whether its masses are fewer than [`FEW`], and stay so: it is drawn thicker.
    pub few: bool,
}

impl Look {
    /// An object without trail, leap and plane.
    pub fn new(object: &str, form: Form, color: Rgb) -> Self {
        Self { object: object.into(), form, color, radius: RADIUS, trail: 0.0, leap: None, plane: None, strands: 1, few: false }
    }

    /// The same with another radius [m].
    pub fn with_radius(self, radius: f64) -> Self {
        Self { radius, ..self }
    }
}

/// A mass: name of the object, and row.
pub type End = (String, usize);

/// All that is drawn of a scene.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Looks {
    /// Its objects, system by system, and then what does not follow from anything: colliders.
    pub objects: Vec<Look>,
    /// The ends of each anchor that pulls.
    pub anchors: Vec<[End; 2]>,
}

/// Colours of objects that have none, one after the other.
#[derive(Debug, Default)]
pub struct Colors(usize);

impl Colors {
    /// The colour given, or else the next.
    pub fn pick(&mut self, own: Option<Rgb>) -> Rgb {
        own.unwrap_or_else(|| {
            self.0 += 1;
            PALETTE[(self.0 - 1) % PALETTE.len()]
        })
    }
}

/// Radius of what has none [m].
pub const RADIUS: f64 = 0.01;
/// An object of fewer masses than these is drawn thicker.
pub const FEW: f64 = 200.0;
/// Fluid density [kg/m³] from which smoke counts as dye, with a colour of its own.
pub const LIQUID: f64 = 100.0;
/// Colours of objects that have none: Paul Tol's "bright" scheme, which stays distinguishable for every common kind of colour blindness.
pub const PALETTE: &[Rgb] = &[
    [0.05780543019106723, 0.184474994500441, 0.4019777798321958],
    [0.8549926081242338, 0.13286832155381798, 0.184474994500441],
    [0.01599629336550963, 0.24620132670783548, 0.033104766570885055],
    [0.6038273388553378, 0.4969329950608704, 0.05780543019106723],
    [0.13286832155381798, 0.6038273388553378, 0.8549926081242338],
    [0.4019777798321958, 0.033104766570885055, 0.184474994500441],
];
/// Of solids that have none, and of anchors and lines around grids.
pub const SOLID: Rgb = [0.42, 0.41, 0.39];
/// Of grounds that have none.
pub const GROUND: Rgb = [0.82, 0.82, 0.82];
/// Of smoke.
pub const SMOKE: Rgb = [0.52, 0.53, 0.56];

/// Something that all fronts draw alike.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Constant {
    /// Its name.
    pub name: &'static str,
    /// SI unit, `1` for a pure number.
    pub unit: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// How much.
    pub value: Value,
}

/// The value of a constant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
#[allow(missing_docs)]
pub enum Value {
    Number(f64),
    Color(Rgb),
    Words(&'static [&'static str]),
    Pairs(&'static [(&'static str, &'static str)]),
}

/// All of them.
pub const CONSTANTS: &[Constant] = &[
    Constant {
        name: "solid",
        unit: "1",
        doc: "Colour of solids that have none, of anchors and of lines around grids.",
        value: Value::Color(SOLID),
    },
    Constant { name: "ground", unit: "1", doc: "Colour of grounds that have none.", value: Value::Color(GROUND) },
    Constant {
        name: "shown",
        unit: "1",
        doc: "Column shown of a grid: the first of these that is in the frames and not uniform.",
        value: Value::Words(&["density", "fuel", "temperature", "vorticity", "speed", "pressure", "divergence"]),
    },
    Constant {
        name: "maps",
        unit: "1",
        doc: "Map of colours of a column, in Matplotlib's names; of all others viridis.",
        value: Value::Pairs(&[
            ("density", "cividis"),
            ("fuel", "cividis"),
            ("temperature", "inferno"),
            ("vorticity", "RdBu_r"),
            ("pressure", "PuOr_r"),
            ("divergence", "PRGn"),
            ("velocity_x", "RdBu_r"),
            ("velocity_y", "RdBu_r"),
            ("velocity_z", "RdBu_r"),
        ]),
    },
    Constant { name: "glowing", unit: "K", doc: "A gas that gets hotter than this is seen to glow.", value: Value::Number(1000.0) },
    Constant {
        name: "trail",
        unit: "1",
        doc: "Radius of trails over the radius of the points that leave them.",
        value: Value::Number(0.3),
    },
    Constant {
        name: "spring",
        unit: "1",
        doc: "Radius of springs over the radius of the points that they join.",
        value: Value::Number(0.25),
    },
    Constant { name: "shade", unit: "1", doc: "How bright springs are over the points that they join.", value: Value::Number(0.6) },
    Constant {
        name: "drawn_on",
        unit: "1",
        doc: "How bright links are over the surface that they are drawn on.",
        value: Value::Number(0.35),
    },
];
