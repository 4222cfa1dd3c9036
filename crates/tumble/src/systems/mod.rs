//! L5: the numerical methods. None imports another.

pub mod compressible;
pub mod crowd;
pub mod dynamics;
pub mod gas;
pub mod grains;
pub mod heat;
pub mod liquid;
pub mod rigid;
pub mod scenery;
pub mod tracers;
pub mod vicsek;
