//! Values of options, read from text.

use crate::import::Source;
use crate::scene::UpAxis;
use crate::scene::anim::{Contact, MAX_FRAMES, Resolution, Scheme, Written};
use nalgebra::Vector3;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

/// Metres in a unit of length: a name, or the number itself.
pub fn units(text: &str) -> Result<f64, String> {
    match text {
        "m" => Ok(1.0),
        "cm" => Ok(0.01),
        "mm" => Ok(0.001),
        "in" => Ok(0.0254),
        "ft" => Ok(0.3048),
        number => number
            .parse()
            .ok()
            .filter(|x: &f64| *x >= 1e-6 && *x <= 1e4)
            .ok_or_else(|| "m, cm, mm, in, ft, or metres in a unit (1e-6 to 1e4)".into()),
    }
}

/// An up axis.
pub fn up_axis(text: &str) -> Result<UpAxis, String> {
    match text {
        "y" | "Y" => Ok(UpAxis::Y),
        "z" | "Z" => Ok(UpAxis::Z),
        _ => Err("y or z".into()),
    }
}

/// A time scheme.
pub fn scheme(text: &str) -> Result<Scheme, String> {
    match text {
        "backward-euler" => Ok(Scheme::BackwardEuler),
        "bdf2" => Ok(Scheme::Bdf2),
        _ => Err("backward-euler or bdf2".into()),
    }
}

/// What hair touches.
pub fn contact(text: &str) -> Result<Contact, String> {
    match text {
        "full" => Ok(Contact::Full),
        "bodies" => Ok(Contact::Bodies),
        "penalty" => Ok(Contact::Penalty),
        _ => Err("full, bodies or penalty".into()),
    }
}

/// What moves by itself.
pub fn resolution(text: &str) -> Result<Resolution, String> {
    match text {
        "auto" => Ok(Resolution::Auto),
        "adaptive" => Ok(Resolution::Adaptive),
        "full" => Ok(Resolution::Full),
        "coarse" => Ok(Resolution::Coarse),
        _ => Err("auto, adaptive, full or coarse".into()),
    }
}

/// Which curves are written.
pub fn curves(text: &str) -> Result<Written, String> {
    match text {
        "guides" => Ok(Written::Guides),
        "steps" => Ok(Written::Steps),
        "strands" => Ok(Written::Strands),
        "both" => Ok(Written::Both),
        _ => Err("guides, strands, both or steps".into()),
    }
}

/// A file, and its prim (of USD), unit and up axis if they are given: `FILE[:PRIM][:UNITS][:UP]`.
pub fn source(text: &str) -> Result<Source, String> {
    let mut source = Source::default();
    let mut rest = text;
    while let Some((file, suffix)) = rest.rsplit_once(':') {
        if let (Ok(up), None) = (up_axis(suffix), source.up) {
            source.up = Some(up);
        } else if let (Ok(metres), None) = (units(suffix), source.metres_per_unit) {
            source.metres_per_unit = Some(metres);
        } else if suffix.starts_with('/') && !file.is_empty() && source.prim.is_none() {
            source.prim = Some(suffix.into());
        } else {
            break;
        }
        rest = file;
    }
    if rest.is_empty() {
        return Err(
            "FILE, FILE:UNITS or FILE:UNITS:UP, such as head.obj:cm; a prim of USD as head.usd:/bust".into(),
        );
    }
    source.path = PathBuf::from(rest);
    Ok(source)
}

/// First and last frame: `1001-1100`, or one frame.
pub fn frames(text: &str) -> Result<(i32, i32), String> {
    let help = || "FIRST-LAST or one frame, such as 1001-1100".to_string();
    // A sign is no dash.
    let dash = text.char_indices().skip(1).find(|(_, c)| *c == '-').map(|(i, _)| i);
    let (first, last) = dash.map_or((text, text), |i| (&text[..i], &text[i + 1..]));
    let (first, last) = (first.parse().map_err(|_| help())?, last.parse().map_err(|_| help())?);
    if first > last {
        return Err(format!("frame {first} is after {last}"));
    }
    Ok((first, last))
}

/// Frames of a shot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameList {
    /// In the order in which they were asked for, each once.
    pub frames: Vec<i32>,
    /// First and last of the shot that they are of: the ends of its ranges, whatever their steps.
    pub shot: (i32, i32),
    /// As it was typed.
    pub text: String,
}

impl FrameList {
    /// Whether it is all of its shot.
    pub fn is_whole(&self) -> bool {
        self.frames.len() as i64 == i64::from(self.shot.1) - i64::from(self.shot.0) + 1
    }
}

/// Frames: `1001`, `1001-1100`, every fifth of them `1001-1100x5` (or `:5`), and lists of these with commas.
pub fn frame_list(text: &str) -> Result<FrameList, String> {
    let mut list = Vec::new();
    let mut shot = (i32::MAX, i32::MIN);
    for part in text.split(',').map(str::trim) {
        let (range, step) = part.split_once(['x', ':']).unwrap_or((part, "1"));
        let (first, last) = frames(range)?;
        let step: usize =
            step.parse().ok().filter(|n| *n > 0).ok_or("a step of 1 or more, such as 1001-1100x5")?;
        if (i64::from(last) - i64::from(first)) / step as i64 >= MAX_FRAMES - list.len() as i64 {
            return Err(format!("more than {MAX_FRAMES} frames"));
        }
        list.extend((first..=last).step_by(step));
        shot = (shot.0.min(first), shot.1.max(last));
    }
    let mut seen = BTreeSet::new();
    list.retain(|frame| seen.insert(*frame));
    Ok(FrameList { frames: list, shot, text: text.into() })
}

/// A time: seconds, or with units as in `1h30m`, `90m`, `45s`.
pub fn duration(text: &str) -> Result<Duration, String> {
    let help = || "seconds, or a time such as 90m or 1h30m".to_string();
    let mut seconds = 0.0;
    let mut rest = text;
    while !rest.is_empty() {
        let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let number = not_negative(&rest[..end]).map_err(|_| help())?;
        let unit = match rest[end..].chars().next() {
            Some('h') => 3600.0,
            Some('m') => 60.0,
            Some('s') | None => 1.0,
            Some(_) => return Err(help()),
        };
        seconds += number * unit;
        rest = rest.get(end + 1..).unwrap_or_default();
    }
    let time = Duration::try_from_secs_f64(seconds).ok();
    time.filter(|_| !text.is_empty() && seconds <= 1e9).ok_or_else(help)
}

/// A rule of a path map: `FROM=TO`.
pub fn path_rule(text: &str) -> Result<(String, String), String> {
    let rule = text.split_once('=').filter(|(from, _)| !from.is_empty());
    rule.map(|(from, to)| (from.into(), to.into())).ok_or_else(|| "FROM=TO, such as /show=/mnt/show".into())
}

/// A vector: `x,y,z`.
pub fn vector(text: &str) -> Result<Vector3<f64>, String> {
    let parts: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match parts[..] {
        [x, y, z] if text.matches(',').count() == 2 && parts.iter().all(|x| x.is_finite()) => {
            Ok(Vector3::new(x, y, z))
        }
        _ => Err("three numbers, such as 0,1.6,0.05".into()),
    }
}

/// Width and height in pixels: `640x480`, or one number for a square.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once('x').unwrap_or((text, text));
    let pixels = |side: &str| side.parse().ok().filter(|n| (1..=8192).contains(n));
    pixels(width).zip(pixels(height)).ok_or_else(|| "WIDTHxHEIGHT or one number, 1 to 8192 each".into())
}

/// A finite number that is not negative.
pub fn not_negative(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| *x >= 0.0 && x.is_finite()).ok_or_else(|| "a number, 0 or more".into())
}

/// A finite number above zero.
pub fn positive(text: &str) -> Result<f64, String> {
    not_negative(text).ok().filter(|x| *x > 0.0).ok_or_else(|| "a number above 0".into())
}

/// An angle, degrees.
pub fn angle(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.abs() <= 360.0).ok_or_else(|| "degrees from -360 to 360".into())
}

/// A share from 0 to 1.
pub fn share(text: &str) -> Result<f64, String> {
    not_negative(text).ok().filter(|x| *x <= 1.0).ok_or_else(|| "a number from 0 to 1".into())
}

/// The share that is kept, above 0.
pub fn kept(text: &str) -> Result<f64, String> {
    share(text).ok().filter(|x| *x >= 1e-6).ok_or_else(|| "a number above 0, to 1".into())
}

/// Frames that a shutter is open.
pub fn shutter(text: &str) -> Result<f64, String> {
    share(text)
        .ok()
        .filter(|x| (1e-3..=0.999).contains(x))
        .ok_or_else(|| "a number from 0.001 to 0.999".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_carry_their_unit_and_axis() {
        let parts =
            |text| source(text).map(|s| (s.path.to_string_lossy().into_owned(), s.metres_per_unit, s.up));
        assert_eq!(parts("a/head.obj"), Ok(("a/head.obj".into(), None, None)));
        assert_eq!(parts("head.obj:cm"), Ok(("head.obj".into(), Some(0.01), None)));
        assert_eq!(parts("head.obj:0.5:z"), Ok(("head.obj".into(), Some(0.5), Some(UpAxis::Z))));
        assert_eq!(parts("C:\\head.obj"), Ok(("C:\\head.obj".into(), None, None)));
        assert!(parts(":cm").is_err());
        let prim = |text| source(text).map(|s| (s.path.to_string_lossy().into_owned(), s.prim, s.up));
        assert_eq!(prim("a/b.usd:/c/d:m:z"), Ok(("a/b.usd".into(), Some("/c/d".into()), Some(UpAxis::Z))));
        assert_eq!(prim("a/b.usd:cm"), Ok(("a/b.usd".into(), None, None)));
    }

    #[test]
    fn lists_of_frames() {
        let list = |text| frame_list(text).map(|list| list.frames);
        assert_eq!(list("7"), Ok(vec![7]));
        assert_eq!(list("-2-1"), Ok(vec![-2, -1, 0, 1]));
        assert_eq!(list("1001-1010x4, 1002,1001"), Ok(vec![1001, 1005, 1009, 1002]));
        assert_eq!(list("-9--1:4"), Ok(vec![-9, -5, -1]));
        for wrong in ["", "1,", "5-1", "1-5x0", "1-5x", "1-5x-1", "x2", "1-5x2x2", "0-2000000000", "one"] {
            assert!(list(wrong).is_err(), "{wrong}");
        }
        assert_eq!(list("-2147483648-2147483647x1000000000").map(|l| l.len()), Ok(5));
        let shot = |text| frame_list(text).map(|list| (list.shot, list.is_whole()));
        assert_eq!(shot("1001-1010x4"), Ok(((1001, 1010), false)));
        assert_eq!(shot("1006-1010,1001-1005"), Ok(((1001, 1010), true)));
    }

    #[test]
    fn times() {
        let seconds = |text| duration(text).map(|d| d.as_secs_f64());
        for (text, expected) in
            [("90", 90.0), ("1.5", 1.5), ("90m", 5400.0), ("1h30m", 5400.0), ("2h5", 7205.0), ("45s", 45.0)]
        {
            assert_eq!(seconds(text), Ok(expected), "{text}");
        }
        for wrong in ["", "h", "-3", "3d", "1e400", "1h30x", "1é"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn ranges_vectors_and_sizes() {
        assert_eq!(frames("1001-1100"), Ok((1001, 1100)));
        assert_eq!(frames("-5--2"), Ok((-5, -2)));
        assert_eq!(frames("7"), Ok((7, 7)));
        assert!(frames("9-7").is_err() && frames("a").is_err() && frames("").is_err());
        assert_eq!(vector("0,-1.5, 2"), Ok(Vector3::new(0.0, -1.5, 2.0)));
        assert!(vector("0,1").is_err() && vector("0,1,x").is_err() && vector("0,1,2,3").is_err());
        assert!(vector("0,x,1,2").is_err() && vector("0,nan,1").is_err());
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert_eq!(size("300"), Ok((300, 300)));
        assert!(size("0x3").is_err() && size("9000").is_err());
        assert!(units("furlong").is_err() && units("-1").is_err() && units("0.01") == units("cm"));
        assert!(share("1.1").is_err() && positive("0").is_err() && not_negative("nan").is_err());
    }
}
