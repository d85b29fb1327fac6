//! Curves in Wavefront OBJ files: the elements `l`.

use super::convention::Convention;
use crate::file::read_file;
use nalgebra::Vector3;
use std::fmt::Write;
use std::path::Path;

/// The curves of an OBJ file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ObjCurves {
    /// Start of each curve in `points`, then the number of points.
    pub offsets: Vec<usize>,
    /// Points, m, Y up.
    pub points: Vec<Vector3<f64>>,
}

impl ObjCurves {
    /// Number of curves.
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Reads the curves of a file whose lengths and axes follow `convention`, in its order.
    ///
    /// # Errors
    /// What is wrong, in words that follow the name of the file.
    pub fn load(path: &Path, convention: &Convention) -> Result<Self, String> {
        let bytes = read_file(path).map_err(|e| format!("cannot be read: {e}"))?;
        let text = std::str::from_utf8(&bytes).map_err(|_| "is not a text file".to_string())?;
        let mut vertices: Vec<Vector3<f64>> = Vec::new();
        let mut curves = ObjCurves { offsets: vec![0], points: Vec::new() };
        for (number, line) in text.lines().enumerate() {
            let mut words = line.split_ascii_whitespace();
            let wrong = |what: &str| format!("is not a valid OBJ file: line {}: {what}", number + 1);
            match words.next() {
                Some("v") => {
                    let mut coordinate = || words.next()?.parse().ok().filter(|x: &f64| x.is_finite());
                    let mut vertex = || Some(Vector3::new(coordinate()?, coordinate()?, coordinate()?));
                    let vertex = vertex().ok_or_else(|| wrong("a vertex needs three finite numbers"))?;
                    vertices.push(convention.length_in(vertex));
                }
                Some("l") => {
                    let first = curves.points.len();
                    for word in words {
                        let index = word.split('/').next().unwrap_or_default().parse::<i64>().unwrap_or(0);
                        // Negative numbers count from the last vertex.
                        let index = if index < 0 { index + vertices.len() as i64 } else { index - 1 };
                        let vertex = usize::try_from(index).ok().and_then(|i| vertices.get(i));
                        curves
                            .points
                            .push(*vertex.ok_or_else(|| wrong(&format!("there is no vertex {word}")))?);
                    }
                    if curves.points.len() < first + 2 {
                        return Err(wrong("a curve needs two points or more"));
                    }
                    curves.offsets.push(curves.points.len());
                }
                _ => {}
            }
        }
        if curves.len() == 0 { Err("holds no curve, an element `l`".into()) } else { Ok(curves) }
    }

    /// The curves as Wavefront OBJ in the unit of their points, with `digits` decimal places.
    pub fn to_obj(&self, digits: usize) -> String {
        let mut out = String::new();
        // Writing to a string does not fail.
        for p in &self.points {
            let _ = writeln!(out, "v {:.digits$} {:.digits$} {:.digits$}", p.x, p.y, p.z);
        }
        for ends in self.offsets.windows(2) {
            out.push('l');
            (ends[0]..ends[1]).for_each(|i| {
                let _ = write!(out, " {}", i + 1);
            });
            out.push('\n');
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(text: &str) -> Result<ObjCurves, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        ObjCurves::load(file.path(), &Convention::default())
    }

    #[test]
    fn curves_are_read_as_they_are_written() {
        let points =
            vec![Vector3::x(), Vector3::y(), Vector3::z() * 0.5, Vector3::zeros(), Vector3::x() * 2.0];
        let curves = ObjCurves { offsets: vec![0, 3, 5], points };
        assert_eq!(load(&curves.to_obj(9)).unwrap(), curves);
        // Shared vertices, in any order, counted from the end, with texture coordinates.
        let shared = load("v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1/1 2/2\nl -3 3\n").unwrap();
        assert_eq!(shared.points[2..], [Vector3::zeros(), Vector3::y()]);
    }

    #[test]
    fn errors_name_the_line() {
        for (text, what) in [
            ("v 0 0 0\nv 1 0 0\n", "holds no curve"),
            ("v 0 0 0\nv 1 0 x\nl 1 2\n", "line 2"),
            ("v 0 0 0\nv nan 0 0\nl 1 2\n", "line 2"),
            ("v 0 0 0\nl 1 2\n", "there is no vertex 2"),
            ("v 0 0 0\nl 1\n", "two points"),
        ] {
            let error = load(text).unwrap_err();
            assert!(error.contains(what), "{error}");
        }
    }
}
