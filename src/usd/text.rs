//! The text (usda) encoding of a [`Layer`]: writer.

use super::layer::{Attribute, Layer, Metadata, Prim, Specifier, Value};
use std::fmt::{Debug, Write};

/// The layer as usda text.
pub fn encode(layer: &Layer) -> String {
    let mut out = Writer { text: "#usda 1.0\n".into(), depth: 0 };
    if !layer.metadata.is_empty() || !layer.sub_layers.is_empty() {
        out.line("(");
        out.depth += 1;
        out.metadata(&layer.metadata);
        if !layer.sub_layers.is_empty() {
            out.line(&format!("subLayers = {}", list(&layer.sub_layers, |p| asset(p))));
        }
        out.depth -= 1;
        out.line(")");
    }
    for prim in &layer.prims {
        out.text.push('\n');
        out.prim(prim);
    }
    out.text
}

struct Writer {
    text: String,
    depth: usize,
}

impl Writer {
    fn line(&mut self, line: &str) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{:1$}{line}", "", 4 * self.depth);
    }

    fn prim(&mut self, prim: &Prim) {
        let specifier = match prim.specifier {
            Specifier::Def => "def",
            Specifier::Over => "over",
            Specifier::Class => "class",
        };
        let space = if prim.type_name.is_empty() { "" } else { " " };
        let head = format!("{specifier}{space}{} {}", prim.type_name, quoted(&prim.name));
        self.with_metadata(&head, &prim.metadata);
        self.line("{");
        self.depth += 1;
        for attribute in &prim.attributes {
            self.attribute(attribute);
        }
        for relationship in &prim.relationships {
            let head = format!("rel {}", relationship.name);
            self.line(&match relationship.targets.as_deref() {
                None => head,
                Some([]) => format!("{head} = None"),
                Some(targets) => format!("{head} = {}", paths(targets)),
            });
        }
        for child in &prim.children {
            self.prim(child);
        }
        self.depth -= 1;
        self.line("}");
    }

    fn attribute(&mut self, a: &Attribute) {
        let variability = if a.uniform { "uniform " } else { "" };
        let declaration = format!("{variability}{} {}", a.type_name, a.name);
        // Metadata may be written once only, with the first statement of the attribute.
        let first = match &a.default {
            Some(value) => format!("{declaration} = {}", value_text(value, self.depth)),
            None => declaration.clone(),
        };
        let has_statements_below = !a.samples.is_empty() || !a.connections.is_empty();
        if a.default.is_some() || !has_statements_below || !a.metadata.is_empty() {
            self.with_metadata(&first, &a.metadata);
        }
        if !a.samples.is_empty() {
            self.line(&format!("{declaration}.timeSamples = {{"));
            for (time, value) in &a.samples {
                self.line(&format!("    {time:?}: {},", value_text(value, self.depth)));
            }
            self.line("}");
        }
        if !a.connections.is_empty() {
            self.line(&format!("{declaration}.connect = {}", paths(&a.connections)));
        }
    }

    fn with_metadata(&mut self, head: &str, metadata: &Metadata) {
        if metadata.is_empty() {
            self.line(head);
        } else {
            self.line(&format!("{head} ("));
            self.depth += 1;
            self.metadata(metadata);
            self.depth -= 1;
            self.line(")");
        }
    }

    fn metadata(&mut self, metadata: &Metadata) {
        for (name, value) in metadata {
            let text = value_text(value, self.depth);
            self.line(&match (name.as_str(), value) {
                ("comment", _) => text,
                ("documentation", _) => format!("doc = {text}"),
                (_, Value::PrependedTokens(_) | Value::PrependedReference(..)) => {
                    format!("prepend {name} = {text}")
                }
                _ => format!("{name} = {text}"),
            });
        }
    }
}

/// Type name written before a dictionary key.
fn dictionary_type(value: &Value) -> &'static str {
    match value {
        Value::Bool(_) => "bool",
        Value::Int(_) => "int",
        Value::Float(_) => "float",
        Value::Double(_) => "double",
        Value::String(_) => "string",
        Value::Token(_) => "token",
        Value::Asset(_) | Value::PrependedReference(..) => "asset",
        Value::Matrix4d(_) => "matrix4d",
        Value::Ints(_) => "int[]",
        Value::Floats(_) => "float[]",
        Value::Float2s(_) => "float2[]",
        Value::Float3s(_) => "float3[]",
        Value::Strings(_) => "string[]",
        Value::Tokens(_) | Value::PrependedTokens(_) => "token[]",
        Value::Dictionary(_) => "dictionary",
        Value::Block => "None",
    }
}

/// A value as text. `depth` is the indentation of its last line; dictionaries take several lines.
fn value_text(value: &Value, depth: usize) -> String {
    match value {
        Value::Bool(b) => b.to_string(),
        Value::Int(i) => i.to_string(),
        Value::Float(f) => number(f),
        Value::Double(d) => number(d),
        Value::String(s) | Value::Token(s) => quoted(s),
        Value::Asset(path) => asset(path),
        Value::PrependedReference(path, prim) => format!("{}<{prim}>", asset(path)),
        Value::Matrix4d(rows) => format!("( {} )", rows.map(|row| tuple(&row)).join(", ")),
        Value::Block => "None".into(),
        Value::Ints(v) => list(v, i32::to_string),
        Value::Floats(v) => list(v, number),
        Value::Float2s(v) => list(v, |x| tuple(x)),
        Value::Float3s(v) => list(v, |x| tuple(x)),
        Value::Strings(v) | Value::Tokens(v) | Value::PrependedTokens(v) => list(v, |s| quoted(s)),
        Value::Dictionary(entries) => {
            let mut out = String::from("{\n");
            for (key, value) in entries {
                let text = value_text(value, depth + 1);
                // Writing to a String cannot fail.
                let _ = writeln!(
                    out,
                    "{:indent$}{} {} = {text}",
                    "",
                    dictionary_type(value),
                    quoted(key),
                    indent = 4 * (depth + 1),
                );
            }
            let _ = write!(out, "{:1$}}}", "", 4 * depth);
            out
        }
    }
}

fn list<T>(items: &[T], item: impl Fn(&T) -> String) -> String {
    format!("[{}]", items.iter().map(item).collect::<Vec<_>>().join(", "))
}

fn tuple(items: &[impl Debug]) -> String {
    format!("({})", items.iter().map(number).collect::<Vec<_>>().join(", "))
}

/// The shortest decimal that parses to the same float. `Debug` writes exponents where `Display` writes long
/// integers, about which USD warns.
fn number(float: &impl Debug) -> String {
    format!("{float:?}")
}

/// Targets or connections: a list, or the path alone if there is only one.
fn paths(paths: &[String]) -> String {
    match paths {
        [path] => format!("<{path}>"),
        _ => list(paths, |path| format!("<{path}>")),
    }
}

fn asset(path: &str) -> String {
    format!("@{path}@")
}

fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            _ => out.push(c),
        }
    }
    out.push('"');
    out
}
