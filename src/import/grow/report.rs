//! The report on grown fur.

use crate::import::groom::build::BuildReport;
use crate::scene::UpAxis;
use std::fmt;
use std::path::PathBuf;

/// What was grown.
#[derive(Debug, Clone, PartialEq)]
pub struct GrowReport {
    /// The mesh.
    pub path: PathBuf,
    /// Metres per unit of the mesh, and its up axis.
    pub convention: (f64, UpAxis),
    /// Remarks on the mesh.
    pub notes: Vec<String>,
    /// Triangles and area, m², that bear fur.
    pub skin: (usize, f64),
    /// Number of strands, or of guides without strands.
    pub strands: usize,
    /// Vertices of each.
    pub vertices: usize,
    /// Shortest, mean and greatest length, m.
    pub length: [f64; 3],
    /// Greatest depth of a strand in the mesh, m, and the number of strands that are in it.
    pub inside: (f64, usize),
    /// The fit of the wisps.
    pub fit: BuildReport,
}

impl GrowReport {
    /// The lines of the report for the groom file, without the folder of the mesh.
    pub(super) fn notes(&self) -> Vec<String> {
        let path = self.path.file_name().map_or_else(PathBuf::new, PathBuf::from);
        GrowReport { path, ..self.clone() }.to_string().lines().map(String::from).collect()
    }
}

impl fmt::Display for GrowReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (triangles, area) = self.skin;
        let up = if self.convention.1 == UpAxis::Y { "Y" } else { "Z" };
        writeln!(
            f,
            "{}: {} m per unit, {up} up; {triangles} triangles of {area:.3} m² bear fur",
            self.path.display(),
            self.convention.0
        )?;
        self.notes.iter().try_for_each(|note| writeln!(f, "{note}"))?;
        let [guides, leaves, strands] = self.fit.counts;
        let density = self.strands as f64 / (area * 1e4);
        writeln!(f, "{guides} guides in {leaves} leaf wisps, {strands} strands: {density:.2} on each cm²")?;
        let [shortest, mean, longest] = self.length.map(|length| length * 1e3);
        writeln!(
            f,
            "{} vertices each; {shortest:.1} to {longest:.1} mm long, {mean:.1} mm on average",
            self.vertices
        )?;
        let (depth, inside) = self.inside;
        writeln!(f, "{inside} strands enter the mesh, {:.2} mm deep at most", depth * 1e3)?;
        self.fit.levels.iter().enumerate().try_for_each(|(level, fit)| writeln!(f, "level {level}: {fit}"))
    }
}
