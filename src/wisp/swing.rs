//! How guides swing as the head shakes them, to first order: by how much hair that is alike but for its length or lie moves otherwise.

use super::LinearKinematics;
use super::linear::Linear;
use crate::math::cholesky;
use crate::rod::Rod;
use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix3x4, SymmetricEigen, Vector3};
use serde::{Deserialize, Serialize};

/// Modes of a guide, the slowest: two of each order, about.
const MODES: usize = 6;

const G: f64 = 9.81;

/// Numbers of a [`HeadExcitation`].
const SHAKES: usize = 18;

/// What shakes hair at a moment, as seen from the head: a field of acceleration a − 𝐀 x and of the air's motion −(v + ω × x), m, m/s² and m/s; in order a, 𝐀 by
/// its columns, v and ω.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HeadExcitation([f64; SHAKES]);

impl HeadExcitation {
    /// Of hair that is pulled by `pull`, m/s², world, on a head that is at `heads`, now and one to four steps of `h`, s, ago: rates are those of the solver's own
    /// differences (`docs/theory.md` §4.6).
    pub fn new(heads: &[Isometry3<f64>; 5], h: f64, pull: &Vector3<f64>) -> Self {
        let poses = heads.map(|head| head.to_homogeneous().fixed_view::<3, 4>(0, 0).into_owned());
        let rate = |p: &[Matrix3x4<f64>]| (p[0] * 3.0 - p[1] * 4.0 + p[2]) / (2.0 * h);
        let rates = [rate(&poses), rate(&poses[1..]), rate(&poses[2..])];
        let to_head = heads[0].rotation.inverse().to_rotation_matrix();
        let (velocity, acceleration) = (to_head.matrix() * rates[0], to_head.matrix() * rate(&rates));
        let a = to_head * pull - acceleration.column(3);
        let spin = velocity.fixed_view::<3, 3>(0, 0);
        let omega = [(2, 1), (0, 2), (1, 0)].map(|(i, j)| 0.5 * (spin[(i, j)] - spin[(j, i)]));
        let linear = acceleration.fixed_view::<3, 3>(0, 0).into_owned();
        let mut numbers = a
            .iter()
            .chain(linear.iter())
            .chain(velocity.column(3).iter())
            .chain(&omega)
            .copied()
            .collect::<Vec<_>>()
            .into_iter();
        HeadExcitation(std::array::from_fn(|_| numbers.next().unwrap_or(0.0)))
    }

    /// What it is more than `other`.
    pub fn minus(&self, other: &Self) -> Self {
        HeadExcitation(std::array::from_fn(|k| self.0[k] - other.0[k]))
    }

    /// One of the numbers alone.
    fn unit(k: usize) -> Self {
        HeadExcitation(std::array::from_fn(|i| f64::from(u8::from(i == k))))
    }

    /// The force on a mass, kg, with a drag, N·s/m, at `x`, m, rest space.
    fn force(&self, x: &Vector3<f64>, mass: f64, drag: f64) -> Vector3<f64> {
        let [a, v, omega] = [0, 12, 15].map(|at| Vector3::from_column_slice(&self.0[at..at + 3]));
        let linear = Matrix3::from_column_slice(&self.0[3..12]);
        (a - linear * x) * mass - (v + omega.cross(x)) * drag
    }
}

/// A guide that swings: its slowest modes, moved by what shakes it.
#[derive(Debug, Clone, Default)]
pub struct ModalResponse {
    modes: Vec<Mode>,
    swung: Vec<ModeState>,
    /// Turning of its nodes now, then one and two steps ago: three numbers each, per share of the length, rest space, rad; then the ways of its nodes but the
    /// root now, as shares of its length.
    pub turning: Vec<f64>,
}

/// z̈ + c ż + ω² z = f.
#[derive(Debug, Clone)]
struct Mode {
    /// Turning of the nodes at z = 1, and the ways of those but the root.
    turning: Vec<f64>,
    ways: Vec<f64>,
    /// c, 1/s, and ω², 1/s².
    damping: f64,
    stiffness: f64,
    /// f of each number of a shake.
    push: [f64; SHAKES],
}

/// How far a mode has swung.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ModeState {
    /// z now, and one and two steps ago.
    z: [f64; 3],
    /// ż now, and a step ago.
    rate: [f64; 2],
}

impl ModalResponse {
    /// Of `rod` that rests at unknowns `q`, 1/m, with that `reach`, with `drag` at its points, N·s/m², pulled by `pull`, m/s², rest space.
    pub fn new(rod: &Rod, q: &[f64], reach: &LinearKinematics, drag: &[f64], pull: &Vector3<f64>) -> Self {
        let pendulum = pull.norm() / rod.length();
        let modes = modes(&Linear::new(rod, q, drag, pull), pendulum, reach).unwrap_or_default();
        ModalResponse {
            swung: vec![ModeState::default(); modes.len()],
            modes,
            turning: vec![0.0; 4 * q.len()],
        }
    }

    /// Swings through steps of `h`, s, that end at moments of these shakes.
    pub fn advance(&mut self, shakes: &[HeadExcitation], h: f64) {
        // By BDF2, as the rods themselves.
        let eta = 2.0 / 3.0 * h;
        for (mode, swung) in self.modes.iter().zip(&mut self.swung) {
            for shake in shakes {
                let f: f64 = mode.push.iter().zip(&shake.0).map(|(push, shake)| push * shake).sum();
                let past = |now: f64, before: f64| (4.0 * now - before) / 3.0;
                let ([z, before, _], [rate, rate_before]) = (swung.z, swung.rate);
                let (from, rate_from) = (past(z, before), past(rate, rate_before));
                let next = (rate_from + eta * (f - mode.stiffness * from))
                    / (1.0 + eta * (mode.damping + eta * mode.stiffness));
                *swung = ModeState { z: [from + eta * next, z, before], rate: [next, rate] };
            }
        }
        self.turn();
    }

    fn turn(&mut self) {
        let n = self.turning.len() / 4;
        self.turning.fill(0.0);
        for (mode, ModeState { z, .. }) in self.modes.iter().zip(&self.swung) {
            let parts =
                [(&mode.turning, z[0]), (&mode.turning, z[1]), (&mode.turning, z[2]), (&mode.ways, z[0])];
            for (sums, (of, z)) in self.turning.chunks_exact_mut(n).zip(parts) {
                sums.iter_mut().zip(of).for_each(|(sum, of)| *sum += of * z);
            }
        }
    }

    /// How far each mode has swung.
    pub fn mode_states(&self) -> &[ModeState] {
        &self.swung
    }

    /// Goes on from where modes as many as its own had swung to.
    pub fn restore(&mut self, swung: Vec<ModeState>) {
        self.swung = swung;
        self.turn();
    }
}

/// The slowest modes, none where there is no sense in them. What gives way where it hangs, as what stands or leans on a body, is held as a `pendulum` is, of that ω²,
/// 1/s².
fn modes(linear: &Linear, pendulum: f64, reach: &LinearKinematics) -> Option<Vec<Mode>> {
    let n = linear.unknowns();
    let some = G / linear.length();
    // Those of 𝐊 + s 𝐌, which is positive definite if s is large enough.
    let shifted = |shift: f64| {
        let mut sum: Vec<f64> =
            linear.stiffness.iter().zip(&linear.mass).map(|(k, m)| k + shift * m).collect();
        (cholesky::factor(&mut sum, n) == 1).then_some((shift, sum))
    };
    let (shift, factor) = (0..32).map(|k| some * f64::from(1_u32 << k)).find_map(shifted)?;
    let lower = |rows: &DMatrix<f64>| {
        let mut columns = rows.transpose();
        columns
            .column_iter_mut()
            .for_each(|mut column| cholesky::solve_lower(&factor, n, column.as_mut_slice()));
        columns
    };
    let mass = lower(&lower(&DMatrix::from_row_slice(n, n, &linear.mass)));
    let eigen = SymmetricEigen::new((&mass + mass.transpose()) * 0.5);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let pushes: Vec<Vec<f64>> = (0..SHAKES)
        .map(|k| linear.forces(|x, mass, drag| HeadExcitation::unit(k).force(x, mass, drag)))
        .collect();
    let mode = |k: usize| {
        let share = eigen.eigenvalues[k];
        let mut q: Vec<f64> = eigen.eigenvectors.column(k).iter().map(|y| y / share.sqrt()).collect();
        cholesky::solve_upper(&factor, n, &mut q);
        let damping =
            linear.damping.chunks_exact(n).zip(&q).map(|(row, q_i)| q_i * cholesky::dot(row, &q)).sum();
        let turning = linear.turning(&q);
        let ways = numbers(reach.displacements(turning.iter().copied()).map(|(way, _)| way));
        let turning = numbers(turning.into_iter());
        let push = std::array::from_fn(|k| cholesky::dot(&pushes[k], &q));
        Mode { turning, ways, damping, stiffness: (1.0 / share - shift).max(pendulum), push }
    };
    Some(order.into_iter().take(MODES).filter(|k| eigen.eigenvalues[*k] > 0.0).map(mode).collect())
}

fn numbers(vectors: impl Iterator<Item = Vector3<f64>>) -> Vec<f64> {
    vectors.flat_map(|v| [v.x, v.y, v.z]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::{RodSource, SegmentSize, Taper};
    use crate::scene::Tree;

    const PULL: Vector3<f64> = Vector3::new(0.0, -G, 0.0);

    /// A hair that hangs 20 cm down, 10 cm beside the middle of the head.
    fn hair(nodes: usize, stiffness: f64) -> Rod {
        let root = Vector3::x() * 0.1;
        Rod::new(&RodSource {
            points: &[root, root - Vector3::y() * 0.2],
            root_frame: None,
            arc: &Tree::default_arc(nodes),
            stiffness: [stiffness; 3],
            line_density: 6.6e-6,
            damping: 0.01,
            taper: Taper::NONE,
            natural_strain: None,
            segment_size: SegmentSize::FINE,
        })
        .unwrap()
    }

    #[test]
    fn limp_hair_swings_as_a_hanging_chain() {
        let rod = hair(40, 1e-13);
        let drag = vec![0.0; rod.points()];
        let linear = Linear::new(&rod, &rod.initial_q, &drag, &PULL);
        let modes = modes(&linear, G / rod.length(), &LinearKinematics::default()).unwrap();
        // (j/2)² g/L, j the zeros of J0, each to two sides.
        for (mode, zero) in modes.iter().zip([2.404826, 2.404826, 5.520078, 5.520078]) {
            let chain = 0.25 * zero * zero * G / rod.length();
            assert!((mode.stiffness / chain - 1.0).abs() < 0.05, "{} {chain}", mode.stiffness);
        }
    }

    #[test]
    fn a_swing_that_is_pushed_steadily_comes_to_where_stiffness_holds_it() {
        // Two nodes with unknowns: its modes are all that have inertia.
        let rod = hair(3, 1e-9);
        let drag = vec![1e-5; rod.points()];
        let linear = Linear::new(&rod, &rod.initial_q, &drag, &PULL);
        let n = linear.unknowns();
        let places: Vec<_> = rod.nodes.iter().map(|s| Vector3::y() * -s).collect();
        let reach = LinearKinematics::new(&places, &rod.nodes);
        let mut swing = ModalResponse::new(&rod, &rod.initial_q, &reach, &drag, &PULL);
        for k in 0..SHAKES {
            let shake = HeadExcitation::unit(k);
            let mut q = linear.forces(|x, mass, drag| shake.force(x, mass, drag));
            let mut factor = linear.stiffness.clone();
            assert_eq!(cholesky::factor(&mut factor, n), 1);
            cholesky::solve(&factor, n, &mut q);
            swing.advance(&[shake; 4000], 0.05);
            let still = linear.turning(&q);
            let size = still.iter().map(|turn| turn.norm()).fold(1e-3, f64::max);
            let (turning, ways) = swing.turning.split_at(3 * n);
            for (way, (found, _)) in ways.chunks_exact(3).zip(reach.displacements(still.iter().copied())) {
                assert!(
                    (Vector3::from_column_slice(way) - found).norm() < 1e-6 * size,
                    "{k}: {way:?} {found}"
                );
            }
            for back in turning.chunks_exact(n) {
                for (turned, still) in back.chunks_exact(3).zip(&still) {
                    assert!(
                        (Vector3::from_column_slice(turned) - still).norm() < 1e-6 * size,
                        "{k}: {turned:?} {still}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_shake_is_what_a_mass_on_the_head_feels() {
        // A head that flies along a parabola, and spins.
        let (axis, rate) = (Vector3::new(0.3, 0.8, -0.5).normalize(), 3.0);
        let (speed, gain) = (Vector3::new(0.4, 0.0, -1.0), Vector3::new(2.0, 1.0, 0.0));
        let head = |t: f64| Isometry3::new(speed * t + gain * (0.5 * t * t), axis * (rate * t));
        let (h, t) = (1e-4, 0.2);
        let shake = HeadExcitation::new(&std::array::from_fn(|k| head(t - k as f64 * h)), h, &PULL);
        let x = Vector3::new(0.05, 0.1, -0.02);
        let spin = axis * rate;
        let back = head(t).rotation.inverse();
        let felt = back * (PULL - gain) - spin.cross(&spin.cross(&x));
        let air = back * (speed + gain * t) + spin.cross(&x);
        for (mass, drag, force) in [(1.0, 0.0, felt), (0.0, 1.0, -air)] {
            assert!(
                (shake.force(&x, mass, drag) - force).norm() < 1e-4,
                "{} {force}",
                shake.force(&x, mass, drag)
            );
        }
        assert_eq!(shake.minus(&shake).force(&x, 1.0, 1.0), Vector3::zeros());
    }
}
