//! When a stage saves and stops.

use super::scene_changes::FARM;
use super::{signals, values};
use crate::bake::control::Control;
use crate::error::Result;
use clap::Args;
use std::time::{Duration, Instant};

/// The limits of a run as they are typed.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// Save and stop after this time, with exit code 85 [default: no limit]
    ///
    /// Seconds, or a time such as 90m or 1h30m. The same command resumes the bake.
    #[arg(long, value_name = "TIME", value_parser = values::duration, env = "HAIRBAKE_MAX_RUNTIME", help_heading = FARM)]
    max_runtime: Option<Duration>,
    /// Time between checkpoints, in seconds; 0 for none
    ///
    /// A killed process loses at most this much work. Lowering it costs more writing.
    #[arg(long, value_name = "SECONDS", value_parser = values::not_negative, default_value_t = 30.0, env = "HAIRBAKE_CHECKPOINT_SECONDS", help_heading = FARM)]
    checkpoint_seconds: f64,
    /// Also write a checkpoint at every frame that is a multiple of N [default: none]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = FARM)]
    checkpoint_frames: Option<u32>,
}

impl RunArguments {
    /// The control of a stage. From now on it also obeys the signals of the system.
    ///
    /// # Errors
    /// [`crate::Error::Config`] if the system refuses the signal handlers.
    pub fn control(&self) -> Result<Control> {
        let every = Some(self.checkpoint_seconds).filter(|s| *s > 0.0);
        let control = Control {
            until: self.max_runtime.map(|time| Instant::now() + time),
            every: every.and_then(|s| Duration::try_from_secs_f64(s).ok()),
            every_frames: self.checkpoint_frames,
            ..Control::default()
        };
        signals::listen(&control.stop, &control.save)?;
        Ok(control)
    }
}
