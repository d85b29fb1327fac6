//! Words for JSON values and for what a JSON Schema allows.

use serde_json::Value;

/// Longest string that is shown whole, characters.
const MAX_STRING: usize = 40;
/// Longest misspelt key that is compared with the known ones, characters.
const MAX_WORD: usize = 64;

/// `schema`, or the shared definition in `defs` that it refers to.
pub fn resolve<'a>(defs: &'a Value, schema: &'a Value) -> &'a Value {
    match schema["$ref"].as_str().and_then(|r| r.rsplit('/').next()) {
        Some(name) => &defs[name],
        None => schema,
    }
}

/// The alternatives of a schema that has some.
pub fn branches(schema: &Value) -> Option<&Vec<Value>> {
    schema["anyOf"].as_array().or_else(|| schema["oneOf"].as_array())
}

/// The names of the properties of an object schema.
pub fn property_names(schema: &Value) -> Vec<&str> {
    schema["properties"].as_object().into_iter().flatten().map(|(name, _)| name.as_str()).collect()
}

/// What a schema allows.
pub fn describe(defs: &Value, schema: &Value) -> String {
    let schema = resolve(defs, schema);
    if let Some(branches) = branches(schema) {
        return alternatives(defs, branches);
    }
    if let Some(constant) = schema.get("const") {
        return constant.to_string();
    }
    if let Some(all) = schema["enum"].as_array() {
        return all.iter().map(Value::to_string).collect::<Vec<_>>().join(", ");
    }
    let name = match &schema["type"] {
        Value::Array(names) => names.first().and_then(Value::as_str),
        name => name.as_str(),
    };
    match name.unwrap_or("any value") {
        name @ ("number" | "integer") => match range(schema) {
            Some(range) => format!("{name} {range}"),
            None => name.into(),
        },
        "array" => {
            let of = describe(defs, &schema["items"]);
            match schema["minItems"].as_u64() {
                Some(n) if schema["maxItems"].as_u64() == Some(n) => format!("array of {n} × {of}"),
                _ => format!("array of {of}"),
            }
        }
        "object" => {
            let tag = &schema["properties"]["type"]["const"];
            if !tag.is_null() {
                return format!("{{ \"type\": {tag} … }}");
            }
            let names: Vec<String> = property_names(schema).iter().map(|n| format!("\"{n}\"")).collect();
            format!("object {{ {} }}", names.join(", "))
        }
        other => other.into(),
    }
}

/// What any of several schemas allows.
pub fn alternatives(defs: &Value, branches: &[Value]) -> String {
    let mut all: Vec<String> = branches.iter().map(|b| describe(defs, b)).filter(|a| a != "null").collect();
    all.dedup();
    all.join(" or ")
}

/// The bounds of a number, as an interval.
pub fn range(schema: &Value) -> Option<String> {
    let bound = |name: &str| schema[name].as_f64();
    match (bound("minimum"), bound("maximum")) {
        (None, None) => None,
        (Some(low), None) => Some(format!("{} or more", number(low))),
        (None, Some(high)) => Some(format!("{} or less", number(high))),
        (Some(low), Some(high)) if low == high => Some(number(low)),
        (Some(low), Some(high)) => Some(format!("{} to {}", number(low), number(high))),
    }
}

/// A number, with an exponent if it would be long.
fn number(x: f64) -> String {
    if x != 0.0 && !(1e-3..1e5).contains(&x.abs()) { format!("{x:e}") } else { format!("{x}") }
}

/// A value found, shortened.
pub fn show(value: &Value) -> String {
    match value {
        Value::Array(elements) => format!("array of length {}", elements.len()),
        Value::Object(_) => "object".into(),
        Value::String(text) if text.chars().count() > MAX_STRING => {
            format!("\"{}…\"", text.chars().take(MAX_STRING).collect::<String>())
        }
        other => other.to_string(),
    }
}

/// The one of `names` that `word` most likely means; `None` if none is similar.
pub fn nearest<'a>(word: &str, names: &[&'a str]) -> Option<&'a str> {
    let word: Vec<char> = word.to_lowercase().chars().take(MAX_WORD).collect();
    let scored = names.iter().map(|name| {
        let chars: Vec<char> = name.chars().collect();
        // A missing unit or a truncated word is as likely as a typing error.
        let starts = word.len() >= 3 && (chars.starts_with(&word) || word.starts_with(&chars));
        (if starts { 0 } else { edit_distance(&word, &chars) }, *name)
    });
    scored.min().filter(|(distance, name)| *distance <= name.len().max(3) / 3).map(|(_, name)| name)
}

/// Levenshtein distance.
fn edit_distance(a: &[char], b: &[char]) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
