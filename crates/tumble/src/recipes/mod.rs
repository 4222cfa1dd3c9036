//! L7: things. Each recipe fills a system with the masses and elements of one kind of thing.
//!
//! Every link of a family gets k_s = modulus x (length, area or volume that it stands for) / l0², so that stiffness does
//! not depend on how finely a thing is divided; the links of a family in one direction together stand for the whole thing
//! once.                                                               (springs.8)

mod arrange;
mod block;
mod body_shape;
mod cloth;
mod clump;
mod convex_parts;
mod cut;
mod dress;
mod emitter;
mod figures;
mod fracture;
mod galaxy;
mod grains;
mod guides;
mod hair;
mod joints;
mod lattice;
mod loads;
mod net;
mod particles;
mod pins;
mod rigid;
mod rope;
mod scenery;
mod sheet;
mod surface;

pub use block::block;
pub use cloth::cloth;
pub use clump::crowded;
pub use emitter::{emitter, region, volume};
pub use figures::{MANNEQUIN, bytes as figure_bytes, character, mannequin};
pub use galaxy::galaxy;
pub use grains::grains;
pub use guides::Ground;
pub use hair::hair;
pub use joints::{joints, named};
pub use net::net;
pub use particles::{draw_cloud, particles};
pub use rigid::{Made, bodies};
pub use rope::rope;
pub use scenery::{animated, placed, scenery, solid};
pub use sheet::sheet;

use crate::geometry::{Collider, Vector};
use crate::systems::dynamics::{Parts, SpringPart};
use tumble_interface::scene::Link;
use tumble_interface::{Assets, Issue, Warning};

/// Where a recipe puts masses and elements, and what it finds wrong.
pub struct Site<'a> {
    /// The system under construction.
    pub parts: &'a mut Parts,
    /// Everything wrong so far.
    pub issues: &'a mut Vec<Issue>,
    /// What it hardly means.
    pub hints: &'a mut Vec<Warning>,
    /// Direction that counts as up.
    pub up: Vector,
    /// The scene's colliders, for what follows them.
    pub solids: Option<&'a [Collider]>,
    /// What comes from files.
    pub assets: &'a Assets,
}

impl Site<'_> {
    fn wrong(&mut self, path: impl Into<String>, message: impl Into<String>) {
        self.issues.push(Issue::new(path, message));
    }

    /// Adds a link of a family that stands for `measure` [m, m², m³], at rest where it is.
    fn link(&mut self, family: &Link, ends: [u32; 2], measure: f64) {
        let rest = (self.parts.position(ends[1]) - self.parts.position(ends[0])).norm();
        self.link_of(family, ends, measure, rest);
    }

    /// The same with a rest length [m]; nothing if that is zero.
    fn link_of(&mut self, family: &Link, ends: [u32; 2], measure: f64, rest: f64) {
        let settings = family.settings();
        if rest > 0.0 {
            let share = measure / (rest * rest);
            self.parts.spring(SpringPart {
                ends,
                stiffness: settings.modulus * share,
                damping: settings.damping * share,
                rest,
                hardening: settings.hardening,
                tension_only: settings.tension_only,
                break_strain: settings.break_strain,
            });
        }
    }
}
