//! Velocity fields, which carry tracers.

use crate::math::{Dual, Lane, Vec3};
use tumble_interface::scene::Field;

/// A sum of velocity fields u(x), linear in x:
///
///   u = u0 + rate axis x (x - center),   u = -rate (x - center)        (integrators.15)
#[derive(Debug, Clone, Default)]
pub struct Flow {
    fields: Vec<Field>,
}

impl Flow {
    /// The fields of a scene.
    pub fn new(fields: &[Field]) -> Self {
        Self { fields: fields.to_vec() }
    }

    /// u(x) [m/s].
    pub fn velocity<L: Lane>(&self, x: Vec3<L>) -> Vec3<L> {
        let vector = |v: [f64; 3]| Vec3 { x: x.x.like(v[0]), y: x.x.like(v[1]), z: x.x.like(v[2]) };
        let mut u = vector([0.0; 3]);
        for field in &self.fields {
            u = u + match field {
                Field::Uniform { velocity } => vector(*velocity),
                Field::Swirl { center, axis, rate } => {
                    let axis = Vec3::from(*axis).normalized() * *rate;
                    vector(axis.into()).cross(x - vector(*center))
                }
                Field::Sink { center, rate } => (x - vector(*center)) * x.x.like(-rate),
            };
        }
        u
    }

    /// du/dx, by columns [1/s].
    pub fn gradient(&self, x: Vec3<f64>) -> [Vec3<f64>; 3] {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| self.velocity(Vec3::<Dual<f64>>::lift(x, e.into())).slope())
    }
}
