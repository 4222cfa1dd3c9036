//! Functions of formulas. Every function has the same bits on every machine.

use crate::math::functions;

/// A function of up to three numbers.
#[derive(Clone, Copy)]
pub enum Function {
    /// Of one.
    One(fn(f64) -> f64),
    /// Of two.
    Two(fn(f64, f64) -> f64),
    /// Of two or more, taken in pairs from the left.
    Fold(fn(f64, f64) -> f64),
    /// Of three.
    Three(fn(f64, f64, f64) -> f64),
}

/// All functions, by name.
pub const FUNCTIONS: [(&str, Function); 28] = [
    ("sin", Function::One(functions::sin)),
    ("cos", Function::One(functions::cos)),
    ("tan", Function::One(functions::tan)),
    ("asin", Function::One(functions::asin)),
    ("acos", Function::One(functions::acos)),
    ("atan", Function::One(functions::atan)),
    ("atan2", Function::Two(functions::atan2)),
    ("sinh", Function::One(functions::sinh)),
    ("cosh", Function::One(functions::cosh)),
    ("tanh", Function::One(functions::tanh)),
    ("exp", Function::One(functions::exp)),
    ("ln", Function::One(functions::ln)),
    ("log10", Function::One(functions::log10)),
    ("sqrt", Function::One(f64::sqrt)),
    ("abs", Function::One(f64::abs)),
    ("floor", Function::One(functions::floor)),
    ("ceil", Function::One(|x| -functions::floor(-x))),
    ("sign", Function::One(sign)),
    ("pow", Function::Two(functions::pow)),
    ("hypot", Function::Fold(|a, b| (a * a + b * b).sqrt())),
    ("min", Function::Fold(f64::min)),
    ("max", Function::Fold(f64::max)),
    ("mod", Function::Two(|a, b| a - b * functions::floor(a / b))),
    ("step", Function::Two(|edge, x| if x < edge { 0.0 } else { 1.0 })),
    ("smoothstep", Function::Three(smoothstep)),
    ("clamp", Function::Three(|x, low, high| x.max(low).min(high))),
    ("mix", Function::Three(|a, b, s| a + (b - a) * s)),
    ("if", Function::Three(|holds, yes, no| if holds != 0.0 { yes } else { no })),
];

/// Comparisons, 1 where they hold and 0 where they do not.
pub const COMPARISONS: [(&str, fn(f64, f64) -> f64); 6] = [
    ("<=", |a, b| f64::from(u8::from(a <= b))),
    (">=", |a, b| f64::from(u8::from(a >= b))),
    ("==", |a, b| f64::from(u8::from(a == b))),
    ("!=", |a, b| f64::from(u8::from(a != b))),
    ("<", |a, b| f64::from(u8::from(a < b))),
    (">", |a, b| f64::from(u8::from(a > b))),
];

/// Constants, by name.
pub const CONSTANTS: [(&str, f64); 2] = [("pi", std::f64::consts::PI), ("e", std::f64::consts::E)];

/// -1, 0 or 1.
fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x
    }
}

/// 0 below a, 1 above b, and a cubic between them.
fn smoothstep(a: f64, b: f64, x: f64) -> f64 {
    let s = ((x - a) / (b - a)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}
