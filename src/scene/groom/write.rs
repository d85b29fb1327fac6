//! Writes a [`Groom`] as `groom.json` with its buffer.

use super::file::*;
use super::material_file::MaterialFile;
use super::model::{Curves, Groom, Tree};
use super::source::SourceCurves;
use crate::error::Result;
use crate::scene::json::packer::Packer;
use crate::scene::json::pretty::write_json;
use nalgebra::{UnitQuaternion, Vector3};
use std::path::Path;

impl Groom {
    /// Writes the groom, in its own unit and axes, as JSON at `path`. Long arrays go to a binary file that is named
    /// after it (`groom.json`, `groom.bin`): guides and wisps as f64, render strands as f32. Each file is written whole
    /// or not at all.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut packer = Packer::default();
        let mut file = self.to_file(&mut packer);
        file.buffers = packer.write(path)?;
        write_json(path, &file)
    }

    fn to_file(&self, packer: &mut Packer) -> GroomFile {
        GroomFile {
            format: GroomFormat::Groom,
            version: 1,
            name: Some(self.name.clone()),
            notes: self.notes.clone(),
            origin: self.origin.clone(),
            metres_per_unit: self.convention.metres_per_unit,
            up_axis: self.convention.up,
            buffers: Vec::new(),
            materials: self.materials.iter().map(MaterialFile::from).collect(),
            groups: self
                .groups
                .iter()
                .map(|g| GroupFile {
                    name: g.name.clone(),
                    material: MaterialRef::Index(g.material),
                    width_m: Some(g.width),
                })
                .collect(),
            guides: self.guides_file(packer),
            wisps: (!self.trees.is_empty()).then(|| self.wisps_file(packer)),
            strands: (!self.strands.curves.is_empty()).then(|| self.strands_file(packer)),
            source: self.source.as_ref().map(|source| source_file(source, packer)),
        }
    }

    fn guides_file(&self, packer: &mut Packer) -> GuidesFile {
        let curves = &self.guides.curves;
        GuidesFile {
            vertices: Some(vertices(curves, packer)),
            points: packer.array(self.lengths(&curves.points)),
            id: Some(packer.array(curves.id.clone())),
            group: Some(packer.array(curves.group.clone())),
            root_uv: Some(packer.array(root_uv(curves))),
            root_frame_wxyz: self
                .guides
                .root_frame
                .as_ref()
                .map(|frames| packer.array(frames.iter().map(|q| self.frame(q)).collect())),
            factors: {
                let [stiffness, damping, friction, drag, goal, goal_weight] =
                    self.guides.factors.each().map(|f| f.clone().map(|f| packer.array(f)));
                FactorsFile { stiffness, damping, friction, drag, goal, goal_weight }
            },
        }
    }

    fn strands_file(&self, packer: &mut Packer) -> StrandsFile {
        let curves = &self.strands.curves;
        let starts = self.tree_starts();
        // Without trees a leaf is (guide, 0).
        let start = |tree: u32| starts.get(tree as usize).copied().unwrap_or(tree);
        StrandsFile {
            vertices: Some(vertices(curves, packer)),
            points: packer.array_f32(self.lengths(&curves.points)),
            id: Some(packer.array(curves.id.clone())),
            group: Some(packer.array(curves.group.clone())),
            root_uv: Some(packer.array_f32(root_uv(curves))),
            wisp: packer.array(self.strands.leaf.iter().map(|&(tree, wisp)| start(tree) + wisp).collect()),
        }
    }

    fn wisps_file(&self, packer: &mut Packer) -> WispsFile {
        let starts = self.tree_starts();
        let all = || self.trees.iter().flat_map(|tree| &tree.wisps);
        let sections = || all().flat_map(|wisp| &wisp.sections);
        let unit = self.convention.metres_per_unit;
        let parent = self.trees.iter().zip(&starts).flat_map(|(tree, start)| {
            tree.wisps.iter().map(move |w| w.parent.map_or(-1, |p| (start + p) as i32))
        });
        let centres: Vec<_> = sections().map(|s| s.centre).collect();
        WispsFile {
            parent: packer.array(parent.collect()),
            length: packer.array(all().map(|w| w.length / unit).collect()),
            strand_count: packer.array(all().map(|w| w.strand_count).collect()),
            sections: packer.array(self.trees.iter().map(|t| t.arc.len() as u32).collect()),
            arc: packer.array(self.trees.iter().flat_map(|t| t.arc.iter().copied()).collect()),
            centre: packer.array(self.lengths(&centres)),
            frame_wxyz: packer.array(sections().map(|s| self.frame(&s.frame)).collect()),
            radius: packer.array(sections().map(|s| s.radius / unit).collect()),
            guide_count: packer.array(all().map(|w| w.guides.len() as u32).collect()),
            guides: packer.array(all().flat_map(|w| w.guides.iter().copied()).collect()),
        }
    }

    /// Index of the first wisp of each tree among all wisps.
    fn tree_starts(&self) -> Vec<u32> {
        let mut next = 0;
        let start = |tree: &Tree| {
            let start = next;
            next += tree.wisps.len() as u32;
            start
        };
        self.trees.iter().map(start).collect()
    }

    fn lengths(&self, points: &[Vector3<f64>]) -> Vec<[f64; 3]> {
        points.iter().map(|&p| self.convention.length_out(p).into()).collect()
    }

    fn frame(&self, q: &UnitQuaternion<f64>) -> [f64; 4] {
        let q = self.convention.frame_out(*q);
        [q.w, q.i, q.j, q.k]
    }
}

fn source_file(source: &SourceCurves, packer: &mut Packer) -> SourceFile {
    let prims = source.prims.iter().map(|prim| SourcePrimFile {
        path: prim.path.clone(),
        basis: prim.curve.basis,
        wrap: prim.curve.wrap,
        curves: prim.curves as u32,
        to_rest_m: std::array::from_fn(|row| std::array::from_fn(|column| prim.to_rest[(row, column)])),
    });
    let mut indices = |of: &[Option<u32>]| {
        let known = of.iter().any(Option::is_some);
        known.then(|| packer.array(of.iter().map(|curve| curve.map_or(-1, |curve| curve as i32)).collect()))
    };
    let (strands, guides) = (indices(&source.strands), indices(&source.guides));
    SourceFile {
        origin: source.origin.clone(),
        prims: prims.collect(),
        vertices: packer.array(source.vertices.clone()),
        length: source.length.clone().map(|length| packer.array(length)),
        strands,
        guides,
    }
}

fn vertices(curves: &Curves, packer: &mut Packer) -> Vertices {
    let counts: Vec<u32> = curves.offsets.windows(2).map(|w| (w[1] - w[0]) as u32).collect();
    match counts.first() {
        Some(&n) if counts.iter().all(|&c| c == n) => Vertices::All(n),
        _ => Vertices::Each(packer.array(counts)),
    }
}

fn root_uv(curves: &Curves) -> Vec<[f64; 2]> {
    curves.root_uv.iter().map(|uv| uv.map(f64::from)).collect()
}
