//! glTF 2.0 animations (`.gltf`, `.glb`): metres, Y up. Keys lie where the animator put them; the joint is sampled at an even rate.

use super::{Joint, Motion, SCALE_CHANGES, convention, no_joint, rigid_all, whole_if_near};
use crate::import::read::Source;
use crate::scene::UpAxis;
use crate::{Diagnostic, Error, Result};
use gltf::accessor::{DataType, Dimensions};
use gltf::animation::{Interpolation, Property, util::ReadOutputs};
use gltf::json::validation::Checked;
use gltf::{Accessor, Document, Gltf, Node, buffer};
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};
use std::path::Path;

/// Samples a second: at least, and at most. Keys closer together than the second allows are noise.
const RATES: [f64; 2] = [10.0, 240.0];
/// Longest animation, s.
const LONGEST: f64 = 3600.0;
/// Begins a buffer that is in the text itself.
const DATA_URI: &str = "data:";

/// Reads the motion of a node.
///
/// # Errors
/// Every fault that was found.
pub(super) fn parse(source: &Source, joint: &Joint, bytes: &[u8]) -> Result<Motion> {
    let Gltf { document, blob } = Gltf::from_slice(bytes).map_err(|e| {
        fault(
            &source.path,
            "",
            format!("is not sound glTF: {e}"),
            "a .gltf or .glb file of version 2.0",
            "export it again",
        )
    })?;
    Error::if_any(unknown_words(source, &document))?;
    let names: Vec<String> = document.nodes().map(|n| name(&n)).collect();
    let shown: Vec<&str> = names.iter().map(String::as_str).collect();
    let of_name = |asked: &str| names.iter().position(|n| n == asked);
    let node = joint.name.as_deref().and_then(of_name);
    let Some(node) = node else { return Err(no_joint(source, joint.name.as_deref(), &shown, "node")) };

    let mut notes = Vec::new();
    let clip = clip(source, joint, &document, &mut notes)?;
    let buffers = buffers(source, &document, blob)?;
    let chain = chain(&document, node);
    let mut rig: Vec<Animated> = chain.iter().map(|&n| Animated::still(&document, n)).collect();
    let mut problems = Vec::new();
    for (i, channel) in clip.channels().enumerate() {
        let Some(at) = chain.iter().position(|&n| n == channel.target().node().index()) else { continue };
        let key = format!("animations[{}].channels[{i}]", clip.index());
        if let Err(what) = rig[at].add(&channel, &buffers) {
            problems.push(problem(&source.path, &key, what, "keys as glTF 2.0 has them", "export it again"));
        }
    }
    Error::if_any(problems)?;

    let keys: Vec<f64> = rig.iter().flat_map(Animated::keys).collect();
    if keys.is_empty() {
        let what =
            format!("animation {} moves neither \"{}\" nor what is above it", clip_name(&clip), shown[node]);
        return Err(fault(
            &source.path,
            "animations",
            what,
            "an animation of the node",
            "name another node, or another with --clip",
        ));
    }
    let start = keys.iter().copied().fold(f64::INFINITY, f64::min);
    let end = keys.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if end - start > LONGEST {
        let what = format!("lasts {} s", end - start);
        return Err(fault(
            &source.path,
            "animations",
            what,
            &format!("at most {LONGEST} s"),
            "export a part of it",
        ));
    }
    let rate = rate(rig.iter().flat_map(Animated::gaps).collect());
    let count = ((end - start) * rate + 1e-6).floor() as usize + 1;
    notes.push(format!(
        "animation {}: keys from {start:.3} to {end:.3} s, sampled at {rate} a second",
        clip_name(&clip)
    ));
    let world = |t: f64| rig.iter().fold(Matrix4::identity(), |above, node| above * node.at(t));
    let matrices: Vec<_> = (0..count).map(|i| world(start + i as f64 / rate)).collect();
    let key = format!("nodes[{node}]");
    // As the nodes stand without animation. The matrices that bind a skin are in the mesh's own space, wherever that lies.
    let bind = rig.iter().fold(Matrix4::identity(), |above, node| above * node.still);
    let (poses, bind, scales) = rigid_all(source, &key, &matrices, Some(&bind))?;
    Ok(Motion {
        rate,
        numbered: None,
        convention: convention(source, 1.0, UpAxis::Y),
        poses,
        bind,
        prim: None,
        notes,
        warnings: if scales { vec![SCALE_CHANGES.into()] } else { Vec::new() },
    })
}

/// Names in animations that glTF does not know: the reader lets them pass and panics where they are asked for.
fn unknown_words(source: &Source, document: &Document) -> Vec<Diagnostic> {
    let mut problems = Vec::new();
    for (a, animation) in document.as_json().animations.iter().enumerate() {
        let mut unknown = |key: String, allowed: &str| {
            let what = "is a word that glTF does not have".to_string();
            let key = format!("animations[{a}].{key}");
            problems.push(problem(&source.path, &key, what, allowed, "export it again"));
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
    problems
}

fn problem(path: &Path, key: &str, what: String, allowed: &str, remedy: &str) -> Diagnostic {
    Diagnostic::new(path, key, what, allowed, remedy)
}

fn fault(path: &Path, key: &str, what: String, allowed: &str, remedy: &str) -> Error {
    problem(path, key, what, allowed, remedy).into()
}

fn name(node: &Node) -> String {
    node.name().map_or_else(|| format!("node {}", node.index()), String::from)
}

fn clip_name(clip: &gltf::Animation) -> String {
    clip.name().map_or_else(|| clip.index().to_string(), |name| format!("\"{name}\""))
}

/// The animation that is named, or the first.
fn clip<'a>(
    source: &Source,
    joint: &Joint,
    document: &'a Document,
    notes: &mut Vec<String>,
) -> Result<gltf::Animation<'a>> {
    let names: Vec<String> = document.animations().map(|a| clip_name(&a)).collect();
    let wanted = |a: &gltf::Animation| {
        joint.clip.as_deref().is_none_or(|name| a.name() == Some(name) || a.index().to_string() == name)
    };
    let Some(clip) = document.animations().find(wanted) else {
        let asked = joint.clip.as_deref().map_or("none".into(), |name| format!("no animation \"{name}\""));
        let what = format!("has {asked}");
        let allowed =
            if names.is_empty() { "an animation".into() } else { format!("one of: {}", names.join(", ")) };
        return Err(fault(
            &source.path,
            "animations",
            what,
            &allowed,
            "export the animation too, or name another with --clip",
        ));
    };
    if names.len() > 1 && joint.clip.is_none() {
        notes.push(format!(
            "{} animations, the first is taken (--clip for another): {}",
            names.len(),
            names.join(", ")
        ));
    }
    Ok(clip)
}

/// The bytes of every buffer: in the file, beside it, or in its text.
fn buffers(source: &Source, document: &Document, mut blob: Option<Vec<u8>>) -> Result<Vec<Vec<u8>>> {
    let folder = source.path.parent().unwrap_or(Path::new(""));
    let mut problems = Vec::new();
    let mut read = |buffer: buffer::Buffer| -> Result<Vec<u8>> {
        let uri = match buffer.source() {
            buffer::Source::Bin => return Ok(blob.take().unwrap_or_default()),
            buffer::Source::Uri(uri) => uri,
        };
        let key = format!("buffers[{}].uri", buffer.index());
        let told = |what: String| {
            fault(&source.path, &key, what, "a file beside this one, or base64", "export as .glb")
        };
        match uri.strip_prefix(DATA_URI) {
            Some(data) => data
                .split_once(";base64,")
                .and_then(|(_, text)| base64(text))
                .ok_or_else(|| told("is no base64".into())),
            None if crate::file::is_plain_name(uri) => crate::file::read_file(&folder.join(uri))
                .map_err(|e| told(format!("\"{uri}\" cannot be read: {e}"))),
            None => Err(told(format!("\"{uri}\" is no plain file name"))),
        }
    };
    let mut all = Vec::new();
    for buffer in document.buffers() {
        match read(buffer) {
            Err(Error::BadInput(found)) => problems.extend(found),
            bytes => all.push(bytes?),
        }
    }
    Error::if_any(problems)?;
    Ok(all)
}

/// Bytes of base64 (RFC 4648, §4); padding may be absent.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for c in text.trim_end_matches('=').bytes() {
        let six = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        (bits, held) = (bits << 6 | u32::from(six), held + 6);
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    Some(out)
}

/// A node and all above it, the root first.
fn chain(document: &Document, node: usize) -> Vec<usize> {
    let mut parent = vec![None; document.nodes().count()];
    for above in document.nodes() {
        above.children().for_each(|below| parent[below.index()] = Some(above.index()));
    }
    // A file may name a node as its own ancestor.
    let mut chain: Vec<usize> =
        std::iter::successors(Some(node), |&n| parent[n]).take(parent.len()).collect();
    chain.reverse();
    chain
}

/// Transform of a node without animation.
fn local(document: &Document, node: usize) -> Matrix4<f64> {
    let columns = document.nodes().nth(node).map(|n| n.transform().matrix());
    columns.map_or_else(Matrix4::identity, |c| Matrix4::from_fn(|row, column| f64::from(c[column][row])))
}

/// Holds that the numbers of an accessor are there, before they are read.
fn sound(
    accessor: &Accessor,
    dimensions: Dimensions,
    types: &[DataType],
    buffers: &[Vec<u8>],
) -> std::result::Result<(), String> {
    if accessor.dimensions() != dimensions || !types.contains(&accessor.data_type()) {
        return Err(format!("holds {:?} of {:?}", accessor.dimensions(), accessor.data_type()));
    }
    let view = accessor.view().filter(|_| accessor.sparse().is_none()).ok_or("is sparse or empty")?;
    let stride = view.stride().unwrap_or(accessor.size());
    let end = accessor
        .count()
        .checked_sub(1)
        .and_then(|n| n.checked_mul(stride)?.checked_add(accessor.size())?.checked_add(accessor.offset()));
    let fits = end.is_some_and(|end| end <= view.length()) && stride >= accessor.size();
    let there = buffers.get(view.buffer().index()).map_or(0, Vec::len);
    let whole = view.offset().checked_add(view.length()).is_some_and(|end| end <= there);
    if fits && whole {
        Ok(())
    } else {
        Err(format!("names {} elements beyond the end of its data", accessor.count()))
    }
}

/// Values over time.
#[derive(Debug, Clone)]
struct Keys {
    times: Vec<f64>,
    /// One a key; with tangents three: in, value, out.
    values: Vec<Vector4<f64>>,
    how: Interpolation,
}

impl Keys {
    /// The value at a time, held before the first key and after the last. Quaternions on the way from one to the next are what the
    /// four numbers are, or turned evenly where that is asked for (glTF 2.0, appendix C).
    fn at(&self, t: f64, is_turn: bool) -> Vector4<f64> {
        let cubic = self.how == Interpolation::CubicSpline;
        let value = |k: usize| if cubic { self.values[3 * k + 1] } else { self.values[k] };
        let next = self.times.partition_point(|&key| key <= t);
        if next == 0 || next == self.times.len() {
            return value(next.saturating_sub(1));
        }
        let k = next - 1;
        let step = self.times[next] - self.times[k];
        let u = (t - self.times[k]) / step;
        let (a, b) = (value(k), value(next));
        match self.how {
            Interpolation::Step => a,
            Interpolation::Linear if is_turn => slerp(a, b, u),
            Interpolation::Linear => a.lerp(&b, u),
            Interpolation::CubicSpline => {
                let (out, into) = (self.values[3 * k + 2] * step, self.values[3 * next] * step);
                let (u2, u3) = (u * u, u * u * u);
                a * (2.0 * u3 - 3.0 * u2 + 1.0)
                    + out * (u3 - 2.0 * u2 + u)
                    + b * (3.0 * u2 - 2.0 * u3)
                    + into * (u3 - u2)
            }
        }
    }
}

/// Evenly from one turn to another, the shorter way. Components are x, y, z, w.
fn slerp(a: Vector4<f64>, b: Vector4<f64>, u: f64) -> Vector4<f64> {
    let [a, b] = [a, b].map(|q| UnitQuaternion::from_quaternion(Quaternion::from_vector(q)));
    a.try_slerp(&b, u, 1e-12).unwrap_or(a).as_vector().into_owned()
}

/// A node and what animates it.
struct Animated {
    still: Matrix4<f64>,
    /// Translation, rotation, scale without animation.
    usual: [Vector4<f64>; 3],
    keys: [Option<Keys>; 3],
}

impl Animated {
    fn still(document: &Document, node: usize) -> Self {
        let (t, r, s) = document
            .nodes()
            .nth(node)
            .map_or(([0.0; 3], [0.0, 0.0, 0.0, 1.0], [1.0; 3]), |n| n.transform().decomposed());
        let wide = |v: [f32; 3]| Vector4::new(v[0].into(), v[1].into(), v[2].into(), 0.0);
        Animated {
            still: local(document, node),
            usual: [wide(t), Vector4::from(r.map(f64::from)), wide(s)],
            keys: [None, None, None],
        }
    }

    fn add(
        &mut self,
        channel: &gltf::animation::Channel,
        buffers: &[Vec<u8>],
    ) -> std::result::Result<(), String> {
        const FLOAT: &[DataType] = &[DataType::F32];
        const TURN: &[DataType] = &[DataType::F32, DataType::I8, DataType::U8, DataType::I16, DataType::U16];
        let (part, dimensions, types) = match channel.target().property() {
            Property::Translation => (0, Dimensions::Vec3, FLOAT),
            Property::Rotation => (1, Dimensions::Vec4, TURN),
            Property::Scale => (2, Dimensions::Vec3, FLOAT),
            Property::MorphTargetWeights => return Ok(()),
        };
        let sampler = channel.sampler();
        sound(&sampler.input(), Dimensions::Scalar, FLOAT, buffers)
            .map_err(|what| format!("input {what}"))?;
        sound(&sampler.output(), dimensions, types, buffers).map_err(|what| format!("output {what}"))?;
        let reader = channel.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
        let times: Vec<f64> = reader.read_inputs().into_iter().flatten().map(f64::from).collect();
        let wide = |v: [f32; 3]| Vector4::new(v[0].into(), v[1].into(), v[2].into(), 0.0);
        let values: Vec<Vector4<f64>> = match reader.read_outputs() {
            Some(ReadOutputs::Translations(all)) => all.map(wide).collect(),
            Some(ReadOutputs::Scales(all)) => all.map(wide).collect(),
            Some(ReadOutputs::Rotations(all)) => {
                all.into_f32().map(|q| Vector4::from(q.map(f64::from))).collect()
            }
            _ => Vec::new(),
        };
        let how = sampler.interpolation();
        let each = if how == Interpolation::CubicSpline { 3 } else { 1 };
        if times.is_empty() || values.len() != each * times.len() {
            return Err(format!("has {} values for {} keys", values.len(), times.len()));
        }
        if times.windows(2).any(|w| w[0].partial_cmp(&w[1]) != Some(std::cmp::Ordering::Less))
            || !times.iter().all(|t| t.is_finite())
        {
            return Err("has keys that are not in order".into());
        }
        if values.iter().any(|v| v.iter().any(|x| !x.is_finite())) {
            return Err("has values that are no numbers".into());
        }
        self.keys[part] = Some(Keys { times, values, how });
        Ok(())
    }

    fn keys(&self) -> impl Iterator<Item = f64> + '_ {
        self.keys.iter().flatten().flat_map(|keys| keys.times.iter().copied())
    }

    fn gaps(&self) -> impl Iterator<Item = f64> + '_ {
        self.keys.iter().flatten().flat_map(|keys| keys.times.windows(2).map(|w| w[1] - w[0]))
    }

    fn at(&self, t: f64) -> Matrix4<f64> {
        if self.keys.iter().all(Option::is_none) {
            return self.still;
        }
        let part = |i: usize| self.keys[i].as_ref().map_or(self.usual[i], |keys| keys.at(t, i == 1));
        let [shift, turn, scale] = [part(0), part(1), part(2)];
        Matrix4::new_translation(&shift.xyz())
            * UnitQuaternion::from_quaternion(Quaternion::from_vector(turn)).to_homogeneous()
            * Matrix4::new_nonuniform_scaling(&Vector3::new(scale.x, scale.y, scale.z))
    }
}

/// Samples a second for keys so far apart: as the median gap has it.
fn rate(mut gaps: Vec<f64>) -> f64 {
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).map_or(24.0, |gap| whole_if_near(1.0 / gap)).clamp(RATES[0], RATES[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::motion::turn;
    use proptest::prelude::*;

    /// A head on a body that shrinks all by half and stands 1 m to the side; it turns by a quarter about Y in 1 s, in keys half a second apart.
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

    fn to_base64(bytes: &[u8]) -> String {
        const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let group = |part: &[u8]| {
            let bits = part.iter().fold(0u32, |bits, b| bits << 8 | u32::from(*b)) << (8 * (3 - part.len()));
            (0..4).map(move |i| LETTERS[(bits >> (18 - 6 * i) & 63) as usize] as char)
        };
        bytes.chunks(3).flat_map(group).collect()
    }

    fn read(text: &str, node: &str, clip: Option<&str>) -> Result<Motion> {
        let joint = Joint { name: Some(node.into()), clip: clip.map(String::from) };
        parse(&Source::new("a.gltf"), &joint, text.as_bytes())
    }

    #[test]
    fn a_node_goes_with_what_is_above_it() {
        for (how, quarter) in [("LINEAR", 22.5), ("STEP", 0.0), ("CUBICSPLINE", 22.5)] {
            let motion = read(&file(how), "head", None).unwrap();
            // Keys half a second apart are sampled ten times a second.
            assert_eq!((motion.rate, motion.poses.len()), (10.0, 11), "{how}");
            assert!(motion.poses.iter().all(|p| p.translation == [1.0, 1.5, 0.0]));
            let degrees = |i: usize| turn(motion.poses[i].rotation_wxyz).angle().to_degrees();
            assert!(
                degrees(0) < 1e-3 && (degrees(5) - 45.0).abs() < 1e-3 && (degrees(10) - 90.0).abs() < 1e-3
            );
            let middle = 0.5 * (degrees(2) + degrees(3));
            assert!((middle - quarter).abs() < 0.2, "{how}: {middle}");
            let bind = motion.bind.unwrap();
            assert!(bind.translation == [1.0, 1.5, 0.0] && turn(bind.rotation_wxyz).angle() < 1e-6);
            assert!(motion.warnings.is_empty(), "the scale does not change");
        }
    }

    #[test]
    fn faults_are_named() {
        let what = |text: String, node: &str, clip| match read(&text, node, clip) {
            Err(Error::BadInput(problems)) => problems
                .iter()
                .map(|p| format!("{}: {} ({})", p.key, p.message, p.allowed))
                .collect::<String>(),
            other => panic!("{other:?}"),
        };
        let sound = || file("LINEAR");
        assert!(what(sound(), "nose", None).contains("\"nose\" (one of: body, head)"));
        assert!(what(sound(), "head", Some("run")).contains("no animation \"run\" (one of: \"turn\")"));
        assert!(what(sound(), "body", None).contains("moves neither \"body\""));
        let cut = sound().replace("\"count\":3,\"type\":\"SCALAR\"", "\"count\":9000,\"type\":\"SCALAR\"");
        assert!(what(cut, "head", None).contains("channels[0]: input names 9000 elements beyond"));
        let few = sound().replace("\"count\":3,\"type\":\"VEC4\"", "\"count\":2,\"type\":\"VEC4\"");
        assert!(what(few, "head", None).contains("2 values for 3 keys"));
        let away = sound().replace("data:application/octet-stream;base64,", "../../etc/");
        assert!(what(away, "head", None).contains("no plain file name"));
        assert!(what("{".into(), "head", None).contains("not sound glTF"));
        let wrong = sound().replace("\"rotation\"", "\"rotatio \"");
        assert!(what(wrong, "head", None).contains("target.path: is a word"));
        let wrong = sound().replace("\"LINEAR\"", "\"LINEA\"");
        assert!(what(wrong, "head", None).contains("interpolation"));
    }

    #[test]
    fn base64_is_read() {
        for bytes in [&b""[..], b"a", b"ab", b"abc", b"\xff\x00\xfe\x01"] {
            assert_eq!(base64(&to_base64(bytes)[..(8 * bytes.len()).div_ceil(6)]).as_deref(), Some(bytes));
        }
        assert_eq!(base64("YWI=").as_deref(), Some(&b"ab"[..]));
        assert_eq!(base64("Y*I="), None);
    }

    proptest! {
        #[test]
        fn mutated_files_never_panic(edits in prop::collection::vec((0usize..2000, any::<u8>()), 0..6)) {
            let mut bytes = file("LINEAR").into_bytes();
            for (at, value) in edits {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            let joint = Joint { name: Some("head".into()), clip: None };
            let _ = parse(&Source::new("a.gltf"), &joint, &bytes);
        }
    }
}
