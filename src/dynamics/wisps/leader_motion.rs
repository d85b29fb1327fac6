//! The motion that leaders give their followers, and its estimated error.

use super::control_variate::{ControlVariate, LeaderMeans};
use super::modal_correction::ModalCorrection;
use super::rest_shape::RestShape;
use crate::dynamics::guide::{GuideModel, GuideState};
use crate::dynamics::integrator::backward_difference;
use crate::wisp::{Deflection, Hierarchy};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Now, and one and two sub-steps ago.
const BACK: [usize; Deflection::MOMENTS] = [0, 1, 2];

/// The hierarchy with the rest shapes and deflections of its guides.
pub(super) struct LeaderMotion {
    pub hierarchy: Hierarchy,
    /// Length of a sub-step, s.
    pub h: f64,
    /// Length of a frame, s.
    pub frame: f64,
    /// Rest shape of each guide; empty before the pre-roll ends.
    pub rest: Vec<RestShape>,
    /// Modal response of each guide; empty before the pre-roll ends.
    pub modal: ModalCorrection,
    /// Whether each guide leads others.
    leads: Vec<bool>,
    /// Deflections of the leaders at the end of the last frame.
    deflections: Vec<Deflection>,
}

impl LeaderMotion {
    /// `h` is the sub-step, `frame` the frame, s.
    pub fn new(hierarchy: Hierarchy, h: f64, frame: f64) -> Self {
        let guides = hierarchy.leaders.len();
        let mut leads = vec![false; guides];
        hierarchy.leaders.iter().flatten().for_each(|(leader, _)| leads[*leader] = true);
        LeaderMotion {
            hierarchy,
            h,
            frame,
            rest: Vec::new(),
            modal: ModalCorrection::default(),
            leads,
            deflections: vec![Deflection::default(); guides],
        }
    }

    /// True if guide `i` has leaders and is of `level`.
    pub fn may_follow_at(&self, level: u32, i: usize) -> bool {
        self.hierarchy.level[i] == level && !self.hierarchy.leaders[i].is_empty()
    }

    /// Records the deflections of the leaders of a level.
    pub fn record_level(&mut self, level: u32, models: &[GuideModel], states: &[GuideState]) {
        let LeaderMotion { hierarchy, rest, leads, deflections, .. } = self;
        let leading = deflections.par_iter_mut().zip(states).enumerate();
        leading
            .filter(|(i, _)| hierarchy.level[*i] == level && leads[*i])
            .for_each(|(i, (deflection, state))| rest[i].deflection(&models[i].rod, state, deflection));
    }

    /// Sets `means` to those of the leaders of guide `i`.
    pub fn leader_means(&self, i: usize, LeaderMeans { deflection, modal }: &mut LeaderMeans) {
        let own = self.modal.deflection(i);
        deflection.reset_like(own);
        modal.reset_like(own);
        for (leader, share) in &self.hierarchy.leaders[i] {
            deflection.add_scaled(*share, &self.deflections[*leader]);
            modal.add_scaled(*share, self.modal.deflection(*leader));
        }
    }

    /// Updates the control variate of guide `i` with the last frame of its leaders, whose means are given.
    pub fn update_variate(&self, i: usize, means: &LeaderMeans, variate: &mut ControlVariate) {
        let leader =
            |(j, share): &(usize, f64)| (share.abs(), &self.deflections[*j], self.modal.deflection(*j));
        let leaders = self.hierarchy.leaders[i].iter().map(leader);
        variate.update(self.frame, leaders, self.modal.deflection(i), means);
    }

    /// Adds `nu` times the modal deviation of guide `i` from its leaders to the mean deflection.
    pub fn add_modal_correction(
        &self,
        i: usize,
        nu: f64,
        LeaderMeans { deflection, modal }: &mut LeaderMeans,
    ) {
        deflection.add_scaled_difference(nu, self.modal.deflection(i), modal);
    }

    /// The deflection of guide `i` that its leaders predict, with coefficient `nu`.
    fn prediction(&self, i: usize, nu: f64) -> Deflection {
        let mut means = LeaderMeans::default();
        self.leader_means(i, &mut means);
        self.add_modal_correction(i, nu, &mut means);
        means.deflection
    }

    /// Speed of active guide `i` relative to its prediction, as a share of its length, 1/s.
    pub fn relative_speed(&self, i: usize, nu: f64, model: &GuideModel, state: &GuideState) -> f64 {
        let (predicted, mut own) = (self.prediction(i, nu), Deflection::default());
        self.rest[i].deflection(&model.rod, state, &mut own);
        let rate = |n: usize| {
            backward_difference(BACK.map(|back| own.strain(back)[n] - predicted.strain(back)[n]), self.h)
        };
        let rates: Vec<f64> = (0..predicted.strain(0).len()).map(rate).collect();
        self.rest[i].kinematics.mean_displacement(rates.chunks_exact(3).map(Vector3::from_column_slice))
    }

    /// Deviation of guide `i` from its prediction, 1/m, and its rate, 1/(m·s).
    pub fn deviation(&self, i: usize, nu: f64, model: &GuideModel, state: &GuideState) -> [Vec<f64>; 2] {
        let deflection = self.prediction(i, nu);
        let predicted = BACK.map(|back| {
            let mut q = Vec::new();
            self.rest[i].unknowns(&model.rod, deflection.strain(back), &mut q);
            q
        });
        let own = |n: usize| BACK.map(|back| state.q[back][n] - predicted[back][n]);
        let n = 0..predicted[0].len();
        [n.clone().map(|n| own(n)[0]).collect(), n.map(|n| backward_difference(own(n), self.h)).collect()]
    }

    /// Mean displacement of guide `i` from its leaders that the hair around it demands, as a share of its length.
    pub fn apart(&self, i: usize) -> f64 {
        self.rest[i].kinematics.mean_displacement(self.modal.strain_apart(i).into_iter())
    }

    /// What tells how far the prediction of guide `i` may be off, as strains of its nodes: for leader after leader, how
    /// far the deflection by it alone is from that by all, less the modal responses, or with a single leader, whose
    /// error is not known, its whole deflection from rest; then what is left out of the modal deviation of the guide
    /// from its leaders.
    pub fn disagreement(&self, i: usize, nu: f64) -> Vec<f64> {
        let mut means = LeaderMeans::default();
        self.leader_means(i, &mut means);
        let leaders = &self.hierarchy.leaders[i];
        let (deflection, modal) = (means.deflection.strain(0), means.modal.strain(0));
        let mut disagreement = Vec::with_capacity((leaders.len() + 1) * deflection.len());
        if leaders.len() == 1 {
            disagreement.extend(deflection);
        } else {
            for &(leader, _) in leaders {
                let own = self.deflections[leader].strain(0).iter().zip(deflection);
                let of_modes = self.modal.deflection(leader).strain(0).iter().zip(modal);
                let differences = own
                    .zip(of_modes)
                    .map(|((own, mean), (modal, of_mean))| own - mean - nu * (modal - of_mean));
                disagreement.extend(differences);
            }
        }
        let own = self.modal.deflection(i).strain(0).iter().zip(modal);
        disagreement.extend(own.map(|(own, of_mean)| (1.0 - nu) * (own - of_mean)));
        disagreement
    }

    /// Estimated error of the prediction of guide `i` since a time when its leaders disagreed as `before`, by those that
    /// disagree as `now`, as a share of its length: the displacements that the change of their disagreement gives, in the
    /// root mean square by their shares, times the response error of the hierarchy, and with them what is left out of
    /// its own modes. At rest leaders agree, as where `before` is empty.
    pub fn prediction_error(&self, i: usize, now: &[f64], before: &[f64]) -> f64 {
        let kinematics = &self.rest[i].kinematics;
        let leaders = &self.hierarchy.leaders[i];
        let n = now.len() / (leaders.len() + 1);
        let square = |k: usize| {
            let change = |m: usize| now[m] - before.get(m).unwrap_or(&0.0);
            let strain = |m: usize| Vector3::new(change(m), change(m + 1), change(m + 2));
            let strains = (k * n..(k + 1) * n).step_by(3).map(strain);
            kinematics.mean_displacement(strains).powi(2)
        };
        let of_leaders: f64 = leaders.iter().enumerate().map(|(k, (_, share))| share.abs() * square(k)).sum();
        (self.hierarchy.response_error[i].powi(2) * of_leaders + square(leaders.len())).sqrt()
    }
}
