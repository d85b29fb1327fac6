//! Settings of a preview.

use super::lighting::Sampling;
use crate::error::{Error, Result};

/// Curves to draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CurveSelection {
    /// Render strands, at their true widths.
    Hair,
    /// Guides, in one colour per group, wide enough to be visible.
    Guides,
    /// Guides among thinned strands.
    Both,
}

/// Motion of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Follow {
    /// Follows the position of the head: its rotation and gravity remain visible.
    #[default]
    Position,
    /// Follows position and rotation of the head, which stands still in the picture.
    Head,
    /// Stands still: the whole motion of the head fits into the picture.
    World,
}

/// Meaning of the colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Colours {
    /// Natural colours for strands, one colour per group for guides.
    #[default]
    Hair,
    /// Level of the wisp with which each curve moves.
    Level,
    /// Density over that of the densest twentieth of the hair in the pose of the groom.
    Crowding,
}

/// How much work is put into a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quality {
    /// A fraction of a second.
    #[default]
    Quick,
    /// Soft shadows from many directions, in some seconds.
    Beauty,
}

impl Quality {
    /// How finely light is sampled.
    pub(super) fn sampling(self) -> Sampling {
        match self {
            Quality::Quick => Sampling { cells: 400_000, lamp: 1, sky: 8, map: 768 },
            Quality::Beauty => Sampling { cells: 3_000_000, lamp: 12, sky: 48, map: 2048 },
        }
    }
}

/// Settings of a preview.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Width and height of one picture, pixels.
    pub size: (u32, u32),
    /// Samples per pixel in each direction.
    pub supersampling: u32,
    /// How much work is put into light.
    pub quality: Quality,
    /// Meaning of the colours.
    pub colours: Colours,
    /// Curves to draw; by default strands if the cache has them, else guides.
    pub curves: Option<CurveSelection>,
    /// Factor on the widths of strands. A factor above 1 compensates for a cache with fewer strands than the
    /// head has hairs.
    pub width_scale: f64,
    /// Whether colliders are drawn.
    pub colliders: bool,
    /// Motion of the camera.
    pub follow: Follow,
    /// Azimuth of the viewer, degrees from the front (+Z, or −Y if Z is up) to the left of the subject.
    pub azimuth_deg: f64,
    /// Elevation of the viewer, degrees above the horizon.
    pub elevation_deg: f64,
    /// Vertical field of view, degrees.
    pub fov_deg: f64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            size: (480, 480),
            supersampling: 3,
            quality: Quality::default(),
            colours: Colours::default(),
            curves: None,
            width_scale: 1.0,
            colliders: true,
            follow: Follow::default(),
            azimuth_deg: 35.0,
            elevation_deg: 8.0,
            fov_deg: 24.0,
        }
    }
}

impl CurveSelection {
    /// Noun for messages.
    pub(super) fn noun(self) -> &'static str {
        match self {
            CurveSelection::Hair => "render strands",
            CurveSelection::Guides => "guides",
            CurveSelection::Both => "curves",
        }
    }
}

impl Options {
    /// Checks the ranges of all settings.
    ///
    /// # Errors
    /// [`Error::Usage`] for a setting out of range.
    pub(super) fn check(&self) -> Result<()> {
        let error = |what: String| Err(Error::Usage(what));
        let (width, height) = self.size;
        if width == 0 || height == 0 || width > 8192 || height > 8192 {
            return error(format!("picture size {width}x{height} is out of range (1 to 8192 pixels)"));
        }
        if !(1..=8).contains(&self.supersampling) {
            return error(format!("supersampling {} is out of range (1 to 8)", self.supersampling));
        }
        if !(self.fov_deg >= 1.0 && self.fov_deg <= 150.0) {
            return error(format!("field of view {} is out of range (1 to 150 degrees)", self.fov_deg));
        }
        if !(self.width_scale > 0.0 && self.width_scale.is_finite()) {
            return error(format!("width scale {} is not a positive number", self.width_scale));
        }
        if !(self.azimuth_deg.is_finite() && self.elevation_deg.is_finite()) {
            return error("azimuth and elevation must be finite angles".into());
        }
        Ok(())
    }
}
