//! Meshes of a glTF file, at rest and over time: nodes, skins and morph targets.

use super::keyframes::{AnimatedNode, Keyframes, check};
use super::{ancestors, error, open, select_clip};
use crate::geometry::TriMesh;
use crate::import::plain::{Declared, Field, Paint, PlainMesh, SampleTimes, UV};
use crate::import::source::Source;
use crate::scene::UpAxis;
use crate::{Diagnostic, Error, Result};
use gltf::accessor::{DataType, Dimensions};
use gltf::animation::Property;
use gltf::mesh::{Mode, Primitive};
use gltf::{Document, Semantic};
use nalgebra::{Matrix4, Vector3};

/// Largest displacement of a vertex, relative to the size of the mesh, that counts as none.
const STILL: f64 = 1e-6;

/// Triangles of one primitive.
struct Part {
    /// The node that holds the mesh.
    node: usize,
    positions: Vec<Vector3<f64>>,
    triangles: Vec<[u32; 3]>,
    /// Displacements of each morph target.
    targets: Vec<Vec<Vector3<f64>>>,
    skin: Option<Binding>,
    /// Name, size and values at the vertices of each field.
    fields: Vec<(&'static str, usize, Vec<Vector3<f64>>)>,
    /// Names of its material, mesh and node.
    names: Vec<String>,
}

/// The name of the field of vertex colours.
const COLOUR: &str = "COLOR_0";

/// The joints that a part follows.
struct Binding {
    /// Nodes of the joints, with the matrices from the space of the mesh to theirs at rest.
    joints: Vec<(usize, Matrix4<f64>)>,
    /// Joints and weights, of sum 1, of each vertex.
    weights: Vec<[(u16, f64); 4]>,
}

/// Nodes and morph targets over time.
struct Rig {
    nodes: Vec<AnimatedNode>,
    /// Each node with its ancestors, root first.
    chains: Vec<Vec<usize>>,
    /// Weights of the morph targets of each node's mesh without animation.
    rest_weights: Vec<Vec<f64>>,
    /// The same over time; empty without animation.
    weights: Vec<Vec<Keyframes>>,
}

/// Reads all triangles as one mesh, in world space at the nodes' own transforms and, if it deforms, at
/// `times`.
///
/// # Errors
/// Every error in the file.
pub(crate) fn read(source: &Source, times: Option<&SampleTimes>) -> Result<PlainMesh> {
    let (document, buffers) = open(source, &source.read()?)?;
    let (parts, mut notes) = parts(source, &document, &buffers)?;
    let mut rig = Rig::new(&document);
    let still = |t: Option<f64>| {
        let globals = rig.globals(t);
        parts.iter().flat_map(|part| part.vertices(&globals, &rig.weights_at(part.node, t))).collect()
    };
    let vertices: Vec<Vector3<f64>> = still(None);
    let mut triangles = Vec::new();
    let mut first = 0;
    for part in &parts {
        triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
        first += part.positions.len() as u32;
    }
    let mut samples = Vec::new();
    if let Some(times) = times.filter(|_| document.animations().len() > 0) {
        let start = rig.animate(source, &document, &buffers, times, &mut notes)?;
        let seconds = |k: usize| start + (times.start + times.step * k as f64 - times.origin) / times.rate;
        let sample = |t: f64| -> Vec<Vector3<f64>> {
            let globals = rig.globals(Some(t));
            parts
                .iter()
                .flat_map(|part| part.vertices(&globals, &rig.weights_at(part.node, Some(t))))
                .collect()
        };
        samples = (0..times.count).map(|k| sample(seconds(k))).collect();
        if !deforms(&samples) {
            samples.clear();
        }
    }
    Ok(PlainMesh {
        mesh: TriMesh { vertices, triangles },
        samples,
        paint: paint(&parts),
        declared: Declared { metres_per_unit: Some(1.0), up: Some(UpAxis::Y) },
        notes,
        ..PlainMesh::default()
    })
}

/// What is painted on all parts: fields that each of them has, and the triangles of each name.
fn paint(parts: &[Part]) -> Paint {
    let values = |part: &Part, name: &str| part.fields.iter().position(|field| field.0 == name);
    let mut paint = Paint::default();
    for (name, size) in [(UV, 2), (COLOUR, 3)] {
        if parts.iter().all(|part| values(part, name).is_some()) {
            let corners = parts.iter().filter_map(|part| Some((part, values(part, name)?)));
            let corners = corners.flat_map(|(part, k)| {
                part.triangles.iter().map(move |t| t.map(|v| part.fields[k].2[v as usize]))
            });
            paint.fields.push(Field { name: name.into(), size, corners: corners.collect() });
            paint.known.push(name.into());
        }
    }
    let mut first = 0;
    for part in parts {
        let own = first..first + part.triangles.len() as u32;
        first = own.end;
        for name in &part.names {
            match paint.parts.iter_mut().find(|(known, _)| known == name) {
                Some((_, triangles)) => triangles.extend(own.clone()),
                None => paint.parts.push((name.clone(), own.clone().collect())),
            }
        }
    }
    paint
}

/// Whether vertices move.
fn deforms(samples: &[Vec<Vector3<f64>>]) -> bool {
    let Some(first) = samples.first() else { return false };
    let size = first.iter().map(|x| x.amax()).fold(0.0, f64::max);
    samples.iter().any(|sample| sample.iter().zip(first).any(|(a, b)| (a - b).amax() > STILL * size))
}

impl Rig {
    /// The nodes without animation.
    fn new(document: &Document) -> Self {
        let count = document.nodes().count();
        let rest_weights = |node: gltf::Node| {
            let own = node.weights().or_else(|| node.mesh().and_then(|mesh| mesh.weights()));
            own.unwrap_or_default().iter().map(|w| f64::from(*w)).collect()
        };
        Rig {
            nodes: (0..count).map(|node| AnimatedNode::new(document, node)).collect(),
            chains: (0..count).map(|node| ancestors(document, node)).collect(),
            rest_weights: document.nodes().map(rest_weights).collect(),
            weights: vec![Vec::new(); count],
        }
    }

    /// Adds the selected animation; returns when its motion starts: that of the joint to follow, or of all.
    ///
    /// # Errors
    /// Every faulty channel.
    fn animate(
        &mut self,
        source: &Source,
        document: &Document,
        buffers: &[Vec<u8>],
        times: &SampleTimes,
        notes: &mut Vec<String>,
    ) -> Result<f64> {
        let clip = select_clip(source, &times.joint, document, notes)?;
        let mut diagnostics = Vec::new();
        for (i, channel) in clip.channels().enumerate() {
            let node = channel.target().node().index();
            let added = match channel.target().property() {
                Property::MorphTargetWeights => {
                    let targets = document.nodes().nth(node).and_then(|node| node.mesh());
                    let targets = targets
                        .and_then(|mesh| mesh.primitives().next())
                        .map_or(0, |primitive| primitive.morph_targets().count());
                    Keyframes::of_weights(&channel, targets, buffers).map(|keys| self.weights[node] = keys)
                }
                _ => self.nodes[node].add(&channel, buffers),
            };
            if let Err(what) = added {
                let key = format!("animations[{}].channels[{i}]", clip.index());
                let allowed = "keyframes as glTF 2.0 defines them";
                diagnostics.push(Diagnostic::new(&source.path, key, what, allowed, "export it again"));
            }
        }
        Error::if_any(diagnostics)?;
        let named = |node: &gltf::Node| times.joint.name.as_ref() == Some(&super::node_name(node));
        let of_joint = document.nodes().find(named).map(|node| &self.chains[node.index()]);
        let first = |keys: &mut dyn Iterator<Item = f64>| keys.reduce(f64::min);
        let joint = of_joint
            .and_then(|chain| first(&mut chain.iter().flat_map(|node| self.nodes[*node].key_times())));
        let all = self.nodes.iter().flat_map(AnimatedNode::key_times);
        let weights = self.weights.iter().flatten().flat_map(|keys| keys.times().iter().copied());
        Ok(joint.or_else(|| first(&mut all.chain(weights))).unwrap_or(0.0))
    }

    /// Transforms of all nodes to the world at time `t`, s, or without animation.
    fn globals(&self, t: Option<f64>) -> Vec<Matrix4<f64>> {
        let local = |node: &usize| t.map_or(self.nodes[*node].rest, |t| self.nodes[*node].at(t));
        let global = |chain: &Vec<usize>| chain.iter().map(local).product();
        self.chains.iter().map(global).collect()
    }

    /// Weights of the morph targets of the mesh of `node` at time `t`, s, or without animation.
    fn weights_at(&self, node: usize, t: Option<f64>) -> Vec<f64> {
        match t.filter(|_| !self.weights[node].is_empty()) {
            Some(t) => self.weights[node].iter().map(|keys| keys.at(t, false).x).collect(),
            None => self.rest_weights[node].clone(),
        }
    }
}

impl Part {
    /// Its vertices in the world with the nodes at `globals` and these weights of the morph targets.
    fn vertices(&self, globals: &[Matrix4<f64>], weights: &[f64]) -> Vec<Vector3<f64>> {
        let joints: Vec<Matrix4<f64>> = match &self.skin {
            Some(skin) => skin.joints.iter().map(|(node, inverse)| globals[*node] * inverse).collect(),
            None => Vec::new(),
        };
        let vertex = |(v, x): (usize, &Vector3<f64>)| {
            let moved = self.targets.iter().zip(weights).map(|(target, weight)| target[v] * *weight);
            let x = (x + moved.sum::<Vector3<f64>>()).push(1.0);
            match &self.skin {
                // Joints carry a skinned mesh; its node does not.
                Some(skin) => {
                    skin.weights[v].iter().map(|(j, w)| (joints[usize::from(*j)] * x).xyz() * *w).sum()
                }
                None => (globals[self.node] * x).xyz(),
            }
        };
        self.positions.iter().enumerate().map(vertex).collect()
    }
}

/// The triangles of all meshes of the file.
///
/// # Errors
/// Every faulty primitive; a file without triangles.
fn parts(source: &Source, document: &Document, buffers: &[Vec<u8>]) -> Result<(Vec<Part>, Vec<String>)> {
    let (mut parts, mut notes, mut diagnostics) = (Vec::new(), Vec::new(), Vec::new());
    for node in document.nodes() {
        let Some(mesh) = node.mesh() else { continue };
        for primitive in mesh.primitives() {
            let key = format!("meshes[{}].primitives[{}]", mesh.index(), primitive.index());
            if primitive.mode() != Mode::Triangles {
                notes.push(format!("{key}: {:?}, left out", primitive.mode()));
                continue;
            }
            match part(document, &node, &primitive, buffers) {
                Ok(part) => parts.push(part),
                Err(what) => diagnostics.push(Diagnostic::new(
                    &source.path,
                    key,
                    what,
                    "plain accessors within the buffers, as glTF 2.0 defines them",
                    "export it again, without compression and sparse accessors",
                )),
            }
        }
    }
    Error::if_any(diagnostics)?;
    if parts.is_empty() {
        let remedy = "name a file with a mesh";
        return Err(error(
            source,
            "meshes",
            "the file holds no triangles".into(),
            "a mesh of triangles",
            remedy,
        ));
    }
    Ok((parts, notes))
}

/// One primitive of the mesh of a node.
///
/// # Errors
/// What is wrong with it.
fn part(
    document: &Document,
    node: &gltf::Node,
    primitive: &Primitive,
    buffers: &[Vec<u8>],
) -> std::result::Result<Part, String> {
    const FLOAT: &[DataType] = &[DataType::F32];
    const INDEX: &[DataType] = &[DataType::U8, DataType::U16, DataType::U32];
    let accessor = |semantic: &Semantic, dimensions: Dimensions, types: &[DataType]| {
        let found = primitive.get(semantic).ok_or_else(|| format!("has no {}", semantic.to_string()))?;
        check(&found, dimensions, types, buffers)
            .map_err(|what| format!("the accessor of {} {what}", semantic.to_string()))?;
        Ok::<usize, String>(found.count())
    };
    let count = accessor(&Semantic::Positions, Dimensions::Vec3, FLOAT)?;
    if let Some(indices) = primitive.indices() {
        check(&indices, Dimensions::Scalar, INDEX, buffers)
            .map_err(|what| format!("its indices: it {what}"))?;
    }
    let reader = primitive.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
    let vector = |x: [f32; 3]| Vector3::from(x.map(f64::from));
    let positions: Vec<_> = reader.read_positions().into_iter().flatten().map(vector).collect();
    let indices: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0..count as u32).collect(),
    };
    if let Some(bad) = indices.iter().find(|i| **i as usize >= count) {
        return Err(format!("vertex {bad} of {count}"));
    }
    for target in primitive.morph_targets() {
        if let Some(moved) = target.positions() {
            check(&moved, Dimensions::Vec3, FLOAT, buffers)
                .map_err(|what| format!("a morph target {what}"))?;
            if moved.count() != count {
                return Err(format!("a morph target of {} vertices, not {count}", moved.count()));
            }
        }
    }
    let targets = reader.read_morph_targets().map(|(moved, _, _)| match moved {
        Some(moved) => moved.map(vector).collect(),
        None => vec![Vector3::zeros(); count],
    });
    let targets: Vec<Vec<_>> = targets.collect();
    let numbers = positions.iter().chain(targets.iter().flatten()).flat_map(|x| x.iter());
    if numbers.into_iter().any(|x| !x.is_finite()) {
        return Err("a position is not a number".into());
    }
    let skin = match node.skin() {
        None => None,
        Some(skin) => {
            if primitive.get(&Semantic::Joints(1)).is_some() {
                return Err("has more than four joints per vertex (JOINTS_1)".into());
            }
            const JOINT: &[DataType] = &[DataType::U8, DataType::U16];
            const WEIGHT: &[DataType] = &[DataType::F32, DataType::U8, DataType::U16];
            let of_each = [
                accessor(&Semantic::Joints(0), Dimensions::Vec4, JOINT)?,
                accessor(&Semantic::Weights(0), Dimensions::Vec4, WEIGHT)?,
            ];
            if of_each != [count; 2] {
                return Err(format!("joints and weights of {of_each:?} vertices, not {count}"));
            }
            let joints = reader.read_joints(0).into_iter().flat_map(|all| all.into_u16());
            let weights = reader.read_weights(0).into_iter().flat_map(|all| all.into_f32());
            Some(binding(document, &skin, joints.zip(weights), buffers)?)
        }
    };
    let triangles = indices.as_chunks().0.to_vec();
    let mut fields = Vec::new();
    const NUMBERS: &[DataType] = &[DataType::F32, DataType::U8, DataType::U16];
    // A mesh can be read without them.
    let sound = |semantic: &Semantic, dimensions| accessor(semantic, dimensions, NUMBERS) == Ok(count);
    if sound(&Semantic::TexCoords(0), Dimensions::Vec2) {
        let uv = reader.read_tex_coords(0).into_iter().flat_map(|uv| uv.into_f32());
        fields.push((UV, 2, uv.map(|[u, v]| Vector3::new(u.into(), v.into(), 0.0)).collect()));
    }
    let colours = Semantic::Colors(0);
    if [Dimensions::Vec3, Dimensions::Vec4].into_iter().any(|dimensions| sound(&colours, dimensions)) {
        let colours = reader.read_colors(0).into_iter().flat_map(|colours| colours.into_rgb_f32());
        fields.push((COLOUR, 3, colours.map(|rgb| Vector3::from(rgb.map(f64::from))).collect()));
    }
    let names = [primitive.material().name(), node.mesh().and_then(|mesh| mesh.name()), node.name()];
    let mut names: Vec<String> = names.into_iter().flatten().map(String::from).collect();
    names.dedup();
    Ok(Part { node: node.index(), positions, triangles, targets, skin, fields, names })
}

/// The joints of a skin, and those of each vertex with their weights.
///
/// # Errors
/// What is wrong with them.
fn binding(
    document: &Document,
    skin: &gltf::Skin,
    of_vertices: impl Iterator<Item = ([u16; 4], [f32; 4])>,
    buffers: &[Vec<u8>],
) -> std::result::Result<Binding, String> {
    let nodes: Vec<usize> = skin.joints().map(|joint| joint.index()).collect();
    let mut inverse = vec![Matrix4::identity(); nodes.len()];
    if let Some(accessor) = skin.inverse_bind_matrices() {
        check(&accessor, Dimensions::Mat4, &[DataType::F32], buffers)
            .map_err(|what| format!("the inverse bind matrices: the accessor {what}"))?;
        let reader = skin.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
        let read: Vec<_> = reader.read_inverse_bind_matrices().into_iter().flatten().collect();
        if read.len() < nodes.len() {
            return Err(format!("{} inverse bind matrices for {} joints", read.len(), nodes.len()));
        }
        for (matrix, columns) in inverse.iter_mut().zip(read) {
            *matrix = Matrix4::from_fn(|row, column| f64::from(columns[column][row]));
        }
    }
    if inverse.iter().any(|matrix| matrix.iter().any(|x| !x.is_finite())) {
        return Err("an inverse bind matrix is not finite".into());
    }
    let known = document.nodes().count();
    let weights = of_vertices.enumerate().map(|(v, (joints, weights))| {
        let sum: f64 = weights.iter().map(|w| f64::from(*w)).sum();
        let used = joints.iter().zip(weights).filter(|(_, w)| *w != 0.0);
        if used.into_iter().any(|(j, _)| nodes.get(usize::from(*j)).is_none_or(|node| *node >= known)) {
            return Err(format!("vertex {v} follows joints {joints:?} of {}", nodes.len()));
        }
        if !sum.is_finite() || sum < 1e-3 {
            return Err(format!("the weights of vertex {v} have the sum {sum}"));
        }
        // A joint of no weight may be none at all.
        Ok(std::array::from_fn(|i| match f64::from(weights[i]) {
            0.0 => (0, 0.0),
            weight => (joints[i], weight / sum),
        }))
    });
    let weights = weights.collect::<std::result::Result<Vec<_>, String>>()?;
    Ok(Binding { joints: nodes.into_iter().zip(inverse).collect(), weights })
}

#[cfg(test)]
mod tests {
    use super::super::buffers::tests::to_base64;
    use super::*;
    use crate::import::joint_selector::JointSelector;

    /// A triangle whose second and third corner follow a joint at x = 1 m, half and whole, that turns 90°
    /// about z within 1 s from 0.5 s on; its third corner rises by 1 m with a morph target meanwhile.
    fn file(joint: u8) -> String {
        let half = std::f32::consts::FRAC_PI_4;
        let mut bytes: Vec<u8> = Vec::new();
        let mut views = Vec::new();
        let mut view = |part: Vec<u8>| {
            views.push(
                serde_json::json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": part.len() }),
            );
            bytes.extend(part);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        };
        let floats = |all: &[f32]| all.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        view(floats(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 1.0, 0.0]));
        view(vec![0, 0, 0, 0, 0, 1, 0, 0, joint, 0, 0, 0]);
        view(floats(&[1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]));
        let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let mut moved = identity;
        moved[12] = -1.0;
        view(floats(&[identity, moved].concat()));
        view(floats(&[0.5, 1.5]));
        view(floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half.sin(), half.cos()]));
        view(floats(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
        view(floats(&[0.0, 1.0]));
        let accessor = |view: usize, kind: u32, count: usize, shape: &str| {
            serde_json::json!({ "bufferView": view, "componentType": kind, "count": count, "type": shape,
                "min": [0.0, 0.0, 0.0], "max": [2.0, 1.0, 1.0] })
        };
        let plain = |view: usize, kind: u32, count: usize, shape: &str| serde_json::json!({ "bufferView": view, "componentType": kind, "count": count, "type": shape });
        serde_json::json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{}", to_base64(&bytes)) }],
            "bufferViews": views,
            "accessors": [
                accessor(0, 5126, 3, "VEC3"), plain(1, 5121, 3, "VEC4"), plain(2, 5126, 3, "VEC4"),
                plain(3, 5126, 2, "MAT4"),
                { "bufferView": 4, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0.5], "max": [1.5] },
                 plain(5, 5126, 2, "VEC4"), accessor(6, 5126, 3, "VEC3"),
                plain(7, 5126, 2, "SCALAR"),
            ],
            "meshes": [{ "primitives": [{
                "attributes": { "POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2 }, "targets": [{ "POSITION": 6 }],
            }] }],
            "skins": [{ "joints": [1, 2], "inverseBindMatrices": 3 }],
            "nodes": [
                { "name": "body", "mesh": 0, "skin": 0, "translation": [7, 7, 7] },
                { "name": "root", "children": [2], "translation": [0, 0, 3] },
                { "name": "tip", "translation": [1, 0, 0] },
            ],
            "animations": [{
                "samplers": [{ "input": 4, "output": 5 }, { "input": 4, "output": 7 }],
                "channels": [
                    { "sampler": 0, "target": { "node": 2, "path": "rotation" } },
                    { "sampler": 1, "target": { "node": 0, "path": "weights" } },
                ],
            }],
        })
        .to_string()
    }

    fn read_text(text: &str, times: Option<&SampleTimes>) -> Result<PlainMesh> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, text).unwrap();
        read(&Source::new(path), times)
    }

    #[test]
    fn a_mesh_follows_its_joints_and_morph_targets_from_the_start_of_the_motion() {
        // Frame 10 is the first sample of the motion, at 2 frames a second.
        let times = SampleTimes {
            start: 10.0,
            step: 1.0,
            count: 3,
            origin: 10.0,
            rate: 2.0,
            joint: JointSelector::default(),
            carrier: None,
            from_world: None,
        };
        let found = read_text(&file(0), Some(&times)).unwrap();
        let near = |found: &[Vector3<f64>], expected: [[f64; 3]; 3]| {
            assert_eq!(found.len(), expected.len());
            for (x, expected) in found.iter().zip(expected) {
                assert!((x - Vector3::from(expected)).norm() < 1e-6, "{found:?}");
            }
        };
        // The root carries the mesh, and not its own node.
        let rest = [[0.0, 0.0, 3.0], [2.0, 0.0, 3.0], [2.0, 1.0, 3.0]];
        near(&found.mesh.vertices, rest);
        assert_eq!((found.mesh.triangles.len(), found.samples.len()), (1, 3));
        near(&found.samples[0], rest);
        // Half way to (1, 1), and risen.
        near(&found.samples[2], [[0.0, 0.0, 3.0], [1.5, 0.5, 3.0], [2.0, 1.0, 4.0]]);
        assert_eq!(read_text(&file(0), None).unwrap().samples.len(), 0);
    }

    #[test]
    fn errors_name_their_primitive() {
        let what = |text: String| match read_text(&text, None) {
            Err(Error::BadInput(found)) => {
                found.iter().map(|d| format!("{}: {} ", d.key, d.message)).collect()
            }
            other => panic!("{other:?}"),
        };
        let text: String = what(file(9));
        assert!(
            text.contains("meshes[0].primitives[0]: vertex 2 follows joints [9, 0, 0, 0] of 2"),
            "{text}"
        );
        let text = what(file(0).replace("\"JOINTS_0\":1,", "\"JOINTS_0\":1,\"JOINTS_1\":1,"));
        assert!(text.contains("has more than four joints per vertex"), "{text}");
        let text = what(file(0).replacen("\"count\":3", "\"count\":4000", 1));
        assert!(text.contains("POSITION has 4000 elements, beyond"), "{text}");
    }
}
