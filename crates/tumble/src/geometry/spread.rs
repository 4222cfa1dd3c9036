//! Points in blue noise: of many at random those that are far from each other.
//!
//! Source: weighted sample elimination, in its progressive order [yuksel2015].

use super::Vector;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;

/// Part of the distance in a lattice below which all distances count alike, if few points are kept: where there are many by chance, as many stay as
/// elsewhere.
const ALIKE: f64 = 0.65;

/// Rows of `count` points with normals, which lie on `area` [m²], that are far from each other, in an order in which the first ones of any number
/// are far from each other, too. Points on two sides of a thin sheet do not know of each other.
pub fn spread(points: &[(Vector, Vector)], count: usize, area: f64) -> Vec<u32> {
    let mut rows: Vec<u32> = (0..points.len() as u32).collect();
    let mut order = Vec::with_capacity(count);
    let mut wanted = count.min(rows.len());
    eliminate(points, &mut rows, wanted, area);
    // Half of them go last, the others are halved again.
    while wanted > 1 {
        wanted /= 2;
        order.extend(eliminate(points, &mut rows, wanted, area));
    }
    order.extend(rows);
    order.reverse();
    order
}

/// Takes rows away until `count` are left, always the one with the nearest neighbours, and returns them in that order.
fn eliminate(points: &[(Vector, Vector)], rows: &mut Vec<u32>, count: usize, area: f64) -> Vec<u32> {
    let n = rows.len();
    if n <= count {
        return Vec::new();
    }
    // Distance of neighbours in a hexagonal lattice of as many.                                             (hair.9)
    let reach = (2.0 / 3.0_f64.sqrt() * area / count as f64).sqrt();
    let share = count as f64 / n as f64;
    let least = ALIKE * (1.0 - share * share.sqrt()) * reach;
    let cells = Cells::new(points, rows, reach);
    let (places, normals): (Vec<Vector>, Vec<Vector>) = rows.iter().map(|row| points[*row as usize]).unzip();
    let weight = |a: usize, b: usize| {
        let square = (places[a] - places[b]).norm_sq();
        if a == b || square >= reach * reach || normals[a].dot(normals[b]) < 0.0 {
            return 0.0;
        }
        let w = 1.0 - square.sqrt().max(least) / reach;
        let square = w * w;
        square * square * square * square
    };
    let mut weights: Vec<f64> = (0..n).map(|i| cells.around(i).map(|j| weight(i, j)).sum()).collect();
    // Numbers that are not negative are ordered as their bits; of equals the last goes.
    let mut heap: BinaryHeap<(u64, u32)> = weights.iter().enumerate().map(|(i, w)| (w.to_bits(), i as u32)).collect();
    let mut gone = vec![false; n];
    let mut taken = Vec::with_capacity(n - count);
    while taken.len() < n - count
        && let Some(mut heaviest) = heap.peek_mut()
    {
        let i = heaviest.1 as usize;
        // Weights fall as neighbours go: what has become lighter since takes its place further down.
        if heaviest.0 != weights[i].to_bits() {
            heaviest.0 = weights[i].to_bits();
            continue;
        }
        PeekMut::pop(heaviest);
        gone[i] = true;
        taken.push(rows[i]);
        for j in cells.around(i).filter(|j| !gone[*j]) {
            weights[j] = (weights[j] - weight(i, j)).max(0.0);
        }
    }
    let mut left = gone.iter();
    rows.retain(|_| left.next().is_some_and(|gone| !gone));
    taken
}

/// Which points are in cells beside each other.
struct Cells {
    /// Cell of each point.
    cell: Vec<u32>,
    /// Runs of points in a cell and those around it, nine for each cell.
    runs: Vec<[u32; 2]>,
}

impl Cells {
    /// Sorts the rows by cell; points are numbered in that order.
    fn new(points: &[(Vector, Vector)], rows: &mut [u32], width: f64) -> Self {
        let key = |row: u32| {
            let [x, y, z]: [f64; 3] = (points[row as usize].0 * (1.0 / width)).into();
            [z.floor() as i64, y.floor() as i64, x.floor() as i64]
        };
        let mut keys: Vec<([i64; 3], u32)> = rows.iter().map(|row| (key(*row), *row)).collect();
        keys.sort_unstable();
        let mut cells: Vec<([i64; 3], u32)> = Vec::new();
        let mut cell = Vec::with_capacity(rows.len());
        for (at, (key, row)) in keys.iter().enumerate() {
            if cells.last().is_none_or(|(last, _)| last != key) {
                cells.push((*key, at as u32));
            }
            cell.push(cells.len() as u32 - 1);
            rows[at] = *row;
        }
        let first = |key: [i64; 3]| {
            let k = cells.partition_point(|(cell, _)| *cell < key);
            cells.get(k).map_or(keys.len() as u32, |(_, at)| *at)
        };
        let beside = (-1..=1).flat_map(|z| (-1..=1).map(move |y| (z, y)));
        let run = |[z, y, x]: [i64; 3], (dz, dy): (i64, i64)| [first([z + dz, y + dy, x - 1]), first([z + dz, y + dy, x + 2])];
        let runs = cells.iter().flat_map(|(key, _)| beside.clone().map(|way| run(*key, way))).collect();
        Self { cell, runs }
    }

    /// The points around a point, it among them.
    fn around(&self, i: usize) -> impl Iterator<Item = usize> + '_ {
        let k = 9 * self.cell[i] as usize;
        self.runs[k..k + 9].iter().flat_map(|[a, b]| *a as usize..*b as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Sampler;
    use crate::geometry::surface;
    use crate::math::{Quat, Random};
    use tumble_interface::Mesh;

    /// Random points on a surface, and its area.
    fn candidates(mesh: &Mesh, n: usize, seed: u32) -> (Vec<(Vector, Vector)>, f64) {
        let (sampler, random) = (Sampler::surface(mesh).unwrap(), Random::new(seed, "spread"));
        let corner = |i: u32| Vector::from(mesh.vertices[i as usize]);
        let area = |t: &[u32; 3]| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).norm() / 2.0;
        ((0..n as u64).map(|id| sampler.sample(&|k| random.uniform(id, 0, k))).collect(), mesh.triangles.iter().map(area).sum())
    }

    /// Smallest distance between points over that of a hexagonal lattice of as many.
    fn closest(points: &[Vector], area: f64) -> f64 {
        let lattice = (2.0 / 3.0_f64.sqrt() * area / points.len() as f64).sqrt();
        let pairs = points.iter().enumerate().flat_map(|(i, x)| points[..i].iter().map(move |y| (*x - *y).norm()));
        pairs.fold(f64::INFINITY, f64::min) / lattice
    }

    fn ball() -> Mesh {
        surface::sphere(5, Vector::default(), 1.0)
    }

    fn cuboid(half: [f64; 3]) -> Mesh {
        surface::cuboid(Vector::default(), half.into(), Quat { v: Vector::default(), w: 1.0 })
    }

    #[test]
    fn first_points_of_any_number_are_far_from_each_other() {
        for (name, mesh) in [("ball", ball()), ("box", cuboid([0.5, 1.0, 1.5]))] {
            let (points, area) = candidates(&mesh, 5000, 1);
            let order = spread(&points, 1000, area);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            sorted.dedup();
            assert_eq!((order.len(), sorted.len()), (1000, 1000));
            let at = |n: usize| order[..n].iter().map(|i| points[*i as usize].0).collect::<Vec<_>>();
            let white = closest(&points[..1000].iter().map(|p| p.0).collect::<Vec<_>>(), area);
            let ratios = [1000, 700, 500, 333, 100, 40].map(|n| (n, closest(&at(n), area)));
            println!("{name}: smallest distances over those of a lattice {ratios:.2?}, at random {white:.3}");
            assert!(white < 0.1);
            for (n, ratio) in ratios {
                assert!(ratio > if n == 1000 { 0.6 } else { 0.45 }, "{n}: {ratio}");
            }
        }
    }

    #[test]
    fn points_are_even_over_the_area() {
        // Counts of blue noise scatter less than those of white noise, whose chi-square is about the number of bins less one.
        let (mut squares, mut white) = (0.0, 0.0);
        let bins = 20;
        let n = 1000;
        for seed in 0..10 {
            let (points, area) = candidates(&ball(), 5 * n, seed);
            // Zones of equal height have equal areas.
            let chi = |rows: &mut dyn Iterator<Item = usize>| {
                let mut counts = vec![0.0; bins];
                rows.for_each(|i| counts[((points[i].0.z + 1.0) / 2.0 * bins as f64).min(bins as f64 - 1.0) as usize] += 1.0);
                let mean = n as f64 / bins as f64;
                counts.iter().map(|c: &f64| (c - mean).powi(2) / mean).sum::<f64>()
            };
            squares += chi(&mut spread(&points, n, area).into_iter().map(|i| i as usize)) / 10.0;
            white += chi(&mut (0..n)) / 10.0;
        }
        println!("chi-square of {bins} zones: {squares:.2}, at random {white:.1}");
        // 19 degrees of freedom; the mean of ten has a deviation of 1.9.
        assert!((13.0..25.0).contains(&white) && squares < 6.0 && squares > 0.1);
    }

    #[test]
    fn two_sides_of_a_sheet_do_not_know_of_each_other() {
        let (points, area) = candidates(&cuboid([1.0, 1.0, 1e-4]), 5000, 3);
        let order = spread(&points, 1000, area);
        let side = |up: bool| order.iter().map(|i| points[*i as usize].0).filter(|p| (p.z > 0.0) == up).collect::<Vec<_>>();
        let (upper, lower) = (side(true), side(false));
        println!("{} above, {} below", upper.len(), lower.len());
        assert!(upper.len().abs_diff(500) < 40);
        assert!(closest(&upper, area / 2.0) > 0.5 && closest(&lower, area / 2.0) > 0.5);
        // Both together are as close as chance has it.
        assert!(closest(&[upper, lower].concat(), area) < 0.3);
    }

    #[test]
    fn there_may_be_few_points_or_equal_ones() {
        let point = (Vector::default(), Vector { x: 0.0, y: 0.0, z: 1.0 });
        assert_eq!(spread(&[point], 1, 1.0), [0]);
        assert_eq!(spread(&[point; 3], 5, 1.0).len(), 3);
        assert_eq!(spread(&[point; 50], 10, 1.0).len(), 10);
        assert!(spread(&[], 0, 1.0).is_empty());
    }
}
