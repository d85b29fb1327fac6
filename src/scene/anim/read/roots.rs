//! How roots are held.

use super::context::Context;
use crate::scene::anim::ends_file::RootsFile;
use crate::scene::anim::model::Roots;

/// How some roots are held.
pub fn roots(context: &mut Context, files: Vec<RootsFile>) -> Vec<Roots> {
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    context.check_unique("roots", &names);
    let roots = |RootsFile { name, ids, group, within, hold }| Roots {
        name,
        guides: context.selection(ids, group, within),
        hold,
    };
    files.into_iter().map(roots).collect()
}
