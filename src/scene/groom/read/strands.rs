//! Reads the render strands of `groom.json`, `"strands"`.

use super::context::Context;
use super::curves::{CurvesFile, curves};
use crate::scene::groom::file::StrandsFile;
use crate::scene::groom::model::{Curves, Strands, Tree, Wisp};
use crate::scene::json::diagnostics::MAX_REPORTED;
use crate::scene::json::key::Key;

/// The render strands of a groom with `trees` and `guide_count` guides, each assigned to a leaf wisp; without
/// trees every guide is a leaf of its own. `None` stands for what could not be read; its errors are in the
/// diagnostics of `context`.
pub fn strands(
    context: &mut Context,
    file: StrandsFile,
    trees: Option<&[Tree]>,
    guide_count: Option<usize>,
) -> Option<Strands> {
    let StrandsFile { vertices, points, id, group, root_uv, wisp } = file;
    let curves = curves(context, "strands", CurvesFile { vertices, points, id, group, root_uv });
    let key = Key::at("strands.wisp");
    let wisp = context.load_per_curve(&key, wisp, curves.as_ref().map(Curves::len))?;
    let trees = trees?;
    // The leaf by the file's index, and what that index counts.
    let (leaves, item) = match trees {
        [] => ((0..guide_count? as u32).map(|g| Some((g, 0))).collect(), "guide"),
        trees => (leaves(trees), "wisp"),
    };
    if !context.check_indices(&key, &wisp, leaves.len(), item) {
        return None;
    }
    let not_leaves = wisp.iter().enumerate().filter(|(_, w)| leaves[**w as usize].is_none());
    for (i, w) in not_leaves.take(MAX_REPORTED) {
        let message = format!("wisp {w} has children");
        let allowed = "a leaf wisp: one without children";
        context.diagnostics.add(&key.index(i), message, allowed, "use one of its leaves");
    }
    let leaf = wisp.iter().map(|&w| leaves[w as usize]).collect::<Option<Vec<_>>>()?;
    Some(Strands { curves: curves?, leaf })
}

/// For each wisp of all trees in order: its tree, and its index in that tree; `None` if it has children.
/// Leaves alone have guides.
fn leaves(trees: &[Tree]) -> Vec<Option<(u32, u32)>> {
    let leaf = |t: usize, w: usize, wisp: &Wisp| (!wisp.guides.is_empty()).then_some((t as u32, w as u32));
    let of_tree = |(t, tree): (usize, &Tree)| {
        tree.wisps.iter().enumerate().map(|(w, wisp)| leaf(t, w, wisp)).collect::<Vec<_>>()
    };
    trees.iter().enumerate().flat_map(of_tree).collect()
}
