//! The JSON Schema of a deck, and a deck to start from.
use super::{ParameterText, Sections, UnitSystem};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use std::borrow::Cow;

/// The JSON Schema (draft 2020-12) of a deck, for editors; it ends with a line break.
pub fn schema() -> String {
    let mut schema = SchemaGenerator::default().into_root_schema_for::<Sections>();
    schema.insert("title".into(), "Peridyne deck".into());
    let mut text = serde_json::to_string_pretty(&schema).unwrap_or_default();
    text.push('\n');
    text
}

/// A commented deck to start from: a plate with a crack, pulled apart.
pub fn starter() -> &'static str {
    include_str!("starter.yaml")
}

impl JsonSchema for ParameterText {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Parameter".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": ["number", "string", "boolean", "array", "object"]})
    }
}

impl JsonSchema for UnitSystem {
    fn schema_name() -> Cow<'static, str> {
        "UnitSystem".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let unit = |example: &str| serde_json::json!({"type": "string", "examples": [example]});
        json_schema!({
            "description": "Units of plain numbers and of output: a name, or the unit of each base quantity.",
            "anyOf": [
                {"enum": ["SI", "mm-N-MPa"]},
                {
                    "type": "object",
                    "properties": {"length": unit("mm"), "mass": unit("t"), "time": unit("s"), "temperature": unit("K")},
                    "additionalProperties": false,
                },
            ]
        })
    }
}
