//! What a peridynamic material is: the energy density `W(Y)` of a deformed family and its Fréchet derivative, the force
//! state `T = ∇W(Y)`. This crate knows no points, threads or files.
//!
//! Begin with [`material::Material`], then read one of the [`models`].
#![deny(unsafe_op_in_unsafe_fn)]

pub mod constitutive;
pub mod elasticity;
pub mod failure;
pub mod family;
pub mod influence;
pub mod isotropy;
pub mod lanes;
pub mod material;
pub mod models;
pub mod scalar;
pub mod stretch_law;
pub mod sub_horizon;
pub mod tensor;
pub mod zero_energy;
