//! Normals of deformed surfaces, and the change of normal curvature of their bond pairs.
//!
//! # Equations
//! The tangents of a point are sums over the bonds of its family, `a = Σ α_j Y_j`, `b = Σ β_j Y_j`, with weights of the reference that give the
//! tangents of the reference and reproduce linear (and where the family allows it quadratic) fields. Its normal is
//! `n = a × b/|a × b|`, a smooth function of the points that turns with them. A pair of arms s along the surface has the angle
//!
//! ```text
//! φ = [n·(Y+ + Y−) − n₀·(Y+ + Y−)₀]/s
//! ```
//!
//! so φ/s is the change of normal curvature. Its linear part is `n₀·(u+ + u− − 2u)/s`, as Y+ + Y− of a geodesic pair lies along the
//! normal. A rigid rotation turns n and Y alike and has no angle. In a plane, `b` is fixed and normal to it.
//!
//! # Source
//! O'Grady 2014, 5.2.1, with reference curvature as a normal component; the finite form and its normal are ours.
//!
//! # Differs from the classical measure
//! By strain over radius: a uniformly inflated sphere has φ/s = ε/R.

use physics::scalar::{Jet, Scalar, array};

pub(crate) type V3 = [f64; 3];

#[inline(always)]
pub(crate) fn dot<S: Scalar>(a: &[S; 3], b: &[S; 3]) -> S {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
#[inline(always)]
pub(crate) fn cross<S: Scalar>(a: &[S; 3], b: &[S; 3]) -> [S; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
#[inline(always)]
pub(crate) fn sub(a: &V3, b: &V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
#[inline(always)]
pub(crate) fn add_scaled(a: &V3, s: f64, b: &V3) -> V3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}
#[inline(always)]
pub(crate) fn norm(a: &V3) -> f64 {
    dot(a, a).sqrt()
}
/// The vector over its length; unchanged where it has none.
pub(crate) fn unit(a: &V3) -> V3 {
    let l = norm(a);
    if l > 0.0 { a.map(|x| x / l) } else { *a }
}

/// A bond that enters the tangents of its point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameBond {
    /// Its end.
    pub end: u32,
    /// Weights α, β in both tangents (1/length).
    pub weights: [f64; 2],
}

/// Arms of a pair that is bent in the reference, and its angle there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// Y+ in the reference.
    pub plus: V3,
    /// Y− in the reference.
    pub minus: V3,
    /// Turning angle in the reference.
    pub angle: f64,
}

/// The frames of all points.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    /// Start of the bonds of each point, and the end of the last.
    pub(crate) starts: Vec<usize>,
    pub(crate) bonds: Vec<FrameBond>,
    /// Tangents a, b in the reference; none where the pairs of a point are those of a flat body, measured by their angle as a vector.
    pub(crate) tangents: Vec<Option<[V3; 2]>>,
    /// Y+ + Y− of each pair in the reference.
    pub(crate) chords: Vec<V3>,
    /// Pairs measured by their angle less that of the reference, where the body was asked to; else empty.
    pub(crate) bends: Vec<Option<Bend>>,
}

/// n − n₀ from the changes of both tangents, with all digits of small changes; and n, |a × b|.
#[inline(always)]
pub(crate) fn turned<S: Scalar>(reference: &[V3; 2], da: &[S; 3], db: &[S; 3]) -> ([S; 3], [S; 3], S) {
    let (a, b): ([S; 3], [S; 3]) = (array(|k| S::of(reference[0][k])), array(|k| S::of(reference[1][k])));
    let n0 = cross(&reference[0], &reference[1]);
    let l0 = norm(&n0);
    let (x, y, z) = (cross(da, &b), cross(&a, db), cross(da, db));
    let dn: [S; 3] = array(|k| x[k] + y[k] + z[k]);
    let whole: [S; 3] = array(|k| S::of(n0[k]) + dn[k]);
    let length = dot(&whole, &whole).sqrt();
    // 1/l − 1/l₀ = −(N − N₀)·(N + N₀)/(l l₀ (l + l₀))
    let both: [S; 3] = array(|k| whole[k] + S::of(n0[k]));
    let inverse = -(dot(&dn, &both) / (length * (length + S::of(l0)) * l0));
    let change = array(|k| dn[k] / length + inverse * n0[k]);
    (change, array(|k| whole[k] / length), length)
}

/// Gradient of `q·n` with respect to both tangents.
#[inline(always)]
pub(crate) fn normal_gradient<S: Scalar>(reference: &[V3; 2], da: &[S; 3], db: &[S; 3], q: &V3) -> [[S; 3]; 2] {
    let a: [S; 3] = array(|k| S::of(reference[0][k]) + da[k]);
    let b: [S; 3] = array(|k| S::of(reference[1][k]) + db[k]);
    let whole = cross(&a, &b);
    let length = dot(&whole, &whole).sqrt();
    let n: [S; 3] = array(|k| whole[k] / length);
    let q: [S; 3] = array(|k| S::of(q[k]));
    let along = dot(&q, &n);
    let p: [S; 3] = array(|k| (q[k] - n[k] * along) / length);
    // dN = da × b + a × db
    [cross(&b, &p), cross(&p, &a)]
}

/// Second derivatives of `q·n`: components of a, then of b.
pub(crate) fn normal_second(reference: &[V3; 2], da: &V3, db: &V3, q: &V3) -> [[f64; 6]; 6] {
    let seed = |v: &V3, at: usize| -> [Jet<6>; 3] { array(|k| Jet { value: v[k], slope: array(|j| if j == at + k { 1.0 } else { 0.0 }) }) };
    let [ga, gb] = normal_gradient(reference, &seed(da, 0), &seed(db, 3), q);
    array(|i| if i < 3 { ga[i].slope } else { gb[i - 3].slope })
}

/// Turning angle of a pair with arms of their own, and its gradient with respect to both ends: signed in a plane (two components), between 0
/// and π in space (smooth where it is not zero).
#[inline(always)]
pub(crate) fn bent<S: Scalar>(planar: bool, bend: &Bend, plus: &[S; 3], minus: &[S; 3]) -> (S, [S; 3], [S; 3]) {
    let a: [S; 3] = array(|k| S::of(bend.plus[k]) + plus[k]);
    let b: [S; 3] = array(|k| S::of(bend.minus[k]) + minus[k]);
    let (aa, bb) = (dot(&a, &a), dot(&b, &b));
    let zero = S::of(0.0);
    if planar {
        // from −Y− to Y+, by half the angle: one branch for all |φ| < π
        let (across, along) = (a[0] * b[1] - a[1] * b[0], -dot(&a, &b));
        let angle = (across / ((aa * bb).sqrt() + along)).map(|x| (x.atan(), 1.0 / (1.0 + x * x))) * 2.0;
        return (angle, [-(a[1] / aa), a[0] / aa, zero], [b[1] / bb, -(b[0] / bb), zero]);
    }
    let (la, lb) = (aa.sqrt(), bb.sqrt());
    let (ya, yb): ([S; 3], [S; 3]) = (array(|k| a[k] / la), array(|k| b[k] / lb));
    let c: [S; 3] = array(|k| ya[k] + yb[k]);
    let half = dot(&c, &c).sqrt() * 0.5;
    let angle = half.map(|x| (2.0 * x.min(1.0).asin(), 2.0 / (1.0 - x * x).max(1e-300).sqrt()));
    let cosine = dot(&ya, &yb);
    // sin φ = 2 sin(φ/2) cos(φ/2)
    let sine = half * (S::of(1.0) - half * half).sqrt() * 2.0;
    let ga = array(|k| (yb[k] - cosine * ya[k]) / (sine * la));
    let gb = array(|k| (ya[k] - cosine * yb[k]) / (sine * lb));
    (angle, ga, gb)
}

/// Second derivatives of the angle of [`bent`]: components of the plus end, then of the minus end.
pub(crate) fn bent_second(planar: bool, bend: &Bend, plus: &V3, minus: &V3) -> [[f64; 6]; 6] {
    let seed = |v: &V3, at: usize| -> [Jet<6>; 3] { array(|k| Jet { value: v[k], slope: array(|j| if j == at + k { 1.0 } else { 0.0 }) }) };
    let (_, ga, gb) = bent(planar, bend, &seed(plus, 0), &seed(minus, 3));
    array(|i| if i < 3 { ga[i].slope } else { gb[i - 3].slope })
}

impl Frames {
    /// Arms and angle of a pair that is measured by its angle.
    #[inline(always)]
    pub(crate) fn bend(&self, pair: usize) -> Option<&Bend> {
        self.bends.get(pair).and_then(Option::as_ref)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_of_bent_pairs() {
        let bend = |p: V3, m: V3| Bend { plus: p, minus: m, angle: 0.0 };
        // a right angle, in a plane and in space
        let right = bend([1.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
        let zero = [0.0; 3];
        for planar in [true, false] {
            let (angle, ..) = bent(planar, &right, &zero, &zero);
            assert!((angle.abs() - std::f64::consts::FRAC_PI_2).abs() < 1e-15, "{angle}");
        }
        // gradients against differences
        let b = bend([1.0, 0.2, -0.1], [-0.7, 0.5, 0.3]);
        for planar in [true, false] {
            let (_, ga, gb) = bent(planar, &b, &zero, &zero);
            for k in 0..if planar { 2 } else { 3 } {
                let mut d = zero;
                d[k] = 1e-6;
                let minus = d.map(|x| -x);
                let difference = |f: &dyn Fn(&V3) -> f64| (f(&d) - f(&minus)) / 2e-6;
                // the planar angle leaves third components out
                let b = if planar { bend([1.0, 0.2, 0.0], [-0.7, 0.5, 0.0]) } else { b };
                let (ga, gb) = if planar {
                    let (_, ga, gb) = bent(true, &b, &zero, &zero);
                    (ga, gb)
                } else {
                    (ga, gb)
                };
                assert!((difference(&|x| bent(planar, &b, x, &zero).0) - ga[k]).abs() < 1e-8);
                assert!((difference(&|x| bent(planar, &b, &zero, x).0) - gb[k]).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn normals_turn() {
        let reference = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let (da, db) = ([0.1, 0.05, 0.2], [-0.03, 0.1, 0.4]);
        let (change, n, _) = turned(&reference, &da, &db);
        let expected = unit(&cross(&[1.1, 0.05, 0.2], &[-0.03, 1.1, 0.4]));
        for k in 0..3 {
            assert!((n[k] - expected[k]).abs() < 1e-15);
            assert!((change[k] - (expected[k] - [0.0, 0.0, 1.0][k])).abs() < 1e-15);
        }
        let q = [0.3, -0.7, 0.9];
        let g = normal_gradient(&reference, &da, &db, &q);
        let h = normal_second(&reference, &da, &db, &q);
        for k in 0..6 {
            let shift = |s: f64| {
                let (mut a, mut b) = (da, db);
                if k < 3 {
                    a[k] += s
                } else {
                    b[k - 3] += s
                }
                (a, b)
            };
            let e = 1e-6;
            let ((ap, bp), (am, bm)) = (shift(e), shift(-e));
            let value = |a: &V3, b: &V3| dot(&q, &turned(&reference, a, b).1);
            let slope = (value(&ap, &bp) - value(&am, &bm)) / (2.0 * e);
            assert!((slope - g[k / 3][k % 3]).abs() < 1e-9);
            let (gp, gm) = (normal_gradient(&reference, &ap, &bp, &q), normal_gradient(&reference, &am, &bm, &q));
            for j in 0..6 {
                assert!(((gp[j / 3][j % 3] - gm[j / 3][j % 3]) / (2.0 * e) - h[j][k]).abs() < 1e-8);
            }
        }
    }
}
