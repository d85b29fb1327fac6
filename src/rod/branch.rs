//! Rods that branch: stretches of strands, one growing from the end of another (`docs/theory.md` §8).

use super::model::{Beam, Chain, hat_matrix, simpson};
use super::{Rod, Shape};
use crate::math::cholesky::Branches;
use crate::math::lanes::V3;
use crate::math::se3::Pose;
use nalgebra::Vector3;
use std::ops::Range;

/// A stretch of a strand that a branching rod is made of.
#[derive(Debug, Clone)]
pub struct Limb<'a> {
    /// The whole strand, root to tip, without branches.
    pub strand: &'a Rod,
    /// Unknowns of the strand at rest, 1/m, when the limb is beside its parent and turned from it as it stays.
    pub rest: &'a [f64],
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
        self.strand.node_point(self.nodes.start)..self.strand.node_point(self.nodes.end) + 1
    }

    /// Share of what belongs to node `k` of the strand, an unknown one of the limb, that belongs to the limb's: at a joint, that of the
    /// element on its side.
    pub fn share_of(&self, k: usize) -> f64 {
        let s = &self.strand.nodes;
        let joint = |own: f64, other: f64| self.share * own / (own + other);
        match k {
            k if k == self.nodes.start && k > 0 => joint(s[k + 1] - s[k], s[k] - s[k - 1]),
            k if k == self.nodes.end => joint(s[k] - s[k - 1], s[k + 1] - s[k]),
            _ => self.share,
        }
    }

    /// Values at the unknown nodes of its strand, three each, as far as the limb goes.
    pub fn of<'a>(&self, values: &'a [f64]) -> &'a [f64] {
        let nodes = self.unknown_nodes();
        &values[3 * nodes.start..3 * nodes.end]
    }
}

impl Rod {
    /// A rod of limbs, the first at the clamp; they must be of one material. Its stiffness and mass are per hair of the whole: a limb has
    /// its share. Each limb keeps, as the strands rest, which is how the rod starts, its orientation in the frame of its parent's end,
    /// and its place beside it in the frame of the root. Pre-bending is left to [`Rod::balance`].
    pub fn branching(limbs: &[Limb]) -> Rod {
        let rest: Vec<Vec<Pose>> = limbs.iter().map(|limb| poses(limb.strand, limb.rest)).collect();
        let first = limbs[0].strand;
        let (mut steps, mut chains, mut hat, mut weight) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (mut starts, mut beside, mut apart) = (Vec::new(), Vec::new(), Vec::new());
        for (limb, rest_of) in limbs.iter().zip(&rest) {
            let (strand, points) = (limb.strand, limb.points());
            let own = &strand.beam.steps[points.start..points.end - 1];
            // Hairs slide along each other, so a limb stays beside its parent as the roots are, however the parent turns.
            let (joint, aside) = match limb.parent {
                None => (first.root, Vector3::zeros()),
                Some(p) => (rest[p][limbs[p].points().end - 1], apart[p]),
            };
            let start = &rest_of[points.start];
            apart.push(aside + first.root.r.transpose() * (start.p - joint.p));
            beside.extend(points.clone().map(|_| V3::from(apart[apart.len() - 1])));
            let moved = hat.len();
            chains.push(Chain {
                steps: steps.len()..steps.len() + own.len(),
                parent: limb.parent,
                turned: (joint.r.transpose() * start.r).into(),
            });
            let mut own = own.to_vec();
            own.iter_mut().for_each(|step| step.node = step.node - limb.nodes.start + moved);
            hat.extend(hat_matrix(&strand.nodes[limb.nodes.start..=limb.nodes.end], limb.tip(), limb.share));
            weight.extend(simpson(&own, limb.share));
            starts.extend_from_slice(limb.of(limb.rest));
            steps.extend(own);
        }
        let stems = limbs.iter().map(|limb| (limb.parent, 3 * limb.unknown_nodes().len()));
        let beam = Beam {
            chains,
            branches: Branches::new(stems),
            hat,
            stiffness: first.beam.stiffness,
            damping: first.beam.damping,
            prebend: vec![0.0; starts.len()],
            beside: if limbs.len() > 1 { beside } else { Vec::new() },
            length: limbs.iter().map(|limb| limb.strand.length()).fold(0.0, f64::max),
            longest: limbs.iter().map(|limb| limb.strand.beam.longest).fold(0.0, f64::max),
            mass: first.line_density * weight.iter().sum::<f64>(),
            steps,
        };
        let (nodes, root, line_density) = (first.nodes.clone(), first.root, first.line_density);
        Rod { nodes, root, line_density, weight, start: starts, beam }
    }

    /// The point at strain node `node` of a rod without branches.
    pub fn node_point(&self, node: usize) -> usize {
        self.beam.steps.partition_point(|step| step.node < node)
    }

    /// Whether it branches.
    pub fn branches_out(&self) -> bool {
        self.beam.chains.len() > 1
    }
}

/// Poses of the points of a strand at unknowns `q`, rest space.
fn poses(strand: &Rod, q: &[f64]) -> Vec<Pose> {
    let mut shape = Shape::default();
    shape.update(strand, &strand.root.r, q);
    shape.poses().map(|g| Pose { r: g.r, p: g.p + strand.root.p }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::newton::Solver;
    use crate::rod::potential::{Load, PointLoad};
    use crate::rod::{Cut, RodSource};

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
        let origin = |k: usize| rod.origin(&Pose { r: rod.root.r, p: Vector3::zeros() }, k);
        let points = (0..rod.points()).map(|k| PointLoad {
            inertial: shape.x(k) - origin(k) + Vector3::new(0.0, 0.01, 0.02),
            previous: shape.x(k) - origin(k),
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

    /// A hair that parts at node `at` into branches of these shares, whose roots are beside it.
    fn fork(hair: &Rod, at: usize, shares: &[f64]) -> Rod {
        let last = hair.nodes.len() - 1;
        let beside = |i: usize| {
            let mut strand = hair.clone();
            strand.root.p += Vector3::new(0.0, 0.002, 0.003) * i as f64;
            strand
        };
        let strands: Vec<Rod> = (0..shares.len()).map(beside).collect();
        let mut limbs =
            vec![Limb { strand: hair, rest: &hair.start, nodes: 0..at, parent: None, share: 1.0 }];
        limbs.extend(strands.iter().zip(shares).map(|(strand, &share)| Limb {
            strand,
            rest: &strand.start,
            nodes: at..last,
            parent: Some(0),
            share,
        }));
        Rod::branching(&limbs)
    }

    #[test]
    fn one_limb_is_the_strand() {
        let hair = hair(7);
        let whole = Rod::branching(&[Limb {
            strand: &hair,
            rest: &hair.start,
            nodes: 0..6,
            parent: None,
            share: 1.0,
        }]);
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
        let (l, beside) = (hair.length(), Vector3::new(0.0, 0.004, 0.006));
        assert!((x[x.len() - 1] + beside - three_x[three_x.len() - 1]).norm() < 2e-6 * l);
        assert!((x[x.len() - 1] - tip_at_rest(&hair)).norm() > 1e-3 * l, "it has moved");
    }

    fn tip_at_rest(hair: &Rod) -> Vector3<f64> {
        poses(hair, &hair.start).last().unwrap().p - hair.root.p
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
        fn limb(strand: &Rod, nodes: Range<usize>, parent: Option<usize>) -> Limb<'_> {
            Limb { strand, rest: &strand.start, nodes, parent, share: 0.5 }
        }
        let limbs = [
            limb(&near, 0..2, None),
            limb(&near, 2..6, Some(0)),
            limb(&aside, 2..4, Some(0)),
            limb(&aside, 4..6, Some(2)),
        ];
        let rod = Rod::branching(&limbs);
        let mut shape = Shape::default();
        shape.update(&rod, &rod.root.r, &rod.start);
        let drawn: Vec<Pose> =
            limbs.iter().flat_map(|l| poses(l.strand, l.rest)[l.points()].to_vec()).collect();
        assert_eq!(drawn.len(), rod.points());
        for (k, (pose, drawn)) in shape.poses().zip(&drawn).enumerate() {
            assert!(
                (pose.p + rod.root.p - drawn.p).norm() < 1e-13 && (pose.r - drawn.r).norm() < 1e-12,
                "{k}"
            );
        }
        assert_eq!(rod.starts().count(), 4);
    }

    #[test]
    fn a_balanced_rod_rests_as_it_starts() {
        let mut rod = fork(&hair(7), 3, &[0.3, 0.7]);
        let load = rod.load(&rod.start, &(Vector3::y() * -9.81));
        assert!(rod.imbalance(&rod.start, &load).iter().any(|f| f.abs() > 1e-9));
        rod.balance(&load);
        assert!(rod.imbalance(&rod.start, &load).iter().all(|f| f.abs() < 1e-20));
    }
}
