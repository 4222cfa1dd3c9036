//! A pyramid of cubes that stands: the median time of a step, and how far its cubes are from where they began.
//!
//! Usage: rapier-pile THREADS STEP SETTLE STEPS EDGE FRICTION, and the places of cubes on standard input, three numbers a line. [s, m]

use rapier3d::prelude::*;
use std::io::Read;
use std::time::Instant;

fn main() {
    let words: Vec<f32> = std::env::args().skip(1).map(|word| word.parse().expect("a number")).collect();
    let [threads, step, settle, steps, edge, friction] = words[..] else { panic!("expected six numbers") };
    rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build_global().expect("a pool");
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).expect("places");
    let numbers: Vec<f32> = text.split_whitespace().map(|word| word.parse().expect("a number")).collect();

    let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
    let floor = ColliderBuilder::cuboid(100.0, 100.0, 1.0).translation(Vector::new(0.0, 0.0, -1.0)).friction(friction);
    colliders.insert(floor);
    let cube = ColliderBuilder::cuboid(0.5 * edge, 0.5 * edge, 0.5 * edge).density(1000.0).friction(friction).build();
    let handles: Vec<RigidBodyHandle> = numbers
        .chunks_exact(3)
        .map(|x| {
            let body = RigidBodyBuilder::dynamic().translation(Vector::new(x[0], x[1], x[2])).can_sleep(false);
            let handle = bodies.insert(body);
            colliders.insert_with_parent(cube.clone(), handle, &mut bodies);
            handle
        })
        .collect();

    let parameters = IntegrationParameters { dt: step, ..Default::default() };
    let (mut pipeline, mut islands) = (PhysicsPipeline::new(), IslandManager::new());
    let (mut broad, mut narrow) = (DefaultBroadPhase::new(), NarrowPhase::new());
    let (mut joints, mut multibodies) = (ImpulseJointSet::new(), MultibodyJointSet::new());
    let (mut soft, mut ccd) = (SoftBodySet::new(), CCDSolver::new());
    let mut times = Vec::new();
    for k in 0..(settle + steps) as usize {
        let start = Instant::now();
        pipeline.step(
            Vector::new(0.0, 0.0, -9.81), &parameters, &mut islands, &mut broad, &mut narrow, &mut bodies, &mut colliders,
            &mut joints, &mut multibodies, &mut soft, &mut ccd, &(), &(),
        );
        if k >= settle as usize {
            times.push(start.elapsed().as_secs_f64());
        }
    }
    times.sort_by(f64::total_cmp);
    let moved = handles.iter().zip(numbers.chunks_exact(3)).map(|(handle, x)| {
        (bodies[*handle].translation() - Vector::new(x[0], x[1], x[2])).length()
    });
    println!("{} {}", times[times.len() / 2], moved.fold(0.0, f32::max));
}
