//! `hairbake completions` and `hairbake man`.

use super::arguments::Arguments;
use super::console;
use crate::error::{Error, Result};
use clap::CommandFactory;

/// Prints a completion script.
pub fn completions(shell: clap_complete::Shell) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "hairbake", &mut script);
    console::data(&script)
}

/// Prints the manual page of the command that `names` lead to, or of all.
pub fn man(names: &[String]) -> Result<()> {
    let mut command = Arguments::command();
    command.build();
    for name in names {
        let below = command.find_subcommand(name).cloned();
        command = below.ok_or_else(|| Error::Usage(format!("there is no command {}", names.join(" "))))?;
    }
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page).map_err(|e| Error::io("manual page", e))?;
    console::data(&page)
}
