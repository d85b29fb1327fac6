//! `hairbake import groom`.

use crate::cli::material_arguments::MaterialArguments;
use crate::cli::values::{self, count};
use crate::cli::{console, input_files, output_file};
use crate::error::Result;
use crate::import::{self, BuildOptions, Generation, GroomOptions, HierarchyShape, Resample, Source};
use crate::scene::{Material, UpAxis};
use clap::Args;
use nalgebra::Vector3;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  hairbake import groom hair.tfx --units cm --head bust.obj:cm -o groom.json
  hairbake import groom guides.tfx --strands full.tfx:m --head bust.obj:m -o groom.json
  hairbake import groom asset.usd --prim /char/groom --head asset.usd:/char/body -o groom.json
  hairbake import groom straight.hair --guides 300 --levels 3 --diameter 90 -o groom.json";

const USD: &str = "USD";
const SPACE: &str = "Space";
const STRANDS: &str = "Guides and render strands";
const HIERARCHY: &str = "Wisp hierarchy";

/// `hairbake import groom` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct GroomArguments {
    /// Strand file: USD, .tfx or .hair
    ///
    /// Strands of the file stay as they are and are drawn; guides are chosen from them. Strands are grown
    /// only if the file holds nothing but guides. In USD these are told by primvars:groom_guide, purpose
    /// guide, a name with "guide", or purpose proxy beside curves that are drawn; a .tfx file of up to 1000
    /// strands holds guides.
    strands: PathBuf,
    /// Groom file to write; long arrays go to a .bin file next to it, which is named after it
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Name of the groom [default: name of the strand file]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,

    /// Prim of a USD file that holds the strands, itself or below it [default: the whole stage]
    #[arg(long, value_name = "PATH", value_parser = values::prim, help_heading = USD)]
    prim: Option<String>,
    /// Time code at which animated USD curves are read [default: their rest pose, else the earliest]
    #[arg(long, value_name = "CODE", allow_hyphen_values = true, help_heading = USD)]
    time: Option<f64>,

    /// Unit of the strands: m, cm, mm, in, ft or metres per unit [default: from the file, else from the size
    /// of the groom]
    #[arg(long, value_name = "UNIT", value_parser = values::units, help_heading = SPACE)]
    units: Option<f64>,
    /// Up axis of the strands, y or z [default: from the file, else z for .hair and y for other files]
    #[arg(long, value_name = "AXIS", value_parser = values::up_axis, help_heading = SPACE)]
    up: Option<UpAxis>,
    /// Translation of all strands to the head, in metres, Y up
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", value_parser = values::vector, allow_hyphen_values = true, help_heading = SPACE)]
    offset: Vector3<f64>,
    /// Head mesh (OBJ or USD) that the hair grows on
    ///
    /// Used to report how far the roots are from the head, and to root generated strands on it.
    #[arg(long, value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source, help_heading = SPACE)]
    head: Option<Source>,

    /// Separate file with the render strands
    #[arg(long = "strands", value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source, help_heading = STRANDS)]
    render: Option<Source>,
    /// Number of guides to simulate [default: those named in the file; else all, or 500 of more than 1000]
    ///
    /// They are spread evenly over the strands. More guides follow the groom more closely and cost more.
    #[arg(long, value_name = "N", value_parser = count(1, 100_000), help_heading = STRANDS)]
    guides: Option<u32>,
    /// Vertices per guide [default: 32, or up to 128 for curls]
    ///
    /// More vertices follow tighter curls.
    #[arg(long, value_name = "N", value_parser = count(2, 4096), help_heading = STRANDS)]
    guide_vertices: Option<u32>,
    /// Vertices per render strand [default: as in the file; 16 for generated strands, or up to 128 for curls]
    ///
    /// More vertices draw smoother strands and make the cache larger.
    #[arg(long, value_name = "N", value_parser = count(2, 4096), help_heading = STRANDS)]
    strand_vertices: Option<u32>,
    /// Render strands to grow around each guide, in place of any in the file; 0 for none [default: 50 if the
    /// file holds guides only, else none]
    ///
    /// More strands are denser and make the cache larger. They grow outside the head of `--head`; other
    /// bodies are not known yet, and strands that grow into shoulders stay in them.
    #[arg(long, value_name = "N", alias = "per-guide", value_parser = count(0, 100_000), help_heading = STRANDS)]
    strands_per_guide: Option<u32>,
    /// Largest shortening of a generated strand relative to its guide, 0 to 1
    ///
    /// Raising it frays the ends.
    #[arg(long, value_name = "FRACTION", alias = "shorter", default_value_t = 0.08, value_parser = values::fraction, help_heading = STRANDS)]
    length_variation: f64,
    /// Scale factor for the length of all strands; their shape is kept
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = values::positive, help_heading = STRANDS)]
    length_scale: f64,
    /// How far generated strands converge on their guide towards the tip, 0 to 1
    ///
    /// 0 keeps their distance; 1 makes pointed locks.
    #[arg(long, value_name = "FRACTION", default_value_t = 0.4, value_parser = values::fraction, help_heading = STRANDS)]
    clump: f64,
    /// Drawn width of the strands at root and tip, in mm [default: covers the skin as hairs cover a scalp]
    ///
    /// Wider strands cover more of the head.
    #[arg(long, value_name = "ROOT,TIP", value_parser = values::widths, help_heading = STRANDS)]
    width: Option<[f64; 2]>,

    /// Levels of the wisp hierarchy; 1 for leaf wisps only
    ///
    /// With more levels, an adaptive bake starts from coarser wisps.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count(1, 8), help_heading = HIERARCHY)]
    levels: u32,
    /// Number of wisps on the coarsest level [default: a fifth of the next level]
    ///
    /// With more of them, an adaptive bake follows the groom more closely and costs more.
    #[arg(long, value_name = "N", alias = "coarse", value_parser = count(1, 100_000), help_heading = HIERARCHY)]
    coarse_wisps: Option<u32>,
    /// Number of leaf wisps, each with one to three guides [default: half the number of guides]
    ///
    /// More leaf wisps represent the strands more closely.
    #[arg(long, value_name = "N", alias = "leaves", value_parser = count(1, 100_000), help_heading = HIERARCHY)]
    leaf_wisps: Option<u32>,
    /// Sections per wisp, which are the strain nodes of its guides
    ///
    /// More sections resolve finer bends and cost more.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = count(2, 64), help_heading = HIERARCHY)]
    sections: u32,

    #[command(flatten)]
    material: MaterialArguments,
}

/// Imports a groom.
pub fn run(arguments: GroomArguments) -> Result<()> {
    let output = arguments.output.clone();
    let others = arguments.head.iter().chain(&arguments.render).map(|source| &*source.path);
    input_files::require(std::iter::once(&*arguments.strands).chain(others))?;
    let head = arguments.head.as_ref().map(import::read_mesh).transpose()?;
    let mut options = arguments.options();
    options.folder = output_file::folder(&output).to_path_buf();
    if let Some(head) = head {
        head.notes.iter().for_each(|note| console::say(note));
        options.scalp = Some(head.mesh);
    }
    let (groom, report) = import::groom(&options)?;
    output_file::write_groom(&output, &groom, &report)
}

impl GroomArguments {
    fn options(self) -> GroomOptions {
        let offset = |source: Source| Source { offset: self.offset, ..source };
        let guides = Source {
            metres_per_unit: self.units,
            up: self.up,
            prim: self.prim,
            time: self.time,
            ..Source::new(self.strands)
        };
        let default = GroomOptions::new(offset(guides));
        let generation = Generation::default();
        GroomOptions {
            name: self.name.unwrap_or(default.name),
            folder: default.folder,
            guides: default.guides,
            strands: self.render.map(offset),
            scalp: None,
            length_scale: self.length_scale,
            guide_count: self.guides.map(|n| n as usize),
            strands_per_guide: self.strands_per_guide.map(|n| n as usize),
            build: BuildOptions {
                guide_vertices: self
                    .guide_vertices
                    .map_or(BuildOptions::default().guide_vertices, |n| Resample::Vertices(n as usize)),
                strand_vertices: self
                    .strand_vertices
                    .map_or(Resample::Keep, |n| Resample::Vertices(n as usize)),
                generation: Generation {
                    per_guide: generation.per_guide,
                    vertices: self.strand_vertices.map(|n| n as usize),
                    length_variation: self.length_variation,
                    clump: self.clump,
                },
                hierarchy: HierarchyShape {
                    levels: self.levels as usize,
                    coarse: self.coarse_wisps.map(|n| n as usize),
                    leaves: self.leaf_wisps.map(|n| n as usize),
                },
                sections: self.sections as usize,
                material: self.material.material(Material::default()),
                width: self.width,
            },
        }
    }
}
