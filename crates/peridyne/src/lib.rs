//! Peridyne.

pub mod output;
