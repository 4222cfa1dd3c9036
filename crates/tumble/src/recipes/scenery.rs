//! Colliders: the solids that masses feel, and the meshes that pictures show.

use crate::geometry::motion::Key;
use crate::geometry::{Collider, Facets, Friction, GridSdf, Motion, Rig, Shape, Vector, surface};
use crate::math::Signal;
use crate::math::rotation::from_degrees;
use std::sync::Arc;
use tumble_interface::Mesh;
use tumble_interface::check::plain;
use tumble_interface::fault::Fault;
use tumble_interface::repair::repair;
use tumble_interface::scene::{Animated, Collider as Thing, Interpolation, MeshFile, MeshFrames, Motion as Moves, Pace, Shape as Words};

/// Half the side of the square that stands for an endless plane in pictures [m].
const PLANE: f64 = 10.0;
/// Vertices of all keyframes of a solid that changes its size, at most.
const MOST_KEYS: usize = 100_000_000;

/// A mesh put in its place: scaled, turned, moved.
pub fn placed(mesh: &Mesh, file: &MeshFile) -> Mesh {
    let (turn, shift) = (from_degrees(file.rotate), Vector::from(file.translate));
    let place = |v: &[f64; 3]| (turn.turn(Vector::from(*v) * file.scale) + shift).into();
    Mesh { vertices: mesh.vertices.iter().map(place).collect(), ..mesh.clone() }
}

/// The meshes of an animation put in their place.
pub fn animated(meshes: &[&Mesh], frames: &MeshFrames) -> Vec<Mesh> {
    let file = MeshFile {
        path: String::new(),
        hash: None,
        scale: frames.scale,
        rotate: frames.rotate,
        translate: frames.translate,
        resolution: 8,
        shell: frames.shell,
    };
    meshes.iter().map(|mesh| placed(mesh, &file)).collect()
}

/// What is wrong with which key.
type Wrong = (String, String);

/// The solid of a collider; its meshes, one for each keyframe, stand where they belong. `Err` says what is wrong with
/// which key. A figure comes with its bones and the keyframes of its skin; `times` are those of the frames of the scene [s].
pub fn solid(thing: &Thing, meshes: &[Mesh], figure: Option<(Arc<Rig>, Facets)>, times: &[f64]) -> Result<Collider, Wrong> {
    let (rig, figure) = figure.unzip();
    let wrong = |key: &str, message: String| Err((key.to_string(), message));
    let shape = match &thing.shape {
        Words::Sphere { center, radius } => Shape::Sphere { center: (*center).into(), radius: *radius },
        Words::Box { center, size, rotate } => {
            Shape::Box { center: (*center).into(), half: Vector::from(*size) * 0.5, turn: from_degrees(*rotate) }
        }
        Words::Plane { point, normal } => {
            let normal = Vector::from(*normal);
            if normal == Vector::default() {
                return wrong(".shape.plane.normal", "[0, 0, 0] has no direction".into());
            }
            let normal = normal.tamed().normalized();
            Shape::Plane { normal, offset: normal.dot(Vector::from(*point)) }
        }
        Words::Floor { height } => Shape::Plane { normal: [0.0, 0.0, 1.0].into(), offset: *height },
        Words::Capsule { from, to, radius } => Shape::Capsule { from: (*from).into(), to: (*to).into(), radius: *radius },
        Words::Lathe { center, profile, sides } => {
            let mesh = turned(*center, profile, *sides)?;
            match Facets::new(&[&mesh], &[0.0]) {
                Some(facets) => Shape::Animated { facets, shell: false },
                None => return wrong(".shape.lathe.profile", "it makes no triangle with an area".into()),
            }
        }
        Words::Mesh(file) => {
            let Some(mesh) = meshes.first() else { return wrong(".shape.mesh", "the mesh has not been loaded".into()) };
            whole(mesh, ".shape.mesh", file.shell, thing.thickness)?;
            match (GridSdf::new(mesh, file.resolution, thing.thickness, file.shell), Facets::new(&[mesh], &[0.0])) {
                (Some(grid), Some(facets)) => Shape::Mesh { grid, facets, shell: file.shell },
                _ => return wrong(".shape.mesh", "the mesh has no triangle with an area".into()),
            }
        }
        Words::AnimatedMesh(words) => {
            let key = ".shape.animated_mesh.frames";
            let Some(first) = meshes.first().filter(|_| meshes.len() == words.frames.len()) else {
                return wrong(key, "the list is empty, expected a mesh for each of some times".into());
            };
            for (i, pair) in words.frames.windows(2).enumerate() {
                if pair[1].time <= pair[0].time {
                    return wrong(
                        &format!("{key}[{}].time", i + 1),
                        format!("{} s, expected > {} s: times rise", pair[1].time, pair[0].time),
                    );
                }
            }
            for (i, mesh) in meshes.iter().enumerate() {
                let (n, m) = (mesh.vertices.len(), first.vertices.len());
                if n != m || mesh.triangles != first.triangles {
                    let what = if n == m { "other triangles".to_string() } else { format!("{n} vertices instead of {m}") };
                    return wrong(&format!("{key}[{i}]"), format!("the mesh has {what} than the first; all frames need the same ones"));
                }
                whole(mesh, &format!("{key}[{i}]"), words.shell, thing.thickness)?;
            }
            let times: Vec<f64> = words.frames.iter().map(|f| f.time).collect();
            match Facets::new(&meshes.iter().collect::<Vec<_>>(), &times) {
                Some(facets) => Shape::Animated { facets, shell: words.shell },
                None => return wrong(key, "the mesh has no triangles".into()),
            }
        }
        Words::Character(_) | Words::Mannequin(_) => {
            let (key, shell) = match &thing.shape {
                Words::Character(words) => (".shape.character", words.shell),
                _ => (".shape.mannequin", false),
            };
            let Some(facets) = figure else { return wrong(key, "a figure, expected sphere, box, plane, floor, capsule or mesh".into()) };
            let mesh = Mesh { vertices: facets.vertices(0.0), triangles: facets.triangles().to_vec(), ..Mesh::default() };
            whole(&mesh, key, shell, thing.thickness)?;
            Shape::Animated { facets, shell }
        }
    };
    let shape = match thing.motion.as_ref().and_then(size) {
        Some((scale, pivot)) => resized(thing, (scale, pivot), meshes, times)?,
        None => shape,
    };
    let mesh = match &shape {
        _ if !thing.edges => None,
        Shape::Plane { .. } => {
            return wrong(".edges", "true, but a plane has none: what its masses keep off, all between them does; leave it out".into());
        }
        Shape::Animated { facets, .. } => {
            Some(Mesh { vertices: facets.vertices(0.0), triangles: facets.triangles().to_vec(), ..Mesh::default() })
        }
        _ => Some(shown(thing, meshes)),
    };
    let shell = matches!(shape, Shape::Mesh { shell: true, .. } | Shape::Animated { shell: true, .. });
    if thing.inside && (shell || matches!(shape, Shape::Plane { .. })) {
        let what = if shell { "a shell has no inside" } else { "a plane has two sides alike; reverse its normal" };
        return wrong(".inside", format!("true, but {what}"));
    }
    Ok(Collider {
        name: thing.name.clone(),
        shape,
        inside: thing.inside,
        thickness: thing.thickness,
        friction: Friction::default(),
        rubbing: None,
        restitution: thing.restitution,
        belt: thing.belt.into(),
        motion: thing.motion.as_ref().map(motion).transpose()?,
        rig,
        edges: mesh.map(Arc::new),
    })
}

/// The surface of a solid of revolution.
fn turned(center: [f64; 3], profile: &[[f64; 2]], sides: u32) -> Result<Mesh, Wrong> {
    let wrong = |key: String, message: &str| Err((format!(".shape.lathe.profile{key}"), message.to_string()));
    if let Some(k) = profile.iter().position(|p| p[0] < 0.0) {
        return wrong(format!("[{k}][0]"), "less than 0 m, expected a distance from the axis");
    }
    let n = profile.len();
    let side = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let edge = |i: usize| (profile[i], profile[(i + 1) % n]);
    for i in 0..n {
        for j in i + 2..n.min(i + n - 1) {
            let ((a, b), (c, d)) = (edge(i), edge(j));
            // Two on one line may lie apart.
            let apart = (0..2).any(|k| a[k].max(b[k]) < c[k].min(d[k]) || c[k].max(d[k]) < a[k].min(b[k]));
            if !apart && side(a, b, c) * side(a, b, d) <= 0.0 && side(c, d, a) * side(c, d, b) <= 0.0 {
                return wrong(format!("[{j}]"), "the side from here touches another; go around the cut once");
            }
        }
    }
    let area: f64 = (1..n - 1).map(|i| side(profile[0], profile[i], profile[i + 1])).sum();
    let mut profile = profile.to_vec();
    if area < 0.0 {
        profile.reverse();
    }
    Ok(surface::revolved(center.into(), &profile, sides))
}

fn motion(words: &Moves) -> Result<Motion, Wrong> {
    for (i, pair) in words.keys.windows(2).enumerate() {
        if pair[1].time <= pair[0].time {
            let message = format!("{} s, expected > {} s: times rise", pair[1].time, pair[0].time);
            return Err((format!(".motion.keys[{}].time", i + 1), message));
        }
    }
    let keys = words.keys.iter().map(|k| Key { time: k.time, shift: k.translate.into(), turn: from_degrees(k.rotate) });
    Ok(Motion {
        velocity: words.velocity.into(),
        spin: words.spin.into(),
        pivot: words.pivot.into(),
        keys: keys.collect(),
        smooth: words.interpolation == Pace::Smooth,
    })
}

/// The size of a solid that is not always that of its shape, and the point that it keeps [m].
fn size(motion: &Moves) -> Option<(&Animated, Vector)> {
    motion.scale.as_ref().filter(|scale| scale.constant() != Some(1.0)).map(|scale| (scale, motion.pivot.into()))
}

/// A shape of changing size, as a mesh with keyframes at those of the size, or at every frame of the scene.
fn resized(thing: &Thing, (scale, pivot): (&Animated, Vector), meshes: &[Mesh], times: &[f64]) -> Result<Shape, Wrong> {
    let wrong = |key: &str, message: String| Err((format!(".motion.scale{key}"), message));
    let shell = match &thing.shape {
        Words::Mesh(file) => file.shell,
        Words::Sphere { .. } | Words::Box { .. } | Words::Capsule { .. } | Words::Lathe { .. } => false,
        Words::Plane { .. } | Words::Floor { .. } => return wrong("", "a plane has no size; leave it out".into()),
        _ => return wrong("", "its own frames say how this shape deforms; scale them, and leave it out".into()),
    };
    let size = match Signal::new(scale) {
        Ok(size) => size,
        Err(message) => return wrong("", message),
    };
    let times: Vec<f64> = match scale {
        Animated::Value(_) => vec![0.0],
        Animated::Keys(keys) if keys.interpolation == Interpolation::Step => {
            return wrong(".interpolation", "\"step\": a surface cannot jump; take \"linear\" or \"smooth\"".into());
        }
        Animated::Keys(keys) if keys.interpolation == Interpolation::Linear => keys.keys.iter().map(|key| key[0]).collect(),
        _ => times.to_vec(),
    };
    let mesh = shown(thing, meshes);
    if mesh.vertices.len() * times.len() > MOST_KEYS {
        let (n, m) = (mesh.vertices.len(), times.len());
        return wrong("", format!("{n} vertices at {m} frames are too many; give linear keys at fewer times, or a coarser mesh"));
    }
    if let Some((t, s)) = times.iter().map(|t| (t, size.value(*t))).find(|(_, s)| !s.is_finite() || *s <= 0.0) {
        let at = if size.is_constant() { String::new() } else { format!(" at t = {} s", plain(*t)) };
        return wrong("", format!("{}{at}, expected > 0", plain(s)));
    }
    let at = |t: &f64| mesh.vertices.iter().map(|v| pivot + (Vector::from(*v) - pivot) * size.value(*t)).collect();
    match Facets::of(mesh.triangles.clone(), times.iter().map(at).collect(), times.clone(), None) {
        Some(facets) => Ok(Shape::Animated { facets, shell }),
        None => wrong("", "the shape has no triangle with an area".into()),
    }
}

/// Whether a mesh has an inside, or needs none.
fn whole(mesh: &Mesh, key: &str, shell: bool, thickness: f64) -> Result<(), Wrong> {
    let wrong = |key: &str, message: String| Err((key.to_string(), message));
    if !shell && let Some(Fault { defects, place, cure }) = mesh.fault() {
        let message = format!(
            "the mesh has {} open and {} inconsistent edges, for example {place}, so it has no inside; {cure}, or set shell = true with a \
             thickness",
            defects.open_edges, defects.bad_edges
        );
        return wrong(key, message);
    }
    if !shell && volume(mesh) < 0.0 {
        let cure = match volume(&repair(mesh).0) > 0.0 {
            true => "mend the file with `tumble check SCENE --repair`",
            false => "reverse them",
        };
        return wrong(key, format!("the triangles face inward; {cure}, or set shell = true with a thickness"));
    }
    if shell && thickness == 0.0 {
        return wrong(".thickness", "0 m, expected > 0 m for a shell, which has no inside".into());
    }
    Ok(())
}

/// Six times the volume of a closed mesh [m³], negative if its triangles face inward.
fn volume(mesh: &Mesh) -> f64 {
    let corner = |i: u32| Vector::from(mesh.vertices[i as usize]);
    mesh.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])))).sum()
}

/// The surface of a collider for pictures.
pub fn scenery(thing: &Thing, meshes: &[Mesh], solid: Option<&Collider>) -> Mesh {
    let facets = solid.and_then(|solid| if let Shape::Animated { facets, .. } = &solid.shape { Some(facets) } else { None });
    match (&thing.shape, facets) {
        (Words::Character(_) | Words::Mannequin(_), Some(facets)) => {
            Mesh { vertices: facets.vertices(0.0), triangles: facets.triangles().to_vec(), ..Mesh::default() }
        }
        (_, Some(facets)) if thing.motion.as_ref().and_then(size).is_some() => {
            Mesh { vertices: facets.vertices(0.0), ..shown(thing, meshes) }
        }
        _ => shown(thing, meshes),
    }
}

/// The surface of a shape without motion; nothing of a figure.
fn shown(thing: &Thing, meshes: &[Mesh]) -> Mesh {
    match &thing.shape {
        Words::Sphere { center, radius } => surface::sphere(4, (*center).into(), *radius),
        Words::Box { center, size, rotate } => surface::cuboid((*center).into(), Vector::from(*size) * 0.5, from_degrees(*rotate)),
        Words::Plane { point, normal } => surface::square((*point).into(), Vector::from(*normal).tamed().normalized(), PLANE),
        Words::Floor { height } => surface::square([0.0, 0.0, *height].into(), [0.0, 0.0, 1.0].into(), PLANE),
        Words::Capsule { from, to, radius } => surface::capsule((*from).into(), (*to).into(), *radius),
        Words::Lathe { center, profile, sides } => turned(*center, profile, *sides).unwrap_or_default(),
        Words::Mesh(_) | Words::AnimatedMesh(_) => meshes.first().cloned().unwrap_or_default(),
        Words::Character(_) | Words::Mannequin(_) => Mesh::default(),
    }
}
