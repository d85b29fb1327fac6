//! The USD curves that a groom was imported from, as they are drawn.

use crate::math::basis_curve::CurveType;
use crate::scene::origin::Origin;
use nalgebra::Matrix4;

/// The USD curves that a groom was imported from. Their points are in the stage.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceCurves {
    /// Where they were read.
    pub origin: Origin,
    /// The prims, in the order of the stage.
    pub prims: Vec<SourcePrim>,
    /// Number of control points of each curve, prim after prim.
    pub vertices: Vec<u32>,
    /// Factor by which each curve was lengthened about its root; `None` for 1.
    pub length: Option<Vec<f64>>,
    /// The curve that each render strand was read from.
    pub strands: Vec<Option<u32>>,
    /// The curve that each guide was read from.
    pub guides: Vec<Option<u32>>,
}

/// A prim of [`SourceCurves`].
#[derive(Debug, Clone, PartialEq)]
pub struct SourcePrim {
    /// Path of the prim.
    pub path: String,
    /// Type of its curves.
    pub curve: CurveType,
    /// Number of curves.
    pub curves: usize,
    /// Matrix from the space of the prim to rest space in metres, Y up.
    pub to_rest: Matrix4<f64>,
}

impl SourceCurves {
    /// Whether render strands were read from the curves: not guides alone, which strands may be grown around.
    pub fn has_strands(&self) -> bool {
        self.strands.iter().any(Option::is_some)
    }

    /// The first curve of each prim among those of all, and the number of all.
    pub fn starts(&self) -> Vec<usize> {
        let ends = self.prims.iter().scan(0, |end, prim| {
            *end += prim.curves;
            Some(*end)
        });
        std::iter::once(0).chain(ends).collect()
    }
}
