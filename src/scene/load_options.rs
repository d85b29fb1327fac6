//! Changes made to the files of a scene as they are read: overridden values and mapped file names.

use super::format::Format;
use super::json::document::Document;
use super::json::former_names;
use super::json::key::{Key, Step};
use crate::error::{Error, Result};
use crate::file::read_file;
use serde::Deserialize;
use serde_json::{Map, Value};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A place in the files of a scene that names another file.
pub(super) struct FileName {
    /// What the named file is to the scene.
    pub role: &'static str,
    /// Key of a list at the root.
    pub list: &'static str,
    /// JSON pointer into each element of the list.
    pub pointer: &'static str,
}

/// All places that name a single file.
pub(super) const FILE_NAMES: [FileName; 3] = [
    FileName { role: "buffer", list: "buffers", pointer: "/uri" },
    FileName { role: "track", list: "bodies", pointer: "/track/file" },
    FileName { role: "collider", list: "colliders", pointer: "/shape/file" },
];

/// The places that name a sequence of files, one for each frame: of a deforming collider, and of the curves
/// of a goal.
pub(super) const SEQUENCE_NAMES: [FileName; 2] = [
    FileName { role: "deformation", list: "colliders", pointer: "/shape/sequence" },
    FileName { role: "goal", list: "goals", pointer: "/sequence" },
];

/// JSON pointer to the name of the stage that an animation puts the motion over. What is read of it is
/// recorded, and not the file.
const OVER_NAME: &str = "/over/file";

/// Changes made to the files of a scene as they are read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LoadOptions {
    /// Values that replace those in the files.
    pub overrides: Vec<Override>,
    /// Maps file names from the machine that wrote the files to this one.
    pub path_map: PathMap,
}

impl LoadOptions {
    /// Reads and parses a file of a scene and applies the options. Places in the text are those of the file
    /// itself.
    ///
    /// # Errors
    /// As [`Document::open`], and [`Error::Usage`] if the file has no place for an override.
    pub(super) fn open(&self, format: Format, path: &Path) -> Result<Document> {
        let mut doc = Document::open(path)?;
        self.apply(format, &mut doc)?;
        Ok(doc)
    }

    /// Applies the options to a file of this format.
    ///
    /// # Errors
    /// [`Error::Usage`] if the file has no place for an override.
    pub(super) fn apply(&self, format: Format, doc: &mut Document) -> Result<()> {
        let root = doc.value_mut();
        self.overrides.iter().filter(|o| o.format == format).try_for_each(|o| o.apply(root))?;
        self.map_file_names(root);
        Ok(())
    }

    fn map_file_names(&self, root: &mut Value) {
        for FileName { list, pointer, .. } in FILE_NAMES.iter().chain(&SEQUENCE_NAMES) {
            let elements = root.get_mut(*list).and_then(Value::as_array_mut);
            for name in elements.into_iter().flatten().filter_map(|e| e.pointer_mut(pointer)) {
                if let Some(mapped) = name.as_str().and_then(|name| self.path_map.map(name)) {
                    *name = Value::String(mapped);
                }
            }
        }
        if let Some(name) = root.pointer_mut(OVER_NAME)
            && let Some(mapped) = name.as_str().and_then(|name| self.path_map.map(name))
        {
            *name = Value::String(mapped);
        }
    }
}

/// A value that replaces one of `groom.json` or `anim.json`.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// The file.
    pub format: Format,
    /// The place in it, such as `materials[0].damping_s`.
    pub key: Key,
    /// The new value.
    pub value: Value,
}

impl Override {
    /// Parses an assignment such as `groom.materials[0].damping_s=0.01`. A value that is not JSON is a
    /// string.
    ///
    /// # Errors
    /// The syntax expected.
    pub fn parse(text: &str) -> std::result::Result<Self, String> {
        let syntax = || {
            "FILE.KEY=VALUE, such as groom.materials[0].friction=0.3 or anim.gravity_m_s2=[0,-1,0]"
                .to_string()
        };
        let (path, value) = text.split_once('=').ok_or_else(syntax)?;
        let (file, path) = path.split_once('.').ok_or_else(syntax)?;
        let format = match file {
            "groom" => Format::Groom,
            "anim" => Format::Anim,
            _ => return Err(syntax()),
        };
        let mut key = Key::parse(path).ok_or_else(syntax)?;
        former_names::update_key(&mut key);
        let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.into()));
        Ok(Override { format, key, value })
    }

    /// File and key, such as `groom.materials[0].damping_s`.
    pub fn name(&self) -> String {
        format!("{}.{}", self.format, self.key)
    }

    fn apply(&self, root: &mut Value) -> Result<()> {
        let mut place = root;
        for step in &self.key.0 {
            let next = match (step, place) {
                (Step::Name(name), Value::Object(map)) => {
                    Some(map.entry(name.as_str()).or_insert_with(|| Value::Object(Map::new())))
                }
                (Step::Index(i), Value::Array(elements)) => elements.get_mut(*i),
                _ => None,
            };
            place =
                next.ok_or_else(|| Error::Usage(format!("--set {}: the file has no such key", self.name())))?;
        }
        place.clone_from(&self.value);
        Ok(())
    }
}

/// Pairs of path prefixes, from and to. The first that matches applies.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PathMap(pub Vec<(String, String)>);

impl PathMap {
    /// Reads a file of path mapping rules as OpenJD writes it for a session.
    ///
    /// # Errors
    /// [`Error::Config`] if it cannot be read or is not such a file.
    pub fn read(path: &Path) -> Result<Self> {
        #[derive(Deserialize)]
        struct Rules {
            #[serde(default)]
            path_mapping_rules: Vec<Rule>,
        }
        #[derive(Deserialize)]
        struct Rule {
            source_path: String,
            destination_path: String,
        }
        let error = |e: &dyn Display| Error::Config(format!("path map {}: {e}", path.display()));
        let text = read_file(path).map_err(|e| error(&e))?;
        let rules: Rules = serde_json::from_slice(&text).map_err(|e| error(&e))?;
        Ok(PathMap(
            rules.path_mapping_rules.into_iter().map(|r| (r.source_path, r.destination_path)).collect(),
        ))
    }

    /// The path on this machine; `None` if no rule matches.
    pub fn map(&self, path: &str) -> Option<String> {
        let slashed = path.replace('\\', "/");
        self.0.iter().find_map(|(from, to)| {
            let from = from.replace('\\', "/");
            let tail = slashed.strip_prefix(from.trim_end_matches('/'))?;
            // Whole components only: /show is not a prefix of /shows.
            (tail.is_empty() || tail.starts_with('/')).then(|| format!("{}{tail}", to.trim_end_matches('/')))
        })
    }

    /// As [`Self::map`], but returns `path` itself if no rule matches.
    pub fn map_path(&self, path: &Path) -> PathBuf {
        path.to_str().and_then(|text| self.map(text)).map_or_else(|| path.into(), PathBuf::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn overrides_replace_and_add_values() {
        let mut file = json!({ "materials": [{ "friction": 0.1 }, {}], "name": "a" });
        for text in ["groom.materials[1].friction=0.3", "groom.name=long hair", "groom.new.key=[1,2]"] {
            Override::parse(text).unwrap().apply(&mut file).unwrap();
        }
        let expected = json!({ "materials": [{ "friction": 0.1 }, { "friction": 0.3 }], "name": "long hair", "new": { "key": [1, 2] } });
        assert_eq!(file, expected);
        for wrong in ["groom.materials[2].friction=1", "groom.name.x=1", "groom.materials.x=1"] {
            let error = Override::parse(wrong).unwrap().apply(&mut file).unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{wrong}");
        }
        for wrong in
            ["", "groom", "groom.a", "hair.a=1", "groom.=1", "groom.a[x]=1", "groom.a[1=1", "groom.[0]=1"]
        {
            assert!(Override::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn overrides_know_former_names() {
        let parsed = Override::parse("anim.settings.parting=0.01").unwrap();
        assert_eq!(parsed.name(), "anim.settings.split_tolerance");
    }

    #[test]
    fn path_prefixes_match_whole_components() {
        let map = PathMap(vec![("/show".into(), "/mnt/show/".into()), ("Z:\\art".into(), "/art".into())]);
        assert_eq!(map.map("/show/head.obj").as_deref(), Some("/mnt/show/head.obj"));
        assert_eq!(map.map("/show").as_deref(), Some("/mnt/show"));
        assert_eq!(map.map("Z:\\art\\a\\b.obj").as_deref(), Some("/art/a/b.obj"));
        assert_eq!(map.map("/shows/head.obj"), None);
        assert_eq!(map.map("head.obj"), None);
    }
}
