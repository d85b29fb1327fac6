//! The command line. Only this module prints: data on standard output, everything else on standard error.

mod arguments;
mod bake;
mod bake_report;
mod check;
mod command_line;
mod completions;
mod console;
mod estimate;
mod explain;
mod figures;
mod film;
mod frame_list;
mod grow;
mod help;
mod import;
mod input_files;
mod material_arguments;
mod output_file;
mod plan;
mod preview;
mod progress;
mod read;
mod run_arguments;
mod sample;
mod scene_arguments;
mod scene_changes;
mod schema;
mod settings;
mod signals;
mod stages;
mod status;
mod summary;
mod validate;
mod values;
mod view;
mod warnings;
mod wedges;

use crate::error::{Error, Result};
use arguments::{Arguments, Command};
use clap::ArgMatches;
use explain::OptionOrigins;
use progress::Progress;
use std::process::ExitCode;

/// Exit code of wrong usage.
const USAGE: u8 = 64;

/// Runs the program on the arguments of the process.
pub fn main() -> ExitCode {
    let (arguments, matches) = match command_line::parse(std::env::args_os().collect()) {
        Ok(parsed) => parsed,
        Err(message) => {
            // A closed output is not an error.
            let _ = message.print();
            return if message.use_stderr() { ExitCode::from(USAGE) } else { ExitCode::SUCCESS };
        }
    };
    console::start(arguments.general.quiet, arguments.general.log_format);
    match run(arguments, matches) {
        Ok(code) => code,
        Err(error) => {
            console::fail(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(arguments: Arguments, matches: ArgMatches) -> Result<ExitCode> {
    let Arguments { command, general } = arguments;
    let queue = start_threads(general.threads)?;
    let origins = || OptionOrigins::new(command_line::command(), matches, queue);
    let progress = Progress::start(general.quiet, general.progress);
    match command {
        Command::Sample(options) => sample::run(&options)?,
        Command::Import { what } => import::run(what)?,
        Command::Grow(options) => grow::run(*options)?,
        Command::Check(options) => check::run(&options)?,
        Command::Schema { format } => schema::schema(format)?,
        Command::Estimate(options) => estimate::run(&options, &origins(), progress)?,
        Command::Bake(options) => bake::run(&options, &origins(), progress)?,
        Command::Preview(options) => preview::run(&options)?,
        Command::View(options) => view::run(&options)?,
        Command::Read(options) => read::run(&options)?,
        Command::Status(options) => status::run(&options)?,
        Command::Validate(options) => return validate::run(&options),
        Command::Plan(options) => plan::run(&options, general.threads)?,
        Command::Simulate(options) => stages::simulate(&options, progress)?,
        Command::Interpolate(options) => stages::interpolate(&options, progress)?,
        Command::Assemble(options) => stages::assemble(&options)?,
        Command::Completions { shell } => completions::completions(shell)?,
        Command::Man { command } => completions::man(&command)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Starts the worker threads: as many as `asked`, else as the queue of the render farm allows, else one per
/// core.
///
/// Returns the variable of the queue that was used.
fn start_threads(asked: Option<usize>) -> Result<Option<&'static str>> {
    let count = |name: &'static str| {
        let count = std::env::var(name).ok()?.parse().ok().filter(|n: &usize| *n > 0)?;
        Some((name, count))
    };
    let queue = ["CUE_THREADS", "SLURM_CPUS_PER_TASK"].into_iter().find_map(count);
    rayon::ThreadPoolBuilder::new()
        .num_threads(asked.or(queue.map(|(_, n)| n)).unwrap_or(0))
        .build_global()
        .map_err(|e| Error::Internal(format!("cannot start threads: {e}")))?;
    Ok(queue.map(|(name, _)| name))
}
