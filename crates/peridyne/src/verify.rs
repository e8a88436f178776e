//! What a deck expects of its own result, measured; and `peridyne verify`, which does so for many decks.

use crate::deck::{Deck, DeckErrors, Expectation, FieldComponent, Measured, Moment, Norm, Reduction, StudyDecks};
use crate::problem::Problem;
use crate::run::{self, Progress, Target};
use crate::study;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// An expectation, measured.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// What was measured.
    pub quantity: String,
    /// The result.
    pub computed: f64,
    /// The value expected (the middle, where bounds were given).
    pub reference: f64,
    /// Largest deviation allowed, absolute.
    pub tolerance: f64,
    /// Where the reference comes from.
    pub source: String,
    /// Whether it lies within.
    pub passed: bool,
    /// Why it could not be measured, if so.
    pub problem: Option<String>,
}

/// An expectation that waits for its time.
pub(crate) struct Pending<'a> {
    expectation: &'a Expectation,
    measured: Measured<'a>,
}

impl<'a> Pending<'a> {
    pub(crate) fn new(expectation: &'a Expectation) -> Option<Self> {
        expectation.measured().map(|measured| Pending { expectation, measured })
    }

    /// Whether it has a value; else it is only measured.
    pub(crate) fn is_expected(&self) -> bool {
        self.expectation.value.is_some() || self.expectation.between.is_some()
    }

    /// When it is due; `None` at the end.
    pub(crate) fn time(&self) -> Option<f64> {
        match self.expectation.moment() {
            Moment::At(q) => Some(q.value),
            _ => None,
        }
    }

    /// A run that ended before its time.
    pub(crate) fn missing(self) -> Measurement {
        self.judge(Err("the run ended before".into()))
    }

    /// Measures now. `field` gives a component in the user's order.
    pub(crate) fn measure(
        self,
        problem: &Problem,
        scalars: &BTreeMap<String, f64>,
        earlier: Earlier,
        field: &mut dyn FnMut(&FieldComponent) -> Vec<f64>,
        t: f64,
    ) -> Measurement {
        let set = |name: &str| -> Vec<usize> { problem.set(name).iter().map(|&p| p as usize).collect() };
        let user = |p: usize| problem.user[p] as usize;
        let computed = match &self.measured {
            Measured::Quantity(q) => scalars.get(&q.value).copied().ok_or_else(|| unknown(&q.value, scalars)),
            Measured::Expression(e) => arithmetic(&e.value, problem, scalars, earlier),
            Measured::FieldAt(f, at) => Ok(field(f)[user(problem.nearest(at.point()))]),
            Measured::FieldOver(f, name, reduce) => {
                let values = field(f);
                let points: Vec<(usize, f64)> = set(&name.value).into_iter().map(|p| (p, values[user(p)])).collect();
                Ok(reduced(problem, &points, reduce, self.expectation.above.map(|a| a.value)))
            }
            Measured::Error(e) => {
                let values = field(&e.field);
                let points = problem.set(&e.over.value);
                problem.reference(e, points, t).map(|reference| {
                    let pairs =
                        || points.iter().zip(&reference).map(|(&p, r)| (values[user(p as usize)] - r, problem.cloud.volume[p as usize], r));
                    let square = || pairs().map(|(d, v, _)| d * d * v).sum::<f64>();
                    match e.norm {
                        Norm::L2 => square().sqrt(),
                        Norm::RelativeL2 => (square() / pairs().map(|(_, v, r)| r * r * v).sum::<f64>()).sqrt(),
                        // a NaN must not get lost
                        Norm::Max => pairs().fold(0.0f64, |m, (d, ..)| if d.is_nan() { d } else { m.max(d.abs()) }),
                    }
                })
            }
        };
        self.judge(computed)
    }

    fn judge(&self, computed: Result<f64, String>) -> Measurement {
        let e = self.expectation;
        let between = e.between.map(|b| b.map(|q| q.value));
        let (reference, tolerance) =
            reference(e.value.map(|q| q.value), e.tolerance.map(|q| q.value), e.absolute.map(|q| q.value), between);
        let source = e.source.as_ref().map_or_else(String::new, |s| s.value.clone());
        let (value, problem) = match computed {
            Ok(v) => (v, None),
            Err(why) => (f64::NAN, Some(why)),
        };
        // a NaN never passes
        let passed = (value - reference).abs() <= tolerance;
        Measurement { quantity: e.label(), computed: value, reference, tolerance, source, passed, problem }
    }
}

/// The value expected, and the largest deviation: of a value, or of bounds.
pub(crate) fn reference(value: Option<f64>, tolerance: Option<f64>, absolute: Option<f64>, between: Option<[f64; 2]>) -> (f64, f64) {
    match (value, between) {
        (_, Some([low, high])) => (0.5 * (low + high), 0.5 * (high - low)),
        (Some(v), _) => (v, tolerance.map_or(0.0, |t| t * v.abs()).max(absolute.unwrap_or(0.0))),
        _ => (f64::NAN, 0.0),
    }
}

/// A field reduced to a number over some points (sorted index and value); `above` picks the points that some reductions
/// look at.
pub(crate) fn reduced(problem: &Problem, points: &[(usize, f64)], reduce: &Reduction, above: Option<f64>) -> f64 {
    let n = points.len() as f64;
    let picked = || points.iter().filter(|p| above.is_none_or(|a| p.1 > a)).map(|p| p.0);
    let extent = |k: usize| picked().map(|p| problem.cloud.position[p][k]).fold(f64::NEG_INFINITY, f64::max);
    match reduce {
        Reduction::Max => points.iter().fold(f64::NEG_INFINITY, |m, x| m.max(x.1)),
        Reduction::Min => points.iter().fold(f64::INFINITY, |m, x| m.min(x.1)),
        Reduction::Mean => points.iter().map(|x| x.1).sum::<f64>() / n,
        Reduction::Sum => points.iter().map(|x| x.1).sum(),
        Reduction::Rms => (points.iter().map(|x| x.1 * x.1).sum::<f64>() / n).sqrt(),
        Reduction::MaxAbs => points.iter().fold(0.0f64, |m, x| m.max(x.1.abs())),
        Reduction::Integral => points.iter().map(|x| x.1 * problem.cloud.volume[x.0]).sum(),
        Reduction::Count => picked().count() as f64,
        Reduction::ExtentX => extent(0),
        Reduction::ExtentY => extent(1),
        Reduction::ExtentZ => extent(2),
        Reduction::LineAngle => {
            // direction of the largest second moment of the picked points in the plane of x and y
            let list: Vec<[f64; 3]> = picked().map(|p| problem.cloud.position[p]).collect();
            let m = list.len() as f64;
            let mean = |k: usize| list.iter().map(|x| x[k]).sum::<f64>() / m;
            let (a, b) = (mean(0), mean(1));
            let (xx, yy, xy) = list.iter().fold((0.0, 0.0, 0.0), |s, x| {
                let (u, v) = (x[0] - a, x[1] - b);
                (s.0 + u * u, s.1 + v * v, s.2 + u * v)
            });
            (0.5 * f64::atan2(2.0 * xy, xx - yy)).to_degrees()
        }
        Reduction::TotalVariation => rows(problem, points).iter().map(|row| row.windows(2).map(|w| (w[1] - w[0]).abs()).sum::<f64>()).sum(),
        Reduction::Rough3 => {
            let rows = rows(problem, points);
            let thirds = rows.iter().flat_map(|row| row.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]) / 8.0));
            let (sum, count) = thirds.fold((0.0, 0.0), |(s, n), d| (s + d * d, n + 1.0));
            (sum / count).sqrt()
        }
    }
}

/// Values along the rows of points in x direction: neighbours in a row lie less than one and a half spacings apart in x, and less
/// than a quarter of one in the other directions.
fn rows(problem: &Problem, points: &[(usize, f64)]) -> Vec<Vec<f64>> {
    let cloud = &problem.cloud;
    let mut order: Vec<&(usize, f64)> = points.iter().collect();
    // directions across the rows first: levels are numbered, so that round-off in a coordinate does not tear a row apart
    let level = |k: usize| -> Vec<usize> {
        let mut by: Vec<usize> = points.iter().map(|p| p.0).collect();
        by.sort_by(|&a, &b| cloud.position[a][k].total_cmp(&cloud.position[b][k]).then(a.cmp(&b)));
        let mut level = vec![0; cloud.len()];
        for pair in by.windows(2) {
            let apart = cloud.position[pair[1]][k] - cloud.position[pair[0]][k] > 0.25 * cloud.spacing[pair[1]];
            level[pair[1]] = level[pair[0]] + usize::from(apart);
        }
        level
    };
    let (y, z) = (level(1), level(2));
    let x = |p: usize| cloud.position[p][0];
    order.sort_by(|a, b| (z[a.0], y[a.0]).cmp(&(z[b.0], y[b.0])).then(x(a.0).total_cmp(&x(b.0))));
    let mut rows: Vec<Vec<f64>> = vec![];
    let mut former: Option<usize> = None;
    for &&(p, value) in &order {
        let joined = former.is_some_and(|q| y[q] == y[p] && z[q] == z[p] && x(p) - x(q) < 1.5 * cloud.spacing[p]);
        match rows.last_mut() {
            Some(row) if joined => row.push(value),
            _ => rows.push(vec![value]),
        }
        former = Some(p);
    }
    rows
}

fn unknown(name: &str, scalars: &BTreeMap<String, f64>) -> String {
    let best = scalars.keys().max_by(|a, b| strsim::jaro_winkler(a, name).total_cmp(&strsim::jaro_winkler(b, name)));
    format!("there is no quantity `{name}`; did you mean `{}`?", best.map_or("", String::as_str))
}

/// A scalar quantity at the row of the histories nearest to a time.
pub(crate) type Earlier<'a> = &'a dyn Fn(&str, f64) -> Option<f64>;

/// Arithmetic over scalar quantities: names are replaced by values, `name@1e-5` by the value at that time.
fn arithmetic(text: &str, problem: &Problem, scalars: &BTreeMap<String, f64>, earlier: Earlier) -> Result<f64, String> {
    let part_of_name = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
    let mut filled = String::new();
    let mut rest = text;
    while let Some(start) = rest.find(|c: char| c.is_alphabetic() || c == '_') {
        let length = rest[start..].find(|c: char| !part_of_name(c)).unwrap_or(rest.len() - start);
        let (before, name) = (&rest[..start], &rest[start..start + length]);
        filled.push_str(before);
        rest = &rest[start + length..];
        // a letter right after a digit is the exponent of a number
        let exponent = before.ends_with(|c: char| c.is_ascii_digit() || c == '.');
        if let Some(time) = rest.strip_prefix('@') {
            let length = number_length(time);
            let at: f64 = time[..length].parse().map_err(|_| format!("after `{name}@` a time is needed, as in `{name}@1e-5`"))?;
            let value = earlier(name, at).ok_or_else(|| unknown(name, scalars))?;
            filled.push_str(&format!("({value:e})"));
            rest = &time[length..];
        } else {
            match scalars.get(name) {
                Some(value) if !exponent => filled.push_str(&format!("({value:e})")),
                _ => filled.push_str(name),
            }
        }
    }
    filled.push_str(rest);
    let parsed = crate::deck::Expr::parse(&filled, &[], &problem.deck.parameters)
        .map_err(|e| e.first().map_or_else(String::new, |e| e.message.clone()))?;
    parsed.constant().ok_or_else(|| "the expression has no value".into())
}

/// Length of the number at the start of a text.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    (0..bytes.len())
        .take_while(|&k| match bytes[k] {
            b'0'..=b'9' | b'.' => true,
            b'e' | b'E' => k > 0,
            b'-' | b'+' => k == 0 || matches!(bytes[k - 1], b'e' | b'E'),
            _ => false,
        })
        .count()
}

/// One line of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    /// The deck.
    pub deck: String,
    /// Its run.
    pub run: String,
    /// What was measured.
    pub quantity: String,
    /// The result.
    pub computed: f64,
    /// The value expected.
    pub reference: f64,
    /// Largest deviation allowed, absolute.
    pub tolerance: f64,
    /// Where the reference comes from.
    pub source: String,
    /// Whether it lies within.
    pub passed: bool,
    /// Why it could not be measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
}

/// What `--json` writes.
#[derive(Debug, Serialize)]
pub struct Report {
    /// All verdicts.
    pub results: Vec<Verdict>,
}

/// The decks under the given paths: files as they are, folders searched, in alphabetical order.
pub fn find(paths: &[PathBuf]) -> std::io::Result<Vec<PathBuf>> {
    let mut found = vec![];
    for path in paths {
        collect(path, &mut found)?;
    }
    Ok(found)
}

fn collect(path: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if !path.is_dir() {
        found.push(path.to_path_buf());
        return Ok(());
    }
    let mut entries: Vec<PathBuf> = std::fs::read_dir(path)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    entries.sort();
    for e in entries {
        if e.is_dir() {
            collect(&e, found)?;
        } else if e.extension().is_some_and(|x| x == "yaml" || x == "yml") {
            found.push(e);
        }
    }
    Ok(())
}

/// Runs one run of one deck and returns its verdicts; a deck without expectations gives none.
///
/// # Errors
/// The faults of the deck.
pub fn verify(
    path: &Path,
    run: &str,
    only: Option<&str>,
    progress: &mut dyn Progress,
    cancel: &AtomicBool,
) -> Result<Vec<Verdict>, DeckErrors> {
    let deck = Deck::load(path, &[], only)?;
    if deck.expectations().next().is_none() {
        return Ok(vec![]);
    }
    let shown = path.display().to_string();
    match run::run(deck, &Target::Nowhere, progress, cancel) {
        Ok(outcome) => {
            let mut verdicts = verdicts(&shown, run, outcome.measurements);
            if let crate::output::summary::Exit::Stopped { reason, .. } = outcome.summary.exit {
                verdicts.push(incomplete(&shown, run, reason));
            }
            Ok(verdicts)
        }
        Err(run::RunError::Deck(e)) => Err(e),
        Err(e) => Ok(vec![incomplete(&shown, run, e.to_string())]),
    }
}

fn verdicts(deck: &str, run: &str, measurements: Vec<Measurement>) -> Vec<Verdict> {
    let verdict = |m: Measurement| Verdict {
        deck: deck.into(),
        run: run.into(),
        quantity: m.quantity,
        computed: m.computed,
        reference: m.reference,
        tolerance: m.tolerance,
        source: m.source,
        passed: m.passed,
        problem: m.problem,
    };
    measurements.into_iter().map(verdict).collect()
}

/// The verdict on a run that did not reach its end.
fn incomplete(deck: &str, run: &str, why: String) -> Verdict {
    Verdict {
        deck: deck.into(),
        run: run.into(),
        quantity: "run completes".into(),
        computed: f64::NAN,
        reference: f64::NAN,
        tolerance: 0.0,
        source: String::new(),
        passed: false,
        problem: Some(why),
    }
}

/// The name under which what is expected of all combinations together is reported.
pub const STUDY: &str = "study";

/// Hears the verdicts on one combination: its name, the seconds it took, and the verdicts.
pub type Told<'a> = &'a mut dyn FnMut(&str, Option<f64>, Vec<Verdict>);

/// Tells verdicts as soon as they are there.
struct Teller<'a, 'b> {
    deck: String,
    told: &'a mut Told<'b>,
}

impl Progress for Teller<'_, '_> {
    fn at(&mut self, _: f64, _: &str) {}
}

impl study::Listener for Teller<'_, '_> {
    fn begins(&mut self, _: usize, _: usize, _: &str) {}

    fn ends(&mut self, made: &study::Made, _: &run::Outcome) {
        let mut all = verdicts(&self.deck, &made.name, made.measurements.clone());
        all.extend(made.stopped.clone().map(|why| incomplete(&self.deck, &made.name, why)));
        (self.told)(&made.name, Some(made.seconds), all);
    }
}

/// Runs the combinations of a study and tells the verdicts on each, then those on all of them together. Slow combinations are run if
/// asked for; without them, what needs them is left out.
///
/// # Errors
/// The faults of the deck.
pub fn verify_study(path: &Path, study: &StudyDecks, slow: bool, mut told: Told, cancel: &AtomicBool) -> Result<(), DeckErrors> {
    let together = study.written.study.as_ref().is_some_and(|own| !own.expect.is_empty());
    if !together && study.combinations.iter().all(|one| one.deck.expectations().next().is_none()) {
        return Ok(());
    }
    let deck = path.display().to_string();
    let mut teller = Teller { deck: deck.clone(), told: &mut told };
    match study::run(study, None, &|one| slow || !one.slow, &mut teller, cancel) {
        Ok(outcome) => told(STUDY, None, verdicts(&deck, STUDY, outcome.measurements)),
        Err(run::RunError::Deck(e)) => return Err(e),
        Err(e) => told(STUDY, None, vec![incomplete(&deck, STUDY, e.to_string())]),
    }
    Ok(())
}
