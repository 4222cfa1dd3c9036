//! Ropes, strings and sheets against the mechanics of continua: shapes at rest, frequencies, and what refinement changes.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, list, positions, run, simulation, step, vector, velocities, write, zeros};
use tumble_f64::reference::{Catenary, ElasticCatenary, HangingChain, HangingRope, TautString};
use tumble_f64::scene::Simulation;
use tumble_interface::Engine;
use tumble_interface::engine::UserForce;

const DENSITY: f64 = 0.1;
const G: f64 = 9.8;

/// A slack rope between (0, 0, 0) and (1, 0, rise), relaxed with drag and large implicit steps until it rests.
fn relaxed_rope(segments: u32, length: f64, rise: f64, modulus: f64) -> Vec<Vector> {
    let mut sim = simulation(&format!(
        "time.fps = 10\n[[system]]\nintegrator = \"implicit_euler\"\nsubsteps = 1\nsolver = {{ linear = \"cholesky\", newton_iterations = 50 }}\n\
         [[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [1, 0, {rise}]\nlength = {length}\nsegments = {segments}\ndensity = {DENSITY}\npin = [\"start\", \"end\"]\n\
         links = {{ structural = {modulus} }}\n[[force]]\nkind = \"drag\"\nrate = 4\n"
    ));
    run(&mut sim, 250);
    let speed = sim.ledger().speed.unwrap();
    assert!(speed < 1e-6, "{segments} segments still move with {speed:e} m/s");
    positions(&sim, "rope")
}

/// Largest distance of the masses to a curve by its material points.
fn distance(x: &[Vector], curve: impl Fn(f64) -> [f64; 2], length: f64) -> f64 {
    let n = (x.len() - 1) as f64;
    let off = |(i, x): (usize, &Vector)| {
        let [cx, cz] = curve(length * i as f64 / n);
        (*x - vector(cx, 0.0, cz)).norm()
    };
    x.iter().enumerate().map(off).fold(0.0, f64::max)
}

#[test]
fn a_rope_of_200_segments_hangs_in_the_catenary() {
    for (rise, length) in [(0.0, 1.5), (0.3, 1.3)] {
        let modulus = 2000.0;
        let x = relaxed_rope(200, length, rise, modulus);
        let rigid = Catenary::new(1.0, rise, length).unwrap();
        let elastic = ElasticCatenary::new(1.0, rise, length, DENSITY * G, modulus).unwrap();
        let (to_rigid, to_elastic) = (distance(&x, |s| rigid.at(s), length), distance(&x, |s| elastic.at(s), length));
        let lowest = -x.iter().map(|x| x.z).fold(0.0, f64::min);
        println!(
            "rise {rise}: sag {lowest:.6} m, catenary {:.6} m; masses at most {to_rigid:.1e} m from it, {to_elastic:.1e} m from the elastic one",
            rigid.sag()
        );
        // The rope is 0.04 % longer than one that cannot stretch, which lowers it by 0.05 % of its sag.
        // Measured: sag +0.05 % and +0.12 %, masses 2.5e-4 and 2.9e-4 m off.
        assert!((lowest / rigid.sag() - 1.0).abs() < 0.005);
        assert!(to_rigid < 0.005 * rigid.sag());
        // The polygon of 200 pieces errs by (1/200)² of the sag times a constant of order one.
        // Measured: 8.1e-6 and 4.8e-6 m.
        assert!(to_elastic < 1e-4 * rigid.sag() && to_elastic > 1e-9);
    }
}

/// Differences from one division to the next, and their ratios: 4 for order 2.
fn convergence(name: &str, values: &[f64]) -> Vec<f64> {
    let differences: Vec<f64> = values.windows(2).map(|v| v[1] - v[0]).collect();
    let ratios = differences.windows(2).map(|d| d[0] / d[1]).collect();
    println!("{name}: {values:.7?}, differences {}, ratios {ratios:.3?}", common::show(&differences));
    ratios
}

#[test]
fn the_sag_of_a_rope_converges() {
    let sags: Vec<f64> = [10, 20, 40, 80].map(|n| -relaxed_rope(n, 1.5, 0.0, 200.0).iter().map(|x| x.z).fold(0.0, f64::min)).into();
    // Measured: 4.093, 4.021.
    for ratio in convergence("sag at 10, 20, 40, 80 segments", &sags) {
        assert!((ratio - 4.0).abs() < 0.8, "{ratio}");
    }
    let [.., coarse, fine] = sags[..] else { unreachable!() };
    let limit = ElasticCatenary::new(1.0, 0.0, 1.5, DENSITY * G, 200.0).unwrap().at(0.75)[1];
    println!("extrapolated {:.7}, elastic catenary {:.7}", fine + (fine - coarse) / 3.0, -limit);
    assert!((fine + (fine - coarse) / 3.0 + limit).abs() < 1e-5);
}

/// A straight rope under its own weight: exact for every division, because the end mass is halved.        (catenary.5)
#[test]
fn a_hanging_rope_stretches_exactly_whatever_its_division() {
    for segments in [1, 3, 10, 77] {
        let mut sim = simulation(&format!(
            "time.fps = 10\n[[system]]\nintegrator = \"implicit_euler\"\nsubsteps = 1\nsolver.linear = \"cholesky\"\n\
             [[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [0, 0, -2]\nsegments = {segments}\ndensity = {DENSITY}\npin = [\"start\"]\nlinks = {{ structural = 30 }}\n\
             [[force]]\nkind = \"drag\"\nrate = 8\n"
        ));
        run(&mut sim, 200);
        let exact = HangingRope { length: 2.0, weight: DENSITY * G, stiffness: 30.0, load: 0.0 };
        let stretch = -positions(&sim, "rope")[segments].z - 2.0;
        println!("{segments} segments: stretch {stretch:.12} m, exact {:.12} m", exact.stretch());
        // Measured: 12 digits.
        assert!((stretch / exact.stretch() - 1.0).abs() < 1e-9, "{stretch}");
    }
}

/// The first five modes of a string of 64 segments, all at once, each seen by its own projection.
#[test]
fn a_taut_string_has_its_frequencies() {
    let (n, modulus, unstretched) = (64_u32, 100.0, 0.9);
    let mut sim = simulation(&format!(
        "time.fps = 1000\nworld.gravity = [0, 0, 0]\n[[system]]\nintegrator = \"verlet\"\nsubsteps = 10\n\
         [[rope]]\nname = \"string\"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nlength = {unstretched}\nsegments = {n}\ndensity = {DENSITY}\npin = [\"start\", \"end\"]\n\
         links = {{ structural = {modulus} }}\n"
    ));
    let string = TautString { length: 1.0, tension: modulus * (1.0 - unstretched) / unstretched, density: DENSITY * unstretched };
    let beads = string.beads(n);
    // Small enough that stretching by the motion, (amplitude x wave number)², does not raise the tension.
    let mut x = positions(&sim, "string");
    for (i, x) in x.iter_mut().enumerate() {
        x.y = (1..=5).map(|mode| 1e-6 * beads.shape(mode, i as u32)).sum();
    }
    write(&mut sim, "string", "position", &x);
    let mut samples = vec![Vec::new(); 5];
    for frame in 0..2000 {
        let (x, v) = (positions(&sim, "string"), velocities(&sim, "string"));
        for (mode, samples) in (1..=5).zip(&mut samples) {
            let part = |y: &dyn Fn(usize) -> f64| (0..=n as usize).map(|i| y(i) * beads.shape(mode, i as u32)).sum::<f64>();
            samples.push((f64::from(frame) / 1000.0, part(&|i| x[i].y), part(&|i| v[i].y)));
        }
        step(&mut sim);
    }
    for (mode, samples) in (1..=5).zip(&samples) {
        let zeros = zeros(samples);
        let count = zeros.len() - 1;
        let measured = 0.5 * count as f64 / (zeros[count].0 - zeros[0].0);
        let (exact, limit) = (beads.frequency(mode), string.frequency(mode));
        println!(
            "mode {mode}: {measured:.5} Hz over {count} half-periods; beads {:+.1e}, string {:+.2} %",
            measured / exact - 1.0,
            100.0 * (measured / limit - 1.0)
        );
        // Verlet is fast by (w h)²/24, 1.3e-5 for mode 5; the string of beads is slow by (n pi/128)²/6, 0.25 % for mode 5.
        // Measured: 5e-7 .. 1.3e-5 from the beads, 0.01 % .. 0.25 % from the string.
        assert!((measured / exact - 1.0).abs() < 5e-5);
        assert!((measured / limit - 1.0).abs() < 0.01);
        assert!(measured < limit);
    }
}

/// Period of the first mode of a rope that hangs by one end and swings a little.
fn period(segments: u32) -> f64 {
    let (length, modulus) = (1.0, 100.0);
    let mut sim = simulation(&format!(
        "time.fps = 40\n[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 100\n\
         [[rope]]\nname = \"rope\"\nfrom = [0, 0, 0]\nto = [0, 0, {}]\nsegments = {segments}\ndensity = {DENSITY}\npin = [\"start\"]\nlinks = {{ structural = {modulus} }}\n",
        -length
    ));
    let rest = HangingRope { length, weight: DENSITY * G, stiffness: modulus, load: 0.0 };
    let chain = HangingChain { length, gravity: G };
    let at = |i: usize| length * i as f64 / f64::from(segments);
    let shape: Vec<f64> = (0..=segments as usize).map(|i| chain.shape(1, length - at(i))).collect();
    let x: Vec<Vector> = shape.iter().enumerate().map(|(i, y)| vector(0.0, 1e-4 * y, -rest.depth(at(i)))).collect();
    write(&mut sim, "rope", "position", &x);
    // Masses are equal but for the halved end.
    let part = |y: Vec<Vector>| -> f64 {
        let last = y.len() - 1;
        y.iter().enumerate().map(|(i, y)| y.y * shape[i] * if i == last { 0.5 } else { 1.0 }).sum()
    };
    let mut samples = Vec::new();
    for frame in 0..700 {
        samples.push((f64::from(frame) / 40.0, part(positions(&sim, "rope")), part(velocities(&sim, "rope"))));
        step(&mut sim);
    }
    let zeros = zeros(&samples);
    let count = zeros.len() - 1;
    2.0 * (zeros[count].0 - zeros[0].0) / count as f64
}

#[test]
fn the_period_of_a_rope_converges() {
    let periods = [10, 20, 40, 80].map(period);
    let ratios = convergence("period at 10, 20, 40, 80 segments [s]", &periods);
    // Measured: 4.002, 4.003.
    for ratio in ratios {
        assert!((ratio - 4.0).abs() < 0.8, "{ratio}");
    }
    let exact = 1.0 / HangingChain { length: 1.0, gravity: G }.frequency(1);
    println!("a rope that cannot stretch: {exact:.5} s");
    // This one is 0.5 % longer.
    assert!((periods[3] / exact - 1.0).abs() < 0.005);
}

/// A sheet held at two corners, relaxed until it hangs at rest; starts from the shape of a coarser one, or flat.
///
/// It is held by patches of 1/8 x 1/8 m: a single mass is a point, at which the displacement of an elastic sheet grows with the
/// logarithm of the division (measured: by the same 0.6 mm from 8 to 16 to 32 cells), and there is nothing to converge to. It is stiff
/// enough for the coarsest division to resolve its bends: sqrt(B/T) is 0.2 m.
fn draped(cells: usize, coarse: &[Vector]) -> Vec<Vector> {
    let n = cells + 1;
    let side = cells / 8;
    let patch =
        (0..=side).flat_map(|j| (0..=side).flat_map(move |i| [format!("\"vertex {i} {j}\""), format!("\"vertex {} {j}\"", cells - i)]));
    let pins = patch.collect::<Vec<_>>().join(", ");
    // A loose tolerance: on the way to rest nothing else is asked of a step, and at rest the residual is zero.
    let mut sim = simulation(&format!(
        "time.fps = 10\n[[system]]\nintegrator = \"implicit_euler\"\nsubsteps = 1\nsolver = {{ linear = \"cholesky\", newton_tolerance = 1e-2 }}\n\
         [[sheet]]\nname = \"sheet\"\nsize = [1, 1]\nresolution = [{n}, {n}]\npin = [{pins}]\nhinge = 0.5\nlinks = {{ structural = 300, shear = 150 }}\n\
         [[force]]\nkind = \"drag\"\nrate = 3\n"
    ));
    let m = (coarse.len() as f64).sqrt() as usize;
    if m > 1 {
        let at = |i: usize| {
            let t = (m - 1) as f64 * i as f64 / (n - 1) as f64;
            let k = (t as usize).min(m - 2);
            (k, t - k as f64)
        };
        let x: Vec<Vector> = (0..n * n)
            .map(|p| {
                let ((i, s), (j, t)) = (at(p % n), at(p / n));
                let row = |j: usize| coarse[i + m * j] * (1.0 - s) + coarse[i + 1 + m * j] * s;
                row(j) * (1.0 - t) + row(j + 1) * t
            })
            .collect();
        write(&mut sim, "sheet", "position", &x);
    }
    let mut steps = 0;
    loop {
        step(&mut sim);
        steps += 1;
        if sim.ledger().speed.unwrap() < 3e-6 {
            break;
        }
        assert!(steps < 300, "{n}: still {:e} m/s", sim.ledger().speed.unwrap());
    }
    positions(&sim, "sheet")
}

/// Heights of a free corner and of the middle.
fn heights(x: &[Vector]) -> [f64; 2] {
    [x[x.len() - 1].z, x[x.len() / 2].z]
}

/// The patches end between two rows of masses: where exactly, no division can say, which makes it order 1, ratios of 2.
fn drape_converges(cells: [usize; 3]) {
    let mut x = Vec::new();
    let drapes = cells.map(|n| {
        x = draped(n, &x);
        heights(&x)
    });
    for (k, name) in ["corner", "middle"].into_iter().enumerate() {
        for ratio in convergence(&format!("height of the {name} at {cells:?} cells [m]"), &drapes.map(|d| d[k])) {
            // Measured: 1.926 and 1.941 at 8, 16, 32 cells, 1.912 and 1.933 at 16, 32, 64.
            assert!((ratio - 2.0).abs() < 0.3, "{ratio}");
        }
    }
    assert!(drapes[2][0] < -0.2, "it hangs");
}

#[test]
fn the_drape_of_a_sheet_converges() {
    drape_converges([8, 16, 32]);
}

#[test]
#[ignore = "long: make validate"]
fn the_drape_of_a_fine_sheet_converges() {
    drape_converges([16, 32, 64]);
}

/// The lecture's recipe A: f = k (|d| - l)/l for neighbours.             (springs.9)
struct RecipeA {
    modulus: f64,
    length: f64,
}

impl UserForce for RecipeA {
    fn force(&mut self, _: f64, x: &[f64], _: &[f64], _: &[f64], force: &mut [f64]) -> Result<(), String> {
        for i in 0..x.len() / 3 - 1 {
            let d: [f64; 3] = std::array::from_fn(|a| x[3 * i + 3 + a] - x[3 * i + a]);
            let norm = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            for a in 0..3 {
                let f = self.modulus * (norm - self.length) / self.length * d[a] / norm;
                force[3 * i + a] += f;
                force[3 * i + 3 + a] -= f;
            }
        }
        Ok(())
    }
}

/// Recipe A (divide the force by the rest length), recipe B (divide the constant), and the modulus of a rope are one.    (springs.10)
#[test]
fn both_recipes_of_stiffness_and_the_modulus_give_one_rope() {
    let (n, modulus, length) = (6_u32, 40.0, 1.2);
    let l = length / f64::from(n);
    let system = "time.fps = 50\n[[system]]\nintegrator = \"velocity_verlet\"\nsubsteps = 20\n";
    let mut rope = simulation(&format!(
        "{system}[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [{length}, 0, 0]\nsegments = {n}\ndensity = {DENSITY}\npin = [\"start\"]\nlinks = {{ structural = {modulus} }}\n"
    ));
    let masses: Vec<f64> = (0..=n).map(|i| DENSITY * l * if i == 0 || i == n { 0.5 } else { 1.0 }).collect();
    let particles = |springs: &str| -> Simulation {
        simulation(&format!(
            "{system}[[particles]]\nname = \"r\"\nposition = {}\nmass = {masses:?}\npin = [\"vertex 0\"]\nspring = [{springs}]\n",
            list(&positions(
                &simulation(&format!("[[rope]]\nname = \"r\"\nfrom = [0, 0, 0]\nto = [{length}, 0, 0]\nsegments = {n}\n")),
                "r"
            ))
        ))
    };
    let b: Vec<String> =
        (0..n).map(|i| format!("{{ between = [{i}, {}], stiffness = {:e}, rest_length = {l:e} }}", i + 1, modulus / l)).collect();
    let mut recipe_b = particles(&b.join(", "));
    let mut recipe_a = particles("");
    recipe_a.add_force("main", Box::new(RecipeA { modulus, length: l })).unwrap();
    let mut worst = (0.0_f64, 0.0_f64);
    for _ in 0..25 {
        [&mut rope, &mut recipe_b, &mut recipe_a].into_iter().for_each(|sim| drop(step(sim)));
        let x = positions(&rope, "r");
        let off = |y: Vec<Vector>| x.iter().zip(y).map(|(x, y)| (*x - y).norm()).fold(0.0, f64::max);
        worst = (worst.0.max(off(positions(&recipe_b, "r"))), worst.1.max(off(positions(&recipe_a, "r"))));
    }
    let fallen = positions(&rope, "r")[n as usize].z;
    println!("after 0.5 s (end at {fallen:.3} m): recipe B {:.1e} m from the rope, recipe A {:.1e} m", worst.0, worst.1);
    // Round-off of 500 steps, which a swinging rope magnifies a little. Measured: 1.1e-15, 8.5e-16 m.
    assert!(fallen < -0.3);
    assert!(worst.0 < 1e-11 && worst.1 < 1e-11);
    // A constant that does not know the length makes another rope: n springs in series are n times as soft.
    let wrong: Vec<String> =
        (0..n).map(|i| format!("{{ between = [{i}, {}], stiffness = {modulus:e}, rest_length = {l:e} }}", i + 1)).collect();
    let mut soft = particles(&wrong.join(", "));
    run(&mut soft, 25);
    assert!((positions(&soft, "r")[n as usize] - positions(&rope, "r")[n as usize]).norm() > 0.01);
}
