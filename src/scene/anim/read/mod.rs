//! Reads an [`Anim`] from the structure of its file: checks its meaning, converts units and axes, reads the
//! files it names.

mod bodies;
mod colliders;
mod context;
mod deformation;
mod goals;
mod keyframes;
mod loads;
mod roots;
mod samples;
mod ties;
mod track;

use super::file::AnimFile;
use super::model::{Anim, Body, Collider, GRAVITY, MAX_FRAMES, Wind};
use super::settings::Settings;
use crate::geometry::Shape;
use crate::scene::convention::Convention;
use crate::scene::file_sequence::lead_in;
use crate::scene::json::buffers::Buffers;
use crate::scene::json::diagnostics::Diagnostics;
use crate::scene::json::document::Document;
use crate::scene::json::key::Key;
use crate::scene::over_target::OverSource;
use context::Context;
use nalgebra::Vector3;
use std::sync::Arc;

/// Largest frame number: 32 bits must hold numbers derived from it.
const MAX_FRAME: i32 = 1_000_000_000;

/// Sections of the file, each with a section that it depends on; see [`Document::finish`].
pub const DEPENDENCIES: &[(&str, &str)] = &[
    ("bodies", "buffers"),
    ("bodies", "fps"),
    ("head", "bodies"),
    ("colliders", "bodies"),
    ("skins", "colliders"),
    ("ties", "bodies"),
    ("loads", "fps"),
    ("goals", "buffers"),
    ("goals", "fps"),
    ("goals", "frames"),
];

/// The animation that `file` describes. Returns `None` only after reporting an error.
pub fn anim(file: AnimFile, doc: &mut Document) -> Option<Anim> {
    let folder = doc.folder();
    let diagnostics = &mut doc.diagnostics;
    let buffers = Buffers::read(&file.buffers, &folder, diagnostics);
    let [first, last] = file.frames;
    check_frames(diagnostics, first, last);
    let frames = (first, last);
    let convention = Convention { metres_per_unit: file.metres_per_unit, up: file.up_axis };
    let lead = lead_in(file.fps, file.settings.preroll_s);
    let over = file.over.map(|over| OverSource {
        file: folder.join(over.file),
        prims: over.prims,
        metres_per_unit: over.metres_per_unit,
        up: over.up_axis,
    });
    let mut context = Context { convention, fps: file.fps, frames, lead, folder, buffers, diagnostics };
    let bodies = bodies::bodies(&mut context, file.bodies);
    let names: Vec<String> = bodies.iter().map(|body| body.name.clone()).collect();
    let head = match &file.head {
        Some(head) => context.body_index(&Key::at("head"), head, &names),
        None => Some(0),
    };
    let collider_names: Vec<String> = file.colliders.iter().map(|collider| collider.name.clone()).collect();
    let colliders = colliders::colliders(&mut context, file.colliders, &names, head);
    let skins = skins(&mut context, &file.skins, &collider_names, &colliders);
    let roots = roots::roots(&mut context, file.roots);
    let ties = ties::ties(&mut context, file.ties, &names, head);
    let loads = loads::loads(&mut context, file.loads);
    let goals = goals::goals(&mut context, file.goals);
    let wind: Vec<_> = file
        .wind
        .into_iter()
        .enumerate()
        .map(|(i, wind)| {
            let key = Key::at("wind").index(i).name("velocity_m_s");
            let velocity = keyframes::keyframes(&mut context, &key, wind.velocity_m_s)?;
            let (gust_speed, gust_length) = (wind.gust_speed_m_s, wind.gust_length_m);
            Some(Wind { velocity, gust_speed, gust_length, seed: wind.seed })
        })
        .collect();
    let forces: Vec<_> = file
        .forces
        .into_iter()
        .enumerate()
        .map(|(i, force)| {
            let key = Key::at("forces").index(i).name("acceleration_m_s2");
            keyframes::keyframes(&mut context, &key, force.acceleration_m_s2)
        })
        .collect();
    let head = head?;
    let bodies: Vec<Body> = bodies.into_iter().map(bodies::NamedTrack::into_body).collect::<Option<_>>()?;
    let mut colliders: Vec<Collider> = colliders.into_iter().collect::<Option<_>>()?;
    // What roots on skins ride on where the head does not move is known once they are bound.
    if skins.as_ref().is_none_or(Vec::is_empty) || bodies[head].track.span().is_some() {
        colliders.iter_mut().for_each(|collider| carry_beyond_ends(collider, &bodies, head));
    }
    Some(Anim {
        fps: file.fps,
        frames,
        shot: frames,
        head,
        bodies,
        colliders,
        skins: skins?,
        reference: None,
        roots,
        ties: ties.into_iter().collect::<Option<_>>()?,
        loads: loads.into_iter().collect::<Option<_>>()?,
        goals: goals.into_iter().collect::<Option<_>>()?,
        gravity: file.gravity_m_s2.map_or(Vector3::y() * -GRAVITY, |g| convention.direction_in(g.into())),
        wind: wind.into_iter().collect::<Option<_>>()?,
        forces: forces.into_iter().collect::<Option<_>>()?,
        over,
        settings: Settings::from(file.settings),
    })
}

/// The colliders with these `names`, which roots grow on, among `all`.
fn skins(
    context: &mut Context,
    names: &[String],
    all: &[String],
    colliders: &[Option<Collider>],
) -> Option<Vec<usize>> {
    let skin = |(i, name): (usize, &String)| {
        let found = all.iter().position(|other| other == name);
        let (message, help) = match found.map(|c| colliders[c].as_ref()) {
            Some(Some(Collider { shape: Shape::Mesh(_), .. })) if !names[..i].contains(name) => return found,
            // It has errors of its own.
            Some(None) => return None,
            None => (format!("there is no collider \"{name}\""), "correct the name, or add the collider"),
            Some(Some(Collider { shape: Shape::Mesh(_), .. })) => {
                (format!("\"{name}\" is named twice"), "remove one of them")
            }
            Some(Some(_)) => {
                (format!("the collider \"{name}\" is not a mesh"), "name the mesh that hair grows on")
            }
        };
        let meshes = colliders.iter().flatten().filter(|c| matches!(c.shape, Shape::Mesh(_)));
        let meshes: Vec<&str> = meshes.map(|c| c.name.as_str()).collect();
        let allowed = format!("names of meshes among the colliders: \"{}\"", meshes.join("\", \""));
        context.diagnostics.add(&Key::at("skins").index(i), message, allowed, help);
        None
    };
    let found: Vec<Option<usize>> = names.iter().enumerate().map(skin).collect();
    found.into_iter().collect()
}

/// Before and after its samples, what of a deforming mesh moves with the head goes on to do so.
fn carry_beyond_ends(collider: &mut Collider, bodies: &[Body], head: usize) {
    let [carrier, head] = [collider.body, head].map(|body| &bodies[body].track);
    collider.deformation = collider.deformation.take().map(|deformation| {
        let head_in_body = |t: f64| carrier.pose(t).inverse() * head.pose(t);
        Arc::new(Arc::unwrap_or_clone(deformation).carried_beyond_ends(head_in_body))
    });
}

fn check_frames(diagnostics: &mut Diagnostics, first: i32, last: i32) {
    let key = Key::at("frames");
    if first > last {
        let message = format!("first frame {first} is after last frame {last}");
        diagnostics.add(&key, message, "[first, last] with first ≤ last", "swap the two");
    } else if i64::from(last) - i64::from(first) >= MAX_FRAMES || first < -MAX_FRAME || last > MAX_FRAME {
        let message = format!("frames {first} to {last} are out of range");
        let allowed = format!("up to {MAX_FRAMES} frames, numbered -{MAX_FRAME} to {MAX_FRAME}");
        diagnostics.add(&key, message, allowed, "split the shot");
    }
}
