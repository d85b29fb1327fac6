use super::*;
use crate::contact::Bodies;
use crate::dynamics::guide::{ContactMode, GuideModel, GuideScratch};
use crate::rod::RodSource;
use crate::scene::{Material, Tree};
use nalgebra::{Isometry3, UnitQuaternion};
use std::f64::consts::PI;

type V = Vector3<f64>;

/// Hairs that hang side by side, some millimetres apart.
struct Curtain {
    models: Vec<GuideModel>,
    states: Vec<GuideState>,
    volume: HairVolume,
    env: Environment<'static>,
}

const H: f64 = 1.0 / 96.0;

fn turning(t: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(V::new(0.2, 3.0, -0.1) * t);
    Isometry3::from_parts(V::new(0.1 * t, 0.4, 0.0).into(), turn)
}

fn frictionless() -> Material {
    Material { friction: crate::geometry::Friction { mu_s: 0.0, mu_k: 0.0 }, ..Material::default() }
}

/// Number of hairs of guide `i`.
fn hairs(i: usize) -> f64 {
    8.0 + 0.02 * i as f64
}

/// Roots of `count` × `count` guides, `apart`, m.
pub(super) fn square(count: usize, apart: f64) -> Vec<V> {
    let root = |i: usize| V::new((i / count) as f64, 0.1 * (i % 3) as f64, (i % count) as f64) * apart;
    (0..count * count).map(root).collect()
}

/// `count` × `count` guides, `apart`, m.
fn curtain(count: usize, apart: f64) -> Curtain {
    curtain_of(&square(count, apart), &Material::default())
}

/// A guide that bends along x.
pub(super) fn guide(root: &V, hairs: f64, material: Material) -> GuideRod {
    let point = |k: i32| root - V::new(0.05 * f64::from(k * k), 1.0, 0.0) * (0.01 * f64::from(k));
    let points: Vec<V> = (0..12).map(point).collect();
    let rod = crate::rod::Rod::new(&RodSource::hair(&points, &Tree::default_arc(6))).unwrap();
    GuideRod { guide: 0, leaf: (0, 0), hairs, material, rod }
}

/// Guides with these roots.
fn curtain_of(roots: &[V], material: &Material) -> Curtain {
    let rod = |(i, root): (usize, &V)| guide(root, hairs(i), material.clone());
    let rods: Vec<GuideRod> = roots.iter().enumerate().map(rod).collect();
    let env = Environment { head: Box::new(turning), ..Environment::at_rest(Bodies::default()) };
    let models: Vec<GuideModel> =
        rods.iter().map(|r| GuideModel::new(r.rod.clone(), vec![0.0; r.rod.points()], 0.3)).collect();
    let states: Vec<GuideState> = models.iter().map(|m| GuideState::new(m, &[], &env, 0.0, H)).collect();
    let volume = HairVolume::new(&rods, &vec![1.0; rods.len()], &models, &states, &env, ([0.0, H], &[]));
    Curtain { models, states, volume, env }
}

impl Curtain {
    /// Gives each point the position and the velocity relative to the head that `of` maps its head-space
    /// position in the groom's pose to, at time 0, as they were before a sub-step without forces.
    fn set(&mut self, of: impl Fn(usize, &V) -> (V, V)) {
        let head = CarrierVelocity::of_head(&self.env, 0.0);
        for (i, state) in self.states.iter_mut().enumerate() {
            for (k, x) in state.x.iter_mut().enumerate() {
                let (moved, v) = of(i, &head.to_head(x));
                *x = turning(0.0) * nalgebra::Point3::from(moved) - nalgebra::Point3::origin();
                // Carried by the head, and v relative to it.
                state.v[k] = head.to_world(&(v - head.relative_velocity(x, &V::zeros())));
            }
        }
        self.volume.locate(&self.states, &self.env, 0.0);
        let history = |piece: &Piece| History {
            before: [piece.v; 3],
            unforced: piece.v,
            eta: H,
            beyond_leader: V::zeros(),
            pressure_beyond_leader: V::zeros(),
        };
        self.volume.history = self.volume.pieces.iter().map(history).collect();
    }

    /// The record of a sub-step.
    fn record(&mut self) -> HairRecord {
        self.states.iter_mut().for_each(GuideState::clear_hair_force);
        self.volume.apply(&self.models, &mut self.states, |_| true, &self.env, [0.0, H])
    }

    /// The forces on the points of each guide, N, head axes.
    fn forces(&mut self) -> Vec<Vec<V>> {
        self.record();
        let to_head = turning(0.0).rotation.inverse();
        self.states.iter().map(|s| s.hair_force().iter().map(|f| to_head * f).collect()).collect()
    }

    /// Σ hairs · f · weight(i, k) over all points.
    fn sum(&self, forces: &[Vec<V>], weight: impl Fn(usize, usize) -> V) -> f64 {
        let of = |(i, forces): (usize, &Vec<V>)| {
            forces.iter().enumerate().map(|(k, f)| f.dot(&weight(i, k))).sum::<f64>() * hairs(i)
        };
        forces.iter().enumerate().map(of).sum()
    }
}

fn largest(forces: &[Vec<V>]) -> f64 {
    forces.iter().flatten().map(V::norm).fold(0.0, f64::max)
}

#[test]
fn hair_carried_by_the_head_in_the_pose_of_the_groom_feels_nothing() {
    let mut hair = curtain(5, 0.004);
    hair.set(|_, x| (*x, V::zeros()));
    assert!(largest(&hair.forces()) < 1e-15);
}

#[test]
fn pressure_is_the_derivative_of_an_energy_and_keeps_momentum() {
    let mut hair = curtain(14, 0.004);
    let squeeze = |x: &V, by: f64| V::new(x.x * (1.0 - by), x.y, x.z * (1.0 - 0.5 * by));
    hair.set(|_, x| (squeeze(x, 0.4), V::zeros()));
    let mut forces = hair.forces();
    // Without what keeps hair out of hair that crosses it.
    let HairVolume { hairs: kinds, parts, pieces, .. } = &hair.volume;
    for (piece, part) in pieces.iter().zip(parts) {
        for k in part.points.clone() {
            let length = hair.models[part.guide].rod.weight[k];
            forces[part.guide][k] -= piece.repulsion * kinds[part.guide].fibre.area * length;
        }
    }
    let size = hair.sum(&forces, |i, k| forces[i][k].try_normalize(0.0).unwrap_or_default());
    assert!(size > 0.0);
    // To the variation of the shape functions between nodes.
    for axis in [V::x(), V::y(), V::z()] {
        let share = hair.sum(&forces, |_, _| axis) / size;
        assert!(share.abs() < 0.03, "{share}");
    }
    // Pushed apart.
    let head = CarrierVelocity::of_head(&hair.env, 0.0);
    let places: Vec<Vec<V>> =
        hair.states.iter().map(|state| state.x.iter().map(|x| head.to_head(x)).collect()).collect();
    let across = |i: usize, k: usize| V::new(places[i][k].x - 0.02, 0.0, 0.0);
    assert!(hair.sum(&forces, across) > 0.0);
    // The energy is Σ V ∫ u′ dφ. Displacements of single points at random.
    let direction = |i: usize, k: usize| {
        let draw = |a: u64| crate::math::random::unit(a, (i * 100 + k) as u64) - 0.5;
        V::new(draw(1), draw(2), draw(3))
    };
    hair.volume.deposit(&hair.models, &hair.states, &hair.env, [0.0, H]);
    // k E of each piece as the forces take it: they leave out that it changes with the mean direction.
    let fibre = &hair.volume.hairs[0].fibre;
    let stiffness = |piece: usize| {
        let hair = hair.volume.assembly(piece);
        hair.energy_slope(fibre, 0.0, f64::INFINITY) / hair.fraction
    };
    let stiffness: Vec<f64> = (0..hair.volume.parts.len()).map(stiffness).collect();
    let mut energy = |step: f64| {
        let moved: Vec<Vec<V>> = places
            .iter()
            .enumerate()
            .map(|(i, p)| p.iter().enumerate().map(|(k, x)| x + direction(i, k) * step).collect())
            .collect();
        for (state, moved) in hair.states.iter_mut().zip(&moved) {
            for (x, m) in state.x.iter_mut().zip(moved) {
                *x = turning(0.0) * nalgebra::Point3::from(*m) - nalgebra::Point3::origin();
            }
        }
        hair.volume.deposit(&hair.models, &hair.states, &hair.env, [0.0, H]);
        let volume = &hair.volume;
        let of = |(i, piece): (usize, &Piece)| {
            let (fraction, rest) = (volume.assembly(i).fraction, volume.rest[i].fraction);
            // ∫ k (φ³ − φ0³)/φ² dφ from φ0.
            let u = |phi: f64| 0.5 * phi * phi + rest.powi(3) / phi;
            let excess = if fraction > rest { u(fraction) - u(rest) } else { 0.0 };
            piece.volume * stiffness[i] * excess
        };
        volume.pieces.iter().enumerate().map(of).sum::<f64>()
    };
    let step = 1e-7;
    let slope = (energy(step) - energy(-step)) / (2.0 * step);
    let found = -hair.sum(&forces, direction);
    assert!((found / slope - 1.0).abs() < 1e-5, "{found} {slope}");
}

#[test]
fn slip_past_the_neighbours_is_lost_and_the_common_motion_kept() {
    let mut hair = curtain(6, 0.004);
    // All guides move; every other one against that.
    let velocity = |i: usize| V::new(0.3, 0.0, if i.is_multiple_of(2) { 0.2 } else { -0.2 });
    hair.set(|i, x| (*x, velocity(i)));
    let forces = hair.forces();
    let power = hair.sum(&forces, |i, _| velocity(i) - V::new(0.3, 0.0, 0.0));
    assert!(power < 0.0, "{power}");
    for (i, forces) in forces.iter().enumerate() {
        for (k, f) in forces.iter().enumerate().skip(1) {
            let lost = -f.z * H / hair.models[i].rod.mass[k] / velocity(i).z;
            assert!((0.0..1.2).contains(&lost), "guide {i} point {k} loses {lost} of its slip");
            assert!(f.x.abs() < 0.2 * f.z.abs());
        }
    }
}

/// Speed, m/s, at which two hairs in the middle of others slip past each other, every other one pulled along z
/// by `load`, times the friction that holds it, after each of some steps.
fn pulled(load: f64) -> Vec<f64> {
    let mut hair = curtain(8, 0.004);
    hair.env = Environment { gravity: Box::new(|_| V::zeros()), ..Environment::at_rest(Bodies::default()) };
    hair.states = hair.models.iter().map(|m| GuideState::new(m, &[], &hair.env, 0.0, H)).collect();
    let mut scratch = GuideScratch::default();
    // Short against the period of the hairs.
    let h = H / 8.0;
    let step = |n: u32| {
        let t = [f64::from(n) * h, f64::from(n + 1) * h];
        hair.states.iter_mut().for_each(GuideState::clear_hair_force);
        hair.volume.apply(&hair.models, &mut hair.states, |_| true, &hair.env, [t[0], h]);
        for (i, (model, state)) in hair.models.iter().zip(&mut hair.states).enumerate() {
            let sign = if i % 2 == 0 { load } else { -load };
            for piece in hair.volume.first[i]..hair.volume.first[i + 1] {
                let bound = hair.volume.assembly(piece).friction_bounds(&hair.volume.hairs[piece].fibre)[0];
                for k in hair.volume.parts[piece].points.clone() {
                    state.hair_force_mut()[k].z += sign * bound * model.rod.weight[k];
                }
            }
            let record = model.step(&hair.env, state, t, ContactMode::Bodies, &mut scratch);
            assert_eq!(record.unconverged, 0);
        }
        let [a, b] = [27, 28].map(|i: usize| &hair.states[i].v[8]);
        (a - b).z.abs()
    };
    (0..10).map(step).collect()
}

#[test]
fn friction_holds_what_is_pulled_with_less_than_its_bound() {
    let [held, pulled, free] = [0.5, 2.0, 20.0].map(pulled);
    // The load comes unforeseen in the first step.
    assert!(held[9] < 0.01 * held[0], "{held:?}");
    assert!(pulled[9] > 3.0 * pulled[0], "{pulled:?}");
    // What goes beyond the bound accelerates.
    let share = pulled[9] / free[9];
    assert!(share > 0.5 * 1.0 / 19.0 && share < 2.0 * 1.0 / 19.0, "{share}");
}

/// Two layers of hair, 8 mm apart, at this `angle`, rad, to each other, after a step; the upper one falls on the
/// other at `speed`, m/s. They were apart in the groom's pose.
fn layers(angle: f64, speed: f64) -> Curtain {
    layers_of_pose(angle, speed, 0.0)
}

/// [`layers`] of which the volume fraction `crossing` crosses each other in the groom's pose.
fn layers_of_pose(angle: f64, speed: f64, crossing: f64) -> Curtain {
    let dry = Material { drag: 0.0, ..frictionless() };
    let roots = square(8, 0.004);
    let mut hair = curtain_of(&roots, &dry);
    hair.volume.rest.iter_mut().for_each(|rest| rest.crossing = crossing);
    let course = |i: usize| V::new((angle * layer(i) as f64).cos(), 0.0, (angle * layer(i) as f64).sin());
    hair.set(|i, x| {
        let aside = V::y().cross(&course(i)) * (0.002 * ((i / 2) as f64 - 15.5));
        let upper = layer(i) as f64;
        let along = course(i) * (roots[i].y - x.y - 0.055);
        (along + aside + V::y() * (0.008 * upper), V::y() * (-speed * upper))
    });
    for (i, state) in hair.states.iter_mut().enumerate() {
        state.tangent.fill(turning(0.0) * course(i));
    }
    hair.record();
    hair
}

/// The layer of guide `i`: the lower one is 0.
fn layer(i: usize) -> usize {
    i % 2
}

/// What `of` gives for the pieces, in the mean over those around the middle of each layer, lower one first, and
/// the norm of its sum over all hair, by volume, over the sum of the norms.
fn means(hair: &Curtain, of: impl Fn(&Piece) -> V) -> ([V; 2], f64) {
    let [mut sums, mut counts] = [[V::zeros(); 2], [V::zeros(); 2]];
    let (mut norms, mut sum) = (0.0, V::zeros());
    for (piece, part) in hair.volume.pieces.iter().zip(&hair.volume.parts) {
        if piece.x.x.hypot(piece.x.z) < 0.01 {
            sums[layer(part.guide)] += of(piece);
            counts[layer(part.guide)] += V::repeat(1.0);
        }
        norms += (of(piece) * piece.volume).norm();
        sum += of(piece) * piece.volume;
    }
    ([0, 1].map(|k| sums[k].component_div(&counts[k])), sum.norm() / f64::max(norms, f64::MIN_POSITIVE))
}

#[test]
fn hair_stops_where_it_meets_hair_that_crosses_and_leaves_freely() {
    // The mean velocity after the step, by the drag of neighbours alone.
    let meeting = |angle, speed| {
        let hair = layers(angle, speed);
        let ([lower, upper], _) = means(&hair, |piece| piece.v + piece.drag * piece.eta);
        (lower, upper, means(&hair, |piece| piece.drag).1)
    };
    // Each comes to the mean velocity of the hair where it is; half of the way between them is left.
    let (lower, upper, lost) = meeting(PI / 2.0, 0.5);
    assert!((0.1..0.25).contains(&(lower.y - upper.y)), "{lower} {upper}");
    assert!((0.1..0.2).contains(&-lower.y), "{lower}");
    assert!(lost < 0.2, "{lost}");
    let free = |angle: f64, speed: f64| {
        let (lower, upper, _) = meeting(angle, speed);
        assert!((lower - upper + V::y() * -speed).norm() < 0.01 * speed.abs(), "{angle}: {lower} {upper}");
    };
    // Leaving, and parallel.
    free(PI / 2.0, -0.5);
    free(0.0, 0.5);
}

#[test]
fn hair_does_not_stop_where_it_crosses_hair_in_the_pose_of_the_groom_already() {
    let hair = layers_of_pose(PI / 2.0, 0.5, 1.0);
    let ([lower, upper], _) = means(&hair, |piece| piece.v + piece.drag * piece.eta);
    assert!((lower - upper - V::y() * 0.5).norm() < 0.005, "{lower} {upper}");
    assert_eq!(means(&hair, |piece| piece.repulsion).0, [V::zeros(); 2]);
}

#[test]
fn hair_keeps_out_of_hair_that_crosses_it_whatever_its_velocity() {
    let weight = 9.81 * Material::default().density;
    for angle in [20.0_f64, 45.0, 90.0] {
        let hair = layers(angle.to_radians(), 0.0);
        let ([lower, upper], lost) = means(&hair, |piece| piece.repulsion);
        assert!(upper.y > 0.0 && lower.y < 0.0, "{angle}°: {lower} {upper}");
        assert!(lower.xz().norm().max(upper.xz().norm()) < 0.2 * upper.y, "{angle}°: {lower} {upper}");
        assert!(angle < 90.0 || upper.y > 2.0 * weight, "{upper}");
        // What pushes is pushed back.
        assert!(lost < 1e-12, "{angle}°: {lost}");
    }
    let ([lower, upper], _) = means(&layers(0.0, 0.0), |piece| piece.repulsion);
    assert_eq!(lower, V::zeros());
    assert_eq!(upper, V::zeros());
}

/// Their pieces point everywhere, and the mean of each over a turn along the axis that all have.
#[test]
fn curls_that_lie_side_by_side_do_not_keep_apart() {
    let mut hair = curtain(6, 0.004);
    hair.set(|_, x| (*x, V::zeros()));
    for (i, (state, model)) in hair.states.iter_mut().zip(&hair.models).enumerate() {
        for (tangent, arc) in state.tangent.iter_mut().zip(&model.rod.arc) {
            let phase = 2.4 * i as f64 + 2.0 * PI * arc / 0.05;
            *tangent = turning(0.0) * V::new(0.8 * phase.cos(), -0.6, 0.8 * phase.sin());
        }
    }
    hair.volume.deposit(&hair.models, &hair.states, &hair.env, [0.0, H]);
    let HairVolume { pieces, parts, first, .. } = &hair.volume;
    let crossing = |own: bool| {
        let of = |(i, piece): (usize, &Piece)| {
            let axis = if own { piece.tangent } else { hair.volume.axes[i] };
            Crossing::of((&hair.volume.grid, &hair.volume.stencils[i]), &hair.volume.assembly(i), &axis)
                .map_or(0.0, |crossing| crossing.fraction / hair.volume.assembly(i).fraction)
        };
        // Where a whole turn is around the piece.
        let whole = |i: usize| {
            let guide = first[parts[i].guide]..first[parts[i].guide + 1];
            let before: f64 = parts[guide.start..i].iter().map(|part| part.length).sum();
            let after: f64 = parts[i + 1..guide.end].iter().map(|part| part.length).sum();
            before.min(after) > 0.025
        };
        let shares: Vec<f64> = pieces.iter().enumerate().filter(|(i, _)| whole(*i)).map(of).collect();
        shares.iter().sum::<f64>() / shares.len() as f64
    };
    assert!(crossing(false) < 0.2 * crossing(true), "{} {}", crossing(false), crossing(true));
}

#[test]
fn crowding_and_slip_are_recorded() {
    // Nothing takes slip away.
    let mut hair = curtain_of(&square(14, 0.004), &Material { shielding: 0.0, ..frictionless() });
    hair.set(|_, x| (*x, V::zeros()));
    let record = hair.record();
    assert!((record.crowding_p95 - 1.0).abs() < 1e-9 && record.crowding_max >= 1.0, "{record:?}");
    assert!((record.softened, record.slip) == (0.0, 0.0), "{record:?}");
    // Three quarters as wide, and as deep: at most 16/9 as dense, in the cells that it still fills.
    let velocity = |i: usize| V::new(0.3, 0.0, if i.is_multiple_of(2) { 0.2 } else { -0.2 });
    hair.set(|i, x| (V::new(0.75 * x.x, x.y, 0.75 * x.z), velocity(i)));
    let record = hair.record();
    assert!(record.crowding_p95 > 1.4 && record.crowding_p95 < 1.8, "{record:?}");
    assert!(record.crowding_max > record.crowding_p95 && record.crowding_max < 2.0, "{record:?}");
    // The common velocity is no slip.
    assert!((record.slip - 0.2 / 0.3_f64.hypot(0.2)).abs() < 0.02, "{record:?}");
    // By volume: the densest twentieth of the hair is above the percentile.
    let pieces = &mut hair.volume.pieces;
    (0..).zip(pieces.iter_mut()).for_each(|(i, piece)| piece.fraction = f64::from(i));
    let densest: f64 = pieces.iter().rev().take(4).map(|piece| piece.volume).sum();
    let others = pieces.len() - 4;
    pieces[..others].iter_mut().for_each(|piece| piece.volume = 18.0 * densest / others as f64);
    assert_eq!(hair.volume.fraction_p95(), others as f64);
    hair.volume.pieces[..others].iter_mut().for_each(|piece| piece.volume *= 1.2);
    assert!(hair.volume.fraction_p95() < others as f64);
}

#[test]
fn hair_that_turns_as_a_whole_against_the_head_is_not_braked() {
    let mut hair = curtain(6, 0.004);
    hair.set(|_, x| (*x, V::new(0.3, 0.1, 0.0) + V::new(1.0, -5.0, 3.0).cross(x)));
    let largest = hair.forces().iter().flatten().map(|f| f.norm()).fold(0.0, f64::max);
    let weight = hair.models[0].rod.mass.iter().sum::<f64>() * 9.81;
    assert!(largest < 1e-9 * weight, "{largest} {weight}");
}

#[test]
fn the_air_between_hairs_moves_with_them() {
    let material = Material { shielding: 0.9, ..frictionless() };
    let mut hair = curtain_of(&square(6, 0.004), &material);
    // Across the hairs, which are parallel.
    hair.set(|i, x| (*x, V::new(0.0, 0.0, if i.is_multiple_of(3) { 0.3 } else { 0.0 })));
    hair.states.iter_mut().for_each(|state| state.tangent.fill(turning(0.0) * -V::y()));
    let forces = hair.forces();
    let volume = &hair.volume;
    let mut largest: f64 = 0.0;
    for (i, forces) in forces.iter().enumerate() {
        for piece in volume.first[i]..volume.first[i + 1] {
            let values = volume.grid.values(&volume.stencils[piece]);
            let around = RigidMotion::around(&volume.grid, &volume.stencils[piece], &values);
            let slip = volume.pieces[piece].v.z - around.at(&volume.pieces[piece].x).z;
            // The drag of an isolated hair, N·s/m², as far as this hair takes it away from that against the
            // wind.
            let length_density = values[FRACTION] / (PI * 4e-5 * 4e-5);
            let drag = 2.07e-4 * 0.9 * length_density / (length_density + 1e5);
            for k in volume.parts[piece].points.clone() {
                let [length, mass] = [&hair.models[i].rod.weight, &hair.models[i].rod.mass].map(|of| of[k]);
                // On the slip that is left at the end of the step.
                let expected = -drag * length * slip / (1.0 + drag * length / mass * H);
                assert!((forces[k].z - expected).abs() < 1e-6 * expected.abs() + 1e-15, "{i} {k}");
                largest = largest.max(expected.abs() / mass);
            }
        }
    }
    assert!(largest > 1.0, "{largest} m/s²");
}

#[test]
fn hair_far_away_takes_no_more_memory() {
    let mut roots = square(5, 0.004);
    roots.extend(square(5, 0.004).iter().map(|root| root + V::new(3e3, -4e3, 2e3)));
    let mut hair = curtain_of(&roots, &Material::default());
    let blocks = hair.volume.grid.blocks();
    assert!(blocks <= grid::MAX_BLOCKS && blocks > grid::MAX_BLOCKS / 4, "{blocks}");
    // Thrown farther than it is long.
    for thrown in [1.0, 1e9] {
        let mut near = curtain(5, 0.004);
        let blocks = near.volume.grid.blocks();
        near.set(|i, x| (if i == 7 { x + V::repeat(thrown) } else { x * 0.5 }, V::zeros()));
        assert!(largest(&near.forces()).is_finite());
        assert_eq!(near.volume.grid.blocks(), blocks);
    }
    hair.set(|_, x| (x * 0.5, V::zeros()));
    assert!(largest(&hair.forces()).is_finite());
}

#[test]
fn a_follower_is_where_its_leader_carries_it() {
    let mut hair = curtain(4, 0.004);
    hair.set(|_, x| (*x, V::zeros()));
    let Curtain { models, states, volume, env } = &mut hair;
    volume.end_frame(models, states, |i| i.min(1), env, 0.0);
    let before: Vec<V> = volume.pieces.iter().map(|p| p.x).collect();
    let shift = V::new(0.01, -0.002, 0.003);
    let moves = |i: usize| if i < 2 { shift * (1.0 + i as f64) } else { V::zeros() };
    hair.set(|i, x| (x + moves(i), V::new(0.0, 0.1, 0.0)));
    hair.volume.deposit(&hair.models, &hair.states, &hair.env, [0.0, H]);
    for i in 0..hair.models.len() {
        let range = hair.volume.first[i]..hair.volume.first[i + 1];
        for (piece, before) in hair.volume.pieces[range.clone()].iter().zip(&before[range]) {
            assert!((piece.x - before - moves(i.min(1))).norm() < 1e-12);
            assert!((piece.v - V::new(0.0, 0.1, 0.0)).norm() < 1e-6);
        }
    }
    // The velocities of the sub-steps before are its leader's.
    let Curtain { models, states, volume, env } = &mut hair;
    let earlier = |i: usize, volume: &HairVolume| past(&volume.history, &volume.between, volume.first[i])[0];
    let jerk = V::new(0.0, 0.0, 0.7);
    let of_leader = volume.first[1]..volume.first[2];
    of_leader.clone().for_each(|piece| volume.history[piece].before[0] += jerk);
    assert!((earlier(15, volume) - earlier(1, volume)).norm() < 1e-12);
    assert!((earlier(15, volume) - earlier(0, volume) - jerk).norm() < 1e-6);
    of_leader.for_each(|piece| volume.history[piece].before[0] -= jerk);
    // What the leader is pushed by pushes it too, and still does once it moves by itself.
    let push = V::new(0.2, 0.0, -0.1);
    (volume.first[1]..volume.first[2]).for_each(|piece| volume.history[piece].unforced -= push * H);
    volume.deposit(models, states, env, [0.0, H]);
    let of_last = volume.first[15]..volume.first[16];
    let is_pushed = |piece: &Piece| (piece.acceleration - push).norm() < 1e-6;
    assert!(volume.pieces[of_last.clone()].iter().all(is_pushed));
    volume.end_frame(models, states, |i| i, env, 0.0);
    volume.deposit(models, states, env, [0.0, H]);
    assert!(volume.pieces[of_last.clone()].iter().all(is_pushed));
    // Its neighbours balance that.
    of_last.clone().for_each(|piece| volume.pieces[piece].load = -push);
    let is_free = |piece: &Piece| piece.acceleration.norm() < 1e-6;
    assert!(volume.pieces[..volume.first[1]].iter().all(is_free));
    // Behind a leader that is not pushed it keeps its own load, and the leader's changes are added.
    volume.end_frame(models, states, |i| if i == 15 { 0 } else { i }, env, 0.0);
    volume.deposit(models, states, env, [0.0, H]);
    assert!(volume.pieces[..volume.first[1]].iter().all(is_free));
    assert!(volume.pieces[of_last.clone()].iter().all(is_pushed));
    (volume.first[0]..volume.first[1]).for_each(|piece| volume.history[piece].unforced += push * H);
    volume.deposit(models, states, env, [0.0, H]);
    assert!(volume.pieces[of_last].iter().all(is_free));
}

#[test]
fn a_leader_moves_under_the_mean_of_the_forces_on_its_wisp() {
    // Two guides lead the others, all of one shape and crowded towards the middle.
    let mut hair = curtain(4, 0.004);
    hair.set(|_, x| (*x, V::zeros()));
    let Curtain { models, states, volume, env } = &mut hair;
    volume.end_frame(models, states, |i| i % 2, env, 0.0);
    let squeeze = |i: usize, x: &V| (x * 0.7, V::new(0.0, 0.0, if i.is_multiple_of(2) { 0.2 } else { -0.2 }));
    hair.set(squeeze);
    // What guide 2 bears beyond its leader.
    let beyond = V::new(0.0, 0.3, 0.0);
    (hair.volume.first[2]..hair.volume.first[3])
        .for_each(|piece| hair.volume.history[piece].beyond_leader = beyond);
    let forces = hair.forces();
    assert!(largest(&forces) > 0.0);
    let volume = &hair.volume;
    let apart = volume.forces_apart(&hair.models, &hair.env, 0.0);
    for leader in [0, 1] {
        let range = |i: usize| volume.first[i]..volume.first[i + 1];
        for (k, own) in range(leader).enumerate() {
            let wisp = (leader..16).step_by(2).map(|i| range(i).start + k);
            let whole: f64 = wisp.clone().map(|j| volume.pieces[j].volume).sum();
            let mean = |of: &dyn Fn(usize) -> V| {
                wisp.clone().map(|j| of(j) * volume.pieces[j].volume).sum::<V>() / whole
            };
            // What the piece itself is under comes from the grid.
            let gradient = |j: usize| {
                let piece = &volume.pieces[j];
                let energy = |node: &Node| node[FRACTION] * piece.energy_slope + node[PRESSURE];
                let force = piece.repulsion - volume.grid.gradient(&volume.stencils[j], energy);
                force * volume.hairs[0].fibre.area
            };
            let pressure = mean(&gradient);
            let load = mean(&|j| {
                let beyond = if range(2).contains(&j) { beyond } else { V::zeros() };
                volume.pieces[j].drag + beyond
            });
            let (model, points) = (&hair.models[leader], &volume.parts[own].points);
            for point in points.clone() {
                let expected = pressure * model.rod.weight[point] + load * model.rod.mass[point];
                let found = forces[leader][point];
                assert!((found - expected).norm() < 1e-9 * largest(&forces), "{found} {expected}");
            }
            // What followers have beyond the leader, and the leader beyond the mean, balance.
            let part = &volume.parts[own];
            let mut sum = V::zeros();
            for i in (leader..16).step_by(2) {
                let force = match i == leader {
                    true => {
                        let ([pressure, load], _) =
                            volume.led.mean(own, volume.pieces[own].volume, &volume.beyond);
                        -(pressure * part.length + load * part.mass)
                    }
                    false => apart[i][k].force,
                };
                sum += force * volume.pieces[range(i).start + k].volume;
            }
            assert!(sum.norm() < 1e-9 * whole * largest(&forces), "{sum}");
        }
        assert!(apart[leader].is_empty());
    }
}

/// The pieces of tapered hair have the section, the stiffness and the friction of where they are.
#[test]
fn tapered_hair_is_thin_where_it_is() {
    let material =
        Material { radius_at_tip: 0.1, stiffness_at_tip: 2.0, friction_at_tip: 3.0, ..Material::default() };
    let arc = Tree::default_arc(6);
    let taper = crate::rod::Taper { radius: 0.1, stiffness: 2.0, damping: 1.0 };
    let line = [V::zeros(), V::x() * 0.2];
    let rod = crate::rod::Rod::new(&RodSource { taper, ..RodSource::hair(&line, &arc) }).unwrap();
    let model = GuideModel::new(rod.clone(), vec![0.0; rod.points()], 0.3);
    let guide = GuideRod { guide: 0, leaf: (0, 0), hairs: 1.0, material: material.clone(), rod };
    let (parts, _) = Part::of_guides(std::slice::from_ref(&model), 0.006);
    for part in &parts {
        let fibre = Hairs::new(&guide, 1.0, part).fibre;
        let square = |k: usize| (1.0 - 0.9 * model.rod.arc[k] / model.rod.length()).powi(2);
        let mean: f64 = part.points.clone().zip(&part.shares).map(|(k, share)| share * square(k)).sum();
        assert!((fibre.area / (mean * material.section.area()) - 1.0).abs() < 1e-9, "{}", fibre.area);
        assert!((fibre.modulus / material.young_modulus - (1.0 + part.middle)).abs() < 1e-12);
        assert!((fibre.friction / material.friction.mu_k - (1.0 + 2.0 * part.middle)).abs() < 1e-12);
    }
    assert!(parts.last().is_some_and(|tip| tip.section < 0.03 && tip.middle > 0.95));
}
