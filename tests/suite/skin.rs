//! Hair on a skin that deforms, from files to the cache.

use crate::common::{assert_resumed_bits, write_curves};
use hairbake::bake::base_cache::GroupSelection;
use hairbake::bake::control::Control;
use hairbake::bake::frame_record::FrameRecord;
use hairbake::bake::job::{Job, JobOptions};
use hairbake::cache::{CurveFrame, Reader};
use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::math::spline::ArcSpline;
use hairbake::scene::anim::Resolution;
use hairbake::scene::{self, Anim, Groom, LoadOptions};
use hairbake::{Error, bake};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

type V = Vector3<f64>;

const FRAMES: [i32; 2] = [1001, 1008];

/// Vertices along each side of a sheet, 1 cm apart.
const SIDE: usize = 15;

/// Vertex (i, j) of the sheet at rest, flat.
fn flat(i: usize, j: usize) -> V {
    V::new(0.01 * i as f64 - 0.07, 0.0, 0.01 * j as f64 - 0.07)
}

/// The sheet as it rolls up by a third of a turn, waves, and is thrown, at a frame.
fn rolling(frame: i32) -> Vec<V> {
    let t = f64::from(frame - FRAMES[0]) / 24.0;
    let roll = 14.0 * (0.5 - 0.5 * (9.0 * t).cos());
    let place = UnitQuaternion::from_scaled_axis(V::new(0.5, 1.5, -0.3) * t);
    let rolled = |x: V| {
        let (angle, wave) = (roll * x.x, 0.004 * (60.0 * x.z + 20.0 * t).sin());
        let along =
            if roll > 1e-6 { V::new(angle.sin(), angle.cos() - 1.0, 0.0) / roll } else { V::x() * x.x };
        place * (along + V::new(angle.sin(), angle.cos(), 0.0) * wave + V::z() * x.z)
            + V::new(t, 0.5 * t, 0.0)
    };
    (0..SIDE * SIDE).map(|v| rolled(flat(v / SIDE, v % SIDE))).collect()
}

fn triangles() -> Vec<[usize; 3]> {
    let cells = (0..SIDE - 1).flat_map(|i| (0..SIDE - 1).map(move |j| SIDE * i + j));
    cells.flat_map(|a| [[a, a + 1, a + SIDE + 1], [a, a + SIDE + 1, a + SIDE]]).collect()
}

fn write_obj(path: &Path, vertices: &[V]) {
    let vertices: String =
        vertices.iter().map(|x| format!("v {:.12} {:.12} {:.12}\n", x.x, x.y, x.z)).collect();
    let faces: String =
        triangles().iter().map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1)).collect();
    std::fs::write(path, vertices + &faces).unwrap();
}

/// A strand of `length` that rises from `root` and leans over.
fn strand(root: V, length: f64) -> impl Iterator<Item = [f64; 3]> {
    (0..8).map(move |k| f64::from(k) / 7.0).map(move |s| {
        let x = root + V::new(0.3 * s, 1.0, 0.1) * (length * s);
        [x.x, x.y, x.z]
    })
}

/// The vertices that guides stand on, and the triangles in whose middle the strands do.
fn places() -> (Vec<usize>, Vec<usize>) {
    let guides = (0..36).map(|g| SIDE * (2 + 2 * (g / 6)) + 2 + 2 * (g % 6)).collect();
    (guides, (0..2 * (SIDE - 1) * (SIDE - 1)).step_by(2).collect())
}

/// Files of short fur on the sheet, which rolls up; `change` is applied to the animation.
fn write_scene(folder: &Path, change: impl FnOnce(&mut Value)) -> [PathBuf; 2] {
    let rest: Vec<V> = (0..SIDE * SIDE).map(|v| flat(v / SIDE, v % SIDE)).collect();
    write_obj(&folder.join("sheet.obj"), &rest);
    for frame in FRAMES[0] - 8..=FRAMES[1] + 2 {
        write_obj(&folder.join(format!("sheet.{frame:04}.obj")), &rolling(frame));
    }
    let (guides, strands) = places();
    let middle = |t: usize| triangles()[t].iter().map(|v| rest[*v]).sum::<V>() / 3.0;
    let nearest = |x: V| {
        let distance = |g: &usize| (rest[guides[*g]] - x).norm();
        (0..guides.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap()
    };
    let points = |roots: Vec<V>| roots.into_iter().flat_map(|root| strand(root, 0.025)).collect::<Vec<_>>();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        "materials": [{ "name": "fur", "section": { "radius_m": 3e-4 }, "sag_free": 1.0, "wisp_friction_per_s": 5 }],
        "guides": { "vertices": 8, "points": points(guides.iter().map(|v| rest[*v]).collect()) },
        "strands": {
            "vertices": 8,
            "points": points(strands.iter().map(|t| middle(*t)).collect()),
            "wisp": strands.iter().map(|t| nearest(middle(*t))).collect::<Vec<_>>(),
        },
    });
    let mut anim = json!({
        "format": "hairbake-anim", "version": 1, "fps": 24, "frames": FRAMES, "skins": ["sheet"],
        "colliders": [{ "name": "sheet", "shape": { "type": "mesh", "file": "sheet.obj", "sequence": "sheet.####.obj" } }],
        "settings": { "preroll_s": 0.25 },
    });
    change(&mut anim);
    let paths = ["groom.json", "anim.json"].map(|name| folder.join(name));
    std::fs::write(&paths[0], groom.to_string()).unwrap();
    std::fs::write(&paths[1], anim.to_string()).unwrap();
    paths
}

fn load(folder: &Path, change: impl FnOnce(&mut Value)) -> Result<(Groom, Anim), Error> {
    let [groom, anim] = write_scene(folder, change);
    scene::load(&groom, &anim)
}

fn baked(folder: &Path, change: impl FnOnce(&mut Value)) -> Reader {
    bake_files(folder, write_scene(folder, change))
}

/// Bakes a groom and an animation.
fn bake_files(folder: &Path, files: [PathBuf; 2]) -> Reader {
    let options = JobOptions { overwrite: true, ..JobOptions::default() };
    bake_with(&folder.join("out"), &files, options).unwrap()
}

fn bake_with(out: &Path, [groom, anim]: &[PathBuf; 2], options: JobOptions) -> Result<Reader, Error> {
    let inputs = bake::input_records(groom, anim, &LoadOptions::default()).unwrap();
    let (groom, anim) = scene::load(groom, anim).unwrap();
    let job = Job::begin(groom, anim, inputs, options, out)?;
    bake::bake(&job, &Control::default(), |record, _, _| assert!(record.broken().is_empty(), "{record:?}"))?;
    Reader::open(out)
}

/// The first `n` points of each curve of a frame.
fn starts(curves: &CurveFrame, counts: &[i32], n: usize) -> Vec<Vec<V>> {
    let mut points = curves.points.iter().map(|p| V::new(p[0].into(), p[1].into(), p[2].into()));
    counts
        .iter()
        .map(|count| points.by_ref().take(*count as usize).collect::<Vec<_>>()[..n].to_vec())
        .collect()
}

#[test]
fn roots_and_strands_follow_the_skin() {
    let folder = tempfile::tempdir().unwrap();
    let cache = baked(folder.path(), |_| {});
    assert!(cache.header().colliders[0].is_skin);
    let (guides, strands) = places();
    let counts = [&cache.header().guides.counts, &cache.header().hair.as_ref().unwrap().counts];
    let (mut turned, mut leans) = (0.0_f64, 0.0_f64);
    for &number in cache.frames() {
        let frame = cache.read_frame(number).unwrap();
        let skin = rolling(number);
        for (root, v) in starts(&frame.guides, counts[0], 1).iter().zip(&guides) {
            assert!((root[0] - skin[*v]).norm() < 1e-6, "guide on vertex {v} in frame {number}");
        }
        let hair = starts(frame.hair.as_ref().unwrap(), counts[1], 2);
        for (root, t) in hair.iter().zip(&strands) {
            let [a, b, c] = triangles()[*t].map(|v| skin[v]);
            assert!((root[0] - (a + b + c) / 3.0).norm() < 1e-6, "strand on triangle {t} in frame {number}");
            // At the border, the mean over the triangles around a corner is one-sided.
            let border = |v: &usize| [v / SIDE, v % SIDE].iter().any(|i| *i == 0 || *i == SIDE - 1);
            if triangles()[*t].iter().any(border) {
                continue;
            }
            // Bristles stand as they were drawn, whichever way the skin turns.
            let normal = (b - a).cross(&(c - a)).normalize();
            turned = turned.max(normal.angle(&V::y()));
            leans = leans
                .max(((root[1] - root[0]).angle(&normal) - V::new(0.3 / 7.0, 1.0, 0.1).angle(&V::y())).abs());
        }
    }
    assert!(turned > 0.9 && leans < 0.15, "{turned} {leans}");
}

#[test]
fn roots_ride_on_the_nearest_of_several_skins() {
    let folder = tempfile::tempdir().unwrap();
    let files = write_scene(folder.path(), |anim| {
        anim["skins"] = json!(["sheet", "plate"]);
        let plate = json!({ "name": "plate", "shape": { "type": "mesh", "file": "plate.obj" } });
        anim["colliders"].as_array_mut().unwrap().push(plate);
    });
    // A plate beside the sheet, which stands still, with a guide and a strand.
    let away = |v: usize| flat(v / SIDE, v % SIDE) + V::z() * 0.3;
    write_obj(&folder.path().join("plate.obj"), &(0..SIDE * SIDE).map(away).collect::<Vec<_>>());
    let mut groom: Value = serde_json::from_slice(&std::fs::read(&files[0]).unwrap()).unwrap();
    let roots = [7 * SIDE + 7, 7 * SIDE + 8].map(away);
    for (set, root) in ["guides", "strands"].into_iter().zip(roots) {
        let points = groom[set]["points"].as_array_mut().unwrap();
        points.extend(strand(root, 0.025).map(|x| json!(x)));
    }
    let (guides, strands) = places();
    groom["strands"]["wisp"].as_array_mut().unwrap().push(json!(guides.len()));
    std::fs::write(&files[0], groom.to_string()).unwrap();
    let cache = bake_files(folder.path(), files);
    assert!(cache.header().colliders.iter().all(|collider| collider.is_skin));
    let counts = [&cache.header().guides.counts, &cache.header().hair.as_ref().unwrap().counts];
    for &number in cache.frames() {
        let frame = cache.read_frame(number).unwrap();
        let (skin, hair) = (rolling(number), frame.hair.as_ref().unwrap());
        let first = |curves: &CurveFrame, counts| starts(curves, counts, 1).concat();
        let (of_guides, of_hair) = (first(&frame.guides, counts[0]), first(hair, counts[1]));
        for (root, v) in of_guides.iter().zip(&guides) {
            assert!((root - skin[*v]).norm() < 1e-6, "guide on vertex {v} in frame {number}");
        }
        let still = [of_guides[guides.len()], of_hair[strands.len()]];
        for (root, at_rest) in still.iter().zip(&roots) {
            assert!((root - at_rest).norm() < 1e-6, "{root} in frame {number}");
        }
    }
}

/// A wall that has come over the root of upright hair, or in front of it where it leans.
#[test]
fn hair_that_a_part_of_its_skin_closes_on_before_the_shot_leaves_that() {
    for (front, along) in [(-0.008, V::y()), (0.008, V::new(0.9, 0.44, 0.0))] {
        let [root, tip] = depths_in_wall(front, along);
        assert!((root + front).abs() < 1e-4, "the root is {root} m deep, not {}", -front);
        assert!(tip < 5e-4, "the tip is {tip} m inside");
    }
}

/// A floor and a wall of one mesh: the hair of 2.5 cm is on the floor, in the direction `along`. At rest the
/// wall is 10 cm away; in the whole shot its side is at x = `front`, m, where the root is at 0. Returns how
/// far root and tip are inside it at the end, m.
fn depths_in_wall(front: f64, along: V) -> [f64; 2] {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let write = |name: String, front: f64| {
        let blocks = [
            [V::new(-0.1, -0.06, -0.1), V::new(0.1, 0.0, 0.1)],
            [V::new(front, -0.04, -0.05), V::new(front + 0.05, 0.06, 0.05)],
        ];
        let corner = |i: usize| V::from_fn(|k, _| blocks[i / 8][i >> k & 1][k]);
        let vertices = (0..16).map(corner).map(|x| format!("v {:.9} {:.9} {:.9}\n", x.x, x.y, x.z));
        let faces = (0..2).flat_map(|b| quads.map(|quad| quad.map(|i| 8 * b + i + 1)));
        let faces = faces.map(|[a, b, c, d]| format!("f {a} {b} {c} {d}\n"));
        std::fs::write(folder.join(name), vertices.chain(faces).collect::<String>()).unwrap();
    };
    write("body.obj".into(), 0.1);
    for frame in FRAMES[0] - 2..=FRAMES[1] + 2 {
        write(format!("body.{frame:04}.obj"), front);
    }
    let points: Vec<[f64; 3]> = (0..8).map(|k| (along * (0.025 * f64::from(k) / 7.0)).into()).collect();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        "materials": [{ "name": "fur", "sag_free": 1.0 }],
        "guides": { "vertices": 8, "points": points },
    });
    let anim = json!({
        "format": "hairbake-anim", "version": 1, "fps": 24, "frames": FRAMES, "skins": ["body"],
        "colliders": [{ "name": "body", "shape": { "type": "mesh", "file": "body.obj", "sequence": "body.####.obj" } }],
        "settings": { "preroll_s": 0.5 },
    });
    let paths = ["groom.json", "anim.json"].map(|name| folder.join(name));
    std::fs::write(&paths[0], groom.to_string()).unwrap();
    std::fs::write(&paths[1], anim.to_string()).unwrap();
    let cache = bake_files(folder, paths);
    let guides = cache.read_frame(FRAMES[1]).unwrap().guides;
    [0, guides.points.len() - 1].map(|k| f64::from(guides.points[k][0]) - front)
}

#[test]
fn a_skin_that_deforms_goes_with_its_body() {
    let folder = tempfile::tempdir().unwrap();
    let still = |place: [f64; 3]| json!({ "first_frame": 990, "translation": vec![place; 25] });
    let (away, head) = ([0.1, 0.2, -0.3], [0.0; 3]);
    let cache = baked(folder.path(), |anim| {
        anim["bodies"] = json!([
            { "name": "head", "track": still(head) },
            { "name": "chest", "track": still(away) },
        ]);
        anim["colliders"][0]["body"] = json!("chest");
    });
    let (guides, _) = places();
    for &number in cache.frames() {
        let frame = cache.read_frame(number).unwrap();
        let skin = rolling(number);
        for (root, v) in starts(&frame.guides, &cache.header().guides.counts, 1).iter().zip(&guides) {
            assert!((root[0] - skin[*v] - V::from(away)).norm() < 1e-6, "vertex {v} in frame {number}");
        }
    }
}

#[test]
fn a_base_with_another_motion_of_the_skin_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    // A head with a track of its own is the same in all bakes.
    let track = json!({ "first_frame": 990, "translation": vec![[0, 0, 0]; 25] });
    let files = write_scene(folder.path(), |anim| {
        anim["bodies"] = json!([{ "name": "head", "track": track }]);
        anim["settings"]["preroll_s"] = json!(0.0);
    });
    let mut groom: Value = serde_json::from_slice(&std::fs::read(&files[0]).unwrap()).unwrap();
    let (guides, strands) = places();
    for (set, count) in [("guides", guides.len()), ("strands", strands.len())] {
        groom[set]["group"] = (0..count).map(|c| c * 2 / count).collect();
    }
    groom["groups"] = json!([{ "name": "left", "material": 0 }, { "name": "right", "material": 0 }]);
    std::fs::write(&files[0], groom.to_string()).unwrap();
    let [base, out] = ["base", "out"].map(|name| folder.path().join(name));
    bake_with(&base, &files, JobOptions::default()).unwrap();
    let only = GroupSelection { groups: vec!["left".into()], base };
    let again = || {
        let options = JobOptions { only: Some(&only), overwrite: true, ..JobOptions::default() };
        bake_with(&out, &files, options)
    };
    again().unwrap();
    let last = rolling(FRAMES[1]).iter().map(|x| x + V::x() * 1e-3).collect::<Vec<_>>();
    write_obj(&folder.path().join(format!("sheet.{:04}.obj", FRAMES[1])), &last);
    match again() {
        Err(Error::BadInput(found)) => assert!(found[0].message.contains("the skin \"sheet\""), "{found:?}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_skin_that_does_not_deform_carries_as_its_body_does() {
    let turning = |skins: Value| {
        move |anim: &mut Value| {
            let half: Vec<f64> = (0..20).map(|i| 0.2 * (0.5 * f64::from(i)).sin()).collect();
            let q: Vec<_> = half.iter().map(|h| [h.cos(), 0.0, h.sin(), 0.0]).collect();
            anim["bodies"] = json!([{ "name": "head", "track": { "first_frame": 993, "rotation_wxyz": q } }]);
            anim["colliders"][0]["shape"].as_object_mut().unwrap().remove("sequence");
            anim["skins"] = skins;
        }
    };
    let [on_skin, on_head] = [json!(["sheet"]), json!([])].map(|skins| {
        let folder = tempfile::tempdir().unwrap();
        let cache = baked(folder.path(), turning(skins));
        cache.frames().iter().map(|f| cache.read_frame(*f).unwrap()).collect::<Vec<_>>()
    });
    for (a, b) in on_skin.iter().zip(&on_head) {
        assert_eq!((&a.guides, &a.head), (&b.guides, &b.head));
        let [a, b] = [a, b].map(|frame| frame.hair.as_ref().unwrap());
        for (a, b) in a.points.iter().zip(&b.points).chain(a.velocities.iter().zip(&b.velocities)) {
            assert!((V::from(a.map(f64::from)) - V::from(b.map(f64::from))).norm() < 2e-6, "{a:?} {b:?}");
        }
    }
}

#[test]
fn a_resumed_simulation_on_a_skin_has_the_same_bits() {
    for resolution in [Resolution::Full, Resolution::Adaptive, Resolution::Coarse] {
        let folder = tempfile::tempdir().unwrap();
        let (groom, mut anim) = load(folder.path(), |_| {}).unwrap();
        anim.settings.resolution = resolution;
        let groom = groom.with_default_trees(anim.settings.nodes);
        let rods = GuideRods::new(&groom, &anim);
        assert!(rods.sampling.is_some(), "hair does not meet");
        assert_resumed_bits(&groom, &anim, &rods, 70);
    }
}

#[test]
fn goals_are_carried_by_the_skin() {
    // The bristles sway in the space of the groom.
    let swaying = |root: V, frame: i32| {
        let lean = 0.2 + 0.2 * (1.3 * f64::from(frame)).sin();
        (0..8).map(move |k| 0.025 * f64::from(k) / 7.0).map(move |s| root + V::new(lean * s, s, 6.0 * s * s))
    };
    let exempt = |goal: bool| {
        let folder = tempfile::tempdir().unwrap();
        let (guides, _) = places();
        for frame in FRAMES[0] - 8..=FRAMES[1] + 2 {
            let curves = guides.iter().map(|v| swaying(flat(v / SIDE, v % SIDE), frame));
            write_curves(&folder.path().join(format!("bristles.{frame:04}.obj")), curves);
        }
        let (groom, anim) = load(folder.path(), |anim| {
            if goal {
                anim["goals"] = json!([{ "name": "sway", "sequence": "bristles.####.obj", "space": "rest" }]);
            }
        })
        .unwrap();
        let groom = groom.with_default_trees(anim.settings.nodes);
        let rods = GuideRods::new(&groom, &anim);
        let mut simulation = Simulation::new(&groom, &anim, &rods);
        let exempt: Vec<usize> = simulation.exemptions().iter().map(|e| e.exempt).collect();
        while goal && simulation.time() < anim.time(f64::from(FRAMES[1])) - 1e-9 {
            simulation.step();
            let mut record = FrameRecord::default();
            record.close(&simulation);
            assert_eq!(record.goal_guides as usize, guides.len());
            assert!(record.goal_distance_max_m < 5e-4, "{}", record.goal_distance_max_m);
        }
        exempt
    };
    assert_eq!([true, false].map(exempt), [[0], [0]], "nothing is drawn in the skin");
}

/// A hand over the middle of the sheet, which turns with it and carries what was above the middle at rest.
fn hand(frame: i32) -> Isometry3<f64> {
    let t = f64::from(frame - FRAMES[0]) / 24.0;
    let middle = rolling(frame)[SIDE * (SIDE / 2) + SIDE / 2];
    Isometry3::new(middle, V::new(0.5, 1.5, -0.3) * t)
}

#[test]
fn a_braid_grows_on_a_skin_and_ends_in_a_hand() {
    // The four guides around the middle.
    let braid = [14, 15, 20, 21];
    // Where each is held, in the groom's pose.
    let held = |root: V| {
        let line: Vec<V> = strand(root, 0.025).map(V::from).collect();
        let spline = ArcSpline::through(&line).unwrap();
        spline.at(0.02).x
    };
    let folder = tempfile::tempdir().unwrap();
    let files = write_scene(folder.path(), |anim| {
        let frames: Vec<i32> = (FRAMES[0] - 8..=FRAMES[1] + 2).collect();
        let poses: Vec<Isometry3<f64>> = frames.iter().map(|frame| hand(*frame)).collect();
        let translation: Vec<[f64; 3]> = poses.iter().map(|pose| pose.translation.vector.into()).collect();
        let rotation: Vec<[f64; 4]> = poses
            .iter()
            .map(|pose| [pose.rotation.w, pose.rotation.i, pose.rotation.j, pose.rotation.k])
            .collect();
        let track = json!({ "first_frame": frames[0], "translation": translation, "rotation_wxyz": rotation, "smoothing_hz": 0 });
        anim["bodies"] = json!([{ "name": "world" }, { "name": "hand", "track": track }]);
        anim["colliders"][0]["body"] = json!("world");
        anim["ties"] = json!([{ "name": "end", "body": "hand", "ids": braid, "arc_m": 0.02 }]);
    });
    // Fine hair: a tie gives way to bristles.
    let mut groom: Value = serde_json::from_slice(&std::fs::read(&files[0]).unwrap()).unwrap();
    groom["materials"][0]["section"]["radius_m"] = json!(4e-5);
    std::fs::write(&files[0], groom.to_string()).unwrap();
    let cache = bake_files(folder.path(), files);
    let (guides, _) = places();
    let counts = &cache.header().guides.counts;
    let points = counts[0] as usize;
    let mut moved = 0.0_f64;
    for &number in cache.frames() {
        let frame = cache.read_frame(number).unwrap();
        let skin = rolling(number);
        let curves = starts(&frame.guides, counts, points);
        for g in braid {
            assert!((curves[g][0] - skin[guides[g]]).norm() < 1e-6, "guide {g} in frame {number}");
            let at = held(flat(guides[g] / SIDE, guides[g] % SIDE));
            let end = (hand(number) * nalgebra::Point3::from(at)).coords;
            let to_end = |ends: &[V]| {
                let along = ends[1] - ends[0];
                let u = ((end - ends[0]).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
                (ends[0] + along * u - end).norm()
            };
            let off = curves[g].windows(2).map(to_end).fold(f64::INFINITY, f64::min);
            assert!(off < 2e-4, "guide {g} is {off} m from the hand in frame {number}");
            moved = moved.max((end - at).norm());
        }
    }
    assert!(moved > 0.2, "{moved}");
}

#[test]
fn the_frame_of_reference_is_that_of_the_head_or_fits_the_roots() {
    let folder = tempfile::tempdir().unwrap();
    let (groom, anim) = load(folder.path(), |_| {}).unwrap();
    let roots: Vec<V> = groom.guides.curves.roots().collect();
    let off = |t: f64| {
        let fit = anim.head_pose(t);
        let apart = |(x, root): (&V, &scene::RootBinding)| {
            let now = anim.carried(root, t) * nalgebra::Point3::from(*x);
            (now - fit * nalgebra::Point3::from(*x)).norm()
        };
        let sum: f64 = roots.iter().zip(&groom.guides.curves.skin).map(apart).sum();
        sum / roots.len() as f64
    };
    // The sheet is thrown by 30 cm, and rolls.
    let furthest = (0..=28).map(|k| off(anim.time(1001.0 + 0.25 * f64::from(k)))).fold(0.0, f64::max);
    assert!(furthest < 0.02, "{furthest}");
    let head =
        json!([{ "name": "head", "track": { "first_frame": 990, "translation": vec![[1, 2, 3]; 25] } }]);
    let (_, anim) = load(folder.path(), |anim| anim["bodies"] = head).unwrap();
    assert_eq!(anim.head_pose(anim.time(1004.0)).translation.vector, V::new(1.0, 2.0, 3.0));
}

/// What a scene is refused for, in one line.
fn refused(change: impl FnOnce(&mut Value), spoil: impl FnOnce(&Path)) -> String {
    let folder = tempfile::tempdir().unwrap();
    let [groom, anim] = write_scene(folder.path(), change);
    spoil(folder.path());
    match scene::load(&groom, &anim) {
        Err(error @ Error::BadInput(_)) if error.exit_code() == 65 => {
            let Error::BadInput(all) = error else { unreachable!() };
            all.iter().map(|d| format!("{}: {} ({}) ", d.key, d.message, d.allowed)).collect()
        }
        other => panic!("{:?}", other.map(|_| ())),
    }
}

#[test]
fn skins_that_cannot_carry_roots_are_refused() {
    let says =
        |text: &str, words: &[&str]| words.iter().for_each(|word| assert!(text.contains(word), "{text}"));
    let ball = json!({ "name": "ball", "shape": { "type": "sphere", "centre": [0, 0, 0], "radius": 0.01 } });
    let text = refused(
        |anim| {
            anim["colliders"].as_array_mut().unwrap().push(ball);
            anim["skins"] = json!(["sheet", "shet", "ball", "sheet"]);
        },
        |_| {},
    );
    says(
        &text,
        &["skins[1]: there is no collider \"shet\"", "(names of meshes among the colliders: \"sheet\")"],
    );
    says(&text, &["skins[2]: the collider \"ball\" is not a mesh", "skins[3]: \"sheet\" is named twice"]);
    // The mesh at rest lies elsewhere than the groom.
    let away = |anim: &mut Value| anim["colliders"][0]["shape"]["up_axis"] = json!("z");
    let text = refused(away, |_| {});
    says(
        &text,
        &["skins: ", "of the 36 roots of the guides are 0.02 m or more from the skin sheet at rest (id "],
    );
    says(&text, &["roots of the strands", "m)"]);
    let collapsed = |folder: &Path| {
        let mut vertices = rolling(1004);
        vertices.iter_mut().take(8 * SIDE).for_each(|x| *x = V::zeros());
        write_obj(&folder.join("sheet.1004.obj"), &vertices);
    };
    let text = refused(|_| {}, collapsed);
    says(
        &text,
        &["colliders.sheet: the skin around the root of id 0 of the guides", "no area at frame 1004"],
    );
    let text = refused(|_| {}, |folder| std::fs::remove_file(folder.join("sheet.1005.obj")).unwrap());
    says(&text, &["no file for frame 1005"]);
}
