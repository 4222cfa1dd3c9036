//! Every kind of object that a scene can hold, described once.

use serde::Serialize;

/// What an object consists of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Matter {
    /// Masses, or particles without mass.
    Masses,
    /// Cells of a grid.
    Cells,
    /// A shape that others meet.
    Solid,
}

/// A kind of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Kind {
    /// Its table in a scene.
    pub name: &'static str,
    /// What an object of it is.
    pub doc: &'static str,
    /// What it consists of.
    pub matter: Matter,
    /// Whether elements bind its masses, always or where asked for: the others are particles by themselves.
    pub bound: bool,
    /// Whether it is a surface of masses, with `links`, `membrane` or `fabric`.
    pub surface: bool,
    /// The word that says how finely it is divided, where there is one.
    pub resolution: Option<&'static str>,
    /// Words for amounts of what it consists of.
    pub amounts: &'static [&'static str],
}

const MASSES: Kind = Kind { name: "", doc: "", matter: Matter::Masses, bound: true, surface: false, resolution: None, amounts: &[] };
const LOOSE: Kind = Kind { bound: false, ..MASSES };
const CELLS: Kind = Kind { matter: Matter::Cells, resolution: Some("box.resolution"), ..LOOSE };

/// All of them.
pub const KINDS: &[Kind] = &[
    Kind {
        name: "particles",
        doc: "Masses, with springs between some of them where asked for.",
        amounts: &["cloud.count", "fluid.fill"],
        ..MASSES
    },
    Kind { name: "emitter", doc: "Where particles are born.", ..LOOSE },
    Kind { name: "rope", doc: "Masses in a row, joined by links or a rod.", resolution: Some("segments"), ..MASSES },
    Kind { name: "hair", doc: "Strands, each a rod, planted on a surface.", resolution: Some("segments"), amounts: &["count"], ..MASSES },
    Kind { name: "sheet", doc: "A rectangular lattice of masses.", surface: true, resolution: Some("resolution"), ..MASSES },
    Kind { name: "block", doc: "A solid lattice of masses.", resolution: Some("resolution"), ..MASSES },
    Kind { name: "net", doc: "A mesh whose edges are links.", surface: true, ..MASSES },
    Kind { name: "cloth", doc: "A mesh that resists stretch and bending.", surface: true, resolution: Some("resolution"), ..MASSES },
    Kind { name: "galaxy", doc: "Stars around a centre.", amounts: &["stars"], ..LOOSE },
    Kind { name: "body", doc: "Rigid bodies of one shape.", ..LOOSE },
    Kind { name: "joint", doc: "What holds rigid bodies together: it consists of its ends, first that of the first body.", ..LOOSE },
    Kind { name: "grains", doc: "Spheres of a granular material.", amounts: &["fill"], ..LOOSE },
    Kind {
        name: "plan",
        doc: "The plan of a floor: it consists of the ends of its walls, then of those of its doors and exits.",
        ..MASSES
    },
    Kind { name: "crowd", doc: "People on a floor.", amounts: &["count", "density"], ..LOOSE },
    Kind { name: "liquid", doc: "A liquid with a free surface: its particles.", resolution: Some("box.resolution"), ..LOOSE },
    Kind { name: "heat", doc: "A body that conducts heat.", ..CELLS },
    Kind { name: "compressible", doc: "A gas in which sound travels.", ..CELLS },
    Kind { name: "gas", doc: "An incompressible fluid in a box.", ..CELLS },
    Kind { name: "collider", doc: "A solid that others meet.", matter: Matter::Solid, ..LOOSE },
];
