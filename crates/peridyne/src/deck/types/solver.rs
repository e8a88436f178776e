//! `solver`: how the problem is advanced.
use super::spectrum::Spectrum;
use crate::deck::decode::{Auto, Context, choice, section};
use crate::deck::quantity::{Count, Number, Quantity, Time};

choice! {
    /// How the problem is advanced.
    pub enum Solver as "a solver" {
        /// Explicit dynamics.
        VelocityVerlet(VelocityVerlet) = "velocity_verlet",
        /// Equilibrium by Newton's method.
        Statics(Statics) = "statics",
        /// Equilibrium by damped dynamics.
        DynamicRelaxation(DynamicRelaxation) = "dynamic_relaxation",
        /// No motion: which waves and modes cost no energy, and how waves travel.
        Spectrum(Spectrum) = "spectrum",
    }
}

section! {
    /// Explicit dynamics.
    pub struct VelocityVerlet as "a velocity Verlet solver" check check_verlet {
        /// Time at which the run ends; this or `steps`.
        end: Option<Quantity<Time>> where POSITIVE,
        /// Number of steps; this or `end`.
        steps: Option<Count> where POSITIVE,
        /// Time step; `auto` is `safety` times the largest stable one.
        step: Auto<Quantity<Time>> where POSITIVE = "auto",
        /// Fraction of the largest stable step.
        safety: Quantity<Number> where FRACTION = "0.9",
    }
}

section! {
    /// Equilibrium by Newton's method; `t` in expressions is the load, from 0 to `end`.
    pub struct Statics as "a statics solver" {
        /// Load at which the run ends.
        end: Quantity<Time> where POSITIVE = "1",
        /// Number of equal load steps.
        load_steps: Count where POSITIVE = "1",
        /// Linearise about the reference state: one solve, small displacements.
        linear: bool = "false",
        /// How the linear systems are solved.
        method: LinearMethod = "auto",
        /// Largest residual force, relative to the forces in the body.
        tolerance: Quantity<Number> where POSITIVE = "1e-9",
        /// Newton iterations before a load step is halved.
        max_iterations: Count where POSITIVE = "30",
        /// Smallest load step, as a fraction of `end`.
        smallest_step: Quantity<Number> where FRACTION = "1e-4",
    }
}

choice! {
    /// How equilibrium is solved for.
    pub enum LinearMethod as "a method" {
        /// Chosen by size and dimension.
        Auto = "auto",
        /// Sparse factorisation.
        Direct = "direct",
        /// Conjugate gradients, without a matrix.
        ConjugateGradients = "conjugate_gradients",
        /// Nonlinear conjugate gradients on the energy.
        NonlinearConjugateGradients = "nonlinear_conjugate_gradients",
    }
}

section! {
    /// Equilibrium by damped dynamics; `t` in expressions is the load, from 0 to `end`.
    pub struct DynamicRelaxation as "a dynamic relaxation solver" {
        /// Load at which the run ends.
        end: Quantity<Time> where POSITIVE = "1",
        /// Number of equal load steps.
        load_steps: Count where POSITIVE = "1",
        /// Largest residual force, relative to the forces in the body.
        tolerance: Quantity<Number> where POSITIVE = "1e-6",
        /// Steps before a load step is given up.
        max_steps: Count where POSITIVE = "100000",
    }
}

fn check_verlet(solver: &VelocityVerlet, cx: &mut Context) {
    match (&solver.end, &solver.steps) {
        (None, None) => {
            cx.fault(solver.span, "`end` or `steps` is missing in a velocity Verlet solver", "add `end: …` (a time) or `steps: …`")
        }
        (Some(_), Some(steps)) => cx.fault(steps.span, "both `end` and `steps` are given", "keep one; the time step is set by `step`"),
        _ => {}
    }
}
