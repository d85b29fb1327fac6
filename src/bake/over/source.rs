//! The curves of a groom's source: how they lie in the groom's pose, and what they move as.

use super::motion::affine;
use crate::cache::{CurveFrame, Frame, Header, ranges};
use crate::math::basis_curve::{CurveFit, CurveType};
use crate::scene::{Convention, Curves, Groom, OverPrim, RootBinding, SourceCurves};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::ops::Range;

/// A set of curves of the cache.
#[derive(Debug, Clone, Copy)]
pub(super) enum Set {
    Hair,
    Guides,
}

impl Set {
    pub const ALL: [Set; 2] = [Set::Hair, Set::Guides];

    /// The points of each curve, and the points at rest, m.
    pub fn curves(self, header: &Header, convention: Convention) -> (Vec<Range<usize>>, Vec<Vector3<f64>>) {
        let set = match self {
            Set::Hair => header.hair.as_ref(),
            Set::Guides => Some(&header.guides),
        };
        let Some(set) = set else { return Default::default() };
        let rest = set.rest.iter().map(|p| convention.length_in(p.map(f64::from).into()));
        (set.ranges().collect(), rest.collect())
    }

    /// Path of the prim in the cache.
    pub fn path(self) -> &'static str {
        match self {
            Set::Hair => "/groom/hair",
            Set::Guides => "/groom/guides",
        }
    }

    /// Number of curves in the cache.
    pub fn count(self, header: &Header) -> usize {
        match self {
            Set::Hair => header.hair.as_ref().map_or(0, |hair| hair.counts.len()),
            Set::Guides => header.guides.counts.len(),
        }
    }

    /// The curves of the groom that it holds.
    pub fn of_groom(self, groom: &Groom) -> &Curves {
        match self {
            Set::Hair => &groom.strands.curves,
            Set::Guides => &groom.guides.curves,
        }
    }

    pub fn of(self, moment: &Frame) -> Option<&CurveFrame> {
        match self {
            Set::Hair => moment.hair.as_ref(),
            Set::Guides => Some(&moment.guides),
        }
    }
}

/// The fits of all types and sizes of curves.
#[derive(Default)]
pub(super) struct Fits {
    pub all: Vec<CurveFit>,
    index: BTreeMap<(CurveType, usize), usize>,
}

impl Fits {
    /// Index of the fit of curves that an [`OverPlan`](super::OverPlan) has checked.
    pub fn index(&mut self, curve: CurveType, count: usize) -> usize {
        let all = &mut self.all;
        *self.index.entry((curve, count)).or_insert_with(|| {
            all.extend(CurveFit::new(curve, count));
            all.len() - 1
        })
    }
}

/// The control points of a prim of the stage in rest space, m, lengthened as its curves were.
pub(super) fn rest_controls(
    source: &SourceCurves,
    of: usize,
    prim: &OverPrim,
    fits: &mut Fits,
) -> Vec<Vector3<f64>> {
    let to_rest = &source.prims[of].to_rest;
    let mut rest: Vec<_> = prim.points.iter().map(|p| affine(to_rest, p)).collect();
    if let Some(length) = &source.length {
        let factors = &length[source.starts()[of]..];
        for (controls, factor) in ranges(prim.vertices.iter().copied()).zip(factors) {
            let fit = fits.index(prim.curve, controls.len());
            let root = fits.all[fit].samples[0].of(&rest[controls.clone()]);
            rest[controls].iter_mut().for_each(|p| *p = root + (*p - root) * *factor);
        }
    }
    rest
}

/// The curve of the cache that each curve of a source moves as.
#[derive(Debug)]
pub(super) struct Owners {
    each: Vec<Option<(Set, usize)>>,
    /// The first curve of each prim, and the number of all.
    starts: Vec<usize>,
}

impl Owners {
    pub fn new(source: &SourceCurves) -> Self {
        let mut each = vec![None; source.vertices.len()];
        // A strand is drawn, a guide may not be.
        for (set, curves) in [(Set::Guides, &source.guides), (Set::Hair, &source.strands)] {
            for (i, curve) in curves.iter().enumerate() {
                if let Some(curve) = curve {
                    each[*curve as usize] = Some((set, i));
                }
            }
        }
        Owners { each, starts: source.starts() }
    }

    /// Those of the curves of a prim of the source.
    pub fn of_prim(&self, of: usize) -> &[Option<(Set, usize)>] {
        &self.each[self.starts[of]..self.starts[of + 1]]
    }
}

/// The place of a skin that carries the root of the groom nearest to `x`, m, rest space: for curves that were
/// left out of the groom. `None` if the head carries all roots.
pub(super) fn nearest_root(groom: &Groom, x: &Vector3<f64>) -> Option<RootBinding> {
    let roots = groom.guides.curves.skin.iter().chain(&groom.strands.curves.skin);
    let distance = |root: &&RootBinding| (root.place.rest() - x).norm_squared();
    roots.min_by(|a, b| distance(a).total_cmp(&distance(b))).cloned()
}
