//! Every model compiled for every dimension: the one place where loops and models meet as machine code.
//!
//! A model is a choice made at run time ([`Model`]), the loops over its families are compiled for its type. This crate holds all
//! these types, so that the program above it does not compile them again whenever a word of a deck changes. Where speed matters
//! (elastic bonds, the linear solid, hyperelastic correspondence) a constant influence is a type of its own; elsewhere, and in one
//! dimension, it is stored. Where a law costs more than a zero-energy control, all controls are one type.

#![forbid(unsafe_code)]

use bodies::chunk::Chunk;
use bodies::inclined::Inclined;
use bodies::part::{Assigned, Constants, Part};
use bodies::structure::{Simulated, Structure};
use physics::constitutive::{
    Almansi, FromCauchy, Hyperelastic, HyperelasticConstants, J2Plasticity, J2PlasticityConstants, KelvinVoigt, KelvinVoigtConstants,
    LinearElastic, OfStrain, OfStrainConstants,
};
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::influence::{Influence, One, Stored};
use physics::material::Material;
use physics::models::{
    BondBased, BondBasedConstants, BondStrainCalibration, CorrectedCorrespondence, Correspondence, EmptySubHorizon, ExtendedCorrespondence,
    LARGEST_ORDER, LinearPeridynamicSolid, LinearPeridynamicSolidConstants, SethHill, SubHorizonCorrespondence, monomial_count,
};
use physics::stretch_law::{Elastic, Nonlinear};
use physics::zero_energy::{self, AnyControl, Wan2019};

/// A model with its constants.
#[derive(Clone, Debug)]
pub enum Model<const D: usize> {
    /// [`BondBased`] with elastic bonds.
    ElasticBonds(Constants<BondBasedConstants>),
    /// [`BondBased`] with another law of stretch.
    NonlinearBonds(Nonlinear, Constants<BondBasedConstants>),
    /// [`LinearPeridynamicSolid`].
    LinearPeridynamicSolid(Constants<LinearPeridynamicSolidConstants>),
    /// [`Correspondence`].
    Correspondence(Law<D>, AnyControl),
    /// [`CorrectedCorrespondence`] of an order.
    Corrected(SmoothLaw<D>, zero_energy::Isotropic, usize),
    /// [`SubHorizonCorrespondence`].
    SubHorizons(SmoothLaw<D>, EmptySubHorizon),
    /// [`ExtendedCorrespondence`].
    Extended(StrainLaw<D>, BondStrains),
}

/// A constitutive law with its constants.
#[derive(Clone, Debug)]
pub enum Law<const D: usize> {
    /// One that all kinematics take.
    Smooth(SmoothLaw<D>),
    /// [`KelvinVoigt`].
    KelvinVoigt(Constants<KelvinVoigtConstants<D>>),
    /// [`Almansi`], a law that is known by its Cauchy stress.
    Almansi(Constants<(Isotropic, Section)>),
}

/// A constitutive law that all kinematics take.
#[allow(clippy::large_enum_variant)] // one for each material of a deck
#[derive(Clone, Debug)]
pub enum SmoothLaw<const D: usize> {
    /// One of the laws with an energy.
    Hyperelastic(Constants<HyperelasticConstants<D>>),
    /// [`J2Plasticity`] in a strain of F.
    Plastic(Constants<OfStrainConstants<J2PlasticityConstants>>),
}

/// A law of a strain.
#[allow(clippy::large_enum_variant)] // one for each material of a deck
#[derive(Clone, Debug)]
pub enum StrainLaw<const D: usize> {
    /// [`LinearElastic`].
    Elastic(Constants<Stiffness<D>>),
    /// [`J2Plasticity`].
    Plastic(Constants<J2PlasticityConstants>),
}

/// How extended correspondence makes a strain tensor of bond strains.
#[derive(Clone, Copy, Debug)]
pub struct BondStrains {
    /// The exponent m.
    pub exponent: SethHill,
    /// H
    pub calibration: BondStrainCalibration,
    /// Strength of the zero-energy control.
    pub control: f64,
}

/// Where a model goes: on some points (sorted index) of a body with these chunks.
pub struct Place<'a, const D: usize> {
    /// Name of the material.
    pub name: &'a str,
    /// Points made of it.
    pub points: &'a [u32],
    /// Chunks of the body.
    pub chunks: &'a [Chunk<D>],
    /// Whether the bonds store their influence; otherwise it is 1. In one dimension they always do.
    pub weighted: bool,
    /// Number of sub-horizons whose membership the bonds store.
    pub sub_horizons: usize,
}

/// What is compiled for a dimension.
pub trait Compiled<const D: usize> {
    /// A model on its points.
    fn part(model: Model<D>, place: &Place<D>) -> Box<dyn Part<D>>;
    /// A body as the program advances it.
    fn simulated(structure: Structure<D>) -> Box<dyn Simulated>;
}

/// The catalog: [`Compiled`] in one, two and three dimensions.
pub struct Catalog;

macro_rules! compiled {
    ($($d:literal, $plain:ident;)*) => {$(
        impl Compiled<$d> for Catalog {
            fn part(model: Model<$d>, place: &Place<$d>) -> Box<dyn Part<$d>> {
                part::<$d, { monomial_count($d, LARGEST_ORDER[$d - 1]) }, { sub_horizon_planes($d, 1, false) }, _>(model, $plain, place)
            }
            fn simulated(structure: Structure<$d>) -> Box<dyn Simulated> {
                if structure.is_inclined() { Box::new(Inclined::new(structure)) } else { Box::new(structure) }
            }
        }
    )*};
}
compiled!(1, Stored; 2, One; 3, One;);

/// Sub-horizons that models are compiled for, and so the numbers whose membership a body stores: four in the plane are a case of their
/// own, because quadrants are (with history all come in eights).
pub const fn sub_horizon_planes(d: usize, count: usize, history: bool) -> usize {
    if d == 2 && count <= 4 && !history { 4 } else { 8 }
}

impl<const D: usize> Place<'_, D> {
    fn assign<M: Material<D>>(&self, model: M, constants: Constants<M::Constants>) -> Box<dyn Part<D>> {
        Box::new(Assigned::new(self.name, model, constants, self.points, self.chunks))
    }
}

/// `M` monomials of the largest order of a correction; `FEW` and 8 are the numbers of sub-horizons; `plain` is the influence of bonds that
/// store none.
fn part<const D: usize, const M: usize, const FEW: usize, I: Influence>(model: Model<D>, plain: I, place: &Place<D>) -> Box<dyn Part<D>> {
    let omega = Stored;
    match model {
        Model::ElasticBonds(c) if place.weighted => place.assign(BondBased { law: Elastic, omega }, c),
        Model::ElasticBonds(c) => place.assign(BondBased { law: Elastic, omega: plain }, c),
        Model::NonlinearBonds(law, c) => place.assign(BondBased { law, omega }, c),
        Model::LinearPeridynamicSolid(c) if place.weighted => place.assign(LinearPeridynamicSolid { omega }, c),
        Model::LinearPeridynamicSolid(c) => place.assign(LinearPeridynamicSolid { omega: plain }, c),
        Model::Correspondence(Law::Smooth(SmoothLaw::Hyperelastic(c)), control) => match (control, place.weighted) {
            (AnyControl::Wan2019, true) => place.assign(Correspondence { law: Hyperelastic, control: Wan2019, omega }, c),
            (AnyControl::Wan2019, false) => place.assign(Correspondence { law: Hyperelastic, control: Wan2019, omega: plain }, c),
            (AnyControl::Isotropic(control), true) => place.assign(Correspondence { law: Hyperelastic, control, omega }, c),
            (AnyControl::Isotropic(control), false) => place.assign(Correspondence { law: Hyperelastic, control, omega: plain }, c),
        },
        Model::Correspondence(Law::Smooth(SmoothLaw::Plastic(c)), control) => {
            place.assign(Correspondence { law: OfStrain(J2Plasticity), control, omega }, c)
        }
        Model::Correspondence(Law::KelvinVoigt(c), control) => place.assign(Correspondence { law: KelvinVoigt, control, omega }, c),
        Model::Correspondence(Law::Almansi(c), control) => place.assign(Correspondence { law: FromCauchy(Almansi), control, omega }, c),
        Model::Corrected(law, control, order) => {
            debug_assert!(order <= LARGEST_ORDER[D - 1]);
            match law {
                SmoothLaw::Hyperelastic(c) => {
                    place.assign(CorrectedCorrespondence::<_, _, _, M> { law: Hyperelastic, control, omega, order }, c)
                }
                SmoothLaw::Plastic(c) => {
                    place.assign(CorrectedCorrespondence::<_, _, _, M> { law: OfStrain(J2Plasticity), control, omega, order }, c)
                }
            }
        }
        Model::SubHorizons(SmoothLaw::Hyperelastic(c), empty) => {
            let law = Hyperelastic;
            match (place.sub_horizons, place.weighted) {
                (n, true) if n == FEW => place.assign(SubHorizonCorrespondence::<_, _, FEW> { law, omega, empty }, c),
                (n, false) if n == FEW => place.assign(SubHorizonCorrespondence::<_, _, FEW> { law, omega: plain, empty }, c),
                (_, true) => place.assign(SubHorizonCorrespondence::<_, _, 8> { law, omega, empty }, c),
                (_, false) => place.assign(SubHorizonCorrespondence::<_, _, 8> { law, omega: plain, empty }, c),
            }
        }
        Model::SubHorizons(SmoothLaw::Plastic(c), empty) => {
            place.assign(SubHorizonCorrespondence::<_, _, 8> { law: OfStrain(J2Plasticity), omega, empty }, c)
        }
        Model::Extended(law, BondStrains { exponent, calibration, control }) => match (law, place.weighted) {
            (StrainLaw::Elastic(c), true) => {
                place.assign(ExtendedCorrespondence { law: LinearElastic, exponent, calibration, control, omega }, c)
            }
            (StrainLaw::Elastic(c), false) => {
                place.assign(ExtendedCorrespondence { law: LinearElastic, exponent, calibration, control, omega: plain }, c)
            }
            (StrainLaw::Plastic(c), _) => {
                place.assign(ExtendedCorrespondence { law: J2Plasticity, exponent, calibration, control, omega }, c)
            }
        },
    }
}
