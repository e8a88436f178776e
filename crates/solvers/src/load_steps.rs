//! Statics over a program of loads: increments with cutting, bonds that break at equilibrium, and the interface of the methods that
//! find one equilibrium ([`crate::newton`], [`crate::nonlinear_cg`], [`crate::dynamic_relaxation`]).

use std::ops::ControlFlow;

use crate::direct::DirectError;
use crate::observe::{Cancel, Ended, Observer, StepReport, cancelled};
use crate::problem::{Statics, Stop};
use crate::vector;

/// A method that finds an equilibrium near a given state.
pub trait Equilibrium {
    /// Solves `f(t, u) = 0` for the free dofs.
    ///
    /// On entry `u` is the equilibrium at an earlier load (or at `t` itself, before bonds broke), fixed dofs included. On success it
    /// is the equilibrium at `t`; on failure it holds anything.
    ///
    /// # Errors
    /// [`EquilibriumError`].
    fn equilibrate(
        &mut self,
        problem: &mut dyn Statics,
        t: f64,
        u: &mut [f64],
        cancel: Cancel<'_>,
    ) -> Result<Equilibrated, EquilibriumError>;

    /// The force law is another one now (bonds broke, or their breaking was undone): what was remembered of the stiffness is stale.
    fn force_law_changed(&mut self) {}
}

/// What a method reports of one equilibrium.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Equilibrated {
    /// Nonlinear iterations.
    pub iterations: usize,
    /// Iterations of the linear solver; 0 for direct solutions.
    pub linear_iterations: usize,
    /// `‖f‖` over free dofs relative to the force scale.
    pub residual: f64,
    /// Relative residuals of all iterations (of long runs, a selection).
    pub history: Vec<f64>,
    /// Whether the tolerance was out of reach: iterations stagnated at round-off, with the residual below
    /// [`ROUND_OFF_RESIDUAL`].
    pub at_round_off: bool,
    /// Times that the tangent was not positive definite and had to be modified.
    pub modified_tangents: usize,
    /// Method and linear solver, in words.
    pub solver: &'static str,
}

/// Stagnation above this relative residual is a failure, below it the limit of the arithmetic.
pub const ROUND_OFF_RESIDUAL: f64 = 1e-6;

/// Why no equilibrium was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EquilibriumError {
    /// The body stopped.
    #[error(transparent)]
    Evaluation(#[from] Stop),
    /// The linear system could not be solved.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The iterative linear solver did not converge.
    #[error(
        "the iterative linear solver stopped after {iterations} iterations at relative residual {residual:.1e}: allow more \
             iterations, use the direct solver, or support parts that are free to move"
    )]
    Krylov {
        /// Iterations made.
        iterations: usize,
        /// Relative residual reached.
        residual: f64,
    },
    /// The iteration did not converge.
    #[error(
        "{method} did not converge: {reason} (relative residual {residual:.1e} after {iterations} iterations, largest at dof {worst_dof})"
    )]
    NotConverged {
        /// The method.
        method: &'static str,
        /// What happened.
        reason: String,
        /// Iterations made.
        iterations: usize,
        /// Relative residual at the end.
        residual: f64,
        /// Relative residuals on the way.
        history: Vec<f64>,
        /// Free dof with the largest residual.
        worst_dof: usize,
    },
    /// The run was cancelled.
    #[error("the run was cancelled")]
    Cancelled,
}

impl EquilibriumError {
    /// The free dof with the largest residual or the bad pivot, where there is one.
    pub fn worst_dof(&self) -> Option<usize> {
        match self {
            Self::NotConverged { worst_dof, .. } => Some(*worst_dof),
            Self::Direct(
                DirectError::NotPositiveDefinite { dof } | DirectError::Singular { dof } | DirectError::Inaccurate { dof, .. },
            ) => Some(*dof),
            _ => None,
        }
    }
}

/// Index of the largest absolute free entry (of the first NaN, where there is one).
pub(crate) fn worst_dof(f: &[f64], fixed: &[bool]) -> usize {
    let mut worst = (0, -1.0);
    for k in (0..f.len()).filter(|&k| !fixed[k]) {
        if f[k].is_nan() {
            return k;
        }
        if f[k].abs() > worst.1 {
            worst = (k, f[k].abs());
        }
    }
    worst.0
}

/// `force`, with fixed entries set to zero; returns its norm.
pub(crate) fn residual(problem: &mut dyn Statics, t: f64, u: &[f64], f: &mut [f64]) -> Result<f64, Stop> {
    problem.force(t, u, f)?;
    vector::clear_fixed(f, problem.fixed());
    Ok(vector::norm(f))
}

/// What a relative residual is relative to: the body's own scale, or the first residual that was not zero.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Scale {
    first: f64,
}

impl Scale {
    /// The residual norm of the state last evaluated, relative to the force scale there.
    pub(crate) fn relative(&mut self, problem: &dyn Statics, norm: f64) -> f64 {
        if self.first == 0.0 && norm.is_finite() {
            self.first = norm;
        }
        let scale = problem.force_scale();
        let scale = if scale > 0.0 { scale } else { self.first };
        if norm == 0.0 { 0.0 } else { norm / scale }
    }
}

/// A program of loads.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadSteps {
    /// Load parameter of the state given at the start.
    pub start: f64,
    /// Load parameters to be reached exactly, ascending. If the first equals `start`, the start itself is brought to equilibrium.
    pub stations: Vec<f64>,
    /// Largest increment; the distance to the next station where `None`.
    pub largest_increment: Option<f64>,
    /// An increment that has been halved to less than this fraction of the whole range is an error. 1e-4 by default.
    pub smallest_fraction: f64,
    /// An equilibrium found with so few nonlinear iterations lets the increment grow again by a factor of two, up to the largest.
    pub easy_iterations: usize,
    /// Most times that bonds may break at one load before this counts as a failure of the increment.
    pub most_breakings: usize,
}

/// Why a program of loads was not carried through. The displacement given to [`LoadSteps::run`] holds the last equilibrium accepted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StaticsError {
    /// The program itself is not usable.
    #[error("the load stations must be finite and ascending from {start}; station {index} is {value}")]
    Stations {
        /// Start of the program.
        start: f64,
        /// Number of the bad station.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// No equilibrium, even for the smallest increment.
    #[error("no equilibrium beyond load {time}: the increment was cut to {increment:.3e}, and {cause}")]
    Increment {
        /// Last load at equilibrium.
        time: f64,
        /// The last increment tried.
        increment: f64,
        /// Why the last attempt failed.
        cause: EquilibriumError,
    },
    /// Bonds went on breaking.
    #[error(
        "bonds were still breaking after {passes} equilibria at one load, beyond load {time} ({broken} broken): the crack grows \
             unstably; prescribe displacement instead of force, or use dynamics"
    )]
    Breaking {
        /// Last load at equilibrium.
        time: f64,
        /// Equilibria found at the load that failed.
        passes: usize,
        /// Bonds broken there.
        broken: usize,
    },
    /// The body stopped the run at an accepted state.
    #[error("load {time}: {stop}")]
    Stopped {
        /// Load of the accepted state.
        time: f64,
        /// Why.
        stop: Stop,
    },
}

enum Failure {
    Equilibrium(EquilibriumError),
    Breaking { passes: usize, broken: usize },
}

impl LoadSteps {
    /// `steps` equal increments from `start` to `end`.
    pub fn uniform(start: f64, end: f64, steps: usize) -> Self {
        let at = |k: usize| {
            if k == steps { end } else { start + (end - start) * (k as f64 / steps as f64) }
        };
        Self::at((1..=steps).map(at).collect(), start)
    }

    /// Given stations.
    pub fn at(stations: Vec<f64>, start: f64) -> Self {
        Self { start, stations, largest_increment: None, smallest_fraction: 1e-4, easy_iterations: 6, most_breakings: 10_000 }
    }

    /// Follows the program from the equilibrium `u` at [`start`](Self::start).
    ///
    /// An increment that fails (no convergence, a body that stops, bonds breaking without end) is rolled back and halved. At each
    /// equilibrium the bonds that fail are broken and a new equilibrium is sought at the same load until none breaks; then the
    /// increment is accepted. Cancelling gives up the increment under way.
    ///
    /// # Errors
    /// [`StaticsError`]; `u` then holds the last accepted equilibrium, and the problem is rolled back to it.
    pub fn run<P: Statics + ?Sized>(
        &self,
        problem: &mut P,
        method: &mut dyn Equilibrium,
        u: &mut [f64],
        observer: &mut dyn Observer<P>,
        cancel: Cancel<'_>,
    ) -> Result<Ended, StaticsError> {
        let start = self.start;
        let mut before = start;
        for (index, &value) in self.stations.iter().enumerate() {
            if !(value.is_finite() && start.is_finite() && (value > before || index == 0 && value == start)) {
                return Err(StaticsError::Stations { start, index, value });
            }
            before = value;
        }
        let smallest = self.smallest_fraction * (before - start);
        let mut trial = u.to_vec();
        let mut time = start;
        let mut increment = f64::INFINITY;
        let (mut step, mut cuts) = (0, 0);
        for &station in &self.stations {
            loop {
                let remaining = station - time;
                increment = increment.min(self.largest_increment.unwrap_or(f64::INFINITY));
                // A last bit much shorter than the rest is not left over: two increments alike instead.
                let target = if increment >= remaining * (1.0 - 1e-9) {
                    station
                } else if 2.0 * increment > remaining {
                    time + 0.5 * remaining
                } else {
                    time + increment
                };
                problem.checkpoint();
                trial.copy_from_slice(u);
                let outcome = match cancelled(cancel) {
                    true => Err(Failure::Equilibrium(EquilibriumError::Cancelled)),
                    false => self.equilibrium(&mut &mut *problem, method, target, &mut trial, cancel),
                };
                match outcome {
                    Ok(mut report) => {
                        u.copy_from_slice(&trial);
                        step += 1;
                        (report.step, report.increment, report.cuts) = (step, target - time, cuts);
                        report.station = target == station;
                        if report.iterations <= self.easy_iterations * report.equilibria && increment.is_finite() {
                            increment *= 2.0;
                        }
                        (time, cuts) = (target, 0);
                        problem.accept(time, u).map_err(|stop| StaticsError::Stopped { time, stop })?;
                        if observer.step(&report, problem, u, &[]) == ControlFlow::Break(()) {
                            return Ok(Ended::Observer);
                        }
                    }
                    Err(failure) => {
                        problem.rollback();
                        method.force_law_changed();
                        if matches!(failure, Failure::Equilibrium(EquilibriumError::Cancelled)) {
                            return Ok(Ended::Cancelled);
                        }
                        let tried = target - time;
                        increment = 0.5 * tried;
                        cuts += 1;
                        if increment < smallest || increment == 0.0 || time + increment == time {
                            return Err(match failure {
                                Failure::Equilibrium(cause) => StaticsError::Increment { time, increment: tried, cause },
                                Failure::Breaking { passes, broken } => StaticsError::Breaking { time, passes, broken },
                            });
                        }
                    }
                }
                if time >= station {
                    break;
                }
            }
        }
        Ok(Ended::Completed)
    }

    /// Equilibria at one load until no more bonds break.
    fn equilibrium(
        &self,
        problem: &mut dyn Statics,
        method: &mut dyn Equilibrium,
        t: f64,
        u: &mut [f64],
        cancel: Cancel<'_>,
    ) -> Result<StepReport, Failure> {
        let mut report = StepReport { time: t, ..Default::default() };
        loop {
            let found = method.equilibrate(problem, t, u, cancel).map_err(Failure::Equilibrium)?;
            report.equilibria += 1;
            report.iterations += found.iterations;
            report.linear_iterations += found.linear_iterations;
            report.residual = found.residual;
            report.solver = found.solver;
            let broken = problem.break_bonds(t, u).map_err(|stop| Failure::Equilibrium(stop.into()))?;
            if broken == 0 {
                return Ok(report);
            }
            report.broken += broken;
            method.force_law_changed();
            if report.equilibria > self.most_breakings {
                return Err(Failure::Breaking { passes: report.equilibria, broken: report.broken });
            }
        }
    }
}
