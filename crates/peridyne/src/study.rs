//! A study: one deck run for every combination of some values, a table of what was measured, and what is expected of all
//! combinations together.

use crate::deck::{Combination, Deck, Fit, ParameterValue, StudyDecks, StudyExpectation, chooses};
use crate::figures;
use crate::output::summary::Exit;
use crate::output::table::{quoted, shortest};
use crate::output::{OutputError, write_whole};
use crate::run::{self, Observed, Outcome, Progress, RunError, Target};
use crate::verify::{Measurement, reference};
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Hears how far a study is.
pub trait Listener: Progress {
    /// The combination `number` (from 1) of `count` begins.
    fn begins(&mut self, number: usize, count: usize, name: &str);
    /// It has ended.
    fn ends(&mut self, made: &Made, outcome: &Outcome);
}

/// One combination that was run.
#[derive(Debug, Clone)]
pub struct Made {
    /// Its name.
    pub name: String,
    /// The run that is varied, if the study is over runs; then the values that the combination sets, as typed.
    pub factors: Vec<(String, String)>,
    /// Its deck.
    pub deck: Deck,
    /// What was expected of it, measured.
    pub measurements: Vec<Measurement>,
    /// What was measured besides.
    pub measures: Vec<(String, f64)>,
    /// Histories and fields.
    pub observed: Observed,
    /// Why it did not reach its end.
    pub stopped: Option<String>,
    /// Seconds that it took.
    pub seconds: f64,
}

impl Made {
    /// A quantity that was measured, or the last value of a history.
    pub fn quantity(&self, name: &str) -> Option<f64> {
        let expected = self.measurements.iter().find(|m| m.quantity == name).map(|m| m.computed);
        let measured = || self.measures.iter().find(|m| m.0 == name).map(|m| m.1);
        let last = || self.observed.column(name).and_then(|column| column.last().copied());
        expected.or_else(measured).or_else(last)
    }

    /// The value of a parameter.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        match self.deck.parameters.get(name)?.value {
            ParameterValue::Number(value, _) => Some(value),
            _ => None,
        }
    }
}

/// What a study ended with.
pub struct StudyOutcome {
    /// The combinations that were run, in order.
    pub made: Vec<Made>,
    /// What was expected of them together, measured.
    pub measurements: Vec<Measurement>,
    /// Expectations that were left out because some of their combinations were not run.
    pub left_out: usize,
    /// What could not be drawn, and why.
    pub undrawn: Vec<String>,
}

impl StudyOutcome {
    /// Whether all runs reached their end, all expectations hold and all figures were drawn.
    pub fn is_good(&self) -> bool {
        let runs = self.made.iter().all(|made| made.stopped.is_none() && made.measurements.iter().all(|m| m.passed));
        runs && self.undrawn.is_empty() && self.measurements.iter().all(|m| m.passed)
    }
}

/// Runs the chosen combinations of a study, each into its own folder within `folder`; writes `study.csv`, and, where all
/// combinations were run, the figures.
///
/// # Errors
/// [`RunError`] where a deck is at fault or nothing can be written.
pub fn run(
    study: &StudyDecks,
    folder: Option<&Path>,
    chosen: &dyn Fn(&Combination) -> bool,
    listener: &mut dyn Listener,
    cancel: &AtomicBool,
) -> Result<StudyOutcome, RunError> {
    let todo: Vec<&Combination> = study.combinations.iter().filter(|one| chosen(one)).collect();
    let complete = todo.len() == study.combinations.len();
    let draw = folder.is_some() && complete;
    if draw {
        figures::check(&study.written).map_err(RunError::Deck)?;
    }
    let mut made: Vec<Made> = vec![];
    for (k, one) in todo.iter().enumerate() {
        if cancel.load(Ordering::Relaxed) {
            break;
        }
        listener.begins(k + 1, todo.len(), &one.name);
        let clock = std::time::Instant::now();
        let own = folder.map(|folder| folder.join(&one.name));
        let target = own.as_deref().map_or(Target::Nowhere, Target::Folder);
        let wanted = if draw { figures::wanted(&one.deck, &one.name) } else { vec![] };
        let mut outcome = match run::run_keeping(one.deck.clone(), &target, &wanted, listener, cancel) {
            Ok(outcome) => outcome,
            Err(RunError::Deck(errors)) => return Err(RunError::Deck(errors.of(&one.name))),
            Err(e) => return Err(e),
        };
        let over_runs = (one.deck.run != crate::deck::DEFAULT_RUN).then(|| ("run".to_string(), one.deck.run.clone()));
        let stopped = match &outcome.summary.exit {
            Exit::Completed { .. } => None,
            Exit::Stopped { reason, .. } => Some(reason.clone()),
        };
        let result = Made {
            name: one.name.clone(),
            factors: over_runs.into_iter().chain(one.values.clone()).collect(),
            deck: one.deck.clone(),
            measurements: outcome.measurements.clone(),
            measures: outcome.measures.clone(),
            observed: std::mem::take(&mut outcome.observed),
            stopped,
            seconds: clock.elapsed().as_secs_f64(),
        };
        listener.ends(&result, &outcome);
        made.push(result);
    }
    let (measurements, left_out) = judge(study, &made);
    let mut undrawn = vec![];
    if let Some(folder) = folder {
        write_table(&folder.join("study.csv"), &study.written, &made)?;
        if draw && made.len() == todo.len() {
            undrawn = figures::draw(&study.written, &made, folder);
        }
    }
    Ok(StudyOutcome { made, measurements, left_out, undrawn })
}

/// Values of the combinations of one group, by increasing parameter.
pub(crate) struct Group<'a> {
    /// What its combinations have in common and others have not, such as `control=none`.
    pub label: String,
    /// Parameter and combination.
    pub members: Vec<(f64, &'a Made)>,
}

/// Sorts combinations by a parameter, in groups: whatever takes several values at one value of the parameter parts them.
pub(crate) fn groups<'a>(made: &[&'a Made], against: &str) -> Vec<Group<'a>> {
    let all: Vec<(f64, &Made)> = made.iter().filter_map(|one| Some((one.parameter(against)?, *one))).collect();
    let parts = |k: usize| all.iter().any(|a| all.iter().any(|b| a.0 == b.0 && a.1.factors.get(k) != b.1.factors.get(k)));
    let count = all.iter().map(|one| one.1.factors.len()).max().unwrap_or(0);
    let parting: Vec<usize> = (0..count).filter(|&k| parts(k)).collect();
    let mut groups: Vec<Group> = vec![];
    for (x, one) in all {
        let own = parting.iter().filter_map(|&k| one.factors.get(k));
        let label = own.map(|(name, value)| if name == "run" { value.clone() } else { format!("{name} = {value}") });
        let label = label.collect::<Vec<_>>().join(", ");
        match groups.iter_mut().find(|group| group.label == label) {
            Some(group) => group.members.push((x, one)),
            None => groups.push(Group { label, members: vec![(x, one)] }),
        }
    }
    groups.iter_mut().for_each(|group| group.members.sort_by(|a, b| a.0.total_cmp(&b.0)));
    groups
}

/// Measures what is expected of the combinations together; the second value counts expectations left out.
fn judge(study: &StudyDecks, made: &[Made]) -> (Vec<Measurement>, usize) {
    let expectations = study.written.study.as_ref().map_or(&[][..], |own| &own.expect);
    let mut measured = vec![];
    let mut left_out = 0;
    for e in expectations {
        let needed = |name: &str| match (&e.of, &e.to) {
            (Some(of), Some(to)) => chooses(&of.value, name) || chooses(&to.value, name),
            _ => e.runs.holds(name),
        };
        let missing = study.combinations.iter().any(|one| needed(&one.name) && !made.iter().any(|m| m.name == one.name));
        if missing {
            left_out += 1;
            continue;
        }
        let chosen: Vec<&Made> = made.iter().filter(|one| needed(&one.name)).collect();
        measured.extend(measure(e, &chosen));
    }
    (measured, left_out)
}

fn measure(e: &StudyExpectation, made: &[&Made]) -> Vec<Measurement> {
    let judged = |what: String, computed: Result<f64, String>, (reference, tolerance): (f64, f64)| {
        let (value, problem) = match computed {
            Ok(value) => (value, None),
            Err(why) => (f64::NAN, Some(why)),
        };
        Measurement {
            quantity: what,
            computed: value,
            reference,
            tolerance,
            source: e.source.as_ref().map_or_else(String::new, |s| s.value.clone()),
            // a NaN never passes
            passed: (value - reference).abs() <= tolerance,
            problem,
        }
    };
    let between = e.between.map(|b| b.map(|q| q.value));
    let bounds = reference(e.value.map(|q| q.value), e.tolerance.map(|q| q.value), e.absolute.map(|q| q.value), between);
    let named = |what: String| e.name.as_ref().map_or(what, |name| name.value.clone());
    if let (Some(quantity), Some(of), Some(to)) = (&e.ratio, &e.of, &e.to) {
        let value = |wanted: &str| {
            let one = made.iter().find(|one| chooses(wanted, &one.name)).ok_or_else(|| format!("`{wanted}` was not run"))?;
            one.quantity(&quantity.value).ok_or_else(|| format!("`{}` was not measured in {}", quantity.value, one.name))
        };
        let ratio = value(&of.value).and_then(|a| value(&to.value).map(|b| a / b));
        return vec![judged(named(format!("{}, {} over {}", quantity.value, of.value, to.value)), ratio, bounds)];
    }
    let Some(against) = &e.against else { return vec![] };
    let (kind, quantity) = match (&e.order, &e.falls, &e.rises) {
        (Some(q), ..) => ("order of", q),
        (_, Some(q), _) => ("falls:", q),
        (_, _, Some(q)) => ("rises:", q),
        _ => return vec![],
    };
    groups(made, &against.value)
        .iter()
        .map(|group| {
            let mut what = named(format!("{kind} {} against {}", quantity.value, against.value));
            if !group.label.is_empty() {
                what.push_str(&format!(" ({})", group.label));
            }
            let values: Result<Vec<[f64; 2]>, String> = group
                .members
                .iter()
                .map(|(x, one)| {
                    let y = one.quantity(&quantity.value).filter(|y| y.is_finite());
                    y.map(|y| [*x, y]).ok_or_else(|| format!("`{}` was not measured in {}", quantity.value, one.name))
                })
                .collect();
            let values = match values {
                Ok(values) if values.len() >= 2 => values,
                Ok(_) => return judged(what, Err("two combinations at least are needed".into()), bounds),
                Err(why) => return judged(what, Err(why), bounds),
            };
            if e.order.is_some() {
                return judged(what, order(&values, &e.fit), bounds);
            }
            let wrong = values.windows(2).filter(|w| if e.falls.is_some() { w[1][1] >= w[0][1] } else { w[1][1] <= w[0][1] }).count();
            let mut found = judged(what, Ok(wrong as f64), (0.0, 0.0));
            if wrong > 0 {
                let list: Vec<String> = values.iter().map(|[x, y]| format!("{x}: {y:e}")).collect();
                found.problem = Some(format!("{wrong} steps go the wrong way; {}", list.join(", ")));
            }
            found
        })
        .collect()
}

/// The slope of the logarithms, by least squares or through two values at an end.
fn order(values: &[[f64; 2]], fit: &Fit) -> Result<f64, String> {
    if let Some([x, y]) = values.iter().find(|v| v[0] <= 0.0 || v[1] <= 0.0) {
        return Err(format!("an order needs positive values, but there is {y:e} at {x:e}"));
    }
    let values = match fit {
        Fit::All => values,
        Fit::Smallest => &values[..2],
        Fit::Largest => &values[values.len() - 2..],
    };
    let n = values.len() as f64;
    let logs = || values.iter().map(|[x, y]| (x.ln(), y.ln()));
    let (mx, my) = (logs().map(|l| l.0).sum::<f64>() / n, logs().map(|l| l.1).sum::<f64>() / n);
    let (xy, xx) = logs().fold((0.0, 0.0), |(xy, xx), (x, y)| (xy + (x - mx) * (y - my), xx + (x - mx) * (x - mx)));
    if xx > 0.0 { Ok(xy / xx) } else { Err("all combinations have the same value of the parameter".into()) }
}

/// The table of a study: a row for each combination, with run, parameters and all that was measured.
fn write_table(path: &Path, written: &Deck, made: &[Made]) -> Result<(), OutputError> {
    let mut parameters: Vec<&str> = vec![];
    for parameter in written.parameters.iter() {
        let name = parameter.name.as_str();
        let set = made.iter().any(|one| one.factors.iter().any(|f| f.0 == name));
        let values: Vec<Option<f64>> = made.iter().map(|one| one.parameter(name)).collect();
        let moves = values.windows(2).any(|w| w[0].is_some() && w[1].is_some() && w[0] != w[1]);
        if set || moves {
            parameters.push(name);
        }
    }
    let over_runs = made.iter().any(|one| one.factors.first().is_some_and(|f| f.0 == "run"));
    let mut quantities: Vec<&str> = vec![];
    let own =
        made.iter().flat_map(|one| one.measures.iter().map(|m| m.0.as_str()).chain(one.measurements.iter().map(|m| m.quantity.as_str())));
    let expected = written.study.iter().flat_map(|s| &s.expect).flat_map(|e| [&e.order, &e.falls, &e.rises, &e.ratio]);
    let named = expected.flatten().chain(figures::quantities(written)).map(|text| text.value.as_str());
    for name in own.chain(named) {
        if !quantities.contains(&name) {
            quantities.push(name);
        }
    }
    write_whole(path, |file| -> io::Result<()> {
        let mut head = vec!["combination".to_string()];
        head.extend(over_runs.then(|| "run".to_string()));
        head.extend(parameters.iter().chain(&quantities).map(|name| quoted(name)));
        writeln!(file, "{}", head.join(","))?;
        for one in made {
            let mut row = vec![quoted(&one.name)];
            row.extend(over_runs.then(|| quoted(&one.deck.run)));
            row.extend(parameters.iter().map(|name| match one.parameter(name) {
                Some(value) => shortest(value),
                None => quoted(one.factors.iter().find(|f| f.0 == *name).map_or("", |f| f.1.as_str())),
            }));
            row.extend(quantities.iter().map(|name| one.quantity(name).map_or_else(String::new, shortest)));
            writeln!(file, "{}", row.join(","))?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_a_power_is_its_exponent() {
        let values: Vec<[f64; 2]> = [0.1, 0.2, 0.4, 0.8].iter().map(|&x: &f64| [x, 3.0 * x.powf(1.5)]).collect();
        for fit in [Fit::All, Fit::Smallest, Fit::Largest] {
            assert!((order(&values, &fit).unwrap() - 1.5).abs() < 1e-12);
        }
        // 1, 1, 4 at 1, 2, 4: slopes 0 and 2 between neighbours, 1 by least squares
        let bent = [[1.0, 1.0], [2.0, 1.0], [4.0, 4.0]];
        assert!((order(&bent, &Fit::All).unwrap() - 1.0).abs() < 1e-12);
        assert!(order(&bent, &Fit::Smallest).unwrap().abs() < 1e-12);
        assert!((order(&bent, &Fit::Largest).unwrap() - 2.0).abs() < 1e-12);
        assert!(order(&[[1.0, 0.0], [2.0, 1.0]], &Fit::All).unwrap_err().contains("positive"));
        assert!(order(&[[1.0, 1.0], [1.0, 2.0]], &Fit::All).is_err());
    }
}
