//! `solver`: how the problem is advanced.
use super::conditions::Axis;
use super::spectrum::Spectrum;
use crate::deck::decode::{Auto, Context, SetName, choice, section};
use crate::deck::quantity::{Count, Length, Number, Quantity, Time};

choice! {
    /// How the problem is advanced.
    pub enum Solver as "a solver" {
        /// Explicit dynamics.
        VelocityVerlet(VelocityVerlet) = "velocity_verlet",
        /// Equilibrium by Newton's method.
        Statics(Statics) = "statics",
        /// Equilibrium by damped dynamics.
        DynamicRelaxation(DynamicRelaxation) = "dynamic_relaxation",
        /// Natural vibrations about the reference state: the lowest frequencies and their modes.
        Vibration(Vibration) = "vibration",
        /// Linear buckling: the lowest factors of the load at which the reference state becomes unstable, and their modes.
        Buckling(Buckling) = "buckling",
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
    pub struct Statics as "a statics solver" check check_statics {
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
        /// What is raised step by step: the load, or something that goes on growing where the load does not.
        control: StaticControl = "load",
    }
}

choice! {
    /// What is raised step by step.
    pub enum StaticControl as "a control" {
        /// The load, in `load_steps` steps.
        Load = "load",
        /// The arc length of the path of equilibria (Riks), through limit points, until the load reaches `end`.
        ArcLength(ArcLengthControl) = "arc_length",
        /// The load at which the next bond breaks, up and down, until none breaks below `end`: every bond at its threshold. For `linear: true` and
        /// loads in proportion to `t`.
        Breaking = "breaking",
        /// The mean displacement of a set of points; the load follows, `end` tells its order of magnitude.
        Displacement(DisplacementControl) = "displacement",
    }
}

section! {
    /// Arc length. A step of one changes the load by `end`, or displacements by as much as they have changed so far.
    pub struct ArcLengthControl as "arc-length control" {
        /// First step.
        first_step: Quantity<Number> where POSITIVE = "0.02",
        /// Largest step; steps grow and shrink with the difficulty.
        largest_step: Quantity<Number> where POSITIVE = "0.05",
        /// Steps after which the path is given up.
        most_steps: Count where POSITIVE = "2000",
    }
}

section! {
    /// Displacement control.
    pub struct DisplacementControl as "displacement control" {
        /// The points whose mean displacement is raised.
        over: SetName,
        /// Its direction.
        along: Axis,
        /// The displacement at which the run ends.
        end: Quantity<Length>,
        /// Number of steps, if none must be cut.
        steps: Count where POSITIVE = "50",
    }
}

section! {
    /// Natural vibrations.
    pub struct Vibration as "a vibration solver" {
        /// Number of modes.
        modes: Count where POSITIVE = "6",
        /// Largest relative change of an eigenvalue in the last iteration.
        tolerance: Quantity<Number> where POSITIVE = "1e-10",
    }
}

section! {
    /// Linear buckling under the loads and prescribed displacements at load `end`; in a plate that moves across alone, under its `tension`.
    pub struct Buckling as "a buckling solver" {
        /// Number of modes.
        modes: Count where POSITIVE = "3",
        /// The load that is taken as one.
        end: Quantity<Time> where POSITIVE = "1",
        /// Largest relative change of a factor in the last iteration.
        tolerance: Quantity<Number> where POSITIVE = "1e-10",
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

fn check_statics(solver: &Statics, cx: &mut Context) {
    if !matches!(solver.control, StaticControl::Breaking) {
        return;
    }
    if cx.thin {
        cx.fault(solver.span, "`control: breaking` is for solids", "use `control: load` or `displacement`");
    } else if !solver.linear {
        cx.fault(
            solver.span,
            "`control: breaking` finds loads by proportion, which needs `linear: true`",
            "add `linear: true`, or use `control: load`",
        );
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
