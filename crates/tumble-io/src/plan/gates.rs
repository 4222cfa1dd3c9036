//! Lines from jamb to jamb, of what draws doors: lines, thin outlines, and symbols of a leaf and the arc that it swings along.

use super::{Gate, Kind, Point, Shape, cross, distance, dot, off, sub};

/// Angles that leaves swing through [rad], between 40 and 200 degrees.
const SWINGS: [f64; 2] = [0.7, 3.5];
/// What counts as the same place, in parts of a width.
const SAME: f64 = 0.1;
/// Depth over width of an outline that is a door, at most.
const THIN: f64 = 0.8;

type Line = [Point; 2];

/// Gates of shapes of a kind; what is none becomes a fault.
pub fn gates(shapes: &[&Shape], kind: Kind, walls: &[Vec<Point>], faults: &mut Vec<String>) -> Vec<Gate> {
    let mut found: Vec<Gate> = Vec::new();
    let mut k = 0;
    while k < shapes.len() {
        let block = shapes[k].block;
        let n = if block == 0 { 1 } else { shapes[k..].iter().take_while(|shape| shape.block == block).count() };
        let own = &shapes[k..k + n];
        k += n;
        // Leaves may be loose lines beside loose arcs.
        let near = if block == 0 { shapes } else { own };
        let swings: Vec<Line> = own.iter().filter_map(|shape| swing(shape, near, walls)).collect();
        if !swings.is_empty() {
            found.extend(swings.into_iter().map(|line| Gate { name: own[0].name.clone(), line }));
        } else if block == 0 && near.iter().any(|arc| is_leaf(own[0], arc)) {
            // Its arc is a gate already.
        } else if let Some(line) = thin(own) {
            found.push(Gate { name: own[0].name.clone(), line });
        } else {
            let points: usize = own.iter().map(|shape| shape.points.len()).sum();
            faults.push(format!(
                "{}: a {} of {points} points, expected a line from jamb to jamb, a thin outline, or a leaf with its arc",
                own[0].place,
                kind.name()
            ));
        }
    }
    merged(found)
}

/// The gate of a leaf's arc: from its hinge to the end where the leaf is when it is shut.
fn swing(shape: &Shape, near: &[&Shape], walls: &[Vec<Point>]) -> Option<Line> {
    let [centre, a, b] = shape.arc.filter(|ends| is_swing(*ends, shape.points.len()))?;
    let radius = distance(centre, a);
    let open = |end: Point| {
        let side = |line: &[Point]| {
            let along = |from: Point, to: Point| distance(from, centre) < SAME * radius && distance(to, end) < SAME * radius;
            along(line[0], line[1]) || along(line[1], line[0])
        };
        near.iter().filter(|other| other.arc.is_none()).any(|other| other.points.windows(2).any(side))
    };
    let clear = |end: Point| walls.iter().flat_map(|wall| wall.windows(2)).map(|w| off([w[0], w[1]], end)).fold(f64::INFINITY, f64::min);
    let shut = match (open(a), open(b)) {
        (true, false) => b,
        (false, true) => a,
        _ if clear(b) < clear(a) => b,
        _ => a,
    };
    Some([centre, shut])
}

/// Whether an arc is one that a leaf swings along.
fn is_swing([centre, a, b]: [Point; 3], points: usize) -> bool {
    let (u, v) = (sub(a, centre), sub(b, centre));
    let turn = libm::atan2(cross(u, v), dot(u, v)).abs();
    points > 2 && (SWINGS[0]..=SWINGS[1]).contains(&turn)
}

/// Whether a line is the leaf of an arc.
fn is_leaf(line: &Shape, arc: &Shape) -> bool {
    let Some([centre, a, b]) = arc.arc.filter(|ends| is_swing(*ends, arc.points.len())) else { return false };
    let radius = distance(centre, a);
    let same = |x: Point, y: Point| distance(x, y) < SAME * radius;
    let of = |from: Point, to: Point| same(from, centre) && (same(to, a) || same(to, b));
    line.arc.is_none() && line.points.windows(2).any(|w| of(w[0], w[1]) || of(w[1], w[0]))
}

/// The middle line of shapes that are longer than deep, along their longest side.
fn thin(shapes: &[&Shape]) -> Option<Line> {
    let sides = || shapes.iter().flat_map(|shape| shape.points.windows(2));
    let longest = sides().max_by(|v, w| distance(v[0], v[1]).total_cmp(&distance(w[0], w[1])))?;
    let length = distance(longest[0], longest[1]);
    if let [shape] = shapes
        && let [a, b] = shape.points[..]
    {
        return (length > 0.0).then_some([a, b]);
    }
    let from = longest[0];
    let u = sub(longest[1], from).map(|x| x / length);
    let range = |of: &dyn Fn(Point) -> f64| {
        let values = sides().flatten().map(|x| of(sub(*x, from)));
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    let (along, across) = (range(&|x| dot(u, x)), range(&|x| cross(u, x)));
    let middle = 0.5 * (across[0] + across[1]);
    let at = |s: f64| [from[0] + s * u[0] - middle * u[1], from[1] + s * u[1] + middle * u[0]];
    (length > 0.0 && across[1] - across[0] <= THIN * (along[1] - along[0])).then(|| [at(along[0]), at(along[1])])
}

/// Both leaves of a double door as one gate, and each gate once.
fn merged(gates: Vec<Gate>) -> Vec<Gate> {
    let mut found: Vec<Gate> = Vec::new();
    for gate in gates {
        let [a, b] = gate.line;
        let near = SAME * distance(a, b);
        let same = |x: Point, y: Point| distance(x, y) < near;
        if found.iter().any(|other| {
            let [c, d] = other.line;
            (same(a, c) && same(b, d)) || (same(a, d) && same(b, c))
        }) {
            continue;
        }
        // Hinges come first: leaves meet at their ends.
        let other = found.iter_mut().find(|other| {
            let [c, d] = other.line;
            let (u, v) = (sub(b, a), sub(d, c));
            same(b, d) && dot(u, v) < 0.0 && cross(u, v).abs() < SAME * dot(u, u)
        });
        match other {
            Some(other) => other.line = [other.line[0], a],
            None => found.push(gate),
        }
    }
    found
}
