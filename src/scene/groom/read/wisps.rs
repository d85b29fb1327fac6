//! The hierarchy of wisps.

use super::Reader;
use crate::scene::document::array::Element;
use crate::scene::document::{Key, MAX_NAMED};
use crate::scene::groom::file::WispsFile;
use crate::scene::groom::{Section, Tree, Wisp};

impl Reader<'_> {
    pub(super) fn wisps(&mut self, file: WispsFile, guide_count: Option<usize>) -> Option<Vec<Tree>> {
        let parent = self.load("wisps.parent", file.parent);
        let length = self.load("wisps.length", file.length);
        let strand_count = self.load("wisps.strand_count", file.strand_count);
        let sections = self.load("wisps.sections", file.sections);
        let arc = self.load("wisps.arc", file.arc);
        let centre = self.load("wisps.centre", file.centre);
        let frame = self.frames("wisps.frame_wxyz", file.frame_wxyz);
        let radius = self.load("wisps.radius", file.radius);
        let counts = self.load("wisps.guide_count", file.guide_count);
        let guides = self.load("wisps.guides", file.guides);

        let (parent, length, strand_count) = (parent?, length?, strand_count?);
        let (sections, arc, counts, guides) = (sections?, arc?, counts?, guides?);
        let (centre, frame, radius) = (centre?, frame?, radius?);
        let before = self.faults.len();
        let starts = self.tree_starts(&parent)?;
        let tree_of = |w: usize| starts.partition_point(|&s| s <= w) - 1;
        let n = parent.len();
        let at = |name: &str| Key::at("wisps").name(name);
        let faults = &mut *self.faults;
        faults.expect_len(&at("length"), length.len(), n, "wisp");
        faults.expect_len(&at("strand_count"), strand_count.len(), n, "wisp");
        faults.expect_len(&at("guide_count"), counts.len(), n, "wisp");
        let total = counts.iter().map(|&c| c as usize).sum();
        faults.expect_len(&at("guides"), guides.len(), total, "unit of guide_count");
        if faults.expect_len(&at("sections"), sections.len(), starts.len(), "tree (parent -1)") {
            let total = sections.iter().map(|&s| s as usize).sum();
            faults.expect_len(&at("arc"), arc.len(), total, "section of each tree");
            let total = (0..n).map(|w| sections[tree_of(w)] as usize).sum();
            faults.expect_len(&at("centre"), centre.len(), total, "section of each wisp");
            faults.expect_len(&at("frame_wxyz"), frame.len(), total, "section of each wisp");
            faults.expect_len(&at("radius"), radius.len(), total, "section of each wisp");
        }
        self.numbers("length", &length, |x| x > 0.0, "above 0");
        self.numbers("radius", &radius, |x| x >= 0.0, "0 or more");
        self.numbers("strand_count", &strand_count, |x| x > 0.0, "at least 1");
        self.numbers("sections", &sections, |x| x >= 2.0, "at least 2");
        if self.faults.len() > before {
            return None;
        }
        self.arcs(&sections, &arc);
        self.leaves(&parent, &counts, &guides, guide_count);
        if self.faults.len() > before {
            return None;
        }

        let unit = self.convention.metres_per_unit;
        let (mut next_arc, mut next_section, mut next_guide) = (0, 0, 0);
        let trees = starts.iter().enumerate().map(|(t, &start)| {
            let count = sections[t] as usize;
            let end = starts.get(t + 1).copied().unwrap_or(n);
            let wisps = (start..end).map(|w| {
                let first = advance(&mut next_section, count);
                let guide = advance(&mut next_guide, counts[w] as usize);
                Wisp {
                    parent: u32::try_from(parent[w]).ok().map(|p| p - start as u32),
                    length: length[w] * unit,
                    strand_count: strand_count[w],
                    sections: (first..first + count)
                        .map(|s| Section {
                            centre: self.convention.length_in(centre[s].into()),
                            frame: frame[s],
                            radius: radius[s] * unit,
                        })
                        .collect(),
                    guides: guides[guide..next_guide].to_vec(),
                }
            });
            let wisps = wisps.collect();
            let first = advance(&mut next_arc, count);
            Tree { arc: arc[first..next_arc].to_vec(), wisps }
        });
        Some(trees.collect())
    }

    /// Index of the coarse wisp of each tree.
    fn tree_starts(&mut self, parent: &[i32]) -> Option<Vec<usize>> {
        let key = Key::at("wisps.parent");
        let before = self.faults.len();
        let mut starts = Vec::new();
        for (w, &p) in parent.iter().enumerate() {
            if p == -1 {
                starts.push(w);
                continue;
            }
            let start = starts.last().copied();
            if !start.is_some_and(|start| p >= start as i32 && p < w as i32) {
                let allowed = match start {
                    Some(start) => format!("-1, or an earlier wisp of its tree: {start} ≤ x < {w}"),
                    None => "-1: the first wisp starts a tree".into(),
                };
                let remedy = "order the wisps tree by tree, parents before children";
                self.faults.add(&key.index(w), format!("is {p}"), allowed, remedy);
                if self.faults.len() - before >= MAX_NAMED {
                    break;
                }
            }
        }
        if parent.is_empty() {
            self.faults.add(&key, "is empty", "at least one wisp", "leave \"wisps\" out to have one a guide");
        }
        (self.faults.len() == before).then_some(starts)
    }

    fn numbers<T: Element>(&mut self, name: &str, values: &[T], good: fn(f64) -> bool, allowed: &str) {
        let value = |x: &T| x.components().next().unwrap_or(f64::NAN);
        let bad = values.iter().map(value).enumerate().filter(|(_, x)| !good(*x));
        for (i, x) in bad.take(MAX_NAMED) {
            self.faults.add(
                &Key::at("wisps").name(name).index(i),
                format!("is {x}"),
                allowed,
                "correct the value",
            );
        }
    }

    /// Arc-length fractions run from 0 to 1 and increase.
    fn arcs(&mut self, sections: &[u32], arc: &[f64]) {
        let key = Key::at("wisps.arc");
        let mut first = 0;
        for &count in sections {
            let end = first + count as usize;
            for i in first..end {
                let (good, allowed) = match i {
                    i if i == first => (arc[i] == 0.0, "0 at the root".into()),
                    i if i + 1 == end => (arc[i] == 1.0, "1 at the tip".into()),
                    i => (arc[i - 1] < arc[i] && arc[i] < 1.0, format!("increasing: {} < x < 1", arc[i - 1])),
                };
                if !good {
                    self.faults.add(
                        &key.index(i),
                        format!("is {}", arc[i]),
                        allowed,
                        "order the sections root to tip",
                    );
                    break;
                }
            }
            first = end;
        }
    }

    /// Leaves hold guides, others none, and every guide lies in one leaf.
    fn leaves(&mut self, parent: &[i32], counts: &[u32], guides: &[u32], guide_count: Option<usize>) {
        let mut has_child = vec![false; parent.len()];
        for &p in parent.iter().filter(|p| **p >= 0) {
            has_child[p as usize] = true;
        }
        let at = |name: &str, i: usize| Key::at("wisps").name(name).index(i);
        let mut named = 0;
        for (w, (&child, &count)) in has_child.iter().zip(counts).enumerate() {
            if child != (count == 0) && named < MAX_NAMED {
                named += 1;
                let (allowed, remedy) = match child {
                    true => ("0: only wisps without children hold guides", "give its guides to its children"),
                    false => ("at least 1: a wisp without children holds guides", "drop the empty wisp"),
                };
                self.faults.add(&at("guide_count", w), format!("is {count}"), allowed, remedy);
            }
        }
        let Some(n) = guide_count else { return };
        if !self.in_range(&Key::at("wisps.guides"), guides, n, "guide") {
            return;
        }
        let mut place = vec![None; n];
        for (i, &g) in guides.iter().enumerate() {
            if let Some(other) = place[g as usize].replace(i) {
                let what = format!("is {g}, as at index {other}");
                self.faults.add(&at("guides", i), what, "every guide once", "keep a guide in one wisp");
            }
        }
        let missing: Vec<String> =
            place.iter().enumerate().filter(|(_, p)| p.is_none()).map(|(g, _)| g.to_string()).collect();
        if !missing.is_empty() {
            let shown = missing.iter().take(MAX_NAMED).cloned().collect::<Vec<_>>().join(", ");
            let what = format!(
                "lacks {} of {n} guides: {shown}{}",
                missing.len(),
                if missing.len() > MAX_NAMED { " …" } else { "" }
            );
            self.faults.add(&Key::at("wisps.guides"), what, "every guide once", "give each guide a wisp");
        }
    }
}

/// `next`, which moves on by `n`.
fn advance(next: &mut usize, n: usize) -> usize {
    let first = *next;
    *next += n;
    first
}
