//! The two faces of a body that solvers see: [`Dynamics`] and [`Statics`].
//!
//! Vectors are flat and interleaved: component `c` of point `p` is entry `p * D + c`. All quantities are in one consistent system of
//! units, whichever it is: no solver contains an absolute tolerance.
//!
//! **Fixed dofs.** A dof is *fixed* where its motion is prescribed. Solvers never change a fixed dof except through the
//! `prescribe…` calls, never look at the entries of `f` or `K x` there, and always pass zero there in the `x` of a tangent product
//! unless the documentation of the caller says otherwise (the predictor of statics passes the increments of fixed dofs, which is how
//! their motion loads the free ones). So an implementation may leave reactions in the fixed entries of `f`.

use std::sync::Arc;

use crate::sparse::{BlockMatrix, BlockPattern};

/// Why an evaluation could not be completed.
///
/// Made by the body, which knows the point, its position and the likely cause; solvers hand it on inside their own errors, or take a
/// shorter step where they can.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{reason}")]
#[non_exhaustive]
pub struct Stop {
    /// What went wrong, where, and what the user can do.
    pub reason: String,
}

impl Stop {
    /// A stop with its reason: one sentence with the point, the cause and a remedy.
    pub fn new(reason: impl Into<String>) -> Self {
        Self { reason: reason.into() }
    }
}

/// A system in motion: `M a = f(t, u, v)` with lumped mass `M`.
pub trait Dynamics {
    /// Number of dofs: length of every vector below.
    fn dofs(&self) -> usize;

    /// Lumped mass per dof `\[mass\]`, positive and finite at free dofs.
    fn mass(&self) -> &[f64];

    /// Which dofs have a prescribed displacement or velocity now. May change in [`accept`](Self::accept) only.
    fn fixed(&self) -> &[bool];

    /// Overwrites `f` (all of it: no accumulation) with the total force per dof `[force]`: internal, external, damping, contact.
    ///
    /// Must not change history or damage. Called once a step.
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated (inverted family, NaN, runaway).
    fn force(&mut self, t: f64, u: &[f64], v: &[f64], f: &mut [f64]) -> Result<(), Stop>;

    /// Overwrites those entries of `u` whose displacement is prescribed, for time `t`; leaves the others alone.
    fn prescribe_displacement(&mut self, t: f64, u: &mut [f64]);

    /// Overwrites the velocity of *every* fixed dof for time `t`: the prescribed velocity, or the time derivative of the prescribed
    /// displacement. Asked at half steps also.
    fn prescribe_velocity(&mut self, t: f64, v: &mut [f64]);

    /// The largest step from here, not above `step`, that resolves the motion of points that are about to meet. `step` is stable at the start. Asked before every step; the default is `step`.
    ///
    /// # Errors
    /// [`Stop`] where no step does.
    fn step_limit(&mut self, _t: f64, _u: &[f64], _v: &[f64], step: f64) -> Result<f64, Stop> {
        Ok(step)
    }

    /// How much stiffer than at the start the stiffest part may have become, 1 where it has not: any measure that grows by more than a few
    /// per cent whenever the largest frequency does. An automatic step estimates that frequency again when this has changed; asked
    /// after [`step_limit`](Self::step_limit), of the same state. The default is 1.
    fn hardness(&self) -> f64 {
        1.0
    }

    /// Whether bonds that are left may become stiffer when others break (shapes that are rebuilt): an automatic step then estimates the
    /// largest frequency again after breaking. The default is no.
    fn stiffens_by_breaking(&self) -> bool {
        false
    }

    /// The increment that ends at `t` is accepted: commit history, break bonds, change conditions. Returns whether the force law
    /// changed (bonds broke), so that the force last evaluated is out of date.
    ///
    /// # Errors
    /// [`Stop`] where the accepted state ends the run (a body that has fallen apart, say).
    fn accept(&mut self, t: f64, u: &[f64], v: &[f64]) -> Result<bool, Stop>;

    /// `y = K x` with `K = −∂f/∂u` at `(t, u)`, exact. Only the free entries of `y` need be right. Used for stable time steps.
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated.
    fn tangent_product(&mut self, t: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop>;
}

/// A system at rest: `f(t, u) = 0` at free dofs, with load parameter `t`.
///
/// # Order of calls
/// [`checkpoint`](Self::checkpoint) at the start of a load increment; any number of evaluations; at each equilibrium
/// [`break_bonds`](Self::break_bonds), and further evaluations where bonds broke; then either [`accept`](Self::accept), or
/// [`rollback`](Self::rollback) to the checkpoint and a new, smaller increment.
pub trait Statics {
    /// Number of dofs: length of every vector below.
    fn dofs(&self) -> usize;

    /// Dofs of one point, `D` (the block size); divides [`dofs`](Self::dofs).
    fn dofs_per_point(&self) -> usize;

    /// Coordinates of the points in the reference configuration, interleaved, the same number for each point (`dofs / D` points).
    /// Used for orderings only, so any sensible geometry does.
    fn positions(&self) -> &[f64];

    /// Which dofs are prescribed, per dof. May change in [`prescribe`](Self::prescribe), [`break_bonds`](Self::break_bonds),
    /// [`accept`](Self::accept) and [`rollback`](Self::rollback) only.
    fn fixed(&self) -> &[bool];

    /// Overwrites the fixed entries of `u` for load parameter `t`; leaves the others alone.
    fn prescribe(&mut self, t: f64, u: &mut [f64]);

    /// Overwrites `f` with internal plus external force per dof; zero at free dofs in equilibrium. Fixed entries may hold anything
    /// (reactions, usually). Must not change history or damage.
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated; the solver then tries a shorter step.
    fn force(&mut self, t: f64, u: &[f64], f: &mut [f64]) -> Result<(), Stop>;

    /// The potential `Π(t, u)` with `f = −∂Π/∂u` at free dofs `[energy]`, where there is one; `None` for forces without a potential
    /// (then line searches go by `f` alone). A state that cannot be evaluated may return `None` or infinity.
    fn energy(&mut self, t: f64, u: &[f64]) -> Option<f64>;

    /// `y = K x` with `K = −∂f/∂u` at `(t, u)`, exact. Only the free entries of `y` need be right; `x` may have non-zero fixed
    /// entries, which count.
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated.
    fn tangent_product(&mut self, t: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop>;

    /// The sparsity pattern of the assembled tangent, or `None` where this body does not assemble (3D, memory).
    ///
    /// Return the *same* `Arc` as long as the pattern holds: the solver compares pointers to reuse its symbolic factor. A pattern
    /// that is too large (bonds broken since) is correct, so usually one pattern lasts the whole run.
    fn pattern(&mut self) -> Option<Arc<BlockPattern>>;

    /// Adds the symmetric tangent `K = −∂f/∂u` at `(t, u)` to `matrix`, which has the pattern of [`pattern`](Self::pattern) and is
    /// zero. Fixed rows and columns may be filled or not. Where `K` is not symmetric, add its symmetric part (iterations then lose
    /// quadratic convergence, not correctness).
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated.
    fn tangent(&mut self, t: f64, u: &[f64], matrix: &mut BlockMatrix) -> Result<(), Stop>;

    /// Adds to `matrix`, of the pattern of the tangent, the derivative of the tangent at `(t, u)` along the displacement `along`, exact:
    /// `K_σ` of linear buckling, where `along` is what a load does. Returns `false`, adding nothing, where the body does not know it.
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated.
    fn tangent_change(&mut self, _t: f64, _u: &[f64], _along: &[f64], _matrix: &mut BlockMatrix) -> Result<bool, Stop> {
        Ok(false)
    }

    /// Overwrites `blocks` with the `D×D` diagonal blocks of `K` at `(t, u)`, one per point, row-major, for preconditioning. An
    /// approximation is allowed (it changes speed, not results), but keep it symmetric and positive.
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated.
    fn block_diagonal(&mut self, t: f64, u: &[f64], blocks: &mut [f64]) -> Result<(), Stop>;

    /// The distance beyond which no two points are coupled by the tangent `[length]`, where there is one that is short beside the body: it
    /// lets iterative solvers correct what is smooth on a coarse grid. The default is none.
    fn reach(&self) -> Option<f64> {
        None
    }

    /// The force that the residual is small *relative to* `[force]`: the largest of the Euclidean norms over dofs of the reactions and
    /// of the external forces, at the last [`force`](Self::force) call and at the states accepted so far. Not at all states ever
    /// tried: a trial far off has huge reactions, against which any residual is small. 0 where nothing is known (the solver then
    /// takes its first residual).
    fn force_scale(&self) -> f64;

    /// Breaks the bonds that fail at the equilibrium `(t, u)` and returns how many broke now (0: none). Which bonds to break together
    /// is the body's choice. Undone by [`rollback`](Self::rollback).
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated.
    fn break_bonds(&mut self, t: f64, u: &[f64]) -> Result<usize, Stop>;

    /// The share of the load `t` at which the first bond would fail if displacements were `u` at `t` and in proportion to the load below; `None`,
    /// the default, where none fails up to `t`.
    ///
    /// # Errors
    /// [`Stop`] where the state cannot be evaluated.
    fn first_failure(&mut self, _t: f64, _u: &[f64]) -> Result<Option<f64>, Stop> {
        Ok(None)
    }

    /// The increment is accepted: commit history.
    ///
    /// # Errors
    /// [`Stop`] where the accepted state ends the run.
    fn accept(&mut self, t: f64, u: &[f64]) -> Result<(), Stop>;

    /// Remembers damage and history, for one later [`rollback`](Self::rollback) or none.
    fn checkpoint(&mut self);

    /// Returns to the damage and history of the last [`checkpoint`](Self::checkpoint), which stays valid.
    fn rollback(&mut self);
}

/// So that a solver generic over `P: Statics + ?Sized` can hand a trait object to its parts.
impl<P: Statics + ?Sized> Statics for &mut P {
    fn dofs(&self) -> usize {
        (**self).dofs()
    }
    fn dofs_per_point(&self) -> usize {
        (**self).dofs_per_point()
    }
    fn positions(&self) -> &[f64] {
        (**self).positions()
    }
    fn fixed(&self) -> &[bool] {
        (**self).fixed()
    }
    fn prescribe(&mut self, t: f64, u: &mut [f64]) {
        (**self).prescribe(t, u);
    }
    fn force(&mut self, t: f64, u: &[f64], f: &mut [f64]) -> Result<(), Stop> {
        (**self).force(t, u, f)
    }
    fn energy(&mut self, t: f64, u: &[f64]) -> Option<f64> {
        (**self).energy(t, u)
    }
    fn tangent_product(&mut self, t: f64, u: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Stop> {
        (**self).tangent_product(t, u, x, y)
    }
    fn pattern(&mut self) -> Option<Arc<BlockPattern>> {
        (**self).pattern()
    }
    fn tangent(&mut self, t: f64, u: &[f64], matrix: &mut BlockMatrix) -> Result<(), Stop> {
        (**self).tangent(t, u, matrix)
    }
    fn tangent_change(&mut self, t: f64, u: &[f64], along: &[f64], matrix: &mut BlockMatrix) -> Result<bool, Stop> {
        (**self).tangent_change(t, u, along, matrix)
    }
    fn block_diagonal(&mut self, t: f64, u: &[f64], blocks: &mut [f64]) -> Result<(), Stop> {
        (**self).block_diagonal(t, u, blocks)
    }
    fn reach(&self) -> Option<f64> {
        (**self).reach()
    }
    fn force_scale(&self) -> f64 {
        (**self).force_scale()
    }
    fn break_bonds(&mut self, t: f64, u: &[f64]) -> Result<usize, Stop> {
        (**self).break_bonds(t, u)
    }
    fn first_failure(&mut self, t: f64, u: &[f64]) -> Result<Option<f64>, Stop> {
        (**self).first_failure(t, u)
    }
    fn accept(&mut self, t: f64, u: &[f64]) -> Result<(), Stop> {
        (**self).accept(t, u)
    }
    fn checkpoint(&mut self) {
        (**self).checkpoint();
    }
    fn rollback(&mut self) {
        (**self).rollback();
    }
}
