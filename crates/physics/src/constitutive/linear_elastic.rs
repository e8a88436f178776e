use super::{Deformation, Law};
use crate::elasticity::Stiffness;
use crate::scalar::Scalar;
use crate::tensor::Matrix;

/// Linear elasticity at small strain, of any symmetry, with thermal strain.
///
/// # Equations
/// ε = sym(F − 1), σ = C:(ε − α ΔT), P = σ, ψ = (ε − α ΔT):C:(ε − α ΔT)/2.
///
/// # Holds when
/// strains and rotations are small: a rotation by φ gives a strain of order φ².
#[derive(Clone, Copy, Debug)]
pub struct LinearElastic;

impl<const D: usize> Law<D> for LinearElastic {
    type Constants = Stiffness<D>;
    fn stiffness(&self, c: &Stiffness<D>) -> Stiffness<D> {
        *c
    }
    #[inline(always)]
    fn first_piola<R: Scalar>(&self, c: &Stiffness<D>, f: &Deformation<R, D>) -> Matrix<R, D> {
        stress(c, &f.small_strain(), f.temperature)
    }
    #[inline(always)]
    fn energy<R: Scalar>(&self, c: &Stiffness<D>, f: &Deformation<R, D>) -> R {
        energy(c, &f.small_strain(), f.temperature)
    }
}

/// C:(strain − α ΔT)
#[inline(always)]
pub(super) fn stress<R: Scalar, const D: usize>(c: &Stiffness<D>, strain: &Matrix<R, D>, temperature: f64) -> Matrix<R, D> {
    c.stress(strain) - c.thermal_stress(temperature)
}

/// (strain − α ΔT):C:(strain − α ΔT)/2
#[inline(always)]
pub(super) fn energy<R: Scalar, const D: usize>(c: &Stiffness<D>, strain: &Matrix<R, D>, temperature: f64) -> R {
    let elastic = c.stress(strain) * R::of(0.5) - c.thermal_stress(temperature);
    elastic.double_dot(*strain) + R::of(0.5 * c.thermal_energy * temperature * temperature)
}
