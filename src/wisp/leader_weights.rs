//! How well guides stand in for each other, and the weights of a guide's leaders.

use super::guide_rod::GuideRod;
use super::linear_kinematics::LinearKinematics;
use crate::math::cholesky;
use crate::rod::RodShape;
use crate::scene::Section;
use nalgebra::Vector3;

/// Regularisation of the weights (`docs/theory.md` eq. 8.1).
const REGULARISATION: f64 = 0.03;

/// Weight of differences in position and length; differences in response have weight 1.
const POSE_WEIGHT: f64 = 0.3;

/// A guide in the groom's pose.
pub(super) struct RestPose {
    /// Positions of the nodes, m, rest space.
    nodes: Vec<Vector3<f64>>,
    length: f64,
    kinematics: LinearKinematics,
}

impl RestPose {
    pub fn new(r: &GuideRod) -> Self {
        let mut shape = RodShape::default();
        shape.update(&r.rod, &r.rod.root.r, &r.rod.initial_q);
        let node = |node: usize| shape.x(r.rod.node_point(node)) + r.rod.root.p;
        let nodes: Vec<_> = (0..r.rod.nodes.len()).map(node).collect();
        RestPose { kinematics: LinearKinematics::new(&nodes, &r.rod.nodes), nodes, length: r.rod.length() }
    }

    /// Sum of squared distances of the nodes from the centres of `sections`, m².
    pub fn distance_from(&self, sections: &[Section]) -> f64 {
        self.nodes.iter().zip(sections).map(|(x, section)| (x - section.centre).norm_squared()).sum()
    }

    /// Difference from `other` in position and length, m. Scaled so that products are means along the hair.
    pub fn difference(&self, other: &Self) -> Difference {
        let scale = 1.0 / (self.nodes.len() as f64).sqrt();
        let nodes = self.nodes.iter().zip(&other.nodes).map(|(a, b)| (a - b) * scale);
        let pose = nodes.chain([Vector3::x() * (self.length - other.length)]).collect();
        Difference { pose, response: Vec::new() }
    }

    /// The whole difference of a leader from this guide, dimensionless: in pose, given as `pose`, and in the
    /// displacements of this guide if it responded as the leader does (`led`) instead of as it does itself
    /// (`own`).
    pub fn with_response(
        &self,
        pose: Difference,
        own: &[Vec<Vector3<f64>>],
        led: &[Vec<Vector3<f64>>],
    ) -> Difference {
        let displacements = |strain: Vec<Vector3<f64>>| {
            self.kinematics.displacements(strain.into_iter()).map(|(x, _)| x).collect::<Vec<_>>()
        };
        let size: f64 = own.iter().flat_map(|own| displacements(own.clone())).map(|x| x.norm_squared()).sum();
        let response = |(own, led): (&Vec<Vector3<f64>>, &Vec<Vector3<f64>>)| {
            displacements(led.iter().zip(own).map(|(led, own)| (led - own) / size.sqrt()).collect())
        };
        let pose = pose.pose.into_iter().map(|d| d * (POSE_WEIGHT.sqrt() / self.length)).collect();
        Difference { pose, response: own.iter().zip(led).flat_map(response).collect() }
    }
}

/// Difference of a leader from a guide, as a vector of a Euclidean space.
pub(super) struct Difference {
    /// In position and length.
    pose: Vec<Vector3<f64>>,
    /// In the response to motions of the head.
    response: Vec<Vector3<f64>>,
}

impl Difference {
    fn dot(&self, other: &Self) -> f64 {
        let dot =
            |a: &[Vector3<f64>], b: &[Vector3<f64>]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
        dot(&self.pose, &other.pose) + dot(&self.response, &other.response)
    }

    /// Squared norm.
    pub fn square(&self) -> f64 {
        self.dot(self)
    }
}

/// Weights w of leaders with differences d from a guide: the minimum of |Σ w_j d_j|² + ε Σ w_j² |d_j|² with Σ
/// w_j = 1 (`docs/theory.md` eq. 8.1). Weights may be negative: they extrapolate trends across the leaders.
pub(super) fn leader_weights(differences: &[Difference]) -> Vec<f64> {
    let n = differences.len();
    let mut normal: Vec<f64> = (0..n * n).map(|at| differences[at / n].dot(&differences[at % n])).collect();
    for j in 0..n {
        // The added minimum lets a leader that coincides with the guide take all the weight.
        normal[j * n + j] += REGULARISATION * normal[j * n + j] + f64::MIN_POSITIVE;
    }
    let mut weights = vec![1.0; n];
    if cholesky::factor(&mut normal, n) == 1 {
        cholesky::solve(&normal, n, &mut weights);
    }
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

/// Error of the weighted mean of the leaders' responses, relative to the guide's own response.
pub(super) fn response_error(differences: &[Difference], weights: &[f64]) -> f64 {
    let mean =
        |k: usize| -> Vector3<f64> { differences.iter().zip(weights).map(|(d, w)| d.response[k] * *w).sum() };
    (0..differences[0].response.len()).map(|k| mean(k).norm_squared()).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_reproduce_the_position_and_length_of_a_guide() {
        let hair = |x: f64, y: f64, length: f64| {
            let arc: Vec<f64> = (0..8).map(|k| length / 7.0 * f64::from(k)).collect();
            let nodes: Vec<_> = arc.iter().map(|s| Vector3::new(x, y, *s)).collect();
            RestPose { kinematics: LinearKinematics::new(&nodes, &arc), nodes, length }
        };
        let leaders = [(0.0, 0.0), (0.02, 0.0), (0.0, 0.02), (0.02, 0.02)];
        let of = |guide: &RestPose, lengths: [f64; 4]| {
            let differences =
                leaders.iter().zip(lengths).map(|(l, length)| hair(l.0, l.1, length).difference(guide));
            let weights = leader_weights(&differences.collect::<Vec<_>>());
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let mean: Vector3<f64> =
                leaders.iter().zip(&weights).map(|(l, w)| Vector3::new(l.0, l.1, 0.0) * *w).sum();
            (weights, mean)
        };
        let (even, _) = of(&hair(0.01, 0.01, 0.1), [0.1; 4]);
        assert!(even.iter().all(|w| (w - 0.25).abs() < 1e-9), "{even:?}");
        let (uneven, mean) = of(&hair(0.006, 0.004, 0.1), [0.1; 4]);
        assert!(
            (mean - Vector3::new(0.006, 0.004, 0.0)).norm() < 1e-3 && uneven[0] > 0.4,
            "{uneven:?} {mean}"
        );
        // A little outside of all leaders.
        let (_, beyond) = of(&hair(-0.002, 0.01, 0.1), [0.1; 4]);
        assert!((-0.002..0.002).contains(&beyond.x), "{beyond}");
        // A guide that coincides with a leader takes all from it.
        let (on, _) = of(&hair(0.02, 0.0, 0.1), [0.1; 4]);
        assert!((on[1] - 1.0).abs() < 1e-9, "{on:?}");
        // Leaders of the guide's length count more.
        let (long, _) = of(&hair(0.01, 0.01, 0.12), [0.12, 0.1, 0.1, 0.12]);
        assert!(long[0] > 0.4 && long[3] > 0.4, "{long:?}");
    }
}
