//! `hair.deform.usda`: the layer by which Houdini deforms the curves of another stage by the guides of the
//! cache, so that a cache holds guides alone.
//!
//! Overs of the stage's curves apply `HoudiniHairDeformAPI`. The names are those of the schema as SideFX
//! publishes it with Houdini 22, which takes guides and skin at rest in the space of the curves' points, and
//! in motion in the world. So the layer refers to the cache once for each such space, with the places at rest
//! in it.

use super::header::Header;
use super::layers::{interpolated, transform, transform_order, uniform_token};
use super::names::{ROOT, collider_prim_names};
use super::shot::{LayerKind, ShotStage, apply, descendant, unbind};
use crate::usd::{Attribute, Layer, Prim, Relationship, Specifier, Value};
use std::borrow::Cow;

/// The prim of the layer that holds the references to the cache.
const ROOT_PRIM: &str = "hairbake_guides";
/// The schema by which Houdini deforms curves.
const SCHEMA: &str = "HoudiniHairDeformAPI";

/// What the layer holds.
#[derive(Debug, Clone, PartialEq)]
pub struct DeformHeader {
    /// The stage.
    pub stage: ShotStage,
    /// Matrix from the unit and axes of the cache to those of the stage, for column vectors.
    pub from_cache: [[f64; 4]; 4],
    /// The spaces in which curves are at rest.
    pub spaces: Vec<DeformSpace>,
    /// The curves.
    pub prims: Vec<DeformCurves>,
}

/// Guides and skins at rest in one space.
#[derive(Debug, Clone, PartialEq)]
pub struct DeformSpace {
    /// Name of its reference to the cache, an identifier.
    pub name: String,
    /// Points of the guides.
    pub guides: Vec<[f32; 3]>,
    /// Colliders, as indices into [`Header::colliders`], with their vertices.
    pub skins: Vec<(usize, Vec<[f32; 3]>)>,
}

/// Curves of the stage.
#[derive(Debug, Clone, PartialEq)]
pub struct DeformCurves {
    /// Path of the prim.
    pub path: String,
    /// Its space: index into [`DeformHeader::spaces`].
    pub space: usize,
    /// The collider that carries its roots: index into [`Header::colliders`].
    pub skin: usize,
    /// How guides move it.
    pub method: DeformMethod,
    /// Its points at rest, if the stage has others, or moves them.
    pub points: Option<Vec<[f32; 3]>>,
    /// Whether to remove the stage's accelerations.
    pub without_accelerations: bool,
    /// Whether to keep a skeleton from moving the points.
    pub without_skeleton: bool,
}

/// How guides move curves.
#[derive(Debug, Clone, PartialEq)]
pub enum DeformMethod {
    /// By weights of given guides.
    Weights {
        /// Number of guides of each curve.
        counts: Vec<i32>,
        /// The guides, curve after curve, as indices of curves of the cache.
        guides: Vec<i32>,
        /// Their weights, of sum 1 per curve.
        weights: Vec<f32>,
    },
    /// By guides that Houdini chooses by their shapes.
    Shapes {
        /// How far from the root of a curve it looks for guides, units of the space.
        radius: f32,
    },
}

impl DeformMethod {
    /// Its name in the schema.
    pub fn name(&self) -> &'static str {
        match self {
            DeformMethod::Weights { .. } => "guideweights",
            DeformMethod::Shapes { .. } => "guideshapeinterpolation",
        }
    }

    fn attributes(&self) -> Vec<Attribute<'_>> {
        let method = Attribute::new("houdini:hairdeform:deformmethod", "string");
        let mut attributes = vec![method.uniform().with_default(Value::string(self.name()))];
        match self {
            DeformMethod::Weights { counts, guides, weights } => {
                let [counts, guides] = [counts, guides].map(|ints| Value::Ints(Cow::Borrowed(ints)));
                let weights = Value::Floats(Cow::Borrowed(weights));
                // No element of USD has several values of varying number: they are constant as a whole.
                attributes.extend([
                    interpolated("primvars:guides", "int[]", "constant", guides),
                    interpolated("primvars:guides:lengths", "int[]", "uniform", counts.clone()),
                    interpolated("primvars:weights", "float[]", "constant", weights),
                    interpolated("primvars:weights:lengths", "int[]", "uniform", counts),
                ]);
            }
            DeformMethod::Shapes { radius } => {
                let search = Attribute::new("houdini:hairdeform:gsisearchradius", "float");
                attributes.push(search.uniform().with_default(Value::Float(*radius)));
            }
        }
        attributes
    }
}

impl DeformHeader {
    /// Path of the guides that move a prim.
    pub fn guides_path(&self, curves: &DeformCurves) -> String {
        format!("/{ROOT_PRIM}/{}/guides", self.spaces[curves.space].name)
    }

    /// Path of the mesh that carries the roots of a prim.
    pub fn skin_path(&self, curves: &DeformCurves, header: &Header) -> String {
        let name = &collider_prim_names(header)[curves.skin];
        format!("/{ROOT_PRIM}/{}/colliders/{name}", self.spaces[curves.space].name)
    }

    /// `hair.deform.usda` beside the cache with that header.
    pub(super) fn layer(&self, header: &Header) -> Layer<'_> {
        let mut root = Prim::new(Specifier::Over, "", "");
        for curves in &self.prims {
            let prim = descendant(&mut root, &curves.path);
            apply(prim, SCHEMA);
            if curves.without_skeleton {
                unbind(prim);
            }
            prim.attributes = curves.method.attributes();
            let blocked = |name| Attribute::new(name, "vector3f[]").with_default(Value::Block);
            if let Some(points) = &curves.points {
                let points = Value::Float3s(Cow::Borrowed(points));
                prim.attributes.push(Attribute::new("points", "point3f[]").with_default(points));
                prim.attributes.push(blocked("velocities"));
            }
            if curves.without_accelerations {
                prim.attributes.push(blocked("accelerations"));
            }
            let targets =
                [("deformerPrim", self.guides_path(curves)), ("skinPrim", self.skin_path(curves, header))];
            prim.relationships.extend(targets.map(|(name, target)| Relationship {
                name: format!("houdini:hairdeform:{name}"),
                targets: Some(vec![target]),
            }));
        }
        let mut guides = Prim::new(Specifier::Def, "Scope", ROOT_PRIM);
        guides.attributes.push(uniform_token("purpose", "guide"));
        guides.children.extend(self.spaces.iter().map(|space| self.reference(space, header)));
        root.children.push(guides);
        let metadata = self.stage.metadata(Some(LayerKind::Deform));
        Layer { metadata, sub_layers: Vec::new(), prims: root.children }
    }

    /// The cache, with guides and skins at rest in one space.
    fn reference<'a>(&self, space: &'a DeformSpace, header: &Header) -> Prim<'a> {
        let rest = |points: &'a [[f32; 3]]| {
            interpolated("primvars:rest", "point3f[]", "vertex", Value::Float3s(Cow::Borrowed(points)))
        };
        let mut prim = Prim::new(Specifier::Def, "Xform", &space.name);
        let target = Value::PrependedReference(format!("./{ROOT}"), "/groom".into());
        prim.metadata.push(("references".into(), target));
        let transform =
            Attribute::new("xformOp:transform", "matrix4d").with_default(transform(&self.from_cache));
        prim.attributes.push(transform);
        prim.attributes.extend(transform_order());
        descendant(&mut prim, "guides").attributes.push(rest(&space.guides));
        let names = collider_prim_names(header);
        for (collider, points) in &space.skins {
            let skin = descendant(&mut prim, &format!("colliders/{}", names[*collider]));
            skin.attributes.push(rest(points));
        }
        prim
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::ColliderMesh;
    use crate::usd::text;

    #[test]
    fn curves_name_guides_and_skin_of_their_space() {
        let curves = |path: &str, space: usize, method: DeformMethod| DeformCurves {
            path: path.into(),
            space,
            skin: 0,
            method,
            points: None,
            without_accelerations: false,
            without_skeleton: space == 1,
        };
        let space = |name: &str| DeformSpace {
            name: name.into(),
            guides: vec![[1.0, 2.0, 3.0]],
            skins: vec![(0, vec![[0.0; 3]])],
        };
        let weights = DeformMethod::Weights {
            counts: vec![2, 1],
            guides: vec![4, 0, 1],
            weights: vec![0.75, 0.25, 1.0],
        };
        let deform = DeformHeader {
            stage: ShotStage::default(),
            from_cache: [
                [1.0, 0.0, 0.0, 5.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ],
            spaces: vec![space("a"), space("b")],
            prims: vec![curves("/x/a", 0, weights), curves("/x/b", 1, DeformMethod::Shapes { radius: 2.5 })],
        };
        let skin = ColliderMesh { name: "left arm".into(), ..ColliderMesh::default() };
        let text = text::encode(&deform.layer(&Header { colliders: vec![skin], ..Header::default() }));
        for (line, count) in [
            ("string \"hairbake\" = \"deform\"", 1),
            ("over \"x\"", 1),
            ("prepend apiSchemas = [\"HoudiniHairDeformAPI\"]", 1),
            ("prepend apiSchemas = [\"HoudiniHairDeformAPI\", \"SkelBindingAPI\"]", 1),
            ("int[] primvars:guides = [4, 0, 1]", 1),
            ("float[] primvars:weights = [0.75, 0.25, 1.0]", 1),
            (":lengths = [2, 1]", 2),
            ("uniform float houdini:hairdeform:gsisearchradius = 2.5", 1),
            ("rel houdini:hairdeform:deformerPrim = </hairbake_guides/a/guides>", 1),
            ("rel houdini:hairdeform:skinPrim = </hairbake_guides/b/colliders/left_arm>", 1),
            ("prepend references = @./hair.usda@</groom>", 2),
            // Rows of USD's matrices are columns of ours.
            ("(5.0, 0.0, 0.0, 1.0) )", 2),
        ] {
            assert_eq!(text.matches(line).count(), count, "{line}: {text}");
        }
    }
}
