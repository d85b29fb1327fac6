//! Fur on shapes for which density, direction and distance are known.

use super::convert::grow;
use super::flow::{directions, distances};
use super::options::{Direction, FurShape, GrowOptions, StrandCount};
use super::scatter::{blue_noise, stratified};
use super::surface::Surface;
use crate::Error;
use crate::geometry::{Shape, TriMesh};
use crate::import::Source;
use crate::math::polyline;
use crate::scene::Curves;
use nalgebra::Vector3;
use std::f64::consts::PI;
use tempfile::TempDir;

type V = Vector3<f64>;

const RADIUS: f64 = 0.3;

fn sphere() -> TriMesh {
    Shape::Sphere { centre: V::zeros(), radius: RADIUS }.tessellate()
}

/// A tube of radius 10 cm along z, from −0.5 to 0.5 m, with round ends.
fn tube() -> TriMesh {
    const SIDES: u32 = 36;
    let end = |k: i32, z: f64| {
        let (sin, cos) = (f64::from(k) * PI / 24.0).sin_cos();
        [0.1 * sin + z, 0.1 * cos]
    };
    let profile: Vec<[f64; 2]> = (-11..=0)
        .map(|k| end(k, -0.5))
        .chain((1..20).map(|k| [0.05 * f64::from(k) - 0.5, 0.1]))
        .chain((0..=11).map(|k| end(k, 0.5)))
        .collect();
    let rings = profile.len() as u32;
    let ring = |[z, radius]: [f64; 2]| {
        (0..SIDES).map(move |side| {
            let (sin, cos) = (f64::from(side) * 2.0 * PI / f64::from(SIDES)).sin_cos();
            V::new(radius * cos, radius * sin, z)
        })
    };
    let corner = |k: u32, side: u32| k * SIDES + side % SIDES;
    let mut mesh = TriMesh {
        vertices: profile.into_iter().flat_map(ring).chain([-0.6, 0.6].map(|z| V::z() * z)).collect(),
        triangles: Vec::new(),
    };
    for side in 0..SIDES {
        for k in 0..rings - 1 {
            let [a, b] = [corner(k, side), corner(k, side + 1)];
            let [c, d] = [corner(k + 1, side + 1), corner(k + 1, side)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        let poles = [rings * SIDES, rings * SIDES + 1];
        mesh.triangles.push([poles[0], corner(0, side + 1), corner(0, side)]);
        mesh.triangles.push([poles[1], corner(rings - 1, side), corner(rings - 1, side + 1)]);
    }
    mesh
}

/// A file with the mesh, and options to grow little on it.
fn scene(text: &str) -> (TempDir, GrowOptions) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.obj");
    std::fs::write(&path, text).unwrap();
    let source = Source { metres_per_unit: Some(1.0), ..Source::new(path) };
    let options = GrowOptions { guides: 60, strands: StrandCount::Number(900), ..GrowOptions::new(source) };
    (folder, options)
}

fn areas(surface: &Surface) -> Vec<f64> {
    (0..surface.triangles as u32).map(|t| 0.5 * surface.doubled_area(t).norm()).collect()
}

#[test]
fn roots_are_as_dense_everywhere_on_a_sphere() {
    let surface = Surface::new(&sphere());
    // Triangles are small at the poles, which are those of y.
    for places in
        [stratified(&surface, &areas(&surface), 8000, 5), blue_noise(&surface, &areas(&surface), 2000, 5)]
    {
        let count = |of: &dyn Fn(&V) -> bool| {
            places.iter().filter(|place| of(&surface.point(place))).count() as f64 / places.len() as f64
        };
        // A cap of height h has the share h / 2R of the area (Archimedes).
        for height in [0.1, 0.5, 1.0, 1.5] {
            let share = count(&|x| x.y > RADIUS * (1.0 - height));
            assert!((share - height / 2.0).abs() < 0.01, "{share} within {height}");
        }
        for axis in 0..3 {
            assert!((count(&|x| x[axis] > 0.0) - 0.5).abs() < 0.01);
        }
    }
}

#[test]
fn guides_keep_their_distance() {
    let surface = Surface::new(&sphere());
    let count = 600;
    let places = blue_noise(&surface, &areas(&surface), count, 1);
    let points: Vec<V> = places.iter().map(|place| surface.point(place)).collect();
    let nearest = |i: usize| {
        (0..count).filter(|j| *j != i).map(|j| (points[i] - points[j]).norm()).fold(f64::INFINITY, f64::min)
    };
    // The distance in the densest packing of so many discs. Random points come within 0.05 of it.
    let packed = (4.0 * PI * RADIUS * RADIUS * 2.0 / (3f64.sqrt() * count as f64)).sqrt();
    let least = (0..count).map(nearest).fold(f64::INFINITY, f64::min);
    assert!((0.6..1.0).contains(&(least / packed)), "{}", least / packed);
}

#[test]
fn distances_along_a_sphere_are_arcs() {
    let surface = Surface::new(&sphere());
    let points = surface.vertices();
    let start = (0..points.len()).max_by(|a, b| points[*a].z.total_cmp(&points[*b].z)).unwrap();
    let cell = RADIUS * PI / 48.0;
    for (x, distance) in points.iter().zip(distances(&surface, &[start as u32])) {
        let arc = RADIUS * x.angle(&points[start]);
        // The method is of first order in the side of a cell.
        assert!((distance - arc).abs() < 1.5 * cell, "{distance} for {arc}");
    }
}

#[test]
fn fur_lies_along_a_tube_and_a_plane() {
    let shape = FurShape { gravity: 0.0, ..FurShape::default() };
    let surface = Surface::new(&tube());
    let middle = |directions: &[V], expected: &dyn Fn(&V) -> V| {
        let mut seen = 0;
        for (x, along) in surface.vertices().iter().zip(directions).filter(|(x, _)| x.z.abs() < 0.4) {
            assert!(along.angle(&expected(x)) < 0.02, "{along} at {x}");
            seen += 1;
        }
        assert!(seen > 100);
    };
    // Away from the end with the greatest z.
    middle(&directions(&surface, &shape, None), &|_| -V::z());
    // Around the tube, and along the vector from there.
    let along = FurShape { direction: Direction::Vector(V::new(0.0, 0.0, 2.0)), ..shape.clone() };
    middle(&directions(&surface, &along, None), &|_| V::z());

    let plane = Shape::Plane { point: V::zeros(), normal: V::new(0.0, 0.6, 0.8) }.tessellate();
    let plane = Surface::new(&plane);
    let slanted = FurShape { direction: Direction::Vector(V::new(1.0, 0.6, 0.8)), ..shape.clone() };
    for found in directions(&plane, &slanted, None) {
        assert!((found - V::x()).norm() < 1e-9, "{found}");
    }
    // Weight alone pulls down the slope.
    let still = FurShape { direction: Direction::Vector(V::new(0.0, 0.6, 0.8)), gravity: 0.5, ..shape };
    for found in directions(&plane, &still, None) {
        assert!((found - V::new(0.0, -0.8, 0.6)).norm() < 1e-9, "{found}");
    }
}

/// The angles between the first segment of each curve and a plane with the normal `y`.
fn leans(curves: &Curves) -> Vec<f64> {
    let lean = |c: usize| {
        let edge = curves.curve(c)[1] - curves.curve(c)[0];
        (edge.y / edge.norm()).asin()
    };
    (0..curves.len()).map(lean).collect()
}

#[test]
fn strands_rise_by_the_lift_and_are_as_long_as_asked() {
    let plane = Shape::Plane { point: V::zeros(), normal: V::y() }.tessellate();
    let (_folder, mut options) = scene(&plane.to_obj(6));
    options.clumps.iter_mut().for_each(|clumps| clumps.strength = 0.0);
    options.shape = FurShape {
        length: Some(0.05),
        length_variation: 0.0,
        frizz: 0.0,
        direction: Direction::Vector(V::x()),
        ..FurShape::default()
    };
    let (groom, report) = grow(&options).unwrap();
    let curves = &groom.guides.curves;
    let mean = leans(curves).iter().sum::<f64>() / 60.0;
    assert!((mean - options.shape.lift).abs() < 0.05, "{mean}");
    // It bends down to the share that is left at the tip.
    let tips = (0..60).map(|c| curves.curve(c)[7].y).sum::<f64>() / 60.0;
    assert!((0.4..0.85).contains(&(tips / (0.05 * options.shape.lift.sin()))), "{tips}");
    assert!(report.length.iter().all(|length| (length - 0.05).abs() < 1e-9), "{:?}", report.length);
    assert_eq!((groom.guides.curves.len(), groom.strands.curves.len()), (60, 900));
    options.shape.direction = Direction::Normal;
    let (upright, _) = grow(&options).unwrap();
    assert!(leans(&upright.strands.curves).iter().all(|lean| (lean - PI / 2.0).abs() < 1e-6));
}

#[test]
fn fur_stays_outside_where_the_mesh_is_hollow() {
    // A bowl: a sphere whose lower half is pushed in.
    let mut bowl = sphere();
    bowl.vertices.iter_mut().for_each(|x| x.y = if x.y > 0.0 { -0.7 * x.y } else { x.y });
    let (_folder, mut options) = scene(&bowl.to_obj(6));
    options.shape.length = Some(0.1);
    options.shape.curl = [0.1, 2.0];
    let (groom, report) = grow(&options).unwrap();
    assert!(report.inside.0 < 1e-4, "{} m deep", report.inside.0);
    assert!(groom.strands.curves.points.iter().all(|x| x.iter().all(|x| x.is_finite())));
    let strand = groom.strands.curves.curve(0);
    assert!(strand.len() > 20, "curls need {} vertices", strand.len());
}

#[test]
fn the_number_of_threads_does_not_matter_and_the_seed_does() {
    let (_folder, options) = scene(&tube().to_obj(6));
    let grown = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| grow(&GrowOptions { seed, ..options.clone() }).unwrap().0)
    };
    assert!(grown(1, 3) == grown(3, 3));
    assert!(grown(1, 3).strands.curves.points != grown(1, 4).strands.curves.points);
}

/// A square of side 1 m in two parts, with texture coordinates and vertex colours whose red is x and whose
/// green is -z.
const SQUARE: &str = "\
v 0 0 0 0 0 1
v 1 0 0 1 0 1
v 1 0 -1 1 1 1
v 0 0 -1 0 1 1
vt 0 0
vt 0 1
vt 1 1
vt 1 0
g right
f 1/1 2/2 3/3
g left
f 1/1 3/3 4/4
";

#[test]
fn density_length_direction_and_parts_are_painted() {
    let (_folder, mut options) = scene(SQUARE);
    options.strands = StrandCount::PerArea(2000.0);
    options.shape.gravity = 0.0;
    options.clumps.iter_mut().for_each(|clumps| clumps.strength = 0.0);
    options.shape.direction = Direction::Texture { axis: 1, falls: false };
    let all = grow(&options).unwrap().0;
    assert_eq!(all.strands.curves.len(), 2000);
    let off = |c: usize| {
        let strand = all.strands.curves.curve(c);
        (strand[7] - strand[0]).component_mul(&V::new(1.0, 0.0, 1.0)).angle(&V::x())
    };
    let mean = (0..2000).map(off).sum::<f64>() / 2000.0;
    assert!(mean < 0.3, "{mean}");
    assert!(
        all.strands.curves.root_uv.iter().zip(all.strands.curves.roots()).all(|(uv, x)| {
            (f64::from(uv[1]) - x.x).abs() < 1e-6 && (f64::from(uv[0]) + x.z).abs() < 1e-6
        })
    );

    options.density_field = Some("color".into());
    options.shape.length_field = Some("color".into());
    let painted = grow(&options).unwrap().0;
    // The mean of the density is half.
    assert_eq!(painted.strands.curves.len(), 1000);
    let right = painted.strands.curves.roots().filter(|x| x.x + x.z > 0.0).count();
    // Of x, two thirds are on the right triangle.
    assert!(right.abs_diff(667) < 5, "{right}");
    options.density_field = Some("color.g".into());
    let painted = grow(&options).unwrap().0;
    let right = painted.strands.curves.roots().filter(|x| x.x + x.z > 0.0).count();
    assert!(right.abs_diff(333) < 5, "{right}");
    let shortest = (0..1000).map(|c| polyline::length(painted.strands.curves.curve(c))).fold(1.0, f64::min);
    assert!((0.9e-3..2e-3).contains(&shortest), "{shortest} m");
    options.density_field = Some("color".into());
    options.parts = vec!["left".into()];
    let left = grow(&options).unwrap().0;
    assert!(left.guides.curves.roots().chain(left.strands.curves.roots()).all(|x| x.x + x.z < 1e-9));
}

#[test]
fn everything_that_is_wrong_is_told_at_once() {
    let messages = |options: &GrowOptions| match grow(options) {
        Err(Error::BadInput(found)) => {
            let words = found.iter().map(|d| format!("{}: {} ({})", d.key, d.message, d.allowed));
            words.collect::<Vec<_>>().join("\n")
        }
        other => panic!("{:?}", other.map(|_| ())),
    };
    let (_folder, good) = scene(SQUARE);
    let mut options = good.clone();
    options.parts = vec!["back".into()];
    options.density_field = Some("fur".into());
    options.shape.length_field = Some("uv.b".into());
    options.shape.direction = Direction::Field("uv".into());
    options.shape.length = Some(20.0);
    let found = messages(&options);
    for expected in [
        "--on: no part is named back (a part of the mesh: right, left)",
        "--density-map: the mesh has no fur (one of uv, color)",
        "--length-map: uv has two numbers at a place (three numbers)",
        "--direction: uv has two numbers at a place (three numbers)",
        "--length: 20000.000 mm of fur on a mesh of 1414.214 mm",
    ] {
        assert!(found.contains(expected), "{found}");
    }
    assert_eq!(found.lines().count(), 5, "{found}");
    let dense = GrowOptions { strands: StrandCount::PerArea(1e9), ..good.clone() };
    assert!(messages(&dense).contains("1000000000 strands on 1.000 m²"));
    assert!(matches!(grow(&GrowOptions { guides: 0, ..good }), Err(Error::Usage(_))));

    for (text, expected) in [
        ("v 0 0 0\nv 1 0 0\n", "has no triangles"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "all 1 are degenerate"),
        ("v 0 0 nan\nv 1 0 0\nv 1 0 1\nf 1 2 3\n", "not finite"),
    ] {
        let (_folder, options) = scene(text);
        assert!(messages(&options).contains(expected), "{text}");
    }
    let painted = |red: &str| SQUARE.replace("v 1 0 0 1", &format!("v 1 0 0 {red}"));
    for (red, expected) in
        [("nan", "color is not finite"), ("1.5", "color is 0 to 1.5"), ("-1", "color is -1 to 1")]
    {
        let (_folder, options) = scene(&painted(red));
        let options = GrowOptions { density_field: Some("color".into()), ..options };
        assert!(messages(&options).contains(expected), "{red}");
    }
    let bald = SQUARE.replace("v 1 0 0 1", "v 1 0 0 0").replace("v 1 0 -1 1", "v 1 0 -1 0");
    let (_folder, options) = scene(&bald);
    let options = GrowOptions { density_field: Some("color".into()), ..options };
    assert!(messages(&options).contains("no part of the mesh bears fur"));
}

#[test]
fn fur_of_a_small_animal_is_as_smooth_as_that_of_a_large_one() {
    // Mean over all strands of the largest turn between two segments, rad.
    let turn = |metres_per_unit: f64| {
        let (_folder, mut options) = scene(SQUARE);
        options.mesh.metres_per_unit = Some(metres_per_unit);
        let curves = grow(&options).unwrap().0.strands.curves;
        let largest = |c: usize| {
            let x = curves.curve(c);
            x.windows(3).map(|x| (x[1] - x[0]).angle(&(x[2] - x[1]))).fold(0.0, f64::max)
        };
        (0..curves.len()).map(largest).sum::<f64>() / curves.len() as f64
    };
    let [small, large] = [0.05, 1.0].map(turn);
    assert!(large > 0.02 && (small / large - 1.0).abs() < 0.2, "{small} {large}");
}

#[test]
fn clumps_keep_the_length_of_strands() {
    let (_folder, mut options) = scene(SQUARE);
    options.shape.length = Some(0.06);
    (options.shape.length_variation, options.shape.frizz) = (0.0, 0.0);
    options.clumps.iter_mut().for_each(|clumps| clumps.strength = 0.9);
    let curves = grow(&options).unwrap().0.strands.curves;
    // What enters the skin is lifted out.
    let off = |c: usize| (polyline::length(curves.curve(c)) / 0.06 - 1.0).abs();
    let off: Vec<f64> = (0..curves.len()).map(off).collect();
    assert!(off.iter().all(|off| *off < 0.05), "{:?}", off.iter().copied().fold(0.0, f64::max));
    assert!(off.iter().sum::<f64>() < 1e-3 * off.len() as f64, "{}", off.iter().sum::<f64>());
}
