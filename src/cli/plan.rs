//! `hairbake plan`: a bake as a job of a render farm.

use super::console;
use super::frame_list::frame_range;
use super::scene_arguments::{SELECTION, SceneArguments};
use super::wedges::{self, Wedge};
use crate::error::{Error, Result};
use crate::farm::{Commands, Division, FRAMES, PATH_MAP, Plan, Step, ValidateCommands, openjd, slurm};
use crate::strands::LOOKAHEAD;
use clap::{Args, ValueEnum};
use std::path::Path;

const EXAMPLES: &str = "\
Examples:
  Run the job with the OpenJD command line:
    hairbake plan groom.json anim.json -o out --format openjd >job.json
    openjd run job.json --step assemble --run-dependencies \\
      -p Groom=$PWD/groom.json -p Anim=$PWD/anim.json -p Output=$PWD/out
  Submit the job to Slurm:
    hairbake plan groom.json anim.json -o out --format slurm --segment 50 | bash
  Bake every combination of two settings, each into a folder of its own:
    hairbake plan groom.json anim.json -o sweep \\
      --wedge groom.materials[0].friction=0.1,0.3 --wedge substeps=4,8";

const HEADING: &str = "Plan";

/// `hairbake plan` as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct PlanArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Frames to bake, such as 1001-1100 [default: all frames of ANIM]
    #[arg(long, value_name = "A-B", value_parser = frame_range, allow_hyphen_values = true, help_heading = SELECTION)]
    frames: Option<(i32, i32)>,
    /// Format of the plan on standard output
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "json", help_heading = HEADING)]
    format: PlanFormat,
    /// Frames per segment of the simulation; one task simulates a segment
    ///
    /// With shorter segments, interpolation starts sooner.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..), help_heading = HEADING)]
    segment: u32,
    /// Frames per task that interpolates strands
    ///
    /// Larger chunks make fewer and longer tasks.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..), help_heading = HEADING)]
    chunk: u32,
    /// Do not validate the caches
    #[arg(long, help_heading = HEADING)]
    no_validate: bool,
    /// Bake once per value, each into a folder of its own below the output folder; may be repeated
    ///
    /// NAME is a setting, such as substeps=4,8, or a value of an input file as for --set. Several wedges give
    /// every combination, and a contact sheet compares them.
    #[arg(long, value_name = "NAME=V1,V2,...", value_parser = wedges::wedge, help_heading = HEADING)]
    wedge: Vec<Wedge>,
    /// Command that starts hairbake where the tasks run
    #[arg(long, value_name = "COMMAND", default_value = "hairbake", help_heading = HEADING)]
    program: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PlanFormat {
    /// Every task with its command line
    Json,
    /// Job template of Open Job Description
    Openjd,
    /// Shell script that submits to Slurm
    Slurm,
}

/// Prints the plan.
pub fn run(arguments: &PlanArguments, threads: Option<usize>) -> Result<()> {
    let paths = arguments.scene.absolute_paths()?;
    let plan = arguments.plan(&paths, threads)?;
    let text = match arguments.format {
        PlanFormat::Json => pretty(&plan.to_json())?,
        PlanFormat::Openjd => {
            let [groom, anim, out] = paths;
            console::say(&format!(
                "job parameters: -p \"Groom={groom}\" -p \"Anim={anim}\" -p \"Output={out}\""
            ));
            pretty(&openjd::template(&plan, &[("Groom", groom), ("Anim", anim), ("Output", out)])?)?
        }
        PlanFormat::Slurm => slurm::script(&plan)?,
    };
    console::data(text.as_bytes())
}

fn pretty(value: &serde_json::Value) -> Result<String> {
    serde_json::to_string_pretty(value).map(|text| text + "\n").map_err(|e| Error::Internal(e.to_string()))
}

impl PlanArguments {
    /// One bake, or one per combination of the wedges with a contact sheet of all; `paths` are groom,
    /// animation and output.
    fn plan(&self, paths: &[String; 3], threads: Option<usize>) -> Result<Plan> {
        let frames = self.scene.load(self.frames)?.anim.frames;
        let division = Division {
            frames: (frames.0 - 1, frames.1 + 1),
            lookahead: LOOKAHEAD as i32,
            segment: self.segment,
            interpolate: self.chunk,
            validate: self.segment,
        };
        let mut plan = Plan::new(&self.scene.title(), threads);
        let [groom, anim, out] = paths;
        if self.wedge.is_empty() {
            plan.add_bake(&self.commands("", [groom, anim, out], &[], frames)?, division)?;
            return Ok(plan);
        }
        let mut caches = Vec::new();
        let mut needs = Vec::new();
        for (i, values) in wedges::combinations(&self.wedge)?.iter().enumerate() {
            let number = format!("{:03}", i + 1);
            let cache = wedges::folder(out, &number, values);
            let commands = self.commands(&number, [groom, anim, &cache], values, frames)?;
            needs.push(plan.add_bake(&commands, division)?);
            caches.push(cache);
        }
        let sheet = Path::new(out).join("wedges.png").display().to_string();
        let command =
            [vec![self.program.clone(), "preview".into()], caches, vec!["-o".into(), sheet]].concat();
        plan.add(Step { name: "sheet".into(), command, chunks: Vec::new(), needs })?;
        Ok(plan)
    }

    /// The commands of one bake, with `values` in place of its settings.
    ///
    /// # Errors
    /// As [`SceneArguments::to_words`].
    fn commands(
        &self,
        name: &str,
        [groom, anim, out]: [&str; 3],
        values: &[(String, String)],
        (first, last): (i32, i32),
    ) -> Result<Commands> {
        let mut settings = self.scene.to_words()?;
        if self.format == PlanFormat::Openjd {
            settings.extend(["--path-map-file", PATH_MAP].map(String::from));
        }
        for (name, value) in values {
            match name.contains('.') {
                true => settings.extend(["--set".into(), format!("{name}={value}")]),
                false => settings.extend([format!("--{name}"), value.clone()]),
            }
        }
        let stage = |stage: &str, end: &[&str]| {
            let words = [&*self.program, stage, groom, anim, "-o", out].map(String::from);
            let shot = format!("--shot={first}-{last}");
            let end = end.iter().map(|word| (*word).to_string());
            words.into_iter().chain([shot]).chain(settings.clone()).chain(end).collect::<Vec<String>>()
        };
        let frames = format!("--frames={FRAMES}");
        let validate = |end: &[&str]| {
            [&[&*self.program, "validate", out][..], end].concat().into_iter().map(String::from).collect()
        };
        Ok(Commands {
            name: name.into(),
            simulate: stage("simulate", &[&frames]),
            interpolate: stage("interpolate", &[&frames]),
            assemble: stage("assemble", &[]),
            validate: (!self.no_validate).then(|| ValidateCommands {
                files: validate(&["--only=static"]),
                frames: validate(&["--only=moving", &frames]),
            }),
        })
    }
}
