//! Peridyne: a deck in, a verified result out.
//!
//! The way from a deck to its result: [`deck`] (as typed) → [`problem`] (validated) → [`registry`] (models and bodies) →
//! [`run`] (solvers and observers) → [`output`] (fields, tables, pictures) and [`verify`].
#![forbid(unsafe_code)]

pub mod cli;
pub mod deck;
pub mod output;
pub mod point_file;
pub mod problem;
pub mod registry;
pub mod run;
mod thin_registry;
pub mod verify;
