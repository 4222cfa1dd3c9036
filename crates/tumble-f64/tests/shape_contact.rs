//! Contact of matched shapes with solids: a rigid block rebounds, rubs, slides, tips over and comes to rest as a rigid body does.
//! docs/theory/shapes.md.

use crate::common;

use common::{Numbers, Vector, positions, simulation, step, vector, velocities, write};
use tumble_f64::math::Quat;
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const G: f64 = 9.81;
/// Sub-steps of 1 ms, one a frame.
const H: f64 = 1e-3;
const SIDE: f64 = 0.5;

/// Blocks of `n` masses along each edge over a floor, one for each name.
fn blocks(names: &[&str], n: usize, words: &str, floor: &str, gravity: Vector) -> Simulation {
    let block = |name: &&str| {
        format!(
            "[[block]]\nname = \"{name}\"\nsize = [{SIDE}, {SIDE}, {SIDE}]\nresolution = [{n}, {n}, {n}]\nshape_matching = {{{words}}}\n"
        )
    };
    simulation(&format!(
        "precision = \"double\"\ntime.fps = 1000\nworld.gravity = [{:e}, {:e}, {:e}]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 1\n{}\
         [[collider]]\nname = \"floor\"\nshape.floor.height = 0\n{floor}\n",
        gravity.x,
        gravity.y,
        gravity.z,
        names.iter().map(block).collect::<String>()
    ))
}

fn falling(n: usize, words: &str, floor: &str) -> Simulation {
    blocks(&["block"], n, words, floor, vector(0.0, 0.0, -G))
}

/// Turns a block about its centre, moves that, and gives it a velocity and a spin.
fn throw(sim: &mut Simulation, name: &str, turn: Quat<f64>, center: Vector, velocity: Vector, spin: Vector) {
    let x = positions(sim, name);
    let middle = mean(&x);
    let x: Vec<Vector> = x.iter().map(|x| turn.turn(*x - middle) + center).collect();
    let v: Vec<Vector> = x.iter().map(|x| velocity + spin.cross(*x - center)).collect();
    write(sim, name, "position", &x);
    write(sim, name, "velocity", &v);
}

fn mean(x: &[Vector]) -> Vector {
    x.iter().fold(Vector::default(), |a, b| a + *b) * (1.0 / x.len() as f64)
}

/// A block as a rigid body: centre, its velocity, spin.
fn body(sim: &Simulation, name: &str) -> [Vector; 3] {
    let (x, v) = (positions(sim, name), velocities(sim, name));
    let (center, velocity) = (mean(&x), mean(&v));
    let turning = x.iter().zip(&v).fold(Vector::default(), |sum, (x, v)| sum + (*x - center).cross(*v - velocity));
    let round = x.iter().map(|x| (*x - center).norm_sq()).sum::<f64>() * 2.0 / 3.0;
    [center, velocity, turning * (1.0 / round)]
}

/// I/M of a block [m²]: masses at the rim of the lattice stand for half as much in each direction.
fn inertia(n: usize) -> f64 {
    let weight = |i: usize| if i == 0 || i == n - 1 { 0.5 } else { 1.0 };
    let at = |i: usize| SIDE * (i as f64 / (n - 1) as f64 - 0.5);
    let total: f64 = (0..n).map(weight).sum();
    2.0 * (0..n).map(|i| weight(i) * at(i) * at(i)).sum::<f64>() / total
}

/// Energy over mass of the path: the velocity of the scheme is ahead of it by half a step of gravity.
fn energy(sim: &Simulation, name: &str, n: usize, gravity: Vector) -> f64 {
    let [x, v, w] = body(sim, name);
    0.5 * (v + gravity * (0.5 * H)).norm_sq() + 0.5 * inertia(n) * w.norm_sq() - gravity.dot(x)
}

fn random_turn(numbers: &mut Numbers) -> Quat<f64> {
    let mut number = || numbers.next();
    loop {
        let q = Quat { v: vector(number(), number(), number()), w: number() };
        if (0.01..1.0).contains(&(q.dot(q))) {
            return q.normalized();
        }
    }
}

/// How far from vertical the face normal of a block that is nearest to it is [rad].
fn tilt(sim: &Simulation, name: &str, n: usize) -> f64 {
    let x = positions(sim, name);
    let upright = [1, n, n * n].map(|step| ((x[step * (n - 1)] - x[0]).normalized()).z.abs()).into_iter().fold(0.0, f64::max);
    upright.min(1.0).acos()
}

#[test]
fn a_block_that_falls_flat_rebounds_with_the_restitution() {
    for n in [2, 3, 6] {
        for e in [0.0, 0.3, 0.7, 1.0] {
            let mut sim = falling(n, "", &format!("restitution = {e}\nfriction = 0.5"));
            let height = 0.4;
            throw(
                &mut sim,
                "block",
                Quat { v: Vector::default(), w: 1.0 },
                vector(0.0, 0.0, 0.5 * SIDE + height),
                Vector::default(),
                Vector::default(),
            );
            // Released from rest the path has half a step of gravity.                              (contact.14)
            let arrival = (2.0 * G * height + 0.25 * G * G * H * H).sqrt();
            (0..((arrival / G) / H) as usize + 3).for_each(|_| {
                step(&mut sim);
            });
            let [x, v, w] = body(&sim, "block");
            // Of the path, where it left the floor.
            let up = v.z - 0.5 * G * H;
            let left = (up * up + 2.0 * G * (x.z - 0.5 * SIDE)).max(0.0).sqrt();
            println!("n = {n}, e = {e}: rebounds with {:.12} of its speed, spin {:.1e}", left / arrival, w.norm());
            if e > 0.0 {
                assert!((left / arrival - e).abs() < 1e-9, "{}", left / arrival);
            } else {
                assert!(v.norm() < 1e-9 && (x.z - 0.5 * SIDE).abs() < 1e-9, "{v:?} {x:?}");
            }
            assert!(w.norm() < 1e-9);
        }
    }
}

/// j = -(1 + e) v_n/(1/m + n.(I⁻¹ (r x n)) x r).
#[test]
fn a_corner_that_hits_the_floor_gives_the_impulse_of_a_rigid_body() {
    let (n, mut numbers) = (3, Numbers(5));
    for e in [0.0, 0.3, 0.7, 1.0] {
        for _ in 0..6 {
            let mut sim = blocks(&["block"], n, "", &format!("restitution = {e}"), Vector::default());
            let mut vector3 = |size: f64| vector(numbers.next(), numbers.next(), numbers.next()) * size;
            let (velocity, spin) = (vector3(1.0) - vector(0.0, 0.0, 3.0), vector3(2.0));
            let turn = random_turn(&mut numbers);
            throw(&mut sim, "block", turn, vector(0.0, 0.0, SIDE), velocity, spin);
            let (mut before, mut frames) = (body(&sim, "block"), 0);
            let mut lowest;
            loop {
                let x = positions(&sim, "block");
                lowest = x.into_iter().min_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
                step(&mut sim);
                let after = body(&sim, "block");
                frames += 1;
                assert!(frames < 1000);
                if (after[1] - before[1]).norm() > 1e-3 {
                    break;
                }
                before = after;
            }
            let after = body(&sim, "block");
            let (r, up, inverse) = (lowest - before[0], vector(0.0, 0.0, 1.0), 1.0 / inertia(n));
            let approach = (before[1] + before[2].cross(r)).z;
            let j = -(1.0 + e) * approach / (1.0 + ((r.cross(up) * inverse).cross(r)).z);
            let exact = [before[1] + up * j, before[2] + r.cross(up) * (j * inverse)];
            let off = [(after[1] - exact[0]).norm() / j, (after[2] - exact[1]).norm() * SIDE / j];
            println!("e = {e}: j/m = {j:.4} m/s, off by {:.1e} and {:.1e} of that", off[0], off[1]);
            // The arm turns by w h in a sub-step.
            assert!(off[0] < 5e-3 && off[1] < 2e-2 && j > 0.5, "{off:?} {before:?} {after:?} {exact:?}");
        }
    }
}

#[test]
fn thrown_blocks_never_gain_energy() {
    let (n, mut numbers) = (4, Numbers(8));
    let names = ["a", "b", "c", "d", "e", "f"];
    for e in [0.0, 0.3, 0.7, 1.0] {
        for mu in [0.0, 0.4, 1.2] {
            let gravity = vector(0.0, 0.0, -G);
            let mut sim = blocks(&names, n, "", &format!("restitution = {e}\nfriction = {mu}"), gravity);
            for name in names {
                let mut vector3 = |size: f64| vector(numbers.next(), numbers.next(), numbers.next()) * size;
                let (velocity, spin, center) = (vector3(3.0), vector3(10.0), vector3(0.3));
                let turn = random_turn(&mut numbers);
                throw(&mut sim, name, turn, center + vector(0.0, 0.0, 1.5), velocity, spin);
            }
            let start = names.map(|name| energy(&sim, name, n, gravity));
            let (mut least, mut rise) = (start, 0.0_f64);
            for _ in 0..1500 {
                step(&mut sim);
                for (least, name) in least.iter_mut().zip(names) {
                    let now = energy(&sim, name, n, gravity);
                    rise = rise.max(now - *least);
                    *least = least.min(now);
                }
            }
            let kept = (0..6).map(|k| (least[k] - 0.5 * SIDE * G) / (start[k] - 0.5 * SIDE * G)).fold(0.0, f64::max);
            println!("e = {e}, mu = {mu}: rises by {rise:.2e} J/kg at most; at most {kept:.3} is left");
            assert!(rise < 2e-2, "{rise}");
            assert!(if e < 0.5 && mu > 0.0 { kept < 0.2 } else { kept > 0.01 }, "{kept}");
        }
    }
}

#[test]
fn thrown_blocks_come_to_rest_flat_on_a_face() {
    let (n, thickness, mut numbers) = (3, 0.02, Numbers(21));
    let names: Vec<String> = (0..20).map(|k| format!("block{k}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut sim = blocks(&names, n, "", &format!("restitution = 0.3\nfriction = 0.5\nthickness = {thickness}"), vector(0.0, 0.0, -G));
    for name in &names {
        let mut vector3 = |size: f64| vector(numbers.next(), numbers.next(), numbers.next()) * size;
        let (velocity, spin) = (vector3(3.0), vector3(12.0));
        let turn = random_turn(&mut numbers);
        throw(&mut sim, name, turn, vector(0.0, 0.0, 1.5), velocity, spin);
    }
    (0..5000).for_each(|_| {
        step(&mut sim);
    });
    let before: Vec<Vec<Vector>> = names.iter().map(|name| positions(&sim, name)).collect();
    let mut faces = [0; 3];
    for name in &names {
        let [x, v, w] = body(&sim, name);
        let tilt = tilt(&sim, name, n);
        println!("{name}: height {:.6}, tilt {tilt:.1e}, speed {:.1e}, spin {:.1e}", x.z - thickness, v.norm(), w.norm());
        assert!(tilt < 1e-4 && (x.z - thickness - 0.5 * SIDE).abs() < 1e-5 * SIDE, "{name}: {tilt} {x:?}");
        assert!(v.norm() < 1e-6 && w.norm() < 1e-6, "{name}: {v:?} {w:?}");
        let x = positions(&sim, name);
        let up = [1, n, n * n].map(|step| (x[step * (n - 1)] - x[0]).z.abs());
        faces[(0..3).max_by(|a, b| up[*a].total_cmp(&up[*b])).unwrap()] += 1;
    }
    // They have tumbled: each pair of faces comes up.
    assert!(faces.iter().all(|count| (2..=13).contains(count)), "{faces:?}");
    (0..1000).for_each(|_| {
        step(&mut sim);
    });
    let crept =
        names.iter().zip(&before).flat_map(|(name, before)| positions(&sim, name).into_iter().zip(before.clone()).collect::<Vec<_>>());
    let crept = crept.map(|(x, before)| (x - before).norm()).fold(0.0, f64::max);
    println!("creeps {crept:.1e} m in 1 s");
    assert!(crept < 1e-9, "{crept:e}");
}

#[test]
fn a_sliding_block_stops_where_friction_says() {
    for (n, mu, speed) in [(2, 0.3, 2.0), (3, 0.3, 2.0), (5, 0.6, 3.0), (5, 0.9, 2.0)] {
        let mut sim = falling(n, "", &format!("friction = {mu}"));
        throw(
            &mut sim,
            "block",
            Quat { v: Vector::default(), w: 1.0 },
            vector(0.0, 0.0, 0.5 * SIDE),
            vector(speed, 0.0, 0.0),
            Vector::default(),
        );
        (0..1500).for_each(|_| {
            step(&mut sim);
        });
        let ([x, v, w], exact) = (body(&sim, "block"), speed * speed / (2.0 * mu * G));
        println!("n = {n}, mu = {mu}: slides {:.5} m, v²/(2 mu g) = {exact:.5} m", x.x);
        assert!((x.x / exact - 1.0).abs() < 5e-3 && v.norm() + w.norm() < 1e-9 && x.y.abs() < 1e-9, "{x:?} {v:?}");
        assert!((x.z - 0.5 * SIDE).abs() < 1e-6, "{x:?}");
    }
}

/// A block on a slope rests, slides, or tips over beyond 45 degrees where friction holds it.
#[test]
fn a_block_on_a_slope_rests_slides_or_tips_over() {
    for (n, mu, degrees) in [(3, 0.5, 20.0_f64), (3, 0.5, 30.0), (4, 1.5, 43.0), (4, 1.5, 47.0), (4, 0.8, 50.0)] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let mut sim = blocks(&["block"], n, "", &format!("friction = {mu}"), vector(G * sin, 0.0, -G * cos));
        throw(&mut sim, "block", Quat { v: Vector::default(), w: 1.0 }, vector(0.0, 0.0, 0.5 * SIDE), Vector::default(), Vector::default());
        let time = 0.5;
        (0..500).for_each(|_| {
            step(&mut sim);
        });
        let [x, v, w] = body(&sim, "block");
        println!("mu = {mu}, {degrees} degrees: goes {:.6} m at {:.4} m/s, spin {:.2e} rad/s", x.x, v.x, w.norm());
        if mu > sin / cos && degrees < 45.0 {
            assert!(x.x.abs() < 1e-9 && w.norm() < 1e-9, "{x:?} {w:?}");
        } else if mu < sin / cos && mu < 1.0 {
            let a = G * (sin - mu * cos);
            assert!((v.x / (a * time) - 1.0).abs() < 1e-2 && w.norm() < 1e-6, "{v:?} {w:?}");
        } else {
            // It turns about its lower edge, which holds.
            let x = positions(&sim, "block");
            let edge = x.iter().filter(|x| x.z.abs() < 1e-4).map(|x| (x.x - 0.5 * SIDE).abs()).fold(0.0, f64::max);
            assert!(w.y > 0.1 && edge < 1e-3, "{w:?} {edge}");
        }
    }
}

/// Between both coefficients of friction a block that rests stays, and one that slides slides on.
#[test]
fn a_block_at_rest_holds_up_to_its_static_friction() {
    for (degrees, start, holds) in [(33.0_f64, 0.0, true), (37.0, 0.0, true), (40.0, 0.0, false), (33.0, 0.5, false)] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let mut sim = blocks(&["block"], 4, "", "friction = 0.3\nfriction_static = 0.8", vector(G * sin, 0.0, -G * cos));
        let still = Quat { v: Vector::default(), w: 1.0 };
        throw(&mut sim, "block", still, vector(0.0, 0.0, 0.5 * SIDE), vector(start, 0.0, 0.0), Vector::default());
        (0..500).for_each(|_| {
            step(&mut sim);
        });
        let [x, v, _] = body(&sim, "block");
        let exact = start + 0.5 * G * (sin - 0.3 * cos);
        println!("{degrees} degrees from {start} m/s: goes {:.2e} m, {:.4} m/s, sliding {exact:.4}", x.x, v.x);
        assert!(if holds { x.x.abs() < 1e-9 } else { (v.x / exact - 1.0).abs() < 1e-2 }, "{x:?} {v:?}");
    }
}

/// Plain projection takes a soft shape back as far as its stiffness says, whatever its frequency: so does contact.
#[test]
fn a_block_under_plain_projection_is_as_rigid_as_its_stiffness_says() {
    for restitution in [0.3, 0.8] {
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 1000\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 1\n\
             position_based = {{ projection = \"plain\", stiffness = 1 }}\n[[block]]\nname = \"block\"\nsize = [{SIDE}, {SIDE}, {SIDE}]\n\
             resolution = [3, 3, 3]\nshape_matching.frequency = 1\n[[collider]]\nname = \"floor\"\nshape.floor.height = 0\nrestitution = {restitution}\n"
        ));
        let still = Quat { v: Vector::default(), w: 1.0 };
        throw(&mut sim, "block", still, vector(0.0, 0.0, 0.5 * SIDE + 0.1), vector(0.0, 0.0, -2.0), Vector::default());
        (0..100).for_each(|_| {
            step(&mut sim);
        });
        let [_, v, w] = body(&sim, "block");
        assert!((v.z / (2.0 * restitution) - 1.0).abs() < 1e-6 && w.norm() < 1e-6, "{restitution}: {v:?} {w:?}");
    }
}

/// A block held at an edge swings onto the floor like a door: its spin comes back by the restitution.
#[test]
fn a_held_block_rebounds_about_what_holds_it() {
    for e in [0.0, 0.5, 1.0] {
        let n = 3;
        let mut sim = simulation(&format!(
            "precision = \"double\"\ntime.fps = 1000\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 1\n\
             [[block]]\nname = \"block\"\nsize = [{SIDE}, {SIDE}, {SIDE}]\nresolution = [{n}, {n}, {n}]\ncenter = [{0}, {0}, {1}]\nshape_matching = {{}}\n\
             pin = [\"corner 0 0 0\", \"corner 0 1 0\"]\n[[collider]]\nname = \"floor\"\nshape.floor.height = 0\nrestitution = {e}\n",
            0.5 * SIDE,
            0.5 * SIDE + 0.2
        ));
        let spin = vector(0.0, 2.0, 0.0);
        let v: Vec<Vector> = positions(&sim, "block").iter().map(|x| spin.cross(*x - vector(0.0, 0.0, 0.2))).collect();
        write(&mut sim, "block", "velocity", &v);
        let turning = |sim: &Simulation| {
            let (x, v) = (positions(sim, "block")[n - 1], velocities(sim, "block")[n - 1]);
            ((x - vector(0.0, 0.0, 0.2)).cross(v) * (1.0 / (SIDE * SIDE))).y
        };
        let (start, mut last) = (positions(&sim, "block"), turning(&sim));
        let mut least = f64::INFINITY;
        for _ in 0..300 {
            step(&mut sim);
            least = positions(&sim, "block").iter().map(|x| x.z).fold(least, f64::min);
            let now = turning(&sim);
            if now < 0.5 * last {
                break;
            }
            last = now;
        }
        step(&mut sim);
        let (now, x) = (turning(&sim), positions(&sim, "block"));
        println!("e = {e}: {last:.5} rad/s before, {now:.5} rad/s after; lowest mass at {least:.1e} m");
        assert!((now + e * last).abs() < 5e-3 * last && last > 1.9 && least > -1e-9, "{last} {now} {least}");
        assert!(x[0] == start[0] && x[n * (n - 1)] == start[n * (n - 1)]);
    }
}

#[test]
fn a_moving_solid_hits_a_block_and_a_belt_carries_it() {
    let up = 1.5;
    for e in [0.0, 0.6, 1.0] {
        let mut sim = blocks(&["block"], 3, "", &format!("restitution = {e}\nmotion.velocity = [0, 0, {up}]"), Vector::default());
        let (none, down) = (Quat { v: Vector::default(), w: 1.0 }, 2.0);
        throw(&mut sim, "block", none, vector(0.0, 0.0, 0.5 * SIDE + 0.1), vector(0.0, 0.0, -down), Vector::default());
        (0..60).for_each(|_| {
            step(&mut sim);
        });
        let [_, v, w] = body(&sim, "block");
        println!("e = {e}: leaves with {:.9} m/s", v.z);
        assert!((v.z - (up + e * (up + down))).abs() < 1e-9 && w.norm() < 1e-9, "{v:?}");
    }
    let (mu, belt, time) = (0.4, 1.0, 0.2);
    let mut sim = falling(3, "", &format!("friction = {mu}\nbelt = [{belt}, 0, 0]"));
    throw(&mut sim, "block", Quat { v: Vector::default(), w: 1.0 }, vector(0.0, 0.0, 0.5 * SIDE), Vector::default(), Vector::default());
    (0..200).for_each(|_| {
        step(&mut sim);
    });
    let [_, v, _] = body(&sim, "block");
    assert!((v.x - mu * G * time).abs() < 1e-6 && v.y.abs() < 1e-9, "{v:?}");
    (0..100).for_each(|_| {
        step(&mut sim);
    });
    let [_, v, w] = body(&sim, "block");
    assert!((v.x - belt).abs() < 1e-9 && w.norm() < 1e-9, "{v:?}");
}

/// In a box that contains them, and again from the middle of their way.
#[test]
fn blocks_come_to_rest_in_a_box_the_same_way_from_a_snapshot() {
    let (n, names, mut numbers) = (3, ["a", "b", "c", "d", "e", "f"], Numbers(4));
    let block = |name: &&str| {
        format!("[[block]]\nname = \"{name}\"\nsize = [{SIDE}, {SIDE}, {SIDE}]\nresolution = [{n}, {n}, {n}]\nshape_matching = {{}}\n")
    };
    let mut sim = simulation(&format!(
        "precision = \"double\"\ntime.fps = 100\nworld.gravity = [0, 0, -{G}]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 10\n{}\
         [[collider]]\nname = \"box\"\ninside = true\nshape.box = {{ center = [0, 0, 1], size = [1.4, 1.2, 2] }}\nrestitution = 0.4\nfriction = 0.4\n",
        names.iter().map(block).collect::<String>()
    ));
    for name in names {
        let (velocity, spin, turn) = (numbers.vector() * 5.0, numbers.vector() * 8.0, random_turn(&mut numbers));
        throw(&mut sim, name, turn, vector(0.0, 0.0, 1.0), velocity, spin);
    }
    common::run(&mut sim, 60);
    let kept = sim.save(&[]);
    common::run(&mut sim, 240);
    let hash = sim.hash();
    for name in names {
        let ([x, v, w], tilt) = (body(&sim, name), tilt(&sim, name, n));
        println!("{name}: at {:.5} {:.5} {:.5}, tilt {tilt:.1e}, speed {:.1e}, spin {:.1e}", x.x, x.y, x.z, v.norm(), w.norm());
        // Flat on the floor, or leaning on a wall with an edge on the floor.
        assert!(v.norm() < 1e-3 && w.norm() < 1e-3, "{name}: {v:?} {w:?}");
        let low = positions(&sim, name).iter().map(|x| x.z.min(0.7 - x.x.abs()).min(0.6 - x.y.abs())).fold(f64::MAX, f64::min);
        assert!(low.abs() < 1e-6, "{name}: {low}");
    }
    sim.restore(&kept).unwrap();
    common::run(&mut sim, 240);
    assert_eq!(sim.hash(), hash);
}

/// Of an impact on a soft shape the part e is that of a rigid one: with e = 1 it comes back as it came, with e = 0 its own elasticity gives back what
/// it does, and a shape too stiff for the sub-steps is as good as rigid.
#[test]
fn a_soft_block_rebounds_by_restitution_and_its_own_elasticity() {
    for (frequency, own) in [(5.0, [0.3, 0.5]), (20.0, [0.6, 0.85]), (60.0, [0.4, 0.7]), (120.0, [0.1, 0.3]), (5000.0, [0.0, 0.03])] {
        let rebound = [0.0, 0.5, 1.0].map(|e| {
            let mut sim = falling(4, &format!("frequency = {frequency}"), &format!("restitution = {e}"));
            let (height, flat) = (0.4, Quat { v: Vector::default(), w: 1.0 });
            throw(&mut sim, "block", flat, vector(0.0, 0.0, 0.5 * SIDE + height), Vector::default(), Vector::default());
            let (mut up, mut least, mut rise) = (0.0_f64, f64::INFINITY, 0.0_f64);
            let (arrival, start) = ((2.0 * G * height).sqrt(), sim.ledger());
            for _ in 0..400 + (250.0 / frequency) as usize {
                step(&mut sim);
                let (v, now) = (body(&sim, "block")[1], sim.ledger());
                let energy = (now.energy() - start.energy()) / now.mass;
                (rise, least) = (rise.max(energy - least), least.min(energy));
                up = up.max(v.z);
            }
            println!("{frequency} Hz, e = {e}: rebounds with {:.4} of its speed; energy rises by {rise:.1e} J/kg", up / arrival);
            // Of 3.9 J/kg; measured energies of a step are v a h/2 off, where a mass turns around.
            assert!(rise < 0.12, "{rise}");
            up / arrival
        });
        assert!((own[0]..own[1]).contains(&rebound[0]), "{rebound:?}");
        assert!((rebound[2] - 1.0).abs() < 5e-3 && rebound[1] < 0.8, "{rebound:?}");
        assert!(frequency < 1000.0 || (rebound[1] - 0.5).abs() < 0.02, "{rebound:?}");
    }
}
