//! Colliders and their shapes.

use super::context::Context;
use super::deformation::deformation;
use crate::geometry::{Deformation, Friction, Shape, TriMesh};
use crate::scene::anim::file::{ColliderFile, ShapeFile};
use crate::scene::anim::model::Collider;
use crate::scene::convention::Convention;
use crate::scene::json::diagnostics::Diagnostics;
use crate::scene::json::key::Key;
use nalgebra::Vector3;
use std::sync::Arc;

/// The colliders on the bodies `bodies`; `None` for those with errors.
pub fn colliders(
    context: &mut Context,
    files: Vec<ColliderFile>,
    bodies: &[String],
    head: Option<usize>,
) -> Vec<Option<Collider>> {
    let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
    context.check_unique("colliders", &names);
    let collider = |(i, file): (usize, ColliderFile)| {
        let key = Key::at("colliders").index(i);
        check_name(context.diagnostics, &key.name("name"), &file.name);
        let body = match &file.body {
            Some(name) => context.body_index(&key.name("body"), name, bodies),
            None => head,
        };
        let shape = shape(context, &key.name("shape"), file.shape);
        let (body, (shape, deformation)) = (body?, shape?);
        Some(Collider {
            name: file.name,
            body,
            shape,
            deformation: deformation.map(Arc::new),
            friction: friction(context.diagnostics, &key, file.friction, file.static_friction),
            thickness: file.thickness_m,
        })
    };
    files.into_iter().enumerate().map(collider).collect()
}

/// Checks that the name is a valid USD prim name.
fn check_name(diagnostics: &mut Diagnostics, key: &Key, name: &str) {
    let valid = |(i, c): (usize, char)| c == '_' || c.is_ascii_alphabetic() || (i > 0 && c.is_ascii_digit());
    if name.is_empty() || !name.chars().enumerate().all(valid) {
        let message = format!("invalid name \"{name}\"");
        let allowed = "letters, digits and _, not starting with a digit: a USD prim name";
        diagnostics.add(key, message, allowed, "rename it");
    }
}

fn friction(
    diagnostics: &mut Diagnostics,
    key: &Key,
    kinetic: Option<f64>,
    fixed: Option<f64>,
) -> Option<Friction> {
    if let Some(fixed) = fixed
        && kinetic.is_none_or(|kinetic| fixed < kinetic)
    {
        let (message, allowed) = match kinetic {
            Some(kinetic) => {
                (format!("{fixed} is below `friction`, {kinetic}"), format!("{kinetic} or more"))
            }
            None => {
                ("is given without `friction`".into(), "together with `friction`, and not below it".into())
            }
        };
        let help = "set both, static friction at least as high as kinetic friction";
        diagnostics.add(&key.name("static_friction"), message, allowed, help);
    }
    kinetic.map(|kinetic| Friction::new(kinetic, fixed))
}

/// The shape at `key`, and its deformation.
fn shape(context: &mut Context, key: &Key, file: ShapeFile) -> Option<(Shape, Option<Deformation>)> {
    let convention = context.convention;
    let unit = convention.metres_per_unit;
    let point = |p: [f64; 3]| convention.length_in(p.into());
    let shape = match file {
        ShapeFile::Mesh { file, sequence, metres_per_unit, up_axis } => {
            let convention = Convention {
                metres_per_unit: metres_per_unit.unwrap_or(unit),
                up: up_axis.unwrap_or(convention.up),
            };
            return mesh(context, key, &file, sequence, &convention);
        }
        ShapeFile::Sphere { centre, radius } => {
            Shape::Sphere { centre: point(centre), radius: radius * unit }
        }
        ShapeFile::Capsule { ends, radius } => {
            Shape::Capsule { ends: ends.map(point), radius: radius * unit }
        }
        ShapeFile::Ellipsoid { centre, radii, rotation_wxyz } => {
            let q = context.quaternion(&key.name("rotation_wxyz"), rotation_wxyz)?;
            let rotation = convention.frame_in(q);
            Shape::Ellipsoid { centre: point(centre), radii: Vector3::from(radii) * unit, rotation }
        }
        ShapeFile::Plane { point: p, normal } => {
            let Some(normal) = convention.direction_in(normal.into()).try_normalize(1e-12) else {
                let message = format!("{normal:?} has length 0");
                let help = "give the direction away from the solid side";
                context.diagnostics.add(&key.name("normal"), message, "a length above 0", help);
                return None;
            };
            Shape::Plane { point: point(p), normal }
        }
    };
    Some((shape, None))
}

/// The mesh of the OBJ file `file`, and its deformation.
fn mesh(
    context: &mut Context,
    key: &Key,
    file: &str,
    sequence: Option<String>,
    convention: &Convention,
) -> Option<(Shape, Option<Deformation>)> {
    let path = context.folder.join(file);
    let report = |diagnostics: &mut Diagnostics, what: String| {
        let allowed = "a Wavefront OBJ file with triangles; paths are relative to the folder of this file";
        let help = "correct the path, or export the mesh again";
        diagnostics.add(&key.name("file"), format!("\"{file}\" {what}"), allowed, help);
    };
    let mut mesh = TriMesh::load_obj_with_degenerate(&path, convention)
        .map_err(|what| report(context.diagnostics, what))
        .ok()?;
    let deformation = match sequence {
        Some(pattern) => Some(deformation(context, &key.name("sequence"), &pattern, &mesh, convention)?),
        None => None,
    };
    match mesh.drop_degenerate() {
        Ok(0) => {}
        Ok(dropped) => tracing::warn!("{}: dropped {dropped} triangles without area", path.display()),
        Err(what) => {
            report(context.diagnostics, what);
            return None;
        }
    }
    Some((Shape::Mesh(mesh), deformation))
}
