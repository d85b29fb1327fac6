//! A step of rods takes no memory from the system.

use crate::strand::hair;
use hairbake::contact::Bodies;
use hairbake::dynamics::batch::Batches;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::Guide;
use hairbake::dynamics::step_record::StepRecord;
use hairbake::rod::SegmentSize;
use nalgebra::{Isometry3, Vector3};

#[test]
fn a_step_of_many_rods_allocates_nothing() {
    let head = |t: f64| Isometry3::translation(0.05 * (16.0 * t).sin(), 0.0, 0.0);
    let env = Environment {
        head: &head,
        gravity: &|_| Vector3::y() * -9.81,
        wind: &[],
        bodies: &Bodies::default(),
        body: &|_, _| Isometry3::identity(),
        carrier: &|_, _| Isometry3::identity(),
        brought_out: &|_| 1.0,
    };
    let h = 1.0 / 25.0;
    let guide = |i: u32| {
        let rod = hair(0.15 + 0.005 * f64::from(i), SegmentSize::COARSE);
        let drag = vec![2e-5; rod.points()];
        Guide::new(rod, drag, 0.3, &[], &env, 0.0, h)
    };
    let mut guides: Vec<Guide> = (0..25).map(guide).collect();
    let mut records = vec![StepRecord::default(); guides.len()];
    // One thread, whose allocations are counted.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| {
        let batches = Batches::rebuild(&guides, |_| true);
        let mut step = |i: u32| {
            let span = [f64::from(i) * h, f64::from(i + 1) * h];
            batches.advance(&mut guides, &env, span, &mut records);
            records.iter().map(|r| r.iterations).sum::<u32>()
        };
        let mut iterations = 0;
        // The first second finds out how much room is needed, and that allocations are seen.
        let counted = allocation_counter::measure(|| (0..25).for_each(|i| iterations += step(i)));
        assert!(counted.count_total > 0);
        let counted = allocation_counter::measure(|| (25..50).for_each(|i| iterations += step(i)));
        assert!(iterations > 50 * 25);
        assert_eq!(counted.count_total, 0, "{counted:?}");
    });
}
