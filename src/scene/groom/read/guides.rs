//! Guides.

use super::context::Context;
use super::curves::{CurvesFile, curves};
use crate::scene::groom::file::{FactorsFile, GuidesFile};
use crate::scene::groom::model::{Curves, Factors, Guides};
use crate::scene::json::diagnostics::MAX_REPORTED;
use crate::scene::json::key::Key;
use nalgebra::Vector3;

/// Smallest and largest extent of the guides, m: outside, a wrong unit is the likely reason.
const EXTENT: [f64; 2] = [0.5e-3, 100.0];
/// Range of the factors on stiffness; without stiffness there is no rod.
const STIFFNESS_FACTORS: [f64; 2] = [1e-3, 1e3];
/// Range of the other factors.
const FACTORS: [f64; 2] = [0.0, 1e3];
/// Allowed factors on weights.
const WEIGHT_FACTORS: [f64; 2] = [0.0, 1.0];

/// The guides, and their number; each `None` after an error in what it depends on.
pub fn guides(context: &mut Context, file: GuidesFile) -> (Option<Guides>, Option<usize>) {
    let GuidesFile { vertices, points, id, group, root_uv, root_frame_wxyz, factors } = file;
    let curves = curves(context, "guides", CurvesFile { vertices, points, id, group, root_uv });
    let count = curves.as_ref().map(Curves::len);
    let root_frame = match root_frame_wxyz {
        Some(array) => {
            let key = Key::at("guides.root_frame_wxyz");
            context.load_frames(&key, array).and_then(|frames| {
                let expected = count.unwrap_or(frames.len());
                let ok = context.diagnostics.expect_len(&key, frames.len(), expected, "guide");
                ok.then_some(Some(frames))
            })
        }
        None => Some(None),
    };
    let factors = read_factors(context, factors, count);
    if let Some(curves) = &curves {
        check_extent(context, curves);
    }
    let guides = || Some(Guides { curves: curves?, root_frame: root_frame?, factors: factors? });
    (guides(), count)
}

fn read_factors(context: &mut Context, file: FactorsFile, guides: Option<usize>) -> Option<Factors> {
    let FactorsFile { stiffness, damping, friction, drag, goal, goal_weight } = file;
    let mut names = Factors::NAMES.into_iter();
    let read = [stiffness, damping, friction, drag, goal, goal_weight].map(|array| {
        let name = names.next().unwrap_or_default();
        let key = Key::at("guides.factors").name(name);
        let Some(array) = array else { return Some(None) };
        let factors = context.load_per_curve(&key, array, guides)?;
        let [low, high] = match name {
            "stiffness" => STIFFNESS_FACTORS,
            "goal_weight" => WEIGHT_FACTORS,
            _ => FACTORS,
        };
        let bad = factors.iter().enumerate().filter(|(_, f)| !(low..=high).contains(*f));
        let bad: Vec<_> = bad.take(MAX_REPORTED).collect();
        for (i, f) in &bad {
            let message = format!("{f} is out of range");
            let allowed = format!("{low} to {high}");
            let help = "use a value in the allowed range";
            context.diagnostics.add(&key.index(*i), message, allowed, help);
        }
        bad.is_empty().then_some(Some(factors))
    });
    let [stiffness, damping, friction, drag, goal, goal_weight] = read;
    Some(Factors::of([stiffness?, damping?, friction?, drag?, goal?, goal_weight?]))
}

/// Checks the size of the groom: a wrong unit makes it far too small or too large.
fn check_extent(context: &mut Context, guides: &Curves) {
    let corner = |start: f64, pick: fn(f64, f64) -> f64| {
        guides.points.iter().fold(Vector3::repeat(start), |corner, p| corner.zip_map(p, pick))
    };
    let size = (corner(f64::NEG_INFINITY, f64::max) - corner(f64::INFINITY, f64::min)).norm();
    let [low, high] = EXTENT;
    if !(low..=high).contains(&size) {
        let unit = context.convention.metres_per_unit;
        let message = format!("the groom is {size:.3e} m across with {unit} m per unit");
        let allowed = format!("a groom {low} m to {high} m across");
        let help = "set the metres per unit of the points: 1 for metres, 0.01 for centimetres";
        context.diagnostics.add(&Key::at("metres_per_unit"), message, allowed, help);
    }
}
