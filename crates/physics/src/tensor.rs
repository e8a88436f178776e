//! Vectors and second-order tensors of dimension `D` over any [`Scalar`], and what a sum over bonds can add up.

use crate::scalar::{Record, Scalar, array};
use std::ops::{Add, Mul, Neg, Sub};

/// A vector of dimension `D`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector<S, const D: usize>(pub [S; D]);

/// A second-order tensor of dimension `D`, rows first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix<S, const D: usize>(pub [[S; D]; D]);

impl<S: Scalar, const D: usize> Vector<S, D> {
    /// The null vector.
    #[inline(always)]
    pub fn zero() -> Self {
        Vector([S::of(0.0); D])
    }
    /// a · b
    #[inline(always)]
    pub fn dot(self, o: Self) -> S {
        let mut r = self.0[0] * o.0[0];
        let mut k = 1;
        while k < D {
            r = self.0[k].fma(o.0[k], r);
            k += 1;
        }
        r
    }
    /// a ⊗ b
    #[inline(always)]
    pub fn outer(self, o: Self) -> Matrix<S, D> {
        Matrix(array(
            #[inline(always)]
            |a| {
                array(
                    #[inline(always)]
                    |b| self.0[a] * o.0[b],
                )
            },
        ))
    }
    /// |a|
    #[inline(always)]
    pub fn norm(self) -> S {
        self.dot(self).sqrt()
    }
}

impl<S: Scalar, const D: usize> Matrix<S, D> {
    /// The null tensor.
    #[inline(always)]
    pub fn zero() -> Self {
        Matrix([[S::of(0.0); D]; D])
    }
    /// s 1
    #[inline(always)]
    pub fn scaled_identity(s: S) -> Self {
        let mut m = Self::zero();
        for k in 0..D {
            m.0[k][k] = s;
        }
        m
    }
    /// 1
    #[inline(always)]
    pub fn identity() -> Self {
        Self::scaled_identity(S::of(1.0))
    }
    /// Aᵀ
    #[inline(always)]
    pub fn transpose(self) -> Self {
        Matrix(array(
            #[inline(always)]
            |a| {
                array(
                    #[inline(always)]
                    |b| self.0[b][a],
                )
            },
        ))
    }
    /// tr A
    #[inline(always)]
    pub fn trace(self) -> S {
        let mut r = self.0[0][0];
        for k in 1..D {
            r += self.0[k][k];
        }
        r
    }
    /// (A + Aᵀ)/2
    #[inline(always)]
    pub fn symmetric(self) -> Self {
        (self + self.transpose()) * S::of(0.5)
    }
    /// A : B
    #[inline(always)]
    pub fn double_dot(self, o: Self) -> S {
        let mut r = S::of(0.0);
        for a in 0..D {
            for b in 0..D {
                r = self.0[a][b].fma(o.0[a][b], r);
            }
        }
        r
    }
    /// det A for D ≤ 3
    #[inline(always)]
    pub fn determinant(self) -> S {
        let a = &self.0;
        match D {
            1 => a[0][0],
            2 => a[0][0] * a[1][1] - a[0][1] * a[1][0],
            _ => {
                a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) - a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0])
                    + a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0])
            }
        }
    }
    /// The cofactor tensor (det A) A⁻ᵀ for D ≤ 3: needs no division.
    #[inline(always)]
    pub fn cofactor(self) -> Self {
        let a = &self.0;
        let mut r = Self::zero();
        match D {
            1 => r.0[0][0] = S::of(1.0),
            2 => {
                r.0[0][0] = a[1][1];
                r.0[0][1] = -a[1][0];
                r.0[1][0] = -a[0][1];
                r.0[1][1] = a[0][0];
            }
            _ => {
                for i in 0..3 {
                    for j in 0..3 {
                        let (p, q, s, t) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
                        r.0[i][j] = a[p][s] * a[q][t] - a[p][t] * a[q][s];
                    }
                }
            }
        }
        r
    }
    /// A⁻¹; not finite where A is singular.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        let c = self.cofactor();
        let mut det = self.0[0][0] * c.0[0][0];
        for k in 1..D {
            det = self.0[0][k].fma(c.0[0][k], det);
        }
        c.transpose() * (S::of(1.0) / det)
    }
}

impl<S: Scalar, const D: usize> Matrix<S, D> {
    /// `A v + b`
    #[inline(always)]
    pub fn times_plus(self, v: Vector<S, D>, b: Vector<S, D>) -> Vector<S, D> {
        let mut r = b;
        for a in 0..D {
            for k in 0..D {
                r.0[a] = self.0[a][k].fma(v.0[k], r.0[a]);
            }
        }
        r
    }
    /// `self += x ⊗ y`
    #[inline(always)]
    pub fn add_outer(&mut self, x: Vector<S, D>, y: Vector<S, D>) {
        for a in 0..D {
            for b in 0..D {
                self.0[a][b] = x.0[a].fma(y.0[b], self.0[a][b]);
            }
        }
    }
}

impl<const D: usize> Matrix<f64, D> {
    /// The tensor over another number type.
    #[inline(always)]
    pub fn to<S: Scalar>(self) -> Matrix<S, D> {
        Matrix(array(
            #[inline(always)]
            |a| {
                array(
                    #[inline(always)]
                    |b| S::of(self.0[a][b]),
                )
            },
        ))
    }
    /// Eigenvalues of a symmetric tensor in ascending order (cyclic Jacobi rotations).
    pub fn eigenvalues(self) -> [f64; D] {
        let mut a = self.0;
        for _ in 0..50 {
            let scale: f64 = a.iter().flatten().fold(0.0, |m, x| m.max(x.abs()));
            let mut off = 0.0f64;
            for p in 0..D {
                for q in p + 1..D {
                    off = off.max(a[p][q].abs());
                    if a[p][q] == 0.0 {
                        continue;
                    }
                    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                    let c = 1.0 / (t * t + 1.0).sqrt();
                    let s = t * c;
                    for k in 0..D {
                        let (x, y) = (a[k][p], a[k][q]);
                        a[k][p] = c * x - s * y;
                        a[k][q] = s * x + c * y;
                    }
                    for k in 0..D {
                        let (x, y) = (a[p][k], a[q][k]);
                        a[p][k] = c * x - s * y;
                        a[q][k] = s * x + c * y;
                    }
                }
            }
            if off <= 1e-16 * scale {
                break;
            }
        }
        let mut e: [f64; D] = std::array::from_fn(|k| a[k][k]);
        e.sort_by(f64::total_cmp);
        e
    }
    /// A⁻¹ of a symmetric positive tensor, `None` where its smallest eigenvalue is below `ratio` times its largest.
    pub fn inverse_if_regular(self, ratio: f64) -> Option<Self> {
        let e = self.eigenvalues();
        // written so that a NaN is not regular
        (e[0] > ratio * e[D - 1]).then(|| self.inverse())
    }
}

impl<const D: usize> Matrix<f64, D> {
    /// Eigenvalues of a symmetric tensor, in no order, and the rotation V whose columns are the unit eigenvectors: A = V Λ Vᵀ
    /// (cyclic Jacobi rotations). Does not allocate; exact for a diagonal tensor.
    pub fn eigen(self) -> ([f64; D], Self) {
        let (mut a, mut v) = (self.0, Matrix::<f64, D>::identity().0);
        for _ in 0..50 {
            let mut turned = false;
            for p in 0..D {
                for q in p + 1..D {
                    let apq = a[p][q];
                    // written so that a NaN ends the sweeps
                    let small = apq.abs() <= 1e-18 * (a[p][p].abs() + a[q][q].abs());
                    if small || apq.is_nan() {
                        continue;
                    }
                    turned = true;
                    let theta = (a[q][q] - a[p][p]) / (2.0 * apq);
                    let t = if theta < 0.0 { -1.0 } else { 1.0 } / (theta.abs() + (theta * theta + 1.0).sqrt());
                    let c = 1.0 / (t * t + 1.0).sqrt();
                    let s = t * c;
                    for k in 0..D {
                        let (x, y) = (a[k][p], a[k][q]);
                        a[k][p] = c * x - s * y;
                        a[k][q] = s * x + c * y;
                    }
                    for k in 0..D {
                        let (x, y) = (a[p][k], a[q][k]);
                        a[p][k] = c * x - s * y;
                        a[q][k] = s * x + c * y;
                    }
                    for row in &mut v {
                        let (x, y) = (row[p], row[q]);
                        row[p] = c * x - s * y;
                        row[q] = s * x + c * y;
                    }
                }
            }
            if !turned {
                break;
            }
        }
        (array(|k| a[k][k]), Matrix(v))
    }
}

/// A symmetric tensor by its components 11, 22, 33, 23, 13, 12 (in the plane 11, 22, 12; in one dimension 11): the first
/// D(D + 1)/2 numbers, the others are never looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symmetric<S, const D: usize>(pub [S; 6]);

impl<S: Scalar, const D: usize> Symmetric<S, D> {
    /// Number of independent components.
    pub const COMPONENTS: usize = D * (D + 1) / 2;
    /// Indices of component `k`.
    #[inline(always)]
    pub const fn pair(k: usize) -> (usize, usize) {
        match (D, k) {
            (2, 2) => (0, 1),
            (_, 3) => (1, 2),
            (_, 4) => (0, 2),
            (_, 5) => (0, 1),
            _ => (k, k),
        }
    }
    /// By components.
    #[inline(always)]
    pub fn of(mut f: impl FnMut(usize, usize) -> S) -> Self {
        let mut r = [S::of(0.0); 6];
        let mut k = 0;
        while k < Self::COMPONENTS {
            let (a, b) = Self::pair(k);
            r[k] = f(a, b);
            k += 1;
        }
        Symmetric(r)
    }
    /// v ⊗ v
    #[inline(always)]
    pub fn square(v: Vector<S, D>) -> Self {
        Self::of(
            #[inline(always)]
            |a, b| v.0[a] * v.0[b],
        )
    }
    /// The components of a symmetric matrix.
    #[inline(always)]
    pub fn of_matrix(m: &Matrix<S, D>) -> Self {
        Self::of(
            #[inline(always)]
            |a, b| m.0[a][b],
        )
    }
    /// As a matrix.
    #[inline(always)]
    pub fn matrix(self) -> Matrix<S, D> {
        let mut m = Matrix::zero();
        for k in 0..Self::COMPONENTS {
            let (a, b) = Self::pair(k);
            m.0[a][b] = self.0[k];
            m.0[b][a] = self.0[k];
        }
        m
    }
    /// Σ over the components, each once.
    #[inline(always)]
    pub fn dot(self, o: Self) -> S {
        let mut r = self.0[0] * o.0[0];
        let mut k = 1;
        while k < Self::COMPONENTS {
            r = self.0[k].fma(o.0[k], r);
            k += 1;
        }
        r
    }
    /// The components of unequal indices times `s`: with √2 they become those of Mandel, whose dot product is A : B.
    #[inline(always)]
    pub fn scaled_off_diagonal(mut self, s: f64) -> Self {
        for k in D..Self::COMPONENTS {
            self.0[k] = self.0[k] * s;
        }
        self
    }
    /// Component by component.
    #[inline(always)]
    pub fn zip(self, o: Self, f: impl Fn(S, S) -> S) -> Self {
        Symmetric(array(
            #[inline(always)]
            |k| f(self.0[k], o.0[k]),
        ))
    }
}

impl<R: Scalar, const D: usize> Record<R> for Symmetric<R, D> {
    const WORDS: usize = D * (D + 1) / 2;
    #[inline(always)]
    fn word(&self, k: usize) -> R {
        self.0[k]
    }
    #[inline(always)]
    fn read(f: impl Fn(usize) -> R + Copy, at: usize) -> Self {
        Symmetric(array(
            #[inline(always)]
            |k| if k < D * (D + 1) / 2 { f(at + k) } else { R::of(0.0) },
        ))
    }
}
impl<S: Scalar, const D: usize> Linear<S> for Symmetric<S, D> {
    type Total = Symmetric<S::Sum, D>;
    #[inline(always)]
    fn nothing() -> Self {
        Symmetric([S::of(0.0); 6])
    }
    #[inline(always)]
    fn add_times(&mut self, w: S, x: Self) {
        let mut k = 0;
        while k < Self::COMPONENTS {
            self.0[k] = w.fma(x.0[k], self.0[k]);
            k += 1;
        }
    }
    #[inline(always)]
    fn total(self) -> Self::Total {
        Symmetric(array(
            #[inline(always)]
            |k| if k < D * (D + 1) / 2 { self.0[k].sum() } else { S::Sum::of(0.0) },
        ))
    }
}

/// Eigenvalues in ascending order and unit eigenvectors, one after the other, of a symmetric matrix of any size `n`, given by
/// rows (cyclic Jacobi rotations). For small matrices that are made once: it allocates.
pub fn symmetric_eigen(matrix: &[f64], n: usize) -> (Vec<f64>, Vec<f64>) {
    assert_eq!(matrix.len(), n * n, "a square matrix");
    let mut a = matrix.to_vec();
    // rows of `v` become the eigenvectors
    let mut v: Vec<f64> = (0..n * n).map(|k| if k / n == k % n { 1.0 } else { 0.0 }).collect();
    let scale = a.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    for _ in 0..60 {
        let mut off = 0.0f64;
        for p in 0..n {
            for q in p + 1..n {
                let apq = a[p * n + q];
                off = off.max(apq.abs());
                if apq == 0.0 {
                    continue;
                }
                let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
                let t = if theta < 0.0 { -1.0 } else { 1.0 } / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..n {
                    let (x, y) = (a[k * n + p], a[k * n + q]);
                    a[k * n + p] = c * x - s * y;
                    a[k * n + q] = s * x + c * y;
                }
                for m in [&mut a, &mut v] {
                    for k in 0..n {
                        let (x, y) = (m[p * n + k], m[q * n + k]);
                        m[p * n + k] = c * x - s * y;
                        m[q * n + k] = s * x + c * y;
                    }
                }
            }
        }
        if off <= 1e-17 * scale {
            break;
        }
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| a[i * n + i].total_cmp(&a[j * n + j]));
    (order.iter().map(|&i| a[i * n + i]).collect(), order.iter().flat_map(|&i| v[i * n..(i + 1) * n].to_vec()).collect())
}

impl<S: Scalar, const D: usize> Add for Vector<S, D> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Vector(array(
            #[inline(always)]
            |k| self.0[k] + o.0[k],
        ))
    }
}
impl<S: Scalar, const D: usize> Sub for Vector<S, D> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Vector(array(
            #[inline(always)]
            |k| self.0[k] - o.0[k],
        ))
    }
}
impl<S: Scalar, const D: usize> Neg for Vector<S, D> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Vector(array(
            #[inline(always)]
            |k| -self.0[k],
        ))
    }
}
impl<S: Scalar, const D: usize> Mul<S> for Vector<S, D> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: S) -> Self {
        Vector(array(
            #[inline(always)]
            |k| self.0[k] * s,
        ))
    }
}
macro_rules! entrywise {
    ($trait:ident, $f:ident) => {
        impl<S: Scalar, const D: usize> $trait for Matrix<S, D> {
            type Output = Self;
            #[inline(always)]
            fn $f(self, o: Self) -> Self {
                Matrix(array(
                    #[inline(always)]
                    |a| {
                        array(
                            #[inline(always)]
                            |b| self.0[a][b].$f(o.0[a][b]),
                        )
                    },
                ))
            }
        }
    };
}
entrywise!(Add, add);
entrywise!(Sub, sub);
impl<S: Scalar, const D: usize> Mul<S> for Matrix<S, D> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: S) -> Self {
        Matrix(array(
            #[inline(always)]
            |a| {
                array(
                    #[inline(always)]
                    |b| self.0[a][b] * s,
                )
            },
        ))
    }
}
impl<S: Scalar, const D: usize> Mul for Matrix<S, D> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        let t = o.transpose();
        Matrix(array(
            #[inline(always)]
            |a| {
                array(
                    #[inline(always)]
                    |b| Vector(self.0[a]).dot(Vector(t.0[b])),
                )
            },
        ))
    }
}
impl<S: Scalar, const D: usize> Mul<Vector<S, D>> for Matrix<S, D> {
    type Output = Vector<S, D>;
    #[inline(always)]
    fn mul(self, v: Vector<S, D>) -> Vector<S, D> {
        Vector(array(
            #[inline(always)]
            |a| Vector(self.0[a]).dot(v),
        ))
    }
}

impl<R: Scalar, const D: usize> Record<R> for Vector<R, D> {
    const WORDS: usize = D;
    #[inline(always)]
    fn word(&self, k: usize) -> R {
        self.0[k]
    }
    #[inline(always)]
    fn read(f: impl Fn(usize) -> R + Copy, at: usize) -> Self {
        Vector(array(
            #[inline(always)]
            |k| f(at + k),
        ))
    }
}
impl<R: Scalar, const D: usize> Record<R> for Matrix<R, D> {
    const WORDS: usize = D * D;
    #[inline(always)]
    fn word(&self, k: usize) -> R {
        self.0[k / D][k % D]
    }
    #[inline(always)]
    fn read(f: impl Fn(usize) -> R + Copy, at: usize) -> Self {
        Matrix(array(
            #[inline(always)]
            |a| {
                array(
                    #[inline(always)]
                    |b| f(at + a * D + b),
                )
            },
        ))
    }
}

/// What [`Family::integrate`](crate::family::Family::integrate) can add up over bonds.
pub trait Linear<S: Scalar>: Copy {
    /// The sum over all bonds.
    type Total: Copy;
    /// Zero.
    fn nothing() -> Self;
    /// `self += w x`
    fn add_times(&mut self, w: S, x: Self);
    /// The sum over the lanes.
    fn total(self) -> Self::Total;
}
impl<S: Scalar> Linear<S> for S {
    type Total = S::Sum;
    #[inline(always)]
    fn nothing() -> S {
        S::of(0.0)
    }
    #[inline(always)]
    fn add_times(&mut self, w: S, x: S) {
        *self = w.fma(x, *self);
    }
    #[inline(always)]
    fn total(self) -> S::Sum {
        self.sum()
    }
}
impl<S: Scalar, const D: usize> Linear<S> for Vector<S, D> {
    type Total = Vector<S::Sum, D>;
    #[inline(always)]
    fn nothing() -> Self {
        Vector::zero()
    }
    #[inline(always)]
    fn add_times(&mut self, w: S, x: Self) {
        for k in 0..D {
            self.0[k] = w.fma(x.0[k], self.0[k]);
        }
    }
    #[inline(always)]
    fn total(self) -> Self::Total {
        Vector(array(
            #[inline(always)]
            |k| self.0[k].sum(),
        ))
    }
}
impl<S: Scalar, const D: usize> Linear<S> for Matrix<S, D> {
    type Total = Matrix<S::Sum, D>;
    #[inline(always)]
    fn nothing() -> Self {
        Matrix::zero()
    }
    #[inline(always)]
    fn add_times(&mut self, w: S, x: Self) {
        for a in 0..D {
            for b in 0..D {
                self.0[a][b] = w.fma(x.0[a][b], self.0[a][b]);
            }
        }
    }
    #[inline(always)]
    fn total(self) -> Self::Total {
        Matrix(array(
            #[inline(always)]
            |a| {
                array(
                    #[inline(always)]
                    |b| self.0[a][b].sum(),
                )
            },
        ))
    }
}
impl<S: Scalar, A: Linear<S>, B: Linear<S>> Linear<S> for (A, B) {
    type Total = (A::Total, B::Total);
    #[inline(always)]
    fn nothing() -> Self {
        (A::nothing(), B::nothing())
    }
    #[inline(always)]
    fn add_times(&mut self, w: S, x: Self) {
        self.0.add_times(w, x.0);
        self.1.add_times(w, x.1);
    }
    #[inline(always)]
    fn total(self) -> Self::Total {
        (self.0.total(), self.1.total())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_of_a_known_tensor() {
        let a = Matrix([[2.0, 1.0, 0.0], [0.0, 4.0, -1.0], [3.0, 0.0, 1.0]]);
        assert_eq!(a.determinant(), 5.0);
        // adjugate by hand
        let want = [[0.8, -0.2, -0.2], [-0.6, 0.4, 0.4], [-2.4, 0.6, 1.6]];
        for i in 0..3 {
            for j in 0..3 {
                assert!((a.inverse().0[i][j] - want[i][j]).abs() < 1e-15);
            }
        }
        assert_eq!(Matrix([[4.0]]).inverse().0[0][0], 0.25);
    }

    #[test]
    fn eigenvalues_of_known_tensors() {
        assert_eq!(Matrix([[3.0, 0.0], [0.0, 1.0]]).eigenvalues(), [1.0, 3.0]);
        // the second difference matrix: 2 − √2, 2, 2 + √2
        let e = Matrix([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]]).eigenvalues();
        for (x, y) in e.iter().zip([2.0 - 2f64.sqrt(), 2.0, 2.0 + 2f64.sqrt()]) {
            assert!((x - y).abs() < 1e-15 * 4.0);
        }
        assert!(Matrix([[1.0, 1.0], [1.0, 1.0]]).inverse_if_regular(1e-10).is_none());
        assert!(Matrix([[f64::NAN, 1.0], [1.0, 1.0]]).inverse_if_regular(1e-10).is_none());
    }

    #[test]
    fn eigenvectors_without_allocation() {
        let a = Matrix([[2.0, -1.0, 0.5], [-1.0, 2.0, -1.0], [0.5, -1.0, 3.0]]);
        let (e, v) = a.eigen();
        for k in 0..3 {
            let x = Vector([v.0[0][k], v.0[1][k], v.0[2][k]]);
            assert!((x.norm() - 1.0).abs() < 1e-15);
            assert!((a * x - x * e[k]).norm() < 1e-15 * 6.0, "{k}");
        }
        assert_eq!(Matrix([[3.0, 0.0], [0.0, 1.0]]).eigen(), ([3.0, 1.0], Matrix::identity()));
        assert!(Matrix([[f64::NAN, 1.0], [1.0, f64::NAN]]).eigen().0[0].is_nan());
    }

    #[test]
    fn eigenpairs_of_the_second_difference_matrix() {
        // of size n: 2 − 2 cos(kπ/(n + 1)), components sin(jkπ/(n + 1))
        let n = 15;
        let at = |i: usize, j: usize| if i == j { 2.0 } else { -((i.abs_diff(j) == 1) as u8 as f64) };
        let matrix: Vec<f64> = (0..n * n).map(|k| at(k / n, k % n)).collect();
        let (values, vectors) = symmetric_eigen(&matrix, n);
        for k in 0..n {
            let angle = std::f64::consts::PI * (k + 1) as f64 / (n + 1) as f64;
            assert!((values[k] - (2.0 - 2.0 * angle.cos())).abs() < 2e-15 * 4.0, "{k}");
            let norm = ((n + 1) as f64 / 2.0).sqrt();
            let sign = vectors[k * n].signum();
            for j in 0..n {
                assert!((sign * vectors[k * n + j] - (angle * (j + 1) as f64).sin() / norm).abs() < 1e-14, "{k} {j}");
            }
        }
        // a double eigenvalue and a null vector
        let (values, _) = symmetric_eigen(&[1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 2.0], 3);
        for (x, y) in values.iter().zip([0.0, 2.0, 2.0]) {
            assert!((x - y).abs() < 1e-15);
        }
    }
}
