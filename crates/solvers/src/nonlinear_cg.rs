//! Nonlinear conjugate gradients for statics: no assembled matrix, no linear solver, a handful of vectors.
//!
//! Polak–Ribière⁺ with automatic restart (Gilbert and Nocedal 1992, SIAM J. Optim. 2), preconditioned by the block diagonal, which is
//! renewed at restarts. The line search finds the zero of the slope `s(a) = f(u + a d)·d`: first by one Newton step with the exact tangent
//! product, then by secants. Fixed dofs are moved together with the free ones as in [`crate::newton`], by a rough linear solution.

use crate::krylov::{BlockJacobi, ConjugateGradients, KrylovOptions, Preconditioner};
use crate::load_steps::{Equilibrated, Equilibrium, EquilibriumError, ROUND_OFF_RESIDUAL, Scale, residual, worst_dof};
use crate::observe::{Cancel, cancelled};
use crate::problem::Statics;
use crate::vector;

/// Options of [`NonlinearCg`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NonlinearCgOptions {
    /// Residual wanted, relative to [`Statics::force_scale`]. 1e-6.
    pub tolerance: f64,
    /// Most iterations for one equilibrium. 20,000.
    pub max_iterations: usize,
    /// The line search ends where the slope has fallen to this part. 0.1.
    pub slope_ratio: f64,
    /// Iterations after which the direction starts afresh, with a new preconditioner. 200.
    pub restart: usize,
}

impl Default for NonlinearCgOptions {
    fn default() -> Self {
        Self { tolerance: 1e-6, max_iterations: 20_000, slope_ratio: 0.1, restart: 200 }
    }
}

/// Nonlinear conjugate gradients with their work vectors.
#[derive(Clone, Debug, Default)]
pub struct NonlinearCg {
    options: NonlinearCgOptions,
    f: Vec<f64>,
    trial_f: Vec<f64>,
    trial: Vec<f64>,
    z: Vec<f64>,
    d: Vec<f64>,
    blocks: Vec<f64>,
    linear: ConjugateGradients,
}

/// Evaluations of one line search.
const MOST_TRIALS: usize = 30;
/// Iterations whose residuals are compared to notice stagnation.
const STAGNATION: usize = 400;

impl NonlinearCg {
    /// A method with these options.
    pub fn new(options: NonlinearCgOptions) -> Self {
        Self { options, ..Self::default() }
    }

    fn preconditioner(&mut self, problem: &mut dyn Statics, t: f64, u: &[f64]) -> Result<BlockJacobi, EquilibriumError> {
        let d = problem.dofs_per_point();
        self.blocks.resize(u.len() * d, 0.0);
        problem.block_diagonal(t, u, &mut self.blocks)?;
        Ok(BlockJacobi::new(d, &self.blocks, problem.fixed()))
    }

    /// Moves the fixed dofs to `t`, the free ones as the tangent says, to one per cent.
    fn predict(&mut self, problem: &mut dyn Statics, t: f64, u: &mut [f64]) -> Result<(), EquilibriumError> {
        self.trial.copy_from_slice(u);
        problem.prescribe(t, &mut self.trial);
        let fixed = problem.fixed().to_vec();
        let moved: Vec<f64> = (0..u.len()).map(|k| if fixed[k] { self.trial[k] - u[k] } else { 0.0 }).collect();
        if moved.iter().all(|x| *x == 0.0) {
            return Ok(());
        }
        residual(problem, t, u, &mut self.f)?;
        problem.tangent_product(t, u, &moved, &mut self.trial_f)?;
        vector::clear_fixed(&mut self.trial_f, &fixed);
        vector::add_scaled(&mut self.f, -1.0, &self.trial_f);
        let mut preconditioner = self.preconditioner(problem, t, u)?;
        let options = KrylovOptions { tolerance: 1e-2, max_iterations: 2000 };
        let product = |x: &[f64], y: &mut [f64]| problem.tangent_product(t, u, x, y);
        self.linear.solve(product, &mut preconditioner, &fixed, &self.f, &mut self.d, options)?;
        vector::add_scaled(u, 1.0, &moved);
        vector::combine(&mut self.trial, u, 1.0, &self.d);
        let predicted = residual(problem, t, &self.trial, &mut self.trial_f);
        let alone = residual(problem, t, u, &mut self.f);
        let better = match (predicted, alone) {
            (Ok(predicted), Ok(alone)) => predicted <= alone || alone.is_nan(),
            (predicted, _) => predicted.is_ok(),
        };
        if better {
            u.copy_from_slice(&self.trial);
        }
        Ok(())
    }

    /// Goes along `d` to where the slope has fallen enough; `u` and `f` are then those of the new state. Returns its residual norm,
    /// or `None` where no step lowers anything.
    fn search(&mut self, problem: &mut dyn Statics, t: f64, u: &mut [f64], slope: f64) -> Result<Option<f64>, EquilibriumError> {
        problem.tangent_product(t, u, &self.d, &mut self.trial_f)?;
        vector::clear_fixed(&mut self.trial_f, problem.fixed());
        let curvature = vector::dot(&self.d, &self.trial_f);
        // Where the energy is not convex along d, the preconditioned gradient is a step of the right size.
        let mut a = if curvature > 0.0 { slope / curvature } else { 1.0 };
        let (mut low, mut low_slope) = (0.0, slope);
        let mut high: Option<(f64, f64)> = None;
        let mut energy = None;
        let mut taken = None;
        let mut stop = None;
        for trial in 0..MOST_TRIALS {
            vector::combine(&mut self.trial, u, a, &self.d);
            let norm = match residual(problem, t, &self.trial, &mut self.trial_f) {
                Ok(norm) if norm.is_finite() => norm,
                other => {
                    stop = other.err().or(stop);
                    high = Some((a, f64::NAN));
                    a = 0.5 * (low + a);
                    continue;
                }
            };
            let s = vector::dot(&self.trial_f, &self.d);
            let falls = trial == 0 && s.abs() <= self.options.slope_ratio * slope || {
                let start = *energy.get_or_insert_with(|| problem.energy(t, u));
                match (start, problem.energy(t, &self.trial)) {
                    (Some(start), Some(end)) => end <= start + 16.0 * f64::EPSILON * start.abs(),
                    _ => true,
                }
            };
            if falls && s.abs() <= self.options.slope_ratio * slope {
                taken = Some(norm);
                break;
            }
            if s > 0.0 && falls {
                (low, low_slope) = (a, s);
            } else {
                high = Some((a, s));
            }
            a = match high {
                None => {
                    // Still going down: on by the secant, at most fourfold.
                    let next = if low_slope < slope { a * slope / (slope - low_slope) } else { 4.0 * a };
                    next.clamp(1.2 * a, 4.0 * a)
                }
                Some((high, s)) => {
                    let share = if s < 0.0 { low_slope / (low_slope - s) } else { 0.5 };
                    low + (high - low) * share.clamp(0.1, 0.9)
                }
            };
        }
        if taken.is_none() && low > 0.0 {
            // The slope did not fall as far as wished, but the energy fell.
            vector::combine(&mut self.trial, u, low, &self.d);
            taken = Some(residual(problem, t, &self.trial, &mut self.trial_f)?);
        }
        match (taken, stop) {
            (None, Some(stop)) => Err(stop.into()),
            (None, None) => Ok(None),
            (Some(norm), _) => {
                u.copy_from_slice(&self.trial);
                std::mem::swap(&mut self.f, &mut self.trial_f);
                Ok(Some(norm))
            }
        }
    }
}

impl Equilibrium for NonlinearCg {
    fn equilibrate(
        &mut self,
        problem: &mut dyn Statics,
        t: f64,
        u: &mut [f64],
        cancel: Cancel<'_>,
    ) -> Result<Equilibrated, EquilibriumError> {
        const NAME: &str = "nonlinear conjugate gradients";
        for work in [&mut self.f, &mut self.trial_f, &mut self.trial, &mut self.z, &mut self.d] {
            work.clear();
            work.resize(u.len(), 0.0);
        }
        self.predict(problem, t, u)?;
        let mut scale = Scale::default();
        let mut norm = residual(problem, t, u, &mut self.f)?;
        let mut preconditioner = self.preconditioner(problem, t, u)?;
        let mut history = Vec::new();
        let (mut best, mut best_at) = (f64::INFINITY, 0);
        let (mut rho, mut since_restart) = (0.0, 0);
        for iterations in 0.. {
            let relative = scale.relative(problem, norm);
            if iterations % 10 == 0 || relative <= self.options.tolerance {
                history.push(relative);
            }
            let done = |at_round_off, history| {
                Ok(Equilibrated { iterations, residual: relative, history, at_round_off, solver: NAME, ..Default::default() })
            };
            if relative <= self.options.tolerance {
                return done(false, history);
            }
            if relative < 0.5 * best {
                (best, best_at) = (relative, iterations);
            }
            let stagnant = iterations - best_at > STAGNATION && relative <= ROUND_OFF_RESIDUAL;
            if stagnant {
                return done(true, history);
            }
            let reason = match () {
                () if !relative.is_finite() => Some("the residual is not a number"),
                () if iterations >= self.options.max_iterations => Some("too many iterations"),
                () => None,
            };
            let failed = |reason: &str, history, f: &[f64], fixed: &[bool]| EquilibriumError::NotConverged {
                method: NAME,
                reason: reason.into(),
                iterations,
                residual: relative,
                history,
                worst_dof: worst_dof(f, fixed),
            };
            if let Some(reason) = reason {
                return Err(failed(reason, history, &self.f, problem.fixed()));
            }
            if cancelled(cancel) {
                return Err(EquilibriumError::Cancelled);
            }
            if since_restart >= self.options.restart {
                preconditioner = self.preconditioner(problem, t, u)?;
                since_restart = 0;
            }
            // trial_f holds the residual before this one (swapped there by the search).
            preconditioner.apply(&self.f, &mut self.z);
            vector::clear_fixed(&mut self.z, problem.fixed());
            let rho_before = rho;
            rho = vector::dot(&self.f, &self.z);
            let crossed = vector::dot(&self.trial_f, &self.z);
            let beta = if since_restart == 0 { 0.0 } else { ((rho - crossed) / rho_before).max(0.0) };
            vector::scale_and_add(&mut self.d, beta, &self.z);
            let mut slope = vector::dot(&self.f, &self.d);
            if slope <= 0.0 || beta == 0.0 {
                self.d.copy_from_slice(&self.z);
                (slope, since_restart) = (rho, 0);
            }
            since_restart += 1;
            match self.search(problem, t, u, slope)? {
                Some(reached) => norm = reached,
                None if since_restart > 1 => {
                    // A fresh start along the preconditioned gradient before giving up.
                    since_restart = 0;
                }
                None if relative <= ROUND_OFF_RESIDUAL => return done(true, history),
                None => {
                    return Err(failed("no step along the gradient lowers the energy", history, &self.f, problem.fixed()));
                }
            }
        }
        unreachable!("the loop returns")
    }
}
