//! Eigenvalues of `K x = λ M x` with lumped mass: the largest one, and the lowest modes.

use crate::direct::{DirectError, SparseCholesky};
use crate::problem::Stop;
use crate::sparse::BlockMatrix;
use crate::vector;

/// Why eigenvalues were not found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EigenError {
    /// The body stopped.
    #[error(transparent)]
    Evaluation(#[from] Stop),
    /// The shifted stiffness could not be factored.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// No free dof, or fewer than the modes asked for.
    #[error("{asked} eigenvalues of {free} free dofs were asked for")]
    TooFewDofs {
        /// Number of eigenvalues asked for.
        asked: usize,
        /// Number of free dofs.
        free: usize,
    },
    /// A mass that cannot be divided by.
    #[error("dof {dof} has mass {mass}; the mass of every free dof must be positive and finite")]
    Mass {
        /// The dof.
        dof: usize,
        /// Its mass.
        mass: f64,
    },
    /// The largest eigenvalue is zero, negative or not a number.
    #[error("the largest eigenvalue of the stiffness is {value}: there is no positive stiffness, or a state that is not a number")]
    NoStiffness {
        /// The value found.
        value: f64,
    },
    /// Iteration ended early.
    #[error(
        "the eigenvalues changed by {change:.1e} (relative) in the last of {iterations} iterations: ask for fewer modes or more iterations"
    )]
    NotConverged {
        /// Iterations made.
        iterations: usize,
        /// Largest relative change in the last one.
        change: f64,
    },
}

/// Estimate of a largest eigenvalue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LargestEigenvalue {
    /// Ritz value: a lower bound.
    pub value: f64,
    /// Ritz value plus norm of its residual: there is an eigenvalue between the two, and none above but by bad luck of the start.
    pub upper: f64,
    /// The lowest Ritz value: negative where the stiffness is not that of a stable state.
    pub lowest: f64,
    /// Products used.
    pub iterations: usize,
}

/// Most products of a Lanczos iteration; the bound found then is used as it is, conservative if not sharp.
const MOST_PRODUCTS: usize = 300;
/// Seed of start vectors.
const SEED: u64 = 0x0050_4552_4944_594E;

fn check_mass(mass: &[f64], fixed: &[bool]) -> Result<(), EigenError> {
    match (0..mass.len()).find(|&k| !fixed[k] && (mass[k] <= 0.0 || !mass[k].is_finite())) {
        Some(dof) => Err(EigenError::Mass { dof, mass: mass[dof] }),
        None => Ok(()),
    }
}

/// Largest eigenvalue of `M⁻¹K` over the free dofs, for a symmetric `K` given by its products (Lanczos 1950; Paige 1972 for why
/// lost orthogonality does no harm to extreme values). Stops when the residual is below `tolerance` times the value.
///
/// # Errors
/// [`EigenError`].
pub fn largest_eigenvalue(
    mut product: impl FnMut(&[f64], &mut [f64]) -> Result<(), Stop>,
    mass: &[f64],
    fixed: &[bool],
    tolerance: f64,
) -> Result<LargestEigenvalue, EigenError> {
    check_mass(mass, fixed)?;
    let n = mass.len();
    let free = fixed.iter().filter(|f| !**f).count();
    if free == 0 {
        return Err(EigenError::TooFewDofs { asked: 1, free });
    }
    let root: Vec<f64> = mass.iter().zip(fixed).map(|(m, f)| if *f { 0.0 } else { m.sqrt().recip() }).collect();
    let (mut previous, mut current, mut next) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut scaled = vec![0.0; n];
    vector::fill_seeded(&mut current, SEED);
    vector::clear_fixed(&mut current, fixed);
    let length = vector::norm(&current);
    current.iter_mut().for_each(|x| *x /= length);
    let (mut alphas, mut betas): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    loop {
        for k in 0..n {
            scaled[k] = root[k] * current[k];
        }
        product(&scaled, &mut next)?;
        for k in 0..n {
            // Fixed entries of a product may hold anything, NaN included.
            next[k] = if fixed[k] { 0.0 } else { root[k] * next[k] };
        }
        if let Some(beta) = betas.last() {
            vector::add_scaled(&mut next, -beta, &previous);
        }
        let alpha = vector::dot(&current, &next);
        vector::add_scaled(&mut next, -alpha, &current);
        let beta = vector::norm(&next);
        alphas.push(alpha);
        if !(alpha.is_finite() && beta.is_finite()) {
            return Err(EigenError::NoStiffness { value: f64::NAN });
        }
        let count = alphas.len();
        let scale = alphas.iter().chain(&betas).fold(0.0f64, |s, x| s.max(x.abs()));
        let exhausted = count >= free || beta <= 1e-14 * scale;
        if exhausted || count >= MOST_PRODUCTS || count.is_multiple_of(4) {
            let (value, last) = largest_of_tridiagonal(&alphas, &betas);
            let residual = if exhausted { 0.0 } else { beta * last };
            if exhausted || count >= MOST_PRODUCTS || residual <= tolerance * value {
                if value <= 0.0 || value.is_nan() {
                    return Err(EigenError::NoStiffness { value });
                }
                let negated: Vec<f64> = alphas.iter().map(|a| -a).collect();
                let lowest = -largest_of_tridiagonal(&negated, &betas).0;
                return Ok(LargestEigenvalue { value, upper: value + residual, lowest, iterations: count });
            }
        }
        betas.push(beta);
        next.iter_mut().for_each(|x| *x /= beta);
        std::mem::swap(&mut previous, &mut current);
        std::mem::swap(&mut current, &mut next);
    }
}

/// Largest eigenvalue of a symmetric tridiagonal matrix and the size of the last component of its unit eigenvector: implicit QL
/// (Golub and Welsch 1969, Math. Comp. 23) on the matrix turned around, of whose vectors the first components are kept.
fn largest_of_tridiagonal(alphas: &[f64], betas: &[f64]) -> (f64, f64) {
    let n = alphas.len();
    let mut d: Vec<f64> = alphas.iter().rev().copied().collect();
    let mut e: Vec<f64> = betas[..n - 1].iter().rev().copied().chain([0.0]).collect();
    let mut z = vec![0.0; n];
    z[0] = 1.0;
    for l in 0..n {
        for _ in 0..60 {
            let m = (l..n - 1).find(|&m| e[m].abs() <= f64::EPSILON * (d[m].abs() + d[m + 1].abs())).unwrap_or(n - 1);
            if m == l {
                break;
            }
            let mut g = (d[l + 1] - d[l]) / (2.0 * e[l]);
            let r = g.hypot(1.0);
            g = d[m] - d[l] + e[l] / (g + r.copysign(g));
            let (mut s, mut c, mut p) = (1.0, 1.0, 0.0);
            let mut split = false;
            for i in (l..m).rev() {
                let (f, b) = (s * e[i], c * e[i]);
                let r = f.hypot(g);
                e[i + 1] = r;
                if r == 0.0 {
                    d[i + 1] -= p;
                    e[m] = 0.0;
                    split = true;
                    break;
                }
                (s, c) = (f / r, g / r);
                g = d[i + 1] - p;
                let r = (d[i] - g) * s + 2.0 * c * b;
                p = s * r;
                d[i + 1] = g + p;
                g = c * r - b;
                let f = z[i + 1];
                z[i + 1] = s * z[i] + c * f;
                z[i] = c * z[i] - s * f;
            }
            if !split {
                d[l] -= p;
                e[l] = g;
                e[m] = 0.0;
            }
        }
    }
    let top = (0..n).max_by(|&a, &b| d[a].total_cmp(&d[b])).unwrap_or(0);
    (d[top], z[top].abs())
}

/// Lowest modes of a structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    /// Eigenvalues `λ = ω²`, ascending.
    pub values: Vec<f64>,
    /// Eigenvectors, one after another, each of the length of all dofs, zero at fixed ones, with `xᵀ M x = 1`.
    pub vectors: Vec<f64>,
    /// Iterations made.
    pub iterations: usize,
}

/// The `count` lowest modes of `K x = λ M x` over the free dofs, by subspace iteration with the factor of `K + σ M` (Bathe and Wilson
/// 1972), which finds repeated eigenvalues with all their vectors.
///
/// `shift` is `σ ≥ 0` `\[1/time²\]`: 0 for a supported body; for a free one a positive number well below the first non-zero `λ` wanted,
/// so that rigid motions, of `λ = 0`, do not make the matrix singular. `positions` as for
/// [`SparseCholesky::analyze`]. Iterates until no wanted value changes by more than `tolerance` times itself plus `σ`.
///
/// # Errors
/// [`EigenError`].
pub fn lowest_modes(
    stiffness: &BlockMatrix,
    mass: &[f64],
    fixed: &[bool],
    positions: &[f64],
    count: usize,
    shift: f64,
    tolerance: f64,
    threads: usize,
) -> Result<Modes, EigenError> {
    const MOST_ITERATIONS: usize = 200;
    check_mass(mass, fixed)?;
    let n = mass.len();
    let free = fixed.iter().filter(|f| !**f).count();
    if count == 0 || count > free {
        return Err(EigenError::TooFewDofs { asked: count, free });
    }
    let mut factor = SparseCholesky::analyze(stiffness.pattern().clone(), positions, fixed, threads)?;
    let addition: Vec<f64> = mass.iter().map(|m| shift * m).collect();
    factor.factor(stiffness, Some(&addition))?;
    let size = (2 * count).max(count + 8).min(free);
    let mut basis = vec![0.0; n * size];
    vector::fill_seeded(&mut basis, SEED);
    basis.chunks_mut(n).for_each(|x| vector::clear_fixed(x, fixed));
    let (mut weighted, mut images) = (vec![0.0; n * size], vec![0.0; n * size]);
    let mut values = vec![0.0; size];
    for iteration in 1..=MOST_ITERATIONS {
        // Images Z = (K + σM)⁻¹ M X, orthonormal in M by Gram and Schmidt (twice), then Rayleigh and Ritz.
        for (x, z) in basis.chunks(n).zip(images.chunks_mut(n)) {
            for k in 0..n {
                weighted[k] = mass[k] * x[k];
            }
            factor.solve(&weighted[..n], z)?;
        }
        orthonormalize(&mut images, mass, fixed, n);
        let mut reduced = faer::Mat::<f64>::zeros(size, size);
        for (z, w) in images.chunks(n).zip(weighted.chunks_mut(n)) {
            stiffness.product(z, w);
            vector::clear_fixed(w, fixed);
        }
        for a in 0..size {
            for b in 0..=a {
                let value = vector::dot(&images[a * n..(a + 1) * n], &weighted[b * n..(b + 1) * n]);
                reduced[(a, b)] = value;
                reduced[(b, a)] = value;
            }
        }
        let decomposition = reduced
            .self_adjoint_eigen(faer::Side::Lower)
            .map_err(|_| EigenError::NotConverged { iterations: iteration, change: f64::NAN })?;
        let mut change = 0.0f64;
        for k in 0..size {
            let value = decomposition.S()[k];
            if k < count {
                change = change.max((value - values[k]).abs() / (value.abs() + shift));
            }
            values[k] = value;
        }
        basis.fill(0.0);
        for (k, x) in basis.chunks_mut(n).enumerate() {
            for (a, z) in images.chunks(n).enumerate() {
                vector::add_scaled(x, decomposition.U()[(a, k)], z);
            }
        }
        if (iteration > 1 && change <= tolerance) || size == free {
            values.truncate(count);
            basis.truncate(count * n);
            return Ok(Modes { values, vectors: basis, iterations: iteration });
        }
        if iteration == MOST_ITERATIONS {
            return Err(EigenError::NotConverged { iterations: iteration, change });
        }
    }
    unreachable!("the last iteration returns")
}

/// Makes the columns orthonormal in the mass; a column that depends on the others is replaced by a fresh seeded one.
fn orthonormalize(columns: &mut [f64], mass: &[f64], fixed: &[bool], n: usize) {
    let mut weighted = vec![0.0; n];
    for k in 0..columns.len() / n {
        let (done, rest) = columns.split_at_mut(k * n);
        let column = &mut rest[..n];
        for attempt in 0..3u64 {
            let before = mass_norm(column, mass);
            for _ in 0..2 {
                for other in done.chunks(n) {
                    for i in 0..n {
                        weighted[i] = mass[i] * column[i];
                    }
                    let share = vector::dot(other, &weighted);
                    vector::add_scaled(column, -share, other);
                }
            }
            let after = mass_norm(column, mass);
            if after > 1e-10 * before {
                column.iter_mut().for_each(|x| *x /= after);
                break;
            }
            vector::fill_seeded(column, SEED + 1 + k as u64 + 1000 * attempt);
            vector::clear_fixed(column, fixed);
        }
    }
}

fn mass_norm(x: &[f64], mass: &[f64]) -> f64 {
    x.iter().zip(mass).filter(|(x, _)| **x != 0.0).map(|(x, m)| m * x * x).sum::<f64>().sqrt()
}
