//! Winding numbers (A. Jacobson, L. Kavan & O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers", 2013).

use crate::geometry::bounds::Bounds;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::ops::Range;

/// Most triangles of what is not divided further.
const LEAF: usize = 16;

/// A mesh as it is given.
#[derive(Clone, Copy)]
struct Triangles<'a> {
    vertices: &'a [Vector3<f64>],
    triangles: &'a [[u32; 3]],
}

impl<'a> Triangles<'a> {
    /// Corners of a triangle.
    fn triangle(&self, t: u32) -> [&'a Vector3<f64>; 3] {
        self.triangles[t as usize].map(|v| &self.vertices[v as usize])
    }
}

/// The triangles of a mesh, divided again and again: seen from outside the box around a part, it winds as any other surface with its border does that stays in
/// the box, such as a fan (ibid., section 4.2).
#[derive(Debug)]
pub struct Winding {
    /// In the order of the parts.
    triangles: Vec<u32>,
    root: Node,
}

/// Some of the triangles.
#[derive(Debug)]
struct Node {
    bounds: Bounds,
    /// The edges of the fan, which all meet where the first begins; only of a part that has more triangles than edges.
    fan: Option<Vec<[u32; 2]>>,
    within: Within,
}

#[derive(Debug)]
enum Within {
    Parts(Box<[Node; 2]>),
    /// Where they are in the list of all.
    Triangles(Range<usize>),
}

/// Edges of a border, each from its lower to its higher vertex, in order, and how often it is gone along so more than the other way.
type Border = Vec<([u32; 2], i32)>;

impl Winding {
    /// Of a mesh that keeps its shape.
    pub fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Self {
        let mesh = Triangles { vertices, triangles };
        let mut triangles: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        let count = triangles.len();
        let (root, _) = Node::new(mesh, &mut triangles, 0..count);
        Winding { triangles, root }
    }

    /// See [`SolidMesh::winding_number`](super::SolidMesh::winding_number).
    pub fn number(&self, vertices: &[Vector3<f64>], triangles: &[[u32; 3]], p: &Vector3<f64>) -> f64 {
        let mesh = Triangles { vertices, triangles };
        let mut sum = SolidAngleSum::default();
        self.root.add(self, mesh, p, &mut sum);
        sum.turns()
    }
}

impl Node {
    /// Of the triangles of a `range` of the list, which are put in the order of its parts; and its border.
    fn new(mesh: Triangles, triangles: &mut [u32], range: Range<usize>) -> (Node, Border) {
        let mine = &mut triangles[range.clone()];
        let count = mine.len();
        let bounds = Bounds::around(mine.iter().flat_map(|t| mesh.triangle(*t)), 0.0);
        let (within, border) = if count <= LEAF {
            let edges = mine.iter().flat_map(|t| {
                let [a, b, c] = mesh.triangles[*t as usize];
                [[a, b], [b, c], [c, a]].map(|[a, b]| ([a.min(b), a.max(b)], if a < b { 1 } else { -1 }))
            });
            (Within::Triangles(range), joined(edges.collect()))
        } else {
            let axis = (bounds.max - bounds.min).imax();
            let middle = |t: &u32| mesh.triangle(*t).iter().map(|v| v[axis]).sum::<f64>();
            let half = count / 2;
            mine.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
            let [(first, mut border), (second, others)] =
                [range.start..range.start + half, range.start + half..range.end]
                    .map(|range| Node::new(mesh, triangles, range));
            border.extend(others);
            (Within::Parts(Box::new([first, second])), joined(border))
        };
        let edges = || {
            border.iter().flat_map(|&([a, b], times)| {
                let edge = if times > 0 { [a, b] } else { [b, a] };
                std::iter::repeat_n(edge, times.unsigned_abs() as usize)
            })
        };
        let fan = (edges().count() < count).then(|| edges().collect());
        (Node { bounds, fan, within }, border)
    }

    /// Adds what it winds about `p`.
    fn add(&self, of: &Winding, mesh: Triangles, p: &Vector3<f64>, sum: &mut SolidAngleSum) {
        let outside = (0..3).any(|i| p[i] < self.bounds.min[i] || p[i] > self.bounds.max[i]);
        match (&self.fan, &self.within) {
            (Some(edges), _) if outside => {
                let Some([corner, _]) = edges.first() else { return };
                let corner = mesh.vertices[*corner as usize] - p;
                for edge in edges {
                    let [a, b] = edge.map(|v| mesh.vertices[v as usize] - p);
                    sum.add(&[corner, a, b]);
                }
            }
            (_, Within::Parts(parts)) => parts.iter().for_each(|part| part.add(of, mesh, p, sum)),
            (_, Within::Triangles(range)) => {
                for t in &of.triangles[range.clone()] {
                    sum.add(&mesh.triangle(*t).map(|v| v - p));
                }
            }
        }
    }
}

/// A border with each edge once, without those that are gone along as often either way.
fn joined(mut border: Border) -> Border {
    border.sort_unstable_by_key(|(edge, _)| *edge);
    border.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    border.retain(|(_, times)| *times != 0);
    border
}

/// SolidAngleSum of solid angles of triangles (A. Van Oosterom & J. Strackee 1983), halved: these are added by multiplying complex numbers, and counting how often the
/// product's own angle, within ±π, goes over that.
struct SolidAngleSum {
    re: f64,
    im: f64,
    turns: f64,
}

impl Default for SolidAngleSum {
    fn default() -> Self {
        SolidAngleSum { re: 1.0, im: 0.0, turns: 0.0 }
    }
}

impl SolidAngleSum {
    /// Adds a triangle with these corners as seen from the origin.
    fn add(&mut self, [a, b, c]: &[Vector3<f64>; 3]) {
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let sin = a.dot(&b.cross(c));
        let cos = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        let [re, im] = [self.re * cos - self.im * sin, self.re * sin + self.im * cos];
        let size = re.abs() + im.abs();
        if size == 0.0 {
            return;
        }
        if sin > 0.0 && self.im >= 0.0 && im < 0.0 {
            self.turns += 1.0;
        } else if sin < 0.0 && self.im < 0.0 && im >= 0.0 {
            self.turns -= 1.0;
        }
        (self.re, self.im) = (re / size, im / size);
    }

    /// The sum over 4π.
    fn turns(&self) -> f64 {
        self.turns + self.im.atan2(self.re) / TAU
    }
}
