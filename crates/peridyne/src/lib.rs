//! Peridyne.
#![forbid(unsafe_code)]
pub mod point_file;
