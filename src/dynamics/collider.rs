//! Bodies of contact from the colliders of a scene.

use crate::contact::Body;
use crate::scene::Collider;

impl From<&Collider> for Body {
    fn from(collider: &Collider) -> Self {
        Body::new(&collider.shape, collider.deformation.as_ref(), collider.friction)
    }
}
