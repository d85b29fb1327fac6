//! Where text goes.

use crate::error::{Error, Result};
use std::io::{self, ErrorKind, Write};

/// Writes data to standard output. A reader that has seen enough (`| head`) is no error.
pub fn data(bytes: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::io("standard output", e)),
        _ => Ok(()),
    }
}

/// Writes a line for people to standard error.
pub fn say(line: &str) {
    // There is nowhere left to tell that this failed.
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// Sends the library's warnings to standard error; only its errors if `quiet`.
pub fn log(quiet: bool) {
    let level = if quiet { tracing::Level::ERROR } else { tracing::Level::WARN };
    tracing_subscriber::fmt()
        .with_writer(io::stderr)
        .with_max_level(level)
        .with_target(false)
        .without_time()
        .init();
}
