//! The turning of a bond pair in space as a vector across its axis, and what pairs with a limit make of it.
//!
//! # Equations
//! With `a± = Y±/|Y±|`, `c = a+ + a−` and the axis `t = (a+ − a−)/|a+ − a−|` of the deformed pair, the turning vector is `φ c/|c|`, across t
//! and as long as the turning angle. A plastic angle is kept as two components in the reference, so the turning vector is brought there by
//! the shortest rotation from t to the axis `t₀` of the reference:
//!
//! ```text
//! q_k = f(sin²(φ/2)) [e_k·c − (t₀·c)(e_k·n)/(|n| + t₀·n)],   n = a+ − a−,   f = (φ/2)/sin(φ/2)
//! ```
//!
//! with `e_k` two directions across `t₀`. A pair with the limit angle φ_c yields on a circle: of the elastic part `q − p` what is longer than
//! φ_c becomes plastic, along `q − p`. Its energy is the incremental potential `min over p' of a |q − p'|²/2 + a φ_c |p' − p|`, so its
//! tangent is symmetric: `a` within the circle, `a φ_c/|q − p|` along the circle and nothing across it.
//!
//! # Source
//! O'Grady 2014, 4.2.3, where pairs yield in one plane. A circle of each pair: new here.
//!
//! # Holds when
//! Sections do not spin about the axis of the beam. How much they do three points do not tell, so here they never spin: the shortest rotation has no
//! part about the axis. For pairs without plastic angles, yielding or not, and for bending that stays in one plane through the axis of
//! the reference this makes no difference, and energies do not change with any rotation. Else (moments across the plane of the plastic bend)
//! a pair takes the twisting moment `a |(q − p') × p|` about `t₀ + t` from outside, as a beam that is rigid in torsion takes it from a
//! guide; linear momentum is always kept.
//!
//! # Fails when
//! A pair points against its reference direction (turned by half a turn): there the shortest rotation is not unique.

use crate::angle::opening;
use crate::frame::V3;
use crate::pairs::Pair;
use physics::scalar::{Jet, Scalar, array};

/// Axis t₀ of a pair in the reference and two unit vectors across it.
pub type Basis = [V3; 3];

/// asin(√x)/√x with x = sin²(φ/2), and its first two derivatives.
fn over_sine_of_half(x: f64) -> [f64; 3] {
    if x < 0.02 {
        // Σ (2n)!/(4ⁿ n!² (2n + 1)) xⁿ
        const C: [f64; 14] = {
            let mut c = [1.0; 14];
            let (mut n, mut binomial) = (1, 1.0);
            while n < 14 {
                binomial *= (2 * n - 1) as f64 / (2 * n) as f64;
                c[n] = binomial / (2 * n + 1) as f64;
                n += 1;
            }
            c
        };
        let (mut value, mut slope, mut half_bend) = (0.0, 0.0, 0.0);
        for n in (0..14).rev() {
            half_bend = half_bend * x + slope;
            slope = slope * x + value;
            value = value * x + C[n];
        }
        return [value, slope, 2.0 * half_bend];
    }
    let x = x.min(1.0 - f64::EPSILON);
    let cosine = (1.0 - x).sqrt();
    let value = x.sqrt().asin() / x.sqrt();
    let slope = (1.0 / cosine - value) / (2.0 * x);
    [value, slope, (0.5 / (cosine * (1.0 - x)) - 3.0 * slope) / (2.0 * x)]
}

fn dot<S: Scalar>(a: &[f64; 3], b: &[S; 3]) -> S {
    b[0] * a[0] + b[1] * a[1] + b[2] * a[2]
}

/// Components of the turning vector along both directions of the basis.
pub fn turning(basis: &Basis, arm: &V3, plus: &V3, minus: &V3) -> [f64; 2] {
    let (x, c, a, b, ..) = opening(arm, plus, minus);
    let n: V3 = array(|k| a[k] - b[k]);
    let against = dot(&n, &n).sqrt() + dot(&basis[0], &n);
    let [f, ..] = over_sine_of_half(x);
    let tilt = dot(&basis[0], &c) / against;
    array(|k| f * (dot(&basis[1 + k], &c) - tilt * dot(&basis[1 + k], &n)))
}

/// Gradient of `g · q` with respect to both ends.
pub fn gradient<S: Scalar>(basis: &Basis, g: &[f64; 2], arm: &V3, plus: &[S; 3], minus: &[S; 3]) -> ([S; 3], [S; 3]) {
    let (x, c, a, b, la, lb) = opening(arm, plus, minus);
    let n: [S; 3] = array(|k| a[k] - b[k]);
    let along: V3 = array(|k| g[0] * basis[1][k] + g[1] * basis[2][k]);
    let axis = &basis[0];
    let size = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    let against = size + dot(axis, &n);
    let f = x.map(|x| {
        let [value, slope, _] = over_sine_of_half(x);
        (value, slope)
    });
    let slope = x.map(|x| {
        let [_, slope, bend] = over_sine_of_half(x);
        (slope, bend)
    });
    let (ac, gn) = (dot(axis, &c), dot(&along, &n));
    let (tilt, lean) = (ac / against, gn / against);
    // as if c and n were independent, with x = c²/4
    let of_sine = slope * (dot(&along, &c) - tilt * gn) * 0.5;
    let by_c: [S; 3] = array(|k| of_sine * c[k] + f * (S::of(along[k]) - lean * axis[k]));
    let by_n: [S; 3] = array(|k| f * tilt * (lean * (n[k] / size + S::of(axis[k])) - S::of(along[k])));
    // ∂a/∂Y = (1 − a a)/|Y|
    let end = |direction: &[S; 3], length: S, sign: f64| {
        let v: [S; 3] = array(|k| by_c[k] + by_n[k] * sign);
        let radial = v[0] * direction[0] + v[1] * direction[1] + v[2] * direction[2];
        array(|k| (v[k] - radial * direction[k]) / length)
    };
    (end(&a, la, 1.0), end(&b, lb, -1.0))
}

/// Second derivatives of `g · q`: components of `d+`, then of `d−`.
pub fn second(basis: &Basis, g: &[f64; 2], arm: &V3, plus: &V3, minus: &V3) -> [[f64; 6]; 6] {
    let seed = |value: f64, k: usize| Jet::<6> { value, slope: array(|j| if j == k { 1.0 } else { 0.0 }) };
    let (gp, gm) = gradient(basis, g, arm, &array(|k| seed(plus[k], k)), &array(|k| seed(minus[k], 3 + k)));
    let mut h = [[0.0; 6]; 6];
    for k in 0..3 {
        h[k] = gp[k].slope;
        h[3 + k] = gm[k].slope;
    }
    h
}

/// What a pair with a limit answers to a turning vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Energy, with what has become plastic since `before`.
    pub energy: f64,
    /// ∂E/∂q
    pub force: [f64; 2],
    /// ∂²E/∂q²
    pub tangent: [[f64; 2]; 2],
    /// Plastic part p' of the turning vector.
    pub plastic: [f64; 2],
}

/// Response of a pair at turning vector `q` with the plastic part `before`.
pub fn respond(pair: &Pair, q: [f64; 2], before: [f64; 2]) -> Response {
    let (a, limit) = (pair.stiffness, pair.limit);
    let trial = [q[0] - before[0], q[1] - before[1]];
    let size = trial[0].hypot(trial[1]);
    if size <= limit {
        let force = trial.map(|t| a * t);
        return Response { energy: 0.5 * a * size * size, force, tangent: [[a, 0.0], [0.0, a]], plastic: before };
    }
    let n = trial.map(|t| t / size);
    let elastic = n.map(|n| limit * n);
    let across = a * limit / size;
    Response {
        energy: a * limit * (size - 0.5 * limit),
        force: elastic.map(|e| a * e),
        tangent: [[across * n[1] * n[1], -across * n[0] * n[1]], [-across * n[0] * n[1], across * n[0] * n[0]]],
        plastic: [q[0] - elastic[0], q[1] - elastic[1]],
    }
}
