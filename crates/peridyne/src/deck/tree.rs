//! A YAML text as a tree of nodes that remember their place.
//!
//! The tree keeps scalars as text: what a scalar means is decided by the key that reads it, so that a wrong value
//! in one place hides nothing elsewhere. `${name}` is replaced here, node by node, so that places stay exact and a
//! replacement cannot change the structure around it.
use super::report::Issue;
use super::source::{Sources, Span};
use granit_parser::{Event, Parser, ScalarStyle};
use std::collections::HashMap;

/// More nodes than any deck needs; bounds what aliases of aliases can grow to.
const MOST_NODES: usize = 200_000;
/// Most nodes and characters that `${…}` may put into a deck.
const MOST_PLACED: usize = 1_000_000;
/// Deepest nesting, bounded so that walking the tree cannot exhaust the call stack.
const DEEPEST: usize = 64;

/// A node and its place.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    pub span: Span,
    pub content: Content,
}

#[derive(Debug, Clone)]
pub(crate) enum Content {
    Scalar(Scalar),
    List(Vec<Node>),
    Map(Vec<Entry>),
}

#[derive(Debug, Clone)]
pub(crate) struct Scalar {
    pub text: String,
    pub quoted: bool,
    /// Whether `${…}` was replaced in it: then places inside the text are not places in the file.
    pub replaced: bool,
}

#[derive(Debug, Clone)]
pub(crate) struct Entry {
    pub key: String,
    pub key_span: Span,
    pub value: Node,
}

impl Node {
    pub fn scalar(text: impl Into<String>, span: Span) -> Self {
        Self { span, content: Content::Scalar(Scalar { text: text.into(), quoted: false, replaced: true }) }
    }

    pub fn as_scalar(&self) -> Option<&Scalar> {
        match &self.content {
            Content::Scalar(scalar) => Some(scalar),
            _ => None,
        }
    }

    pub fn entries(&self) -> &[Entry] {
        match &self.content {
            Content::Map(entries) => entries,
            _ => &[],
        }
    }

    pub fn get(&self, key: &str) -> Option<&Node> {
        self.entries().iter().find(|entry| entry.key == key).map(|entry| &entry.value)
    }

    /// The entries of a map, to be changed; none of anything else.
    pub fn entries_mut(&mut self) -> &mut [Entry] {
        match &mut self.content {
            Content::Map(entries) => entries,
            _ => &mut [],
        }
    }

    /// The value of a key, to be changed.
    pub fn get_mut(&mut self, key: &str) -> Option<&mut Node> {
        self.entries_mut().iter_mut().find(|entry| entry.key == key).map(|entry| &mut entry.value)
    }

    /// Takes a key out of a map.
    pub fn remove(&mut self, key: &str) {
        if let Content::Map(entries) = &mut self.content {
            entries.retain(|entry| entry.key != key);
        }
    }

    /// Whether nothing was written: `key:` alone, `~` or `null`.
    pub fn is_null(&self) -> bool {
        self.as_scalar().is_some_and(|scalar| !scalar.quoted && matches!(scalar.text.as_str(), "" | "~" | "null"))
    }

    /// What stands here, for messages: `` `72 mm` ``, `a list`.
    pub fn shown(&self) -> String {
        match &self.content {
            Content::Scalar(_) if self.is_null() => "nothing".into(),
            Content::Scalar(scalar) if scalar.text.chars().count() > 60 => {
                format!("`{}…`", scalar.text.chars().take(60).collect::<String>())
            }
            Content::Scalar(scalar) => format!("`{}`", scalar.text),
            Content::List(_) => "a list".into(),
            Content::Map(_) => "a map of keys".into(),
        }
    }

    /// The same content, all of it placed at `span`.
    pub fn placed_at(&self, span: Span) -> Self {
        let content = match &self.content {
            Content::Scalar(scalar) => Content::Scalar(Scalar { replaced: true, ..scalar.clone() }),
            Content::List(items) => Content::List(items.iter().map(|item| item.placed_at(span)).collect()),
            Content::Map(entries) => Content::Map(
                entries.iter().map(|entry| Entry { key: entry.key.clone(), key_span: span, value: entry.value.placed_at(span) }).collect(),
            ),
        };
        Self { span, content }
    }

    /// The content as one line of YAML.
    pub fn text(&self) -> String {
        match &self.content {
            Content::Scalar(scalar) => scalar.text.clone(),
            Content::List(items) => format!("[{}]", items.iter().map(Node::text).collect::<Vec<_>>().join(", ")),
            Content::Map(entries) => {
                let inner: Vec<String> = entries.iter().map(|entry| format!("{}: {}", entry.key, entry.value.text())).collect();
                format!("{{{}}}", inner.join(", "))
            }
        }
    }

    fn size_and_depth(&self) -> (usize, usize) {
        let children: Box<dyn Iterator<Item = &Node>> = match &self.content {
            Content::Scalar(_) => return (1, 1),
            Content::List(items) => Box::new(items.iter()),
            Content::Map(entries) => Box::new(entries.iter().map(|entry| &entry.value)),
        };
        let (mut size, mut depth) = (1, 0);
        for child in children {
            let (child_size, child_depth) = child.size_and_depth();
            size += child_size;
            depth = depth.max(child_depth);
        }
        (size, depth + 1)
    }

    /// The dotted path of the key or value at `span`, innermost last.
    pub fn path_of(&self, span: Span) -> String {
        let mut path = String::new();
        self.extend_path(span, &mut path);
        path
    }

    fn extend_path(&self, span: Span, path: &mut String) {
        let holds = |outer: Span| outer.source == span.source && outer.start <= span.start && span.end <= outer.end;
        match &self.content {
            Content::Scalar(_) => {}
            Content::List(items) => {
                if let Some(index) = items.iter().position(|item| holds(item.span)) {
                    path.push_str(&format!("[{index}]"));
                    items[index].extend_path(span, path);
                }
            }
            Content::Map(entries) => {
                if let Some(entry) = entries.iter().find(|entry| holds(entry.key_span) || holds(entry.value.span)) {
                    if !path.is_empty() {
                        path.push('.');
                    }
                    path.push_str(&entry.key);
                    if !holds(entry.key_span) {
                        entry.value.extend_path(span, path);
                    }
                }
            }
        }
    }

    /// Replaces every `${name}` in keys and values by what `find` gives for the name.
    pub fn replace(&mut self, find: &Find, into: &mut Replacing) {
        let span = self.span;
        let before = into.issues.len();
        match &mut self.content {
            Content::Scalar(scalar) => {
                if let Some(whole) = lone_name(&scalar.text)
                    && !scalar.quoted
                {
                    match find(whole) {
                        Ok(node) => {
                            let (size, depth) = node.size_and_depth();
                            if into.fits(size, depth, span) {
                                *self = node.placed_at(span);
                            }
                        }
                        Err(fault) => into.note(fault, whole, span, &scalar.text),
                    }
                } else if scalar.text.contains("${") {
                    scalar.text = replace_in(&scalar.text, span, find, into);
                    scalar.replaced = true;
                }
                if into.issues.len() > before {
                    into.broken.push(span);
                }
            }
            Content::List(items) => items.iter_mut().for_each(|item| item.replace(find, into)),
            Content::Map(entries) => {
                for entry in entries {
                    if entry.key.contains("${") {
                        entry.key = replace_in(&entry.key, entry.key_span, find, into);
                    }
                    entry.value.replace(find, into);
                }
            }
        }
    }
}

/// Finds what `${name}` stands for.
pub(crate) type Find<'a> = dyn Fn(&str) -> Result<Node, Replace> + 'a;

/// What replacing needs, and what it leaves.
pub(crate) struct Replacing<'a> {
    pub sources: &'a Sources,
    pub issues: &'a mut Vec<Issue>,
    /// Scalars in which something could not be replaced: what they say further on is no fault of its own.
    pub broken: Vec<Span>,
    /// Nodes and characters put in so far, bounded because parameters may repeat parameters.
    pub placed: usize,
}

impl Replacing<'_> {
    fn fits(&mut self, size: usize, depth: usize, span: Span) -> bool {
        self.placed = self.placed.saturating_add(size);
        let fits = self.placed <= MOST_PLACED && depth < DEEPEST / 2;
        if !fits {
            let issue = Issue::new(span, "parameters in parameters make the deck too large", "write the value out");
            self.issues.push(issue);
        }
        fits
    }

    fn note(&mut self, fault: Replace, name: &str, span: Span, text: &str) {
        let issue = fault.issue(name, span, text, self.sources);
        self.issues.push(issue);
    }
}

/// Why a `${name}` cannot be replaced.
pub(crate) struct Replace {
    pub message: String,
    pub help: String,
}

impl Replace {
    fn issue(self, name: &str, span: Span, text: &str, sources: &Sources) -> Issue {
        // The place within the scalar, when the scalar stands in the file as it reads.
        let written = sources.slice(span);
        let span = match written.find(&format!("${{{name}}}")) {
            Some(at) if text.len() <= written.len() => {
                let start = span.start + at as u32;
                Span { start, end: start + name.len() as u32 + 3, ..span }
            }
            _ => span,
        };
        Issue::new(span, self.message, self.help)
    }
}

fn lone_name(text: &str) -> Option<&str> {
    let name = text.strip_prefix("${")?.strip_suffix('}')?;
    is_name(name).then_some(name)
}

fn is_name(text: &str) -> bool {
    text.starts_with(|c: char| c.is_alphabetic() || c == '_') && text.chars().all(|c| c.is_alphanumeric() || c == '_')
}

fn replace_in(text: &str, span: Span, find: &Find, into: &mut Replacing) -> String {
    let mut result = String::new();
    let mut rest = text;
    while let Some(start) = rest.find("${") {
        result.push_str(&rest[..start]);
        rest = &rest[start + 2..];
        let Some(end) = rest.find('}') else {
            let issue = Issue::new(span, "`${` has no `}`", "write `${name}`");
            into.issues.push(issue);
            return result;
        };
        let name = &rest[..end];
        rest = &rest[end + 1..];
        let found = if is_name(name) {
            find(name)
        } else {
            Err(Replace {
                message: format!("`${{{name}}}` does not name a parameter"),
                help: "write `${name}` with the name of a parameter".into(),
            })
        };
        match found.map(|node| node.as_scalar().map(|scalar| scalar.text.clone())) {
            Ok(Some(value)) => {
                if into.fits(value.len(), 0, span) {
                    result.push_str(&value);
                }
            }
            Ok(None) => into.issues.push(Issue::new(
                span,
                format!("parameter `{name}` is a list or a map, which cannot stand inside a text"),
                "let `${…}` be the whole value",
            )),
            Err(fault) => into.note(fault, name, span, text),
        }
    }
    result.push_str(rest);
    result
}

/// Hides the braces of `${name}` from YAML, to which they would open a map in `{control: ${control}}`.
///
/// The hidden text has the same length, so that places stay exact.
fn hide(text: &str) -> String {
    let mut hidden = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find("${") {
        let (head, tail) = rest.split_at(start + 2);
        let name = tail.find('}').map(|end| &tail[..end]).filter(|name| is_name(name));
        match name {
            Some(name) => {
                hidden.push_str(&head[..start]);
                hidden.push_str("$<");
                hidden.push_str(name);
                hidden.push('>');
                rest = &tail[name.len() + 1..];
            }
            None => {
                hidden.push_str(head);
                rest = tail;
            }
        }
    }
    hidden.push_str(rest);
    hidden
}

/// Undoes [`hide`] in a scalar. `$<name>` typed by a user is read as `${name}` too; it has no other use in a deck.
fn show(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find("$<") {
        shown.push_str(&rest[..start]);
        let tail = &rest[start + 2..];
        match tail.find('>').map(|end| &tail[..end]).filter(|name| is_name(name)) {
            Some(name) => {
                shown.push_str(&format!("${{{name}}}"));
                rest = &tail[name.len() + 1..];
            }
            None => {
                shown.push_str("$<");
                rest = tail;
            }
        }
    }
    shown.push_str(rest);
    shown
}

struct Builder<'a> {
    source: u32,
    text: &'a str,
    anchors: HashMap<usize, (Node, usize)>,
    issues: &'a mut Vec<Issue>,
    nodes: usize,
}

/// Reads a source text into a tree; duplicate keys, tags and the like are noted and reading goes on.
///
/// `None` after a fault of YAML itself, which is noted too.
pub(crate) fn read(sources: &Sources, source: u32, issues: &mut Vec<Issue>) -> Option<Node> {
    let span = Span { source, start: 0, end: 0 };
    let text = hide(&sources.get(span)?.text);
    let mut builder = Builder { source, text: &text, anchors: HashMap::new(), issues, nodes: 0 };
    let mut parser = Parser::new_from_str(&text);
    match builder.document(&mut parser) {
        Ok(node) => Some(node),
        Err(issue) => {
            builder.issues.push(issue);
            None
        }
    }
}

/// Reads a fragment of YAML that belongs to the program: a default value.
pub(crate) fn fragment(text: &str, span: Span) -> Node {
    let mut issues = Vec::new();
    let mut builder = Builder { source: 0, text, anchors: HashMap::new(), issues: &mut issues, nodes: 0 };
    let node = builder.document(&mut Parser::new_from_str(text)).unwrap_or_else(|_| Node::scalar(text, span));
    node.placed_at(span)
}

type Events<'a> = Parser<'a, granit_parser::StrInput<'a>>;

impl Builder<'_> {
    fn span(&self, span: &granit_parser::Span) -> Span {
        let range = span.byte_range().unwrap_or(0..0);
        // The span of a block ends where the next token begins; blanks after the content are not part of it.
        let written = self.text.get(range.clone()).unwrap_or("");
        let end = range.start + written.trim_end().len();
        Span { source: self.source, start: range.start as u32, end: end as u32 }
    }

    fn next<'t>(&self, events: &mut Events<'t>) -> Result<(Event<'t>, Span), Issue> {
        loop {
            match events.next_event() {
                Some(Ok((Event::Comment(..), _))) => {}
                Some(Ok((event, span))) => return Ok((event, self.span(&span))),
                Some(Err(error)) => {
                    let start = error.marker().byte_offset().unwrap_or(0).min(self.text.len()) as u32;
                    let span = Span { source: self.source, start, end: start };
                    let help = "check indentation, the space after `:`, and that quotes, `[` and `{` are closed; \
                                quote texts that contain `: ` or begin with `*`, `&`, `!`, `%`, `@`";
                    return Err(Issue::new(span, format!("this is not YAML: {}", error.info()), help));
                }
                None => {
                    return Err(Issue::new(Span { source: self.source, ..Span::default() }, "the text ends too early", ""));
                }
            }
        }
    }

    fn document(&mut self, events: &mut Events<'_>) -> Result<Node, Issue> {
        loop {
            let (event, span) = self.next(events)?;
            match event {
                Event::StreamStart | Event::DocumentStart(..) => {}
                Event::StreamEnd | Event::DocumentEnd => return Ok(Node::scalar("", span)),
                event => {
                    let node = self.node(event, span, events, 0)?;
                    self.end(events)?;
                    return Ok(node);
                }
            }
        }
    }

    fn end(&mut self, events: &mut Events<'_>) -> Result<(), Issue> {
        loop {
            match self.next(events)? {
                (Event::StreamEnd, _) => return Ok(()),
                (Event::DocumentStart(..), span) => {
                    return Err(Issue::new(span, "a second document begins here", "a deck is one YAML document: remove the `---`"));
                }
                _ => {}
            }
        }
    }

    fn node<'t>(&mut self, event: Event<'t>, span: Span, events: &mut Events<'t>, depth: usize) -> Result<Node, Issue> {
        if depth > DEEPEST {
            return Err(Issue::new(span, "the deck is nested too deeply", format!("at most {DEEPEST} levels are read")));
        }
        if event.tag().is_some() {
            self.issues.push(Issue::new(span, "YAML tags (`!…`) mean nothing in a deck", "remove the tag, or quote the text"));
        }
        self.nodes += 1;
        let mut whole = span;
        let (content, anchor) = match event {
            Event::Scalar(text, style, anchor, _) => {
                let quoted = style != ScalarStyle::Plain;
                (Content::Scalar(Scalar { text: show(&text), quoted, replaced: false }), anchor)
            }
            Event::SequenceStart(_, anchor, _) => {
                let mut items = Vec::new();
                loop {
                    match self.next(events)? {
                        (Event::SequenceEnd, end) => {
                            whole.end = end.end.max(whole.end);
                            break;
                        }
                        (event, span) => items.push(self.node(event, span, events, depth + 1)?),
                    }
                }
                (Content::List(items), anchor)
            }
            Event::MappingStart(_, anchor, _) => {
                let mut entries: Vec<Entry> = Vec::new();
                loop {
                    let (event, span) = self.next(events)?;
                    if event == Event::MappingEnd {
                        whole.end = span.end.max(whole.end);
                        break;
                    }
                    let key = self.node(event, span, events, depth + 1)?;
                    let (event, span) = self.next(events)?;
                    let value = self.node(event, span, events, depth + 1)?;
                    let Content::Scalar(Scalar { text, .. }) = key.content else {
                        self.issues.push(Issue::new(key.span, "a key must be a word", "write `key: value`"));
                        continue;
                    };
                    if let Some(first) = entries.iter().find(|entry| entry.key == text) {
                        let line = self.text[..first.key_span.start as usize].matches('\n').count() + 1;
                        let message = format!("key `{text}` is given twice, first in line {line}");
                        self.issues.push(Issue::new(key.span, message, "keep one of them"));
                        continue;
                    }
                    entries.push(Entry { key: text, key_span: key.span, value });
                }
                (Content::Map(entries), anchor)
            }
            Event::Alias(id) => {
                let Some((node, height)) = self.anchors.get(&id).cloned() else {
                    return Err(Issue::new(span, "an alias cannot stand inside the node it repeats", "write the value out"));
                };
                let (size, _) = node.size_and_depth();
                self.nodes += size;
                if self.nodes > MOST_NODES || depth + height > DEEPEST {
                    return Err(Issue::new(span, "aliases make the deck too large", "write the value out"));
                }
                return Ok(node.placed_at(span));
            }
            _ => {
                return Err(Issue::new(span, "a value is expected here", "write `key: value`"));
            }
        };
        // Collections end where their last child ends: the end event stands at the next token.
        if let (Content::Map(_) | Content::List(_), true) =
            (&content, self.text[whole.start as usize..].starts_with(|c| c != '{' && c != '['))
        {
            let last = match &content {
                Content::Map(entries) => entries.last().map(|entry| entry.value.span.end.max(entry.key_span.end)),
                Content::List(items) => items.last().map(|item| item.span.end),
                Content::Scalar(_) => None,
            };
            whole.end = last.unwrap_or(whole.end).max(whole.start);
        }
        let node = Node { span: whole, content };
        if anchor != 0 {
            let (_, height) = node.size_and_depth();
            self.anchors.insert(anchor, (node.clone(), height));
        }
        Ok(node)
    }
}
