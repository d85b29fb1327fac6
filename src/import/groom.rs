//! Strand files to a groom, whole.

use super::cluster::{Space, divide, medoid};
use super::fidelity::{self, Curl, LevelFit};
use super::grow::{self, Growth};
use super::hierarchy::{self, Depth, Members};
use super::read::{self, Source, SourceReport};
use super::resample::{Resample, ResampleError, resample};
use super::scalp::{RootReport, Scalp};
use super::sections::{Features, Sections, default_arc, nearest};
use crate::scene::{Curves, Groom, Group, Guides, Material, Strands, Tree, TriMesh};
use crate::{Error, Result};
use nalgebra::Vector3;
use std::fmt;

/// Up to this many strands, all become guides unless a number is asked for.
pub const ALL_GUIDES: usize = 1000;
/// Guides chosen from a larger groom unless a number is asked for.
pub const CHOSEN_GUIDES: usize = 500;

/// What [`groom`] is to make.
#[derive(Debug, Clone, PartialEq)]
pub struct GroomOptions {
    /// Name of the groom.
    pub name: String,
    /// The strands from which guides are taken.
    pub guides: Source,
    /// The render strands, where they are in a file of their own.
    pub strands: Option<Source>,
    /// The head they grow on, rest space: to report where the roots lie, and to root grown strands on.
    pub scalp: Option<TriMesh>,
    /// Number of guides; `None` for all of [`ALL_GUIDES`] or fewer, [`CHOSEN_GUIDES`] of more.
    pub guide_count: Option<usize>,
    /// Vertices of the guides.
    pub guide_vertices: Resample,
    /// Vertices of render strands from a file.
    pub strand_vertices: Resample,
    /// How render strands are grown where no file has more strands than there are guides.
    pub growth: Growth,
    /// Shape of the hierarchy.
    pub depth: Depth,
    /// Sections of each wisp, which are the strain nodes of its guides; 2 or more.
    pub sections: usize,
    /// Material of the strands.
    pub material: Material,
    /// Drawn width at root and tip, m; `None` for widths that cover the head as 100,000 real hairs do.
    pub width: Option<[f64; 2]>,
}

impl GroomOptions {
    /// The defaults for a strand file: two levels, eight sections, hair that does not sag at the start.
    pub fn new(guides: Source) -> Self {
        let name = guides.path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        GroomOptions {
            name,
            guides,
            strands: None,
            scalp: None,
            guide_count: None,
            guide_vertices: Resample::Vertices(32),
            strand_vertices: Resample::Keep,
            growth: Growth::default(),
            depth: Depth { levels: 2, coarse: None, leaves: None },
            sections: 8,
            material: Material { sag_free: 1.0, ..Material::default() },
            width: None,
        }
    }

    fn check(&self) -> Result<()> {
        let mut wrong = Vec::new();
        let mut need = |ok: bool, what: &str| {
            if !ok {
                wrong.push(what.to_string())
            }
        };
        need(self.guide_count != Some(0), "the number of guides must be 1 or more");
        need((2..=64).contains(&self.sections), "the number of sections must be 2 to 64");
        need((1..=8).contains(&self.depth.levels), "the number of levels must be 1 to 8");
        need(self.depth.coarse != Some(0), "the number of coarse wisps must be 1 or more");
        need(self.growth.vertices >= 2, "grown strands need 2 vertices or more");
        need(
            (0.0..1.0).contains(&self.growth.shorter),
            "grown strands may be shorter by 0 to under 1 of their length",
        );
        for to in [self.guide_vertices, self.strand_vertices] {
            need(!matches!(to, Resample::Vertices(0 | 1)), "resampled strands need 2 vertices or more");
            need(
                !matches!(to, Resample::Spacing(s) if s.is_nan() || s <= 0.0),
                "the spacing of vertices must be above 0",
            );
        }
        if wrong.is_empty() { Ok(()) } else { Err(Error::Usage(wrong.join("; "))) }
    }
}

/// How well the groom represents the strands, and what was found on the way.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GroomReport {
    /// The file of the guides, and that of the strands where there is one.
    pub sources: Vec<SourceReport>,
    /// Guides, leaf wisps, render strands.
    pub counts: [usize; 3],
    /// Where the render strands come from.
    pub origin: String,
    /// What resampling did to the guides.
    pub guide_error: ResampleError,
    /// What resampling did to the render strands, where they come from a file.
    pub strand_error: Option<ResampleError>,
    /// Where the roots of the guides, and of render strands from a file, lie on the scalp.
    pub roots: Vec<(String, RootReport)>,
    /// Curvature of the guides as drawn.
    pub curl: Curl,
    /// How the strands lie in their wisps, from the coarse level to the leaves.
    pub levels: Vec<LevelFit>,
    /// What an artist should look at.
    pub warnings: Vec<String>,
}

/// Makes a groom of strand files. Errors: files that cannot be read or are damaged, options out of range.
pub fn groom(options: &GroomOptions) -> Result<(Groom, GroomReport)> {
    options.check()?;
    let mut report = GroomReport::default();
    let (input, source) = read::strands(&options.guides)?;
    let convention = source.convention;
    report.sources.push(source);
    let separate = match &options.strands {
        Some(source) => {
            let (strands, found) = read::strands(source)?;
            report.sources.push(found);
            Some(strands)
        }
        None => None,
    };
    let scalp = options.scalp.as_ref().and_then(Scalp::new);
    if let Some(scalp) = &scalp {
        report.look_at_roots("guides' file", scalp, &input);
        separate.iter().for_each(|strands| report.look_at_roots("strands' file", scalp, strands));
    }

    let arc = default_arc(options.sections);
    let mean_length = report.sources[0].length[1];
    let guides = choose_guides(&input, &arc, mean_length, options.guide_count);
    let from_file = match &separate {
        Some(strands) => Some(strands),
        None => (input.len() > guides.len()).then_some(&input),
    };
    let (guides, guide_error) = resample(&guides, options.guide_vertices);
    report.guide_error = guide_error;
    report.curl = fidelity::curl(&guides);
    let guide_sections = Sections::of(&guides, &arc);
    let guide_features = Features::of(&guide_sections, &arc, mean_length);
    let footprint = hierarchy::footprints(&guide_sections, &guide_features);

    let (strands, follows) = match from_file {
        Some(strands) => {
            report.origin = format!("the {} file", if separate.is_some() { "strands'" } else { "guides'" });
            let (strands, error) = resample(strands, options.strand_vertices);
            report.strand_error = Some(error);
            let features = Features::of(&Sections::of(&strands, &arc), &arc, mean_length);
            (strands, nearest(&features, &guide_features))
        }
        None => {
            report.origin = format!("grown, {} round each guide", options.growth.per_guide);
            grow::grow(&guides, &guide_sections, &footprint, &arc, options.growth, scalp.as_ref())
        }
    };
    let mut hairs = vec![0u32; guides.len()];
    follows.iter().for_each(|&g| hairs[g as usize] += 1);
    // A guide that no strand follows still stands for itself.
    hairs.iter_mut().for_each(|h| *h = (*h).max(1));
    let weight: Vec<f64> = hairs.iter().map(|&h| f64::from(h)).collect();

    let nested = hierarchy::nest(&guide_features, &weight, options.depth);
    let strand_sections = Sections::of(&strands, &arc);
    let members = Members {
        guides: &guide_sections,
        hairs: &hairs,
        footprint: &footprint,
        strands: from_file.map(|_| (&strand_sections, follows.as_slice())),
    };
    let trees = hierarchy::build(&nested, &arc, &members);
    let leaf_of = leaf_of_guides(&trees, guides.len());
    let leaf: Vec<(u32, u32)> = follows.iter().map(|&g| leaf_of[g as usize]).collect();
    report.levels = if strands.is_empty() {
        fidelity::levels(&trees, &guide_sections, &leaf_of)
    } else {
        fidelity::levels(&trees, &strand_sections, &leaf)
    };
    let leaves = nested.last().map_or(0, Vec::len);
    report.counts = [guides.len(), leaves, strands.len()];
    let drawn = if strands.is_empty() { guides.len() } else { strands.len() };
    let groom = Groom {
        name: options.name.clone(),
        convention,
        materials: vec![options.material.clone()],
        groups: vec![Group {
            name: "hair".into(),
            material: 0,
            width: options.width.unwrap_or_else(|| covering_width(drawn)),
        }],
        guides: Guides { curves: guides, root_frame: None },
        trees,
        strands: Strands { curves: strands, leaf },
    };
    report.warn();
    Ok((groom, report))
}

/// Width at root and tip, m, with which `strands` cover as much as 100,000 hairs of 80 µm, within reason.
pub(crate) fn covering_width(strands: usize) -> [f64; 2] {
    let root = (8e-5 * (1e5 / strands.max(1) as f64).sqrt()).clamp(8e-5, 6e-4);
    [root, 0.3 * root]
}

/// The guides: all strands, or the medoids of as many clusters as guides are wanted.
fn choose_guides(input: &Curves, arc: &[f64], mean_length: f64, count: Option<usize>) -> Curves {
    let wanted = count.unwrap_or(if input.len() <= ALL_GUIDES { input.len() } else { CHOSEN_GUIDES });
    if wanted >= input.len() {
        return input.clone();
    }
    let features = Features::of(&Sections::of(input, arc), arc, mean_length);
    let weight = vec![1.0; input.len()];
    let space = Space { features: &features, weight: &weight };
    let clusters = divide(space, &[(0..input.len() as u32).collect()], wanted, usize::MAX);
    let mut chosen: Vec<u32> = clusters.iter().flatten().map(|cluster| medoid(space, cluster)).collect();
    chosen.sort_unstable();
    select(input, &chosen)
}

fn select(curves: &Curves, which: &[u32]) -> Curves {
    let mut out = Curves { offsets: vec![0], ..Curves::default() };
    for &c in which {
        let c = c as usize;
        out.points.extend_from_slice(curves.curve(c));
        out.offsets.push(out.points.len());
        out.id.push(curves.id[c]);
        out.group.push(curves.group[c]);
        out.root_uv.push(curves.root_uv[c]);
    }
    out
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

fn roots(curves: &Curves) -> Vec<Vector3<f64>> {
    (0..curves.len()).map(|c| curves.curve(c)[0]).collect()
}

impl GroomReport {
    fn look_at_roots(&mut self, of: &str, scalp: &Scalp, curves: &Curves) {
        self.roots.push((of.to_string(), scalp.report(&roots(curves))));
    }

    fn warn(&mut self) {
        for (of, roots) in &self.roots {
            if roots.off * 2 > roots.roots {
                self.warnings.push(format!(
                    "most roots of the {of} are off the scalp (mean {:.0} mm): check the units and the offset of strands and head",
                    roots.distance[0] * 1e3
                ));
            }
        }
        for source in &self.sources {
            if source.kept * 10 < source.read * 9 {
                let lost = source.read - source.kept;
                self.warnings.push(format!("{lost} of {} strands left out", source.read));
            }
        }
    }
}

impl fmt::Display for GroomReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.sources.iter().try_for_each(|source| write!(f, "{source}"))?;
        self.roots.iter().try_for_each(|(of, roots)| writeln!(f, "scalp, {of}: {roots}"))?;
        let [guides, leaves, strands] = self.counts;
        writeln!(f, "{guides} guides in {leaves} leaf wisps; {strands} render strands ({})", self.origin)?;
        writeln!(f, "guides' shape: {}", self.curl)?;
        let resampled = |f: &mut fmt::Formatter<'_>, of: &str, error: &ResampleError| {
            writeln!(
                f,
                "{of} resampled: length off by {:.3} % on average, {:.2} % at most; vertices by {:.3} mm, {:.2} mm at most",
                error.length[0] * 100.0,
                error.length[1] * 100.0,
                error.distance[0] * 1e3,
                error.distance[1] * 1e3
            )
        };
        resampled(f, "guides", &self.guide_error)?;
        self.strand_error.iter().try_for_each(|error| resampled(f, "strands", error))?;
        for (level, fit) in self.levels.iter().enumerate() {
            writeln!(f, "level {level}: {fit}")?;
        }
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}
