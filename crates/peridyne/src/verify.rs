//! What a deck expects of its own result, measured; and `peridyne verify`, which does so for many decks.

use crate::deck::{At, Deck, DeckErrors, Expectation, FieldComponent, Measured, Moment, Norm, Reduction};
use crate::problem::Problem;
use crate::run::{self, Progress, Target};
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

    /// When it is due; `None` at the end.
    pub(crate) fn time(&self) -> Option<f64> {
        match self.expectation.moment() {
            Moment::At(q) => Some(q.value),
            _ => None,
        }
    }

    fn name(&self) -> String {
        if let Some(name) = &self.expectation.name {
            return name.value.clone();
        }
        let what = match &self.measured {
            Measured::Quantity(q) => q.value.clone(),
            Measured::Expression(e) => e.value.clone(),
            Measured::FieldAt(f, at) => format!("{f} at {:?}", &at.point()[..]),
            Measured::FieldOver(f, set, reduce) => format!("{} {f} over {}", reduce.name(), set.value),
            Measured::Error(e) => format!("{} error of {}", e.norm.name(), e.field),
        };
        match (&self.expectation.at, self.time()) {
            (Some(At::Time(_)), Some(t)) | (None, Some(t)) => format!("{what} at {t:e}"),
            _ => what,
        }
    }

    /// A run that ended before its time.
    pub(crate) fn missing(self) -> Measurement {
        self.judge(Err("the run ended before".into()), &BTreeMap::new())
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
                let deviations = set(&e.over.value).into_iter().map(|p| {
                    let x = problem.cloud.position[p];
                    (values[user(p)] - e.against.eval(x, t), problem.cloud.volume[p])
                });
                Ok(match e.norm {
                    Norm::L2 => deviations.map(|(d, v)| d * d * v).sum::<f64>().sqrt(),
                    Norm::Max => deviations.fold(0.0f64, |m, (d, _)| m.max(d.abs())),
                })
            }
        };
        self.judge(computed, scalars)
    }

    fn judge(&self, computed: Result<f64, String>, _: &BTreeMap<String, f64>) -> Measurement {
        let e = self.expectation;
        let (reference, tolerance) = match (&e.value, &e.between) {
            (_, Some([low, high])) => (0.5 * (low.value + high.value), 0.5 * (high.value - low.value)),
            (Some(v), _) => {
                let relative = e.tolerance.map_or(0.0, |t| t.value * v.value.abs());
                (v.value, relative.max(e.absolute.map_or(0.0, |a| a.value)))
            }
            _ => (f64::NAN, 0.0),
        };
        let source = e.source.as_ref().map_or_else(String::new, |s| s.value.clone());
        let (value, problem) = match computed {
            Ok(v) => (v, None),
            Err(why) => (f64::NAN, Some(why)),
        };
        // a NaN never passes
        let passed = (value - reference).abs() <= tolerance;
        Measurement { quantity: self.name(), computed: value, reference, tolerance, source, passed, problem }
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
    }
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
    let verdict = |quantity: &str, problem: String| Verdict {
        deck: shown.clone(),
        run: run.into(),
        quantity: quantity.into(),
        computed: f64::NAN,
        reference: f64::NAN,
        tolerance: 0.0,
        source: String::new(),
        passed: false,
        problem: Some(problem),
    };
    match run::run(deck, &Target::Nowhere, progress, cancel) {
        Ok(outcome) => {
            let mut verdicts: Vec<Verdict> = outcome
                .measurements
                .into_iter()
                .map(|m| Verdict {
                    deck: shown.clone(),
                    run: run.into(),
                    quantity: m.quantity,
                    computed: m.computed,
                    reference: m.reference,
                    tolerance: m.tolerance,
                    source: m.source,
                    passed: m.passed,
                    problem: m.problem,
                })
                .collect();
            if let crate::output::summary::Exit::Stopped { reason, .. } = outcome.summary.exit {
                verdicts.push(verdict("run completes", reason));
            }
            Ok(verdicts)
        }
        Err(run::RunError::Deck(e)) => Err(e),
        Err(e) => Ok(vec![verdict("run completes", e.to_string())]),
    }
}
