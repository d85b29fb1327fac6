//! A mesh whose vertices move.

use super::solid_mesh::SolidMesh;
use crate::geometry::deformation::Deformation;
use nalgebra::Vector3;
use std::sync::{Arc, OnceLock};

/// Shares of a step that differ by less are the same: far above rounding, far below any part of a step.
const SAME: f64 = 1e-6;

/// A deforming mesh over one step at a time. Between the ends of the step its vertices move linearly: that is what its motion
/// *is*, for detection and for everyone, however a strand divides the step.
#[derive(Debug)]
pub struct DeformingMesh {
    deformation: Arc<Deformation>,
    /// Start and end of the step, s; before all times until a step is prepared.
    times: [f64; 2],
    /// The mesh there.
    ends: [SolidMesh; 2],
    middle: Middle,
    /// Way that no vertex has exceeded since the mesh was made, m, at start and end.
    travel: [f64; 2],
}

/// The mesh in the middle of a stretch of the step, and the middles of its halves: prepared when a part of a step first asks for it,
/// once for all strands.
#[derive(Debug, Default)]
struct Middle(OnceLock<Box<(SolidMesh, [Middle; 2])>>);

impl DeformingMesh {
    /// The mesh at rest, of `vertices` and `triangles`, m, body frame; `deformation` moves these vertices.
    pub fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], deformation: Arc<Deformation>) -> Self {
        // Points that part later must not be welded.
        let mut shapes = vec![vertices];
        shapes.extend(deformation.samples.iter().map(Vec::as_slice));
        let ends = [0; 2].map(|_| SolidMesh::of_shapes(&shapes, triangles));
        DeformingMesh {
            deformation,
            times: [f64::NEG_INFINITY; 2],
            ends,
            middle: Middle::default(),
            travel: [0.0; 2],
        }
    }

    /// Makes ready for the step between two times, s.
    pub fn prepare(&mut self, times: [f64; 2]) {
        for t in times {
            if t != self.times[1] {
                self.go_on_to(t);
            }
        }
    }

    fn go_on_to(&mut self, t: f64) {
        let last = &self.ends[1];
        let points = self.deformation.vertices(t);
        let next = last.reshaped(last.topology.source.iter().map(|&i| points[i as usize]).collect());
        let way2 =
            next.vertices.iter().zip(&last.vertices).map(|(a, b)| (a - b).norm_squared()).fold(0.0, f64::max);
        self.ends.swap(0, 1);
        self.ends[1] = next;
        self.times = [self.times[1], t];
        self.travel = [self.travel[1], self.travel[1] + way2.sqrt()];
        self.middle = Middle::default();
    }

    /// The mesh at time `t`, s, of the step; at the nearer end where it is outside of it.
    pub fn at(&self, t: f64) -> &SolidMesh {
        let share = self.share(t);
        if share <= SAME {
            return &self.ends[0];
        }
        if share >= 1.0 - SAME {
            return &self.ends[1];
        }
        let (mut from, mut to, mut middle) = (0.0, 1.0, &self.middle);
        loop {
            let half = 0.5 * (from + to);
            let (mesh, halves) =
                &**middle.0.get_or_init(|| Box::new((self.between(half), Default::default())));
            if (share - half).abs() < SAME {
                return mesh;
            }
            if share < half {
                (to, middle) = (half, &halves[0]);
            } else {
                (from, middle) = (half, &halves[1]);
            }
        }
    }

    /// Way that no vertex has exceeded up to time `t`, s, of the step, m.
    pub fn travel(&self, t: f64) -> f64 {
        self.travel[0] + (self.travel[1] - self.travel[0]) * self.share(t).clamp(0.0, 1.0)
    }

    fn share(&self, t: f64) -> f64 {
        let [t0, t1] = self.times;
        // Written so that no time is in a step of no length, or that starts before all times.
        if t >= t1 {
            1.0
        } else if t > t0 && t0.is_finite() {
            (t - t0) / (t1 - t0)
        } else {
            0.0
        }
    }

    fn between(&self, share: f64) -> SolidMesh {
        let [a, b] = &self.ends;
        a.reshaped(a.vertices.iter().zip(&b.vertices).map(|(a, b)| a.lerp(b, share)).collect())
    }
}
