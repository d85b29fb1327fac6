//! A plan as a shell script that submits it to Slurm.

use super::Plan;
use crate::{Error, Result};
use std::fmt::Write;

/// What the script begins with.
const SUBMIT: &str = include_str!("submit.sh");

/// The script. Each task is a batch job that passes its signals on to hairbake: USR1 a minute before its time is up or when it is
/// preempted. It then ends with exit code 85 and is queued again, if the cluster is set up to (`RequeueExit=75,85`).
///
/// # Errors
/// [`Error::Usage`] where a word of a command holds a line break: commands are told apart by lines.
pub fn script(plan: &Plan) -> Result<String> {
    let mut text = String::from(SUBMIT);
    let threads = plan.threads.map(|n| format!(" --cpus-per-task={n}")).unwrap_or_default();
    for (i, step) in plan.steps.iter().enumerate() {
        let of = |name: &String| {
            let number = plan.steps.iter().position(|s| s.name == *name).unwrap_or_default();
            format!("$step{number}")
        };
        let needed: Vec<String> = step.needs.iter().map(of).collect();
        if let Some(word) = step.command.iter().find(|word| word.contains('\n')) {
            return Err(Error::Usage(format!(
                "{word:?} holds a line break, which divides the commands of the script"
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

/// A word as the shell reads it back.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}
