//! Builds a groom over guides: the wisp hierarchy, the render strands, and measurements of the fit.

use super::coverage::covering_width;
use super::features::{Features, nearest};
use super::fidelity::{self, Curl, LevelFit};
use super::generate::{self, Generation};
use super::hierarchy::{self, HierarchyShape, Members};
use super::resample::{Resample, ResampleError, resample};
use super::scalp::Scalp;
use super::sections::Sections;
use crate::scene::{Convention, Curves, Groom, Group, Guides, Material, Strands, Tree};
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::fmt;

/// How a groom is built over strands.
#[derive(Debug, Clone, PartialEq)]
pub struct BuildOptions {
    /// Vertices of the guides.
    pub guide_vertices: Resample,
    /// Vertices of given render strands.
    pub strand_vertices: Resample,
    /// How render strands are generated if none are given.
    pub generation: Generation,
    /// Size of the hierarchy.
    pub hierarchy: HierarchyShape,
    /// Sections of each wisp, equal to the strain nodes of its guides; 2 to 64.
    pub sections: usize,
    /// Material of the strands.
    pub material: Material,
    /// Drawn width at root and tip, m; `None` for the width at which the strands cover the skin as hairs
    /// cover a scalp.
    pub width: Option<[f64; 2]>,
}

impl Default for BuildOptions {
    /// Two levels, eight sections, 32 vertices per guide or as many as curls need, and hair that does not sag
    /// at the start.
    fn default() -> Self {
        BuildOptions {
            guide_vertices: Resample::Curls(32),
            strand_vertices: Resample::Keep,
            generation: Generation::default(),
            hierarchy: HierarchyShape { levels: 2, coarse: None, leaves: None },
            sections: 8,
            material: Material { sag_free: 1.0, ..Material::default() },
            width: None,
        }
    }
}

impl BuildOptions {
    /// Checks the ranges of all options.
    ///
    /// # Errors
    /// [`Error::Usage`] with every option that is out of range.
    pub(in crate::import) fn check(&self) -> Result<()> {
        let mut errors = Vec::new();
        let mut require = |ok: bool, what: &str| {
            if !ok {
                errors.push(what.to_string());
            }
        };
        require((2..=64).contains(&self.sections), "the number of sections must be 2 to 64");
        require((1..=8).contains(&self.hierarchy.levels), "the number of levels must be 1 to 8");
        require(self.hierarchy.coarse != Some(0), "the number of coarse wisps must be at least 1");
        require(
            self.generation.vertices.is_none_or(|n| n >= 2),
            "generated strands need at least 2 vertices",
        );
        require(
            (0.0..1.0).contains(&self.generation.length_variation),
            "the shortening of generated strands must be at least 0 and less than 1",
        );
        require(
            (0.0..=1.0).contains(&self.generation.clump),
            "the clumping of generated strands must be 0 to 1",
        );
        for to in [self.guide_vertices, self.strand_vertices] {
            require(
                !matches!(to, Resample::Vertices(0 | 1) | Resample::Curls(0 | 1)),
                "the number of vertices per strand must be at least 2",
            );
            require(
                !matches!(to, Resample::Spacing(s) if s.is_nan() || s <= 0.0),
                "the spacing of vertices must be positive",
            );
        }
        if errors.is_empty() { Ok(()) } else { Err(Error::Usage(errors.join("; "))) }
    }
}

/// Fit of a groom to its strands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BuildReport {
    /// Number of guides, leaf wisps and render strands.
    pub counts: [usize; 3],
    /// Change of the guides by resampling.
    pub guide_error: ResampleError,
    /// Change of the render strands by resampling; `None` if they are generated.
    pub strand_error: Option<ResampleError>,
    /// Render strands that were to be generated around each guide.
    pub per_guide: usize,
    /// Curvature of the guides.
    pub curl: Curl,
    /// Fit of the wisps, from the coarse level to the leaves.
    pub levels: Vec<LevelFit>,
}

/// Given render strands.
pub(crate) struct RenderStrands {
    /// The strands, m, rest space.
    pub(crate) curves: Curves,
    /// The clump of each strand.
    pub(crate) clumps: Vec<Option<i32>>,
}

/// Builds a groom over `guides` (m, rest space; at least one, each with a length) and the given render
/// strands; generates render strands if none are given. `convention` is that of the written groom.
pub(crate) fn build(
    name: &str,
    convention: Convention,
    guides: &Curves,
    strands: Option<&RenderStrands>,
    scalp: Option<&Scalp>,
    options: &BuildOptions,
) -> (Groom, BuildReport) {
    let arc = Tree::default_arc(options.sections);
    let (guides, guide_error) = resample(guides, options.guide_vertices);
    let guides = MeasuredGuides::new(guides, &arc);
    let strands = match strands {
        Some(given) => AttachedStrands::attach(given, options.strand_vertices, &guides, &arc),
        None => AttachedStrands::generate(&guides, options.generation, scalp, &arc),
    };
    let hairs = hairs_per_guide(guides.curves.len(), &strands.guide);
    let weight: Vec<f64> = hairs.iter().map(|&h| f64::from(h)).collect();
    let nested = hierarchy::nest(&guides.features, &weight, options.hierarchy);
    let members = Members {
        guides: &guides.sections,
        hairs: &hairs,
        footprint: &guides.footprint,
        strands: &strands.sections,
        guide_of_strand: &strands.guide,
    };
    let trees = hierarchy::build(&nested, &arc, &members);
    let leaf_of_guide = leaf_of_guides(&trees, guides.curves.len());
    let leaf: Vec<(u32, u32)> = strands.guide.iter().map(|&g| leaf_of_guide[g as usize]).collect();
    let levels = if strands.curves.is_empty() {
        fidelity::levels(&trees, &guides.sections, &leaf_of_guide)
    } else {
        fidelity::levels(&trees, &strands.sections, &leaf)
    };
    let report = BuildReport {
        counts: [guides.curves.len(), nested.last().map_or(0, Vec::len), strands.curves.len()],
        guide_error,
        strand_error: strands.error,
        per_guide: options.generation.per_guide,
        curl: fidelity::curl(&guides.curves),
        levels,
    };
    let drawn = if strands.curves.is_empty() { &guides.curves } else { &strands.curves };
    let width = options.width.unwrap_or_else(|| covering_width(&drawn.roots().collect::<Vec<_>>()));
    let groom = Groom {
        name: name.into(),
        notes: Vec::new(),
        origin: None,
        convention,
        materials: vec![options.material.clone()],
        groups: vec![Group { name: "hair".into(), material: 0, width }],
        guides: Guides { curves: guides.curves, ..Guides::default() },
        trees,
        strands: Strands { curves: strands.curves, leaf },
        source: None,
    };
    (groom, report)
}

/// Guides and what the hierarchy needs of them.
struct MeasuredGuides {
    curves: Curves,
    sections: Sections,
    /// Mean length, m.
    mean_length: f64,
    features: Features,
    /// Footprints, m, `guides × sections`.
    footprint: Vec<f64>,
}

impl MeasuredGuides {
    fn new(curves: Curves, arc: &[f64]) -> Self {
        let sections = Sections::of(&curves, arc);
        let mean_length = sections.length.iter().sum::<f64>() / curves.len() as f64;
        let features = Features::of(&sections, arc, mean_length);
        let footprint = hierarchy::footprints(&sections, &features);
        MeasuredGuides { curves, sections, mean_length, features, footprint }
    }
}

/// Render strands and the guide that each follows.
struct AttachedStrands {
    curves: Curves,
    sections: Sections,
    guide: Vec<u32>,
    /// Change by resampling; `None` for generated strands.
    error: Option<ResampleError>,
}

impl AttachedStrands {
    /// Resamples given strands and attaches each to the nearest guide; strands of a clump share one guide.
    fn attach(given: &RenderStrands, vertices: Resample, guides: &MeasuredGuides, arc: &[f64]) -> Self {
        let (curves, error) = resample(&given.curves, vertices);
        let sections = Sections::of(&curves, arc);
        let mut guide = nearest(&Features::of(&sections, arc, guides.mean_length), &guides.features);
        unite_clumps(&mut guide, &given.clumps);
        AttachedStrands { curves, sections, guide, error: Some(error) }
    }

    /// Generates strands around the guides.
    fn generate(guides: &MeasuredGuides, generation: Generation, scalp: Option<&Scalp>, arc: &[f64]) -> Self {
        let (curves, guide) =
            generate::generate(&guides.curves, &guides.sections, &guides.footprint, arc, generation, scalp);
        let sections = Sections::of(&curves, arc);
        AttachedStrands { curves, sections, guide, error: None }
    }
}

/// Number of hairs that each guide represents: its render strands, at least 1.
fn hairs_per_guide(guides: usize, guide_of_strand: &[u32]) -> Vec<u32> {
    let mut hairs = vec![0u32; guides];
    guide_of_strand.iter().for_each(|&g| hairs[g as usize] += 1);
    hairs.iter_mut().for_each(|h| *h = (*h).max(1));
    hairs
}

/// Attaches all strands of a clump to one guide: the one that most of them are nearest to, of several the
/// first.
fn unite_clumps(guide: &mut [u32], clumps: &[Option<i32>]) {
    let mut votes: BTreeMap<i32, BTreeMap<u32, usize>> = BTreeMap::new();
    for (guide, clump) in guide.iter().zip(clumps).filter_map(|(guide, clump)| Some((*guide, (*clump)?))) {
        *votes.entry(clump).or_default().entry(guide).or_default() += 1;
    }
    let elected =
        |votes: BTreeMap<u32, usize>| votes.into_iter().rev().max_by_key(|(_, n)| *n).map(|(guide, _)| guide);
    let of_clump: BTreeMap<i32, u32> =
        votes.into_iter().filter_map(|(clump, votes)| Some((clump, elected(votes)?))).collect();
    for (guide, clump) in guide.iter_mut().zip(clumps) {
        *guide = clump.and_then(|clump| of_clump.get(&clump).copied()).unwrap_or(*guide);
    }
}

/// Leaf wisp (tree, wisp) of each guide.
fn leaf_of_guides(trees: &[Tree], guides: usize) -> Vec<(u32, u32)> {
    let mut leaf = vec![(0, 0); guides];
    for (t, tree) in trees.iter().enumerate() {
        for (w, wisp) in tree.wisps.iter().enumerate() {
            wisp.guides.iter().for_each(|&g| leaf[g as usize] = (t as u32, w as u32));
        }
    }
    leaf
}

impl fmt::Display for BuildReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [guides, leaves, strands] = self.counts;
        writeln!(f, "{guides} guides in {leaves} leaf wisps")?;
        match (self.strand_error.is_some(), self.per_guide) {
            (true, _) => writeln!(f, "{strands} render strands: all those of the file, and none grown"),
            (false, 0) => writeln!(f, "no render strands"),
            (false, n) => writeln!(f, "{strands} render strands, grown: {n} around each guide"),
        }?;
        writeln!(f, "guides: {}", self.curl)?;
        writeln!(f, "guides resampled: {}", self.guide_error)?;
        self.strand_error.iter().try_for_each(|error| writeln!(f, "strands resampled: {error}"))?;
        self.levels.iter().enumerate().try_for_each(|(level, fit)| writeln!(f, "level {level}: {fit}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clump_is_attached_to_the_guide_of_most_of_its_strands() {
        let mut guide = [3, 5, 5, 2, 9, 4, 2];
        unite_clumps(&mut guide, &[Some(1), Some(1), Some(1), Some(-7), Some(-7), None, None]);
        assert_eq!(guide, [5, 5, 5, 2, 2, 4, 2]);
    }
}
