//! Single projections of one element each, against what is computed by hand: to round-off. Springs, limits, hinges and volumes have theirs
//! in `position_based.rs` and `surfaces.rs`.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, step, vector, velocities, write};
use std::collections::HashMap;
use std::sync::Arc;
use tumble_f64::elements::{
    Area, BendTwist, Constraints, Distance, Linear, Members, Membrane, Neohookean, Projected, Projection, Strands, Vector as Seam, Woven,
};
use tumble_f64::geometry::Walls;
use tumble_f64::math::{Quat, Row, xyz};
use tumble_f64::scene::Simulation;
use tumble_interface::{Mesh, Scene};

fn step_of(h: f64, iteration: u32, iterations: u32) -> Projection<'static> {
    Projection { h, before: &[], iteration, iterations, plain: None, walls: Walls::default() }
}

/// A point with an inverse mass.
fn row(x: f64, y: f64, z: f64, w: f64) -> Row {
    [x, y, z, w]
}

fn near(found: f64, exact: f64, most: f64) {
    assert!((found - exact).abs() <= most, "{found:e}, by hand {exact:e}: {:e} apart", found - exact);
}

/// The unit tetrahedron with B = 1, both laws.
fn tetrahedron(mu: f64, lambda: f64) -> Neohookean {
    let b = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let rest = std::array::from_fn(|i| if i < 9 { b[i] } else { 1.0 + mu / lambda });
    let shear = [Members { nodes: [0, 1, 2, 3], rest: b, law: [], stiffness: mu / 6.0, damping: 0.0 }];
    let bulk = [Members { nodes: [0, 1, 2, 3], rest, law: [], stiffness: lambda / 6.0, damping: 0.0 }];
    Neohookean::new(4, &shear, &bulk, 0.0).unwrap()
}

/// (J W J^T + alpha) dlambda = -(C + alpha lambda) by Cramer's rule.
fn pair([a11, a12, a22]: [f64; 3], c: [f64; 2], alpha: [f64; 2], lambda: [f64; 2]) -> [f64; 2] {
    let (a11, a22) = (a11 + alpha[0], a22 + alpha[1]);
    let [b1, b2] = [0, 1].map(|i| -(c[i] + alpha[i] * lambda[i]));
    let det = a11 * a22 - a12 * a12;
    [(b1 * a22 - b2 * a12) / det, (a11 * b2 - a12 * b1) / det]
}

/// F = diag(2, 1, 1): c1 = |F| = sqrt(6) with the gradients (2, 0, 0), (0, 1, 0), (0, 0, 1) over c1, c2 = 2 - 1 - mu/lambda with those of the
/// cofactors, (1, 0, 0), (0, 2, 0), (0, 0, 2); on x0 minus their sums.                                          (solids.10)
#[test]
fn a_neohookean_tetrahedron_moves_as_computed_by_hand() {
    let (mu, lambda, h) = (5.0, 40.0, 0.1);
    let w = [0.5, 1.0, 2.0, 0.25];
    let alpha = [6.0 / (mu * h * h), 6.0 / (lambda * h * h)];
    let mut x = vec![row(0.0, 0.0, 0.0, w[0]), row(2.0, 0.0, 0.0, w[1]), row(0.0, 1.0, 0.0, w[2]), row(0.0, 0.0, 1.0, w[3])];
    let start = x.clone();
    tetrahedron(mu, lambda).project(&mut x, &step_of(h, 0, 1));
    let c1 = 6.0_f64.sqrt();
    // Squares and products of the gradients of each corner: 6, 4, 1, 1 over 6; 2 + 2 + 2, 2, 2, 2 over sqrt(6); 9, 1, 4, 4.
    let a11 = (6.0 * w[0] + 4.0 * w[1] + w[2] + w[3]) / 6.0;
    let a12 = (6.0 * w[0] + 2.0 * (w[1] + w[2] + w[3])) / c1;
    let a22 = 9.0 * w[0] + w[1] + 4.0 * (w[2] + w[3]);
    let [d1, d2] = pair([a11, a12, a22], [c1, 1.0 - mu / lambda], alpha, [0.0; 2]);
    let exact = [
        vector(-2.0 * d1 / c1 - d2, -d1 / c1 - 2.0 * d2, -d1 / c1 - 2.0 * d2) * w[0],
        vector(2.0 * d1 / c1 + d2, 0.0, 0.0) * w[1],
        vector(0.0, d1 / c1 + 2.0 * d2, 0.0) * w[2],
        vector(0.0, 0.0, d1 / c1 + 2.0 * d2) * w[3],
    ];
    for i in 0..4 {
        let off = (xyz(x[i]) - xyz(start[i]) - exact[i]).norm();
        println!("corner {i}: moved by {:.6} m, {off:.1e} off", exact[i].norm());
        assert!(off < 1e-15 && exact[i].norm() > 1e-3, "{i}: {:?} {:?}", x[i], exact[i]);
    }
}

/// With x0 held the corners stay on their axes, F stays a diagonal, and sweeps are three numbers each: multipliers go on from one to the next.
#[test]
fn a_neohookean_tetrahedron_goes_on_with_its_multipliers() {
    let (mu, lambda, h) = (5.0, 40.0, 0.3);
    let w = [1.0, 2.0, 0.25];
    let alpha = [6.0 / (mu * h * h), 6.0 / (lambda * h * h)];
    let mut f = [1.4_f64, 0.9, 1.1];
    let mut x = vec![row(0.0, 0.0, 0.0, 0.0), row(f[0], 0.0, 0.0, w[0]), row(0.0, f[1], 0.0, w[1]), row(0.0, 0.0, f[2], w[2])];
    let mut solid = tetrahedron(mu, lambda);
    let mut multipliers = [0.0; 2];
    for sweep in 0..30 {
        solid.project(&mut x, &step_of(h, sweep, 30));
        let c1 = f.iter().map(|f| f * f).sum::<f64>().sqrt();
        let (g1, g2) = (f.map(|f| f / c1), [f[1] * f[2], f[2] * f[0], f[0] * f[1]]);
        let sum = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| w[i] * a[i] * b[i]).sum::<f64>();
        let c = [c1, f[0] * f[1] * f[2] - 1.0 - mu / lambda];
        let d = pair([sum(g1, g1), sum(g1, g2), sum(g2, g2)], c, alpha, multipliers);
        (0..3).for_each(|i| f[i] += w[i] * (g1[i] * d[0] + g2[i] * d[1]));
        (0..2).for_each(|i| multipliers[i] += d[i]);
        (0..3).for_each(|i| near(x[i + 1][i], f[i], 1e-14));
        // Measured: 7.2e-3, 2.2e-3, 2.4e-6, 3.4e-12, then round-off.
        assert!(sweep > 1 || d[1].abs() > 1e-3, "sweep {sweep} does something: {d:?}");
    }
    // They end where each law has the multiplier that its measure asks for.
    let measures = [f.iter().map(|f| f * f).sum::<f64>().sqrt(), f[0] * f[1] * f[2] - 1.0 - mu / lambda];
    (0..2).for_each(|i| near(alpha[i] * multipliers[i], -measures[i], 1e-13));
    // That is the step of implicit Euler, m (f - f*) = -h² dE/df with P = mu F + (lambda (J - 1) - mu) cof F, but for gradients that turned on the
    // way. Measured: 6.4 mm off at most, of ways up to 111 mm.
    let bracket = lambda * (f[0] * f[1] * f[2] - 1.0) - mu;
    let cofactors = [f[1] * f[2], f[2] * f[0], f[0] * f[1]];
    let balance = |i: usize| w[i] * h * h / 6.0 * (mu * f[i] + bracket * cofactors[i]) + f[i] - [1.4, 0.9, 1.1][i];
    let (off, way) =
        (0..3).fold((0.0_f64, 0.0_f64), |(off, way), i| (off.max(balance(i).abs()), way.max((f[i] - [1.4, 0.9, 1.1][i]).abs())));
    println!("moved by {way:.3} m, {off:.1e} m off the step of implicit Euler");
    assert!(way > 0.05 && off < 0.1 * way, "{way} {off:e}");
}

/// A right triangle with legs a and b: A = a b/2, whose gradients on the corners of the legs are b/2 and a/2 along them.    (membranes.6)
#[test]
fn a_projected_area_moves_as_computed_by_hand() {
    let (a, b, rest, k, h) = (2.0, 1.0, 0.7, 8.0, 0.5);
    let w = [0.5, 1.0, 2.0];
    let mut x = vec![row(0.0, 0.0, 0.0, w[0]), row(a, 0.0, 0.0, w[1]), row(0.0, b, 0.0, w[2])];
    let member = [Members { nodes: [0, 1, 2], rest: [rest], law: [], stiffness: k, damping: 0.0 }];
    Projected::<Area, Linear, 3, 1, 1, 0>::new(3, 3, &[], &member, &[]).unwrap().project(&mut x, &step_of(h, 0, 1));
    let weight = 0.25 * (w[0] * (a * a + b * b) + w[1] * b * b + w[2] * a * a);
    let delta = -(0.5 * a * b - rest) / (weight + 1.0 / (k * h * h));
    assert!(delta.abs() > 0.05);
    for (found, exact) in [
        (x[0][0], -0.5 * b * w[0] * delta),
        (x[0][1], -0.5 * a * w[0] * delta),
        (x[1][0], a + 0.5 * b * w[1] * delta),
        (x[1][1], 0.0),
        (x[2][0], 0.0),
        (x[2][1], b + 0.5 * a * w[2] * delta),
    ] {
        near(found, exact, 1e-15);
    }
    assert!(x.iter().all(|x| x[2] == 0.0));
    // A triangle without area has no direction, and stays.
    let mut flat = vec![row(0.0, 0.0, 0.0, 1.0), row(1.0, 0.0, 0.0, 1.0), row(2.0, 0.0, 0.0, 1.0)];
    let before = flat.clone();
    Projected::<Area, Linear, 3, 1, 1, 0>::new(3, 3, &[], &member, &[]).unwrap().project(&mut flat, &step_of(h, 0, 1));
    assert_eq!(flat, before);
}

/// A frame that is turned about an axis of the rod: 0 and 1 bend it, 2 twists it.
fn turned(axis: usize, angle: f64) -> Quat<f64> {
    let mut v = [0.0; 3];
    v[axis] = (0.5 * angle).sin();
    Quat { v: v.into(), w: (0.5 * angle).cos() }
}

/// How far a frame is turned about an axis.
fn angle(axis: usize, q: Row) -> f64 {
    2.0 * q[axis].atan2(q[3])
}

/// Two frames, turned by theta about one axis: r = s (2/l sin(theta/2) - kappa), dr/dtheta = s/l cos(theta/2). A rotation vector d is taken by
/// q (1 + d/2) of length 1, which turns by 2 atan(d/2).                                                        (rods.2)
fn relaxed(theta: f64, w: [f64; 2], [l, s, kappa]: [f64; 3], alpha: f64) -> [f64; 2] {
    let (r, g) = (s * (2.0 / l * (0.5 * theta).sin() - kappa), s / l * (0.5 * theta).cos());
    let delta = -r / (g * g * (w[0] + w[1]) + alpha);
    [2.0 * (-0.5 * w[0] * g * delta).atan(), 2.0 * (0.5 * w[1] * g * delta).atan()]
}

#[test]
fn projected_frames_bend_and_twist_back_as_computed_by_hand() {
    let (l, side, twist, k, h, theta, kappa) = (0.5, 1.2, 1.5, 3.0, 0.4, 0.3, 0.1);
    let w = [0.5, 2.0];
    for axis in 0..3 {
        let mut rest = [2.0 / l, 0.0, 0.0, 0.0, side, twist];
        rest[1 + axis] = kappa;
        let member = [Members { nodes: [0, 1], rest, law: [], stiffness: k, damping: 0.0 }];
        let mut x = vec![turned(axis, 0.2).row(), turned(axis, 0.2 + theta).row()];
        Projected::<BendTwist, Linear, 2, 3, 6, 0>::new(2, 0, &w, &member, &[]).unwrap().project(&mut x, &step_of(h, 0, 1));
        let s = [1.0, side, twist][axis];
        let [first, second] = relaxed(theta, w, [l, s, kappa], 1.0 / (k * h * h));
        println!("about axis {axis}: turned by {first:.4} and {second:.4} rad");
        assert!(first > 0.005 && second < -0.02);
        near(angle(axis, x[0]), 0.2 + first, 1e-15);
        near(angle(axis, x[1]), 0.2 + theta + second, 1e-15);
    }
}

/// The same of two pieces of a rod that is solved as a whole: twist does not change their direction, so that no other element answers.
#[test]
fn a_twisted_strand_turns_back_as_computed_by_hand() {
    let (l, twist, k, h, theta) = (0.5, 1.5, 0.3, 0.4, 0.3);
    let w = [0.5, 2.0];
    let mut x: Vec<Row> = (0..3).map(|i| row(0.0, 0.0, l * f64::from(i), 1.0)).collect();
    x.extend([turned(2, 0.2).row(), turned(2, 0.2 + theta).row()]);
    let stretches: Vec<Members<3, 2, 0>> =
        (0..2).map(|i| Members { nodes: [i, i + 1, 3 + i], rest: [l, 1.0], law: [], stiffness: 50.0, damping: 0.0 }).collect();
    let mut bends = vec![Members { nodes: [3, 4], rest: [2.0 / l, 0.0, 0.0, 0.0, 1.0, twist], law: [], stiffness: k, damping: 0.0 }];
    let mut strand = Strands::new(5, 3, &w, &stretches, &mut bends, &[]).unwrap();
    assert!(bends.is_empty());
    let start = x.clone();
    strand.project(&mut x, &step_of(h, 0, 1));
    let [first, second] = relaxed(theta, w, [l, twist, 0.0], 1.0 / (k * h * h));
    assert!(first > 0.005 && second < -0.02, "{first} {second}");
    near(angle(2, x[3]), 0.2 + first, 1e-14);
    near(angle(2, x[4]), 0.2 + theta + second, 1e-14);
    assert!(x[..3].iter().zip(&start).all(|(x, s)| (xyz(*x) - xyz(*s)).norm() < 1e-15), "{x:?}");
}

/// Sewing springs, of zero length, as a vector. Stiff or not, both ends move straight towards each other by their inverse masses, and meet if rigid.
#[test]
fn a_projected_seam_closes_as_computed_by_hand() {
    let (w, k, h) = ([1.0, 0.25], 20.0, 0.2);
    let gap = vector(0.3, -0.4, 1.2);
    for (stiffness, alpha) in [(k, 1.0 / (k * h * h)), (f64::INFINITY, 0.0)] {
        let exact = [0, 1].map(|i| gap * (w[i] / (w[0] + w[1] + alpha)));
        let start = vec![row(1.0, 2.0, 3.0, w[0]), row(1.0 + gap.x, 2.0 + gap.y, 3.0 + gap.z, w[1])];
        let sewn = [Members { nodes: [0, 1], rest: [], law: [], stiffness, damping: 0.0 }];
        let spring = [Members { nodes: [0, 1], rest: [0.0], law: [], stiffness, damping: 0.0 }];
        let seam: Box<dyn Constraints> = Box::new(Projected::<Seam, Linear, 2, 3, 0, 0>::new(2, 2, &[], &sewn, &[]).unwrap());
        let link: Box<dyn Constraints> = Box::new(Projected::<Distance, Linear, 2, 1, 1, 0>::new(2, 2, &[], &spring, &[]).unwrap());
        for mut element in [seam, link] {
            let mut x = start.clone();
            element.project(&mut x, &step_of(h, 0, 1));
            let off = [xyz(x[0]) - xyz(start[0]) - exact[0], xyz(x[1]) - xyz(start[1]) + exact[1]].map(|d| d.norm());
            assert!(off.iter().all(|d| *d < 1e-15) && exact[1].norm() > 0.1, "{}: {off:?}", element.name());
            // A seam that is closed pulls nowhere.
            let mut closed = vec![row(1.0, 2.0, 3.0, 1.0), row(1.0, 2.0, 3.0, 1.0)];
            element.project(&mut closed, &step_of(h, 0, 1));
            assert!(closed[0] == closed[1] && closed[0] == row(1.0, 2.0, 3.0, 1.0), "{closed:?}");
        }
    }
}

/// A unit of fabric that is pulled along warp or weft, its other corners held. By its record, with C = C0 + 6 (s - 1) D up to the stretch 7/6:
///
///   force per width = 2 s C e,   work = C0 (s² - 1)²/4 + 6 D (s^5/5 - s^4/4 - s³/3 + s²/2 - 7/60)            (fabrics.2)
///
/// so that c = sqrt(2 work), since k c²/2 is the energy, and dc/ds = force/c.
#[test]
fn a_projected_fabric_moves_as_computed_by_hand() {
    let h = 0.05;
    for name in ["denim", "interlock", "tablecloth"] {
        let fabric = tumble_io::shipped(name).unwrap();
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Vector::from);
        let (b, area) = Membrane::axes(corners, vector(1.0, 0.0, 0.0), 0.0).unwrap();
        let member = [Members { nodes: [0, 1, 2], rest: Woven::rest(b, &fabric, 1.0), law: [], stiffness: area, damping: 0.0 }];
        // Row 1 of the record is the warp, row 5 the weft; of each the stiffness along it.
        for (axis, along, entry) in [(0, 1, 0), (1, 5, 2)] {
            let (s, w) = (1.08_f64, 0.3);
            let c0 = fabric.stretching[0][entry];
            let slope = fabric.stretching[along][entry] - c0;
            let e = 0.5 * (s * s - 1.0);
            let force = 2.0 * s * e * (c0 + 6.0 * (s - 1.0) * slope);
            let powers = s.powi(5) / 5.0 - s.powi(4) / 4.0 - s.powi(3) / 3.0 + s * s / 2.0 - 7.0 / 60.0;
            let c = (2.0 * (c0 * e * e + 6.0 * slope * powers)).sqrt();
            let g = force / c;
            let delta = -c / (w * g * g + 1.0 / (area * h * h));
            let mut x: Vec<Row> = corners.iter().map(|c| row(c.x, c.y, c.z, 0.0)).collect();
            (x[axis + 1][axis], x[axis + 1][3]) = (s, w);
            Projected::<Woven, Linear, 3, 3, 28, 0>::new(3, 3, &[], &member, &[]).unwrap().project(&mut x, &step_of(h, 0, 1));
            println!("{name}, axis {axis}: moved by {:.5} m, {:.1e} off", w * g * delta, x[axis + 1][axis] - s - w * g * delta);
            assert!(w * g * delta < -1e-3);
            near(x[axis + 1][axis], s + w * g * delta, 1e-14);
            near(x[axis + 1][1 - axis], 0.0, 1e-14);
        }
    }
}

/// A point that comes down on the middle of a triangle at a speed, from 25 mm with a thickness of 20 mm: places and velocities after a step, the
/// point first, and where each would be without contact.
fn met(relative: Vector, friction: f64) -> ([Vec<Vector>; 3], [f64; 2]) {
    let (thickness, drift) = (0.02, vector(0.1, -0.05, 0.2));
    let text = format!(
        "version = 1\nprecision = \"double\"\ntime.fps = 100\nworld.gravity = [0, 0, 0]\n[[system]]\nmethod = \"position_based\"\nsubsteps = 1\n\
         self_contact = {{ thickness = {thickness}, friction = {friction} }}\n\
         [[rope]]\nname = \"point\"\nfrom = [0, 0, 0.025]\nto = [0, 0, 1.025]\nsegments = 1\ndensity = 0.5\nlinks.structural = 1\n\
         [[net]]\nname = \"triangle\"\nmesh.path = \"t.obj\"\ndensity = 0.4\nlinks.structural = 1\n"
    );
    let vertices = vec![[0.9, 0.0, 0.0], [-0.45, 0.75, 0.0], [-0.45, -0.75, 0.0]];
    let mesh = Mesh { vertices, triangles: vec![[0, 1, 2]], ..Mesh::default() };
    let assets = Arc::new(HashMap::from([("t.obj".to_string(), mesh)]));
    let mut sim = Simulation::new(Scene::from_toml(&text).unwrap(), assets.into()).unwrap();
    let all = |sim: &Simulation, of: &dyn Fn(&Simulation, &str) -> Vec<Vector>| -> Vec<Vector> {
        of(sim, "point").into_iter().take(1).chain(of(sim, "triangle")).collect()
    };
    write(&mut sim, "point", "velocity", &[drift + relative; 2]);
    write(&mut sim, "triangle", "velocity", &[drift; 3]);
    let free: Vec<Vector> =
        all(&sim, &|s, o| positions(s, o)).iter().zip(all(&sim, &|s, o| velocities(s, o))).map(|(x, v)| *x + v * 0.01).collect();
    step(&mut sim);
    // Half of 0.5 kg; a third of 0.4 kg/m² on 1.35 m x 1.5 m/2.
    ([all(&sim, &|s, o| positions(s, o)), all(&sim, &|s, o| velocities(s, o)), free], [1.0 / 0.25, 3.0 / (0.4 * 1.0125)])
}

/// 10 mm down leave 15 mm: the depth is 5 mm, and both give way by their inverse masses over w_p + 3 w/9. Friction takes back mu times the depth of
/// what has slid, or all of it.                                                                              (positions.4)
#[test]
fn a_point_that_meets_a_triangle_moves_as_computed_by_hand() {
    let depth = 0.005;
    // Slid by 5 mm: the cone allows 1.5 mm; then 0.65 mm, all of which is taken back; then without friction.
    for (aside, friction) in [(vector(0.3, 0.4, 0.0), 0.3), (vector(0.025, 0.06, 0.0), 0.3), (vector(0.3, 0.4, 0.0), 0.0)] {
        let ([x, v, free], [point, corner]) = met(aside + vector(0.0, 0.0, -1.0), friction);
        let slid = aside * 0.01;
        let back = slid * (friction * depth / slid.norm()).min(1.0);
        let push = (vector(0.0, 0.0, depth) - back) * (1.0 / (point + corner / 3.0));
        let exact = |i: usize| if i == 0 { push * point } else { push * (-corner / 3.0) };
        let mut worst = [0.0_f64; 2];
        for i in 0..4 {
            worst[0] = worst[0].max((x[i] - free[i] - exact(i)).norm());
            let before = vector(0.1, -0.05, 0.2) + if i == 0 { aside + vector(0.0, 0.0, -1.0) } else { Vector::default() };
            worst[1] = worst[1].max((v[i] - before - exact(i) * 100.0).norm());
            assert!(exact(i).norm() > 1e-4);
        }
        println!("slid by {:.2} mm, mu = {friction}: {:.1e} m and {:.1e} m/s off", 1e3 * slid.norm(), worst[0], worst[1]);
        // Rounding of places of 1 m, over the step of 0.01 s for velocities.
        assert!(worst[0] < 1e-15 && worst[1] < 1e-13, "{worst:?}");
        let height = (x[0] - (x[1] + x[2] + x[3]) * (1.0 / 3.0)).z;
        near(height, 0.02, 1e-15);
    }
}
