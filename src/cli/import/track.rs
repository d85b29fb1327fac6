//! `hairbake import track`.

use crate::cli::frame_list::frame_range;
use crate::cli::{console, input_files, output_file, values};
use crate::error::Result;
use crate::import::{
    self, ColliderMesh, GoalCurvesSource, JointSelector, RestPose, Source, TrackGroom, TrackOptions,
};
use crate::scene::anim::GoalSpace;
use crate::scene::anim::file::Pops;
use crate::scene::{UpAxis, load_groom};
use clap::{Args, ValueEnum};
use nalgebra::Vector3;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  hairbake import track walk.json --groom groom.json --collider bust.obj:cm -o anim.json
  hairbake import track walk.json --groom groom.json --collider shirt.####.obj -o anim.json
  hairbake import track shot.usd --joint head --groom groom.json --collider shot.usd:/char/body -o anim.json
  hairbake import track shot.usd --joint head --groom fur.json --skin shot.usd:/char/body -o anim.json
  hairbake import track shot.usd --joint head --groom groom.json --goal approved/hair.usda -o anim.json
  hairbake import track walk.bvh --joint Head --units in --groom groom.json -o anim.json
  hairbake import track mocap.json --pivot 0,1.62,0.02 --fps 24 --rest first -o anim.json";

const MOTION: &str = "Motion";
const TIME: &str = "Time";
const REST: &str = "Rest pose";
const COLLIDERS: &str = "Colliders";
const GOALS: &str = "Goals";

/// `hairbake import track` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct TrackArguments {
    /// Motion file: USD, BVH, glTF (.gltf, .glb) or JSON
    ///
    /// JSON: { fps, units, up_axis, frames: [{ translation, rotation_quat_wxyz }] }
    motion: PathBuf,
    /// Animation file to write; USD and glTF meshes and curves are written next to it, named after it
    ///
    /// With -o shot.json they are shot.NAME.obj and shot.NAME.####.obj: several shots may share a folder.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,

    /// Joint to follow: a BVH or USD skeleton joint or a glTF node, by name; in USD also by its path or the
    /// end of it, as in /world/hero/rig/spine/head
    #[arg(long, value_name = "NAME", help_heading = MOTION)]
    joint: Option<String>,
    /// glTF animation, by name or number [default: the first]
    #[arg(long, value_name = "NAME", help_heading = MOTION)]
    clip: Option<String>,
    /// USD prim to follow, or the skeleton of --joint [default: the only prim that moves]
    #[arg(long, value_name = "PATH", value_parser = values::prim, help_heading = MOTION)]
    prim: Option<String>,
    /// Unit of the motion: m, cm, mm, in, ft or metres per unit [default: from the file; m for glTF, cm for
    /// BVH]
    #[arg(long, value_name = "UNIT", value_parser = values::units, help_heading = MOTION)]
    units: Option<f64>,
    /// Up axis of the motion, y or z [default: from the file, else y]
    #[arg(long, value_name = "AXIS", value_parser = values::up_axis, help_heading = MOTION)]
    up: Option<UpAxis>,

    /// Frames per second of the bake [default: time codes per second in USD, else 24]
    ///
    /// May differ from the rate of the motion. A higher rate takes shorter solver steps and writes more
    /// frames.
    #[arg(long, value_name = "FPS", value_parser = values::positive, help_heading = TIME)]
    fps: Option<f64>,
    /// Frames of the bake, such as 1001-1240 [default: those of the USD stage, else 1001 to the end of the
    /// motion]
    ///
    /// The motion starts at the first frame, except in USD, where time codes are frames.
    #[arg(long, value_name = "A-B", value_parser = frame_range, allow_hyphen_values = true, help_heading = TIME)]
    frames: Option<(i32, i32)>,
    /// Cutoff frequency of the low-pass filter on the motion, in Hz; 0 for no filter [default: 12]
    ///
    /// Lowering it removes more noise and rounds off sharp turns.
    #[arg(long, value_name = "HZ", alias = "smoothing", value_parser = values::not_negative, help_heading = TIME)]
    cutoff: Option<f64>,
    /// What a bake does with samples that jump as no head can move, such as a T-pose at the start
    #[arg(long, value_enum, value_name = "ACTION", default_value = "error", help_heading = TIME)]
    pops: PopsName,

    /// Position of the joint in the modelled head, in metres, Y up [default: centre of the roots of --groom,
    /// else 0,0,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, help_heading = REST)]
    pivot: Option<Vector3<f64>>,
    /// Groom that the head carries: its roots are compared with the colliders
    ///
    /// If it comes from a USD stage, the rest pose is that of the head there. For other motions its roots
    /// give the pivot.
    #[arg(long, value_name = "FILE", help_heading = REST)]
    groom: Option<PathBuf>,
    /// Orientation of the joint in the modelled head [default: bind if the file has one and neither --pivot
    /// nor, outside USD, --groom is given; else world]
    #[arg(long, value_enum, value_name = "POSE", help_heading = REST)]
    rest: Option<RestName>,

    /// Mesh that the hair collides with, OBJ, USD or glTF; may be repeated
    ///
    /// The head carries the mesh. A deforming mesh stays in world space: a USD or glTF mesh with its own
    /// motion, or a sequence with one file per frame such as cloth.####.obj. Holes, such as a neck, are
    /// closed.
    #[arg(long = "collider", value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source, help_heading = COLLIDERS)]
    colliders: Vec<Source>,
    /// Mesh that the roots of the groom grow on, and that the hair collides with; may be repeated
    ///
    /// As --collider. Each root rides on the place of the skins that is nearest to it at rest, wherever the
    /// mesh deforms: brows, beards, fur. The head is then a frame of reference near the hair; a joint that
    /// carries most of it is best.
    #[arg(long = "skin", value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source, help_heading = COLLIDERS)]
    skins: Vec<Source>,
    /// Coulomb friction coefficient of the colliders [default: that of the strands]
    ///
    /// Raising it holds the hair on the colliders longer.
    #[arg(long, value_name = "MU", value_parser = values::not_negative, help_heading = COLLIDERS)]
    friction: Option<f64>,
    /// Distance between colliders and strands, in mm
    ///
    /// Raising it hides gaps of coarse render meshes.
    #[arg(long, value_name = "MM", default_value_t = 0.5, value_parser = values::not_negative, help_heading = COLLIDERS)]
    thickness: f64,

    /// Animated curves that guides are pulled to; may be repeated
    ///
    /// USD curves with time samples, such as those of an animator or hair.usda of an earlier bake, or a
    /// sequence of OBJ files, one per frame, such as tail.####.obj. The guides among them count if there are
    /// any. Curves belong to the guides of --groom with their ids, or, without ids, in order. How firmly they
    /// pull is set in the animation: see `goals` there.
    #[arg(long = "goal", value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source, help_heading = GOALS)]
    goals: Vec<Source>,
    /// Space of the curves
    #[arg(long, value_enum, value_name = "SPACE", default_value = "world", help_heading = GOALS)]
    goal_space: GoalSpaceName,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum GoalSpaceName {
    /// The world
    World,
    /// The space of the groom at rest: the head or the skin carries the curves
    Rest,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PopsName {
    /// Refuses the animation
    Error,
    /// Replaces them by interpolation, unless the jump lasts
    Bridge,
    /// Follows them
    Keep,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum RestName {
    /// Bind pose of the file
    Bind,
    /// Axes of the world
    World,
    /// First sample, for rigs whose joints have their own axes
    First,
}

/// Imports a track.
pub fn run(arguments: &TrackArguments) -> Result<()> {
    let output = &arguments.output;
    let meshes = arguments.skins.iter().chain(&arguments.colliders).chain(&arguments.goals);
    let others = arguments.groom.iter().chain(meshes.map(|source| &source.path));
    input_files::require(std::iter::once(&arguments.motion).chain(others).map(|path| &**path))?;
    let groom = match &arguments.groom {
        Some(file) => Some(TrackGroom::new(&load_groom(file)?, output_file::folder(file))),
        None => None,
    };
    let track = import::track(&TrackOptions { groom, ..arguments.options() })?;
    output_file::create_folder(output)?;
    track.write(output)?;
    console::say(track.report.to_string().trim_end());
    console::wrote(output);
    Ok(())
}

impl TrackArguments {
    fn options(&self) -> TrackOptions {
        let motion = Source {
            metres_per_unit: self.units,
            up: self.up,
            prim: self.prim.clone(),
            ..Source::new(&self.motion)
        };
        let mesh = |(source, is_skin): (&Source, bool)| ColliderMesh {
            friction: self.friction,
            thickness: self.thickness * 1e-3,
            is_skin,
            ..ColliderMesh::new(source.clone())
        };
        let space = match self.goal_space {
            GoalSpaceName::World => GoalSpace::World,
            GoalSpaceName::Rest => GoalSpace::Rest,
        };
        let skins = self.skins.iter().map(|source| (source, true));
        let colliders = self.colliders.iter().map(|source| (source, false));
        TrackOptions {
            fps: self.fps,
            frames: self.frames.map(<[i32; 2]>::from),
            pivot: self.pivot,
            rest: self.rest.map(|rest| match rest {
                RestName::Bind => RestPose::Bind,
                RestName::World => RestPose::World,
                RestName::First => RestPose::First,
            }),
            joint: JointSelector { name: self.joint.clone(), clip: self.clip.clone() },
            colliders: skins.chain(colliders).map(mesh).collect(),
            goals: self.goals.iter().map(|source| GoalCurvesSource::new(source.clone(), space)).collect(),
            smoothing_hz: self.cutoff,
            pops: match self.pops {
                PopsName::Error => Pops::Error,
                PopsName::Bridge => Pops::Bridge,
                PopsName::Keep => Pops::Keep,
            },
            ..TrackOptions::new(motion, &self.output)
        }
    }
}
