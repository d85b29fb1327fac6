//! What the readers of all sections share.

use crate::scene::anim::ends_file::BallFile;
use crate::scene::anim::model::GuideSelection;
use crate::scene::convention::Convention;
use crate::scene::json::buffers::Buffers;
use crate::scene::json::diagnostics::Diagnostics;
use crate::scene::json::key::Key;
use nalgebra::UnitQuaternion;
use std::path::PathBuf;

/// What the readers of all sections share.
pub struct Context<'a> {
    pub convention: Convention,
    /// Frames per second of the bake.
    pub fps: f64,
    /// First and last frame of the bake.
    pub frames: (i32, i32),
    /// Frames read before the first, for the pre-roll.
    pub lead: i32,
    /// The folder that relative file names start from.
    pub folder: PathBuf,
    pub buffers: Buffers,
    pub diagnostics: &'a mut Diagnostics,
}

impl Context<'_> {
    /// Checks that the names in a section are unique.
    pub fn check_unique(&mut self, section: &str, names: &[String]) {
        for (i, name) in names.iter().enumerate() {
            if names[..i].contains(name) {
                let key = Key::at(section).index(i).name("name");
                let message = format!("duplicate name \"{name}\"");
                self.diagnostics.add(&key, message, "unique names", "rename one of them");
            }
        }
    }

    /// Index of the body `name`, the value of `key`, among the bodies `names`.
    pub fn body_index(&mut self, key: &Key, name: &str, names: &[String]) -> Option<usize> {
        let found = names.iter().position(|other| other == name);
        if found.is_none() {
            let message = format!("there is no body \"{name}\"");
            let allowed = format!("the name of a body: \"{}\"", names.join("\", \""));
            self.diagnostics.add(key, message, allowed, "correct the name, or add the body");
        }
        found
    }

    /// The guides that these keys of `key` select.
    pub fn selection(
        &mut self,
        key: &Key,
        ids: Option<Vec<i32>>,
        group: Option<String>,
        within: Option<BallFile>,
    ) -> GuideSelection {
        if ids.as_ref().is_some_and(Vec::is_empty) {
            let help = "name guides, or leave it out for all";
            self.diagnostics.add(&key.name("ids"), "is empty", "at least one id of a guide", help);
        }
        let ball = |BallFile { centre, radius }| {
            (self.convention.length_in(centre.into()), radius * self.convention.metres_per_unit)
        };
        GuideSelection { ids, group, within: within.map(ball) }
    }

    /// The unit quaternion at `key`.
    pub fn quaternion(&mut self, key: &Key, wxyz: [f64; 4]) -> Option<UnitQuaternion<f64>> {
        self.diagnostics.unit_quaternions(key, &[wxyz]).map(|q| q[0])
    }
}
