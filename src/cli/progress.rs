//! How far a stage is.

use super::console::{self, LogFormat};
use crate::bake::frame_record::FrameRecord;
use crate::error::Result;
use clap::ValueEnum;
use indicatif::ProgressBar;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Shortest time between two lines where there is no bar.
const INTERVAL: Duration = Duration::from_secs(1);

/// Who is to read the progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum ProgressStyle {
    /// A bar on a terminal, lines elsewhere
    #[default]
    Auto,
    /// Lines, at most one a second
    Lines,
    /// Lines that OpenJD reads: openjd_progress: 41.7
    Openjd,
    /// Lines that Tractor reads: ALF_PROGRESS 42%
    Alf,
    /// Nothing
    None,
}

/// A bar on a terminal; lines, at most one a second, elsewhere.
pub struct Progress {
    style: ProgressStyle,
    bar: Option<ProgressBar>,
    /// When the first frame was done: the pre-roll before it says nothing about those to come.
    first: Option<Instant>,
    /// When the last line was said.
    said: Option<Instant>,
}

impl Progress {
    /// Nothing is shown yet.
    pub fn start(quiet: bool, style: ProgressStyle) -> Self {
        let style = if quiet { ProgressStyle::None } else { style };
        let bar = style == ProgressStyle::Auto
            && console::format() == LogFormat::Text
            && std::io::stderr().is_terminal();
        let bar = bar.then(|| ProgressBar::new_spinner().with_message("settling the groom"));
        Progress { style, bar, first: None, said: None }
    }

    /// Shows how far `stage` is while it runs.
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

    /// Shows that `done` of `total` frames are on disk, the last of them as in `record`.
    fn show(&mut self, record: &FrameRecord, done: usize, total: usize) {
        if let Some(bar) = &self.bar {
            if done == 1 {
                // The pre-roll is behind; only now does the time of a frame mean something.
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
        if done < total && self.said.is_some_and(|last| now - last < INTERVAL) {
            return;
        }
        self.said = Some(now);
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
        // Nothing can be done about a bar that cannot be drawn.
        let _ = write!(out, "{:.3}", 1.0 / state.per_sec());
    };
    indicatif::ProgressStyle::with_template(template)
        .unwrap_or_else(|_| indicatif::ProgressStyle::default_bar())
        .with_key("seconds", seconds)
}
