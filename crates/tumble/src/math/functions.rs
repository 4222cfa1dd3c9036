//! Transcendental functions with the same bits on every machine (the standard library's differ between platforms).

/// sin x.
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// cos x.
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// The angle of the point (x, y), in (-pi, pi].
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// arc cosine.
pub fn acos(x: f64) -> f64 {
    libm::acos(x)
}

/// arc sine.
pub fn asin(x: f64) -> f64 {
    libm::asin(x)
}

/// e^x.
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Natural logarithm.
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// x^y.
pub fn pow(x: f64, y: f64) -> f64 {
    libm::pow(x, y)
}

/// Hyperbolic cosine.
pub fn cosh(x: f64) -> f64 {
    libm::cosh(x)
}

/// Hyperbolic sine.
pub fn sinh(x: f64) -> f64 {
    libm::sinh(x)
}

/// Inverse hyperbolic sine.
pub fn asinh(x: f64) -> f64 {
    libm::asinh(x)
}

/// tan x.
pub fn tan(x: f64) -> f64 {
    libm::tan(x)
}

/// arc tangent.
pub fn atan(x: f64) -> f64 {
    libm::atan(x)
}

/// Decimal logarithm.
pub fn log10(x: f64) -> f64 {
    libm::log10(x)
}

/// Hyperbolic tangent.
pub fn tanh(x: f64) -> f64 {
    libm::tanh(x)
}

/// The largest whole number that is not above x.
pub fn floor(x: f64) -> f64 {
    libm::floor(x)
}
