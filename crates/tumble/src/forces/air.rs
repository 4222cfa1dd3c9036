//! Surfaces in air that moves: drag along the air's velocity, lift across it, friction in the surface, triangle by triangle.
//!
//!   F = rho/2 A (C_D |s| w + C_L (s |w| n - s²/|w| w) + C_F |w| (w - s n)),   w = u - v,   s = w . n             (cloth.1)
//!
//! w [m/s] is the velocity of the air relative to the triangle, whose velocity v is the mean of its corners'; n its unit normal, A its area
//! [m²]. Each corner takes a third. Turning n around changes nothing.
//! Source: [ling1996] for drag on the area that the air sees, A |s|/|w|. Differs: lift is that of a plate that turns the air, sin a cos a
//! at the angle a between air and surface, which has no jump at a = 0.
//! Limits: the air does not notice the surface, and no triangle shelters another. Verified in tests/air.rs.

use super::Flow;
use crate::elements::{Batch, Block, Incidence, Weights};
use crate::math::parallel::{CHUNK, Tasks, chunks};
use crate::math::simd::Index;
use crate::math::{Lane, Real, Row, Vec3, ZERO, add, row, xyz64};

/// Air force on a surface.
pub struct Air {
    /// Density of the air [kg/m³].
    pub density: f64,
    /// C_D, on the area that the air sees.
    pub drag: f64,
    /// C_L.
    pub lift: f64,
    /// C_F, of both faces together.
    pub friction: f64,
    /// Velocity of the air.
    pub flow: Flow,
}

impl Air {
    /// The force [N] on a triangle of that normal, as long as its area [m²], for the relative velocity w [m/s].
    pub fn force(&self, area: Vec3<f64>, w: Vec3<f64>) -> Vec3<f64> {
        self.force_on(area, w)
    }

    fn force_on<L: Lane>(&self, area: Vec3<f64>, w: Vec3<L>) -> Vec3<L> {
        let size = area.norm();
        let one = |c: f64| w.x.like(c);
        let speed = w.norm_sq().sqrt();
        let inverse = speed.positive(one(1.0) / speed, one(0.0));
        let unit = if size > 0.0 { area * (1.0 / size) } else { area };
        let n = Vec3 { x: one(unit.x), y: one(unit.y), z: one(unit.z) };
        let s = w.dot(n);
        let seen = s.positive(s, -s);
        let along = one(self.drag) * seen - one(self.lift) * s * s * inverse + one(self.friction) * speed;
        let across = one(self.lift - self.friction) * speed * s;
        (w * along + n * across) * one(0.5 * self.density * size)
    }

    /// dF/dw without what is not symmetric, as a I + b n n^T with a, b >= 0, for that normal and relative velocity.
    fn slope(&self, area: Vec3<f64>, w: Vec3<f64>) -> (f64, f64, Vec3<f64>) {
        let size = area.norm();
        let n = if size > 0.0 { area * (1.0 / size) } else { area };
        let (speed, s) = (w.norm(), w.dot(n).abs());
        let flat = if speed > 0.0 { (speed - s * s / speed).max(0.0) } else { 0.0 };
        let scale = 0.5 * self.density * size;
        (scale * (self.drag * s + self.friction * speed), scale * (self.drag * s + self.lift * flat), n)
    }
}

/// Triangles in the air.
pub struct Sails {
    law: Air,
    nodes: [Index; 3],
    incidence: Incidence,
    /// Mass of all corners [kg].
    mass: f64,
    /// Largest speed of the air that is foreseen, if it blows [m/s].
    fastest: Option<f64>,
    /// Of each triangle: the velocity relative to the air.
    relative: Vec<Row>,
    /// Of each triangle: the force on each corner [N], and how fast it falls with the corner's velocity [N s/m].
    forces: Vec<Row>,
    matrices: Vec<Block>,
    products: Vec<Row>,
    /// How long the forces will act at once [s]; 0 where the scheme sees to it.
    kick: f64,
}

/// Triangles at a time in which the air's velocity is asked for.
const BLOCK: usize = 128;

impl Sails {
    /// The triangles of some rows, whose masses [kg] and places are given; `None` if a corner is no row. `times` are some of the run [s].
    pub fn new(law: Air, triangles: &[[u32; 3]], x: &[Row], mass: &[Real], times: &[f64]) -> Option<Self> {
        let nodes = nodes(triangles, x.len())?;
        let mut rows: Vec<u32> = triangles.concat();
        rows.sort_unstable();
        rows.dedup();
        let corners: Vec<Row> = rows.iter().map(|i| x[*i as usize]).collect();
        let mut u = vec![ZERO; corners.len()];
        let mut fastest = 0.0_f64;
        for t in times {
            law.flow.velocities(*t, &corners, &mut u);
            fastest = u.iter().map(|u| xyz64(*u).norm()).fold(fastest, f64::max);
        }
        Some(Self {
            incidence: Incidence::new(&nodes),
            mass: rows.iter().map(|i| f64::from(mass[*i as usize])).sum(),
            fastest: (!law.flow.fields.is_empty()).then_some(fastest),
            law,
            nodes,
            relative: Vec::new(),
            forces: Vec::new(),
            matrices: Vec::new(),
            products: Vec::new(),
            kick: 0.0,
        })
    }

    fn corners(&self, x: &[Row], e: usize) -> [Vec3<f64>; 3] {
        [0, 1, 2].map(|a| xyz64(x[self.nodes[a].get()[e] as usize]))
    }

    fn area(&self, x: &[Row], e: usize) -> Vec3<f64> {
        let [a, b, c] = self.corners(x, e);
        (b - a).cross(c - a) * 0.5
    }

    fn check(&self, rows: &[Row]) {
        assert!(self.nodes.iter().all(|i| i.rows() <= rows.len()), "a column is shorter than the rows of the triangles");
    }
}

fn nodes(triangles: &[[u32; 3]], rows: usize) -> Option<[Index; 3]> {
    let index = |a: usize| Index::new(triangles.iter().map(|t| t[a]).collect(), rows);
    Some([index(0)?, index(1)?, index(2)?])
}

fn narrow(v: Vec3<f64>, last: f64) -> Row {
    row(Vec3 { x: v.x as Real, y: v.y as Real, z: v.z as Real }, last as Real)
}

impl Batch for Sails {
    fn name(&self) -> &'static str {
        "air"
    }

    fn len(&self) -> usize {
        self.nodes[0].get().len()
    }

    fn energy(&self, _x: &[Row]) -> f64 {
        0.0
    }

    fn is_elastic(&self) -> bool {
        false
    }

    /// Twice the speed of the air.
    fn drives(&self) -> Option<f64> {
        self.fastest.map(|u| 2.0 * self.mass * u * u)
    }

    fn feels_velocity(&self) -> bool {
        true
    }

    fn act_at_once(&mut self, h: f64) {
        self.kick = h;
    }

    fn begin_forces(&mut self, t: f64, x: &[Row], v: &[Row]) {
        self.check(x);
        self.check(v);
        let n = self.len();
        let (mut relative, mut forces) = (std::mem::take(&mut self.relative), std::mem::take(&mut self.forces));
        relative.resize(n, ZERO);
        forces.resize(n, ZERO);
        let sails = &*self;
        relative.chunks_mut(BLOCK).zip(forces.chunks_mut(BLOCK)).enumerate().in_parallel(|(block, (relative, forces))| {
            let mut middle = [ZERO; BLOCK];
            let third = 1.0 / 3.0;
            for (k, middle) in middle.iter_mut().enumerate().take(forces.len()) {
                let [a, b, c] = sails.corners(x, block * BLOCK + k);
                *middle = narrow((a + b + c) * third, 0.0);
            }
            sails.law.flow.velocities(t, &middle[..forces.len()], relative);
            for (k, (w, f)) in relative.iter_mut().zip(forces).enumerate() {
                let e = block * BLOCK + k;
                let [a, b, c] = sails.corners(v, e);
                let area = sails.area(x, e);
                let wind = xyz64(*w) - (a + b + c) * third;
                *w = narrow(wind, 0.0);
                let (level, steep, _) = sails.law.slope(area, wind);
                *f = narrow(sails.law.force(area, wind) * third, (level + steep) * third);
            }
        });
        (self.relative, self.forces) = (relative, forces);
    }

    fn add_forces(&self, x: &[Row], _v: &[Row], start: usize, force: &mut [Row]) {
        let kick = self.kick as Real;
        self.incidence.rows(start, force, |i, out, slots| {
            let mut sum = ZERO;
            for slot in slots {
                sum = add(sum, self.forces[*slot as usize / 3]);
            }
            // At once, no more than what takes the wind out of the surface.
            let part = 1.0 / (kick * x[i][3] * sum[3]).max(1.0);
            *out = [out[0] + part * sum[0], out[1] + part * sum[1], out[2] + part * sum[2], out[3]];
        });
    }

    fn rewire(&mut self, changes: &[(u32, usize, u32)]) {
        if changes.is_empty() {
            return;
        }
        for (element, node, row) in changes {
            self.nodes[*node].set(*element as usize, *row);
        }
        self.incidence = Incidence::new(&self.nodes);
    }

    /// How the force changes with the place and the turn of a triangle is left out: it is slow beside what velocities do.
    fn linearize(&mut self, x: &[Row], weights: Weights) {
        self.check(x);
        let mut matrices = std::mem::take(&mut self.matrices);
        matrices.resize(self.len(), [0.0; 6]);
        let sails = &*self;
        chunks(&mut matrices, |start, matrices| {
            for (k, block) in matrices.iter_mut().enumerate() {
                let Some(w) = sails.relative.get(start + k) else { continue };
                let (level, steep, n) = sails.law.slope(sails.area(x, start + k), xyz64(*w));
                let c = f64::from(weights.damping) / 9.0;
                let n: [f64; 3] = n.into();
                let entry = |i: usize, j: usize| (c * (steep * n[i] * n[j] + if i == j { level } else { 0.0 })) as Real;
                *block = [entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(1, 2), entry(2, 0)];
            }
        });
        self.matrices = matrices;
    }

    fn begin_product(&mut self, _x: &[Row], u: &[Row]) {
        self.check(u);
        let mut products = std::mem::take(&mut self.products);
        products.resize(self.len(), ZERO);
        let sails = &*self;
        products.chunks_mut(CHUNK).enumerate().in_parallel(|(c, products)| {
            for (k, out) in products.iter_mut().enumerate() {
                let e = c * CHUNK + k;
                let [a, b, d] = [0, 1, 2].map(|a| u[sails.nodes[a].get()[e] as usize]);
                let s = add(add(a, b), d);
                let [xx, yy, zz, xy, yz, zx] = sails.matrices[e];
                *out = [xx * s[0] + xy * s[1] + zx * s[2], xy * s[0] + yy * s[1] + yz * s[2], zx * s[0] + yz * s[1] + zz * s[2], 0.0];
            }
        });
        self.products = products;
    }

    fn add_product(&self, _u: &[Row], start: usize, out: &mut [Row]) {
        self.incidence.rows(start, out, |_, out, slots| {
            for slot in slots {
                *out = add(*out, self.products[*slot as usize / 3]);
            }
        });
    }

    fn add_diagonal(&mut self, _x: &[Row], blocks: &mut [Block]) {
        let sails = &*self;
        chunks(blocks, |start, blocks| {
            sails.incidence.rows(start, blocks, |_, out, slots| {
                for slot in slots {
                    let block = sails.matrices[*slot as usize / 3];
                    (0..6).for_each(|c| out[c] += block[c]);
                }
            });
        });
    }

    fn entries(&self, _x: &[Row], sink: &mut dyn FnMut(usize, usize, [[f64; 3]; 3])) {
        for (e, block) in self.matrices.iter().enumerate() {
            let [xx, yy, zz, xy, yz, zx] = block.map(f64::from);
            for a in 0..3 {
                for b in 0..3 {
                    let [a, b] = [a, b].map(|k: usize| self.nodes[k].get()[e] as usize);
                    sink(a, b, [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Dual;

    /// The slope is that of the force where the two agree: straight onto the surface, and the friction along it.
    #[test]
    fn the_slope_is_the_derivative_where_it_is_symmetric() {
        let law = Air { density: 1.2, drag: 1.1, lift: 0.7, friction: 0.05, flow: Flow::default() };
        let area = Vec3 { x: 0.3, y: -0.2, z: 0.6 };
        let n = area * (1.0 / area.norm());
        let w = n * 3.0;
        let derivative = |e: Vec3<f64>| law.force_on(area, Vec3::<Dual<f64>>::lift(w, e)).slope();
        let (level, steep, _) = law.slope(area, w);
        assert!((derivative(n) - n * (level + steep)).norm() < 2.0 * law.friction * 3.0 * area.norm());
        let along = Vec3 { x: 0.2, y: 0.3, z: 0.0 };
        assert!(along.dot(n).abs() < 1e-12 && level > 0.0 && steep > 0.0);
        // Turned around it is the same surface.
        assert_eq!(law.force(area, w + along), law.force(-area, w + along));
    }
}
