//! Bodies.

use super::context::Context;
use super::track::track;
use crate::scene::anim::file::BodyFile;
use crate::scene::anim::model::Body;
use crate::scene::json::key::Key;
use crate::scene::origin::Origin;
use crate::scene::track::Track;
use nalgebra::Isometry3;

/// A body; its track is `None` after an error in it.
pub struct NamedTrack {
    pub name: String,
    track: Option<Track>,
    origin: Option<Origin>,
}

impl NamedTrack {
    /// The body, if its track is valid.
    pub fn into_body(self) -> Option<Body> {
        Some(Body { name: self.name, track: self.track?, origin: self.origin })
    }
}

/// The bodies; a head that does not move if there are none.
pub fn bodies(context: &mut Context, files: Vec<BodyFile>) -> Vec<NamedTrack> {
    let fixed = || Some(Track::fixed(Isometry3::identity()));
    if files.is_empty() {
        return vec![NamedTrack { name: "head".into(), track: fixed(), origin: None }];
    }
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    context.check_unique("bodies", &names);
    let body = |(i, file): (usize, BodyFile)| {
        let origin = file.track.as_ref().and_then(|track| track.origin.clone());
        let track = match file.track {
            Some(file) => track(context, &Key::at("bodies").index(i).name("track"), file),
            None => fixed(),
        };
        NamedTrack { name: file.name, track, origin }
    };
    files.into_iter().enumerate().map(body).collect()
}
