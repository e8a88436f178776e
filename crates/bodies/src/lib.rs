//! A discretised body: points, families, chunks, damage, loads; and how solvers see it.
#![forbid(unsafe_code)]

pub mod body;
pub mod chunk;
pub mod damage;
pub mod loads;
pub mod measures;
pub mod part;
pub mod structure;
