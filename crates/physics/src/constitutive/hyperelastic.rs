use super::{Deformation, Law, LinearElastic, NeoHookean, NeoHookeanConstants, SaintVenantKirchhoff};
use crate::elasticity::Stiffness;
use crate::scalar::Scalar;
use crate::tensor::Matrix;

/// One of the hyperelastic laws, chosen by its constants: a law is evaluated once a point, not once a bond, so that the choice costs
/// nothing there, and models need not be compiled once for every law.
#[derive(Clone, Copy, Debug)]
pub struct Hyperelastic;

/// Which law, with its constants.
#[derive(Clone, Copy, Debug)]
pub enum HyperelasticConstants<const D: usize> {
    /// [`LinearElastic`].
    LinearElastic(Stiffness<D>),
    /// [`SaintVenantKirchhoff`].
    SaintVenantKirchhoff(Stiffness<D>),
    /// [`NeoHookean`].
    NeoHookean(NeoHookeanConstants),
}
use HyperelasticConstants as Constants;

impl<const D: usize> Law<D> for Hyperelastic {
    type Constants = Constants<D>;
    fn stiffness(&self, c: &Constants<D>) -> Stiffness<D> {
        match c {
            Constants::LinearElastic(c) => LinearElastic.stiffness(c),
            Constants::SaintVenantKirchhoff(c) => SaintVenantKirchhoff.stiffness(c),
            Constants::NeoHookean(c) => NeoHookean.stiffness(c),
        }
    }
    #[inline(never)]
    fn first_piola<R: Scalar>(&self, c: &Constants<D>, f: &Deformation<R, D>) -> Matrix<R, D> {
        match c {
            Constants::LinearElastic(c) => LinearElastic.first_piola(c, f),
            Constants::SaintVenantKirchhoff(c) => SaintVenantKirchhoff.first_piola(c, f),
            Constants::NeoHookean(c) => NeoHookean.first_piola(c, f),
        }
    }
    #[inline(never)]
    fn energy<R: Scalar>(&self, c: &Constants<D>, f: &Deformation<R, D>) -> R {
        match c {
            Constants::LinearElastic(c) => LinearElastic.energy(c, f),
            Constants::SaintVenantKirchhoff(c) => SaintVenantKirchhoff.energy(c, f),
            Constants::NeoHookean(c) => NeoHookean.energy(c, f),
        }
    }
    fn out_of_plane_stress(&self, c: &Constants<D>, f: &Deformation<f64, D>) -> f64 {
        match c {
            Constants::LinearElastic(c) => LinearElastic.out_of_plane_stress(c, f),
            Constants::SaintVenantKirchhoff(c) => SaintVenantKirchhoff.out_of_plane_stress(c, f),
            Constants::NeoHookean(c) => NeoHookean.out_of_plane_stress(c, f),
        }
    }
}
