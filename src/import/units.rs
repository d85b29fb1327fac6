//! The unit and up axis of a file: given, declared in the file, or guessed.

use super::plain::Declared;
use super::source::Source;
use crate::scene::{Convention, UpAxis};
use crate::{Diagnostic, Error, Result};
use nalgebra::Vector3;

/// Plausible sizes of a head of hair (diagonal of the bounding box), m.
pub(super) const HAIR_SIZE: [f64; 2] = [0.1, 2.0];
/// Plausible sizes of a head or body mesh (diagonal of the bounding box), m.
pub(super) const BODY_SIZE: [f64; 2] = [0.15, 3.0];

/// The unit and up axis of `points`: as given in `source`, else as the file declares. A missing unit is
/// guessed such that the size of the bounding box lies in `plausible` (m), and the guess is noted. A missing
/// up axis is the format's default.
///
/// # Errors
/// A unit that is not positive, or that cannot be guessed.
pub(super) fn convention(
    source: &Source,
    declared: Declared,
    points: &[Vector3<f64>],
    plausible: [f64; 2],
    notes: &mut Vec<String>,
) -> Result<Convention> {
    let default_up = if source.extension().as_deref() == Some("hair") { UpAxis::Z } else { UpAxis::Y };
    let up = source.up.or(declared.up).unwrap_or(default_up);
    if let Some(metres_per_unit) = source.metres_per_unit.or(declared.metres_per_unit) {
        if !(metres_per_unit > 0.0 && metres_per_unit.is_finite()) {
            return Err(error(
                source,
                format!("{metres_per_unit} m"),
                "a positive length",
                "give --units as m, cm, mm, in, ft or metres per unit",
            ));
        }
        return Ok(Convention { metres_per_unit, up });
    }
    let size = bounding_box_diagonal(points);
    for (name, metres_per_unit) in [("metres", 1.0), ("centimetres", 0.01), ("millimetres", 0.001)] {
        let metres = size * metres_per_unit;
        if (plausible[0]..=plausible[1]).contains(&metres) {
            notes
                .push(format!("unit guessed: {name}, for a size of {metres:.2} m (set --units to override)"));
            return Ok(Convention { metres_per_unit, up });
        }
    }
    Err(error(
        source,
        format!(
            "cannot be guessed: the size of {size:.3} units is not {} to {} m in m, cm or mm",
            plausible[0], plausible[1]
        ),
        "a given unit, or a size from which it can be guessed",
        "set --units (FILE:UNITS for a mesh): m, cm, mm, in, ft or metres per unit",
    ))
}

/// Diagonal of the bounding box of the finite points.
fn bounding_box_diagonal(points: &[Vector3<f64>]) -> f64 {
    let finite = || points.iter().filter(|p| p.iter().all(|x| x.is_finite()));
    let low = finite().fold(Vector3::repeat(f64::INFINITY), |a, p| a.inf(p));
    let high = finite().fold(Vector3::repeat(f64::NEG_INFINITY), |a, p| a.sup(p));
    (high - low).norm()
}

fn error(source: &Source, what: String, allowed: &str, remedy: &str) -> Error {
    Diagnostic::new(&source.path, "units", what, allowed, remedy).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_is_guessed_from_the_size_and_noted() {
        let guess = |size: f64| {
            let mut notes = Vec::new();
            let points = [Vector3::zeros(), Vector3::new(0.0, size, 0.0)];
            convention(&Source::new("a.tfx"), Declared::default(), &points, HAIR_SIZE, &mut notes)
                .map(|c| (c.metres_per_unit, notes))
        };
        let (metres, notes) = guess(40.0).unwrap();
        assert_eq!(metres, 0.01);
        assert!(notes[0].contains("centimetres") && notes[0].contains("0.40 m"));
        assert_eq!(guess(0.4).unwrap().0, 1.0);
        assert_eq!(guess(400.0).unwrap().0, 0.001);
        assert!(matches!(guess(1e6), Err(Error::BadInput(_))));
    }

    #[test]
    fn a_given_unit_and_axis_override_declared_ones() {
        let declared = Declared { metres_per_unit: Some(0.1), up: Some(UpAxis::Z) };
        let of = |source| convention(&source, declared, &[], HAIR_SIZE, &mut Vec::new()).unwrap();
        assert_eq!(of(Source::new("a.usd")), Convention { metres_per_unit: 0.1, up: UpAxis::Z });
        let given = Source { metres_per_unit: Some(2.0), up: Some(UpAxis::Y), ..Source::new("a.usd") };
        assert_eq!(of(given), Convention { metres_per_unit: 2.0, up: UpAxis::Y });
    }

    #[test]
    fn hair_files_are_z_up_by_default() {
        let points = [Vector3::zeros(), Vector3::x()];
        let up = |source: &Source| {
            convention(source, Declared::default(), &points, HAIR_SIZE, &mut Vec::new()).unwrap().up
        };
        assert_eq!(up(&Source::new("a.hair")), UpAxis::Z);
        assert_eq!(up(&Source { up: Some(UpAxis::Y), ..Source::new("a.hair") }), UpAxis::Y);
        assert_eq!(up(&Source::new("a.tfx")), UpAxis::Y);
    }
}
