//! A bake with loose hair.

use crate::common::{Scene, bake, hairbake, here, python_with_usd};
use hairbake::cache::Reader;
use serde_json::{Value, json};

#[test]
fn a_bake_with_loose_hair_is_valid_and_goes_on_with_the_same_bytes() {
    let scene = Scene::import();
    let mut anim: Value = serde_json::from_slice(&here(&scene.anim)).unwrap();
    let groom = hairbake::scene::load_groom(&scene.groom).unwrap();
    let id = groom.guides.curves.id[1];
    anim["roots"] = json!([{ "name": "loose", "ids": [id], "hold": "free" }]);
    std::fs::write(&scene.anim, anim.to_string()).unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| scene.folder.path().join(name));
    let options = ["--preroll", "0", "--samples", "2", "--reactions"];
    let mut of_whole = bake(&scene.groom, &scene.anim, &whole);
    of_whole.args(["--frames", "1001-1006", "--no-pictures"]).args(options).assert().success();
    for stage in [&["simulate", "--frames", "1000-1002"][..], &["simulate"], &["interpolate"], &["assemble"]]
    {
        let mut command = hairbake();
        command.args(stage).args([&scene.groom, &scene.anim]).arg("-o").arg(&parts);
        command.args(["--shot", "1001-1006"]).args(options).assert().success();
    }
    for frame in 1000..=1007 {
        let name = format!("hair.{frame}.usdc");
        assert!(here(&whole.join(&name)) == here(&parts.join(&name)), "{name}");
    }
    let cache = Reader::open(&whole).unwrap();
    let header = cache.header().clone();
    let of = |set: &hairbake::cache::CurveSet| set.loose.iter().filter(|loose| **loose == 1).count();
    let strands = header.hair.as_ref().unwrap();
    assert_eq!(of(&header.guides), 1);
    assert!(of(strands) > 1 && of(strands) < strands.loose.len());
    // From frame 1000 on it falls along the ball, and its strands with it.
    let [first, last] = [1000, 1006].map(|frame| cache.read_frame(frame).unwrap());
    let t = 6.0 / 24.0;
    let fall = 0.5 * 9.81 * t * t / header.metres_per_unit;
    let (guides, loose) = (&header.guides, &header.guides.loose);
    for (points, loose) in guides.ranges().zip(loose) {
        let fallen = f64::from(first.guides.points[points.start][1] - last.guides.points[points.start][1]);
        assert!(
            if *loose == 1 { fallen > 0.1 * fall } else { fallen.abs() < 0.01 * fall },
            "{fallen} {fall}"
        );
    }
    let held = &last.guides.reactions.as_ref().unwrap().clamp_force;
    assert!(held.iter().zip(loose).all(|(force, loose)| (*force == [0.0; 3]) == (*loose == 1)), "{held:?}");
    let [before, after] = [first, last].map(|frame| frame.hair.unwrap().points);
    for (points, loose) in strands.ranges().zip(&strands.loose) {
        let fallen = f64::from(before[points.start][1] - after[points.start][1]);
        assert_eq!(fallen > 0.1 * fall, *loose == 1, "{fallen} {fall}");
    }
    let Some(python) = python_with_usd() else { return };
    hairbake().env("HAIRBAKE_PYTHON", &python).arg("validate").arg(&whole).assert().success();
}
