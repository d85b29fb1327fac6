//! Wisps of hair, some of which follow animated curves.

use hairbake::bake::frame_record::FrameRecord;
use hairbake::dynamics::guide::GuideModel;
use hairbake::dynamics::guide_frame::GuideFrame;
use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::math::sample_times::SampleTimes;
use hairbake::rod::RodShape;
use hairbake::sample::{self, Size, Style};
use hairbake::scene::anim::{ContactSetting, Goal, GoalCurves, GoalPull, GoalSpace, Keyframes, Resolution};
use hairbake::scene::{self, Anim, Groom};
use nalgebra::{SVector, Vector3};
use std::sync::Arc;

type V = Vector3<f64>;

const SUBSTEPS: u32 = 4;

/// A scene of wisps of long hair, some of which a goal bends from the sixth frame on. Nothing keeps the
/// guides from where they are led.
struct Leaning {
    groom: Groom,
    anim: Anim,
}

/// The end of a frame of [`Leaning`].
struct LeaningFrame {
    guides: Vec<GuideFrame>,
    tips: Vec<V>,
    active: Vec<usize>,
    record: FrameRecord,
}

impl Leaning {
    fn new(resolution: Resolution) -> Self {
        Leaning::of(40, resolution)
    }

    fn of(wisps: usize, resolution: Resolution) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let size = Size { wisps: Some(wisps), strands: Some(0), head_subdivisions: 4 };
        sample::write(Style::Long, size, folder.path()).unwrap();
        let files = ["groom.json", "shake.json"].map(|name| folder.path().join(name));
        let (groom, mut anim) = scene::load(&files[0], &files[1]).unwrap();
        (anim.settings.preroll, anim.settings.substeps, anim.settings.resolution) =
            (0.5, SUBSTEPS, resolution);
        anim.settings.contact = ContactSetting::Bodies;
        anim.colliders.clear();
        let groom = groom.with_default_trees(anim.settings.nodes);
        Leaning { groom, anim }
    }

    /// Leads `guides` aside from the sixth frame on.
    fn led(self, guides: &[usize]) -> Self {
        let weight = Keyframes {
            times: [6, 10].map(|k| self.time(k)).to_vec(),
            values: [[0.0], [1.0]].map(Into::into).to_vec(),
        };
        self.led_to(guides, weight, |_, u| V::x() * (0.03 * u * u))
    }

    /// Time of the frame `frame` after the first, s.
    fn time(&self, frame: i32) -> f64 {
        self.anim.time(f64::from(self.anim.frames.0 + frame))
    }

    /// Leads `guides` away from how they are drawn, by `away` of a point and its share of the length.
    fn led_to(mut self, guides: &[usize], weight: Keyframes<1>, away: impl Fn(&V, f64) -> V) -> Self {
        let curves = &self.groom.guides.curves;
        let mut offsets = vec![0];
        let mut points = Vec::new();
        for &g in guides {
            let n = curves.curve(g).len();
            points.extend(curves.curve(g).iter().enumerate().map(|(k, x)| x + away(x, k as f64 / n as f64)));
            offsets.push(points.len());
        }
        let constant = |x: f64| Keyframes::constant(SVector::from([x]));
        let pull =
            GoalPull { weight, along: constant(1.0), hard_to: constant(0.0), omega: 25.0, damping: 1.0 };
        let times = SampleTimes { start: self.time(0), rate: self.anim.fps, count: 1 };
        self.anim.goals = vec![Goal {
            name: "lean".into(),
            groups: None,
            ids: None,
            space: GoalSpace::Rest,
            curves: Arc::new(GoalCurves { times, offsets, samples: vec![points] }),
            pull: Arc::new(pull),
            guides: guides.to_vec(),
        }];
        self
    }

    fn frames(&self) -> Vec<LeaningFrame> {
        let Leaning { groom, anim } = self;
        let rods = GuideRods::new(groom, anim);
        let mut simulation = Simulation::new(groom, anim, &rods);
        let first = anim.frames.0;
        let mut frames = Vec::new();
        while simulation.time() < anim.time(f64::from(first + 18)) - 1e-9 {
            simulation.step();
            let frame = simulation.time() * anim.fps;
            if (frame - frame.round()).abs() < 1e-6 && frame.round() as i32 >= first {
                let mut record = FrameRecord::default();
                record.close(&simulation);
                let tips = tips(&simulation);
                let active = simulation.active().collect();
                frames.push(LeaningFrame { guides: simulation.frame(), tips, active, record });
            }
        }
        frames
    }
}

/// Where the tips of all guides are, m, of followers too.
fn tips(simulation: &Simulation) -> Vec<V> {
    let mut shape = RodShape::default();
    let tip = |(model, frame): (&GuideModel, GuideFrame)| {
        let root = model.root(&simulation.env, simulation.time());
        shape.update(&model.rod, &root.r, &frame.q);
        shape.x(model.rod.points() - 1) + root.p
    };
    simulation.model.guides.iter().zip(simulation.frame()).map(tip).collect()
}

#[test]
fn followers_leave_their_wisps_when_a_goal_begins_to_pull() {
    for resolution in [Resolution::Adaptive, Resolution::Coarse] {
        let free = Leaning::new(resolution).frames();
        let all = free[0].guides.len();
        assert!(free[0].active.len() < all, "some guides must follow");
        let guides: Vec<usize> = (0..all).filter(|g| !free[0].active.contains(g)).step_by(2).collect();
        let led = Leaning::new(resolution).led(&guides).frames();
        for (a, b) in free.iter().zip(&led).take(7) {
            let same = a.guides.iter().zip(&b.guides).all(|(a, b)| a.q == b.q) && a.active == b.active;
            assert!(same, "{resolution:?}");
        }
        let LeaningFrame { active, record, .. } = &led[18];
        assert!(guides.iter().all(|g| active.contains(g)), "{resolution:?}");
        let others_follow = active.len() < all;
        assert!(others_follow || resolution == Resolution::Adaptive, "others need not leave");
        assert_eq!(record.goal_guides as usize, guides.len());
        assert!(record.goal_distance_mean_m < 2e-3, "{resolution:?}: {}", record.goal_distance_mean_m);
    }
}

#[test]
fn a_guide_that_is_not_led_does_not_follow_one_that_is() {
    let hair = || Leaning::new(Resolution::Coarse);
    let free = hair().frames();
    // Those that lead wisps.
    let guides = free[0].active.clone();
    let led = hair().led(&guides).frames();
    let moved = |led_only: bool| {
        let tips = free[18].tips.iter().zip(&led[18].tips).enumerate();
        let moved: Vec<f64> = tips
            .filter(|(g, _)| guides.contains(g) == led_only)
            .map(|(_, (free, led))| (free - led).norm())
            .collect();
        moved.iter().sum::<f64>() / moved.len() as f64
    };
    let (of_led, of_others) = (moved(true), moved(false));
    println!("the goal moves its guides by {of_led:.4} m, others by {of_others:.4} m");
    // A coarse bake moves those that follow otherwise than they would by themselves.
    assert!(of_led > 0.02 && of_others < 0.5 * of_led, "{of_led} {of_others}");
}

#[test]
fn hair_is_at_rest_at_the_density_of_the_groom_wherever_a_goal_holds_it_first() {
    // From the start on, a goal halves the distances from the axis.
    let mut hair = Leaning::of(300, Resolution::Full);
    hair.anim.settings.contact = ContactSetting::Volume;
    let all: Vec<usize> = (0..hair.groom.guides.curves.len()).collect();
    let full = Keyframes::constant(SVector::from([1.0]));
    let Leaning { groom, anim } = hair.led_to(&all, full, |x, u| -0.5 * u * V::new(x.x, 0.0, x.z));
    let rods = GuideRods::new(&groom, &anim);
    let crowding = Simulation::new(&groom, &anim, &rods).step().hair.crowding_p95;
    assert!(crowding > 1.5, "{crowding}");
}
