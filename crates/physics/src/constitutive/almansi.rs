use super::{CauchyLaw, Deformation};
use crate::elasticity::{Isotropic, Section, Stiffness};
use crate::scalar::Scalar;
use crate::tensor::Matrix;

/// Linear elasticity of the Almansi strain in space, a law known by its Cauchy stress only.
///
/// # Equations
/// e = (1 − F⁻ᵀF⁻¹)/2, σ = λ* tr(e) 1 + 2μ e. In plane stress and in a bar the transverse strain is −λ/(λ + 2μ) tr e and
/// −ν e₁₁, and the transverse stretch 1/√(1 − 2e₃₃).
///
/// # Fails when
/// an energy is needed: the stress is not the derivative of one.
#[derive(Clone, Copy, Debug)]
pub struct Almansi;

impl<const D: usize> CauchyLaw<D> for Almansi {
    type Constants = (Isotropic, Section);
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D> {
        Stiffness::isotropic(c.0, 0.0, c.1)
    }
    #[inline(always)]
    fn cauchy<R: Scalar>(&self, (m, section): &Self::Constants, f: &Deformation<R, D>) -> (Matrix<R, D>, R) {
        // F⁻¹ = 1 − G with G = F⁻¹ H, hence e = (G + Gᵀ − GᵀG)/2
        let g = f.f().inverse() * f.gradient;
        let e = g.symmetric() - g.transpose() * g * R::of(0.5);
        let across = |ratio: f64| (R::of(1.0) + e.trace() * (2.0 * ratio)).rsqrt();
        match section {
            Section::Bar { .. } => {
                let c = across(m.poisson);
                (e * R::of(m.young), c * c)
            }
            _ => {
                let sigma = Matrix::scaled_identity(e.trace() * m.lambda_of(*section)) + e * R::of(2.0 * m.shear());
                let free = section.free_directions() == 1;
                (sigma, if free { across(m.poisson / (1.0 - m.poisson)) } else { R::of(1.0) })
            }
        }
    }
}
