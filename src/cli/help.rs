//! The layout of the help: commands in groups, general options once, defaults and variables in one form.

use clap::builder::StyledStr;
use clap::builder::styling::{AnsiColor, Styles};
use clap::{Arg, Command};
use std::fmt::Write;

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Green.on_default().bold())
    .usage(AnsiColor::Green.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

/// The commands by group.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Prepare a shot", &["sample", "import", "grow", "check", "schema", "estimate"]),
    ("Bake", &["bake"]),
    ("Inspect a cache", &["preview", "view", "read", "status", "validate"]),
    ("Render farm", &["plan", "simulate", "interpolate", "assemble"]),
    ("Shell", &["completions", "man", "help"]),
];

const USAGE: &str = "\
hairbake <GROOM> <ANIM> --output <DIR> [OPTIONS]
       hairbake <COMMAND> [OPTIONS]";

const EXAMPLES: &str = "\
Examples:
  Make a sample, bake it and look at it:
    hairbake sample short -o short
    hairbake short/groom.json short/shake.json -o out
    xdg-open out/sheet.png
  Import a groom, its head and a head motion, then bake:
    hairbake import groom hair.tfx --units cm --head bust.obj:cm -o groom.json
    hairbake import track walk.json --groom groom.json --collider bust.obj:cm -o anim.json
    hairbake groom.json anim.json -o out

Exit codes:
   0  done, or already up to date
   1  a guarantee is broken (--strict), or a check failed (validate)
  64  wrong usage; also no command, which prints this help
  65  bad input
  70  internal error
  74  reading or writing failed
  75  the output of an earlier stage is missing; try again later
  78  the environment is not set up
  85  stopped on request (TERM, INT, USR1, --max-runtime); run again to resume

Run `hairbake help COMMAND` for the options of a command.";

const POINTER: &str = "General options (--threads, --progress, --log-format, --quiet): see hairbake --help";

/// Lays out the help of the program and of all its commands.
pub fn lay_out(command: Command) -> Command {
    let general: Vec<Arg> =
        command.get_arguments().filter(|a| a.is_global_set()).map(|a| a.clone().hide(true)).collect();
    let template = template(&command);
    command
        .styles(STYLES)
        .mut_args(annotate)
        .mut_subcommands(|below| lay_out_subcommand(below, &general))
        .override_usage(USAGE)
        .help_template(template)
        .after_help(styled(EXAMPLES))
}

/// The general options work after every command, but only the program's help lists them.
fn lay_out_subcommand(command: Command, general: &[Arg]) -> Command {
    let after = command.get_after_help().map(|text| format!("{text}\n\n")).unwrap_or_default();
    command
        .args(general)
        .mut_args(annotate)
        .mut_subcommands(|below| lay_out_subcommand(below, general))
        .after_help(styled(&(after + POINTER)))
}

/// The help of the program, with its commands in groups.
fn template(command: &Command) -> StyledStr {
    let (header, literal) = (STYLES.get_header(), STYLES.get_literal());
    let mut text = String::from("{about-with-newline}\n{usage-heading} {usage}\n");
    for (heading, names) in GROUPS {
        // Writing to a string does not fail.
        let _ = writeln!(text, "\n{header}{heading}:{header:#}");
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about);
            let about = about.map_or("Print the help of a command".into(), ToString::to_string);
            let _ = writeln!(text, "  {literal}{name:<12}{literal:#} {about}");
        }
    }
    let _ = write!(text, "\n{header}General options:{header:#}\n{{options}}{{after-help}}");
    text.into()
}

/// Appends default and environment variable to the first paragraph of an option's help.
fn annotate(mut argument: Arg) -> Arg {
    let takes_values = argument.get_action().takes_values();
    let mut notes = String::new();
    let defaults = argument.get_default_values();
    if takes_values && !defaults.is_empty() {
        let defaults: Vec<_> = defaults.iter().map(|value| value.to_string_lossy()).collect();
        notes += &format!(" [default: {}]", defaults.join(","));
    }
    if let Some(variable) = argument.get_env() {
        notes += &format!(" [env: {}]", variable.to_string_lossy());
    }
    if let Some(short) = argument.get_help().map(ToString::to_string) {
        if let Some(long) = argument.get_long_help().map(ToString::to_string) {
            let (first, others) = long.split_once("\n\n").unwrap_or((&long, ""));
            argument = argument.long_help(format!("{first}{notes}\n\n{others}").trim_end().to_string());
        }
        argument = argument.help(short + &notes);
    }
    argument.hide_default_value(takes_values).hide_env(takes_values)
}

/// Text with its headings, which are lines that end in a colon and are not indented, in the headings' style.
fn styled(text: &str) -> StyledStr {
    let header = STYLES.get_header();
    let style = |line: &str| match line.ends_with(':') && !line.starts_with(' ') {
        true => format!("{header}{line}{header:#}"),
        false => line.to_string(),
    };
    text.lines().map(style).collect::<Vec<_>>().join("\n").into()
}
