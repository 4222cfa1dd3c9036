//! The pattern of a dress: four panels, the front and the back of a bodice on straps and the two halves of a skirt that is a full circle.
//!
//! ```text
//!      4__3   10__9              y
//!      |  |___|  |    front, back     y = bodice + shoulder: the top of the straps
//!      5         8
//!       \       /                     y = bodice: below the arms
//!        1_____0                      y = 0: the waist, sewn to the inner arcs of the skirt
//! ```
//! The bodice hangs on a tube around the body that is as wide as the panels at every height, its straps bent over the shoulders; the
//! skirt falls from the waist as a cone.

use super::cut::{Cut, Stitch};
use crate::geometry::Vector;
use crate::math::functions::{cos, sin};
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::RangeInclusive;
use tumble_interface::check::{plain, short};
use tumble_interface::scene::Dress;

/// Girths of waists, from a doll's to a monument's [m].
const GIRTHS: RangeInclusive<f64> = 0.01..=100.0;
/// Points along an arc.
const ARC: usize = 96;

/// Half axes of an ellipse of so long a girth whose depth is `depth` of its width, by Ramanujan's formula (to 1e-4).
fn ellipse(girth: f64, depth: f64) -> (f64, f64) {
    let h = (1.0 - depth) * (1.0 - depth) / ((1.0 + depth) * (1.0 + depth));
    let round = PI * (1.0 + depth) * (1.0 + 3.0 * h / (10.0 + (4.0 - 3.0 * h).sqrt()));
    (girth / round, girth / round * depth)
}

/// Which measure is beyond sense, and why: nobody wears that, or its panels would overlap themselves.
pub fn beyond_sense(words: &Dress, resolution: f64) -> Option<(&'static str, String)> {
    let (girth, bust, apart, strap) = (words.waist_girth, words.bust_girth, words.strap_distance, words.strap);
    if !GIRTHS.contains(&girth) {
        return Some((".dress.waist_girth", format!("{} m, expected {} to {} m", plain(girth), GIRTHS.start(), GIRTHS.end())));
    }
    // Over the girth of the waist: from half of what the leanest doll would wear to several times what the longest train would.
    let shares = [
        (".dress.bust_girth", bust, 0.2, 5.0),
        (".dress.bodice", words.bodice, 0.02, 5.0),
        (".dress.shoulder", words.shoulder, 0.02, 5.0),
        (".dress.skirt", words.skirt, 0.02, 20.0),
        (".dress.strap", strap, 0.005, 5.0),
    ];
    if let Some((key, x, least, most)) = shares.into_iter().find(|(_, x, least, most)| !(least * girth..=most * girth).contains(x)) {
        let (x, least, most, girth) = (plain(x), short(least * girth), short(most * girth), plain(girth));
        return Some((key, format!("{x} m, expected {least} to {most} m beside a waist_girth of {girth} m")));
    }
    if strap >= apart {
        let message =
            format!("{} m, expected less than strap_distance, {} m: both straps would lie on each other", plain(strap), plain(apart));
        return Some((".dress.strap", message));
    }
    if 0.5 * (apart + strap) >= 0.25 * bust {
        let message = format!(
            "{} m, and a strap is {} m wide, expected less than half of bust_girth together, {} m: straps would end beyond the sides",
            plain(apart),
            plain(strap),
            short(0.5 * bust)
        );
        return Some((".dress.strap_distance", message));
    }
    (resolution > girth / 6.0).then(|| {
        let message = format!(
            "{} m is too coarse for a waist_girth of {} m, expected at most a sixth of it, {} m",
            plain(resolution),
            plain(girth),
            short(girth / 6.0)
        );
        (".resolution", message)
    })
}

/// The panels front, back, skirt front, skirt back, and their seams.
pub fn dress(words: &Dress) -> (Vec<Cut>, Vec<Stitch>) {
    let mut cuts: Vec<Cut> = [-1.0, 1.0].into_iter().map(|side| bodice(words, side)).collect();
    cuts.extend([-1.0, 1.0].into_iter().map(|side| skirt(words, side)));
    // Sides of a bodice: 0 waist, 1 side, 2 armhole, 3 strap top, 4 neckline, 5 strap top, 6 armhole, 7 side. Of a skirt: 0 waist,
    // 1 side, 2 hem, 3 side. Front and back are drawn as seen from outside, so that the left of one is sewn to the right of the other.
    let stitch = |from, to| Stitch { from, to, flip: false };
    let mut stitches = vec![stitch((0, 1), (1, 7)), stitch((0, 7), (1, 1)), stitch((0, 3), (1, 5)), stitch((0, 5), (1, 3))];
    stitches.extend([stitch((2, 1), (3, 3)), stitch((2, 3), (3, 1)), stitch((0, 0), (2, 0)), stitch((1, 0), (3, 0))]);
    (cuts, stitches)
}

/// A half of the bodice, the front (side = -1) or the back, drawn as seen from outside: x to the right, y up.
fn bodice(words: &Dress, side: f64) -> Cut {
    let (waist, bust) = (words.waist_girth / 4.0, words.bust_girth / 4.0);
    let (top, arm) = (words.bodice + words.shoulder, words.bodice);
    let (inner, outer) = (0.5 * (words.strap_distance - words.strap), 0.5 * (words.strap_distance + words.strap));
    // A neckline is a half ellipse between the straps, deeper in front; an armhole a quarter.
    let dip = if side < 0.0 { 0.85 * words.shoulder } else { 0.6 * words.shoulder };
    let arc = |f: &dyn Fn(f64) -> [f64; 2]| -> Vec<[f64; 2]> { (0..=24).map(|i| f(f64::from(i) / 24.0)).collect() };
    let right_arm = arc(&|s| [outer + (bust - outer) * (1.0 - sin(FRAC_PI_2 * s)), arm + (top - arm) * (1.0 - cos(FRAC_PI_2 * s))]);
    let left_arm: Vec<[f64; 2]> = right_arm.iter().rev().map(|p| [-p[0], p[1]]).collect();
    let neck = arc(&|s| [inner * cos(PI * s), top - dip * sin(PI * s)]);
    let sides = vec![
        vec![[-waist, 0.0], [waist, 0.0]],
        vec![[waist, 0.0], [bust, arm]],
        right_arm,
        vec![[outer, top], [inner, top]],
        neck,
        vec![[-inner, top], [-outer, top]],
        left_arm,
        vec![[-bust, arm], [-waist, 0.0]],
    ];
    let words = words.clone();
    let place = move |[x, y]: [f64; 2]| {
        let share = (y / arm).min(1.0);
        let half = waist + (bust - waist) * share;
        let (rx, ry) = ellipse(4.0 * half, words.depth);
        // Seen from outside, the front's right is at +x, the back's at -x.
        let angle = (x / half).clamp(-1.0, 1.0) * FRAC_PI_2;
        let (across, mut deep, mut z) = (rx * sin(angle), ry * cos(angle), y);
        if y > arm {
            // Straps go straight up and bend over the shoulder on a quarter of a circle.
            let straight = (words.shoulder - FRAC_PI_2 * deep).max(0.0);
            let bent = ((y - arm - straight) / deep).clamp(0.0, FRAC_PI_2);
            z = (arm + straight).min(y) + deep * sin(bent);
            deep *= cos(bent);
        }
        let [cx, cy, cz] = words.waist;
        Vector { x: cx - side * across, y: cy + side * deep, z: cz + z }
    };
    Cut { sides, place: Box::new(place) }
}

/// A half of the skirt: half a ring whose inner arc is half the waist.
fn skirt(words: &Dress, side: f64) -> Cut {
    let inner = words.waist_girth / (2.0 * PI);
    let outer = inner + words.skirt;
    // From right to left around the front, as seen from above and behind; the waist runs against it.
    let arc = |radius: f64, forth: bool| -> Vec<[f64; 2]> {
        let at = |i: usize| PI * if forth { i } else { ARC - i } as f64 / ARC as f64;
        (0..=ARC).map(|i| [radius * cos(at(i)), -radius * sin(at(i))]).collect()
    };
    let sides = vec![arc(inner, true), vec![[-inner, 0.0], [-outer, 0.0]], arc(outer, false), vec![[outer, 0.0], [inner, 0.0]]];
    let words = words.clone();
    let (rx, ry) = ellipse(words.waist_girth, words.depth);
    let slope = words.fall.to_radians();
    let place = move |[x, y]: [f64; 2]| {
        let radius = (x * x + y * y).sqrt();
        let (c, s) = (x / radius, -y / radius);
        let way = radius - inner;
        let flare = way * cos(slope);
        let [cx, cy, cz] = words.waist;
        Vector { x: cx - side * c * (rx + flare), y: cy + side * s * (ry + flare), z: cz - way * sin(slope) }
    };
    Cut { sides, place: Box::new(place) }
}
