//! A small scene, imported by the program itself.

use assert_cmd::Command;
use hairbake::dynamics::checkpoint::Checkpoint;
use hairbake::dynamics::guide_rods::GuideRods;
use hairbake::dynamics::simulation::Simulation;
use hairbake::scene::{Anim, Groom};
use nalgebra::Vector3;
use std::f32::consts::{PI, TAU};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The program, independent of the caller's environment.
pub fn hairbake() -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("hairbake"));
    for variable in ["HAIRBAKE_THREADS", "CUE_THREADS", "SLURM_CPUS_PER_TASK", "HAIRBAKE_PYTHON"] {
        command.env_remove(variable);
    }
    command
}

/// A bake of `groom` on `anim` into `out`.
pub fn bake(groom: &Path, anim: &Path, out: &Path) -> Command {
    let mut command = hairbake();
    command.args([groom, anim]).arg("-o").arg(out);
    command
}

/// The bytes of a file that must exist.
pub fn here(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Sorted names of the entries of a folder.
pub fn entries(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Strands in centimetres on a ball in metres that follows a track in metres.
pub struct Scene {
    /// Holds all files.
    pub folder: TempDir,
    /// `groom.json`
    pub groom: PathBuf,
    /// `anim.json`
    pub anim: PathBuf,
}

impl Scene {
    /// Writes the source files and imports them.
    pub fn import() -> Scene {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("strands.tfx"), tfx()).unwrap();
        std::fs::write(at("ball.obj"), ball()).unwrap();
        std::fs::write(at("turn.json"), motion()).unwrap();
        let (groom, anim) = (at("shot/groom.json"), at("shot/anim.json"));
        let mesh = format!("{}:m", at("ball.obj").display());
        hairbake()
            .args(["import", "groom"])
            .arg(at("strands.tfx"))
            .args(["--units", "cm", "--strands-per-guide", "4", "--head", &mesh, "-o"])
            .arg(&groom)
            .assert()
            .success();
        hairbake()
            .args(["import", "track"])
            .arg(at("turn.json"))
            .args(["--collider", &mesh, "-o"])
            .arg(&anim)
            .assert()
            .success();
        Scene { folder, groom, anim }
    }
}

/// Eight radial strands of 12 cm on the upper half of a ball of radius 10 cm, in centimetres.
fn tfx() -> Vec<u8> {
    const STRANDS: u32 = 8;
    const VERTICES: u32 = 6;
    let mut bytes = vec![0; 160];
    bytes[..4].copy_from_slice(&4.0f32.to_le_bytes());
    for (word, value) in [(1, STRANDS), (2, VERTICES), (3, 160), (4, 160 + STRANDS * VERTICES * 16)] {
        bytes[4 * word..4 * word + 4].copy_from_slice(&value.to_le_bytes());
    }
    for strand in 0..STRANDS {
        let (turn, level) = (strand as f32 / STRANDS as f32 * TAU, 0.5f32);
        for vertex in 0..VERTICES {
            let r = 10.0 + 12.0 * vertex as f32 / (VERTICES - 1) as f32;
            for x in [r * level.cos() * turn.cos(), r * level.sin(), r * level.cos() * turn.sin(), 1.0] {
                bytes.extend(x.to_le_bytes());
            }
        }
    }
    (0..STRANDS).for_each(|strand| bytes.extend([strand as f32 / 8.0, 0.5].map(f32::to_le_bytes).concat()));
    bytes
}

/// A ball of radius 10 cm, in metres.
fn ball() -> String {
    let (rings, sides) = (12, 24);
    let mut text = String::new();
    for ring in 0..=rings {
        let (sin, cos) = (ring as f32 / rings as f32 * PI).sin_cos();
        for side in 0..sides {
            let (s, c) = (side as f32 / sides as f32 * TAU).sin_cos();
            text += &format!("v {} {} {}\n", 0.1 * sin * s, 0.1 * cos, 0.1 * sin * c);
        }
    }
    for ring in 0..rings {
        for side in 0..sides {
            let corner = |r: usize, s: usize| r * sides + s % sides + 1;
            let (a, b) = (corner(ring, side), corner(ring + 1, side));
            let (c, d) = (corner(ring + 1, side + 1), corner(ring, side + 1));
            text += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
        }
    }
    text
}

/// A head at a height of 1.5 m that turns by 2° per sample at 24 samples per second, in metres.
fn motion() -> String {
    let frame = |i: i32| {
        let (sin, cos) = f64::from(i).to_radians().sin_cos();
        serde_json::json!({ "translation": [0.0, 1.5, 0.0], "rotation_quat_wxyz": [cos, 0.0, sin, 0.0] })
    };
    let frames: Vec<_> = (0..8).map(frame).collect();
    serde_json::json!({ "fps": 24.0, "units": "m", "up_axis": "Y", "frames": frames }).to_string()
}

/// The Python of the tests: `HAIRBAKE_PYTHON`, or the environment that `tests/run` makes.
pub fn python() -> PathBuf {
    std::env::var_os("HAIRBAKE_PYTHON")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python"), PathBuf::from)
}

/// A Python with usd-core. Without one, prints that the test is skipped.
pub fn python_with_usd() -> Option<PathBuf> {
    let python = python();
    let has_usd = std::process::Command::new(&python).args(["-c", "import pxr.Usd, numpy"]).output();
    if has_usd.is_ok_and(|output| output.status.success()) {
        return Some(python);
    }
    println!("skipped: {} has no usd-core; tests/run makes an environment that has", python.display());
    None
}

/// Writes curves as elements `l` of an OBJ file.
pub fn write_curves(path: &Path, curves: impl IntoIterator<Item = impl IntoIterator<Item = Vector3<f64>>>) {
    let (mut points, mut lines, mut last) = (String::new(), String::new(), 0);
    for curve in curves {
        lines += "l";
        for x in curve {
            last += 1;
            points += &format!("v {:.12} {:.12} {:.12}\n", x.x, x.y, x.z);
            lines += &format!(" {last}");
        }
        lines += "\n";
    }
    std::fs::write(path, points + &lines).unwrap();
}

/// Asserts that a simulation resumed after `steps` sub-steps goes on with the same bits.
pub fn assert_resumed_bits(groom: &Groom, anim: &Anim, rods: &GuideRods, steps: usize) {
    let mut whole = Simulation::new(groom, anim, rods);
    for _ in 0..steps {
        whole.step();
    }
    let state = postcard::to_stdvec(&whole.state()).unwrap();
    let mut resumed = Simulation::new(groom, anim, rods);
    resumed.restore(postcard::from_bytes(&state).unwrap()).unwrap();
    for _ in 0..20 {
        assert_eq!(whole.step().guides, resumed.step().guides);
    }
    let bytes = |simulation: &Simulation| postcard::to_stdvec(&simulation.state()).unwrap();
    assert_eq!(bytes(&whole), bytes(&resumed));
}

/// Materials and groups of a groom in which soft hair, group 0, falls on stiff hair, group 1.
pub fn soft_and_stiff() -> [serde_json::Value; 2] {
    [
        serde_json::json!([
            { "name": "soft", "sag_free": 0.0 },
            { "name": "stiff", "sag_free": 1.0, "young_modulus_pa": 4e10, "shear_modulus_pa": 1e10 }
        ]),
        serde_json::json!([{ "name": "falls", "material": 0 }, { "name": "held", "material": 1 }]),
    ]
}
