//! Both kinds of detection at once: a segment that is far from a body on all of its way is looked at once.

use super::bodies::Bodies;
use super::cache::ContactCache;
use super::candidates::near;
use super::polyline::{BodyMotion, Contact, MovingPolyline, is_exempt};

impl Bodies {
    /// [`Bodies::candidates`] into `candidates`, and [`Bodies::impacts`] into `impacts`.
    pub fn detect(
        &self,
        motions: &[BodyMotion],
        line: &MovingPolyline,
        reach: f64,
        cache: &mut ContactCache,
        candidates: &mut Vec<Contact>,
        impacts: &mut Vec<Contact>,
    ) {
        let segments = line.x0.len().saturating_sub(1);
        cache.resize(self.len(), segments);
        for (b, (body, motion)) in self.bodies.iter().zip(motions).enumerate() {
            cache.enter(line, motion);
            for (k, clearance) in line.clearances(b).iter().enumerate().filter(|(_, c)| !is_exempt(c)) {
                let far = near(clearance, reach, line.by_part);
                if !cache.stays_beyond(&body.solid, b * segments + k, k, motion.times, far) {
                    self.candidates_of([b, k], motion, line, reach, cache, candidates);
                    self.impact_of([b, k], motion, line, cache, impacts);
                }
            }
        }
    }
}
