//! `groom.json` to a [`Groom`]: faults of meaning, units and axes.

mod curves;
mod wisps;

use super::file::*;
use super::{Curves, Factors, Groom, Group, Guides, Material, RodSection, Strands};
use crate::geometry::Friction;
use crate::scene::Convention;
use crate::scene::document::array::{Array, Buffers, Element};
use crate::scene::document::{Document, Faults, Key, MAX_NAMED};
use curves::CurvesFile;
use nalgebra::{UnitQuaternion, Vector3};

/// Sections of the file and those that they build on.
pub const DEPENDS: &[(&str, &str)] = &[
    ("groups", "materials"),
    ("guides", "buffers"),
    ("guides", "groups"),
    ("wisps", "buffers"),
    ("wisps", "guides"),
    ("strands", "buffers"),
    ("strands", "groups"),
    ("strands", "guides"),
    ("strands", "wisps"),
];

/// The groom that `file` describes; `None` only where faults were noted.
pub fn groom(file: GroomFile, stem: &str, doc: &mut Document) -> Option<Groom> {
    let folder = doc.folder();
    let faults = &mut doc.faults;
    let convention = Convention { metres_per_unit: file.metres_per_unit, up: file.up_axis };
    let buffers = Buffers::read(&file.buffers, &folder, faults);
    let materials = materials(&file.materials, faults);
    let groups = groups(&file.groups, &materials, faults);
    let mut reader = Reader { convention, buffers, groups: groups.len(), faults };

    let root_frame_wxyz = file.guides.root_frame_wxyz;
    let guides = reader.curves(
        "guides",
        CurvesFile {
            vertices: file.guides.vertices,
            points: file.guides.points,
            id: file.guides.id,
            group: file.guides.group,
            root_uv: file.guides.root_uv,
        },
    );
    let guide_count = guides.as_ref().map(Curves::len);
    let root_frame = root_frame_wxyz.map(|frames| {
        let frames = reader.frames("guides.root_frame_wxyz", frames)?;
        let wanted = guide_count.unwrap_or(frames.len());
        let ok = reader.faults.expect_len(&Key::at("guides.root_frame_wxyz"), frames.len(), wanted, "guide");
        ok.then_some(frames)
    });
    let factors = reader.factors(file.guides.factors, guide_count);
    if let Some(guides) = &guides {
        reader.extent(guides);
    }
    let trees = match file.wisps {
        Some(wisps) => reader.wisps(wisps, guide_count),
        None => Some(Vec::new()),
    };
    let strands = match file.strands {
        Some(strands) => reader.strands(strands, trees.as_deref(), guide_count),
        None => Some(Strands::default()),
    };
    Some(Groom {
        name: file.name.unwrap_or_else(|| stem.into()),
        notes: file.notes,
        convention,
        materials,
        groups,
        guides: Guides {
            curves: guides?,
            root_frame: root_frame.map_or(Some(None), |f| f.map(Some))?,
            factors: factors?,
        },
        trees: trees?,
        strands: strands?,
    })
}

fn materials(files: &[MaterialFile], faults: &mut Faults) -> Vec<Material> {
    for (i, file) in files.iter().enumerate() {
        if files[..i].iter().any(|other| other.name == file.name) {
            let key = Key::at("materials").index(i).name("name");
            faults.add(&key, format!("\"{}\" names two materials", file.name), "unique names", "rename one");
        }
    }
    if files.is_empty() { vec![Material::default()] } else { files.iter().map(Material::from).collect() }
}

fn groups(files: &[GroupFile], materials: &[Material], faults: &mut Faults) -> Vec<Group> {
    let width = |m: &Material| [2.0 * m.section.a1.max(m.section.a2); 2];
    let group = |(i, file): (usize, &GroupFile)| {
        let found = match &file.material {
            MaterialRef::Index(index) => Some(*index as usize).filter(|&index| index < materials.len()),
            MaterialRef::Name(name) => materials.iter().position(|m| m.name == *name),
        };
        if found.is_none() {
            let names: Vec<String> = materials.iter().map(|m| format!("\"{}\"", m.name)).collect();
            let what = match &file.material {
                MaterialRef::Index(index) => format!("is {index}"),
                MaterialRef::Name(name) => format!("is \"{name}\""),
            };
            let allowed = format!("an index below {} or one of {}", materials.len(), names.join(", "));
            faults.add(
                &Key::at("groups").index(i).name("material"),
                what,
                allowed,
                "name a material of this file",
            );
        }
        let material = found.unwrap_or(0);
        Group {
            name: file.name.clone(),
            material: material as u32,
            width: file.width_m.unwrap_or_else(|| width(&materials[material])),
        }
    };
    if files.is_empty() {
        return vec![Group { name: "hair".into(), material: 0, width: width(&materials[0]) }];
    }
    files.iter().enumerate().map(group).collect()
}

impl From<&MaterialFile> for Material {
    fn from(file: &MaterialFile) -> Self {
        Material {
            name: file.name.clone(),
            young_modulus: file.young_modulus_pa,
            shear_modulus: file.shear_modulus_pa,
            density: file.density_kg_m3,
            section: match file.section {
                SectionFile::Round { radius_m } => RodSection { a1: radius_m, a2: radius_m },
                SectionFile::Elliptic { semi_axes_m: [a1, a2] } => RodSection { a1, a2 },
            },
            natural: file.natural_curvature_per_m.map(Vector3::from),
            sag_free: file.sag_free,
            stiffness_at_tip: file.stiffness_at_tip,
            radius_at_tip: file.radius_at_tip,
            goal: file.goal_hz,
            damping: file.damping_s,
            damping_at_tip: file.damping_at_tip,
            friction: Friction::new(file.friction, file.static_friction),
            friction_at_tip: file.friction_at_tip,
            friction_across: file.friction_across,
            friction_parallel: file.friction_parallel,
            cohesion: file.cohesion_n_m,
            clumping: file.clumping,
            wisp_friction: file.wisp_friction_per_s,
            drag: file.drag,
            shielding: file.shielding,
        }
    }
}

struct Reader<'a> {
    convention: Convention,
    buffers: Buffers,
    /// Number of groups.
    groups: usize,
    faults: &'a mut Faults,
}

impl Reader<'_> {
    fn load<T: Element>(&mut self, key: &str, array: Array<T>) -> Option<Vec<T>> {
        self.buffers.load(array, &Key::at(key), self.faults)
    }

    /// An array with one element a curve.
    fn per_curve<T: Element>(&mut self, key: &Key, array: Array<T>, n: Option<usize>) -> Option<Vec<T>> {
        let elements = self.buffers.load(array, key, self.faults)?;
        let wanted = n.unwrap_or(elements.len());
        self.faults.expect_len(key, elements.len(), wanted, "curve").then_some(elements)
    }

    /// Factors of `guides` guides.
    fn factors(&mut self, file: FactorsFile, guides: Option<usize>) -> Option<Factors> {
        let FactorsFile { stiffness, damping, friction, drag, goal } = file;
        let mut named = Factors::NAMES.into_iter();
        let read = [stiffness, damping, friction, drag, goal].map(|array| {
            let name = named.next().unwrap_or_default();
            let key = Key::at("guides.factors").name(name);
            let Some(array) = array else { return Some(None) };
            let factors = self.per_curve(&key, array, guides)?;
            // What has no stiffness is no rod.
            let least = if name == "stiffness" { 1e-3 } else { 0.0 };
            let wrong = factors.iter().enumerate().filter(|(_, f)| !(least..=1e3).contains(*f));
            let named: Vec<_> = wrong.take(MAX_NAMED).collect();
            for (i, f) in &named {
                let allowed = format!("{least} to 1000");
                self.faults.add(&key.index(*i), format!("is {f}"), allowed, "correct the factor");
            }
            named.is_empty().then_some(Some(factors))
        });
        let [a, b, c, d, e] = read;
        Some(Factors::of([a?, b?, c?, d?, e?]))
    }

    /// Indices below `n`.
    fn in_range(&mut self, key: &Key, indices: &[u32], n: usize, of: &str) -> bool {
        let bad = || indices.iter().enumerate().filter(|(_, i)| **i as usize >= n);
        for (at, i) in bad().take(MAX_NAMED) {
            let allowed = format!("index of a {of}, below {n}");
            self.faults.add(&key.index(at), format!("is {i}"), allowed, "correct the index");
        }
        bad().next().is_none()
    }

    /// Unit quaternions turned to Y up.
    fn frames(&mut self, key: &str, array: Array<[f64; 4]>) -> Option<Vec<UnitQuaternion<f64>>> {
        let convention = self.convention;
        let frames = self.load(key, array)?;
        let quaternions = self.faults.unit_quaternions(&Key::at(key), &frames)?;
        Some(quaternions.into_iter().map(|q| convention.frame_in(q)).collect())
    }
}
