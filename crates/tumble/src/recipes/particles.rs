//! Free masses, and springs between chosen ones.

use super::Site;
use super::loads::load;
use super::pins::{Pinnable, pin};
use crate::geometry::Vector;
use crate::math::Random;
use crate::math::functions::{cos, pow, sin};
use crate::systems::dynamics::{Liquid, SpringPart};
use tumble_interface::scene::{CloudShape, Fluid, Particles};

/// What the random numbers of a cloud are drawn for.
const PLACE: u32 = 0;
const DIRECTION: u32 = 1;

/// Puts the masses of an object's cloud, or those of its liquid, into its lists.
pub fn draw_cloud(thing: &mut Particles, seed: u32) {
    if let Some(fluid) = &thing.fluid {
        let [s, mass] = [fluid.spacing, fluid.density * fluid.spacing * fluid.spacing * fluid.spacing];
        for fill in &fluid.fill {
            let n = fill.size.map(|size| (size / s).round().max(1.0) as u64);
            for k in 0..n[0] * n[1] * n[2] {
                let at = [k % n[0], k / n[0] % n[1], k / (n[0] * n[1])];
                thing.position.push(std::array::from_fn(|a| fill.center[a] + s * (at[a] as f64 - 0.5 * (n[a] - 1) as f64)));
            }
        }
        thing.mass = vec![mass];
    }
    let Some(cloud) = thing.cloud.take() else { return };
    let random = Random::new(seed, &thing.name);
    let full: Vec<usize> = (0..3).filter(|a| cloud.size[*a] > 0.0).collect();
    thing.position = (0..u64::from(cloud.count))
        .map(|id| {
            let [a, b, c, _] = random.uniform(id, 0, PLACE);
            // In a sphere: a direction and a radius whose power, of as many dimensions as there are, is uniform.
            let offset = match cloud.shape {
                CloudShape::Box => [a - 0.5, b - 0.5, c - 0.5],
                CloudShape::Sphere => {
                    let radius = 0.5 * pow(c, 1.0 / full.len().max(1) as f64);
                    direction(&full, a, b).map(|d| d * radius)
                }
            };
            std::array::from_fn(|k| cloud.center[k] + cloud.size[k] * offset[k])
        })
        .collect();
    let fits = thing.velocity.len() <= 1 || thing.velocity.len() == cloud.count as usize;
    if cloud.speed > 0.0 && fits {
        let given = |id: usize| thing.velocity.get(id).or(thing.velocity.first()).copied().unwrap_or_default();
        thing.velocity = (0..cloud.count as usize)
            .map(|id| {
                let [a, b, ..] = random.uniform(id as u64, 0, DIRECTION);
                let (v, d) = (given(id), direction(&full, a, b));
                std::array::from_fn(|k| v[k] + cloud.speed * d[k])
            })
            .collect();
    }
}

/// A direction from two numbers that are uniform in [0, 1): on the sphere, the circle or the line of these axes.
fn direction(axes: &[usize], a: f64, b: f64) -> [f64; 3] {
    let turn = std::f64::consts::TAU * a;
    let mut d = [0.0; 3];
    match *axes {
        [k] => d[k] = if a < 0.5 { -1.0 } else { 1.0 },
        [k, l] => (d[k], d[l]) = (cos(turn), sin(turn)),
        _ => {
            let z = 2.0 * b - 1.0;
            let r = (1.0 - z * z).sqrt();
            d = [r * cos(turn), r * sin(turn), z];
        }
    }
    d
}

/// Adds the masses and springs.
pub fn particles(site: &mut Site<'_>, thing: &Particles) {
    let path = format!("particles \"{}\"", thing.name);
    let n = thing.position.len();
    site.parts.begin(&thing.name, thing.radius);
    if !matches!(thing.velocity.len(), 0 | 1) && thing.velocity.len() != n {
        site.wrong(
            format!("{path}.velocity"),
            format!("{} velocities for {n} positions, expected none, one, or {n}", thing.velocity.len()),
        );
    }
    if thing.mass.len() != 1 && thing.mass.len() != n {
        site.wrong(format!("{path}.mass"), format!("{} masses for {n} positions, expected one or {n}", thing.mass.len()));
    }
    if thing.charge.len() > 1 && thing.charge.len() != n {
        site.wrong(format!("{path}.charge"), format!("{} charges for {n} positions, expected none, one or {n}", thing.charge.len()));
    }
    let one = |list: &[f64], i: usize| *list.get(i).or(list.first()).unwrap_or(&1.0);
    let mut first = 0;
    for (i, x) in thing.position.iter().enumerate() {
        let v = thing.velocity.get(i).or(thing.velocity.first()).copied().unwrap_or_default();
        let index = site.parts.point(Vector::from(*x), Vector::from(v), one(&thing.mass, i));
        if let Some(charge) = thing.charge.get(i).or(thing.charge.first()) {
            site.parts.charge(index, *charge);
        }
        if i == 0 {
            first = index;
        }
    }
    let pinnable = Pinnable { path: &path, n: &[n as u32], first, is_lattice: false, clamps: false };
    pin(site, &pinnable, &thing.pin);
    load(site, &pinnable, &thing.load, &thing.point_mass);
    if let Some(words) = &thing.shape_matching {
        site.shape(first as usize..first as usize + n, words, &path);
    }
    if let Some(Fluid { spacing, stiffness, viscosity, .. }) = thing.fluid {
        let liquid = Liquid { spacing, bulk: stiffness.unwrap_or(f64::INFINITY), viscosity };
        site.parts.liquid(format!("{path}.fluid"), first as usize..first as usize + n, liquid);
    }
    for (i, spring) in thing.spring.iter().enumerate() {
        let [a, b] = spring.between;
        if a.max(b) as usize >= n || a == b {
            let message = format!("[{a}, {b}], expected two different indices below {n}");
            site.wrong(format!("{path}.spring[{i}].between"), message);
            continue;
        }
        let ends = [first + a, first + b];
        let distance = (site.parts.position(ends[1]) - site.parts.position(ends[0])).norm();
        let rest = spring.rest_length.unwrap_or(distance);
        if rest == 0.0 && (spring.hardening > 0.0 || spring.tension_only || spring.break_strain.is_some()) {
            site.wrong(format!("{path}.spring[{i}]"), "hardening, tension_only and break_strain need a rest length above 0");
            continue;
        }
        let (stiffness, damping) = (spring.stiffness, spring.damping);
        site.parts.spring(SpringPart {
            ends,
            stiffness,
            damping,
            rest,
            hardening: spring.hardening,
            tension_only: spring.tension_only,
            break_strain: spring.break_strain,
        });
    }
}
