//! Statics of a linear body whose bonds break one after the other, each at its threshold: sequentially linear analysis.
//!
//! At a prescribed load what breaks overloads its neighbours, which break beyond their thresholds; the load of a test that follows the crack
//! would have gone back. Here it does: the load of each step is the one at which the next bond fails, found by proportion, so it goes up and
//! down along the path of equilibria. Nothing is iterated.
//!
//! **Source.** J. G. Rots, Sequentially linear continuum model for concrete fracture, in: Fracture Mechanics of Concrete Structures (2001),
//! 831–839; with bonds in the place of integration points, which lose all their stiffness at once.

use std::ops::ControlFlow;

use crate::load_steps::{Equilibrium, EquilibriumError, StaticsError};
use crate::observe::{Cancel, Ended, Observer, StepReport, cancelled};
use crate::problem::{Statics, Stop};

/// Largest part of the load by which a step may go beyond the threshold.
const LARGEST_EXCESS: f64 = 0.1;
/// Loads that are not in proportion to `t` are told by displacements that deviate by more, relative to the largest.
const PROPORTIONAL: f64 = 1e-6;

/// A path of loads at which bonds fail.
#[derive(Clone, Debug, PartialEq)]
pub struct SequentiallyLinear {
    /// Load at which the path ends: no bond fails below it any more. All loads are proportional to the load parameter, 0 at the start.
    pub end: f64,
    /// A step goes beyond the threshold by this part of its load, so that bonds that fail together by symmetry break together. 1e-3.
    pub excess: f64,
    /// Steps after which the path is given up.
    pub most_steps: usize,
}

impl SequentiallyLinear {
    /// A path to the load `end`.
    pub fn new(end: f64) -> Self {
        Self { end, excess: 1e-3, most_steps: 1_000_000 }
    }

    /// Follows the path from the unloaded body `u`. `method` must solve linearly. A step is reported at its load with the bonds that broke
    /// there, in the new equilibrium.
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
        let mut trial = u.to_vec();
        let mut time = 0.0;
        let mut ended = None;
        for step in 1..=self.most_steps {
            problem.checkpoint();
            let outcome = self.step(&mut &mut *problem, method, step == 1, u, &mut trial, cancel);
            let mut report = match outcome {
                Ok(report) => report,
                Err(cause) => {
                    problem.rollback();
                    method.force_law_changed();
                    if matches!(cause, EquilibriumError::Cancelled) {
                        return Ok(Ended::Cancelled);
                    }
                    return Err(StaticsError::Increment { time, increment: self.end - time, cause });
                }
            };
            (report.step, report.increment) = (step, report.time - time);
            time = report.time;
            u.copy_from_slice(&trial);
            problem.accept(time, u).map_err(|stop| StaticsError::Stopped { time, stop })?;
            let last = report.broken == 0;
            report.station = last;
            if observer.step(&report, problem, u, &[]) == ControlFlow::Break(()) {
                return Ok(Ended::Observer);
            }
            if last {
                ended = Some(Ended::Completed);
                break;
            }
        }
        ended.ok_or(StaticsError::Breaking { time, passes: self.most_steps, broken: 0 })
    }

    /// The next step: the state after breaking, or that at the end where nothing breaks.
    fn step(
        &self,
        problem: &mut dyn Statics,
        method: &mut dyn Equilibrium,
        first: bool,
        u: &[f64],
        trial: &mut [f64],
        cancel: Cancel<'_>,
    ) -> Result<StepReport, EquilibriumError> {
        let mut report = StepReport::default();
        let mut solve = |problem: &mut dyn Statics, method: &mut dyn Equilibrium, t: f64, trial: &mut [f64]| {
            if cancelled(cancel) {
                return Err(EquilibriumError::Cancelled);
            }
            let found = method.equilibrate(problem, t, trial, cancel)?;
            report.equilibria += 1;
            report.iterations += found.iterations;
            report.linear_iterations += found.linear_iterations;
            (report.residual, report.solver) = (found.residual, found.solver);
            Ok(())
        };
        trial.copy_from_slice(u);
        solve(problem, method, self.end, trial)?;
        if first {
            let whole = trial.to_vec();
            solve(problem, method, 0.5 * self.end, trial)?;
            let largest = whole.iter().fold(0.0, |m: f64, u| m.max(u.abs()));
            if whole.iter().zip(&*trial).any(|(w, h)| (0.5 * w - h).abs() > PROPORTIONAL * largest) {
                return Err(Stop::new("the loads are not in proportion to `t`, as following the breaking of bonds needs them").into());
            }
            trial.copy_from_slice(&whole);
        }
        let Some(share) = problem.first_failure(self.end, trial)? else {
            report.time = self.end;
            return Ok(report);
        };
        let mut excess = self.excess;
        loop {
            let time = (self.end * share * (1.0 + excess)).min(self.end);
            trial.copy_from_slice(u);
            solve(problem, method, time, trial)?;
            let broken = problem.break_bonds(time, trial)?;
            if broken > 0 {
                method.force_law_changed();
                solve(problem, method, time, trial)?;
                (report.time, report.broken) = (time, broken);
                return Ok(report);
            }
            // stretches of large displacements are not quite in proportion
            excess *= 2.0;
            if excess > LARGEST_EXCESS {
                return Err(Stop::new(format!(
                    "no bond fails at load {time:.6e}, where one should by proportion: displacements are too large for linear statics"
                ))
                .into());
            }
        }
    }
}
