//! Requests to abandon a long solve.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether somebody wants a solve to be abandoned. All threads ask for it; once the answer is yes it stays so, and
/// whatever has been computed since is worth nothing. The default never asks for it.
#[derive(Clone, Default)]
pub struct Interrupt(Option<Arc<Request>>);

/// A question, and whether the answer has been yes.
struct Request {
    asks: Box<dyn Fn() -> bool + Send + Sync>,
    seen: AtomicBool,
}

impl Interrupt {
    /// Abandons a solve once `asks` returns true.
    pub fn new(asks: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Interrupt(Some(Arc::new(Request { asks: Box::new(asks), seen: AtomicBool::new(false) })))
    }

    /// True if the solve is to be abandoned.
    pub fn is_asked_for(&self) -> bool {
        let Some(request) = &self.0 else { return false };
        if !request.seen.load(Ordering::Relaxed) && (request.asks)() {
            request.seen.store(true, Ordering::Relaxed);
        }
        self.was_seen()
    }

    /// True if [`Interrupt::is_asked_for`] has been true, on any thread: a solve may have ended early.
    pub fn was_seen(&self) -> bool {
        self.0.as_ref().is_some_and(|request| request.seen.load(Ordering::Relaxed))
    }
}

impl fmt::Debug for Interrupt {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_tuple("Interrupt").field(&self.was_seen()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn a_request_stays_once_it_is_seen() {
        let asked = AtomicUsize::new(0);
        let interrupt = Interrupt::new(move || asked.fetch_add(1, Ordering::Relaxed) == 2);
        let seen = [(); 4].map(|()| (interrupt.is_asked_for(), interrupt.clone().was_seen()));
        assert_eq!(seen, [(false, false), (false, false), (true, true), (true, true)]);
        assert!(!Interrupt::default().is_asked_for());
    }
}
