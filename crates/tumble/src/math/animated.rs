//! Values that change in time or space, as the scene's [`Animated`] and [`AnimatedVector`] say.

use super::formula::{Formula, Of};
use super::{Row, Vec3};
use tumble_interface::check::plain;
use tumble_interface::scene::{Animated, AnimatedVector, Component, Interpolation};

/// A number as a function of time.
#[derive(Debug, Clone)]
pub enum Signal {
    /// The same at all times.
    Constant(f64),
    /// A formula of t.
    Formula(Formula),
    /// Keyframes.
    Keys(Curve<1>),
}

impl Signal {
    /// From the words of a scene, or what is wrong with them.
    pub fn new(words: &Animated) -> Result<Self, String> {
        Ok(match words {
            Animated::Value(value) => Self::Constant(*value),
            Animated::Formula(text) => Self::Formula(Formula::new(text, 1, Of::Time)?),
            Animated::Keys(keys) => {
                Self::Keys(Curve::new(keys.keys.iter().map(|[t, value]| (*t, [*value])).collect(), keys.interpolation)?)
            }
        })
    }

    /// The value at a time [s].
    pub fn value(&self, t: f64) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Formula(formula) => formula.at(t, Vec3::from([0.0; 3]), Vec3::from([0.0; 3]))[0],
            Self::Keys(curve) => curve.value(t)[0],
        }
    }

    /// Whether it is the same at all times.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Constant(_))
    }

    /// The times of its keys [s].
    pub fn key_times(&self) -> &[f64] {
        if let Self::Keys(curve) = self { &curve.times } else { &[] }
    }

    /// Its integral from a to b [s]: exact for keyframes, for a formula by Simpson's rule.
    pub fn integral(&self, a: f64, b: f64) -> f64 {
        match self {
            Self::Constant(value) => value * (b - a),
            Self::Formula(_) => simpson(a, b, |t| self.value(t)),
            Self::Keys(curve) => curve.integral(a, b)[0],
        }
    }
}

/// Simpson's rule, exact for cubics.
fn simpson(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    (b - a) / 6.0 * (f(a) + 4.0 * f(0.5 * (a + b)) + f(b))
}

impl From<f64> for Signal {
    fn from(value: f64) -> Self {
        Self::Constant(value)
    }
}

/// A vector as a function of time, and of place and velocity where the formula may use them.
#[derive(Debug, Clone)]
pub enum VectorSignal {
    /// The same everywhere, at all times.
    Constant([f64; 3]),
    /// A formula.
    Formula(Formula),
    /// Keyframes.
    Keys(Curve<3>),
}

impl VectorSignal {
    /// From the words of a scene, which may use these variables, or what is wrong with them.
    pub fn new(words: &AnimatedVector, of: Of) -> Result<Self, String> {
        if let Some(value) = words.constant() {
            return Ok(Self::Constant(value));
        }
        let part = |component: &Component| match component {
            Component::Value(value) => Ok(Formula::constant(*value)),
            Component::Formula(text) => Formula::new(text, 1, of),
        };
        Ok(match words {
            AnimatedVector::Components([x, y, z]) => Self::Formula(Formula::joined([part(x)?, part(y)?, part(z)?])),
            AnimatedVector::Formula(text) => Self::Formula(Formula::new(text, 3, of)?),
            AnimatedVector::Keys(_) if of == Of::Start => {
                return Err("keyframes have no meaning in a value that does not change; give numbers, or formulas of x, y, z".into());
            }
            AnimatedVector::Keys(keys) => {
                Self::Keys(Curve::new(keys.keys.iter().map(|[t, x, y, z]| (*t, [*x, *y, *z])).collect(), keys.interpolation)?)
            }
        })
    }

    /// The vector at a time, a place and a velocity.
    pub fn at(&self, t: f64, x: Vec3<f64>, v: Vec3<f64>) -> Vec3<f64> {
        Vec3::from(match self {
            Self::Constant(value) => *value,
            Self::Formula(formula) => formula.at(t, x, v),
            Self::Keys(curve) => curve.value(t),
        })
    }

    /// The vector at a time, where it is a formula of time alone.
    pub fn value(&self, t: f64) -> Vec3<f64> {
        self.at(t, Vec3::from([0.0; 3]), Vec3::from([0.0; 3]))
    }

    /// Calls `each(row, vector)` for every row; `false`, without a call, if the vector is the same for all of them.
    pub fn rows(&self, t: f64, x: &[Row], v: &[Row], mut each: impl FnMut(usize, Vec3<f64>)) -> bool {
        if let Self::Formula(formula) = self
            && formula.varies()
        {
            formula.rows(t, x, v, |i, value| each(i, value.into()));
            return true;
        }
        false
    }

    /// Calls `each(i, value)` with one component at n points of a line along x, the i-th of which is at `x(i)`.
    pub fn along(&self, component: usize, t: f64, n: usize, x: impl Fn(usize) -> f64, yz: [f64; 2], mut each: impl FnMut(usize, f64)) {
        match self {
            Self::Formula(formula) => formula.along(component, t, n, x, yz, each),
            _ => (0..n).for_each(|i| each(i, <[f64; 3]>::from(self.value(t))[component])),
        }
    }

    /// How fast it changes at a time, where it is a function of time alone: by central differences, but keys that it jumps
    /// between are no motion.
    pub fn velocity(&self, t: f64) -> Vec3<f64> {
        const STEP: f64 = 1e-4;
        match self {
            Self::Constant(_) => [0.0; 3].into(),
            Self::Keys(curve) if curve.interpolation == Interpolation::Step => [0.0; 3].into(),
            _ => (self.value(t + STEP) - self.value(t - STEP)) * (0.5 / STEP),
        }
    }

    /// The times of its keys [s].
    pub fn key_times(&self) -> &[f64] {
        if let Self::Keys(curve) = self { &curve.times } else { &[] }
    }

    /// Whether it is the same for all masses.
    pub fn is_uniform(&self) -> bool {
        !matches!(self, Self::Formula(formula) if formula.varies())
    }

    /// Whether it is the same everywhere, at all times.
    pub fn is_constant(&self) -> bool {
        matches!(self, Self::Constant(_))
    }
}

impl From<[f64; 3]> for VectorSignal {
    fn from(value: [f64; 3]) -> Self {
        Self::Constant(value)
    }
}

/// Keyframes of N numbers: the first holds before them, the last after them.
///
/// `smooth` is the cubic through the keys whose slopes are zero at extremes and weighted harmonic means of the neighbouring
/// differences elsewhere, so that it never leaves the interval between two keys.
/// Source: [fritsch1984].
#[derive(Debug, Clone, PartialEq)]
pub struct Curve<const N: usize> {
    times: Vec<f64>,
    values: Vec<[f64; N]>,
    slopes: Vec<[f64; N]>,
    interpolation: Interpolation,
}

impl<const N: usize> Curve<N> {
    /// A curve through keys in ascending order of time.
    pub fn new(keys: Vec<(f64, [f64; N])>, interpolation: Interpolation) -> Result<Self, String> {
        if let Some(i) = keys.windows(2).position(|pair| pair[0].0 >= pair[1].0) {
            return Err(format!(
                "key {} at t = {} s is not later than the one before it, at {} s",
                i + 1,
                plain(keys[i + 1].0),
                plain(keys[i].0)
            ));
        }
        let (times, values): (Vec<f64>, Vec<[f64; N]>) = keys.into_iter().unzip();
        let difference = |i: usize, c: usize| (values[i + 1][c] - values[i][c]) / (times[i + 1] - times[i]);
        let slope = |i: usize, c: usize| {
            if i == 0 || i + 1 >= values.len() {
                return 0.0;
            }
            let (a, b) = (difference(i - 1, c), difference(i, c));
            let (h, k) = (times[i] - times[i - 1], times[i + 1] - times[i]);
            if a * b > 0.0 { 3.0 * (h + k) / ((h + 2.0 * k) / a + (2.0 * h + k) / b) } else { 0.0 }
        };
        let slopes = (0..values.len()).map(|i| std::array::from_fn(|c| slope(i, c))).collect();
        Ok(Self { times, values, slopes, interpolation })
    }

    /// The integral from a to b [s], piece by piece, each of which is a polynomial that Simpson's rule takes exactly.
    pub fn integral(&self, a: f64, b: f64) -> [f64; N] {
        let inner = self.times.iter().copied().filter(|key| *key > a && *key < b);
        let (mut sum, mut from) = ([0.0; N], a);
        for to in inner.chain([b]) {
            for (c, sum) in sum.iter_mut().enumerate() {
                *sum += match self.interpolation {
                    Interpolation::Step => (to - from) * self.value(from)[c],
                    _ => simpson(from, to, |t| self.value(t)[c]),
                };
            }
            from = to;
        }
        sum
    }

    /// The numbers at a time [s].
    pub fn value(&self, t: f64) -> [f64; N] {
        let after = self.times.partition_point(|key| *key <= t);
        let (Some(first), Some(last)) = (self.values.first(), self.values.last()) else { return [0.0; N] };
        if after == 0 {
            return *first;
        }
        if after == self.times.len() {
            return *last;
        }
        let i = after - 1;
        let (a, b, h) = (self.values[i], self.values[after], self.times[after] - self.times[i]);
        let s = (t - self.times[i]) / h;
        match self.interpolation {
            Interpolation::Step => a,
            Interpolation::Linear => std::array::from_fn(|c| a[c] + (b[c] - a[c]) * s),
            Interpolation::Smooth => {
                let (s2, s3) = (s * s, s * s * s);
                std::array::from_fn(|c| {
                    let slopes = self.slopes[i][c] * (s3 - 2.0 * s2 + s) + self.slopes[after][c] * (s3 - s2);
                    a[c] + (b[c] - a[c]) * (3.0 * s2 - 2.0 * s3) + h * slopes
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_interface::scene::{Keys, VectorKeys};

    /// Integrals by hand: keys 0 at 1 s, 2 at 2 s, 0 at 4 s hold a triangle of 3; with slope 0 at all of them a smooth curve
    /// is symmetric about the middle of each piece and holds the same; steps hold 0 and 2*2.
    #[test]
    fn keys_are_integrated_exactly() {
        let keys = |interpolation| Keys { keys: vec![[1.0, 0.0], [2.0, 2.0], [4.0, 0.0]], interpolation };
        for (interpolation, parts) in [
            (Interpolation::Linear, [0.25, 3.0, 0.5]),
            // 2 (s³ - s⁴/2) up to s = 1/2; the second piece is its mirror image, twice as wide.
            (Interpolation::Smooth, [0.1875, 3.0, 0.375]),
            (Interpolation::Step, [0.0, 4.0, 2.0]),
        ] {
            let signal = Signal::new(&Animated::Keys(keys(interpolation))).unwrap();
            let found = [signal.integral(0.0, 1.5), signal.integral(0.0, 9.0), signal.integral(3.0, 5.0)];
            for (found, exact) in found.into_iter().zip(parts) {
                assert!((found - exact).abs() < 1e-14, "{interpolation:?}: {found} {exact}");
            }
        }
    }

    #[test]
    fn keys_hold_outside_and_join_inside() {
        let words = |interpolation| Animated::Keys(Keys { keys: vec![[1.0, 2.0], [2.0, 4.0], [4.0, 5.0], [5.0, 5.0]], interpolation });
        let signal = |interpolation| Signal::new(&words(interpolation)).unwrap();
        let (linear, smooth, step) = (signal(Interpolation::Linear), signal(Interpolation::Smooth), signal(Interpolation::Step));
        for signal in [&linear, &smooth, &step] {
            assert_eq!([0.0, 1.0, 2.0, 4.0, 5.0, 9.0].map(|t| signal.value(t)), [2.0, 2.0, 4.0, 5.0, 5.0, 5.0]);
        }
        assert_eq!((linear.value(1.25), linear.value(3.0), step.value(3.9)), (2.5, 4.5, 4.0));
        // The slope at t = 2: 3*3/(5/2 + 4/(1/2)) = 6/7, from both sides; measured to 3e-7.
        let h = 1e-6;
        for slope in [(smooth.value(2.0) - smooth.value(2.0 - h)) / h, (smooth.value(2.0 + h) - smooth.value(2.0)) / h] {
            assert!((slope - 6.0 / 7.0).abs() < 1e-5, "{slope}");
        }
        let mut last = 2.0;
        for i in 0..=400 {
            let now = smooth.value(1.0 + 0.01 * f64::from(i));
            assert!(now >= last - 1e-15 && now <= 5.0, "no overshoot");
            last = now;
        }
    }

    #[test]
    fn formulas_and_keys_give_vectors() {
        let text = AnimatedVector::Formula("[1, 2*t, sin(t)]".into());
        let mixed =
            AnimatedVector::Components([Component::Value(1.0), Component::Formula("2*t".into()), Component::Formula("sin(t)".into())]);
        for words in [text, mixed] {
            let v = VectorSignal::new(&words, Of::Time).unwrap().value(0.5);
            assert!(v.x == 1.0 && v.y == 1.0 && (v.z - 0.5_f64.sin()).abs() < 1e-16);
        }
        let keys = VectorKeys { keys: vec![[0.0, 0.0, 1.0, 2.0], [2.0, 4.0, 1.0, 0.0]], interpolation: Interpolation::Linear };
        let v = VectorSignal::new(&AnimatedVector::Keys(keys), Of::Time).unwrap().value(0.5);
        assert_eq!([v.x, v.y, v.z], [1.0, 1.0, 1.5]);
    }

    #[test]
    fn faults_are_named() {
        assert!(Signal::new(&Animated::Formula("x".into())).unwrap_err().contains("unknown name \"x\""));
        let keys = Keys { keys: vec![[0.0, 1.0], [0.0, 2.0]], interpolation: Interpolation::Linear };
        assert!(Signal::new(&Animated::Keys(keys)).unwrap_err().contains("key 1 at t = 0 s"));
    }
}
