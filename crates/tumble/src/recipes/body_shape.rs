//! Shapes of rigid bodies: words to convex parts, mass and surfaces.

use super::arrange::Wrong;
use super::convex_parts::{centered_hull, convex_parts, enclosed};
use crate::geometry::{Vector, surface};
use crate::math::functions::{cos, sin};
use crate::math::rotation::from_degrees;
use crate::systems::rigid::pose;
use parry3d_f64::mass_properties::MassProperties;
use parry3d_f64::math::{Pose, Vector as V};
use parry3d_f64::shape::SharedShape;
use tumble_interface::Mesh;
use tumble_interface::fault::Fault;
use tumble_interface::scene::{BodyShape, MeshFile};

/// Flat sides around what is round, in pictures.
const SIDES: u32 = 48;

/// A solid in the axes of its words.
pub struct Solid {
    parts: Vec<Part>,
    /// Its surface for pictures.
    pub drawn: Mesh,
    /// The surface that masses of other systems touch.
    pub met: Mesh,
    /// Mass, centre and moments of inertia at the density 1 kg/m³, in a body of parts at densities relative to that of the body.
    pub weight: MassProperties,
    /// Volume of its parts [m³].
    pub volume: f64,
}

/// A part of a solid.
struct Part {
    place: Pose,
    /// Convex; of what is hollow the hull.
    shape: SharedShape,
    hollow: Option<Hollow>,
}

/// A mesh that is to be met with its hollows.
struct Hollow {
    mesh: Mesh,
    place: Pose,
    tolerance: f64,
    most: u32,
}

impl Solid {
    fn convex(shape: SharedShape, place: Pose, drawn: Mesh) -> Self {
        let weight = shape.mass_properties(1.0).transform_by(&place);
        let volume = weight.mass();
        Self { parts: vec![Part { place, shape, hollow: None }], met: drawn.clone(), drawn, weight, volume }
    }

    /// The same elsewhere, as so many times as dense.
    fn placed(mut self, place: Pose, density: f64) -> Self {
        for part in &mut self.parts {
            part.place = place * part.place;
            part.hollow.iter_mut().for_each(|hollow| hollow.place = place * hollow.place);
        }
        let mass = self.weight.mass() * density;
        self.weight = self.weight.transform_by(&place);
        self.weight.set_mass(mass, true);
        for vertex in self.drawn.vertices.iter_mut().chain(&mut self.met.vertices) {
            *vertex = (place * V::from(*vertex)).into();
        }
        self
    }

    /// Its surface, and where that is; what is hollow is filled.
    pub fn outline(&self) -> (SharedShape, Pose) {
        joined(self.parts.iter().map(|part| (part.place, part.shape.clone())).collect())
    }

    /// Its surface as convex parts, and the largest part of its volume by which those of a mesh exceed it where that is more than its tolerance.
    pub fn surface(&self) -> (SharedShape, Pose, Option<f64>) {
        let (mut shapes, mut worst) = (Vec::new(), None::<f64>);
        for Part { place, shape, hollow } in &self.parts {
            let found =
                hollow.as_ref().and_then(|hollow| Some((hollow, convex_parts(&hollow.mesh, hollow.tolerance, hollow.most as usize)?)));
            let Some((hollow, (parts, left))) = found else {
                shapes.push((*place, shape.clone()));
                continue;
            };
            shapes.extend(parts.into_iter().map(|(shape, at)| (hollow.place * at, shape)));
            worst = if left > hollow.tolerance { Some(left.max(worst.unwrap_or_default())) } else { worst };
        }
        let (shape, place) = joined(shapes);
        (shape, place, worst)
    }
}

/// Shapes as one.
fn joined(shapes: Vec<(Pose, SharedShape)>) -> (SharedShape, Pose) {
    match &shapes[..] {
        [(place, shape)] => (shape.clone(), *place),
        _ => (SharedShape::compound(shapes), Pose::IDENTITY),
    }
}

/// The solid of words under a key; `file` finds meshes, `density` is that of the body [kg/m³].
pub fn solid(key: &str, words: &BodyShape, file: &dyn Fn(&MeshFile) -> Option<Mesh>, density: f64) -> Result<Solid, Wrong> {
    let zero = Vector::default();
    // Axes of y become those of z.
    let upright = pose(zero, from_degrees([90.0, 0.0, 0.0]));
    let still = Pose::IDENTITY;
    let flat = |word: &str| {
        (format!("{key}.{word}"), "the points lie in a plane or too close together, expected a body with a volume".to_string())
    };
    let loaded = |word: &str, words: &MeshFile| file(words).ok_or_else(|| (format!("{key}.{word}"), "the mesh has not been loaded".into()));
    Ok(match words {
        BodyShape::Sphere { radius } => Solid::convex(SharedShape::ball(*radius), still, surface::sphere(3, zero, *radius)),
        BodyShape::Box { size: [x, y, z] } => {
            let half = Vector { x: 0.5 * x, y: 0.5 * y, z: 0.5 * z };
            Solid::convex(SharedShape::cuboid(half.x, half.y, half.z), still, surface::cuboid(zero, half, from_degrees([0.0; 3])))
        }
        BodyShape::Capsule { radius, length } => {
            let tip = Vector { x: 0.0, y: 0.0, z: 0.5 * length };
            Solid::convex(SharedShape::capsule_z(0.5 * length, *radius), still, surface::capsule(-tip, tip, *radius))
        }
        BodyShape::Cylinder { radius, height } => {
            let profile = [[0.0, -0.5 * height], [*radius, -0.5 * height], [*radius, 0.5 * height], [0.0, 0.5 * height]];
            Solid::convex(SharedShape::cylinder(0.5 * height, *radius), upright, surface::revolved(zero, &profile, SIDES))
        }
        BodyShape::Cone { radius, height } => {
            let profile = [[0.0, -0.5 * height], [*radius, -0.5 * height], [0.0, 0.5 * height]];
            Solid::convex(SharedShape::cone(0.5 * height, *radius), upright, surface::revolved(zero, &profile, SIDES))
        }
        BodyShape::Hull { points } => {
            let (shape, place) = hull(points).ok_or_else(|| flat("hull.points"))?;
            let mesh = mesh_of(&shape, &place);
            Solid::convex(shape, place, mesh)
        }
        BodyShape::Voussoir { radius, thickness, width, stones, span } => {
            if *thickness >= 2.0 * radius {
                let message = format!("{thickness} m, expected less than twice the mean radius, {} m", 2.0 * radius);
                return Err((format!("{key}.voussoir.thickness"), message));
            }
            let stone = voussoir([radius - 0.5 * thickness, radius + 0.5 * thickness], *width, 0.5 * span / f64::from(*stones));
            let (shape, place) = hull(&stone).ok_or_else(|| flat("voussoir"))?;
            let mesh = mesh_of(&shape, &place);
            Solid::convex(shape, place, mesh)
        }
        BodyShape::Mesh(words) => {
            let mesh = loaded("mesh", words)?;
            let (shape, place) = hull(&mesh.vertices).ok_or_else(|| flat("mesh"))?;
            let met = mesh_of(&shape, &place);
            Solid { met, ..Solid::convex(shape, place, mesh) }
        }
        BodyShape::Concave { mesh: words, tolerance, most } => {
            let mesh = loaded("concave.mesh", words)?;
            if let Some(Fault { defects, place, cure }) = mesh.fault() {
                let (open, bad) = (defects.open_edges, defects.bad_edges);
                let message = format!(
                    "the mesh is not closed: {open} open edges and {bad} bad ones, {place}; {cure}, or take shape.mesh, its convex hull"
                );
                return Err((format!("{key}.concave.mesh"), message));
            }
            let (shape, place) = hull(&mesh.vertices).ok_or_else(|| flat("concave.mesh"))?;
            if enclosed(&mesh) <= 0.0 {
                let message = "its triangles face inwards: mend the file with `tumble check SCENE --repair`";
                return Err((format!("{key}.concave.mesh"), message.into()));
            }
            let points: Vec<V> = mesh.vertices.iter().map(|p| V::from(*p)).collect();
            let weight = MassProperties::from_trimesh(1.0, &points, &mesh.triangles);
            let hollow = Some(Hollow { mesh: mesh.clone(), place: still, tolerance: *tolerance, most: *most });
            let volume = weight.mass();
            Solid { parts: vec![Part { place, shape, hollow }], met: mesh.clone(), drawn: mesh, weight, volume }
        }
        BodyShape::Compound { parts } => {
            let (drawn, met, weight) = (Mesh::default(), Mesh::default(), MassProperties::default());
            let mut all = Solid { parts: Vec::new(), drawn, met, weight, volume: 0.0 };
            for (i, part) in parts.iter().enumerate() {
                let own = part.density.unwrap_or(density);
                let solid = solid(&format!("{key}.compound.parts[{i}].shape"), &part.shape, file, own)?;
                let place = pose(Vector::from(part.position), from_degrees(part.rotate));
                let Solid { parts, drawn, met, weight, volume } = solid.placed(place, own / density);
                all.parts.extend(parts);
                all.volume += volume;
                append(&mut all.drawn, &drawn);
                append(&mut all.met, &met);
                all.weight += weight;
            }
            all
        }
    })
}

/// Puts a mesh into another one.
fn append(mesh: &mut Mesh, other: &Mesh) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(&other.vertices);
    mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
}

/// The convex hull of points, and where that is, unless it has no volume.
fn hull(points: &[[f64; 3]]) -> Option<(SharedShape, Pose)> {
    centered_hull(&points.iter().map(|p| V::from(*p)).collect::<Vec<_>>())
}

/// Corners of the part of a ring about y between two radii [m], within an angle [°] of z on both sides.
fn voussoir(radii: [f64; 2], width: f64, angle: f64) -> Vec<[f64; 3]> {
    let (s, c) = (sin(angle.to_radians()), cos(angle.to_radians()));
    let corner = |r: f64| [-1.0, 1.0].into_iter().flat_map(move |x| [-0.5, 0.5].map(|y| [x * r * s, y * width, r * c]));
    radii.into_iter().flat_map(corner).collect()
}

/// The triangles of a convex hull in its place.
fn mesh_of(shape: &SharedShape, place: &Pose) -> Mesh {
    let Some(hull) = shape.as_convex_polyhedron() else { return Mesh::default() };
    let (points, triangles) = hull.to_trimesh();
    Mesh { vertices: points.iter().map(|p| (*place * *p).into()).collect(), triangles, ..Mesh::default() }
}
