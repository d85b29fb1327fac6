//! Animated nodes of a glTF file: keyframes and their interpolation.

use gltf::accessor::{DataType, Dimensions};
use gltf::animation::util::ReadOutputs;
use gltf::animation::{Channel, Interpolation, Property};
use gltf::{Accessor, Document};
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};

/// A node and its keyframes.
pub(super) struct AnimatedNode {
    /// Local transform without animation.
    pub(super) rest: Matrix4<f64>,
    /// Translation, rotation (x, y, z, w) and scale without animation.
    rest_parts: [Vector4<f64>; 3],
    keyframes: [Option<Keyframes>; 3],
}

/// Values of one property over time.
#[derive(Debug, Clone)]
pub(super) struct Keyframes {
    times: Vec<f64>,
    /// One per key; for cubic splines three: in-tangent, value, out-tangent.
    values: Vec<Vector4<f64>>,
    interpolation: Interpolation,
}

impl AnimatedNode {
    /// The node without keyframes.
    pub(super) fn new(document: &Document, node: usize) -> Self {
        let node = document.nodes().nth(node);
        let columns = node.as_ref().map(|n| n.transform().matrix());
        let rest = columns
            .map_or_else(Matrix4::identity, |c| Matrix4::from_fn(|row, column| f64::from(c[column][row])));
        let (t, r, s) =
            node.map_or(([0.0; 3], [0.0, 0.0, 0.0, 1.0], [1.0; 3]), |n| n.transform().decomposed());
        AnimatedNode {
            rest,
            rest_parts: [widen(t), Vector4::from(r.map(f64::from)), widen(s)],
            keyframes: [None, None, None],
        }
    }

    /// Adds the keyframes of a channel. Those of morph targets are not its own ([`Keyframes::of_weights`]).
    ///
    /// # Errors
    /// What is wrong with the channel.
    pub(super) fn add(&mut self, channel: &Channel, buffers: &[Vec<u8>]) -> Result<(), String> {
        const FLOAT: &[DataType] = &[DataType::F32];
        const ROTATION: &[DataType] =
            &[DataType::F32, DataType::I8, DataType::U8, DataType::I16, DataType::U16];
        let (part, dimensions, types) = match channel.target().property() {
            Property::Translation => (0, Dimensions::Vec3, FLOAT),
            Property::Rotation => (1, Dimensions::Vec4, ROTATION),
            Property::Scale => (2, Dimensions::Vec3, FLOAT),
            Property::MorphTargetWeights => return Ok(()),
        };
        let sampler = channel.sampler();
        check(&sampler.input(), Dimensions::Scalar, FLOAT, buffers)
            .map_err(|what| format!("the input accessor {what}"))?;
        check(&sampler.output(), dimensions, types, buffers)
            .map_err(|what| format!("the output accessor {what}"))?;
        let reader = channel.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
        let times: Vec<f64> = reader.read_inputs().into_iter().flatten().map(f64::from).collect();
        let values: Vec<Vector4<f64>> = match reader.read_outputs() {
            Some(ReadOutputs::Translations(all)) => all.map(widen).collect(),
            Some(ReadOutputs::Scales(all)) => all.map(widen).collect(),
            Some(ReadOutputs::Rotations(all)) => {
                all.into_f32().map(|q| Vector4::from(q.map(f64::from))).collect()
            }
            _ => Vec::new(),
        };
        self.keyframes[part] = Some(Keyframes::new(times, values, sampler.interpolation())?);
        Ok(())
    }

    /// Times of all keys, s.
    pub(super) fn key_times(&self) -> impl Iterator<Item = f64> + '_ {
        self.keyframes.iter().flatten().flat_map(|keys| keys.times.iter().copied())
    }

    /// Differences between consecutive key times, s.
    pub(super) fn key_steps(&self) -> impl Iterator<Item = f64> + '_ {
        self.keyframes.iter().flatten().flat_map(|keys| keys.times.windows(2).map(|w| w[1] - w[0]))
    }

    /// Local transform at time `t`, s.
    pub(super) fn at(&self, t: f64) -> Matrix4<f64> {
        if self.keyframes.iter().all(Option::is_none) {
            return self.rest;
        }
        let part =
            |i: usize| self.keyframes[i].as_ref().map_or(self.rest_parts[i], |keys| keys.at(t, i == 1));
        let [translation, rotation, scale] = [part(0), part(1), part(2)];
        Matrix4::new_translation(&translation.xyz())
            * UnitQuaternion::from_quaternion(Quaternion::from_vector(rotation)).to_homogeneous()
            * Matrix4::new_nonuniform_scaling(&Vector3::new(scale.x, scale.y, scale.z))
    }
}

impl Keyframes {
    /// Weights of `targets` morph targets over time, each as the first component.
    ///
    /// # Errors
    /// What is wrong with the channel.
    pub(super) fn of_weights(
        channel: &Channel,
        targets: usize,
        buffers: &[Vec<u8>],
    ) -> Result<Vec<Self>, String> {
        const WEIGHT: &[DataType] =
            &[DataType::F32, DataType::I8, DataType::U8, DataType::I16, DataType::U16];
        let sampler = channel.sampler();
        check(&sampler.input(), Dimensions::Scalar, &[DataType::F32], buffers)
            .map_err(|what| format!("the input accessor {what}"))?;
        check(&sampler.output(), Dimensions::Scalar, WEIGHT, buffers)
            .map_err(|what| format!("the output accessor {what}"))?;
        let reader = channel.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
        let times: Vec<f64> = reader.read_inputs().into_iter().flatten().map(f64::from).collect();
        let Some(ReadOutputs::MorphTargetWeights(all)) = reader.read_outputs() else { return Ok(Vec::new()) };
        let all: Vec<f64> = all.into_f32().map(f64::from).collect();
        let of = |target: usize| {
            let own = all.iter().skip(target).step_by(targets);
            let values = own.map(|w| Vector4::new(*w, 0.0, 0.0, 0.0)).collect();
            Keyframes::new(times.clone(), values, sampler.interpolation())
        };
        (0..targets).map(of).collect()
    }

    /// Times of the keys, s.
    pub(super) fn times(&self) -> &[f64] {
        &self.times
    }

    fn new(times: Vec<f64>, values: Vec<Vector4<f64>>, interpolation: Interpolation) -> Result<Self, String> {
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if times.is_empty() || values.len() != per_key * times.len() {
            return Err(format!("{} values for {} keys", values.len(), times.len()));
        }
        if times.windows(2).any(|w| w[0].partial_cmp(&w[1]) != Some(std::cmp::Ordering::Less))
            || !times.iter().all(|t| t.is_finite())
        {
            return Err("the key times do not increase".into());
        }
        if values.iter().any(|v| v.iter().any(|x| !x.is_finite())) {
            return Err("a value is not a number".into());
        }
        Ok(Keyframes { times, values, interpolation })
    }

    /// The value at time `t`, constant before the first and after the last key (glTF 2.0, appendix C). Linear
    /// interpolation is spherical for rotations; cubic splines interpolate the components of quaternions.
    pub(super) fn at(&self, t: f64, is_rotation: bool) -> Vector4<f64> {
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let value = |k: usize| if cubic { self.values[3 * k + 1] } else { self.values[k] };
        let next = self.times.partition_point(|&key| key <= t);
        if next == 0 || next == self.times.len() {
            return value(next.saturating_sub(1));
        }
        let k = next - 1;
        let step = self.times[next] - self.times[k];
        let u = (t - self.times[k]) / step;
        let (a, b) = (value(k), value(next));
        match self.interpolation {
            Interpolation::Step => a,
            Interpolation::Linear if is_rotation => slerp(a, b, u),
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

/// Spherical interpolation of unit quaternions (x, y, z, w) along the shorter arc.
fn slerp(a: Vector4<f64>, b: Vector4<f64>, u: f64) -> Vector4<f64> {
    let [a, b] = [a, b].map(|q| UnitQuaternion::from_quaternion(Quaternion::from_vector(q)));
    a.try_slerp(&b, u, 1e-12).unwrap_or(a).as_vector().into_owned()
}

fn widen(v: [f32; 3]) -> Vector4<f64> {
    Vector4::new(v[0].into(), v[1].into(), v[2].into(), 0.0)
}

/// Checks the type of an accessor and that its elements lie within the buffers; the reader panics otherwise.
pub(super) fn check(
    accessor: &Accessor,
    dimensions: Dimensions,
    types: &[DataType],
    buffers: &[Vec<u8>],
) -> Result<(), String> {
    if accessor.dimensions() != dimensions || !types.contains(&accessor.data_type()) {
        return Err(format!("holds {:?} of {:?}", accessor.dimensions(), accessor.data_type()));
    }
    let view = accessor.view().filter(|_| accessor.sparse().is_none()).ok_or("is sparse or empty")?;
    let stride = view.stride().unwrap_or(accessor.size());
    let end = accessor
        .count()
        .checked_sub(1)
        .and_then(|n| n.checked_mul(stride)?.checked_add(accessor.size())?.checked_add(accessor.offset()));
    let in_view = end.is_some_and(|end| end <= view.length()) && stride >= accessor.size();
    let buffer = buffers.get(view.buffer().index()).map_or(0, Vec::len);
    let in_buffer = view.offset().checked_add(view.length()).is_some_and(|end| end <= buffer);
    if in_view && in_buffer {
        Ok(())
    } else {
        Err(format!("has {} elements, beyond the end of its data", accessor.count()))
    }
}
