//! Pieces of a body that breaks: the Voronoi cells of its sites, cut out of its convex polyhedron by the planes between sites, and the faces between
//! them.

use super::arrange::Wrong;
use super::convex_parts::{Face, cut, faces, hull, volume};
use crate::geometry::Vector;
use crate::math::Random;
use crate::systems::rigid::{Bond, Frame, Hull, Pattern, Piece, Weight, steiner};
use std::sync::Arc;
use tumble_interface::Mesh;
use tumble_interface::scene::{Body as Words, BodyShape, Fracture};

/// Draws for a site at most; a convex body fills much of its box.
const TRIES: u32 = 10_000;
/// Faces smaller than this part of the square of the size of a body are no glue.
const SLIVER: f64 = 1e-12;

// Purposes of random numbers.
const SITE: u32 = 2;

/// A convex body that is cut: its surface about its centre of mass, in its own axes, and from the axes of its words to these.
pub struct Whole<'a> {
    /// Its surface.
    pub mesh: &'a Mesh,
    /// From the axes of its words.
    pub back: &'a dyn Fn(Vector) -> Vector,
    /// As a body.
    pub frame: Frame,
    /// Its surface for contact, and for masses of other systems.
    pub hull: Hull,
    /// That which masses of other systems touch.
    pub solid: Arc<crate::geometry::Collider>,
    /// Seed of the scene.
    pub seed: u32,
}

/// How bodies of these words break.
pub fn pattern(words: &Words, fracture: &Fracture, whole: Whole<'_>) -> Result<Pattern, Wrong> {
    let wrong = |key: &str, message: String| Err((format!(".fracture{key}"), message));
    let flat = matches!(words.shape, BodyShape::Box { .. } | BodyShape::Hull { .. } | BodyShape::Mesh(_) | BodyShape::Voussoir { .. });
    if !flat {
        return wrong("", "only a convex body with flat faces breaks; expected shape.box, hull, mesh or voussoir".into());
    }
    if words.inertia.is_some() {
        return Err((".inertia".into(), "given beside fracture: that of pieces follows from their shapes; leave it out".into()));
    }
    let outside = faces(whole.mesh);
    let (low, high) = whole.mesh.bounds().unwrap_or_default();
    let size = (Vector::from(high) - Vector::from(low)).norm();
    let sites = sites(words, fracture, &whole, [low.into(), high.into()], size)?;
    let cells: Vec<Vec<Face>> = (0..sites.len()).map(|k| cell(&outside, &sites, k)).collect();
    let filled: f64 = cells.iter().map(|cell| volume(cell)).sum();
    let density = whole.frame.mass / filled;
    let mut pieces = Vec::new();
    for (k, cell) in cells.iter().enumerate() {
        let Some((shape, _)) = hull(cell, size) else {
            return wrong("", format!("piece {} has no volume; take another seed, fewer pieces or other sites", k + 1));
        };
        let (weight, volume) = weight(cell, density);
        pieces.push(Piece { site: sites[k], weight, shape: (shape.1, shape.0), mesh: drawn(cell, weight.center), volume });
    }
    let glued = |(k, cell): (usize, &Vec<Face>)| {
        let least = SLIVER * size * size;
        cell.iter().filter(move |face| face.beyond.is_some_and(|other| other > k)).filter_map(move |face| bond(face, k, least)).collect()
    };
    let bonds: Vec<Vec<Bond>> = cells.iter().enumerate().map(glued).collect();
    let Whole { frame, hull, solid, .. } = whole;
    Ok(Pattern { pieces, bonds: bonds.concat(), strength: fracture.strength, whole: frame, hull, solid })
}

/// Whether a point is inside convex faces, or on them.
fn is_inside(outside: &[Face], p: Vector, size: f64) -> bool {
    outside.iter().all(|face| face.sides.first().is_some_and(|[a, _]| (p - *a).dot(face.area().normalized()) <= 1e-9 * size))
}

/// The sites.
fn sites(words: &Words, fracture: &Fracture, whole: &Whole<'_>, [low, high]: [Vector; 2], size: f64) -> Result<Vec<Vector>, Wrong> {
    let wrong = |key: &str, message: String| Err((format!(".fracture{key}"), message));
    let outside = faces(whole.mesh);
    let own = |p: &[f64; 3]| (whole.back)(Vector::from(*p));
    if !fracture.sites.is_empty() {
        let sites: Vec<Vector> = fracture.sites.iter().map(own).collect();
        if fracture.pieces.is_some() {
            return wrong(".pieces", "given beside sites, of which each has a piece; leave out one of them".into());
        }
        if sites.len() < 2 {
            return wrong(".sites", "one site, expected at least two".into());
        }
        if let Some(k) = sites.iter().position(|site| !is_inside(&outside, *site, size)) {
            return wrong(&format!(".sites[{k}]"), format!("{:?} m lies outside the body, expected points in it", fracture.sites[k]));
        }
        let near = |k: &usize| sites[..*k].iter().any(|other| (*other - sites[*k]).norm() < 1e-6 * size);
        if let Some(k) = (1..sites.len()).find(near) {
            return wrong(&format!(".sites[{k}]"), format!("{:?} m is given twice; move one of both", fracture.sites[k]));
        }
        return Ok(sites);
    }
    let Some(count) = fracture.pieces else {
        return wrong("", "no pieces; give pieces, as pieces = 20, or sites".into());
    };
    let around = fracture.around.as_ref().map(own);
    if around.is_some_and(|around| !is_inside(&outside, around, size)) {
        return wrong(".around", format!("{:?} m lies outside the body, expected a point in it", fracture.around.unwrap_or_default()));
    }
    let random = Random::new(whole.seed.wrapping_add(fracture.seed.wrapping_mul(0x9E37_79B9)), &words.name);
    let drawn = |id: u32| {
        let tried = |k: u32| {
            let [u, v, w, s] = random.uniform(u64::from(id), k, SITE);
            let span = high - low;
            let p = low + Vector { x: span.x * u, y: span.y * v, z: span.z * w };
            is_inside(&outside, p, 0.0).then(|| around.map_or(p, |around| around + (p - around) * s))
        };
        (0..TRIES).find_map(tried)
    };
    match (0..count).map(drawn).collect() {
        Some(sites) => Ok(sites),
        None => wrong(".pieces", "no points are found in the body, which is too thin; give sites".into()),
    }
}

/// The cell of a site: what of the body is nearer to it than to all others, which are tried from the nearest on.
fn cell(outside: &[Face], sites: &[Vector], k: usize) -> Vec<Face> {
    let own = sites[k];
    let mut others: Vec<(f64, usize)> = (0..sites.len()).filter(|i| *i != k).map(|i| ((sites[i] - own).norm(), i)).collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut left = outside.to_vec();
    for (distance, i) in others {
        let far = left.iter().flat_map(|face| &face.sides).map(|[a, _]| (*a - own).norm()).fold(0.0, f64::max);
        if distance > 2.0 * far {
            break;
        }
        // Of a pair the plane is the same for both, so that they have the same face.
        let [a, b] = [sites[k.min(i)], sites[k.max(i)]];
        let n = (b - a) * (1.0 / distance);
        let plane = (n, n.dot((a + b) * 0.5));
        let before = left.len();
        let [below, above] = cut(&left, plane);
        let (mut kept, gone) = if k < i { (below, above) } else { (above, below) };
        if gone.is_empty() && kept.len() == before {
            continue;
        }
        // The section is the last one.
        if let Some(section) = kept.last_mut().filter(|_| !gone.is_empty()) {
            section.beyond = Some(i);
        }
        left = kept;
    }
    left
}

/// Mass, centre and inertia of what faces enclose at a density [kg/m³], and its volume [m³].
fn weight(faces: &[Face], density: f64) -> (Weight, f64) {
    let all = || faces.iter().flat_map(|face| face.sides.iter().map(|[a, b]| [face.sides[0][0], *a, *b]));
    let count = all().count().max(1) as f64;
    // About a point in the middle, so that little cancels.
    let middle = all().fold(Vector::default(), |sum, [_, a, _]| sum + a) * (1.0 / count);
    let (mut volume, mut first, mut second) = (0.0, Vector::default(), [0.0; 6]);
    for corners in all() {
        let [a, b, c] = corners.map(|p| p - middle);
        let v = a.dot(b.cross(c)) / 6.0;
        volume += v;
        first = first + (a + b + c) * (0.25 * v);
        for p in [a, b, c, a + b + c] {
            let away = steiner(p);
            (0..6).for_each(|k| second[k] += away[k] * v / 20.0);
        }
    }
    let shift = first * (1.0 / volume);
    let away = steiner(shift);
    let inertia = std::array::from_fn(|k| (second[k] - volume * away[k]) * density);
    (Weight { mass: volume * density, center: middle + shift, inertia }, volume)
}

/// The corners of a convex face in order around it.
fn outline(face: &Face) -> Vec<Vector> {
    let n = face.area().normalized();
    let middle = face.sides.iter().fold(Vector::default(), |sum, [a, _]| sum + *a) * (1.0 / face.sides.len().max(1) as f64);
    let Some([start, _]) = face.sides.iter().find(|[a, _]| (*a - middle).norm() > 0.0) else { return Vec::new() };
    let e = (*start - middle).normalized();
    let f = n.cross(e);
    let angle = |p: &Vector| crate::math::functions::atan2((*p - middle).dot(f), (*p - middle).dot(e));
    let mut corners: Vec<Vector> = face.sides.iter().map(|[a, _]| *a).collect();
    corners.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    corners.dedup();
    corners
}

/// Faces as a mesh about a point.
fn drawn(cell: &[Face], center: Vector) -> Mesh {
    let mut mesh = Mesh::default();
    for face in cell {
        let first = mesh.vertices.len() as u32;
        let corners = outline(face);
        mesh.triangles.extend((2..corners.len() as u32).map(|i| [first, first + i - 1, first + i]));
        mesh.vertices.extend(corners.into_iter().map(|p| <[f64; 3]>::from(p - center)));
    }
    mesh
}

/// The glue on a face of a piece, unless that is smaller than `least` [m²].
fn bond(face: &Face, piece: usize, least: f64) -> Option<Bond> {
    let normal = face.area().normalized();
    let [origin, _] = *face.sides.first()?;
    let triangles = || face.sides.iter().map(|[a, b]| ([origin, *a, *b], 0.5 * normal.dot((*a - origin).cross(*b - origin))));
    let area: f64 = triangles().map(|(_, part)| part).sum();
    if area <= least {
        return None;
    }
    let center = triangles().fold(Vector::default(), |sum, ([a, b, c], part)| sum + (a + b + c) * (part / 3.0)) * (1.0 / area);
    let mut second = [0.0; 6];
    for (corners, part) in triangles() {
        let [a, b, c] = corners.map(|p| p - center);
        for p in [a, b, c, a + b + c] {
            let away = steiner(p);
            (0..6).for_each(|k| second[k] += away[k] * part / 12.0);
        }
    }
    let corners = outline(face).into_iter().map(|p| p - center).collect();
    Some(Bond { pair: [piece, face.beyond?], area, center, normal, corners, second })
}
