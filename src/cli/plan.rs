//! `hairbake plan`: a bake as a job of a render farm.

use super::scene::SceneArguments;
use super::{console, values};
use crate::error::{Error, Result};
use crate::farm::{Commands, Division, FRAMES, PATH_MAP, Plan, Step, openjd, slurm};
use crate::strands::RETRACTION_SPAN;
use clap::{Args, ValueEnum};
use std::path::Path;

const EXAMPLES: &str = "\
Examples:
  hairbake plan groom.json anim.json -o out --format openjd >shot.template.json
  openjd run shot.template.json --step assemble --run-dependencies -p Groom=$PWD/groom.json -p Anim=$PWD/anim.json -p Output=$PWD/out
  hairbake plan groom.json anim.json -o out --format slurm --segment 50 | bash
  hairbake plan groom.json anim.json -o sweep --wedge groom.materials[0].friction=0.1,0.3 --wedge substeps=4,8";

/// Most combinations of wedges.
const MAX_WEDGES: usize = 1000;

/// The plan as it is typed.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct PlanArguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Bake this part of the shot only
    #[arg(long, value_name = "A-B", value_parser = values::frames, allow_hyphen_values = true, help_heading = "Output")]
    frames: Option<(i32, i32)>,
    /// What is printed on standard output: a job template, a script that submits, or every task with its command line
    #[arg(long, value_enum, default_value = "json", help_heading = "Plan")]
    format: PlanFormat,
    /// Frames of a segment of the simulation, one task each: shorter lets strands be made sooner
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..), help_heading = "Plan")]
    segment: u32,
    /// Frames of a task that makes strands
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..), help_heading = "Plan")]
    chunk: u32,
    /// Do not check the caches
    #[arg(long, help_heading = "Plan")]
    no_validate: bool,
    /// A bake for each of these values, in a folder of its own below OUT: a setting, such as substeps=4,8, or a value of a file as --set
    /// takes it. Given again, every combination
    #[arg(long, value_name = "NAME=V1,V2,...", value_parser = wedge, help_heading = "Plan")]
    wedge: Vec<(String, Vec<String>)>,
    /// How the program is called where the tasks run
    #[arg(long, value_name = "COMMAND", default_value = "hairbake", help_heading = "Plan")]
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

/// A setting and its values.
fn wedge(text: &str) -> std::result::Result<(String, Vec<String>), String> {
    let (name, list) = text.split_once('=').ok_or("NAME=V1,V2, such as substeps=4,8")?;
    // A value may be a list in brackets.
    let mut values = vec![String::new()];
    let mut depth = 0;
    for c in list.chars() {
        match c {
            '[' | '{' => depth += 1,
            ']' | '}' => depth -= 1,
            _ => {}
        }
        if c == ',' && depth == 0 {
            values.push(String::new());
        } else if let Some(value) = values.last_mut() {
            value.push(c);
        }
    }
    if name.is_empty() || values.iter().any(String::is_empty) {
        return Err("NAME=V1,V2, such as substeps=4,8".into());
    }
    Ok((name.into(), values))
}

/// Prints the plan.
pub fn run(arguments: &PlanArguments, threads: Option<usize>) -> Result<()> {
    let scene = arguments.scene.load(arguments.frames)?;
    let (first, last) = scene.anim.frames;
    let division = Division {
        frames: (first - 1, last + 1),
        ahead: RETRACTION_SPAN as i32,
        segment: arguments.segment,
        chunk: arguments.chunk,
        check: arguments.segment,
    };
    let mut plan = Plan::new(&arguments.scene.title(), threads);
    let paths = arguments.scene.absolute()?;
    let sheet = Path::new(&paths[2]).join("wedges.png");
    let mut caches = Vec::new();
    let mut wholes = Vec::new();
    for (i, values) in combinations(&arguments.wedge)?.iter().enumerate() {
        let name = if values.is_empty() { String::new() } else { format!("{:03}", i + 1) };
        let out = if values.is_empty() { paths[2].clone() } else { under(&paths[2], &name, values) };
        wholes
            .push(plan.add_bake(&arguments.commands(&name, &paths, &out, values, (first, last)), division)?);
        caches.push(out);
    }
    if !arguments.wedge.is_empty() {
        let mut command = vec![arguments.program.clone(), "preview".into()];
        command.extend(caches);
        command.extend(["-o".into(), sheet.display().to_string()]);
        plan.add(Step { name: "sheet".into(), command, chunks: Vec::new(), needs: wholes })?;
    }
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

/// Every combination of the values of the wedges; one of none where there is no wedge.
fn combinations(wedges: &[(String, Vec<String>)]) -> Result<Vec<Vec<(String, String)>>> {
    let count = wedges.iter().try_fold(1usize, |n, (_, values)| n.checked_mul(values.len()));
    if count.is_none_or(|n| n > MAX_WEDGES) {
        return Err(Error::Usage(format!("more than {MAX_WEDGES} combinations of wedges")));
    }
    let mut all = vec![Vec::new()];
    for (name, values) in wedges {
        let with = |chosen: &Vec<(String, String)>, value: &String| {
            [chosen.clone(), vec![(name.clone(), value.clone())]].concat()
        };
        all = all.iter().flat_map(|chosen| values.iter().map(move |value| with(chosen, value))).collect();
    }
    Ok(all)
}

/// The folder of a wedge: its number and what it is of, in characters that every file system takes.
fn under(out: &str, number: &str, values: &[(String, String)]) -> String {
    let words: Vec<String> = values
        .iter()
        .map(|(name, value)| format!("{}={value}", name.rsplit('.').next().unwrap_or(name)))
        .collect();
    let plain = |c: char| if c.is_ascii_alphanumeric() || "=.-".contains(c) { c } else { '_' };
    let name: String = words.join("_").chars().map(plain).take(100).collect();
    Path::new(out).join(format!("{number}_{name}")).display().to_string()
}

impl PlanArguments {
    fn commands(
        &self,
        name: &str,
        [groom, anim, _]: &[String; 3],
        out: &str,
        values: &[(String, String)],
        (first, last): (i32, i32),
    ) -> Commands {
        let mut settings = self.scene.settings();
        if self.format == PlanFormat::Openjd {
            settings.extend(["--path-map-file", PATH_MAP].map(String::from));
        }
        for (name, value) in values {
            if name.contains('.') {
                settings.extend(["--set".into(), format!("{name}={value}")]);
            } else {
                settings.extend([format!("--{name}"), value.clone()]);
            }
        }
        let stage = |stage: &str, end: &[&str]| {
            let words = [&self.program, stage, groom, anim, "-o", out].map(String::from);
            let shot = format!("--shot={first}-{last}");
            let end = end.iter().map(|word| (*word).to_string());
            words.into_iter().chain([shot]).chain(settings.clone()).chain(end).collect::<Vec<String>>()
        };
        let frames = format!("--frames={FRAMES}");
        let validate = |end: &[&str]| {
            [&[&*self.program, "validate", out][..], end].concat().into_iter().map(String::from).collect()
        };
        Commands {
            name: name.into(),
            simulate: stage("simulate", &[&frames]),
            interpolate: stage("interpolate", &[&frames]),
            assemble: stage("assemble", &[]),
            validate: (!self.no_validate)
                .then(|| [validate(&["--only=static"]), validate(&["--only=moving", &frames])]),
        }
    }
}
