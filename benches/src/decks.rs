//! Every model on a block of a cubic lattice, as decks: whatever the program can run, the benches can time.
#![allow(dead_code, reason = "shared by programs that each need a part of it")]

use bodies::structure::Simulated;
use peridyne::deck::Deck;
use peridyne::problem::Problem;
use peridyne::registry::{assemble, initial_state};
use std::path::Path;

/// A model in a dimension.
#[derive(Clone, Copy)]
pub struct Model {
    /// What it is called in tables.
    pub name: &'static str,
    /// Dimension of space.
    pub dimension: usize,
    /// Its entry in a deck; `K` is the bulk modulus.
    pub model: &'static str,
}

/// A law of continuum mechanics in an entry of the table.
macro_rules! law {
    ($before:literal, $after:literal) => {
        concat!($before, "{saint_venant_kirchhoff: {youngs_modulus: 1.5*K, poisson_ratio: 0.25}}", $after)
    };
}
macro_rules! linear {
    ($before:literal, $after:literal) => {
        concat!($before, "{linear_elastic: {youngs_modulus: 1.5*K, poisson_ratio: 0.25}}", $after)
    };
}

/// The models that are timed, the plainest of each dimension first.
pub const MODELS: &[Model] = &[
    Model { name: "bond-based", dimension: 3, model: "{bond_based: {youngs_modulus: 1.5*K, calibration: continuum}}" },
    Model { name: "linear solid", dimension: 3, model: "{linear_peridynamic_solid: {bulk_modulus: K, shear_modulus: 0.6*K}}" },
    Model { name: "correspondence + control", dimension: 3, model: law!("{correspondence: {law: ", ", control: wan_2019}}") },
    Model {
        name: "corrected, order 2",
        dimension: 3,
        model: law!("{correspondence: {law: ", ", kinematics: {corrected: {order: 2}}, control: wan_2019_objective}}"),
    },
    Model { name: "octants", dimension: 3, model: law!("{correspondence: {law: ", ", kinematics: {sub_horizons: {partition: octants}}}}") },
    Model { name: "extended, exponent 1", dimension: 3, model: linear!("{extended_correspondence: {law: ", ", exponent: 1}}") },
    Model { name: "extended, exponent 0", dimension: 3, model: linear!("{extended_correspondence: {law: ", ", exponent: 0}}") },
    Model { name: "extended, exponent -0.5", dimension: 3, model: linear!("{extended_correspondence: {law: ", ", exponent: -0.5}}") },
    Model { name: "bond-based", dimension: 2, model: "{bond_based: {youngs_modulus: 1.5*K, calibration: continuum}}" },
    Model { name: "linear solid", dimension: 2, model: "{linear_peridynamic_solid: {bulk_modulus: K, shear_modulus: 0.6*K}}" },
    Model { name: "correspondence + control", dimension: 2, model: law!("{correspondence: {law: ", ", control: wan_2019}}") },
    Model {
        name: "corrected, order 3",
        dimension: 2,
        model: law!("{correspondence: {law: ", ", kinematics: {corrected: {order: 3}}, control: wan_2019_objective}}"),
    },
    Model {
        name: "quadrants",
        dimension: 2,
        model: law!("{correspondence: {law: ", ", kinematics: {sub_horizons: {partition: quadrants}}}}"),
    },
    Model { name: "extended, exponent 1", dimension: 2, model: linear!("{extended_correspondence: {law: ", ", exponent: 1}}") },
    Model { name: "bond-based", dimension: 1, model: "{bond_based: {youngs_modulus: 1.5*K, calibration: continuum}}" },
    Model { name: "correspondence + control", dimension: 1, model: law!("{correspondence: {law: ", ", control: wan_2019}}") },
];

/// Time step of all blocks, about half the stable one.
pub const STEP: f64 = 50e-9;

/// Horizon ratio in a dimension: 122, 60 and 20 neighbours.
pub fn horizon(dimension: usize) -> f64 {
    match dimension {
        3 => 3.015,
        2 => 3.1 * std::f64::consts::SQRT_2,
        _ => 10.1,
    }
}

/// A block ready to be advanced.
pub struct Block {
    /// The body.
    pub model: Box<dyn Simulated>,
    /// Displacements, zero.
    pub u: Vec<f64>,
    /// Velocities: stretched along x.
    pub v: Vec<f64>,
    /// Material points.
    pub points: usize,
    /// Directed bonds.
    pub bonds: usize,
    /// Bytes of the body.
    pub bytes: usize,
    /// Seconds of points, sorting and neighbour search, and of building the body.
    pub seconds: (f64, f64),
}

/// What pushes a block, beside nothing.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Push {
    /// Free surfaces.
    Nothing,
    /// A force that varies in space and time on every point, and a wall that half of the points touch.
    LoadAndWall,
}

/// The deck of a block of so many cells, glass, spacing 0.5 mm, stretched by its initial velocity.
pub fn deck(model: &Model, cells: [usize; 3], steps: usize, push: Push) -> String {
    let d = model.dimension;
    let low = vec!["-dx/2"; d].join(", ");
    let high = cells[..d].iter().map(|n| format!("{n}*dx - dx/2")).collect::<Vec<_>>().join(", ");
    let (shape, section) = match d {
        3 => ("box", ""),
        2 => ("rectangle", "  plane: strain\n  thickness: 1 m\n"),
        _ => ("line", "  area: 1 m^2\n"),
    };
    let wall = |first: &str| [first, "0", "0"][..d].join(", ");
    let pushed = match push {
        Push::Nothing => String::new(),
        Push::LoadAndWall => format!(
            "  - force_density: {{set: all, x: \"1e4*x*(1 + t)\"}}\n  - rigid_wall: {{normal: [{}], at: [{}], stiffness: 1e9 N/m^4}}\n",
            wall("1"),
            wall(&format!("{}*dx/2", cells[0]))
        ),
    };
    let corners = if d == 1 { format!("from: {low}, to: {high}") } else { format!("from: [{low}], to: [{high}]") };
    format!(
        "title: block\nparameters: {{dx: 0.5 mm, K: 14.9 GPa}}\nbody:\n  dimension: {d}\n{section}  points:\n    - {shape}: {{{corners}, spacing: dx}}\n  \
         horizon: {horizon}*dx\nmaterials:\n  glass:\n    density: 2200 kg/m^3\n    model: {model}\nconditions:\n  \
         - initial_velocity: {{set: all, x: \"-1 + 2*x/({n}*dx)\"}}\n{pushed}solver:\n  velocity_verlet: {{steps: {steps}, step: 50 ns}}\n",
        horizon = horizon(d),
        model = model.model,
        n = cells[0],
    )
}

/// Builds the block of a model, with free surfaces.
///
/// # Panics
/// With the program's own message, where it refuses the deck.
pub fn block(model: &Model, cells: [usize; 3]) -> Block {
    block_under(model, cells, Push::Nothing)
}

/// Builds the block of a model.
///
/// # Panics
/// With the program's own message, where it refuses the deck.
pub fn block_under(model: &Model, cells: [usize; 3], push: Push) -> Block {
    let clock = std::time::Instant::now();
    let refused = |e: peridyne::deck::DeckErrors| -> ! { panic!("{}, {} D: {e}", model.name, model.dimension) };
    let deck = Deck::from_text(deck(model, cells, 1, push), Path::new("block.yaml"), &[], None).unwrap_or_else(|e| refused(e));
    let problem = Problem::new(deck).unwrap_or_else(|e| refused(e));
    let searched = clock.elapsed().as_secs_f64();
    let assembly = assemble(&problem).unwrap_or_else(|e| refused(e));
    let built = clock.elapsed().as_secs_f64() - searched;
    let dofs = solvers::problem::Dynamics::dofs(&*assembly.model);
    let (u, v) = initial_state(&problem, dofs);
    let (bonds, _, bytes) = assembly.model.sizes();
    let points = problem.cloud.len();
    Block { model: assembly.model, u, v, points, bonds, bytes: bytes.0 + bytes.1 + bytes.2, seconds: (searched, built) }
}
