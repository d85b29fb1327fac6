//! The report on an imported animation.

use super::options::{RestPose, TrackOptions};
use crate::scene::Convention;
use crate::scene::anim::file::Pops;
use nalgebra::Vector3;
use std::fmt;
use std::path::PathBuf;

/// First rotation of the head that leads to a warning, degrees.
const LARGE_ROTATION: f64 = 60.0;
/// Most samples that a warning lists.
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
    /// Indices of samples that pop.
    pub pops: Vec<usize>,
    /// Guesses and remarks for the artist.
    pub notes: Vec<String>,
    /// What the artist should check.
    pub warnings: Vec<String>,
}

impl TrackReport {
    /// Adds warnings about the rest pose, pops and ignored options.
    pub(super) fn add_warnings(&mut self, options: &TrackOptions) {
        if self.first_rotation > LARGE_ROTATION {
            self.warnings.push(format!(
                "the head is rotated by {:.0}° in the first sample: if the joint's axes are arbitrary, use --rest first",
                self.first_rotation
            ));
        }
        if !self.pops.is_empty() && options.pops == Pops::Error {
            let listed: Vec<String> = self.pops.iter().take(MAX_LISTED).map(usize::to_string).collect();
            self.warnings.push(format!(
                "{} ({}{}), which a bake rejects: import with --pops bridge or keep, or clean the motion",
                match self.pops.len() {
                    1 => "1 sample pops".into(),
                    n => format!("{n} samples pop"),
                },
                listed.join(", "),
                if self.pops.len() > MAX_LISTED { ", …" } else { "" }
            ));
        }
        for mesh in options.colliders.iter().filter(|m| m.source.offset != Vector3::zeros()) {
            self.warnings
                .push(format!("collider {}: the offset is ignored; move the mesh itself", mesh.name));
        }
    }
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
