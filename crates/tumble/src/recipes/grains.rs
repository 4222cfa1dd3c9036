//! Grains: where they start, and how large each is.

use crate::geometry::Vector;
use crate::math::Random;
use crate::systems::grains::Grain;
use std::f64::consts::PI;
use tumble_interface::check::short;
use tumble_interface::scene::{FillShape, GrainFill, Grains as Words};

/// Key and message of what is wrong.
type Wrong = (String, String);

// Purposes of random numbers.
const RADIUS: u32 = 0;
const PLACE: u32 = 1;

/// The grains of an object, or all that is wrong with them.
pub fn grains(words: &Words, seed: u32) -> Result<Vec<Grain>, Vec<Wrong>> {
    let random = Random::new(seed, &words.name);
    let mut wrong = Vec::new();
    let mut places: Vec<Vector> = words.position.iter().map(|x| Vector::from(*x)).collect();
    let given = places.len();
    if given == 0 && words.fill.is_empty() {
        wrong.push((String::new(), "no grain; give it position, or fill".into()));
    }
    for (k, fill) in words.fill.iter().enumerate() {
        match filled(words, fill, &random, places.len()) {
            Ok(more) => places.extend(more),
            Err((key, message)) => wrong.push((format!(".fill[{k}].{key}"), message)),
        }
    }
    let lists = [("velocity", &words.velocity), ("angular_velocity", &words.angular_velocity)];
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
    let grain = |(i, x): (usize, &Vector)| {
        let [u, ..] = random.uniform(i as u64, 0, RADIUS);
        let radius = words.radius * (1.0 + words.radius_spread * (2.0 * u - 1.0));
        let mass = 4.0 / 3.0 * PI * radius * radius * radius * words.density;
        Grain { x: *x, radius, mass, v: each(&words.velocity, i), w: each(&words.angular_velocity, i) }
    };
    Ok(places.iter().enumerate().map(grain).collect())
}

/// Places in a volume, layer by layer from the bottom: on a cubic lattice, each moved at random within the gap to its neighbours.
fn filled(words: &Words, fill: &GrainFill, random: &Random, first: usize) -> Result<Vec<Vector>, Wrong> {
    let spacing = words.spacing();
    let gap = spacing - 2.0 * words.radius * (1.0 + words.radius_spread);
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
    let count = fill.count.map_or(usize::MAX, |count| count as usize);
    let moved = |(n, p): (usize, [f64; 3])| {
        let u = random.uniform((first + n) as u64, 0, PLACE);
        Vector::from(std::array::from_fn::<f64, 3, _>(|a| fill.center[a] + p[a] + gap * (u[a] - 0.5)))
    };
    let places: Vec<Vector> = places.take(count).enumerate().map(moved).collect();
    if places.is_empty() {
        let message = format!(
            "{:?} m holds no grain of up to {} m; make each edge at least {} m, or lower radius",
            fill.size,
            short(words.radius * (1.0 + words.radius_spread)),
            short(spacing)
        );
        return Err(("size".into(), message));
    }
    if let Some(count) = fill.count.filter(|count| places.len() < *count as usize) {
        return Err(("count".into(), format!("{count}, but {} fit; enlarge size, or lower count", places.len())));
    }
    Ok(places)
}
