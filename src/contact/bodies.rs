//! The bodies of a scene.

use super::pinch;
use crate::geometry::{Deformation, Friction, Shape, Solid, SurfacePoint};
use nalgebra::Vector3;
use std::sync::Arc;

/// A body.
#[derive(Debug)]
pub struct Body {
    /// Its solid, in its own frame.
    pub solid: Solid,
    /// Its friction; `None` for the strand's own.
    pub friction: Option<Friction>,
}

/// All bodies. Queries take `&self` and may run on many threads. Deforming bodies answer for the step set by
/// [`Bodies::prepare`], and before that for the mesh at rest.
#[derive(Debug, Default)]
pub struct Bodies {
    /// The bodies, in the order of the scene.
    pub bodies: Vec<Body>,
}

impl Body {
    /// A body of `shape`, in its own frame; `deformation` moves the vertices of a mesh.
    pub fn new(shape: &Shape, deformation: Option<&Arc<Deformation>>, friction: Option<Friction>) -> Self {
        Body { solid: Solid::new(shape, deformation), friction }
    }
}

impl Bodies {
    /// The given bodies, in this order.
    pub fn new(bodies: impl IntoIterator<Item = Body>) -> Self {
        Bodies { bodies: bodies.into_iter().collect() }
    }

    /// Rigid bodies of `shapes`, with the friction of the strands.
    pub fn from_shapes(shapes: &[Shape]) -> Self {
        Bodies::new(shapes.iter().map(|shape| Body::new(shape, None, None)))
    }

    /// Prepares deforming bodies for the step between two times, s; once for all queries in the step.
    pub fn prepare(&mut self, times: [f64; 2]) {
        for body in &mut self.bodies {
            if let Solid::Deforming(deforming) = &mut body.solid {
                deforming.prepare(times);
            }
        }
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.bodies.len()
    }

    /// Whether there are no bodies.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// [`Solid::closest`] of a body.
    pub fn closest(&self, body: usize, t: f64, p: &Vector3<f64>, max_distance: f64) -> Option<SurfacePoint> {
        self.bodies[body].solid.closest(t, p, max_distance)
    }

    /// [`SolidMesh::facing`](crate::geometry::SolidMesh::facing) of a body at time `t`, s; `None` for a convex
    /// shape.
    pub fn facing(
        &self,
        body: usize,
        t: f64,
        p: &Vector3<f64>,
        from: &SurfacePoint,
        max_distance: f64,
    ) -> Option<SurfacePoint> {
        self.bodies[body].solid.mesh(t)?.facing(p, from, -pinch::FACING, max_distance)
    }

    /// [`SolidMesh::facing_or_around`](crate::geometry::SolidMesh::facing_or_around) of a body at time `t`, s;
    /// `None` for a convex shape.
    pub fn facing_or_around(
        &self,
        body: usize,
        t: f64,
        p: &Vector3<f64>,
        from: &SurfacePoint,
        max_distance: f64,
    ) -> Option<SurfacePoint> {
        self.bodies[body].solid.mesh(t)?.facing_or_around(p, from, -pinch::FACING, max_distance)
    }

    /// [`SolidMesh::around`](crate::geometry::SolidMesh::around) of a body at time `t`, s; `None` for a convex
    /// shape.
    pub fn around(
        &self,
        body: usize,
        t: f64,
        p: &Vector3<f64>,
        from: &SurfacePoint,
        max_distance: f64,
    ) -> Option<SurfacePoint> {
        self.bodies[body].solid.mesh(t)?.around(p, from, max_distance)
    }

    /// [`SolidMesh::winds_past`](crate::geometry::SolidMesh::winds_past) of a body at time `t`, s.
    pub fn winds_past(&self, body: usize, t: f64, p: &Vector3<f64>) -> bool {
        self.bodies[body].solid.mesh(t).is_some_and(|mesh| mesh.winds_past(p))
    }

    /// [`SolidMesh::in_other_part`](crate::geometry::SolidMesh::in_other_part) of a body at time `t`, s.
    pub fn in_other_part(&self, body: usize, t: f64, p: &Vector3<f64>, from: &SurfacePoint) -> bool {
        self.bodies[body].solid.mesh(t).is_some_and(|mesh| mesh.in_other_part(p, from))
    }

    /// [`Solid::distance_bounds`] of a body.
    pub fn distance_bounds(&self, body: usize, p: &Vector3<f64>) -> [f64; 2] {
        self.bodies[body].solid.distance_bounds(p)
    }

    /// [`Solid::first_intersection`] of a body.
    pub fn first_intersection(
        &self,
        body: usize,
        t: f64,
        a: &Vector3<f64>,
        b: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        self.bodies[body].solid.first_intersection(t, a, b)
    }

    /// [`Solid::contains`] of a body.
    pub fn contains(&self, body: usize, t: f64, p: &Vector3<f64>) -> bool {
        self.bodies[body].solid.contains(t, p)
    }
}
