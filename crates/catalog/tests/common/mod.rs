//! Models with constants that are the same everywhere, and their parts: the machine code of the program itself.
#![allow(dead_code, reason = "shared by tests that each need a part of it")]

use bodies::body::Body;
use bodies::part::{Constants, Part};
use catalog::{BondStrains, Catalog, Compiled, Law, Model, Place, SmoothLaw, StrainLaw};
use physics::constitutive::HyperelasticConstants;
use physics::elasticity::{Isotropic, Section, Stiffness};
use physics::models::{BondBasedConstants, BondStrainCalibration, LinearPeridynamicSolidConstants, SethHill};
use physics::zero_energy::{self, AnyControl};

/// Without zero-energy control.
pub const UNCONTROLLED: AnyControl = AnyControl::Isotropic(zero_energy::Isotropic::None);
/// The control of Wan et al., made frame indifferent.
pub const CONTROLLED: AnyControl = AnyControl::Isotropic(zero_energy::Isotropic::Wan2019);

/// A model on some points of a body. In one dimension bonds always store their influence.
pub fn on<const D: usize>(points: &[u32], model: Model<D>, weighted: bool, sub_horizons: usize, body: &Body<D>) -> Box<dyn Part<D>>
where
    Catalog: Compiled<D>,
{
    Catalog::part(model, &Place { name: "material", points, chunks: body.chunks(), weighted: weighted || D == 1, sub_horizons })
}

/// A model on a whole body whose bonds store nothing but what they must.
pub fn everywhere<const D: usize>(model: Model<D>, body: &Body<D>) -> Box<dyn Part<D>>
where
    Catalog: Compiled<D>,
{
    on(&(0..body.points() as u32).collect::<Vec<_>>(), model, false, 0, body)
}

pub fn bonds<const D: usize>(young: f64, section: Section) -> Model<D> {
    Model::ElasticBonds(Constants::Uniform(BondBasedConstants { young, section, continuum: false }))
}

pub fn linear_solid<const D: usize>(elastic: Isotropic, section: Section) -> Model<D> {
    Model::LinearPeridynamicSolid(Constants::Uniform(LinearPeridynamicSolidConstants::new(elastic, section)))
}

pub fn linear<const D: usize>(stiffness: Stiffness<D>) -> SmoothLaw<D> {
    SmoothLaw::Hyperelastic(Constants::Uniform(HyperelasticConstants::LinearElastic(stiffness)))
}

pub fn saint_venant<const D: usize>(stiffness: Stiffness<D>) -> SmoothLaw<D> {
    SmoothLaw::Hyperelastic(Constants::Uniform(HyperelasticConstants::SaintVenantKirchhoff(stiffness)))
}

pub fn correspondence<const D: usize>(law: SmoothLaw<D>, control: AnyControl) -> Model<D> {
    Model::Correspondence(Law::Smooth(law), control)
}

pub fn extended<const D: usize>(stiffness: Stiffness<D>, exponent: f64, calibration: BondStrainCalibration, control: f64) -> Model<D> {
    let exponent = SethHill::new(exponent).expect("an exponent within bounds");
    Model::Extended(StrainLaw::Elastic(Constants::Uniform(stiffness)), BondStrains { exponent, calibration, control })
}
