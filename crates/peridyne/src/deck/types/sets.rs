//! `sets`: named sets of material points.
use super::body::{Ball, Bounds};
use crate::deck::decode::{Context, Decode, Position, SetName, Text, choice, section};
use crate::deck::quantity::{Count, Field, Length, Number, Quantity, Space};
use crate::deck::tree::{Content, Node};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

/// The name of a set, or a rule.
#[derive(Debug, Clone, serde::Serialize)]
#[serde(untagged)]
pub enum PointSet {
    /// `all`, a block of points, or a name under `sets`.
    Name(SetName),
    /// A rule.
    Rule(SetRule),
}

choice! {
    /// A rule that chooses material points by their reference positions.
    pub enum SetRule as "a rule for a set" {
        /// Where an expression of x, y, z is true, or positive if it is a number.
        Where(Field<Number, Space>) = "where",
        /// In a box; its faces belong to it.
        Box(Bounds) = "box",
        /// In a disc (2D) or sphere (3D).
        Disc(Ball) = "disc",
        /// In a polygon (2D), given by its corners in order.
        Polygon(Vec<[Quantity<Length>; 2]>) = "polygon",
        /// The one point nearest to a position.
        Nearest(Position) = "nearest",
        /// The points of these numbers.
        Ids(Vec<Count>) = "ids",
        /// The outermost layers on one side.
        Layer(Layer) = "layer",
        /// The points in all of these sets.
        AllOf(Vec<PointSet>) = "all_of",
        /// The points in any of these sets.
        AnyOf(Vec<PointSet>) = "any_of",
        /// The points that are not in this set.
        Not(Box<PointSet>) = "not",
        /// Point numbers from a text file, one per line; path relative to the folder of the deck.
        File(Text) = "file",
    }
}

section! {
    /// The outermost layers of points on one side.
    pub struct Layer as "a layer" {
        /// Which side.
        side: Side,
        /// How many layers.
        count: Count where POSITIVE = "1",
    }
}

choice! {
    /// A side of the body.
    pub enum Side as "a side" {
        /// Smallest x.
        Left = "left",
        /// Largest x.
        Right = "right",
        /// Smallest y.
        Bottom = "bottom",
        /// Largest y.
        Top = "top",
        /// Smallest z.
        Back = "back",
        /// Largest z.
        Front = "front",
    }
}

impl Side {
    /// The axis it is normal to (0, 1, 2) and whether it has the largest coordinate.
    pub fn axis(&self) -> (usize, bool) {
        match self {
            Side::Left => (0, false),
            Side::Right => (0, true),
            Side::Bottom => (1, false),
            Side::Top => (1, true),
            Side::Back => (2, false),
            Side::Front => (2, true),
        }
    }
}

impl PointSet {
    /// The names of other sets it refers to, directly.
    pub fn names<'a>(&'a self, names: &mut Vec<&'a SetName>) {
        match self {
            PointSet::Name(name) => names.push(name),
            PointSet::Rule(SetRule::AllOf(parts) | SetRule::AnyOf(parts)) => parts.iter().for_each(|part| part.names(names)),
            PointSet::Rule(SetRule::Not(part)) => part.names(names),
            PointSet::Rule(_) => {}
        }
    }
}

impl Decode for PointSet {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match &node.content {
            Content::Scalar(_) => SetName::decode(node, cx).map(PointSet::Name),
            _ => SetRule::decode(node, cx).map(PointSet::Rule),
        }
    }
}

impl JsonSchema for PointSet {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "PointSet".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The name of a set, or a rule.",
            "anyOf": [{"type": "string"}, generator.subschema_for::<SetRule>()],
        })
    }
}
