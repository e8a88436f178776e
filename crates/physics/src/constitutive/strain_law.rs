//! Laws of a strain and its conjugate stress, and the way from a deformation gradient to them.

use super::{Deformation, Law, LinearElastic, linear_elastic};
use crate::elasticity::Stiffness;
use crate::scalar::{Scalar, array};
use crate::tensor::Matrix;

/// What a law of the strain may know of a point.
#[derive(Clone, Copy, Debug)]
pub struct Strain<'a, R, const D: usize> {
    /// The strain, symmetric, of whatever measure: small, Green–Lagrange, logarithmic, or a nonlocal one.
    pub tensor: Matrix<R, D>,
    /// Temperature change against the reference \[K\].
    pub temperature: f64,
    /// Committed history: [`StrainLaw::MEMORY`] words.
    pub memory: &'a [f64],
}

/// A law that needs a strain only: energy density ψ(E) and the conjugate stress ∂ψ/∂E of the section.
///
/// With history, ψ is the incremental potential at fixed history, whose words are all zeros in the reference state.
pub trait StrainLaw<const D: usize>: Copy + Send + Sync + 'static {
    /// Words of history.
    const MEMORY: usize = 0;
    /// The constants at a point.
    type Constants: Copy + Send + Sync + 'static;
    /// The stiffness at small strain.
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D>;
    /// The stress conjugate to the strain \[Pa\].
    fn stress<R: Scalar>(&self, c: &Self::Constants, e: &Strain<R, D>) -> Matrix<R, D>;
    /// Energy density ψ \[J/m³\].
    fn energy<R: Scalar>(&self, c: &Self::Constants, e: &Strain<R, D>) -> R;
    /// Stress across the plane in plane strain, zero else \[Pa\]. The default is that of linear elasticity with the law's stiffness.
    fn out_of_plane_stress(&self, c: &Self::Constants, e: &Strain<f64, D>) -> f64 {
        self.stiffness(c).out_of_plane_stress(&self.stress(c, e), e.temperature)
    }
    /// Writes the history of an accepted increment, given in `memory` what [`Strain::memory`] holds.
    fn commit(&self, _: &Self::Constants, _: &Strain<f64, D>, _memory: &mut [f64]) {}
}

impl<const D: usize> StrainLaw<D> for LinearElastic {
    type Constants = Stiffness<D>;
    fn stiffness(&self, c: &Stiffness<D>) -> Stiffness<D> {
        *c
    }
    #[inline(always)]
    fn stress<R: Scalar>(&self, c: &Stiffness<D>, e: &Strain<R, D>) -> Matrix<R, D> {
        linear_elastic::stress(c, &e.tensor, e.temperature)
    }
    #[inline(always)]
    fn energy<R: Scalar>(&self, c: &Stiffness<D>, e: &Strain<R, D>) -> R {
        linear_elastic::energy(c, &e.tensor, e.temperature)
    }
}

/// The strain of a deformation gradient that a [`StrainLaw`] is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StrainMeasure {
    /// ε = sym(F − 1), small rotations only; P = σ.
    Small,
    /// E = (FᵀF − 1)/2; P = F S.
    GreenLagrange,
    /// E = ½ ln FᵀF (Hencky); P = F (σ : 2 ∂E/∂C), exact at equal principal stretches too.
    Logarithmic,
}

/// A law of F made of a law of the strain.
///
/// # Equations
/// ψ(F) = ψ̂(E(F)), P = ∂ψ̂/∂E : ∂E/∂F. In plane stress and in a bar the stress conjugate to the transverse strain vanishes, which for
/// each measure means that the transverse stress does.
///
/// # Source
/// Logarithmic strain with plastic strain subtracted: Miehe, Apel & Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002)
/// 5383–5425. Derivatives of tensor functions by divided differences: Carlson & Hoger, Quart. Appl. Math. 44 (1986) 409–423.
///
/// # Holds when
/// rotations are small, or the measure is not `Small`.
///
/// # Differs from the source
/// Principal axes are those of the value; the derivatives that a jet carries enter through first and second divided differences of the
/// logarithm there, which are smooth functions at equal stretches.
#[derive(Clone, Copy, Debug)]
pub struct OfStrain<L>(pub L);

/// Constants of [`OfStrain`].
#[derive(Clone, Copy, Debug)]
pub struct OfStrainConstants<C> {
    /// Which strain.
    pub measure: StrainMeasure,
    /// The constants of the law of the strain.
    pub law: C,
}

impl<L> OfStrain<L> {
    #[inline(always)]
    fn strain<'a, R: Scalar, const D: usize>(f: &Deformation<'a, R, D>, tensor: Matrix<R, D>) -> Strain<'a, R, D> {
        Strain { tensor, temperature: f.temperature, memory: f.memory }
    }
    /// The strain of the measure.
    #[inline(always)]
    fn of<'a, R: Scalar, const D: usize>(measure: StrainMeasure, f: &Deformation<'a, R, D>) -> Strain<'a, R, D> {
        let tensor = match measure {
            StrainMeasure::Small => f.small_strain(),
            StrainMeasure::GreenLagrange => f.green_lagrange(),
            StrainMeasure::Logarithmic => Logarithm::new(f.green_lagrange()).strain(),
        };
        Self::strain(f, tensor)
    }
}

impl<L: StrainLaw<D>, const D: usize> Law<D> for OfStrain<L> {
    const MEMORY: usize = L::MEMORY;
    type Constants = OfStrainConstants<L::Constants>;
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D> {
        self.0.stiffness(&c.law)
    }
    #[inline(never)]
    fn first_piola<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> Matrix<R, D> {
        match c.measure {
            StrainMeasure::Small => self.0.stress(&c.law, &Self::strain(f, f.small_strain())),
            StrainMeasure::GreenLagrange => f.f() * self.0.stress(&c.law, &Self::strain(f, f.green_lagrange())),
            StrainMeasure::Logarithmic => {
                let log = Logarithm::new(f.green_lagrange());
                f.f() * log.pull_back(self.0.stress(&c.law, &Self::strain(f, log.strain())))
            }
        }
    }
    #[inline(never)]
    fn energy<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> R {
        self.0.energy(&c.law, &Self::of(c.measure, f))
    }
    fn out_of_plane_stress(&self, c: &Self::Constants, f: &Deformation<f64, D>) -> f64 {
        // no strain and no stretch across: the conjugate stress of every measure is the first Piola stress
        self.0.out_of_plane_stress(&c.law, &Self::of(c.measure, f))
    }
    fn commit(&self, c: &Self::Constants, f: &Deformation<f64, D>, memory: &mut [f64]) {
        self.0.commit(&c.law, &Self::of(c.measure, f), memory);
    }
}

/// ½ ln(1 + 2E) of a symmetric tensor E and its derivative, to first order about the value: E = V (Λ + X) Vᵀ with X that holds the
/// derivatives (and round-off) only.
struct Logarithm<R, const D: usize> {
    axes: Matrix<R, D>,
    /// Λ
    values: [f64; D],
    /// 1 + 2Λ: squares of the principal stretches.
    squares: [f64; D],
    /// X
    rest: Matrix<R, D>,
}

impl<R: Scalar, const D: usize> Logarithm<R, D> {
    #[inline(always)]
    fn new(e: Matrix<R, D>) -> Self {
        let (values, axes) = Matrix(e.0.map(|row| row.map(R::value))).eigen();
        let axes = axes.to();
        let mut rest = axes.transpose() * e * axes;
        for k in 0..D {
            rest.0[k][k] -= R::of(values[k]);
        }
        Logarithm { axes, values, squares: values.map(|x| 1.0 + 2.0 * x), rest }
    }
    /// ½ ln(1 + 2E): in the axes of the value ½ ln(1 + 2Λ) + φ[a, b] X.
    #[inline(always)]
    fn strain(&self) -> Matrix<R, D> {
        let g = &self.squares;
        let mut inner = Matrix(array(|a| array(|b| self.rest.0[a][b] * first_difference(g[a], g[b]))));
        for k in 0..D {
            inner.0[k][k] += R::of(0.5 * (2.0 * self.values[k]).ln_1p());
        }
        self.axes * inner * self.axes.transpose()
    }
    /// σ : ∂(½ ln(1 + 2E))/∂E: φ[a, b] σ and, to first order in X, φ[a, c, b] (σ X + X σ).
    #[inline(always)]
    fn pull_back(&self, stress: Matrix<R, D>) -> Matrix<R, D> {
        let g = &self.squares;
        let s = self.axes.transpose() * stress * self.axes;
        let x = &self.rest.0;
        let mut inner = Matrix(array(|a| array(|b| s.0[a][b] * first_difference(g[a], g[b]))));
        // without derivatives X is round-off
        if R::DIFFERENTIATES {
            for a in 0..D {
                for b in 0..D {
                    for c in 0..D {
                        inner.0[a][b] += (s.0[a][c] * x[c][b] + x[a][c] * s.0[c][b]) * (2.0 * second_difference(g[a], g[c], g[b]));
                    }
                }
            }
        }
        self.axes * inner * self.axes.transpose()
    }
}

/// (ln a − ln b)/(a − b), 1/a where they are equal. As a function of the strains (a − 1)/2 and (b − 1)/2 it is the divided difference
/// of ½ ln(1 + 2e).
fn first_difference(a: f64, b: f64) -> f64 {
    let r = (a - b) / (a + b);
    if r.abs() > 0.1 {
        return (a / b).ln() / (a - b);
    }
    // 2 artanh(r)/(a − b)
    let z = r * r;
    let mut series = 0.0;
    for k in (0..9).rev() {
        series = series * z + 1.0 / (2 * k + 1) as f64;
    }
    2.0 * series / (a + b)
}

/// The second divided difference of the logarithm.
fn second_difference(a: f64, b: f64, c: f64) -> f64 {
    let mut g = [a, b, c];
    g.sort_by(f64::total_cmp);
    let mean = (a + b + c) / 3.0;
    if g[2] - g[0] > 0.2 * mean {
        return (first_difference(g[2], g[1]) - first_difference(g[1], g[0])) / (g[2] - g[0]);
    }
    // Σ f⁽ⁿ⁾/n! h(n − 2) with the complete symmetric polynomials h of the distances from the mean (whose sum is zero)
    let d = g.map(|x| x / mean - 1.0);
    let (e2, e3) = (d[0] * d[1] + d[1] * d[2] + d[0] * d[2], d[0] * d[1] * d[2]);
    let (mut h, mut sum) = ([1.0, 0.0, -e2], 0.0);
    for k in 0..22 {
        let sign = if k % 2 == 0 { -1.0 } else { 1.0 };
        sum += sign * h[0] / (k + 2) as f64;
        h = [h[1], h[2], e3 * h[0] - e2 * h[1]];
    }
    sum / (mean * mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn divided_differences_of_the_logarithm() {
        assert_eq!(first_difference(2.0, 2.0), 0.5);
        assert!((first_difference(4.0, 1.0) - 4f64.ln() / 3.0).abs() < 1e-16);
        assert!((second_difference(2.0, 2.0, 2.0) + 0.125).abs() < 1e-17);
        // f[1, 2, 4] = (ln 2/2 − ln 2)/3
        assert!((second_difference(4.0, 1.0, 2.0) + 2f64.ln() / 6.0).abs() < 1e-16);
        // f[1, 1, x] = (ln x/(x − 1) − 1)/(x − 1), on both sides of the change of method and far below it, by its series
        for x in [1.2f64, 1.22, 1.3, 1.35, 0.9, 0.75] {
            let want = (x.ln() / (x - 1.0) - 1.0) / (x - 1.0);
            assert!((second_difference(1.0, x, 1.0) / want - 1.0).abs() < 1e-13, "{x}");
        }
        let h = 1e-4;
        let want = -0.5 + h / 3.0 - h * h / 4.0 + h * h * h / 5.0;
        assert!((second_difference(1.0, 1.0 + h, 1.0) / want - 1.0).abs() < 1e-15);
    }
}
