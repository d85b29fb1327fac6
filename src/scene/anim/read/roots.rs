//! How roots are held.

use super::context::Context;
use crate::scene::anim::ends_file::RootsFile;
use crate::scene::anim::model::Roots;
use crate::scene::json::key::Key;

/// How some roots are held.
pub fn roots(context: &mut Context, files: Vec<RootsFile>) -> Vec<Roots> {
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    context.check_unique("roots", &names);
    let roots = |(i, RootsFile { name, ids, group, within, hold })| {
        let guides = context.selection(&Key::at("roots").index(i), ids, group, within);
        Roots { name, guides, hold }
    };
    files.into_iter().enumerate().map(roots).collect()
}
