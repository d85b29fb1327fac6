//! Bodies that a shot finds in the hair come there from where the groom was drawn.

use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::scene;
use nalgebra::{Isometry3, Vector3};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

type V = Vector3<f64>;

/// The board beside the hair, at rest: its corners, m.
const BOARD: [[f64; 2]; 3] = [[0.04, 0.06], [-0.3, -0.05], [-0.1, 0.1]];

/// Turn about z of the board when the shot starts, rad: its lower part is behind the hair.
const TURN: f64 = -0.5;

/// Turn about z.
fn turned(angle: f64) -> Isometry3<f64> {
    Isometry3::rotation(V::z() * angle)
}

/// Writes the board, where `place` takes it.
fn write_board(path: &Path, place: &Isometry3<f64>) {
    write_boxes(path, &[(BOARD, *place)]);
}

/// Writes boxes with these corners, m, each where its place takes it.
fn write_boxes(path: &Path, boxes: &[([[f64; 2]; 3], Isometry3<f64>)]) {
    let mut text = String::new();
    for (corners, place) in boxes {
        for corner in 0..8 {
            let at = V::new(corners[0][corner & 1], corners[1][corner >> 1 & 1], corners[2][corner >> 2]);
            let at = place.transform_point(&at.into());
            writeln!(text, "v {} {} {}", at.x, at.y, at.z).unwrap();
        }
    }
    for first in (0..boxes.len()).map(|i| 8 * i) {
        for face in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
            let [a, b, c, d] = face.map(|corner| first + corner);
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
    }
    std::fs::write(path, text).unwrap();
}

/// Five hairs of 20 cm that hang at this x, m, among a board that `shape` describes on a body with this `track`.
fn hanging(folder: &Path, x: f64, shape: Value, track: Value, preroll: f64) -> (scene::Groom, scene::Anim) {
    hanging_on(&[], folder, x, shape, track, preroll)
}

/// The same, with roots on these skins.
fn hanging_on(
    skins: &[&str],
    folder: &Path,
    x: f64,
    shape: Value,
    track: Value,
    preroll: f64,
) -> (scene::Groom, scene::Anim) {
    let line = |i: usize| (0..=10).map(move |k| json!([x, -0.02 * f64::from(k), 0.003 * i as f64]));
    let groom = json!({
        "format": "hairbake-groom", "version": 1, "materials": [{ "name": "hair", "sag_free": 1.0 }],
        "guides": { "points": (0..5).flat_map(line).collect::<Vec<_>>(), "vertices": 11 }
    });
    let anim = json!({
        "format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 3], "head": "head",
        "skins": skins,
        "bodies": [{ "name": "head" }, { "name": "torso", "track": track }],
        "colliders": [{ "name": "board", "body": "torso", "thickness_m": 5e-4, "shape": shape }],
        "settings": { "preroll_s": preroll, "substeps": 4, "contact": "bodies", "resolution": "full" }
    });
    let [groom_path, anim_path] = ["groom.json", "anim.json"].map(|name| folder.join(name));
    std::fs::write(&groom_path, groom.to_string()).unwrap();
    std::fs::write(&anim_path, anim.to_string()).unwrap();
    let (groom, anim) = scene::load(&groom_path, &anim_path).unwrap();
    (groom.with_default_trees(anim.settings.nodes), anim)
}

/// A track that is turned all the time.
fn at_turn(angle: f64) -> Value {
    let (s, c) = (0.5 * angle).sin_cos();
    json!({ "translation": [[0, 0, 0]], "rotation_wxyz": [[c, 0, 0, s]] })
}

/// Segments of guides that are exempt from contact.
fn exempt(simulation: &Simulation) -> usize {
    simulation.exemptions().iter().map(|of_body| of_body.exempt).sum()
}

/// How far points of the hair are behind the near side of the board as it is in the shot, m.
fn behind(simulation: &Simulation) -> f64 {
    let to_board = turned(TURN).inverse();
    let local = simulation
        .state
        .guides
        .iter()
        .flat_map(|guide| &guide.x)
        .map(|x| to_board * nalgebra::Point3::from(*x));
    local.filter(|x| x.y < BOARD[1][1]).map(|x| x.x - BOARD[0][0]).fold(f64::NEG_INFINITY, f64::max)
}

/// The simulation at the start of the pre-roll and at its end, of these hairs.
fn settle(groom: &scene::Groom, anim: &scene::Anim, then: impl Fn(&Simulation, &Simulation)) {
    let rods = GuideRods::new(groom, anim);
    let start = Simulation::new(groom, anim, &rods);
    let mut end = Simulation::new(groom, anim, &rods);
    while end.time() < anim.time(0.0) - 1e-9 {
        end.step();
    }
    then(&start, &end);
}

#[test]
fn a_body_that_lies_in_the_hair_when_the_shot_starts_pushes_it_aside() {
    let folder = tempfile::tempdir().unwrap();
    let rest = folder.path().join("board.obj");
    write_board(&rest, &Isometry3::identity());
    for frame in 1..=3 {
        write_board(&folder.path().join(format!("moved.{frame}.obj")), &turned(TURN));
    }
    let rigid = (json!({ "type": "mesh", "file": "board.obj" }), at_turn(TURN));
    let deforming = (json!({ "type": "mesh", "file": "board.obj", "sequence": "moved.#.obj" }), at_turn(0.0));
    for (shape, track) in [rigid, deforming] {
        let (groom, anim) = hanging(folder.path(), 0.0, shape.clone(), track.clone(), 1.0);
        settle(&groom, &anim, |start, end| {
            assert_eq!([exempt(start), exempt(end)], [0, 0], "{shape}");
            assert!(behind(start) > 0.02, "{}: the board is not behind the hair", behind(start));
            assert!(behind(end) < 0.0, "{shape}: {}", behind(end));
        });
        // Without a pre-roll there is no time for it.
        let (groom, anim) = hanging(folder.path(), 0.0, shape, track, 0.0);
        settle(&groom, &anim, |start, end| {
            assert!(exempt(start) > 0 && behind(end) > 0.02);
        });
    }
}

/// A character of one mesh: some roots follow the head, others, as at the nape, in part.
#[test]
fn a_skin_that_lies_in_the_hair_when_the_shot_starts_brings_its_roots_along() {
    let folder = tempfile::tempdir().unwrap();
    let [crown, nape] = [[-0.02, 0.0045], [0.0045, 0.03]].map(|z| [[-0.03, 0.03], [1e-5, 0.01], z]);
    let (still, moved) = (Isometry3::identity(), Isometry3::translation(-0.015, 0.01, 0.0) * turned(-0.3));
    write_boxes(&folder.path().join("board.obj"), &[(BOARD, still), (crown, still), (nape, still)]);
    for frame in 1..=3 {
        let boxes = [(BOARD, turned(TURN)), (crown, still), (nape, moved)];
        write_boxes(&folder.path().join(format!("moved.{frame}.obj")), &boxes);
    }
    let shape = json!({ "type": "mesh", "file": "board.obj", "sequence": "moved.#.obj" });
    let (groom, anim) = hanging_on(&["board"], folder.path(), 0.0, shape, at_turn(0.0), 1.0);
    let roots = |simulation: &Simulation| simulation.state.guides.iter().map(|g| g.x[0]).collect::<Vec<_>>();
    settle(&groom, &anim, |start, end| {
        assert!(start.started_in.iter().map(|body| body.runs_up).eq([true]), "{:?}", start.started_in);
        for (k, (from, to)) in roots(start).into_iter().zip(roots(end)).enumerate() {
            let drawn = nalgebra::Point3::new(0.0, 0.0, 0.003 * k as f64);
            let place = if k < 2 { drawn } else { moved * drawn };
            assert!((to - place.coords).norm() < 1e-6, "{k}: {to}");
            assert!((from - to).norm() > 1e-3, "{k}: {from}");
        }
        assert_eq!([exempt(start), exempt(end)], [0, 0]);
        assert!(behind(start) > 0.02 && behind(end) < 0.0, "{} {}", behind(start), behind(end));
    });
}

/// A ball that comes down on the hair from above its roots.
#[test]
fn a_body_that_would_sweep_through_the_roots_comes_from_outside() {
    let folder = tempfile::tempdir().unwrap();
    let (rest, shot) = (V::new(0.0, 0.5, 0.006), V::new(0.03, -0.15, 0.006));
    let ball = json!({ "type": "sphere", "centre": rest.as_slice(), "radius": 0.05 });
    let track = json!({ "translation": [(shot - rest).as_slice()] });
    let (groom, anim) = hanging(folder.path(), 0.0, ball, track, 1.0);
    settle(&groom, &anim, |start, end| {
        let from = (start.env.body)(0, start.time()) * nalgebra::Point3::from(rest) - shot;
        assert!(from.x > 0.015 && from.coords.yz().norm() < 0.5 * from.x, "{from}");
        assert_eq!([exempt(start), exempt(end)], [0, 0]);
        for x in end.state.guides.iter().flat_map(|guide| &guide.x) {
            assert!((x - shot).norm() > 0.05 && x.x < 0.01, "{x}");
        }
    });
}

#[test]
fn a_body_through_which_the_hair_is_drawn_stays_where_the_shot_has_it() {
    let folder = tempfile::tempdir().unwrap();
    write_board(&folder.path().join("board.obj"), &Isometry3::identity());
    let shape = json!({ "type": "mesh", "file": "board.obj" });
    let (groom, anim) = hanging(folder.path(), 0.05, shape, at_turn(0.2 * TURN), 1.0);
    settle(&groom, &anim, |start, _| {
        assert!(exempt(start) > 0);
        let (pose, own) = ((start.env.body)(0, start.time()), turned(0.2 * TURN));
        assert!((pose.inverse() * own).rotation.angle() < 1e-12, "{pose}");
    });
}

#[test]
fn hair_has_the_same_natural_shape_wherever_bodies_are_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let natural = |at_rest: Isometry3<f64>, turn: f64| {
        write_board(&folder.path().join("board.obj"), &at_rest);
        let shape = json!({ "type": "mesh", "file": "board.obj" });
        let (groom, mut anim) = hanging(folder.path(), BOARD[0][0] - 0.005, shape, at_turn(turn), 1.0);
        // The hair leans on the board.
        anim.gravity = V::new(9.81, 0.0, 0.0);
        let rods = GuideRods::new(&groom, &anim);
        rods.simulated.iter().map(|guide| format!("{:?}", guide.rod)).collect::<Vec<_>>()
    };
    let drawn = natural(Isometry3::identity(), 0.0);
    assert!(natural(Isometry3::identity(), TURN) == drawn);
    assert!(natural(Isometry3::translation(1.0, 0.0, 0.0), 0.0) != drawn, "the board bears nothing");
}
