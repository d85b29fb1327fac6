//! Biovision hierarchies (`.bvh`): a skeleton, then a row of channel values a frame.
//!
//! A joint stands at its offset from its parent; position channels stand in place of the offset, as all programs that write them
//! have it. Rotations are in degrees, about the joint's own axes in the order of the channels. The format knows no unit.

use super::{Joint, Motion, convention, no_joint, whole_if_near};
use crate::import::read::Source;
use crate::scene::UpAxis;
use crate::scene::anim::file::PoseFile;
use crate::{Diagnostic, Error, Result};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::ops::Range;

/// Metres in a unit where none is given.
const CENTIMETRE: f64 = 0.01;
/// Heights of a skeleton that make one think of the right unit, m.
const FIGURE: [f64; 2] = [0.5, 3.0];
/// Faulty rows and values that are told one by one.
const NAMED: usize = 6;
/// Most joints of a skeleton.
const MOST_JOINTS: usize = 10_000;

/// One channel of a joint.
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
    /// Place of its first channel in a row.
    first: usize,
}

/// Reads the motion of a joint.
///
/// # Errors
/// Every fault that was found, with its place.
pub(super) fn parse(source: &Source, joint: &Joint, bytes: &[u8]) -> Result<Motion> {
    let text = String::from_utf8_lossy(bytes);
    let mut file = File { source, text: &text, at: 0, problems: Vec::new() };
    let bones = file.hierarchy();
    let channels = bones.as_ref().map(|bones| bones.iter().map(|b| b.channels.len()).sum());
    let motion = bones.as_ref().and_then(|_| file.motion(channels));
    Error::if_any(std::mem::take(&mut file.problems))?;
    let (Some(bones), Some((step, rows))) = (bones, motion) else {
        return Err(Error::Internal("a BVH file that is neither read nor faulty".into()));
    };
    let named = |name: &str| bones.iter().position(|b| b.name == name);
    let names: Vec<&str> = bones.iter().map(|b| b.name).collect();
    let missing = || no_joint(source, joint.name.as_deref(), &names, "joint");
    let index =
        joint.name.as_deref().and_then(named).or((joint.name.is_none() && bones.len() == 1).then_some(0));
    let chain = chain(&bones, index.ok_or_else(missing)?);

    let convention = convention(source, CENTIMETRE, UpAxis::Y);
    let metres = height(&bones, convention.up) * convention.metres_per_unit;
    let mut notes = Vec::new();
    let mut warnings = Vec::new();
    if source.metres_per_unit.is_none() {
        notes.push(format!("BVH has no unit: centimetres are taken, which make the skeleton {metres:.2} m tall (--units for another)"));
    }
    if !(FIGURE[0]..=FIGURE[1]).contains(&metres) {
        warnings.push(format!("the skeleton is {metres:.2} m tall: check --units"));
    }
    let rest = chain.iter().map(|&b| bones[b].offset).sum::<Vector3<f64>>();
    Ok(Motion {
        rate: whole_if_near(1.0 / step),
        numbered: None,
        convention,
        poses: rows.iter().map(|row| pose(&bones, &chain, row)).collect(),
        bind: Some(PoseFile { translation: rest.into(), rotation_wxyz: [1.0, 0.0, 0.0, 0.0] }),
        prim: None,
        notes,
        warnings,
    })
}

/// A joint and all above it, the root first.
fn chain(bones: &[Bone], joint: usize) -> Vec<usize> {
    let mut chain: Vec<usize> = std::iter::successors(Some(joint), |&b| bones[b].parent).collect();
    chain.reverse();
    chain
}

/// Height of the joints as they stand at rest, file units.
fn height(bones: &[Bone], up: UpAxis) -> f64 {
    let axis = if up == UpAxis::Z { 2 } else { 1 };
    let mut at: Vec<f64> = Vec::with_capacity(bones.len());
    for bone in bones {
        at.push(bone.parent.map_or(0.0, |p| at[p]) + bone.offset[axis]);
    }
    at.iter().copied().fold(f64::NEG_INFINITY, f64::max) - at.iter().copied().fold(f64::INFINITY, f64::min)
}

fn pose(bones: &[Bone], chain: &[usize], row: &[f64]) -> PoseFile {
    let mut world = Isometry3::identity();
    for &b in chain {
        let bone = &bones[b];
        let (mut at, mut turn) = (bone.offset, UnitQuaternion::identity());
        for (channel, &value) in bone.channels.iter().zip(&row[bone.first..]) {
            match *channel {
                Channel::Position(axis) => at[axis] = value,
                Channel::Rotation(axis) => {
                    let axis = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()][axis];
                    turn *= UnitQuaternion::from_axis_angle(&axis, value.to_radians());
                }
            }
        }
        world *= Isometry3::from_parts(Translation3::from(at), turn);
    }
    let q = world.rotation;
    PoseFile { translation: world.translation.vector.into(), rotation_wxyz: [q.w, q.i, q.j, q.k] }
}

/// The text and how far it is read.
struct File<'a> {
    source: &'a Source,
    text: &'a str,
    at: usize,
    problems: Vec<Diagnostic>,
}

impl<'a> File<'a> {
    /// The next word and its place.
    fn word(&mut self) -> Option<(&'a str, Range<usize>)> {
        let rest = &self.text[self.at..];
        let start = self.at + rest.find(|c: char| !c.is_whitespace())?;
        let rest = &self.text[start..];
        self.at = start + rest.find(char::is_whitespace).unwrap_or(rest.len());
        Some((&self.text[start..self.at], start..self.at))
    }

    fn fault(&mut self, place: Range<usize>, key: &str, what: String, allowed: &str) {
        let remedy = "export the motion again";
        let mut problem = Diagnostic::new(&self.source.path, key, what, allowed, remedy);
        problem.span = Some((place.start, place.len()));
        self.problems.push(problem);
    }

    /// The next word if it is one of these; else the fault is noted.
    fn expect(&mut self, words: &[&str]) -> Option<(&'a str, Range<usize>)> {
        let allowed = words.join(" or ");
        match self.word() {
            Some((word, place)) if words.iter().any(|w| w.eq_ignore_ascii_case(word)) => Some((word, place)),
            Some((word, place)) => {
                self.fault(place, "", format!("\"{word}\" stands where {allowed} should"), &allowed);
                None
            }
            None => {
                let end = self.text.len();
                self.fault(end..end, "", format!("the file ends where {allowed} should be"), &allowed);
                None
            }
        }
    }

    fn number(&mut self, key: &str) -> Option<f64> {
        match self.word() {
            Some((word, place)) => match word.parse::<f64>() {
                Ok(x) if x.is_finite() => Some(x),
                _ => {
                    self.fault(place, key, format!("\"{word}\" is no number"), "a finite number");
                    None
                }
            },
            None => {
                let end = self.text.len();
                self.fault(end..end, key, "the file ends where a number should be".into(), "a finite number");
                None
            }
        }
    }

    fn triple(&mut self, key: &str) -> Option<Vector3<f64>> {
        let [x, y, z] = [self.number(key), self.number(key), self.number(key)];
        Some(Vector3::new(x?, y?, z?))
    }

    /// The skeleton; its end sites are of no joint.
    fn hierarchy(&mut self) -> Option<Vec<Bone<'a>>> {
        self.expect(&["HIERARCHY"])?;
        self.expect(&["ROOT"])?;
        let mut bones: Vec<Bone> = Vec::new();
        let mut open: Vec<usize> = Vec::new();
        let mut channels = 0;
        loop {
            // After ROOT or JOINT.
            let Some((name, place)) = self.word() else {
                let end = self.text.len();
                self.fault(end..end, "", "the file ends where a joint's name should be".into(), "a name");
                return None;
            };
            self.expect(&["{"])?;
            self.expect(&["OFFSET"])?;
            let offset = self.triple(&format!("{name}.OFFSET"));
            if bones.len() == MOST_JOINTS {
                self.fault(place, name, format!("more than {MOST_JOINTS} joints"), "fewer joints");
                return None;
            }
            let mut bone = Bone {
                name,
                parent: open.last().copied(),
                offset: offset.unwrap_or_default(),
                channels: Vec::new(),
                first: channels,
            };
            self.expect(&["CHANNELS"])?;
            bone.channels = self.channels(name)?;
            channels += bone.channels.len();
            open.push(bones.len());
            bones.push(bone);
            // Up to the next joint, or to the end of the skeleton.
            loop {
                let (word, _) = self.expect(&["JOINT", "End", "}"])?;
                match word {
                    "}" => {
                        open.pop();
                        if open.is_empty() {
                            return Some(bones);
                        }
                    }
                    _ if word.eq_ignore_ascii_case("joint") => break,
                    _ => {
                        self.expect(&["Site"])?;
                        self.expect(&["{"])?;
                        self.expect(&["OFFSET"])?;
                        self.triple("End Site.OFFSET");
                        self.expect(&["}"])?;
                    }
                }
            }
        }
    }

    fn channels(&mut self, joint: &str) -> Option<Vec<Channel>> {
        let key = format!("{joint}.CHANNELS");
        let count = self.number(&key)?;
        if !(0.0..=6.0).contains(&count) || count.fract() != 0.0 {
            self.fault(self.at..self.at, &key, format!("are {count}"), "0 to 6");
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

    /// Time of a frame, s, and the rows.
    fn motion(&mut self, channels: Option<usize>) -> Option<(f64, Vec<Vec<f64>>)> {
        self.expect(&["MOTION"])?;
        self.expect(&["Frames:"])?;
        let wanted = self.number("Frames")?;
        self.expect(&["Frame"])?;
        self.expect(&["Time:"])?;
        let start = self.at;
        let step = self.number("Frame Time")?;
        if !(1e-4..=1.0).contains(&step) {
            self.fault(start..self.at, "Frame Time", format!("is {step} s"), "0.0001 to 1 s");
        }
        let channels = channels?;
        let mut rows = Vec::new();
        let mut told = 0;
        let mut from = self.at;
        for line in self.text[self.at..].split_inclusive('\n') {
            let place = from..from + line.trim_end().len();
            from += line.len();
            if line.trim().is_empty() {
                continue;
            }
            let values: Vec<f64> = line.split_whitespace().map(|w| w.parse().unwrap_or(f64::NAN)).collect();
            if values.len() != channels && told < NAMED {
                let key = format!("frame {}", rows.len());
                self.fault(
                    place,
                    &key,
                    format!("has {} values", values.len()),
                    &format!("{channels} values, one a channel"),
                );
                told += 1;
            } else if values.iter().any(|x| !x.is_finite()) && told < NAMED {
                let key = format!("frame {}", rows.len());
                self.fault(place, &key, "holds what is no number".into(), "finite numbers");
                told += 1;
            }
            rows.push(values);
        }
        if rows.is_empty() || rows.len() as f64 != wanted {
            self.fault(
                from..from,
                "Frames",
                format!("are {wanted}, for {} rows", rows.len()),
                "as many rows as it says, one or more",
            );
        }
        Some((step, rows))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::motion::turn;
    use proptest::prelude::*;

    const TEXT: &str = "HIERARCHY\nROOT Hips\n{\n OFFSET 1 2 3\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n \
        JOINT Head\n {\n  OFFSET 0 50 0\n  CHANNELS 3 Zrotation Xrotation Yrotation\n  End Site\n  {\n   OFFSET 0 20 0\n  }\n }\n \
        JOINT Tail\n {\n  OFFSET 0 -20 0\n  CHANNELS 0\n }\n}\n\
        MOTION\nFrames: 2\nFrame Time: 0.025\n0 90 0 0 0 0 0 0 0\n10 90 5 0 0 90 90 30 0\n";

    fn read(text: &str, joint: &str) -> Result<Motion> {
        let joint = Joint { name: Some(joint.into()), clip: None };
        parse(&Source::new("a.bvh"), &joint, text.as_bytes())
    }

    #[test]
    fn a_joint_goes_with_those_above_it() {
        let motion = read(TEXT, "Head").unwrap();
        assert_eq!((motion.rate, motion.poses.len()), (40.0, 2));
        assert_eq!(motion.bind.unwrap().translation, [1.0, 52.0, 3.0]);
        assert_eq!(motion.poses[0].translation, [0.0, 140.0, 0.0]);
        let at = Vector3::from(motion.poses[1].translation);
        assert!((at - Vector3::new(10.0, 140.0, 5.0)).norm() < 1e-9);
        // The hips turn by a quarter about Y; the head by a quarter about its own Z, then by 30° about its new X.
        let expected = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 90f64.to_radians())
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 90f64.to_radians())
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 30f64.to_radians());
        assert!(turn(motion.poses[1].rotation_wxyz).angle_to(&expected) < 1e-9);
    }

    #[test]
    fn the_unit_is_told_and_a_wrong_one_warned_of() {
        let motion = read(TEXT, "Head").unwrap();
        assert_eq!(motion.convention.metres_per_unit, 0.01);
        assert!(motion.notes[0].contains("0.70 m tall") && motion.warnings.is_empty());
        let metres = Source { metres_per_unit: Some(1.0), ..Source::new("a.bvh") };
        let motion =
            parse(&metres, &Joint { name: Some("Head".into()), clip: None }, TEXT.as_bytes()).unwrap();
        assert!(motion.notes.is_empty() && motion.warnings[0].contains("70.00 m tall"));
        let lying = Source { up: Some(UpAxis::Z), ..Source::new("a.bvh") };
        let motion =
            parse(&lying, &Joint { name: Some("Head".into()), clip: None }, TEXT.as_bytes()).unwrap();
        assert!(motion.notes[0].contains("0.00 m tall"), "{:?}", motion.notes);
    }

    #[test]
    fn every_fault_in_one_report() {
        let text = TEXT
            .replace("OFFSET 0 50 0", "OFFSET 0 up 0")
            .replace("Frames: 2", "Frames: 3")
            .replace("0.025", "0")
            .replace("0 90 0 0", "0 nan 0 0")
            .replace("10 90 5 0", "90 5 0");
        let Err(Error::BadInput(problems)) = read(&text, "Head") else { panic!("accepted") };
        let keys: Vec<_> = problems.iter().map(|p| p.key.as_str()).collect();
        assert_eq!(keys, ["Head.OFFSET", "Frame Time", "frame 0", "frame 1", "Frames"]);
        let (start, length) = problems[0].span.unwrap();
        assert_eq!(&text[start..start + length], "up");
    }

    #[test]
    fn a_joint_that_is_not_there_is_told_with_those_that_are() {
        let Err(Error::BadInput(problems)) = read(TEXT, "Nose") else { panic!("accepted") };
        assert!(problems[0].message.contains("\"Nose\"") && problems[0].allowed.contains("Hips, Head, Tail"));
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
            let _ = parse(&Source::new("a.bvh"), &Joint { name: Some("Head".into()), clip: None }, &bytes);
        }
    }
}
