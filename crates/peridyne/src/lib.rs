//! Peridyne.
#![forbid(unsafe_code)]
pub mod deck;
