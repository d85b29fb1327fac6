//! Unfinished and damaged caches, and failures of writing.

use super::sample;
use hairbake::Error;
use hairbake::cache::{
    FrameEntry, Header, Manifest, Reader, TOPOLOGY, Writer, frame_file_name, mark_unfinished, write_file,
};
use proptest::prelude::*;
use std::path::Path;
use std::sync::LazyLock;

/// Sorted file names of a folder.
fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn write_frames(writer: &Writer, header: &Header) -> Manifest {
    let mut manifest = Manifest::new(header);
    let frames: Vec<i32> = (header.frames.0 - 1..=header.frames.1 + 1).collect();
    // One thread per frame.
    let files: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = frames
            .iter()
            .map(|&frame| scope.spawn(move || writer.write_frame(&[sample::frame(header, frame)]).unwrap()))
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    // Last frame first: the manifest sorts them.
    for (&frame, file) in frames.iter().zip(files).rev() {
        manifest.frames.push(FrameEntry { frame, file, over: None, figures: Default::default() });
    }
    manifest
}

fn write_cache(dir: &Path, header: &Header) -> Manifest {
    let writer = Writer::create(dir, header).unwrap();
    let manifest = write_frames(&writer, header);
    writer.finish(manifest).unwrap()
}

#[test]
fn caches_are_reproducible_to_the_byte() {
    let header = sample::header(true);
    let [a, b] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    assert_eq!(write_cache(a.path(), &header), write_cache(b.path(), &header));
    assert_eq!(names(a.path()), names(b.path()));
    assert_eq!(names(a.path()).len(), 3 + 5 + 1);
    for name in names(a.path()) {
        let [first, second] = [&a, &b].map(|dir| std::fs::read(dir.path().join(&name)).unwrap());
        assert_eq!(first, second, "{name}");
    }
}

#[test]
fn shorter_bake_removes_only_frames_outside_its_range() {
    let dir = tempfile::tempdir().unwrap();
    let long = Header { frames: (1001, 1006), ..sample::header(true) };
    write_cache(dir.path(), &long);
    std::fs::write(dir.path().join("notes.txt"), "not ours").unwrap();
    mark_unfinished(dir.path()).unwrap();
    let left = names(dir.path());
    assert!(!left.iter().any(|name| name == "manifest.json" || name == "hair.usda"));
    let reader = Reader::open(dir.path()).unwrap();
    assert!(matches!(reader.read_manifest(), Err(Error::Io { .. })));

    let writer = Writer::create(dir.path(), &sample::header(true)).unwrap();
    let mut manifest = write_frames(&writer, &sample::header(true));
    writer.finish(manifest.clone()).unwrap();
    assert_eq!(Reader::open(dir.path()).unwrap().frames(), [1000, 1001, 1002, 1003, 1004]);
    assert!(names(dir.path()).contains(&"notes.txt".to_string()));

    let writer = Writer::create(dir.path(), &sample::header(true)).unwrap();
    manifest.frames.pop();
    assert!(matches!(writer.finish(manifest), Err(Error::Internal(_))), "a frame is not in the manifest");
}

#[test]
fn inconsistent_arrays_are_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let good = sample::header(true);
    let mut header = good.clone();
    header.guides.widths.pop();
    assert!(matches!(Writer::create(dir.path(), &header), Err(Error::Internal(_))));
    assert_eq!(names(dir.path()), [""; 0]);

    let writer = Writer::create(dir.path(), &good).unwrap();
    let frame = sample::frame(&good, 1001);
    let mut short = frame.clone();
    short.guides.velocities.pop();
    let mut without_hair = frame.clone();
    without_hair.hair = None;
    let mut without_head = frame.clone();
    without_head.colliders.pop();
    let mut stiff = frame.clone();
    stiff.colliders[1].points = None;
    let mut torn = frame.clone();
    torn.colliders[1].points.as_mut().unwrap().pop();
    let mut soft = frame.clone();
    soft.colliders[0].points = soft.colliders[1].points.clone();
    let outside = sample::frame(&good, 1005);
    let mut late = frame.clone();
    late.offset = 0.5;
    assert!(matches!(
        writer.write_frame(&[frame.clone(), late.clone(), late.clone()]),
        Err(Error::Internal(_))
    ));
    assert!(matches!(writer.write_frame(&[]), Err(Error::Internal(_))));
    for wrong in [short, without_hair, without_head, stiff, torn, soft, outside, late] {
        assert!(
            matches!(writer.write_frame(std::slice::from_ref(&wrong)), Err(Error::Internal(_))),
            "frame {}",
            wrong.frame
        );
    }
    assert_eq!(Reader::open(dir.path()).unwrap().frames(), [0; 0]);
}

#[test]
fn failed_write_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    // A folder at the path: the temporary file is complete when renaming fails.
    let blocked = dir.path().join("hair.1001.usdc");
    std::fs::create_dir(&blocked).unwrap();
    match write_file(&blocked, &[b"bytes"]) {
        Err(Error::Io { path, .. }) => assert_eq!(path, blocked),
        other => panic!("{other:?}"),
    }
    assert_eq!(names(dir.path()), ["hair.1001.usdc"]);

    let nowhere = dir.path().join("missing").join("file");
    assert!(matches!(write_file(&nowhere, &[b"bytes"]), Err(Error::Io { path, .. }) if path == nowhere));
    let under_a_file = dir.path().join("file");
    std::fs::write(&under_a_file, "").unwrap();
    assert!(matches!(Writer::create(&under_a_file, &sample::header(true)), Err(Error::Io { .. })));
}

#[cfg(target_os = "linux")]
#[test]
fn full_disk_leaves_no_partial_file() {
    use std::process::Command;
    // The test runs itself again on a disk of 64 KiB in its own mount namespace.
    const SMALL_DISK: &str = "HAIRBAKE_TEST_SMALL_DISK";
    if let Some(dir) = std::env::var_os(SMALL_DISK) {
        let path = Path::new(&dir).join("large");
        std::fs::write(&path, "what was there before").unwrap();
        match write_file(&path, &[vec![1; 1 << 20]]) {
            Err(Error::Io { source, .. }) => assert_eq!(source.kind(), std::io::ErrorKind::StorageFull),
            other => panic!("{other:?}"),
        }
        assert_eq!(names(Path::new(&dir)), ["large"]);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "what was there before");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let in_namespace = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "sh", "-c", script, "sh"]).arg(dir.path());
        command.arg(std::env::current_exe().unwrap()).env(SMALL_DISK, dir.path());
        command.output()
    };
    let mount = "mount -t tmpfs -o size=64k tmpfs \"$1\"";
    if !in_namespace(mount).is_ok_and(|output| output.status.success()) {
        println!("skipped: no file system can be mounted here");
        return;
    }
    let output = in_namespace(&format!(
        "{mount} && exec \"$2\" --exact usd::faults::full_disk_leaves_no_partial_file"
    ))
    .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    assert!(String::from_utf8_lossy(&output.stdout).contains("1 passed"));
}

#[test]
fn missing_and_truncated_frames_are_distinguished() {
    let dir = tempfile::tempdir().unwrap();
    write_cache(dir.path(), &sample::header(true));
    let path = dir.path().join(frame_file_name(1002));
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let reader = Reader::open(dir.path()).unwrap();
    assert!(matches!(reader.read_frame(1002), Err(Error::Damaged { .. })));
    assert!(matches!(reader.read_frame(1009), Err(Error::Io { .. })));
    // The file of another frame has no sample at this one.
    std::fs::copy(dir.path().join(frame_file_name(1003)), &path).unwrap();
    assert!(matches!(reader.read_frame(1002), Err(Error::Damaged { .. })));
}

/// The bytes of a topology and of frame 1, to be damaged.
static CACHE: LazyLock<[(String, Vec<u8>); 2]> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let header = Header { frames: (1, 1), ..sample::header(true) };
    Writer::create(dir.path(), &header).unwrap().write_frame(&[sample::frame(&header, 1)]).unwrap();
    [TOPOLOGY.to_string(), frame_file_name(1)].map(|name| {
        let bytes = std::fs::read(dir.path().join(&name)).unwrap();
        (name, bytes)
    })
});

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn damaged_cache_is_read_or_an_error_but_never_panics(
        damaged_file in 0..2usize,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let dir = tempfile::tempdir().unwrap();
        for (file, (name, bytes)) in CACHE.iter().enumerate() {
            let mut bytes = bytes.clone();
            for (index, byte) in damage.iter().filter(|_| file == damaged_file) {
                let index = index.index(bytes.len());
                bytes[index] = *byte;
            }
            std::fs::write(dir.path().join(name), bytes).unwrap();
        }
        let read = Reader::open(dir.path()).and_then(|reader| reader.read_frame(1));
        prop_assert!(matches!(read, Ok(_) | Err(Error::Damaged { .. })), "{:?}", read);
    }
}
