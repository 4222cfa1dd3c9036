//! Rigid bodies: shapes, masses and inertia, and where copies stand.

use crate::geometry::{Collider, Facets, Friction, Shape, Vector, surface};
use crate::math::Quat;
use crate::math::rotation::from_degrees;
use crate::systems::rigid::{Body, Hull, pose};
use parry3d_f64::math::{Pose, Vector as V};
use parry3d_f64::shape::SharedShape;
use tumble_interface::Mesh;
use tumble_interface::scene::{Arrange, Body as Words, BodyShape};

/// Flat sides around what is round, in pictures.
const SIDES: u32 = 48;

/// Bodies of an object, in their principal axes about their centre of mass.
pub struct Made {
    /// Their surface where they touch each other.
    pub hull: Hull,
    /// The same where other systems touch them.
    pub solid: Collider,
    /// Their surface for pictures.
    pub mesh: Mesh,
    /// Volume of each [m³].
    pub volume: f64,
    /// Their states at the start.
    pub bodies: Vec<Body>,
}

/// What is wrong with which key.
type Wrong = (String, String);

/// The solid in the axes of its words, and its surface for pictures.
fn solid(words: &BodyShape, file: Option<&Mesh>) -> Result<(SharedShape, Pose, Mesh), Wrong> {
    let zero = Vector::default();
    // Axes of y become those of z.
    let upright = pose(zero, from_degrees([90.0, 0.0, 0.0]));
    let still = Pose::IDENTITY;
    let hull = |points: &[[f64; 3]]| {
        let shape = SharedShape::convex_hull(&points.iter().map(|p| V::new(p[0], p[1], p[2])).collect::<Vec<_>>());
        shape.filter(|shape| shape.mass_properties(1.0).mass() > 0.0)
    };
    let flat = |key: &str| (key.to_string(), "the points lie in a plane or too close together, expected a body with a volume".to_string());
    Ok(match words {
        BodyShape::Sphere { radius } => (SharedShape::ball(*radius), still, surface::sphere(3, zero, *radius)),
        BodyShape::Box { size: [x, y, z] } => {
            let half = Vector { x: 0.5 * x, y: 0.5 * y, z: 0.5 * z };
            (SharedShape::cuboid(half.x, half.y, half.z), still, surface::cuboid(zero, half, from_degrees([0.0; 3])))
        }
        BodyShape::Capsule { radius, length } => {
            let tip = Vector { x: 0.0, y: 0.0, z: 0.5 * length };
            (SharedShape::capsule_z(0.5 * length, *radius), still, surface::capsule(-tip, tip, *radius))
        }
        BodyShape::Cylinder { radius, height } => {
            let profile = [[0.0, -0.5 * height], [*radius, -0.5 * height], [*radius, 0.5 * height], [0.0, 0.5 * height]];
            (SharedShape::cylinder(0.5 * height, *radius), upright, surface::revolved(zero, &profile, SIDES))
        }
        BodyShape::Cone { radius, height } => {
            let profile = [[0.0, -0.5 * height], [*radius, -0.5 * height], [0.0, 0.5 * height]];
            (SharedShape::cone(0.5 * height, *radius), upright, surface::revolved(zero, &profile, SIDES))
        }
        BodyShape::Hull { points } => {
            let shape = hull(points).ok_or_else(|| flat(".shape.hull.points"))?;
            let mesh = drawn(&shape);
            (shape, still, mesh)
        }
        BodyShape::Mesh(_) => {
            let mesh = file.ok_or_else(|| (".shape.mesh".to_string(), "the mesh has not been loaded".to_string()))?;
            (hull(&mesh.vertices).ok_or_else(|| flat(".shape.mesh"))?, still, mesh.clone())
        }
    })
}

/// The triangles of a convex hull.
fn drawn(shape: &SharedShape) -> Mesh {
    let Some(hull) = shape.as_convex_polyhedron() else { return Mesh::default() };
    let (points, triangles) = hull.to_trimesh();
    Mesh { vertices: points.iter().map(|p| [p.x, p.y, p.z]).collect(), triangles, ..Mesh::default() }
}

/// The surface of a body that masses touch: `back` and `turn` lead from the axes of its words to its own.
fn touched(words: &BodyShape, shape: &SharedShape, mesh: &Mesh, back: impl Fn(Vector) -> Vector, turn: Quat<f64>) -> Option<Shape> {
    let zero = Vector::default();
    Some(match words {
        BodyShape::Sphere { radius } => Shape::Sphere { center: back(zero), radius: *radius },
        BodyShape::Box { size: [x, y, z] } => Shape::Box { center: back(zero), half: Vector { x: 0.5 * x, y: 0.5 * y, z: 0.5 * z }, turn },
        BodyShape::Capsule { radius, length } => {
            let tip = Vector { x: 0.0, y: 0.0, z: 0.5 * length };
            Shape::Capsule { from: back(-tip), to: back(tip), radius: *radius }
        }
        _ => {
            let hull = if let BodyShape::Mesh(_) = words { drawn(shape) } else { mesh.clone() };
            let vertices = hull.vertices.iter().map(|p| back(Vector::from(*p)).into()).collect();
            Shape::Animated { facets: Facets::new(&[&Mesh { vertices, ..hull }], &[0.0])?, shell: false }
        }
    })
}

/// Bodies of an object; `file` is the mesh of its shape, if that is one.
pub fn bodies(words: &Words, file: Option<&Mesh>) -> Result<Made, Wrong> {
    let (shape, place, mesh) = solid(&words.shape, file)?;
    let wrong = |key: &str, message: String| Err((key.to_string(), message));
    if words.density.is_some() && words.mass.is_some() {
        return wrong(".mass", "given beside density; leave out one of them".into());
    }
    if let Some(resting) = words.friction_static.filter(|resting| *resting < words.friction) {
        return wrong(".friction_static", format!("{resting}, expected >= {}, the friction of what slides", words.friction));
    }
    let own = shape.mass_properties(1.0).transform_by(&place);
    let volume = own.mass();
    let mass = words.mass.unwrap_or_else(|| words.density.unwrap_or(1000.0) * volume);
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
    let place = pose(back(Vector::default()), axes.conj()) * place;
    let reach = place.translation.length() + shape.compute_local_bounding_sphere().radius();
    let friction = Friction { sliding: words.friction, resting: words.friction_static.unwrap_or(words.friction) };
    let hull = Hull { shape, place, thickness: 0.0, friction, restitution: words.restitution, belt: Vector::default(), reach };
    // Extents of the first body as it stands.
    let stands = from_degrees(words.rotate.first().copied().unwrap_or_default());
    let extent = |axis: usize| {
        let along = mesh.vertices.iter().map(|p| <[f64; 3]>::from(stands.turn(Vector::from(*p)))[axis]);
        let [low, high] = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)]);
        high - low
    };
    let places = places(words, [extent(0), extent(2)])?;
    let n = places.len();
    let each = |key: &str, list: &[[f64; 3]], i: usize| match list {
        [] => Ok([0.0; 3]),
        [one] => Ok(*one),
        all if all.len() == n => Ok(all[i]),
        all => Err((format!(".{key}"), format!("{} for {n} bodies, expected none, one, or {n}", all.len()))),
    };
    let body = |(i, x): (usize, &[f64; 3])| {
        Ok(Body {
            x: Vector::from(*x),
            q: (from_degrees(each("rotate", &words.rotate, i)?) * axes).normalized(),
            v: each("velocity", &words.velocity, i)?.into(),
            w: each("angular_velocity", &words.angular_velocity, i)?.into(),
            inverse_mass: 1.0 / mass,
            inertia,
            inverse_inertia: [0.0; 6],
        })
    };
    let bodies = places.iter().enumerate().map(body).collect::<Result<Vec<_>, Wrong>>()?;
    let Some(shape) = touched(&words.shape, &hull.shape, &mesh, back, axes.conj()) else {
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
    let mesh = Mesh { vertices: mesh.vertices.iter().map(|p| back(Vector::from(*p)).into()).collect(), ..mesh };
    Ok(Made { hull, solid, mesh, volume, bodies })
}

/// Where bodies of this width and height [m] stand.
fn places(words: &Words, [width, height]: [f64; 2]) -> Result<Vec<[f64; 3]>, Wrong> {
    let Some(arrange) = &words.arrange else { return Ok(words.position.clone()) };
    let &[[x, y, z]] = &words.position[..] else {
        return Err((".arrange".into(), format!("given with {} positions; give that of the first body alone", words.position.len())));
    };
    let at = |i: f64, step: [f64; 3]| [x + i * step[0], y + i * step[1], z + i * step[2]];
    Ok(match arrange {
        Arrange::Row { count, step } => (0..*count).map(|i| at(f64::from(i), *step)).collect(),
        Arrange::Stack { count } => (0..*count).map(|i| at(f64::from(i), [0.0, 0.0, height])).collect(),
        Arrange::Wall { columns, rows } => (0..*rows)
            .flat_map(|row| {
                let shift = 0.5 * f64::from(row % 2);
                (0..*columns).map(move |column| [x + (f64::from(column) + shift) * width, y, z + f64::from(row) * height])
            })
            .collect(),
    })
}
