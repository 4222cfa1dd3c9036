//! How much memory a scene will take, told before any is taken.

use super::Assets;
use super::methods::METHODS;
use crate::geometry::GridSdf;
use crate::math::Signal;
use tumble_interface::scene::{Animated, Diagonals, Dress, Emitter, Fluid, Interpolation, Linear, Shape, Source, System};
use tumble_interface::{Mesh, Scene};

/// Bytes for a mass: its rows in state, scratch, snapshot and history, in double precision.
const MASS: f64 = 1200.0;
/// Bytes for an emitted particle: its rows, id and age, twice, and a snapshot on its way to a file, in double precision.
const BORN: f64 = 400.0;
/// Bytes for a link: as part, in the list of its kind, and in the gather lists of both ends.
const LINK: f64 = 260.0;
/// Bytes for a tetrahedron with its two or three laws.
const TETRAHEDRON: f64 = 1400.0;

/// Bytes for a corner of a solid whose edges meet those of what is soft: its rows, features, their boxes, and pairs.
const CORNER: f64 = 2000.0;

/// Bytes for a vertex of a keyframe: its position, and two corners of the boxes, about one for each vertex.
const KEYED: f64 = 160.0;

/// Bytes for a mass of the factors of a direct solver: along curves, on surfaces, and in bodies for each mass along an edge of the smaller
/// cross-section. Measured: 1.9 kB in ropes, 13.3 to 14.5 kB in sheets of 100 to 400 masses along a side, 2.0 to 2.7 kB in bodies of 10 to 30.
const FACTORS: [f64; 3] = [2.5e3, 16e3, 2.8e3];

/// An upper estimate of the bytes that the objects and colliders of a resolved scene need.
pub fn memory(scene: &Scene, assets: &Assets) -> f64 {
    // Intervals that are repeated have a snapshot of their own; none is more than half of all.
    let kept = if scene.world.coupling.is_some() { 1.5 } else { 1.0 };
    METHODS.into_iter().map(|method| method.memory(scene, assets)).sum::<f64>() * kept + solids(scene, assets)
}

/// Of particles and of things that are made of masses.
pub fn masses(scene: &Scene, assets: &Assets) -> f64 {
    let diagonals = |d: &Diagonals| if *d == Diagonals::Both { 2.0 } else { 1.0 };
    // What a direct solver takes, of the objects that it may have to solve for.
    let factors = |system: &Option<String>, each: f64| {
        let moves = |s: &System| system.as_ref().is_none_or(|name| *name == s.name);
        let direct = scene.system.iter().any(|s| moves(s) && s.integrator.is_implicit() && s.solver.linear == Linear::Cholesky);
        if direct { each } else { 0.0 }
    };
    let mut bytes = 0.0;
    for thing in &scene.particles {
        let liquid = thing.fluid.as_ref().map_or(0.0, Fluid::count);
        // A particle of a liquid has sums over its neighbours and a place among them besides.
        bytes += liquid * 3.0 * MASS;
        bytes += (thing.position.len() as f64 + thing.cloud.as_ref().map_or(0.0, |c| f64::from(c.count))) * MASS
            + thing.spring.len() as f64 * LINK;
    }
    for (thing, count) in scene.emitter.iter().zip(alive(scene)) {
        bytes += count * (BORN + 32.0 * thing.columns.len() as f64);
    }
    bytes += scene.galaxy.iter().map(|thing| f64::from(thing.stars) * MASS).sum::<f64>();
    for thing in &scene.rope {
        let links = if thing.rod.is_some() { 6.0 } else { 2.0 };
        bytes += (f64::from(thing.segments) + 1.0) * (2.0 * MASS + links * LINK + factors(&thing.system, FACTORS[0]));
    }
    for thing in &scene.hair {
        let of = |mesh: &Mesh, scale: f64| {
            let corner = |i: u32| mesh.vertices[i as usize];
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(corner).map(crate::math::Vec3::from);
                (b - a).cross(c - a).norm() / 2.0
            };
            mesh.triangles.iter().map(area).sum::<f64>() * scale * scale
        };
        let carrier = scene.collider.iter().find(|c| Some(&c.name) == thing.on.as_ref()).map(|c| &c.shape);
        let file = if let Some(Shape::Mesh(file)) = carrier { Some(file) } else { thing.mesh.as_ref() };
        let area = match carrier {
            Some(Shape::Sphere { radius, .. }) => 13.0 * radius * radius,
            Some(Shape::Box { size: [a, b, c], .. }) => 2.0 * (a * b + b * c + c * a),
            Some(Shape::Capsule { from, to, radius }) => {
                let way = (0..3).map(|a| (to[a] - from[a]).powi(2)).sum::<f64>().sqrt();
                6.3 * radius * (way + 2.0 * radius)
            }
            _ => file.and_then(|file| Some(of(assets.get(&file.path)?, file.scale))).unwrap_or(0.0),
        };
        let groomed = thing.guides.as_ref().and_then(|guides| assets.curves(&guides.path)).map(|curves| curves.len() as f64);
        let sown = || thing.per_area.map_or(f64::from(thing.count.unwrap_or(1)), |n| n * area);
        let strands = groomed.unwrap_or_else(sown);
        bytes += strands * (f64::from(thing.segments) + 2.0) * (2.0 * MASS + 4.0 * LINK + factors(&thing.system, FACTORS[0]));
    }
    for thing in &scene.sheet {
        let n: f64 = thing.resolution.iter().map(|n| f64::from(*n)).product();
        // Three edges and two triangles a mass; one that bends has the size of six links.
        let each = |there: bool, links: f64| if there { links } else { 0.0 };
        let elements = each(thing.hinge > 0.0, 12.0)
            + each(thing.isometric > 0.0, 9.0)
            + each(thing.membrane.is_some(), 6.0)
            + each(thing.fabric.is_some(), 30.0)
            + each(thing.area > 0.0, 4.0);
        bytes += n * (MASS + (4.0 + diagonals(&thing.links().diagonals) + elements) * LINK + factors(&thing.system, FACTORS[1]));
    }
    for thing in &scene.block {
        let n: f64 = thing.resolution.iter().map(|n| f64::from(*n)).product();
        let links = thing.links.as_ref().map_or(0.0, |l| 6.0 + 3.0 * diagonals(&l.diagonals));
        let solids = if thing.material.is_some() { 6.0 } else { 0.0 };
        let mut edges = thing.resolution.map(f64::from);
        edges.sort_by(f64::total_cmp);
        let factor = factors(&thing.system, FACTORS[2] * (edges[0] * edges[1]).sqrt());
        bytes += n * (MASS + links * LINK + solids * TETRAHEDRON + factor);
    }
    let woven = |there: bool| if there { 45.0 } else { 18.0 };
    for (thing, mesh) in scene.net.iter().filter_map(|thing| Some((thing, assets.get(&thing.mesh.path)?))) {
        bytes += mesh.vertices.len() as f64 * (MASS + woven(thing.fabric.is_some()) * LINK + factors(&thing.system, FACTORS[1]));
    }
    for thing in &scene.cloth {
        let girth = |d: &Dress| (d.bust_girth * (d.bodice + d.shoulder), d.waist_girth / std::f64::consts::TAU);
        let of_dress = |d: &Dress| girth(d).0 + std::f64::consts::PI * (girth(d).1 + d.skirt) * (girth(d).1 + d.skirt);
        let twice =
            |o: &[[f64; 2]]| (0..o.len()).map(|i| o[i][0] * o[(i + 1) % o.len()][1] - o[(i + 1) % o.len()][0] * o[i][1]).sum::<f64>();
        let area = thing.panels.iter().map(|p| 0.5 * twice(&p.outline).abs()).sum::<f64>() + thing.dress.as_ref().map_or(0.0, of_dress);
        // Equilateral triangles have an area of sqrt(3)/2 edge² a point; sides add some.
        let each = MASS + woven(thing.fabric.is_some()) * LINK + factors(&thing.system, FACTORS[1]);
        bytes += 1.5 * area / (thing.resolution * thing.resolution) * each;
    }
    bytes
}

/// Of colliders.
fn solids(scene: &Scene, assets: &Assets) -> f64 {
    let mut bytes = 0.0;
    for thing in &scene.collider {
        if let Shape::Mesh(file) = &thing.shape
            && let Some((low, high)) = assets.get(&file.path).and_then(|mesh| mesh.bounds())
        {
            // Turning a box makes it no larger than its diagonal along any axis.
            let size: [f64; 3] = std::array::from_fn(|a| (high[a] - low[a]) * file.scale);
            let size = if file.rotate == [0.0; 3] { size } else { [size.iter().map(|s| s * s).sum::<f64>().sqrt(); 3] };
            bytes += GridSdf::bytes(size, file.resolution, thing.thickness);
        }
        if thing.edges {
            bytes += corners(&thing.shape, assets) * CORNER;
        }
        let end = scene.frame_time() * f64::from(scene.time.frames);
        bytes += match &thing.shape {
            Shape::Mannequin(words) => {
                crate::recipes::figure_bytes(crate::recipes::MANNEQUIN, end.min(words.start + words.settle + 10.0), words.rate)
            }
            Shape::Character(words) => {
                assets.character(&words.path).map_or(0.0, |file| crate::recipes::figure_bytes(file.mesh.vertices.len(), end, words.rate))
            }
            Shape::Lathe { profile, sides, .. } => profile.len() as f64 * f64::from(*sides) * 160.0,
            _ => 0.0,
        };
        if let Shape::AnimatedMesh(frames) = &thing.shape {
            let meshes = frames.frames.iter().filter_map(|f| assets.get(&f.path));
            bytes += meshes.map(|mesh| mesh.vertices.len() as f64 * KEYED).sum::<f64>();
        }
        if let Some(size) = thing.motion.as_ref().and_then(|motion| motion.scale.as_ref()) {
            let keyframes = match size {
                Animated::Value(_) => 1.0,
                Animated::Keys(keys) if keys.interpolation == Interpolation::Linear => keys.keys.len() as f64,
                _ => f64::from(scene.time.frames) + 1.0,
            };
            bytes += corners(&thing.shape, assets) * keyframes * KEYED;
        }
    }
    bytes
}

/// Corners of the surface of a solid, where its edges meet those of what is soft.
fn corners(shape: &Shape, assets: &Assets) -> f64 {
    let of = |path: &String| assets.get(path).map_or(0.0, |mesh| mesh.vertices.len() as f64);
    match shape {
        Shape::Sphere { .. } => 1026.0,
        Shape::Capsule { .. } => 514.0,
        Shape::Box { .. } => 8.0,
        Shape::Plane { .. } | Shape::Floor { .. } => 0.0,
        Shape::Lathe { profile, sides, .. } => profile.len() as f64 * f64::from(*sides),
        Shape::Mesh(file) => of(&file.path),
        Shape::AnimatedMesh(words) => words.frames.first().map_or(0.0, |frame| of(&frame.path)),
        Shape::Character(words) => assets.character(&words.path).map_or(0.0, |file| file.mesh.vertices.len() as f64),
        Shape::Mannequin(_) => crate::recipes::MANNEQUIN as f64,
    }
}

/// Particles of each emitter that may live at once until the last frame of the scene.
fn alive(scene: &Scene) -> Vec<f64> {
    let duration = scene.frame_time() * f64::from(scene.time.frames);
    // The largest that a changing number is at a hundred times; what is wrong with it is told elsewhere.
    let largest = |words: &Animated| {
        let Ok(signal) = Signal::new(words) else { return 0.0 };
        (0..=100).map(|i| signal.value(duration * f64::from(i) / 100.0)).filter(|value| value.is_finite()).fold(0.0, f64::max)
    };
    let rate_of = |thing: &Emitter| largest(&thing.rate);
    let longest = |thing: &Emitter| thing.lifetime.as_ref().map_or(duration, largest).min(duration);
    // Of every emitter: births a second, and all of its bursts.
    let mut births: Vec<(f64, f64)> = Vec::new();
    let mut counts = Vec::new();
    for thing in &scene.emitter {
        let burst: f64 = thing.burst.iter().map(|b| f64::from(b.count)).sum();
        let (rate, bursts) = match &thing.from {
            Source::Particles { of, .. } => {
                let parent = scene.emitter.iter().zip(&births).find(|(parent, _)| parent.name == *of);
                let each = |parent: f64| rate_of(thing) * parent + burst;
                parent.map_or((0.0, 0.0), |(p, (rate, bursts))| {
                    let each = each(longest(p) * (1.0 + p.lifetime_spread));
                    (rate * each, bursts * each)
                })
            }
            _ => (rate_of(thing), burst),
        };
        births.push((rate, bursts));
        // All that are born in an exchange interval stand in a list before they live, however short.
        let interval = scene.interval();
        let life = (longest(thing) * (1.0 + thing.lifetime_spread)).min(duration);
        counts.push((rate * life + bursts).min(thing.most.map_or(f64::INFINITY, f64::from)) + rate * interval);
    }
    counts
}
