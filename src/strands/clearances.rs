//! Distances that a strand keeps from bodies.

use crate::contact::Bodies;
use nalgebra::Vector3;

/// Radius of searches for a surface beyond the next edge, m.
pub(super) const SEARCH_RADIUS: f64 = 0.02;

/// Distances that the vertices of one strand keep from each body, m: as in the groom, but at most the
/// thickness of the body. −∞ for the leading vertices that the groom places inside the body; negative for
/// later vertices placed inside.
#[derive(Debug, Clone)]
pub(super) struct Clearances {
    /// Body-major.
    values: Vec<f32>,
    vertices: usize,
    largest: f64,
}

impl Clearances {
    /// Of a strand with `points` in the groom, m, rest space; `bodies` are at rest and have the thicknesses
    /// `thickness`, m.
    pub fn new(bodies: &Bodies, thickness: &[f64], points: &[Vector3<f64>]) -> Self {
        let mut values = Vec::with_capacity(bodies.len() * points.len());
        for (b, &d) in thickness.iter().enumerate() {
            let mut rooted = true;
            for p in points {
                let far = SEARCH_RADIUS.max(2.0 * d);
                let [least, _] = bodies.distance_bounds(b, p);
                let g = if least > 2.0 * d {
                    least
                } else if let Some(surface) = bodies.closest(b, 0.0, p, far) {
                    surface.distance
                } else if bodies.contains(b, 0.0, p) {
                    -far
                } else {
                    far
                };
                rooted &= g <= 0.0;
                let keep = if rooted {
                    f64::NEG_INFINITY
                } else if g > 0.0 {
                    d.min(0.5 * g)
                } else {
                    g
                };
                values.push(keep as f32);
            }
        }
        let largest = values.iter().copied().fold(0.0, f32::max);
        Clearances { values, vertices: points.len(), largest: f64::from(largest) }
    }

    /// Distance that `vertex` keeps from `body`, m.
    pub fn get(&self, body: usize, vertex: usize) -> f64 {
        f64::from(self.values[body * self.vertices + vertex])
    }

    /// Distance from `body` at which a depth of `vertex` begins: 0, or −∞ if the groom places it inside.
    pub fn surface(&self, body: usize, vertex: usize) -> f64 {
        if self.get(body, vertex) > 0.0 { 0.0 } else { f64::NEG_INFINITY }
    }

    /// Lets vertices next to a later vertex that the groom places inside be anywhere.
    pub fn free_beside_drawn_through(&mut self) {
        for of_body in self.values.chunks_mut(self.vertices) {
            let drawn = of_body.to_vec();
            let through = |k: usize| drawn[k] <= 0.0 && drawn[k] > f32::NEG_INFINITY;
            for k in (0..drawn.len()).filter(|k| through(*k)) {
                of_body[k.saturating_sub(1)..drawn.len().min(k + 2)].fill(f32::NEG_INFINITY);
            }
        }
    }

    /// The largest of all distances, at least 0, m.
    pub fn largest(&self) -> f64 {
        self.largest
    }
}

/// Lower bounds on the distance from each body to the last place looked at, m. They spare searches that would
/// find nothing.
#[derive(Debug, Default)]
pub(super) struct DistanceBounds(Vec<f64>);

impl DistanceBounds {
    /// Nothing is known about `bodies` bodies.
    pub fn reset(&mut self, bodies: usize) {
        self.0.clear();
        self.0.resize(bodies, f64::NEG_INFINITY);
    }

    /// Nothing is known about any body.
    pub fn forget(&mut self) {
        self.0.fill(f64::NEG_INFINITY);
    }

    /// The place has moved by `distance`, m.
    pub fn move_by(&mut self, distance: f64) {
        self.0.iter_mut().for_each(|bound| *bound -= distance);
    }

    /// The bound for each body.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.0.iter_mut()
    }
}
