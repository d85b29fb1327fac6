//! The layer model of both encodings: the content of one USD file, before composition.

use std::borrow::Cow;

/// Metadata fields of a layer, prim or attribute: name and value, in the order in which they are written.
pub type Metadata<'a> = Vec<(String, Value<'a>)>;

/// One USD layer.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Layer<'a> {
    /// Stage metadata, such as `upAxis`.
    pub metadata: Metadata<'a>,
    /// Asset paths of the sublayers, strongest first.
    pub sub_layers: Vec<String>,
    /// Root prims.
    pub prims: Vec<Prim<'a>>,
}

/// One prim spec.
#[derive(Debug, Clone, PartialEq)]
pub struct Prim<'a> {
    /// Relation of the prim to weaker layers.
    pub specifier: Specifier,
    /// Type name, such as `BasisCurves`; empty for none.
    pub type_name: String,
    /// Name; an identifier.
    pub name: String,
    /// Metadata fields, such as `kind`.
    pub metadata: Metadata<'a>,
    /// Attributes.
    pub attributes: Vec<Attribute<'a>>,
    /// Relationships.
    pub relationships: Vec<Relationship>,
    /// Child prims.
    pub children: Vec<Prim<'a>>,
}

/// Relation of a prim spec to weaker layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Specifier {
    /// Defines the prim.
    Def,
    /// Adds opinions to a prim that another layer defines.
    Over,
    /// Defines a class for inheritance.
    Class,
}

/// One attribute spec. Without default, samples and connections it only declares the attribute.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute<'a> {
    /// Name, including namespaces.
    pub name: String,
    /// Value type name, such as `point3f[]`. It includes the role; [`Value`] holds the numbers only.
    pub type_name: String,
    /// Whether the value is constant over time.
    pub uniform: bool,
    /// Metadata fields, such as `interpolation`.
    pub metadata: Metadata<'a>,
    /// Value in the absence of samples.
    pub default: Option<Value<'a>>,
    /// (time code, value), with increasing time codes.
    pub samples: Vec<(f64, Value<'a>)>,
    /// Sources of its value in a shading network: absolute paths such as
    /// `/groom/materials/hair/surface.outputs:surface`. Empty if this layer has no opinion.
    pub connections: Vec<String>,
}

/// One relationship spec: it targets other prims or properties.
#[derive(Debug, Clone, PartialEq)]
pub struct Relationship {
    /// Name, including namespaces.
    pub name: String,
    /// Absolute paths of the targets, which replace those of weaker layers, also with none; `None` only
    /// declares the relationship.
    pub targets: Option<Vec<String>>,
}

/// A value. Arrays may be borrowed, so that writing a frame copies no points.
#[derive(Debug, Clone, PartialEq)]
pub enum Value<'a> {
    /// `bool`
    Bool(bool),
    /// `int`
    Int(i32),
    /// `float`
    Float(f32),
    /// `double`
    Double(f64),
    /// `string`
    String(String),
    /// `token`
    Token(String),
    /// `asset`
    Asset(String),
    /// `matrix4d` in the row-vector convention of USD: translation in the last row
    Matrix4d([[f64; 4]; 4]),
    /// `int[]`
    Ints(Cow<'a, [i32]>),
    /// `float[]`
    Floats(Cow<'a, [f32]>),
    /// `float2[]` and its roles, such as `texCoord2f[]`
    Float2s(Cow<'a, [[f32; 2]]>),
    /// `float3[]` and its roles, such as `point3f[]`, `vector3f[]`, `color3f[]`
    Float3s(Cow<'a, [[f32; 3]]>),
    /// `string[]`
    Strings(Vec<String>),
    /// `token[]`
    Tokens(Vec<String>),
    /// `dictionary`, in metadata only
    Dictionary(Vec<(String, Value<'a>)>),
    /// Prepended items of a token list, in metadata only (`apiSchemas`)
    PrependedTokens(Vec<String>),
    /// Prepended reference to a layer and a prim of it, in metadata only (`references`)
    PrependedReference(String, String),
    /// No value, whatever weaker layers have
    Block,
}

impl<'a> Layer<'a> {
    /// The prim at an absolute path such as `/groom/hair`.
    pub fn prim_mut(&mut self, path: &str) -> Option<&mut Prim<'a>> {
        let mut names = path.strip_prefix('/')?.split('/');
        let first = names.next()?;
        let root = self.prims.iter_mut().find(|p| p.name == first)?;
        names.try_fold(root, |prim, name| prim.children.iter_mut().find(|c| c.name == name))
    }
}

impl<'a> Prim<'a> {
    /// An empty prim.
    pub fn new(specifier: Specifier, type_name: &str, name: &str) -> Self {
        Prim {
            specifier,
            type_name: type_name.into(),
            name: name.into(),
            metadata: Vec::new(),
            attributes: Vec::new(),
            relationships: Vec::new(),
            children: Vec::new(),
        }
    }

    /// The attribute `name`.
    pub fn attribute_mut(&mut self, name: &str) -> Option<&mut Attribute<'a>> {
        self.attributes.iter_mut().find(|a| a.name == name)
    }
}

impl<'a> Attribute<'a> {
    /// A declaration without value.
    pub fn new(name: &str, type_name: &str) -> Self {
        Attribute {
            name: name.into(),
            type_name: type_name.into(),
            uniform: false,
            metadata: Vec::new(),
            default: None,
            samples: Vec::new(),
            connections: Vec::new(),
        }
    }

    /// Sets the default.
    pub fn with_default(mut self, value: Value<'a>) -> Self {
        self.default = Some(value);
        self
    }

    /// Appends the sample `value` at time code `time`.
    pub fn with_sample(mut self, time: f64, value: Value<'a>) -> Self {
        self.samples.push((time, value));
        self
    }

    /// Adds a connection to the attribute at `path`.
    pub fn with_connection(mut self, path: &str) -> Self {
        self.connections.push(path.into());
        self
    }

    /// Adds a metadata field.
    pub fn with_metadata(mut self, name: &str, value: Value<'a>) -> Self {
        self.metadata.push((name.into(), value));
        self
    }

    /// Makes it constant over time.
    pub fn uniform(mut self) -> Self {
        self.uniform = true;
        self
    }
}

impl Value<'_> {
    /// A `token`.
    pub fn token(text: &str) -> Self {
        Value::Token(text.into())
    }

    /// A `string`.
    pub fn string(text: &str) -> Self {
        Value::String(text.into())
    }
}
