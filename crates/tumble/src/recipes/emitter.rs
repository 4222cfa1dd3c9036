//! Sources of particles, from the words of a scene.

use super::Site;
use super::scenery::{placed, solid};
use crate::geometry::{Sampler, Vector};
use crate::math::rotation::{from_degrees, from_z_to};
use crate::pool::{Course, Emitter, Kill, Origin};
use tumble_interface::Mesh;
use tumble_interface::check::plain;
use tumble_interface::fault::Fault;
use tumble_interface::scene::{Cause, Collider, Emitter as Words, Event, Kill as Rule, MeshFile, Shape as Solid, Source, WhenFull};

/// Names that frames and files need for themselves.
const TAKEN: [&str; 19] = [
    "position",
    "velocity",
    "id",
    "age",
    "radius",
    "mass",
    "color",
    "orientation",
    "turn",
    "translation",
    "first",
    "x",
    "y",
    "z",
    "vx",
    "vy",
    "vz",
    "red",
    "green",
];

/// What is wrong with the words of children: of which emitter, at which event and causes.
fn refuse_births(
    words: &Words,
    course: &Course,
    (of, at, cause): (&str, Event, &[Cause]),
    parent: Option<(&Words, bool)>,
    wrong: &mut impl FnMut(&str, &str),
) {
    if let Some(i) = words.burst.iter().position(|b| b.time != 0.0) {
        wrong(&format!(".burst[{i}].time"), "children are born when the parent dies or bounces; leave it out");
    }
    if !course.rate.is_constant() {
        wrong(".rate", "the rate of children goes by the age of each parent and is constant");
    }
    if words.path.constant() != Some([0.0; 3]) {
        wrong(".path", "children are born where their parents are; leave it out");
    }
    if parent.is_some_and(|(_, elsewhere)| elsewhere) && words.rate.constant() != Some(0.0) {
        wrong(
            ".rate",
            "children by rate follow living parents, and these are in another system; leave it out, or put both into one system",
        );
    }
    let parent = parent.map(|(words, _)| words);
    let dies = |cause: &Cause| {
        parent.is_none_or(|p| match cause {
            Cause::Lifetime => p.lifetime.is_some(),
            Cause::Replaced => p.when_full == WhenFull::ReplaceOldest,
            _ => p.kill.iter().any(|rule| cause_of(rule) == *cause),
        })
    };
    let key = |key: &str| format!(".from.particles.{key}");
    if at == Event::Bounce && !cause.is_empty() {
        wrong(&key("cause"), "a bounce is no death; leave it out");
    } else if let Some(i) = cause.iter().position(|c| !dies(c)) {
        wrong(&key(&format!("cause[{i}]")), &format!("nothing of \"{of}\" dies of that; give it such a rule, or leave it out"));
    }
    if (at != Event::Death || !cause.is_empty()) && words.burst.iter().all(|b| b.count == 0) {
        wrong(".burst", "missing: at and cause say when a burst is born; give one with a count");
    }
}

/// What the points of a source are spread over; none of one whose points are particles. `wrong` is told the key and what is wrong there.
pub fn sampler<'a>(from: &Source, mesh: &dyn Fn(&MeshFile) -> Option<&'a Mesh>, wrong: &mut dyn FnMut(&str, &str)) -> Option<Sampler> {
    let vector = |v: &[f64; 3]| Vector::from(*v);
    let mut sampled = |key: &str, file: &MeshFile, sampler: fn(&Mesh) -> Option<Sampler>, nothing: &str| match mesh(file) {
        None => {
            wrong(key, "the mesh has not been loaded");
            None
        }
        Some(mesh) => {
            let sampler = sampler(&placed(mesh, file));
            if sampler.is_none() {
                wrong(key, nothing);
            }
            sampler
        }
    };
    match from {
        Source::Point { at } => Some(Sampler::Point(vector(at))),
        Source::Curve { points } => {
            let curve = Sampler::curve(points);
            if curve.is_none() {
                wrong(".curve.points", "they are all in one place; use a point");
            }
            curve
        }
        Source::Disk { normal: [0.0, 0.0, 0.0], .. } => {
            wrong(".disk.normal", "[0, 0, 0], expected a direction");
            None
        }
        Source::Disk { center, normal, radius } => Some(Sampler::Disk(vector(center), from_z_to(vector(normal).tamed()), *radius)),
        Source::Sphere { center, radius, surface } => Some(Sampler::Ball(vector(center), *radius, *surface)),
        Source::Box { center, size, rotate } => Some(Sampler::Box(vector(center), vector(size), from_degrees(*rotate))),
        Source::MeshSurface(file) => sampled(".mesh_surface", file, Sampler::surface, "the mesh has no triangle with an area"),
        Source::MeshVolume(file) => {
            let nothing = "the mesh has no inside; close it, turn its triangles outward, or use mesh_surface";
            let closed = |mesh: &Mesh| Sampler::volume(mesh);
            if let Some(Fault { defects, place, cure }) = mesh(file).and_then(Mesh::fault) {
                let n = defects.open_edges + defects.bad_edges;
                let message =
                    format!("the mesh has no inside: {n} edges are open or inconsistent, for example {place}; {cure}, or use mesh_surface");
                wrong(".mesh_volume", &message);
                None
            } else {
                sampled(".mesh_volume", file, closed, nothing)
            }
        }
        Source::Particles { .. } => None,
    }
}

/// Adds an emitter. `mesh` finds the mesh of a file; `flat` is the axis that is missing in two dimensions.
pub fn emitter<'a>(
    site: &mut Site<'_>,
    words: &Words,
    course: Course,
    (seed, flat): (u32, Option<usize>),
    parent: Option<(&Words, bool)>,
    mesh: &dyn Fn(&MeshFile) -> Option<&'a Mesh>,
) {
    let path = format!("emitter \"{}\"", words.name);
    let mut wrong = |key: &str, message: &str| site.issues.push(tumble_interface::Issue::new(format!("{path}{key}"), message));
    if words.rate.constant() == Some(0.0) && words.burst.iter().all(|b| b.count == 0) {
        wrong("", "it makes no particles; give it a rate, or a burst with a count");
    }
    if let Source::Particles { of, at, cause } = &words.from {
        refuse_births(words, &course, (of, *at, cause), parent, &mut wrong);
    }
    if words.end.is_some_and(|end| end <= words.start) {
        wrong(".end", "it is not after start");
    }
    if words.direction == Some([0.0; 3]) {
        wrong(".direction", "[0, 0, 0], expected a direction");
    }
    if words.lifetime.is_none() && words.lifetime_spread != 0.0 {
        wrong(".lifetime_spread", &format!("{}, but there is no lifetime to spread; set lifetime", words.lifetime_spread));
    }
    if words.color.is_none() && (words.color_to.is_some() || words.color_end.is_some()) {
        wrong(".color", "color_to and color_end need a color to start from");
    }
    if words.color_end.is_some() && words.lifetime.is_none() {
        wrong(".color_end", "particles without a lifetime have no end to fade to; set lifetime");
    }
    if words.most.is_none() && words.when_full != Default::default() {
        wrong(".when_full", "it never is full; set most");
    }
    if let Some(name) = words.columns.keys().find(|name| {
        TAKEN.contains(&name.as_str()) || name.is_empty() || *name == "blue" || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    }) {
        wrong(&format!(".columns.{name}"), &format!("expected a name of letters, digits and _ that is none of {}", TAKEN.join(", ")));
    }
    if let Some((name, b)) = words.columns.iter().find(|(_, b)| b.to.is_some_and(|to| to < b.from)) {
        wrong(&format!(".columns.{name}.to"), &format!("{}, expected >= {}", plain(b.to.unwrap_or_default()), plain(b.from)));
    }
    let place = sampler(&words.from, mesh, &mut |key, message| wrong(&format!(".from{key}"), message));
    let mut kill = Vec::new();
    for (i, rule) in words.kill.iter().enumerate() {
        let mut region = |shape: &Solid| -> Option<crate::geometry::Collider> {
            let file: Vec<Mesh> =
                if let Solid::Mesh(file) = shape { mesh(file).map(|mesh| placed(mesh, file)).into_iter().collect() } else { Vec::new() };
            match solid(&bounds(shape), &file, None, &[]) {
                Ok(solid) => Some(solid),
                Err((key, message)) => {
                    let key = key.trim_start_matches(".shape");
                    wrong(&format!(".kill[{i}]{key}"), &message);
                    None
                }
            }
        };
        kill.extend(match rule {
            Rule::Inside(shape) => region(shape).map(Kill::Inside),
            Rule::Outside(shape) => region(shape).map(Kill::Outside),
            Rule::NearCollider(distance) => Some(Kill::NearCollider(*distance)),
            Rule::SlowerThan(speed) => Some(Kill::SlowerThan(*speed)),
            Rule::FasterThan(speed) => Some(Kill::FasterThan(*speed)),
        });
    }
    let parent = match &words.from {
        Source::Particles { of, .. } => {
            let parent = match site.parts.stream(of) {
                Some(stream) => Some(Origin::Particles(stream)),
                None => parent.filter(|(_, elsewhere)| *elsewhere).map(|_| Origin::Elsewhere(of.clone())),
            };
            if parent.is_none() {
                let message = format!(
                    "\"{of}\" is no emitter of the same system that stands before this one, nor one of a system that comes before its own"
                );
                wrong(".from.particles.of", &message);
            }
            parent
        }
        _ => None,
    };
    if let Some(origin) = place.map(Origin::Place).or(parent) {
        site.parts.emitter(Emitter::new(words.clone(), course, seed, origin, kill, site.up, flat));
    }
}

/// What those die of whom a rule kills.
fn cause_of(rule: &Rule) -> Cause {
    match rule {
        Rule::Inside(_) => Cause::Inside,
        Rule::Outside(_) => Cause::Outside,
        Rule::NearCollider(_) => Cause::NearCollider,
        Rule::SlowerThan(_) => Cause::SlowerThan,
        Rule::FasterThan(_) => Cause::FasterThan,
    }
}

/// A shape that only bounds a region: no mesh. `Err` says what is wrong with which key.
pub fn region(shape: &Solid) -> Result<crate::geometry::Collider, (String, String)> {
    volume(shape, &[])
}

/// The same, or a closed mesh that has been loaded.
pub fn volume(shape: &Solid, meshes: &[Mesh]) -> Result<crate::geometry::Collider, (String, String)> {
    solid(&bounds(shape), meshes, None, &[]).map_err(|(key, message)| (key.trim_start_matches(".shape").to_string(), message))
}

/// A solid that only bounds a region.
fn bounds(shape: &Solid) -> Collider {
    Collider {
        name: String::new(),
        shape: shape.clone(),
        thickness: 0.0,
        friction: 0.0.into(),
        friction_static: None,
        restitution: 0.0,
        color: None,
        inside: false,
        edges: false,
        belt: [0.0; 3],
        motion: None,
    }
}
