//! The command line. The only module that prints: data on standard output, all else on standard error.

mod arguments;
mod bake;
mod check;
mod console;
mod estimate;
mod import;
mod plan;
mod preview;
mod progress;
mod sample;
mod scene;
mod shell;
mod signals;
mod status;
mod summary;
mod validate;
mod values;

use crate::error::{Error, Result};
use arguments::{Arguments, Command};
use clap::{ArgMatches, CommandFactory, FromArgMatches};
use estimate::Typed;
use progress::Progress;
use std::process::ExitCode;

/// Exit code of wrong usage.
const USAGE: u8 = 64;

/// Runs the program on the process's own arguments.
pub fn main() -> ExitCode {
    let parsed = Arguments::command()
        .try_get_matches_from(arguments::general_last(std::env::args_os().collect()))
        .and_then(|matches| Ok((Arguments::from_arg_matches(&matches)?, matches)));
    let (arguments, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(message) => {
            // A closed output is no reason to fail; there is nobody to tell.
            let _ = message.print();
            return if message.use_stderr() { ExitCode::from(USAGE) } else { ExitCode::SUCCESS };
        }
    };
    console::start(arguments.quiet, arguments.log_format);
    match run(arguments, matches) {
        Ok(code) => code,
        Err(error) => {
            console::fail(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(arguments: Arguments, matches: ArgMatches) -> Result<ExitCode> {
    let Arguments { scene, bake, command, threads, quiet, progress, log_format: _ } = arguments;
    let queue = start_threads(threads)?;
    let typed = || Typed::new(Arguments::command(), matches, queue);
    let progress = Progress::start(quiet, progress);
    match command {
        None => match scene {
            Some(scene) => bake::run(&scene, &bake, &typed(), progress)?,
            None => return Err(Error::Usage("GROOM and ANIM, or a command, are needed: see --help".into())),
        },
        Some(Command::Check { files }) => check::check(&files)?,
        Some(Command::Schema { format }) => check::schema(format)?,
        Some(Command::Import { what }) => import::run(what)?,
        Some(Command::Sample(options)) => sample::run(&options)?,
        Some(Command::Estimate(options)) => estimate::run(&options, &typed(), progress)?,
        Some(Command::Simulate(options)) => bake::simulate(&options, progress)?,
        Some(Command::Interpolate(options)) => bake::interpolate(&options, progress)?,
        Some(Command::Assemble(options)) => bake::assemble(&options)?,
        Some(Command::Plan(options)) => plan::run(&options, threads)?,
        Some(Command::Status(options)) => status::run(&options)?,
        Some(Command::Preview(options)) => preview::run(&options)?,
        Some(Command::Validate(options)) => return validate::run(&options),
        Some(Command::Completions { shell }) => shell::completions(shell)?,
        Some(Command::Man { command }) => shell::man(&command)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Starts as many worker threads as asked for: by option, by hairbake's own variable (clap reads both), or by that of the render
/// farm's queue, which is returned; else one for each core that the process may use.
fn start_threads(asked: Option<usize>) -> Result<Option<&'static str>> {
    let of_queue =
        |name: &'static str| Some((name, std::env::var(name).ok()?.parse().ok().filter(|n: &usize| *n > 0)?));
    let queue = ["CUE_THREADS", "SLURM_CPUS_PER_TASK"].into_iter().find_map(of_queue);
    rayon::ThreadPoolBuilder::new()
        .num_threads(asked.or(queue.map(|(_, n)| n)).unwrap_or(0))
        .build_global()
        .map_err(|e| Error::Internal(format!("starting threads: {e}")))?;
    Ok(queue.map(|(name, _)| name))
}
