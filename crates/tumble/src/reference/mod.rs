//! L1: exact solutions and reference orbits, for the tests and for the lab. Always in double precision.
//!
//! Each is an object that holds the constants of its problem and answers questions about the solution.

pub mod catenary;
pub mod disk;
pub mod kepler;
pub mod orbits;
pub mod oscillator;
pub mod string;

pub use catenary::{Catenary, ElasticCatenary, HangingRope};
pub use disk::Disk;
pub use kepler::Kepler;
pub use oscillator::Oscillator;
pub use string::{Beads, HangingChain, TautString};
