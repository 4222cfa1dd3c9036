//! Whether what a scene says may be meant: figures beyond anything real are mostly slips of a unit.

use tumble_interface::Assets;
use tumble_interface::check::{plain, short};
use tumble_interface::scene::{MeshFile, Scene, Shape};
use tumble_interface::warning::{Code, Warning};

/// Mass per area of denim [kg/m²]: 12 ounces per square yard.
const DENIM: f64 = 0.4;
/// How many times denim a surface may weigh: 8 kg/m² is a millimetre of steel.
const HEAVY: f64 = 20.0;
/// Mass per area of a film of a tenth of a micrometre [kg/m²].
const FILM: f64 = 1e-4;
/// Density of osmium [kg/m³], the densest element (Arblaster, Platinum Metals Review 33, 1989).
const OSMIUM: f64 = 22_590.0;
/// Density of graphene aerogel [kg/m³], the lightest solid (Sun, Xu and Gao, Advanced Materials 25, 2013).
const AEROGEL: f64 = 0.16;
/// Density of liquid hydrogen [kg/m³], the lightest liquid.
const HYDROGEN: f64 = 70.0;
/// Mass per length of the heaviest anchor chains [kg/m].
const CHAIN: f64 = 1000.0;
/// Young's modulus of diamond along its stiffest direction [Pa] (McSkimin and Andreatch, Journal of Applied Physics 43, 1972).
const DIAMOND: f64 = 1.2e12;
/// Gravity of the Earth [m/s²].
const EARTH: f64 = 9.80665;
/// How many times the Earth's gravity may be; the Sun has 28 times.
const STRONG: f64 = 30.0;
/// Least extent of anything [m].
const SMALL: f64 = 1e-4;
/// Largest extent of cloth [m], as of the largest tents.
const BROAD: f64 = 200.0;
/// Largest extent of what is solid [m], as of the largest buildings.
const LARGE: f64 = 1000.0;

/// What in the scene is unlike anything real.
pub fn implausible(scene: &Scene, assets: &Assets) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut doubt = |code, path: String, message: String| warnings.push(Warning::new(code, path, message));

    let sheets = scene.sheet.iter().map(|t| ("sheet", &t.name, t.density, &t.fabric));
    let nets = scene.net.iter().map(|t| ("net", &t.name, t.density, &t.fabric));
    let cloths = scene.cloth.iter().map(|t| ("cloth", &t.name, t.density, &t.fabric));
    for (kind, name, density, fabric) in sheets.chain(nets).chain(cloths) {
        let record = || {
            let words = fabric.as_ref()?;
            Some((assets.fabric(words.key())?.density * words.settings().thicken, "fabric"))
        };
        let Some((density, key)) = density.map(|density| (density, "density")).or_else(record) else { continue };
        let than = if density > HEAVY * DENIM {
            format!("{} times as much as denim", short(density / DENIM))
        } else if density < FILM {
            "less than a film of a tenth of a micrometre".into()
        } else {
            continue;
        };
        let message = format!("{} kg/m² is {than}; densities of surfaces are per area, cotton has 0.15", plain(density));
        doubt(Code::ImplausibleWeight, format!("{kind} \"{name}\".{key}"), message);
    }
    for rope in scene.rope.iter().filter(|rope| rope.density > CHAIN) {
        let message = format!("{} kg/m is more than the heaviest chains; densities of ropes are per length", plain(rope.density));
        doubt(Code::ImplausibleWeight, format!("rope \"{}\".density", rope.name), message);
    }

    let blocks = scene.block.iter().map(|t| (format!("block \"{}\".density", t.name), t.density, AEROGEL));
    let hair = scene.hair.iter().map(|t| (format!("hair \"{}\".density", t.name), t.density, AEROGEL));
    let liquids = scene
        .particles
        .iter()
        .filter_map(|t| Some((format!("particles \"{}\".fluid.density", t.name), t.fluid.as_ref()?.density, HYDROGEN)));
    warnings.extend(blocks.chain(hair).chain(liquids).filter_map(|(path, density, least)| odd_density(path, density, least)));
    let mut doubt = |code, path: String, message: String| warnings.push(Warning::new(code, path, message));

    for block in &scene.block {
        if let Some(young) = block.material.as_ref().map(|m| m.young).filter(|young| *young > DIAMOND) {
            let message =
                format!("{} Pa is {} times as stiff as diamond; rubber has 1e6, steel 2.1e11", plain(young), short(young / DIAMOND));
            doubt(Code::ImplausibleStiffness, format!("block \"{}\".material.young", block.name), message);
        }
    }

    let gravity = scene.world.gravity.constant().map_or(0.0, |g| g.iter().map(|g| g * g).sum::<f64>().sqrt());
    if gravity > STRONG * EARTH {
        let message = format!("{} m/s² is {} times that of the Earth; lengths are in metres", plain(gravity), short(gravity / EARTH));
        doubt(Code::ImplausibleGravity, "world.gravity".into(), message);
    }

    let largest = |size: &[f64]| size.iter().copied().fold(0.0, f64::max);
    let in_mesh = |file: &MeshFile| assets.get(&file.path).map_or(0.0, |mesh| file.scale.abs() * extent(&mesh.vertices));
    let sheets = scene.sheet.iter().map(|t| (format!("sheet \"{}\".size", t.name), largest(&t.size), BROAD));
    let blocks = scene.block.iter().map(|t| (format!("block \"{}\".size", t.name), largest(&t.size), LARGE));
    let nets = scene.net.iter().map(|t| (format!("net \"{}\".mesh", t.name), in_mesh(&t.mesh), BROAD));
    let solids = scene.collider.iter().filter_map(|t| match &t.shape {
        Shape::Mesh(file) => Some((format!("collider \"{}\".shape.mesh", t.name), in_mesh(file), LARGE)),
        _ => None,
    });
    for (path, size, most) in sheets.chain(blocks).chain(nets).chain(solids) {
        if size > 0.0 && !(SMALL..=most).contains(&size) {
            let message = format!("{} m across; lengths are in metres: a mesh in millimetres needs a scale of 0.001", short(size));
            doubt(Code::ImplausibleSize, path, message);
        }
    }
    warnings
}

/// A density that no material has; `least` is that of the lightest of its kind [kg/m³].
pub fn odd_density(path: String, density: f64, least: f64) -> Option<Warning> {
    let than = if density > OSMIUM {
        format!("{} times as much as osmium, the densest element", short(density / OSMIUM))
    } else if density < least {
        format!("less than {} kg/m³, the lightest there is", plain(least))
    } else {
        return None;
    };
    let message = format!("{} kg/m³ is {than}; water has 1000", plain(density));
    Some(Warning::new(Code::ImplausibleDensity, path, message))
}

/// The longest edge of the box around points [m].
fn extent(points: &[[f64; 3]]) -> f64 {
    let along = |axis: usize| points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (p[axis].min(l), p[axis].max(h)));
    (0..3).map(along).map(|(low, high)| high - low).fold(0.0, f64::max)
}
