//! A plan as a shell script that submits it to Slurm.

use super::plan::Plan;
use crate::{Error, Result};
use std::fmt::Write;

/// Start of the script.
const SUBMIT: &str = include_str!("submit.sh");

/// The script. Each task is a batch job that passes signals on to hairbake: Slurm sends USR1 a minute before
/// the time limit and on preemption. The task then exits with code 85, and Slurm requeues it if configured
/// with `RequeueExit=75,85`.
///
/// # Errors
/// [`Error::Usage`] for a line break in a command, because line breaks separate the commands in the script.
pub fn script(plan: &Plan) -> Result<String> {
    let mut text = String::from(SUBMIT);
    let threads = plan.threads.map(|n| format!(" --cpus-per-task={n}")).unwrap_or_default();
    for (i, step) in plan.steps.iter().enumerate() {
        let variable = |name: &String| {
            let number = plan.steps.iter().position(|s| s.name == *name).unwrap_or_default();
            format!("$step{number}")
        };
        let needed: Vec<String> = step.needs.iter().map(variable).collect();
        if let Some(word) = step.command.iter().find(|word| word.contains('\n')) {
            return Err(Error::Usage(format!(
                "{word:?} contains a line break, which a Slurm script cannot express"
            )));
        }
        let commands: Vec<String> = step
            .tasks()
            .iter()
            .map(|words| words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" "))
            .collect();
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "step{i}=$(submit {} \"{}\" {}{threads} \"$@\")",
            quoted(&format!("{}: {}", plan.name, step.name)),
            needed.join(":"),
            quoted(&commands.join("\n")),
        );
    }
    text.push_str("echo \"submitted\"\n");
    Ok(text)
}

/// Quotes a word for the shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}
