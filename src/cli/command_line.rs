//! Parses the command line: the default command and suggestions for mistyped commands.

use super::arguments::Arguments;
use super::help;
use clap::builder::Resettable;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{ArgMatches, Command, CommandFactory, FromArgMatches};
use std::ffi::{OsStr, OsString};
use std::path::Path;

/// The command that is meant if none is named.
pub const DEFAULT_COMMAND: &str = "bake";

/// The whole command line with its help.
pub fn command() -> Command {
    help::lay_out(Arguments::command())
}

/// Parses `words`, the first of which is the program.
///
/// If the first word after the general options is a file or an option, [`DEFAULT_COMMAND`] is inserted before
/// it.
///
/// # Errors
/// Wrong usage, or a request for help or the version. A line without a command yields the help on standard
/// error: a script whose arguments expand to nothing must not seem to succeed.
pub fn parse(mut words: Vec<OsString>) -> Result<(Arguments, ArgMatches), clap::Error> {
    let command = command();
    let at = skip_general_options(&command, &words);
    let Some(word) = words.get(at) else {
        // Variables of the environment count as arguments, and would replace the help by an error.
        let bare = command.mut_args(|argument| argument.env(Resettable::Reset));
        return parse_as(bare, &words[..words.len().min(1)]);
    };
    if is_command_or_help(&command, word) {
        return parse_as(command, &words);
    }
    if is_file_or_option(word) {
        words.insert(at, DEFAULT_COMMAND.into());
        return parse_as(command, &words);
    }
    parse_as(command.clone(), &words).or_else(|error| {
        if error.get(ContextKind::SuggestedSubcommand).is_some() {
            return Err(error);
        }
        // Not similar to a command: a file that does not exist, if the rest of the line fits.
        words.insert(at, DEFAULT_COMMAND.into());
        parse_as(command, &words).map_err(|_| error)
    })
}

fn parse_as(mut command: Command, words: &[OsString]) -> Result<(Arguments, ArgMatches), clap::Error> {
    let matches = command.try_get_matches_from_mut(words);
    matches.and_then(|matches| Ok((Arguments::from_arg_matches(&matches)?, matches))).map_err(|error| {
        match error.kind() {
            ErrorKind::InvalidSubcommand => unknown_command(&error, command, words),
            _ => error,
        }
    })
}

/// The error for an unknown command, with the most similar one.
fn unknown_command(error: &clap::Error, mut command: Command, words: &[OsString]) -> clap::Error {
    let text = |kind: ContextKind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        // The most similar one is the last.
        Some(ContextValue::Strings(texts)) => texts.last().cloned(),
        _ => None,
    };
    let unknown = text(ContextKind::InvalidSubcommand).unwrap_or_default();
    let similar = text(ContextKind::SuggestedSubcommand);
    let mut message = format!("unknown command `{unknown}`");
    if let Some(similar) = &similar {
        message += &format!("; did you mean `{similar}`?");
    }
    // The usage is that of the innermost command.
    for word in words.iter().skip(1).take_while(|word| **word != *unknown) {
        if let Some(found) = word.to_str().and_then(|word| command.find_subcommand(word)) {
            command = found.clone();
        }
    }
    let mut shown = command.error(ErrorKind::InvalidSubcommand, message);
    if let Some(similar) = similar {
        shown.insert(ContextKind::SuggestedSubcommand, ContextValue::String(similar));
    }
    shown
}

/// Index of the first word that is neither the program nor a general option with its value.
fn skip_general_options(command: &Command, words: &[OsString]) -> usize {
    let general = |word: &str| {
        let long = word.strip_prefix("--").map(|long| long.split_once('=').map_or(long, |(name, _)| name));
        command.get_arguments().filter(|option| option.is_global_set()).find(|option| match long {
            Some(long) => option.get_long() == Some(long),
            None => option.get_short().is_some_and(|short| word == format!("-{short}")),
        })
    };
    let mut at = 1;
    while let Some(word) = words.get(at).and_then(|word| word.to_str()) {
        let Some(option) = general(word) else { break };
        at += if option.get_action().takes_values() && !word.contains('=') { 2 } else { 1 };
    }
    at
}

fn is_command_or_help(command: &Command, word: &OsStr) -> bool {
    let Some(word) = word.to_str() else { return false };
    matches!(word, "help" | "-h" | "--help" | "-V" | "--version") || command.find_subcommand(word).is_some()
}

fn is_file_or_option(word: &OsStr) -> bool {
    let text = word.to_string_lossy();
    text.starts_with('-') || text.contains(['.', '/', '\\']) || Path::new(word).exists()
}

#[cfg(test)]
mod tests {
    use super::super::arguments::Command as Parsed;
    use super::*;

    fn parsed(line: &str) -> Result<Arguments, clap::Error> {
        parse(line.split(' ').map(OsString::from).collect()).map(|(arguments, _)| arguments)
    }

    #[test]
    fn general_options_may_stand_anywhere() {
        for line in [
            "hairbake -q check a",
            "hairbake check -q a",
            "hairbake check a -q",
            "hairbake -q import groom a -o b",
            "hairbake import -q groom a -o b",
            "hairbake import groom a -o b -q",
            "hairbake -q a.json b.json -o c",
            "hairbake a.json b.json -o c -q",
            "hairbake --threads 2 --progress=lines -q man",
        ] {
            assert!(parsed(line).unwrap().general.quiet, "{line}");
        }
        let general = parsed("hairbake --threads 2 --progress=alf bake a b -o c").unwrap().general;
        assert_eq!(general.threads, Some(2));
        assert_eq!(general.progress, super::super::progress::ProgressStyle::Alf);
    }

    #[test]
    fn bake_is_the_default_command() {
        for line in [
            "hairbake a.json b.json -o c",
            "hairbake bake a.json b.json -o c",
            "hairbake -o c a b",
            "hairbake --substeps 3 a b -o check",
            "hairbake --threads 3 a.json check -o c",
            "hairbake shot/a b -o c",
            "hairbake sources b -o c",
        ] {
            assert!(matches!(parsed(line).unwrap().command, Parsed::Bake(_)), "{line}");
        }
    }

    #[test]
    fn similar_commands_are_suggested() {
        for (line, similar) in [
            ("hairbake chek a.json", "check"),
            ("hairbake previw out", "preview"),
            ("hairbake -q statsu out", "status"),
            ("hairbake bak a.json b.json -o c", "bake"),
            ("hairbake import grom a -o b", "groom"),
        ] {
            let error = parsed(line).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidSubcommand);
            assert!(error.to_string().contains(&format!("did you mean `{similar}`?")), "{error}");
        }
        let error = parsed("hairbake frobnicate").unwrap_err().to_string();
        assert!(error.contains("unknown command `frobnicate`") && !error.contains("did you mean"), "{error}");
    }

    #[test]
    fn a_line_without_a_command_prints_help_to_standard_error() {
        for line in ["hairbake", "hairbake -q", "hairbake --threads 2"] {
            let error = parsed(line).unwrap_err();
            assert!(error.use_stderr() && error.to_string().contains("Render farm:"), "{error}");
        }
    }

    #[test]
    fn former_names_of_options_work() {
        for line in [
            "hairbake a.json b.json -o c --parting 0.01",
            "hairbake plan a.json b.json -o c --parting 0.01",
            "hairbake import groom a -o b --per-guide 9 --shorter 0.1 --coarse 9 --leaves 99",
            "hairbake import track a -o b --smoothing 9",
            "hairbake sample short -o a --head-rounds 2",
            "hairbake preview a -o b --color level",
        ] {
            assert!(parsed(line).is_ok(), "{line}");
        }
    }

    /// A command and all below it, except `help`.
    fn all_commands(command: &Command) -> Vec<Command> {
        let below =
            command.get_subcommands().filter(|below| below.get_name() != "help").flat_map(all_commands);
        std::iter::once(command.clone()).chain(below).collect()
    }

    #[test]
    fn the_examples_of_the_help_are_valid_command_lines() {
        let mut checked = 0;
        for command in all_commands(&command()) {
            let text =
                command.get_after_help().map(ToString::to_string).unwrap_or_default().replace("\\\n", " ");
            for line in text.lines().map(str::trim).filter(|line| line.starts_with("hairbake ")) {
                // Prose of the help names commands too.
                if line.starts_with("hairbake runs") {
                    continue;
                }
                let line = [" >", " |", " #"].iter().fold(line, |line, end| line.split(end).next().unwrap());
                let words: Vec<OsString> = line.split_whitespace().map(OsString::from).collect();
                assert!(parse(words).is_ok(), "{}: {line}", command.get_name());
                checked += 1;
            }
        }
        assert!(checked > 30, "{checked} examples");
    }

    #[test]
    fn the_help_of_a_command_leaves_out_the_general_options() {
        let mut command = command();
        command.build();
        let root = command.render_long_help().to_string();
        for option in ["--threads", "--progress", "--log-format", "--quiet"] {
            assert!(root.contains(option));
        }
        assert!(root.lines().count() <= 100, "{} lines", root.lines().count());
        for mut below in all_commands(&command).into_iter().skip(1) {
            let help = below.render_long_help().to_string();
            assert!(help.contains("General options (--threads") && !help.contains("  --threads"), "{help}");
        }
    }

    #[test]
    fn the_help_lists_every_command_once() {
        let mut command = command();
        command.build();
        let help = command.render_help().to_string();
        for below in command.get_subcommands() {
            let name = format!("\n  {} ", below.get_name());
            assert_eq!(help.matches(&name).count(), 1, "{name}");
        }
    }

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }
}
