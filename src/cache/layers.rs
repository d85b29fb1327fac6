//! The USD layers of a cache.
//!
//! Topology, clip manifest and frame files have the same [`skeleton`] of prims and the same [`animated`]
//! declarations: an attribute of a clip that the clip manifest lacks resolves to nothing, without an error.

use super::frame::{ColliderFrame, CurveFrame, Frame, Reactions};
use super::header::{Basis, ClosestGuides, ColliderMesh, CurveSet, Header, HeldGuides};
use super::manifest::Manifest;
use super::material;
use super::names::{
    ARC, ARRIVED, CAPS, CLAMP_FORCE, CLAMP_MOMENT, CLIP_MANIFEST, CLOSEST_GUIDES, GUIDE_WEIGHTS, LEVEL,
    LOOSE, PLANE, SKIN, TIE_FORCE, TIE_GUIDE, TIE_MOMENT, TIE_NUMBER, TOPOLOGY, clip_template, clips,
    collider_prim_names, frames_with_handles, up_axis,
};
use crate::usd::{Attribute, Layer, Metadata, Prim, Specifier, Value};
use std::borrow::Cow;

/// Brown hair, linear.
const HAIR_COLOUR: [f32; 3] = [0.16, 0.075, 0.035];
/// Guides contrast with the strands.
const GUIDE_COLOUR: [f32; 3] = [0.9, 0.45, 0.05];
/// Pale skin.
const COLLIDER_COLOUR: [f32; 3] = [0.55, 0.42, 0.36];

/// A part of the cache that moves.
#[derive(Clone, Copy)]
enum Part {
    Head,
    Hair,
    Guides,
    Collider(usize),
}

/// `hair.usda`. It includes the provenance of the cache, except what varies between runs.
pub(super) fn root_layer(header: &Header, manifest: &Manifest) -> Layer<'static> {
    let mut groom = Prim::new(Specifier::Over, "", "groom");
    groom.metadata.push(clips(
        "default",
        &clip_template(),
        frames_with_handles(header),
        "/groom",
        CLIP_MANIFEST,
    ));
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
            Part::Guides => {
                let mut attributes = curves(&header.guides, header.basis, GUIDE_COLOUR);
                attributes.extend(header.reactions.iter().flat_map(ties));
                attributes
            }
            Part::Collider(i) => collider(&header.colliders[i]),
        };
        attributes.extend(animated(header, part));
        attributes
    });
    groom.metadata.push(("kind".into(), Value::token("component")));
    // Identifies a groom to Unreal; others ignore it.
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

/// One frame file with the time samples of its frame. Points and velocities are borrowed.
pub(super) fn frame_layer<'a>(header: &Header, samples: &'a [Frame]) -> Layer<'a> {
    let groom = skeleton(header, Specifier::Over, |part| {
        let mut attributes = animated(header, part);
        for sample in samples {
            let time = f64::from(sample.frame) + sample.offset;
            let values = match part {
                Part::Head => vec![transform(&sample.head)],
                Part::Hair => sample.hair.as_ref().map(moving_curves).unwrap_or_default(),
                Part::Guides => moving_curves(&sample.guides),
                Part::Collider(i) => moving_collider(&sample.colliders[i]),
            };
            for (attribute, value) in attributes.iter_mut().zip(values) {
                attribute.samples.push((time, value));
            }
        }
        attributes
    });
    Layer { metadata: layer_metadata(header), sub_layers: Vec::new(), prims: vec![groom] }
}

/// Metadata of every layer of the cache.
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

/// [`layer_metadata`] and the frame range: for root and topology. Frame files omit the range, so that they
/// are equal in a longer shot.
fn stage_metadata(header: &Header) -> Metadata<'static> {
    let mut metadata = layer_metadata(header);
    metadata.extend([
        ("startTimeCode".into(), Value::Double(header.frames.0.into())),
        ("endTimeCode".into(), Value::Double(header.frames.1.into())),
    ]);
    metadata
}

/// `/groom` and all prims below it. The prims of an `over` have no type.
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

/// Declarations of the animated attributes, in the order of the values in [`frame_layer`].
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
            if header.steps && matches!(part, Part::Guides) {
                let arrived = Attribute::new(ARRIVED, "int[]");
                attributes.push(arrived.with_metadata("interpolation", Value::token("uniform")));
            }
            if header.accelerations {
                attributes.push(Attribute::new("accelerations", "vector3f[]"));
            }
            if header.normals && matches!(part, Part::Guides) {
                let normals = Attribute::new("normals", "normal3f[]");
                attributes.push(normals.with_metadata("interpolation", Value::token("vertex")));
            }
            if let (Part::Guides, Some(held)) = (part, &header.reactions) {
                let clamps = [(CLAMP_FORCE, "uniform"), (CLAMP_MOMENT, "uniform")];
                let ties = [(TIE_FORCE, "constant"), (TIE_MOMENT, "constant")];
                let ties = ties.into_iter().filter(|_| !held.guide.is_empty());
                attributes.extend(clamps.into_iter().chain(ties).map(|(name, interpolation)| {
                    Attribute::new(name, "vector3f[]")
                        .with_metadata("interpolation", Value::token(interpolation))
                }));
            }
            attributes
        }
    }
}

fn moving_curves(curves: &CurveFrame) -> Vec<Value<'_>> {
    let arrays: [&[[f32; 3]]; 3] = [&curves.points, &curves.velocities, &curves.extent];
    let per_curve = [&curves.level, &curves.arrived].into_iter().flatten();
    let per_curve = per_curve.map(|values| Value::Ints(Cow::Borrowed(values)));
    let accelerations = curves.accelerations.iter().map(|array| Value::Float3s(Cow::Borrowed(array)));
    let normals = curves.normals.iter().map(|array| Value::Float3s(Cow::Borrowed(array)));
    let reactions =
        curves.reactions.iter().flat_map(|Reactions { clamp_force, clamp_moment, tie_force, tie_moment }| {
            let arrays = [clamp_force, clamp_moment, tie_force, tie_moment];
            arrays.map(|array| Value::Float3s(Cow::Borrowed(array)))
        });
    arrays
        .map(|array| Value::Float3s(Cow::Borrowed(array)))
        .into_iter()
        .chain(per_curve)
        .chain(accelerations)
        .chain(normals)
        .chain(reactions)
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

/// A matrix in the row-vector convention of USD: transposed.
pub(super) fn transform(matrix: &[[f64; 4]; 4]) -> Value<'static> {
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
        // Curves reach their end points without duplicated or phantom points.
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
    if !curves.arc.is_empty() {
        let arc = Value::Floats(Cow::Borrowed(&curves.arc));
        attributes.push(interpolated(ARC, "float[]", "vertex", arc));
    }
    if !curves.loose.is_empty() {
        attributes.push(interpolated(LOOSE, "int[]", "uniform", ints(&curves.loose)));
    }
    let ClosestGuides { guides, weights } = &curves.closest;
    if !guides.is_empty() {
        let weights = Value::Floats(Cow::Borrowed(weights));
        let arrays = [(CLOSEST_GUIDES, "int[]", ints(guides)), (GUIDE_WEIGHTS, "float[]", weights)];
        attributes.extend(arrays.map(|(name, type_name, value)| {
            let size = Value::Int(ClosestGuides::PER_STRAND as i32);
            interpolated(name, type_name, "uniform", value).with_metadata("elementSize", size)
        }));
    }
    attributes
}

/// What the tie forces of the frames are of; nothing without ties.
fn ties(HeldGuides { guide, number }: &HeldGuides) -> impl Iterator<Item = Attribute<'_>> {
    let arrays =
        [(TIE_GUIDE, guide), (TIE_NUMBER, number)].into_iter().filter(|(_, array)| !array.is_empty());
    arrays.map(|(name, array)| interpolated(name, "int[]", "constant", Value::Ints(Cow::Borrowed(array))))
}

fn collider(mesh: &ColliderMesh) -> Vec<Attribute<'_>> {
    let points = Value::Float3s(Cow::Borrowed(&mesh.points));
    let mut attributes = vec![
        // The points of a deforming mesh are in the frames; its rest points are named as those of curves.
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
    if !mesh.caps.is_empty() {
        let corners = Value::Ints(Cow::Borrowed(mesh.caps.as_flattened()));
        attributes.push(interpolated(CAPS, "int[]", "constant", corners));
    }
    for (name, _) in [(SKIN, mesh.is_skin), (PLANE, mesh.is_plane)].into_iter().filter(|(_, is)| *is) {
        attributes.push(interpolated(name, "int", "constant", Value::Int(1)));
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

pub(super) fn transform_order() -> Vec<Attribute<'static>> {
    let order = Value::Tokens(vec!["xformOp:transform".into()]);
    vec![Attribute::new("xformOpOrder", "token[]").uniform().with_default(order)]
}

fn display_colour(colour: [f32; 3]) -> Attribute<'static> {
    interpolated("primvars:displayColor", "color3f[]", "constant", Value::Float3s(vec![colour].into()))
}

pub(super) fn uniform_token(name: &str, token: &str) -> Attribute<'static> {
    Attribute::new(name, "token").uniform().with_default(Value::token(token))
}

pub(super) fn interpolated<'a>(
    name: &str,
    type_name: &str,
    interpolation: &str,
    value: Value<'a>,
) -> Attribute<'a> {
    Attribute::new(name, type_name)
        .with_default(value)
        .with_metadata("interpolation", Value::token(interpolation))
}
