//! The USD curves that a groom was imported from.

use super::context::Context;
use crate::math::basis_curve::CurveType;
use crate::scene::groom::file::SourceFile;
use crate::scene::groom::source::{SourceCurves, SourcePrim};
use crate::scene::json::array::Array;
use crate::scene::json::key::Key;
use nalgebra::Matrix4;

/// The source of a groom with these numbers of strands and guides.
pub fn source(
    context: &mut Context,
    file: SourceFile,
    [strands, guides]: [usize; 2],
) -> Option<SourceCurves> {
    let key = Key::at("source");
    let SourceFile { origin, prims, vertices, length, strands: of_strands, guides: of_guides } = file;
    let vertices = context.load(&key.name("vertices"), vertices)?;
    let curves: usize = prims.iter().map(|prim| prim.curves as usize).sum();
    let expect =
        &mut |key: &Key, found, expected, item| context.diagnostics.expect_len(key, found, expected, item);
    if !expect(&key.name("vertices"), vertices.len(), curves, "curve of the prims") {
        return None;
    }
    let length = match length {
        Some(array) => {
            let length = context.load(&key.name("length"), array)?;
            if !context.diagnostics.expect_len(&key.name("length"), length.len(), curves, "curve") {
                return None;
            }
            Some(length)
        }
        None => None,
    };
    let mut indices = |name: &str, array: Option<Array<i32>>, n: usize| -> Option<Vec<Option<u32>>> {
        let key = key.name(name);
        let Some(array) = array else { return Some(vec![None; n]) };
        let found = context.load(&key, array)?;
        let known: Vec<u32> = found.iter().filter_map(|index| u32::try_from(*index).ok()).collect();
        let right = context.diagnostics.expect_len(&key, found.len(), n, "curve of the groom")
            && context.check_indices(&key, &known, curves, "curve");
        right.then(|| found.into_iter().map(|index| u32::try_from(index).ok()).collect())
    };
    let (strands, guides) = (indices("strands", of_strands, strands)?, indices("guides", of_guides, guides)?);
    let prims = prims.into_iter().map(|prim| SourcePrim {
        path: prim.path,
        curve: CurveType { basis: prim.basis, wrap: prim.wrap },
        curves: prim.curves as usize,
        to_rest: Matrix4::from_fn(|row, column| prim.to_rest_m[row][column]),
    });
    Some(SourceCurves { origin, prims: prims.collect(), vertices, length, strands, guides })
}
