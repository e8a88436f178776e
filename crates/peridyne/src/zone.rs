//! The whole Brillouin zone of a plane lattice as a map: what every wave costs, beside the local solid.

use crate::output::OutputError;
use crate::output::color::ColorMap;
use crate::output::picture::{self, Body, Deformation, Options, Range, Shown};
use crate::output::table::History;
use bodies::points::Lattice;
use bodies::spectrum::{Symbol, wave_vector};
use std::path::Path;

/// Wave vectors from one border of the zone to the other, both included.
const SIDE: usize = 97;

/// One wave vector of the map.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// In units of π over the spacing, from −1 to 1.
    pub fraction: [f64; 2],
    /// Stiffness over that of the local solid, by ascending stiffness; NaN at the origin, where there is no wave.
    pub ratio: [f64; 2],
}

/// The map of a lattice in the plane.
pub fn map(symbol: &Symbol, lattice: &Lattice) -> Vec<Cell> {
    let at = |i: usize| 2.0 * i as f64 / (SIDE - 1) as f64 - 1.0;
    (0..SIDE * SIDE)
        .map(|q| {
            let fraction = [at(q % SIDE), at(q / SIDE)];
            if fraction == [0.0; 2] {
                return Cell { fraction, ratio: [f64::NAN; 2] };
            }
            let branches = symbol.branches(wave_vector(lattice, 2, [fraction[0], fraction[1], 0.0]));
            Cell { fraction, ratio: std::array::from_fn(|b| branches.get(b).map_or(f64::NAN, |b| b.ratio())) }
        })
        .collect()
}

/// Writes the map as `zone.csv`, and the weakest wave as `zone.png`, with a suffix.
///
/// # Errors
/// [`OutputError`].
pub fn write(cells: &[Cell], folder: &Path, title: &str, suffix: &str) -> Result<(), OutputError> {
    let mut table = History::create(&folder.join(format!("zone{suffix}.csv")), &["fraction.x", "fraction.y", "ratio.1", "ratio.2"])?;
    for c in cells {
        table.append(&[c.fraction[0], c.fraction[1], c.ratio[0], c.ratio[1]])?;
    }
    let reference: Vec<[f64; 3]> = cells.iter().map(|c| [c.fraction[0], c.fraction[1], 0.0]).collect();
    let displacement = vec![[0.0; 3]; cells.len()];
    let edge = vec![2.0 / (SIDE - 1) as f64; cells.len()];
    let mut values: Vec<f64> = cells.iter().map(|c| c.ratio[0]).collect();
    // the origin shows the long-wave limit
    values.iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = 1.0);
    let body = Body { dimension: 2, reference: &reference, displacement: &displacement, edge: &edge };
    // below this it is the round-off of a wave without energy
    let unstable = values.iter().any(|v| *v < -1e-9);
    if !unstable {
        values.iter_mut().for_each(|v| *v = v.max(0.0));
    }
    let options = Options {
        title: Some(title.to_string()),
        caption: Some("weakest wave over the local solid; axes in π over the spacing".into()),
        colors: if unstable { ColorMap::Diverging } else { ColorMap::Viridis },
        range: if unstable { Range::Symmetric } else { Range::Auto },
        deformation: Deformation::Factor(1.0),
        ..Options::default()
    };
    picture::draw(&body, &Shown { name: "stiffness ratio", unit: None, values: &values }, &options)?
        .write(&folder.join(format!("zone{suffix}.png")))
}
