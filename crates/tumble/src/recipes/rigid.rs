//! Rigid bodies: shapes, masses and inertia, and where copies stand.

use super::arrange::{Place, Wrong, each, places};
use super::body_shape::{Solid, solid};
use super::fracture::{self, Whole};
use crate::geometry::{Collider, Facets, Friction, Sampler, Shape, Vector};
use crate::math::rotation::{from_degrees, from_z_to};
use crate::math::{Quat, Random};
use crate::systems::rigid::{Birth, Body, Frame, Hull, Pattern, pose};
use parry3d_f64::math::Pose;
use std::sync::Arc;
use tumble_interface::Mesh;
use tumble_interface::scene::{BirthRegion, Body as Words, BodyEmit, BodyShape, MeshFile};

/// Bodies of an object, in their principal axes about their centre of mass.
pub struct Made {
    form: Solid,
    /// From the axes of the words to those of a body.
    own: Pose,
    /// Their surface, where what is hollow is filled.
    pub outline: Hull,
    /// That which masses of other systems touch.
    pub solid: Collider,
    /// That for pictures.
    pub mesh: Mesh,
    /// Their states at the start.
    pub bodies: Vec<Body>,
    /// How they are born, if that is during the run.
    pub birth: Option<Birth>,
    /// How they break, if they do.
    pub pattern: Option<Arc<Pattern>>,
}

impl Made {
    /// How many bodies there are, at most.
    pub fn count(&self) -> usize {
        self.birth.as_ref().map_or(self.bodies.len(), |birth| birth.count)
    }

    /// Volume of each [m³].
    pub fn volume(&self) -> f64 {
        self.form.volume
    }

    /// The surface of its bodies with its hollows, which takes time to find, and by which part of the volume of a mesh that is too large, if it is.
    pub fn hull(&self) -> (Hull, Option<f64>) {
        let (shape, place, left) = self.form.surface();
        (Hull { place: self.own * place, shape, ..self.outline.clone() }, left)
    }
}

/// The surface of a body that masses touch: `back` and `turn` lead from the axes of its words to its own.
fn touched(words: &BodyShape, mesh: &Mesh, back: impl Fn(Vector) -> Vector, turn: Quat<f64>) -> Option<Shape> {
    let zero = Vector::default();
    Some(match words {
        BodyShape::Sphere { radius } => Shape::Sphere { center: back(zero), radius: *radius },
        BodyShape::Box { size: [x, y, z] } => Shape::Box { center: back(zero), half: Vector { x: 0.5 * x, y: 0.5 * y, z: 0.5 * z }, turn },
        BodyShape::Capsule { radius, length } => {
            let tip = Vector { x: 0.0, y: 0.0, z: 0.5 * length };
            Shape::Capsule { from: back(-tip), to: back(tip), radius: *radius }
        }
        _ => {
            let vertices = mesh.vertices.iter().map(|p| back(Vector::from(*p)).into()).collect();
            Shape::Animated { facets: Facets::new(&[&Mesh { vertices, ..mesh.clone() }], &[0.0])?, shell: false }
        }
    })
}

/// How bodies are born, of which `like` is one without velocities; `axes` are their own in those of the words.
fn birth(words: &Words, emit: &BodyEmit, seed: u32, axes: Quat<f64>, like: Body) -> Result<Birth, Wrong> {
    let wrong = |key: &str, message: &str| Err((key.to_string(), message.to_string()));
    if words.arrange.is_some() {
        return wrong(".arrange", "given beside emit: bodies are born where emit.from says; leave out one of them");
    }
    if words.position != [[0.0; 3]] {
        return wrong(".position", "given beside emit: bodies are born where emit.from says; leave out one of them");
    }
    for (key, list, own) in [(".velocity", &words.velocity, "emit.velocity"), (".angular_velocity", &words.angular_velocity, "emit.spin")] {
        if !list.is_empty() {
            return wrong(key, &format!("given beside emit; say it of those that are born: {own}"));
        }
    }
    if words.rotate.len() > 1 {
        return wrong(".rotate", &format!("{} beside emit, expected none or one, of all that are born", words.rotate.len()));
    }
    if emit.random_turns && !words.rotate.is_empty() {
        return wrong(".emit.random_turns", "true, and rotate is given, too; leave out one of them");
    }
    if emit.end.is_some_and(|end| end <= emit.start) {
        return wrong(".emit.end", "it is not after start");
    }
    let from = match &emit.from {
        BirthRegion::Point { at } => Sampler::Point(Vector::from(*at)),
        BirthRegion::Disk { normal: [0.0, 0.0, 0.0], .. } => return wrong(".emit.from.disk.normal", "[0, 0, 0], expected a direction"),
        BirthRegion::Disk { center, normal, radius } => {
            Sampler::Disk(Vector::from(*center), from_z_to(Vector::from(*normal).tamed()), *radius)
        }
        BirthRegion::Sphere { center, radius } => Sampler::Ball(Vector::from(*center), *radius, false),
        BirthRegion::Box { center, size, rotate } => Sampler::Box(Vector::from(*center), Vector::from(*size), from_degrees(*rotate)),
    };
    Ok(Birth {
        rate: emit.rate,
        count: emit.count as usize,
        span: [emit.start, emit.end.unwrap_or(f64::INFINITY)],
        from,
        turn: (!emit.random_turns).then(|| from_degrees(each(&words.rotate, 0))),
        axes,
        like: Body { v: emit.velocity.into(), w: emit.spin.into(), ..like },
        random: Random::new(seed, &words.name),
    })
}

/// Width and height [m] of the first body as it stands.
fn extents(words: &Words, drawn: &Mesh) -> [f64; 2] {
    let stands = from_degrees(words.rotate.first().copied().unwrap_or_default());
    [0, 2].map(|axis| {
        let along = drawn.vertices.iter().map(|p| <[f64; 3]>::from(stands.turn(Vector::from(*p)))[axis]);
        let [low, high] = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)]);
        high - low
    })
}

/// Bodies of an object; `file` finds the meshes of its shape; `seed` is that of the scene.
pub fn bodies(words: &Words, file: &dyn Fn(&MeshFile) -> Option<Mesh>, seed: u32) -> Result<Made, Wrong> {
    let density = words.density.unwrap_or(1000.0);
    let form = solid(".shape", &words.shape, file, density)?;
    let wrong = |key: &str, message: String| Err((key.to_string(), message));
    if words.density.is_some() && words.mass.is_some() {
        return wrong(".mass", "given beside density; leave out one of them".into());
    }
    if let Some(resting) = words.friction_static.filter(|resting| *resting < words.friction) {
        return wrong(".friction_static", format!("{resting}, expected >= {}, the friction of what slides", words.friction));
    }
    let own = form.weight;
    let volume = own.mass();
    let mass = words.mass.unwrap_or(density * volume);
    // Principal axes in those of the words.
    let frame = own.principal_inertia_local_frame;
    let axes = Quat { v: Vector { x: frame.x, y: frame.y, z: frame.z }, w: frame.w };
    let center = Vector { x: own.local_com.x, y: own.local_com.y, z: own.local_com.z };
    let moments = own.principal_inertia() * (mass / volume);
    let (axes, inertia) = match words.inertia {
        Some(inertia) => (from_degrees([0.0; 3]), inertia),
        None => (axes, [moments.x, moments.y, moments.z]),
    };
    if !(mass > 0.0 && mass.is_finite() && inertia.iter().all(|i| *i > 0.0 && i.is_finite())) {
        let key = if words.mass.is_some() { ".mass" } else { ".shape" };
        return wrong(key, format!("a body of {mass:e} kg with moments of inertia {inertia:?} kg m²; expected a volume"));
    }
    if let Some([a, b, c]) = words.inertia.filter(|[a, b, c]| *a > b + c || *b > c + a || *c > a + b) {
        return wrong(".inertia", format!("[{a}, {b}, {c}] kg m²: no body has a moment larger than the sum of the others"));
    }
    let back = |p: Vector| axes.conj().turn(p - center);
    let (shape, place) = form.outline();
    let own = pose(back(Vector::default()), axes.conj());
    let place = own * place;
    let bound = shape.compute_local_bounding_sphere();
    let reach = (place * bound.center()).length() + bound.radius();
    let friction = Friction { sliding: words.friction, resting: words.friction_static.unwrap_or(words.friction) };
    let outline = Hull {
        shape,
        place,
        thickness: 0.0,
        friction,
        rolling: words.rolling_friction,
        restitution: words.restitution,
        belt: Vector::default(),
        reach,
    };
    let like = Body { inverse_mass: 1.0 / mass, inertia, ..Body::WORLD };
    let birth = words.emit.as_ref().map(|emit| birth(words, emit, seed, axes, like)).transpose()?;
    let places = if birth.is_some() { Vec::new() } else { places(words, seed, extents(words, &form.drawn), center, axes, &outline)? };
    let n = places.len();
    let fits = |key: &str, list: &[[f64; 3]]| match list.len() {
        0 | 1 => Ok(()),
        given if given == n || birth.is_some() => Ok(()),
        given => Err((format!(".{key}"), format!("{given} for {n} bodies, expected none, one, or {n}"))),
    };
    fits("rotate", &words.rotate)?;
    fits("velocity", &words.velocity)?;
    fits("angular_velocity", &words.angular_velocity)?;
    let body = |(i, place): (usize, &Place)| Body {
        x: place.x,
        q: (place.turn * axes).normalized(),
        v: each(&words.velocity, i).into(),
        w: each(&words.angular_velocity, i).into(),
        ..like
    };
    let bodies = places.iter().enumerate().map(body).collect();
    let Some(shape) = touched(&words.shape, &form.met, back, axes.conj()) else {
        return wrong(".shape", "its surface has no triangle with an area".into());
    };
    let solid = Collider {
        name: words.name.clone(),
        shape,
        inside: false,
        thickness: words.thickness,
        friction,
        rubbing: None,
        restitution: words.restitution,
        belt: Vector::default(),
        motion: None,
        rig: None,
        edges: None,
    };
    let cut = |fracture| {
        let vertices = form.met.vertices.iter().map(|p| back(Vector::from(*p)).into()).collect();
        let whole = Whole {
            mesh: &Mesh { vertices, ..form.met.clone() },
            back: &back,
            frame: Frame { center: Vector::default(), axes: Body::WORLD.q, mass, inertia },
            hull: outline.clone(),
            solid: Arc::new(solid.clone()),
            seed,
        };
        fracture::pattern(words, fracture, whole).map(Arc::new)
    };
    let pattern = words.fracture.as_ref().map(cut).transpose()?;
    let mesh = Mesh { vertices: form.drawn.vertices.iter().map(|p| back(Vector::from(*p)).into()).collect(), ..form.drawn.clone() };
    Ok(Made { form, own, outline, solid, mesh, bodies, birth, pattern })
}
