//! L1: shapes, meshes and what is near them. Always in double precision.

mod affine;
pub mod bvh;
pub mod contact;
pub mod facets;
pub mod mannequin;
pub mod mesh_contact;
pub mod motion;
pub mod neighbours;
pub mod nets;
pub mod sampling;
pub mod sdf;
pub mod shape;
pub mod skeleton;
pub mod spread;
pub mod surface;

pub use affine::Affine;
pub use bvh::Bvh;
pub use contact::{Carrier, Collider, Friction, Impact, Search, Touch, Walls};
pub use facets::Facets;
pub use motion::Motion;
pub use neighbours::{Meet, Neighbours};
pub use sampling::Sampler;
pub use sdf::GridSdf;
pub use shape::Shape;
pub use skeleton::Rig;
pub use spread::spread;

/// A point or direction.
pub type Vector = crate::math::Vec3<f64>;
