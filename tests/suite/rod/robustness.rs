//! Rods far from ordinary hair: every step converges, halved if necessary, and stays bounded.

use hairbake::contact::Bodies;
use hairbake::dynamics::environment::Environment;
use hairbake::dynamics::guide::{ContactMode, GuideModel, GuideScratch, GuideState};
use hairbake::dynamics::step_record::StepRecord;
use hairbake::rod::{Rod, RodSource, SegmentSize};
use hairbake::scene::Tree;
use hairbake::scene::anim::Scheme;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Parameters of a hair, SI units.
#[derive(Clone, Copy)]
struct Hair {
    length: f64,
    /// Semi-axes of the section.
    radius: [f64; 2],
    young: f64,
    nodes: usize,
    /// Radius of the curls; 0 for straight hair.
    curl: f64,
    /// Steps per second.
    rate: f64,
    segment_size: SegmentSize,
}

const HAIR: Hair = Hair {
    length: 0.25,
    radius: [40e-6, 40e-6],
    young: 3.89e9,
    nodes: 8,
    curl: 0.0,
    rate: 96.0,
    segment_size: SegmentSize::COARSE,
};

impl Hair {
    fn points(&self) -> Vec<Vector3<f64>> {
        let pitch = 0.5;
        // A helix whose axis points forward, then down; its points are 0.4 rad apart.
        let n = if self.curl > 0.0 { (self.length / self.curl / 0.4) as usize } else { 20 };
        (0..=n)
            .map(|i| {
                let s = self.length * i as f64 / n as f64;
                let a = if self.curl > 0.0 { s / (self.curl * f64::hypot(1.0, pitch)) } else { 0.0 };
                let along = if self.curl > 0.0 { a * self.curl * pitch } else { s };
                let axis = Vector3::new(0.3, -0.95, 0.0).normalize() * along;
                axis + Vector3::new(0.0, 0.0, 1.0) * (self.curl * a.sin())
                    + Vector3::new(0.95, 0.3, 0.0).normalize() * (self.curl * (a.cos() - 1.0))
            })
            .collect()
    }

    fn rod_along(&self, points: &[Vector3<f64>]) -> Rod {
        let [a, b] = self.radius;
        let area = std::f64::consts::PI * a * b;
        let [i1, i2] = [area * b * b / 4.0, area * a * a / 4.0];
        let shear = 0.23 * self.young;
        Rod::new(&RodSource {
            stiffness: [self.young * i1, self.young * i2, shear * 4.0 * i1 * i2 / (i1 + i2)],
            line_density: 1320.0 * area,
            damping: 0.005,
            segment_size: self.segment_size,
            ..RodSource::hair(points, &Tree::default_arc(self.nodes))
        })
        .unwrap()
    }

    /// Simulates 0.5 s on a head that moves by `pose`. Returns the sum of the records, the largest speed and
    /// the speed at the end, m/s.
    fn run(&self, scheme: Scheme, pose: &(dyn Fn(f64) -> Isometry3<f64> + Sync)) -> (StepRecord, f64, f64) {
        self.run_along(&self.points(), scheme, pose)
    }

    /// The same for a hair through `points`.
    fn run_along(
        &self,
        points: &[Vector3<f64>],
        scheme: Scheme,
        pose: &(dyn Fn(f64) -> Isometry3<f64> + Sync),
    ) -> (StepRecord, f64, f64) {
        let env = Environment {
            head: Box::new(pose),
            body: Box::new(|_, t| pose(t)),
            ..Environment::at_rest(Bodies::default())
        };
        let (rod, h) = (self.rod_along(points), 1.0 / self.rate);
        let drag = vec![2e-5; rod.points()];
        let mut model = GuideModel::new(rod, drag, 0.3);
        let mut state = GuideState::new(&model, &[], &env, 0.0, h);
        model.scheme = scheme;
        let mut scratch = GuideScratch::default();
        let mut sum = StepRecord::default();
        let mut fastest = 0.0_f64;
        let steps = (0.5 * self.rate) as u32;
        for i in 0..steps {
            let (t0, t1) = (f64::from(i) * h, f64::from(i + 1) * h);
            let record = model.step(&env, &mut state, [t0, t1], ContactMode::Bodies, &mut scratch);
            sum.iterations += record.iterations;
            sum.halvings += record.halvings;
            sum.unconverged += record.unconverged;
            fastest = state.v.iter().map(|v| v.norm()).fold(fastest, f64::max);
            let root = pose(t1) * nalgebra::Point3::from(model.rod.root.p);
            let reach = state.x.iter().map(|x| (x - root.coords).norm()).fold(0.0, f64::max);
            assert!(reach < self.length * (1.0 + 1e-9), "stretched to {reach} m of {}", self.length);
            assert!(fastest.is_finite());
        }
        let calm = state.v.iter().map(|v| v.norm()).fold(0.0, f64::max);
        (sum, fastest, calm)
    }
}

/// A head shaken at 2.5 Hz by ±5 cm and rotated by ±30°.
fn shaken(t: f64) -> Isometry3<f64> {
    let wave = (std::f64::consts::TAU * 2.5 * t).sin();
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.5 * wave);
    Isometry3::from_parts((Vector3::x() * 0.05 * wave).into(), turn)
}

/// A head that jumps by a metre and half a turn between two frames.
fn teleported(t: f64) -> Isometry3<f64> {
    let gone = if t > 0.2 { 1.0 } else { 0.0 };
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI * gone);
    Isometry3::from_parts((Vector3::x() * gone).into(), turn)
}

fn kinds() -> Vec<(&'static str, Hair)> {
    let (a, b) = (40e-6, 40e-6);
    vec![
        ("hair", HAIR),
        ("soft", Hair { young: 3.89e7, ..HAIR }),
        ("stiff", Hair { young: 3.89e11, ..HAIR }),
        ("thin", Hair { radius: [4e-6, 4e-6], ..HAIR }),
        ("thick", Hair { radius: [4e-4, 4e-4], ..HAIR }),
        ("a hundred times as thick", Hair { radius: [4e-3, 4e-3], ..HAIR }),
        ("1 mm", Hair { length: 1e-3, ..HAIR }),
        ("1 m", Hair { length: 1.0, ..HAIR }),
        ("2 m", Hair { length: 2.0, ..HAIR }),
        ("2 m, fine segments", Hair { length: 2.0, segment_size: SegmentSize::FINE, ..HAIR }),
        ("3 nodes", Hair { nodes: 3, ..HAIR }),
        ("64 nodes", Hair { nodes: 64, ..HAIR }),
        ("curls of 5 mm", Hair { length: 0.3, curl: 2.5e-3, ..HAIR }),
        ("curls of 4 mm, 24 nodes", Hair { length: 0.3, curl: 2e-3, nodes: 24, ..HAIR }),
        ("ribbon", Hair { radius: [10.0 * a, b], ..HAIR }),
        ("ribbon across", Hair { radius: [a, 10.0 * b], ..HAIR }),
        ("24 steps per second", Hair { rate: 24.0, ..HAIR }),
        ("2000 steps per second", Hair { rate: 2000.0, ..HAIR }),
    ]
}

#[test]
fn straight_hanging_hair_stays_at_rest() {
    // In exact equilibrium the gradient is zero.
    let points: Vec<_> = (0..=20).map(|i| Vector3::y() * (-0.25 * f64::from(i) / 20.0)).collect();
    for scheme in [Scheme::BackwardEuler, Scheme::Bdf2, Scheme::FourStep] {
        let (record, fastest, _) = HAIR.run_along(&points, scheme, &|_| Isometry3::identity());
        assert_eq!((record.unconverged, record.halvings), (0, 0), "{scheme:?}");
        assert!(fastest < 1e-9, "{scheme:?}: {fastest} m/s");
    }
}

#[test]
fn coarse_segments_resolve_a_bend_between_nodes() {
    // A hair of 1 m with three nodes that turns by 270° within 3 cm.
    let mut points = vec![Vector3::zeros()];
    let mut heading = 0.0_f64;
    for i in 0..1000 {
        let s = f64::from(i) * 1e-3;
        if (0.62..0.65).contains(&s) {
            heading += 1.5 * std::f64::consts::PI / 30.0;
        }
        let last = *points.last().unwrap();
        points.push(last + Vector3::new(heading.cos(), 0.0, heading.sin()) * 1e-3);
    }
    let end = |segment_size: SegmentSize| {
        let hair = Hair { nodes: 3, segment_size, length: 1.0, ..HAIR };
        let rod = hair.rod_along(&points);
        let mut shape = hairbake::rod::RodShape::default();
        let q: Vec<f64> = (0..rod.unknowns()).map(|i| (f64::from(i as u32) * 0.7).sin() * 3.0).collect();
        shape.update(&rod, &rod.root.r, &q);
        shape.x(shape.points() - 1)
    };
    let off = (end(SegmentSize::COARSE) - end(SegmentSize { max_length: 1e-3, max_turn: 0.05 })).norm();
    // A thousandth of the length; 72 mm if the bend is missed.
    assert!(off < 1e-3, "{off} m");
}

#[test]
fn unusual_rods_converge_on_a_shaken_head() {
    for scheme in [Scheme::BackwardEuler, Scheme::Bdf2, Scheme::FourStep] {
        for (name, hair) in kinds() {
            let (record, fastest, _) = hair.run(scheme, &shaken);
            assert_eq!(record.unconverged, 0, "{name}, {scheme:?}");
            assert!(fastest < 20.0, "{name}, {scheme:?}: {fastest} m/s");
        }
    }
}

/// A thread of a hundredth of the radius of a hair: ten thousand times as limp for its weight, and nearly
/// weightless in air. Solves that fail are recorded, and the thread neither stretches nor flies off.
#[test]
fn thread_too_thin_to_solve_is_carried_and_recorded() {
    for scheme in [Scheme::BackwardEuler, Scheme::Bdf2, Scheme::FourStep] {
        let (record, fastest, _) = Hair { radius: [4e-7, 4e-7], ..HAIR }.run(scheme, &shaken);
        assert!(record.unconverged > 0 && fastest < 20.0, "{scheme:?}: {record:?}, {fastest} m/s");
    }
}

#[test]
fn unusual_rods_survive_a_teleport() {
    for scheme in [Scheme::BackwardEuler, Scheme::Bdf2, Scheme::FourStep] {
        for (name, hair) in kinds() {
            let (record, _, calm) = hair.run(scheme, &teleported);
            // Few solves fail, and they are recorded. 0.3 s later hair is no faster than in free fall.
            assert!(record.unconverged <= 15, "{name}, {scheme:?}: {}", record.unconverged);
            assert!(calm < 4.0, "{name}, {scheme:?}: {calm} m/s");
        }
    }
}
