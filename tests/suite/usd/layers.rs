//! Single layers of every type and many sizes, in both encodings.

use super::python;
use hairbake::Error;
use hairbake::usd::{Attribute, Layer, Prim, Relationship, Specifier, Value, crate_file, text};
use proptest::prelude::*;
use serde_json::{Map, json};
use std::path::Path;

fn crate_bytes(layer: &Layer) -> Vec<u8> {
    crate_file::encode(layer).concat()
}

fn decode(bytes: &[u8]) -> hairbake::Result<Layer<'static>> {
    crate_file::decode(Path::new("test.usdc"), bytes)
}

/// Integers for all branches of the coding: constant, evenly spaced, and differences of 8, 16, 32 bits.
fn int_patterns(count: usize) -> Vec<(&'static str, Vec<i32>)> {
    // Knuth's multiplicative hash.
    let mixed = |i: i32| i.wrapping_add(1).wrapping_mul(-1_640_531_535);
    let make = |f: &dyn Fn(i32) -> i32| (0..count as i32).map(f).collect();
    vec![
        ("constant", make(&|_| -7)),
        ("sorted", make(&|i| 3 * i - 20)),
        ("small_steps", make(&|i| mixed(i) >> 26)),
        ("medium_steps", make(&|i| mixed(i) >> 18)),
        ("random", make(&mixed)),
        ("extremes", make(&|i| if i % 2 == 0 { i32::MIN } else { i32::MAX })),
    ]
}

fn floats(count: usize) -> Vec<f32> {
    let special = [0.0, -0.0, 1.0, 1.0 / 3.0, -1e-30, f32::MAX, f32::MIN_POSITIVE, f32::from_bits(1), 1e7];
    (0..count).map(|i| special.get(i).copied().unwrap_or(i as f32 * 0.37)).collect()
}

/// One attribute for each array type with `count` elements.
fn array_layer(count: usize) -> Layer<'static> {
    let mut prim = Prim::new(Specifier::Def, "", "arrays");
    for (name, ints) in int_patterns(count) {
        prim.attributes.push(Attribute::new(name, "int[]").with_default(Value::Ints(ints.into())));
    }
    let flat = floats(3 * count);
    let pairs = flat.as_chunks::<2>().0[..count].to_vec();
    let triples = flat.as_chunks::<3>().0.to_vec();
    let texts = |word: &str| (0..count).map(|i| format!("{word}{}", i % 5)).collect();
    for (name, type_name, value) in [
        ("floats", "float[]", Value::Floats(flat[..count].to_vec().into())),
        ("uvs", "texCoord2f[]", Value::Float2s(pairs.into())),
        ("points", "point3f[]", Value::Float3s(triples.clone().into())),
        ("velocities", "vector3f[]", Value::Float3s(triples.clone().into())),
        ("normals", "normal3f[]", Value::Float3s(triples.clone().into())),
        ("colours", "color3f[]", Value::Float3s(triples.into())),
        ("strings", "string[]", Value::Strings(texts("a \"string\" "))),
        ("tokens", "token[]", Value::Tokens(texts("token"))),
    ] {
        prim.attributes.push(Attribute::new(name, type_name).with_default(value));
    }
    Layer { prims: vec![prim], ..Layer::default() }
}

/// All features but large arrays.
fn varied_layer() -> Layer<'static> {
    let identity: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j)));
    let matrix: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| (i * 4 + j) as f64 / 3.0));
    let odd_text = "a \"quoted\" \\ word,\nanother line, a\ttab, µm and 毛";
    let dictionary = Value::Dictionary(vec![
        ("an asset".into(), Value::Asset("./other.usda".into())),
        ("bool".into(), Value::Bool(true)),
        ("double".into(), Value::Double(0.1)),
        ("floats".into(), Value::Floats(floats(5).into())),
        (
            "inside".into(),
            Value::Dictionary(vec![("ints".into(), Value::Ints((0..20).collect::<Vec<_>>().into()))]),
        ),
        ("text".into(), Value::string(odd_text)),
    ]);

    let mut scalars = Prim::new(Specifier::Def, "Scope", "scalars");
    scalars.metadata = vec![
        ("apiSchemas".into(), Value::PrependedTokens(vec!["MotionAPI".into(), "GeomModelAPI".into()])),
        ("assetInfo".into(), dictionary.clone()),
        ("comment".into(), Value::string("a comment")),
        ("documentation".into(), Value::string(odd_text)),
        ("kind".into(), Value::token("component")),
    ];
    for (name, type_name, value) in [
        ("yes", "bool", Value::Bool(true)),
        ("no", "bool", Value::Bool(false)),
        ("int", "int", Value::Int(i32::MIN)),
        ("float", "float", Value::Float(-1.0 / 3.0)),
        ("infinite", "float", Value::Float(f32::NEG_INFINITY)),
        ("short_double", "double", Value::Double(-0.5)),
        ("long_double", "double", Value::Double(std::f64::consts::PI)),
        ("text", "string", Value::string(odd_text)),
        ("no_text", "string", Value::string("")),
        ("token", "token", Value::token("a token")),
        ("asset", "asset", Value::Asset("./maps/root.png".into())),
        ("identity", "matrix4d", Value::Matrix4d(identity)),
        ("matrix", "matrix4d", Value::Matrix4d(matrix)),
    ] {
        scalars.attributes.push(Attribute::new(name, type_name).with_default(value));
    }
    scalars.attributes.push(
        Attribute::new("primvars:a:long:name", "int[]")
            .uniform()
            .with_default(Value::Ints(vec![1].into()))
            .with_metadata("elementSize", Value::Int(1))
            .with_metadata("interpolation", Value::token("uniform")),
    );

    let mut moving = Prim::new(Specifier::Over, "", "moving");
    moving.metadata = vec![(
        "references".into(),
        Value::PrependedReference("./other.usda".into(), "/elsewhere/deep".into()),
    )];
    let points = |time: f32| Value::Float3s(vec![[time, 1.0, 2.0]; 500].into());
    moving.attributes = vec![
        Attribute::new("declared", "point3f[]"),
        Attribute::new("declared:with_metadata", "float")
            .with_metadata("documentation", Value::string("why")),
        Attribute::new("points", "point3f[]").with_sample(-1.5, points(0.0)).with_sample(1001.0, points(1.0)),
        Attribute::new("blocked", "vector3f[]").with_default(Value::Block),
        Attribute::new("both", "matrix4d")
            .with_default(Value::Matrix4d(identity))
            .with_sample(0.1, Value::Matrix4d(matrix))
            .with_metadata("comment", Value::string("default and samples")),
        Attribute::new("samples_and_metadata", "double")
            .with_sample(1.0, Value::Double(1e300))
            .with_metadata("comment", Value::string("samples only")),
    ];

    // Targets inside and outside of this layer, before and after the prim, prims and properties.
    let relationship = |name: &str, targets: &[&str]| Relationship {
        name: name.into(),
        targets: Some(targets.iter().map(|target| target.to_string()).collect()),
    };
    let mut pointing = Prim::new(Specifier::Def, "Scope", "pointing");
    pointing.attributes = vec![
        Attribute::new("inputs:connected", "color3f").with_connection("/elsewhere/deep/shader.outputs:rgb"),
        Attribute::new("inputs:twice", "float3[]")
            .with_default(points(0.5))
            .with_sample(2.0, points(1.0))
            .with_connection("/pointing/inside.outputs:a")
            .with_connection("/scalars.infinite")
            .with_metadata("comment", Value::string("default, samples and connections")),
    ];
    pointing.relationships = vec![
        Relationship { name: "declared".into(), targets: None },
        relationship("without", &[]),
        relationship("material:binding", &["/pointing/inside"]),
        relationship(
            "several",
            &["/_class_last", "/moving.points", "/elsewhere", "/pointing.several", "/pointing/late"],
        ),
    ];
    pointing.children = vec![Prim {
        attributes: vec![Attribute::new("outputs:a", "float3")],
        ..Prim::new(Specifier::Def, "Scope", "inside")
    }];

    // A branch after a deep one, so that a jump skips a subtree.
    let deep = (0..40).rev().fold(Prim::new(Specifier::Class, "Xform", "end"), |child, i| {
        let mut prim = Prim::new(Specifier::Def, "Xform", &format!("level{i}"));
        prim.children = vec![child, Prim::new(Specifier::Over, "", "sibling")];
        prim
    });
    Layer {
        metadata: vec![
            ("customLayerData".into(), dictionary),
            ("documentation".into(), Value::string(odd_text)),
            ("endTimeCode".into(), Value::Double(1001.0)),
            ("upAxis".into(), Value::token("Y")),
        ],
        sub_layers: vec!["./weak.usda".into(), "./weaker.usda".into()],
        prims: vec![pointing, deep, scalars, moving, Prim::new(Specifier::Class, "", "_class_last")],
    }
}

#[test]
fn usd_core_reads_and_rewrites_both_encodings() {
    let dir = python::folder("layers");
    let mut layers: Vec<(String, Layer)> =
        (0..=17).chain([65_537]).map(|n| (format!("arrays_{n}"), array_layer(n))).collect();
    layers.push(("varied".into(), varied_layer()));
    layers.push(("empty".into(), Layer::default()));

    let mut expected = Map::new();
    for (name, layer) in &layers {
        std::fs::write(dir.join(format!("{name}.usdc")), crate_bytes(layer)).unwrap();
        std::fs::write(dir.join(format!("{name}.usda")), text::encode(layer)).unwrap();
        let arrays =
            layer.prims.iter().filter(|prim| prim.name == "arrays").flat_map(|prim| &prim.attributes);
        let values: Map<_, _> = arrays
            .map(|attribute| {
                let value = match attribute.default.as_ref().unwrap() {
                    Value::Ints(v) => json!(v),
                    Value::Floats(v) => json!(v),
                    Value::Float2s(v) => json!(v),
                    Value::Float3s(v) => json!(v),
                    Value::Strings(v) | Value::Tokens(v) => json!(v),
                    other => panic!("not an array: {other:?}"),
                };
                (attribute.name.clone(), value)
            })
            .collect();
        expected.insert(name.clone(), values.into());
    }
    std::fs::write(dir.join("expected.json"), serde_json::to_vec(&expected).unwrap()).unwrap();
    python::run("check_layers.py", &[&dir]);
}

#[test]
fn corpus_round_trips() {
    for layer in (0..=17).chain([65_537]).map(array_layer).chain([varied_layer(), Layer::default()]) {
        assert_eq!(decode(&crate_bytes(&layer)).unwrap(), layer);
    }
}

#[test]
fn every_truncation_is_damage() {
    let bytes = crate_bytes(&varied_layer());
    for len in 0..bytes.len() {
        assert!(
            matches!(decode(&bytes[..len]), Err(Error::Damaged { .. })),
            "{len} of {} bytes",
            bytes.len()
        );
    }
}

#[test]
fn count_beyond_the_file_is_an_error_before_allocation() {
    // The count of the points is the first value of this layer.
    let layer = Layer {
        prims: vec![Prim {
            attributes: vec![
                Attribute::new("points", "point3f[]").with_default(Value::Float3s(vec![[1.0; 3]].into())),
            ],
            ..Prim::new(Specifier::Def, "", "p")
        }],
        ..Layer::default()
    };
    let bytes = crate_bytes(&layer);
    let array = [1u64.to_le_bytes().as_slice(), &[0, 0, 128, 63].repeat(3)].concat();
    let at = bytes.windows(array.len()).position(|window| window == array).unwrap();
    for count in [2, 1 << 20, 1 << 60, u64::MAX] {
        let mut bytes = bytes.clone();
        bytes[at..at + 8].copy_from_slice(&u64::to_le_bytes(count));
        if count == 2 {
            // Twelve bytes of the tables are read as a point: only a checksum would detect that.
            assert!(decode(&bytes).is_ok());
        } else {
            assert!(matches!(decode(&bytes), Err(Error::Damaged { .. })), "{count}");
        }
    }
}

fn any_value() -> impl Strategy<Value = Value<'static>> {
    let float =
        prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO | prop::num::f32::INFINITE;
    let double = prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO;
    let text = "[^\0]{0,12}";
    let leaf = prop_oneof![
        any::<bool>().prop_map(Value::Bool),
        any::<i32>().prop_map(Value::Int),
        float.prop_map(Value::Float),
        double.prop_map(Value::Double),
        text.prop_map(Value::String),
        text.prop_map(Value::Token),
        text.prop_map(Value::Asset),
        prop::array::uniform4(prop::array::uniform4(double)).prop_map(Value::Matrix4d),
        prop::collection::vec(any::<i32>(), 0..40).prop_map(|v| Value::Ints(v.into())),
        prop::collection::vec(float, 0..40).prop_map(|v| Value::Floats(v.into())),
        prop::collection::vec(prop::array::uniform2(float), 0..9).prop_map(|v| Value::Float2s(v.into())),
        prop::collection::vec(prop::array::uniform3(float), 0..9).prop_map(|v| Value::Float3s(v.into())),
        prop::collection::vec(text, 0..4).prop_map(Value::Strings),
        prop::collection::vec(text, 0..4).prop_map(Value::Tokens),
        prop::collection::vec(text, 0..4).prop_map(Value::PrependedTokens),
    ];
    leaf.prop_recursive(3, 12, 4, |inner| {
        prop::collection::vec(("[a-z]{1,4}", inner), 0..4).prop_map(Value::Dictionary)
    })
}

fn any_metadata() -> impl Strategy<Value = Vec<(String, Value<'static>)>> {
    prop::collection::vec(("meta_[a-z]{0,3}", any_value()), 0..3)
}

/// Absolute paths, some of which may exist in a layer.
fn any_paths() -> impl Strategy<Value = Vec<String>> {
    prop::collection::vec("(/[a-z]{1,2}){1,3}(\\.[a-z:]{1,2})?", 0..3)
}

fn any_attribute() -> impl Strategy<Value = Attribute<'static>> {
    let samples = prop::collection::vec((-1e4..1e4, any_value()), 0..3);
    let name = "[a-z:]{1,6}";
    let value = prop::option::of(any_value());
    (name, "[a-z]{0,6}", any::<bool>(), any_metadata(), value, samples, any_paths()).prop_map(
        |(name, type_name, uniform, metadata, default, samples, connections)| Attribute {
            name,
            type_name,
            uniform,
            metadata,
            default,
            samples,
            connections,
        },
    )
}

fn any_relationship() -> impl Strategy<Value = Relationship> {
    let targets = prop::option::of(any_paths());
    ("[a-z:]{1,6}", targets).prop_map(|(name, targets)| Relationship { name, targets })
}

fn any_prim() -> impl Strategy<Value = Prim<'static>> {
    let specifier = prop_oneof![Just(Specifier::Def), Just(Specifier::Over), Just(Specifier::Class)];
    let attributes = || prop::collection::vec(any_attribute(), 0..4);
    let relationships = prop::collection::vec(any_relationship(), 0..3);
    let childless = (specifier, "[A-Z]{0,4}", "[a-z]{1,5}", any_metadata(), attributes(), relationships)
        .prop_map(|(specifier, type_name, name, metadata, attributes, relationships)| Prim {
            specifier,
            type_name,
            name,
            metadata,
            attributes,
            relationships,
            children: Vec::new(),
        });
    childless.prop_recursive(4, 16, 3, |inner| {
        (inner.clone(), prop::collection::vec(inner, 0..3))
            .prop_map(|(prim, children)| Prim { children, ..prim })
    })
}

fn any_layer() -> impl Strategy<Value = Layer<'static>> {
    (any_metadata(), prop::collection::vec("[a-z./]{1,8}", 0..3), prop::collection::vec(any_prim(), 0..4))
        .prop_map(|(metadata, sub_layers, prims)| Layer { metadata, sub_layers, prims })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn any_layer_round_trips(layer in any_layer()) {
        let bytes = crate_bytes(&layer);
        let read = decode(&bytes).unwrap();
        prop_assert_eq!(&read, &layer);
        // Bits: == does not distinguish -0 from 0.
        prop_assert_eq!(crate_bytes(&read), bytes);
    }

    #[test]
    fn damage_is_read_or_an_error_but_never_panics(
        layer in any_layer(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut bytes = crate_bytes(&layer);
        for (index, byte) in damage {
            let index = index.index(bytes.len());
            bytes[index] = byte;
        }
        match decode(&bytes) {
            Ok(_) | Err(Error::Damaged { .. }) => {}
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}
