//! Where a text comes from, and which line and column a place in it has.
use std::path::{Path, PathBuf};

/// A range of bytes of one source text; what every value of a deck remembers, so that later checks can point at it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub struct Span {
    /// Index of the source: 0 is the deck, others are overrides.
    pub source: u32,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

/// One source text and what to call it in messages.
#[derive(Debug, Clone)]
pub struct Source {
    /// The path of the deck, or `--set name`.
    pub name: String,
    /// The text.
    pub text: String,
}

/// The deck text and the texts of the overrides.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    texts: Vec<Source>,
    /// The path of the deck; relative paths in it start from its folder.
    pub path: PathBuf,
}

impl Sources {
    pub(crate) fn new(path: &Path) -> Self {
        Self { texts: Vec::new(), path: path.into() }
    }

    pub(crate) fn add(&mut self, name: String, text: String) -> u32 {
        self.texts.push(Source { name, text });
        (self.texts.len() - 1) as u32
    }

    /// The source that `span` lies in.
    pub fn get(&self, span: Span) -> Option<&Source> {
        self.texts.get(span.source as usize)
    }

    /// The text that `span` covers.
    pub fn slice(&self, span: Span) -> &str {
        self.get(span).and_then(|source| source.text.get(span.start as usize..span.end as usize)).unwrap_or("")
    }

    /// Line and column of the start of `span`, both from 1, columns in characters.
    pub fn line_column(&self, span: Span) -> (usize, usize) {
        let text = self.get(span).map_or("", |source| &source.text);
        let mut start = (span.start as usize).min(text.len());
        while !text.is_char_boundary(start) {
            start -= 1;
        }
        let before = &text[..start];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        (line, column)
    }

    /// The line of text in which `span` starts.
    pub fn line(&self, span: Span) -> &str {
        let (line, _) = self.line_column(span);
        self.get(span).and_then(|source| source.text.lines().nth(line - 1)).unwrap_or("")
    }
}
