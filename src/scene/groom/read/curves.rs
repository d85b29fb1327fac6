//! Curves: what guides and render strands have in common.

use super::context::Context;
use crate::math::polyline;
use crate::scene::groom::file::Vertices;
use crate::scene::groom::model::Curves;
use crate::scene::json::array::Array;
use crate::scene::json::diagnostics::{Diagnostics, MAX_REPORTED};
use crate::scene::json::key::Key;

/// The keys that guides and render strands have in common.
pub struct CurvesFile {
    pub vertices: Option<Vertices>,
    pub points: Array<[f64; 3]>,
    pub id: Option<Array<i32>>,
    pub group: Option<Array<u32>>,
    pub root_uv: Option<Array<[f64; 2]>>,
}

/// The curves of the section `name`.
pub fn curves(context: &mut Context, name: &str, file: CurvesFile) -> Option<Curves> {
    let key = Key::at(name);
    let points = context.load(&key.name("points"), file.points);
    let offsets = offsets(context, &key, file.vertices, points.as_ref().map(Vec::len));
    let n = offsets.as_ref().map(|o| o.len() - 1);
    let id = match file.id {
        Some(id) => context.load_per_curve(&key.name("id"), id, n),
        None => n.map(|n| (0..n as i32).collect()),
    };
    let group = match file.group {
        Some(group) => context.load_per_curve(&key.name("group"), group, n),
        None => n.map(|n| vec![0; n]),
    };
    let root_uv = match file.root_uv {
        Some(uv) => context.load_per_curve(&key.name("root_uv"), uv, n),
        None => n.map(|n| vec![[0.0; 2]; n]),
    };
    if let Some(id) = &id {
        check_unique(context.diagnostics, &key.name("id"), id);
    }
    if let Some(group) = &group {
        context.check_indices(&key.name("group"), group, context.group_count, "group");
    }
    let convention = context.convention;
    let curves = Curves {
        offsets: offsets?,
        points: points?.into_iter().map(|p| convention.length_in(p.into())).collect(),
        id: id?,
        group: group?,
        root_uv: root_uv?.into_iter().map(|uv| uv.map(|x| x as f32)).collect(),
        skin: Vec::new(),
    };
    check_lengths(context.diagnostics, &key.name("points"), &curves);
    Some(curves)
}

/// Start of each curve among the `points` points, and their end, for the curves at `section`.
fn offsets(
    context: &mut Context,
    section: &Key,
    vertices: Option<Vertices>,
    points: Option<usize>,
) -> Option<Vec<usize>> {
    let key = section.name("vertices");
    match vertices {
        None => {
            let n = points?;
            if n < 2 {
                too_few(context.diagnostics, &section.name("points"), n);
                return None;
            }
            Some(vec![0, n])
        }
        Some(Vertices::All(n)) => {
            let n = n as usize;
            if n < 2 {
                too_few(context.diagnostics, &key, n);
                return None;
            }
            let points = points?;
            if points == 0 || points % n != 0 {
                let message = format!("{n} points per curve do not divide {points} points");
                let allowed = format!("a divisor of {points}, the number of points");
                context.diagnostics.add(&key, message, allowed, "make vertices and points agree");
                return None;
            }
            Some((0..=points / n).map(|c| c * n).collect())
        }
        Some(Vertices::Each(counts)) => {
            let counts = context.load(&key, counts)?;
            let short = counts.iter().enumerate().filter(|(_, n)| **n < 2);
            for (c, n) in short.take(MAX_REPORTED) {
                too_few(context.diagnostics, &key.index(c), *n as usize);
            }
            let mut offsets = vec![0];
            let mut total = 0usize;
            for &n in &counts {
                total = total.saturating_add(n as usize);
                offsets.push(total);
            }
            let points = points?;
            if total != points || counts.is_empty() {
                let message = format!("sum is {total}, but there are {points} points");
                let allowed = format!("counts whose sum is {points}, the number of points");
                context.diagnostics.add(&key, message, allowed, "make vertices and points agree");
                return None;
            }
            counts.iter().all(|&n| n >= 2).then_some(offsets)
        }
    }
}

fn too_few(diagnostics: &mut Diagnostics, key: &Key, n: usize) {
    diagnostics.add(
        key,
        format!("curve has {n} point{}", if n == 1 { "" } else { "s" }),
        "at least 2 points per curve",
        "remove such curves",
    );
}

fn check_unique(diagnostics: &mut Diagnostics, key: &Key, id: &[i32]) {
    let mut order: Vec<usize> = (0..id.len()).collect();
    order.sort_by_key(|&i| (id[i], i));
    let pairs = order.windows(2).filter(|w| id[w[0]] == id[w[1]]);
    for pair in pairs.take(MAX_REPORTED) {
        let message = format!("duplicate id {}, also at index {}", id[pair[1]], pair[0]);
        diagnostics.add(&key.index(pair[1]), message, "unique ids", "number the curves again");
    }
}

fn check_lengths(diagnostics: &mut Diagnostics, key: &Key, curves: &Curves) {
    let degenerate = |c: &usize| polyline::length(curves.curve(*c)) <= f64::MIN_POSITIVE;
    let all: Vec<usize> = (0..curves.len()).filter(degenerate).collect();
    for &c in all.iter().take(MAX_REPORTED) {
        let message = format!("curve {c} (id {}) has length 0: its points coincide", curves.id[c]);
        let help = "remove the strand; `hairbake import` drops such strands";
        diagnostics.add(&key.index(curves.offsets[c]), message, "length above 0", help);
    }
    if all.len() > MAX_REPORTED {
        let message = format!("{} curves have length 0", all.len());
        diagnostics.add(key, message, "length above 0", "remove these strands");
    }
}
