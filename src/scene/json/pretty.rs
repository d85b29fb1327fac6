//! JSON formatted for people: an array of plain values takes one line.

use crate::error::{Error, Result};
use crate::file::write_file;
use serde::Serialize;
use serde_json::Value;
use std::path::Path;

/// Writes `value` at `path`, formatted by [`pretty`]. Writes the whole file or nothing.
///
/// # Errors
/// [`Error::Io`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let value = serde_json::to_value(value).map_err(|e| Error::Internal(e.to_string()))?;
    write_file(path, &[pretty(&value)]).map(drop)
}

/// JSON text of `value`, indented by two spaces, with a final newline.
pub fn pretty(value: &Value) -> String {
    let mut text = String::new();
    write(value, 0, &mut text);
    text.push('\n');
    text
}

fn write(value: &Value, depth: usize, text: &mut String) {
    let plain = |v: &Value| !v.is_array() && !v.is_object();
    match value {
        Value::Array(elements) if !elements.iter().all(plain) => {
            write_lines(['[', ']'], elements, depth, text, |element, text| write(element, depth + 1, text));
        }
        Value::Object(map) if !map.is_empty() => {
            write_lines(['{', '}'], map, depth, text, |(name, value), text| {
                text.push_str(&Value::String(name.clone()).to_string());
                text.push_str(": ");
                write(value, depth + 1, text);
            });
        }
        Value::Array(elements) => {
            let row: Vec<String> = elements.iter().map(Value::to_string).collect();
            text.push_str(&format!("[{}]", row.join(", ")));
        }
        plain => text.push_str(&plain.to_string()),
    }
}

/// Writes `items` between `brackets`, one per line.
fn write_lines<T>(
    [open, close]: [char; 2],
    items: impl IntoIterator<Item = T>,
    depth: usize,
    text: &mut String,
    mut write_item: impl FnMut(T, &mut String),
) {
    text.push(open);
    for (i, item) in items.into_iter().enumerate() {
        text.push_str(if i == 0 { "\n" } else { ",\n" });
        text.push_str(&"  ".repeat(depth + 1));
        write_item(item, text);
    }
    text.push('\n');
    text.push_str(&"  ".repeat(depth));
    text.push(close);
}
