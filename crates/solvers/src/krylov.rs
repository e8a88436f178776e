//! Iterative linear solvers: conjugate gradients and flexible restarted GMRES, with preconditioners.
//!
//! All work on the free dofs: the solution is zero where `fixed`, and the operator's output is not read there.

use crate::problem::Stop;
use crate::vector;

/// An approximate inverse.
pub trait Preconditioner {
    /// `z ≈ A⁻¹ r`. For conjugate gradients it must be symmetric positive definite and the same in every call of one solution.
    /// Fixed entries of `r` are zero; those of `z` are not read.
    fn apply(&mut self, r: &[f64], z: &mut [f64]);
}

/// No preconditioning.
#[derive(Clone, Copy, Debug, Default)]
pub struct Identity;

impl Preconditioner for Identity {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
    }
}

/// Inverses of the `D×D` diagonal blocks.
#[derive(Clone, Debug, Default)]
pub struct BlockJacobi {
    block: usize,
    inverses: Vec<f64>,
}

impl BlockJacobi {
    /// Inverts the free part of each symmetric row-major block. A block that is not positive definite is replaced by the absolute
    /// values of its diagonal (or, where that vanishes, by the mean of all diagonals), so that the preconditioner is always positive.
    ///
    /// # Panics
    /// Where `blocks` does not hold `block²` entries for each `block` dofs.
    pub fn new(block: usize, blocks: &[f64], fixed: &[bool]) -> Self {
        assert_eq!(blocks.len(), fixed.len() * block);
        let diagonal = |k: usize| blocks[(k / block) * block * block + (k % block) * (block + 1)].abs();
        let (mut sum, mut count) = (0.0, 0.0);
        for k in (0..fixed.len()).filter(|&k| !fixed[k] && diagonal(k).is_finite()) {
            sum += diagonal(k);
            count += 1.0;
        }
        let mean = if sum > 0.0 { sum / count } else { 1.0 };
        let mut inverses = vec![0.0; blocks.len()];
        let (mut lower, mut unit) = (vec![0.0; block * block], vec![0.0; block]);
        for p in 0..fixed.len() / block {
            let entries = &blocks[p * block * block..(p + 1) * block * block];
            let fixed = &fixed[p * block..(p + 1) * block];
            let inverse = &mut inverses[p * block * block..(p + 1) * block * block];
            let entry = |i: usize, j: usize| match fixed[i] || fixed[j] {
                true => f64::from(u8::from(i == j)) * mean,
                false => entries[i * block + j],
            };
            if cholesky(block, &mut lower, entry) {
                for j in 0..block {
                    unit.fill(0.0);
                    unit[j] = 1.0;
                    substitute(block, &lower, &mut unit);
                    (0..block).for_each(|i| inverse[i * block + j] = unit[i]);
                }
            } else {
                for i in 0..block {
                    let value = diagonal(p * block + i);
                    let usable = value.is_finite() && value > f64::EPSILON * mean;
                    inverse[i * block + i] = 1.0 / if usable { value } else { mean };
                }
            }
        }
        Self { block, inverses }
    }
}

/// Dense Cholesky of a small matrix; `false` where not positive definite to working precision.
fn cholesky(n: usize, lower: &mut [f64], entry: impl Fn(usize, usize) -> f64) -> bool {
    for i in 0..n {
        for j in 0..=i {
            let mut sum = entry(i, j);
            for k in 0..j {
                sum -= lower[i * n + k] * lower[j * n + k];
            }
            if i == j {
                if !(sum > 1e-12 * entry(i, i).abs() && sum.is_finite()) {
                    return false;
                }
                lower[i * n + i] = sum.sqrt();
            } else {
                lower[i * n + j] = sum / lower[j * n + j];
            }
        }
    }
    true
}

fn substitute(n: usize, lower: &[f64], x: &mut [f64]) {
    for i in 0..n {
        for k in 0..i {
            x[i] -= lower[i * n + k] * x[k];
        }
        x[i] /= lower[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            x[i] -= lower[k * n + i] * x[k];
        }
        x[i] /= lower[i * n + i];
    }
}

impl Preconditioner for BlockJacobi {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let d = self.block;
        let blocks = self.inverses.chunks_exact(d * d);
        for ((z, r), inverse) in z.chunks_exact_mut(d).zip(r.chunks_exact(d)).zip(blocks) {
            for i in 0..d {
                let mut sum = 0.0;
                for j in 0..d {
                    sum += inverse[i * d + j] * r[j];
                }
                z[i] = sum;
            }
        }
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KrylovOptions {
    /// Residual wanted, relative to the right-hand side.
    pub tolerance: f64,
    /// Most iterations (products).
    pub max_iterations: usize,
}

/// How an iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KrylovEnd {
    /// The tolerance was met.
    Converged,
    /// Conjugate gradients met a direction `p` with `pᵀ A p ≤ 0`: the matrix is not positive definite.
    NegativeCurvature,
    /// The iterations were used up.
    Exhausted,
    /// A number that is not finite appeared, or no progress was possible.
    BrokenDown,
}

/// What an iteration reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KrylovReport {
    /// Products used.
    pub iterations: usize,
    /// `‖b − A x‖ / ‖b‖` by the recurrence.
    pub residual: f64,
    /// How it ended.
    pub end: KrylovEnd,
}

/// Preconditioned conjugate gradients (Hestenes and Stiefel 1952) with its work vectors.
#[derive(Clone, Debug, Default)]
pub struct ConjugateGradients {
    r: Vec<f64>,
    z: Vec<f64>,
    p: Vec<f64>,
    q: Vec<f64>,
}

impl ConjugateGradients {
    /// Solves `A x = b` from `x = 0`.
    ///
    /// On [`KrylovEnd::NegativeCurvature`] `x` holds the iterate before it, or, where that is still zero, the preconditioned
    /// right-hand side: in both cases a direction of descent for the quadratic `½ xᵀAx − bᵀx` (Steihaug 1983).
    ///
    /// # Errors
    /// [`Stop`] from the product.
    pub fn solve(
        &mut self,
        mut product: impl FnMut(&[f64], &mut [f64]) -> Result<(), Stop>,
        preconditioner: &mut dyn Preconditioner,
        fixed: &[bool],
        b: &[f64],
        x: &mut [f64],
        options: KrylovOptions,
    ) -> Result<KrylovReport, Stop> {
        let n = b.len();
        for work in [&mut self.r, &mut self.z, &mut self.p, &mut self.q] {
            work.resize(n, 0.0);
        }
        let (r, z, p, q) = (&mut self.r, &mut self.z, &mut self.p, &mut self.q);
        x.fill(0.0);
        r.copy_from_slice(b);
        vector::clear_fixed(r, fixed);
        let scale = vector::norm(r);
        let report = |iterations, residual: f64, end| Ok(KrylovReport { iterations, residual, end });
        if scale == 0.0 {
            return report(0, 0.0, KrylovEnd::Converged);
        }
        let mut residual = 1.0;
        let mut rho = 0.0;
        for iteration in 0..options.max_iterations {
            preconditioner.apply(r, z);
            vector::clear_fixed(z, fixed);
            let rho_before = std::mem::replace(&mut rho, vector::dot(r, z));
            if !(rho > 0.0 && rho.is_finite()) {
                return report(iteration, residual, KrylovEnd::BrokenDown);
            }
            if iteration == 0 {
                p.copy_from_slice(z);
            } else {
                vector::scale_and_add(p, rho / rho_before, z);
            }
            product(p, q)?;
            vector::clear_fixed(q, fixed);
            let curvature = vector::dot(p, q);
            if !curvature.is_finite() {
                return report(iteration + 1, residual, KrylovEnd::BrokenDown);
            }
            if curvature <= 0.0 {
                if iteration == 0 {
                    x.copy_from_slice(p);
                }
                return report(iteration + 1, residual, KrylovEnd::NegativeCurvature);
            }
            let alpha = rho / curvature;
            vector::add_scaled(x, alpha, p);
            vector::add_scaled(r, -alpha, q);
            residual = vector::norm(r) / scale;
            if residual <= options.tolerance {
                return report(iteration + 1, residual, KrylovEnd::Converged);
            }
        }
        report(options.max_iterations, residual, KrylovEnd::Exhausted)
    }
}

/// Flexible restarted GMRES (Saad 1993, SIAM J. Sci. Comput. 14) with its work vectors: for matrices that are not symmetric or not
/// definite. The preconditioner may change from product to product.
#[derive(Clone, Debug)]
pub struct Gmres {
    /// Products between restarts; memory is twice as many vectors.
    pub restart: usize,
    basis: Vec<f64>,
    images: Vec<f64>,
    work: Vec<f64>,
}

impl Gmres {
    /// With so many products between restarts (at least 1).
    pub fn new(restart: usize) -> Self {
        Self { restart: restart.max(1), basis: Vec::new(), images: Vec::new(), work: Vec::new() }
    }

    /// Solves `A x = b` from `x = 0`.
    ///
    /// # Errors
    /// [`Stop`] from the product.
    pub fn solve(
        &mut self,
        mut product: impl FnMut(&[f64], &mut [f64]) -> Result<(), Stop>,
        preconditioner: &mut dyn Preconditioner,
        fixed: &[bool],
        b: &[f64],
        x: &mut [f64],
        options: KrylovOptions,
    ) -> Result<KrylovReport, Stop> {
        let (n, m) = (b.len(), self.restart);
        self.basis.resize((m + 1) * n, 0.0);
        self.images.resize(m * n, 0.0);
        self.work.resize(n, 0.0);
        x.fill(0.0);
        self.work.copy_from_slice(b);
        vector::clear_fixed(&mut self.work, fixed);
        let scale = vector::norm(&self.work);
        let report = |iterations, residual: f64, end| Ok(KrylovReport { iterations, residual, end });
        if scale == 0.0 {
            return report(0, 0.0, KrylovEnd::Converged);
        }
        // Upper triangle of the rotated Hessenberg matrix by columns, rotations, right-hand side.
        let mut h = vec![0.0; (m + 1) * m];
        let (mut cosines, mut sines, mut g) = (vec![0.0; m], vec![0.0; m], vec![0.0; m + 1]);
        let (mut iterations, mut before) = (0, f64::INFINITY);
        loop {
            let beta = vector::norm(&self.work);
            let residual = beta / scale;
            if residual <= options.tolerance {
                return report(iterations, residual, KrylovEnd::Converged);
            }
            if !beta.is_finite() || residual >= before {
                return report(iterations, residual, KrylovEnd::BrokenDown);
            }
            if iterations >= options.max_iterations {
                return report(iterations, residual, KrylovEnd::Exhausted);
            }
            before = residual;
            for (v, r) in self.basis[..n].iter_mut().zip(&self.work) {
                *v = r / beta;
            }
            g.fill(0.0);
            g[0] = beta;
            let mut used = 0;
            while used < m && iterations < options.max_iterations {
                let k = used;
                let (head, tail) = self.basis.split_at_mut((k + 1) * n);
                let (z, w) = (&mut self.images[k * n..(k + 1) * n], &mut tail[..n]);
                preconditioner.apply(&head[k * n..], z);
                vector::clear_fixed(z, fixed);
                product(z, w)?;
                vector::clear_fixed(w, fixed);
                let column = &mut h[k * (m + 1)..(k + 1) * (m + 1)];
                column.fill(0.0);
                // Twice is enough (Parlett 1980).
                for _ in 0..2 {
                    for (i, v) in head.chunks(n).enumerate() {
                        let share = vector::dot(v, w);
                        column[i] += share;
                        vector::add_scaled(w, -share, v);
                    }
                }
                let length = vector::norm(w);
                if !length.is_finite() {
                    return report(iterations + 1, residual, KrylovEnd::BrokenDown);
                }
                column[k + 1] = length;
                if length > 0.0 {
                    w.iter_mut().for_each(|x| *x /= length);
                }
                for i in 0..k {
                    let (a, b) = (column[i], column[i + 1]);
                    column[i] = cosines[i] * a + sines[i] * b;
                    column[i + 1] = cosines[i] * b - sines[i] * a;
                }
                let radius = column[k].hypot(column[k + 1]);
                if radius == 0.0 {
                    break;
                }
                (cosines[k], sines[k]) = (column[k] / radius, column[k + 1] / radius);
                column[k] = radius;
                column[k + 1] = 0.0;
                g[k + 1] = -sines[k] * g[k];
                g[k] *= cosines[k];
                iterations += 1;
                used += 1;
                if g[used].abs() <= options.tolerance * scale || length == 0.0 {
                    break;
                }
            }
            for i in (0..used).rev() {
                for k in i + 1..used {
                    g[i] -= h[k * (m + 1) + i] * g[k];
                }
                g[i] /= h[i * (m + 1) + i];
                vector::add_scaled(x, g[i], &self.images[i * n..(i + 1) * n]);
            }
            // The true residual, so that restarts do not build on round-off.
            product(x, &mut self.work)?;
            for k in 0..n {
                self.work[k] = if fixed[k] { 0.0 } else { b[k] - self.work[k] };
            }
        }
    }
}
