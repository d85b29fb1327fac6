//! Guides that follow animated curves, from files to the cache.

use crate::common::{assert_resumed_bits, bake, hairbake, here, python, python_with_usd, write_curves};
use hairbake::Error;
use hairbake::bake::frame_record::FrameRecord;
use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::rod::RodShape;
use hairbake::scene::{self, Anim, Groom};
use nalgebra::{Isometry3, Point3, Vector3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

type V = Vector3<f64>;

const FRAMES: [i32; 2] = [1001, 1012];
const GUIDES: usize = 12;
const LENGTH: f64 = 0.25;
const SUBSTEPS: u32 = 4;

/// The head at a frame: it walks, nods and turns by up to 10 rad/s.
fn head(frame: f64) -> Isometry3<f64> {
    let t = (frame - 1001.0) / 24.0;
    let turn = V::new(0.3 * (7.0 * t).sin(), 0.9 * (11.0 * t).sin(), 0.1);
    Isometry3::new(V::new(0.2 * (6.0 * t).sin(), 0.05 * (9.0 * t).cos(), 0.8 * t), turn)
}

fn root(guide: usize) -> V {
    V::new(0.03 * (guide % 4) as f64, 0.0, 0.03 * (guide / 4) as f64)
}

/// The curve that leads a guide at a frame, in rest space: an arc whose bend changes by half a turn a second.
fn curve(guide: usize, frame: f64, points: usize) -> Vec<V> {
    let t = (frame - 1001.0) / 24.0;
    let bend = 5.0 + 3.0 * (8.0 * t + guide as f64).sin();
    let place = |k: usize| {
        let s = LENGTH * k as f64 / (points - 1) as f64;
        let (x, y) = ((1.0 - (bend * s).cos()) / bend, (bend * s).sin() / bend);
        root(guide) + V::new(x, -y, 0.1 * x)
    };
    (0..points).map(place).collect()
}

fn goal_path(folder: &Path, frame: i32) -> PathBuf {
    folder.join(format!("hair.{frame:04}.obj"))
}

/// Files of hair on a head that moves, with a goal for all of it; `change` is applied to the animation.
fn write_scene(folder: &Path, change: impl FnOnce(&mut Value)) -> [PathBuf; 2] {
    for frame in FRAMES[0] - 8..=FRAMES[1] + 2 {
        let frame_f = f64::from(frame);
        let in_world = |x: &V| (head(frame_f) * Point3::from(*x)).coords;
        // Curves of various numbers of points.
        let of = |g: usize| curve(g, frame_f, 20 + g).iter().map(in_world).collect();
        let curves: Vec<Vec<V>> = (0..GUIDES).map(of).collect();
        write_curves(&goal_path(folder, frame), curves.clone());
        let left: Vec<Vec<V>> = curves.into_iter().step_by(2).collect();
        write_curves(&folder.join(format!("left.{frame:04}.obj")), left);
        let at_rest: Vec<Vec<V>> = (0..GUIDES).map(|g| curve(g, frame_f, 20 + g)).collect();
        write_curves(&folder.join(format!("rest.{frame:04}.obj")), at_rest);
    }
    let points: Vec<[f64; 3]> = (0..GUIDES)
        .flat_map(|g| (0..9).map(move |k| root(g) + V::new(0.002 * k as f64, -LENGTH * k as f64 / 8.0, 0.0)))
        .map(Into::into)
        .collect();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        "groups": [{ "name": "left", "material": 0 }, { "name": "right", "material": 0 }],
        "guides": { "vertices": 9, "points": points, "group": (0..GUIDES).map(|g| g % 2).collect::<Vec<_>>() },
    });
    let poses: Vec<Isometry3<f64>> = (980..=1020).map(|frame| head(f64::from(frame))).collect();
    let translation: Vec<[f64; 3]> = poses.iter().map(|p| p.translation.vector.into()).collect();
    let rotation: Vec<[f64; 4]> =
        poses.iter().map(|p| [p.rotation.w, p.rotation.i, p.rotation.j, p.rotation.k]).collect();
    let track = json!({ "first_frame": 980, "translation": translation, "rotation_wxyz": rotation });
    let mut anim = json!({
        "format": "hairbake-anim", "version": 1, "fps": 24, "frames": FRAMES,
        "bodies": [{ "name": "head", "track": track }],
        "goals": [{ "name": "hair", "sequence": "hair.####.obj" }],
        "settings": { "preroll_s": 0.25, "substeps": SUBSTEPS },
    });
    change(&mut anim);
    let paths = ["groom.json", "anim.json"].map(|name| folder.join(name));
    std::fs::write(&paths[0], groom.to_string()).unwrap();
    std::fs::write(&paths[1], anim.to_string()).unwrap();
    paths
}

fn load(change: impl FnOnce(&mut Value)) -> (Groom, Anim) {
    let folder = tempfile::tempdir().unwrap();
    let [groom, anim] = write_scene(folder.path(), change);
    let (groom, anim) = scene::load(&groom, &anim).unwrap();
    (groom.with_default_trees(anim.settings.nodes), anim)
}

/// The guides at the end of each sub-step from the start of the first frame on.
struct Run {
    /// Points of all guides, m, by sub-step.
    x: Vec<Vec<V>>,
    records: Vec<FrameRecord>,
}

fn run(change: impl FnOnce(&mut Value)) -> Run {
    let (groom, anim) = load(change);
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let (mut x, mut records) = (Vec::new(), Vec::new());
    let [start, end] = FRAMES.map(|frame| anim.time(f64::from(frame)));
    while simulation.time() < end - 1e-9 {
        simulation.step();
        if simulation.time() > start - 1e-9 {
            x.push(simulation.state.guides.iter().flat_map(|g| g.x.clone()).collect());
            let mut record = FrameRecord::default();
            record.close(&simulation);
            records.push(record);
        }
    }
    Run { x, records }
}

/// Largest distance between the points of two runs at a sub-step, m.
fn apart(a: &[V], b: &[V]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// Second differences of the points over a sub-step, m/s²: the 99th percentile and the largest.
fn accelerations(x: &[Vec<V>], h: f64) -> [f64; 2] {
    let of = |w: &[Vec<V>]| -> Vec<f64> {
        w[0].iter().zip(&w[1]).zip(&w[2]).map(|((a, b), c)| (a - b * 2.0 + c).norm() / (h * h)).collect()
    };
    let mut all: Vec<f64> = x.windows(3).flat_map(of).collect();
    all.sort_by(f64::total_cmp);
    [all[all.len() * 99 / 100], all[all.len() - 1]]
}

#[test]
fn a_full_goal_is_followed_without_lag() {
    let (groom, anim) = load(|_| {});
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let (mut lag, mut fit, mut fastest) = (0.0_f64, 0.0_f64, 0.0_f64);
    let end = anim.time(f64::from(FRAMES[1]));
    // From the first sub-step of the pre-roll on: it starts in the goal's pose.
    while simulation.time() < end - 1e-9 {
        simulation.step();
        let t = simulation.time();
        for (model, state) in simulation.model.guides.iter().zip(&simulation.state.guides) {
            let goal = model.animated_goal.as_ref().unwrap();
            let (mut q, mut shape, root) = (Vec::new(), RodShape::default(), model.root(&simulation.env, t));
            goal.unknowns(t, &mut q);
            shape.update(&model.rod, &root.r, &q);
            for k in 0..model.rod.points() {
                lag = lag.max((state.x[k] - root.p - shape.x(k)).norm());
                fastest = fastest.max(state.v[k].norm());
            }
        }
        let mut record = FrameRecord::default();
        record.close(&simulation);
        assert_eq!(record.goal_guides, GUIDES as u32);
        assert!(record.goal_distance_mean_m <= record.goal_distance_max_m);
        // Between frames, strains and points take other ways.
        if (t * 24.0 - (t * 24.0).round()).abs() < 1e-6 {
            fit = fit.max(record.goal_distance_max_m);
        }
    }
    println!("lag {lag:.1e} m, distance from the curves {fit:.1e} m, at up to {fastest:.1} m/s");
    assert!(fastest > 2.0 && lag < 1e-7, "{lag} at {fastest} m/s");
    // A strand has no bend of its own at the tip.
    assert!(fit < 0.004 * LENGTH, "{fit}");
}

#[test]
fn without_weight_a_goal_changes_no_bit() {
    let free = run(|anim| anim["goals"] = json!([]));
    let none = run(|anim| anim["goals"][0]["weight"] = json!(0.0));
    assert!(free.x == none.x, "weight 0");
    // Some guides only, and not yet.
    let late = run(|anim| {
        anim["goals"][0]["weight"] = json!({ "frames": [1005, 1008], "values": [0, 1] });
    });
    assert!(free.x[..17] == late.x[..17], "before the first weight");
    assert!(apart(&free.x[30], &late.x[30]) > 0.01, "the goal must matter");
    assert!(late.records[16].goal_guides == 0 && late.records[30].goal_guides == GUIDES as u32);
    let left = run(|anim| {
        anim["goals"][0]["groups"] = json!(["left"]);
        anim["goals"][0]["ids"] = json!([0, 2, 4, 6, 8, 10]);
        anim["goals"][0]["sequence"] = json!("left.####.obj");
    });
    let per_guide = free.x[0].len() / GUIDES;
    for (a, b) in free.x.iter().zip(&left.x) {
        for (g, (a, b)) in a.chunks(per_guide).zip(b.chunks(per_guide)).enumerate() {
            assert!(g % 2 == 0 || a == b, "guide {g} has no goal");
        }
    }
}

#[test]
fn a_goal_that_comes_and_goes_makes_no_pop() {
    let h = 1.0 / 24.0 / f64::from(SUBSTEPS);
    let with = |weight: Value| run(|anim| anim["goals"][0]["weight"] = weight);
    let step = |values: [f64; 2]| json!({ "frames": [1004, 1004.01], "values": values });
    let blend = |values: [f64; 2]| json!({ "frames": [1003, 1009], "values": values });
    let of = |weight| accelerations(&with(weight).x, h);
    let (free, full) = (of(json!(0.0)), of(json!(1.0)));
    let distance = apart(&with(json!(0.0)).x[13], &with(json!(1.0)).x[13]);
    for (name, weight) in [
        ("step in", step([0.0, 1.0])),
        ("step out", step([1.0, 0.0])),
        ("blend in", blend([0.0, 1.0])),
        ("blend out", blend([1.0, 0.0])),
    ] {
        let found = of(weight);
        // What dies away at the frequency of the goal is accelerated by ω² times its distance at first.
        let most = free[1].max(full[1]) + (std::f64::consts::TAU * 4.0).powi(2) * distance;
        let at_once = distance / (h * h);
        println!(
            "{name}: {found:.0?} m/s²; free {free:.0?}, full {full:.0?}, {most:.0}, at once {at_once:.0}"
        );
        assert!(found[1] < most, "{name}: {found:?} {most}");
    }
    // It arrives: (1 + ω t) exp(−ω t) of the distance is left after 31 sub-steps, 0.3 %.
    let late = with(step([0.0, 1.0]));
    let distance = |i: usize| late.records[i].goal_distance_max_m;
    assert!(distance(44) < 0.005 * distance(13), "{} {}", distance(13), distance(44));
}

#[test]
fn the_hard_part_is_the_animation_and_the_tip_moves() {
    let full = run(|_| {});
    let part = run(|anim| anim["goals"][0]["hard_to"] = json!(0.5));
    let per_guide = full.x[0].len() / GUIDES;
    let (mut hard, mut tip) = (0.0_f64, 0.0_f64);
    for (a, b) in full.x.iter().zip(&part.x) {
        for (a, b) in a.chunks(per_guide).zip(b.chunks(per_guide)) {
            // The strain at a node acts half an element beyond it.
            let near = per_guide * 2 / 5;
            hard = hard.max(apart(&a[..near], &b[..near]));
            tip = tip.max((a[per_guide - 1] - b[per_guide - 1]).norm());
        }
    }
    assert!(hard < 1e-3 && tip > 0.03, "{hard} {tip}");
}

#[test]
fn contact_is_stronger_than_a_goal() {
    // A ball on the head, where the full goal leads the tips through it.
    let ball = json!([{
        "name": "ball", "shape": { "type": "sphere", "centre": [0.1, -0.17, 0.03], "radius": 0.06 },
    }]);
    let (groom, anim) = load(|anim| {
        anim["colliders"] = ball;
        anim["settings"]["contact"] = json!("bodies");
    });
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let (mut led, mut deepest, mut touched) = (0, 0.0_f64, 0);
    let (start, end) = (anim.time(f64::from(FRAMES[0])), anim.time(f64::from(FRAMES[1])));
    while simulation.time() < end - 1e-9 {
        let record = simulation.step();
        touched += record.guides.iter().filter(|r| r.active > 0).count();
        assert!(record.guides.iter().all(|r| r.unconverged == 0 && r.crossed == 0), "{:?}", record.guides);
        let t = simulation.time();
        if t < start {
            continue;
        }
        let centre = anim.head_pose(t) * Point3::new(0.1, -0.17, 0.03);
        for (model, state) in simulation.model.guides.iter().zip(&simulation.state.guides) {
            let root = |t: f64| model.root(&simulation.env, t);
            let goal = model.animated_goal.as_ref().unwrap().points(&model.rod, root, t);
            let inside = |x: &V| 0.06 - (x - centre.coords).norm();
            led += goal.iter().filter(|x| inside(&(*x + root(t).p)) > 0.005).count();
            deepest = state.x.iter().map(inside).fold(deepest, f64::max);
        }
    }
    println!("{led} points are led into the ball, the deepest is {deepest:.1e} m inside; {touched} contacts");
    assert!(led > 1000 && touched > 100 && deepest < 1e-5, "{led} {touched} {deepest}");
}

#[test]
fn curves_in_rest_space_are_carried_by_the_head() {
    let world = run(|_| {});
    let rest = run(|anim| {
        anim["goals"][0]["sequence"] = json!("rest.####.obj");
        anim["goals"][0]["space"] = json!("rest");
    });
    for (a, b) in world.x.iter().zip(&rest.x) {
        assert!(apart(a, b) < 1e-6, "{}", apart(a, b));
    }
}

#[test]
fn curves_have_a_unit_an_axis_and_springs_of_their_own() {
    let metres = load(|_| {}).1;
    let folder = tempfile::tempdir().unwrap();
    let files = write_scene(folder.path(), |anim| {
        let goal = &mut anim["goals"][0];
        (goal["metres_per_unit"], goal["up_axis"]) = (json!(0.01), json!("z"));
        (goal["hz"], goal["damping"]) = (json!(2.5), json!(0.7));
    });
    for frame in FRAMES[0] - 8..=FRAMES[1] + 2 {
        let path = goal_path(folder.path(), frame);
        let turned = |line: &str| match line.strip_prefix("v ") {
            Some(point) => {
                let x: Vec<f64> = point.split(' ').map(|x| 100.0 * x.parse::<f64>().unwrap()).collect();
                format!("v {} {} {}\n", x[0], -x[2], x[1])
            }
            None => format!("{line}\n"),
        };
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.lines().map(turned).collect::<String>()).unwrap();
    }
    let (_, turned) = scene::load(&files[0], &files[1]).unwrap();
    let [a, b] = [&metres, &turned].map(|anim| &anim.goals[0].curves.samples);
    assert!(a.len() == b.len() && a.iter().zip(b).all(|(a, b)| apart(a, b) < 1e-9));
    let pull = &turned.goals[0].pull;
    assert!((pull.omega - std::f64::consts::TAU * 2.5).abs() < 1e-12 && pull.damping == 0.7);
    assert!((metres.goals[0].pull.omega - std::f64::consts::TAU * 4.0).abs() < 1e-12);
}

#[test]
fn a_resumed_simulation_with_a_goal_has_the_same_bits() {
    let (groom, anim) = load(|anim| {
        anim["goals"][0]["weight"] = json!({ "frames": [1002, 1006], "values": [0, 0.9] });
        anim["goals"][0]["hard_to"] = json!({ "frames": [1002, 1012], "values": [0.2, 0.6] });
    });
    let rods = GuideRods::new(&groom, &anim);
    assert_resumed_bits(&groom, &anim, &rods, 45);
}

#[test]
fn what_is_in_a_body_is_told_by_the_drawing_and_not_by_a_goal() {
    let bodies = |anim: &mut Value| anim["settings"]["contact"] = json!("bodies");
    let (groom, anim) = load(bodies);
    let rods = GuideRods::new(&groom, &anim);
    let start = Simulation::new(&groom, &anim, &rods).time() * anim.fps;
    // Balls that the curves pass through to which the full goal leads when the simulation starts, thinner than
    // a segment is long.
    let (guides, radius) = ([2, 3, 4], 0.005);
    let centre = |g: usize| curve(g, start, 21)[15] + V::z() * 0.001;
    let ball = |g: usize| {
        let shape = json!({ "type": "sphere", "centre": centre(g).as_slice(), "radius": radius });
        json!({ "name": format!("ball{g}"), "shape": shape })
    };
    let (groom, anim) = load(|anim| {
        anim["colliders"] = guides.map(ball).into_iter().collect();
        bodies(anim);
    });
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let exempt = |simulation: &Simulation| simulation.exemptions().iter().map(|e| e.exempt).sum::<usize>();
    assert_eq!(exempt(&simulation), 0, "the hair is drawn beside the balls");
    while simulation.time() < anim.time(f64::from(FRAMES[1])) - 1e-9 {
        simulation.step();
        assert_eq!(exempt(&simulation), 0);
        if simulation.time() < anim.time(f64::from(FRAMES[0])) {
            continue;
        }
        let head = anim.head_pose(simulation.time());
        let centres = guides.map(|g| (head * Point3::from(centre(g))).coords);
        let points = simulation.state.guides.iter().flat_map(|g| &g.x);
        let nearest = points.flat_map(|x| centres.map(|c| (x - c).norm())).fold(f64::INFINITY, f64::min);
        assert!(nearest > radius - 1e-5, "{nearest}");
    }
}

/// What a scene is refused for, in one line.
fn refused(change: impl FnOnce(&mut Value), spoil: impl FnOnce(&Path)) -> String {
    let folder = tempfile::tempdir().unwrap();
    let [groom, anim] = write_scene(folder.path(), change);
    spoil(folder.path());
    match scene::load(&groom, &anim) {
        Err(error @ Error::BadInput(_)) if error.exit_code() == 65 => {
            let Error::BadInput(all) = error else { unreachable!() };
            all.iter().map(|d| format!("{}: {} ", d.key, d.message)).collect()
        }
        other => panic!("{:?}", other.map(|_| ())),
    }
}

/// `n` curves at a frame, changed by `change`.
fn spoilt(folder: &Path, frame: i32, n: usize, change: impl FnOnce(&mut Vec<Vec<V>>)) {
    let in_world = |x: &V| (head(f64::from(frame)) * Point3::from(*x)).coords;
    let of = |g: usize| curve(g, f64::from(frame), 20 + g).iter().map(in_world).collect();
    let mut curves = (0..n).map(of).collect();
    change(&mut curves);
    write_curves(&goal_path(folder, frame), curves.clone());
}

#[test]
fn goals_that_cannot_be_followed_are_refused() {
    let all = |folder: &Path, change: &dyn Fn(&mut Vec<Vec<V>>)| {
        (FRAMES[0] - 8..=FRAMES[1] + 2).for_each(|frame| spoilt(folder, frame, GUIDES, change));
    };
    let keep = |_: &mut Value| {};
    let cases: [(String, &[&str]); 17] = [
        (
            refused(keep, |f| std::fs::remove_file(goal_path(f, 1005)).unwrap()),
            &["goals[0].sequence: \"hair.####.obj\" has no file for frame 1005"],
        ),
        (
            refused(keep, |f| spoilt(f, 1004, GUIDES, |curves| curves[3].truncate(9))),
            &["at frame 1004: curve 4 has 9 points, 23 in the first file"],
        ),
        (
            refused(keep, |f| spoilt(f, 1004, GUIDES - 1, |_| {})),
            &["at frame 1004: holds 11 curves, the first file 12"],
        ),
        (
            refused(keep, |f| {
                spoilt(f, 1004, GUIDES, |curves| {
                    let root = curves[3][0];
                    curves[3].iter_mut().for_each(|x| *x = root);
                });
            }),
            &["hair.1004.obj\" has a curve without length: number 4"],
        ),
        (
            refused(keep, |f| spoilt(f, 1004, GUIDES, |curves| curves[0][1].x = f64::NAN)),
            &["hair.1004.obj\" is not a valid OBJ file: line 2"],
        ),
        (
            refused(keep, |f| all(f, &|curves| curves.truncate(9))),
            &["goals[0].sequence: the files hold 9 curves, for 12 guides"],
        ),
        (
            refused(keep, |f| all(f, &|curves| curves.iter_mut().flatten().for_each(|x| x.y += 3.0))),
            &["12 of 12 curves start 0.02 m or more from the roots of their guides: that of id"],
        ),
        (
            refused(keep, |f| {
                all(f, &|curves| {
                    let root = curves[5][0];
                    curves[5].iter_mut().for_each(|x| *x = root + (*x - root) * 1.4);
                });
            }),
            &["1 of 12 curves differ in length from their guides by more than 20 %: that of id 5 by +40 %"],
        ),
        (
            refused(|anim| anim["goals"][0]["weight"] = json!(1.5), |_| {}),
            &["goals[0].weight: 1.5 is out of range"],
        ),
        (
            refused(
                |anim| {
                    anim["goals"][0]["weight"] = json!({ "frames": [1003, 1002], "values": [0, -1] });
                },
                |_| {},
            ),
            &[
                "goals[0].weight.values[1]: -1 is out of range",
                "goals[0].weight.frames[1]: 1002 follows 1003",
            ],
        ),
        (
            refused(|anim| anim["goals"][0]["weight"] = json!("half"), |_| {}),
            &["goals[0].weight: invalid value: \"half\""],
        ),
        (
            refused(|anim| anim["goals"][0]["along"] = json!({ "arc": [0, 2], "values": [1] }), |_| {}),
            &["goals[0].along.arc[1]: 2 is out of range", "goals[0].along.values"],
        ),
        (
            refused(
                |anim| {
                    anim["goals"][0]["groups"] = json!(["left", "middle"]);
                    anim["goals"][0]["ids"] = json!([0, 1, 77, 0]);
                },
                |_| {},
            ),
            &[
                "goals[0].groups: the groom has no group \"middle\"",
                "goals[0].ids: there are no guides with 2 of the ids: 1, 77",
                "goals[0].ids: 0 is there twice",
            ],
        ),
        (
            refused(
                |anim| {
                    let mut again = anim["goals"][0].clone();
                    again["name"] = json!("again");
                    anim["goals"].as_array_mut().unwrap().push(again);
                },
                |_| {},
            ),
            &["goals[1]: the guide of id 0 is in the goal \"hair\", too"],
        ),
        (
            refused(|anim| anim["roots"] = json!([{ "name": "pins", "hold": "pinned" }]), |_| {}),
            &["roots[0]: pins roots of guides that the goal \"hair\" leads"],
        ),
        (
            refused(|anim| anim["roots"] = json!([{ "name": "loose", "hold": "free" }]), |_| {}),
            &["roots[0]: frees roots of guides that the goal \"hair\" leads"],
        ),
        (
            refused(|anim| anim["goals"][0]["sequence"] = json!("hair.obj"), |_| {}),
            &["goals[0].sequence: \"hair.obj\" is not a numbered file name"],
        ),
    ];
    for (found, words) in cases {
        words.iter().for_each(|word| assert!(found.contains(word), "{word} not in {found}"));
    }
}

#[test]
fn a_cache_is_the_goal_of_a_finer_bake() {
    if python_with_usd().is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let [groom, anim] = write_scene(folder.path(), |anim| anim["goals"] = json!([]));
    let options = ["--no-pictures", "-q", "--set", "anim.settings.nodes=6"];
    bake(&groom, &anim, &at("coarse")).args(options).assert().success();
    let frames: Vec<Value> = (FRAMES[0]..=FRAMES[1])
        .map(|frame| {
            let Isometry3 { translation, rotation: r } = head(f64::from(frame));
            let translation: [f64; 3] = translation.vector.into();
            json!({ "translation": translation, "rotation_quat_wxyz": [r.w, r.i, r.j, r.k] })
        })
        .collect();
    let motion = json!({ "fps": 24, "units": "m", "up_axis": "Y", "frames": frames });
    std::fs::write(at("walk.json"), motion.to_string()).unwrap();
    let mut import = hairbake();
    import.args(["import", "track"]).arg(at("walk.json")).args(["--pivot", "0,0,0", "--groom"]).arg(&groom);
    import.env("HAIRBAKE_PYTHON", python()).arg("--goal").arg(at("coarse/hair.usda"));
    import.arg("-o").arg(at("shot/anim.json")).assert().success();
    let again = |name: &str, options: &[&str]| -> Value {
        let mut bake = bake(&groom, &at("shot/anim.json"), &at(name));
        bake.args(["--no-pictures", "-q", "--set", "anim.settings.nodes=12"])
            .args(options)
            .assert()
            .success();
        serde_json::from_slice(&here(&at(name).join("manifest.json"))).unwrap()
    };
    let manifest = again("fine", &[]);
    let figure = |name: &str| manifest["totals"][name].as_f64().unwrap();
    let [mean, most] = ["goal_distance_mean_m", "goal_distance_max_m"].map(figure);
    println!("a rod of 12 nodes follows one of 6: {mean:.1e} m in the mean, {most:.1e} m at most");
    assert!(mean > 0.0 && most < 1e-3 * LENGTH, "{mean} {most}");
    let goals = manifest["inputs"].as_array().unwrap().iter().filter(|input| input["role"] == "goal");
    assert!(goals.count() > FRAMES[1] as usize - FRAMES[0] as usize);
    let mut validate = hairbake();
    validate.env("HAIRBAKE_PYTHON", python()).arg("validate").arg(at("fine"));
    let validated = validate.arg("--goals").arg(at("shot/anim.json")).assert().success();
    let text = String::from_utf8_lossy(&validated.get_output().stdout).into_owned();
    assert!(
        text.lines().any(|line| line.contains("goal") && line.contains("of 0.01 of the length")),
        "{text}"
    );
    // In parts, the same bytes.
    let stage = |name: &str, options: &[&str]| {
        let mut stage = hairbake();
        stage.arg(name).args([&groom, &at("shot/anim.json")]).arg("-o").arg(at("parts"));
        stage.args(["-q", "--set", "anim.settings.nodes=12"]).args(options).assert().success();
    };
    ["1000-1003", "1004-1009", "1010-1016"].iter().for_each(|part| stage("simulate", &["--frames", part]));
    stage("interpolate", &["--frames", "1000-1013"]);
    stage("assemble", &["--no-pictures"]);
    let bytes = |name: &str| here(&at(name).join("hair.1008.usdc"));
    assert!(bytes("fine") == bytes("parts"));
}
