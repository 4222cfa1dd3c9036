//! Every element against finite differences of its own energy, in double precision: force = -dE/dq, the exact Hessian
//! product, its symmetry, no net force and no net torque. One definition is enough only if this holds.

use tumble_f64::elements::forces as derived;
use tumble_f64::elements::*;
use tumble_f64::forces::{Attractor, DirectSum, Halos};
use tumble_f64::math::parallel::CHUNK;
use tumble_f64::math::{Real, Row, Vec3, ZERO, rotation, row, xyz};
use tumble_f64::state::Masses;
use tumble_interface::scene::Hessian;

/// Numbers between -1 and 1 without a pattern.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64) / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vec3<Real> {
        Vec3 { x: self.next(), y: self.next(), z: self.next() }
    }

    fn row(&mut self) -> Row {
        row(self.vector(), 0.0)
    }
}

struct Case {
    batch: Box<dyn Batch>,
    x: Vec<Row>,
    /// Rows from here on are frames.
    points: usize,
    /// Whether it acts between its nodes only.
    internal: bool,
}

fn batch<E: Element<N, M, D>, Y: Law<P>, const N: usize, const M: usize, const D: usize, const P: usize>(
    rows: usize,
    members: &[Members<N, D, P>],
) -> Box<dyn Batch> {
    Box::new(Elements::<E, Y, N, M, D, P>::new(rows, members).unwrap())
}

fn member<const N: usize, const D: usize>(nodes: [u32; N], rest: [f64; D]) -> Members<N, D, 0> {
    Members { nodes, rest, law: [], stiffness: 1.5, damping: 0.2 }
}

/// Without a column for the last edge.
fn rim<const D: usize>(mut rest: [f64; D]) -> [f64; D] {
    [2, 5, 8].into_iter().for_each(|i| rest[i] = 0.0);
    rest
}

fn cases() -> Vec<Case> {
    let mut r = Numbers(7);
    let mut points = |n: usize| -> Vec<Row> { (0..n).map(|_| r.row()).collect() };
    let mut cases = Vec::new();
    let mut add = |batch, x: Vec<Row>, points, internal| cases.push(Case { batch, x, points, internal });

    let spring = |nodes, l, b| Members { nodes, rest: [l], law: [], stiffness: 3.0, damping: b };
    let springs = [spring([0, 1], 0.4, 0.2), spring([1, 2], 2.5, 0.0), spring([3, 0], 0.9, 0.3), spring([2, 4], 0.1, 0.1)];
    add(batch::<Distance, Linear, 2, 1, 1, 0>(5, &springs), points(5), 5, true);
    add(Box::new(Pairs::<Distance, Linear, 1, 1, 0>::new(5, &springs, &[]).unwrap()), points(5), 5, true);
    let thread = |nodes, l, p| Members { nodes, rest: [l], law: [0.7, p], stiffness: 3.0, damping: 0.1 };
    let threads = [thread([0, 1], 0.4, 0.0), thread([1, 2], 2.9, 0.0), thread([3, 0], 3.0, 1.0)];
    add(batch::<Distance, Nonlinear, 2, 1, 1, 2>(4, &threads), points(4), 4, true);
    add(Box::new(Pairs::<Distance, Nonlinear, 1, 1, 2>::new(4, &threads, &[]).unwrap()), points(4), 4, true);
    add(batch::<Limit, Linear, 2, 1, 1, 0>(5, &springs), points(5), 5, true);
    let vectors = [[0, 1], [1, 2], [0, 2]].map(|nodes| Members { nodes, rest: [], law: [], stiffness: 2.0, damping: 0.0 });
    add(batch::<Vector, Linear, 2, 3, 0, 0>(3, &vectors), points(3), 3, true);
    add(Box::new(Pairs::<Vector, Linear, 3, 0, 0>::new(3, &vectors, &[]).unwrap()), points(3), 3, true);
    let hinges = [
        Members { nodes: [0, 1, 2, 3, 1, 2], rest: Bending::fold(0.3), law: [], stiffness: 1.5, damping: 0.2 },
        Members { nodes: [2, 3, 4, 5, 3, 4], rest: Bending::fold(0.0), law: [], stiffness: 0.5, damping: 0.0 },
    ];
    add(batch::<Bending, Linear, 6, 3, 12, 0>(6, &hinges), points(6), 6, true);
    // Almost folded onto itself, from either side.
    for side in [0.05, -0.05] {
        let x = [[0.0, 0.0, 0.0], [0.1, 1.0, 0.0], [1.1, 0.4, 0.0], [0.9, 0.6, side]].map(|p| row(p.into(), 0.0));
        add(batch::<Bending, Linear, 6, 3, 12, 0>(4, &hinges[..1]), x.to_vec(), 4, true);
    }
    for softening in [0.0, 0.6] {
        let mass = vec![2.0, 3.0, 9.0, 1.5, 0.5, 2.5, 1.0];
        let masses = Masses { mass, ..Masses::default() };
        add(Box::new(DirectSum::new(Attractor::Mass(0.7), softening, false, &[], vec![0..2, 3..7], &masses)), points(7), 7, true);
    }
    let rest: Vec<Row> = points(4);
    let (b, volume) = rest_matrix([0, 1, 2, 3].map(|i| xyz(rest[i])));
    assert!(volume.abs() > 0.01);
    let shear = [Members { nodes: [0, 1, 2, 3], rest: b, law: [], stiffness: 2.0, damping: 0.0 }];
    add(batch::<TetShear, Linear, 4, 9, 9, 0>(4, &shear), points(4), 4, true);
    let strain = [Members { damping: 0.3, ..shear[0] }];
    add(batch::<TetStrain, Linear, 4, 6, 9, 0>(4, &strain), points(4), 4, true);
    let mut rest = [1.3; 10];
    rest[..9].copy_from_slice(&b);
    let inflate = [Members { nodes: [0, 1, 2, 3], rest, law: [], stiffness: 5.0, damping: 0.1 }];
    add(batch::<TetVolume, Linear, 4, 1, 10, 0>(4, &inflate), points(4), 4, true);
    let planes = [
        Members { nodes: [0], rest: [0.0, 0.6, 0.8, 1.7], law: [], stiffness: 4.0, damping: 0.0 },
        Members { nodes: [1], rest: [0.0, 0.0, 1.0, -2.0], law: [], stiffness: 4.0, damping: 0.0 },
    ];
    add(batch::<PointPlane, Linear, 1, 1, 4, 0>(2, &planes), points(2), 2, false);

    let frame = |axis: [f64; 3]| rotation::from_z_to(Vec3::from(axis)).row();
    let mut x = points(3);
    x.extend([frame([1.0, 2.0, 0.5]), frame([0.8, 2.0, 0.3])]);
    let stretch = [[0, 1, 3], [1, 2, 4]].map(|nodes| Members { nodes, rest: [0.7, 0.6], law: [], stiffness: 2.0, damping: 0.1 });
    add(batch::<StretchShear, Linear, 3, 3, 2, 0>(5, &stretch), x.clone(), 3, true);
    let bend = [Members { nodes: [3, 4], rest: [2.0 / 0.7, 0.1, -0.2, 0.3, 1.7, 0.8], law: [], stiffness: 1.2, damping: 0.1 }];
    add(batch::<BendTwist, Linear, 2, 3, 6, 0>(5, &bend), x.clone(), 3, true);
    // The same frames with one quaternion negated are the same orientations.
    x[4] = x[4].map(|q| -q);
    add(batch::<BendTwist, Linear, 2, 3, 6, 0>(5, &bend), x, 3, true);
    for softening in [0.0, 0.6] {
        let masses = Masses { charge: vec![1.0, -2.0, 9.0, 0.5, -1.5, 2.5, 1.0], ..Masses::default() };
        add(Box::new(DirectSum::new(Attractor::Charge(-0.7), softening, false, &[], vec![0..2, 3..7], &masses)), points(7), 7, true);
        let masses = Masses { mass: vec![2.0, 3.0, 9.0, 1.5, 0.5, 2.5, 1.0], ..Masses::default() };
        let halos = [(1, 0.7), (2, 0.4), (4, 0.5)];
        add(Box::new(Halos::new(0.7, softening, &halos, &[0..2, 3..7], &masses)), points(7), 7, true);
    }
    let flat = [[0.0, 0.0, 0.0], [0.2, 1.0, 0.0], [-0.8, 0.4, 0.0], [0.9, 0.7, 0.0]].map(Vec3::from);
    let rest = IsometricBend::rest(flat).unwrap();
    let isometric = [[0, 1, 2, 3], [2, 3, 4, 5]].map(|nodes| Members { nodes, rest, law: [], stiffness: 1.5, damping: 0.0 });
    add(batch::<IsometricBend, Linear, 4, 3, 3, 0>(6, &isometric), points(6), 6, true);
    let (b, area) = Membrane::axes([flat[0], flat[1], flat[2]], flat[3], 0.4).unwrap();
    let root = Membrane::root(3.0, 2.0, 0.5, 0.8).unwrap();
    let rest = std::array::from_fn(|i| if i < 4 { b[i] } else { root[i - 4] });
    let membrane = |nodes, damping| Members { nodes, rest, law: [], stiffness: area, damping };
    add(batch::<Membrane, Linear, 3, 3, 8, 0>(4, &[membrane([0, 1, 2], 0.2), membrane([3, 2, 1], 0.0)]), points(4), 4, true);
    let areas = [[0, 1, 2], [3, 2, 1]].map(|nodes| Members { nodes, rest: [0.4], law: [], stiffness: 2.0, damping: 0.1 });
    add(batch::<Area, Linear, 3, 1, 1, 0>(4, &areas), points(4), 4, true);
    // Measured cloth: strains of a few percent both ways, beyond the record, pressed, sheared; folds of one to thirty times the first sample.
    let record = tumble_io::shipped("interlock").unwrap();
    let mut own = Numbers(11);
    let mut own = |n: usize| -> Vec<Row> { (0..n).map(|_| own.row()).collect() };
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.9, 0.0]].map(Vec3::from);
    for strain in [0.03, 0.1, 0.25, 0.6] {
        let (b, area) = Membrane::axes(triangle, Vec3::from([1.0, 0.4, 0.0]), 0.3).unwrap();
        let member = [Members { nodes: [0, 1, 2], rest: Woven::rest(b, &record, 2.0), law: [], stiffness: area, damping: 0.2 }];
        let moved: Vec<Row> = triangle.iter().zip(own(3)).map(|(x, d)| row(*x + xyz(d) * strain, 0.0)).collect();
        add(batch::<Woven, Linear, 3, 3, 28, 0>(3, &member), moved, 3, true);
    }
    // Triangles that bend, with all their neighbours and with two; curvatures within each piece of a record, and beyond it.
    let rows = [[2.0, 3.0, 0.1, 2.5, 1.0], [1.0, 1.2, 1.1, 0.9, 2.0], [3.0, 2.5, 2.9, 3.5, 3.0]].map(|b| WovenBending::samples(b).unwrap());
    for s in [0.3, 1.0, 2.0, 4.5] {
        let mut rest = [0.0; 36];
        rest[..12].copy_from_slice(&[0.7, 0.1, -0.3, 0.2, 0.8, 0.4, -0.5, 0.3, 0.9, 0.1, -0.1, 0.05].map(|l| l * s));
        rest[12..].copy_from_slice(rows.as_flattened());
        let plain: [f64; 12] = std::array::from_fn(|i| rest[i]);
        add(batch::<Bending, Linear, 6, 3, 12, 0>(6, &[member([0, 1, 2, 3, 4, 5], plain)]), own(6), 6, true);
        add(batch::<Bending, Linear, 6, 3, 12, 0>(5, &[member([0, 1, 2, 3, 4, 2], rim(plain))]), own(5), 5, true);
        add(batch::<WovenBending, Linear, 6, 3, 36, 0>(6, &[member([0, 1, 2, 3, 4, 5], rest)]), own(6), 6, true);
        add(batch::<WovenBending, Linear, 6, 3, 36, 0>(5, &[member([0, 1, 2, 3, 4, 2], rim(rest))]), own(5), 5, true);
    }
    cases
}

fn moved(case: &Case, u: &[Row], h: f64) -> Vec<Row> {
    let step = |i: usize| if i < case.points { row(xyz(case.x[i]) + xyz(u[i]) * h, 0.0) } else { rotation::turn(case.x[i], xyz(u[i]) * h) };
    (0..case.x.len()).map(step).collect()
}

/// Forces on all rows.
fn forces(batch: &mut dyn Batch, x: &[Row], v: &[Row]) -> Vec<Row> {
    let mut out = vec![ZERO; x.len()];
    batch.begin_forces(0.0, x, v);
    batch.add_forces(x, v, 0, &mut out);
    out
}

/// The product with u on all rows.
fn product(batch: &mut dyn Batch, x: &[Row], u: &[Row]) -> Vec<Row> {
    let mut out = vec![ZERO; x.len()];
    batch.begin_product(x, u);
    batch.add_product(u, 0, &mut out);
    out
}

fn inner(a: &[Row], b: &[Row]) -> f64 {
    a.iter().zip(b).map(|(a, b)| xyz(*a).dot(xyz(*b))).sum()
}

#[test]
fn force_is_minus_the_gradient_of_the_energy() {
    let mut r = Numbers(3);
    for mut case in cases() {
        let n = case.x.len();
        let force = forces(case.batch.as_mut(), &case.x, &vec![ZERO; n]);
        for _ in 0..4 {
            let u: Vec<Row> = (0..n).map(|_| r.row()).collect();
            let h = 1e-5;
            let slope = (case.batch.energy(&moved(&case, &u, h)) - case.batch.energy(&moved(&case, &u, -h))) / (2.0 * h);
            let expected = -inner(&force, &u);
            assert!(expected.abs() > 1e-3, "{}: the test sees no force", case.batch.name());
            // Measured: at most 3e-9 (central difference, h² third derivative plus round-off / h).
            assert!((slope - expected).abs() < 2e-8 * expected.abs().max(1.0), "{}: {slope} {expected}", case.batch.name());
        }
    }
}

#[test]
fn the_exact_product_is_the_second_derivative_of_the_energy() {
    let mut r = Numbers(5);
    for mut case in cases() {
        let n = case.x.len();
        let u: Vec<Row> = (0..n).map(|_| r.row()).collect();
        case.batch.linearize(&case.x, Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Exact });
        let product = product(case.batch.as_mut(), &case.x, &u);
        let h = 1e-4;
        let e = |h| case.batch.energy(&moved(&case, &u, h));
        let second = (e(h) - 2.0 * e(0.0) + e(-h)) / (h * h);
        let expected = inner(&product, &u);
        assert!(expected.abs() > 1e-3, "{}", case.batch.name());
        assert!((second - expected).abs() < 2e-6 * expected.abs().max(1.0), "{}: {second} {expected}", case.batch.name());
        if case.points == n {
            // Without frames the product is also the slope of the force, component by component.
            let force = |case: &mut Case, h: f64| {
                let x = moved(case, &u, h);
                forces(case.batch.as_mut(), &x, &vec![ZERO; n])
            };
            let (plus, minus) = (force(&mut case, 1e-5), force(&mut case, -1e-5));
            for i in 0..n {
                let slope = (xyz(minus[i]) - xyz(plus[i])) * (1.0 / 2e-5);
                let error = (slope - xyz(product[i])).norm() / (1.0 + xyz(product[i]).norm());
                // Measured: 1.1e-8 for the hinge, whose third derivative is large, 1e-9 for the others.
                assert!(error < 5e-8, "{}: {error:e}", case.batch.name());
            }
        }
    }
}

#[test]
fn matrices_are_symmetric_and_the_definite_one_is() {
    let mut r = Numbers(11);
    for mut case in cases() {
        let n = case.x.len();
        for hessian in [Hessian::Exact, Hessian::Definite] {
            case.batch.linearize(&case.x, Weights { stiffness: 1.0, damping: 2.0, hessian });
            for _ in 0..4 {
                let [u, w]: [Vec<Row>; 2] = std::array::from_fn(|_| (0..n).map(|_| r.row()).collect());
                let [ku, kw] = [&u, &w].map(|u| product(case.batch.as_mut(), &case.x, u));
                let (a, b) = (inner(&ku, &w), inner(&u, &kw));
                assert!((a - b).abs() < 1e-12 * (1.0 + a.abs()), "{}: {a} {b}", case.batch.name());
                if hessian == Hessian::Definite {
                    assert!(inner(&ku, &u) > -1e-12, "{}", case.batch.name());
                }
            }
        }
    }
}

/// (membranes.10): what is pulled both ways has its exact matrix, what is pressed both ways has nothing across, and what is pulled one way and
/// pressed the other has no less than exactly, and nothing negative.
#[test]
fn tension_stiffens_across_and_pressure_does_not() {
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.9, 0.0]].map(Vec3::from);
    let (b, area) = Membrane::axes(triangle, Vec3::from([1.0, 0.4, 0.0]), 0.3).unwrap();
    let root = Membrane::root(3.0, 2.0, 0.3, 0.8).unwrap();
    let rest = std::array::from_fn(|i| if i < 4 { b[i] } else { root[i - 4] });
    let membrane =
        || batch::<Membrane, Linear, 3, 3, 8, 0>(3, &[Members { nodes: [0, 1, 2], rest, law: [], stiffness: area, damping: 0.0 }]);
    let rest = Woven::rest(b, &tumble_io::shipped("interlock").unwrap(), 2.0);
    let woven = || batch::<Woven, Linear, 3, 3, 28, 0>(3, &[Members { nodes: [0, 1, 2], rest, law: [], stiffness: area, damping: 0.0 }]);
    let mut r = Numbers(17);
    for (mut batch, linear) in [(membrane(), true), (woven(), false)] {
        for (sx, sy) in [(1.2, 1.1), (0.9, 0.8), (1.2, 0.8), (1.0, 1.0)] {
            let x = triangle.map(|p| row(Vec3 { x: p.x * sx, y: p.y * sy, z: 0.0 }, 0.0));
            let mut products = |u: &[Row]| {
                [Hessian::Exact, Hessian::Definite].map(|hessian| {
                    batch.linearize(&x, Weights { stiffness: 1.0, damping: 0.0, hessian });
                    product(batch.as_mut(), &x, u)
                })
            };
            for _ in 0..8 {
                let across: Vec<Row> = (0..3).map(|_| row(Vec3 { x: 0.0, y: 0.0, z: r.next() }, 0.0)).collect();
                let [exact, definite] = products(&across).map(|k| inner(&k, &across));
                match (sx > 1.0, sy > 1.0) {
                    (true, true) => assert!(exact > 1e-3 && (exact - definite).abs() < 1e-12 * exact, "{exact} {definite}"),
                    (false, false) => assert!(exact < 1e-12 && definite.abs() < 1e-12, "{exact} {definite}"),
                    _ => assert!(definite > 1e-6 && definite > exact, "{exact} {definite}"),
                }
                if linear && sy > 1.0 {
                    let any: Vec<Row> = (0..3).map(|_| r.row()).collect();
                    let [exact, definite] = products(&any);
                    for (a, b) in exact.iter().zip(&definite) {
                        assert!((xyz(*a) - xyz(*b)).norm() < 1e-12, "{a:?} {b:?}");
                    }
                }
            }
        }
    }
}

/// The largest lengthening of all but some elements, after those have been given up, as forces and as constraints.
fn largest<E: Element<N, M, D>, const N: usize, const M: usize, const D: usize>(
    members: &[Members<N, D, 0>],
    x: &[Row],
    points: usize,
    lost: &[u32],
) -> [f64; 2] {
    let mut batch = Elements::<E, Linear, N, M, D, 0>::new(x.len(), members).unwrap();
    batch.break_elements(lost);
    let inverse = vec![1.0; x.len() - points];
    let mut constraints = Projected::<E, Linear, N, M, D, 0>::new(x.len(), points, &inverse, members, &[]).unwrap();
    constraints.break_elements(lost);
    [batch.largest_strain(x), constraints.largest_strain(x)]
}

/// Of triangles each edge is the longest somewhere; of rods each piece. What is given up does not count.
#[test]
fn the_largest_lengthening_is_that_of_the_edges_that_hold() {
    let mut r = Numbers(29);
    let record = tumble_io::shipped("interlock").unwrap();
    let warp = Vec3::from([1.0, 0.4, 0.0]);
    let root = Membrane::root(3.0, 2.0, 0.3, 0.8).unwrap();
    let same = |found: [f64; 2], exact: f64| assert!(found.iter().all(|f| (f - exact).abs() < 1e-12 * (1.0 + exact)), "{found:?} {exact}");
    let mut longest = [0; 3];
    for _ in 0..40 {
        // More than fill any register, and a rest.
        let (mut membranes, mut wovens, mut pieces, mut x) = (vec![], vec![], vec![], vec![]);
        let (mut of_triangles, mut of_pieces) = (vec![], vec![]);
        for e in 0..21_u32 {
            let flat: [Vec3<f64>; 3] = std::array::from_fn(|_| Vec3 { z: 0.0, ..r.vector() });
            let place: [Vec3<f64>; 3] = std::array::from_fn(|_| r.vector());
            let Some((b, area)) = Membrane::axes(flat, warp, 0.3).filter(|(_, area)| *area > 0.01) else { continue };
            let edge = |k: usize| (place[(k + 1) % 3] - place[k]).norm() / (flat[(k + 1) % 3] - flat[k]).norm() - 1.0;
            let most = (0..3).max_by(|i, j| edge(*i).total_cmp(&edge(*j))).unwrap();
            longest[most] += 1;
            of_triangles.push(edge(most));
            let nodes = [0, 1, 2].map(|k| x.len() as u32 + k);
            x.extend(place.map(|p| row(p, 1.0)));
            let rest = std::array::from_fn(|i| if i < 4 { b[i] } else { root[i - 4] });
            membranes.push(Members { nodes, rest, law: [], stiffness: area, damping: 0.0 });
            wovens.push(Members { nodes, rest: Woven::rest(b, &record, 2.0), law: [], stiffness: area, damping: 0.0 });
            let l = 0.3 + f64::from(e) * 0.05;
            pieces.push(Members { nodes: [nodes[0], nodes[1], 0], rest: [l, 0.6], law: [], stiffness: 2.0, damping: 0.0 });
            of_pieces.push((place[1] - place[0]).norm() / l - 1.0);
        }
        let points = x.len();
        let mut with_frames = x.clone();
        for piece in &mut pieces {
            piece.nodes[2] = with_frames.len() as u32;
            with_frames.push(rotation::from_z_to(r.vector()).row());
        }
        // Whole, then without those that were stretched most.
        for lost in [0, 5] {
            let held = |all: &[f64]| -> (Vec<u32>, f64) {
                let mut order: Vec<u32> = (0..all.len() as u32).collect();
                order.sort_by(|i, j| all[*j as usize].total_cmp(&all[*i as usize]));
                (order[..lost].to_vec(), all[order[lost] as usize])
            };
            let (gone, exact) = held(&of_triangles);
            same(largest::<Membrane, 3, 3, 8>(&membranes, &x, points, &gone), exact);
            same(largest::<Woven, 3, 3, 28>(&wovens, &x, points, &gone), exact);
            let (gone, exact) = held(&of_pieces);
            same(largest::<StretchShear, 3, 3, 2>(&pieces, &with_frames, points, &gone), exact);
        }
    }
    assert!(longest.iter().all(|n| *n > 100), "{longest:?}");
}

#[test]
fn entries_and_diagonal_are_those_of_the_product() {
    let mut r = Numbers(13);
    for mut case in cases() {
        let n = case.x.len();
        for hessian in [Hessian::Exact, Hessian::Definite] {
            case.batch.linearize(&case.x, Weights { stiffness: 0.7, damping: 2.0, hessian });
            let u: Vec<Row> = (0..n).map(|_| r.row()).collect();
            let product = product(case.batch.as_mut(), &case.x, &u);
            let mut sum = vec![[0.0; 3]; n];
            let mut diagonal = vec![[0.0; 6]; n];
            case.batch.entries(&case.x, &mut |i, j, block| {
                for a in 0..3 {
                    for b in 0..3 {
                        sum[i][a] += block[a][b] * u[j][b];
                    }
                }
                if i == j {
                    for (c, (a, b)) in [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)].into_iter().enumerate() {
                        diagonal[i][c] += block[a][b];
                    }
                }
            });
            let mut blocks = vec![[0.0; 6]; n];
            case.batch.add_diagonal(&case.x, &mut blocks);
            for i in 0..n {
                assert!((Vec3::from(sum[i]) - xyz(product[i])).norm() < 1e-12 * (1.0 + xyz(product[i]).norm()), "{}", case.batch.name());
                for c in 0..6 {
                    assert!((diagonal[i][c] - blocks[i][c]).abs() < 1e-12 * (1.0 + blocks[i][c].abs()), "{}", case.batch.name());
                }
            }
        }
    }
}

#[test]
fn internal_elements_exert_no_net_force_and_no_net_torque() {
    let mut r = Numbers(17);
    for mut case in cases().into_iter().filter(|c| c.internal) {
        let n = case.x.len();
        let v: Vec<Row> = (0..n).map(|_| r.row()).collect();
        let force = forces(case.batch.as_mut(), &case.x, &v);
        let (mut net, mut torque, mut size) = (Vec3::default(), Vec3::default(), 0.0);
        for i in 0..n {
            let f = xyz(force[i]);
            size += f.norm();
            if i < case.points {
                net = net + f;
                torque = torque + xyz(case.x[i]).cross(f);
            } else {
                torque = torque + tumble_f64::math::Quat::from_row(case.x[i]).turn(f);
            }
        }
        assert!(size > 0.1, "{}: the test sees no force", case.batch.name());
        assert!(net.norm() < 1e-14 * size && torque.norm() < 2e-14 * size, "{}: {net:?} {torque:?}", case.batch.name());
    }
}

#[test]
fn internal_damping_opposes_motion_and_leaves_rigid_motion_alone() {
    let mut r = Numbers(19);
    for mut case in cases().into_iter().filter(|c| c.internal) {
        let n = case.x.len();
        let at_rest = forces(case.batch.as_mut(), &case.x, &vec![ZERO; n]);
        let (v0, omega) = (r.vector(), r.vector());
        let rigid: Vec<Row> = (0..n)
            .map(|i| {
                let q = tumble_f64::math::Quat::from_row(case.x[i]);
                if i < case.points { row(v0 + omega.cross(xyz(case.x[i])), 0.0) } else { row(q.conj().turn(omega), 0.0) }
            })
            .collect();
        let any: Vec<Row> = (0..n).map(|_| r.row()).collect();
        for (v, is_rigid) in [(rigid, true), (any, false)] {
            let moving = forces(case.batch.as_mut(), &case.x, &v);
            let power: f64 = (0..n).map(|i| (xyz(moving[i]) - xyz(at_rest[i])).dot(xyz(v[i]))).sum();
            if is_rigid {
                assert!(power.abs() < 1e-13, "{}: {power}", case.batch.name());
            } else if !["limit", "vector", "isometric bend", "tetrahedron shear", "gravitation", "electrostatics", "halos"]
                .contains(&case.batch.name())
            {
                assert!(power < -1e-5, "{}: {power}", case.batch.name());
            }
        }
    }
}

#[test]
fn gathered_pairs_agree_with_the_element_pass_and_break() {
    let mut r = Numbers(23);
    let n = 101_u32;
    let x: Vec<Row> = (0..n).map(|_| r.row()).collect();
    let v: Vec<Row> = (0..n).map(|_| r.row()).collect();
    let spring = |a, b, stiffness| Members { nodes: [a, b], rest: [0.8], law: [], stiffness, damping: 0.3 };
    let mut end = || ((r.next() + 1.0) * 0.5 * f64::from(n)) as u32 % n;
    // Without order, and a sheet of nine columns, in which neighbours are runs of rows and springs are alike.
    let random: Vec<_> = (0..400)
        .map(|_| {
            let i = end();
            spring(i, (i + 1 + end() % (n - 1)) % n, 2.0)
        })
        .collect();
    let offsets = [(1, 2.0), (9, 2.0), (10, 1.0), (2, 0.5)];
    let columns = |d: u32, k: f64| (0..n - d).filter(|i| i % 9 < 7).map(move |i| spring(i, i + d, k));
    let sheet: Vec<_> = offsets.into_iter().flat_map(|(d, k)| columns(d, k)).collect();
    for members in [random, sheet] {
        let m = members.len();
        let mut passes = Elements::<Distance, Linear, 2, 1, 1, 0>::new(x.len(), &members).unwrap();
        let mut pairs = Pairs::<Distance, Linear, 1, 1, 0>::new(x.len(), &members, &vec![1.0; m]).unwrap();
        let same = |a: &[Row], b: &[Row]| a.iter().zip(b).all(|(a, b)| (xyz(*a) - xyz(*b)).norm() < 1e-13);
        let whole = forces(&mut pairs, &x, &v);
        assert!(same(&forces(&mut passes, &x, &v), &whole));
        assert_eq!(passes.energy(&x), pairs.energy(&x));
        let weights = Weights { stiffness: 0.7, damping: 0.2, hessian: Hessian::Exact };
        pairs.linearize(&x, weights);
        passes.linearize(&x, weights);
        assert!(same(&product(&mut passes, &x, &v), &product(&mut pairs, &x, &v)));
        let strain = pairs.link_strain(&x);
        assert_eq!(pairs.largest_strain(&x), strain.iter().copied().fold(f64::MIN, f64::max));
        let beyond = strain.iter().filter(|s| s.abs() > 1.0).count();
        assert!(beyond > 10 && beyond < m - 10, "{beyond}");
        assert_eq!(pairs.break_links(&x), beyond as u64);
        assert_eq!(pairs.break_links(&x), 0);
        assert_eq!(pairs.link_strain(&x).iter().filter(|s| s.is_nan()).count(), beyond);
        assert!(pairs.largest_strain(&x) <= 1.0);
        let kept: Vec<_> = members.iter().zip(&strain).filter(|(_, s)| s.abs() <= 1.0).map(|(m, _)| *m).collect();
        let mut rest = Elements::<Distance, Linear, 2, 1, 1, 0>::new(x.len(), &kept).unwrap();
        assert!(same(&forces(&mut rest, &x, &v), &forces(&mut pairs, &x, &v)));
        pairs.set_broken(&[]);
        assert_eq!(forces(&mut pairs, &x, &v), whole);
    }
}

/// Rows are summed chunk by chunk; where a chunk ends must not matter.
#[test]
fn chunks_of_rows_give_what_all_rows_give() {
    let mut r = Numbers(29);
    let (first, n) = (37_u32, 2 * CHUNK as u32 + 37);
    let x: Vec<Row> = (0..n).map(|_| r.row()).collect();
    let v: Vec<Row> = (0..n).map(|_| r.row()).collect();
    let spring = |a, b| Members { nodes: [a, b], rest: [0.8], law: [], stiffness: 2.0, damping: 0.3 };
    let members: Vec<_> =
        (first..n - 61).flat_map(|i| [spring(i, i + 1), spring(i + 60, i), spring(i, first + (i * 7919) % (n - first))]).collect();
    let mut pairs = Pairs::<Distance, Linear, 1, 1, 0>::new(n as usize, &members, &[]).unwrap();
    let mut passes = Elements::<Distance, Linear, 2, 1, 1, 0>::new(n as usize, &members).unwrap();
    for batch in [&mut pairs as &mut dyn Batch, &mut passes] {
        batch.linearize(&x, Weights { stiffness: 0.7, damping: 0.2, hessian: Hessian::Exact });
        let chunked = |add: &dyn Fn(usize, &mut [Row])| {
            let mut out = vec![ZERO; n as usize];
            out.chunks_mut(CHUNK).enumerate().for_each(|(c, out)| add(c * CHUNK, out));
            out
        };
        let whole = forces(batch, &x, &v);
        assert!(whole[CHUNK - 1] != ZERO && whole[CHUNK] != ZERO && whole[..first as usize].iter().all(|f| *f == ZERO));
        assert_eq!(chunked(&|start, out| batch.add_forces(&x, &v, start, out)), whole);
        let whole = product(batch, &x, &v);
        assert_eq!(chunked(&|start, out| batch.add_product(&v, start, out)), whole);
    }
    // And the two kinds agree, so that the whole is right.
    let (a, b) = (forces(&mut pairs, &x, &v), forces(&mut passes, &x, &v));
    assert!(a.iter().zip(&b).all(|(a, b)| (xyz(*a) - xyz(*b)).norm() < 1e-12));
}

#[test]
fn the_force_of_a_gathered_spring_is_the_derived_one() {
    let mut r = Numbers(31);
    let (k, b, rest) = (3.0, 0.4, [0.7]);
    for _ in 0..20 {
        let (x, v) = ([r.row(), r.row()], [r.vector(), r.vector()]);
        let (d, rate) = (xyz(x[1]) - xyz(x[0]), v[1] - v[0]);
        let same = |pull: Vec3<Real>, [f, _]: [Vec3<Real>; 2]| assert!((pull - f).norm() < 1e-14, "{pull:?} {f:?}");
        for damping in [None, Some(b)] {
            let (lists, line) = (damping.map(|b| (b, v)), damping.map(|b| (b, rate)));
            same(
                Distance::pull::<Linear, Real, 0>(k, [], rest, d, line),
                derived::<Distance, Linear, Real, 2, 1, 1, 0>(k, [], rest, x, lists),
            );
            let law = [0.7, 0.0];
            same(
                Distance::pull::<Nonlinear, Real, 2>(k, law, rest, d, line),
                derived::<Distance, Nonlinear, Real, 2, 1, 1, 2>(k, law, rest, x, lists),
            );
            same(Vector::pull::<Linear, Real, 0>(k, [], [], d, line), derived::<Vector, Linear, Real, 2, 3, 0, 0>(k, [], [], x, lists));
        }
    }
}

/// Triangles without area, and lengths from micrometres to a hundred kilometres.
#[test]
fn hinges_work_at_every_size_and_a_triangle_without_area_bends_nothing() {
    let fold = |size: f64, tip: [f64; 3]| {
        [[0.0, 0.0, 0.0], [0.1, 1.0, 0.0], [-0.8, 0.4, 0.0], tip].map(|p| row(Vec3::from(p) * size, 0.0)).to_vec()
    };
    let member = |rest: f64| [Members { nodes: [0, 1, 2, 3, 1, 2], rest: Bending::fold(rest), law: [], stiffness: 1.5, damping: 0.0 }];
    let reference = batch::<Bending, Linear, 6, 3, 12, 0>(4, &member(0.3)).energy(&fold(1.0, [0.9, 0.6, 0.5]));
    for size in [1e-6, 1e5] {
        let energy = batch::<Bending, Linear, 6, 3, 12, 0>(4, &member(0.3)).energy(&fold(size, [0.9, 0.6, 0.5]));
        assert!((energy / reference - 1.0).abs() < 1e-12, "{size}: {energy} {reference}");
    }
    let mut flat = batch::<Bending, Linear, 6, 3, 12, 0>(4, &member(0.3));
    let x = fold(1.0, [0.05, 0.5, 0.0]);
    assert_eq!(flat.energy(&x), 0.0);
    assert!(forces(flat.as_mut(), &x, &[ZERO; 4]).iter().all(|f| xyz(*f).norm() == 0.0));
}

#[test]
fn a_hinge_turns_through_a_whole_fold() {
    // E = k/2 (2 sin(theta/2))² = k (1 - cos theta), and the moment is its slope k sin(theta), at every angle.
    let k = 1.5;
    let member = [Members { nodes: [0, 1, 2, 3, 1, 2], rest: Bending::fold(0.0), law: [], stiffness: k, damping: 0.0 }];
    let mut hinge = batch::<Bending, Linear, 6, 3, 12, 0>(4, &member);
    for step in 0..=64 {
        let theta = f64::from(step - 32) / 32.0 * std::f64::consts::PI;
        let x = [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [-1.0, 0.7, 0.0], [theta.cos(), 1.1, -theta.sin()]].map(|p| row(p.into(), 0.0));
        let energy = hinge.energy(&x);
        assert!((energy - k * (1.0 - theta.cos())).abs() < 1e-14, "{theta}: {energy}");
        let f = xyz(forces(hinge.as_mut(), &x, &[ZERO; 4])[3]);
        let along = Vec3 { x: -theta.sin(), y: 0.0, z: -theta.cos() };
        assert!((f - along * (-k * theta.sin())).norm() < 1e-13, "{theta}: {f:?}");
        hinge.linearize(&x, Weights { stiffness: 1.0, damping: 0.0, hessian: Hessian::Exact });
        let push = [ZERO, ZERO, ZERO, row(along, 0.0)];
        let stiffness = inner(&product(hinge.as_mut(), &x, &push), &push);
        assert!((stiffness - k * theta.cos()).abs() < 1e-6, "{theta}: {stiffness}");
    }
}

#[test]
fn an_unloaded_tetrahedron_is_at_rest() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.9, 0.1], [0.1, 0.0, 1.1]].map(Vec3::from);
    let (b, volume) = rest_matrix(corners);
    let (mu, lambda) = (3.0, 11.0);
    let mut rest = [1.0 + mu / lambda; 10];
    rest[..9].copy_from_slice(&b);
    let mut shear = Elements::<TetShear, Linear, 4, 9, 9, 0>::new(
        4,
        &[Members { nodes: [0, 1, 2, 3], rest: b, law: [], stiffness: mu * volume, damping: 0.0 }],
    )
    .unwrap();
    let mut inflate = Elements::<TetVolume, Linear, 4, 1, 10, 0>::new(
        4,
        &[Members { nodes: [0, 1, 2, 3], rest, law: [], stiffness: lambda * volume, damping: 0.0 }],
    )
    .unwrap();
    let x: Vec<Row> = corners.iter().map(|c| row(*c, 0.0)).collect();
    let [f, g] = [&mut shear as &mut dyn Batch, &mut inflate].map(|batch| forces(batch, &x, &x));
    assert!(xyz(f[1]).norm() > 0.1);
    assert!(f.iter().zip(&g).all(|(f, g)| (xyz(*f) + xyz(*g)).norm() < 1e-14), "{f:?} {g:?}");
}
