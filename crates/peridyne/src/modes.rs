//! Linear eigenproblems of a deck: natural vibrations, and the loads at which the reference state buckles.

use crate::deck::{self, Solver};
use crate::problem::Problem;
use bodies::structure::Simulated;
use solvers::eigen::{EigenError, largest_eigenvalue, lowest_modes};
use solvers::load_steps::Equilibrium;
use solvers::newton::{LinearSolver, Newton, NewtonOptions};
use solvers::problem::{Dynamics, Statics};
use solvers::sparse::BlockMatrix;
use thin::buckling::buckling_loads;

/// Modes that were found.
#[derive(Clone, Debug)]
pub struct Found {
    /// What their values are called: `factor`, or `angular_frequency`.
    pub what: &'static str,
    /// Factors of the load, or angular frequencies (1/time), ascending.
    pub values: Vec<f64>,
    /// Shapes, one after another, with a largest component of a hundredth of the body.
    pub shapes: Vec<f64>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

impl Found {
    /// Columns of the table of modes.
    pub fn columns(&self) -> Vec<&'static str> {
        if self.what == "factor" { vec!["mode", "factor"] } else { vec!["mode", "angular_frequency", "frequency"] }
    }

    /// Rows of the table of modes.
    pub fn rows(&self) -> Vec<Vec<f64>> {
        let row = |(k, value): (usize, &f64)| {
            let mut row = vec![(k + 1) as f64, *value];
            if self.what != "factor" {
                row.push(value / std::f64::consts::TAU);
            }
            row
        };
        self.values.iter().enumerate().map(row).collect()
    }

    /// Named values for expectations: `factor.1`, or `angular_frequency.1` and `frequency.1`, ….
    pub fn quantities(&self) -> Vec<(String, f64)> {
        let columns = self.columns();
        self.rows()
            .iter()
            .flat_map(|row| (1..row.len()).map(|c| (format!("{}.{}", columns[c], row[0]), row[c])).collect::<Vec<_>>())
            .collect()
    }
}

/// Solves the eigenproblem of a deck about the displacements `u` (vibration) or the reference state (buckling).
///
/// # Errors
/// Why there are no modes.
pub fn solve(problem: &Problem, model: &mut dyn Simulated, u: &[f64]) -> Result<Found, String> {
    model.set_statics(true);
    let threads = rayon::current_num_threads();
    let mut found = match &problem.deck.solver {
        Solver::Vibration(v) => vibration(model, u, v.modes.value as usize, v.tolerance.value, threads)?,
        Solver::Buckling(b) => buckling(problem, model, b, threads)?,
        _ => return Err("this solver has no modes".into()),
    };
    // largest component a hundredth of the body, first of those positive
    let positions = Statics::positions(model);
    let points = u.len() / Statics::dofs_per_point(model).max(1);
    let d = positions.len() / points.max(1);
    let extent = |k: usize| {
        let (low, high) =
            (0..points).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(positions[p * d + k]), b.max(positions[p * d + k])));
        high - low
    };
    let size = (0..d).map(extent).fold(0.0, f64::hypot);
    for shape in found.shapes.chunks_mut(u.len().max(1)) {
        let top = shape.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let first = shape.iter().copied().find(|x| x.abs() > 0.999 * top).unwrap_or(1.0);
        shape.iter_mut().for_each(|x| *x *= 0.01 * size / (top * first.signum()));
    }
    Ok(found)
}

fn vibration(model: &mut dyn Simulated, u: &[f64], count: usize, tolerance: f64, threads: usize) -> Result<Found, String> {
    let fixed = Statics::fixed(model).to_vec();
    let mass = Dynamics::mass(model).to_vec();
    let positions = Statics::positions(model).to_vec();
    let free = fixed.iter().filter(|f| !**f).count();
    let count = count.min(free);
    let pattern = Statics::pattern(model).ok_or("the stiffness of this body is too large to be assembled: use fewer points")?;
    let mut stiffness = BlockMatrix::new(pattern);
    Statics::tangent(model, 0.0, u, &mut stiffness).map_err(|e| e.to_string())?;
    let mut warnings = vec![];
    let mut shift = 0.0;
    let modes = loop {
        match lowest_modes(&stiffness, &mass, &fixed, &positions, count, shift, tolerance, threads) {
            Ok(modes) => break modes,
            // a body that is free to move has rigid motions of no frequency: a shift far below all others keeps the factor regular
            Err(EigenError::Direct(_)) => {
                let product = |x: &[f64], y: &mut [f64]| {
                    stiffness.product(x, y);
                    Ok(())
                };
                let largest = largest_eigenvalue(product, &mass, &fixed, 1e-2).map_err(|e| e.to_string())?.upper;
                if shift == 0.0 {
                    warnings.push("the body is free to move, or its state unstable: modes without stiffness are among those found".into());
                }
                shift = if shift == 0.0 { 1e-12 * largest } else { 10.0 * shift };
                if shift > 1e-3 * largest {
                    return Err("the stiffness has negative eigenvalues: the state is unstable".into());
                }
            }
            Err(e) => return Err(e.to_string()),
        }
    };
    let values = modes.values.iter().map(|v| v.signum() * v.abs().sqrt()).collect();
    Ok(Found { what: "angular_frequency", values, shapes: modes.vectors, warnings })
}

fn buckling(problem: &Problem, model: &mut dyn Simulated, options: &deck::Buckling, threads: usize) -> Result<Found, String> {
    let n = Statics::dofs(model);
    let mut warnings = vec![];
    let tension = problem.deck.materials.iter().any(|(_, m)| matches!(&m.model, deck::Model::BondMultiplePlate(p) if p.tension.is_some()));
    let mut along = vec![0.0; n];
    if !tension {
        let newton = NewtonOptions { linear: true, threads, solver: LinearSolver::Direct, ..NewtonOptions::default() };
        Newton::new(newton)
            .equilibrate(&mut &mut *model, options.end.value, &mut along, None)
            .map_err(|e| format!("the state under the load: {e}"))?;
    }
    let largest = along.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    if largest == 0.0 && !tension {
        return Err(
            "nothing loads the body: give loads or prescribed displacements, or to a plate that moves across alone a `tension`".into()
        );
    }
    let zero = vec![0.0; n];
    let fixed = Statics::fixed(model).to_vec();
    let positions = Statics::positions(model).to_vec();
    let pattern = Statics::pattern(model).ok_or("the stiffness of this body is too large to be assembled: use fewer points")?;
    let fail = |e: solvers::problem::Stop| e.to_string();
    let mut stiffness = BlockMatrix::new(pattern.clone());
    Statics::tangent(model, 0.0, &zero, &mut stiffness).map_err(fail)?;
    let mut change = BlockMatrix::new(pattern.clone());
    if !Statics::tangent_change(model, 0.0, &zero, &along, &mut change).map_err(fail)? {
        // central difference: tangents are smooth, and a step of 1e-5 of the spacing keeps about nine digits
        let spacing = problem.cloud.spacing.iter().fold(f64::INFINITY, |m, h| m.min(*h));
        let step = 1e-5 * spacing / largest;
        let mut at = |factor: f64| {
            let mut matrix = BlockMatrix::new(pattern.clone());
            let u: Vec<f64> = along.iter().map(|x| factor * x).collect();
            Statics::tangent(model, 0.0, &u, &mut matrix).map(|()| matrix)
        };
        let (plus, minus) = (at(step).map_err(fail)?, at(-step).map_err(fail)?);
        let d = pattern.block();
        let mut block = vec![0.0; d * d];
        for column in 0..pattern.points() {
            for (k, &row) in pattern.column(column).iter().enumerate() {
                let slot = (pattern.first_slot(column) + k) * d * d;
                for i in 0..d {
                    for j in 0..d {
                        // blocks of the matrix are column-major
                        block[i * d + j] = (plus.values()[slot + j * d + i] - minus.values()[slot + j * d + i]) / (2.0 * step);
                    }
                }
                let _ = change.add_block(row as usize, column, &block);
            }
        }
        warnings.push("the change of the stiffness was found by differences: about eight digits of the factors are right".into());
    }
    let count = options.modes.value as usize;
    let found =
        buckling_loads(&stiffness, &change, &fixed, &positions, count, options.tolerance.value, threads).map_err(|e| e.to_string())?;
    // a tension is in the stiffness already, once
    let base = if tension { 1.0 } else { 0.0 };
    Ok(Found { what: "factor", values: found.factors.iter().map(|f| base + f).collect(), shapes: found.modes, warnings })
}
