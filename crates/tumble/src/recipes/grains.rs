//! Grains: where they start, and how large each is.

use super::clump;
use super::emitter::{sampler, volume};
use crate::geometry::Vector;
use crate::math::functions::{cos, sin};
use crate::math::rotation::from_degrees;
use crate::math::{Quat, Random};
use crate::systems::grains::{Clump, Grain, Pour};
use std::f64::consts::PI;
use tumble_interface::Mesh;
use tumble_interface::check::short;
use tumble_interface::scene::{Emit, FillShape, GrainFill, Grains as Words, MeshFile, Source};

/// Key and message of what is wrong.
type Wrong = (String, String);

// Purposes of random numbers.
const RADIUS: u32 = 0;
const PLACE: u32 = 1;
const TURN: u32 = 2;

/// Grains, those that are poured in later at the end, and the clumps that they make, with the place of each grain [m] in the axes of its own.
pub struct Made {
    pub grains: Vec<Grain>,
    pub pour: Option<Pour>,
    pub clumps: Vec<Clump>,
    pub local: Vec<Vector>,
}

/// The grains of an object, with the meshes that its fills name, or all that is wrong with them.
pub fn grains<'a>(
    words: &Words,
    seed: u32,
    meshes: &[Vec<Mesh>],
    mesh: &dyn Fn(&MeshFile) -> Option<&'a Mesh>,
) -> Result<Made, Vec<Wrong>> {
    let random = Random::new(seed, &words.name);
    let mut wrong = Vec::new();
    let mut places: Vec<Vector> = words.position.iter().map(|x| Vector::from(*x)).collect();
    let given = places.len();
    let union = words.clump.as_ref().map(clump::union).transpose();
    if let Err((key, message)) = &union {
        // What it is like says how much room it takes.
        return Err(vec![(format!(".clump{key}"), message.clone())]);
    }
    let union = union.ok().flatten();
    if !words.rotate.is_empty() && union.is_none() {
        wrong.push((".rotate".into(), "given to balls; leave it out, or give them a clump".into()));
    }
    if given == 0 && words.fill.is_empty() && words.emit.is_none() {
        wrong.push((String::new(), "no grain; give it position, fill, or emit".into()));
    }
    let pour = words.emit.as_ref().and_then(|emit| pour(emit, words, seed, mesh, &mut wrong));
    for (k, fill) in words.fill.iter().enumerate() {
        match filled(words, fill, meshes.get(k).map_or(&[], Vec::as_slice), &random, places.len()) {
            Ok(more) => places.extend(more),
            Err((key, message)) => wrong.push((format!(".fill[{k}].{key}"), message)),
        }
    }
    let lists = [("rotate", &words.rotate), ("velocity", &words.velocity), ("angular_velocity", &words.angular_velocity)];
    for (key, list) in lists {
        let fits = list.len() < 2 || (words.fill.is_empty() && list.len() == given);
        if !fits {
            let expected =
                if words.fill.is_empty() { format!("none, one, or {given}") } else { "none or one, where grains fill volumes".into() };
            wrong.push((format!(".{key}"), format!("{} for {} grains, expected {expected}", list.len(), places.len())));
        }
    }
    if !wrong.is_empty() {
        return Err(wrong);
    }
    let each = |list: &[[f64; 3]], i: usize| Vector::from(list.get(i).or(list.first()).copied().unwrap_or_default());
    let mut made = Made { grains: Vec::new(), pour, clumps: Vec::new(), local: Vec::new() };
    let radius_of = |i: usize| words.radius * (1.0 + words.radius_spread * (2.0 * random.uniform(i as u64, 0, RADIUS)[0] - 1.0));
    let mass_of = |radius: f64| 4.0 / 3.0 * PI * radius * radius * radius * words.density;
    for (i, x) in places.iter().enumerate() {
        let radius = radius_of(i);
        let [v, w] = [each(&words.velocity, i), each(&words.angular_velocity, i)];
        let Some(union) = &union else {
            made.grains.push(Grain { x: *x, radius, mass: mass_of(radius), v, w });
            made.local.push(Vector::default());
            continue;
        };
        let turn = match words.rotate.get(i).or(words.rotate.first()) {
            Some(angles) => from_degrees(*angles),
            None if i < given => from_degrees([0.0; 3]),
            None => any_turn(random.uniform(i as u64, 0, TURN)),
        };
        let first = made.grains.len() as u32;
        let (clump, spheres) = union.clump([radius, words.density], [*x, v, w], turn, first);
        for (local, radius) in spheres {
            let arm = clump.q.turn(local);
            made.grains.push(Grain { x: clump.x + arm, radius, mass: clump.mass, v: clump.v + w.cross(arm), w });
            made.local.push(local);
        }
        made.clumps.push(clump);
    }
    if let Some(emit) = &words.emit {
        let none = Vector::default();
        for i in places.len()..places.len() + emit.count as usize {
            let radius = radius_of(i);
            made.grains.push(Grain { x: none, radius, mass: mass_of(radius), v: emit.velocity.into(), w: none });
            made.local.push(none);
        }
    }
    Ok(made)
}

/// How grains are poured in.
fn pour<'a>(emit: &Emit, words: &Words, seed: u32, mesh: &dyn Fn(&MeshFile) -> Option<&'a Mesh>, wrong: &mut Vec<Wrong>) -> Option<Pour> {
    let mut tell = |key: &str, message: &str| wrong.push((format!(".emit{key}"), message.into()));
    if words.clump.is_some() {
        tell("", "only balls are poured; leave out clump, or give the clumps a fill");
    }
    if emit.end.is_some_and(|end| end <= emit.start) {
        tell(".end", "it is not after start");
    }
    if matches!(emit.from, Source::Particles { .. }) {
        tell(".from.particles", "grains are born of no particles; take a disk or a box");
    }
    let place = sampler(&emit.from, mesh, &mut |key, message| tell(&format!(".from{key}"), message))?;
    Some(Pour::new(emit.clone(), place, Random::new(seed, &words.name)))
}

/// A rotation, all alike likely, of three numbers that are uniform between 0 and 1 [shoemake1992].
fn any_turn([a, b, c, _]: [f64; 4]) -> Quat<f64> {
    let [s, t] = [(1.0 - a).sqrt(), a.sqrt()];
    let [b, c] = [b, c].map(|u| 2.0 * PI * u);
    Quat::from_row([s * sin(b), s * cos(b), t * sin(c), t * cos(c)])
}

/// Places in a volume, layer by layer from the bottom: on a cubic lattice, each moved at random within the gap to its neighbours.
fn filled(words: &Words, fill: &GrainFill, meshes: &[Mesh], random: &Random, first: usize) -> Result<Vec<Vector>, Wrong> {
    let spacing = words.spacing();
    let gap = spacing - 2.0 * words.reach();
    let [nx, ny, nz] = fill.places(spacing).map(|n| n as usize);
    let reach: [f64; 3] = fill.size.map(|size| 0.5 * (size - spacing));
    let inside = |p: [f64; 3]| {
        let part = |a: usize| {
            if reach[a] > 0.0 {
                (p[a] / reach[a]).powi(2)
            } else if p[a] == 0.0 {
                0.0
            } else {
                f64::INFINITY
            }
        };
        match fill.shape {
            FillShape::Box => true,
            FillShape::Cylinder => part(0) + part(1) <= 1.0,
            FillShape::Sphere => part(0) + part(1) + part(2) <= 1.0,
        }
    };
    // Along x and y in the middle, along z on the bottom.
    let at = |i: usize, n: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * spacing;
    let lattice = (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])));
    let places = lattice.map(|[i, j, k]| [at(i, nx), at(j, ny), (k as f64 + 0.5) * spacing - 0.5 * fill.size[2]]).filter(|p| inside(*p));
    let solid = fill.within.as_ref().map(|shape| volume(shape, meshes)).transpose();
    // By its triangles: the distance of a grid is off by parts of its cells.
    let solid = solid.map_err(|(key, message)| (format!("within{key}"), message))?.map(|solid| solid.by_triangles());
    let held = |p: &Vector| solid.as_ref().is_none_or(|solid| solid.distance(*p, 0.0, words.reach()).0 <= -words.reach());
    let count = fill.count.map_or(usize::MAX, |count| count as usize);
    let moved = |(n, p): (usize, [f64; 3])| {
        let u = random.uniform((first + n) as u64, 0, PLACE);
        Vector::from(std::array::from_fn::<f64, 3, _>(|a| fill.center[a] + p[a] + gap * (u[a] - 0.5)))
    };
    let places: Vec<Vector> = places.enumerate().map(moved).filter(held).take(count).collect();
    if places.is_empty() && solid.is_some() {
        let message =
            format!("no grain of up to {} m lies in it and in the box; enlarge or move one of them, or lower radius", short(words.reach()));
        return Err(("within".into(), message));
    }
    if places.is_empty() {
        let message = format!(
            "{:?} m holds no grain of up to {} m; make each edge at least {} m, or lower radius",
            fill.size,
            short(words.reach()),
            short(spacing)
        );
        return Err(("size".into(), message));
    }
    if let Some(count) = fill.count.filter(|count| places.len() < *count as usize) {
        return Err(("count".into(), format!("{count}, but {} fit; enlarge size, or lower count", places.len())));
    }
    Ok(places)
}
