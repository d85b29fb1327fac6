//! Arrays of a cache by name, and NumPy's file format for them.

use super::{CurveFrame, CurveSet, Frame, Header, HeldGuides};

/// The curves that have arrays.
pub const CURVES: [&str; 2] = ["hair", "guides"];
/// Arrays of curves that do not move, with what they hold.
pub const FIXED: [(&str, &str); 13] = [
    ("counts", "number of points of each curve"),
    ("rest", "points in rest space, units"),
    ("arc", "arc length of the rod from the root to each point, units, of guides"),
    ("widths", "diameter at each point, units"),
    ("ids", "id of each curve"),
    ("groups", "group of each curve"),
    ("guide", "1 for a simulated guide, 0 for a render strand"),
    ("root_uv", "texture coordinate of each root"),
    ("loose", "1 for a curve whose root nothing holds, in caches that have such"),
    ("closest_guides", "ids of the guides that each strand follows"),
    ("guide_weights", "their weights"),
    ("tie_guides", "id of the guide that each tie force acts on, in caches that have them"),
    ("tie_numbers", "numbers of the ties in the animation, from 0"),
];
/// Arrays of curves that move, with what they hold.
pub const MOVING: [(&str, &str); 10] = [
    ("points", "points, world, units"),
    ("velocities", "velocities, units per second"),
    ("accelerations", "accelerations, units per second squared, in caches that have them"),
    ("levels", "level of the wisp of each curve, 0 for the coarsest, in caches that have them"),
    ("arrived", "1 for a guide that the solver brought to a moment, in caches of its steps"),
    ("normals", "first axis of the section at each point, world, in caches that have them"),
    ("clamp_forces", "force of the clamp on each guide, world, N, in caches that have them"),
    ("clamp_moments", "moment of the clamp on each guide about its root, N m"),
    ("tie_forces", "force of each tie on a guide, N"),
    ("tie_moments", "moment of each tie on a guide about the place that it holds, N m"),
];
/// The transform of the head, which moves.
pub const HEAD: (&str, &str) = ("head", "transform of the head, rest space to world, for column vectors");

/// An array of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// The values, the last axis fastest.
    pub values: Values,
}

/// The numbers of an [`Array`].
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// 32-bit integers.
    I32(Vec<i32>),
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 64-bit floats.
    F64(Vec<f64>),
}

impl Array {
    fn integers(values: &[i32]) -> Self {
        Array { shape: vec![values.len()], values: Values::I32(values.to_vec()) }
    }

    fn floats(values: &[f32]) -> Self {
        Array { shape: vec![values.len()], values: Values::F32(values.to_vec()) }
    }

    fn vectors<const D: usize>(values: &[[f32; D]]) -> Self {
        Array { shape: vec![values.len(), D], values: Values::F32(values.concat()) }
    }

    /// The same values in rows of `length`.
    fn in_rows(mut self, length: usize) -> Self {
        self.shape = vec![self.shape[0] / length, length];
        self
    }

    /// The array `name` that does not move, such as `hair.counts`; `None` if the cache has none.
    pub fn fixed(header: &Header, name: &str) -> Option<Self> {
        let (curves, name) = name.split_once('.')?;
        let set = match curves {
            "hair" => header.hair.as_ref()?,
            "guides" => &header.guides,
            _ => return None,
        };
        let held = header.reactions.as_ref().filter(|_| curves == "guides");
        fixed(set, held, name)
    }

    /// The array `name` of a frame, such as `hair.points`; `None` if the cache has none.
    pub fn moving(frame: &Frame, name: &str) -> Option<Self> {
        if name == HEAD.0 {
            return Some(Array { shape: vec![4, 4], values: Values::F64(frame.head.concat()) });
        }
        let (curves, name) = name.split_once('.')?;
        let set = match curves {
            "hair" => frame.hair.as_ref()?,
            "guides" => &frame.guides,
            _ => return None,
        };
        moving(set, name)
    }

    /// The values, little-endian.
    pub fn bytes(&self) -> Vec<u8> {
        match &self.values {
            Values::I32(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Values::F32(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Values::F64(values) => values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        }
    }

    /// The header of an `.npy` file (NumPy Enhancement Proposal 1) of `count` arrays like this, or of this
    /// array alone.
    pub fn npy_header(&self, count: Option<usize>) -> Vec<u8> {
        let kind = match self.values {
            Values::I32(_) => "<i4",
            Values::F32(_) => "<f4",
            Values::F64(_) => "<f8",
        };
        let axes: String = count.iter().chain(&self.shape).map(|length| format!("{length}, ")).collect();
        let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({axes}), }}");
        // The values begin at a multiple of 64.
        let (start, block) = (10, 64);
        let length = (start + text.len() + 1).next_multiple_of(block) - start;
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((length as u16).to_le_bytes());
        bytes.extend(format!("{text:<width$}\n", width = length - 1).bytes());
        bytes
    }
}

fn fixed(set: &CurveSet, held: Option<&HeldGuides>, name: &str) -> Option<Array> {
    let per_strand = super::ClosestGuides::PER_STRAND;
    let array = match name {
        "counts" => Array::integers(&set.counts),
        "rest" => Array::vectors(&set.rest),
        "arc" => Array::floats(&set.arc),
        "widths" => Array::floats(&set.widths),
        "ids" => Array::integers(&set.id),
        "groups" => Array::integers(&set.group),
        "guide" => Array::integers(&set.guide),
        "root_uv" => Array::vectors(&set.root_uv),
        "loose" => Array::integers(&set.loose),
        "closest_guides" => Array::integers(&set.closest.guides).in_rows(per_strand),
        "guide_weights" => Array::floats(&set.closest.weights).in_rows(per_strand),
        "tie_guides" => Array::integers(&held?.guide),
        "tie_numbers" => Array::integers(&held?.number),
        _ => return None,
    };
    Some(array).filter(|array| array.shape[0] > 0)
}

fn moving(set: &CurveFrame, name: &str) -> Option<Array> {
    let array = match name {
        "points" => Array::vectors(&set.points),
        "velocities" => Array::vectors(&set.velocities),
        "accelerations" => Array::vectors(set.accelerations.as_ref()?),
        "levels" => Array::integers(set.level.as_ref()?),
        "arrived" => Array::integers(set.arrived.as_ref()?),
        "normals" => Array::vectors(set.normals.as_ref()?),
        "clamp_forces" => Array::vectors(&set.reactions.as_ref()?.clamp_force),
        "clamp_moments" => Array::vectors(&set.reactions.as_ref()?.clamp_moment),
        "tie_forces" => Array::vectors(&set.reactions.as_ref()?.tie_force),
        "tie_moments" => Array::vectors(&set.reactions.as_ref()?.tie_moment),
        _ => return None,
    };
    Some(array).filter(|array| array.shape[0] > 0)
}

#[cfg(test)]
mod tests {
    use super::super::Reactions;
    use super::*;

    #[test]
    fn the_header_is_that_of_numpy() {
        // numpy.save of zeros((2, 3), '<f4').
        let array = Array::vectors(&[[0.0; 3]; 2]);
        let mut expected = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        expected.extend(b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, ), }");
        expected.resize(127, b' ');
        expected.push(b'\n');
        assert_eq!(array.npy_header(None), expected);
        assert_eq!(array.bytes(), [0; 24]);
        let frames = String::from_utf8_lossy(&array.npy_header(Some(7))).into_owned();
        assert!(frames.contains("'shape': (7, 2, 3, )"), "{frames}");
        assert_eq!(Array::integers(&[1, -2]).bytes(), [1, 0, 0, 0, 254, 255, 255, 255]);
    }

    #[test]
    fn every_name_has_an_array() {
        let set = CurveSet {
            counts: vec![2],
            rest: vec![[0.0; 3]; 2],
            arc: vec![0.0, 1.0],
            widths: vec![1.0; 2],
            id: vec![5],
            group: vec![0],
            group_name: vec!["a".into()],
            guide: vec![0],
            root_uv: vec![[0.0; 2]],
            loose: vec![1],
            closest: super::super::ClosestGuides { guides: vec![1; 3], weights: vec![0.5; 3] },
        };
        let reactions = Some(HeldGuides { guide: vec![5], number: vec![0] });
        let header = Header { hair: Some(set), reactions, ..Header::default() };
        for (name, _) in FIXED {
            // Ties hold guides, which this cache does not write.
            let [hair, guides] =
                ["hair", "guides"].map(|set| Array::fixed(&header, &format!("{set}.{name}")));
            assert_eq!(
                (hair.is_some(), guides.is_some()),
                if name.starts_with("tie") { (false, true) } else { (true, false) },
                "{name}"
            );
        }
        let curves = CurveFrame {
            points: vec![[0.0; 3]; 2],
            velocities: vec![[0.0; 3]; 2],
            accelerations: Some(vec![[0.0; 3]; 2]),
            level: Some(vec![0]),
            arrived: Some(vec![1]),
            normals: Some(vec![[0.0; 3]; 2]),
            reactions: Some(Reactions {
                clamp_force: vec![[0.0; 3]],
                clamp_moment: vec![[0.0; 3]],
                tie_force: vec![[0.0; 3]],
                tie_moment: vec![[0.0; 3]],
            }),
            ..CurveFrame::default()
        };
        let frame = Frame { hair: Some(curves), ..Frame::default() };
        for (name, _) in MOVING {
            assert!(Array::moving(&frame, &format!("hair.{name}")).is_some(), "{name}");
        }
        assert_eq!(Array::moving(&frame, HEAD.0).unwrap().shape, [4, 4]);
        assert_eq!(Array::moving(&frame, "hair.colour"), None);
    }
}
