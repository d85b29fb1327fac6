//! `hairbake grow`.

use super::material_arguments::MaterialArguments;
use super::values::{self, count};
use super::{input_files, output_file};

use crate::import::{
    self, Clumps, Direction, FurShape, GROWN_GUIDES, GrowOptions, STRANDS_PER_GUIDE, Source, StrandCount,
};
use crate::scene::Material;
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  hairbake grow body.obj -o fur.json
  hairbake grow shot.usd:/char/body -o fur.json --length 30 --length-map fur_length --density-map fur_density
  hairbake grow bear.glb -o fur.json --on Body,Head --direction primvar:comb --strands-per-cm2 40
  hairbake import track shot.usd --groom fur.json --skin shot.usd:/char/body -o anim.json";

const WHERE: &str = "Where and how many";
const SHAPE: &str = "Shape";
const HIERARCHY: &str = "Wisp hierarchy";
const MATERIAL: &str = "Material (defaults: human scalp hair)";

/// `hairbake grow` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct GrowArguments {
    /// Mesh that the fur grows on: OBJ, USD or glTF, in the pose to which `import track --skin` binds roots
    ///
    /// Units and up axis are those of the file; without them the unit is guessed from the size.
    #[arg(value_name = "FILE[:PRIM][:UNITS][:UP]", value_parser = values::source)]
    mesh: Source,
    /// Groom file to write; long arrays go to a .bin file next to it, which is named after it
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Name of the groom and of its group [default: name of the mesh file]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Seed of all random numbers; another seed gives other strands
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Parts of the mesh that bear fur, separated by commas [default: all]
    ///
    /// Groups and objects of OBJ; subsets and prims of USD; materials, meshes and nodes of glTF.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', help_heading = WHERE)]
    on: Vec<String>,
    /// Painted density, 0 to 1, that multiplies the number of strands; none grow where it is 0
    ///
    /// A primvar of USD of any interpolation; vertex colours are \"color\" in OBJ and \"COLOR_0\" in glTF. The red
    /// counts, or what the name ends with: color.g, color.b.
    #[arg(long, value_name = "PRIMVAR", help_heading = WHERE)]
    density_map: Option<String>,
    /// Number of guides, which are simulated; they keep their distance from each other
    ///
    /// More guides follow the motion of the skin more closely and cost more.
    #[arg(long, value_name = "N", default_value_t = GROWN_GUIDES as u32, value_parser = count(1, 1_000_000), help_heading = WHERE)]
    guides: u32,
    /// Number of strands, which are drawn; 0 for guides alone [default: 25 for each guide]
    #[arg(long, value_name = "N", value_parser = count(0, 10_000_000), conflicts_with = "strands_per_cm2", help_heading = WHERE)]
    strands: Option<u32>,
    /// Strands on each square centimetre, in place of their number
    #[arg(long, value_name = "N", value_parser = values::positive, help_heading = WHERE)]
    strands_per_cm2: Option<f64>,

    /// Length of the fur, in mm [default: 3 % of the diagonal of the mesh's bounding box]
    #[arg(long, value_name = "MM", value_parser = values::positive, help_heading = SHAPE)]
    length: Option<f64>,
    /// Painted factor on the length, named as --density-map; no strand is shorter than 1 mm
    #[arg(long, value_name = "PRIMVAR", help_heading = SHAPE)]
    length_map: Option<String>,
    /// Largest shortening of a strand at random, 0 to 1
    #[arg(long, value_name = "FRACTION", default_value_t = FurShape::default().length_variation, value_parser = values::fraction, help_heading = SHAPE)]
    length_variation: f64,
    /// Which way the fur lies: flow, flow:X,Y,Z, X,Y,Z, u, v, -u, -v, primvar:NAME or normal
    ///
    /// flow runs along the surface away from the head end, which is that end of the longest axis that has the
    /// greatest coordinate, or away from the place X,Y,Z (metres, Y up): along the back to the tail, down the
    /// legs. A vector X,Y,Z (Y up) is laid on the surface, u and v are rising texture coordinates, a primvar
    /// holds combed vectors, and normal is straight out.
    #[arg(long, value_name = "DIRECTION", default_value = "flow", value_parser = direction, allow_hyphen_values = true, help_heading = SHAPE)]
    direction: Direction,
    /// How much its weight turns the fur down the surface: 0 not at all, 1 as much as the direction
    #[arg(long, value_name = "SHARE", default_value_t = FurShape::default().gravity, value_parser = values::not_negative, help_heading = SHAPE)]
    gravity: f64,
    /// Rounds of smoothing that make the directions of neighbouring vertices agree
    #[arg(long, value_name = "N", default_value_t = FurShape::default().smoothing as u32, value_parser = count(0, 10_000), help_heading = SHAPE)]
    smoothing: u32,
    /// Angle between skin and fur at the root, and the share of it that is left at the tip
    ///
    /// In degrees, 0 to 90. Less is sleeker; 90 and 1 is a brush.
    #[arg(long, value_name = "DEGREES[,SHARE]", default_value = "40,0.3", value_parser = lift, help_heading = SHAPE)]
    lift: [f64; 2],
    /// Radius of curls at the tip, as a share of the length, and their turns [default: no curls]
    #[arg(long, value_name = "SHARE[,TURNS]", value_parser = curl, help_heading = SHAPE)]
    curl: Option<[f64; 2]>,
    /// How far single strands stray at the tip, as a share of their length, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = FurShape::default().frizz, value_parser = values::fraction, help_heading = SHAPE)]
    frizz: f64,
    /// How far strands of a clump come together at their tips, 0 to 1: of large clumps, and of small ones
    #[arg(long, value_name = "LARGE[,SMALL]", default_value = "0.5,0.5", value_parser = strengths, help_heading = SHAPE)]
    clump: [f64; 2],
    /// Number of large clumps and of small ones [default: one for each guide, and six in each of these]
    #[arg(long, value_name = "LARGE[,SMALL]", value_parser = clump_counts, help_heading = SHAPE)]
    clump_count: Option<[Option<usize>; 2]>,
    /// Vertices of a strand and of a guide [default: 8, or up to 128 for curls]
    #[arg(long, value_name = "N", value_parser = count(3, 256), help_heading = SHAPE)]
    vertices: Option<u32>,
    /// Drawn width of the strands at root and tip, in mm [default: covers the skin as hairs cover a scalp]
    #[arg(long, value_name = "ROOT,TIP", value_parser = values::widths, help_heading = SHAPE)]
    width: Option<[f64; 2]>,

    /// Levels of the wisp hierarchy; 1 for leaf wisps only
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count(1, 8), help_heading = HIERARCHY)]
    levels: u32,
    /// Sections per wisp, which are the strain nodes of its guides
    ///
    /// More sections resolve finer bends and cost more.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = count(2, 64), help_heading = HIERARCHY)]
    sections: u32,

    /// Frequencies at which fur springs back to its pose at root and tip, in Hz; 0,0 for none
    #[arg(long, value_name = "ROOT,TIP", default_value = "8,3", value_parser = frequencies, help_heading = MATERIAL)]
    stand: [f64; 2],
    #[command(flatten)]
    material: MaterialArguments,
}

/// The direction of fur.
fn direction(text: &str) -> Result<Direction, String> {
    let texture = |axis, falls| Ok(Direction::Texture { axis, falls });
    match text {
        "flow" => Ok(Direction::Flow(None)),
        "normal" => Ok(Direction::Normal),
        "u" => texture(0, false),
        "v" => texture(1, false),
        "-u" => texture(0, true),
        "-v" => texture(1, true),
        _ => match text.split_once(':') {
            Some(("flow", start)) => Ok(Direction::Flow(Some(values::vector(start)?))),
            Some(("primvar", name)) if !name.is_empty() => Ok(Direction::Field(name.into())),
            None if text.contains(',') => match values::vector(text)? {
                along if along.norm() > 0.0 => Ok(Direction::Vector(along)),
                _ => Err("expected a vector that has a length".into()),
            },
            _ => {
                Err("expected flow, flow:X,Y,Z, a vector X,Y,Z, u, v, -u, -v, primvar:NAME or normal".into())
            }
        },
    }
}

/// Angle at the root in degrees, in radians, and the share of it at the tip.
fn lift(text: &str) -> Result<[f64; 2], String> {
    let [degrees, share] = values::pair(text, values::not_negative, |_| FurShape::default().lift_at_tip)?;
    match degrees <= 90.0 && share <= 1.0 {
        true => Ok([degrees.to_radians(), share]),
        false => Err("expected 0 to 90 degrees and a share of 0 to 1, such as 40,0.3".into()),
    }
}

/// Radius and turns of curls.
fn curl(text: &str) -> Result<[f64; 2], String> {
    let [radius, turns] = values::pair(text, values::not_negative, |_| FurShape::default().curl[1])?;
    match radius <= 1.0 && turns <= 100.0 {
        true => Ok([radius, turns]),
        false => Err("expected a share of 0 to 1 and up to 100 turns, such as 0.1,3".into()),
    }
}

/// Strengths of large and of small clumps.
fn strengths(text: &str) -> Result<[f64; 2], String> {
    values::pair(text, values::fraction, |large| *large)
}

/// Numbers of large and of small clumps.
fn clump_counts(text: &str) -> Result<[Option<usize>; 2], String> {
    let number = |text: &str| {
        let number = text.parse().ok().filter(|n| (1..=10_000_000).contains(n));
        number.map(Some).ok_or_else(|| "expected numbers from 1 to 10000000, such as 2000,12000".to_string())
    };
    values::pair(text, number, |_| None)
}

/// Frequencies at root and tip.
fn frequencies(text: &str) -> Result<[f64; 2], String> {
    let pair = values::pair(text, values::not_negative, |hz| *hz)?;
    match pair.iter().all(|hz| *hz <= 1000.0) {
        true => Ok(pair),
        false => Err("expected 0 to 1000 Hz".into()),
    }
}

/// Grows fur.
pub fn run(arguments: GrowArguments) -> crate::error::Result<()> {
    let output = arguments.output.clone();
    input_files::require(std::iter::once(&*arguments.mesh.path))?;
    let mut options = arguments.options();
    options.folder = output_file::folder(&output).to_path_buf();
    let (groom, report) = import::grow(&options)?;
    output_file::write_groom(&output, &groom, &report)
}

impl GrowArguments {
    fn options(self) -> GrowOptions {
        let default = GrowOptions::new(self.mesh);
        let guides = self.guides as usize;
        let number = self.strands.map_or(STRANDS_PER_GUIDE * guides, |n| n as usize);
        let [large, small] = self.clump_count.unwrap_or_default();
        GrowOptions {
            name: self.name.unwrap_or_else(|| default.name.clone()),
            parts: self.on,
            density_field: self.density_map,
            guides,
            strands: self
                .strands_per_cm2
                .map_or(StrandCount::Number(number), |per_cm2| StrandCount::PerArea(per_cm2 * 1e4)),
            vertices: self.vertices.map(|n| n as usize),
            seed: self.seed,
            shape: FurShape {
                length: self.length.map(|mm| mm * 1e-3),
                length_variation: self.length_variation,
                length_field: self.length_map,
                direction: self.direction,
                gravity: self.gravity,
                smoothing: self.smoothing as usize,
                lift: self.lift[0],
                lift_at_tip: self.lift[1],
                curl: self.curl.unwrap_or(default.shape.curl),
                frizz: self.frizz,
            },
            clumps: [
                Clumps { count: large, strength: self.clump[0] },
                Clumps { count: small, strength: self.clump[1] },
            ],
            levels: self.levels as usize,
            sections: self.sections as usize,
            material: self.material.material(Material { goal: self.stand, ..default.material.clone() }),
            width: self.width,
            ..default
        }
    }
}
