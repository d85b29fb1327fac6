use super::super::*;

/// The schemas that are published are those of the code. `INSTA_UPDATE` does not write them: use
/// `hairbake schema groom > pipeline/schemas/groom.schema.json`, and the same with `anim`.
#[test]
fn published_schemas_are_current() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipeline/schemas");
    for (format, name) in [(Format::Groom, "groom"), (Format::Anim, "anim")] {
        let published = std::fs::read_to_string(folder.join(format!("{name}.schema.json"))).unwrap();
        assert!(
            published == schema(format),
            "{name}.schema.json is out of date: write it anew with `hairbake schema {name}`"
        );
    }
}

/// Every key of the formats says what it means.
#[test]
fn every_key_is_described() {
    fn undescribed(schema: &serde_json::Value, at: &str, found: &mut Vec<String>) {
        for (name, property) in schema["properties"].as_object().into_iter().flatten() {
            let place = format!("{at}.{name}");
            if property.get("description").is_none() && property.get("const").is_none() {
                found.push(place.clone());
            }
        }
        for branch in
            ["anyOf", "oneOf"].iter().flat_map(|name| schema[*name].as_array().into_iter().flatten())
        {
            undescribed(branch, at, found);
        }
    }
    for format in [Format::Groom, Format::Anim] {
        let schema: serde_json::Value = serde_json::from_str(&schema(format)).unwrap();
        let mut found = Vec::new();
        undescribed(&schema, "", &mut found);
        let defs = schema["$defs"].as_object().unwrap();
        assert!(defs.len() > 5);
        for (name, schema) in defs {
            undescribed(schema, name, &mut found);
        }
        assert!(found.is_empty(), "{found:?}");
    }
}
