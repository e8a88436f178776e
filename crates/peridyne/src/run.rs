//! A run: the deck's solver over the assembled body, with what is observed on the way and written at the end.

use crate::deck::{self, Auto, Deck, DeckErrors, FieldComponent, Moment, Solver};
use crate::field_units::{unit_in, unit_of, unit_of_column};
use crate::modes;
use crate::output::background::{BackgroundFile, Frame};
use crate::output::picture::{self, Deformation, Options, Range, Shown, View};
use crate::output::plot::{Axis, Curve, Legend, Plot, Style};
use crate::output::summary::{Constant, Exit, Sizes, Summary, Timing, Verdict};
use crate::output::table::{History, write_final};
use crate::output::{Field, FieldValues, OutputError, Snapshot, color::ColorMap};
use crate::problem::{Problem, axis_name};
use crate::registry::{Assembly, assemble, initial_state};
use crate::spectrum;
use crate::verify::{Measurement, Pending};
use bodies::measures::FieldName;
use bodies::neighbors::Families;
use bodies::structure::Simulated;
use solvers::arc_length::{ArcLength, Control, Path as Followed, PathError};
use solvers::dynamic_relaxation::{DynamicRelaxation, DynamicRelaxationOptions};
use solvers::load_steps::{Equilibrium, LoadSteps, StaticsError};
use solvers::newton::{LinearSolver, Newton, NewtonOptions};
use solvers::nonlinear_cg::{NonlinearCg, NonlinearCgOptions};
use solvers::observe::{Ended, Observer, StepReport};
use solvers::problem::{Dynamics, Statics};
use solvers::sequential::SequentiallyLinear;
use solvers::velocity_verlet::{Following, Motion, VelocityVerlet, stable_step};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, atomic::AtomicBool};
use std::time::Instant;

mod advance;
use advance::{follow, motion, path_options, statics};

/// Why there is no result at all.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The deck is at fault.
    #[error("{0}")]
    Deck(DeckErrors),
    /// A result could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Relative error of linear solutions beyond which the user should know.
const LOST_DIGITS: f64 = 1e-6;

/// Hears how far a run is.
pub trait Progress {
    /// `share` of the run is done (0 to 1); `text` says where it is.
    fn at(&mut self, share: f64, text: &str);
}

/// Nobody listens.
pub struct Quiet;
impl Progress for Quiet {
    fn at(&mut self, _: f64, _: &str) {}
}

/// A component of a field that is kept, at a time or at the end.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// The component.
    pub field: FieldComponent,
    /// When; `None` at the end.
    pub time: Option<f64>,
}

/// A component of a field as it was.
#[derive(Debug, Clone)]
pub struct Kept {
    /// Its name, such as `displacement.x`.
    pub field: String,
    /// The time asked for; `None` at the end.
    pub time: Option<f64>,
    /// One value a point.
    pub values: Vec<f64>,
    /// The displacements at that time.
    pub displacement: Vec<[f64; 3]>,
}

/// What is kept of a run in memory: points in the user's order, the fields that were wanted, the histories.
#[derive(Debug, Clone, Default)]
pub struct Observed {
    /// Dimension of space.
    pub dimension: usize,
    /// Reference positions.
    pub reference: Arc<[[f64; 3]]>,
    /// Edge of the cell of each point.
    pub edge: Vec<f64>,
    /// The fields that were wanted.
    pub fields: Vec<Kept>,
    /// Names of the histories.
    pub columns: Vec<String>,
    /// Rows of the histories.
    pub rows: Vec<Vec<f64>>,
}

impl Observed {
    /// The field `name` at a time, or at the end; `None` if it was not kept.
    pub fn field(&self, name: &str, time: Option<f64>) -> Option<&Kept> {
        self.fields.iter().find(|kept| kept.field == name && kept.time == time)
    }

    /// A column of the histories.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let k = self.columns.iter().position(|column| column == name)?;
        Some(self.rows.iter().map(|row| row[k]).collect())
    }
}

/// What a run ended with.
pub struct Outcome {
    /// As written to `summary.json`.
    pub summary: Summary,
    /// What was expected, measured.
    pub measurements: Vec<Measurement>,
    /// What a study measures without expecting it: names and values, NaN where it could not be measured.
    pub measures: Vec<(String, f64)>,
    /// What is kept of the run.
    pub observed: Observed,
    /// Whether the run reached its end.
    pub completed: bool,
    /// What the solver `spectrum` found.
    pub spectrum: Option<spectrum::Report>,
}

/// Where results go.
pub enum Target<'a> {
    /// Into a folder.
    Folder(&'a Path),
    /// Nowhere: only measurements are wanted.
    Nowhere,
}

/// Runs a deck.
///
/// # Errors
/// [`RunError`] where the deck is at fault or nothing can be written; a run that goes wrong on the way is an [`Outcome`].
pub fn run(deck: Deck, target: &Target, progress: &mut dyn Progress, cancel: &AtomicBool) -> Result<Outcome, RunError> {
    run_keeping(deck, target, &[], progress, cancel)
}

/// Runs a deck and keeps some fields in memory.
///
/// # Errors
/// Those of [`run`].
pub fn run_keeping(
    deck: Deck,
    target: &Target,
    wanted: &[Wanted],
    progress: &mut dyn Progress,
    cancel: &AtomicBool,
) -> Result<Outcome, RunError> {
    let clock = Instant::now();
    let mut problem = Problem::new(deck).map_err(RunError::Deck)?;
    let assembly = assemble(&problem).map_err(RunError::Deck)?;
    if !matches!(problem.deck.solver, Solver::Spectrum(_)) {
        // the chunks of the body have their own lists
        problem.families = Families::default();
    }
    let problem = problem;
    let setup = clock.elapsed().as_secs_f64();
    let Assembly { mut model, derived, warnings } = assembly;
    let mut recorder = Recorder::new(&problem, &*model, target, wanted)?;
    let (mut u, mut v) = initial_state(&problem, Statics::dofs(&*model));
    model.enter(&mut u);
    model.enter(&mut v);
    if matches!(problem.deck.solver, Solver::VelocityVerlet(_)) {
        // what is prescribed moves from the first instant on: that is part of the initial state, not work
        model.prescribe_displacement(0.0, &mut u);
        model.prescribe_velocity(0.0, &mut v);
    }
    let mut constants: Vec<Constant> = derived.into_iter().map(|(name, value, unit)| Constant { name, value, unit: unit.into() }).collect();
    // the balance of energy counts from the state before the first step
    let start = model.balance(0.0, &u, &v);
    recorder.initial_energy = Some(start.kinetic + start.strain + start.contact);
    let solving = Instant::now();
    let mut solver_time = 0.0;
    let mut lost_digits = 0.0;
    let mut found = None;
    let (exit, steps) = match &problem.deck.solver {
        Solver::VelocityVerlet(options) => {
            model.set_statics(false);
            let ended = motion(&problem, options, &mut *model, &mut u, &mut v, &mut recorder, progress, cancel)?;
            solver_time += ended.estimating;
            constants.push(Constant { name: "time step".into(), value: ended.step, unit: "time".into() });
            (ended.exit, ended.steps)
        }
        Solver::Statics(options) => {
            model.set_statics(true);
            let threads = rayon::current_num_threads();
            let newton = NewtonOptions {
                tolerance: options.tolerance.value,
                max_iterations: options.max_iterations.value as usize,
                linear: options.linear,
                threads,
                solver: match options.method {
                    deck::LinearMethod::Direct => LinearSolver::Direct,
                    deck::LinearMethod::ConjugateGradients => LinearSolver::ConjugateGradients,
                    // points of a surface have no more neighbours than those of a plane
                    _ if problem.thin => LinearSolver::Automatic,
                    // in 3D the factor grows too fast: matrix-free unless asked for
                    _ if problem.section.dimension() == 3 => LinearSolver::ConjugateGradients,
                    _ => LinearSolver::Automatic,
                },
                ..NewtonOptions::default()
            };
            let mut newton = Newton::new(newton);
            let mut nonlinear =
                NonlinearCg::new(NonlinearCgOptions { tolerance: options.tolerance.value, ..NonlinearCgOptions::default() });
            let method: &mut dyn Equilibrium = match options.method {
                deck::LinearMethod::NonlinearConjugateGradients => &mut nonlinear,
                _ => &mut newton,
            };
            let mut program = LoadSteps::uniform(0.0, options.end.value, options.load_steps.value as usize);
            program.smallest_fraction = options.smallest_step.value;
            recorder.span = (0.0, options.end.value);
            if matches!(options.control, deck::StaticControl::Load) {
                let end = statics(&mut *model, program.start, &mut u, &mut recorder, progress, |model, u, observer| {
                    program.run(model, method, u, observer, Some(cancel))
                });
                lost_digits = newton.linear_error();
                end
            } else if matches!(options.control, deck::StaticControl::Breaking) {
                let path = SequentiallyLinear::new(options.end.value);
                statics(&mut *model, 0.0, &mut u, &mut recorder, progress, |model, u, observer| {
                    path.run(model, method, u, observer, Some(cancel))
                })
            } else {
                let arc = path_options(&problem, options, &*model, threads);
                follow(&mut *model, &arc, &mut u, &mut recorder, progress, cancel)
            }
        }
        Solver::DynamicRelaxation(options) => {
            model.set_statics(true);
            let mut method = DynamicRelaxation::new(DynamicRelaxationOptions {
                tolerance: options.tolerance.value,
                max_steps: options.max_steps.value as usize,
                ..DynamicRelaxationOptions::default()
            });
            let program = LoadSteps::uniform(0.0, options.end.value, options.load_steps.value as usize);
            recorder.span = (0.0, options.end.value);
            statics(&mut *model, program.start, &mut u, &mut recorder, progress, |model, u, observer| {
                program.run(model, &mut method, u, observer, Some(cancel))
            })
        }
        Solver::Vibration(_) | Solver::Buckling(_) => match modes::solve(&problem, &mut *model, &u) {
            Ok(modes) => {
                let n = u.len();
                recorder.found = modes.quantities();
                recorder.warnings.extend(modes.warnings.iter().cloned());
                if let Target::Folder(folder) = target {
                    let mut table = History::create(&folder.join("modes.csv"), &modes.columns())?;
                    modes.rows().iter().try_for_each(|row| table.append(row))?;
                    recorder.shapes(&mut *model, &modes.shapes, n)?;
                }
                recorder.drawn = true;
                recorder.last = (1.0, 1);
                u.copy_from_slice(&modes.shapes[..n]);
                (Exit::Completed { time: 1.0 }, modes.values.len())
            }
            Err(reason) => (Exit::Stopped { reason, time: 0.0 }, 0),
        },
        Solver::Spectrum(options) => {
            let report = spectrum::analyse(&problem, &mut *model, &options.into()).map_err(RunError::Deck)?;
            if let Target::Folder(folder) = target {
                report.write(&problem, folder)?;
            }
            recorder.found = report.quantities();
            recorder.warnings.extend(report.notes.iter().cloned());
            found = Some(report);
            (Exit::Completed { time: 0.0 }, 0)
        }
    };
    solver_time = solving.elapsed().as_secs_f64().max(solver_time) - recorder.seconds;
    let iterations = recorder.iterations;
    let mut result = recorder.finish(&mut *model, &u, &exit)?;
    let (bonds, chunks, bytes) = model.sizes();
    let (forces, tangents) = model.evaluations();
    let memory = bytes.0 + bytes.1 + bytes.2;
    let output = result.seconds;
    constants.push(Constant { name: "steps".into(), value: steps as f64, unit: String::new() });
    constants.push(Constant { name: "force evaluations".into(), value: forces as f64, unit: String::new() });
    constants.push(Constant { name: "tangent products".into(), value: tangents as f64, unit: String::new() });
    for (name, count) in [("iterations", iterations.0), ("linear iterations", iterations.1)] {
        if count > 0 {
            constants.push(Constant { name: name.into(), value: count as f64, unit: String::new() });
        }
    }
    let (damage, broken) = model.damage();
    if broken.bonds > 0 {
        constants.push(Constant { name: "bonds broken".into(), value: broken.bonds as f64 / 2.0, unit: String::new() });
        constants.push(Constant { name: "points released".into(), value: broken.released as f64, unit: String::new() });
        constants.push(Constant { name: "largest damage".into(), value: damage, unit: String::new() });
    }
    if let Some(ratio) = model.closest_approach() {
        constants.push(Constant { name: "smallest |Y|/|ξ|".into(), value: ratio, unit: String::new() });
    }
    let mut all_warnings = warnings;
    all_warnings.append(&mut result.warnings);
    if lost_digits > LOST_DIGITS {
        all_warnings.push(format!(
            "the stiffness is so ill-conditioned that linear solutions have a relative error of at least {lost_digits:.0e}; the condition number of beams and plates grows with the fourth power of the number of points: use fewer"
        ));
    }
    if model.held_points() > 0 {
        all_warnings.push(format!("{} points of fragments that nothing holds were kept where they are", model.held_points()));
    }
    let summary = Summary {
        version: env!("CARGO_PKG_VERSION").into(),
        deck: serde_json::to_string(&problem.deck.resolved()).unwrap_or_default(),
        sizes: Sizes {
            points: problem.cloud.len() as u64,
            directed_bonds: bonds as u64,
            chunks: chunks as u64,
            bytes_per_bond: memory as f64 / bonds.max(1) as f64,
            memory_bytes: memory as u64,
        },
        constants,
        timings: Timing::list([("set-up", setup), ("solver", solver_time.max(0.0)), ("output", output)]),
        bonds_per_second: (forces + tangents) as f64 * bonds as f64 / solver_time.max(1e-9),
        verdicts: result
            .measurements
            .iter()
            .map(|m| Verdict {
                quantity: m.quantity.clone(),
                computed: m.computed,
                reference: m.reference,
                tolerance: m.tolerance,
                passed: m.passed,
            })
            .collect(),
        warnings: all_warnings,
        exit: exit.clone(),
    };
    if let Target::Folder(folder) = target {
        summary.write(&folder.join("summary.json"))?;
    }
    let completed = matches!(exit, Exit::Completed { .. });
    Ok(Outcome {
        summary,
        measurements: result.measurements,
        measures: result.measures,
        observed: result.observed,
        completed,
        spectrum: found,
    })
}

/// Rows kept of the histories, for plots and expectations.
struct Rows {
    columns: Vec<String>,
    rows: Vec<Vec<f64>>,
}

/// What a recorder leaves.
struct Recorded {
    measurements: Vec<Measurement>,
    measures: Vec<(String, f64)>,
    observed: Observed,
    warnings: Vec<String>,
    seconds: f64,
}

/// Observes a run: histories, frames, pictures, and the measurements that the deck expects.
struct Recorder<'a> {
    problem: &'a Problem,
    folder: Option<PathBuf>,
    fields: Vec<FieldName>,
    // shared with the thread that writes
    reference: Arc<[[f64; 3]]>,
    id: Arc<[i64]>,
    edge: Vec<f64>,
    conditions: Vec<String>,
    history: Option<History>,
    rows: Rows,
    file: Option<BackgroundFile>,
    pending: Vec<Pending<'a>>,
    measured: Vec<Measurement>,
    /// What is measured without being expected.
    measures: Vec<(String, f64)>,
    wanted: Vec<Wanted>,
    kept: Vec<Kept>,
    /// Start and end of the run.
    span: (f64, f64),
    next_frame: f64,
    next_row: f64,
    /// Least time between rows, where the deck does not say how many there are.
    least_row_interval: f64,
    frames: usize,
    initial_energy: Option<f64>,
    last_velocity: Vec<f64>,
    last: (f64, u64),
    seconds: f64,
    warnings: Vec<String>,
    failed: Option<OutputError>,
    /// Scalars of the run as a whole, for expectations.
    found: Vec<(String, f64)>,
    /// Whether a path is followed: loads then rise and fall, every step has its row, and frames count steps.
    path: bool,
    /// Unstable modes of the last step of a path.
    unstable: usize,
    /// Whether frames and pictures have been made already.
    drawn: bool,
    /// Iterations of statics, and of their linear solvers.
    iterations: (usize, usize),
}

impl<'a> Recorder<'a> {
    fn new(problem: &'a Problem, model: &dyn Simulated, target: &Target, wanted: &[Wanted]) -> Result<Self, RunError> {
        let folder = match target {
            Target::Folder(path) => {
                std::fs::create_dir_all(path).map_err(|source| OutputError::Io { action: "create", path: path.to_path_buf(), source })?;
                Some(path.to_path_buf())
            }
            Target::Nowhere => None,
        };
        let n = problem.cloud.len();
        let (mut reference, mut id, mut edge) = (vec![[0.0; 3]; n], vec![0; n], vec![0.0; n]);
        let d = problem.section.dimension();
        for (p, &q) in problem.user.iter().enumerate() {
            reference[q as usize] = problem.cloud.position[p];
            id[q as usize] = problem.cloud.id[p] as i64;
            edge[q as usize] = match &problem.surface {
                Some(surface) => surface.spacing[p],
                None => (problem.cloud.volume[p] / problem.section.measure()).powf(1.0 / d as f64),
            };
        }
        let conditions = model.condition_names();
        let mut columns: Vec<String> = deck::HISTORY.map(String::from).into();
        columns.extend(problem.deck.output.measures.iter().map(|m| m.name.value.clone()));
        for name in &conditions {
            columns.extend((0..problem.directions()).map(|k| format!("reaction.{name}.{}", axis_name(k))));
        }
        let path = matches!(&problem.deck.solver, Solver::Statics(s) if !matches!(s.control, deck::StaticControl::Load));
        if path {
            columns.push("unstable_modes".into());
        }
        let history = match &folder {
            Some(f) => Some(History::create(&f.join("history.csv"), &columns.iter().map(String::as_str).collect::<Vec<_>>())?),
            None => None,
        };
        let fields = problem.deck.output.fields.iter().filter_map(|f| FieldName::parse(f.name())).collect();
        let pending = problem.deck.expectations().chain(problem.deck.measures()).filter_map(Pending::new).collect();
        Ok(Recorder {
            problem,
            folder,
            fields,
            reference: reference.into(),
            id: id.into(),
            edge,
            conditions,
            history,
            rows: Rows { columns, rows: vec![] },
            file: None,
            pending,
            measured: vec![],
            measures: vec![],
            wanted: wanted.to_vec(),
            kept: vec![],
            span: (0.0, 1.0),
            next_frame: f64::NEG_INFINITY,
            next_row: f64::NEG_INFINITY,
            least_row_interval: 0.0,
            frames: 0,
            initial_energy: None,
            last_velocity: vec![],
            last: (0.0, 0),
            seconds: 0.0,
            warnings: vec![],
            failed: None,
            found: vec![],
            path,
            unstable: 0,
            drawn: false,
            iterations: (0, 0),
        })
    }

    fn points(&self) -> usize {
        self.reference.len()
    }

    /// Whether the points lie on a curve in a plane.
    fn curve(&self) -> bool {
        self.problem.surface.as_ref().is_some_and(|s| s.dimension == 1)
    }

    fn frame_interval(&self) -> f64 {
        let o = &self.problem.deck.output;
        o.every.map_or_else(|| (self.span.1 - self.span.0) / o.frames.map_or(20, |f| f.value.max(1)) as f64, |q| q.value)
    }

    fn row_interval(&self) -> f64 {
        let o = &self.problem.deck.output;
        if let Some(interval) = o.history_every {
            return interval.value;
        }
        let rows = |most: u64| (self.span.1 - self.span.0) / most.max(1) as f64;
        o.history.map_or_else(|| rows(1000).max(self.least_row_interval), |most| rows(most.value))
    }

    /// One accepted step.
    fn step(
        &mut self,
        model: &mut dyn Simulated,
        report: &StepReport,
        u: &[f64],
        v: &[f64],
        progress: &mut dyn Progress,
    ) -> ControlFlow<()> {
        let clock = Instant::now();
        let rest;
        let v = if v.is_empty() {
            rest = vec![0.0; u.len()];
            &rest
        } else {
            v
        };
        let t = report.time;
        self.last = (t, report.step as u64);
        // half a step of grace: the step nearest to the time asked for
        let path = self.path;
        self.unstable = report.unstable_modes.unwrap_or(0);
        let grace = if path { 1e-12 * t.abs() } else { 0.5 * report.increment };
        let count = report.step as f64;
        let reached = |due: f64| if path { count >= due } else { t >= due - grace };
        if path || reached(self.next_row) {
            let row = self.scalars(model, report.step, t, u, v);
            if let Some(h) = &mut self.history
                && let Err(e) = h.append(&row)
            {
                self.failed = Some(e);
            }
            self.rows.rows.push(row);
            self.next_row = next_after(self.next_row, self.row_interval(), t, self.span.0);
        }
        if self.folder.is_some() && reached(self.next_frame) && (path || t < self.span.1 * (1.0 - 1e-12)) {
            self.frame(model, report.step as u64, if path { count } else { t }, u, v);
            // a path has as many steps as it takes: frames become rarer
            self.next_frame = if path {
                count + (0.1 * count).max(1.0).floor()
            } else {
                next_after(self.next_frame, self.frame_interval(), t, self.span.0)
            };
        }
        self.measure_due(model, report.step, t, u, v, Some(grace));
        self.keep_due(model, t, u, v, Some(grace));
        self.seconds += clock.elapsed().as_secs_f64();
        let share = ((t - self.span.0) / (self.span.1 - self.span.0)).clamp(0.0, 1.0);
        progress.at(share, &format!("step {}, time {t:.4e}", report.step));
        if self.failed.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// The first row of the histories, of the state before the first increment.
    fn begin(&mut self, model: &mut dyn Simulated, t: f64, u: &[f64], v: &[f64]) {
        let row = self.scalars(model, 0, t, u, v);
        if let Some(h) = &mut self.history
            && let Err(e) = h.append(&row)
        {
            self.failed = Some(e);
        }
        self.rows.rows.push(row);
        self.next_row = next_after(self.next_row, self.row_interval(), t, self.span.0);
    }

    fn measure_due(&mut self, model: &mut dyn Simulated, step: usize, t: f64, u: &[f64], v: &[f64], grace: Option<f64>) {
        let problem = self.problem;
        let (due, rest): (Vec<_>, Vec<_>) = std::mem::take(&mut self.pending).into_iter().partition(|p| match (p.time(), grace) {
            (Some(time), Some(grace)) => t >= time - grace,
            (None, Some(_)) => false,
            (_, None) => true,
        });
        self.pending = rest;
        if due.is_empty() {
            return;
        }
        let row = self.scalars(model, step, t, u, v);
        let scalars: BTreeMap<String, f64> = self.rows.columns.iter().cloned().zip(row).chain(self.found.iter().cloned()).collect();
        let rows = &self.rows;
        let earlier = |name: &str, time: f64| {
            let column = rows.columns.iter().position(|c| c == name)?;
            rows.rows.iter().min_by(|a, b| (a[0] - time).abs().total_cmp(&(b[0] - time).abs())).map(|r| r[column])
        };
        for p in due {
            let mut field = |c: &FieldComponent| component(model, c, t, u, v);
            let expected = p.is_expected();
            let measured = p.measure(problem, &scalars, &earlier, &mut field, t);
            if expected {
                self.measured.push(measured);
            } else {
                if let Some(why) = measured.problem {
                    self.warnings.push(format!("`{}` could not be measured: {why}", measured.quantity));
                }
                self.measures.push((measured.quantity, measured.computed));
            }
        }
    }

    /// Keeps the fields whose time has come; at the end (no grace) those that are left.
    fn keep_due(&mut self, model: &mut dyn Simulated, t: f64, u: &[f64], v: &[f64], grace: Option<f64>) {
        let (due, rest): (Vec<_>, Vec<_>) = std::mem::take(&mut self.wanted).into_iter().partition(|w| match (w.time, grace) {
            (Some(time), Some(grace)) => t >= time - grace,
            (None, Some(_)) => false,
            (_, None) => true,
        });
        self.wanted = rest;
        if due.is_empty() {
            return;
        }
        let displacement = vectors(&model.field(FieldName::Displacement, t, u, v));
        for Wanted { field, time } in due {
            let values = component(model, &field, t, u, v);
            self.kept.push(Kept { field: field.to_string(), time, values, displacement: displacement.clone() });
        }
    }

    /// The row of the histories.
    fn scalars(&mut self, model: &mut dyn Simulated, step: usize, t: f64, u: &[f64], v: &[f64]) -> Vec<f64> {
        let b = model.balance(t, u, v);
        let total = b.kinetic + b.strain + b.contact;
        let initial = self.initial_energy.unwrap_or(total);
        let (damage, broken) = model.damage();
        let mut row = vec![
            t,
            step as f64,
            b.kinetic,
            b.strain,
            b.contact,
            b.external_work,
            total,
            b.external_work + initial - total,
            b.broken_bonds,
            b.breaking.released,
            b.breaking.raised,
            b.momentum[0],
            b.momentum[1],
            b.momentum[2],
            b.angular_momentum[0],
            b.angular_momentum[1],
            b.angular_momentum[2],
            damage,
            broken.bonds as f64 / 2.0,
        ];
        for m in &self.problem.deck.output.measures {
            let values = component(model, &m.field, t, u, v);
            let points: Vec<(usize, f64)> =
                self.problem.set(&m.over.value).iter().map(|&p| (p as usize, values[self.problem.user[p as usize] as usize])).collect();
            row.push(crate::verify::reduced(self.problem, &points, &m.reduce, m.above.map(|a| a.value)));
        }
        for c in 0..self.conditions.len() {
            let r = model.resultant(c, t, u, Some(v));
            row.extend(&r[..self.problem.directions()]);
        }
        if self.path {
            row.push(self.unstable as f64);
        }
        row
    }

    /// A frame for each of several shapes of `n` dofs, and all pictures of it.
    fn shapes(&mut self, model: &mut dyn Simulated, shapes: &[f64], n: usize) -> Result<(), OutputError> {
        let v = vec![0.0; n];
        for (k, u) in shapes.chunks(n.max(1)).enumerate() {
            let number = (k + 1) as f64;
            self.frame(model, k as u64 + 1, number, u, &v);
            let displacement = vectors(&model.field(FieldName::Displacement, 0.0, u, &v));
            self.pictures(model, number, u, &v, &displacement, |m| !matches!(m, Moment::All), Some(k + 1))?;
        }
        Ok(())
    }

    fn frame(&mut self, model: &mut dyn Simulated, step: u64, t: f64, u: &[f64], v: &[f64]) {
        let Some(folder) = self.folder.clone() else { return };
        let displacement = vectors(&model.field(FieldName::Displacement, t, u, v));
        let fields: Vec<Field> = self
            .fields
            .iter()
            .filter(|f| !matches!(f, FieldName::Displacement | FieldName::Id))
            .map(|&f| Field::new(f.name(), values(f, model.field(f, t, u, v))))
            .collect();
        self.frames += 1;
        let pictures = self.pictures(model, t, u, v, &displacement, |m| matches!(m, Moment::All), Some(self.frames));
        let frame = Frame { time: t, step, displacement, fields };
        let written = match &mut self.file {
            Some(file) => file.push(frame),
            None => {
                let triangles = self.problem.surface.as_ref().map_or_else(Vec::new, |s| s.triangles.clone());
                let file = BackgroundFile::start(folder.join("fields.vtkhdf"), self.id.clone(), self.reference.clone(), triangles);
                file.and_then(|file| self.file.insert(file).push(frame))
            }
        };
        if let Err(e) = written.and(pictures) {
            self.failed = Some(e);
        }
    }

    fn pictures(
        &mut self,
        model: &mut dyn Simulated,
        t: f64,
        u: &[f64],
        v: &[f64],
        displacement: &[[f64; 3]],
        wanted: impl Fn(&Moment) -> bool,
        frame: Option<usize>,
    ) -> Result<(), OutputError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        for p in self.problem.deck.output.pictures.iter().filter(|p| wanted(&p.time)) {
            let shown = component(model, &p.field, t, u, v);
            let name = p.name.as_ref().map_or_else(|| p.field.to_string().replace('.', "_"), |n| n.value.clone());
            let body = picture::Body {
                dimension: (self.problem.section.dimension() + usize::from(self.problem.thin)).min(if self.curve() { 2 } else { 3 }),
                reference: &self.reference,
                displacement,
                edge: &self.edge,
            };
            let label = p.field.to_string();
            let signed = shown.iter().any(|x| *x < 0.0) && shown.iter().any(|x| *x > 0.0);
            let damage = p.field.field.name() == "damage";
            let mut options = Options {
                title: Some(self.problem.deck.title.value.clone()),
                caption: Some(match (frame, &self.problem.deck.solver) {
                    (Some(k), Solver::Vibration(_) | Solver::Buckling(_)) => format!("{label}, mode {k}"),
                    (_, Solver::VelocityVerlet(_)) => format!("{label} at {} {}", short(t), self.problem.deck.units.symbols()[2]),
                    _ => format!("{label} at time {}", short(t)),
                }),
                colors: if damage {
                    ColorMap::Ember
                } else if signed {
                    ColorMap::Diverging
                } else {
                    ColorMap::Viridis
                },
                range: if signed && !damage { Range::Symmetric } else { Range::Auto },
                deformation: match p.scale {
                    Auto::Auto => Deformation::Auto,
                    Auto::Given(q) => Deformation::Factor(q.value),
                },
                ..Options::default()
            };
            if damage {
                options.range = Range::Fixed { min: 0.0, max: 1.0 };
            }
            if let Some([a, b]) = p.range {
                options.range = Range::Fixed { min: a.value, max: b.value };
            }
            if let Some(view) = &p.view {
                options.view = View { azimuth: view.azimuth.value.to_degrees(), elevation: view.elevation.value.to_degrees() };
            }
            let file = frame.map_or_else(|| format!("{name}.png"), |k| format!("{name}_{k:04}.png"));
            let units = &self.problem.deck.units;
            options.length_unit = unit_of(FieldName::Displacement, units);
            let unit = FieldName::parse(p.field.field.name()).and_then(|field| unit_in(self.problem, field));
            let shown = Shown { name: &label, unit: unit.as_deref(), values: &shown };
            let picture = match &self.problem.surface {
                Some(surface) if surface.dimension == 2 => {
                    let whole = untorn(&surface.triangles, &self.reference, displacement, &model.field(FieldName::Damage, t, u, v));
                    picture::draw_surface(&body, &whole, &surface.normals, &shown, &options)?
                }
                _ => picture::draw(&body, &shown, &options)?,
            };
            picture.write(&folder.join(file))?;
        }
        Ok(())
    }

    /// The end: last frame, pictures, tables, plots, and what is still to be measured.
    fn finish(mut self, model: &mut dyn Simulated, u: &[f64], exit: &Exit) -> Result<Recorded, RunError> {
        let clock = Instant::now();
        let (t, step) = self.last;
        let v = if self.last_velocity.len() == u.len() { std::mem::take(&mut self.last_velocity) } else { vec![0.0; u.len()] };
        if self.rows.rows.last().is_none_or(|r| if self.path { r[1] < step as f64 } else { r[0] < t }) {
            let row = self.scalars(model, step as usize, t, u, &v);
            if let Some(h) = &mut self.history {
                h.append(&row)?;
            }
            self.rows.rows.push(row);
        }
        if matches!(exit, Exit::Completed { .. }) {
            self.measure_due(model, step as usize, t, u, &v, None);
        } else {
            for p in std::mem::take(&mut self.pending) {
                if p.is_expected() {
                    self.measured.push(p.missing());
                } else {
                    self.measures.push((p.missing().quantity, f64::NAN));
                }
            }
        }
        self.keep_due(model, t, u, &v, None);
        if let Some(folder) = self.folder.clone() {
            let displacement = vectors(&model.field(FieldName::Displacement, t, u, &v));
            if !self.drawn {
                self.frame(model, step, if self.path { step as f64 } else { t }, u, &v);
                let at_end = |m: &Moment| !matches!(m, Moment::All);
                self.pictures(model, t, u, &v, &displacement, at_end, None)?;
            }
            let fields: Vec<Field> = self
                .fields
                .iter()
                .filter(|f| !matches!(f, FieldName::Displacement | FieldName::Id))
                .map(|&f| Field::new(f.name(), values(f, model.field(f, t, u, &v))))
                .collect();
            let snapshot = Snapshot { time: t, step, displacement: &displacement, fields: &fields };
            write_final(&folder.join("final.csv"), &self.id, &self.reference, &snapshot)?;
            self.plots(model, &folder, t, u, &v)?;
        }
        if let Some(file) = self.file.take() {
            file.finish()?;
        }
        if let Some(e) = self.failed {
            return Err(e.into());
        }
        Ok(Recorded {
            measurements: self.measured,
            measures: self.measures,
            observed: Observed {
                dimension: self.problem.section.dimension(),
                reference: self.reference,
                edge: self.edge,
                fields: self.kept,
                columns: self.rows.columns,
                rows: self.rows.rows,
            },
            warnings: self.warnings,
            seconds: self.seconds + clock.elapsed().as_secs_f64(),
        })
    }

    fn plots(&mut self, model: &mut dyn Simulated, folder: &Path, t: f64, u: &[f64], v: &[f64]) -> Result<(), OutputError> {
        for p in &self.problem.deck.output.plots {
            let mut plot = Plot::new(self.problem.deck.title.value.clone(), Axis::new(""), Axis::new(""));
            if let (Some(x), Some(ys)) = (&p.x, &p.y) {
                let column = |name: &str| self.rows.columns.iter().position(|c| c == name);
                let Some(a) = column(&x.value) else {
                    self.warnings.push(format!(
                        "plot `{}`: there is no history `{}`; there are {}",
                        p.name.value,
                        x.value,
                        self.rows.columns.join(", ")
                    ));
                    continue;
                };
                plot.x = axis(x.value.clone(), unit_of_column(self.problem, &x.value));
                plot.y = common(ys.iter().map(|y| (y.value.clone(), unit_of_column(self.problem, &y.value))).collect(), &mut plot.legend);
                for y in ys {
                    match column(&y.value) {
                        Some(b) => plot = plot.curve(Curve::new(y.value.clone(), self.rows.rows.iter().map(|r| [r[a], r[b]]).collect())),
                        None => self.warnings.push(format!("plot `{}`: there is no history `{}`", p.name.value, y.value)),
                    }
                }
                if matches!(p.log, Some(deck::LogAxes::X | deck::LogAxes::Both)) {
                    plot.x = plot.x.logarithmic();
                }
                if matches!(p.log, Some(deck::LogAxes::Y | deck::LogAxes::Both)) {
                    plot.y = plot.y.logarithmic();
                }
            }
            if let (Some(line), Some(fields)) = (&p.along, &p.fields) {
                let (a, b) = (line.from.point(), line.to.point());
                let on = along(&self.reference, &self.edge, a, b);
                plot.x = axis("distance along the line".into(), unit_of(FieldName::Displacement, &self.problem.deck.units));
                let unit = |f: &FieldComponent| FieldName::parse(f.field.name()).and_then(|field| unit_in(self.problem, field));
                plot.y = common(fields.iter().map(|f| (f.to_string(), unit(f))).collect(), &mut plot.legend);
                if p.analytic.is_some() {
                    plot.legend = Legend::Inside;
                }
                for f in fields {
                    let values = component(model, f, t, u, v);
                    plot = plot.curve(Curve::new(f.to_string(), on.iter().map(|&(s, q)| [s, values[q]]).collect()));
                }
                if let Some(f) = &p.analytic {
                    let points = on.iter().map(|&(s, q)| [s, f.eval(self.reference[q], t)]).collect();
                    plot = plot.curve(Curve::new(f.text.clone(), points).style(Style::Dashed));
                }
            }
            plot.write_png(&folder.join(format!("{}.png", p.name.value)))?;
            plot.write_csv(&folder.join(format!("{}.csv", p.name.value)))?;
        }
        Ok(())
    }
}

/// A number of a caption: five digits at most.
fn short(x: f64) -> String {
    let rounded: f64 = format!("{x:.4e}").parse().unwrap_or(x);
    if rounded == 0.0 || (1e-3..1e5).contains(&rounded.abs()) { rounded.to_string() } else { format!("{rounded:e}") }
}

fn axis(label: String, unit: Option<String>) -> Axis {
    let axis = Axis::new(label);
    match unit {
        Some(unit) => axis.unit(unit),
        None => axis,
    }
}

/// The ordinate of several curves: the one curve's name and unit (it then needs no legend), or the unit they share.
fn common(mut curves: Vec<(String, Option<String>)>, legend: &mut Legend) -> Axis {
    if let [_] = curves[..] {
        *legend = Legend::None;
        let (name, unit) = curves.remove(0);
        return axis(name, unit);
    }
    let first = curves.first().and_then(|c| c.1.clone());
    Axis::new(first.filter(|unit| curves.iter().all(|c| c.1.as_ref() == Some(unit))).unwrap_or_default())
}

/// Points within half a cell of the line from `a` to `b`, as distance along it and index, in order.
pub fn along(reference: &[[f64; 3]], edge: &[f64], a: [f64; 3], b: [f64; 3]) -> Vec<(f64, usize)> {
    let d: [f64; 3] = std::array::from_fn(|k| b[k] - a[k]);
    let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut on: Vec<(f64, usize)> = (0..reference.len())
        .filter_map(|q| {
            let r: [f64; 3] = std::array::from_fn(|k| reference[q][k] - a[k]);
            let s = (0..3).map(|k| r[k] * d[k]).sum::<f64>() / length;
            let away = (0..3).map(|k| (r[k] - s * d[k] / length).powi(2)).sum::<f64>().sqrt();
            let near = 0.5 * edge[q] * (1.0 + 1e-9);
            (away <= near && s >= -near && s <= length + near).then_some((s, q))
        })
        .collect();
    on.sort_by(|x, y| x.0.total_cmp(&y.0));
    on
}

/// The next time at which something is due, on a grid from the start of the run.
fn next_after(due: f64, interval: f64, t: f64, start: f64) -> f64 {
    if interval.is_nan() || interval <= 0.0 {
        return t;
    }
    let from = if due.is_finite() { due } else { start };
    let steps = ((t - from) / interval + 1e-9).floor().max(0.0) + 1.0;
    from + steps * interval
}

fn vectors(flat: &[f64]) -> Vec<[f64; 3]> {
    flat.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

/// The triangles that no crack has torn: those whose corners are not all damaged, or none of whose edges has opened by a fiftieth.
fn untorn(triangles: &[[u32; 3]], reference: &[[f64; 3]], displacement: &[[f64; 3]], damage: &[f64]) -> Vec<[u32; 3]> {
    let length = |x: [f64; 3]| x.iter().map(|c| c * c).sum::<f64>().sqrt();
    let open = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        let before: [f64; 3] = std::array::from_fn(|k| reference[b][k] - reference[a][k]);
        let now: [f64; 3] = std::array::from_fn(|k| before[k] + displacement[b][k] - displacement[a][k]);
        length(now) > 1.02 * length(before)
    };
    let whole = |t: &&[u32; 3]| t.iter().any(|&q| damage[q as usize] < 0.2) || !(0..3).any(|k| open(t[k], t[(k + 1) % 3]));
    triangles.iter().filter(whole).copied().collect()
}

fn values(name: FieldName, flat: Vec<f64>) -> FieldValues {
    match name {
        FieldName::FamilySize | FieldName::Material | FieldName::Id => FieldValues::Integer(flat.iter().map(|x| *x as i64).collect()),
        _ => match name.words() {
            1 => FieldValues::Scalar(flat),
            3 => FieldValues::Vector(vectors(&flat)),
            _ => FieldValues::Tensor(flat.chunks_exact(9).map(|c| std::array::from_fn(|k| c[k])).collect()),
        },
    }
}

/// A component of a field, one number a point, in the user's order.
fn component(model: &mut dyn Simulated, c: &FieldComponent, t: f64, u: &[f64], v: &[f64]) -> Vec<f64> {
    let Some(name) = FieldName::parse(c.field.name()) else { return vec![] };
    let flat = model.field(name, t, u, v);
    let words = name.words();
    let entry = |k: usize| flat.chunks_exact(words).map(|w| w[k]).collect::<Vec<f64>>();
    let axis = |a: u8| (a - b'x') as usize;
    match c.component.map(str::as_bytes) {
        None => entry(0),
        Some(b"magnitude") => flat.chunks_exact(words).map(|w| w.iter().map(|x| x * x).sum::<f64>().sqrt()).collect(),
        Some([a]) => entry(axis(*a)),
        Some([a, b]) => entry(axis(*a) * 3 + axis(*b)),
        Some(_) => entry(0),
    }
}
