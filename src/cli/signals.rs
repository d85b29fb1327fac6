//! Signals that stop a stage or make it save.

use crate::error::{Error, Result};
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Installs the handlers: INT, TERM and USR1 set `stop`, and end the process if it is already set; HUP sets
/// `save`.
///
/// # Errors
/// [`Error::Config`] if the system refuses a handler.
pub fn listen(stop: &Arc<AtomicBool>, save: &Arc<AtomicBool>) -> Result<()> {
    handle(stop.clone(), save.clone()).map_err(|e| Error::Config(format!("cannot handle signals: {e}")))
}

/// One thread takes the signals one after another. Handlers on the threads that signals interrupt could both find
/// the flag unset when two signals come together, and the second would end nothing.
#[cfg(unix)]
fn handle(stop: Arc<AtomicBool>, save: Arc<AtomicBool>) -> io::Result<()> {
    use signal_hook::consts::signal::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
    use std::sync::atomic::Ordering::SeqCst;
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGUSR1, SIGHUP])?;
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        for signal in signals.forever() {
            if signal == SIGHUP {
                save.store(true, SeqCst);
            } else if stop.swap(true, SeqCst) {
                signal_hook::low_level::exit(128 + signal);
            }
        }
    })?;
    Ok(())
}

#[cfg(not(unix))]
fn handle(stop: Arc<AtomicBool>, _save: Arc<AtomicBool>) -> io::Result<()> {
    use signal_hook::consts::signal::{SIGINT, SIGTERM};
    use signal_hook::flag;
    for signal in [SIGINT, SIGTERM] {
        // In this order, so that the first signal finds the flag unset.
        flag::register_conditional_shutdown(signal, 128 + signal, stop.clone())?;
        flag::register(signal, stop.clone())?;
    }
    Ok(())
}
