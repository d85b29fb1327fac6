//! Where everything stands in the USD layers of a cache.
//!
//! The same [`skeleton`] and the same [`animated`] declarations go into topology, clip manifest and
//! frames, because an attribute that a clip holds but the clip manifest lacks resolves to nothing,
//! without an error.

use super::{
    Basis, Closest, ColliderFrame, ColliderMesh, CurveFrame, CurveSet, Frame, Header, Manifest, material,
};
use crate::usd::{Attribute, Layer, Metadata, Prim, Specifier, Value};
use std::borrow::Cow;

/// Root layer: the one to open or to reference.
pub const ROOT: &str = "hair.usda";
/// Layer of all that does not move.
pub const TOPOLOGY: &str = "hair.topology.usdc";
/// Clip manifest: declares every attribute that the frame files animate.
pub const CLIP_MANIFEST: &str = "hair.manifest.usda";
/// The cache's own manifest, written last.
pub const MANIFEST: &str = "manifest.json";

/// Digits to which frame numbers are filled up; `####` in the clip template.
const FRAME_DIGITS: usize = 4;
/// Names of the attributes that tell the guides that each strand follows, and their weights, as Unreal reads them.
pub(super) const CLOSEST: &str = "primvars:groom_closest_guides";
pub(super) const GUIDE_WEIGHTS: &str = "primvars:groom_guide_weights";
/// Name of the attribute that tells the level of each curve.
pub(super) const LEVEL: &str = "primvars:groom_level";
/// Brown hair under neutral light, linear.
const HAIR_COLOUR: [f32; 3] = [0.16, 0.075, 0.035];
/// Guides stand out from the strands.
const GUIDE_COLOUR: [f32; 3] = [0.9, 0.45, 0.05];
/// Pale skin.
const COLLIDER_COLOUR: [f32; 3] = [0.55, 0.42, 0.36];

/// File of a frame, as USD's clip template `hair.####.usdc` resolves it: filled up with zeros to four
/// characters, the sign among them (frame −1 is `hair.-001.usdc`).
pub fn frame_file_name(frame: i32) -> String {
    format!("hair.{frame:0FRAME_DIGITS$}.usdc")
}

/// The frame of a file, where its name is one of [`frame_file_name`].
pub(super) fn frame_of_file_name(name: &str) -> Option<i32> {
    let digits = name.strip_prefix("hair.")?.strip_suffix(".usdc")?;
    let frame = digits.parse().ok()?;
    (frame_file_name(frame) == name).then_some(frame)
}

/// Frames on disk: the shot's and one handle before and after, so that the first and the last shutter
/// have motion.
pub(super) fn frames_with_handles(header: &Header) -> std::ops::RangeInclusive<i32> {
    header.frames.0.saturating_sub(1)..=header.frames.1.saturating_add(1)
}

pub(super) fn up_axis(header: &Header) -> &'static str {
    if header.z_up { "Z" } else { "Y" }
}

/// Prim names of the colliders: every other character than ASCII letters, digits and `_` becomes `_`,
/// and a name that was there already gets a number.
pub(super) fn collider_prim_names(header: &Header) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for ColliderMesh { name, .. } in &header.colliders {
        let mut stem: String =
            name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        if stem.is_empty() || stem.starts_with(|c: char| c.is_ascii_digit()) {
            stem.insert(0, '_');
        }
        let mut name = stem.clone();
        let mut number = 2;
        while names.contains(&name) {
            name = format!("{stem}_{number}");
            number += 1;
        }
        names.push(name);
    }
    names
}

/// A part of the cache that moves.
#[derive(Clone, Copy)]
enum Part {
    Head,
    Hair,
    Guides,
    Collider(usize),
}

/// `hair.usda`; it tells what the cache was made from, as far as that does not change from run to run.
pub(super) fn root_layer(header: &Header, manifest: &Manifest) -> Layer<'static> {
    let handles = frames_with_handles(header);
    let clips = vec![
        ("templateAssetPath".into(), Value::string(&format!("./hair.{}.usdc", "#".repeat(FRAME_DIGITS)))),
        ("templateStartTime".into(), Value::Double((*handles.start()).into())),
        ("templateEndTime".into(), Value::Double((*handles.end()).into())),
        ("templateStride".into(), Value::Double(1.0)),
        ("primPath".into(), Value::string("/groom")),
        ("manifestAssetPath".into(), Value::Asset(format!("./{CLIP_MANIFEST}"))),
    ];
    let mut groom = Prim::new(Specifier::Over, "", "groom");
    groom
        .metadata
        .push(("clips".into(), Value::Dictionary(vec![("default".into(), Value::Dictionary(clips))])));
    let inputs = manifest.inputs.iter().filter(|input| matches!(input.role.as_str(), "groom" | "anim"));
    let mut provenance: Vec<(String, Value)> =
        inputs.map(|input| (format!("{}_sha256", input.role), Value::string(&input.sha256))).collect();
    provenance.extend([
        ("build".into(), Value::string(&manifest.build)),
        ("key".into(), Value::string(&manifest.key)),
        ("settings".into(), Value::string(&manifest.settings.to_string())),
    ]);
    let mut metadata = stage_metadata(header);
    if let Some((_, Value::Dictionary(data))) = metadata.first_mut() {
        data.extend(provenance);
    }
    Layer { metadata, sub_layers: vec![format!("./{TOPOLOGY}")], prims: vec![groom] }
}

/// `hair.topology.usdc`.
pub(super) fn topology_layer(header: &Header) -> Layer<'_> {
    let mut groom = skeleton(header, Specifier::Def, |part| {
        let mut attributes = match part {
            Part::Head => transform_order(),
            Part::Hair => {
                header.hair.as_ref().map(|c| curves(c, header.basis, HAIR_COLOUR)).unwrap_or_default()
            }
            Part::Guides => curves(&header.guides, header.basis, GUIDE_COLOUR),
            Part::Collider(i) => collider(&header.colliders[i]),
        };
        attributes.extend(animated(header, part));
        attributes
    });
    groom.metadata.push(("kind".into(), Value::token("component")));
    // By this Unreal knows a groom; to others it says nothing.
    groom.metadata.push(("apiSchemas".into(), Value::PrependedTokens(vec!["GroomAPI".into()])));
    for child in &mut groom.children {
        if matches!(child.name.as_str(), "guides" | "colliders") {
            child.attributes.push(uniform_token("purpose", "guide"));
        }
        if matches!(child.name.as_str(), "hair" | "guides") {
            material::bind(child);
        }
    }
    groom.children.push(material::scope());
    Layer { metadata: stage_metadata(header), sub_layers: Vec::new(), prims: vec![groom] }
}

/// `hair.manifest.usda`.
pub(super) fn clip_manifest_layer(header: &Header) -> Layer<'static> {
    let groom = skeleton(header, Specifier::Over, |part| animated(header, part));
    Layer { prims: vec![groom], ..Layer::default() }
}

/// One frame file, of the moments of its frame; points and velocities are borrowed.
pub(super) fn frame_layer<'a>(header: &Header, moments: &'a [Frame]) -> Layer<'a> {
    let groom = skeleton(header, Specifier::Over, |part| {
        let mut attributes = animated(header, part);
        for moment in moments {
            let time = f64::from(moment.frame) + moment.offset;
            let values = match part {
                Part::Head => vec![transform(&moment.head)],
                Part::Hair => moment.hair.as_ref().map(moving_curves).unwrap_or_default(),
                Part::Guides => moving_curves(&moment.guides),
                Part::Collider(i) => moving_collider(&moment.colliders[i]),
            };
            for (attribute, value) in attributes.iter_mut().zip(values) {
                attribute.samples.push((time, value));
            }
        }
        attributes
    });
    Layer { metadata: layer_metadata(header), sub_layers: Vec::new(), prims: vec![groom] }
}

/// What every layer of the cache says of itself.
fn layer_metadata(header: &Header) -> Metadata<'static> {
    let creator = Value::string(concat!("hairbake ", env!("CARGO_PKG_VERSION")));
    [
        ("customLayerData", Value::Dictionary(vec![("creator".into(), creator)])),
        ("defaultPrim", Value::token("groom")),
        ("metersPerUnit", Value::Double(header.metres_per_unit)),
        ("upAxis", Value::token(up_axis(header))),
        ("timeCodesPerSecond", Value::Double(header.fps)),
        ("framesPerSecond", Value::Double(header.fps)),
    ]
    .map(|(name, value)| (name.to_string(), value))
    .into()
}

/// The same and the range of the shot: for root and topology, but not for a frame, which is the same in a longer shot.
fn stage_metadata(header: &Header) -> Metadata<'static> {
    let mut metadata = layer_metadata(header);
    metadata.extend([
        ("startTimeCode".into(), Value::Double(header.frames.0.into())),
        ("endTimeCode".into(), Value::Double(header.frames.1.into())),
    ]);
    metadata
}

/// `/groom` and all below it; prims of an `over` have no type.
fn skeleton<'a>(
    header: &Header,
    specifier: Specifier,
    attributes: impl Fn(Part) -> Vec<Attribute<'a>>,
) -> Prim<'a> {
    let prim = |type_name: &str, name: &str, part: Option<Part>| {
        let type_name = if specifier == Specifier::Def { type_name } else { "" };
        let mut prim = Prim::new(specifier, type_name, name);
        prim.attributes = part.map(&attributes).unwrap_or_default();
        prim
    };
    let mut groom = prim("Xform", "groom", None);
    groom.children.push(prim("Xform", "head", Some(Part::Head)));
    if header.hair.is_some() {
        groom.children.push(prim("BasisCurves", "hair", Some(Part::Hair)));
    }
    if !header.guides.counts.is_empty() {
        groom.children.push(prim("BasisCurves", "guides", Some(Part::Guides)));
    }
    if !header.colliders.is_empty() {
        let mut colliders = prim("Scope", "colliders", None);
        let names = collider_prim_names(header);
        colliders.children =
            names.iter().enumerate().map(|(i, name)| prim("Mesh", name, Some(Part::Collider(i)))).collect();
        groom.children.push(colliders);
    }
    groom
}

/// Declarations of what the frame files hold, in the order of [`frame_layer`]'s values.
fn animated<'a>(header: &Header, part: Part) -> Vec<Attribute<'a>> {
    let transform = Attribute::new("xformOp:transform", "matrix4d");
    match part {
        Part::Collider(i) if header.colliders[i].deforms => {
            vec![transform, Attribute::new("points", "point3f[]"), Attribute::new("extent", "float3[]")]
        }
        Part::Head | Part::Collider(_) => vec![transform],
        Part::Hair | Part::Guides => {
            let mut attributes = vec![
                Attribute::new("points", "point3f[]"),
                Attribute::new("velocities", "vector3f[]"),
                Attribute::new("extent", "float3[]"),
            ];
            if header.levels {
                let level = Attribute::new(LEVEL, "int[]");
                attributes.push(level.with_metadata("interpolation", Value::token("uniform")));
            }
            if header.accelerations {
                attributes.push(Attribute::new("accelerations", "vector3f[]"));
            }
            attributes
        }
    }
}

fn moving_curves(curves: &CurveFrame) -> Vec<Value<'_>> {
    let arrays: [&[[f32; 3]]; 3] = [&curves.points, &curves.velocities, &curves.extent];
    let level = curves.level.iter().map(|level| Value::Ints(Cow::Borrowed(level)));
    let accelerations = curves.accelerations.iter().map(|array| Value::Float3s(Cow::Borrowed(array)));
    arrays
        .map(|array| Value::Float3s(Cow::Borrowed(array)))
        .into_iter()
        .chain(level)
        .chain(accelerations)
        .collect()
}

fn moving_collider(collider: &ColliderFrame) -> Vec<Value<'_>> {
    let mut values = vec![transform(&collider.transform)];
    if let Some(points) = &collider.points {
        values
            .extend([Value::Float3s(Cow::Borrowed(points)), Value::Float3s(bounds(points).to_vec().into())]);
    }
    values
}

/// USD multiplies row vectors from the left, so its matrices are the transposed ones.
fn transform(matrix: &[[f64; 4]; 4]) -> Value<'static> {
    Value::Matrix4d(transposed(matrix))
}

pub(super) fn transposed(matrix: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[column][row]))
}

fn curves(curves: &CurveSet, basis: Basis, colour: [f32; 3]) -> Vec<Attribute<'_>> {
    let ints = |values| Value::Ints(Cow::Borrowed(values));
    let basis = match basis {
        Basis::CatmullRom => "catmullRom",
        Basis::Bspline => "bspline",
    };
    let mut attributes = vec![
        uniform_token("type", "cubic"),
        uniform_token("basis", basis),
        // Curves reach their first and last point without doubled or phantom points.
        uniform_token("wrap", "pinned"),
        Attribute::new("curveVertexCounts", "int[]").with_default(ints(&curves.counts)),
        interpolated("widths", "float[]", "vertex", Value::Floats(Cow::Borrowed(&curves.widths))),
        display_colour(colour),
        interpolated("primvars:groom_id", "int[]", "uniform", ints(&curves.id)),
        interpolated("primvars:groom_group_id", "int[]", "uniform", ints(&curves.group)),
        interpolated(
            "primvars:groom_group_name",
            "string[]",
            "uniform",
            Value::Strings(curves.group_name.clone()),
        ),
        interpolated("primvars:groom_guide", "int[]", "uniform", ints(&curves.guide)),
        interpolated(
            "primvars:groom_root_uv",
            "texCoord2f[]",
            "uniform",
            Value::Float2s(Cow::Borrowed(&curves.root_uv)),
        ),
        interpolated("primvars:rest", "point3f[]", "vertex", Value::Float3s(Cow::Borrowed(&curves.rest))),
    ];
    let Closest { guides, weights } = &curves.closest;
    if !guides.is_empty() {
        let weights = Value::Floats(Cow::Borrowed(weights));
        let of_each = [(CLOSEST, "int[]", ints(guides)), (GUIDE_WEIGHTS, "float[]", weights)];
        attributes.extend(of_each.map(|(name, type_name, value)| {
            let size = Value::Int(Closest::EACH as i32);
            interpolated(name, type_name, "uniform", value).with_metadata("elementSize", size)
        }));
    }
    attributes
}

fn collider(mesh: &ColliderMesh) -> Vec<Attribute<'_>> {
    let points = Value::Float3s(Cow::Borrowed(&mesh.points));
    let mut attributes = vec![
        // Where a mesh that deforms was at rest has the name that it has for curves: its points are the frames'.
        if mesh.deforms {
            interpolated("primvars:rest", "point3f[]", "vertex", points)
        } else {
            Attribute::new("points", "point3f[]").with_default(points)
        },
        Attribute::new("faceVertexCounts", "int[]")
            .with_default(Value::Ints(vec![3; mesh.triangles.len()].into())),
        Attribute::new("faceVertexIndices", "int[]")
            .with_default(Value::Ints(Cow::Borrowed(mesh.triangles.as_flattened()))),
    ];
    if !mesh.deforms {
        let extent = Value::Float3s(bounds(&mesh.points).to_vec().into());
        attributes.push(Attribute::new("extent", "float3[]").with_default(extent));
    }
    attributes.extend([
        uniform_token("subdivisionScheme", "none"),
        Attribute::new("doubleSided", "bool").uniform().with_default(Value::Bool(true)),
        display_colour(COLLIDER_COLOUR),
    ]);
    attributes.extend(transform_order());
    attributes
}

/// Lowest and highest corner.
fn bounds(points: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let Some(&first) = points.first() else { return [[0.0; 3]; 2] };
    points.iter().fold([first; 2], |[low, high], p| {
        [std::array::from_fn(|i| low[i].min(p[i])), std::array::from_fn(|i| high[i].max(p[i]))]
    })
}

fn transform_order() -> Vec<Attribute<'static>> {
    let order = Value::Tokens(vec!["xformOp:transform".into()]);
    vec![Attribute::new("xformOpOrder", "token[]").uniform().with_default(order)]
}

fn display_colour(colour: [f32; 3]) -> Attribute<'static> {
    interpolated("primvars:displayColor", "color3f[]", "constant", Value::Float3s(vec![colour].into()))
}

fn uniform_token(name: &str, token: &str) -> Attribute<'static> {
    Attribute::new(name, "token").uniform().with_default(Value::token(token))
}

fn interpolated<'a>(name: &str, type_name: &str, interpolation: &str, value: Value<'a>) -> Attribute<'a> {
    Attribute::new(name, type_name)
        .with_default(value)
        .with_metadata("interpolation", Value::token(interpolation))
}
