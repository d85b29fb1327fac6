//! A simulation that is stopped between any two sub-steps and taken up by another process goes on as if
//! nothing had been.

use hairbake::contact::friction::Interrupt;
use hairbake::dynamics::checkpoint::Checkpoint;
use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::sample::{self, Size, Style};
use hairbake::scene::anim::{
    ContactSetting, GuideSelection, Resolution, RootHold, Roots, Tie, TieOrientation, TiePoint,
};
use hairbake::scene::{self, Anim, Groom};
use serde_json::json;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A small head of short hair that is shaken, with a suit that breathes if `deforms`. With strands enough to
/// meet as a volume.
fn scene(folder: &Path, contact: ContactSetting, deforms: bool) -> (Groom, Anim) {
    let size = Size { wisps: Some(24), strands: Some(1440), head_subdivisions: 4 };
    sample::write(Style::Short, size, folder).unwrap();
    let shake = folder.join("shake.json");
    if deforms {
        let mut anim: serde_json::Value = serde_json::from_slice(&std::fs::read(&shake).unwrap()).unwrap();
        let [first, last] = [0, 1].map(|i| anim["frames"][i].as_i64().unwrap());
        for frame in first - 60..=last + 2 {
            // A plate that rises into the hair and sinks again.
            let y = 0.05 + 0.03 * (frame as f64 * 0.7).sin();
            let corners = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]];
            let vertices: String = corners.iter().map(|[x, z]| format!("v {x} {y} {z}\n")).collect();
            let text = format!("{vertices}f 1 3 2\nf 1 4 3\n");
            std::fs::write(folder.join(format!("plate.{frame:04}.obj")), text).unwrap();
        }
        let name = format!("plate.{first:04}.obj");
        let plate =
            json!({"name": "plate", "shape": {"type": "mesh", "file": name, "sequence": "plate.####.obj"}});
        anim["colliders"].as_array_mut().unwrap().push(plate);
        std::fs::write(&shake, anim.to_string()).unwrap();
    }
    let (mut groom, mut anim) = scene::load(&folder.join("groom.json"), &shake).unwrap();
    anim.settings.contact = contact;
    // So heavy, it sags on to the head and on to itself.
    anim.gravity *= 4.0;
    groom.materials.iter_mut().for_each(|material| material.sag_free = 0.0);
    (groom.with_default_trees(anim.settings.nodes), anim)
}

/// How far hair that meets other hair gets from hair that does not within 60 sub-steps, m.
fn effect_of_hair(groom: &Groom, anim: &Anim) -> f64 {
    let points = |contact| {
        let mut anim = anim.clone();
        anim.settings.contact = contact;
        let rods = GuideRods::new(groom, &anim);
        let mut simulation = Simulation::new(groom, &anim, &rods);
        for _ in 0..60 {
            simulation.step();
        }
        simulation.state.guides.iter().flat_map(|guide| guide.x.clone()).collect::<Vec<_>>()
    };
    let [alone, met] = [ContactSetting::Bodies, anim.settings.contact].map(points);
    alone.iter().zip(met).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

fn bytes(simulation: &Simulation) -> Vec<u8> {
    postcard::to_stdvec(&simulation.state()).unwrap()
}

#[test]
fn a_resumed_simulation_has_the_same_bits() {
    let alike = [
        (ContactSetting::Bodies, false),
        (ContactSetting::Bodies, true),
        (ContactSetting::Volume, false),
        (ContactSetting::Full, false),
    ];
    let scenes = alike.map(|(contact, deforms)| (contact, deforms, Resolution::Full));
    let wisps = [ContactSetting::Bodies, ContactSetting::Volume, ContactSetting::Full]
        .map(|contact| [Resolution::Adaptive, Resolution::Coarse].map(|r| (contact, false, r)));
    for (contact, deforms, resolution) in scenes.into_iter().chain(wisps.into_iter().flatten()) {
        let folder = tempfile::tempdir().unwrap();
        let (groom, mut anim) = scene(folder.path(), contact, deforms);
        anim.settings.resolution = resolution;
        if resolution != Resolution::Full {
            // Wisps have come apart at the last places.
            anim.settings.preroll = 0.25;
        }
        if contact == ContactSetting::Volume {
            assert!(effect_of_hair(&groom, &anim) > 1e-3, "hair does not meet");
        }
        let rods = GuideRods::new(&groom, &anim);
        let mut whole = Simulation::new(&groom, &anim, &rods);
        let (mut bodies, mut strands, mut splits) = (0, 0, 0);
        for cut in [1, 13, 60, 130] {
            while whole.taken() < cut {
                splits += whole.step().changes.splits;
            }
            let state = bytes(&whole);
            let mut resumed = Simulation::new(&groom, &anim, &rods);
            resumed.restore(postcard::from_bytes(&state).unwrap()).unwrap();
            assert_eq!(bytes(&resumed), state);
            for i in 0..12 {
                let (step, again) = (whole.step(), resumed.step());
                assert_eq!(step.guides, again.guides, "{contact:?}, {i} sub-steps after {cut}");
                assert_eq!(step.hair, again.hair, "{contact:?}, {i} sub-steps after {cut}");
                let records = step.guides.clone();
                bodies += records.iter().map(|r| r.active).sum::<u32>();
                strands += records.iter().map(|r| r.strands.active).sum::<u32>();
            }
            assert_eq!(bytes(&whole), bytes(&resumed), "{contact:?}, after {cut}");
        }
        assert!(bodies > 0, "nothing touched a body");
        assert_eq!(splits > 0, resolution == Resolution::Adaptive);
        assert_eq!(strands > 0, contact == ContactSetting::Full, "{strands} contacts of strands");
    }
}

#[test]
fn a_resumed_simulation_of_driven_and_pinned_guides_has_the_same_bits() {
    for contact in [ContactSetting::Bodies, ContactSetting::Full] {
        let folder = tempfile::tempdir().unwrap();
        let (groom, mut anim) = scene(folder.path(), contact, false);
        let some = |remainder: i32| GuideSelection {
            ids: Some(groom.guides.curves.id.iter().copied().filter(|id| id % 3 == remainder).collect()),
            ..GuideSelection::default()
        };
        anim.roots = vec![Roots { name: "pins".into(), guides: some(0), hold: RootHold::Pinned }];
        let tie = |name: &str, remainder: i32, orientation: TieOrientation, slides: bool| Tie {
            name: name.into(),
            body: 0,
            guides: some(remainder),
            point: TiePoint::Share(0.7),
            bundle: None,
            orientation,
            slides,
            releases: slides,
            times: [f64::NEG_INFINITY, f64::INFINITY],
        };
        anim.ties =
            vec![tie("clamp", 1, TieOrientation::Drawn, false), tie("ring", 2, TieOrientation::Free, true)];
        let rods = GuideRods::new(&groom, &anim);
        let mut whole = Simulation::new(&groom, &anim, &rods);
        for cut in [1, 40] {
            while whole.taken() < cut {
                whole.step();
            }
            let state = bytes(&whole);
            let mut resumed = Simulation::new(&groom, &anim, &rods);
            resumed.restore(postcard::from_bytes(&state).unwrap()).unwrap();
            for i in 0..6 {
                let (step, again) = (whole.step(), resumed.step());
                assert_eq!(step.guides, again.guides, "{contact:?}, {i} sub-steps after {cut}");
                let failed: u32 = step.guides.iter().map(|r| r.unconverged).sum();
                assert_eq!(failed, 0, "{contact:?}, {i} sub-steps after {cut}");
            }
            assert_eq!(bytes(&whole), bytes(&resumed), "{contact:?}, after {cut}");
        }
    }
}

#[test]
fn a_resumed_simulation_with_loose_hair_has_the_same_bits() {
    for contact in [ContactSetting::Bodies, ContactSetting::Volume, ContactSetting::Full] {
        let folder = tempfile::tempdir().unwrap();
        let (groom, mut anim) = scene(folder.path(), contact, false);
        let ids = groom.guides.curves.id.iter().copied().filter(|id| id % 3 == 0).collect();
        let guides = GuideSelection { ids: Some(ids), ..GuideSelection::default() };
        anim.roots = vec![Roots { name: "loose".into(), guides, hold: RootHold::Free }];
        let rods = GuideRods::new(&groom, &anim);
        let start = |steps: i64| {
            let mut simulation = Simulation::new(&groom, &anim, &rods);
            while simulation.taken() < steps {
                simulation.step();
            }
            simulation
        };
        let (mut whole, mut resumed) = (start(40), start(0));
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(bytes(&whole), pool.install(|| bytes(&start(40))), "{contact:?}, {threads} threads");
        }
        resumed.restore(postcard::from_bytes(&bytes(&whole)).unwrap()).unwrap();
        for i in 0..20 {
            let (step, again) = (whole.step(), resumed.step());
            assert_eq!(step.guides, again.guides, "{contact:?}, {i}");
            assert_eq!(step.guides.iter().map(|r| r.unconverged).sum::<u32>(), 0, "{contact:?}, {i}");
        }
        assert_eq!(bytes(&whole), bytes(&resumed), "{contact:?}");
        let fallen = |i: usize| whole.state.guides[i].x[0] - start(0).state.guides[i].x[0];
        let loose = (0..rods.simulated.len()).filter(|&i| rods.simulated[i].rod.is_free());
        assert!(loose.clone().count() > 3 && loose.clone().any(|i| fallen(i).norm() > 1e-3), "{contact:?}");
    }
}

#[test]
fn threads_change_no_bit_of_wisps_that_meet_as_a_volume_or_touch_each_other() {
    for contact in [ContactSetting::Volume, ContactSetting::Full] {
        let folder = tempfile::tempdir().unwrap();
        let (groom, mut anim) = scene(folder.path(), contact, false);
        (anim.settings.resolution, anim.settings.preroll) = (Resolution::Adaptive, 0.25);
        assert!(effect_of_hair(&groom, &anim) > 1e-3, "hair does not meet");
        assert!(on_threads(1, &groom, &anim) == on_threads(3, &groom, &anim), "{contact:?}");
    }
}

/// The state after 110 sub-steps on a number of threads.
fn on_threads(threads: usize, groom: &Groom, anim: &Anim) -> Vec<u8> {
    let rods = GuideRods::new(groom, anim);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut simulation = Simulation::new(groom, anim, &rods);
        let mut splits = 0;
        while simulation.taken() < 110 {
            splits += simulation.step().changes.splits;
        }
        assert!(splits > 0);
        bytes(&simulation)
    })
}

#[test]
fn a_state_of_another_scene_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (groom, anim) = scene(folder.path(), ContactSetting::Bodies, false);
    let rods = GuideRods::new(&groom, &anim);
    let mut simulation = Simulation::new(&groom, &anim, &rods);
    let mut other = simulation.state();
    other.guides.pop();
    let error = simulation.restore(other).unwrap_err().to_string();
    assert!(error.contains("23 parts where the scene has 24"), "{error}");
}

#[test]
fn an_abandoned_sub_step_leaves_no_trace() {
    let folder = tempfile::tempdir().unwrap();
    let (groom, anim) = scene(folder.path(), ContactSetting::Full, false);
    let rods = GuideRods::new(&groom, &anim);
    let [mut whole, mut abandoned] = [(); 2].map(|()| Simulation::new(&groom, &anim, &rods));
    let mut most = 0;
    while whole.taken() < 40 {
        if whole.taken() >= 36 {
            let before = bytes(&abandoned);
            // The question is asked in the middle of rounds and parts, which end then.
            let mut asked = 0;
            while abandoned.step_unless(&asked_for_at(asked)).is_err() {
                assert!(bytes(&abandoned) == before, "abandoned at question {asked}");
                asked = 2 * asked + 1;
            }
            most = most.max(asked);
        } else {
            abandoned.step();
        }
        whole.step();
        assert!(bytes(&abandoned) == bytes(&whole), "after {}", whole.taken());
    }
    assert!(most > 30, "no more than {most} questions");
}

/// An interrupt that is asked for when the question has been put a number of times.
fn asked_for_at(asked: usize) -> Interrupt {
    let questions = AtomicUsize::new(0);
    Interrupt::new(move || questions.fetch_add(1, Ordering::Relaxed) == asked)
}
