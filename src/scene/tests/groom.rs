use super::super::*;
use super::file;
use crate::math::basis_curve::{Basis, CurveType, Wrap};
use approx::assert_relative_eq;
use nalgebra::{Matrix4, UnitQuaternion, Vector3};

const MINIMAL: &str = r#"{
  "format": "hairbake-groom",
  "version": 1,
  "guides": { "points": [[0, 0, 0], [0, -0.1, 0], [0, -0.25, 0]] }
}"#;

#[test]
fn the_minimal_file_is_a_groom_of_one_guide() {
    let (_folder, path) = file("one.json", MINIMAL);
    let groom = load_groom(&path).unwrap();
    assert_eq!(groom.name, "one");
    assert_eq!(groom.materials, [Material::default()]);
    assert_eq!(groom.guides.curves.offsets, [0, 3]);
    assert_eq!(groom.guides.curves.id, [0]);
    assert!(groom.trees.is_empty() && groom.strands.curves.is_empty());

    let groom = groom.with_default_trees(5);
    let wisp = &groom.trees[0].wisps[0];
    assert_relative_eq!(wisp.length, 0.25, epsilon = 1e-12);
    assert_eq!(wisp.guides, [0]);
    assert_eq!(groom.trees[0].arc, Tree::default_arc(5));
    assert_relative_eq!(wisp.sections[4].centre, Vector3::new(0.0, -0.25, 0.0), epsilon = 1e-12);
    for section in &wisp.sections {
        assert_relative_eq!(section.frame * Vector3::z(), -Vector3::y(), epsilon = 1e-12);
    }
}

#[test]
fn default_arc_runs_from_0_to_1_and_is_densest_at_the_root() {
    for nodes in [2, 3, 8, 64] {
        let arc = Tree::default_arc(nodes);
        assert_eq!((arc.len(), arc[0], arc[nodes - 1]), (nodes, 0.0, 1.0));
        let gaps: Vec<f64> = arc.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(gaps[0] > 0.0 && gaps.windows(2).all(|g| g[0] < g[1]));
    }
}

/// A groom of two trees with all optional keys set.
fn full(convention: Convention, curves: usize) -> Groom {
    let turn = |i: usize| UnitQuaternion::from_euler_angles(0.1 * i as f64, 0.3, -0.2 * i as f64);
    let points = |n: usize| -> Vec<Vector3<f64>> {
        (0..n).map(|i| Vector3::new(0.01 * i as f64, 0.2 - 0.003 * (i % 5) as f64, 0.02)).collect()
    };
    let curves_of = |n: usize, vertices: usize| Curves {
        offsets: (0..=n).map(|c| c * vertices).collect(),
        points: points(n * vertices),
        id: (0..n as i32).map(|c| 7 + 2 * c).collect(),
        group: (0..n as u32).map(|c| c % 2).collect(),
        root_uv: (0..n).map(|c| [c as f32 / 64.0, 0.5]).collect(),
        skin: Vec::new(),
    };
    let mut guides = curves_of(curves, 5);
    // One guide has fewer points.
    guides.points.pop();
    *guides.offsets.last_mut().unwrap() -= 1;
    let section = |i: usize| Section { centre: points(9)[i % 9], frame: turn(i), radius: 0.001 * i as f64 };
    let wisp = |parent, guides: Vec<u32>, sections| Wisp {
        parent,
        length: 0.21,
        strand_count: 40,
        sections: (0..sections).map(section).collect(),
        guides,
    };
    let others = (2..curves as u32).collect();
    Groom {
        name: "full".into(),
        notes: vec!["one strand left out".into(), "λ".into()],
        origin: Some(Origin {
            file: "../char.usd".into(),
            prim: Some("/char/hair".into()),
            time: Some(1.5),
            space: RestSpace::Bind,
        }),
        convention,
        materials: vec![
            Material { natural: Some(Vector3::new(1.0, -2.0, 3.0)), sag_free: 0.5, ..Material::default() },
            Material {
                name: "wool".into(),
                section: RodSection { a1: 3e-5, a2: 5e-5 },
                stiffness_at_tip: 0.5,
                radius_at_tip: 0.4,
                damping_at_tip: 3.0,
                friction_at_tip: 2.0,
                goal: [3.0, 0.5],
                goal_weight: 0.75,
                ..Material::default()
            },
        ],
        groups: vec![
            Group { name: "a".into(), material: 1, width: [1e-4, 5e-5] },
            Group { name: "b".into(), material: 0, width: [1e-4, 0.0] },
        ],
        guides: Guides {
            curves: guides,
            root_frame: Some((0..curves).map(turn).collect()),
            factors: Factors {
                stiffness: Some((0..curves).map(|g| 0.5 + g as f64).collect()),
                goal: Some(vec![2.0; curves]),
                goal_weight: Some(vec![0.5; curves]),
                ..Factors::default()
            },
        },
        trees: vec![
            Tree {
                arc: vec![0.0, 0.25, 1.0],
                wisps: vec![wisp(None, vec![], 3), wisp(Some(0), vec![1], 3), wisp(Some(0), vec![0], 3)],
            },
            Tree { arc: vec![0.0, 1.0], wisps: vec![wisp(None, others, 2)] },
        ],
        strands: Strands { curves: curves_of(4, 16), leaf: vec![(0, 2), (1, 0), (0, 1), (1, 0)] },
        source: Some(source(curves)),
    }
}

/// A source of `guides` guides and of four strands, in two prims.
fn source(guides: usize) -> SourceCurves {
    let prim = |path: &str, basis, curves| SourcePrim {
        path: path.into(),
        curve: CurveType { basis, wrap: Wrap::Pinned },
        curves,
        to_rest: Matrix4::new_translation(&Vector3::new(0.1, 1.0 / 3.0, -2.0)) * 0.01,
    };
    SourceCurves {
        origin: Origin { file: "../char.usd".into(), prim: None, time: None, space: RestSpace::World },
        prims: vec![prim("/char/hair", Basis::BSpline, 70), prim("/char/guides", Basis::Linear, 40)],
        vertices: (0..110).map(|curve| 4 + curve % 7).collect(),
        length: Some((0..110).map(|curve| 1.0 + 0.01 * f64::from(curve)).collect()),
        strands: vec![Some(69), None, Some(0), Some(7)],
        guides: (0..guides as u32).map(|guide| (guide % 2 == 0).then_some(70 + guide)).collect(),
    }
}

fn assert_same(a: &Groom, b: &Groom) {
    let close = |a: &Curves, b: &Curves, epsilon: f64| {
        assert_eq!((&a.offsets, &a.id, &a.group, &a.root_uv), (&b.offsets, &b.id, &b.group, &b.root_uv));
        for (p, q) in a.points.iter().zip(&b.points) {
            assert_relative_eq!(p, q, epsilon = epsilon);
        }
    };
    assert_eq!((&a.name, &a.convention, &a.materials), (&b.name, &b.convention, &b.materials));
    assert_eq!((&a.groups, &a.guides.factors), (&b.groups, &b.guides.factors));
    close(&a.guides.curves, &b.guides.curves, 1e-15);
    close(&a.strands.curves, &b.strands.curves, 1e-7);
    assert_eq!(a.strands.leaf, b.strands.leaf);
    assert_eq!(a.source, b.source);
    let frames = |g: &Groom| g.guides.root_frame.clone().unwrap();
    assert!(frames(a).iter().zip(frames(b)).all(|(p, q)| p.angle_to(&q) < 1e-7));
    assert_eq!(a.trees.len(), b.trees.len());
    for (s, t) in a.trees.iter().zip(&b.trees) {
        assert_eq!((&s.arc, s.wisps.len()), (&t.arc, t.wisps.len()));
        for (v, w) in s.wisps.iter().zip(&t.wisps) {
            assert_eq!((v.parent, v.strand_count, &v.guides), (w.parent, w.strand_count, &w.guides));
            assert_relative_eq!(v.length, w.length, epsilon = 1e-15);
            assert_eq!(v.sections.len(), w.sections.len());
            for (p, q) in v.sections.iter().zip(&w.sections) {
                assert_relative_eq!(p.centre, q.centre, epsilon = 1e-15);
                assert_relative_eq!(p.radius, q.radius, epsilon = 1e-15);
                assert_relative_eq!(p.frame.angle_to(&q.frame), 0.0, epsilon = 1e-7);
            }
        }
    }
}

#[test]
fn a_written_groom_loads_as_it_was() {
    for up in [UpAxis::Y, UpAxis::Z] {
        // The arrays of 4 guides stay in the JSON, those of 40 go to the buffer.
        for curves in [4, 40] {
            let groom = full(Convention { metres_per_unit: 0.01, up }, curves);
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("full.json");
            groom.write(&path).unwrap();
            assert_same(&groom, &load_groom(&path).unwrap());
            let names = std::fs::read_dir(folder.path()).unwrap().count();
            assert_eq!(names, 2, "only full.json and full.bin");
        }
    }
}

#[test]
fn a_source_that_does_not_fit_is_an_error() {
    let source = r#""source": { "origin": { "file": "a.usd" }, "vertices": [4, 5], "guides": [0],
      "prims": [{ "path": "/a", "basis": "bspline", "wrap": "pinned", "curves": 2,
        "to_rest_m": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }] }, "version": 1,"#;
    let right = MINIMAL.replace("\"version\": 1,", source);
    let errors = |text: &str| {
        let (_folder, path) = file("a.json", text);
        match load_groom(&path) {
            Err(crate::Error::BadInput(found)) => found.into_iter().map(|d| d.key).collect(),
            _ => Vec::new(),
        }
    };
    assert_eq!(errors(&right), [""; 0]);
    assert_eq!(errors(&right.replace("[4, 5]", "[4]")), ["source.vertices"]);
    assert_eq!(errors(&right.replace("\"guides\": [0]", "\"guides\": [2]")), ["source.guides[0]"]);
    assert_eq!(errors(&right.replace("\"guides\": [0]", "\"guides\": [0, -1]")), ["source.guides"]);
    assert_eq!(errors(&right.replace("pinned", "open")), ["source.prims[0].wrap"]);
}

#[test]
fn points_are_converted_to_metres_y_up() {
    let text = MINIMAL
        .replace("\"version\": 1,", "\"version\": 1, \"metres_per_unit\": 0.01, \"up_axis\": \"z\",")
        .replace("[0, -0.25, 0]", "[1, 2, 30]");
    let (_folder, path) = file("z.json", &text);
    let groom = load_groom(&path).unwrap();
    assert_relative_eq!(groom.guides.curves.points[2], Vector3::new(0.01, 0.3, -0.02), epsilon = 1e-15);
}

#[test]
fn default_trees_do_not_replace_trees() {
    let groom = full(Convention::default(), 4);
    assert_eq!(groom.clone().with_default_trees(9), groom);
}
