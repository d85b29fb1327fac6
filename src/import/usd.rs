//! USD files, read by Pixar's own library: composition needs it. `pipeline/hairbake_usd` reads a stage, and hands over what it found as a
//! header in JSON and plain arrays, in the file's unit and axes.

use super::motion::{Motion, SCALE_CHANGES, rigid_all};
use super::read::{Own, PlainGroup, PlainMesh, PlainStrands, Source};
use crate::python::{Package, python_package};
use crate::scene::{Convention, Curves, Factors, TriMesh, UpAxis};
use crate::{Diagnostic, Error, Result};
use nalgebra::{Matrix4, Vector3};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::ffi::OsStr;
use std::path::Path;

const PACKAGE: Package = python_package!(
    "pipeline",
    "hairbake_usd",
    [
        "__init__.py",
        "__main__.py",
        "curves.py",
        "exchange.py",
        "faults.py",
        "groom.py",
        "mesh.py",
        "motion.py",
        "stage.py"
    ]
);

/// Exit code of the package for a file that is faulty.
const FAULTY: i32 = 2;

/// Whether a file is USD, by its ending.
pub(super) fn is_usd(path: &Path) -> bool {
    let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    matches!(ending.as_str(), "usd" | "usda" | "usdc" | "usdz")
}

/// What every header has: unit, up axis and notes; and the arrays in the order in which they lie in the data.
#[derive(Debug, Deserialize)]
struct Header<T> {
    metres_per_unit: Option<f64>,
    up: Option<UpAxis>,
    notes: Vec<String>,
    arrays: Vec<Listed>,
    #[serde(flatten)]
    more: T,
}

#[derive(Debug, Deserialize)]
struct Listed {
    name: String,
    #[serde(rename = "type")]
    kind: Kind,
    count: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    F32,
    F64,
    I32,
    U32,
}

impl Kind {
    fn bytes(self) -> usize {
        if self == Kind::F64 { 8 } else { 4 }
    }
}

/// Header and data of one read.
struct Exchange<T> {
    header: Header<T>,
    data: Vec<u8>,
}

#[derive(Debug, Deserialize)]
struct Faulty {
    faults: Vec<Fault>,
}

#[derive(Debug, Deserialize)]
struct Fault {
    key: String,
    what: String,
    allowed: String,
    remedy: String,
}

impl<T: DeserializeOwned> Exchange<T> {
    /// Has the package read `what` from a file; `options` are its own.
    fn read(what: &str, source: &Source, options: &[String]) -> Result<Self> {
        let path = &source.path;
        // What the system says of a file that is not there is plainer than what USD does.
        std::fs::File::open(path).map_err(|e| Error::io(path, e))?;
        let folder = tempfile::tempdir().map_err(|e| Error::io(std::env::temp_dir(), e))?;
        let mut run = PACKAGE.prepare()?;
        run.command.arg(what).arg(path).arg("--out").arg(folder.path()).args(options);
        if let Some(prim) = &source.prim {
            run.command.arg(format!("--prim={prim}"));
        }
        if let Some(time) = source.time {
            run.command.arg(format!("--time={time}"));
        }
        let output = run.command.output().map_err(|e| Error::io(&run.python, e))?;
        let at = |name: &str| folder.path().join(name);
        let bytes = |name: &str| crate::file::read_file(&at(name)).map_err(|e| Error::io(at(name), e));
        let broken = |e: serde_json::Error| {
            Error::Internal(format!("the reader of USD wrote a header that is none: {e}"))
        };
        match output.status.code() {
            Some(0) => Ok(Exchange {
                header: serde_json::from_slice(&bytes("header.json")?).map_err(broken)?,
                data: bytes("data.bin")?,
            }),
            Some(FAULTY) => {
                let Faulty { faults } = serde_json::from_slice(&bytes("header.json")?).map_err(broken)?;
                let problem = |f: Fault| Diagnostic::new(path, f.key, f.what, f.allowed, f.remedy);
                Err(Error::BadInput(faults.into_iter().map(problem).collect()))
            }
            _ => {
                let said = String::from_utf8_lossy(&output.stderr);
                let last = said.trim_end().lines().last().unwrap_or_default();
                Err(Error::Internal(format!(
                    "{}: the reader of USD ended with {}: {last}",
                    path.display(),
                    output.status
                )))
            }
        }
    }

    /// The numbers of an array, `N` bytes each; `None` where there is no such array.
    fn array<const N: usize, X>(&self, name: &str, kind: Kind, number: fn([u8; N]) -> X) -> Option<Vec<X>> {
        let arrays = &self.header.arrays;
        let index = arrays.iter().position(|a| a.name == name && a.kind == kind)?;
        let start: usize = arrays[..index].iter().map(|a| a.count * a.kind.bytes()).sum();
        let bytes = self.data.get(start..start + arrays[index].count * kind.bytes())?;
        Some(bytes.as_chunks::<N>().0.iter().map(|b| number(*b)).collect())
    }

    fn f64s(&self, name: &str) -> Option<Vec<f64>> {
        self.array(name, Kind::F64, f64::from_le_bytes)
    }

    fn u32s(&self, name: &str) -> Option<Vec<u32>> {
        self.array(name, Kind::U32, u32::from_le_bytes)
    }
}

/// An array that the package always writes.
fn need<X>(array: Option<X>, name: &str) -> Result<X> {
    array.ok_or_else(|| Error::Internal(format!("the reader of USD wrote no {name}")))
}

#[derive(Debug, Deserialize)]
struct StrandsHeader {
    groups: Vec<String>,
}

/// What `n` curves have of their own; none where the file has nothing of the kind.
fn own(read: &Exchange<StrandsHeader>, n: usize) -> Vec<Own> {
    let (length, clump) = (read.f64s("length"), read.array("clump", Kind::I32, i32::from_le_bytes));
    let factors = Factors::NAMES.map(|name| read.f64s(name));
    if length.is_none() && clump.is_none() && factors.iter().all(Option::is_none) {
        return Vec::new();
    }
    let at = |of: &Option<Vec<f64>>, c: usize| of.as_ref().map_or(1.0, |of| of[c]);
    let own = |c: usize| Own {
        length: at(&length, c),
        factors: factors.each_ref().map(|of| at(of, c)),
        // One that is of none has a negative number.
        clump: clump.as_ref().map(|clump| clump[c]).filter(|clump| *clump >= 0),
    };
    (0..n).map(own).collect()
}

/// The strands at and below a prim, evaluated to points, with their ids, groups, root coordinates and widths.
///
/// # Errors
/// Every fault of the file that was found; [`Error::Config`] without a Python that has usd-core.
pub(super) fn strands(source: &Source) -> Result<PlainStrands> {
    let read = Exchange::<StrandsHeader>::read("strands", source, &[])?;
    let points = need(read.f64s("points"), "points")?;
    let counts = need(read.u32s("counts"), "counts")?;
    let root_uv = need(read.array("root_uv", Kind::F32, f32::from_le_bytes), "root_uv")?;
    let group = need(read.u32s("group"), "group")?;
    let guide: Vec<bool> = need(read.u32s("guide"), "guide")?.iter().map(|&flag| flag != 0).collect();
    let mut offsets = vec![0];
    offsets.extend(counts.iter().scan(0, |sum, n| {
        *sum += *n as usize;
        Some(*sum)
    }));
    let widths = read.f64s("width");
    let own = own(&read, counts.len());
    let groups = read.header.more.groups.iter().enumerate().map(|(g, name)| PlainGroup {
        name: name.clone(),
        width: widths.as_ref().and_then(|all| mean_width(all.as_chunks().0, &group, &guide, g as u32)),
    });
    Ok(PlainStrands {
        groups: groups.collect(),
        curves: Curves {
            offsets,
            points: places(&points),
            id: need(read.array("id", Kind::I32, i32::from_le_bytes), "id")?,
            group,
            root_uv: root_uv.as_chunks().0.to_vec(),
        },
        guide,
        own,
        notes: read.header.notes,
        metres_per_unit: read.header.metres_per_unit,
        up: read.header.up,
    })
}

/// Numbers in threes.
fn places(numbers: &[f64]) -> Vec<Vector3<f64>> {
    numbers.as_chunks().0.iter().map(|&p: &[f64; 3]| p.into()).collect()
}

#[derive(Debug, Deserialize)]
struct MeshHeader {}

/// Time codes at which a mesh is wanted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Times {
    /// The first.
    pub(super) start: f64,
    /// From one to the next.
    pub(super) step: f64,
    /// How many.
    pub(super) count: usize,
    /// Path of a prim of the same file; a mesh that goes along with it does not move by itself.
    pub(super) carrier: Option<String>,
}

/// The meshes at and below a prim as one, as it is at rest, and at `times` if it moves by itself.
///
/// # Errors
/// As [`strands`].
pub(super) fn mesh(source: &Source, times: Option<&Times>) -> Result<PlainMesh> {
    let mut options = Vec::new();
    if let Some(Times { start, step, count, carrier }) = times {
        options.push(format!("--times={start},{step},{count}"));
        options.extend(carrier.iter().map(|prim| format!("--carrier={prim}")));
    }
    let read = Exchange::<MeshHeader>::read("mesh", source, &options)?;
    let vertices = places(&need(read.f64s("vertices"), "vertices")?);
    let triangles = need(read.u32s("triangles"), "triangles")?.as_chunks().0.to_vec();
    let moving = read.f64s("moving").unwrap_or_default();
    Ok(PlainMesh {
        moving: places(&moving).chunks(vertices.len().max(1)).map(<[_]>::to_vec).collect(),
        mesh: TriMesh { file: source.path.clone(), vertices, triangles },
        metres_per_unit: read.header.metres_per_unit,
        up: read.header.up,
        notes: read.header.notes,
    })
}

#[derive(Debug, Deserialize)]
struct MotionHeader {
    /// The prim that was followed.
    prim: String,
    /// Time codes a second.
    rate: f64,
    /// Time code of the first sample, and from one to the next.
    start: f64,
    step: f64,
}

/// The motion of a prim, or of a joint of a skeleton at or below it. Without a unit in the stage it is USD's own, centimetres.
///
/// # Errors
/// As [`strands`].
pub(super) fn motion(source: &Source, joint: Option<&str>) -> Result<Motion> {
    let options: Vec<String> = joint.iter().map(|name| format!("--joint={name}")).collect();
    let read = Exchange::<MotionHeader>::read("motion", source, &options)?;
    let matrices = |numbers: &[f64]| -> Vec<Matrix4<f64>> {
        numbers.as_chunks::<16>().0.iter().map(|rows| Matrix4::from_row_slice(rows)).collect()
    };
    let over_time = matrices(&need(read.f64s("matrix"), "matrix")?);
    let rest = matrices(&need(read.f64s("rest"), "rest")?);
    let Header { metres_per_unit, up, mut notes, more: MotionHeader { prim, rate, start, step }, .. } =
        read.header;
    let (poses, bind, scales) = rigid_all(source, &prim, &over_time, rest.first())?;
    let given = source.metres_per_unit.or(metres_per_unit);
    if given.is_none() {
        notes.push(
            "the stage has no metersPerUnit: USD's own, centimetres, is taken (--units for another)".into(),
        );
    }
    Ok(Motion {
        rate: rate / step,
        numbered: Some((start, rate)),
        convention: Convention {
            metres_per_unit: given.unwrap_or(0.01),
            up: source.up.or(up).unwrap_or_default(),
        },
        poses,
        bind,
        prim: Some(prim),
        notes,
        warnings: if scales { vec![SCALE_CHANGES.into()] } else { Vec::new() },
    })
}

/// Mean width at root and tip of the curves of a group, of its guides only where it has nothing else; `None` where it has no width.
fn mean_width(widths: &[[f64; 2]], group: &[u32], guide: &[bool], wanted: u32) -> Option<[f64; 2]> {
    let mean = |guides: bool| {
        let of_group: Vec<_> =
            (0..widths.len()).filter(|&c| group[c] == wanted && guide[c] == guides).collect();
        let mean =
            [0, 1].map(|end| of_group.iter().map(|&c| widths[c][end]).sum::<f64>() / of_group.len() as f64);
        (mean[0] > 0.0).then_some(mean)
    };
    mean(false).or_else(|| mean(true))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_module_of_the_reader_is_missing() {
        crate::python::assert_whole("pipeline", &PACKAGE);
    }

    #[test]
    fn endings_of_usd() {
        for (name, is) in
            [("a.usd", true), ("a.USDA", true), ("a.usdc", true), ("a.usdz", true), ("usd", false)]
        {
            assert_eq!(is_usd(Path::new(name)), is, "{name}");
        }
    }

    #[test]
    fn widths_are_averaged_by_group() {
        let widths = [[1.0, 0.5], [3.0, 1.5], [9.0, 9.0], [5.0, 5.0]];
        let mean = |group: &[u32; 4], wanted| mean_width(&widths, group, &[false, false, true, true], wanted);
        assert_eq!(mean(&[0, 0, 0, 1], 0), Some([2.0, 1.0]));
        assert_eq!(mean(&[0, 0, 0, 1], 1), Some([5.0, 5.0]));
        assert_eq!(mean(&[0; 4], 1), None);
        assert_eq!(mean_width(&[[0.0, 0.0]], &[0], &[false], 0), None);
    }
}
