//! The record of a frame, as in the manifest and the report.

pub use crate::dynamics::run_up::StartedIn;
use crate::dynamics::simulation::{Simulation, SubstepRecord};
use crate::rod::RodShape;
use crate::strands::{Depths, Jumps, RigidMotion};
use serde::{Deserialize, Serialize};

/// Record of one frame. Independent of the number of threads; timings are kept apart.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Frame number.
    pub frame: i32,
    /// Sub-steps of active guides since the last frame.
    pub solves: u64,
    /// Newton steps per guide and sub-step: mean.
    pub newton_mean: f64,
    /// Newton steps per guide and sub-step: largest.
    pub newton_max: u32,
    /// Sub-steps that were halved.
    pub halvings: u32,
    /// Ids of guides that halved a sub-step on their own. The moments in between are not written, so their
    /// written path is not exact.
    pub divided: Vec<i32>,
    /// Ids of guides with a solve that did not converge; they were carried rigidly with their roots instead.
    pub unconverged: Vec<i32>,
    /// Strain nodes with unknowns of the active guides at the end of the frame.
    pub active_nodes: u32,
    /// Guides that split from their wisps.
    pub splits: u32,
    /// Guides that merged into their wisps.
    pub merges: u32,
    /// Contacts of guides with bodies in the last sub-step of the frame.
    pub contacts_found: u32,
    /// Contacts of them with a non-zero reaction.
    pub contacts_active: u32,
    /// Contact rounds per guide and sub-step: largest.
    pub contact_rounds: u32,
    /// Relative residual of the contact reactions: largest. For a solve that did not settle, evaluated where
    /// it ended.
    pub contact_residual: f64,
    /// Solves accepted after all rounds before the guide came to rest on the bodies.
    pub unsettled: u32,
    /// Deepest point of a guide inside a body, m; 0 if none. Exempt segments are excluded in the solver's
    /// steps, points that the groom places inside, or next to a stretch drawn through, in what is written at
    /// the frame.
    pub penetration_m: f64,
    /// Solves whose motion was truncated at a surface, or taken whole because no part of it is admissible.
    pub shortened: u32,
    /// Contact pairs of guides in the last sub-step of the frame.
    pub strand_contacts_found: u32,
    /// Contacts of them with a non-zero reaction.
    pub strand_contacts_active: u32,
    /// Rounds of contact between guides per sub-step: largest.
    pub strand_rounds: u32,
    /// Relative residual of the reactions between guides: largest.
    pub strand_residual: f64,
    /// Coupled solves accepted after all rounds before the guide came to rest on other guides.
    pub strands_unsettled: u32,
    /// Motions of guides through a body, and segments of guides that passed through each other.
    pub crossings: u32,
    /// Motions of guides that were truncated, or that ignore other guides, because no coupled solution was
    /// found.
    pub strands_shortened: u32,
    /// Largest share of the hair, by volume, whose pressure against other hair is less than the law's because
    /// of the length of the sub-step.
    pub hair_softened: f64,
    /// Volume fraction of the hair, with contact as a volume, over the 95th percentile by volume in the
    /// groom's pose: 95th percentile, largest of the sub-steps.
    pub hair_crowding_p95: f64,
    /// The same: largest.
    pub hair_crowding_max: f64,
    /// Root mean square of the hair's velocity against the mean of the hair around, over that in head space,
    /// at the start of the last sub-step of the frame; 0 where the latter is below 5 cm/s.
    pub hair_slip: f64,
    /// Work that hair does on hair as a volume over the frame, J: negative where it brakes.
    pub hair_work_j: f64,
    /// Where that work since the start is positive, its share of the kinetic energy of the hair and of what it would
    /// have at 5 cm/s.
    pub hair_gain: f64,
    /// Largest share of the distance that contact keeps between guides that was missing at the end of a sub-step: 1 where
    /// they touch.
    pub strand_missing: f64,
    /// Work that contact between guides does on them over the frame, J: negative where it brakes them. Each
    /// guide counts as its hairs, of which the median guide has one.
    pub strand_work_j: f64,
    /// Where that work is positive, its share of the kinetic energy of the guides and of what they would have
    /// at the speed at which contact may push them apart.
    pub strand_gain: f64,
    /// Largest distance of a tied place from its goal at the end of the frame, m.
    pub tie_slack_m: f64,
    /// Guides that an animated goal pulls at the frame.
    pub goal_guides: u32,
    /// Distance of their points from the animated curves at the same arc length, which start at the roots of
    /// the guides: mean, by weight, m.
    pub goal_distance_mean_m: f64,
    /// The same: largest of points of weight 1, m.
    pub goal_distance_max_m: f64,
    /// Speed of the guides' points relative to what carries their roots, the head or a skin: mean, m/s.
    pub speed_mean_m_s: f64,
    /// The same: 95th percentile, m/s.
    pub speed_p95_m_s: f64,
    /// The same: largest, m/s.
    pub speed_max_m_s: f64,
    /// Largest relative error of the length of a segment of a guide, as cubics through its points and midpoints.
    pub length_drift: f64,
    /// Largest angle by which a segment of a guide turns, rad.
    pub segment_turn_rad: f64,
    /// Guide segments exempt from contact, counted once per body: where the groom or the start of the
    /// pre-roll has them inside.
    pub exempt_segments: u32,
    /// All guide segments but those next to their roots, which meet no body; counted once per body.
    pub contact_segments: u32,
    /// Deepest point inside its body of an exempt segment or one next to a root, roots excluded, m; 0 if none.
    pub exempt_penetration_m: f64,
    /// Of the first frame, to which the pre-roll belongs: colliders in which guides start that are not in them as they
    /// are drawn.
    pub started_in: Vec<StartedIn>,
    /// Segments of active guides' contact polylines, at the frame, that bodies leave no room for outside,
    /// counted once per body.
    pub pinched_segments: u32,
    /// Deepest written point of a guide or vertex of a render strand that bodies leave no room for, m; 0 if
    /// there is none. The other depths are without these.
    pub pinched_penetration_m: f64,
    /// Colliders that hold these points, by their places in the scene.
    pub pinched_colliders: Vec<u32>,
    /// Deepest vertex of a written render strand inside a body, vertices that the groom places inside
    /// excepted, m; 0 if none, and until the strands are written.
    pub hair_penetration_m: f64,
    /// Written render strands that are deeper than 2 mm.
    pub hair_inside: u32,
    /// Written render strands with a vertex that contact moves by more than 5 cm from the frame to the next.
    pub hair_jumped: u32,
    /// Largest way by which contact moves a vertex of them, m.
    pub hair_jump_m: f64,
    /// Written guides whose velocities are limited, or not fitted to the motion of their points; 0 until they
    /// are written.
    pub limited_rates: u32,
}

/// What is measured of the curves of a frame as they are written.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct WrittenMeasures {
    /// Depths of the guides and render strands.
    pub depths: Depths,
    /// How far contact moves the render strands from the frame to the next.
    pub jumps: Jumps,
    /// Number of guides with limited rates ([`MovingGuide`](crate::dynamics::guide_frame::MovingGuide)).
    pub limited_rates: u32,
}

/// Relative residual of the reactions above which a frame violates the contact law: 1/1000 of the forces.
pub const RESIDUAL: f64 = 1e-3;

/// Largest share of its energy that contact between guides may add to hair in a frame; what was pressed
/// together and comes apart again gains less.
pub const GAIN: f64 = 0.01;

impl FrameRecord {
    /// Exempt segments as a share of all; 0 without bodies.
    pub fn exempt_share(&self) -> f64 {
        f64::from(self.exempt_segments) / f64::from(self.contact_segments.max(1))
    }

    /// Largest residual of contact, with bodies and between guides.
    pub fn residual(&self) -> f64 {
        self.contact_residual.max(self.strand_residual)
    }

    /// The guarantees that the frame breaks, in words.
    pub fn broken(&self) -> Vec<String> {
        let counted = |n: u32, what: &str| (n > 0).then(|| format!("{n} {what}"));
        let residual = self.residual();
        let residual = (residual > RESIDUAL)
            .then(|| format!("a contact residual of {residual:.1e} (limit {RESIDUAL:.0e})"));
        let broken = [
            counted(self.crossings, "crossings of a surface"),
            counted(self.shortened, "motions truncated at a surface"),
            counted(self.strands_shortened, "motions truncated to avoid another guide"),
            (self.strand_gain > GAIN).then(|| {
                format!("{:.1} % of energy gained by contact between guides", 1e2 * self.strand_gain)
            }),
            counted(self.unconverged.len() as u32, "guides whose solve did not converge"),
            residual,
        ];
        broken.into_iter().flatten().collect()
    }

    /// The record with what is measured of the written frame.
    pub fn with_written(&self, WrittenMeasures { depths, jumps, limited_rates }: WrittenMeasures) -> Self {
        FrameRecord {
            penetration_m: self.penetration_m.max(depths.guides),
            hair_penetration_m: depths.strands,
            hair_inside: depths.inside,
            hair_jumped: jumps.strands,
            hair_jump_m: jumps.largest,
            pinched_penetration_m: depths.pinched,
            pinched_colliders: depths.pinched_bodies.into_iter().collect(),
            limited_rates,
            ..self.clone()
        }
    }

    /// Adds one sub-step; `ids` are the guides' ids.
    pub fn add(&mut self, step: &SubstepRecord, ids: &[i32]) {
        self.active_nodes = step.active_nodes;
        self.splits += step.changes.splits;
        self.merges += step.changes.merges;
        self.hair_softened = self.hair_softened.max(step.hair.softened);
        self.hair_crowding_p95 = self.hair_crowding_p95.max(step.hair.crowding_p95);
        self.hair_crowding_max = self.hair_crowding_max.max(step.hair.crowding_max);
        self.hair_slip = step.hair.slip;
        self.hair_work_j += step.hair.work;
        (self.contacts_found, self.contacts_active) = (0, 0);
        (self.strand_contacts_found, self.strand_contacts_active) = (0, 0);
        self.tie_slack_m = 0.0;
        let stepped = step.guides.iter().enumerate().filter(|(i, _)| step.active[*i]);
        for (_, r) in stepped.clone() {
            self.contacts_found += r.found;
            self.contacts_active += r.active;
            self.strand_contacts_found += r.strands.found;
            self.strand_contacts_active += r.strands.active;
            self.tie_slack_m = self.tie_slack_m.max(r.tie_slack);
        }
        let stepped = stepped.map(|(i, r)| (i, r, !step.coupled));
        for (i, r, alone) in stepped.chain(step.catch_up.iter().map(|(i, r)| (*i, r, true))) {
            self.solves += 1;
            // A running mean.
            self.newton_mean += (f64::from(r.iterations) - self.newton_mean) / self.solves as f64;
            self.newton_max = self.newton_max.max(r.iterations);
            self.halvings += r.halvings;
            self.contact_rounds = self.contact_rounds.max(r.rounds);
            self.contact_residual = self.contact_residual.max(r.residual);
            self.unsettled += r.unsettled;
            self.strands_unsettled += r.strands.unsettled;
            self.penetration_m = self.penetration_m.max(r.penetration);
            self.shortened += r.truncated;
            self.strand_rounds = self.strand_rounds.max(r.strands.rounds);
            self.strand_residual = self.strand_residual.max(r.strands.residual);
            self.crossings += r.crossed + r.strands.crossings;
            self.strands_shortened += r.strands.uncoupled + r.strands.truncated;
            self.strand_missing = self.strand_missing.max(r.strands.missing);
            self.strand_work_j += r.strands.work;
            if r.halvings > 0 && alone && !self.divided.contains(&ids[i]) {
                self.divided.push(ids[i]);
            }
            if r.unconverged > 0 && !self.unconverged.contains(&ids[i]) {
                self.unconverged.push(ids[i]);
            }
        }
    }

    /// Adds the figures of the active guides' state at the end of the frame.
    pub fn close(&mut self, simulation: &Simulation) {
        let (env, t) = (&simulation.env, simulation.time());
        let head = RigidMotion::of(&*env.head, t);
        let (mut speeds, mut shape) = (Vec::new(), RodShape::default());
        for i in simulation.active() {
            let g = &simulation.state.guides[i];
            let root = simulation.model.guides[i].skin.as_ref();
            let carrier = root.map_or(head, |root| RigidMotion::of(|t| (env.skin)(root, t), t));
            for (x, v) in g.x.iter().zip(&g.v).skip(1) {
                let carried = carrier.velocity + carrier.spin.cross(&(x - carrier.translation));
                speeds.push((v - carried).norm());
            }
            let rod = &simulation.model.guides[i].rod;
            shape.update(rod, &rod.root.r, &g.q[0]);
            self.length_drift = self.length_drift.max(shape.length_drift(rod, &g.q[0]));
            self.segment_turn_rad = self.segment_turn_rad.max(shape.largest_turn());
        }
        for body in simulation.exemptions() {
            self.exempt_segments += body.exempt as u32;
            self.contact_segments += body.segments as u32;
        }
        self.exempt_penetration_m = simulation.exempt_depth();
        self.strand_gain = simulation.strand_gain(self.strand_work_j);
        self.hair_gain = simulation.hair_gain();
        self.pinched_segments = simulation.pinched_segments() as u32;
        self.measure_goals(simulation);
        speeds.sort_by(f64::total_cmp);
        if let Some(&max) = speeds.last() {
            self.speed_max_m_s = max;
            self.speed_mean_m_s = speeds.iter().sum::<f64>() / speeds.len() as f64;
            self.speed_p95_m_s = speeds[(speeds.len() - 1) * 95 / 100];
        }
    }
}

impl FrameRecord {
    /// Adds how far guides are from their animated goals.
    fn measure_goals(&mut self, simulation: &Simulation) {
        let (env, t) = (&simulation.env, simulation.time());
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in simulation.active() {
            let (model, state) = (&simulation.model.guides[i], &simulation.state.guides[i]);
            let Some(goal) = &model.animated_goal else { continue };
            let (rod, weight, root) = (&model.rod, goal.weight(t), |t: f64| model.root(env, t));
            let of_points: Vec<f64> = rod.arc.iter().map(|s| weight(s / rod.length())).collect();
            if of_points.iter().all(|w| *w == 0.0) {
                continue;
            }
            self.goal_guides += 1;
            let (curve, origin) = (goal.points(rod, root, t), root(t).p);
            for ((x, place), weight) in state.x.iter().zip(&curve).zip(of_points).skip(1) {
                let distance = (x - origin - place).norm();
                sum += weight * distance;
                weights += weight;
                if weight == 1.0 {
                    self.goal_distance_max_m = self.goal_distance_max_m.max(distance);
                }
            }
        }
        if weights > 0.0 {
            self.goal_distance_mean_m = sum / weights;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::step_record::{HairRecord, StepRecord};

    #[test]
    fn ties_are_as_far_off_as_at_the_end_of_the_frame() {
        let step = |slacks: [f64; 2]| SubstepRecord {
            guides: slacks.map(|tie_slack| StepRecord { tie_slack, ..StepRecord::default() }).to_vec(),
            active: vec![true; 2],
            ..SubstepRecord::default()
        };
        let mut record = FrameRecord::default();
        for slacks in [[0.3, 0.1], [0.02, 0.01]] {
            record.add(&step(slacks), &[0, 1]);
        }
        assert_eq!(record.tie_slack_m, 0.02);
    }

    #[test]
    fn the_hair_of_a_frame_is_the_densest_of_its_sub_steps_and_slips_as_in_the_last() {
        let step = |softened, crowding, slip| SubstepRecord {
            hair: HairRecord {
                softened,
                crowding_p95: crowding,
                crowding_max: 2.0 * crowding,
                slip,
                work: -slip,
            },
            ..SubstepRecord::default()
        };
        let mut record = FrameRecord::default();
        for step in [step(0.1, 1.5, 0.7), step(0.3, 1.25, 0.2)] {
            record.add(&step, &[]);
        }
        let found =
            (record.hair_softened, record.hair_crowding_p95, record.hair_crowding_max, record.hair_slip);
        assert_eq!(found, (0.3, 1.5, 3.0, 0.2));
        assert_eq!(record.hair_work_j, -0.7 - 0.2);
    }

    #[test]
    fn each_broken_guarantee_is_reported() {
        let good =
            FrameRecord { contact_residual: 0.5 * RESIDUAL, contacts_active: 7, ..FrameRecord::default() };
        assert!(good.broken().is_empty());
        let bad = [
            FrameRecord { crossings: 1, ..good.clone() },
            FrameRecord { shortened: 2, ..good.clone() },
            FrameRecord { unconverged: vec![4], ..good.clone() },
            FrameRecord { contact_residual: 2.0 * RESIDUAL, ..good.clone() },
            FrameRecord { strands_shortened: 1, ..good.clone() },
            FrameRecord { strand_gain: 0.02, ..good.clone() },
            FrameRecord { strand_residual: 2.0 * RESIDUAL, ..good.clone() },
        ];
        for record in bad {
            assert_eq!(record.broken().len(), 1, "{record:?}");
        }
    }
}
