//! Masses at the vertices of a mesh, springs along its edges.

use super::Site;
use super::loads::load;
use super::pins::{Pinnable, pin};
use super::surface::{Rest, Surface};
use crate::geometry::Vector;
use tumble_interface::fault::place;
use tumble_interface::scene::{Net, Pattern, Pin, Place};
use tumble_interface::warning::Code;
use tumble_interface::{Mesh, Warning};

/// A triangle has no area if that is less than this part of its longest side squared.
const SLIVER: f64 = 1e-9;
/// Areas of a pattern and of its mesh that differ by more than this factor are worth a hint.
const UNLIKE: f64 = 2.0;
/// And by more than this, about 30 in lengths, are refused.
const BEYOND: f64 = 1000.0;

/// Adds the masses, links, hinges and triangles. `mesh` stands where it belongs.
///
/// An edge stands for the area of its triangles: an equilateral net then has the modulus of its links as Young's modulus.
pub fn net(site: &mut Site<'_>, thing: &Net, mesh: &Mesh) {
    let path = format!("net \"{}\"", thing.name);
    site.parts.begin(&thing.name, 0.0);
    site.hints.extend(unsound(mesh, &path));
    site.hints.extend(renumbered(mesh, thing, &path));
    let Some((fabric, density)) = site.fabric(&path, thing.fabric.as_ref(), thing.density) else { return };
    let Ok(panels) = thing.pattern.as_ref().map(|words| pattern(site, words, mesh, &path)).transpose() else { return };
    // The triangles' own planes have no axes in common; the x axis has a direction in most.
    let along = Vector { x: 1.0, y: 0.0, z: 0.0 };
    let rest = panels.as_deref().map_or_else(|| Rest::mesh(mesh, along), |panels| Rest::pattern(mesh, panels));
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(|t| area(rest.corners(t))).collect();
    let mut mass = vec![0.0; mesh.vertices.len()];
    for (t, area) in mesh.triangles.iter().zip(&areas) {
        t.iter().for_each(|i| mass[*i as usize] += density * area / 3.0);
    }
    if let Some(i) = mass.iter().position(|m| *m == 0.0) {
        return site.wrong(
            format!("{path}.mesh"),
            format!(
                "vertex {i} at {} has no triangle with an area, so it would have no mass; remove it from the mesh, or mend that with \
                 `tumble check SCENE --repair`",
                place(mesh.vertices[i])
            ),
        );
    }
    let first = mesh.vertices.iter().zip(&mass).map(|(x, m)| site.parts.point(Vector::from(*x), Vector::default(), *m)).min().unwrap_or(0);
    let links = thing.links();
    if links.shear.is_some() {
        site.wrong(format!("{path}.links.shear"), "a net of triangles has no diagonals; known here: structural, bend");
    }
    let edges = mesh.edges();
    for ([a, b], faces) in &edges {
        let measure: f64 = faces.iter().map(|t| areas[*t as usize]).sum();
        if let Some(family) = &links.structural {
            match panels {
                Some(_) => site.link_of(family, [first + a, first + b], measure, rest.length([*a, *b], faces)),
                None => site.link(family, [first + a, first + b], measure),
            }
        }
        if let (Some(family), [t, u]) = (&links.bend, &faces[..]) {
            let opposite = |t: u32| mesh.triangles[t as usize].into_iter().find(|i| i != a && i != b);
            if let (Some(c), Some(d)) = (opposite(*t), opposite(*u)) {
                let ends = [first + c, first + d];
                match rest.wings([*a, *b], faces).filter(|_| panels.is_some()) {
                    Some(wings) => site.link_of(family, ends, measure, (wings.at[2] - wings.at[3]).norm()),
                    None => site.link(family, ends, measure),
                }
            }
        }
    }
    let clamps = (thing.hinge > 0.0 || thing.isometric > 0.0 || fabric.is_some()) && thing.tear.is_none();
    let pinnable = Pinnable { path: &path, n: &[mesh.vertices.len() as u32], first, is_lattice: false, clamps };
    let pins = pin(site, &pinnable, &thing.pin);
    load(site, &pinnable, &thing.load, &thing.point_mass);
    let words = Surface {
        path: &path,
        hinge: thing.hinge,
        isometric: thing.isometric,
        membrane: thing.membrane.as_ref(),
        fabric,
        area: thing.area,
        clamps: &pins.clamps,
    };
    site.bending(mesh, first, &words, &rest);
    pins.clamps.iter().for_each(|clamp| clamp.check(site));
    site.stretch(mesh, first, &words, &rest);
    if let Some(words) = &thing.pressure {
        site.inflate(mesh, first, words, &path);
    }
    if let Some(words) = &thing.shape_matching {
        site.shape(first as usize..first as usize + mesh.vertices.len(), words, &path);
    }
    site.parts.launch(thing.velocity);
    if let Some(object) = site.parts.object() {
        object.triangles.clone_from(&mesh.triangles);
        object.texture = mesh.drawn_texture();
    }
    if let Some(words) = &thing.tear {
        if thing.pressure.is_some() || thing.shape_matching.is_some() {
            return site.wrong(
                format!("{path}.tear"),
                "what tears can neither hold a pressure nor keep a shape as a whole; leave out one of them",
            );
        }
        let places: Vec<_> = (0..mesh.triangles.len()).map(|t| Rest::mesh(mesh, along).corners(t)).collect();
        site.tear(words, panels.as_deref().unwrap_or(&places), &places, &path);
    }
}

/// What is wrong with the mesh of a soft surface, though it can be simulated.
fn unsound(mesh: &Mesh, path: &str) -> Option<Warning> {
    mesh.unsound().map(|told| Warning::new(Code::UnsoundMesh, format!("{path}.mesh"), told))
}

/// That places by number do not mean the numbers of the file, where those are others.
fn renumbered(mesh: &Mesh, thing: &Net, path: &str) -> Option<Warning> {
    let [before, after] = mesh.renumbered?;
    let is_number = |words: &str| words.trim_start().starts_with("vertex");
    let pinned = |pin: &Pin| match pin {
        Pin::Words(words) => is_number(words),
        Pin::Region(region) => region.which.as_deref().is_some_and(is_number),
    };
    let at = |place: &Place| matches!(place, Place::Words(words) if is_number(words));
    let pins = thing.pin.iter().position(pinned).map(|i| format!("pin[{i}]"));
    let loads = || thing.load.iter().position(|load| at(&load.at)).map(|i| format!("load[{i}].at"));
    let masses = || thing.point_mass.iter().position(|mass| at(&mass.at)).map(|i| format!("point_mass[{i}].at"));
    let key = pins.or_else(loads).or_else(masses)?;
    let message = format!(
        "vertices are counted from 0 without those of no triangle, and those of a seam once: vertex {before} of the file is vertex {after} \
         here, and so on; choose by center and radius, or by these numbers, which `tumble check SCENE --repair` writes"
    );
    Some(Warning::new(Code::UnsoundMesh, format!("{path}.{key}"), message))
}

fn area([a, b, c]: [Vector; 3]) -> f64 {
    (b - a).cross(c - a).norm() / 2.0
}

/// The triangles of a mesh in the plane of its texture coordinates [m]; `Err`, and an issue, if they are no pattern.
fn pattern(site: &mut Site<'_>, words: &Pattern, mesh: &Mesh, path: &str) -> Result<Vec<[Vector; 3]>, ()> {
    let path = format!("{path}.pattern");
    let place = |t: usize| {
        let [a, b, c] = mesh.triangles[t].map(|i| Vector::from(mesh.vertices[i as usize]));
        let middle: [f64; 3] = ((a + b + c) * (1.0 / 3.0)).into();
        format!("triangle {t} (from 0, around [{}])", middle.map(|x| format!("{x:.4}")).join(", "))
    };
    let mut wrong = |message: String| {
        site.wrong(path.clone(), message);
        Err(())
    };
    const EXPORT: &str =
        "unwrap it and export it again with them (vt in OBJ, s and t in PLY, TEXCOORD_0 in GLB; STL has none), or leave out pattern";
    if mesh.texture.len() != mesh.triangles.len() {
        return wrong(format!("the mesh has no texture coordinates; {EXPORT}"));
    }
    let mut panels = Vec::with_capacity(mesh.texture.len());
    for (t, corners) in mesh.texture.iter().enumerate() {
        let Some(corners) = corners else { return wrong(format!("{} has no texture coordinates; {EXPORT}", place(t))) };
        panels.push(corners.map(|[u, v]| Vector { x: u * words.scale, y: v * words.scale, z: 0.0 }));
    }
    let longest = |[a, b, c]: [Vector; 3]| (b - a).norm_sq().max((c - b).norm_sq()).max((a - c).norm_sq());
    let is_flat = |x: &[Vector; 3]| area(*x) <= SLIVER * longest(*x) || !area(*x).is_finite();
    if let Some(t) = panels.iter().position(is_flat) {
        let n = panels.iter().filter(|x| is_flat(x)).count();
        let more = if n > 1 { format!(", nor have {} others", n - 1) } else { String::new() };
        return wrong(format!("{} has no area in texture coordinates{more}; unwrap the mesh again, each panel flat", place(t)));
    }
    let (flat, real): (f64, f64) = panels
        .iter()
        .zip(0..)
        .map(|(x, t)| (area(*x), area(Rest::mesh(mesh, Vector::default()).corners(t))))
        .fold((0.0, 0.0), |s, a| (s.0 + a.0, s.1 + a.1));
    let ratio = flat / real;
    if real > 0.0 && !(1.0 / BEYOND..=BEYOND).contains(&ratio) {
        let message = format!(
            "{}, which makes the pattern {flat:.3e} m² where the mesh has {real:.3e} m²: no cloth is stretched so; expected about {:.3e}",
            words.scale,
            words.scale / ratio.sqrt()
        );
        site.wrong(format!("{path}.scale"), message);
        return Err(());
    }
    if real > 0.0 && !(1.0 / UNLIKE..=UNLIKE).contains(&ratio) {
        let message = format!(
            "the pattern has {flat:.4} m² and the mesh {real:.4} m²; a scale of {:.4} would make them equal",
            words.scale / ratio.sqrt()
        );
        site.hints.push(Warning::new(Code::PatternScale, format!("{path}.scale"), message));
    }
    let side = |t: u32| {
        let [a, b, c] = panels[t as usize];
        (b - a).cross(c - a).z > 0.0
    };
    let at = |t: u32, end: u32| mesh.triangles[t as usize].iter().position(|i| *i == end).map(|k| mesh.texture[t as usize].map(|c| c[k]));
    let folded = |(ends, faces): &&([u32; 2], Vec<u32>)| match faces[..] {
        [t, u] => side(t) != side(u) && ends.iter().all(|end| at(t, *end) == at(u, *end)),
        _ => false,
    };
    let edges = mesh.edges();
    if let Some((_, faces)) = edges.iter().find(folded) {
        let n = edges.iter().filter(folded).count();
        let message = format!(
            "the texture is folded over at {n} edges, the first at {}; no cloth is cut so, unwrap the mesh again",
            place(faces[0] as usize)
        );
        site.hints.push(Warning::new(Code::FoldedPattern, path, message));
    }
    Ok(panels)
}
