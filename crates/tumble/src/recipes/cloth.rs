//! Cloth from flat panels: each is cut into triangles in its own plane, where its springs take their rest lengths, and hung where its
//! place says; sides that are sewn have as many points as each other, joined by springs without length.

use super::Site;
use super::cut::{Cut, Stitch, cut};
use super::dress::{beyond_sense, dress};
use super::loads::load;
use super::pins::{Pinnable, pin};
use super::surface::{Rest, Surface};
use crate::geometry::Vector;
use crate::math::functions;
use crate::systems::dynamics::SpringPart;
use tumble_interface::Mesh;
use tumble_interface::check::{plain, short};
use tumble_interface::scene::{Cloth, Panel, Seam};

/// Sewn sides may differ in length by this part of it.
const UNEQUAL: f64 = 0.02;
/// Points of a cloth at most.
const MOST: f64 = 5e6;

/// Length over width of triangles at most: twice that of the thinnest that steps of all lengths are tried with.
const THIN: f64 = 100.0;

/// Adds the masses, links, hinges, seams and triangles.
pub fn cloth(site: &mut Site<'_>, thing: &Cloth) {
    let path = format!("cloth \"{}\"", thing.name);
    let links = thing.links();
    if links.shear.is_some() {
        site.wrong(format!("{path}.links.shear"), "cloth of triangles has no diagonals; known here: structural, bend");
    }
    let Some((fabric, density)) = site.fabric(&path, thing.fabric.as_ref(), thing.density) else { return };
    let (cuts, stitches) = match (&thing.dress, thing.panels.is_empty()) {
        (Some(words), true) => match beyond_sense(words, thing.resolution) {
            Some((key, message)) => return site.wrong(format!("{path}{key}"), message),
            None => dress(words),
        },
        (None, false) => {
            let Some(found) = of_panels(site, thing, &path) else { return };
            found
        }
        (Some(_), false) => return site.wrong(format!("{path}.dress"), "given beside panels; leave out one of them"),
        (None, true) => return site.wrong(format!("{path}.panels"), "missing, expected panels or a dress"),
    };
    let area: f64 = cuts.iter().map(Cut::area).sum();
    if area / (thing.resolution * thing.resolution) > MOST {
        let message = format!("{} m makes more than {MOST:.0e} points of {area:.3} m² of cloth; take a larger one", thing.resolution);
        return site.wrong(format!("{path}.resolution"), message);
    }
    if let Some(k) = cuts.iter().position(|panel| panel.extent() < thing.resolution) {
        let (resolution, extent) = (plain(thing.resolution), short(cuts[k].extent()));
        let message = format!("{resolution} m is more than panels[{k}] measures from corner to corner, {extent} m; take a smaller one");
        return site.wrong(format!("{path}.resolution"), message);
    }
    let mut lengths = vec![];
    for (k, s) in stitches.iter().enumerate() {
        let [a, b] = [s.from, s.to].map(|(panel, side)| cuts[panel].length(side));
        if (a - b).abs() > UNEQUAL * a.max(b) {
            let message = format!("its sides are {a:.4} m and {b:.4} m long, expected the same length to {:.0} %", 100.0 * UNEQUAL);
            site.wrong(format!("{path}.seams[{k}]"), message);
        }
        lengths.push(0.5 * (a + b));
    }
    site.parts.begin(&thing.name, 0.0);
    let mut all = Mesh::default();
    // Corners of triangles in their panel.
    let mut cut_out: Vec<[Vector; 3]> = Vec::new();
    let mut sides: Vec<Vec<Vec<u32>>> = Vec::new();
    let (mut first, mut panels) = (None, Vec::new());
    for (k, words) in cuts.iter().enumerate() {
        // Sewn sides take their count of edges from the mean of both.
        let count = |side: usize| {
            let sewn = stitches.iter().position(|s| s.from == (k, side) || s.to == (k, side));
            let length = sewn.map_or_else(|| words.length(side), |s| lengths[s]);
            (length / thing.resolution).round().max(1.0) as usize
        };
        let Some(piece) = cut(words, thing.resolution, &count) else {
            if thing.dress.is_some() {
                return site.wrong(format!("{path}.dress"), "sides of a panel cross each other: its measures do not go together");
            }
            let message = "its sides cross each other, or it has no area; go around it once";
            return site.wrong(format!("{path}.panels[{k}].outline"), message);
        };
        let (long, wide) = piece.thinnest();
        if long > THIN * wide {
            let message = format!(
                "cut to edges of {} m it has a triangle {} m long and {} m wide, expected at most {THIN} times as long as wide; \
                 make it wider there, or the resolution smaller",
                plain(thing.resolution),
                short(long),
                short(wide)
            );
            let key = if thing.dress.is_some() { "dress".into() } else { format!("panels[{k}].outline") };
            return site.wrong(format!("{path}.{key}"), message);
        }
        let start = all.vertices.len() as u32;
        let flat = |i: u32| piece.flat[i as usize];
        let measure = |t: &[u32; 3]| {
            let [a, b, c] = t.map(flat);
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
        };
        let mut mass = vec![0.0; piece.flat.len()];
        for t in &piece.triangles {
            t.iter().for_each(|i| mass[*i as usize] += density * measure(t) / 3.0);
        }
        for (p, m) in piece.flat.iter().zip(&mass) {
            let x = (words.place)(*p);
            let index = site.parts.point(x, Vector::default(), *m);
            first.get_or_insert(index);
            all.vertices.push(x.into());
        }
        let at = first.unwrap_or(0) + start;
        // In its own plane the panel is a mesh like any other.
        let own = Mesh {
            vertices: piece.flat.iter().map(|p| [p[0], p[1], 0.0]).collect(),
            triangles: piece.triangles.clone(),
            ..Mesh::default()
        };
        let distance = |a: u32, b: u32| (flat(a)[0] - flat(b)[0]).hypot(flat(a)[1] - flat(b)[1]);
        for ([a, b], faces) in own.edges() {
            let stands_for: f64 = faces.iter().map(|t| measure(&own.triangles[*t as usize])).sum();
            if let Some(family) = &links.structural {
                site.link_of(family, [at + a, at + b], stands_for, distance(a, b));
            }
            if let (Some(family), [t, u]) = (&links.bend, &faces[..]) {
                let opposite = |t: u32| own.triangles[t as usize].into_iter().find(|i| *i != a && *i != b);
                if let (Some(c), Some(d)) = (opposite(*t), opposite(*u)) {
                    site.link_of(family, [at + c, at + d], stands_for, distance(c, d));
                }
            }
        }
        cut_out.extend(own.triangles.iter().map(|t| t.map(|i| Vector::from(own.vertices[i as usize]))));
        all.triangles.extend(own.triangles.iter().map(|t| t.map(|i| i + start)));
        panels.push((own, at));
        sides.push(piece.sides.into_iter().map(|side| side.into_iter().map(|i| at + i).collect()).collect());
    }
    for (s, length) in stitches.iter().zip(&lengths) {
        let (from, to) = (&sides[s.from.0][s.from.1], &sides[s.to.0][s.to.1]);
        let each = thing.thread * length / from.len() as f64;
        for (k, a) in from.iter().enumerate() {
            let b = to[if s.flip { k } else { to.len() - 1 - k }];
            site.parts.spring(SpringPart {
                ends: [*a, b],
                stiffness: each,
                damping: 0.0,
                rest: 0.0,
                hardening: 0.0,
                tension_only: false,
                break_strain: None,
            });
        }
    }
    let first = first.unwrap_or(0);
    let clamps = (thing.hinge() > 0.0 || thing.isometric > 0.0 || fabric.is_some()) && thing.tear.is_none();
    let pinnable = Pinnable { path: &path, n: &[all.vertices.len() as u32], first, is_lattice: false, clamps };
    let pins = pin(site, &pinnable, &thing.pin);
    load(site, &pinnable, &thing.load, &thing.point_mass);
    let words = Surface {
        path: &path,
        hinge: thing.hinge(),
        isometric: thing.isometric,
        membrane: thing.membrane.as_ref(),
        fabric,
        area: thing.area,
        clamps: &pins.clamps,
    };
    for (own, at) in &panels {
        let rest = Rest::mesh(own, Vector { x: 1.0, y: 0.0, z: 0.0 });
        site.bending(own, *at, &words, &rest);
        site.stretch(own, *at, &words, &rest);
    }
    pins.clamps.iter().for_each(|clamp| clamp.check(site));
    site.parts.launch(thing.velocity);
    let places: Vec<_> = all.triangles.iter().map(|t| t.map(|i| Vector::from(all.vertices[i as usize]))).collect();
    if let Some(object) = site.parts.object() {
        object.triangles = all.triangles;
        // A metre of cloth is 1 of texture.
        object.texture = cut_out.iter().map(|[a, b, c]| [a.x, a.y, b.x, b.y, c.x, c.y].map(|x| x as f32)).collect();
    }
    if let Some(words) = &thing.tear {
        site.tear(words, &cut_out, &places, &path);
    }
}

/// Panels and seams as a scene says them; `None` if a seam is of sides that are not there.
fn of_panels(site: &mut Site<'_>, thing: &Cloth, path: &str) -> Option<(Vec<Cut>, Vec<Stitch>)> {
    let mut cuts = Vec::new();
    for (k, panel) in thing.panels.iter().enumerate() {
        if let Some(first) = thing.panels[..k].iter().position(|p| p.name == panel.name) {
            let message = format!("\"{}\" is the name of panels[{first}] already; seams tell panels by their names", panel.name);
            site.wrong(format!("{path}.panels[{k}].name"), message);
            return None;
        }
        let (right, up) = (Vector::from(panel.right), Vector::from(panel.up));
        if right.cross(up).norm() <= 1e-9 * right.norm() * up.norm() || panel.outline.len() < 3 {
            site.wrong(format!("{path}.panels[{k}].up"), "it points along right, or one of them is zero; a plane needs two directions");
            return None;
        }
        cuts.push(flat_panel(panel));
    }
    let mut stitches = Vec::new();
    for (k, Seam { from, to, flip }) in thing.seams.iter().enumerate() {
        let mut find = |side: &tumble_interface::scene::Side, key: &str| {
            let Some(panel) = thing.panels.iter().position(|p| p.name == side.panel) else {
                let known: Vec<&str> = thing.panels.iter().map(|p| p.name.as_str()).collect();
                site.wrong(
                    format!("{path}.seams[{k}].{key}.panel"),
                    format!("\"{}\" is no panel; known are {}", side.panel, known.join(", ")),
                );
                return None;
            };
            let count = thing.panels[panel].outline.len();
            if side.side as usize >= count {
                site.wrong(
                    format!("{path}.seams[{k}].{key}.side"),
                    format!("there is no side {}; the last one is {}", side.side, count - 1),
                );
                return None;
            }
            Some((panel, side.side as usize))
        };
        let (from, to) = (find(from, "from")?, find(to, "to")?);
        if from == to {
            site.wrong(format!("{path}.seams[{k}].to"), "a side cannot be sewn to itself");
            return None;
        }
        stitches.push(Stitch { from, to, flip: *flip });
    }
    Some((cuts, stitches))
}

fn flat_panel(panel: &Panel) -> Cut {
    let n = panel.outline.len();
    let sides = (0..n).map(|i| vec![panel.outline[i], panel.outline[(i + 1) % n]]).collect();
    let (origin, around) = (Vector::from(panel.origin), panel.around);
    let right = Vector::from(panel.right).normalized();
    let up = Vector::from(panel.up);
    let up = (up - right * up.dot(right)).normalized();
    let out = right.cross(up);
    let place = move |[u, v]: [f64; 2]| match around {
        Some(r) => origin + up * v + right * (r * functions::sin(u / r)) + out * (r * (functions::cos(u / r) - 1.0)),
        None => origin + right * u + up * v,
    };
    Cut { sides, place: Box::new(place) }
}
