//! `study` and `figures`: a deck run for several values of its parameters, and what is drawn of all runs together.
use super::expect::{At, Expectation, FieldError, Reduction, check_measured};
use super::output::{FieldComponent, LogAxes, Moment, Segment, View};
use crate::deck::ParameterText;
use crate::deck::decode::{Auto, Context, Decode, Dictionary, SetName, Text, choice, section};
use crate::deck::quantity::{Any, Count, Number, Quantity, SpaceField};
use crate::deck::tree::{Content, Node};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

section! {
    /// A study: the deck is run for every combination of the values given. A combination is called by its values, as in `m=2.1,n=4`; parts of that name choose several.
    pub struct Study as "a study" {
        /// Parameters and the values each takes.
        vary: Dictionary<Vec<ParameterText>> = "{}",
        /// How the lists are combined.
        combine: Combine = "cross",
        /// Runs that are varied: names, or `all`. Without them the deck is varied as it is written.
        runs: Option<Selection>,
        /// What is measured in each combination besides what is expected of it: columns of `study.csv` under their names.
        measure: Vec<StudyMeasure> = "[]",
        /// Expectations of single combinations, by their name or parts of it.
        combinations: Dictionary<CombinationSettings> = "{}",
        /// What is expected of the combinations together.
        expect: Vec<StudyExpectation> = "[]",
    }
}

choice! {
    /// How lists of values are combined.
    pub enum Combine as "a way to combine" {
        /// Every value of one with every value of the others; the last list changes fastest.
        Cross = "cross",
        /// The first values together, then the second ones, and so on: all lists are equally long.
        Zip = "zip",
    }
}

section! {
    /// What holds for some combinations only.
    pub struct CombinationSettings as "the settings of combinations" {
        /// Results expected of them, besides those of the deck.
        expect: Vec<Expectation> = "[]",
        /// Only run by `verify --slow`.
        slow: bool = "false",
    }
}

/// Some combinations: `all`, or names and parts of names such as `m=2.1`.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(transparent)]
pub struct Selection(pub Vec<Text>);

impl Selection {
    /// Whether everything is chosen.
    pub fn is_all(&self) -> bool {
        self.0.iter().any(|part| part.value == "all")
    }
}

impl Decode for Selection {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match &node.content {
            Content::List(items) if items.is_empty() => {
                cx.fault(node.span, "the list is empty", "write names, or `all`");
                None
            }
            Content::List(_) => Vec::decode(node, cx).map(Self),
            _ => Text::decode(node, cx).map(|text| Self(vec![text])),
        }
    }
}

impl JsonSchema for Selection {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Selection".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "`all`, or names of combinations, or parts of names such as `m=2.1`.",
            "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}],
        })
    }
}

section! {
    /// Something measured without being expected.
    pub struct MeasureKeys as "a measure of a study" {
        /// Name of the column.
        name: Text,
        /// A scalar of the history, such as `reaction.grip.x`.
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
        /// Arithmetic over scalar quantities.
        expression: Option<Text>,
        /// When; the end of the run if not given.
        time: Option<Moment>,
    }
}

/// Something measured in each combination: an expectation without a value.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(transparent)]
pub struct StudyMeasure(pub Expectation);

impl Decode for StudyMeasure {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let keys = MeasureKeys::decode(node, cx)?;
        let MeasureKeys { name, quantity, field, at, over, reduce, above, error, expression, time, span } = keys;
        let expectation = Expectation {
            name: Some(name),
            quantity,
            field,
            at,
            over,
            reduce,
            above,
            error,
            expression,
            time,
            value: None,
            tolerance: None,
            absolute: None,
            between: None,
            when: None,
            source: None,
            span,
        };
        check_measured(&expectation, cx);
        Some(Self(expectation))
    }
}

impl JsonSchema for StudyMeasure {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        MeasureKeys::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        generator.subschema_for::<MeasureKeys>()
    }
}

section! {
    /// What is expected of several combinations together. One of `order`, `falls`, `rises`, `ratio` says what is measured.
    pub struct StudyExpectation as "an expectation of a study" check check_study_expectation {
        /// Name in reports.
        name: Option<Text>,
        /// The slope of the logarithm of this quantity over that of `against`: the observed order of convergence.
        order: Option<Text>,
        /// A quantity that falls strictly as `against` grows.
        falls: Option<Text>,
        /// A quantity that rises strictly as `against` grows.
        rises: Option<Text>,
        /// A quantity whose ratio between two combinations, `of` over `to`, is measured.
        ratio: Option<Text>,
        /// A parameter: the abscissa of `order`, `falls` and `rises`.
        against: Option<Text>,
        /// Which values decide the order.
        fit: Fit = "all",
        /// The combinations looked at.
        runs: Selection = "all",
        /// The combination above the line of the ratio.
        of: Option<Text>,
        /// The combination below the line of the ratio.
        to: Option<Text>,
        /// Expected value.
        value: Option<Quantity<Any>>,
        /// Largest deviation relative to `value`.
        tolerance: Option<Quantity<Number>> where NOT_NEGATIVE,
        /// Largest absolute deviation.
        absolute: Option<Quantity<Any>> where NOT_NEGATIVE,
        /// Smallest and largest value, instead of `value`.
        between: Option<[Quantity<Any>; 2]>,
        /// Where the expected value comes from.
        source: Option<Text>,
    }
}

choice! {
    /// Which values decide an observed order.
    pub enum Fit as "a fit" {
        /// All: the line of least squares through the logarithms.
        All = "all",
        /// The two at the smallest values of the parameter.
        Smallest = "smallest",
        /// The two at the largest values of the parameter.
        Largest = "largest",
    }
}

fn check_study_expectation(e: &StudyExpectation, cx: &mut Context) {
    let kinds = [("order", &e.order), ("falls", &e.falls), ("rises", &e.rises), ("ratio", &e.ratio)];
    let given: Vec<String> = kinds.iter().filter(|(_, given)| given.is_some()).map(|(name, _)| format!("`{name}`")).collect();
    if given.len() != 1 {
        let message = match given.len() {
            0 => "the expectation does not say what is measured".to_string(),
            _ => format!("an expectation measures one thing, but {} are given", given.join(" and ")),
        };
        cx.fault(e.span, message, "give one of `order`, `falls`, `rises`, `ratio`");
        return;
    }
    if e.ratio.is_some() {
        if e.of.is_none() || e.to.is_none() {
            cx.fault(e.span, "a ratio needs two combinations", "write `of: m=1.1, to: m=2.1`");
        }
    } else if e.against.is_none() {
        cx.fault(e.span, format!("{} needs a parameter", given[0]), "add `against: dx` or the like");
    }
    let bounded = e.value.is_some() || e.between.is_some();
    if e.falls.is_some() || e.rises.is_some() {
        if let Some(span) = e.value.map(|v| v.span).or(e.between.map(|b| b[0].span)) {
            cx.fault(span, "`falls` and `rises` have no value", "remove it");
        }
    } else if !bounded {
        cx.fault(e.span, "the expectation has no value", "give `value` with `tolerance` or `absolute`, or `between: [low, high]`");
    }
    super::expect::check_bounds(e.value.as_ref(), e.tolerance.as_ref(), e.absolute.as_ref(), e.between.as_ref(), cx);
}

choice! {
    /// A figure of several runs: a PNG and a CSV beside `study.csv`.
    pub enum Figure as "a figure" {
        /// Curves in one frame.
        Lines(LinesFigure) = "lines",
        /// The same picture of a field for several runs, side by side, with one colour bar.
        Fields(FieldsFigure) = "fields",
    }
}

impl Figure {
    /// The name of its files.
    pub fn file(&self) -> &Text {
        match self {
            Self::Lines(figure) => &figure.name,
            Self::Fields(figure) => &figure.name,
        }
    }
}

section! {
    /// Curves in one frame.
    pub struct LinesFigure as "a figure of lines" check check_lines {
        /// Name of the files.
        name: Text,
        /// Title; that of the deck if not given.
        title: Option<Text>,
        /// The abscissa.
        x: AxisSettings = "{}",
        /// The ordinate.
        y: AxisSettings = "{}",
        /// Logarithmic axes: `x`, `y` or `xy`.
        log: Option<LogAxes>,
        /// The curves.
        curves: Vec<FigureCurve>,
        /// Triangles that show slopes in a doubly logarithmic frame, as in `[1, 2]`.
        slopes: Vec<Quantity<Number>> = "[]",
        /// Whether curves are named.
        legend: bool = "true",
    }
}

section! {
    /// An axis of a figure.
    pub struct AxisSettings as "an axis" {
        /// What is shown; from the curves if not given.
        label: Option<Text>,
        /// Its unit, for the label.
        unit: Option<Text>,
        /// What values are multiplied by before they are drawn, such as 1000 for millimetres in a deck in metres.
        factor: Quantity<Number> = "1",
        /// Both ends, after multiplication.
        range: Option<[Quantity<Any>; 2]>,
    }
}

section! {
    /// A curve, or one for each of several runs. One of `field`, `history`, `quantity`, `expression`, `csv` says what is drawn.
    pub struct FigureCurve as "a curve" check check_curve {
        /// A field along a line, or over all points of a body in one dimension.
        field: Option<FieldComponent>,
        /// The line along which the field is drawn.
        along: Option<Segment>,
        /// When the field is drawn: `end`, or a time.
        time: Moment = "end",
        /// A column of the history.
        history: Option<Text>,
        /// A quantity that is measured in every combination, over a parameter.
        quantity: Option<Text>,
        /// The abscissa: of a field `x`, `y`, `z` or `distance`; of a history another column (`time` if not given); of a quantity a parameter.
        against: Option<Text>,
        /// An expression of x.
        expression: Option<SpaceField<Any>>,
        /// First x of the expression; that of the other curves if not given.
        from: Option<Quantity<Any>>,
        /// Last x of the expression.
        to: Option<Quantity<Any>>,
        /// A file of comma-separated values whose first line names the columns; path relative to the folder of the deck.
        csv: Option<Text>,
        /// The columns drawn, abscissa first; the first two if not given.
        columns: Option<[Text; 2]>,
        /// The combinations drawn. An expression is drawn once, with the parameters of the deck, unless combinations are given.
        runs: Option<Selection>,
        /// Name in the legend; `{m}` stands for the value of parameter m, `{run}` for the name of the combination.
        label: Option<Text>,
        /// How it is drawn; chosen so that curves can be told apart without colour if not given.
        style: Option<CurveStyle>,
    }
}

choice! {
    /// How a curve is drawn.
    pub enum CurveStyle as "a style" {
        /// A solid line.
        Line = "line",
        /// A line of dashes.
        Dashed = "dashed",
        /// A line of dots.
        Dotted = "dotted",
        /// A line of dashes and dots.
        DashDot = "dash_dot",
        /// Markers alone.
        Markers = "markers",
        /// Markers joined by a line.
        LineAndMarkers = "line_and_markers",
    }
}

section! {
    /// The same picture of a field for several runs.
    pub struct FieldsFigure as "a figure of fields" check check_fields {
        /// Name of the files.
        name: Text,
        /// Title; that of the deck if not given.
        title: Option<Text>,
        /// What colours the points.
        field: FieldComponent,
        /// The combinations drawn.
        runs: Selection = "all",
        /// Title of each picture, as the label of a curve; the name of the combination if not given.
        label: Option<Text>,
        /// When: `end`, or a time.
        time: Moment = "end",
        /// Magnification of the displacements, the same for all.
        scale: Auto<Quantity<Number>> = "auto",
        /// Values of the ends of the colour scale; from all fields if not given.
        range: Option<[Quantity<Any>; 2]>,
        /// What values are multiplied by before they are drawn.
        factor: Quantity<Number> = "1",
        /// Unit of the field after multiplication, for the colour bar.
        unit: Option<Text>,
        /// Direction of view (3D).
        view: Option<View>,
        /// Pictures in a row; chosen by their shape if not given.
        columns: Option<Count>,
    }
}

fn check_lines(figure: &LinesFigure, cx: &mut Context) {
    check_file(&figure.name, cx);
    if figure.curves.is_empty() {
        cx.fault(figure.span, "the figure has no curves", "add `curves: [{field: displacement.x}]`");
    }
    if let Some(slope) = figure.slopes.first()
        && !matches!(figure.log, Some(LogAxes::Both))
    {
        cx.fault(slope.span, "slopes are shown between logarithmic axes only", "add `log: xy`");
    }
    for (axis, logarithmic) in [
        (&figure.x, matches!(figure.log, Some(LogAxes::X | LogAxes::Both))),
        (&figure.y, matches!(figure.log, Some(LogAxes::Y | LogAxes::Both))),
    ] {
        if let Some(range) = &axis.range {
            check_range(range, cx);
            if logarithmic && range[0].value <= 0.0 {
                cx.fault(range[0].span, "a logarithmic axis has positive values only", "write a positive first end");
            }
        }
    }
}

fn check_range(range: &[Quantity<Any>; 2], cx: &mut Context) {
    if range[0].value >= range[1].value {
        cx.fault(range[1].span, "the second end must be above the first", "write `range: [low, high]`");
    }
}

fn check_file(name: &Text, cx: &mut Context) {
    if name.value.is_empty() || name.value.contains(['/', '\\']) || name.value == "study" {
        cx.fault(
            name.span,
            format!("`{}` cannot be the name of a figure", name.value),
            "use letters, digits, `-` and `_`; `study` is taken",
        );
    }
}

fn check_fields(figure: &FieldsFigure, cx: &mut Context) {
    check_file(&figure.name, cx);
    check_moment(&figure.time, figure.span, cx);
    if let Some(range) = &figure.range {
        check_range(range, cx);
    }
    if let Some(columns) = figure.columns.filter(|columns| columns.value == 0) {
        cx.fault(columns.span, "a row has at least one picture", "write `columns: 2`");
    }
}

fn check_moment(time: &Moment, span: crate::deck::Span, cx: &mut Context) {
    if matches!(time, Moment::All) {
        cx.fault(span, "a figure shows one moment, not `all` frames", "write `time: end`, or a time");
    }
}

fn check_curve(curve: &FigureCurve, cx: &mut Context) {
    let kinds = [
        ("field", curve.field.is_some()),
        ("history", curve.history.is_some()),
        ("quantity", curve.quantity.is_some()),
        ("expression", curve.expression.is_some()),
        ("csv", curve.csv.is_some()),
    ];
    let given: Vec<String> = kinds.iter().filter(|(_, given)| *given).map(|(name, _)| format!("`{name}`")).collect();
    if given.len() != 1 {
        let message = match given.len() {
            0 => "the curve does not say what is drawn".to_string(),
            _ => format!("a curve shows one thing, but {} are given", given.join(" and ")),
        };
        cx.fault(curve.span, message, "give one of `field`, `history`, `quantity`, `expression`, `csv`");
        return;
    }
    check_moment(&curve.time, curve.span, cx);
    if curve.field.is_some() {
        if curve.along.is_none() && cx.dimension.is_some_and(|dimension| dimension > 1) {
            cx.fault(curve.span, "a field of this body is drawn along a line", "add `along: {from: [x, y], to: [x, y]}`");
        }
        if let Some(against) = &curve.against
            && !["x", "y", "z", "distance"].contains(&against.value.as_str())
        {
            let help = crate::deck::report::suggest(&against.value, ["x", "y", "z", "distance"]);
            cx.fault(against.span, format!("a field cannot be drawn over `{}`", against.value), help);
        }
    } else if let Some(along) = &curve.along {
        cx.fault(along.span, "`along` has a meaning for `field` only", "remove it");
    }
    if curve.quantity.is_some() && curve.against.is_none() {
        cx.fault(curve.span, "a quantity is drawn over a parameter", "add `against: dx` or the like");
    }
    if curve.expression.is_none()
        && let Some(end) = curve.from.or(curve.to)
    {
        cx.fault(end.span, "`from` and `to` have a meaning for `expression` only", "give the axis a `range`");
    }
    if curve.csv.is_some() != curve.columns.is_some()
        && let Some(columns) = &curve.columns
    {
        cx.fault(columns[0].span, "`columns` has a meaning for `csv` only", "remove it");
    }
}
