//! Writing one frame of 10,000 strands of 32 points with velocities (7.7 MB), and of 100,000 of 16 points (38
//! MB), compared to writing the bare bytes; and the cost of the checksum and of reading.
//!
//! Files go to the folder for temporary files, or to `HAIRBAKE_BENCH_DIR`: a memory disk measures the
//! program, a real disk the disk.

use divan::{Bencher, counter::BytesCount};
use hairbake::cache::{ClosestGuides, CurveFrame, CurveSet, Frame, Header, Reader, Writer, sha256};
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use tempfile::TempDir;

/// Number of strands, and of points per strand.
const SIZES: [(usize, usize); 2] = [(10_000, 32), (100_000, 16)];

fn main() {
    divan::main();
}

struct Shot {
    dir: TempDir,
    writer: Writer,
    frame: Frame,
}

impl Shot {
    fn new((curves, points): (usize, usize)) -> Self {
        let total = curves * points;
        let hair = CurveSet {
            counts: vec![points as i32; curves],
            rest: (0..total).map(|i| [i as f32 * 0.1, 1.0, (i % points) as f32]).collect(),
            arc: Vec::new(),
            widths: vec![0.008; total],
            id: (0..curves as i32).collect(),
            group: vec![0; curves],
            guide: vec![0; curves],
            group_name: vec!["hair".into(); curves],
            root_uv: vec![[0.5; 2]; curves],
            loose: Vec::new(),
            closest: ClosestGuides { guides: vec![0; 3 * curves], weights: vec![0.5; 3 * curves] },
        };
        let moving = CurveFrame {
            points: hair.rest.clone(),
            velocities: hair.rest.iter().map(|p| p.map(|x| 0.7 * x)).collect(),
            extent: [[0.0; 3], [1.0; 3]],
            level: None,
            ..CurveFrame::default()
        };
        let header = Header {
            metres_per_unit: 0.01,
            fps: 24.0,
            frames: (1001, 1001),
            hair: Some(hair),
            ..Header::default()
        };
        let frame = Frame { frame: 1001, hair: Some(moving), ..Frame::default() };
        let root = std::env::var_os("HAIRBAKE_BENCH_DIR").map_or_else(std::env::temp_dir, PathBuf::from);
        let dir = TempDir::new_in(root).unwrap();
        let writer = Writer::create(dir.path(), &header).unwrap();
        Shot { dir, writer, frame }
    }

    /// The bytes of the frame's file.
    fn bytes(&self) -> Vec<u8> {
        let file = self.writer.write_frame(std::slice::from_ref(&self.frame)).unwrap();
        std::fs::read(self.dir.path().join(file.file)).unwrap()
    }
}

#[divan::bench(args = SIZES)]
fn write_frame(bencher: Bencher, size: (usize, usize)) {
    let shot = Shot::new(size);
    let len = shot.bytes().len();
    bencher
        .counter(BytesCount::new(len))
        .bench(|| shot.writer.write_frame(std::slice::from_ref(&shot.frame)).unwrap());
}

/// Writes the same bytes to a new file, synced and renamed, without the cache.
#[divan::bench(args = SIZES)]
fn raw_write(bencher: Bencher, size: (usize, usize)) {
    let shot = Shot::new(size);
    let bytes = shot.bytes();
    let [temp, path] = ["raw.tmp", "raw"].map(|name| shot.dir.path().join(name));
    bencher.counter(BytesCount::new(bytes.len())).bench(|| {
        let mut file = File::create(&temp).unwrap();
        file.write_all(&bytes).unwrap();
        file.sync_all().unwrap();
        std::fs::rename(&temp, &path).unwrap();
    });
}

#[divan::bench(args = SIZES)]
fn checksum(bencher: Bencher, size: (usize, usize)) {
    let bytes = Shot::new(size).bytes();
    bencher.counter(BytesCount::new(bytes.len())).bench(|| sha256(&bytes));
}

#[divan::bench(args = SIZES)]
fn read_frame(bencher: Bencher, size: (usize, usize)) {
    let shot = Shot::new(size);
    let len = shot.bytes().len();
    let reader = Reader::open(shot.dir.path()).unwrap();
    bencher.counter(BytesCount::new(len)).bench(|| reader.read_frame(1001).unwrap());
}
