//! Hair: rods planted on a surface, clamped at their roots, at rest as they are groomed.
//!
//! A round strand of radius r has                                          (hair.1)
//!
//!   E A = E pi r²,   E I = E pi r⁴/4,   G J = E I/(1 + nu),   k_s G A = E A/(2 (1 + nu))
//!
//! Its natural curvature is that of the shape in which it starts (hair.3). Verified in `tests/hair.rs`.

use super::Site;
use super::guides::{Ground, MOST, combed, guided};
use crate::geometry::{Carrier, Collider, Sampler, Vector, spread};
use crate::math::functions::{cos, sin};
use crate::math::rotation::from_z_to;
use crate::math::{Quat, Random};
use std::f64::consts::{PI, TAU};
use tumble_interface::Mesh;
use tumble_interface::scene::Hair;

/// Roots that are tried for each that must be above a height.
const TRIES: u32 = 4096;
/// Random points for each root that is wanted, and in all as long as there are two for each.
const CANDIDATES: u64 = 5;
const MOST_CANDIDATES: u64 = 2_000_000;
/// Times that a point is moved out of a solid.
const COMB: usize = 6;

/// Adds the masses, frames and elements of all strands.
pub fn hair(site: &mut Site<'_>, thing: &Hair, seed: u32, ground: &Ground<'_>) {
    let grown = match &thing.guides {
        None => grown(site, thing, seed, ground.mesh),
        Some(words) => match site.assets.curves(&words.path) {
            Some(curves) => guided(site, thing, words, curves, ground),
            None => return site.wrong(format!("hair \"{}\".guides", thing.name), "the curves have not been loaded"),
        },
    };
    let Some(grown) = grown else { return };
    let groomed: Vec<Vec<Vector>> = grown.into_iter().map(|shape| shape.into_iter().map(|p| ground.pose.out(p)).collect()).collect();
    let mut shapes = groomed.clone();
    if let Some((solid, ..)) = ground.solid {
        for shape in &mut shapes {
            let length = thing.length.unwrap_or_else(|| shape.windows(2).map(|p| (p[1] - p[0]).norm()).sum());
            comb(shape, solid, 1.02 * solid.thickness + 1e-4 * length);
        }
    }
    if thing.guides.is_some() {
        combed(site, thing, groomed.iter().zip(&shapes).map(|(was, is)| (&was[..], &is[..])));
    }
    site.parts.begin(&thing.name, thing.radius);
    shapes.iter().for_each(|shape| plant(site, thing, shape, ground));
    let n = thing.segments + 1;
    if let Some(object) = site.parts.object() {
        object.curve = (0..shapes.len() as u32 * n).collect();
        object.curve_points = n;
    }
    if let Some(words) = &thing.collisions {
        site.parts.hair_continuum(words.clone());
    }
}

/// Points of strands that grow on a surface; `None` where they cannot.
fn grown(site: &mut Site<'_>, thing: &Hair, seed: u32, mesh: Option<&Mesh>) -> Option<Vec<Vec<Vector>>> {
    let path = format!("hair \"{}\"", thing.name);
    let mut wrong = |key: &str, message: String| {
        site.wrong(format!("{path}{key}"), message);
        None
    };
    let place = if thing.mesh.is_some() { ".mesh" } else { ".on" };
    let Some((mesh, sampler)) = mesh.and_then(|mesh| Some((mesh, Sampler::surface(mesh)?))) else {
        return wrong(place, "the surface has no triangle with an area, so nothing can grow on it".into());
    };
    let length = thing.length.unwrap_or(0.0);
    let corner = |i: u32| Vector::from(mesh.vertices[i as usize]);
    let twice = |t: &[u32; 3]| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).norm();
    let area = mesh.triangles.iter().map(twice).sum::<f64>() / 2.0;
    let wanted = thing.per_area.map_or(f64::from(thing.count.unwrap_or(1)), |n| (n * area).round());
    if !(1.0..=MOST).contains(&wanted) || wanted * f64::from(thing.segments) > 10.0 * MOST {
        let (key, most) = (if thing.per_area.is_some() { ".per_area" } else { ".count" }, MOST);
        let message = format!("{wanted} strands of {} segments, expected 1 to {most:.0e} strands and at most 1e8 segments", thing.segments);
        return wrong(key, message);
    }
    if let Some(curl) = &thing.curl {
        let turn = length / f64::from(thing.segments) / curl.radius.hypot(curl.pitch / TAU);
        if turn > 1.5 {
            let least = (f64::from(thing.segments) * turn / 1.5).ceil();
            let message = format!(
                "{} pieces of a strand turn by {turn:.1} rad each in its curl, expected at most 1.5 rad: {least} segments",
                thing.segments
            );
            return wrong(".segments", message);
        }
    }
    let random = Random::new(seed, &thing.name);
    let Some(roots) = sown(&sampler, &random, wanted as u64, (thing.above, area)) else {
        return wrong(".above", "almost none of the surface is above this height; lower it".into());
    };
    let grown: Vec<Vec<Vector>> = roots.iter().enumerate().map(|(i, root)| strand(thing, &random, i as u64, *root)).collect();
    let Some(clump) = &thing.clump else { return Some(grown) };
    let middles = (clump.count as usize).min(roots.len());
    let shape = |i: usize| {
        let near = nearest(&roots[..middles], roots[i].0);
        drawn(&grown[i], &grown[near], clump.strength)
    };
    Some((0..grown.len()).map(|i| if i < middles { grown[i].clone() } else { shape(i) }).collect())
}

/// Roots in blue noise above a height on a surface of that area, in an order in which the first ones of any number, centres of clumps, are in blue
/// noise, too. `None` where almost nothing is above the height.
fn sown(sampler: &Sampler, random: &Random, count: u64, (above, area): (Option<f64>, f64)) -> Option<Vec<(Vector, Vector)>> {
    let candidates = (CANDIDATES * count).min(MOST_CANDIDATES).max(2 * count);
    let mut tried = 0;
    let mut one = |id: u64| {
        let at = |k: u32| sampler.sample(&|j| random.uniform(id, k, j));
        let (k, root) = (0..TRIES).map(|k| (k, at(k))).find(|(_, (x, _))| above.is_none_or(|z| x.z > z))?;
        tried += u64::from(k) + 1;
        Some(root)
    };
    let points: Vec<(Vector, Vector)> = (0..candidates).map(&mut one).collect::<Option<_>>()?;
    let order = spread(&points, count as usize, area * candidates as f64 / tried as f64);
    Some(order.into_iter().map(|i| points[i as usize]).collect())
}

/// The nearest of some roots.
fn nearest(roots: &[(Vector, Vector)], x: Vector) -> usize {
    let far = |i: usize| (roots[i].0 - x).norm_sq();
    (0..roots.len()).reduce(|a, b| if far(b) < far(a) { b } else { a }).unwrap_or(0)
}

/// A strand drawn to the middle of its clump by a share that grows with the square of the way from the root, and brought back to the
/// length of its pieces.
fn drawn(own: &[Vector], middle: &[Vector], strength: f64) -> Vec<Vector> {
    let last = (own.len() - 1) as f64;
    // Half of the way is kept apart, so that strands do not lie in each other.
    let target = |i: usize| own[i] + (middle[i] - own[i]) * (strength * (i as f64 / last).powi(2));
    let mut out = vec![own[0]];
    for i in 1..own.len() {
        // Along the drawn strand: towards its points would lead back, where pieces of full length have gone farther than they.
        let (way, piece) = (target(i) - target(i - 1), own[i] - own[i - 1]);
        let along = if way.norm() > 1e-9 * piece.norm() { way.normalized() } else { piece.normalized() };
        out.push(out[i - 1] + along * piece.norm());
    }
    out
}

/// Moves points out of a solid, to a distance [m] from it, and keeps the lengths of pieces: what starts in contact at its roots would
/// strive against it for ever.
fn comb(shape: &mut [Vector], solid: &Collider, clear: f64) {
    for i in 1..shape.len() {
        let (before, l) = (shape[i - 1], (shape[i] - shape[i - 1]).norm());
        let rest = shape[i..].to_vec();
        let start = shape[i];
        for _ in 0..COMB {
            let (distance, normal) = solid.distance(shape[i], 0.0, clear);
            if distance >= clear {
                break;
            }
            let way = shape[i] + normal * (clear - distance) - before;
            if way.norm() > 0.0 {
                shape[i] = before + way.normalized() * l;
            }
        }
        // The rest of the strand comes along.
        let moved = shape[i] - start;
        shape[i..].iter_mut().zip(rest).for_each(|(x, was)| *x = was + moved);
    }
}

/// The points of a strand: straight, or a spiral of that radius and pitch which leaves the root in the direction of growth.
///
/// x(s) = (R (cos(a) - 1), R sin(a), b a),  a = s/sqrt(R² + b²),  b = pitch/(2 pi)                          (hair.2)
fn strand(thing: &Hair, random: &Random, id: u64, (root, normal): (Vector, Vector)) -> Vec<Vector> {
    let [u, v, ..] = random.uniform(id, u32::MAX, 0);
    let length = thing.length.unwrap_or(0.0) * (1.0 - thing.spread * u);
    let n = thing.segments as usize;
    let grows = normal + Vector::from(thing.lean);
    let along = if grows.norm() > 1e-9 { grows.normalized() } else { normal };
    let l = length / n as f64;
    let Some(curl) = &thing.curl else {
        return (0..=n).map(|i| root + along * (l * i as f64)).collect();
    };
    let b = curl.pitch / TAU;
    // Pieces are chords: of the angle a of one piece, l² = 4 R² sin²(a/2) + b² a².
    let chord = |a: f64| (4.0 * (curl.radius * sin(a / 2.0)).powi(2) + (b * a).powi(2)).sqrt();
    let (low, high) = crate::math::bisect((0.0, PI), 60, |a| chord(a) < l);
    let a = 0.5 * (low + high);
    let spiral = |i: usize| {
        let t = a * i as f64;
        Vector { x: curl.radius * (cos(t) - 1.0), y: curl.radius * sin(t), z: b * t }
    };
    // Its first piece points along the direction of growth, turned about it at random.
    let first = from_z_to(spiral(1)).conj();
    let spin = Quat { v: Vector { x: 0.0, y: 0.0, z: sin(PI * v) }, w: cos(PI * v) };
    let turn = from_z_to(along) * spin * first;
    (0..=n).map(|i| root + turn.turn(spiral(i))).collect()
}

/// Masses, frames and elements of a strand at rest.
fn plant(site: &mut Site<'_>, thing: &Hair, shape: &[Vector], ground: &Ground<'_>) {
    let n = shape.len() - 1;
    let area = PI * thing.radius * thing.radius;
    let per_length = thing.density * area;
    let (stretch, bend) = (thing.young * area, thing.young * area * thing.radius * thing.radius / 4.0);
    let (shear, twist) = (1.0 / (2.0 * (1.0 + thing.poisson)), 1.0 / (1.0 + thing.poisson));
    let mut points = Vec::with_capacity(n + 1);
    for (i, x) in shape.iter().enumerate() {
        let before = if i > 0 { (*x - shape[i - 1]).norm() } else { 0.0 };
        let after = if i < n { (shape[i + 1] - *x).norm() } else { 0.0 };
        points.push(site.parts.point(*x, Vector::default(), per_length * 0.5 * (before + after)));
    }
    site.parts.pin(points[0]);
    let mut turn = from_z_to(shape[1] - shape[0]);
    // A stick's inertia beside the wire's own.                                                            (hair.4)
    let inertia = |l: f64| per_length * l * (thing.radius * thing.radius / 2.0 + l * l / 12.0);
    let held = site.parts.frame(turn.row(), inertia((shape[1] - shape[0]).norm()));
    site.parts.clamp_frame(held);
    if let Some((solid, number, bone)) = ground.solid {
        let carrier = bone.map_or_else(|| solid.carrier(shape[0]), Carrier::Bone);
        let pose = solid.pose(carrier, 0.0);
        site.parts.carry((number, carrier), points[0], pose.back(shape[0]), held, pose.turn.conj() * turn);
    }
    let mut before = (held, turn, 0.0);
    for i in 0..n {
        let way = shape[i + 1] - shape[i];
        let l = way.norm();
        let d = way.normalized();
        turn = if i == 0 { turn } else { super::rope::shortest(turn.axis_z(), d) * turn };
        let frame = site.parts.frame(turn.row(), inertia(l));
        let k = stretch * l;
        site.parts.rod_stretch([points[i], points[i + 1]], frame, [l, shear.sqrt()], k, k * thing.damping, None);
        let distance = 0.5 * (before.2 + l);
        let p = before.1.conj() * turn;
        let c = if p.w < 0.0 { -2.0 } else { 2.0 } / distance;
        let k = bend * distance;
        let rest = [2.0 / distance, c * p.v.x, c * p.v.y, c * p.v.z, 1.0, twist.sqrt()];
        site.parts.rod_bend([before.0, frame], rest, k, k * thing.damping);
        before = (frame, turn, l);
    }
}
