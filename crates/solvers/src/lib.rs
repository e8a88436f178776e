//! How a system is advanced: time integration, statics, Krylov and direct solvers over plain vectors.
//!
//! The crate knows vectors and operators, nothing of peridynamics. A body implements [`problem::Dynamics`] or [`problem::Statics`].
#![forbid(unsafe_code)]

pub mod arc_length;
pub mod direct;
pub mod dynamic_relaxation;
pub mod eigen;
pub mod krylov;
pub mod load_steps;
pub mod newton;
pub mod nonlinear_cg;
pub mod observe;
pub mod ordering;
pub mod problem;
pub mod sequential;
pub mod sparse;
pub mod two_level;
pub mod vector;
pub mod velocity_verlet;
