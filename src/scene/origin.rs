//! Where imported data come from.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Where imported data come from, for messages and for later imports. A bake does not read the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Origin {
    /// Path of the file, relative to the folder of this one.
    pub file: String,
    /// Path of the USD prim. Default: the whole file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prim: Option<String>,
    /// Time code at which it was read. Default: the rest pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The space of the data.
    #[serde(default)]
    pub space: RestSpace,
}

/// The space in which groom, head and skin are given at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RestSpace {
    /// The world of the file or stage, in its rest pose.
    #[default]
    World,
    /// The space of a USD skeleton's bind transforms: that of the asset, wherever a shot places it.
    Bind,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let space = match self.space {
            RestSpace::World => "world of the file",
            RestSpace::Bind => "bind space of the skeleton",
        };
        write!(f, "{}", self.file)?;
        self.prim.iter().try_for_each(|prim| write!(f, ":{prim}"))?;
        self.time.iter().try_for_each(|time| write!(f, " at {time}"))?;
        write!(f, " ({space})")
    }
}
