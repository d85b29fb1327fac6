//! The stage that layers of over mode lie over, and what all of them write.

use crate::usd::{Layer, Metadata, Prim, Relationship, Specifier, Value};

/// The metadata field of applied schemas.
const SCHEMAS: &str = "apiSchemas";
/// The relationship to the skeleton that deforms a prim, its own or that of a prim above it.
const SKELETON: &str = "skel:skeleton";
/// The schema without which USD ignores a prim's own [`SKELETON`] and takes that of a prim above it.
const SKELETON_SCHEMA: &str = "SkelBindingAPI";

/// A stage, with the metadata that layers over it repeat.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ShotStage {
    /// Its path, relative to the folder of the cache.
    pub path: String,
    /// Metres per unit that it declares.
    pub metres_per_unit: Option<f64>,
    /// Whether Z is up in it, if it declares an axis.
    pub z_up: Option<bool>,
    /// Its time codes per second.
    pub time_codes_per_second: f64,
    /// Its frames per second.
    pub frames_per_second: f64,
    /// Its first and last time code.
    pub range: Option<[f64; 2]>,
    /// Its default prim.
    pub default_prim: Option<String>,
}

/// What a layer does to the stage below it. Readers of the stage tell such layers by it from the stage's own.
#[derive(Clone, Copy)]
pub(super) enum LayerKind {
    /// It moves curves.
    Over,
    /// It lets Houdini deform curves.
    Deform,
}

impl LayerKind {
    /// The entry of `customLayerData` that tells it.
    fn mark(self) -> (String, Value<'static>) {
        let kind = match self {
            LayerKind::Over => "over",
            LayerKind::Deform => "deform",
        };
        ("hairbake".into(), Value::string(kind))
    }
}

impl ShotStage {
    /// Metadata of the stage, in a layer that lies over it if it has a `kind`. A layer of another rate or unit
    /// would be scaled in it.
    pub(super) fn metadata(&self, kind: Option<LayerKind>) -> Metadata<'static> {
        let creator = Value::string(concat!("hairbake ", env!("CARGO_PKG_VERSION")));
        let mut data = vec![("creator".into(), creator)];
        data.extend(kind.map(LayerKind::mark));
        let mut metadata: Metadata = [
            ("customLayerData", Value::Dictionary(data)),
            ("timeCodesPerSecond", Value::Double(self.time_codes_per_second)),
            ("framesPerSecond", Value::Double(self.frames_per_second)),
        ]
        .map(|(name, value)| (name.to_string(), value))
        .into();
        let unit = self.metres_per_unit.map(Value::Double);
        let up = self.z_up.map(|z_up| Value::token(if z_up { "Z" } else { "Y" }));
        metadata.extend(
            [("metersPerUnit", unit), ("upAxis", up)]
                .into_iter()
                .filter_map(|(name, value)| Some((name.to_string(), value?))),
        );
        metadata.extend(self.default_prim.iter().map(|name| ("defaultPrim".into(), Value::token(name))));
        let range = self.range.iter().flatten().zip(["startTimeCode", "endTimeCode"]);
        metadata.extend(range.map(|(code, name)| (name.into(), Value::Double(*code))));
        metadata
    }

    /// `hair.shot.usda`, with the layer `over` over the stage.
    pub(super) fn layer(&self, over: &str) -> Layer<'static> {
        let sub_layers = vec![format!("./{over}"), self.path.clone()];
        Layer { metadata: self.metadata(None), sub_layers, prims: Vec::new() }
    }
}

/// The prim at an absolute path below `root`; overs on the way are made where there are none.
pub(super) fn descendant<'p, 'a>(root: &'p mut Prim<'a>, path: &str) -> &'p mut Prim<'a> {
    path.trim_start_matches('/').split('/').fold(root, |parent, name| {
        let at = parent.children.iter().position(|child| child.name == name).unwrap_or_else(|| {
            parent.children.push(Prim::new(Specifier::Over, "", name));
            parent.children.len() - 1
        });
        &mut parent.children[at]
    })
}

/// Keeps a skeleton from moving the points of a prim.
pub(super) fn unbind(prim: &mut Prim) {
    apply(prim, SKELETON_SCHEMA);
    prim.relationships.push(Relationship { name: SKELETON.into(), targets: Some(Vec::new()) });
}

/// Applies a schema to a prim, besides those of weaker layers.
pub(super) fn apply(prim: &mut Prim, schema: &str) {
    let known = prim.metadata.iter_mut().find(|(name, _)| name == SCHEMAS);
    match known {
        Some((_, Value::PrependedTokens(schemas))) => schemas.push(schema.into()),
        _ => prim.metadata.push((SCHEMAS.into(), Value::PrependedTokens(vec![schema.into()]))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::usd::text;

    #[test]
    fn a_unit_that_the_stage_does_not_declare_is_not_declared() {
        let stage = ShotStage { path: "../shot.usda".into(), z_up: Some(true), ..ShotStage::default() };
        let shot = text::encode(&stage.layer("hair.over.usda"));
        assert!(shot.contains("[@./hair.over.usda@, @../shot.usda@]"));
        // It would change what the stage is taken for.
        assert!(shot.contains("upAxis = \"Z\"") && !shot.contains("metersPerUnit"), "{shot}");
    }
}
