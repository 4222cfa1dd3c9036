//! L4: what methods for fluids on staggered grids share: solids with cut faces, bodies and sheets that the fluid moves, the sides of
//! the box, the pressure projection, viscosity.
//!
//! A method owns its state and the order of the parts of its step; the parts take from here what does not depend on the method.

mod failure;
mod immersed;
pub mod projection;
pub mod rows;
mod sheets;
mod sides;
mod solids;
mod viscosity;

pub use failure::Failure;
pub use immersed::{Hull, Immersed};
pub use projection::PressureProjection;
pub use sheets::Sheet;
pub use sides::{Beyond, hold};
pub use solids::Solids;
pub use viscosity::{Viscosity, spread};
