//! Hair that meets hair as a volume: neighbours drag each other along, and the record tells what the sub-step
//! softens.

use crate::common::{bake, here};
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
