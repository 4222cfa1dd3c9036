//! Objects: the tables of a scene that systems move.

use super::Scene;

/// An object as the scene names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Object<'a> {
    /// The table that it stands in.
    pub kind: &'static str,
    /// Its name.
    pub name: &'a str,
    /// The system that it asks for; in a resolved scene the one that moves it.
    pub system: Option<&'a str>,
}

macro_rules! kinds {
    ($($kind:ident)*) => {
        /// Kinds of objects, in the order in which scenes list them.
        pub const KINDS: &[&str] = &[$(stringify!($kind)),*];

        impl Scene {
            /// All objects, kind by kind.
            pub fn objects(&self) -> Vec<Object<'_>> {
                let mut all = Vec::new();
                $(all.extend(
                    self.$kind.iter().map(|o| Object { kind: stringify!($kind), name: &o.name, system: o.system.as_deref() }),
                );)*
                all
            }

            /// The kind of every object and the word for its system.
            pub fn object_systems_mut(&mut self) -> Vec<(&'static str, &mut Option<String>)> {
                let mut all = Vec::new();
                $(all.extend(self.$kind.iter_mut().map(|o| (stringify!($kind), &mut o.system)));)*
                all
            }
        }
    };
}

kinds! { particles emitter rope hair sheet block net cloth galaxy body joint grains plan crowd gas liquid heat compressible }
