use super::{Deformation, Law, linear_elastic};
use crate::elasticity::Stiffness;
use crate::scalar::Scalar;
use crate::tensor::Matrix;

/// Kelvin–Voigt: linear elasticity with a viscous stress in parallel.
///
/// # Equations
/// σ = C:(ε + τ ε̇ − α ΔT), P = σ, with the retardation time τ \[s\]. The energy is that of the spring.
///
/// # Holds when
/// strains are small. In statics the velocity is zero and the law is [`LinearElastic`](super::LinearElastic).
#[derive(Clone, Copy, Debug)]
pub struct KelvinVoigt;

/// Constants of [`KelvinVoigt`].
#[derive(Clone, Copy, Debug)]
pub struct KelvinVoigtConstants<const D: usize> {
    /// C.
    pub stiffness: Stiffness<D>,
    /// τ \[s\].
    pub retardation_time: f64,
}

impl<const D: usize> Law<D> for KelvinVoigt {
    const RATE: bool = true;
    type Constants = KelvinVoigtConstants<D>;
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D> {
        c.stiffness
    }
    #[inline(always)]
    fn first_piola<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> Matrix<R, D> {
        let strain = f.small_strain() + f.rate.symmetric() * R::of(c.retardation_time);
        linear_elastic::stress(&c.stiffness, &strain, f.temperature)
    }
    #[inline(always)]
    fn energy<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> R {
        linear_elastic::energy(&c.stiffness, &f.small_strain(), f.temperature)
    }
}
