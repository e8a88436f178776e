//! Parameters: named numbers and texts that the rest of a deck refers to.
use super::decode::Context;
use super::expression::{Scope, is_reserved};
use super::quantity::{ANY, Compiled, compile};
use super::report::{Issue, suggest};
use super::source::Span;
use super::tree::{Content, Entry, Node};
use super::units::Dimension;

/// The parameters of a deck after overrides, in the order of the deck.
#[derive(Debug, Clone, Default)]
pub struct Parameters {
    all: Vec<Parameter>,
    /// Names that are defined further down while parameters are being read.
    later: Vec<String>,
}

/// One parameter.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: ParameterValue,
    /// Its value as typed, which is what `${name}` stands for.
    pub text: String,
}

/// The value of a parameter.
#[derive(Debug, Clone)]
pub enum ParameterValue {
    /// A number in the units of the deck, with its dimension if it was given with a unit.
    Number(f64, Option<Dimension>),
    /// A text; the string says why it is not a number.
    Text(String),
    /// Its fault has been told; no parameter of a deck that was read without faults is so.
    Faulty,
}

impl Parameters {
    /// All parameters, in the order of the deck.
    pub fn iter(&self) -> impl Iterator<Item = &Parameter> {
        self.all.iter()
    }

    /// Name and value, in the units of the deck, of every numeric parameter.
    pub fn numbers(&self) -> impl Iterator<Item = (&str, f64)> {
        self.all.iter().filter_map(|parameter| match parameter.value {
            ParameterValue::Number(value, _) => Some((parameter.name.as_str(), value)),
            ParameterValue::Text(_) | ParameterValue::Faulty => None,
        })
    }

    /// The parameter called `name`.
    pub fn get(&self, name: &str) -> Option<&Parameter> {
        self.all.iter().find(|parameter| parameter.name == name)
    }
}

impl Scope for Parameters {
    fn parameter(&self, name: &str) -> Option<Result<f64, String>> {
        if let Some(parameter) = self.get(name) {
            return Some(match &parameter.value {
                ParameterValue::Number(value, _) => Ok(*value),
                ParameterValue::Text(why) => Err(why.clone()),
                // Told where it is defined: an empty reason keeps its uses silent.
                ParameterValue::Faulty => Err(String::new()),
            });
        }
        self.later.iter().any(|later| later == name).then(|| Err("it is defined further down; move it up".into()))
    }

    fn parameters(&self) -> Vec<&str> {
        self.numbers().map(|(name, _)| name).collect()
    }
}

/// Puts the values of `changes` in place of those of the parameters they name.
pub(crate) fn apply(parameters: &mut [Entry], changes: &[Entry], issues: &mut Vec<Issue>) {
    for change in changes {
        match parameters.iter_mut().find(|entry| entry.key == change.key) {
            Some(entry) => entry.value = change.value.clone(),
            None => {
                let names: Vec<&str> = parameters.iter().map(|entry| entry.key.as_str()).collect();
                let message = format!("the deck has no parameter `{}`", change.key);
                let help = if names.is_empty() { "name it under `parameters:` first".into() } else { suggest(&change.key, names) };
                issues.push(Issue::new(change.key_span, message, help));
            }
        }
    }
}

/// Reads the values of all parameters, each of which may use those before it.
///
/// Those at a place in `broken` are faulty already, without being told again.
pub(crate) fn evaluate(entries: &[Entry], broken: &[Span], cx: &mut Context) {
    cx.parameters = Parameters { all: Vec::new(), later: entries.iter().map(|entry| entry.key.clone()).collect() };
    for entry in entries {
        cx.parameters.later.retain(|later| *later != entry.key);
        if !check_name(entry, cx) {
            continue;
        }
        let value = if broken.contains(&entry.value.span) { ParameterValue::Faulty } else { value(&entry.value, cx) };
        cx.parameters.all.push(Parameter { name: entry.key.clone(), value, text: entry.value.text() });
    }
}

fn check_name(entry: &Entry, cx: &mut Context) -> bool {
    let name = &entry.key;
    if is_reserved(name) {
        let message = format!("`{name}` already has a meaning in expressions");
        cx.issues.push(Issue::new(entry.key_span, message, format!("give the parameter another name, such as `{name}_0`")));
    } else if !name.starts_with(|c: char| c.is_alphabetic() || c == '_') || !name.chars().all(|c| c.is_alphanumeric() || c == '_') {
        let message = format!("`{name}` cannot be the name of a parameter");
        cx.issues.push(Issue::new(entry.key_span, message, "use letters, digits and `_`, and begin with a letter"));
    } else {
        return true;
    }
    false
}

fn value(node: &Node, cx: &mut Context) -> ParameterValue {
    let Content::Scalar(scalar) = &node.content else {
        return ParameterValue::Text("it is a list or a map".into());
    };
    if node.is_null() {
        cx.issues.push(Issue::new(node.span, "the parameter has no value", "write a number, an expression or a text"));
        return ParameterValue::Faulty;
    }
    let before = cx.issues.len();
    match compile(node, &ANY, &[], cx) {
        Some(Compiled { expression, dimension, .. }) => match expression.constant() {
            Some(value) if value.is_finite() => ParameterValue::Number(value, dimension),
            Some(value) => {
                cx.issues.push(Issue::new(node.span, format!("{} is {value}", node.shown()), "every parameter must be finite"));
                ParameterValue::Faulty
            }
            None => ParameterValue::Text("it depends on a variable".into()),
        },
        None => {
            let faults = cx.issues.split_off(before);
            let why = faults.first().map_or(String::new(), |issue| issue.message.clone());
            // A plain text that could be a sum or a number with a unit was meant as one: its faults are faults.
            // A word, or anything in quotes, is a text.
            let meant = !scalar.quoted
                && (scalar.text.contains(['+', '*', '/', '^', '(']) || scalar.text.starts_with(|c: char| c.is_ascii_digit()))
                || why.contains("is not a number: it");
            if meant {
                cx.issues.extend(faults);
                return ParameterValue::Faulty;
            }
            if faults.is_empty() {
                // It rests on a parameter that is faulty.
                return ParameterValue::Faulty;
            }
            ParameterValue::Text(why)
        }
    }
}
