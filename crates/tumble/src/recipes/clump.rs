//! Clumps: mass and inertia of a union of spheres.

use crate::geometry::Vector;
use crate::math::{Quat, eigen, rotation};
use crate::systems::grains::Clump;
use std::f64::consts::PI;
use tumble_interface::scene::GrainClump as Words;

/// Lines along z, in each direction, along which overlapping spheres are integrated: volume and moments are then right to 1e-4.
const LINES: usize = 400;

/// Key and message of what is wrong.
type Wrong = (String, String);

/// Mass, moments about the centre of mass, and the spheres, of density and `radius` 1.
pub struct Union {
    volume: f64,
    /// The centre of mass.
    center: Vector,
    /// Moments of inertia about its own axes, and these axes.
    inertia: [f64; 3],
    axes: Quat<f64>,
    spheres: Vec<[f64; 4]>,
}

impl Union {
    /// A clump of spheres of this radius [m], where the words say 1, and density [kg/m³], with the mean of its spheres at a place, its velocities, and
    /// turned by so much; and its spheres: their places in its own axes, and radii [m].
    pub fn clump(
        &self,
        [radius, density]: [f64; 2],
        [x, v, w]: [Vector; 3],
        turn: Quat<f64>,
        first: u32,
    ) -> (Clump, impl Iterator<Item = (Vector, f64)>) {
        let mut clump = Clump {
            spheres: first..first + self.spheres.len() as u32,
            mass: density * radius.powi(3) * self.volume,
            inertia: self.inertia.map(|i| density * radius.powi(5) * i),
            x: x + turn.turn(self.center) * radius,
            q: (turn * self.axes).normalized(),
            v,
            spin: Vector::default(),
        };
        clump.spin = clump.spin_of(w);
        let own = move |s: &[f64; 4]| (self.axes.conj().turn(Vector { x: s[0], y: s[1], z: s[2] } - self.center) * radius, s[3] * radius);
        (clump, self.spheres.iter().map(own))
    }
}

/// Least radius of a clump's spheres over that of the grains, its matter over that of its spheres if none overlapped, and how many there are.
pub fn crowded(words: &Words) -> Option<[f64; 3]> {
    let union = union(words).ok()?;
    let apart: f64 = union.spheres.iter().map(|s| ball(s[3])).sum();
    Some([union.spheres.iter().map(|s| s[3]).fold(f64::INFINITY, f64::min), union.volume / apart, union.spheres.len() as f64])
}

/// Volume of a ball.
fn ball(radius: f64) -> f64 {
    4.0 / 3.0 * PI * radius.powi(3)
}

/// Distance of two spheres, and how near their centres may be so that they just touch.
fn gap(a: &[f64; 4], b: &[f64; 4]) -> (f64, f64) {
    ((0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt(), a[3] + b[3])
}

/// The union of a clump's spheres.
pub fn union(words: &Words) -> Result<Union, Wrong> {
    /// Of the distance of centres, which is rounded.
    const TOUCH: f64 = 1e-9;
    if let Words::Spheres(given) = words {
        let wrong = |key: String, message: &str| Err((key, message.to_string()));
        if given.is_empty() {
            return wrong(".spheres".into(), "no sphere; give at least one, as [x, y, z, radius]");
        }
        if let Some(k) = given.iter().position(|s| s[3] <= 0.0 || s[3].is_nan()) {
            return wrong(format!(".spheres[{k}]"), "radius, the fourth number, expected > 0");
        }
        // Those that hang together with the first.
        let mut together = vec![0];
        let mut k = 0;
        while k < together.len() {
            let here = &given[together[k]];
            let near = |i: &usize| {
                let (far, touch) = gap(here, &given[*i]);
                !together.contains(i) && far <= touch * (1.0 + 1e-6)
            };
            let more: Vec<usize> = (0..given.len()).filter(near).collect();
            together.extend(more);
            k += 1;
        }
        if let Some(k) = (0..given.len()).find(|k| !together.contains(k)) {
            return wrong(format!(".spheres[{k}]"), "not connected with the first sphere; move it nearer, or put a sphere between");
        }
    }
    let spheres = words.spheres();
    let pairs = spheres.iter().enumerate().flat_map(|(i, a)| spheres[..i].iter().map(move |b| gap(a, b)));
    let apart = pairs.into_iter().all(|(far, touch)| far >= touch * (1.0 - TOUCH));
    let Moments { volume, first, second } = if apart { sums(&spheres) } else { lines(&spheres) };
    let center = first.map(|c| c / volume);
    // About the centre of mass.
    let s: [[f64; 3]; 3] = std::array::from_fn(|a| std::array::from_fn(|b| second[a][b] - volume * center[a] * center[b]));
    let trace = s[0][0] + s[1][1] + s[2][2];
    let tensor = std::array::from_fn(|a| std::array::from_fn(|b| if a == b { trace - s[a][b] } else { -s[a][b] }));
    let (inertia, vectors) = eigen::symmetric(tensor);
    let axis = |k: usize| Vector { x: vectors[0][k], y: vectors[1][k], z: vectors[2][k] };
    // The third axis is across the others; which way it points does not matter.
    let axes = rotation::from_axes(axis(0), axis(0).cross(axis(1)).normalized());
    Ok(Union { volume, center: Vector::from(center), inertia, axes, spheres })
}

/// Volume, and the integrals of x and of x x^T, about the origin.
#[derive(Default)]
struct Moments {
    volume: f64,
    first: [f64; 3],
    second: [[f64; 3]; 3],
}

impl Moments {
    fn add(&mut self, volume: f64, x: [f64; 3]) {
        self.volume += volume;
        for a in 0..3 {
            self.first[a] += volume * x[a];
            for b in 0..3 {
                self.second[a][b] += volume * x[a] * x[b];
            }
        }
    }
}

/// Of spheres that do not overlap.
fn sums(spheres: &[[f64; 4]]) -> Moments {
    let mut all = Moments::default();
    for [x, y, z, r] in spheres {
        all.add(ball(*r), [*x, *y, *z]);
        (0..3).for_each(|a| all.second[a][a] += ball(*r) * r * r / 5.0);
    }
    all
}

/// Of the union of any spheres, line by line.
fn lines(spheres: &[[f64; 4]]) -> Moments {
    let ends = |a: usize| {
        let low = spheres.iter().map(|s| s[a] - s[3]).fold(f64::INFINITY, f64::min);
        let high = spheres.iter().map(|s| s[a] + s[3]).fold(f64::NEG_INFINITY, f64::max);
        (low, (high - low) / LINES as f64)
    };
    let (along_x, along_y) = (ends(0), ends(1));
    let area = along_x.1 * along_y.1;
    let at = |(low, step): (f64, f64), i: usize| low + (i as f64 + 0.5) * step;
    let mut all = Moments::default();
    let mut cuts = Vec::new();
    for (x, y) in (0..LINES).flat_map(|i| (0..LINES).map(move |j| (i, j))).map(|(i, j)| (at(along_x, i), at(along_y, j))) {
        let cut = |s: &[f64; 4]| {
            let half = s[3] * s[3] - (s[0] - x).powi(2) - (s[1] - y).powi(2);
            (half > 0.0).then(|| [s[2] - half.sqrt(), s[2] + half.sqrt()])
        };
        cuts.clear();
        cuts.extend(spheres.iter().filter_map(cut));
        cuts.sort_by(|a: &[f64; 2], b| a[0].total_cmp(&b[0]));
        let mut done = f64::NEG_INFINITY;
        for [from, to] in &cuts {
            let from = from.max(done);
            if *to > from {
                let (length, middle) = (to - from, 0.5 * (from + to));
                all.add(length * area, [x, y, middle]);
                all.second[2][2] += length.powi(3) / 12.0 * area;
                done = *to;
            }
        }
    }
    all
}
