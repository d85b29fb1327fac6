//! Checks a JSON value against the JSON Schema of its format and notes every fault, not just the first.
//! Covers the keywords that schemars emits for our structs, nothing else.

use super::describe::{alternatives, branches, describe, nearest, range, resolve, show};
use super::{Faults, Key, MAX_NAMED, Step};
use serde_json::Value;

/// Notes in `faults` all that `schema` forbids in `value`. Returns the optional properties that hold a
/// value of a wrong type: without them the rest can still be read.
pub fn check(value: &Value, schema: &Value, faults: &mut Faults) -> Vec<Key> {
    let mut walk =
        Walk { defs: &schema["$defs"], key: Key::default(), optional: 0, faults, removable: vec![] };
    walk.value(value, schema);
    walk.removable
}

/// Removes the property at `key`.
pub fn remove(value: &mut Value, key: &Key) {
    let Some((last, way)) = key.0.split_last() else { return };
    let parent = way.iter().try_fold(value, |value, step| match step {
        Step::Name(name) => value.get_mut(name),
        Step::Index(i) => value.get_mut(i),
    });
    if let (Some(Value::Object(map)), Step::Name(name)) = (parent, last) {
        map.remove(name);
    }
}

struct Walk<'a> {
    defs: &'a Value,
    key: Key,
    /// Length of the longest start of `key` that names an optional property; 0 where there is none.
    optional: usize,
    faults: &'a mut Faults,
    removable: Vec<Key>,
}

impl<'a> Walk<'a> {
    fn value(&mut self, value: &Value, schema: &'a Value) {
        let schema = resolve(self.defs, schema);
        if let Some(branches) = branches(schema) {
            return self.choice(value, branches);
        }
        if !self.fits(value, schema) {
            return self.wrong(format!("is {}", show(value)), describe(self.defs, schema));
        }
        match value {
            Value::Number(number) => self.bounds(number.as_f64().unwrap_or(f64::NAN), schema),
            Value::Array(elements) => self.array(elements, schema),
            Value::Object(_) => self.object(value, schema),
            _ => {}
        }
    }

    /// One of several forms: those that the value can be meant as by type and tag; of these the one with
    /// the fewest faults.
    fn choice(&mut self, value: &Value, branches: &'a [Value]) {
        let mut best: Option<(Faults, Vec<Key>)> = None;
        for branch in branches {
            if !self.fits(value, resolve(self.defs, branch)) {
                continue;
            }
            let mut faults = Faults::default();
            let mut walk = Walk {
                defs: self.defs,
                key: self.key.clone(),
                optional: self.optional,
                faults: &mut faults,
                removable: vec![],
            };
            walk.value(value, branch);
            let removable = walk.removable;
            if best.as_ref().is_none_or(|(b, _)| faults.len() < b.len()) {
                best = Some((faults, removable));
            }
        }
        match best {
            Some((faults, removable)) => {
                self.faults.list.extend(faults.list);
                self.removable.extend(removable);
            }
            None => self.no_branch(value, branches),
        }
    }

    /// A value that none of several forms admits. Where a tag tells them apart the tag is at fault.
    fn no_branch(&mut self, value: &Value, branches: &'a [Value]) {
        let tags: Vec<&Value> =
            branches.iter().map(|b| &resolve(self.defs, b)["properties"]["type"]["const"]).collect();
        if !value.is_object() || tags.iter().any(|tag| tag.is_null()) {
            return self.wrong(format!("is {}", show(value)), alternatives(self.defs, branches));
        }
        let allowed = tags.iter().map(|tag| tag.to_string()).collect::<Vec<_>>().join(", ");
        let what = value.get("type").map_or("is missing".into(), |tag| format!("is {}", show(tag)));
        self.note_removable();
        self.faults.add(&self.key.name("type"), what, allowed, "use one of these");
    }

    /// Whether the type, the constant, the enumeration and the tag of `schema` admit `value`.
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
            let allowed = range(schema).unwrap_or_default();
            let remedy = "use a value in this range; the end of the key names the unit it is read in";
            self.faults.add(&self.key, format!("is {x}"), allowed, remedy);
        }
    }

    fn array(&mut self, elements: &[Value], schema: &'a Value) {
        let bound = |name: &str| schema[name].as_u64().map(|n| n as usize);
        let n = elements.len();
        if bound("minItems").is_some_and(|b| n < b) || bound("maxItems").is_some_and(|b| n > b) {
            return self.wrong(format!("has {n} elements"), describe(self.defs, schema));
        }
        let before = self.faults.len();
        if let Some(items) = schema.get("items") {
            for (i, element) in elements.iter().enumerate() {
                self.key.0.push(Step::Index(i));
                self.value(element, items);
                self.key.0.pop();
                if self.faults.len() - before >= MAX_NAMED {
                    break;
                }
            }
        }
    }

    fn object(&mut self, value: &Value, schema: &'a Value) {
        let Value::Object(map) = value else { return };
        let required: Vec<&str> =
            schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        for name in required.iter().filter(|name| !map.contains_key(**name)) {
            let property = &schema["properties"][*name];
            let meaning =
                property["description"].as_str().and_then(|d| d.split_terminator(['.', ';', '\n']).next());
            let what = meaning.map_or("is missing".into(), |m| format!("is missing: {}", m.to_lowercase()));
            let allowed = describe(self.defs, property);
            self.note_removable();
            self.faults.add(&self.key.name(name), what, allowed, format!("add \"{name}\""));
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
                None if schema["additionalProperties"] == Value::Bool(false) => {
                    let names: Vec<&str> = schema["properties"]
                        .as_object()
                        .into_iter()
                        .flatten()
                        .map(|(n, _)| n.as_str())
                        .collect();
                    let remedy = match nearest(name, &names) {
                        Some(near) => format!("did you mean \"{near}\"?"),
                        None => "remove it".into(),
                    };
                    self.faults.add(
                        &self.key.name(name),
                        "is not a key of this place",
                        names.join(", "),
                        remedy,
                    );
                }
                None => {}
            }
        }
    }

    fn wrong(&mut self, what: String, allowed: String) {
        self.note_removable();
        self.faults.add(&self.key, what, allowed, "correct the value");
    }

    fn note_removable(&mut self) {
        if self.optional > 0 {
            self.removable.push(Key(self.key.0[..self.optional].to_vec()));
        }
    }
}

/// Whether `value` is of the JSON Schema type `name`; integers also must fit the width in `format`.
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
