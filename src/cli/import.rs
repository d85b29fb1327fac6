//! `hairbake import`: grooms and tracks of other programs.

use super::{console, values};
use crate::error::{Error, Result};
use crate::import::{
    self, BuildOptions, ColliderMesh, GroomOptions, Growth, HierarchyShape, JointSelector, Resample,
    RestPose, Source, TrackOptions,
};
use crate::scene::anim::file::Pops;
use crate::scene::{Material, RodSection, UpAxis, load_groom};
use clap::{Args, Subcommand, ValueEnum};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

const GROOM_EXAMPLES: &str = "\
Examples:
  hairbake import groom guides.tfx --head bust.obj:cm -o shot/groom.json
  hairbake import groom guides_cm.tfx --strands full_m.tfx:m --head bust_m.obj:m -o shot/groom.json
  hairbake import groom asset.usd --prim /char/groom --head asset.usd:/char/body -o shot/groom.json
  hairbake import groom straight.hair --guides 300 --levels 3 --diameter 90 -o shot/groom.json";

const TRACK_EXAMPLES: &str = "\
Examples:
  hairbake import track walk.json --groom shot/groom.json --collider bust.obj:cm -o shot/anim.json
  hairbake import track walk.json --groom shot/groom.json --collider bust.obj:cm --collider shirt.####.obj -o shot/anim.json
  hairbake import track shot.usd --prim /char/head --collider shot.usd:/char/body -o shot/anim.json
  hairbake import track walk.bvh --joint Head --units in --groom shot/groom.json -o shot/anim.json
  hairbake import track mocap.json --pivot 0,1.62,0.02 --fps 24 --frames 1001-1240 --rest first -o shot/anim.json";

#[derive(Debug, Subcommand)]
pub enum Import {
    /// Make groom.json of strands: USD basis curves, TressFX .tfx or Cem Yuksel .hair
    Groom(Box<GroomArguments>),
    /// Make anim.json of a head track and the meshes that the hair collides with
    Track(Box<TrackArguments>),
}

#[derive(Debug, Args)]
#[command(after_help = GROOM_EXAMPLES)]
pub struct GroomArguments {
    /// Strands: guides are taken from them; where there are more than guides, they are the render strands too. USD may name its
    /// guides: curves of purpose guide, or with primvars:groom_guide
    strands: PathBuf,
    /// File to write; long arrays go into a .bin beside it
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Name of the groom [default: that of the file]
    #[arg(long)]
    name: Option<String>,

    /// Path of the prim of a USD file at and below which strands are [default: the whole stage]
    #[arg(long, value_name = "PATH", value_parser = prim, help_heading = "USD")]
    prim: Option<String>,
    /// Time code at which curves of a USD file that move are taken [default: their rest pose, else the earliest]
    #[arg(long, value_name = "CODE", allow_hyphen_values = true, help_heading = "USD")]
    time: Option<f64>,

    /// Unit of the strands: m, cm, mm, in, ft or metres in a unit [default: as the file says, else guessed from their size]
    #[arg(long, value_parser = values::units, help_heading = "Space")]
    units: Option<f64>,
    /// Axis of the strands that points up, y or z [default: as the file says, else z for .hair and y for others]
    #[arg(long, value_name = "AXIS", value_parser = values::up_axis, help_heading = "Space")]
    up: Option<UpAxis>,
    /// Moves all strands to where the head was modelled, m, Y up
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = values::vector, allow_hyphen_values = true, hide_default_value = true, help_heading = "Space")]
    offset: Vector3<f64>,
    /// Head mesh (OBJ) that the hair grows on: tells where the roots lie, and roots grown strands on it
    #[arg(long, value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source, help_heading = "Space")]
    head: Option<Source>,

    /// Render strands from a file of their own
    #[arg(long = "strands", value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source, help_heading = "Strands")]
    render: Option<Source>,
    /// Guides to simulate, chosen evenly: more is truer and slower [default: those that the file names, else all of 1000 or fewer, 500
    /// of more]
    #[arg(long, value_name = "N", value_parser = count(1, 100_000), help_heading = "Strands")]
    guides: Option<u32>,
    /// Vertices a guide is resampled to: more follows tighter curls
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = count(2, 4096), help_heading = "Strands")]
    guide_vertices: u32,
    /// Vertices a render strand is resampled to [default: as in the file; 16 where they are grown]
    #[arg(long, value_name = "N", value_parser = count(2, 4096), help_heading = "Strands")]
    strand_vertices: Option<u32>,
    /// Strands grown round each guide where the file holds guides only; 0 for none
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = count(0, 100_000), help_heading = "Strands")]
    per_guide: u32,
    /// Most that a grown strand is shorter than its guide, share: more frays the ends
    #[arg(long, value_name = "SHARE", default_value_t = 0.08, value_parser = values::share, help_heading = "Strands")]
    shorter: f64,
    /// Factor on the length of all strands, which keep their shape
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = values::positive, help_heading = "Strands")]
    length_scale: f64,
    /// How far grown strands close in on their guide towards the tip, share: 1 is a pointed lock
    #[arg(long, value_name = "SHARE", default_value_t = 0.4, value_parser = values::share, help_heading = "Strands")]
    clump: f64,
    /// Drawn width at root and tip, mm [default: covers the head as 100,000 hairs would]
    #[arg(long, value_name = "ROOT,TIP", value_parser = widths, help_heading = "Strands")]
    width: Option<[f64; 2]>,

    /// Levels of the wisp hierarchy: 1 is leaf wisps alone
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count(1, 8), help_heading = "Hierarchy")]
    levels: u32,
    /// Wisps on the coarse level [default: a branching of about five]
    #[arg(long, value_name = "N", value_parser = count(1, 100_000), help_heading = "Hierarchy")]
    coarse: Option<u32>,
    /// Leaf wisps; none holds more than three guides [default: half as many as guides]
    #[arg(long, value_name = "N", value_parser = count(1, 100_000), help_heading = "Hierarchy")]
    leaves: Option<u32>,
    /// Sections of a wisp, which are its guides' strain nodes: more bends finer and costs more
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = count(2, 64), help_heading = "Hierarchy")]
    sections: u32,

    #[command(flatten)]
    material: MaterialArguments,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Material (defaults: human scalp hair)")]
struct MaterialArguments {
    /// Young's modulus, GPa: resistance to bending
    #[arg(long, value_name = "GPA", value_parser = values::positive)]
    young: Option<f64>,
    /// Shear modulus, GPa: resistance to twist
    #[arg(long, value_name = "GPA", value_parser = values::positive)]
    shear: Option<f64>,
    /// Density, kg/m³: heavier hair hangs more
    #[arg(long, value_name = "KG/M3", value_parser = values::positive)]
    density: Option<f64>,
    /// Diameter of a hair, µm: stiffness grows with its fourth power, weight with its square
    #[arg(long, value_name = "UM", value_parser = values::positive)]
    diameter: Option<f64>,
    /// Internal damping time, s: more calms bounce sooner
    #[arg(long, value_name = "S", value_parser = values::not_negative)]
    damping: Option<f64>,
    /// Coulomb friction coefficient against the body
    #[arg(long, value_name = "MU", value_parser = values::not_negative)]
    friction: Option<f64>,
    /// Factor on the drag of the air; 0 for none
    #[arg(long, value_name = "X", value_parser = values::not_negative)]
    drag: Option<f64>,
    /// Share of gravity that the shape balances: 1 keeps the groom's shape at rest, made stiffer where it must be; 0 lets it sag
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = values::share)]
    sag_free: f64,
}

#[derive(Debug, Args)]
#[command(after_help = TRACK_EXAMPLES)]
pub struct TrackArguments {
    /// Motion: USD, BVH, glTF (.gltf, .glb), or .json { fps, units, up_axis, frames: [{ translation, rotation_quat_wxyz }] }
    motion: PathBuf,
    /// File to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,

    /// Joint whose motion it is: a joint of a BVH or of a USD skeleton, a node of a glTF; by its name, in USD also by its path
    #[arg(long, value_name = "NAME", help_heading = "Joint")]
    joint: Option<String>,
    /// Animation of a glTF, by name or number [default: the first]
    #[arg(long, value_name = "NAME", help_heading = "Joint")]
    clip: Option<String>,
    /// Path of the prim of a USD file that the head goes with, or of the skeleton of --joint [default: the only one that moves]
    #[arg(long, value_name = "PATH", value_parser = prim, help_heading = "Joint")]
    prim: Option<String>,
    /// Unit of the motion: m, cm, mm, in, ft or metres in a unit [default: as the file says; m for glTF, cm for BVH]
    #[arg(long, value_parser = values::units, help_heading = "Joint")]
    units: Option<f64>,
    /// Axis of the motion that points up, y or z [default: as the file says, else y]
    #[arg(long, value_name = "AXIS", value_parser = values::up_axis, help_heading = "Joint")]
    up: Option<UpAxis>,

    /// Frames a second of the bake; the track's own rate may differ [default: the time codes a second of USD, else 24]
    #[arg(long, value_parser = values::positive, help_heading = "Time")]
    fps: Option<f64>,
    /// Frames of the bake; the track's first sample lies on the first, but where USD numbers it [default: those of USD, else 1001 to
    /// the end of the track]
    #[arg(long, value_name = "A-B", value_parser = values::frames, allow_hyphen_values = true, help_heading = "Time")]
    frames: Option<(i32, i32)>,
    /// Frequency above which motion is noise and filtered out, Hz: lower is smoother and lags at sharp turns; 0 is off
    /// [default: 12]
    #[arg(long, value_name = "HZ", value_parser = values::not_negative, help_heading = "Time")]
    smoothing: Option<f64>,
    /// What a bake is to do with samples far from their neighbours: refuse them, go past them, or take them as they are
    #[arg(long, value_enum, value_name = "HOW", default_value = "error", help_heading = "Time")]
    pops: PopsName,

    /// Where the joint is in the head as modelled, m, Y up [default: the middle of the groom's roots, else 0,0,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, help_heading = "Rest pose")]
    pivot: Option<Vector3<f64>>,
    /// Groom whose roots give the pivot
    #[arg(long, value_name = "FILE", conflicts_with = "pivot", help_heading = "Rest pose")]
    groom: Option<PathBuf>,
    /// Which pose of the joint is that of the head as modelled [default: bind where the file has one and no pivot is given, else world]
    #[arg(long, value_enum, value_name = "WHICH", help_heading = "Rest pose")]
    rest: Option<RestName>,

    /// Mesh (OBJ or USD) that the head carries and the hair collides with; or that deforms in the world: one of USD that moves by itself, or
    /// cloth.####.obj, a file for each frame. May be given more than once. Meshes of USD are written beside the animation
    #[arg(long = "collider", value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source, help_heading = "Colliders")]
    colliders: Vec<Source>,
    /// Coulomb friction coefficient of the colliders [default: the strands' own]
    #[arg(long, value_name = "MU", value_parser = values::not_negative, help_heading = "Colliders")]
    friction: Option<f64>,
    /// Distance kept between colliders and strands, mm: more hides coarse render meshes
    #[arg(long, value_name = "MM", default_value_t = 0.5, value_parser = values::not_negative, help_heading = "Colliders")]
    thickness: f64,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PopsName {
    /// They are errors
    Error,
    /// They are replaced from their neighbours
    Bridge,
    /// They are followed
    Keep,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum RestName {
    /// The file's own: where the joint was bound, or is outside of time
    Bind,
    /// None: along the world's axes
    World,
    /// That of the first sample, for rigs whose joints have axes of their own
    First,
}

fn count(least: i64, most: i64) -> impl clap::builder::TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(least..=most)
}

/// The path of a prim.
fn prim(text: &str) -> std::result::Result<String, String> {
    text.starts_with('/')
        .then(|| text.into())
        .ok_or_else(|| "a path from the root, such as /groom/hair".into())
}

/// Two widths in millimetres, as metres.
fn widths(text: &str) -> std::result::Result<[f64; 2], String> {
    let (root, tip) = text.split_once(',').ok_or("two numbers, such as 0.2,0.05")?;
    Ok([values::positive(root)? * 1e-3, values::not_negative(tip)? * 1e-3])
}

/// Imports what is asked for.
pub fn run(what: Import) -> Result<()> {
    match what {
        Import::Groom(arguments) => groom(*arguments),
        Import::Track(arguments) => track(&arguments),
    }
}

fn groom(arguments: GroomArguments) -> Result<()> {
    let output = arguments.output.clone();
    let head = arguments.head.as_ref().map(import::read_mesh).transpose();
    let (mut options, head) = (arguments.resolve(), head?);
    if let Some(head) = head {
        say_all(&head.notes);
        options.scalp = Some(head.mesh);
    }
    let (groom, report) = import::groom(&options)?;
    make_folder_of(&output)?;
    groom.write(&output)?;
    console::say(&format!("{}\nwritten: {}", report.to_string().trim_end(), output.display()));
    Ok(())
}

fn track(arguments: &TrackArguments) -> Result<()> {
    let output = &arguments.output;
    let pivot = match (&arguments.groom, arguments.pivot) {
        (Some(groom), _) => Some(import::root_centroid(&load_groom(groom)?)),
        (None, pivot) => pivot,
    };
    let track = import::track(&arguments.resolve(pivot))?;
    make_folder_of(output)?;
    track.write(output)?;
    console::say(&format!("{}\nwritten: {}", track.report.to_string().trim_end(), output.display()));
    Ok(())
}

fn say_all(notes: &[String]) {
    notes.iter().for_each(|note| console::say(note));
}

fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn make_folder_of(file: &Path) -> Result<()> {
    let folder = folder_of(file);
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))
}

impl GroomArguments {
    fn resolve(self) -> GroomOptions {
        let place = |source: Source| Source { offset: self.offset, ..source };
        let guides = Source {
            metres_per_unit: self.units,
            up: self.up,
            prim: self.prim,
            time: self.time,
            ..Source::new(self.strands)
        };
        let usual = GroomOptions::new(place(guides));
        let growth = Growth::default();
        GroomOptions {
            name: self.name.unwrap_or(usual.name),
            guides: usual.guides,
            strands: self.render.map(place),
            scalp: None,
            length_scale: self.length_scale,
            guide_count: self.guides.map(|n| n as usize),
            build: BuildOptions {
                guide_vertices: Resample::Vertices(self.guide_vertices as usize),
                strand_vertices: self
                    .strand_vertices
                    .map_or(Resample::Keep, |n| Resample::Vertices(n as usize)),
                growth: Growth {
                    per_guide: self.per_guide as usize,
                    vertices: self.strand_vertices.map_or(growth.vertices, |n| n as usize),
                    shorter: self.shorter,
                    clump: self.clump,
                },
                hierarchy: HierarchyShape {
                    levels: self.levels as usize,
                    coarse: self.coarse.map(|n| n as usize),
                    leaves: self.leaves.map(|n| n as usize),
                },
                sections: self.sections as usize,
                material: self.material.resolve(),
                width: self.width,
            },
        }
    }
}

impl MaterialArguments {
    fn resolve(self) -> Material {
        let usual = Material::default();
        let section = self.diameter.map(|microns| 0.5e-6 * microns).map(|a| RodSection { a1: a, a2: a });
        Material {
            young_modulus: self.young.map_or(usual.young_modulus, |gpa| gpa * 1e9),
            shear_modulus: self.shear.map_or(usual.shear_modulus, |gpa| gpa * 1e9),
            density: self.density.unwrap_or(usual.density),
            section: section.unwrap_or(usual.section),
            damping: self.damping.unwrap_or(usual.damping),
            friction: self.friction.map_or(usual.friction, Into::into),
            drag: self.drag.unwrap_or(usual.drag),
            sag_free: self.sag_free,
            ..usual
        }
    }
}

impl TrackArguments {
    fn resolve(&self, pivot: Option<Vector3<f64>>) -> TrackOptions {
        let motion = Source {
            metres_per_unit: self.units,
            up: self.up,
            prim: self.prim.clone(),
            ..Source::new(&self.motion)
        };
        let mesh = |source: &Source| ColliderMesh {
            friction: self.friction,
            thickness: self.thickness * 1e-3,
            ..ColliderMesh::new(source.clone())
        };
        TrackOptions {
            fps: self.fps,
            frames: self.frames.map(<[i32; 2]>::from),
            pivot,
            rest: self.rest.map(|rest| match rest {
                RestName::Bind => RestPose::Bind,
                RestName::World => RestPose::World,
                RestName::First => RestPose::First,
            }),
            joint: JointSelector { name: self.joint.clone(), clip: self.clip.clone() },
            colliders: self.colliders.iter().map(mesh).collect(),
            smoothing_hz: self.smoothing,
            pops: match self.pops {
                PopsName::Error => Pops::Error,
                PopsName::Bridge => Pops::Bridge,
                PopsName::Keep => Pops::Keep,
            },
            ..TrackOptions::new(motion, folder_of(&self.output))
        }
    }
}
