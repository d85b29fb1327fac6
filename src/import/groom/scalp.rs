//! Position of roots relative to the scalp.

use crate::geometry::TriMesh;
use nalgebra::Vector3;
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{TriMesh as Surface, TriMeshFlags};
use rayon::prelude::*;
use std::fmt;

/// Distance from the scalp beyond which a root counts as off it, m.
pub const OFF_SCALP: f64 = 2e-3;

/// Height above the scalp to which strands are brought out, m: the default thickness of a collider.
const CLEARANCE: f64 = 5e-4;

/// A head mesh that answers closest-point queries.
pub(crate) struct Scalp(Surface);

/// The closest point of the scalp to a position.
pub(super) struct Foot {
    /// The closest point, m.
    pub(super) point: Vector3<f64>,
    /// Signed distance to it, negative inside the head, m. At an open edge the sign is that of the nearest
    /// face.
    pub(super) height: f64,
}

impl Foot {
    /// Displacement of `x`, whose foot this is, along the normal to `height`, m.
    fn displacement(&self, x: &Vector3<f64>, height: f64) -> Vector3<f64> {
        let Some(normal) = (x - self.point).try_normalize(1e-9) else { return Vector3::zeros() };
        normal * ((height - self.height) * self.height.signum())
    }
}

/// Positions of roots relative to the scalp.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RootReport {
    /// Number of roots.
    pub roots: usize,
    /// Roots inside the head.
    pub inside: usize,
    /// Roots farther than [`OFF_SCALP`] from the scalp, on either side.
    pub off: usize,
    /// Distance to the scalp, m: mean and largest.
    pub distance: [f64; 2],
    /// Largest depth inside the head, m.
    pub deepest: f64,
}

impl Scalp {
    /// `None` if the mesh has no triangle.
    pub(crate) fn new(mesh: &TriMesh) -> Option<Self> {
        let vertices = mesh.vertices.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
        Surface::with_flags(vertices, mesh.triangles.clone(), TriMeshFlags::ORIENTED).ok().map(Scalp)
    }

    /// The closest point to `x`, m.
    pub(super) fn foot(&self, x: &Vector3<f64>) -> Foot {
        let position = Vector::new(x.x, x.y, x.z);
        let projected = self.0.project_local_point(position, false);
        let distance = (projected.point - position).length();
        Foot {
            point: Vector3::new(projected.point.x, projected.point.y, projected.point.z),
            height: if projected.is_inside { -distance } else { distance },
        }
    }

    /// Displacement of `root`, along the normal, to the height above the scalp that `reference` has.
    pub(super) fn lift(&self, reference: &Vector3<f64>, root: &Vector3<f64>) -> Vector3<f64> {
        self.foot(root).displacement(root, self.foot(reference).height)
    }

    /// Displacement of `x`, along the normal, that brings it out of the head: to [`CLEARANCE`], or to the
    /// height of `reference` if that is lower; zero if it is as high.
    pub(super) fn out(&self, reference: &Vector3<f64>, x: &Vector3<f64>) -> Vector3<f64> {
        let foot = self.foot(x);
        if foot.height >= CLEARANCE {
            return Vector3::zeros();
        }
        foot.displacement(x, self.foot(reference).height.min(CLEARANCE).max(foot.height))
    }

    /// Heights of `roots` above the scalp in figures.
    pub(super) fn report(&self, roots: &[Vector3<f64>]) -> RootReport {
        let heights: Vec<f64> = roots.par_iter().map(|x| self.foot(x).height).collect();
        let count = |condition: &dyn Fn(f64) -> bool| heights.iter().filter(|h| condition(**h)).count();
        RootReport {
            roots: roots.len(),
            inside: count(&|h| h < 0.0),
            off: count(&|h| h.abs() > OFF_SCALP),
            distance: [
                heights.iter().map(|h| h.abs()).sum::<f64>() / roots.len().max(1) as f64,
                heights.iter().fold(0.0, |a, h| a.max(h.abs())),
            ],
            deepest: heights.iter().fold(0.0, |a, h| a.max(-h)),
        }
    }
}

impl fmt::Display for RootReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |n: usize| 100.0 * n as f64 / self.roots.max(1) as f64;
        write!(
            f,
            "{} roots: {} inside the head ({:.0} %, deepest {:.1} mm), {} more than {:.0} mm off the scalp ({:.0} %); \
             mean distance {:.2} mm, largest {:.1} mm",
            self.roots,
            self.inside,
            share(self.inside),
            self.deepest * 1e3,
            self.off,
            OFF_SCALP * 1e3,
            share(self.off),
            self.distance[0] * 1e3,
            self.distance[1] * 1e3
        )
    }
}
