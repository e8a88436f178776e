//! Thin features: bond-pair beams, bond-multiple plates, and shells (O'Grady, *Peridynamic beams, plates, and shells*, thesis 2014, chapters
//! 4 and 5, corrected).
//!
//! A thin body resists bending because a *bond pair*, two opposite bonds of a point, resists being turned out of line. Every pair has
//! one energy, counted once, at its centre. Its two ends are stencils ([`stencil::Ends`]): a real point, the image of one behind a
//! mirror plane (a support), or weights on several points; what the energy gives an end goes back through the transpose of its
//! stencil, so forces, tangents, momenta and reactions are those of one potential.
//!
//! From the points to a solution:
//! [`layout::Layout`] (lattice of a line or plane) → [`beam::Beam`] or [`plate::Plate`] (energy of the families) → [`body::Thin`]
//! (all points: energy, force, tangent, breaking, plastic history) → [`structure::ThinStructure`] (with conditions: what solvers see).
//! Curved and irregular: [`surface::Surface`] (points, normals, areas; made by [`generate`], from triangles or from points) → [`shell::Shell`] →
//! the same body; bodies are joined by [`body::Thin::join`].
#![forbid(unsafe_code)]

pub mod angle;
pub mod beam;
pub mod body;
pub mod buckling;
pub mod extension;
pub mod frame;
pub mod generate;
pub mod interpolation;
pub mod joint;
pub mod layout;
pub mod linear;
pub mod loads;
pub mod pairs;
pub mod plate;
pub mod section;
pub mod shell;
pub mod stability;
pub mod stencil;
pub mod structure;
pub mod surface;
pub mod turn;
pub mod weights;

mod error;
pub use error::ThinError;
