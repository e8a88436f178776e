//! The models. A file holds equations only: what the deformed family reduces to, and the force state of a bond.

mod bond_based;
mod corrected_correspondence;
mod correspondence;
mod extended_correspondence;
mod linear_peridynamic_solid;
mod sub_horizon_correspondence;

pub use bond_based::{BondBased, BondBasedConstants};
pub use corrected_correspondence::{
    CorrectedCorrespondence, CorrectedShape, CorrectedState, LARGEST_AMPLIFICATION, LARGEST_ORDER, monomial_count,
};
pub use correspondence::{Correspondence, FLAT_FAMILY};
pub use extended_correspondence::{BondStrainCalibration, ExponentError, ExtendedCorrespondence, MAX_EXPONENT, SethHill};
pub use linear_peridynamic_solid::{LinearPeridynamicSolid, LinearPeridynamicSolidConstants};
pub use sub_horizon_correspondence::{EmptySubHorizon, SubHorizonCorrespondence, SubHorizonShape};
