//! Figures with bones: skinning, clips, the mannequin, and what touches them. See docs/theory/character.md.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests fail by panicking, too

use crate::common;

use common::{Vector, positions, simulation, step, vector};
use std::collections::HashMap;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use tumble_f64::geometry::Affine;
use tumble_f64::geometry::mannequin::{self, BONES, Dance, Moves};
use tumble_f64::geometry::motion::Pose;
use tumble_f64::geometry::skeleton::{Act, Clock, sample};
use tumble_f64::geometry::{Bvh, Rig};
use tumble_f64::scene::{Assets, Simulation};
use tumble_interface::character::{Between, Bind, Character, Clip, Influence, Joint, Part, Track, Transform};
use tumble_interface::mesh::Defects;
use tumble_interface::{Mesh, Scene};

const DANCES: [Moves; 5] = [Moves::Bind, Moves::Stand, Moves::Walk, Moves::Twirl, Moves::Dance];

/// A rig of a mannequin of its own height.
fn rig(moves: Moves, travel: bool, settle: f64) -> Rig {
    let body = mannequin::body();
    Rig {
        names: BONES.map(String::from).to_vec(),
        vertices: body.mesh.vertices.iter().map(|v| (*v).into()).collect(),
        triangles: body.mesh.triangles.clone(),
        skin: body.skin.clone(),
        binds: body.binds.clone(),
        act: Act::Mannequin(Dance { moves, travel }),
        clock: Clock { start: 0.0, settle, pace: 1.0 },
        scale: 1.0,
        place: Pose::default(),
    }
}

fn track(part: Part, between: Between, times: &[f64], values: &[[f64; 4]]) -> Track {
    Track { joint: 1, part, times: times.to_vec(), values: values.to_vec(), between }
}

/// An upper and a lower arm along z, joined at z = 1, as a closed prism of three rings; the ring at the elbow is carried by both alike.
/// In 1 s the elbow bends by 90 degrees about x.
fn arm() -> Character {
    let ring = |z: f64| [[0.2, 0.0, z], [-0.1, 0.2, z], [-0.1, -0.2, z]];
    let mut triangles = vec![[0, 2, 1], [6, 7, 8]];
    for first in [0, 3] {
        for k in 0..3 {
            let (a, b) = (first + k, first + (k + 1) % 3);
            triangles.extend([[a, b, b + 3], [a, b + 3, a + 3]]);
        }
    }
    let joint = |name: &str, parent, z: f64| {
        let rest = Transform { translation: [0.0, 0.0, z], ..Transform::default() };
        Joint { name: name.into(), parent, rest }
    };
    let bind = |joint, z: f64| Bind { joint, inverse: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, z]] };
    let by = |a: f64| {
        let part = |bind, weight| Influence { bind, weight };
        [part(0, 1.0 - a), part(1, a), part(0, 0.0), part(0, 0.0)]
    };
    let quarter = [[0.0, 0.0, 0.0, 1.0], [FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2]];
    Character {
        mesh: Mesh { vertices: [ring(0.0), ring(1.0), ring(2.0)].concat(), triangles, ..Mesh::default() },
        joints: vec![joint("upper", None, 0.0), joint("lower", Some(0), 1.0)],
        binds: vec![bind(0, 0.0), bind(1, -1.0)],
        skin: [0.0, 0.5, 1.0].into_iter().flat_map(|a| [by(a); 3]).collect(),
        clips: vec![
            Clip { name: "bend".into(), tracks: vec![track(Part::Rotation, Between::Linear, &[0.0, 1.0], &quarter)] },
            Clip { name: "still".into(), tracks: Vec::new() },
        ],
    }
}

fn arm_rig(settle: f64) -> Rig {
    let c = arm();
    Rig {
        names: c.joints.iter().map(|j| j.name.clone()).collect(),
        vertices: c.mesh.vertices.iter().map(|v| (*v).into()).collect(),
        triangles: c.mesh.triangles,
        skin: c.skin,
        binds: c.binds.iter().map(|b| (b.joint, Affine::from_rows(b.inverse))).collect(),
        act: Act::Clip { joints: c.joints, clip: c.clips[0].clone(), period: None },
        clock: Clock { start: 0.0, settle, pace: 1.0 },
        scale: 2.0,
        place: Pose { shift: vector(10.0, 0.0, 0.0), ..Pose::default() },
    }
}

/// By hand: y -> z, z -> -y at the elbow; a vertex that both carry is the mean of what each makes of it. All twice as large, 10 m along x.
#[test]
fn a_bent_arm_has_the_vertices_of_hand_computation() {
    let rig = arm_rig(0.0);
    let at = |p: [f64; 3]| vector(10.0 + 2.0 * p[0], 2.0 * p[1], 2.0 * p[2]);
    let x = rig.skin_at(1.0);
    for (i, p) in [
        (1, [-0.1, 0.2, 0.0]),
        // (-0.1, 0.2, 1) by the upper arm, (-0.1, 0, 1.2) by the lower one.
        (4, [-0.1, 0.1, 1.1]),
        (6, [0.2, -1.0, 1.0]),
        (7, [-0.1, -1.0, 1.2]),
    ] {
        assert!((x[i] - at(p)).norm() < 1e-14, "{i}: {:?}", x[i]);
    }
    let start = rig.skin_at(0.0);
    assert!(start.iter().zip(arm().mesh.vertices).all(|(x, p)| (*x - at(p)).norm() < 1e-14));
    // Half-way: 45 degrees, at a constant rate; a bone turns but does not bend.
    let (pose, twist) = rig.moving(1, 0.5).unwrap();
    assert!((pose.out(Vector::default()) - at([0.0, 0.0, 1.0])).norm() < 1e-14);
    assert!((pose.turn.turn(vector(0.0, 1.0, 0.0)) - vector(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2)).norm() < 1e-14);
    assert!((twist.angular - vector(PI / 2.0, 0.0, 0.0)).norm() < 1e-8, "{:?}", twist.angular);
    assert!((twist.at(pose.shift)).norm() < 1e-8);
    assert_eq!((rig.bone("lower"), rig.bone("Lower")), (Some(1), None));
}

/// The way into a movement: with u = t/settle the pose is the resting one with a share s of the clip at tau.          (character.2)
#[test]
fn a_movement_begins_and_goes_on_without_a_jump() {
    let clock = Clock { start: 0.5, settle: 2.0, pace: 3.0 };
    assert_eq!(clock.at(0.2), (0.0, 0.0));
    assert_eq!(clock.at(1.5), (0.5, 3.0 * 2.0 * 0.0625 * 1.25));
    assert_eq!(clock.at(4.5), (1.0, 3.0 * 3.0));
    let h = 1e-5;
    for t in [0.5, 1.0, 1.7, 2.5, 3.0] {
        // The rate of tau is pace times the share.
        let rate = (clock.at(t + h).1 - clock.at(t - h).1) / (2.0 * h);
        assert!((rate - 3.0 * clock.at(t).0).abs() < 1e-4, "{t}: {rate}");
    }
}

/// Values by hand.                                                                                             (character.4)
#[test]
fn tracks_step_go_straight_and_curve() {
    let value = |t: &Track, at: f64| sample(t, at).unwrap();
    let two = [[1.0, 2.0, 3.0, 0.0], [3.0, 2.0, 7.0, 0.0]];
    let step = track(Part::Translation, Between::Step, &[1.0, 3.0], &two);
    let straight = track(Part::Translation, Between::Linear, &[1.0, 3.0], &two);
    for (at, by_step, by_line) in [(0.0, two[0], two[0]), (2.5, two[0], [2.5, 2.0, 6.0, 0.0]), (3.0, two[1], two[1]), (9.0, two[1], two[1])]
    {
        assert_eq!((value(&step, at), value(&straight, at)), (by_step, by_line));
    }
    // From 1 with rate 2 to 3 with rate -1, 2 s apart: at s = 1/4 (54 + 2 x 9 x 2 + 10 x 3 + 2 x (-3) x (-1))/64.
    let four = |x: f64| [x, 0.0, 0.0, 0.0];
    let curved = track(Part::Scale, Between::Cubic, &[1.0, 3.0], &[four(7.0), four(1.0), four(2.0), four(-1.0), four(3.0), four(9.0)]);
    assert!((value(&curved, 1.5)[0] - (54.0 + 36.0 + 30.0 + 6.0) / 64.0).abs() < 1e-15);
    assert_eq!((value(&curved, 0.0)[0], value(&curved, 5.0)[0]), (1.0, 3.0));
    // A turn goes the shorter way at a constant rate: a third of 90 degrees, though the second key has the other sign.
    let other = [-FRAC_1_SQRT_2, 0.0, 0.0, -FRAC_1_SQRT_2];
    let turn = track(Part::Rotation, Between::Linear, &[0.0, 3.0], &[[0.0, 0.0, 0.0, 1.0], other]);
    let q = value(&turn, 1.0);
    assert!((q[0] - (PI / 12.0).sin()).abs() < 1e-15 && (q[3] - (PI / 12.0).cos()).abs() < 1e-15, "{q:?}");
}

#[test]
fn the_mannequin_is_closed_symmetric_and_as_tall_as_it_says() {
    let mesh = &mannequin::body().mesh;
    assert_eq!(mesh.defects(), Defects::default());
    let vertex = |i: u32| Vector::from(mesh.vertices[i as usize]);
    let corners = |t: &[u32; 3]| t.map(vertex);
    let volume: f64 = mesh.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    println!("{} triangles, {volume:.4} m³", mesh.triangles.len());
    // A slender person of 1.7 m: 50 to 65 kg at the density of water.
    assert!((0.045..0.070).contains(&volume));
    // One body without holes: V - E + F = 2.
    let (v, e, f) = (mesh.vertices.len() as i64, mesh.edges().len() as i64, mesh.triangles.len() as i64);
    assert_eq!(v - e + f, 2);
    let (low, high) = mesh.bounds().unwrap();
    assert!(low[2].abs() < 0.002 && (high[2] - 1.7).abs() < 0.02, "{low:?} {high:?}");
    // Every vertex has its mirror image.
    let mut keys: HashMap<[i64; 3], usize> = HashMap::new();
    let key = |x: [f64; 3]| x.map(|x| (x * 1e9).round() as i64);
    for (i, x) in mesh.vertices.iter().enumerate() {
        keys.insert(key(*x), i);
    }
    let near = |x: [f64; 3]| {
        let k = key(x);
        (0..27).find_map(|n| keys.get(&[k[0] + n % 3 - 1, k[1] + n / 3 % 3 - 1, k[2] + n / 9 - 1]))
    };
    assert!(mesh.vertices.iter().all(|x| near([-x[0], x[1], x[2]]).is_some()));
    // Nothing is inside out: just outside and inside of the middle of each triangle the distance has the right sign.
    let tree = Bvh::new(mesh).unwrap();
    for t in &mesh.triangles {
        let [a, b, c] = corners(t);
        let (middle, n) = ((a + b + c) * (1.0 / 3.0), (b - a).cross(c - a).normalized());
        assert!(tree.signed_distance(middle + n * 1e-4) > 0.0 && tree.signed_distance(middle - n * 1e-4) < 0.0, "{middle:?}");
    }
    let body = mannequin::body();
    assert_eq!(body.skin.len(), mesh.vertices.len());
    assert!(body.skin.iter().all(|s| (s.iter().map(|p| p.weight).sum::<f64>() - 1.0).abs() < 1e-12));
    // Dressed as it was bound, at any share of nothing.
    let start = rig(Moves::Dance, false, 1.0).skin_at(0.0);
    assert!(start.iter().zip(&mesh.vertices).all(|(x, p)| (*x - Vector::from(*p)).norm() < 1e-12));
}

/// At 1 kHz no joint jumps, its velocity changes by less than 0.15 m/s (150 m/s²; measured: 0.074 in the walk), bones keep their lengths,
/// feet stay above the floor by less than a centimetre of skin, and all comes again after a period.
#[test]
fn movements_are_smooth_rigid_and_come_again() {
    let h = 1e-3;
    for moves in DANCES {
        let rig = rig(moves, false, 0.7);
        let joints = |t: f64| -> Vec<Vector> { (0..BONES.len()).map(|b| rig.pose(b, t).unwrap().shift).collect() };
        let period = rig.period().map_or(1.0, |(period, _)| period);
        let n = ((0.7 + 2.0 * period) / h) as usize;
        let mut last: Option<(Vec<Vector>, Vec<Vector>)> = None;
        let (mut jump, mut fastest, mut lowest) = (0.0_f64, 0.0_f64, 0.0_f64);
        let length = |x: &[Vector], a: usize, b: usize| (x[a] - x[b]).norm();
        let start = joints(0.0);
        for k in 0..n {
            let x = joints(k as f64 * h);
            for (a, b) in (1..BONES.len()).map(|b| (mannequin::parent(b), b)) {
                assert!((length(&x, a, b) - length(&start, a, b)).abs() < 1e-12, "{} at {}", BONES[b], k as f64 * h);
            }
            let v: Vec<Vector> = match &last {
                Some((before, _)) => x.iter().zip(before).map(|(x, b)| (*x - *b) * (1.0 / h)).collect(),
                None => vec![Vector::default(); x.len()],
            };
            if let Some((_, old)) = &last {
                jump = v.iter().zip(old).map(|(a, b)| (*a - *b).norm()).fold(jump, f64::max);
            }
            fastest = v.iter().map(|v| v.norm()).fold(fastest, f64::max);
            if k % 50 == 0 {
                lowest = rig.skin_at(k as f64 * h).iter().map(|p| p.z).fold(lowest, f64::min);
            }
            last = Some((x, v));
        }
        println!("{moves:?}: fastest joint {fastest:.2} m/s, jump {jump:.4} m/s in 1 ms, lowest point {lowest:.4} m");
        assert!(jump < 0.15 && fastest < 6.0 && lowest > -0.015, "{moves:?}");
        assert!((moves == Moves::Bind) == (fastest == 0.0));
        let (a, b) = (rig.skin_at(1.0), rig.skin_at(1.0 + period));
        assert!(a.iter().zip(&b).all(|(a, b)| (*a - *b).norm() < 1e-11), "{moves:?}");
    }
}

/// A foot that stands does not slide: with `travel`, as on the spot against a floor that moves.
#[test]
fn a_walk_does_not_slide_on_its_feet() {
    let rig = rig(Moves::Walk, true, 0.0);
    let ball = |t: f64| rig.pose(rig.bone("toes_l").unwrap(), t).unwrap().shift;
    let (period, gone) = rig.period().unwrap();
    assert!(gone.y < -0.9 && gone.x == 0.0 && gone.z == 0.0);
    // Flat from 0.11 to 0.36 of the pace.
    let (a, b) = (ball(3.0 * period + 0.12 * period), ball(3.0 * period + 0.34 * period));
    assert!((a - b).norm() < 0.003, "{:?}", a - b);
    assert!((ball(0.5 + period) - ball(0.5) - gone).norm() < 1e-12);
}

/// Keyframes are the skin at their times, and between them no farther from it than h²/8 times the largest acceleration.   (character.3)
#[test]
fn keyframes_follow_the_skin_also_after_many_periods() {
    for (moves, travel) in [(Moves::Walk, true), (Moves::Dance, false)] {
        let rig = rig(moves, travel, 1.0);
        let facets = rig.facets(60.0, 40.0).unwrap();
        let (period, _) = rig.period().unwrap();
        let mut worst = 0.0_f64;
        for t in [0.0, 0.35, 1.0, 1.0 + 0.613 * period, 1.0 + 2.999 * period, 17.777] {
            let (baked, exact) = (facets.vertices(t), rig.skin_at(t));
            worst = baked.iter().zip(&exact).map(|(a, b)| (Vector::from(*a) - *b).norm()).fold(worst, f64::max);
        }
        println!("{moves:?}: keyframes at most {:.3} mm off", worst * 1e3);
        // 150 m/s² would be 5.2 mm; hands and toes have at most a third of that.
        assert!(worst < 2e-3 && worst > 1e-6, "{worst}");
        // Velocities of the surface are those of its points, and nothing is farther than it is after a period.
        let (t, h) = (1.0 + 1.37 * period, 1e-6);
        let (now, then) = (facets.vertices(t - h), facets.vertices(t + h));
        for (i, x) in facets.vertices(t).into_iter().enumerate().step_by(97) {
            let found = facets.nearest(x.into(), t, 1.0).unwrap();
            let v = (Vector::from(then[i]) - Vector::from(now[i])) * (0.5 / h);
            assert!(found.distance < 1e-12 && (found.velocity - v).norm() < 1e-6, "{found:?} {v:?}");
        }
    }
}

#[test]
fn a_point_by_the_tree_is_that_of_all_triangles() {
    let rig = rig(Moves::Walk, true, 0.5);
    let facets = rig.facets(30.0, 20.0).unwrap();
    let t = 9.3;
    let mesh = Mesh { vertices: facets.vertices(t), triangles: facets.triangles().to_vec(), ..Mesh::default() };
    let tree = Bvh::new(&mesh).unwrap();
    let middle = Vector::from(mesh.vertices[0]);
    for k in 0..200 {
        let part = |a: f64| (f64::from(k) * a).fract() - 0.5;
        let p = middle + vector(1.5 * part(0.819), 1.0 * part(0.671), 2.0 * part(0.5497));
        let (a, b) = (facets.nearest(p, t, 10.0).unwrap(), tree.closest(p, 10.0).unwrap());
        assert!((a.distance - b.distance_sq.sqrt()).abs() < 1e-12, "{p:?}");
        assert!(((p - a.point).dot(a.normal) < 0.0) == ((p - b.point).dot(b.normal) < 0.0));
    }
}

/// Nothing passes the keyframe at which a period ends.
#[test]
fn a_sweep_over_the_end_of_a_period_meets_what_two_halves_meet() {
    let rig = rig(Moves::Walk, true, 0.5);
    let facets = rig.facets(30.0, 20.0).unwrap();
    let (period, gone) = rig.period().unwrap();
    let end = 0.5 + 3.0 * period;
    let chest = rig.pose(rig.bone("chest").unwrap(), end).unwrap().shift;
    let (from, to) = (chest + vector(0.02, -1.0, 0.0), chest + vector(0.02, 1.0, 0.0));
    let slack = 1e-9;
    let sides = tumble_f64::geometry::facets::Sides::In;
    let whole = facets.passage(from, to, (end - 0.05, end + 0.05), sides, slack).unwrap();
    // The same a period earlier.
    let before = facets.passage(from - gone, to - gone, (end - period - 0.05, end - period + 0.05), sides, slack).unwrap();
    assert!((whole.s - before.s).abs() < 1e-9 && (whole.normal - before.normal).norm() < 1e-6);
    assert!(whole.s > 0.3 && whole.s < 0.6, "{whole:?}");
}

/// A ball laid on the shoulders of a mannequin that walks goes along with it.
#[test]
fn what_lies_on_a_walking_mannequin_goes_along() {
    let mut sim = simulation(
        "time.fps = 60\ntime.frames = 120\n[[system]]\nintegrator = \"symplectic_euler\"\nsubsteps = 20\n\
         [[particles]]\nname = \"p\"\nposition = [[0.06, 0.03, 1.45]]\nmass = [0.1]\n\
         [[collider]]\nname = \"m\"\nthickness = 0.01\nfriction = 4.0\n\
         shape.mannequin = { motion = \"walk\", travel = true }",
    );
    (0..120).for_each(|_| drop(step(&mut sim)));
    let x = positions(&sim, "p")[0];
    let rig = rig(Moves::Walk, true, 1.0);
    let neck = rig.pose(rig.bone("neck").unwrap(), 2.0).unwrap().shift;
    println!("after 2 s {x:?}, neck at {neck:?}");
    // The walk has gone 1.5 m of time at 1 m/s.
    assert!(neck.y < -1.3);
    assert!((x - neck).norm() < 0.25, "{:?}", x - neck);
}

fn scene(toml: &str) -> Result<Simulation, String> {
    let scene = Scene::from_toml(&format!("version = 1\n[[particles]]\nname = \"p\"\nposition = [[9, 9, 9]]\nmass = [1]\n{toml}"));
    let assets = Assets::new(HashMap::new(), HashMap::from([("arm.glb".to_string(), arm())]));
    Simulation::new(scene.map_err(|e| e.to_string())?, assets).map_err(|e| e.to_string())
}

#[test]
fn a_scene_with_a_character_says_what_is_wrong_with_it() {
    let with = |words: &str| scene(&format!("[[collider]]\nname = \"c\"\nshape.character = {{ path = \"arm.glb\", {words} }}"));
    let wrong = |words: &str| with(words).err().unwrap();
    let found = wrong("clip = \"bent\"");
    assert!(found.contains("collider \"c\".shape.character.clip") && found.contains("\"bend\"") && found.contains("clips: bend, still"));
    assert!(wrong("rate = 0").contains("rate") && wrong("settle = -1").contains("settle"));
    with("").unwrap();
    with("clip = \"still\", repeat = false, settle = 0").unwrap();
    // Its sheath moves: the ring of the hand goes from z = 2 to y = -1.
    let mut sim = with("clip = \"bend\", repeat = false, settle = 0, rotate = [0, 0, 0]").unwrap();
    (0..24).for_each(|_| drop(step(&mut sim)));
    let hand = positions(&sim, "c");
    assert!(hand.iter().any(|x| (*x - vector(0.2, -1.0, 1.0)).norm() < 1e-9), "{hand:?}");
}

/// Scenes name bones, so both places where a reader looks for their names have all of them.
#[test]
fn every_bone_of_the_mannequin_is_documented() {
    let texts = [include_str!("../../../docs/theory/character.md"), include_str!("../../../docs/scene.md")];
    for bone in BONES {
        let left = bone.strip_suffix("_r").map_or(bone.into(), |limb| format!("{limb}_l"));
        let is_word = |text: &str| text.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == left);
        assert!(texts.into_iter().all(is_word), "{bone}");
    }
}
