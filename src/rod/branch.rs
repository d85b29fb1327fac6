//! Rods that branch: stretches of strands, one growing from the end of another (`docs/theory.md` §8).

use super::model::{Beam, Chain, hat_matrix, simpson};
use super::{Rod, Shape};
use crate::math::cholesky::Branches;
use crate::math::lanes;
use crate::math::se3::Pose;
use std::ops::Range;

/// A stretch of a strand that a branching rod is made of.
#[derive(Debug, Clone)]
pub struct Limb<'a> {
    /// The whole strand, root to tip, without branches.
    pub strand: &'a Rod,
    /// Its strain nodes from which to which the limb goes; to the last for a free tip.
    pub nodes: Range<usize>,
    /// The limb from whose end it grows, one before it; `None` for the first, which starts at the strand's root.
    pub parent: Option<usize>,
    /// Its hairs over those of the whole rod.
    pub share: f64,
}

impl Limb<'_> {
    /// Whether it ends in a free tip.
    pub fn tip(&self) -> bool {
        self.nodes.end + 1 == self.strand.nodes.len()
    }

    /// Strain nodes that have unknowns: all, a joint's at either side of it included, but for a free tip.
    pub fn unknown_nodes(&self) -> Range<usize> {
        self.nodes.start..self.nodes.end + usize::from(!self.tip())
    }

    /// Its points, as points of the strand.
    pub fn points(&self) -> Range<usize> {
        point(self.strand, self.nodes.start)..point(self.strand, self.nodes.end) + 1
    }

    /// Values at the unknown nodes of its strand, three each, as far as the limb goes.
    pub fn of<'a>(&self, values: &'a [f64]) -> &'a [f64] {
        let nodes = self.unknown_nodes();
        &values[3 * nodes.start..3 * nodes.end]
    }
}

/// The point of an unbranched rod at its node `node`.
fn point(strand: &Rod, node: usize) -> usize {
    strand.beam.steps.partition_point(|step| step.node < node)
}

impl Rod {
    /// A rod of limbs, the first at the clamp. Its stiffness and mass are per hair of the whole: a limb has its share. Each limb keeps the place
    /// and the orientation in the frame of its parent's end that it has as the strands start.
    ///
    /// The limbs must be of one material; pre-bending is not taken over ([`Rod::support`]).
    pub fn branching(limbs: &[Limb]) -> Rod {
        let rest: Vec<Vec<Pose>> = limbs.iter().map(|limb| at_rest(limb.strand)).collect();
        let first = limbs[0].strand;
        let (mut steps, mut chains, mut hat, mut start, mut weight) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (limb, rest_of) in limbs.iter().zip(&rest) {
            let (strand, points) = (limb.strand, limb.points());
            let own = &strand.beam.steps[points.start..points.end - 1];
            let joint = limb
                .parent
                .map_or(Pose { r: first.root.r, p: first.root.p }, |p| rest[p][limbs[p].points().end - 1]);
            let offset = joint.inverse().compose(&rest_of[points.start]);
            let moved = hat.len();
            chains.push(Chain {
                steps: steps.len()..steps.len() + own.len(),
                parent: limb.parent,
                offset: lanes::Pose { r: offset.r.into(), p: offset.p.into() },
            });
            let mut own = own.to_vec();
            own.iter_mut().for_each(|step| step.node = step.node - limb.nodes.start + moved);
            hat.extend(hat_matrix(&strand.nodes[limb.nodes.start..=limb.nodes.end], limb.tip(), limb.share));
            weight.extend(simpson(&own, limb.share));
            start.extend_from_slice(limb.of(&strand.start));
            steps.extend(own);
        }
        let stems = limbs.iter().map(|limb| (limb.parent, 3 * limb.unknown_nodes().len()));
        let beam = Beam {
            chains,
            branches: Branches::new(stems),
            hat,
            stiffness: first.beam.stiffness,
            damping: first.beam.damping,
            prebend: vec![0.0; start.len()],
            length: limbs.iter().map(|limb| limb.strand.length()).fold(0.0, f64::max),
            longest: limbs.iter().map(|limb| limb.strand.beam.longest).fold(0.0, f64::max),
            mass: first.line_density * weight.iter().sum::<f64>(),
            steps,
        };
        Rod {
            nodes: first.nodes.clone(),
            root: first.root,
            line_density: first.line_density,
            weight,
            start,
            beam,
        }
    }

    /// Whether it branches.
    pub fn branches_out(&self) -> bool {
        self.beam.chains.len() > 1
    }
}

/// Poses of the points of a strand as it starts, rest space.
fn at_rest(strand: &Rod) -> Vec<Pose> {
    let mut shape = Shape::default();
    shape.update(strand, &strand.root.r, &strand.start);
    shape.poses().map(|g| Pose { r: g.r, p: g.p + strand.root.p }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::newton::Solver;
    use crate::rod::potential::{Load, PointLoad};
    use crate::rod::{Cut, RodSource};
    use nalgebra::Vector3;

    fn hair(nodes: usize) -> Rod {
        let arc: Vec<f64> = (0..nodes).map(|i| i as f64 / (nodes - 1) as f64).collect();
        let points = [[0.0, 0.0, 0.0], [0.05, 0.02, 0.0], [0.1, 0.02, 0.02], [0.14, 0.0, 0.05]];
        Rod::new(&RodSource {
            points: &points.map(Vector3::from),
            root_frame: None,
            arc: &arc,
            stiffness: [7.8e-9, 7.8e-9, 3.6e-9],
            line_density: 6.6e-6,
            damping: 0.005,
            natural: None,
            cut: Cut { length: 0.01, turn: 0.4 },
        })
        .unwrap()
    }

    /// The rod a hundredth of a second after a jerk, from rest: unknowns and points, m.
    fn jerked(rod: &Rod) -> (Vec<f64>, Vec<Vector3<f64>>) {
        let mut shape = Shape::default();
        shape.update(rod, &rod.root.r, &rod.start);
        let points = (0..rod.points()).map(|k| PointLoad {
            inertial: shape.x(k) + Vector3::new(0.0, 0.01, 0.02),
            previous: shape.x(k),
            air: Vector3::x(),
            tangent: shape.tangent(k),
            drag: 2e-5,
        });
        let (mut load, mut q) = (Load::default(), rod.start.clone());
        load.set(rod, 0.01, &(Vector3::y() * -9.81), &rod.start, points);
        let mut solver = Solver::default();
        assert!(solver.minimise(rod, &rod.root.r, &load, &mut q, &rod.start).converged);
        (q, (0..rod.points()).map(|k| solver.shape.x(k)).collect())
    }

    fn fork<'a>(hair: &'a Rod, at: usize, shares: &[f64]) -> Rod {
        let last = hair.nodes.len() - 1;
        let stem = Limb { strand: hair, nodes: 0..at, parent: None, share: 1.0 };
        let twigs =
            shares.iter().map(|&share| Limb { nodes: at..last, parent: Some(0), share, ..stem.clone() });
        Rod::branching(&std::iter::once(stem.clone()).chain(twigs).collect::<Vec<Limb<'a>>>())
    }

    #[test]
    fn one_limb_is_the_strand() {
        let hair = hair(7);
        let whole = Rod::branching(&[Limb { strand: &hair, nodes: 0..6, parent: None, share: 1.0 }]);
        assert_eq!(jerked(&whole), jerked(&hair));
        assert!(!whole.branches_out());
    }

    #[test]
    fn equal_branches_are_one_of_the_sum_of_their_stiffness_and_mass() {
        let hair = hair(7);
        let (one, three) = (fork(&hair, 3, &[1.0]), fork(&hair, 3, &[0.5, 0.2, 0.3]));
        let ((q, x), (three_q, three_x)) = (jerked(&one), jerked(&three));
        let (stem, twig) = (12, 9);
        for i in 0..3 {
            let of_twig = &three_q[stem + i * twig..][..twig];
            let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-4;
            assert!(q[..stem].iter().zip(&three_q).all(near) && q[stem..].iter().zip(of_twig).all(near));
        }
        let l = hair.length();
        assert!((x[x.len() - 1] - three_x[three_x.len() - 1]).norm() < 2e-6 * l);
        assert!((x[x.len() - 1] - hair_at_rest(&hair)).norm() > 1e-3 * l, "it has moved");
    }

    fn hair_at_rest(hair: &Rod) -> Vector3<f64> {
        at_rest(hair).last().unwrap().p - hair.root.p
    }

    #[test]
    fn a_joint_lets_the_strain_jump_and_the_jump_goes_with_the_nodes() {
        let apart = |nodes: usize| {
            let hair = hair(nodes);
            let (whole, jointed) = (jerked(&hair).1, jerked(&fork(&hair, nodes / 2, &[1.0])).1);
            (whole[whole.len() - 1] - jointed[jointed.len() - 1]).norm() / hair.length()
        };
        let (coarse, fine) = (apart(7), apart(13));
        assert!(coarse < 1e-3 && fine < 0.3 * coarse && fine > 0.0, "{coarse} {fine}");
    }

    #[test]
    fn limbs_start_where_they_were_drawn() {
        let (near, far) = (hair(7), hair(7));
        let mut aside = far.clone();
        aside.root.p += Vector3::new(0.003, 0.0, -0.004);
        let limb = |strand, nodes, parent| Limb { strand, nodes, parent, share: 0.5 };
        let limbs = [
            limb(&near, 0..2, None),
            limb(&near, 2..6, Some(0)),
            limb(&aside, 2..4, Some(0)),
            limb(&aside, 4..6, Some(2)),
        ];
        let rod = Rod::branching(&limbs);
        let mut shape = Shape::default();
        shape.update(&rod, &rod.root.r, &rod.start);
        let drawn: Vec<Pose> = limbs.iter().flat_map(|l| at_rest(l.strand)[l.points()].to_vec()).collect();
        assert_eq!(drawn.len(), rod.points());
        for (k, (pose, drawn)) in shape.poses().zip(&drawn).enumerate() {
            assert!(
                (pose.p + rod.root.p - drawn.p).norm() < 1e-13 && (pose.r - drawn.r).norm() < 1e-12,
                "{k}"
            );
        }
        assert_eq!(rod.starts().count(), 4);
    }
}
