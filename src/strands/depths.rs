//! How deep written curves are inside bodies.

use super::clearances::{Clearances, DistanceBounds};
use super::obstacles::{Inside, Obstacles};
use crate::contact::Bodies;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Depth inside a body above which a strand counts as inside, m.
pub(super) const INSIDE: f64 = 2e-3;

/// How deep guides and strands are inside bodies. Points that the groom places inside do not count.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Depths {
    /// Depth of the deepest point of a guide, m; 0 if none is inside.
    pub guides: f64,
    /// Depth of the deepest vertex of a strand, m; 0 if none is inside.
    pub strands: f64,
    /// Number of strands with a vertex deeper than 2 mm.
    pub inside: u32,
    /// Depth of the deepest pinched point or vertex, m: bodies leave no room for it outside
    /// ([`pinch`](crate::contact::pinch)). The figures above are without these.
    pub pinched: f64,
    /// Bodies that hold pinched points: bit b for body b, the last bit for all from 63 on.
    pub pinched_bodies: u64,
}

impl Depths {
    /// The larger of each figure.
    pub fn max(self, other: Self) -> Self {
        Depths {
            guides: self.guides.max(other.guides),
            strands: self.strands.max(other.strands),
            inside: self.inside.max(other.inside),
            pinched: self.pinched.max(other.pinched),
            pinched_bodies: self.pinched_bodies | other.pinched_bodies,
        }
    }

    /// The depths of a guide with these points inside, from root to tip. A point next to a pinched one counts
    /// as pinched: no closer is known where a curve leaves a pinch.
    pub(super) fn of_guide(points: &[Inside]) -> Self {
        let pinched_by = |inside: &Inside| {
            let beside = points.iter().filter(|other| other.vertex.abs_diff(inside.vertex) <= 1);
            beside.fold(0, |bodies, other| bodies | other.pinched_by)
        };
        points.iter().fold(Depths::default(), |depths, inside| match pinched_by(inside) {
            0 => Depths { guides: depths.guides.max(inside.depth), ..depths },
            bodies => Depths {
                pinched: depths.pinched.max(inside.depth),
                pinched_bodies: depths.pinched_bodies | bodies,
                ..depths
            },
        })
    }
}

/// Measures how deep guides are inside bodies.
#[derive(Debug, Default)]
pub struct GuideDepths {
    /// Places of each guide's points in an array of all points, and the distances that they keep.
    guides: Vec<(Range<usize>, Clearances)>,
}

impl GuideDepths {
    /// Of guides with `points` in the groom, m, rest space, of which each has a range. `bodies` are at rest
    /// and have the thicknesses `thickness`, m.
    ///
    /// A stretch that the groom draws through a body may slide in it: points next to one do not count either.
    pub fn new(
        points: &[Vector3<f64>],
        guides: Vec<Range<usize>>,
        bodies: &Bodies,
        thickness: &[f64],
    ) -> Self {
        let clearances = |range: Range<usize>| {
            let mut clearances = Clearances::new(bodies, thickness, &points[range.clone()]);
            clearances.free_beside_drawn_through();
            (range, clearances)
        };
        GuideDepths { guides: guides.into_par_iter().map(clearances).collect() }
    }

    /// Depths of guides at `points`, in the output's unit and axes, which `from_scene` maps to metres, Y up.
    pub fn measure(&self, obstacles: &Obstacles, points: &[[f32; 3]], from_scene: &Matrix3<f64>) -> Depths {
        let depths = |bounds: &mut DistanceBounds, (range, clearances): &(Range<usize>, Clearances)| {
            let points = in_metres(&points[range.clone()], from_scene);
            Depths::of_guide(&obstacles.inside(clearances, points, |_, _| false, bounds))
        };
        self.guides
            .par_iter()
            .with_min_len(16)
            .map_init(DistanceBounds::default, depths)
            .reduce(Depths::default, Depths::max)
    }
}

/// Points in the output's unit and axes, which `from_scene` maps to metres, Y up.
pub(super) fn in_metres(
    points: &[[f32; 3]],
    from_scene: &Matrix3<f64>,
) -> impl Iterator<Item = Vector3<f64>> {
    points.iter().map(move |p| from_scene * Vector3::from(p.map(f64::from)))
}
