//! Influence functions ω.
//!
//! Inside a model there are two kinds only: [`One`], which costs nothing, and [`Stored`], a number per bond evaluated
//! when the body is made. Any function of the bond, partial volumes and weight corrections are of the second kind, so
//! the hot loop neither branches on a name nor evaluates an exponential.

use crate::family::Undeformed;
use crate::scalar::Scalar;

/// The influence function of a model.
pub trait Influence: Copy + Send + Sync + 'static {
    /// Whether the bonds must store their influence.
    const STORED: bool;
    /// ω of a bond.
    fn at<S: Scalar, const D: usize>(&self, b: impl Undeformed<S, D>) -> S;
}

/// ω = 1
#[derive(Clone, Copy, Debug)]
pub struct One;
impl Influence for One {
    const STORED: bool = false;
    #[inline(always)]
    fn at<S: Scalar, const D: usize>(&self, _: impl Undeformed<S, D>) -> S {
        S::of(1.0)
    }
}

/// ω stored with the bond.
#[derive(Clone, Copy, Debug)]
pub struct Stored;
impl Influence for Stored {
    const STORED: bool = true;
    #[inline(always)]
    fn at<S: Scalar, const D: usize>(&self, b: impl Undeformed<S, D>) -> S {
        b.weight()
    }
}

/// The named radial influence functions; r = |ξ|, δ the horizon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radial {
    /// 1
    Constant,
    /// δ/r
    InverseLength,
    /// 1 − r/δ
    Cone,
    /// exp(−(r/(width δ))²)
    Gaussian {
        /// Width relative to the horizon.
        width: f64,
    },
    /// Cubic B-spline with support δ, 1 at r = 0.
    CubicSpline,
}

impl Radial {
    /// ω, dimensionless.
    pub fn at(self, r: f64, delta: f64) -> f64 {
        let q = r / delta;
        match self {
            Radial::Constant => 1.0,
            Radial::InverseLength => 1.0 / q,
            // a bond on the rim of the closed ball keeps a weight of round-off size at most: never negative
            Radial::Cone => (1.0 - q).max(0.0),
            Radial::Gaussian { width } => (-(q / width) * (q / width)).exp(),
            Radial::CubicSpline if q < 0.5 => 1.0 - 6.0 * q * q * (1.0 - q),
            Radial::CubicSpline => 2.0 * (1.0 - q).max(0.0).powi(3),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_functions_at_known_places() {
        assert_eq!(Radial::InverseLength.at(0.5, 2.0), 4.0);
        assert_eq!(Radial::Cone.at(0.5, 2.0), 0.75);
        assert!((Radial::Gaussian { width: 0.5 }.at(0.5, 1.0) - 0.367_879_441_171_442_3).abs() < 1e-16);
        // the two pieces of the spline meet with value 1/4 and slope −3/2
        assert_eq!(Radial::CubicSpline.at(0.5, 1.0), 0.25);
        let h = 1e-6;
        for s in [-1.0, 1.0] {
            let slope = s * (Radial::CubicSpline.at(0.5 + s * h, 1.0) - 0.25) / h;
            assert!((slope + 1.5).abs() < 1e-5);
        }
        assert_eq!(Radial::CubicSpline.at(1.0, 1.0), 0.0);
    }
}
