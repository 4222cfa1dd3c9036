//! Links between floors: two lines on a plan that are one place, where a flight of stairs that is begun on one floor goes on at another.
//!
//! The plane is cut along both lines and joined crosswise: whoever crosses one goes on beyond the other, and sees who is there.

use super::line::{Line, Point, along, cross, dot, length, middle, sub};

/// The way through a link from one of its lines to the other: the motion that lays the first on the second, end on end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// The line that is crossed.
    pub from: Line,
    /// The line beyond which the way goes on.
    pub to: Line,
    /// Cosine and sine of the turn.
    turn: Point,
}

/// How far beyond a line people are at least [m].
const ROUNDING: f64 = 1e-9;

/// Whether a place is to the left of a line, or on it.
pub fn is_left([a, b]: Line, x: Point) -> bool {
    cross(sub(b, a), sub(x, a)) >= 0.0
}

impl Passage {
    /// Both ways through a link.
    pub fn both([a, b]: [Line; 2]) -> [Self; 2] {
        let [d, e] = [a, b].map(|line| sub(line[1], line[0]));
        // Exactly no turn between lines that are alike.
        let turn = [dot(d, e), cross(d, e)];
        let size = length(turn);
        let turn = if size > 0.0 { turn.map(|c| c / size) } else { [1.0, 0.0] };
        [Self { from: a, to: b, turn }, Self { from: b, to: a, turn: [turn[0], -turn[1]] }]
    }

    /// Angle of the turn, to the left [rad].
    pub fn angle(&self) -> f64 {
        crate::math::functions::atan2(self.turn[1], self.turn[0])
    }

    /// The middle of the line that is crossed.
    pub fn middle(&self) -> Point {
        middle(self.from)
    }

    /// Places so far to the left and to the right of it [m].
    pub fn sides(&self, far: f64) -> [Point; 2] {
        let d = sub(self.from[1], self.from[0]);
        [far, -far].map(|far| along(self.middle(), far / length(d), [-d[1], d[0]]))
    }

    /// A direction beyond it.
    pub fn direction(&self, v: Point) -> Point {
        [self.turn[0] * v[0] - self.turn[1] * v[1], self.turn[1] * v[0] + self.turn[0] * v[1]]
    }

    /// A place beyond it.
    pub fn place(&self, x: Point) -> Point {
        along(middle(self.to), 1.0, self.direction(sub(x, middle(self.from))))
    }

    /// Where somebody is who has gone from x to y and crossed: beyond the other line, however its place is rounded.
    pub fn arrival(&self, x: Point, y: Point) -> Point {
        let d = sub(self.to[1], self.to[0]);
        let away = if is_left(self.from, x) { -ROUNDING } else { ROUNDING } / length(d);
        along(self.place(y), away, [-d[1], d[0]])
    }

    /// The place of which x is the one beyond it.
    pub fn before(&self, x: Point) -> Point {
        let r = sub(x, middle(self.to));
        along(middle(self.from), 1.0, [self.turn[0] * r[0] + self.turn[1] * r[1], self.turn[0] * r[1] - self.turn[1] * r[0]])
    }
}

#[cfg(test)]
mod tests {
    use super::super::{AnticipationVelocity, CollisionFreeSpeed, Floor, Gate, Goal, Model, Person, Plan, journeys, walk::Walk};
    use super::*;

    fn exit(name: &str, line: Line) -> Gate {
        Gate { name: name.into(), line, exit: true, hours: [None; 2] }
    }

    /// People in a corridor 12 m x 3 m who walk to the exit at its other end, after some steps: places, and who has left. Its far half is drawn
    /// elsewhere, by a motion, if there is one.
    fn corridor(model: Model, moved: Option<fn(Point) -> Point>, people: &[(Point, usize)], steps: usize) -> Vec<(u32, Point)> {
        let far = |x: Point| moved.map_or(x, |moved| moved(x));
        let cut = [[6.0, 0.0], [6.0, 3.0]];
        let halves = [[[0.0, 0.0], [6.0, 0.0]], [[0.0, 3.0], [6.0, 3.0]]];
        let mut walls: Vec<Line> = halves.into_iter().chain(halves.map(|line| line.map(|[x, y]| far([x + 6.0, y])))).collect();
        // What lies beyond the cut in the drawing is another room.
        walls.extend(moved.map(|_| [[6.4, -1.0], [6.4, 4.0]]));
        let gates = vec![exit("left", [[0.0, 0.0], [0.0, 3.0]]), exit("right", [[12.0, 0.0], [12.0, 3.0]].map(far))];
        let links: Vec<[Line; 2]> = moved.into_iter().map(|moved| [cut, cut.map(moved)]).collect();
        let (legs, targets) = journeys([0, 1].map(|exit| (vec![Goal::Exits(vec![exit])], false)).to_vec());
        let floor = Floor::new(Plan::new(walls, gates, 3.0).with_links(&links), targets, 0.1, 0.22);
        let person = |(id, (x, way)): (usize, &(Point, usize))| {
            let stands = id >= people.len();
            let x = if x[0] > 6.0 && !stands { far(*x) } else { *x };
            let (_, phi) = legs[*way][0].shortest(&floor, x);
            let down = floor.way(*way as u32).direction(x).0;
            Person {
                x,
                v: [0.0; 2],
                heading: crate::math::functions::atan2(down[1], down[0]),
                phi,
                radius: 0.2,
                speed: 1.2,
                free: 1.2,
                starts: if stands { f64::INFINITY } else { 0.0 },
                out: None,
                started: !stands,
                slide: [0.0; 2],
                up: 0.0,
                lies: false,
                id: id as u32,
                crowd: *way as u32,
                leg: 0,
                way: *way as u32,
            }
        };
        let room = [0.7, 1.5, 2.3].map(|y| ([7.0, y], 0));
        let everybody = people.iter().chain(if moved.is_some() { &room[..] } else { &[] }).enumerate().map(person).collect();
        let mut walk = Walk::new(floor, (model, None, None), legs, everybody, Vec::new());
        (0..steps).for_each(|k| walk.step(0.05 * k as f64, 0.05));
        walk.people.iter().filter(|p| p.starts < 1.0).map(|p| (p.id, p.x)).collect()
    }

    /// Two streams that meet at the cut, and one that goes across it, walk as on a floor in one piece: all see each other across it, and have the
    /// same ways. Who stands beyond the cut in the drawing is seen by nobody.
    #[test]
    fn a_floor_that_is_drawn_in_two_pieces_is_walked_like_one() {
        // Nobody is as far from two others, of whom the order would choose one.
        let aside = |i: i32| [0.11 * f64::from(i * i % 5), 0.07 * f64::from(3 * i % 4)];
        let places =
            |low: f64, y: f64| (0..6).map(move |i| along([low + 1.4 * f64::from(i / 3), y + 0.8 * f64::from(i % 3)], 1.0, aside(i)));
        let meeting: Vec<(Point, usize)> = places(0.7, 0.6).map(|x| (x, 1)).chain(places(9.9, 0.67).map(|x| (x, 0))).collect();
        let following: Vec<(Point, usize)> = places(2.7, 0.6).chain(places(5.0, 0.3)).map(|x| (x, 1)).collect();
        let shifted: fn(Point) -> Point = |[x, y]| [x + 20.0, y];
        let turned: fn(Point) -> Point = |[x, y]| [30.0 - y, x + 4.0];
        // Where bodies touch, their order counts, and it is that of the drawing.
        let speed = Model::CollisionFreeSpeed(CollisionFreeSpeed { time_gap: 0.65, buffer: 0.04 });
        // It heeds where others go.
        let ahead = Model::AnticipationVelocity(AnticipationVelocity { time_gap: 0.5, buffer: 0.04 });
        for (model, people, steps, across) in [(speed, &meeting, 50, 0), (speed, &following, 25, 3), (ahead, &meeting, 50, 0)] {
            let whole = corridor(model, None, people, steps);
            let crossed = whole.iter().filter(|(id, [x, _])| (*x > 6.0) != (people[*id as usize].0[0] > 6.0)).count();
            assert!(crossed >= across && whole.len() == people.len(), "{crossed}");
            assert!(whole.iter().any(|(id, [_, y])| (y - people[*id as usize].0[1]).abs() > 0.05));
            for moved in [shifted, turned] {
                let parted = corridor(model, Some(moved), people, steps);
                assert_eq!(parted.len(), whole.len());
                for ((_, x), (_, y)) in parted.into_iter().zip(&whole) {
                    let y = if y[0] > 6.0 { moved(*y) } else { *y };
                    assert!(length(sub(x, y)) < 1e-6, "{x:?} {y:?}");
                }
            }
        }
    }

    /// A quarter turn: the end of one line lies on the end of the other, what is beyond one beyond the other, and back again.
    #[test]
    fn a_passage_lays_a_line_on_the_other() {
        let lines = [[[1.0, 2.0], [3.0, 2.0]], [[10.0, 5.0], [10.0, 7.0]]];
        let [there, back] = Passage::both(lines);
        for k in 0..2 {
            assert!(length(sub(there.place(lines[0][k]), lines[1][k])) < 1e-15);
        }
        assert!(length(sub(there.place([2.0, 2.5]), [9.5, 6.0])) < 1e-15);
        assert!(length(sub(there.direction([0.0, 1.0]), [-1.0, 0.0])) < 1e-15);
        assert!((there.angle() - 0.5 * std::f64::consts::PI).abs() < 1e-15);
        assert!(length(sub(back.place(there.place([2.3, 1.1])), [2.3, 1.1])) < 1e-15);
        let [along_x, _] = Passage::both([[[0.25, 0.5], [0.5, 0.75]], [[5.25, 0.5], [5.5, 0.75]]]);
        assert_eq!(along_x.direction([0.3, 0.1]), [0.3, 0.1]);
    }
}
