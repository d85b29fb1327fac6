//! Statics of the rod against theory: the cantilever under its own weight.

use hairbake::rod::newton::Solver;
use hairbake::rod::potential::{Load, PointLoad};
use hairbake::rod::{Rod, RodShape, RodSource, SegmentSize};
use nalgebra::Vector3;

/// Tip (reach, drop) in lengths of the heavy elastica at Γ = ρSgL³/EI: θ'' = −Γ(1 − s) cos θ, θ(0) = 0, θ'(1)
/// = 0.
const ELASTICA: [(f64, f64, f64); 5] = [
    (0.1, 0.999911, 0.012498),
    (1.0, 0.991246, 0.123471),
    (10.0, 0.656354, 0.700200),
    (100.0, 0.159223, 0.937524),
    (1000.0, 0.045986, 0.981141),
];

fn cantilever(gamma: f64, nodes: usize, grading: f64) -> (f64, f64) {
    let (l, ei, g) = (0.25, 7.8e-9, 9.81);
    let arc: Vec<f64> = (0..nodes).map(|i| (i as f64 / (nodes - 1) as f64).powf(grading)).collect();
    let rod = Rod::new(&RodSource {
        stiffness: [ei, ei, 3.6e-9],
        line_density: gamma * ei / (g * l * l * l),
        segment_size: SegmentSize::COARSE,
        ..RodSource::hair(&[Vector3::zeros(), Vector3::x() * l], &arc)
    })
    .unwrap();
    let n = rod.points();
    let mut q = vec![0.0; rod.unknowns()];
    let mut solver = Solver::default();
    // From straight in a few steps. A step of 1000 s is quasi-static.
    for h in [0.1, 0.1, 0.1, 1000.0, 1000.0] {
        let mut at = RodShape::default();
        at.update(&rod, &rod.root.r, &q);
        let x: Vec<_> = (0..n).map(|k| at.x(k)).collect();
        let points = x.iter().map(|x| PointLoad {
            inertial: *x,
            previous: *x,
            air: Vector3::zeros(),
            tangent: Vector3::x(),
            drag: 0.0,
        });
        let (mut load, start) = (Load::default(), q.clone());
        load.set(&rod, h, &(Vector3::y() * -g), &start, points);
        let outcome = solver.minimise(&rod, &rod.root.r, &load, &mut q, &start);
        assert!(outcome.converged, "Γ = {gamma}, {nodes} nodes, h = {h}: {outcome:?}");
    }
    let tip = solver.shape.x(n - 1) / l;
    (tip.x, -tip.y)
}

/// Error of the tip, in lengths.
fn error(gamma: f64, nodes: usize, grading: f64) -> f64 {
    let (_, reach, drop) = *ELASTICA.iter().find(|e| e.0 == gamma).unwrap();
    let (x, y) = cantilever(gamma, nodes, grading);
    (x - reach).hypot(y - drop)
}

#[test]
fn cantilever_with_eight_nodes_matches_the_elastica() {
    for gamma in [0.1, 1.0, 10.0, 100.0] {
        let e = error(gamma, 8, 1.5);
        assert!(e < 1e-4, "Γ = {gamma}: {e:.2e}");
    }
    // A boundary layer of L/√Γ at the clamp, thinner than the first element.
    let e = error(1000.0, 8, 1.5);
    assert!(e < 1e-3, "Γ = 1000: {e:.2e}");
}

#[test]
fn refinement_is_of_fourth_order() {
    // Uniform refinement from 8 to 16 elements.
    let ratio = error(100.0, 9, 1.0) / error(100.0, 17, 1.0);
    assert!(ratio > 12.0, "{ratio}");
}
