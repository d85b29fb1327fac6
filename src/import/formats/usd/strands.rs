//! Basis curves of a USD stage.

use super::exchange::{Exchange, matrices, points, required};
use crate::Result;
use crate::import::plain::{DrawnCurves, PlainGroup, PlainStrands, Rest, StrandAttributes};
use crate::import::source::Source;
use crate::math::basis_curve::{Basis, CurveType, Wrap};
use crate::scene::{Curves, Factors, RestSpace, SourcePrim};
use serde::Deserialize;

#[derive(Debug, Deserialize)]
struct Header {
    groups: Vec<String>,
    space: RestSpace,
    prims: Vec<PrimHeader>,
}

#[derive(Debug, Deserialize)]
struct PrimHeader {
    path: String,
    basis: Basis,
    wrap: Wrap,
    curves: usize,
}

/// Reads the curves at and below a prim, evaluated to points, with ids, groups, root coordinates and widths.
///
/// # Errors
/// As [`Exchange::read`].
pub(crate) fn read(source: &Source) -> Result<PlainStrands> {
    let read = Exchange::<Header>::read("strands", source, &[])?;
    let counts = required(read.u32s("counts"), "counts")?;
    let root_uv = required(read.f32s("root_uv"), "root_uv")?;
    let group = required(read.u32s("group"), "group")?;
    let guide: Vec<bool> = required(read.u32s("guide"), "guide")?.iter().map(|&flag| flag != 0).collect();
    let mut offsets = vec![0];
    offsets.extend(counts.iter().scan(0, |sum, n| {
        *sum += *n as usize;
        Some(*sum)
    }));
    let to_rest = matrices(&required(read.f64s("to_rest"), "to_rest")?);
    let prims = read.header.more.prims.iter().zip(to_rest).map(|(prim, to_rest)| SourcePrim {
        path: prim.path.clone(),
        curve: CurveType { basis: prim.basis, wrap: prim.wrap },
        curves: prim.curves,
        to_rest,
    });
    let drawn =
        DrawnCurves { prims: prims.collect(), vertices: required(read.u32s("controls"), "controls")? };
    let widths = read.f64s("width");
    let groups = read.header.more.groups.iter().enumerate().map(|(g, name)| PlainGroup {
        name: name.clone(),
        width: widths.as_ref().and_then(|all| mean_width(all.as_chunks().0, &group, &guide, g as u32)),
    });
    Ok(PlainStrands {
        groups: groups.collect(),
        curves: Curves {
            offsets,
            points: points(&required(read.f64s("points"), "points")?),
            id: required(read.i32s("id"), "id")?,
            group,
            root_uv: root_uv.as_chunks().0.to_vec(),
            skin: Vec::new(),
        },
        guide,
        attributes: attributes(&read, counts.len()),
        declared: read.header.declared(),
        rest: Rest { space: read.header.more.space, from_world: None },
        drawn: Some(drawn),
        notes: read.header.notes,
        ..PlainStrands::default()
    })
}

/// Attributes of `n` curves; empty if the stage has none.
fn attributes(read: &Exchange<Header>, n: usize) -> Vec<StrandAttributes> {
    let (length, clump) = (read.f64s("length"), read.i32s("clump"));
    let factors = Factors::NAMES.map(|name| read.f64s(name));
    if length.is_none() && clump.is_none() && factors.iter().all(Option::is_none) {
        return Vec::new();
    }
    let at = |values: &Option<Vec<f64>>, c: usize| values.as_ref().map_or(1.0, |values| values[c]);
    let of_curve = |c: usize| StrandAttributes {
        length: at(&length, c),
        factors: factors.each_ref().map(|values| at(values, c)),
        // A negative number marks a curve without a clump.
        clump: clump.as_ref().map(|clump| clump[c]).filter(|clump| *clump >= 0),
    };
    (0..n).map(of_curve).collect()
}

/// Mean width at root and tip of the curves in group `wanted` that are not guides, or of its guides if it has
/// no other curves with a width; `None` if it has no width.
fn mean_width(widths: &[[f64; 2]], group: &[u32], guide: &[bool], wanted: u32) -> Option<[f64; 2]> {
    let mean = |guides: bool| {
        let members: Vec<_> =
            (0..widths.len()).filter(|&c| group[c] == wanted && guide[c] == guides).collect();
        let mean =
            [0, 1].map(|end| members.iter().map(|&c| widths[c][end]).sum::<f64>() / members.len() as f64);
        (mean[0] > 0.0).then_some(mean)
    };
    mean(false).or_else(|| mean(true))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_are_averaged_per_group() {
        let widths = [[1.0, 0.5], [3.0, 1.5], [9.0, 9.0], [5.0, 5.0]];
        let mean = |group: &[u32; 4], wanted| mean_width(&widths, group, &[false, false, true, true], wanted);
        assert_eq!(mean(&[0, 0, 0, 1], 0), Some([2.0, 1.0]));
        assert_eq!(mean(&[0, 0, 0, 1], 1), Some([5.0, 5.0]));
        assert_eq!(mean(&[0; 4], 1), None);
        assert_eq!(mean_width(&[[0.0, 0.0]], &[0], &[false], 0), None);
    }
}
