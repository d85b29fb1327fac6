use super::*;
use crate::contact::Body;
use crate::geometry::{Deformation, Shape, TriMesh};
use std::sync::Arc;

/// The clearance of a polyline among bodies at the origin.
fn clearance(bodies: &Bodies, x: &[Vector3<f64>]) -> Clearance {
    let poses = &[Isometry3::identity()];
    Clearance::new(&GroomPose { bodies, t: 0.0, poses, thickness: &[5e-4], x, rooted: true })
}

/// A clockwise triangle of the xy plane, extruded along z from −`half` to `half`.
fn prism(corners: [[f64; 2]; 3], half: f64) -> TriMesh {
    let side = |z: f64| corners.map(|[x, y]| Vector3::new(x, y, z));
    let vertices = [side(half), side(-half)].concat();
    let walls = [0, 1, 2].map(|i: u32| [i, (i + 1) % 3]).map(|[a, b]| [[a, b, a + 3], [b, b + 3, a + 3]]);
    let triangles = [walls.concat(), vec![[0, 2, 1], [3, 4, 5]]].concat();
    TriMesh { vertices, triangles }
}

#[test]
fn a_segment_drawn_through_a_body_is_exempt_and_its_ends_keep_their_side() {
    let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.01 };
    let bodies = Bodies::from_shapes(&[ball]);
    let at = |x: f64| Vector3::new(x, 0.0, 0.0);
    // From inside, out, back through, out to 0.2 mm and on.
    let x = [at(0.005), at(0.02), at(-0.0102), at(-0.03), at(-0.04)];
    let clearance = clearance(&bodies, &x);
    let mut kept = Vec::new();
    clearance.at(1.0, &mut kept);
    assert_eq!(kept[..2], [EXEMPT; 2]);
    // The drawn distance along the adjacent segments.
    assert!(kept[2].iter().all(|d| (d - 1e-4).abs() < 1e-12), "{kept:?}");
    assert_eq!(kept[3], [kept[2][1], 5e-4]);
    assert_eq!(clearance.counts(), (2, 0));
    // The next segment holds the end of the exempt one.
    let mut pushed = x;
    pushed[2] = at(-0.0099);
    let line = MovingPolyline { x0: &x, x1: &pushed, clearance: &kept, by_part: false };
    let found = static_contacts(&bodies, 0.0, &[Isometry3::identity()], &[5e-4], &line);
    assert!(found.iter().any(|c| (c.segment, c.u) == (2, 0.0) && c.gap < 0.0), "{found:?}");
}

#[test]
fn held_segments_meet_no_body_and_are_not_counted() {
    let plane = || Shape::Plane { point: Vector3::zeros(), normal: Vector3::y() };
    let bodies = Bodies::from_shapes(&[plane(), plane()]);
    let x: Vec<_> = (0..6).map(|k| Vector3::new(0.01 * f64::from(k), 0.002, 0.0)).collect();
    let poses = &[Isometry3::identity(); 2];
    let mut clearance = Clearance::new(&GroomPose {
        bodies: &bodies,
        t: 0.0,
        poses,
        thickness: &[5e-4; 2],
        x: &x,
        rooted: true,
    });
    clearance.hold(2);
    let mut kept = Vec::new();
    clearance.at(1.0, &mut kept);
    let of_body = [EXEMPT, EXEMPT, [5e-4; 2], [5e-4; 2], [5e-4; 2]];
    assert_eq!(kept, [of_body, of_body].concat());
    assert_eq!(clearance.counts(), (0, 0));
    assert_eq!(clearance.by_body().collect::<Vec<_>>(), [[0, 3]; 2]);
}

#[test]
fn a_chord_that_cuts_the_surface_is_pushed_out() {
    let bodies = Bodies::from_shapes(&[Shape::Sphere { centre: Vector3::zeros(), radius: 0.1 }]);
    let x = [-0.02, 0.0, 0.005].map(|s: f64| Vector3::new((s / 0.1).sin(), (s / 0.1).cos(), 0.0) * 0.1002);
    let depth = 0.1 - 0.5 * (x[0] + x[1]).norm();
    assert!(depth > 1e-4);
    let clearance = clearance(&bodies, &x);
    // Not exempt, and pushed out.
    assert_eq!(clearance.counts(), (0, 1));
    let mut kept = Vec::new();
    clearance.at(0.0, &mut kept);
    assert!(kept[0].iter().all(|d| (d + depth).abs() < 1e-5), "{kept:?} {depth}");
    clearance.at(1.0, &mut kept);
    assert!(kept[0].iter().all(|d| (8e-5..1e-4).contains(d)), "{kept:?}");
}

#[test]
fn a_clipped_edge_is_pushed_out_and_a_crossed_sheet_is_exempt() {
    // A ridge along z, and a thin sheet in the plane x = 0 with two sides.
    let [wide, thin] = [0.05, 1e-4].map(|w| prism([[0.0, 0.0], [w, -0.1], [-w, -0.1]], 0.1));
    let counts = |mesh: TriMesh, height: f64| {
        let bodies = Bodies::from_shapes(&[Shape::Mesh(mesh)]);
        let x = [-0.02, -0.002, 0.002, 0.02].map(|x| Vector3::new(x, height, 1e-3));
        clearance(&bodies, &x).counts()
    };
    assert_eq!(counts(wide.clone(), -3e-4), (0, 1));
    assert_eq!(counts(wide, -2e-3), (1, 0));
    assert_eq!(counts(thin, -0.03), (1, 0));
}

#[test]
fn a_run_through_a_body_is_exempt_and_a_dip_into_it_is_pushed_out() {
    // A slab 8 mm thick, its upper face at the height 0.
    let half = Vector3::new(0.1, 0.004, 0.1);
    let corner = |i: usize| Vector3::from_fn(|k, _| if i >> k & 1 == 1 { half[k] } else { -half[k] });
    let vertices = (0..8).map(|i| corner(i) - Vector3::y() * half.y).collect();
    let triangles = [[0, 3, 1], [0, 2, 3], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]];
    let more = [[2, 7, 3], [2, 6, 7], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]];
    let triangles = [triangles, more].concat();
    let bodies = Bodies::from_shapes(&[Shape::Mesh(TriMesh { vertices, triangles })]);
    let kept = |heights: [f64; 7]| {
        let x: Vec<_> =
            heights.iter().enumerate().map(|(k, h)| Vector3::new(0.003 * k as f64, *h, 0.0)).collect();
        let clearance = clearance(&bodies, &x);
        let mut kept = Vec::new();
        clearance.at(1.0, &mut kept);
        kept.iter().map(|ends| *ends == EXEMPT).collect::<Vec<_>>()
    };
    let through = kept([0.004, 0.001, -0.002, -0.003, -0.006, -0.009, -0.012]);
    assert_eq!(through, [false, true, true, true, true, false]);
    let dips = kept([0.004, 0.001, -0.002, -0.003, -0.002, 0.001, 0.004]);
    assert_eq!(dips, [false; 6]);
}

#[test]
fn a_point_that_starts_inside_is_pushed_out_or_becomes_exempt() {
    let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.01 };
    let bodies = Bodies::from_shapes(std::slice::from_ref(&ball));
    let x = [0.03, 0.015, 0.008, 0.015, 0.03].map(|y| Vector3::new(0.0, y, 0.0));
    let clearance = clearance(&bodies, &x);
    let mut kept = Vec::new();
    clearance.at(0.5, &mut kept);
    assert_eq!(kept[0], [5e-4; 2]);
    assert!((kept[1][1] - 0.5 * (5e-4 - 2e-3)).abs() < 1e-12, "{kept:?}");
    assert_eq!(kept[1][1], kept[2][0]);
    assert_eq!(clearance.counts(), (0, 2));
    let arrive = |bodies: &Bodies, beside: f64| {
        let (mut arrived, mut kept) = (clearance.clone(), Vec::new());
        let moved = x.map(|p| p + Vector3::x() * beside);
        let closed_on = arrived.end_push_out(bodies, 0.0, &[Isometry3::identity()], &moved);
        arrived.at(1.0, &mut kept);
        (closed_on, kept)
    };
    let free = vec![[5e-4; 2]; 4];
    assert_eq!(arrive(&bodies, 0.0), (false, vec![[5e-4; 2], EXEMPT, EXEMPT, [5e-4; 2]]));
    // Outside the ball, but nearer than its clearance.
    assert_eq!(arrive(&bodies, 0.0101), (false, free.clone()));
    // A ball that deforms has closed on what is inside it.
    let mesh = ball.tessellate();
    let samples = vec![mesh.vertices.clone(); 2];
    let deformation = Arc::new(Deformation { start: 0.0, rate: 1.0, samples });
    let bodies = Bodies::new([Body::new(&Shape::Mesh(mesh), Some(&deformation), None)]);
    assert_eq!(arrive(&bodies, 0.0), (true, free.clone()));
    assert_eq!(arrive(&bodies, 0.0101), (false, free));
}

#[test]
fn a_strand_drawn_flat_in_the_surface_rises_with_limited_slope() {
    let ball = Shape::Sphere { centre: Vector3::zeros(), radius: 0.1 };
    let bodies = Bodies::from_shapes(&[ball]);
    // From just outside, along the surface 0.01 mm inside it, and out.
    let x = [(0.0, 1e-6), (1e-4, -1e-5), (4e-4, -1e-5), (5e-3, -1e-5), (2e-2, 2e-3)]
        .map(|(s, g): (f64, f64)| Vector3::new((s / 0.1).sin(), (s / 0.1).cos(), 0.0) * (0.1 + g));
    let clearance = clearance(&bodies, &x);
    let mut kept = Vec::new();
    clearance.at(1.0, &mut kept);
    for (ends, goal) in kept[1..].iter().zip([0.25e-4, 1e-4, 5e-4]) {
        assert!((ends[0] - goal).abs() < 0.03 * goal, "{kept:?}");
    }
}
