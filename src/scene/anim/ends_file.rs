//! How `anim.json` holds roots and other places of guides.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A ball in the rest space of the groom, scene units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct BallFile {
    /// Centre.
    pub centre: [f64; 3],
    /// Radius.
    #[schemars(range(min = 1e-6))]
    pub radius: f64,
}

/// How the roots of some guides are held. Selects the guides that match all of `ids`, `group` and `within`
/// that are given; all guides if none is. Of several entries for a guide the last one counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct RootsFile {
    /// Unique name.
    pub name: String,
    /// Selects guides by their ids.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ids: Option<Vec<i32>>,
    /// Selects the guides of a group, by its name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Selects the guides that enter a ball in the groom's pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<BallFile>,
    /// How they are held.
    pub hold: RootHold,
}

/// How a root is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RootHold {
    /// Position and frame follow the head or the skin.
    #[default]
    Clamped,
    /// The position follows, and the frame turns freely, as in a ball joint: chains, beads, tassels.
    Pinned,
    /// Nothing holds it: a loose hair, or one that ties alone hold. It starts at rest as it is drawn, where the head or
    /// the skin is at the start of the pre-roll, and falls from then on.
    Free,
}

/// Holds one point of each of some guides to a body: a hair tie, a clip, the end of a braid. Hair drawn
/// elsewhere moves there at 0.5 m/s and turns there at 5 rad/s at most; the pre-roll must be long enough for
/// that. Selects the guides that match all of `ids`, `group` and `within` that are given; all guides if none is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct TieFile {
    /// Unique name.
    pub name: String,
    /// Name of the body that holds the hair. Default: the head.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Selects guides by their ids.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ids: Option<Vec<i32>>,
    /// Selects the guides of a group, by its name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Selects the guides that enter a ball in the groom's pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<BallFile>,
    /// Where the held points are gathered in a bundle of `radius`, scene units, rest space of the body.
    /// Default: each point stays where it was drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<[f64; 3]>,
    /// Radius of the bundle, scene units. Higher is a looser tie. Default 0: all in one point.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub radius: f64,
    /// The point of each guide that is held: its arc length from the root, m. Shorter guides are not held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub arc_m: Option<f64>,
    /// The same place as a share of the length from the root; 1 is the tip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub arc_share: Option<f64>,
    /// The same arc length, as a multiple of the distance from the root to `at`. Higher leaves more slack:
    /// 1.3 lets hair pass around the head. Default, without the other places: the point drawn nearest to `at`, but at
    /// least 1.1 times the distance, or the point drawn nearest to the centre of `within`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1.0, max = 10.0))]
    pub arc_by_distance: Option<f64>,
    /// Whether the material frame of the held place turns with the body, as in a second clamp. Default: it turns
    /// freely.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<TieOrientationFile>,
    /// Whether the strand slides along its axis through the held place, without friction, as through a ring, or
    /// with `orientation` a sleeve. Default: it does not.
    #[serde(default)]
    pub slides: bool,
    /// With `slides`: whether a strand that is drawn out, with its tip, is let go for good. Default: it is held on as if
    /// it went on straight beyond its tip.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub releases: bool,
    /// First and last frame at which the tie holds; may be fractional. Default: always.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<[f64; 2]>,
}

/// The material frame that a tie holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum TieOrientationFile {
    /// A word.
    Word(TieOrientationWord),
    /// The frame as a unit quaternion (w, x, y, z): it turns the axes x, y and z of the rest space of the body
    /// to the two axes of the section and the tangent.
    Frame([f64; 4]),
}

/// The material frame that a tie holds, by a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TieOrientationWord {
    /// None: the place turns freely.
    Free,
    /// That in which the hair is drawn.
    Drawn,
}
