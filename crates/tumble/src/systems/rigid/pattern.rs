//! How a body breaks: its pieces, and the faces that glue them together. All places are from the centre of mass of the whole, in its own axes.

use super::contact::{Hull, pose};
use crate::geometry::{Collider, Facets, Shape, Vector};
use crate::math::{Quat, eigen, rotation};
use parry3d_f64::math::Pose;
use parry3d_f64::shape::SharedShape;
use std::sync::Arc;
use tumble_interface::Mesh;

/// Mass [kg], centre of mass [m], and inertia about it, xx, yy, zz, xy, yz, zx [kg m²].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weight {
    /// Mass [kg].
    pub mass: f64,
    /// Centre of mass [m].
    pub center: Vector,
    /// Inertia [kg m²].
    pub inertia: [f64; 6],
}

/// A symmetric matrix, xx, yy, zz, xy, yz, zx, times a vector.
pub fn times([xx, yy, zz, xy, yz, zx]: [f64; 6], v: Vector) -> Vector {
    Vector { x: xx * v.x + xy * v.y + zx * v.z, y: xy * v.x + yy * v.y + yz * v.z, z: zx * v.x + yz * v.y + zz * v.z }
}

/// |d|² 1 - d dᵀ.
pub fn steiner(d: Vector) -> [f64; 6] {
    let Vector { x, y, z } = d;
    [y * y + z * z, z * z + x * x, x * x + y * y, -x * y, -y * z, -z * x]
}

impl Weight {
    /// Of several together.
    pub fn sum<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let mass: f64 = parts.clone().map(|part| part.mass).sum();
        let center = parts.clone().fold(Vector::default(), |sum, part| sum + part.center * part.mass) * (1.0 / mass);
        let mut inertia = [0.0; 6];
        for part in parts {
            let away = steiner(part.center - center);
            (0..6).for_each(|k| inertia[k] += part.inertia[k] + part.mass * away[k]);
        }
        Self { mass, center, inertia }
    }

    /// Principal axes, and moments about them [kg m²].
    pub fn principal(&self) -> (Quat<f64>, [f64; 3]) {
        let [xx, yy, zz, xy, yz, zx] = self.inertia;
        let (moments, vectors) = eigen::symmetric([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]);
        let axis = |k: usize| Vector { x: vectors[0][k], y: vectors[1][k], z: vectors[2][k] };
        // The third axis is across the others; which way it points does not matter.
        (rotation::from_axes(axis(0), axis(0).cross(axis(1)).normalized()), moments)
    }
}

/// A piece of a body: the points that are nearer to its site than to any other.
pub struct Piece {
    /// Its site [m].
    pub site: Vector,
    /// Its mass.
    pub weight: Weight,
    /// Its surface, and where that is.
    pub shape: (Pose, SharedShape),
    /// Its surface for pictures, about its centre of mass.
    pub mesh: Mesh,
    /// Its volume [m³].
    pub volume: f64,
}

/// A face of two pieces.
#[derive(Debug, Clone, PartialEq)]
pub struct Bond {
    /// The two.
    pub pair: [usize; 2],
    /// Its area [m²].
    pub area: f64,
    /// Its centroid [m].
    pub center: Vector,
    /// Unit normal from the first to the second.
    pub normal: Vector,
    /// Its corners, from the centroid [m].
    pub corners: Vec<Vector>,
    /// Integral of |rho|² 1 - rho rhoᵀ over it, rho being the way from the centroid [m⁴].
    pub second: [f64; 6],
}

/// What a cluster of pieces is as a body.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Its centre of mass [m].
    pub center: Vector,
    /// Its principal axes in those of the whole.
    pub axes: Quat<f64>,
    /// Its mass [kg].
    pub mass: f64,
    /// Its principal moments of inertia [kg m²].
    pub inertia: [f64; 3],
}

/// How all bodies of an object break.
pub struct Pattern {
    /// The pieces.
    pub pieces: Vec<Piece>,
    /// The faces between them.
    pub bonds: Vec<Bond>,
    /// Tensile strength [Pa].
    pub strength: f64,
    /// The whole body, its surface, and that for masses of other systems, with its volume [m³].
    pub whole: Frame,
    /// Its surface.
    pub hull: Hull,
    /// That which masses of other systems touch.
    pub solid: Arc<Collider>,
}

impl Pattern {
    /// The piece among some that a point belongs to.
    pub fn nearest(&self, point: Vector, among: impl Iterator<Item = usize>) -> usize {
        let far = |k: &usize| (self.pieces[*k].site - point).norm_sq();
        among.min_by(|a, b| far(a).total_cmp(&far(b)).then(a.cmp(b))).unwrap_or(0)
    }

    /// The clusters that unbroken bonds hold together: of each piece the first of its own.
    pub fn clusters(&self, broken: &[bool]) -> Vec<usize> {
        let mut first: Vec<usize> = (0..self.pieces.len()).collect();
        // Until nothing changes: what hangs together has one first piece.
        loop {
            let before = first.clone();
            for (bond, _) in self.bonds.iter().zip(broken).filter(|(_, broken)| !**broken) {
                let [a, b] = bond.pair;
                let least = first[a].min(first[b]);
                (first[a], first[b]) = (least, least);
            }
            if first == before {
                return first;
            }
        }
    }

    /// A cluster as a body.
    pub fn frame(&self, members: &[usize]) -> Frame {
        if members.len() == self.pieces.len() {
            return self.whole.clone();
        }
        let weight = Weight::sum(members.iter().map(|k| &self.pieces[*k].weight));
        let (axes, inertia) = weight.principal();
        Frame { center: weight.center, axes, mass: weight.mass, inertia }
    }

    /// The surface of a cluster, and that which masses of other systems touch, with its volume [m³].
    pub fn surface(&self, members: &[usize], frame: &Frame) -> (Hull, Arc<Collider>, f64) {
        let volume = members.iter().map(|k| self.pieces[*k].volume).sum();
        if members.len() == self.pieces.len() {
            return (self.hull.clone(), self.solid.clone(), volume);
        }
        let own = |p: Vector| frame.axes.conj().turn(p - frame.center);
        let place = pose(own(Vector::default()), frame.axes.conj());
        let mut mesh = Mesh::default();
        for piece in members.iter().map(|k| &self.pieces[*k]) {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(piece.mesh.vertices.iter().map(|p| <[f64; 3]>::from(own(Vector::from(*p) + piece.weight.center))));
            mesh.triangles.extend(piece.mesh.triangles.iter().map(|t| t.map(|i| i + first)));
        }
        let reach = mesh.vertices.iter().map(|p| Vector::from(*p).norm()).fold(0.0, f64::max);
        let mut shapes: Vec<(Pose, SharedShape)> =
            members.iter().map(|k| &self.pieces[*k].shape).map(|(at, shape)| (place * *at, shape.clone())).collect();
        let (place, shape) = match (shapes.len(), shapes.pop()) {
            (1, Some(one)) => one,
            (_, last) => {
                shapes.extend(last);
                (Pose::IDENTITY, SharedShape::compound(shapes))
            }
        };
        let solid = match Facets::new(&[&mesh], &[0.0]) {
            Some(facets) => Arc::new(Collider { shape: Shape::Animated { facets, shell: false }, ..(*self.solid).clone() }),
            None => self.solid.clone(),
        };
        (Hull { shape, place, reach, ..self.hull.clone() }, solid, volume)
    }
}
