//! The combinations of a study: their names and values, and whether what the deck says of them fits.
use super::report::{Issue, suggest};
use super::source::Span;
use super::tree::{Content, Entry, Node};
use super::types::*;
use super::{DEFAULT_RUN, Parameters, Sections, Text};
use std::collections::BTreeSet;

/// More runs than any study needs.
const MOST: usize = 10_000;
/// Longer values are shortened in names.
const LONGEST: usize = 48;

/// One combination as the deck lists it.
#[derive(Debug, Clone)]
pub(crate) struct Listed {
    /// Its name: run and values, such as `wan,m=2.1`.
    pub name: String,
    /// The run that is varied; `None` for the deck as it is written.
    pub run: Option<String>,
    /// The values of the parameters.
    pub values: Vec<Entry>,
}

/// Whether the deck has a study; figures alone are those of a study that varies nothing.
pub(crate) fn has_study(tree: &Node) -> bool {
    ["study", "figures"].iter().any(|key| tree.get(key).is_some_and(|node| !node.is_null()))
}

/// Lists all combinations, and notes what is wrong with the lists.
pub(crate) fn list(tree: &Node, parameters: &[Entry], issues: &mut Vec<Issue>) -> Vec<Listed> {
    if !has_study(tree) {
        return vec![];
    }
    let study = tree.get("study");
    let key = |name: &str| study.and_then(|node| node.get(name)).filter(|node| !node.is_null());
    let vary = key("vary").map_or(&[] as &[Entry], Node::entries);
    let runs = runs(tree, key("runs"), study.is_none_or(Node::is_null), issues);
    let mut lists: Vec<(&Entry, &[Node])> = vec![];
    let mut sound = true;
    for entry in vary {
        if !parameters.iter().any(|parameter| parameter.key == entry.key) {
            let names: Vec<&str> = parameters.iter().map(|entry| entry.key.as_str()).collect();
            let help = if names.is_empty() { "name it under `parameters:` first".into() } else { suggest(&entry.key, names) };
            issues.push(Issue::new(entry.key_span, format!("the deck has no parameter `{}`", entry.key), help));
        }
        match &entry.value.content {
            Content::List(items) if items.is_empty() => {
                let help = format!("write for example `{}: [1, 2, 4]`", entry.key);
                issues.push(Issue::new(entry.value.span, format!("the list of values of `{}` is empty", entry.key), help));
                sound = false;
            }
            Content::List(items) => lists.push((entry, items)),
            // told when it is read
            _ => sound = false,
        }
    }
    let zip = key("combine").and_then(Node::as_scalar).is_some_and(|scalar| scalar.text == "zip");
    let rows: Vec<Vec<usize>> = if zip {
        let length = lists.first().map_or(1, |list| list.1.len());
        for (entry, items) in lists.iter().filter(|list| list.1.len() != length) {
            let (count, first) = (items.len(), &lists[0].0.key);
            let message = format!("`{}` has {count} values, but `{first}` has {length}", entry.key);
            issues.push(Issue::new(entry.value.span, message, "give lists that are zipped the same length"));
            sound = false;
        }
        (0..length).map(|row| vec![row; lists.len()]).collect()
    } else {
        let count = lists.iter().fold(1usize, |n, list| n.saturating_mul(list.1.len()));
        if count.saturating_mul(runs.len()) > MOST {
            let span = vary.first().map_or(tree.span, |entry| entry.key_span);
            issues.push(Issue::new(span, format!("the study has {count} combinations"), format!("at most {MOST} are possible")));
            sound = false;
        }
        if sound { crossed(&lists.iter().map(|list| list.1.len()).collect::<Vec<_>>()) } else { vec![] }
    };
    if !sound {
        return vec![];
    }
    let mut all: Vec<Listed> = vec![];
    for run in &runs {
        for row in &rows {
            let values: Vec<Entry> = lists
                .iter()
                .zip(row)
                .map(|((entry, items), &k)| Entry { key: entry.key.clone(), key_span: items[k].span, value: items[k].clone() })
                .collect();
            let parts = run.iter().map(|name| clean(name)).chain(values.iter().map(|e| format!("{}={}", e.key, clean(&e.value.text()))));
            let mut name = parts.collect::<Vec<_>>().join(",");
            if name.is_empty() {
                name = DEFAULT_RUN.into();
            }
            // values that differ in signs only, or beyond what a name shows
            let same = all.iter().filter(|other| other.name == name || other.name.starts_with(&format!("{name},no=")));
            let count = same.count();
            if count > 0 {
                name = format!("{name},no={}", count + 1);
            }
            all.push(Listed { name, run: run.clone(), values });
        }
    }
    all
}

/// All tuples of indices below `lengths`, the last changing fastest.
fn crossed(lengths: &[usize]) -> Vec<Vec<usize>> {
    lengths.iter().fold(vec![vec![]], |rows, &length| {
        rows.iter().flat_map(|row| (0..length).map(move |k| row.iter().copied().chain([k]).collect())).collect()
    })
}

/// The runs that are varied.
fn runs(tree: &Node, chosen: Option<&Node>, implied: bool, issues: &mut Vec<Issue>) -> Vec<Option<String>> {
    let known: Vec<&str> = tree.get("runs").map_or(&[] as &[Entry], Node::entries).iter().map(|entry| entry.key.as_str()).collect();
    let all = || known.iter().map(|name| Some(name.to_string())).collect::<Vec<_>>();
    let names: Vec<&Node> = match chosen.map(|node| (&node.content, node)) {
        // figures without a study show the runs of the deck
        None if implied && !known.is_empty() => return all(),
        None => return vec![None],
        Some((Content::List(items), _)) => items.iter().collect(),
        Some((_, node)) => vec![node],
    };
    let mut found = vec![];
    for node in names {
        match node.as_scalar().map(|scalar| scalar.text.as_str()) {
            Some("all") if !known.is_empty() => return all(),
            Some(name) if known.contains(&name) => found.push(Some(name.to_string())),
            Some(name) => {
                let help = if known.is_empty() { "the deck has no `runs`".into() } else { suggest(name, known.iter().copied()) };
                issues.push(Issue::new(node.span, format!("the deck has no run `{name}`"), help));
            }
            // told when it is read
            None => {}
        }
    }
    if found.is_empty() { vec![None] } else { found }
}

/// A value as part of a name: what a folder can be called.
fn clean(text: &str) -> String {
    let mut out = String::new();
    for c in text.trim().chars().take(LONGEST) {
        if c.is_alphanumeric() || matches!(c, '.' | '+' | '-' | '_') {
            out.push(c);
        } else if !out.ends_with('_') && !out.is_empty() {
            out.push('_');
        }
    }
    let out = out.trim_end_matches('_').trim_start_matches('.');
    if out.is_empty() { "_".into() } else { out.into() }
}

/// Whether the combination `name` has all parts of `wanted`.
pub(crate) fn chooses(wanted: &str, name: &str) -> bool {
    wanted == "all"
        || wanted == name
        || wanted.split(',').all(|part| {
            let part = match part.split_once('=') {
                Some((key, value)) => format!("{}={}", key.trim(), clean(value)),
                None => clean(part),
            };
            name.split(',').any(|own| own == part)
        })
}

impl Selection {
    /// Whether the combination `name` is chosen.
    pub fn holds(&self, name: &str) -> bool {
        self.0.iter().any(|part| chooses(&part.value, name))
    }
}

/// What names in the study and its figures may stand for.
struct Known<'a> {
    names: Vec<&'a str>,
    parameters: Vec<&'a str>,
    texts: Vec<&'a str>,
    history: Vec<String>,
    measured: BTreeSet<String>,
}

/// Notes what the study and the figures name although it does not exist.
pub(crate) fn check(deck: &Sections, all: &[Listed], parameters: &Parameters, issues: &mut Vec<Issue>) {
    if all.is_empty() {
        return;
    }
    let mut measured: BTreeSet<String> = deck.expect.iter().map(Expectation::label).collect();
    measured.extend(deck.runs.iter().flat_map(|(_, run)| run.expect.iter().map(Expectation::label)));
    if let Some(study) = &deck.study {
        measured.extend(study.measure.iter().map(|measure| measure.0.label()));
        measured.extend(study.combinations.iter().flat_map(|(_, own)| own.expect.iter().map(Expectation::label)));
    }
    let known = Known {
        names: all.iter().map(|one| one.name.as_str()).collect(),
        parameters: parameters.numbers().map(|(name, _)| name).collect(),
        texts: parameters.iter().map(|parameter| parameter.name.as_str()).collect(),
        history: history_columns(deck),
        measured,
    };
    if let Some(study) = &deck.study {
        known.study(study, issues);
    }
    let mut files: Vec<&str> = vec![];
    for figure in &deck.figures {
        let file = figure.file();
        if files.contains(&file.value.as_str()) {
            issues.push(Issue::new(file.span, format!("two figures are called `{}`", file.value), "choose another name"));
        }
        files.push(&file.value);
        match figure {
            Figure::Lines(lines) => lines.curves.iter().for_each(|curve| known.curve(curve, issues)),
            Figure::Fields(fields) => {
                known.selection(&fields.runs, issues);
                known.template(fields.label.as_ref(), issues);
            }
        }
    }
}

impl Known<'_> {
    fn study(&self, study: &Study, issues: &mut Vec<Issue>) {
        let mut columns: Vec<&str> = vec![];
        for measure in &study.measure {
            if let Some(name) = &measure.0.name {
                if columns.contains(&name.value.as_str()) {
                    issues.push(Issue::new(name.span, format!("two measures are called `{}`", name.value), "choose another name"));
                }
                columns.push(&name.value);
            }
        }
        for (name, _) in study.combinations.iter() {
            self.choice(name, issues);
        }
        for e in &study.expect {
            for quantity in [&e.order, &e.falls, &e.rises, &e.ratio].into_iter().flatten() {
                self.quantity(quantity, issues);
            }
            if let Some(against) = &e.against {
                self.parameter(against, issues);
            }
            self.selection(&e.runs, issues);
            for one in [&e.of, &e.to].into_iter().flatten() {
                self.choice(one, issues);
                let found: Vec<&str> = self.names.iter().copied().filter(|name| chooses(&one.value, name)).collect();
                if found.len() > 1 {
                    let message = format!("`{}` stands for {} combinations: {}", one.value, found.len(), found.join("; "));
                    issues.push(Issue::new(one.span, message, "name one"));
                }
            }
        }
    }

    fn curve(&self, curve: &FigureCurve, issues: &mut Vec<Issue>) {
        if let Some(runs) = &curve.runs {
            self.selection(runs, issues);
        }
        self.template(curve.label.as_ref(), issues);
        if let Some(quantity) = &curve.quantity {
            self.quantity(quantity, issues);
            if let Some(against) = &curve.against {
                self.parameter(against, issues);
            }
        }
        if let Some(column) = &curve.history {
            for column in [Some(column), curve.against.as_ref()].into_iter().flatten() {
                if !self.history.contains(&column.value) {
                    let help = suggest(&column.value, self.history.iter().map(String::as_str));
                    issues.push(Issue::new(column.span, format!("there is no history `{}`", column.value), help));
                }
            }
        }
    }

    fn quantity(&self, name: &Text, issues: &mut Vec<Issue>) {
        if !self.measured.contains(&name.value) && !self.history.contains(&name.value) {
            let names: Vec<&str> = self.measured.iter().chain(&self.history).map(String::as_str).collect();
            let help = format!("{}; or add it to `measure:` of the study", suggest(&name.value, names));
            issues.push(Issue::new(name.span, format!("nothing that is measured is called `{}`", name.value), help));
        }
    }

    fn parameter(&self, name: &Text, issues: &mut Vec<Issue>) {
        if !self.parameters.contains(&name.value.as_str()) {
            let help = suggest(&name.value, self.parameters.iter().copied());
            issues.push(Issue::new(name.span, format!("there is no parameter `{}` that is a number", name.value), help));
        }
    }

    fn selection(&self, selection: &Selection, issues: &mut Vec<Issue>) {
        selection.0.iter().for_each(|part| self.choice(part, issues));
    }

    fn choice(&self, name: &Text, issues: &mut Vec<Issue>) {
        if !self.names.iter().any(|own| chooses(&name.value, own)) {
            let mut parts: Vec<&str> = vec![];
            for part in self.names.iter().flat_map(|own| std::iter::once(*own).chain(own.split(','))) {
                if !parts.contains(&part) {
                    parts.push(part);
                }
            }
            let help = suggest(&name.value, parts);
            issues.push(Issue::new(name.span, format!("the study has no combination `{}`", name.value), help));
        }
    }

    fn template(&self, label: Option<&Text>, issues: &mut Vec<Issue>) {
        for name in label.iter().flat_map(|label| placeholders(&label.value)) {
            if name != "run" && !self.texts.contains(&name) {
                let help = suggest(name, self.texts.iter().copied().chain(["run"]));
                let span = label.map_or(Span::default(), |label| label.span);
                issues.push(Issue::new(span, format!("`{{{name}}}` does not name a parameter"), help));
            }
        }
    }
}

/// The names in braces of a label.
pub(crate) fn placeholders(label: &str) -> Vec<&str> {
    label.split('{').skip(1).filter_map(|rest| rest.split_once('}').map(|pair| pair.0)).collect()
}

/// Columns that every history begins with.
pub(crate) const HISTORY: [&str; 19] = [
    "time",
    "step",
    "energy.kinetic",
    "energy.strain",
    "energy.contact",
    "energy.external_work",
    "energy.total",
    "energy.dissipated",
    "energy.broken_bonds",
    "energy.released",
    "energy.raised",
    "momentum.x",
    "momentum.y",
    "momentum.z",
    "angular_momentum.x",
    "angular_momentum.y",
    "angular_momentum.z",
    "damage.max",
    "damage.broken_bonds",
];

/// The columns of the history of a deck.
fn history_columns(deck: &Sections) -> Vec<String> {
    let measures = deck.output.measures.iter().map(|measure| measure.name.value.clone());
    let acting = deck
        .conditions
        .iter()
        .zip(labels(&deck.conditions))
        .filter(|(c, _)| !matches!(c, Condition::InitialVelocity(_) | Condition::InitialDisplacement(_)))
        .filter(|(c, _)| !matches!(c, Condition::Symmetry(plane) if plane.axis().is_some()));
    let axes = &["x", "y", "z"][..deck.body.dimensions().clamp(1, 3)];
    let reactions = acting.flat_map(|(_, label)| axes.iter().map(move |axis| format!("reaction.{label}.{axis}")));
    let path = matches!(&deck.solver, Solver::Statics(s) if !matches!(s.control, StaticControl::Load));
    HISTORY.map(String::from).into_iter().chain(measures).chain(reactions).chain(path.then(|| "unstable_modes".into())).collect()
}
