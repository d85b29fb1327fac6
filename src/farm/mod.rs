//! A bake as a graph of tasks, for the schedulers that exist: [`openjd`], [`slurm`], and JSON for all others.
//!
//! Segments of the simulation follow each other; each is followed by chunks of frames that depend on nothing else; then the cache
//! is assembled, and checked in chunks. A sweep of parameters, or wedge, is such a graph for each combination of values, and a
//! contact sheet over all.

pub mod openjd;
pub mod slurm;

use crate::{Error, Result};
use serde::Serialize;
use serde_json::{Value, json};

/// Stands for the frames of a task in [`Step::command`].
pub const FRAMES: &str = "{frames}";

/// Stands for the file of the session's path rules in [`Step::command`], for schedulers that write one.
pub const PATH_MAP: &str = "{path map}";

/// Most tasks of a plan: a limit against memory without bound.
const MAX_TASKS: usize = 1_000_000;

/// A graph of tasks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// Name of the job.
    pub name: String,
    /// Processors that a task is to use; `None` leaves it to the scheduler.
    pub threads: Option<usize>,
    /// The steps, each after all that it needs.
    pub steps: Vec<Step>,
}

/// Tasks that differ in their frames only, or a single task.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Its name, unique.
    pub name: String,
    /// The command line; [`FRAMES`] stands for the frames of the task.
    pub command: Vec<String>,
    /// First and last frame of each task; none for a single task without frames.
    pub chunks: Vec<(i32, i32)>,
    /// Names of the steps that must be done before.
    pub needs: Vec<String>,
}

/// How a bake is divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Division {
    /// First and last frame, handles included.
    pub frames: (i32, i32),
    /// Frames that the simulation has to be ahead of a frame before that can be made.
    pub ahead: i32,
    /// Frames of a segment of the simulation.
    pub segment: u32,
    /// Frames of a task that interpolates.
    pub chunk: u32,
    /// Frames of a task that validates.
    pub check: u32,
}

/// The commands of the stages of one bake; [`FRAMES`] stands for frames where a stage is divided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Commands {
    /// What the names of the steps begin with; empty for the only bake of a plan.
    pub name: String,
    /// Simulates a segment.
    pub simulate: Vec<String>,
    /// Makes a chunk of frames.
    pub interpolate: Vec<String>,
    /// Ends the cache.
    pub assemble: Vec<String>,
    /// Checks what does not move, and a chunk of frames.
    pub validate: Option<[Vec<String>; 2]>,
}

impl Plan {
    /// A plan without steps.
    pub fn new(name: &str, threads: Option<usize>) -> Self {
        Plan { name: name.into(), threads, steps: Vec::new() }
    }

    /// Adds a bake; returns the name of the step after which its cache is whole.
    ///
    /// # Errors
    /// [`Error::Usage`] where that makes too many tasks.
    pub fn add_bake(&mut self, commands: &Commands, division: Division) -> Result<String> {
        let Commands { name, simulate, interpolate, assemble, validate } = commands;
        let prefix = if name.is_empty() { String::new() } else { format!("{name} ") };
        let Division { frames: (first, last), ahead, .. } = division;
        let mut before = Vec::new();
        let mut made = Vec::new();
        for (i, segment) in chunks((first, last + ahead), division.segment).enumerate() {
            let simulated = format!("{prefix}simulate {}", i + 1);
            let frames = format!("{}-{}", segment.0, segment.1);
            let command = simulate.iter().map(|a| a.replace(FRAMES, &frames)).collect();
            self.add(Step { name: simulated.clone(), command, chunks: Vec::new(), needs: before.clone() })?;
            before = vec![simulated];
            let chunks: Vec<_> =
                chunks(((segment.0 - ahead).max(first), segment.1 - ahead), division.chunk).collect();
            if chunks.is_empty() {
                continue;
            }
            let step = format!("{prefix}interpolate {}", i + 1);
            self.add(Step {
                name: step.clone(),
                command: interpolate.clone(),
                chunks,
                needs: before.clone(),
            })?;
            made.push(step);
        }
        let whole = format!("{prefix}assemble");
        self.add(Step { name: whole.clone(), command: assemble.clone(), chunks: Vec::new(), needs: made })?;
        if let Some([still, moving]) = validate {
            let needs = vec![whole.clone()];
            let frames = chunks(division.frames, division.check).collect();
            let name = format!("{prefix}validate files");
            self.add(Step { name, command: still.clone(), chunks: Vec::new(), needs: needs.clone() })?;
            let name = format!("{prefix}validate frames");
            self.add(Step { name, command: moving.clone(), chunks: frames, needs })?;
        }
        Ok(whole)
    }

    /// Adds a step.
    ///
    /// # Errors
    /// [`Error::Usage`] where that makes too many tasks.
    pub fn add(&mut self, step: Step) -> Result<()> {
        self.steps.push(step);
        match self.steps.iter().map(|s| s.chunks.len().max(1)).sum::<usize>() {
            n if n > MAX_TASKS => {
                Err(Error::Usage(format!("more than {MAX_TASKS} tasks: ask for longer segments and chunks")))
            }
            _ => Ok(()),
        }
    }

    /// The plan as JSON, every task with its whole command line.
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

/// Frames in parts of so many.
fn chunks((first, last): (i32, i32), frames: u32) -> impl Iterator<Item = (i32, i32)> {
    let end = move |a: i64| i32::try_from(a + i64::from(frames) - 1).map_or(last, |b| b.min(last));
    let starts = (i64::from(first)..=i64::from(last)).step_by(frames.max(1) as usize);
    starts.map(move |a| (a as i32, end(a)))
}

#[cfg(test)]
mod tests;
