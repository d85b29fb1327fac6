//! A plan: steps of tasks with their dependencies.

use crate::{Error, Result};
use serde::Serialize;
use serde_json::{Value, json};

/// Placeholder in [`Step::command`] for the frames of a task.
pub const FRAMES: &str = "{frames}";

/// Placeholder in [`Step::command`] for the file of path map rules that the scheduler writes.
pub const PATH_MAP: &str = "{path map}";

/// Most tasks of a plan. Bounds the memory.
const MAX_TASKS: usize = 1_000_000;

/// A graph of tasks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// Name of the job.
    pub name: String,
    /// Processors per task; `None` leaves it to the scheduler.
    pub threads: Option<usize>,
    /// The steps, each after the steps that it needs.
    pub steps: Vec<Step>,
}

/// A single task, or tasks that differ only in their frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Unique name.
    pub name: String,
    /// The command line, with [`FRAMES`] for the frames of the task.
    pub command: Vec<String>,
    /// First and last frame of each task; empty for a single task without frames.
    pub chunks: Vec<(i32, i32)>,
    /// Names of the steps that must be done first.
    pub needs: Vec<String>,
}

/// How a bake is divided into tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Division {
    /// First and last frame, including handle frames.
    pub frames: (i32, i32),
    /// How many frames past a frame must be simulated before it can be interpolated.
    pub lookahead: i32,
    /// Frames per segment of the simulation.
    pub segment: u32,
    /// Frames per task that interpolates.
    pub interpolate: u32,
    /// Frames per task that validates.
    pub validate: u32,
}

/// The commands of the stages of one bake, with [`FRAMES`] for the frames of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Commands {
    /// Prefix of the names of the steps; empty for the only bake of a plan.
    pub name: String,
    /// Simulates a segment.
    pub simulate: Vec<String>,
    /// Writes a chunk of frames.
    pub interpolate: Vec<String>,
    /// Finishes the cache.
    pub assemble: Vec<String>,
    /// Validates the cache.
    pub validate: Option<ValidateCommands>,
}

/// The commands that validate a cache.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ValidateCommands {
    /// Validates files, metadata, topology and checksums.
    pub files: Vec<String>,
    /// Validates a chunk of frames.
    pub frames: Vec<String>,
}

impl Plan {
    /// A plan without steps.
    pub fn new(name: &str, threads: Option<usize>) -> Self {
        Plan { name: name.into(), threads, steps: Vec::new() }
    }

    /// Adds a bake. Returns the name of the step that finishes its cache.
    ///
    /// # Errors
    /// [`Error::Usage`] for too many tasks.
    pub fn add_bake(&mut self, commands: &Commands, division: Division) -> Result<String> {
        let prefix = match &*commands.name {
            "" => String::new(),
            name => format!("{name} "),
        };
        let interpolated = self.add_segments(&prefix, commands, division)?;
        let assembled = format!("{prefix}assemble");
        self.add(Step {
            name: assembled.clone(),
            command: commands.assemble.clone(),
            chunks: Vec::new(),
            needs: interpolated,
        })?;
        if let Some(ValidateCommands { files, frames }) = &commands.validate {
            let needs = vec![assembled.clone()];
            let name = format!("{prefix}validate files");
            self.add(Step { name, command: files.clone(), chunks: Vec::new(), needs: needs.clone() })?;
            let name = format!("{prefix}validate frames");
            let chunks = chunks(division.frames, division.validate).collect();
            self.add(Step { name, command: frames.clone(), chunks, needs })?;
        }
        Ok(assembled)
    }

    /// Adds the simulation in segments, and after each segment the interpolation of the frames that it
    /// allows. Returns the names of the steps that interpolate.
    fn add_segments(&mut self, prefix: &str, commands: &Commands, division: Division) -> Result<Vec<String>> {
        let Division { frames: (first, last), lookahead, .. } = division;
        let mut needs = Vec::new();
        let mut interpolated = Vec::new();
        for (i, segment) in chunks((first, last + lookahead), division.segment).enumerate() {
            let simulated = format!("{prefix}simulate {}", i + 1);
            let frames = format!("{}-{}", segment.0, segment.1);
            let command = commands.simulate.iter().map(|word| word.replace(FRAMES, &frames)).collect();
            self.add(Step { name: simulated.clone(), command, chunks: Vec::new(), needs })?;
            needs = vec![simulated];
            let ready = ((segment.0 - lookahead).max(first), segment.1 - lookahead);
            let chunks: Vec<_> = chunks(ready, division.interpolate).collect();
            if chunks.is_empty() {
                continue;
            }
            let name = format!("{prefix}interpolate {}", i + 1);
            let command = commands.interpolate.clone();
            self.add(Step { name: name.clone(), command, chunks, needs: needs.clone() })?;
            interpolated.push(name);
        }
        Ok(interpolated)
    }

    /// Adds a step.
    ///
    /// # Errors
    /// [`Error::Usage`] for too many tasks.
    pub fn add(&mut self, step: Step) -> Result<()> {
        self.steps.push(step);
        match self.steps.iter().map(|s| s.chunks.len().max(1)).sum::<usize>() {
            n if n > MAX_TASKS => {
                Err(Error::Usage(format!("more than {MAX_TASKS} tasks; use longer segments and chunks")))
            }
            _ => Ok(()),
        }
    }

    /// The plan as JSON, with the complete command line of every task.
    pub fn to_json(&self) -> Value {
        let steps: Vec<Value> = self
            .steps
            .iter()
            .map(|step| json!({ "name": step.name, "needs": step.needs, "tasks": step.tasks() }))
            .collect();
        json!({ "format": "hairbake-plan", "version": 1, "name": self.name, "threads": self.threads, "steps": steps })
    }
}

impl Step {
    /// The command line of each task.
    pub fn tasks(&self) -> Vec<Vec<String>> {
        if self.chunks.is_empty() {
            return vec![self.command.clone()];
        }
        let task = |(a, b): &(i32, i32)| {
            self.command.iter().map(|word| word.replace(FRAMES, &format!("{a}-{b}"))).collect()
        };
        self.chunks.iter().map(task).collect()
    }
}

/// Divides the frames `first` to `last` into ranges of `size` frames; the last may be shorter.
fn chunks((first, last): (i32, i32), size: u32) -> impl Iterator<Item = (i32, i32)> {
    let end = move |a: i64| i32::try_from(a + i64::from(size) - 1).map_or(last, |b| b.min(last));
    let starts = (i64::from(first)..=i64::from(last)).step_by(size.max(1) as usize);
    starts.map(move |a| (a as i32, end(a)))
}
