//! Views of a small synthetic shot, decoded as the page decodes them.

use super::codec::{Box16, Encoded, tests::decode};
use super::*;
use crate::cache::{ColliderFrame, ColliderMesh, CurveFrame, CurveSet};
use crate::report::preview::Memory;
use nalgebra::{Matrix4, Point3};
use std::f64::consts::FRAC_PI_2;
use std::io::Read;

const POINTS: usize = 8;

fn curves(n: usize) -> CurveSet {
    let place = |i: usize, k: usize| [0.002 * i as f32, 0.15 - 0.01 * k as f32, 0.02 * (i as f32).sin()];
    CurveSet {
        counts: vec![POINTS as i32; n],
        rest: (0..n * POINTS).map(|i| place(i / POINTS, i % POINTS)).collect(),
        widths: vec![1e-4; n * POINTS],
        id: (100..100 + n as i32).collect(),
        group: (0..n as i32).map(|i| i % 2).collect(),
        group_name: (0..n).map(|i| ["fringe", "back"][i % 2].to_string()).collect(),
        guide: vec![0; n],
        root_uv: vec![[0.0; 2]; n],
        ..CurveSet::default()
    }
}

/// Strands and guides that swing on a head that turns and walks, before a wall at z = -0.05.
fn shot(strands: usize, guides: usize, frames: usize) -> Memory {
    let (hair, guides) = ((strands > 0).then(|| curves(strands)), curves(guides));
    let frame = |f: usize| {
        let (s, c) = (0.1 * f as f64).sin_cos();
        let head =
            [[c, 0.0, s, 0.3 * f as f64], [0.0, 1.0, 0.0, 1.5], [-s, 0.0, c, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let moved = |set: &CurveSet| {
            let at = |(i, p): (usize, &[f32; 3])| {
                let swing = 0.002 * (i % POINTS) as f64 * (0.5 * f as f64 + (i / POINTS) as f64).sin();
                let p = Point3::new(f64::from(p[0]) + swing, f64::from(p[1]), f64::from(p[2]));
                matrix(&head).transform_point(&p).coords.cast::<f32>().into()
            };
            CurveFrame { points: set.rest.iter().enumerate().map(at).collect(), ..CurveFrame::default() }
        };
        Frame {
            frame: 1001 + f as i32,
            hair: hair.as_ref().map(moved),
            guides: moved(&guides),
            head,
            colliders: vec![ColliderFrame { transform: head, points: None }],
            ..Frame::default()
        }
    };
    let corner = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 1 { [9.0, 9.0, -0.05][k] } else { -9.0 });
    let (points, triangles) = ((0..8).map(corner).collect(), bodies::tests::BOX.to_vec());
    let wall = ColliderMesh { name: "wall <b>".into(), points, triangles, ..ColliderMesh::default() };
    let frames: Vec<Frame> = (0..frames).map(frame).collect();
    let header = Header {
        metres_per_unit: 1.0,
        fps: 24.0,
        frames: (1001, 1000 + frames.len() as i32),
        hair,
        guides,
        colliders: vec![wall],
        ..Header::default()
    };
    Memory { header, frames }
}

/// The same shot in centimetres, Z up.
fn in_cm_z_up(mut shot: Memory) -> Memory {
    let place = |p: &mut [f32; 3]| *p = [100.0 * p[0], -100.0 * p[2], 100.0 * p[1]];
    let to = Matrix4::new_scaling(100.0) * Matrix4::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
    let back = to.try_inverse().unwrap();
    let motion = |rows: &mut [[f64; 4]; 4]| *rows = (to * matrix(rows) * back).transpose().into();
    let header = &mut shot.header;
    (header.metres_per_unit, header.z_up) = (0.01, true);
    for set in header.hair.iter_mut().chain([&mut header.guides]) {
        set.rest.iter_mut().for_each(place);
        set.widths.iter_mut().for_each(|width| *width *= 100.0);
    }
    header.colliders.iter_mut().flat_map(|mesh| &mut mesh.points).for_each(place);
    for frame in &mut shot.frames {
        for moving in frame.hair.iter_mut().chain([&mut frame.guides]) {
            moving.points.iter_mut().for_each(place);
        }
        motion(&mut frame.head);
        frame.colliders.iter_mut().for_each(|body| motion(&mut body.transform));
    }
    shot
}

fn view(shot: &Memory) -> View {
    View::new(shot, &numbers(shot), &Findings::default(), 1_000_000).unwrap()
}

/// The bound on errors that a view states, m.
fn stated(view: &View) -> f64 {
    let (_, bound) = view.note.split_once("off by ").unwrap();
    1e-3 * bound.split_once(" mm").unwrap().0.parse::<f64>().unwrap()
}

/// Error, m, of coordinates of a few metres in single precision, rounded twice and turned once.
const SINGLE: f64 = 1e-6;

/// How far, m, each point of a set in each frame of a view is from where the shot has it.
fn errors(shot: &Memory, view: &View, set: usize) -> Vec<Vec<f64>> {
    let guides = view.description["sets"][set]["name"] == "guides";
    let (frames, _) = view.points(set);
    assert_eq!(frames.len(), shot.frames.len());
    let each = shot.frames.iter().zip(&frames).map(|(frame, points)| {
        let moving = if guides { &frame.guides } else { frame.hair.as_ref().unwrap() };
        assert_eq!(moving.points.len(), points.len());
        let back = |p: &Vector3<f32>| matrix(&frame.head).transform_point(&p.cast::<f64>().into()).coords;
        let off = |(at, p): (&[f32; 3], _)| (back(p) - Vector3::from(*at).cast()).norm();
        moving.points.iter().zip(points).map(|pair| off(pair) * shot.header.metres_per_unit).collect()
    });
    each.collect()
}

fn largest(errors: &[Vec<f64>]) -> f64 {
    errors.iter().flatten().copied().fold(0.0, f64::max)
}

fn numbers(shot: &Memory) -> Vec<i32> {
    shot.frames.iter().map(|f| f.frame).collect()
}

impl View {
    /// A view of four strands in three frames.
    pub fn sample() -> View {
        let shot = shot(4, 2, 3);
        View::new(&shot, &numbers(&shot), &Findings::default(), 1_000_000).unwrap()
    }

    fn unpacked(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        flate2::read::ZlibDecoder::new(&self.data[..]).read_to_end(&mut bytes).unwrap();
        assert_eq!(self.description["bytes"], bytes.len());
        bytes
    }

    /// The points of a set at the frames shown, and the length of a step.
    fn points(&self, set: usize) -> (Vec<Vec<Vector3<f32>>>, f32) {
        let (set, bytes) = (&self.description["sets"][set], self.unpacked());
        let points = &set["points"];
        let float = |v: &Value| v.as_f64().unwrap() as f32;
        let low = Vector3::from_fn(|k, _| float(&points["low"][k]));
        let space = Box16 { low, step: float(&points["step"]) };
        let shifts: Vec<u8> = serde_json::from_value(points["shifts"].clone()).unwrap();
        let [at, end] = [&points["at"], &set["widthsAt"]].map(|v| v.as_u64().unwrap() as usize);
        let roots: Vec<bool> =
            (0..points["count"].as_u64().unwrap() as usize).map(|i| i % POINTS == 0).collect();
        // The sections after the points begin at a multiple of four, and hold more than one set.
        let encoded = Encoded { bytes: bytes[at..].to_vec(), shifts };
        let (frames, used) = decode(&encoded, &roots, &space);
        assert!(at + used <= end || end < at);
        (frames, space.step)
    }
}

#[test]
fn points_come_back_in_the_frame_of_the_head() {
    for shot in [shot(6, 3, 12), in_cm_z_up(shot(6, 3, 12))] {
        let view = view(&shot);
        assert!(stated(&view) < 1e-4, "{}", view.note);
        for (set, name) in [(0, "strands"), (1, "guides")] {
            assert_eq!(view.description["sets"][set]["name"], name);
            let off = largest(&errors(&shot, &view, set));
            assert!(off <= stated(&view) + SINGLE, "{off} m: {}", view.note);
        }
    }
}

#[test]
fn roots_that_a_skin_takes_far_from_the_head_stay_where_they_are() {
    for unit in [1.0, 0.01] {
        let mut shot = shot(6, 3, 12);
        for (f, frame) in shot.frames.iter_mut().enumerate() {
            // A limb that leaves the head by five metres.
            let moving = [frame.hair.as_mut().unwrap(), &mut frame.guides];
            moving.into_iter().flat_map(|m| &mut m.points).for_each(|p| p[1] += 0.45 * f as f32);
        }
        let shot = if unit == 1.0 { shot } else { in_cm_z_up(shot) };
        let view = view(&shot);
        for set in [0, 1] {
            let off = largest(&errors(&shot, &view, set));
            assert!(off <= stated(&view) + SINGLE && off < 2e-3, "{off} m: {}", view.note);
        }
    }
}

#[test]
fn a_point_that_is_drawn_elsewhere_counts_as_error() {
    let mut shot = shot(6, 3, 12);
    // No root, so that it widens no box.
    shot.frames[5].hair.as_mut().unwrap().points[20] = [0.0, 900.0, 0.0];
    let view = view(&shot);
    let mut errors = errors(&shot, &view, 0);
    let stray = errors[5][20];
    assert!(stray > 890.0 && stray <= stated(&view), "{stray} m: {}", view.note);
    // The error itself is in single precision.
    assert!(stated(&view) < stray + 0.01, "{}", view.note);
    errors[5][20] = 0.0;
    assert!(largest(&errors) < 1e-3, "{}", largest(&errors));
}

#[test]
fn a_page_keeps_to_its_size_and_says_what_it_leaves_out() {
    let shot = shot(3000, 40, 60);
    let view = |size| View::new(&shot, &numbers(&shot), &Findings::default(), size).unwrap();
    for size in [300_000, 1_000_000] {
        let view = view(size);
        let page = view.to_html();
        assert!(page.len() <= size, "{} of {size}", page.len());
        assert!(view.data.len() * 4 / 3 > size / 8, "{} of {size}: room is left", view.data.len());
        let every = view.description["sets"][0]["every"].as_u64().unwrap();
        assert!(every > 1 && page.contains(&format!("every {} of 3000 strands", ordinal(every as usize))));
    }
    let whole = view(50_000_000);
    assert!(whole.note.starts_with("Shown: all 3000 strands, all 40 guides, every frame."), "{}", whole.note);
}

#[test]
fn frames_of_warnings_are_shown_and_guides_that_failed_are_named() {
    let shot = shot(2000, 4, 120);
    let mut warning = Warning::new("</script> & more");
    [1002, 1004, 1999].into_iter().for_each(|frame| warning.frame(frame, "0.3 mm"));
    let warnings = vec![warning];
    let unconverged = BTreeMap::from([(1004, vec![102, 7])]);
    let findings = Findings { warnings, unconverged, ..Findings::default() };
    let view = View::new(&shot, &numbers(&shot), &findings, 150_000).unwrap();
    let shown: Vec<i32> = serde_json::from_value(view.description["frames"].clone()).unwrap();
    assert!(shown.len() < 120 && [1001, 1002, 1004].iter().all(|f| shown.contains(f)), "{shown:?}");
    assert!(view.note.contains(" frame, those between interpolated"), "{}", view.note);
    let guides = &view.description["sets"][1];
    assert_eq!(guides["unconverged"], json!({ "places": { "1004": [2] }, "missing": 1 }));
    let page = view.to_html();
    assert_eq!(page.matches("</script>").count(), 3, "those of the page itself");
}

#[test]
fn shades_tell_where_hair_is_inside_a_body() {
    let mut shot = shot(2, 1, 2);
    let touching = shot.frames[1].head;
    // Points of the first strand behind the wall; they are in front of it in the groom.
    let depths = [(2, 0.5), (3, 0.0012), (5, 1.5)];
    for (point, depth) in depths {
        let inside = Point3::new(0.0, 0.12, -0.05 - depth);
        shot.frames[1].hair.as_mut().unwrap().points[point] =
            matrix(&touching).transform_point(&inside).coords.cast::<f32>().into();
    }
    for shot in [in_cm_z_up(Memory { header: shot.header.clone(), frames: shot.frames.clone() }), shot] {
        let view = view(&shot);
        let at = view.description["sets"][0]["shadesAt"].as_u64().unwrap() as usize;
        let codes: Vec<u8> = view.unpacked()[at..][..4 * POINTS].iter().map(|shade| shade >> 4).collect();
        let found: Vec<_> = codes.iter().enumerate().filter(|(_, code)| **code > 0).collect();
        assert_eq!(found, [(2 * POINTS + 2, &15), (2 * POINTS + 3, &7), (2 * POINTS + 5, &15)]);
    }
}

#[test]
fn deforming_bodies_are_thinned_and_move() {
    let mut shot = shot(500, 3, 40);
    let points = |f: usize| -> Vec<[f32; 3]> {
        let place =
            |i: usize| [(i / 90) as f32 * 0.01, (i % 90) as f32 * 0.01, 0.001 * (f * (i % 7)) as f32 - 0.3];
        (0..90 * 90).map(place).collect()
    };
    let corner = |i: i32, j: i32| 90 * i + j;
    let below = |i, j| [corner(i, j), corner(i + 1, j), corner(i, j + 1)];
    let body = &mut shot.header.colliders[0];
    body.points = points(0);
    body.triangles = (0..89).flat_map(|i| (0..89).map(move |j| below(i, j))).collect();
    body.deforms = true;
    for (f, frame) in shot.frames.iter_mut().enumerate() {
        frame.colliders[0].points = Some(points(f));
    }
    let view = View::new(&shot, &numbers(&shot), &Findings::default(), 500_000).unwrap();
    let body = &view.description["bodies"][0];
    let n = body["points"]["count"].as_u64().unwrap() as usize;
    assert!((100..2000).contains(&n), "{n}");
    assert_eq!(body["points"]["shifts"].as_array().unwrap().len(), 40);
    assert!(view.note.contains("bodies with fewer vertices"), "{}", view.note);
    assert!(view.to_html().len() <= 500_000);
}

#[test]
fn a_page_with_many_bodies_and_failures_keeps_to_its_size() {
    let mut shot = shot(0, 100, 60);
    shot.header.colliders = vec![shot.header.colliders[0].clone(); 60];
    for frame in &mut shot.frames {
        let turn = |k: usize| {
            let motion = matrix(&frame.head) * Matrix4::from_scaled_axis(Vector3::y() * k as f64);
            ColliderFrame { transform: motion.transpose().into(), points: None }
        };
        frame.colliders = (0..60).map(turn).collect();
    }
    let all: Vec<i32> = (100..200).collect();
    let failed: BTreeMap<i32, Vec<i32>> = numbers(&shot).into_iter().map(|n| (n, all.clone())).collect();
    let findings = Findings { unconverged: failed.clone(), halved: failed, ..Findings::default() };
    let size = 250_000;
    let view = View::new(&shot, &numbers(&shot), &findings, size).unwrap();
    let page = view.to_html();
    assert!(page.len() <= size, "{} of {size}", page.len());
    let bodies = view.description["bodies"].as_array().unwrap().len();
    assert!((1..60).contains(&bodies), "{bodies}");
    assert!(view.note.contains(&format!("the first {bodies} of 60 bodies")), "{}", view.note);
}

#[test]
fn guides_that_did_not_converge_are_shown_where_others_are_left_out() {
    let shot = shot(0, 3000, 60);
    let unconverged = BTreeMap::from([(1005, vec![101, 2222]), (1009, vec![102, 2222])]);
    let halved = BTreeMap::from([(1005, (1100..1200).collect())]);
    let findings = Findings { unconverged, halved, ..Findings::default() };
    let view = View::new(&shot, &numbers(&shot), &findings, 500_000).unwrap();
    let guides = &view.description["sets"][0];
    let every = guides["every"].as_u64().unwrap() as usize;
    assert!(every > 3 && view.note.contains("3000 guides and those that did not converge"), "{}", view.note);
    assert_eq!(guides["unconverged"]["missing"], 0);
    assert_eq!(guides["unconverged"]["places"]["1009"].as_array().unwrap().len(), 2);
    let shown = (1000..1100).filter(|curve| curve % every == 0).count();
    assert_eq!(guides["halved"]["missing"], 100 - shown);
    assert_eq!(
        guides["counts"].as_array().unwrap().len(),
        3000usize.div_ceil(every) + 3 - [1, 2, 2122].iter().filter(|c| *c % every == 0).count()
    );
}

#[test]
fn guides_alone_and_gaps_between_frames_are_shown() {
    let shot = shot(0, 5, 9);
    let mut frames = numbers(&shot);
    frames.drain(3..6);
    let view = View::new(&shot, &frames, &Findings::default(), 1_000_000).unwrap();
    assert_eq!(view.description["frames"], json!(frames));
    assert_eq!(view.description["sets"].as_array().unwrap().len(), 1);
    assert!(View::new(&shot, &[], &Findings::default(), 1_000_000).is_err());
}

#[test]
fn the_part_of_the_page_is_well_formed() {
    let page = View::sample().to_html();
    let (markup, rest) = page.split_once("<script").unwrap();
    crate::report::text::check_markup(&format!("<div>{markup}</div>")).unwrap();
    assert!(rest.contains("\"name\":\"wall \\u003cb>\""));
    assert!(!page.contains("http"), "nothing is loaded");
}

#[test]
fn guides_that_did_not_converge_leave_room_for_strands() {
    let shot = shot(400, 400, 60);
    let all: Vec<i32> = (100..500).collect();
    let unconverged = numbers(&shot).into_iter().map(|frame| (frame, all.clone())).collect();
    let findings = Findings { unconverged, ..Findings::default() };
    let size = 150_000;
    let view = View::new(&shot, &numbers(&shot), &findings, size).unwrap();
    assert!(view.to_html().len() <= size);
    let shown = |set: usize| view.description["sets"][set]["counts"].as_array().unwrap().len();
    assert!(shown(0) > shown(1) && shown(1) > 4, "{} strands, {} guides", shown(0), shown(1));
    assert!(view.note.contains(" of 400 that did not converge"), "{}", view.note);
}

#[test]
fn bodies_have_a_bound_of_their_own() {
    let shot = shot(6, 3, 12);
    let view = view(&shot);
    let (_, bound) = view.note.split_once("vertices of bodies by ").unwrap();
    let bound = 1e-3 * bound.strip_suffix(" mm.").unwrap().parse::<f64>().unwrap();
    // A wall of 18 m in 16 bits.
    assert!(bound > 1e-4 && bound < 5e-4, "{}", view.note);
}
