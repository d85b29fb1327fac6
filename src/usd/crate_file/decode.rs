//! Reader of the subset of the format that the writer uses, also of files written by USD itself. It skips
//! values of types that [`Value`] does not have, specs of kinds that a [`Layer`] does not have, and other
//! list operations.
//!
//! A file may be damaged or hostile: every offset and count is checked, and memory is limited by a budget
//! that grows with the length of the file.

use super::format::{IDENTITY_OFFSET, LIST_OP_EXPLICIT, LIST_OP_PREPENDED, ValueRep, kind, spec};
use super::integers::{decompress_ints, max_coded_len};
use super::source::{Decoded, Source};
use super::tables::Tables;
use crate::usd::layer::{Attribute, Layer, Metadata, Prim, Relationship, Specifier, Value};
use crate::{Error, Result};
use bytemuck::Pod;
use std::borrow::Cow;
use std::path::Path;

/// Largest nesting depth of dictionaries.
const MAX_DICTIONARY_DEPTH: usize = 16;

/// Decodes the bytes of a crate file; `path` is for the message.
///
/// # Errors
/// [`Error::Damaged`] if the bytes are not a consistent crate file.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Layer<'static>> {
    let damaged = |what| Error::Damaged { path: path.to_path_buf(), what };
    let source = Source::new(bytes);
    let tables = Tables::read(&source).map_err(damaged)?;
    Decoder { source, tables }.layer().map_err(damaged)
}

struct Decoder<'b> {
    source: Source<'b>,
    tables: Tables,
}

/// Children of a prim or the root while its subtree is read, last first.
#[derive(Default)]
struct Subtree {
    attributes: Vec<Attribute<'static>>,
    relationships: Vec<Relationship>,
    children: Vec<Prim<'static>>,
}

impl Decoder<'_> {
    fn layer(&self) -> Decoded<Layer<'static>> {
        let paths = &self.tables.paths;
        self.source.charge(paths.len(), size_of::<Subtree>())?;
        let mut subtrees: Vec<Subtree> = paths.iter().map(|_| Subtree::default()).collect();
        // In reverse, children are complete before their parent.
        for (i, path) in paths.iter().enumerate().rev() {
            let (Some(parent), Some((kind, set))) = (path.parent, path.spec) else { continue };
            match kind {
                spec::ATTRIBUTE => {
                    self.source.charge(1, size_of::<Attribute>())?;
                    let attribute = self.attribute(path.element, set)?;
                    subtrees[parent].attributes.push(attribute);
                }
                spec::RELATIONSHIP => {
                    self.source.charge(1, size_of::<Relationship>())?;
                    let relationship = self.relationship(path.element, set)?;
                    subtrees[parent].relationships.push(relationship);
                }
                spec::PRIM => {
                    self.source.charge(1, size_of::<Prim>())?;
                    let subtree = std::mem::take(&mut subtrees[i]);
                    let prim = self.prim(path.element, set, subtree)?;
                    subtrees[parent].children.push(prim);
                }
                _ => {}
            }
        }
        match (paths.first().and_then(|p| p.spec), subtrees.into_iter().next()) {
            (Some((spec::PSEUDO_ROOT, set)), Some(subtree)) => self.root(set, subtree),
            _ => Err("there is no root".into()),
        }
    }

    /// The fields of a spec. Charged, because many specs of a damaged file may refer to one long set.
    fn fields(&self, set: u32) -> impl Iterator<Item = Decoded<(&str, ValueRep)>> {
        self.tables.field_set(set).map(|field| {
            self.source.charge(1, size_of::<(&str, ValueRep)>())?;
            field
        })
    }

    fn root(&self, set: u32, subtree: Subtree) -> Decoded<Layer<'static>> {
        let mut layer = Layer::default();
        for field in self.fields(set) {
            match field? {
                ("subLayers", rep) => layer.sub_layers = self.strings(rep)?,
                ("primChildren" | "subLayerOffsets", _) => {}
                (name, rep) => self.metadata(name, rep, &mut layer.metadata)?,
            }
        }
        layer.prims = subtree.children.into_iter().rev().collect();
        Ok(layer)
    }

    fn prim(&self, element: u32, set: u32, subtree: Subtree) -> Decoded<Prim<'static>> {
        let mut prim = Prim::new(Specifier::Over, "", &self.text(self.tables.token(element.into())?)?);
        for field in self.fields(set) {
            match field? {
                ("specifier", rep) if rep.kind() == kind::SPECIFIER => {
                    prim.specifier = match rep.payload() {
                        0 => Specifier::Def,
                        1 => Specifier::Over,
                        2 => Specifier::Class,
                        other => return Err(format!("unknown specifier {other}")),
                    }
                }
                ("typeName", rep) => prim.type_name = self.text(self.tables.token(rep.payload())?)?,
                ("properties" | "primChildren", _) => {}
                (name, rep) => self.metadata(name, rep, &mut prim.metadata)?,
            }
        }
        prim.attributes = subtree.attributes.into_iter().rev().collect();
        prim.relationships = subtree.relationships.into_iter().rev().collect();
        prim.children = subtree.children.into_iter().rev().collect();
        Ok(prim)
    }

    fn attribute(&self, element: u32, set: u32) -> Decoded<Attribute<'static>> {
        let mut attribute = Attribute::new(&self.text(self.tables.token(element.into())?)?, "");
        for field in self.fields(set) {
            match field? {
                ("typeName", rep) => attribute.type_name = self.text(self.tables.token(rep.payload())?)?,
                ("variability", rep) => attribute.uniform = rep.payload() == 1,
                ("custom", _) => {}
                ("default", rep) => attribute.default = self.value(rep, 0)?,
                ("timeSamples", rep) => attribute.samples = self.time_samples(rep)?,
                ("connectionPaths", rep) => attribute.connections = self.path_list(rep)?,
                (name, rep) => self.metadata(name, rep, &mut attribute.metadata)?,
            }
        }
        Ok(attribute)
    }

    fn relationship(&self, element: u32, set: u32) -> Decoded<Relationship> {
        let name = self.text(self.tables.token(element.into())?)?;
        let mut targets = None;
        for field in self.fields(set) {
            if let ("targetPaths", rep) = field? {
                targets = Some(self.path_list(rep)?);
            }
        }
        Ok(Relationship { name, targets })
    }

    fn metadata(&self, name: &str, rep: ValueRep, metadata: &mut Metadata<'static>) -> Decoded<()> {
        if let Some(value) = self.value(rep, 0)? {
            metadata.push((self.text(name)?, value));
        }
        Ok(())
    }

    /// A copy of a text of the tables. Charged, because a few bytes of a damaged file may refer to many.
    fn text(&self, text: &str) -> Decoded<String> {
        self.source.charge(1, size_of::<String>() + text.len())?;
        Ok(text.to_string())
    }

    /// The value; `None` for a type that [`Value`] does not have.
    fn value(&self, rep: ValueRep, depth: usize) -> Decoded<Option<Value<'static>>> {
        if rep.has(ValueRep::ARRAY) {
            return self.array(rep);
        }
        let payload = rep.payload();
        let low = payload as u32;
        let value = match (rep.kind(), rep.has(ValueRep::INLINED)) {
            (kind::BOOL, true) => Value::Bool(payload != 0),
            (kind::INT, true) => Value::Int(low.cast_signed()),
            (kind::FLOAT, true) => Value::Float(f32::from_bits(low)),
            (kind::DOUBLE, true) => Value::Double(f32::from_bits(low).into()),
            (kind::DOUBLE, false) => Value::Double(self.source.at(payload)?.value()?),
            (kind::STRING, true) => Value::String(self.text(self.tables.string(payload)?)?),
            (kind::TOKEN, true) => Value::Token(self.text(self.tables.token(payload)?)?),
            (kind::ASSET, true) => Value::Asset(self.text(self.tables.token(payload)?)?),
            (kind::MATRIX4D, true) => {
                // Diagonal matrices of small integers, such as the identity.
                let mut rows = [[0.0; 4]; 4];
                for (i, byte) in low.to_le_bytes().into_iter().enumerate() {
                    rows[i][i] = f64::from(byte.cast_signed());
                }
                Value::Matrix4d(rows)
            }
            (kind::MATRIX4D, false) => Value::Matrix4d(self.source.at(payload)?.value()?),
            (kind::DICTIONARY, true) => Value::Dictionary(Vec::new()),
            (kind::DICTIONARY, false) => Value::Dictionary(self.dictionary(payload, depth)?),
            (kind::VALUE_BLOCK, true) => Value::Block,
            (kind::TOKEN_LIST_OP, false) => return self.prepended_tokens(payload),
            (kind::REFERENCE_LIST_OP, false) => return self.prepended_reference(payload),
            _ => return Ok(None),
        };
        Ok(Some(value))
    }

    fn array(&self, rep: ValueRep) -> Decoded<Option<Value<'static>>> {
        let compressed = rep.has(ValueRep::COMPRESSED);
        Ok(Some(match rep.kind() {
            kind::INT if compressed => {
                let mut at = self.source.at(rep.payload())?;
                let count = at.count()?;
                self.source.charge(max_coded_len(count), 2)?;
                Value::Ints(Cow::Owned(decompress_ints(at.sized()?, count)?))
            }
            _ if compressed => return Err("compressed float arrays are not supported".into()),
            kind::INT => Value::Ints(self.items(rep)?.into()),
            kind::FLOAT => Value::Floats(self.items(rep)?.into()),
            kind::FLOAT2 => Value::Float2s(self.items(rep)?.into()),
            kind::FLOAT3 => Value::Float3s(self.items(rep)?.into()),
            kind::STRING => Value::Strings(self.strings(rep)?),
            kind::TOKEN => Value::Tokens(self.tokens(self.items(rep)?)?),
            _ => return Ok(None),
        }))
    }

    /// A count and that many items; offset 0 denotes none.
    fn items<T: Pod>(&self, rep: ValueRep) -> Decoded<Vec<T>> {
        if rep.payload() == 0 {
            return Ok(Vec::new());
        }
        let mut at = self.source.at(rep.payload())?;
        let count = at.count()?;
        at.items(count, &self.source)
    }

    fn tokens(&self, indices: Vec<u32>) -> Decoded<Vec<String>> {
        indices.into_iter().map(|index| self.text(self.tables.token(index.into())?)).collect()
    }

    fn strings(&self, rep: ValueRep) -> Decoded<Vec<String>> {
        let indices: Vec<u32> = self.items(rep)?;
        indices.into_iter().map(|index| self.text(self.tables.string(index.into())?)).collect()
    }

    fn prepended_tokens(&self, offset: u64) -> Decoded<Option<Value<'static>>> {
        let items = self.list_op(offset, LIST_OP_PREPENDED)?;
        items.map(|items| self.tokens(items).map(Value::PrependedTokens)).transpose()
    }

    /// The only item of a list of references, without offset and custom data.
    fn prepended_reference(&self, offset: u64) -> Decoded<Option<Value<'static>>> {
        let mut at = self.source.at(offset)?;
        if at.value::<u8>()? != LIST_OP_PREPENDED || at.count()? != 1 {
            return Ok(None);
        }
        let [asset, prim]: [u32; 2] = at.value()?;
        if at.value::<[f64; 2]>()? != IDENTITY_OFFSET || at.count()? != 0 {
            return Ok(None);
        }
        let asset = self.text(self.tables.string(asset.into())?)?;
        Ok(Some(Value::PrependedReference(asset, self.text(&self.tables.path(prim)?)?)))
    }

    /// The paths of an explicit list.
    fn path_list(&self, rep: ValueRep) -> Decoded<Vec<String>> {
        if rep.kind() != kind::PATH_LIST_OP || rep.has(ValueRep::INLINED | ValueRep::ARRAY) {
            return Err("a list of paths has the wrong type".into());
        }
        let paths = self.list_op(rep.payload(), LIST_OP_EXPLICIT)?.unwrap_or_default();
        paths.into_iter().map(|index| self.text(&self.tables.path(index)?)).collect()
    }

    /// The items (token or path indices) of a list operation if it has the given header.
    fn list_op(&self, offset: u64, header: u8) -> Decoded<Option<Vec<u32>>> {
        let mut at = self.source.at(offset)?;
        if at.value::<u8>()? != header {
            return Ok(None);
        }
        let count = at.count()?;
        at.items(count, &self.source).map(Some)
    }

    fn dictionary(&self, offset: u64, depth: usize) -> Decoded<Vec<(String, Value<'static>)>> {
        if depth >= MAX_DICTIONARY_DEPTH {
            return Err(format!("dictionaries are nested deeper than {MAX_DICTIONARY_DEPTH}"));
        }
        let mut at = self.source.at(offset)?;
        let mut entries = Vec::new();
        for _ in 0..at.count()? {
            let key: u32 = at.value()?;
            let key = self.text(self.tables.string(key.into())?)?;
            at.follow()?;
            let rep = ValueRep(at.value()?);
            self.source.charge(1, size_of::<Value>())?;
            if let Some(value) = self.value(rep, depth + 1)? {
                entries.push((key, value));
            }
        }
        Ok(entries)
    }

    fn time_samples(&self, rep: ValueRep) -> Decoded<Vec<(f64, Value<'static>)>> {
        if rep.kind() != kind::TIME_SAMPLES || rep.has(ValueRep::INLINED) {
            return Err("time samples have the wrong type".into());
        }
        let mut at = self.source.at(rep.payload())?;
        at.follow()?;
        let times = ValueRep(at.value()?);
        if times.kind() != kind::DOUBLE_VECTOR || times.has(ValueRep::INLINED) {
            return Err("sample times have the wrong type".into());
        }
        let times: Vec<f64> = self.items(times)?;
        at.follow()?;
        let count = at.count()?;
        let reps: Vec<u64> = at.items(count, &self.source)?;
        if times.len() != reps.len() {
            return Err(format!("there are {} times for {} samples", times.len(), reps.len()));
        }
        let mut samples = Vec::new();
        for (time, rep) in times.into_iter().zip(reps) {
            self.source.charge(1, size_of::<Value>())?;
            if let Some(value) = self.value(ValueRep(rep), 0)? {
                samples.push((time, value));
            }
        }
        Ok(samples)
    }
}
