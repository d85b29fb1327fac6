//! JSON Schemas of the formats.

use schemars::JsonSchema;
use serde_json::Value;

/// The JSON Schema of `T`. Its descriptions are the doc comments of `T`, each paragraph on one line.
pub fn schema_of<T: JsonSchema>() -> Value {
    let mut schema = schemars::schema_for!(T).to_value();
    join_lines(&mut schema);
    schema
}

/// Joins the lines of each paragraph of the descriptions in `schema`.
fn join_lines(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            for (name, value) in map {
                match value {
                    Value::String(text) if name == "description" => {
                        let paragraphs: Vec<String> =
                            text.split("\n\n").map(|paragraph| paragraph.replace('\n', " ")).collect();
                        *text = paragraphs.join("\n\n");
                    }
                    value => join_lines(value),
                }
            }
        }
        Value::Array(elements) => elements.iter_mut().for_each(join_lines),
        _ => {}
    }
}
