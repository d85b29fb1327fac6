//! An earlier cache of the same shot, from which a bake of some groups takes the curves of all others.

use super::output::extent;
use crate::cache::{self, CurveFrame, CurveSet, Frame, Header, InputRecord, MANIFEST, Reader};
use crate::error::{Diagnostic, Error, Result};
use crate::file::{FileRecord, record_of};
use crate::scene::{Anim, Curves, Groom};
use nalgebra::Vector3;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// How far a point at rest, and an entry of the head's matrix, may be from the base's, as a share of the largest: both are written rounded.
const SAME: f64 = 1e-6;

/// What is asked for: which groups to bake, over which cache.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Only {
    /// Names of the groups.
    pub groups: Vec<String>,
    /// Folder of the finished cache that has the others.
    pub base: PathBuf,
}

/// The base of a bake, seen to fit to it.
#[derive(Debug)]
pub struct Base {
    reader: Reader,
    /// What the base's manifest says of its frame files.
    files: BTreeMap<i32, FileRecord>,
    /// Which of the groom's groups are baked.
    baked: Vec<bool>,
    hair: Vec<Piece>,
    guides: Vec<Piece>,
}

/// Where a curve comes from.
#[derive(Debug)]
struct Piece {
    /// The base, or this bake.
    kept: bool,
    /// Which curve it is there, and which points are its own.
    curve: usize,
    points: Range<usize>,
}

impl Base {
    /// Opens the base of a bake of `groom` whose cache has this `header`.
    ///
    /// # Errors
    /// [`Error::Usage`] for groups that the groom does not have; [`Error::Io`] and [`Error::Damaged`] where the base cannot be read;
    /// [`Error::BadInput`] with all that does not fit.
    pub fn open(only: &Only, groom: &Groom, anim: &Anim, header: &Header) -> Result<Self> {
        let baked: Vec<bool> = groom.groups.iter().map(|g| only.groups.contains(&g.name)).collect();
        if let Some(name) = only.groups.iter().find(|name| !groom.groups.iter().any(|g| g.name == **name)) {
            let names: Vec<&str> = groom.groups.iter().map(|g| g.name.as_str()).collect();
            return Err(Error::Usage(format!(
                "the groom has no group {name:?}; it has {}",
                names.join(", ")
            )));
        }
        let reader = Reader::open(&only.base)?;
        let manifest = reader.read_manifest()?;
        let old = reader.header();
        let mut faults = Faults { file: only.base.join(MANIFEST), problems: Vec::new() };
        faults.unless_same("metres_per_unit", old.metres_per_unit, header.metres_per_unit);
        let axis = |header: &Header| if header.z_up { "Z" } else { "Y" };
        faults.unless_same("up_axis", axis(old), axis(header));
        faults.unless_same("fps", old.fps, header.fps);
        faults.unless_same("levels of wisps written", old.levels, header.levels);
        faults.unless_same("accelerations", old.accelerations, header.accelerations);
        for (key, value) in
            [("samples", f64::from(anim.settings.samples)), ("shutter", anim.settings.shutter)]
        {
            // One moment is the frame itself, however long the shutter.
            if key == "samples" || anim.settings.samples > 1 || header.accelerations {
                let found = manifest.settings[key].as_f64();
                faults.unless_same(key, found.unwrap_or(f64::NAN), value);
            }
        }
        let frames = header.frames.0 - 1..=header.frames.1 + 1;
        let missing = frames.clone().filter(|f| !manifest.frames.iter().any(|record| record.frame == *f));
        if let Some(first) = missing.clone().next() {
            let found = format!("the base lacks frame {first} and {} more", missing.count() - 1);
            faults.add("frames", found, format!("frames {} to {}", frames.start(), frames.end()));
        }
        let sets = [(old.hair.as_ref(), header.hair.as_ref()), (Some(&old.guides), Some(&header.guides))];
        let none = CurveSet::default();
        let [hair, guides] = [0, 1].map(|i| {
            let (old, new) = (sets[i].0.unwrap_or(&none), sets[i].1.unwrap_or(&none));
            pieces(old, new, &baked, ["strand", "guide"][i], &mut faults)
        });
        Error::if_any(faults.problems)?;
        let files = manifest.frames.into_iter().map(|record| (record.frame, record.file)).collect();
        // Strands are made for this bake alone, guides all.
        let hair = numbered(hair, header.hair.as_ref().unwrap_or(&none), true);
        let base = Base { reader, files, baked, hair, guides: numbered(guides, &header.guides, false) };
        Ok(base)
    }

    /// The base's manifest, as an input of the bake: every byte of the base follows from it.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn record(&self) -> Result<InputRecord> {
        let path = self.reader.dir().join(MANIFEST);
        let FileRecord { file, sha256, .. } = record_of(&path).map_err(|e| Error::io(&path, e))?;
        Ok(InputRecord { role: "base".into(), file, sha256 })
    }

    /// Which curves are baked, by index.
    pub fn baked<'a>(&'a self, curves: &'a Curves) -> impl Iterator<Item = usize> + 'a {
        (0..curves.len()).filter(|&c| self.baked[curves.group[c] as usize])
    }

    /// Puts the base's curves to those that were baked, at the moments of one frame, of which `moments` holds the strands that were baked and all
    /// guides.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Damaged`] where the base is not what its manifest says; [`Error::BadInput`] where its head is elsewhere.
    pub fn complete(&self, moments: &mut [Frame], header: &Header) -> Result<()> {
        let Some(frame) = moments.first().map(|m| m.frame) else { return Ok(()) };
        let path = self.reader.dir().join(cache::frame_file_name(frame));
        let found = record_of(&path).map_err(|e| Error::io(&path, e))?;
        if self.files.get(&frame) != Some(&found) {
            let what = "its checksum is not that of the manifest: bake the base again".into();
            return Err(Error::Damaged { path, what });
        }
        let old = self.reader.read_samples(frame, moments.iter().map(|m| m.offset))?;
        for (new, old) in moments.iter_mut().zip(old) {
            let largest = new.head.as_flattened().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let mut entries = new.head.as_flattened().iter().zip(old.head.as_flattened());
            if entries.any(|(a, b)| (a - b).abs() > SAME * largest) {
                let what = format!("at frame {frame} the head of the base is elsewhere");
                return Err(problem(&path, "head", what, "the head track of this animation".into()).into());
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
}

struct Faults {
    file: PathBuf,
    problems: Vec<Diagnostic>,
}

impl Faults {
    fn unless_same<T: PartialEq + std::fmt::Display>(&mut self, key: &str, found: T, expected: T) {
        if found != expected {
            self.add(key, format!("the base has {found}"), format!("{expected}, as this bake"));
        }
    }

    fn add(&mut self, key: &str, what: String, allowed: String) {
        self.problems.push(problem(&self.file, key, what, allowed));
    }
}

fn problem(file: &Path, key: &str, what: String, allowed: String) -> Diagnostic {
    let remedy = "give the base the same groom, head track, range and output settings, or bake all groups";
    Diagnostic::new(file, key, what, allowed, remedy)
}

/// For each curve of the new set, the curve of the old one that it is taken from and its points there; nothing where it is baked.
fn pieces(
    old: &CurveSet,
    new: &CurveSet,
    baked: &[bool],
    kind: &str,
    faults: &mut Faults,
) -> Vec<Option<(usize, Range<usize>)>> {
    let (ranges, own) = (ranges(old), ranges(new));
    let by_id: HashMap<i32, usize> = old.id.iter().enumerate().map(|(c, id)| (*id, c)).collect();
    let size = new.rest.as_flattened().iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    let mut strange = Vec::new();
    let mut found = Vec::with_capacity(new.id.len());
    for (c, range) in own.into_iter().enumerate() {
        if baked[new.group[c] as usize] {
            found.push(None);
            continue;
        }
        let same = |of: &usize| {
            let (old, new) = (&old.rest[ranges[*of].clone()], &new.rest[range.clone()]);
            let apart = |(a, b): (&[f32; 3], &[f32; 3])| (Vector3::from(*a) - Vector3::from(*b)).norm();
            old.len() == new.len()
                && old.iter().zip(new).all(|points| f64::from(apart(points)) <= SAME * f64::from(size))
        };
        match by_id.get(&new.id[c]).copied().filter(same) {
            Some(of) => found.push(Some((of, ranges[of].clone()))),
            None => strange.push(c),
        }
    }
    if let Some(first) = strange.first() {
        let (id, group) = (new.id[*first], &new.group_name[*first]);
        let others = strange.len() - 1;
        faults.add(
            &format!("{kind}s"),
            format!("the base lacks {kind} {id} of group {group:?}, or has it otherwise at rest, and {others} more"),
            "all curves of the groups that are kept, as the groom has them".into(),
        );
    }
    found
}

/// The pieces in the order of the set; of curves that are baked, `alone` tells whether they stand in arrays of their own.
fn numbered(pieces: Vec<Option<(usize, Range<usize>)>>, set: &CurveSet, alone: bool) -> Vec<Piece> {
    let (mut curves, mut points) = (0, 0);
    let pieces = pieces.into_iter().zip(&set.counts).map(|(kept, count)| {
        let here = Piece { kept: false, curve: curves, points: points..points + *count as usize };
        if kept.is_none() || !alone {
            curves += 1;
            points = here.points.end;
        }
        kept.map_or(here, |(curve, points)| Piece { kept: true, curve, points })
    });
    pieces.collect()
}

/// Range of points of each curve.
fn ranges(set: &CurveSet) -> Vec<Range<usize>> {
    let mut end = 0;
    let range = |count: &i32| {
        let start = end;
        end += *count as usize;
        start..end
    };
    set.counts.iter().map(range).collect()
}

/// Puts kept curves among those that were baked.
fn complete(pieces: &[Piece], baked: &mut CurveFrame, kept: &CurveFrame, set: &CurveSet) {
    let of = |piece: &Piece| if piece.kept { kept } else { &*baked };
    let array = |of_frame: fn(&CurveFrame) -> Option<&Vec<[f32; 3]>>| -> Option<Vec<[f32; 3]>> {
        let part = |p: &Piece| Some(&of_frame(of(p))?[p.points.clone()]);
        Some(pieces.iter().map(part).collect::<Option<Vec<_>>>()?.concat())
    };
    let points = array(|f| Some(&f.points)).unwrap_or_default();
    let velocities = array(|f| Some(&f.velocities)).unwrap_or_default();
    let accelerations = array(|f| f.accelerations.as_ref());
    let level = |piece: &Piece| of(piece).level.as_ref().map(|level| level[piece.curve]);
    let level = pieces.iter().map(level).collect();
    *baked = CurveFrame { extent: extent(&points, &set.widths), points, velocities, accelerations, level };
}
