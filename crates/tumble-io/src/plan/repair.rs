//! What can be mended of a plan without its author: [`super::lint`] says of which findings that holds.

use super::lint::{Cure, Finding, Floor, JAMB, Near, SAME, Side, TOUCH, at, crossing, gap, is_sliver, open_ends, overlap, pairs, sides};
use super::{Point, between, distance, foot, off};
use std::collections::BTreeMap;

/// Times that all is looked at, at most.
const PASSES: usize = 5;

/// The floor with gaps closed, walls parted where they cross themselves and ended at gates, slivers and what is twice there dropped, and corners at
/// jambs; and what was done, with its places.
pub fn repair(floor: &Floor) -> (Floor, Vec<Finding>) {
    let mut mended = floor.clone();
    let mut done = Vec::new();
    // What is cut or joined may come to lie near something else.
    for _ in 0..PASSES {
        let before = done.len();
        mended.walls.iter_mut().for_each(|wall| wall.dedup_by(|a, b| distance(*a, *b) == 0.0));
        slivers(&mut mended.walls, &mut done);
        part(&mut mended.walls, &mut done);
        doubles(&mut mended.walls, &mut done);
        open(&mut mended, &mut done);
        close(&mut mended.walls, &mut done);
        corners(&mut mended, &mut done);
        if done.len() == before {
            break;
        }
    }
    (mended, done)
}

fn tell(done: &mut Vec<Finding>, kind: &'static str, places: Vec<Point>, text: &str) {
    if let Some(first) = places.first() {
        let n = places.len();
        let text = format!("{text} at {}{}", at(*first), if n > 1 { format!(" and {} other places", n - 1) } else { String::new() });
        done.push(Finding { kind, fatal: false, places, text, cure: String::new(), by: Cure::Repair });
    }
}

fn slivers(walls: &mut Vec<Vec<Point>>, done: &mut Vec<Finding>) {
    let places = walls.iter().filter(|wall| !wall.is_empty() && is_sliver(wall)).map(|wall| wall[0]).collect();
    walls.retain(|wall| !is_sliver(wall));
    tell(done, "sliver", places, "dropped a sliver");
}

/// Walls parted where they cross themselves.
fn part(walls: &mut Vec<Vec<Point>>, done: &mut Vec<Finding>) {
    let all = sides(walls);
    let mut cuts: BTreeMap<(usize, usize), Vec<Point>> = BTreeMap::new();
    let mut places = Vec::new();
    pairs(&all, 0.0, |i, j| {
        if all[i].wall == all[j].wall
            && let Some(x) = crossing(all[i].line, all[j].line)
        {
            places.push(x);
            for side in [&all[i], &all[j]] {
                cuts.entry((side.wall, side.k)).or_default().push(x);
            }
        }
    });
    if places.is_empty() {
        return;
    }
    let mut found = Vec::new();
    for (k, wall) in walls.iter().enumerate() {
        let mut piece = vec![wall[0]];
        for (s, ends) in wall.windows(2).enumerate() {
            let mut own = cuts.get(&(k, s)).cloned().unwrap_or_default();
            own.sort_by(|x, y| distance(ends[0], *x).total_cmp(&distance(ends[0], *y)));
            for x in own {
                piece.push(x);
                found.push(std::mem::replace(&mut piece, vec![x]));
            }
            piece.push(ends[1]);
        }
        found.push(piece);
    }
    *walls = found;
    tell(done, "crossing", places, "parted a wall that crosses itself");
}

/// Of walls that lie on each other, the parts that another one covers are cut away.
fn doubles(walls: &mut Vec<Vec<Point>>, done: &mut Vec<Finding>) {
    let all = sides(walls);
    let mut covered: BTreeMap<(usize, usize), Vec<[f64; 2]>> = BTreeMap::new();
    let mut places = Vec::new();
    pairs(&all, SAME, |i, j| {
        // The earlier one stays.
        if let Some([low, high]) = overlap(all[j].line, all[i].line, SAME) {
            covered.entry((all[j].wall, all[j].k)).or_default().push([low, high]);
            places.push(between(all[j].line[0], all[j].line[1], 0.5 * (low + high) / distance(all[j].line[0], all[j].line[1])));
        }
    });
    *walls = without(walls, &covered);
    tell(done, "double", places, "dropped a wall that was there twice");
}

/// Walls without parts of their sides, which are given along them [m].
fn without(walls: &[Vec<Point>], parts: &BTreeMap<(usize, usize), Vec<[f64; 2]>>) -> Vec<Vec<Point>> {
    let mut found = Vec::new();
    for (k, wall) in walls.iter().enumerate() {
        let mut piece: Vec<Point> = vec![wall[0]];
        for (s, ends) in wall.windows(2).enumerate() {
            let length = distance(ends[0], ends[1]);
            let mut own = parts.get(&(k, s)).cloned().unwrap_or_default();
            own.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let mut from = 0.0;
            for [low, high] in own {
                if low > from + SAME {
                    piece.push(between(ends[0], ends[1], low / length));
                }
                if piece.len() > 1 {
                    found.push(std::mem::take(&mut piece));
                }
                from = high.max(from);
                piece = vec![between(ends[0], ends[1], (from / length).min(1.0))];
            }
            if from < length - SAME {
                piece.push(ends[1]);
            } else {
                piece = vec![ends[1]];
            }
        }
        if piece.len() > 1 {
            found.push(piece);
        }
    }
    found
}

/// Ends of walls moved to the walls that they are meant to meet.
fn close(walls: &mut [Vec<Point>], done: &mut Vec<Finding>) {
    let (all, mut places) = (sides(walls), Vec::new());
    let near = Near::new(&all, 2.0 * TOUCH);
    for (wall, end, x) in open_ends(walls) {
        // As they are by now: the one that it meets may have moved.
        let now = |i: &usize| Side { line: [walls[all[*i].wall][all[*i].k], walls[all[*i].wall][all[*i].k + 1]], ..all[*i] };
        let near: Vec<Side> = near.at(x).iter().map(now).collect();
        if let Some(to) = gap(&near, wall, end, x, walls[wall].len()) {
            walls[wall][end] = to;
            places.push(x);
        }
    }
    tell(done, "gap", places, "closed a gap");
}

/// Walls ended at the jambs of gates that they go on through.
fn open(floor: &mut Floor, done: &mut Vec<Finding>) {
    let mut places = Vec::new();
    let lines: Vec<[Point; 2]> = floor.door.iter().chain(&floor.exit).map(|gate| gate.line()).collect();
    for line in lines {
        let mut parts: BTreeMap<(usize, usize), Vec<[f64; 2]>> = BTreeMap::new();
        for side in sides(&floor.walls) {
            if overlap(line, side.line, TOUCH).is_some_and(|[low, high]| high - low > TOUCH)
                && let Some(part) = overlap(side.line, line, TOUCH)
            {
                parts.entry((side.wall, side.k)).or_default().push(part);
            }
        }
        if !parts.is_empty() {
            places.push(between(line[0], line[1], 0.5));
            floor.walls = without(&floor.walls, &parts);
        }
    }
    tell(done, "closed", places, "ended a wall at a gate");
}

/// Jambs moved to the corners of walls that are near, or made corners of walls.
fn corners(floor: &mut Floor, done: &mut Vec<Finding>) {
    let mut places = Vec::new();
    let walls = &mut floor.walls;
    for gate in floor.door.iter_mut().chain(&mut floor.exit) {
        for jamb in [&mut gate.from, &mut gate.to] {
            let x = *jamb;
            let all = sides(walls);
            let corner = all.iter().flat_map(|side| side.line).min_by(|y, z| distance(*y, x).total_cmp(&distance(*z, x)));
            let nearest = all.iter().min_by(|v, w| off(v.line, x).total_cmp(&off(w.line, x)));
            let (Some(corner), Some(side)) = (corner, nearest) else { continue };
            if distance(corner, x) <= JAMB || off(side.line, x) > TOUCH {
                continue;
            }
            if distance(corner, x) <= TOUCH {
                *jamb = corner;
            } else {
                let place = between(side.line[0], side.line[1], foot(side.line, x));
                walls[side.wall].insert(side.k + 1, place);
                *jamb = place;
            }
            places.push(x);
        }
    }
    tell(done, "jamb", places, "made a jamb meet a corner");
}
