//! Parses the values of options.

use crate::import::Source;
use crate::scene::anim::{ContactSetting, OutputCurves, Resolution, Scheme};
use crate::scene::{OverSource, UpAxis};
use clap::ValueEnum;
use clap::builder::{PossibleValue, TypedValueParser};
use nalgebra::Vector3;
use std::path::PathBuf;
use std::time::Duration;

/// Implements [`ValueEnum`] for an enum of the scene: value, name and help.
macro_rules! value_enum {
    ($type:ident: $($variant:ident, $name:literal, $help:literal;)+) => {
        impl ValueEnum for $type {
            fn value_variants<'a>() -> &'a [Self] {
                &[$($type::$variant),+]
            }

            fn to_possible_value(&self) -> Option<PossibleValue> {
                Some(match self {
                    $($type::$variant => PossibleValue::new($name).help($help),)+
                })
            }
        }
    };
}

value_enum! { Scheme:
    FourStep, "four-step", "Second order, with next to no numerical damping";
    Bdf2, "bdf2", "Second order, with little numerical damping and 2.5 times the error";
    BackwardEuler, "backward-euler", "First order: cheaper in contact, damps swinging hair more than air and hair do";
}
value_enum! { ContactSetting:
    Volume, "volume", "Bodies, and other hair as a volume that resists pressure and slip";
    Bodies, "bodies", "Bodies";
    Full, "full", "Bodies, and other guides as rigid bundles; many times slower";
    Penalty, "penalty", "Bodies, by springs: for a quick look, without guarantees";
}
value_enum! { Resolution:
    Auto, "auto", "full if hair collides with hair or --curves is steps, else adaptive";
    Adaptive, "adaptive", "Coarse wisps, from which guides split where the motion requires it";
    Full, "full", "Every guide";
    Coarse, "coarse", "Coarse wisps only: for a quick look";
}
value_enum! { OutputCurves:
    Both, "both", "Guides and render strands";
    Guides, "guides", "Guides";
    Strands, "strands", "Render strands";
    Steps, "steps", "Guides, at every solver step: for checks of the solver";
}

/// The name of a value as it is typed.
pub fn name<T: ValueEnum>(value: &T) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().into())
}

/// A parser of numbers from `least` to `most`.
pub fn count(least: i64, most: i64) -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(least..=most)
}

/// The path of a USD prim.
pub fn prim(text: &str) -> Result<String, String> {
    match text.starts_with('/') {
        true => Ok(text.into()),
        false => Err("expected an absolute prim path, such as /groom/hair".into()),
    }
}

/// Metres per unit of length: the name of a unit, or the number itself.
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
            .ok_or_else(|| "expected m, cm, mm, in, ft, or metres per unit from 1e-6 to 1e4".into()),
    }
}

/// An up axis.
pub fn up_axis(text: &str) -> Result<UpAxis, String> {
    match text {
        "y" | "Y" => Ok(UpAxis::Y),
        "z" | "Z" => Ok(UpAxis::Z),
        _ => Err("expected y or z".into()),
    }
}

/// A file with its optional prim (USD), unit and up axis: `FILE[:PRIM][:UNITS][:UP]`.
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
        return Err("expected FILE, FILE:UNITS or FILE:UNITS:UP, such as head.obj:cm; \
                    a prim of USD as head.usd:/bust"
            .into());
    }
    source.path = PathBuf::from(rest);
    Ok(source)
}

/// A USD file with an optional prim: `FILE[:PRIM]`.
pub fn stage_prim(text: &str) -> Result<OverSource, String> {
    match source(text)? {
        Source { path, prim, metres_per_unit: None, up: None, .. } => {
            Ok(OverSource { file: path, prims: prim.into_iter().collect(), ..OverSource::default() })
        }
        _ => Err("expected FILE or FILE:PRIM, such as shot.usda:/world/hero/groom".into()),
    }
}

/// A duration: seconds, or with units as in `1h30m`, `90m`, `45s`.
pub fn duration(text: &str) -> Result<Duration, String> {
    let help = || "expected seconds, or a time such as 90m or 1h30m".to_string();
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
    rule.map(|(from, to)| (from.into(), to.into()))
        .ok_or_else(|| "expected FROM=TO, such as /show=/mnt/show".into())
}

/// A vector: `x,y,z`.
pub fn vector(text: &str) -> Result<Vector3<f64>, String> {
    let parts: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match parts[..] {
        [x, y, z] if text.matches(',').count() == 2 && parts.iter().all(|x| x.is_finite()) => {
            Ok(Vector3::new(x, y, z))
        }
        _ => Err("expected three numbers, such as 0,1.6,0.05".into()),
    }
}

/// Two widths in millimetres, in metres: `0.2,0.05`.
pub fn widths(text: &str) -> Result<[f64; 2], String> {
    let (root, tip) = text.split_once(',').ok_or("expected two numbers, such as 0.2,0.05")?;
    Ok([positive(root)? * 1e-3, not_negative(tip)? * 1e-3])
}

/// One number or two, of which the second has a default.
pub fn pair<T>(
    text: &str,
    number: impl Fn(&str) -> Result<T, String>,
    second: impl Fn(&T) -> T,
) -> Result<[T; 2], String> {
    match text.split_once(',') {
        Some((one, other)) => Ok([number(one)?, number(other)?]),
        None => {
            let one = number(text)?;
            let other = second(&one);
            Ok([one, other])
        }
    }
}

/// Width and height in pixels: `640x480`, or one number for a square.
pub fn size(text: &str) -> Result<(u32, u32), String> {
    let (width, height) = text.split_once('x').unwrap_or((text, text));
    let pixels = |side: &str| side.parse().ok().filter(|n| (1..=8192).contains(n));
    pixels(width)
        .zip(pixels(height))
        .ok_or_else(|| "expected WIDTHxHEIGHT or one number, 1 to 8192 each".into())
}

/// A finite number of 0 or more.
pub fn not_negative(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| *x >= 0.0 && x.is_finite())
        .ok_or_else(|| "expected a number of 0 or more".into())
}

/// A finite number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    not_negative(text).ok().filter(|x| *x > 0.0).ok_or_else(|| "expected a number above 0".into())
}

/// An angle in degrees.
pub fn angle(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.abs() <= 360.0)
        .ok_or_else(|| "expected degrees from -360 to 360".into())
}

/// A number from 0 to 1.
pub fn fraction(text: &str) -> Result<f64, String> {
    not_negative(text).ok().filter(|x| *x <= 1.0).ok_or_else(|| "expected a number from 0 to 1".into())
}

/// A number above 0 and up to 1.
pub fn positive_fraction(text: &str) -> Result<f64, String> {
    fraction(text).ok().filter(|x| *x >= 1e-6).ok_or_else(|| "expected a number from 0.000001 to 1".into())
}

/// Time that a shutter is open, in frames.
pub fn shutter(text: &str) -> Result<f64, String> {
    fraction(text)
        .ok()
        .filter(|x| (1e-3..=0.999).contains(x))
        .ok_or_else(|| "expected a number from 0.001 to 0.999".into())
}

/// Length of a pre-roll in seconds.
pub fn preroll(text: &str) -> Result<f64, String> {
    not_negative(text).ok().filter(|s| *s <= 60.0).ok_or_else(|| "expected 0 to 60 seconds".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_have_units_axes_and_prims() {
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
    fn durations_have_units() {
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
    fn vectors_sizes_units_and_fractions() {
        assert_eq!(vector("0,-1.5, 2"), Ok(Vector3::new(0.0, -1.5, 2.0)));
        assert!(vector("0,1").is_err() && vector("0,1,x").is_err() && vector("0,1,2,3").is_err());
        assert!(vector("0,x,1,2").is_err() && vector("0,nan,1").is_err());
        assert_eq!(size("640x480"), Ok((640, 480)));
        assert_eq!(size("300"), Ok((300, 300)));
        assert!(size("0x3").is_err() && size("9000").is_err());
        assert!(units("furlong").is_err() && units("-1").is_err() && units("0.01") == units("cm"));
        assert!(fraction("1.1").is_err() && positive("0").is_err() && not_negative("nan").is_err());
    }

    #[test]
    fn enums_have_the_names_of_the_file_format() {
        fn check<T: ValueEnum + serde::Serialize>() {
            for value in T::value_variants() {
                assert_eq!(serde_json::json!(value), name(value));
            }
        }
        check::<Scheme>();
        check::<ContactSetting>();
        check::<Resolution>();
        check::<OutputCurves>();
    }
}
