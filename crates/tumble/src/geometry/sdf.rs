//! Signed distance on a grid: exact at the nodes near the surface, trilinear between them.

use super::{Bvh, Vector};
use crate::math::parallel::Tasks;
use tumble_interface::Mesh;

/// Nodes along the side of a tile.
const TILE: usize = 8;

/// Signed distance to a mesh on a grid [m].
#[derive(Debug, Clone)]
pub struct GridSdf {
    origin: Vector,
    dx: f64,
    n: [usize; 3],
    values: Vec<f32>,
}

impl GridSdf {
    /// Samples a mesh with `resolution` cells along its longest side, and `margin` [m] around it. A `shell` has no
    /// inside: its distance is never negative. `None` for a mesh without area.
    pub fn new(mesh: &Mesh, resolution: u32, margin: f64, shell: bool) -> Option<Self> {
        let bvh = Bvh::new(mesh)?;
        let (low, high) = bvh.bounds();
        let size: [f64; 3] = (high - low).into();
        let dx = size.iter().copied().fold(0.0, f64::max) / f64::from(resolution);
        let border = margin + 2.0 * dx;
        let origin = low - Vector { x: border, y: border, z: border };
        let n = size.map(|s| ((s + 2.0 * border) / dx).ceil() as usize + 1);
        let tiles = n.map(|n| n.div_ceil(TILE));
        let node = |i: usize, j: usize, k: usize| origin + Vector { x: i as f64, y: j as f64, z: k as f64 } * dx;
        let distance =
            |p| if shell { bvh.closest(p, f64::INFINITY).map_or(f64::INFINITY, |c| c.distance_sq.sqrt()) } else { bvh.signed_distance(p) };
        // A tile far from the surface has one sign; only nodes inside the solid and near it need their own search.
        let radius = dx * (TILE - 1) as f64 * 3.0_f64.sqrt() / 2.0;
        let band = margin + 3.0 * dx;
        let tile = |t: usize| -> Vec<f32> {
            let [a, b, c] = [t % tiles[0], t / tiles[0] % tiles[1], t / (tiles[0] * tiles[1])].map(|i| i * TILE);
            let half = (TILE - 1) as f64 / 2.0;
            let center = node(a, b, c) + Vector { x: half, y: half, z: half } * dx;
            let middle = distance(center);
            let far = middle - radius > band;
            let nodes = (0..TILE * TILE * TILE).map(|m| node(a + m % TILE, b + m / TILE % TILE, c + m / (TILE * TILE)));
            nodes.map(|p| if far { (middle - (p - center).norm()) as f32 } else { distance(p) as f32 }).collect()
        };
        let count = tiles[0] * tiles[1] * tiles[2];
        let blocks: Vec<Vec<f32>> = (0..count).map_in_parallel(tile);
        let mut values = vec![0.0; n[0] * n[1] * n[2]];
        for (t, block) in blocks.iter().enumerate() {
            let [a, b, c] = [t % tiles[0], t / tiles[0] % tiles[1], t / (tiles[0] * tiles[1])].map(|i| i * TILE);
            for (m, value) in block.iter().enumerate() {
                let [i, j, k] = [a + m % TILE, b + m / TILE % TILE, c + m / (TILE * TILE)];
                if i < n[0] && j < n[1] && k < n[2] {
                    values[i + n[0] * (j + n[1] * k)] = *value;
                }
            }
        }
        Some(Self { origin, dx, n, values })
    }

    /// Signed distance [m] and its gradient at p; outside the grid a lower bound of the distance.
    pub fn sample(&self, p: Vector) -> (f64, Vector) {
        let q: [f64; 3] = ((p - self.origin) * (1.0 / self.dx)).into();
        let (mut cell, mut f, mut out) = ([0; 3], [0.0; 3], [0.0; 3]);
        for a in 0..3 {
            let inside = q[a].clamp(0.0, (self.n[a] - 1) as f64);
            out[a] = (q[a] - inside) * self.dx;
            cell[a] = (inside as usize).min(self.n[a] - 2);
            f[a] = inside - cell[a] as f64;
        }
        let v = |i: usize, j: usize, k: usize| f64::from(self.values[cell[0] + i + self.n[0] * (cell[1] + j + self.n[1] * (cell[2] + k))]);
        let x = |j, k| (v(0, j, k), v(1, j, k) - v(0, j, k));
        let ((a00, d00), (a10, d10), (a01, d01), (a11, d11)) = (x(0, 0), x(1, 0), x(0, 1), x(1, 1));
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let (b00, b10, b01, b11) = (a00 + d00 * f[0], a10 + d10 * f[0], a01 + d01 * f[0], a11 + d11 * f[0]);
        let (c0, c1) = (mix(b00, b10, f[1]), mix(b01, b11, f[1]));
        let gradient = Vector {
            x: mix(mix(d00, d10, f[1]), mix(d01, d11, f[1]), f[2]) / self.dx,
            y: mix(b10 - b00, b11 - b01, f[2]) / self.dx,
            z: (c1 - c0) / self.dx,
        };
        let beyond = Vector::from(out);
        let far = beyond.norm();
        let value = mix(c0, c1, f[2]);
        if far > 0.0 { ((value * value + far * far).sqrt(), beyond * (1.0 / far)) } else { (value, gradient) }
    }

    /// Edge of a cell [m].
    pub fn cell(&self) -> f64 {
        self.dx
    }

    /// Memory [B] that a grid of this resolution over a box of these edges takes.
    pub fn bytes(size: [f64; 3], resolution: u32, margin: f64) -> f64 {
        let dx = size.iter().copied().fold(0.0, f64::max) / f64::from(resolution);
        size.iter().map(|s| (s + 2.0 * margin) / dx + 6.0).product::<f64>() * 4.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_follows_the_distance_of_a_sphere() {
        let sdf = GridSdf::new(&super::super::bvh::tests::sphere(4), 48, 0.1, false).unwrap();
        let mut near = 0;
        for p in super::super::bvh::tests::points() {
            let (phi, gradient) = sdf.sample(p);
            let exact = p.norm() - 1.0;
            if exact.abs() < 0.12 {
                near += 1;
                // Facets 0.003, trilinear interpolation dx²/2 of curvature 1: 0.001.
                assert!((phi - exact).abs() < 0.005, "{p:?} {phi} {exact}");
                assert!(gradient.normalized().dot(p.normalized()) > 0.99);
            }
            assert!(exact.abs() < 0.006 || (phi > 0.0) == (exact > 0.0), "{p:?} {phi} {exact}");
        }
        assert!(near > 30, "{near}");
    }

    #[test]
    fn a_shell_has_no_inside() {
        let mut open = super::super::bvh::tests::sphere(3);
        open.triangles.truncate(open.triangles.len() / 2);
        let sdf = GridSdf::new(&open, 32, 0.1, true).unwrap();
        for p in [[0.0, 0.0, 0.5], [0.0, 0.0, 0.0], [0.1, 0.2, 0.9]] {
            assert!(sdf.sample(p.into()).0 >= 0.0);
        }
    }
}
