//! Hostile input files: the program writes nothing outside the output folder, allocates no more memory than
//! the size of a file justifies, and runs nothing that a file names.

use crate::common::{Scene, bake, entries, hairbake, here};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Address space of a process, KiB: little more than it takes to start.
const MEMORY_KIB: u32 = 1 << 20;

/// Runs the program with limited memory and returns its exit code. It must exit by itself: with success, bad
/// input or usage, an unreadable file, or stopped.
#[track_caller]
fn run_limited(what: &str, arguments: &[&dyn AsRef<std::ffi::OsStr>]) -> i32 {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -v {MEMORY_KIB}; HAIRBAKE_THREADS=2 exec \"$0\" \"$@\"")]);
    command.arg(assert_cmd::cargo::cargo_bin!("hairbake"));
    let output = command.args(arguments.iter().map(|argument| argument.as_ref())).output().unwrap();
    let code = output.status.code();
    let known = code.filter(|code| [0, 64, 65, 74, 85].contains(code));
    known
        .unwrap_or_else(|| panic!("{what}: {:?}\n{}", output.status, String::from_utf8_lossy(&output.stderr)))
}

/// A groom of one guide, and an animation that uses all features of the format.
fn scene() -> [Value; 2] {
    let groom = json!({
        "format": "hairbake-groom", "version": 1, "metres_per_unit": 1, "up_axis": "y",
        "buffers": [{ "uri": "b.bin", "bytes": 48 }],
        "materials": [{ "name": "m", "section": { "semi_axes_m": [4e-5, 3e-5] } }],
        "groups": [{ "name": "g", "material": "m", "width_m": [1e-4, 0] }],
        "guides": { "vertices": [4], "points": { "buffer": 0, "offset": 0, "count": 4, "type": "f32x3" }, "id": [1], "group": [0] },
        "wisps": {
            "parent": [-1], "length": [0.1], "strand_count": [1], "sections": [2], "arc": [0, 1],
            "centre": [[0, 0, 0], [0, 0.1, 0]], "frame_wxyz": [[1, 0, 0, 0], [1, 0, 0, 0]], "radius": [0.001, 0.001],
            "guide_count": [1], "guides": [0],
        },
        "strands": { "vertices": 2, "points": [[0, 0, 0], [0, 0.1, 0]], "wisp": [0] },
    });
    let still = vec![json!([0, 0, 0]); 5];
    let anim = json!({
        "format": "hairbake-anim", "version": 1, "fps": 24, "frames": [1, 2], "head": "head",
        "bodies": [
            { "name": "head", "track": { "frames": [0, 1, 2, 3, 4], "translation": still, "rest": { "translation": [0, 0, 0] } } },
            { "name": "b", "track": { "fps": 24, "first_frame": 0, "translation": still, "smoothing_hz": 3 } },
            { "name": "at_rest" },
        ],
        "colliders": [
            { "name": "c", "body": "b", "shape": { "type": "sphere", "centre": [0, -0.2, 0], "radius": 0.1 }, "thickness_m": 0.001 },
            { "name": "d", "body": "at_rest", "shape": { "type": "mesh", "file": "m.obj", "sequence": "m##.obj" } },
        ],
        "wind": [{ "velocity_m_s": { "frames": [0, 1], "values": [[0, 0, 0], [1, 0, 0]] } }],
        "ties": [{ "name": "t", "at": [0, 0.1, 0], "radius": 0.01, "frames": [1, 2] }],
        "settings": { "nodes": 8, "substeps": 2, "preroll_s": 0.1 },
    });
    [groom, anim]
}

/// Writes the scene and all files that it names into a folder.
fn write(folder: &Path, [groom, anim]: &[Value; 2]) -> [PathBuf; 2] {
    let file = |name: &str| folder.join(name);
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(file("groom.json"), groom.to_string()).unwrap();
    std::fs::write(file("anim.json"), anim.to_string()).unwrap();
    let points = [0.0, 0.0, 0.0, 0.0, 0.03, 0.0, 0.0, 0.06, 0.0, 0.0, 0.1, 0.0f32];
    std::fs::write(file("b.bin"), points.map(f32::to_le_bytes).concat()).unwrap();
    for name in ["m.obj", "m00.obj", "m01.obj", "m02.obj", "m03.obj"] {
        std::fs::write(file(name), "v 0 -1 0\nv 1 -1 0\nv 0 -1 1\nf 1 3 2\n").unwrap();
    }
    [file("groom.json"), file("anim.json")]
}

/// JSON pointers to the numbers of a file; of an array of numbers, to the first.
fn numbers(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(at.into()),
        Value::Object(map) => {
            map.iter().for_each(|(name, value)| numbers(value, &format!("{at}/{name}"), found))
        }
        Value::Array(list) => {
            let some = if list.iter().all(Value::is_object) { list.len() } else { 1 };
            list.iter()
                .take(some)
                .enumerate()
                .for_each(|(i, value)| numbers(value, &format!("{at}/{i}"), found));
        }
        _ => {}
    }
}

#[test]
fn extreme_numbers_do_not_exhaust_memory() {
    let folder = tempfile::tempdir().unwrap();
    let sound = scene();
    let [groom, anim] = write(&folder.path().join("sound"), &sound);
    let out = folder.path().join("out");
    assert_eq!(run_limited("valid", &[&groom, &anim, &"-o", &out, &"--no-pictures"]), 0);
    let mut wrong = Vec::new();
    for (i, file) in sound.iter().enumerate() {
        let mut places = Vec::new();
        numbers(file, "", &mut places);
        for place in places {
            for value in [json!(2_147_483_646), json!(u32::MAX), json!(1e-300)] {
                wrong.push((i, place.clone(), value));
            }
        }
    }
    for frames in [[0, 2_000_000_000], [i32::MIN, i32::MIN], [i32::MAX, i32::MAX], [0, 900_000]] {
        wrong.push((1, "/frames".into(), json!(frames)));
    }
    assert!(wrong.len() > 100, "{}", wrong.len());
    let refused: usize = wrong
        .par_iter()
        .enumerate()
        .map(|(n, (i, place, value))| {
            let folder = folder.path().join(n.to_string());
            let mut scene = sound.clone();
            *scene[*i].pointer_mut(place).unwrap() = value.clone();
            // A track would limit the frames of the shot.
            if place == "/frames" {
                let file = scene[1].as_object_mut().unwrap();
                ["bodies", "head", "colliders", "ties"].iter().for_each(|name| drop(file.remove(*name)));
            }
            let [groom, anim] = write(&folder, &scene);
            let out = folder.join("out");
            let options = ["--no-pictures", "--max-runtime", "0.3"];
            let code = run_limited(
                &format!("{place} = {value}"),
                &[&groom, &anim, &"-o", &out, &options[0], &options[1], &options[2]],
            );
            usize::from(code == 65)
        })
        .sum();
    assert!(refused > 60, "{refused}");
}

/// A sparse file of `bytes` bytes that starts with `start`; it takes no space on disk.
fn sparse_file(path: &Path, start: &[u8], bytes: u64) {
    std::fs::write(path, start).unwrap();
    std::fs::File::options().append(true).open(path).unwrap().set_len(bytes).unwrap();
}

#[test]
fn sizes_are_checked_before_memory_is_allocated() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let words = |words: &[u32]| -> Vec<u8> { words.iter().flat_map(|word| word.to_le_bytes()).collect() };
    let huge = u32::MAX;
    let four = 4.0f32.to_bits();
    let strands: &[(&str, Vec<u8>, u64)] = &[
        ("huge.tfx", words(&[four, huge, huge, 160, 0]), 4096),
        ("wraps.tfx", words(&[four, 1 << 30, 1 << 30, 160, 0]), 4096),
        ("late.tfx", words(&[four, 1, 2, huge, huge]), 4096),
        ("hole.tfx", words(&[four, 1 << 27, 2, 160, 0]), 160 + (1 << 32)),
        ("huge.hair", [b"HAIR".to_vec(), words(&[huge, huge, 3, huge])].concat(), 4096),
        ("sums.hair", [b"HAIR".to_vec(), words(&[1, huge, 2, huge - 1])].concat(), 4096),
        (
            "hole.hair",
            [b"HAIR".to_vec(), words(&[1, 1 << 28, 2, (1 << 28) - 1])].concat(),
            128 + 12 * (1 << 28),
        ),
        ("far.tfx", Vec::new(), 1 << 40),
    ];
    for (name, start, bytes) in strands {
        sparse_file(&file(name), start, *bytes);
        let made = file("made.json");
        let code = run_limited(name, &[&"import", &"groom", &file(name), &"--units", &"cm", &"-o", &made]);
        assert!(code != 0 && !made.exists(), "{name}");
    }

    let sound = scene();
    let mut names = sound.clone();
    names[0]["buffers"] = json!([{ "uri": "hole.bin", "bytes": 12_u64 << 28 }]);
    names[0]["guides"]["points"]["count"] = json!(1 << 28);
    names[0]["guides"]["vertices"] = json!([1 << 28]);
    sparse_file(&file("hole.bin"), b"", 12 << 28);
    let [groom, anim] = write(folder.path(), &names);
    assert_eq!(run_limited("buffer", &[&"check", &groom, &anim]), 65);

    let texts: &[(&str, String, u64)] = &[
        ("hole", "{".into(), 1 << 40),
        ("arrays", "[".repeat(1 << 20), 1 << 20),
        ("objects", "{\"a\":".repeat(1 << 20), 5 << 20),
    ];
    for (name, start, bytes) in texts {
        sparse_file(&groom, start.as_bytes(), *bytes);
        assert_eq!(run_limited(name, &[&"check", &groom]), 65, "{name}");
    }

    let [groom, anim] = write(folder.path(), &sound);
    for mesh in [
        "v 0 0 0\nf 1 2 4294967295\n",
        "v 0 0 0\nf 1 2 99999999999999999999\n",
        "v 0 0 0\nf -4294967295 1 1\n",
        "v 1e999 nan inf\nv 0 0 0\nv 1 0 0\nf 1 2 3\n",
        "mtllib /dev/zero\nusemtl a\nf\n",
    ] {
        std::fs::write(file("m.obj"), mesh).unwrap();
        assert_eq!(run_limited(mesh, &[&"check", &groom, &anim]), 65, "{mesh}");
    }
    // Endless files, and paths that are not plain files.
    for name in ["/dev/zero", "/dev/stdin", "/proc/self/mem", "/"] {
        let mut scene = sound.clone();
        scene[1]["colliders"][1]["shape"] = json!({ "type": "mesh", "file": name });
        let [groom, anim] = write(folder.path(), &scene);
        assert_eq!(run_limited(name, &[&"check", &groom, &anim]), 65, "{name}");
    }

    let pose = json!({ "translation": [0, 0, 0], "rotation_quat_wxyz": [1, 0, 0, 0] });
    for fps in [1e-300, 1e-9, 1e300] {
        let motion = json!({ "fps": fps, "units": "m", "up_axis": "Y", "frames": vec![pose.clone(); 8] });
        std::fs::write(file("motion.json"), motion.to_string()).unwrap();
        let what = format!("{fps} frames a second");
        run_limited(&what, &[&"import", &"track", &file("motion.json"), &"-o", &file("moves.json")]);
    }
}

/// All files below a folder, except those in `out`, with their bytes; links are followed.
fn files_outside(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for name in entries(folder) {
        let path = folder.join(name);
        if path.is_dir() && !path.ends_with("out") {
            files.extend(files_outside(&path));
        } else if path.is_file() {
            files.insert(path.clone(), here(&path));
        }
    }
    files
}

#[test]
fn nothing_is_written_outside_the_output_folder() {
    let folder = tempfile::tempdir().unwrap();
    let scene_folder = folder.path().join("in");
    let out = folder.path().join("a/out");
    std::fs::create_dir_all(folder.path().join("elsewhere")).unwrap();
    std::fs::write(folder.path().join("elsewhere/mine"), "mine").unwrap();

    // Names that lead out of the folder, at every key that takes a name.
    let escapes = [
        "../../elsewhere/mine",
        "/tmp/../../elsewhere",
        "..",
        "a/b",
        "a\\b",
        "a\0b",
        "a\nb",
        "@/etc/passwd@",
    ];
    let places = [
        (0, "/materials/0/name"),
        (0, "/groups/0/name"),
        (0, "/buffers/0/uri"),
        (1, "/bodies/1/name"),
        (1, "/colliders/0/name"),
        (1, "/colliders/1/shape/file"),
        (1, "/colliders/1/shape/sequence"),
        (1, "/ties/0/name"),
    ];
    for (file, place) in places {
        for name in escapes {
            let mut scene = scene();
            *scene[file].pointer_mut(place).unwrap() = json!(name);
            let [groom, anim] = write(&scene_folder, &scene);
            let before = files_outside(folder.path());
            bake(&groom, &anim, &out).args(["--frames", "1-1", "--quiet"]).output().unwrap();
            assert_eq!(files_outside(folder.path()), before, "{place} = {name:?}");
        }
    }

    // A cache whose files are links to files elsewhere.
    let [groom, anim] = write(&scene_folder, &scene());
    let options = ["--frames", "1-1", "--quiet", "--overwrite"];
    bake(&groom, &anim, &out).args(options).assert().success();
    let names = entries(&out).into_iter().filter(|name| out.join(name).is_file());
    let work = ["job.json", "frames/1.json", "states/1"].map(|name| format!(".hairbake/{name}"));
    for name in names.chain(work) {
        std::fs::remove_file(out.join(&name)).unwrap();
        std::os::unix::fs::symlink(folder.path().join("elsewhere/mine"), out.join(&name)).unwrap();
    }
    let before = files_outside(folder.path());
    bake(&groom, &anim, &out).args(options).assert().success();
    assert_eq!(files_outside(folder.path()), before);
    for inside in [".hairbake/states", ".hairbake"] {
        std::fs::remove_dir_all(out.join(inside)).unwrap();
        std::os::unix::fs::symlink(folder.path().join("elsewhere"), out.join(inside)).unwrap();
        bake(&groom, &anim, &out).args(["--frames", "1-1", "--quiet"]).assert().code(74);
        assert_eq!(entries(&folder.path().join("elsewhere")), ["mine"]);
        std::fs::remove_file(out.join(inside)).unwrap();
    }
}

#[test]
fn names_are_not_run_as_commands() {
    let scene = Scene::import();
    let folder = scene.folder.path();
    let nasty = "$(touch run)`touch run`;touch run;'touch run'<script>alert(1)</script>{{Param.x}}";
    let groom = folder.join(format!("shot/{}.json", nasty.replace('/', "|")));
    std::fs::copy(&scene.groom, &groom).unwrap();
    let anim = folder.join(format!("shot/{}.anim", nasty.replace('/', "|")));
    let mut file: Value = serde_json::from_slice(&here(&scene.anim)).unwrap();
    let track = file["bodies"][0]["track"].clone();
    file["bodies"].as_array_mut().unwrap().push(json!({ "name": nasty, "track": track }));
    std::fs::write(&anim, file.to_string()).unwrap();
    let out = folder.join("out");
    let baked = bake(&groom, &anim, &out)
        .args(["--frames", "1001-1001", "--preroll", "0"])
        .current_dir(folder)
        .assert();
    // The name may be refused, or be accepted and do no harm.
    assert!(matches!(baked.get_output().status.code(), Some(0 | 65)));
    std::fs::write(&anim, here(&scene.anim)).unwrap();
    bake(&groom, &anim, &out)
        .args(["--frames", "1001-1001", "--preroll", "0", "--overwrite"])
        .current_dir(folder)
        .assert()
        .success();
    let page = String::from_utf8(here(&out.join("report.html"))).unwrap();
    assert!(page.contains("alert(1)") && !page.contains("<script>alert"), "the title of the page");

    let mut plan = hairbake();
    plan.arg("plan").args([&groom, &anim]).arg("-o").arg(&out).args(["--format", "slurm"]);
    let script = folder.join("job.sh");
    std::fs::write(&script, &plan.assert().success().get_output().stdout).unwrap();
    // A fake sbatch that runs the task; hairbake is not on the path.
    let fake = "sbatch() { SLURM_ARRAY_TASK_ID=1 sh >&2; echo 1; }; export -f sbatch; bash job.sh";
    let ran = Command::new("bash").args(["-c", fake]).current_dir(folder).output().unwrap();
    assert!(String::from_utf8_lossy(&ran.stderr).contains("hairbake"), "no task was started");
    assert!(!entries(folder).contains(&"run".to_string()), "a name was run");
    hairbake()
        .arg("plan")
        .args([&groom, &anim])
        .arg("-o")
        .arg(&out)
        .args(["--format", "openjd"])
        .assert()
        .code(64);
}
