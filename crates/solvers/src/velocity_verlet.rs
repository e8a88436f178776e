//! Explicit dynamics: velocity Verlet, and the largest stable time step.

use std::ops::ControlFlow;

use rayon::prelude::*;

use crate::eigen::{self, EigenError};
use crate::observe::{Cancel, Ended, Observer, StepReport, cancelled};
use crate::problem::{Dynamics, Stop};
use crate::vector;

/// Most parts that a step is made in, and the smallest as a fraction of the step: what needs more is a collision that the model does not
/// prevent.
const MOST_PARTS: usize = 100_000;
const SMALLEST_PART: f64 = 1e-9;

/// Growth of [`Dynamics::hardness`] after which a step that follows the stiffness estimates the largest frequency again.
pub const HARDER: f64 = 1.1;
/// Parts made before a shortened step is estimated again, to find that it may be longer.
const PATIENCE: usize = 100;
/// Where bonds have become stiffer than at the start by a factor k, a step is a fraction 1/k of what would be stable, but not below this:
/// their stiffness changes within a period then, and stability alone would let the energy grow. On a bar driven into itself
/// (`decks/papers/tupek2014/driven-bar`) this conserves energy to a few parts in a thousand, whatever the exponent.
pub const FINEST: f64 = 0.05;

/// State of a motion: advanced in place, so a run can be continued.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Time.
    pub time: f64,
    /// Number of steps made.
    pub step: usize,
    /// Displacement per dof.
    pub u: Vec<f64>,
    /// Velocity per dof.
    pub v: Vec<f64>,
}

impl Motion {
    /// At rest in the reference configuration at `time`.
    pub fn at_rest(dofs: usize, time: f64) -> Self {
        Self { time, step: 0, u: vec![0.0; dofs], v: vec![0.0; dofs] }
    }
}

/// What velocity Verlet needs to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityVerlet {
    /// Largest time step. The run uses the largest step not above this that divides its duration evenly; where the body asks for
    /// shorter ones ([`Dynamics::step_limit`]) such a step is made in several parts.
    pub time_step: f64,
    /// Time at which to end.
    pub end: f64,
    /// The observer is called every so many steps (counted over the whole motion), and at the first and the last state. At least 1.
    /// A step made in parts is observed part by part where it is observed at all.
    pub observe_every: usize,
    /// Follow the stiffness on the way; `None` where the step was chosen by hand.
    pub following: Option<Following>,
}

/// A step that follows the stiffness: where the body says that it has become harder ([`Dynamics::hardness`]), or bonds broke whose breaking
/// stiffens others ([`Dynamics::stiffens_by_breaking`]), the largest frequency ω of its tangent is estimated again, and a part of a step
/// is at most `safety · (2/ω) · max((ω₀/ω)², 0.05)` long ([`FINEST`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Following {
    /// Fraction of the stable step.
    pub safety: f64,
    /// Largest angular frequency ω₀ at the start.
    pub frequency: f64,
}

/// Most steps with bonds that broke between two estimates.
const MOST_WAITED: usize = 8;

/// Where a [`Following`] is.
struct Follower {
    following: Option<Following>,
    /// Hardness and frequency at the last estimate.
    hardness: f64,
    frequency: f64,
    /// Longest part that the last estimate allows.
    limit: f64,
    /// Parts made since.
    since: usize,
    /// Parts since in which bonds broke, and how many are waited for: more where breaking changes little.
    broke: usize,
    waited: usize,
}

impl Follower {
    fn new(following: Option<Following>) -> Self {
        let frequency = following.map_or(0.0, |f| f.frequency);
        Follower { following, hardness: 1.0, frequency, limit: f64::INFINITY, since: 0, broke: 0, waited: 1 }
    }
    /// The longest part from here.
    fn limit<P: Dynamics + ?Sized>(&mut self, problem: &mut P, t: f64, u: &[f64]) -> Result<f64, Stop> {
        let Some(Following { safety, frequency }) = self.following else { return Ok(f64::INFINITY) };
        let hardness = problem.hardness();
        self.since += 1;
        let harder = hardness > HARDER * self.hardness;
        let broken = self.broke >= self.waited;
        if !(harder || broken || (self.limit.is_finite() && self.since > PATIENCE)) {
            return Ok(self.limit);
        }
        let former = self.frequency;
        (self.hardness, self.since, self.broke) = (hardness, 0, 0);
        self.limit = match largest_frequency(problem, t, u, 0.05) {
            // states that only run away have no stable step: the approach of points limits those
            Err(EigenError::NoStiffness { .. }) if hardness.is_finite() => f64::INFINITY,
            Err(EigenError::Evaluation(stop)) => return Err(stop),
            Err(e) => return Err(Stop::new(format!("the stable step could not be estimated again: {e}"))),
            Ok((omega, _)) => {
                self.frequency = omega;
                if omega <= frequency { f64::INFINITY } else { safety * 2.0 / omega * (frequency / omega).powi(2).max(FINEST) }
            }
        };
        if broken {
            let changed = (self.frequency / former - 1.0).abs() > 0.5 * (HARDER - 1.0);
            self.waited = if changed { 1 } else { MOST_WAITED.min(2 * self.waited) };
        }
        Ok(self.limit)
    }
    /// A part was made; `stiffer` where bonds broke whose breaking may stiffen others.
    fn made(&mut self, stiffer: bool) {
        self.broke += usize::from(stiffer);
    }
}

/// Why a motion could not be followed to its end.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// The time step or the end is not usable.
    #[error(
        "a motion from time {start} to {end} with steps of {time_step} cannot be made: the step must be positive and finite, the \
             end not before the start"
    )]
    Times {
        /// Time of the motion at the start.
        start: f64,
        /// End asked for.
        end: f64,
        /// Step asked for.
        time_step: f64,
    },
    /// A mass that cannot be divided by.
    #[error("dof {dof} has mass {mass}; the mass of every free dof must be positive and finite")]
    Mass {
        /// The dof.
        dof: usize,
        /// Its mass.
        mass: f64,
    },
    /// The body stopped.
    #[error("step {step} at time {time}: {stop}")]
    Stopped {
        /// Number of the step under way.
        step: usize,
        /// Time at its end.
        time: f64,
        /// Why.
        stop: Stop,
    },
}

impl VelocityVerlet {
    /// Follows the motion `M a = f` from `motion.time` to [`end`](Self::end).
    ///
    /// One step from `t` to `t' = t + Δt` (Swope, Andersen, Berens and Wilson 1982, J. Chem. Phys. 76, eqs. 8–9 in half-step form):
    ///
    /// ```text
    /// v½ = v + Δt/2 M⁻¹ f;   u' = u + Δt v½;   f' = f(t', u', v½);   v' = v½ + Δt/2 M⁻¹ f'
    /// ```
    ///
    /// Forces that depend on velocity see `v½`, which keeps the step explicit (first order in the damping, stable for moderate
    /// damping). A dof with prescribed velocity moves by its velocity at the middle of the step; a dof with prescribed displacement
    /// goes where it must, and its `v½` is the displacement made divided by `Δt`; both have exactly the prescribed velocity at the
    /// end of the step. The force is evaluated once a step, before bonds break: a bond that fails at `t'` acts until `t' + Δt/2`.
    ///
    /// # Errors
    /// [`MotionError`]. After [`MotionError::Stopped`] `motion` holds the last accepted displacements and their time; velocities are half a step
    /// ahead of them where the force could not be evaluated.
    pub fn run<P: Dynamics + ?Sized>(
        &self,
        problem: &mut P,
        motion: &mut Motion,
        observer: &mut dyn Observer<P>,
        cancel: Cancel<'_>,
    ) -> Result<Ended, MotionError> {
        let (start, duration) = (motion.time, self.end - motion.time);
        if !(self.time_step > 0.0 && self.time_step.is_finite() && duration >= 0.0 && duration.is_finite()) {
            return Err(MotionError::Times { start, end: self.end, time_step: self.time_step });
        }
        // A ratio that is whole but for round-off is whole.
        let steps = (duration / self.time_step * (1.0 - 1e-12)).ceil() as usize;
        let dt = if steps > 0 { duration / steps as f64 } else { 0.0 };
        let every = self.observe_every.max(1);
        let n = problem.dofs();
        assert!(motion.u.len() == n && motion.v.len() == n, "one entry per dof");
        for (dof, (&mass, &fixed)) in problem.mass().iter().zip(problem.fixed()).enumerate() {
            if !fixed && (mass <= 0.0 || !mass.is_finite()) {
                return Err(MotionError::Mass { dof, mass });
            }
        }
        let mut force = vec![0.0; n];
        let mut free = Free::of(problem.mass(), problem.fixed());
        let mut before = vec![];
        problem.prescribe_displacement(start, &mut motion.u);
        problem.prescribe_velocity(start, &mut motion.v);
        let mut follower = Follower::new(self.following);
        let first_step = motion.step;
        let stopped = |step: usize, time: f64| move |stop| MotionError::Stopped { step, time, stop };
        problem.force(start, &motion.u, &motion.v, &mut force).map_err(stopped(first_step, start))?;
        let mut report =
            StepReport { step: first_step, time: start, increment: dt, solver: "velocity Verlet", station: true, ..Default::default() };
        if observer.step(&report, problem, &motion.u, &motion.v) == ControlFlow::Break(()) {
            return Ok(Ended::Observer);
        }
        for k in 1..=steps {
            if cancelled(cancel) {
                return Ok(Ended::Cancelled);
            }
            // Times by multiplication: sums of many small steps drift.
            let time = if k == steps { self.end } else { start + k as f64 * dt };
            let step = first_step + k;
            motion.step = step;
            let mut left = dt;
            for part in 1.. {
                let limit = problem.step_limit(time - left, &motion.u, &motion.v, dt).map_err(stopped(step, time - left))?;
                let limit = limit.min(follower.limit(problem, time - left, &motion.u).map_err(stopped(step, time - left))?);
                // written so that a limit that is not a number is refused too
                let resolved = limit > dt * SMALLEST_PART && part <= MOST_PARTS;
                if !resolved {
                    return Err(stopped(step, time - left)(Stop::new(format!(
                        "points approach so fast that {MOST_PARTS} parts of a step, or parts of {SMALLEST_PART} of it, do not resolve them; \
                         reduce the load, or give the material an exponent that resists collapse"
                    ))));
                }
                let h = if limit >= left * (1.0 - 1e-12) { left } else { left / (left / limit).ceil() };
                left -= h;
                let time = if left > 0.0 { time - left } else { time };
                free.update(problem.mass(), problem.fixed());
                before.clear();
                before.extend(free.fixed.iter().map(|&dof| motion.u[dof as usize]));
                kick_and_move(&mut motion.v, &mut motion.u, h, &force, &free.inverse_mass);
                problem.prescribe_velocity(time - 0.5 * h, &mut motion.v);
                for (&dof, before) in free.fixed.iter().zip(&before) {
                    motion.u[dof as usize] = before + h * motion.v[dof as usize];
                }
                problem.prescribe_displacement(time, &mut motion.u);
                for (&dof, before) in free.fixed.iter().zip(&before) {
                    motion.v[dof as usize] = (motion.u[dof as usize] - before) / h;
                }
                if let Err(stop) = problem.force(time, &motion.u, &motion.v, &mut force) {
                    // back to where the body could be evaluated
                    motion.step = step - 1;
                    motion.u.iter_mut().zip(&motion.v).for_each(|(u, v)| *u -= h * v);
                    for (&dof, before) in free.fixed.iter().zip(&before) {
                        motion.u[dof as usize] = *before;
                    }
                    return Err(stopped(step, time)(stop));
                }
                motion.time = time;
                kick(&mut motion.v, 0.5 * h, &force, &free.inverse_mass);
                problem.prescribe_velocity(time, &mut motion.v);
                let broke = problem.accept(time, &motion.u, &motion.v).map_err(stopped(step, time))?;
                follower.made(broke && problem.stiffens_by_breaking());
                if left <= 0.0 {
                    break;
                }
                if cancelled(cancel) {
                    return Ok(Ended::Cancelled);
                }
                if step.is_multiple_of(every) {
                    (report.step, report.time, report.increment) = (step, time, h);
                    if observer.step(&report, problem, &motion.u, &motion.v) == ControlFlow::Break(()) {
                        return Ok(Ended::Observer);
                    }
                }
            }
            if step.is_multiple_of(every) || k == steps {
                (report.step, report.time, report.increment, report.station) = (step, time, dt, k == steps);
                if observer.step(&report, problem, &motion.u, &motion.v) == ControlFlow::Break(()) {
                    return Ok(Ended::Observer);
                }
            }
        }
        Ok(Ended::Completed)
    }
}

/// What moves freely.
struct Free {
    /// 1/m, and 0 at fixed dofs.
    inverse_mass: Vec<f64>,
    /// The fixed dofs.
    fixed: Vec<u32>,
    flags: Vec<bool>,
}

impl Free {
    fn of(mass: &[f64], fixed: &[bool]) -> Self {
        let inverse_mass = mass.iter().zip(fixed).map(|(m, &fixed)| if fixed { 0.0 } else { 1.0 / m }).collect();
        let list = (0..fixed.len() as u32).filter(|&dof| fixed[dof as usize]).collect();
        Free { inverse_mass, fixed: list, flags: fixed.to_vec() }
    }
    /// Follows what is fixed now.
    fn update(&mut self, mass: &[f64], fixed: &[bool]) {
        if self.flags != fixed {
            *self = Free::of(mass, fixed);
        }
    }
}

/// Entries that one thread takes at a time.
const GRAIN: usize = 16_384;

/// `v += dt M⁻¹ f`
fn kick(v: &mut [f64], dt: f64, force: &[f64], inverse_mass: &[f64]) {
    v.par_chunks_mut(GRAIN).zip(force.par_chunks(GRAIN)).zip(inverse_mass.par_chunks(GRAIN)).with_max_len(1).for_each(|((v, f), w)| {
        for ((v, f), w) in v.iter_mut().zip(f).zip(w) {
            *v += dt * f * w;
        }
    });
}

/// `v += dt/2 M⁻¹ f; u += dt v`, in one go through memory.
fn kick_and_move(v: &mut [f64], u: &mut [f64], dt: f64, force: &[f64], inverse_mass: &[f64]) {
    let (v, u) = (v.par_chunks_mut(GRAIN), u.par_chunks_mut(GRAIN));
    v.zip(u).zip(force.par_chunks(GRAIN)).zip(inverse_mass.par_chunks(GRAIN)).with_max_len(1).for_each(|(((v, u), f), w)| {
        for (((v, u), f), w) in v.iter_mut().zip(u).zip(f).zip(w) {
            *v += 0.5 * dt * f * w;
            *u += dt * *v;
        }
    });
}

/// Kinetic energy `½ Σ m v²`.
pub fn kinetic_energy(mass: &[f64], v: &[f64]) -> f64 {
    let momentum: Vec<f64> = mass.iter().zip(v).map(|(m, v)| m * v).collect();
    0.5 * vector::dot(&momentum, v)
}

/// A stable time step and what it follows from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableStep {
    /// `safety · 2/ω`.
    pub time_step: f64,
    /// Upper estimate of the largest angular frequency `ω`.
    pub frequency: f64,
    /// Tangent products used.
    pub iterations: usize,
}

/// The largest stable step of velocity Verlet, `2/ω_max`, times `safety`, at the state `(t, u)`.
///
/// `ω_max²` is the largest eigenvalue of `M⁻¹K` over the free dofs by Lanczos iteration with the actual tangent products. The estimate
/// used is the Ritz value *plus* the norm of its residual, iterated until the residual is below 1 % of it, so that `ω_max` is
/// overestimated, by less than 0.5 %, where plain power iteration underestimates it. `safety` (0.9, say) is left for nonlinear
/// stiffening and damping.
///
/// # Errors
/// [`EigenError`], for one where there is no positive stiffness (then every step is stable).
pub fn stable_step<P: Dynamics + ?Sized>(problem: &mut P, t: f64, u: &[f64], safety: f64) -> Result<StableStep, EigenError> {
    let (frequency, iterations) = largest_frequency(problem, t, u, 1e-2)?;
    Ok(StableStep { time_step: safety * 2.0 / frequency, frequency, iterations })
}

/// Upper estimate of the largest angular frequency at `(t, u)`, and the products used. Motions that run away at a rate above it count as
/// well, so that a step resolves them.
fn largest_frequency<P: Dynamics + ?Sized>(problem: &mut P, t: f64, u: &[f64], tolerance: f64) -> Result<(f64, usize), EigenError> {
    let (mass, fixed) = (problem.mass().to_vec(), problem.fixed().to_vec());
    let product = |x: &[f64], y: &mut [f64]| problem.tangent_product(t, u, x, y);
    let largest = eigen::largest_eigenvalue(product, &mass, &fixed, tolerance)?;
    Ok((largest.upper.max(-largest.lowest).sqrt(), largest.iterations))
}
