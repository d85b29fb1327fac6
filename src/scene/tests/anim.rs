use super::super::*;
use super::{file, shared_data};
use nalgebra::{Isometry3, Vector3};

const SMALLEST: &str = r#"{ "format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 48] }"#;

#[test]
fn a_static_clamp_is_an_animation() {
    let (_folder, path) = file("still.json", SMALLEST);
    let anim = load_anim(&path).unwrap();
    assert_eq!((anim.fps, anim.frames, anim.head, anim.bodies.len()), (24.0, (1, 48), 0, 1));
    assert_eq!(anim.gravity, Vector3::new(0.0, -9.81, 0.0));
    assert_eq!(anim.head_pose(1.0), Isometry3::identity());
    assert_eq!(anim.settings, Settings::default());
}

/// Every real track loads as it is, by reference to its file.
#[test]
fn real_tracks_load_clean_with_defaults() {
    let Some(data) = shared_data() else { return };
    let mut tracks = 0;
    for entry in std::fs::read_dir(data.join("motion")).unwrap() {
        let track = entry.unwrap().path().canonicalize().unwrap();
        let text = std::fs::read_to_string(&track).unwrap();
        let motion: anim::file::MotionFile = serde_json::from_str(&text).unwrap();
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
        // The filter keeps to the samples: noise is of the order of millimetres.
        for (i, frame) in motion.frames.iter().enumerate() {
            let pose = anim.head_pose(i as f64 / motion.fps);
            let off = (pose.translation.vector - Vector3::from(frame.translation)).norm();
            assert!(off < 0.02, "{}: sample {i} moved by {off} m", track.display());
        }
        tracks += 1;
    }
    assert!(tracks >= 5);
}
