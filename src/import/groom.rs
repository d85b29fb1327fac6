//! Strand files to a groom, whole.

use super::build::{BuildOptions, BuildReport, build};
use super::cluster::{Space, divide, medoid};
use super::read::{self, CleanStrands, Own, Owned, PlainGroup, Source, SourceReport};
use super::scalp::{RootReport, Scalp};
use super::sections::{Features, Sections};
use crate::scene::{Curves, Factors, Groom, Group, Tree, TriMesh};
use crate::{Error, Result};
use std::fmt;
use std::path::PathBuf;

/// Up to this many strands, all become guides unless a number is asked for.
pub const ALL_GUIDES: usize = 1000;
/// Guides chosen from a larger groom unless a number is asked for.
pub const CHOSEN_GUIDES: usize = 500;

/// What [`groom`] is to make.
#[derive(Debug, Clone, PartialEq)]
pub struct GroomOptions {
    /// Name of the groom.
    pub name: String,
    /// The strands from which guides are taken. Where there are more than guides, they are the render strands as well.
    pub guides: Source,
    /// The render strands, where they are in a file of their own.
    pub strands: Option<Source>,
    /// The head they grow on, rest space: to report where the roots lie, and to root grown strands on.
    pub scalp: Option<TriMesh>,
    /// Factor on the length of all strands, which keep their shape.
    pub length_scale: f64,
    /// Number of guides to choose; `None` for those that the file names, else all of [`ALL_GUIDES`] or fewer, [`CHOSEN_GUIDES`] of more.
    pub guide_count: Option<usize>,
    /// How the groom is built over them.
    pub build: BuildOptions,
}

impl GroomOptions {
    /// The defaults for a strand file, named after it.
    pub fn new(guides: Source) -> Self {
        let name = guides.path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        GroomOptions {
            name,
            guides,
            strands: None,
            scalp: None,
            length_scale: 1.0,
            guide_count: None,
            build: BuildOptions::default(),
        }
    }
}

/// How well the groom represents the strands, and what was found on the way.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GroomReport {
    /// The file of the guides, and that of the strands where there is one.
    pub sources: Vec<SourceReport>,
    /// Where the roots of each file lie on the scalp; empty without one.
    pub roots: Vec<RootReport>,
    /// The groom against its strands.
    pub fit: BuildReport,
    /// What an artist should look at.
    pub warnings: Vec<String>,
}

/// Makes a groom of strand files.
///
/// # Errors
/// Files that cannot be read or are damaged, options out of range.
pub fn groom(options: &GroomOptions) -> Result<(Groom, GroomReport)> {
    options.build.check()?;
    if options.guide_count == Some(0) {
        return Err(Error::Usage("the number of guides must be 1 or more".into()));
    }
    if !(1e-3..=1e3).contains(&options.length_scale) {
        return Err(Error::Usage("the factor on the length must be 0.001 to 1000".into()));
    }
    let read = |source| read::strands(source, options.length_scale);
    // Both files are read before either's faults are reported.
    let (guides, strands) = (read(&options.guides), options.strands.as_ref().map(read).transpose());
    let (input, separate) = match (guides, strands) {
        (Ok(input), Ok(separate)) => (input, separate),
        (Err(Error::BadInput(mut one)), Err(Error::BadInput(other))) => {
            one.extend(other);
            return Err(Error::BadInput(one));
        }
        (Err(e), _) | (_, Err(e)) => return Err(e),
    };
    let CleanStrands { curves, guides: named, own, mut groups, report } = input;
    let mean_length = report.length[1];
    let mut roots = vec![curves.roots().chain(named.roots()).collect::<Vec<_>>()];
    let mut sources = vec![report];
    let separate = separate.map(|other| {
        // Guides of a file that is named for its strands are of use only where there is nothing else in it.
        let of_named = other.curves.is_empty();
        let mut strands = if of_named { other.guides } else { other.curves };
        let clumps = clumps(&other.own, of_named, &strands.id);
        roots.push(strands.roots().collect());
        sources.push(other.report);
        join_groups(&mut groups, other.groups, &mut strands);
        (strands, clumps)
    });
    let choose = |of: &Curves, n| choose_guides(of, n, options.build.sections, mean_length);
    let choose_of_strands = options.guide_count.is_some() && separate.is_none() && !curves.is_empty();
    let of_named = !(named.is_empty() || choose_of_strands);
    let only_named = curves.is_empty();
    let (guides, others) = if of_named {
        let guides = choose(&named, options.guide_count.unwrap_or(named.len()));
        let others = if only_named && named.len() > guides.len() { named } else { curves };
        (guides, Some(others).filter(|others| !others.is_empty()))
    } else {
        let usual = if curves.len() <= ALL_GUIDES { curves.len() } else { CHOSEN_GUIDES };
        let guides = choose(&curves, options.guide_count.unwrap_or(usual));
        let others = (curves.len() > guides.len()).then_some(curves);
        (guides, others)
    };
    let scalp = options.scalp.as_ref().and_then(Scalp::new);
    let roots: Vec<RootReport> =
        scalp.iter().flat_map(|scalp| roots.iter().map(|roots| scalp.report(roots))).collect();
    let strands = separate.or_else(|| {
        let others = others?;
        let clumps = clumps(&own, only_named, &others.id);
        Some((others, clumps))
    });
    let convention = sources[0].convention;
    let mut build_options = options.build.clone();
    if strands.iter().any(|(_, clumps)| clumps.iter().any(Option::is_some)) {
        build_options.material.clumping = 1.0;
    }
    let (mut groom, fit) = build(
        &options.name,
        convention,
        &guides,
        strands.as_ref().map(|(curves, clumps)| (curves, &clumps[..])),
        scalp.as_ref(),
        &build_options,
    );
    groom.guides.factors = factors(&own, of_named, &guides.id);
    let usual = groom.groups[0].width;
    let group = |PlainGroup { name, width }| Group {
        name,
        material: 0,
        width: options.build.width.or(width).unwrap_or(usual),
    };
    groom.groups = groups.into_iter().map(group).collect();
    let warnings = warnings(&sources, &roots);
    let report = GroomReport { sources, roots, fit, warnings };
    groom.notes = report.notes();
    Ok((groom, report))
}

/// What the curves with these ids have of their own, `named` guides or others.
fn owned(own: &Owned, named: bool, ids: &[i32]) -> impl Iterator<Item = Own> + Clone {
    ids.iter().map(move |id| own.get(&(named, *id)).copied().unwrap_or(Own::NONE))
}

/// Their factors; of a property for which all are 1, none.
fn factors(own: &Owned, named: bool, ids: &[i32]) -> Factors {
    let property = |i: usize| -> Option<Vec<f64>> {
        let values = owned(own, named, ids).map(|own| own.factors[i]);
        values.clone().any(|f| f != 1.0).then(|| values.collect())
    };
    Factors::of(std::array::from_fn(property))
}

/// Their clumps.
fn clumps(own: &Owned, named: bool, ids: &[i32]) -> Vec<Option<i32>> {
    owned(own, named, ids).map(|own| own.clump).collect()
}

/// Adds the groups of a second file, those of the same name being the same, and has its strands name them so. Its widths count: they are
/// those of the strands that are drawn.
fn join_groups(groups: &mut Vec<PlainGroup>, others: Vec<PlainGroup>, strands: &mut Curves) {
    let place = |other: PlainGroup| -> u32 {
        match groups.iter_mut().position(|group| group.name == other.name) {
            Some(at) => {
                groups[at].width = other.width.or(groups[at].width);
                at as u32
            }
            None => {
                groups.push(other);
                groups.len() as u32 - 1
            }
        }
    };
    let places: Vec<u32> = others.into_iter().map(place).collect();
    strands.group.iter_mut().for_each(|group| *group = places[*group as usize]);
}

/// The guides: the medoids of as many clusters as guides are wanted, or all strands.
fn choose_guides(input: &Curves, wanted: usize, sections: usize, mean_length: f64) -> Curves {
    if wanted >= input.len() {
        return input.clone();
    }
    let arc = Tree::default_arc(sections);
    let features = Features::of(&Sections::of(input, &arc), &arc, mean_length);
    let weight = vec![1.0; input.len()];
    let space = Space { features: &features, weight: &weight };
    let clusters = divide(space, &[(0..input.len() as u32).collect()], wanted, usize::MAX);
    let mut chosen: Vec<u32> = clusters.iter().flatten().map(|cluster| medoid(space, cluster)).collect();
    chosen.sort_unstable();
    input.select(chosen.into_iter().map(|c| c as usize))
}

fn warnings(sources: &[SourceReport], roots: &[RootReport]) -> Vec<String> {
    let off = sources.iter().zip(roots).filter(|(_, r)| r.off * 2 > r.roots).map(|(source, r)| {
        format!(
            "{}: most roots are off the scalp (mean {:.0} mm): check the units and the offset of strands and head",
            source.path.display(),
            r.distance[0] * 1e3
        )
    });
    let lost = sources
        .iter()
        .filter(|s| s.kept * 10 < s.read * 9)
        .map(|s| format!("{}: {} of {} strands left out", s.path.display(), s.read - s.kept, s.read));
    off.chain(lost).collect()
}

impl GroomReport {
    /// The report for the groom itself, which must not depend on the folder that its strands lay in.
    fn notes(&self) -> Vec<String> {
        let mut report = self.clone();
        for source in &mut report.sources {
            source.path = source.path.file_name().map_or_else(PathBuf::new, PathBuf::from);
        }
        report.warnings = warnings(&report.sources, &report.roots);
        report.to_string().lines().map(|line| line.trim().to_string()).collect()
    }
}

impl fmt::Display for GroomReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, source) in self.sources.iter().enumerate() {
            write!(f, "{source}")?;
            self.roots.get(i).map_or(Ok(()), |roots| writeln!(f, "  scalp: {roots}"))?;
        }
        write!(f, "{}", self.fit)?;
        self.warnings.iter().try_for_each(|warning| writeln!(f, "warning: {warning}"))
    }
}
