//! Triangle meshes as plain data.

use nalgebra::Vector3;

/// A triangle mesh, open or closed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriMesh {
    /// Vertices, m.
    pub vertices: Vec<Vector3<f64>>,
    /// Vertex indices, counter-clockwise seen from outside; none degenerate.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// Removes triangles of zero area and returns their number.
    ///
    /// # Errors
    /// A message, if no triangle is left.
    pub(crate) fn drop_degenerate(&mut self) -> Result<usize, String> {
        let all = self.triangles.len();
        let mut has_area = self.have_area().into_iter();
        self.triangles.retain(|_| has_area.next().unwrap_or(false));
        match (self.triangles.len(), all) {
            (0, 0) => Err("has no triangles".into()),
            (0, _) => Err(format!("has no triangles with area: all {all} are degenerate")),
            (kept, all) => Ok(all - kept),
        }
    }

    /// Whether each triangle has an area.
    pub(crate) fn have_area(&self) -> Vec<bool> {
        // Relative to the sides: a small triangle is valid, a needle of zero area has no normal.
        let has_area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.vertices[i as usize]);
            let (u, v) = (b - a, c - a);
            u.cross(&v).norm() > 1e-12 * u.norm_squared().max(v.norm_squared())
        };
        self.triangles.iter().map(has_area).collect()
    }
}
