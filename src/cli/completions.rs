//! `hairbake completions` and `hairbake man`.

use super::arguments::Arguments;
use super::command_line::{self, DEFAULT_COMMAND};
use super::console;
use crate::error::{Error, Result};
use clap::{Arg, CommandFactory};

/// Prints a completion script.
pub fn completions(shell: clap_complete::Shell) -> Result<()> {
    // Completes hidden general options too, so the help's layout is left out; and the options of the default
    // command.
    let mut command = Arguments::command();
    let default =
        command.find_subcommand(DEFAULT_COMMAND).map(|c| c.get_arguments().cloned().collect::<Vec<Arg>>());
    command = command.args(default.unwrap_or_default().into_iter().map(|a| a.required(false)));
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command, "hairbake", &mut script);
    console::data(&script)
}

/// Prints the manual page of the command with these `names`, or of the program.
pub fn man(names: &[String]) -> Result<()> {
    let mut command = command_line::command();
    command.build();
    for name in names {
        let below = command.find_subcommand(name).cloned();
        command = below.ok_or_else(|| Error::Usage(format!("unknown command `{}`", names.join(" "))))?;
    }
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page).map_err(|e| Error::io("manual page", e))?;
    console::data(&page)
}
