//! Settings of the simulation and of its output.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the simulation and of its output. The command line may override them.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Sub-steps per frame.
    pub substeps: u32,
    /// Time simulated before the first frame, s: the groom settles and overlaps are resolved.
    pub preroll: f64,
    /// Strain nodes per guide, for guides of a groom without wisps.
    pub nodes: u32,
    /// Time integration scheme.
    pub scheme: Scheme,
    /// What hair collides with.
    pub contact: ContactSetting,
    /// Which guides are simulated, as requested; see [`Settings::resolution`].
    pub resolution: Resolution,
    /// With adaptive resolution: the estimated deviation from its leaders' motion at which a guide splits
    /// off, relative to its length.
    pub split_tolerance: f64,
    /// Which curves are written.
    pub curves: OutputCurves,
    /// Share of the render strands that is written, above 0, at most 1. They are widened to cover as much.
    pub keep: f64,
    /// Motion samples per frame: the first at the frame, the last when the shutter closes, evenly spaced.
    pub samples: u32,
    /// Time from a frame until the shutter closes, frames (0..1).
    pub shutter: f64,
    /// Whether accelerations are written in addition to velocities.
    pub accelerations: bool,
    /// Whether the normals of the guides, a section axis of their material frames, are written.
    pub normals: bool,
    /// Whether the forces and moments that hold the guides are written.
    pub reactions: bool,
}

/// Which guides are simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Resolution {
    /// `full` with `contact` "full", since followers pass through other hair, and with `curves` "steps";
    /// otherwise `adaptive`.
    #[default]
    Auto,
    /// Coarse wisps, and the guides that deviate from them. Such a guide splits off, and merges again when it
    /// is calm.
    Adaptive,
    /// All guides.
    Full,
    /// Coarse wisps only, for quick previews.
    Coarse,
}

/// Which curves a bake writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OutputCurves {
    /// The guides only.
    Guides,
    /// The guides only, also at the sub-steps between frames; between two of these moments the motion is
    /// linear. For checks of the solver.
    Steps,
    /// The render strands only.
    Strands,
    /// Guides and render strands.
    #[default]
    Both,
}

/// What hair collides with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ContactSetting {
    /// Colliders, and other hair as a fibre assembly: hair keeps its volume, pushes back where it is pressed,
    /// and drags its neighbours along. Single strands may pass through each other.
    #[default]
    Volume,
    /// Colliders only: strands do not meet. Slightly faster.
    Bodies,
    /// Colliders and other guides as rigid bundles: they rest on each other, slide with friction, and do not
    /// pass through each other. Followers of a wisp do pass through other hair. The reference; many times
    /// slower.
    Full,
    /// Colliders only, by penalty springs, for quick previews. Guarantees nothing: hair sinks in, and fast
    /// hair passes through.
    Penalty,
}

/// Time integration scheme. All are stable for any step and cost about the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// First order. Damps all oscillations, fast ones most: the damping ratio is half the phase angle per
    /// step.
    BackwardEuler,
    /// Second order: the two-step backward differentiation formula. Hardly damps slow oscillations; damps
    /// those too fast for the step as backward Euler does. A step with contacts uses backward Euler.
    Bdf2,
    /// Second order: a backward differentiation formula of four steps, with two fifths of the error of BDF2
    /// and a twelfth of its damping of slow oscillations. It starts with backward Euler, BDF2 and a formula
    /// of three steps; a step with contacts uses backward Euler.
    #[default]
    FourStep,
}

impl Settings {
    /// Which guides are simulated; never [`Resolution::Auto`].
    pub fn resolution(&self) -> Resolution {
        match self.resolution {
            // Guides that follow a wisp are not held by their own clamps, and meet no bundles.
            Resolution::Auto
                if self.contact == ContactSetting::Full
                    || self.curves == OutputCurves::Steps
                    || self.reactions =>
            {
                Resolution::Full
            }
            Resolution::Auto => Resolution::Adaptive,
            requested => requested,
        }
    }

    /// Times of the motion samples of a frame, frames after it.
    pub fn offsets(&self) -> impl Iterator<Item = f64> + use<> {
        let (shutter, last) = (self.shutter, f64::from(self.samples.max(2) - 1));
        (0..self.samples).map(move |i| shutter * f64::from(i) / last)
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            substeps: 8,
            preroll: 1.0,
            nodes: 8,
            scheme: Scheme::default(),
            contact: ContactSetting::default(),
            resolution: Resolution::default(),
            // The mean curves of locks then deviate by up to a percent of their length. With half of it the hair
            // around them makes nearly all guides split, and the bake takes as long as one of all guides.
            split_tolerance: 0.01,
            curves: OutputCurves::default(),
            keep: 1.0,
            samples: 1,
            shutter: 0.5,
            accelerations: false,
            normals: false,
            reactions: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn automatic_resolution_follows_from_contact_and_output() {
        for (resolution, contact, curves, resolved) in [
            (Resolution::Auto, ContactSetting::Bodies, OutputCurves::Both, Resolution::Adaptive),
            (Resolution::Auto, ContactSetting::Penalty, OutputCurves::Strands, Resolution::Adaptive),
            (Resolution::Auto, ContactSetting::Full, OutputCurves::Both, Resolution::Full),
            (Resolution::Auto, ContactSetting::Bodies, OutputCurves::Steps, Resolution::Full),
            (Resolution::Adaptive, ContactSetting::Full, OutputCurves::Both, Resolution::Adaptive),
            (Resolution::Coarse, ContactSetting::Full, OutputCurves::Both, Resolution::Coarse),
            (Resolution::Full, ContactSetting::Bodies, OutputCurves::Both, Resolution::Full),
        ] {
            let settings = Settings { resolution, contact, curves, ..Settings::default() };
            assert_eq!(settings.resolution(), resolved, "{resolution:?} {contact:?} {curves:?}");
            // What follows a wisp has no reactions.
            let settings = Settings { reactions: true, ..settings };
            let resolved = if resolution == Resolution::Auto { Resolution::Full } else { resolved };
            assert_eq!(settings.resolution(), resolved, "{resolution:?} with reactions");
        }
    }
}
