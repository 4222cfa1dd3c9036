//! Signed distance on a grid: exact at the nodes near the surface, trilinear between them. Cells in which that is too far off, such as
//! those that a shell or a thin part runs through, are marked.

use super::{Bvh, Vector};
use crate::math::parallel;
use tumble_interface::Mesh;

/// Nodes along the side of a tile.
const TILE: usize = 8;
/// Interpolated distances may be off by this part of a cell, at the middle of it and at four places about that.
const ROUGH: f64 = 0.03;
const PROBES: [[f64; 3]; 5] = [[0.5; 3], [0.2, 0.2, 0.8], [0.2, 0.8, 0.2], [0.8, 0.2, 0.2], [0.8; 3]];

/// Signed distance to a mesh on a grid [m].
#[derive(Debug, Clone)]
pub struct GridSdf {
    origin: Vector,
    dx: f64,
    n: [usize; 3],
    values: Vec<f32>,
    /// One bit for each node: whether the cell above it is too coarse for the surface.
    rough: Vec<u64>,
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
        let blocks: Vec<Vec<f32>> = parallel::map(count, tile);
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
        let mut grid = Self { origin, dx, n, values, rough: Vec::new() };
        grid.rough = grid.check(shell, distance);
        Some(grid)
    }

    /// The cells that are too coarse: all of a shell that the surface may run through, for its distance has a crease there, and of a solid
    /// those in which the distance is off.
    fn check(&self, shell: bool, distance: impl Fn(Vector) -> f64 + Sync) -> Vec<u64> {
        let n = self.n;
        let word = |w: usize| -> u64 {
            let is_rough = |i: usize| {
                let at = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
                if (0..3).any(|a| at[a] + 1 >= n[a]) {
                    return false;
                }
                let corner = |k: usize| f64::from(self.values[i + (k & 1) + n[0] * ((k >> 1 & 1) + n[1] * (k >> 2))]);
                // The surface is nearer than the diagonal of a cell that it runs through.
                let reach = 3.0_f64.sqrt() * self.dx;
                if !(0..8).any(|k| corner(k).abs() <= reach) {
                    return false;
                }
                shell
                    || PROBES.into_iter().any(|[x, y, z]| {
                        let p = self.origin + Vector { x: at[0] as f64 + x, y: at[1] as f64 + y, z: at[2] as f64 + z } * self.dx;
                        (self.interpolate(p).0 - distance(p)).abs() > ROUGH * self.dx
                    })
            };
            (0..64).fold(0, |bits, b| bits | u64::from(64 * w + b < self.values.len() && is_rough(64 * w + b)) << b)
        };
        parallel::map(self.values.len().div_ceil(64), word)
    }

    /// Signed distance [m] and its gradient at p, `None` where the grid is too coarse for the surface; outside the grid a lower bound of
    /// the distance.
    pub fn sample(&self, p: Vector) -> Option<(f64, Vector)> {
        let q: [f64; 3] = ((p - self.origin) * (1.0 / self.dx)).into();
        let cell: [usize; 3] = std::array::from_fn(|a| (q[a].max(0.0) as usize).min(self.n[a] - 2));
        let i = cell[0] + self.n[0] * (cell[1] + self.n[1] * cell[2]);
        if self.rough[i / 64] >> (i % 64) & 1 == 1 { None } else { Some(self.interpolate(p)) }
    }

    fn interpolate(&self, p: Vector) -> (f64, Vector) {
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
    use super::super::surface;
    use super::*;
    use crate::math::rotation::from_degrees;

    #[test]
    fn the_grid_follows_the_distance_of_a_sphere() {
        let sdf = GridSdf::new(&super::super::bvh::tests::sphere(4), 48, 0.1, false).unwrap();
        let mut near = 0;
        for p in super::super::bvh::tests::points() {
            let (phi, gradient) = sdf.interpolate(p);
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

    /// Cells that a shell or a plate thinner than a cell runs through are marked; faces of a thick one are not.
    #[test]
    fn what_the_grid_cannot_resolve_is_marked() {
        let mut open = super::super::bvh::tests::sphere(3);
        open.triangles.truncate(open.triangles.len() / 2);
        let sdf = GridSdf::new(&open, 32, 0.1, true).unwrap();
        assert!(sdf.sample([0.1, 0.2, 0.9].into()).is_none_or(|(d, _)| d >= 0.0) && sdf.sample([0.0; 3].into()).unwrap().0 > 0.5);
        assert!(sdf.sample(open.vertices[open.triangles[0][0] as usize].into()).is_none());
        let half = |thick: f64| Vector { x: 0.5, y: 0.5, z: 0.5 * thick };
        for (thick, marked) in [(0.01, true), (0.003, true), (0.5, false)] {
            let plate = surface::cuboid(Vector::default(), half(thick), from_degrees([0.0; 3]));
            let sdf = GridSdf::new(&plate, 20, 0.0, false).unwrap();
            for z in [0.4, 0.6, -0.4] {
                assert_eq!(sdf.sample([0.11, 0.07, z * thick].into()).is_none(), marked, "{thick} {z}");
            }
        }
    }
}
