//! Settings in `anim.json`.

use super::settings::{ContactSetting, OutputCurves, Resolution, Scheme, Settings};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the simulation and of its output. The command line may override them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct SettingsFile {
    /// Sub-steps per frame. Higher is more accurate and slower.
    #[schemars(range(min = 1, max = 10000))]
    pub substeps: u32,
    /// Time simulated before the first frame, s: the groom settles and overlaps are resolved. Higher settles
    /// more completely.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub preroll_s: f64,
    /// Strain nodes per guide, for guides of a groom without wisps. Higher is more accurate and slower.
    #[schemars(range(min = 2, max = 256))]
    pub nodes: u32,
    /// Time integration scheme.
    pub scheme: Scheme,
    /// What hair collides with.
    pub contact: ContactSetting,
    /// Which guides are simulated.
    pub resolution: Resolution,
    /// With adaptive resolution: the deviation at which a guide splits off from the guides that lead it,
    /// relative to its length. The deviation is estimated from differences between its leaders and from
    /// contacts of the guide. Lower is more accurate and slower. The default keeps the mean curves of
    /// locks within a percent of their length of a full bake.
    #[serde(alias = "parting")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub split_tolerance: f64,
    /// Which curves are written.
    pub curves: OutputCurves,
    /// Share of the render strands that is written. Lower is faster to write and to render; the strands are
    /// widened to cover as much.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub keep: f64,
    /// Motion samples per frame, for motion blur: the first at the frame, the last when the shutter closes,
    /// evenly spaced. Higher blurs curved motion more exactly and writes larger files.
    #[schemars(range(min = 1, max = 64))]
    pub samples: u32,
    /// Time from a frame until the shutter closes, frames. Higher blurs more. No effect with one sample and
    /// without accelerations.
    #[schemars(range(min = 0.001, max = 0.999))]
    pub shutter: f64,
    /// Whether accelerations are written in addition to velocities, for renderers that use them for motion
    /// blur. Files are half as large again.
    pub accelerations: bool,
    /// Whether the normals of the guides are written: the first axis of their section at each point, which turns
    /// with twist. Files of guides are half as large again. Not with `curves` "strands".
    pub normals: bool,
    /// Whether the force and moment of the clamp of each guide and the force of each tie are written, N and
    /// N m. Guides that follow a wisp, with `resolution` "adaptive" or "coarse", have none. Not with `curves`
    /// "strands".
    pub reactions: bool,
}

impl Default for SettingsFile {
    fn default() -> Self {
        SettingsFile::from(Settings::default())
    }
}

impl From<Settings> for SettingsFile {
    fn from(s: Settings) -> Self {
        SettingsFile {
            substeps: s.substeps,
            preroll_s: s.preroll,
            nodes: s.nodes,
            scheme: s.scheme,
            contact: s.contact,
            resolution: s.resolution,
            split_tolerance: s.split_tolerance,
            curves: s.curves,
            keep: s.keep,
            samples: s.samples,
            shutter: s.shutter,
            accelerations: s.accelerations,
            normals: s.normals,
            reactions: s.reactions,
        }
    }
}

impl From<SettingsFile> for Settings {
    fn from(s: SettingsFile) -> Self {
        Settings {
            substeps: s.substeps,
            preroll: s.preroll_s,
            nodes: s.nodes,
            scheme: s.scheme,
            contact: s.contact,
            resolution: s.resolution,
            split_tolerance: s.split_tolerance,
            curves: s.curves,
            keep: s.keep,
            samples: s.samples,
            shutter: s.shutter,
            accelerations: s.accelerations,
            normals: s.normals,
            reactions: s.reactions,
        }
    }
}
