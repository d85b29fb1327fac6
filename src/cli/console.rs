//! Where text goes.

use crate::error::{Diagnostic, Error, Result, render};
use clap::ValueEnum;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::OnceLock;

/// Writes data to standard output. A reader that has seen enough (`| head`) is no error.
pub fn data(bytes: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::io("standard output", e)),
        _ => Ok(()),
    }
}

/// How what is said on standard error is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum LogFormat {
    /// Lines for people
    #[default]
    Text,
    /// A JSON object a line: timestamp, level, message, and what else is known
    Json,
}

/// Whether anything but errors is said, and how.
static MANNER: OnceLock<(bool, LogFormat)> = OnceLock::new();

fn manner() -> (bool, LogFormat) {
    MANNER.get().copied().unwrap_or_default()
}

/// The format chosen at the start.
pub fn format() -> LogFormat {
    manner().1
}

/// Says something to people, or to a log, on standard error, unless asked to be quiet.
pub fn say(text: &str) {
    match manner() {
        (true, _) => {}
        (false, LogFormat::Text) => line(text),
        (false, LogFormat::Json) => tracing::info!("{text}"),
    }
}

/// Tells why the program stops.
pub fn fail(error: &Error) {
    let diagnostics = if let Error::BadInput(diagnostics) = error { &diagnostics[..] } else { &[] };
    let ending = if diagnostics.is_empty() { "" } else { "; nothing written" };
    if format() == LogFormat::Json {
        for Diagnostic { file, key, message, allowed, help, .. } in diagnostics {
            tracing::error!(file = %file.display(), key, allowed, remedy = help, "{key} {message}");
        }
        tracing::error!(exit_code = error.exit_code(), "{error}{ending}");
        return;
    }
    if !diagnostics.is_empty() {
        let colour = io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        line(render(diagnostics, colour).trim_end());
    }
    line(&format!("hairbake: {error}{ending}"));
}

/// Writes a line as it is to standard error.
pub fn line(text: &str) {
    // There is nowhere left to tell that this failed.
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Sends the library's warnings to standard error in a format, only its errors if `quiet`, and all that is said later likewise.
pub fn start(quiet: bool, format: LogFormat) {
    MANNER.get_or_init(|| (quiet, format));
    let level = match (quiet, format) {
        (true, _) => tracing::Level::ERROR,
        (false, LogFormat::Text) => tracing::Level::WARN,
        (false, LogFormat::Json) => tracing::Level::INFO,
    };
    let log = tracing_subscriber::fmt().with_writer(io::stderr).with_max_level(level).with_target(false);
    // It would tell of a closed standard error on standard error.
    let log = log.log_internal_errors(false);
    match format {
        LogFormat::Text => log.without_time().init(),
        LogFormat::Json => log.json().flatten_event(true).with_current_span(false).init(),
    }
}
