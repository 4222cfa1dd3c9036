//! The surface of a signed distance as triangles: one vertex for each sheet of the surface in a cell, one quadrilateral for each
//! edge of the lattice that it crosses, then vertices drawn onto the surface and spread evenly on it.
//!
//! Source: [gibson1998]. Closed and facing outward; where two sheets meet twice at one face of a cell, an edge has four triangles (cells are too large there).
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
    let (vertices, quads) = net(&values, n, &place);
    let mut mesh = Mesh { vertices, ..Mesh::default() };
    spread(phi, &mut mesh.vertices, &quads, cell);
    mesh.triangles = halved(&mesh.vertices, &quads);
    mesh
}

/// Vertices and quadrilaterals of the surface on which values at the points of a lattice are zero, inside below zero; the points lie where `place`
/// says.
pub fn net(values: &[f64], n: [usize; 3], place: &dyn Fn([usize; 3]) -> Vector) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let index = |i: [usize; 3]| (i[2] * n[1] + i[1]) * n[0] + i[0];
    // Of each cell the vertex of each edge that is crossed.
    let mut numbers: HashMap<usize, [u32; 12]> = HashMap::new();
    let (mut vertices, mut quads) = (Vec::<[f64; 3]>::new(), Vec::new());
    for i in lattice(n.map(|n| n - 1)) {
        let corner = |c: usize| -> [usize; 3] { std::array::from_fn(|k| i[k] + (c >> k & 1)) };
        let inside: [bool; 8] = std::array::from_fn(|c| values[index(corner(c))] < 0.0);
        if inside == [inside[0]; 8] {
            continue;
        }
        let sheet = sheets(&inside);
        let mut own = [u32::MAX; 12];
        for first in 0..12 {
            if sheet[first] != first || inside[EDGES[first].0] == inside[EDGES[first].1] {
                continue;
            }
            let (mut sum, mut count) = (Vector::default(), 0.0);
            for (e, (a, b)) in EDGES.into_iter().enumerate().filter(|(e, _)| sheet[*e] == first) {
                let (p, q) = (corner(a), corner(b));
                let (u, v) = (values[index(p)], values[index(q)]);
                sum = sum + place(p) + (place(q) - place(p)) * (u / (u - v));
                count += 1.0;
                own[e] = vertices.len() as u32;
            }
            vertices.push((sum * (1.0 / count)).into());
        }
        numbers.insert(index(i), own);
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
                let corner = down[0] << b | down[1] << c;
                let edge = EDGES.iter().position(|e| *e == (corner, corner | 1 << a))?;
                numbers.get(&index(cell)).map(|own| own[edge])
            };
            let [Some(p), Some(q), Some(r), Some(s)] = [[1, 1], [0, 1], [0, 0], [1, 0]].map(around) else { continue };
            let [p, q, r, s] = if u { [p, q, r, s] } else { [s, r, q, p] };
            quads.push([p, q, r, s]);
        }
    }
    (vertices, quads)
}

/// Two triangles for each quadrilateral, along its shorter diagonal.
pub fn halved(vertices: &[[f64; 3]], quads: &[[u32; 4]]) -> Vec<[u32; 3]> {
    let at = |i: u32| Vector::from(vertices[i as usize]);
    let halves = |[p, q, r, s]: [u32; 4]| {
        let short = (at(p) - at(r)).norm_sq() <= (at(q) - at(s)).norm_sq();
        if short { [[p, q, r], [p, r, s]] } else { [[q, r, s], [q, s, p]] }
    };
    quads.iter().flat_map(|quad| halves(*quad)).collect()
}

/// Each vertex goes half the way to the middle of its neighbours along the surface, then onto it.
fn spread(phi: &dyn Fn(Vector) -> f64, vertices: &mut [[f64; 3]], quads: &[[u32; 4]], cell: f64) {
    let mut near = vec![Vec::new(); vertices.len()];
    for quad in quads {
        for k in 0..4 {
            let (a, b) = (quad[k], quad[(k + 1) % 4]);
            near[a as usize].push(b);
            near[b as usize].push(a);
        }
    }
    let h = 1e-3 * cell;
    let slope = |p: Vector| {
        let d = |x: f64, y: f64, z: f64| phi(p + Vector { x, y, z }) - phi(p - Vector { x, y, z });
        Vector { x: d(h, 0.0, 0.0), y: d(0.0, h, 0.0), z: d(0.0, 0.0, h) } * (0.5 / h)
    };
    for round in 0..=ROUNDS {
        let old: Vec<Vector> = vertices.iter().map(|v| Vector::from(*v)).collect();
        for (i, vertex) in vertices.iter_mut().enumerate() {
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

/// Which crossed edges of a cell lie on one sheet of the surface: of each edge the first of its sheet. On a face whose edges are all
/// crossed, the inside is cut in two; both cells of a face see it alike.
fn sheets(inside: &[bool; 8]) -> [usize; 12] {
    let mut sheet: [usize; 12] = std::array::from_fn(|e| e);
    let edge = |a: usize, b: usize| EDGES.iter().position(|e| *e == (a.min(b), a.max(b))).unwrap_or(0);
    let mut join = |a: usize, b: usize| {
        let (from, to) = (sheet[a].max(sheet[b]), sheet[a].min(sheet[b]));
        sheet.iter_mut().filter(|s| **s == from).for_each(|s| *s = to);
    };
    for axis in 0..3 {
        for side in 0..2 {
            let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            let ring = [0, u, u | v, v].map(|c| c | side << axis);
            let edges: [usize; 4] = std::array::from_fn(|k| edge(ring[k], ring[(k + 1) % 4]));
            let crossed: Vec<usize> = (0..4).filter(|k| inside[ring[*k]] != inside[ring[(k + 1) % 4]]).collect();
            match crossed[..] {
                [a, b] => join(edges[a], edges[b]),
                [_, _, _, _] => {
                    for k in (0..4).filter(|k| inside[ring[*k]]) {
                        join(edges[k], edges[(k + 3) % 4]);
                    }
                }
                _ => {}
            }
        }
    }
    sheet
}

/// Edges of a cell: pairs of corners, bit k of a corner is its place along axis k.
const EDGES: [(usize, usize); 12] = [(0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)];

fn lattice(n: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..n[2]).flat_map(move |z| (0..n[1]).flat_map(move |y| (0..n[0]).map(move |x| [x, y, z])))
}
