//! Guides: strands of hair that were groomed elsewhere, resampled to pieces of equal length along the curve.
//!
//! Verified in `tests/guides.rs`.

use super::Site;
use crate::geometry::motion::Pose;
use crate::geometry::{Bvh, Collider, Vector};
use crate::math::rotation::from_degrees;
use std::ops::RangeInclusive;
use tumble_interface::check::short;
use tumble_interface::scene::{Guides, Hair};
use tumble_interface::warning::Code;
use tumble_interface::{Curves, Mesh, Warning};

/// Strands at most.
pub const MOST: f64 = 1e7;
/// Lengths that strands may have [m].
const LENGTHS: RangeInclusive<f64> = 1e-6..=1000.0;
/// Way of a piece from end to end over that along the curve, at least.
const FOLDED: f64 = 0.1;
/// Part of a strand's length by which it may be off without a word.
const OFF: f64 = 0.05;
/// The same in radii of the strand.
const RADII: f64 = 4.0;

/// What a hair grows on.
pub struct Ground<'a> {
    /// Its surface, without motion; guides need none.
    pub mesh: Option<&'a Mesh>,
    /// Where that stands at the start.
    pub pose: Pose,
    /// The collider that strands are combed off and that carries the roots, counted from the first, and which of its bones does.
    pub solid: Option<(&'a Collider, usize, Option<usize>)>,
}

/// The strand that is farthest off, and how many are too far.
#[derive(Default)]
struct Worst {
    count: usize,
    strand: usize,
    off: f64,
}

impl Worst {
    fn meet(&mut self, strand: usize, off: f64, most: f64) {
        if off > most {
            self.count += 1;
            if off > self.off {
                (self.strand, self.off) = (strand, off);
            }
        }
    }
}

/// Points of the strands, as they are before the motion of what they grow on; `None` where one of them is wrong.
pub fn guided(site: &mut Site<'_>, thing: &Hair, words: &Guides, curves: &Curves, ground: &Ground<'_>) -> Option<Vec<Vec<Vector>>> {
    let path = format!("hair \"{}\"", thing.name);
    let n = thing.segments as usize;
    let wanted = curves.len() as f64;
    if wanted > MOST || wanted * n as f64 > 10.0 * MOST {
        let message = format!(
            "{wanted} curves of {n} segments, expected at most {MOST:.0e} curves and 1e8 segments; lower segments, or export fewer"
        );
        site.wrong(format!("{path}.guides"), message);
        return None;
    }
    let (turn, shift) = (from_degrees(words.rotate), Vector::from(words.translate));
    let (mut grown, mut shorter) = (Vec::with_capacity(curves.len()), Worst::default());
    for (k, curve) in (1..).zip(curves) {
        let points: Vec<Vector> = curve.iter().map(|x| turn.turn(Vector::from(*x) * words.scale) + shift).collect();
        let (shape, length) = resampled(&points, n);
        if !LENGTHS.contains(&length) {
            let message = format!("curve {k} of \"{}\" is {length:.3e} m long, expected 1e-6 to 1000 m; set guides.scale", words.path);
            site.wrong(format!("{path}.guides.path"), message);
            return None;
        }
        let pieces = || shape.windows(2).map(|p| (p[1] - p[0]).norm());
        if pieces().any(|l| l < FOLDED * length / n as f64) {
            let message = format!(
                "curve {k} of \"{}\" folds back within one of {n} pieces; take more segments, or smooth the curve in the groom",
                words.path
            );
            site.wrong(format!("{path}.segments"), message);
            return None;
        }
        shorter.meet(k, 1.0 - pieces().sum::<f64>() / length, OFF);
        grown.push(shape);
    }
    if shorter.count > 0 {
        let Worst { count, strand, off } = shorter;
        let message = format!(
            "{count} of {wanted} curves have bends or curls too fine for pieces that long: in {n} pieces curve {strand} becomes {}% shorter; \
             take about {:.0} segments",
            short(100.0 * off),
            (n as f64 * (off / OFF).sqrt()).ceil()
        );
        site.hints.push(Warning::new(Code::CoarseGuides, format!("{path}.segments"), message));
    }
    loose(site, thing, &grown, ground);
    Some(grown)
}

/// Tells of roots that are far from what they grow on.
fn loose(site: &mut Site<'_>, thing: &Hair, grown: &[Vec<Vector>], ground: &Ground<'_>) {
    let Some(surface) = ground.mesh.and_then(Bvh::new) else { return };
    let mut far = Worst::default();
    for (k, shape) in (1..).zip(grown) {
        let (root, most) = (shape[0], tolerance(thing, shape));
        let off = surface.closest(root, f64::INFINITY).map_or(0.0, |c| c.distance_sq.sqrt());
        // The surface of a sphere is that of its triangles, nearly.
        let exact = |(solid, ..): (&Collider, usize, Option<usize>)| solid.distance(ground.pose.out(root), 0.0, off).0.abs();
        let off = if off > most { ground.solid.map_or(off, |solid| exact(solid).min(off)) } else { off };
        far.meet(k, off, most);
    }
    let Some(shape) = far.strand.checked_sub(1).and_then(|k| grown.get(k)) else { return };
    let Worst { count, strand, off } = far;
    let at: [f64; 3] = shape[0].into();
    let message = format!(
        "{count} of {} roots are off the surface by more than {}% of their strands, that of curve {strand}, at [{}], by {} m; they stay there and \
         move with the nearest part of it. Fit scale, rotate and translate, or attach the roots in the groom",
        grown.len(),
        100.0 * OFF,
        at.map(short).join(", "),
        short(off)
    );
    site.hints.push(Warning::new(Code::FarRoots, format!("hair \"{}\".guides", thing.name), message));
}

/// How far off a point of a strand may be [m].
fn tolerance(thing: &Hair, shape: &[Vector]) -> f64 {
    let length: f64 = shape.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
    (OFF * length).max(RADII * thing.radius)
}

/// Tells of strands that were moved out of the solid that they grow on: pairs of shapes as they were groomed and as they start.
pub fn combed<'a>(site: &mut Site<'_>, thing: &Hair, shapes: impl Iterator<Item = (&'a [Vector], &'a [Vector])>) {
    let (mut moved, mut n) = (Worst::default(), 0);
    for (k, (was, is)) in (1..).zip(shapes) {
        let most = was.iter().zip(is).map(|(a, b)| (*b - *a).norm()).fold(0.0, f64::max);
        moved.meet(k, most, tolerance(thing, was));
        n = k;
    }
    if moved.count > 0 {
        let Worst { count, strand, off } = moved;
        let message = format!(
            "{count} of {n} strands are within the collider or its thickness and are combed out of it, curve {strand} by up to {} m; lower the \
             collider's thickness, or lift them in the groom",
            short(off)
        );
        site.hints.push(Warning::new(Code::CombedGuides, format!("hair \"{}\".guides", thing.name), message));
    }
}

/// Points that part a curve into n pieces of equal length along it, and its length [m].
fn resampled(points: &[Vector], n: usize) -> (Vec<Vector>, f64) {
    let mut sums = vec![0.0];
    for p in points.windows(2) {
        sums.push(sums[sums.len() - 1] + (p[1] - p[0]).norm());
    }
    let (last, length) = (points.len() - 1, sums[points.len() - 1]);
    let mut i = 0;
    let mut at = |k: usize| {
        let s = length * k as f64 / n as f64;
        while i + 1 < last && sums[i + 1] < s {
            i += 1;
        }
        let piece = sums[i + 1] - sums[i];
        let share = if piece > 0.0 { ((s - sums[i]) / piece).min(1.0) } else { 0.0 };
        points[i] * (1.0 - share) + points[i + 1] * share
    };
    let mut shape: Vec<Vector> = (0..n).map(&mut at).collect();
    shape.push(points[last]);
    (shape, length)
}
