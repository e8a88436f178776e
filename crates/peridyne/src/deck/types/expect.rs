//! `expect` and `verify`: what a deck says about its own result.
use super::output::{FieldComponent, Moment};
use crate::deck::decode::{Context, Decode, Position, SetName, Text, choice, section};
use crate::deck::quantity::{Any, Number, Quantity, Time, TimeField};
use crate::deck::tree::{Content, Node};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

section! {
    /// An expected result. One of `quantity`, `field`, `error`, `expression` says what is measured.
    pub struct Expectation as "an expectation" check check_expectation {
        /// Name in reports; what is measured if not given.
        name: Option<Text>,
        /// A scalar of the history, such as `reaction.grip.x` or `energy.strain`.
        quantity: Option<Text>,
        /// A field, measured `at` a position or `over` a set.
        field: Option<FieldComponent>,
        /// Position at which `field` is measured (a list), or time at which `quantity` is (a number).
        at: Option<At>,
        /// Set over which `field` is reduced.
        over: Option<SetName>,
        /// How `field` is reduced over the set.
        reduce: Option<Reduction>,
        /// Bound that `count`, `extent_…` and `line_angle` compare with.
        above: Option<Quantity<Any>>,
        /// Deviation of a field from an expression or from values in a file.
        error: Option<FieldError>,
        /// Arithmetic over scalar quantities, such as `energy.strain / 0.5`.
        expression: Option<Text>,
        /// When; the end of the run if not given.
        time: Option<Moment>,
        /// Expected value.
        value: Option<Quantity<Any>>,
        /// Largest deviation relative to `value`.
        tolerance: Option<Quantity<Number>> where NOT_NEGATIVE,
        /// Largest absolute deviation.
        absolute: Option<Quantity<Any>> where NOT_NEGATIVE,
        /// Smallest and largest value, instead of `value`.
        between: Option<[Quantity<Any>; 2]>,
        /// A condition on parameters, such as `m > 2`: the expectation counts only where it holds.
        when: Option<Quantity<Number>>,
        /// Where the expected value comes from.
        source: Option<Text>,
    }
}

/// A position or a time.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(untagged)]
pub enum At {
    /// A list: a position.
    Position(Position),
    /// A number: a time.
    Time(Quantity<Time>),
}

choice! {
    /// How a field over a set becomes one number.
    pub enum Reduction as "a reduction" {
        /// Largest value.
        Max = "max",
        /// Smallest value.
        Min = "min",
        /// Volume average.
        Mean = "mean",
        /// Sum over the points.
        Sum = "sum",
        /// Root of the mean square.
        Rms = "rms",
        /// Largest absolute value.
        MaxAbs = "max_abs",
        /// Volume integral.
        Integral = "integral",
        /// Number of points above `above`.
        Count = "count",
        /// Largest reference x of the points above `above`: how far a crack has come.
        ExtentX = "extent_x",
        /// Largest reference y of the points above `above`.
        ExtentY = "extent_y",
        /// Largest reference z of the points above `above`.
        ExtentZ = "extent_z",
        /// Angle in degrees, against the x axis, of the straight line through the points above `above`.
        LineAngle = "line_angle",
        /// Sum of the absolute differences between neighbours along the rows of points in x direction.
        TotalVariation = "total_variation",
        /// Root of the mean square of the third differences along the rows of points in x direction, over 8: zero-energy modes show
        /// in full, smooth fields hardly.
        Rough3 = "rough3",
    }
}

section! {
    /// Deviation of a field from an expression, or from values in a file.
    pub struct FieldError as "a field error" check check_error {
        /// The field.
        field: FieldComponent,
        /// What it should be, an expression of x, y, z, t; this or `csv`.
        against: Option<TimeField<Any>>,
        /// A file of comma-separated values whose first line names the columns, among them `x`, `y`, `z` as the body has dimensions; path
        /// relative to the folder of the deck. Every point takes the nearest line, which must lie within half a spacing.
        csv: Option<Text>,
        /// The column of the file that holds the reference.
        column: Text = "value",
        /// How deviations are summed up.
        norm: Norm = "l2",
        /// The set of points.
        over: SetName = "all",
    }
}

choice! {
    /// How deviations are summed up.
    pub enum Norm as "a norm" {
        /// Root of the volume integral of the square.
        L2 = "l2",
        /// The same over that of the reference: a relative difference.
        RelativeL2 = "relative_l2",
        /// Largest absolute value.
        Max = "max",
    }
}

/// What an [`Expectation`] measures.
#[derive(Debug, Clone, Copy)]
pub enum Measured<'a> {
    /// A scalar of the history.
    Quantity(&'a Text),
    /// A field at a position.
    FieldAt(&'a FieldComponent, &'a Position),
    /// A field reduced over a set.
    FieldOver(&'a FieldComponent, &'a SetName, &'a Reduction),
    /// Deviation of a field from an expression.
    Error(&'a FieldError),
    /// Arithmetic over scalar quantities.
    Expression(&'a Text),
}

impl Expectation {
    /// What is measured; `None` only for an expectation that was refused.
    pub fn measured(&self) -> Option<Measured<'_>> {
        if let Some(quantity) = &self.quantity {
            return Some(Measured::Quantity(quantity));
        }
        if let Some(error) = &self.error {
            return Some(Measured::Error(error));
        }
        if let Some(expression) = &self.expression {
            return Some(Measured::Expression(expression));
        }
        let field = self.field.as_ref()?;
        match (&self.at, &self.over, &self.reduce) {
            (Some(At::Position(position)), ..) => Some(Measured::FieldAt(field, position)),
            (_, Some(over), Some(reduce)) => Some(Measured::FieldOver(field, over, reduce)),
            _ => None,
        }
    }

    /// Its name in reports: as given, or what is measured.
    pub fn label(&self) -> String {
        if let Some(name) = &self.name {
            return name.value.clone();
        }
        let what = match self.measured() {
            Some(Measured::Quantity(q)) => q.value.clone(),
            Some(Measured::Expression(e)) => e.value.clone(),
            Some(Measured::FieldAt(f, at)) => format!("{f} at {:?}", at.point()),
            Some(Measured::FieldOver(f, set, reduce)) => format!("{} {f} over {}", reduce.name(), set.value),
            Some(Measured::Error(e)) => format!("{} error of {}", e.norm.name(), e.field),
            None => String::new(),
        };
        match self.moment() {
            Moment::At(t) => format!("{what} at {:e}", t.value),
            _ => what,
        }
    }

    /// When it is measured.
    pub fn moment(&self) -> Moment {
        match (&self.time, &self.at) {
            (Some(moment), _) => *moment,
            (None, Some(At::Time(time))) => Moment::At(*time),
            _ => Moment::End,
        }
    }
}

section! {
    /// How the deck takes part in `verify`.
    pub struct Verify as "the verification" {
        /// Only run by `verify --slow`.
        slow: bool = "false",
    }
}

impl Decode for At {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match &node.content {
            Content::List(_) => Position::decode(node, cx).map(At::Position),
            _ => Quantity::decode(node, cx).map(At::Time),
        }
    }
}

impl JsonSchema for At {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "At".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let position = generator.subschema_for::<Position>();
        json_schema!({"description": "A position (a list) or a time (a number).", "anyOf": [position, generator.subschema_for::<Quantity<Time>>()]})
    }
}

fn check_error(error: &FieldError, cx: &mut Context) {
    match (&error.against, &error.csv) {
        (None, None) => cx.fault(error.span, "the error has no reference", "give `against: expression`, or `csv: file.csv`"),
        (Some(_), Some(csv)) => cx.fault(csv.span, "both `against` and `csv` are given", "keep one"),
        _ => {}
    }
}

fn check_expectation(expectation: &Expectation, cx: &mut Context) {
    check_measured(expectation, cx);
    let Expectation { value, tolerance, absolute, between, .. } = expectation;
    if value.is_none() && between.is_none() {
        let help = "give `value` with `tolerance` or `absolute`, or `between: [low, high]`";
        cx.fault(expectation.span, "the expectation has no value", help);
    }
    check_bounds(value.as_ref(), tolerance.as_ref(), absolute.as_ref(), between.as_ref(), cx);
}

/// What is measured must be said once, and completely.
pub(super) fn check_measured(expectation: &Expectation, cx: &mut Context) {
    let span = expectation.span;
    let kinds = [
        ("quantity", expectation.quantity.is_some()),
        ("field", expectation.field.is_some()),
        ("error", expectation.error.is_some()),
        ("expression", expectation.expression.is_some()),
    ];
    let given: Vec<String> = kinds.iter().filter(|(_, given)| *given).map(|(name, _)| format!("`{name}`")).collect();
    match given.len() {
        0 => cx.fault(span, "the expectation does not say what is measured", "give one of `quantity`, `field`, `error`, `expression`"),
        1 => {}
        _ => cx.fault(span, format!("an expectation measures one thing, but {} are given", given.join(" and ")), "keep one"),
    }
    if expectation.field.is_some() {
        let placed = matches!(expectation.at, Some(At::Position(_)));
        let reduced = expectation.over.is_some() && expectation.reduce.is_some();
        if placed == reduced {
            cx.fault(
                span,
                "a field is measured at a position, or reduced over a set",
                "give `at: [x, y]`, or both `over: set` and `reduce: max`",
            );
        }
    } else if let Some(At::Position(position)) = &expectation.at {
        cx.fault(position.span, "a position has a meaning for `field` only", "write the time as a number");
    }
}

/// Value and tolerance, or bounds, must fit together.
pub(super) fn check_bounds(
    value: Option<&Quantity<Any>>,
    tolerance: Option<&Quantity<Number>>,
    absolute: Option<&Quantity<Any>>,
    between: Option<&[Quantity<Any>; 2]>,
    cx: &mut Context,
) {
    match (value, between) {
        (Some(_), Some(between)) => cx.fault(between[0].span, "both `value` and `between` are given", "keep one"),
        (Some(value), None) if tolerance.is_none() && absolute.is_none() => {
            cx.fault(value.span, "the expectation has no tolerance", "add `tolerance: 1e-3` (relative) or `absolute: …`");
        }
        (Some(value), None) if value.value == 0.0 && absolute.is_none() => {
            cx.fault(value.span, "a relative tolerance means nothing for the value 0", "add `absolute: …`");
        }
        (None, Some([low, high])) if low.value > high.value => {
            cx.fault(high.span, "`between` must not decrease", "write `between: [low, high]`")
        }
        _ => {}
    }
}
