//! The plan of a bake: its size, and every setting with the origin of its value.

use super::scene_arguments::{Scene, SceneArguments};
use super::settings::Explained;
use crate::error::Result;
use clap::parser::ValueSource;
use clap::{ArgMatches, Command};
use std::fmt::Write;

/// The size of the bake of `scene`, and its settings with their origins.
///
/// # Errors
/// As [`SceneArguments::explained`].
pub fn plan(arguments: &SceneArguments, scene: &Scene, origins: &OptionOrigins) -> Result<String> {
    let mut text = String::new();
    let (first, last) = scene.anim.frames;
    let frames = format!("{first} to {last} at {} fps, plus one handle frame at each end", scene.anim.fps);
    let (guides, strands) = (&scene.groom.guides.curves, &scene.groom.strands.curves);
    row(&mut text, "frames", &frames, "");
    row(&mut text, "guides", &format!("{} ({} points)", guides.len(), guides.points.len()), "");
    row(&mut text, "strands", &format!("{} ({} points)", strands.len(), strands.points.len()), "");
    row(&mut text, "colliders", &scene.anim.colliders.len().to_string(), "");
    for Explained { name, value, origin } in arguments.explained(scene)?.iter().chain(&origins.explained()) {
        row(&mut text, name, value, origin);
    }
    Ok(text)
}

/// Appends a line of three columns.
pub fn row(text: &mut String, name: &str, value: &str, origin: &str) {
    // Writing to a string does not fail.
    let _ = writeln!(text, "{}", format!("{name:<20}{value:<18}{origin}").trim_end());
}

/// The parsed command line, to tell where the values of its options come from.
pub struct OptionOrigins {
    /// The command that runs, and its matches.
    command: Command,
    matches: ArgMatches,
    /// The variable of a render farm's queue that set the number of threads.
    queue: Option<&'static str>,
}

impl OptionOrigins {
    /// The origins for the innermost command in `matches`.
    pub fn new(mut command: Command, mut matches: ArgMatches, queue: Option<&'static str>) -> Self {
        // Passes the general options on to the commands.
        command.build();
        while let Some((name, below)) = matches.remove_subcommand() {
            if let Some(found) = command.find_subcommand(&name) {
                command = found.clone();
            }
            matches = below;
        }
        OptionOrigins { command, matches, queue }
    }

    /// Every option that an environment variable may set.
    fn explained(&self) -> Vec<Explained> {
        self.command.get_arguments().filter(|a| a.get_env().is_some()).map(|a| self.explain(a)).collect()
    }

    fn explain(&self, argument: &clap::Arg) -> Explained {
        let id = argument.get_id().as_str();
        let name = argument.get_long().unwrap_or(id);
        let values = self.matches.get_raw(id).into_iter().flatten();
        let value = values.map(|v| v.to_string_lossy().into_owned()).collect::<Vec<_>>().join(",");
        let (value, origin) = match self.matches.value_source(id) {
            Some(ValueSource::CommandLine) => (value, format!("--{name}")),
            Some(ValueSource::EnvVariable) => {
                (value, argument.get_env().unwrap_or_default().to_string_lossy().into_owned())
            }
            _ if id == "threads" => {
                (rayon::current_num_threads().to_string(), self.queue.unwrap_or("processor cores").into())
            }
            Some(_) => (value, "default".into()),
            None => ("none".into(), "default".into()),
        };
        Explained { name: name.into(), value, origin }
    }
}
