//! `output`: what is written.
use super::expect::Reduction;
use crate::deck::decode::Position;
use crate::deck::decode::{Auto, Context, Decode, SetName, Text, choice, section};
use crate::deck::quantity::{Angle, Any, Count, Number, Quantity, SpaceField, Time};
use crate::deck::report::suggest;
use crate::deck::source::Span;
use crate::deck::tree::Node;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer};

section! {
    /// What is written.
    pub struct Output as "the output" check check_output {
        /// Fields written for every frame.
        fields: Vec<FieldName> = "[displacement, damage]",
        /// Number of frames, evenly spread, besides the start; this or `every`.
        frames: Option<Count>,
        /// Time between frames; this or `frames`. Without both there are 20 frames.
        every: Option<Quantity<Time>> where POSITIVE,
        /// Most rows of the history. Without this and `history_every` there are up to 1000; in motions by explicit steps at least 120 steps apart,
        /// as energies take about the time of two steps.
        history: Option<Count>,
        /// Time between rows of the history.
        history_every: Option<Quantity<Time>> where POSITIVE,
        /// Further columns of the history: fields reduced over sets.
        measures: Vec<HistoryMeasure> = "[]",
        /// Pictures of fields.
        pictures: Vec<Picture> = "[]",
        /// Line plots.
        plots: Vec<Plot> = "[]",
    }
}

choice! {
    /// A field over the material points.
    pub enum FieldName as "a field" {
        /// Displacement.
        Displacement = "displacement",
        /// Velocity.
        Velocity = "velocity",
        /// Nonlocal deformation gradient.
        DeformationGradient = "deformation_gradient",
        /// Strain.
        Strain = "strain",
        /// Nonlocal strain of extended correspondence, in the measure of its exponent.
        ExtendedStrain = "extended_strain",
        /// Stress.
        Stress = "stress",
        /// Equivalent stress after von Mises.
        VonMises = "von_mises",
        /// Dilatation.
        Dilatation = "dilatation",
        /// Pressure.
        Pressure = "pressure",
        /// Strain energy density.
        EnergyDensity = "energy_density",
        /// Broken fraction of the family.
        Damage = "damage",
        /// Number of neighbours.
        FamilySize = "family_size",
        /// Internal force density.
        ForceDensity = "force_density",
        /// Smallest ratio of deformed to reference bond length.
        MinBondRatio = "min_bond_ratio",
        /// Number of the material.
        Material = "material",
        /// Number of the point.
        Id = "id",
        /// Curvature of beams and plates.
        Curvature = "curvature",
        /// Moment of beams, and of plates per width.
        Moment = "moment",
        /// Largest plastic angle of the bond pairs of beams and plates.
        PlasticAngle = "plastic_angle",
    }
}

impl FieldName {
    /// The components that can follow the name after a dot; none for a scalar field.
    pub fn components(&self) -> &'static [&'static str] {
        match self {
            FieldName::Displacement | FieldName::Velocity | FieldName::ForceDensity => &["x", "y", "z", "magnitude"],
            FieldName::Strain | FieldName::ExtendedStrain | FieldName::Stress | FieldName::Curvature | FieldName::Moment => {
                &["xx", "yy", "zz", "yz", "xz", "xy"]
            }
            FieldName::DeformationGradient => &["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz"],
            _ => &[],
        }
    }
}

/// One scalar of a field: `displacement.x`, `damage`.
#[derive(Debug, Clone)]
pub struct FieldComponent {
    /// The field.
    pub field: FieldName,
    /// The component, if the field has any.
    pub component: Option<&'static str>,
    /// Where it was typed.
    pub span: Span,
}

impl Decode for FieldComponent {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let text = String::decode(node, cx)?;
        let (name, component) = match text.split_once('.') {
            Some((name, component)) => (name, Some(component)),
            None => (text.as_str(), None),
        };
        if !FieldName::NAMES.contains(&name) {
            cx.fault(node.span, format!("`{name}` is not a field"), suggest(name, FieldName::NAMES.iter().copied()));
            return None;
        }
        let field = FieldName::decode(&Node::scalar(name, node.span), cx)?;
        let known = field.components();
        match component {
            None if known.is_empty() => Some(Self { field, component: None, span: node.span }),
            None => {
                cx.fault(node.span, format!("`{name}` has several components"), format!("write for example `{name}.{}`", known[0]));
                None
            }
            Some(component) => match known.iter().copied().find(|known| *known == component) {
                Some(component) => Some(Self { field, component: Some(component), span: node.span }),
                None if known.is_empty() => {
                    cx.fault(node.span, format!("`{name}` has no components"), format!("write `{name}` alone"));
                    None
                }
                None => {
                    cx.fault(node.span, format!("`{component}` is not a component of `{name}`"), suggest(component, known.iter().copied()));
                    None
                }
            },
        }
    }
}

impl std::fmt::Display for FieldComponent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.component {
            Some(component) => write!(f, "{}.{component}", self.field.name()),
            None => f.write_str(self.field.name()),
        }
    }
}

impl Serialize for FieldComponent {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl JsonSchema for FieldComponent {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "FieldComponent".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let mut all: Vec<String> = Vec::new();
        for name in FieldName::NAMES {
            let span = Span::default();
            let mut cx = Context {
                units: crate::deck::UnitSystem::si(),
                parameters: Default::default(),
                sources: Default::default(),
                issues: Vec::new(),
                set_names: None,
                dimension: None,
                thin: false,
            };
            if let Some(field) = FieldName::decode(&Node::scalar(*name, span), &mut cx) {
                match field.components() {
                    [] => all.push(name.to_string()),
                    components => all.extend(components.iter().map(|component| format!("{name}.{component}"))),
                }
            }
        }
        json_schema!({"description": "A scalar field or a component of a field.", "enum": all})
    }
}

section! {
    /// A field reduced to one number, a column of the history under its name.
    pub struct HistoryMeasure as "a measure" {
        /// Name of the column.
        name: Text,
        /// The field.
        field: FieldComponent,
        /// The set it is reduced over.
        over: SetName = "all",
        /// How.
        reduce: Reduction,
        /// Bound that `count`, `extent_…` and `line_angle` compare with.
        above: Option<Quantity<Any>>,
    }
}

section! {
    /// A picture of a field.
    pub struct Picture as "a picture" {
        /// What colours the points.
        field: FieldComponent,
        /// Magnification of the displacements.
        scale: Auto<Quantity<Number>> = "auto",
        /// Values of the ends of the colour scale; from the field if not given.
        range: Option<[Quantity<Any>; 2]>,
        /// When: `end`, `all` frames, or a time.
        time: Moment = "end",
        /// Name of the file; from the field if not given.
        name: Option<Text>,
        /// Direction of view (3D).
        view: Option<View>,
    }
}

section! {
    /// Direction of view.
    pub struct View as "a view" {
        /// Angle about the vertical axis; a plain number is in radian.
        azimuth: Quantity<Angle> = "30 deg",
        /// Angle above the horizontal plane; a plain number is in radian.
        elevation: Quantity<Angle> = "25 deg",
    }
}

/// When a picture or measurement is taken.
#[derive(Debug, Clone, Copy)]
pub enum Moment {
    /// At the end of the run.
    End,
    /// At every frame.
    All,
    /// At the frame or step nearest to this time.
    At(Quantity<Time>),
}

impl Decode for Moment {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match node.as_scalar().map(|scalar| scalar.text.as_str()) {
            Some("end") => Some(Self::End),
            Some("all") => Some(Self::All),
            _ => Quantity::decode(node, cx).map(Self::At),
        }
    }
}

impl Serialize for Moment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::End => serializer.serialize_str("end"),
            Self::All => serializer.serialize_str("all"),
            Self::At(time) => time.serialize(serializer),
        }
    }
}

impl JsonSchema for Moment {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Moment".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({"description": "A time of the run: its end, every time that is written, or the written one next to a value.", "anyOf": [{"enum": ["end", "all"]}, generator.subschema_for::<Quantity<Time>>()]})
    }
}

section! {
    /// A line plot: of histories (`x`, `y`) or of fields along a line (`along`, `fields`).
    pub struct Plot as "a plot" check check_plot {
        /// Name of the file.
        name: Text,
        /// Quantity along the abscissa, such as `time`.
        x: Option<Text>,
        /// Quantities along the ordinate, such as `energy.kinetic`.
        y: Option<Vec<Text>>,
        /// Logarithmic axes: `x`, `y` or `xy`.
        log: Option<LogAxes>,
        /// The line along which fields are drawn.
        along: Option<Segment>,
        /// Fields drawn along the line.
        fields: Option<Vec<FieldComponent>>,
        /// When fields are drawn: `end`, `all` frames, or a time.
        time: Moment = "end",
        /// An expression of x, y, z drawn for comparison.
        analytic: Option<SpaceField<Any>>,
    }
}

choice! {
    /// Which axes are logarithmic.
    pub enum LogAxes as "a choice of logarithmic axes" {
        /// The abscissa.
        X = "x",
        /// The ordinate.
        Y = "y",
        /// Both.
        Both = "xy",
    }
}

section! {
    /// A line between two positions.
    pub struct Segment as "a line" {
        /// First end.
        from: Position,
        /// Second end.
        to: Position,
    }
}

fn check_output(output: &Output, cx: &mut Context) {
    if let (Some(_), Some(every)) = (&output.frames, &output.every) {
        cx.fault(every.span, "both `frames` and `every` are given", "keep one");
    }
}

fn check_plot(plot: &Plot, cx: &mut Context) {
    let history = plot.x.is_some() || plot.y.is_some() || plot.log.is_some();
    let line = plot.along.is_some() || plot.fields.is_some() || plot.analytic.is_some();
    let fault = match (history, line) {
        (true, true) => Some("a plot is either of histories (`x`, `y`, `log`) or along a line (`along`, `fields`, `analytic`)"),
        (false, false) => Some("a plot needs `x` and `y`, or `along` and `fields`"),
        (true, false) if plot.x.is_none() || plot.y.is_none() => Some("a plot of histories needs both `x` and `y`"),
        (false, true) if plot.along.is_none() || plot.fields.is_none() => Some("a plot along a line needs both `along` and `fields`"),
        _ => None,
    };
    if let Some(message) = fault {
        cx.fault(plot.span, message, "write `{name: energies, x: time, y: [energy.kinetic]}` or `{name: bar, along: {from: [0], to: [1]}, fields: [displacement.x]}`");
    }
}
