//! Makes an animation from a motion file and collider meshes.

use super::colliders::{Colliders, WORLD};
use super::goals::{GoalInput, Goals};
use super::options::{ColliderMesh, GoalCurvesSource, RestPose, TrackGroom, TrackOptions};
use super::report::{TrackPop, TrackReport};
use super::timing::{DEFAULT_FIRST_FRAME, Timing};
use crate::file::relative;
use crate::import::mesh_file::{ImportedMesh, read_deforming_mesh};
use crate::import::motion::{Motion, rotation};
use crate::import::motion_file::read_motion;
use crate::import::source::Source;
use crate::scene::anim::file::{BodyFile, OverFile, Pops, PoseFile, TrackFile};
use crate::scene::placement::PlacedMesh;
use crate::scene::track::{Pop, find_pops};
use crate::scene::{AnimFile, Origin, RestSpace};
use crate::{Diagnostic, Error, Result};
use nalgebra::{Point3, Vector3};
use std::path::{Path, PathBuf};

/// An animation and the mesh files that belong to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// The animation.
    pub anim: AnimFile,
    /// OBJ files converted from USD and glTF, meshes and curves: path and text.
    pub meshes: Vec<(PathBuf, String)>,
    /// The report.
    pub report: TrackReport,
}

impl Track {
    /// Writes the animation to `path`, the [`TrackOptions::output`] of its import, and the meshes.
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

/// Makes an animation from a motion file. Its first sample is the first frame, unless the file numbers its
/// frames; unit and up axis stay those of the file.
///
/// # Errors
/// Unreadable or invalid files, all in one report; options out of range.
pub fn track(options: &TrackOptions) -> Result<Track> {
    let mut inputs = Inputs::read(options)?;
    let goal_inputs = std::mem::take(&mut inputs.goals);
    let Inputs { motion, timing, meshes, .. } = &inputs;
    let pops = find_pops(&motion.in_metres(), motion.rate);
    let first = first_sample(&pops, options.pops);
    let (kind, rest) = rest_pose(options, motion, first)?;

    let mut colliders = Colliders::default();
    for (mesh, (file, read)) in options.colliders.iter().zip(meshes) {
        colliders.add(mesh, file, read, timing.first_mesh_frame(), options)?;
    }
    let mut goals = Goals::beside(&colliders);
    for (goal, read) in options.goals.iter().zip(goal_inputs) {
        goals.add(goal, read, timing, options)?;
    }
    let mut report = TrackReport {
        path: options.motion.path.clone(),
        samples: (motion.poses.len(), motion.rate),
        convention: motion.convention,
        frames: (timing.frames, timing.fps),
        first_frame: timing.first_sample,
        rest: (kind, motion.convention.length_in(rest.translation.into()).into()),
        first_rotation: rotation(motion.poses[first].rotation_wxyz)
            .angle_to(&rotation(rest.rotation_wxyz))
            .to_degrees(),
        pops: pops.iter().map(|pop| track_pop(pop, timing, motion.rate)).collect(),
        notes: [&motion.notes[..], &colliders.notes[..], &goals.notes[..]].concat(),
        warnings: [&motion.warnings[..], &goals.warnings[..]].concat(),
    };
    report.add_warnings(options);
    let origin = origin(options, motion, kind)?;
    if let Some(groom) = &options.groom {
        report.notes.extend(check_placement(options, groom, &inputs, rest, &origin)?);
    }

    let mut anim = AnimFile::new(timing.fps, timing.frames);
    anim.metres_per_unit = motion.convention.metres_per_unit;
    anim.up_axis = motion.convention.up;
    anim.bodies = vec![head(options, motion, timing, rest, origin)];
    if colliders.any_deforms() {
        anim.bodies.push(BodyFile { name: WORLD.into(), track: None });
    }
    (anim.colliders, anim.skins) = (colliders.colliders, colliders.skins);
    anim.goals = goals.goals;
    anim.over = over(options, motion)?;
    Ok(Track { anim, meshes: [colliders.files, goals.files].concat(), report })
}

/// The contents of all files.
struct Inputs {
    motion: Motion,
    timing: Timing,
    /// For each collider the file that was read and its contents.
    meshes: Vec<(Source, ImportedMesh)>,
    /// The curves of each goal.
    goals: Vec<GoalInput>,
}

impl Inputs {
    /// Reads the motion, the meshes and the curves.
    ///
    /// # Errors
    /// The errors of all files in one report.
    fn read(options: &TrackOptions) -> Result<Self> {
        let rest_of = options.groom.as_ref().and_then(TrackGroom::rest_stage);
        let curves = options.groom.as_ref().and_then(|groom| groom.curves.as_ref());
        let motion = read_motion(&options.motion, &options.joint, rest_of.as_deref(), curves)
            .and_then(|motion| motion.check_places(&options.motion.path).map(|()| motion));
        let timing = match &motion {
            Ok(motion) => Some(Timing::new(options, motion)?),
            Err(_) => None,
        };
        // If the motion cannot be read, the meshes are still checked.
        let first = timing
            .as_ref()
            .map(|timing| timing.frames[0])
            .or(options.frames.map(|f| f[0]))
            .unwrap_or(DEFAULT_FIRST_FRAME);
        let meshes = options.colliders.iter().map(|mesh| {
            let file = mesh.first_file(first);
            let times = timing.as_ref().map(|t| t.mesh_times(options, &file, motion.as_ref().ok()));
            let read = read_deforming_mesh(&file, times.as_ref())?;
            Ok((file, read))
        });
        let meshes = meshes.collect();
        let goals = timing.iter().flat_map(|timing| {
            let read = |goal: &GoalCurvesSource| {
                let times = timing.mesh_times(options, &goal.source, None);
                GoalInput::read(&goal.source, &times, timing.frames[0])
            };
            options.goals.iter().map(read)
        });
        let goals = goals.collect();
        let (motion, meshes, goals) = merge_errors(motion, meshes, goals)?;
        let timing = timing.ok_or_else(|| Error::Internal("a motion that was read has no frames".into()))?;
        Ok(Inputs { motion, timing, meshes, goals })
    }
}

/// The motion, the meshes and the goals, or the errors in all of them.
fn merge_errors<A, B, C>(
    motion: Result<A>,
    meshes: Vec<Result<B>>,
    goals: Vec<Result<C>>,
) -> Result<(A, Vec<B>, Vec<C>)> {
    let mut diagnostics = Vec::new();
    let motion = match motion {
        Err(Error::BadInput(found)) => {
            diagnostics.extend(found);
            None
        }
        other => Some(other?),
    };
    let meshes = sound(meshes, &mut diagnostics)?;
    let goals = sound(goals, &mut diagnostics)?;
    match motion {
        Some(motion) if diagnostics.is_empty() => Ok((motion, meshes, goals)),
        _ => Err(Error::BadInput(diagnostics)),
    }
}

/// What could be read; adds the errors of the others to `diagnostics`.
fn sound<T>(all: Vec<Result<T>>, diagnostics: &mut Vec<Diagnostic>) -> Result<Vec<T>> {
    let mut read = Vec::with_capacity(all.len());
    for one in all {
        match one {
            Err(Error::BadInput(found)) => diagnostics.extend(found),
            other => read.push(other?),
        }
    }
    Ok(read)
}

/// The first sample that the track follows.
fn first_sample(pops: &[Pop], action: Pops) -> usize {
    let off = pops.iter().map(|pop| &pop.off).find(|off| off.start == 0 && action == Pops::Bridge);
    off.map_or(0, |off| off.end)
}

fn track_pop(pop: &Pop, timing: &Timing, rate: f64) -> TrackPop {
    let frame = timing.first_sample + pop.sample() as f64 / rate * timing.fps;
    TrackPop { frame: (frame * 100.0).round() / 100.0, samples: pop.off.len() }
}

/// The pose of the joint that corresponds to the head as modelled, in the file's unit and axes; `first` is
/// the first sample that the track follows.
fn rest_pose(options: &TrackOptions, motion: &Motion, first: usize) -> Result<(RestPose, PoseFile)> {
    // The rest pose of a motion capture has nothing to do with a groom.
    let same_asset = options.groom.is_none() || motion.stage.is_some();
    let kind = options.rest.unwrap_or(match (motion.bind, options.pivot) {
        (Some(_), None) if same_asset => RestPose::Bind,
        _ => RestPose::World,
    });
    let pivot = options.pivot.or(options.groom.as_ref().map(|groom| groom.centroid)).unwrap_or_default();
    let pivot = motion.convention.length_out(pivot).into();
    let pose = match (kind, motion.bind) {
        (RestPose::Bind, Some(bind)) => bind,
        (RestPose::Bind, None) => {
            let what = "the motion file has no rest pose";
            let remedy = "use --rest first, or --rest world with --pivot";
            return Err(Diagnostic::new(
                &options.motion.path,
                "rest",
                what,
                "a USD, glTF or BVH file",
                remedy,
            )
            .into());
        }
        (RestPose::World, _) => PoseFile { translation: pivot, rotation_wxyz: [1.0, 0.0, 0.0, 0.0] },
        (RestPose::First, _) => {
            PoseFile { translation: pivot, rotation_wxyz: motion.poses[first].rotation_wxyz }
        }
    };
    Ok((kind, pose))
}

/// Where the rest pose comes from.
fn origin(options: &TrackOptions, motion: &Motion, kind: RestPose) -> Result<Origin> {
    let bind = motion.stage.as_ref().filter(|_| kind == RestPose::Bind);
    Ok(Origin {
        file: relative(&options.motion.path, options.folder())?,
        prim: motion.stage.as_ref().map(|stage| stage.prim.clone()),
        time: None,
        space: bind.map_or(RestSpace::World, |stage| stage.rest.space),
    })
}

/// The curves of the groom, if they are in the stage of the motion.
fn over(options: &TrackOptions, motion: &Motion) -> Result<Option<OverFile>> {
    let prims = motion.stage.as_ref().map(|stage| stage.over.clone()).unwrap_or_default();
    if prims.is_empty() {
        return Ok(None);
    }
    Ok(Some(OverFile {
        file: relative(&options.motion.path, options.folder())?,
        prims,
        metres_per_unit: Some(motion.convention.metres_per_unit),
        up_axis: Some(motion.convention.up),
    }))
}

/// Compares the roots of the groom with the colliders; returns notes of the distances.
///
/// # Errors
/// They cannot be in one space.
fn check_placement(
    options: &TrackOptions,
    groom: &TrackGroom,
    Inputs { motion, timing, meshes, .. }: &Inputs,
    rest: PoseFile,
    origin: &Origin,
) -> Result<Vec<String>> {
    let first = timing.frames[0];
    let sample = (f64::from(first) - timing.first_sample) / timing.fps * motion.rate;
    let now = motion.poses[(sample.round().max(0.0) as usize).min(motion.poses.len() - 1)];
    let pose = |p: PoseFile| motion.convention.pose_in(p.translation.into(), rotation(p.rotation_wxyz));
    let to_rest = pose(rest) * pose(now).inverse();
    let skins: Vec<PlacedMesh> = options
        .colliders
        .iter()
        .zip(meshes)
        .map(|(mesh, (file, read))| {
            let index = (first - timing.first_mesh_frame()) as usize;
            let sequence = (mesh.source != *file).then_some(&read.mesh.vertices);
            let moving = read.samples.get(index).or(sequence);
            let to_rest = |x: &Vector3<f64>| (to_rest * Point3::from(*x)).coords;
            // The roots on a skin go with it.
            let first = moving.filter(|_| !mesh.is_skin).map(|v| v.iter().map(to_rest).collect());
            PlacedMesh { name: &mesh.name, rest: &read.mesh, first }
        })
        .collect();
    let note = |(skin, mesh): (&PlacedMesh, &ColliderMesh)| {
        let vertices = skin.first.as_ref().unwrap_or(&skin.rest.vertices);
        let distances = groom.roots.distances(vertices, &skin.rest.triangles);
        let when = if mesh.is_skin { "at rest".into() } else { format!("in frame {first}") };
        format!("collider {}: {distances} from the roots {when}", skin.name)
    };
    let found = groom.roots.check(&skins);
    let file = &options.motion.path;
    Error::if_any(found.iter().map(|f| f.diagnostic(file, groom.origin.as_ref(), Some(origin))).collect())?;
    Ok(skins.iter().zip(&options.colliders).map(note).collect())
}

/// The body of the head.
fn head(
    options: &TrackOptions,
    motion: &Motion,
    timing: &Timing,
    rest: PoseFile,
    origin: Origin,
) -> BodyFile {
    let Motion { rate, poses, .. } = motion;
    let starts_at_first_frame = timing.first_sample == f64::from(timing.frames[0]);
    let defaults = TrackFile::default();
    BodyFile {
        name: "head".into(),
        track: Some(TrackFile {
            fps: Some(*rate),
            first_frame: (!starts_at_first_frame).then_some(timing.first_sample),
            translation: Some(poses.iter().map(|p| p.translation).collect::<Vec<_>>().into()),
            rotation_wxyz: Some(poses.iter().map(|p| p.rotation_wxyz).collect::<Vec<_>>().into()),
            rest: Some(rest),
            origin: Some(origin),
            smoothing_hz: options.smoothing_hz.unwrap_or(defaults.smoothing_hz),
            pops: options.pops,
            ..defaults
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriMesh;
    use crate::import::formats::usd::goal::MovingCurves;
    use crate::import::plain::Declared;
    use crate::scene::anim::GoalSpace;
    use crate::scene::{Convention, load_anim};

    /// `n` samples at 48 per second of a head that moves 1 cm along x and turns 1.5° about y per sample,
    /// starting at 90°.
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
    fn a_track_keeps_its_motion_rate_and_rest_pose() {
        let folder = tempfile::tempdir().unwrap();
        let pivot = Vector3::new(0.0, 1.4, 0.1);
        let mut options = TrackOptions::new(motion_file(folder.path(), 49), folder.path().join("anim.json"));
        options.pivot = Some(pivot);
        options.smoothing_hz = Some(0.0);
        let Track { anim: file, report, .. } = track(&options).unwrap();
        assert_eq!(file.frames, [1001, 1025]);
        assert!(
            (report.first_rotation - 90.0).abs() < 1e-9 && report.warnings[0].contains("--rest first"),
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

        options.rest = Some(RestPose::First);
        let Track { anim: file, report, .. } = track(&options).unwrap();
        assert_eq!((report.first_rotation, report.warnings.len()), (0.0, 0));
        let anim = write_and_load(&file, folder.path());
        assert!(anim.head_pose(anim.time(1001.0)).rotation.angle() < 1e-6);
        assert!((anim.head_pose(anim.time(1025.0)).rotation.angle().to_degrees() - 72.0).abs() < 1e-3);
    }

    #[test]
    fn a_t_pose_at_the_start_is_said_and_bridged() {
        let folder = tempfile::tempdir().unwrap();
        let motion = motion_file(folder.path(), 49);
        let text = std::fs::read_to_string(&motion.path).unwrap();
        let mut file: serde_json::Value = serde_json::from_str(&text).unwrap();
        file["frames"][0] = serde_json::json!({ "translation": [0.0, 170.0, 80.0], "rotation_quat_wxyz": [1.0, 0.0, 0.0, 0.0] });
        std::fs::write(&motion.path, file.to_string()).unwrap();

        let mut options = TrackOptions::new(motion, folder.path().join("anim.json"));
        let Track { anim, report, .. } = track(&options).unwrap();
        assert_eq!(report.pops, [TrackPop { frame: 1001.0, samples: 1 }]);
        assert!(report.to_string().contains("at frame 1001") && report.to_string().contains("--pops bridge"));
        let path = folder.path().join("anim.json");
        anim.write(&path).unwrap();
        assert!(load_anim(&path).is_err());

        options.pops = Pops::Bridge;
        let Track { anim, report, .. } = track(&options).unwrap();
        assert!(report.notes.iter().any(|note| note.contains("interpolates")), "{report}");
        // The first sample that counts is turned by 91.5°.
        assert!((report.first_rotation - 91.5).abs() < 1e-6);
        let anim = write_and_load(&anim, folder.path());
        let first = anim.head_pose(anim.time(1001.0));
        assert!((first.translation.vector - Vector3::new(0.0, 1.5, 0.0)).norm() < 0.02, "{first}");
        assert!((first.rotation.angle().to_degrees() - 90.0).abs() < 2.0, "{first}");
    }

    #[test]
    fn colliders_keep_their_own_unit() {
        let folder = tempfile::tempdir().unwrap();
        let shelf = folder.path().join("meshes");
        std::fs::create_dir(&shelf).unwrap();
        std::fs::write(shelf.join("7 head.obj"), "v 0 0 0\nv 200 0 0\nv 0 300 0\nf 1 2 3\n").unwrap();
        let mut options =
            TrackOptions::new(motion_file(folder.path(), 9), folder.path().join("shots/a/anim.json"));
        std::fs::create_dir_all(options.folder()).unwrap();
        options.colliders = vec![ColliderMesh::new(Source::new(shelf.join("7 head.obj")))];
        let Track { anim: file, report, .. } = track(&options).unwrap();
        assert!(report.notes[0].contains("millimetres"), "{report}");
        let anim = write_and_load(&file, options.folder());
        assert_eq!(anim.colliders[0].name, "mesh_7_head");
        let crate::geometry::Shape::Mesh(mesh) = &anim.colliders[0].shape else { panic!("not a mesh") };
        assert!((mesh.vertices[2].y - 0.3).abs() < 1e-6);
    }

    #[test]
    fn a_mesh_that_is_named_as_the_file_of_a_goal_has_files_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let options = TrackOptions::new(motion_file(folder.path(), 9), folder.path().join("anim.json"));
        let timing = Inputs::read(&options).unwrap().timing;
        let vertices = vec![Vector3::zeros(), Vector3::x(), Vector3::y()];
        let read = ImportedMesh {
            mesh: TriMesh { vertices: vertices.clone(), triangles: vec![[0, 1, 2]] },
            samples: vec![vertices.clone(); 5],
            convention: Convention::default(),
            notes: Vec::new(),
        };
        let shot = |prim: &str| Source { prim: Some(prim.into()), ..Source::new("shot.usda") };
        let mesh = ColliderMesh::new(shot("/goal_tail"));
        let mut colliders = Colliders::default();
        colliders.add(&mesh, &mesh.source, &read, timing.first_mesh_frame(), &options).unwrap();
        let curves = MovingCurves {
            counts: vec![3],
            ids: None,
            samples: vec![vertices; 5],
            span: vec![[f64::NEG_INFINITY, f64::INFINITY]],
            rate: 24.0,
            declared: Declared { metres_per_unit: Some(1.0), ..Declared::default() },
            notes: Vec::new(),
        };
        let input = GoalInput::Stage { read: curves, rate: 24.0, codes_per_frame: 1.0 };
        let goal = GoalCurvesSource::new(shot("/tail"), GoalSpace::World);
        let mut goals = Goals::beside(&colliders);
        goals.add(&goal, input, &timing, &options).unwrap();
        assert_eq!((mesh.name.as_str(), goals.goals[0].name.as_str()), ("goal_tail", "tail"));
        assert_eq!(goals.goals[0].sequence, "anim.goal_tail_2.####.obj");
        let files = colliders.files.iter().chain(&goals.files).map(|(path, _)| path);
        assert_eq!(files.collect::<std::collections::BTreeSet<_>>().len(), 1 + 5 + 5);
    }

    #[test]
    fn a_mesh_sequence_deforms_in_the_world() {
        let folder = tempfile::tempdir().unwrap();
        for frame in 1001..=1005 {
            let text = format!("v 0 {} 0\nv 200 0 0\nv 0 300 0\nf 1 2 3\n", frame - 1000);
            std::fs::write(folder.path().join(format!("silk_shirt.{frame}.obj")), text).unwrap();
        }
        let mut options = TrackOptions::new(motion_file(folder.path(), 9), folder.path().join("anim.json"));
        options.colliders = vec![ColliderMesh::new(Source::new(folder.path().join("silk_shirt.####.obj")))];
        let file = track(&options).unwrap().anim;
        let anim = write_and_load(&file, options.folder());
        let collider = &anim.colliders[0];
        assert_eq!(
            (collider.name.as_str(), anim.bodies[collider.body].name.as_str()),
            ("silk_shirt", "world")
        );
        let deformation = collider.deformation.as_ref().unwrap();
        assert!((deformation.vertices(anim.time(1003.0))[0].y - 0.003).abs() < 1e-9);
        options.frames = Some([1006, 1007]);
        let Err(Error::BadInput(diagnostics)) = track(&options) else { panic!("accepted") };
        assert!(diagnostics[0].file.ends_with("silk_shirt.1006.obj"), "{:?}", diagnostics[0]);
    }

    #[test]
    fn errors_of_all_files_are_in_one_report() {
        let folder = tempfile::tempdir().unwrap();
        let motion = folder.path().join("walk.json");
        std::fs::write(&motion, r#"{ "fps": -1.0, "frames": [] }"#).unwrap();
        let mut options = TrackOptions::new(Source::new(&motion), folder.path().join("anim.json"));
        options.colliders = vec![ColliderMesh::new(Source::new(folder.path().join("no.obj")))];
        let Err(Error::BadInput(diagnostics)) = track(&options) else { panic!("accepted") };
        let files: Vec<_> =
            diagnostics.iter().map(|p| p.file.file_name().unwrap().to_string_lossy()).collect();
        assert_eq!(files, ["walk.json", "walk.json", "no.obj"]);

        let mut options = TrackOptions::new(motion_file(folder.path(), 9), folder.path().join("anim.json"));
        options.frames = Some([1, 9]);
        let Err(Error::BadInput(diagnostics)) = track(&options) else { panic!("accepted") };
        assert!(diagnostics[0].allowed.contains("1 to 5"), "{:?}", diagnostics[0]);
    }
}
