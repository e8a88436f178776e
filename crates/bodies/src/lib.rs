//! A discretised body: points, families, chunks, damage, loads; and how solvers see it.
#![forbid(unsafe_code)]

mod alike;
pub mod body;
mod cells;
pub mod chunk;
pub mod crack;
pub mod damage;
pub mod generate;
pub mod inclined;
mod lattice;
mod lattice_families;
pub mod loads;
pub mod measures;
pub mod neighbors;
mod orientation;
pub mod part;
mod places;
pub mod points;
pub mod region;
pub mod scratch;
mod shared;
pub mod sort;
pub mod spectrum;
pub mod structure;
pub mod visibility;
