//! The features of a system, in the order in which they act.

use super::core::Core;
use super::feature::{Feature, Span};
use super::followers::Followers;
use super::fracture::Fracture;
use super::hair_continuum::HairContinuum;
use super::holds::Holds;
use super::liquid_loads::LiquidLoads;
use super::self_contact::SelfContact;
use crate::system::Archive;
use tumble_interface::engine::StepReport;

/// All of them.
pub struct Features {
    /// Hair that acts on itself, by object.
    pub hair: Vec<HairContinuum>,
    /// Points and frames that are held for some time.
    pub holds: Holds,
    /// Points and frames that follow colliders.
    pub followers: Followers,
    /// Contact of surfaces with each other.
    pub self_contact: Option<SelfContact>,
    /// Links that break and surfaces that tear.
    pub fracture: Fracture,
    /// Pressures in liquids, and their forces on solids; never acts.
    pub liquid_loads: LiquidLoads,
    /// Counts intersections where no contact prevents them, if a scene asks for the number; never acts.
    pub intersection_counter: Option<SelfContact>,
}

impl Features {
    fn each(&mut self) -> impl Iterator<Item = &mut dyn Feature> {
        let Self { hair, holds, followers, self_contact, fracture, liquid_loads, .. } = self;
        let hair = hair.iter_mut().map(|f| f as &mut dyn Feature);
        let contact = self_contact.iter_mut().map(|f| f as &mut dyn Feature);
        hair.chain([holds as &mut dyn Feature, followers as &mut dyn Feature])
            .chain(contact)
            .chain([fracture as &mut dyn Feature, liquid_loads])
    }

    /// Whether none acts on masses without elements.
    pub fn are_idle(&self) -> bool {
        self.hair.is_empty() && self.holds.is_empty() && self.followers.is_empty() && self.self_contact.is_none()
    }

    /// Surfaces whose intersections are counted.
    pub fn surfaces(&self) -> Option<&SelfContact> {
        self.self_contact.as_ref().or(self.intersection_counter.as_ref())
    }

    /// Before an exchange interval from t on.
    pub fn begin(&mut self, core: &mut Core, t: f64) {
        self.each().for_each(|f| f.begin(core, t));
    }

    /// Before a sub-step.
    pub fn before(&mut self, core: &mut Core, step: Span) {
        self.each().for_each(|f| f.before(core, step));
    }

    /// Once masses have been moved to the end of a sub-step.
    pub fn moved(&mut self, core: &mut Core, step: Span) {
        self.each().for_each(|f| f.moved(core, step));
    }

    /// In each sweep over positions.
    pub fn sweep(&mut self, core: &mut Core) {
        self.each().for_each(|f| f.sweep(core));
    }

    /// In place of sweeps.
    pub fn relax(&mut self, core: &mut Core, step: Span) {
        self.each().for_each(|f| f.relax(core, step));
    }

    /// After a sub-step.
    pub fn after(&mut self, core: &mut Core, step: Span, report: &mut StepReport) {
        self.each().for_each(|f| f.after(core, step, report));
        self.renew_surfaces(core);
    }

    /// Writes their state.
    pub fn save(&self, core: &Core, archive: &mut Archive) {
        self.fracture.save(core, archive);
        self.holds.save(core, archive);
        self.followers.save(core, archive);
        self.liquid_loads.save(core, archive);
    }

    /// Reads it back.
    pub fn restore(&mut self, core: &mut Core, archive: &mut Archive) -> Option<()> {
        // What is held acts on links as they are then.
        let Self { fracture, holds, followers, liquid_loads, .. } = self;
        [fracture as &mut dyn Feature, holds, followers, liquid_loads].into_iter().try_for_each(|f| f.restore(core, archive))?;
        self.renew_surfaces(core);
        Some(())
    }

    /// Contact follows surfaces that have torn.
    fn renew_surfaces(&mut self, core: &Core) {
        if std::mem::take(&mut self.fracture.torn) {
            let tears = self.fracture.tears();
            let surfaces = self.self_contact.iter_mut().chain(&mut self.intersection_counter);
            surfaces.for_each(|surfaces| surfaces.renew(&core.objects, tears));
        }
    }
}
