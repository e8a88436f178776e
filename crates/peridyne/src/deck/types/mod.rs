//! The types of the deck, one file per section.
mod body;
mod conditions;
mod expect;
mod materials;
mod output;
mod sets;
mod solver;
mod spectrum;
mod study;
mod thin;

pub use body::*;
pub use conditions::*;
pub use expect::*;
pub use materials::*;
pub use output::*;
pub use sets::*;
pub use solver::*;
pub use spectrum::*;
pub use study::*;
pub use thin::*;
