//! What is wrong with a deck: every fault at once, each with its place, its key, and a remedy.
use super::source::{Sources, Span};
use std::fmt;
use std::sync::Arc;

/// One fault of a deck, as found; [`DeckErrors`] adds the texts to show it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Issue {
    /// Where.
    pub span: Span,
    /// Dotted path of the key, such as `body.points[0].rectangle.spacing`; empty if there is none.
    pub path: String,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: String,
}

impl Issue {
    /// A fault at `span`: what is wrong, and what would be right.
    pub fn new(span: Span, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { span, path: String::new(), message: message.into(), help: help.into() }
    }
}

/// All faults of one deck, in the order of the text.
///
/// `Display` prints the whole report, one block per fault, with file, line, column and the line itself;
/// `miette::Diagnostic` offers the same to a terminal renderer.
#[derive(Debug, Clone)]
pub struct DeckErrors {
    faults: Vec<Fault>,
}

/// One fault together with the text in which it lies.
#[derive(Debug, Clone)]
pub struct Fault {
    /// The fault.
    pub issue: Issue,
    /// File, or `--set name`.
    pub file: String,
    /// Line, from 1; 0 if the fault concerns the file as a whole.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    text: miette::NamedSource<Arc<str>>,
    snippet: String,
    width: usize,
}

impl DeckErrors {
    /// Sorts `issues` by place and joins them with the texts they point into.
    pub(crate) fn new(mut issues: Vec<Issue>, sources: &Sources) -> Self {
        issues.sort_by_key(|issue| (issue.span.source, issue.span.start));
        issues.dedup();
        let mut texts: Vec<Option<Arc<str>>> = Vec::new();
        let mut faults = Vec::with_capacity(issues.len());
        for issue in issues {
            let index = issue.span.source as usize;
            if texts.len() <= index {
                texts.resize(index + 1, None);
            }
            let text =
                texts[index].get_or_insert_with(|| sources.get(issue.span).map_or("".into(), |source| source.text.as_str().into())).clone();
            let file = sources.get(issue.span).map_or_else(|| sources.path.display().to_string(), |source| source.name.clone());
            let (line, column) = sources.line_column(issue.span);
            let first_line = sources.slice(issue.span).lines().next().unwrap_or("").trim_end();
            faults.push(Fault {
                snippet: sources.line(issue.span).to_string(),
                width: first_line.chars().count().max(1),
                text: miette::NamedSource::new(&file, text),
                issue,
                file,
                line,
                column,
            });
        }
        Self { faults }
    }

    /// The same faults, told to be those of one combination of a study.
    pub(crate) fn of(mut self, combination: &str) -> Self {
        for fault in &mut self.faults {
            fault.issue.message.push_str(&format!(" (in the combination {combination})"));
        }
        self
    }

    /// All faults of several reports on the same deck.
    pub(crate) fn joined(all: impl IntoIterator<Item = Self>) -> Self {
        let mut faults: Vec<Fault> = vec![];
        for report in all {
            let told = faults.len();
            for fault in report.faults {
                // the same place is at fault in many combinations: told for the first
                if !faults[..told].iter().any(|other| other.file == fault.file && other.issue.span == fault.issue.span) {
                    faults.push(fault);
                }
            }
        }
        faults.sort_by_key(|fault| (fault.issue.span.source, fault.issue.span.start));
        Self { faults }
    }

    /// A fault of the file as a whole.
    pub(crate) fn of_file(path: &std::path::Path, message: String, help: &str) -> Self {
        let file = path.display().to_string();
        let text = miette::NamedSource::new(&file, Arc::from(""));
        let issue = Issue::new(Span::default(), message, help);
        Self { faults: vec![Fault { issue, file, line: 0, column: 0, text, snippet: String::new(), width: 0 }] }
    }

    /// The faults, in the order of the text.
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }
}

impl fmt::Display for DeckErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, fault) in self.faults.iter().enumerate() {
            if index > 0 {
                writeln!(f, "\n")?;
            }
            write!(f, "{fault}")?;
        }
        Ok(())
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let issue = &self.issue;
        write!(f, "{}", self.file)?;
        if self.line > 0 {
            write!(f, ":{}:{}", self.line, self.column)?;
        }
        write!(f, ": ")?;
        if !issue.path.is_empty() {
            write!(f, "{}: ", issue.path)?;
        }
        write!(f, "{}", issue.message)?;
        if self.line > 0 {
            let number = self.line.to_string();
            let margin = " ".repeat(number.len());
            // Tabs are kept, so that the marks stand under the text on any terminal.
            let lead: String = self.snippet.chars().take(self.column - 1).map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
            write!(f, "\n {number} | {}", self.snippet.trim_end())?;
            write!(f, "\n {margin} | {lead}{}", "^".repeat(self.width))?;
        }
        if !issue.help.is_empty() {
            write!(f, "\n   help: {}", issue.help)?;
        }
        Ok(())
    }
}

impl std::error::Error for DeckErrors {}
impl std::error::Error for Fault {}

impl miette::Diagnostic for Fault {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        (!self.issue.help.is_empty()).then(|| Box::new(&self.issue.help) as _)
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        (self.line > 0).then_some(&self.text as _)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        if self.line == 0 {
            return None;
        }
        let span = self.issue.span;
        let range = span.start as usize..span.end.max(span.start) as usize;
        Some(Box::new(std::iter::once(miette::LabeledSpan::at(range, &self.issue.message))))
    }
}

impl miette::Diagnostic for DeckErrors {
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn miette::Diagnostic> + 'a>> {
        Some(Box::new(self.faults.iter().map(|fault| fault as &dyn miette::Diagnostic)))
    }
}

/// The names of `known` nearest to `name`, all equally near; empty if none is near enough to be what was meant.
fn nearest_all<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let lower = name.to_lowercase();
    let length = name.chars().count();
    let mut best = usize::MAX;
    let mut names = Vec::new();
    for candidate in known {
        let distance = strsim::damerau_levenshtein(&lower, &candidate.to_lowercase());
        let longer = candidate.chars().count().max(length);
        // A third of the letters may differ; two single letters have nothing in common.
        if distance > (longer / 3).max(1) || distance >= longer || distance > best {
            continue;
        }
        if distance < best {
            names.clear();
            best = distance;
        }
        if !names.contains(&candidate) {
            names.push(candidate);
        }
    }
    names
}

/// The name of `known` nearest to `name`, if one is near enough to be what was meant.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    nearest_all(name, known).first().copied()
}

/// `did you mean …?` if names are near, else the list of all that is known.
pub(crate) fn suggest<'a>(name: &str, known: impl IntoIterator<Item = &'a str> + Clone) -> String {
    let quoted = |name: &str| format!("`{name}`");
    let near = nearest_all(name, known.clone());
    if !near.is_empty() {
        return format!("did you mean {}?", near.into_iter().map(quoted).collect::<Vec<_>>().join(" or "));
    }
    let all: Vec<String> = known.into_iter().map(quoted).collect();
    if all.is_empty() { String::new() } else { format!("known are {}", all.join(", ")) }
}
