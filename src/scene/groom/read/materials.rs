//! Materials and groups.

use crate::scene::groom::file::{GroupFile, MaterialRef};
use crate::scene::groom::material_file::MaterialFile;
use crate::scene::groom::model::{Group, Material};
use crate::scene::json::diagnostics::Diagnostics;
use crate::scene::json::key::Key;

/// The materials; human hair if there are none.
pub fn materials(files: &[MaterialFile], diagnostics: &mut Diagnostics) -> Vec<Material> {
    for (i, file) in files.iter().enumerate() {
        if files[..i].iter().any(|other| other.name == file.name) {
            let key = Key::at("materials").index(i).name("name");
            let message = format!("duplicate name \"{}\"", file.name);
            diagnostics.add(&key, message, "a unique name per material", "rename one of them");
        }
    }
    if files.is_empty() { vec![Material::default()] } else { files.iter().map(Material::from).collect() }
}

/// The groups; one, of the first material, if there are none.
pub fn groups(files: &[GroupFile], materials: &[Material], diagnostics: &mut Diagnostics) -> Vec<Group> {
    let diameter = |m: &Material| [2.0 * m.section.a1.max(m.section.a2); 2];
    let group = |(i, file): (usize, &GroupFile)| {
        let material = material_index(i, &file.material, materials, diagnostics).unwrap_or(0);
        Group {
            name: file.name.clone(),
            material: material as u32,
            width: file.width_m.unwrap_or_else(|| diameter(&materials[material])),
        }
    };
    if files.is_empty() {
        return vec![Group { name: "hair".into(), material: 0, width: diameter(&materials[0]) }];
    }
    files.iter().enumerate().map(group).collect()
}

/// Index of the material of group `group`.
fn material_index(
    group: usize,
    material: &MaterialRef,
    materials: &[Material],
    diagnostics: &mut Diagnostics,
) -> Option<usize> {
    let (found, message) = match material {
        MaterialRef::Index(index) => {
            let found = Some(*index as usize).filter(|&index| index < materials.len());
            (found, format!("there is no material {index}"))
        }
        MaterialRef::Name(name) => {
            let found = materials.iter().position(|m| m.name == *name);
            (found, format!("there is no material \"{name}\""))
        }
    };
    if found.is_none() {
        let names: Vec<String> = materials.iter().map(|m| format!("\"{}\"", m.name)).collect();
        let allowed = format!("an index below {}, or one of {}", materials.len(), names.join(", "));
        let key = Key::at("groups").index(group).name("material");
        diagnostics.add(&key, message, allowed, "name a material of this file");
    }
    found
}
