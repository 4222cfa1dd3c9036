//! Regular lattices of masses in one, two or three directions, x fastest, and their links.

use super::Site;
use super::pins::Clamp;
use crate::geometry::Vector;
use crate::math::rotation::from_degrees;
use tumble_interface::scene::{Diagonals, Link, Links};

/// A lattice with its middle at `center`.
pub struct Lattice {
    /// Masses along each direction; 1 in a direction that it lacks.
    pub n: [u32; 3],
    /// Spacing [m]; 1 in a direction that it lacks, so that products are lengths, areas or volumes.
    spacing: [f64; 3],
    /// Directions that it has.
    pub directions: usize,
    first: u32,
}

impl Lattice {
    /// Adds the masses; `density` is per length, area or volume, and masses at the rim stand for less of it.
    pub fn build<const D: usize>(
        site: &mut Site<'_>,
        resolution: [u32; D],
        size: [f64; D],
        center: [f64; 3],
        rotate: [f64; 3],
        density: f64,
    ) -> Self {
        let (mut n, mut spacing, mut half) = ([1; 3], [1.0; 3], [0.0; 3]);
        for a in 0..D {
            n[a] = resolution[a];
            spacing[a] = size[a] / f64::from(resolution[a] - 1);
            half[a] = size[a] / 2.0;
        }
        let mut lattice = Self { n, spacing, directions: D, first: 0 };
        let (turn, center) = (from_degrees(rotate), Vector::from(center));
        for [i, j, k] in lattice.nodes() {
            let at = |a: usize, i: u32| if a < D { f64::from(i) * spacing[a] - half[a] } else { 0.0 };
            let place = center + turn.turn(Vector { x: at(0, i), y: at(1, j), z: at(2, k) });
            let mass = density * lattice.share([i, j, k], [0; 3]);
            let index = site.parts.point(place, Vector::default(), mass);
            if [i, j, k] == [0; 3] {
                lattice.first = index;
            }
        }
        lattice
    }

    /// All nodes, x fastest.
    pub fn nodes(&self) -> impl Iterator<Item = [u32; 3]> + use<> {
        let [nx, ny, nz] = self.n;
        (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
    }

    /// Index of a node.
    pub fn index(&self, [i, j, k]: [u32; 3]) -> u32 {
        self.first + i + self.n[0] * (j + self.n[1] * k)
    }

    /// The part of the thing that a link from `node` by `step` stands for [m, m², m³]: a whole spacing along each direction
    /// in which it runs, across it what lies nearer to it than to its neighbours.
    fn share(&self, node: [u32; 3], step: [i64; 3]) -> f64 {
        (0..self.directions)
            .map(|a| {
                let rim = self.n[a] > 1 && step[a] == 0 && (node[a] == 0 || node[a] == self.n[a] - 1);
                self.spacing[a] * if rim { 0.5 } else { 1.0 }
            })
            .product()
    }

    /// Adds a link of a family from every node by `step`, where there is a node; each stands for `part` of its share.
    fn family(&self, site: &mut Site<'_>, family: &Link, step: [i64; 3], part: f64) {
        for node in self.nodes() {
            let end: [i64; 3] = std::array::from_fn(|a| i64::from(node[a]) + step[a]);
            if (0..3).all(|a| (0..i64::from(self.n[a])).contains(&end[a])) {
                let ends = [self.index(node), self.index(end.map(|e| e as u32))];
                site.link(family, ends, part * self.share(node, step));
            }
        }
    }

    /// Adds the links of a structure.
    pub fn links(&self, site: &mut Site<'_>, links: &Links) {
        let unit = |a: usize, length: i64| -> [i64; 3] { std::array::from_fn(|b| if a == b { length } else { 0 }) };
        if let Some(family) = &links.structural {
            (0..self.directions).for_each(|a| self.family(site, family, unit(a, 1), 1.0));
        }
        if let Some(family) = &links.shear {
            for (a, b) in [(0, 1), (1, 2), (0, 2)].into_iter().filter(|(_, b)| *b < self.directions) {
                let diagonal = |sign: i64| -> [i64; 3] {
                    std::array::from_fn(|c| {
                        if c == a {
                            1
                        } else if c == b {
                            sign
                        } else {
                            0
                        }
                    })
                };
                match links.diagonals {
                    Diagonals::One => self.family(site, family, diagonal(1), 1.0),
                    Diagonals::Both => [1, -1].into_iter().for_each(|sign| self.family(site, family, diagonal(sign), 0.5)),
                }
            }
        }
        if let Some(family) = &links.bend {
            (0..self.directions).for_each(|a| self.family(site, family, unit(a, 2), 1.0));
        }
    }

    /// Bending as of a plate without Poisson's ratio, alike in all directions; B is its stiffness per width [N m]:
    ///
    ///   r = K2 (x2 - x0) + K3 (x3 - x0),  K2 = K3 = -1/a,  k = B w/a,  in each row of width w        (bending.11)
    ///   r of (bending.10) for the diagonal of each cell,  k = 2 B a b/(a² + b²)                       (bending.12)
    pub fn plate(&self, site: &mut Site<'_>, stiffness: f64, clamps: &[Clamp]) {
        let [nx, ny, _] = self.n;
        self.clamp(site, stiffness, clamps);
        for [i, j, _] in self.nodes() {
            // The second corner has no part: K1 = 0.
            for (a, at, n) in [(0, i, nx), (1, j, ny)] {
                if (1..n - 1).contains(&at) {
                    let step = |way: i64| [(i, 0), (j, 1)].map(|(at, b)| if a == b { (i64::from(at) + way) as u32 } else { at });
                    let other = if a == 0 { [i, if j > 0 { j - 1 } else { 1 }] } else { [if i > 0 { i - 1 } else { 1 }, j] };
                    let nodes = [[i, j], other, step(-1), step(1)].map(|[i, j]| self.index([i, j, 0]));
                    let (along, across) =
                        (self.spacing[a], self.share([i, j, 0], std::array::from_fn(|b| i64::from(a == b))) / self.spacing[a]);
                    site.parts.isometric(nodes, [0.0, -1.0 / along, -1.0 / along], stiffness * across / along);
                }
            }
            if i + 1 < nx && j + 1 < ny {
                let nodes = [[i, j], [i + 1, j + 1], [i + 1, j], [i, j + 1]].map(|[i, j]| self.index([i, j, 0]));
                let (area, length_sq) = (self.spacing[0] * self.spacing[1], self.spacing[0].powi(2) + self.spacing[1].powi(2));
                let k = length_sq.sqrt() / area;
                site.parts.isometric(nodes, [k, -k, -k], 2.0 * stiffness * area / length_sq);
            }
        }
    }

    /// Rows that end at a clamp go on beyond it, as they are bent on this side alone: twice the stiffness.          (bending.14)
    fn clamp(&self, site: &mut Site<'_>, stiffness: f64, clamps: &[Clamp]) {
        for a in 0..2 {
            let (b, along) = (1 - a, self.spacing[a]);
            for (at, inner) in [(0, 1), (self.n[a] - 1, self.n[a] - 2)] {
                let point = |at: u32, j: u32| {
                    let mut node = [0; 3];
                    (node[a], node[b]) = (at, j);
                    self.index(node)
                };
                for j in 0..self.n[b] {
                    let neighbours = [j.checked_sub(1), Some(j + 1).filter(|j| *j < self.n[b])];
                    let edges = neighbours.into_iter().flatten().filter_map(|k| Clamp::of_edge(clamps, [point(at, j), point(at, k)]));
                    let held: Vec<&Clamp> = edges.collect();
                    let Some(clamp) = held.first() else { continue };
                    let width = 0.5 * self.spacing[b] * held.len() as f64;
                    let [end, next] = [at, inner].map(|at| point(at, j));
                    let [here, there] = [end, next].map(|point| site.parts.position(point));
                    let ghost = clamp.ghost(site, here * 2.0 - there);
                    let other = point(at, if j > 0 { j - 1 } else { 1 });
                    let nodes = [end, other, ghost, next];
                    site.parts.isometric(nodes, [0.0, -1.0 / along, -1.0 / along], 2.0 * stiffness * width / along);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::systems::dynamics::Parts;

    /// Masses add up to density times area, and each family in one direction stands for the whole area, less half a
    /// spacing at either end of skip-one links, whatever the resolution.
    #[test]
    fn shares_add_up_to_the_whole() {
        for n in [5, 9] {
            let (mut parts, mut issues) = (Parts::default(), Vec::new());
            let mut site = Site {
                hints: &mut Vec::new(),
                parts: &mut parts,
                issues: &mut issues,
                up: Vector::default(),
                solids: None,
                assets: &tumble_interface::Assets::default(),
            };
            let lattice = Lattice::build(&mut site, [n, 7], [2.0, 3.0], [0.0; 3], [0.0; 3], 0.5);
            let sum = |step: [i64; 3]| -> f64 {
                let inside = |node: &[u32; 3]| (0..3).all(|a| (0..i64::from(lattice.n[a])).contains(&(i64::from(node[a]) + step[a])));
                lattice.nodes().filter(inside).map(|node| lattice.share(node, step)).sum()
            };
            assert!((sum([0, 0, 0]) - 6.0).abs() < 1e-12);
            assert!((sum([1, 0, 0]) - 6.0).abs() < 1e-12);
            assert!((sum([0, 1, 0]) - 6.0).abs() < 1e-12);
            assert!((sum([1, 1, 0]) - 6.0).abs() < 1e-12);
            assert!((sum([2, 0, 0]) - 6.0 * (1.0 - 1.0 / f64::from(n - 1))).abs() < 1e-12);
        }
    }
}
