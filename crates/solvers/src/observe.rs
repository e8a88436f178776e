//! What solvers tell between steps, and how a run is ended early.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// One accepted step of time or load.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct StepReport {
    /// Number of accepted steps, this one included; 0 for the state before the first.
    pub step: usize,
    /// Time or load parameter reached.
    pub time: f64,
    /// Length of the step.
    pub increment: f64,
    /// Iterations of the nonlinear solver, over all equilibria of the step; 0 for explicit steps.
    pub iterations: usize,
    /// Iterations of the linear solver; 0 for direct solutions and explicit steps.
    pub linear_iterations: usize,
    /// Residual reached, relative to the force scale; 0 for explicit steps.
    pub residual: f64,
    /// Method and linear solver used, in words.
    pub solver: &'static str,
    /// Bonds that broke at equilibria of this step (statics).
    pub broken: usize,
    /// Equilibria found on the way (1 plus the number of times that bonds broke); 0 for explicit steps.
    pub equilibria: usize,
    /// Increments given up and cut before this one succeeded.
    pub cuts: usize,
    /// Whether this is a time or load that was asked for, not one put in between by the solver.
    pub station: bool,
    /// Negative eigenvalues of the tangent where that is known (path following): 0 where the state is stable.
    pub unstable_modes: Option<usize>,
}

/// Looks on between steps.
pub trait Observer<P: ?Sized> {
    /// Called with each accepted state: displacement `u`, velocity `v` (empty in statics). May ask the problem for what it knows, but
    /// must leave its state as it is. [`ControlFlow::Break`] ends the run after this step, without an error.
    fn step(&mut self, report: &StepReport, problem: &mut P, u: &[f64], v: &[f64]) -> ControlFlow<()>;
}

/// Any closure of the right shape observes.
impl<P: ?Sized, F> Observer<P> for F
where
    F: FnMut(&StepReport, &mut P, &[f64], &[f64]) -> ControlFlow<()>,
{
    fn step(&mut self, report: &StepReport, problem: &mut P, u: &[f64], v: &[f64]) -> ControlFlow<()> {
        self(report, problem, u, v)
    }
}

/// Observes nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl<P: ?Sized> Observer<P> for Silent {
    fn step(&mut self, _: &StepReport, _: &mut P, _: &[f64], _: &[f64]) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// How a run ended that met no error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The last time or load was reached.
    Completed,
    /// An observer ended it.
    Observer,
    /// It was cancelled from outside; the state is that of the last accepted step.
    Cancelled,
}

/// A flag that another thread (or a signal handler) may set to end a run at the next opportunity.
pub type Cancel<'a> = Option<&'a AtomicBool>;

/// Whether the flag is there and set.
pub fn cancelled(cancel: Cancel<'_>) -> bool {
    cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
}
