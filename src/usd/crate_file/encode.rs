//! Writer: one pass over a [`Layer`]; values first, then the tables.

use super::format::{
    BOOTSTRAP_LEN, FIELD_SET_END, IDENTITY_OFFSET, Jump, LIST_OP_EXPLICIT, LIST_OP_PREPENDED, MAGIC,
    MIN_COMPRESSED_INTS, SECTION_NAME_LEN, VERSION, ValueRep, kind, spec,
};
use super::integers::compress;
use super::output::Output;
use crate::usd::layer::{Attribute, Layer, Prim, Relationship, Specifier, Value};
use std::borrow::Cow;
use std::collections::HashMap;

/// The bytes of the crate file as consecutive parts, large arrays borrowed from the layer. Equal layers give
/// equal bytes. Text is truncated at a NUL, which the format cannot represent.
pub fn encode<'a>(layer: &'a Layer<'_>) -> Vec<Cow<'a, [u8]>> {
    let mut encoder = Encoder::new();
    // The name of `/` is the empty token. It comes first because properties are stored with negated token
    // indices: index 0 must not name a property.
    let root = encoder.tokens.index("");
    encoder.paths.push(Path { element: root as i32, children: Vec::new() });
    encoder.add_paths(0, &layer.prims);
    encoder.pseudo_root(layer);
    encoder.finish()
}

/// Name and writer of a section.
type Section<'a> = (&'static str, fn(&mut Encoder<'a>));

struct Encoder<'a> {
    out: Output<'a>,
    tokens: Tokens,
    strings: Vec<u32>,
    string_index: HashMap<u32, u32>,
    fields: Vec<(u32, ValueRep)>,
    field_index: HashMap<(u32, ValueRep), u32>,
    field_sets: Vec<u32>,
    field_set_index: HashMap<Vec<u32>, u32>,
    /// The root, all paths with specs, in the order of the specs, and paths that are only targets.
    paths: Vec<Path>,
    /// Index of a path, by its parent and element.
    path_index: HashMap<(u32, i32), u32>,
    /// Field set and kind of the spec at each of the leading paths.
    specs: Vec<(u32, u32)>,
}

/// A node of the path tree.
struct Path {
    /// Token of its last element, negated for a property.
    element: i32,
    /// Indices of its child paths.
    children: Vec<u32>,
}

/// Interned tokens.
#[derive(Default)]
struct Tokens {
    /// All tokens so far, each terminated by a NUL.
    text: Vec<u8>,
    indices: HashMap<String, u32>,
}

impl Tokens {
    fn index(&mut self, token: &str) -> u32 {
        let token = token.split('\0').next().unwrap_or_default();
        if let Some(&index) = self.indices.get(token) {
            return index;
        }
        let index = self.indices.len() as u32;
        self.text.extend_from_slice(token.as_bytes());
        self.text.push(0);
        self.indices.insert(token.to_string(), index);
        index
    }
}

impl<'a> Encoder<'a> {
    fn new() -> Self {
        Encoder {
            out: Output::new(),
            tokens: Tokens::default(),
            strings: Vec::new(),
            string_index: HashMap::new(),
            fields: Vec::new(),
            field_index: HashMap::new(),
            field_sets: Vec::new(),
            field_set_index: HashMap::new(),
            paths: Vec::new(),
            path_index: HashMap::new(),
            specs: Vec::new(),
        }
    }

    fn pseudo_root(&mut self, layer: &'a Layer<'_>) {
        let mut fields = self.metadata(&layer.metadata);
        if !layer.sub_layers.is_empty() {
            let rep = self.string_vector(&layer.sub_layers);
            fields.push(self.field("subLayers", rep));
            let rep = self.identity_offsets(layer.sub_layers.len());
            fields.push(self.field("subLayerOffsets", rep));
        }
        self.name_list("primChildren", layer.prims.iter().map(|p| p.name.as_str()), &mut fields);
        self.spec(fields, spec::PSEUDO_ROOT);
        layer.prims.iter().for_each(|prim| self.prim(prim));
    }

    fn prim(&mut self, prim: &'a Prim<'_>) {
        let specifier = match prim.specifier {
            Specifier::Def => 0,
            Specifier::Over => 1,
            Specifier::Class => 2,
        };
        let mut fields = vec![self.field("specifier", ValueRep::inlined(kind::SPECIFIER, specifier))];
        if !prim.type_name.is_empty() {
            fields.push(self.token_field("typeName", &prim.type_name));
        }
        fields.extend(self.metadata(&prim.metadata));
        self.name_list("properties", property_names(prim), &mut fields);
        self.name_list("primChildren", prim.children.iter().map(|c| c.name.as_str()), &mut fields);
        self.spec(fields, spec::PRIM);
        prim.attributes.iter().for_each(|attribute| self.attribute(attribute));
        prim.relationships.iter().for_each(|relationship| self.relationship(relationship));
        prim.children.iter().for_each(|child| self.prim(child));
    }

    fn attribute(&mut self, attribute: &'a Attribute<'_>) {
        let mut fields = vec![
            self.field("custom", ValueRep::inlined(kind::BOOL, 0)),
            self.token_field("typeName", &attribute.type_name),
            self.field("variability", ValueRep::inlined(kind::VARIABILITY, attribute.uniform.into())),
        ];
        fields.extend(self.metadata(&attribute.metadata));
        if let Some(value) = &attribute.default {
            let rep = self.value(value);
            fields.push(self.field("default", rep));
        }
        if !attribute.samples.is_empty() {
            let rep = self.time_samples(&attribute.samples);
            fields.push(self.field("timeSamples", rep));
        }
        if !attribute.connections.is_empty() {
            self.path_list("connectionPaths", &attribute.connections, &mut fields);
        }
        self.spec(fields, spec::ATTRIBUTE);
    }

    fn relationship(&mut self, relationship: &Relationship) {
        let mut fields = vec![
            self.field("custom", ValueRep::inlined(kind::BOOL, 0)),
            self.field("variability", ValueRep::inlined(kind::VARIABILITY, 1)),
        ];
        if let Some(targets) = &relationship.targets {
            self.path_list("targetPaths", targets, &mut fields);
        }
        self.spec(fields, spec::RELATIONSHIP);
    }

    /// Adds the paths of all specs below `parent`, in the order in which the specs are written.
    fn add_paths(&mut self, parent: u32, prims: &[Prim]) {
        for prim in prims {
            let element = self.tokens.index(&prim.name) as i32;
            let path = self.add_path(parent, element);
            for name in property_names(prim) {
                let element = -(self.tokens.index(name) as i32);
                self.add_path(path, element);
            }
            self.add_paths(path, &prim.children);
        }
    }

    fn add_path(&mut self, parent: u32, element: i32) -> u32 {
        let path = self.paths.len() as u32;
        self.paths.push(Path { element, children: Vec::new() });
        self.paths[parent as usize].children.push(path);
        self.path_index.entry((parent, element)).or_insert(path);
        path
    }

    /// Index of an absolute path, added if new.
    fn path(&mut self, path: &str) -> u32 {
        let (prim, property) = path.split_once('.').map_or((path, None), |(prim, name)| (prim, Some(name)));
        let names = prim.split('/').filter(|name| !name.is_empty());
        let elements = names.map(|name| (name, 1)).chain(property.map(|name| (name, -1)));
        elements.fold(0, |parent, (name, sign)| {
            let element = sign * self.tokens.index(name) as i32;
            let known = self.path_index.get(&(parent, element)).copied();
            known.unwrap_or_else(|| self.add_path(parent, element))
        })
    }

    /// Appends the field of target paths, if there are any.
    fn path_list(&mut self, field: &str, paths: &[String], fields: &mut Vec<u32>) {
        let paths: Vec<u32> = paths.iter().map(|path| self.path(path)).collect();
        let rep = self.list_op(kind::PATH_LIST_OP, LIST_OP_EXPLICIT, &paths);
        fields.push(self.field(field, rep));
    }

    /// Adds the spec of the next path.
    fn spec(&mut self, mut fields: Vec<u32>, kind: u32) {
        fields.push(FIELD_SET_END);
        let start = self.field_sets.len() as u32;
        let set = *self.field_set_index.entry(fields).or_insert_with_key(|fields| {
            self.field_sets.extend_from_slice(fields);
            start
        });
        self.specs.push((set, kind));
    }

    fn metadata(&mut self, metadata: &'a [(String, Value<'_>)]) -> Vec<u32> {
        let mut fields = Vec::with_capacity(metadata.len());
        for (name, value) in metadata {
            let rep = self.value(value);
            fields.push(self.field(name, rep));
        }
        fields
    }

    fn name_list<'n>(&mut self, field: &str, names: impl Iterator<Item = &'n str>, fields: &mut Vec<u32>) {
        let tokens: Vec<u32> = names.map(|name| self.tokens.index(name)).collect();
        if !tokens.is_empty() {
            let rep = ValueRep::at(kind::TOKEN_VECTOR, self.out.counted(&tokens));
            fields.push(self.field(field, rep));
        }
    }

    fn token_field(&mut self, name: &str, token: &str) -> u32 {
        let rep = ValueRep::inlined(kind::TOKEN, self.tokens.index(token));
        self.field(name, rep)
    }

    fn field(&mut self, name: &str, rep: ValueRep) -> u32 {
        let field = (self.tokens.index(name), rep);
        *self.field_index.entry(field).or_insert_with(|| {
            self.fields.push(field);
            self.fields.len() as u32 - 1
        })
    }

    fn string(&mut self, text: &str) -> u32 {
        let token = self.tokens.index(text);
        *self.string_index.entry(token).or_insert_with(|| {
            self.strings.push(token);
            self.strings.len() as u32 - 1
        })
    }

    fn value(&mut self, value: &'a Value<'_>) -> ValueRep {
        match value {
            Value::Bool(b) => ValueRep::inlined(kind::BOOL, (*b).into()),
            Value::Int(i) => ValueRep::inlined(kind::INT, i.cast_unsigned()),
            Value::Float(f) => ValueRep::inlined(kind::FLOAT, f.to_bits()),
            Value::Double(d) if f64::from(*d as f32) == *d => {
                ValueRep::inlined(kind::DOUBLE, (*d as f32).to_bits())
            }
            Value::Double(d) => {
                let offset = self.out.align();
                self.out.put(*d);
                ValueRep::at(kind::DOUBLE, offset)
            }
            Value::Block => ValueRep::inlined(kind::VALUE_BLOCK, 0),
            Value::String(text) => ValueRep::inlined(kind::STRING, self.string(text)),
            Value::Token(text) => ValueRep::inlined(kind::TOKEN, self.tokens.index(text)),
            Value::Asset(text) => ValueRep::inlined(kind::ASSET, self.tokens.index(text)),
            Value::Matrix4d(rows) => {
                let offset = self.out.align();
                self.out.put(*rows);
                ValueRep::at(kind::MATRIX4D, offset)
            }
            Value::Ints(ints) if ints.len() >= MIN_COMPRESSED_INTS => {
                let offset = self.out.align();
                self.out.put(ints.len() as u64);
                self.out.put_compressed_ints(ints.iter().copied());
                ValueRep(ValueRep::array(kind::INT, offset).0 | ValueRep::COMPRESSED)
            }
            Value::Ints(ints) => self.out.array(kind::INT, ints),
            Value::Floats(floats) => self.out.array(kind::FLOAT, floats),
            Value::Float2s(floats) => self.out.array(kind::FLOAT2, floats),
            Value::Float3s(floats) => self.out.array(kind::FLOAT3, floats),
            Value::Strings(texts) if texts.is_empty() => ValueRep::array(kind::STRING, 0),
            Value::Strings(texts) => {
                let strings = self.string_indices(texts);
                ValueRep::array(kind::STRING, self.out.counted(&strings))
            }
            Value::Tokens(texts) if texts.is_empty() => ValueRep::array(kind::TOKEN, 0),
            Value::Tokens(texts) => {
                let tokens = self.token_indices(texts);
                ValueRep::array(kind::TOKEN, self.out.counted(&tokens))
            }
            Value::Dictionary(entries) => self.dictionary(entries),
            Value::PrependedTokens(texts) => {
                let tokens = self.token_indices(texts);
                self.list_op(kind::TOKEN_LIST_OP, LIST_OP_PREPENDED, &tokens)
            }
            Value::PrependedReference(asset, prim) => {
                let (asset, prim) = (self.string(asset), self.path(prim));
                let offset = self.out.align();
                self.out.put(LIST_OP_PREPENDED);
                self.out.put(1u64);
                self.out.put([asset, prim]);
                self.out.put(IDENTITY_OFFSET);
                // No custom data.
                self.out.put(0u64);
                ValueRep::at(kind::REFERENCE_LIST_OP, offset)
            }
        }
    }

    /// Writes a list operation with one list of items: token or path indices.
    fn list_op(&mut self, kind: u8, header: u8, items: &[u32]) -> ValueRep {
        let offset = self.out.align();
        self.out.put(header);
        self.out.put(items.len() as u64);
        self.out.put_slice(items);
        ValueRep::at(kind, offset)
    }

    fn token_indices(&mut self, texts: &[String]) -> Vec<u32> {
        texts.iter().map(|text| self.tokens.index(text)).collect()
    }

    fn dictionary(&mut self, entries: &'a [(String, Value<'_>)]) -> ValueRep {
        if entries.is_empty() {
            return ValueRep::inlined(kind::DICTIONARY, 0);
        }
        let entries: Vec<_> =
            entries.iter().map(|(key, value)| (self.string(key), self.value(value))).collect();
        let offset = self.out.align();
        self.out.put(entries.len() as u64);
        for (key, rep) in entries {
            self.out.put(key);
            self.out.put_rep_distance();
            self.out.put(rep.0);
        }
        ValueRep::at(kind::DICTIONARY, offset)
    }

    fn time_samples(&mut self, samples: &'a [(f64, Value<'_>)]) -> ValueRep {
        let times: Vec<f64> = samples.iter().map(|(time, _)| *time).collect();
        let times = ValueRep::at(kind::DOUBLE_VECTOR, self.out.counted(&times));
        let reps: Vec<u64> = samples.iter().map(|(_, value)| self.value(value).0).collect();
        let offset = self.out.align();
        self.out.put_rep_distance();
        self.out.put(times.0);
        self.out.put_rep_distance();
        self.out.put(reps.len() as u64);
        self.out.put_slice(&reps);
        ValueRep::at(kind::TIME_SAMPLES, offset)
    }

    fn string_indices(&mut self, texts: &[String]) -> Vec<u32> {
        texts.iter().map(|text| self.string(text)).collect()
    }

    fn string_vector(&mut self, texts: &[String]) -> ValueRep {
        let strings = self.string_indices(texts);
        ValueRep::at(kind::STRING_VECTOR, self.out.counted(&strings))
    }

    /// Writes identity sublayer offsets.
    fn identity_offsets(&mut self, count: usize) -> ValueRep {
        ValueRep::at(kind::LAYER_OFFSET_VECTOR, self.out.counted(&vec![IDENTITY_OFFSET; count]))
    }

    fn finish(mut self) -> Vec<Cow<'a, [u8]>> {
        let writers: [Section<'a>; 6] = [
            ("TOKENS", Self::tokens_section),
            ("STRINGS", Self::strings_section),
            ("FIELDS", Self::fields_section),
            ("FIELDSETS", Self::field_sets_section),
            ("PATHS", Self::paths_section),
            ("SPECS", Self::specs_section),
        ];
        let sections = writers.map(|(name, write)| {
            let start = self.out.position() as u64;
            write(&mut self);
            (name, start, self.out.position() as u64 - start)
        });
        let contents = self.out.position() as u64;
        self.out.put(sections.len() as u64);
        for (name, start, size) in sections {
            let mut padded = [0; SECTION_NAME_LEN];
            padded[..name.len()].copy_from_slice(name.as_bytes());
            self.out.put(padded);
            self.out.put([start, size]);
        }
        let mut bootstrap = vec![0; BOOTSTRAP_LEN];
        bootstrap[..8].copy_from_slice(MAGIC);
        bootstrap[8..11].copy_from_slice(&VERSION);
        bootstrap[16..24].copy_from_slice(&contents.to_le_bytes());
        self.out.finish(bootstrap)
    }

    fn tokens_section(&mut self) {
        let Encoder { out, tokens, .. } = self;
        out.put([tokens.indices.len() as u64, tokens.text.len() as u64]);
        out.put_sized(&compress(&tokens.text));
    }

    fn strings_section(&mut self) {
        self.out.put(self.strings.len() as u64);
        self.out.put_slice(&self.strings);
    }

    fn fields_section(&mut self) {
        let Encoder { out, fields, .. } = self;
        out.put(fields.len() as u64);
        out.put_compressed_ints(fields.iter().map(|(token, _)| token.cast_signed()));
        let reps: Vec<u64> = fields.iter().map(|(_, rep)| rep.0).collect();
        out.put_sized(&compress(bytemuck::cast_slice(&reps)));
    }

    fn field_sets_section(&mut self) {
        let Encoder { out, field_sets, .. } = self;
        out.put(field_sets.len() as u64);
        out.put_compressed_ints(field_sets.iter().map(|field| field.cast_signed()));
    }

    fn paths_section(&mut self) {
        let mut table = Vec::with_capacity(self.paths.len());
        self.pre_order(0, false, &mut table);
        // Number of paths, and number of them in the tree: all.
        self.out.put([table.len() as u64; 2]);
        for column in 0..3 {
            self.out.put_compressed_ints(table.iter().map(|row: &[i32; 3]| row[column]));
        }
    }

    /// Appends index, element and jump of a path and of all its descendants.
    fn pre_order(&self, path: u32, has_sibling: bool, table: &mut Vec<[i32; 3]>) {
        let Path { element, children } = &self.paths[path as usize];
        let place = table.len();
        table.push([path as i32, *element, 0]);
        for (i, child) in children.iter().enumerate() {
            self.pre_order(*child, i + 1 < children.len(), table);
        }
        let jump = match (children.is_empty(), has_sibling) {
            (true, false) => Jump::Leaf,
            (true, true) => Jump::Sibling,
            (false, false) => Jump::Child,
            (false, true) => Jump::Both((table.len() - place) as i32),
        };
        table[place][2] = jump.code();
    }

    fn specs_section(&mut self) {
        let Encoder { out, specs, .. } = self;
        out.put(specs.len() as u64);
        out.put_compressed_ints(0..specs.len() as i32);
        out.put_compressed_ints(specs.iter().map(|(set, _)| set.cast_signed()));
        out.put_compressed_ints(specs.iter().map(|(_, kind)| kind.cast_signed()));
    }
}

/// Names of attributes and relationships in the order in which their specs are written.
fn property_names<'n>(prim: &'n Prim) -> impl Iterator<Item = &'n str> {
    let relationships = prim.relationships.iter().map(|relationship| relationship.name.as_str());
    prim.attributes.iter().map(|attribute| attribute.name.as_str()).chain(relationships)
}
