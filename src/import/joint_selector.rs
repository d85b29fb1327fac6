//! Which joint of a motion file, and which of its animations, to follow.

/// Selects a joint of a motion file, and one of its animations.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointSelector {
    /// Name of the joint (BVH, USD) or node (glTF); `None` for the file's only joint, or for the prim itself
    /// (USD).
    pub name: Option<String>,
    /// Name or number of the animation (glTF); `None` for the first.
    pub clip: Option<String>,
}
