//! How a problem is advanced: the deck's solver, with its options, over the assembled body.

use super::*;

/// Least steps between two rows of the history, where the deck does not say how many there are: a row costs about two steps, for the energies.
const STEPS_PER_ROW: f64 = 120.0;

/// How a motion ended.
pub(super) struct Moved {
    pub(super) exit: Exit,
    pub(super) steps: usize,
    /// The step at the start.
    pub(super) step: f64,
    /// Seconds that the estimate of the stable step took.
    pub(super) estimating: f64,
}

#[allow(clippy::too_many_arguments)]
pub(super) fn motion(
    problem: &Problem,
    options: &deck::VelocityVerlet,
    model: &mut (dyn Simulated + 'static),
    u: &mut Vec<f64>,
    v: &mut Vec<f64>,
    recorder: &mut Recorder,
    progress: &mut dyn Progress,
    cancel: &AtomicBool,
) -> Result<Moved, RunError> {
    let clock = Instant::now();
    // points that meet at the start have no stiffness to estimate a step from
    let met = model.step_limit(0.0, u, v, f64::MAX).err();
    let estimate = match options.step {
        Auto::Given(q) => Ok((q.value, None)),
        Auto::Auto if met.is_some() => Ok((0.0, None)),
        Auto::Auto => stable_step(model, 0.0, u, options.safety.value)
            .map(|s| (s.time_step, Some(Following { safety: options.safety.value, frequency: s.frequency }))),
    };
    let (step, following) = match estimate {
        Ok(found) => found,
        Err(e) => {
            let mut force = vec![0.0; u.len()];
            if let Err(stop) = Dynamics::force(model, 0.0, u, v, &mut force) {
                let exit = Exit::Stopped { reason: format!("at the start {stop}"), time: 0.0 };
                recorder.last_velocity = std::mem::take(v);
                return Ok(Moved { exit, steps: 0, step: 0.0, estimating: clock.elapsed().as_secs_f64() });
            }
            let issue = deck::Issue::new(options.span, e.to_string(), "give `step:` in the solver");
            return Err(RunError::Deck(problem.deck.errors(vec![issue])));
        }
    };
    let estimating = clock.elapsed().as_secs_f64();
    if let Some(stop) = met {
        recorder.last_velocity = std::mem::take(v);
        return Ok(Moved { exit: Exit::Stopped { reason: format!("at the start {stop}"), time: 0.0 }, steps: 0, step, estimating });
    }
    let end = options.end.map_or_else(|| step * options.steps.map_or(1, |s| s.value) as f64, |e| e.value);
    let solver = VelocityVerlet { time_step: step, end, observe_every: 1, following };
    let mut motion = Motion::at_rest(0, 0.0);
    (motion.u, motion.v) = (std::mem::take(u), std::mem::take(v));
    recorder.span = (0.0, end);
    recorder.least_row_interval = STEPS_PER_ROW * step;
    let result = {
        let mut observer =
            |report: &StepReport, model: &mut (dyn Simulated + 'static), u: &[f64], v: &[f64]| recorder.step(model, report, u, v, progress);
        solver.run(model, &mut motion, &mut observer, Some(cancel))
    };
    let exit = match result {
        Ok(Ended::Completed) => Exit::Completed { time: motion.time },
        Ok(_) => Exit::Stopped { reason: "stopped by the user".into(), time: motion.time },
        Err(e) => Exit::Stopped { reason: e.to_string(), time: motion.time },
    };
    *u = motion.u;
    recorder.last_velocity = motion.v;
    Ok(Moved { exit, steps: motion.step, step, estimating })
}

/// Statics from the load `start` on, by whatever leads `run` through them.
pub(super) fn statics(
    model: &mut (dyn Simulated + 'static),
    start: f64,
    u: &mut [f64],
    recorder: &mut Recorder,
    progress: &mut dyn Progress,
    run: impl FnOnce(&mut (dyn Simulated + 'static), &mut [f64], &mut dyn Observer<dyn Simulated>) -> Result<Ended, StaticsError>,
) -> (Exit, usize) {
    let mut last = (start, 0);
    let rest = vec![0.0; u.len()];
    // the unloaded body is the first frame, and the first row of the histories
    recorder.frame(model, 0, start, u, &rest);
    recorder.begin(model, start, u, &rest);
    let result = {
        let mut observer = |report: &StepReport, model: &mut (dyn Simulated + 'static), u: &[f64], _: &[f64]| {
            last = (report.time, report.step);
            recorder.iterations.0 += report.iterations;
            recorder.iterations.1 += report.linear_iterations;
            recorder.step(model, report, u, &rest, progress)
        };
        run(model, u, &mut observer)
    };
    recorder.last_velocity = rest;
    (ended(result, model, u, recorder, last.0), last.1)
}

/// How statics ended.
fn ended(result: Result<Ended, StaticsError>, model: &dyn Simulated, u: &[f64], recorder: &Recorder, time: f64) -> Exit {
    match result {
        Ok(Ended::Completed) => Exit::Completed { time },
        Ok(_) => Exit::Stopped { reason: "stopped by the user".into(), time },
        Err(e) => {
            let worst = match &e {
                StaticsError::Increment { cause, .. } => cause.worst_dof(),
                _ => None,
            };
            failed(&e, worst, model, u.len() / recorder.points(), time)
        }
    }
}

/// The end of statics that failed, with the place of the worst residual where one is known.
fn failed(error: &dyn std::fmt::Display, worst: Option<usize>, model: &dyn Simulated, dofs_per_point: usize, time: f64) -> Exit {
    let place = worst.map(|dof| {
        let (id, x) = model.describe_dof(dof);
        format!("; worst at point {id} at ({:.6e}, {:.6e}, {:.6e}), direction {}", x[0], x[1], x[2], axis_name(dof % dofs_per_point))
    });
    Exit::Stopped { reason: format!("{error}{}; the last good state was written", place.unwrap_or_default()), time }
}

/// What following a path needs, from the deck.
pub(super) fn path_options(problem: &Problem, options: &deck::Statics, model: &dyn Simulated, threads: usize) -> ArcLength {
    let end = options.end.value;
    let mut arc = ArcLength {
        end,
        tolerance: options.tolerance.value,
        most_iterations: options.max_iterations.value as usize,
        threads,
        ..ArcLength::default()
    };
    match &options.control {
        deck::StaticControl::Load | deck::StaticControl::Breaking => {}
        deck::StaticControl::ArcLength(a) => {
            (arc.first_step, arc.largest_step) = (a.first_step.value, a.largest_step.value);
            arc.most_steps = a.most_steps.value as usize;
            // loads at which something is expected are met exactly
            let expected = problem.deck.expectations().chain(problem.deck.measures()).filter_map(|e| match e.moment() {
                Moment::At(q) => Some(q.value),
                _ => None,
            });
            arc.stations = expected.collect();
            arc.stations.sort_by(f64::total_cmp);
            arc.stations.dedup();
        }
        deck::StaticControl::Displacement(c) => {
            let points = problem.set(&c.over.value);
            let d = Statics::dofs_per_point(model);
            // where a body moves across alone that is its only component
            let component = if d == 1 { 0 } else { c.along.index().min(d - 1) };
            let weight = 1.0 / points.len().max(1) as f64;
            let measure = points.iter().map(|&p| (p as usize * d + component, weight)).collect();
            arc.control = Control::Displacement { measure, end: c.end.value };
            arc.first_step = 1.0 / c.steps.value.max(1) as f64;
            arc.largest_step = arc.first_step;
            arc.most_steps = 1000 * c.steps.value.max(1) as usize;
        }
    }
    arc
}

/// Follows a path of equilibria.
pub(super) fn follow(
    model: &mut (dyn Simulated + 'static),
    arc: &ArcLength,
    u: &mut [f64],
    recorder: &mut Recorder,
    progress: &mut dyn Progress,
    cancel: &AtomicBool,
) -> (Exit, usize) {
    let mut last = (arc.start, 0);
    let rest = vec![0.0; u.len()];
    recorder.frame(model, 0, 0.0, u, &rest);
    let result = {
        let mut observer = |report: &StepReport, model: &mut (dyn Simulated + 'static), u: &[f64], _: &[f64]| {
            last = (report.time, report.step);
            recorder.step(model, report, u, &rest, progress)
        };
        arc.run(model, u, &mut observer, Some(cancel))
    };
    recorder.last_velocity = rest;
    let exit = match result {
        Ok(Followed { ended, limit_points, bifurcations, .. }) => {
            recorder.found.push(("limit_points".into(), limit_points.len() as f64));
            recorder.found.push(("bifurcations".into(), bifurcations.len() as f64));
            for (k, p) in limit_points.iter().enumerate() {
                recorder.found.push((format!("limit_load.{}", k + 1), p.load));
            }
            for (k, b) in bifurcations.iter().enumerate() {
                recorder.found.push((format!("bifurcation_load.{}", k + 1), 0.5 * (b.between[0] + b.between[1])));
            }
            match ended {
                Ended::Completed => Exit::Completed { time: last.0 },
                _ => Exit::Stopped { reason: "stopped by the user".into(), time: last.0 },
            }
        }
        Err(e) => {
            let worst = match &e {
                PathError::Step { cause, .. } => cause.worst_dof(),
                _ => None,
            };
            failed(&e, worst, model, u.len() / recorder.points(), last.0)
        }
    };
    (exit, last.1)
}
