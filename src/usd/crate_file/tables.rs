//! Reading and validation of the tables of a crate file. Accessors check all indices.

use super::format::{BOOTSTRAP_LEN, FIELD_SET_END, Jump, MAGIC, SECTION_NAME_LEN, ValueRep};
use super::integers::{decompress, decompress_ints, max_coded_len};
use super::source::{Cursor, Decoded, Source};
use std::ops::RangeInclusive;

/// Minor versions (0.x) that are read: their layouts agree in what is read.
const READ_VERSIONS: RangeInclusive<u8> = 7..=13;
/// Largest depth of paths. It also bounds recursion over the tree.
const MAX_DEPTH: usize = 256;

/// All of a crate file but the values.
pub(super) struct Tables {
    tokens: Vec<String>,
    /// Token of each string.
    strings: Vec<u32>,
    /// Name token and value of each field.
    pub fields: Vec<(u32, ValueRep)>,
    field_sets: Vec<u32>,
    /// Paths in pre-order: parents before children.
    pub paths: Vec<PathEntry>,
    /// For each path index, its position in [`Self::paths`] if it has one.
    order: Vec<Option<usize>>,
}

/// One path and its spec.
pub(super) struct PathEntry {
    /// Index of the parent in [`Tables::paths`]; `None` for the root.
    pub parent: Option<usize>,
    /// Token of its last element.
    pub element: u32,
    /// Whether it is a property of its parent rather than a child prim.
    pub is_property: bool,
    /// Kind code and start of the field set of the spec, if there is one.
    pub spec: Option<(u32, u32)>,
}

impl Tables {
    pub fn read(source: &Source) -> Decoded<Self> {
        let sections = sections(source)?;
        let section = |name: &str| {
            let found = sections.iter().find(|(n, _)| n == name);
            found
                .ok_or_else(|| format!("there is no section {name}"))
                .and_then(|(_, offset)| source.at(*offset))
        };

        let tokens = tokens(&mut section("TOKENS")?, source)?;
        let mut at = section("STRINGS")?;
        let count = at.count()?;
        let strings: Vec<u32> = at.items(count, source)?;

        let mut at = section("FIELDS")?;
        let count = at.count()?;
        let names = indices(&mut at, count, source)?;
        let reps = decompress(at.sized()?, count.saturating_mul(8))?;
        source.charge(reps.len(), 2)?;
        let (reps, rest) = reps.as_chunks::<8>();
        if reps.len() != count || !rest.is_empty() {
            return Err(format!("there are {} values for {count} fields", reps.len()));
        }
        let fields = names.into_iter().zip(reps.iter().map(|r| ValueRep(u64::from_le_bytes(*r)))).collect();

        let mut at = section("FIELDSETS")?;
        let count = at.count()?;
        let field_sets = indices(&mut at, count, source)?;

        let (mut paths, order) = paths(&mut section("PATHS")?, source)?;
        specs(&mut section("SPECS")?, source, &mut paths, &order)?;
        Ok(Tables { tokens, strings, fields, field_sets, paths, order })
    }

    /// The token at `index`.
    pub fn token(&self, index: u64) -> Decoded<&str> {
        let token = usize::try_from(index).ok().and_then(|i| self.tokens.get(i));
        token.map(String::as_str).ok_or_else(|| format!("token index {index} of {}", self.tokens.len()))
    }

    /// The string at `index`.
    pub fn string(&self, index: u64) -> Decoded<&str> {
        let token = usize::try_from(index).ok().and_then(|i| self.strings.get(i));
        self.token((*token.ok_or_else(|| format!("string index {index} of {}", self.strings.len()))?).into())
    }

    /// The path at `index`, such as `/groom/hair.points`.
    pub fn path(&self, index: u32) -> Decoded<String> {
        let place = self.order.get(index as usize).copied().flatten();
        let mut entry = place.and_then(|place| self.paths.get(place));
        if entry.is_none() {
            return Err(format!("path index {index} of {}", self.order.len()));
        }
        let mut elements = Vec::new();
        while let Some(PathEntry { parent: Some(parent), element, is_property, .. }) = entry {
            elements.push([if *is_property { "." } else { "/" }, self.token((*element).into())?]);
            entry = self.paths.get(*parent);
        }
        Ok(elements.into_iter().rev().flatten().collect())
    }

    /// The fields of the set that starts at `start`.
    pub fn field_set(&self, start: u32) -> impl Iterator<Item = Decoded<(&str, ValueRep)>> {
        let set = self.field_sets.get(start as usize..).unwrap_or_default();
        set.iter().take_while(|&&index| index != FIELD_SET_END).map(|&index| {
            let field = self.fields.get(index as usize);
            let (name, rep) = field.ok_or_else(|| format!("field index {index} of {}", self.fields.len()))?;
            Ok((self.token((*name).into())?, *rep))
        })
    }
}

/// Names and offsets of the sections.
fn sections(source: &Source) -> Decoded<Vec<(String, u64)>> {
    let mut at = source.at(0)?;
    let bootstrap = at.bytes(BOOTSTRAP_LEN)?;
    if !bootstrap.starts_with(MAGIC) {
        return Err("this is not a crate file: its first bytes are wrong".into());
    }
    let [major, minor, patch] = [bootstrap[8], bootstrap[9], bootstrap[10]];
    if major != 0 || !READ_VERSIONS.contains(&minor) {
        return Err(format!("crate version {major}.{minor}.{patch} is not supported"));
    }
    let mut at = source.at(16)?;
    let mut at = source.at(at.value()?)?;
    let mut sections = Vec::new();
    for _ in 0..at.count()? {
        let name: [u8; SECTION_NAME_LEN] = at.value()?;
        let [start, _size]: [u64; 2] = at.value()?;
        sections.push((String::from_utf8_lossy(&name).trim_end_matches('\0').to_string(), start));
    }
    Ok(sections)
}

fn tokens(at: &mut Cursor, source: &Source) -> Decoded<Vec<String>> {
    let (count, len) = (at.count()?, at.count()?);
    source.charge(len, 2)?;
    source.charge(count, size_of::<String>())?;
    let text = decompress(at.sized()?, len)?;
    let text = String::from_utf8(text).map_err(|_| "tokens are not UTF-8")?;
    let tokens: Vec<String> = text.split_terminator('\0').map(String::from).collect();
    if tokens.len() == count {
        Ok(tokens)
    } else {
        Err(format!("there are {} tokens of {count}", tokens.len()))
    }
}

fn ints(at: &mut Cursor, count: usize, source: &Source) -> Decoded<Vec<i32>> {
    source.charge(max_coded_len(count), 2)?;
    decompress_ints(at.sized()?, count)
}

fn indices(at: &mut Cursor, count: usize, source: &Source) -> Decoded<Vec<u32>> {
    Ok(ints(at, count, source)?.into_iter().map(i32::cast_unsigned).collect())
}

/// The paths in pre-order, and the position of each path index in them.
fn paths(at: &mut Cursor, source: &Source) -> Decoded<(Vec<PathEntry>, Vec<Option<usize>>)> {
    let total = at.count()?;
    let count = at.count()?;
    let indices = indices(at, count, source)?;
    let elements = ints(at, count, source)?;
    let jumps = ints(at, count, source)?;
    if count > total {
        return Err(format!("the tree has {count} paths of {total}"));
    }
    source.charge(total, size_of::<Option<usize>>())?;
    source.charge(count, size_of::<PathEntry>())?;
    let mut order = vec![None; total];
    let mut paths = Vec::with_capacity(count);

    // Ancestors of the next entry, outermost first: the last is its parent. A node is removed after its
    // subtree. `waiting` holds the depths at which a sibling is still to come.
    let mut ancestors: Vec<usize> = Vec::new();
    let mut waiting: Vec<usize> = Vec::new();
    for (i, &jump) in jumps.iter().enumerate() {
        let place = order
            .get_mut(indices[i] as usize)
            .ok_or_else(|| format!("path index {} of {total}", indices[i]))?;
        *place = Some(i);
        paths.push(PathEntry {
            parent: ancestors.last().copied(),
            element: elements[i].unsigned_abs(),
            is_property: elements[i] < 0,
            spec: None,
        });
        match Jump::from_code(jump).ok_or_else(|| format!("unknown path jump {jump}"))? {
            Jump::Sibling => {}
            Jump::Child => ancestors.push(i),
            Jump::Both(_) => {
                waiting.push(ancestors.len());
                ancestors.push(i);
            }
            Jump::Leaf => match waiting.pop() {
                Some(depth) => ancestors.truncate(depth),
                None if i + 1 == count => {}
                None => return Err(format!("the path tree ends at entry {} of {count}", i + 1)),
            },
        }
        if ancestors.len() > MAX_DEPTH {
            return Err(format!("prims are nested deeper than {MAX_DEPTH}"));
        }
    }
    Ok((paths, order))
}

fn specs(at: &mut Cursor, source: &Source, paths: &mut [PathEntry], order: &[Option<usize>]) -> Decoded<()> {
    let count = at.count()?;
    let path_indices = indices(at, count, source)?;
    let sets = indices(at, count, source)?;
    let kinds = indices(at, count, source)?;
    for ((path, set), kind) in path_indices.into_iter().zip(sets).zip(kinds) {
        let place = order.get(path as usize).copied().flatten();
        paths[place.ok_or_else(|| format!("a spec refers to path index {path} of {}", order.len()))?].spec =
            Some((kind, set));
    }
    Ok(())
}
