//! `anim.json` to an [`Anim`]: faults of meaning, units and axes, files it names.

mod deformation;
mod track;

use super::file::*;
use super::{Anim, Body, Collider, Keyed, MAX_FRAMES, Settings, Tie, TiePlace, Track, Wind};
use crate::geometry::{Deformation, Friction, Shape, TriMesh};
use crate::scene::Convention;
use crate::scene::document::array::Buffers;
use crate::scene::document::{Document, Faults, Key, MAX_NAMED};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use std::path::PathBuf;
use std::sync::Arc;
pub(crate) use track::motion;

/// Gravity where none is given, m/s².
const GRAVITY: f64 = 9.81;

/// Largest number of a frame: what follows from it is counted in 32 bits too.
const MAX_FRAME: i32 = 1_000_000_000;

/// Sections of the file and those that they build on.
pub const DEPENDS: &[(&str, &str)] = &[
    ("bodies", "buffers"),
    ("bodies", "fps"),
    ("head", "bodies"),
    ("colliders", "bodies"),
    ("ties", "bodies"),
];

/// The animation that `file` describes; `None` only where faults were noted.
pub fn anim(file: AnimFile, doc: &mut Document) -> Option<Anim> {
    let folder = doc.folder();
    let faults = &mut doc.faults;
    let buffers = Buffers::read(&file.buffers, &folder, faults);
    let [first, last] = file.frames;
    if first > last {
        let what = format!("is [{first}, {last}]");
        faults.add(&Key::at("frames"), what, "first ≤ last", "put the first frame first");
    } else if i64::from(last) - i64::from(first) >= MAX_FRAMES || first < -MAX_FRAME || last > MAX_FRAME {
        let allowed = format!("{MAX_FRAMES} frames, numbered from -{MAX_FRAME} to {MAX_FRAME}");
        faults.add(&Key::at("frames"), format!("is [{first}, {last}]"), allowed, "divide the shot");
    }
    let convention = Convention { metres_per_unit: file.metres_per_unit, up: file.up_axis };
    let mut reader = Reader { convention, fps: file.fps, frames: (first, last), folder, buffers, faults };
    let bodies = reader.bodies(file.bodies);
    let names: Vec<String> = bodies.iter().map(|(name, _)| name.clone()).collect();
    let head = match &file.head {
        Some(head) => reader.body(&Key::at("head"), head, &names),
        None => Some(0),
    };
    let colliders = reader.colliders(file.colliders, &names, head);
    let ties = reader.ties(file.ties, &names, head);
    let gravity = file.gravity_m_s2.map_or(Vector3::y() * -GRAVITY, |g| convention.direction_in(g.into()));
    let wind = file.wind.into_iter().enumerate().map(|(i, wind)| {
        let velocity = reader.keyed(&Key::at("wind").index(i).name("velocity_m_s"), wind.velocity_m_s)?;
        Some(Wind {
            velocity,
            gust_speed: wind.gust_speed_m_s,
            gust_length: wind.gust_length_m,
            seed: wind.seed,
        })
    });
    let wind: Vec<_> = wind.collect();
    let forces = file.forces.into_iter().enumerate().map(|(i, force)| {
        reader.keyed(&Key::at("forces").index(i).name("acceleration_m_s2"), force.acceleration_m_s2)
    });
    let forces: Vec<_> = forces.collect();
    let body = |(name, track): (String, Option<Track>)| Some(Body { name, track: track? });
    Some(Anim {
        fps: file.fps,
        frames: (first, last),
        head: head?,
        bodies: bodies.into_iter().map(body).collect::<Option<_>>()?,
        colliders: colliders.into_iter().collect::<Option<_>>()?,
        ties: ties.into_iter().collect::<Option<_>>()?,
        gravity,
        wind: wind.into_iter().collect::<Option<_>>()?,
        forces: forces.into_iter().collect::<Option<_>>()?,
        settings: Settings {
            substeps: file.settings.substeps,
            preroll: file.settings.preroll_s,
            nodes: file.settings.nodes,
            scheme: file.settings.scheme,
            contact: file.settings.contact,
            resolution: file.settings.resolution,
            parting: file.settings.parting,
            curves: file.settings.curves,
            keep: file.settings.keep,
            samples: file.settings.samples,
            shutter: file.settings.shutter,
            accelerations: file.settings.accelerations,
        },
    })
}

struct Reader<'a> {
    convention: Convention,
    fps: f64,
    frames: (i32, i32),
    folder: PathBuf,
    buffers: Buffers,
    faults: &'a mut Faults,
}

impl Reader<'_> {
    /// Name and track of each body.
    fn bodies(&mut self, files: Vec<BodyFile>) -> Vec<(String, Option<Track>)> {
        if files.is_empty() {
            return vec![("head".into(), Some(Track::fixed(Isometry3::identity())))];
        }
        let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
        self.unique("bodies", &names);
        let body = |(i, file): (usize, BodyFile)| {
            let track = match file.track {
                Some(track) => self.track(&Key::at("bodies").index(i).name("track"), track),
                None => Some(Track::fixed(Isometry3::identity())),
            };
            (file.name, track)
        };
        files.into_iter().enumerate().map(body).collect()
    }

    fn unique(&mut self, section: &str, names: &[String]) {
        for (i, name) in names.iter().enumerate() {
            if names[..i].contains(name) {
                let key = Key::at(section).index(i).name("name");
                self.faults.add(&key, format!("\"{name}\" is there already"), "unique names", "rename one");
            }
        }
    }

    /// Index of the body `name`, which stands at `key`.
    fn body(&mut self, key: &Key, name: &str, names: &[String]) -> Option<usize> {
        let found = names.iter().position(|other| other == name);
        if found.is_none() {
            let allowed = format!("the name of a body: \"{}\"", names.join("\", \""));
            self.faults.add(
                key,
                format!("\"{name}\" is no body"),
                allowed,
                "correct the name, or add the body",
            );
        }
        found
    }

    fn quaternion(&mut self, key: &Key, wxyz: [f64; 4]) -> Option<UnitQuaternion<f64>> {
        self.faults.unit_quaternions(key, &[wxyz]).map(|q| q[0])
    }

    fn colliders(
        &mut self,
        files: Vec<ColliderFile>,
        bodies: &[String],
        head: Option<usize>,
    ) -> Vec<Option<Collider>> {
        let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
        self.unique("colliders", &names);
        let collider = |(i, file): (usize, ColliderFile)| {
            let key = Key::at("colliders").index(i);
            let good =
                |(i, c): (usize, char)| c == '_' || c.is_ascii_alphabetic() || (i > 0 && c.is_ascii_digit());
            if file.name.is_empty() || !file.name.chars().enumerate().all(good) {
                let allowed = "letters, digits and _, no digit first: it becomes the name of a USD prim";
                self.faults.add(&key.name("name"), format!("is \"{}\"", file.name), allowed, "rename it");
            }
            let body = match &file.body {
                Some(name) => self.body(&key.name("body"), name, bodies),
                None => head,
            };
            let shape = self.shape(&key.name("shape"), file.shape);
            let (body, (shape, deformation)) = (body?, shape?);
            Some(Collider {
                name: file.name,
                body,
                shape,
                deformation: deformation.map(Arc::new),
                friction: self.friction(&key, file.friction, file.static_friction),
                thickness: file.thickness_m,
            })
        };
        files.into_iter().enumerate().map(collider).collect()
    }

    fn friction(&mut self, key: &Key, sliding: Option<f64>, fixed: Option<f64>) -> Option<Friction> {
        if let Some(fixed) = fixed
            && sliding.is_none_or(|sliding| fixed < sliding)
        {
            let allowed = "not below `friction`, which must be given";
            let remedy = "what sticks is held at least as well as what slides";
            self.faults.add(&key.name("static_friction"), format!("is {fixed}"), allowed, remedy);
        }
        sliding.map(|sliding| Friction::new(sliding, fixed))
    }

    fn ties(&mut self, files: Vec<TieFile>, bodies: &[String], head: Option<usize>) -> Vec<Option<Tie>> {
        let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
        self.unique("ties", &names);
        let point = |p: [f64; 3], convention: &Convention| convention.length_in(p.into());
        let tie = |(i, file): (usize, TieFile)| {
            let (key, convention) = (Key::at("ties").index(i), self.convention);
            let unit = convention.metres_per_unit;
            let body = match &file.body {
                Some(name) => self.body(&key.name("body"), name, bodies),
                None => head,
            };
            let place = match (file.arc_m, file.arc_by_distance) {
                (Some(_), Some(_)) => Err((
                    key.name("arc_m"),
                    "is there beside `arc_by_distance`",
                    "`arc_m` or `arc_by_distance`, not both",
                    "remove one",
                )),
                (Some(arc), None) => Ok(TiePlace::Arc(arc)),
                (None, Some(_)) if file.at.is_none() => Err((
                    key.name("arc_by_distance"),
                    "stands without `at`",
                    "only with `at`, the distance to which it multiplies",
                    "give `at`, or `arc_m`",
                )),
                (None, Some(factor)) => Ok(TiePlace::Distance(factor)),
                (None, None) if file.at.is_none() && file.within.is_none() => Err((
                    key.clone(),
                    "does not say which place of a guide it holds",
                    "`arc_m`, `at` or `within`",
                    "give one of them",
                )),
                (None, None) => Ok(TiePlace::Nearest),
            };
            let place = place
                .map_err(|(key, found, allowed, remedy)| self.faults.add(&key, found, allowed, remedy))
                .ok()?;
            if let Some([on, off]) = file.frames.filter(|[on, off]| on > off) {
                self.faults.add(
                    &key.name("frames"),
                    format!("is [{on}, {off}]"),
                    "first ≤ last",
                    "put the first frame first",
                );
            }
            let always = [f64::NEG_INFINITY, f64::INFINITY];
            Some(Tie {
                name: file.name,
                body: body?,
                ids: file.ids,
                group: file.group,
                within: file.within.map(|ball| (point(ball.centre, &convention), ball.radius * unit)),
                place,
                gathered: file.at.map(|at| (point(at, &convention), file.radius * unit)),
                times: file.frames.map_or(always, |frames| frames.map(|frame| frame / self.fps)),
            })
        };
        files.into_iter().enumerate().map(tie).collect()
    }

    /// A shape, and how it deforms.
    fn shape(&mut self, key: &Key, file: ShapeFile) -> Option<(Shape, Option<Deformation>)> {
        let unit = self.convention.metres_per_unit;
        let convention = self.convention;
        let point = |p: [f64; 3]| convention.length_in(p.into());
        let shape = match file {
            ShapeFile::Mesh { file, sequence, metres_per_unit, up_axis } => {
                let convention = Convention {
                    metres_per_unit: metres_per_unit.unwrap_or(unit),
                    up: up_axis.unwrap_or(convention.up),
                };
                return self.mesh(key, &file, sequence, &convention);
            }
            ShapeFile::Sphere { centre, radius } => {
                Shape::Sphere { centre: point(centre), radius: radius * unit }
            }
            ShapeFile::Capsule { ends, radius } => {
                Shape::Capsule { ends: ends.map(point), radius: radius * unit }
            }
            ShapeFile::Ellipsoid { centre, radii, rotation_wxyz } => {
                let q = self.quaternion(&key.name("rotation_wxyz"), rotation_wxyz)?;
                let rotation = self.convention.frame_in(q);
                Shape::Ellipsoid { centre: point(centre), radii: Vector3::from(radii) * unit, rotation }
            }
            ShapeFile::Plane { point: p, normal } => {
                let Some(normal) = convention.direction_in(normal.into()).try_normalize(1e-12) else {
                    let remedy = "give the direction away from the solid side";
                    self.faults.add(
                        &key.name("normal"),
                        format!("is {normal:?}"),
                        "any length but zero",
                        remedy,
                    );
                    return None;
                };
                Shape::Plane { point: point(p), normal }
            }
        };
        Some((shape, None))
    }

    fn mesh(
        &mut self,
        key: &Key,
        file: &str,
        sequence: Option<String>,
        convention: &Convention,
    ) -> Option<(Shape, Option<Deformation>)> {
        let path = self.folder.join(file);
        let fault = |faults: &mut Faults, what: String| {
            let allowed = "a Wavefront OBJ file with triangles, relative to the folder of this file";
            let remedy = "correct the path or export the mesh anew";
            faults.add(&key.name("file"), format!("\"{file}\" {what}"), allowed, remedy);
        };
        let read = TriMesh::load_obj_as_it_is(&path, convention).map_err(|what| fault(self.faults, what));
        let mut mesh = read.ok()?;
        let deformation = match sequence {
            Some(pattern) => Some(self.deformation(&key.name("sequence"), &pattern, &mesh, convention)?),
            None => None,
        };
        match mesh.drop_degenerate() {
            Ok(0) => {}
            Ok(dropped) => tracing::warn!("{}: {dropped} triangles of no area left out", path.display()),
            Err(what) => {
                fault(self.faults, what);
                return None;
            }
        }
        Some((Shape::Mesh(mesh), deformation))
    }

    fn keyed(&mut self, key: &Key, file: KeyedFile) -> Option<Keyed> {
        let value = |v: [f64; 3]| self.convention.direction_in(v.into());
        let (frames, values) = match file {
            KeyedFile::Constant(v) => return Some(Keyed::constant(value(v))),
            KeyedFile::Keys { frames, values } => (frames, values),
        };
        let values: Vec<_> = values.into_iter().map(value).collect();
        let before = self.faults.len();
        self.faults.expect_len(&key.name("values"), values.len(), frames.len(), "frame");
        if frames.is_empty() {
            self.faults.add(&key.name("frames"), "is empty", "one key or more", "give a key, or a constant");
        }
        for (i, pair) in frames.windows(2).enumerate().filter(|(_, pair)| pair[0] >= pair[1]).take(MAX_NAMED)
        {
            let what = format!("is {} after {}", pair[1], pair[0]);
            self.faults.add(
                &key.name("frames").index(i + 1),
                what,
                "increasing",
                "put the keys in order of time",
            );
        }
        let times = frames.iter().map(|frame| frame / self.fps).collect();
        (self.faults.len() == before).then_some(Keyed { times, values })
    }
}
