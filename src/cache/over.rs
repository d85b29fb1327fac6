//! The layers of over mode: they put the motion of a bake over the curves of another stage.
//!
//! | file | content |
//! |---|---|
//! | `hair.over.usda` | overs of the stage's curves, with value clips |
//! | `hair.over.manifest.usda` | their clip manifest |
//! | `hair.over.1001.usdc` … | one file per frame |
//! | `hair.shot.usda` | the stage with `hair.over.usda` over it |
//!
//! Clips beat what weaker layers and references have of an attribute, values and time samples alike.

use super::names::{OVER_CLIP_MANIFEST, clips, over_clip_template};
use super::shot::{LayerKind, ShotStage, descendant, unbind};
use crate::usd::{Attribute, Layer, Prim, Specifier, Value};
use std::borrow::Cow;
use std::ops::RangeInclusive;

/// Name of the clip set; a set of the stage may be named "default".
const CLIP_SET: &str = "hairbake";
/// The prim of the frame files that holds those of the stage's curves.
const FRAME_ROOT: &str = "over";

/// What does not change in the layers of over mode.
#[derive(Debug, Clone, PartialEq)]
pub struct OverHeader {
    /// The stage.
    pub stage: ShotStage,
    /// Whether accelerations are written.
    pub accelerations: bool,
    /// The curves.
    pub prims: Vec<OverCurves>,
}

/// Curves of the stage.
#[derive(Debug, Clone, PartialEq)]
pub struct OverCurves {
    /// Path of the prim.
    pub path: String,
    /// The attribute of its normals, if they turn with the curves.
    pub normals: Option<String>,
    /// Whether to remove the stage's accelerations.
    pub without_accelerations: bool,
    /// Whether to keep a skeleton from moving the points again.
    pub without_skeleton: bool,
}

/// The curves of the stage at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OverFrame {
    /// Frame number.
    pub frame: i32,
    /// Time since the frame, frames (0..1).
    pub offset: f64,
    /// The prims of the header.
    pub prims: Vec<OverCurveFrame>,
}

/// Curves of the stage at one moment, in the space of their prim.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OverCurveFrame {
    /// Control points.
    pub points: Vec<[f32; 3]>,
    /// Their velocities, units per second.
    pub velocities: Vec<[f32; 3]>,
    /// Lowest and highest corner of the points, padded by half the largest width.
    pub extent: [[f32; 3]; 2],
    /// Accelerations, units per second squared, if the header includes them.
    pub accelerations: Option<Vec<[f32; 3]>>,
    /// Normals, if the header includes them.
    pub normals: Option<Vec<[f32; 3]>>,
}

impl OverHeader {
    /// `hair.over.usda`, with clips of these frames.
    pub(super) fn over_layer(&self, frames: RangeInclusive<i32>) -> Layer<'static> {
        let mut root = Prim::new(Specifier::Over, "", "");
        for (i, curves) in self.prims.iter().enumerate() {
            let prim = descendant(&mut root, &curves.path);
            let path = format!("/{FRAME_ROOT}/{}", clip_prim(i));
            prim.metadata.push(clips(
                CLIP_SET,
                &over_clip_template(),
                frames.clone(),
                &path,
                OVER_CLIP_MANIFEST,
            ));
            // Stronger than other sets that the stage may have for the prim.
            prim.metadata.push(("clipSets".into(), Value::PrependedTokens(vec![CLIP_SET.into()])));
            if curves.without_skeleton {
                unbind(prim);
            }
            if curves.without_accelerations {
                let accelerations = Attribute::new("accelerations", "vector3f[]");
                prim.attributes.push(accelerations.with_default(Value::Block));
            }
        }
        let metadata = self.stage.metadata(Some(LayerKind::Over));
        Layer { metadata, sub_layers: Vec::new(), prims: root.children }
    }

    /// `hair.over.manifest.usda`.
    pub(super) fn clip_manifest_layer(&self) -> Layer<'static> {
        Layer { prims: vec![self.skeleton(|i| self.animated(i))], ..Layer::default() }
    }

    /// The file of a frame with its moments.
    pub(super) fn frame_layer<'a>(&self, moments: &'a [OverFrame]) -> Layer<'a> {
        let root = self.skeleton(|i| {
            let mut attributes = self.animated(i);
            for moment in moments {
                let time = f64::from(moment.frame) + moment.offset;
                let OverCurveFrame { points, velocities, extent, accelerations, normals } = &moment.prims[i];
                let values: [&[[f32; 3]]; 3] = [points, velocities, extent];
                let more = accelerations.iter().chain(normals).map(Vec::as_slice);
                for (attribute, value) in attributes.iter_mut().zip(values.into_iter().chain(more)) {
                    attribute.samples.push((time, Value::Float3s(Cow::Borrowed(value))));
                }
            }
            attributes
        });
        Layer { metadata: self.stage.metadata(None), sub_layers: Vec::new(), prims: vec![root] }
    }

    /// The prims of a frame file.
    fn skeleton<'a>(&self, attributes: impl Fn(usize) -> Vec<Attribute<'a>>) -> Prim<'a> {
        let mut root = Prim::new(Specifier::Over, "", FRAME_ROOT);
        root.children.extend((0..self.prims.len()).map(|i| {
            let mut prim = Prim::new(Specifier::Over, "", &clip_prim(i));
            prim.attributes = attributes(i);
            prim
        }));
        root
    }

    /// Declarations of the attributes of prim `i` that move, in the order of the values in `frame_layer`.
    fn animated<'a>(&self, i: usize) -> Vec<Attribute<'a>> {
        let mut attributes = vec![
            Attribute::new("points", "point3f[]"),
            Attribute::new("velocities", "vector3f[]"),
            Attribute::new("extent", "float3[]"),
        ];
        attributes.extend(self.accelerations.then(|| Attribute::new("accelerations", "vector3f[]")));
        attributes.extend(self.prims[i].normals.iter().map(|name| Attribute::new(name, "normal3f[]")));
        attributes
    }
}

/// Name of the prim of a frame file that holds prim `i`.
fn clip_prim(i: usize) -> String {
    format!("curves{i}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::usd::text;

    #[test]
    fn prims_of_one_parent_share_it() {
        let curves = |path: &str| OverCurves {
            path: path.into(),
            normals: None,
            without_accelerations: false,
            without_skeleton: true,
        };
        let header = OverHeader {
            stage: ShotStage {
                path: "../shot.usda".into(),
                z_up: Some(true),
                time_codes_per_second: 24.0,
                frames_per_second: 24.0,
                ..ShotStage::default()
            },
            accelerations: false,
            prims: vec![curves("/world/a/hair"), curves("/world/a/fringe"), curves("/b")],
        };
        let text = text::encode(&header.over_layer(100..=102));
        for (line, count) in [
            ("over \"world\"", 1),
            ("over \"a\"", 1),
            ("rel skel:skeleton = None", 3),
            ("prepend apiSchemas = [\"SkelBindingAPI\"]", 3),
        ] {
            assert_eq!(text.matches(line).count(), count, "{text}");
        }
        assert!(text.contains("string \"primPath\" = \"/over/curves1\""));
        assert!(text.contains("string \"hairbake\" = \"over\""));
    }
}
