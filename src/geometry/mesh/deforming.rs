//! A mesh whose vertices move.

use super::solid_mesh::SolidMesh;
use crate::geometry::deformation::Deformation;
use nalgebra::{Isometry3, Vector3};
use std::sync::{Arc, OnceLock};

/// Fractions of a step closer than this are equal: far above rounding, far below any part of a step.
const SAME: f64 = 1e-6;

/// A deforming mesh over one step at a time. Between the ends of the step its vertices move linearly. That
/// linear motion is *the* motion, for detection and for friction, however a strand divides the step.
#[derive(Debug)]
pub struct DeformingMesh {
    deformation: Arc<Deformation>,
    /// Vertices at rest, m.
    rest: Vec<Vector3<f64>>,
    /// Start and end of the step, s; −∞ until a step is prepared.
    times: [f64; 2],
    /// The mesh at the start and at the end.
    ends: [SolidMesh; 2],
    midpoint: Midpoint,
    /// Upper bound, m, on the path length of any vertex since the mesh was created, at the start and at the
    /// end.
    max_travel: [f64; 2],
}

/// The mesh at the middle of a part of the step, and the midpoints of its two halves. Each is computed when a
/// part of a step first needs it, once for all strands.
#[derive(Debug, Default)]
struct Midpoint(OnceLock<Box<(SolidMesh, [Midpoint; 2])>>);

/// Where a mesh is on its way from rest to where its deformation has it.
#[derive(Debug, Clone, Copy)]
pub struct FromRest {
    /// Where it is at rest, body frame.
    pub rest: Isometry3<f64>,
    /// The share (0..=1) of its way that it has come.
    pub share: f64,
}

impl FromRest {
    /// The vertices of a mesh with the vertices `rest` at rest and `deformed` by its deformation, m, body frame: each on
    /// a straight line as the carrier of the rest sees it.
    pub fn between(&self, rest: &[Vector3<f64>], deformed: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        rest.iter().zip(deformed).map(|(rest, deformed)| self.place(rest, deformed)).collect()
    }

    /// The same of one vertex.
    pub fn place(&self, rest: &Vector3<f64>, deformed: &Vector3<f64>) -> Vector3<f64> {
        self.rest.transform_point(&(*rest).into()).coords.lerp(deformed, self.share)
    }
}

impl DeformingMesh {
    /// The mesh at rest, of `vertices`, m, body frame, and `triangles`; `deformation` moves the vertices.
    pub fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], deformation: Arc<Deformation>) -> Self {
        // Points that separate later must not be welded.
        let mut positions = vec![vertices];
        positions.extend(deformation.samples.iter().map(Vec::as_slice));
        let ends = [0; 2].map(|_| SolidMesh::from_positions(&positions, triangles));
        DeformingMesh {
            deformation,
            rest: vertices.to_vec(),
            times: [f64::NEG_INFINITY; 2],
            ends,
            midpoint: Midpoint::default(),
            max_travel: [0.0; 2],
        }
    }

    /// Prepares the step between two times, s. `from_rest` is where it is on its way from rest at each.
    pub fn prepare(&mut self, times: [f64; 2], from_rest: impl Fn(f64) -> Option<FromRest>) {
        for t in times {
            if t != self.times[1] {
                self.advance_to(t, from_rest(t));
            }
        }
    }

    fn advance_to(&mut self, t: f64, from_rest: Option<FromRest>) {
        let last = &self.ends[1];
        let vertices = self.deformation.vertices(t);
        let next = match from_rest {
            None => last.moved(&vertices),
            Some(from_rest) => last.moved(&from_rest.between(&self.rest, &vertices)),
        };
        let displacement2 =
            next.vertices.iter().zip(&last.vertices).map(|(a, b)| (a - b).norm_squared()).fold(0.0, f64::max);
        self.ends.swap(0, 1);
        self.ends[1] = next;
        self.times = [self.times[1], t];
        self.max_travel = [self.max_travel[1], self.max_travel[1] + displacement2.sqrt()];
        self.midpoint = Midpoint::default();
    }

    /// The mesh at time `t`, s, clamped to the step.
    pub fn at(&self, t: f64) -> &SolidMesh {
        let fraction = self.fraction(t);
        if fraction <= SAME {
            return &self.ends[0];
        }
        if fraction >= 1.0 - SAME {
            return &self.ends[1];
        }
        let (mut from, mut to, mut midpoint) = (0.0, 1.0, &self.midpoint);
        loop {
            let half = 0.5 * (from + to);
            let (mesh, halves) =
                &**midpoint.0.get_or_init(|| Box::new((self.interpolated(half), Default::default())));
            if (fraction - half).abs() < SAME {
                return mesh;
            }
            if fraction < half {
                (to, midpoint) = (half, &halves[0]);
            } else {
                (from, midpoint) = (half, &halves[1]);
            }
        }
    }

    /// Upper bound, m, on the path length of any vertex up to time `t`, s, of the step.
    pub fn max_travel(&self, t: f64) -> f64 {
        self.max_travel[0] + (self.max_travel[1] - self.max_travel[0]) * self.fraction(t).clamp(0.0, 1.0)
    }

    fn fraction(&self, t: f64) -> f64 {
        let [t0, t1] = self.times;
        // No time lies in a step of zero length, or in one that starts at −∞.
        if t >= t1 {
            1.0
        } else if t > t0 && t0.is_finite() {
            (t - t0) / (t1 - t0)
        } else {
            0.0
        }
    }

    fn interpolated(&self, fraction: f64) -> SolidMesh {
        let [a, b] = &self.ends;
        a.with_vertices(a.vertices.iter().zip(&b.vertices).map(|(a, b)| a.lerp(b, fraction)).collect())
    }
}
