//! Generalised winding numbers (A. Jacobson, L. Kavan & O. Sorkine-Hornung, "Robust inside-outside
//! segmentation using generalized winding numbers", 2013).

use crate::geometry::bounds::Bounds;
use crate::math;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::ops::Range;

/// Maximum number of triangles in a leaf.
const LEAF: usize = 16;

/// Vertices, m, and triangles of a mesh.
#[derive(Clone, Copy)]
pub struct Triangles<'a> {
    pub vertices: &'a [Vector3<f64>],
    pub triangles: &'a [[u32; 3]],
}

impl<'a> Triangles<'a> {
    fn vertex(&self, v: u32) -> &'a Vector3<f64> {
        &self.vertices[v as usize]
    }

    /// Corners of a triangle.
    fn corners(&self, t: u32) -> [&'a Vector3<f64>; 3] {
        self.triangles[t as usize].map(|v| self.vertex(v))
    }
}

/// A hierarchy over the triangles of a mesh. Seen from outside the bounding box of a node, its triangles wind
/// as any other surface in the box with the same boundary does, such as a fan (ibid., section 4.2).
#[derive(Debug)]
pub struct WindingTree {
    /// Triangles in the order of the leaves.
    order: Vec<u32>,
    root: Node,
}

/// A subset of the triangles.
#[derive(Debug)]
struct Node {
    bounds: Bounds,
    /// Boundary edges; with the first vertex as apex they make the fan. `None` if the fan has no fewer
    /// triangles.
    fan: Option<Vec<[u32; 2]>>,
    content: Content,
}

#[derive(Debug)]
enum Content {
    Children(Box<[Node; 2]>),
    /// A range of [`WindingTree::order`].
    Triangles(Range<usize>),
}

/// Boundary edges in ascending order, each from its lower to its higher vertex, with the multiplicity in that
/// direction less that in the other.
type Boundary = Vec<([u32; 2], i32)>;

impl WindingTree {
    /// The hierarchy of `mesh`.
    pub fn new(mesh: Triangles) -> Self {
        let mut order: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        let count = order.len();
        let (root, _) = Node::new(mesh, &mut order, 0..count);
        WindingTree { order, root }
    }

    /// Winding number of `mesh`, for which the tree was built, about `p`, m.
    pub fn number(&self, mesh: Triangles, p: &Vector3<f64>) -> f64 {
        let mut sum = SolidAngleSum::default();
        self.root.add(self, mesh, p, &mut sum);
        sum.turns()
    }
}

impl Node {
    /// The node of a `range` of `order`, which it sorts by its leaves; and the boundary of its triangles.
    fn new(mesh: Triangles, order: &mut [u32], range: Range<usize>) -> (Node, Boundary) {
        let mine = &mut order[range.clone()];
        let count = mine.len();
        let bounds = Bounds::around(mine.iter().flat_map(|t| mesh.corners(*t)), 0.0);
        let (content, boundary) = if count <= LEAF {
            let edges = mine.iter().flat_map(|t| {
                let [a, b, c] = mesh.triangles[*t as usize];
                [[a, b], [b, c], [c, a]].map(|[a, b]| ([a.min(b), a.max(b)], if a < b { 1 } else { -1 }))
            });
            (Content::Triangles(range), merged(edges.collect()))
        } else {
            let axis = (bounds.max - bounds.min).imax();
            let centroid = |t: &u32| mesh.corners(*t).iter().map(|v| v[axis]).sum::<f64>();
            let half = count / 2;
            mine.select_nth_unstable_by(half, |a, b| centroid(a).total_cmp(&centroid(b)).then(a.cmp(b)));
            let [(first, mut boundary), (second, others)] =
                [range.start..range.start + half, range.start + half..range.end]
                    .map(|range| Node::new(mesh, order, range));
            boundary.extend(others);
            (Content::Children(Box::new([first, second])), merged(boundary))
        };
        let edges = || {
            boundary.iter().flat_map(|&([a, b], times)| {
                let edge = if times > 0 { [a, b] } else { [b, a] };
                std::iter::repeat_n(edge, times.unsigned_abs() as usize)
            })
        };
        let fan = (edges().count() < count).then(|| edges().collect());
        (Node { bounds, fan, content }, boundary)
    }

    /// Adds the solid angle of the node's triangles as seen from `p`.
    fn add(&self, tree: &WindingTree, mesh: Triangles, p: &Vector3<f64>, sum: &mut SolidAngleSum) {
        match (&self.fan, &self.content) {
            (Some(edges), _) if !self.bounds.contains(p) => {
                let Some([apex, _]) = edges.first() else { return };
                let apex = mesh.vertex(*apex) - p;
                for edge in edges {
                    let [a, b] = edge.map(|v| mesh.vertex(v) - p);
                    sum.add(&[apex, a, b]);
                }
            }
            (_, Content::Children(children)) => {
                children.iter().for_each(|child| child.add(tree, mesh, p, sum));
            }
            (_, Content::Triangles(range)) => {
                for t in &tree.order[range.clone()] {
                    sum.add(&mesh.corners(*t).map(|v| v - p));
                }
            }
        }
    }
}

/// Merges equal edges, and drops those whose directions cancel.
fn merged(mut boundary: Boundary) -> Boundary {
    boundary.sort_unstable_by_key(|(edge, _)| *edge);
    math::merge_equal_keys(&mut boundary);
    boundary.retain(|(_, times)| *times != 0);
    boundary
}

/// Sum of half the solid angles of triangles (A. Van Oosterom & J. Strackee 1983). The half-angles are added
/// by multiplying complex numbers, counting how often the argument of the product passes ±π.
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
    /// Adds the triangle with these corners, as seen from the origin.
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
