//! From the tree to the types of the deck, noting every fault instead of stopping at the first.
//!
//! `section!` declares a struct whose fields are the keys of a map, `choice!` an enum of which a deck names one
//! variant. Both derive reading, writing (for the resolved deck) and JSON Schema from one declaration; doc comments
//! become descriptions. Defaults are deck text, read by the same code as what a user types.
use super::parameters::Parameters;
use super::quantity::{Count, Field, Kind, Length, Quantity, Variables};
use super::report::{Issue, suggest};
use super::source::{Sources, Span};
use super::tree::{Content, Entry, Node};
use super::units::UnitSystem;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer, ser::SerializeMap};
use std::borrow::Cow;
use std::ops::{Deref, Range};

/// What decoding needs to know and where it notes faults.
pub(crate) struct Context {
    pub units: UnitSystem,
    pub parameters: Parameters,
    pub sources: Sources,
    pub issues: Vec<Issue>,
    /// The names that sets may be called by; `None` if a file may bring more.
    pub set_names: Option<Vec<String>>,
    /// The dimension of space, unless it is at fault.
    pub dimension: Option<usize>,
    /// Whether the body is a beam or a plate, which moves out of its line or plane.
    pub thin: bool,
}

impl Context {
    pub fn fault(&mut self, span: Span, message: impl Into<String>, help: impl Into<String>) {
        self.issues.push(Issue::new(span, message, help));
    }

    /// The place of `range` of the text of the scalar `node`; the whole node where the text is not as in the file.
    pub fn within(&self, node: &Node, range: Range<usize>) -> Span {
        let Some(scalar) = node.as_scalar().filter(|scalar| !scalar.replaced) else {
            return node.span;
        };
        let written = self.sources.slice(node.span);
        match written.find(&scalar.text) {
            Some(lead) => {
                let start = node.span.start + (lead + range.start) as u32;
                let end = node.span.start + (lead + range.end) as u32;
                Span { start: start.min(node.span.end), end: end.max(start).min(node.span.end), ..node.span }
            }
            None => node.span,
        }
    }
}

/// Can be read from a node of the tree.
pub(crate) trait Decode: Sized {
    /// Reads `node`; `None` after noting what is wrong.
    fn decode(node: &Node, cx: &mut Context) -> Option<Self>;

    /// What an absent key means; `None` if the key is required.
    fn absent() -> Option<Self> {
        None
    }

    /// Whether every key of a section may be left out, so that the name of a variant can stand alone.
    fn needs_nothing() -> bool {
        false
    }
}

/// The keys of a map that is being read.
pub(crate) struct Entries<'n> {
    entries: &'n [Entry],
    known: Vec<&'static str>,
    /// Where the map is.
    pub span: Span,
    what: &'static str,
}

impl<'n> Entries<'n> {
    pub fn open(node: &'n Node, what: &'static str, cx: &mut Context) -> Option<Self> {
        match &node.content {
            Content::Map(entries) => Some(Self { entries, known: Vec::new(), span: node.span, what }),
            _ if node.is_null() => Some(Self { entries: &[], known: Vec::new(), span: node.span, what }),
            _ => {
                cx.fault(
                    node.span,
                    format!("a map of keys is needed here, but {} was found", node.shown()),
                    "write `key: value` in the lines below, or `{key: value}`",
                );
                None
            }
        }
    }

    /// Reads `key`; the default, given as deck text, if it is absent.
    pub fn read<T: Decode>(&mut self, key: &'static str, default: Option<&str>, cx: &mut Context) -> Option<T> {
        self.known.push(key);
        let entry = self.entries.iter().find(|entry| entry.key == key);
        let optional = T::absent();
        match entry {
            Some(entry) if !(entry.value.is_null() && (optional.is_some() || default.is_some())) => {
                let node = &entry.value;
                if node.is_null() {
                    cx.fault(entry.key_span, format!("`{key}` has no value"), "write a value after the `:`");
                    return None;
                }
                T::decode(node, cx)
            }
            _ if optional.is_some() => optional,
            _ => match default {
                Some(text) => T::decode(&super::tree::fragment(text, self.span), cx),
                None => {
                    cx.fault(first_line(self.span, &cx.sources), format!("`{key}` is missing in {}", self.what), format!("add `{key}: …`"));
                    None
                }
            },
        }
    }

    /// Notes all keys that were not read.
    pub fn close(self, cx: &mut Context) {
        for entry in self.entries.iter().filter(|entry| !self.known.contains(&entry.key.as_str())) {
            let message = format!("`{}` is not a key of {}", entry.key, self.what);
            cx.fault(entry.key_span, message, suggest(&entry.key, self.known.iter().copied()));
        }
    }
}

/// The part of `span` in its first line: a fault of a whole block is shown at its beginning.
fn first_line(span: Span, sources: &Sources) -> Span {
    let length = sources.slice(span).lines().next().map_or(0, str::len) as u32;
    Span { end: span.start + length, ..span }
}

/// The name of the one variant a node chooses, and its settings.
pub(crate) struct Chosen<'n> {
    pub name: &'n str,
    pub span: Span,
    pub settings: Option<&'n Node>,
}

/// Reads `name` or `{name: settings}`.
pub(crate) fn chosen<'n>(node: &'n Node, what: &str, names: &[&'static str], cx: &mut Context) -> Option<Chosen<'n>> {
    let list = || format!("choose one of {}", names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "));
    match &node.content {
        Content::Scalar(scalar) if !node.is_null() => Some(Chosen { name: &scalar.text, span: node.span, settings: None }),
        Content::Map(entries) => match entries.as_slice() {
            [entry] => Some(Chosen { name: &entry.key, span: entry.key_span, settings: Some(&entry.value) }),
            [] => {
                cx.fault(node.span, format!("{what} is empty"), list());
                None
            }
            [first, rest @ ..] => {
                let known = |entry: &&Entry| names.contains(&entry.key.as_str());
                let (span, message) = match rest.iter().find(known) {
                    Some(second) => {
                        (second.key_span, format!("{what} is one kind, but both `{}` and `{}` are given", first.key, second.key))
                    }
                    None => (rest[0].key_span, format!("{what} has one key, but `{}` follows `{}`", rest[0].key, first.key)),
                };
                let help = "keep one; in a list begin each with `-`, and indent the settings of one below its name";
                cx.fault(span, message, help);
                None
            }
        },
        _ => {
            cx.fault(node.span, format!("{what} is needed here, but {} was found", node.shown()), list());
            None
        }
    }
}

/// Joins the lines of a doc comment.
pub(crate) fn description(lines: &[&str]) -> String {
    lines.iter().map(|line| line.trim()).collect::<Vec<_>>().join("\n").trim().replace('\n', " ")
}

/// One property of a schema: the schema of its type, with what the key means and its default.
pub(crate) fn property<T: JsonSchema>(generator: &mut SchemaGenerator, docs: &[&str], default: Option<&str>) -> Schema {
    let mut schema = generator.subschema_for::<T>();
    let mut text = description(docs);
    if let Some(default) = default.filter(|default| !matches!(*default, "{}" | "[]")) {
        text.push_str(&format!(" Default: `{default}`."));
    }
    schema.insert("description".into(), text.into());
    schema
}

/// Declares a struct read from a map. Field: `key: Type where BOUND = "default as deck text"`, both parts optional.
macro_rules! section {
    (
        $(#[doc = $doc:literal])*
        pub struct $name:ident as $what:literal $(check $check:path)? {
            $( $(#[doc = $field_doc:literal])* $field:ident: $type:ty $(where $bound:ident)? $(= $default:literal)?, )*
        }
        $(flatten { $( $(#[doc = $inner_doc:literal])* $inner:ident: $inner_type:ty, )* })?
    ) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, serde::Serialize)]
        pub struct $name {
            $( $(#[doc = $field_doc])* $(#[doc = concat!("\n\nDefault: `", $default, "`.")])? pub $field: $type, )*
            $($( $(#[doc = $inner_doc])* #[serde(flatten)] pub $inner: $inner_type, )*)?
            /// Where the section is.
            #[serde(skip)]
            pub span: $crate::deck::Span,
        }

        impl $name {
            pub(crate) fn from_entries(entries: &mut $crate::deck::decode::Entries<'_>, cx: &mut $crate::deck::decode::Context) -> Option<Self> {
                $(
                    let default = $crate::deck::decode::default_text!($($default)?);
                    let $field: Option<$type> = entries.read($crate::deck::decode::plain(stringify!($field)), default, cx);
                    $( if let Some(value) = &$field { $crate::deck::decode::check_bound(value, &$crate::deck::decode::$bound, cx); } )?
                )*
                $($( let $inner = <$inner_type>::from_entries(entries, cx); )*)?
                let section = Self { $( $field: $field?, )* $($( $inner: $inner?, )*)? span: entries.span };
                $( $check(&section, cx); )?
                Some(section)
            }
        }

        impl $crate::deck::decode::Decode for $name {
            fn decode(node: &$crate::deck::tree::Node, cx: &mut $crate::deck::decode::Context) -> Option<Self> {
                let mut entries = $crate::deck::decode::Entries::open(node, $what, cx)?;
                let section = Self::from_entries(&mut entries, cx);
                entries.close(cx);
                section
            }

            fn needs_nothing() -> bool {
                let mut free = true;
                $(
                    let default: Option<&str> = $crate::deck::decode::default_text!($($default)?);
                    free &= default.is_some() || <$type as $crate::deck::decode::Decode>::absent().is_some();
                )*
                $($( free &= <$inner_type as $crate::deck::decode::Decode>::needs_nothing(); )*)?
                free
            }
        }

        impl $name {
            pub(crate) fn properties(generator: &mut schemars::SchemaGenerator, properties: &mut serde_json::Map<String, serde_json::Value>, required: &mut Vec<&'static str>) {
                $(
                    let default: Option<&str> = $crate::deck::decode::default_text!($($default)?);
                    let key = $crate::deck::decode::plain(stringify!($field));
                    properties.insert(key.into(), $crate::deck::decode::property::<$type>(generator, &[$($field_doc),*], default).to_value());
                    if default.is_none() && <$type as $crate::deck::decode::Decode>::absent().is_none() {
                        required.push(key);
                    }
                )*
                $($( <$inner_type>::properties(generator, properties, required); )*)?
            }
        }

        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                let mut properties = serde_json::Map::new();
                let mut required = Vec::new();
                Self::properties(generator, &mut properties, &mut required);
                schemars::json_schema!({
                    "description": $crate::deck::decode::description(&[$($doc),*]),
                    "type": "object",
                    "properties": properties,
                    "required": required,
                    "additionalProperties": false,
                })
            }
        }
    };
}
pub(crate) use section;

macro_rules! default_text {
    () => {
        None
    };
    ($text:literal) => {
        Some($text)
    };
}
pub(crate) use default_text;

/// Declares an enum of which the deck names one variant: `Variant(Settings) = "key"` or `Variant = "key"`.
macro_rules! choice {
    (
        $(#[doc = $doc:literal])*
        pub enum $name:ident as $what:literal {
            $( $(#[doc = $variant_doc:literal])* $variant:ident $(($settings:ty))? = $key:literal, )*
        }
    ) => {
        $(#[doc = $doc])*
        // A deck holds few of them; boxes would only be in the way of who reads it.
        #[allow(clippy::large_enum_variant)]
        #[derive(Debug, Clone, serde::Serialize)]
        pub enum $name {
            $( $(#[doc = $variant_doc])* #[serde(rename = $key)] $variant $(($settings))?, )*
        }

        impl $name {
            /// The names a deck may choose from.
            pub const NAMES: &'static [&'static str] = &[$($key),*];

            /// The name in the deck.
            pub fn name(&self) -> &'static str {
                match self {
                    $( choice!(@pattern $variant $(, $settings)?) => $key, )*
                }
            }
        }

        impl $crate::deck::decode::Decode for $name {
            fn decode(node: &$crate::deck::tree::Node, cx: &mut $crate::deck::decode::Context) -> Option<Self> {
                let chosen = $crate::deck::decode::chosen(node, $what, Self::NAMES, cx)?;
                match chosen.name {
                    $( $key => choice!(@read $variant, chosen, node, cx $(, $settings)?), )*
                    other => {
                        let message = format!("`{other}` is not {}", $what);
                        cx.fault(chosen.span, message, $crate::deck::report::suggest(other, Self::NAMES.iter().copied()));
                        None
                    }
                }
            }
        }

        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            #[allow(unused_variables)]
            fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                let mut all: Vec<serde_json::Value> = Vec::new();
                $( choice!(@schema all, generator, $key, &[$($variant_doc),*] $(, $settings)?); )*
                schemars::json_schema!({
                    "description": $crate::deck::decode::description(&[$($doc),*]),
                    "anyOf": all,
                })
            }
        }
    };
    (@pattern $variant:ident) => { Self::$variant };
    (@pattern $variant:ident, $settings:ty) => { Self::$variant(..) };
    (@read $variant:ident, $chosen:ident, $node:ident, $cx:ident) => {
        match $chosen.settings {
            Some(settings) if !settings.is_null() => {
                $cx.fault(settings.span, format!("`{}` takes no settings", $chosen.name), format!("write `{}` alone", $chosen.name));
                None
            }
            _ => Some(Self::$variant),
        }
    };
    (@read $variant:ident, $chosen:ident, $node:ident, $cx:ident, $settings:ty) => {
        match $chosen.settings {
            Some(settings) => <$settings as $crate::deck::decode::Decode>::decode(settings, $cx).map(Self::$variant),
            // A name alone is the name with all settings at their defaults.
            None => <$settings as $crate::deck::decode::Decode>::decode(&$crate::deck::tree::fragment("{}", $node.span), $cx).map(Self::$variant),
        }
    };
    (@schema $all:ident, $generator:ident, $key:literal, $docs:expr) => {
        $all.push(serde_json::json!({"const": $key, "description": $crate::deck::decode::description($docs)}));
    };
    (@schema $all:ident, $generator:ident, $key:literal, $docs:expr, $settings:ty) => {
        let settings = $crate::deck::decode::property::<$settings>($generator, $docs, None);
        if <$settings as $crate::deck::decode::Decode>::needs_nothing() {
            $all.push(serde_json::json!({"const": $key, "description": $crate::deck::decode::description($docs)}));
        }
        $all.push(serde_json::json!({
            "type": "object",
            "description": $crate::deck::decode::description($docs),
            "properties": {$key: settings},
            "required": [$key],
            "additionalProperties": false,
        }));
    };
}
pub(crate) use choice;

/// The key of a field: raw identifiers without their mark.
pub(crate) fn plain(field: &'static str) -> &'static str {
    field.strip_prefix("r#").unwrap_or(field)
}

/// A range that values must lie in.
pub(crate) struct Bound {
    /// As in "must be positive".
    text: &'static str,
    holds: fn(f64) -> bool,
}

pub(crate) const POSITIVE: Bound = Bound { text: "positive", holds: |value| value > 0.0 };
pub(crate) const NOT_NEGATIVE: Bound = Bound { text: "zero or positive", holds: |value| value >= 0.0 };
pub(crate) const FRACTION: Bound = Bound { text: "positive and at most 1", holds: |value| value > 0.0 && value <= 1.0 };
pub(crate) const BELOW_HALF: Bound = Bound { text: "at least 0 and below 0.5", holds: |value| (0.0..0.5).contains(&value) };
pub(crate) const POISSON: Bound = Bound { text: "above -1 and at most 0.5", holds: |value| value > -1.0 && value <= 0.5 };
pub(crate) const DIMENSION: Bound = Bound { text: "1, 2 or 3", holds: |value| (1.0..=3.0).contains(&value) };

/// Has numbers whose range can be checked.
pub(crate) trait Numbers {
    fn each(&self, visit: &mut dyn FnMut(f64, Span));
}

impl<K: Kind> Numbers for Quantity<K> {
    fn each(&self, visit: &mut dyn FnMut(f64, Span)) {
        visit(self.value, self.span);
    }
}

impl<K: Kind, V: Variables> Numbers for Field<K, V> {
    fn each(&self, visit: &mut dyn FnMut(f64, Span)) {
        if let Some(value) = self.constant() {
            visit(value, self.span);
        }
    }
}

impl Numbers for Count {
    fn each(&self, visit: &mut dyn FnMut(f64, Span)) {
        visit(self.value as f64, self.span);
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn each(&self, visit: &mut dyn FnMut(f64, Span)) {
        if let Some(value) = self {
            value.each(visit);
        }
    }
}

impl<T: Numbers> Numbers for Auto<T> {
    fn each(&self, visit: &mut dyn FnMut(f64, Span)) {
        if let Auto::Given(value) = self {
            value.each(visit);
        }
    }
}

/// Notes every number of `value` outside `bound`.
pub(crate) fn check_bound<T: Numbers>(value: &T, bound: &Bound, cx: &mut Context) {
    let mut faults = Vec::new();
    value.each(&mut |number, span| {
        if !(bound.holds)(number) {
            faults.push((span, number));
        }
    });
    for (span, number) in faults {
        let written = cx.sources.slice(span).to_string();
        let shown = if written.parse::<f64>() == Ok(number) || written.is_empty() {
            format!("{number}")
        } else {
            format!("`{written}` = {number}")
        };
        cx.fault(span, format!("the value must be {}, but is {shown}", bound.text), "");
    }
}

/// A value and where it was typed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// Where it was typed.
    pub span: Span,
}

impl<T> Deref for Spanned<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T: Serialize> Serialize for Spanned<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.value.serialize(serializer)
    }
}

impl<T: JsonSchema> JsonSchema for Spanned<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        generator.subschema_for::<T>()
    }
}

/// The name of a set of points that exists: `all`, a block of points, or an entry of `sets`.
///
/// Where points come from a file, the blocks it brings are only known once it is read; then any name passes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SetName {
    /// The name.
    pub value: String,
    /// Where it was typed.
    pub span: Span,
}

impl Decode for SetName {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let value = String::decode(node, cx)?;
        if let Some(known) = cx.set_names.as_ref().filter(|known| !known.contains(&value)) {
            let help = if value.contains(['<', '>', '=', '*', '(']) {
                format!("for the points where something holds write `{{where: \"{value}\"}}`")
            } else {
                suggest(&value, known.iter().map(String::as_str))
            };
            cx.fault(node.span, format!("there is no set `{value}`"), help);
            return None;
        }
        Some(Self { value, span: node.span })
    }
}

impl Serialize for SetName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.value)
    }
}

impl JsonSchema for SetName {
    fn schema_name() -> Cow<'static, str> {
        "SetName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"description": "`all`, a block of points, or a name under `sets`.", "type": "string"})
    }
}

/// A text: a name, a title, a path.
pub type Text = Spanned<String>;

impl<T: Decode> Decode for Spanned<T> {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        T::decode(node, cx).map(|value| Self { value, span: node.span })
    }
}

impl Decode for String {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let text = node.as_scalar().map(|scalar| scalar.text.clone());
        if text.is_none() {
            cx.fault(node.span, format!("a text is needed here, but {} was found", node.shown()), "write one word or a text in quotes");
        }
        text
    }
}

impl Decode for bool {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match node.as_scalar().map(|scalar| scalar.text.as_str()) {
            Some("true") => Some(true),
            Some("false") => Some(false),
            _ => {
                cx.fault(node.span, format!("{} is neither `true` nor `false`", node.shown()), "write `true` or `false`");
                None
            }
        }
    }
}

impl<T: Decode> Decode for Box<T> {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        T::decode(node, cx).map(Box::new)
    }
}

impl<T: Decode> Decode for Option<T> {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        T::decode(node, cx).map(Some)
    }

    fn absent() -> Option<Self> {
        Some(None)
    }
}

impl<T: Decode> Decode for Vec<T> {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let Content::List(items) = &node.content else {
            cx.fault(
                node.span,
                format!("a list is needed here, but {} was found", node.shown()),
                "write `[a, b]`, or one item per line after `- `",
            );
            return None;
        };
        // All items are read before any failure counts, so that each can report its own.
        let all: Vec<Option<T>> = items.iter().map(|item| T::decode(item, cx)).collect();
        all.into_iter().collect()
    }
}

impl<T: Decode, const N: usize> Decode for [T; N] {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let Content::List(items) = &node.content else {
            cx.fault(
                node.span,
                format!("a list of {N} values is needed here, but {} was found", node.shown()),
                format!("write `[{}]`", vec!["…"; N].join(", ")),
            );
            return None;
        };
        if items.len() != N {
            cx.fault(
                node.span,
                format!("a list of {N} values is needed here, but it has {}", items.len()),
                format!("write `[{}]`", vec!["…"; N].join(", ")),
            );
            return None;
        }
        Vec::decode(node, cx)?.try_into().ok()
    }
}

/// `auto`, or a value of one's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Auto<T> {
    /// Chosen by the program.
    Auto,
    /// Given in the deck.
    Given(T),
}

impl<T: Decode> Decode for Auto<T> {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        match node.as_scalar() {
            Some(scalar) if scalar.text == "auto" => Some(Self::Auto),
            _ => T::decode(node, cx).map(Self::Given),
        }
    }
}

impl<T: Serialize> Serialize for Auto<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Given(value) => value.serialize(serializer),
        }
    }
}

impl<T: JsonSchema> JsonSchema for Auto<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("AutoOr{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({"anyOf": [{"const": "auto"}, generator.subschema_for::<T>()]})
    }
}

/// A map from names to values, in the order of the deck.
#[derive(Debug, Clone)]
pub struct Dictionary<T>(pub Vec<(Text, T)>);

impl<T> Dictionary<T> {
    /// Names and values.
    pub fn iter(&self) -> impl Iterator<Item = (&Text, &T)> {
        self.0.iter().map(|(name, value)| (name, value))
    }

    /// The value called `name`.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.iter().find(|(key, _)| key.value == name).map(|(_, value)| value)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<T: Decode> Decode for Dictionary<T> {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let entries = Entries::open(node, "a map of names", cx)?;
        let all: Vec<Option<(Text, T)>> = entries
            .entries
            .iter()
            .map(|entry| {
                if entry.value.is_null() {
                    cx.fault(entry.key_span, format!("`{}` has no value", entry.key), "write a value after the `:`");
                    return None;
                }
                T::decode(&entry.value, cx).map(|value| (Spanned { value: entry.key.clone(), span: entry.key_span }, value))
            })
            .collect();
        all.into_iter().collect::<Option<Vec<_>>>().map(Self)
    }
}

impl<T: Serialize> Serialize for Dictionary<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in &self.0 {
            map.serialize_entry(&name.value, value)?;
        }
        map.end()
    }
}

impl<T: JsonSchema> JsonSchema for Dictionary<T> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("Named{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": "object", "additionalProperties": generator.subschema_for::<T>()})
    }
}

/// One to three coordinates; a single number will do in one dimension.
#[derive(Debug, Clone)]
pub struct Position {
    /// As many as were typed.
    pub coordinates: Vec<Quantity<Length>>,
    /// Where they were typed.
    pub span: Span,
}

impl Position {
    /// As a point of space; coordinates that were not typed are zero.
    pub fn point(&self) -> [f64; 3] {
        let mut point = [0.0; 3];
        for (slot, coordinate) in point.iter_mut().zip(&self.coordinates) {
            *slot = coordinate.value;
        }
        point
    }
}

impl Decode for Position {
    fn decode(node: &Node, cx: &mut Context) -> Option<Self> {
        let coordinates = match &node.content {
            Content::Scalar(_) => vec![Quantity::decode(node, cx)?],
            _ => Vec::decode(node, cx)?,
        };
        if !(1..=3).contains(&coordinates.len()) {
            cx.fault(
                node.span,
                format!("a position has 1 to 3 coordinates, not {}", coordinates.len()),
                "write `[x, y]` in 2D, `[x, y, z]` in 3D",
            );
            return None;
        }
        if let Some(dimension) = cx.dimension.filter(|dimension| *dimension != coordinates.len()) {
            let message = format!("the position has {} coordinates, but the body has dimension {dimension}", coordinates.len());
            cx.fault(node.span, message, format!("write `[{}]`", ["x", "x, y", "x, y, z"][dimension - 1]));
            return None;
        }
        Some(Self { coordinates, span: node.span })
    }
}

impl Serialize for Position {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.coordinates.serialize(serializer)
    }
}

impl JsonSchema for Position {
    fn schema_name() -> Cow<'static, str> {
        "Position".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let length = generator.subschema_for::<Quantity<Length>>();
        json_schema!({"description": "A position: one length a direction; in 1D the length alone will do.", "anyOf": [length, {"type": "array", "items": length, "minItems": 1, "maxItems": 3}]})
    }
}
