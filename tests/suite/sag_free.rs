//! The sag-free start of a bake: what carries the hair where the head is.

use crate::common::{Scene, bake, here};
use serde_json::{Value, json};

/// Number of stiffened guides of a bake of one guide of 30 cm, which lies level 2 mm above the top of the head;
/// the head is a slab, if there is one, and moves.
fn stiffened(slab: bool) -> u64 {
    let scene = Scene::import();
    let points: Vec<Value> = (0..=30).map(|i| json!([0.01 * f64::from(i), 0.102, 0.0])).collect();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        "materials": [{ "name": "hair", "sag_free": 1.0 }],
        "guides": { "points": points, "vertices": [31] }
    });
    let mut anim: Value = serde_json::from_slice(&here(&scene.anim)).unwrap();
    let plane = json!({ "type": "plane", "point": [0.0, 0.1, 0.0], "normal": [0.0, 1.0, 0.0] });
    // A collider that names no body is carried by the head.
    anim["colliders"] = if slab { json!([{ "name": "slab", "shape": plane }]) } else { json!([]) };
    std::fs::write(&scene.groom, groom.to_string()).unwrap();
    std::fs::write(&scene.anim, anim.to_string()).unwrap();
    let out = scene.folder.path().join("out");
    bake(&scene.groom, &scene.anim, &out).assert().success();
    let manifest: Value = serde_json::from_slice(&here(&out.join("manifest.json"))).unwrap();
    manifest["scene_figures"]["sag_free"]["stiffened"].as_u64().unwrap()
}

#[test]
fn hair_that_lies_on_the_moving_head_is_carried_by_it() {
    assert_eq!([stiffened(true), stiffened(false)], [0, 1]);
}
