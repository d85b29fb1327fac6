//! A small cache with all parts and distinct values.

use hairbake::cache::{ClosestGuides, ColliderFrame, ColliderMesh, CurveFrame, CurveSet, Frame, Header};

/// 40 curves of 2 to 5 points, 18 guides, two colliders, the second of which deforms.
pub fn header(hair: bool) -> Header {
    Header {
        metres_per_unit: 0.01,
        z_up: false,
        fps: 24.0,
        frames: (1001, 1003),
        hair: hair.then(|| curves(40, 0)),
        guides: curves(18, 1),
        colliders: vec![
            tetrahedron("head", 1.0),
            ColliderMesh {
                deforms: true,
                is_skin: true,
                caps: vec![[3, 1, 0], [3, 2, 1]],
                ..tetrahedron("shoulder_L", 2.0)
            },
        ],
        levels: hair,
        accelerations: hair,
        ..Header::default()
    }
}

/// A frame of a header: everything moves linearly from the rest shape.
pub fn frame(header: &Header, frame: i32) -> Frame {
    let time = frame as f32 * 0.125;
    let moved = |curves: &CurveSet| {
        let points: Vec<[f32; 3]> = curves.rest.iter().map(|p| [p[0] + time, p[1] - time, p[2]]).collect();
        let velocity = [0.125 * header.fps as f32, -0.125 * header.fps as f32, 0.0];
        let extent = [0, 1].map(|end| {
            std::array::from_fn(|axis| {
                let axis_values = points.iter().zip(&curves.widths).map(|(p, width)| match end {
                    0 => p[axis] - 0.5 * width,
                    _ => -(p[axis] + 0.5 * width),
                });
                let lowest = axis_values.fold(f32::INFINITY, f32::min);
                if end == 0 { lowest } else { -lowest }
            })
        });
        let level = header.levels.then(|| (0..curves.counts.len() as i32).map(|i| i % 3).collect());
        let accelerations = header.accelerations.then(|| vec![[0.0, -9.81, time]; points.len()]);
        CurveFrame {
            velocities: vec![velocity; points.len()],
            points,
            accelerations,
            extent,
            level,
            ..CurveFrame::default()
        }
    };
    // A quarter turn about z and a translation: not its own transpose.
    let turned = |x: f64| {
        [[0.0, -1.0, 0.0, x], [1.0, 0.0, 0.0, 0.1], [0.0, 0.0, 1.0, f64::from(frame)], [0.0, 0.0, 0.0, 1.0]]
    };
    Frame {
        frame,
        offset: 0.0,
        hair: header.hair.as_ref().map(moved),
        guides: moved(&header.guides),
        head: turned(1.0 / 3.0),
        colliders: (header.colliders.iter().zip(0..))
            .map(|(mesh, i)| ColliderFrame {
                transform: turned(f64::from(i)),
                points: mesh.deforms.then(|| mesh.points.iter().map(|p| [p[0] * time, p[1], p[2]]).collect()),
            })
            .collect(),
    }
}

fn curves(count: i32, guide: i32) -> CurveSet {
    let counts: Vec<i32> = (0..count).map(|c| 2 + c % 4).collect();
    let total: i32 = counts.iter().sum();
    CurveSet {
        rest: (0..total).map(|i| [i as f32 * 0.1, (i % 7) as f32, -(i as f32) / 3.0]).collect(),
        arc: (0..if guide == 1 { total } else { 0 }).map(|i| i as f32 * 0.125).collect(),
        widths: (0..total).map(|i| 0.01 + i as f32 * 1e-5).collect(),
        id: (0..count).map(|c| 1000 * (guide + 1) + 7 * c).collect(),
        group: (0..count).map(|c| c / 10).collect(),
        guide: vec![guide; count as usize],
        group_name: (0..count).map(|c| ["fringe", "the back"][c as usize % 2].into()).collect(),
        root_uv: (0..count).map(|c| [c as f32 / 64.0, 1.0 - c as f32 / 50.0]).collect(),
        loose: (0..count).map(|c| c % 2).collect(),
        closest: ClosestGuides {
            guides: (0..if guide == 0 { 3 * count } else { 0 }).map(|i| 2000 + 7 * (i % 18)).collect(),
            weights: (0..if guide == 0 { 3 * count } else { 0 })
                .map(|i| [0.5, 0.25, 0.25][i as usize % 3])
                .collect(),
        },
        counts,
    }
}

fn tetrahedron(name: &str, size: f32) -> ColliderMesh {
    ColliderMesh {
        name: name.into(),
        points: vec![[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        caps: Vec::new(),
        deforms: false,
        is_skin: false,
        is_plane: false,
    }
}
