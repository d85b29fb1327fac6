//! Strands to a groom: the hierarchy over the guides, render strands attached or grown, and the result measured.

use super::fidelity::{self, Curl, LevelFit};
use super::grow::{self, Growth};
use super::hierarchy::{self, Depth, Members};
use super::resample::{Resample, ResampleError, resample};
use super::scalp::Scalp;
use super::sections::{Features, Sections, nearest};
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
    /// How render strands are grown where none are given.
    pub growth: Growth,
    /// Shape of the hierarchy.
    pub depth: Depth,
    /// Sections of each wisp, which are the strain nodes of its guides; 2 to 64.
    pub sections: usize,
    /// Material of the strands.
    pub material: Material,
    /// Drawn width at root and tip, m; `None` for widths that cover the head as 100,000 real hairs do.
    pub width: Option<[f64; 2]>,
}

impl Default for BuildOptions {
    /// Two levels, eight sections, 32 vertices a guide, hair that does not sag at the start.
    fn default() -> Self {
        BuildOptions {
            guide_vertices: Resample::Vertices(32),
            strand_vertices: Resample::Keep,
            growth: Growth::default(),
            depth: Depth { levels: 2, coarse: None, leaves: None },
            sections: 8,
            material: Material { sag_free: 1.0, ..Material::default() },
            width: None,
        }
    }
}

impl BuildOptions {
    ///
    /// # Errors
    /// Options out of range, all of them.
    pub(super) fn check(&self) -> Result<()> {
        let mut wrong = Vec::new();
        let mut need = |ok: bool, what: &str| {
            if !ok {
                wrong.push(what.to_string());
            }
        };
        need((2..=64).contains(&self.sections), "the number of sections must be 2 to 64");
        need((1..=8).contains(&self.depth.levels), "the number of levels must be 1 to 8");
        need(self.depth.coarse != Some(0), "the number of coarse wisps must be 1 or more");
        need(self.growth.vertices >= 2, "grown strands need 2 vertices or more");
        need(
            (0.0..1.0).contains(&self.growth.shorter),
            "grown strands may be shorter by 0 to under 1 of the length",
        );
        need((0.0..=1.0).contains(&self.growth.clump), "the clump of grown strands must be 0 to 1");
        for to in [self.guide_vertices, self.strand_vertices] {
            need(!matches!(to, Resample::Vertices(0 | 1)), "resampled strands need 2 vertices or more");
            need(
                !matches!(to, Resample::Spacing(s) if s.is_nan() || s <= 0.0),
                "vertices must be more than 0 m apart",
            );
        }
        if wrong.is_empty() { Ok(()) } else { Err(Error::Usage(wrong.join("; "))) }
    }
}

/// How well a groom represents its strands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BuildReport {
    /// Guides, leaf wisps, render strands.
    pub counts: [usize; 3],
    /// What resampling did to the guides.
    pub guide_error: ResampleError,
    /// What resampling did to the render strands; `None` where they were grown.
    pub strand_error: Option<ResampleError>,
    /// Curvature of the guides as drawn.
    pub curl: Curl,
    /// How the strands lie in their wisps, from the coarse level to the leaves.
    pub levels: Vec<LevelFit>,
}

/// Builds a groom over `guides` (m, rest space; one or more, each with a length) and render strands: those given, with the clump of each, or grown.
/// `convention` is that in which the groom is written.
pub(crate) fn build(
    name: &str,
    convention: Convention,
    guides: &Curves,
    strands: Option<(&Curves, &[Option<i32>])>,
    scalp: Option<&Scalp>,
    options: &BuildOptions,
) -> (Groom, BuildReport) {
    let arc = Tree::default_arc(options.sections);
    let (guides, guide_error) = resample(guides, options.guide_vertices);
    let guide_sections = Sections::of(&guides, &arc);
    let mean_length = guide_sections.length.iter().sum::<f64>() / guides.len() as f64;
    let guide_features = Features::of(&guide_sections, &arc, mean_length);
    let footprint = hierarchy::footprints(&guide_sections, &guide_features);

    let mut strand_error = None;
    let (curves, follows, strand_sections) = match strands {
        Some((given, clumps)) => {
            let (curves, error) = resample(given, options.strand_vertices);
            strand_error = Some(error);
            let sections = Sections::of(&curves, &arc);
            let mut follows = nearest(&Features::of(&sections, &arc, mean_length), &guide_features);
            keep_together(&mut follows, clumps);
            (curves, follows, sections)
        }
        None => {
            let (curves, follows) =
                grow::grow(&guides, &guide_sections, &footprint, &arc, options.growth, scalp);
            let sections = Sections::of(&curves, &arc);
            (curves, follows, sections)
        }
    };
    let mut hairs = vec![0u32; guides.len()];
    follows.iter().for_each(|&g| hairs[g as usize] += 1);
    // A guide that no strand follows still stands for itself.
    hairs.iter_mut().for_each(|h| *h = (*h).max(1));
    let weight: Vec<f64> = hairs.iter().map(|&h| f64::from(h)).collect();

    let nested = hierarchy::nest(&guide_features, &weight, options.depth);
    let members = Members {
        guides: &guide_sections,
        hairs: &hairs,
        footprint: &footprint,
        strands: &strand_sections,
        follows: &follows,
    };
    let trees = hierarchy::build(&nested, &arc, &members);
    let leaf_of = leaf_of_guides(&trees, guides.len());
    let leaf: Vec<(u32, u32)> = follows.iter().map(|&g| leaf_of[g as usize]).collect();
    let levels = if curves.is_empty() {
        fidelity::levels(&trees, &guide_sections, &leaf_of)
    } else {
        fidelity::levels(&trees, &strand_sections, &leaf)
    };
    let drawn = if curves.is_empty() { guides.len() } else { curves.len() };
    let report = BuildReport {
        counts: [guides.len(), nested.last().map_or(0, Vec::len), curves.len()],
        guide_error,
        strand_error,
        curl: fidelity::curl(&guides),
        levels,
    };
    let width = options.width.unwrap_or_else(|| covering_width(drawn));
    let groom = Groom {
        name: name.into(),
        notes: Vec::new(),
        convention,
        materials: vec![options.material.clone()],
        groups: vec![Group { name: "hair".into(), material: 0, width }],
        guides: Guides { curves: guides, ..Guides::default() },
        trees,
        strands: Strands { curves, leaf },
    };
    (groom, report)
}

/// Has all strands of a clump follow one guide: that which most of them would, of several the first.
fn keep_together(follows: &mut [u32], clumps: &[Option<i32>]) {
    let mut votes: BTreeMap<i32, BTreeMap<u32, usize>> = BTreeMap::new();
    for (guide, clump) in follows.iter().zip(clumps).filter_map(|(guide, clump)| Some((*guide, (*clump)?))) {
        *votes.entry(clump).or_default().entry(guide).or_default() += 1;
    }
    let elected =
        |votes: BTreeMap<u32, usize>| votes.into_iter().rev().max_by_key(|(_, n)| *n).map(|(guide, _)| guide);
    let of_clump: BTreeMap<i32, u32> =
        votes.into_iter().filter_map(|(clump, votes)| Some((clump, elected(votes)?))).collect();
    for (guide, clump) in follows.iter_mut().zip(clumps) {
        *guide = clump.and_then(|clump| of_clump.get(&clump).copied()).unwrap_or(*guide);
    }
}

/// Width at root and tip, m, with which `strands` cover as much as 100,000 hairs of 80 µm, within reason.
fn covering_width(strands: usize) -> [f64; 2] {
    let root = (8e-5 * (1e5 / strands.max(1) as f64).sqrt()).clamp(8e-5, 1e-3);
    [root, 0.3 * root]
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
        let origin = if self.strand_error.is_some() { "given" } else { "grown round the guides" };
        writeln!(f, "{guides} guides in {leaves} leaf wisps; {strands} render strands, {origin}")?;
        writeln!(f, "guides' shape: {}", self.curl)?;
        writeln!(f, "guides resampled: {}", self.guide_error)?;
        self.strand_error.iter().try_for_each(|error| writeln!(f, "strands resampled: {error}"))?;
        self.levels.iter().enumerate().try_for_each(|(level, fit)| writeln!(f, "level {level}: {fit}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clump_follows_what_most_of_it_would() {
        let mut follows = [3, 5, 5, 2, 9, 4, 2];
        keep_together(&mut follows, &[Some(1), Some(1), Some(1), Some(-7), Some(-7), None, None]);
        assert_eq!(follows, [5, 5, 5, 2, 2, 4, 2]);
    }
}
