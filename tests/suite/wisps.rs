//! Wisps that guides come away from and join again.

use crate::common::soft_and_stiff;
use hairbake::dynamics::clock::substeps_to;
use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::dynamics::step_record::StepRecord;
use hairbake::rod::{RodShape, SegmentSize};
use hairbake::sample::{self, Size, Style};
use hairbake::scene::anim::{ContactSetting, Resolution};
use hairbake::scene::{self, Anim, Groom, Group, Material};
use hairbake::wisp::{self, Hierarchy};
use nalgebra::Vector3;
use serde_json::{Value, json};
use std::path::Path;

/// A head of hair that is shaken for two seconds and held still for `still` frames.
fn scene(style: Style, still: i32) -> (Groom, Anim) {
    scene_with(style, still, json!([]))
}

/// [`scene`] with these loads.
fn scene_with(style: Style, still: i32, loads: Value) -> (Groom, Anim) {
    sized_scene(style, 40, still, loads)
}

/// The same of this many wisps.
fn sized_scene(style: Style, wisps: usize, still: i32, loads: Value) -> (Groom, Anim) {
    let folder = tempfile::tempdir().unwrap();
    let size = Size { wisps: Some(wisps), strands: Some(0), head_subdivisions: 4 };
    sample::write(style, size, folder.path()).unwrap();
    let shake = folder.path().join("shake.json");
    let mut file: Value = serde_json::from_slice(&std::fs::read(&shake).unwrap()).unwrap();
    file["loads"] = loads;
    std::fs::write(&shake, file.to_string()).unwrap();
    let (groom, mut anim) = scene::load(&folder.path().join("groom.json"), &shake).unwrap();
    anim.settings.preroll = 0.5;
    anim.settings.substeps = 4;
    anim.frames.1 += still;
    (groom.with_default_trees(anim.settings.nodes), anim)
}

/// The points of all guides, m, seen from the head, and the strain nodes that move, at each frame from the
/// end of the pre-roll to `frame`.
fn run(groom: &Groom, anim: &Anim, frame: i32) -> Vec<(Vec<Vec<Vector3<f64>>>, u32)> {
    let rods = GuideRods::new(groom, anim);
    let mut simulation = Simulation::new(groom, anim, &rods);
    let (start, end) = (substeps_to(anim, anim.frames.0 - 1), substeps_to(anim, frame));
    let mut seen = Vec::new();
    let mut shape = RodShape::default();
    for taken in 1..=end {
        let nodes = simulation.step().active_nodes;
        if taken < start || (taken - start) % i64::from(anim.settings.substeps) != 0 {
            continue;
        }
        let points =
            |(state, r): (hairbake::dynamics::guide_frame::GuideFrame, &hairbake::wisp::GuideRod)| {
                shape.update(&r.rod, &r.rod.root.r, &state.q);
                (0..r.rod.points()).map(|k| shape.x(k)).collect()
            };
        seen.push((simulation.frame().into_iter().zip(&rods.simulated).map(points).collect(), nodes));
    }
    seen
}

/// Mean distance of points in two runs, over the guides' lengths.
fn apart(a: &[(Vec<Vec<Vector3<f64>>>, u32)], b: &[(Vec<Vec<Vector3<f64>>>, u32)]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for ((a, _), (b, _)) in a.iter().zip(b) {
        for (a, b) in a.iter().zip(b) {
            let length: f64 = a.windows(2).map(|p| (p[1] - p[0]).norm()).sum();
            sum += a.iter().zip(b).map(|(a, b)| (a - b).norm()).sum::<f64>() / length;
            count += a.len();
        }
    }
    sum / f64::from(count as u32)
}

#[test]
fn smaller_split_tolerances_come_nearer_to_full_resolution_with_more_active_guides() {
    let (groom, mut anim) = scene(Style::Long, 0);
    let last = anim.frames.0 + 30;
    let mut with = |resolution, tolerance| {
        (anim.settings.resolution, anim.settings.split_tolerance) = (resolution, tolerance);
        run(&groom, &anim, last)
    };
    let full = with(Resolution::Full, 0.0);
    let runs = [(Resolution::Coarse, 0.0), (Resolution::Adaptive, 0.004), (Resolution::Adaptive, 0.0004)]
        .map(|(resolution, tolerance)| with(resolution, tolerance));
    // Gathering moves nothing.
    for run in &runs {
        assert_eq!(run[0].0, full[0].0);
    }
    let [coarse, some, most] = runs.each_ref().map(|run| apart(&full, run));
    assert!(most < some && some < coarse, "{coarse} {some} {most}");
    assert!(most < 3e-3 && coarse < 0.1, "{coarse} {most}");
    let nodes = |run: &[(_, u32)]| run[1..].iter().map(|(_, nodes)| f64::from(*nodes)).sum::<f64>();
    let [coarse, some, most] = runs.each_ref().map(|run| nodes(run));
    assert!(
        coarse < 0.3 * most && coarse < some && some < most && most <= nodes(&full),
        "{coarse} {some} {most}"
    );
}

#[test]
fn what_comes_away_moves_by_itself_from_the_frame_before() {
    let (groom, mut anim) = scene(Style::Short, 0);
    // The shot begins in the middle of the shake.
    anim.frames.0 += 20;
    let last = anim.frames.0 + 4;
    let mut with = |resolution| {
        (anim.settings.resolution, anim.settings.split_tolerance) = (resolution, 1e-9);
        run(&groom, &anim, last)
    };
    let full = with(Resolution::Full);
    let [coarse, all] = [Resolution::Coarse, Resolution::Adaptive].map(with).map(|run| apart(&full, &run));
    // All come away at the end of the first frame, up to which they would be as far off as the coarse ones.
    assert!(coarse > 1e-2 && all < 0.01 * coarse, "{coarse} {all}");
}

#[test]
fn what_follows_swings_otherwise_than_its_leaders() {
    let (groom, mut anim) = scene(Style::Short, 0);
    let last = anim.frames.0 + 40;
    let mut with = |resolution| {
        anim.settings.resolution = resolution;
        run(&groom, &anim, last)
    };
    let [full, coarse] = [Resolution::Full, Resolution::Coarse].map(&mut with);
    let off = apart(&full, &coarse);
    // As its leaders do on average alone it would be off by 0.024.
    assert!(off < 0.018, "{off}");
}

#[test]
fn a_guide_with_a_load_moves_by_itself() {
    let (groom, mut anim) = scene(Style::Short, 0);
    let last = anim.frames.0 + 4;
    let ids = &groom.guides.curves.id;
    let loaded = ids.len() - 1;
    let load = json!([{ "name": "aside", "ids": [ids[loaded]], "force_n": [1e-4, 0, 0] }]);
    let loads = scene_with(Style::Short, 0, load).1.loads;
    let mut tip = |resolution, loads: &[_]| {
        (anim.settings.resolution, anim.settings.split_tolerance) = (resolution, 1.0);
        anim.loads = loads.to_vec();
        let (guides, _) = run(&groom, &anim, last).pop().unwrap();
        guides[loaded][guides[loaded].len() - 1]
    };
    let free = tip(Resolution::Adaptive, &[]);
    let [adaptive, full] = [Resolution::Adaptive, Resolution::Full].map(|of| tip(of, &loads));
    let (moved, off) = ((full - free).norm(), (adaptive - full).norm());
    assert!(moved > 0.01 && off < 1e-3 * moved, "{moved} {off}");
}

#[test]
fn when_the_head_holds_still_wisps_join_again_and_nothing_jumps() {
    joins_again(scene(Style::ShortCurly, 60));
}

#[test]
fn what_its_neighbours_hold_where_the_shake_left_it_joins_again() {
    joins_again(sized_scene(Style::Short, 200, 60, json!([])));
}

/// Fails unless guides come away in the shake of a scene, have joined again when its still frames end, and nothing
/// jumps.
fn joins_again((groom, mut anim): (Groom, Anim)) {
    anim.settings.resolution = Resolution::Adaptive;
    anim.settings.split_tolerance = 0.003;
    let frames = run(&groom, &anim, anim.frames.1);
    let nodes: Vec<u32> = frames.iter().map(|(_, nodes)| *nodes).collect();
    let (coarse, most) = (nodes[0], *nodes.iter().max().unwrap());
    assert!(most > 2 * coarse, "{coarse} {most}");
    let last = *nodes.last().unwrap();
    assert!(last < coarse + (most - coarse) / 10, "{coarse} {most} {last}");
    // Second differences of all points, at frames where something comes away or joins, and at all others.
    let mut jumps = [0.0_f64; 2];
    for (three, nodes) in frames.windows(3).zip(nodes.windows(3)) {
        let changed = usize::from(nodes[0] != nodes[1] || nodes[1] != nodes[2]);
        for (g, now) in three[2].0.iter().enumerate() {
            for (k, x) in now.iter().enumerate() {
                let second = x - three[1].0[g][k] * 2.0 + three[0].0[g][k];
                jumps[changed] = jumps[changed].max(second.norm());
            }
        }
    }
    assert!(jumps[1] > 0.0 && jumps[1] < 1.5 * jumps[0], "{jumps:?}");
}

#[test]
fn the_polylines_of_followers_are_on_the_head_that_has_moved() {
    // The volume of hair needs their points where they are; where only bodies act none are kept.
    assert!(farthest_from_its_polyline(ContactSetting::Bodies) > 0.005);
    let off = farthest_from_its_polyline(ContactSetting::Volume);
    assert!(off < 1e-9, "{off}");
}

/// Largest distance, m, of the points of a follower from its polyline, after a head has moved for 8 frames.
fn farthest_from_its_polyline(contact: ContactSetting) -> f64 {
    let (groom, mut anim) = sized_scene(Style::Short, 200, 0, json!([]));
    (anim.settings.resolution, anim.settings.contact) = (Resolution::Coarse, contact);
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    for _ in 0..substeps_to(&anim, anim.frames.0 + 8) {
        simulation.step();
    }
    let mut farthest = 0.0_f64;
    let head = anim.head_pose(simulation.time());
    for (i, rod) in rods.simulated.iter().enumerate() {
        let polyline = simulation.polyline(i);
        let on_head = (head * nalgebra::Point3::from(rod.rod.root.p)).coords;
        assert!((polyline[0] - on_head).norm() < 1e-9, "guide {i}");
        let points = &simulation.state.guides[i].x;
        let off = (0..points.len()).map(|k| (polyline[2 * k] - points[k]).norm()).fold(0.0, f64::max);
        match simulation.active().any(|active| active == i) {
            true => assert!(off < 1e-9, "guide {i}: {off}"),
            false => farthest = farthest.max(off),
        }
    }
    farthest
}

#[test]
fn what_joins_goes_on_as_it_moved() {
    let (groom, mut anim) = scene(Style::ShortCurly, 20);
    (anim.settings.resolution, anim.settings.split_tolerance) = (Resolution::Adaptive, 0.003);
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let mut shape = RodShape::default();
    // Where the tips are and which guides move by themselves, at each frame.
    let mut seen: Vec<Vec<(Vector3<f64>, bool)>> = Vec::new();
    for _ in 0..substeps_to(&anim, anim.frames.1) {
        simulation.step();
        if simulation.taken() < substeps_to(&anim, anim.frames.0) || simulation.taken() % 4 != 0 {
            continue;
        }
        let tips = simulation.frame().into_iter().zip(&rods.simulated).enumerate().map(|(i, (state, r))| {
            shape.update(&r.rod, &r.rod.root.r, &state.q);
            (shape.x(r.rod.points() - 1), simulation.state.is_active(&simulation.model, i))
        });
        seen.push(tips.collect());
    }
    // Third differences to the first frame in which a guide follows.
    let mut jumps = Vec::new();
    for four in seen.windows(4) {
        for (guide, (tip, _)) in four[3].iter().enumerate() {
            let [(one, _), (two, was_free), (three, is_free)] = [0, 1, 2].map(|k| four[k][guide]);
            if was_free && !is_free {
                jumps.push((tip - three * 3.0 + two * 3.0 - one).norm());
            }
        }
    }
    let mean = jumps.iter().sum::<f64>() / jumps.len() as f64;
    // 0.13 mm where they forget what they learnt of their leaders.
    assert!(jumps.len() > 20 && mean < 5e-5, "{} {mean}", jumps.len());
}

#[test]
fn every_guide_is_led_by_those_of_coarser_wisps() {
    let (groom, _) = scene(Style::Long, 0);
    let rods = wisp::guide_rods(&groom, SegmentSize::COARSE, false);
    let drag: Vec<_> = rods.iter().map(|r| vec![1e-5; r.rod.points()]).collect();
    let hierarchy = Hierarchy::new(&groom, &rods, &Vector3::new(0.0, -9.81, 0.0), |i| &drag[i]);
    let coarse = |i: &usize| hierarchy.leaders[*i].is_empty();
    assert_eq!((0..rods.len()).filter(coarse).count(), groom.trees.len());
    assert!(
        (0..rods.len())
            .all(|i| coarse(&i) == (hierarchy.response_error[i] == 0.0) && hierarchy.response_error[i] < 2.0)
    );
    for (i, leaders) in hierarchy.leaders.iter().enumerate().filter(|(i, _)| !coarse(i)) {
        assert!(leaders.iter().all(|(leader, _)| hierarchy.level[*leader] < hierarchy.level[i]));
        assert!((leaders.iter().map(|(_, share)| share).sum::<f64>() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn every_guide_moves_with_guides_of_its_own_material() {
    let (mut groom, _) = scene(Style::Long, 0);
    let stiffer =
        Material { young_modulus: 1.001 * groom.materials[0].young_modulus, ..groom.materials[0].clone() };
    groom.materials.push(stiffer);
    groom.groups.push(Group { material: 1, ..groom.groups[0].clone() });
    groom.guides.curves.group.iter_mut().step_by(2).for_each(|group| *group = 1);
    let rods = wisp::guide_rods(&groom, SegmentSize::COARSE, false);
    let drag: Vec<_> = rods.iter().map(|r| vec![1e-5; r.rod.points()]).collect();
    let hierarchy = Hierarchy::new(&groom, &rods, &Vector3::new(0.0, -9.81, 0.0), |i| &drag[i]);
    let group = |i: usize| groom.guides.curves.group[rods[i].guide];
    let led: Vec<usize> = (0..rods.len()).filter(|i| !hierarchy.leaders[*i].is_empty()).collect();
    assert!(led.len() > rods.len() / 2);
    for i in led {
        let parent = hierarchy.parent[i].unwrap();
        assert!(group(parent) == group(i) && hierarchy.level[parent] < hierarchy.level[i], "{i} {parent}");
    }
}

#[test]
fn guides_that_came_away_rub_as_they_do_at_full_resolution() {
    let (mut groom, mut anim) = scene(Style::Short, 0);
    let last = anim.frames.0 + 20;
    let mut with = |friction, resolution| {
        groom.materials.iter_mut().for_each(|m| m.wisp_friction = friction);
        (anim.settings.resolution, anim.settings.split_tolerance) = (resolution, 0.0004);
        run(&groom, &anim, last)
    };
    let free = with(0.0, Resolution::Full);
    let friction_force = with(60.0, Resolution::Full);
    let adaptive = with(60.0, Resolution::Adaptive);
    let (near, far) = (apart(&friction_force, &adaptive), apart(&free, &adaptive));
    assert!(near < 0.3 * far, "{near} {far}");
}

/// What a shaken head of hair that touches hair did in a sub-step: to each guide that moved by itself, to
/// what came away before it ended, and the guides that followed.
struct Seen {
    moved: Vec<StepRecord>,
    caught_up: Vec<StepRecord>,
    followed: Vec<StepRecord>,
    splits: u32,
}

/// Simulates to `frame` with contact between guides, which hold to taking their sub-steps together.
fn touch(groom: &Groom, anim: &Anim, frame: i32) -> Vec<Seen> {
    let rods = GuideRods::new(groom, anim);
    let mut simulation = Simulation::new(groom, anim, &rods);
    let mut seen = Vec::new();
    while simulation.taken() < substeps_to(anim, frame) {
        let step = simulation.step();
        let of = |free: bool| {
            let records = step.guides.iter().zip(&step.active);
            records.filter(|(_, stepped)| **stepped == free).map(|(r, _)| *r).collect()
        };
        let caught_up = step.catch_up.iter().map(|(_, r)| *r).collect();
        assert!(step.coupled);
        seen.push(Seen { moved: of(true), followed: of(false), caught_up, splits: step.changes.splits });
    }
    seen
}

#[test]
fn what_moves_by_itself_touches_its_like_and_passes_through_none() {
    let (mut groom, mut anim) = scene(Style::Long, 0);
    // Thick ones.
    groom.trees.iter_mut().flat_map(|tree| &mut tree.wisps).for_each(|wisp| wisp.strand_count = 2000);
    anim.settings.contact = ContactSetting::Full;
    let last = anim.frames.0 + 30;
    for resolution in [Resolution::Coarse, Resolution::Adaptive] {
        (anim.settings.resolution, anim.settings.split_tolerance) = (resolution, 0.02);
        let seen = touch(&groom, &anim, last);
        let sum = |of: fn(&StepRecord) -> u32| seen.iter().flat_map(|s| &s.moved).map(of).sum::<u32>();
        assert!(sum(|r| r.strands.active) > 20, "{resolution:?}: {}", sum(|r| r.strands.active));
        assert_eq!(sum(|r| r.strands.crossings + r.crossed), 0, "{resolution:?}");
        // What follows is neither here nor there.
        let met = |r: &StepRecord| r.found + r.strands.found + r.strands.rounds + r.iterations;
        assert!(seen.iter().any(|s| !s.followed.is_empty()));
        assert_eq!(seen.iter().flat_map(|s| &s.followed).map(met).sum::<u32>(), 0, "{resolution:?}");
        assert_eq!(seen.iter().any(|s| s.splits > 0), resolution == Resolution::Adaptive);
    }
}

#[test]
fn what_comes_away_divides_its_sub_steps_for_itself_until_it_is_there() {
    let (groom, mut anim) = scene(Style::Long, 0);
    (anim.settings.contact, anim.settings.resolution) = (ContactSetting::Full, Resolution::Adaptive);
    (anim.settings.split_tolerance, anim.settings.substeps, anim.settings.preroll) = (0.002, 1, 0.1);
    // It falls hard.
    anim.gravity *= 60.0;
    let seen = touch(&groom, &anim, anim.frames.0 + 1);
    let caught_up: Vec<&StepRecord> = seen.iter().flat_map(|s| &s.caught_up).collect();
    assert!(caught_up.iter().any(|r| r.halvings > 0), "of {}", caught_up.len());
    assert!(caught_up.iter().all(|r| r.strands == Default::default()));
}

/// Root mean square speed of the guides, m/s, in the first frame after the pre-roll, while the head is still.
fn speed_after_preroll(resolution: Resolution) -> f64 {
    let (groom, mut anim) = sized_scene(Style::Long, 200, 0, json!([]));
    (anim.settings.preroll, anim.settings.resolution) = (1.0, resolution);
    anim.settings.split_tolerance = 1e-9;
    assert_eq!(anim.settings.contact, ContactSetting::Volume);
    let seen = run(&groom, &anim, anim.frames.0);
    let [before, after] = [0, 1].map(|frame: usize| seen[frame].0.iter().flatten());
    let moved: Vec<f64> = before.zip(after).map(|(a, b)| (a - b).norm_squared()).collect();
    (moved.iter().sum::<f64>() / moved.len() as f64).sqrt() * anim.fps
}

#[test]
fn hair_that_its_neighbours_hold_stays_when_wisps_form() {
    let [full, coarse] = [Resolution::Full, Resolution::Coarse].map(speed_after_preroll);
    assert!(coarse < 2.0 * full, "{coarse} {full} m/s");
    // All guides come away again in the first frame.
    let adaptive = speed_after_preroll(Resolution::Adaptive);
    assert!(adaptive < 2.0 * full, "{adaptive} {full} m/s");
}

#[test]
fn what_a_lock_of_hair_catches_comes_away_from_its_wisp() {
    let folder = tempfile::tempdir().unwrap();
    let (groom, mut anim) = curtain_over_a_lock(folder.path());
    let mut run = |resolution, split_tolerance| {
        (anim.settings.resolution, anim.settings.split_tolerance) = (resolution, split_tolerance);
        let rods = GuideRods::new(&groom, &anim);
        let mut simulation = Simulation::new(&groom, &anim, &rods);
        let coarse: Vec<usize> = simulation.active().collect();
        for _ in 0..substeps_to(&anim, anim.frames.1) {
            simulation.step();
        }
        let split: Vec<usize> = simulation.active().filter(|i| !coarse.contains(i)).collect();
        let tip = |i: usize| simulation.state.guides[i].x[simulation.state.guides[i].x.len() - 1];
        (split, (0..CURTAIN).map(tip).collect::<Vec<_>>())
    };
    let (_, full) = run(Resolution::Full, 0.0);
    let (_, coarse) = run(Resolution::Coarse, 0.0);
    let (split, adaptive) = run(Resolution::Adaptive, 0.01);
    let off = |tips: &[Vector3<f64>]| tips.iter().zip(&full).map(|(a, b)| (a - b).norm()).sum::<f64>();
    // Only because their leaders, which the lock does not meet, disagree, they would be farther off than coarse wisps.
    assert!(split.len() < CURTAIN - CURTAIN / OF_WISP, "{split:?}");
    assert!(off(&adaptive) < 0.5 * off(&coarse), "{} {}", off(&adaptive), off(&coarse));
}

/// Guides of the curtain of [`curtain_over_a_lock`], and how many of them are one coarse wisp.
const CURTAIN: usize = 48;
const OF_WISP: usize = 24;

/// A wisp: its parent or -1, its root, m, whether it is of the lock, and its guide.
type Wisp = (i32, [f64; 3], bool, Option<usize>);

/// A curtain of soft hair, 10 cm wide and in two coarse wisps, that falls from 3 cm across a stiff lock of 12 mm in
/// its middle.
fn curtain_over_a_lock(folder: &Path) -> (Groom, Anim) {
    const LOCK: usize = 12;
    const NODES: usize = 8;
    let of_curtain =
        |i: usize| [-0.05 + 0.1 * ((i / 2) as f64 + 0.5) / 24.0, 0.03 + 0.003 * (i % 2) as f64, -0.04];
    let of_lock = |i: usize| {
        let (radius, turn) = (0.006 * ((i as f64 + 0.5) / LOCK as f64).sqrt(), 2.4 * i as f64);
        [radius * turn.cos(), -0.1, 0.06 + radius * turn.sin()]
    };
    let along = |[x, y, z]: [f64; 3], held: bool, share: f64| match held {
        true => [x, y + 0.1 * share, z],
        false => [x, y, z + 0.16 * share],
    };
    let guides: Vec<([f64; 3], bool)> =
        (0..CURTAIN).map(|i| (of_curtain(i), false)).chain((0..LOCK).map(|i| (of_lock(i), true))).collect();
    let line =
        |&(root, held): &([f64; 3], bool)| (0..=16).map(move |k| along(root, held, f64::from(k) / 16.0));
    // Each coarse wisp of the curtain, with its centre, then its guides; each guide of the lock alone.
    let mut wisps: Vec<Wisp> = Vec::new();
    for first in (0..CURTAIN).step_by(OF_WISP) {
        let middle = of_curtain(first + OF_WISP / 2);
        let (coarse, x) = (wisps.len() as i32, middle[0] - 0.05 / 24.0);
        wisps.push((-1, [x, middle[1] + 0.0015, middle[2]], false, None));
        wisps.extend((first..first + OF_WISP).map(|i| (coarse, of_curtain(i), false, Some(i))));
    }
    wisps.extend((0..LOCK).map(|i| (-1, of_lock(i), true, Some(CURTAIN + i))));
    let arc: Vec<f64> = (0..NODES).map(|k| k as f64 / (NODES - 1) as f64).collect();
    let sections = |of: &dyn Fn(&Wisp, f64) -> Value| -> Vec<Value> {
        wisps.iter().flat_map(|wisp| arc.iter().map(|s| of(wisp, *s)).collect::<Vec<_>>()).collect()
    };
    let frame =
        |held: bool| if held { json!([0.5_f64.sqrt(), -0.5_f64.sqrt(), 0, 0]) } else { json!([1, 0, 0, 0]) };
    let trees = wisps.iter().filter(|wisp| wisp.0 < 0).count();
    let [materials, groups_of_groom] = soft_and_stiff();
    let groom = json!({
        "format": "hairbake-groom", "version": 1,
        "materials": materials, "groups": groups_of_groom,
        "guides": {
            "points": guides.iter().flat_map(line).collect::<Vec<_>>(), "vertices": 17,
            "group": guides.iter().map(|(_, held)| u32::from(*held)).collect::<Vec<_>>()
        },
        "wisps": {
            "parent": wisps.iter().map(|wisp| wisp.0).collect::<Vec<_>>(),
            "length": wisps.iter().map(|wisp| if wisp.2 { 0.1 } else { 0.16 }).collect::<Vec<_>>(),
            "strand_count": vec![20; wisps.len()],
            "sections": vec![NODES; trees],
            "arc": arc.repeat(trees),
            "centre": sections(&|(_, root, held, _), s| json!(along(*root, *held, s))),
            "frame_wxyz": sections(&|(_, _, held, _), _| frame(*held)),
            "radius": sections(&|(.., guide), _| json!(if guide.is_some() { 0.001 } else { 0.01 })),
            "guide_count": wisps.iter().map(|wisp| u32::from(wisp.3.is_some())).collect::<Vec<_>>(),
            "guides": wisps.iter().filter_map(|wisp| wisp.3).collect::<Vec<_>>()
        }
    });
    let anim = json!({
        "format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 12], "head": "clamp",
        "bodies": [{ "name": "clamp", "track": { "translation": [[0, 0, 0]] } }],
        "settings": { "preroll_s": 0, "substeps": 4 }
    });
    let paths = ["groom.json", "anim.json"].map(|name| folder.join(name));
    std::fs::write(&paths[0], groom.to_string()).unwrap();
    std::fs::write(&paths[1], anim.to_string()).unwrap();
    scene::load(&paths[0], &paths[1]).unwrap()
}
