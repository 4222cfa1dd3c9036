//! How a rope hangs: between two supports, or straight down.

use crate::math::bisect;
use crate::math::functions::{asinh, cosh, ln, sinh};

/// A rope that cannot stretch, from (0, 0) to (span, rise) in a vertical plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Catenary {
    /// Parameter a = H/q [m], horizontal tension over weight per length.      (catenary.2)
    pub a: f64,
    /// Abscissa of its lowest point [m]; may lie beyond the supports.
    pub lowest: f64,
    /// Horizontal distance of the supports [m].
    pub span: f64,
    /// Height of the second support above the first [m].
    pub rise: f64,
}

impl Catenary {
    /// A rope of this length [m]; `None` unless it is longer than the distance of its supports and span > 0.
    pub fn new(span: f64, rise: f64, length: f64) -> Option<Self> {
        let chord = (span * span + rise * rise).sqrt();
        if !(span > 0.0 && length > chord) {
            return None;
        }
        // sqrt(L² - rise²) = 2 a sinh(d/2a), which is (catenary.3) for level supports: with u = d/2a, sinh(u)/u = s.
        let s = (length * length - rise * rise).sqrt() / span;
        let mut high = 1.0;
        while sinh(high) / high < s {
            high *= 2.0;
        }
        let (low, high) = bisect((0.0, high), 200, |u| sinh(u) / u < s);
        let a = span / (low + high);
        // tanh((x1 + x2)/2a) = rise/length for the two supports as seen from the lowest point.
        let middle = a * 0.5 * ln((length + rise) / (length - rise));
        Some(Self { a, lowest: span / 2.0 - middle, span, rise })
    }

    /// Height [m] above the first support at x.                         (catenary.2)
    pub fn height(&self, x: f64) -> f64 {
        self.a * (cosh((x - self.lowest) / self.a) - cosh(self.lowest / self.a))
    }

    /// Place (x, z) [m] of the material point at the length s [m] from the first support.
    pub fn at(&self, s: f64) -> [f64; 2] {
        let from_lowest = s - self.a * sinh(self.lowest / self.a);
        let x = self.lowest + self.a * asinh(from_lowest / self.a);
        [x, self.height(x)]
    }

    /// Depth of the lowest point below the lower support [m]; for level supports the sag of (catenary.4).
    pub fn sag(&self) -> f64 {
        let x = self.lowest.clamp(0.0, self.span);
        self.rise.min(0.0) - self.height(x)
    }

    /// Tension over weight per length [m] at x.                         (catenary.4)
    pub fn tension(&self, x: f64) -> f64 {
        self.a * cosh((x - self.lowest) / self.a)
    }
}

/// A rope that stretches in proportion to its tension.
///
/// With s the unstretched length from the first support, the tension has the components H and V + q s, and the rope its
/// direction:
///
///   x = H s/k + H/q (asinh((V + q s)/H) - asinh(V/H))
///   z = (V s + q s²/2)/k + (sqrt(H² + (V + q s)²) - sqrt(H² + V²))/q
///
/// Source: H. M. Irvine, Cable Structures (MIT Press, 1981), 1.3. For k -> infinity it is [`Catenary`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticCatenary {
    /// Horizontal tension H [N].
    pub horizontal: f64,
    /// Vertical component of the tension at the first support, < 0 where the rope leaves it downward [N].
    pub vertical: f64,
    /// Weight per unstretched length q [N/m].
    pub weight: f64,
    /// Stiffness k = E A [N].
    pub stiffness: f64,
    /// Unstretched length [m].
    pub length: f64,
}

impl ElasticCatenary {
    /// A rope from (0, 0) to (span, rise), by Newton's method from the rope that cannot stretch. `None` if that does not
    /// exist (a rope shorter than its chord) or if no solution is found.
    pub fn new(span: f64, rise: f64, length: f64, weight: f64, stiffness: f64) -> Option<Self> {
        let start = Catenary::new(span, rise, length)?;
        let horizontal = weight * start.a;
        let vertical = -horizontal * sinh(start.lowest / start.a);
        let mut rope = Self { horizontal, vertical, weight, stiffness, length };
        for _ in 0..100 {
            let [x, z] = rope.at(length);
            let (dx, dz) = (span - x, rise - z);
            if dx.abs().max(dz.abs()) <= 1e-14 * length {
                return Some(rope);
            }
            // dx/dH, dx/dV = dz/dH (the rope's compliance is symmetric), dz/dV.
            let (h, q, k) = (rope.horizontal, weight, stiffness);
            let (v0, v1) = (rope.vertical, rope.vertical + q * length);
            let (t0, t1) = ((h * h + v0 * v0).sqrt(), (h * h + v1 * v1).sqrt());
            let a = length / k + (asinh(v1 / h) - asinh(v0 / h)) / q - (v1 / t1 - v0 / t0) / q;
            let b = h * (1.0 / t1 - 1.0 / t0) / q;
            let c = length / k + (v1 / t1 - v0 / t0) / q;
            let det = a * c - b * b;
            let (step_h, step_v) = ((c * dx - b * dz) / det, (a * dz - b * dx) / det);
            // H stays positive.
            let factor = if step_h < -0.5 * h { -0.5 * h / step_h } else { 1.0 };
            rope.horizontal += factor * step_h;
            rope.vertical += factor * step_v;
        }
        let [x, z] = rope.at(length);
        ((span - x).abs().max((rise - z).abs()) <= 1e-12 * length).then_some(rope)
    }

    /// Place (x, z) [m] of the material point at the unstretched length s [m].
    pub fn at(&self, s: f64) -> [f64; 2] {
        let (h, q, k) = (self.horizontal, self.weight, self.stiffness);
        let (v0, v1) = (self.vertical, self.vertical + q * s);
        let root = |v: f64| (h * h + v * v).sqrt();
        [h * s / k + h / q * (asinh(v1 / h) - asinh(v0 / h)), 0.5 * (v0 + v1) * s / k + (root(v1) - root(v0)) / q]
    }
}

/// A straight elastic rope that hangs by one end, with a weight at the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HangingRope {
    /// Unstretched length [m].
    pub length: f64,
    /// Weight per unstretched length q [N/m].
    pub weight: f64,
    /// Stiffness k = E A [N].
    pub stiffness: f64,
    /// Weight at the lower end [N].
    pub load: f64,
}

impl HangingRope {
    /// Depth [m] below the support of the material point at the unstretched length s [m] from it: the strain at s is
    /// (load + q (L - s))/k.                                            (catenary.5)
    pub fn depth(&self, s: f64) -> f64 {
        s + (self.load * s + self.weight * (self.length * s - s * s / 2.0)) / self.stiffness
    }

    /// Lengthening of the whole rope [m].                               (catenary.5)
    pub fn stretch(&self) -> f64 {
        self.depth(self.length) - self.length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of docs/theory/catenary.md.
    #[test]
    fn level_supports() {
        for (length, a, sag, tension, angle) in [
            (1.1, 0.654963948, 0.200300791, 0.855264738, 40.0216_f64),
            (1.5, 0.308236470, 0.502633262, 0.810869731, 67.6582),
            (2.0, 0.229640215, 0.796388356, 1.026028571, 77.0668),
            (3.0, 0.176152702, 1.334155139, 1.510307841, 83.3021),
        ] {
            let rope = Catenary::new(1.0, 0.0, length).unwrap();
            assert!((rope.a - a).abs() < 1e-9 && (rope.sag() - sag).abs() < 1e-9 && (rope.tension(0.0) - tension).abs() < 1e-9);
            assert!((sinh(0.5 / rope.a) - angle.to_radians().tan()).abs() < 1e-4);
        }
        assert_eq!(Catenary::new(1.0, 0.5, 1.1), None);
    }

    #[test]
    fn both_ropes_end_at_their_supports_and_carry_their_weight() {
        for (span, rise, length) in [(1.0, 0.0, 1.5), (1.0, 0.7, 1.5), (2.0, -1.0, 2.5), (0.3, 2.0, 3.0)] {
            let rigid = Catenary::new(span, rise, length).unwrap();
            let [x, z] = rigid.at(length);
            assert!((x - span).abs() < 1e-12 && (z - rise).abs() < 1e-12, "{x} {z}");
            assert!(rigid.sag() >= 0.0);
            let (q, k) = (2.0, 30.0);
            let soft = ElasticCatenary::new(span, rise, length, q, k).unwrap();
            let [x, z] = soft.at(length);
            assert!((x - span).abs() < 1e-12 && (z - rise).abs() < 1e-12);
            // Equilibrium of a piece by differences: T = k e t with e the strain and t the direction; T' = (0, q). They err
            // by k (h q/H)²/6, 4e-7 where H is smallest, and by round-off k 1e-16/h = 3e-10.
            let h = 1e-5;
            let tension = |s: f64| {
                let ([ax, az], [bx, bz]) = (soft.at(s - h), soft.at(s + h));
                let (dx, dz) = ((bx - ax) / (2.0 * h), (bz - az) / (2.0 * h));
                let stretch = (dx * dx + dz * dz).sqrt();
                [k * (stretch - 1.0) * dx / stretch, k * (stretch - 1.0) * dz / stretch]
            };
            let (a, b) = (tension(0.2 * length), tension(0.8 * length));
            assert!((a[0] - b[0]).abs() < 1e-5 * q, "{a:?} {b:?}");
            assert!((b[1] - a[1] - 0.6 * q * length).abs() < 1e-5 * q);
            // A stiff rope is the rope that cannot stretch: they differ by T L/k = 1e-9.
            let stiff = ElasticCatenary::new(span, rise, length, q, 1e9).unwrap();
            for s in [0.1, 0.5, 0.9].map(|part| part * length) {
                let (a, b) = (stiff.at(s), rigid.at(s));
                assert!((a[0] - b[0]).abs().max((a[1] - b[1]).abs()) < 3e-8, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn a_hanging_rope_by_hand() {
        let rope = HangingRope { length: 2.0, weight: 3.0, stiffness: 100.0, load: 5.0 };
        assert!((rope.stretch() - (3.0 * 4.0 / 200.0 + 5.0 * 2.0 / 100.0)).abs() < 1e-15);
        assert_eq!(rope.depth(0.0), 0.0);
    }
}
