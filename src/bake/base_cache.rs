//! An earlier cache of the same shot: a bake of some groups copies the curves of all other groups from it.

use super::single::extent;
use crate::cache::{
    self, ColliderFrame, ColliderMesh, CurveFrame, CurveSet, Frame, Header, InputRecord, MANIFEST, Reader,
};
use crate::error::{Diagnostic, Error, Result};
use crate::file::{FileRecord, record_of};
use crate::scene::{Anim, Curves, Groom};
use nalgebra::Vector3;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Largest relative difference of rest points, head matrices and skins between base and bake: both are
/// written rounded.
const REST_TOLERANCE: f64 = 1e-6;

/// A selection of groups to bake over an earlier cache.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GroupSelection {
    /// Names of the groups.
    pub groups: Vec<String>,
    /// Folder of the finished cache with the other groups.
    pub base: PathBuf,
}

/// An earlier cache, checked to fit a bake.
#[derive(Debug)]
pub struct BaseCache {
    reader: Reader,
    /// Checksums of its frame files, from its manifest.
    files: BTreeMap<i32, FileRecord>,
    /// For each group of the groom, whether it is baked anew.
    baked: Vec<bool>,
    hair: Vec<CurveSource>,
    guides: Vec<CurveSource>,
}

/// Where a curve comes from.
#[derive(Debug)]
struct CurveSource {
    /// True for the base, false for this bake.
    from_base: bool,
    /// Index of the curve there, and its points.
    curve: usize,
    points: Range<usize>,
}

impl BaseCache {
    /// Opens the base of a bake of `groom` whose cache will have this `header`.
    ///
    /// # Errors
    /// [`Error::Usage`] for groups that the groom does not have; [`Error::Io`] and [`Error::Damaged`] if the
    /// base cannot be read; [`Error::BadInput`] with all differences from this bake.
    pub fn open(selection: &GroupSelection, groom: &Groom, anim: &Anim, header: &Header) -> Result<Self> {
        let baked: Vec<bool> = groom.groups.iter().map(|g| selection.groups.contains(&g.name)).collect();
        if let Some(name) =
            selection.groups.iter().find(|name| !groom.groups.iter().any(|g| g.name == **name))
        {
            let names: Vec<&str> = groom.groups.iter().map(|g| g.name.as_str()).collect();
            return Err(Error::Usage(format!(
                "the groom has no group {name:?}; it has {}",
                names.join(", ")
            )));
        }
        if header.reactions.is_some() {
            return Err(Error::Usage("reactions are not written with --base: leave out one of them".into()));
        }
        let reader = Reader::open(&selection.base)?;
        let manifest = reader.read_manifest()?;
        let old = reader.header();
        let mut mismatches = Mismatches { file: selection.base.join(MANIFEST), diagnostics: Vec::new() };
        mismatches.unless_same("metres_per_unit", old.metres_per_unit, header.metres_per_unit);
        let axis = |header: &Header| if header.z_up { "Z" } else { "Y" };
        mismatches.unless_same("up_axis", axis(old), axis(header));
        mismatches.unless_same("fps", old.fps, header.fps);
        mismatches.unless_same("levels of wisps written", old.levels, header.levels);
        mismatches.unless_same("accelerations", old.accelerations, header.accelerations);
        mismatches.unless_same("normals", old.normals, header.normals);
        let skins =
            |header: &Header| skins(header).map(|(_, skin)| &*skin.name).collect::<Vec<_>>().join(", ");
        mismatches.unless_same("skins", skins(old), skins(header));
        for (key, value) in
            [("samples", f64::from(anim.settings.samples)), ("shutter", anim.settings.shutter)]
        {
            // A single moment is the frame itself, whatever the shutter.
            if key == "samples" || anim.settings.samples > 1 || header.accelerations {
                let found = manifest.settings[key].as_f64();
                mismatches.unless_same(key, found.unwrap_or(f64::NAN), value);
            }
        }
        let frames = header.frames.0 - 1..=header.frames.1 + 1;
        let missing = frames.clone().filter(|f| !manifest.frames.iter().any(|record| record.frame == *f));
        if let Some(first) = missing.clone().next() {
            let found = format!("the base lacks frame {first} and {} more", missing.count() - 1);
            mismatches.add("frames", found, format!("frames {} to {}", frames.start(), frames.end()));
        }
        let sets = [(old.hair.as_ref(), header.hair.as_ref()), (Some(&old.guides), Some(&header.guides))];
        let none = CurveSet::default();
        let [hair, guides] = [0, 1].map(|i| {
            let (old, new) = (sets[i].0.unwrap_or(&none), sets[i].1.unwrap_or(&none));
            matching_curves(old, new, &baked, ["strand", "guide"][i], &mut mismatches)
        });
        Error::if_any(mismatches.diagnostics)?;
        let files = manifest.frames.into_iter().map(|record| (record.frame, record.file)).collect();
        // This bake makes only its own strands, but all guides.
        let hair = sources(hair, header.hair.as_ref().unwrap_or(&none), true);
        let base = BaseCache { reader, files, baked, hair, guides: sources(guides, &header.guides, false) };
        Ok(base)
    }

    /// The base's manifest as an input of the bake: it determines every byte of the base.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn record(&self) -> Result<InputRecord> {
        let path = self.reader.dir().join(MANIFEST);
        let FileRecord { file, sha256, .. } = record_of(&path).map_err(|e| Error::io(&path, e))?;
        Ok(InputRecord { role: "base".into(), file, sha256 })
    }

    /// Indices of the curves that are baked anew.
    pub fn baked<'a>(&'a self, curves: &'a Curves) -> impl Iterator<Item = usize> + 'a {
        (0..curves.len()).filter(|&c| self.baked[curves.group[c] as usize])
    }

    /// Adds the curves of the base at the moments of one frame; `moments` holds the strands baked anew, and
    /// all guides.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Damaged`] if the base differs from its manifest; [`Error::BadInput`] if its
    /// head or a skin moves differently.
    pub fn complete(&self, moments: &mut [Frame], header: &Header) -> Result<()> {
        let Some(frame) = moments.first().map(|m| m.frame) else { return Ok(()) };
        let path = self.reader.dir().join(cache::frame_file_name(frame));
        let found = record_of(&path).map_err(|e| Error::io(&path, e))?;
        if self.files.get(&frame) != Some(&found) {
            let what = "its checksum differs from the manifest: bake the base again".into();
            return Err(Error::Damaged { path, what });
        }
        let old = self.reader.read_samples(frame, moments.iter().map(|m| m.offset))?;
        for (new, old) in moments.iter_mut().zip(old) {
            if !agree(new.head.concat(), old.head.concat()) {
                let what = format!("the head of the base has another pose at frame {frame}");
                return Err(mismatch(&path, "head", what, "the head track of this animation".into()).into());
            }
            if let Some(skin) = self.other_skin(header, new, &old) {
                let what =
                    format!("the skin \"{skin}\" of the base has another shape or place at frame {frame}");
                return Err(mismatch(&path, "skins", what, "the skins of this animation".into()).into());
            }
            if let (Some(hair), Some(set), Some(old)) = (&mut new.hair, &header.hair, &old.hair) {
                complete(&self.hair, hair, old, set);
            }
            if !header.guides.counts.is_empty() {
                complete(&self.guides, &mut new.guides, &old.guides, &header.guides);
            }
        }
        Ok(())
    }

    /// A skin whose vertices, at rest or at one moment, differ between the base, `old`, and the bake, `new`.
    fn other_skin<'a>(&self, header: &'a Header, new: &Frame, old: &Frame) -> Option<&'a str> {
        let known = self.reader.header();
        let wide = |points: &[[f32; 3]]| points.as_flattened().iter().map(|x| f64::from(*x)).collect();
        let same = |(i, skin): &(usize, &ColliderMesh)| {
            skins(known).any(|(j, other)| {
                let [here, there] = [&new.colliders[*i], &old.colliders[j]];
                let now = |frame: &ColliderFrame| frame.points.as_deref().map(wide).unwrap_or_default();
                other.name == skin.name
                    && agree(wide(&skin.points), wide(&other.points))
                    && agree(now(here), now(there))
                    && agree(here.transform.concat(), there.transform.concat())
            })
        };
        skins(header).find(|skin| !same(skin)).map(|(_, skin)| &*skin.name)
    }
}

/// The skins of a cache, with their indices among its colliders.
fn skins(header: &Header) -> impl Iterator<Item = (usize, &ColliderMesh)> {
    header.colliders.iter().enumerate().filter(|(_, collider)| collider.is_skin)
}

/// True if two lists of numbers differ by no more than [`REST_TOLERANCE`] of the largest.
fn agree(a: Vec<f64>, b: Vec<f64>) -> bool {
    let largest = a.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= REST_TOLERANCE * largest)
}

struct Mismatches {
    file: PathBuf,
    diagnostics: Vec<Diagnostic>,
}

impl Mismatches {
    fn unless_same<T: PartialEq + std::fmt::Display>(&mut self, key: &str, found: T, expected: T) {
        if found != expected {
            self.add(key, format!("the base has {found}"), format!("{expected}, as this bake"));
        }
    }

    fn add(&mut self, key: &str, what: String, allowed: String) {
        self.diagnostics.push(mismatch(&self.file, key, what, allowed));
    }
}

fn mismatch(file: &Path, key: &str, what: String, allowed: String) -> Diagnostic {
    let remedy = "give the base the same groom, head track, range and output settings, or bake all groups";
    Diagnostic::new(file, key, what, allowed, remedy)
}

/// For each curve of the new set, the curve of the old set to copy and its points there; `None` if it is
/// baked anew.
fn matching_curves(
    old: &CurveSet,
    new: &CurveSet,
    baked: &[bool],
    kind: &str,
    mismatches: &mut Mismatches,
) -> Vec<Option<(usize, Range<usize>)>> {
    let ranges: Vec<_> = old.ranges().collect();
    let by_id: HashMap<i32, usize> = old.id.iter().enumerate().map(|(c, id)| (*id, c)).collect();
    let size = new.rest.as_flattened().iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    let mut unmatched = Vec::new();
    let mut found = Vec::with_capacity(new.id.len());
    for (c, range) in new.ranges().enumerate() {
        if baked[new.group[c] as usize] {
            found.push(None);
            continue;
        }
        let same = |of: &usize| {
            let (old, new) = (&old.rest[ranges[*of].clone()], &new.rest[range.clone()]);
            let apart = |(a, b): (&[f32; 3], &[f32; 3])| (Vector3::from(*a) - Vector3::from(*b)).norm();
            old.len() == new.len()
                && old
                    .iter()
                    .zip(new)
                    .all(|points| f64::from(apart(points)) <= REST_TOLERANCE * f64::from(size))
        };
        match by_id.get(&new.id[c]).copied().filter(same) {
            Some(of) => found.push(Some((of, ranges[of].clone()))),
            None => unmatched.push(c),
        }
    }
    if let Some(first) = unmatched.first() {
        let (id, group) = (new.id[*first], &new.group_name[*first]);
        let others = unmatched.len() - 1;
        mismatches.add(
            &format!("{kind}s"),
            format!("the base lacks {kind} {id} of group {group:?}, or has it with another rest shape, and {others} more"),
            "all curves of the other groups, as in the groom".into(),
        );
    }
    found
}

/// The source of each curve of the set. `only_baked` says that the bake's arrays hold only the curves baked
/// anew.
fn sources(
    matching: Vec<Option<(usize, Range<usize>)>>,
    set: &CurveSet,
    only_baked: bool,
) -> Vec<CurveSource> {
    let (mut curves, mut points) = (0, 0);
    let sources = matching.into_iter().zip(&set.counts).map(|(base, count)| {
        let here = CurveSource { from_base: false, curve: curves, points: points..points + *count as usize };
        if base.is_none() || !only_baked {
            curves += 1;
            points = here.points.end;
        }
        base.map_or(here, |(curve, points)| CurveSource { from_base: true, curve, points })
    });
    sources.collect()
}

/// Merges the curves of the base with those baked anew.
fn complete(sources: &[CurveSource], baked: &mut CurveFrame, base: &CurveFrame, set: &CurveSet) {
    let of = |source: &CurveSource| if source.from_base { base } else { &*baked };
    let array = |of_frame: fn(&CurveFrame) -> Option<&Vec<[f32; 3]>>| -> Option<Vec<[f32; 3]>> {
        let part = |s: &CurveSource| Some(&of_frame(of(s))?[s.points.clone()]);
        Some(sources.iter().map(part).collect::<Option<Vec<_>>>()?.concat())
    };
    let points = array(|f| Some(&f.points)).unwrap_or_default();
    let velocities = array(|f| Some(&f.velocities)).unwrap_or_default();
    let accelerations = array(|f| f.accelerations.as_ref());
    let normals = array(|f| f.normals.as_ref());
    let level = |source: &CurveSource| of(source).level.as_ref().map(|level| level[source.curve]);
    let level = sources.iter().map(level).collect();
    let extent = extent(&points, &set.widths);
    // Steps and reactions are not written with a base.
    let none = CurveFrame::default();
    *baked = CurveFrame { extent, points, velocities, accelerations, level, normals, ..none };
}
