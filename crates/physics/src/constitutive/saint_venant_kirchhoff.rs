use super::{Deformation, Law, linear_elastic};
use crate::elasticity::Stiffness;
use crate::scalar::Scalar;
use crate::tensor::Matrix;

/// Saint-Venant–Kirchhoff: linear elasticity of the Green–Lagrange strain, of any symmetry.
///
/// # Equations
/// E = (FᵀF − 1)/2, S = C:(E − α ΔT), P = F S, ψ = (E − α ΔT):C:(E − α ΔT)/2.
///
/// # Holds when
/// rotations are any, strains moderate. Under strong compression (uniaxially below F = 1/√3) it loses stiffness.
#[derive(Clone, Copy, Debug)]
pub struct SaintVenantKirchhoff;

impl<const D: usize> Law<D> for SaintVenantKirchhoff {
    type Constants = Stiffness<D>;
    fn stiffness(&self, c: &Stiffness<D>) -> Stiffness<D> {
        *c
    }
    #[inline(always)]
    fn first_piola<R: Scalar>(&self, c: &Stiffness<D>, f: &Deformation<R, D>) -> Matrix<R, D> {
        f.f() * linear_elastic::stress(c, &f.green_lagrange(), f.temperature)
    }
    #[inline(always)]
    fn energy<R: Scalar>(&self, c: &Stiffness<D>, f: &Deformation<R, D>) -> R {
        linear_elastic::energy(c, &f.green_lagrange(), f.temperature)
    }
    fn out_of_plane_stress(&self, c: &Stiffness<D>, f: &Deformation<f64, D>) -> f64 {
        c.out_of_plane_stress(&linear_elastic::stress(c, &f.green_lagrange(), f.temperature), f.temperature)
    }
}
