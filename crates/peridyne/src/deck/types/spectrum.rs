//! `solver: {spectrum: …}`: what plane waves cost, and the lowest modes of the body.
use super::conditions::Axis;
use crate::deck::decode::{Auto, Context, Decode, Dictionary, Position, choice, section};
use crate::deck::quantity::{Count, Length, Number, Quantity};
use crate::deck::source::Span;
use crate::deck::tree::{Content, Node};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

section! {
    /// Stability: what plane waves cost on the body's lattice, and the lowest modes of the body.
    pub struct Spectrum as "a spectrum" check check_spectrum {
        /// Corners of the way through the Brillouin zone along which waves are written: their names, or wave vectors; `auto` is gamma-x in
        /// 1D, gamma-x-m-gamma in 2D, gamma-x-m-r-gamma in 3D.
        path: Auto<Vec<Corner>> = "auto",
        /// Wave vectors written per leg of the path.
        points: Count where POSITIVE = "60",
        /// Wave vectors of the search along each direction of the zone, an even number.
        grid: Auto<Count> = "auto",
        /// A wave costs nothing if it costs at most this fraction of what it costs the local solid.
        threshold: Quantity<Number> where POSITIVE = "1e-9",
        /// Uniform deformation of the lattice about which waves are small: a stretch along each axis, or the rows of a deformation gradient.
        stretch: Option<Deformation>,
        /// Wave vectors to be measured, by name.
        waves: Dictionary<WaveVector> = "{}",
        /// Number of lowest modes of the body; `auto` is 6 where the body is small.
        modes: Auto<Count> = "auto",
        /// Sine waves whose energy in the body is measured.
        imposed: Option<Imposed>,
        /// Where constants that vary in place are taken for the lattice; the middle of each material if not given.
        at: Option<Position>,
    }
}

choice! {
    /// A named corner of the Brillouin zone of a lattice with rows along x, y, z.
    pub enum CornerName as "a corner of the Brillouin zone" {
        /// No wave: (0, 0, 0).
        Gamma = "gamma",
        /// (1, 0, 0).
        X = "x",
        /// (0, 1, 0).
        Y = "y",
        /// (0, 0, 1).
        Z = "z",
        /// (1, 1, 0).
        M = "m",
        /// (1, 1, 1).
        R = "r",
    }
}

/// A corner of a path: a name or a wave vector.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(untagged)]
pub enum Corner {
    /// A name.
    Named(CornerName),
    /// Components.
    Vector(WaveVector),
}

impl Corner {
    /// Components in units of π over the spacing.
    pub fn fraction(&self) -> [f64; 3] {
        match self {
            Corner::Named(CornerName::Gamma) => [0.0; 3],
            Corner::Named(CornerName::X) => [1.0, 0.0, 0.0],
            Corner::Named(CornerName::Y) => [0.0, 1.0, 0.0],
            Corner::Named(CornerName::Z) => [0.0, 0.0, 1.0],
            Corner::Named(CornerName::M) => [1.0, 1.0, 0.0],
            Corner::Named(CornerName::R) => [1.0, 1.0, 1.0],
            Corner::Vector(v) => v.fraction(),
        }
    }
}

impl Decode for Corner {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let named = node.as_scalar().is_some_and(|s| s.text.chars().all(char::is_alphabetic));
        if !named {
            return WaveVector::decode(node, cx).map(Corner::Vector);
        }
        let corner = CornerName::decode(node, cx).map(Corner::Named)?;
        if let Some(dimension) = cx.dimension
            && corner.fraction()[dimension..].iter().any(|f| *f != 0.0)
        {
            let name = node.shown();
            cx.fault(
                node.span,
                format!("the corner {name} does not exist in {dimension} dimensions"),
                "use `gamma` and `x` in 1D; `y` and `m` too in 2D",
            );
            return None;
        }
        Some(corner)
    }
}

impl JsonSchema for Corner {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Corner".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let vector = generator.subschema_for::<WaveVector>();
        json_schema!({"description": "A corner of the path of wave vectors: by name, or in units of π over the spacing.", "anyOf": [generator.subschema_for::<CornerName>(), vector]})
    }
}

/// A wave vector: components along the rows of the lattice in units of π over the spacing, so that 1 is the boundary of the Brillouin
/// zone, a wave of two spacings.
#[derive(Debug, Clone)]
pub struct WaveVector {
    /// As many as were typed.
    pub components: Vec<Quantity<Number>>,
    /// Where they were typed.
    pub span: Span,
}

impl WaveVector {
    /// Components in units of π over the spacing; those that were not typed are zero.
    pub fn fraction(&self) -> [f64; 3] {
        let mut fraction = [0.0; 3];
        for (slot, component) in fraction.iter_mut().zip(&self.components) {
            *slot = component.value;
        }
        fraction
    }
}

impl Decode for WaveVector {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let components: Vec<Quantity<Number>> = match &node.content {
            Content::Scalar(_) => vec![Quantity::decode(node, cx)?],
            _ => Vec::decode(node, cx)?,
        };
        if let Some(dimension) = cx.dimension.filter(|d| *d != components.len()) {
            let message = format!("the wave vector has {} components, but the body has dimension {dimension}", components.len());
            cx.fault(node.span, message, format!("write `[{}]` in units of π over the spacing", ["1", "1, 0", "1, 0, 0"][dimension - 1]));
            return None;
        }
        Some(Self { components, span: node.span })
    }
}

impl serde::Serialize for WaveVector {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.components.serialize(serializer)
    }
}

impl JsonSchema for WaveVector {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "WaveVector".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let number = generator.subschema_for::<Quantity<Number>>();
        json_schema!({
            "description": "Components in units of π over the spacing: 1 is a wave of two spacings.",
            "anyOf": [number, {"type": "array", "items": number, "minItems": 1, "maxItems": 3}],
        })
    }
}

/// A uniform deformation.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(untagged)]
pub enum Deformation {
    /// Stretches along the axes.
    Stretches(Vec<Quantity<Number>>),
    /// Rows of the deformation gradient.
    Gradient(Vec<Vec<Quantity<Number>>>),
}

impl Deformation {
    /// F − 1.
    pub fn displacement_gradient(&self) -> [[f64; 3]; 3] {
        let mut h = [[0.0; 3]; 3];
        match self {
            Self::Stretches(s) => s.iter().enumerate().for_each(|(k, s)| h[k][k] = s.value - 1.0),
            Self::Gradient(rows) => {
                for (i, row) in rows.iter().enumerate() {
                    for (j, f) in row.iter().enumerate() {
                        h[i][j] = f.value - (i == j) as u8 as f64;
                    }
                }
            }
        }
        h
    }
}

impl Decode for Deformation {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let rows = matches!(&node.content, Content::List(items) if items.iter().any(|i| matches!(i.content, Content::List(_))));
        let made = match (&node.content, rows) {
            (Content::Scalar(_), _) => Self::Stretches(vec![Quantity::decode(node, cx)?]),
            (_, true) => Self::Gradient(Vec::decode(node, cx)?),
            (_, false) => Self::Stretches(Vec::decode(node, cx)?),
        };
        let dimension = cx.dimension?;
        let fits = match &made {
            Self::Stretches(s) => s.len() == dimension,
            Self::Gradient(rows) => rows.len() == dimension && rows.iter().all(|r| r.len() == dimension),
        };
        if !fits {
            let help = [
                "write `stretch: [1.02]`",
                "write `stretch: [1.02, 1]`, or two rows of two",
                "write `stretch: [1.02, 1, 1]`, or three rows of three",
            ];
            cx.fault(node.span, format!("the deformation does not fit a body of dimension {dimension}"), help[dimension - 1]);
            return None;
        }
        let h = made.displacement_gradient();
        let f: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| h[i][j] + (i == j) as u8 as f64));
        let determinant = f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1]) - f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0])
            + f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0]);
        if determinant <= 0.0 {
            cx.fault(
                node.span,
                format!("the deformation turns the body inside out: its determinant is {determinant}"),
                "stretches are positive: 1 is no deformation",
            );
            return None;
        }
        Some(made)
    }
}

impl JsonSchema for Deformation {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Deformation".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let number = generator.subschema_for::<Quantity<Number>>();
        let list = serde_json::json!({"type": "array", "items": number, "minItems": 1, "maxItems": 3});
        json_schema!({"description": "A uniform deformation: one stretch, one along each axis, or the rows of a deformation gradient.", "anyOf": [number, list, {"type": "array", "items": list, "minItems": 1, "maxItems": 3}]})
    }
}

section! {
    /// Displacements `amplitude sin(k x/length)` whose energy in the body is measured.
    pub struct Imposed as "imposed waves" {
        /// The numbers k: a list, or `{from: …, to: …, count: …}`.
        wave_numbers: WaveNumbers,
        /// Length that makes k a number.
        length: Quantity<Length> where POSITIVE,
        /// Amplitude.
        amplitude: Quantity<Length> where POSITIVE = "1",
        /// Axis along which the wave runs.
        along: Axis = "x",
        /// Axis along which points move.
        displacement: Axis = "x",
    }
}

/// Wave numbers.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)]
pub enum WaveNumbers {
    /// One by one.
    List(Vec<Quantity<Number>>),
    /// Equally spaced.
    Range(WaveRange),
}

section! {
    /// Equally spaced wave numbers.
    pub struct WaveRange as "a range of wave numbers" {
        /// The first.
        from: Quantity<Number> where POSITIVE,
        /// The last.
        to: Quantity<Number> where POSITIVE,
        /// How many.
        count: Count where POSITIVE = "200",
    }
}

impl WaveNumbers {
    /// The numbers.
    pub fn values(&self) -> Vec<f64> {
        match self {
            Self::List(list) => list.iter().map(|q| q.value).collect(),
            Self::Range(r) => {
                let n = r.count.value;
                (0..n).map(|i| r.from.value + (r.to.value - r.from.value) * i as f64 / n.saturating_sub(1).max(1) as f64).collect()
            }
        }
    }
}

impl Decode for WaveNumbers {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match &node.content {
            Content::Map(_) => WaveRange::decode(node, cx).map(Self::Range),
            Content::Scalar(_) => Quantity::decode(node, cx).map(|q| Self::List(vec![q])),
            _ => Vec::decode(node, cx).map(Self::List),
        }
    }
}

impl JsonSchema for WaveNumbers {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "WaveNumbers".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let number = generator.subschema_for::<Quantity<Number>>();
        json_schema!({"description": "Wave numbers: one, a list, or a range.", "anyOf": [number, {"type": "array", "items": number}, generator.subschema_for::<WaveRange>()]})
    }
}

fn check_spectrum(spectrum: &Spectrum, cx: &mut Context) {
    if let Auto::Given(grid) = &spectrum.grid
        && (grid.value < 2 || grid.value % 2 == 1)
    {
        let even = (grid.value + 1).max(2);
        cx.fault(
            grid.span,
            format!("a grid of {} misses the corners of the Brillouin zone", grid.value),
            format!("use an even number, such as {even}"),
        );
    }
    if let Auto::Given(grid) = &spectrum.grid
        && let Some(dimension) = cx.dimension
        && (grid.value as f64).powi(dimension as i32) > 2e7
    {
        cx.fault(
            grid.span,
            format!("a grid of {} in {dimension} dimensions has more than 20 million wave vectors", grid.value),
            "use a coarser one",
        );
    }
    if let Auto::Given(path) = &spectrum.path {
        if path.len() < 2 {
            cx.fault(spectrum.span, "a path has two corners or more", "write for example `path: [gamma, x]`");
        }
        if path.windows(2).any(|w| w[0].fraction() == w[1].fraction()) {
            cx.fault(spectrum.span, "two corners of the path in a row are the same", "remove one");
        }
    }
    for (name, wave) in spectrum.waves.iter() {
        if wave.fraction() == [0.0; 3] {
            cx.fault(
                wave.span,
                format!("the wave `{}` has the wave vector zero: a rigid translation", name.value),
                "give a component that is not zero",
            );
        }
        if !name.value.chars().all(|c| c.is_alphanumeric() || c == '_') {
            cx.fault(name.span, format!("`{}` cannot be part of the name of a quantity", name.value), "use letters, digits and `_`");
        }
    }
    if let (Some(imposed), Some(dimension)) = (&spectrum.imposed, cx.dimension) {
        for axis in [&imposed.along, &imposed.displacement] {
            if axis.index() >= dimension {
                cx.fault(imposed.span, format!("a body of dimension {dimension} has no axis {}", axis.name()), "choose another axis");
            }
        }
    }
}
