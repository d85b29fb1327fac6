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

/// Prints the manual page.
pub fn man() -> Result<()> {
    let mut page = Vec::new();
    clap_mangen::Man::new(Arguments::command()).render(&mut page).map_err(|e| Error::io("manual page", e))?;
    console::data(&page)
}
