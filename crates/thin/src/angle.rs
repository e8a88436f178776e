//! The turning angle of a bond pair, φ = π − θ, and what it changes with.
//!
//! Ends are given relative to the centre: `Y± = ±ξ + d±`, with `d±` the displacement of the end less that of the centre. A straight pair
//! has φ = 0. All of it is computed from `d+ + d−`, which is small where little turns, so small angles keep their digits.

use physics::scalar::{Jet, Scalar, array};

/// Energy of a pair as a function of its turning angle, per unit stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Potential {
    /// φ²/2 = (π − θ)²/2
    #[default]
    Square,
    /// 1 − cos φ = 1 + cos θ
    Cosine,
}

/// How the angle follows from transverse deflections alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Kinematics {
    /// φ = (d+ + d−)/ξ: linear.
    #[default]
    Small,
    /// φ = atan(d+/ξ) + atan(d−/ξ): the exact angle between arms of unchanged projection.
    Exact,
}

/// Turning angle of a pair, its derivatives with respect to the two ends, and the second derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Turning<const D: usize> {
    /// φ
    pub angle: f64,
    /// ∂φ/∂d+
    pub plus: [f64; D],
    /// ∂φ/∂d−
    pub minus: [f64; D],
}

/// Second derivatives of φ: rows and columns are the components of `d+`, then those of `d−`; only the first `2 D` are used.
pub type Second = [[f64; 4]; 4];

/// The signed turning angle in one (transverse) or two (planar) components.
///
/// # Panics
/// For `D` other than 1 and 2.
#[inline(always)]
pub fn turning<const D: usize>(kinematics: Kinematics, arm: &[f64; 3], length: f64, plus: &[f64; D], minus: &[f64; D]) -> Turning<D> {
    if D == 1 {
        let (a, b) = (plus[0] / length, minus[0] / length);
        return match kinematics {
            Kinematics::Small => Turning { angle: (plus[0] + minus[0]) / length, plus: [1.0 / length; D], minus: [1.0 / length; D] },
            Kinematics::Exact => Turning {
                angle: a.atan() + b.atan(),
                plus: [1.0 / (length * (1.0 + a * a)); D],
                minus: [1.0 / (length * (1.0 + b * b)); D],
            },
        };
    }
    assert!(D == 2, "a signed angle needs one or two components");
    let (angle, p, m) = planar([arm[0], arm[1]], [plus[0], plus[1]], [minus[0], minus[1]]);
    Turning { angle, plus: array(|k| p[k]), minus: array(|k| m[k]) }
}

/// The second derivatives of [`turning`].
pub fn second<const D: usize>(kinematics: Kinematics, arm: &[f64; 3], length: f64, plus: &[f64; D], minus: &[f64; D]) -> Second {
    let mut h = [[0.0; 4]; 4];
    if D == 1 {
        if kinematics == Kinematics::Exact {
            for (k, d) in [plus[0], minus[0]].into_iter().enumerate() {
                let a = d / length;
                h[k][k] = -2.0 * a / (length * (1.0 + a * a)).powi(2);
            }
        }
        return h;
    }
    let seed = |value: f64, k: usize| Jet::<4> { value, slope: array(|j| if j == k { 1.0 } else { 0.0 }) };
    let p = [seed(plus[0], 0), seed(plus[1], 1)];
    let m = [seed(minus[0], 2), seed(minus[1], 3)];
    let (_, gp, gm) = planar([arm[0], arm[1]], p, m);
    for k in 0..2 {
        h[k] = gp[k].slope;
        h[2 + k] = gm[k].slope;
    }
    h
}

/// Signed angle in the plane from −Y− to Y+ and its gradient: with J a quarter turn, ∂φ/∂Y+ = J Y+/|Y+|², ∂φ/∂Y− = −J Y−/|Y−|².
#[inline(always)]
pub fn planar<S: Scalar>(arm: [f64; 2], plus: [S; 2], minus: [S; 2]) -> (S, [S; 2], [S; 2]) {
    let a: [S; 2] = array(|k| S::of(arm[k]) + plus[k]);
    let b: [S; 2] = array(|k| S::of(-arm[k]) + minus[k]);
    let sum: [S; 2] = array(|k| plus[k] + minus[k]);
    let (aa, bb) = (a[0] * a[0] + a[1] * a[1], b[0] * b[0] + b[1] * b[1]);
    // (−Y−) × Y+ with Y+ + Y− = d+ + d−
    let cross = sum[1] * a[0] - sum[0] * a[1];
    let dot = -(a[0] * b[0] + a[1] * b[1]);
    // half the angle: one branch for all |φ| < π
    let angle = (cross / ((aa * bb).sqrt() + dot)).map(|x| (x.atan(), 1.0 / (1.0 + x * x))) * 2.0;
    (angle, [-(a[1] / aa), a[0] / aa], [b[1] / bb, -(b[0] / bb)])
}

/// q = sin²(φ/2) and c = Y+/|Y+| + Y−/|Y−|, |c|² = 4 q, in space.
#[inline(always)]
pub(crate) fn opening<S: Scalar>(arm: &[f64; 3], plus: &[S; 3], minus: &[S; 3]) -> (S, [S; 3], [S; 3], [S; 3], S, S) {
    let a: [S; 3] = array(|k| S::of(arm[k]) + plus[k]);
    let b: [S; 3] = array(|k| S::of(-arm[k]) + minus[k]);
    let sum: [S; 3] = array(|k| plus[k] + minus[k]);
    let la = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
    let lb = (b[0] * b[0] + b[1] * b[1] + b[2] * b[2]).sqrt();
    // |Y+| − |Y−| = (Y+ − Y−)·(Y+ + Y−)/(|Y+| + |Y−|)
    let mut longer = S::of(0.0);
    for k in 0..3 {
        longer += (a[k] - b[k]) * sum[k];
    }
    let stretch = longer / ((la + lb) * la * lb);
    let c: [S; 3] = array(|k| sum[k] / la + b[k] * stretch);
    let q = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) * 0.25;
    (q, c, array(|k| a[k] / la), array(|k| b[k] / lb), la, lb)
}

/// φ/sin φ as a function of q = sin²(φ/2).
fn over_sine(q: f64) -> (f64, f64) {
    if q < 0.02 {
        // Σ (2n)!!/(2n+1)!! qⁿ
        const C: [f64; 12] = {
            let mut c = [1.0; 12];
            let mut n = 1;
            while n < 12 {
                c[n] = c[n - 1] * (2 * n) as f64 / (2 * n + 1) as f64;
                n += 1;
            }
            c
        };
        let (mut value, mut slope) = (0.0, 0.0);
        for n in (0..12).rev() {
            slope = slope * q + value;
            value = value * q + C[n];
        }
        return (value, slope);
    }
    let root = (q * (1.0 - q)).sqrt();
    let value = q.sqrt().min(1.0).asin() / root;
    (value, (1.0 - value * (1.0 - 2.0 * q)) / (2.0 * q * (1.0 - q)))
}

/// φ²/2 as a function of q = sin²(φ/2).
fn half_square(q: f64) -> (f64, f64) {
    let phi = 2.0 * q.sqrt().min(1.0).asin();
    // d(φ²/2)/dq = φ · 2/sin φ
    (0.5 * phi * phi, 2.0 * over_sine(q).0)
}

/// The (unsigned) turning angle in space.
pub fn spatial_angle(arm: &[f64; 3], plus: &[f64; 3], minus: &[f64; 3]) -> f64 {
    2.0 * opening(arm, plus, minus).0.sqrt().min(1.0).asin()
}

/// Energy of a pair in space per unit stiffness.
pub fn spatial_energy<S: Scalar>(potential: Potential, arm: &[f64; 3], plus: &[S; 3], minus: &[S; 3]) -> S {
    let q = opening(arm, plus, minus).0;
    match potential {
        Potential::Cosine => q * 2.0,
        Potential::Square => q.map(half_square),
    }
}

/// Gradient of [`spatial_energy`] with respect to both ends, appendix A.2 of the thesis without cross products:
/// `∂w/∂Y+ = (ψ′/sin φ)/|Y+| [y− − (y+·y−) y+]`, with `y− − (y+·y−) y+ = c − (c·c/2) y+`.
pub fn spatial_gradient<S: Scalar>(potential: Potential, arm: &[f64; 3], plus: &[S; 3], minus: &[S; 3]) -> ([S; 3], [S; 3]) {
    let (q, c, a, b, la, lb) = opening(arm, plus, minus);
    let factor = match potential {
        Potential::Cosine => S::of(1.0),
        Potential::Square => q.map(over_sine),
    };
    let half = q * 2.0;
    let (fa, fb) = (factor / la, factor / lb);
    (array(|k| fa * (c[k] - half * a[k])), array(|k| fb * (c[k] - half * b[k])))
}

/// Second derivatives of [`spatial_energy`]: components of `d+`, then of `d−`.
pub fn spatial_second(potential: Potential, arm: &[f64; 3], plus: &[f64; 3], minus: &[f64; 3]) -> [[f64; 6]; 6] {
    let seed = |value: f64, k: usize| Jet::<6> { value, slope: array(|j| if j == k { 1.0 } else { 0.0 }) };
    let (gp, gm) = spatial_gradient(potential, arm, &array(|k| seed(plus[k], k)), &array(|k| seed(minus[k], 3 + k)));
    let mut h = [[0.0; 6]; 6];
    for k in 0..3 {
        h[k] = gp[k].slope;
        h[3 + k] = gm[k].slope;
    }
    h
}
