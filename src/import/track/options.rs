//! What to import as an animation.

use crate::import::joint_selector::JointSelector;
use crate::import::motion::GroomCurves;
use crate::import::source::Source;
use crate::scene::anim::GoalSpace;
use crate::scene::anim::file::Pops;
use crate::scene::placement::Roots;
use crate::scene::{FileSequence, Groom, Origin, RestSpace};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// Default distance kept between a collider and the strands, m.
const DEFAULT_THICKNESS: f64 = 5e-4;

/// Which pose of the joint corresponds to the head as modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RestPose {
    /// The file's own rest pose: of a USD prim its pose outside of time, of a skeleton joint its bind pose,
    /// of a BVH the pose without rotations. Position and orientation; the pivot is not used.
    Bind,
    /// At the pivot, aligned with the world axes.
    World,
    /// At the pivot, oriented as in the first sample, for rigs whose joint axes are arbitrary. The head
    /// starts as modelled.
    First,
}

/// A mesh that the hair collides with: carried by the head, or deforming in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct ColliderMesh {
    /// Unique name of letters, digits and `_` that does not start with a digit.
    pub name: String,
    /// The file, or one file per frame if the name has a `#` for each digit of the frame number
    /// (`cloth.####.obj`). The offset must be zero.
    pub source: Source,
    /// Coulomb friction coefficient; `None` for that of the strands.
    pub friction: Option<f64>,
    /// Distance kept between the mesh and the strands, m.
    pub thickness: f64,
    /// Whether the roots of the groom grow on it.
    pub is_skin: bool,
}

/// Animated curves that guides are pulled to.
#[derive(Debug, Clone, PartialEq)]
pub struct GoalCurvesSource {
    /// Unique name, as of a mesh.
    pub name: String,
    /// The USD file, or a sequence of OBJ files, one per frame.
    pub source: Source,
    /// The space of the curves.
    pub space: GoalSpace,
}

impl GoalCurvesSource {
    /// Curves named after their prim or file.
    pub fn new(source: Source, space: GoalSpace) -> Self {
        GoalCurvesSource { name: name_of(&source, "goal_"), source, space }
    }
}

/// A name of letters, digits and `_` after the prim or file of `source`; `prefix` is put before a digit.
fn name_of(source: &Source, prefix: &str) -> String {
    let prim = source.prim.as_deref().and_then(|prim| prim.rsplit('/').next()).map(String::from);
    let stem = source.path.file_stem().map(|s| s.to_string_lossy().replace('#', ""));
    let stem = prim.or(stem).unwrap_or_default();
    let stem = stem.trim_end_matches(['.', '_', '-']);
    let mut name: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name.insert_str(0, prefix);
    }
    name
}

impl ColliderMesh {
    /// A mesh named after its prim or file.
    pub fn new(source: Source) -> Self {
        let name = name_of(&source, "mesh_");
        ColliderMesh { name, source, friction: None, thickness: DEFAULT_THICKNESS, is_skin: false }
    }

    /// The file to read first: of a sequence, that of frame `first`.
    pub(super) fn first_file(&self, first: i32) -> Source {
        let path = self.source.path.to_string_lossy();
        match FileSequence::new(&path) {
            Some(sequence) => Source { path: sequence.path(Path::new(""), first), ..self.source.clone() },
            None => self.source.clone(),
        }
    }
}

/// What a track needs of the groom that its head carries.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackGroom {
    /// Mean root position of the guides, m, rest space.
    pub(super) centroid: Vector3<f64>,
    pub(super) roots: Roots,
    pub(super) origin: Option<Origin>,
    /// Ids of the guides.
    pub(super) ids: Vec<i32>,
    /// The USD curves that it comes from.
    pub(super) curves: Option<GroomCurves>,
    /// Folder of the groom file, from which the path of its origin starts.
    folder: PathBuf,
}

impl TrackGroom {
    /// Of a groom read from a file in `folder`.
    pub fn new(groom: &Groom, folder: &Path) -> Self {
        let all = &groom.guides.curves;
        let centroid = all.roots().sum::<Vector3<f64>>() / all.len().max(1) as f64;
        let curves = groom.source.as_ref().map(|source| GroomCurves {
            stage: folder.join(&source.origin.file),
            prims: source.prims.iter().map(|prim| prim.path.clone()).collect(),
        });
        let folder = folder.to_path_buf();
        let (roots, origin, ids) = (Roots::of(groom), groom.origin.clone(), all.id.clone());
        TrackGroom { centroid, roots, origin, ids, curves, folder }
    }

    /// The USD stage whose world at rest is the groom's rest space; `None` if that is another space, or if
    /// the stage no longer exists.
    pub(super) fn rest_stage(&self) -> Option<PathBuf> {
        let origin = self.origin.as_ref().filter(|origin| origin.space == RestSpace::World)?;
        let stage = Source::new(self.folder.join(&origin.file));
        (stage.is_usd() && stage.path.is_file()).then_some(stage.path)
    }
}

/// What [`track`](super::convert::track) imports.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackOptions {
    /// The motion file: our JSON, BVH, glTF or USD.
    pub motion: Source,
    /// The joint in it.
    pub joint: JointSelector,
    /// The animation file that will be written. Paths of meshes are relative to its folder, and the names of
    /// those that are written there begin with its name.
    pub output: PathBuf,
    /// Frames per second of the bake; `None` for the rate at which the file numbers its frames, or 24.
    pub fps: Option<f64>,
    /// First and last frame; `None` for the frames of the file, or 1001 to the end of the motion if it
    /// numbers none.
    pub frames: Option<[i32; 2]>,
    /// The groom that the head carries, if it is known.
    pub groom: Option<TrackGroom>,
    /// Position of the joint in the head as modelled, m, Y up, rest space; `None` for the centre of the roots
    /// of `groom`, or the origin.
    pub pivot: Option<Vector3<f64>>,
    /// Pose of the head as modelled; `None` for [`RestPose::Bind`] if the file has a rest pose, no pivot is
    /// given, and the groom, if it is known, may come from the same asset (USD); else [`RestPose::World`].
    pub rest: Option<RestPose>,
    /// Meshes that the hair collides with.
    pub colliders: Vec<ColliderMesh>,
    /// Animated curves that guides are pulled to.
    pub goals: Vec<GoalCurvesSource>,
    /// Cutoff frequency of the smoothing filter, Hz; `None` for the default of the format, 0 for no filter.
    pub smoothing_hz: Option<f64>,
    /// How a bake handles one-frame pops.
    pub pops: Pops,
}

impl TrackOptions {
    /// The defaults for a motion file and the animation file to write: no collider, no pivot.
    pub fn new(motion: Source, output: impl Into<PathBuf>) -> Self {
        TrackOptions {
            motion,
            joint: JointSelector::default(),
            output: output.into(),
            fps: None,
            frames: None,
            groom: None,
            pivot: None,
            rest: None,
            colliders: Vec::new(),
            goals: Vec::new(),
            smoothing_hz: None,
            pops: Pops::Error,
        }
    }

    /// The folder in which the animation will be written.
    pub fn folder(&self) -> &Path {
        self.output.parent().unwrap_or(Path::new(""))
    }

    /// The name `name` of a file that is written next to the animation, after the animation's own: several
    /// shots may share a folder.
    pub(super) fn name_beside(&self, name: &str) -> String {
        let own = self.output.file_name().unwrap_or_default().to_string_lossy();
        let own = own.strip_suffix(".json").unwrap_or(&own);
        // A `#` stands for a digit of the frame number in the name of a sequence.
        format!("{}.{name}", own.replace('#', "_"))
    }
}
