//! The bodies of a scene.

use crate::geometry::{Deformation, Friction, FromRest, Shape, Solid, SolidMesh, SurfacePoint};
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
        self.prepare_from_rest(times, |_, _| None);
    }

    /// The same, of bodies that are on their way from rest: `from_rest` tells where, by the body and the time, s.
    pub fn prepare_from_rest(&mut self, times: [f64; 2], from_rest: impl Fn(usize, f64) -> Option<FromRest>) {
        for (b, body) in self.bodies.iter_mut().enumerate() {
            if let Solid::Deforming(deforming) = &mut body.solid {
                deforming.prepare(times, |t| from_rest(b, t));
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

    /// [`Solid::mesh`] of a body.
    pub fn mesh(&self, body: usize, t: f64) -> Option<&SolidMesh> {
        self.bodies[body].solid.mesh(t)
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
