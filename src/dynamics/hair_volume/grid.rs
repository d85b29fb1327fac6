//! A sparse grid in blocks of nodes, with quadratic B-splines as shape functions.

use nalgebra::Vector3;
use rayon::prelude::*;

/// Nodes along the edge of a block.
const EDGE: usize = 4;

/// Nodes of a block.
const BLOCK: usize = EDGE * EDGE * EDGE;

/// Most blocks of the box that hair can reach: at 1 cm between nodes, a cube of 4 m. The table has an entry
/// for each, 4 MB in all. Without a bound a guide that grows a kilometre from the others would take all
/// memory.
pub(super) const MAX_BLOCKS: usize = 1 << 20;

/// Table entry of a block without nodes.
const ABSENT: u32 = u32::MAX;

/// Values at a node.
pub(super) type Node = [f64; ENTRIES];

/// Number of values at a node.
pub(super) const ENTRIES: usize = 12;

/// A node in a line and a half of the processor's cache.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(32))]
struct Aligned(Node);

/// Nodes near the points of one sub-step.
#[derive(Debug, Default)]
pub(super) struct Grid {
    /// Distance between nodes, m.
    spacing: f64,
    /// Lowest block of the box, counted from the origin.
    first: [f64; 3],
    /// Blocks along each axis.
    size: [usize; 3],
    /// Index of each block's first node in `nodes`, or [`ABSENT`].
    table: Vec<u32>,
    nodes: Vec<Aligned>,
    /// For each block, the index of its first corner in `corners`, then their number.
    first_corner: Vec<u32>,
    /// What lies in the blocks, block by block: 8 times the index of a stencil, plus that of the corner of it.
    corners: Vec<u32>,
}

/// The 27 nodes around a point: its lowest node, and those up to two above it along each axis.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stencil {
    /// Blocks below the lowest node's, along each axis.
    block: [u32; 3],
    /// The lowest node in its block.
    node: [u8; 3],
    /// The point, counted from the lowest node, in distances between nodes: 0.5 to 1.5.
    at: [f64; 3],
    /// The first nodes of the blocks of its corners, of which those that it does not reach have no meaning. Corner
    /// (x, y, z), each 0 or 1, has the index 4 x + 2 y + z.
    blocks: [u32; 8],
}

impl Grid {
    /// A grid over the box between `low` and `high`, m, whose nodes are at least `spacing`, m, apart: as far
    /// as [`MAX_BLOCKS`] requires.
    pub fn new(mut spacing: f64, [low, high]: [Vector3<f64>; 2]) -> Self {
        loop {
            // A stencil reaches one node below its point, and two above.
            let block = |x: f64, nodes: f64| ((x / spacing + nodes) / EDGE as f64).floor();
            let first: [f64; 3] = std::array::from_fn(|c| block(low[c], -1.0));
            let size: [f64; 3] = std::array::from_fn(|c| block(high[c], 2.0) - first[c] + 1.0);
            if size.iter().product::<f64>() <= MAX_BLOCKS as f64 {
                let size = size.map(|blocks| blocks as usize);
                let table = vec![ABSENT; size.iter().product()];
                return Grid { spacing, first, size, table, ..Grid::default() };
            }
            spacing *= 1.25;
        }
    }

    /// Distance between nodes, m.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Volume of a cell, m³.
    pub fn cell_volume(&self) -> f64 {
        self.spacing.powi(3)
    }

    /// Blocks of the box.
    #[cfg(test)]
    pub fn blocks(&self) -> usize {
        self.table.len()
    }

    /// True if a point, m, is in the box.
    pub fn contains(&self, x: &Vector3<f64>) -> bool {
        (0..3).all(|c| {
            let u = x[c] / self.spacing - self.first[c] * EDGE as f64;
            (0.5..=(self.size[c] * EDGE) as f64 - 2.0).contains(&u)
        })
    }

    /// The stencil of point `x`, m, or of the point of the box next to it, without its blocks.
    pub fn stencil(&self, x: &Vector3<f64>) -> Stencil {
        let mut stencil = Stencil::default();
        for c in 0..3 {
            let nodes = (self.size[c] * EDGE) as f64;
            let u = (x[c] / self.spacing - self.first[c] * EDGE as f64).clamp(0.5, nodes - 2.0);
            let lowest = (u - 0.5) as usize;
            stencil.block[c] = (lowest / EDGE) as u32;
            stencil.node[c] = (lowest % EDGE) as u8;
            stencil.at[c] = u - lowest as f64;
        }
        stencil
    }

    /// Makes the blocks that the stencils lie in, and no others.
    pub fn make_blocks(&mut self, stencils: &mut [Stencil]) {
        let Grid { size, table, nodes, first_corner, corners, .. } = self;
        table.fill(ABSENT);
        first_corner.clear();
        first_corner.push(0);
        for stencil in &mut *stencils {
            let [x, y, z] = stencil.block.map(|block| block as usize);
            for corner in stencil.corners() {
                let at = [x + (corner >> 2), y + (corner >> 1 & 1), z + (corner & 1)];
                let block = &mut table[(at[0] * size[1] + at[1]) * size[2] + at[2]];
                if *block == ABSENT {
                    *block = ((first_corner.len() - 1) * BLOCK) as u32;
                    first_corner.push(0);
                }
                stencil.blocks[corner] = *block;
                first_corner[*block as usize / BLOCK] += 1;
            }
        }
        let mut sum = 0;
        for first in &mut *first_corner {
            sum += *first;
            *first = sum;
        }
        corners.resize(sum as usize, 0);
        // From the last on, so that each block has them in the order of the stencils.
        for (i, stencil) in stencils.iter().enumerate().rev() {
            for corner in stencil.corners() {
                let first = &mut first_corner[stencil.blocks[corner] as usize / BLOCK];
                *first -= 1;
                corners[*first as usize] = (8 * i + corner) as u32;
            }
        }
        nodes.resize((first_corner.len() - 1) * BLOCK, Aligned::default());
    }

    /// Sets the nodes to the sums of the `values` of all stencils that reach them, by their weights.
    pub fn sum(&mut self, stencils: &[Stencil], values: &[Node]) {
        self.each_block(|corners, nodes| {
            nodes.fill(Aligned::default());
            for (i, corner) in corners.iter().map(place) {
                let values = &values[i];
                stencils[i].for_each_in(corner, |node, weight| {
                    for (sum, value) in nodes[node].0.iter_mut().zip(values) {
                        *sum += weight * value;
                    }
                });
            }
        });
    }

    /// Adds one entry of the `values`, where it is not zero, to that of the nodes.
    pub fn add_entry(&mut self, stencils: &[Stencil], entry: usize, values: &[Node]) {
        self.each_block(|corners, nodes| {
            for (i, corner) in corners.iter().map(place).filter(|(i, _)| values[*i][entry] != 0.0) {
                let value = values[i][entry];
                stencils[i].for_each_in(corner, |node, weight| nodes[node].0[entry] += weight * value);
            }
        });
    }

    /// Calls `then` for each block, with what of `corners` lies there and with its nodes.
    fn each_block(&mut self, then: impl Fn(&[u32], &mut [Aligned; BLOCK]) + Sync) {
        let Grid { nodes, first_corner, corners, .. } = self;
        let (blocks, _) = nodes.as_chunks_mut::<BLOCK>();
        let all = blocks.par_iter_mut().zip(first_corner.par_windows(2));
        all.for_each(|(nodes, range)| then(&corners[range[0] as usize..range[1] as usize], nodes));
    }

    /// The values at the point of a stencil.
    pub fn values(&self, stencil: &Stencil) -> Node {
        let mut values = [0.0; ENTRIES];
        stencil.for_each(|node, weight| {
            for (sum, value) in values.iter_mut().zip(&self.nodes[node].0) {
                *sum += weight * value;
            }
        });
        values
    }

    /// Calls `then` with the weights and the values of the nodes of a stencil.
    #[inline(always)]
    pub fn for_each(&self, stencil: &Stencil, mut then: impl FnMut(f64, &Node)) {
        stencil.for_each(|node, weight| then(weight, &self.nodes[node].0));
    }

    /// The gradient of `value` of the nodes at the point of a stencil, per m.
    pub fn gradient(&self, stencil: &Stencil, value: impl Fn(&Node) -> f64) -> Vector3<f64> {
        let ([x, y, z], [dx, dy, dz]) = (stencil.weights(), stencil.slopes(self.spacing));
        let nodes = stencil.nodes();
        let mut sum = Vector3::zeros();
        for i in 0..3 {
            for j in 0..3 {
                let (along_x, along_y, across) = (dx[i] * y[j], x[i] * dy[j], x[i] * y[j]);
                for k in 0..3 {
                    let slopes = Vector3::new(along_x * z[k], along_y * z[k], across * dz[k]);
                    sum += slopes * value(&self.nodes[nodes([i, j, k])].0);
                }
            }
        }
        sum
    }
}

impl Stencil {
    /// The shape functions along each axis.
    fn weights(&self) -> [[f64; 3]; 3] {
        self.at.map(weights)
    }

    /// Their derivatives, 1/m, of nodes that are `spacing`, m, apart.
    fn slopes(&self, spacing: f64) -> [[f64; 3]; 3] {
        self.at.map(|f| [f - 1.5, 2.0 - 2.0 * f, f - 0.5].map(|w| w / spacing))
    }

    /// The corners whose blocks it reaches.
    fn corners(&self) -> impl Iterator<Item = usize> + use<> {
        let [x, y, z] = self.node.map(|node| usize::from(usize::from(node) + 2 >= EDGE));
        (0..8).filter(move |corner| corner & !(x << 2 | y << 1 | z) == 0)
    }

    /// The index of each of its nodes.
    fn nodes(&self) -> impl Fn([usize; 3]) -> usize {
        // The corner that each node along an axis lies in, and the node within it.
        let along = |c: usize, corner: usize, stride: usize| {
            [0, 1, 2]
                .map(|i| usize::from(self.node[c]) + i)
                .map(|at| (at / EDGE * corner, at % EDGE * stride))
        };
        let (x, y, z) = (along(0, 4, EDGE * EDGE), along(1, 2, EDGE), along(2, 1, 1));
        let blocks = self.blocks;
        move |[i, j, k]| blocks[x[i].0 + y[j].0 + z[k].0] as usize + x[i].1 + y[j].1 + z[k].1
    }

    /// Calls `then` with each node and its weight.
    #[inline(always)]
    fn for_each(&self, mut then: impl FnMut(usize, f64)) {
        let ([x, y, z], nodes) = (self.weights(), self.nodes());
        for (i, x) in x.iter().enumerate() {
            for (j, y) in y.iter().enumerate() {
                let across = x * y;
                z.iter().enumerate().for_each(|(k, z)| then(nodes([i, j, k]), across * z));
            }
        }
    }

    /// Calls `then` with each node in the block of `corner`, counted from its first, and its weight.
    #[inline(always)]
    fn for_each_in(&self, corner: usize, mut then: impl FnMut(usize, f64)) {
        // The nodes along an axis that lie in the block, from the first on, and their weights.
        let along = |c: usize, beyond: usize| {
            let (lowest, inside) = (usize::from(self.node[c]), (EDGE - usize::from(self.node[c])).min(3));
            let weights = weights(self.at[c]);
            match beyond {
                0 => (lowest, inside, weights),
                _ => (0, 3 - inside, [weights[inside % 3], weights[(inside + 1) % 3], weights[2]]),
            }
        };
        let (x, y, z) = (along(0, corner >> 2), along(1, corner >> 1 & 1), along(2, corner & 1));
        for i in 0..x.1 {
            for j in 0..y.1 {
                let (across, row) = (x.2[i] * y.2[j], ((x.0 + i) * EDGE + y.0 + j) * EDGE + z.0);
                (0..z.1).for_each(|k| then(row + k, across * z.2[k]));
            }
        }
    }
}

/// The index of a stencil, and that of a corner of it, that an entry of [`Grid::corners`] stands for.
fn place(corner: &u32) -> (usize, usize) {
    (*corner as usize / 8, *corner as usize % 8)
}

/// The shape functions of the three nodes along an axis, where the point is at `f`. They add up to 1.
#[inline(always)]
fn weights(f: f64) -> [f64; 3] {
    [0.5 * (1.5 - f) * (1.5 - f), 0.75 - (f - 1.0) * (f - 1.0), 0.5 * (f - 0.5) * (f - 0.5)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The entry that is added twice.
    const ENTRY: usize = 7;

    /// What lies on the grid, by its definition.
    #[test]
    fn values_are_spread_by_the_shape_functions_of_all_nodes() {
        let draw = |a: u64, i: usize| crate::math::random::unit(a, i as u64) - 0.5;
        // Two clusters, so that there are blocks without nodes, and points beyond the box.
        let point = |i: usize| {
            Vector3::new(draw(1, i), draw(2, i), draw(3, i)) * 0.2 + Vector3::x() * (0.6 * (i % 2) as f64)
        };
        let points: Vec<Vector3<f64>> = (0..400).map(point).collect();
        let values: Vec<Node> = (0..400).map(|i| std::array::from_fn(|k| draw(4 + k as u64, i))).collect();
        let (spacing, box_) = (0.01, [Vector3::repeat(-0.11), Vector3::new(0.75, 0.11, 0.08)]);
        let mut grid = Grid::new(spacing, box_);
        // A shape function, of a distance in spacings.
        let shape = |d: f64| match d.abs() {
            d if d < 0.5 => 0.75 - d * d,
            d if d < 1.5 => 0.5 * (1.5 - d) * (1.5 - d),
            _ => 0.0,
        };
        let mut stencils: Vec<Stencil> = points.iter().map(|x| grid.stencil(x)).collect();
        grid.make_blocks(&mut stencils);
        grid.sum(&stencils, &values);
        // A second grid of fewer points, in the memory of the first.
        for count in [400, 70] {
            let mut stencils = stencils[..count].to_vec();
            grid.make_blocks(&mut stencils);
            grid.sum(&stencils, &values[..count]);
            grid.add_entry(&stencils, ENTRY, &values[..count]);
            for (i, x) in points[..count].iter().enumerate().filter(|(_, x)| grid.contains(x)) {
                // Σ over nodes of N(x) Σ over points of N(y) value.
                let mut expected = [0.0; ENTRIES];
                let lowest = x.map(|x| (x / spacing).round() - 1.0);
                for node in 0..27 {
                    let offset = Vector3::new((node / 9) as f64, (node / 3 % 3) as f64, (node % 3) as f64);
                    let weight = |y: &Vector3<f64>| (y / spacing - lowest - offset).map(shape).product();
                    for (y, values) in points[..count].iter().zip(&values).filter(|(y, _)| grid.contains(y)) {
                        let weight = weight(x) * weight(y);
                        expected.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
                    }
                }
                expected[ENTRY] *= 2.0;
                for (found, expected) in grid.values(&stencils[i]).iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-12, "{i}: {found} {expected}");
                }
            }
        }
    }
}
