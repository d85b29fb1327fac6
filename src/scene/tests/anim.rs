use super::super::track::{PoseSamples, Track};
use super::super::*;
use super::file;
use crate::error::Error;
use crate::geometry::Shape;
use crate::test_data::shared_data;
use approx::assert_relative_eq;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

const MINIMAL: &str = r#"{ "format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 48] }"#;

#[test]
fn the_minimal_file_is_a_head_that_does_not_move() {
    let (_folder, path) = file("still.json", MINIMAL);
    let anim = load_anim(&path).unwrap();
    assert_eq!((anim.fps, anim.frames, anim.head, anim.bodies.len()), (24.0, (1, 48), 0, 1));
    assert_eq!(anim.gravity, Vector3::new(0.0, -9.81, 0.0));
    assert_eq!(anim.head_pose(1.0), Isometry3::identity());
    assert_eq!(anim.settings, Settings::default());
}

/// Real tracks, referenced as motion files.
#[test]
fn real_tracks_load_with_default_settings() {
    let Some(motions) = shared_data("motion") else { return };
    let mut tracks = 0;
    for entry in std::fs::read_dir(motions).unwrap() {
        let track = entry.unwrap().path().canonicalize().unwrap();
        let text = std::fs::read_to_string(&track).unwrap();
        let motion: anim::motion_file::MotionFile = serde_json::from_str(&text).unwrap();
        let last = ((motion.frames.len() - 1) as f64 * 24.0 / motion.fps) as i32;
        let mut scene = AnimFile::new(24.0, [0, last]);
        scene.bodies = vec![anim::file::BodyFile {
            name: "head".into(),
            track: Some(anim::file::TrackFile {
                file: Some(track.to_string_lossy().into()),
                ..Default::default()
            }),
        }];
        let (_folder, path) = file("anim.json", "");
        scene.write(&path).unwrap();
        let anim = load_anim(&path).unwrap_or_else(|e| panic!("{}: {e:?}", track.display()));
        // The filter stays close to the samples: their noise is of the order of millimetres.
        for (i, frame) in motion.frames.iter().enumerate() {
            let pose = anim.head_pose(i as f64 / motion.fps);
            let off = (pose.translation.vector - Vector3::from(frame.translation)).norm();
            assert!(off < 0.02, "{}: sample {i} moved by {off} m", track.display());
        }
        tracks += 1;
    }
    assert!(tracks >= 5);
}

/// The solver sees the second difference of a track. That of raw motion capture at 120 Hz is many times the
/// acceleration of the head.
#[test]
fn smoothing_removes_the_accelerations_of_noise() {
    let Some(track) = shared_data("motion/cmu_01_01_jump_turn_120fps.json") else { return };
    let text = std::fs::read_to_string(track).unwrap();
    let motion: anim::motion_file::MotionFile = serde_json::from_str(&text).unwrap();
    let poses: Vec<Isometry3<f64>> = motion
        .frames
        .iter()
        .map(|f| {
            let [w, x, y, z] = f.rotation_quat_wxyz;
            let q = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
            Isometry3::from_parts(Vector3::from(f.translation).into(), q)
        })
        .collect();
    let samples = PoseSamples { start: 0.0, rate: motion.fps, poses, bridged: vec![] };
    // Peak linear and angular acceleration, by central differences over one sample.
    let peaks = |smoothing: f64| {
        let track = Track::through(&samples, smoothing, &Isometry3::identity());
        let h = 1.0 / samples.rate;
        let mut peak = [0.0_f64; 2];
        for i in 1..samples.poses.len() - 1 {
            let [a, b, c] = [-1.0, 0.0, 1.0].map(|k| track.pose((i as f64 + k) * h));
            let linear = (a.translation.vector - b.translation.vector * 2.0 + c.translation.vector) / (h * h);
            let angular =
                ((c.rotation / b.rotation).scaled_axis() - (b.rotation / a.rotation).scaled_axis()) / (h * h);
            peak = [peak[0].max(linear.norm()), peak[1].max(angular.norm())];
        }
        peak
    };
    let (raw, smooth) = (peaks(0.0), peaks(12.0));
    assert!(raw[0] > 190.0 && raw[1] > 1700.0);
    // Measured: 28 of 195 m/s² and 103 of 1783 rad/s².
    assert!(smooth[0] < 35.0 && smooth[1] < 130.0, "{smooth:?}");
}

#[test]
fn pops_and_gaps_are_bridged_or_kept_on_request() {
    let scene = |pops: &str| {
        let samples: Vec<String> = (0..12)
            .map(|i| if i == 5 { "[0.5, 0, 0]".into() } else { format!("[0, {}, 0]", 0.01 * f64::from(i)) })
            .collect();
        let numbers =
            if pops == "bridge" { "[0,1,2,3,4,5,6,7,8,10,11,12]" } else { "[0,1,2,3,4,5,6,7,8,9,10,11]" };
        let track =
            format!(r#"{{ "pops": "{pops}", "frames": {numbers}, "translation": [{}] }}"#, samples.join(","));
        MINIMAL
            .replace("[1, 48]", "[0, 11]")
            .replace(" }", &format!(r#", "bodies": [{{ "name": "head", "track": {track} }}] }}"#))
    };
    let x = |pops: &str, frame: f64| {
        let (_folder, path) = file("anim.json", &scene(pops));
        let anim = load_anim(&path).unwrap();
        anim.head_pose(anim.time(frame)).translation.vector
    };
    assert_relative_eq!(x("keep", 5.0), Vector3::new(0.5, 0.0, 0.0), epsilon = 1e-9);
    assert_relative_eq!(x("bridge", 5.0), Vector3::new(0.0, 0.05, 0.0), epsilon = 1e-6);
    // Sample 9 is missing; the later ones lag by 0.01.
    assert!((x("bridge", 9.0).y - 0.085).abs() < 0.003);
    let (_folder, path) = file("anim.json", &scene("error"));
    assert!(matches!(load_anim(&path), Err(Error::BadInput(diagnostics)) if diagnostics.len() == 1));
}

/// A scene in centimetres, Z up, equals the same scene in metres, Y up.
#[test]
fn units_and_axes_are_converted() {
    let scene = |unit: &str, up: &str, p: &str, quaternion: &str, gravity: &str, normal: &str| {
        format!(
            r#"{{ "format": "hairbake-anim", "version": 1, "metres_per_unit": {unit}, "up_axis": "{up}", "fps": 24,
  "frames": [0, 0], "gravity_m_s2": {gravity},
  "bodies": [{{ "name": "head", "track": {{ "translation": [{p}], "rotation_wxyz": [{quaternion}],
    "rest": {{ "translation": {p} }} }} }}],
  "colliders": [{{ "name": "ground", "shape": {{ "type": "plane", "point": {p}, "normal": {normal} }} }}] }}"#
        )
    };
    let load = |text: String| {
        let (_folder, path) = file("anim.json", &text);
        load_anim(&path).unwrap()
    };
    let a = load(scene("1", "y", "[0.1, 1.6, -0.3]", "[0.6, 0, 0.8, 0]", "[0, -9, 1]", "[0, 1, 0]"));
    let b = load(scene("0.01", "z", "[10, 30, 160]", "[0.6, 0, 0, 0.8]", "[0, -1, -9]", "[0, 0, 2]"));
    assert_relative_eq!(a.gravity, b.gravity, epsilon = 1e-12);
    assert_relative_eq!(a.head_pose(0.0), b.head_pose(0.0), epsilon = 1e-12);
    let plane = |anim: &Anim| match anim.colliders[0].shape {
        Shape::Plane { point, normal } => (point, normal),
        _ => panic!("not a plane"),
    };
    assert_relative_eq!(plane(&a).0, plane(&b).0, epsilon = 1e-12);
    assert_relative_eq!(plane(&a).1, plane(&b).1, epsilon = 1e-12);
}

/// The frames of a deforming mesh have the unit and axes of its file, and are interpolated.
#[test]
fn a_deforming_mesh_is_read_from_numbered_files() {
    let text = MINIMAL.replace("[1, 48]", "[10, 12]").replace(
        " }",
        r#", "colliders": [{ "name": "cloth", "shape": { "type": "mesh", "file": "rest.obj", "sequence": "cloth.##.obj",
            "metres_per_unit": 0.01, "up_axis": "z" } }] }"#,
    );
    let (folder, path) = file("anim.json", &text);
    let mesh = |height: i32| format!("v 0 0 {height}\nv 100 0 0\nv 0 100 0\nv 0 0 0\nf 1 2 3\nf 4 4 2\n");
    std::fs::write(folder.path().join("rest.obj"), mesh(7)).unwrap();
    // Frame 9 is a handle. 8 is missing, so 7 is not read; 15 is too far.
    for frame in [7, 9, 10, 11, 12, 13, 14, 15] {
        std::fs::write(folder.path().join(format!("cloth.{frame:02}.obj")), mesh((frame - 9) * (frame - 9)))
            .unwrap();
    }
    let anim = load_anim(&path).unwrap();
    let collider = &anim.colliders[0];
    let Shape::Mesh(rest) = &collider.shape else { panic!("not a mesh") };
    assert_eq!((rest.triangles.len(), rest.vertices.len()), (1, 4));
    assert_relative_eq!(rest.vertices[0], Vector3::y() * 0.07, epsilon = 1e-15);
    let deformation = collider.deformation.as_ref().unwrap();
    assert_eq!((deformation.start, deformation.samples.len()), (anim.time(9.0), 6));
    for frame in [9.0, 10.5, 11.25, 14.0] {
        let height = 0.01 * (frame - 9.0) * (frame - 9.0);
        let vertices = deformation.vertices(anim.time(frame));
        assert_relative_eq!(vertices[0], Vector3::y() * height, epsilon = 1e-15);
        assert_relative_eq!(vertices[2], -Vector3::z(), epsilon = 1e-15);
    }
    let (_groom_folder, groom) = file("groom.json", "{}");
    let files = input_files(&groom, &path, &LoadOptions::default()).unwrap();
    let names: Vec<_> =
        files.iter().map(|(role, file)| (*role, file.file_name().unwrap().to_str().unwrap())).collect();
    assert_eq!(names[2], ("collider", "rest.obj"));
    assert_eq!(names[3..].len(), 6);
    assert_eq!((names[3], names[8]), (("deformation", "cloth.09.obj"), ("deformation", "cloth.14.obj")));
}

#[test]
fn the_former_name_of_split_tolerance_is_read() {
    let text = MINIMAL.replace(" }", r#", "settings": { "parting": 0.25 } }"#);
    let (_folder, path) = file("anim.json", &text);
    assert_eq!(load_anim(&path).unwrap().settings.split_tolerance, 0.25);
    let file: AnimFile = serde_json::from_str(&text).unwrap();
    assert_eq!(file.settings.split_tolerance, 0.25);
    assert!(serde_json::to_string(&file).unwrap().contains("\"split_tolerance\":0.25"));
    let options = |text: &str| LoadOptions {
        overrides: vec![Override::parse(text).unwrap()],
        ..LoadOptions::default()
    };
    let (_groom_folder, groom) = self::file(
        "groom.json",
        r#"{ "format": "hairbake-groom", "version": 1, "guides": { "points": [[0, 0, 0], [0, 1, 0]] } }"#,
    );
    for (assignment, value) in
        [("anim.settings.split_tolerance=0.5", 0.5), ("anim.settings.split_tolerance=0.75", 0.75)]
    {
        let (_, anim) = load_with(&groom, &path, &options(assignment)).unwrap();
        assert_eq!(anim.settings.split_tolerance, value, "{assignment}");
    }
}
