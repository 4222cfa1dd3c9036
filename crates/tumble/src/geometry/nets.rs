//! The surface of a signed distance as triangles: one vertex in each cell that the surface crosses, one quadrilateral for each
//! edge of the lattice that it crosses, then vertices drawn onto the surface and spread evenly on it.
//!
//! Source: [gibson1998]. Closed and facing outward; where two sheets lie within one cell, an edge may have four triangles.
//! Verified by tests/character.rs.

use super::Vector;
use std::collections::HashMap;
use tumble_interface::Mesh;

/// Cells of a block that is left out where the surface is far.
const BLOCK: usize = 4;
/// Rounds of spreading and drawing.
const ROUNDS: usize = 8;

/// Meshes phi = 0 within the box; phi must not change by more than the distance. Cells are cubes with this edge [m], points of the lattice
/// are whole multiples of it.
pub fn surface(phi: &dyn Fn(Vector) -> f64, (low, high): (Vector, Vector), cell: f64) -> Mesh {
    let (low, high): ([f64; 3], [f64; 3]) = (low.into(), high.into());
    let first: [i64; 3] = std::array::from_fn(|a| (low[a] / cell).floor() as i64 - 1);
    let n: [usize; 3] = std::array::from_fn(|a| ((high[a] / cell).ceil() as i64 + 2 - first[a]).max(1) as usize);
    let n = n.map(|n| n.next_multiple_of(BLOCK) + 1);
    let place = |i: [usize; 3]| Vector::from(std::array::from_fn::<f64, 3, _>(|a| (first[a] + i[a] as i64) as f64 * cell));
    let index = |i: [usize; 3]| (i[2] * n[1] + i[1]) * n[0] + i[0];
    let mut values = vec![f64::INFINITY; n[0] * n[1] * n[2]];
    let far = 0.5 * BLOCK as f64 * 3.0_f64.sqrt() * cell * 1.01;
    for block in lattice(n.map(|n| (n - 1) / BLOCK)) {
        let corner = block.map(|b| b * BLOCK);
        let middle = phi(place(corner) + Vector { x: 1.0, y: 1.0, z: 1.0 } * (0.5 * BLOCK as f64 * cell));
        for i in lattice([BLOCK + 1; 3]) {
            let i: [usize; 3] = std::array::from_fn(|a| corner[a] + i[a]);
            let value = &mut values[index(i)];
            if middle.abs() > far {
                if value.is_infinite() {
                    *value = middle.signum() * far;
                }
            } else if value.is_infinite() || value.abs() >= far {
                *value = phi(place(i));
            }
        }
    }
    let mut numbers: HashMap<usize, u32> = HashMap::new();
    let mut mesh = Mesh::default();
    for i in lattice(n.map(|n| n - 1)) {
        let (mut sum, mut count) = (Vector::default(), 0.0);
        for (a, b) in EDGES {
            let [p, q] = [a, b].map(|c| std::array::from_fn(|k| i[k] + (c >> k & 1)));
            let (u, v) = (values[index(p)], values[index(q)]);
            if (u < 0.0) != (v < 0.0) {
                sum = sum + place(p) + (place(q) - place(p)) * (u / (u - v));
                count += 1.0;
            }
        }
        if count > 0.0 {
            numbers.insert(index(i), mesh.vertices.len() as u32);
            mesh.vertices.push((sum * (1.0 / count)).into());
        }
    }
    for i in lattice(n.map(|n| n - 1)) {
        for a in 0..3 {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            if i[b] == 0 || i[c] == 0 {
                continue;
            }
            let mut next = i;
            next[a] += 1;
            let (u, v) = (values[index(i)] < 0.0, values[index(next)] < 0.0);
            if u == v {
                continue;
            }
            // The four cells around the edge, counter-clockwise seen from where it points.
            let around = |down: [usize; 2]| {
                let mut cell = i;
                cell[b] -= down[0];
                cell[c] -= down[1];
                numbers.get(&index(cell)).copied()
            };
            let [Some(p), Some(q), Some(r), Some(s)] = [[1, 1], [0, 1], [0, 0], [1, 0]].map(around) else { continue };
            let [p, q, r, s] = if u { [p, q, r, s] } else { [s, r, q, p] };
            let at = |i: u32| Vector::from(mesh.vertices[i as usize]);
            // The shorter diagonal.
            let short = (at(p) - at(r)).norm_sq() <= (at(q) - at(s)).norm_sq();
            mesh.triangles.extend(if short { [[p, q, r], [p, r, s]] } else { [[q, r, s], [q, s, p]] });
        }
    }
    spread(phi, &mut mesh, cell);
    mesh
}

/// Each vertex goes half the way to the middle of its neighbours along the surface, then onto it.
fn spread(phi: &dyn Fn(Vector) -> f64, mesh: &mut Mesh, cell: f64) {
    let mut near = vec![Vec::new(); mesh.vertices.len()];
    for ([a, b], _) in mesh.edges() {
        near[a as usize].push(b);
        near[b as usize].push(a);
    }
    let h = 1e-3 * cell;
    let slope = |p: Vector| {
        let d = |x: f64, y: f64, z: f64| phi(p + Vector { x, y, z }) - phi(p - Vector { x, y, z });
        Vector { x: d(h, 0.0, 0.0), y: d(0.0, h, 0.0), z: d(0.0, 0.0, h) } * (0.5 / h)
    };
    for round in 0..=ROUNDS {
        let old: Vec<Vector> = mesh.vertices.iter().map(|v| Vector::from(*v)).collect();
        for (i, vertex) in mesh.vertices.iter_mut().enumerate() {
            let mut p = old[i];
            let g = slope(p);
            if round < ROUNDS && !near[i].is_empty() {
                let middle = near[i].iter().fold(Vector::default(), |m, j| m + old[*j as usize]) * (1.0 / near[i].len() as f64);
                let (way, normal) = (middle - p, g.normalized());
                p = p + (way - normal * way.dot(normal)) * 0.5;
            }
            let far = g.norm_sq();
            if far > 1e-6 {
                // No farther than a cell: a corner of phi has no slope to trust.
                let step = g * (phi(p) / far);
                let long = step.norm();
                p = p - if long > 0.5 * cell { step * (0.5 * cell / long) } else { step };
            }
            *vertex = p.into();
        }
    }
}

/// Edges of a cell: pairs of corners, bit k of a corner is its place along axis k.
const EDGES: [(usize, usize); 12] =
    [(0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)];

fn lattice(n: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..n[2]).flat_map(move |z| (0..n[1]).flat_map(move |y| (0..n[0]).map(move |x| [x, y, z])))
}
