//! Names of the files, prims and attributes of a cache.

use super::header::{ColliderMesh, Header};
use crate::usd::Value;
use crate::{Error, Result};
use std::ops::RangeInclusive;
use std::path::Path;

/// Root layer: the one to open or to reference.
pub const ROOT: &str = "hair.usda";
/// Layer of everything that does not move.
pub const TOPOLOGY: &str = "hair.topology.usdc";
/// Clip manifest: declares every attribute that the frame files animate.
pub const CLIP_MANIFEST: &str = "hair.manifest.usda";
/// In over mode: overs of the curves of another stage.
pub const OVER: &str = "hair.over.usda";
/// In over mode: clip manifest of [`OVER`].
pub const OVER_CLIP_MANIFEST: &str = "hair.over.manifest.usda";
/// In over mode with guides alone: the layer by which Houdini deforms the curves of another stage.
pub const DEFORM: &str = "hair.deform.usda";
/// In over mode: the other stage with [`OVER`] or [`DEFORM`] over it.
pub const SHOT: &str = "hair.shot.usda";
/// The cache's own manifest, written last.
pub const MANIFEST: &str = "manifest.json";

/// Guides that each strand follows, under the name that Unreal reads.
pub(super) const CLOSEST_GUIDES: &str = "primvars:groom_closest_guides";
/// Weights of these guides, under the name that Unreal reads.
pub(super) const GUIDE_WEIGHTS: &str = "primvars:groom_guide_weights";
/// Arc length of each point of a guide.
pub(super) const ARC: &str = "primvars:groom_arc";
/// Marks curves whose roots nothing holds.
pub(super) const LOOSE: &str = "primvars:groom_loose";
/// Triangles that close the holes of a collider.
pub(super) const CAPS: &str = "primvars:groom_caps";
/// Marks a collider that roots ride on.
pub(super) const SKIN: &str = "primvars:groom_skin";
/// Marks a collider that stands for an unbounded plane.
pub(super) const PLANE: &str = "primvars:groom_plane";
/// Force of the clamp of each guide.
pub(super) const CLAMP_FORCE: &str = "primvars:groom_clamp_force";
/// Moment of the clamp of each guide.
pub(super) const CLAMP_MOMENT: &str = "primvars:groom_clamp_moment";
/// Force of each tie of a guide.
pub(super) const TIE_FORCE: &str = "primvars:groom_tie_force";
/// Moment of each tie of a guide.
pub(super) const TIE_MOMENT: &str = "primvars:groom_tie_moment";
/// Guide of each of these.
pub(super) const TIE_GUIDE: &str = "primvars:groom_tie_guide";
/// Number of the tie in the animation of each of these.
pub(super) const TIE_NUMBER: &str = "primvars:groom_tie_number";
/// Level of each curve.
pub(super) const LEVEL: &str = "primvars:groom_level";
/// Whether each guide has arrived at a moment between frames.
pub(super) const ARRIVED: &str = "primvars:groom_arrived";

/// Minimal width of frame numbers in file names, padded with zeros: `####` in the clip template.
const FRAME_DIGITS: usize = 4;

/// File name of a frame, as USD resolves the clip template `hair.####.usdc`: padded with zeros to four
/// characters including the sign (frame −1 is `hair.-001.usdc`).
pub fn frame_file_name(frame: i32) -> String {
    format!("hair.{frame:0FRAME_DIGITS$}.usdc")
}

/// File name of a frame of [`OVER`].
pub fn over_frame_file_name(frame: i32) -> String {
    format!("hair.over.{frame:0FRAME_DIGITS$}.usdc")
}

/// The template of [`frame_file_name`] in the clip metadata.
pub(super) fn clip_template() -> String {
    format!("./hair.{}.usdc", "#".repeat(FRAME_DIGITS))
}

/// The template of [`over_frame_file_name`] in the clip metadata.
pub(super) fn over_clip_template() -> String {
    format!("./hair.over.{}.usdc", "#".repeat(FRAME_DIGITS))
}

/// Metadata of a prim whose attributes are in files, one for each of the `frames`, at `prim_path`: the clip
/// set `name`.
pub(super) fn clips(
    name: &str,
    template: &str,
    frames: RangeInclusive<i32>,
    prim_path: &str,
    manifest: &str,
) -> (String, Value<'static>) {
    let set = vec![
        ("templateAssetPath".into(), Value::string(template)),
        ("templateStartTime".into(), Value::Double((*frames.start()).into())),
        ("templateEndTime".into(), Value::Double((*frames.end()).into())),
        ("templateStride".into(), Value::Double(1.0)),
        ("primPath".into(), Value::string(prim_path)),
        ("manifestAssetPath".into(), Value::Asset(format!("./{manifest}"))),
    ];
    ("clips".into(), Value::Dictionary(vec![(name.into(), Value::Dictionary(set))]))
}

/// The frame of a file, if its name is one that `name_of` gives.
fn frame_of_file_name(name: &str, name_of: fn(i32) -> String) -> Option<i32> {
    let digits = name.strip_suffix(".usdc")?.rsplit('.').next()?;
    let frame = digits.parse().ok()?;
    (name_of(frame) == name).then_some(frame)
}

/// Frames that have a file with a name of `name_of` in `dir`, in order.
pub(super) fn frames_on_disk(dir: &Path, name_of: fn(i32) -> String) -> Result<Vec<i32>> {
    let mut frames = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(|e| Error::io(dir, e))? {
        let entry = entry.map_err(|e| Error::io(dir, e))?;
        frames.extend(entry.file_name().to_str().and_then(|name| frame_of_file_name(name, name_of)));
    }
    frames.sort_unstable();
    Ok(frames)
}

/// Frames of a complete cache: those of the shot and one handle frame before and after, which give the first
/// and the last shutter interval motion.
pub(super) fn frames_with_handles(header: &Header) -> RangeInclusive<i32> {
    header.frames.0.saturating_sub(1)..=header.frames.1.saturating_add(1)
}

pub(super) fn up_axis(header: &Header) -> &'static str {
    if header.z_up { "Z" } else { "Y" }
}

/// Prim names of the colliders: characters other than ASCII letters, digits and `_` become `_`, and
/// duplicates get a number.
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
