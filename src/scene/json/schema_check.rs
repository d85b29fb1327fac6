//! Checks a JSON value against the JSON Schema of its format and reports every error, not only the first.
//! Supports the keywords that schemars emits for our structs, no others.

use super::describe::{alternatives, branches, describe, nearest, property_names, range, resolve, show};
use super::diagnostics::{Diagnostics, MAX_REPORTED};
use super::key::{Key, Step};
use serde_json::{Map, Value};

/// Reports all that `schema` forbids in `value`. Returns the optional properties that hold a value of a wrong
/// type: once they are removed, the file can be deserialised unless a required value is wrong.
pub fn check(value: &Value, schema: &Value, diagnostics: &mut Diagnostics) -> Vec<Key> {
    let mut checker =
        Checker { defs: &schema["$defs"], key: Key::default(), optional: 0, diagnostics, removable: vec![] };
    checker.value(value, schema);
    checker.removable
}

/// Removes the property at `key`.
pub fn remove(value: &mut Value, key: &Key) {
    let Some((last, path)) = key.0.split_last() else { return };
    let parent = path.iter().try_fold(value, |value, step| match step {
        Step::Name(name) => value.get_mut(name),
        Step::Index(i) => value.get_mut(i),
    });
    if let (Some(Value::Object(map)), Step::Name(name)) = (parent, last) {
        map.remove(name);
    }
}

struct Checker<'a> {
    /// Shared definitions of the schema.
    defs: &'a Value,
    /// Place of the value being checked.
    key: Key,
    /// Length of the longest start of `key` that is an optional property; 0 if there is none.
    optional: usize,
    diagnostics: &'a mut Diagnostics,
    /// Optional properties with a value of a wrong type.
    removable: Vec<Key>,
}

impl<'a> Checker<'a> {
    fn value(&mut self, value: &Value, schema: &'a Value) {
        let schema = resolve(self.defs, schema);
        if let Some(branches) = branches(schema) {
            return self.alternatives(value, branches);
        }
        if !self.fits(value, schema) {
            return self.invalid(format!("invalid value: {}", show(value)), describe(self.defs, schema));
        }
        match value {
            Value::Number(number) => self.bounds(number.as_f64().unwrap_or(f64::NAN), schema),
            Value::Array(elements) => self.array(elements, schema),
            Value::Object(map) => self.object(map, schema),
            _ => {}
        }
    }

    /// Checks a value with alternatives. Of those that fit it by type and tag, reports the errors of the one
    /// with the fewest.
    fn alternatives(&mut self, value: &Value, branches: &'a [Value]) {
        let mut best: Option<(Diagnostics, Vec<Key>)> = None;
        for branch in branches {
            if !self.fits(value, resolve(self.defs, branch)) {
                continue;
            }
            let mut diagnostics = Diagnostics::default();
            let mut checker = Checker {
                defs: self.defs,
                key: self.key.clone(),
                optional: self.optional,
                diagnostics: &mut diagnostics,
                removable: vec![],
            };
            checker.value(value, branch);
            let removable = checker.removable;
            if best.as_ref().is_none_or(|(b, _)| diagnostics.len() < b.len()) {
                best = Some((diagnostics, removable));
            }
        }
        match best {
            Some((diagnostics, removable)) => {
                self.diagnostics.own.extend(diagnostics.own);
                self.removable.extend(removable);
            }
            None => self.no_alternative(value, branches),
        }
    }

    /// Reports a value that fits none of the alternatives. If a tag tells these apart, the tag is wrong.
    fn no_alternative(&mut self, value: &Value, branches: &'a [Value]) {
        let tags: Vec<&Value> =
            branches.iter().map(|b| &resolve(self.defs, b)["properties"]["type"]["const"]).collect();
        if !value.is_object() || tags.iter().any(|tag| tag.is_null()) {
            let message = format!("invalid value: {}", show(value));
            return self.invalid(message, alternatives(self.defs, branches));
        }
        let allowed = tags.iter().map(|tag| tag.to_string()).collect::<Vec<_>>().join(", ");
        let (message, help) = match value.get("type") {
            Some(tag) => (format!("invalid value: {}", show(tag)), "use an allowed value"),
            None => ("required key is missing".into(), "add \"type\""),
        };
        self.mark_removable();
        self.diagnostics.add(&self.key.name("type"), message, allowed, help);
    }

    /// Whether `value` has the type, the constant, the enumeration and the tag of `schema`.
    fn fits(&self, value: &Value, schema: &'a Value) -> bool {
        if let Some(branches) = branches(schema) {
            return branches.iter().any(|b| self.fits(value, resolve(self.defs, b)));
        }
        let types_fit = match &schema["type"] {
            Value::String(name) => is_type(value, name, schema),
            Value::Array(names) => names.iter().filter_map(Value::as_str).any(|n| is_type(value, n, schema)),
            _ => true,
        };
        let tag = &schema["properties"]["type"]["const"];
        types_fit
            && schema.get("const").is_none_or(|c| c == value)
            && schema["enum"].as_array().is_none_or(|all| all.contains(value))
            && (tag.is_null() || value.get("type") == Some(tag))
    }

    fn bounds(&mut self, x: f64, schema: &Value) {
        let bound = |name: &str| schema[name].as_f64();
        let inside = bound("minimum").is_none_or(|b| x >= b) && bound("maximum").is_none_or(|b| x <= b);
        if !inside {
            let allowed = self.with_unit(range(schema).unwrap_or_default());
            self.diagnostics.add(
                &self.key,
                format!("{x} is out of range"),
                allowed,
                "use a value in the allowed range",
            );
        }
    }

    fn array(&mut self, elements: &[Value], schema: &'a Value) {
        let bound = |name: &str| schema[name].as_u64().map(|n| n as usize);
        let n = elements.len();
        if bound("minItems").is_some_and(|b| n < b) || bound("maxItems").is_some_and(|b| n > b) {
            return self.invalid(format!("array has length {n}"), describe(self.defs, schema));
        }
        let before = self.diagnostics.len();
        if let Some(items) = schema.get("items") {
            for (i, element) in elements.iter().enumerate() {
                self.key.0.push(Step::Index(i));
                self.value(element, items);
                self.key.0.pop();
                if self.diagnostics.len() - before >= MAX_REPORTED {
                    break;
                }
            }
        }
    }

    fn object(&mut self, map: &Map<String, Value>, schema: &'a Value) {
        let required: Vec<&str> =
            schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        for name in required.iter().filter(|name| !map.contains_key(**name)) {
            self.missing(name, &schema["properties"][*name]);
        }
        for (name, value) in map {
            match schema["properties"].get(name) {
                Some(property) => {
                    let outer = self.optional;
                    self.key.0.push(Step::Name(name.clone()));
                    if !required.contains(&name.as_str()) {
                        self.optional = self.key.0.len();
                    }
                    self.value(value, property);
                    self.key.0.pop();
                    self.optional = outer;
                }
                None if schema["additionalProperties"] == Value::Bool(false) => self.unknown(name, schema),
                None => {}
            }
        }
    }

    /// Reports that the required property `name` is missing.
    fn missing(&mut self, name: &str, property: &Value) {
        let description = property["description"].as_str();
        let meaning = description.and_then(|d| d.split_terminator(['.', ';', '\n']).next());
        let help = match meaning {
            Some(meaning) => format!("add \"{name}\" ({})", lower_first(meaning)),
            None => format!("add \"{name}\""),
        };
        self.mark_removable();
        let allowed = describe(self.defs, property);
        self.diagnostics.add(&self.key.name(name), "required key is missing", allowed, help);
    }

    /// Reports that the property `name` is not in the schema.
    fn unknown(&mut self, name: &str, schema: &Value) {
        let names = property_names(schema);
        let help = match nearest(name, &names) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => "remove it".into(),
        };
        self.diagnostics.add(&self.key.name(name), "unknown key", names.join(", "), help);
    }

    /// Reports a value of a wrong type or length.
    fn invalid(&mut self, message: String, allowed: String) {
        self.mark_removable();
        let allowed = self.with_unit(allowed);
        self.diagnostics.add(&self.key, message, allowed, "use an allowed value");
    }

    /// `allowed` with the unit of the key, if numbers are allowed and nothing else.
    fn with_unit(&self, allowed: String) -> String {
        let numbers = !allowed.contains(['"', '{']) && allowed.contains(|c: char| c.is_ascii_digit());
        match self.key.unit().filter(|_| numbers) {
            Some(unit) => format!("{allowed} {unit}"),
            None => allowed,
        }
    }

    fn mark_removable(&mut self) {
        if self.optional > 0 {
            self.removable.push(Key(self.key.0[..self.optional].to_vec()));
        }
    }
}

/// `text` with a lower-case first letter, unless it starts with an acronym.
fn lower_first(text: &str) -> String {
    let mut chars = text.chars();
    match (chars.next(), text.chars().nth(1)) {
        (Some(first), second) if !second.is_some_and(char::is_uppercase) => {
            first.to_lowercase().chain(chars).collect()
        }
        _ => text.into(),
    }
}

/// Whether `value` has the JSON Schema type `name`. An integer must also fit the width in `format`.
fn is_type(value: &Value, name: &str, schema: &Value) -> bool {
    match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        "integer" => match schema["format"].as_str() {
            Some("int32") => value.as_i64().is_some_and(|i| i32::try_from(i).is_ok()),
            Some("uint32") => value.as_u64().is_some_and(|i| u32::try_from(i).is_ok()),
            _ => value.is_i64() || value.is_u64(),
        },
        _ => false,
    }
}
