//! Structures of masses and links. Stiffness is independent of resolution: k_s = modulus x (length, area or volume that the link represents) / l0².

use super::fabrics::FabricWords;
use super::links::{Links, Load, Pin, PointMass, given_or, net_links, rope_links, sheet_links};
use super::surfaces::{Fluid, Inflation, Membrane, ShapeMatching, Tear};
use super::{MeshFile, items_above_zero};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Free masses, and springs between selected ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Particles {
    /// Name in frames.
    pub name: String,
    /// System that moves it. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Initial positions. Alternative: `cloud`.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub position: Vec<[f64; 3]>,
    /// Masses at random positions. Alternative: `position`.
    #[serde(default)]
    pub cloud: Option<Cloud>,
    /// Initial velocities: one each, or a single one for all.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: Vec<[f64; 3]>,
    /// Mass of each, or a single one for all.
    #[serde(default = "one_each")]
    #[schemars(length(min = 1), transform = items_above_zero, extend("x-unit" = "kg"))]
    pub mass: Vec<f64>,
    /// Electric charge of each, or a single one for all.
    #[serde(default)]
    #[schemars(extend("x-unit" = "C"))]
    pub charge: Vec<f64>,
    /// Fixed masses.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Forces on some of its masses.
    #[serde(default)]
    pub load: Vec<Load>,
    /// Extra masses on some of its masses.
    #[serde(default)]
    pub point_mass: Vec<PointMass>,
    /// Springs between them.
    #[serde(default)]
    pub spring: Vec<Spring>,
    /// A liquid that fills boxes at the start, instead of `position`, `cloud` and `mass`. Position-based dynamics only.
    #[serde(default)]
    pub fluid: Option<Fluid>,
    /// Shape matching of the whole object. Position-based dynamics only.
    #[serde(default)]
    pub shape_matching: Option<ShapeMatching>,
    /// Radius in pictures.
    #[serde(default = "centimetre")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Duration of the trail drawn behind each particle in pictures.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub trail: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Masses at random positions, determined by seed and name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cloud {
    /// Count.
    #[schemars(range(min = 1, max = 100_000_000))]
    pub count: u32,
    /// Centre.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Edges of the box, or diameters of the ellipsoid; zero along one axis makes it flat.
    #[schemars(inner(range(min = 0.0)), extend("x-unit" = "m"))]
    pub size: [f64; 3],
    /// Shape of the cloud.
    #[serde(default)]
    pub shape: CloudShape,
    /// Speed in random directions, within the plane of a flat cloud; added to `velocity`.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m/s"))]
    pub speed: f64,
}

/// Shape of a cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CloudShape {
    /// A box.
    #[default]
    Box,
    /// A ball, or an ellipsoid for unequal diameters.
    Sphere,
}

/// A spring between two masses of one object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// Indices of the two masses.
    pub between: [u32; 2],
    /// Spring constant k_s.
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub stiffness: f64,
    /// Rest length; 0 gives f = k_s (b - a). Default: the initial distance.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "m"))]
    pub rest_length: Option<f64>,
    /// Internal damping: force along the spring per rate of extension.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N s/m"))]
    pub damping: f64,
    /// Stiffening: force k_s r (1 + hardening (r / l0)²) at the extension r.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub hardening: f64,
    /// Pulls but does not push, like a thread.
    #[serde(default)]
    pub tension_only: bool,
    /// Breaks permanently when |r| / l0 exceeds this.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub break_strain: Option<f64>,
}

/// Stars at random positions, in dynamical equilibrium under the gravitation of the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Galaxy {
    /// Name in frames; with the scene's seed, it determines the random numbers.
    pub name: String,
    /// System that moves it. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Distribution of the stars.
    #[serde(default)]
    pub profile: Profile,
    /// Number of stars.
    #[serde(default = "many")]
    #[schemars(range(min = 1, max = 100_000_000))]
    pub stars: u32,
    /// Total mass of the stars.
    #[schemars(extend("x-unit" = "kg", "exclusiveMinimum" = 0.0))]
    pub mass: f64,
    /// Scale length: of the disk's exponential, or a of Plummer's sphere.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub length: f64,
    /// Height z0 of the disk relative to its scale length; its density is proportional to sech²(z/z0).
    #[serde(default = "tenth")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub thickness: f64,
    /// Toomre's Q: velocity dispersion in units of the one at which a disk is marginally stable against fragmentation.
    #[serde(default = "stable")]
    #[schemars(range(min = 0.0), extend("x-unit" = "1"))]
    pub toomre: f64,
    /// Dark matter around the stars of a disk: one additional mass, the last one.
    #[serde(default)]
    pub halo: Option<Halo>,
    /// Initial position of its centre.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Initial velocity of its centre.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Rotation about x, then y, then z; a disk is in the x-y plane before.
    #[serde(default)]
    #[schemars(extend("x-unit" = "degree"))]
    pub rotate: [f64; 3],
    /// Rotates clockwise as seen from above, before `rotate`.
    #[serde(default)]
    pub clockwise: bool,
    /// Radius of a star in pictures.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Duration of the trail drawn behind each particle in pictures.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub trail: f64,
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Distribution of the stars of a galaxy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// An exponential disk with nearly circular orbits.
    #[default]
    Disk,
    /// Plummer's sphere in equilibrium.
    Plummer,
}

/// A halo: a Plummer sphere that moves as one mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Halo {
    /// Its mass.
    #[schemars(extend("x-unit" = "kg", "exclusiveMinimum" = 0.0))]
    pub mass: f64,
    /// Its radius b, which encloses 35 % of the mass.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
}

/// A chain of masses between two points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rope {
    /// Name in frames.
    pub name: String,
    /// System that moves it. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Position of its start.
    #[schemars(extend("x-unit" = "m"))]
    pub from: [f64; 3],
    /// Position of its end.
    #[schemars(extend("x-unit" = "m"))]
    pub to: [f64; 3],
    /// Rest length. Default: the distance between the ends. A longer rope starts as a circular arc hanging down.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub length: Option<f64>,
    /// Segments; there is one more mass.
    #[schemars(range(min = 1, max = 1_000_000_000))]
    pub segments: u32,
    /// Mass per length.
    #[serde(default = "tenth")]
    #[schemars(extend("x-unit" = "kg/m", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Spring families, modulus in N: `structural` between neighbours, `bend` between next-nearest ones. Not with `rod`. Default: structural 1000.
    #[serde(default)]
    pub links: Option<Links>,
    /// Makes it a Cosserat rod, which resists bending and twist.
    #[serde(default)]
    pub rod: Option<Rod>,
    /// Fixed masses: `"start"`, `"end"`, `"vertex 3"`. A pinned end of a rod is clamped.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Forces on some of its masses.
    #[serde(default)]
    pub load: Vec<Load>,
    /// Extra masses on some of its masses.
    #[serde(default)]
    pub point_mass: Vec<PointMass>,
    /// Radius in pictures.
    #[serde(default = "centimetre")]
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub radius: f64,
    /// Initial velocity.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Elastic moduli of a rod.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rod {
    /// Stretching stiffness E A.
    #[schemars(extend("x-unit" = "N", "exclusiveMinimum" = 0.0))]
    pub stretch: f64,
    /// Shearing stiffness k G A. Default: that of stretching.
    #[serde(default)]
    #[schemars(extend("x-unit" = "N", "exclusiveMinimum" = 0.0))]
    pub shear: Option<f64>,
    /// Bending stiffness E I.
    #[schemars(range(min = 0.0), extend("x-unit" = "N m²"))]
    pub bend: f64,
    /// Bending stiffness towards `side`, as of a flat strip in its own plane. Default: `bend`.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m²"))]
    pub bend_side: Option<f64>,
    /// Direction in which `bend_side` resists: the width of a flat strip at its start, orthogonalized against the rod. Default: horizontal, so that a
    /// strip lies flat, or along y where the rod starts vertically.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1"))]
    pub side: Option<[f64; 3]>,
    /// Twisting stiffness G J. Default: that of bending.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m²"))]
    pub twist: Option<f64>,
    /// Natural curvature about the axis of `side`, about the axis across it, and natural twist: what the rod bends and twists to without load. Default:
    /// straight.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1/m"))]
    pub curvature: [f64; 3],
    /// Rotational inertia per length, the same about every axis. Default: that of a round wire of the picture radius.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg m", "exclusiveMinimum" = 0.0))]
    pub inertia: Option<f64>,
    /// Damping of all strains, as a time: damping = time x stiffness.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
    /// Strain at which a segment breaks permanently; only in position-based systems.
    #[serde(default)]
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0))]
    pub break_strain: Option<f64>,
}

/// A rectangle of masses and links.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// Name in frames.
    pub name: String,
    /// System that moves it. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Lengths of its sides.
    #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
    pub size: [f64; 2],
    /// Masses along each side.
    #[schemars(inner(range(min = 2, max = 1_000_000_000)))]
    pub resolution: [u32; 2],
    /// Centre.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Rotation about x, then y, then z, from the plane z = 0.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Mass per area. Default: that of the fabric, or 0.2.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m²", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Spring families, modulus in N/m. Default: structural 500, shear 200 and bend 10.
    #[serde(default)]
    pub links: Option<Links>,
    /// Bending stiffness of a plate without Poisson's ratio, the same on triangles of any shape; at rest it is flat.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub hinge: f64,
    /// Additional isotropic plate bending stiffness; quadratic in the positions, cheaper than `hinge`, and exact for inextensible sheets.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub isometric: f64,
    /// Stretch resistance of a woven membrane; it replaces the default links.
    #[serde(default)]
    pub membrane: Option<Membrane>,
    /// Measured fabric, the name of a bundled one or the path of its record: stretch, bending and, by default, density. It replaces the default
    /// links.
    #[serde(default)]
    pub fabric: Option<FabricWords>,
    /// Tearing. Default: none.
    #[serde(default)]
    pub tear: Option<Tear>,
    /// Area stiffness of each triangle: tension per relative change of area.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub area: f64,
    /// Fixed masses: `"corner 0 0"`, `"vertex 3 4"`, `"edge x-"`.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Forces on some of its masses.
    #[serde(default)]
    pub load: Vec<Load>,
    /// Extra masses on some of its masses.
    #[serde(default)]
    pub point_mass: Vec<PointMass>,
    /// Initial velocity.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// A box of masses and links, or of tetrahedra.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Name in frames.
    pub name: String,
    /// System that moves it. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// Lengths of its edges.
    #[schemars(transform = items_above_zero, extend("x-unit" = "m"))]
    pub size: [f64; 3],
    /// Masses along each edge.
    #[schemars(inner(range(min = 2, max = 1_000_000_000)))]
    pub resolution: [u32; 3],
    /// Centre.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub center: [f64; 3],
    /// Rotation about x, then y, then z.
    #[serde(default)]
    #[schemars(extend("x-unit" = "°"))]
    pub rotate: [f64; 3],
    /// Mass per volume.
    #[serde(default = "thousand")]
    #[schemars(extend("x-unit" = "kg/m³", "exclusiveMinimum" = 0.0))]
    pub density: f64,
    /// Spring families, modulus in Pa. Not with `material`.
    #[serde(default)]
    pub links: Option<Links>,
    /// Elastic tetrahedra instead of springs.
    #[serde(default)]
    pub material: Option<Material>,
    /// Shape matching of the whole object. Position-based dynamics only.
    #[serde(default)]
    pub shape_matching: Option<ShapeMatching>,
    /// Fixed masses: `"corner 0 0 0"`, `"vertex 1 2 3"`, `"face z-"`.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Forces on some of its masses.
    #[serde(default)]
    pub load: Vec<Load>,
    /// Extra masses on some of its masses.
    #[serde(default)]
    pub point_mass: Vec<PointMass>,
    /// Initial velocity.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// A stable Neo-Hookean solid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Young's modulus.
    #[schemars(extend("x-unit" = "Pa", "exclusiveMinimum" = 0.0))]
    pub young: f64,
    /// Poisson's ratio.
    #[schemars(extend("x-unit" = "1", "exclusiveMinimum" = 0.0, "exclusiveMaximum" = 0.5))]
    pub poisson: f64,
    /// Damping as a time: damping = time x stiffness.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "s"))]
    pub damping: f64,
}

/// Masses at the vertices of a mesh, springs along its edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Net {
    /// Name in frames.
    pub name: String,
    /// System that moves it. Default: the first that can.
    #[serde(default)]
    pub system: Option<String>,
    /// The mesh.
    pub mesh: MeshFile,
    /// Takes the texture coordinates of the mesh as its flat sewing pattern: the rest shape, with the warp along u. Default: the initial shape is the
    /// rest shape.
    #[serde(default)]
    pub pattern: Option<Pattern>,
    /// Mass per area. Default: that of the fabric, or 0.2.
    #[serde(default)]
    #[schemars(extend("x-unit" = "kg/m²", "exclusiveMinimum" = 0.0))]
    pub density: Option<f64>,
    /// Spring families, modulus in N/m: `structural` along edges, `bend` across them. Default: structural 500 and bend 10.
    #[serde(default)]
    pub links: Option<Links>,
    /// Bending stiffness of a plate without Poisson's ratio, the same on triangles of any shape; at rest it is bent as it is made, or flat if it has a
    /// pattern.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub hinge: f64,
    /// Additional bending stiffness, quadratic in the positions and flat at rest for any mesh: cheaper than `hinge`, and equal to it for inextensible
    /// surfaces of equilateral triangles.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N m"))]
    pub isometric: f64,
    /// Stretch resistance of a woven membrane; it replaces the default links.
    #[serde(default)]
    pub membrane: Option<Membrane>,
    /// Measured fabric, the name of a bundled one or the path of its record: stretch, bending and, by default, density. It replaces the default
    /// links.
    #[serde(default)]
    pub fabric: Option<FabricWords>,
    /// Tearing. Default: none.
    #[serde(default)]
    pub tear: Option<Tear>,
    /// Area stiffness of each triangle: tension per relative change of area.
    #[serde(default)]
    #[schemars(range(min = 0.0), extend("x-unit" = "N/m"))]
    pub area: f64,
    /// Enclosed volume and pressure; the mesh must be closed. Position-based dynamics only.
    #[serde(default)]
    pub pressure: Option<Inflation>,
    /// Shape matching of the whole object; it replaces the default links. Position-based dynamics only.
    #[serde(default)]
    pub shape_matching: Option<ShapeMatching>,
    /// Fixed masses: `"vertex 3"`, or all within a radius of a point.
    #[serde(default)]
    pub pin: Vec<Pin>,
    /// Forces on some of its masses.
    #[serde(default)]
    pub load: Vec<Load>,
    /// Extra masses on some of its masses.
    #[serde(default)]
    pub point_mass: Vec<PointMass>,
    /// Initial velocity.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Red, green and blue in pictures, 0 to 1, in linear light (0.5 is 188 of 255 in sRGB).
    #[serde(default)]
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub color: Option<[f64; 3]>,
}

/// Texture coordinates as flat panels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pattern {
    /// Length of one unit of texture coordinates.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0.0))]
    pub scale: f64,
}

impl Rope {
    /// Its springs: those given, otherwise stiff ones between neighbours. Not for a rod, which has none.
    pub fn links(&self) -> Links {
        given_or(&self.links, self.rod.is_some(), rope_links)
    }
}

impl Sheet {
    /// Its springs: those given, otherwise the default ones if nothing else makes it elastic.
    pub fn links(&self) -> Links {
        given_or(&self.links, self.membrane.is_some() || self.fabric.is_some(), sheet_links)
    }
}

impl Net {
    /// Its springs: those given, otherwise the default ones if nothing else makes it elastic.
    pub fn links(&self) -> Links {
        let elastic = self.membrane.is_some() || self.fabric.is_some() || self.shape_matching.is_some();
        given_or(&self.links, elastic, net_links)
    }
}

fn one_each() -> Vec<f64> {
    vec![1.0]
}

fn centimetre() -> f64 {
    0.01
}

fn tenth() -> f64 {
    0.1
}

fn thousand() -> f64 {
    1000.0
}

fn many() -> u32 {
    16_384
}

fn stable() -> f64 {
    1.5
}
