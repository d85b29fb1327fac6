//! What carries a root that grows on a skin.

use crate::geometry::SkinPoint;

/// The place of a skin that carries a root.
#[derive(Debug, Clone, PartialEq)]
pub struct RootBinding {
    /// The skin: index into [`Anim::colliders`](super::Anim::colliders).
    pub collider: usize,
    /// The place on it.
    pub place: SkinPoint,
}
