//! Constitutive laws: stress of a local deformation gradient. One file a law.

use crate::elasticity::Stiffness;
use crate::scalar::Scalar;
use crate::tensor::Matrix;

mod almansi;
mod hyperelastic;
mod j2_plasticity;
mod kelvin_voigt;
mod linear_elastic;
mod neo_hookean;
mod saint_venant_kirchhoff;
mod strain_law;

pub use almansi::Almansi;
pub use hyperelastic::{Hyperelastic, HyperelasticConstants};
pub use j2_plasticity::{J2Plasticity, J2PlasticityConstants, PlasticityError};
pub use kelvin_voigt::{KelvinVoigt, KelvinVoigtConstants};
pub use linear_elastic::LinearElastic;
pub use neo_hookean::{NeoHookean, NeoHookeanConstants};
pub use saint_venant_kirchhoff::SaintVenantKirchhoff;
pub use strain_law::{OfStrain, OfStrainConstants, Strain, StrainLaw, StrainMeasure};

/// What a law may know of a point. The displacement gradient is given rather than F, so that small strains keep their
/// digits and the reference state is exactly free of stress.
#[derive(Clone, Copy, Debug)]
pub struct Deformation<'a, R, const D: usize> {
    /// H = F − 1
    pub gradient: Matrix<R, D>,
    /// Ḟ \[1/s\], zero where velocities are not known (statics).
    pub rate: Matrix<R, D>,
    /// Temperature change against the reference \[K\].
    pub temperature: f64,
    /// Time \[s\].
    pub time: f64,
    /// Committed history: [`Law::MEMORY`] words, those of the end of the last accepted increment.
    pub memory: &'a [f64],
}

impl<R: Scalar, const D: usize> Deformation<'_, R, D> {
    /// A deformation at rest, at the reference temperature, without history.
    pub fn of(gradient: Matrix<R, D>) -> Self {
        Deformation { gradient, rate: Matrix::zero(), temperature: 0.0, time: 0.0, memory: &[] }
    }
    /// F = 1 + H
    #[inline(always)]
    pub fn f(&self) -> Matrix<R, D> {
        Matrix::identity() + self.gradient
    }
    /// ε = sym H
    #[inline(always)]
    pub fn small_strain(&self) -> Matrix<R, D> {
        self.gradient.symmetric()
    }
    /// E = (FᵀF − 1)/2 = sym H + HᵀH/2
    #[inline(always)]
    pub fn green_lagrange(&self) -> Matrix<R, D> {
        let h = self.gradient;
        h.symmetric() + h.transpose() * h * R::of(0.5)
    }
    /// det F − 1, without cancellation.
    #[inline(always)]
    pub fn volume_growth(&self) -> R {
        let h = self.gradient;
        match D {
            1 => h.trace(),
            2 => h.trace() + h.determinant(),
            _ => h.trace() + h.cofactor().trace() + h.determinant(),
        }
    }
}

/// A constitutive law: energy density ψ(F) and first Piola–Kirchhoff stress P = ∂ψ/∂F of the section.
///
/// A law with history sees the committed words in [`Deformation::memory`]; its ψ is then the incremental potential at
/// fixed history, all zeros in the reference state. Who evaluates it several times a point (sub-horizons) keeps
/// [`MEMORY`](Self::MEMORY) words for each evaluation and hands each its own.
pub trait Law<const D: usize>: Copy + Send + Sync + 'static {
    /// Words of history.
    const MEMORY: usize = 0;
    /// Whether the stress depends on the rate of F.
    const RATE: bool = false;
    /// Whether P is the derivative of an energy (at rest).
    const HYPERELASTIC: bool = true;
    /// The constants at a point.
    type Constants: Copy + Send + Sync + 'static;
    /// The stiffness at small strain.
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D>;
    /// First Piola–Kirchhoff stress P \[Pa\].
    fn first_piola<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> Matrix<R, D>;
    /// Energy density ψ \[J/m³\]; 0 for a law that has none.
    fn energy<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> R;
    /// Stress across the plane in plane strain (first Piola, which with F₃₃ = 1 is J times Cauchy's), zero else \[Pa\]. The default is that
    /// of linear elasticity with the law's stiffness.
    fn out_of_plane_stress(&self, c: &Self::Constants, f: &Deformation<f64, D>) -> f64 {
        self.stiffness(c).out_of_plane_stress(&self.first_piola(c, f), f.temperature)
    }
    /// Writes the history of an accepted increment that ended with `f`, given in `memory` what
    /// [`Deformation::memory`] holds.
    fn commit(&self, _: &Self::Constants, _: &Deformation<f64, D>, _memory: &mut [f64]) {}
}

/// A law that is known as a Cauchy stress only. It has no energy, so its tangent need not be symmetric.
pub trait CauchyLaw<const D: usize>: Copy + Send + Sync + 'static {
    /// The constants at a point.
    type Constants: Copy + Send + Sync + 'static;
    /// The stiffness at small strain.
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D>;
    /// Cauchy stress σ \[Pa\] and the product of the transverse stretches (1 in plane strain and in three dimensions), so
    /// that the three-dimensional J is det F times it.
    fn cauchy<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> (Matrix<R, D>, R);
}

/// Makes a law of a Cauchy stress: P = J σ F⁻ᵀ.
#[derive(Clone, Copy, Debug)]
pub struct FromCauchy<L>(pub L);

impl<L: CauchyLaw<D>, const D: usize> Law<D> for FromCauchy<L> {
    const HYPERELASTIC: bool = false;
    type Constants = L::Constants;
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D> {
        self.0.stiffness(c)
    }
    #[inline(always)]
    fn first_piola<R: Scalar>(&self, c: &Self::Constants, f: &Deformation<R, D>) -> Matrix<R, D> {
        let (sigma, transverse) = self.0.cauchy(c, f);
        sigma * f.f().cofactor() * transverse
    }
    #[inline(always)]
    fn energy<R: Scalar>(&self, _: &Self::Constants, _: &Deformation<R, D>) -> R {
        R::of(0.0)
    }
    fn out_of_plane_stress(&self, c: &Self::Constants, f: &Deformation<f64, D>) -> f64 {
        self.0.stiffness(c).out_of_plane_stress(&self.0.cauchy(c, f).0, f.temperature) * (1.0 + f.volume_growth())
    }
}
