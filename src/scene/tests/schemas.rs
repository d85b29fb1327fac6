//! The published schemas.

use super::super::*;
use std::path::Path;

/// The published schemas are those of the code. To write them again, run this test with the environment
/// variable `UPDATE_EXPECTED` set, or use `hairbake schema groom > pipeline/schemas/groom.schema.json` and
/// the same with `anim`.
#[test]
fn published_schemas_are_current() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipeline/schemas");
    for (format, name) in [(Format::Groom, "groom"), (Format::Anim, "anim")] {
        let path = folder.join(format!("{name}.schema.json"));
        if std::env::var_os("UPDATE_EXPECTED").is_some() {
            std::fs::write(&path, schema(format)).unwrap();
        }
        let published = std::fs::read_to_string(path).unwrap();
        assert!(
            published == schema(format),
            "{name}.schema.json is out of date: write it again with `hairbake schema {name}`"
        );
    }
}

#[test]
fn every_key_has_a_description() {
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
