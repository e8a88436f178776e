//! Newton's method for statics, with a line search, on the exact tangent.
//!
//! **Increment of fixed dofs.** Moving the supports alone would stretch the bonds next to them by the whole increment. So the first
//! state is that of the tangent at the old equilibrium: `K_ff Δu_f = f_f − K_fp Δu_p`. If the body is worse off there (by energy, or by
//! residual) than with the supports moved alone, or cannot be evaluated, the latter is the start.
//!
//! **Tangents that are not positive definite** (softening, buckling, snap-through). The direct solver factors `K + λ diag(d)`,
//! `d` the absolute values of the diagonal (not less than a thousandth of their mean), with the smallest `λ` of 10⁻⁹, 10⁻⁶, 10⁻³, 10⁻², … that makes
//! it positive definite (Levenberg and Marquardt), starting from a tenth of the last `λ` that was needed. Conjugate gradients stop
//! at negative curvature and use the direction reached (Steihaug 1983, Dembo and Steihaug 1983). A direction of GMRES that leads
//! uphill is turned around. All give directions of descent; near a stable equilibrium none of this acts, and convergence is quadratic.
//!
//! **Line search** along `p`, with `s(a) = f(u + a p)·p = −dΠ/da`: the full step is taken where it meets the tolerance, or
//! `|s(1)| ≤ 0.8 s(0)` and the residual falls. Otherwise a step is taken where the energy falls enough (Armijo, 10⁻⁴) as far as
//! there is one and its change is above round-off, and either the minimum has not been passed (`s ≥ 0`) or `|s| ≤ 0.8 s(0)`; until then the step is
//! shortened by the secant of `s`, kept within 0.1 and 0.7 of the last. A state in which the body stops counts as too long a step.

use std::sync::Arc;

use crate::direct::{DirectError, DirectReport, SparseCholesky};
use crate::krylov::{BlockJacobi, ConjugateGradients, Gmres, KrylovEnd, KrylovOptions, KrylovReport};
use crate::load_steps::{Equilibrated, Equilibrium, EquilibriumError, ROUND_OFF_RESIDUAL, Scale, residual, worst_dof};
use crate::observe::{Cancel, cancelled};
use crate::problem::{Statics, Stop};
use crate::sparse::{BlockMatrix, BlockPattern};
use crate::two_level::{Coarse, TwoLevel};
use crate::vector;

/// Which linear solver Newton's method uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSolver {
    /// Direct where the body assembles and the factor fits in [`NewtonOptions::direct_bytes`]; else conjugate gradients.
    Automatic,
    /// Sparse Cholesky of the assembled tangent. An error where the body does not assemble.
    Direct,
    /// Conjugate gradients with block Jacobi and a coarse correction ([`crate::two_level`]); matrix-free in space. For symmetric tangents.
    ConjugateGradients,
    /// Flexible GMRES with the same preconditioner, matrix-free, restarted after so many products. For tangents that are not symmetric.
    Gmres {
        /// Products between restarts.
        restart: usize,
    },
}

/// Options of [`Newton`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonOptions {
    /// Residual wanted, relative to [`Statics::force_scale`]. 1e-8.
    pub tolerance: f64,
    /// Most iterations for one equilibrium. 40.
    pub max_iterations: usize,
    /// Linear solver.
    pub solver: LinearSolver,
    /// Most iterations of an iterative linear solver. 20,000.
    pub max_linear_iterations: usize,
    /// Threads of the direct solver. All cores.
    pub threads: usize,
    /// Largest factor, in bytes, for which [`LinearSolver::Automatic`] is direct. 4 GiB.
    pub direct_bytes: usize,
    /// One linear solution from the reference configuration for each load: `u = u_p − K(0)⁻¹ …`, no iteration, superposition holds.
    pub linear: bool,
}

impl Default for NewtonOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-8,
            max_iterations: 40,
            solver: LinearSolver::Automatic,
            max_linear_iterations: 20_000,
            threads: std::thread::available_parallelism().map_or(1, |n| n.get()),
            direct_bytes: 4 << 30,
            linear: false,
        }
    }
}

/// Newton's method. Keeps factors and work vectors from one equilibrium to the next.
pub struct Newton {
    options: NewtonOptions,
    linear: Linear,
    f: Vec<f64>,
    trial_f: Vec<f64>,
    trial: Vec<f64>,
    direction: Vec<f64>,
    right: Vec<f64>,
    moved: Vec<f64>,
}

/// The linear solvers and what they remember.
struct Linear {
    options: NewtonOptions,
    cholesky: Option<SparseCholesky>,
    matrix: Option<BlockMatrix>,
    /// Pattern whose factor was found too large.
    refused: Option<Arc<BlockPattern>>,
    /// The factor in hand is that of the reference configuration (linear mode).
    reference_factor: bool,
    /// So is the matrix that was assembled for products.
    reference_matrix: bool,
    shift: f64,
    conjugate_gradients: ConjugateGradients,
    gmres: Gmres,
    /// For the fixed dofs of the last iterative solution.
    coarse: Option<Coarse>,
    blocks: Vec<f64>,
    diagonal: Vec<f64>,
    iterations: usize,
    modified: usize,
    name: &'static str,
    /// Largest estimate of the error of a direct solution so far.
    error: f64,
}

/// Levenberg–Marquardt shifts, relative to the diagonal. The first two are for tangents that are singular, not indefinite (a piece that
/// has broken off), where they do not slow convergence.
const SHIFTS: [f64; 10] = [1e-9, 1e-6, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4];

impl Newton {
    /// A method with these options.
    pub fn new(options: NewtonOptions) -> Self {
        let linear = Linear {
            options,
            cholesky: None,
            matrix: None,
            refused: None,
            reference_factor: false,
            reference_matrix: false,
            shift: 0.0,
            conjugate_gradients: ConjugateGradients::default(),
            gmres: Gmres::new(match options.solver {
                LinearSolver::Gmres { restart } => restart,
                _ => 1,
            }),
            coarse: None,
            blocks: Vec::new(),
            diagonal: Vec::new(),
            iterations: 0,
            modified: 0,
            name: "",
            error: 0.0,
        };
        let empty = Vec::new;
        Self { options, linear, f: empty(), trial_f: empty(), trial: empty(), direction: empty(), right: empty(), moved: empty() }
    }

    /// Dofs of the coarse problem of an iterative solution, and the products with the stiffness that it took to make.
    pub fn coarse(&self) -> Option<(usize, usize)> {
        self.linear.coarse.as_ref().map(Coarse::size)
    }

    /// The direct solver in use, if any: for reports on fill and ordering.
    pub fn cholesky(&self) -> Option<&SparseCholesky> {
        self.linear.cholesky.as_ref()
    }

    /// Largest estimate so far of the relative error of a direct linear solution (see [`crate::direct::DirectReport::error`]): where it is not
    /// small, the stiffness is so ill-conditioned that digits are lost.
    pub fn linear_error(&self) -> f64 {
        self.linear.error
    }

    fn resize(&mut self, n: usize) {
        for work in [&mut self.f, &mut self.trial_f, &mut self.trial, &mut self.direction, &mut self.right, &mut self.moved] {
            work.clear();
            work.resize(n, 0.0);
        }
    }

    /// One solution with the stiffness of the reference configuration.
    fn linear_solution(&mut self, problem: &mut dyn Statics, t: f64, u: &mut [f64]) -> Result<Equilibrated, EquilibriumError> {
        self.trial.fill(0.0);
        u.fill(0.0);
        problem.prescribe(t, u);
        for (u, fixed) in u.iter_mut().zip(problem.fixed()) {
            *u = if *fixed { *u } else { 0.0 };
        }
        residual(problem, t, &self.trial, &mut self.right)?;
        problem.tangent_product(t, &self.trial, u, &mut self.trial_f)?;
        vector::clear_fixed(&mut self.trial_f, problem.fixed());
        vector::add_scaled(&mut self.right, -1.0, &self.trial_f);
        let options = KrylovOptions { tolerance: self.options.tolerance, max_iterations: self.options.max_linear_iterations };
        let reached = self.linear.solve(problem, t, &self.trial, &self.right, &mut self.direction, options, true)?;
        vector::add_scaled(u, 1.0, &self.direction);
        Ok(Equilibrated {
            iterations: 1,
            linear_iterations: self.linear.iterations,
            residual: reached,
            history: vec![reached],
            solver: self.linear.name,
            ..Default::default()
        })
    }

    /// Moves the fixed dofs to `t` and the free ones with them, as the tangent says.
    fn predict(&mut self, problem: &mut dyn Statics, t: f64, u: &mut [f64]) -> Result<(), EquilibriumError> {
        self.trial.copy_from_slice(u);
        problem.prescribe(t, &mut self.trial);
        let fixed = problem.fixed();
        let mut any = false;
        for k in 0..u.len() {
            self.moved[k] = if fixed[k] { self.trial[k] - u[k] } else { 0.0 };
            any |= self.moved[k] != 0.0;
        }
        if !any {
            return Ok(());
        }
        residual(problem, t, u, &mut self.right)?;
        problem.tangent_product(t, u, &self.moved, &mut self.trial_f)?;
        vector::clear_fixed(&mut self.trial_f, problem.fixed());
        vector::add_scaled(&mut self.right, -1.0, &self.trial_f);
        let options = KrylovOptions { tolerance: 1e-4, max_iterations: self.options.max_linear_iterations };
        let solved = self.linear.solve(problem, t, u, &self.right, &mut self.direction, options, false);
        vector::add_scaled(u, 1.0, &self.moved);
        match solved {
            Ok(_) => {}
            // The supports moved alone are still a start.
            Err(EquilibriumError::Krylov { .. }) => return Ok(()),
            Err(other) => return Err(other),
        }
        vector::combine(&mut self.trial, u, 1.0, &self.direction);
        let Ok(predicted) = residual(problem, t, &self.trial, &mut self.trial_f) else {
            return Ok(());
        };
        let better = match residual(problem, t, u, &mut self.f) {
            Err(_) => true,
            Ok(alone) if !alone.is_finite() || predicted <= alone => predicted.is_finite(),
            Ok(_) => match (problem.energy(t, u), problem.energy(t, &self.trial)) {
                (Some(alone), Some(predicted)) => predicted < alone,
                _ => false,
            },
        };
        if better {
            u.copy_from_slice(&self.trial);
        }
        Ok(())
    }

    /// A step along `direction` from `u`; on success `u` and `f` are those of the new state. `None` where no step helps; the last
    /// reason of the body to stop, where it did.
    fn search(
        &mut self,
        problem: &mut dyn Statics,
        t: f64,
        u: &mut [f64],
        slope: f64,
        norm: f64,
        scale: &mut Scale,
    ) -> Result<f64, Option<Stop>> {
        const MOST_TRIALS: usize = 40;
        const ENOUGH: f64 = 0.8;
        let mut a = 1.0;
        let mut stop = None;
        let mut start_energy: Option<Option<f64>> = None;
        for _ in 0..MOST_TRIALS {
            vector::combine(&mut self.trial, u, a, &self.direction);
            let evaluated = residual(problem, t, &self.trial, &mut self.trial_f);
            let reached = match evaluated {
                Ok(reached) if reached.is_finite() => reached,
                Ok(_) => {
                    a *= 0.5;
                    continue;
                }
                Err(reason) => {
                    stop = Some(reason);
                    a *= 0.5;
                    continue;
                }
            };
            let s = vector::dot(&self.trial_f, &self.direction);
            let mut take = scale.relative(problem, reached) <= self.options.tolerance || (s.abs() <= ENOUGH * slope && reached < norm);
            if !take && (s >= 0.0 || s.abs() <= ENOUGH * slope) {
                let start = *start_energy.get_or_insert_with(|| problem.energy(t, u));
                let falls = match (start, problem.energy(t, &self.trial)) {
                    (Some(start), Some(end)) => {
                        let wanted = 1e-4 * a * slope;
                        // Below this the difference of the two energies is noise.
                        wanted <= 64.0 * f64::EPSILON * start.abs().max(end.abs()) || end <= start - wanted
                    }
                    (Some(_), None) => false,
                    (None, _) => true,
                };
                take = falls;
            }
            if take {
                u.copy_from_slice(&self.trial);
                std::mem::swap(&mut self.f, &mut self.trial_f);
                return Ok(reached);
            }
            a *= if s < 0.0 { (slope / (slope - s)).clamp(0.1, 0.7) } else { 0.5 };
        }
        Err(stop)
    }
}

impl Equilibrium for Newton {
    fn equilibrate(
        &mut self,
        problem: &mut dyn Statics,
        t: f64,
        u: &mut [f64],
        cancel: Cancel<'_>,
    ) -> Result<Equilibrated, EquilibriumError> {
        self.resize(u.len());
        (self.linear.iterations, self.linear.modified) = (0, 0);
        if self.options.linear {
            return self.linear_solution(problem, t, u);
        }
        self.predict(problem, t, u)?;
        let mut scale = Scale::default();
        let mut norm = residual(problem, t, u, &mut self.f)?;
        let mut history = Vec::with_capacity(16);
        let mut forcing = 0.1;
        loop {
            let relative = scale.relative(problem, norm);
            history.push(relative);
            let iterations = history.len() - 1;
            let done = |at_round_off: bool, history: Vec<f64>, linear: &Linear| {
                Ok(Equilibrated {
                    iterations,
                    linear_iterations: linear.iterations,
                    residual: relative,
                    history,
                    at_round_off,
                    modified_tangents: linear.modified,
                    solver: linear.name,
                })
            };
            if relative <= self.options.tolerance {
                return done(false, history, &self.linear);
            }
            let failed = |reason: &str, history: Vec<f64>, f: &[f64], fixed: &[bool]| EquilibriumError::NotConverged {
                method: "Newton's method",
                reason: reason.into(),
                iterations,
                residual: relative,
                worst_dof: worst_dof(f, fixed),
                history,
            };
            if !relative.is_finite() {
                return Err(failed("the residual is not a number", history, &self.f, problem.fixed()));
            }
            // Two steps without a real gain near the limit of the arithmetic: this is it.
            if relative <= ROUND_OFF_RESIDUAL
                && let [.., a, b, c] = history[..]
                && c > 0.5 * b
                && b > 0.5 * a
            {
                return done(true, history, &self.linear);
            }
            if iterations >= self.options.max_iterations {
                return Err(failed("too many iterations", history, &self.f, problem.fixed()));
            }
            if cancelled(cancel) {
                return Err(EquilibriumError::Cancelled);
            }
            // Inexact Newton: Eisenstat and Walker 1996 (SIAM J. Sci. Comput. 17), choice 2, not beyond what is needed.
            if let [.., a, b] = history[..] {
                forcing = (0.9 * (b / a) * (b / a)).clamp(1e-6, 0.1);
            }
            let options = KrylovOptions {
                tolerance: forcing.max(0.3 * self.options.tolerance / relative).min(0.1),
                max_iterations: self.options.max_linear_iterations,
            };
            self.linear.solve(problem, t, u, &self.f, &mut self.direction, options, false)?;
            let mut slope = vector::dot(&self.f, &self.direction);
            if slope < 0.0 {
                // GMRES solves an indefinite system as it is; turned around, its direction leads downhill.
                self.direction.iter_mut().for_each(|x| *x = -*x);
                self.linear.modified += 1;
                slope = -slope;
            }
            if slope <= 0.0 || slope.is_nan() {
                if relative <= ROUND_OFF_RESIDUAL {
                    return done(true, history, &self.linear);
                }
                return Err(failed("the Newton direction is not one of descent", history, &self.f, problem.fixed()));
            }
            norm = match self.search(problem, t, u, slope, norm, &mut scale) {
                Ok(norm) => norm,
                Err(_) if relative <= ROUND_OFF_RESIDUAL => {
                    return done(true, history, &self.linear);
                }
                Err(None) => {
                    return Err(failed("no step along the Newton direction lowers the energy", history, &self.f, problem.fixed()));
                }
                Err(Some(stop)) => return Err(stop.into()),
            };
        }
    }

    fn force_law_changed(&mut self) {
        (self.linear.reference_factor, self.linear.reference_matrix) = (false, false);
    }
}

/// The residual of a direct solution; its error is remembered.
fn solved(report: DirectReport, error: &mut f64) -> f64 {
    *error = error.max(report.error);
    report.residual
}

impl Linear {
    /// Solves `K(u) x = b`, possibly with a modified `K`; returns the relative residual. `reference`: `u` is the reference
    /// configuration and its factor may be kept.
    fn solve(
        &mut self,
        problem: &mut dyn Statics,
        t: f64,
        u: &[f64],
        b: &[f64],
        x: &mut [f64],
        options: KrylovOptions,
        reference: bool,
    ) -> Result<f64, EquilibriumError> {
        match self.options.solver {
            LinearSolver::Automatic | LinearSolver::Direct => match self.prepare_direct(problem)? {
                true => self.solve_direct(problem, t, u, b, x, reference),
                false => self.solve_iteratively(problem, t, u, b, x, options, reference),
            },
            _ => self.solve_iteratively(problem, t, u, b, x, options, reference),
        }
    }

    /// Makes the symbolic factor and the matrix ready; `false` where the direct solver is not to be used.
    fn prepare_direct(&mut self, problem: &mut dyn Statics) -> Result<bool, EquilibriumError> {
        let automatic = self.options.solver == LinearSolver::Automatic;
        let Some(pattern) = problem.pattern() else {
            return match automatic {
                true => Ok(false),
                false => Err(Stop::new("this body does not assemble its stiffness: use conjugate gradients").into()),
            };
        };
        if automatic && self.refused.as_ref().is_some_and(|refused| Arc::ptr_eq(refused, &pattern)) {
            return Ok(false);
        }
        if self.cholesky.as_ref().is_some_and(|c| c.serves(&pattern, problem.fixed())) {
            return Ok(true);
        }
        (self.cholesky, self.reference_factor) = (None, false);
        match SparseCholesky::analyze(pattern.clone(), problem.positions(), problem.fixed(), self.options.threads) {
            Ok(cholesky) if !automatic || cholesky.bytes() <= self.options.direct_bytes => self.cholesky = Some(cholesky),
            Ok(_) | Err(DirectError::OutOfMemory { .. }) if automatic => {
                self.refused = Some(pattern);
                return Ok(false);
            }
            Ok(_) => unreachable!("a direct solver that was asked for is taken"),
            Err(other) => return Err(other.into()),
        }
        if self.matrix.as_ref().is_none_or(|m| !Arc::ptr_eq(m.pattern(), &pattern)) {
            self.matrix = Some(BlockMatrix::new(pattern));
        }
        Ok(true)
    }

    fn solve_direct(
        &mut self,
        problem: &mut dyn Statics,
        t: f64,
        u: &[f64],
        b: &[f64],
        x: &mut [f64],
        reference: bool,
    ) -> Result<f64, EquilibriumError> {
        self.name = if reference { "linear, Cholesky" } else { "Newton, Cholesky" };
        let (Some(cholesky), Some(matrix)) = (self.cholesky.as_mut(), self.matrix.as_mut()) else {
            unreachable!("`prepare_direct` made both");
        };
        if reference && self.reference_factor {
            return Ok(solved(cholesky.solve(b, x)?, &mut self.error));
        }
        (self.reference_factor, self.reference_matrix) = (false, false);
        matrix.clear();
        problem.tangent(t, u, matrix)?;
        self.diagonal.resize(u.len(), 0.0);
        matrix.diagonal(&mut self.diagonal);
        self.diagonal.iter_mut().for_each(|d| *d = d.abs());
        vector::clear_fixed(&mut self.diagonal, problem.fixed());
        let mean = self.diagonal.iter().sum::<f64>() / cholesky.free_dofs().max(1) as f64;
        // Points that all bonds have left, and no load acts on, stay where they are: any stiffness does.
        let mut isolated = false;
        for (k, fixed) in problem.fixed().iter().enumerate() {
            if !fixed && b[k] == 0.0 && self.diagonal[k] <= f64::EPSILON * mean {
                matrix.add_diagonal_entry(k, mean);
                isolated = true;
            }
        }
        match cholesky.factor(matrix, None) {
            Ok(()) => {
                self.shift = 0.0;
                // With another load the isolated points might not be at rest.
                self.reference_factor = reference && !isolated;
                return Ok(solved(cholesky.solve(b, x)?, &mut self.error));
            }
            Err(DirectError::NotPositiveDefinite { .. }) if !reference => {}
            Err(other) => return Err(other.into()),
        }
        self.modified += 1;
        let first = SHIFTS.iter().position(|s| *s >= 0.1 * self.shift).unwrap_or(0);
        let mut applied = 1.0;
        for &shift in &SHIFTS[first..] {
            // What was added for the last shift is scaled up to this one.
            let factor = shift / applied;
            for (d, fixed) in self.diagonal.iter_mut().zip(problem.fixed()) {
                let least = applied * 1e-3 * mean;
                *d = if *fixed { 0.0 } else { factor * d.max(least) };
            }
            applied = shift;
            match cholesky.factor(matrix, Some(&self.diagonal)) {
                Ok(()) => {
                    self.shift = shift;
                    return Ok(solved(cholesky.solve(b, x)?, &mut self.error));
                }
                Err(DirectError::NotPositiveDefinite { .. }) if shift < SHIFTS[SHIFTS.len() - 1] => {}
                Err(other) => return Err(other.into()),
            }
        }
        unreachable!("the last shift returns")
    }

    /// Assembles the stiffness for an iterative solution, where it is small: in the plane and on a line. `false` elsewhere.
    fn assemble_for_products(&mut self, problem: &mut dyn Statics, t: f64, u: &[f64], reference: bool) -> Result<bool, EquilibriumError> {
        /// Largest matrix, in bytes.
        const LARGEST: usize = 1 << 30;
        let d = problem.dofs_per_point();
        // GMRES is for stiffnesses that are not symmetric, which the matrix would lose
        if d > 2 || matches!(self.options.solver, LinearSolver::Gmres { .. }) {
            return Ok(false);
        }
        let Some(pattern) = problem.pattern().filter(|p| p.blocks() * d * d * 8 <= LARGEST) else {
            return Ok(false);
        };
        if self.matrix.as_ref().is_none_or(|m| !Arc::ptr_eq(m.pattern(), &pattern)) {
            self.matrix = Some(BlockMatrix::new(pattern));
            self.reference_matrix = false;
        }
        if !(reference && self.reference_matrix) {
            self.reference_matrix = false;
            let matrix = self.matrix.as_mut().expect("made above");
            matrix.clear();
            problem.tangent(t, u, matrix)?;
            self.reference_matrix = reference;
        }
        Ok(true)
    }

    fn solve_iteratively(
        &mut self,
        problem: &mut dyn Statics,
        t: f64,
        u: &[f64],
        b: &[f64],
        x: &mut [f64],
        options: KrylovOptions,
        reference: bool,
    ) -> Result<f64, EquilibriumError> {
        let d = problem.dofs_per_point();
        let fixed = problem.fixed().to_vec();
        self.blocks.resize(u.len() * d, 0.0);
        let assembled = self.assemble_for_products(problem, t, u, reference)?;
        match &self.matrix {
            Some(matrix) if assembled => matrix.diagonal_blocks(&mut self.blocks),
            _ => problem.block_diagonal(t, u, &mut self.blocks)?,
        }
        let smoother = BlockJacobi::new(d, &self.blocks, &fixed);
        let matrix = self.matrix.as_ref().filter(|_| assembled);
        if !self.coarse.as_ref().is_some_and(|c| c.serves(&fixed)) {
            self.coarse = None;
            if let Some(reach) = problem.reach().filter(|_| problem.positions().len() == u.len() && d <= 3) {
                let positions = problem.positions().to_vec();
                // of the reference configuration: it is stable, and products are fastest there
                let start = vec![0.0; u.len()];
                let product = |x: &[f64], y: &mut [f64]| match matrix {
                    Some(matrix) => {
                        matrix.product(x, y);
                        Ok(())
                    }
                    None => problem.tangent_product(t, &start, x, y),
                };
                self.coarse = Coarse::new(product, &positions, &fixed, d, reach, self.options.threads)?;
            }
        }
        let mut preconditioner = TwoLevel { smoother, coarse: self.coarse.as_mut() };
        let product = |x: &[f64], y: &mut [f64]| match matrix {
            Some(matrix) => {
                matrix.product(x, y);
                Ok(())
            }
            None => problem.tangent_product(t, u, x, y),
        };
        let report: KrylovReport = if let LinearSolver::Gmres { .. } = self.options.solver {
            self.name = "Newton, GMRES";
            self.gmres.solve(product, &mut preconditioner, &fixed, b, x, options)?
        } else {
            self.name = "Newton, conjugate gradients";
            self.conjugate_gradients.solve(product, &mut preconditioner, &fixed, b, x, options)?
        };
        self.iterations += report.iterations;
        match report.end {
            KrylovEnd::Converged => {}
            KrylovEnd::NegativeCurvature if !self.options.linear => self.modified += 1,
            // A half-solved system is still a direction; round-off may keep the last digits out of reach.
            _ if report.residual <= 0.1 && !self.options.linear => {}
            _ => {
                return Err(EquilibriumError::Krylov { iterations: report.iterations, residual: report.residual });
            }
        }
        Ok(report.residual)
    }
}
