//! glTF 2.0 (`.gltf`, `.glb`): metres, Y up. Animations of joints, whose keyframes are resampled at a
//! constant rate, and meshes that deform.

mod buffers;
mod keyframes;
pub(crate) mod mesh;

use crate::import::joint_selector::JointSelector;
use crate::import::motion::{Motion, convention, snap_rate, unknown_joint};
use crate::import::rigid::{self, RigidPoses};
use crate::import::source::Source;
use crate::scene::UpAxis;
use crate::{Diagnostic, Error, Result};
use gltf::json::validation::Checked;
use gltf::{Animation, Document, Gltf};
use keyframes::AnimatedNode;
use nalgebra::Matrix4;

/// Range of sampling rates, 1/s: keyframes closer together than the upper bound allows are noise.
const RATES: [f64; 2] = [10.0, 240.0];
/// Sampling rate of an animation with a single key, 1/s.
const DEFAULT_RATE: f64 = 24.0;
/// Longest animation, s.
const MAX_DURATION: f64 = 3600.0;

/// Reads the motion of a node.
///
/// # Errors
/// Every error in the file.
pub(crate) fn parse(source: &Source, joint: &JointSelector, bytes: &[u8]) -> Result<Motion> {
    let (document, buffers) = open(source, bytes)?;
    let names: Vec<String> = document.nodes().map(|n| node_name(&n)).collect();
    let node = select_node(source, joint, &names)?;
    let mut notes = Vec::new();
    let clip = select_clip(source, joint, &document, &mut notes)?;
    let chain = animated_chain(source, &document, &clip, node, &buffers)?;
    let times = sample_times(source, &clip, &names[node], &chain, &mut notes)?;

    let world = |t: f64| chain.iter().fold(Matrix4::identity(), |parent, node| parent * node.at(t));
    let matrices: Vec<_> = (0..times.count).map(|i| world(times.start + i as f64 / times.rate)).collect();
    // The nodes without animation. A skin's inverse bind matrices are relative to the mesh's own space
    // instead.
    let bind = chain.iter().fold(Matrix4::identity(), |parent, node| parent * node.rest);
    let RigidPoses { poses, bind, warnings } =
        rigid::poses(source, &format!("nodes[{node}]"), &matrices, Some(&bind))?;
    Ok(Motion {
        rate: times.rate,
        numbering: None,
        convention: convention(source, 1.0, UpAxis::Y),
        poses,
        bind,
        stage: None,
        notes,
        warnings,
    })
}

/// The document and its buffers.
///
/// # Errors
/// Not a valid file, or buffers that cannot be read.
fn open(source: &Source, bytes: &[u8]) -> Result<(Document, Vec<Vec<u8>>)> {
    let Gltf { document, blob } = Gltf::from_slice(bytes).map_err(|e| {
        error(
            source,
            "",
            format!("not valid glTF: {e}"),
            "a .gltf or .glb file of version 2.0",
            "export it again",
        )
    })?;
    Error::if_any(unknown_enums(source, &document))?;
    let buffers = buffers::read(source, &document, blob)?;
    Ok((document, buffers))
}

/// Errors for unknown enum values in animations: the parser accepts them and panics when they are read.
fn unknown_enums(source: &Source, document: &Document) -> Vec<Diagnostic> {
    let mut diagnostics = Vec::new();
    for (a, animation) in document.as_json().animations.iter().enumerate() {
        let mut unknown = |key: String, allowed: &str| {
            let key = format!("animations[{a}].{key}");
            let what = "not a value that glTF 2.0 defines";
            diagnostics.push(Diagnostic::new(&source.path, key, what, allowed, "export it again"));
        };
        for (i, channel) in animation.channels.iter().enumerate() {
            if matches!(channel.target.path, Checked::Invalid) {
                unknown(format!("channels[{i}].target.path"), "translation, rotation, scale or weights");
            }
        }
        for (i, sampler) in animation.samplers.iter().enumerate() {
            if matches!(sampler.interpolation, Checked::Invalid) {
                unknown(format!("samplers[{i}].interpolation"), "LINEAR, STEP or CUBICSPLINE");
            }
        }
    }
    diagnostics
}

fn error(source: &Source, key: &str, what: String, allowed: &str, remedy: &str) -> Error {
    Diagnostic::new(&source.path, key, what, allowed, remedy).into()
}

fn node_name(node: &gltf::Node) -> String {
    node.name().map_or_else(|| format!("node {}", node.index()), String::from)
}

fn clip_name(clip: &Animation) -> String {
    clip.name().map_or_else(|| clip.index().to_string(), |name| format!("\"{name}\""))
}

/// Index of the node with the selected name.
fn select_node(source: &Source, joint: &JointSelector, names: &[String]) -> Result<usize> {
    let found = joint.name.as_deref().and_then(|name| names.iter().position(|n| n == name));
    found.ok_or_else(|| {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        unknown_joint(source, joint.name.as_deref(), &names, "node")
    })
}

/// The selected animation, or the first.
fn select_clip<'a>(
    source: &Source,
    joint: &JointSelector,
    document: &'a Document,
    notes: &mut Vec<String>,
) -> Result<Animation<'a>> {
    let names: Vec<String> = document.animations().map(|a| clip_name(&a)).collect();
    let selected = |a: &Animation| {
        joint.clip.as_deref().is_none_or(|name| a.name() == Some(name) || a.index().to_string() == name)
    };
    let Some(clip) = document.animations().find(selected) else {
        let what = match joint.clip.as_deref() {
            Some(name) => format!("no animation is named \"{name}\""),
            None => "the file has no animation".into(),
        };
        let allowed =
            if names.is_empty() { "an animation".into() } else { format!("one of: {}", names.join(", ")) };
        let remedy = "export the animation as well, or select another with --clip";
        return Err(error(source, "animations", what, &allowed, remedy));
    };
    if names.len() > 1 && joint.clip.is_none() {
        notes.push(format!(
            "the first of {} animations is used (set --clip to select another): {}",
            names.len(),
            names.join(", ")
        ));
    }
    Ok(clip)
}

/// The node and its ancestors, root first, with their keyframes.
///
/// # Errors
/// Every faulty channel of these nodes.
fn animated_chain(
    source: &Source,
    document: &Document,
    clip: &Animation,
    node: usize,
    buffers: &[Vec<u8>],
) -> Result<Vec<AnimatedNode>> {
    let chain = ancestors(document, node);
    let mut animated: Vec<_> = chain.iter().map(|&n| AnimatedNode::new(document, n)).collect();
    let mut diagnostics = Vec::new();
    for (i, channel) in clip.channels().enumerate() {
        let Some(at) = chain.iter().position(|&n| n == channel.target().node().index()) else { continue };
        if let Err(what) = animated[at].add(&channel, buffers) {
            let key = format!("animations[{}].channels[{i}]", clip.index());
            let allowed = "keyframes as glTF 2.0 defines them";
            diagnostics.push(Diagnostic::new(&source.path, key, what, allowed, "export it again"));
        }
    }
    Error::if_any(diagnostics)?;
    Ok(animated)
}

/// Indices of a node and its ancestors, root first.
fn ancestors(document: &Document, node: usize) -> Vec<usize> {
    let mut parent = vec![None; document.nodes().count()];
    for above in document.nodes() {
        above.children().for_each(|below| parent[below.index()] = Some(above.index()));
    }
    // The bound ends the walk in a damaged file where a node is its own ancestor.
    let mut chain: Vec<usize> =
        std::iter::successors(Some(node), |&n| parent[n]).take(parent.len()).collect();
    chain.reverse();
    chain
}

/// Evenly spaced times: the first, s, their rate, 1/s, and their number.
struct SampleTimes {
    start: f64,
    rate: f64,
    count: usize,
}

/// Times that cover all keyframes of `chain`; the rate follows from the median step between keys.
///
/// # Errors
/// No keyframes, or an animation longer than [`MAX_DURATION`].
fn sample_times(
    source: &Source,
    clip: &Animation,
    node: &str,
    chain: &[AnimatedNode],
    notes: &mut Vec<String>,
) -> Result<SampleTimes> {
    let keys: Vec<f64> = chain.iter().flat_map(AnimatedNode::key_times).collect();
    if keys.is_empty() {
        let what = format!("animation {} moves neither \"{node}\" nor an ancestor", clip_name(clip));
        let remedy = "select another node with --joint, or another animation with --clip";
        return Err(error(source, "animations", what, "an animation that moves the node", remedy));
    }
    let start = keys.iter().copied().fold(f64::INFINITY, f64::min);
    let end = keys.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if end - start > MAX_DURATION {
        let what = format!("the animation lasts {} s", end - start);
        let allowed = format!("at most {MAX_DURATION} s");
        return Err(error(source, "animations", what, &allowed, "export a part of it"));
    }
    let rate = rate(chain.iter().flat_map(AnimatedNode::key_steps).collect());
    let count = ((end - start) * rate + 1e-6).floor() as usize + 1;
    notes.push(format!(
        "animation {}: keyframes from {start:.3} to {end:.3} s, sampled at {rate} per second",
        clip_name(clip)
    ));
    Ok(SampleTimes { start, rate, count })
}

/// Sampling rate for keyframes with these steps: the reciprocal of the median, within [`RATES`].
fn rate(mut steps: Vec<f64>) -> f64 {
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).map_or(DEFAULT_RATE, |step| snap_rate(1.0 / step)).clamp(RATES[0], RATES[1])
}

#[cfg(test)]
mod tests {
    use super::buffers::tests::to_base64;
    use super::*;
    use crate::import::motion::rotation;
    use proptest::prelude::*;

    /// A head on a body with scale 0.5 at x = 1 m. The head turns 90° about Y within 1 s; its keys are 0.5 s
    /// apart.
    fn file(how: &str) -> String {
        let half = std::f32::consts::FRAC_PI_8;
        let turns = [0.0, half, 2.0 * half].map(|a: f32| [0.0, a.sin(), 0.0, a.cos()]);
        let each = |q: [f32; 4]| if how == "CUBICSPLINE" { vec![[0.0; 4], q, [0.0; 4]] } else { vec![q] };
        let numbers = [0.5f32, 1.0, 1.5].into_iter().chain(turns.into_iter().flat_map(each).flatten());
        let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
        let count = (bytes.len() - 12) / 16;
        serde_json::json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{}", to_base64(&bytes)) }],
            "bufferViews": [
                { "buffer": 0, "byteLength": 12 },
                { "buffer": 0, "byteOffset": 12, "byteLength": bytes.len() - 12 },
            ],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": 3, "type": "SCALAR", "min": [0.5], "max": [1.5] },
                { "bufferView": 1, "componentType": 5126, "count": count, "type": "VEC4" },
            ],
            "nodes": [
                { "name": "body", "children": [1], "scale": [0.5, 0.5, 0.5], "translation": [1, 0, 0] },
                { "name": "head", "translation": [0, 3, 0] },
            ],
            "animations": [{
                "name": "turn",
                "samplers": [{ "input": 0, "output": 1, "interpolation": how }],
                "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }],
            }],
        })
        .to_string()
    }

    fn read(text: &str, node: &str, clip: Option<&str>) -> Result<Motion> {
        let joint = JointSelector { name: Some(node.into()), clip: clip.map(String::from) };
        parse(&Source::new("a.gltf"), &joint, text.as_bytes())
    }

    #[test]
    fn a_node_moves_with_its_ancestors() {
        for (how, quarter) in [("LINEAR", 22.5), ("STEP", 0.0), ("CUBICSPLINE", 22.5)] {
            let motion = read(&file(how), "head", None).unwrap();
            // Keys 0.5 s apart are sampled at the lowest rate.
            assert_eq!((motion.rate, motion.poses.len()), (10.0, 11), "{how}");
            assert!(motion.poses.iter().all(|p| p.translation == [1.0, 1.5, 0.0]));
            let degrees = |i: usize| rotation(motion.poses[i].rotation_wxyz).angle().to_degrees();
            assert!(
                degrees(0) < 1e-3 && (degrees(5) - 45.0).abs() < 1e-3 && (degrees(10) - 90.0).abs() < 1e-3
            );
            let middle = 0.5 * (degrees(2) + degrees(3));
            assert!((middle - quarter).abs() < 0.2, "{how}: {middle}");
            let bind = motion.bind.unwrap();
            assert!(bind.translation == [1.0, 1.5, 0.0] && rotation(bind.rotation_wxyz).angle() < 1e-6);
            assert!(motion.warnings.is_empty(), "the scale is constant");
        }
    }

    #[test]
    fn errors_name_their_key() {
        let what = |text: String, node: &str, clip| match read(&text, node, clip) {
            Err(Error::BadInput(diagnostics)) => diagnostics
                .iter()
                .map(|p| format!("{}: {} ({})", p.key, p.message, p.allowed))
                .collect::<String>(),
            other => panic!("{other:?}"),
        };
        let valid = || file("LINEAR");
        assert!(what(valid(), "nose", None).contains("no node is named \"nose\" (one of: body, head)"));
        assert!(
            what(valid(), "head", Some("run")).contains("no animation is named \"run\" (one of: \"turn\")")
        );
        assert!(what(valid(), "body", None).contains("moves neither \"body\""));
        let cut = valid().replace("\"count\":3,\"type\":\"SCALAR\"", "\"count\":9000,\"type\":\"SCALAR\"");
        assert!(
            what(cut, "head", None).contains("channels[0]: the input accessor has 9000 elements, beyond")
        );
        let few = valid().replace("\"count\":3,\"type\":\"VEC4\"", "\"count\":2,\"type\":\"VEC4\"");
        assert!(what(few, "head", None).contains("2 values for 3 keys"));
        let away = valid().replace("data:application/octet-stream;base64,", "../../etc/");
        assert!(what(away, "head", None).contains("not a plain file name"));
        assert!(what("{".into(), "head", None).contains("not valid glTF"));
        let wrong = valid().replace("\"rotation\"", "\"rotatio \"");
        assert!(what(wrong, "head", None).contains("target.path: not a value"));
        let wrong = valid().replace("\"LINEAR\"", "\"LINEA\"");
        assert!(what(wrong, "head", None).contains("interpolation"));
    }

    proptest! {
        #[test]
        fn mutated_files_never_panic(edits in prop::collection::vec((0usize..2000, any::<u8>()), 0..6)) {
            let mut bytes = file("LINEAR").into_bytes();
            for (at, value) in edits {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            let joint = JointSelector { name: Some("head".into()), clip: None };
            let _ = parse(&Source::new("a.gltf"), &joint, &bytes);
        }
    }
}
