//! Equilibrium paths past limit points: the load is an unknown, and a further equation says how far along the path the next state lies.
//!
//! **The system.** Unknown are the displacements `u` and the load parameter `t`: `f(t, u) = 0` at free dofs and one linear equation
//! `c·u + c_t t = s`. Newton's method on both is quadratic, also where the tangent `K = −∂f/∂u` is singular but the path is smooth (limit
//! points), because the bordered matrix is regular there. Each iteration takes two solutions with one factor,
//! `K x_f = f` and `K x_q = ∂f/∂t` (the motion of prescribed dofs included), and `δt = (s − c·u − c_t t − c·x_f)/(c_t + c·x_q)`.
//!
//! **Arc length** (Riks 1979, Int. J. Solids Struct. 15; Keller 1977): `c` is the tangent of the path at the last state in the metric
//! `ds² = (dt/T)² + (‖du‖/U)²`, with T the range of loads and U the displacements (root of their mean square) that the first tangent gives
//! for that range, or the largest so far where they are larger, and `s` a step along it: the correction runs in the plane normal to the
//! predictor. Steps grow where few iterations are needed and shrink where many are, or where the path turns.
//!
//! **Displacement control**: `c·u` is a measure that the path must raise steadily, such as the deflection of a point; the load follows.
//!
//! **Stability.** The tangent is factored `L B Lᵀ`; the number of negative eigenvalues of `B` is that of unstable modes, and is reported with each
//! state. Where it changes there is a critical point: a limit point if `dt/ds` changes its sign too, else a bifurcation. Limit loads are
//! found by regula falsi along the step.

use std::ops::ControlFlow;

use crate::direct::{DirectError, SparseCholesky};
use crate::load_steps::{EquilibriumError, worst_dof};
use crate::observe::{Cancel, Ended, Observer, StepReport, cancelled};
use crate::problem::{Statics, Stop};
use crate::sparse::BlockMatrix;
use crate::vector;

/// What is made to grow along the path.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    /// The arc length.
    Arc,
    /// A measure of displacements, `Σ weight u`, from its value at the start to `end`.
    Displacement {
        /// Dofs and weights.
        measure: Vec<(usize, f64)>,
        /// Value at which the path ends `[length]`.
        end: f64,
    },
}

/// Follows an equilibrium path.
#[derive(Clone, Debug, PartialEq)]
pub struct ArcLength {
    /// What grows along the path.
    pub control: Control,
    /// Load parameter of the state given at the start.
    pub start: f64,
    /// Load at which the path ends when it is first reached (arc length); it sets the scale of loads in any case.
    pub end: f64,
    /// First step, as a part of the whole range. With arc length a step of one changes the load by the whole range, or displacements by
    /// as much as they have changed so far.
    pub first_step: f64,
    /// Largest step, as above.
    pub largest_step: f64,
    /// A step that has been halved to less than this is an error.
    pub smallest_step: f64,
    /// Most steps.
    pub most_steps: usize,
    /// Loads (arc length) or values of the measure (displacement control) at which the path is to have a state exactly, at the first
    /// passage; in the order in which they are met.
    pub stations: Vec<f64>,
    /// Residual wanted, relative to [`Statics::force_scale`].
    pub tolerance: f64,
    /// Iterations before a step is halved.
    pub most_iterations: usize,
    /// Threads of the direct solver.
    pub threads: usize,
}

impl Default for ArcLength {
    fn default() -> Self {
        ArcLength {
            control: Control::Arc,
            start: 0.0,
            end: 1.0,
            first_step: 0.02,
            largest_step: 0.05,
            smallest_step: 1e-8,
            most_steps: 2000,
            stations: vec![],
            tolerance: 1e-9,
            most_iterations: 12,
            threads: std::thread::available_parallelism().map_or(1, |n| n.get()),
        }
    }
}

/// A state where the load has an extremum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitPoint {
    /// The load.
    pub load: f64,
    /// The step in which it was passed.
    pub step: usize,
}

/// A state where an eigenvalue of the tangent changes its sign and the load has no extremum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bifurcation {
    /// Loads before and after.
    pub between: [f64; 2],
    /// Unstable modes before and after.
    pub unstable_modes: [usize; 2],
    /// The step in which it was passed.
    pub step: usize,
}

/// A path that was followed.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// How it ended.
    pub ended: Ended,
    /// Load of the last state.
    pub load: f64,
    /// Limit points in the order in which they were passed.
    pub limit_points: Vec<LimitPoint>,
    /// Bifurcations in the order in which they were passed.
    pub bifurcations: Vec<Bifurcation>,
}

/// Why a path could not be followed. The displacement given holds the last state accepted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PathError {
    /// Options that make no sense.
    #[error("{what} is {value}; {remedy}")]
    Options {
        /// The option.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What would be right.
        remedy: &'static str,
    },
    /// The body does not assemble its tangent.
    #[error("this body does not assemble its stiffness, which following a path needs: use load steps")]
    NotAssembled,
    /// No equilibrium, even for the smallest step.
    #[error("no equilibrium beyond load {load} (step {step}): the step along the path was cut to {size:.1e} of the range, and {cause}")]
    Step {
        /// Load of the last state.
        load: f64,
        /// Number of the step that failed.
        step: usize,
        /// The last step tried.
        size: f64,
        /// Why it failed.
        cause: EquilibriumError,
    },
    /// The end was not reached.
    #[error("the path has not come to its end after {steps} steps (load {load}): allow more or larger steps, or another end")]
    Steps {
        /// Steps made.
        steps: usize,
        /// Load of the last state.
        load: f64,
    },
    /// The body stopped the run at an accepted state.
    #[error("load {load}: {stop}")]
    Stopped {
        /// Load of the accepted state.
        load: f64,
        /// Why.
        stop: Stop,
    },
}

/// A linear equation for the state: `c·u + c_t t = s`.
struct Constraint {
    c: Vec<f64>,
    c_t: f64,
    s: f64,
}

/// A tangent of the path with unit length in the metric of the path.
#[derive(Clone, Default)]
struct Tangent {
    u: Vec<f64>,
    t: f64,
}

/// The linear system and room for it.
struct System<'a> {
    options: &'a ArcLength,
    factor: Option<SparseCholesky>,
    matrix: Option<BlockMatrix>,
    f: Vec<f64>,
    other: Vec<f64>,
    q: Vec<f64>,
    moved: Vec<f64>,
    product: Vec<f64>,
    from_force: Vec<f64>,
    from_load: Vec<f64>,
    diagonal: Vec<f64>,
    /// Metric: `ds² = a_t dt² + a_u du·du`.
    metric: [f64; 2],
    /// U of the metric, and the size of the body, which it does not exceed.
    displacement: f64,
    size: f64,
    unstable: usize,
    load_norm: f64,
}

impl ArcLength {
    fn check(&self) -> Result<(), PathError> {
        let positive = "give a positive number";
        for (what, value) in [
            ("the first step", self.first_step),
            ("the largest step", self.largest_step),
            ("the smallest step", self.smallest_step),
            ("the tolerance", self.tolerance),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(PathError::Options { what, value, remedy: positive });
            }
        }
        if !(self.end - self.start).is_finite() || self.end == self.start {
            return Err(PathError::Options {
                what: "the load at the end",
                value: self.end,
                remedy: "let it differ from that at the start",
            });
        }
        if let Control::Displacement { measure, end } = &self.control
            && (measure.iter().all(|m| m.1 == 0.0) || !end.is_finite())
        {
            return Err(PathError::Options {
                what: "the end of the controlled displacement",
                value: *end,
                remedy: "give a finite displacement of some points",
            });
        }
        Ok(())
    }

    /// Follows the path from the equilibrium `u` at [`start`](Self::start). Every accepted state is shown to the observer, with its load as
    /// the time of the report.
    ///
    /// A step that fails is rolled back and halved. Bonds that fail at an equilibrium are broken and the equilibrium is found again under
    /// the same equation, so the load falls where it must.
    ///
    /// # Errors
    /// [`PathError`]; `u` then holds the last accepted state.
    pub fn run<P: Statics + ?Sized>(
        &self,
        problem: &mut P,
        u: &mut [f64],
        observer: &mut dyn Observer<P>,
        cancel: Cancel<'_>,
    ) -> Result<Path, PathError> {
        self.check()?;
        let n = u.len();
        let mut system = System::new(self, &mut &mut *problem, n);
        let mut path = Path { ended: Ended::Completed, load: self.start, limit_points: vec![], bifurcations: vec![] };
        let (mut t, mut step, mut cuts) = (self.start, 0, 0);
        let measured = |u: &[f64]| match &self.control {
            Control::Arc => 0.0,
            Control::Displacement { measure, .. } => measure.iter().map(|(k, w)| w * u[*k]).sum(),
        };
        let (from, to) = match self.control {
            Control::Arc => (self.start, self.end),
            Control::Displacement { end, .. } => (measured(u), end),
        };
        let sense = (to - from).signum();
        let mut stations: Vec<f64> = self.stations.iter().copied().filter(|s| (s - from) * sense > 0.0 && (to - s) * sense > 0.0).collect();
        stations.push(to);
        stations.reverse();
        let failed = |load, step, size, cause| PathError::Step { load, step, size, cause };
        problem.prescribe(t, u);
        system.factor(&mut &mut *problem, t, u).map_err(|e| failed(t, 0, 0.0, e))?;
        let mut tangent = system.tangent(&mut &mut *problem, t, u).map_err(|e| failed(t, 0, 0.0, e))?;
        let ahead = match &self.control {
            Control::Arc => tangent.t * sense,
            Control::Displacement { .. } => measured(&tangent.u) * sense,
        };
        if ahead < 0.0 {
            tangent.flip();
        }
        let first = u.to_vec();
        system.scale(rms(&tangent.u, None) / tangent.t.abs() * (self.end - self.start).abs(), &mut tangent);
        let mut unstable = system.unstable;
        let mut size = self.first_step.min(self.largest_step);
        let mut trial = u.to_vec();
        loop {
            if step >= self.most_steps {
                return Err(PathError::Steps { steps: step, load: t });
            }
            if cancelled(cancel) {
                path.ended = Ended::Cancelled;
                return Ok(path);
            }
            problem.checkpoint();
            // the predictor, and what the state must satisfy
            let station = *stations.last().unwrap_or(&to);
            let (constraint, mut landed, length) = match &self.control {
                Control::Arc => (system.normal_plane(&tangent, u, t, size), false, size),
                Control::Displacement { measure, .. } => {
                    let here = measured(u);
                    let reaches = here + sense * size * (to - from).abs() * (1.0 + 1e-9);
                    let lands = (reaches - station) * sense >= 0.0;
                    let s = if lands { station } else { here + sense * size * (to - from).abs() };
                    let mut c = vec![0.0; n];
                    measure.iter().for_each(|(k, w)| c[*k] += w);
                    let rate = measured(&tangent.u);
                    // where the measure hardly changes along the path a predictor would run away
                    let length = if rate.abs() > 1e-3 * vector::largest(&tangent.u) { (s - here) / rate } else { 0.0 };
                    (Constraint { c, c_t: 0.0, s }, lands, length)
                }
            };
            vector::combine(&mut trial, u, length, &tangent.u);
            let mut next_t = t + length * tangent.t;
            let mut outcome = system.step(&mut &mut *problem, &constraint, &mut trial, &mut next_t);
            let mut next = Tangent::default();
            if outcome.is_ok() {
                // past a station of the load: land on it
                let passes = self.control == Control::Arc && (next_t - station) * sense >= 0.0 && (t - station) * sense < 0.0;
                if passes {
                    let share = (station - t) / (next_t - t);
                    trial.iter_mut().zip(&*u).for_each(|(x, u)| *x = u + share * (*x - u));
                    next_t = station;
                    problem.rollback();
                    let load = Constraint { c: vec![0.0; n], c_t: 1.0, s: station };
                    outcome = system.step(&mut &mut *problem, &load, &mut trial, &mut next_t);
                    landed = true;
                }
            }
            let mut turned = false;
            if let Ok(report) = &outcome {
                match system.tangent(&mut &mut *problem, next_t, &trial) {
                    Ok(found) => {
                        next = found;
                        let onward = match self.control {
                            Control::Arc => system.product(&next, &tangent),
                            Control::Displacement { .. } => measured(&next.u) * sense,
                        };
                        if onward < 0.0 {
                            next.flip();
                        }
                        // a path that turns sharply, or a state farther off than the step is long, may be of another path; very short steps
                        // are believed, and after breaking it is another
                        turned = self.control == Control::Arc
                            && report.broken == 0
                            && (onward.abs() < 0.7 || system.distance(u, t, &trial, next_t) > 1.3 * size)
                            && size > 16.0 * self.smallest_step;
                    }
                    Err(e) => outcome = Err(e),
                }
            }
            let mut report = match outcome {
                Ok(report) if !turned => report,
                other => {
                    problem.rollback();
                    cuts += 1;
                    if size * 0.5 < self.smallest_step {
                        let cause = other.err().unwrap_or_else(|| Stop::new("the path turns too sharply").into());
                        return Err(failed(t, step + 1, size, cause));
                    }
                    size *= 0.5;
                    continue;
                }
            };
            step += 1;
            let now_unstable = system.unstable;
            if report.broken == 0 {
                if next.t * tangent.t < 0.0 && self.control == Control::Arc && !landed {
                    let load = system.limit_load(&mut &mut *problem, (u, t, &tangent), (next_t, &next), size);
                    path.limit_points.push(LimitPoint { load, step });
                } else if next.t * tangent.t < 0.0 {
                    // between two states: the parabola through both with the slopes of the load at them
                    path.limit_points
                        .push(LimitPoint { load: parabola(t, next_t, tangent.t, next.t, system.distance(u, t, &trial, next_t)), step });
                } else if now_unstable != unstable {
                    path.bifurcations.push(Bifurcation { between: [t, next_t], unstable_modes: [unstable, now_unstable], step });
                }
            }
            unstable = now_unstable;
            let increment = next_t - t;
            (report.step, report.time, report.increment, report.cuts, report.station) = (step, next_t, increment, cuts, landed);
            report.unstable_modes = Some(now_unstable);
            let iterations = report.iterations;
            (t, cuts, tangent) = (next_t, 0, next);
            u.copy_from_slice(&trial);
            path.load = t;
            system.scale(rms(u, Some(&first)), &mut tangent);
            problem.accept(t, u).map_err(|stop| PathError::Stopped { load: t, stop })?;
            if observer.step(&report, problem, u, &[]) == ControlFlow::Break(()) {
                path.ended = Ended::Observer;
                return Ok(path);
            }
            if landed {
                stations.pop();
                if stations.is_empty() {
                    return Ok(path);
                }
            }
            let growth = (5.0 / iterations.max(1) as f64).sqrt().clamp(0.5, 2.0);
            size = (size * growth).min(self.largest_step);
        }
    }
}

/// Root of the mean square of a vector, or of its difference from another.
fn rms(u: &[f64], from: Option<&[f64]>) -> f64 {
    let square: f64 = match from {
        Some(from) => u.iter().zip(from).map(|(a, b)| (a - b) * (a - b)).sum(),
        None => vector::dot(u, u),
    };
    (square / u.len().max(1) as f64).sqrt()
}

/// Extremum of a load between two states `distance` apart, from its values and slopes there (the zero of the linear slope).
fn parabola(from: f64, to: f64, slope: f64, end_slope: f64, distance: f64) -> f64 {
    let share = slope / (slope - end_slope);
    let predicted = from + 0.5 * share * distance * slope;
    let back = to - 0.5 * (1.0 - share) * distance * end_slope;
    // both ends tell; the nearer one more
    (1.0 - share) * predicted + share * back
}

impl Tangent {
    fn flip(&mut self) {
        self.u.iter_mut().for_each(|x| *x = -*x);
        self.t = -self.t;
    }
}

impl<'a> System<'a> {
    fn new(options: &'a ArcLength, problem: &mut dyn Statics, n: usize) -> Self {
        let points = (n / problem.dofs_per_point()).max(1);
        let x = problem.positions();
        let d = x.len() / points;
        let extent = |k: usize| {
            let (low, high) = (0..points).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(x[p * d + k]), b.max(x[p * d + k])));
            high - low
        };
        let size = (0..d).map(extent).fold(0.0, f64::hypot);
        let size = if size > 0.0 { size } else { 1.0 };
        let zeros = || vec![0.0; n];
        System {
            options,
            factor: None,
            matrix: None,
            f: zeros(),
            other: zeros(),
            q: zeros(),
            moved: zeros(),
            product: zeros(),
            from_force: zeros(),
            from_load: zeros(),
            diagonal: zeros(),
            metric: [(options.end - options.start).powi(-2), 1.0 / (n.max(1) as f64 * size * size)],
            displacement: 0.0,
            size,
            unstable: 0,
            load_norm: 0.0,
        }
    }

    /// Displacements as large as this have been met: the metric follows, and the tangent is of unit length in it again.
    fn scale(&mut self, displacement: f64, tangent: &mut Tangent) {
        let displacement = displacement.min(self.size);
        if displacement > self.displacement {
            self.displacement = displacement;
            self.metric[1] = 1.0 / (tangent.u.len() as f64 * displacement * displacement);
        }
        let length = self.product(tangent, tangent).sqrt();
        tangent.u.iter_mut().for_each(|x| *x /= length);
        tangent.t /= length;
    }

    /// Scalar product of two tangents in the metric.
    fn product(&self, a: &Tangent, b: &Tangent) -> f64 {
        self.metric[0] * a.t * b.t + self.metric[1] * vector::dot(&a.u, &b.u)
    }

    /// Distance of two states.
    fn distance(&self, u: &[f64], t: f64, v: &[f64], s: f64) -> f64 {
        let square: f64 = u.iter().zip(v).map(|(a, b)| (a - b) * (a - b)).sum();
        (self.metric[0] * (t - s) * (t - s) + self.metric[1] * square).sqrt()
    }

    /// The plane normal to a tangent, a step ahead.
    fn normal_plane(&self, tangent: &Tangent, u: &[f64], t: f64, size: f64) -> Constraint {
        let c: Vec<f64> = tangent.u.iter().map(|x| self.metric[1] * x).collect();
        let c_t = self.metric[0] * tangent.t;
        let s = vector::dot(&c, u) + c_t * t + size;
        Constraint { c, c_t, s }
    }

    /// Assembles and factors the tangent.
    fn factor(&mut self, problem: &mut dyn Statics, t: f64, u: &[f64]) -> Result<(), EquilibriumError> {
        let Some(pattern) = problem.pattern() else {
            return Err(Stop::new(PathError::NotAssembled.to_string()).into());
        };
        if !self.factor.as_ref().is_some_and(|c| c.serves(&pattern, problem.fixed())) {
            self.factor = Some(SparseCholesky::analyze(pattern.clone(), problem.positions(), problem.fixed(), self.options.threads)?);
        }
        if self.matrix.as_ref().is_none_or(|m| !std::sync::Arc::ptr_eq(m.pattern(), &pattern)) {
            self.matrix = Some(BlockMatrix::new(pattern));
        }
        let (Some(factor), Some(matrix)) = (self.factor.as_mut(), self.matrix.as_mut()) else { unreachable!("both were just made") };
        matrix.clear();
        problem.tangent(t, u, matrix)?;
        matrix.diagonal(&mut self.diagonal);
        vector::clear_fixed(&mut self.diagonal, problem.fixed());
        let mean = self.diagonal.iter().map(|d| d.abs()).sum::<f64>() / factor.free_dofs().max(1) as f64;
        // points that all bonds have left stay where they are
        for (k, fixed) in problem.fixed().iter().enumerate() {
            if !fixed && self.diagonal[k].abs() <= f64::EPSILON * mean {
                matrix.add_diagonal_entry(k, mean);
            }
        }
        self.unstable = match factor.factor_indefinite(matrix, None) {
            Err(DirectError::Singular { .. }) => {
                // exactly critical: a shift far below what iterations notice
                self.diagonal.iter_mut().for_each(|d| *d = 1e-12 * mean);
                factor.factor_indefinite(matrix, Some(&self.diagonal))?
            }
            other => other?,
        };
        Ok(())
    }

    /// `∂f/∂t` at free dofs, with what the motion of prescribed dofs adds to it, and that motion.
    fn load(&mut self, problem: &mut dyn Statics, t: f64, u: &[f64]) -> Result<(), EquilibriumError> {
        let (low, high) = (self.options.start.min(self.options.end), self.options.start.max(self.options.end));
        let h = 1e-4 * (high - low);
        let (a, b) = ((t - h).max(low.min(t)), (t + h).min(high.max(t)));
        problem.force(b, u, &mut self.q)?;
        problem.force(a, u, &mut self.other)?;
        vector::add_scaled(&mut self.q, -1.0, &self.other);
        let width = b - a;
        self.q.iter_mut().for_each(|q| *q /= width);
        self.moved.copy_from_slice(u);
        problem.prescribe(b, &mut self.moved);
        self.other.copy_from_slice(&self.moved);
        problem.prescribe(a, &mut self.other);
        let mut moves = false;
        for k in 0..u.len() {
            self.moved[k] = if problem.fixed()[k] { (self.moved[k] - self.other[k]) / width } else { 0.0 };
            moves |= self.moved[k] != 0.0;
        }
        if moves {
            problem.tangent_product(t, u, &self.moved, &mut self.product)?;
            vector::add_scaled(&mut self.q, -1.0, &self.product);
        }
        // back to where the problem was
        self.other.copy_from_slice(u);
        problem.prescribe(t, &mut self.other);
        vector::clear_fixed(&mut self.q, problem.fixed());
        self.load_norm = vector::norm(&self.q);
        Ok(())
    }

    /// The unit tangent of the path at an equilibrium whose tangent was factored.
    fn tangent(&mut self, problem: &mut dyn Statics, t: f64, u: &[f64]) -> Result<Tangent, EquilibriumError> {
        self.load(problem, t, u)?;
        let factor = self.factor.as_mut().ok_or_else(|| Stop::new("there is no factor"))?;
        factor.solve(&self.q, &mut self.from_load)?;
        vector::add_scaled(&mut self.from_load, 1.0, &self.moved);
        let mut tangent = Tangent { u: self.from_load.clone(), t: 1.0 };
        let length = self.product(&tangent, &tangent).sqrt();
        tangent.u.iter_mut().for_each(|x| *x /= length);
        tangent.t /= length;
        Ok(tangent)
    }

    /// An equilibrium under a constraint, bonds that fail broken; afterwards the tangent at it is factored.
    fn step(
        &mut self,
        problem: &mut dyn Statics,
        constraint: &Constraint,
        u: &mut [f64],
        t: &mut f64,
    ) -> Result<StepReport, EquilibriumError> {
        const MOST_BREAKINGS: usize = 10_000;
        let mut report = StepReport { solver: "path, L B Lᵀ", ..Default::default() };
        loop {
            let (iterations, residual) = self.equilibrium(problem, constraint, u, t)?;
            report.iterations += iterations;
            report.residual = residual;
            report.equilibria += 1;
            let broken = problem.break_bonds(*t, u)?;
            report.broken += broken;
            if broken == 0 {
                break;
            }
            if report.equilibria > MOST_BREAKINGS {
                return Err(Stop::new("bonds break without end at one state: the crack grows unstably; use dynamics").into());
            }
        }
        report.iterations = report.iterations.div_ceil(report.equilibria);
        self.factor(problem, *t, u)?;
        Ok(report)
    }

    fn equilibrium(
        &mut self,
        problem: &mut dyn Statics,
        constraint: &Constraint,
        u: &mut [f64],
        t: &mut f64,
    ) -> Result<(usize, f64), EquilibriumError> {
        let mut history: Vec<f64> = vec![];
        loop {
            problem.prescribe(*t, u);
            problem.force(*t, u, &mut self.f)?;
            vector::clear_fixed(&mut self.f, problem.fixed());
            let norm = vector::norm(&self.f);
            let scale = problem.force_scale().max(1e-6 * self.load_norm * (self.options.end - self.options.start).abs());
            let relative = if norm == 0.0 { 0.0 } else { norm / scale };
            let miss = constraint.s - vector::dot(&constraint.c, u) - constraint.c_t * *t;
            history.push(relative);
            let iterations = history.len() - 1;
            let failed = |reason: &str, f: &[f64], fixed: &[bool], history: &[f64]| EquilibriumError::NotConverged {
                method: "Newton's method along the path",
                reason: reason.into(),
                iterations,
                residual: relative,
                history: history.to_vec(),
                worst_dof: worst_dof(f, fixed),
            };
            if !relative.is_finite() {
                return Err(failed("the residual is not a number", &self.f, problem.fixed(), &history));
            }
            // the equation of the step is linear: after one iteration it holds
            if iterations > 0 && relative <= self.options.tolerance {
                return Ok((iterations, relative));
            }
            if relative <= crate::load_steps::ROUND_OFF_RESIDUAL
                && let [.., a, b, c] = history[..]
                && c > 0.5 * b
                && b > 0.5 * a
            {
                return Ok((iterations, relative));
            }
            if iterations >= self.options.most_iterations {
                return Err(failed("too many iterations", &self.f, problem.fixed(), &history));
            }
            // `load` evaluates the force at other loads
            let f = std::mem::take(&mut self.f);
            self.factor(problem, *t, u)?;
            self.load(problem, *t, u)?;
            self.f = f;
            let Some(factor) = self.factor.as_mut() else { unreachable!("it was just made") };
            factor.solve(&self.f, &mut self.from_force)?;
            factor.solve(&self.q, &mut self.from_load)?;
            vector::add_scaled(&mut self.from_load, 1.0, &self.moved);
            let slope = constraint.c_t + vector::dot(&constraint.c, &self.from_load);
            let change = (miss - vector::dot(&constraint.c, &self.from_force)) / slope;
            if !change.is_finite() {
                return Err(failed("the load cannot satisfy the step", &self.f, problem.fixed(), &history));
            }
            vector::add_scaled(u, 1.0, &self.from_force);
            vector::add_scaled(u, change, &self.from_load);
            *t += change;
        }
    }

    /// The extremum of the load within a step, by regula falsi (Illinois) on `dt/ds`. What the linear slope tells serves where that fails.
    fn limit_load(
        &mut self,
        problem: &mut dyn Statics,
        (u, t, tangent): (&[f64], f64, &Tangent),
        (next_t, next): (f64, &Tangent),
        size: f64,
    ) -> f64 {
        let unstable = self.unstable;
        let (mut a, mut b) = ((0.0, tangent.t), (size, next.t));
        let mut best = parabola(t, next_t, tangent.t, next.t, size);
        let mut side = 0;
        for _ in 0..8 {
            let s = (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1);
            let constraint = self.normal_plane(tangent, u, t, s);
            let mut trial = u.to_vec();
            vector::add_scaled(&mut trial, s, &tangent.u);
            let mut at = t + s * tangent.t;
            let found = self.equilibrium(problem, &constraint, &mut trial, &mut at).and_then(|_| {
                self.factor(problem, at, &trial)?;
                self.tangent(problem, at, &trial)
            });
            let Ok(mut found) = found else { break };
            if self.product(&found, tangent) < 0.0 {
                found.flip();
            }
            best = at;
            let here = (s, found.t);
            if found.t * a.1 > 0.0 {
                a = here;
                if side == 1 {
                    b.1 *= 0.5;
                }
                side = 1;
            } else {
                b = here;
                if side == -1 {
                    a.1 *= 0.5;
                }
                side = -1;
            }
            // the load is flat there: its error is of the second order in this
            if (found.t / tangent.t).abs().min((found.t / next.t).abs()) < 1e-4 || found.t == 0.0 {
                break;
            }
        }
        self.unstable = unstable;
        best
    }
}
