//! Where the curves of a groom come from.

use crate::Result;
use crate::file::relative;
use crate::import::source::Source;
use crate::import::strand_file::{CleanDrawn, CleanStrands};
use crate::scene::{Groom, Origin, RestSpace, SourceCurves};
use std::path::Path;

/// The curves of a file as they are drawn.
pub(super) struct Drawn<'a> {
    source: &'a Source,
    space: RestSpace,
    drawn: CleanDrawn,
}

/// Where data in this space come from, for a file in `folder`.
///
/// # Errors
/// A path that has no absolute form.
pub(in crate::import) fn origin_of(source: &Source, space: RestSpace, folder: &Path) -> Result<Origin> {
    Ok(Origin { file: relative(&source.path, folder)?, prim: source.prim.clone(), time: source.time, space })
}

impl<'a> Drawn<'a> {
    /// Those of `file`, read from `source`; `None` for a format that has no control points.
    pub(super) fn of(file: &mut CleanStrands, source: &'a Source) -> Option<Self> {
        Some(Drawn { source, space: file.rest.space, drawn: file.drawn.take()? })
    }

    /// The source of `groom`, which is written to `folder`. `marked` tells whether its strands and its guides
    /// are among those that the file marks as guides; `None` for those that are not of the file.
    ///
    /// # Errors
    /// As [`origin_of`].
    pub(super) fn source_of(
        self,
        groom: &Groom,
        marked: [Option<bool>; 2],
        folder: &Path,
    ) -> Result<SourceCurves> {
        let Drawn { source, space, drawn } = self;
        let origin = origin_of(source, space, folder)?;
        let [strands, guides] = [(&groom.strands.curves, marked[0]), (&groom.guides.curves, marked[1])].map(
            |(curves, marked)| match marked {
                Some(marked) => drawn.indices(marked, &curves.id),
                None => vec![None; curves.len()],
            },
        );
        let CleanDrawn { curves, length, .. } = drawn;
        Ok(SourceCurves { origin, prims: curves.prims, vertices: curves.vertices, length, strands, guides })
    }
}
