//! The report on an imported animation.

use super::options::{RestPose, TrackOptions};
use crate::scene::Convention;
use crate::scene::anim::file::Pops;
use nalgebra::Vector3;
use std::fmt;
use std::path::PathBuf;

/// First rotation of the head that leads to a warning, degrees.
const LARGE_ROTATION: f64 = 60.0;
/// Most pops that a warning lists.
const MAX_LISTED: usize = 5;

/// The contents of a motion file and the animation made from it.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackReport {
    /// The file.
    pub path: PathBuf,
    /// Number of samples, and samples per second.
    pub samples: (usize, f64),
    /// Unit and up axis of the file.
    pub convention: Convention,
    /// First and last frame of the bake, and frames per second.
    pub frames: ([i32; 2], f64),
    /// Frame number of the first sample.
    pub first_frame: f64,
    /// The rest pose of the joint, and its position, m.
    pub rest: (RestPose, [f64; 3]),
    /// Rotation of the head in the first sample relative to the rest pose, degrees.
    pub first_rotation: f64,
    /// The pops of the motion.
    pub pops: Vec<TrackPop>,
    /// Guesses and remarks for the artist.
    pub notes: Vec<String>,
    /// What the artist should check.
    pub warnings: Vec<String>,
}

/// A pop: samples that jump as no head can move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPop {
    /// Frame of the first sample that is off, or of the first after the jump.
    pub frame: f64,
    /// Number of samples that are off; 0 if the jump lasts.
    pub samples: usize,
}

impl TrackReport {
    /// Adds notes and warnings about the rest pose, pops and ignored options.
    pub(super) fn add_warnings(&mut self, options: &TrackOptions) {
        if self.first_rotation > LARGE_ROTATION {
            self.warnings.push(format!(
                "the head is rotated by {:.0}° in the first sample: if the joint's axes are arbitrary, use --rest first",
                self.first_rotation
            ));
        }
        self.add_pops(options.pops);
        for mesh in options.colliders.iter().filter(|m| m.source.offset != Vector3::zeros()) {
            self.warnings
                .push(format!("collider {}: the offset is ignored; move the mesh itself", mesh.name));
        }
    }

    /// Says which samples pop, and what a bake does with them.
    fn add_pops(&mut self, action: Pops) {
        let (lasting, short): (Vec<_>, Vec<_>) = self.pops.iter().copied().partition(|pop| pop.samples == 0);
        let samples = match short.iter().map(|pop| pop.samples).sum::<usize>() {
            1 => "1 sample is".to_string(),
            n => format!("{n} samples are"),
        };
        let at = frames_of(&short);
        match action {
            Pops::Error if !short.is_empty() => self.warnings.push(format!(
                "{samples} off, {at}, which a bake refuses: import with --pops bridge to interpolate, \
                 with --pops keep to follow, or clean the motion"
            )),
            Pops::Bridge if !short.is_empty() => {
                self.notes.push(format!("{samples} off, {at}: a bake interpolates (--pops bridge)"));
            }
            _ => {}
        }
        if action != Pops::Keep && !lasting.is_empty() {
            self.warnings.push(format!(
                "the motion jumps {} and goes on from there, which a bake refuses: clean the motion, shorten it with \
                 --frames, or import with --pops keep to follow the jump",
                frames_of(&lasting)
            ));
        }
    }
}

/// "at frame 1001", "at frames 1001, 1007, …".
fn frames_of(pops: &[TrackPop]) -> String {
    let listed: Vec<String> = pops.iter().take(MAX_LISTED).map(|pop| pop.frame.to_string()).collect();
    let plural = if pops.len() == 1 { "" } else { "s" };
    let more = if pops.len() > MAX_LISTED { ", …" } else { "" };
    format!("at frame{plural} {}{more}", listed.join(", "))
}

impl fmt::Display for TrackReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (samples, rate) = self.samples;
        let ([first, last], fps) = self.frames;
        writeln!(
            f,
            "{}: {samples} samples at {rate} per second, {:.2} s",
            self.path.display(),
            samples as f64 / rate
        )?;
        writeln!(f, "  1 unit = {} m, {:?} up", self.convention.metres_per_unit, self.convention.up)?;
        writeln!(
            f,
            "  frames {first} to {last} at {fps} per second; the first sample is frame {}",
            self.first_frame
        )?;
        let (rest, [x, y, z]) = self.rest;
        let orientation = match rest {
            RestPose::Bind => "oriented as in the file",
            RestPose::World => "aligned with the world axes",
            RestPose::First => "oriented as in the first sample",
        };
        writeln!(f, "  rest pose: joint at ({x:.3}, {y:.3}, {z:.3}) m, {orientation}")?;
        writeln!(f, "  the first sample rotates the head by {:.0}° from the rest pose", self.first_rotation)?;
        self.notes.iter().try_for_each(|note| writeln!(f, "  {note}"))?;
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}
