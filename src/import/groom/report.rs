//! The report on an imported groom.

use super::build::BuildReport;
use super::scalp::RootReport;
use crate::import::strand_file::StrandFileReport;
use std::fmt;
use std::path::PathBuf;

/// What the files contain, and how well the groom represents their strands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GroomReport {
    /// The file of the guides, and the separate file of render strands if there is one.
    pub sources: Vec<StrandFileReport>,
    /// Root positions of each file relative to the scalp; empty without a scalp.
    pub roots: Vec<RootReport>,
    /// The fit of the groom to the strands.
    pub fit: BuildReport,
    /// Strands of the files in whose place others were grown.
    pub not_drawn: usize,
    /// What the artist should check.
    pub warnings: Vec<String>,
}

impl GroomReport {
    pub(super) fn new(
        sources: Vec<StrandFileReport>,
        roots: Vec<RootReport>,
        fit: BuildReport,
        not_drawn: usize,
    ) -> Self {
        let mut warnings = warnings(&sources, &roots);
        if not_drawn > 0 {
            warnings.push(format!(
                "{not_drawn} strands of the file are not drawn: others are grown in their place, as asked"
            ));
        }
        GroomReport { sources, roots, fit, not_drawn, warnings }
    }

    /// The lines of the report for the groom file, without the folders of the sources.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut sources = self.sources.clone();
        for source in &mut sources {
            source.path = source.path.file_name().map_or_else(PathBuf::new, PathBuf::from);
        }
        let report = GroomReport::new(sources, self.roots.clone(), self.fit.clone(), self.not_drawn);
        report.to_string().lines().map(|line| line.trim().to_string()).collect()
    }
}

/// Warnings where most roots are off the scalp, or where more than a tenth of the strands were dropped.
fn warnings(sources: &[StrandFileReport], roots: &[RootReport]) -> Vec<String> {
    let off = sources.iter().zip(roots).filter(|(_, r)| r.off * 2 > r.roots).map(|(source, r)| {
        format!(
            "{}: most roots are off the scalp (mean {:.0} mm): check the units and the offset of strands and head",
            source.path.display(),
            r.distance[0] * 1e3
        )
    });
    let dropped = sources
        .iter()
        .filter(|s| s.kept * 10 < s.read * 9)
        .map(|s| format!("{}: {} of {} strands dropped", s.path.display(), s.read - s.kept, s.read));
    off.chain(dropped).collect()
}

impl fmt::Display for GroomReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, source) in self.sources.iter().enumerate() {
            write!(f, "{source}")?;
            self.roots.get(i).map_or(Ok(()), |roots| writeln!(f, "  scalp: {roots}"))?;
        }
        write!(f, "{}", self.fit)?;
        if self.fit.counts[2] > 0 && self.fit.strand_error.is_none() {
            writeln!(f, "  --strands-per-guide N grows another number of strands, 0 none")?;
        }
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}
