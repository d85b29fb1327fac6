//! Output to the console: data on standard output, messages on standard error.

use crate::error::{Diagnostic, Error, Result, render};
use clap::ValueEnum;
use clap::builder::styling::{AnsiColor, Style};
use std::fmt;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::sync::OnceLock;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

const ERROR: Style = AnsiColor::Red.on_default().bold();
const WARNING: Style = AnsiColor::Yellow.on_default().bold();

/// Format of the messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum LogFormat {
    /// Plain text
    #[default]
    Text,
    /// One JSON object per line: timestamp, level, message and other fields
    Json,
}

/// What [`start`] set.
#[derive(Debug, Clone, Copy, Default)]
struct Console {
    quiet: bool,
    format: LogFormat,
}

static CONSOLE: OnceLock<Console> = OnceLock::new();

fn console() -> Console {
    CONSOLE.get().copied().unwrap_or_default()
}

/// Sets the format of the messages, and sends the library's warnings to standard error. If `quiet`, only
/// errors are printed.
pub fn start(quiet: bool, format: LogFormat) {
    CONSOLE.get_or_init(|| Console { quiet, format });
    let level = match (quiet, format) {
        (true, _) => Level::ERROR,
        (false, LogFormat::Text) => Level::WARN,
        (false, LogFormat::Json) => Level::INFO,
    };
    let log = tracing_subscriber::fmt().with_writer(io::stderr).with_max_level(level).with_target(false);
    // It would report a closed standard error on standard error.
    let log = log.log_internal_errors(false);
    match format {
        LogFormat::Text => log.event_format(PlainText).init(),
        LogFormat::Json => log.json().flatten_event(true).with_current_span(false).init(),
    }
}

/// The format of the messages.
pub fn format() -> LogFormat {
    console().format
}

/// Writes data to standard output. A reader that closes it early, such as `| head`, is not an error.
///
/// # Errors
/// [`Error::Io`].
pub fn data(bytes: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::io("standard output", e)),
        _ => Ok(()),
    }
}

/// Prints a message, unless quiet.
pub fn say(text: &str) {
    match console() {
        Console { quiet: true, .. } => {}
        Console { format: LogFormat::Text, .. } => line(text),
        Console { format: LogFormat::Json, .. } => tracing::info!("{text}"),
    }
}

/// Prints a warning, unless quiet.
pub fn warn(text: &str) {
    tracing::warn!("{text}");
}

/// Prints that a file or folder was written, unless quiet.
pub fn wrote(path: &Path) {
    say(&format!("wrote {}", path.display()));
}

/// Prints why the program fails.
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
        line(render(diagnostics, is_coloured()).trim_end());
    }
    line(&format!("{} {error}{ending}", label("error:", ERROR)));
}

/// Writes a line to standard error.
pub fn line(text: &str) {
    // A failure could not be reported anywhere.
    let _ = writeln!(io::stderr().lock(), "{text}");
}

fn is_coloured() -> bool {
    io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

fn label(text: &str, style: Style) -> String {
    if is_coloured() { format!("{style}{text}{style:#}") } else { text.into() }
}

/// Messages of the library as `warning: text`.
struct PlainText;

impl<S, N> FormatEvent<S, N> for PlainText
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let label = match *event.metadata().level() {
            Level::ERROR => label("error:", ERROR),
            _ => label("warning:", WARNING),
        };
        write!(writer, "{label} ")?;
        context.field_format().format_fields(writer.by_ref(), event)?;
        writeln!(writer)
    }
}
