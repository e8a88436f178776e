//! Adaptive dynamic relaxation: statics as the end of a damped fictitious motion.
//!
//! Underwood 1983, *Dynamic relaxation*, in Belytschko and Hughes (eds), Computational Methods for Transient Analysis, ch. 5; for
//! peridynamics Kilic and Madenci 2010, Theor. Appl. Fract. Mech. 53, whose central difference form is used with step `h = 1`:
//!
//! ```text
//! v^{n+½} = ((2 − c h) v^{n−½} + 2 h M⁻¹ f^n) / (2 + c h);   u^{n+1} = u^n + h v^{n+½}
//! ```
//!
//! **Mass.** `M = ¼ h² λ D · margin` with `D` the diagonal of the stiffness and `λ` an upper estimate of the largest eigenvalue of `D⁻¹K`
//! (Lanczos with the actual tangent products): the highest frequency is then just below the stability limit `2/h`. Underwood's
//! Gershgorin sum is the same bound, less sharp, for an assembled matrix. Estimated anew when the force law has changed, every
//! [`renew_every`](DynamicRelaxationOptions::renew_every) steps, and when the residual grows as in an instability.
//!
//! **Damping.** `c = 2 ω`, `ω² = ΔuᵀSΔu / ΔuᵀMΔu`, with `Δu` the displacement since the start of the relaxation and the diagonal
//! stiffness felt `S_ii = −Δf_i / (h v_i)`, not less than zero; the lowest frequency that takes part is so damped critically. `c h`
//! is kept below 1.9.

use crate::eigen::{self, EigenError};
use crate::load_steps::{Equilibrated, Equilibrium, EquilibriumError, ROUND_OFF_RESIDUAL, Scale, residual, worst_dof};
use crate::observe::{Cancel, cancelled};
use crate::problem::{Statics, Stop};

/// Options of [`DynamicRelaxation`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DynamicRelaxationOptions {
    /// Residual wanted, relative to [`Statics::force_scale`]. 1e-4.
    pub tolerance: f64,
    /// Most steps for one equilibrium. 100,000.
    pub max_steps: usize,
    /// Factor on the mass beyond the bound, for stiffening on the way. 1.2.
    pub margin: f64,
    /// Steps after which the mass is estimated anew. 1000.
    pub renew_every: usize,
}

impl Default for DynamicRelaxationOptions {
    fn default() -> Self {
        Self { tolerance: 1e-4, max_steps: 100_000, margin: 1.2, renew_every: 1000 }
    }
}

/// Adaptive dynamic relaxation with its work vectors.
#[derive(Clone, Debug, Default)]
pub struct DynamicRelaxation {
    options: DynamicRelaxationOptions,
    mass: Vec<f64>,
    stale: bool,
    f: Vec<f64>,
    before: Vec<f64>,
    v: Vec<f64>,
    start: Vec<f64>,
    blocks: Vec<f64>,
}

impl DynamicRelaxation {
    /// A method with these options.
    pub fn new(options: DynamicRelaxationOptions) -> Self {
        Self { options, stale: true, ..Self::default() }
    }

    /// The fictitious mass at the state `u`.
    fn renew_mass(&mut self, problem: &mut dyn Statics, t: f64, u: &[f64]) -> Result<(), EquilibriumError> {
        let d = problem.dofs_per_point();
        self.blocks.resize(u.len() * d, 0.0);
        problem.block_diagonal(t, u, &mut self.blocks)?;
        let fixed = problem.fixed().to_vec();
        self.mass.resize(u.len(), 0.0);
        let (mut sum, mut count) = (0.0, 0.0);
        for k in 0..u.len() {
            self.mass[k] = self.blocks[(k / d) * d * d + (k % d) * (d + 1)].abs();
            if !fixed[k] {
                sum += self.mass[k];
                count += 1.0;
            }
        }
        let mean = if sum > 0.0 { sum / count } else { 1.0 };
        // Points that all bonds have left still need a mass.
        for mass in &mut self.mass {
            *mass = if mass.is_finite() { mass.max(1e-3 * mean) } else { mean };
        }
        let product = |x: &[f64], y: &mut [f64]| problem.tangent_product(t, u, x, y);
        let largest = match eigen::largest_eigenvalue(product, &self.mass, &fixed, 2e-2) {
            Ok(found) => found.upper,
            // No stiffness here and now: a unit bound keeps the motion slow enough to find some.
            Err(EigenError::NoStiffness { value }) if !value.is_nan() => 1.0,
            Err(EigenError::Evaluation(stop)) => return Err(stop.into()),
            Err(other) => return Err(Stop::new(other.to_string()).into()),
        };
        self.mass.iter_mut().for_each(|m| *m *= 0.25 * largest * self.options.margin);
        self.stale = false;
        Ok(())
    }

    /// Underwood's damping coefficient from the last step.
    fn damping(&self, u: &[f64], fixed: &[bool]) -> f64 {
        let (mut stiffness, mut mass) = (0.0, 0.0);
        for k in 0..u.len() {
            if fixed[k] {
                continue;
            }
            let moved = u[k] - self.start[k];
            let felt = if self.v[k] != 0.0 { (self.before[k] - self.f[k]) / self.v[k] } else { 0.0 };
            if felt > 0.0 && felt.is_finite() {
                stiffness += moved * moved * felt;
            }
            mass += moved * moved * self.mass[k];
        }
        if mass > 0.0 { (2.0 * (stiffness / mass).sqrt()).min(1.9) } else { 0.0 }
    }
}

impl Equilibrium for DynamicRelaxation {
    fn equilibrate(
        &mut self,
        problem: &mut dyn Statics,
        t: f64,
        u: &mut [f64],
        cancel: Cancel<'_>,
    ) -> Result<Equilibrated, EquilibriumError> {
        const NAME: &str = "adaptive dynamic relaxation";
        /// Residual growth over the best one that counts as an instability.
        const GROWTH: f64 = 1e3;
        for work in [&mut self.f, &mut self.before, &mut self.v, &mut self.start] {
            work.clear();
            work.resize(u.len(), 0.0);
        }
        problem.prescribe(t, u);
        self.start.copy_from_slice(u);
        if self.stale || self.mass.len() != u.len() {
            self.renew_mass(problem, t, u)?;
        }
        let fixed = problem.fixed().to_vec();
        let mut scale = Scale::default();
        let mut history = Vec::new();
        let mut best = f64::INFINITY;
        let (mut best_at, mut renewals) = (0, 0);
        let mut best_u: Vec<f64> = Vec::new();
        for iterations in 0.. {
            self.before.copy_from_slice(&self.f);
            let norm = match residual(problem, t, u, &mut self.f) {
                Ok(norm) => norm,
                // Overshoot into a state that does not exist: back to the best one with more mass, a few times.
                Err(stop) if renewals >= 20 || best_u.is_empty() => return Err(stop.into()),
                Err(_) => f64::INFINITY,
            };
            let relative = scale.relative(problem, norm);
            if iterations % 100 == 0 || relative <= self.options.tolerance {
                history.push(relative);
            }
            let done = |at_round_off, history| {
                Ok(Equilibrated { iterations, residual: relative, history, at_round_off, solver: NAME, ..Default::default() })
            };
            if relative <= self.options.tolerance {
                return done(false, history);
            }
            if relative < best {
                if relative < 0.9 * best {
                    best_at = iterations;
                    best_u.clear();
                    best_u.extend_from_slice(u);
                }
                best = relative.min(best);
            }
            if relative <= ROUND_OFF_RESIDUAL && iterations - best_at > 5000 {
                return done(true, history);
            }
            if iterations >= self.options.max_steps || relative.is_nan() {
                let reason = if relative.is_nan() { "the residual is not a number" } else { "too many steps" };
                return Err(EquilibriumError::NotConverged {
                    method: NAME,
                    reason: reason.into(),
                    iterations,
                    residual: relative,
                    history,
                    worst_dof: worst_dof(&self.f, &fixed),
                });
            }
            if cancelled(cancel) {
                return Err(EquilibriumError::Cancelled);
            }
            let unstable = relative > GROWTH * best || !relative.is_finite();
            if unstable {
                renewals += 1;
                u.copy_from_slice(&best_u);
                self.v.fill(0.0);
                self.renew_mass(problem, t, u)?;
                // The tangent at the best state did not show what came: heavier each time.
                let more = 2f64.powi(renewals);
                self.mass.iter_mut().for_each(|m| *m *= more);
                best = f64::INFINITY;
                residual(problem, t, u, &mut self.f)?;
            } else if iterations > 0 && iterations % self.options.renew_every.max(1) == 0 {
                let old = std::mem::take(&mut self.mass);
                self.renew_mass(problem, t, u)?;
                if renewals > 0 {
                    self.mass.iter_mut().zip(&old).for_each(|(m, old)| *m = m.max(*old));
                }
            }
            // The first step, and every step from rest, is a half one: v^{½} = h f / (2 M).
            let at_rest = iterations == 0 || unstable;
            let c = if at_rest { 0.0 } else { self.damping(u, &fixed) };
            for k in 0..u.len() {
                if fixed[k] {
                    continue;
                }
                let kick = self.f[k] / self.mass[k];
                self.v[k] = if at_rest { 0.5 * kick } else { ((2.0 - c) * self.v[k] + 2.0 * kick) / (2.0 + c) };
                u[k] += self.v[k];
            }
        }
        unreachable!("the loop returns")
    }

    fn force_law_changed(&mut self) {
        self.stale = true;
    }
}
