//! The command line. The only module that prints: data on standard output, all else on standard error.

mod arguments;
mod bake;
mod check;
mod console;
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
use clap::Parser;
use progress::Progress;
use std::process::ExitCode;

/// Exit code of wrong usage.
const USAGE: u8 = 64;

/// Runs the program on the process's own arguments.
pub fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(message) => {
            // A closed output is no reason to fail; there is nobody to tell.
            let _ = message.print();
            return if message.use_stderr() { ExitCode::from(USAGE) } else { ExitCode::SUCCESS };
        }
    };
    console::start(arguments.quiet, arguments.log_format);
    match run(arguments) {
        Ok(code) => code,
        Err(error) => {
            console::fail(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(arguments: Arguments) -> Result<ExitCode> {
    let Arguments { scene, bake, command, threads, quiet, progress, log_format: _ } = arguments;
    start_threads(threads)?;
    let progress = Progress::start(quiet, progress);
    match command {
        None => match scene {
            Some(scene) => bake::run(&scene, &bake, progress)?,
            None => return Err(Error::Usage("GROOM and ANIM, or a command, are needed: see --help".into())),
        },
        Some(Command::Check { files }) => check::check(&files)?,
        Some(Command::Schema { format }) => check::schema(format)?,
        Some(Command::Import { what }) => import::run(what)?,
        Some(Command::Sample(options)) => sample::run(&options)?,
        Some(Command::Simulate(options)) => bake::simulate(&options, progress)?,
        Some(Command::Interpolate(options)) => bake::interpolate(&options, progress)?,
        Some(Command::Assemble(options)) => bake::assemble(&options)?,
        Some(Command::Plan(options)) => plan::run(&options, threads)?,
        Some(Command::Status(options)) => status::run(&options)?,
        Some(Command::Preview(options)) => preview::run(&options)?,
        Some(Command::Validate(options)) => return validate::run(&options),
        Some(Command::Completions { shell }) => shell::completions(shell)?,
        Some(Command::Man) => shell::man()?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Starts as many worker threads as asked for: by option, by hairbake's own variable (clap reads both), or by that of the render
/// farm's queue; else one for each core that the process may use.
fn start_threads(asked: Option<usize>) -> Result<()> {
    let of_queue = |name: &str| std::env::var(name).ok()?.parse().ok().filter(|n| *n > 0);
    let threads = asked.or_else(|| of_queue("CUE_THREADS")).or_else(|| of_queue("SLURM_CPUS_PER_TASK"));
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build_global()
        .map_err(|e| Error::Internal(format!("starting threads: {e}")))
}
