//! A motion file and the meshes that move with it, made into an animation.

use super::read::{self, ReadMesh, Source};
use crate::scene::anim::file::{BodyFile, ColliderFile, Pops, PoseFile, ShapeFile, TrackFile};
use crate::scene::track::find_pops;
use crate::scene::{AnimFile, Convention, Groom, Sequence, motion};
use crate::{Error, Problem, Result};
use nalgebra::{UnitQuaternion, Vector3};
use std::fmt;
use std::path::{Component, Path, PathBuf};

/// First frame of a bake unless asked otherwise.
const FIRST_FRAME: i32 = 1001;
/// Turn of the head in the first frame that is worth a warning, degrees.
const LARGE_TURN: f64 = 60.0;
/// Distance kept between a collider and the strands unless asked otherwise, m.
const THICKNESS: f64 = 5e-4;

/// Name of the body at rest that carries meshes which deform.
const WORLD: &str = "world";

/// Which orientation of the joint is that of the head as it was modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Rest {
    /// That of the world's axes: the joint turns by its rotation.
    #[default]
    World,
    /// That of the first sample: for rigs whose joints have axes of their own. The head starts as it was modelled.
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
    /// A mesh named after its file.
    pub fn new(source: Source) -> Self {
        let stem = source.path.file_stem().map(|s| s.to_string_lossy().replace('#', "")).unwrap_or_default();
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
    /// The motion file: fps, unit, up axis, and a pose of the joint for every sample.
    pub motion: PathBuf,
    /// Folder in which the animation will be written; the paths of meshes start there.
    pub folder: PathBuf,
    /// Frames a second of the bake.
    pub fps: f64,
    /// First and last frame; `None` for 1001 to the end of the track.
    pub frames: Option<[i32; 2]>,
    /// Where the joint is in the head as it was modelled, m, Y up, rest space.
    pub pivot: Vector3<f64>,
    /// How the joint is turned there.
    pub rest: Rest,
    /// Meshes carried by the head.
    pub colliders: Vec<Mesh>,
    /// Frequency above which motion is taken as noise, Hz; `None` for the format's default, 0 for no filter.
    pub smoothing_hz: Option<f64>,
    /// What to do with one-frame pops.
    pub pops: Pops,
}

impl TrackOptions {
    /// The defaults for a motion file: 24 frames a second from 1001 on, a joint that turns about `pivot`, no collider.
    pub fn new(motion: impl Into<PathBuf>, folder: impl Into<PathBuf>, pivot: Vector3<f64>) -> Self {
        TrackOptions {
            motion: motion.into(),
            folder: folder.into(),
            fps: 24.0,
            frames: None,
            pivot,
            rest: Rest::World,
            colliders: Vec::new(),
            smoothing_hz: None,
            pops: Pops::Error,
        }
    }
}

/// What was found in a motion file and made of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrackReport {
    /// The file.
    pub path: PathBuf,
    /// Samples, and samples a second.
    pub samples: (usize, f64),
    /// Its unit and up axis.
    pub convention: Convention,
    /// Frames of the bake, and frames a second.
    pub frames: ([i32; 2], f64),
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

/// Makes an animation of a motion file. Its first sample lies on the first frame; unit and up axis stay the
/// file's.
///
/// # Errors
/// Files that cannot be read or are faulty, options out of range.
pub fn track(options: &TrackOptions) -> Result<(AnimFile, TrackReport)> {
    if !(1.0..=1000.0).contains(&options.fps) {
        return Err(Error::Usage(format!("{} frames a second: 1 to 1000 are possible", options.fps)));
    }
    let read = motion(&options.motion);
    let first = options.frames.map_or(FIRST_FRAME, |frames| frames[0]);
    let rest: Vec<Source> = options.colliders.iter().map(|mesh| mesh.at_rest(first)).collect();
    let meshes: Vec<_> = rest.iter().map(read::mesh).collect();
    let ((file, poses), meshes) = all_problems(read, meshes)?;

    let convention = Convention { metres_per_unit: file.units.metres(), up: file.up_axis.into() };
    let last = |first: i32| first + ((poses.len() - 1) as f64 / file.fps * options.fps + 1e-6).floor() as i32;
    let frames = options.frames.unwrap_or([FIRST_FRAME, last(FIRST_FRAME)]);
    if frames[0] > frames[1] || frames[1] > last(frames[0]) {
        return Err(frames_fault(options, frames, last(frames[0])));
    }
    let first = file.frames[0].rotation_quat_wxyz;
    let turn =
        |q: [f64; 4]| UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]));
    let upright = [1.0, 0.0, 0.0, 0.0];
    let rest_rotation = match options.rest {
        Rest::World => upright,
        Rest::First => first,
    };
    let pose =
        PoseFile { translation: convention.length_out(options.pivot).into(), rotation_wxyz: rest_rotation };

    let mut report = TrackReport {
        path: options.motion.clone(),
        samples: (poses.len(), file.fps),
        convention,
        frames: (frames, options.fps),
        rest: (options.rest, options.pivot.into()),
        first_turn: turn(first).angle_to(&turn(rest_rotation)).to_degrees(),
        pops: find_pops(&poses, file.fps).iter().map(|pop| pop.sample).collect(),
        ..TrackReport::default()
    };
    let smoothing = options.smoothing_hz.unwrap_or(TrackFile::default().smoothing_hz);
    let mut anim = AnimFile::new(options.fps, frames);
    anim.metres_per_unit = convention.metres_per_unit;
    anim.up_axis = convention.up;
    anim.bodies = vec![BodyFile {
        name: "head".into(),
        track: Some(TrackFile {
            fps: Some(file.fps),
            translation: Some(file.frames.iter().map(|f| f.translation).collect::<Vec<_>>().into()),
            rotation_wxyz: Some(file.frames.iter().map(|f| f.rotation_quat_wxyz).collect::<Vec<_>>().into()),
            rest: Some(pose),
            smoothing_hz: smoothing,
            pops: options.pops,
            ..TrackFile::default()
        }),
    }];
    if options.colliders.iter().zip(&rest).any(|(mesh, rest)| mesh.source != *rest) {
        anim.bodies.push(BodyFile { name: WORLD.into(), track: None });
    }
    for ((mesh, rest), ReadMesh { convention, notes, .. }) in options.colliders.iter().zip(&rest).zip(meshes)
    {
        let deforms = mesh.source != *rest;
        report.notes.extend(notes.into_iter().map(|note| format!("{}: {note}", mesh.source.path.display())));
        anim.colliders.push(ColliderFile {
            name: mesh.name.clone(),
            body: deforms.then(|| WORLD.into()),
            shape: ShapeFile::Mesh {
                file: relative(&rest.path, &options.folder)?,
                sequence: if deforms { Some(relative(&mesh.source.path, &options.folder)?) } else { None },
                metres_per_unit: Some(convention.metres_per_unit),
                up_axis: Some(convention.up),
            },
            friction: mesh.friction,
            static_friction: None,
            thickness_m: mesh.thickness,
        });
    }
    report.warn(options);
    Ok((anim, report))
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

fn frames_fault(options: &TrackOptions, frames: [i32; 2], last: i32) -> Error {
    Problem::new(
        &options.motion,
        "frames",
        format!("frames {} to {} asked for", frames[0], frames[1]),
        format!("a range that starts at {0} ends at {0} to {last}, where the track ends", frames[0]),
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
                "{} samples pop ({}{}): bake with --pops bridge or keep, or clean the track",
                self.pops.len(),
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
        writeln!(f, "  frames {first} to {last} at {fps} a second, the first sample on frame {first}")?;
        let (rest, [x, y, z]) = self.rest;
        let turned = match rest {
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
    fn motion_file(folder: &Path, n: usize) -> PathBuf {
        let frames: Vec<_> = (0..n)
            .map(|i| {
                let q =
                    UnitQuaternion::from_axis_angle(&Vector3::y_axis(), (90.0 + 1.5 * i as f64).to_radians());
                serde_json::json!({
                    "translation": [i as f64, 150.0, 0.0], "rotation_quat_wxyz": [q.w, q.i, q.j, q.k],
                })
            })
            .collect();
        let path = folder.join("walk.json");
        let file = serde_json::json!({ "fps": 48.0, "units": "cm", "up_axis": "Y", "frames": frames });
        std::fs::write(&path, file.to_string()).unwrap();
        path
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
        let mut options = TrackOptions::new(motion_file(folder.path(), 49), folder.path(), pivot);
        options.smoothing_hz = Some(0.0);
        let (file, report) = track(&options).unwrap();
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

        options.rest = Rest::First;
        let (file, report) = track(&options).unwrap();
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
        let mut options =
            TrackOptions::new(motion_file(folder.path(), 9), folder.path().join("shots/a"), Vector3::zeros());
        std::fs::create_dir_all(&options.folder).unwrap();
        options.colliders = vec![Mesh::new(Source::new(shelf.join("7 head.obj")))];
        let (file, report) = track(&options).unwrap();
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
        let mut options = TrackOptions::new(motion_file(folder.path(), 9), folder.path(), Vector3::zeros());
        options.colliders = vec![Mesh::new(Source::new(folder.path().join("silk_shirt.####.obj")))];
        let (file, _) = track(&options).unwrap();
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
        let mut options = TrackOptions::new(&motion, folder.path(), Vector3::zeros());
        options.colliders = vec![Mesh::new(Source::new(folder.path().join("no.obj")))];
        let Err(Error::BadInput(problems)) = track(&options) else { panic!("accepted") };
        let files: Vec<_> = problems.iter().map(|p| p.file.file_name().unwrap().to_string_lossy()).collect();
        assert_eq!(files, ["walk.json", "walk.json", "no.obj"]);

        let mut options = TrackOptions::new(motion_file(folder.path(), 9), folder.path(), Vector3::zeros());
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
