//! A sparse grid in blocks of nodes, with quadratic B-splines as shape functions.

use nalgebra::Vector3;

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
pub(super) type Node = [f64; 8];

/// A node that lies in one line of the processor's cache.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
struct Aligned(Node);

/// Nodes near the points of one sub-step; their values are zero until something is added.
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
}

/// The 27 nodes around a point, with the shape functions along each axis.
#[derive(Debug, Clone, Default)]
pub(super) struct Stencil {
    /// Along x, y and z.
    nodes: [[[u32; 3]; 3]; 3],
    weight: [[f64; 3]; 3],
    /// Derivatives of the weights, 1/m.
    slope: [[f64; 3]; 3],
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
                return Grid { spacing, first, size, table, nodes: Vec::new() };
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

    /// Removes all values.
    pub fn clear(&mut self) {
        self.table.fill(ABSENT);
        self.nodes.clear();
    }

    /// The stencil of point `x`, m, or of the point of the box next to it. Makes the blocks that it lies in.
    pub fn touch(&mut self, x: &Vector3<f64>) -> Stencil {
        let (base, weight, slope) = self.shape(x);
        // Along each axis: the block of each of the three nodes, and the node within it.
        let along = |c: usize, blocks: usize, nodes: usize| -> [(usize, usize); 3] {
            [0, 1, 2].map(|i| base[c] + i).map(|at| (at / EDGE * blocks, at % EDGE * nodes))
        };
        let x = along(0, self.size[1] * self.size[2], EDGE * EDGE);
        let (y, z) = (along(1, self.size[2], EDGE), along(2, 1, 1));
        let mut nodes = [[[0; 3]; 3]; 3];
        for (plane, x) in nodes.iter_mut().zip(x) {
            for (row, y) in plane.iter_mut().zip(y) {
                for (node, z) in row.iter_mut().zip(z) {
                    *node = self.block(x.0 + y.0 + z.0) + (x.1 + y.1 + z.1) as u32;
                }
            }
        }
        Stencil { nodes, weight, slope }
    }

    /// First node of a block, which is made if it is missing.
    fn block(&mut self, block: usize) -> u32 {
        let Grid { table, nodes, .. } = self;
        if table[block] == ABSENT {
            table[block] = nodes.len() as u32;
            nodes.resize(nodes.len() + BLOCK, Aligned::default());
        }
        table[block]
    }

    /// Lowest node of the stencil around `x`, counted from the first block, and the shape functions.
    fn shape(&self, x: &Vector3<f64>) -> ([usize; 3], [[f64; 3]; 3], [[f64; 3]; 3]) {
        let mut base = [0; 3];
        let (mut weight, mut slope) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for c in 0..3 {
            let nodes = (self.size[c] * EDGE) as f64;
            let u = (x[c] / self.spacing - self.first[c] * EDGE as f64).clamp(0.5, nodes - 2.0);
            base[c] = (u - 0.5) as usize;
            let f = u - base[c] as f64;
            weight[c] =
                [0.5 * (1.5 - f) * (1.5 - f), 0.75 - (f - 1.0) * (f - 1.0), 0.5 * (f - 0.5) * (f - 0.5)];
            slope[c] = [f - 1.5, 2.0 - 2.0 * f, f - 0.5].map(|w| w / self.spacing);
        }
        (base, weight, slope)
    }

    /// Adds `values` to the nodes of a stencil, by their weights.
    pub fn add(&mut self, stencil: &Stencil, values: &Node) {
        stencil.for_each(|node, weight| {
            for (sum, value) in self.nodes[node].0.iter_mut().zip(values) {
                *sum += weight * value;
            }
        });
    }

    /// Adds `value` to one entry of the nodes of a stencil, by their weights.
    pub fn add_entry(&mut self, stencil: &Stencil, entry: usize, value: f64) {
        stencil.for_each(|node, weight| self.nodes[node].0[entry] += weight * value);
    }

    /// The values at the point of a stencil.
    pub fn values(&self, stencil: &Stencil) -> Node {
        let mut values = [0.0; 8];
        stencil.for_each(|node, weight| {
            for (sum, value) in values.iter_mut().zip(&self.nodes[node].0) {
                *sum += weight * value;
            }
        });
        values
    }

    /// The gradient of `value` of the nodes at the point of a stencil, per m.
    pub fn gradient(&self, stencil: &Stencil, value: impl Fn(&Node) -> f64) -> Vector3<f64> {
        let ([x, y, z], [dx, dy, dz]) = (stencil.weight, stencil.slope);
        let mut sum = Vector3::zeros();
        for (plane, (x, dx)) in stencil.nodes.iter().zip(x.iter().zip(dx)) {
            for (row, (y, dy)) in plane.iter().zip(y.iter().zip(dy)) {
                let (along_x, along_y, across) = (dx * y, x * dy, x * y);
                for (node, (z, dz)) in row.iter().zip(z.iter().zip(dz)) {
                    let slopes = Vector3::new(along_x * z, along_y * z, across * dz);
                    sum += slopes * value(&self.nodes[*node as usize].0);
                }
            }
        }
        sum
    }
}

impl Stencil {
    /// Calls `then` with each node and its weight. The weights add up to 1.
    #[inline(always)]
    fn for_each(&self, mut then: impl FnMut(usize, f64)) {
        let [x, y, z] = &self.weight;
        for (plane, x) in self.nodes.iter().zip(x) {
            for (row, y) in plane.iter().zip(y) {
                let across = x * y;
                row.iter().zip(z).for_each(|(node, z)| then(*node as usize, across * z));
            }
        }
    }
}
