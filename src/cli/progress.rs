//! The progress of a stage.

use super::console::{self, LogFormat};
use crate::bake::frame_record::FrameRecord;
use crate::error::Result;
use clap::ValueEnum;
use indicatif::ProgressBar;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Shortest time between two lines.
const INTERVAL: Duration = Duration::from_secs(1);

/// How progress is reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum ProgressStyle {
    /// A bar on a terminal, else lines
    #[default]
    Auto,
    /// At most one line per second
    Lines,
    /// Lines for OpenJD, as in openjd_progress: 41.7
    Openjd,
    /// Lines for Tractor, as in ALF_PROGRESS 42%
    Alf,
    /// No progress
    None,
}

/// Reports the progress of a stage.
pub struct Progress {
    style: ProgressStyle,
    bar: Option<ProgressBar>,
    /// When the first frame was done. The pre-roll before it does not count for the time per frame.
    first: Option<Instant>,
    /// When the last line was printed.
    printed: Option<Instant>,
}

impl Progress {
    /// Prepares the report; shows nothing yet.
    pub fn start(quiet: bool, style: ProgressStyle) -> Self {
        let style = if quiet { ProgressStyle::None } else { style };
        let bar = style == ProgressStyle::Auto
            && console::format() == LogFormat::Text
            && std::io::stderr().is_terminal();
        let bar = bar.then(|| ProgressBar::new_spinner().with_message("pre-roll"));
        Progress { style, bar, first: None, printed: None }
    }

    /// Runs `stage` and shows its progress.
    pub fn through<T>(
        mut self,
        stage: impl FnOnce(&mut dyn FnMut(&FrameRecord, usize, usize)) -> Result<T>,
    ) -> Result<T> {
        if let Some(bar) = &self.bar {
            bar.enable_steady_tick(Duration::from_millis(100));
        }
        let result = stage(&mut |record, done, total| self.show(record, done, total));
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
        result
    }

    /// Shows that `done` of `total` frames are written, the last one with the figures in `record`.
    fn show(&mut self, record: &FrameRecord, done: usize, total: usize) {
        if let Some(bar) = &self.bar {
            if done == 1 {
                // The time per frame starts after the pre-roll.
                bar.reset();
                bar.set_length(total as u64);
                bar.set_style(bar_style());
            }
            bar.set_position(done as u64);
            bar.set_message(format!("frame {}, {} contacts", record.frame, record.contacts_active));
            return;
        }
        let now = Instant::now();
        let first = *self.first.get_or_insert(now);
        if done < total && self.printed.is_some_and(|last| now - last < INTERVAL) {
            return;
        }
        self.printed = Some(now);
        let percent = 100.0 * done as f64 / total as f64;
        let pace = match done {
            0 | 1 => String::new(),
            _ => format!("{:.3} s/frame, ", (now - first).as_secs_f64() / (done - 1) as f64),
        };
        let line =
            format!("frame {} ({done} of {total}), {pace}{} contacts", record.frame, record.contacts_active);
        match (self.style, console::format()) {
            (ProgressStyle::None, _) => {}
            (ProgressStyle::Openjd, _) => console::line(&format!("openjd_progress: {percent:.1}")),
            (ProgressStyle::Alf, _) => console::line(&format!("ALF_PROGRESS {percent:.0}%")),
            (_, LogFormat::Json) => tracing::info!(frame = record.frame, done, total, percent, "{line}"),
            (_, LogFormat::Text) => console::line(&line),
        }
    }
}

fn bar_style() -> indicatif::ProgressStyle {
    let template = "{wide_bar:.cyan} {pos}/{len} frames, {seconds} s/frame, {eta} left, {msg}";
    let seconds = |state: &indicatif::ProgressState, out: &mut dyn std::fmt::Write| {
        // A bar that cannot be drawn is not an error.
        let _ = write!(out, "{:.3}", 1.0 / state.per_sec());
    };
    indicatif::ProgressStyle::with_template(template)
        .unwrap_or_else(|_| indicatif::ProgressStyle::default_bar())
        .with_key("seconds", seconds)
}
