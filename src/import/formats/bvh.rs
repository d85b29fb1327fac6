//! Biovision hierarchies (`.bvh`): a skeleton, then one row of channel values per frame.
//!
//! A joint lies at its offset from its parent; position channels replace the offset, as all exporters write
//! them. Rotations are in degrees, about the joint's own axes, in the order of the channels. The format has
//! no unit.

use crate::import::joint_selector::JointSelector;
use crate::import::motion::{Motion, convention, snap_rate, unknown_joint};
use crate::import::source::Source;
use crate::scene::UpAxis;
use crate::scene::anim::file::PoseFile;
use crate::{Diagnostic, Error, Result};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::ops::Range;

/// Default metres per unit: centimetres.
const DEFAULT_METRES_PER_UNIT: f64 = 0.01;
/// Plausible heights of a skeleton, m; others lead to a warning about the unit.
const PLAUSIBLE_HEIGHT: [f64; 2] = [0.5, 3.0];
/// Most rows with errors that are reported one by one.
const MAX_REPORTED: usize = 6;
/// Most joints of a skeleton.
const MAX_JOINTS: usize = 10_000;

/// One channel of a joint: its kind and axis.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Channel {
    Position(usize),
    Rotation(usize),
}

#[derive(Debug)]
struct Bone<'a> {
    name: &'a str,
    parent: Option<usize>,
    offset: Vector3<f64>,
    channels: Vec<Channel>,
    /// Index of its first channel in a row.
    first: usize,
}

/// Reads the motion of a joint.
///
/// # Errors
/// Every error in the file, with its position.
pub(crate) fn parse(source: &Source, joint: &JointSelector, bytes: &[u8]) -> Result<Motion> {
    let text = String::from_utf8_lossy(bytes);
    let mut parser = Parser { source, text: &text, at: 0, diagnostics: Vec::new() };
    let bones = parser.hierarchy();
    let channels = bones.as_ref().map(|bones| bones.iter().map(|b| b.channels.len()).sum());
    let motion = bones.as_ref().and_then(|_| parser.motion(channels));
    Error::if_any(std::mem::take(&mut parser.diagnostics))?;
    let (Some(bones), Some((step, rows))) = (bones, motion) else {
        return Err(Error::Internal("the BVH reader failed without reporting an error".into()));
    };
    let chain = ancestors(&bones, select(source, joint, &bones)?);

    let convention = convention(source, DEFAULT_METRES_PER_UNIT, UpAxis::Y);
    let height = height(&bones, convention.up) * convention.metres_per_unit;
    let mut notes = Vec::new();
    let mut warnings = Vec::new();
    if source.metres_per_unit.is_none() {
        notes.push(format!(
            "BVH has no unit: centimetres, for a skeleton {height:.2} m tall (set --units to override)"
        ));
    }
    if !(PLAUSIBLE_HEIGHT[0]..=PLAUSIBLE_HEIGHT[1]).contains(&height) {
        warnings.push(format!("the skeleton is {height:.2} m tall: check --units"));
    }
    let rest = chain.iter().map(|&b| bones[b].offset).sum::<Vector3<f64>>();
    Ok(Motion {
        rate: snap_rate(1.0 / step),
        numbering: None,
        convention,
        poses: rows.iter().map(|row| pose(&bones, &chain, row)).collect(),
        bind: Some(PoseFile { translation: rest.into(), rotation_wxyz: [1.0, 0.0, 0.0, 0.0] }),
        stage: None,
        notes,
        warnings,
    })
}

/// Index of the selected joint: the one named, or the only one.
fn select(source: &Source, joint: &JointSelector, bones: &[Bone]) -> Result<usize> {
    let found = match joint.name.as_deref() {
        Some(name) => bones.iter().position(|b| b.name == name),
        None => (bones.len() == 1).then_some(0),
    };
    found.ok_or_else(|| {
        let names: Vec<&str> = bones.iter().map(|b| b.name).collect();
        unknown_joint(source, joint.name.as_deref(), &names, "joint")
    })
}

/// A joint and its ancestors, root first.
fn ancestors(bones: &[Bone], joint: usize) -> Vec<usize> {
    let mut chain: Vec<usize> = std::iter::successors(Some(joint), |&b| bones[b].parent).collect();
    chain.reverse();
    chain
}

/// Height of the skeleton in its rest pose, file units.
fn height(bones: &[Bone], up: UpAxis) -> f64 {
    let axis = if up == UpAxis::Z { 2 } else { 1 };
    let mut at: Vec<f64> = Vec::with_capacity(bones.len());
    for bone in bones {
        at.push(bone.parent.map_or(0.0, |p| at[p]) + bone.offset[axis]);
    }
    at.iter().copied().fold(f64::NEG_INFINITY, f64::max) - at.iter().copied().fold(f64::INFINITY, f64::min)
}

/// World pose of the last joint of `chain` for one row of channel values.
fn pose(bones: &[Bone], chain: &[usize], row: &[f64]) -> PoseFile {
    let mut world = Isometry3::identity();
    for &b in chain {
        let bone = &bones[b];
        let (mut at, mut rotation) = (bone.offset, UnitQuaternion::identity());
        for (channel, &value) in bone.channels.iter().zip(&row[bone.first..]) {
            match *channel {
                Channel::Position(axis) => at[axis] = value,
                Channel::Rotation(axis) => {
                    let axis = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()][axis];
                    rotation *= UnitQuaternion::from_axis_angle(&axis, value.to_radians());
                }
            }
        }
        world *= Isometry3::from_parts(Translation3::from(at), rotation);
    }
    let q = world.rotation;
    PoseFile { translation: world.translation.vector.into(), rotation_wxyz: [q.w, q.i, q.j, q.k] }
}

/// The text, the current position in it, and the errors so far.
struct Parser<'a> {
    source: &'a Source,
    text: &'a str,
    at: usize,
    diagnostics: Vec<Diagnostic>,
}

impl<'a> Parser<'a> {
    /// The next word and its byte range.
    fn word(&mut self) -> Option<(&'a str, Range<usize>)> {
        let rest = &self.text[self.at..];
        let start = self.at + rest.find(|c: char| !c.is_whitespace())?;
        let rest = &self.text[start..];
        self.at = start + rest.find(char::is_whitespace).unwrap_or(rest.len());
        Some((&self.text[start..self.at], start..self.at))
    }

    fn error(&mut self, range: Range<usize>, key: &str, what: String, allowed: &str) {
        let remedy = "export the motion again";
        let mut diagnostic = Diagnostic::new(&self.source.path, key, what, allowed, remedy);
        diagnostic.span = Some((range.start, range.len()));
        self.diagnostics.push(diagnostic);
    }

    fn unexpected_end(&mut self, key: &str, expected: &str) {
        let end = self.text.len();
        self.error(end..end, key, format!("the file ends before {expected}"), expected);
    }

    /// The next word if it is one of `words`; reports an error otherwise.
    fn expect(&mut self, words: &[&str]) -> Option<(&'a str, Range<usize>)> {
        let expected = words.join(" or ");
        match self.word() {
            Some((word, range)) if words.iter().any(|w| w.eq_ignore_ascii_case(word)) => Some((word, range)),
            Some((word, range)) => {
                self.error(range, "", format!("\"{word}\" instead of {expected}"), &expected);
                None
            }
            None => {
                self.unexpected_end("", &expected);
                None
            }
        }
    }

    fn number(&mut self, key: &str) -> Option<f64> {
        match self.word() {
            Some((word, range)) => match word.parse::<f64>() {
                Ok(x) if x.is_finite() => Some(x),
                _ => {
                    self.error(range, key, format!("\"{word}\" is not a number"), "a finite number");
                    None
                }
            },
            None => {
                self.unexpected_end(key, "a finite number");
                None
            }
        }
    }

    fn vector(&mut self, key: &str) -> Option<Vector3<f64>> {
        let [x, y, z] = [self.number(key), self.number(key), self.number(key)];
        Some(Vector3::new(x?, y?, z?))
    }

    /// The skeleton, without end sites.
    fn hierarchy(&mut self) -> Option<Vec<Bone<'a>>> {
        self.expect(&["HIERARCHY"])?;
        self.expect(&["ROOT"])?;
        let mut bones: Vec<Bone> = Vec::new();
        let mut open: Vec<usize> = Vec::new();
        let mut channels = 0;
        loop {
            let bone = self.bone(bones.len(), open.last().copied(), channels)?;
            channels += bone.channels.len();
            open.push(bones.len());
            bones.push(bone);
            if self.close_until_next_joint(&mut open)? {
                return Some(bones);
            }
        }
    }

    /// The joint number `index`, from its name to its channels; `first` is the index of its first channel.
    fn bone(&mut self, index: usize, parent: Option<usize>, first: usize) -> Option<Bone<'a>> {
        let Some((name, range)) = self.word() else {
            self.unexpected_end("", "the name of a joint");
            return None;
        };
        self.expect(&["{"])?;
        self.expect(&["OFFSET"])?;
        let offset = self.vector(&format!("{name}.OFFSET"));
        if index == MAX_JOINTS {
            self.error(
                range,
                name,
                format!("the skeleton has more than {MAX_JOINTS} joints"),
                &format!("at most {MAX_JOINTS} joints"),
            );
            return None;
        }
        self.expect(&["CHANNELS"])?;
        let channels = self.channels(name)?;
        Some(Bone { name, parent, offset: offset.unwrap_or_default(), channels, first })
    }

    /// Reads end sites and closing braces up to the name of the next joint. Returns true at the end of the
    /// skeleton.
    fn close_until_next_joint(&mut self, open: &mut Vec<usize>) -> Option<bool> {
        loop {
            let (word, _) = self.expect(&["JOINT", "End", "}"])?;
            match word {
                "}" => {
                    open.pop();
                    if open.is_empty() {
                        return Some(true);
                    }
                }
                _ if word.eq_ignore_ascii_case("joint") => return Some(false),
                _ => {
                    self.expect(&["Site"])?;
                    self.expect(&["{"])?;
                    self.expect(&["OFFSET"])?;
                    self.vector("End Site.OFFSET");
                    self.expect(&["}"])?;
                }
            }
        }
    }

    fn channels(&mut self, joint: &str) -> Option<Vec<Channel>> {
        let key = format!("{joint}.CHANNELS");
        let count = self.number(&key)?;
        if !(0.0..=6.0).contains(&count) || count.fract() != 0.0 {
            self.error(self.at..self.at, &key, format!("{count} channels"), "0 to 6");
            return None;
        }
        (0..count as usize)
            .map(|_| {
                let names = ["Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation"];
                let (word, _) = self.expect(&names)?;
                let i = names.iter().position(|name| name.eq_ignore_ascii_case(word))?;
                Some(if i < 3 { Channel::Position(i) } else { Channel::Rotation(i - 3) })
            })
            .collect()
    }

    /// The frame time, s, and one row of channel values per frame.
    fn motion(&mut self, channels: Option<usize>) -> Option<(f64, Vec<Vec<f64>>)> {
        self.expect(&["MOTION"])?;
        self.expect(&["Frames:"])?;
        let declared = self.number("Frames")?;
        self.expect(&["Frame"])?;
        self.expect(&["Time:"])?;
        let start = self.at;
        let step = self.number("Frame Time")?;
        if !(1e-4..=1.0).contains(&step) {
            self.error(start..self.at, "Frame Time", format!("{step} s"), "0.0001 to 1 s");
        }
        let rows = self.rows(channels?);
        if rows.is_empty() || rows.len() as f64 != declared {
            let end = self.text.len();
            self.error(
                end..end,
                "Frames",
                format!("{declared} frames declared, {} rows found", rows.len()),
                "one row per declared frame, at least one",
            );
        }
        Some((step, rows))
    }

    /// The rows up to the end of the text; the first few errors are reported.
    fn rows(&mut self, channels: usize) -> Vec<Vec<f64>> {
        let mut rows = Vec::new();
        let mut reported = 0;
        let mut from = self.at;
        for line in self.text[self.at..].split_inclusive('\n') {
            let range = from..from + line.trim_end().len();
            from += line.len();
            if line.trim().is_empty() {
                continue;
            }
            let values: Vec<f64> = line.split_whitespace().map(|w| w.parse().unwrap_or(f64::NAN)).collect();
            let key = format!("frame {}", rows.len());
            if values.len() != channels && reported < MAX_REPORTED {
                let allowed = format!("{channels} values, one per channel");
                self.error(range, &key, format!("{} values", values.len()), &allowed);
                reported += 1;
            } else if values.iter().any(|x| !x.is_finite()) && reported < MAX_REPORTED {
                self.error(range, &key, "a value is not a number".into(), "finite numbers");
                reported += 1;
            }
            rows.push(values);
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::motion::rotation;
    use proptest::prelude::*;

    const TEXT: &str = "HIERARCHY\nROOT Hips\n{\n OFFSET 1 2 3\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n \
        JOINT Head\n {\n  OFFSET 0 50 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 20 0\n  }\n }\n \
        JOINT Tail\n {\n  OFFSET 0 -20 0\n  CHANNELS 0\n }\n}\n\
        MOTION\nFrames: 2\nFrame Time: 0.025\n0 90 0 0 0 0 0 0 0\n10 90 5 0 0 90 90 30 0\n";

    fn read(text: &str, joint: &str) -> Result<Motion> {
        let joint = JointSelector { name: Some(joint.into()), clip: None };
        parse(&Source::new("a.bvh"), &joint, text.as_bytes())
    }

    #[test]
    fn a_joint_moves_with_its_ancestors() {
        let motion = read(TEXT, "Head").unwrap();
        assert_eq!((motion.rate, motion.poses.len()), (40.0, 2));
        assert_eq!(motion.bind.unwrap().translation, [1.0, 52.0, 3.0]);
        assert_eq!(motion.poses[0].translation, [0.0, 140.0, 0.0]);
        let at = Vector3::from(motion.poses[1].translation);
        assert!((at - Vector3::new(10.0, 140.0, 5.0)).norm() < 1e-9);
        // The hips turn 90° about Y; the head turns 90° about its own Z, then 30° about its new X.
        let expected = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 90f64.to_radians())
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 90f64.to_radians())
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 30f64.to_radians());
        assert!(rotation(motion.poses[1].rotation_wxyz).angle_to(&expected) < 1e-9);
    }

    #[test]
    fn the_default_unit_is_noted_and_an_implausible_height_warned_about() {
        let motion = read(TEXT, "Head").unwrap();
        assert_eq!(motion.convention.metres_per_unit, 0.01);
        assert!(motion.notes[0].contains("0.70 m tall") && motion.warnings.is_empty());
        let metres = Source { metres_per_unit: Some(1.0), ..Source::new("a.bvh") };
        let motion =
            parse(&metres, &JointSelector { name: Some("Head".into()), clip: None }, TEXT.as_bytes())
                .unwrap();
        assert!(motion.notes.is_empty() && motion.warnings[0].contains("70.00 m tall"));
        let lying = Source { up: Some(UpAxis::Z), ..Source::new("a.bvh") };
        let motion =
            parse(&lying, &JointSelector { name: Some("Head".into()), clip: None }, TEXT.as_bytes()).unwrap();
        assert!(motion.notes[0].contains("0.00 m tall"), "{:?}", motion.notes);
    }

    #[test]
    fn all_errors_are_reported_at_once() {
        let text = TEXT
            .replace("OFFSET 0 50 0", "OFFSET 0 up 0")
            .replace("Frames: 2", "Frames: 3")
            .replace("0.025", "0")
            .replace("0 90 0 0", "0 nan 0 0")
            .replace("10 90 5 0", "90 5 0");
        let Err(Error::BadInput(diagnostics)) = read(&text, "Head") else { panic!("accepted") };
        let keys: Vec<_> = diagnostics.iter().map(|p| p.key.as_str()).collect();
        assert_eq!(keys, ["Head.OFFSET", "Frame Time", "frame 0", "frame 1", "Frames"]);
        let (start, length) = diagnostics[0].span.unwrap();
        assert_eq!(&text[start..start + length], "up");
    }

    #[test]
    fn an_unknown_joint_is_reported_with_the_known_ones() {
        let Err(Error::BadInput(diagnostics)) = read(TEXT, "Nose") else { panic!("accepted") };
        assert!(
            diagnostics[0].message.contains("\"Nose\"")
                && diagnostics[0].allowed.contains("Hips, Head, Tail")
        );
        for text in ["", "HIERARCHY\nROOT", "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 9", &TEXT[..200]] {
            assert!(matches!(read(text, "Head"), Err(Error::BadInput(_))), "{text}");
        }
    }

    proptest! {
        #[test]
        fn mutated_files_never_panic(edits in prop::collection::vec((0usize..500, any::<u8>()), 0..8), cut in 0usize..500) {
            let mut bytes = TEXT.as_bytes().to_vec();
            for (at, value) in edits {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            bytes.truncate(cut);
            let _ = parse(&Source::new("a.bvh"), &JointSelector { name: Some("Head".into()), clip: None }, &bytes);
        }
    }
}
