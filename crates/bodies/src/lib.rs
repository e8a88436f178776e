//! A discretised body: material points, their families, and what separates them.
#![forbid(unsafe_code)]

mod cells;
pub mod crack;
pub mod generate;
pub mod neighbors;
mod orientation;
pub mod points;
pub mod region;
pub mod sort;
pub mod visibility;
