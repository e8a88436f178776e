//! Linear buckling: the loads at which `K + λ K_σ` is singular; and vibration, by the modes of `K`.

use crate::body::Thin;
use crate::structure::ThinStructure;
use crate::weights::symmetric_eigen;
use solvers::direct::{DirectError, SparseCholesky};
use solvers::eigen::{EigenError, Modes, lowest_modes};
use solvers::problem::{Dynamics, Statics, Stop};
use solvers::sparse::BlockMatrix;
use solvers::vector;

/// Buckling loads.
#[derive(Clone, Debug, PartialEq)]
pub struct BucklingLoads {
    /// Factors λ of the load, ascending, positive.
    pub factors: Vec<f64>,
    /// Modes, one after another, each of the length of all dofs, largest entry 1.
    pub modes: Vec<f64>,
    /// Iterations made.
    pub iterations: usize,
}

/// Why there are none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BucklingError {
    /// The body stopped.
    #[error(transparent)]
    Evaluation(#[from] Stop),
    /// The stiffness could not be factored.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The load does not make anything buckle.
    #[error("{found} of {asked} buckling loads found: the load pulls, or there are fewer free dofs; reverse the load or ask for fewer")]
    Fewer {
        /// Number found.
        found: usize,
        /// Number asked for.
        asked: usize,
    },
    /// Iteration ended early.
    #[error("buckling loads changed by {change:.1e} (relative) in the last of {iterations} iterations")]
    NotConverged {
        /// Iterations made.
        iterations: usize,
        /// Largest relative change in the last one.
        change: f64,
    },
}

/// The lowest positive λ of `K x = −λ K_σ x`, by subspace iteration with the factor of `K` on `−K_σ x = μ K x`, μ = 1/λ. `geometric` is
/// `K_σ`, with the pattern of `stiffness`.
///
/// # Errors
/// [`BucklingError`].
pub fn buckling_loads(
    stiffness: &BlockMatrix,
    geometric: &BlockMatrix,
    fixed: &[bool],
    positions: &[f64],
    count: usize,
    tolerance: f64,
    threads: usize,
) -> Result<BucklingLoads, BucklingError> {
    const MOST_ITERATIONS: usize = 500;
    let n = fixed.len();
    let free = fixed.iter().filter(|f| !**f).count();
    let size = (2 * count).max(count + 8).min(free);
    if count == 0 || count > free {
        return Err(BucklingError::Fewer { found: 0, asked: count });
    }
    let mut factor = SparseCholesky::analyze(stiffness.pattern().clone(), positions, fixed, threads)?;
    factor.factor(stiffness, None)?;
    let mut basis = vec![0.0; n * size];
    vector::fill_seeded(&mut basis, 0x5045_5249);
    basis.chunks_mut(n).for_each(|x| vector::clear_fixed(x, fixed));
    let (mut images, mut right) = (vec![0.0; n * size], vec![0.0; n]);
    let mut values = vec![0.0; size];
    for iteration in 1..=MOST_ITERATIONS {
        for (x, z) in basis.chunks(n).zip(images.chunks_mut(n)) {
            geometric.product(x, &mut right);
            right.iter_mut().for_each(|r| *r = -*r);
            vector::clear_fixed(&mut right, fixed);
            factor.solve(&right, z)?;
        }
        // orthonormal in K, twice
        for k in 0..size {
            for _ in 0..2 {
                let (done, rest) = images.split_at_mut(k * n);
                let z = &mut rest[..n];
                stiffness.product(z, &mut right);
                vector::clear_fixed(&mut right, fixed);
                for other in done.chunks(n) {
                    let share = vector::dot(other, &right);
                    vector::add_scaled(z, -share, other);
                }
                stiffness.product(z, &mut right);
                vector::clear_fixed(&mut right, fixed);
                let norm = vector::dot(z, &right).max(0.0).sqrt();
                if norm > 0.0 {
                    z.iter_mut().for_each(|x| *x /= norm);
                }
            }
        }
        let mut reduced = vec![0.0; size * size];
        for b in 0..size {
            geometric.product(&images[b * n..(b + 1) * n], &mut right);
            for a in 0..=b {
                let value = -vector::dot(&images[a * n..(a + 1) * n], &right);
                (reduced[a * size + b], reduced[b * size + a]) = (value, value);
            }
        }
        let (mu, vectors) = symmetric_eigen(&mut reduced, size);
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|&a, &b| mu[b].total_cmp(&mu[a]));
        let mut change = 0.0f64;
        basis.fill(0.0);
        for (k, &from) in order.iter().enumerate() {
            if k < count {
                change = change.max(((mu[from] - values[k]) / mu[from]).abs());
            }
            values[k] = mu[from];
            for (a, z) in images.chunks(n).enumerate() {
                vector::add_scaled(&mut basis[k * n..(k + 1) * n], vectors[a * size + from], z);
            }
        }
        if (iteration > 1 && change <= tolerance) || size == free {
            let found = values[..count].iter().filter(|m| **m > 0.0).count();
            if found < count {
                return Err(BucklingError::Fewer { found, asked: count });
            }
            basis.truncate(count * n);
            for x in basis.chunks_mut(n) {
                let top = x.iter().fold(0.0, |m: f64, v| if v.abs() > m.abs() { *v } else { m });
                x.iter_mut().for_each(|v| *v /= top);
            }
            return Ok(BucklingLoads { factors: values[..count].iter().map(|m| 1.0 / m).collect(), modes: basis, iterations: iteration });
        }
        if iteration == MOST_ITERATIONS {
            return Err(BucklingError::NotConverged { iterations: iteration, change });
        }
    }
    unreachable!("the last iteration returns")
}

/// `K` and `K_σ = dK/dλ` of a body under displacements λ `u` about its reference: exact, see [`crate::stability`].
///
/// # Errors
/// [`BucklingError::Evaluation`], also where the reference state is not straight and free of stress.
pub fn stiffness_and_its_change<const D: usize>(body: &mut Thin<D>, u: &[f64]) -> Result<(BlockMatrix, BlockMatrix), BucklingError> {
    let fail = |e: crate::ThinError| BucklingError::Evaluation(Stop::new(e.to_string()));
    let pattern = body.pattern().map_err(fail)?;
    let mut stiffness = BlockMatrix::new(pattern.clone());
    body.tangent(&vec![0.0; u.len()], &mut stiffness).map_err(fail)?;
    let mut change = BlockMatrix::new(pattern);
    if !body.tangent_change(u, &mut change).map_err(fail)? {
        let why = "the change of the stiffness is known about straight, stress-free bodies with displacements along them only";
        return Err(Stop::new(why).into());
    }
    Ok((stiffness, change))
}

/// The `count` lowest vibration modes about the state `u`: eigenvalues are squares of circular frequencies.
///
/// # Errors
/// [`EigenError`].
pub fn vibration_modes<const D: usize>(
    structure: &mut ThinStructure<D>,
    u: &[f64],
    count: usize,
    tolerance: f64,
    threads: usize,
) -> Result<Modes, EigenError> {
    let pattern = structure.body.pattern().map_err(|e| Stop::new(e.to_string()))?;
    let mut stiffness = BlockMatrix::new(pattern);
    Statics::tangent(structure, 0.0, u, &mut stiffness)?;
    let fixed = Statics::fixed(structure).to_vec();
    let (mass, positions) = (Dynamics::mass(structure).to_vec(), structure.positions().to_vec());
    lowest_modes(&stiffness, &mass, &fixed, &positions, count, 0.0, tolerance, threads)
}
