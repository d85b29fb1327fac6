//! Hair that meets hair as a volume: neighbours drag each other along, and the record tells what the sub-step
//! softens.

use crate::common::{bake, here, soft_and_stiff};
use hairbake::dynamics::clock::substeps_to;
use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::scene::anim::ContactSetting;
use hairbake::scene::{self, Anim, Groom};
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Guides along each side of the square on which they grow, 3 mm apart.
const SIDE: usize = 5;

/// Index of the guide in the middle.
const MIDDLE: usize = SIDE * SIDE / 2;

/// Writes a tuft of hair of 10 cm that hangs in a wind of 1 m/s, which has no hold on the guide in the
/// middle. Each guide has `strands` strands.
fn tuft(folder: &Path, strands: usize) -> [PathBuf; 2] {
    let root = |i: usize| [0.003 * (i / SIDE) as f64, 0.0, 0.003 * (i % SIDE) as f64];
    let line = |[x, _, z]: [f64; 3]| (0..=10).map(move |k| json!([x, -0.01 * f64::from(k), z]));
    let guides = || 0..SIDE * SIDE;
    let strand = |n: usize| {
        let [x, y, z] = root(n / strands);
        line([x + 1e-5 * (n % strands) as f64, y, z])
    };
    let drag: Vec<f64> = guides().map(|i| if i == MIDDLE { 0.0 } else { 1.0 }).collect();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        "materials": [{ "name": "hair", "shielding": 0.0, "sag_free": 1.0 }],
        "guides": {
            "points": guides().map(root).flat_map(line).collect::<Vec<_>>(),
            "vertices": 11, "factors": { "drag": drag }
        },
        "strands": {
            "points": (0..guides().len() * strands).flat_map(strand).collect::<Vec<_>>(),
            "vertices": 11, "wisp": guides().flat_map(|i| vec![i; strands]).collect::<Vec<_>>()
        }
    });
    let anim = json!({
        "format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 6], "head": "head",
        "bodies": [{ "name": "head", "track": { "translation": [[0, 0, 0]] } }],
        "wind": [{ "velocity_m_s": { "frames": [0], "values": [[1, 0, 0]] } }],
        "settings": { "preroll_s": 0, "resolution": "full" }
    });
    let paths = ["groom.json", "anim.json"].map(|name| folder.join(name));
    std::fs::write(&paths[0], groom.to_string()).unwrap();
    std::fs::write(&paths[1], anim.to_string()).unwrap();
    paths
}

fn load(strands: usize, contact: ContactSetting) -> (Groom, Anim) {
    let folder = tempfile::tempdir().unwrap();
    let [groom, anim] = tuft(folder.path(), strands);
    let (groom, mut anim) = scene::load(&groom, &anim).unwrap();
    anim.settings.contact = contact;
    (groom.with_default_trees(anim.settings.nodes), anim)
}

/// How far the wind has moved the tip of each guide after 0.2 s, m.
fn blown(contact: ContactSetting) -> Vec<f64> {
    let (groom, anim) = load(60, contact);
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let tips = |simulation: &Simulation| -> Vec<Vector3<f64>> {
        simulation.state.guides.iter().map(|guide| guide.x[guide.x.len() - 1]).collect()
    };
    let before = tips(&simulation);
    let end = simulation.time() + 0.2;
    while simulation.time() < end {
        simulation.step();
    }
    tips(&simulation).iter().zip(before).map(|(now, before)| now.x - before.x).collect()
}

#[test]
fn a_neighbour_drags_a_guide_along() {
    for (contact, drags) in [(ContactSetting::Bodies, false), (ContactSetting::Volume, true)] {
        let moved = blown(contact);
        let others = (moved.iter().sum::<f64>() - moved[MIDDLE]) / (moved.len() - 1) as f64;
        assert!(others > 0.01, "{others}");
        match drags {
            true => assert!(moved[MIDDLE] > 0.5 * others, "{} {others}", moved[MIDDLE]),
            false => assert!(moved[MIDDLE].abs() < 1e-6, "{}", moved[MIDDLE]),
        }
    }
}

/// The largest share of hair that the sub-step softens.
fn softened(substeps: u32) -> f64 {
    let (groom, mut anim) = load(200, ContactSetting::Volume);
    anim.settings.substeps = substeps;
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let steps = substeps_to(&anim, anim.frames.1);
    (0..steps).map(|_| simulation.step().hair.softened).fold(0.0, f64::max)
}

#[test]
fn what_the_sub_step_softens_is_recorded_and_warned_of() {
    let [coarse, fine] = [1, 64].map(softened);
    assert!(coarse > 0.3 && coarse <= 1.0, "{coarse}");
    assert!(fine < 0.5 * coarse, "{fine} {coarse}");

    let folder = tempfile::tempdir().unwrap();
    let [groom, anim] = tuft(folder.path(), 200);
    let out = folder.path().join("out");
    let assert =
        bake(&groom, &anim, &out).args(["--substeps", "1", "--no-pictures", "--figures"]).assert().success();
    let text = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
    assert!(text.contains("is pressed together in "), "{text}");
    assert!(
        text.contains("hair on hair  as a volume, in which each hair of the groom stands for 1.0"),
        "{text}"
    );
    let manifest: Value = serde_json::from_slice(&here(&out.join("manifest.json"))).unwrap();
    let totals = &manifest["totals"];
    assert_eq!(totals["hair_softened"].as_f64(), Some(coarse));
    let [crowding, slip] = ["hair_crowding_max", "hair_slip"].map(|name| totals[name].as_f64().unwrap());
    assert!(crowding > 1.0 && slip > 0.0 && slip < 1.0, "{totals}");
    let page = String::from_utf8(here(&out.join("report.html"))).unwrap();
    assert!(
        ["Softened hair", "Crowding of hair", "Slip of hair", "hair on hair"]
            .iter()
            .all(|t| page.contains(t))
    );
}

#[test]
fn the_work_of_friction_and_air_is_recorded_and_nothing_is_gained() {
    let (groom, anim) = load(60, ContactSetting::Volume);
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let steps = substeps_to(&anim, anim.frames.1);
    let work: Vec<f64> = (0..steps).map(|_| simulation.step().hair.work).collect();
    // The wind moves all but the one in the middle.
    assert!(work.iter().sum::<f64>() < 0.0 && work[1..].iter().all(|work| *work != 0.0), "{work:?}");
    assert_eq!(simulation.hair_gain(), 0.0);
}

/// Guides of a lock.
const LOCK: usize = 16;

/// Two locks of parallel hair: one of soft hair, held at one end, falls on one of stiff hair beneath that it
/// crosses at this `angle`, rad.
fn crossing_locks(angle: f64) -> (Groom, Anim) {
    let hairs = |count: usize| {
        // In a disc of 6 mm, by the golden angle.
        let place = move |n: usize| {
            let (r, turn) = (0.006 * ((n as f64 + 0.5) / count as f64).sqrt(), 2.4 * n as f64);
            [r * turn.cos(), r * turn.sin()]
        };
        let lock = move |[root, course]: [Vector3<f64>; 2]| {
            let aside = course.cross(&Vector3::y());
            (0..count).map(place).flat_map(move |[a, b]| {
                let from = root + aside * a + Vector3::y() * b;
                (0..=16).map(move |k| json!((from + course * (0.01 * f64::from(k))).as_slice()))
            })
        };
        let course = Vector3::new(angle.cos(), 0.0, angle.sin());
        let falls = [Vector3::new(0.03, 0.03, 0.01) - course * 0.05, course];
        let held = [Vector3::new(-0.07, 0.0, 0.01), Vector3::x()];
        lock(falls).chain(lock(held)).collect::<Vec<Value>>()
    };
    let groups = |count: usize| [vec![0; count], vec![1; count]].concat();
    let strands = 15 * LOCK;
    let [materials, groups_of_groom] = soft_and_stiff();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        "materials": materials, "groups": groups_of_groom,
        "guides": { "vertices": 17, "points": hairs(LOCK), "group": groups(LOCK) },
        "strands": {
            "vertices": 17, "points": hairs(strands), "group": groups(strands),
            "wisp": (0..2 * strands).map(|n| n % LOCK + n / strands * LOCK).collect::<Vec<_>>()
        }
    });
    let anim = json!({
        "format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 20],
        "bodies": [{ "name": "clamp", "track": { "translation": [[0, 0, 0]] } }],
        "settings": { "preroll_s": 0 }
    });
    let folder = tempfile::tempdir().unwrap();
    let paths = ["groom.json", "anim.json"].map(|name| folder.path().join(name));
    std::fs::write(&paths[0], groom.to_string()).unwrap();
    std::fs::write(&paths[1], anim.to_string()).unwrap();
    let (groom, anim) = scene::load(&paths[0], &paths[1]).unwrap();
    (groom.with_default_trees(anim.settings.nodes), anim)
}

/// How far the first of two lines is above the other where they cross, seen from above, m.
fn above(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> Option<f64> {
    let flat = |v: Vector3<f64>, w: Vector3<f64>| v.x * w.z - v.z * w.x;
    a.windows(2).find_map(|a| {
        b.windows(2).find_map(|b| {
            let (along_a, along_b, between) = (a[1] - a[0], b[1] - b[0], b[0] - a[0]);
            let area = flat(along_a, along_b);
            let [s, t] = [flat(between, along_b) / area, flat(between, along_a) / area];
            let crosses = [s, t].iter().all(|share| (0.0..=1.0).contains(share));
            crosses.then(|| (a[0] + along_a * s - b[0] - along_b * t).y)
        })
    })
}

/// By then the hair has come to rest, but for its creep.
#[test]
fn a_lock_does_not_fall_through_one_that_it_crosses() {
    for angle in [90.0_f64, 45.0] {
        let (groom, anim) = crossing_locks(angle.to_radians());
        let rods = GuideRods::new(&groom, &anim);
        let mut simulation = Simulation::new(&groom, &anim, &rods);
        let end = simulation.time() + 0.8;
        while simulation.time() < end {
            simulation.step();
        }
        let (falls, held) = simulation.state.guides.split_at(LOCK);
        let pairs = falls.iter().flat_map(|a| held.iter().map(|b| above(&a.x, &b.x)));
        let through = pairs.filter(|above| above.is_none_or(|above| above < 0.0)).count();
        assert!(through <= LOCK * LOCK / 50, "{through} of {} pairs at {angle} degrees", LOCK * LOCK);
    }
}
