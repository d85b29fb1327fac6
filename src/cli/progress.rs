//! How far a bake is.

use super::console;
use crate::bake::record::FrameRecord;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Shortest time between two lines where there is no bar.
const INTERVAL: Duration = Duration::from_secs(1);

/// A bar on a terminal; lines, at most one a second, elsewhere.
pub enum Progress {
    /// Nothing is shown.
    Quiet,
    /// On a terminal.
    Bar(ProgressBar),
    /// In a log.
    Lines {
        /// When the first frame was done: the pre-roll before it says nothing about those to come.
        first: Option<Instant>,
        /// When the last line was said.
        said: Option<Instant>,
    },
}

impl Progress {
    /// Starts to show a bake.
    pub fn start(quiet: bool) -> Self {
        if quiet {
            Progress::Quiet
        } else if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new_spinner().with_message("settling the groom");
            bar.enable_steady_tick(Duration::from_millis(100));
            Progress::Bar(bar)
        } else {
            Progress::Lines { first: None, said: None }
        }
    }

    /// Shows that `done` of `total` frames are on disk, the last of them as in `record`.
    pub fn show(&mut self, record: &FrameRecord, done: usize, total: usize) {
        match self {
            Progress::Quiet => {}
            Progress::Bar(bar) => {
                if done == 1 {
                    // The pre-roll is behind; only now does the time of a frame mean something.
                    bar.reset();
                    bar.set_length(total as u64);
                    bar.set_style(style());
                }
                bar.set_position(done as u64);
                bar.set_message(format!("frame {}, {} contacts", record.frame, record.contacts_active));
            }
            Progress::Lines { first, said } => {
                let now = Instant::now();
                let first = *first.get_or_insert(now);
                if done < total && said.is_some_and(|last| now - last < INTERVAL) {
                    return;
                }
                *said = Some(now);
                let pace = match done {
                    0 | 1 => String::new(),
                    _ => format!("{:.3} s/frame, ", (now - first).as_secs_f64() / (done - 1) as f64),
                };
                console::say(&format!(
                    "frame {} ({done} of {total}), {pace}{} contacts",
                    record.frame, record.contacts_active
                ));
            }
        }
    }

    /// Ends the show.
    pub fn finish(self) {
        if let Progress::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

fn style() -> ProgressStyle {
    let template = "{wide_bar:.cyan} {pos}/{len} frames, {seconds} s/frame, {eta} left, {msg}";
    let seconds = |state: &indicatif::ProgressState, out: &mut dyn std::fmt::Write| {
        // Nothing can be done about a bar that cannot be drawn.
        let _ = write!(out, "{:.3}", 1.0 / state.per_sec());
    };
    ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .with_key("seconds", seconds)
}
