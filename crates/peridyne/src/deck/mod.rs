//! The deck: one YAML file of engineering inputs, read into a typed [`Deck`].
//!
//! Nothing physical is computed here. A deck is read in five steps:
//!
//! 1. the text becomes a tree of nodes that know their place (`tree.rs`);
//! 2. the `set` of the chosen run and the overrides replace parameter values, and `${name}` is replaced everywhere;
//! 3. `units` and `parameters` are read (`units.rs`, `parameters.rs`);
//! 4. the tree becomes the types of `types/`, numbers being converted to the units of the deck and expressions being
//!    compiled (`quantity.rs`, `expression.rs`, `decode.rs`);
//! 5. references between sections are checked (`references.rs`).
//!
//! Every step notes faults and goes on, so that a user sees all of them at once, each with file, line, column, key,
//! value and remedy (`report.rs`). Every value keeps its [`Span`], so that later checks can do the same through
//! [`Deck::errors`].
mod combinations;
mod decode;
mod expression;
mod parameters;
mod quantity;
mod reference_page;
mod references;
mod report;
mod schema;
mod source;
mod tree;
mod types;
mod units;

pub(crate) use combinations::{HISTORY, chooses, placeholders};
pub use decode::{Auto, Dictionary, Position, SetName, Spanned, Text};
pub use expression::{Expr, ExpressionError, Scope};
pub use parameters::{Parameter, ParameterValue, Parameters};
pub use quantity::*;
pub use reference_page::{explain, reference_page, similar};
pub use report::{DeckErrors, Fault, Issue};
pub use schema::{schema, starter};
pub use source::{Source, Sources, Span};
pub use types::*;
pub use units::{Dimension, Unit, UnitError, UnitSystem};

use decode::{Context, Decode, section};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use tree::{Content, Entry, Node, Replace, Replacing};

section! {
    /// A peridynamic problem: what the body is, what acts on it, how it is solved, what is written and expected.
    pub struct Sections as "a deck" {
        /// Title, shown in reports and pictures.
        title: Text = "untitled",
        /// Units of plain numbers and of all output: `SI`, `mm-N-MPa`, or a map of base units.
        units: UnitSystem = "SI",
        /// Named values: a number, an expression of earlier parameters, or a text. Usable in every expression, and anywhere as `${name}`.
        parameters: Dictionary<ParameterText> = "{}",
        /// Variants of the deck, by name.
        runs: Dictionary<Run> = "{}",
        /// The discretised body.
        body: Body,
        /// Named sets of points. `all` and the blocks of points exist without being listed.
        sets: Dictionary<PointSet> = "{}",
        /// Materials, by name; together they must cover every point once.
        materials: Dictionary<Material>,
        /// A prescribed temperature.
        temperature: Option<TemperatureField>,
        /// What acts on the body.
        conditions: Vec<Condition> = "[]",
        /// How the problem is advanced.
        solver: Solver,
        /// What is written.
        output: Output = "{}",
        /// Expected results.
        expect: Vec<Expectation> = "[]",
        /// The deck run for several values of its parameters.
        study: Option<Study>,
        /// What is drawn of all runs of the study together. Without a study these are the runs of the deck.
        figures: Vec<Figure> = "[]",
        /// How the deck takes part in `verify`.
        verify: Verify = "{}",
    }
}

section! {
    /// A variant of the deck.
    pub struct Run as "a run" {
        /// Values that replace those of parameters.
        set: Dictionary<ParameterText> = "{}",
        /// Results expected of this run, besides those of the deck.
        expect: Vec<Expectation> = "[]",
        /// Only run by `verify --slow`.
        slow: bool = "false",
    }
}

/// A parameter as typed; [`Deck::parameters`] holds the values.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
#[serde(transparent)]
pub struct ParameterText(pub String);

impl Decode for ParameterText {
    fn decode(node: &Node, _: &mut Context) -> Option<Self> {
        Some(Self(node.text()))
    }
}

/// A deck that has been read without faults.
///
/// Dereferences to its [`Sections`]: `deck.body`, `deck.conditions`, ….
#[derive(Debug, Clone)]
pub struct Deck {
    /// The sections as typed, with defaults filled in.
    pub sections: Sections,
    /// The parameters after overrides.
    pub parameters: Parameters,
    /// The name of the run: `default` unless one was chosen.
    pub run: String,
    /// The name of the combination, where the deck is one of a study.
    pub combination: Option<String>,
    sources: Sources,
    tree: Node,
}

impl Deref for Deck {
    type Target = Sections;

    fn deref(&self) -> &Sections {
        &self.sections
    }
}

/// The name of the only run of a deck without `runs`.
pub const DEFAULT_RUN: &str = "default";

/// One combination of a study.
#[derive(Debug, Clone)]
pub struct Combination {
    /// Its name, such as `m=2.1,n=4`.
    pub name: String,
    /// Whether it is marked slow.
    pub slow: bool,
    /// Names and texts of the values that it sets.
    pub values: Vec<(String, String)>,
    /// The deck with these values.
    pub deck: Deck,
}

/// The decks of a study.
#[derive(Debug, Clone)]
pub struct StudyDecks {
    /// The deck as written.
    pub written: Deck,
    /// All combinations, in order.
    pub combinations: Vec<Combination>,
}

impl Combination {
    /// Whether `wanted` is its name, or parts of it.
    pub fn is_called(&self, wanted: &str) -> bool {
        chooses(wanted, &self.name)
    }
}

impl StudyDecks {
    /// Whether making the study makes this run of the deck, or takes its place.
    pub fn covers(&self, run: &str) -> bool {
        run == DEFAULT_RUN && self.written.runs.is_empty() || self.combinations.iter().any(|one| one.deck.run == run)
    }
}

/// A run that a deck offers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunName {
    /// Its name.
    pub name: String,
    /// Whether it, or the whole deck, is marked slow.
    pub slow: bool,
}

impl Deck {
    /// Reads the deck at `path`. `overrides` are parameter names and texts that replace their values, after those of
    /// the run; `run` names an entry of `runs`, `None` stands for the deck as written.
    ///
    /// # Errors
    /// Every fault of the deck, or why the file cannot be read.
    pub fn load(path: &Path, overrides: &[(String, String)], run: Option<&str>) -> Result<Self, DeckErrors> {
        Self::from_text(read_file(path)?, path, overrides, run)
    }

    /// Reads a deck from `text`, as [`Deck::load`] does; `path` is what messages call it, and its folder is where
    /// relative paths start.
    ///
    /// # Errors
    /// Every fault of the deck.
    pub fn from_text(text: String, path: &Path, overrides: &[(String, String)], run: Option<&str>) -> Result<Self, DeckErrors> {
        Self::read(text, path, overrides, run, None)
    }

    /// Reads a deck; of a study, the combination of that place in its list.
    fn read(
        text: String,
        path: &Path,
        overrides: &[(String, String)],
        run: Option<&str>,
        combination: Option<&combinations::Listed>,
    ) -> Result<Self, DeckErrors> {
        let mut sources = Sources::new(path);
        sources.add(path.display().to_string(), text);
        let mut issues = Vec::new();
        let Some(tree) = top(&sources, &mut issues) else {
            return Err(DeckErrors::new(issues, &sources));
        };
        let changes: Vec<Entry> =
            overrides.iter().filter_map(|(name, text)| read_override(name, text, &mut sources, &mut issues)).collect();

        let mut current = tree.clone();
        let mut parameters = take_parameters(&mut current, &mut issues);
        choose_run(&current, run, &mut parameters, &mut issues);
        let listed = combinations::list(&current, &parameters, &mut issues);
        parameters::apply(&mut parameters, &changes, &mut issues);
        if let Some(one) = combination {
            // names that do not exist were told with the list
            parameters::apply(&mut parameters, &one.values, &mut Vec::new());
        }
        let mut replacing = Replacing { sources: &sources, issues: &mut issues, broken: Vec::new(), placed: 0 };
        replace_all(&mut current, &mut parameters, &mut replacing);
        let broken = replacing.broken;
        let told = issues.len();

        let mut cx = Context {
            units: UnitSystem::si(),
            parameters: Parameters::default(),
            sources,
            issues,
            set_names: set_names(&current),
            dimension: None,
            thin: is_thin(&current),
        };
        if let Some(node) = current.get("units").filter(|node| !node.is_null()) {
            let before = cx.issues.len();
            if let Some(units) = UnitSystem::decode(node, &mut cx) {
                cx.units = units;
            }
            // They are read again, and reported, with the other sections.
            cx.issues.truncate(before);
        }
        parameters::evaluate(&parameters, &broken, &mut cx);
        leave_out_expectations_of_others(&mut current, run, combination);
        cx.dimension = space_dimension(&current, &mut cx);
        let sections = Sections::decode(&current, &mut cx);
        let Context { parameters, sources, mut issues, .. } = cx;
        if let Some(sections) = &sections {
            references::check(sections, &mut issues);
            combinations::check(sections, &listed, &parameters, &mut issues);
        }
        let within = |issue: &Issue, outer: &Span| {
            issue.span.source == outer.source && outer.start <= issue.span.start && issue.span.end <= outer.end
        };
        let later = issues.split_off(told);
        issues.extend(later.into_iter().filter(|issue| !broken.iter().any(|outer| within(issue, outer))));
        match sections {
            Some(sections) if issues.is_empty() => Ok(Self {
                sections,
                parameters,
                run: run.unwrap_or(DEFAULT_RUN).into(),
                combination: combination.map(|one| one.name.clone()),
                sources,
                tree,
            }),
            _ => Err(with_paths(issues, &tree, &sources)),
        }
    }

    /// The deck at `path` as written, and all combinations of its study in order; `None` if it has no study.
    ///
    /// # Errors
    /// Every fault of the deck, and those that only appear in some combinations.
    pub fn study(path: &Path, overrides: &[(String, String)]) -> Result<Option<StudyDecks>, DeckErrors> {
        let text = read_file(path)?;
        let mut sources = Sources::new(path);
        sources.add(path.display().to_string(), text.clone());
        let mut issues = Vec::new();
        let Some(tree) = top(&sources, &mut issues) else {
            return Err(DeckErrors::new(issues, &sources));
        };
        if !combinations::has_study(&tree) {
            return Ok(None);
        }
        let parameters = take_parameters(&mut tree.clone(), &mut Vec::new());
        let listed = combinations::list(&tree, &parameters, &mut Vec::new());
        let mut faults = vec![];
        for (name, text) in overrides.iter().filter(|(name, _)| listed.iter().any(|one| one.values.iter().any(|e| e.key == *name))) {
            let source = sources.add(format!("--set {name}"), text.clone());
            let span = Span { source, start: 0, end: text.len() as u32 };
            let message = format!("the study varies `{name}`, so that it cannot be set");
            let issue = Issue::new(span, message, "choose combinations with `--only`, or a run with `--run`");
            faults.push(DeckErrors::new(vec![issue], &sources));
        }
        let written = Self::from_text(text.clone(), path, overrides, None);
        let mut all = vec![];
        for one in &listed {
            match Self::read(text.clone(), path, overrides, one.run.as_deref(), Some(one)) {
                Ok(deck) => all.push(Combination { name: one.name.clone(), slow: deck.is_slow(), values: texts(&one.values), deck }),
                // what is wrong with the deck as written is told once
                Err(errors) if written.is_ok() => faults.push(errors.of(&one.name)),
                Err(_) => {}
            }
        }
        match written {
            Ok(written) if faults.is_empty() => Ok(Some(StudyDecks { written, combinations: all })),
            Ok(_) => Err(DeckErrors::joined(faults)),
            Err(errors) => Err(DeckErrors::joined([errors].into_iter().chain(faults))),
        }
    }

    /// The runs that the deck at `path` offers, in its order; one called `default` if it lists none.
    ///
    /// # Errors
    /// Why the file cannot be read, or is not YAML; other faults are left to [`Deck::load`].
    pub fn runs(path: &Path) -> Result<Vec<RunName>, DeckErrors> {
        let mut sources = Sources::new(path);
        sources.add(path.display().to_string(), read_file(path)?);
        let mut issues = Vec::new();
        let Some(tree) = top(&sources, &mut issues) else {
            return Err(DeckErrors::new(issues, &sources));
        };
        let slow =
            |node: Option<&Node>| node.and_then(|node| node.get("slow")).and_then(Node::as_scalar).is_some_and(|slow| slow.text == "true");
        let deck_slow = slow(tree.get("verify"));
        let runs = tree.get("runs").map_or(&[] as &[Entry], Node::entries);
        if runs.is_empty() {
            return Ok(vec![RunName { name: DEFAULT_RUN.into(), slow: deck_slow }]);
        }
        Ok(runs.iter().map(|run| RunName { name: run.key.clone(), slow: deck_slow || slow(Some(&run.value)) }).collect())
    }

    /// What is expected of this run: the expectations of the deck, then those of the run, then those of the combination; of these
    /// the ones whose condition holds.
    pub fn expectations(&self) -> impl Iterator<Item = &Expectation> {
        let own = self.sections.runs.get(&self.run).map_or(&[] as &[Expectation], |run| &run.expect);
        let combined = self.settings().flat_map(|settings| &settings.expect);
        self.sections.expect.iter().chain(own).chain(combined).filter(|e| e.when.is_none_or(|when| when.value != 0.0))
    }

    /// What a study measures in this run without expecting it; nothing outside of a study.
    pub fn measures(&self) -> impl Iterator<Item = &Expectation> {
        let study = self.sections.study.as_ref().filter(|_| self.combination.is_some());
        study.into_iter().flat_map(|study| study.measure.iter().map(|measure| &measure.0))
    }

    /// The settings of the study that concern this combination.
    fn settings(&self) -> impl Iterator<Item = &CombinationSettings> {
        let pair = self.sections.study.as_ref().zip(self.combination.as_deref());
        pair.into_iter().flat_map(|(study, own)| {
            study.combinations.iter().filter(move |(name, _)| chooses(&name.value, own)).map(|(_, settings)| settings)
        })
    }

    /// Whether this run, its combination, or the whole deck, is marked slow.
    pub fn is_slow(&self) -> bool {
        self.sections.verify.slow
            || self.sections.runs.get(&self.run).is_some_and(|run| run.slow)
            || self.settings().any(|settings| settings.slow)
    }

    /// The path of the deck.
    pub fn path(&self) -> &Path {
        &self.sources.path
    }

    /// The texts of the deck and of its overrides.
    pub fn sources(&self) -> &Sources {
        &self.sources
    }

    /// A path of the deck as seen from the working folder: relative paths start from the folder of the deck.
    pub fn resolve(&self, path: &str) -> PathBuf {
        self.sources.path.parent().unwrap_or(Path::new("")).join(path)
    }

    /// Faults found by later checks, as one report with places and keys.
    pub fn errors(&self, issues: Vec<Issue>) -> DeckErrors {
        with_paths(issues, &self.tree, &self.sources)
    }

    /// The deck as it is run, as JSON: all defaults filled in, parameters evaluated, `${…}` replaced, numbers in the
    /// units of the deck, the expectations of the run among those of the deck. JSON being YAML, it is itself a deck.
    pub fn resolved(&self) -> serde_json::Value {
        let mut value = serde_json::to_value(&self.sections).unwrap_or_default();
        strip_nulls(&mut value);
        if let Some(map) = value.as_object_mut() {
            for key in ["runs", "study", "figures"] {
                map.remove(key);
            }
            let expectations: Vec<&Expectation> = self.expectations().collect();
            let mut expect = serde_json::to_value(expectations).unwrap_or_default();
            strip_nulls(&mut expect);
            map.insert("expect".into(), expect);
            let parameters = self.parameters.iter().map(|parameter| {
                let value = match parameter.value {
                    ParameterValue::Number(value, _) => value.into(),
                    ParameterValue::Text(_) | ParameterValue::Faulty => parameter.text.clone().into(),
                };
                (parameter.name.clone(), value)
            });
            map.insert("parameters".into(), serde_json::Value::Object(parameters.collect()));
        }
        value
    }
}

fn read_file(path: &Path) -> Result<String, DeckErrors> {
    let bytes = std::fs::read(path).map_err(|error| {
        let help = match error.kind() {
            std::io::ErrorKind::NotFound => "check the path; `peridyne new` writes a deck to start from",
            std::io::ErrorKind::PermissionDenied => "ask for permission to read it",
            _ => "a deck is one text file",
        };
        DeckErrors::of_file(path, format!("cannot be read: {error}"), help)
    })?;
    if bytes.len() > 1 << 28 {
        return Err(DeckErrors::of_file(
            path,
            format!("has {} bytes", bytes.len()),
            "a deck is a text of some lines; put points into a CSV file",
        ));
    }
    String::from_utf8(bytes).map_err(|error| {
        let sound = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = sound.iter().filter(|byte| **byte == b'\n').count() + 1;
        let message = format!("is not UTF-8 text: byte {} in line {line} belongs to no character", sound.len() + 1);
        DeckErrors::of_file(path, message, "save the file as UTF-8; signs such as `µ` and `°` are the usual cause")
    })
}

/// The tree of the deck, whose top must be a map.
fn top(sources: &Sources, issues: &mut Vec<Issue>) -> Option<Node> {
    let tree = tree::read(sources, 0, issues)?;
    if matches!(tree.content, Content::Map(_)) {
        return Some(tree);
    }
    let message =
        if tree.is_null() { "the deck is empty".into() } else { format!("a deck is a map of sections, but {} was found", tree.shown()) };
    issues.push(Issue::new(tree.span, message, "begin with `title:`, `body:`, `materials:`, `solver:`"));
    None
}

/// The names that sets may be called by; `None` if a file may bring more.
fn set_names(tree: &Node) -> Option<Vec<String>> {
    let mut names = vec!["all".to_string()];
    names.extend(tree.get("sets").map_or(&[] as &[Entry], Node::entries).iter().map(|entry| entry.key.clone()));
    if let Some(Content::List(sources)) = tree.get("body").and_then(|body| body.get("points")).map(|points| &points.content) {
        for entry in sources.iter().flat_map(Node::entries) {
            if entry.key == "file" || entry.key == "surface" {
                return None;
            }
            names.extend(entry.value.get("block").and_then(Node::as_scalar).map(|block| block.text.clone()));
        }
    }
    Some(names)
}

/// The dimension of space, needed before the body is read; its faults are told when the body is.
fn space_dimension(tree: &Node, cx: &mut Context) -> Option<usize> {
    let before = cx.issues.len();
    let dimension = tree.get("body").and_then(|body| body.get("dimension")).and_then(|node| Count::decode(node, cx));
    cx.issues.truncate(before);
    dimension.map(|count| count.value as usize).filter(|dimension| (1..=3).contains(dimension))
}

fn texts(entries: &[Entry]) -> Vec<(String, String)> {
    entries.iter().map(|entry| (entry.key.clone(), entry.value.text())).collect()
}

fn read_override(name: &str, text: &str, sources: &mut Sources, issues: &mut Vec<Issue>) -> Option<Entry> {
    let source = sources.add(format!("--set {name}"), text.to_string());
    let value = tree::read(sources, source, issues)?;
    let key_span = Span { source, start: 0, end: text.len() as u32 };
    Some(Entry { key: name.to_string(), key_span, value })
}

/// Takes the entries of `parameters` out of the tree.
fn take_parameters(tree: &mut Node, issues: &mut Vec<Issue>) -> Vec<Entry> {
    match tree.get("parameters") {
        Some(node) if !node.is_null() && !matches!(node.content, Content::Map(_)) => {
            issues.push(Issue::new(
                node.span,
                format!("a map of names is needed here, but {} was found", node.shown()),
                "write `name: value` in the lines below",
            ));
            Vec::new()
        }
        Some(node) => node.entries().to_vec(),
        None => Vec::new(),
    }
}

/// Applies the values that `run` sets.
fn choose_run(tree: &Node, run: Option<&str>, parameters: &mut [Entry], issues: &mut Vec<Issue>) {
    let runs = tree.get("runs").map_or(&[] as &[Entry], Node::entries);
    for entry in runs {
        let set = entry.value.get("set").map_or(&[] as &[Entry], Node::entries);
        // Names are checked for all runs, values taken from one.
        let mut scratch = parameters.to_vec();
        parameters::apply(&mut scratch, set, issues);
        if run == Some(entry.key.as_str()) {
            parameters.clone_from_slice(&scratch);
        }
    }
    if let Some(name) = run.filter(|name| !runs.iter().any(|entry| entry.key == *name))
        && !(name == DEFAULT_RUN && runs.is_empty())
    {
        let span = tree
            .entries()
            .iter()
            .find(|entry| entry.key == "runs")
            .map_or(Span { end: tree.span.start, ..tree.span }, |entry| entry.key_span);
        let help = if runs.is_empty() {
            format!("the deck has no `runs`; its only run is `{DEFAULT_RUN}`")
        } else {
            report::suggest(name, runs.iter().map(|entry| entry.key.as_str()))
        };
        issues.push(Issue::new(span, format!("the deck has no run `{name}`"), help));
    }
}

/// Replaces `${name}` in the parameters, each by those before it, and in all other sections.
/// Whether a material is a beam, plate or shell, which move out of their line or plane.
fn is_thin(tree: &Node) -> bool {
    let models = ["bond_pair_beam", "bond_multiple_plate", "shell"];
    let thin = |material: &Entry| material.value.get("model").is_some_and(|m| models.iter().any(|name| m.get(name).is_some()));
    tree.get("materials").is_some_and(|materials| materials.entries().iter().any(thin))
}

fn replace_all(tree: &mut Node, parameters: &mut [Entry], replacing: &mut Replacing) {
    for index in 0..parameters.len() {
        let (before, rest) = parameters.split_at_mut(index);
        let Some((own, after)) = rest.split_first_mut() else {
            break;
        };
        let find = |name: &str| find_parameter(name, before, after);
        own.value.replace(&find, replacing);
    }
    let find = |name: &str| find_parameter(name, parameters, &[]);
    let Content::Map(sections) = &mut tree.content else {
        return;
    };
    for section in sections {
        match (section.key.as_str(), &mut section.value.content) {
            ("parameters", _) => {}
            ("runs", Content::Map(runs)) => {
                for run in runs {
                    if let Content::Map(parts) = &mut run.value.content {
                        for part in parts.iter_mut().filter(|part| part.key != "set") {
                            part.value.replace(&find, replacing);
                        }
                    }
                }
            }
            // the values of a study stand for those of parameters, and are replaced where these are
            ("study", Content::Map(parts)) => {
                for part in parts.iter_mut().filter(|part| part.key != "vary") {
                    part.value.replace(&find, replacing);
                }
            }
            _ => section.value.replace(&find, replacing),
        }
    }
}

fn find_parameter(name: &str, known: &[Entry], later: &[Entry]) -> Result<Node, Replace> {
    if let Some(entry) = known.iter().find(|entry| entry.key == name) {
        return Ok(entry.value.clone());
    }
    let message = format!("`${{{name}}}` does not name a parameter");
    if later.iter().any(|entry| entry.key == name) {
        return Err(Replace { message, help: format!("`{name}` is defined further down; move it up") });
    }
    let names: Vec<&str> = known.iter().map(|entry| entry.key.as_str()).collect();
    let help = if names.is_empty() { "the deck has no parameters".into() } else { report::suggest(name, names) };
    Err(Replace { message, help })
}

/// Adds the paths of keys to faults that have none.
/// What other runs and combinations expect is written for their own parameters: it is read, and its faults are told, with them.
fn leave_out_expectations_of_others(tree: &mut Node, run: Option<&str>, combination: Option<&combinations::Listed>) {
    fn without(node: Option<&mut Node>, other: impl Fn(&str) -> bool) {
        for entry in node.map_or(&mut [] as &mut [Entry], Node::entries_mut).iter_mut().filter(|entry| other(&entry.key)) {
            entry.value.remove("expect");
        }
    }
    if let Some(own) = run {
        without(tree.get_mut("runs"), |name| name != own);
    }
    if let Some(own) = combination {
        without(tree.get_mut("study").and_then(|study| study.get_mut("combinations")), |name| !chooses(name, &own.name));
    }
}

fn with_paths(mut issues: Vec<Issue>, tree: &Node, sources: &Sources) -> DeckErrors {
    for issue in issues.iter_mut().filter(|issue| issue.path.is_empty()) {
        issue.path = if issue.span.source == 0 { tree.path_of(issue.span) } else { String::new() };
    }
    DeckErrors::new(issues, sources)
}

fn strip_nulls(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Object(map) => {
            map.retain(|_, value| !value.is_null());
            map.values_mut().for_each(strip_nulls);
        }
        serde_json::Value::Array(items) => items.iter_mut().for_each(strip_nulls),
        _ => {}
    }
}

impl Decode for UnitSystem {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        const HELP: &str = "write `SI`, `mm-N-MPa` or `{length: mm, mass: t, time: s, temperature: K}`";
        match &node.content {
            Content::Scalar(scalar) => match scalar.text.as_str() {
                "SI" => Some(Self::si()),
                "mm-N-MPa" => Some(Self::mm_n_mpa()),
                _ => {
                    cx.fault(node.span, format!("{} is not a system of units", node.shown()), HELP);
                    None
                }
            },
            Content::Map(entries) => {
                const KEYS: [&str; 4] = ["mass", "length", "time", "temperature"];
                let mut symbols = ["kg", "m", "s", "K"];
                let mut sound = true;
                for entry in entries {
                    let axis = KEYS.iter().position(|key| *key == entry.key);
                    match (axis, entry.value.as_scalar()) {
                        (Some(axis), Some(scalar)) => symbols[axis] = &scalar.text,
                        (None, _) => {
                            cx.fault(
                                entry.key_span,
                                format!("`{}` is not a key of a system of units", entry.key),
                                report::suggest(&entry.key, KEYS),
                            );
                            sound = false;
                        }
                        (_, None) => {
                            cx.fault(entry.value.span, format!("a unit is needed here, but {} was found", entry.value.shown()), HELP);
                            sound = false;
                        }
                    }
                }
                match Self::new(symbols) {
                    Ok(system) => sound.then_some(system),
                    Err((axis, error)) => {
                        let span = node.get(KEYS[axis]).map_or(node.span, |node| node.span);
                        cx.fault(span, error.message, error.help);
                        None
                    }
                }
            }
            Content::List(_) => {
                cx.fault(node.span, "a system of units is needed here, but a list was found", HELP);
                None
            }
        }
    }
}

impl serde::Serialize for UnitSystem {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let [mass, length, time, temperature] = self.symbols();
        serde_json::json!({"length": length, "mass": mass, "time": time, "temperature": temperature}).serialize(serializer)
    }
}
