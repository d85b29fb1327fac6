//! The modal response of a guide to the motion of the head: its slowest linear modes, integrated in time.

use super::deflection::Deflection;
use super::head_excitation::HeadExcitation;
use super::linear_kinematics::LinearKinematics;
use super::linear_model::LinearModel;
use crate::math::cholesky;
use crate::rod::Rod;
use crate::scene::anim::GRAVITY;
use nalgebra::{DMatrix, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};

/// Number of modes, the slowest: about two per order.
const MODES: usize = 6;

/// Share of the trace that regularises the projection of leaders' modes: those that displace nothing have none.
const REGULARISATION: f64 = 1e-6;

/// Response of a guide to the motion of the head in its slowest modes (`docs/theory.md` §8.2).
#[derive(Debug, Clone, Default)]
pub struct ModalResponse {
    modes: Vec<Mode>,
    states: Vec<ModeState>,
    deflection: Deflection,
    /// For each guide that this one would follow: the rates of its modes that those of the leader amount to,
    /// as a matrix by columns, times the leader's share.
    leaders: Vec<(usize, [[f64; MODES]; MODES])>,
    /// Arc length of the nodes but the root over that of the guide.
    nodes: Vec<f64>,
    /// Length of the guide, m.
    length: f64,
    /// States of the modes under the forces on this guide that its leaders do not have.
    apart: Vec<ModeState>,
}

/// A force on a guide that its leaders do not have.
#[derive(Debug, Clone, Copy)]
pub struct ForceApart {
    /// Arc length over that of the guide.
    pub place: f64,
    /// N, rest space.
    pub force: Vector3<f64>,
}

/// What opposes the motion of a guide relative to the hair around it.
#[derive(Debug, Clone, Copy, Default)]
pub struct NeighbourDrag {
    /// Bound of friction per mass, m/s².
    pub friction: f64,
    /// Drag of the air between hairs, 1/s.
    pub air: f64,
}

/// Rates of the modes of a guide; zero beyond its last mode.
pub type ModalRates = [f64; MODES];

/// z̈ + c ż + ω² z = f.
#[derive(Debug, Clone)]
struct Mode {
    /// Normalised strain of the nodes at z = 1.
    strain: Vec<f64>,
    /// Displacements of the nodes but the root at z = 1, over the length of the guide.
    displacement: Vec<f64>,
    /// c, 1/s.
    damping: f64,
    /// ω², 1/s².
    stiffness: f64,
    /// f per component of a [`HeadExcitation`].
    force: [f64; HeadExcitation::COMPONENTS],
    /// f per acceleration that acts along the displacement everywhere.
    grip: f64,
}

/// State of a mode.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ModeState {
    /// z now, and one and two steps ago.
    z: [f64; 3],
    /// ż now and one step ago.
    rate: [f64; 2],
}

impl Mode {
    /// Takes one BDF2 step of `h`, s, under the force `f`, where `hair` opposes a rate other than `led`.
    fn step(&self, state: &mut ModeState, f: f64, h: f64, hair: &NeighbourDrag, led: f64) {
        let eta = 2.0 / 3.0 * h;
        let past = |now: f64, before: f64| (4.0 * now - before) / 3.0;
        let ([z, before, _], [rate, rate_before]) = (state.z, state.rate);
        let (from, rate_from) = (past(z, before), past(rate, rate_before));
        let inertia = 1.0 + eta * (self.damping + eta * self.stiffness);
        let mut next = (rate_from + eta * (f - self.stiffness * from)) / inertia;
        if hair.friction + hair.air > 0.0 {
            let pull = inertia * (next - led);
            let slips = (pull.abs() - eta * hair.friction * self.grip).max(0.0);
            next = led + slips.copysign(pull) / (inertia + eta * hair.air);
        }
        *state = ModeState { z: [from + eta * next, z, before], rate: [next, rate] };
    }

    /// Displacement of a node, the root not counted, at z = 1, over the length of the guide.
    fn displacement_of(&self, node: usize) -> Vector3<f64> {
        Vector3::from_column_slice(&self.displacement[3 * node..][..3])
    }
}

impl ModalResponse {
    /// Of `rod` at rest at unknowns `q`, 1/m, where its kinematics are `kinematics`, with drag coefficients
    /// `drag` at its points, N·s/m², under `gravity`, m/s², rest space.
    pub fn new(
        rod: &Rod,
        q: &[f64],
        kinematics: &LinearKinematics,
        drag: &[f64],
        gravity: &Vector3<f64>,
    ) -> Self {
        let pendulum = gravity.norm() / rod.length();
        let modes = modes(&LinearModel::new(rod, q, drag, gravity), pendulum, kinematics).unwrap_or_default();
        let states = vec![ModeState::default(); modes.len()];
        ModalResponse {
            apart: states.clone(),
            states,
            modes,
            deflection: Deflection::zeros(q.len()),
            leaders: Vec::new(),
            nodes: rod.nodes[1..].iter().map(|s| s / rod.length()).collect(),
            length: rod.length(),
        }
    }

    /// Sets the guides that this one would follow: the index of each, its share and its response.
    pub fn set_leaders<'a>(&mut self, leaders: impl Iterator<Item = (usize, f64, &'a ModalResponse)>) {
        let product = |a: &Mode, b: &Mode| cholesky::dot(&a.displacement, &b.displacement);
        let n = self.modes.len();
        let mut gram: Vec<f64> =
            (0..n * n).map(|at| product(&self.modes[at / n], &self.modes[at % n])).collect();
        let trace: f64 = (0..n).map(|k| gram[k * n + k]).sum();
        (0..n).for_each(|k| gram[k * n + k] += REGULARISATION * trace + f64::MIN_POSITIVE);
        if cholesky::factor(&mut gram, n) != 1 {
            return;
        }
        let matrix = |(leader, share, response): (usize, f64, &ModalResponse)| {
            let mut matrix = [[0.0; MODES]; MODES];
            for (j, mode) in response.modes.iter().enumerate() {
                let mut column: Vec<f64> = self.modes.iter().map(|own| product(own, mode) * share).collect();
                cholesky::solve(&gram, n, &mut column);
                matrix[j][..n].copy_from_slice(&column);
            }
            (leader, matrix)
        };
        self.leaders = leaders.map(matrix).collect();
    }

    /// Takes one BDF2 step of `h`, s, under the `excitation` at its end, relative to rest, where `hair`
    /// opposes what it moves relative to its leaders. `rates` are those of all guides at the end of the step,
    /// as far as they lead it.
    pub fn step(&mut self, excitation: &HeadExcitation, h: f64, hair: &NeighbourDrag, rates: &[ModalRates]) {
        let mut led = ModalRates::default();
        for (leader, matrix) in &self.leaders {
            for (column, rate) in matrix.iter().zip(rates[*leader]) {
                led.iter_mut().zip(column).for_each(|(led, of)| *led += of * rate);
            }
        }
        let hair = if self.leaders.is_empty() { &NeighbourDrag::default() } else { hair };
        for ((mode, state), led) in self.modes.iter().zip(&mut self.states).zip(led) {
            let f: f64 = mode.force.iter().zip(excitation.components()).map(|(f, x)| f * x).sum();
            mode.step(state, f, h, hair, led);
        }
    }

    /// Moves the guide apart from its leaders in `steps` BDF2 steps of `h`, s, under constant forces that they do
    /// not have, where `hair` opposes that.
    pub fn move_apart(&mut self, forces: &[ForceApart], hair: &NeighbourDrag, h: f64, steps: usize) {
        let mut f = [0.0; MODES];
        for ForceApart { place, force } in forces {
            let next = self.nodes.partition_point(|node| node < place).min(self.nodes.len() - 1);
            let before = if next == 0 { 0.0 } else { self.nodes[next - 1] };
            let share = ((place - before) / (self.nodes[next] - before)).min(1.0);
            for (f, mode) in f.iter_mut().zip(&self.modes) {
                let start = if next == 0 { Vector3::zeros() } else { mode.displacement_of(next - 1) };
                *f += start.lerp(&mode.displacement_of(next), share).dot(force) * self.length;
            }
        }
        for _ in 0..steps {
            let modes = self.modes.iter().zip(&mut self.apart).zip(f);
            modes.for_each(|((mode, state), f)| mode.step(state, f, h, hair, 0.0));
        }
    }

    /// Brings the guide back to its leaders.
    pub fn rejoin(&mut self) {
        self.apart.fill(ModeState::default());
    }

    /// Normalised strain of the nodes by which the guide is apart from its leaders.
    pub fn strain_apart(&self) -> Vec<Vector3<f64>> {
        let modes = || self.modes.iter().zip(&self.apart);
        let at = |n: usize| modes().map(|(mode, state)| mode.strain[n] * state.z[0]).sum();
        let numbers = self.modes.first().map_or(0, |mode| mode.strain.len());
        (0..numbers / 3).map(|node| Vector3::from_fn(|c, _| at(3 * node + c))).collect()
    }

    /// Rates of the modes.
    pub fn rates(&self) -> ModalRates {
        std::array::from_fn(|k| self.states.get(k).map_or(0.0, |state| state.rate[0]))
    }

    /// Finds the deflection of the states.
    pub fn update_deflection(&mut self) {
        self.deflection.fill_zero();
        for (mode, ModeState { z, .. }) in self.modes.iter().zip(&self.states) {
            let parts = [
                (&mode.strain, z[0]),
                (&mode.strain, z[1]),
                (&mode.strain, z[2]),
                (&mode.displacement, z[0]),
            ];
            for (sums, (of, z)) in self.deflection.blocks_mut().zip(parts) {
                sums.iter_mut().zip(of).for_each(|(sum, of)| *sum += of * z);
            }
        }
    }

    /// Deflection of the guide from rest in its modes.
    pub fn deflection(&self) -> &Deflection {
        &self.deflection
    }

    /// States of the modes, and of what the guide is apart from its leaders in them.
    pub fn mode_states(&self) -> [&[ModeState]; 2] {
        [&self.states, &self.apart]
    }

    /// Restores [`ModalResponse::mode_states`], of which there must be as many.
    pub fn restore(&mut self, [states, apart]: [Vec<ModeState>; 2]) {
        (self.states, self.apart) = (states, apart);
        self.update_deflection();
    }
}

/// The slowest modes; `None` if the eigenvalue problem has no sense. `pendulum`, 1/s², is a lower bound on
/// ω²: a mode that weight would tip over, as of hair that stands or leans on a body, swings as a pendulum.
fn modes(linear: &LinearModel, pendulum: f64, kinematics: &LinearKinematics) -> Option<Vec<Mode>> {
    let n = linear.unknowns();
    let first_shift = GRAVITY / linear.length();
    // The modes are those of 𝐊 + s 𝐌, which is positive definite for large enough s.
    let shifted = |shift: f64| {
        let mut sum: Vec<f64> =
            linear.stiffness.iter().zip(&linear.mass).map(|(k, m)| k + shift * m).collect();
        (cholesky::factor(&mut sum, n) == 1).then_some((shift, sum))
    };
    let (shift, factor) = (0..32).map(|k| first_shift * f64::from(1_u32 << k)).find_map(shifted)?;
    let solve_lower = |rows: &DMatrix<f64>| {
        let mut columns = rows.transpose();
        columns
            .column_iter_mut()
            .for_each(|mut column| cholesky::solve_lower(&factor, n, column.as_mut_slice()));
        columns
    };
    let mass = solve_lower(&solve_lower(&DMatrix::from_row_slice(n, n, &linear.mass)));
    let eigen = SymmetricEigen::new((&mass + mass.transpose()) * 0.5);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let unit_force = |k| {
        let unit = HeadExcitation::unit(k);
        linear.generalised_force(|x, mass, drag| unit.force(x, mass, drag))
    };
    let forces: Vec<Vec<f64>> = (0..HeadExcitation::COMPONENTS).map(unit_force).collect();
    let mode = |k: usize| {
        // 1/(ω² + s).
        let eigenvalue = eigen.eigenvalues[k];
        let mut q: Vec<f64> = eigen.eigenvectors.column(k).iter().map(|y| y / eigenvalue.sqrt()).collect();
        cholesky::solve_upper(&factor, n, &mut q);
        let damping =
            linear.damping.chunks_exact(n).zip(&q).map(|(row, q_i)| q_i * cholesky::dot(row, &q)).sum();
        let strain = linear.normalised_strain(&q);
        let displacement = numbers(kinematics.displacements(strain.iter().copied()).map(|(x, _)| x));
        let strain = numbers(strain.into_iter());
        let force = std::array::from_fn(|k| cholesky::dot(&forces[k], &q));
        let of_node =
            |(node, x): (usize, &[f64])| linear.node_mass(node) * x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let grip = linear.length() * (1..).zip(displacement.chunks_exact(3)).map(of_node).sum::<f64>();
        Mode {
            strain,
            displacement,
            damping,
            stiffness: (1.0 / eigenvalue - shift).max(pendulum),
            force,
            grip,
        }
    };
    Some(order.into_iter().take(MODES).filter(|k| eigen.eigenvalues[*k] > 0.0).map(mode).collect())
}

fn numbers(vectors: impl Iterator<Item = Vector3<f64>>) -> Vec<f64> {
    vectors.flat_map(|v| [v.x, v.y, v.z]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::RodSource;
    use crate::scene::Tree;

    const GRAVITY: Vector3<f64> = Vector3::new(0.0, -super::GRAVITY, 0.0);

    /// A hair that hangs 20 cm down, 10 cm from the centre of the head.
    fn hair(nodes: usize, stiffness: f64) -> Rod {
        let root = Vector3::x() * 0.1;
        Rod::new(&RodSource {
            stiffness: [stiffness; 3],
            damping: 0.01,
            ..RodSource::hair(&[root, root - Vector3::y() * 0.2], &Tree::default_arc(nodes))
        })
        .unwrap()
    }

    #[test]
    fn limp_hair_has_the_frequencies_of_a_hanging_chain() {
        let rod = hair(40, 1e-13);
        let drag = vec![0.0; rod.points()];
        let linear = LinearModel::new(&rod, &rod.initial_q, &drag, &GRAVITY);
        let modes = modes(&linear, super::GRAVITY / rod.length(), &LinearKinematics::default()).unwrap();
        // (j/2)² g/L with the zeros j of J0, each in two directions.
        for (mode, zero) in modes.iter().zip([2.404826, 2.404826, 5.520078, 5.520078]) {
            let chain = 0.25 * zero * zero * super::GRAVITY / rod.length();
            assert!((mode.stiffness / chain - 1.0).abs() < 0.05, "{} {chain}", mode.stiffness);
        }
    }

    /// The library solves K x = ω² M x by the QZ algorithm, without a shift or a factor of K.
    #[test]
    fn frequencies_are_the_generalised_eigenvalues_of_stiffness_and_mass() {
        let rod = hair(12, 1e-9);
        let drag = vec![0.0; rod.points()];
        let linear = LinearModel::new(&rod, &rod.initial_q, &drag, &GRAVITY);
        let n = linear.unknowns();
        let [stiffness, mass] =
            [&linear.stiffness, &linear.mass].map(|m| faer::Mat::from_fn(n, n, |i, j| m[i * n + j]));
        let eigen = stiffness.generalized_eigen(&mass).unwrap();
        let mut expected: Vec<f64> = (0..n)
            .map(|k| (eigen.S_a()[k] / eigen.S_b()[k]).re)
            .filter(|square| square.is_finite())
            .collect();
        expected.sort_by(f64::total_cmp);
        let modes = modes(&linear, 0.0, &LinearKinematics::default()).unwrap();
        assert_eq!(modes.len(), MODES);
        for (mode, expected) in modes.iter().zip(expected) {
            assert!((mode.stiffness / expected - 1.0).abs() < 1e-6, "{} {expected}", mode.stiffness);
        }
    }

    #[test]
    fn response_to_a_constant_excitation_converges_to_the_static_one() {
        // Two nodes with unknowns: the modes are complete.
        let rod = hair(3, 1e-9);
        let drag = vec![1e-5; rod.points()];
        let linear = LinearModel::new(&rod, &rod.initial_q, &drag, &GRAVITY);
        let n = linear.unknowns();
        let nodes: Vec<_> = rod.nodes.iter().map(|s| Vector3::y() * -s).collect();
        let kinematics = LinearKinematics::new(&nodes, &rod.nodes);
        let mut response = ModalResponse::new(&rod, &rod.initial_q, &kinematics, &drag, &GRAVITY);
        for k in 0..HeadExcitation::COMPONENTS {
            let excitation = HeadExcitation::unit(k);
            let mut q = linear.generalised_force(|x, mass, drag| excitation.force(x, mass, drag));
            let mut factor = linear.stiffness.clone();
            assert_eq!(cholesky::factor(&mut factor, n), 1);
            cholesky::solve(&factor, n, &mut q);
            for _ in 0..4000 {
                response.step(&excitation, 0.05, &NeighbourDrag::default(), &[]);
            }
            response.update_deflection();
            let expected = linear.normalised_strain(&q);
            let size = expected.iter().map(|strain| strain.norm()).fold(1e-3, f64::max);
            let close = |found: &[f64], expected: Vector3<f64>| {
                let found = Vector3::from_column_slice(found);
                assert!((found - expected).norm() < 1e-6 * size, "{k}: {found} {expected}");
            };
            let found = response.deflection();
            let displacements = kinematics.displacements(expected.iter().copied());
            found.displacement().chunks_exact(3).zip(displacements).for_each(|(x, (y, _))| close(x, y));
            for back in 0..Deflection::MOMENTS {
                found.strain(back).chunks_exact(3).zip(&expected).for_each(|(x, y)| close(x, *y));
            }
        }
    }

    /// A leader and a guide that would follow it, stiffer by half.
    fn led() -> [ModalResponse; 2] {
        let [leader, mut own] = [1e-9, 1.5e-9].map(|stiffness| {
            let rod = hair(6, stiffness);
            let nodes: Vec<_> = rod.nodes.iter().map(|s| Vector3::y() * -s).collect();
            let kinematics = LinearKinematics::new(&nodes, &rod.nodes);
            ModalResponse::new(&rod, &rod.initial_q, &kinematics, &vec![1e-5; rod.points()], &GRAVITY)
        });
        own.set_leaders([(0, 1.0, &leader)].into_iter());
        [leader, own]
    }

    /// Displacements of the leader and the other, after a quarter of a second of a head that accelerates.
    fn displaced(hair: NeighbourDrag) -> [Vec<f64>; 2] {
        let mut responses = led();
        let mut rates = [ModalRates::default(); 2];
        for _ in 0..48 {
            for (i, response) in responses.iter_mut().enumerate() {
                response.step(&HeadExcitation::unit(0), 1.0 / 192.0, &hair, &rates);
                rates[i] = response.rates();
            }
        }
        responses.map(|mut response| {
            response.update_deflection();
            response.deflection().displacement().to_vec()
        })
    }

    fn norm(x: impl Iterator<Item = f64>) -> f64 {
        x.map(|x| x * x).sum::<f64>().sqrt()
    }

    #[test]
    fn hair_opposes_what_a_guide_moves_relative_to_its_leader() {
        let slip = |friction: f64, air: f64| {
            let [leader, own] = displaced(NeighbourDrag { friction, air });
            let apart = norm(leader.iter().zip(&own).map(|(a, b)| a - b));
            apart / norm(leader.into_iter())
        };
        let free = slip(0.0, 0.0);
        assert!(free > 0.02, "{free}");
        // Held, it moves as its leader in all its modes; the two shapes differ by little.
        let held = slip(1e3, 0.0);
        assert!(held < 0.1 * free, "{held} {free}");
        // The more it is opposed, the less it slips.
        let slips = [slip(0.01, 0.0), slip(0.03, 0.0), slip(0.0, 30.0)];
        assert!(slips.iter().all(|slip| *slip < 0.95 * free && *slip > held), "{slips:?} {free}");
        assert!(slips[1] < slips[0]);
    }

    #[test]
    fn friction_of_the_bound_slows_a_mode_steadily() {
        let [_, mut own] = led();
        let (h, hair) = (1e-5, NeighbourDrag { friction: 0.2, air: 0.0 });
        let (k, rate) = (0, 1e-4);
        own.states[k] = ModeState { z: [0.0, -h * rate, -2.0 * h * rate], rate: [rate; 2] };
        let still = HeadExcitation::unit(0).minus(&HeadExcitation::unit(0));
        for _ in 0..100 {
            own.step(&still, h, &hair, &[ModalRates::default()]);
        }
        let slowed = rate - own.states[k].rate[0];
        let expected = 100.0 * h * (hair.friction * own.modes[k].grip + own.modes[k].damping * rate);
        assert!((slowed / expected - 1.0).abs() < 0.05, "{slowed} {expected}");
    }

    #[test]
    fn a_force_that_leaders_do_not_have_bends_a_guide_away_as_statics_have_it() {
        // Displacements are to first order in the length of an element.
        let rod = hair(60, 1e-9);
        let nodes: Vec<_> = rod.nodes.iter().map(|s| Vector3::y() * -s).collect();
        let kinematics = LinearKinematics::new(&nodes, &rod.nodes);
        let drag = vec![1e-5; rod.points()];
        let weightless = Vector3::zeros();
        let mut own = ModalResponse::new(&rod, &rod.initial_q, &kinematics, &drag, &weightless);
        let force = ForceApart { place: 1.0, force: Vector3::z() * 1e-10 };
        let mut tip = |hair: NeighbourDrag| {
            own.rejoin();
            for _ in 0..100 {
                own.move_apart(&[force], &hair, 0.05, 40);
            }
            kinematics.displacements(own.strain_apart().into_iter()).last().unwrap().0 * rod.length()
        };
        // F L³/3EI.
        let expected = 1e-10 * rod.length().powi(3) / (3.0 * 1e-9);
        let free = tip(NeighbourDrag::default());
        assert!((free.z / expected - 1.0).abs() < 0.05 && free.xy().norm() < 1e-3 * expected, "{free}");
        // The air between hairs slows it, and friction of more than the force holds it.
        let slowed = tip(NeighbourDrag { friction: 0.0, air: 10.0 });
        assert!((slowed.z / free.z - 1.0).abs() < 1e-3, "{slowed}");
        let held = tip(NeighbourDrag { friction: 1.0, air: 0.0 });
        assert_eq!(held, Vector3::zeros());
    }
}
