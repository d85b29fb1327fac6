//! Places of keys in the text of a JSON file.

use super::diagnostics::Unplaced;
use super::key::{Key, Step};
use crate::error::Diagnostic;
use jsonc_parser::ast;
use jsonc_parser::common::Ranged;
use std::path::Path;

/// The diagnostics of a file, with their places in its text.
pub fn place(file: &Path, text: &[u8], unplaced: Vec<Unplaced>) -> Vec<Diagnostic> {
    if unplaced.is_empty() {
        return Vec::new();
    }
    let text = std::str::from_utf8(text).unwrap_or_default();
    let parsed = jsonc_parser::parse_to_ast(text, &Default::default(), &Default::default());
    let root = parsed.ok().and_then(|p| p.value);
    let place = |d: Unplaced| Diagnostic {
        span: root.as_ref().map(|root| first_line(text, span(root, &d.key))),
        ..Diagnostic::new(file, d.key.to_string(), d.message, d.allowed, d.help)
    };
    unplaced.into_iter().map(place).collect()
}

/// Finds the places of `diagnostics` in `file`, which has text, where they have a key but no place yet.
pub fn find(file: &Path, diagnostics: &mut [Diagnostic]) {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let parsed = jsonc_parser::parse_to_ast(&text, &Default::default(), &Default::default());
    let Some(root) = parsed.ok().and_then(|parsed| parsed.value) else { return };
    for diagnostic in diagnostics.iter_mut().filter(|d| d.file == file && d.span.is_none()) {
        let key = Key::parse(&diagnostic.key);
        diagnostic.span = key.map(|key| first_line(&text, span(&root, &key)));
    }
}

/// Byte range of the value at `key`, with its name. If there is no such value: of the name or bracket that
/// opens the innermost value on the way to it.
fn span(root: &ast::Value, key: &Key) -> (usize, usize) {
    let mut value = root;
    let mut whole = value.range();
    let mut opening = (whole.start, whole.start + 1);
    for step in &key.0 {
        let next = match (value, step) {
            (ast::Value::Object(object), Step::Name(name)) => {
                // Of duplicate keys the last is the one that was read.
                object.properties.iter().rfind(|p| p.name.as_str() == name).map(|p| {
                    let name_end = p.value.range().start;
                    (&p.value, p.range, (p.range.start, name_end))
                })
            }
            (ast::Value::Array(array), Step::Index(i)) => array.elements.get(*i).map(|e| {
                let range = e.range();
                (e, range, (range.start, range.start + 1))
            }),
            _ => None,
        };
        match next {
            Some(found) => (value, whole, opening) = found,
            None => return opening,
        }
    }
    (whole.start, whole.end)
}

/// The part of a range that is on its first line, as offset and length.
fn first_line(text: &str, (start, end): (usize, usize)) -> (usize, usize) {
    let line = text[start..end].lines().next().unwrap_or_default().trim_end();
    (start, line.trim_end_matches(':').len())
}

/// Byte offset of a line and column, both from 1.
pub fn offset(text: &[u8], line: usize, column: usize) -> usize {
    let start =
        text.split_inclusive(|&b| b == b'\n').take(line.saturating_sub(1)).map(<[u8]>::len).sum::<usize>();
    (start + column.saturating_sub(1)).min(text.len().saturating_sub(1))
}

/// The key of a serde error.
pub fn key(path: &serde_path_to_error::Path) -> Key {
    use serde_path_to_error::Segment;
    let step = |segment: &Segment| match segment {
        Segment::Seq { index } => Some(Step::Index(*index)),
        Segment::Map { key } => Some(Step::Name(key.clone())),
        _ => None,
    };
    Key(path.iter().filter_map(step).collect())
}
