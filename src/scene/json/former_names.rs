//! Former names of keys, which are still read.

use super::diagnostics::Diagnostics;
use super::key::{Key, Step};
use serde_json::Value;

/// A key that was renamed.
struct Renamed {
    /// The property of the root that holds the key.
    section: &'static str,
    former: &'static str,
    current: &'static str,
}

const RENAMED: &[Renamed] = &[Renamed { section: "settings", former: "parting", current: "split_tolerance" }];

/// Replaces former names of keys in the file `root` by the current ones. Returns the keys replaced, each
/// under its current and its former name. Reports a key that is given under both names.
pub fn update(root: &mut Value, diagnostics: &mut Diagnostics) -> Vec<(Key, Key)> {
    let mut replaced = Vec::new();
    for Renamed { section, former, current } in RENAMED {
        let Some(map) = root.get_mut(section).and_then(Value::as_object_mut) else { continue };
        let Some(value) = map.remove(*former) else { continue };
        let [current_key, former_key] = [current, former].map(|name| Key::at(section).name(name));
        if map.contains_key(*current) {
            let message = format!("former name of \"{current}\", which is also given");
            diagnostics.add(&former_key, message, "one of the two", "remove it");
            continue;
        }
        map.insert((*current).into(), value);
        replaced.push((current_key, former_key));
    }
    replaced
}

/// The former name of the key `current` in `section`, if it was renamed.
pub fn former_name(section: &str, current: &str) -> Option<&'static str> {
    RENAMED.iter().find(|r| r.section == section && r.current == current).map(|r| r.former)
}

/// Replaces a former name in `key` by the current one.
pub fn update_key(key: &mut Key) {
    for Renamed { section, former, current } in RENAMED {
        if let [Step::Name(first), Step::Name(second), ..] = &mut key.0[..]
            && first == section
            && second == former
        {
            *second = (*current).into();
        }
    }
}
