//! Numbers of a deck: with a unit, plain, or as an expression, each checked against the dimension its key expects.
use super::decode::{Context, Decode};
use super::expression::{Expr, number_length};
use super::parameters::ParameterValue;
use super::report::Issue;
use super::source::Span;
use super::tree::{Content, Node};
use super::units::{Dimension, Unit};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer, ser::SerializeMap};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// What a key measures: its dimension, and how to speak of it.
#[derive(Debug, Clone, Copy)]
pub struct Measure {
    /// As in "a length is needed".
    pub name: &'static str,
    /// `None`: any dimension will do.
    pub dimension: Option<Dimension>,
    /// Values with units, for messages.
    pub examples: &'static str,
}

/// A measure as a type, so that [`Quantity<Length>`] says what it is.
pub trait Kind: fmt::Debug + Clone + Copy + Send + Sync + 'static {
    /// The name of the type in the schema.
    const ID: &'static str;
    /// The measure.
    const MEASURE: Measure;
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident $constant:ident: $text:literal, $dimension:expr, $examples:literal;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        pub struct $name;
        const $constant: Measure = Measure { name: $text, dimension: $dimension, examples: $examples };
        impl Kind for $name {
            const ID: &'static str = stringify!($name);
            const MEASURE: Measure = $constant;
        }
    )*};
}

const fn dimension(m: i16, l: i16, t: i16, k: i16) -> Option<Dimension> {
    Some(Dimension::new(m, l, t, k))
}

kinds! {
    /// Metre.
    Length LENGTH: "a length", dimension(0, 1, 0, 0), "`0.5 mm`, `2 m`";
    /// Square metre.
    Area AREA: "an area", dimension(0, 2, 0, 0), "`100 mm^2`";
    /// Second.
    Time TIME: "a time", dimension(0, 0, 1, 0), "`20 us`, `1.5 s`";
    /// Metre per second.
    Velocity VELOCITY: "a velocity", dimension(0, 1, -1, 0), "`20 m/s`";
    /// Kilogram per cubic metre.
    Density DENSITY: "a density", dimension(1, -3, 0, 0), "`2440 kg/m^3`";
    /// Pascal.
    Pressure PRESSURE: "a pressure", dimension(1, -1, -2, 0), "`72 GPa`, `250 MPa`";
    /// Joule per square metre.
    EnergyPerArea ENERGY_PER_AREA: "an energy per area", dimension(1, 0, -2, 0), "`3.8 J/m^2`, `0.5 N/mm`";
    /// Newton per cubic metre.
    ForceDensity FORCE_DENSITY: "a force density", dimension(1, -2, -2, 0), "`1e6 N/m^3`";
    /// Newton per metre to the fourth: force density per length of penetration.
    ContactStiffness CONTACT_STIFFNESS: "a force density per length", dimension(1, -3, -2, 0), "`1e15 N/m^4`";
    /// Kelvin.
    Temperature TEMPERATURE: "a temperature", dimension(0, 0, 0, 1), "`293 K`, `20 degC`";
    /// Per kelvin.
    Expansion EXPANSION: "a thermal expansion", dimension(0, 0, 0, -1), "`12e-6 1/K`";
    /// Radian.
    Angle ANGLE: "an angle", dimension(0, 0, 0, 0), "`30 deg`, `0.5 rad`, `pi/6`";
    /// A pure number.
    Number NUMBER: "a pure number", dimension(0, 0, 0, 0), "`0.25`, `2 %`";
    /// A force.
    Force FORCE: "a force", dimension(1, 1, -2, 0), "`5 kN`";
    /// A force per length.
    LineForce LINE_FORCE: "a force per length", dimension(1, 0, -2, 0), "`5 kN/m`";
    /// A moment, or the bending stiffness of a plate.
    MomentOfForce MOMENT_OF_FORCE: "a moment", dimension(1, 2, -2, 0), "`20 N*m`";
    /// The bending stiffness of a beam.
    BeamStiffness BEAM_STIFFNESS: "a bending stiffness", dimension(1, 3, -2, 0), "`200 N*m^2`";
    /// A curvature.
    Curvature CURVATURE: "a curvature", dimension(0, -1, 0, 0), "`0.1 1/m`";
    /// A quantity whose dimension depends on other keys.
    Any ANY_KIND: "a quantity", None, "`0.5 mm`, `72 GPa`";
}

pub(crate) const ANY: Measure = ANY_KIND;

/// The variables an expression may use, as a type.
pub trait Variables: fmt::Debug + Clone + Copy + Send + Sync + 'static {
    /// The part of the schema's type name that tells the variables.
    const ID: &'static str;
    /// Names and the slots of [`Expr::eval`] they read (0 to 2: coordinate, 3: time).
    const NAMES: &'static [(&'static str, usize)];
}

macro_rules! variables {
    ($($(#[$doc:meta])* $name:ident: $names:expr;)*) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        pub struct $name;
        impl Variables for $name {
            const ID: &'static str = stringify!($name);
            const NAMES: &'static [(&'static str, usize)] = &$names;
        }
    )*};
}

variables! {
    /// The reference coordinates `x`, `y`, `z`.
    Space: [("x", 0), ("y", 1), ("z", 2)];
    /// The reference coordinates `x`, `y`, `z` and time `t` (in statics: the load).
    SpaceTime: [("x", 0), ("y", 1), ("z", 2), ("t", 3)];
    /// Time `t` alone (in statics: the load).
    OnlyTime: [("t", 3)];
    /// The bond stretch `s`, read as the first coordinate.
    Stretch: [("s", 0)];
    /// The bond length over the horizon, `r`, read as the first coordinate.
    BondRatio: [("r", 0)];
}

/// What [`compile`] makes of a scalar or table.
pub(crate) struct Compiled {
    pub expression: Expr,
    /// The dimension, if the text tells it.
    pub dimension: Option<Dimension>,
    pub table: bool,
}

/// Splits `-0.5 mm` into number and unit text; `None` if the text is no single number, perhaps with a unit.
fn split(text: &str) -> Option<(f64, &str)> {
    let trimmed = text.trim();
    let sign = trimmed.starts_with(['-', '+']);
    let unsigned = if sign { trimmed[1..].trim_start() } else { trimmed };
    let length = number_length(unsigned);
    let value: f64 = unsigned.get(..length).filter(|number| !number.is_empty())?.parse().ok()?;
    let rest = unsigned[length..].trim_start();
    Some((if trimmed.starts_with('-') { -value } else { value }, rest))
}

/// Whether `rest`, which follows a number, can only be a unit. `/K` could also divide by a parameter.
fn is_unit(rest: &str) -> bool {
    let word: String = rest.chars().take_while(|c| c.is_alphabetic()).collect();
    !matches!(word.as_str(), "if" | "and" | "or") && rest.starts_with(|c: char| c.is_alphabetic() || matches!(c, '°' | '%' | '1'))
}

/// Compiles the value of `node`, a `measure`, whose text may use `variables`; notes what is wrong.
pub(crate) fn compile(node: &Node, measure: &Measure, variables: &[(&str, usize)], cx: &mut Context) -> Option<Compiled> {
    let needed = |cx: &mut Context| {
        let message = format!("{} is needed here, but {} was found", measure.name, node.shown());
        cx.issues.push(Issue::new(node.span, message, advice(measure, variables)));
    };
    let scalar = match &node.content {
        Content::Scalar(scalar) => scalar,
        Content::Map(_) if !variables.is_empty() && node.get("table").is_some() => {
            return table(node, measure, variables, cx);
        }
        _ => {
            needed(cx);
            return None;
        }
    };
    if node.is_null() || scalar.text.trim().is_empty() {
        needed(cx);
        return None;
    }
    let text = scalar.text.as_str();
    if let Some((value, rest)) = split(text) {
        if rest.is_empty() {
            return Some(Compiled { expression: Expr::of(value), dimension: None, table: false });
        }
        let unit = rest.parse::<Unit>();
        if is_unit(rest) || rest.starts_with('/') && unit.is_ok() && Expr::parse(text, variables, &cx.parameters).is_err() {
            return with_unit(node, value, unit, measure, cx);
        }
    }
    match Expr::parse(text, variables, &cx.parameters) {
        Ok(expression) => {
            let dimension = cx.parameters.get(text.trim()).and_then(|parameter| match parameter.value {
                ParameterValue::Number(_, dimension) => dimension,
                ParameterValue::Text(_) | ParameterValue::Faulty => None,
            });
            if let (Some(found), Some(expected)) = (dimension, measure.dimension)
                && found != expected
            {
                let message = format!("parameter {} is {found}, but {} is needed", node.shown(), measure.name);
                cx.issues.push(Issue::new(node.span, message, advice(measure, variables)));
                return None;
            }
            Some(Compiled { expression, dimension, table: false })
        }
        Err(errors) => {
            for error in errors.into_iter().filter(|error| !error.message.is_empty()) {
                let span = cx.within(node, error.range);
                cx.issues.push(Issue::new(span, error.message, error.help));
            }
            None
        }
    }
}

fn with_unit(
    node: &Node,
    value: f64,
    unit: Result<Unit, super::units::UnitError>,
    measure: &Measure,
    cx: &mut Context,
) -> Option<Compiled> {
    match unit {
        Err(error) => {
            cx.issues.push(Issue::new(node.span, format!("in {}, {}", node.shown(), error.message), error.help));
            None
        }
        Ok(unit) if measure.dimension.is_some_and(|expected| expected != unit.dimension) => {
            let message = format!("{} is {}, but {} is needed", node.shown(), unit.dimension, measure.name);
            cx.issues.push(Issue::new(node.span, message, advice(measure, &[])));
            None
        }
        Ok(unit) => {
            let value = cx.units.convert(value, &unit);
            Some(Compiled { expression: Expr::of(value), dimension: Some(unit.dimension), table: false })
        }
    }
}

fn advice(measure: &Measure, variables: &[(&str, usize)]) -> String {
    let plain = if measure.dimension == Some(Dimension::NONE) { "" } else { ", a plain number in the units of the deck" };
    let names: Vec<&str> = variables.iter().map(|variable| variable.0).collect();
    let of = if names.is_empty() { "parameters".into() } else { format!("{} and parameters", names.join(", ")) };
    format!("write for example {}{plain}, or an expression of {of}", measure.examples)
}

fn table(node: &Node, measure: &Measure, variables: &[(&str, usize)], cx: &mut Context) -> Option<Compiled> {
    let known = ["table", "of"];
    for entry in node.entries().iter().filter(|entry| !known.contains(&entry.key.as_str())) {
        cx.issues.push(Issue::new(
            entry.key_span,
            format!("`{}` is not a key of a table", entry.key),
            super::report::suggest(&entry.key, known),
        ));
    }
    let of = node
        .get("of")
        .and_then(Node::as_scalar)
        .map_or_else(|| variables.last().map_or("t", |variable| variable.0).to_string(), |scalar| scalar.text.clone());
    let Some((name, slot)) = variables.iter().find(|variable| variable.0 == of) else {
        let span = node.get("of").map_or(node.span, |of| of.span);
        let names: Vec<&str> = variables.iter().map(|variable| variable.0).collect();
        cx.issues.push(Issue::new(span, format!("a table here cannot be of `{of}`"), super::report::suggest(&of, names)));
        return None;
    };
    let abscissa = match *name {
        "x" | "y" | "z" => LENGTH,
        // In statics `t` is the load, so that a plain number is as good as a time.
        "t" => TIME,
        _ => NUMBER,
    };
    let rows_node = node.get("table")?;
    let Content::List(items) = &rows_node.content else {
        cx.issues.push(Issue::new(rows_node.span, "a table is a list of pairs", "write `table: [[0, 0], [1e-5, 2.0]]`"));
        return None;
    };
    let mut rows: Vec<[f64; 2]> = Vec::new();
    let mut sound = !items.is_empty();
    if !sound {
        cx.issues.push(Issue::new(rows_node.span, "the table is empty", "write `table: [[0, 0], [1e-5, 2.0]]`"));
    }
    for item in items {
        let Content::List(pair) = &item.content else {
            cx.issues.push(Issue::new(item.span, "a row of a table is a pair", "write `[1e-5, 2.0]`"));
            sound = false;
            continue;
        };
        let [first, second] = pair.as_slice() else {
            cx.issues.push(Issue::new(item.span, format!("a row of a table has 2 numbers, not {}", pair.len()), "write `[1e-5, 2.0]`"));
            sound = false;
            continue;
        };
        match (number(first, &abscissa, cx), number(second, measure, cx)) {
            (Some(x), Some(y)) => {
                if rows.last().is_some_and(|row| x <= row[0]) {
                    cx.issues.push(Issue::new(
                        first.span,
                        format!("the `{name}` of a table must increase from row to row"),
                        "sort the rows; write a jump as two close rows",
                    ));
                    sound = false;
                }
                rows.push([x, y]);
            }
            _ => sound = false,
        }
    }
    sound.then(|| Compiled { expression: Expr::table(&rows, *slot), dimension: None, table: true })
}

/// The finite number at `node`.
pub(crate) fn number(node: &Node, measure: &Measure, cx: &mut Context) -> Option<f64> {
    let compiled = compile(node, measure, &[], cx)?;
    let value = compiled.expression.constant()?;
    if value.is_finite() {
        return Some(value);
    }
    cx.issues.push(Issue::new(node.span, format!("{} is {value}", node.shown()), "the value must be finite"));
    None
}

/// One number, in the units of the deck, of the measure `K`.
#[derive(Debug, Clone, Copy)]
pub struct Quantity<K: Kind> {
    /// The value in the units of the deck.
    pub value: f64,
    /// Where it was typed.
    pub span: Span,
    kind: PhantomData<K>,
}

impl<K: Kind> Decode for Quantity<K> {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        number(node, &K::MEASURE, cx).map(|value| Self { value, span: node.span, kind: PhantomData })
    }
}

impl<K: Kind> Serialize for Quantity<K> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.value)
    }
}

impl<K: Kind> JsonSchema for Quantity<K> {
    fn schema_name() -> Cow<'static, str> {
        K::ID.into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let description = format!("{}: {}.", capital(K::MEASURE.name), advice(&K::MEASURE, &[]));
        json_schema!({"description": description, "type": ["number", "string"]})
    }
}

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or(String::new(), |first| first.to_uppercase().chain(chars).collect())
}

/// A value of measure `K` that may depend on the variables `V`; a number, an expression or a table.
#[derive(Debug, Clone)]
pub struct Field<K: Kind, V: Variables> {
    /// The compiled expression; its value is in the units of the deck.
    pub expression: Expr,
    /// The expression as typed.
    pub text: String,
    /// Where it was typed.
    pub span: Span,
    table: Option<serde_json::Value>,
    kind: PhantomData<(K, V)>,
}

/// A value that may depend on place.
pub type SpaceField<K> = Field<K, Space>;
/// A value that may depend on place and time.
pub type TimeField<K> = Field<K, SpaceTime>;

impl<K: Kind, V: Variables> Field<K, V> {
    /// The value at point `p` and time `t`.
    #[inline]
    pub fn eval(&self, p: [f64; 3], t: f64) -> f64 {
        self.expression.eval(p, t)
    }

    /// The value of an expression of one variable (`s`, `r`).
    #[inline]
    pub fn at(&self, variable: f64) -> f64 {
        self.expression.eval([variable, 0.0, 0.0], 0.0)
    }

    /// The value, if it depends on no variable.
    pub fn constant(&self) -> Option<f64> {
        self.expression.constant()
    }
}

impl<K: Kind, V: Variables> Decode for Field<K, V> {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let Compiled { expression, table, .. } = compile(node, &K::MEASURE, V::NAMES, cx)?;
        if let Some(value) = expression.constant().filter(|value| !value.is_finite()) {
            cx.issues.push(Issue::new(node.span, format!("{} is {value}", node.shown()), "the value must be finite"));
            return None;
        }
        let table = table.then(|| plain_table(node, &K::MEASURE, cx));
        Some(Self { expression, text: node.text(), span: node.span, table, kind: PhantomData })
    }
}

/// A table with its numbers in the units of the deck.
fn plain_table(node: &Node, measure: &Measure, cx: &mut Context) -> serde_json::Value {
    let of = node.get("of").map(Node::text);
    let abscissa = if matches!(of.as_deref(), Some("x" | "y" | "z")) { LENGTH } else { ANY };
    let mut rows = Vec::new();
    if let Some(Content::List(items)) = node.get("table").map(|table| &table.content) {
        for item in items {
            if let Content::List(pair) = &item.content {
                let row: Vec<Option<f64>> =
                    pair.iter().zip([abscissa, *measure]).map(|(cell, measure)| number(cell, &measure, cx)).collect();
                rows.push(row);
            }
        }
    }
    serde_json::json!({"table": rows, "of": of})
}

impl<K: Kind, V: Variables> Serialize for Field<K, V> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match (&self.table, self.expression.constant()) {
            (Some(serde_json::Value::Object(table)), _) => {
                let mut map = serializer.serialize_map(None)?;
                for (key, value) in table.iter().filter(|entry| !entry.1.is_null()) {
                    map.serialize_entry(key, value)?;
                }
                map.end()
            }
            (_, Some(value)) if !self.expression.is_condition() => serializer.serialize_f64(value),
            _ => serializer.serialize_str(&self.text),
        }
    }
}

impl<K: Kind, V: Variables> JsonSchema for Field<K, V> {
    fn schema_name() -> Cow<'static, str> {
        format!("{}Of{}", K::ID, V::ID).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let description = format!(
            "{}: {}, or `{{table: [[a, b], …], of: {}}}`.",
            capital(K::MEASURE.name),
            advice(&K::MEASURE, V::NAMES),
            V::NAMES[V::NAMES.len() - 1].0
        );
        let cell = generator.subschema_for::<Quantity<Any>>();
        let names: Vec<&str> = V::NAMES.iter().map(|name| name.0).collect();
        json_schema!({
            "description": description,
            "anyOf": [
                {"type": ["number", "string"]},
                {
                    "type": "object",
                    "properties": {
                        "table": {"type": "array", "items": {"type": "array", "items": cell, "minItems": 2, "maxItems": 2}},
                        "of": {"enum": names},
                    },
                    "required": ["table"],
                    "additionalProperties": false,
                }
            ]
        })
    }
}

/// A whole number that is not negative; may be an expression of parameters.
#[derive(Debug, Clone, Copy)]
pub struct Count {
    /// The number.
    pub value: u64,
    /// Where it was typed.
    pub span: Span,
}

impl Decode for Count {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let value = number(node, &NUMBER, cx)?;
        if (0.0..=9e15).contains(&value) && value == value.trunc() {
            return Some(Self { value: value as u64, span: node.span });
        }
        cx.issues.push(Issue::new(
            node.span,
            format!("a whole number is needed here, but {} is {value}", node.shown()),
            "write for example `100`",
        ));
        None
    }
}

impl Serialize for Count {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u64(self.value)
    }
}

impl JsonSchema for Count {
    fn schema_name() -> Cow<'static, str> {
        "Count".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"description": "A whole number, or an expression of parameters.", "type": ["integer", "string"], "minimum": 0})
    }
}
