//! `anim.json` to an [`Anim`]: faults of meaning, units and axes, files it names.

use super::file::*;
use super::{Anim, Body, Collider, Keyed, Settings, Shape, Track, TriMesh, Wind};
use crate::error::{Error, Result};
use crate::scene::Convention;
use crate::scene::document::array::Buffers;
use crate::scene::document::{Document, Faults, Key};
use crate::scene::groom::read::unit_quaternions;
use crate::scene::track::{self, Samples};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// Gravity where none is given, m/s².
const GRAVITY: f64 = 9.81;
/// Faults of one track that are reported one by one.
const MAX_NAMED: usize = 8;

/// Sections of the file and those that they build on.
pub const DEPENDS: &[(&str, &str)] =
    &[("bodies", "buffers"), ("bodies", "fps"), ("head", "bodies"), ("colliders", "bodies")];

/// Reads a motion file: what stands in it, and its poses in metres, Y up. Errors: as [`crate::scene::load_anim`].
pub(crate) fn motion(path: &Path) -> Result<(MotionFile, Vec<Isometry3<f64>>)> {
    let mut doc = Document::open(path)?;
    let read = doc.parse().and_then(|file: MotionFile| {
        let convention = Convention { metres_per_unit: file.units.metres(), up: file.up_axis.into() };
        let wxyz: Vec<_> = file.frames.iter().map(|f| f.rotation_quat_wxyz).collect();
        let rotation = unit_quaternions(&wxyz, &Key::at("frames"), &mut doc.faults)?;
        let pose = |(f, q): (&MotionFrame, UnitQuaternion<f64>)| convention.pose_in(f.translation.into(), q);
        let poses = file.frames.iter().zip(rotation).map(pose).collect();
        Some((file, poses))
    });
    doc.finish(read, &[])
}

/// The animation that `file` describes; `None` only where faults were noted.
pub fn anim(file: AnimFile, doc: &mut Document) -> Option<Anim> {
    let folder = doc.folder();
    let faults = &mut doc.faults;
    let buffers = Buffers::read(&file.buffers, &folder, faults);
    let [first, last] = file.frames;
    if first > last {
        let what = format!("is [{first}, {last}]");
        faults.add(&Key::at("frames"), what, "first ≤ last", "put the first frame first");
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
        gravity,
        wind: wind.into_iter().collect::<Option<_>>()?,
        forces: forces.into_iter().collect::<Option<_>>()?,
        settings: Settings {
            substeps: file.settings.substeps,
            preroll: file.settings.preroll_s,
            nodes: file.settings.nodes,
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

    fn track(&mut self, key: &Key, file: TrackFile) -> Option<Track> {
        let rest = match file.rest {
            Some(rest) => self.rest(&key.name("rest"), &rest),
            None => Some(Isometry3::identity()),
        };
        let (rate, poses, at, numbers) = match &file.file {
            Some(name) => {
                self.only_one_source(key, &file);
                let (rate, poses) = self.motion_file(key, name)?;
                (rate, poses, key.name("file"), None)
            }
            None => {
                let rate = file.fps.unwrap_or(self.fps);
                let numbers = match file.frames {
                    Some(frames) => Some(self.buffers.load(frames, &key.name("frames"), self.faults)?),
                    None => None,
                };
                let at = if file.translation.is_some() { "translation" } else { "rotation_wxyz" };
                let poses = self.poses(key, file.translation, file.rotation_wxyz)?;
                (rate, poses, key.name(at), numbers)
            }
        };
        let start = file.first_frame.unwrap_or(self.frames.0.into()) / self.fps;
        let mut samples = match numbers {
            Some(numbers) => self.spread(key, &numbers, poses, file.pops)?,
            None => Samples { start, rate, poses, bridged: Vec::new() },
        };
        (samples.start, samples.rate) = (start, rate);
        self.covers_frames(key, &samples);
        self.pops(&at, &mut samples, file.pops);
        if !samples.bridged.is_empty() && samples.poses.len() - samples.bridged.len() < 3 {
            let what =
                format!("leaves {} samples to bridge from", samples.poses.len() - samples.bridged.len());
            self.faults.add(&at, what, "3 or more sound samples", "mend the track");
            return None;
        }
        Some(Track::through(&samples, file.smoothing_hz, &rest?))
    }

    fn only_one_source(&mut self, key: &Key, file: &TrackFile) {
        let here = [
            ("fps", file.fps.is_some()),
            ("frames", file.frames.is_some()),
            ("translation", file.translation.is_some()),
            ("rotation_wxyz", file.rotation_wxyz.is_some()),
        ];
        for (name, _) in here.iter().filter(|(_, given)| *given) {
            let what = "is given beside \"file\", which has its own";
            self.faults.add(
                &key.name(name),
                what,
                "either \"file\" or samples here",
                "remove one of the two",
            );
        }
    }

    fn rest(&mut self, key: &Key, file: &PoseFile) -> Option<Isometry3<f64>> {
        let q = self.quaternion(&key.name("rotation_wxyz"), file.rotation_wxyz)?;
        Some(self.convention.pose_in(file.translation.into(), q))
    }

    fn quaternion(&mut self, key: &Key, wxyz: [f64; 4]) -> Option<UnitQuaternion<f64>> {
        unit_quaternions(&[wxyz], key, self.faults).map(|q| q[0])
    }

    /// Poses of the samples in the file itself.
    fn poses(
        &mut self,
        key: &Key,
        translation: Option<crate::scene::Array<[f64; 3]>>,
        rotation: Option<crate::scene::Array<[f64; 4]>>,
    ) -> Option<Vec<Isometry3<f64>>> {
        if translation.is_none() && rotation.is_none() {
            let allowed = "\"file\", or \"translation\" and \"rotation_wxyz\"";
            self.faults.add(
                key,
                "has no samples",
                allowed,
                "give the samples, or leave the track out for a body at rest",
            );
            return None;
        }
        let translation =
            translation.map(|array| self.buffers.load(array, &key.name("translation"), self.faults));
        let rotation_key = key.name("rotation_wxyz");
        let rotation = rotation.map(|array| {
            let array = self.buffers.load(array, &rotation_key, self.faults)?;
            unit_quaternions(&array, &rotation_key, self.faults)
        });
        // A missing array has the default value for every sample; a faulty one ends here.
        let translation = translation.map_or(Some(None), |t| t.map(Some))?;
        let rotation = rotation.map_or(Some(None), |r| r.map(Some))?;
        let n = translation.as_ref().map_or_else(|| rotation.as_ref().map_or(0, Vec::len), Vec::len);
        if n == 0 {
            self.faults.add(key, "has no samples", "one sample or more", "give the samples");
            return None;
        }
        if let Some(rotation) = &rotation
            && !self.faults.expect_len(&rotation_key, rotation.len(), n, "sample of \"translation\"")
        {
            return None;
        }
        let pose = |i: usize| {
            let p = translation.as_ref().map_or(Vector3::zeros(), |t| t[i].into());
            let q = rotation.as_ref().map_or(UnitQuaternion::identity(), |r| r[i]);
            self.convention.pose_in(p, q)
        };
        Some((0..n).map(pose).collect())
    }

    /// Rate and poses of a motion file; its faults are reported at their places in it.
    fn motion_file(&mut self, key: &Key, name: &str) -> Option<(f64, Vec<Isometry3<f64>>)> {
        let path = self.folder.join(name);
        match motion(&path) {
            Ok((file, poses)) => return Some((file.fps, poses)),
            Err(Error::BadInput(problems)) => self.faults.add_elsewhere(problems),
            Err(Error::Io { source, .. }) => self.faults.add(
                &key.name("file"),
                format!("\"{name}\" cannot be read: {source}"),
                "a readable motion file",
                "correct the path; it starts from the folder of this file",
            ),
            Err(e) => self.faults.add(&key.name("file"), e.to_string(), "a motion file", "correct the path"),
        }
        None
    }

    /// Samples with a number each, spread out over the gaps between them.
    fn spread(
        &mut self,
        key: &Key,
        numbers: &[i32],
        poses: Vec<Isometry3<f64>>,
        pops: Pops,
    ) -> Option<Samples> {
        let key = key.name("frames");
        if !self.faults.expect_len(&key, numbers.len(), poses.len(), "sample") {
            return None;
        }
        let mut sound = true;
        for (i, pair) in numbers.windows(2).enumerate() {
            let gap = i64::from(pair[1]) - i64::from(pair[0]);
            let (what, allowed, remedy) = match gap {
                1 => continue,
                ..1 => (
                    format!("is {} after {}", pair[1], pair[0]),
                    "increasing".to_string(),
                    "put the samples in order of time, each once",
                ),
                // Longer gaps are no tracker's drop-out, and filling them would invent motion.
                2..=30 if pops == Pops::Bridge => continue,
                _ => (
                    format!("is {} after {}: a gap, samples missing: {}", pair[1], pair[0], gap - 1),
                    format!("{}", i64::from(pair[0]) + 1),
                    "fill the gap, or set \"pops\": \"bridge\" to bridge gaps of up to 29 samples",
                ),
            };
            self.faults.add(&key.index(i + 1), what, allowed, remedy);
            sound = false;
        }
        if !sound {
            return None;
        }
        let mut samples = Samples { start: 0.0, rate: 1.0, poses: Vec::new(), bridged: Vec::new() };
        for (pose, &number) in poses.into_iter().zip(numbers) {
            let place = (i64::from(number) - i64::from(numbers[0])) as usize;
            for missing in samples.poses.len()..place {
                samples.bridged.push(missing);
                samples.poses.push(pose);
            }
            samples.poses.push(pose);
        }
        Some(samples)
    }

    /// The frames of the bake lie in the track.
    fn covers_frames(&mut self, key: &Key, samples: &Samples) {
        if samples.poses.len() < 2 {
            return;
        }
        let first = samples.start * self.fps;
        let last = first + (samples.poses.len() - 1) as f64 * self.fps / samples.rate;
        // The last frame may fall short of a whole sample by rounding, or by the sample's own length.
        let slack = 1e-6 + self.fps / samples.rate;
        let (a, b) = (f64::from(self.frames.0), f64::from(self.frames.1));
        if a < first - slack || b > last + slack {
            let what = format!("covers frames {first:.2} to {last:.2}, not all of {a} to {b}");
            let allowed = format!("\"frames\" within {} to {}", first.ceil(), last.floor());
            self.faults.add(key, what, allowed, "shorten \"frames\", or correct \"first_frame\" or \"fps\"");
        }
    }

    /// Reports the pops of a track, or marks them to be bridged.
    fn pops(&mut self, key: &Key, samples: &mut Samples, pops: Pops) {
        if pops == Pops::Keep {
            return;
        }
        let mut named = 0;
        for pop in track::find_pops(&samples.poses, samples.rate) {
            let known = |i: usize| samples.bridged.binary_search(&i).is_ok();
            if known(pop.sample) || known(pop.sample - 1) {
                continue;
            }
            if pops == Pops::Bridge && pop.alone {
                let place = samples.bridged.partition_point(|&i| i < pop.sample);
                samples.bridged.insert(place, pop.sample);
                continue;
            }
            named += 1;
            if named > MAX_NAMED {
                continue;
            }
            let length =
                |x: f64| if pop.angular { format!("{:.1}°", x.to_degrees()) } else { format!("{x:.4} m") };
            let frame = (samples.start + pop.sample as f64 / samples.rate) * self.fps;
            let way = if pop.alone { "jumps there and back" } else { "jumps" };
            let what = format!(
                "{way} by {} at frame {frame:.2} while the samples around move {} at most",
                length(pop.size),
                length(pop.around)
            );
            let allowed = format!("at most {} or 3 times the motion around", length(pop.limit));
            let remedy = if pop.alone {
                "mend the sample, or set \"pops\": \"bridge\" to replace it from its neighbours, \"keep\" to follow it"
            } else {
                "mend the track, or set \"pops\": \"keep\" to follow the jump"
            };
            self.faults.add(&key.index(pop.sample), what, allowed, remedy);
        }
        if named > MAX_NAMED {
            self.faults.add(
                key,
                format!("has {named} pops in all"),
                "none",
                "mend the track, or set \"pops\"",
            );
        }
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
            Some(Collider {
                name: file.name,
                body: body?,
                shape: shape?,
                friction: file.friction,
                thickness: file.thickness_m,
            })
        };
        files.into_iter().enumerate().map(collider).collect()
    }

    fn shape(&mut self, key: &Key, file: ShapeFile) -> Option<Shape> {
        let unit = self.convention.metres_per_unit;
        let convention = self.convention;
        let point = |p: [f64; 3]| convention.length_in(p.into());
        Some(match file {
            ShapeFile::Mesh { file, metres_per_unit, up_axis } => {
                let convention = Convention {
                    metres_per_unit: metres_per_unit.unwrap_or(unit),
                    up: up_axis.unwrap_or(convention.up),
                };
                let path = self.folder.join(&file);
                match TriMesh::load_obj(&path, &convention) {
                    Ok((mesh, 0)) => Shape::Mesh(mesh),
                    Ok((mesh, dropped)) => {
                        tracing::warn!("{}: {dropped} triangles of no area left out", path.display());
                        Shape::Mesh(mesh)
                    }
                    Err(what) => {
                        let allowed =
                            "a Wavefront OBJ file with triangles, relative to the folder of this file";
                        let remedy = "correct the path or export the mesh anew";
                        self.faults.add(&key.name("file"), format!("\"{file}\" {what}"), allowed, remedy);
                        return None;
                    }
                }
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
        })
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

impl Convention {
    /// A pose given in the file's unit and axes, in metres, Y up.
    fn pose_in(&self, translation: Vector3<f64>, rotation: UnitQuaternion<f64>) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(self.length_in(translation)), self.rotation_in(rotation))
    }
}
