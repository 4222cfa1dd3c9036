//! Flocks, against sums over all pairs, and what must not change a flock.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, simulation, step, vector, velocities};
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;

const H: f64 = 1e-3;

fn flock(integrator: &str, h: f64, count: usize, before: &str, words: &str) -> Simulation {
    simulation(&format!(
        "seed = 5\ntime.fps = {:e}\nworld.gravity = [0, 0, 0]\n[[system]]\n{integrator}\n{before}\n\
         [[particles]]\nname = \"birds\"\ncloud = {{ count = {count}, size = [4, 4, 4], speed = 1.5 }}\n\
         [[force]]\nkind = \"flock\"\n{words}\n",
        1.0 / h
    ))
}

fn accelerations(words: &str) -> (Vec<Vector>, Vec<Vector>, Vec<Vector>) {
    let mut sim = flock("integrator = \"forward_euler\"\nsubsteps = 1", H, 400, "", words);
    let (x, v) = (positions(&sim, "birds"), velocities(&sim, "birds"));
    step(&mut sim);
    let a = velocities(&sim, "birds").iter().zip(&v).map(|(after, before)| (*after - *before) * (1.0 / H)).collect();
    (x, v, a)
}

struct Wanted {
    radius: f64,
    nearest: Option<usize>,
    view: Option<f64>,
    cohesion: f64,
    alignment: f64,
    separation: f64,
    spacing: f64,
}

/// Equations (flocks.1) to (flocks.5) as they stand, over all pairs.
fn naive(w: &Wanted, x: &[Vector], v: &[Vector], i: usize) -> Vector {
    let distance = |j: usize| (x[j] - x[i]).norm();
    let mut radius = w.radius;
    if let Some(k) = w.nearest {
        let mut all: Vec<f64> = (0..x.len()).filter(|j| *j != i).map(distance).collect();
        all.sort_by(f64::total_cmp);
        radius = radius.min(all[k]);
    }
    let (mut total, mut centre, mut velocity, mut apart) = (0.0, Vector::default(), Vector::default(), Vector::default());
    for j in (0..x.len()).filter(|j| *j != i) {
        let (d, r) = (x[j] - x[i], distance(j));
        let sight = w.view.map_or(1.0, |angle| {
            let cosine = d.dot(v[i]) / (r * v[i].norm());
            ((cosine - (0.5 * angle).to_radians().cos()) / 0.2).clamp(0.0, 1.0)
        });
        let weight = (1.0 - (r / radius).powi(2)).max(0.0).powi(2) * sight;
        total += weight;
        centre = centre + d * weight;
        velocity = velocity + (v[j] - v[i]) * weight;
        let e = r / w.spacing;
        if e < 1.0 {
            apart = apart + d * (sight / r * e * (1.0 - e * e).powi(2) / (e * e + 0.01));
        }
    }
    let mean = if total > 0.0 { 1.0 / (total + 0.01) } else { 0.0 };
    (centre * w.cohesion + velocity * w.alignment) * mean - apart * w.separation
}

#[test]
fn steering_is_that_of_all_pairs() {
    for (nearest, view) in [(None, None), (Some(7), None), (None, Some(250.0)), (Some(5), Some(300.0))] {
        let w = Wanted { radius: 0.9, nearest, view, cohesion: 2.0, alignment: 3.0, separation: 1.5, spacing: 0.5 };
        let mut words = String::from("radius = 0.9\ncohesion = 2\nalignment = 3\nseparation = 1.5\nspacing = 0.5");
        words += &nearest.map_or(String::new(), |k| format!("\nnearest = {k}"));
        words += &view.map_or(String::new(), |angle| format!("\nview = {angle}"));
        let (x, v, a) = accelerations(&words);
        let right: Vec<Vector> = (0..x.len()).map(|i| naive(&w, &x, &v, i)).collect();
        let off = a.iter().zip(&right).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
        let size = right.iter().map(|a| a.norm()).sum::<f64>() / x.len() as f64;
        println!("{nearest:?} {view:?}: mean {size:.2} m/s², off by {off:.1e}");
        // Velocities of 1.5 m/s are rounded to 2e-16, over H; sums of 20 neighbours add a little. Measured: 7e-13 at most.
        assert!(size > 1.0 && off < 5e-12, "{off:e}");
    }
}

#[test]
fn urges_do_what_they_say() {
    // One bird: cruising speed, goal, bound.
    let (_, v, a) = accelerations("radius = 0.001\nspeed = 3\npropulsion = 2");
    let off = v.iter().zip(&a).map(|(v, a)| (*a - *v * (2.0 * (1.0 - 0.25))).norm()).fold(0.0, f64::max);
    assert!(off < 2e-12, "{off:e}");
    let (x, _, a) = accelerations("radius = 0.001\ngoal = [{ point = [9, 0, 0], strength = 5 }]\nmax_acceleration = 5");
    let wanted = |x: Vector| (vector(9.0, 0.0, 0.0) - x).normalized() * (5.0 / 2.0_f64.sqrt());
    let off = x.iter().zip(&a).map(|(x, a)| (*a - wanted(*x)).norm()).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off:e}");
    // Solids push outward, and only those who are near.
    let solid = "[[collider]]\nname = \"ball\"\nshape.sphere = { radius = 0.5, center = [0, 0, 0] }\n";
    let mut sim = flock("integrator = \"forward_euler\"\nsubsteps = 1", H, 400, solid, "radius = 0.001\navoidance = 4\nclearance = 1");
    let (x, v) = (positions(&sim, "birds"), velocities(&sim, "birds"));
    step(&mut sim);
    let mut near = 0;
    for ((x, v), after) in x.iter().zip(&v).zip(&velocities(&sim, "birds")) {
        let (r, a) = (x.norm(), (*after - *v) * (1.0 / H));
        if r > 0.52 {
            let wanted = x.normalized() * (4.0 * (1.5 - r).max(0.0).powi(2));
            near += usize::from(r < 1.4);
            assert!((a - wanted).norm() < 0.05, "{x:?} {a:?}");
        }
    }
    assert!(near > 10);
}

#[test]
fn a_hawk_chases_and_its_prey_flees() {
    let hawk = "[[particles]]\nname = \"hawk\"\nposition = [[0, 0, 6]]\n";
    let words = "radius = 0.5\npredators = [\"hawk\"]\nfear = 20\nfear_radius = 9\nchase = 7";
    let mut sim = flock("integrator = \"rk4\"\nsubsteps = 2", 0.05, 200, hawk, words);
    let (x, v) = (positions(&sim, "birds"), velocities(&sim, "birds"));
    step(&mut sim);
    let down = velocities(&sim, "hawk")[0];
    // Towards the flock, 6 m below, at all but 7 m/s².
    assert!((-0.36..-0.30).contains(&down.z) && down.x.abs() < 0.05, "{down:?}");
    let mut fled = 0;
    for ((x, v), after) in x.iter().zip(&v).zip(&velocities(&sim, "birds")) {
        let away = (*x - vector(0.0, 0.0, 6.0)).normalized();
        fled += usize::from((*after - *v).dot(away) > 0.01);
        assert!((*after - *v).dot(away) > -1e-3);
    }
    assert!(fled == 200, "{fled}");
}

/// A bird that takes off gains energy without a blow-up.
#[test]
fn a_flock_that_takes_off_is_no_explosion() {
    let mut sim = simulation(
        "time.fps = 10\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"rk4\"\nsubsteps = 10\n\
         [[particles]]\nname = \"birds\"\ncloud = { count = 50, size = [4, 4, 4], speed = 1e-3 }\n\
         [[force]]\nkind = \"flock\"\nradius = 1\nspeed = 8\npropulsion = 3\nalignment = 1\n",
    );
    let start = sim.ledger().kinetic;
    (0..50).for_each(|_| drop(step(&mut sim)));
    let ratio = sim.ledger().kinetic / start;
    assert!(ratio > 1e7, "{ratio:e}");
}

#[test]
fn one_far_away_changes_no_bit() {
    let words = "radius = 0.9\ncohesion = 2\nalignment = 3\nseparation = 1.5\nspeed = 2\nnearest = 9";
    let pairs = "[[force]]\nkind = \"repulsion\"\nstiffness = 20\ndistance = 0.4\n[[force]]\nkind = \"viscosity\"\ncoefficient = 0.3\nradius = 0.5\n";
    let end = |far: &str| {
        let mut sim = flock("integrator = \"rk4\"\nsubsteps = 5", 0.05, 600, &format!("{far}{pairs}"), words);
        (0..4).for_each(|_| drop(step(&mut sim)));
        positions(&sim, "birds")
    };
    let alone = end("");
    assert!(alone.iter().zip(&end("[[particles]]\nname = \"near\"\nposition = [[0.1, 0, 0]]\n")).any(|(a, b)| a != b));
    for x in ["[1e30, -1e30, 1e30]", "[40, 0.3, 0.3]", "[-1e5, 0, 7]"] {
        // Before the flock, so that all rows are others, too.
        assert_eq!(alone, end(&format!("[[particles]]\nname = \"far\"\nposition = [{x}]\n")), "{x}");
    }
}

#[test]
fn any_count_of_threads_gives_the_same_bits() {
    let words = "radius = 0.3\ncohesion = 2\nalignment = 3\nseparation = 1.5\nspeed = 2";
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let pairs = "[[force]]\nkind = \"cohesion\"\nstrength = 0.1\nradius = 0.2\n";
            let mut sim = flock("integrator = \"heun\"\nsubsteps = 2", 0.05, 9000, pairs, words);
            (0..2).for_each(|_| drop(step(&mut sim)));
            sim.hash()
        })
    };
    assert_eq!(with(1), with(2));
    assert_eq!(with(1), with(8));
}

/// The right-hand side is continuous, so that schemes of order 2 show it, and implicit ones settle.
#[test]
fn integrators_agree_on_a_flock() {
    let words = "radius = 1\ncohesion = 2\nalignment = 3\nseparation = 0.5\nspeed = 2";
    let end = |scheme: &str, n: usize| {
        let mut sim = flock(&format!("integrator = \"{scheme}\"\nsubsteps = {n}"), 0.2, 100, "", words);
        assert_eq!(step(&mut sim).unconverged, 0, "{scheme}");
        positions(&sim, "birds")
    };
    let right = end("rk4", 400);
    for (scheme, order) in [("symplectic_euler", 1), ("heun", 2), ("implicit_midpoint", 2), ("bdf2", 2)] {
        let off = |n| end(scheme, n).iter().zip(&right).map(|(a, b)| (*a - *b).norm()).fold(0.0, f64::max);
        let (coarse, fine) = (off(20), off(40));
        let ratio = coarse / fine;
        println!("{scheme}: {coarse:.1e} {fine:.1e}, order {:.2}", ratio.log2());
        assert!((ratio.log2() - f64::from(order)).abs() < 0.35, "{scheme}: {ratio}");
    }
}

/// The order of the model of Vicsek falls with the noise as published: 40 points in a square of 3.1 m (../shared/validation).
#[test]
fn order_falls_with_noise_as_in_vicsek() {
    use tumble_f64::systems::vicsek::Vicsek;
    let table = [
        (0.5, 0.9891),
        (1.0, 0.9568),
        (1.5, 0.9041),
        (2.0, 0.8334),
        (3.0, 0.6475),
        (4.0, 0.417),
        (5.0, 0.197),
        (std::f64::consts::TAU, 0.1406),
    ];
    for (noise, published) in table {
        let mean = |seed: u32| {
            let mut flock = Vicsek::new(seed, 40, 3.1, 1.0, 0.03, noise);
            (0..1000).for_each(|_| flock.step());
            let steps = 12_000;
            (0..steps).map(|_| (flock.step(), flock.order()).1).sum::<f64>() / f64::from(steps)
        };
        let seeds = [mean(1), mean(2), mean(3)];
        let average = seeds.iter().sum::<f64>() / 3.0;
        let scatter = seeds.iter().map(|m| (m - average).abs()).fold(0.0, f64::max);
        println!("noise {noise:.2}: order {average:.4}, published {published}, scatter {scatter:.4}");
        // The table has four digits of a mean over three seeds, too.
        assert!((average - published).abs() < 3.0 * scatter + 0.003 && scatter < 0.03, "{noise}: {average} {published} {scatter}");
    }
}

/// Those who are alone err to both sides alike, by no more than half the noise, and start where the scene says.
#[test]
fn errors_of_vicseks_model_are_even() {
    let n = 2000;
    let mut sim = simulation(&format!(
        "dimension = 2\nplane = \"xy\"\ntime.fps = 1\n[[system]]\nmethod = \"vicsek\"\n\
         vicsek = {{ side = 100, radius = 1e-6, speed = 2, noise = 1 }}\n\
         [[particles]]\nname = \"p\"\ncloud = {{ count = {n}, size = [100, 100, 0] }}\nvelocity = [[3, 4, 0]]\n\
         [[particles]]\nname = \"q\"\nposition = [[10, -20, 0], [60, 0, 0]]\n"
    ));
    // The second comes in at the other side.
    for (x, exact) in positions(&sim, "q").iter().zip([vector(10.0, -20.0, 0.0), vector(-40.0, 0.0, 0.0)]) {
        assert!((*x - exact).norm() < 1e-12);
    }
    let (x, v) = (positions(&sim, "p"), velocities(&sim, "p"));
    let mean = x.iter().fold(Vector::default(), |sum, x| sum + *x) * (1.0 / f64::from(n));
    // Uniform in the square: 100/sqrt(12 n) = 0.65 m; four of them.
    assert!(mean.norm() < 2.6 && x.iter().all(|x| x.x.abs() <= 50.0 && x.y.abs() <= 50.0 && x.z == 0.0));
    assert!(v.iter().all(|v| (*v - vector(1.2, 1.6, 0.0)).norm() < 1e-14));
    step(&mut sim);
    let turns: Vec<f64> = velocities(&sim, "p").iter().map(|v| (1.2 * v.y - 1.6 * v.x).atan2(1.2 * v.x + 1.6 * v.y)).collect();
    let mean = turns.iter().sum::<f64>() / f64::from(n);
    let spread = (turns.iter().map(|t| t * t).sum::<f64>() / f64::from(n)).sqrt();
    println!("errors: mean {mean:.4}, spread {spread:.4}, exact 0 and {:.4}", 1.0 / 12.0_f64.sqrt());
    // Uniform from -1/2 to 1/2: the mean is known to 0.289/sqrt(n) = 0.0065, the spread to 0.0029; four of each.
    assert!(mean.abs() < 0.026 && (spread - 1.0 / 12.0_f64.sqrt()).abs() < 0.012);
    assert!(turns.iter().all(|t| t.abs() <= 0.5 + 1e-12));
    let end = positions(&sim, "p");
    let moved: Vec<f64> = end.iter().zip(&x).map(|(after, before)| (*after - *before).norm()).filter(|d| *d < 50.0).collect();
    assert!(moved.len() > 1900 && moved.iter().all(|d| (d - 2.0).abs() < 1e-12));
}
