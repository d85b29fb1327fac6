//! Guides and render strands as curves.

use super::Reader;
use crate::math::polyline;
use crate::scene::document::array::Array;
use crate::scene::document::{Faults, Key, MAX_NAMED};
use crate::scene::groom::file::{StrandsFile, Vertices};
use crate::scene::groom::{Curves, Strands, Tree, Wisp};
use nalgebra::Vector3;

/// Smallest and largest extent of the guides, m: what lies outside is more likely a wrong unit.
const EXTENT: [f64; 2] = [0.5e-3, 100.0];

/// What guides and strands have in common.
pub(super) struct CurvesFile {
    pub(super) vertices: Option<Vertices>,
    pub(super) points: Array<[f64; 3]>,
    pub(super) id: Option<Array<i32>>,
    pub(super) group: Option<Array<u32>>,
    pub(super) root_uv: Option<Array<[f64; 2]>>,
}

impl Reader<'_> {
    /// Curves of the section `name`.
    pub(super) fn curves(&mut self, name: &str, file: CurvesFile) -> Option<Curves> {
        let key = Key::at(name);
        let points = self.load(&format!("{name}.points"), file.points);
        let offsets = self.offsets(name, file.vertices, points.as_ref().map(Vec::len));
        let n = offsets.as_ref().map(|o| o.len() - 1);
        let id = match file.id {
            Some(id) => self.per_curve(&key.name("id"), id, n),
            None => n.map(|n| (0..n as i32).collect()),
        };
        let group = match file.group {
            Some(group) => self.per_curve(&key.name("group"), group, n),
            None => n.map(|n| vec![0; n]),
        };
        let root_uv = match file.root_uv {
            Some(uv) => self.per_curve(&key.name("root_uv"), uv, n),
            None => n.map(|n| vec![[0.0; 2]; n]),
        };
        if let Some(id) = &id {
            self.unique(&key.name("id"), id);
        }
        let groups = self.groups;
        if let Some(group) = &group {
            self.in_range(&key.name("group"), group, groups, "group");
        }
        let convention = self.convention;
        let curves = Curves {
            offsets: offsets?,
            points: points?.into_iter().map(|p| convention.length_in(p.into())).collect(),
            id: id?,
            group: group?,
            root_uv: root_uv?.into_iter().map(|uv| uv.map(|x| x as f32)).collect(),
        };
        self.not_zero_length(&key, &curves);
        Some(curves)
    }

    /// Start of each curve among the points, and their end.
    fn offsets(
        &mut self,
        name: &str,
        vertices: Option<Vertices>,
        points: Option<usize>,
    ) -> Option<Vec<usize>> {
        let key = Key::at(name).name("vertices");
        let too_few = |faults: &mut Faults, key: &Key, n: u32| {
            faults.add(key, format!("is {n}"), "at least 2 points a curve", "leave such curves out");
        };
        match vertices {
            None => {
                let n = points?;
                if n < 2 {
                    too_few(self.faults, &Key::at(name).name("points"), n as u32);
                    return None;
                }
                Some(vec![0, n])
            }
            Some(Vertices::All(n)) => {
                if n < 2 {
                    too_few(self.faults, &key, n);
                    return None;
                }
                let (n, points) = (n as usize, points?);
                if points == 0 || points % n != 0 {
                    let allowed = format!("a number that divides {points}, the number of points");
                    self.faults.add(&key, format!("is {n}"), allowed, "make vertices and points agree");
                    return None;
                }
                Some((0..=points / n).map(|c| c * n).collect())
            }
            Some(Vertices::Each(counts)) => {
                let counts = self.buffers.load(counts, &key, self.faults)?;
                let short = counts.iter().enumerate().filter(|(_, n)| **n < 2);
                for (c, n) in short.take(MAX_NAMED) {
                    too_few(self.faults, &key.index(c), *n);
                }
                let mut offsets = vec![0];
                let mut total = 0usize;
                for &n in &counts {
                    total = total.saturating_add(n as usize);
                    offsets.push(total);
                }
                let points = points?;
                if total != points || counts.is_empty() {
                    let what = format!("is {total} in sum, for {points} points");
                    self.faults.add(&key, what, "their sum is the number of points", "make the two agree");
                    return None;
                }
                counts.iter().all(|&n| n >= 2).then_some(offsets)
            }
        }
    }

    fn unique(&mut self, key: &Key, id: &[i32]) {
        let mut order: Vec<usize> = (0..id.len()).collect();
        order.sort_by_key(|&i| (id[i], i));
        let pairs = order.windows(2).filter(|w| id[w[0]] == id[w[1]]);
        for pair in pairs.take(MAX_NAMED) {
            let what = format!("is {}, as at index {}", id[pair[1]], pair[0]);
            self.faults.add(&key.index(pair[1]), what, "unique ids", "number the curves anew");
        }
    }

    fn not_zero_length(&mut self, key: &Key, curves: &Curves) {
        let degenerate = |c: &usize| polyline::length(curves.curve(*c)) <= f64::MIN_POSITIVE;
        let all: Vec<usize> = (0..curves.len()).filter(degenerate).collect();
        for &c in all.iter().take(MAX_NAMED) {
            let what = format!("curve {c} (id {}) has zero length: its points coincide", curves.id[c]);
            let remedy = "leave the strand out; `hairbake import` drops such strands";
            self.faults.add(&key.name("points").index(curves.offsets[c]), what, "length above 0", remedy);
        }
        if all.len() > MAX_NAMED {
            let what = format!("has {} such curves in all", all.len());
            self.faults.add(&key.name("points"), what, "length above 0", "leave these strands out");
        }
    }

    /// A groom of a wrong unit is far too small or too large.
    pub(super) fn extent(&mut self, guides: &Curves) {
        let corner = |start: f64, pick: fn(f64, f64) -> f64| {
            guides.points.iter().fold(Vector3::repeat(start), |corner, p| corner.zip_map(p, pick))
        };
        let size = (corner(f64::NEG_INFINITY, f64::max) - corner(f64::INFINITY, f64::min)).norm();
        if !(EXTENT[0]..=EXTENT[1]).contains(&size) {
            let unit = self.convention.metres_per_unit;
            let what = format!("makes the groom {size:.3e} m across at {unit} m a unit");
            let allowed = format!("a groom {} m to {} m across", EXTENT[0], EXTENT[1]);
            let remedy = "set the metres in one unit of the points: 1 for metres, 0.01 for centimetres";
            self.faults.add(&Key::at("metres_per_unit"), what, allowed, remedy);
        }
    }

    pub(super) fn strands(
        &mut self,
        file: StrandsFile,
        trees: Option<&[Tree]>,
        guide_count: Option<usize>,
    ) -> Option<Strands> {
        let wisp = file.wisp;
        let curves = self.curves(
            "strands",
            CurvesFile {
                vertices: file.vertices,
                points: file.points,
                id: file.id,
                group: file.group,
                root_uv: file.root_uv,
            },
        );
        let key = Key::at("strands.wisp");
        let wisp = self.per_curve(&key, wisp, curves.as_ref().map(Curves::len))?;
        let trees = trees?;
        // For each wisp its place in its tree, or `None` if it has children.
        let leaves: Vec<Option<(u32, u32)>> = if trees.is_empty() {
            (0..guide_count? as u32).map(|g| Some((g, 0))).collect()
        } else {
            let leaf =
                |t: usize, w: usize, wisp: &Wisp| (!wisp.guides.is_empty()).then_some((t as u32, w as u32));
            let of_tree = |(t, tree): (usize, &Tree)| {
                tree.wisps.iter().enumerate().map(|(w, wisp)| leaf(t, w, wisp)).collect::<Vec<_>>()
            };
            trees.iter().enumerate().flat_map(of_tree).collect()
        };
        if !self.in_range(&key, &wisp, leaves.len(), if trees.is_empty() { "guide" } else { "wisp" }) {
            return None;
        }
        let inner = wisp.iter().enumerate().filter(|(_, w)| leaves[**w as usize].is_none());
        for (i, w) in inner.take(MAX_NAMED) {
            let allowed = "a wisp without children";
            self.faults.add(
                &key.index(i),
                format!("is {w}, a wisp with children"),
                allowed,
                "name one of its leaves",
            );
        }
        let leaf = wisp.iter().map(|&w| leaves[w as usize]).collect::<Option<Vec<_>>>()?;
        Some(Strands { curves: curves?, leaf })
    }
}
