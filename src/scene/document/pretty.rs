//! JSON laid out for people: an array of plain values takes one line.

use serde_json::Value;

/// JSON text of `value` with two-space indent and a final newline.
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
            lines('[', ']', elements, depth, text, |element, text| write(element, depth + 1, text));
        }
        Value::Object(map) if !map.is_empty() => {
            lines('{', '}', map, depth, text, |(name, value), text| {
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

fn lines<T>(
    open: char,
    close: char,
    items: impl IntoIterator<Item = T>,
    depth: usize,
    text: &mut String,
    mut item: impl FnMut(T, &mut String),
) {
    text.push(open);
    for (i, each) in items.into_iter().enumerate() {
        text.push_str(if i == 0 { "\n" } else { ",\n" });
        text.push_str(&"  ".repeat(depth + 1));
        item(each, text);
    }
    text.push('\n');
    text.push_str(&"  ".repeat(depth));
    text.push(close);
}
