//! Peridyne: a deck in, a verified result out.
//!
//! The way from a deck to its result: [`deck`] (as typed) → [`problem`] (validated) → [`registry`] (models and bodies) →
//! [`run`] (solvers and observers; [`spectrum`]: stability) → [`output`] (fields, tables, pictures) and [`verify`]; [`study`] makes many
//! runs of one deck.
#![forbid(unsafe_code)]

pub mod cli;
pub mod deck;
mod field_units;
mod figures;
pub mod modes;
pub mod output;
pub mod point_file;
pub mod problem;
pub mod reference;
pub mod registry;
pub mod run;
pub mod spectrum;
pub mod study;
mod surface;
mod thin_registry;
pub mod verify;
pub mod zone;
