//! All that a deck can say, as a page to read, made from the JSON Schema.

use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Write;

/// The reference of decks as a Markdown page.
pub fn reference_page() -> String {
    let schema = schema();
    let mut text = String::from(
        "# What a deck can say\n\nPrinted by `peridyne explain --all`; `peridyne explain WORD` prints the part on one key or choice. Keys in **bold** must \
         be given. A choice without settings is written as its word alone (`solver: statics`), one with settings as a map \
         (`solver: {statics: {load_steps: 4}}`). A list may be written as its one entry where it says so.\n",
    );
    for section in sections(&schema) {
        section.write(&mut text);
    }
    text
}

/// The sections of the reference on a word: a section of that name, or those where it is a key or a choice. `None` where it is unknown.
pub fn explain(word: &str) -> Option<String> {
    let schema = schema();
    let all = sections(&schema);
    let plain = |s: &str| s.replace(['_', '-', ' '], "").to_lowercase();
    let wanted = plain(word);
    // the settings behind a key or choice first, then where it stands
    let mut found: Vec<&Section> = all.iter().filter(|s| plain(s.name) == wanted).collect();
    for section in &all {
        for row in section.rows.iter().filter(|r| plain(&r.word) == wanted) {
            let target = row.target.and_then(|t| all.iter().find(|s| s.name == t));
            for s in target.into_iter().chain([section]) {
                if !found.iter().any(|f| std::ptr::eq(*f, s)) {
                    found.push(s);
                }
            }
        }
    }
    let mut text = String::new();
    found.iter().for_each(|s| s.print(&mut text));
    (!found.is_empty()).then_some(text)
}

/// Words known to [`explain`] that resemble `word`, best first.
pub fn similar(word: &str) -> Vec<String> {
    let schema = schema();
    let words: BTreeSet<String> = sections(&schema).iter().flat_map(|s| s.rows.iter().map(|r| r.word.clone())).collect();
    let mut close: Vec<(f64, String)> = words.into_iter().map(|w| (strsim::jaro_winkler(&w, word), w)).filter(|(s, _)| *s > 0.8).collect();
    close.sort_by(|a, b| b.0.total_cmp(&a.0));
    close.into_iter().take(3).map(|(_, w)| w).collect()
}

fn schema() -> Value {
    serde_json::from_str(&super::schema()).unwrap_or_default()
}

/// A key of a map, or a choice.
struct Row<'a> {
    word: String,
    value: String,
    meaning: &'a str,
    required: bool,
    target: Option<&'a str>,
}

/// One map, choice or kind of value.
struct Section<'a> {
    name: &'a str,
    meaning: &'a str,
    choice: bool,
    /// What may be written, where that is no table.
    forms: String,
    rows: Vec<Row<'a>>,
}

impl Section<'_> {
    /// For a terminal.
    fn print(&self, text: &mut String) {
        let _ = write!(text, "{}{}\n  {}\n", if text.is_empty() { "" } else { "\n" }, self.name, self.meaning);
        let plain = |value: &str| {
            let mut out = String::new();
            let mut rest = value;
            // links keep their text alone
            while let Some(at) = rest.find("](#") {
                out.push_str(&rest[..at]);
                rest = rest[at..].split_once(')').map_or("", |(_, r)| r);
            }
            out.push_str(rest);
            out.replace(['[', '`'], "")
        };
        if !self.forms.is_empty() {
            let _ = writeln!(text, "    written as {}", plain(&self.forms));
        }
        for r in &self.rows {
            let value = plain(&r.value);
            let must = if r.required { ", required" } else { "" };
            let _ = writeln!(
                text,
                "    {}{}\n        {}",
                r.word,
                if value == "–" { must.into() } else { format!(": {value}{must}") },
                r.meaning.replace('`', "")
            );
        }
    }
    /// As Markdown.
    fn write(&self, text: &mut String) {
        let _ = write!(text, "\n## {}\n\n{}\n", self.name, self.meaning);
        if self.rows.is_empty() {
            if !self.forms.is_empty() {
                let _ = write!(text, "\nWritten as {}.\n", self.forms);
            }
            return;
        }
        let _ = write!(
            text,
            "\n| {} | {} | meaning |\n|---|---|---|\n",
            if self.choice { "choice" } else { "key" },
            if self.choice { "settings" } else { "value" }
        );
        for r in &self.rows {
            let word = if r.required { format!("**`{}`**", r.word) } else { format!("`{}`", r.word) };
            let _ = writeln!(text, "| {word} | {} | {} |", r.value, r.meaning.replace('|', "\\|").replace('\n', " "));
        }
    }
}

/// The sections in the order in which a reader of a deck meets them.
fn sections(schema: &Value) -> Vec<Section<'_>> {
    let mut all = vec![section("Deck", schema)];
    let (mut queue, mut seen) = (vec![], BTreeSet::new());
    queue.extend(all[0].rows.iter().rev().filter_map(|r| r.target));
    while let Some(name) = queue.pop() {
        if seen.insert(name) {
            let definition = &schema["$defs"][name];
            let s = section(name, definition);
            let mut targets = BTreeSet::new();
            references(definition, &mut targets);
            let in_rows: Vec<&str> = s.rows.iter().filter_map(|r| r.target).collect();
            queue.extend(targets.into_iter().filter(|t| !in_rows.contains(t)));
            queue.extend(in_rows.into_iter().rev());
            all.push(s);
        }
    }
    all
}

fn section<'a>(name: &'a str, s: &'a Value) -> Section<'a> {
    let meaning = s["description"].as_str().unwrap_or("");
    if let Some(properties) = s["properties"].as_object() {
        let required: Vec<&str> = s["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let rows = properties.iter().map(|(key, v)| row(key.clone(), v, required.contains(&key.as_str())));
        return Section { name, meaning, choice: false, forms: String::new(), rows: rows.collect() };
    }
    let mut rows: Vec<Row> = vec![];
    for option in s["anyOf"].as_array().into_iter().flatten().chain(s["oneOf"].as_array().into_iter().flatten()) {
        if let Some(word) = option["const"].as_str() {
            rows.push(Row {
                word: word.into(),
                value: "–".into(),
                meaning: option["description"].as_str().unwrap_or(""),
                required: false,
                target: None,
            });
        } else if let Some((key, v)) = option["properties"].as_object().and_then(|p| (p.len() == 1).then(|| p.iter().next()).flatten()) {
            let mut with = row(key.clone(), v, false);
            if let Some(alone) = rows.iter_mut().find(|r| r.word == *key) {
                with.value.push_str(", or none");
                *alone = with;
            } else {
                rows.push(with);
            }
        } else {
            for word in option["enum"].as_array().into_iter().flatten().filter_map(Value::as_str) {
                rows.push(Row {
                    word: word.into(),
                    value: "–".into(),
                    meaning: option["description"].as_str().unwrap_or(""),
                    required: false,
                    target: None,
                });
            }
        }
    }
    for word in s["enum"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        rows.push(Row { word: word.into(), value: "–".into(), meaning: "", required: false, target: None });
    }
    let forms = if rows.is_empty() { value(s) } else { String::new() };
    Section { name, meaning, choice: true, forms, rows }
}

fn row<'a>(word: String, v: &'a Value, required: bool) -> Row<'a> {
    let mut targets = BTreeSet::new();
    references(v, &mut targets);
    Row { word, value: value(v), meaning: v["description"].as_str().unwrap_or(""), required, target: targets.into_iter().next() }
}

/// What may be written for a value.
fn value(v: &Value) -> String {
    if let Some(r) = v["$ref"].as_str() {
        let name = r.rsplit('/').next().unwrap_or(r);
        return format!("[{name}](#{})", name.to_lowercase());
    }
    if let Some(options) = v["anyOf"].as_array() {
        let mut all: Vec<String> = options.iter().filter(|o| o["type"] != "null").map(value).filter(|s| !s.is_empty()).collect();
        all.dedup();
        return all.join(" or ");
    }
    if let Some(word) = v["const"].as_str() {
        return format!("`{word}`");
    }
    if let Some(words) = v["enum"].as_array() {
        return words.iter().filter_map(Value::as_str).map(|w| format!("`{w}`")).collect::<Vec<_>>().join(", ");
    }
    let kind = |t: &str| match t {
        "array" => {
            let of = value(&v["items"]);
            let count = match (v["minItems"].as_u64(), v["maxItems"].as_u64()) {
                (Some(a), Some(b)) if a == b => format!("{a} "),
                _ => String::new(),
            };
            if of.is_empty() { "list".into() } else { format!("list of {count}{of}") }
        }
        "object" if v["additionalProperties"].is_object() => format!("named {}", value(&v["additionalProperties"])),
        "object" if v["properties"].is_object() => {
            let keys: Vec<&str> = v["properties"].as_object().into_iter().flatten().map(|(k, _)| k.as_str()).collect();
            format!("map of `{}`", keys.join("`, `"))
        }
        "object" => "map".into(),
        "boolean" => "`true` or `false`".into(),
        "integer" => "whole number".into(),
        "string" => "text".into(),
        "null" => String::new(),
        t => t.into(),
    };
    match &v["type"] {
        Value::String(t) => kind(t),
        Value::Array(all) => all.iter().filter_map(Value::as_str).map(kind).filter(|s| !s.is_empty()).collect::<Vec<_>>().join(" or "),
        _ => String::new(),
    }
}

/// Names of the definitions that a part of the schema refers to.
fn references<'a>(v: &'a Value, out: &mut BTreeSet<&'a str>) {
    match v {
        Value::Object(map) => {
            for (key, v) in map {
                match v.as_str() {
                    Some(r) if key == "$ref" => {
                        out.extend(r.rsplit('/').next());
                    }
                    _ => references(v, out),
                }
            }
        }
        Value::Array(all) => all.iter().for_each(|v| references(v, out)),
        _ => {}
    }
}
