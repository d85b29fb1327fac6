//! `groom.json` to a [`Groom`]: faults of meaning, units and axes.

use super::file::*;
use super::{Curves, Groom, Group, Guides, Material, RodSection, Section, Strands, Tree, Wisp};
use crate::math::polyline;
use crate::scene::Convention;
use crate::scene::document::array::{Array, Buffers, Element};
use crate::scene::document::{Document, Faults, Key};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Smallest and largest extent of the guides, m: what lies outside is more likely a wrong unit.
const EXTENT: [f64; 2] = [0.5e-3, 100.0];
/// Faulty curves that are reported one by one.
const MAX_NAMED: usize = 8;

/// Sections of the file and those that they build on.
pub const DEPENDS: &[(&str, &str)] = &[
    ("groups", "materials"),
    ("guides", "buffers"),
    ("guides", "groups"),
    ("wisps", "buffers"),
    ("wisps", "guides"),
    ("strands", "buffers"),
    ("strands", "groups"),
    ("strands", "guides"),
    ("strands", "wisps"),
];

/// The groom that `file` describes; `None` only where faults were noted.
pub fn groom(file: GroomFile, stem: &str, doc: &mut Document) -> Option<Groom> {
    let folder = doc.folder();
    let faults = &mut doc.faults;
    let convention = Convention { metres_per_unit: file.metres_per_unit, up: file.up_axis };
    let buffers = Buffers::read(&file.buffers, &folder, faults);
    let materials = materials(&file.materials, faults);
    let groups = groups(&file.groups, &materials, faults);
    let mut reader = Reader { convention, buffers, groups: groups.len(), faults };

    let root_frame_wxyz = file.guides.root_frame_wxyz;
    let guides = reader.curves(
        "guides",
        CurvesFile {
            vertices: file.guides.vertices,
            points: file.guides.points,
            id: file.guides.id,
            group: file.guides.group,
            root_uv: file.guides.root_uv,
        },
    );
    let guide_count = guides.as_ref().map(Curves::len);
    let root_frame = root_frame_wxyz.map(|frames| {
        let frames = reader.frames("guides.root_frame_wxyz", frames)?;
        let wanted = guide_count.unwrap_or(frames.len());
        let ok = reader.faults.expect_len(&Key::at("guides.root_frame_wxyz"), frames.len(), wanted, "guide");
        ok.then_some(frames)
    });
    if let Some(guides) = &guides {
        reader.extent(guides);
    }
    let trees = match file.wisps {
        Some(wisps) => reader.wisps(wisps, guide_count),
        None => Some(Vec::new()),
    };
    let strands = match file.strands {
        Some(strands) => reader.strands(strands, trees.as_deref(), guide_count),
        None => Some(Strands::default()),
    };
    Some(Groom {
        name: file.name.unwrap_or_else(|| stem.into()),
        convention,
        materials,
        groups,
        guides: Guides { curves: guides?, root_frame: root_frame.map_or(Some(None), |f| f.map(Some))? },
        trees: trees?,
        strands: strands?,
    })
}

fn materials(files: &[MaterialFile], faults: &mut Faults) -> Vec<Material> {
    for (i, file) in files.iter().enumerate() {
        if files[..i].iter().any(|other| other.name == file.name) {
            let key = Key::at("materials").index(i).name("name");
            faults.add(&key, format!("\"{}\" names two materials", file.name), "unique names", "rename one");
        }
    }
    if files.is_empty() { vec![Material::default()] } else { files.iter().map(Material::from).collect() }
}

fn groups(files: &[GroupFile], materials: &[Material], faults: &mut Faults) -> Vec<Group> {
    let width = |m: &Material| [2.0 * m.section.a1.max(m.section.a2); 2];
    let group = |(i, file): (usize, &GroupFile)| {
        let found = match &file.material {
            MaterialRef::Index(index) => Some(*index as usize).filter(|&index| index < materials.len()),
            MaterialRef::Name(name) => materials.iter().position(|m| m.name == *name),
        };
        if found.is_none() {
            let names: Vec<String> = materials.iter().map(|m| format!("\"{}\"", m.name)).collect();
            let what = match &file.material {
                MaterialRef::Index(index) => format!("is {index}"),
                MaterialRef::Name(name) => format!("is \"{name}\""),
            };
            let allowed = format!("an index below {} or one of {}", materials.len(), names.join(", "));
            faults.add(
                &Key::at("groups").index(i).name("material"),
                what,
                allowed,
                "name a material of this file",
            );
        }
        let material = found.unwrap_or(0);
        Group {
            name: file.name.clone(),
            material: material as u32,
            width: file.width_m.unwrap_or_else(|| width(&materials[material])),
        }
    };
    if files.is_empty() {
        return vec![Group { name: "hair".into(), material: 0, width: width(&materials[0]) }];
    }
    files.iter().enumerate().map(group).collect()
}

impl From<&MaterialFile> for Material {
    fn from(file: &MaterialFile) -> Self {
        Material {
            name: file.name.clone(),
            young_modulus: file.young_modulus_pa,
            shear_modulus: file.shear_modulus_pa,
            density: file.density_kg_m3,
            section: match file.section {
                SectionFile::Round { radius_m } => RodSection { a1: radius_m, a2: radius_m },
                SectionFile::Elliptic { semi_axes_m: [a1, a2] } => RodSection { a1, a2 },
            },
            natural: file.natural_curvature_per_m.map(Vector3::from),
            sag_free: file.sag_free,
            damping: file.damping_s,
            friction: file.friction,
            drag: file.drag,
            shielding: file.shielding,
        }
    }
}

/// What guides and strands have in common.
struct CurvesFile {
    vertices: Option<Vertices>,
    points: Array<[f64; 3]>,
    id: Option<Array<i32>>,
    group: Option<Array<u32>>,
    root_uv: Option<Array<[f64; 2]>>,
}

struct Reader<'a> {
    convention: Convention,
    buffers: Buffers,
    /// Number of groups.
    groups: usize,
    faults: &'a mut Faults,
}

impl Reader<'_> {
    fn load<T: Element>(&mut self, key: &str, array: Array<T>) -> Option<Vec<T>> {
        self.buffers.load(array, &Key::at(key), self.faults)
    }

    /// Curves of the section `name`.
    fn curves(&mut self, name: &str, file: CurvesFile) -> Option<Curves> {
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

    /// An array with one element a curve.
    fn per_curve<T: Element>(&mut self, key: &Key, array: Array<T>, n: Option<usize>) -> Option<Vec<T>> {
        let elements = self.buffers.load(array, key, self.faults)?;
        let wanted = n.unwrap_or(elements.len());
        self.faults.expect_len(key, elements.len(), wanted, "curve").then_some(elements)
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

    /// Indices below `n`.
    fn in_range(&mut self, key: &Key, indices: &[u32], n: usize, of: &str) -> bool {
        let bad = || indices.iter().enumerate().filter(|(_, i)| **i as usize >= n);
        for (at, i) in bad().take(MAX_NAMED) {
            let allowed = format!("index of a {of}, below {n}");
            self.faults.add(&key.index(at), format!("is {i}"), allowed, "correct the index");
        }
        bad().next().is_none()
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
    fn extent(&mut self, guides: &Curves) {
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

    /// Unit quaternions turned to Y up.
    fn frames(&mut self, key: &str, array: Array<[f64; 4]>) -> Option<Vec<UnitQuaternion<f64>>> {
        let convention = self.convention;
        let frames = self.load(key, array)?;
        let quaternions = unit_quaternions(&frames, &Key::at(key), self.faults)?;
        Some(quaternions.into_iter().map(|q| convention.frame_in(q)).collect())
    }

    fn wisps(&mut self, file: WispsFile, guide_count: Option<usize>) -> Option<Vec<Tree>> {
        let parent = self.load("wisps.parent", file.parent);
        let length = self.load("wisps.length", file.length);
        let strand_count = self.load("wisps.strand_count", file.strand_count);
        let sections = self.load("wisps.sections", file.sections);
        let arc = self.load("wisps.arc", file.arc);
        let centre = self.load("wisps.centre", file.centre);
        let frame = self.frames("wisps.frame_wxyz", file.frame_wxyz);
        let radius = self.load("wisps.radius", file.radius);
        let counts = self.load("wisps.guide_count", file.guide_count);
        let guides = self.load("wisps.guides", file.guides);

        let (parent, length, strand_count) = (parent?, length?, strand_count?);
        let (sections, arc, counts, guides) = (sections?, arc?, counts?, guides?);
        let (centre, frame, radius) = (centre?, frame?, radius?);
        let before = self.faults.len();
        let starts = self.tree_starts(&parent)?;
        let tree_of = |w: usize| starts.partition_point(|&s| s <= w) - 1;
        let n = parent.len();
        let at = |name: &str| Key::at("wisps").name(name);
        let faults = &mut *self.faults;
        faults.expect_len(&at("length"), length.len(), n, "wisp");
        faults.expect_len(&at("strand_count"), strand_count.len(), n, "wisp");
        faults.expect_len(&at("guide_count"), counts.len(), n, "wisp");
        let total = counts.iter().map(|&c| c as usize).sum();
        faults.expect_len(&at("guides"), guides.len(), total, "unit of guide_count");
        if faults.expect_len(&at("sections"), sections.len(), starts.len(), "tree (parent -1)") {
            let total = sections.iter().map(|&s| s as usize).sum();
            faults.expect_len(&at("arc"), arc.len(), total, "section of each tree");
            let total = (0..n).map(|w| sections[tree_of(w)] as usize).sum();
            faults.expect_len(&at("centre"), centre.len(), total, "section of each wisp");
            faults.expect_len(&at("frame_wxyz"), frame.len(), total, "section of each wisp");
            faults.expect_len(&at("radius"), radius.len(), total, "section of each wisp");
        }
        self.numbers("length", &length, |x| x > 0.0, "above 0");
        self.numbers("radius", &radius, |x| x >= 0.0, "0 or more");
        self.numbers("strand_count", &strand_count, |x| x > 0.0, "at least 1");
        self.numbers("sections", &sections, |x| x >= 2.0, "at least 2");
        if self.faults.len() > before {
            return None;
        }
        self.arcs(&sections, &arc);
        self.leaves(&parent, &counts, &guides, guide_count);
        if self.faults.len() > before {
            return None;
        }

        let unit = self.convention.metres_per_unit;
        let (mut next_arc, mut next_section, mut next_guide) = (0, 0, 0);
        let trees = starts.iter().enumerate().map(|(t, &start)| {
            let count = sections[t] as usize;
            let end = starts.get(t + 1).copied().unwrap_or(n);
            let wisps = (start..end).map(|w| {
                let first = advance(&mut next_section, count);
                let guide = advance(&mut next_guide, counts[w] as usize);
                Wisp {
                    parent: u32::try_from(parent[w]).ok().map(|p| p - start as u32),
                    length: length[w] * unit,
                    strand_count: strand_count[w],
                    sections: (first..first + count)
                        .map(|s| Section {
                            centre: self.convention.length_in(centre[s].into()),
                            frame: frame[s],
                            radius: radius[s] * unit,
                        })
                        .collect(),
                    guides: guides[guide..next_guide].to_vec(),
                }
            });
            let wisps = wisps.collect();
            let first = advance(&mut next_arc, count);
            Tree { arc: arc[first..next_arc].to_vec(), wisps }
        });
        Some(trees.collect())
    }

    /// Index of the coarse wisp of each tree.
    fn tree_starts(&mut self, parent: &[i32]) -> Option<Vec<usize>> {
        let key = Key::at("wisps.parent");
        let before = self.faults.len();
        let mut starts = Vec::new();
        for (w, &p) in parent.iter().enumerate() {
            if p == -1 {
                starts.push(w);
                continue;
            }
            let start = starts.last().copied();
            if !start.is_some_and(|start| p >= start as i32 && p < w as i32) {
                let allowed = match start {
                    Some(start) => format!("-1, or an earlier wisp of its tree: {start} ≤ x < {w}"),
                    None => "-1: the first wisp starts a tree".into(),
                };
                let remedy = "order the wisps tree by tree, parents before children";
                self.faults.add(&key.index(w), format!("is {p}"), allowed, remedy);
                if self.faults.len() - before >= MAX_NAMED {
                    break;
                }
            }
        }
        if parent.is_empty() {
            self.faults.add(&key, "is empty", "at least one wisp", "leave \"wisps\" out to have one a guide");
        }
        (self.faults.len() == before).then_some(starts)
    }

    fn numbers<T: Element>(&mut self, name: &str, values: &[T], good: fn(f64) -> bool, allowed: &str) {
        let value = |x: &T| x.components().next().unwrap_or(f64::NAN);
        let bad = values.iter().map(value).enumerate().filter(|(_, x)| !good(*x));
        for (i, x) in bad.take(MAX_NAMED) {
            self.faults.add(
                &Key::at("wisps").name(name).index(i),
                format!("is {x}"),
                allowed,
                "correct the value",
            );
        }
    }

    /// Arc-length fractions run from 0 to 1 and increase.
    fn arcs(&mut self, sections: &[u32], arc: &[f64]) {
        let key = Key::at("wisps.arc");
        let mut first = 0;
        for &count in sections {
            let end = first + count as usize;
            for i in first..end {
                let (good, allowed) = match i {
                    i if i == first => (arc[i] == 0.0, "0 at the root".into()),
                    i if i + 1 == end => (arc[i] == 1.0, "1 at the tip".into()),
                    i => (arc[i - 1] < arc[i] && arc[i] < 1.0, format!("increasing: {} < x < 1", arc[i - 1])),
                };
                if !good {
                    self.faults.add(
                        &key.index(i),
                        format!("is {}", arc[i]),
                        allowed,
                        "order the sections root to tip",
                    );
                    break;
                }
            }
            first = end;
        }
    }

    /// Leaves hold guides, others none, and every guide lies in one leaf.
    fn leaves(&mut self, parent: &[i32], counts: &[u32], guides: &[u32], guide_count: Option<usize>) {
        let mut has_child = vec![false; parent.len()];
        for &p in parent.iter().filter(|p| **p >= 0) {
            has_child[p as usize] = true;
        }
        let at = |name: &str, i: usize| Key::at("wisps").name(name).index(i);
        let mut named = 0;
        for (w, (&child, &count)) in has_child.iter().zip(counts).enumerate() {
            if child != (count == 0) && named < MAX_NAMED {
                named += 1;
                let (allowed, remedy) = match child {
                    true => ("0: only wisps without children hold guides", "give its guides to its children"),
                    false => ("at least 1: a wisp without children holds guides", "drop the empty wisp"),
                };
                self.faults.add(&at("guide_count", w), format!("is {count}"), allowed, remedy);
            }
        }
        let Some(n) = guide_count else { return };
        if !self.in_range(&Key::at("wisps.guides"), guides, n, "guide") {
            return;
        }
        let mut place = vec![None; n];
        for (i, &g) in guides.iter().enumerate() {
            if let Some(other) = place[g as usize].replace(i) {
                let what = format!("is {g}, as at index {other}");
                self.faults.add(&at("guides", i), what, "every guide once", "keep a guide in one wisp");
            }
        }
        let missing: Vec<String> =
            place.iter().enumerate().filter(|(_, p)| p.is_none()).map(|(g, _)| g.to_string()).collect();
        if !missing.is_empty() {
            let shown = missing.iter().take(MAX_NAMED).cloned().collect::<Vec<_>>().join(", ");
            let what = format!(
                "lacks {} of {n} guides: {shown}{}",
                missing.len(),
                if missing.len() > MAX_NAMED { " …" } else { "" }
            );
            self.faults.add(&Key::at("wisps.guides"), what, "every guide once", "give each guide a wisp");
        }
    }

    fn strands(
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

/// Quaternions (w, x, y, z) of about unit length, normalised.
pub fn unit_quaternions(
    wxyz: &[[f64; 4]],
    key: &Key,
    faults: &mut Faults,
) -> Option<Vec<UnitQuaternion<f64>>> {
    let norm = |q: &[f64; 4]| q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let bad = || wxyz.iter().enumerate().filter(|(_, q)| !(0.9..=1.1).contains(&norm(q)));
    for (i, q) in bad().take(MAX_NAMED) {
        let what = format!("is {q:?}, of length {:.3}", norm(q));
        let allowed = "unit quaternions (w, x, y, z), length 0.9 to 1.1";
        faults.add(&key.index(i), what, allowed, "write unit quaternions, w first");
    }
    let unit = |&[w, x, y, z]: &[f64; 4]| UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    bad().next().is_none().then(|| wxyz.iter().map(unit).collect())
}

/// `next`, which moves on by `n`.
fn advance(next: &mut usize, n: usize) -> usize {
    let first = *next;
    *next += n;
    first
}
