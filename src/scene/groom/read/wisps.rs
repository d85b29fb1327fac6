//! The hierarchy of wisps.

use super::context::Context;
use crate::scene::convention::Convention;
use crate::scene::groom::file::WispsFile;
use crate::scene::groom::model::{Section, Tree, Wisp};
use crate::scene::json::array::Element;
use crate::scene::json::diagnostics::{Diagnostics, MAX_REPORTED};
use crate::scene::json::key::Key;
use nalgebra::UnitQuaternion;

/// The arrays of [`WispsFile`], loaded.
struct Arrays {
    parent: Vec<i32>,
    length: Vec<f64>,
    strand_count: Vec<u32>,
    sections: Vec<u32>,
    arc: Vec<f64>,
    centre: Vec<[f64; 3]>,
    frame: Vec<UnitQuaternion<f64>>,
    radius: Vec<f64>,
    guide_count: Vec<u32>,
    guides: Vec<u32>,
}

/// The trees of wisps over `guide_count` guides.
pub fn trees(context: &mut Context, file: WispsFile, guide_count: Option<usize>) -> Option<Vec<Tree>> {
    let arrays = load(context, file)?;
    let before = context.diagnostics.len();
    let starts = tree_starts(context.diagnostics, &arrays.parent)?;
    arrays.check_lengths(context.diagnostics, &starts);
    arrays.check_ranges(context.diagnostics);
    if context.diagnostics.len() > before {
        return None;
    }
    arrays.check_arcs(context.diagnostics);
    arrays.check_leaves(context, guide_count);
    if context.diagnostics.len() > before {
        return None;
    }
    Some(arrays.into_trees(&starts, &context.convention))
}

fn load(context: &mut Context, file: WispsFile) -> Option<Arrays> {
    let key = |name: &str| Key::at("wisps").name(name);
    let parent = context.load(&key("parent"), file.parent);
    let length = context.load(&key("length"), file.length);
    let strand_count = context.load(&key("strand_count"), file.strand_count);
    let sections = context.load(&key("sections"), file.sections);
    let arc = context.load(&key("arc"), file.arc);
    let centre = context.load(&key("centre"), file.centre);
    let frame = context.load_frames(&key("frame_wxyz"), file.frame_wxyz);
    let radius = context.load(&key("radius"), file.radius);
    let guide_count = context.load(&key("guide_count"), file.guide_count);
    let guides = context.load(&key("guides"), file.guides);
    Some(Arrays {
        parent: parent?,
        length: length?,
        strand_count: strand_count?,
        sections: sections?,
        arc: arc?,
        centre: centre?,
        frame: frame?,
        radius: radius?,
        guide_count: guide_count?,
        guides: guides?,
    })
}

/// Index of the coarse wisp of each tree. Checks that wisps are in order: tree by tree, parents before
/// children.
fn tree_starts(diagnostics: &mut Diagnostics, parent: &[i32]) -> Option<Vec<usize>> {
    let key = Key::at("wisps.parent");
    let before = diagnostics.len();
    let mut starts = Vec::new();
    for (w, &p) in parent.iter().enumerate() {
        if p == -1 {
            starts.push(w);
            continue;
        }
        let start = starts.last().copied();
        if !start.is_some_and(|start| p >= start as i32 && p < w as i32) {
            let allowed = match start {
                Some(start) => format!("-1, or an earlier wisp of the same tree: {start} ≤ parent < {w}"),
                None => "-1: the first wisp starts a tree".into(),
            };
            let help = "order the wisps tree by tree, parents before children";
            diagnostics.add(&key.index(w), format!("invalid parent {p}"), allowed, help);
            if diagnostics.len() - before >= MAX_REPORTED {
                break;
            }
        }
    }
    if parent.is_empty() {
        diagnostics.add(&key, "is empty", "at least one wisp", "remove \"wisps\" for one wisp per guide");
    }
    (diagnostics.len() == before).then_some(starts)
}

impl Arrays {
    /// Checks that the lengths of the arrays agree. `starts`: index of the coarse wisp of each tree.
    fn check_lengths(&self, diagnostics: &mut Diagnostics, starts: &[usize]) {
        let n = self.parent.len();
        let mut expect = |name: &str, found: usize, expected: usize, item: &str| {
            diagnostics.expect_len(&Key::at("wisps").name(name), found, expected, item)
        };
        expect("length", self.length.len(), n, "wisp");
        expect("strand_count", self.strand_count.len(), n, "wisp");
        expect("guide_count", self.guide_count.len(), n, "wisp");
        let total = self.guide_count.iter().map(|&c| c as usize).sum();
        expect("guides", self.guides.len(), total, "guide counted in guide_count");
        if expect("sections", self.sections.len(), starts.len(), "tree (parent -1)") {
            let tree_of = |w: usize| starts.partition_point(|&s| s <= w) - 1;
            let total = self.sections.iter().map(|&s| s as usize).sum();
            expect("arc", self.arc.len(), total, "section of each tree");
            let total = (0..n).map(|w| self.sections[tree_of(w)] as usize).sum();
            expect("centre", self.centre.len(), total, "section of each wisp");
            expect("frame_wxyz", self.frame.len(), total, "section of each wisp");
            expect("radius", self.radius.len(), total, "section of each wisp");
        }
    }

    fn check_ranges(&self, diagnostics: &mut Diagnostics) {
        check_each(diagnostics, "length", &self.length, |x| x > 0.0, "above 0");
        check_each(diagnostics, "radius", &self.radius, |x| x >= 0.0, "0 or more");
        check_each(diagnostics, "strand_count", &self.strand_count, |x| x > 0.0, "at least 1");
        check_each(diagnostics, "sections", &self.sections, |x| x >= 2.0, "at least 2");
    }

    /// Checks that the arc-length fractions of each tree increase from 0 to 1.
    fn check_arcs(&self, diagnostics: &mut Diagnostics) {
        let arc = &self.arc;
        let mut first = 0;
        for &count in &self.sections {
            let end = first + count as usize;
            for i in first..end {
                let (good, allowed) = match i {
                    i if i == first => (arc[i] == 0.0, "0 at the root".into()),
                    i if i + 1 == end => (arc[i] == 1.0, "1 at the tip".into()),
                    i => (
                        arc[i - 1] < arc[i] && arc[i] < 1.0,
                        format!("increasing: above {}, below 1", arc[i - 1]),
                    ),
                };
                if !good {
                    let key = Key::at("wisps.arc").index(i);
                    let message = format!("{} is out of order", arc[i]);
                    diagnostics.add(&key, message, allowed, "order the sections from root to tip");
                    break;
                }
            }
            first = end;
        }
    }

    /// Checks that leaves hold guides, that other wisps hold none, and that every guide is in one leaf.
    fn check_leaves(&self, context: &mut Context, guide_count: Option<usize>) {
        self.check_guide_counts(context.diagnostics);
        let Some(n) = guide_count else { return };
        let key = Key::at("wisps.guides");
        if !context.check_indices(&key, &self.guides, n, "guide") {
            return;
        }
        let mut place = vec![None; n];
        for (i, &g) in self.guides.iter().enumerate() {
            if let Some(other) = place[g as usize].replace(i) {
                let message = format!("guide {g} is also at index {other}");
                let help = "assign the guide to one wisp";
                context.diagnostics.add(&key.index(i), message, "every guide once", help);
            }
        }
        let missing: Vec<String> =
            place.iter().enumerate().filter(|(_, p)| p.is_none()).map(|(g, _)| g.to_string()).collect();
        if !missing.is_empty() {
            let shown = missing.iter().take(MAX_REPORTED).cloned().collect::<Vec<_>>().join(", ");
            let ellipsis = if missing.len() > MAX_REPORTED { ", …" } else { "" };
            let message = format!("{} of {n} guides are missing: {shown}{ellipsis}", missing.len());
            context.diagnostics.add(&key, message, "every guide once", "assign each guide to a wisp");
        }
    }

    fn check_guide_counts(&self, diagnostics: &mut Diagnostics) {
        let mut has_child = vec![false; self.parent.len()];
        for &p in self.parent.iter().filter(|p| **p >= 0) {
            has_child[p as usize] = true;
        }
        let wisps = has_child.iter().zip(&self.guide_count).enumerate();
        let bad = wisps.filter(|(_, (has_child, count))| **has_child != (**count == 0));
        for (w, (has_child, count)) in bad.take(MAX_REPORTED) {
            let (message, allowed, help) = if *has_child {
                let message = format!("wisp {w} has children and {count} guides of its own");
                (message, "0 guides for a wisp with children", "assign its guides to its children")
            } else {
                let message = format!("leaf wisp {w} has no guides");
                (message, "at least 1 guide for a wisp without children", "remove the empty wisp")
            };
            let key = Key::at("wisps.guide_count").index(w);
            diagnostics.add(&key, message, allowed, help);
        }
    }

    /// The trees, metres, Y up.
    fn into_trees(self, starts: &[usize], convention: &Convention) -> Vec<Tree> {
        let unit = convention.metres_per_unit;
        let section = |s: usize| Section {
            centre: convention.length_in(self.centre[s].into()),
            frame: self.frame[s],
            radius: self.radius[s] * unit,
        };
        let (mut next_arc, mut next_section, mut next_guide) = (0, 0, 0);
        let tree = |(t, &start): (usize, &usize)| {
            let sections = self.sections[t] as usize;
            let end = starts.get(t + 1).copied().unwrap_or(self.parent.len());
            let wisps = (start..end).map(|w| {
                let first = advance(&mut next_section, sections);
                let guide = advance(&mut next_guide, self.guide_count[w] as usize);
                Wisp {
                    parent: u32::try_from(self.parent[w]).ok().map(|p| p - start as u32),
                    length: self.length[w] * unit,
                    strand_count: self.strand_count[w],
                    sections: (first..first + sections).map(section).collect(),
                    guides: self.guides[guide..next_guide].to_vec(),
                }
            });
            let wisps = wisps.collect();
            let first = advance(&mut next_arc, sections);
            Tree { arc: self.arc[first..next_arc].to_vec(), wisps }
        };
        starts.iter().enumerate().map(tree).collect()
    }
}

/// Reports the `values` of `wisps.NAME` that are not `good`.
fn check_each<T: Element>(
    diagnostics: &mut Diagnostics,
    name: &str,
    values: &[T],
    good: fn(f64) -> bool,
    allowed: &str,
) {
    let value = |x: &T| x.components().next().unwrap_or(f64::NAN);
    let bad = values.iter().map(value).enumerate().filter(|(_, x)| !good(*x));
    for (i, x) in bad.take(MAX_REPORTED) {
        let key = Key::at("wisps").name(name).index(i);
        let message = format!("{x} is out of range");
        diagnostics.add(&key, message, allowed, "use a value in the allowed range");
    }
}

/// Adds `n` to `next` and returns its old value.
fn advance(next: &mut usize, n: usize) -> usize {
    let first = *next;
    *next += n;
    first
}
