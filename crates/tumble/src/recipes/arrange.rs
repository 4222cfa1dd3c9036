//! Where the bodies of an object stand.

use crate::geometry::Vector;
use crate::math::rotation::{by, from_degrees};
use crate::math::{Quat, Random};
use crate::systems::rigid::{Hull, any_turn};
use std::collections::BTreeMap;
use tumble_interface::scene::{Arrange, Body as Words, BodyShape};

/// Places that are tried for a body that is strewn.
const TRIES: u32 = 2000;

// Purposes of random numbers.
const PLACE: u32 = 0;
const TURN: u32 = 1;

/// What is wrong with which key.
pub type Wrong = (String, String);

/// Where a body starts.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Its centre of mass [m].
    pub x: Vector,
    /// Turn of the axes of its words.
    pub turn: Quat<f64>,
}

/// That of body i in a list of none, one, or one each.
pub fn each(list: &[[f64; 3]], i: usize) -> [f64; 3] {
    list.get(i).or(list.first()).copied().unwrap_or_default()
}

/// Where bodies of this width and height [m] stand; `center` is their centre of mass [m] and `axes` their own axes, both in those of the words.
pub fn places(
    words: &Words,
    seed: u32,
    [width, height]: [f64; 2],
    center: Vector,
    axes: Quat<f64>,
    hull: &Hull,
) -> Result<Vec<Place>, Wrong> {
    let turn = |i: usize| from_degrees(each(&words.rotate, i));
    let Some(arrange) = &words.arrange else {
        return Ok(words.position.iter().enumerate().map(|(i, x)| Place { x: Vector::from(*x), turn: turn(i) }).collect());
    };
    let &[first] = &words.position[..] else {
        return Err((".arrange".into(), format!("given with {} positions; give that of the first body alone", words.position.len())));
    };
    let first = Vector::from(first);
    let along = |count: u32, step: Vector| (0..count).map(move |i| first + step * f64::from(i));
    let stand = |places: Vec<Vector>| places.into_iter().enumerate().map(|(i, x)| Place { x, turn: turn(i) }).collect();
    Ok(match arrange {
        Arrange::Row { count, step } => stand(along(*count, Vector::from(*step)).collect()),
        Arrange::Stack { count } => stand(along(*count, Vector { x: 0.0, y: 0.0, z: height }).collect()),
        Arrange::Wall { columns, rows } => {
            let brick = |row: u32, column: u32| {
                let shift = f64::from(column) + 0.5 * f64::from(row % 2);
                first + Vector { x: shift * width, y: 0.0, z: f64::from(row) * height }
            };
            stand((0..*rows).flat_map(|row| (0..*columns).map(move |column| brick(row, column))).collect())
        }
        Arrange::Chain { count, step, twist } => {
            let axis = Vector::from(*step).normalized();
            let places = along(*count, Vector::from(*step)).enumerate();
            places.map(|(i, x)| Place { x, turn: by(axis * (twist.to_radians() * i as f64)) * turn(i) }).collect()
        }
        Arrange::Arch {} => {
            let BodyShape::Voussoir { stones, span, .. } = words.shape else {
                return Err((".arrange.arch".into(), "given with another shape; expected shape.voussoir, a stone of an arch".into()));
            };
            if words.rotate.len() > 1 {
                let message = format!("{} with arrange.arch, expected none or one, of the arch as a whole", words.rotate.len());
                return Err((".rotate".into(), message));
            }
            let stone = |i: u32| {
                let angle = span.to_radians() * ((f64::from(i) + 0.5) / f64::from(stones) - 0.5);
                let turn = turn(0) * by(Vector { x: 0.0, y: angle, z: 0.0 });
                Place { x: first + turn.turn(center), turn }
            };
            (0..stones).map(stone).collect()
        }
        Arrange::Scatter { count, size } => return scattered(words, seed, *count, [first, Vector::from(*size)], axes, hull),
    })
}

/// Places in a box, its centre and its edges [m], one after the other: the first of random ones where a body touches none before.
fn scattered(words: &Words, seed: u32, count: u32, [center, size]: [Vector; 2], axes: Quat<f64>, hull: &Hull) -> Result<Vec<Place>, Wrong> {
    let random = Random::new(seed, &words.name);
    // Those that may touch are in neighbouring cells; beyond what an index can say all are in one.
    let cell = |x: Vector| <[f64; 3]>::from(x - center).map(|p| (p / (2.0 * hull.reach)).floor().clamp(-1e15, 1e15) as i64);
    let mut cells: BTreeMap<[i64; 3], Vec<Place>> = BTreeMap::new();
    let mut places = Vec::new();
    for i in 0..count {
        let tried = |attempt: u32| {
            let id = u64::from(i);
            let turn = match words.rotate[..] {
                [] => any_turn(random.uniform(id, attempt, TURN)),
                _ => from_degrees(each(&words.rotate, i as usize)),
            };
            let [low, high] = hull.bounds(turn * axes).map(<[f64; 3]>::from);
            let (u, half) = (random.uniform(id, attempt, PLACE), <[f64; 3]>::from(size * 0.5));
            let room: [f64; 3] = std::array::from_fn(|a| 2.0 * half[a] - (high[a] - low[a]));
            let x = center + Vector::from(std::array::from_fn::<f64, 3, _>(|a| u[a] * room[a] - half[a] - low[a]));
            let own = Place { x, turn };
            let at = cell(x);
            let mut near = (0..27).filter_map(|k| cells.get(&[at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1])).flatten();
            let fits = room.iter().all(|room| *room >= 0.0);
            let mut free = || !near.any(|other| hull.meets((x, turn * axes), (other.x, other.turn * axes)));
            (fits && free()).then_some(own)
        };
        let Some(place) = (0..TRIES).find_map(tried) else {
            let message =
                format!("{count}, but only {i} have found a place in {:?} m; enlarge size, or lower count", <[f64; 3]>::from(size));
            return Err((".arrange.scatter.count".into(), message));
        };
        cells.entry(cell(place.x)).or_default().push(place);
        places.push(place);
    }
    Ok(places)
}
