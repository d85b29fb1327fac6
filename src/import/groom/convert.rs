//! Makes a groom from strand files.

use super::build::{RenderStrands, build};
use super::cluster::{Space, divide, medoid};
use super::drawn::{Drawn, origin_of};
use super::features::Features;
use super::options::{ALL_GUIDES_UP_TO, DEFAULT_GUIDES, GroomOptions};
use super::report::GroomReport;
use super::scalp::Scalp;
use super::sections::Sections;
use crate::error::Diagnostic;
use crate::import::plain::{PlainGroup, StrandAttributes};
use crate::import::strand_file::{AttributeMap, CleanStrands, read_strands};
use crate::scene::placement::{Misplaced, PlacedMesh, Roots};
use crate::scene::{Curves, Factors, Groom, Group, Tree};
use crate::{Error, Result};

/// Makes a groom from strand files.
///
/// # Errors
/// Unreadable or damaged files, all in one report; options out of range.
pub fn groom(options: &GroomOptions) -> Result<(Groom, GroomReport)> {
    options.check()?;
    let (mut input, mut separate) = read_files(options)?;
    let scalp = options.scalp.as_ref().and_then(Scalp::new);
    let convention = input.report.convention;
    let origin = origin_of(&options.guides, input.rest.space, &options.folder)?;
    let attributes = std::mem::take(&mut input.attributes);
    let drawn = match &mut separate {
        Some(file) => Drawn::of(file, options.strands.as_ref().unwrap_or(&options.guides)),
        None => Drawn::of(&mut input, &options.guides),
    };
    let mut groups = std::mem::take(&mut input.groups);
    let mut sources = vec![input.report.clone()];
    let mut roots: Vec<Vec<_>> = vec![input.curves.roots().chain(input.guides.roots()).collect()];
    let is_separate = separate.is_some();
    let strands_are_marked = separate.as_ref().map(|file| file.curves.is_empty());
    let separate = separate.map(|file| {
        sources.push(file.report.clone());
        let strands = separate_strands(file, &mut groups);
        roots.push(strands.curves.roots().collect());
        strands
    });
    let choice = GuideChoice::new(input, is_separate, options);
    let strands_are_marked = strands_are_marked.unwrap_or(choice.strands_are_marked);
    let own = choice.strands.as_ref().map_or(0, Curves::len);
    let strands = separate.or_else(|| {
        let curves = choice.strands.filter(|_| !options.grows())?;
        Some(RenderStrands { clumps: clumps(&attributes, choice.strands_are_marked, &curves.id), curves })
    });
    let not_drawn = if options.grows() { own } else { 0 };
    let mut build_options = options.build.clone();
    build_options.generation.per_guide =
        options.strands_per_guide.unwrap_or(options.build.generation.per_guide);
    if strands.iter().any(|strands| strands.clumps.iter().any(Option::is_some)) {
        build_options.material.clumping = 1.0;
    }
    let (mut groom, fit) =
        build(&options.name, convention, &choice.guides, strands.as_ref(), scalp.as_ref(), &build_options);
    groom.origin = Some(origin);
    if let Some(drawn) = drawn {
        let strands = strands.is_some().then_some(strands_are_marked);
        let guides = (!is_separate).then_some(choice.guides_are_marked);
        groom.source = Some(drawn.source_of(&groom, [strands, guides], &options.folder)?);
    }
    groom.guides.factors = factors(&attributes, choice.guides_are_marked, &choice.guides.id);
    let default_width = groom.groups[0].width;
    check_head(options, &groom)?;
    let group = |PlainGroup { name, width }| Group {
        name,
        material: 0,
        width: options.build.width.or(width).unwrap_or(default_width),
    };
    groom.groups = groups.into_iter().map(group).collect();
    let roots = scalp.iter().flat_map(|scalp| roots.iter().map(|roots| scalp.report(roots))).collect();
    let report = GroomReport::new(sources, roots, fit, not_drawn);
    groom.notes = report.notes();
    Ok((groom, report))
}

/// Compares the roots with the head mesh.
///
/// # Errors
/// The hair cannot grow on it.
fn check_head(options: &GroomOptions, groom: &Groom) -> Result<()> {
    let skin = |rest| PlacedMesh { name: "head", rest, first: None };
    let found = options.scalp.as_ref().and_then(|mesh| Roots::of(groom).check(&[skin(mesh)]));
    let diagnostic = |found: Misplaced| {
        Diagnostic::new(
            &options.guides.path,
            "--head",
            found.what,
            "the head that the hair grows on, in one space with it",
            "give --units, --up or --offset for the strands, the unit of the head as in --head head.obj:cm, or \
             another head",
        )
    };
    Error::if_any(found.into_iter().map(diagnostic).collect())
}

/// Reads the file of the guides and the separate file of render strands.
///
/// # Errors
/// The errors of both files in one report.
fn read_files(options: &GroomOptions) -> Result<(CleanStrands, Option<CleanStrands>)> {
    let read = |source| read_strands(source, options.length_scale);
    match (read(&options.guides), options.strands.as_ref().map(read).transpose()) {
        (Ok(input), Ok(separate)) => Ok((input, separate)),
        (Err(Error::BadInput(mut one)), Err(Error::BadInput(other))) => {
            one.extend(other);
            Err(Error::BadInput(one))
        }
        (Err(e), _) | (_, Err(e)) => Err(e),
    }
}

/// The guides and what remains as render strands.
struct GuideChoice {
    guides: Curves,
    /// Whether the guides are among those that the file marks.
    guides_are_marked: bool,
    /// Strands of the file that can be drawn; `None` if it holds guides only.
    strands: Option<Curves>,
    /// Whether `strands` are among those that the file marks as guides.
    strands_are_marked: bool,
}

impl GuideChoice {
    /// Takes the marked guides of a file unless a number of guides is asked for and there are other strands
    /// to choose from; `separate` is whether a separate file has the render strands.
    fn new(input: CleanStrands, separate: bool, options: &GroomOptions) -> Self {
        let CleanStrands { curves, guides: marked, holds_guides, report, .. } = input;
        let choose = |from: &Curves, n| choose_guides(from, n, options.build.sections, report.length[1]);
        let among_strands = options.guide_count.is_some() && !separate && !curves.is_empty();
        if marked.is_empty() || among_strands {
            let default = if curves.len() <= ALL_GUIDES_UP_TO { curves.len() } else { DEFAULT_GUIDES };
            let guides = choose(&curves, options.guide_count.unwrap_or(default));
            // As many strands as guides in a format of guides: others are grown around them.
            let strands = (!holds_guides || curves.len() > guides.len()).then_some(curves);
            return GuideChoice { guides, guides_are_marked: false, strands, strands_are_marked: false };
        }
        let strands_are_marked = curves.is_empty();
        let guides = choose(&marked, options.guide_count.unwrap_or(marked.len()));
        let strands = if strands_are_marked && marked.len() > guides.len() { marked } else { curves };
        let strands = Some(strands).filter(|strands| !strands.is_empty());
        GuideChoice { guides, guides_are_marked: true, strands, strands_are_marked }
    }
}

/// The guides: the medoids of `wanted` clusters, or all strands.
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

/// The render strands of a separate file; marked guides count only if the file has no other strands. Adds the
/// groups of the file to `groups`.
fn separate_strands(file: CleanStrands, groups: &mut Vec<PlainGroup>) -> RenderStrands {
    let marked = file.curves.is_empty();
    let mut curves = if marked { file.guides } else { file.curves };
    let clumps = clumps(&file.attributes, marked, &curves.id);
    join_groups(groups, file.groups, &mut curves);
    RenderStrands { curves, clumps }
}

/// Adds the groups of a second file to those of the first and renumbers the groups of its strands. Groups of
/// the same name are one; the width of the second file takes precedence, because its strands are drawn.
fn join_groups(groups: &mut Vec<PlainGroup>, others: Vec<PlainGroup>, strands: &mut Curves) {
    let join = |other: PlainGroup| -> u32 {
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
    let index: Vec<u32> = others.into_iter().map(join).collect();
    strands.group.iter_mut().for_each(|group| *group = index[*group as usize]);
}

/// Attributes of the strands with these ids; `marked`: whether they are marked as guides.
fn attributes_of(
    attributes: &AttributeMap,
    marked: bool,
    ids: &[i32],
) -> impl Iterator<Item = StrandAttributes> + Clone {
    ids.iter().map(move |id| attributes.get(&(marked, *id)).copied().unwrap_or(StrandAttributes::DEFAULT))
}

/// Material factors of the strands with these ids; `None` for a property whose factors are all 1.
fn factors(attributes: &AttributeMap, marked: bool, ids: &[i32]) -> Factors {
    let property = |i: usize| -> Option<Vec<f64>> {
        let values = attributes_of(attributes, marked, ids).map(|own| own.factors[i]);
        values.clone().any(|f| f != 1.0).then(|| values.collect())
    };
    Factors::of(std::array::from_fn(property))
}

/// Clumps of the strands with these ids.
fn clumps(attributes: &AttributeMap, marked: bool, ids: &[i32]) -> Vec<Option<i32>> {
    attributes_of(attributes, marked, ids).map(|own| own.clump).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::Source;
    use nalgebra::Vector3;

    /// Guides and strands chosen among `n` strands of a format that holds guides or not.
    fn chosen(n: usize, holds_guides: bool, wanted: Option<usize>) -> [usize; 2] {
        let curves = Curves {
            offsets: (0..=n).map(|i| 2 * i).collect(),
            points: (0..2 * n)
                .map(|i| Vector3::new(1e-3 * (i / 2) as f64, -0.1 * (i % 2) as f64, 0.0))
                .collect(),
            id: (0..n as i32).collect(),
            group: vec![0; n],
            root_uv: vec![[0.0; 2]; n],
            skin: Vec::new(),
        };
        let input = CleanStrands {
            curves,
            guides: Curves::default(),
            holds_guides,
            attributes: AttributeMap::new(),
            groups: Vec::new(),
            rest: Default::default(),
            drawn: None,
            report: crate::import::StrandFileReport { length: [0.1; 3], ..Default::default() },
        };
        let options = GroomOptions { guide_count: wanted, ..GroomOptions::new(Source::new("a")) };
        let choice = GuideChoice::new(input, false, &options);
        [choice.guides.len(), choice.strands.map_or(0, |strands| strands.len())]
    }

    #[test]
    fn strands_of_a_file_are_kept_unless_it_holds_guides_only() {
        assert_eq!(chosen(1, false, None), [1, 1]);
        assert_eq!(chosen(900, false, None), [900, 900]);
        assert_eq!(chosen(900, true, None), [900, 0]);
        assert_eq!(chosen(1001, true, None), [DEFAULT_GUIDES, 1001]);
        assert_eq!(chosen(1001, false, None), [DEFAULT_GUIDES, 1001]);
        assert_eq!(chosen(900, true, Some(90)), [90, 900]);
    }
}
