//! Steps of rods allocate no memory.

use crate::strand::hair;
use hairbake::contact::Bodies;
use hairbake::dynamics::batch::Batches;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideState};
use hairbake::dynamics::step_record::StepRecord;
use hairbake::rod::{RootJoint, SegmentSize};
use nalgebra::Isometry3;

#[test]
fn step_of_many_rods_allocates_nothing() {
    let head = |t: f64| Isometry3::translation(0.05 * (16.0 * t).sin(), 0.0, 0.0);
    let env = Environment { head: Box::new(&head), ..Environment::at_rest(Bodies::default()) };
    let h = 1.0 / 25.0;
    let model = |i: u32| {
        let mut rod = hair(0.15 + 0.005 * f64::from(i), SegmentSize::COARSE);
        if i.is_multiple_of(3) {
            rod.join_root(RootJoint::Free);
        }
        let drag = vec![2e-5; rod.points()];
        GuideModel::new(rod, drag, 0.3)
    };
    let models: Vec<GuideModel> = (0..25).map(model).collect();
    let state = |model| GuideState::new(model, &[], &env, 0.0, h);
    let mut states: Vec<GuideState> = models.iter().map(state).collect();
    let mut records = vec![StepRecord::default(); models.len()];
    // One thread: allocations are counted per thread.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let batches = Batches::new(&models, |_| true);
        let mut step = |i: u32| {
            let span = [f64::from(i) * h, f64::from(i + 1) * h];
            batches.step(&models, &env, &mut states, span, ContactMode::Bodies, &mut records);
            records.iter().map(|r| r.iterations).sum::<u32>()
        };
        let mut iterations = 0;
        // The first second sizes the buffers and shows that allocations are counted.
        let counted = allocation_counter::measure(|| (0..25).for_each(|i| iterations += step(i)));
        assert!(counted.count_total > 0);
        let counted = allocation_counter::measure(|| (25..50).for_each(|i| iterations += step(i)));
        assert!(iterations > 50 * 25);
        assert_eq!(counted.count_total, 0, "{counted:?}");
    });
}
