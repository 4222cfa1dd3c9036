//! Events that systems tell each other: children of parents in another system. See docs/theory/particles.md.

extern crate tumble_f64 as tumble;

use crate::common;
use crate::emission::by_id;

use common::{run, simulation};
use tumble_f64::scene::Simulation;
use tumble_interface::{Engine, Scene};

/// Children of parents in another system are born at the same moments and places, whatever moves them; a restored run goes on alike.
#[test]
fn events_of_one_system_bear_particles_of_another() {
    let splash = |name: &str, system: &str, at: &str| {
        format!(
            "[[emitter]]\nname = \"{name}\"\nsystem = \"{system}\"\nburst = [{{ count = 3 }}]\ninherit = 0.5\n\
             from.particles = {{ of = \"drop\", at = \"{at}\" }}\n"
        )
    };
    let build = || {
        simulation(&format!(
            "time = {{ fps = 24, exchanges = 2 }}\n[[system]]\nname = \"rain\"\nintegrator = \"verlet\"\nsubsteps = 4\n\
             [[system]]\nname = \"water\"\nintegrator = \"rk4\"\nsubsteps = 4\n\
             [[system]]\nname = \"ink\"\nmethod = \"tracers\"\nintegrator = \"rk4\"\nsubsteps = 4\n[[field]]\nkind = \"uniform\"\nvelocity = [0, 0, 2]\n\
             [[emitter]]\nname = \"drop\"\nsystem = \"rain\"\nrate = 20\njitter = 1\nlifetime = 0.9\nlifetime_spread = 0.2\nfrom.disk = {{ center = [0, 0, 1], radius = 0.3 }}\n\
             {}{}{}{}\
             [[emitter]]\nname = \"stain\"\nsystem = \"ink\"\nburst = [{{ count = 2 }}]\nfrom.particles = {{ of = \"drop\", at = \"bounce\" }}\n\
             [[collider]]\nname = \"floor\"\nrestitution = 0.5\nshape.floor.height = 0\n",
            splash("here", "rain", "bounce"),
            splash("there", "water", "bounce"),
            splash("gone here", "rain", "death"),
            splash("gone there", "water", "death"),
        ))
    };
    let mut sim = build();
    run(&mut sim, 30);
    let saved = sim.save(&[]);
    run(&mut sim, 18);
    for (one, other, least) in [("here", "there", 90), ("gone here", "gone there", 50)] {
        let (one, other) = (by_id(&sim, one), by_id(&sim, other));
        assert!(one.len() == other.len() && one.len() > least, "{} {}", one.len(), other.len());
        for ((id, x, _, age), (same, y, _, as_old)) in one.iter().zip(&other) {
            assert!(id == same && (age - as_old).abs() < 1e-12, "{id} {same}: {age} {as_old}");
            // Those that have met nothing since fly freely from the same start: exactly, by both schemes.
            assert!(*age > 0.1 || (*x - *y).norm() < 1e-9, "{id}: {x:?} {y:?}");
        }
        assert!(one.iter().filter(|(_, _, _, age)| *age < 0.1).count() > 3);
    }
    let (drops, stains) = (by_id(&sim, "there"), by_id(&sim, "stain"));
    assert_eq!(3 * stains.len(), 2 * drops.len());
    for (k, (_, x, _, age)) in stains.iter().enumerate() {
        // Off the floor, where each drop has met it, at 2 m/s.
        assert!((age - drops[3 * (k / 2)].3).abs() < 1e-12 && (x.z - 2.0 * age).abs() < 1e-9, "{x:?} {age}");
    }
    let mut again = build();
    again.restore(&saved).unwrap();
    run(&mut again, 18);
    assert_eq!(again.hash(), sim.hash());
}

#[test]
fn parents_in_other_systems_come_first_and_meet_what_children_ask_for() {
    let refused = |systems: [&str; 2], child: &str| {
        let text = format!(
            "version = 1\n[[system]]\nname = \"{}\"\n[[system]]\nname = \"{}\"\n[[system]]\nname = \"dust\"\nmethod = \"tracers\"\nintegrator = \"rk4\"\n\
             [[field]]\nkind = \"uniform\"\nvelocity = [0, 0, 2]\n[[collider]]\nname = \"f\"\nshape.floor.height = 0\n\
             [[emitter]]\nname = \"p\"\nsystem = \"a\"\nrate = 1\nlifetime = 1\nfrom.point = {{}}\n\
             [[emitter]]\nname = \"s\"\nsystem = \"dust\"\nrate = 1\nlifetime = 1\nfrom.point = {{}}\n\
             [[emitter]]\nname = \"q\"\nsystem = \"b\"\n{child}\n",
            systems[0], systems[1]
        );
        Simulation::new(Scene::from_toml(&text).unwrap(), Default::default()).err().map(|e| e.to_string()).unwrap_or_default()
    };
    let burst = "burst = [{ count = 1 }]\nfrom.particles.of = ";
    assert_eq!(refused(["a", "b"], &format!("{burst}\"p\"")), "");
    for (systems, child, told) in [
        (["b", "a"], format!("{burst}\"p\""), "nor one of a system that comes before its own"),
        (["a", "b"], format!("rate = 1\n{burst}\"p\""), "emitter \"q\".rate: children by rate follow living parents"),
        (["a", "b"], "burst = [{ count = 1 }]\nfrom.particles = { of = \"s\", at = \"bounce\" }".into(), "\"s\" meets no colliders"),
    ] {
        let message = refused(systems, &child);
        assert!(message.contains(told), "{child}: {message}");
    }
}
