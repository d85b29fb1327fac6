//! Matches the curves of goals with the guides of a groom (`docs/theory.md` §4.1, animated goals).

use super::anim::{Anim, Goal, GoalSpace};
use super::groom::{Curves, Groom};
use super::json::diagnostics::MAX_REPORTED;
use crate::error::Diagnostic;
use crate::math::polyline;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Distance of a curve's root from that of its guide from which on it is told, m.
const OFF_ROOT: f64 = 2e-3;

/// The same from which on it is refused, m.
const TOO_FAR: f64 = 0.02;

/// Difference in length between a curve and its guide, as a share of the guide's, from which on it is told.
const OTHER_LENGTH: f64 = 0.02;

/// The same from which on it is refused: the curve belongs to another guide, or to other hair.
const TOO_LONG: f64 = 0.2;

/// Matches the goals of `anim`, read from `file`, with the guides of `groom`, whose roots are bound to their
/// skins. Returns what prevents it.
pub fn bind(groom: &mut Groom, anim: &mut Anim, file: &Path) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    let mut taken: HashMap<usize, usize> = HashMap::new();
    for i in 0..anim.goals.len() {
        let mut report = Report { file, key: format!("goals[{i}]"), diagnostics: Vec::new() };
        if let Some(guides) = guides(groom, &anim.goals[i], &mut report) {
            let twice = guides.iter().find_map(|g| Some((*g, *taken.get(g)?)));
            if let Some((guide, other)) = twice {
                report.add(
                    "",
                    format!(
                        "the guide of id {} is in the goal \"{}\", too",
                        groom.guides.curves.id[guide], anim.goals[other].name
                    ),
                    "one goal at most for each guide",
                    "give the goals other groups or ids",
                );
            }
            taken.extend(guides.iter().map(|g| (*g, i)));
            anim.goals[i].guides = guides;
            let note = fit(&groom.guides.curves, anim, i, &mut report);
            groom.notes.extend(note);
        }
        diagnostics.extend(report.diagnostics);
    }
    diagnostics
}

/// The errors of a goal.
struct Report<'a> {
    file: &'a Path,
    key: String,
    diagnostics: Vec<Diagnostic>,
}

impl Report<'_> {
    fn add(&mut self, name: &str, message: String, allowed: &str, help: &str) {
        let key = if name.is_empty() { self.key.clone() } else { format!("{}.{name}", self.key) };
        self.diagnostics.push(Diagnostic::new(self.file, key, message, allowed, help));
    }
}

/// The guide of each curve of a goal.
fn guides(groom: &Groom, goal: &Goal, report: &mut Report) -> Option<Vec<usize>> {
    let all = &groom.guides.curves;
    let names: Vec<&str> = groom.groups.iter().map(|g| g.name.as_str()).collect();
    for name in goal.groups.iter().flatten().filter(|name| !names.contains(&name.as_str())) {
        let allowed = format!("groups of the groom: \"{}\"", names.join("\", \""));
        report.add("groups", format!("the groom has no group \"{name}\""), &allowed, "correct the name");
    }
    let in_groups = |g: &usize| {
        goal.groups.as_ref().is_none_or(|own| own.iter().any(|n| n == names[all.group[*g] as usize]))
    };
    let members: Vec<usize> = (0..all.len()).filter(in_groups).collect();
    let guides = match &goal.ids {
        None => members,
        Some(ids) => {
            let index: HashMap<i32, usize> = members.iter().map(|g| (all.id[*g], *g)).collect();
            let unknown: Vec<String> =
                ids.iter().filter(|id| !index.contains_key(id)).map(i32::to_string).collect();
            if !unknown.is_empty() {
                let message =
                    format!("there are no guides with {} of the ids: {}", unknown.len(), shown(&unknown));
                report.add(
                    "ids",
                    message,
                    "ids of guides of the groom, in `groups`",
                    "correct or remove them",
                );
            }
            let mut seen = HashSet::new();
            if let Some(id) = ids.iter().find(|id| !seen.insert(**id)) {
                report.add("ids", format!("{id} is there twice"), "each id once", "remove one of the curves");
            }
            ids.iter().filter_map(|id| index.get(id).copied()).collect()
        }
    };
    if report.diagnostics.is_empty() && guides.len() != goal.curves.len() {
        let message = format!("the files hold {} curves, for {} guides", goal.curves.len(), guides.len());
        let help = "export a curve for each guide, root first, in the order of the groom; or name the guides by \
                    `groups` or `ids`";
        report.add("sequence", message, "one curve for each guide", help);
    }
    report.diagnostics.is_empty().then_some(guides)
}

/// The first few of `words`.
fn shown(words: &[String]) -> String {
    let more = if words.len() > MAX_REPORTED { ", …" } else { "" };
    format!("{}{more}", words[..words.len().min(MAX_REPORTED)].join(", "))
}

/// A curve beside its guide.
struct Pair {
    guide: usize,
    /// Largest distance of the roots, m, and the sample.
    apart: (f64, usize),
    /// Largest difference in length, as a share of that of the guide.
    longer: f64,
}

/// Compares the curves of goal `i` with their guides; returns a remark.
fn fit(all: &Curves, anim: &Anim, i: usize, report: &mut Report) -> Option<String> {
    let Goal { name, curves, guides, space, .. } = &anim.goals[i];
    let pair = |(c, &guide): (usize, &usize)| {
        let (rest, root) = (all.curve(guide), all.skin.get(guide));
        let length = polyline::length(rest);
        let mut pair = Pair { guide, apart: (0.0, 0), longer: 0.0 };
        for sample in 0..curves.times.count {
            let points = curves.points(c, sample);
            let placed = match space {
                GoalSpace::Rest => rest[0],
                GoalSpace::World => {
                    (anim.carrier(root, curves.times.time(sample)) * Point3::from(rest[0])).coords
                }
            };
            let apart: Vector3<f64> = points[0] - placed;
            if apart.norm() > pair.apart.0 {
                pair.apart = (apart.norm(), sample);
            }
            let longer = polyline::length(points) / length - 1.0;
            if longer.abs() > pair.longer.abs() {
                pair.longer = longer;
            }
        }
        pair
    };
    let pairs: Vec<Pair> = guides.par_iter().enumerate().map(pair).collect();
    let far: Vec<&Pair> = pairs.iter().filter(|p| p.apart.0 > TOO_FAR).collect();
    if let Some(worst) = far.iter().max_by(|a, b| a.apart.0.total_cmp(&b.apart.0)) {
        let frame = curves.times.time(worst.apart.1) * anim.fps;
        let message = format!(
            "{} of {} curves start {TOO_FAR} m or more from the roots of their guides: that of id {} {:.3} m at \
             frame {frame:.0}",
            far.len(),
            pairs.len(),
            all.id[worst.guide],
            worst.apart.0
        );
        let help = "check order, ids, unit and `space` of the curves, and the frame they start at: roots stay on the \
                    head or the skin, whatever the curves do";
        report.add("sequence", message, "curves that start at the roots of their guides", help);
    }
    let other: Vec<&Pair> = pairs.iter().filter(|p| p.longer.abs() > TOO_LONG).collect();
    if let Some(worst) = other.iter().max_by(|a, b| a.longer.abs().total_cmp(&b.longer.abs())) {
        let message = format!(
            "{} of {} curves differ in length from their guides by more than {:.0} %: that of id {} by {:+.0} %",
            other.len(),
            pairs.len(),
            1e2 * TOO_LONG,
            all.id[worst.guide],
            1e2 * worst.longer
        );
        let help = "check order and ids of the curves; hair does not stretch";
        report.add("sequence", message, "curves about as long as their guides", help);
    }
    let apart = pairs.iter().map(|p| p.apart.0).fold(0.0, f64::max);
    let longer = pairs.iter().map(|p| p.longer.abs()).fold(0.0, f64::max);
    let mut words = format!("goal {name}: {} guides follow curves", pairs.len());
    if apart > OFF_ROOT {
        words += &format!(
            ", whose roots are up to {:.1} mm off; they are moved to the guides' roots",
            1e3 * apart
        );
    }
    if longer > OTHER_LENGTH {
        let count = pairs.iter().filter(|p| p.longer.abs() > OTHER_LENGTH).count();
        words += &format!(
            "; {count} differ in length by up to {:.1} %: guides keep theirs, and follow to their own tips",
            1e2 * longer
        );
    }
    Some(words)
}
