//! All laws behind one type, and all stretch laws: the product of laws, controls, influences and dimensions would take
//! minutes to compile for every number type; so only controls, influences and dimensions are types of their own. The laws
//! inside are those of the crate, untouched.

use physics::constitutive::{
    Almansi, Deformation, FromCauchy, J2Plasticity, J2PlasticityConstants, KelvinVoigt, KelvinVoigtConstants, Law, LinearElastic,
    NeoHookean, NeoHookeanConstants, SaintVenantKirchhoff, Strain, StrainLaw,
};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::scalar::Scalar;
use physics::stretch_law::{Bilinear, Elastic, ElasticPlastic, StretchLaw, Tabulated, TensionOnly};
use physics::tensor::Matrix;

/// Any law.
#[derive(Clone, Copy)]
pub struct AnyLaw;

/// Which law, with its constants.
#[derive(Clone, Copy)]
pub enum AnyConstants<const D: usize> {
    Linear(Stiffness<D>),
    SaintVenantKirchhoff(Stiffness<D>),
    NeoHookean(NeoHookeanConstants),
    KelvinVoigt(KelvinVoigtConstants<D>),
    Almansi((Isotropic, Section)),
}
use AnyConstants as Any;

impl<const D: usize> Any<D> {
    /// (RATE, HYPERELASTIC) of the law inside.
    pub fn constants_of_the_law(&self) -> (bool, bool) {
        fn of<L: Law<D>, const D: usize>(_: L) -> (bool, bool) {
            (L::RATE, L::HYPERELASTIC)
        }
        match self {
            Any::Linear(_) => of::<_, D>(LinearElastic),
            Any::SaintVenantKirchhoff(_) => of::<_, D>(SaintVenantKirchhoff),
            Any::NeoHookean(_) => of::<_, D>(NeoHookean),
            Any::KelvinVoigt(_) => of::<_, D>(KelvinVoigt),
            Any::Almansi(_) => of::<_, D>(FromCauchy(Almansi)),
        }
    }
}

impl<const D: usize> Law<D> for AnyLaw {
    // F's rate is given to all; those without rate must not look at it
    const RATE: bool = true;
    type Constants = Any<D>;
    fn stiffness(&self, c: &Any<D>) -> Stiffness<D> {
        match c {
            Any::Linear(c) => Law::stiffness(&LinearElastic, c),
            Any::SaintVenantKirchhoff(c) => SaintVenantKirchhoff.stiffness(c),
            Any::NeoHookean(c) => NeoHookean.stiffness(c),
            Any::KelvinVoigt(c) => KelvinVoigt.stiffness(c),
            Any::Almansi(c) => FromCauchy(Almansi).stiffness(c),
        }
    }
    #[inline(never)]
    fn first_piola<R: Scalar>(&self, c: &Any<D>, f: &Deformation<R, D>) -> Matrix<R, D> {
        match c {
            Any::Linear(c) => LinearElastic.first_piola(c, f),
            Any::SaintVenantKirchhoff(c) => SaintVenantKirchhoff.first_piola(c, f),
            Any::NeoHookean(c) => NeoHookean.first_piola(c, f),
            Any::KelvinVoigt(c) => KelvinVoigt.first_piola(c, f),
            Any::Almansi(c) => FromCauchy(Almansi).first_piola(c, f),
        }
    }
    #[inline(never)]
    fn energy<R: Scalar>(&self, c: &Any<D>, f: &Deformation<R, D>) -> R {
        match c {
            Any::Linear(c) => Law::energy(&LinearElastic, c, f),
            Any::SaintVenantKirchhoff(c) => SaintVenantKirchhoff.energy(c, f),
            Any::NeoHookean(c) => NeoHookean.energy(c, f),
            Any::KelvinVoigt(c) => KelvinVoigt.energy(c, f),
            Any::Almansi(c) => FromCauchy(Almansi).energy(c, f),
        }
    }
}

/// Any law of the stretch.
#[derive(Clone)]
pub enum AnyStretchLaw {
    Elastic,
    TensionOnly,
    Bilinear(Bilinear),
    ElasticPlastic(ElasticPlastic),
    Tabulated(Tabulated),
}

impl AnyStretchLaw {
    /// BOND_MEMORY of the law inside.
    pub fn words(&self) -> usize {
        fn of<G: StretchLaw>(_: &G) -> usize {
            G::BOND_MEMORY
        }
        match self {
            AnyStretchLaw::Elastic => of(&Elastic),
            AnyStretchLaw::TensionOnly => of(&TensionOnly),
            AnyStretchLaw::Bilinear(g) => of(g),
            AnyStretchLaw::ElasticPlastic(g) => of(g),
            AnyStretchLaw::Tabulated(g) => of(g),
        }
    }
}

impl StretchLaw for AnyStretchLaw {
    const BOND_MEMORY: usize = 1;
    #[inline(always)]
    fn force<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        match self {
            AnyStretchLaw::Elastic => Elastic.force(s, past),
            AnyStretchLaw::TensionOnly => TensionOnly.force(s, past),
            AnyStretchLaw::Bilinear(g) => g.force(s, past),
            AnyStretchLaw::ElasticPlastic(g) => g.force(s, past),
            AnyStretchLaw::Tabulated(g) => g.force(s, past),
        }
    }
    #[inline(always)]
    fn potential<S: Scalar>(&self, s: S, past: impl Fn(usize) -> S) -> S {
        match self {
            AnyStretchLaw::Elastic => Elastic.potential(s, past),
            AnyStretchLaw::TensionOnly => TensionOnly.potential(s, past),
            AnyStretchLaw::Bilinear(g) => g.potential(s, past),
            AnyStretchLaw::ElasticPlastic(g) => g.potential(s, past),
            AnyStretchLaw::Tabulated(g) => g.potential(s, past),
        }
    }
    fn commit(&self, s: f64, memory: &mut [f64]) {
        match self {
            AnyStretchLaw::Elastic => Elastic.commit(s, memory),
            AnyStretchLaw::TensionOnly => TensionOnly.commit(s, memory),
            AnyStretchLaw::Bilinear(g) => g.commit(s, memory),
            AnyStretchLaw::ElasticPlastic(g) => g.commit(s, memory),
            AnyStretchLaw::Tabulated(g) => g.commit(s, memory),
        }
    }
}

/// Any law of the strain.
#[derive(Clone, Copy)]
pub struct AnyStrainLaw;

/// Which law of the strain, with its constants.
#[derive(Clone, Copy)]
// constants are plain data: no box
#[allow(clippy::large_enum_variant)]
pub enum AnyStrainConstants<const D: usize> {
    Linear(Stiffness<D>),
    Plastic(J2PlasticityConstants),
}

impl<const D: usize> StrainLaw<D> for AnyStrainLaw {
    const MEMORY: usize = <J2Plasticity as StrainLaw<D>>::MEMORY;
    type Constants = AnyStrainConstants<D>;
    fn stiffness(&self, c: &Self::Constants) -> Stiffness<D> {
        match c {
            AnyStrainConstants::Linear(c) => *c,
            AnyStrainConstants::Plastic(c) => StrainLaw::<D>::stiffness(&J2Plasticity, c),
        }
    }
    #[inline(never)]
    fn stress<R: Scalar>(&self, c: &Self::Constants, e: &Strain<R, D>) -> Matrix<R, D> {
        match c {
            AnyStrainConstants::Linear(c) => LinearElastic.stress(c, e),
            AnyStrainConstants::Plastic(c) => J2Plasticity.stress(c, e),
        }
    }
    #[inline(never)]
    fn energy<R: Scalar>(&self, c: &Self::Constants, e: &Strain<R, D>) -> R {
        match c {
            AnyStrainConstants::Linear(c) => StrainLaw::energy(&LinearElastic, c, e),
            AnyStrainConstants::Plastic(c) => J2Plasticity.energy(c, e),
        }
    }
    fn commit(&self, c: &Self::Constants, e: &Strain<f64, D>, memory: &mut [f64]) {
        if let AnyStrainConstants::Plastic(c) = c {
            J2Plasticity.commit(c, e, memory);
        }
    }
}
