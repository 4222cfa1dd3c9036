//! Contact of soft meshes with themselves and each other: who is near whom, how far all may go without meeting, when they meet,
//! and what has passed through what. Pure geometry; positions are rows of a column, everything inside is in double precision.
//!
//! A solver finds pairs (`Detector::detect`), moves vertices, holds them back where they went too far (`Detector::hold`), and
//! finds pairs anew where many were held. `intersections` and `crossed` are the judges. docs/theory/contact.md.

mod common;
mod crossing;
mod detect;
mod distance;
mod impact;
mod tangle;
mod topology;
mod tree;

pub use common::common_ways;
pub use crossing::{crossed, intersections, passes, tangled};
pub use detect::{Detector, GAMMA, Held, Pair, PairKind, truncate};
pub use distance::{Nearest, edge_edge, point_triangle};
pub use impact::{edge_edge_impact, point_triangle_impact};
pub use tangle::{contour, untangle_directions};
pub use topology::{Owner, Topology};
