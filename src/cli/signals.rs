//! Signals that stop a stage or make it save.

use crate::error::{Error, Result};
#[cfg(unix)]
use signal_hook::consts::signal::{SIGHUP, SIGUSR1};
use signal_hook::consts::signal::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

#[cfg(unix)]
const STOPPING: [i32; 3] = [SIGINT, SIGTERM, SIGUSR1];
#[cfg(not(unix))]
const STOPPING: [i32; 2] = [SIGINT, SIGTERM];

/// Installs the handlers: INT, TERM and USR1 set `stop`, and end the process if it is already set; HUP sets
/// `save`.
///
/// # Errors
/// [`Error::Config`] if the system refuses a handler.
pub fn listen(stop: &Arc<AtomicBool>, save: &Arc<AtomicBool>) -> Result<()> {
    let refused = |e| Error::Config(format!("cannot handle signals: {e}"));
    for signal in STOPPING {
        // In this order, so that the first signal finds the flag unset.
        flag::register_conditional_shutdown(signal, 128 + signal, stop.clone()).map_err(refused)?;
        flag::register(signal, stop.clone()).map_err(refused)?;
    }
    #[cfg(unix)]
    flag::register(SIGHUP, save.clone()).map_err(refused)?;
    #[cfg(not(unix))]
    let _ = save;
    Ok(())
}
