use super::*;
use crate::contact::Feature;
use nalgebra::{Isometry3, Matrix3};

#[test]
fn no_force_takes_what_is_asked_of_a_contact_down_to_the_surface() {
    let (rod, _) = Rod::wound();
    let keep = 5e-4;
    for h in [1e-6, 1e-4, 5e-3] {
        let motion = Motion { times: [0.0, h], start: Isometry3::identity(), end: Isometry3::identity() };
        for before in [1e-6, 2e-5, 2e-4, 5e-4, 1e-3] {
            let x = [Vector3::new(0.0, before, 0.0), Vector3::new(0.01, before, 0.0)];
            let line = Polyline { x0: &x, x1: &x, clearance: &[[keep; 2]] };
            let touch = Touch {
                rod: &rod,
                bodies: &Bodies::default(),
                motions: &[motion],
                clearance: line.clearance,
                x0: &x,
                fastest: 0.0,
                ties: &[],
                friction: [0.3.into(); 2],
                across: 1.0,
                root: &Pose { r: Matrix3::identity(), p: Vector3::zeros() },
                load: &Load::default(),
            };
            let mut contact = Contact {
                segment: 0,
                u: 0.5,
                body: 0,
                feature: Feature::Face(0),
                normal: Vector3::y(),
                point: [Vector3::zeros(); 2],
                gap: 0.0,
                friction: None,
            };
            let tolerated = touch.tolerated(&line, &contact);
            contact.gap = line.gap(&contact) - tolerated;
            let (asked, yielding) = (keep + tolerated, touch.yielding(&line, &contact));
            assert!(asked - PRESSED * yielding > 0.1 * asked, "{h} {before}: {yielding} of {asked}");
            // Where the step has the time it is a share of what is kept.
            assert!(h < 1e-3 || (yielding / keep - 1.0).abs() < 1e-12, "{h} {before}: {yielding}");
        }
    }
}
