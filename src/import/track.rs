//! A motion file and the meshes that move with it, made into an animation.

use super::motion::{self, Joint, Motion, turn};
use super::read::{self, ReadMesh, Source};
use super::usd::{self, Times};
use crate::scene::anim::file::{BodyFile, ColliderFile, Pops, PoseFile, ShapeFile, TrackFile};
use crate::scene::track::find_pops;
use crate::scene::{AnimFile, Convention, Groom, Sequence, TriMesh, UpAxis};
use crate::{Diagnostic, Error, Result};
use nalgebra::Vector3;
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Component, Path, PathBuf};

/// First frame of a bake unless asked otherwise.
const FIRST_FRAME: i32 = 1001;
/// Frames a second of a bake unless asked otherwise.
const FPS: f64 = 24.0;
/// Frames before the first and after the last at which a mesh is wanted, for its motion there.
const HANDLES: i32 = 2;
/// Digits of the vertices of meshes that are written: nanometres.
const OBJ_DIGITS: usize = 9;
/// Turn of the head in the first frame that is worth a warning, degrees.
const LARGE_TURN: f64 = 60.0;
/// Distance kept between a collider and the strands unless asked otherwise, m.
const THICKNESS: f64 = 5e-4;

/// Name of the body at rest that carries meshes which deform.
const WORLD: &str = "world";

/// Which pose of the joint is that of the head as it was modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rest {
    /// That in which the file says that the character was modelled: of a USD prim outside of time, of a skeleton's joint where it was bound,
    /// of a BVH without rotations. Place and turn; there is no pivot.
    Bind,
    /// At the pivot along the world's axes: the joint turns by its rotation.
    World,
    /// At the pivot, turned as in the first sample: for rigs whose joints have axes of their own. The head starts as it was modelled.
    First,
}

/// A mesh that the hair collides with, carried by the head; or one that deforms in the world, a file for each frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Name, unique: letters, digits and _, no digit first.
    pub name: String,
    /// The file, or the files where the name has a `#` for each digit of the frame's number (`cloth.####.obj`); the offset must be
    /// zero.
    pub source: Source,
    /// Coulomb friction coefficient; `None` for the strands' own.
    pub friction: Option<f64>,
    /// Distance kept between the mesh and the strands, m.
    pub thickness: f64,
}

impl Mesh {
    /// A mesh named after its file, or its prim.
    pub fn new(source: Source) -> Self {
        let prim = source.prim.as_deref().and_then(|prim| prim.rsplit('/').next()).map(String::from);
        let stem = source.path.file_stem().map(|s| s.to_string_lossy().replace('#', ""));
        let stem = prim.or(stem).unwrap_or_default();
        let stem = stem.trim_end_matches(['.', '_', '-']);
        let mut name: String =
            stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            name.insert_str(0, "mesh_");
        }
        Mesh { name, source, friction: None, thickness: THICKNESS }
    }

    /// The mesh as it is at rest: of one that deforms, as it is in frame `first`.
    fn at_rest(&self, first: i32) -> Source {
        let path = self.source.path.to_string_lossy();
        match Sequence::new(&path) {
            Some(sequence) => Source { path: sequence.path(Path::new(""), first), ..self.source.clone() },
            None => self.source.clone(),
        }
    }
}

/// What [`track`] is to make.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackOptions {
    /// The motion file: our own (fps, unit, up axis, and a pose of the joint for every sample), BVH, glTF or USD.
    pub motion: Source,
    /// Which joint of it.
    pub joint: Joint,
    /// Folder in which the animation will be written; the paths of meshes start there.
    pub folder: PathBuf,
    /// Frames a second of the bake; `None` for those in which the file numbers its frames, else 24.
    pub fps: Option<f64>,
    /// First and last frame; `None` for the file's own, or 1001 to the end of the track where it numbers none.
    pub frames: Option<[i32; 2]>,
    /// Where the joint is in the head as it was modelled, m, Y up, rest space; `None` for the origin.
    pub pivot: Option<Vector3<f64>>,
    /// Which pose is that of the head as it was modelled; `None` for the pose that the file says without a pivot, else that of the
    /// world's axes.
    pub rest: Option<Rest>,
    /// Meshes carried by the head.
    pub colliders: Vec<Mesh>,
    /// Frequency above which motion is taken as noise, Hz; `None` for the format's default, 0 for no filter.
    pub smoothing_hz: Option<f64>,
    /// What to do with one-frame pops.
    pub pops: Pops,
}

impl TrackOptions {
    /// The defaults for a motion file: no collider, no pivot.
    pub fn new(motion: Source, folder: impl Into<PathBuf>) -> Self {
        TrackOptions {
            motion,
            joint: Joint::default(),
            folder: folder.into(),
            fps: None,
            frames: None,
            pivot: None,
            rest: None,
            colliders: Vec::new(),
            smoothing_hz: None,
            pops: Pops::Error,
        }
    }
}

/// What was found in a motion file and made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackReport {
    /// The file.
    pub path: PathBuf,
    /// Samples, and samples a second.
    pub samples: (usize, f64),
    /// Its unit and up axis.
    pub convention: Convention,
    /// Frames of the bake, and frames a second.
    pub frames: ([i32; 2], f64),
    /// Frame at which the first sample lies.
    pub first_frame: f64,
    /// How the joint is turned in the rest pose, and where it is, m.
    pub rest: (Rest, [f64; 3]),
    /// Turn of the head from its rest pose in the first sample, degrees.
    pub first_turn: f64,
    /// Samples that pop.
    pub pops: Vec<usize>,
    /// Guesses made and oddities of the meshes.
    pub notes: Vec<String>,
    /// What an artist should look at.
    pub warnings: Vec<String>,
}

/// Middle of the roots of a groom's guides, m, rest space: a pivot where none is known.
pub fn root_centroid(groom: &Groom) -> Vector3<f64> {
    let guides = &groom.guides.curves;
    (0..guides.len()).map(|c| guides.curve(c)[0]).sum::<Vector3<f64>>() / guides.len().max(1) as f64
}

/// An animation, and the meshes that have to be written beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// The animation.
    pub anim: AnimFile,
    /// Meshes from USD as OBJ files, by their paths.
    pub meshes: Vec<(PathBuf, String)>,
    /// What was found.
    pub report: TrackReport,
}

impl Track {
    /// Writes the animation at `path`, which lies in the folder of the options, and the meshes.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        for (file, text) in &self.meshes {
            crate::file::write_file(file, &[text])?;
        }
        self.anim.write(path)
    }
}

/// Makes an animation of a motion file. Its first sample lies on the first frame, unless the file numbers its frames; unit and up axis
/// stay the file's.
///
/// # Errors
/// Files that cannot be read or are faulty, options out of range.
pub fn track(options: &TrackOptions) -> Result<Track> {
    let read = motion::read(&options.motion, &options.joint);
    let time = match &read {
        Ok(motion) => Some(Time::of(options, motion)?),
        Err(_) => None,
    };
    let first =
        time.as_ref().map(|time| time.frames[0]).or(options.frames.map(|f| f[0])).unwrap_or(FIRST_FRAME);
    let rest: Vec<Source> = options.colliders.iter().map(|mesh| mesh.at_rest(first)).collect();
    let times = |source: &Source| time.as_ref().map(|time| time.of_mesh(options, source, read.as_ref().ok()));
    let meshes: Vec<_> =
        rest.iter().map(|source| read::moving_mesh(source, times(source).as_ref())).collect();
    let (motion, meshes) = all_problems(read, meshes)?;
    let Some(Time { fps, frames, first_frame, .. }) = time else {
        return Err(Error::Internal("a motion that was read has no time".into()));
    };

    let Motion { rate, convention, poses, bind, .. } = &motion;
    let kind = options.rest.unwrap_or(match (bind, options.pivot) {
        (Some(_), None) => Rest::Bind,
        _ => Rest::World,
    });
    let pivot = convention.length_out(options.pivot.unwrap_or_default()).into();
    let pose = match (kind, bind) {
        (Rest::Bind, Some(bind)) => *bind,
        (Rest::Bind, None) => {
            let what = "does not say in which pose the character was modelled";
            let remedy = "use --rest first, or --rest world with the pivot";
            return Err(
                Diagnostic::new(&options.motion.path, "rest", what, "USD, glTF or BVH", remedy).into()
            );
        }
        (Rest::World, _) => PoseFile { translation: pivot, rotation_wxyz: [1.0, 0.0, 0.0, 0.0] },
        (Rest::First, _) => PoseFile { translation: pivot, rotation_wxyz: poses[0].rotation_wxyz },
    };

    let first_turn = turn(poses[0].rotation_wxyz).angle_to(&turn(pose.rotation_wxyz)).to_degrees();
    let mut report = TrackReport {
        path: options.motion.path.clone(),
        samples: (poses.len(), *rate),
        convention: *convention,
        frames: (frames, fps),
        first_frame,
        rest: (kind, convention.length_in(pose.translation.into()).into()),
        first_turn,
        pops: find_pops(&motion.in_metres(), *rate).iter().map(|pop| pop.sample).collect(),
        notes: motion.notes.clone(),
        warnings: motion.warnings.clone(),
    };
    let smoothing = options.smoothing_hz.unwrap_or(TrackFile::default().smoothing_hz);
    let mut anim = AnimFile::new(fps, frames);
    anim.metres_per_unit = convention.metres_per_unit;
    anim.up_axis = convention.up;
    anim.bodies = vec![BodyFile {
        name: "head".into(),
        track: Some(TrackFile {
            fps: Some(*rate),
            first_frame: (first_frame != f64::from(frames[0])).then_some(first_frame),
            translation: Some(poses.iter().map(|p| p.translation).collect::<Vec<_>>().into()),
            rotation_wxyz: Some(poses.iter().map(|p| p.rotation_wxyz).collect::<Vec<_>>().into()),
            rest: Some(pose),
            smoothing_hz: smoothing,
            pops: options.pops,
            ..TrackFile::default()
        }),
    }];
    let mut written = Vec::new();
    let mut names = BTreeSet::new();
    for ((mesh, rest), read) in options.colliders.iter().zip(&rest).zip(meshes) {
        let noted = read.notes.iter().map(|note| format!("{}: {note}", mesh.source.path.display()));
        report.notes.extend(noted);
        let mut name = mesh.name.clone();
        for i in 2.. {
            if names.insert(name.clone()) {
                break;
            }
            name = format!("{}_{i}", mesh.name);
        }
        let deforms = mesh.source != *rest || !read.moving.is_empty();
        let shape = if usd::is_usd(&rest.path) {
            let first = frames[0] - before(first_frame, frames);
            written_mesh(&name, &read, first, &options.folder, &mut written)
        } else {
            ShapeFile::Mesh {
                file: relative(&rest.path, &options.folder)?,
                sequence: if deforms { Some(relative(&mesh.source.path, &options.folder)?) } else { None },
                metres_per_unit: Some(read.convention.metres_per_unit),
                up_axis: Some(read.convention.up),
            }
        };
        if deforms && anim.bodies.len() == 1 {
            anim.bodies.push(BodyFile { name: WORLD.into(), track: None });
        }
        anim.colliders.push(ColliderFile {
            name,
            body: deforms.then(|| WORLD.into()),
            shape,
            friction: mesh.friction,
            static_friction: None,
            thickness_m: mesh.thickness,
        });
    }
    report.warn(options);
    Ok(Track { anim, meshes: written, report })
}

/// The time of a bake.
struct Time {
    fps: f64,
    frames: [i32; 2],
    /// Frame at which the first sample lies, and the last.
    first_frame: f64,
    last_frame: f64,
    /// Numbers that the file counts in a frame of the bake.
    codes_per_frame: f64,
}

impl Time {
    fn of(options: &TrackOptions, motion: &Motion) -> Result<Time> {
        let fps = options.fps.or(motion.numbered.map(|(_, rate)| rate)).unwrap_or(FPS);
        if !(1.0..=1000.0).contains(&fps) {
            return Err(Error::Usage(format!("{fps} frames a second: 1 to 1000 are possible")));
        }
        let span = (motion.poses.len() - 1) as f64 / motion.rate * fps;
        let own = motion.numbered.map(|(code, rate)| code / rate * fps);
        let first_frame = own.unwrap_or(options.frames.map_or(FIRST_FRAME, |frames| frames[0]).into());
        let last_frame = first_frame + span;
        let there = [(first_frame - 1e-6).ceil() as i32, (last_frame + 1e-6).floor() as i32];
        let frames = options.frames.unwrap_or(there);
        if frames[0] > frames[1] || frames[0] < there[0] || frames[1] > there[1] {
            return Err(frames_fault(options, frames, there));
        }
        let codes_per_frame = motion.numbered.map_or(1.0, |(_, rate)| rate / fps);
        Ok(Time { fps, frames, first_frame, last_frame, codes_per_frame })
    }

    /// When a mesh of USD is wanted: at the frames of the bake, and at some more on both sides as far as the motion goes.
    fn of_mesh(&self, options: &TrackOptions, source: &Source, motion: Option<&Motion>) -> Times {
        let [first, last] = [self.frames[0] - before(self.first_frame, self.frames), self.frames[1]];
        let after = ((self.last_frame + 1e-6).floor() as i32 - last).clamp(0, HANDLES);
        let same = source.path == options.motion.path && options.joint.name.is_none();
        Times {
            start: f64::from(first) * self.codes_per_frame,
            step: self.codes_per_frame,
            count: (last + after - first + 1) as usize,
            carrier: motion.and_then(|m| m.prim.clone()).filter(|_| same),
        }
    }
}

/// Frames before the first at which meshes are wanted, as far as the motion goes.
fn before(first_frame: f64, frames: [i32; 2]) -> i32 {
    (frames[0] - (first_frame - 1e-6).ceil() as i32).clamp(0, HANDLES)
}

/// A mesh from USD as OBJ files in `folder`, metres, Y up; the first of those over time is of frame `first`.
fn written_mesh(
    name: &str,
    read: &ReadMesh,
    first: i32,
    folder: &Path,
    written: &mut Vec<(PathBuf, String)>,
) -> ShapeFile {
    let file = format!("{name}.obj");
    written.push((folder.join(&file), read.mesh.to_obj(OBJ_DIGITS)));
    let sequence = (!read.moving.is_empty()).then(|| format!("{name}.####.obj"));
    if let Some(sequence) = sequence.as_deref().and_then(Sequence::new) {
        for (frame, vertices) in (first..).zip(&read.moving) {
            let mesh = TriMesh { vertices: vertices.clone(), ..read.mesh.clone() };
            written.push((sequence.path(folder, frame), mesh.to_obj(OBJ_DIGITS)));
        }
    }
    ShapeFile::Mesh { file, sequence, metres_per_unit: Some(1.0), up_axis: Some(UpAxis::Y) }
}

/// The motion and the meshes, or the problems of all of them in one report.
fn all_problems<M>(motion: Result<M>, meshes: Vec<Result<ReadMesh>>) -> Result<(M, Vec<ReadMesh>)> {
    let mut problems = Vec::new();
    let mut read = Vec::with_capacity(meshes.len());
    let motion = match motion {
        Err(Error::BadInput(found)) => {
            problems.extend(found);
            None
        }
        other => Some(other?),
    };
    for mesh in meshes {
        match mesh {
            Err(Error::BadInput(found)) => problems.extend(found),
            other => read.push(other?),
        }
    }
    match motion {
        Some(motion) if problems.is_empty() => Ok((motion, read)),
        _ => Err(Error::BadInput(problems)),
    }
}

fn frames_fault(options: &TrackOptions, frames: [i32; 2], there: [i32; 2]) -> Error {
    Diagnostic::new(
        &options.motion.path,
        "frames",
        format!("frames {} to {} asked for", frames[0], frames[1]),
        format!("a range in {} to {}, where the track is", there[0], there[1]),
        "shorten the range with --frames, or export a longer track",
    )
    .into()
}

/// The way from `folder` to `path`, with forward slashes, as it stands in a file.
fn relative(path: &Path, folder: &Path) -> Result<String> {
    let whole = |p: &Path| -> Result<PathBuf> {
        let absolute = std::path::absolute(p).map_err(|e| Error::io(p, e))?;
        let mut out = PathBuf::new();
        for part in absolute.components() {
            match part {
                Component::ParentDir => {
                    out.pop();
                }
                other => out.push(other),
            }
        }
        Ok(out)
    };
    let (path, folder) = (whole(path)?, whole(folder)?);
    let shared = path.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| "..".to_string());
    let down = path.components().skip(shared).map(|c| c.as_os_str().to_string_lossy().into_owned());
    Ok(up.chain(down).collect::<Vec<_>>().join("/"))
}

impl TrackReport {
    fn warn(&mut self, options: &TrackOptions) {
        if self.first_turn > LARGE_TURN {
            self.warnings.push(format!(
                "the first frame turns the head {:.0}° from how it was modelled: if the joint's axes are arbitrary, use \
                 --rest first",
                self.first_turn
            ));
        }
        if !self.pops.is_empty() && options.pops == Pops::Error {
            let named: Vec<String> = self.pops.iter().take(5).map(usize::to_string).collect();
            self.warnings.push(format!(
                "{} ({}{}): a bake refuses that; import with --pops bridge or keep, or clean the track",
                match self.pops.len() {
                    1 => "1 sample pops".into(),
                    n => format!("{n} samples pop"),
                },
                named.join(", "),
                if self.pops.len() > 5 { ", …" } else { "" }
            ));
        }
        for mesh in options.colliders.iter().filter(|m| m.source.offset != Vector3::zeros()) {
            self.warnings
                .push(format!("collider {}: an offset is not kept; move the mesh instead", mesh.name));
        }
    }
}

impl fmt::Display for TrackReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (samples, rate) = self.samples;
        let ([first, last], fps) = self.frames;
        writeln!(
            f,
            "{}: {samples} samples at {rate} a second, {:.2} s",
            self.path.display(),
            samples as f64 / rate
        )?;
        writeln!(f, "  1 unit = {} m, {:?} up", self.convention.metres_per_unit, self.convention.up)?;
        writeln!(
            f,
            "  frames {first} to {last} at {fps} a second, the first sample on frame {}",
            self.first_frame
        )?;
        let (rest, [x, y, z]) = self.rest;
        let turned = match rest {
            Rest::Bind => "as the file has it",
            Rest::World => "along the world's axes",
            Rest::First => "as in the first sample",
        };
        writeln!(f, "  rest pose: joint at ({x:.3}, {y:.3}, {z:.3}) m, {turned}")?;
        writeln!(f, "  the first sample turns the head by {:.0}° from there", self.first_turn)?;
        self.notes.iter().try_for_each(|note| writeln!(f, "  {note}"))?;
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::load_anim;
    use nalgebra::Point3;

    /// A head that goes 1 cm along x and turns 1.5° about y in every of `n` samples at 48 a second, from a quarter turn.
    fn motion_file(folder: &Path, n: usize) -> Source {
        let frames: Vec<_> = (0..n)
            .map(|i| {
                let q = nalgebra::UnitQuaternion::from_axis_angle(
                    &Vector3::y_axis(),
                    (90.0 + 1.5 * i as f64).to_radians(),
                );
                serde_json::json!({
                    "translation": [i as f64, 150.0, 0.0], "rotation_quat_wxyz": [q.w, q.i, q.j, q.k],
                })
            })
            .collect();
        let path = folder.join("walk.json");
        let file = serde_json::json!({ "fps": 48.0, "units": "cm", "up_axis": "Y", "frames": frames });
        std::fs::write(&path, file.to_string()).unwrap();
        Source::new(path)
    }

    fn write_and_load(anim: &AnimFile, folder: &Path) -> crate::scene::Anim {
        let path = folder.join("anim.json");
        anim.write(&path).unwrap();
        load_anim(&path).unwrap()
    }

    #[test]
    fn a_track_keeps_its_motion_rate_and_rest_offset() {
        let folder = tempfile::tempdir().unwrap();
        let pivot = Vector3::new(0.0, 1.4, 0.1);
        let mut options = TrackOptions::new(motion_file(folder.path(), 49), folder.path());
        options.pivot = Some(pivot);
        options.smoothing_hz = Some(0.0);
        let Track { anim: file, report, .. } = track(&options).unwrap();
        assert_eq!(file.frames, [1001, 1025]);
        assert!(
            (report.first_turn - 90.0).abs() < 1e-9 && report.warnings[0].contains("--rest first"),
            "{report}"
        );
        let anim = write_and_load(&file, folder.path());
        for (frame, sample) in [(1001.0, 0.0), (1012.5, 23.0), (1025.0, 48.0)] {
            let pose = anim.head_pose(anim.time(frame));
            let joint = pose * Point3::from(pivot);
            assert!((joint.coords - Vector3::new(0.01 * sample, 1.5, 0.0)).norm() < 1e-6, "{frame}: {joint}");
            let turn = pose.rotation.angle().to_degrees();
            assert!((turn - (90.0 + 1.5 * sample)).abs() < 1e-3, "{frame}: {turn}");
        }

        options.rest = Some(Rest::First);
        let Track { anim: file, report, .. } = track(&options).unwrap();
        assert_eq!((report.first_turn, report.warnings.len()), (0.0, 0));
        let anim = write_and_load(&file, folder.path());
        assert!(anim.head_pose(anim.time(1001.0)).rotation.angle() < 1e-6);
        assert!((anim.head_pose(anim.time(1025.0)).rotation.angle().to_degrees() - 72.0).abs() < 1e-3);
    }

    #[test]
    fn meshes_in_other_units_come_along() {
        let folder = tempfile::tempdir().unwrap();
        let shelf = folder.path().join("meshes");
        std::fs::create_dir(&shelf).unwrap();
        std::fs::write(shelf.join("7 head.obj"), "v 0 0 0\nv 200 0 0\nv 0 300 0\nf 1 2 3\n").unwrap();
        let mut options = TrackOptions::new(motion_file(folder.path(), 9), folder.path().join("shots/a"));
        std::fs::create_dir_all(&options.folder).unwrap();
        options.colliders = vec![Mesh::new(Source::new(shelf.join("7 head.obj")))];
        let Track { anim: file, report, .. } = track(&options).unwrap();
        assert!(report.notes[0].contains("millimetres"), "{report}");
        let anim = write_and_load(&file, &options.folder);
        assert_eq!(anim.colliders[0].name, "mesh_7_head");
        let crate::scene::Shape::Mesh(mesh) = &anim.colliders[0].shape else { panic!("not a mesh") };
        assert!((mesh.vertices[2].y - 0.3).abs() < 1e-6);
    }

    #[test]
    fn a_sequence_of_meshes_deforms_in_the_world() {
        let folder = tempfile::tempdir().unwrap();
        for frame in 1001..=1005 {
            let text = format!("v 0 {} 0\nv 200 0 0\nv 0 300 0\nf 1 2 3\n", frame - 1000);
            std::fs::write(folder.path().join(format!("silk_shirt.{frame}.obj")), text).unwrap();
        }
        let mut options = TrackOptions::new(motion_file(folder.path(), 9), folder.path());
        options.colliders = vec![Mesh::new(Source::new(folder.path().join("silk_shirt.####.obj")))];
        let file = track(&options).unwrap().anim;
        let anim = write_and_load(&file, &options.folder);
        let collider = &anim.colliders[0];
        assert_eq!(
            (collider.name.as_str(), anim.bodies[collider.body].name.as_str()),
            ("silk_shirt", "world")
        );
        let deformation = collider.deformation.as_ref().unwrap();
        assert!((deformation.vertices(anim.time(1003.0))[0].y - 0.003).abs() < 1e-9);
        options.frames = Some([1006, 1007]);
        let Err(Error::BadInput(problems)) = track(&options) else { panic!("accepted") };
        assert!(problems[0].file.ends_with("silk_shirt.1006.obj"), "{:?}", problems[0]);
    }

    #[test]
    fn every_faulty_file_is_in_the_report() {
        let folder = tempfile::tempdir().unwrap();
        let motion = folder.path().join("walk.json");
        std::fs::write(&motion, r#"{ "fps": -1.0, "frames": [] }"#).unwrap();
        let mut options = TrackOptions::new(Source::new(&motion), folder.path());
        options.colliders = vec![Mesh::new(Source::new(folder.path().join("no.obj")))];
        let Err(Error::BadInput(problems)) = track(&options) else { panic!("accepted") };
        let files: Vec<_> = problems.iter().map(|p| p.file.file_name().unwrap().to_string_lossy()).collect();
        assert_eq!(files, ["walk.json", "walk.json", "no.obj"]);

        let mut options = TrackOptions::new(motion_file(folder.path(), 9), folder.path());
        options.frames = Some([1, 9]);
        let Err(Error::BadInput(problems)) = track(&options) else { panic!("accepted") };
        assert!(problems[0].allowed.contains("1 to 5"), "{:?}", problems[0]);
    }

    #[test]
    fn the_way_to_a_file_starts_from_the_folder() {
        let way = |path: &str, folder: &str| relative(Path::new(path), Path::new(folder)).unwrap();
        assert_eq!(way("/a/b/c.obj", "/a/b"), "c.obj");
        assert_eq!(way("/a/b/../x/c.obj", "/a/b"), "../x/c.obj");
        assert_eq!(way("c.obj", "d/e"), "../../c.obj");
    }
}
