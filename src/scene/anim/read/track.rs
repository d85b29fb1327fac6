//! Tracks of bodies, from samples in the file or from a motion file.

use super::Reader;
use crate::error::{Error, Result};
use crate::scene::anim::Track;
use crate::scene::anim::file::{MotionFile, MotionFrame, Pops, PoseFile, TrackFile};
use crate::scene::document::{Document, Key, MAX_NAMED};
use crate::scene::track::{Samples, find_pops};
use crate::scene::{Array, Convention};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use std::path::Path;

/// Reads a motion file: what stands in it, and its poses in metres, Y up.
///
/// # Errors
/// As [`crate::scene::load_anim`].
pub(crate) fn motion(path: &Path) -> Result<(MotionFile, Vec<Isometry3<f64>>)> {
    let mut doc = Document::open(path)?;
    let read = doc.parse().and_then(|file: MotionFile| {
        let convention = Convention { metres_per_unit: file.units.metres(), up: file.up_axis.into() };
        let wxyz: Vec<_> = file.frames.iter().map(|f| f.rotation_quat_wxyz).collect();
        let rotation = doc.faults.unit_quaternions(&Key::at("frames"), &wxyz)?;
        let pose = |(f, q): (&MotionFrame, UnitQuaternion<f64>)| convention.pose_in(f.translation.into(), q);
        let poses = file.frames.iter().zip(rotation).map(pose).collect();
        Some((file, poses))
    });
    doc.finish(read, &[])
}

impl Reader<'_> {
    pub(super) fn track(&mut self, key: &Key, file: TrackFile) -> Option<Track> {
        let rest = match file.rest {
            Some(rest) => self.rest(&key.name("rest"), &rest),
            None => Some(Isometry3::identity()),
        };
        let (rate, poses, at, numbers) = match &file.file {
            Some(name) => {
                self.only_one_source(key, &file);
                let (rate, poses) = self.motion_file(key, name)?;
                (rate, poses, key.name("file"), None)
            }
            None => {
                let rate = file.fps.unwrap_or(self.fps);
                let numbers = match file.frames {
                    Some(frames) => Some(self.buffers.load(frames, &key.name("frames"), self.faults)?),
                    None => None,
                };
                let at = if file.translation.is_some() { "translation" } else { "rotation_wxyz" };
                let poses = self.poses(key, file.translation, file.rotation_wxyz)?;
                (rate, poses, key.name(at), numbers)
            }
        };
        let start = file.first_frame.unwrap_or(self.frames.0.into()) / self.fps;
        let mut samples = match numbers {
            Some(numbers) => self.spread(key, &numbers, poses, file.pops)?,
            None => Samples { start, rate, poses, bridged: Vec::new() },
        };
        (samples.start, samples.rate) = (start, rate);
        self.covers_frames(key, &samples);
        self.pops(&at, &mut samples, file.pops);
        if !samples.bridged.is_empty() && samples.poses.len() - samples.bridged.len() < 3 {
            let what =
                format!("leaves {} samples to bridge from", samples.poses.len() - samples.bridged.len());
            self.faults.add(&at, what, "3 or more sound samples", "mend the track");
            return None;
        }
        Some(Track::through(&samples, file.smoothing_hz, &rest?))
    }

    fn only_one_source(&mut self, key: &Key, file: &TrackFile) {
        let here = [
            ("fps", file.fps.is_some()),
            ("frames", file.frames.is_some()),
            ("translation", file.translation.is_some()),
            ("rotation_wxyz", file.rotation_wxyz.is_some()),
        ];
        for (name, _) in here.iter().filter(|(_, given)| *given) {
            let what = "is given beside \"file\", which has its own";
            self.faults.add(
                &key.name(name),
                what,
                "either \"file\" or samples here",
                "remove one of the two",
            );
        }
    }

    fn rest(&mut self, key: &Key, file: &PoseFile) -> Option<Isometry3<f64>> {
        let q = self.quaternion(&key.name("rotation_wxyz"), file.rotation_wxyz)?;
        Some(self.convention.pose_in(file.translation.into(), q))
    }

    /// Poses of the samples in the file itself.
    fn poses(
        &mut self,
        key: &Key,
        translation: Option<Array<[f64; 3]>>,
        rotation: Option<Array<[f64; 4]>>,
    ) -> Option<Vec<Isometry3<f64>>> {
        if translation.is_none() && rotation.is_none() {
            let allowed = "\"file\", or \"translation\" and \"rotation_wxyz\"";
            self.faults.add(
                key,
                "has no samples",
                allowed,
                "give the samples, or leave the track out for a body at rest",
            );
            return None;
        }
        let translation =
            translation.map(|array| self.buffers.load(array, &key.name("translation"), self.faults));
        let rotation_key = key.name("rotation_wxyz");
        let rotation = rotation.map(|array| {
            let array = self.buffers.load(array, &rotation_key, self.faults)?;
            self.faults.unit_quaternions(&rotation_key, &array)
        });
        // A missing array has the default value for every sample; a faulty one ends here.
        let translation = translation.map_or(Some(None), |t| t.map(Some))?;
        let rotation = rotation.map_or(Some(None), |r| r.map(Some))?;
        let n = translation.as_ref().map_or_else(|| rotation.as_ref().map_or(0, Vec::len), Vec::len);
        if n == 0 {
            self.faults.add(key, "has no samples", "one sample or more", "give the samples");
            return None;
        }
        if let Some(rotation) = &rotation
            && !self.faults.expect_len(&rotation_key, rotation.len(), n, "sample of \"translation\"")
        {
            return None;
        }
        let pose = |i: usize| {
            let p = translation.as_ref().map_or(Vector3::zeros(), |t| t[i].into());
            let q = rotation.as_ref().map_or(UnitQuaternion::identity(), |r| r[i]);
            self.convention.pose_in(p, q)
        };
        Some((0..n).map(pose).collect())
    }

    /// Rate and poses of a motion file; its faults are reported at their places in it.
    fn motion_file(&mut self, key: &Key, name: &str) -> Option<(f64, Vec<Isometry3<f64>>)> {
        let path = self.folder.join(name);
        match motion(&path) {
            Ok((file, poses)) => return Some((file.fps, poses)),
            Err(Error::BadInput(problems)) => self.faults.add_elsewhere(problems),
            Err(Error::Io { source, .. }) => self.faults.add(
                &key.name("file"),
                format!("\"{name}\" cannot be read: {source}"),
                "a readable motion file",
                "correct the path; it starts from the folder of this file",
            ),
            Err(e) => self.faults.add(&key.name("file"), e.to_string(), "a motion file", "correct the path"),
        }
        None
    }

    /// Samples with a number each, spread out over the gaps between them.
    fn spread(
        &mut self,
        key: &Key,
        numbers: &[i32],
        poses: Vec<Isometry3<f64>>,
        pops: Pops,
    ) -> Option<Samples> {
        let key = key.name("frames");
        if !self.faults.expect_len(&key, numbers.len(), poses.len(), "sample") {
            return None;
        }
        let mut sound = true;
        for (i, pair) in numbers.windows(2).enumerate() {
            let gap = i64::from(pair[1]) - i64::from(pair[0]);
            let (what, allowed, remedy) = match gap {
                1 => continue,
                ..1 => (
                    format!("is {} after {}", pair[1], pair[0]),
                    "increasing".to_string(),
                    "put the samples in order of time, each once",
                ),
                // Longer gaps are no tracker's drop-out, and filling them would invent motion.
                2..=30 if pops == Pops::Bridge => continue,
                _ => (
                    format!("is {} after {}: a gap, samples missing: {}", pair[1], pair[0], gap - 1),
                    format!("{}", i64::from(pair[0]) + 1),
                    "fill the gap, or set \"pops\": \"bridge\" to bridge gaps of up to 29 samples",
                ),
            };
            self.faults.add(&key.index(i + 1), what, allowed, remedy);
            sound = false;
        }
        if !sound {
            return None;
        }
        let mut samples = Samples { start: 0.0, rate: 1.0, poses: Vec::new(), bridged: Vec::new() };
        for (pose, &number) in poses.into_iter().zip(numbers) {
            let place = (i64::from(number) - i64::from(numbers[0])) as usize;
            for missing in samples.poses.len()..place {
                samples.bridged.push(missing);
                samples.poses.push(pose);
            }
            samples.poses.push(pose);
        }
        Some(samples)
    }

    /// The frames of the bake lie in the track.
    fn covers_frames(&mut self, key: &Key, samples: &Samples) {
        if samples.poses.len() < 2 {
            return;
        }
        let first = samples.start * self.fps;
        let last = first + (samples.poses.len() - 1) as f64 * self.fps / samples.rate;
        // The last frame may fall short of a whole sample by rounding, or by the sample's own length.
        let slack = 1e-6 + self.fps / samples.rate;
        let (a, b) = (f64::from(self.frames.0), f64::from(self.frames.1));
        if a < first - slack || b > last + slack {
            let what = format!("covers frames {first:.2} to {last:.2}, not all of {a} to {b}");
            let allowed = format!("\"frames\" within {} to {}", first.ceil(), last.floor());
            self.faults.add(key, what, allowed, "shorten \"frames\", or correct \"first_frame\" or \"fps\"");
        }
    }

    /// Reports the pops of a track, or marks them to be bridged.
    fn pops(&mut self, key: &Key, samples: &mut Samples, pops: Pops) {
        if pops == Pops::Keep {
            return;
        }
        let mut named = 0;
        for pop in find_pops(&samples.poses, samples.rate) {
            let known = |i: usize| samples.bridged.binary_search(&i).is_ok();
            if known(pop.sample) || known(pop.sample - 1) {
                continue;
            }
            if pops == Pops::Bridge && pop.alone {
                let place = samples.bridged.partition_point(|&i| i < pop.sample);
                samples.bridged.insert(place, pop.sample);
                continue;
            }
            named += 1;
            if named > MAX_NAMED {
                continue;
            }
            let length =
                |x: f64| if pop.angular { format!("{:.1}°", x.to_degrees()) } else { format!("{x:.4} m") };
            let frame = (samples.start + pop.sample as f64 / samples.rate) * self.fps;
            let way = if pop.alone { "jumps there and back" } else { "jumps" };
            let what = format!(
                "{way} by {} at frame {frame:.2} while the samples around move {} at most",
                length(pop.size),
                length(pop.around)
            );
            let allowed = format!("at most {} or 3 times the motion around", length(pop.limit));
            let remedy = if pop.alone {
                "mend the sample, or set \"pops\": \"bridge\" to replace it from its neighbours, \"keep\" to follow it"
            } else {
                "mend the track, or set \"pops\": \"keep\" to follow the jump"
            };
            self.faults.add(&key.index(pop.sample), what, allowed, remedy);
        }
        if named > MAX_NAMED {
            self.faults.add(
                key,
                format!("has {named} pops in all"),
                "none",
                "mend the track, or set \"pops\"",
            );
        }
    }
}
