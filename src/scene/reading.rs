//! How a scene's files are read: values put in place of theirs, and names of files that are elsewhere here.

use super::document::{Key, Step};
use crate::error::{Error, Result};
use serde::Deserialize;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// What is changed in the files of a scene as they are read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Reading {
    /// Values put in place.
    pub set: Vec<Override>,
    /// Names of files mapped from where they were made to here.
    pub paths: PathMap,
}

/// A value put in place of one of `groom.json` or `anim.json`.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// `groom` or `anim`.
    pub file: String,
    /// Where, such as `materials[0].damping`.
    pub key: Key,
    /// The value.
    pub value: Value,
}

impl Override {
    /// Reads `groom.materials[0].damping=0.01`; what is no JSON after the sign is text.
    ///
    /// # Errors
    /// What is expected instead.
    pub fn parse(text: &str) -> std::result::Result<Self, String> {
        let help = || {
            "FILE.KEY=VALUE, such as groom.materials[0].friction=0.3 or anim.gravity_m_s2=[0,-1,0]"
                .to_string()
        };
        let (path, value) = text.split_once('=').ok_or_else(help)?;
        let (file, path) = path.split_once('.').ok_or_else(help)?;
        if !matches!(file, "groom" | "anim") {
            return Err(help());
        }
        let mut key = Key::default();
        for part in path.split('.') {
            let mut indices = part.split('[');
            let name = indices.next().filter(|name| !name.is_empty()).ok_or_else(help)?;
            key.0.push(Step::Name(name.into()));
            for index in indices {
                let index = index.strip_suffix(']').and_then(|i| i.parse().ok()).ok_or_else(help)?;
                key.0.push(Step::Index(index));
            }
        }
        let value = serde_json::from_str(value).unwrap_or_else(|_| Value::String(value.into()));
        Ok(Override { file: file.into(), key, value })
    }

    /// Its name in lists of settings.
    pub fn name(&self) -> String {
        format!("{}.{}", self.file, self.key)
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
            place = next
                .ok_or_else(|| Error::Usage(format!("--set {}: the file has no such place", self.name())))?;
        }
        place.clone_from(&self.value);
        Ok(())
    }
}

/// Beginnings of paths, and what stands for them here. The first that fits counts.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PathMap(pub Vec<(String, String)>);

impl PathMap {
    /// The rules of a file as OpenJD writes it for a session.
    ///
    /// # Errors
    /// [`Error::Config`] where it cannot be read, or is no such file.
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
        let fault = |e: &dyn std::fmt::Display| Error::Config(format!("path map {}: {e}", path.display()));
        let text = crate::file::read_file(path).map_err(|e| fault(&e))?;
        let rules: Rules = serde_json::from_slice(&text).map_err(|e| fault(&e))?;
        Ok(PathMap(
            rules.path_mapping_rules.into_iter().map(|r| (r.source_path, r.destination_path)).collect(),
        ))
    }

    /// A path as it is here.
    pub fn map(&self, path: &str) -> Option<String> {
        let slashed = path.replace('\\', "/");
        self.0.iter().find_map(|(from, to)| {
            let from = from.replace('\\', "/");
            let rest = slashed.strip_prefix(from.trim_end_matches('/'))?;
            // Whole names only: /show is no beginning of /shows.
            (rest.is_empty() || rest.starts_with('/')).then(|| format!("{}{rest}", to.trim_end_matches('/')))
        })
    }

    /// As [`Self::map`], for a path that may have no rule.
    pub fn map_path(&self, path: &Path) -> PathBuf {
        path.to_str().and_then(|text| self.map(text)).map_or_else(|| path.into(), PathBuf::from)
    }
}

impl Reading {
    /// Changes the value of a file, `groom` or `anim`.
    pub(super) fn change(&self, file: &str, root: &mut Value) -> Result<()> {
        self.set.iter().filter(|o| o.file == file).try_for_each(|o| o.apply(root))?;
        for (list, place) in super::inputs::NAMED {
            let elements = root.get_mut(*list).and_then(Value::as_array_mut);
            for name in elements.into_iter().flatten().filter_map(|e| e.pointer_mut(place)) {
                if let Some(here) = name.as_str().and_then(|name| self.paths.map(name)) {
                    *name = Value::String(here);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_are_put_in_place() {
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
    fn paths_are_mapped_by_whole_names() {
        let map = PathMap(vec![("/show".into(), "/mnt/show/".into()), ("Z:\\art".into(), "/art".into())]);
        assert_eq!(map.map("/show/head.obj").as_deref(), Some("/mnt/show/head.obj"));
        assert_eq!(map.map("/show").as_deref(), Some("/mnt/show"));
        assert_eq!(map.map("Z:\\art\\a\\b.obj").as_deref(), Some("/art/a/b.obj"));
        assert_eq!(map.map("/shows/head.obj"), None);
        assert_eq!(map.map("head.obj"), None);
    }
}
